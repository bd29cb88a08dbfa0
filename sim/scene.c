// SPDX-License-Identifier: BSD-3-Clause
// The image of one ray, in closed form: a plane or a sphere, so no ray caster is needed here.
#include "sim/scene.h"

#include <math.h>

#include "base/vector.h"

static gonio_vec3 add(gonio_vec3 a, double s, gonio_vec3 b) {
    return (gonio_vec3){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z};
}

// A direction turned about an axis: its part along the axis stays, the rest turns in the plane across.
static gonio_vec3 turn(const sim_axis *axis, double angle, gonio_vec3 v) {
    const gonio_vec3 origin = {0, 0, 0}, along = add(origin, dot(axis->direction, v), axis->direction);
    const gonio_vec3 across = add(v, -1, along);
    return add(add(along, cos(angle), across), sin(angle), cross(axis->direction, across));
}

static gonio_vec3 carry(const sim_axis *axis, double angle, gonio_vec3 point) {
    return add(axis->point, 1, turn(axis, angle, add(point, -1, axis->point)));
}

// What an arm carries: a point on the z axis at the given distance, and the directions right, up and outward there.
typedef struct arm {
    gonio_vec3 position, right, up, outward;
} arm;

static arm arm_at(const sim_axis *tilt, const sim_axis *azimuth, double theta, double phi, double distance) {
    const gonio_vec3 at_zero[3] = {{0, 1, 0}, {-1, 0, 0}, {0, 0, 1}};
    arm a = {.position = carry(azimuth, phi, carry(tilt, theta, (gonio_vec3){0, 0, distance}))};
    gonio_vec3 *const directions[3] = {&a.right, &a.up, &a.outward};
    for (int k = 0; k < 3; k++) {
        *directions[k] = turn(azimuth, phi, turn(tilt, theta, at_zero[k]));
    }
    return a;
}

void gonio_sim_axes_perfect(sim_axis axes[GONIO_AXES]) {
    static const gonio_vec3 z = {0, 0, 1}, y = {0, 1, 0}, origin = {0, 0, 0};
    axes[GONIO_LIGHT_THETA] = axes[GONIO_CAMERA_THETA] = (sim_axis){y, origin};
    axes[GONIO_LIGHT_PHI] = axes[GONIO_CAMERA_PHI] = (sim_axis){z, origin};
}

// Rings of eight, of equal area, every second one turned by half a step: no first moment, equal second ones.
void gonio_sim_disc_point(int k, int n, double *x, double *y) {
    const double r = sqrt((k / 8 + 0.5) / (n / 8)), angle = (k % 8 + 0.5 * (k / 8 % 2)) * GONIO_PI / 4;
    *x = r * cos(angle);
    *y = r * sin(angle);
}

// A lamp of finite size: points that share its power.
static void place_light(sim_scene *scene, const sim_settings *settings, const arm *light) {
    const double radius = settings->rig.light_radius_mm;
    scene->light_distance_mm = settings->rig.light_distance_mm;
    const gonio_vec3 origin = {0, 0, 0};
    const double spot = settings->rig.light_spot_mm / scene->light_distance_mm;
    scene->beam = add(origin, -1, light->outward);
    scene->beam_tan2 = spot > 0 ? spot * spot : INFINITY;
    scene->lights = radius > 0 ? SIM_LIGHT_POINTS : 1;
    for (int k = 0; k < scene->lights; k++) {
        double x = 0, y = 0;
        gonio_sim_disc_point(k, SIM_LIGHT_POINTS, &x, &y);
        scene->light[k] = add(add(light->position, radius * x, light->right), radius * y, light->up);
    }
}

void gonio_sim_scene_place(sim_scene *scene, const sim_settings *settings, const sim_axis *axes,
                           const double angles[GONIO_AXES]) {
    const gonio_vec3 origin = {0, 0, 0};
    sim_axis perfect[GONIO_AXES];
    if (axes == NULL) {
        gonio_sim_axes_perfect(perfect);
        axes = perfect;
    }
    const arm light = arm_at(&axes[GONIO_LIGHT_THETA], &axes[GONIO_LIGHT_PHI], angles[GONIO_LIGHT_THETA],
                             angles[GONIO_LIGHT_PHI], settings->rig.light_distance_mm);
    const arm camera = arm_at(&axes[GONIO_CAMERA_THETA], &axes[GONIO_CAMERA_PHI], angles[GONIO_CAMERA_THETA],
                              angles[GONIO_CAMERA_PHI], settings->rig.camera_distance_mm);
    place_light(scene, settings, &light);
    scene->camera = camera.position;
    scene->right = camera.right;
    scene->up = camera.up;
    scene->forward = add(origin, -1, camera.outward);
    scene->sphere = settings->sample.sphere == 1;
    scene->radius_mm = settings->sample.radius_mm;
    scene->half_plate_mm = settings->sample.plate_mm / 2;
    scene->half_panel_mm = settings->reference.panel_mm / 2;
}

