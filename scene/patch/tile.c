// SPDX-License-Identifier: BSD-3-Clause
#include "scene/patch/tile.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <embree3/rtcore.h>

#include "base/vector.h"

#define COPIES_MAX 400000  // triangles that are worth copying for the sake of fewer wraps
#define TILES_AROUND_MAX 4 // copies on each side at most
#define BAND 0.02          // of a side: copied beyond the zone, so that no ray slips through where it wraps
#define LIFT 2e-5          // of a side: above float32's rounding of places in the zone
#define WRAPS_MAX 100000   // of a ray that runs level between the ridges

struct patch_tile {
    RTCDevice device;
    RTCScene scene;
    const patch_mesh *mesh;
    double x_low, x_high, y_low, y_high; // the zone that Embree has whole
    double low, high, lift;
    unsigned *source;    // [triangles of the scene]: which of the mesh each is
    gonio_vec3 *normals; // [mesh->triangles]
    int *classes;        // [mesh->triangles]
    long *members;       // [class_count]
    int class_count;
};

void gonio_patch_tile_free(patch_tile *tile) {
    if (tile != NULL) {
        if (tile->scene != NULL) {
            rtcReleaseScene(tile->scene);
        }
        if (tile->device != NULL) {
            rtcReleaseDevice(tile->device);
        }
        free(tile->source);
        free(tile->normals);
        free(tile->classes);
        free(tile->members);
        free(tile);
    }
}

static gonio_vec3 corner(const patch_mesh *mesh, size_t triangle, size_t k) {
    const float *p = mesh->positions + 3 * (size_t)mesh->corners[3 * triangle + k];
    return (gonio_vec3){(double)p[0], (double)p[1], (double)p[2]};
}

// ---- what the triangles are ----

// A triangle's normal as whole numbers, for telling like from unlike.
typedef struct orientation {
    int32_t x, y, z, material;
    long triangle;
} orientation;

static int by_orientation(const void *a, const void *b) {
    const int by = memcmp(a, b, offsetof(orientation, triangle));
    const long x = ((const orientation *)a)->triangle, y = ((const orientation *)b)->triangle;
    return by != 0 ? by : (x > y) - (x < y);
}

static bool classify(patch_tile *tile) {
    const size_t n = tile->mesh->triangles;
    orientation *all = malloc(n * sizeof *all);
    if (all == NULL) {
        return false;
    }
    for (size_t t = 0; t < n; t++) {
        const gonio_vec3 v = tile->normals[t];
        all[t] = (orientation){(int32_t)lrint(1e6 * v.x), (int32_t)lrint(1e6 * v.y), (int32_t)lrint(1e6 * v.z),
                               tile->mesh->materials[t], (long)t};
    }
    qsort(all, n, sizeof *all, by_orientation);
    for (size_t k = 0; k < n; k++) {
        if (k == 0 || memcmp(&all[k], &all[k - 1], offsetof(orientation, triangle)) != 0) {
            tile->members[tile->class_count++] = all[k].triangle;
        }
        tile->classes[all[k].triangle] = tile->class_count - 1;
    }
    free(all);
    return true;
}

// False where no triangle has an area.
static bool find_normals(patch_tile *tile) {
    bool any = false;
    tile->low = INFINITY;
    tile->high = -INFINITY;
    for (size_t t = 0; t < tile->mesh->triangles; t++) {
        const gonio_vec3 a = corner(tile->mesh, t, 0), b = corner(tile->mesh, t, 1), c = corner(tile->mesh, t, 2);
        const gonio_vec3 across = cross(sum(b, scaled(a, -1)), sum(c, scaled(a, -1)));
        const double area = sqrt(dot(across, across));
        tile->normals[t] = area > 0 ? scaled(across, 1 / area) : (gonio_vec3){0, 0, 1};
        any = any || area > 0;
        tile->low = fmin(tile->low, fmin(a.z, fmin(b.z, c.z)));
        tile->high = fmax(tile->high, fmax(a.z, fmax(b.z, c.z)));
    }
    return any;
}

// ---- Embree's copies ----

typedef struct copying {
    const patch_tile *tile;
    int around;
    float *positions; // NULL: only count
    unsigned *corners, *source;
    size_t n;
} copying;

static bool touches(double a, double b, double c, double low, double high) {
    return fmax(a, fmax(b, c)) >= low && fmin(a, fmin(b, c)) <= high;
}

static void copy_triangle(copying *c, size_t triangle, double dx, double dy) {
    const patch_tile *tile = c->tile;
    const double band_x = BAND * tile->mesh->width, band_y = BAND * tile->mesh->height;
    gonio_vec3 p[3];
    for (size_t k = 0; k < 3; k++) {
        p[k] = corner(tile->mesh, triangle, k);
        p[k].x += dx;
        p[k].y += dy;
    }
    if (!touches(p[0].x, p[1].x, p[2].x, tile->x_low - band_x, tile->x_high + band_x) ||
        !touches(p[0].y, p[1].y, p[2].y, tile->y_low - band_y, tile->y_high + band_y)) {
        return;
    }
    for (size_t k = 0; k < 3 && c->positions != NULL; k++) {
        float *to = c->positions + 9 * c->n + 3 * k;
        to[0] = (float)p[k].x;
        to[1] = (float)p[k].y;
        to[2] = (float)p[k].z;
        c->corners[3 * c->n + k] = (unsigned)(3 * c->n + k);
    }
    if (c->source != NULL) {
        c->source[c->n] = (unsigned)triangle;
    }
    c->n++;
}

