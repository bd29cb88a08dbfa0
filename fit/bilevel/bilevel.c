// SPDX-License-Identifier: BSD-3-Clause
// From a scatter to the parts of a CBMBA model.
#include "fit/bilevel/bilevel.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/order_statistic.h"

// values -= the lattice, and the sparse one where there is one, at every sample.
static void subtract(const gonio_scatter *s, const gonio_lattice *lattice, const gonio_sparse *sparse, float *values) {
    enum { BATCH = 64 };
    const size_t c = (size_t)s->channels;
    gonio_position positions[BATCH] = {{{0}}};
    float at[BATCH * c];
    for (size_t begin = 0; begin < s->n; begin += BATCH) {
        const size_t n = s->n - begin < BATCH ? s->n - begin : BATCH;
        for (size_t i = 0; i < n; i++) {
            memcpy(positions[i].x, s->positions + (begin + i) * (size_t)s->dims, (size_t)s->dims * sizeof(uint32_t));
        }
        gonio_lattice_eval_positions(lattice, n, positions, at);
        for (size_t i = 0; i < n && sparse != NULL; i++) {
            gonio_sparse_add(sparse, &positions[i], at + i * c);
        }
        for (size_t i = 0; i < n * c; i++) {
            values[begin * c + i] -= at[i];
        }
    }
}

gonio_status gonio_bilevel_split(const gonio_scatter *scatter, const double *start, int diffuse_level, int first,
                                 int specular_level, int threads, gonio_lattice *diffuse, gonio_lattice *specular,
                                 gonio_error *error) {
    *diffuse = *specular = (gonio_lattice){0};
    const size_t values = scatter->n * (size_t)scatter->channels * sizeof(float);
    gonio_scatter residual = *scatter;
    residual.values = malloc(values);
    if (residual.values == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the residuals of %zu samples", scatter->n);
    }
    gonio_status status = gonio_mba_fit(scatter, start, diffuse_level, threads, diffuse, error);
    if (status == GONIO_OK) {
        memcpy(residual.values, scatter->values, values);
        subtract(scatter, diffuse, NULL, residual.values);
        status = gonio_mba_fit_from(&residual, first, specular_level, threads, specular, error);
    }
    free(residual.values);
    if (status != GONIO_OK) {
        gonio_lattice_release(diffuse);
    }
    return status;
}

static double magnitude(const gonio_lattice *l, size_t point) {
    float largest = 0;
    for (size_t c = 0; c < (size_t)l->channels; c++) {
        largest = fmaxf(largest, fabsf(l->points[point * (size_t)l->channels + c]));
    }
    return (double)largest;
}

// keep[i] for the (100 - percent) % largest control points, never for a zero; ties by index. *kept: how many.
static gonio_status choose_points(const gonio_lattice *l, double percent, bool *keep, size_t *kept,
                                  gonio_error *error) {
    const size_t quota = (size_t)llround((double)l->count * (1 - percent / 100));
    double *magnitudes = malloc(l->count * sizeof *magnitudes);
    if (magnitudes == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to rank %zu control points", l->count);
    }
    for (size_t i = 0; i < l->count; i++) {
        magnitudes[i] = magnitude(l, i);
    }
    const double limit = quota == 0 ? INFINITY : gonio_order_statistic(magnitudes, l->count, l->count - quota);
    size_t ties = quota; // places left for points that equal the limit
    for (size_t i = 0; i < l->count; i++) {
        ties -= magnitudes[i] > limit;
    }
    free(magnitudes);
    *kept = 0;
    for (size_t i = 0; i < l->count; i++) {
        const double m = magnitude(l, i);
        keep[i] = m > 0 && (m > limit || (m == limit && ties > 0));
        ties -= keep[i] && m == limit;
        *kept += keep[i];
    }
    return GONIO_OK;
}

static size_t brick_of(const gonio_lattice *l, size_t side, size_t point) {
    const size_t k = point % l->size, j = point / l->size % l->size, i = point / l->size / l->size;
    return (i / 4 * side + j / 4) * side + k / 4;
}

