// SPDX-License-Identifier: BSD-3-Clause
// Ashikhmin & Shirley 2000, brdf/analytic/ashikhmin_shirley.c. The strength is free beside f0; 1 is theirs.
#include "fit/analytic/plan.h"

extern const gonio_formula gonio_formula_ashikhmin_shirley;

static const gonio_analytic_variable isotropic[] = {
    {"n", GONIO_VARY_LOG, 0.2, 2e5, 2, 3, 0}, {"f0", GONIO_VARY_LINEAR, 0, 1, 4, 4, 0}, {0}};
// The axes are those of the data.
static const gonio_analytic_variable anisotropic[] = {{"n_u", GONIO_VARY_LOG, 0.2, 2e5, 2, 2, 0},
                                                      {"n_v", GONIO_VARY_LOG, 0.2, 2e5, 3, 3, 0},
                                                      {"f0", GONIO_VARY_LINEAR, 0, 1, 4, 4, 0},
                                                      {0}};

static const gonio_analytic_plan plan = {.formula = &gonio_formula_ashikhmin_shirley,
                                         .isotropic = isotropic,
                                         .anisotropic = anisotropic,
                                         .diffuse = 0,
                                         .lobes = 1,
                                         .lobes_max = 3};

GONIO_ANALYTIC_METHOD(ashikhmin_shirley, "ashikhmin-shirley",
                      "an anisotropic power of the half vector's cosine over a diffuse term",
                      gonio_analytic_lobe_options);
