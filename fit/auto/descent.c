// SPDX-License-Identifier: BSD-3-Clause
// Coordinate descent in lambda, stiffness and level: each solve begins where the last one ended, or at the multilevel
// start; a step is kept where the held-out samples are predicted better.
#include "fit/auto/descent.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "fit/auto/tuning.h"
#include "fit/eval_cost.h"

#define TRIAL_ITERATIONS_MIN 12
#define TRIAL_ITERATIONS_MAX 40
#define TRIAL_WORK 2.5e6 // samples x iterations of a trial solve: a fraction of a second
#define TOLERANCE 2e-3   // the gradient's fall that ends a trial: below what the held-out error can tell
#define LAMBDA_FIRST 1e-3
#define LAMBDA_LAST 1e-9
#define LAMBDA_MOST 10.0

void gonio_descent_release(gonio_descent *s) {
    gonio_smooth_cg_free(s->cg);
    gonio_smooth_base_release(&s->train);
    gonio_smooth_base_release(&s->held);
    free(s->points);
}

gonio_status gonio_descent_init(gonio_descent *s, const gonio_dataset *all, const gonio_holdout *in,
                                gonio_deadline *watch, const gonio_lobe_base *lobes, int finest, gonio_error *error) {
    *s = (gonio_descent){.in = in,
                         .options = watch->options,
                         .watch = watch,
                         .all = all,
                         .lobes = lobes,
                         .finest = finest,
                         .lambda = LAMBDA_FIRST,
                         .score = INFINITY};
    gonio_status status = GONIO_OK;
    for (int side = 0; side < 2 && status == GONIO_OK; side++) {
        gonio_lobe_base own = {0};
        if (lobes != NULL) {
            status = gonio_holdout_lobes(in, lobes, &own, error);
        }
        if (status == GONIO_OK) {
            status = gonio_smooth_base_init(side == 0 ? &s->train : &s->held, side == 0 ? &in->train : &in->held,
                                            lobes != NULL ? &own : NULL, error);
        }
        free(own.strength);
    }
    return status;
}

gonio_status gonio_descent_set(gonio_descent *s, const gonio_smooth_form *form, gonio_error *error) {
    const bool placed = s->cg != NULL && s->form.coordinates == form->coordinates;
    free(s->points);
    s->form = *form;
    const size_t count = gonio_lattice_count(s->in->train.dims, form->level);
    s->points = malloc(count * (size_t)s->in->channels * sizeof *s->points);
    if (s->points == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for level %d (%.3g GB)", form->level,
                          8e-9 * (double)count * s->in->channels);
    }
    if (placed) {
        gonio_smooth_cg_reform(s->cg, form);
    } else {
        gonio_smooth_form widest = *form;
        widest.level = s->finest;
        gonio_smooth_cg_free(s->cg);
        const gonio_status status = gonio_smooth_cg_new(&s->in->train, &widest, s->options->threads, &s->cg, error);
        if (status != GONIO_OK) {
            return status;
        }
        gonio_smooth_cg_reform(s->cg, form);
        gonio_smooth_cg_watch(s->cg, s->watch);
    }
    return s->options->max_ns > 0 ? gonio_eval_cost_ns(s->all, form, s->lobes, &s->ns, error) : GONIO_OK;
}

// An error of 1 % of all values is below any instrument's, as is one of 0.2 % in the middle (fit/smooth/loo.c):
// once there, the peak counts.

// Thousands of held-out samples tell the peak's error too, which a single grazing one sets in small sets. (Without the
// largest error, or at a smaller weight, grazing factors and stiffness are missed on some draws of a smooth lobe.)
static void add_peak(const gonio_descent *s, gonio_smooth_score *score) {
    const gonio_dataset *held = &s->in->held;
    const size_t c = (size_t)held->channels;
    for (size_t k = 0; k < c; k++) {
        double squares = 0;
        for (size_t i = k; i < held->n * c; i += c) {
            squares += s->in->residuals[i] * s->in->residuals[i];
        }
        const double rms = sqrt(squares / (double)held->n);
        score->score += log((rms + gonio_auto_tuned.rms_floor) / (rms + 1e-6)) / (double)c;
    }
    score->score += gonio_auto_tuned.peak * log(score->rmse / held->transforms[0].scale + 1e-9);
}

