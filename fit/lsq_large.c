// The choice and the fit of large sets.
//
// Closed forms cost n^3, so choices are scored on a fifth of the geometries that the fit has not seen (at most three
// channels of them: more say little more). lambda is searched first by hundreds, then by tens, each solve beginning
// where the last one ended; then one level finer and coarser. About a dozen short solves.
#include "fit/lsq_large.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/auto_cost.h"
#include "fit/lsq_cg.h"

#define CHANNELS_TRIED 3
#define FOLDS 5
#define TRIAL_ITERATIONS_MIN 12
#define TRIAL_ITERATIONS_MAX 80
#define TRIAL_WORK 4e6 // samples x iterations of a trial solve: a fraction of a second
#define FINAL_ITERATIONS 200
#define TOLERANCE 1e-3 // the gradient's fall that ends a solve: below what the held-out error can tell

// ---- inner hold-out ----

typedef struct inner {
    gonio_lsq_data train, held;
    int which[CHANNELS_TRIED], channels;
    double *residuals, *work;
} inner;

static void inner_release(inner *in) {
    gonio_lsq_data_release(&in->train);
    gonio_lsq_data_release(&in->held);
    free(in->residuals);
    free(in->work);
}

// Steele, Lea and Flood (2014): the mixing function of SplitMix64.
static uint64_t mix(uint64_t x) {
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

static gonio_status split(const gonio_lsq_data *some, const bool *given, inner *in, gonio_error *error) {
    bool *keep = malloc(some->n * sizeof *keep);
    if (keep == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to hold samples out");
    }
    // Geometries are in order, so a draw from each five neighbours holds out a stratified fifth.
    for (size_t i = 0; i < some->n; i++) {
        keep[i] = given != NULL ? given[i] : mix(i / FOLDS) % FOLDS != i % FOLDS;
    }
    gonio_status status = gonio_lsq_data_select(some, keep, &in->train, error);
    for (size_t i = 0; i < some->n; i++) {
        keep[i] = !keep[i];
    }
    if (status == GONIO_OK) {
        status = gonio_lsq_data_select(some, keep, &in->held, error);
    }
    free(keep);
    return status;
}

// keep: what is not held out; NULL: a fifth is.
static gonio_status inner_init(inner *in, const gonio_lsq_data *data, const bool *keep, gonio_error *error) {
    *in = (inner){.channels = data->channels < CHANNELS_TRIED ? data->channels : CHANNELS_TRIED};
    for (int k = 0; k < in->channels; k++) {
        in->which[k] = (int)((2 * k + 1) * data->channels / (2 * in->channels));
    }
    gonio_lsq_data some;
    gonio_status status = gonio_lsq_data_channels(data, in->which, in->channels, &some, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = split(&some, keep, in, error);
    gonio_lsq_data_release(&some);
    if (status == GONIO_OK) {
        in->residuals = malloc(in->held.n * (size_t)in->channels * sizeof *in->residuals);
        in->work = malloc(in->held.n * sizeof *in->work);
        if (in->residuals == NULL || in->work == NULL) {
            status = gonio_fail(error, GONIO_E_MEMORY, "no memory to score held-out samples");
        }
    }
    if (status != GONIO_OK) {
        inner_release(in);
    }
    return status;
}

// The candidate's base for the channels tried; strength NULL without one.
static gonio_status tried_lobes(const gonio_lobe_base *lobes, const inner *in, gonio_lobe_base *out,
                                gonio_error *error) {
    const size_t row = 1 + GONIO_LOBES_MAX;
    *out = *lobes;
    out->strength = malloc((size_t)in->channels * row * sizeof *out->strength);
    if (out->strength == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for lobes");
    }
    for (int k = 0; k < in->channels; k++) {
        memcpy(out->strength + (size_t)k * row, lobes->strength + (size_t)in->which[k] * row, row * sizeof(double));
    }
    return GONIO_OK;
}

// ---- one candidate ----

typedef struct search {
    const inner *in;
    const gonio_fit_options *options;
    gonio_lsq_watch *watch;
    const gonio_lsq_data *all;
    const gonio_lobe_base *lobes;
    double ns; // of an evaluation at this level; 0: not asked for
    gonio_lsq_base train, held;
    gonio_lsq_form form;
    gonio_lsq_cg *cg;
    double *points;                 // channels x count, where the last solve ended
    gonio_lsq_large_choice *choice; // keeps what was scored; may be NULL
} search;

static void search_release(search *s) {
    gonio_lsq_cg_free(s->cg);
    gonio_lsq_base_release(&s->train);
    gonio_lsq_base_release(&s->held);
    free(s->points);
}

static gonio_status search_init(search *s, const gonio_lsq_data *all, const inner *in, gonio_lsq_watch *watch,
                                const gonio_lobe_base *lobes, gonio_error *error) {
    *s = (search){.in = in, .options = watch->options, .watch = watch, .all = all, .lobes = lobes};
    gonio_status status = GONIO_OK;
    for (int side = 0; side < 2 && status == GONIO_OK; side++) {
        gonio_lobe_base own = {0};
        if (lobes != NULL) {
            status = tried_lobes(lobes, in, &own, error);
        }
        if (status == GONIO_OK) {
            status = gonio_lsq_base_init(side == 0 ? &s->train : &s->held, side == 0 ? &in->train : &in->held,
                                         lobes != NULL ? &own : NULL, error);
        }
        free(own.strength);
    }
    return status;
}

static gonio_status set_level(search *s, const gonio_lsq_form *form, gonio_error *error) {
    gonio_lsq_cg_free(s->cg);
    s->cg = NULL;
    free(s->points);
    s->form = *form;
    const size_t count = gonio_lattice_count(s->in->train.dims, form->level);
    s->points = malloc(count * (size_t)s->in->channels * sizeof *s->points);
    if (s->points == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for level %d (%.3g GB)", form->level,
                          8e-9 * (double)count * s->in->channels);
    }
    const gonio_status status = gonio_lsq_cg_new(&s->in->train, form, s->options->threads, &s->cg, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_lsq_cg_watch(s->cg, s->watch);
    return s->options->max_ns > 0 ? gonio_auto_cost_ns(s->all, form, s->lobes, &s->ns, error) : GONIO_OK;
}

// Residuals of the points now, on the held-out.
static gonio_status score_points(search *s, gonio_lsq_score *score, gonio_error *error) {
    const size_t c = (size_t)s->in->channels, count = gonio_lsq_cg_count(s->cg, s->form.level);
    gonio_status status = GONIO_OK;
    for (size_t k = 0; k < c && status == GONIO_OK; k++) {
        status = gonio_lsq_cg_eval(s->cg, &s->in->held, s->form.level, s->points + k * count, s->in->residuals + k, c,
                                   error);
    }
    for (size_t i = 0; i < s->in->held.n * c && status == GONIO_OK; i++) {
        // The held-out targets lost their own mean; the model adds the training mean.
        const double truth = s->held.rest[i] + s->held.mean[i % c] - s->train.mean[i % c];
        s->in->residuals[i] = truth - s->in->residuals[i];
    }
    if (status == GONIO_OK) {
        *score = gonio_lsq_score_of(&s->in->held, s->in->residuals, s->in->work);
        // Thousands of held-out samples tell the peak's error too, which a single grazing one sets in small sets.
        if (s->in->held.kind != GONIO_LINK_LINEAR) {
            score->score += 0.5 * log(score->rmse / s->in->held.links[0].scale + 1e-9);
        }
    }
    return status;
}

static int trial_iterations(const search *s) {
    if (s->options->iterations > 0) {
        return s->options->iterations;
    }
    const double affordable = TRIAL_WORK / (double)s->in->train.n;
    return (int)fmin(fmax(affordable, TRIAL_ITERATIONS_MIN), TRIAL_ITERATIONS_MAX);
}

static void keep_trial(const search *s, gonio_lsq_score score) {
    gonio_lsq_large_choice *choice = s->choice;
    const gonio_lsq_large_trial trial = {s->form.coordinates, s->form.level, s->lobes, score};
    for (int t = 0; t < choice->trials_n; t++) {
        gonio_lsq_large_trial *other = &choice->trials[t];
        if (other->coordinates == trial.coordinates && other->level == trial.level && other->lobes == trial.lobes) {
            *other = score.score < other->score.score ? trial : *other;
            return;
        }
    }
    if (choice->trials_n < GONIO_LSQ_LARGE_TRIALS) {
        choice->trials[choice->trials_n++] = trial;
    }
}

// Solve at this level with lambda; `warm` from where the points are.
static gonio_status score_lambda(search *s, double lambda, bool warm, gonio_lsq_score *score, gonio_error *error) {
    const size_t c = (size_t)s->in->channels, count = gonio_lsq_cg_count(s->cg, s->form.level);
    gonio_status status = GONIO_OK;
    for (size_t k = 0; k < c && status == GONIO_OK; k++) {
        gonio_lsq_cg_report report;
        double *points = s->points + k * count;
        if (warm) {
            status = gonio_lsq_cg_solve(s->cg, s->train.rest + k, c, s->form.level, lambda, trial_iterations(s),
                                        TOLERANCE, points, &report, error);
        } else {
            status = gonio_lsq_cg_cascade(s->cg, s->train.rest + k, c, lambda, 2 * trial_iterations(s), TOLERANCE,
                                          points, &report, error);
        }
    }
    if (status == GONIO_OK) {
        status = score_points(s, score, error);
    }
    if (status == GONIO_OK && s->choice != NULL) {
        keep_trial(s, *score);
    }
    return status;
}

// Of those that meet --max-error the coarser; else the better score.
static bool preferred(const gonio_lsq_large_choice *choice, const search *s, gonio_lsq_score score) {
    const double limit = s->options->max_error;
    const bool good = limit > 0 && score.rmse <= limit, good_before = limit > 0 && choice->score.rmse <= limit;
    if (good != good_before) {
        return good;
    }
    return good && s->form.level != choice->form.level ? s->form.level < choice->form.level
                                                       : score.score < choice->score.score;
}

// The first; then what meets --max-ns, and of such what scores better.
static bool accept(gonio_lsq_large_choice *choice, const search *s, const gonio_lobe_base *lobes, double lambda,
                   gonio_lsq_score score) {
    const double limit = s->options->max_ns;
    const bool within = limit <= 0 || s->ns <= limit, within_before = limit <= 0 || choice->ns <= limit;
    const bool first = choice->score.score == INFINITY;
    if (!first && (within != within_before ? !within : !preferred(choice, s, score))) {
        return false;
    }
    choice->ns = s->ns;
    choice->form = s->form;
    choice->lobes = lobes;
    choice->lambda = lambda;
    choice->score = score;
    return true;
}

// Is there time for one more solve? The first must be made in any case.
static bool may_try(const search *s, const gonio_lsq_large_choice *choice) {
    return choice->score.score == INFINITY || !gonio_lsq_watch_over(s->watch);
}

// The best lambda at this level, by factors of 100 downhill, then of 10 about the best.
static gonio_status search_lambda(search *s, const gonio_lobe_base *lobes, gonio_lsq_large_choice *choice,
                                  double *best_lambda, double *best_score, gonio_error *error) {
    gonio_lsq_score score;
    *best_score = INFINITY;
    *best_lambda = 0.1;
    gonio_status status = GONIO_OK;
    for (double lambda = 0.1; lambda >= 1e-9 && status == GONIO_OK && may_try(s, choice); lambda *= 1e-2) {
        status = score_lambda(s, lambda, lambda < 0.1, &score, error);
        if (status != GONIO_OK || score.score > *best_score + 0.7) {
            break;
        }
        if (score.score < *best_score) {
            *best_lambda = lambda;
            *best_score = score.score;
            accept(choice, s, lobes, lambda, score);
        }
    }
    const double centre = *best_lambda;
    for (int side = 0; side < 2 && status == GONIO_OK && may_try(s, choice); side++) {
        const double lambda = centre * (side == 0 ? 0.1 : 10);
        status = score_lambda(s, lambda, true, &score, error);
        if (status == GONIO_OK && score.score < *best_score) {
            *best_score = score.score;
            *best_lambda = lambda;
            accept(choice, s, lobes, lambda, score);
        }
    }
    return status;
}

// The multilevel start alone at this level: the solution must not be worse.
static gonio_status score_start(search *s, gonio_lsq_large_choice *choice, gonio_error *error) {
    const size_t c = (size_t)s->in->channels, count = gonio_lsq_cg_count(s->cg, s->form.level);
    for (size_t k = 0; k < c; k++) {
        gonio_lsq_cg_start(s->cg, s->train.rest + k, c, s->form.level, s->points + k * count);
    }
    return score_points(s, &choice->start_score, error);
}

static int finest_level(const gonio_lsq_data *data, const gonio_fit_options *options) {
    const int dims = data->dims, cap = dims == 3 ? (data->n >= 1000000 ? 7 : 6) : (data->n >= 100000 ? 5 : 4);
    int level = 0;
    while (level < cap && ldexp(1, dims * (level + 1)) <= 32.0 * (double)data->n) {
        level++;
    }
    while (options->max_bytes > 0 && level > 0 &&
           gonio_lattice_count(dims, level) * (size_t)data->channels * sizeof(float) > options->max_bytes) {
        level--;
    }
    return level;
}

// ---- stiffness ----

#define STIFFNESS_MIN 1e-2
#define STIFFNESS_MAX 1e4
#define HOPELESS 2.0 // a worse score than the best by more than that is not made good by stiffness

// The axes along which BRDFs vary slowly: the difference angle, or the incidence.
static void stiffen(gonio_lsq_form *form, int dims, double factor) {
    const int count = dims == 3 ? 1 : 2, first = gonio_coordinates_are_half_vector(form->coordinates) ? dims - count : 0;
    for (int d = first; d < first + count; d++) {
        form->stretch[d] *= factor;
    }
}

static double stiffness(const gonio_lsq_form *form, int dims) {
    return form->stretch[gonio_coordinates_are_half_vector(form->coordinates) ? dims - 1 : 0];
}

// Score a form, and keep it where it is better than *before.
static gonio_status try_form(search *s, const gonio_lsq_form *form, double lambda, gonio_lsq_large_choice *choice,
                             double *before, bool *better, gonio_error *error) {
    gonio_lsq_score score = {INFINITY, INFINITY};
    gonio_status status = set_level(s, form, error);
    if (status == GONIO_OK) {
        status = score_lambda(s, lambda, false, &score, error);
    }
    const double limit = s->options->max_error;
    const bool cheaper = limit > 0 && score.rmse <= limit && form->level < choice->form.level;
    *better = status == GONIO_OK && (score.score < *before || cheaper);
    if (*better) {
        *before = score.score;
        accept(choice, s, s->lobes, lambda, score);
    }
    return status;
}

// Stiffer by `factor`, again and again as long as that helps.
static gonio_status stiffen_by(search *s, double factor, gonio_lsq_form *form, double lambda,
                               gonio_lsq_large_choice *choice, double *before, bool *moved, gonio_error *error) {
    const int dims = s->all->dims;
    gonio_status status = GONIO_OK;
    for (bool better = true; better && status == GONIO_OK && may_try(s, choice);) {
        gonio_lsq_form trial = *form;
        stiffen(&trial, dims, factor);
        if (stiffness(&trial, dims) < STIFFNESS_MIN || stiffness(&trial, dims) > STIFFNESS_MAX) {
            break;
        }
        status = try_form(s, &trial, lambda, choice, before, &better, error);
        if (better) {
            *form = trial;
            *moved = true;
        }
    }
    return status;
}

// A sharp lobe at grazing angles has few samples of its own: along the slow axes it is told by the others, if the
// spline is stiff there. By tens and hundreds up, or else down; then lambda again. At the finest level, which a stiffer
// spline can afford.
static gonio_status search_stiffness(search *s, const gonio_lsq_form *best, int finest, double lambda,
                                     gonio_lsq_large_choice *choice, double *before, gonio_error *error) {
    static const double steps[] = {100, 10, 0.1};
    gonio_lsq_form form = *best;
    form.level = finest;
    gonio_status status = GONIO_OK;
    bool moved = false;
    for (int k = 0; k < 3 && status == GONIO_OK && !(moved && steps[k] < 1); k++) {
        status = stiffen_by(s, steps[k], &form, lambda, choice, before, &moved, error);
    }
    bool better = !moved;
    for (int up = 0; up < 2 && !better && status == GONIO_OK && may_try(s, choice); up++) {
        status = try_form(s, &form, lambda * (up ? 10 : 0.1), choice, before, &better, error);
    }
    return status;
}

static gonio_status try_candidate(const gonio_lsq_data *data, const inner *in, gonio_lsq_watch *watch,
                                  const gonio_lsq_candidate *candidate, gonio_lsq_large_choice *choice,
                                  gonio_error *error) {
    const gonio_fit_options *options = watch->options;
    search s;
    gonio_lsq_form form = candidate->form;
    const bool open = options->level == GONIO_LEVEL_AUTO;
    const int finest = finest_level(data, options);
    form.level = open ? (finest > 0 ? finest - 1 : 0) : options->level;
    gonio_status status = search_init(&s, data, in, watch, candidate->lobes, error);
    s.choice = choice;
    if (status == GONIO_OK) {
        status = set_level(&s, &form, error);
    }
    double lambda = options->lambda, before = INFINITY;
    gonio_lsq_score score;
    if (status == GONIO_OK && lambda >= 0) {
        status = score_lambda(&s, lambda, false, &score, error);
        before = score.score;
        accept(choice, &s, candidate->lobes, lambda, score);
    } else if (status == GONIO_OK) {
        status = search_lambda(&s, candidate->lobes, choice, &lambda, &before, error);
    }
    gonio_lsq_form best = form;
    // One level finer; or coarser, as long as that helps.
    for (int step = 1; open && step >= -1 && status == GONIO_OK; step -= 2) {
        bool better = true;
        for (form.level = finest - 1 + step; better && form.level >= 0 && form.level <= finest && may_try(&s, choice);
             form.level += step) {
            status = try_form(&s, &form, lambda, choice, &before, &better, error);
            best = better ? form : best;
        }
    }
    if (status == GONIO_OK && options->lambda < 0 && before < choice->score.score + HOPELESS) {
        status = search_stiffness(&s, &best, open ? finest : best.level, lambda, choice, &before, error);
    }
    search_release(&s);
    return status;
}

gonio_status gonio_lsq_large_choose(const gonio_lsq_data *data, gonio_lsq_watch *watch,
                                    const gonio_lsq_candidate *candidates, int n, gonio_lsq_large_choice *choice,
                                    gonio_error *error) {
    *choice = (gonio_lsq_large_choice){0};
    inner in;
    gonio_status status = inner_init(&in, data, NULL, error);
    if (status != GONIO_OK) {
        return status;
    }
    choice->score.score = INFINITY;
    for (int k = 0; k < n && status == GONIO_OK; k++) {
        status = gonio_lsq_watch_tell(watch, 0.6 + 0.2 * k / n, "choosing lambda and level", error);
        if (status == GONIO_OK && (k == 0 || !gonio_lsq_watch_over(watch))) {
            status = try_candidate(data, &in, watch, &candidates[k], choice, error);
        }
    }
    search s = {0};
    if (status == GONIO_OK) {
        status = search_init(&s, data, &in, watch, choice->lobes, error);
        if (status == GONIO_OK) {
            status = set_level(&s, &choice->form, error);
        }
        if (status == GONIO_OK) {
            status = score_start(&s, choice, error);
        }
        search_release(&s);
    }
    if (status == GONIO_OK) {
        choice->start_only = choice->start_score.score < choice->score.score;
    }
    inner_release(&in);
    return status;
}

// ---- the choice without some samples ----

void gonio_lsq_left_out_release(gonio_lsq_left_out *out) {
    gonio_lsq_data_release(&out->kept);
    gonio_lsq_data_release(&out->held);
    free(out->residuals);
    free(out->replicate);
    *out = (gonio_lsq_left_out){0};
}

// What noise of unit variance (at full weight) in every kept sample leaves at the held-out ones: one draw.
static gonio_status replicate_noise(search *s, const gonio_lsq_large_choice *choice, double *out, gonio_error *error) {
    const size_t n = s->in->train.n;
    double *noise = malloc(n * sizeof *noise);
    if (noise == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    for (size_t i = 0; i < n; i++) {
        // Irwin-Hall: 12 uniforms less 6 are as good as normal here.
        double sum = -6;
        for (uint64_t k = 0; k < 12; k++) {
            sum += (double)(mix(12 * i + k) >> 11) * 0x1p-53;
        }
        noise[i] = sum / sqrt(s->in->train.weights[i]);
    }
    gonio_lsq_cg_report unused;
    gonio_status status = GONIO_OK;
    if (choice->start_only) {
        gonio_lsq_cg_start(s->cg, noise, 1, s->form.level, s->points);
    } else {
        status = gonio_lsq_cg_cascade(s->cg, noise, 1, choice->lambda, 2 * trial_iterations(s), TOLERANCE, s->points,
                                      &unused, error);
    }
    free(noise);
    return status == GONIO_OK ? gonio_lsq_cg_eval(s->cg, &s->in->held, s->form.level, s->points, out, 1, error)
                              : status;
}

gonio_status gonio_lsq_large_leave_out(const gonio_lsq_data *data, gonio_lsq_watch *watch,
                                       const gonio_lsq_large_choice *choice, const bool *keep, gonio_lsq_left_out *out,
                                       gonio_error *error) {
    *out = (gonio_lsq_left_out){0};
    inner in;
    gonio_status status = inner_init(&in, data, keep, error);
    if (status != GONIO_OK) {
        return status;
    }
    search s = {0};
    gonio_lsq_score score;
    status = search_init(&s, data, &in, watch, choice->lobes, error);
    if (status == GONIO_OK) {
        status = set_level(&s, &choice->form, error);
    }
    if (status == GONIO_OK && choice->start_only) {
        gonio_lsq_large_choice unused;
        status = score_start(&s, &unused, error);
    } else if (status == GONIO_OK) {
        status = score_lambda(&s, choice->lambda, false, &score, error);
    }
    if (status == GONIO_OK && (out->replicate = malloc(in.held.n * sizeof *out->replicate)) == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    if (status == GONIO_OK) {
        status = replicate_noise(&s, choice, out->replicate, error);
    }
    search_release(&s);
    if (status == GONIO_OK) {
        out->kept = in.train;
        out->held = in.held;
        out->residuals = in.residuals;
        in.train = in.held = (gonio_lsq_data){0};
        in.residuals = NULL;
    } else {
        gonio_lsq_left_out_release(out);
    }
    inner_release(&in);
    return status;
}

// ---- the fit ----

static gonio_status solve_channels(const gonio_lsq_data *data, gonio_lsq_watch *watch, gonio_lsq_large_choice *choice,
                                   const gonio_lsq_base *base, gonio_lattice *lattice, gonio_error *error) {
    const gonio_fit_options *options = watch->options;
    const size_t c = (size_t)data->channels;
    gonio_lsq_cg *cg = NULL;
    double *points = malloc(lattice->count * sizeof *points);
    gonio_status status = points != NULL ? gonio_lsq_cg_new(data, &choice->form, options->threads, &cg, error)
                                         : gonio_fail(error, GONIO_E_MEMORY, "no memory for level %d", lattice->level);
    const int iterations = options->iterations > 0 ? options->iterations : FINAL_ITERATIONS;
    const double end = watch->until;
    if (status == GONIO_OK) {
        gonio_lsq_cg_watch(cg, watch);
    }
    for (size_t k = 0; k < c && status == GONIO_OK; k++) {
        const double now = gonio_lsq_watch_now();
        watch->until = now + (end - now) / (double)(c - k); // no channel takes the others' time
        gonio_lsq_cg_report report = {0};
        if (choice->start_only) {
            gonio_lsq_cg_start(cg, base->rest + k, c, lattice->level, points);
        } else {
            status = gonio_lsq_cg_cascade(cg, base->rest + k, c, choice->lambda, iterations, TOLERANCE, points, &report,
                                          error);
        }
        choice->iterations = report.iterations > choice->iterations ? report.iterations : choice->iterations;
        choice->gradient = fmax(choice->gradient, report.gradient);
        for (size_t i = 0; i < lattice->count && status == GONIO_OK; i++) {
            lattice->points[i * c + k] = (float)(points[i] + base->mean[k]);
        }
        if (status == GONIO_OK) {
            status = gonio_lsq_watch_tell(watch, 0.8 + 0.2 * (double)(k + 1) / (double)c, "solving", error);
        }
    }
    gonio_lsq_cg_free(cg);
    free(points);
    return status;
}

gonio_status gonio_lsq_large_parts(const gonio_lsq_data *data, gonio_lsq_watch *watch, gonio_lsq_large_choice *choice,
                                   gonio_lobe_model_parts *parts, gonio_error *error) {
    gonio_status status = gonio_lsq_parts_init(parts, data, choice->lobes, choice->form.coordinates, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_lobe_base own = {0};
    gonio_lsq_base base = {0};
    if (choice->lobes != NULL) {
        const size_t size = (size_t)data->channels * (1 + GONIO_LOBES_MAX) * sizeof(double);
        own = *choice->lobes;
        own.strength = malloc(size);
        if (own.strength != NULL) {
            memcpy(own.strength, choice->lobes->strength, size);
        } else {
            status = gonio_fail(error, GONIO_E_MEMORY, "no memory for lobes");
        }
    }
    if (status == GONIO_OK) {
        status = gonio_lsq_base_init(&base, data, choice->lobes != NULL ? &own : NULL, error);
    }
    if (status == GONIO_OK) {
        status = gonio_lsq_parts_hold(parts, &base, error);
    }
    if (status == GONIO_OK) {
        status = gonio_lattice_init(&parts->lattice, data->dims, choice->form.level, data->channels, error);
    }
    if (status == GONIO_OK) {
        status = solve_channels(data, watch, choice, &base, &parts->lattice, error);
    }
    free(own.strength);
    gonio_lsq_base_release(&base);
    if (status != GONIO_OK) {
        gonio_lobe_model_parts_release(parts);
    }
    return status;
}
