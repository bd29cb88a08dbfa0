// SPDX-License-Identifier: BSD-3-Clause
// The error of a model as a viewer of its pictures sees it: Park and Lee (2015), eq. 16, the mean over the pixels of
// the Euclidean distance of 8-bit RGB colours; Kameya (2002), section 7.2.2, compares pictures in the same way.
//
// A sphere has every angle of view once; a trefoil knot's tube, made here, has saddles, shadows of its own and other
// statistics. Each is lit twice, from 40 deg and from the side behind it, where lobes graze: four pictures. Only
// pixels on the objects count, so their margins do not matter. Rays are parallel and one a pixel: both pictures have
// the same edges. The reference's 99th percentile is exposed to 0.9, as in the preview (scene/render.c).
#include "scene/model_pictures.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/order_statistic.h"
#include "base/thread_pool.h"
#include "base/vector.h"
#include "gonio/sample.h"
#include "io/colour.h"
#include "scene/caster.h"

#define SIDE 112 // pixels: some 7,000 on a sphere
#define LIGHTS 2
#define PICTURES (2 * LIGHTS)
#define BENDS 180 // of the knot, and corners of its tube
#define CORNERS 20
#define PERCENTILE 0.99
#define PERCENTILE_TO 0.9

struct gonio_image_scene {
    size_t end[PICTURES]; // of each picture's pixels
    gonio_vec3 *wi, *wo;  // wi.z 0: no light
};

// ---- the knot ----

static gonio_vec3 knot_at(double t) {
    return (gonio_vec3){sin(t) + 2 * sin(2 * t), cos(t) - 2 * cos(2 * t), -sin(3 * t)};
}

static gonio_vec3 unit(gonio_vec3 v) { return scaled(v, 1 / sqrt(dot(v, v))); }


// A tube about the curve, whose curvature is nowhere 0: across it stand its own normal and binormal.
static void set_vertices(scene_mesh *mesh) {
    for (size_t i = 0; i < BENDS; i++) {
        const double t = 2 * GONIO_PI * (double)i / BENDS, h = 1e-3;
        const gonio_vec3 here = knot_at(t), before = knot_at(t - h), after = knot_at(t + h);
        const gonio_vec3 along = unit(sum(after, scaled(before, -1)));
        const gonio_vec3 bend = sum(sum(after, before), scaled(here, -2));
        const gonio_vec3 normal = unit(sum(bend, scaled(along, -dot(along, bend)))), across = cross(along, normal);
        for (size_t k = 0; k < CORNERS; k++) {
            const double a = 2 * GONIO_PI * (double)k / CORNERS;
            const gonio_vec3 out = sum(scaled(normal, cos(a)), scaled(across, sin(a)));
            const gonio_vec3 point = scaled(sum(here, scaled(out, 0.6)), 1 / 3.7);
            const double both[2][3] = {{point.x, point.y, point.z}, {out.x, out.y, out.z}};
            for (size_t d = 0; d < 3; d++) {
                mesh->positions[3 * (i * CORNERS + k) + d] = (float)both[0][d];
                mesh->normals[3 * (i * CORNERS + k) + d] = (float)both[1][d];
            }
        }
    }
}

static scene_mesh *make_knot(void) {
    scene_mesh *mesh = calloc(1, sizeof *mesh);
    if (mesh == NULL) {
        return NULL;
    }
    mesh->vertices = BENDS * CORNERS;
    mesh->triangles = 2 * mesh->vertices;
    mesh->positions = malloc(3 * mesh->vertices * sizeof(float));
    mesh->normals = malloc(3 * mesh->vertices * sizeof(float));
    mesh->indices = malloc(3 * mesh->triangles * sizeof(unsigned));
    if (mesh->positions == NULL || mesh->normals == NULL || mesh->indices == NULL) {
        gonio_scene_mesh_free(mesh);
        return NULL;
    }
    set_vertices(mesh);
    unsigned *index = mesh->indices;
    for (unsigned i = 0; i < BENDS; i++) {
        for (unsigned k = 0; k < CORNERS; k++) {
            const unsigned next = (i + 1) % BENDS, right = (k + 1) % CORNERS;
            const unsigned corner[6] = {i * CORNERS + k, next * CORNERS + k,     next * CORNERS + right,
                                        i * CORNERS + k, next * CORNERS + right, i * CORNERS + right};
            memcpy(index, corner, sizeof corner);
            index += 6;
        }
    }
    return mesh;
}

// ---- the pictures' geometry ----

static void look(const scene_caster *caster, gonio_vec3 light, gonio_image_scene *scene, size_t *n) {
    const gonio_vec3 down = {0, 0, -1}, up = {0, 0, 1};
    for (int i = 0; i < SIDE * SIDE; i++) {
        const double x = (i % SIDE + 0.5) / SIDE * 2 - 1, y = 1 - (i / SIDE + 0.5) / SIDE * 2;
        scene_hit hit;
        if (!gonio_scene_caster_hit(caster, (gonio_vec3){x, y, 2}, down, &hit)) {
            continue;
        }
        gonio_vec3 wi = scene_into_frame(&hit, light);
        const gonio_vec3 wo = scene_into_frame(&hit, up);
        if (!(wi.z > 0) || !(wo.z > 0) || dot(light, hit.facet) <= 0 ||
            gonio_scene_caster_shadowed(caster, &hit, light)) {
            wi.z = 0;
        }
        scene->wi[*n] = wi;
        scene->wo[(*n)++] = wo;
    }
}

