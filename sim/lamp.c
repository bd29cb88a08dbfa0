// SPDX-License-Identifier: BSD-3-Clause
// The lamp, its shutter and its monitor photodiode, which looks at the lamp before the shutter. Warm-up is counted from
// the session's clock 0, when the lamp was cold.
#include <math.h>

#include "sim/internal.h"
#include "sim/random.h"

// Where the warm-up counts as over: far below the drift that is stated.
#define WARM 1e-4
// The monitor's own floor, relative to the nominal output; a dark lamp reads about this.
#define METER_FLOOR 1e-6

double gonio_sim_lamp_curve(const gonio_sim *sim, double clock_s) {
    const double warm = 1 - sim->settings.lamp.warm_up_percent / 100 * exp(-clock_s / sim->settings.lamp.warm_up_s);
    double wander = 0;
    for (int k = 0; k < SIM_WANDER_TERMS; k++) {
        wander += sin(sim->truth.wander_rad_per_s[k] * clock_s + sim->truth.wander_rad[k]);
    }
    const double drift = 1 + sim->truth.drift_per_s * clock_s + sim->truth.wander_amplitude * wander;
    return sim->lamp_level * warm * fmax(0, drift);
}

double gonio_sim_lamp_output(gonio_sim *sim, const gonio_stamp *stamp, double after_s) {
    return gonio_sim_fault_strikes(sim, SIM_FAULT_LAMP_OFF, stamp)
               ? 0
               : gonio_sim_lamp_curve(sim, stamp->clock_s + after_s);
}

static gonio_status lamp_set_level(void *device, double level, gonio_error *error) {
    gonio_sim *sim = device;
    if (!(level >= 0 && level <= 1)) {
        return gonio_fail(error, GONIO_E_RANGE, "lamp level %g; 0 to 1 is possible", level);
    }
    sim->lamp_level = level;
    return GONIO_OK;
}

static gonio_status lamp_set_shutter(void *device, bool open, gonio_error *error) {
    (void)error;
    ((gonio_sim *)device)->shutter_open = open;
    return GONIO_OK;
}

static gonio_status lamp_wait_ready(void *device, const gonio_stamp *stamp, double timeout_s, double *waited_s,
                                    gonio_error *error) {
    gonio_sim *sim = device;
    *waited_s = 0;
    if (sim->lamp_level == 0) {
        return gonio_fail(error, GONIO_E_DEVICE, "lamp: it is switched off and will not get warm");
    }
    const double amplitude = sim->settings.lamp.warm_up_percent / 100;
    const double ready_s = amplitude > WARM ? sim->settings.lamp.warm_up_s * log(amplitude / WARM) : 0;
    const double wait_s = fmax(0, ready_s - stamp->clock_s);
    if (wait_s > timeout_s) {
        return gonio_fail(error, GONIO_E_TIMEOUT, "lamp: not ready within %g s; its warm-up takes another %g s",
                          timeout_s, wait_s);
    }
    *waited_s = wait_s;
    return GONIO_OK;
}

static gonio_status meter_read(void *device, const gonio_stamp *stamp, double integration_s, double *value,
                               double *sigma, gonio_error *error) {
    gonio_sim *sim = device;
    if (gonio_sim_fault_strikes(sim, SIM_FAULT_METER_ERROR, stamp)) {
        return gonio_fail(error, GONIO_E_DEVICE, "meter: no reading at pose %lld, frame %d", (long long)stamp->pose,
                          (int)stamp->frame);
    }
    const double output = gonio_sim_lamp_output(sim, stamp, integration_s / 2);
    *sigma = hypot(sim->settings.meter.noise_percent / 100 * output, METER_FLOOR);
    *value = output + *sigma * gonio_sim_normal(sim->seed, SIM_METER, stamp->pose, stamp->frame, 0);
    return GONIO_OK;
}

static void nothing_to_close(void *device) { (void)device; }

const gonio_lamp_ops gonio_sim_lamp_ops = {.name = "simulated lamp",
                                           .set_level = lamp_set_level,
                                           .set_shutter = lamp_set_shutter,
                                           .wait_ready = lamp_wait_ready,
                                           .close = nothing_to_close};
const gonio_meter_ops gonio_sim_meter_ops = {
    .name = "simulated lamp monitor", .read = meter_read, .close = nothing_to_close};
