// SPDX-License-Identifier: BSD-3-Clause
// Simplification by meshoptimizer (quadric errors: Garland and Heckbert 1997), nearest places by Embree's point
// queries.
#include "scene/cpm/surface.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <embree3/rtcore.h>
#include <meshoptimizer.h>

#include "base/vector.h"

#define LIFT 1e-5      // of the largest coordinate
#define ERROR_MAX 0.2f // of the mesh's extent, beyond which simplification stops

struct cpm_surface {
    size_t vertices, triangles;
    float *positions;
    unsigned *indices;
    float *uv; // triangles x 3 x 2
    bool file_charts;
    RTCDevice device;
    RTCScene scene;
    double lift; // by which rays leave it
};

void gonio_cpm_surface_free(cpm_surface *s) {
    if (s != NULL) {
        if (s->scene != NULL) {
            rtcReleaseScene(s->scene);
        }
        if (s->device != NULL) {
            rtcReleaseDevice(s->device);
        }
        free(s->positions);
        free(s->indices);
        free(s->uv);
        free(s);
    }
}

size_t gonio_cpm_surface_triangles(const cpm_surface *s) { return s->triangles; }
bool gonio_cpm_surface_has_file_charts(const cpm_surface *s) { return s->file_charts; }

static gonio_vec3 corner(const cpm_surface *s, size_t triangle, size_t k) {
    const float *p = s->positions + 3 * (size_t)s->indices[3 * triangle + k];
    return (gonio_vec3){(double)p[0], (double)p[1], (double)p[2]};
}

// ---- simplification ----

// Vertices of the same place (and texture coordinates, where those are kept) become one.
static bool weld(const scene_mesh *mesh, bool keep_uv, cpm_surface *s, float **uvs) {
    const size_t n = mesh->vertices;
    unsigned *remap = malloc(n * sizeof *remap);
    const struct meshopt_Stream streams[2] = {{mesh->positions, 3 * sizeof(float), 3 * sizeof(float)},
                                              {mesh->uvs, 2 * sizeof(float), 2 * sizeof(float)}};
    s->positions = malloc(3 * n * sizeof(float));
    s->indices = malloc(3 * mesh->triangles * sizeof(unsigned));
    *uvs = malloc(2 * n * sizeof(float));
    const bool good = remap != NULL && s->positions != NULL && s->indices != NULL && *uvs != NULL;
    if (good) {
        s->vertices =
            meshopt_generateVertexRemapMulti(remap, mesh->indices, 3 * mesh->triangles, n, streams, keep_uv ? 2 : 1);
        meshopt_remapIndexBuffer(s->indices, mesh->indices, 3 * mesh->triangles, remap);
        meshopt_remapVertexBuffer(s->positions, mesh->positions, n, 3 * sizeof(float), remap);
        meshopt_remapVertexBuffer(*uvs, mesh->uvs, n, 2 * sizeof(float), remap);
    }
    free(remap);
    return good;
}

// Triangles without an area carry no texels.
static void drop_degenerate(cpm_surface *s, size_t triangles) {
    s->triangles = 0;
    for (size_t t = 0; t < triangles; t++) {
        const gonio_vec3 a = corner(s, t, 0), n = cross(difference(corner(s, t, 1), a), difference(corner(s, t, 2), a));
        if (dot(n, n) > 0) {
            memmove(s->indices + 3 * s->triangles++, s->indices + 3 * t, 3 * sizeof *s->indices);
        }
    }
}

static bool in_unit_square(const scene_mesh *mesh) {
    for (size_t i = 0; i < 2 * mesh->vertices; i++) {
        if (!(mesh->uvs[i] >= 0 && mesh->uvs[i] <= 1)) {
            return false;
        }
    }
    return true;
}

