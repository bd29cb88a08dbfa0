// SPDX-License-Identifier: BSD-3-Clause
// Models of kind "transformed": another model, of any kind, brought nearer to a property.
#ifndef GONIO_BRDF_KIND_TRANSFORMED_H
#define GONIO_BRDF_KIND_TRANSFORMED_H

#include "gonio/model.h"

typedef enum gonio_transformation {
    GONIO_MADE_RECIPROCAL, // towards the mean of f and its exchanged value
    GONIO_MADE_ISOTROPIC,  // towards the mean over the azimuths of the sample
    GONIO_MADE_SCALED,     // times a factor that depends on theta_i
    GONIO_MADE_PASSIVE,    // times a factor of theta_i and the same of theta_o, which keeps reciprocity
    GONIO_MADE_SEPARABLE,  // towards a sum of products of tables
    GONIO_TRANSFORMATIONS
} gonio_transformation;

#define GONIO_TRANSFORMED_TURNS 32 // azimuths of GONIO_MADE_ISOTROPIC
#define GONIO_TRANSFORMED_PRODUCTS_MAX 64

typedef struct gonio_transformed_parts {
    gonio_transformation what;
    double delta;   // 0: the model as it is; 1: the property
    bool geometric; // on the way by powers instead of a line, where both values are positive
    // SCALED, PASSIVE: factors[knots] at thetas from 0 to 90 deg at equal steps, linear between them. 2 or more.
    size_t knots;
    const double *factors;
    // SEPARABLE: the products' tables [products][channels][2][thetas][phis], 0 of wi and 1 of wo, at the middles of
    // equal steps of theta and at equal steps of azimuth from 0 on; linear between them.
    size_t products, thetas, phis;
    const double *tables;
} gonio_transformed_parts;

// Takes over `inner`, on success only; the tables are copied. The caller frees the model.
gonio_status gonio_transformed_new(gonio_model *inner, const gonio_transformed_parts *parts, gonio_model **out,
                                   gonio_error *error);
// Free the transformed model and give its inner one back to the caller.
void gonio_transformed_abandon(gonio_model *model);

#endif
