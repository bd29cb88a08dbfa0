// SPDX-License-Identifier: BSD-3-Clause
// Which poses to measure for a scene: the next one is where the expected variance of the pictures falls most a second.
//
// ln f_r deviates from what is expected of a material by a Gaussian process (fit/prior/kernel.h): half of its variance
// over the prior's lengths, the rest over a third and a ninth of them, as what few samples tell of a lobe's foot is
// told more finely by more. The variance of the pictures is the sum of squares_t v_t over what is asked for, v_t the
// process' variance there. Measuring a pose c takes cov(t, c)^2 / (v_c + noise) of each v_t (Seo et al., "Gaussian
// process regression: active data selection and test point rejection", 2000); the process is then conditioned on it,
// and so on. A fit so far scales the deviations down to its own sigma, or support.
//
// Travel counts as what a pose costs on the way from the nearest one that was chosen: a tour visits neighbours.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "base/statistics.h"
#include "base/thread_pool.h"
#include "fit/needs/needs.h"
#include "fit/prior/kernel.h"
#include "gonio/library.h"

#define POINTS_MIN 600
#define POINTS_MAX 1600
#define NOISE 1e-3 // variance of a sample's noise over that of the deviation: 1 % over 30 %
#define SCALES 3
static const double scale[SCALES] = {1, 1.0 / 3, 1.0 / 9}, share[SCALES] = {0.5, 0.3, 0.2};

typedef struct design {
    const gonio_needs *needs;
    const gonio_needs_plan_options *options;
    bool isotropic;
    gonio_prior_kernel kernel;
    size_t n; // points: where pictures ask, and where poses may be
    gonio_pair *pairs;
    double *x;                           // n x 4
    double *norm;                        // n x SCALES
    double *squares, *deviation, *value; // [n]
    double *gain, *travel;               // [n]
    bool *barred;                        // out of reach, or taken
    float *covariance;                   // n x n
    size_t chosen;
    double chosen_variance;
    float *column;         // [n]: of the chosen one
    double spread_seconds; // that a pose which is spread out is taken to need: as the last one
} design;

void gonio_needs_plan_options_default(gonio_needs_plan_options *options) {
    *options = (gonio_needs_plan_options){.poses = 400, .explore = 0.1, .theta_max_deg = 85, .seed = 1};
}

// ---- points ----

// Half of the points by their squares, half by the squares' roots, along the cells' order, which keeps neighbours
// together: a systematic sample. Each stands for the squares of its stretch.
static void choose_points(design *d, const gonio_need *cells, size_t count) {
    double total[2] = {0}, at[2] = {0};
    for (size_t i = 0; i < count; i++) {
        total[0] += cells[i].squares;
        total[1] += sqrt(cells[i].squares);
    }
    size_t n = 0;
    double waiting = 0;
    for (size_t i = 0; i < count && n < d->n; i++) {
        const double by = 0.5 * cells[i].squares / total[0] + 0.5 * sqrt(cells[i].squares) / total[1];
        const double before = floor(at[0] * (double)d->n);
        at[0] += by;
        waiting += cells[i].squares;
        if (floor(at[0] * (double)d->n) > before || (i == count - 1 && n == 0)) {
            d->pairs[n] = gonio_pair_from_vectors(cells[i].wi, cells[i].wo);
            d->value[n] = cells[i].value;
            d->squares[n++] = waiting;
            waiting = 0;
        }
    }
    d->squares[n - 1] += waiting;
    d->n = n;
}

static double deviation_of(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo) {
    double sigma[model->channels], values[model->channels], sum = 0, f = 0;
    if (gonio_model_sigma(model, wi, wo, sigma)) {
        gonio_model_eval(model, wi, wo, values);
        for (int c = 0; c < model->channels; c++) {
            sum += sigma[c];
            f += fmax(values[c], 0);
        }
        // In the unit of the deviations that NOISE has: 30 %.
        return f > 0 ? fmin(sum / f / 0.3, 10) : 1;
    }
    const double support = gonio_model_support(model, wi, wo);
    return isfinite(support) ? sqrt(fmax(1 - support, 0)) : 1;
}

// Deviations grow with what stands out: how high and wide a lobe is, is known less than the darker rest is. That is
// 1 + ln of the value over the points' median.
static gonio_status expect(design *d, gonio_error *error) {
    double *values = malloc((d->n + 1) * sizeof *values);
    if (values == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to plan among %zu points", d->n);
    }
    memcpy(values, d->value, d->n * sizeof *values);
    const double middle = gonio_upper_median(values, d->n);
    for (size_t i = 0; i < d->n; i++) {
        d->deviation[i] = 1 + (middle > 0 ? fmax(log(d->value[i] / middle), 0) : 0);
    }
    free(values);
    return GONIO_OK;
}

