// SPDX-License-Identifier: BSD-3-Clause
// Encoders of the axes beside the stage that moves them: every move, and every look in between, compares.
//
// An encoder is a Modbus slave (on a line of its own, or on the stage's) or the stage's own. What it counts means
// nothing until a homing has told where it is zero, or zero_counts does. A difference beyond encoder_deg is
// GONIO_E_MISMATCH: steps were lost. An encoder that does not answer, or stands still while its axis moves, is
// GONIO_E_TIMEOUT or GONIO_E_DEVICE, with the axis named.
#ifndef GONIO_DRIVERS_ENCODERS_H
#define GONIO_DRIVERS_ENCODERS_H

#include "base/keys.h"
#include "gonio/rig.h"
#include "host/drivers/controller.h"
#include "host/drivers/modbus_bus.h"

typedef struct gonio_encoder {
    double encoder_deg;    // a larger difference is lost steps; 0: there is no encoder
    int slave;             // 0: the stage's own encoder
    char port[128];        // "": the stage's line
    int baud;              // of a port of its own
    const char *parity;    // likewise
    int timeout_ms;        // likewise
    int address, function; // of its register; 3 or 4
    int bits;              // 16 or 32: see gonio_encoder_keys
    int low_first;         // of 32 bits: the low word stands first
    double counts_per_deg; // of user coordinates; < 0: it counts the other way
    double wrap_counts;    // it begins anew after so many; 0: after all of its bits
    double zero_counts;    // what it reads at 0 deg; NaN: homing tells
} gonio_encoder;

typedef struct gonio_encoders {
    gonio_encoder axes[GONIO_AXES];
} gonio_encoders;

extern const gonio_key gonio_encoder_keys[]; // of sections [encoder light_theta] ..., into a gonio_encoders
void gonio_encoders_defaults(gonio_encoders *encoders);
bool gonio_encoders_any(const gonio_encoders *encoders);

// Whose line the encoders without a port of their own are on; either may be NULL.
typedef struct gonio_encoder_lines {
    gonio_controller *controller;
    gonio_modbus_bus *bus;
    void (*event)(void *context, const char *kind, const char *text); // NULL: nobody
    void *event_context;
} gonio_encoder_lines;

// Put them in front of the rig's stage, which is closed with them. *device: for gonio_encoders_read, borrowed.
gonio_status gonio_encoders_guard(const gonio_encoders *encoders, const gonio_encoder_lines *lines, gonio_rig *rig,
                                  void **device, gonio_error *error);

typedef struct gonio_encoder_reading {
    bool there, known;                   // known: its zero is
    double counts;                       // as read; degrees of a stage's own
    double position_rad, difference_rad; // where known: by the encoder, and that less what the stage says
} gonio_encoder_reading;
gonio_status gonio_encoders_read(void *device, gonio_encoder_reading readings[GONIO_AXES], gonio_error *error);

#endif
