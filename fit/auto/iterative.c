// SPDX-License-Identifier: BSD-3-Clause
// The choice and the fit of large sets.
//
// Closed forms cost n^3, so choices are scored on a fifth of the geometries that the fit has not seen. Every candidate
// (coordinates; lobes, a grazing factor or neither) searches lambda and stiffness on a lattice one level coarser than
// the finest; those close to the best go on to the finest (fit/auto/descent.c).
#include "fit/auto/iterative.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/auto/descent.h"
#include "fit/auto/tuning.h"
#include "fit/lobes/fit.h"
#include "fit/smooth/cg.h"
#include "fit/smooth/precondition.h"

#define FINAL_ITERATIONS 200
#define TOLERANCE 1e-3 // the gradient's fall that ends a solve: below what the held-out error can tell

// ---- memory ----

// Of the choice and of the fit at a level, whichever takes more, beside the samples: the sets and what a base leaves of
// them, the samples' places, and the solver's vectors.
static double memory_at(const gonio_dataset *data, int level) {
    const gonio_smooth_form form = gonio_smooth_form_default(GONIO_NUSSELT, level, data->mirror);
    const double n = (double)data->n, c = data->channels, tried = fmin(c, GONIO_SMOOTH_CHANNELS_TRIED);
    const double set = n * (sizeof(gonio_pair) + 8 * (2 * c + 1)),
                 part = n * (sizeof(gonio_pair) + 8 * (2 * tried + 1));
    const double places = n * (32 + 24 + 8 * data->dims);
    const double count = (double)gonio_lattice_count(data->dims, level);
    // Of a solve 4, of the start and the levels before 3, sums of the places 2 a level.
    const double vectors = 8 * count * (7 + 2.3 + tried);
    return set + fmax(2 * part + n * 8 * tried, n * 8 * c) + places + vectors + 4 * count * c +
           gonio_smooth_precondition_memory(data->dims, &form, level);
}

// Bytes for that under --max-memory; the process itself and the samples are in it.
static double memory_limit(const gonio_dataset *data, const gonio_fit_options *options) {
    const double samples = (double)data->n * (sizeof(gonio_pair) + 8.0 * data->channels);
    return options->max_memory > 0 ? (double)options->max_memory - 20e6 - samples : INFINITY;
}

static gonio_status check_memory(const gonio_dataset *data, const gonio_fit_options *options, int level,
                                 gonio_error *error) {
    const double limit = memory_limit(data, options), needed = memory_at(data, level);
    return needed <= limit
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_MEMORY,
                            "least squares on %zu geometries of %d channels at level %d need %.3g GB beside "
                            "the samples; there are %.3g GB",
                            data->n, data->channels, level, needed / 1e9, fmax(limit, 0) / 1e9);
}

static int finest_level(const gonio_dataset *data, const gonio_fit_options *options) {
    const int dims = data->dims, cap = dims == 3 ? (data->n >= 1000000 ? 7 : 6) : (data->n >= 100000 ? 5 : 4);
    int level = 0;
    while (level < cap && ldexp(1, dims * (level + 1)) <= 32.0 * (double)data->n) {
        level++;
    }
    while (options->max_bytes > 0 && level > 0 &&
           gonio_lattice_count(dims, level) * (size_t)data->channels * sizeof(float) > options->max_bytes) {
        level--;
    }
    while (level > 0 && memory_at(data, level) > memory_limit(data, options)) {
        level--;
    }
    return level;
}

// ---- the choice ----

typedef struct comparison {
    const gonio_dataset *data;
    const gonio_holdout *in;
    gonio_deadline *watch;
    gonio_iterative_choice *choice;
    int finest;
    bool open;  // the level is to be chosen
    bool brief; // roughly
} comparison;

// Where a candidate stands after its own search.
typedef struct standing {
    gonio_smooth_form form;
    double lambda, score;
} standing;

