// SPDX-License-Identifier: BSD-3-Clause
// Sigma beyond the samples (fit/sigma/beyond.h).
//
// A law learnt from left-out samples knows gaps as wide as those among the samples. Samples of one plane say nothing
// of other planes, nor do five samples of anything. There the error is what the materials that could have given these
// samples differ from the model: a quantile of theirs (fit/prior/extend.h). Beside the samples it is what the fit
// passes on of the errors at the places that physics added, but no more than those materials differ there.
#include "fit/sigma/beyond.h"

#include <math.h>
#include <stdlib.h>

#include "fit/prior/extend.h"
#include "fit/sigma/tuning.h"

// How far the law is to be trusted.
static double trust(double support, size_t samples) {
    const double s = fmin(
        fmax((support - gonio_sigma_tuned.law_from) / (gonio_sigma_tuned.law_to - gonio_sigma_tuned.law_from), 0), 1);
    return s * s * (3 - 2 * s) * fmin((double)samples / gonio_sigma_tuned.law_samples, 1);
}

// The spread of the samples' targets: what is unknown of a signed quantity.
static double spread_of(const gonio_dataset *data) {
    double sum = 0, squares = 0;
    const double n = (double)data->n * data->channels;
    for (size_t i = 0; i < data->n * (size_t)data->channels; i++) {
        sum += data->targets[i] / n;
        squares += data->targets[i] * data->targets[i] / n;
    }
    return fmax(squares - sum * sum, 0);
}

// Of transformed values, mean over channels.
static double prior_variance(gonio_prior *prior, const gonio_model *model, const gonio_lobe_spline_parts *parts,
                             const gonio_pair *pair) {
    double value[GONIO_CHANNELS_MAX], square = 0;
    gonio_model_eval_pair(model, pair, value);
    for (int c = 0; c < parts->channels; c++) {
        const double y = value[c] / parts->transforms[c].scale;
        square += y * y / parts->channels;
    }
    return gonio_prior_spread(prior, pair, value) * (parts->kind == GONIO_TRANSFORM_LINEAR ? square : 1);
}

static void mix(gonio_prior *prior, const gonio_model *model, const gonio_lobe_spline_parts *parts, double unit,
                gonio_dataset *probes, double *support) {
    const double unknown = spread_of(&prior->data);
    const double most = parts->kind == GONIO_TRANSFORM_LINEAR
                            ? INFINITY
                            : gonio_sigma_tuned.law_most * gonio_sigma_tuned.law_most * unit;
    for (size_t i = 0; i < probes->n; i++) {
        const gonio_pair *pair = &probes->pairs[i];
        support[i] = gonio_prior_support(prior, pair);
        const double law = trust(support[i], prior->data.n);
        probes->targets[i] = fmin(probes->targets[i], most);
        if (law < 1 || probes->values[i] > 0) {
            const double variance = unit * (prior->materials_n > 0 ? prior_variance(prior, model, parts, pair)
                                                                   : unknown * (1 - support[i]));
            probes->targets[i] = law * (probes->targets[i] + fmin(probes->values[i], variance)) + (1 - law) * variance;
        }
    }
}

gonio_status gonio_sigma_beyond(gonio_prior *prior, gonio_lobe_spline_parts *parts, const double *factor,
                                gonio_dataset *probes, double *support, gonio_error *error) {
    char(*names)[32] = calloc((size_t)parts->channels, sizeof *names);
    gonio_model *model;
    double unit = 0; // of a variance in the factors' units
    for (int c = 0; c < parts->channels; c++) {
        unit += 1 / (factor[c] * factor[c]) / parts->channels;
    }
    if (names == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    parts->channel_names = (const char(*)[32])names;
    const gonio_status status = gonio_lobe_spline_new(parts, &model, error);
    if (status == GONIO_OK) {
        mix(prior, model, gonio_lobe_spline_about(model), unit, probes, support);
        gonio_lobe_spline_take(model, parts);
    }
    parts->channel_names = NULL;
    free(names);
    return status;
}
