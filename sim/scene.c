// The image of one ray, in closed form: a plane or a sphere, so no ray caster is needed here.
#include "sim/scene.h"

#include <math.h>

static gonio_vec3 add(gonio_vec3 a, double s, gonio_vec3 b) {
    return (gonio_vec3){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z};
}
static double dot(gonio_vec3 a, gonio_vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

// Right, up and the direction outward of an arm at (theta, phi); see rig.h.
static void arm_axes(double theta, double phi, gonio_vec3 *right, gonio_vec3 *up, gonio_vec3 *outward) {
    const double ct = cos(theta), st = sin(theta), cp = cos(phi), sp = sin(phi);
    *right = (gonio_vec3){-sp, cp, 0};
    *up = (gonio_vec3){-ct * cp, -ct * sp, st};
    *outward = (gonio_vec3){st * cp, st * sp, ct};
}

// Rings of eight, of equal area, every second one turned by half a step: no first moment, equal second ones.
void sim_disc_point(int k, int n, double *x, double *y) {
    const double r = sqrt((k / 8 + 0.5) / (n / 8)), angle = (k % 8 + 0.5 * (k / 8 % 2)) * GONIO_PI / 4;
    *x = r * cos(angle);
    *y = r * sin(angle);
}

// A lamp of finite size: points that share its power.
static void place_light(sim_scene *scene, const sim_settings *settings, double theta, double phi) {
    const gonio_vec3 origin = {0, 0, 0};
    gonio_vec3 right, up, outward;
    arm_axes(theta, phi, &right, &up, &outward);
    const double radius = settings->rig.light_radius_mm;
    scene->light_distance_mm = settings->rig.light_distance_mm;
    scene->lights = radius > 0 ? SIM_LIGHT_POINTS : 1;
    const gonio_vec3 centre = add(origin, scene->light_distance_mm, outward);
    for (int k = 0; k < scene->lights; k++) {
        double x = 0, y = 0;
        sim_disc_point(k, SIM_LIGHT_POINTS, &x, &y);
        scene->light[k] = add(add(centre, radius * x, right), radius * y, up);
    }
}

void sim_scene_place(sim_scene *scene, const sim_settings *settings, const double angles[GONIO_AXES]) {
    const gonio_vec3 origin = {0, 0, 0};
    gonio_vec3 outward;
    place_light(scene, settings, angles[GONIO_LIGHT_THETA], angles[GONIO_LIGHT_PHI]);
    arm_axes(angles[GONIO_CAMERA_THETA], angles[GONIO_CAMERA_PHI], &scene->right, &scene->up, &outward);
    scene->camera = add(origin, settings->rig.camera_distance_mm, outward);
    scene->forward = add(origin, -1, outward);
    scene->sphere = settings->sample.sphere == 1;
    scene->radius_mm = settings->sample.radius_mm;
    scene->half_plate_mm = settings->sample.plate_mm / 2;
    scene->half_panel_mm = settings->reference.panel_mm / 2;
}

static bool hit_plane(const sim_scene *scene, gonio_vec3 ray, double half, gonio_vec3 *point) {
    if (!(ray.z < 0) || !(scene->camera.z > 0)) {
        return false;
    }
    *point = add(scene->camera, -scene->camera.z / ray.z, ray);
    point->z = 0;
    return fabs(point->x) <= half && fabs(point->y) <= half;
}

// The nearer root of |C + s ray| = r.
static bool hit_sphere(const sim_scene *scene, gonio_vec3 ray, gonio_vec3 *point) {
    const double a = dot(ray, ray), b = dot(ray, scene->camera), r = scene->radius_mm;
    const double c = dot(scene->camera, scene->camera) - r * r, root = b * b - a * c;
    if (!(root >= 0) || !(c > 0)) {
        return false;
    }
    *point = add(scene->camera, (-b - sqrt(root)) / a, ray);
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

static double reflected(const sim_scene *scene, gonio_vec3 point, gonio_vec3 normal, int channel) {
    double distance2, sum = 0;
    const bool sphere = scene->sphere && scene->target == GONIO_TARGET_SAMPLE;
    gonio_vec3 wo = toward(point, scene->camera, &distance2);
    wo = sphere ? to_local(normal, wo) : wo;
    if (!(wo.z > 0)) {
        return 0;
    }
    for (int k = 0; k < scene->lights; k++) {
        gonio_vec3 wi = toward(point, scene->light[k], &distance2);
        wi = sphere ? to_local(normal, wi) : wi;
        if (wi.z > 0) {
            const double pi_f = scene->target == GONIO_TARGET_REFERENCE
                                    ? scene->reflectance[channel]
                                    : GONIO_PI * gonio_model_eval_channel(scene->sample, wi, wo, channel);
            sum += pi_f * wi.z * scene->light_distance_mm * scene->light_distance_mm / distance2;
        }
    }
    // A fitted model may undershoot; light cannot. fmax takes NaN to 0 too.
    return fmax(0, sum / scene->lights);
}

double sim_scene_radiance(const sim_scene *scene, double x, double y, int channel) {
    const gonio_vec3 ray = add(add(scene->forward, x, scene->right), -y, scene->up);
    gonio_vec3 point, normal = {0, 0, 1};
    if (scene->target == GONIO_TARGET_TRAP) {
        return 0;
    }
    if (scene->sphere && scene->target == GONIO_TARGET_SAMPLE) {
        if (!hit_sphere(scene, ray, &point)) {
            return 0;
        }
        const gonio_vec3 origin = {0, 0, 0};
        normal = add(origin, 1 / scene->radius_mm, point);
    } else if (!hit_plane(scene, ray,
                          scene->target == GONIO_TARGET_REFERENCE ? scene->half_panel_mm : scene->half_plate_mm,
                          &point)) {
        return 0;
    }
    return reflected(scene, point, normal, channel);
}