static gonio_status try_candidate(const comparison *c, const gonio_smooth_candidate *candidate, bool levels,
                                  standing *stands, gonio_error *error) {
    gonio_descent s;
    gonio_status status = gonio_descent_init(&s, c->data, c->in, c->watch, candidate->lobes, c->finest, error);
    s.choice = c->choice;
    s.best = stands->form;
    s.lambda = stands->lambda > 0 ? stands->lambda : s.lambda;
    s.score = stands->score;
    if (status == GONIO_OK && levels) {
        status = gonio_descent_levels(&s, c->brief, error);
    } else if (status == GONIO_OK) {
        status = gonio_descent_first(&s, &stands->form, stands->lambda,
                                     candidate->lambda > 0 ? gonio_auto_tuned.close : gonio_auto_tuned.hopeless, error);
    }
    *stands = (standing){s.best, s.lambda, s.score};
    gonio_descent_release(&s);
    return status;
}

static bool grazes(const gonio_smooth_candidate *candidate) {
    return candidate->lobes != NULL && candidate->lobes->lobes == 0;
}

// The last one before k in the same coordinates without lobes; -1: none.
static int sibling(const gonio_smooth_candidate *candidates, int k) {
    for (int j = k - 1; j >= 0; j--) {
        if (candidates[j].form.coordinates == candidates[k].form.coordinates &&
            (candidates[j].lobes == NULL || grazes(&candidates[j]))) {
            return j;
        }
    }
    return -1;
}

// A steeper grazing factor is worth a try where the last one was close to the best, and began no worse.
static bool promising(const gonio_smooth_candidate *candidates, const standing *stands, int k, double best) {
    const int before = sibling(candidates, k);
    if (!grazes(&candidates[k]) || before < 0) {
        return true;
    }
    const int first = sibling(candidates, before);
    return stands[before].score < best + 2 * gonio_auto_tuned.close &&
           (first < 0 || stands[before].score < stands[first].score);
}

static gonio_status compare(const comparison *c, const gonio_smooth_candidate *candidates, int n, standing *stands,
                            gonio_error *error) {
    const gonio_iterative_choice *choice = c->choice;
    gonio_status status = GONIO_OK;
    double best = INFINITY;
    for (int k = 0; k < n && status == GONIO_OK; k++) {
        stands[k] = (standing){candidates[k].form, 0, INFINITY};
        stands[k].form.level = c->open ? (c->finest > 0 ? c->finest - 1 : 0) : c->finest;
        status = gonio_deadline_report(c->watch, 0.6 + 0.15 * k / n, "choosing lambda and stiffness", error);
        if (status == GONIO_OK && (k == 0 || !gonio_deadline_over(c->watch)) &&
            promising(candidates, stands, k, best)) {
            // What suits similar candidates is where to begin.
            const int before = grazes(&candidates[k]) ? sibling(candidates, k) : -1;
            stands[k].lambda = before >= 0                ? stands[before].lambda
                               : candidates[k].lambda > 0 ? candidates[k].lambda
                               : k > 0                    ? choice->lambda
                                                          : 0;
            stands[k].form = before >= 0 ? stands[before].form : stands[k].form;
            status = try_candidate(c, &candidates[k], false, &stands[k], error);
            best = fmin(best, stands[k].score);
        }
    }
    for (int k = 0; k < n && status == GONIO_OK && c->open; k++) {
        status = gonio_deadline_report(c->watch, 0.75 + 0.05 * k / n, "choosing the level", error);
        if (status == GONIO_OK && stands[k].score < best + gonio_auto_tuned.close) {
            status = try_candidate(c, &candidates[k], true, &stands[k], error);
        }
    }
    return status;
}

