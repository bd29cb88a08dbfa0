#include "host/drivers/lamp_modbus.h"

#include <math.h>
#include <stdlib.h>

#include "host/drivers/controller_map.h"
#include "host/transport/clock.h"

enum { POLL_MS = 50, PERMYRIAD = 10000 };

typedef struct lamp {
    gonio_controller *controller;
    double shutter_settle_s;
} lamp;

static gonio_status lamp_set_level(void *device, double level, gonio_error *error) {
    const lamp *l = device;
    if (!(level >= 0 && level <= 1)) {
        return gonio_fail(error, GONIO_E_RANGE, "lamp level of %g; expected 0 to 1", level);
    }
    const uint16_t drive = (uint16_t)lround(level * PERMYRIAD);
    gonio_status status = GONIO_OK;
    if (level > 0) {
        status = gonio_controller_write(l->controller, CONTROLLER_lamp_level, 1, &drive, error);
    }
    return status == GONIO_OK ? gonio_controller_coil(l->controller, CONTROLLER_COIL_lamp, level > 0, error) : status;
}

static gonio_status lamp_set_shutter(void *device, bool open, gonio_error *error) {
    const lamp *l = device;
    const gonio_status status = gonio_controller_coil(l->controller, CONTROLLER_COIL_shutter, open, error);
    if (status == GONIO_OK) {
        gonio_clock_sleep_ms((int)(l->shutter_settle_s * 1000));
    }
    return status;
}

static gonio_status lamp_wait_ready(void *device, const gonio_stamp *stamp, double timeout_s, double *waited_s,
                                    gonio_error *error) {
    (void)stamp;
    const lamp *l = device;
    const int64_t start_ms = gonio_clock_ms();
    const gonio_deadline deadline = gonio_deadline_in_s(timeout_s);
    for (;;) {
        gonio_controller_status now;
        gonio_status status = gonio_controller_read_status(l->controller, &now, error);
        if (status == GONIO_OK) {
            status = gonio_controller_alarm(&now, error);
        }
        if (status != GONIO_OK) {
            return status;
        }
        if (now.lamp_state == CONTROLLER_LAMP_READY) {
            *waited_s = (double)(gonio_clock_ms() - start_ms) / 1000;
            return GONIO_OK;
        }
        if (now.lamp_state == CONTROLLER_LAMP_OFF || now.lamp_state == CONTROLLER_LAMP_SAFE) {
            return gonio_fail(error, GONIO_E_DEVICE, "lamp: waiting for warm-up, but it is %s",
                              gonio_controller_lamp_name(now.lamp_state));
        }
        if (gonio_deadline_left_ms(deadline) == 0) {
            return gonio_fail(error, GONIO_E_TIMEOUT, "lamp: still %s after %.1f s",
                              gonio_controller_lamp_name(now.lamp_state), timeout_s);
        }
        gonio_clock_sleep_ms(POLL_MS);
    }
}

// The lamp is left as it is: a warm one need not warm up again.
static void lamp_close(void *device) {
    lamp *l = device;
    gonio_controller_release(l->controller);
    free(l);
}

const gonio_lamp_ops gonio_lamp_modbus = {.api_version = GONIO_RIG_API_VERSION,
                                          .name = "modbus",
                                          .set_level = lamp_set_level,
                                          .set_shutter = lamp_set_shutter,
                                          .wait_ready = lamp_wait_ready,
                                          .close = lamp_close};

gonio_status gonio_lamp_modbus_open(gonio_controller *controller, double shutter_settle_s, void **device,
                                    gonio_error *error) {
    lamp *l = calloc(1, sizeof *l);
    if (l == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a lamp");
    }
    *l = (lamp){gonio_controller_share(controller), shutter_settle_s};
    *device = l;
    return GONIO_OK;
}

// ---- monitor ----

typedef struct monitor {
    gonio_controller *controller;
    double scale, relative_sigma;
    int64_t last_us; // the controller's time of the last mean that was used
} monitor;

// A mean whose middle lies after the one used last: the controller averages over and over.
static gonio_status next_mean(monitor *m, double *value, gonio_error *error) {
    const gonio_deadline deadline = gonio_deadline_in_s(5); // 4096 readings, one a ms, is the most it averages
    for (;;) {
        gonio_controller_status now;
        const gonio_status status = gonio_controller_read_status(m->controller, &now, error);
        if (status != GONIO_OK) {
            return status;
        }
        if (now.monitor_us > m->last_us) {
            m->last_us = now.monitor_us;
            *value = now.monitor;
            return GONIO_OK;
        }
        if (gonio_deadline_left_ms(deadline) == 0) {
            return gonio_fail(error, GONIO_E_TIMEOUT, "monitor: no new reading");
        }
        gonio_clock_sleep_ms(10);
    }
}

static gonio_status monitor_read(void *device, const gonio_stamp *stamp, double integration_s, double *value,
                                 double *sigma, gonio_error *error) {
    (void)stamp;
    monitor *m = device;
    gonio_controller_status now;
    gonio_status status = gonio_controller_read_status(m->controller, &now, error);
    if (status != GONIO_OK) {
        return status;
    }
    m->last_us = now.time_us; // only light from now on counts
    const gonio_deadline deadline = gonio_deadline_in_s(integration_s);
    double mean = 0, squares = 0;
    int n = 0;
    do {
        double reading = 0;
        status = next_mean(m, &reading, error);
        if (status != GONIO_OK) {
            return status;
        }
        const double delta = reading - mean;
        mean += delta / ++n;
        squares += delta * (reading - mean);
    } while (gonio_deadline_left_ms(deadline) > 0);
    const double scatter = n > 1 ? sqrt(squares / (n - 1) / n) : 0;
    *value = mean * m->scale;
    *sigma = fabs(m->scale) * hypot(scatter, m->relative_sigma * mean);
    return GONIO_OK;
}

static void monitor_close(void *device) {
    monitor *m = device;
    gonio_controller_release(m->controller);
    free(m);
}

const gonio_meter_ops gonio_meter_modbus = {
    .api_version = GONIO_RIG_API_VERSION, .name = "modbus", .read = monitor_read, .close = monitor_close};

gonio_status gonio_meter_modbus_open(gonio_controller *controller, double scale, double relative_sigma, void **device,
                                     gonio_error *error) {
    monitor *m = calloc(1, sizeof *m);
    if (m == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a meter");
    }
    *m = (monitor){gonio_controller_share(controller), scale, relative_sigma, 0};
    *device = m;
    return GONIO_OK;
}
