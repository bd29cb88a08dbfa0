// Methods "auto" and "lsq": least-squares splines, with or without a lobe under them.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/auto_choose.h"
#include "fit/method.h"

static bool mirrored(const gonio_samples *samples, const gonio_fit_options *options) {
    return options->symmetry == GONIO_SYMMETRY_AUTO ? samples->isotropic
                                                    : (options->symmetry & GONIO_SYMMETRY_MIRROR) != 0;
}

// Forced reciprocity outside half-vector coordinates: swapped copies of the samples.
static bool needs_swapped(const gonio_fit_options *options) {
    return options->symmetry != GONIO_SYMMETRY_AUTO && (options->symmetry & GONIO_SYMMETRY_RECIPROCITY) != 0;
}

static gonio_status fit_small(const gonio_lsq_data *data, const gonio_samples *samples,
                              const gonio_fit_options *options, bool lobes, gonio_model **out, gonio_fit_report *report,
                              gonio_error *error) {
    gonio_auto_choice choice;
    gonio_status status = gonio_auto_choose(data, options, lobes, &choice, error);
    if (status != GONIO_OK) {
        return status;
    }
    const gonio_auto_trial *chosen = &choice.trials[choice.chosen];
    gonio_lobe_model_parts parts;
    status = gonio_lsq_dense_parts(choice.dense, data, &choice.bases[chosen->base], choice.lambdas, &parts, error);
    if (status == GONIO_OK) {
        parts.channel_names = (const char(*)[32])samples->channel_names;
        status = gonio_lobe_model_new(&parts, out, error);
        gonio_lobe_model_parts_release(&parts);
    }
    if (status == GONIO_OK) {
        report->level = chosen->form.level;
        report->coordinates = chosen->form.coordinates;
        report->channels = samples->channels;
        gonio_auto_describe(&choice, report);
    }
    gonio_auto_choice_release(&choice);
    return status;
}

static gonio_status fit_any(const gonio_samples *samples, const gonio_fit_options *options, bool lobes,
                            gonio_model **out, gonio_fit_report *report, gonio_error *error) {
    *out = NULL;
    const gonio_lsq_data_options how = {.mirror = mirrored(samples, options),
                                        .domain = options->domain_set ? options->domain : GONIO_LOG,
                                        .reciprocal = needs_swapped(options)};
    gonio_lsq_data data;
    gonio_status status = gonio_lsq_data_init(&data, samples, &how, error);
    if (status != GONIO_OK) {
        return status;
    }
    report->domain = data.kind == GONIO_LINK_LINEAR ? GONIO_LINEAR : GONIO_LOG;
    if (data.n > GONIO_LSQ_DENSE_MAX) {
        gonio_lsq_data thin;
        status = gonio_lsq_data_thin(&data, GONIO_LSQ_DENSE_MAX, options->seed, &thin, error);
        if (status == GONIO_OK) {
            status = fit_small(&thin, samples, options, lobes, out, report, error);
            gonio_lsq_data_release(&thin);
        }
    } else {
        status = fit_small(&data, samples, options, lobes, out, report, error);
    }
    gonio_lsq_data_release(&data);
    return status;
}

static gonio_status fit_auto(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                             gonio_fit_report *report, gonio_error *error) {
    return fit_any(samples, options, true, out, report, error);
}

static gonio_status fit_lsq(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                            gonio_fit_report *report, gonio_error *error) {
    return fit_any(samples, options, false, out, report, error);
}

const gonio_fit_method gonio_method_auto = {
    .summary = "lobes and a least-squares spline of the ratio to them, all chosen from the training data",
    .levels = true,
    .fit = fit_auto,
};

const gonio_fit_method gonio_method_lsq = {
    .summary = "least-squares B-spline with a second-difference penalty",
    .levels = true,
    .fit = fit_lsq,
};
