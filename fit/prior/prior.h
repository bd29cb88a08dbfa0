// SPDX-License-Identifier: BSD-3-Clause
// What samples say of a material where there are none: the materials that could have given them.
//
// A set of materials (fit/prior/material.h), more of them where the samples make them likelier, stands for the
// posterior: found by sequential Monte Carlo with tempering (Del Moral, Doucet and Jasra, "Sequential Monte Carlo
// samplers", 2006). Each deviates from the samples by a Gaussian process (fit/prior/kernel.h) of a scale that is not
// known, and is carried through the samples by its mean, as a draw of the posterior of material and process together
// (Matheron's rule: Wilson et al., "Pathwise conditioning of Gaussian processes", 2021).
#ifndef GONIO_FIT_PRIOR_PRIOR_H
#define GONIO_FIT_PRIOR_PRIOR_H

#include "fit/prior/kernel.h"
#include "fit/prior/material.h"

#define GONIO_PRIOR_MATERIALS 128

typedef struct gonio_prior {
    gonio_dataset data; // spread over the set
    gonio_prior_kernel kernel;
    int materials_n;               // 0: a signed quantity, of which physics says nothing
    gonio_lobe_geometry *geometry; // [n]
    double *target;                // [n] ln of the value, mean over channels
    double *colour;                // n x channels: what each channel is above that
    gonio_material materials[GONIO_PRIOR_MATERIALS];
    double offset[GONIO_PRIOR_MATERIALS]; // ln of the material's scale
    double scale[GONIO_PRIOR_MATERIALS];  // standard deviation of what it deviates
    double draw[GONIO_PRIOR_MATERIALS];   // and how many of those it deviates where no sample tells
    double *misfit;                       // n x materials, sample fastest
    double *weights;                      // [n]
} gonio_prior;

// Of the measured geometries. Release with gonio_prior_release.
gonio_status gonio_prior_init(gonio_prior *prior, const gonio_dataset *data, gonio_error *error);
void gonio_prior_release(gonio_prior *prior);
// The samples' support of a pair.
double gonio_prior_support(gonio_prior *prior, const gonio_pair *pair);
// ln of the value (mean over channels) that each material has there; returns the support. colour[channels] (may
// be NULL): what each channel is above that.
double gonio_prior_at(gonio_prior *prior, const gonio_pair *pair, double out[GONIO_PRIOR_MATERIALS], double *colour);

#endif
