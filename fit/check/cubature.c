// SPDX-License-Identifier: BSD-3-Clause
// Adaptive cubature: Genz & Malik, "An adaptive algorithm for numerical integration over an n-dimensional rectangular
// region" (1980), for n = 2: 17 points a panel, exact for degree 7, with an embedded rule of degree 5 whose difference
// estimates the error. The panel of the largest estimate is halved across the direction of its largest fourth
// difference.
#include "fit/check/cubature.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { POINTS = 17 };
// Weights for a panel of area 1, n = 2: centre, the near and the far points on the axes, far diagonals, near corners.
static const double rule7[5] = {(12824.0 - 9120 * 2 + 400 * 4) / 19683, 980.0 / 6561, (1820.0 - 400 * 2) / 19683,
                                200.0 / 19683, 6859.0 / 19683 / 4};
static const double rule5[4] = {(729.0 - 950 * 2 + 50 * 4) / 729, 245.0 / 486, (265.0 - 100 * 2) / 1458, 25.0 / 729};

typedef struct panel {
    double x, y, half_x, half_y, error;
    bool across; // halve x next
    double *sum; // [n], and behind it [n] the estimates of its errors
} panel;

typedef struct run {
    const gonio_cubature *c;
    panel *heap; // the largest error first
    size_t panels, room;
    double *work;  // [POINTS][n]
    double *scale; // [n] errors of each function count relative to it
} run;

static void measure(run *r, panel *p) {
    const gonio_cubature *c = r->c;
    const size_t n = c->n;
    const double near = sqrt(9.0 / 70), far = sqrt(9.0 / 10), corner = sqrt(9.0 / 19);
    const double at[POINTS][2] = {
        {0, 0},     {-near, 0},         {near, 0},         {0, -near},        {0, near},       {-far, 0},
        {far, 0},   {0, -far},          {0, far},          {-far, -far},      {-far, far},     {far, -far},
        {far, far}, {-corner, -corner}, {-corner, corner}, {corner, -corner}, {corner, corner}};
    static const int group[POINTS] = {0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3, 4, 4, 4, 4};
    for (int k = 0; k < POINTS; k++) {
        c->f(c->context, p->x + p->half_x * at[k][0], p->y + p->half_y * at[k][1], r->work + (size_t)k * n);
    }
    const double area = 4 * p->half_x * p->half_y, ratio = near * near / (far * far);
    double fourth[2] = {0, 0};
    p->error = 0;
    for (size_t j = 0; j < n; j++) {
        double seven = 0, five = 0, value[POINTS];
        for (int k = 0; k < POINTS; k++) {
            value[k] = r->work[(size_t)k * n + j];
            seven += rule7[group[k]] * value[k];
            five += group[k] < 4 ? rule5[group[k]] * value[k] : 0;
        }
        for (int d = 0; d < 2; d++) {
            fourth[d] += fabs(value[1 + 2 * d] + value[2 + 2 * d] - 2 * value[0] -
                              ratio * (value[5 + 2 * d] + value[6 + 2 * d] - 2 * value[0]));
        }
        p->sum[j] = area * seven;
        p->sum[n + j] = area * fabs(seven - five);
        p->error = fmax(p->error, p->sum[n + j] / r->scale[j]);
    }
    p->across = fourth[0] > fourth[1] || (fourth[0] == fourth[1] && p->half_x > p->half_y);
}

static void sink(panel *heap, size_t n, size_t at) {
    for (size_t child; (child = 2 * at + 1) < n; at = child) {
        child += child + 1 < n && heap[child + 1].error > heap[child].error;
        if (heap[at].error >= heap[child].error) {
            return;
        }
        const panel p = heap[at];
        heap[at] = heap[child];
        heap[child] = p;
    }
}

static void rise(panel *heap, size_t at) {
    for (; at > 0 && heap[at].error > heap[(at - 1) / 2].error; at = (at - 1) / 2) {
        const panel p = heap[at];
        heap[at] = heap[(at - 1) / 2];
        heap[(at - 1) / 2] = p;
    }
}

