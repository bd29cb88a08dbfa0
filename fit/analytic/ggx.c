// SPDX-License-Identifier: BSD-3-Clause
// Walter et al. 2007, brdf/analytic/ggx.c, with Smith's masking and Schlick's Fresnel term; elliptical for
// anisotropic samples.
#include "fit/analytic/plan.h"

extern const gonio_formula gonio_formula_ggx;

static const gonio_analytic_variable isotropic[] = {
    {"alpha", GONIO_VARY_LOG, 1e-3, 2, 2, 3, 0}, {"f0", GONIO_VARY_LINEAR, 0, 1, 4, 4, 0}, {0}};
// The axes are those of the data.
static const gonio_analytic_variable anisotropic[] = {{"alpha_x", GONIO_VARY_LOG, 1e-3, 2, 2, 2, 0},
                                                      {"alpha_y", GONIO_VARY_LOG, 1e-3, 2, 3, 3, 0},
                                                      {"f0", GONIO_VARY_LINEAR, 0, 1, 4, 4, 0},
                                                      {0}};

static const gonio_analytic_plan plan = {.formula = &gonio_formula_ggx,
                                         .isotropic = isotropic,
                                         .anisotropic = anisotropic,
                                         .diffuse = 0,
                                         .lobes = 2,
                                         .lobes_max = 3};

GONIO_ANALYTIC_METHOD(ggx, "ggx", "microfacets with GGX's tails, and a diffuse term", gonio_analytic_lobe_options);
