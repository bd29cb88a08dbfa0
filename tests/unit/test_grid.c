// SPDX-License-Identifier: BSD-3-Clause
// Grids of angles and what stands on them: nodes and places are inverse, nothing has an edge at poles and azimuths,
// splines go through their samples, wavelets come back, products of tables are the best ones, the tree finds the
// nearest.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "brdf/grid/lifting.h"
#include "brdf/kind/kernel.h"
#include "brdf/kind/separable.h"
#include "brdf/kind/table.h"
#include "fit/tables/low_rank.h"
#include "gonio/fit.h"
#include "tests/simulate.h"

static void nodes_lie_where_they_are_located(void **state) {
    (void)state;
    for (int system = 0; system < GONIO_GRIDS; system++) {
        for (int dims = 3; dims <= 4; dims++) {
            const gonio_grid grid = gonio_grid_of((gonio_grid_system)system, dims, 2);
            size_t met = 0;
            for (size_t node = 0; node < grid.count; node++) {
                gonio_vec3 wi, wo;
                size_t nodes[GONIO_GRID_POINTS_MAX];
                double x[4], weights[GONIO_GRID_POINTS_MAX];
                gonio_grid_node(&grid, node, &wi, &wo);
                if (wi.z < 1e-6 || wo.z < 1e-6) {
                    continue; // on the horizon, or moved to it
                }
                gonio_grid_locate(&grid, wi, wo, x);
                const int n = gonio_grid_points(&grid, GONIO_GRID_LINEAR, x, nodes, weights);
                double own = 0, all = 0;
                for (int k = 0; k < n; k++) {
                    gonio_vec3 i, o; // at a pole other nodes are the same pair
                    gonio_grid_node(&grid, nodes[k], &i, &o);
                    const double apart =
                        dims == 3 ? fabs(i.z - wi.z) + fabs(o.z - wo.z) +
                                        fabs(i.x * o.x + i.y * o.y - wi.x * wo.x - wi.y * wo.y)
                                  : fabs(i.x - wi.x) + fabs(i.y - wi.y) + fabs(o.x - wo.x) + fabs(o.y - wo.y);
                    own += apart < 1e-9 ? weights[k] : 0;
                    all += weights[k];
                }
                met++;
                if (fabs(own - 1) > 1e-6 || fabs(all - 1) > 1e-12) {
                    fail_msg("grid %d, %d-D, node %zu: weight %g of %g", system, dims, node, own, all);
                }
            }
            assert_true(met > grid.count / 4);
        }
    }
}

// A function that is smooth in directions, and even in y where it is isotropic.
static double smooth(gonio_vec3 wi, gonio_vec3 wo, int dims) {
    const double along = wi.x * wo.x + wi.y * wo.y, half = dims == 4 ? 0.2 * wi.x * wi.y + 0.1 * wo.x : 0;
    return 1 + 0.3 * wi.z + 0.4 * wo.z * wo.z + 0.5 * along + half;
}

static gonio_model *table_of(const gonio_grid *grid, gonio_grid_degree degree) {
    static const gonio_transform plain = {1, 0};
    static const char name[1][32] = {"y"};
    gonio_table_parts parts = {
        *grid, degree, 1, GONIO_TRANSFORM_LINEAR, &plain, name, malloc(grid->count * sizeof(float)), NULL};
    gonio_model *model;
    assert_non_null(parts.points);
    for (size_t node = 0; node < grid->count; node++) {
        gonio_vec3 wi, wo;
        gonio_grid_node(grid, node, &wi, &wo);
        parts.points[node] = (float)smooth(wi, wo, grid->dims);
    }
    assert_int_equal(gonio_table_new(&parts, &model, NULL), GONIO_OK);
    return model;
}