// The mesh may reach beyond its own tile, so one more ring than the zone has is looked through.
static void copy_all(copying *c) {
    const patch_mesh *mesh = c->tile->mesh;
    c->n = 0;
    for (int i = -c->around - 1; i <= c->around + 1; i++) {
        for (int j = -c->around - 1; j <= c->around + 1; j++) {
            for (size_t t = 0; t < mesh->triangles; t++) {
                copy_triangle(c, t, i * mesh->width, j * mesh->height);
            }
        }
    }
}

static bool add_copies(patch_tile *tile, int around) {
    copying c = {.tile = tile, .around = around};
    copy_all(&c);
    RTCGeometry geometry = rtcNewGeometry(tile->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    c.positions =
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), 3 * c.n);
    c.corners =
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), c.n);
    c.source = tile->source = malloc(c.n * sizeof *c.source);
    const bool good = c.positions != NULL && c.corners != NULL && c.source != NULL;
    if (good) {
        copy_all(&c);
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(tile->scene, geometry);
    }
    rtcReleaseGeometry(geometry);
    return good;
}

static bool build(patch_tile *tile) {
    const patch_mesh *mesh = tile->mesh;
    int around = 0;
    while (around < TILES_AROUND_MAX && mesh->triangles * (size_t)((2 * around + 3) * (2 * around + 3)) <= COPIES_MAX) {
        around++;
    }
    tile->x_low = -around * mesh->width;
    tile->x_high = (around + 1) * mesh->width;
    tile->y_low = -around * mesh->height;
    tile->y_high = (around + 1) * mesh->height;
    tile->lift = LIFT * fmax(mesh->width, mesh->height);
    tile->device = rtcNewDevice("threads=1"); // one thread builds the hierarchy: the same one every time
    if (tile->device == NULL) {
        return false;
    }
    tile->scene = rtcNewScene(tile->device);
    rtcSetSceneFlags(tile->scene, RTC_SCENE_FLAG_ROBUST); // no light through shared edges
    const bool good = add_copies(tile, around);
    if (good) {
        rtcCommitScene(tile->scene);
    }
    return good && rtcGetDeviceError(tile->device) == RTC_ERROR_NONE;
}

gonio_status gonio_patch_tile_new(const patch_mesh *mesh, patch_tile **out, gonio_error *error) {
    *out = NULL;
    patch_tile *tile = calloc(1, sizeof *tile);
    if (tile != NULL) {
        tile->mesh = mesh;
        tile->normals = malloc(mesh->triangles * sizeof *tile->normals);
        tile->classes = malloc(mesh->triangles * sizeof *tile->classes);
        tile->members = malloc(mesh->triangles * sizeof *tile->members);
    }
    gonio_status status = GONIO_OK;
    if (tile == NULL || tile->normals == NULL || tile->classes == NULL || tile->members == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for a patch of %zu triangles", mesh->triangles);
    } else if (!find_normals(tile)) {
        status = gonio_fail(error, GONIO_E_INPUT, "the patch's triangles have no area");
    } else if (!classify(tile) || !build(tile)) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to trace a patch of %zu triangles", mesh->triangles);
    }
    if (status != GONIO_OK) {
        gonio_patch_tile_free(tile);
        return status;
    }
    *out = tile;
    return GONIO_OK;
}

gonio_vec3 gonio_patch_tile_normal(const patch_tile *tile, long triangle) { return tile->normals[triangle]; }
int gonio_patch_tile_class(const patch_tile *tile, long triangle) { return tile->classes[triangle]; }
int gonio_patch_tile_classes(const patch_tile *tile) { return tile->class_count; }
long gonio_patch_tile_member(const patch_tile *tile, int class) { return tile->members[class]; }
double gonio_patch_tile_lift(const patch_tile *tile) { return tile->lift; }
void gonio_patch_tile_heights(const patch_tile *tile, double *low, double *high) {
    *low = tile->low;
    *high = tile->high;
}

// ---- rays ----

// The distance at which the ray leaves the slab from low to high; INFINITY: it runs along.
static double leaves(double from, double step, double low, double high) {
    return step > 0 ? fmax(0, (high - from) / step) : step < 0 ? fmax(0, (low - from) / step) : INFINITY;
}

