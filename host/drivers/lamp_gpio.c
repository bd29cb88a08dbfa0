// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/lamp_gpio.h"

#include <stdlib.h>

#include "host/drivers/driver.h"
#include "host/transport/clock.h"

#define LOOK_MS 100

typedef struct lamp {
    gonio_lamp_gpio_config config;
    const gonio_gpio_io *io;
    void *state, *enable, *shutter;
    bool on;
    int64_t on_since_ms;
} lamp;

static gonio_status drive(const lamp *l, void *handle, const char *line, bool level, gonio_error *error) {
    const int code = handle != NULL ? l->io->set(l->state, handle, level) : 0;
    return code == 0 ? GONIO_OK : gonio_gpio_fail(code, line, "cannot be set", error);
}

static gonio_status lamp_set_level(void *device, double level, gonio_error *error) {
    lamp *l = device;
    if (level != 0 && level != 1) {
        return gonio_fail(error, GONIO_E_RANGE, "a lamp on a GPIO line has the levels 0 and 1, found %g", level);
    }
    const gonio_status status = drive(l, l->enable, l->config.enable_line, (level == 1) != l->config.enable_low, error);
    if (status == GONIO_OK && (level == 1) != l->on) {
        l->on = level == 1;
        l->on_since_ms = gonio_clock_ms();
    }
    return status;
}

static gonio_status lamp_set_shutter(void *device, bool open, gonio_error *error) {
    lamp *l = device;
    const gonio_status status = drive(l, l->shutter, l->config.shutter_line, open != l->config.shutter_low, error);
    if (status == GONIO_OK) {
        gonio_clock_sleep_ms((int)(l->config.shutter_settle_s * 1000));
    }
    return status;
}

static gonio_status lamp_wait_ready(void *device, const gonio_stamp *stamp, double timeout_s, double *waited_s,
                                    gonio_error *error) {
    (void)stamp;
    const lamp *l = device;
    if (!l->on) {
        return gonio_fail(error, GONIO_E_DEVICE, "lamp: waiting for warm-up, but it is off");
    }
    const int64_t start_ms = gonio_clock_ms();
    const int64_t left_ms = l->on_since_ms + (int64_t)(l->config.warm_up_s * 1000) - start_ms;
    if ((double)left_ms > timeout_s * 1000) {
        return gonio_fail(error, GONIO_E_TIMEOUT, "lamp: warm-up takes %.1f s more, allowed were %.1f s",
                          (double)left_ms / 1000, timeout_s);
    }
    const gonio_deadline warm = gonio_deadline_in_ms(left_ms > 0 ? left_ms : 0);
    while (gonio_deadline_left_ms(warm) > 0) {
        if (l->config.cancelled != NULL && l->config.cancelled(l->config.cancelled_context)) {
            return gonio_fail(error, GONIO_E_INTERRUPTED, "interrupted while the lamp warms up");
        }
        gonio_clock_sleep_ms(gonio_deadline_left_ms(warm) < LOOK_MS ? gonio_deadline_left_ms(warm) : LOOK_MS);
    }
    *waited_s = (double)(gonio_clock_ms() - start_ms) / 1000;
    return GONIO_OK;
}

// The lines are given back as they are: a lamp left on stays warm for the next run.
static void lamp_close(void *device) {
    lamp *l = device;
    l->io->close(l->state, l->enable);
    l->io->close(l->state, l->shutter);
    free(l);
}

const gonio_lamp_ops gonio_lamp_gpio = {.name = "gpio",
                                        .set_level = lamp_set_level,
                                        .set_shutter = lamp_set_shutter,
                                        .wait_ready = lamp_wait_ready,
                                        .close = lamp_close};

static gonio_status open_output(const gonio_gpio_io *io, void *state, const char *line, bool low, void **handle,
                                gonio_error *error) {
    const int code = line[0] != 0 ? io->open_output(state, line, low, handle) : 0;
    return code == 0 ? GONIO_OK : gonio_gpio_fail(code, line, "cannot be opened", error);
}

gonio_status gonio_lamp_gpio_open(const gonio_lamp_gpio_config *config, const gonio_gpio_io *io, void *state,
                                  void **device, gonio_error *error) {
    lamp *l = calloc(1, sizeof *l);
    if (l == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a lamp");
    }
    *l = (lamp){.config = *config, .io = io, .state = state};
    gonio_status status = open_output(io, state, config->enable_line, config->enable_low, &l->enable, error);
    if (status == GONIO_OK) {
        status = open_output(io, state, config->shutter_line, config->shutter_low, &l->shutter, error);
    }
    if (status != GONIO_OK) {
        lamp_close(l);
        return status;
    }
    *device = l;
    return GONIO_OK;
}

gonio_status gonio_trigger_gpio_open(gonio_trigger_gpio *t, gonio_error *error) {
    t->handle = NULL;
    return open_output(t->io, t->state, t->line, t->low, &t->handle, error);
}

gonio_status gonio_trigger_gpio_fire(void *trigger, gonio_error *error) {
    const gonio_trigger_gpio *t = trigger;
    gonio_clock_sleep_ms((int)(t->settle_s * 1000));
    int code = t->io->set(t->state, t->handle, !t->low);
    if (code == 0) {
        gonio_clock_sleep_ms((int)(t->pulse_s * 1000) + 1);
        code = t->io->set(t->state, t->handle, t->low);
    }
    return code == 0 ? GONIO_OK : gonio_gpio_fail(code, t->line, "cannot be set", error);
}

void gonio_trigger_gpio_close(gonio_trigger_gpio *t) {
    t->io->close(t->state, t->handle);
    t->handle = NULL;
}

typedef gonio_lamp_gpio_config settings;
#define KEY(text, kind, member) .section = "lamp", GONIO_KEY_NAMED(settings, member, text, kind)
static const gonio_key keys[] = {{KEY("enable_line", LINE, enable_line)},
                                 {KEY("enable_low", BOOLEAN, enable_low)},
                                 {KEY("shutter_line", LINE, shutter_line)},
                                 {KEY("shutter_low", BOOLEAN, shutter_low)},
                                 {KEY("shutter_settle_s", REAL, shutter_settle_s), 0, 60},
                                 {KEY("warm_up_s", REAL, warm_up_s), 0, 1e5, .shared = true},
                                 {0}};

static void defaults(void *config) { ((settings *)config)->shutter_settle_s = GONIO_SHUTTER_SETTLE_S; }

static gonio_status make(void *config, const gonio_driver_context *context, void **device, gonio_error *error) {
    settings *s = config;
    s->cancelled = context->cancelled;
    s->cancelled_context = context->event_context;
    return gonio_lamp_gpio_open(config, &gonio_gpio_system, NULL, device, error);
}

const gonio_driver gonio_driver_lamp_gpio = {.name = "gpio",
                                             .device = GONIO_DEVICE_LAMP,
                                             .summary = "lamp and shutter on lines of this computer",
                                             .keys = keys,
                                             .settings = sizeof(settings),
                                             .defaults = defaults,
                                             .ops = &gonio_lamp_gpio,
                                             .open = make};