// Residuals of the points now, on the held-out.
static gonio_status score_points(gonio_descent *s, gonio_smooth_score *score, gonio_error *error) {
    const size_t c = (size_t)s->in->channels, count = gonio_smooth_cg_count(s->cg, s->form.level);
    gonio_status status = GONIO_OK;
    for (size_t k = 0; k < c && status == GONIO_OK; k++) {
        status = gonio_smooth_cg_eval(s->cg, &s->in->held, s->form.level, s->points + k * count, s->in->residuals + k,
                                      c, error);
    }
    for (size_t i = 0; i < s->in->held.n * c && status == GONIO_OK; i++) {
        // The held-out targets lost their own mean; the model adds the training mean.
        const double truth = s->held.rest[i] + s->held.mean[i % c] - s->train.mean[i % c];
        s->in->residuals[i] = truth - s->in->residuals[i];
    }
    if (status == GONIO_OK) {
        *score = gonio_smooth_score_of(&s->in->held, s->in->residuals, s->in->work);
        if (s->in->held.kind != GONIO_TRANSFORM_LINEAR) {
            add_peak(s, score);
        }
    }
    return status;
}

static int trial_iterations(const gonio_descent *s) {
    if (s->options->iterations > 0) {
        return s->options->iterations;
    }
    const double affordable = TRIAL_WORK / (double)s->in->train.n;
    return (int)fmin(fmax(affordable, TRIAL_ITERATIONS_MIN), TRIAL_ITERATIONS_MAX);
}

static void keep_trial(const gonio_descent *s, double lambda, gonio_smooth_score score) {
    gonio_iterative_choice *choice = s->choice;
    const gonio_iterative_trial trial = {s->form, lambda, s->lobes, score};
    for (int t = 0; t < choice->trials_n; t++) {
        gonio_iterative_trial *other = &choice->trials[t];
        if (other->form.coordinates == s->form.coordinates && other->form.level == s->form.level &&
            other->lobes == s->lobes) {
            *other = score.score < other->score.score ? trial : *other;
            return;
        }
    }
    assert(choice->trials_n < GONIO_ITERATIVE_TRIALS); // each candidate's coordinates and lobes, at each level once
    choice->trials[choice->trials_n++] = trial;
}

gonio_status gonio_descent_solve(gonio_descent *s, double lambda, bool warm, gonio_smooth_score *score,
                                 gonio_error *error) {
    const size_t c = (size_t)s->in->channels, count = gonio_smooth_cg_count(s->cg, s->form.level);
    gonio_status status = GONIO_OK;
    for (size_t k = 0; k < c && status == GONIO_OK; k++) {
        gonio_smooth_cg_report report;
        double *points = s->points + k * count;
        if (warm) {
            status = gonio_smooth_cg_solve(s->cg, s->train.rest + k, c, s->form.level, lambda, trial_iterations(s),
                                           TOLERANCE, points, &report, error);
        } else {
            status = gonio_smooth_cg_cascade(s->cg, s->train.rest + k, c, lambda, 2 * trial_iterations(s), TOLERANCE,
                                             points, &report, error);
        }
    }
    status = status == GONIO_OK ? score_points(s, score, error) : status;
    if (status == GONIO_OK && s->choice != NULL) {
        keep_trial(s, lambda, *score);
    }
    return status;
}

gonio_status gonio_descent_start(gonio_descent *s, gonio_smooth_score *score, gonio_error *error) {
    const size_t c = (size_t)s->in->channels, count = gonio_smooth_cg_count(s->cg, s->form.level);
    for (size_t k = 0; k < c; k++) {
        gonio_smooth_cg_start(s->cg, s->train.rest + k, c, s->form.level, s->points + k * count);
    }
    return score_points(s, score, error);
}

