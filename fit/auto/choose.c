// SPDX-License-Identifier: BSD-3-Clause
// The choice for small sets, in rounds, each scored by leave-one-out on all its samples:
//   1. coordinates and base, at a level that suits the number of samples;
//   2. how stiff each axis is;
//   3. one level coarser and finer;
//   4. half-vector coordinates for sharper and for broader lobes;
//   5. stiffness once more, a step from what was chosen;
//   6. a profile beside the lattice of what was chosen, or of half vectors where others were (brdf/spline/profile.h);
//   7. how far reciprocity is trusted by it;
//   8. what its lobes' shares say beside the spline (brdf/kind/lobe_spline.h).
// Coordinates that come close to the best ones go on through the rounds: which suit the samples can change with the
// level (a silk's half-vector fit overtook its Nusselt fit only at level 5). A round's forms are independent, so they
// run side by side; one eigendecomposition a form scores every base, channel and lambda.
#include "fit/auto/choose.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread_pool.h"
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
    job->usable[f] = gonio_lobe_fit(job->data, family, 2, &job->fitted[f], NULL) == GONIO_OK;
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

// ---- rounds ----

typedef struct round_result {
    gonio_smooth_dense *dense;
    gonio_smooth_score score[GONIO_AUTO_BASES];
    double *lambdas;   // bases x channels
    int first, beyond; // of the bases that were scored
    gonio_status status;
    gonio_error error;
} round_result;

// Bases r->first .. r->beyond - 1.
static void score_bases(const gonio_smooth_dense *dense, const gonio_dataset *data, const gonio_auto_choice *choice,
                        double lambda, round_result *r) {
    const size_t c = (size_t)data->channels;
    r->lambdas = malloc((size_t)choice->bases_n * c * sizeof *r->lambdas);
    if (r->lambdas == NULL) {
        r->status = gonio_fail(&r->error, GONIO_E_MEMORY, "no memory to compare choices");
    }
    for (int b = r->first; b < r->beyond && r->status == GONIO_OK; b++) {
        r->status = gonio_smooth_choose_lambda(dense, data, &choice->bases[b], lambda, r->lambdas + (size_t)b * c,
                                               &r->score[b], &r->error);
    }
}

static void score_form(const gonio_dataset *data, const gonio_auto_choice *choice, const gonio_smooth_form *form,
                       double lambda, round_result *r) {
    *r = (round_result){.beyond = choice->bases_n};
    r->status = gonio_smooth_dense_new(data, form, &r->dense, &r->error);
    if (r->status == GONIO_OK) {
        score_bases(r->dense, data, choice, lambda, r);
    }
}

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

// What a score must gain before it is worth its price: what a few samples gain may be chance. A profile is a second
// lattice (2 % of the errors); other widths than the usual one are more to choose from (10 %); without lobes nothing
// goes on where nothing has been measured (2 %).
#define PROFILE_PRICE 0.03
#define WIDTH_PRICE 0.15
#define NO_LOBES_PRICE 0.03

