// SPDX-License-Identifier: BSD-3-Clause
// Fitting the law of fit/sigma/law.h.
//
// Every constant of the law but u is found by maximum likelihood of the residuals under Student's t with 5 degrees of
// freedom: BRDF residuals have heavy tails (the peak, the horizon), which would drag a normal likelihood's scale. u(x)
// is the same likelihood weighted by nearness, with a normal prior; the last step scales what was learnt so that the
// quantiles of the residuals over their sigma, each without its own part in u, are those of a normal.
#include "fit/sigma/law.h"

#include <math.h>
#include <stdlib.h>

#include "base/nearest.h"
#include "base/order_statistic.h"
#include "base/statistics.h"
#include "fit/sigma/tuning.h"

#define ROUGHNESS_MAX 6.0
#define NEARNESS_MIN (-4.5) // ln of the weight: farther records count for a hundredth
#define VARIANCE_MIN 1e-14
#define POWER_MAX 5.0

void gonio_sigma_records_release(gonio_sigma_records *records) {
    free(records->rows);
    *records = (gonio_sigma_records){0};
}

void gonio_sigma_place(const gonio_pair *pair, double x[2]) {
    double at[3];
    gonio_coordinates_isotropic(GONIO_HALF_VECTOR, gonio_direction(pair->theta_i, pair->phi_i),
                                gonio_direction(pair->theta_o, pair->phi_o), at);
    x[0] = gonio_sigma_tuned.tilt * hypot(at[0] - 0.5, at[1] - 0.5);
    x[1] = at[2];
}

gonio_status gonio_sigma_records_add(gonio_sigma_records *records, const gonio_sigma_record *row, gonio_error *error) {
    if (records->n == records->capacity) {
        const size_t capacity = 2 * records->capacity + 256;
        gonio_sigma_record *rows = realloc(records->rows, capacity * sizeof *rows);
        if (rows == NULL) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
        }
        records->rows = rows;
        records->capacity = capacity;
    }
    records->rows[records->n++] = *row;
    return GONIO_OK;
}

// What the powers are taken of.
static void logarithms(const gonio_sigma_law *law, const double *signs, double *ln) {
    for (int k = 0; k < GONIO_SIGMA_SIGNS; k++) {
        ln[k] = log((signs[k] + law->floor[k]) / law->unit[k]);
    }
}

// The unknown's part of the variance. u: ln of the roughness.
static double unknown_part(const gonio_sigma_law *law, const double *ln, double u) {
    double sum = 2 * u;
    for (int k = 0; k < GONIO_SIGMA_SIGNS; k++) {
        sum += law->power[k] * ln[k];
    }
    return law->scale * exp(sum);
}

// Minus the logarithm of the likelihood of a squared residual.
static double neg_log_likelihood(double square, double variance) {
    const double v = fmax(variance, VARIANCE_MIN);
    return 0.5 * log(v) + 0.5 * (gonio_sigma_tuned.freedom + 1) * log1p(square / (gonio_sigma_tuned.freedom * v));
}

// Minus the logarithm of the posterior. ln: GONIO_SIGMA_SIGNS a record.
static double total_neg_log_likelihood(const gonio_sigma_law *law, const double *ln, const double *roughness) {
    const gonio_sigma_records *r = law->records;
    double sum = 0;
    for (int k = 0; k < GONIO_SIGMA_SIGNS; k++) {
        const double off = (law->power[k] - r->power[k]) / r->spread[k];
        sum += 0.5 * off * off;
    }
    for (size_t i = 0; i < r->n; i++) {
        const gonio_sigma_record *row = &r->rows[i];
        const double v = law->noise * row->noise + unknown_part(law, ln + GONIO_SIGMA_SIGNS * i, roughness[i]);
        sum += row->weight * neg_log_likelihood(row->square, v);
    }
    return sum;
}