gonio_status gonio_descent_replicate(gonio_descent *s, const double *targets, const gonio_iterative_choice *choice,
                                     double *out, gonio_error *error) {
    gonio_smooth_cg_report unused;
    gonio_status status = GONIO_OK;
    if (choice->start_only) {
        gonio_smooth_cg_start(s->cg, targets, 1, s->form.level, s->points);
    } else {
        status = gonio_smooth_cg_cascade(s->cg, targets, 1, choice->lambda, 2 * trial_iterations(s), TOLERANCE,
                                         s->points, &unused, error);
    }
    return status == GONIO_OK ? gonio_smooth_cg_eval(s->cg, &s->in->held, s->form.level, s->points, out, 1, error)
                              : status;
}

// ---- which is better ----

// Of those that meet --max-error the coarser; else the better score.
static bool preferred(const gonio_descent *s, gonio_smooth_score score) {
    const gonio_iterative_choice *choice = s->choice;
    const double limit = s->options->max_error;
    const bool good = limit > 0 && score.rmse <= limit, good_before = limit > 0 && choice->score.rmse <= limit;
    if (good != good_before) {
        return good;
    }
    return good && s->form.level != choice->form.level ? s->form.level < choice->form.level
                                                       : score.score < choice->score.score;
}

// The first; then what meets --max-ns, and of such what scores better.
static void offer(gonio_descent *s, double lambda, gonio_smooth_score score) {
    gonio_iterative_choice *choice = s->choice;
    const double limit = s->options->max_ns;
    const bool within = limit <= 0 || s->ns <= limit, within_before = limit <= 0 || choice->ns <= limit;
    const bool first = choice->score.score == INFINITY;
    if (!first && (within != within_before ? !within : !preferred(s, score))) {
        return;
    }
    choice->ns = s->ns;
    choice->form = s->form;
    choice->lobes = s->lobes;
    choice->lambda = lambda;
    choice->score = score;
}

bool gonio_descent_may_try(const gonio_descent *s) {
    return s->choice->score.score == INFINITY || !gonio_deadline_over(s->watch);
}

// Solve, and take it where it is better than this candidate's best so far, or meets the error asked for at a coarser
// level.
static gonio_status attempt(gonio_descent *s, double lambda, bool warm, bool *better, gonio_error *error) {
    gonio_smooth_score score = {INFINITY, INFINITY};
    const gonio_status status = gonio_descent_solve(s, lambda, warm, &score, error);
    const double limit = s->options->max_error;
    const bool cheaper = limit > 0 && score.rmse <= limit && s->form.level < s->choice->form.level;
    s->last = score.score;
    *better = status == GONIO_OK && (score.score < s->score || cheaper);
    if (*better) {
        s->best = s->form;
        s->lambda = lambda;
        s->score = score.score;
        offer(s, lambda, score);
    }
    return status;
}

static gonio_status attempt_form(gonio_descent *s, const gonio_smooth_form *form, double lambda, bool *better,
                                 gonio_error *error) {
    *better = false;
    const gonio_status status = gonio_descent_set(s, form, error);
    return status == GONIO_OK ? attempt(s, lambda, false, better, error) : status;
}

// ---- lambda ----

#define STEP 100.0

// By factors of 100 down, up where that was no good, then of 10 about the best.
static gonio_status search_lambda(gonio_descent *s, gonio_error *error) {
    bool better;
    gonio_status status = attempt(s, LAMBDA_FIRST, false, &better, error);
    for (int up = 0; up < 2 && s->lambda == LAMBDA_FIRST; up++) {
        double lambda = LAMBDA_FIRST;
        for (int bad = 0; bad < 2 && status == GONIO_OK && gonio_descent_may_try(s); bad += better ? -bad : 1) {
            lambda *= up ? STEP : 1 / STEP;
            if (lambda < LAMBDA_LAST || lambda > LAMBDA_MOST) {
                break;
            }
            status = attempt(s, lambda, true, &better, error);
            if (s->last > s->score + gonio_auto_tuned.worse) {
                break;
            }
        }
    }
    const double centre = s->lambda;
    for (int side = 0; side < 2 && status == GONIO_OK && gonio_descent_may_try(s); side++) {
        status = attempt(s, centre * (side == 0 ? 0.1 : 10), true, &better, error);
    }
    return status;
}

// ---- stiffness ----

#define STIFFNESS_MIN 1e-2
#define STIFFNESS_MAX 1e5