static double priced_score(const gonio_auto_trial *t) {
    const bool usual = gonio_coordinates_base(t->form.coordinates) == t->form.coordinates;
    return t->score.score + (t->form.profile > 0 ? PROFILE_PRICE : 0) + (usual ? 0 : WIDTH_PRICE) +
           (t->base == 0 ? NO_LOBES_PRICE : 0) + t->entry;
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

static gonio_status keep_best(const gonio_dataset *data, const gonio_fit_options *options, gonio_auto_choice *choice,
                              const gonio_smooth_form *form, round_result *r, gonio_error *error) {
    const size_t c = (size_t)data->channels;
    for (int b = r->first; b < r->beyond; b++) {
        gonio_status status = reserve_trial(choice, error);
        if (status != GONIO_OK) {
            return status;
        }
        gonio_auto_trial *t = &choice->trials[choice->trials_n];
        *t = (gonio_auto_trial){*form, b, r->score[b], model_bytes(data, form, &choice->bases[b]), 0, choice->entry};
        if (choice->entry == 0 && choice->trials_n > 0) {
            t->entry = choice->trials[choice->chosen].entry;
        }
        status = options->max_ns > 0 ? measure_cost(data, choice, t, error) : GONIO_OK;
        if (status != GONIO_OK) {
            return status;
        }
        if (choice->trials_n == 0 || better(t, &choice->trials[choice->chosen], options)) {
            choice->chosen = choice->trials_n;
            if (r->dense != NULL) {
                gonio_smooth_dense_free(choice->dense);
                choice->dense = r->dense;
                r->dense = NULL;
            }
            memcpy(choice->lambdas, r->lambdas + (size_t)b * c, c * sizeof *choice->lambdas);
        }
        choice->trials_n++;
    }
    return GONIO_OK;
}

#define SIDE_BY_SIDE 2
typedef struct round_job {
    const gonio_dataset *data;
    const gonio_auto_choice *choice;
    const gonio_smooth_form *forms;
    double lambda;
    round_result results[SIDE_BY_SIDE];
} round_job;

static void run_form(void *context, size_t f) {
    round_job *job = context;
    score_form(job->data, job->choice, &job->forms[f], job->lambda, &job->results[f]);
}

static gonio_status run_forms(const gonio_dataset *data, const gonio_fit_options *options, gonio_pool *pool,
                              const gonio_smooth_form *forms, int n, gonio_auto_choice *choice, gonio_error *error) {
    round_job job = {.data = data, .choice = choice, .forms = forms, .lambda = options->lambda};
    round_result *results = job.results;
    gonio_pool_run(pool, (size_t)n, run_form, &job);
    gonio_status status = GONIO_OK;
    for (int f = 0; f < n; f++) {
        if (results[f].status == GONIO_OK && status == GONIO_OK) {
            status = keep_best(data, options, choice, &forms[f], &results[f], error);
        } else if (results[f].status != GONIO_OK && status == GONIO_OK) {
            status = results[f].status;
            if (error != NULL) {
                *error = results[f].error;
            }
        }
        gonio_smooth_dense_free(results[f].dense);
        free(results[f].lambdas);
    }
    return status;
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

// A few forms at a time, as many as run side by side: between them the caller may stop, and the time is looked at.
static gonio_status run_round(const gonio_dataset *data, gonio_deadline *watch, gonio_pool *pool,
                              const gonio_smooth_form *forms, int n, gonio_auto_choice *choice, gonio_error *error) {
    const int side_by_side = isinf(watch->until) ? SIDE_BY_SIDE : 1;
    gonio_status status = GONIO_OK;
    for (int f = 0; f < n && status == GONIO_OK; f += side_by_side) {
        const int count = n - f < side_by_side ? n - f : side_by_side;
        const double start = gonio_clock_s();
        if (!time_for(watch, choice, forms + f, count, choice->longest)) {
            continue;
        }
        status = run_forms(data, watch->options, pool, forms + f, count, choice, error);
        choice->longest = fmax(choice->longest, gonio_clock_s() - start);
        status = status == GONIO_OK ? gonio_deadline_poll(watch, error) : status;
    }
    return status;
}

// A level at which a sample has some cells to itself and n^2 8^level stays within seconds.
static int first_level(const gonio_dataset *data) {
    const int most = data->dims == 3 ? 4 : GONIO_SMOOTH_DENSE_LEVEL_MAX_4D;
    int level = 0;
    while (level < most && ldexp(1, data->dims * level) < 2.0 * (double)data->n) {
        level++;
    }
    return level;
}

static double fixed_reciprocity(const gonio_fit_options *options) {
    return options->symmetry != GONIO_SYMMETRY_AUTO && (options->symmetry & GONIO_SYMMETRY_RECIPROCITY) != 0;
}

// The forms of a round.
typedef struct form_list {
    gonio_smooth_form items[GONIO_AUTO_ROUND_FORMS];
    int n;
    bool overrun; // more were asked for than there is room
} form_list;

static void push(form_list *forms, const gonio_smooth_form *form) {
    if (forms->n < GONIO_AUTO_ROUND_FORMS) {
        forms->items[forms->n++] = *form;
    } else {
        forms->overrun = true;
    }
}

// The coordinates given, or every system but other widths of it; half vectors, which suit most measured materials,
// first.
static void coordinate_forms(const gonio_dataset *data, const gonio_fit_options *options, form_list *forms) {
    const int level = options->level != GONIO_LEVEL_AUTO ? options->level : first_level(data);
    const bool open = options->coordinates == GONIO_COORDINATES_AUTO;
    for (int half_vector = 1; half_vector >= 0; half_vector--) {
        for (gonio_coordinates c = 0; c < GONIO_COORDINATES; c++) {
            const bool wanted = open ? gonio_coordinates_base(c) == c : options->coordinates == c;
            if (wanted && gonio_coordinates_are_half_vector(c) == (half_vector == 1)) {
                gonio_smooth_form form = gonio_smooth_form_default(c, level, data->mirror);
                form.reciprocity = fixed_reciprocity(options);
                push(forms, &form);
            }
        }
    }
}

// Ever stiffer along the difference angle, ever softer across the half vector's plane.
#define LADDER 4
static const double half_ladder[LADDER][4] = {{1, 1, 1, 1}, {1, 1, 10, 10}, {0.1, 0.1, 10, 10}, {0.1, 0.1, 100, 100}};

// Stiffer or softer along the difference angle or the incidence.
static void stiffness_forms(const gonio_dataset *data, const gonio_smooth_form *best, form_list *forms) {
    static const double other[][4] = {{10, 1, 1, 1}, {0.1, 1, 1, 1}};
    const bool half_vector = gonio_coordinates_are_half_vector(best->coordinates);
    for (size_t k = 0; k < sizeof other / sizeof *other && (half_vector || data->dims == 3); k++) {
        gonio_smooth_form form = *best;
        memcpy(form.stretch, half_vector ? half_ladder[1 + k] : other[k], sizeof form.stretch);
        push(forms, &form);
    }
}

static bool was_tried(const gonio_auto_choice *choice, const gonio_smooth_form *form) {
    for (int t = 0; t < choice->trials_n; t++) {
        const gonio_smooth_form *other = &choice->trials[t].form;
        if (other->coordinates == form->coordinates && other->level == form->level &&
            memcmp(other->stretch, form->stretch, sizeof form->stretch) == 0) {
            return true;
        }
    }
    return false;
}

// The ladder's steps beside the chosen one that these coordinates and level have not been on.
static void ladder_forms(const gonio_auto_choice *choice, form_list *forms) {
    const gonio_smooth_form *chosen = &choice->trials[choice->chosen].form;
    int at = 0;
    while (at < LADDER && memcmp(half_ladder[at], chosen->stretch, sizeof chosen->stretch) != 0) {
        at++;
    }
    for (int step = at - 1; step <= at + 1; step += 2) {
        if (gonio_coordinates_are_half_vector(chosen->coordinates) && at < LADDER && step >= 0 && step < LADDER) {
            gonio_smooth_form form = *chosen;
            memcpy(form.stretch, half_ladder[step], sizeof form.stretch);
            if (!was_tried(choice, &form)) {
                push(forms, &form);
            }
        }
    }
}

static void level_forms(const gonio_dataset *data, const gonio_fit_options *options, const gonio_smooth_form *best,
                        form_list *forms) {
    const int most = data->dims == 3 ? GONIO_SMOOTH_DENSE_LEVEL_MAX_3D : GONIO_SMOOTH_DENSE_LEVEL_MAX_4D;
    // Under a limit every coarser level may be the answer.
    const bool limited = options->max_bytes > 0 || options->max_ns > 0 || options->max_error > 0;
    for (int level = limited ? 0 : best->level - 1; level <= best->level + 1; level++) {
        if (level >= 0 && level <= most && level != best->level && options->level == GONIO_LEVEL_AUTO) {
            gonio_smooth_form form = *best;
            form.level = level;
            push(forms, &form);
        }
    }
}

#define CLOSE 0.5 // in the score: errors up to a third larger

// The best trial in these coordinates; NULL where none was made or it is far from the best of all.
static const gonio_smooth_form *best_of(const gonio_auto_choice *choice, gonio_coordinates coordinates) {
    const gonio_auto_trial *best = NULL;
    for (int t = 0; t < choice->trials_n; t++) {
        const gonio_auto_trial *trial = &choice->trials[t];
        if (trial->form.coordinates == coordinates && (best == NULL || trial->score.score < best->score.score)) {
            best = trial;
        }
    }
    const gonio_auto_trial *chosen = &choice->trials[choice->chosen];
    if (chosen->form.coordinates == coordinates) {
        best = chosen; // limits of bytes and time may forbid what scores better
    }
    return best != NULL && best->score.score < chosen->score.score + CLOSE ? &best->form : NULL;
}

// Other widths of the coordinates that are close to the best ones.
static void width_forms(const gonio_fit_options *options, const gonio_auto_choice *choice, form_list *forms) {
    for (gonio_coordinates c = 0; c < GONIO_COORDINATES && options->coordinates == GONIO_COORDINATES_AUTO; c++) {
        const gonio_coordinates base = gonio_coordinates_base(c);
        const gonio_smooth_form *best = base != c ? best_of(choice, base) : NULL;
        if (best != NULL) {
            gonio_smooth_form form = *best;
            form.coordinates = c;
            push(forms, &form);
        }
    }
}

#define ROUNDS 5

static void round_forms(int round, const gonio_dataset *data, const gonio_fit_options *options,
                        const gonio_auto_choice *choice, form_list *forms) {
    if (round == 0) {
        coordinate_forms(data, options, forms);
    } else if (round == 3) {
        width_forms(options, choice, forms);
    } else if (round == 4) {
        ladder_forms(choice, forms);
    }
    for (gonio_coordinates c = 0; c < GONIO_COORDINATES && (round == 1 || round == 2); c++) {
        const gonio_smooth_form *best = best_of(choice, c);
        if (best != NULL && round == 1) {
            stiffness_forms(data, best, forms);
        } else if (best != NULL) {
            level_forms(data, options, best, forms);
        }
    }
}

// Score the chosen solver as it now stands, over one base; *better: it is chosen again. Not over the others: beside a
// profile all bases predict alike what has samples about it, and chance would choose among them, but where nothing has
// been measured lobes go on and a spline does not.
static gonio_status try_again(const gonio_dataset *data, gonio_deadline *watch, gonio_auto_choice *choice,
                              const gonio_smooth_form *form, int base, bool *better, gonio_error *error) {
    const int before = choice->chosen;
    round_result r = {.first = base, .beyond = base + 1};
    score_bases(choice->dense, data, choice, watch->options->lambda, &r);
    gonio_status status = r.status;
    if (status != GONIO_OK && error != NULL) {
        *error = r.error;
    }
    status = status == GONIO_OK ? keep_best(data, watch->options, choice, form, &r, error) : status;
    free(r.lambdas);
    *better = choice->chosen != before;
    return status == GONIO_OK ? gonio_deadline_poll(watch, error) : status;
}

// A profile beside the chosen isotropic half-vector lattice: a fine one, equally smooth in both directions, for sharp
// peaks, and a coarser one, stiff along the difference angle. Each with more and more weight for as long as that is
// better.
static const struct {
    int level;
    double stretch[2], weights[3];
} profiles[] = {{6, {1, 1}, {0.03, 0.3, 3}}, {5, {0.1, 10}, {0.01, 0.1, 1}}};

// Coordinates that lost without a profile may win with one: of a material that is a function of the half vector and the
// difference angle alone, a stiff lattice beside a strong profile knows it. Where other coordinates are ahead, that
// form is compared with them once, over every base. It must gain two standard errors of what n residuals tell: the
// logarithm of their rms is known to sqrt((kurtosis - 1)/(4 n)), which is 1/sqrt(n) at a kurtosis of 5, between a
// normal's 3 and Laplace's 6. (With no such price 100 noisy samples of a Ward lobe were fitted a third worse.)
static gonio_status try_half_vector(const gonio_dataset *data, gonio_deadline *watch, gonio_pool *pool,
                                    gonio_auto_choice *choice, gonio_error *error) {
    const gonio_smooth_form *chosen = &choice->trials[choice->chosen].form;
    const gonio_fit_options *options = watch->options;
    if (data->dims != 3 || options->coordinates != GONIO_COORDINATES_AUTO ||
        gonio_coordinates_are_half_vector(chosen->coordinates)) {
        return GONIO_OK;
    }
    gonio_smooth_form form = gonio_smooth_form_default(GONIO_HALF_VECTOR, chosen->level, data->mirror);
    form.reciprocity = fixed_reciprocity(options);
    memcpy(form.stretch, half_ladder[LADDER - 1], sizeof form.stretch);
    form.profile = profiles[1].weights[2];
    form.profile_level = profiles[1].level;
    memcpy(form.profile_stretch, profiles[1].stretch, sizeof form.profile_stretch);
    choice->entry = 2 / sqrt((double)data->measured);
    const gonio_status status = run_round(data, watch, pool, &form, 1, choice, error);
    choice->entry = 0;
    return status;
}

static gonio_status try_profile(const gonio_dataset *data, gonio_deadline *watch, gonio_auto_choice *choice,
                                gonio_error *error) {
    gonio_smooth_form form = choice->trials[choice->chosen].form;
    gonio_status status = GONIO_OK;
    if (data->dims != 3 || !gonio_coordinates_are_half_vector(form.coordinates)) {
        return GONIO_OK;
    }
    for (int p = 0; p < 2; p++) {
        bool better = true;
        form.profile_level = profiles[p].level;
        memcpy(form.profile_stretch, profiles[p].stretch, sizeof form.profile_stretch);
        for (int k = 0; k < 3 && status == GONIO_OK && better; k++) {
            if (!time_for(watch, choice, &form, 1, choice->longest)) {
                break;
            }
            form.profile = profiles[p].weights[k];
            status = gonio_smooth_dense_profile(choice->dense, &form, error);
            if (status == GONIO_OK) {
                status = try_again(data, watch, choice, &form, choice->trials[choice->chosen].base, &better, error);
            }
        }
    }
    const gonio_smooth_form *chosen = &choice->trials[choice->chosen].form,
                            *now = gonio_smooth_dense_form(choice->dense);
    if (status == GONIO_OK && (chosen->profile != now->profile || chosen->profile_level != now->profile_level)) {
        status = gonio_smooth_dense_profile(choice->dense, chosen, error);
    }
    return status;
}

// Reciprocity of the chosen half-vector fit, from a weak prior to the full constraint: the non-reciprocal part keeps
// 30, 10, 3 and 0 % of its prior variance. The sums over the lattice serve them all; the first that is worse ends it.
static gonio_status try_reciprocity(const gonio_dataset *data, gonio_deadline *watch, gonio_auto_choice *choice,
                                    gonio_error *error) {
    static const double weights[] = {0.7, 0.9, 0.97, 1};
    gonio_smooth_form form = choice->trials[choice->chosen].form;
    if (watch->options->symmetry != GONIO_SYMMETRY_AUTO || !gonio_coordinates_are_half_vector(form.coordinates)) {
        return GONIO_OK;
    }
    gonio_status status = GONIO_OK;
    bool better = true;
    for (int k = 0; k < 4 && status == GONIO_OK && better && time_for(watch, choice, &form, 1, choice->longest); k++) {
        form.reciprocity = weights[k];
        status = gonio_smooth_dense_reciprocity(choice->dense, weights[k], error);
        if (status == GONIO_OK) {
            status = try_again(data, watch, choice, &form, choice->trials[choice->chosen].base, &better, error);
        }
    }
    const double chosen = choice->trials[choice->chosen].form.reciprocity;
    if (status == GONIO_OK && chosen != gonio_smooth_dense_form(choice->dense)->reciprocity) {
        status = gonio_smooth_dense_reciprocity(choice->dense, chosen, error);
    }
    return status;
}

// What the chosen lobes' shares say beside the spline.
static gonio_status try_shares(const gonio_dataset *data, gonio_deadline *watch, gonio_auto_choice *choice,
                               gonio_error *error) {
    const gonio_auto_trial *chosen = &choice->trials[choice->chosen];
    const int base = chosen->base;
    const gonio_lobe_base *lobes = &choice->bases[base].lobes;
    gonio_smooth_form form = chosen->form;
    if (lobes->lobes == 0 || !time_for(watch, choice, &form, 1, choice->longest)) {
        return GONIO_OK;
    }
    bool better = false;
    form.shares = true;
    gonio_status status = gonio_smooth_dense_shares(choice->dense, lobes, error);
    status = status == GONIO_OK ? try_again(data, watch, choice, &form, base, &better, error) : status;
    return status == GONIO_OK && !better ? gonio_smooth_dense_shares(choice->dense, NULL, error) : status;
}

static gonio_status do_round(int round, const gonio_dataset *data, gonio_deadline *watch, gonio_pool *pool,
                             gonio_auto_choice *choice, gonio_error *error) {
    form_list forms;
    forms.n = 0;
    forms.overrun = false;
    round_forms(round, data, watch->options, choice, &forms);
    if (forms.overrun || (round == 0 && forms.n == 0)) {
        return gonio_fail(error, GONIO_E_FAILED, "round %d of the choice has %s forms to compare", round + 1,
                          forms.overrun ? "too many" : "no");
    }
    return run_round(data, watch, pool, forms.items, forms.n, choice, error);
}

gonio_status gonio_auto_choose(const gonio_dataset *data, gonio_deadline *watch, bool lobes, bool terms,
                               gonio_auto_choice *choice, gonio_error *error) {
    static const char *const what[ROUNDS] = {"comparing coordinates", "comparing stiffness", "comparing levels",
                                             "comparing lobe widths", "comparing stiffness"};
    *choice = (gonio_auto_choice){.lambdas = malloc((size_t)data->channels * sizeof(double))};
    gonio_pool *pool = gonio_pool_new(watch->options->threads);
    gonio_status status = choice->lambdas != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory to choose");
    status = status == GONIO_OK ? gonio_deadline_report(watch, 0, "fitting lobes", error) : status;
    status = status == GONIO_OK ? fit_bases(data, pool, lobes, choice, error) : status;
    for (int round = 0; round < ROUNDS && status == GONIO_OK; round++) {
        status = gonio_deadline_report(watch, 0.1 + 0.13 * round, what[round], error);
        status = status == GONIO_OK ? do_round(round, data, watch, pool, choice, error) : status;
    }
    if (status == GONIO_OK && terms) {
        status = gonio_deadline_report(watch, 0.75, "comparing profiles", error);
        status = status == GONIO_OK ? try_half_vector(data, watch, pool, choice, error) : status;
        status = status == GONIO_OK ? try_profile(data, watch, choice, error) : status;
    }
    status = status == GONIO_OK ? gonio_deadline_report(watch, 0.9, "comparing reciprocity", error) : status;
    status = status == GONIO_OK ? try_reciprocity(data, watch, choice, error) : status;
    status = status == GONIO_OK && terms ? try_shares(data, watch, choice, error) : status;
    gonio_pool_free(pool);
    if (status != GONIO_OK) {
        gonio_auto_choice_release(choice);
    }
    return status;
}
