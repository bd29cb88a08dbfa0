// SPDX-License-Identifier: BSD-3-Clause
// Camera rays start uniformly over the tile and run along -wo, so the places that they find are spread as the visible
// area is, seen from wo: the mean of f_r (n.wi) V(wi) over them is Wu's fbar (2009, eq. 6) without any weight. Every
// place serves all wi. With interreflection the path goes on by the cosine, and every vertex of it is lit again; it
// ends by Russian roulette on its throughput, since a fixed number of bounces loses light.
#include "scene/patch/rays.h"

#include <math.h>
#include <string.h>

#include "base/random.h"
#include "base/sobol.h"
#include "base/vector.h"

#define DEPTH_MAX 4096  // vertices of a path: only a trap for light of albedo 1 comes near
#define ROULETTE_FROM 3 // vertices that no path ends before

// What a packet of paths carries from vertex to vertex.
typedef struct paths {
    patch_packet packet;
    unsigned alive;
    gonio_vec3 normal[PATCH_PACKET], toward[PATCH_PACKET]; // at the vertex: the side that is seen, and whence
    double first_u[PATCH_PACKET], first_v[PATCH_PACKET];   // where the first bounce goes: stratified with the places
    uint64_t stream[PATCH_PACKET];
    int depth;
} paths;

// About an axis: distance u along the cosine's range [least, 1], azimuth v.
static gonio_vec3 about(gonio_vec3 axis, double cosine, double v) {
    const gonio_vec3 t = gonio_patch_tangent(axis), b = cross(axis, t);
    const double sine = sqrt(fmax(0, 1 - cosine * cosine)), angle = 2 * GONIO_PI * v;
    return normalised(sum(scaled(axis, cosine), sum(scaled(t, sine * cos(angle)), scaled(b, sine * sin(angle)))));
}

static gonio_vec3 in_cone(gonio_vec3 axis, double half_deg, double u, double v) {
    return half_deg > 0 ? about(axis, 1 - u * (1 - cos(gonio_radians(half_deg))), v) : axis;
}

static gonio_vec3 facing(const gonio_patch *patch, long triangle, gonio_vec3 toward) {
    const gonio_vec3 normal = gonio_patch_tile_normal(patch->tile, triangle);
    return dot(normal, toward) < 0 ? scaled(normal, -1) : normal;
}

void gonio_patch_rays_table(const patch_rays *rays, double *table) {
    const gonio_patch *patch = rays->patch;
    const size_t channels = (size_t)patch->channels;
    for (int class = 0; class < gonio_patch_tile_classes(patch->tile); class ++) {
        const long triangle = gonio_patch_tile_member(patch->tile, class);
        const gonio_vec3 normal = facing(patch, triangle, rays->wo);
        const int material = patch->mesh.materials[triangle];
        for (size_t i = 0; i < rays->n; i++) {
            double *to = table + ((size_t) class * rays->n + i) * channels;
            const double cosine = dot(normal, rays->wi[i]);
            memset(to, 0, channels * sizeof *to);
            if (cosine > 0) {
                gonio_patch_material_eval(patch, material, normal, rays->wi[i], rays->wo, to);
            }
            for (size_t c = 0; c < channels; c++) {
                to[c] *= cosine;
            }
        }
    }
}

// ---- the camera ----

static void start(const patch_rays *rays, size_t replicate, uint32_t first, paths *p) {
    const gonio_patch *patch = rays->patch;
    const uint64_t seed = gonio_random(rays->seed + replicate);
    double low, high;
    gonio_patch_tile_heights(patch->tile, &low, &high);
    p->depth = 0;
    p->alive = 0;
    p->packet.coherent = true;
    for (uint32_t k = 0; k < PATCH_PACKET && first + k < rays->to; k++) {
        const double x = gonio_sobol_shifted(first + k, 0, seed), y = gonio_sobol_shifted(first + k, 1, seed);
        const bool more = rays->options->interreflection || rays->options->camera_half_deg > 0;
        const double u = more ? gonio_sobol_shifted(first + k, 2, seed) : 0;
        const double v = more ? gonio_sobol_shifted(first + k, 3, seed) : 0;
        const double half = rays->options->camera_half_deg;
        p->toward[k] = in_cone(rays->wo, half, u, v);
        p->packet.origin[k] =
            (gonio_vec3){x * patch->mesh.width, y * patch->mesh.height, high + gonio_patch_tile_lift(patch->tile) / 2};
        p->packet.direction[k] = scaled(p->toward[k], -1);
        p->stream[k] = gonio_random(seed ^ gonio_random(first + k));
        p->first_u[k] = half > 0 ? gonio_random_next(&p->stream[k]) : u;
        p->first_v[k] = half > 0 ? gonio_random_next(&p->stream[k]) : v;
        p->alive |= (unsigned)(p->toward[k].z > 1e-3) << k;
    }
}

// Follow the rays to their next vertices. Those that leave the patch end.
static void advance(const patch_rays *rays, paths *p, patch_counts *counts) {
    gonio_patch_tile_hit(rays->patch->tile, &p->packet, p->alive);
    for (int k = 0; k < PATCH_PACKET; k++) {
        if ((p->alive >> k & 1) == 0) {
            continue;
        }
        if (p->packet.triangle[k] < 0) {
            counts->fell += p->packet.triangle[k] == PATCH_FELL;
            p->alive &= ~(1u << k);
            continue;
        }
        p->normal[k] = facing(rays->patch, p->packet.triangle[k], p->toward[k]);
    }
}

// ---- light ----