static void nothing_has_an_edge(void **state) {
    (void)state;
    uint64_t seed = 3;
    for (int form = 0; form < GONIO_GRIDS * 2 * 2; form++) {
        const gonio_grid grid = gonio_grid_of((gonio_grid_system)(form & 1), 3 + (form >> 1 & 1), 3);
        gonio_model *model = table_of(&grid, (gonio_grid_degree)(form >> 2));
        for (int k = 0; k < 200; k++) {
            const gonio_pair p = simulate_pair(&seed, 0);
            // Steps over the azimuth where it begins, over the pole of either direction, and over the mirror direction.
            const double e = 1e-6, phis[4] = {0, p.phi_o, p.phi_o, GONIO_PI};
            gonio_pair a = {p.theta_i, p.phi_i, p.theta_o, p.phi_i + phis[k % 4] - e}, b = a;
            b.phi_o += 2 * e;
            if (k % 4 == 1) {
                a.theta_o = b.theta_o = e;
                b.phi_o += GONIO_PI;
            } else if (k % 4 == 2) {
                a.theta_i = b.theta_i = e;
                b.phi_i += GONIO_PI;
                b.phi_o = a.phi_o;
            } else if (k % 4 == 3) {
                a.theta_o = b.theta_o = p.theta_i;
            }
            double one, two;
            gonio_model_eval_pair(model, &a, &one);
            gonio_model_eval_pair(model, &b, &two);
            // Through asinh(theta_h / 0.1) a step is 10 times as long.
            if (!(fabs(one - two) < 1e-3)) {
                fail_msg("form %d, step %d: %.9g and %.9g", form, k % 4, one, two);
            }
        }
        gonio_model_free(model);
    }
}

// Methods through the public door, filled by a fit that is exact for what it is given: the kernel with one neighbour.
static gonio_model *filled(const gonio_samples *samples, const char *method, int system, int level) {
    gonio_fit_options o;
    gonio_model *model;
    gonio_fit_options_default(&o);
    o.hold_out = 0;
    o.fill = "kernel";
    o.level = level;
    o.grid = system;
    o.method = method;
    assert_int_equal(gonio_fit(samples, &o, &model, NULL, NULL), GONIO_OK);
    return model;
}

static void check_spline(const gonio_samples *samples, int dims, int system) {
    const gonio_grid grid = gonio_grid_of((gonio_grid_system)system, dims, 6 - dims);
    gonio_model *table = filled(samples, "table", system, grid.level);
    gonio_model *spline = filled(samples, "interpolating-spline", system, grid.level);
    gonio_model *mesh = filled(samples, "control-mesh", system, grid.level);
    double apart = 0;
    for (size_t node = 0; node < grid.count; node++) {
        gonio_vec3 wi, wo;
        double a[2], b[2], c[2];
        gonio_grid_node(&grid, node, &wi, &wo);
        if (wi.z < 1e-6 || wo.z < 1e-6 || (wi.z > 0.999 && dims == 3) || wo.z > 0.999) {
            continue; // the kernel jumps between samples, so a pole's nodes need not agree to rounding
        }
        gonio_model_eval(table, wi, wo, a);
        gonio_model_eval(spline, wi, wo, b);
        gonio_model_eval(mesh, wi, wo, c);
        if (!(fabs(a[1] - b[1]) <= 1e-4 * a[1])) {
            fail_msg("grid %d, %d-D, node %zu: %.9g, the spline %.9g", system, dims, node, a[1], b[1]);
        }
        apart = fmax(apart, fabs(c[1] - a[1]));
    }
    assert_true(apart > 1e-3); // the control mesh does not
    gonio_model_free(table);
    gonio_model_free(spline);
    gonio_model_free(mesh);
}

static void splines_go_through_their_samples(void **state) {
    (void)state;
    for (int dims = 3; dims <= 4; dims++) {
        gonio_samples *samples = simulate_samples(dims == 3 ? "ward:rho_d=0.3,rho_s=0.2,alpha=0.3"
                                                            : "ward:rho_d=0.3,rho_s=0.2,alpha_x=0.2,alpha_y=0.4",
                                                  60, 2, 4);
        for (int system = 0; system < GONIO_GRIDS; system++) {
            check_spline(samples, dims, system);
        }
        gonio_samples_free(samples);
    }
}

