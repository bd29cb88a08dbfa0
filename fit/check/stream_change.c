// SPDX-License-Identifier: BSD-3-Clause
// The transforms of a table in passes: rows come out in the order in which they stand.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "fit/check/change.h"
#include "fit/check/measures.h"
#include "fit/check/products.h"
#include "fit/check/stream.h"
#include "gonio/output.h"

enum { PASSES = 6 };

// ---- a row ----

// What stands in column k for entry i.
static double number_of(const gonio_stream *s, const gonio_samples *e, size_t i, int k) {
    const gonio_columns *l = s->columns;
    for (size_t c = 0; c < s->channels; c++) {
        const size_t at = i * s->channels + c;
        if (l->value[c] == k) {
            return e->values[at];
        }
        if (l->sigma[c] == k) {
            return hypot(e->sigma_random[at], e->sigma_systematic[at]);
        }
        if (l->random[c] == k) {
            return e->sigma_random[at];
        }
        if (l->systematic[c] == k) {
            return e->sigma_systematic[at];
        }
    }
    return NAN;
}

static void put_row(const gonio_stream *s, FILE *out, size_t p, const gonio_samples *e, size_t from) {
    const gonio_table *t = s->table;
    char text[32];
    for (size_t q = 0; q < t->n_out; q++) {
        const double angles[4] = {t->in[p].theta, t->in[p].phi, t->out[q].theta, t->out[q].phi};
        for (int k = 0; k < s->columns->columns; k++) {
            gonio_text_shortest(k < 4 ? gonio_degrees(angles[k]) : number_of(s, e, from + q, k), text);
            fprintf(out, "%s%s", k > 0 ? "," : "", text);
        }
        fputc('\n', out);
    }
}

// Entry i of one set of entries to entry j of another of the same stream.
static void copy_entry(const gonio_samples *from, size_t i, gonio_samples *to, size_t j) {
    const size_t c = (size_t)from->channels, bytes = c * sizeof(double);
    memcpy(to->values + j * c, from->values + i * c, bytes);
    if (from->sigma_random != NULL) {
        memcpy(to->sigma_random + j * c, from->sigma_random + i * c, bytes);
        memcpy(to->sigma_systematic + j * c, from->sigma_systematic + i * c, bytes);
    }
}

static gonio_status no_memory(gonio_error *error) {
    return gonio_fail(error, GONIO_E_MEMORY, "no memory for the rows of a table in passes");
}

// ---- reciprocity ----

typedef struct exchange {
    gonio_stream *stream;
    const gonio_change *change;
    gonio_samples *block, *back, *row; // rows, their exchanged values, a row of the pass
    gonio_samples *two, *changed;      // an entry and its partner
} exchange;

// Entry q of row p, the j-th of the block, and its partner, the smaller number first, as in a table that memory holds.
static void exchange_entry(const exchange *x, size_t p, size_t j, size_t q) {
    const size_t at = j * x->stream->table->n_out + q, own = p <= q ? 0 : 1, of[2] = {0, 1};
    double weight[2];
    if (p == q) {
        return;
    }
    copy_entry(x->block, at, x->two, own);
    copy_entry(x->back, at, x->two, 1 - own);
    for (size_t c = 0; c < x->stream->channels; c++) {
        gonio_change_weigh(x->two, c, 2, of, weight);
        gonio_change_towards(x->change, x->two, own, c, 2, of, weight, x->changed);
    }
    copy_entry(x->changed, own, x->block, at);
}

// n rows at a time, and the values of the exchanged directions. Stored incidences and outgoing directions are the same
// list.
static void exchange_rows(const exchange *x, size_t n, FILE *out) {
    gonio_stream *s = x->stream;
    const size_t width = s->table->n_out;
    for (size_t from = 0; from < s->table->n_in && !s->failed; from += n) {
        const size_t held = s->table->n_in - from < n ? s->table->n_in - from : n;
        for (size_t q = 0; q < s->table->n_in; q++) {
            gonio_stream_read(s, q, x->row, 0);
            for (size_t j = 0; j < held; j++) {
                copy_entry(x->row, from + j, x->back, j * width + q);
            }
            for (size_t k = 0; q >= from && q < from + held && k < width; k++) {
                copy_entry(x->row, k, x->block, (q - from) * width + k);
            }
        }
        for (size_t j = 0; j < held; j++) {
            for (size_t q = 0; q < width; q++) {
                exchange_entry(x, from + j, j, q);
            }
            put_row(s, out, from + j, x->block, j * width);
        }
    }
}

static bool is_square(const gonio_table *t) {
    bool equal = t->n_in == t->n_out;
    for (size_t k = 0; equal && k < t->n_in; k++) {
        equal = fabs(t->in[k].theta - t->out[k].theta) < GONIO_TABLE_TOLERANCE &&
                fabs(t->in[k].phi - t->out[k].phi) < GONIO_TABLE_TOLERANCE;
    }
    return equal;
}