static gonio_status score_start(const comparison *c, gonio_error *error) {
    gonio_descent s;
    const gonio_iterative_choice *choice = c->choice;
    gonio_status status = gonio_descent_init(&s, c->data, c->in, c->watch, choice->lobes, choice->form.level, error);
    status = status == GONIO_OK ? gonio_descent_set(&s, &choice->form, error) : status;
    status = status == GONIO_OK ? gonio_descent_start(&s, &c->choice->start_score, error) : status;
    gonio_descent_release(&s);
    return status;
}

gonio_status gonio_iterative_choose(const gonio_dataset *data, gonio_deadline *watch,
                                    const gonio_smooth_candidate *candidates, int n, bool compare_only,
                                    gonio_iterative_choice *choice, gonio_error *error) {
    *choice = (gonio_iterative_choice){.score.score = INFINITY};
    gonio_holdout in;
    standing stands[GONIO_SMOOTH_CANDIDATES];
    const bool open = watch->options->level == GONIO_LEVEL_AUTO;
    const int finest = open ? finest_level(data, watch->options) : watch->options->level;
    gonio_status status = check_memory(data, watch->options, finest, error);
    status = status == GONIO_OK ? gonio_holdout_init(&in, data, NULL, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    const comparison c = {data, &in, watch, choice, finest, open, compare_only};
    status = compare(&c, candidates, n, stands, error);
    if (status == GONIO_OK && !compare_only) {
        // The multilevel start alone: the solution must not be worse.
        status = score_start(&c, error);
    }
    if (status == GONIO_OK && !compare_only) {
        choice->start_only = choice->start_score.score < choice->score.score;
    }
    gonio_holdout_release(&in);
    return status;
}

void gonio_smooth_grazing_bases(const gonio_dataset *data, gonio_lobe_base bases[GONIO_SMOOTH_GRAZING]) {
    const float cosine_min = gonio_lobe_cosine_min(data);
    for (int k = 0; k < GONIO_SMOOTH_GRAZING; k++) {
        bases[k] = (gonio_lobe_base){.cosine_min = cosine_min, .grazing = 0.5F * (float)(k + 1)};
    }
}

// ---- the choice without some samples ----

void gonio_left_out_release(gonio_left_out *out) {
    gonio_dataset_release(&out->kept);
    gonio_dataset_release(&out->held);
    free(out->residuals);
    free(out->replicate);
    *out = (gonio_left_out){0};
}

// What noise of unit variance (at full weight) in every kept sample leaves at the held-out ones: one draw.
static gonio_status replicate_noise(gonio_descent *s, const gonio_iterative_choice *choice, double *out,
                                    gonio_error *error) {
    const size_t n = s->in->train.n;
    double *noise = malloc(n * sizeof *noise);
    if (noise == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    for (size_t i = 0; i < n; i++) {
        noise[i] = gonio_holdout_noise(i) / sqrt(s->in->train.weights[i]);
    }
    const gonio_status status = gonio_descent_replicate(s, noise, choice, out, error);
    free(noise);
    return status;
}

gonio_status gonio_iterative_leave_out(const gonio_dataset *data, gonio_deadline *watch,
                                       const gonio_iterative_choice *choice, const bool *keep, gonio_left_out *out,
                                       gonio_error *error) {
    *out = (gonio_left_out){0};
    gonio_holdout in;
    gonio_status status = gonio_holdout_init(&in, data, keep, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_descent s;
    gonio_smooth_score score;
    status = gonio_descent_init(&s, data, &in, watch, choice->lobes, choice->form.level, error);
    status = status == GONIO_OK ? gonio_descent_set(&s, &choice->form, error) : status;
    if (status == GONIO_OK) {
        status = choice->start_only ? gonio_descent_start(&s, &score, error)
                                    : gonio_descent_solve(&s, choice->lambda, false, &score, error);
    }
    if (status == GONIO_OK && (out->replicate = malloc(in.held.n * sizeof *out->replicate)) == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    status = status == GONIO_OK ? replicate_noise(&s, choice, out->replicate, error) : status;
    gonio_descent_release(&s);
    if (status == GONIO_OK) {
        out->kept = in.train;
        out->held = in.held;
        out->residuals = in.residuals;
        in.train = in.held = (gonio_dataset){0};
        in.residuals = NULL;
    } else {
        gonio_left_out_release(out);
    }
    gonio_holdout_release(&in);
    return status;
}

// ---- the fit ----

static gonio_status solve_channels(const gonio_dataset *data, gonio_deadline *watch, gonio_iterative_choice *choice,
                                   const gonio_smooth_base *base, gonio_lattice *lattice, gonio_error *error) {
    const gonio_fit_options *options = watch->options;
    const size_t c = (size_t)data->channels;
    gonio_smooth_cg *cg = NULL;
    double *points = malloc(lattice->count * sizeof *points);
    gonio_status status = points != NULL ? gonio_smooth_cg_new(data, &choice->form, options->threads, &cg, error)
                                         : gonio_fail(error, GONIO_E_MEMORY, "no memory for level %d", lattice->level);
    const int iterations = options->iterations > 0 ? options->iterations : FINAL_ITERATIONS;
    const double end = watch->until;
    if (status == GONIO_OK) {
        gonio_smooth_cg_watch(cg, watch);
    }
    for (size_t k = 0; k < c && status == GONIO_OK; k++) {
        const double now = gonio_clock_s();
        watch->until = now + (end - now) / (double)(c - k); // no channel takes the others' time
        gonio_smooth_cg_report report = {0};
        if (choice->start_only) {
            gonio_smooth_cg_start(cg, base->rest + k, c, lattice->level, points);
        } else {
            status = gonio_smooth_cg_cascade(cg, base->rest + k, c, choice->lambda, iterations, TOLERANCE, points,
                                             &report, error);
        }
        choice->iterations = report.iterations > choice->iterations ? report.iterations : choice->iterations;
        choice->gradient = fmax(choice->gradient, report.gradient);
        for (size_t i = 0; i < lattice->count && status == GONIO_OK; i++) {
            lattice->points[i * c + k] = (float)(points[i] + base->mean[k]);
        }
        if (status == GONIO_OK) {
            status = gonio_deadline_report(watch, 0.8 + 0.2 * (double)(k + 1) / (double)c, "solving", error);
        }
    }
    gonio_smooth_cg_free(cg);
    free(points);
    return status;
}

gonio_status gonio_iterative_parts(const gonio_dataset *data, gonio_deadline *watch, gonio_iterative_choice *choice,
                                   gonio_lobe_spline_parts *parts, gonio_error *error) {
    gonio_status status = gonio_smooth_parts_init(parts, data, choice->lobes, choice->form.coordinates, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_lobe_base own = {0};
    gonio_smooth_base base = {0};
    if (choice->lobes != NULL) {
        const size_t size = (size_t)data->channels * (1 + GONIO_LOBES_MAX) * sizeof(double);
        own = *choice->lobes;
        own.strength = own.lobes > 0 ? malloc(size) : NULL;
        if (own.strength != NULL) {
            memcpy(own.strength, choice->lobes->strength, size);
        } else if (own.lobes > 0) {
            status = gonio_fail(error, GONIO_E_MEMORY, "no memory for lobes");
        }
    }
    if (status == GONIO_OK) {
        status = gonio_smooth_base_init(&base, data, choice->lobes != NULL ? &own : NULL, error);
    }
    status = status == GONIO_OK ? gonio_smooth_parts_hold(parts, &base, error) : status;
    if (status == GONIO_OK) {
        status = gonio_lattice_init(&parts->lattice, data->dims, choice->form.level, data->channels, error);
    }
    status = status == GONIO_OK ? solve_channels(data, watch, choice, &base, &parts->lattice, error) : status;
    free(own.strength);
    gonio_smooth_base_release(&base);
    if (status != GONIO_OK) {
        gonio_lobe_spline_parts_release(parts);
    }
    return status;
}