static gonio_status simplify(const scene_mesh *mesh, const cpm_surface_options *o, cpm_surface *s, gonio_error *error) {
    float *uvs = NULL, reached;
    const size_t wanted = 3 * (size_t)fmin(fmax(4, o->share * (double)mesh->triangles), (double)mesh->triangles);
    bool good = weld(mesh, s->file_charts, s, &uvs);
    unsigned *less = good ? malloc(3 * mesh->triangles * sizeof *less) : NULL;
    if (less != NULL) {
        const size_t n = meshopt_simplify(less, s->indices, 3 * mesh->triangles, s->positions, s->vertices,
                                          3 * sizeof(float), wanted, ERROR_MAX, 0, &reached);
        memcpy(s->indices, less, n * sizeof *less);
        drop_degenerate(s, n / 3);
        s->uv = malloc((s->triangles * 6 + 1) * sizeof *s->uv);
        good = s->uv != NULL;
        for (size_t c = 0; good && s->file_charts && c < 3 * s->triangles; c++) {
            memcpy(s->uv + 2 * c, uvs + 2 * (size_t)s->indices[c], 2 * sizeof *uvs);
        }
        good = good && (s->file_charts || s->triangles == 0 ||
                        gonio_cpm_charts(s->positions, s->indices, s->triangles, o->resolution, s->uv));
    }
    free(uvs);
    free(less);
    if (less == NULL || !good) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to simplify a mesh of %zu triangles", mesh->triangles);
    }
    return s->triangles > 0 ? GONIO_OK
                            : gonio_fail(error, GONIO_E_INPUT, "nothing is left of the mesh when it is simplified");
}

// ---- nearest places ----

static bool build(cpm_surface *s) {
    s->device = rtcNewDevice("threads=1");
    if (s->device == NULL) {
        return false;
    }
    s->scene = rtcNewScene(s->device);
    rtcSetSceneFlags(s->scene, RTC_SCENE_FLAG_ROBUST); // no rays through shared edges
    for (size_t i = 0; i < 3 * s->vertices; i++) {
        s->lift = fmax(s->lift, LIFT * fabs((double)s->positions[i]));
    }
    RTCGeometry geometry = rtcNewGeometry(s->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    float *positions =
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), s->vertices);
    unsigned *indices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                3 * sizeof(unsigned), s->triangles);
    const bool good = positions != NULL && indices != NULL;
    if (good) {
        memcpy(positions, s->positions, 3 * s->vertices * sizeof(float));
        memcpy(indices, s->indices, 3 * s->triangles * sizeof(unsigned));
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(s->scene, geometry);
    }
    rtcReleaseGeometry(geometry);
    rtcCommitScene(s->scene);
    return good && rtcGetDeviceError(s->device) == RTC_ERROR_NONE;
}

typedef struct query {
    const cpm_surface *surface;
    gonio_vec3 point;
    double distance2;
    cpm_spot *spot;
} query;

// The nearest place of a triangle as barycentrics (Ericson, Real-Time Collision Detection, 2005, section 5.1.5).
static void nearest_of(gonio_vec3 p, gonio_vec3 a, gonio_vec3 b, gonio_vec3 c, double *u, double *v) {
    const gonio_vec3 ab = difference(b, a), ac = difference(c, a), ap = difference(p, a);
    const gonio_vec3 bp = difference(p, b), cp = difference(p, c);
    const double d1 = dot(ab, ap), d2 = dot(ac, ap), d3 = dot(ab, bp), d4 = dot(ac, bp);
    const double d5 = dot(ab, cp), d6 = dot(ac, cp);
    const double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
    *u = *v = 0;
    if (d1 <= 0 && d2 <= 0) {
        return;
    }
    if (d3 >= 0 && d4 <= d3) {
        *u = 1;
    } else if (vc <= 0 && d1 >= 0 && d3 <= 0) {
        *u = d1 / (d1 - d3);
    } else if (d6 >= 0 && d5 <= d6) {
        *v = 1;
    } else if (vb <= 0 && d2 >= 0 && d6 <= 0) {
        *v = d2 / (d2 - d6);
    } else if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
        *v = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        *u = 1 - *v;
    } else {
        *u = vb / (va + vb + vc);
        *v = vc / (va + vb + vc);
    }
}

// Is it nearer than what was found? Of equal ones the first in number, in whatever order they are shown.
static bool look_at(query *q, size_t triangle) {
    const cpm_surface *s = q->surface;
    const gonio_vec3 a = corner(s, triangle, 0), b = corner(s, triangle, 1), c = corner(s, triangle, 2);
    double u, v;
    nearest_of(q->point, a, b, c, &u, &v);
    const gonio_vec3 at = sum(scaled(a, 1 - u - v), sum(scaled(b, u), scaled(c, v))), d = difference(at, q->point);
    if (dot(d, d) < q->distance2 || (dot(d, d) == q->distance2 && triangle < q->spot->triangle)) {
        q->distance2 = dot(d, d);
        *q->spot = (cpm_spot){.triangle = triangle, .u = u, .v = v, .point = at};
        return true;
    }
    return false;
}

