// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/interlock_gpio.h"

#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "host/drivers/driver.h"

typedef struct contact {
    gonio_contact_config config;
    void *handle;
    gonio_debounce filter;
} contact;

typedef struct interlock {
    const gonio_gpio_io *io;
    void *state;
    contact contacts[GONIO_CONTACTS_MAX];
    int n;
    pthread_mutex_t lock; // of the contacts, and of io
    pthread_cond_t wake;
    pthread_t watcher;
    bool watching, closing;
    double watch_s;
} interlock;

void gonio_interlock_gpio_defaults(gonio_interlock_gpio_config *config) {
    *config = (gonio_interlock_gpio_config){
        .contacts = {{.name = "emergency stop", .normally_closed = true}, {.name = "door", .normally_closed = true}},
        .debounce_s = 0.005,
        .watch_s = 0.05};
    for (int i = 0; i < GONIO_CONTACTS_MAX; i++) {
        config->contacts[i].bias = GONIO_GPIO_PULL_UP;
    }
}

// A normally closed contact to ground: high means open, active. A normally open one: low means closed, active.
static bool is_active(const contact *c, bool level) { return level == c->config.normally_closed; }

static gonio_status look(interlock *device, contact *c, gonio_error *error) {
    gonio_gpio_edge edge;
    int got;
    while ((got = device->io->next_edge(device->state, c->handle, &edge)) > 0) {
        gonio_debounce_edge(&c->filter, is_active(c, edge.rising), edge.time_ns);
    }
    // The time before the level: an edge in between is then only seen as early, never as lost.
    const int64_t now_ns = device->io->now_ns(device->state);
    const int level = got < 0 ? got : device->io->get(device->state, c->handle);
    if (level < 0) {
        return gonio_gpio_fail(level, c->config.line, "cannot be read", error);
    }
    // An edge that came after the queue was emptied explains a level that differs from the last one seen.
    while (is_active(c, level) != c->filter.raw && device->io->next_edge(device->state, c->handle, &edge) > 0) {
        gonio_debounce_edge(&c->filter, is_active(c, edge.rising), edge.time_ns);
    }
    gonio_debounce_level(&c->filter, is_active(c, level), now_ns);
    return GONIO_OK;
}

static gonio_status check(interlock *device, gonio_error *error) {
    char told[256] = "";
    for (int i = 0; i < device->n; i++) {
        contact *c = &device->contacts[i];
        const gonio_status status = look(device, c, error);
        if (status != GONIO_OK) {
            return status;
        }
        if (c->filter.tripped) {
            const size_t length = strlen(told);
            snprintf(told + length, sizeof told - length, "%s%s %s", length > 0 ? ", " : "", c->config.name,
                     c->filter.stable || c->filter.raw ? "is active" : "was active");
        }
        gonio_debounce_clear(&c->filter);
    }
    return told[0] == 0 ? GONIO_OK : gonio_fail(error, GONIO_E_DEVICE, "interlock: %s", told);
}

static gonio_status interlock_check(void *opaque, gonio_error *error) {
    interlock *device = opaque;
    pthread_mutex_lock(&device->lock);
    const gonio_status status = check(device, error);
    pthread_mutex_unlock(&device->lock);
    return status;
}

// ---- reading the levels while nobody asks ----

static struct timespec moment_in(double seconds) {
    struct timespec at;
    clock_gettime(CLOCK_MONOTONIC, &at);
    const long ns = at.tv_nsec + (long)(seconds * 1e9);
    at.tv_sec += ns / 1000000000;
    at.tv_nsec = ns % 1000000000;
    return at;
}

// What it finds waits in the contacts' filters for the next check; a line that cannot be read fails there again.
static void *watch(void *opaque) {
    interlock *device = opaque;
    pthread_mutex_lock(&device->lock);
    while (!device->closing) {
        const struct timespec until = moment_in(device->watch_s);
        while (!device->closing && pthread_cond_timedwait(&device->wake, &device->lock, &until) != ETIMEDOUT) {
        }
        for (int i = 0; i < device->n && !device->closing; i++) {
            look(device, &device->contacts[i], NULL);
        }
    }
    pthread_mutex_unlock(&device->lock);
    return NULL;
}

static gonio_status start_watching(interlock *device, gonio_error *error) {
    if (!(device->watch_s > 0)) {
        return GONIO_OK;
    }
    device->watching = pthread_create(&device->watcher, NULL, watch, device) == 0;
    return device->watching ? GONIO_OK : gonio_fail(error, GONIO_E_FAILED, "no thread to watch the interlock with");
}

