// SPDX-License-Identifier: BSD-3-Clause
// Lobe fits by Levenberg-Marquardt (cminpack) from several starts.
//
// The residual is the difference of transformed values (logarithms above the noise), since a least-squares fit of f_r
// itself sees the peak only; through the soft-L1 loss, sqrt(2 (sqrt(1 + (r/s)^2) - 1)), grazing samples that no lobe
// model describes do not pull. Bounded parameters go through a logistic curve: an unbounded solver can then not leave
// the range where the formulae are finite.
#include "fit/lobes/fit.h"

#include <cminpack.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/order_statistic.h"
#include "base/statistics.h"
#include "brdf/kind/analytic.h"

#define SHAPES (2 * GONIO_LOBES_MAX)
#define PARAMETERS_MAX (SHAPES + 1 + GONIO_LOBES_MAX)
#define LOSS_SCALE 0.3      // a residual of 30 % counts in full, larger ones less and less
#define SAMPLES_MAX 2500    // shapes of seven numbers gain nothing from more
#define START_SAMPLES 300   // tell which start is the best one
#define LN_ALPHA_MIN (-6.2) // ln 0.002: a degree's lobe is 0.017 wide
#define LN_ALPHA_MAX 0.4
#define LN_STRENGTH 46.0 // strengths may lie e^46 = 1e20 below or above the scale

typedef struct problem {
    size_t n;
    int lobes;
    gonio_lobe_family family;
    const gonio_lobe_geometry *geometry; // [n]
    const double *target;                // [n] transformed values
    const double *unit;                  // n x lobes, shapes held fixed; NULL: shapes are parameters
    gonio_transform transform;           // scale 1: y
    double highest;                      // y; the largest sample
    double peak[GONIO_LOBES_MAX];        // with `unit`: of the unit lobes
} problem;

static double logistic(double u) { return 1 / (1 + exp(-u)); }
static double logit(double p) { return log(p / (1 - p)); }

static double alpha_of(double u) { return exp(LN_ALPHA_MIN + (LN_ALPHA_MAX - LN_ALPHA_MIN) * logistic(u)); }
static double alpha_start(double alpha) { return logit((log(alpha) - LN_ALPHA_MIN) / (LN_ALPHA_MAX - LN_ALPHA_MIN)); }
static double strength_of(double u) { return exp(LN_STRENGTH * tanh(u / LN_STRENGTH)); }

static double unit_lobe(gonio_lobe_family family, const gonio_lobe_geometry *g, double alpha, double f0) {
    return family == GONIO_LOBE_GGX ? gonio_lobe_ggx(g, alpha, alpha, f0) : gonio_lobe_cook_torrance(g, alpha, f0);
}

static double soft(double residual) {
    const double r = residual / LOSS_SCALE, s = r * r;
    // sqrt(1 + s) - 1 without cancellation.
    return copysign(sqrt(2 * s / (sqrt(1 + s) + 1)), r);
}

// At normal incidence, into the mirror direction.
static double unit_peak(gonio_lobe_family family, double alpha, double f0) {
    const gonio_lobe_geometry g = gonio_lobe_geometry_of((gonio_vec3){0, 0, 1}, (gonio_vec3){0, 0, 1});
    return unit_lobe(family, &g, alpha, f0);
}

// What is paid for a peak above the highest sample, which no sample holds down: as much as a residual of 30 % at one
// sample for e^3 = 20 times. Lobes between which samples decide pay next to nothing.
static double peak_price(double peak, double highest) { return fmax(log(fmax(peak, 1e-300) / highest), 0) / 3; }