static void wavelets_come_back(void **state) {
    (void)state;
    uint64_t seed = 5;
    for (int form = 0; form < GONIO_WAVELETS * 2 * 3; form++) {
        const gonio_wavelet wavelet = (gonio_wavelet)(form % GONIO_WAVELETS);
        const gonio_grid grid = gonio_grid_of(GONIO_GRID_ANGLES, 3 + form / GONIO_WAVELETS % 2, form / 4);
        double *v = malloc(2 * grid.count * sizeof *v), *was = malloc(2 * grid.count * sizeof *was);
        assert_true(v != NULL && was != NULL);
        for (size_t k = 0; k < 2 * grid.count; k++) {
            was[k] = v[k] = k % 2 == 0 ? simulate_uniform(&seed) : 0.75;
        }
        gonio_lifting_forward(wavelet, &grid, 2, v);
        for (size_t node = 0; node < grid.count; node++) { // of a constant all details are 0
            assert_true(gonio_lifting_step(&grid, node) > grid.level ? v[2 * node + 1] == 0.75
                                                                     : fabs(v[2 * node + 1]) < 1e-15);
        }
        gonio_lifting_inverse(wavelet, &grid, 2, v);
        for (size_t k = 0; k < 2 * grid.count; k++) {
            assert_true(fabs(v[k] - was[k]) < 1e-13);
        }
        free(v);
        free(was);
    }
}

// A matrix of known singular values: both the whole eigenproblem and the random one find them.
static void products_are_the_largest(void **state) {
    (void)state;
    static const size_t sizes[][2] = {{20, 50}, {300, 260}};
    for (size_t s = 0; s < 2; s++) {
        const size_t rows = sizes[s][0], columns = sizes[s][1], terms = 4;
        double *a = calloc(rows * columns, sizeof *a), *left = malloc(terms * rows * sizeof *left);
        double *right = malloc(terms * columns * sizeof *right), rest, expected = 0;
        for (int k = 0; k < 12; k++) { // sines are orthogonal over whole periods
            const double value = 100 * pow(0.5, k);
            for (size_t i = 0; i < rows * columns; i++) {
                const double x = ((double)(i / columns) + 0.5) / (double)rows,
                             y = ((double)(i % columns) + 0.5) / (double)columns;
                a[i] += value * 2 * cos(GONIO_PI * (k + 1) * x) * cos(GONIO_PI * (k + 1) * y) /
                        sqrt((double)(rows * columns));
            }
            expected += k >= (int)terms ? value * value : 0;
        }
        assert_int_equal(gonio_low_rank(rows, columns, a, terms, left, right, &rest, NULL), GONIO_OK);
        const double best = sqrt(expected / (double)(rows * columns));
        assert_true(rest > best * (1 - 1e-9) && rest < best * 1.0001);
        free(a);
        free(left);
        free(right);
    }
}

static double distance_of(const gonio_kernel_parts *parts, const gonio_pair *p, const gonio_pair *q) {
    double distance = 0;
    const gonio_vec3 a[2] = {gonio_direction(p->theta_i, p->phi_i), gonio_direction(p->theta_o, p->phi_o)};
    const gonio_vec3 b[2] = {gonio_direction(q->theta_i, q->phi_i), gonio_direction(q->theta_o, q->phi_o)};
    if (parts->distance == GONIO_DISTANCE_HALF_VECTOR) {
        double x[4] = {0}, y[4] = {0};
        if (parts->isotropic) {
            gonio_coordinates_isotropic(GONIO_HALF_VECTOR, a[0], a[1], x);
            gonio_coordinates_isotropic(GONIO_HALF_VECTOR, b[0], b[1], y);
            x[1] = fabs(x[1] - 0.5);
            y[1] = fabs(y[1] - 0.5);
        } else {
            gonio_coordinates_anisotropic(GONIO_HALF_VECTOR, a[0], a[1], x);
            gonio_coordinates_anisotropic(GONIO_HALF_VECTOR, b[0], b[1], y);
        }
        for (int d = 0; d < 4; d++) {
            distance += (x[d] - y[d]) * (x[d] - y[d]);
        }
    } else {
        const gonio_vec3 m = {b[1].x, parts->isotropic && a[1].y * b[1].y < 0 ? -b[1].y : b[1].y, b[1].z};
        distance = pow(a[0].x - b[0].x, 2) + pow(a[0].y - b[0].y, 2) + pow(a[0].z - b[0].z, 2) + pow(a[1].x - m.x, 2) +
                   pow(a[1].y - m.y, 2) + pow(a[1].z - m.z, 2);
    }
    return distance;
}

