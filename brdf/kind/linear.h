// SPDX-License-Identifier: BSD-3-Clause
// Models that are linear in their coefficients, f_r = sum_k a_k row_k(wi, wo), on a basis of functions that the kind
// gives. What a kind adds is its basis and its registration.
#ifndef GONIO_BRDF_KIND_LINEAR_H
#define GONIO_BRDF_KIND_LINEAR_H

#include "brdf/kind.h"

#define GONIO_LINEAR_TERMS_MAX 1024

typedef struct gonio_linear_basis {
    const gonio_kind *kind;
    const gonio_model_ops *plain; // the kind's without sigma
    int order_min, order_max[2];  // [isotropic]; max 0: there is no such form
    int order_usual[2];
    int (*terms)(int order, bool isotropic); // at most GONIO_LINEAR_TERMS_MAX
    // row[terms]; the first one is a constant.
    void (*row)(int order, bool isotropic, gonio_vec3 wi, gonio_vec3 wo, double *row);
} gonio_linear_basis;

extern const gonio_kind gonio_kind_koenderink, gonio_kind_harmonics;
extern const gonio_linear_basis gonio_basis_koenderink, gonio_basis_harmonics;

// The uncertainty of such a model: sigma of channel c at a row x is factors[c] |matrix x|.
typedef struct gonio_linear_spread {
    const float *matrix;   // [terms][terms]
    const double *factors; // [channels]
} gonio_linear_spread;

// coefficients[channels][terms] are copied, and so are the names and the spread (NULL: none). The caller frees the
// model.
gonio_status gonio_linear_new(const gonio_linear_basis *basis, int order, bool isotropic, int channels,
                              const double *coefficients, const gonio_linear_spread *spread, const char (*names)[32],
                              gonio_model **out, gonio_error *error);
// The coefficients [channels][terms], borrowed; NULL for a model of another basis.
const double *gonio_linear_coefficients(const gonio_model *model, const gonio_linear_basis *basis);

// ---- for the kinds ----
gonio_status gonio_linear_read(const gonio_linear_basis *basis, gonio_mapped *mapped, gonio_model **out,
                               gonio_error *error);
void gonio_linear_eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values);
double gonio_linear_eval_channel(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, int channel);
gonio_status gonio_linear_save(const gonio_model *model, FILE *stream, gonio_error *error);
void gonio_linear_free(gonio_model *model);

void gonio_linear_sigma(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *sigma);

// sigma_of NULL: of models without uncertainty.
#define GONIO_LINEAR_OPS(name, sigma_of)                                                                               \
    {                                                                                                                  \
        .kind = name, .eval = gonio_linear_eval, .eval_channel = gonio_linear_eval_channel, .sigma = sigma_of,         \
        .save = gonio_linear_save, .free = gonio_linear_free                                                           \
    }

#endif
