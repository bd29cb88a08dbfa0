// SPDX-License-Identifier: BSD-3-Clause
// The tabular form (Park and Lee 2015, eq. 1, 2).
#include "fit/bvb/table.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ON_NODE 1e-4 // of a step: farther from a node, a sample lies between nodes

gonio_status gonio_bvb_table_init(gonio_bvb_table *table, bool isotropic, int channels, int intervals,
                                  gonio_error *error) {
    const size_t theta = (size_t)intervals + 1, phi = 4 * (size_t)intervals + 1;
    *table = (gonio_bvb_table){
        .dims = isotropic ? 3 : 4, .channels = channels, .size = {theta, theta, phi, isotropic ? 1 : phi}};
    table->values = malloc(gonio_bvb_nodes(table) * (size_t)channels * sizeof *table->values);
    return table->values != NULL
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_MEMORY, "no memory for a table of %zu nodes and %d channels",
                            gonio_bvb_nodes(table), channels);
}

void gonio_bvb_table_release(gonio_bvb_table *table) {
    free(table->values);
    *table = (gonio_bvb_table){0};
}

static double angle(const gonio_bvb_table *t, int axis, size_t node) {
    const double turn = axis < GONIO_BVB_PHI_D ? GONIO_PI / 2 : 2 * GONIO_PI;
    return t->size[axis] > 1 ? turn * (double)node / (double)(t->size[axis] - 1) : 0;
}

gonio_pair gonio_bvb_table_pair(const gonio_bvb_table *t, const size_t node[GONIO_BVB_AXES]) {
    const double phi_i = angle(t, GONIO_BVB_PHI_I, node[GONIO_BVB_PHI_I]);
    return (gonio_pair){angle(t, GONIO_BVB_THETA_I, node[GONIO_BVB_THETA_I]), phi_i,
                        angle(t, GONIO_BVB_THETA_O, node[GONIO_BVB_THETA_O]),
                        phi_i + angle(t, GONIO_BVB_PHI_D, node[GONIO_BVB_PHI_D])};
}

static size_t index_of(const gonio_bvb_table *t, const size_t node[GONIO_BVB_AXES]) {
    return ((node[3] * t->size[0] + node[0]) * t->size[1] + node[1]) * t->size[2] + node[2];
}

static float stored(gonio_transform_kind kind, const gonio_transform *t, double value) {
    const double v = gonio_transform_apply(kind, t, value);
    return (float)fmin(fmax(v, -FLT_MAX / 1024), FLT_MAX / 1024); // sums of them are finite too
}

// ---- of a model ----

typedef struct filling {
    gonio_bvb_table *table;
    const gonio_model *model;
    gonio_transform_kind kind;
    const gonio_transform *transforms;
} filling;

// All azimuths of one theta_o.
static void fill_row(void *context, size_t row) {
    const filling *f = context;
    const gonio_bvb_table *t = f->table;
    const size_t n = t->size[GONIO_BVB_PHI_D], c = (size_t)t->channels;
    double values[c];
    size_t node[GONIO_BVB_AXES] = {row / t->size[1] % t->size[0], row % t->size[1], 0, row / t->size[1] / t->size[0]};
    for (size_t k = 0; k < n; k++) {
        node[GONIO_BVB_PHI_D] = k;
        const gonio_pair pair = gonio_bvb_table_pair(t, node);
        gonio_model_eval_pair(f->model, &pair, values);
        for (size_t b = 0; b < c; b++) {
            t->values[(row * n + k) * c + b] = stored(f->kind, &f->transforms[b], values[b]);
        }
    }
}

void gonio_bvb_table_of_model(gonio_bvb_table *table, const gonio_model *model, gonio_transform_kind kind,
                              const gonio_transform *transforms, int threads) {
    filling f = {table, model, kind, transforms};
    gonio_pool_for(threads, gonio_bvb_nodes(table) / table->size[GONIO_BVB_PHI_D], fill_row, &f);
}

// ---- of samples ----

static bool node_at(const gonio_bvb_table *t, int axis, double value, size_t *node) {
    const double whole = axis < GONIO_BVB_PHI_D ? GONIO_PI / 2 : 2 * GONIO_PI, last = (double)(t->size[axis] - 1);
    double turns = value / whole;
    turns = axis < GONIO_BVB_PHI_D ? turns : turns - floor(turns);
    const double at = round(turns * last);
    *node = (size_t)fmin(fmax(at, 0), last);
    return t->size[axis] == 1 || fabs(turns * last - at) < ON_NODE;
}

