// SPDX-License-Identifier: BSD-3-Clause
// The choice for small sets: one search, scored by leave-one-out.
//
// It begins at a form for each system of coordinates and one of half vectors with a strong profile (fit/auto/moves.c),
// at a level that suits the number of samples. From the best of these, and from the next best one that comes close, it
// goes on a step at a time along every axis of the forms, stiffness, profile, widths, reciprocity and level, as long as
// that gains (a compass search: Hooke & Jeeves 1961, with steps of one size, since the scores of finer ones are told
// apart by chance alone). One eigendecomposition a form scores every base, channel and lambda. At last it asks what the
// lobes' shares say beside the spline (brdf/kind/lobe_spline.h).
//
// Which form suits a material a part of the samples tells; lambda, and the answer, are those of all.
#include "fit/auto/choose.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread_pool.h"
#include "fit/auto/moves.h"
#include "fit/auto/tuning.h"
#include "fit/eval_cost.h"
#include "fit/lobes/fit.h"

void gonio_auto_choice_release(gonio_auto_choice *choice) {
    for (int b = 0; b < choice->bases_n; b++) {
        gonio_smooth_base_release(&choice->bases[b]);
    }
    gonio_smooth_dense_free(choice->dense);
    free(choice->lambdas);
    free(choice->trials);
    *choice = (gonio_auto_choice){0};
}

// ---- bases ----

typedef struct lobe_job {
    const gonio_dataset *data;
    gonio_lobe_base fitted[GONIO_LOBE_FAMILIES];
    bool usable[GONIO_LOBE_FAMILIES];
} lobe_job;

// The last family comes first: of equal scores the first base is taken.
static void fit_family(void *context, size_t f) {
    lobe_job *job = context;
    const gonio_lobe_family family = (gonio_lobe_family)(GONIO_LOBE_FAMILIES - 1 - f);
    job->usable[f] = gonio_lobe_fit(job->data, family, 2, NULL, &job->fitted[f], NULL) == GONIO_OK;
}

static gonio_status fit_bases(const gonio_dataset *data, gonio_pool *pool, bool lobes, gonio_auto_choice *choice,
                              gonio_error *error) {
    lobe_job job = {.data = data};
    // Two lobes and a diffuse term have seven numbers: below some thirty samples they follow the noise.
    if (lobes && data->kind == GONIO_TRANSFORM_POSITIVE && data->n >= 30) {
        gonio_pool_run(pool, GONIO_LOBE_FAMILIES, fit_family, &job);
    }
    gonio_status status = gonio_smooth_base_init(&choice->bases[choice->bases_n++], data, NULL, error);
    for (int f = 0; f < GONIO_LOBE_FAMILIES; f++) {
        if (job.usable[f] && status == GONIO_OK) {
            status = gonio_smooth_base_init(&choice->bases[choice->bases_n++], data, &job.fitted[f], error);
        }
        if (job.usable[f]) {
            free(job.fitted[f].strength);
        }
    }
    return status;
}

// ---- trials ----

typedef struct search {
    const gonio_dataset *all, *judges; // a part of all, or all
    const gonio_smooth_base *bases;    // at the judges
    int from;                          // the first trial that they scored
    gonio_deadline *watch;
    gonio_pool *pool;
    gonio_auto_choice *choice;
    gonio_auto_space space;
} search;

typedef struct result {
    gonio_smooth_dense *dense; // kept where the judges are all
    gonio_smooth_score score[GONIO_AUTO_BASES];
    double *lambdas;   // [channels], of the last base
    int first, beyond; // of the bases that were scored
    gonio_status status;
    gonio_error error;
} result;

static size_t model_bytes(const gonio_dataset *data, const gonio_smooth_form *form, const gonio_smooth_base *base) {
    const size_t c = (size_t)data->channels;
    const size_t points = gonio_lattice_count(data->dims, form->level) +
                          (form->profile > 0 ? gonio_lattice_count(2, form->profile_level) : 0);
    return points * c * sizeof(float) + c * sizeof(gonio_transform) +
           (base->lobes.lobes > 0 ? c * 3 * sizeof(double) : 0);
}

