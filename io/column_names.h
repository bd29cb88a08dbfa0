// SPDX-License-Identifier: BSD-3-Clause
// What a column of a laboratory's table is by its name alone.
#ifndef GONIO_IO_COLUMN_NAMES_H
#define GONIO_IO_COLUMN_NAMES_H

#include <stdbool.h>
#include <stddef.h>

typedef enum gonio_column_role {
    GONIO_COLUMN_CHANNEL,
    GONIO_COLUMN_UNKNOWN, // a name that says nothing: a channel where no other column is one by its name
    GONIO_COLUMN_SIGMA,
    GONIO_COLUMN_OTHER_SIGMA, // an uncertainty, but not a standard one in the values' unit
    GONIO_COLUMN_WAVELENGTH,
    GONIO_COLUMN_ASIDE,   // of something else
    GONIO_COLUMN_FOREIGN, // values, but no f_r
} gonio_column_role;
gonio_column_role gonio_column_role_of(const char *name);

// "std_r", "r_unc": its uncertainty's channel, within the name, and that one's length; NULL: it is none.
const char *gonio_column_sigma_of(const char *name, size_t *length);
// The unit of wavelengths that the name tells, in micrometres: 1e-3, 1; 0: none; NaN: another, which `unit` holds.
double gonio_column_um(const char *name, char *unit, size_t size);

#endif
