// SPDX-License-Identifier: BSD-3-Clause
// What is seen of a texel's points.
#include <math.h>
#include <stdlib.h>

#include "base/random.h"
#include "base/vector.h"
#include "scene/cpm/texel.h"

#define GOLDEN_ANGLE 2.399963229728653
// Directions from which less than this share of the largest area is seen decide nothing: 1 over the area would count
// their noise most.
#define AREA_FLOOR 0.02

void gonio_cpm_place(const gonio_scene *scene, uint32_t triangle, double u, double v, cpm_place *place) {
    const unsigned *corner = scene->mesh->indices + 3 * (size_t)triangle;
    gonio_vec3 p[3];
    for (size_t k = 0; k < 3; k++) {
        const float *at = scene->mesh->positions + 3 * (size_t)corner[k];
        p[k] = (gonio_vec3){(double)at[0], (double)at[1], (double)at[2]};
    }
    const gonio_vec3 across = cross(difference(p[1], p[0]), difference(p[2], p[0]));
    const gonio_vec3 facet = dot(across, across) > 0 ? normalised(across) : (gonio_vec3){0, 0, 1};
    scene_hit hit;
    gonio_scene_caster_surface(scene->caster, triangle, u, v, facet, &hit);
    gonio_world_place(scene, &hit, &place->place);
    place->start = gonio_scene_caster_leave(scene->caster, hit.point, hit.facet, hit.facet);
}

void gonio_cpm_apparent(const gonio_scene *scene, const cpm_place *place, gonio_vec3 wi, gonio_vec3 wo, double f[3]) {
    const world_place *p = &place->place;
    const double seen = dot(p->hit.facet, wo);
    gonio_vec3 i = gonio_world_local(p, wi), o = gonio_world_local(p, wo);
    f[0] = f[1] = f[2] = 0;
    if (!(seen > 0) || !(i.z > 0) || !(dot(p->hit.facet, wi) > 0)) {
        return;
    }
    if (o.z < 1e-3) { // a blended normal that turns away from the eye grazes it (caster.c)
        o.z = 1e-3;
        o = normalised(o);
    }
    gonio_world_eval(scene, p->material, i, o, f);
    for (int c = 0; c < 3; c++) {
        f[c] *= p->albedo[c] * i.z * seen;
    }
}

// Which of the points are seen from there; returns the area seen.
static double look(const gonio_scene *scene, const cpm_place *places, size_t points, const double *areas, gonio_vec3 w,
                   uint8_t *seen) {
    double total = 0;
    gonio_vec3 start[SCENE_CASTER_PACKET], direction[SCENE_CASTER_PACKET];
    size_t which[SCENE_CASTER_PACKET];
    int n = 0;
    for (size_t j = 0; j < points; j++) {
        const bool front = dot(places[j].place.hit.facet, w) > 0;
        seen[j] = 0;
        if (front) {
            start[n] = places[j].start;
            direction[n] = w;
            which[n++] = j;
        }
        if (n == SCENE_CASTER_PACKET || (j + 1 == points && n > 0)) {
            const unsigned stopped = gonio_scene_caster_stopped(scene->caster, n, start, direction);
            for (int k = 0; k < n; k++) {
                seen[which[k]] = (stopped >> k & 1) == 0;
                total += seen[which[k]] != 0 ? dot(places[which[k]].place.hit.facet, w) * areas[which[k]] : 0;
            }
            n = 0;
        }
    }
    return total;
}

double gonio_cpm_area_seen(const gonio_scene *scene, const cpm_place *places, size_t points, const double *areas,
                           gonio_vec3 w, uint8_t *room) {
    return look(scene, places, points, areas, w, room);
}

void gonio_cpm_views_free(cpm_views *views) {
    free(views->directions);
    free(views->seen);
    free(views->area);
}

// Of a spiral around the sphere, turned at random, those from which more than the floor could be seen if nothing stood
// in the way.
static size_t candidates(const cpm_place *places, size_t points, size_t n, uint64_t seed, gonio_vec3 *directions) {
    const size_t sphere = 4 * n, step = points / 64 + 1;
    const double shift = gonio_random_uniform(seed), roll = 2 * GONIO_PI * gonio_random_uniform(seed + 1);
    size_t found = 0;
    for (size_t k = 0; k < sphere; k++) {
        const double z = 1 - 2 * ((double)k + shift) / (double)sphere, sine = sqrt(fmax(0, 1 - z * z));
        const double angle = GOLDEN_ANGLE * (double)k + roll;
        const gonio_vec3 w = {sine * cos(angle), sine * sin(angle), z};
        double open = 0;
        for (size_t j = 0; j < points; j += step) {
            open += fmax(0, dot(places[j].place.hit.facet, w));
        }
        if (open > AREA_FLOOR * (double)(points / step + 1)) {
            directions[found++] = w;
        }
    }
    return found;
}

bool gonio_cpm_views_new(const gonio_scene *scene, const cpm_place *places, size_t points, const double *areas,
                         size_t n, uint64_t seed, cpm_views *views) {
    *views = (cpm_views){.points = points,
                         .directions = malloc(4 * n * sizeof *views->directions),
                         .seen = malloc(n * points + 1),
                         .area = malloc(n * sizeof *views->area)};
    if (views->directions == NULL || views->seen == NULL || views->area == NULL) {
        gonio_cpm_views_free(views);
        return false;
    }
    const size_t found = candidates(places, points, n, seed, views->directions);
    double largest = 0;
    for (size_t k = 0; k < (found < n ? found : n); k++) {
        const gonio_vec3 w = views->directions[found > n ? k * found / n : k];
        views->area[views->n] = look(scene, places, points, areas, w, views->seen + views->n * points);
        views->directions[views->n] = w;
        largest = fmax(largest, views->area[views->n]);
        views->n++;
    }
    size_t kept = 0;
    for (size_t k = 0; k < views->n; k++) {
        if (views->area[k] > AREA_FLOOR * largest) {
            views->area[kept] = views->area[k];
            views->directions[kept] = views->directions[k];
            for (size_t j = 0; j < points; j++) {
                views->seen[kept * points + j] = views->seen[k * points + j];
            }
            kept++;
        }
    }
    views->n = kept;
    return true;
}
