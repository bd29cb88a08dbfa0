// SPDX-License-Identifier: BSD-3-Clause
#include "scene/cpm/map.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/sobol.h"
#include "base/vector.h"

gonio_status gonio_cpm_open(const char *folder, const gonio_scene *scene, gonio_cpm **out, gonio_error *error) {
    *out = NULL;
    gonio_cpm *cpm = calloc(1, sizeof *cpm);
    if (cpm == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a map");
    }
    cpm->scene = scene;
    gonio_status status = gonio_cpm_store_open(folder, &cpm->store, error);
    if (status == GONIO_OK && cpm->store.head.scene != gonio_cpm_scene_fingerprint(scene)) {
        status = gonio_fail_line(error, GONIO_E_INPUT, folder, -1,
                                 "the map is of other meshes or materials than the scene's");
    }
    if (status != GONIO_OK) {
        gonio_cpm_free(cpm);
        return status;
    }
    cpm->most_points = cpm->store.head.most_points;
    *out = cpm;
    return GONIO_OK;
}

void gonio_cpm_free(gonio_cpm *cpm) {
    if (cpm != NULL) {
        gonio_cpm_store_release(&cpm->store);
        free(cpm);
    }
}

void gonio_cpm_describe(const gonio_cpm *cpm, gonio_cpm_facts *facts) { *facts = cpm->store.head.facts; }

// ---- a texel's light ----

// Points a packet at a time.
typedef struct packet {
    const gonio_cpm *cpm;
    const cpm_record_point *points;
    int n;
    cpm_place places[SCENE_CASTER_PACKET];
    gonio_vec3 wo;
    unsigned seen;
    double *rgb;
} packet;

// Light that comes to each point from its own direction, `distance` away.
static void add_light(packet *p, const gonio_vec3 *toward, const double (*light)[3], unsigned open) {
    for (int k = 0; k < p->n; k++) {
        double f[3];
        if ((open >> k & 1) == 0) {
            continue;
        }
        gonio_cpm_apparent(p->cpm->scene, &p->places[k], toward[k], p->wo, f);
        for (int c = 0; c < 3; c++) {
            p->rgb[c] += f[c] * light[k][c] * (double)p->points[k].weight[c];
        }
    }
}

// Which of the points that are seen face a direction and have nothing in their way.
static unsigned open_toward(const packet *p, const gonio_vec3 *toward, const double *distance) {
    const scene_caster *caster = p->cpm->scene->caster;
    gonio_vec3 origins[SCENE_CASTER_PACKET], directions[SCENE_CASTER_PACKET];
    int which[SCENE_CASTER_PACKET], n = 0;
    unsigned open = 0;
    for (int k = 0; k < p->n; k++) {
        const world_place *place = &p->places[k].place;
        if ((p->seen >> k & 1) == 0 || !(dot(place->hit.facet, toward[k]) > 0)) {
            continue;
        }
        if (distance != NULL) {
            open |= (unsigned)!gonio_scene_caster_blocked(caster, place->hit.point, place->hit.facet, toward[k],
                                                          distance[k])
                    << k;
            continue;
        }
        origins[n] = p->places[k].start;
        directions[n] = toward[k];
        which[n++] = k;
    }
    const unsigned stopped = n > 0 ? gonio_scene_caster_stopped(caster, n, origins, directions) : 0;
    for (int i = 0; i < n; i++) {
        open |= (unsigned)((stopped >> i & 1) == 0) << which[i];
    }
    return open;
}