// A little more than the distance, so that what is as near is shown, too; and than float32 is off by.
static float radius_of(const query *q, gonio_vec3 p) {
    return (float)(sqrt(q->distance2) * 1.00001 + 1e-6 * (fabs(p.x) + fabs(p.y) + fabs(p.z)) + 1e-30);
}

static bool on_triangle(struct RTCPointQueryFunctionArguments *args) {
    query *q = args->userPtr;
    if (look_at(q, args->primID)) {
        args->query->radius = radius_of(q, q->point);
        return true;
    }
    return false;
}

void gonio_cpm_surface_nearest(const cpm_surface *s, gonio_vec3 point, size_t near, cpm_spot *spot) {
    struct RTCPointQueryContext context;
    query mine = {s, point, INFINITY, spot};
    *spot = (cpm_spot){.triangle = SIZE_MAX};
    look_at(&mine, near);
    struct RTCPointQuery q = {
        .x = (float)point.x, .y = (float)point.y, .z = (float)point.z, .radius = radius_of(&mine, point)};
    rtcInitPointQueryContext(&context);
    rtcPointQuery(s->scene, &q, &context, on_triangle, &mine);
    if (spot->triangle == SIZE_MAX) { // not for finite points
        *spot = (cpm_spot){.triangle = 0};
    }
    const float *uv = s->uv + 6 * spot->triangle;
    const double w = 1 - spot->u - spot->v;
    spot->s = w * (double)uv[0] + spot->u * (double)uv[2] + spot->v * (double)uv[4];
    spot->t = w * (double)uv[1] + spot->u * (double)uv[3] + spot->v * (double)uv[5];
}

// ---- rays ----

static struct RTCRay make_ray(gonio_vec3 origin, gonio_vec3 direction, double distance) {
    return (struct RTCRay){.org_x = (float)origin.x,
                           .org_y = (float)origin.y,
                           .org_z = (float)origin.z,
                           .dir_x = (float)direction.x,
                           .dir_y = (float)direction.y,
                           .dir_z = (float)direction.z,
                           .tfar = (float)distance,
                           .mask = ~0u};
}

bool gonio_cpm_surface_hit(const cpm_surface *s, gonio_vec3 origin, gonio_vec3 direction, gonio_vec3 *point,
                           gonio_vec3 *normal) {
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    struct RTCRayHit ray = {.ray = make_ray(origin, direction, INFINITY), .hit = {.geomID = RTC_INVALID_GEOMETRY_ID}};
    rtcIntersect1(s->scene, &context, &ray);
    if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) {
        return false;
    }
    const size_t t = ray.hit.primID;
    const double u = (double)ray.hit.u, v = (double)ray.hit.v;
    *point = sum(scaled(corner(s, t, 0), 1 - u - v), sum(scaled(corner(s, t, 1), u), scaled(corner(s, t, 2), v)));
    *normal = gonio_cpm_surface_normal(s, t);
    if (dot(*normal, direction) > 0) {
        *normal = scaled(*normal, -1);
    }
    return true;
}

bool gonio_cpm_surface_blocked(const cpm_surface *s, gonio_vec3 point, gonio_vec3 normal, gonio_vec3 direction,
                               double distance) {
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    struct RTCRay ray = make_ray(sum(point, scaled(normal, s->lift)), direction, fmax(0, distance - 2 * s->lift));
    rtcOccluded1(s->scene, &context, &ray);
    return ray.tfar < 0; // Embree's mark of an occluded ray
}

// ---- the texture ----

// Along the triangle a step is x ab + y ac, by least squares.
void gonio_cpm_surface_gradient(const cpm_surface *s, const cpm_spot *spot, gonio_vec3 step, double *ds, double *dt) {
    const gonio_vec3 a = corner(s, spot->triangle, 0);
    const gonio_vec3 ab = difference(corner(s, spot->triangle, 1), a), ac = difference(corner(s, spot->triangle, 2), a);
    const double bb = dot(ab, ab), bc = dot(ab, ac), cc = dot(ac, ac), b = dot(ab, step), c = dot(ac, step);
    const double determinant = bb * cc - bc * bc;
    const double x = determinant > 0 ? (b * cc - c * bc) / determinant : 0;
    const double y = determinant > 0 ? (c * bb - b * bc) / determinant : 0;
    const float *uv = s->uv + 6 * spot->triangle;
    *ds = x * (double)(uv[2] - uv[0]) + y * (double)(uv[4] - uv[0]);
    *dt = x * (double)(uv[3] - uv[1]) + y * (double)(uv[5] - uv[1]);
}