static size_t place_in_brick(const gonio_lattice *l, size_t point) {
    const size_t k = point % l->size, j = point / l->size % l->size, i = point / l->size / l->size;
    return (i % 4 * 4 + j % 4) * 4 + k % 4;
}

// Number the bricks that hold a kept point; 0 is the empty one.
static gonio_status number_bricks(const gonio_lattice *l, const bool *keep, gonio_sparse *s, gonio_error *error) {
    s->side = gonio_sparse_side(l->level);
    const size_t cells = s->side * s->side * s->side;
    uint16_t *table = calloc(cells, sizeof *table);
    s->table = table;
    if (table == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the table of bricks");
    }
    for (size_t i = 0; i < l->count; i++) {
        if (keep[i]) {
            table[brick_of(l, s->side, i)] = 1;
        }
    }
    size_t bricks = 1;
    for (size_t b = 0; b < cells; b++) {
        if (table[b] != 0) {
            if (bricks > UINT16_MAX) {
                return gonio_fail(error, GONIO_E_RANGE,
                                  "more than %d bricks hold control points: drop more, or store "
                                  "them as a hash",
                                  UINT16_MAX);
            }
            table[b] = (uint16_t)bricks++;
        }
    }
    s->bricks = bricks;
    return GONIO_OK;
}

static void encode(const gonio_sparse *s, const float *values) {
    // Const for those who evaluate; here the arrays are being filled.
    void *data = (void *)(uintptr_t)s->data;
    float *scales = (float *)(uintptr_t)s->scales;
    const size_t blocks = s->bricks * (size_t)s->channels;
    for (size_t b = 0; b < blocks; b++) {
        const float *from = values + b * GONIO_BRICK_POINTS;
        float largest = 0;
        for (size_t i = 0; i < GONIO_BRICK_POINTS; i++) {
            largest = fmaxf(largest, fabsf(from[i]));
        }
        const float scale = largest / 127;
        for (size_t i = 0; i < GONIO_BRICK_POINTS; i++) {
            const size_t at = b * GONIO_BRICK_POINTS + i;
            if (s->storage == GONIO_STORAGE_FLOAT) {
                ((float *)data)[at] = from[i];
            } else if (s->storage == GONIO_STORAGE_HALF) {
                ((uint16_t *)data)[at] = gonio_half_encode(from[i]);
            } else {
                ((int8_t *)data)[at] = (int8_t)(scale > 0 ? lrintf(from[i] / scale) : 0);
            }
        }
        if (scales != NULL) {
            scales[b] = scale;
        }
    }
}

// The control points of every brick in use, encoded.
static gonio_status fill_bricks(const gonio_lattice *l, const gonio_sparse *s, gonio_error *error) {
    const size_t c = (size_t)l->channels;
    float *values = calloc(s->bricks * c * GONIO_BRICK_POINTS, sizeof *values);
    if (values == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu bricks", s->bricks);
    }
    for (size_t i = 0; i < l->count; i++) {
        const size_t brick = s->table[brick_of(l, s->side, i)];
        for (size_t k = 0; k < c && brick > 0; k++) {
            values[(brick * c + k) * GONIO_BRICK_POINTS + place_in_brick(l, i)] = l->points[i * c + k];
        }
    }
    encode(s, values);
    free(values);
    return GONIO_OK;
}

static gonio_status pack_bricks(const gonio_lattice *l, const bool *keep, gonio_sparse *s, gonio_error *error) {
    const gonio_status status = number_bricks(l, keep, s, error);
    if (status != GONIO_OK) {
        return status;
    }
    const size_t blocks = s->bricks * (size_t)l->channels;
    s->data = malloc(blocks * GONIO_BRICK_POINTS * gonio_sparse_element(s->storage));
    s->scales = s->storage == GONIO_STORAGE_BYTE ? malloc(blocks * sizeof *s->scales) : NULL;
    if (s->data == NULL || (s->storage == GONIO_STORAGE_BYTE && s->scales == NULL)) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu bricks", s->bricks);
    }
    return fill_bricks(l, s, error);
}