// cminpack's callback: parameters are shapes (unless fixed), then ln strengths.
static int residuals(void *context, int m, int n, const double *x, double *out, int flag) {
    (void)m;
    (void)n;
    (void)flag;
    const problem *p = context;
    const double *strength = p->unit == NULL ? x + 2 * p->lobes : x;
    double alpha[GONIO_LOBES_MAX], f0[GONIO_LOBES_MAX], s[1 + GONIO_LOBES_MAX];
    for (int j = 0; j < p->lobes && p->unit == NULL; j++) {
        alpha[j] = alpha_of(x[2 * j]);
        f0[j] = logistic(x[2 * j + 1]);
    }
    for (int j = 0; j <= p->lobes; j++) {
        s[j] = strength_of(strength[j]);
    }
    for (int j = 0; j < p->lobes; j++) {
        const double unit = p->unit != NULL ? p->peak[j] : unit_peak(p->family, alpha[j], f0[j]);
        out[p->n + (size_t)j] = peak_price(s[1 + j] * unit, p->highest);
    }
    for (int i = 0; i < (int)p->n; i++) {
        double y = s[0];
        for (int j = 0; j < p->lobes; j++) {
            y += s[1 + j] *
                 (p->unit != NULL ? p->unit[i * p->lobes + j] : unit_lobe(p->family, &p->geometry[i], alpha[j], f0[j]));
        }
        const double d = gonio_transform_apply(GONIO_TRANSFORM_POSITIVE, &p->transform, y) - p->target[i];
        out[i] = isfinite(d) ? soft(d) : 1e3;
    }
    return 0;
}

// Half the sum of squares after at most `evaluations`; INFINITY where it failed.
static double minimise(const problem *p, int n, double *x, int evaluations, double *work, int *pivots) {
    const int m = (int)p->n + p->lobes;
    double *fvec = work, *diagonal = fvec + m, *jacobian = diagonal + n, *qtf = jacobian + (ptrdiff_t)m * n;
    double *scratch = qtf + n;
    int calls = 0;
    const int info =
        lmdif(residuals, (void *)(uintptr_t)p, m, n, x, fvec, 1e-8, 1e-8, 0, evaluations, 1e-10, diagonal, 1, 10, 0,
              &calls, jacobian, m, pivots, qtf, scratch, scratch + n, scratch + 2 * n, scratch + 3 * n);
    double sum = 0;
    for (int i = 0; i < m; i++) {
        sum += fvec[i] * fvec[i] / 2;
    }
    return info >= 1 && info <= 8 && isfinite(sum) ? sum : INFINITY;
}

static size_t work_size(size_t m, size_t n) { return (m + GONIO_LOBES_MAX) * (n + 2) + 6 * n + 16; }

// Where starts come from: a typical dark value, and the one that only a hundredth of the samples exceed.
typedef struct level {
    double low, high;
} level;

static level levels_of(size_t n, const double *y, double *sorted) {
    memcpy(sorted, y, n * sizeof *sorted);
    gonio_sort(sorted, n);
    const double low = fmax(sorted[n / 4], 0), high = fmax(sorted[n - 1 - n / 100], 0);
    return (level){fmax(low, 1e-6 * high + 1e-12), fmax(high, 1e-9)};
}

// The 99th percentile of a lobe of these shapes.
static double reach(const problem *p, double alpha, double f0, double *sorted) {
    for (size_t i = 0; i < p->n; i++) {
        sorted[i] = unit_lobe(p->family, &p->geometry[i], alpha, f0);
    }
    return fmax(gonio_order_statistic(sorted, p->n, p->n - 1 - p->n / 100), 1e-9);
}

static const double start_alpha[][GONIO_LOBES_MAX] = {
    {0.05, 0.3}, {0.15, 0.5}, {0.02, 0.15}, {0.3, 0.7}, {0.1, 0.12}, {0.008, 0.08},
};
#define STARTS (sizeof start_alpha / sizeof start_alpha[0])

static void set_start(const problem *p, size_t start, const level *y, double *x, double *work) {
    for (int j = 0; j < p->lobes; j++) {
        const double alpha = start_alpha[start][p->lobes == 1 ? (int)(start % 2) : j], f0 = 0.05;
        x[2 * j] = alpha_start(alpha);
        x[2 * j + 1] = logit(f0);
        x[2 * p->lobes + 1 + j] = log((j == 0 ? 1 : 0.3) * y->high / reach(p, alpha, f0, work));
    }
    x[2 * p->lobes] = log(y->low);
}

