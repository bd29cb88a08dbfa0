// SPDX-License-Identifier: BSD-3-Clause
// P_s^(k) of a table, (4.13) to (4.20): what the best sum of k products leaves of the matrix whose rows are incidences
// and whose columns are outgoing directions.
//
// An isotropic table's matrix is block-circulant: it depends on the difference of azimuths alone. A Fourier transform
// over that makes it block-diagonal with one small thetas x thetas block a frequency, and their singular values
// together are the matrix's own. Others up to EXACT directions a side are decomposed whole; larger ones by
// gonio_products_find, whose error is stated.
#include <math.h>
#include <stdlib.h>

#include "base/thread_pool.h"
#include "fit/check/change.h"
#include "fit/check/measures.h"
#include "fit/check/ranks.h"
#include "fit/check/significance.h"
#include "fit/smooth/matrix.h"

enum { EXACT = 400, PASSES = 3 };

typedef struct job {
    const gonio_table *table;
    size_t channel; // of the row source
    gonio_ranks ranks;
} job;

static double value_of(const gonio_table *t, size_t row, size_t column, size_t channel) {
    return t->samples->values[gonio_table_at(t, row, column) * (size_t)t->samples->channels + channel];
}

static void read_row(void *context, size_t row, double *values) {
    const job *j = context;
    for (size_t q = 0; q < j->table->columns; q++) {
        values[q] = value_of(j->table, row, q, j->channel);
    }
}

// values[n], each `times` as often, join the largest kept so far; the squares of what does not stay go to *rest.
static void keep(double largest[GONIO_CHECK_RANKS], double *rest, const double *values, size_t n, int times) {
    for (size_t i = 0; i < n; i++) {
        for (int copy = 0; copy < times; copy++) {
            double v = values[i];
            for (int k = 0; k < GONIO_CHECK_RANKS; k++) {
                if (v > largest[k]) {
                    const double before = largest[k];
                    largest[k] = v;
                    v = before;
                }
            }
            *rest += v * v;
        }
    }
}

// ---- isotropic: block by block ----

// The block of frequency m, as the real matrix [re -im; im re] unless it is real; returns its size.
static size_t fill_block(const gonio_table *t, size_t channel, size_t m, bool real, const double *turn, double *block) {
    const size_t side = t->thetas_in > t->thetas_out ? t->thetas_in : t->thetas_out, n = real ? side : 2 * side;
    for (size_t k = 0; k < n * n; k++) {
        block[k] = 0;
    }
    for (size_t i = 0; i < t->thetas_in; i++) {
        for (size_t o = 0; o < t->thetas_out; o++) {
            double re = 0, im = 0;
            for (size_t d = 0; d < t->phis; d++) {
                const double z = value_of(t, i * t->phis, o * t->phis + d, channel);
                re += z * turn[2 * (d * m % t->phis)];
                im += z * turn[2 * (d * m % t->phis) + 1];
            }
            block[o * n + i] = re;
            if (!real) {
                block[(o + side) * n + i + side] = re;
                block[o * n + i + side] = im;
                block[(o + side) * n + i] = -im;
            }
        }
    }
    return n;
}

static bool by_blocks(job *j, size_t channel, double largest[GONIO_CHECK_RANKS], double *rest) {
    const gonio_table *t = j->table;
    const size_t side = 2 * (t->thetas_in > t->thetas_out ? t->thetas_in : t->thetas_out);
    double *block = malloc((side * side + side) * sizeof *block), *values = block != NULL ? block + side * side : NULL;
    double *turn = malloc(2 * t->phis * sizeof *turn);
    bool done = block != NULL && turn != NULL;
    for (size_t d = 0; d < t->phis && done; d++) {
        turn[2 * d] = cos(2 * GONIO_PI * (double)d / (double)t->phis);
        turn[2 * d + 1] = sin(2 * GONIO_PI * (double)d / (double)t->phis);
    }
    for (size_t m = 0; m <= t->phis / 2 && done; m++) {
        const bool alone = m == 0 || 2 * m == t->phis, real = t->folded || alone;
        const size_t n = fill_block(t, channel, m, real, turn, block);
        done = gonio_singular_values(n, block, values);
        // The real form holds each complex value twice; frequency -m has the same ones.
        for (size_t i = 0; !real && done && i < n / 2; i++) {
            values[i] = values[2 * i];
        }
        if (done) {
            keep(largest, rest, values, real ? n : n / 2, alone ? 1 : 2);
        }
    }
    free(turn);
    free(block);
    return done;
}

