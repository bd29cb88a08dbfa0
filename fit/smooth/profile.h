// SPDX-License-Identifier: BSD-3-Clause
// The direct solver's profile (brdf/spline/profile.h): a second term of the prior.
#ifndef GONIO_FIT_SMOOTH_PROFILE_H
#define GONIO_FIT_SMOOTH_PROFILE_H

#include "fit/smooth/dense.h"

typedef struct gonio_smooth_profile gonio_smooth_profile;

void gonio_smooth_profile_free(gonio_smooth_profile *profile); // NULL is allowed
// Make (*profile NULL) or change the profile of a solver's samples to the level and stiffness of the solver's form.
gonio_status gonio_smooth_profile_set(gonio_smooth_profile **profile, const gonio_smooth_dense *dense,
                                      gonio_error *error);
// out (n x n, lower triangle) += weight times the profile's covariance between the samples.
void gonio_smooth_profile_add(const gonio_smooth_profile *profile, double weight, double *out);
// cross[n x m] and prior[m] as in gonio_smooth_dense_spread, the profile's share; at: m positions in the solver's
// coordinates.
gonio_status gonio_smooth_profile_cross(const gonio_smooth_profile *profile, double weight, size_t m, const double *at,
                                        double *cross, double *prior, gonio_error *error);
// The profile's control points from representer weights (n x channels, sample fastest); the caller releases the
// lattice.
gonio_status gonio_smooth_profile_solve(const gonio_smooth_profile *profile, double weight, const double *weights,
                                        int channels, gonio_lattice *lattice, gonio_error *error);

#endif