static gonio_status make_reciprocal(gonio_stream *s, const gonio_change *change, FILE *out, gonio_error *error) {
    const gonio_table *t = s->table;
    if (!is_square(t)) {
        return gonio_fail_line(error, GONIO_E_UNSUPPORTED, s->path, -1,
                               "reciprocity in passes needs the same directions on both sides");
    }
    const size_t fit = s->memory / (2 * t->n_out * gonio_stream_entry_bytes(s));
    const size_t n = fit < 1 ? 1 : fit < t->n_in ? fit : t->n_in;
    const exchange x = {s,
                        change,
                        gonio_stream_entries(s, n * t->n_out),
                        gonio_stream_entries(s, n * t->n_out),
                        gonio_stream_entries(s, t->n_out),
                        gonio_stream_entries(s, 2),
                        gonio_stream_entries(s, 2)};
    const bool room = x.block != NULL && x.back != NULL && x.row != NULL && x.two != NULL && x.changed != NULL;
    if (room) {
        exchange_rows(&x, n, out);
    }
    gonio_stream_entries_free(x.block);
    gonio_stream_entries_free(x.back);
    gonio_stream_entries_free(x.row);
    gonio_stream_entries_free(x.two);
    gonio_stream_entries_free(x.changed);
    return room ? gonio_stream_sound(s, error) : no_memory(error);
}

// ---- isotropy ----

typedef struct turning {
    const gonio_change *change;
    const gonio_samples *in;
    gonio_samples *out;
    size_t *of;
    double *weight;
} turning;

static void join(const turning *x, size_t n) {
    for (size_t c = 0; c < (size_t)x->in->channels; c++) {
        gonio_change_weigh(x->in, c, n, x->of, x->weight);
        for (size_t j = 0; j < n; j++) {
            gonio_change_towards(x->change, x->in, x->of[j], c, n, x->of, x->weight, x->out);
        }
    }
}

// One ring of incidences in x->in, or the pole; the poles of both sides take part, though the measures leave them out.
static void turn_ring(const turning *x, const gonio_table *t, bool pole) {
    const size_t n = t->phis, pole_out = t->ring_out[0];
    for (size_t column = 0; column < t->columns; column++) {
        if (pole && column % n > 0) {
            continue;
        }
        for (size_t j = 0; j < n; j++) {
            const size_t q = column - column % n + (column % n + j) % n;
            x->of[j] = (pole ? 0 : j * t->n_out) + t->ring_out[q];
        }
        join(x, n);
    }
    for (size_t j = 0; j < n && !pole && pole_out > 0; j++) {
        x->of[j] = j * t->n_out;
    }
    if (!pole && pole_out > 0) {
        join(x, n);
    }
}

static void turn_rows(gonio_stream *s, const turning *x, gonio_samples *in, FILE *out) {
    const gonio_table *t = s->table;
    const size_t pole = t->ring_in[0];
    for (size_t p = 0; p < t->n_in && !s->failed; p += p < pole ? 1 : t->phis) {
        const size_t rows = p < pole ? 1 : t->phis;
        for (size_t j = 0; j < rows; j++) {
            gonio_stream_read(s, p + j, in, j * t->n_out);
        }
        for (size_t i = 0; i < rows * t->n_out; i++) {
            copy_entry(in, i, x->out, i);
        }
        turn_ring(x, t, p < pole);
        for (size_t j = 0; j < rows; j++) {
            put_row(s, out, p + j, x->out, j * t->n_out);
        }
    }
}

static gonio_status make_isotropic(gonio_stream *s, const gonio_change *change, FILE *out, gonio_error *error) {
    const size_t n = s->table->phis;
    gonio_samples *in = gonio_stream_entries(s, n * s->table->n_out);
    const turning x = {change, in, gonio_stream_entries(s, n * s->table->n_out), malloc(n * sizeof *x.of),
                       malloc(n * sizeof *x.weight)};
    const bool room = in != NULL && x.out != NULL && x.of != NULL && x.weight != NULL;
    if (room) {
        turn_rows(s, &x, in, out);
    }
    free(x.weight);
    free(x.of);
    gonio_stream_entries_free(x.out);
    gonio_stream_entries_free(in);
    return room ? gonio_stream_sound(s, error) : no_memory(error);
}

// ---- energy ----

static double albedo_of(const gonio_table *t, const gonio_samples *row) {
    double largest = -INFINITY;
    for (size_t c = 0; c < (size_t)row->channels; c++) {
        double sum = 0;
        for (size_t q = 0; q < t->n_out; q++) {
            sum += t->weight[q] * row->values[q * (size_t)row->channels + c];
        }
        largest = fmax(largest, sum);
    }
    return largest;
}