static void add(run *r, double x, double y, double half_x, double half_y) {
    panel *p = &r->heap[r->panels];
    double *sum = p->sum;
    *p = (panel){.x = x, .y = y, .half_x = half_x, .half_y = half_y, .sum = sum};
    measure(r, p);
    rise(r->heap, r->panels++);
}

static void halve_worst(run *r) {
    panel *p = r->heap;
    const double x = p->x, y = p->y;
    const double hx = p->across ? p->half_x / 2 : p->half_x, hy = p->across ? p->half_y : p->half_y / 2;
    const double dx = p->across ? hx : 0, dy = p->across ? 0 : hy;
    double *sum = p->sum;
    *p = (panel){.x = x - dx, .y = y - dy, .half_x = hx, .half_y = hy, .sum = sum};
    measure(r, p);
    sink(r->heap, r->panels, 0);
    add(r, x + dx, y + dy, hx, hy);
}

static double total(const run *r, double *integral) {
    double error = 0;
    memset(integral, 0, r->c->n * sizeof *integral);
    for (size_t k = 0; k < r->panels; k++) {
        error += r->heap[k].error;
        for (size_t j = 0; j < r->c->n; j++) {
            integral[j] += r->heap[k].sum[j];
        }
    }
    return error;
}

// The panels to begin with; their sums say how large each integral is. What is 1e-8 of the largest or less counts as
// rounding of it.
static void begin(run *r, double *integral) {
    const gonio_cubature *c = r->c;
    double most = 0;
    for (size_t j = 0; j < c->n; j++) {
        r->scale[j] = 1;
    }
    for (size_t i = 0; i + 1 < c->nx; i++) {
        for (size_t j = 0; j + 1 < c->ny; j++) {
            add(r, (c->x[i] + c->x[i + 1]) / 2, (c->y[j] + c->y[j + 1]) / 2, (c->x[i + 1] - c->x[i]) / 2,
                (c->y[j + 1] - c->y[j]) / 2);
        }
    }
    total(r, integral);
    for (size_t j = 0; j < c->n; j++) {
        most = fmax(most, fabs(integral[j]));
    }
    for (size_t j = 0; j < c->n; j++) {
        r->scale[j] = fmax(fabs(integral[j]), fmax(1e-8 * most, 1e-300));
    }
    for (size_t k = 0; k < r->panels; k++) {
        r->heap[k].error = 0;
        for (size_t j = 0; j < c->n; j++) {
            r->heap[k].error = fmax(r->heap[k].error, r->heap[k].sum[c->n + j] / r->scale[j]);
        }
        rise(r->heap, k);
    }
}

gonio_status gonio_cubature_run(const gonio_cubature *c, double *integral, double *error_left, gonio_error *error) {
    const size_t first = (c->nx - 1) * (c->ny - 1), room = c->most / POINTS > first ? c->most / POINTS : first;
    run r = {.c = c,
             .room = room,
             .heap = malloc(room * sizeof *r.heap),
             .work = malloc(POINTS * c->n * sizeof(double)),
             .scale = malloc(c->n * sizeof(double))};
    double *sums = malloc(2 * room * c->n * sizeof *sums);
    gonio_status status = GONIO_OK;
    if (r.heap == NULL || r.work == NULL || r.scale == NULL || sums == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to integrate %zu functions", c->n);
    } else {
        for (size_t k = 0; k < room; k++) {
            r.heap[k].sum = sums + 2 * k * c->n;
        }
        begin(&r, integral);
        // The sums are taken anew now and then: all panels' errors and integrals in the heap's order.
        double left = total(&r, integral);
        while (r.panels < room && left > c->tolerance) {
            for (size_t more = r.panels / 8 + 1; more > 0 && r.panels < room; more--) {
                halve_worst(&r);
            }
            left = total(&r, integral);
        }
        *error_left = left;
    }
    free(sums);
    free(r.scale);
    free(r.work);
    free(r.heap);
    return status;
}
