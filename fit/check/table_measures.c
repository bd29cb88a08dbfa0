// SPDX-License-Identifier: BSD-3-Clause
// DeYoung's measures of a table. P_r (4.1) halves a sum that is a mean over ordered pairs already; it is kept as
// printed.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/check/measures.h"
#include "fit/check/partial.h"
#include "fit/check/significance.h"

static double variance(const gonio_samples *s, size_t i, size_t c) {
    const double sigma = s->sigma_random != NULL ? s->sigma_random[i * (size_t)s->channels + c] : 0;
    return sigma * sigma;
}

// ---- reciprocity ----

// Of an isotropic table the second half of the azimuths may be the first's samples again.
static bool is_first(const gonio_table *t, size_t column) { return !t->folded || column % t->phis <= t->phis / 2; }

// The ring below theta and how far the next one is on the way; false: theta is outside the rings.
static bool bracket(const gonio_table *t, bool incident, double theta, size_t *ring, double *part) {
    const size_t n = incident ? t->thetas_in : t->thetas_out;
    for (size_t k = 0; k < n; k++) {
        const double at = (incident ? gonio_table_row(t, k * t->phis) : gonio_table_column(t, k * t->phis)).theta;
        const double next =
            k + 1 == n
                ? at
                : (incident ? gonio_table_row(t, (k + 1) * t->phis) : gonio_table_column(t, (k + 1) * t->phis)).theta;
        if (theta > at - GONIO_TABLE_TOLERANCE && theta < next + GONIO_TABLE_TOLERANCE) {
            *ring = k;
            *part = next > at ? fmin(fmax((theta - at) / (next - at), 0), 1) : 0;
            return true;
        }
    }
    return false;
}

// The exchanged direction where thetas of both sides differ: DeYoung's quadrilinear interpolation, of which the thetas
// remain, for the azimuths of both sides are the same ones.
static bool add_interpolated(const gonio_table *t, size_t row, size_t column, gonio_check_sums *sum,
                             gonio_differences *d) {
    const size_t c = (size_t)t->samples->channels, n = t->phis;
    size_t in, out;
    double s, u;
    if (n == 0 || !bracket(t, true, gonio_table_column(t, column).theta, &in, &s) ||
        !bracket(t, false, gonio_table_row(t, row).theta, &out, &u)) {
        return false;
    }
    const size_t a = gonio_table_at(t, row, column), in2 = in + 1 < t->thetas_in ? in + 1 : in;
    const size_t out2 = out + 1 < t->thetas_out ? out + 1 : out, r = column % n, q = row % n;
    const size_t corner[4] = {gonio_table_at(t, in * n + r, out * n + q), gonio_table_at(t, in * n + r, out2 * n + q),
                              gonio_table_at(t, in2 * n + r, out * n + q),
                              gonio_table_at(t, in2 * n + r, out2 * n + q)};
    const double weight[4] = {(1 - s) * (1 - u), (1 - s) * u, s * (1 - u), s * u};
    const gonio_pair where = gonio_table_pair(t, row, column);
    for (size_t k = 0; k < c; k++) {
        double there = 0;
        for (int j = 0; j < 4; j++) {
            there += weight[j] * t->samples->values[corner[j] * c + k];
        }
        const double z = t->samples->values[a * c + k];
        sum->square[k] += (z - there) * (z - there) / 2;
        gonio_differences_add(d, z, there, &where, (int)k);
    }
    return true;
}

static size_t add_pair(const gonio_table *t, size_t row, size_t column, gonio_check_sums *sum, gonio_differences *d) {
    const size_t r = t->row_of_column[column], q = t->column_of_row[row], c = (size_t)t->samples->channels;
    if (r == GONIO_TABLE_NONE || q == GONIO_TABLE_NONE) {
        return 0;
    }
    const size_t a = gonio_table_at(t, row, column), b = gonio_table_at(t, r, q);
    const gonio_pair where = gonio_table_pair(t, row, column);
    for (size_t k = 0; k < c; k++) {
        const double x = t->samples->values[a * c + k], y = t->samples->values[b * c + k];
        const double v = variance(t->samples, a, k) + variance(t->samples, b, k);
        sum->square[k] += (x - y) * (x - y) / 2;
        sum->expected[k] += a != b ? v / 2 : 0;
        gonio_differences_add(d, x, y, &where, (int)k);
        if (a < b && v > 0 && is_first(t, column)) {
            sum->chi2[k] += (x - y) * (x - y) / v;
            sum->dof[k] += 1;
        }
    }
    return 1;
}

