// SPDX-License-Identifier: BSD-3-Clause
// GPIO lines of the host by libgpiod 1.6, behind a table so that a test can stand in for the kernel.
#ifndef GONIO_TRANSPORT_GPIO_H
#define GONIO_TRANSPORT_GPIO_H

#include <stdbool.h>
#include <stdint.h>

#include "gonio/status.h"

typedef enum gonio_gpio_bias { GONIO_GPIO_AS_IS, GONIO_GPIO_PULL_UP, GONIO_GPIO_PULL_DOWN } gonio_gpio_bias;

typedef struct gonio_gpio_edge {
    bool rising;     // of the physical level
    int64_t time_ns; // CLOCK_MONOTONIC
} gonio_gpio_edge;

// `line` is a line's name ("estop") or chip and offset ("gpiochip0:17"). Each returns a negative errno on failure.
typedef struct gonio_gpio_io {
    int (*open_input)(void *state, const char *line, gonio_gpio_bias bias, void **handle); // both edges are reported
    int (*open_output)(void *state, const char *line, bool initial, void **handle);
    int (*get)(void *state, void *handle); // physical level, 0 or 1
    int (*set)(void *state, void *handle, bool level);
    int (*next_edge)(void *state, void *handle, gonio_gpio_edge *edge); // 1: one was waiting, 0: none
    void (*close)(void *state, void *handle);                           // an output keeps its level where the chip does
    int64_t (*now_ns)(void *state);
} gonio_gpio_io;

extern const gonio_gpio_io gonio_gpio_system; // state: not used

// Fill *error for a failed call on `line`; returns GONIO_E_DEVICE.
gonio_status gonio_gpio_fail(int code, const char *line, const char *what, gonio_error *error);

#endif
