// SPDX-License-Identifier: BSD-3-Clause
// Drawing directions from mixtures of lobes: the densities that a kind of model proposes for its own f_r cos(theta_o).
#ifndef GONIO_BRDF_LOBE_SAMPLING_H
#define GONIO_BRDF_LOBE_SAMPLING_H

#include "gonio/direction.h"

typedef enum gonio_proposal_shape {
    GONIO_PROPOSE_COSINE,   // cos(theta_o) / pi
    GONIO_PROPOSE_GGX,      // visible normals of GGX's distribution under Smith's shadowing; alpha_x, alpha_y
    GONIO_PROPOSE_BECKMANN, // visible normals of Beckmann's distribution in V-cavities; alpha_x, alpha_y
    GONIO_PROPOSE_POWER,    // visible normals of (n + 2) / (2 pi) cos^n(theta_h) in V-cavities; n = alpha_x
} gonio_proposal_shape;

typedef struct gonio_proposal {
    gonio_proposal_shape shape;
    double alpha_x, alpha_y;
    double strength; // about its albedo where Fresnel's term is 1
    double f0;       // of Schlick's term; 1: none
} gonio_proposal;

#define GONIO_PROPOSALS_MAX 32

// What stands in for a kind or a formula that proposes nothing: a cosine and a broad lobe.
int gonio_proposals_standard(gonio_proposal *out);

// Draw wo from the mixture of n proposals, each weighted with its albedo at wi; returns the mixture's density at wo
// (1/sr, above 0). A cosine of small weight is always in it, so that no direction is left out. u: two numbers of [0,
// 1).
double gonio_proposals_sample(const gonio_proposal *proposals, int n, gonio_vec3 wi, const double u[2], gonio_vec3 *wo);
// That density. It integrates to 1 over the directions above the surface.
double gonio_proposals_pdf(const gonio_proposal *proposals, int n, gonio_vec3 wi, gonio_vec3 wo);

#endif