static gonio_status reciprocity(const gonio_table *t, int threads, gonio_check_report *report, gonio_error *error) {
    const size_t c = (size_t)t->samples->channels, step = gonio_table_row_step(t);
    gonio_differences d;
    gonio_check_sums sum;
    const bool ready = gonio_differences_begin(&d, t->rows / step * t->columns * c);
    if (!gonio_check_sums_begin(&sum, c) || !ready) {
        free(sum.square);
        free(d.kept);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to compare %zu samples", t->samples->n);
    }
    size_t pairs = 0, between = 0;
    for (size_t row = 0; row < t->rows; row += step) {
        for (size_t column = 0; column < t->columns; column++) {
            const size_t found = add_pair(t, row, column, &sum, &d);
            pairs += found;
            between += found == 0 && add_interpolated(t, row, column, &sum, &d);
        }
    }
    pairs += between;
    report->reciprocity = pairs > 0 ? gonio_check_mean(sum.square, c) / (double)pairs : NAN;
    report->reciprocity_expected = pairs > 0 && between == 0 && t->samples->sigma_random != NULL
                                       ? gonio_check_mean(sum.expected, c) / (double)pairs
                                       : NAN;
    report->reciprocity_test = gonio_check_sums_test(&sum, (int)c);
    report->reciprocity_range = gonio_differences_end(&d, &report->reciprocity_median);
    free(sum.square);
    // What interpolates between thetas errs by more than sigma: the test is that of scattered samples then.
    return between == 0 ? GONIO_OK
                        : gonio_partial_test(t->samples, GONIO_TEST_RECIPROCITY, threads, &report->reciprocity_test,
                                             &report->reciprocity_part, error);
}

// ---- isotropy ----

// The phis values that a turn of the sample makes equal, (4.8) and (4.9).
static double deviation(const gonio_table *t, size_t row, size_t column, size_t k, gonio_check_sums *sum,
                        gonio_differences *d) {
    const gonio_samples *s = t->samples;
    const size_t n = t->phis, c = (size_t)s->channels, row0 = row - row % n, column0 = column - column % n;
    double total = 0, squares = 0, weight = 0, weighted = 0, chi2 = 0;
    for (size_t j = 0; j < n; j++) {
        const size_t i = gonio_table_at(t, row0 + j, column0 + (column % n + j) % n);
        const double z = s->values[i * c + k], v = variance(s, i, k);
        total += z;
        weight += v > 0 ? 1 / v : 0;
        weighted += v > 0 ? z / v : 0;
    }
    const double mu = total / (double)n, best = weight > 0 ? weighted / weight : 0;
    for (size_t j = 0; j < n; j++) {
        const size_t q = column0 + (column % n + j) % n, i = gonio_table_at(t, row0 + j, q);
        const double z = s->values[i * c + k], v = variance(s, i, k);
        const gonio_pair where = gonio_table_pair(t, row0 + j, q);
        squares += (z - mu) * (z - mu);
        chi2 += v > 0 ? (z - best) * (z - best) / v : 0;
        gonio_differences_add(d, z, mu, &where, (int)k);
    }
    sum->chi2[k] += weight > 0 ? chi2 : 0;
    sum->dof[k] += weight > 0 ? (double)n - 1 : 0;
    return sqrt(squares / (double)n);
}

