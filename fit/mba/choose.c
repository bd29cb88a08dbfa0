// SPDX-License-Identifier: BSD-3-Clause
// Choosing the level by inner folds.
//
// One multilevel fit passes through every level, so the held-out error of all levels costs one fit. The score is
// scale-free and weighs the typical and the worst alike: the mean of the logs of median |ln(p/f)| and rms ln(p/f), with
// p and f raised by a floor of a hundredth of the median |f|: RMSE alone would be set by the one sample nearest
// grazing.
#include "fit/mba/choose.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/order_statistic.h"
#include "base/statistics.h"
#include "brdf/spline/lattice_eval.h"
#include "fit/mba/mba.h"
#include "fit/memory.h"

#define INNER_SEED 0x696e6e6572u // so that inner folds are not the outer ones
#define LEVELS (GONIO_LEVEL_MAX + 1)

// The finest level worth trying: beyond 256 cells a sample nothing is learned, beyond level 7 (5 in 4-D) memory grows
// past what a default may take.
static int level_limit(const gonio_samples *samples) {
    const int dims = samples->isotropic ? 3 : 4, cap = dims == 3 ? 7 : 5;
    int level = 0;
    while (level < cap && ldexp(1, dims * (level + 1)) <= 256.0 * (double)samples->n) {
        level++;
    }
    return level;
}

static size_t lattice_bytes(const gonio_samples *samples, int level) {
    const size_t count = gonio_lattice_count(samples->isotropic ? 3 : 4, level);
    return count * (size_t)samples->channels * sizeof(float);
}

// Log of the score of predictions at the samples held; work: 2 n doubles. Lower is better.
static double score_channel(size_t n, const double *predicted, const double *truth, double *work) {
    for (size_t i = 0; i < n; i++) {
        work[i] = fabs(truth[i]);
    }
    const double middle = gonio_upper_median(work, n), most = gonio_order_statistic(work, n, n - 1);
    const double floor_value = middle > 0 ? 1e-2 * middle : most > 0 ? 1e-2 * most : 1;
    double squares = 0;
    for (size_t i = 0; i < n; i++) {
        const double d = log((fmax(predicted[i], 0) + floor_value) / (fmax(truth[i], 0) + floor_value));
        work[i] = fabs(d);
        squares += d * d;
    }
    return 0.5 * (log(gonio_upper_median(work, n) + 1e-9) + log(sqrt(squares / (double)n) + 1e-9));
}

typedef struct trial {
    const gonio_samples *held;
    double *predicted, *truth, *work; // held->n each
    float *values;                    // held->n x channels
    gonio_position *positions;        // held->n
} trial;

static gonio_status trial_init(trial *t, const gonio_samples *held, gonio_error *error) {
    t->held = held;
    t->predicted = malloc(held->n * sizeof(double));
    t->truth = malloc(held->n * sizeof(double));
    t->work = malloc(held->n * sizeof(double));
    t->values = malloc(held->n * (size_t)held->channels * sizeof *t->values);
    t->positions = malloc(held->n * sizeof *t->positions);
    const bool all =
        t->predicted != NULL && t->truth != NULL && t->work != NULL && t->values != NULL && t->positions != NULL;
    return all ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory to compare choices");
}

static void trial_release(trial *t) {
    free(t->predicted);
    free(t->truth);
    free(t->work);
    free(t->values);
    free(t->positions);
}

static double score(const trial *t, const gonio_scatter *scatter, const gonio_lattice *lattice) {
    const size_t n = t->held->n, channels = (size_t)scatter->channels;
    gonio_lattice_eval_positions(lattice, n, t->positions, t->values);
    double sum = 0;
    for (size_t c = 0; c < channels; c++) {
        for (size_t i = 0; i < n; i++) {
            t->predicted[i] =
                gonio_transform_invert(scatter->kind, &scatter->transforms[c], (double)t->values[i * channels + c]);
            t->truth[i] = t->held->values[i * channels + c];
        }
        sum += score_channel(n, t->predicted, t->truth, t->work);
    }
    return sum / (double)channels;
}