// Every few of the samples, as many as the starts are told apart by; false: no memory. The caller frees both arrays.
static bool thin(const problem *p, problem *few, gonio_lobe_geometry **geometry, double **target) {
    const size_t step = 1 + (p->n - 1) / START_SAMPLES;
    *few = *p;
    few->n = (p->n + step - 1) / step;
    *geometry = malloc(few->n * sizeof **geometry);
    *target = malloc(few->n * sizeof **target);
    for (size_t i = 0; i < few->n && *geometry != NULL && *target != NULL; i++) {
        (*geometry)[i] = p->geometry[i * step];
        (*target)[i] = p->target[i * step];
    }
    few->geometry = *geometry;
    few->target = *target;
    return *geometry != NULL && *target != NULL;
}

// The best of all starts on some of the samples; x: the parameters. INFINITY: none leads anywhere.
static double try_starts(const problem *p, const level *levels, double *x, double *work, int *pivots) {
    const int n = 3 * p->lobes + 1;
    double best = INFINITY;
    for (size_t start = 0; start < STARTS; start++) {
        double trial[PARAMETERS_MAX];
        set_start(p, start, levels, trial, work);
        const double cost = minimise(p, n, trial, 30 * (n + 1), work, pivots);
        if (cost < best) {
            best = cost;
            memcpy(x, trial, (size_t)n * sizeof *x);
        }
    }
    return best;
}

// x: the parameters, from the best start on; known: they are near where they began.
static gonio_status fit_shapes(const problem *p, const double *y, bool known, double *x, gonio_error *error) {
    const int n = 3 * p->lobes + 1;
    double *work = malloc(work_size(p->n, (size_t)n) * sizeof *work), *target, best = 0;
    int pivots[PARAMETERS_MAX];
    problem few;
    gonio_lobe_geometry *geometry;
    const bool memory = thin(p, &few, &geometry, &target) && work != NULL;
    if (memory && !known) {
        const level levels = levels_of(p->n, y, work);
        best = try_starts(&few, &levels, x, work, pivots);
    }
    if (memory && isfinite(best)) {
        minimise(p, n, x, 100 * (n + 1), work, pivots);
    }
    free(work);
    free(target);
    free(geometry);
    if (!memory) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to fit lobes to %zu samples", p->n);
    }
    return isfinite(best) ? GONIO_OK
                          : gonio_fail(error, GONIO_E_CONVERGENCE, "no start of the lobe fit leads to a solution");
}

// ---- the data's means, the channels' strengths ----

typedef struct workspace {
    size_t n;    // samples used
    size_t step; // every step-th geometry
    gonio_lobe_geometry *geometry;
    double *mean;   // [n] mean over channels of f_r / scale
    double *target; // [n]
    double *unit;   // n x lobes
    double *work;   // for the strengths' fits
    double scale;
} workspace;

static void workspace_release(workspace *w) {
    free(w->geometry);
    free(w->mean);
    free(w->target);
    free(w->unit);
    free(w->work);
}

static gonio_status workspace_init(workspace *w, const gonio_dataset *data, gonio_error *error) {
    *w = (workspace){.step = 1 + (data->n - 1) / SAMPLES_MAX};
    w->n = (data->n + w->step - 1) / w->step;
    w->geometry = malloc(w->n * sizeof *w->geometry);
    w->mean = calloc(w->n, sizeof *w->mean);
    w->target = malloc(w->n * sizeof *w->target);
    w->unit = malloc(w->n * GONIO_LOBES_MAX * sizeof *w->unit);
    w->work = malloc(work_size(w->n, PARAMETERS_MAX) * sizeof *w->work);
    if (w->geometry == NULL || w->mean == NULL || w->target == NULL || w->unit == NULL || w->work == NULL) {
        workspace_release(w);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to fit lobes to %zu samples", w->n);
    }
    const size_t c = (size_t)data->channels;
    for (size_t k = 0; k < c; k++) {
        w->scale = fmax(w->scale, data->transforms[k].scale);
    }
    for (size_t i = 0; i < w->n; i++) {
        const gonio_pair *p = &data->pairs[i * w->step];
        w->geometry[i] =
            gonio_lobe_geometry_of(gonio_direction(p->theta_i, p->phi_i), gonio_direction(p->theta_o, p->phi_o));
        for (size_t k = 0; k < c; k++) {
            w->mean[i] += data->values[i * w->step * c + k] / w->scale / (double)c;
        }
    }
    return GONIO_OK;
}

