// SPDX-License-Identifier: BSD-3-Clause
#include "scene/caster.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <embree3/rtcore.h>

#include "base/vector.h"

// How far a ray starts off the surface, of the largest coordinate: well above float32's 6e-8 and, of the sphere,
// Embree's own error (1e-6); well below a pixel.
#define LIFT_MESH 1e-5
#define LIFT_SPHERE 1e-4

struct scene_caster {
    RTCDevice device;
    RTCScene scene;
    const scene_mesh *mesh; // NULL: sphere
    double lift;
};

static bool unit(gonio_vec3 *v) {
    const double length = sqrt(dot(*v, *v));
    if (!(length > 1e-12)) { // also NaN
        return false;
    }
    *v = scaled(*v, 1 / length);
    return true;
}

// Embree owns the buffers: they are padded as it wants them.
static bool add_mesh(RTCDevice device, RTCScene scene, const scene_mesh *mesh) {
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    float *positions = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                               3 * sizeof(float), mesh->vertices);
    unsigned *indices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                3 * sizeof(unsigned), mesh->triangles);
    const bool good = positions != NULL && indices != NULL;
    if (good) {
        memcpy(positions, mesh->positions, mesh->vertices * 3 * sizeof(float));
        memcpy(indices, mesh->indices, mesh->triangles * 3 * sizeof(unsigned));
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(scene, geometry);
    }
    rtcReleaseGeometry(geometry);
    return good;
}

static bool add_sphere(RTCDevice device, RTCScene scene) {
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_SPHERE_POINT);
    float *sphere =
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, 4 * sizeof(float), 1);
    if (sphere != NULL) {
        memcpy(sphere, (const float[4]){0, 0, 0, 1}, 4 * sizeof(float));
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(scene, geometry);
    }
    rtcReleaseGeometry(geometry);
    return sphere != NULL;
}

static double lift_of(const scene_mesh *mesh) {
    double largest = 0;
    for (size_t i = 0; mesh != NULL && i < 3 * mesh->vertices; i++) {
        largest = fmax(largest, fabs((double)mesh->positions[i]));
    }
    return mesh != NULL ? LIFT_MESH * largest : LIFT_SPHERE;
}

gonio_status gonio_scene_caster_new(const scene_mesh *mesh, scene_caster **out, gonio_error *error) {
    *out = NULL;
    scene_caster *caster = calloc(1, sizeof *caster);
    if (caster == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the ray caster");
    }
    // One thread builds the hierarchy: the same one every time.
    caster->device = rtcNewDevice("threads=1");
    caster->mesh = mesh;
    caster->lift = lift_of(mesh);
    bool good = caster->device != NULL;
    if (good) {
        caster->scene = rtcNewScene(caster->device);
        rtcSetSceneFlags(caster->scene, RTC_SCENE_FLAG_ROBUST); // no light through shared edges
        good = mesh != NULL ? add_mesh(caster->device, caster->scene, mesh) : add_sphere(caster->device, caster->scene);
    }
    if (good) {
        rtcCommitScene(caster->scene);
    }
    const enum RTCError code = rtcGetDeviceError(caster->device);
    if (!good || code != RTC_ERROR_NONE) {
        gonio_scene_caster_free(caster);
        return gonio_fail(error, code == RTC_ERROR_OUT_OF_MEMORY ? GONIO_E_MEMORY : GONIO_E_FAILED,
                          "the ray caster cannot start (Embree error %d)", (int)code);
    }
    *out = caster;
    return GONIO_OK;
}

void gonio_scene_caster_free(scene_caster *caster) {
    if (caster != NULL) {
        if (caster->scene != NULL) {
            rtcReleaseScene(caster->scene);
        }
        if (caster->device != NULL) {
            rtcReleaseDevice(caster->device);
        }
        free(caster);
    }
}