static gonio_status conserve(gonio_stream *s, const gonio_change *change, gonio_samples *row, FILE *out,
                             gonio_error *error) {
    const gonio_table *t = s->table;
    double worst = -INFINITY;
    for (size_t p = 0; change->one_scalar && p < t->n_in; p++) {
        gonio_stream_read(s, p, row, 0);
        worst = fmax(worst, albedo_of(t, row));
    }
    for (size_t p = 0; p < t->n_in; p++) {
        gonio_stream_read(s, p, row, 0);
        const double by = gonio_change_factor(change, change->one_scalar ? worst : albedo_of(t, row));
        for (size_t k = 0; k < t->n_out * s->channels; k++) {
            row->values[k] *= by;
            if (row->sigma_random != NULL) {
                row->sigma_random[k] *= by;
                row->sigma_systematic[k] *= by;
            }
        }
        put_row(s, out, p, row, 0);
    }
    return gonio_stream_sound(s, error);
}

// ---- separability ----

// Ring row r towards the products of channel c.
static void separate_row(const gonio_stream *s, const gonio_change *change, const gonio_products *p, size_t r, size_t c,
                         gonio_samples *row) {
    const double u = gonio_change_leverage(p->u, p->rows, p->k, r);
    for (size_t column = 0; column < s->table->columns; column++) {
        const size_t at = s->table->ring_out[column] * s->channels + c;
        double target = 0;
        for (size_t j = 0; j < p->k; j++) {
            target += p->value[j] * p->u[j * p->rows + r] * p->v[j * p->columns + column];
        }
        row->values[at] = gonio_change_between(change, row->values[at], target);
        if (row->sigma_random != NULL) {
            row->sigma_random[at] *=
                gonio_change_product_sigma(change, u, gonio_change_leverage(p->v, p->columns, p->k, column));
        }
    }
}

static gonio_status separate(gonio_stream *s, const gonio_change *change, gonio_samples *row, FILE *out,
                             gonio_error *error) {
    const gonio_table *t = s->table;
    const gonio_row_source a = {t->rows, t->columns, gonio_stream_channel_row, s};
    gonio_products *p = calloc(s->channels, sizeof *p);
    gonio_status status = p != NULL ? GONIO_OK : no_memory(error);
    for (s->channel = 0; s->channel < s->channels && status == GONIO_OK; s->channel++) {
        status = gonio_products_find(&a, (size_t)change->products, PASSES, &p[s->channel], error);
    }
    for (size_t k = 0; status == GONIO_OK && k < t->n_in; k++) {
        gonio_stream_read(s, k, row, 0);
        for (size_t c = 0; c < s->channels && k >= t->ring_in[0]; c++) {
            separate_row(s, change, &p[c], k - t->ring_in[0], c, row);
        }
        put_row(s, out, k, row, 0);
    }
    for (size_t c = 0; p != NULL && c < s->channels; c++) {
        gonio_products_free(&p[c]);
    }
    free(p);
    return status == GONIO_OK ? gonio_stream_sound(s, error) : status;
}

// ---- all ----

static gonio_status change_rows(gonio_stream *s, const gonio_change *change, FILE *out, gonio_error *error) {
    gonio_samples *row = gonio_stream_entries(s, s->table->n_out);
    fputs(s->head, out);
    const gonio_status status = row == NULL                                ? no_memory(error)
                                : change->kind == GONIO_CHANGE_RECIPROCITY ? make_reciprocal(s, change, out, error)
                                : change->kind == GONIO_CHANGE_ISOTROPY    ? make_isotropic(s, change, out, error)
                                : change->kind == GONIO_CHANGE_ENERGY      ? conserve(s, change, row, out, error)
                                                                           : separate(s, change, row, out, error);
    gonio_stream_entries_free(row);
    return status;
}

gonio_status gonio_check_stream_change(const char *path, const gonio_change *change, size_t memory, const char *out,
                                       gonio_error *error) {
    gonio_stream s = {0};
    gonio_output *output = NULL;
    gonio_status status = gonio_change_check(change, error);
    if (status == GONIO_OK && (change->kind == GONIO_CHANGE_MIRROR || change->kind == GONIO_CHANGE_CLAMP)) {
        status = gonio_fail(error, GONIO_E_USAGE, "%s is not done in passes", gonio_change_name(change->kind));
    }
    status = status == GONIO_OK ? gonio_stream_open(path, memory, &s, error) : status;
    status = status == GONIO_OK ? gonio_output_open(out, &output, error) : status;
    if (status == GONIO_OK) {
        status = change_rows(&s, change, gonio_output_stream(output), error);
        if (status == GONIO_OK) {
            status = gonio_output_commit(output, error);
        } else {
            gonio_output_abandon(output);
        }
    }
    gonio_stream_close(&s);
    return status;
}