// ---- others ----

static bool whole(job *j, size_t channel, double largest[GONIO_CHECK_RANKS], double *rest) {
    const gonio_table *t = j->table;
    const size_t n = t->rows > t->columns ? t->rows : t->columns;
    double *a = calloc(n * n + n, sizeof *a);
    if (a == NULL) {
        return false;
    }
    for (size_t p = 0; p < t->rows; p++) {
        for (size_t q = 0; q < t->columns; q++) {
            a[q * n + p] = value_of(t, p, q, channel);
        }
    }
    const bool done = gonio_singular_values(n, a, a + n * n);
    if (done) {
        keep(largest, rest, a + n * n, n, 1);
    }
    free(a);
    return done;
}

// ---- what sigma explains ----

// The squares that noise leaves beyond k products: each entry's variance, less what the products took up of it. Their
// sum is a scaled chi-square with the mean and variance of that sum (Satterthwaite 1946).
void gonio_ranks_test(const gonio_row_source *sigma, const gonio_products *p, size_t channel, gonio_ranks *ranks) {
    double mean[GONIO_CHECK_RANKS] = {0}, squares[GONIO_CHECK_RANKS] = {0};
    double *row = malloc(p->columns * sizeof *row);
    const double *left = ranks->left[channel];
    for (size_t r = 0; row != NULL && r < p->rows; r++) {
        sigma->row(sigma->context, r, row);
        for (size_t k = 1; k <= p->k; k++) {
            const double u = 1 - gonio_change_leverage(p->u, p->rows, k, r);
            for (size_t column = 0; column < p->columns; column++) {
                const double v =
                    row[column] * row[column] * u * (1 - gonio_change_leverage(p->v, p->columns, k, column));
                mean[k - 1] += v;
                squares[k - 1] += v * v;
            }
        }
    }
    for (size_t k = 0; k < p->k; k++) {
        gonio_check_test *test = &ranks->tests[channel][k];
        if (squares[k] > 0) {
            *test = (gonio_check_test){left[k + 1] * mean[k] / squares[k], mean[k] * mean[k] / squares[k], 0,
                                       (int)channel, 0};
            test->p = test->least = gonio_chi_square_beyond(test->dof, test->chi2);
        }
    }
    free(row);
}

static void keep_values(const double *value, size_t n, double rest, size_t channel, gonio_ranks *ranks) {
    for (size_t k = GONIO_CHECK_RANKS; k <= GONIO_CHECK_RANKS; k--) {
        ranks->left[channel][k] = rest;
        rest += k > 0 && k <= n ? value[k - 1] * value[k - 1] : 0;
    }
}

void gonio_ranks_of_products(const gonio_products *p, size_t channel, gonio_ranks *ranks) {
    double rest = p->squares;
    for (size_t k = 0; k < p->k; k++) {
        rest = fmax(rest - p->value[k] * p->value[k], 0);
    }
    keep_values(p->value, p->k, rest, channel, ranks);
    ranks->error[channel] = p->left;
}

gonio_status gonio_ranks_begin(size_t channels, gonio_ranks *ranks, gonio_error *error) {
    *ranks = (gonio_ranks){calloc(channels, sizeof *ranks->left), calloc(channels, sizeof *ranks->error),
                           calloc(channels, sizeof *ranks->tests)};
    if (ranks->left == NULL || ranks->error == NULL || ranks->tests == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the singular values of %zu channels", channels);
    }
    for (size_t c = 0; c < channels; c++) {
        for (int k = 0; k < GONIO_CHECK_RANKS; k++) {
            ranks->tests[c][k] = gonio_check_no_test;
        }
    }
    return GONIO_OK;
}

