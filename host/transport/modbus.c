// SPDX-License-Identifier: BSD-3-Clause
// libmodbus prints where it is asked to debug, and when it is given an empty name: neither happens here. Its own error
// recovery sleeps and reconnects without a bound, so it stays off.
#include "host/transport/modbus.h"

#include <errno.h>
#include <modbus.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>

#include "host/transport/clock.h"

struct gonio_modbus {
    gonio_modbus_config config;
    gonio_tape *tape;
    gonio_tape_mode mode;
    bool muted;
    int slave;         // of the exchanges from now on
    modbus_t *context; // NULL while the port is closed
    int exception;
    char text[640];
};

void gonio_modbus_defaults(gonio_modbus_config *config) {
    *config = (gonio_modbus_config){.baud = 115200, .parity = "N", .slave = 1, .timeout_ms = 200};
}

// "tcp:HOST:PORT" taken apart; false where it is no such text.
static bool split_tcp(const char *port, char *host, size_t size, char *service, size_t service_size) {
    const char *colon = strrchr(port, ':');
    if (strncmp(port, "tcp:", 4) != 0 || colon == NULL || colon <= port + 4 || colon[1] == 0) {
        return false;
    }
    snprintf(host, size, "%.*s", (int)(colon - port - 4), port + 4);
    snprintf(service, service_size, "%s", colon + 1);
    return true;
}

static void release(gonio_modbus *m) {
    if (m->context != NULL) {
        modbus_close(m->context);
        modbus_free(m->context);
        m->context = NULL;
    }
}

static gonio_status fail_port(gonio_modbus *m, int code, const char *what, gonio_error *error) {
    release(m);
    return gonio_fail(error, GONIO_E_DEVICE, "Modbus port %s: %s: %s%s", m->config.port, what, modbus_strerror(code),
                      code == EACCES ? " (the user must be in the group dialout)" : "");
}

static gonio_status connect_port(gonio_modbus *m, gonio_error *error) {
    const gonio_modbus_config *c = &m->config;
    char host[sizeof c->port], service[32];
    const bool tcp = split_tcp(c->port, host, sizeof host, service, sizeof service);
    m->context = tcp ? modbus_new_tcp_pi(host, service) : modbus_new_rtu(c->port, c->baud, c->parity[0], 8, 1);
    if (m->context == NULL) {
        return fail_port(m, errno, "cannot be used", error);
    }
    const uint32_t us = (uint32_t)c->timeout_ms * 1000;
    modbus_set_debug(m->context, FALSE);
    modbus_set_error_recovery(m->context, MODBUS_ERROR_RECOVERY_NONE);
    modbus_set_response_timeout(m->context, us / 1000000, us % 1000000);
    // Between two bytes of one answer: USB adapters deliver in blocks up to 16 ms apart.
    modbus_set_byte_timeout(m->context, 0, 50000);
    if (modbus_set_slave(m->context, m->slave) != 0 || modbus_connect(m->context) != 0) {
        return fail_port(m, errno, "cannot be opened", error);
    }
    if (!tcp && flock(modbus_get_socket(m->context), LOCK_EX | LOCK_NB) != 0) {
        return fail_port(m, EBUSY, "another program drives this rig", error);
    }
    return GONIO_OK;
}

gonio_status gonio_modbus_open(const gonio_modbus_config *config, gonio_tape *tape, gonio_tape_mode mode,
                               gonio_modbus **out, gonio_error *error) {
    if (config->port[0] == 0) {
        return gonio_fail(error, GONIO_E_INPUT, "no Modbus port given; expected a serial device or tcp:HOST:PORT");
    }
    gonio_modbus *m = calloc(1, sizeof *m);
    if (m == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a Modbus port");
    }
    m->config = *config;
    m->slave = config->slave;
    m->tape = tape;
    m->mode = mode;
    const gonio_status status = mode == GONIO_TAPE_REPLAY ? GONIO_OK : connect_port(m, error);
    if (status != GONIO_OK) {
        gonio_modbus_close(m);
        return status;
    }
    *out = m;
    return GONIO_OK;
}

void gonio_modbus_close(gonio_modbus *m) {
    if (m != NULL) {
        release(m);
        free(m);
    }
}