// How far ray k may be followed before it wraps (*wraps) or is out of the patch.
static double reach(const patch_tile *tile, const patch_packet *p, int k, bool *wraps) {
    const gonio_vec3 o = p->origin[k], d = p->direction[k];
    const double zone = fmin(leaves(o.x, d.x, tile->x_low, tile->x_high), leaves(o.y, d.y, tile->y_low, tile->y_high));
    const double out = leaves(o.z, d.z, tile->low - tile->lift, tile->high + tile->lift);
    *wraps = zone < out;
    return fmin(zone, out);
}

static double wrapped(double at, double side) {
    const double inside = at - side * floor(at / side);
    return inside < side ? inside : 0;
}

// A little less than the whole way, so that what lies right at the border is looked for twice rather than never.
static void wrap(const patch_tile *tile, patch_packet *p, int k, double distance) {
    const double way = fmax(0, distance - tile->lift / 8);
    gonio_vec3 at = sum(p->origin[k], scaled(p->direction[k], way));
    at.x = wrapped(at.x, tile->mesh->width);
    at.y = wrapped(at.y, tile->mesh->height);
    p->origin[k] = at;
}

// Sets the rays of `active`, and of them the bits that will wrap if nothing is hit.
static unsigned load(const patch_tile *tile, const patch_packet *p, unsigned active, struct RTCRay16 *ray,
                     int valid[PATCH_PACKET], double distance[PATCH_PACKET]) {
    unsigned wrapping = 0;
    for (int k = 0; k < PATCH_PACKET; k++) {
        const bool on = (active >> k & 1) != 0;
        valid[k] = on ? -1 : 0;
        if (!on) {
            continue;
        }
        bool wraps;
        distance[k] = reach(tile, p, k, &wraps);
        wrapping |= (unsigned)wraps << k;
        ray->org_x[k] = (float)p->origin[k].x;
        ray->org_y[k] = (float)p->origin[k].y;
        ray->org_z[k] = (float)p->origin[k].z;
        ray->dir_x[k] = (float)p->direction[k].x;
        ray->dir_y[k] = (float)p->direction[k].y;
        ray->dir_z[k] = (float)p->direction[k].z;
        ray->tnear[k] = 0;
        ray->tfar[k] = (float)distance[k];
        ray->time[k] = 0;
        ray->mask[k] = ~0u;
        ray->id[k] = (unsigned)k;
        ray->flags[k] = 0;
    }
    return wrapping;
}

static struct RTCIntersectContext context_of(const patch_packet *p) {
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = p->coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    return context;
}

void gonio_patch_tile_hit(const patch_tile *tile, patch_packet *packet, unsigned active) {
    _Alignas(64) struct RTCRayHit16 ray;
    _Alignas(64) int valid[PATCH_PACKET];
    double distance[PATCH_PACKET];
    for (int turn = 0; active != 0 && turn < WRAPS_MAX; turn++) {
        const unsigned wrapping = load(tile, packet, active, &ray.ray, valid, distance);
        memset(ray.hit.geomID, 0xff, sizeof ray.hit.geomID); // RTC_INVALID_GEOMETRY_ID
        struct RTCIntersectContext context = context_of(packet);
        rtcIntersect16(valid, tile->scene, &context, &ray);
        for (int k = 0; k < PATCH_PACKET; k++) {
            if ((active >> k & 1) == 0) {
                continue;
            }
            const bool hit = ray.hit.geomID[k] != RTC_INVALID_GEOMETRY_ID;
            if (hit) {
                packet->triangle[k] = (long)tile->source[ray.hit.primID[k]];
                wrap(tile, packet, k, (double)ray.ray.tfar[k] + tile->lift / 8);
            } else if ((wrapping >> k & 1) != 0) {
                wrap(tile, packet, k, distance[k]);
                continue;
            } else {
                packet->triangle[k] = packet->direction[k].z < 0 ? PATCH_FELL : PATCH_OUT;
            }
            active &= ~(1u << k);
        }
    }
    for (int k = 0; k < PATCH_PACKET; k++) {
        packet->triangle[k] = (active >> k & 1) != 0 ? PATCH_OUT : packet->triangle[k];
    }
}

unsigned gonio_patch_tile_shadowed(const patch_tile *tile, patch_packet *packet, unsigned active) {
    _Alignas(64) struct RTCRay16 ray;
    _Alignas(64) int valid[PATCH_PACKET];
    double distance[PATCH_PACKET];
    unsigned shadowed = 0;
    for (int turn = 0; active != 0 && turn < WRAPS_MAX; turn++) {
        unsigned wrapping = load(tile, packet, active, &ray, valid, distance);
        struct RTCIntersectContext context = context_of(packet);
        rtcOccluded16(valid, tile->scene, &context, &ray);
        for (int k = 0; k < PATCH_PACKET; k++) {
            if ((active >> k & 1) != 0 && ray.tfar[k] < 0) { // Embree's mark of an occluded ray
                shadowed |= 1u << k;
            }
        }
        active &= wrapping & ~shadowed;
        for (int k = 0; k < PATCH_PACKET; k++) {
            if ((active >> k & 1) != 0) {
                wrap(tile, packet, k, distance[k]);
            }
        }
    }
    return shadowed;
}
