// SPDX-License-Identifier: BSD-3-Clause
// The white reference: what it returns at the angles of a pixel.
//
// Its reflectance is stated as the radiance factor pi f_r of the reference geometry, light at 45 deg and camera at the
// normal. A panel that is not Lambertian returns another share at the slightly different angles that each pixel has
// (the light and the camera are at finite distances, and the arms may be misaligned): the shape of its own BRDF,
// measured or tabulated, scaled to 1 at the reference geometry, tells which.
//
// Where an irradiance reading gives the scale, the reference is a source of known radiance L: a sample that returned L
// under the lamp's irradiance E would have f_r cos(theta_i) = L / E.
#include <math.h>

#include "calib/internal.h"

static double shape_at(const gonio_calib *calib, gonio_vec3 wi, gonio_vec3 wo, int channel) {
    return gonio_model_eval_channel(calib->white, wi, wo, channel < calib->white->channels ? channel : 0);
}

gonio_status gonio_white_open(gonio_calib *calib, gonio_error *error) {
    const char *path = calib->facts.reference_brdf;
    gonio_status status = gonio_model_resolve(path, &calib->white, error);
    const gonio_vec3 wi = gonio_direction(gonio_radians(GONIO_REFERENCE_THETA_I_DEG), 0), wo = {0, 0, 1};
    for (int c = 0; status == GONIO_OK && c < calib->channels; c++) {
        calib->white_scale[c] = shape_at(calib, wi, wo, c);
        if (!(calib->white_scale[c] > 0 && isfinite(calib->white_scale[c]))) {
            status = gonio_fail_line(error, GONIO_E_INPUT, path, -1,
                                     "the reference's BRDF is %g at 45 deg, seen from the normal; it must be above 0",
                                     calib->white_scale[c]);
        }
    }
    return status;
}

double gonio_white_signal(const gonio_calib *calib, const geometry_hit *hit, int channel) {
    if (scale_by_irradiance(&calib->facts)) {
        return calib->facts.reference_radiance / calib->facts.irradiance;
    }
    const double lambertian = calib->facts.reference_reflectance[channel] / GONIO_PI * hit->irradiance;
    if (calib->white == NULL) {
        return lambertian;
    }
    return lambertian * shape_at(calib, hit->to_light, hit->to_camera, channel) / calib->white_scale[channel];
}
