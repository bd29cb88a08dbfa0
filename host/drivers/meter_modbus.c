// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/meter_modbus.h"

#include <math.h>
#include <stdlib.h>

#include "host/drivers/driver.h"
#include "host/transport/clock.h"

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

const gonio_meter_ops gonio_meter_modbus = {.name = "modbus", .read = monitor_read, .close = monitor_close};

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

typedef struct settings {
    double scale, relative_sigma;
} settings;
static const gonio_key keys[] = {
    {.section = "meter", GONIO_KEY(settings, scale, REAL), -1e30, 1e30},
    {.section = "meter", GONIO_KEY_NAMED(settings, relative_sigma, "sigma_percent", REAL), 0, 100, .times = 100},
    {0}};

static void defaults(void *config) { *(settings *)config = (settings){.scale = 1, .relative_sigma = 0.005}; }

static gonio_status make(void *config, const gonio_driver_context *context, void **device, gonio_error *error) {
    const settings *s = config;
    return gonio_meter_modbus_open(context->controller, s->scale, s->relative_sigma, device, error);
}

const gonio_driver gonio_driver_meter_modbus = {.name = "modbus",
                                                .device = GONIO_DEVICE_METER,
                                                .summary = "the controller's photodiode, which watches the lamp",
                                                .keys = keys,
                                                .settings = sizeof(settings),
                                                .defaults = defaults,
                                                .controller = true,
                                                .ops = &gonio_meter_modbus,
                                                .open = make};
