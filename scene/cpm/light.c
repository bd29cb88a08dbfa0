// SPDX-License-Identifier: BSD-3-Clause
// A texel's light toward the eye: the sum over its characteristic points of V(wi) V(wo) f_r (n.wi) (n.wo) times their
// weights, over the area that is seen (Wu, Dorsey and Rushmeier 2009, eq. 12); both visibilities on the original mesh.
// Most points face away or lie hidden or in shadow: what is costly waits until a point is known to shine.
#include <math.h>

#include "base/sobol.h"
#include "base/vector.h"
#include "scene/cpm/map.h"

#define CHUNK 64 // points at a time

typedef struct shining {
    const cpm_record_point *from;
    gonio_vec3 point, facet, start;
    cpm_place place;
    bool placed;
} shining;

typedef struct texel_light {
    const gonio_cpm *cpm;
    gonio_vec3 wo;
    int sky; // directions of an environment for each point
    uint64_t seed;
    uint32_t index; // of the next of those directions
    shining points[CHUNK];
    int n;
    double *rgb;
} texel_light;

// ---- rays toward lights ----

typedef struct beams {
    texel_light *texel;
    int n;
    shining *points[SCENE_CASTER_PACKET];
    gonio_vec3 starts[SCENE_CASTER_PACKET], toward[SCENE_CASTER_PACKET];
    double distances[SCENE_CASTER_PACKET], light[SCENE_CASTER_PACKET][3];
} beams;

static void receive(texel_light *t, shining *p, gonio_vec3 toward, const double light[3]) {
    double f[3];
    if (!p->placed) {
        gonio_cpm_place(t->cpm->scene, p->from->triangle, (double)p->from->u, (double)p->from->v, &p->place);
        p->placed = true;
    }
    gonio_cpm_apparent(t->cpm->scene, &p->place, toward, t->wo, f);
    for (int c = 0; c < 3; c++) {
        t->rgb[c] += f[c] * light[c] * (double)p->from->weight[c];
    }
}

static void flush(beams *b) {
    const unsigned stopped = b->n > 0 ? gonio_scene_caster_stopped_within(b->texel->cpm->scene->caster, b->n, b->starts,
                                                                          b->toward, b->distances)
                                      : 0;
    for (int k = 0; k < b->n; k++) {
        if ((stopped >> k & 1) == 0) {
            receive(b->texel, b->points[k], b->toward[k], b->light[k]);
        }
    }
    b->n = 0;
}

static void add(beams *b, shining *p, gonio_vec3 toward, double distance, const double light[3], double weight) {
    if (!(dot(p->facet, toward) > 0)) {
        return;
    }
    b->points[b->n] = p;
    b->starts[b->n] = p->start;
    b->toward[b->n] = toward;
    b->distances[b->n] = distance;
    for (int c = 0; c < 3; c++) {
        b->light[b->n][c] = light[c] * weight;
    }
    b->n++;
    if (b->n == SCENE_CASTER_PACKET) {
        flush(b);
    }
}

static void add_small_light(beams *b, shining *p, const scene_light_settings *light) {
    gonio_vec3 toward = {light->toward[0], light->toward[1], light->toward[2]};
    double distance = INFINITY, weight = 1;
    if (light->kind == SCENE_LIGHT_POINT) {
        toward = difference((gonio_vec3){light->position[0], light->position[1], light->position[2]}, p->point);
        distance = sqrt(dot(toward, toward));
        weight = distance > 0 ? 1 / (distance * distance) : 0;
        toward = scaled(toward, sqrt(weight));
    }
    add(b, p, toward, distance, light->intensity, weight);
}

// Directions of its own for each point, all of one stratified sequence.
static void add_sky(beams *b, shining *p) {
    texel_light *t = b->texel;
    for (int i = 0; i < t->sky; i++, t->index++) {
        const double u[2] = {gonio_sobol(t->index, 0, t->seed), gonio_sobol(t->index, 1, t->seed)};
        gonio_vec3 w;
        double radiance[3];
        const double pdf = gonio_world_environment_sample(t->cpm->scene->environment, u, &w, radiance);
        if (pdf > 0) {
            add(b, p, w, INFINITY, radiance, 1 / (pdf * t->sky));
        }
    }
}

