// The direct solver's profile (fit/profile.h): a second term of the prior.
#ifndef GONIO_FIT_LSQ_PROFILE_H
#define GONIO_FIT_LSQ_PROFILE_H

#include "fit/lsq_dense.h"

typedef struct gonio_lsq_profile gonio_lsq_profile;

void gonio_lsq_profile_free(gonio_lsq_profile *profile); // NULL is allowed
// Make (*profile NULL) or change the profile of a solver's samples to the level and stiffness of the solver's form.
gonio_status gonio_lsq_profile_set(gonio_lsq_profile **profile, const gonio_lsq_dense *dense, gonio_error *error);
// out (n x n, lower triangle) += weight times the profile's covariance between the samples.
void gonio_lsq_profile_add(const gonio_lsq_profile *profile, double weight, double *out);
// cross[n x m] and prior[m] as in gonio_lsq_dense_spread, the profile's share; at: m positions in the solver's
// coordinates.
gonio_status gonio_lsq_profile_cross(const gonio_lsq_profile *profile, double weight, size_t m, const double *at,
                                     double *cross, double *prior, gonio_error *error);
// The profile's control points from representer weights (n x channels, sample fastest); the caller releases the
// lattice.
gonio_status gonio_lsq_profile_solve(const gonio_lsq_profile *profile, double weight, const double *weights,
                                     int channels, gonio_lattice *lattice, gonio_error *error);

#endif
