// SPDX-License-Identifier: BSD-3-Clause
// The measures of a table in passes. What has to be held: for isotropy the rows of one ring of incidences, for
// reciprocity as many rows as memory allows, held against the columns of all others in one pass a block, for
// separability the few vectors of the search.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/check/measures.h"
#include "fit/check/products.h"
#include "fit/check/ranks.h"
#include "fit/check/significance.h"
#include "fit/check/stream.h"

enum { PASSES = 3 };

// Rows of the matrix that memory holds.
static size_t block_rows(const gonio_stream *s) {
    const size_t fit = s->memory / (s->table->n_out * gonio_stream_entry_bytes(s));
    return fit < 1 ? 1 : fit < s->table->rows ? fit : s->table->rows;
}

static double variance_at(const gonio_samples *e, size_t at) {
    return e->sigma_random != NULL ? e->sigma_random[at] * e->sigma_random[at] : 0;
}

// ---- reciprocity ----

typedef struct comparison {
    gonio_stream *stream;
    gonio_check_sums sums;
    gonio_differences differences;
    size_t pairs;
} comparison;

// Row p, whose entries begin at `at` of e, against rows [from, from + held) of the block, up to p itself.
static void compare_row(comparison *x, size_t p, const gonio_samples *e, size_t at, const gonio_samples *block,
                        size_t from, size_t held) {
    const gonio_table *t = x->stream->table;
    const size_t c = x->stream->channels;
    for (size_t q = from; q < from + held && q <= p; q++) {
        const size_t there = t->column_of_row[q], back = t->column_of_row[p];
        if (there == GONIO_TABLE_NONE || back == GONIO_TABLE_NONE) {
            continue;
        }
        const gonio_pair where = gonio_table_pair(t, p, there);
        const size_t i = (at + t->ring_out[there]) * c, j = ((q - from) * t->n_out + t->ring_out[back]) * c;
        const double times = p == q ? 1 : 2;
        for (size_t k = 0; k < c; k++) {
            const double a = e->values[i + k], b = block->values[j + k];
            const double v = variance_at(e, i + k) + variance_at(block, j + k);
            x->sums.square[k] += times * (a - b) * (a - b) / 2;
            for (int time = 0; time < (int)times; time++) { // both orders, as in a table that memory holds
                gonio_differences_add(&x->differences, a, b, &where, (int)k);
            }
            if (p != q && v > 0) {
                x->sums.expected[k] += v;
                x->sums.chi2[k] += (a - b) * (a - b) / v;
                x->sums.dof[k] += 1;
            }
        }
        x->pairs += (size_t)times;
    }
}

static gonio_status reciprocity(gonio_stream *s, gonio_samples *block, gonio_check_report *r, gonio_error *error) {
    const gonio_table *t = s->table;
    const size_t n = block_rows(s);
    comparison x = {.stream = s};
    gonio_samples *row = gonio_stream_entries(s, t->n_out);
    const bool ready = gonio_differences_begin(&x.differences, t->rows * t->columns * s->channels);
    if (!gonio_check_sums_begin(&x.sums, s->channels) || row == NULL || !ready) {
        free(x.sums.square);
        free(x.differences.kept);
        gonio_stream_entries_free(row);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to compare %zu rows", t->rows);
    }
    for (size_t from = 0; from < t->rows && !s->failed; from += n) {
        const size_t held = t->rows - from < n ? t->rows - from : n;
        for (size_t j = 0; j < held; j++) {
            gonio_stream_read(s, t->ring_in[from + j], block, j * t->n_out);
        }
        for (size_t p = from; p < t->rows && !s->failed; p++) {
            if (p >= from + held) {
                gonio_stream_read(s, t->ring_in[p], row, 0);
            }
            const bool own = p < from + held;
            compare_row(&x, p, own ? block : row, own ? (p - from) * t->n_out : 0, block, from, held);
        }
    }
    const double pairs = (double)x.pairs;
    r->reciprocity = x.pairs > 0 ? gonio_check_mean(x.sums.square, s->channels) / pairs : NAN;
    r->reciprocity_expected =
        x.pairs > 0 && s->columns->with_sigma ? gonio_check_mean(x.sums.expected, s->channels) / pairs : NAN;
    r->reciprocity_test = gonio_check_sums_test(&x.sums, (int)s->channels);
    r->reciprocity_range = gonio_differences_end(&x.differences, &r->reciprocity_median);
    free(x.sums.square);
    gonio_stream_entries_free(row);
    return gonio_stream_sound(s, error);
}

// ---- isotropy ----

// (4.9) of one column of a ring of incidences, channel k.
static double deviation(comparison *x, size_t row, const gonio_samples *ring, size_t column, size_t k) {
    const gonio_table *t = x->stream->table;
    const size_t n = t->phis, c = x->stream->channels, base = column - column % n;
    double mean = 0, squares = 0, weight = 0, weighted = 0, chi2 = 0;
    for (size_t pass = 0; pass < 2; pass++) {
        const double best = weight > 0 ? weighted / weight : 0, mu = mean;
        for (size_t j = 0; j < n; j++) {
            const size_t q = base + (column % n + j) % n, at = (j * t->n_out + t->ring_out[q]) * c + k;
            const double z = ring->values[at], v = variance_at(ring, at);
            if (pass == 0) {
                mean += z / (double)n;
                weight += v > 0 ? 1 / v : 0;
                weighted += v > 0 ? z / v : 0;
                continue;
            }
            const gonio_pair where = gonio_table_pair(t, row + j, q);
            squares += (z - mu) * (z - mu);
            chi2 += v > 0 ? (z - best) * (z - best) / v : 0;
            gonio_differences_add(&x->differences, z, mu, &where, (int)k);
        }
    }
    x->sums.chi2[k] += weight > 0 ? chi2 : 0;
    x->sums.dof[k] += weight > 0 ? (double)n - 1 : 0;
    return sqrt(squares / (double)n);
}