// The sample is a thin sheet, which has a face on either side; of all else the back is dark.
static bool is_sheet(const sim_scene *scene) { return scene->target == GONIO_TARGET_SAMPLE && !scene->sphere; }

static bool hit_plane(const sim_scene *scene, gonio_vec3 ray, double half, gonio_vec3 *point) {
    if (!(ray.z * scene->camera.z < 0) || !(scene->camera.z > 0 || is_sheet(scene))) {
        return false;
    }
    *point = add(scene->camera, -scene->camera.z / ray.z, ray);
    point->z = 0;
    return fabs(point->x) <= half && fabs(point->y) <= half;
}

// The nearer root of |camera + s ray| = r; all from the centre.
static bool hit_sphere(gonio_vec3 camera, double r, gonio_vec3 ray, gonio_vec3 *point) {
    const double a = dot(ray, ray), b = dot(ray, camera);
    const double c = dot(camera, camera) - r * r, root = b * b - a * c;
    if (!(root >= 0) || !(c > 0)) {
        return false;
    }
    *point = add(camera, (-b - sqrt(root)) / a, ray);
    return true;
}

// Any frame about the normal (Duff et al. 2017, JCGT 6(1)): on a sphere the sample is isotropic.
static gonio_vec3 to_local(gonio_vec3 n, gonio_vec3 w) {
    const double s = copysign(1, n.z), a = -1 / (s + n.z), b = n.x * n.y * a;
    const gonio_vec3 t = {1 + s * n.x * n.x * a, s * b, -s * n.x}, u = {b, s + n.y * n.y * a, -n.y};
    return (gonio_vec3){dot(t, w), dot(u, w), dot(n, w)};
}

// Unit vector from the point; *distance2 its squared length.
static gonio_vec3 toward(gonio_vec3 from, gonio_vec3 to, double *distance2) {
    const gonio_vec3 d = add(to, -1, from), origin = {0, 0, 0};
    *distance2 = dot(d, d);
    return add(origin, 1 / sqrt(*distance2), d);
}

// pi f_r of what stands at the point; wi and wo in the local frame where the sample is a sphere.
static double pi_brdf(const sim_scene *scene, gonio_vec3 wi, gonio_vec3 wo, int channel) {
    switch (scene->target) {
    case GONIO_TARGET_REFERENCE:
        return scene->reflectance[channel];
    case GONIO_TARGET_BALL:
        return GONIO_PI * gonio_model_eval_channel(scene->ball, wi, wo, 0);
    case GONIO_TARGET_MIRROR:
        return GONIO_PI * gonio_model_eval_channel(scene->mirror, wi, wo, 0);
    case GONIO_TARGET_FIDUCIAL:
        return 1; // the picture multiplies it
    default:
        return GONIO_PI * gonio_model_eval_channel(scene->sample, wi, wo, channel);
    }
}

// Is the point inside the beam of this part of the lamp?
static bool lit(const sim_scene *scene, gonio_vec3 point, gonio_vec3 light) {
    const gonio_vec3 way = add(point, -1, light);
    const double along = dot(way, scene->beam);
    return !isfinite(scene->beam_tan2) || dot(way, way) <= along * along * (1 + scene->beam_tan2);
}

static double scattered(const sim_scene *scene, gonio_vec3 point, gonio_vec3 normal, bool curved, int channel) {
    double distance2, sum = 0;
    gonio_vec3 wo = toward(point, scene->camera, &distance2);
    wo = curved ? to_local(normal, wo) : wo;
    const bool sheet = is_sheet(scene);
    if (!(wo.z > 0) && !sheet) {
        return 0;
    }
    for (int k = 0; k < scene->lights; k++) {
        gonio_vec3 wi = toward(point, scene->light[k], &distance2);
        wi = curved ? to_local(normal, wi) : wi;
        if ((wi.z > 0 || sheet) && lit(scene, point, scene->light[k])) {
            sum += pi_brdf(scene, wi, wo, channel) * fabs(wi.z) * scene->light_distance_mm * scene->light_distance_mm /
                   distance2;
        }
    }
    // A fitted model may undershoot; light cannot. fmax takes NaN to 0 too.
    return fmax(0, sum / scene->lights);
}