static void add_small_light(packet *p, const scene_light_settings *light) {
    gonio_vec3 toward[SCENE_CASTER_PACKET];
    double distance[SCENE_CASTER_PACKET], strength[SCENE_CASTER_PACKET][3];
    const bool point = light->kind == SCENE_LIGHT_POINT;
    for (int k = 0; k < p->n; k++) {
        double weight = 1;
        toward[k] = (gonio_vec3){light->toward[0], light->toward[1], light->toward[2]};
        if (point) {
            const gonio_vec3 at = {light->position[0], light->position[1], light->position[2]};
            const gonio_vec3 way = difference(at, p->places[k].place.hit.point);
            distance[k] = sqrt(dot(way, way));
            weight = distance[k] > 0 ? 1 / (distance[k] * distance[k]) : 0;
            toward[k] = scaled(way, sqrt(weight));
        }
        for (int c = 0; c < 3; c++) {
            strength[k][c] = light->intensity[c] * weight;
        }
    }
    add_light(p, toward, (const double(*)[3])strength, open_toward(p, toward, point ? distance : NULL));
}

// The same directions for all points of the texel, so that their errors are one.
static void add_sky(packet *p, int sky, uint64_t seed) {
    for (int i = 0; i < sky; i++) {
        const double u[2] = {gonio_sobol((uint32_t)i, 0, seed), gonio_sobol((uint32_t)i, 1, seed)};
        gonio_vec3 w, toward[SCENE_CASTER_PACKET];
        double radiance[3], strength[SCENE_CASTER_PACKET][3];
        const double pdf = gonio_world_environment_sample(p->cpm->scene->environment, u, &w, radiance);
        if (!(pdf > 0)) {
            continue;
        }
        for (int k = 0; k < p->n; k++) {
            toward[k] = w;
            for (int c = 0; c < 3; c++) {
                strength[k][c] = radiance[c] / (pdf * sky);
            }
        }
        add_light(p, toward, (const double(*)[3])strength, open_toward(p, toward, NULL));
    }
}

static void add_packet(packet *p, int sky, uint64_t seed) {
    const scene_settings *s = p->cpm->scene->settings;
    gonio_vec3 toward[SCENE_CASTER_PACKET];
    for (int k = 0; k < p->n; k++) {
        const cpm_record_point *from = &p->points[k];
        gonio_cpm_place(p->cpm->scene, from->triangle, (double)from->u, (double)from->v, &p->places[k]);
        toward[k] = p->wo;
    }
    p->seen = ~0u;
    p->seen = open_toward(p, toward, NULL);
    for (int i = 0; i < s->lights && p->seen != 0; i++) {
        if (s->light[i].kind != SCENE_LIGHT_ENVIRONMENT) {
            add_small_light(p, &s->light[i]);
        }
    }
    if (p->cpm->scene->environment != NULL && p->seen != 0) {
        add_sky(p, sky, seed);
    }
}

bool gonio_cpm_texel_light(const gonio_cpm *cpm, const cpm_record *record, gonio_vec3 eye, int sky, uint64_t seed,
                           double rgb[3]) {
    const int side = (int)cpm->store.head.side;
    const gonio_vec3 centre = {(double)record->centre[0], (double)record->centre[1], (double)record->centre[2]};
    float area[6 * CPM_FACE_MAX * CPM_FACE_MAX];
    packet p = {.cpm = cpm, .wo = normalised(difference(eye, centre)), .rgb = rgb};
    rgb[0] = rgb[1] = rgb[2] = 0;
    gonio_cpm_area_restore(gonio_cpm_record_coefficients(record), record->coefficients, record->scale, side, area);
    const double seen = gonio_cpm_area_at(area, side, p.wo);
    if (!(seen >= (double)record->floor) || !(seen > 0)) {
        return false;
    }
    const cpm_record_point *points = gonio_cpm_record_points(record);
    for (uint32_t at = 0; at < record->points; at += SCENE_CASTER_PACKET) {
        p.points = points + at;
        p.n = (int)(record->points - at < SCENE_CASTER_PACKET ? record->points - at : SCENE_CASTER_PACKET);
        add_packet(&p, sky, seed);
    }
    for (int c = 0; c < 3; c++) {
        rgb[c] /= seen;
    }
    return true;
}
