// SPDX-License-Identifier: BSD-3-Clause
#include "brdf/grid/grid.h"

#include <math.h>

#include "brdf/spline/bspline.h"

gonio_grid gonio_grid_of(gonio_grid_system system, int dims, int level) {
    gonio_grid grid = {.system = system, .dims = dims, .level = level, .count = 1};
    const size_t tilts = ((size_t)1 << level) + 1, turn = (size_t)2 << level;
    for (int d = 0; d < dims; d++) {
        grid.size[d] = gonio_grid_is_azimuth(&grid, d) && dims == 4 ? turn : tilts;
        grid.count *= grid.size[d]; // at most 2^39
    }
    return grid;
}

bool gonio_grid_is_azimuth(const gonio_grid *grid, int axis) {
    return axis == grid->dims - 1 || (grid->dims == 4 && axis == 1);
}

// ---- directions ----

// The azimuth as steps of a whole turn or, folded, of half of it.
static double turn_steps(const gonio_grid *grid, int axis, double azimuth) {
    const double part = azimuth / (2 * GONIO_PI);
    const double whole = part - floor(part), size = (double)grid->size[axis];
    return grid->dims == 3 ? 2 * fmin(whole, 1 - whole) * (size - 1) : whole * size;
}

static double azimuth_of(double x, double y) { return x != 0 || y != 0 ? atan2(y, x) : 0; }

void gonio_grid_locate(const gonio_grid *grid, gonio_vec3 wi, gonio_vec3 wo, double x[4]) {
    const int second = grid->dims - 2, last = grid->dims - 1; // the other tilt, the azimuth counted from the first's
    const double steps = (double)(grid->size[0] - 1);
    double first_azimuth, last_azimuth;
    if (grid->system == GONIO_GRID_ANGLES) {
        first_azimuth = gonio_direction_phi(wi);
        last_azimuth = gonio_direction_phi(wo) - first_azimuth;
        x[0] = fmin(gonio_direction_theta(wi) * (2 / GONIO_PI), 1) * steps;
        x[second] = fmin(gonio_direction_theta(wo) * (2 / GONIO_PI), 1) * steps;
    } else if (grid->dims == 3) {
        double h[3];
        gonio_coordinates_isotropic(GONIO_HALF_VECTOR, wi, wo, h);
        first_azimuth = 0;
        last_azimuth = azimuth_of(h[0] - 0.5, h[1] - 0.5);
        x[0] = fmin(2 * hypot(h[0] - 0.5, h[1] - 0.5), 1) * steps;
        x[second] = h[2] * steps;
    } else {
        double h[4];
        gonio_coordinates_anisotropic(GONIO_HALF_VECTOR, wi, wo, h);
        first_azimuth = azimuth_of(h[0] - 0.5, h[1] - 0.5);
        last_azimuth = azimuth_of(h[2] - 0.5, h[3] - 0.5) - first_azimuth;
        x[0] = fmin(2 * hypot(h[0] - 0.5, h[1] - 0.5), 1) * steps;
        x[second] = asin(fmin(2 * hypot(h[2] - 0.5, h[3] - 0.5), 1)) * (2 / GONIO_PI) * steps;
    }
    x[last] = turn_steps(grid, last, last_azimuth);
    if (grid->dims == 4) {
        x[1] = turn_steps(grid, 1, first_azimuth);
    }
}

static gonio_vec3 raised(gonio_vec3 w) {
    if (w.z >= 0) {
        return w;
    }
    const double length = hypot(w.x, w.y);
    return length > 0 ? (gonio_vec3){w.x / length, w.y / length, 0} : (gonio_vec3){1, 0, 0};
}

void gonio_grid_node(const gonio_grid *grid, size_t node, gonio_vec3 *wi, gonio_vec3 *wo) {
    const size_t *size = grid->size;
    const int last = grid->dims - 1, second = grid->dims - 2;
    size_t at[4] = {0};
    for (int d = last; d >= 0; d--) {
        at[d] = node % size[d];
        node /= size[d];
    }
    const double turn = 2 * GONIO_PI / (double)(grid->dims == 3 ? 2 * (size[last] - 1) : size[last]);
    const double first = (double)at[0] / (double)(size[0] - 1), other = (double)at[second] / (double)(size[second] - 1);
    const double phi = grid->dims == 4 ? turn * (double)at[1] : 0, delta = phi + turn * (double)at[last];
    if (grid->system == GONIO_GRID_ANGLES) {
        *wi = gonio_direction(first * (GONIO_PI / 2), phi);
        *wo = gonio_direction(other * (GONIO_PI / 2), delta);
        return;
    }
    double stretch, limit;
    gonio_coordinates_stretch(GONIO_HALF_VECTOR, &stretch, &limit);
    const gonio_vec3 h = gonio_direction(atan(stretch * sinh(first * limit)), phi);
    const gonio_vec3 d = gonio_direction(other * (GONIO_PI / 2), delta);
    // The shortest arc from +z to the half vector takes d to wi.
    const double along = d.x * h.x + d.y * h.y, k = d.z - along / (1 + h.z);
    const gonio_vec3 i = {d.x + h.x * k, d.y + h.y * k, d.z * h.z - along};
    *wi = raised(i);
    *wo = raised((gonio_vec3){2 * d.z * h.x - i.x, 2 * d.z * h.y - i.y, 2 * d.z * h.z - i.z});
}

// ---- between nodes ----

// The nodes of one axis; `over` lie beyond the pole.
typedef struct taps {
    int n;
    size_t index[4];
    double weight[4];
    bool over[4];
} taps;

