// SPDX-License-Identifier: BSD-3-Clause
// Koenderink et al. 1996 (Kameya 2002, eq. A.1-A.3), brdf/kind/koenderink.c: 55 terms at order 8.
#include "fit/linear/ridge.h"

static gonio_status fit(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                        gonio_fit_report *report, gonio_error *error) {
    return gonio_ridge_fit(&gonio_basis_koenderink, samples, options, out, report, error);
}

static const gonio_method_form forms[] = {GONIO_METHOD_FORM_AUTO};

const gonio_method gonio_method_koenderink = {
    .name = "koenderink",
    .summary = "Zernike polynomials of both directions, by least squares with a ridge",
    .kind = "koenderink",
    .options = gonio_ridge_options,
    .fit = fit,
    .memory = gonio_ridge_memory,
    .forms = forms,
    .forms_n = sizeof forms / sizeof *forms,
};
