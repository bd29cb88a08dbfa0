// SPDX-License-Identifier: BSD-3-Clause
// Held-out splits by unique geometry.
//
// Each geometry is quantised (1e-9 rad, far below any rig's pointing), hashed with the seed, and ranked by its hash; a
// fold is the rank modulo K. So a split depends on the geometries and the seed alone, not on the samples' order, and
// fold sizes differ by at most one geometry.
#include <math.h>
#include <stdlib.h>

#include "base/random.h"
#include "gonio/sample.h"

static uint64_t quantised(double angle) { return (uint64_t)llround(angle * 1e9); }

static double wrapped(double phi) { return remainder(phi, 2 * GONIO_PI); }

// Mirror images share a key: isotropic sets by |phi_o - phi_i|, anisotropic ones by the sign of the first azimuth.
static uint64_t geometry_key(const gonio_pair *p, bool isotropic, uint64_t seed) {
    double a = 0, b = 0;
    if (isotropic) {
        a = p->theta_i > 0 && p->theta_o > 0 ? fabs(wrapped(p->phi_o - p->phi_i)) : 0;
    } else {
        a = p->theta_i > 0 ? wrapped(p->phi_i) : 0;
        b = p->theta_o > 0 ? wrapped(p->phi_o) : 0;
        if (a < 0 || (a == 0 && b < 0)) {
            a = -a;
            b = -b;
        }
    }
    uint64_t key = gonio_random(seed);
    key = gonio_random(key ^ quantised(p->theta_i));
    key = gonio_random(key ^ quantised(p->theta_o));
    key = gonio_random(key ^ quantised(a));
    return gonio_random(key ^ quantised(b));
}

typedef struct ranked {
    uint64_t key;
    size_t sample;
} ranked;

static int by_key(const void *left, const void *right) {
    const ranked *a = left, *b = right;
    return (a->key > b->key) - (a->key < b->key);
}

// rank[i]: of sample i's geometry among the unique ones; *unique: how many there are.
static gonio_status rank_geometries(const gonio_samples *samples, uint64_t seed, size_t *rank, size_t *unique,
                                    gonio_error *error) {
    ranked *order = malloc((samples->n + 1) * sizeof *order);
    if (order == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to split %zu samples", samples->n);
    }
    for (size_t i = 0; i < samples->n; i++) {
        order[i] = (ranked){geometry_key(&samples->pairs[i], samples->isotropic, seed), i};
    }
    qsort(order, samples->n, sizeof *order, by_key);
    size_t count = 0;
    for (size_t i = 0; i < samples->n; i++) {
        count += i == 0 || order[i].key != order[i - 1].key;
        rank[order[i].sample] = count - 1;
    }
    free(order);
    *unique = count;
    return GONIO_OK;
}

gonio_status gonio_samples_folds(const gonio_samples *samples, int folds, uint64_t seed, int *fold,
                                 gonio_error *error) {
    if (folds < 2) {
        return gonio_fail(error, GONIO_E_USAGE, "%d folds; at least 2 are needed", folds);
    }
    size_t *rank = malloc((samples->n + 1) * sizeof *rank), unique;
    if (rank == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to split %zu samples", samples->n);
    }
    const gonio_status status = rank_geometries(samples, seed, rank, &unique, error);
    for (size_t i = 0; i < samples->n && status == GONIO_OK; i++) {
        fold[i] = (int)(rank[i] % (size_t)folds);
    }
    free(rank);
    return status;
}

gonio_status gonio_samples_hold_out(const gonio_samples *samples, double fraction, uint64_t seed, bool *held,
                                    gonio_error *error) {
    if (!(fraction >= 0 && fraction < 1)) {
        return gonio_fail(error, GONIO_E_USAGE, "hold-out fraction %g; it must be at least 0 and below 1", fraction);
    }
    size_t *rank = malloc((samples->n + 1) * sizeof *rank), unique;
    if (rank == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to split %zu samples", samples->n);
    }
    const gonio_status status = rank_geometries(samples, seed, rank, &unique, error);
    const size_t count = status == GONIO_OK ? (size_t)llround(fraction * (double)unique) : 0;
    for (size_t i = 0; i < samples->n && status == GONIO_OK; i++) {
        held[i] = rank[i] < count;
    }
    free(rank);
    return status;
}
