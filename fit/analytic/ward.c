// SPDX-License-Identifier: BSD-3-Clause
// Ward 1992 (Kameya 2002, eq. 3.3), brdf/analytic/ward.c; elliptical for anisotropic samples.
#include "fit/analytic/plan.h"

extern const gonio_formula gonio_formula_ward;

static const gonio_analytic_variable isotropic[] = {{"alpha", GONIO_VARY_LOG, 1e-3, 2, 2, 3, 0}, {0}};
// The axes are those of the data.
static const gonio_analytic_variable anisotropic[] = {
    {"alpha_x", GONIO_VARY_LOG, 1e-3, 2, 2, 2, 0}, {"alpha_y", GONIO_VARY_LOG, 1e-3, 2, 3, 3, 0}, {0}};

static const gonio_analytic_plan plan = {.formula = &gonio_formula_ward,
                                         .isotropic = isotropic,
                                         .anisotropic = anisotropic,
                                         .diffuse = 0,
                                         .lobes = 1,
                                         .lobes_max = 3};

GONIO_ANALYTIC_METHOD(ward, "ward", "Gaussian lobes of slopes, and a diffuse term", gonio_analytic_lobe_options);
