// SPDX-License-Identifier: BSD-3-Clause
// Lines of text over a serial device or TCP: instruments and motion controllers that take commands in ASCII.
//
// One thread uses a port at a time. A serial device is locked, so that two programs never drive one rig.
#ifndef GONIO_TRANSPORT_LINE_H
#define GONIO_TRANSPORT_LINE_H

#include <stddef.h>

#include "gonio/status.h"
#include "host/transport/tape.h"

enum { GONIO_LINE_MAX = 1024 }; // bytes of an answer

typedef struct gonio_line_config {
    char port[256]; // "/dev/ttyUSB0" or "tcp:HOST:PORT"
    int baud;       // of a serial device; 8 data bits
    int parity;     // 0 none, 1 even, 2 odd
    int timeout_ms; // of one answer
} gonio_line_config;

typedef struct gonio_line gonio_line;

// record, replay: the tape to write or to answer from, as gonio_tape_choose takes them ("": none).
gonio_status gonio_line_open(const gonio_line_config *config, const char *record, const char *replay, gonio_line **out,
                             gonio_error *error);
void gonio_line_close(gonio_line *line); // NULL is allowed
// Close and open again; what was under way is lost.
gonio_status gonio_line_reopen(gonio_line *line, gonio_error *error);

// Send n bytes as they are. GONIO_E_DEVICE: the port is gone; GONIO_E_TIMEOUT: it takes nothing.
gonio_status gonio_line_send(gonio_line *line, const char *bytes, size_t n, gonio_error *error);
// The next line, without what ends it (CR, LF or both) and the blanks around it; empty lines are passed over.
// GONIO_E_TIMEOUT where none ends within timeout_ms (< 0: the port's own).
gonio_status gonio_line_receive(gonio_line *line, int timeout_ms, char answer[GONIO_LINE_MAX], gonio_error *error);
// Throw away what has arrived.
void gonio_line_drain(gonio_line *line);

#endif
