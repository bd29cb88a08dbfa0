// SPDX-License-Identifier: BSD-3-Clause
// What the columns of a lab's own table mean: given as options, or kept in a file beside the data.
#ifndef GONIO_IO_MAPPING_H
#define GONIO_IO_MAPPING_H

#include "io/format.h"

#define GONIO_MAP_ENDING ".gonio-map"
// The options of the format `table`, behind those of every text.
enum {
    GONIO_TABLE_COLUMNS = GONIO_TEXT_OPTIONS_N,
    GONIO_TABLE_SEPARATOR,
    GONIO_TABLE_DECIMAL,
    GONIO_TABLE_SIGNED,
    GONIO_TABLE_ANGLES,
    GONIO_TABLE_QUANTITY,
    GONIO_TABLE_MIRROR_AT,
    GONIO_TABLE_WAVELENGTH,
    GONIO_TABLE_MATRIX,
    GONIO_TABLE_ELEVATION,
    GONIO_TABLE_MAP
};

// What a column is. Of PHI, the azimuth between the two directions, phi_i is 0.
typedef enum gonio_mapped_role {
    GONIO_MAPPED_THETA_I,
    GONIO_MAPPED_PHI_I,
    GONIO_MAPPED_THETA_O,
    GONIO_MAPPED_PHI_O,
    GONIO_MAPPED_PHI,
    GONIO_MAPPED_ANGLES,
    GONIO_MAPPED_WAVELENGTH = GONIO_MAPPED_ANGLES,
    GONIO_MAPPED_SIGMA,
    GONIO_MAPPED_VALUE,
    GONIO_MAPPED_CHANNEL // under a name of its own
} gonio_mapped_role;
const char *gonio_mapped_role_name(gonio_mapped_role role); // "theta_i"; NULL: a channel's is its own

typedef struct gonio_mapped_item {
    gonio_mapped_role role;
    char key[GONIO_CHANNEL_NAME_MAX + 8]; // "theta_i", "sigma_r", "r"
    char name[96];                        // of the column; "": by number, or a constant
    int number;                           // of the column, from 1 on; 0: by name, or a constant
    double constant;                      // of an angle, in the table's unit unless in_degrees; NaN: a column
    bool in_degrees;
} gonio_mapped_item;

typedef enum gonio_quantity {
    GONIO_QUANTITY_UNSTATED, // f_r, unless names or comments say otherwise
    GONIO_QUANTITY_F_R,
    GONIO_QUANTITY_BRF,
    GONIO_QUANTITY_PERCENT,
    GONIO_QUANTITY_F_R_COS
} gonio_quantity;
enum { GONIO_MIRROR_UNSTATED, GONIO_MIRROR_AT_0, GONIO_MIRROR_AT_180 };

enum { GONIO_MAPPED_ITEMS = 64 };

typedef struct gonio_mapping {
    gonio_mapped_item items[GONIO_MAPPED_ITEMS];
    int n;
    char separator, decimal; // 0: as the text shows
    bool is_signed, radians;
    bool elevation; // polar angles count from the surface
    gonio_quantity quantity;
    int mirror_at;
    const char *wavelength; // column; NULL: none
} gonio_mapping;

// From the values of the format's options. GONIO_E_USAGE where they are none.
gonio_status gonio_mapping_parse(const gonio_format_values *values, gonio_mapping *mapping, gonio_error *error);

#endif