void gonio_ranks_free(gonio_ranks *ranks) {
    free(ranks->tests);
    free(ranks->error);
    free(ranks->left);
}

static void read_sigma(void *context, size_t row, double *values) {
    const job *j = context;
    const gonio_samples *s = j->table->samples;
    for (size_t q = 0; q < j->table->columns; q++) {
        values[q] = s->sigma_random[gonio_table_at(j->table, row, q) * (size_t)s->channels + j->channel];
    }
}

static gonio_status find_channel(void *context, size_t channel, gonio_error *error) {
    job j = *(job *)context;
    const gonio_table *t = j.table;
    j.channel = channel;
    double largest[GONIO_CHECK_RANKS] = {0}, rest = 0;
    const size_t longest = t->rows > t->columns ? t->rows : t->columns;
    const bool blocks = t->isotropic && t->phis > 0, exact = blocks || longest <= EXACT;
    const bool sigma = t->samples->sigma_random != NULL && !blocks;
    if (exact && !(blocks ? by_blocks(&j, channel, largest, &rest) : whole(&j, channel, largest, &rest))) {
        return gonio_fail(error, GONIO_E_CONVERGENCE, "no singular values of the table's matrix");
    }
    gonio_products p = {0};
    if (!exact || sigma) {
        const gonio_row_source source = {t->rows, t->columns, read_row, &j};
        const gonio_status status = gonio_products_find(&source, GONIO_CHECK_RANKS, PASSES, &p, error);
        if (status != GONIO_OK) {
            return status;
        }
    }
    if (exact) {
        keep_values(largest, GONIO_CHECK_RANKS, rest, channel, &j.ranks);
    } else {
        gonio_ranks_of_products(&p, channel, &j.ranks);
    }
    if (sigma) {
        gonio_ranks_test(&(gonio_row_source){t->rows, t->columns, read_sigma, &j}, &p, channel, &j.ranks);
    }
    gonio_products_free(&p);
    return GONIO_OK;
}

void gonio_ranks_sum_up(const gonio_ranks *j, size_t rows, size_t columns, size_t channels, gonio_check_report *r) {
    const double entries = (double)rows * (double)columns * (double)channels;
    const size_t least = rows < columns ? rows : columns;
    r->ranks = least < GONIO_CHECK_RANKS ? (int)least : GONIO_CHECK_RANKS;
    r->directions[0] = rows;
    r->directions[1] = columns;
    double all = 0, error = 0;
    for (size_t c = 0; c < channels; c++) {
        all += j->left[c][0];
        error += j->error[c];
    }
    r->mean_square = all / entries;
    r->mean_square_seen = 1;
    for (int k = 0; k < r->ranks; k++) {
        double left = 0;
        int joined = 0;
        r->separability_test[k] = gonio_check_no_test;
        for (size_t c = 0; c < channels; c++) {
            left += j->left[c][k + 1];
            gonio_check_join(&r->separability_test[k], &joined, &j->tests[c][k]);
        }
        r->separability[k] = sqrt(left / entries);
        r->separability_range[k] = all > 0 ? sqrt(left / all) : 0;
        r->separability_error = fmax(r->separability_error, r->separability[k] - sqrt(fmax(left - error, 0) / entries));
    }
}

gonio_status gonio_check_table_ranks(const gonio_table *t, int threads, gonio_check_report *report,
                                     gonio_error *error) {
    const size_t c = (size_t)t->samples->channels;
    job j = {.table = t};
    gonio_status status = gonio_ranks_begin(c, &j.ranks, error);
    status = status == GONIO_OK ? gonio_pool_try(threads, c, find_channel, &j, error) : status;
    if (status == GONIO_OK) {
        gonio_ranks_sum_up(&j.ranks, t->rows, t->columns, c, report);
    }
    gonio_ranks_free(&j.ranks);
    return status;
}
