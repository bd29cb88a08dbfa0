// SPDX-License-Identifier: BSD-3-Clause
// Samples that are a table: every incidence with every outgoing direction, once.
//
// DeYoung's uniform grid (3.1) is thetas x azimuths of equal steps on both sides; semi-uniform is one regular side; a
// matrix of patches (Klems) has direction sets of its own. All of them are a set of incidences times a set of outgoing
// directions. At a pole one azimuth stands for all. Isotropic tables hold the azimuths' difference, all round or half.
#ifndef GONIO_FIT_CHECK_TABLE_H
#define GONIO_FIT_CHECK_TABLE_H

#include "gonio/check.h"

#define GONIO_TABLE_NONE SIZE_MAX
#define GONIO_TABLE_TOLERANCE 2e-5 // rad: 0.001 deg; readers of files round to less

typedef struct gonio_table_direction {
    double theta, phi;
} gonio_table_direction;

typedef struct gonio_table {
    const gonio_samples *samples; // borrowed
    bool isotropic, folded;       // folded: azimuths 0 to 180 deg stand for the other half too
    bool uniform;                 // equal steps of theta and azimuth on both sides
    size_t n_in, n_out;           // directions that are stored
    gonio_table_direction *in, *out;
    size_t *cell; // [n_in][n_out] -> sample
    // Rings of equally spaced azimuths, poles left out; phis 0: there are none. Isotropic: `in` has thetas alone.
    size_t phis, thetas_in, thetas_out;
    size_t *ring_in, *ring_out; // [theta][azimuth] -> index of in, out
    // The matrix of (4.13): rows are incidences, columns outgoing directions, theta by theta; without rings as stored.
    size_t rows, columns;
    size_t *row_of_column, *column_of_row; // the same direction on the other side; GONIO_TABLE_NONE: it is not there
    // Projected solid angles of the outgoing directions that are stored: by (4.4) where the table is uniform, and by
    // cells (differences of sin^2), or triangles where azimuths are irregular.
    double *weight, *weight_cells;
    double covered; // of the projected hemisphere, by cells
} gonio_table;

// *out NULL where the samples are no table (GONIO_OK). The caller frees it; samples must outlive it.
gonio_status gonio_table_of(const gonio_samples *samples, gonio_table **out, gonio_error *error);
// An anisotropic one without samples, `cell` NULL: both lists ascending by theta, then azimuth.
gonio_status gonio_table_of_directions(const gonio_table_direction *in, size_t n_in, const gonio_table_direction *out,
                                       size_t n_out, gonio_table **table, gonio_error *error);
void gonio_table_free(gonio_table *table); // NULL is allowed

// The sample of a row and a column; and the pair of directions.
size_t gonio_table_at(const gonio_table *table, size_t row, size_t column);
gonio_pair gonio_table_pair(const gonio_table *table, size_t row, size_t column);
gonio_table_direction gonio_table_row(const gonio_table *table, size_t row);
gonio_table_direction gonio_table_column(const gonio_table *table, size_t column);
// Rows that differ from those before them: of an isotropic table with rings, each theta's first.
size_t gonio_table_row_step(const gonio_table *table);

#endif
