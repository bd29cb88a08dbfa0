// SPDX-License-Identifier: BSD-3-Clause
// Steps that the uncertainties of small and of large sets have in common.
#ifndef GONIO_FIT_SIGMA_FIELD_H
#define GONIO_FIT_SIGMA_FIELD_H

#include "brdf/kind/lobe_spline.h"
#include "fit/prior/prior.h"

// Of the transform's unit: no sigma is smaller, as no instrument's is; exact data fitted exactly leave rounding alone.
#define GONIO_SIGMA_EXACT 1e-4

// factor[c]: the spread of n x c residuals, the standard deviation of a normal with the same median size. work: [n].
void gonio_sigma_factors(size_t n, size_t c, const double *residuals, double *factor, double *work);
// Variance of the samples' noise in the factors' units, mean over channels; -1 where they do not tell it.
double gonio_sample_noise_variance(const gonio_dataset *data, const double *factor);
// What to add to the variance where a model's lobes (NULL: none) are held beyond the samples' angles.
double gonio_sigma_held_back(const gonio_dataset *data, const gonio_lobe_base *held, const double *factor,
                             const gonio_pair *pair);
// Places where to ask, spread over all pairs and about the lobe; their values are 0. Release with
// gonio_dataset_release.
gonio_status gonio_sigma_probes(gonio_dataset *probes, const gonio_dataset *data, gonio_error *error);
// Give the model its sigma and support: probes->targets are variances in the factors' units, probes->values what the
// places that physics added leave open beside them. Takes factor[channels] over.
gonio_status gonio_sigma_attach(gonio_dataset *probes, gonio_prior *prior, double *factor,
                                gonio_lobe_spline_parts *parts, gonio_error *error);

#endif
