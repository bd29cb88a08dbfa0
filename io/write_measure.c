// SPDX-License-Identifier: BSD-3-Clause
// How far a table that was written lies from its model: read back by our own reader.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/random.h"
#include "base/statistics.h"
#include "base/thread_pool.h"
#include "io/colour.h"
#include "io/format.h"

#define PAIRS 20000
#define THETA_MAX_DEG 80
#define ALBEDO_RINGS 48 // of the outgoing hemisphere, equal in cos^2
#define ALBEDO_TURNS 96
static const double tilts_deg[GONIO_WRITE_TILTS] = {0, 30, 45, 70};

typedef struct job {
    const gonio_model *truth, *found; // found NULL: samples
    const gonio_samples *samples;
    const gonio_colour_weights *weights; // of the samples' channels, where the truth has others; NULL
    gonio_half halves[GONIO_HALVES];     // of the file
    int n_halves;
    size_t n;
    double *errors;
} job;

// Relative error of the sum over channels.
static double relative(const double *truth, const double *found, int channels) {
    double off = 0, all = 0;
    for (int c = 0; c < channels; c++) {
        off += fabs(found[c] - truth[c]);
        all += fabs(truth[c]);
    }
    return all > 0 ? off / all : off > 0 ? INFINITY : 0;
}

static gonio_pair random_pair(size_t k) {
    double u[4];
    for (size_t d = 0; d < 4; d++) {
        u[d] = gonio_random_uniform(gonio_random(7) + (4 * k + d) * GONIO_RANDOM_STEP);
    }
    const double reach = sin(gonio_radians(THETA_MAX_DEG));
    return (gonio_pair){asin(reach * sqrt(u[0])), 2 * GONIO_PI * u[1], asin(reach * sqrt(u[2])), 2 * GONIO_PI * u[3]};
}

static void measure_pair(const job *j, size_t k) {
    double truth[GONIO_CHANNELS_MAX], found[GONIO_CHANNELS_MAX];
    const gonio_half half = j->halves[k % (size_t)j->n_halves];
    const gonio_pair pair = j->samples != NULL ? j->samples->pairs[k] : gonio_pair_lowered(random_pair(k), half);
    gonio_model_eval_pair(j->truth, &pair, truth);
    if (j->samples != NULL) {
        const double *values = j->samples->values + k * (size_t)j->samples->channels;
        if (j->weights != NULL) {
            gonio_colour_rgb(j->weights, values, found);
        } else {
            memcpy(found, values, (size_t)j->truth->channels * sizeof *found);
        }
    } else {
        // A file of one reflection alone is looked at from its own side.
        const gonio_pair own = j->found->ops->both_sides ? pair : gonio_pair_raised(pair);
        gonio_model_eval_pair(j->found, &own, found);
    }
    const gonio_pair raised = gonio_pair_raised(pair);
    const double far = fmax(raised.theta_i, raised.theta_o);
    j->errors[k] = far <= gonio_radians(THETA_MAX_DEG) + 1e-9 ? relative(truth, found, j->truth->channels) : -1;
}

#define BLOCK 256

static void measure_block(void *context, size_t block) {
    const job *j = context;
    for (size_t k = block * BLOCK; k < j->n && k < (block + 1) * BLOCK; k++) {
        measure_pair(j, k);
    }
}

// What of the light goes into a half, summed over the channels.
static double albedo(const gonio_model *model, gonio_half half, double tilt) {
    double sum = 0, values[GONIO_CHANNELS_MAX];
    for (int j = 0; j < ALBEDO_RINGS; j++) {
        const double theta = asin(sqrt((j + 0.5) / ALBEDO_RINGS));
        for (int i = 0; i < ALBEDO_TURNS; i++) {
            const gonio_pair pair = {tilt, 0.3, theta, 2 * GONIO_PI * (i + 0.5) / ALBEDO_TURNS};
            const gonio_pair lowered = gonio_pair_lowered(pair, half);
            gonio_model_eval_pair(model, &lowered, values);
            for (int c = 0; c < model->channels; c++) {
                sum += values[c] * GONIO_PI / ALBEDO_RINGS / ALBEDO_TURNS;
            }
        }
    }
    return sum;
}