static void stop_watching(interlock *device) {
    if (device->watching) {
        pthread_mutex_lock(&device->lock);
        device->closing = true;
        pthread_cond_signal(&device->wake);
        pthread_mutex_unlock(&device->lock);
        pthread_join(device->watcher, NULL);
    }
}

static void interlock_close(void *opaque) {
    interlock *device = opaque;
    stop_watching(device);
    for (int i = 0; i < device->n; i++) {
        device->io->close(device->state, device->contacts[i].handle);
    }
    pthread_cond_destroy(&device->wake);
    pthread_mutex_destroy(&device->lock);
    free(device);
}

const gonio_interlock_ops gonio_interlock_gpio = {.name = "gpio", .check = interlock_check, .close = interlock_close};

static gonio_status open_contact(interlock *device, const gonio_contact_config *config, int64_t hold_ns,
                                 gonio_error *error) {
    contact *c = &device->contacts[device->n];
    c->config = *config;
    int code = device->io->open_input(device->state, config->line, config->bias, &c->handle);
    if (code != 0) {
        return gonio_gpio_fail(code, config->line, "cannot be opened", error);
    }
    device->n++;
    code = device->io->get(device->state, c->handle);
    if (code < 0) {
        return gonio_gpio_fail(code, config->line, "cannot be read", error);
    }
    gonio_debounce_start(&c->filter, is_active(c, code), device->io->now_ns(device->state), hold_ns);
    return GONIO_OK;
}

gonio_status gonio_interlock_gpio_open(const gonio_interlock_gpio_config *config, const gonio_gpio_io *io, void *state,
                                       void **out, gonio_error *error) {
    interlock *device = calloc(1, sizeof *device);
    if (device == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for an interlock");
    }
    device->io = io;
    device->state = state;
    device->watch_s = config->watch_s < 1 ? config->watch_s : 1;
    pthread_mutex_init(&device->lock, NULL);
    pthread_condattr_t monotonic;
    pthread_condattr_init(&monotonic);
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    pthread_cond_init(&device->wake, &monotonic);
    pthread_condattr_destroy(&monotonic);
    for (int i = 0; i < GONIO_CONTACTS_MAX; i++) {
        if (config->contacts[i].line[0] == 0) {
            continue;
        }
        const gonio_status status =
            open_contact(device, &config->contacts[i], (int64_t)(config->debounce_s * 1e9), error);
        if (status != GONIO_OK) {
            interlock_close(device);
            return status;
        }
    }
    const gonio_status status = start_watching(device, error);
    if (status != GONIO_OK) {
        interlock_close(device);
        return status;
    }
    *out = device;
    return GONIO_OK;
}

const gonio_debounce *gonio_interlock_gpio_contact(const void *opaque, int index, const char **name) {
    const interlock *device = opaque;
    if (index < 0 || index >= device->n) {
        return NULL;
    }
    *name = device->contacts[index].config.name;
    return &device->contacts[index].filter;
}

GONIO_KEY_NAMES(no_or_yes, "1", "0") // 1 is false
GONIO_KEY_NAMES(biases, "as-is", "pull-up", "pull-down")
typedef gonio_interlock_gpio_config settings;
#define KEY(text, kind, member) .section = "interlock", GONIO_KEY_NAMED(settings, member, text, kind)
static const gonio_key keys[] = {{KEY("estop_line", LINE, contacts[0].line)},
                                 {KEY("estop_normally_open", BOOLEAN, contacts[0].normally_closed), .names = no_or_yes},
                                 {KEY("estop_bias", CHOICE, contacts[0].bias), .names = biases},
                                 {KEY("door_line", LINE, contacts[1].line)},
                                 {KEY("door_normally_open", BOOLEAN, contacts[1].normally_closed), .names = no_or_yes},
                                 {KEY("door_bias", CHOICE, contacts[1].bias), .names = biases},
                                 {KEY("debounce_ms", REAL, debounce_s), 0, 1000, .times = 1000},
                                 {0}};

static void defaults(void *config) { gonio_interlock_gpio_defaults(config); }

static gonio_status make(void *config, const gonio_driver_context *context, void **device, gonio_error *error) {
    (void)context;
    return gonio_interlock_gpio_open(config, &gonio_gpio_system, NULL, device, error);
}

const gonio_driver gonio_driver_interlock_gpio = {.name = "gpio",
                                                  .device = GONIO_DEVICE_INTERLOCK,
                                                  .summary =
                                                      "emergency stop and door contacts on lines of this computer",
                                                  .keys = keys,
                                                  .settings = sizeof(settings),
                                                  .defaults = defaults,
                                                  .ops = &gonio_interlock_gpio,
                                                  .open = make};