static gonio_status isotropy(gonio_stream *s, gonio_samples *block, gonio_check_report *r, gonio_error *error) {
    const gonio_table *t = s->table;
    comparison x = {.stream = s};
    const bool ready = gonio_differences_begin(&x.differences, t->rows * t->columns * s->channels);
    if (!gonio_check_sums_begin(&x.sums, s->channels) || !ready) {
        free(x.sums.square);
        free(x.differences.kept);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to compare %zu rows", t->rows);
    }
    for (size_t row = 0; row < t->rows && !s->failed; row += t->phis) {
        for (size_t j = 0; j < t->phis; j++) {
            gonio_stream_read(s, t->ring_in[row + j], block, j * t->n_out);
        }
        for (size_t column = 0; column < t->columns; column++) {
            for (size_t k = 0; k < s->channels; k++) {
                x.sums.square[k] += deviation(&x, row, block, column, k);
            }
        }
    }
    r->isotropy = gonio_check_mean(x.sums.square, s->channels) / (double)(t->thetas_in * t->columns);
    r->isotropy_test = gonio_check_sums_test(&x.sums, (int)s->channels);
    r->isotropy_range = gonio_differences_end(&x.differences, &r->isotropy_median);
    free(x.sums.square);
    return gonio_stream_sound(s, error);
}

// ---- energy ----

static gonio_status energy(gonio_stream *s, gonio_samples *row, gonio_check_report *r, gonio_error *error) {
    const gonio_table *t = s->table;
    const size_t c = s->channels;
    size_t *entry = malloc(t->n_out * sizeof *entry);
    r->albedos = calloc(t->n_in, sizeof *r->albedos);
    r->channel_albedos = malloc(t->n_in * c * sizeof *r->channel_albedos);
    r->channel_sigmas = malloc(t->n_in * c * sizeof *r->channel_sigmas);
    if (entry == NULL || r->albedos == NULL || r->channel_albedos == NULL || r->channel_sigmas == NULL) {
        free(entry);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu albedos", t->n_in);
    }
    for (size_t q = 0; q < t->n_out; q++) {
        entry[q] = q;
    }
    r->incidences = t->n_in;
    for (size_t p = 0; p < t->n_in; p++) {
        gonio_stream_read(s, p, row, 0);
        r->albedos[p] =
            (gonio_check_albedo_point){.theta_i = t->in[p].theta, .phi_i = t->in[p].phi, .covered = t->covered};
        gonio_check_integrate(row, t->n_out, entry, t->weight, t->weight_cells, true, r->channel_albedos + p * c,
                              r->channel_sigmas + p * c, &r->albedos[p]);
        for (size_t at = 0; at < t->n_out * c; at++) {
            r->negative += row->values[at] < 0;
        }
    }
    gonio_check_sum_up_albedos(r);
    gonio_check_test_energy(r, (int)c);
    free(entry);
    return gonio_stream_sound(s, error);
}

// ---- separability ----

static gonio_status rank_channel(gonio_stream *s, size_t channel, gonio_ranks *ranks, gonio_error *error) {
    const gonio_table *t = s->table;
    const gonio_row_source a = {t->rows, t->columns, gonio_stream_channel_row, s};
    const gonio_row_source sigma = {t->rows, t->columns, gonio_stream_sigma_row, s};
    gonio_products p;
    s->channel = channel;
    const gonio_status status = gonio_products_find(&a, GONIO_CHECK_RANKS, PASSES, &p, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_ranks_of_products(&p, channel, ranks);
    if (s->columns->with_sigma) {
        gonio_ranks_test(&sigma, &p, channel, ranks);
    }
    gonio_products_free(&p);
    return gonio_stream_sound(s, error);
}

static gonio_status separability(gonio_stream *s, gonio_check_report *r, gonio_error *error) {
    gonio_ranks ranks;
    gonio_status status = gonio_ranks_begin(s->channels, &ranks, error);
    for (size_t c = 0; c < s->channels && status == GONIO_OK; c++) {
        status = rank_channel(s, c, &ranks, error);
    }
    if (status == GONIO_OK) {
        gonio_ranks_sum_up(&ranks, s->table->rows, s->table->columns, s->channels, r);
    }
    gonio_ranks_free(&ranks);
    return status;
}

// ---- all ----

gonio_status gonio_check_stream(const char *path, size_t memory, gonio_check_report *report, gonio_error *error) {
    gonio_stream s;
    *report = (gonio_check_report){.reciprocity_expected = NAN};
    report->reciprocity_test = report->isotropy_test = report->energy_test = gonio_check_no_test;
    gonio_status status = gonio_stream_open(path, memory, &s, error);
    if (status == GONIO_OK) {
        const size_t rows = block_rows(&s) > s.table->phis ? block_rows(&s) : s.table->phis;
        gonio_samples *block = gonio_stream_entries(&s, rows * s.table->n_out);
        report->form = s.table->uniform ? GONIO_CHECK_UNIFORM : GONIO_CHECK_SEMI_UNIFORM;
        status = block != NULL ? reciprocity(&s, block, report, error)
                               : gonio_fail(error, GONIO_E_MEMORY, "no memory for a block of the table's rows");
        status = status == GONIO_OK ? isotropy(&s, block, report, error) : status;
        status = status == GONIO_OK ? energy(&s, block, report, error) : status;
        status = status == GONIO_OK ? separability(&s, report, error) : status;
        gonio_stream_entries_free(block);
    }
    gonio_stream_close(&s);
    if (status != GONIO_OK) {
        gonio_check_report_free(report);
    }
    return status;
}