static void light_points(texel_light *t) {
    const scene_settings *s = t->cpm->scene->settings;
    beams b = {.texel = t};
    for (int i = 0; i < s->lights; i++) {
        for (int k = 0; k < t->n && s->light[i].kind != SCENE_LIGHT_ENVIRONMENT; k++) {
            add_small_light(&b, &t->points[k], &s->light[i]);
        }
    }
    for (int k = 0; k < t->n && t->cpm->scene->environment != NULL; k++) {
        add_sky(&b, &t->points[k]);
    }
    flush(&b);
}

// ---- points that are seen ----

static gonio_vec3 corner(const scene_mesh *mesh, uint32_t triangle, size_t k) {
    const float *p = mesh->positions + 3 * (size_t)mesh->indices[3 * (size_t)triangle + k];
    return (gonio_vec3){(double)p[0], (double)p[1], (double)p[2]};
}

// false: it faces away.
static bool begin_point(const texel_light *t, const cpm_record_point *from, shining *p) {
    const scene_mesh *mesh = t->cpm->scene->mesh;
    const gonio_vec3 a = corner(mesh, from->triangle, 0), ab = difference(corner(mesh, from->triangle, 1), a),
                     ac = difference(corner(mesh, from->triangle, 2), a), across = cross(ab, ac);
    if (!(dot(across, t->wo) > 0)) {
        return false;
    }
    p->from = from;
    p->placed = false;
    p->facet = normalised(across);
    p->point = sum(a, sum(scaled(ab, (double)from->u), scaled(ac, (double)from->v)));
    p->start = gonio_scene_caster_leave(t->cpm->scene->caster, p->point, p->facet, p->facet);
    return true;
}

// Those that nothing hides from the eye stay.
static void keep_seen(texel_light *t) {
    gonio_vec3 starts[SCENE_CASTER_PACKET], toward[SCENE_CASTER_PACKET];
    int kept = 0;
    for (int first = 0; first < t->n; first += SCENE_CASTER_PACKET) {
        const int n = t->n - first < SCENE_CASTER_PACKET ? t->n - first : SCENE_CASTER_PACKET;
        for (int k = 0; k < n; k++) {
            starts[k] = t->points[first + k].start;
            toward[k] = t->wo;
        }
        const unsigned stopped = gonio_scene_caster_stopped(t->cpm->scene->caster, n, starts, toward);
        for (int k = 0; k < n; k++) {
            if ((stopped >> k & 1) == 0) {
                t->points[kept++] = t->points[first + k];
            }
        }
    }
    t->n = kept;
}

bool gonio_cpm_texel_light(const gonio_cpm *cpm, const cpm_record *record, gonio_vec3 eye, int sky, uint64_t seed,
                           double rgb[3]) {
    const gonio_vec3 centre = {(double)record->centre[0], (double)record->centre[1], (double)record->centre[2]};
    texel_light t = {.cpm = cpm,
                     .wo = normalised(difference(eye, centre)),
                     .sky = record->points > 0 ? (sky + (int)record->points - 1) / (int)record->points : 0,
                     .seed = seed,
                     .rgb = rgb};
    rgb[0] = rgb[1] = rgb[2] = 0;
    const double seen = gonio_cpm_area_of(gonio_cpm_record_coefficients(record), record->coefficients, record->scale,
                                          (int)cpm->store.head.side, t.wo);
    if (!(seen >= (double)record->floor) || !(seen > 0)) {
        return false;
    }
    const cpm_record_point *points = gonio_cpm_record_points(record);
    for (uint32_t k = 0; k < record->points; k++) {
        t.n += begin_point(&t, &points[k], &t.points[t.n]);
        if (t.n == CHUNK || (k + 1 == record->points && t.n > 0)) {
            keep_seen(&t);
            light_points(&t);
            t.n = 0;
        }
    }
    for (int c = 0; c < 3; c++) {
        rgb[c] /= seen;
    }
    return true;
}