// Scores of levels 0 .. limit, added to scores[].
static gonio_status score_levels(const gonio_samples *train, const trial *t, const gonio_scatter_options *form,
                                 const gonio_fit_options *options, int limit, double scores[LEVELS],
                                 gonio_error *error) {
    gonio_scatter scatter;
    gonio_status status = gonio_scatter_init(&scatter, train, form, error);
    if (status != GONIO_OK) {
        return status;
    }
    for (size_t i = 0; i < t->held->n; i++) {
        double x[GONIO_DIMS_MAX];
        gonio_scatter_locate(form->coordinates, scatter.dims, &t->held->pairs[i], x);
        t->positions[i] = gonio_position_of(x, scatter.dims);
    }
    gonio_mba *mba;
    status = gonio_mba_new(&scatter, options->thesis ? NULL : scatter.mean, options->threads, &mba, error);
    for (int level = 0; level <= limit && status == GONIO_OK; level++) {
        status = gonio_mba_next(mba, error);
        if (status == GONIO_OK) {
            scores[level] += score(t, &scatter, gonio_mba_lattice(mba));
        }
    }
    gonio_mba_free(mba);
    gonio_scatter_release(&scatter);
    return status;
}

static gonio_status score_fold(const gonio_samples *samples, const gonio_fit_options *options, const int *fold,
                               int index, const gonio_scatter_options *form, int limit, double scores[LEVELS],
                               gonio_error *error) {
    bool *keep = malloc(samples->n * sizeof *keep);
    gonio_samples *train = NULL, *held = NULL;
    trial t = {0};
    gonio_status status = keep != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory to compare choices");
    for (int side = 0; side < 2 && status == GONIO_OK; side++) {
        for (size_t i = 0; i < samples->n; i++) {
            keep[i] = (fold[i] == index) == (side == 1);
        }
        status = gonio_samples_select(samples, keep, side == 0 ? &train : &held, error);
    }
    status = status == GONIO_OK ? trial_init(&t, held, error) : status;
    if (status == GONIO_OK && train->n > 0 && held->n > 0) {
        status = score_levels(train, &t, form, options, limit, scores, error);
    }
    trial_release(&t);
    gonio_samples_free(train);
    gonio_samples_free(held);
    free(keep);
    return status;
}

// Nusselt coordinates and the linear domain are what a multilevel fit is known by.
static gonio_scatter_options form_of(const gonio_samples *samples, const gonio_fit_options *o) {
    const int usual = samples->isotropic ? GONIO_SYMMETRY_MIRROR : 0;
    return (gonio_scatter_options){
        .coordinates = o->coordinates != GONIO_COORDINATES_AUTO ? o->coordinates : GONIO_NUSSELT,
        .domain = o->domain != GONIO_DOMAIN_AUTO ? o->domain : GONIO_LINEAR,
        .symmetry = o->symmetry != GONIO_SYMMETRY_AUTO ? o->symmetry : usual,
        .weighted = !o->thesis,
        .threads = o->threads,
    };
}

// The smallest level within 2 % of the best: what finer ones add cannot be told from chance.
static int pick(const double scores[LEVELS], int limit, int folds) {
    int best = 0, level = 0;
    for (int h = 1; h <= limit; h++) {
        best = scores[h] < scores[best] ? h : best;
    }
    while (level < best && !((scores[level] - scores[best]) / folds < log(1.02))) {
        level++;
    }
    return level;
}

