// SPDX-License-Identifier: BSD-3-Clause
// A tabulated density to draw directions from, for models of any kind (brdf/sampler.c).
#ifndef GONIO_BRDF_SAMPLER_H
#define GONIO_BRDF_SAMPLER_H

#include "gonio/model.h"

typedef struct gonio_sampler gonio_sampler;

// Nodes of the table; at least 2 tilts and rings, turns a multiple of 8. Isotropic models have one azimuth.
typedef struct gonio_sampler_size {
    int tilts, azimuths; // of the incident direction
    int turns, rings;    // about the mirror direction
} gonio_sampler_size;

// What gonio_model_prepare_sampling takes.
gonio_sampler_size gonio_sampler_standard(const gonio_model *model);
// Tabulate the model's f_r cos(theta_o), averaged over its channels. The caller frees it, which free() does
// as well; it does not refer to the model.
gonio_status gonio_sampler_new(const gonio_model *model, const gonio_sampler_size *size, gonio_sampler **out,
                               gonio_error *error);
void gonio_sampler_free(gonio_sampler *sampler); // NULL is allowed
size_t gonio_sampler_bytes(const gonio_sampler *sampler);
// As gonio_model_sample and gonio_model_pdf.
double gonio_sampler_sample(const gonio_sampler *sampler, gonio_vec3 wi, const double u[2], gonio_vec3 *wo);
double gonio_sampler_pdf(const gonio_sampler *sampler, gonio_vec3 wi, gonio_vec3 wo);

#endif
