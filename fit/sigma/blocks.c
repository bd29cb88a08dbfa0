// SPDX-License-Identifier: BSD-3-Clause
// Leave-out predictions of a linear smoother.
//
// With Q = lambda (K + lambda)^-1 and r = Q t, the residuals of a block B of samples predicted by a fit without them
// are e_B = (Q_BB)^-1 r_B, of variance (Q_BB)^-1 in units of the noise's (Rasmussen & Williams 2006, eq. 5.12, for a
// block instead of one sample). e_c = a^T t with a the row c of (Q_BB)^-1 Q_B, so |a|^2 is the noise in it, and the
// rest of its variance what the gap leaves unknown.
//
// A base of lobes was fitted to the same samples, robustly and beforehand, and stays as it is where a block is left
// out: the residuals are then those of the very predictor that the model is. Elsewhere its parameters count as
// regressors with a wide prior (Rasmussen & Williams 2006, section 2.7), so that the noise in them is part of N.
#include "fit/sigma/blocks.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/lobes/fit.h"
#include "fit/prepare/scatter.h"
#include "fit/prior/extend.h"
#include "fit/sigma/tuning.h"
#include "fit/smooth/matrix.h"

#define PARAMETERS_MAX (1 + 3 * GONIO_LOBES_MAX) // diffuse; each lobe's strength, width and f0
#define CENTRES 120                              // of blocks of a kind: their residuals are alike beyond that
#define BLOCK_MAX 400

void gonio_influence_release(gonio_influence *f) {
    free(f->map);
    free(f->square);
    free(f->residual);
    free(f->slopes);
    free(f->pulled);
    free(f->inverse);
    free(f->errors);
    *f = (gonio_influence){0};
}

// ---- the base's slopes ----

// The k-th parameter of the base times e^by.
static void shifted(const gonio_lobe_base *base, const double *strength, int k, double by, gonio_lobe_base *out,
                    double *row) {
    *out = *base;
    out->strength = row;
    memcpy(row, strength, (1 + GONIO_LOBES_MAX) * sizeof *row);
    if (k == 0) {
        row[0] *= exp(by);
        return;
    }
    const int lobe = (k - 1) / 3;
    double *value = (k - 1) % 3 == 0 ? &row[1 + lobe] : (k - 1) % 3 == 1 ? &out->alpha[lobe] : &out->f0[lobe];
    *value *= exp(by);
}

static size_t parameters(const gonio_smooth_base *base) {
    return base->lobes.lobes == 0 ? 0 : 1 + 3 * (size_t)base->lobes.lobes;
}

// out[parameter x n, pair fastest]: by central differences, of the middle channel.
static void base_slopes(const gonio_smooth_base *base, const gonio_dataset *data, size_t n, const gonio_pair *pairs,
                        double *out) {
    const size_t channel = (size_t)data->channels / 2;
    const double *strength = base->lobes.strength + channel * (1 + GONIO_LOBES_MAX), step = 0.01;
    for (size_t k = 0; k < parameters(base); k++) {
        gonio_lobe_base side[2];
        double row[2][1 + GONIO_LOBES_MAX];
        shifted(&base->lobes, strength, (int)k, step, &side[0], row[0]);
        shifted(&base->lobes, strength, (int)k, -step, &side[1], row[1]);
        for (size_t i = 0; i < n; i++) {
            const gonio_vec3 wi = gonio_direction(pairs[i].theta_i, pairs[i].phi_i);
            const gonio_vec3 wo = gonio_direction(pairs[i].theta_o, pairs[i].phi_o);
            double units[1 + GONIO_LOBES_MAX], t[2];
            for (int s = 0; s < 2; s++) {
                gonio_lobe_base_units(&side[s], wi, wo, units);
                t[s] = gonio_lobe_base_transformed(&side[s], row[s], units, data->kind, &data->transforms[channel]);
            }
            out[k * n + i] = (t[0] - t[1]) / (2 * step);
        }
    }
}

// ---- the map ----