#define SAMPLES 257
#define NEAREST 5

// The value at p of a model of those samples alone that a look at all of them finds to be the nearest.
static double mean_of_nearest(const gonio_kernel_parts *parts, const gonio_pair *p) {
    double best[NEAREST], values[NEAREST], value;
    gonio_pair near[NEAREST];
    for (int at = 0; at < NEAREST; at++) {
        best[at] = INFINITY;
    }
    for (size_t k = 0; k < parts->n; k++) {
        const double distance = distance_of(parts, p, &parts->pairs[k]);
        int at = NEAREST;
        for (; at > 0 && distance < best[at - 1]; at--) {
            if (at < NEAREST) {
                best[at] = best[at - 1];
                near[at] = near[at - 1];
                values[at] = values[at - 1];
            }
        }
        if (at < NEAREST) {
            best[at] = distance;
            near[at] = parts->pairs[k];
            values[at] = parts->values[k];
        }
    }
    gonio_kernel_parts few = *parts;
    gonio_model *small;
    few.n = NEAREST;
    few.neighbours = NEAREST;
    few.pairs = near;
    few.values = values;
    assert_int_equal(gonio_kernel_model_new(&few, &small, NULL), GONIO_OK);
    gonio_model_eval_pair(small, p, &value);
    gonio_model_free(small);
    return value;
}

static void the_tree_finds_the_nearest(void **state) {
    (void)state;
    static const gonio_transform plain = {1, 0};
    static const char name[1][32] = {"y"};
    for (int form = 0; form < 4; form++) {
        gonio_pair pairs[SAMPLES];
        double values[SAMPLES];
        uint64_t seed = 6;
        for (int k = 0; k < SAMPLES; k++) {
            pairs[k] = simulate_pair(&seed, form & 1);
            values[k] = k;
        }
        const gonio_kernel_parts parts = {
            SAMPLES, pairs, values, (gonio_distance)(form >> 1), 1, form & 1, 1, GONIO_TRANSFORM_LINEAR, &plain, name};
        gonio_model *model;
        assert_int_equal(gonio_kernel_model_new(&parts, &model, NULL), GONIO_OK);
        for (int k = 0; k < SAMPLES; k++) { // the nearest to a sample is the sample
            double value;
            gonio_model_eval_pair(model, &pairs[k], &value);
            assert_true(value == values[k]);
        }
        gonio_kernel_model_set_neighbours(model, NEAREST);
        for (int q = 0; q < 100; q++) {
            const gonio_pair p = simulate_pair(&seed, form & 1);
            const double expected = mean_of_nearest(&parts, &p);
            double value;
            gonio_model_eval_pair(model, &p, &value);
            if (!(fabs(expected - value) < 1e-9)) {
                fail_msg("form %d, pair %d: %.12g, of all %.12g", form, q, value, expected);
            }
        }
        gonio_model_free(model);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nodes_lie_where_they_are_located), cmocka_unit_test(nothing_has_an_edge),
        cmocka_unit_test(splines_go_through_their_samples), cmocka_unit_test(wavelets_come_back),
        cmocka_unit_test(products_are_the_largest),         cmocka_unit_test(the_tree_finds_the_nearest),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
