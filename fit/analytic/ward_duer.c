// SPDX-License-Identifier: BSD-3-Clause
// Duer 2005, brdf/analytic/ward_duer.c; elliptical for anisotropic samples.
#include "fit/analytic/plan.h"

extern const gonio_formula gonio_formula_ward_duer;

static const gonio_analytic_variable isotropic[] = {{"alpha", GONIO_VARY_LOG, 1e-3, 2, 2, 3, 0}, {0}};
// The axes are those of the data.
static const gonio_analytic_variable anisotropic[] = {
    {"alpha_x", GONIO_VARY_LOG, 1e-3, 2, 2, 2, 0}, {"alpha_y", GONIO_VARY_LOG, 1e-3, 2, 3, 3, 0}, {0}};

static const gonio_analytic_plan plan = {.formula = &gonio_formula_ward_duer,
                                         .isotropic = isotropic,
                                         .anisotropic = anisotropic,
                                         .diffuse = 0,
                                         .lobes = 1,
                                         .lobes_max = 3};

GONIO_ANALYTIC_METHOD(ward_duer, "ward-duer", "Ward's lobes with Duer's cosines, and a diffuse term",
                      gonio_analytic_lobe_options);
