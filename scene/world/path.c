// SPDX-License-Identifier: BSD-3-Clause
// A path is lit at each of its places: by every point and directional light, and by the environment in two ways, a
// direction drawn in proportion to the environment's light and one from the model's own density, weighted by the
// balance heuristic (Veach and Guibas, "Optimally combining sampling techniques for Monte Carlo rendering", 1995). With
// interreflection the direction of the model is followed on, and the path ends by Russian roulette.
#include "scene/world/path.h"

#include <math.h>
#include <string.h>

#include "base/random.h"
#include "base/sobol.h"
#include "base/vector.h"

#define DEPTH_MAX 4096  // only a trap for light of albedo 1 comes near
#define ROULETTE_FROM 3 // places that no path ends before
#define PURPOSES 8      // that are stratified; later ones are merely random

enum { PURPOSE_PIXEL, PURPOSE_LIGHT };

// ---- random numbers ----

static uint32_t reversed(uint32_t x) {
    x = ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
    x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
    x = ((x >> 4) & 0x0f0f0f0fu) | ((x & 0x0f0f0f0fu) << 4);
    x = ((x >> 8) & 0x00ff00ffu) | ((x & 0x00ff00ffu) << 8);
    return (x >> 16) | (x << 16);
}

// Another order of every power-of-two block of indices, so that the pairs of different purposes are independent
// (Laine and Karras, "Stratified sampling for stochastic transparency", 2011; constants of Burley 2020).
static uint32_t shuffled(uint32_t index, uint32_t seed) {
    uint32_t x = reversed(index);
    x += seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    x ^= x * 0x8d22f6e6u;
    return reversed(x);
}

void gonio_world_path_random(const world_path *path, int k, double u[2]) {
    const uint64_t seed = gonio_random(path->seed + GONIO_RANDOM_STEP * (uint64_t)(k + 1));
    if (k < PURPOSES) {
        const uint32_t index = shuffled(path->index, (uint32_t)(seed >> 32));
        u[0] = gonio_sobol_shifted(index, 0, seed);
        u[1] = gonio_sobol_shifted(index, 1, seed);
    } else {
        uint64_t stream = gonio_random(seed ^ path->index);
        u[0] = gonio_random_next(&stream);
        u[1] = gonio_random_next(&stream);
    }
}

// ---- light at one place ----

typedef struct lit {
    world_path *path;
    const world_place *place;
    gonio_vec3 wo; // in the place's frame
    const double *throughput;
    double *rgb;
} lit;

// f_r |cos theta_i| toward a direction; false: it is behind the surface, and the material lets nothing through.
static bool reflect(const lit *l, gonio_vec3 toward, gonio_vec3 *wi, double f[3]) {
    const gonio_scene *scene = l->path->scene;
    const gonio_model *model = scene->materials[l->place->material].model;
    *wi = gonio_world_local(l->place, toward);
    // The facet and the shading normal must agree which side it is on.
    if ((wi->z > 0) != (dot(toward, l->place->hit.facet) > 0) || wi->z == 0 || (wi->z < 0 && !model->ops->both_sides)) {
        return false;
    }
    gonio_world_eval(scene, l->place->material, *wi, l->wo, f);
    for (int c = 0; c < 3; c++) {
        f[c] *= fabs(wi->z) * l->place->albedo[c];
    }
    return f[0] > 0 || f[1] > 0 || f[2] > 0;
}

// The environment, where it shines.
static const world_environment *environment_of(const world_path *path) {
    const scene_settings *s = path->scene->settings;
    return path->light == 0 || s->light[path->light - 1].kind == SCENE_LIGHT_ENVIRONMENT ? path->scene->environment
                                                                                         : NULL;
}

// Light of this radiance over a solid angle (or a light's irradiance), once nothing stands in its way.
static void receive(const lit *l, gonio_vec3 wi, const double f[3], const double light[3], double weight) {
    gonio_scene_use use = {.pixel = l->path->pixel, .material = l->place->material, .wi = wi, .wo = l->wo};
    for (int c = 0; c < 3; c++) {
        const double brought = l->throughput[c] * f[c] * light[c] * weight;
        l->rgb[c] += brought;
        use.light[c] = l->path->scale * brought;
        use.weight[c] = l->path->scale * l->throughput[c] * l->place->albedo[c] * fabs(wi.z) * light[c] * weight;
    }
    if (l->path->use != NULL) {
        l->path->use(l->path->use_context, &use);
    }
}

static bool blocked(const lit *l, gonio_vec3 toward, double distance) {
    const scene_hit *hit = &l->place->hit;
    l->path->rays++;
    return gonio_scene_caster_blocked(l->path->scene->caster, hit->point, hit->facet, toward, distance);
}

static void light_points(const lit *l) {
    const scene_settings *s = l->path->scene->settings;
    for (int i = 0; i < s->lights; i++) {
        const scene_light_settings *light = &s->light[i];
        gonio_vec3 toward = {light->toward[0], light->toward[1], light->toward[2]}, wi;
        double distance = INFINITY, f[3];
        if (light->kind == SCENE_LIGHT_ENVIRONMENT || (l->path->light != 0 && l->path->light != i + 1)) {
            continue;
        }
        if (light->kind == SCENE_LIGHT_POINT) {
            toward = difference((gonio_vec3){light->position[0], light->position[1], light->position[2]},
                                l->place->hit.point);
            distance = sqrt(dot(toward, toward));
            if (!(distance > 0)) {
                continue;
            }
            toward = scaled(toward, 1 / distance);
        }
        if (reflect(l, toward, &wi, f) && !blocked(l, toward, distance)) {
            receive(l, wi, f, light->intensity, distance < INFINITY ? 1 / (distance * distance) : 1);
        }
    }
}