// Rays that average the picture over one pixel, since its edges lie within pixels: Hammersley's points. No two share a
// column or a row, so that an edge along the pixels' sides, as an upright board has them, moves the mean in steps of a
// 32nd. On a grid of 4 x 4 it moves in quarters, and the corners that are found between such edges are up to 0.3 px
// off. Of all angles and places of an edge, the share of the pixel beyond it is wrong by 0.023 rms (grid: 0.029; 16
// points: 0.037), within 3 deg of the sides by 0.010 (0.055; 0.017).
#define TEXTURE_BITS 5
#define TEXTURE_RAYS (1 << TEXTURE_BITS)

static gonio_vec3 ray_of(const sim_scene *scene, double x, double y) {
    return add(add(scene->forward, x, scene->right), -y, scene->up);
}

// The bits of k in reverse order: van der Corput's sequence times TEXTURE_RAYS.
static int reversed(int k) {
    int r = 0;
    for (int bit = 0; bit < TEXTURE_BITS; bit++) {
        r = r << 1 | (k >> bit & 1);
    }
    return r;
}

// The picture's mean reflectance over the pixel about (x, y).
static double picture(const sim_scene *scene, double x, double y) {
    const sim_texture *t = scene->texture;
    double sum = 0;
    for (int k = 0; k < TEXTURE_RAYS && t != NULL && t->pixels != NULL; k++) {
        const double dx = (k + 0.5) / TEXTURE_RAYS - 0.5, dy = (reversed(k) + 0.5) / TEXTURE_RAYS - 0.5;
        gonio_vec3 point;
        if (hit_plane(scene, ray_of(scene, x + dx * scene->pixel, y + dy * scene->pixel), INFINITY, &point)) {
            const double column = floor(point.x / t->mm_per_px + t->width / 2.0);
            const double row = floor(t->height / 2.0 - point.y / t->mm_per_px);
            const bool inside = column >= 0 && row >= 0 && column < t->width && row < t->height;
            sum += inside ? (double)t->pixels[(size_t)row * (size_t)t->width + (size_t)column] : 0;
        }
    }
    return sum / TEXTURE_RAYS;
}

// A sphere's point and normal: the sample's or the ball's.
static bool hit_round(const sim_scene *scene, gonio_vec3 ray, gonio_vec3 *point, gonio_vec3 *normal) {
    const bool ball = scene->target == GONIO_TARGET_BALL;
    const gonio_vec3 origin = {0, 0, 0}, centre = ball ? scene->ball_centre : origin;
    const double radius = ball ? scene->ball_radius_mm : scene->radius_mm;
    if (!hit_sphere(add(scene->camera, -1, centre), radius, ray, point)) {
        return false;
    }
    *normal = add(origin, 1 / radius, *point);
    *point = add(*point, 1, centre);
    return true;
}

double gonio_sim_scene_radiance(const sim_scene *scene, double x, double y, int channel) {
    const gonio_vec3 ray = ray_of(scene, x, y);
    gonio_vec3 point, normal = {0, 0, 1};
    if (scene->target == GONIO_TARGET_TRAP) {
        return 0;
    }
    if (scene->target == GONIO_TARGET_BALL || (scene->sphere && scene->target == GONIO_TARGET_SAMPLE)) {
        return hit_round(scene, ray, &point, &normal) ? scattered(scene, point, normal, true, channel) : 0;
    }
    if (scene->target == GONIO_TARGET_FIDUCIAL) {
        return hit_plane(scene, ray, INFINITY, &point)
                   ? picture(scene, x, y) * scattered(scene, point, normal, false, channel)
                   : 0;
    }
    const double half = scene->target == GONIO_TARGET_REFERENCE ? scene->half_panel_mm : scene->half_plate_mm;
    return hit_plane(scene, ray, half, &point) ? scattered(scene, point, normal, false, channel) : 0;
}