static gonio_status errors_of(job *j, size_t n, int threads, gonio_write_report *report, gonio_error *error) {
    double *errors = malloc((n + 1) * sizeof *errors);
    if (errors == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu errors", n);
    }
    j->n = n;
    j->errors = errors;
    gonio_pool_for(threads, (n + BLOCK - 1) / BLOCK, measure_block, j);
    size_t kept = 0;
    report->largest = 0;
    for (size_t k = 0; k < n; k++) {
        if (errors[k] >= 0) {
            report->largest = fmax(report->largest, errors[k]);
            errors[kept++] = errors[k];
        }
    }
    report->pairs = kept;
    gonio_sort(errors, kept);
    report->median = kept > 0 ? errors[kept / 2] : NAN;
    report->p95 = kept > 0 ? errors[kept * 95 / 100] : NAN;
    free(errors);
    return GONIO_OK;
}

static gonio_status figures(job *j, size_t n, int threads, gonio_write_report *report, gonio_error *error) {
    const gonio_status status = errors_of(j, n, threads, report, error);
    for (int k = 0; k < GONIO_WRITE_TILTS && status == GONIO_OK; k++) {
        const double tilt = gonio_radians(tilts_deg[k]);
        report->tilt_deg[k] = tilts_deg[k];
        report->albedo[k] = albedo(j->truth, j->halves[0], tilt) / j->truth->channels;
        report->albedo_error[k] =
            j->found != NULL ? albedo(j->found, j->found->ops->both_sides ? j->halves[0] : GONIO_REFLECTION, tilt) /
                                       j->truth->channels / report->albedo[k] -
                                   1
                             : NAN;
    }
    return status;
}

static void free_view(gonio_model *view, const gonio_model *model) {
    if (view != model) {
        gonio_model_free(view);
    }
}

// Of different channels, both as red, green and blue.
static gonio_status measure(const gonio_model *model, const gonio_model *found, const gonio_samples *samples,
                            int threads, gonio_write_report *report, gonio_error *error) {
    const int channels = found != NULL ? found->channels : samples->channels;
    const bool same = channels == model->channels;
    gonio_model *truth = (gonio_model *)(uintptr_t)model, *view = (gonio_model *)(uintptr_t)found;
    gonio_colour_weights weights = {0};
    gonio_status status = GONIO_OK;
    if (!same) {
        status = gonio_model_as_rgb(model, &truth, error);
        if (status == GONIO_OK) {
            status = found != NULL
                         ? gonio_model_as_rgb(found, &view, error)
                         : gonio_colour_new(channels, (const char(*)[32])samples->channel_names, &weights, error);
        }
    }
    report->channels = channels;
    if (status == GONIO_OK) {
        job j = {.truth = truth, .found = view, .samples = samples};
        j.weights = weights.weight != NULL ? &weights : NULL;
        for (int h = 0; h < GONIO_HALVES; h++) {
            if (report->halves >> h & 1) {
                j.halves[j.n_halves++] = (gonio_half)h;
            }
        }
        status = figures(&j, found != NULL ? PAIRS : samples->n, threads, report, error);
    }
    gonio_colour_free(&weights);
    free_view(truth, model);
    free_view(view, found);
    return status;
}

gonio_status gonio_write_measure(const gonio_model *model, const gonio_format *format, const char *path, int threads,
                                 gonio_write_report *report, gonio_error *error) {
    struct stat facts;
    gonio_model *found = NULL;
    gonio_samples *samples = NULL;
    report->bytes = stat(path, &facts) == 0 ? (size_t)facts.st_size : 0;
    report->at_its_nodes = format->table == NULL && format->meant == NULL;
    gonio_status status = format->meant != NULL  ? format->meant(model, threads, &found, error)
                          : report->at_its_nodes ? gonio_read(path, NULL, &samples, NULL, error)
                                                 : gonio_read_table(path, &found, error);
    if (status == GONIO_OK) {
        status = measure(model, found, samples, threads, report, error);
    }
    gonio_model_free(found);
    gonio_samples_free(samples);
    return status;
}