gonio_vec3 gonio_cpm_surface_normal(const cpm_surface *s, size_t triangle) {
    const gonio_vec3 a = corner(s, triangle, 0);
    return normalised(cross(difference(corner(s, triangle, 1), a), difference(corner(s, triangle, 2), a)));
}

gonio_status gonio_cpm_surface_new(const scene_mesh *mesh, bool has_uv, const cpm_surface_options *o, cpm_surface **out,
                                   gonio_error *error) {
    *out = NULL;
    cpm_surface *s = calloc(1, sizeof *s);
    if (s == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to simplify a mesh");
    }
    s->file_charts = has_uv && !o->own_charts && in_unit_square(mesh);
    gonio_status status = simplify(mesh, o, s, error);
    if (status == GONIO_OK && !build(s)) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for a mesh of %zu triangles", s->triangles);
    }
    if (status != GONIO_OK) {
        gonio_cpm_surface_free(s);
        return status;
    }
    *out = s;
    return GONIO_OK;
}

// ---- as bytes ----

typedef struct packed {
    uint64_t vertices, triangles, file_charts;
} packed;

static size_t bytes_of(const packed *p) {
    return sizeof *p + (size_t)p->vertices * 3 * sizeof(float) +
           (size_t)p->triangles * (3 * sizeof(unsigned) + 6 * sizeof(float));
}

static packed head_of(const cpm_surface *s) { return (packed){s->vertices, s->triangles, s->file_charts}; }

size_t gonio_cpm_surface_bytes(const cpm_surface *s) { return bytes_of(&(packed){s->vertices, s->triangles, 0}); }

void gonio_cpm_surface_pack(const cpm_surface *s, void *bytes) {
    const packed head = head_of(s);
    char *to = bytes;
    memcpy(to, &head, sizeof head);
    to += sizeof head;
    memcpy(to, s->positions, 3 * s->vertices * sizeof(float));
    to += 3 * s->vertices * sizeof(float);
    memcpy(to, s->indices, 3 * s->triangles * sizeof(unsigned));
    to += 3 * s->triangles * sizeof(unsigned);
    memcpy(to, s->uv, 6 * s->triangles * sizeof(float));
}

static bool are_sound(const cpm_surface *s) {
    for (size_t c = 0; c < 3 * s->triangles; c++) {
        if (s->indices[c] >= s->vertices) {
            return false;
        }
    }
    return true;
}

cpm_surface *gonio_cpm_surface_unpack(const void *bytes, size_t size) {
    packed head;
    if (size < sizeof head) {
        return NULL;
    }
    memcpy(&head, bytes, sizeof head);
    if (head.vertices > size || head.triangles > size || head.triangles == 0 || bytes_of(&head) != size) {
        return NULL;
    }
    cpm_surface *s = calloc(1, sizeof *s);
    if (s == NULL) {
        return NULL;
    }
    *s = (cpm_surface){.vertices = (size_t)head.vertices,
                       .triangles = (size_t)head.triangles,
                       .file_charts = head.file_charts != 0,
                       .positions = malloc(3 * head.vertices * sizeof(float)),
                       .indices = malloc(3 * head.triangles * sizeof(unsigned)),
                       .uv = malloc(6 * head.triangles * sizeof(float))};
    if (s->positions != NULL && s->indices != NULL && s->uv != NULL) {
        const char *from = (const char *)bytes + sizeof head;
        memcpy(s->positions, from, 3 * s->vertices * sizeof(float));
        from += 3 * s->vertices * sizeof(float);
        memcpy(s->indices, from, 3 * s->triangles * sizeof(unsigned));
        from += 3 * s->triangles * sizeof(unsigned);
        memcpy(s->uv, from, 6 * s->triangles * sizeof(float));
    }
    if (s->positions == NULL || s->indices == NULL || s->uv == NULL || !are_sound(s) || !build(s)) {
        gonio_cpm_surface_free(s);
        return NULL;
    }
    return s;
}
