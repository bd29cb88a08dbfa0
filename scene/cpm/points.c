// SPDX-License-Identifier: BSD-3-Clause
#include "scene/cpm/points.h"

#include <math.h>
#include <stdlib.h>

#include "base/random.h"
#include "base/sobol.h"
#include "base/thread_pool.h"
#include "base/vector.h"

#define CHUNK 4096

static void places_of(uint32_t code, int *x, int *y) {
    *x = *y = 0;
    for (int bit = 0; bit < 16; bit++) {
        *x |= (int)(code >> (2 * bit) & 1) << bit;
        *y |= (int)(code >> (2 * bit + 1) & 1) << bit;
    }
}

uint32_t gonio_cpm_morton(uint32_t x, uint32_t y) {
    uint32_t code = 0;
    for (int bit = 0; bit < 16; bit++) {
        code |= (x >> bit & 1) << (2 * bit) | (y >> bit & 1) << (2 * bit + 1);
    }
    return code;
}

static double area_of(const scene_mesh *mesh, size_t t) {
    gonio_vec3 p[3];
    for (size_t k = 0; k < 3; k++) {
        const float *at = mesh->positions + 3 * (size_t)mesh->indices[3 * t + k];
        p[k] = (gonio_vec3){(double)at[0], (double)at[1], (double)at[2]};
    }
    const gonio_vec3 n = cross(difference(p[1], p[0]), difference(p[2], p[0]));
    return sqrt(dot(n, n)) / 2;
}

// Uniform over the triangle of two uniform numbers.
static void barycentric(double a, double b, cpm_point *p) {
    const double root = sqrt(a);
    p->u = (float)(root * (1 - b));
    p->v = (float)(root * b);
}

// The points lie evenly spaced along the triangles' areas, laid end to end; those of one triangle at Sobol's places.
static void scatter(const scene_mesh *mesh, uint64_t seed, double total, cpm_points *points) {
    double before = 0;
    size_t k = 0;
    for (size_t t = 0; t < mesh->triangles; t++) {
        before += area_of(mesh, t);
        const uint64_t own = gonio_random(seed + t);
        for (uint32_t i = 0; k < points->n && ((double)k + 0.5) / (double)points->n * total < before; i++, k++) {
            points->points[k].triangle = (uint32_t)t;
            barycentric(gonio_sobol(i, 0, own), gonio_sobol(i, 1, own), &points->points[k]);
        }
    }
    points->n = k;
}

typedef struct finding {
    const gonio_scene *scene;
    const cpm_surface *surface;
    cpm_points *points;
    int resolution;
} finding;

static uint32_t cell(double at, int resolution) {
    const double i = floor(at * resolution);
    return (uint32_t)fmax(0, fmin(i, resolution - 1));
}

void gonio_cpm_texture(const scene_mesh *mesh, size_t triangle, double u, double v, double *s, double *t) {
    *s = *t = 0;
    for (size_t k = 0; k < 3; k++) {
        const double weight = k == 0 ? 1 - u - v : k == 1 ? u : v;
        const float *uv = mesh->uvs + 2 * (size_t)mesh->indices[3 * triangle + k];
        *s += weight * (double)uv[0];
        *t += weight * (double)uv[1];
    }
}

// *near: a triangle of M_1 close by, such as the last point's.
static void find_texture(const finding *f, const cpm_point *p, size_t *near, double *s, double *t) {
    const double u = (double)p->u, v = (double)p->v;
    if (gonio_cpm_surface_has_file_charts(f->surface)) {
        gonio_cpm_texture(f->scene->mesh, p->triangle, u, v, s, t);
        return;
    }
    scene_hit hit;
    cpm_spot spot;
    gonio_scene_caster_surface(f->scene->caster, p->triangle, u, v, (gonio_vec3){0, 0, 1}, &hit);
    gonio_cpm_surface_nearest(f->surface, hit.point, *near, &spot);
    *near = spot.triangle;
    *s = spot.s;
    *t = spot.t;
}

static void find_texels(void *context, size_t item) {
    const finding *f = context;
    size_t near = 0;
    for (size_t k = item * CHUNK; k < f->points->n && k < (item + 1) * CHUNK; k++) {
        cpm_point *p = &f->points->points[k];
        double at[2];
        find_texture(f, p, &near, &at[0], &at[1]);
        p->s = (float)at[0];
        p->t = (float)at[1];
        p->texel = gonio_cpm_morton(cell(at[0], f->resolution), cell(at[1], f->resolution));
    }
}

