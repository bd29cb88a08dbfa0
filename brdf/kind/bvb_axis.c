// SPDX-License-Identifier: BSD-3-Clause
#include "brdf/kind/bvb_axis.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ORDER_MAX GONIO_BVB_ORDER_MAX

// De Boor's recurrence on polynomials: out[function][power] of the `order` functions that are not 0 between knots
// [k] and [k + 1], in s = (x - t_k) / (t_k+1 - t_k).
static void span_polynomials(const double *t, size_t k, int order, double out[ORDER_MAX][ORDER_MAX]) {
    const double length = t[k + 1] - t[k];
    memset(out, 0, sizeof(double[ORDER_MAX][ORDER_MAX]));
    out[0][0] = 1;
    for (int q = 2; q <= order; q++) {
        double next[ORDER_MAX][ORDER_MAX] = {{0}};
        for (int f = 0; f < q; f++) {
            // Function f of order q is number i = k - q + 1 + f; f - 1 and f of order q - 1 are i and i + 1.
            const double *left = t + k + f + 1 - q, *right = left + 1;
            for (int n = 0; n < q - 1; n++) {
                if (f > 0) {
                    const double a = out[f - 1][n] / (left[q - 1] - left[0]);
                    next[f][n] += (t[k] - left[0]) * a;
                    next[f][n + 1] += length * a;
                }
                if (f < q - 1) {
                    const double b = out[f][n] / (right[q - 1] - right[0]);
                    next[f][n] += (right[q - 1] - t[k]) * b;
                    next[f][n + 1] -= length * b;
                }
            }
        }
        memcpy(out, next, sizeof next);
    }
}

size_t gonio_bvb_basis(const double *knots, size_t count, int order, double x, double *basis) {
    const size_t p = (size_t)order;
    size_t k = p - 1;
    while (k + 1 < count && x >= knots[k + 1]) {
        k++;
    }
    double polynomials[ORDER_MAX][ORDER_MAX];
    span_polynomials(knots, k, order, polynomials);
    const double s = (x - knots[k]) / (knots[k + 1] - knots[k]);
    for (size_t f = 0; f < p; f++) {
        basis[f] = polynomials[f][order - 1];
        for (int n = order - 2; n >= 0; n--) {
            basis[f] = basis[f] * s + polynomials[f][n];
        }
    }
    return k + 1 - p;
}

static void *carve(unsigned char **at, size_t bytes) {
    void *block = *at;
    *at += (bytes + 63) / 64 * 64;
    return block;
}

static void fill_axis(const gonio_bvb_parts *p, int d, gonio_bvb_axis *a) {
    const size_t spans = gonio_bvb_spans(p, d);
    const double *t = p->knots[d] + p->order - 1;
    for (size_t k = 0; k < spans; k++) {
        double polynomials[ORDER_MAX][ORDER_MAX];
        a->begin[k] = t[k];
        a->inverse[k] = 1 / (t[k + 1] - t[k]);
        span_polynomials(p->knots[d], k + (size_t)p->order - 1, p->order, polynomials);
        for (int n = 0; n < 4; n++) {
            for (int f = 0; f < 4; f++) {
                const bool there = n < p->order && f < p->order;
                a->basis[4 * k + (size_t)n][f] = there ? (float)polynomials[f][n] : 0;
            }
        }
    }
    a->begin[spans] = INFINITY;
    for (size_t b = 0, k = 0; b < GONIO_BVB_BUCKETS; b++) {
        while (a->begin[k + 1] <= (double)b / GONIO_BVB_BUCKETS) {
            k++;
        }
        a->span[b] = (uint16_t)k;
    }
}

gonio_status gonio_bvb_axes_fill(const gonio_bvb_parts *p, gonio_bvb_axis axes[GONIO_BVB_AXES], gonio_error *error) {
    size_t bytes = 0;
    for (int d = 0; d < p->dims; d++) {
        bytes += gonio_bvb_spans(p, d) * (2 * sizeof(double) + 64) + GONIO_BVB_BUCKETS * sizeof(uint16_t) + 8 + 4 * 64;
    }
    unsigned char *at = aligned_alloc(64, (bytes + 63) / 64 * 64);
    if (at == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the knots of a B-spline volume");
    }
    for (int d = 0; d < p->dims; d++) {
        const size_t spans = gonio_bvb_spans(p, d);
        axes[d] = (gonio_bvb_axis){.begin = carve(&at, (spans + 1) * sizeof(double)),
                                   .inverse = carve(&at, spans * sizeof(double)),
                                   .basis = carve(&at, spans * 64),
                                   .span = carve(&at, GONIO_BVB_BUCKETS * sizeof(uint16_t))};
        fill_axis(p, d, &axes[d]);
    }
    return GONIO_OK;
}
