// SPDX-License-Identifier: BSD-3-Clause
// Methods "cook-torrance" and "ggx": two lobes and a diffuse term, nothing else.
#include <stdio.h>
#include <stdlib.h>

#include "fit/lobes/fit.h"
#include "fit/memory.h"
#include "fit/smooth/loo.h"

static void describe(const gonio_lobe_base *base, gonio_fit_report *report) {
    snprintf(report->options, sizeof report->options, "alpha=%.4g:%.4g f0=%.3g:%.3g", base->alpha[0], base->alpha[1],
             base->f0[0], base->f0[1]);
    snprintf(report->note, sizeof report->note, "shapes shared by the channels; strengths are each channel's own");
}

static gonio_status fit_lobes(const gonio_samples *samples, gonio_lobe_family family, gonio_model **out,
                              gonio_fit_report *report, gonio_error *error) {
    *out = NULL;
    const gonio_dataset_options how = {.mirror = samples->isotropic, .domain = GONIO_LOG};
    gonio_dataset data;
    gonio_status status = gonio_dataset_init(&data, samples, &how, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_lobe_base base = {0};
    gonio_lobe_spline_parts parts = {0};
    // A second lobe of three more numbers needs samples of its own.
    status = gonio_lobe_fit(&data, family, data.n >= 14 ? 2 : 1, &base, error);
    if (status == GONIO_OK) {
        status = gonio_smooth_parts_init(&parts, &data, &base, GONIO_HALF_VECTOR, error);
        describe(&base, report);
    }
    if (status == GONIO_OK) {
        parts.channel_names = (const char(*)[32])samples->channel_names;
        status = gonio_lobe_spline_new(&parts, out, error);
    }
    report->coordinates = GONIO_HALF_VECTOR;
    report->domain = GONIO_LOG;
    free(base.strength);
    gonio_lobe_spline_parts_release(&parts);
    gonio_dataset_release(&data);
    return status;
}

// Nothing is left open.
static const gonio_method_option no_options[] = {{0}};
static const gonio_method_form forms[] = {GONIO_METHOD_FORM_AUTO};

static gonio_status fit_cook_torrance(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                                      gonio_fit_report *report, gonio_error *error) {
    (void)options;
    return fit_lobes(samples, GONIO_LOBE_COOK_TORRANCE, out, report, error);
}

static gonio_status fit_ggx(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                            gonio_fit_report *report, gonio_error *error) {
    (void)options;
    return fit_lobes(samples, GONIO_LOBE_GGX, out, report, error);
}

const gonio_method gonio_method_cook_torrance = {
    .name = "cook-torrance",
    .summary = "two Cook-Torrance lobes and a diffuse term",
    .kind = "lobe-spline",
    .options = no_options,
    .fit = fit_cook_torrance,
    .memory = gonio_lattice_fit_memory,
    .forms = forms,
    .forms_n = sizeof forms / sizeof *forms,
};

const gonio_method gonio_method_ggx = {
    .name = "ggx",
    .summary = "two GGX lobes and a diffuse term",
    .kind = "lobe-spline",
    .options = no_options,
    .fit = fit_ggx,
    .memory = gonio_lattice_fit_memory,
    .forms = forms,
    .forms_n = sizeof forms / sizeof *forms,
};