static gonio_status isotropy(const gonio_table *t, gonio_check_report *report, gonio_error *error) {
    const size_t c = (size_t)t->samples->channels;
    report->isotropy_test = gonio_check_no_test;
    report->isotropy = report->isotropy_median = t->isotropic ? 0 : NAN;
    if (t->isotropic || t->phis == 0) {
        return GONIO_OK;
    }
    gonio_differences d;
    gonio_check_sums sum;
    const bool ready = gonio_differences_begin(&d, t->rows * t->columns * c);
    if (!gonio_check_sums_begin(&sum, c) || !ready) {
        free(sum.square);
        free(d.kept);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to compare %zu samples", t->samples->n);
    }
    for (size_t row = 0; row < t->rows; row += t->phis) {
        for (size_t column = 0; column < t->columns; column++) {
            for (size_t k = 0; k < c; k++) {
                sum.square[k] += deviation(t, row, column, k, &sum, &d);
            }
        }
    }
    report->isotropy = gonio_check_mean(sum.square, c) / (double)(t->thetas_in * t->columns);
    report->isotropy_test = gonio_check_sums_test(&sum, (int)c);
    report->isotropy_range = gonio_differences_end(&d, &report->isotropy_median);
    free(sum.square);
    return GONIO_OK;
}

// ---- energy ----

void gonio_check_integrate(const gonio_samples *s, size_t n, const size_t *sample, const double *weight,
                           const double *other, bool other_is_better, double *value, double *sigma,
                           gonio_check_albedo_point *point) {
    const size_t c = (size_t)s->channels;
    double scale[2] = {0, 0};
    for (size_t q = 0; q < n; q++) {
        scale[0] += weight[q];
        scale[1] += other[q];
    }
    point->largest = -INFINITY;
    for (size_t k = 0; k < c; k++) {
        double sum = 0, second = 0, random = 0, systematic = 0;
        for (size_t q = 0; q < n; q++) {
            const size_t at = sample[q] * c + k;
            sum += weight[q] * s->values[at];
            second += other[q] * s->values[at];
            random += s->sigma_random != NULL ? pow(weight[q] * s->sigma_random[at], 2) : 0;
            systematic += s->sigma_systematic != NULL ? weight[q] * s->sigma_systematic[at] : 0;
        }
        // What both weights make of a constant is known; what else they differ by is what they may miss.
        const double gap = fabs(sum * scale[1] / scale[0] - second);
        value[k] = other_is_better ? second : sum;
        sigma[k] = random + systematic > 0 ? sqrt(random + systematic * systematic + gap * gap) : 0;
        point->value += sum / (double)c;
        point->random += sqrt(random) / (double)c;
        point->systematic += systematic / (double)c;
        point->integration += (other_is_better ? fmax(gap, fabs(sum - second)) : gap) / (double)c;
        if (sum > point->largest) {
            point->largest = sum;
            point->channel = (int)k;
        }
    }
    if (point->covered < GONIO_CHECK_COVERED) {
        point->value = point->largest = NAN;
        value[0] = NAN;
    }
}

static gonio_status energy(const gonio_table *t, gonio_check_report *report, gonio_error *error) {
    const size_t c = (size_t)t->samples->channels;
    report->albedos = calloc(t->n_in, sizeof *report->albedos);
    double *values = malloc(t->n_in * c * sizeof *values), *sigmas = malloc(t->n_in * c * sizeof *sigmas);
    gonio_status status = GONIO_OK;
    report->channel_albedos = values;
    report->channel_sigmas = sigmas;
    if (report->albedos == NULL || values == NULL || sigmas == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu albedos", t->n_in * c);
    } else {
        report->incidences = t->n_in;
        for (size_t p = 0; p < t->n_in; p++) {
            report->albedos[p] =
                (gonio_check_albedo_point){.theta_i = t->in[p].theta, .phi_i = t->in[p].phi, .covered = t->covered};
            gonio_check_integrate(t->samples, t->n_out, t->cell + p * t->n_out, t->weight, t->weight_cells, true,
                                  values + p * c, sigmas + p * c, &report->albedos[p]);
        }
        gonio_check_sum_up_albedos(report);
        gonio_check_test_energy(report, (int)c);
    }
    return status;
}

gonio_status gonio_check_table(const gonio_table *t, int threads, gonio_check_report *report, gonio_error *error) {
    report->form = t->uniform ? GONIO_CHECK_UNIFORM : GONIO_CHECK_SEMI_UNIFORM;
    gonio_status status = reciprocity(t, threads, report, error);
    status = status == GONIO_OK ? isotropy(t, report, error) : status;
    status = status == GONIO_OK ? energy(t, report, error) : status;
    return status == GONIO_OK ? gonio_check_table_ranks(t, threads, report, error) : status;
}