gonio_status gonio_modbus_reopen(gonio_modbus *m, gonio_error *error) {
    long long code = 0;
    size_t n;
    if (m->mode == GONIO_TAPE_REPLAY) {
        const gonio_status status = gonio_tape_get(m->tape, "modbus-reopen", NULL, 0, &code, NULL, 0, &n, error);
        return status != GONIO_OK ? status
               : code == 0        ? GONIO_OK
                           : gonio_fail(error, GONIO_E_DEVICE, "Modbus port %s cannot be opened", m->config.port);
    }
    release(m);
    const gonio_status status = connect_port(m, error);
    if (m->mode == GONIO_TAPE_RECORD) {
        gonio_tape_put(m->tape, "modbus-reopen", NULL, 0, status, NULL, 0);
    }
    return status;
}

void gonio_modbus_drain(gonio_modbus *m, int quiet_ms) {
    if (m->context == NULL) {
        return;
    }
    const gonio_deadline deadline = gonio_deadline_in_ms(5LL * quiet_ms);
    struct pollfd line = {.fd = modbus_get_socket(m->context), .events = POLLIN};
    while (gonio_deadline_left_ms(deadline) > 0 && poll(&line, 1, quiet_ms) > 0) {
        if (modbus_flush(m->context) <= 0) {
            return; // readable, but nothing to read: closed
        }
    }
}

void gonio_modbus_address(gonio_modbus *m, int slave) {
    m->slave = slave;
    if (m->context != NULL) {
        modbus_set_slave(m->context, slave); // 1 to 247: it cannot fail
    }
}

void gonio_modbus_mute(gonio_modbus *m, bool muted) { m->muted = muted; }

static gonio_modbus_fault say(gonio_modbus *m, gonio_modbus_fault fault, const char *text) {
    snprintf(m->text, sizeof m->text, "%s", text);
    return fault;
}

// What libmodbus's errno means.
static gonio_modbus_fault judge(gonio_modbus *m, int code) {
    m->exception = 0;
    if (code >= EMBXILFUN && code <= EMBXGTAR) {
        m->exception = code - MODBUS_ENOBASE;
        return say(m, GONIO_MODBUS_EXCEPTION, modbus_strerror(code));
    }
    switch (code) {
    case 0:
        return say(m, GONIO_MODBUS_GOOD, "good");
    case ETIMEDOUT:
        return say(m, GONIO_MODBUS_SILENT, "no answer in time");
    case EMBBADCRC:
        return say(m, GONIO_MODBUS_NOISE, "wrong checksum");
    case EMBBADSLAVE:
        return say(m, GONIO_MODBUS_NOISE, "answer of another slave");
    case EMBBADDATA:
    case EMBBADEXC:
    case EMBMDATA:
    case EINVAL:
        return say(m, GONIO_MODBUS_NOISE, "answer that does not fit the request");
    case EINTR:
    case EAGAIN:
        return say(m, GONIO_MODBUS_SILENT, "interrupted");
    default:
        return say(m, GONIO_MODBUS_LOST, strerror(code));
    }
}

typedef enum kind { READ, READ_INPUTS, WRITE, WRITE_ONE, WRITE_READ, COIL } kind;
static const char *const kind_names[] = {"modbus-read",      "modbus-read-inputs", "modbus-write",
                                         "modbus-write-one", "modbus-write-read",  "modbus-coil"};

// A request as numbers: addresses and counts first, words written after them.
typedef struct request {
    kind kind;
    int address, n, read_address, read_n;
    const uint16_t *words;
} request;

static int perform(modbus_t *context, const request *r, uint16_t *reply) {
    // What arrived since the last exchange answers nothing that is asked now.
    modbus_flush(context);
    errno = 0;
    int done = -1;
    switch (r->kind) {
    case READ:
        done = modbus_read_registers(context, r->read_address, r->read_n, reply);
        return done == r->read_n ? 0 : errno != 0 ? errno : EMBBADDATA;
    case READ_INPUTS:
        done = modbus_read_input_registers(context, r->read_address, r->read_n, reply);
        return done == r->read_n ? 0 : errno != 0 ? errno : EMBBADDATA;
    case WRITE_ONE:
        done = modbus_write_register(context, r->address, r->words[0]);
        return done == 1 ? 0 : errno != 0 ? errno : EMBBADDATA;
    case WRITE:
        done = modbus_write_registers(context, r->address, r->n, r->words);
        return done == r->n ? 0 : errno != 0 ? errno : EMBBADDATA;
    case WRITE_READ:
        done = modbus_write_and_read_registers(context, r->address, r->n, r->words, r->read_address, r->read_n, reply);
        return done == r->read_n ? 0 : errno != 0 ? errno : EMBBADDATA;
    case COIL:
        done = modbus_write_bit(context, r->address, r->n);
        return done == 1 ? 0 : errno != 0 ? errno : EMBBADDATA;
    }
    return EINVAL;
}