static gonio_status choose_level(const gonio_samples *samples, const gonio_fit_options *options, int limit,
                                 gonio_mba_choice *choice, gonio_error *error) {
    int *fold = malloc(samples->n * sizeof *fold);
    if (fold == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to compare choices");
    }
    // Many samples make one fifth representative; few want every fold.
    const int folds = 5, used = samples->n > 20000 ? 1 : folds;
    double scores[LEVELS] = {0};
    gonio_status status = gonio_samples_folds(samples, folds, options->seed ^ INNER_SEED, fold, error);
    for (int index = 0; index < used && status == GONIO_OK; index++) {
        status = score_fold(samples, options, fold, index, &choice->scatter, limit, scores, error);
    }
    free(fold);
    if (status == GONIO_OK) {
        choice->level = pick(scores, limit, used);
        snprintf(choice->note, sizeof choice->note, "%s, %s, level %d chosen by the error on %d inner fold%s",
                 gonio_coordinates_name(choice->scatter.coordinates), gonio_domain_name(choice->scatter.domain),
                 choice->level, used, used > 1 ? "s" : "");
    }
    return status;
}

// At most this many channels, evenly spread, take part in a choice: neighbours in a spectrum agree on it.
#define CHANNELS_COMPARED 4

static gonio_status spread_channels(const gonio_samples *samples, gonio_samples **out, gonio_error *error) {
    gonio_status status = gonio_samples_new(CHANNELS_COMPARED, samples->sigma_random != NULL, out, error);
    const size_t channels = (size_t)samples->channels;
    for (size_t i = 0; i < samples->n && status == GONIO_OK; i++) {
        double z[CHANNELS_COMPARED], sigma[CHANNELS_COMPARED] = {0};
        for (size_t c = 0; c < CHANNELS_COMPARED; c++) {
            const size_t at = i * channels + c * (channels - 1) / (CHANNELS_COMPARED - 1);
            z[c] = samples->values[at];
            sigma[c] = samples->sigma_random != NULL ? samples->sigma_random[at] : 0;
        }
        (*out)->isotropic = samples->isotropic;
        status = gonio_samples_add(*out, &samples->pairs[i], z, sigma, NULL, error);
    }
    if (status != GONIO_OK) {
        gonio_samples_free(*out);
        *out = NULL;
    }
    return status;
}

static gonio_status compare_levels(const gonio_samples *samples, const gonio_fit_options *options, int limit,
                                   gonio_mba_choice *choice, gonio_error *error) {
    if (samples->channels <= CHANNELS_COMPARED) {
        return choose_level(samples, options, limit, choice, error);
    }
    gonio_samples *few;
    gonio_status status = spread_channels(samples, &few, error);
    if (status == GONIO_OK) {
        status = choose_level(few, options, limit, choice, error);
        gonio_samples_free(few);
    }
    return status;
}

static bool fits(const gonio_samples *samples, const gonio_fit_options *options, int level) {
    const gonio_fit_size size = gonio_fit_size_of(samples, options, level);
    return gonio_fit_memory_of(&size, gonio_lattice_fit_memory) <= gonio_fit_memory_limit(samples, options);
}

gonio_status gonio_mba_choose(const gonio_samples *samples, const gonio_fit_options *options, gonio_mba_choice *choice,
                              gonio_error *error) {
    const bool open_level = options->level == GONIO_LEVEL_AUTO;
    int limit = open_level ? level_limit(samples) : options->level;
    while (options->max_bytes > 0 && lattice_bytes(samples, limit) > options->max_bytes && limit > 0 && open_level) {
        limit--;
    }
    if (options->max_bytes > 0 && lattice_bytes(samples, limit) > options->max_bytes) {
        return gonio_fail(error, GONIO_E_RANGE, "level %d takes %zu bytes; the limit is %zu", limit,
                          lattice_bytes(samples, limit), options->max_bytes);
    }
    while (open_level && limit > 0 && !fits(samples, options, limit)) {
        limit--;
    }
    *choice = (gonio_mba_choice){.scatter = form_of(samples, options), .level = limit};
    return open_level ? compare_levels(samples, options, limit, choice, error) : GONIO_OK;
}
