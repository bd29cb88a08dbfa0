// SPDX-License-Identifier: BSD-3-Clause
// A lattice's channels at a position, summed in double, for models whose eval promises more than a lattice's own
// rounding.
#ifndef GONIO_BRDF_SPLINE_ROWS_DOUBLE_H
#define GONIO_BRDF_SPLINE_ROWS_DOUBLE_H

#include "brdf/spline/lattice_eval.h"

// values[count]: channels first .. first + count of a lattice of 2 to 4 dimensions.
void gonio_lattice_eval_double(const gonio_lattice *lattice, const gonio_position *position, size_t first, size_t count,
                               double *values);

#endif