static void put_key(const gonio_sparse *s, size_t slot, uint32_t key) {
    unsigned char *at = (unsigned char *)(uintptr_t)s->key + slot * (size_t)s->key_bytes;
    for (int b = 0; b < s->key_bytes; b++) {
        at[b] = (unsigned char)(key >> 8 * b);
    }
}

// The hash of the keys; it tells how many slots there are.
static gonio_status make_hash(const uint32_t *keys, size_t kept, gonio_sparse *s, gonio_error *error) {
    if (s->storage == GONIO_STORAGE_JENKINS) {
        unsigned char *moves;
        const gonio_status status = gonio_bilevel_jenkins(keys, kept, &s->jenkins, &moves, error);
        s->packed = moves;
        s->packed_length = s->jenkins.buckets;
        s->slots = s->jenkins.slots;
        return status;
    }
    void *packed = NULL;
    s->slots = kept;
    gonio_status status = kept > 0 ? gonio_bilevel_hash(keys, kept, &packed, &s->packed_length, error) : GONIO_OK;
    s->packed = packed;
    if (status == GONIO_OK && kept > 0 && !gonio_perfect_hash_unpack(packed, s->packed_length, &s->hash)) {
        status = gonio_fail(error, GONIO_E_FAILED, "libcmph's perfect hash has an unknown layout");
    }
    return status;
}

static gonio_status fill_slots(const gonio_lattice *l, const uint32_t *keys, size_t kept, gonio_sparse *s,
                               gonio_error *error) {
    const size_t c = (size_t)l->channels, bytes = gonio_sparse_key_array(s->key_bytes, s->slots);
    float *values = calloc(s->slots * c + 1, sizeof *values);
    unsigned char *key = malloc(bytes);
    s->key = key;
    s->values = values;
    if (key == NULL || values == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu hashed control points", kept);
    }
    memset(key, 0xff, bytes);
    for (size_t i = 0; i < kept; i++) {
        const size_t slot = s->storage == GONIO_STORAGE_JENKINS ? gonio_jenkins_search(&s->jenkins, keys[i])
                                                                : gonio_perfect_hash_search(&s->hash, keys[i]);
        put_key(s, slot, keys[i]);
        memcpy(values + slot * c, l->points + keys[i] * c, c * sizeof *values);
    }
    return GONIO_OK;
}

static gonio_status pack_hash(const gonio_lattice *l, const bool *keep, size_t kept, gonio_sparse *s,
                              gonio_error *error) {
    uint32_t *keys = malloc((kept + 1) * sizeof *keys);
    if (keys == NULL || l->count >= UINT32_MAX) {
        free(keys);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu hashed control points", kept);
    }
    size_t n = 0;
    for (size_t i = 0; i < l->count; i++) {
        if (keep[i]) {
            keys[n++] = (uint32_t)i;
        }
    }
    s->keys = kept;
    s->key_bytes = gonio_sparse_key_bytes(l->dims, l->level);
    gonio_status status = make_hash(keys, kept, s, error);
    status = status == GONIO_OK ? fill_slots(l, keys, kept, s, error) : status;
    free(keys);
    return status;
}

gonio_status gonio_bilevel_pack_points(const gonio_lattice *diffuse, const gonio_lattice *specular, const bool *keep,
                                       size_t kept, gonio_storage storage, gonio_bilevel_parts *parts,
                                       gonio_error *error) {
    *parts = (gonio_bilevel_parts){.diffuse_level = diffuse->level, .kept = kept};
    parts->sparse = (gonio_sparse){
        .dims = specular->dims, .level = specular->level, .channels = specular->channels, .storage = storage};
    const size_t bytes = diffuse->count * (size_t)diffuse->channels * sizeof(float);
    parts->diffuse = malloc(bytes);
    gonio_status status =
        parts->diffuse != NULL
            ? GONIO_OK
            : gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu diffuse control points", diffuse->count);
    if (status == GONIO_OK) {
        status = gonio_sparse_hashed(storage) ? pack_hash(specular, keep, kept, &parts->sparse, error)
                                              : pack_bricks(specular, keep, &parts->sparse, error);
    }
    if (status != GONIO_OK) {
        gonio_bilevel_parts_release(parts);
        return status;
    }
    memcpy(parts->diffuse, diffuse->points, bytes);
    return GONIO_OK;
}