// Pattern search (Hooke and Jeeves 1961) over ln scale, the powers and, where nobody told it, ln noise.
static void search(gonio_sigma_law *law, bool noise_too, const double *ln, const double *roughness) {
    double best = total_neg_log_likelihood(law, ln, roughness);
    for (double step = 2; step > 0.02; step *= 0.5) {
        for (bool moved = true; moved;) {
            moved = false;
            for (int k = 0; k < 2 * (1 + GONIO_SIGMA_SIGNS + noise_too); k++) {
                gonio_sigma_law trial = *law;
                const double by = k % 2 == 0 ? step : -step;
                if (k < 2) {
                    trial.scale *= exp(by);
                } else if (k < 2 * (1 + GONIO_SIGMA_SIGNS)) {
                    double *power = &trial.power[k / 2 - 1];
                    *power = fmin(fmax(*power + 0.5 * by, 0), POWER_MAX);
                } else {
                    trial.noise *= exp(by);
                }
                const double now = total_neg_log_likelihood(&trial, ln, roughness);
                if (now < best - 1e-6 * fabs(best)) {
                    best = now;
                    *law = trial;
                    moved = true;
                }
            }
        }
    }
}

static double distance2(const gonio_sigma_record *row, const double x[2]) {
    return (row->x[0] - x[0]) * (row->x[0] - x[0]) + (row->x[1] - x[1]) * (row->x[1] - x[1]);
}

// The squared distance to the last of the nearest sample other than `but`.
static double reach2(const gonio_sigma_records *r, const double *x, size_t but) {
    const size_t share = r->near / gonio_sigma_tuned.neighbours_part,
                 enough = share > gonio_sigma_tuned.neighbours ? share : gonio_sigma_tuned.neighbours;
    gonio_nearest nearest = {.wanted = enough < gonio_sigma_tuned.neighbours_most ? enough
                                                                                  : gonio_sigma_tuned.neighbours_most};
    for (size_t i = 0; i < r->near; i++) {
        if (r->rows[i].centre != but) {
            gonio_nearest_show(&nearest, distance2(&r->rows[i], x), i);
        }
    }
    return gonio_nearest_reach(&nearest);
}

// Minus the logarithm of the posterior of u, from the neighbours' rows of [k, A, B, e^2].
static double roughness_neg_log_likelihood(const double *near, size_t n, double u) {
    const double grown = exp(2 * u);
    double sum = 0.5 * u * u / (gonio_sigma_tuned.roughness * gonio_sigma_tuned.roughness);
    for (size_t i = 0; i < n; i++, near += 4) {
        sum += near[0] * neg_log_likelihood(near[3], near[1] + grown * near[2]);
    }
    return sum;
}

#define GRID_STEP 0.5
#define GRID (2 * (int)(ROUGHNESS_MAX / GRID_STEP) + 1)

// ln of the posterior mean of e^u: where few residuals tell it, the rougher possibilities weigh more, as they should.
static double expected(const double *near, size_t n) {
    double values[GRID], least = INFINITY, sum = 0, total = 0;
    for (int k = 0; k < GRID; k++) {
        values[k] = roughness_neg_log_likelihood(near, n, k * GRID_STEP - ROUGHNESS_MAX);
        least = fmin(least, values[k]);
    }
    for (int k = 0; k < GRID; k++) {
        const double p = exp(least - values[k]);
        sum += p * exp(k * GRID_STEP - ROUGHNESS_MAX);
        total += p;
    }
    return log(sum / total);
}

// u(x) without what sample `but` says of itself. work: 4 x records.
static double roughness_at(const gonio_sigma_law *law, const double *x, size_t but, double *work) {
    const gonio_sigma_records *r = law->records;
    const double window = fmax(reach2(r, x, but), gonio_sigma_tuned.window * gonio_sigma_tuned.window);
    size_t n = 0;
    for (size_t i = 0; i < r->n; i++) {
        const gonio_sigma_record *row = &r->rows[i];
        const double nearness = -0.5 * distance2(row, x) / window;
        if (row->centre != but && nearness > NEARNESS_MIN) {
            work[4 * n] = row->weight * exp(nearness);
            work[4 * n + 1] = row->expected[0];
            work[4 * n + 2] = row->expected[1];
            work[4 * n++ + 3] = row->square;
        }
    }
    return expected(work, n);
}

