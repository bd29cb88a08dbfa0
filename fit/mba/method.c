// SPDX-License-Identifier: BSD-3-Clause
// Method "mba": multilevel B-splines on a dense lattice, in Nusselt coordinates and the linear domain unless told
// otherwise; the level is chosen by held-out error where the options leave it open.
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/order_statistic.h"
#include "brdf/kind/lattice.h"
#include "fit/mba/choose.h"
#include "fit/mba/mba.h"
#include "fit/memory.h"
#include "fit/method.h"

static gonio_status fit_chosen(const gonio_samples *samples, const gonio_fit_options *options,
                               const gonio_mba_choice *choice, gonio_model **out, gonio_error *error) {
    gonio_scatter scatter;
    gonio_status status = gonio_scatter_init(&scatter, samples, &choice->scatter, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_lattice lattice = {0};
    status = gonio_mba_fit(&scatter, options->thesis ? NULL : scatter.mean, choice->level, options->threads, &lattice,
                           error);
    if (status == GONIO_OK) {
        status = gonio_lattice_model_new(&lattice, scatter.coordinates, scatter.kind, scatter.transforms,
                                         (const char(*)[32])samples->channel_names, out, error);
    }
    gonio_lattice_release(&lattice);
    gonio_scatter_release(&scatter);
    return status;
}

// A sum of positive and negative lobes cannot be exact everywhere: where the values span many decades, a linear fit
// leaks the peak over the far field. The middle of the data tells: half the magnitudes are below it.
#define LEAK_RANGE 1e5

static double dynamic_range(const gonio_samples *samples) {
    double range = 0, *magnitudes = malloc(samples->n * sizeof *magnitudes);
    for (size_t c = 0; c < (size_t)samples->channels && magnitudes != NULL; c++) {
        for (size_t i = 0; i < samples->n; i++) {
            magnitudes[i] = fabs(samples->values[i * (size_t)samples->channels + c]);
        }
        const double middle = gonio_order_statistic(magnitudes, samples->n, samples->n / 2);
        range = fmax(range, gonio_order_statistic(magnitudes, samples->n, samples->n - 1) / fmax(middle, DBL_MIN));
    }
    free(magnitudes);
    return range;
}

static void append(gonio_fit_report *report, const char *text) {
    const size_t length = strlen(report->note);
    snprintf(report->note + length, sizeof report->note - length, "%s%s", length > 0 ? "; " : "", text);
}

static void warn(const gonio_samples *samples, const gonio_fit_options *options, const gonio_mba_choice *choice,
                 const gonio_model *model, gonio_fit_report *report) {
    char text[200];
    const double bytes =
        gonio_mba_memory(model->isotropic ? 3 : 4, choice->level, model->channels, samples->n, options->threads);
    if (choice->scatter.domain == GONIO_LINEAR && dynamic_range(samples) > LEAK_RANGE) {
        append(report, "the peak is more than 1e5 times the median: the linear domain leaks it over the far field, "
                       "--domain log does not");
    }
    if (bytes > 1e9) {
        snprintf(text, sizeof text, "fitting level %d took %.3g GB of memory", choice->level, bytes / 1e9);
        append(report, text);
    }
}

static gonio_status fit_mba(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                            gonio_fit_report *report, gonio_error *error) {
    gonio_mba_choice choice;
    gonio_status status = gonio_mba_choose(samples, options, &choice, error);
    status = status == GONIO_OK ? fit_chosen(samples, options, &choice, out, error) : status;
    if (status == GONIO_OK) {
        report->level = choice.level;
        report->coordinates = choice.scatter.coordinates;
        report->domain = choice.scatter.domain;
        snprintf(report->options, sizeof report->options, "level=%d", choice.level);
        snprintf(report->note, sizeof report->note, "%s", choice.note);
        warn(samples, options, &choice, *out, report);
    }
    return status;
}

static const gonio_method_option options_of_mba[] = {GONIO_METHOD_OPTION(level, NULL),
                                                     GONIO_METHOD_OPTION(tolerance, NULL),
                                                     GONIO_METHOD_OPTION(coordinates, "nusselt"),
                                                     GONIO_METHOD_OPTION(domain, "linear"),
                                                     GONIO_METHOD_OPTION(symmetry, NULL),
                                                     GONIO_METHOD_OPTION(thesis, NULL),
                                                     GONIO_METHOD_OPTION(max_bytes, NULL),
                                                     {0}};

#define TRADEOFF_LEVEL_MAX 7
static const gonio_method_form forms[] = {{0, TRADEOFF_LEVEL_MAX, GONIO_METHOD_EVERY, GONIO_METHOD_EVERY, NULL}};

const gonio_method gonio_method_mba = {
    .name = "mba",
    .summary = "multilevel B-splines (Lee, Wolberg and Shin 1997; Kameya 2002)",
    .kind = "lattice",
    .options = options_of_mba,
    .fit = fit_mba,
    .memory = gonio_lattice_fit_memory,
    .forms = forms,
    .forms_n = sizeof forms / sizeof *forms,
};