static struct RTCRay make_ray(gonio_vec3 origin, gonio_vec3 direction) {
    return (struct RTCRay){.org_x = (float)origin.x,
                           .org_y = (float)origin.y,
                           .org_z = (float)origin.z,
                           .dir_x = (float)direction.x,
                           .dir_y = (float)direction.y,
                           .dir_z = (float)direction.z,
                           .tfar = INFINITY,
                           .mask = ~0u};
}

// A vertex attribute at the barycentric (u, v) of a triangle.
static gonio_vec3 blended(const float *attribute, const unsigned *corner, double u, double v) {
    double value[3];
    for (size_t k = 0; k < 3; k++) {
        value[k] = (1 - u - v) * (double)attribute[3 * corner[0] + k] + u * (double)attribute[3 * corner[1] + k] +
                   v * (double)attribute[3 * corner[2] + k];
    }
    return (gonio_vec3){value[0], value[1], value[2]};
}

// The wish, made perpendicular to the normal; where it is parallel, any other axis.
static gonio_vec3 tangent_of(gonio_vec3 normal, gonio_vec3 wish) {
    gonio_vec3 tangent = sum(wish, scaled(normal, -dot(wish, normal)));
    if (!unit(&tangent)) {
        const gonio_vec3 axis = fabs(normal.x) < 0.9 ? (gonio_vec3){1, 0, 0} : (gonio_vec3){0, 0, 1};
        tangent = sum(axis, scaled(normal, -dot(axis, normal)));
        unit(&tangent);
    }
    return tangent;
}

// Sets the frame at triangle, u and v.
static void shade_frame(const scene_caster *caster, gonio_vec3 toward_eye, scene_hit *out) {
    const gonio_vec3 up = {0, 1, 0};
    gonio_vec3 wish = {0, 0, 0};
    out->normal = out->facet;
    if (caster->mesh != NULL) {
        const scene_mesh *mesh = caster->mesh;
        const unsigned *corner = mesh->indices + 3 * out->triangle;
        gonio_vec3 normal = blended(mesh->normals, corner, out->u, out->v);
        out->normal = unit(&normal) ? normal : out->facet;
        if (dot(out->normal, out->facet) < 0) {
            out->normal = scaled(out->normal, -1);
        }
        if (mesh->tangents != NULL) {
            wish = blended(mesh->tangents, corner, out->u, out->v);
        }
    }
    // A blended normal may turn away from the eye at a silhouette; bent to graze it, it leaves no black rim.
    const double grazing = 1e-3, cosine = dot(out->normal, toward_eye);
    if (cosine < grazing) {
        out->normal = sum(out->normal, scaled(toward_eye, grazing - cosine));
        unit(&out->normal);
    }
    out->tangent = tangent_of(out->normal, dot(wish, wish) > 0 ? wish : cross(up, out->normal));
}

bool gonio_scene_caster_find(const scene_caster *caster, gonio_vec3 origin, gonio_vec3 direction, scene_hit *hit) {
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    struct RTCRayHit ray = {.ray = make_ray(origin, direction), .hit = {.geomID = RTC_INVALID_GEOMETRY_ID}};
    rtcIntersect1(caster->scene, &context, &ray);
    if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) {
        return false;
    }
    hit->distance = (double)ray.ray.tfar;
    hit->triangle = ray.hit.primID;
    hit->u = (double)ray.hit.u;
    hit->v = (double)ray.hit.v;
    // Of a mesh from its corners, which is better than float32's distance from afar.
    hit->point = caster->mesh != NULL
                     ? blended(caster->mesh->positions, caster->mesh->indices + 3 * hit->triangle, hit->u, hit->v)
                     : sum(origin, scaled(direction, hit->distance));
    hit->facet = (gonio_vec3){(double)ray.hit.Ng_x, (double)ray.hit.Ng_y, (double)ray.hit.Ng_z};
    const gonio_vec3 toward_eye = scaled(direction, -1);
    if (!unit(&hit->facet)) {
        hit->facet = toward_eye;
    }
    if (dot(hit->facet, toward_eye) < 0) {
        hit->facet = scaled(hit->facet, -1);
    }
    return true;
}

