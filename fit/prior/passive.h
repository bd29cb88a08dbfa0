// SPDX-License-Identifier: BSD-3-Clause
// No surface reflects more light than falls in: how much a material does, and by what its unsupported part must be
// lowered.
#ifndef GONIO_FIT_PRIOR_PASSIVE_H
#define GONIO_FIT_PRIOR_PASSIVE_H

#include "fit/prior/prior.h"
#include "gonio/model.h"

#define GONIO_PASSIVE_INCIDENCES 7 // spread over 0 to 90 deg

// For each incidence the factor of what has less than this support that leaves an albedo of 1 at most (of the channel
// that reflects most); 1 where that is so, or where the supported part alone reflects more.
void gonio_passive_factors(gonio_prior *prior, double supported, double factor[GONIO_PASSIVE_INCIDENCES]);
// Between the incidences, of the smaller of a pair's two.
double gonio_passive_factor(const double factor[GONIO_PASSIVE_INCIDENCES], const gonio_pair *pair);
// A model's albedo at an incidence, of the channel that reflects most: to some per cent, of 768 directions.
double gonio_passive_albedo(const gonio_model *model, double theta_i);

#endif