// The model's density of directions in front, for light that comes from there: light is followed from the eye, so the
// directions are exchanged.
static double model_pdf(const lit *l, gonio_vec3 wi) {
    const world_material *m = &l->path->scene->materials[l->place->material];
    if (!(wi.z > 0)) {
        return 0;
    }
    return m->constant ? wi.z / GONIO_PI : gonio_model_pdf(m->model, l->wo, wi);
}

static double model_sample(const lit *l, const double u[2], gonio_vec3 *wi) {
    const world_material *m = &l->path->scene->materials[l->place->material];
    if (!m->constant) {
        return gonio_model_sample(m->model, l->wo, u, wi, NULL);
    }
    const double z = sqrt(1 - u[0]), r = sqrt(u[0]), angle = 2 * GONIO_PI * u[1];
    *wi = (gonio_vec3){r * cos(angle), r * sin(angle), z};
    return z / GONIO_PI;
}

static void light_environment(const lit *l, const double u[2]) {
    const world_environment *environment = environment_of(l->path);
    gonio_vec3 toward, wi;
    double radiance[3], f[3];
    const double pdf = gonio_world_environment_sample(environment, u, &toward, radiance);
    if (pdf > 0 && reflect(l, toward, &wi, f) && !blocked(l, toward, INFINITY)) {
        receive(l, wi, f, radiance, 1 / (pdf + model_pdf(l, wi)));
    }
}

// ---- the path ----

// The next direction. *f: f_r cos over the density, which the throughput takes. False: the path ends.
static bool scatter(const lit *l, const double u[2], gonio_vec3 *toward, gonio_vec3 *wi, double f[3], double *pdf) {
    *pdf = model_sample(l, u, wi);
    if (!(*pdf > 0) || !isfinite(*pdf)) {
        return false;
    }
    *toward = gonio_world_outward(l->place, *wi);
    return reflect(l, *toward, wi, f);
}

// What the model's own direction brings from the environment.
static void meet_environment(const lit *l, gonio_vec3 toward, gonio_vec3 wi, const double f[3], double pdf) {
    const world_environment *environment = environment_of(l->path);
    double radiance[3];
    gonio_world_environment_radiance(environment, toward, radiance);
    receive(l, wi, f, radiance, 1 / (pdf + gonio_world_environment_pdf(environment, toward)));
}

static bool survives(double throughput[3], int depth, double u) {
    const double most = fmax(throughput[0], fmax(throughput[1], throughput[2]));
    const double chance = depth < ROULETTE_FROM ? (most > 0 ? 1 : 0) : fmin(1, most);
    for (int c = 0; c < 3 && chance > 0; c++) {
        throughput[c] /= chance;
    }
    return u < chance;
}

// Lights the place and turns to where the path goes on; false: it ends.
static bool visit(lit *l, int depth, gonio_vec3 *origin, gonio_vec3 *direction, scene_hit *next, double throughput[3]) {
    world_path *path = l->path;
    const gonio_scene *scene = path->scene;
    const bool environment = environment_of(path) != NULL;
    double u[2], pdf, f[3];
    gonio_vec3 toward, wi;
    light_points(l);
    if (environment) {
        gonio_world_path_random(path, PURPOSE_LIGHT + 3 * depth, u);
        light_environment(l, u);
    }
    gonio_world_path_random(path, PURPOSE_LIGHT + 3 * depth + 1, u);
    if ((!environment && !path->interreflection) || !scatter(l, u, &toward, &wi, f, &pdf)) {
        return false;
    }
    if (!path->interreflection) {
        if (!blocked(l, toward, INFINITY)) {
            meet_environment(l, toward, wi, f, pdf);
        }
        return false;
    }
    *origin = gonio_scene_caster_leave(scene->caster, l->place->hit.point, l->place->hit.facet, toward);
    *direction = toward;
    path->rays++;
    if (!gonio_scene_caster_hit(scene->caster, *origin, toward, next)) {
        if (environment) {
            meet_environment(l, toward, wi, f, pdf);
        }
        return false;
    }
    for (int c = 0; c < 3; c++) {
        throughput[c] *= f[c] / pdf;
    }
    gonio_world_path_random(path, PURPOSE_LIGHT + 3 * depth + 2, u);
    return depth + 1 < DEPTH_MAX && survives(throughput, depth + 1, u[0]);
}

void gonio_world_path_trace(world_path *path, gonio_vec3 origin, gonio_vec3 direction, double rgb[3], bool *met) {
    const gonio_scene *scene = path->scene;
    double throughput[3] = {1, 1, 1};
    scene_hit hit;
    memset(rgb, 0, 3 * sizeof *rgb);
    path->rays++;
    bool going = gonio_scene_caster_hit(scene->caster, origin, direction, &hit);
    if (met != NULL) {
        *met = going;
    }
    const world_environment *environment = environment_of(path);
    if (!going && environment != NULL && gonio_world_environment_visible(environment)) {
        gonio_world_environment_radiance(environment, direction, rgb);
    }
    for (int depth = 0; going; depth++) {
        world_place place;
        double before[3];
        memcpy(before, throughput, sizeof before);
        gonio_world_place(scene, &hit, &place);
        lit l = {path, &place, gonio_world_local(&place, scaled(direction, -1)), before, rgb};
        going = l.wo.z > 0 && visit(&l, depth, &origin, &direction, &hit, throughput);
    }
}
