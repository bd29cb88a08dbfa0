// SPDX-License-Identifier: BSD-3-Clause
// What a meter that speaks SCPI does, whatever carries its words: set up, ask, average.
#ifndef GONIO_DRIVERS_SCPI_METER_H
#define GONIO_DRIVERS_SCPI_METER_H

#include <stddef.h>

#include "gonio/rig.h"

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
    double replug_s;       // wait this long for a meter that is gone to come back; 10
} gonio_scpi_config;

void gonio_scpi_defaults(gonio_scpi_config *config);

typedef struct gonio_scpi_meter gonio_scpi_meter;

// How words get there and back.
typedef struct gonio_scpi_link {
    gonio_status (*open)(gonio_scpi_meter *meter, gonio_error *error); // once more after close; does not wait
    void (*close)(gonio_scpi_meter *meter);
    gonio_status (*send)(gonio_scpi_meter *meter, const char *line, size_t n, gonio_error *error);
    gonio_status (*receive)(gonio_scpi_meter *meter, char reply[GONIO_SCPI_REPLY], gonio_error *error); // one line
    bool (*clear)(gonio_scpi_meter *meter); // what was asked and not answered is forgotten; false: it is gone
} gonio_scpi_link;

// The first member of a driver's device.
struct gonio_scpi_meter {
    gonio_scpi_config config;
    const gonio_scpi_link *link;
    char identity[256]; // *IDN?; "" before gonio_scpi_begin
};

// Open it: *IDN?, the setup, and what the meter says of it (SYST:ERR?). `device` has been allocated, with config and
// link set; it is closed and freed where that fails.
gonio_status gonio_scpi_begin(gonio_scpi_meter *device, gonio_error *error);
// gonio_meter_ops.read and .close of a device that begins with a gonio_scpi_meter. Readings are averaged over
// integration_s, at least one. A fault is answered by a clear, a meter that is gone by opening it again; it must be the
// same one.
gonio_status gonio_scpi_read(void *device, const gonio_stamp *stamp, double integration_s, double *value, double *sigma,
                             gonio_error *error);
void gonio_scpi_close(void *device);

// The keys of [meter] for a driver whose settings have a gonio_scpi_config at `member`.
#define GONIO_SCPI_KEY(settings, text, kind, member) .section = "meter", GONIO_KEY_NAMED(settings, member, text, kind)
#define GONIO_SCPI_KEYS(settings, at)                                                                                  \
    {GONIO_SCPI_KEY(settings, "setup", LINE, at.setup)}, {GONIO_SCPI_KEY(settings, "query", LINE, at.query)},          \
        {GONIO_SCPI_KEY(settings, "scale", REAL, at.scale), -1e30, 1e30},                                              \
        {GONIO_SCPI_KEY(settings, "sigma_percent", REAL, at.relative_sigma), 0, 100, .times = 100},                    \
        {GONIO_SCPI_KEY(settings, "unit", CHOICE, at.unit), .names = gonio_scpi_units},                                \
        {GONIO_SCPI_KEY(settings, "replug_s", REAL, at.replug_s), 0, 3600}, {                                          \
        GONIO_SCPI_KEY(settings, "retries", INTEGER, at.retries), 0, 100                                               \
    }
const char *const *gonio_scpi_units(void);

#endif
