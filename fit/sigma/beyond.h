// SPDX-License-Identifier: BSD-3-Clause
// Where the samples say too little for a law of their residuals, sigma is the prior's.
#ifndef GONIO_FIT_SIGMA_BEYOND_H
#define GONIO_FIT_SIGMA_BEYOND_H

#include "brdf/kind/lobe_spline.h"
#include "fit/prior/prior.h"

// probes->targets: variances in the factors' units, the law's. Out: with what the added places leave open beside them
// (probes->values), and where there is little support the prior's spread about the model in their place.
// support[probes n].
gonio_status gonio_sigma_beyond(gonio_prior *prior, gonio_lobe_spline_parts *parts, const double *factor,
                                gonio_dataset *probes, double *support, gonio_error *error);

#endif