// How far a trial exceeds a limit; at most 1: not at all.
static double excess(const gonio_auto_trial *t, const gonio_fit_options *options) {
    const double bytes = options->max_bytes > 0 ? (double)t->bytes / (double)options->max_bytes : 0;
    return fmax(bytes, options->max_ns > 0 ? t->ns / options->max_ns : 0);
}

// What a few samples gain may be chance: what costs more must gain its price.
static double priced_score(const gonio_auto_trial *t) {
    const bool usual = gonio_coordinates_base(t->form.coordinates) == t->form.coordinates;
    return t->score.score + (t->form.profile > 0 ? gonio_auto_tuned.profile : 0) +
           (usual ? 0 : gonio_auto_tuned.width) + (t->base == 0 ? gonio_auto_tuned.no_lobes : 0) + t->entry;
}

// Is trial a the better choice? Of those that meet the error asked for, the smaller one; else the lower score.
static bool better(const gonio_auto_trial *a, const gonio_auto_trial *b, const gonio_fit_options *options) {
    const double excess_a = excess(a, options), excess_b = excess(b, options);
    if ((excess_a > 1) != (excess_b > 1)) {
        return excess_a < excess_b;
    }
    // Of two beyond the limits the nearer one, unless a clock's noise is all that lies between them.
    if (excess_a > 1 && fmax(excess_a, excess_b) > 1.2 * fmin(excess_a, excess_b)) {
        return excess_a < excess_b;
    }
    if (options->max_error > 0) {
        const bool good_a = a->score.rmse <= options->max_error, good_b = b->score.rmse <= options->max_error;
        if (good_a != good_b) {
            return good_a;
        }
        if (good_a && a->bytes != b->bytes) {
            return a->bytes < b->bytes;
        }
    }
    return priced_score(a) < priced_score(b);
}

// Stiffness and reciprocity cost nothing: a trial of the same lattice and base has been timed already.
static gonio_status measure_cost(const gonio_dataset *data, const gonio_auto_choice *choice, gonio_auto_trial *trial,
                                 gonio_error *error) {
    for (int t = 0; t < choice->trials_n; t++) {
        const gonio_auto_trial *other = &choice->trials[t];
        if (other->form.coordinates == trial->form.coordinates && other->form.level == trial->form.level &&
            (other->form.profile > 0) == (trial->form.profile > 0) &&
            other->form.profile_level == trial->form.profile_level && other->base == trial->base) {
            trial->ns = other->ns;
            return GONIO_OK;
        }
    }
    return gonio_eval_cost_ns(data, &trial->form, &choice->bases[trial->base].lobes, &trial->ns, error);
}

// Room for one more trial.
static gonio_status reserve_trial(gonio_auto_choice *choice, gonio_error *error) {
    if (choice->trials_n < choice->trials_room) {
        return GONIO_OK;
    }
    const int room = choice->trials_room > 0 ? 2 * choice->trials_room : 64;
    gonio_auto_trial *trials = realloc(choice->trials, (size_t)room * sizeof *trials);
    if (trials == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to choose");
    }
    choice->trials = trials;
    choice->trials_room = room;
    return GONIO_OK;
}

// Solver and lambdas of what is chosen now.
static void keep_solver(gonio_auto_choice *choice, int channels, result *r) {
    gonio_smooth_dense_free(choice->dense);
    choice->dense = r->dense;
    r->dense = NULL;
    memcpy(choice->lambdas, r->lambdas, (size_t)channels * sizeof *choice->lambdas);
}

