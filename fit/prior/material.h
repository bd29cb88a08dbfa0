// SPDX-License-Identifier: BSD-3-Clause
// What materials look like before one is measured: a distribution of physical BRDFs.
//
// A material is a point of the unit cube, which the prior fills evenly: diffuse (Lambert's or Oren and Nayar's) and up
// to two lobes of one of four families, each with a width, a Fresnel term and a share of the light. Each is reciprocal
// and isotropic (or has one pair of axes), and none has a scale: the samples give it.
#ifndef GONIO_FIT_PRIOR_MATERIAL_H
#define GONIO_FIT_PRIOR_MATERIAL_H

#include "brdf/analytic/formula.h"

#define GONIO_MATERIAL_DIMS 12

typedef struct gonio_material {
    double place[GONIO_MATERIAL_DIMS]; // in the unit cube; what follows is made of it
    int lobes;
    double slope; // of the diffuse facets; 0: Lambert
    struct {
        int family;
        double alpha[2], f0, strength;
    } lobe[2];
    double turn[2]; // cosine and sine of the axes' azimuth
} gonio_material;

// isotropic: the lobes' axes do not matter.
void gonio_material_of(const double place[GONIO_MATERIAL_DIMS], bool isotropic, gonio_material *out);
// ln f_r, up to a constant of the material.
double gonio_material_ln(const gonio_material *material, const gonio_lobe_geometry *geometry);

#endif