// Factor by which sigmas of the unknown must grow for the normal's median, 0.6745, or for 95 % of the residuals within
// 2 sigma, whichever asks for more.
static double calibration(const gonio_sigma_law *law, const double *roughness, double *work) {
    const gonio_sigma_records *r = law->records;
    for (size_t i = 0; i < r->n; i++) {
        const gonio_sigma_record *row = &r->rows[i];
        const double v = row->expected[0] + exp(2 * roughness[i]) * row->expected[1];
        work[i] = sqrt(row->square / fmax(v, VARIANCE_MIN));
    }
    const double median = gonio_upper_median(work, r->n), most = gonio_order_statistic(work, r->n, r->n * 95 / 100);
    return fmin(fmax(fmax(median / GONIO_MEDIAN_OF_NORMAL, most / 2), 0.5), 2);
}

// The median of a sign over the records, or of the residuals' squares (sign GONIO_SIGMA_SIGNS).
static double middle_of(const gonio_sigma_records *r, int sign, double *work) {
    for (size_t i = 0; i < r->n; i++) {
        work[i] = sign < GONIO_SIGMA_SIGNS ? r->rows[i].signs[sign] : r->rows[i].square;
    }
    return r->n > 0 ? fmax(gonio_upper_median(work, r->n), 1e-20) : 1;
}

// Where the search begins: every part about as large as the residuals.
static gonio_sigma_law first_law(const gonio_sigma_records *records, double noise, double *work) {
    const double square = middle_of(records, GONIO_SIGMA_SIGNS, work);
    gonio_sigma_law law = {
        .records = records, .noise = noise >= 0 ? noise : 0.1 * square, .scale = square, .growth = 1};
    for (int k = 0; k < GONIO_SIGMA_SIGNS; k++) {
        const double middle = middle_of(records, k, work);
        law.floor[k] = k == GONIO_SIGMA_UNKNOWN      ? 1e-12 * middle
                       : k == GONIO_SIGMA_CORRECTION ? gonio_sigma_tuned.correction_floor * square
                                                     : gonio_sigma_tuned.slopes_floor;
        law.unit[k] = middle + law.floor[k];
        law.power[k] = records->power[k];
    }
    return law;
}

gonio_status gonio_sigma_law_fit(gonio_sigma_records *records, double noise, gonio_sigma_law *law, gonio_error *error) {
    const size_t n = records->n;
    double *work = malloc(((5 + GONIO_SIGMA_SIGNS) * n + 1) * sizeof *work);
    if (work == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    double *roughness = work + 4 * n, *ln = roughness + n;
    *law = first_law(records, noise, work);
    for (size_t i = 0; i < n; i++) {
        logarithms(law, records->rows[i].signs, ln + GONIO_SIGMA_SIGNS * i);
        roughness[i] = 0;
    }
    for (int pass = 0; pass < 2 && n > 0; pass++) {
        search(law, noise < 0, ln, roughness);
        for (size_t i = 0; i < n; i++) {
            records->rows[i].expected[0] = law->noise * records->rows[i].noise;
            records->rows[i].expected[1] = unknown_part(law, ln + GONIO_SIGMA_SIGNS * i, 0);
        }
        for (size_t i = 0; i < n; i++) {
            roughness[i] = roughness_at(law, records->rows[i].x, records->rows[i].centre, work);
        }
    }
    if (n > 0) {
        law->growth = calibration(law, roughness, work);
    }
    free(work);
    return GONIO_OK;
}

double gonio_sigma_law_variance(const gonio_sigma_law *law, const double x[2], double noise,
                                const double signs[GONIO_SIGMA_SIGNS], double *work) {
    double ln[GONIO_SIGMA_SIGNS];
    logarithms(law, signs, ln);
    const double u = roughness_at(law, x, SIZE_MAX, work);
    return gonio_sigma_tuned.selection *
           fmax(law->noise * noise + law->growth * law->growth * unknown_part(law, ln, u), VARIANCE_MIN);
}
