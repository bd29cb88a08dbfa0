// SPDX-License-Identifier: BSD-3-Clause
// Burley 2012 and OpenPBR, brdf/analytic/principled.c: base colour a channel; metallic, specular, roughness and
// anisotropic shared by the channels. What a material has beyond them shows in the errors.
#include "fit/analytic/plan.h"

extern const gonio_formula gonio_formula_principled;

static const gonio_analytic_variable isotropic[] = {{"metallic", GONIO_VARY_LINEAR, 0, 1, 1, 1, 0},
                                                    {"specular", GONIO_VARY_LINEAR, 0, 1, 2, 2, 0},
                                                    {"roughness", GONIO_VARY_LINEAR, 0.02, 1, 3, 3, 0},
                                                    {0}};
// The axes are those of the data.
static const gonio_analytic_variable anisotropic[] = {{"metallic", GONIO_VARY_LINEAR, 0, 1, 1, 1, 0},
                                                      {"specular", GONIO_VARY_LINEAR, 0, 1, 2, 2, 0},
                                                      {"roughness", GONIO_VARY_LINEAR, 0.02, 1, 3, 3, 0},
                                                      {"anisotropic", GONIO_VARY_LINEAR, -1, 1, 4, 4, 0},
                                                      {0}};

static const gonio_analytic_plan plan = {.formula = &gonio_formula_principled,
                                         .isotropic = isotropic,
                                         .anisotropic = anisotropic,
                                         .diffuse = -1,
                                         .lobes = 1,
                                         .lobes_max = 1};

GONIO_ANALYTIC_METHOD(principled, "principled", "base colour, metallic, specular, roughness, anisotropic",
                      gonio_analytic_options);