// What it takes to let the base's parameters take part at other places.
static gonio_status add_slopes(gonio_influence *f, double doubt, gonio_error *error) {
    const size_t n = f->n, p = f->p;
    const gonio_matrix slopes = gonio_matrix_of(f->slopes, n, p), pulled = gonio_matrix_of(f->pulled, n, p);
    const gonio_matrix inverse = gonio_matrix_of(f->inverse, p, p);
    double work[PARAMETERS_MAX * PARAMETERS_MAX];
    gonio_multiply(1, gonio_matrix_of(f->map, n, n), slopes, 0, pulled);
    gonio_multiply(1, gonio_matrix_transposed(slopes), pulled, 0, inverse);
    for (size_t k = 0; k < p; k++) {
        f->inverse[k * p + k] += doubt * doubt;
    }
    if (!gonio_cholesky(p, f->inverse)) {
        return gonio_fail(error, GONIO_E_CONVERGENCE, "the uncertainty of the lobes was not found");
    }
    gonio_cholesky_invert(p, f->inverse, work);
    gonio_matrix_mirror(inverse);
    return GONIO_OK;
}

static gonio_status fill_residual(gonio_influence *f, gonio_error *error) {
    const size_t n = f->n, c = (size_t)f->data->channels;
    const double *root = gonio_smooth_dense_roots(f->dense);
    double *targets = malloc(n * c * sizeof *targets);
    if (targets == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 0; k < c; k++) {
            targets[k * n + i] = root[i] * f->base->rest[i * c + k];
        }
    }
    gonio_multiply(1, gonio_matrix_of(f->map, n, n), gonio_matrix_of(targets, n, c), 0,
                   gonio_matrix_of(f->residual, n, c));
    free(targets);
    return GONIO_OK;
}

