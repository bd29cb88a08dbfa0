// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/modbus_bus.h"

#include <stdio.h>
#include <stdlib.h>

#include "host/transport/clock.h"

enum { EXCEPTION_BUSY = 6, NOISE_QUIET_MS = 30 };

struct gonio_modbus_bus {
    gonio_modbus_bus_config config;
    gonio_modbus *modbus;
    gonio_tape *tape;
};

typedef struct request {
    int slave, function, address, n;
    uint16_t *words;
    const uint16_t *written;
} request;

void gonio_modbus_bus_defaults(gonio_modbus_bus_config *config) {
    *config = (gonio_modbus_bus_config){.retries = 6, .replug_s = 10};
    gonio_modbus_defaults(&config->modbus);
}

gonio_status gonio_modbus_bus_open(const gonio_modbus_bus_config *config, gonio_modbus_bus **out, gonio_error *error) {
    gonio_modbus_bus *bus = calloc(1, sizeof *bus);
    if (bus == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a Modbus line");
    }
    bus->config = *config;
    gonio_status status = gonio_tape_choose(config->record, config->replay, &bus->tape, error);
    if (status == GONIO_OK) {
        const gonio_tape_mode mode = config->replay[0] != 0   ? GONIO_TAPE_REPLAY
                                     : config->record[0] != 0 ? GONIO_TAPE_RECORD
                                                              : GONIO_TAPE_OFF;
        status = gonio_modbus_open(&config->modbus, bus->tape, mode, &bus->modbus, error);
    }
    if (status != GONIO_OK) {
        gonio_modbus_bus_close(bus);
        return status;
    }
    *out = bus;
    return GONIO_OK;
}

void gonio_modbus_bus_close(gonio_modbus_bus *bus) {
    if (bus != NULL) {
        gonio_modbus_close(bus->modbus);
        gonio_tape_close(bus->tape);
        free(bus);
    }
}

static gonio_modbus_fault once(gonio_modbus_bus *bus, const request *r) {
    gonio_modbus_fault fault = GONIO_MODBUS_GOOD;
    gonio_modbus_address(bus->modbus, r->slave);
    switch (r->function) {
    case 3:
        return gonio_modbus_read(bus->modbus, r->address, r->n, r->words);
    case 4:
        return gonio_modbus_read_inputs(bus->modbus, r->address, r->n, r->words);
    case 6:
        for (int i = 0; i < r->n && fault == GONIO_MODBUS_GOOD; i++) {
            fault = gonio_modbus_write_one(bus->modbus, r->address + i, r->written[i]);
        }
        return fault;
    default:
        return gonio_modbus_write(bus->modbus, r->address, r->n, r->written);
    }
}

// Wait, bounded, until the port can be opened again.
static gonio_status reopen(gonio_modbus_bus *bus, gonio_error *error) {
    const gonio_deadline deadline = gonio_deadline_in_s(bus->config.replug_s);
    for (;;) {
        const gonio_status status = gonio_modbus_reopen(bus->modbus, error);
        if (status == GONIO_OK || status == GONIO_E_MISMATCH || gonio_deadline_left_ms(deadline) == 0) {
            return status; // a replay that leaves its tape has nothing to wait for
        }
        gonio_clock_sleep_ms(100);
    }
}

static gonio_status perform(gonio_modbus_bus *bus, const request *r, gonio_error *error) {
    gonio_modbus_fault fault = GONIO_MODBUS_SILENT;
    for (int attempt = 0; attempt <= bus->config.retries; attempt++) {
        fault = once(bus, r);
        if (fault == GONIO_MODBUS_GOOD) {
            return GONIO_OK;
        }
        if (fault == GONIO_MODBUS_EXCEPTION && gonio_modbus_exception(bus->modbus) != EXCEPTION_BUSY) {
            return gonio_fail(error, GONIO_E_DEVICE, "Modbus %s, slave %d refuses register 0x%04x (%s)",
                              bus->config.modbus.port, r->slave, (unsigned)r->address, gonio_modbus_text(bus->modbus));
        }
        if (fault == GONIO_MODBUS_LOST) {
            const gonio_status status = reopen(bus, error);
            if (status != GONIO_OK) {
                return status;
            }
        } else { // a late answer must not meet the next request
            gonio_modbus_drain(bus->modbus,
                               fault == GONIO_MODBUS_SILENT ? bus->config.modbus.timeout_ms : NOISE_QUIET_MS);
        }
    }
    return gonio_fail(error, fault == GONIO_MODBUS_SILENT ? GONIO_E_TIMEOUT : GONIO_E_DEVICE,
                      "Modbus %s, slave %d, register 0x%04x: failed %d times: %s", bus->config.modbus.port, r->slave,
                      (unsigned)r->address, bus->config.retries + 1, gonio_modbus_text(bus->modbus));
}

gonio_status gonio_modbus_bus_read(gonio_modbus_bus *bus, int slave, int function, int address, int n, uint16_t *words,
                                   gonio_error *error) {
    return perform(bus, &(request){slave, function, address, n, words, NULL}, error);
}

gonio_status gonio_modbus_bus_write(gonio_modbus_bus *bus, int slave, int function, int address, int n,
                                    const uint16_t *words, gonio_error *error) {
    return perform(bus, &(request){slave, function, address, n, NULL, words}, error);
}
