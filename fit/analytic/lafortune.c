// SPDX-License-Identifier: BSD-3-Clause
// Lafortune et al. 1997 (Kameya 2002, eq. A.4-A.5), brdf/analytic/lafortune.c: three numbers a lobe and a constant, 10
// for three lobes. cz is 1, since the coefficients' length and the strength are one number. cx below 0 makes a lobe
// about the mirror direction, above 0 one back to the light; ln |cx| times n is the logarithm of how much brighter the
// lobe is at grazing incidence than at normal: between 0 and 12 in published fits, so starts look
// there, and as far below.
#include "fit/analytic/plan.h"

extern const gonio_formula gonio_formula_lafortune;

#define SIDE                                                                                                           \
    { "side", GONIO_VARY_SIGN, -1, 0.3, 2, 3, 0 }
#define POWER                                                                                                          \
    { "n", GONIO_VARY_LOG, 0.5, 1e5, 5, 5, 0 }
// |cx| between 0.1 and 10.
#define GAIN_LOW -2.3
#define GAIN_HIGH 2.3

static const gonio_analytic_variable isotropic[] = {
    SIDE, POWER, {"cxy", GONIO_VARY_FACTOR, GAIN_LOW, GAIN_HIGH, 2, 3, 2}, {0}};
// The axes are those of the data.
static const gonio_analytic_variable anisotropic[] = {SIDE,
                                                      POWER,
                                                      {"cx", GONIO_VARY_FACTOR, GAIN_LOW, GAIN_HIGH, 2, 2, 2},
                                                      {"cy", GONIO_VARY_FACTOR, GAIN_LOW, GAIN_HIGH, 3, 3, 2},
                                                      {0}};

const gonio_analytic_plan gonio_analytic_plan_lafortune = {.formula = &gonio_formula_lafortune,
                                                           .isotropic = isotropic,
                                                           .anisotropic = anisotropic,
                                                           .diffuse = 0,
                                                           .lobes = 3,
                                                           .lobes_max = 5};

#define plan gonio_analytic_plan_lafortune
GONIO_ANALYTIC_METHOD(lafortune, "lafortune", "generalised cosine lobes, and a diffuse term",
                      gonio_analytic_lobe_options);
