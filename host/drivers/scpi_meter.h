// SPDX-License-Identifier: BSD-3-Clause
// What a meter that speaks SCPI does, whatever carries its words: set up, ask, average.
#ifndef GONIO_DRIVERS_SCPI_METER_H
#define GONIO_DRIVERS_SCPI_METER_H

#include <stddef.h>

#include "gonio/status.h"

enum { GONIO_SCPI_REPLY = 512 };

typedef enum gonio_scpi_unit {
    GONIO_SCPI_LINEAR, // watts, amperes, volts: proportional to the light
    GONIO_SCPI_DBM,    // decibels over a milliwatt, read as watts
} gonio_scpi_unit;

typedef struct gonio_scpi_config {
    char setup[256];       // sent once after opening; empty: nothing
    char query[128];       // "MEAS:POW?"
    double scale;          // unit of the answer to unit of the readings; 1
    double relative_sigma; // stated relative standard uncertainty of one reading (k = 1)
    int unit;              // of the answer, gonio_scpi_unit
    int retries;           // of one query; 3
} gonio_scpi_config;

void gonio_scpi_defaults(gonio_scpi_config *config);

// How words get there and back. recover: make a clean start after a fault, waiting where that helps; it sets the meter
// up again (gonio_scpi_begin) where it was opened anew.
typedef struct gonio_scpi_link {
    gonio_status (*send)(void *link, const char *line, size_t n, gonio_error *error);
    gonio_status (*receive)(void *link, char reply[GONIO_SCPI_REPLY], gonio_error *error); // blanks at its end may stay
    gonio_status (*recover)(void *link, gonio_error *error);
    void (*clean)(void *link); // what was asked and not answered is forgotten; does not wait
} gonio_scpi_link;

typedef struct gonio_scpi_meter {
    gonio_scpi_config config;
    const gonio_scpi_link *link;
    void *device;
    char identity[256]; // *IDN?; "" before the first gonio_scpi_begin
} gonio_scpi_meter;

// *IDN? (which must be that of the last time), the setup, and what the meter says of it (SYST:ERR?).
gonio_status gonio_scpi_begin(gonio_scpi_meter *meter, gonio_error *error);
// As gonio_meter_ops.read has it: readings averaged over integration_s, at least one.
gonio_status gonio_scpi_read(gonio_scpi_meter *meter, double integration_s, double *value, double *sigma,
                             gonio_error *error);

// The keys of [meter] for a driver whose settings have a gonio_scpi_config at `member`.
#define GONIO_SCPI_KEY(settings, text, kind, member) .section = "meter", GONIO_KEY_NAMED(settings, member, text, kind)
#define GONIO_SCPI_KEYS(settings, at)                                                                                  \
    {GONIO_SCPI_KEY(settings, "setup", LINE, at.setup)}, {GONIO_SCPI_KEY(settings, "query", LINE, at.query)},          \
        {GONIO_SCPI_KEY(settings, "scale", REAL, at.scale), -1e30, 1e30},                                              \
        {GONIO_SCPI_KEY(settings, "sigma_percent", REAL, at.relative_sigma), 0, 100, .times = 100},                    \
        {GONIO_SCPI_KEY(settings, "unit", CHOICE, at.unit), .names = gonio_scpi_units}, {                              \
        GONIO_SCPI_KEY(settings, "retries", INTEGER, at.retries), 0, 100                                               \
    }
const char *const *gonio_scpi_units(void);

#endif