typedef struct sums {
    gonio_bvb_table *table;
    const gonio_samples *samples;
    double *sum;     // [nodes][channels]
    uint32_t *count; // [nodes]
} sums;

static void add_at(const sums *s, const size_t node[GONIO_BVB_AXES], size_t sample) {
    const size_t at = index_of(s->table, node), c = (size_t)s->table->channels;
    for (size_t k = 0; k < c; k++) {
        s->sum[at * c + k] += s->samples->values[sample * c + k];
    }
    s->count[at]++;
}

// At the node, at the other end of a closed azimuth, and at their mirror images.
static void add_sample(const sums *s, const size_t node[GONIO_BVB_AXES], size_t sample) {
    const size_t last = s->table->size[GONIO_BVB_PHI_D] - 1, k = node[GONIO_BVB_PHI_D];
    size_t at[GONIO_BVB_AXES];
    memcpy(at, node, sizeof at);
    const bool pole = s->samples->isotropic && (node[0] == 0 || node[1] == 0);
    for (at[2] = 0; pole && at[2] <= last; at[2]++) {
        add_at(s, at, sample);
    }
    const size_t places[2] = {k % last, s->samples->isotropic ? (last - k) % last : k % last};
    for (int m = 0; !pole && m < (places[0] != places[1] ? 2 : 1); m++) {
        at[2] = places[m];
        add_at(s, at, sample);
        at[2] = last;
        if (places[m] == 0) {
            add_at(s, at, sample);
        }
    }
}

// Both ends of phi_i are one: whatever lies at the first one is added to the last.
static void add_turned(const sums *s, size_t node[GONIO_BVB_AXES], size_t sample) {
    add_sample(s, node, sample);
    if (s->table->size[GONIO_BVB_PHI_I] > 1 && node[GONIO_BVB_PHI_I] % (s->table->size[GONIO_BVB_PHI_I] - 1) == 0) {
        node[GONIO_BVB_PHI_I] = s->table->size[GONIO_BVB_PHI_I] - 1 - node[GONIO_BVB_PHI_I];
        add_sample(s, node, sample);
    }
}

static bool take_samples(const sums *s, size_t most[2]) {
    const gonio_samples *samples = s->samples;
    for (size_t i = 0; i < samples->n; i++) {
        const gonio_pair *p = &samples->pairs[i];
        size_t node[GONIO_BVB_AXES];
        if (!node_at(s->table, 0, p->theta_i, &node[0]) || !node_at(s->table, 1, p->theta_o, &node[1]) ||
            !node_at(s->table, 2, p->phi_o - p->phi_i, &node[2]) || !node_at(s->table, 3, p->phi_i, &node[3])) {
            return false;
        }
        add_turned(s, node, i);
        most[0] = node[0] > most[0] ? node[0] : most[0];
        most[1] = node[1] > most[1] ? node[1] : most[1];
    }
    return true;
}

// Every node its own mean, or that of the nearest theta that was sampled.
static bool write_means(const sums *s, const size_t most[2], gonio_transform_kind kind,
                        const gonio_transform *transforms) {
    gonio_bvb_table *t = s->table;
    const size_t c = (size_t)t->channels;
    size_t node[GONIO_BVB_AXES], from[GONIO_BVB_AXES];
    for (size_t k = 0; k < gonio_bvb_nodes(t); k++) {
        node[2] = k % t->size[2];
        node[1] = k / t->size[2] % t->size[1];
        node[0] = k / t->size[2] / t->size[1] % t->size[0];
        node[3] = k / t->size[2] / t->size[1] / t->size[0];
        memcpy(from, node, sizeof from);
        from[0] = node[0] < most[0] ? node[0] : most[0];
        from[1] = node[1] < most[1] ? node[1] : most[1];
        const size_t at = index_of(t, from);
        if (s->count[at] == 0) {
            return false;
        }
        for (size_t b = 0; b < c; b++) {
            t->values[k * c + b] = stored(kind, &transforms[b], s->sum[at * c + b] / s->count[at]);
        }
    }
    return true;
}

bool gonio_bvb_table_of_samples(gonio_bvb_table *table, const gonio_samples *samples, gonio_transform_kind kind,
                                const gonio_transform *transforms) {
    const size_t nodes = gonio_bvb_nodes(table);
    size_t most[2] = {0, 0};
    sums s = {table, samples, NULL, NULL};
    s.sum = calloc(nodes * (size_t)table->channels, sizeof *s.sum);
    s.count = calloc(nodes, sizeof *s.count);
    const bool good =
        s.sum != NULL && s.count != NULL && take_samples(&s, most) && write_means(&s, most, kind, transforms);
    free(s.sum);
    free(s.count);
    return good;
}