static double mean_eps(const gonio_dataset *data, double scale) {
    double sum = 0;
    for (int c = 0; c < data->channels; c++) {
        sum += data->transforms[c].eps * (data->transforms[c].scale / scale) / data->channels;
    }
    return sum;
}

static void fit_channel(const gonio_dataset *data, const workspace *w, problem *p, size_t channel, const double *start,
                        double *strength) {
    const size_t c = (size_t)data->channels;
    const double share = data->transforms[channel].scale / w->scale;
    p->transform = (gonio_transform){1, data->transforms[channel].eps * share};
    double *target = w->target, brightness = 0, mean = 0;
    for (size_t i = 0; i < w->n; i++) {
        const double y = data->values[i * w->step * c + channel] / w->scale;
        target[i] = gonio_transform_apply(GONIO_TRANSFORM_POSITIVE, &p->transform, y);
        brightness += target[i];
        mean += gonio_transform_apply(GONIO_TRANSFORM_POSITIVE, &p->transform, w->mean[i]);
    }
    p->target = target;
    p->highest = 0;
    for (size_t i = 0; i < w->n; i++) {
        p->highest = fmax(p->highest, data->values[i * w->step * c + channel] / w->scale);
    }
    p->highest = fmax(p->highest, p->transform.eps);
    double x[1 + GONIO_LOBES_MAX];
    int pivots[1 + GONIO_LOBES_MAX];
    memcpy(x, start, (size_t)(1 + p->lobes) * sizeof *x);
    x[0] += (brightness - mean) / (double)w->n; // the diffuse term bears the colour
    if (!isfinite(minimise(p, 1 + p->lobes, x, 400, w->work, pivots))) {
        memcpy(x, start, (size_t)(1 + p->lobes) * sizeof *x);
    }
    for (int j = 0; j < 1 + GONIO_LOBES_MAX; j++) {
        strength[j] = j <= p->lobes ? strength_of(x[j]) * w->scale : 0;
    }
}

static void fit_strengths(const gonio_dataset *data, const workspace *w, problem *p, const double *x,
                          gonio_lobe_base *base) {
    for (int j = 0; j < p->lobes; j++) {
        base->alpha[j] = alpha_of(x[2 * j]);
        base->f0[j] = logistic(x[2 * j + 1]);
    }
    for (size_t i = 0; i < w->n; i++) {
        for (int j = 0; j < p->lobes; j++) {
            w->unit[i * (size_t)p->lobes + (size_t)j] =
                unit_lobe(p->family, &w->geometry[i], base->alpha[j], base->f0[j]);
        }
    }
    for (int j = 0; j < p->lobes; j++) {
        p->peak[j] = unit_peak(p->family, base->alpha[j], base->f0[j]);
    }
    p->unit = w->unit;
    for (size_t k = 0; k < (size_t)data->channels; k++) {
        fit_channel(data, w, p, k, x + 2 * p->lobes, base->strength + k * (1 + GONIO_LOBES_MAX));
    }
}

float gonio_lobe_cosine_min(const gonio_dataset *data) {
    double theta = 0;
    for (size_t i = 0; i < data->n; i++) {
        theta = fmax(theta, fmax(data->pairs[i].theta_i, data->pairs[i].theta_o));
    }
    return (float)cos(fmin(theta, 1.57)); // 89.95 deg
}

