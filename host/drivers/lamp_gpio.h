// SPDX-License-Identifier: BSD-3-Clause
// Lamp enable, shutter and camera trigger on GPIO lines of the host.
#ifndef GONIO_DRIVERS_LAMP_GPIO_H
#define GONIO_DRIVERS_LAMP_GPIO_H

#include "gonio/rig.h"
#include "host/transport/gpio.h"

typedef struct gonio_lamp_gpio_config {
    char enable_line[64], shutter_line[64]; // empty: not wired
    bool enable_low, shutter_low;           // a low level switches on, opens
    double warm_up_s, shutter_settle_s;
    bool (*cancelled)(void *context); // asked while the lamp warms up; true ends it. NULL: never
    void *cancelled_context;
} gonio_lamp_gpio_config;

extern const gonio_lamp_ops gonio_lamp_gpio;
// Opens with lamp off and shutter closed. Levels other than 0 and 1 are GONIO_E_RANGE.
gonio_status gonio_lamp_gpio_open(const gonio_lamp_gpio_config *config, const gonio_gpio_io *io, void *state,
                                  void **device, gonio_error *error);

// A pulse for the camera: wait settle_s (the stage came to rest just now), then pulse_s active.
typedef struct gonio_trigger_gpio {
    const gonio_gpio_io *io;
    void *state, *handle;
    char line[64];
    bool low;
    double settle_s, pulse_s;
} gonio_trigger_gpio;
// io, state, line, low, settle_s and pulse_s are set by the caller; the line rests inactive.
gonio_status gonio_trigger_gpio_open(gonio_trigger_gpio *trigger, gonio_error *error);
gonio_status gonio_trigger_gpio_fire(void *trigger, gonio_error *error);
void gonio_trigger_gpio_close(gonio_trigger_gpio *trigger);

#endif
