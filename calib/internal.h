// SPDX-License-Identifier: BSD-3-Clause
// What the files of calib/ share: the state behind gonio_calib and the uncertainty of one value.
#ifndef CALIB_INTERNAL_H
#define CALIB_INTERNAL_H

#include <math.h>

#include "calib/geometry.h"
#include "calib/radiance/merge.h"
#include "gonio/session_calibration.h"

// A copy of a dark or reference frame, kept until the maps are made.
typedef struct stored_frame {
    uint16_t *pixels;
    double exposure_s, gain_db, monitor, monitor_sigma;
    gonio_stamp stamp;
    gonio_pair pose; // reference frames
} stored_frame;

typedef struct stored_frames {
    stored_frame *items;
    int n;
} stored_frames;

// A camera response: points of the curve, and, once the black level is known, tables that undo it: linear DN and
// d linear / d raw for every raw value. No points: a linear camera.
typedef struct response {
    int levels, points;
    double *exposure, *value; // [points], both 0..1, rising
    float *linear, *slope;    // [levels]; NULL: not yet tabulated, or linear
} response;

struct gonio_calib {
    gonio_camera_info camera;
    gonio_rig_facts facts;
    gonio_window window;
    int channels;
    char names[3][32];
    size_t pixels;
    float *ray;       // [pixels][2]: undistorted pixel centres on the plane Z = 1
    uint8_t *channel; // of each pixel
    response response;
    stored_frames dark, trap, reference, later; // later: reference frames after gonio_calib_prepare
    bool prepared;
    // From dark frames: bias (linear DN), dark rate (DN/s), their covariance a pixel {b b, b rate, rate rate}.
    float *bias, *dark_rate;
    double dark_covariance[3];
    // From light-trap frames: stray light (DN/s at the reference's lamp level), its variance from noise, and how it
    // hangs on the dark maps: d stray / d bias and d dark rate. All 0 without a trap.
    float *stray;
    double stray_variance, stray_bias, stray_rate;
    double dark_quantum; // quantisation variance at the bias level, linear DN^2: part of the noise of dark frames
    uint8_t *defect;     // not 0: never used
    gonio_model *white;  // the reference's own BRDF, NULL: Lambertian; and its value at the reference geometry
    double white_scale[3];
    float *known_flat; // [2][pixels] from a file: relative responsivity, relative variance; NULL: none
    // From reference frames: responsivity (DN/s for unit f_r x relative irradiance) and its relative variance.
    float *flat, *flat_variance;
    merge_noise noise;
    int saturation; // raw DN from which a pixel counts as clipped
    double gain_db;
    bool monitored;                    // every reference frame had a lamp reading
    double monitor_reference;          // mean reading that the responsivity refers to
    double monitor_reference_variance; // relative, of the responsivity
    int reference_poses;
    double reference_clock_s, reference_theta_i;
    gonio_calib_report report;
};

// Variances (1/sr^2) of one value, by cause.
typedef struct uncertainty {
    double photon, read, monitor, stray_random;            // from pose to pose
    double dark, flat, reference, drift, stray, alignment; // common to poses
} uncertainty;

// One sample before it is added: its directions, and value and uncertainty of each channel.
typedef struct estimate {
    gonio_pair pair;
    double value[3];
    uncertainty variance[3];
} estimate;

// Receives each estimate of a pose.
typedef gonio_status (*estimate_sink)(void *context, const estimate *e, gonio_error *error);

static inline double linear_dn(const gonio_calib *calib, uint16_t raw) {
    const response *r = &calib->response;
    return r->linear == NULL ? raw : r->linear[raw < r->levels ? raw : r->levels - 1];
}

// Quantisation variance in linear DN: a step of 1 raw DN, uniformly distributed.
static inline double quantum_variance(const gonio_calib *calib, uint16_t raw) {
    const response *r = &calib->response;
    const double step = r->slope == NULL ? 1 : r->slope[raw < r->levels ? raw : r->levels - 1];
    return step * step / 12;
}

// Exposure times lamp: the DN that unit responsivity and radiance give.
static inline double exposure_scale(const gonio_calib *calib, double exposure_s, double monitor) {
    return exposure_s * (calib->monitored && monitor > 0 ? monitor / calib->monitor_reference : 1);
}

// Does an irradiance reading give the absolute scale, so that the lamp does not light the reference?
static inline bool scale_by_irradiance(const gonio_rig_facts *facts) {
    return facts->irradiance > 0 && facts->reference_radiance > 0;
}

// How the scale follows an error of the light's theta at the reference, relative a radian: through cos(theta_i).
static inline double reference_slope(const gonio_rig_facts *facts, double theta_i) {
    return scale_by_irradiance(facts) ? 0 : tan(theta_i);
}

// exposure_scale of a reference frame.
static inline double reference_scale(const gonio_calib *calib, const stored_frame *f) {
    return scale_by_irradiance(&calib->facts) ? f->exposure_s : exposure_scale(calib, f->exposure_s, f->monitor);
}