static gonio_status keep_trials(const search *s, const gonio_smooth_form *form, double entry, result *r,
                                gonio_error *error) {
    gonio_auto_choice *choice = s->choice;
    const gonio_fit_options *options = s->watch->options;
    gonio_status status = GONIO_OK;
    for (int b = r->first; b < r->beyond && status == GONIO_OK; b++) {
        status = reserve_trial(choice, error);
        if (status != GONIO_OK) {
            return status;
        }
        gonio_auto_trial *t = &choice->trials[choice->trials_n];
        *t = (gonio_auto_trial){*form, b, r->score[b], model_bytes(s->all, form, &choice->bases[b]), 0, entry};
        status = options->max_ns > 0 ? measure_cost(s->all, choice, t, error) : GONIO_OK;
        if (status == GONIO_OK &&
            (choice->trials_n == s->from || better(t, &choice->trials[choice->chosen], options))) {
            choice->chosen = choice->trials_n;
            if (r->dense != NULL) {
                keep_solver(choice, s->all->channels, r);
            }
        }
        choice->trials_n += status == GONIO_OK;
    }
    return status;
}

// Bases r->first .. r->beyond - 1; the shares are those of the first one.
static void score_form(const search *s, const gonio_smooth_form *form, result *r) {
    const size_t c = (size_t)s->judges->channels;
    r->lambdas = malloc(c * sizeof *r->lambdas);
    r->status = r->lambdas != NULL
                    ? gonio_smooth_dense_new(s->judges, form, form->shares ? &s->bases[r->first].lobes : NULL,
                                             &r->dense, &r->error)
                    : gonio_fail(&r->error, GONIO_E_MEMORY, "no memory to compare choices");
    for (int b = r->first; b < r->beyond && r->status == GONIO_OK; b++) {
        r->status = gonio_smooth_choose_lambda(r->dense, s->judges, &s->bases[b], s->watch->options->lambda, r->lambdas,
                                               &r->score[b], &r->error);
    }
    if (s->judges != s->all || r->beyond - r->first > 1) {
        gonio_smooth_dense_free(r->dense);
        r->dense = NULL;
    }
}

#define SIDE_BY_SIDE 2
typedef struct job {
    const search *s;
    const gonio_smooth_form *forms;
    result results[SIDE_BY_SIDE];
} job;

static void run_form(void *context, size_t f) {
    job *j = context;
    score_form(j->s, &j->forms[f], &j->results[f]);
}

// A form one level finer than any before takes up to 8 times as long.
static bool time_for(const gonio_deadline *watch, const gonio_auto_choice *choice, const gonio_smooth_form *forms,
                     int n, double longest) {
    int finest = 0, next = 0;
    for (int t = 0; t < choice->trials_n; t++) {
        finest = choice->trials[t].form.level > finest ? choice->trials[t].form.level : finest;
    }
    for (int f = 0; f < n; f++) {
        next = forms[f].level > next ? forms[f].level : next;
    }
    return choice->trials_n == 0 || gonio_deadline_left(watch) > longest * (next > finest ? 8 : 1);
}

// Which bases to score, and what a form must gain.
typedef struct manner {
    int first, beyond;
    double entry;
} manner;

static gonio_status score_two(search *s, const gonio_smooth_form *forms, int n, const manner *how, gonio_error *error) {
    job j = {.s = s, .forms = forms};
    for (int f = 0; f < n; f++) {
        j.results[f] = (result){.first = how->first, .beyond = how->beyond};
    }
    gonio_pool_run(s->pool, (size_t)n, run_form, &j);
    gonio_status status = GONIO_OK;
    for (int f = 0; f < n; f++) {
        result *r = &j.results[f];
        if (status == GONIO_OK && r->status != GONIO_OK && error != NULL) {
            *error = r->error;
        }
        status = status == GONIO_OK ? r->status : status;
        status = status == GONIO_OK ? keep_trials(s, &forms[f], how->entry, r, error) : status;
        gonio_smooth_dense_free(r->dense);
        free(r->lambdas);
    }
    return status;
}

// As many at a time as run side by side: between them the caller may stop, and the time is looked at.
static gonio_status score_forms(search *s, const gonio_smooth_form *forms, int n, const manner *how,
                                gonio_error *error) {
    gonio_auto_choice *choice = s->choice;
    const int side_by_side = isinf(s->watch->until) ? SIDE_BY_SIDE : 1;
    gonio_status status = GONIO_OK;
    for (int f = 0; f < n && status == GONIO_OK; f += side_by_side) {
        const int count = n - f < side_by_side ? n - f : side_by_side;
        const double start = gonio_clock_s();
        if (time_for(s->watch, choice, forms + f, count, choice->longest)) {
            status = score_two(s, forms + f, count, how, error);
            choice->longest = fmax(choice->longest, gonio_clock_s() - start);
            status = status == GONIO_OK ? gonio_deadline_poll(s->watch, error) : status;
        }
    }
    return status;
}

