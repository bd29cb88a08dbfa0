// One pose's exposures -> samples: checks, the merge of one pixel, and what concerns the whole pose.
#include "calib/internal.h"

#include <math.h>

// Thetas of a sphere's samples; beyond, a pixel's footprint covers several degrees.
#define SPHERE_THETA_MAX_DEG 85

bool pixel_used(const gonio_calib *calib, const geometry *g, size_t p, geometry_hit *hit, double *footprint) {
    if (calib->defect[p]) {
        return false;
    }
    const double x = calib->ray[2 * p], y = calib->ray[2 * p + 1];
    if (!calib->facts.sphere) {
        const double r = calib->facts.region_radius_mm;
        return geometry_plate(g, x, y, hit, footprint) && hit->irradiance > 0 &&
               hit->point.x * hit->point.x + hit->point.y * hit->point.y <= r * r;
    }
    if (!geometry_sphere(g, x, y, calib->facts.sphere_radius_mm, hit)) {
        return false;
    }
    const double limit = cos(gonio_radians(SPHERE_THETA_MAX_DEG));
    const gonio_vec3 n = hit->normal, i = hit->to_light, o = hit->to_camera;
    return n.x * i.x + n.y * i.y + n.z * i.z >= limit && n.x * o.x + n.y * o.y + n.z * o.z >= limit;
}

void pixel_merge(const gonio_calib *calib, size_t pixel, int n, const gonio_exposure *exposures, const double *scale,
                 merge_result *result) {
    merge_term terms[MERGE_MAX];
    for (int j = 0; j < n; j++) {
        terms[j] = term_of(calib, pixel, exposures[j].frame.pixels[pixel], exposures[j].frame.exposure_s, scale[j],
                           calib->flat[pixel] * scale[j]);
    }
    merge_pixel(&calib->noise, n, terms, result);
}

void uncertainty_common(const gonio_calib *calib, int n, const gonio_exposure *exposures, double value,
                        uncertainty *u) {
    const gonio_rig_facts *facts = &calib->facts;
    const double v2 = value * value;
    const double random = gonio_radians(facts->pointing_random_deg) * reference_slope(facts, calib->reference_theta_i);
    u->reference = v2 * facts->reference_relative_sigma * facts->reference_relative_sigma;
    // The reference's own pose was off by the axes' repeatability: its irradiance goes with cos(theta_i).
    u->alignment = v2 * random * random / calib->reference_poses;
    double clock = 0;
    bool measured = calib->monitored;
    for (int j = 0; j < n; j++) {
        clock += exposures[j].frame.stamp.clock_s / n;
        measured = measured && exposures[j].monitor > 0;
    }
    const double bound = facts->lamp_drift_per_h * (clock - calib->reference_clock_s) / 3600;
    u->drift = v2 * (measured ? calib->monitor_reference_variance : bound * bound);
}

double uncertainty_random(const uncertainty *u) { return sqrt(u->photon + u->read + u->monitor + u->stray_random); }

double uncertainty_systematic(const uncertainty *u) {
    return sqrt(u->dark + u->flat + u->reference + u->drift + u->stray + u->alignment);
}

gonio_status pose_estimates(const gonio_calib *calib, const gonio_pair *pose, int n, const gonio_exposure *exposures,
                            estimate_sink sink, void *context, gonio_error *error) {
    if (!calib->prepared) {
        return gonio_fail(error, GONIO_E_USAGE, "the calibration is not prepared");
    }
    if (n < 1 || n > MERGE_MAX) {
        return gonio_fail(error, GONIO_E_INPUT, "%d exposures of a pose; 1 to %d are possible", n, MERGE_MAX);
    }
    for (int j = 0; j < n; j++) {
        const gonio_status status = exposure_check(calib, &exposures[j], error);
        if (status != GONIO_OK) {
            return status;
        }
    }
    return calib->facts.sphere ? sphere_estimate(calib, pose, n, exposures, sink, context, error)
                               : plate_estimate(calib, pose, n, exposures, sink, context, error);
}

typedef struct collector {
    const gonio_calib *calib;
    gonio_samples *samples;
} collector;

static gonio_status collect(void *context, const estimate *e, gonio_error *error) {
    const collector *c = context;
    double random[3], systematic[3];
    for (int k = 0; k < c->calib->channels; k++) {
        random[k] = uncertainty_random(&e->variance[k]);
        systematic[k] = uncertainty_systematic(&e->variance[k]);
    }
    return gonio_samples_add(c->samples, &e->pair, e->value, random, systematic, error);
}

gonio_status gonio_calib_pose(const gonio_calib *calib, const gonio_pair *pose, int n, const gonio_exposure *exposures,
                              gonio_samples *samples, gonio_error *error) {
    if (samples->channels != calib->channels) {
        return gonio_fail(error, GONIO_E_USAGE, "a set of %d channels for a camera of %d", samples->channels,
                          calib->channels);
    }
    collector c = {calib, samples};
    return pose_estimates(calib, pose, n, exposures, collect, &c, error);
}
