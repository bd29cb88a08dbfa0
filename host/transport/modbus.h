// SPDX-License-Identifier: BSD-3-Clause
// Modbus master, RTU and TCP, by libmodbus: single requests, each bounded, faults told apart. No retries here: what may
// be repeated is for the driver to know. Every exchange can be recorded on a tape and replayed from one.
#ifndef GONIO_TRANSPORT_MODBUS_H
#define GONIO_TRANSPORT_MODBUS_H

#include <stdbool.h>
#include <stdint.h>

#include "gonio/status.h"
#include "host/transport/tape.h"

typedef struct gonio_modbus gonio_modbus;

typedef struct gonio_modbus_config {
    char port[128];     // "/dev/ttyUSB0", or "tcp:HOST:PORT"
    int baud;           // 115200; serial only, 8 data bits
    const char *parity; // "N", "E" or "O"
    int slave;          // 1
    int timeout_ms;     // of one answer; 200
} gonio_modbus_config;

void gonio_modbus_defaults(gonio_modbus_config *config);

typedef enum gonio_modbus_fault {
    GONIO_MODBUS_GOOD,
    GONIO_MODBUS_SILENT,    // no answer in time, or half of one
    GONIO_MODBUS_NOISE,     // an answer with a wrong CRC, of another slave, of another length, of another request
    GONIO_MODBUS_EXCEPTION, // the slave refused; its code is in gonio_modbus_exception
    GONIO_MODBUS_LOST       // the adapter or connection is gone: reopen
} gonio_modbus_fault;

// What goes over the tape instead of the line; GONIO_TAPE_OFF: nothing.
typedef enum gonio_tape_mode { GONIO_TAPE_OFF, GONIO_TAPE_RECORD, GONIO_TAPE_REPLAY } gonio_tape_mode;

// Open the port, for this process alone. tape: borrowed; NULL with GONIO_TAPE_OFF.
gonio_status gonio_modbus_open(const gonio_modbus_config *config, gonio_tape *tape, gonio_tape_mode mode,
                               gonio_modbus **out, gonio_error *error);
void gonio_modbus_close(gonio_modbus *modbus); // NULL is allowed
// Open the port again after GONIO_MODBUS_LOST; fails at once where it is not there.
gonio_status gonio_modbus_reopen(gonio_modbus *modbus, gonio_error *error);
// Take what still arrives until the line has been quiet for quiet_ms, for at most five times as long.
void gonio_modbus_drain(gonio_modbus *modbus, int quiet_ms);

// While muted, exchanges are not recorded.
void gonio_modbus_mute(gonio_modbus *modbus, bool muted);

// The slave that the exchanges from now on are with; at first the configuration's.
void gonio_modbus_address(gonio_modbus *modbus, int slave);

// Functions 3, 4, 16, 6, 23 and 5. At most 125, 125, 123, 1, 121 written and 125 read, and 1.
gonio_modbus_fault gonio_modbus_read(gonio_modbus *modbus, int address, int n, uint16_t *words);
gonio_modbus_fault gonio_modbus_read_inputs(gonio_modbus *modbus, int address, int n, uint16_t *words);
gonio_modbus_fault gonio_modbus_write(gonio_modbus *modbus, int address, int n, const uint16_t *words);
gonio_modbus_fault gonio_modbus_write_one(gonio_modbus *modbus, int address, uint16_t word);
gonio_modbus_fault gonio_modbus_write_read(gonio_modbus *modbus, int write_address, int written,
                                           const uint16_t *write_words, int read_address, int n, uint16_t *words);
gonio_modbus_fault gonio_modbus_write_coil(gonio_modbus *modbus, int address, bool on);

// What the last exchange ended with, in words; lives until the next. And the exception's code, 0 where it was none.
const char *gonio_modbus_text(const gonio_modbus *modbus);
int gonio_modbus_exception(const gonio_modbus *modbus);

#endif