// Within a texel in the order of the surface.
static int by_texel(const void *left, const void *right) {
    const cpm_point *a = left, *b = right;
    if (a->texel != b->texel) {
        return a->texel > b->texel ? 1 : -1;
    }
    if (a->triangle != b->triangle) {
        return a->triangle > b->triangle ? 1 : -1;
    }
    return a->u != b->u ? (a->u > b->u) - (a->u < b->u) : (a->v > b->v) - (a->v < b->v);
}

gonio_status gonio_cpm_points_new(const gonio_scene *scene, const cpm_surface *surface, size_t n, int resolution,
                                  int threads, uint64_t seed, cpm_points *points, gonio_error *error) {
    double total = 0;
    for (size_t t = 0; t < scene->mesh->triangles; t++) {
        total += area_of(scene->mesh, t);
    }
    *points = (cpm_points){.n = n, .points = malloc(n * sizeof *points->points), .area = total / (double)n};
    if (points->points == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu points", n);
    }
    finding f = {scene, surface, points, resolution};
    scatter(scene->mesh, seed, total, points);
    gonio_pool_for(threads, (points->n + CHUNK - 1) / CHUNK, find_texels, &f);
    qsort(points->points, points->n, sizeof *points->points, by_texel);
    return GONIO_OK;
}

void gonio_cpm_points_free(cpm_points *points) {
    free(points->points);
    points->points = NULL;
}

// The first point whose texel is not below this one.
static size_t lower(const cpm_points *points, uint64_t texel) {
    size_t low = 0, high = points->n;
    while (low < high) {
        const size_t middle = (low + high) / 2;
        if (points->points[middle].texel < texel) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

// ---- a texel's ----

// The runs of points that it needs: its own, or those of the three by three around it.
typedef struct reach {
    size_t first[9], n[9], total;
    int runs, x, y, side;
} reach;

static void find_reach(const cpm_points *points, gonio_cpm_filter filter, int level, uint32_t texel, reach *r) {
    const int wide = filter == GONIO_CPM_TENT ? 1 : 0;
    places_of(texel, &r->x, &r->y);
    for (int y = r->y - wide; y <= r->y + wide; y++) {
        for (int x = r->x - wide; x <= r->x + wide; x++) {
            if (x >= 0 && y >= 0 && x < r->side && y < r->side) {
                const uint64_t code = gonio_cpm_morton((uint32_t)x, (uint32_t)y);
                const size_t first = lower(points, code << (2 * level));
                r->first[r->runs] = first;
                r->n[r->runs] = lower(points, (code + 1) << (2 * level)) - first;
                r->total += r->n[r->runs++];
            }
        }
    }
}

static double tent(double x) { return fmax(0, 1 - fabs(x)); }

// The weight of the k-th of all its points.
static double weigh(const cpm_points *points, const reach *r, gonio_cpm_filter filter, size_t k, cpm_point *point) {
    int run = 0;
    while (k >= r->n[run]) {
        k -= r->n[run++];
    }
    *point = points->points[r->first[run] + k];
    return filter == GONIO_CPM_BOX
               ? 1
               : tent((double)point->s * r->side - r->x - 0.5) * tent((double)point->t * r->side - r->y - 0.5);
}

bool gonio_cpm_dense_new(const cpm_points *points, gonio_cpm_filter filter, int level, int resolution, uint32_t texel,
                         size_t most, cpm_dense *dense) {
    reach r = {.side = resolution >> level};
    find_reach(points, filter, level, texel, &r);
    const size_t looked = r.total < 4 * most ? r.total : 4 * most; // of a tent's some weigh nothing
    *dense = (cpm_dense){.points = malloc(looked * sizeof *dense->points + 1),
                         .areas = malloc(looked * sizeof *dense->areas + 1)};
    if (dense->points == NULL || dense->areas == NULL) {
        gonio_cpm_dense_free(dense);
        return false;
    }
    size_t found = 0;
    for (size_t k = 0; k < looked; k++) {
        const double weight = weigh(points, &r, filter, k * r.total / looked, &dense->points[found]);
        dense->areas[found] = weight * points->area * (double)r.total / (double)looked;
        found += weight > 0;
    }
    dense->n = found < most ? found : most;
    for (size_t k = 0; k < dense->n; k++) {
        dense->points[k] = dense->points[k * found / dense->n];
        dense->areas[k] = dense->areas[k * found / dense->n] * (double)found / (double)dense->n;
    }
    return true;
}

void gonio_cpm_dense_free(cpm_dense *dense) {
    free(dense->points);
    free(dense->areas);
    *dense = (cpm_dense){0};
}