static void add_tap(taps *t, size_t index, double weight, bool over) {
    t->index[t->n] = index;
    t->weight[t->n] = weight;
    t->over[t->n++] = over;
}

// At the horizon the control points go on in a straight line, so that the last of them is the spline's own value there.
static taps tilt_taps(size_t size, gonio_grid_degree degree, double x) {
    taps t = {0};
    const size_t cell = (size_t)fmin(x, (double)(size - 2));
    const double part = fmin(x - (double)cell, 1);
    if (degree == GONIO_GRID_LINEAR) {
        add_tap(&t, cell, 1 - part, false);
        add_tap(&t, cell + 1, part, false);
        return t;
    }
    double w[4];
    gonio_bspline_weights(part, w);
    if (cell + 2 == size) {
        w[2] += 2 * w[3];
        w[1] -= w[3];
        w[3] = 0;
    }
    add_tap(&t, cell > 0 ? cell - 1 : 1, w[0], cell == 0);
    add_tap(&t, cell, w[1], false);
    add_tap(&t, cell + 1, w[2], false);
    if (cell + 2 < size) {
        add_tap(&t, cell + 2, w[3], false);
    }
    return t;
}

static taps turn_taps(size_t size, bool folded, gonio_grid_degree degree, double x) {
    taps t = {0};
    const size_t around = folded ? 2 * (size - 1) : size, cell = (size_t)x % around;
    const double part = x - floor(x);
    double w[4] = {0, 1 - part, part, 0};
    if (degree == GONIO_GRID_CUBIC) {
        gonio_bspline_weights(part, w);
    }
    for (size_t k = 0; k < 4; k++) {
        const size_t at = (cell + around - 1 + k) % around;
        if (w[k] != 0) {
            add_tap(&t, folded && at >= size ? around - at : at, w[k], false);
        }
    }
    return t;
}

static size_t half_turn(size_t index, size_t size, bool folded) {
    return folded ? size - 1 - index : (index + size / 2) % size;
}

int gonio_grid_points(const gonio_grid *grid, gonio_grid_degree degree, const double x[4],
                      size_t nodes[GONIO_GRID_POINTS_MAX], double weights[GONIO_GRID_POINTS_MAX]) {
    const bool folded = grid->dims == 3;
    const size_t *size = grid->size, turns = size[grid->dims - 1];
    const taps a = tilt_taps(size[0], degree, x[0]), b = tilt_taps(size[grid->dims - 2], degree, x[grid->dims - 2]);
    const taps turn = turn_taps(turns, folded, degree, x[grid->dims - 1]);
    taps p = {.n = 1, .weight = {1}};
    if (!folded) {
        p = turn_taps(size[1], false, degree, x[1]);
    }
    int n = 0;
    for (int i = 0; i < a.n; i++) {
        for (int j = 0; j < p.n; j++) {
            const size_t azimuth = folded ? 0 : a.over[i] ? half_turn(p.index[j], size[1], false) : p.index[j];
            const size_t first = folded ? a.index[i] : a.index[i] * size[1] + azimuth;
            for (int k = 0; k < b.n; k++) {
                const size_t row = (first * size[grid->dims - 2] + b.index[k]) * turns;
                const double weight = a.weight[i] * p.weight[j] * b.weight[k];
                for (int l = 0; l < turn.n; l++) {
                    const size_t at = a.over[i] != b.over[k] ? half_turn(turn.index[l], turns, folded) : turn.index[l];
                    nodes[n] = row + at;
                    weights[n++] = weight * turn.weight[l];
                }
            }
        }
    }
    return n;
}

static int product(const taps *a, const taps *b, size_t size, size_t nodes[4], double weights[4]) {
    int n = 0;
    for (int i = 0; i < a->n; i++) {
        for (int j = 0; j < b->n; j++) {
            nodes[n] = a->index[i] * size + b->index[j];
            weights[n++] = a->weight[i] * b->weight[j];
        }
    }
    return n;
}

int gonio_grid_rows(const gonio_grid *grid, const double x[4], size_t rows[4], double weights[4]) {
    const taps tilt = tilt_taps(grid->size[0], GONIO_GRID_LINEAR, x[0]);
    const taps azimuth =
        grid->dims == 4 ? turn_taps(grid->size[1], false, GONIO_GRID_LINEAR, x[1]) : (taps){.n = 1, .weight = {1}};
    return product(&tilt, &azimuth, grid->dims == 4 ? grid->size[1] : 1, rows, weights);
}

int gonio_grid_columns(const gonio_grid *grid, const double x[4], size_t columns[4], double weights[4]) {
    const int last = grid->dims - 1;
    const taps tilt = tilt_taps(grid->size[last - 1], GONIO_GRID_LINEAR, x[last - 1]);
    const taps azimuth = turn_taps(grid->size[last], grid->dims == 3, GONIO_GRID_LINEAR, x[last]);
    return product(&tilt, &azimuth, grid->size[last], columns, weights);
}

size_t gonio_grid_beyond(const gonio_grid *grid, int tilt, size_t node) {
    const bool folded = grid->dims == 3;
    const size_t turns = grid->size[grid->dims - 1], at = node % turns;
    size_t beyond = node - at + half_turn(at, turns, folded);
    if (tilt == 0 && !folded) {
        const size_t inner = grid->size[2] * turns, azimuth = node / inner % grid->size[1];
        beyond = beyond - azimuth * inner + half_turn(azimuth, grid->size[1], false) * inner;
    }
    return beyond;
}
