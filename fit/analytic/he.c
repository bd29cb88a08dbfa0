// SPDX-License-Identifier: BSD-3-Clause
// He et al. 1991 (Kameya 2002, 3.2; DeYoung 1996, 2.1), brdf/analytic/he.c, heights and lengths in wavelengths.
#include "fit/analytic/plan.h"

extern const gonio_formula gonio_formula_he;

static const gonio_analytic_variable isotropic[] = {{"sigma", GONIO_VARY_LOG, 0.01, 1.5, 2, 2, 0},
                                                    {"tau", GONIO_VARY_LOG, 0.2, 50, 3, 3, 0},
                                                    {"f0", GONIO_VARY_LINEAR, 0, 1, 4, 4, 0},
                                                    {0}};

static const gonio_analytic_plan plan = {
    .formula = &gonio_formula_he, .isotropic = isotropic, .diffuse = -1, .lobes = 1, .lobes_max = 1};

GONIO_ANALYTIC_METHOD(he, "he", "a Gaussian random surface in wave optics, and a diffuse term", gonio_analytic_options);
