// SPDX-License-Identifier: BSD-3-Clause
#include "host/transport/gpio.h"

#include <errno.h>
#include <gpiod.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/clock.h"

#define CONSUMER "gonio"

typedef struct line {
    struct gpiod_chip *chip;
    struct gpiod_line *line;
} line;

// By chip and offset where there is a colon followed by a number, else by name.
static int find_line(const char *text, line *found) {
    const char *colon = strrchr(text, ':');
    char *end = NULL;
    const unsigned long offset = colon != NULL ? strtoul(colon + 1, &end, 10) : 0;
    if (colon != NULL && end != colon + 1 && *end == 0) {
        char *chip = strndup(text, (size_t)(colon - text));
        if (chip == NULL) {
            return -ENOMEM;
        }
        found->chip = gpiod_chip_open_lookup(chip);
        free(chip);
        if (found->chip == NULL) {
            return errno != 0 ? -errno : -ENODEV;
        }
        found->line = gpiod_chip_get_line(found->chip, (unsigned)offset);
    } else {
        found->line = gpiod_line_find(text);
        found->chip = found->line != NULL ? gpiod_line_get_chip(found->line) : NULL;
    }
    if (found->line == NULL) {
        const int code = errno != 0 ? -errno : -ENOENT;
        if (found->chip != NULL) {
            gpiod_chip_close(found->chip);
        }
        return code;
    }
    return 0;
}

static int open_line(const char *text, const struct gpiod_line_request_config *config, int initial, void **handle) {
    line *found = calloc(1, sizeof *found);
    if (found == NULL) {
        return -ENOMEM;
    }
    errno = 0;
    int code = find_line(text, found);
    if (code == 0 && gpiod_line_request(found->line, config, initial) != 0) {
        code = -errno;
        gpiod_chip_close(found->chip);
    }
    if (code != 0) {
        free(found);
        return code;
    }
    *handle = found;
    return 0;
}

static int system_open_input(void *state, const char *text, gonio_gpio_bias bias, void **handle) {
    (void)state;
    const int flags[] = {[GONIO_GPIO_AS_IS] = 0,
                         [GONIO_GPIO_PULL_UP] = GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP,
                         [GONIO_GPIO_PULL_DOWN] = GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_DOWN};
    const struct gpiod_line_request_config config = {
        .consumer = CONSUMER, .request_type = GPIOD_LINE_REQUEST_EVENT_BOTH_EDGES, .flags = flags[bias]};
    return open_line(text, &config, 0, handle);
}

static int system_open_output(void *state, const char *text, bool initial, void **handle) {
    (void)state;
    const struct gpiod_line_request_config config = {.consumer = CONSUMER,
                                                     .request_type = GPIOD_LINE_REQUEST_DIRECTION_OUTPUT};
    return open_line(text, &config, initial, handle);
}

static int system_get(void *state, void *handle) {
    (void)state;
    const int level = gpiod_line_get_value(((line *)handle)->line);
    return level < 0 ? -errno : level;
}

static int system_set(void *state, void *handle, bool level) {
    (void)state;
    return gpiod_line_set_value(((line *)handle)->line, level) < 0 ? -errno : 0;
}

static int system_next_edge(void *state, void *handle, gonio_gpio_edge *edge) {
    (void)state;
    struct gpiod_line *l = ((line *)handle)->line;
    const struct timespec now = {0};
    const int waiting = gpiod_line_event_wait(l, &now);
    if (waiting <= 0) {
        return waiting < 0 ? -errno : 0;
    }
    struct gpiod_line_event event;
    if (gpiod_line_event_read(l, &event) != 0) {
        return -errno;
    }
    *edge = (gonio_gpio_edge){event.event_type == GPIOD_LINE_EVENT_RISING_EDGE,
                              (int64_t)event.ts.tv_sec * 1000000000 + event.ts.tv_nsec};
    return 1;
}

static void system_close(void *state, void *handle) {
    (void)state;
    line *l = handle;
    if (l != NULL) {
        gpiod_line_release(l->line);
        gpiod_chip_close(l->chip);
        free(l);
    }
}

static int64_t system_now(void *state) {
    (void)state;
    return gonio_clock_ns();
}

const gonio_gpio_io gonio_gpio_system = {system_open_input, system_open_output, system_get, system_set,
                                         system_next_edge,  system_close,       system_now};

gonio_status gonio_gpio_fail(int code, const char *line, const char *what, gonio_error *error) {
    return gonio_fail(error, GONIO_E_DEVICE, "GPIO line '%s': %s: %s%s", line, what, strerror(-code),
                      code == -EACCES  ? " (the user must be in the group gpio)"
                      : code == -EBUSY ? " (another program holds it)"
                                       : "");
}
