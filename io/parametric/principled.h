// SPDX-License-Identifier: BSD-3-Clause
// What the parametric formats share: one diffuse part and one GGX lobe, fitted to a model (io/parametric/fit.c), and
// what each format's own definition makes of the parameters that it writes.
#ifndef GONIO_IO_PARAMETRIC_PRINCIPLED_H
#define GONIO_IO_PARAMETRIC_PRINCIPLED_H

#include "io/format.h"

typedef struct gonio_principled {
    double alpha_x, alpha_y;  // GGX
    double diffuse[3], f0[3]; // albedo; Schlick's reflectance at normal incidence
    bool metal;               // no diffuse part: f0 is the base colour
} gonio_principled;

typedef enum gonio_principled_rule {
    GONIO_PRINCIPLED_GLTF,    // the diffuse part times 1 - the largest channel's Fresnel term
    GONIO_PRINCIPLED_OPENPBR, // the same, times the part of the light that the specular layer lets through on average
    GONIO_PRINCIPLED_BLENDER, // the diffuse part as it is, f0 at most 0.08
} gonio_principled_rule;

// Least squares of relative errors over pairs up to 75 deg, the lobe's widths by search, the rest linear.
gonio_status gonio_principled_fit(const gonio_model *model, gonio_principled_rule rule, int threads,
                                  gonio_principled *out, gonio_error *error);
// A model of r, g, b of those parameters. The caller frees it.
gonio_status gonio_principled_model(const gonio_principled *parameters, gonio_principled_rule rule, gonio_model **out,
                                    gonio_error *error);
// Fill what the report says of any parametric format.
void gonio_principled_tell(const gonio_model *model, const gonio_principled *p, gonio_write_report *told);
// A number as these files have it: six digits, so that equal parameters are equal text.
double gonio_principled_rounded(double value);
// The index of refraction whose reflectance at normal incidence is f0.
double gonio_principled_ior(double f0);

#endif