gonio_status gonio_bilevel_pack(const gonio_lattice *diffuse, const gonio_lattice *specular, double drop_percent,
                                gonio_storage storage, gonio_bilevel_parts *parts, gonio_error *error) {
    size_t kept = 0;
    *parts = (gonio_bilevel_parts){0};
    bool *keep = malloc(specular->count * sizeof *keep);
    if (keep == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to rank %zu control points", specular->count);
    }
    gonio_status status = choose_points(specular, drop_percent, keep, &kept, error);
    status =
        status == GONIO_OK ? gonio_bilevel_pack_points(diffuse, specular, keep, kept, storage, parts, error) : status;
    free(keep);
    return status;
}

static gonio_lattice diffuse_of(const gonio_bilevel_parts *parts, int channels) {
    const int level = parts->diffuse_level;
    const int dims = parts->sparse.dims;
    return (gonio_lattice){dims,          level, channels, gonio_bspline_size(level), gonio_lattice_count(dims, level),
                           parts->diffuse};
}

// What the packed parts leave of the samples: a scatter that borrows all but its values, which the caller frees.
static gonio_status residuals(const gonio_bilevel_parts *parts, const gonio_scatter *scatter, gonio_scatter *residual,
                              gonio_error *error) {
    const gonio_lattice diffuse = diffuse_of(parts, scatter->channels);
    const size_t values = scatter->n * (size_t)scatter->channels * sizeof(float);
    *residual = *scatter;
    residual->values = malloc(values);
    if (residual->values == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the residuals of %zu samples", scatter->n);
    }
    memcpy(residual->values, scatter->values, values);
    subtract(scatter, &diffuse, &parts->sparse, residual->values);
    return GONIO_OK;
}

static gonio_status correct_diffuse(gonio_bilevel_parts *parts, const gonio_scatter *scatter, int threads,
                                    gonio_error *error) {
    gonio_scatter residual;
    gonio_lattice correction = {0};
    gonio_status status = residuals(parts, scatter, &residual, error);
    if (status == GONIO_OK) {
        status = gonio_mba_fit(&residual, NULL, parts->diffuse_level, threads, &correction, error);
    }
    for (size_t i = 0; status == GONIO_OK && i < correction.count * (size_t)correction.channels; i++) {
        parts->diffuse[i] += correction.points[i];
    }
    gonio_lattice_release(&correction);
    free(residual.values);
    return status;
}

static gonio_status correct_specular(gonio_bilevel_parts *parts, gonio_lattice *specular, const gonio_scatter *scatter,
                                     int threads, gonio_error *error) {
    gonio_scatter residual;
    gonio_lattice correction = {0};
    gonio_status status = residuals(parts, scatter, &residual, error);
    if (status == GONIO_OK) {
        status = gonio_mba_fit_from(&residual, specular->level, specular->level, threads, &correction, error);
    }
    for (size_t i = 0; status == GONIO_OK && i < specular->count * (size_t)specular->channels; i++) {
        specular->points[i] += correction.points[i];
    }
    gonio_lattice_release(&correction);
    free(residual.values);
    return status == GONIO_OK ? fill_bricks(specular, &parts->sparse, error) : status;
}

gonio_status gonio_bilevel_correct(gonio_bilevel_parts *parts, const gonio_lattice *specular,
                                   const gonio_scatter *scatter, int threads, gonio_error *error) {
    gonio_lattice master = *specular;
    const size_t bytes = specular->count * (size_t)specular->channels * sizeof(float);
    master.points = malloc(bytes);
    if (master.points == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to refine %zu control points", specular->count);
    }
    memcpy(master.points, specular->points, bytes);
    gonio_status status = correct_diffuse(parts, scatter, threads, error);
    status = status == GONIO_OK ? correct_specular(parts, &master, scatter, threads, error) : status;
    status = status == GONIO_OK ? correct_diffuse(parts, scatter, threads, error) : status;
    free(master.points);
    return status;
}