static void fill_points(design *d) {
    const double limit = gonio_radians(d->options->theta_max_deg) + 1e-12;
    for (size_t i = 0; i < d->n; i++) {
        const gonio_pair *p = &d->pairs[i];
        gonio_prior_kernel_place(&d->kernel, p, d->x + 4 * i);
        for (int s = 0; s < SCALES; s++) {
            d->norm[SCALES * i + (size_t)s] =
                1 / sqrt(gonio_prior_kernel_covariance(&d->kernel, d->x + 4 * i, d->x + 4 * i, scale[s]));
        }
        d->barred[i] = p->theta_i > limit || p->theta_o > limit;
        d->travel[i] = INFINITY;
        if (d->options->model != NULL) {
            d->deviation[i] = deviation_of(d->options->model, gonio_direction(p->theta_i, p->phi_i),
                                           gonio_direction(p->theta_o, p->phi_o));
        }
    }
}

// ---- the process ----

static double gain_of(const design *d, const float *row) {
    enum { LANES = 8 };
    double sums[LANES] = {0}, sum = 0;
    for (size_t t = 0; t + LANES <= d->n; t += LANES) {
        for (size_t k = 0; k < LANES; k++) {
            sums[k] += d->squares[t + k] * (double)row[t + k] * (double)row[t + k];
        }
    }
    for (size_t t = d->n - d->n % LANES; t < d->n; t++) {
        sum += d->squares[t] * (double)row[t] * (double)row[t];
    }
    for (int k = 0; k < LANES; k++) {
        sum += sums[k];
    }
    return sum;
}

static void fill_row(void *context, size_t i) {
    design *d = context;
    float *row = d->covariance + i * d->n;
    for (size_t j = 0; j < d->n; j++) {
        double sum = 0;
        for (int s = 0; s < SCALES; s++) {
            sum += share[s] * d->norm[SCALES * i + (size_t)s] * d->norm[SCALES * j + (size_t)s] *
                   gonio_prior_kernel_covariance(&d->kernel, d->x + 4 * i, d->x + 4 * j, scale[s]);
        }
        row[j] = (float)(sum * d->deviation[i] * d->deviation[j]);
    }
    d->gain[i] = gain_of(d, row) / ((double)row[i] + NOISE);
}

// Given the chosen one.
static void condition_row(void *context, size_t i) {
    design *d = context;
    float *row = d->covariance + i * d->n;
    const float by = (float)((double)d->column[i] / d->chosen_variance);
    for (size_t j = 0; j < d->n; j++) {
        row[j] -= by * d->column[j];
    }
    d->gain[i] = gain_of(d, row) / (fmax((double)row[i], 0) + NOISE);
}

static double variance_of(const design *d) {
    double sum = 0;
    for (size_t i = 0; i < d->n; i++) {
        sum += d->squares[i] * fmax((double)d->covariance[i * (d->n + 1)], 0);
    }
    return sum;
}

static double seconds_of(const design *d, size_t i) {
    const gonio_needs_plan_options *o = d->options;
    return o->seconds == NULL ? 1
                              : o->seconds(o->seconds_context, NULL, &d->pairs[i], d->value[i]) +
                                    (isfinite(d->travel[i]) ? d->travel[i] : 0);
}

// The point that is worth most; d->n: none is left.
static size_t choose_next(const design *d) {
    size_t best = d->n;
    double most = 0;
    for (size_t i = 0; i < d->n; i++) {
        const double worth = d->barred[i] ? 0 : d->gain[i] / seconds_of(d, i);
        if (worth > most) {
            most = worth;
            best = i;
        }
    }
    return best;
}

static void take(design *d, gonio_pool *pool, size_t chosen) {
    const gonio_needs_plan_options *o = d->options;
    d->chosen = chosen;
    d->barred[chosen] = true;
    memcpy(d->column, d->covariance + chosen * d->n, d->n * sizeof *d->column);
    d->chosen_variance = fmax((double)d->column[chosen], 0) + NOISE;
    gonio_pool_run(pool, d->n, condition_row, d);
    for (size_t i = 0; i < d->n && o->seconds != NULL; i++) {
        if (!d->barred[i]) {
            const double still = o->seconds(o->seconds_context, NULL, &d->pairs[i], d->value[i]);
            d->travel[i] = fmin(d->travel[i],
                                o->seconds(o->seconds_context, &d->pairs[chosen], &d->pairs[i], d->value[i]) - still);
        }
    }
}

