// SPDX-License-Identifier: BSD-3-Clause
// What the fill poses of an adaptive plan say of the models that had not seen them.
#include <math.h>
#include <stdlib.h>

#include "base/statistics.h"
#include "host/acquire/adaptive.h"

// The figures are of the last batches that have this many fill poses together: their median's standard error is then
// about a fifth.
#define HELD_OUT_MIN 24
#define UNTIL_MIN 12    // fewer do not end a measure
#define POINTS_MIN 4    // fill poses of a batch that are a point of the power law
#define SHARE_MAX 0.9   // something is left to the model in any case
#define RESIDUALS_MIN 6 // fewer say nothing about sigma

static bool is_held_out(const gonio_adaptive *a, size_t i, bool mirror) {
    const gonio_adaptive_pose *p = &a->poses[i];
    return p->sample >= 0 && p->batch > 0 && isfinite(p->predicted[0]) &&
           (p->why == GONIO_ADAPTIVE_FILL || (mirror && p->why == GONIO_ADAPTIVE_MIRROR));
}

// Errors on the fill poses of batches first to last.
static gonio_status errors_of(const gonio_adaptive *a, size_t first, size_t last, gonio_errors *out,
                              gonio_error *error) {
    const size_t channels = (size_t)a->samples->channels;
    double *predicted = calloc(a->samples->n * channels + 1, sizeof *predicted);
    bool *which = calloc(a->samples->n + 1, sizeof *which);
    gonio_status status = GONIO_OK;
    if (predicted == NULL || which == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for the errors of %zu samples", a->samples->n);
    } else {
        for (size_t i = 0; i < a->n; i++) {
            const gonio_adaptive_pose *p = &a->poses[i];
            if (is_held_out(a, i, false) && p->batch >= first && p->batch <= last) {
                which[p->sample] = true;
                for (size_t c = 0; c < channels; c++) {
                    predicted[(size_t)p->sample * channels + c] = p->predicted[c];
                }
            }
        }
        status = gonio_errors_of(a->samples, predicted, which, out, error);
    }
    free(predicted);
    free(which);
    return status;
}

static size_t held_out_of(const gonio_adaptive *a, size_t batch) {
    size_t n = 0;
    for (size_t i = 0; i < a->n; i++) {
        n += a->poses[i].batch == batch && is_held_out(a, i, false);
    }
    return n;
}

static size_t poses_before(const gonio_adaptive *a, size_t batch) {
    size_t n = 0;
    for (size_t i = 0; i < a->n; i++) {
        n += a->poses[i].batch < batch;
    }
    return n;
}

typedef struct line {
    double w, x, y, xx, xy;
} line;

static void add(line *l, double weight, double x, double y) {
    l->w += weight;
    l->x += weight * x;
    l->y += weight * y;
    l->xx += weight * x * x;
    l->xy += weight * x * y;
}

// ln error = ln scale - power ln poses; NaN where there are no two numbers of poses.
static void solve(const line *l, double *scale, double *power) {
    const double spread = l->w * l->xx - l->x * l->x;
    const bool known = l->w > 0 && spread > 1e-9 * l->w * l->xx;
    const double slope = known ? (l->w * l->xy - l->x * l->y) / spread : NAN;
    *power = fmax(-slope, 0);
    *power = known ? *power : NAN;
    *scale = known ? exp((l->y + *power * l->x) / l->w) : NAN;
}

// The power laws over the batches, each weighing by its fill poses.
static gonio_status fit_laws(const gonio_adaptive *a, gonio_adaptive_report *report, gonio_error *error) {
    line relative = {0}, logarithmic = {0};
    gonio_status status = GONIO_OK;
    for (size_t b = 1; b < a->batches && status == GONIO_OK; b++) {
        const size_t held = held_out_of(a, b);
        gonio_errors e;
        if (held < POINTS_MIN) {
            continue;
        }
        status = errors_of(a, b, b, &e, error);
        if (status == GONIO_OK && e.median_rel > 0 && e.rms_log > 0) {
            const double x = log((double)poses_before(a, b));
            add(&relative, (double)held, x, log(e.median_rel));
            add(&logarithmic, (double)held, x, log(e.rms_log));
        }
    }
    solve(&relative, &report->median_rel_scale, &report->median_rel_power);
    solve(&logarithmic, &report->rms_log_scale, &report->rms_log_power);
    return status;
}

gonio_status gonio_adaptive_figures(const gonio_adaptive *a, gonio_adaptive_report *report, gonio_error *error) {
    *report = (gonio_adaptive_report){.batches = a->batches,
                                      .poses = a->n,
                                      .median_rel = NAN,
                                      .rms_log = NAN,
                                      .until = a->plan.until,
                                      .share = a->shares[0],
                                      .median_rel_scale = NAN,
                                      .median_rel_power = NAN,
                                      .rms_log_scale = NAN,
                                      .rms_log_power = NAN};
    if (a->samples == NULL || a->samples->n == 0 || a->batches < 2) {
        return GONIO_OK;
    }
    size_t first = a->batches, held = 0;
    while (first > 1 && held < HELD_OUT_MIN) {
        held += held_out_of(a, --first);
    }
    gonio_errors e;
    const gonio_status status = errors_of(a, first, a->batches - 1, &e, error);
    if (status != GONIO_OK) {
        return status;
    }
    report->held_out = held;
    report->median_rel = e.median_rel; // NaN of none
    report->rms_log = e.rms_log;
    report->met = a->plan.until > 0 && held >= UNTIL_MIN && report->median_rel <= a->plan.until;
    return fit_laws(a, report, error);
}

bool gonio_adaptive_over(const gonio_adaptive *a, const gonio_adaptive_report *report) {
    return a->n >= a->plan.poses || report->met;
}

// A residual over its sigma, mean over the channels.
static double surprise_of(const gonio_adaptive *a, const gonio_adaptive_pose *p) {
    const size_t channels = (size_t)a->samples->channels;
    double sum = 0;
    for (size_t c = 0; c < channels; c++) {
        const double by = fabs(p->predicted[c] - a->samples->values[(size_t)p->sample * channels + c]);
        sum += by / fmax(p->uncertainty[c], 1e-12) / (double)channels;
    }
    return sum;
}

double gonio_adaptive_share(const gonio_adaptive *a) {
    double *z = malloc((a->n + 1) * sizeof *z), share = a->plan.share;
    size_t n = 0;
    for (size_t i = 0; z != NULL && i < a->n; i++) {
        if (a->poses[i].batch + 2 >= a->batches && is_held_out(a, i, true) && isfinite(a->poses[i].uncertainty[0])) {
            z[n++] = surprise_of(a, &a->poses[i]);
        }
    }
    if (n >= RESIDUALS_MIN) {
        share *= fmax(1, gonio_median(z, n) / GONIO_MEDIAN_OF_NORMAL);
    }
    free(z);
    return fmin(share, fmax(SHARE_MAX, a->plan.share));
}
