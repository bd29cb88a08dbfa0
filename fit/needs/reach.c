// SPDX-License-Identifier: BSD-3-Clause
// Which cells of a lattice any pair of directions lies in, and which of them a scene asks for.
//
// Coordinates fill a cube, pairs of directions do not: the corners about Nusselt's discs, and half and difference
// vectors that put one direction behind the surface, are nobody's. The maps are inverted (brdf/coordinates.c has them),
// and a cell is reachable where its middle or a place near one of its corners is a pair. (Corners
// themselves would count cells that pairs touch only.)
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "base/thread_pool.h"
#include "fit/needs/needs.h"

#define RIM 0.01 // of a cell: how near its corners

// A direction whose projection on the surface this is.
static bool rise(double x, double y, gonio_vec3 *w) {
    const double z2 = 1 - x * x - y * y;
    *w = (gonio_vec3){x, y, sqrt(fmax(z2, 0))};
    return z2 >= 0;
}

// The plane's offset from its two stretched coordinates.
static bool unstretch(gonio_coordinates system, const double *x, double out[2]) {
    double stretch, limit;
    gonio_coordinates_stretch(system, &stretch, &limit);
    const double u = 2 * x[0] - 1, v = 2 * x[1] - 1, r = sqrt(u * u + v * v);
    if (r > 1) {
        return false;
    }
    const double length = stretch * sinh(r * limit);
    out[0] = r > 0 ? length * u / r : 0;
    out[1] = r > 0 ? length * v / r : 0;
    return true;
}

// The shortest arc that takes +z to h, applied to d.
static gonio_vec3 carried(gonio_vec3 h, double x, double y, double z) {
    const double dot = x * h.x + y * h.y, k = z - dot / (1 + h.z);
    return (gonio_vec3){x + h.x * k, y + h.y * k, z * h.z - dot};
}

static bool half_vector_pair(gonio_coordinates system, bool isotropic, const double *x, gonio_vec3 *wi,
                             gonio_vec3 *wo) {
    double tilt[2], d[3];
    if (!unstretch(system, x, tilt)) {
        return false;
    }
    const double tangent = hypot(tilt[0], tilt[1]), cosine = 1 / sqrt(1 + tangent * tangent);
    gonio_vec3 h = {tilt[0] * cosine, tilt[1] * cosine, cosine};
    if (isotropic) {
        // The tilt's azimuth is the difference vector's about a half vector of azimuth 0.
        const double theta = x[2] * (GONIO_PI / 2);
        d[0] = tangent > 0 ? sin(theta) * tilt[0] / tangent : sin(theta);
        d[1] = tangent > 0 ? sin(theta) * tilt[1] / tangent : 0;
        d[2] = cos(theta);
        h = (gonio_vec3){tangent * cosine, 0, cosine};
    } else {
        d[0] = 2 * x[2] - 1;
        d[1] = 2 * x[3] - 1;
        const double z2 = 1 - d[0] * d[0] - d[1] * d[1];
        d[2] = sqrt(fmax(z2, 0));
        if (z2 < 0) {
            return false;
        }
    }
    *wi = carried(h, d[0], d[1], d[2]);
    *wo = carried(h, -d[0], -d[1], d[2]);
    return wi->z >= 0 && wo->z >= 0;
}

bool gonio_needs_pair_at(gonio_coordinates system, bool isotropic, const double *x, gonio_vec3 *wi, gonio_vec3 *wo) {
    if (gonio_coordinates_are_half_vector(system)) {
        return half_vector_pair(system, isotropic, x, wi, wo);
    }
    const double sine = 2 * x[0] - 1;
    if (isotropic ? sine < 0 || !rise(sine, 0, wi) : !rise(sine, 2 * x[1] - 1, wi)) {
        return false;
    }
    const double *out = x + (isotropic ? 1 : 2);
    if (system == GONIO_NUSSELT) {
        return rise(2 * out[0] - 1, 2 * out[1] - 1, wo);
    }
    double offset[2];
    return unstretch(system, out, offset) && rise(offset[0] - wi->x, offset[1] - wi->y, wo);
}

typedef struct counting {
    gonio_coordinates coordinates;
    bool isotropic;
    size_t side, layer; // cells of an axis, and those of one value of the first
    uint8_t *cells;     // bit 0: reachable, bit 1: asked for
} counting;

static bool is_reachable(const counting *c, size_t cell) {
    const int dims = c->isotropic ? 3 : 4;
    size_t at[4], rest = cell;
    for (int d = dims; d-- > 0; rest /= c->side) {
        at[d] = rest % c->side;
    }
    for (int k = -1; k < 1 << dims; k++) {
        double x[4];
        gonio_vec3 wi, wo;
        for (int d = 0; d < dims; d++) {
            const double within = k < 0 ? 0.5 : k >> d & 1 ? 1 - RIM : RIM;
            x[d] = ((double)at[d] + within) / (double)c->side;
        }
        if (gonio_needs_pair_at(c->coordinates, c->isotropic, x, &wi, &wo)) {
            return true;
        }
    }
    return false;
}

static void count_layer(void *context, size_t item) {
    counting *c = context;
    for (size_t i = item * c->layer; i < (item + 1) * c->layer; i++) {
        c->cells[i] = is_reachable(c, i) ? 1 : 0;
    }
}

// Marks the cell at x; a pair that is asked for is there, however thin the part of the cell that it lies in.
static void mark(const counting *c, const double *x) {
    size_t cell = 0;
    for (int d = 0; d < (c->isotropic ? 3 : 4); d++) {
        const size_t at = (size_t)(x[d] * (double)c->side);
        cell = cell * c->side + (at < c->side ? at : c->side - 1);
    }
    c->cells[cell] = 3;
}

static void ask(const counting *c, const gonio_need *need) {
    double x[4];
    if (!c->isotropic) {
        gonio_coordinates_anisotropic(c->coordinates, need->wi, need->wo, x);
        mark(c, x);
        return;
    }
    gonio_coordinates_isotropic(c->coordinates, need->wi, need->wo, x);
    mark(c, x);
    for (int d = 0; d < 3; d++) {
        x[d] = gonio_coordinates_mirror_axes(c->coordinates, 3) >> d & 1 ? 1 - x[d] : x[d];
    }
    mark(c, x);
}

gonio_status gonio_needs_count_cells(const gonio_needs *needs, int material, gonio_coordinates coordinates, int level,
                                     gonio_needs_count *count, gonio_error *error) {
    const needs_material *m = &needs->material[material];
    const int most = m->isotropic ? GONIO_NEEDS_LEVEL_MAX : 4;
    *count = (gonio_needs_count){0};
    if (level < 0 || level > most) {
        return gonio_fail(error, GONIO_E_RANGE, "cells of level %d; 0 to %d can be counted", level, most);
    }
    counting c = {.coordinates = coordinates, .isotropic = m->isotropic, .side = (size_t)1 << level};
    c.layer = c.side * c.side * (m->isotropic ? 1 : c.side);
    count->cells = c.layer * c.side;
    c.cells = malloc(count->cells);
    if (c.cells == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu cells", count->cells);
    }
    gonio_pool_for(0, c.side, count_layer, &c);
    for (size_t i = 0; i < m->cells; i++) {
        ask(&c, &m->cell[i]);
    }
    for (size_t i = 0; i < count->cells; i++) {
        count->reachable += c.cells[i] & 1;
        count->asked += c.cells[i] >> 1;
    }
    free(c.cells);
    return GONIO_OK;
}
