// SPDX-License-Identifier: BSD-3-Clause
// Is what is drawn distributed as the density says? Pearson's chi-square over cells about the mirror direction, whose
// expected counts are integrals of the density.
#ifndef TESTS_SAMPLING_CHECK_H
#define TESTS_SAMPLING_CHECK_H

#include <math.h>
#include <string.h>

#include "base/random.h"
#include "brdf/sampler.h"

enum { SAMPLING_TURNS = 8, SAMPLING_RINGS = 8, SAMPLING_CELLS = SAMPLING_TURNS * SAMPLING_RINGS };

// A model as it stands, or a table made of it.
typedef struct sampling_source {
    const gonio_model *model;
    const gonio_sampler *table; // NULL: the model's own
} sampling_source;

static inline double sampling_draw(const sampling_source *s, gonio_vec3 wi, const double u[2], gonio_vec3 *wo) {
    return s->table != NULL ? gonio_sampler_sample(s->table, wi, u, wo) : gonio_model_sample(s->model, wi, u, wo, NULL);
}

static inline double sampling_pdf(const sampling_source *s, gonio_vec3 wi, gonio_vec3 wo) {
    return s->table != NULL ? gonio_sampler_pdf(s->table, wi, wo) : gonio_model_pdf(s->model, wi, wo);
}

// Polar coordinates in the disc about the mirror point: the turn from +x, and w with rho = (1 - (1 - w)^2)^power the
// part of the way to the circle: what stands beside the pole and what rises at the horizon are both resolved.
static inline double sampling_reach(gonio_vec3 wi, double turn, double *x, double *y) {
    *x = cos(turn);
    *y = sin(turn);
    const double along = -(wi.x * *x + wi.y * *y), s2 = wi.x * wi.x + wi.y * wi.y;
    return -along + sqrt(fmax(along * along + 1 - s2, 0));
}

static inline gonio_vec3 sampling_at(gonio_vec3 wi, double power, double turn, double w, double *area) {
    double x, y;
    const double reach = sampling_reach(wi, turn, &x, &y), base = 1 - (1 - w) * (1 - w), rho = pow(base, power);
    *area = reach * reach * rho * power * rho / base * 2 * (1 - w);
    const double px = reach * rho * x - wi.x, py = reach * rho * y - wi.y;
    return (gonio_vec3){px, py, sqrt(fmax(1 - px * px - py * py, 1e-30))};
}

static inline int sampling_cell(gonio_vec3 wi, double power, gonio_vec3 wo) {
    const double dx = wo.x + wi.x, dy = wo.y + wi.y;
    double x, y, turn = atan2(dy, dx);
    turn = turn < 0 ? turn + 2 * GONIO_PI : turn;
    const double rho = fmin(hypot(dx, dy) / fmax(sampling_reach(wi, turn, &x, &y), 1e-300), 1);
    const double w = 1 - sqrt(1 - pow(rho, 1 / power));
    const int i = (int)(turn / (2 * GONIO_PI) * SAMPLING_TURNS), j = (int)(w * SAMPLING_RINGS);
    return (i < SAMPLING_TURNS ? i : SAMPLING_TURNS - 1) +
           SAMPLING_TURNS * (j < SAMPLING_RINGS ? j : SAMPLING_RINGS - 1);
}

// The density's integral over each cell, fine x fine points in it; returns the sum.
static inline double sampling_expect(const sampling_source *s, gonio_vec3 wi, double power, int fine,
                                     double expected[SAMPLING_CELLS]) {
    const int turns = SAMPLING_TURNS * fine, rings = SAMPLING_RINGS * fine;
    double total = 0;
    memset(expected, 0, SAMPLING_CELLS * sizeof *expected);
    for (int j = 0; j < rings; j++) {
        for (int i = 0; i < turns; i++) {
            double area;
            const gonio_vec3 wo = sampling_at(wi, power, (i + 0.5) / turns * 2 * GONIO_PI, (j + 0.5) / rings, &area);
            const double share = sampling_pdf(s, wi, wo) / wo.z * area * 2 * GONIO_PI / turns / rings;
            expected[i / fine + SAMPLING_TURNS * (j / fine)] += share;
            total += share;
        }
    }
    return total;
}

// Chi-square of `count` draws as a standard normal deviate (Wilson and Hilferty 1931); cells that expect fewer than 8
// are taken together.
static inline double sampling_chi_square(const sampling_source *s, gonio_vec3 wi, double power, size_t count,
                                         uint64_t seed, const double expected[SAMPLING_CELLS]) {
    double counts[SAMPLING_CELLS] = {0}, chi = 0, rest = 0, rest_count = 0, cells = -1;
    for (size_t k = 0; k < count; k++) {
        const double u[2] = {gonio_random_next(&seed), gonio_random_next(&seed)};
        gonio_vec3 wo;
        sampling_draw(s, wi, u, &wo);
        counts[sampling_cell(wi, power, wo)]++;
    }
    for (int c = 0; c < SAMPLING_CELLS; c++) {
        const double e = expected[c] * (double)count;
        if (e < 8) {
            rest += e;
            rest_count += counts[c];
        } else {
            chi += (counts[c] - e) * (counts[c] - e) / e;
            cells++;
        }
    }
    if (rest > 0) {
        chi += (rest_count - rest) * (rest_count - rest) / fmax(rest, 1);
        cells++;
    }
    const double k = fmax(cells, 1), v = 2 / (9 * k);
    return (cbrt(chi / k) - (1 - v)) / sqrt(v);
}

#endif
