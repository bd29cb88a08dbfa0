// SPDX-License-Identifier: BSD-3-Clause
#ifndef GONIO_FIT_CHECK_ALBEDO_H
#define GONIO_FIT_CHECK_ALBEDO_H

#include "gonio/check.h"

// gonio_check_albedo with so many evaluations.
void gonio_check_albedo_nodes(const gonio_model *model, double theta_i_rad, int nodes, double *albedo);
// The same at the azimuth `turn` of the sample, shared out over theta_o and added to shares[channels][knots] of the
// piecewise linear functions that are 1 at one of `knots` equal steps of theta_o from 0 to 90 deg and 0 at the others.
// Their sum is the albedo; with factors of theta_o at the knots, the albedo of f times the factor.
void gonio_check_albedo_shares(const gonio_model *model, double theta_i_rad, double turn, int nodes, size_t knots,
                               double *shares);

#endif