// Of the mean over channels.
static void set_targets(problem *p, const workspace *w) {
    p->highest = p->transform.eps;
    for (size_t i = 0; i < w->n; i++) {
        p->highest = fmax(p->highest, w->mean[i]);
        w->target[i] = gonio_transform_apply(GONIO_TRANSFORM_POSITIVE, &p->transform, w->mean[i]);
    }
}

// The parameters of a base that was fitted before, its strengths in units of `scale`.
static void set_known(const gonio_lobe_base *near, int channels, double scale, double *x) {
    double mean[1 + GONIO_LOBES_MAX];
    gonio_lobe_mean_strengths(near, channels, mean);
    for (int j = 0; j < near->lobes; j++) {
        const double ln = fmin(fmax(log(near->alpha[j]), LN_ALPHA_MIN + 1e-6), LN_ALPHA_MAX - 1e-6);
        x[2 * j] = alpha_start(exp(ln));
        x[2 * j + 1] = logit(fmin(fmax(near->f0[j], 1e-9), 1 - 1e-9));
    }
    for (int j = 0; j <= near->lobes; j++) {
        x[2 * near->lobes + j] = log(fmax(mean[j] / scale, exp(-LN_STRENGTH / 2)));
    }
}

gonio_status gonio_lobe_fit(const gonio_dataset *data, gonio_lobe_family family, int lobes, const gonio_lobe_base *near,
                            gonio_lobe_base *base, gonio_error *error) {
    *base = (gonio_lobe_base){.lobes = lobes, .family = family};
    if (data->kind == GONIO_TRANSFORM_ASINH) {
        return gonio_fail(error, GONIO_E_INPUT, "lobes cannot describe a signed quantity");
    }
    if (data->n < (size_t)(3 * lobes + 1)) {
        return gonio_fail(error, GONIO_E_INPUT, "%zu geometries; %d lobes need at least %d", data->n, lobes,
                          3 * lobes + 1);
    }
    base->cosine_min = gonio_lobe_cosine_min(data);
    workspace w;
    gonio_status status = workspace_init(&w, data, error);
    if (status != GONIO_OK) {
        return status;
    }
    problem p = {.n = w.n,
                 .lobes = lobes,
                 .family = family,
                 .geometry = w.geometry,
                 .target = w.target,
                 .transform = {1, mean_eps(data, w.scale)}};
    set_targets(&p, &w);
    double x[PARAMETERS_MAX];
    base->strength = calloc((size_t)data->channels * (1 + GONIO_LOBES_MAX), sizeof *base->strength);
    if (near != NULL) {
        set_known(near, data->channels, w.scale, x);
    }
    status = base->strength != NULL ? fit_shapes(&p, w.mean, near != NULL, x, error)
                                    : gonio_fail(error, GONIO_E_MEMORY, "no memory for lobes");
    if (status == GONIO_OK) {
        fit_strengths(data, &w, &p, x, base);
    } else {
        free(base->strength);
        base->strength = NULL;
    }
    workspace_release(&w);
    return status;
}

void gonio_lobe_targets(const gonio_lobe_base *base, const gonio_dataset *data, double *targets) {
    const size_t c = (size_t)data->channels;
    for (size_t i = 0; i < data->n; i++) {
        const gonio_pair *p = &data->pairs[i];
        double unit[1 + GONIO_LOBES_MAX] = {0};
        gonio_lobe_base_units(base, gonio_direction(p->theta_i, p->phi_i), gonio_direction(p->theta_o, p->phi_o), unit);
        for (size_t k = 0; k < c; k++) {
            const double *strength = base->lobes > 0 ? base->strength + k * (1 + GONIO_LOBES_MAX) : NULL;
            targets[i * c + k] = gonio_lobe_base_transformed(base, strength, unit, data->kind, &data->transforms[k]);
        }
    }
}
