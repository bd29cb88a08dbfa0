// SPDX-License-Identifier: BSD-3-Clause
// A connection's life: opening, holding the rig, feeding the dead-man, sharing, closing.
#include "host/drivers/controller_internal.h"

#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "host/transport/clock.h"

void gonio_controller_defaults(gonio_controller_config *config) {
    *config = (gonio_controller_config){.retries = 6, .deadman_s = 5, .feed_s = 600, .replug_s = 10};
    gonio_modbus_defaults(&config->modbus);
    gonio_controller_parameters_defaults(&config->parameters);
}

bool gonio_controller_gives(const gonio_controller *c, int address) {
    return gonio_controller_parameters_give(&c->config.parameters, address);
}

static gonio_status set_deadman(gonio_controller *c, double seconds, gonio_error *error) {
    uint16_t words[CONTROLLER_SIZE_deadman];
    gonio_controller_pack(words, CONTROLLER_SIZE_deadman, (int64_t)(seconds * 1000));
    return gonio_controller_write(c, CONTROLLER_deadman, CONTROLLER_SIZE_deadman, words, error);
}

// Now and then, so that the controller knows that the host lives: without a dead-man, that it still holds the rig.
static void *feed(void *argument) {
    gonio_controller *c = argument;
    const int64_t period_ms = gonio_controller_feed_period_ms(c);
    pthread_mutex_lock(&c->lock);
    while (!c->closing) {
        struct timespec until;
        clock_gettime(CLOCK_MONOTONIC, &until);
        until.tv_sec += (until.tv_nsec + period_ms % 1000 * 1000000) / 1000000000 + period_ms / 1000;
        until.tv_nsec = (until.tv_nsec + period_ms % 1000 * 1000000) % 1000000000;
        while (!c->closing && pthread_cond_timedwait(&c->wake, &c->lock, &until) != ETIMEDOUT) {
        }
        if (!c->closing && (double)(gonio_clock_ms() - c->last_call_ms) <= c->config.feed_s * 1000) {
            gonio_controller_feed_when_due(c);
        }
    }
    pthread_mutex_unlock(&c->lock);
    return NULL;
}