// ---- the plan ----

static double tidy_rad(double rad) { return gonio_radians(round(gonio_degrees(rad) * 1e4) / 1e4); }

static gonio_status design_init(design *d, size_t count, gonio_error *error) {
    const size_t wanted = 3 * d->options->poses;
    d->n = wanted < POINTS_MIN ? POINTS_MIN : wanted > POINTS_MAX ? POINTS_MAX : wanted;
    d->n = d->n < count ? d->n : count;
    d->pairs = calloc(d->n + 1, sizeof *d->pairs);
    d->x = calloc(4 * d->n + 1, sizeof *d->x);
    d->norm = calloc(SCALES * d->n + 1, sizeof *d->norm);
    d->squares = calloc(5 * (d->n + 1), sizeof *d->squares);
    d->barred = calloc(d->n + 1, sizeof *d->barred);
    d->column = calloc(d->n + 1, sizeof *d->column);
    d->covariance = calloc(d->n * d->n + 1, sizeof *d->covariance);
    if (d->pairs == NULL || d->x == NULL || d->norm == NULL || d->squares == NULL || d->barred == NULL ||
        d->column == NULL || d->covariance == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to plan among %zu points", d->n);
    }
    d->deviation = d->squares + d->n + 1;
    d->value = d->deviation + d->n + 1;
    d->gain = d->value + d->n + 1;
    d->travel = d->gain + d->n + 1;
    return GONIO_OK;
}

static void design_release(design *d) {
    free(d->pairs);
    free(d->x);
    free(d->norm);
    free(d->squares);
    free(d->barred);
    free(d->column);
    free(d->covariance);
}

// Every so often, by its share, a pose of the spread; where no point is left, the spread's too.
static void choose_all(design *d, const gonio_plan *spread, gonio_plan *plan) {
    gonio_pool *pool = gonio_pool_new(d->options->threads);
    size_t explored = 0;
    double seconds = 0;
    gonio_pool_run(pool, d->n, fill_row, d);
    while (plan->n < d->options->poses) {
        const bool explores = floor(d->options->explore * (double)(plan->n + 1)) > (double)explored;
        const size_t next = explores ? d->n : choose_next(d);
        const gonio_pair *p = next == d->n ? &spread->poses[explored++] : &d->pairs[next];
        seconds += next == d->n ? d->spread_seconds : seconds_of(d, next);
        if (d->options->seconds_max > 0 && seconds > d->options->seconds_max) {
            break;
        }
        plan->poses[plan->n++] =
            (gonio_pair){tidy_rad(p->theta_i), tidy_rad(p->phi_i), tidy_rad(p->theta_o), tidy_rad(p->phi_o)};
        if (next < d->n) {
            d->spread_seconds = seconds_of(d, next); // about
            take(d, pool, next);
        }
    }
    gonio_pool_free(pool);
}

static gonio_status make_plan(design *d, size_t count, const gonio_need *cells, gonio_plan **out,
                              gonio_needs_plan_report *report, gonio_error *error) {
    const gonio_needs_plan_options *o = d->options;
    gonio_plan *spread = NULL;
    char text[100];
    // Its poses are the room for the plan too.
    gonio_number_format(text, sizeof text, "nusselt:%zu,theta_max=%g%s", o->poses, o->theta_max_deg,
                        d->isotropic ? "" : ",anisotropic=1");
    gonio_status status = design_init(d, count, error);
    status = status == GONIO_OK ? gonio_plan_make(text, o->seed, &spread, error) : status;
    status = status == GONIO_OK ? gonio_plan_make(text, o->seed, out, error) : status;
    if (status == GONIO_OK) {
        choose_points(d, cells, count);
        status = expect(d, error);
    }
    if (status == GONIO_OK) {
        fill_points(d);
        (*out)->n = 0;
        for (size_t i = 0; i < d->n; i++) {
            report->before += d->squares[i] * d->deviation[i] * d->deviation[i];
        }
        choose_all(d, spread, *out);
        report->after = variance_of(d);
    }
    gonio_plan_free(spread);
    return status;
}

