// Method "mba": multilevel B-splines on a dense lattice; coordinates, domain and level chosen by held-out error where
// the options leave them open.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/choose.h"
#include "fit/lattice_model.h"
#include "fit/mba.h"
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

static gonio_status fit_mba(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                            gonio_fit_report *report, gonio_error *error) {
    gonio_mba_choice choice;
    gonio_status status = gonio_mba_choose(samples, options, &choice, error);
    if (status == GONIO_OK) {
        status = fit_chosen(samples, options, &choice, out, error);
    }
    if (status == GONIO_OK) {
        report->level = choice.level;
        report->coordinates = choice.scatter.coordinates;
        report->domain = choice.scatter.domain;
        snprintf(report->options, sizeof report->options, "level=%d", choice.level);
        snprintf(report->note, sizeof report->note, "%s", choice.note);
    }
    return status;
}

const gonio_fit_method gonio_method_mba = {
    .summary = "multilevel B-splines (Lee, Wolberg and Shin 1997; Kameya 2002)",
    .levels = true,
    .fit = fit_mba,
};