// ---- the search ----

// A level at which a sample has some cells to itself and n^2 8^level stays within seconds.
static int first_level(const gonio_dataset *data) {
    const int most = data->dims == 3 ? 4 : gonio_auto_finest(data->dims);
    int level = 0;
    while (level < most && ldexp(1, data->dims * level) < 2.0 * (double)data->n) {
        level++;
    }
    return level;
}

static bool was_tried(const search *s, const gonio_smooth_form *form) {
    bool tried = false;
    for (int t = s->from; t < s->choice->trials_n && !tried; t++) {
        tried = gonio_auto_same_form(&s->choice->trials[t].form, form);
    }
    return tried;
}

// The best of the trials from `first` on, and of *best where it is one.
static void take_best(const search *s, int first, int *best) {
    const gonio_auto_trial *trials = s->choice->trials;
    for (int t = first; t < s->choice->trials_n; t++) {
        *best = *best < 0 || better(&trials[t], &trials[*best], s->watch->options) ? t : *best;
    }
}

// `steps` steps up (by 1) or down (-1) from a form along an axis; false: there is none, or it was tried.
static bool step(const search *s, const gonio_smooth_form *from, gonio_auto_axis axis, int by, int steps,
                 gonio_smooth_form *form) {
    bool moved = true;
    *form = *from;
    for (int k = 0; k < steps && moved; k++) {
        moved = gonio_auto_move(&s->space, form, axis, by);
    }
    return moved && !was_tried(s, form);
}

static bool limited(const gonio_fit_options *o) { return o->max_bytes > 0 || o->max_ns > 0 || o->max_error > 0; }

// From the best trial on along an axis, both ways, then on in the one that is better for as long as it is. A limit may
// be met some levels off only: then each level is looked at.
static gonio_status go_along(search *s, gonio_auto_axis axis, manner how, int *best, gonio_error *error) {
    const bool all = axis == GONIO_AUTO_LEVEL && limited(s->watch->options);
    const gonio_smooth_form from = s->choice->trials[*best].form;
    gonio_smooth_form forms[2];
    gonio_status status = GONIO_OK;
    how.entry += s->choice->trials[*best].entry;
    for (int steps = 1, way = 0, before = -1; status == GONIO_OK && (all ? steps <= GONIO_LEVEL_MAX : *best != before);
         steps++) {
        const int first = s->choice->trials_n, down = way <= 0 && step(s, &from, axis, -1, steps, &forms[0]),
                  n = down + (way >= 0 && step(s, &from, axis, 1, steps, &forms[down]));
        before = *best;
        status = score_forms(s, forms, n, &how, error);
        how.entry += gonio_auto_tuned.gain;
        take_best(s, first, best);
        way = all ? 0 : n > down && gonio_auto_same_form(&s->choice->trials[*best].form, &forms[down]) ? 1 : -1;
    }
    return status;
}

#define SWEEPS 2 // over all axes

static gonio_status descend(search *s, int *best, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int sweep = 0, before = -1; sweep < SWEEPS && before != *best && status == GONIO_OK; sweep++) {
        before = *best;
        for (gonio_auto_axis axis = 0; axis < GONIO_AUTO_AXES && status == GONIO_OK; axis++) {
            status = go_along(s, axis, (manner){0, s->choice->bases_n, gonio_auto_tuned.gain}, best, error);
        }
    }
    return status;
}