// The exchange's name on a tape: those with other slaves than the line's own have the slave in it.
static const char *kind_name(const gonio_modbus *m, const request *r, char name[40]) {
    if (m->slave == m->config.slave) {
        return kind_names[r->kind];
    }
    snprintf(name, 40, "%s@%d", kind_names[r->kind], m->slave);
    return name;
}

static gonio_modbus_fault replay(gonio_modbus *m, const request *r, const uint16_t *asked, size_t size,
                                 uint16_t *reply) {
    long long code = 0;
    size_t n = 0;
    gonio_error error = {0};
    char name[40];
    const size_t room = (size_t)r->read_n * sizeof *reply;
    if (gonio_tape_get(m->tape, kind_name(m, r, name), asked, size, &code, reply, room, &n, &error) != GONIO_OK) {
        return say(m, GONIO_MODBUS_LOST, error.message);
    }
    return judge(m, code == 0 && n != room ? EMBBADDATA : (int)code);
}

static gonio_modbus_fault exchange(gonio_modbus *m, const request *r, uint16_t *reply) {
    uint16_t asked[4 + MODBUS_MAX_WRITE_REGISTERS] = {(uint16_t)r->address, (uint16_t)r->n, (uint16_t)r->read_address,
                                                      (uint16_t)r->read_n};
    const size_t written = r->words != NULL ? (size_t)r->n : 0;
    for (size_t i = 0; i < written; i++) {
        asked[4 + i] = r->words[i];
    }
    const size_t size = (4 + written) * sizeof *asked;
    if (m->mode == GONIO_TAPE_REPLAY) {
        return replay(m, r, asked, size, reply);
    }
    const int code = m->context != NULL ? perform(m->context, r, reply) : ENOTCONN;
    if (m->mode == GONIO_TAPE_RECORD && !m->muted) {
        char name[40];
        gonio_tape_put(m->tape, kind_name(m, r, name), asked, size, code, reply,
                       code == 0 ? (size_t)r->read_n * sizeof *reply : 0);
    }
    return judge(m, code);
}

gonio_modbus_fault gonio_modbus_read(gonio_modbus *m, int address, int n, uint16_t *words) {
    return exchange(m, &(request){.kind = READ, .read_address = address, .read_n = n}, words);
}

gonio_modbus_fault gonio_modbus_read_inputs(gonio_modbus *m, int address, int n, uint16_t *words) {
    return exchange(m, &(request){.kind = READ_INPUTS, .read_address = address, .read_n = n}, words);
}

gonio_modbus_fault gonio_modbus_write_one(gonio_modbus *m, int address, uint16_t word) {
    return exchange(m, &(request){.kind = WRITE_ONE, .address = address, .n = 1, .words = &word}, NULL);
}

gonio_modbus_fault gonio_modbus_write(gonio_modbus *m, int address, int n, const uint16_t *words) {
    return exchange(m, &(request){.kind = WRITE, .address = address, .n = n, .words = words}, NULL);
}

gonio_modbus_fault gonio_modbus_write_read(gonio_modbus *m, int write_address, int written, const uint16_t *write_words,
                                           int read_address, int n, uint16_t *words) {
    return exchange(m, &(request){WRITE_READ, write_address, written, read_address, n, write_words}, words);
}

gonio_modbus_fault gonio_modbus_write_coil(gonio_modbus *m, int address, bool on) {
    return exchange(m, &(request){.kind = COIL, .address = address, .n = on}, NULL);
}

const char *gonio_modbus_text(const gonio_modbus *m) { return m->text; }

int gonio_modbus_exception(const gonio_modbus *m) { return m->exception; }
