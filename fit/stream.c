// SPDX-License-Identifier: BSD-3-Clause
// Streaming: samples are kept as they come; a provisional model, refitted whenever the set has grown by a half,
// predicts each new sample before it is added. Finishing is the batch fit of all, so it equals that bit for bit.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/memory.h"

#define FIRST_FIT 24 // below, an error says nothing yet
#define WINDOW 4096  // the running error is over the latest predictions
#define PROVISIONAL_LEVEL 5

struct gonio_fit_stream {
    gonio_samples *samples;
    gonio_fit_options options, provisional_options;
    char *method;
    gonio_model *provisional;
    size_t next_fit, next_check;
    double *squares; // [WINDOW] squared errors, mean over channels
    size_t predicted;
};

gonio_status gonio_fit_stream_new(int channels, const char (*channel_names)[32], const gonio_fit_options *options,
                                  gonio_fit_stream **out, gonio_error *error) {
    gonio_fit_stream *stream = *out = calloc(1, sizeof *stream);
    if (stream == NULL || (stream->squares = calloc(WINDOW, sizeof *stream->squares)) == NULL) {
        gonio_fit_stream_free(stream);
        *out = NULL;
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a streamed fit");
    }
    const gonio_status status = gonio_samples_new(channels, false, &stream->samples, error);
    if (status != GONIO_OK) {
        gonio_fit_stream_free(stream);
        *out = NULL;
        return status;
    }
    memcpy(stream->samples->channel_names, channel_names, (size_t)channels * sizeof *channel_names);
    stream->options = *options;
    if (options->method != NULL) {
        stream->method = strdup(options->method);
        stream->options.method = stream->method;
    }
    gonio_fit_options_default(&stream->provisional_options);
    stream->provisional_options.method = "mba";
    stream->provisional_options.level = PROVISIONAL_LEVEL;
    stream->provisional_options.coordinates = options->coordinates; // open: mba's own
    stream->provisional_options.domain = options->domain != GONIO_DOMAIN_AUTO ? options->domain : GONIO_LOG;
    stream->provisional_options.hold_out = 0;
    stream->next_fit = FIRST_FIT;
    return GONIO_OK;
}

void gonio_fit_stream_free(gonio_fit_stream *stream) {
    if (stream == NULL) {
        return;
    }
    gonio_samples_free(stream->samples);
    gonio_model_free(stream->provisional);
    free(stream->method);
    free(stream->squares);
    free(stream);
}

static void predict(gonio_fit_stream *stream, const gonio_pair *pair, const double *values) {
    const int channels = stream->samples->channels;
    double predicted[channels], sum = 0;
    gonio_model_eval_pair(stream->provisional, pair, predicted);
    for (int c = 0; c < channels; c++) {
        sum += (predicted[c] - values[c]) * (predicted[c] - values[c]);
    }
    stream->squares[stream->predicted++ % WINDOW] = sum / channels;
}

static gonio_status refit(gonio_fit_stream *stream, gonio_error *error) {
    gonio_model *model;
    const gonio_status status = gonio_fit(stream->samples, &stream->provisional_options, &model, NULL, error);
    if (status == GONIO_OK) {
        gonio_model_free(stream->provisional);
        stream->provisional = model;
        stream->next_fit = stream->samples->n + stream->samples->n / 2;
    }
    return status;
}

// The first uncertainties: the samples before have none, which a fit takes as a sigma of 0.
static gonio_status begin_sigma(gonio_fit_stream *stream, gonio_error *error) {
    const gonio_samples *old = stream->samples;
    gonio_samples *with;
    gonio_status status = gonio_samples_new(old->channels, true, &with, error);
    if (status != GONIO_OK) {
        return status;
    }
    memcpy(with->channel_names, old->channel_names, (size_t)old->channels * sizeof *old->channel_names);
    with->isotropic = old->isotropic;
    with->transmission = old->transmission;
    for (size_t i = 0; i < old->n && status == GONIO_OK; i++) {
        status = gonio_samples_add(with, &old->pairs[i], old->values + i * (size_t)old->channels, NULL, NULL, error);
    }
    gonio_samples_free(status == GONIO_OK ? stream->samples : with);
    stream->samples = status == GONIO_OK ? with : stream->samples;
    return status;
}

// Refuse samples that could be kept but no longer fitted.
static gonio_status check_memory(gonio_fit_stream *stream, size_t n, gonio_error *error) {
    if (n < stream->next_check) {
        return GONIO_OK;
    }
    const int level = stream->options.level >= 0 ? stream->options.level : PROVISIONAL_LEVEL;
    gonio_fit_size size = gonio_fit_size_of(stream->samples, &stream->options, level);
    size.samples = n;
    stream->next_check = n + n / 16;
    return gonio_fit_check_memory(&size, gonio_fit_memory_limit(stream->samples, &stream->options), error);
}

gonio_status gonio_fit_stream_add(gonio_fit_stream *stream, const gonio_samples *samples, gonio_error *error) {
    const size_t c = (size_t)stream->samples->channels;
    if (samples->channels != stream->samples->channels) {
        return gonio_fail(error, GONIO_E_INPUT, "%d channels; the streamed fit has %zu", samples->channels, c);
    }
    gonio_status status = check_memory(stream, stream->samples->n + samples->n, error);
    if (status == GONIO_OK && samples->sigma_random != NULL && stream->samples->sigma_random == NULL) {
        status = begin_sigma(stream, error);
    }
    if (status == GONIO_OK) {
        stream->samples->isotropic = stream->samples->isotropic && samples->isotropic;
        stream->samples->transmission = stream->samples->transmission || samples->transmission;
    }
    for (size_t i = 0; i < samples->n && status == GONIO_OK; i++) {
        if (stream->provisional != NULL) {
            predict(stream, &samples->pairs[i], samples->values + i * c);
        }
        const bool sigma = samples->sigma_random != NULL;
        status = gonio_samples_add(stream->samples, &samples->pairs[i], samples->values + i * c,
                                   sigma ? samples->sigma_random + i * c : NULL,
                                   sigma ? samples->sigma_systematic + i * c : NULL, error);
        if (status == GONIO_OK && stream->samples->n >= stream->next_fit) {
            status = refit(stream, error);
        }
    }
    return status;
}

double gonio_fit_stream_error(const gonio_fit_stream *stream) {
    const size_t n = stream->predicted < WINDOW ? stream->predicted : WINDOW;
    double sum = 0;
    for (size_t i = 0; i < n; i++) {
        sum += stream->squares[i];
    }
    return n > 0 ? sqrt(sum / (double)n) : NAN;
}

gonio_status gonio_fit_stream_finish(gonio_fit_stream *stream, gonio_model **out, gonio_fit_report *report,
                                     gonio_error *error) {
    return gonio_fit(stream->samples, &stream->options, out, report, error);
}