static gonio_status fill_errors(gonio_influence *f, gonio_prior *prior, gonio_error *error) {
    const size_t measured = f->data->measured, places = f->n - measured;
    if (places == 0) {
        return GONIO_OK;
    }
    f->errors = malloc(places * GONIO_PRIOR_MATERIALS * sizeof *f->errors);
    if (f->errors == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    gonio_prior_errors(prior, f->data, f->errors);
    for (size_t i = 0; i < places * GONIO_PRIOR_MATERIALS; i++) {
        f->errors[i] *= gonio_smooth_dense_roots(f->dense)[measured + i % places];
    }
    return GONIO_OK;
}

static bool allocate(gonio_influence *f) {
    const size_t n = f->n, p = f->p > 0 ? f->p : 1;
    f->map = malloc(n * n * sizeof *f->map);
    f->square = malloc(n * n * sizeof *f->square);
    f->residual = malloc(n * (size_t)f->data->channels * sizeof *f->residual);
    f->slopes = malloc(n * p * sizeof *f->slopes);
    f->pulled = malloc(n * p * sizeof *f->pulled);
    f->inverse = malloc(p * p * sizeof *f->inverse);
    return f->map != NULL && f->square != NULL && f->residual != NULL && f->slopes != NULL && f->pulled != NULL &&
           f->inverse != NULL;
}

gonio_status gonio_influence_init(gonio_influence *f, const gonio_smooth_dense *dense, const gonio_dataset *data,
                                  const gonio_smooth_base *base, double lambda, double doubt, gonio_prior *prior,
                                  gonio_error *error) {
    *f = (gonio_influence){.dense = dense, .data = data, .base = base, .lambda = lambda, .n = data->n};
    f->p = parameters(base);
    gonio_status status = allocate(f) ? gonio_smooth_dense_influence(dense, lambda, f->map, error)
                                      : gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    if (status == GONIO_OK && f->p > 0) {
        const double *root = gonio_smooth_dense_roots(dense);
        base_slopes(base, data, f->n, data->pairs, f->slopes);
        for (size_t i = 0; i < f->n * f->p; i++) {
            f->slopes[i] *= root[i % f->n];
        }
        status = add_slopes(f, doubt, error);
    }
    if (status == GONIO_OK) {
        const gonio_matrix map = gonio_matrix_of(f->map, f->n, f->n), square = gonio_matrix_of(f->square, f->n, f->n);
        gonio_multiply_lower(1, map, map, 0, square);
        gonio_matrix_mirror(square);
        status = fill_residual(f, error);
    }
    status = status == GONIO_OK ? fill_errors(f, prior, error) : status;
    if (status != GONIO_OK) {
        gonio_influence_release(f);
    }
    return status;
}

// ---- left-out blocks ----

typedef struct blocks {
    const gonio_influence *f;
    const double *factor, *root;
    double *x; // n x dims
    gonio_sigma_records *records;
    double *matrix, *row; // of a block
    size_t *member;
    unsigned mirror_axes; // of x
} blocks;

// A prediction of a left-out sample. total: its variance in units of the noise's, of which `noise` is the samples'.
// residual, target: of each channel; target is what the base leaves to the spline; slope: what the spline misses of the
// base's slopes; all three times root weight.
typedef struct prediction {
    double total, noise, residual[GONIO_CHANNELS_MAX], target[GONIO_CHANNELS_MAX], slope[PARAMETERS_MAX];
} prediction;

static gonio_status add_record(const blocks *b, size_t centre, double weight, const prediction *p, gonio_error *error) {
    const size_t c = (size_t)b->f->data->channels;
    const double root = b->root[centre], square = root * root;
    double correction = 0, slopes = 0;
    gonio_sigma_record r = {.noise = p->noise / square, .weight = weight, .centre = centre};
    for (size_t k = 0; k < c; k++) {
        const double unit = root * b->factor[k], spline = (p->target[k] - p->residual[k]) / unit;
        r.square += p->residual[k] * p->residual[k] / (unit * unit * (double)c);
        correction += spline * spline / (double)c;
    }
    for (size_t k = 0; k < b->f->p; k++) {
        slopes += p->slope[k] * p->slope[k];
    }
    r.signs[GONIO_SIGMA_UNKNOWN] = fmax(p->total - p->noise, 0) / square;
    r.signs[GONIO_SIGMA_CORRECTION] = correction;
    r.signs[GONIO_SIGMA_SLOPES] = slopes / square;
    gonio_sigma_place(&b->f->data->pairs[centre], r.x);
    return gonio_sigma_records_add(b->records, &r, error);
}

// Predict member[0] from a fit without member[0..size-1].
static gonio_status leave_out(const blocks *b, size_t size, double weight, gonio_error *error) {
    const gonio_influence *f = b->f;
    const size_t n = f->n, c = (size_t)f->data->channels, centre = b->member[0];
    for (size_t i = 0; i < size; i++) {
        for (size_t j = 0; j <= i; j++) {
            b->matrix[j * size + i] = f->map[b->member[j] * n + b->member[i]];
        }
    }
    memset(b->row, 0, size * sizeof *b->row);
    b->row[0] = 1;
    if (!gonio_cholesky(size, b->matrix)) {
        return GONIO_OK; // rounding: samples so near each other that a gap among them tells nothing
    }
    gonio_cholesky_solve(size, b->matrix, gonio_matrix_of(b->row, size, 1));
    prediction p = {.total = b->row[0]};
    for (size_t j = 0; j < size; j++) {
        double sum = 0;
        for (size_t i = 0; i < size; i++) {
            sum += f->square[b->member[j] * n + b->member[i]] * b->row[i];
        }
        p.noise += sum * b->row[j];
        for (size_t k = 0; k < c; k++) {
            p.residual[k] += b->row[j] * f->residual[k * n + b->member[j]];
        }
        for (size_t k = 0; k < f->p; k++) {
            p.slope[k] += b->row[j] * f->pulled[k * n + b->member[j]];
        }
    }
    for (size_t k = 0; k < c; k++) {
        p.target[k] = b->root[centre] * f->base->rest[centre * c + k];
    }
    return add_record(b, centre, weight, &p, error);
}

typedef struct ranked {
    double key;
    size_t sample;
} ranked;

static int by_key(const void *left, const void *right) {
    const ranked *a = left, *b = right;
    if (a->key != b->key) {
        return a->key > b->key ? 1 : -1;
    }
    return (a->sample > b->sample) - (a->sample < b->sample);
}

static double distance2(const blocks *b, size_t i, size_t j) {
    const size_t d = (size_t)b->f->data->dims;
    return gonio_scatter_distance2(b->x + j * d, b->x + i * d, d, b->mirror_axes);
}

// Samples with all their neighbours, the nearest 4, 16, 64, 256 of them.
static gonio_status leave_neighbourhoods(const blocks *b, ranked *order, gonio_error *error) {
    const size_t n = b->f->data->measured, step = 1 + n / CENTRES;
    gonio_status status = GONIO_OK;
    for (size_t at = 0; at < n && status == GONIO_OK; at += step) {
        for (size_t i = 0; i < n; i++) {
            order[i] = (ranked){distance2(b, at, i), i};
        }
        qsort(order, n, sizeof *order, by_key);
        order[0].sample = at; // an equal place may have come first
        for (size_t i = 1; i < n; i++) {
            order[i].sample = order[i].sample == at ? i : order[i].sample;
        }
        for (size_t size = 4; size <= n / 3 && size <= BLOCK_MAX && status == GONIO_OK; size *= 4) {
            for (size_t i = 0; i < size; i++) {
                b->member[i] = order[i].sample;
            }
            status = leave_out(b, size, gonio_sigma_tuned.block, error);
        }
    }
    return status;
}

// What samples of a set kept in part leave to the spline, times root weights: out[n x channels], geometry fastest. The
// base is fitted anew to what is kept, as it would have been.
static gonio_status rest_without(const blocks *b, const bool *keep, double *out, gonio_error *error) {
    const gonio_influence *f = b->f;
    const size_t n = f->n, c = (size_t)f->data->channels;
    const gonio_lobe_base *lobes = &f->base->lobes;
    gonio_dataset part;
    gonio_lobe_base refitted = {0};
    double *values = malloc(n * c * sizeof *values);
    gonio_status status = values != NULL ? gonio_dataset_select(f->data, keep, &part, error)
                                         : gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    if (status == GONIO_OK && lobes->lobes > 0) {
        // Where no start leads anywhere the base stays.
        if (gonio_lobe_fit(&part, lobes->family, lobes->lobes, lobes, &refitted, NULL) == GONIO_OK) {
            refitted.cosine_min = lobes->cosine_min;
            gonio_lobe_targets(&refitted, f->data, values);
        }
        free(refitted.strength);
    }
    for (size_t i = 0; i < n * c && status == GONIO_OK; i++) {
        const double rest = refitted.lobes > 0 ? f->data->targets[i] - values[i] : f->base->rest[i];
        out[i % c * n + i / c] = b->root[i / c] * rest;
    }
    if (status == GONIO_OK) {
        gonio_dataset_release(&part);
    }
    free(values);
    return status;
}

// Records of member[0..size-1], all left out, whose targets are `rest`; work: 3 size^2 + 2 n channels.
static gonio_status predict_members(const blocks *b, size_t size, const double *rest, double *work,
                                    gonio_error *error) {
    const gonio_influence *f = b->f;
    const size_t n = f->n, c = (size_t)f->data->channels;
    double *inverse = work, *square = inverse + size * size, *both = square + size * size, *all = both + size * size;
    double *residual = all + n * c;
    gonio_multiply(1, gonio_matrix_of(f->map, n, n), gonio_matrix_of(rest, n, c), 0, gonio_matrix_of(all, n, c));
    for (size_t i = 0; i < size; i++) {
        for (size_t j = 0; j < size; j++) {
            inverse[j * size + i] = f->map[b->member[j] * n + b->member[i]];
            square[j * size + i] = f->square[b->member[j] * n + b->member[i]];
        }
        for (size_t k = 0; k < c; k++) {
            residual[k * size + i] = all[k * n + b->member[i]];
        }
    }
    if (!gonio_cholesky(size, inverse)) {
        return GONIO_OK; // as in leave_out
    }
    const gonio_matrix whole = gonio_matrix_of(inverse, size, size);
    gonio_cholesky_solve(size, inverse, gonio_matrix_of(residual, size, c));
    gonio_cholesky_invert(size, inverse, both);
    gonio_matrix_mirror(whole);
    gonio_multiply(1, whole, gonio_matrix_of(square, size, size), 0, gonio_matrix_of(both, size, size));
    gonio_status status = GONIO_OK;
    for (size_t i = 0; i < size && status == GONIO_OK; i++) {
        prediction p = {.total = inverse[i * size + i]};
        for (size_t j = 0; j < size; j++) {
            const double weight = inverse[i < j ? i * size + j : j * size + i];
            p.noise += both[j * size + i] * weight;
            for (size_t k = 0; k < f->p; k++) {
                p.slope[k] += weight * f->pulled[k * n + b->member[j]];
            }
        }
        for (size_t k = 0; k < c; k++) {
            p.residual[k] = residual[k * size + i];
            p.target[k] = rest[k * n + b->member[i]];
        }
        status = add_record(b, b->member[i], gonio_sigma_tuned.block, &p, error);
    }
    return status;
}

// All samples beyond an angle at once: what was never measured is mostly near the horizon, and there both the spline
// and the base go on without samples.
static gonio_status leave_beyond(const blocks *b, bool outgoing, size_t size, ranked *order, gonio_error *error) {
    const size_t n = b->f->n, c = (size_t)b->f->data->channels;
    double *work = malloc((3 * size * size + 3 * n * c) * sizeof *work);
    bool *keep = malloc(n * sizeof *keep);
    gonio_status status = GONIO_OK;
    if (work == NULL || keep == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    } else {
        const size_t measured = b->f->data->measured;
        memset(keep, true, n * sizeof *keep);
        for (size_t i = 0; i < measured; i++) {
            const gonio_pair *p = &b->f->data->pairs[i];
            order[i] = (ranked){-(outgoing ? p->theta_o : p->theta_i), i};
        }
        qsort(order, measured, sizeof *order, by_key);
        for (size_t i = 0; i < measured; i++) {
            keep[order[i].sample] = i >= size;
            b->member[i < size ? i : size - 1] = i < size ? order[i].sample : b->member[size - 1];
        }
        double *rest = work + 3 * size * size + 2 * n * c;
        status = rest_without(b, keep, rest, error);
        status = status == GONIO_OK ? predict_members(b, size, rest, work, error) : status;
    }
    free(work);
    free(keep);
    return status;
}

static gonio_status leave_all(const blocks *b, gonio_error *error) {
    const size_t n = b->f->data->measured;
    ranked *order = malloc(n * sizeof *order);
    if (order == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    gonio_status status = GONIO_OK;
    for (size_t i = 0; i < n && status == GONIO_OK; i++) {
        b->member[0] = i;
        status = leave_out(b, 1, 1, error);
    }
    b->records->near = b->records->n;
    status = status == GONIO_OK ? leave_neighbourhoods(b, order, error) : status;
    for (size_t share = 8; share >= 4 && status == GONIO_OK; share /= 2) {
        for (int side = 0; side < 2 && status == GONIO_OK; side++) {
            const size_t size = n / share < BLOCK_MAX ? n / share : BLOCK_MAX;
            status = size > 0 ? leave_beyond(b, side == 0, size, order, error) : GONIO_OK;
        }
    }
    free(order);
    return status;
}

gonio_status gonio_influence_records(const gonio_influence *f, const double *factor, gonio_sigma_records *records,
                                     gonio_error *error) {
    const size_t n = f->n, d = (size_t)f->data->dims;
    const gonio_smooth_form *form = gonio_smooth_dense_form(f->dense);
    *records = (gonio_sigma_records){0};
    for (int k = 0; k < GONIO_SIGMA_SIGNS; k++) {
        records->power[k] = gonio_sigma_tuned.power[k];
        records->spread[k] = gonio_sigma_tuned.spread;
    }
    blocks b = {.f = f, .factor = factor, .root = gonio_smooth_dense_roots(f->dense), .records = records};
    b.mirror_axes = form->mirror ? gonio_coordinates_mirror_axes(form->coordinates, f->data->dims) : 0;
    b.x = malloc(n * d * sizeof *b.x);
    b.matrix = malloc(((size_t)BLOCK_MAX * BLOCK_MAX + BLOCK_MAX) * sizeof *b.matrix);
    b.member = malloc(BLOCK_MAX * sizeof *b.member);
    gonio_status status;
    if (b.x == NULL || b.matrix == NULL || b.member == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    } else {
        b.row = b.matrix + (size_t)BLOCK_MAX * BLOCK_MAX;
        gonio_dataset_locate(f->data, form->coordinates, b.x);
        status = leave_all(&b, error);
    }
    free(b.x);
    free(b.matrix);
    free(b.member);
    if (status != GONIO_OK) {
        gonio_sigma_records_release(records);
    }
    return status;
}

// ---- elsewhere ----

// Let the base's parameters take part in the weights of m predictions; tell what the spline misses of the slopes.
static gonio_status add_base(const gonio_influence *f, size_t m, const gonio_pair *pairs, double *weights,
                             double *signs, gonio_error *error) {
    const size_t n = f->n, p = f->p;
    double *gap = malloc(3 * m * f->p * sizeof *gap);
    if (gap == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    double *pull = gap + m * f->p, *transposed = pull + m * f->p;
    base_slopes(f->base, f->data, m, pairs, transposed);
    for (size_t i = 0; i < m; i++) {
        for (size_t l = 0; l < f->p; l++) {
            gap[i * f->p + l] = transposed[l * m + i];
        }
    }
    // What the spline alone would make of the slopes is not the base's to explain.
    const gonio_matrix missed = gonio_matrix_of(gap, p, m), pulls = gonio_matrix_of(pull, p, m);
    const gonio_matrix all = gonio_matrix_of(weights, n, m);
    gonio_multiply(-1, gonio_matrix_transposed(gonio_matrix_of(f->slopes, n, p)), all, 1, missed);
    gonio_multiply(1, gonio_matrix_of(f->inverse, p, p), missed, 0, pulls);
    gonio_multiply(1, gonio_matrix_of(f->pulled, n, p), pulls, 1, all);
    for (size_t i = 0; i < m; i++) {
        signs[i * GONIO_SIGMA_SIGNS + GONIO_SIGMA_SLOPES] = gonio_dot(p, gap + i * p, gap + i * p);
    }
    free(gap);
    return GONIO_OK;
}

// The spline's mean square over channels, in the channels' factors.
static gonio_status square_spline(const gonio_influence *f, const double *factor, size_t m, const double *weights,
                                  double *signs, gonio_error *error) {
    const size_t n = f->n, c = (size_t)f->data->channels;
    const double *root = gonio_smooth_dense_roots(f->dense);
    double *target = malloc((n + m) * c * sizeof *target), *spline = target != NULL ? target + n * c : NULL;
    if (target == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 0; k < c; k++) {
            target[k * n + i] = root[i] * f->base->rest[i * c + k] / factor[k];
        }
    }
    gonio_multiply(1, gonio_matrix_transposed(gonio_matrix_of(weights, n, m)), gonio_matrix_of(target, n, c), 0,
                   gonio_matrix_of(spline, m, c));
    for (size_t i = 0; i < m; i++) {
        double sum = 0;
        for (size_t k = 0; k < c; k++) {
            sum += spline[k * m + i] * spline[k * m + i] / (double)c;
        }
        signs[i * GONIO_SIGMA_SIGNS + GONIO_SIGMA_CORRECTION] = sum;
    }
    free(target);
    return GONIO_OK;
}

// What the added places may be wrong by is alike at all of them, so each material's errors are passed on by themselves.
static gonio_status pass_on(const gonio_influence *f, double factor, size_t m, const double *weights, double *passed,
                            gonio_error *error) {
    const size_t places = f->n - f->data->measured;
    memset(passed, 0, m * sizeof *passed);
    if (places == 0) {
        return GONIO_OK;
    }
    double *off = malloc(m * GONIO_PRIOR_MATERIALS * sizeof *off);
    if (off == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    const gonio_matrix of_places =
        gonio_matrix_part(gonio_matrix_of(weights, f->n, m), f->data->measured, 0, places, m);
    gonio_multiply(1 / factor, gonio_matrix_transposed(gonio_matrix_of(f->errors, places, GONIO_PRIOR_MATERIALS)),
                   of_places, 0, gonio_matrix_of(off, GONIO_PRIOR_MATERIALS, m));
    for (size_t i = 0; i < m; i++) {
        passed[i] = gonio_prior_variance(off + i * GONIO_PRIOR_MATERIALS);
    }
    free(off);
    return GONIO_OK;
}

static double squared_length(const double *weights, size_t n) { return gonio_dot(n, weights, weights); }

gonio_status gonio_influence_at(const gonio_influence *f, const double *factor, size_t m, const gonio_pair *pairs,
                                const double *x, double *noise, double *signs, double *passed, gonio_error *error) {
    double *weights = malloc((f->n + GONIO_SMOOTH_SHARES) * m * sizeof *weights);
    if (weights == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    double *shares = weights + f->n * m;
    if (gonio_smooth_dense_form(f->dense)->shares) {
        gonio_smooth_shares(&f->base->lobes, f->data->channels, m, pairs, shares);
    }
    gonio_status status = gonio_smooth_dense_spread(f->dense, f->lambda, m, x, shares, weights, noise, error);
    for (size_t i = 0; i < m && status == GONIO_OK; i++) {
        double *at = signs + i * GONIO_SIGMA_SIGNS;
        at[GONIO_SIGMA_UNKNOWN] = fmax(noise[i] - squared_length(weights + i * f->n, f->n), 0);
        at[GONIO_SIGMA_SLOPES] = 0;
    }
    status = status == GONIO_OK ? square_spline(f, factor, m, weights, signs, error) : status;
    status = status == GONIO_OK && f->p > 0 ? add_base(f, m, pairs, weights, signs, error) : status;
    status = status == GONIO_OK ? pass_on(f, factor[f->data->channels / 2], m, weights, passed, error) : status;
    for (size_t i = 0; i < m && status == GONIO_OK; i++) {
        noise[i] = squared_length(weights + i * f->n, f->n);
    }
    free(weights);
    return status;
}
