// SPDX-License-Identifier: BSD-3-Clause
// A connection's life: opening, settling in, feeding the dead-man, sharing, closing.
#include "host/drivers/controller_internal.h"

#include <errno.h>
#include <stdlib.h>
#include <time.h>

#include "host/transport/clock.h"

void gonio_controller_defaults(gonio_controller_config *config) {
    *config = (gonio_controller_config){.retries = 6, .deadman_s = 5, .feed_s = 600, .replug_s = 10};
    gonio_modbus_defaults(&config->modbus);
}

static gonio_status set_deadman(gonio_controller *c, double seconds, gonio_error *error) {
    uint16_t words[CONTROLLER_SIZE_deadman];
    gonio_controller_pack(words, CONTROLLER_SIZE_deadman, (int64_t)(seconds * 1000));
    return gonio_controller_write(c, CONTROLLER_deadman, CONTROLLER_SIZE_deadman, words, error);
}

// A status read now and then, so that the controller knows that the host lives.
static void *feed(void *argument) {
    gonio_controller *c = argument;
    const int64_t period_ms = (int64_t)(c->config.deadman_s * 1000 / 4);
    pthread_mutex_lock(&c->lock);
    while (!c->closing) {
        struct timespec until;
        clock_gettime(CLOCK_MONOTONIC, &until);
        until.tv_sec += (until.tv_nsec + period_ms % 1000 * 1000000) / 1000000000 + period_ms / 1000;
        until.tv_nsec = (until.tv_nsec + period_ms % 1000 * 1000000) % 1000000000;
        while (!c->closing && pthread_cond_timedwait(&c->wake, &c->lock, &until) != ETIMEDOUT) {
        }
        const int64_t now_ms = gonio_clock_ms();
        if (c->closing || now_ms - c->last_exchange_ms < period_ms ||
            (double)(now_ms - c->last_call_ms) > c->config.feed_s * 1000) {
            continue;
        }
        gonio_modbus_mute(c->modbus, true); // not on the tape: its moment is chance
        const gonio_modbus_fault fault = gonio_controller_feed(c);
        if (fault == GONIO_MODBUS_SILENT || fault == GONIO_MODBUS_NOISE) {
            gonio_modbus_drain(c->modbus, c->config.modbus.timeout_ms);
        }
        gonio_modbus_mute(c->modbus, false);
        c->counts.feeds++;
        c->last_exchange_ms = fault == GONIO_MODBUS_GOOD ? gonio_clock_ms() : c->last_exchange_ms;
    }
    pthread_mutex_unlock(&c->lock);
    return NULL;
}

static gonio_status start_feeding(gonio_controller *c, gonio_error *error) {
    if (c->config.mode == GONIO_TAPE_REPLAY || !(c->config.deadman_s > 0)) {
        return GONIO_OK;
    }
    if (pthread_create(&c->feeder, NULL, feed, c) != 0) {
        return gonio_fail(error, GONIO_E_FAILED, "no thread to feed the controller's dead-man with");
    }
    c->feeding = true;
    return GONIO_OK;
}

static void stop_feeding(gonio_controller *c) {
    if (!c->feeding) {
        return;
    }
    pthread_mutex_lock(&c->lock);
    c->closing = true;
    pthread_cond_signal(&c->wake);
    pthread_mutex_unlock(&c->lock);
    pthread_join(c->feeder, NULL);
    c->feeding = false;
}

static void destroy(gonio_controller *c) {
    stop_feeding(c);
    gonio_modbus_close(c->modbus);
    pthread_cond_destroy(&c->wake);
    pthread_mutex_destroy(&c->lock);
    pthread_mutex_destroy(&c->last_lock);
    free(c);
}

// What must hold before anything is asked for: nothing moves, and a dead-man alarm of an earlier host is gone.
static gonio_status settle_in(gonio_controller *c, gonio_error *error) {
    gonio_controller_status status;
    gonio_status result = gonio_controller_read_status(c, &status, error);
    if (result != GONIO_OK) {
        return result;
    }
    c->last_id = status.accepted_id;
    if (status.state == CONTROLLER_STATE_MOVING || status.state == CONTROLLER_STATE_HOMING) {
        result = gonio_controller_command(c, CONTROLLER_COMMAND_STOP, 0, NULL, NULL, error);
        gonio_controller_tell(c, "stopped", "an earlier host had left the axes moving");
        for (int i = 0; i < 500 && result == GONIO_OK && status.state != CONTROLLER_STATE_IDLE; i++) {
            gonio_controller_pause(c, 20);
            result = gonio_controller_read_status(c, &status, error);
        }
    }
    if (result == GONIO_OK && status.state == CONTROLLER_STATE_ALARM && status.alarm == CONTROLLER_ALARM_DEADMAN) {
        result = gonio_controller_clear(c, error);
    } else if (result == GONIO_OK && status.state == CONTROLLER_STATE_IDLE) {
        // Nothing to clear: it only makes the controller hold an id that a restart forgets.
        result = gonio_controller_command(c, CONTROLLER_COMMAND_CLEAR, 0, NULL, NULL, error);
    }
    return result == GONIO_OK ? set_deadman(c, c->config.deadman_s, error) : result;
}

gonio_status gonio_controller_open(const gonio_controller_config *config, gonio_controller **out, gonio_error *error) {
    gonio_controller *c = calloc(1, sizeof *c);
    if (c == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a controller");
    }
    c->config = *config;
    c->users = 1;
    pthread_mutex_init(&c->lock, NULL);
    pthread_mutex_init(&c->last_lock, NULL);
    pthread_condattr_t monotonic;
    pthread_condattr_init(&monotonic);
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    pthread_cond_init(&c->wake, &monotonic);
    pthread_condattr_destroy(&monotonic);
    gonio_status status = gonio_modbus_open(&config->modbus, config->tape, config->mode, &c->modbus, error);
    if (status == GONIO_OK) {
        gonio_modbus_drain(c->modbus, 20);
        status = gonio_controller_greet(c, error);
    }
    status = status == GONIO_OK ? settle_in(c, error) : status;
    status = status == GONIO_OK ? start_feeding(c, error) : status;
    if (status != GONIO_OK) {
        destroy(c);
        return status;
    }
    *out = c;
    return GONIO_OK;
}

gonio_controller *gonio_controller_share(gonio_controller *c) {
    c->users++;
    return c;
}

void gonio_controller_release(gonio_controller *c) {
    if (c == NULL || --c->users > 0) {
        return;
    }
    stop_feeding(c);
    gonio_controller_status status;
    if (gonio_controller_read_status(c, &status, NULL) == GONIO_OK && status.state == CONTROLLER_STATE_IDLE) {
        set_deadman(c, 0, NULL); // else it would switch the lamp off that is to stay as it is
    }
    destroy(c);
}

const gonio_controller_identity *gonio_controller_identify(const gonio_controller *c) { return &c->identity; }

void gonio_controller_count(gonio_controller *c, gonio_controller_counts *counts) {
    pthread_mutex_lock(&c->lock);
    *counts = c->counts;
    pthread_mutex_unlock(&c->lock);
}
