// SPDX-License-Identifier: BSD-3-Clause
// Requests to the controller: one exchange on the line, repeated within bounds, and what its registers say.
#include "host/drivers/controller_internal.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "host/transport/clock.h"

enum { EXCEPTION_BUSY = 6, STATUS_WORDS = CONTROLLER_owner + CONTROLLER_SIZE_owner - CONTROLLER_token };

void gonio_controller_tell(gonio_controller *c, const char *kind, const char *format, ...) {
    char text[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (c->config.event != NULL) {
        c->config.event(c->config.event_context, kind, text);
    }
}

void gonio_controller_pack(uint16_t *words, int n, int64_t value) {
    for (int i = 0; i < n; i++) {
        words[i] = (uint16_t)((uint64_t)value >> (16 * (n - 1 - i)));
    }
}

int64_t gonio_controller_unpack(const uint16_t *words, int n) {
    uint64_t value = words[0] & 0x8000 && n > 1 ? UINT64_MAX : 0;
    for (int i = 0; i < n; i++) {
        value = value << 16 | words[i];
    }
    return (int64_t)value;
}

void gonio_controller_pause(const gonio_controller *c, int ms) {
    if (c->config.mode != GONIO_TAPE_REPLAY) {
        gonio_clock_sleep_ms(ms);
    }
}

gonio_status gonio_controller_contacts(const gonio_controller_status *s, gonio_error *error) {
    const char *what = (s->inputs >> CONTROLLER_CONTACT_estop & 1) != 0  ? "the emergency stop is pressed"
                       : (s->inputs >> CONTROLLER_CONTACT_door & 1) != 0 ? "the door is open"
                                                                         : NULL;
    return what == NULL ? GONIO_OK : gonio_fail(error, GONIO_E_DEVICE, "controller: %s", what);
}

gonio_status gonio_controller_alarm(const gonio_controller_status *s, gonio_error *error) {
    if (s->state != CONTROLLER_STATE_ALARM && s->state != CONTROLLER_STATE_ESTOP) {
        return GONIO_OK;
    }
    char axis[24] = "";
    if (s->alarm_axis < GONIO_CONTROLLER_AXES) {
        snprintf(axis, sizeof axis, ", axis %d", s->alarm_axis);
    }
    return gonio_fail(error, GONIO_E_DEVICE, "controller alarm %d %s%s: %s; see docs/hardware.md", s->alarm,
                      gonio_controller_alarm_name(s->alarm), axis, gonio_controller_alarm_text(s->alarm));
}

// ---- requests ----

static gonio_modbus_fault once_status(gonio_controller *c, void *request);

// Wait, bounded, until the port can be opened again and the same kind of controller answers.
static gonio_status reopen(gonio_controller *c, gonio_error *error) {
    const gonio_deadline deadline = gonio_deadline_in_s(c->config.replug_s);
    for (;;) {
        pthread_mutex_lock(&c->lock);
        const gonio_status status = gonio_modbus_reopen(c->modbus, error);
        c->counts.reopened += status == GONIO_OK;
        pthread_mutex_unlock(&c->lock);
        if (status == GONIO_OK || gonio_deadline_left_ms(deadline) == 0 || status == GONIO_E_MISMATCH) {
            return status; // a replay that leaves its tape has nothing to wait for
        }
        gonio_controller_pause(c, 100);
    }
}

static gonio_modbus_fault exchange(gonio_controller *c, controller_exchange once, void *request, bool call) {
    pthread_mutex_lock(&c->lock);
    gonio_controller_feed_when_due(c); // here as well: requests in close succession keep the feeder from its turn
    const gonio_modbus_fault fault = once(c, request);
    c->counts.exchanges++;
    c->counts.silent += fault == GONIO_MODBUS_SILENT;
    c->counts.noise += fault == GONIO_MODBUS_NOISE;
    c->counts.lost += fault == GONIO_MODBUS_LOST;
    if (fault == GONIO_MODBUS_SILENT || fault == GONIO_MODBUS_NOISE) {
        // A late answer must not meet the next request: wait until nothing comes any more.
        gonio_modbus_drain(c->modbus, fault == GONIO_MODBUS_SILENT ? c->config.modbus.timeout_ms : 30);
    }
    if (call) {
        c->last_call_ms = gonio_clock_ms();
    }
    pthread_mutex_unlock(&c->lock);
    return fault;
}

static gonio_status repeat_request(gonio_controller *c, const char *what, controller_exchange once, void *request,
                                   int *repeats, int *exception, gonio_error *error) {
    gonio_modbus_fault fault = GONIO_MODBUS_SILENT;
    if (exception != NULL) {
        *exception = 0;
    }
    for (int attempt = 0; attempt <= c->config.retries; attempt++) {
        c->counts.retries += attempt > 0;
        *repeats = attempt;
        fault = exchange(c, once, request, true);
        if (fault == GONIO_MODBUS_GOOD) {
            return GONIO_OK;
        }
        const int code = gonio_modbus_exception(c->modbus);
        if (fault == GONIO_MODBUS_EXCEPTION && code != EXCEPTION_BUSY) {
            if (exception != NULL) {
                *exception = code;
            }
            return gonio_fail(error, GONIO_E_DEVICE, "controller %s: %s refused (%s)", c->config.modbus.port, what,
                              gonio_modbus_text(c->modbus));
        }
        if (fault == GONIO_MODBUS_LOST) {
            const gonio_status status = reopen(c, error);
            if (status != GONIO_OK) {
                return status;
            }
        } else {
            gonio_controller_pause(c, 5 << (attempt < 5 ? attempt : 5)); // noise comes in bursts
        }
    }
    return gonio_fail(error, fault == GONIO_MODBUS_SILENT ? GONIO_E_TIMEOUT : GONIO_E_DEVICE,
                      "controller %s: %s failed %d times: %s", c->config.modbus.port, what, c->config.retries + 1,
                      gonio_modbus_text(c->modbus));
}

// A line that made a request be repeated may have carried another one to the controller: the position is read back.
gonio_status gonio_controller_request(gonio_controller *c, const char *what, controller_exchange once, void *request,
                                      int *exception, gonio_error *error) {
    int repeats = 0;
    const gonio_status status = repeat_request(c, what, once, request, &repeats, exception, error);
    if (repeats > 0 && status == GONIO_OK) {
        gonio_controller_tell(c, "retry", "%s: %d times, %s", what, repeats, "then it succeeded");
    }
    gonio_controller_status now;
    return status == GONIO_OK && repeats > 0 && c->resting && once != once_status
               ? gonio_controller_read_status(c, &now, error)
               : status;
}

typedef struct words_request {
    int address, n;
    uint16_t *words;
    const uint16_t *written;
} words_request;

static gonio_modbus_fault once_read(gonio_controller *c, void *request) {
    const words_request *r = request;
    return gonio_modbus_read(c->modbus, r->address, r->n, r->words);
}

static gonio_modbus_fault once_write(gonio_controller *c, void *request) {
    const words_request *r = request;
    return gonio_modbus_write(c->modbus, r->address, r->n, r->written);
}

gonio_status gonio_controller_read(gonio_controller *c, int address, int n, uint16_t *words, gonio_error *error) {
    return gonio_controller_request(c, "reading", once_read, &(words_request){address, n, words, NULL}, NULL, error);
}

gonio_status gonio_controller_write(gonio_controller *c, int address, int n, const uint16_t *words,
                                    gonio_error *error) {
    uint16_t held[125];
    if (n > 123) {
        return gonio_fail(error, GONIO_E_RANGE, "%d registers in one write; at most 123", n);
    }
    gonio_status status = c->claim(c, error);
    status = status == GONIO_OK ? gonio_controller_read(c, address, n, held, error) : status;
    const size_t size = (size_t)n * sizeof *words;
    for (int attempt = 0; attempt < 3 && status == GONIO_OK && memcmp(held, words, size) != 0; attempt++) {
        status =
            gonio_controller_request(c, "writing", once_write, &(words_request){address, n, NULL, words}, NULL, error);
        status = status == GONIO_OK ? gonio_controller_read(c, address, n, held, error) : status;
    }
    if (status == GONIO_OK && memcmp(held, words, size) != 0) {
        return gonio_fail(error, GONIO_E_DEVICE, "controller %s: register 0x%04x does not take what is written",
                          c->config.modbus.port, (unsigned)address);
    }
    return status;
}

typedef struct other_request {
    int slave, function, address, n;
    uint16_t *words;
} other_request;

static gonio_modbus_fault once_other(gonio_controller *c, void *request) {
    const other_request *r = request;
    gonio_modbus_address(c->modbus, r->slave);
    const gonio_modbus_fault fault = r->function == 4 ? gonio_modbus_read_inputs(c->modbus, r->address, r->n, r->words)
                                                      : gonio_modbus_read(c->modbus, r->address, r->n, r->words);
    gonio_modbus_address(c->modbus, c->config.modbus.slave);
    return fault;
}

gonio_status gonio_controller_read_other(gonio_controller *c, int slave, int function, int address, int n,
                                         uint16_t *words, gonio_error *error) {
    char what[40];
    snprintf(what, sizeof what, "reading slave %d", slave);
    return gonio_controller_request(c, what, once_other, &(other_request){slave, function, address, n, words}, NULL,
                                    error);
}

typedef struct coil_request {
    int coil;
    bool on;
} coil_request;

static gonio_modbus_fault once_coil(gonio_controller *c, void *request) {
    const coil_request *r = request;
    return gonio_modbus_write_coil(c->modbus, r->coil, r->on);
}

gonio_status gonio_controller_coil(gonio_controller *c, int coil, bool on, gonio_error *error) {
    int exception = 0;
    const gonio_status claimed = on ? c->claim(c, error) : GONIO_OK; // off is free to all
    if (claimed != GONIO_OK) {
        return claimed;
    }
    const gonio_status status =
        gonio_controller_request(c, "switching", once_coil, &(coil_request){coil, on}, &exception, error);
    gonio_controller_status now;
    if (status != GONIO_OK && exception != 0 && gonio_controller_read_status(c, &now, NULL) == GONIO_OK) {
        const gonio_status alarm = gonio_controller_alarm(&now, error); // it says more than "refused"
        return alarm != GONIO_OK ? alarm : status;
    }
    return status;
}

// ---- status ----

#define WORDS(name) (words + (CONTROLLER_##name - CONTROLLER_token))
#define VALUE(name) gonio_controller_unpack(WORDS(name), CONTROLLER_EACH_##name)

static void decode(const uint16_t *words, gonio_controller_status *s) {
    *s = (gonio_controller_status){.state = (int)VALUE(state),
                                   .alarm = (int)VALUE(alarm),
                                   .alarm_axis = (int)VALUE(alarm_axis),
                                   .refusal = (int)VALUE(refusal),
                                   .moving = (unsigned)VALUE(moving),
                                   .homed = (unsigned)VALUE(homed),
                                   .inputs = (unsigned)VALUE(inputs),
                                   .accepted_id = (uint32_t)VALUE(accepted_id),
                                   .finished_id = (uint32_t)VALUE(finished_id),
                                   .lamp_state = (int)VALUE(lamp_state),
                                   .reset_cause = (int)VALUE(reset_cause),
                                   .lamp_output = (double)VALUE(lamp_output) / 1e4,
                                   .temperature_c = (double)VALUE(temperature) / 1e3,
                                   .monitor = (double)(uint32_t)VALUE(monitor) / 4294967296.0,
                                   .monitor_us = VALUE(monitor_time),
                                   .time_us = VALUE(time),
                                   .trigger_count = (uint32_t)VALUE(trigger_count),
                                   .generation = (uint32_t)VALUE(generation),
                                   .checksum = (uint32_t)VALUE(checksum),
                                   .owner = (uint32_t)VALUE(owner)};
    for (int k = 0; k < GONIO_CONTROLLER_AXES; k++) {
        s->position[k] =
            gonio_controller_unpack(WORDS(position) + k * CONTROLLER_EACH_position, CONTROLLER_EACH_position);
        s->home_difference[k] = (int32_t)gonio_controller_unpack(
            WORDS(home_difference) + k * CONTROLLER_EACH_home_difference, CONTROLLER_EACH_home_difference);
    }
}

// Function 23 writes the token and reads from it on: one exchange, and a reply with another token is an old one.
static gonio_modbus_fault once_status(gonio_controller *c, void *request) {
    uint16_t *words = request;
    c->token = (uint16_t)(c->token % 0xffff + 1); // never 0, which is the initial value
    const gonio_modbus_fault fault =
        gonio_modbus_write_read(c->modbus, CONTROLLER_token, 1, &c->token, CONTROLLER_token, STATUS_WORDS, words);
    if (fault == GONIO_MODBUS_GOOD && words[0] != c->token) {
        c->counts.stale++;
        return GONIO_MODBUS_NOISE;
    }
    if (fault == GONIO_MODBUS_GOOD) {
        pthread_mutex_lock(&c->last_lock);
        decode(words, &c->last);
        c->last_ms = gonio_clock_ms();
        pthread_mutex_unlock(&c->last_lock);
    }
    return fault;
}

bool gonio_controller_last(gonio_controller *c, gonio_controller_status *status, double *age_s) {
    pthread_mutex_lock(&c->last_lock);
    const bool known = c->last_ms != 0;
    *status = c->last;
    *age_s = (double)(gonio_clock_ms() - c->last_ms) / 1000;
    pthread_mutex_unlock(&c->last_lock);
    return known;
}

gonio_modbus_fault gonio_controller_feed(gonio_controller *c) {
    uint16_t words[CONTROLLER_SIZE_heartbeat];
    gonio_controller_pack(words, CONTROLLER_SIZE_heartbeat, c->number);
    const gonio_modbus_fault fault =
        gonio_modbus_write(c->modbus, CONTROLLER_heartbeat, CONTROLLER_SIZE_heartbeat, words);
    c->last_fed_ms = fault == GONIO_MODBUS_GOOD ? gonio_clock_ms() : c->last_fed_ms;
    return fault;
}

int64_t gonio_controller_feed_period_ms(const gonio_controller *c) {
    return c->config.deadman_s > 0 ? (int64_t)(c->config.deadman_s * 1000 / 4) : 1000;
}

void gonio_controller_feed_when_due(gonio_controller *c) {
    if (!c->feeding || gonio_clock_ms() - c->last_fed_ms < gonio_controller_feed_period_ms(c)) {
        return;
    }
    gonio_modbus_mute(c->modbus, true);
    const gonio_modbus_fault fault = gonio_controller_feed(c);
    if (fault == GONIO_MODBUS_SILENT || fault == GONIO_MODBUS_NOISE) {
        gonio_modbus_drain(c->modbus, c->config.modbus.timeout_ms);
    }
    gonio_modbus_mute(c->modbus, false);
    c->counts.feeds++;
}

static gonio_status check_rest(gonio_controller *c, const gonio_controller_status *now, gonio_error *error) {
    for (int k = 0; k < GONIO_CONTROLLER_AXES && c->resting; k++) {
        if (now->position[k] != c->rest[k]) {
            c->resting = false; // told once
            gonio_controller_tell(c, "lost-steps", "axis %d stands at %lld steps, and stood at %lld", k,
                                  (long long)now->position[k], (long long)c->rest[k]);
            return gonio_fail(error, GONIO_E_DEVICE,
                              "controller %s: axis %d stands at %lld steps and was left at %lld, though nothing was "
                              "asked to move",
                              c->config.modbus.port, k, (long long)now->position[k], (long long)c->rest[k]);
        }
    }
    return GONIO_OK;
}

gonio_status gonio_controller_read_status(gonio_controller *c, gonio_controller_status *status, gonio_error *error) {
    uint16_t words[STATUS_WORDS];
    const gonio_status result = gonio_controller_request(c, "status", once_status, words, NULL, error);
    if (result != GONIO_OK) {
        return result;
    }
    decode(words, status);
    pthread_mutex_lock(&c->lock);
    // Soon after power came its time need not go back; but then it has forgotten the last command, and the parameters.
    const bool restarted = status->time_us < c->last_time_us || (c->commanded && status->accepted_id == 0);
    const bool first = restarted && !c->restarted;
    c->restarted = c->restarted || restarted;
    c->last_time_us = status->time_us;
    pthread_mutex_unlock(&c->lock);
    if (first) {
        gonio_controller_tell(c, "controller-restart", "the controller restarted (%s)",
                              gonio_controller_cause_text(status->reset_cause));
    }
    if (c->restarted) { // for good: its parameters are those of its start, until somebody opens it and sets them again
        return gonio_fail(error, GONIO_E_DEVICE, "controller %s restarted (%s): positions are lost, home it again",
                          c->config.modbus.port, gonio_controller_cause_text(status->reset_cause));
    }
    const bool alarmed = status->state == CONTROLLER_STATE_ALARM || status->state == CONTROLLER_STATE_ESTOP;
    if (alarmed && c->alarm_told != status->alarm) {
        gonio_controller_tell(c, "alarm", "%d %s: %s", status->alarm, gonio_controller_alarm_name(status->alarm),
                              gonio_controller_alarm_text(status->alarm));
    }
    c->alarm_told = alarmed ? status->alarm : 0;
    return check_rest(c, status, error);
}

void gonio_controller_rest(gonio_controller *c, const int64_t position[GONIO_CONTROLLER_AXES]) {
    memcpy(c->rest, position, sizeof c->rest);
    c->resting = true;
}

// ---- connection ----

gonio_status gonio_controller_greet(gonio_controller *c, gonio_error *error) {
    enum { N = CONTROLLER_step_rate_max + CONTROLLER_SIZE_step_rate_max - CONTROLLER_magic };
    uint16_t words[N];
    gonio_status status = gonio_controller_read(c, CONTROLLER_magic, N, words, error);
    if (status != GONIO_OK) {
        return status;
    }
    const int magic = words[0], protocol = words[CONTROLLER_protocol - CONTROLLER_magic];
    if (magic != CONTROLLER_INITIAL_magic) {
        return gonio_fail(error, GONIO_E_DEVICE, "%s is no Gonio controller: register 0 reads 0x%04x, expected 0x%04x",
                          c->config.modbus.port, (unsigned)magic, (unsigned)CONTROLLER_INITIAL_magic);
    }
    if (protocol != CONTROLLER_INITIAL_protocol) {
        return gonio_fail(error, GONIO_E_DEVICE,
                          "controller %s speaks protocol %d, this program %d: flash the firmware of this version",
                          c->config.modbus.port, protocol, (int)CONTROLLER_INITIAL_protocol);
    }
    c->identity = (gonio_controller_identity){
        .protocol = protocol,
        .axes = words[CONTROLLER_axes - CONTROLLER_magic],
        .board = words[CONTROLLER_board - CONTROLLER_magic],
        .version = (uint32_t)gonio_controller_unpack(words + (CONTROLLER_version - CONTROLLER_magic), 2),
        .step_rate_max = (uint32_t)gonio_controller_unpack(words + (CONTROLLER_step_rate_max - CONTROLLER_magic), 2)};
    return GONIO_OK;
}