bool gonio_scene_caster_hit(const scene_caster *caster, gonio_vec3 origin, gonio_vec3 direction, scene_hit *hit) {
    if (!gonio_scene_caster_find(caster, origin, direction, hit)) {
        return false;
    }
    shade_frame(caster, scaled(direction, -1), hit);
    return true;
}

void gonio_scene_caster_surface(const scene_caster *caster, size_t triangle, double u, double v, gonio_vec3 toward_eye,
                                scene_hit *hit) {
    const unsigned *corner = caster->mesh->indices + 3 * triangle;
    const float *p = caster->mesh->positions;
    const gonio_vec3 a = blended(p, corner, 0, 0), b = blended(p, corner, 1, 0), c = blended(p, corner, 0, 1);
    *hit = (scene_hit){.triangle = triangle, .u = u, .v = v, .point = blended(p, corner, u, v)};
    hit->facet = cross(difference(b, a), difference(c, a));
    if (!unit(&hit->facet)) {
        hit->facet = toward_eye;
    }
    if (dot(hit->facet, toward_eye) < 0) {
        hit->facet = scaled(hit->facet, -1);
    }
    shade_frame(caster, toward_eye, hit);
}

unsigned gonio_scene_caster_stopped(const scene_caster *caster, int n, const gonio_vec3 *origins,
                                    const gonio_vec3 *directions) {
    return gonio_scene_caster_stopped_within(caster, n, origins, directions, NULL);
}

unsigned gonio_scene_caster_stopped_within(const scene_caster *caster, int n, const gonio_vec3 *origins,
                                           const gonio_vec3 *directions, const double *distances) {
    _Alignas(64) struct RTCRay16 ray;
    _Alignas(64) int valid[SCENE_CASTER_PACKET];
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    for (int k = 0; k < SCENE_CASTER_PACKET; k++) {
        const int from = k < n ? k : 0;
        valid[k] = k < n ? -1 : 0;
        ray.org_x[k] = (float)origins[from].x;
        ray.org_y[k] = (float)origins[from].y;
        ray.org_z[k] = (float)origins[from].z;
        ray.dir_x[k] = (float)directions[from].x;
        ray.dir_y[k] = (float)directions[from].y;
        ray.dir_z[k] = (float)directions[from].z;
        ray.tnear[k] = 0;
        ray.tfar[k] = distances == NULL ? INFINITY : (float)fmax(0, distances[from] - 2 * caster->lift);
        ray.time[k] = 0;
        ray.mask[k] = ~0u;
        ray.id[k] = (unsigned)k;
        ray.flags[k] = 0;
    }
    rtcOccluded16(valid, caster->scene, &context, &ray);
    unsigned stopped = 0;
    for (int k = 0; k < n; k++) {
        stopped |= (unsigned)(ray.tfar[k] < 0) << k;
    }
    return stopped;
}

gonio_vec3 gonio_scene_caster_leave(const scene_caster *caster, gonio_vec3 point, gonio_vec3 facet,
                                    gonio_vec3 direction) {
    return sum(point, scaled(facet, dot(facet, direction) < 0 ? -caster->lift : caster->lift));
}

bool gonio_scene_caster_blocked(const scene_caster *caster, gonio_vec3 point, gonio_vec3 facet, gonio_vec3 direction,
                                double distance) {
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    struct RTCRay ray = make_ray(gonio_scene_caster_leave(caster, point, facet, direction), direction);
    ray.tfar = (float)(distance < INFINITY ? fmax(0, distance - 2 * caster->lift) : distance);
    rtcOccluded1(caster->scene, &context, &ray);
    return ray.tfar < 0; // Embree's mark of an occluded ray
}

bool gonio_scene_caster_shadowed(const scene_caster *caster, const scene_hit *hit, gonio_vec3 toward_light) {
    return gonio_scene_caster_blocked(caster, hit->point, hit->facet, toward_light, INFINITY);
}