static gonio_status start_feeding(gonio_controller *c, gonio_error *error) {
    if (c->config.mode == GONIO_TAPE_REPLAY) {
        return GONIO_OK;
    }
    c->feeding = true; // before the thread looks at it
    if (pthread_create(&c->feeder, NULL, feed, c) == 0) {
        return GONIO_OK;
    }
    c->feeding = false;
    return gonio_fail(error, GONIO_E_FAILED, "no thread to feed the controller's dead-man with");
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

// ---- holding the rig ----

// Where this process runs: a process number tells nothing about one elsewhere. 9 bits.
static uint32_t place_hash(void) {
    char name[256] = "";
    struct stat space = {0};
    gethostname(name, sizeof name - 1);
    if (stat("/proc/self/ns/pid", &space) == 0) {
        const size_t used = strlen(name);
        snprintf(name + used, sizeof name - used, " %llu", (unsigned long long)space.st_ino);
    }
    uint32_t hash = 2166136261u; // FNV-1a
    for (const char *p = name; *p != 0; p++) {
        hash = (hash ^ (uint8_t)*p) * 16777619u;
    }
    return (hash ^ hash >> 9 ^ hash >> 18) & 511;
}

enum { PROCESS_BITS = 22 };

// Place and process, so that the next program can tell that the one before is dead. On a tape, and from one, always the
// same.
static uint32_t own_number(const gonio_controller_config *config) {
    return config->mode != GONIO_TAPE_OFF
               ? 1
               : (uint32_t)1 << 31 | place_hash() << PROCESS_BITS | ((uint32_t)getpid() & ((1u << PROCESS_BITS) - 1));
}

// A program of this computer that is no more: it will not speak again, and need not be waited for.
static bool is_dead(uint32_t number) {
    const uint32_t process = number & ((1u << PROCESS_BITS) - 1);
    return number >> 31 != 0 && (number >> PROCESS_BITS & 511) == place_hash() && process > 0 &&
           kill((pid_t)process, 0) != 0 && errno == ESRCH;
}

static gonio_modbus_fault once_heartbeat(gonio_controller *c, void *request) {
    (void)request;
    return gonio_controller_feed(c);
}

// Claim the rig. Where a program holds it that has died here, go on under its number.
static gonio_status take(gonio_controller *c, gonio_controller_status *status, gonio_error *error) {
    gonio_status result = gonio_controller_read_status(c, status, error);
    if (result != GONIO_OK) {
        return result;
    }
    if (status->owner != 0 && status->owner != c->number && is_dead(status->owner)) {
        c->number = status->owner;
    }
    int exception = 0;
    result = gonio_controller_request(c, "claiming the rig", once_heartbeat, NULL, &exception, error);
    if (result != GONIO_OK && exception != 0) {
        return gonio_fail(
            error, GONIO_E_DEVICE,
            "controller %s: another program drives this rig; where that one has died, wait as long as the "
            "dead-man does",
            c->config.modbus.port);
    }
    c->holds = result == GONIO_OK;
    return result;
}

// What must hold before anything is asked for: nothing moves, and a dead-man alarm of an earlier host is gone.
static gonio_status settle_in(gonio_controller *c, gonio_controller_status *status, gonio_error *error) {
    gonio_status result = GONIO_OK;
    c->last_id = status->accepted_id;
    if (status->state == CONTROLLER_STATE_MOVING || status->state == CONTROLLER_STATE_HOMING) {
        result = gonio_controller_command(c, CONTROLLER_COMMAND_STOP, 0, NULL, NULL, error);
        gonio_controller_tell(c, "stopped", "an earlier host had left the axes moving");
        for (int i = 0; i < 500 && result == GONIO_OK && status->state != CONTROLLER_STATE_IDLE; i++) {
            gonio_controller_pause(c, 20);
            result = gonio_controller_read_status(c, status, error);
        }
    }
    if (result == GONIO_OK && status->state == CONTROLLER_STATE_ALARM && status->alarm == CONTROLLER_ALARM_DEADMAN) {
        result = gonio_controller_clear(c, error);
    } else if (result == GONIO_OK && status->state == CONTROLLER_STATE_IDLE) {
        // Nothing to clear: it only makes the controller hold an id that a restart forgets.
        result = gonio_controller_command(c, CONTROLLER_COMMAND_CLEAR, 0, NULL, NULL, error);
    }
    return result == GONIO_OK ? set_deadman(c, c->config.deadman_s, error) : result;
}

gonio_status gonio_controller_claim(gonio_controller *c, gonio_error *error) {
    if (c->holds) {
        return GONIO_OK;
    }
    gonio_controller_status now;
    gonio_status status = take(c, &now, error);
    status = status == GONIO_OK ? settle_in(c, &now, error) : status;
    status = status == GONIO_OK ? gonio_controller_parameters_write(c, &c->config.parameters, error) : status;
    return status == GONIO_OK ? start_feeding(c, error) : status;
}

// ---- open and close ----

gonio_status gonio_controller_open(const gonio_controller_config *config, gonio_controller **out, gonio_error *error) {
    gonio_controller *c = calloc(1, sizeof *c);
    if (c == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a controller");
    }
    c->config = *config;
    c->users = 1;
    c->number = own_number(config);
    c->claim = gonio_controller_claim;
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
    gonio_controller_status now;
    status = status == GONIO_OK ? gonio_controller_read_status(c, &now, error) : status;
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
    if (c->holds && gonio_controller_read_status(c, &status, NULL) == GONIO_OK && status.moving == 0) {
        // Else the dead-man would switch the lamp off that is to stay as it is.
        gonio_controller_command(c, CONTROLLER_COMMAND_YIELD, 0, NULL, NULL, NULL);
    }
    destroy(c);
}

const gonio_controller_identity *gonio_controller_identify(const gonio_controller *c) { return &c->identity; }

void gonio_controller_count(gonio_controller *c, gonio_controller_counts *counts) {
    pthread_mutex_lock(&c->lock);
    *counts = c->counts;
    pthread_mutex_unlock(&c->lock);
}