// What the chosen lobes' shares say beside the spline.
static gonio_status try_shares(search *s, gonio_error *error) {
    const gonio_auto_trial *chosen = &s->choice->trials[s->choice->chosen];
    gonio_smooth_form form = chosen->form;
    const manner how = {chosen->base, chosen->base + 1, chosen->entry};
    form.shares = true;
    return s->choice->bases[chosen->base].lobes.lobes > 0 ? score_forms(s, &form, 1, &how, error) : GONIO_OK;
}

#define STARTS (GONIO_COORDINATES + 1)

// best[n]: each start's best trial. Half vectors with a profile must gain two standard errors of what the residuals
// tell: the logarithm of their rms is known to sqrt((kurtosis - 1)/(4 n)), which is 1/sqrt(n) at a kurtosis of 5,
// between a normal's 3 and Laplace's 6.
static gonio_status begin(search *s, const gonio_smooth_form *forms, int n, int *best, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int f = 0; f < n && status == GONIO_OK; f++) {
        const int first = s->choice->trials_n;
        const double entry = forms[f].profile > 0 ? 2 / sqrt((double)s->all->measured) : 0;
        const manner how = {0, s->choice->bases_n, entry};
        status = score_forms(s, &forms[f], 1, &how, error);
        best[f] = -1;
        take_best(s, first, &best[f]);
    }
    return status;
}

static gonio_status search_forms(search *s, gonio_error *error) {
    gonio_smooth_form forms[STARTS];
    int best[STARTS];
    const gonio_fit_options *options = s->watch->options;
    const gonio_auto_choice *choice = s->choice;
    const int level = options->level != GONIO_LEVEL_AUTO ? options->level : first_level(s->judges);
    const int n = gonio_auto_starts(&s->space, level, s->all->mirror, forms);
    // Errors at the samples hardly tell a lattice that is too coarse for what lies between them.
    s->space.coarsest = limited(options) ? 0 : level;
    if (n == 0) {
        return gonio_fail(error, GONIO_E_FAILED, "the choice has no forms to compare");
    }
    gonio_status status = gonio_deadline_report(s->watch, 0.1, "comparing coordinates", error);
    status = status == GONIO_OK ? begin(s, forms, n, best, error) : status;
    for (int k = 0; k < 2 && status == GONIO_OK; k++) {
        int next = -1; // the best start that was not followed
        for (int f = 0; f < n; f++) {
            if (best[f] >= 0 && (next < 0 || better(&choice->trials[best[f]], &choice->trials[best[next]], options))) {
                next = f;
            }
        }
        if (next < 0 || choice->trials[best[next]].score.score >
                            choice->trials[choice->chosen].score.score + 2 * gonio_auto_tuned.close) {
            break;
        }
        status = gonio_deadline_report(s->watch, 0.2 + 0.3 * k, "comparing forms", error);
        status = status == GONIO_OK ? descend(s, &best[next], error) : status;
        best[next] = -1;
    }
    status = status == GONIO_OK && s->space.profile ? try_shares(s, error) : status;
    return status;
}

// ---- on all samples ----

// A part has wider gaps than the whole, so that it wants a stiffer and coarser lattice or a stronger profile: these are
// looked at once more. What the part scored is moved by what the chosen form scores better at all.
static gonio_status settle(search *s, gonio_error *error) {
    gonio_auto_choice *choice = s->choice;
    const gonio_auto_trial chosen = choice->trials[choice->chosen];
    const manner how = {chosen.base, chosen.base + 1, chosen.entry}, onward = {chosen.base, chosen.base + 1, 0};
    const bool part = s->judges != s->all;
    s->judges = s->all;
    s->bases = choice->bases;
    s->from = choice->trials_n;
    gonio_status status = gonio_deadline_report(s->watch, 0.8, "solving", error);
    const double start = gonio_clock_s();
    status = status == GONIO_OK ? score_two(s, &chosen.form, 1, &how, error) : status;
    choice->longest = fmax(choice->longest, gonio_clock_s() - start);
    int best = choice->chosen;
    for (int t = 0; t < s->from && status == GONIO_OK; t++) {
        choice->trials[t].score.score += choice->trials[best].score.score - chosen.score.score;
    }
    static const gonio_auto_axis axes[] = {GONIO_AUTO_PROFILE, GONIO_AUTO_STIFFNESS, GONIO_AUTO_LEVEL};
    for (size_t k = 0; k < sizeof axes / sizeof *axes && part && status == GONIO_OK; k++) {
        status = go_along(s, axes[k], onward, &best, error);
    }
    return status;
}

