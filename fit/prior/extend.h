// SPDX-License-Identifier: BSD-3-Clause
// Beyond the samples a fit goes over to physics: what the prior expects there stands beside them.
#ifndef GONIO_FIT_PRIOR_EXTEND_H
#define GONIO_FIT_PRIOR_EXTEND_H

#include "fit/prior/prior.h"

// Below this support a place is the prior's: that of a place half a correlation length from a single sample is 0.77.
#define GONIO_PRIOR_SUPPORTED 0.8

// Add to the data what the prior expects at places that it does not support, weighted by how sure it is of each;
// nothing where the samples leave hardly any, or are too few to tell a lobe. No incidence gets more light than falls
// in, unless the samples say so.
gonio_status gonio_prior_extend(gonio_prior *prior, gonio_dataset *data, gonio_error *error);

// What each material is off the values that were added to the data, as transformed values of the middle channel:
// errors[added x materials], place fastest.
void gonio_prior_errors(gonio_prior *prior, const gonio_dataset *data, double *errors);

// The square of half of what 95 % of the materials are off at most; off[] is reordered.
double gonio_prior_variance(double off[GONIO_PRIOR_MATERIALS]);

// Variance of the relative error of value[channels] at a pair, as the prior has it.
double gonio_prior_spread(gonio_prior *prior, const gonio_pair *pair, const double *value);

#endif
