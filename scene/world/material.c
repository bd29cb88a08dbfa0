// SPDX-License-Identifier: BSD-3-Clause
// What a place of a surface reflects.
#include <math.h>
#include <string.h>

#include "base/vector.h"
#include "gonio/sample.h"
#include "scene/world/world.h"

// Texture coordinates repeat; v = 0 is the picture's bottom row, as in OBJ files.
static void texel(double u, double v, int width, int height, double *x, double *y) {
    *x = (u - floor(u)) * width;
    *y = (1 - (v - floor(v))) * height;
}

static int wrapped(int i, int n) { return ((i % n) + n) % n; }

// Between the middles of four texels.
static void look_up(const gonio_picture *map, const double uv[2], double rgb[3]) {
    double x, y;
    texel(uv[0], uv[1], map->width, map->height, &x, &y);
    x -= 0.5;
    y -= 0.5;
    const int column = (int)floor(x), row = (int)floor(y);
    const double right = x - column, below = y - row;
    for (int c = 0; c < 3; c++) {
        rgb[c] = 0;
    }
    for (int k = 0; k < 4; k++) {
        const int i = wrapped(column + (k & 1), map->width), j = wrapped(row + (k >> 1), map->height);
        const double weight = ((k & 1) != 0 ? right : 1 - right) * ((k >> 1) != 0 ? below : 1 - below);
        const float *p = map->rgb + 3 * ((size_t)j * (size_t)map->width + (size_t)i);
        for (int c = 0; c < 3; c++) {
            rgb[c] += weight * (double)p[c];
        }
    }
}

static int mapped_material(const world_material_map *map, const double uv[2]) {
    double x, y;
    texel(uv[0], uv[1], map->width, map->height, &x, &y);
    const int column = x < map->width ? (int)x : map->width - 1, row = y < map->height ? (int)y : map->height - 1;
    return map->materials[(size_t)row * (size_t)map->width + (size_t)column];
}

void gonio_world_place(const gonio_scene *scene, const scene_hit *hit, world_place *place) {
    const world_mesh *mesh = &scene->meshes[scene->triangle_mesh[hit->triangle]];
    place->hit = *hit;
    place->bitangent = cross(hit->normal, hit->tangent);
    place->uv[0] = place->uv[1] = 0;
    for (size_t k = 0; k < 3 && mesh->has_uv; k++) {
        const double weight = k == 0 ? 1 - hit->u - hit->v : k == 1 ? hit->u : hit->v;
        const float *uv = scene->mesh->uvs + 2 * (size_t)scene->mesh->indices[3 * hit->triangle + k];
        place->uv[0] += weight * (double)uv[0];
        place->uv[1] += weight * (double)uv[1];
    }
    place->material =
        mesh->map.materials != NULL ? mapped_material(&mesh->map, place->uv) : scene->triangle_material[hit->triangle];
    const world_material *material = &scene->materials[place->material];
    memcpy(place->albedo, material->albedo, sizeof place->albedo);
    if (material->map != NULL) {
        double rgb[3];
        look_up(material->map, place->uv, rgb);
        for (int c = 0; c < 3; c++) {
            place->albedo[c] *= rgb[c];
        }
    }
}

gonio_vec3 gonio_world_local(const world_place *place, gonio_vec3 w) {
    return normalised((gonio_vec3){dot(place->hit.tangent, w), dot(place->bitangent, w), dot(place->hit.normal, w)});
}

gonio_vec3 gonio_world_outward(const world_place *place, gonio_vec3 local) {
    return normalised(sum(scaled(place->hit.tangent, local.x),
                          sum(scaled(place->bitangent, local.y), scaled(place->hit.normal, local.z))));
}

void gonio_world_eval(const gonio_scene *scene, int material, gonio_vec3 wi, gonio_vec3 wo, double rgb[3]) {
    const world_material *m = &scene->materials[material];
    if (m->constant) {
        memcpy(rgb, m->f, 3 * sizeof *rgb);
        return;
    }
    double values[GONIO_CHANNELS_MAX];
    gonio_model_eval(m->model, wi, wo, values);
    gonio_colour_rgb(&m->colour, values, rgb);
    for (int c = 0; c < 3; c++) {
        rgb[c] = fmax(0, rgb[c]); // colours outside sRGB, and splines that ring below zero
    }
}