// Some geometries and channels that judge for all, and the bases there. Release both.
static gonio_status take_part(const search *s, gonio_dataset *part, gonio_smooth_base *bases, gonio_error *error) {
    const gonio_dataset *data = s->all;
    const int most = gonio_auto_tuned.channels, channels = data->channels < most ? data->channels : most;
    const size_t row = 1 + GONIO_LOBES_MAX;
    int which[GONIO_CHANNELS_MAX];
    for (int k = 0; k < channels; k++) {
        which[k] = (2 * k + 1) * data->channels / (2 * channels);
    }
    const size_t n = data->measured < gonio_auto_tuned.part ? data->measured : gonio_auto_tuned.part;
    gonio_dataset thin;
    gonio_status status = gonio_dataset_thin(data, n, s->watch->options->seed, &thin, error);
    if (status == GONIO_OK) {
        status = gonio_dataset_channels(&thin, which, channels, part, error);
        gonio_dataset_release(&thin);
    }
    for (int b = 0; b < s->choice->bases_n && status == GONIO_OK; b++) {
        const gonio_lobe_base *lobes = &s->choice->bases[b].lobes;
        gonio_lobe_base own = *lobes;
        own.strength = lobes->lobes > 0 ? malloc((size_t)channels * row * sizeof(double)) : NULL;
        for (int k = 0; k < channels && own.strength != NULL; k++) {
            memcpy(own.strength + (size_t)k * row, lobes->strength + (size_t)which[k] * row, row * sizeof(double));
        }
        status = lobes->lobes > 0 && own.strength == NULL
                     ? gonio_fail(error, GONIO_E_MEMORY, "no memory for lobes")
                     : gonio_smooth_base_init(&bases[b], part, lobes->lobes > 0 ? &own : NULL, error);
        free(own.strength);
    }
    return status;
}

gonio_status gonio_auto_choose(const gonio_dataset *data, gonio_deadline *watch, bool lobes, bool terms,
                               gonio_auto_choice *choice, gonio_error *error) {
    *choice = (gonio_auto_choice){.lambdas = malloc((size_t)data->channels * sizeof(double))};
    gonio_dataset part = {0};
    gonio_smooth_base bases[GONIO_AUTO_BASES];
    memset(bases, 0, sizeof bases);
    search s = {.all = data,
                .watch = watch,
                .choice = choice,
                .space = {.options = watch->options, .dims = data->dims, .profile = terms}};
    s.pool = gonio_pool_new(watch->options->threads);
    gonio_status status = choice->lambdas != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory to choose");
    status = status == GONIO_OK ? gonio_deadline_report(watch, 0, "fitting lobes", error) : status;
    status = status == GONIO_OK ? fit_bases(data, s.pool, lobes, choice, error) : status;
    // A limit of the error is one of all samples.
    const bool whole = watch->options->max_error > 0 ||
                       (data->measured <= gonio_auto_tuned.part && data->channels <= gonio_auto_tuned.channels);
    if (status == GONIO_OK && !whole) {
        status = take_part(&s, &part, bases, error);
    }
    s.judges = whole ? data : &part;
    s.bases = whole ? choice->bases : bases;
    const double until = watch->until;
    watch->until = whole ? until : 0.5 * (gonio_clock_s() + until); // the rest is for all samples
    status = status == GONIO_OK ? search_forms(&s, error) : status;
    watch->until = until;
    status = status == GONIO_OK ? settle(&s, error) : status;
    for (int b = 0; b < GONIO_AUTO_BASES; b++) {
        gonio_smooth_base_release(&bases[b]);
    }
    gonio_dataset_release(&part);
    gonio_pool_free(s.pool);
    if (status != GONIO_OK) {
        gonio_auto_choice_release(choice);
    }
    return status;
}
