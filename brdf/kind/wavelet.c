// SPDX-License-Identifier: BSD-3-Clause
// A table as the few large ones of its wavelet coefficients, in all of its three or four dimensions: Lalonde,
// "Representations and uses of light distribution functions" (1997), as DeYoung (1996), section 3.2.7, tells of it. The
// transform is brdf/grid/lifting.c's, Haar's or the 5/3. What a file holds is the coefficients and their nodes'
// numbers; opening it puts the table together again, and evaluation is the table's: straight lines between nodes, or,
// since Haar's functions are constant from node to node, those too.
#include "brdf/kind/wavelet.h"

#include <stdlib.h>
#include <string.h>

#include "brdf/grid/grid_model.h"

typedef struct wavelet_model {
    gonio_grid_model base;
    gonio_wavelet wavelet;
    size_t keys;
    uint32_t *key;
    float *values;
    float *points; // [nodes][channels]
} wavelet_model;

static int locate(const wavelet_model *m, gonio_vec3 wi, gonio_vec3 wo, size_t *nodes, double *weights) {
    double x[4];
    gonio_grid_locate(&m->base.grid, wi, wo, x);
    return gonio_grid_points(&m->base.grid, GONIO_GRID_LINEAR, x, nodes, weights);
}

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const wavelet_model *m = (const wavelet_model *)model;
    size_t nodes[GONIO_GRID_POINTS_MAX];
    double weights[GONIO_GRID_POINTS_MAX], sums[model->channels];
    const int n = locate(m, wi, wo, nodes, weights);
    gonio_grid_sum(m->points, (size_t)model->channels, n, nodes, weights, sums);
    gonio_grid_invert(&m->base, sums, values);
}

static void release(gonio_model *model) {
    wavelet_model *m = (wavelet_model *)model;
    free(m->key);
    free(m->values);
    free(m->points);
    gonio_channels_free(&m->base.channels);
}

static gonio_status save(const gonio_model *model, FILE *stream, gonio_error *error) {
    const wavelet_model *m = (const wavelet_model *)model;
    const size_t channels = (size_t)model->channels;
    gonio_grid_description about = gonio_grid_describe(&m->base);
    about.own[0] = (uint32_t)m->wavelet;
    about.own[1] = (uint32_t)m->keys;
    const gonio_file_part parts[] = {{&about, sizeof about},
                                     {m->base.channels.transforms, channels * sizeof(gonio_transform)},
                                     {m->key, m->keys * sizeof *m->key},
                                     {m->values, m->keys * channels * sizeof *m->values}};
    return gonio_model_file_write(model, stream, parts, 4, error);
}

static const gonio_model_ops ops = {.kind = "wavelet", .eval = eval, .save = save, .free = release};

static gonio_status assemble(wavelet_model *m, gonio_error *error) {
    const size_t channels = (size_t)m->base.channels.head.channels, count = m->base.grid.count * channels;
    double *values = calloc(count, sizeof *values);
    m->points = malloc(count * sizeof *m->points);
    if (values == NULL || m->points == NULL) {
        free(values);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a table of %zu values", count);
    }
    for (size_t k = 0; k < m->keys; k++) {
        for (size_t c = 0; c < channels; c++) {
            values[m->key[k] * channels + c] = (double)m->values[k * channels + c];
        }
    }
    gonio_lifting_inverse(m->wavelet, &m->base.grid, channels, values);
    for (size_t k = 0; k < count; k++) {
        m->points[k] = (float)values[k];
    }
    free(values);
    return GONIO_OK;
}

// Copies the coefficients into a model that has its channels already.
static gonio_status fill(wavelet_model *m, gonio_wavelet wavelet, size_t keys, const uint32_t *key, const float *values,
                         gonio_error *error) {
    gonio_model *head = &m->base.channels.head;
    const size_t channels = (size_t)head->channels;
    m->wavelet = wavelet;
    m->keys = keys;
    m->key = malloc(keys * sizeof *key);
    m->values = malloc(keys * channels * sizeof *values);
    if (m->key == NULL || m->values == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu coefficients", keys);
    }
    memcpy(m->key, key, keys * sizeof *key);
    memcpy(m->values, values, keys * channels * sizeof *values);
    head->control_points = keys;
    head->bytes += m->base.grid.count * channels * sizeof *m->points;
    return assemble(m, error);
}

gonio_status gonio_wavelet_new(const gonio_wavelet_parts *p, gonio_model **out, gonio_error *error) {
    void *model;
    *out = NULL;
    gonio_status status = gonio_grid_model_new(sizeof(wavelet_model), &ops, &p->grid, p->channels, p->kind,
                                               p->transforms, p->names, &model, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = fill(model, p->wavelet, p->keys, p->key, p->values, error);
    if (status == GONIO_OK) {
        *out = model;
    } else {
        release(model);
    }
    return status;
}

static bool keys_possible(const uint32_t *key, size_t keys, size_t nodes) {
    bool possible = true;
    for (size_t k = 0; k < keys; k++) {
        possible = possible && key[k] < nodes && (k == 0 || key[k] > key[k - 1]);
    }
    return possible;
}

static gonio_status read_model(gonio_mapped *mapped, gonio_model **out, gonio_error *error) {
    const gonio_grid_description *about;
    void *model;
    size_t at = 0;
    gonio_status status = gonio_grid_model_read(mapped, sizeof(wavelet_model), &ops, &at, &about, &model, error);
    if (status != GONIO_OK) {
        return status;
    }
    wavelet_model *m = model;
    const size_t keys = about->own[1], keys_at = at, nodes = m->base.grid.count;
    const uint32_t *key = gonio_mapped_take(mapped, &at, keys * sizeof *key);
    const float *values =
        key != NULL ? gonio_mapped_take(mapped, &at, keys * (size_t)mapped->channels * sizeof *values) : NULL;
    if (about->own[0] >= GONIO_WAVELETS || keys == 0 || keys > nodes || nodes / keys > GONIO_WAVELET_NODES_PER_KEY) {
        status = gonio_mapped_fail(mapped, 0, "an unknown wavelet, or an impossible number of coefficients", error);
    } else if (values == NULL || !keys_possible(key, keys, nodes)) {
        status = gonio_mapped_fail(mapped, keys_at,
                                   "fewer coefficients than it says, or of nodes that are not ascending", error);
    } else {
        status = fill(m, (gonio_wavelet)about->own[0], keys, key, values, error);
    }
    if (status != GONIO_OK) {
        release(model);
        return status;
    }
    gonio_channels_adopt(&m->base.channels, mapped);
    *out = &m->base.channels.head;
    return GONIO_OK;
}

const gonio_kind gonio_kind_wavelet = {
    .name = "wavelet",
    .summary = "the largest wavelet coefficients of a table over a grid of angles",
    .ops = &ops,
    .read = read_model,
};
