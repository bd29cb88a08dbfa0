// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/lamp_modbus.h"

#include <math.h>
#include <stdlib.h>

#include "host/drivers/controller_map.h"
#include "host/drivers/driver.h"
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
        status = status == GONIO_OK ? gonio_controller_alarm(&now, error) : status;
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
        if (gonio_controller_cancelled(l->controller)) {
            return gonio_fail(error, GONIO_E_INTERRUPTED, "interrupted while the lamp warms up");
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

const gonio_lamp_ops gonio_lamp_modbus = {.name = "modbus",
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

typedef struct settings {
    double shutter_settle_s;
} settings;
static const gonio_key keys[] = {{.section = "lamp", GONIO_KEY(settings, shutter_settle_s, REAL), 0, 60}, {0}};

static void defaults(void *config) { ((settings *)config)->shutter_settle_s = GONIO_SHUTTER_SETTLE_S; }

static gonio_status make(void *config, const gonio_driver_context *context, void **device, gonio_error *error) {
    return gonio_lamp_modbus_open(context->controller, ((const settings *)config)->shutter_settle_s, device, error);
}

const gonio_driver gonio_driver_lamp_modbus = {.name = "modbus",
                                               .device = GONIO_DEVICE_LAMP,
                                               .summary = "lamp and shutter behind the controller",
                                               .keys = keys,
                                               .settings = sizeof(settings),
                                               .defaults = defaults,
                                               .controller = true,
                                               .ops = &gonio_lamp_modbus,
                                               .open = make};