// A pixel's reading as the merge wants it; lit_s: its exposure_scale; scale: lit_s times what unit radiance gives.
static inline merge_term term_of(const gonio_calib *calib, size_t pixel, uint16_t raw, double exposure_s, double lit_s,
                                 double scale) {
    const double dark = calib->dark_rate[pixel] * exposure_s + calib->stray[pixel] * lit_s;
    return (merge_term){.signal = linear_dn(calib, raw) - calib->bias[pixel] - dark,
                        .scale = scale,
                        .dark = dark > 0 ? dark : 0,
                        .quantum_variance = quantum_variance(calib, raw),
                        .clipped = raw >= calib->saturation};
}

gonio_status gonio_response_load(const char *path, int bits, response *out, gonio_error *error);
// A camera digitises black + (full scale - black) curve(exposure), so the tables need the black level (raw DN).
gonio_status gonio_response_tabulate(response *r, double black, gonio_error *error);
void gonio_response_free(response *r);

// The steps of gonio_calib_prepare, in this order.
gonio_status gonio_dark_prepare(gonio_calib *calib, gonio_error *error);
gonio_status gonio_transfer_prepare(gonio_calib *calib, gonio_error *error); // saturation, gain
gonio_status gonio_stray_prepare(gonio_calib *calib, gonio_error *error);    // lamp readings, stray light
gonio_status gonio_flat_prepare(gonio_calib *calib, gonio_error *error);
void gonio_stray_describe(gonio_calib *calib); // what the report says of it

// The reference's BRDF and the flat field that the facts name.
gonio_status gonio_white_open(gonio_calib *calib, gonio_error *error);
gonio_status gonio_flat_open(gonio_calib *calib, gonio_error *error);
// What the reference returns at these angles: f_r x relative irradiance.
double gonio_white_signal(const gonio_calib *calib, const geometry_hit *hit, int channel);
// Mean responsivity of each channel's sound pixels.
void gonio_flat_means(const gonio_calib *calib, double mean[3]);

// Refuse exposures that do not fit this calibration: wrong window, exposure or gain.
gonio_status gonio_exposure_check(const gonio_calib *calib, const gonio_exposure *exposure, gonio_error *error);
// Does the pixel see the sample inside the used region?
bool gonio_pixel_used(const gonio_calib *calib, const geometry *g, size_t pixel, geometry_hit *hit, double *footprint);
// Merge one prepared pixel's exposures into f_r x irradiance.
void gonio_pixel_merge(const gonio_calib *calib, size_t pixel, int n, const gonio_exposure *exposures,
                       const double *scale, merge_result *result);
// How one pixel's merged value hangs on what is common to all poses.
typedef struct sensitivity {
    double bias, rate, stray; // d value / d bias, d dark rate, d stray light
} sensitivity;
sensitivity gonio_sensitivity_of(const gonio_calib *calib, int n, const gonio_exposure *exposures, const double *scale,
                                 const merge_result *merged);
// Variance of a pixel's value by the errors of the dark maps.
double gonio_dark_variance(const gonio_calib *calib, const sensitivity *s);
// Mean over the window of what its pixels see (f_r x irradiance), a channel.
void gonio_stray_surroundings(const gonio_calib *calib, int n, const gonio_exposure *exposures, const double *scale,
                              double mean[3]);
// Variance of f_r x irradiance `seen` by the lens' veiling glare, with these surroundings.
double gonio_glare_variance(const gonio_calib *calib, double seen, double surroundings);
// Variances that concern the whole pose, relative to the value.
void gonio_uncertainty_common(const gonio_calib *calib, int n, const gonio_exposure *exposures, double value,
                              uncertainty *u);
double gonio_uncertainty_random(const uncertainty *u);
double gonio_uncertainty_systematic(const uncertainty *u);

// Every sample of a pose, in a fixed order.
gonio_status gonio_plate_estimate(const gonio_calib *calib, const gonio_pair *pose, int n,
                                  const gonio_exposure *exposures, estimate_sink sink, void *context,
                                  gonio_error *error);
gonio_status gonio_sphere_estimate(const gonio_calib *calib, const gonio_pair *pose, int n,
                                   const gonio_exposure *exposures, estimate_sink sink, void *context,
                                   gonio_error *error);
gonio_status gonio_pose_estimates(const gonio_calib *calib, const gonio_pair *pose, int n,
                                  const gonio_exposure *exposures, estimate_sink sink, void *context,
                                  gonio_error *error);

// What a sample averages moves its value by `bias`, relative, of which `rest` is left unknown.
typedef struct blur_bias {
    double bias, rest;
} blur_bias;
typedef struct blur_terms {
    blur_bias area, light, aperture;
} blur_terms;
// centre: the model's value at the pair, above 0.
blur_terms gonio_blur_of(const gonio_rig_facts *facts, const gonio_model *model, int channel, const gonio_pair *pair,
                         double centre);

// Angle, area and blur terms of one sample: variances relative to the value, and the factor that takes the mean over
// disc, light and aperture to the value at the nominal directions.
typedef struct slope_terms {
    double angle_random, angle_systematic, area, blur, factor;
    double area_bias, blur_bias; // relative, what the factor takes out
} slope_terms;
void gonio_blur_correct(const gonio_rig_facts *facts, const gonio_model *model, int channel, const gonio_pair *pair,
                        double centre, double measured, slope_terms *terms);
// measured: the sample's value, against which the model's curvature is judged.
slope_terms gonio_slope_terms_of(const gonio_rig_facts *facts, const gonio_model *model, int channel,
                                 const gonio_pair *pair, double measured);

#endif