static gonio_status look_at_all(gonio_image_scene *scene, gonio_error *error) {
    // Over the viewer's shoulder, and from the side, 20 deg behind the objects.
    const gonio_vec3 lights[LIGHTS] = {gonio_direction(gonio_radians(40), gonio_radians(120)),
                                       gonio_direction(gonio_radians(110), gonio_radians(-20))};
    scene_mesh *knot = make_knot();
    gonio_status status = knot != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a mesh");
    size_t n = 0;
    for (int object = 0; object < 2 && status == GONIO_OK; object++) {
        scene_caster *caster;
        status = gonio_scene_caster_new(object == 0 ? NULL : knot, &caster, error);
        for (int light = 0; light < LIGHTS && status == GONIO_OK; light++) {
            look(caster, lights[light], scene, &n);
            scene->end[object * LIGHTS + light] = n;
        }
        gonio_scene_caster_free(status == GONIO_OK ? caster : NULL);
    }
    gonio_scene_mesh_free(knot);
    return status;
}

gonio_status gonio_image_scene_new(gonio_image_scene **out, gonio_error *error) {
    gonio_image_scene *scene = calloc(1, sizeof *scene);
    const size_t most = (size_t)PICTURES * SIDE * SIDE;
    *out = NULL;
    if (scene != NULL) {
        scene->wi = malloc(most * sizeof *scene->wi);
        scene->wo = malloc(most * sizeof *scene->wo);
    }
    const gonio_status status = scene != NULL && scene->wi != NULL && scene->wo != NULL
                                    ? look_at_all(scene, error)
                                    : gonio_fail(error, GONIO_E_MEMORY, "no memory for pictures");
    if (status != GONIO_OK) {
        gonio_image_scene_free(scene);
        return status;
    }
    *out = scene;
    return GONIO_OK;
}

void gonio_image_scene_free(gonio_image_scene *scene) {
    if (scene != NULL) {
        free(scene->wi);
        free(scene->wo);
        free(scene);
    }
}

// ---- a model's pictures ----

#define PART 256 // pixels that a thread takes at a time

typedef struct shading {
    const gonio_image_scene *scene;
    const gonio_model *model;
    gonio_colour_weights colour;
    float *rgb;
} shading;

static void shade_part(void *context, size_t part) {
    const shading *s = context;
    const size_t n = s->scene->end[PICTURES - 1];
    for (size_t i = part * PART; i < n && i < (part + 1) * PART; i++) {
        double values[GONIO_CHANNELS_MAX], rgb[3] = {0};
        if (s->scene->wi[i].z > 0) {
            gonio_model_eval(s->model, s->scene->wi[i], s->scene->wo[i], values);
            gonio_colour_rgb(&s->colour, values, rgb);
        }
        for (size_t k = 0; k < 3; k++) {
            const double light = rgb[k] * GONIO_PI * s->scene->wi[i].z;
            s->rgb[3 * i + k] = isfinite(light) ? (float)fmin(light, 1e30) : 0;
        }
    }
}

gonio_status gonio_image_render(const gonio_image_scene *scene, const gonio_model *model, int threads, float **rgb,
                                gonio_error *error) {
    const size_t n = scene->end[PICTURES - 1];
    shading s = {.scene = scene, .model = model, .rgb = malloc(3 * n * sizeof(float))};
    *rgb = NULL;
    gonio_status status = s.rgb != NULL ? gonio_colour_new(model->channels, model->channel_names, &s.colour, error)
                                        : gonio_fail(error, GONIO_E_MEMORY, "no memory for pictures");
    if (status == GONIO_OK) {
        gonio_pool_for(threads, (n + PART - 1) / PART, shade_part, &s);
        gonio_colour_free(&s.colour);
        *rgb = s.rgb;
    } else {
        free(s.rgb);
    }
    return status;
}

static double exposure(const float *rgb, size_t begin, size_t end, float *levels) {
    size_t n = 0;
    for (size_t i = begin; i < end; i++) {
        const float level = fmaxf(rgb[3 * i], fmaxf(rgb[3 * i + 1], rgb[3 * i + 2]));
        if (level > 0) {
            levels[n++] = level;
        }
    }
    const float level = n > 0 ? gonio_order_statistic_f32(levels, n, (size_t)(PERCENTILE * (double)(n - 1))) : 0;
    return level > 0 ? PERCENTILE_TO / (double)level : 1;
}

gonio_status gonio_image_error(const gonio_image_scene *scene, const float *reference, const float *rgb,
                               double *distance, gonio_error *error) {
    const size_t n = scene->end[PICTURES - 1];
    float *levels = malloc(n * sizeof *levels);
    if (levels == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to compare pictures");
    }
    double total = 0;
    for (size_t picture = 0, i = 0; picture < PICTURES; picture++) {
        const double scale = exposure(reference, i, scene->end[picture], levels);
        for (; i < scene->end[picture]; i++) {
            double square = 0;
            for (size_t k = 3 * i; k < 3 * i + 3; k++) {
                const double apart =
                    gonio_srgb_code(scale * (double)reference[k]) - gonio_srgb_code(scale * (double)rgb[k]);
                square += apart * apart;
            }
            total += sqrt(square);
        }
    }
    free(levels);
    *distance = n > 0 ? total / (double)n : 0;
    return GONIO_OK;
}