// Rays toward the lamp from all vertices that face it; returns the bits of the vertices that it reaches.
static unsigned light_from(const patch_rays *rays, paths *p, gonio_vec3 wi, gonio_vec3 toward[PATCH_PACKET],
                           patch_counts *counts) {
    const double half = rays->options->light_half_deg, lift = gonio_patch_tile_lift(rays->patch->tile);
    patch_packet shadow = {.coherent = p->depth == 0};
    unsigned facing_it = 0;
    for (int k = 0; k < PATCH_PACKET; k++) {
        if ((p->alive >> k & 1) == 0) {
            continue;
        }
        toward[k] = wi;
        if (half > 0) {
            const double u = gonio_random_next(&p->stream[k]), v = gonio_random_next(&p->stream[k]);
            toward[k] = in_cone(wi, half, u, v);
        }
        if (toward[k].z > 0 && dot(p->normal[k], toward[k]) > 0) {
            shadow.origin[k] = sum(p->packet.origin[k], scaled(p->normal[k], lift));
            shadow.direction[k] = toward[k];
            facing_it |= 1u << k;
        }
    }
    if (facing_it == 0) {
        return 0;
    }
    counts->shadow += (uint64_t)__builtin_popcount(facing_it);
    return facing_it & ~gonio_patch_tile_shadowed(rays->patch->tile, &shadow, facing_it);
}

static void add_vertex(const patch_rays *rays, const paths *p, int k, gonio_vec3 wi, const double *throughput,
                       double *to) {
    const gonio_patch *patch = rays->patch;
    double f[patch->channels];
    const double cosine = dot(p->normal[k], wi);
    gonio_patch_material_eval(patch, patch->mesh.materials[p->packet.triangle[k]], p->normal[k], wi, p->toward[k], f);
    for (int c = 0; c < patch->channels; c++) {
        to[c] += throughput[k * patch->channels + c] * f[c] * cosine;
    }
}

static void light_all(const patch_rays *rays, paths *p, const double *throughput, size_t replicate,
                      patch_counts *counts) {
    const size_t channels = (size_t)rays->patch->channels;
    gonio_vec3 toward[PATCH_PACKET];
    for (size_t i = 0; i < rays->n; i++) {
        if (rays->done[i]) {
            continue;
        }
        double *to = rays->sums + (i * PATCH_REPLICATES + replicate) * channels;
        for (unsigned lit = light_from(rays, p, rays->wi[i], toward, counts); lit != 0; lit &= lit - 1) {
            const int k = __builtin_ctz(lit);
            if (p->depth > 0 || rays->table == NULL) {
                add_vertex(rays, p, k, toward[k], throughput, to);
                continue;
            }
            const size_t class = (size_t)gonio_patch_tile_class(rays->patch->tile, p->packet.triangle[k]);
            const double *from = rays->table + (class * rays->n + i) * channels;
            for (size_t c = 0; c < channels; c++) {
                to[c] += from[c];
            }
        }
    }
}

// ---- the next vertex ----

// Cosine-distributed, so the throughput takes pi f_r. False: the path ends.
static bool bounce(const patch_rays *rays, paths *p, int k, double *throughput) {
    const gonio_patch *patch = rays->patch;
    double f[patch->channels], most = 0;
    const double u = p->depth == 0 ? p->first_u[k] : gonio_random_next(&p->stream[k]);
    const double v = p->depth == 0 ? p->first_v[k] : gonio_random_next(&p->stream[k]);
    const gonio_vec3 out = about(p->normal[k], sqrt(1 - u), v);
    gonio_patch_material_eval(patch, patch->mesh.materials[p->packet.triangle[k]], p->normal[k], out, p->toward[k], f);
    for (int c = 0; c < patch->channels; c++) {
        throughput[c] *= GONIO_PI * f[c];
        most = fmax(most, throughput[c]);
    }
    const double chance = p->depth < ROULETTE_FROM ? (most > 0 ? 1 : 0) : fmin(1, most);
    if (!(gonio_random_next(&p->stream[k]) < chance)) {
        return false;
    }
    for (int c = 0; c < patch->channels; c++) {
        throughput[c] /= chance;
    }
    p->packet.origin[k] = sum(p->packet.origin[k], scaled(p->normal[k], gonio_patch_tile_lift(patch->tile)));
    p->packet.direction[k] = out;
    p->toward[k] = scaled(out, -1);
    return true;
}

static void bounce_all(const patch_rays *rays, paths *p, double *throughput, patch_counts *counts) {
    p->packet.coherent = false;
    for (int k = 0; k < PATCH_PACKET; k++) {
        if ((p->alive >> k & 1) != 0 && !bounce(rays, p, k, throughput + k * rays->patch->channels)) {
            p->alive &= ~(1u << k);
        }
    }
    p->depth++;
    counts->bounces += (uint64_t)__builtin_popcount(p->alive);
}

void gonio_patch_rays_trace(void *context, size_t replicate) {
    patch_rays *rays = context;
    patch_counts *counts = &rays->counts[replicate];
    const int values = PATCH_PACKET * rays->patch->channels;
    double throughput[values];
    for (uint32_t first = rays->from; first < rays->to; first += PATCH_PACKET) {
        paths p;
        start(rays, replicate, first, &p);
        counts->camera += (uint64_t)__builtin_popcount(p.alive);
        for (int k = 0; k < values; k++) {
            throughput[k] = 1;
        }
        advance(rays, &p, counts);
        while (p.alive != 0) {
            light_all(rays, &p, throughput, replicate, counts);
            if (!rays->options->interreflection || p.depth >= DEPTH_MAX) {
                break;
            }
            bounce_all(rays, &p, throughput, counts);
            advance(rays, &p, counts);
        }
    }
}