// The axes along which BRDFs vary slowly: the difference angle, or the incidence.
static void stiffen(gonio_smooth_form *form, int dims, double factor) {
    int count;
    const int first = gonio_coordinates_slow_axes(form->coordinates, dims, &count);
    for (int d = first; d < first + count; d++) {
        form->stretch[d] *= factor;
    }
}

static double stiffness(const gonio_smooth_form *form, int dims) {
    int count;
    return form->stretch[gonio_coordinates_slow_axes(form->coordinates, dims, &count)];
}

// Stiffer by `factor`, again and again as long as that helps.
static gonio_status stiffen_by(gonio_descent *s, double factor, bool *moved, gonio_error *error) {
    const int dims = s->all->dims;
    gonio_status status = GONIO_OK;
    for (bool better = true; better && status == GONIO_OK && gonio_descent_may_try(s);) {
        gonio_smooth_form trial = s->best;
        stiffen(&trial, dims, factor);
        if (stiffness(&trial, dims) < STIFFNESS_MIN || stiffness(&trial, dims) > STIFFNESS_MAX) {
            break;
        }
        status = attempt_form(s, &trial, s->lambda, &better, error);
        *moved = *moved || better;
    }
    return status;
}

// A sharp lobe at grazing angles has few samples of its own: along the slow axes it is told by the others, if the
// spline is stiff there. By tens and hundreds up, or else down; then lambda again.
static gonio_status search_stiffness(gonio_descent *s, bool fine, gonio_error *error) {
    static const double steps[] = {100, 10, 0.1};
    gonio_status status = GONIO_OK;
    bool moved = false;
    for (int k = fine ? 1 : 0; k < 3 && status == GONIO_OK && !(moved && steps[k] < 1); k++) {
        status = stiffen_by(s, steps[k], &moved, error);
    }
    return status;
}

// Lambda by tens, either way as long as that helps.
static gonio_status settle_lambda(gonio_descent *s, gonio_error *error) {
    gonio_status status = GONIO_OK;
    bool moved = false;
    for (int up = 0; up < 2 && !moved && status == GONIO_OK; up++) {
        for (bool better = true; better && status == GONIO_OK && gonio_descent_may_try(s);) {
            const gonio_smooth_form form = s->best;
            status = attempt_form(s, &form, s->lambda * (up ? 10 : 0.1), &better, error);
            moved = moved || better;
        }
    }
    return status;
}

gonio_status gonio_descent_first(gonio_descent *s, const gonio_smooth_form *form, double lambda, double hopeless,
                                 gonio_error *error) {
    gonio_status status = gonio_descent_set(s, form, error);
    bool better;
    if (status == GONIO_OK && s->options->lambda >= 0) {
        return attempt(s, s->options->lambda, false, &better, error);
    }
    if (status == GONIO_OK && lambda > 0) {
        status = attempt(s, lambda, false, &better, error);
    } else if (status == GONIO_OK) {
        status = search_lambda(s, error);
    }
    if (status != GONIO_OK || s->score > s->choice->score.score + hopeless) {
        return status;
    }
    status = search_stiffness(s, false, error);
    return status == GONIO_OK ? settle_lambda(s, error) : status;
}

gonio_status gonio_descent_levels(gonio_descent *s, bool brief, gonio_error *error) {
    const int begin = s->best.level;
    gonio_status status = GONIO_OK;
    // One level finer; else coarser, as long as that helps or meets the error asked for.
    for (int step = 1; step >= (brief ? 1 : -1) && status == GONIO_OK; step -= 2) {
        bool better = true;
        for (int level = begin + step; better && level >= 0 && level <= s->finest && gonio_descent_may_try(s);
             level += step) {
            gonio_smooth_form form = s->best;
            form.level = level;
            status = attempt_form(s, &form, s->lambda, &better, error);
        }
        if (s->best.level > begin && s->options->max_error <= 0) {
            break; // coarser ones are worse still
        }
    }
    if (status == GONIO_OK && s->options->lambda < 0 && !brief) {
        status = search_stiffness(s, true, error);
        status = status == GONIO_OK ? settle_lambda(s, error) : status;
    }
    return status;
}
