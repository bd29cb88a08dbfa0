// SPDX-License-Identifier: BSD-3-Clause
// Westin et al. 1992 (Kameya 2002, eq. 3.4), brdf/kind/harmonics.c.
#include "fit/linear/ridge.h"

static gonio_status fit(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                        gonio_fit_report *report, gonio_error *error) {
    return gonio_ridge_fit(&gonio_basis_harmonics, samples, options, out, report, error);
}

static const gonio_method_form forms[] = {GONIO_METHOD_FORM_AUTO};

const gonio_method gonio_method_spherical_harmonics = {
    .name = "spherical-harmonics",
    .summary = "spherical harmonics of both directions, by least squares with a ridge",
    .kind = "harmonics",
    .options = gonio_ridge_options,
    .fit = fit,
    .memory = gonio_ridge_memory,
    .forms = forms,
    .forms_n = sizeof forms / sizeof *forms,
};