gonio_status gonio_needs_plan(const gonio_needs *needs, int material, const gonio_needs_plan_options *options,
                              gonio_plan **out, gonio_needs_plan_report *report, gonio_error *error) {
    gonio_needs_facts facts;
    gonio_needs_plan_report own;
    gonio_needs_describe(needs, material, &facts);
    report = report != NULL ? report : &own;
    *report = (gonio_needs_plan_report){0};
    *out = NULL;
    if (!(options->explore >= 0 && options->explore <= 1) || options->poses < 1 || options->poses > 100000) {
        return gonio_fail(error, GONIO_E_USAGE,
                          "a plan of %zu poses, a share of %g of them spread out; 1 to 100000 poses, 0 to 1",
                          options->poses, options->explore);
    }
    if (facts.cells == 0) {
        return gonio_fail(error, GONIO_E_USAGE, "no pixel sees material '%s' in front of its surface", facts.name);
    }
    design d = {.needs = needs, .options = options, .isotropic = facts.isotropic};
    gonio_prior_kernel_start(&d.kernel, facts.isotropic ? 3 : 4, facts.isotropic);
    const gonio_status status = make_plan(&d, facts.cells, gonio_needs_cells(needs, material), out, report, error);
    design_release(&d);
    if (status != GONIO_OK) {
        gonio_plan_free(*out);
        *out = NULL;
    }
    return status;
}

// ---- text ----

typedef struct wish {
    gonio_needs_plan_options options;
    const char *needs, *material, *model;
} wish;

static gonio_status parse(char *text, wish *w, gonio_error *error) {
    char *rest;
    w->needs = strtok_r(text, ",", &rest);
    for (char *item = strtok_r(NULL, ",", &rest); item != NULL; item = strtok_r(NULL, ",", &rest)) {
        char *value = strchr(item, '='), *end = NULL;
        const double number = value != NULL ? gonio_number_parse(value + 1, &end) : NAN;
        const bool good = value != NULL && end != value + 1 && *end == 0;
        if (strncmp(item, "material=", 9) == 0) {
            w->material = value + 1;
        } else if (strncmp(item, "model=", 6) == 0) {
            w->model = value + 1;
        } else if (strncmp(item, "N=", 2) == 0 && good && number >= 1 && number <= 1e5 && number == floor(number)) {
            w->options.poses = (size_t)number;
        } else if (strncmp(item, "seconds=", 8) == 0 && good && number > 0) {
            w->options.seconds_max = number;
        } else if (strncmp(item, "explore=", 8) == 0 && good && number >= 0 && number <= 1) {
            w->options.explore = number;
        } else if (strncmp(item, "theta_max=", 10) == 0 && good && number > 0 && number <= 90) {
            w->options.theta_max_deg = number;
        } else {
            return gonio_fail(error, GONIO_E_USAGE,
                              "scene:%s: '%s'; expected N=1 to 100000, material=NAME, model=MODEL, explore=0 to 1, "
                              "theta_max=DEG or seconds=S",
                              w->needs, item);
        }
    }
    return w->needs != NULL ? GONIO_OK
                            : gonio_fail(error, GONIO_E_USAGE, "expected scene:NEEDS, a file of gonio scene needs");
}

static gonio_status plan_scene(const char *text, uint64_t seed, gonio_pose_seconds *seconds, void *context,
                               gonio_plan **out, gonio_needs_plan_report *report, gonio_error *error) {
    wish w = {.needs = NULL};
    gonio_needs *needs = NULL;
    gonio_model *model = NULL;
    int material = 0;
    char *copy = strdup(text);
    if (copy == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a plan");
    }
    gonio_needs_plan_options_default(&w.options);
    w.options.seed = seed;
    w.options.seconds = seconds;
    w.options.seconds_context = context;
    gonio_status status = parse(copy, &w, error);
    status = status == GONIO_OK ? gonio_needs_open(w.needs, &needs, error) : status;
    status = status == GONIO_OK ? gonio_needs_material(needs, w.material, &material, error) : status;
    status = status == GONIO_OK && w.model != NULL ? gonio_model_resolve(w.model, &model, error) : status;
    w.options.model = model;
    status = status == GONIO_OK ? gonio_needs_plan(needs, material, &w.options, out, report, error) : status;
    gonio_model_free(model);
    gonio_needs_free(needs);
    free(copy);
    return status;
}

gonio_status gonio_plan_resolve(const char *text, uint64_t seed, gonio_pose_seconds *seconds, void *seconds_context,
                                gonio_plan **out, gonio_needs_plan_report *report, gonio_error *error) {
    gonio_needs_plan_report own;
    report = report != NULL ? report : &own;
    *report = (gonio_needs_plan_report){0};
    *out = NULL;
    if (gonio_library_plan_is(text)) {
        return gonio_library_plan_make(text, seed, 0, out, error);
    }
    return strncmp(text, "scene:", 6) == 0 ? plan_scene(text + 6, seed, seconds, seconds_context, out, report, error)
                                           : gonio_plan_make(text, seed, out, error);
}
