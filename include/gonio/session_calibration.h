// SPDX-License-Identifier: BSD-3-Clause
// Frames -> radiance -> BRDF samples with an uncertainty.
//
// The order of calls: gonio_calib_new; the dark frames and the reference frames; gonio_calib_prepare; then for every
// pose gonio_calib_pose; where a reference was measured again at the end, gonio_calib_add_reference once more and
// gonio_calib_drift; at last gonio_calib_pointing. Plain functions of the frames: replay calls the same ones and gets
// the same bits.
//
// What a scan should take:
//   trap       (optional) a light trap on the table, the lamp on: 4 frames or more, about a second each
//   dark       >= 4 frames (better 16) at the shortest exposure that the scan may use and as many at the longest
//   reference  gonio_calib_bracket until it is done (it works before gonio_calib_prepare too), then the last exposure
//              again, 16 frames or more in all: the repeats give the gain and average the flat field's noise; and one
//              frame of eight times that exposure (which may fill a seventh of the range only), so that the saturation
//              level is measured, not assumed
#ifndef GONIO_SESSION_CALIBRATION_H
#define GONIO_SESSION_CALIBRATION_H

#include "gonio/export.h"
#include "gonio/model.h"
#include "gonio/rig.h"
#include "gonio/sample.h"

GONIO_BEGIN

typedef struct gonio_calib gonio_calib;

// A frame with what was journalled beside it.
typedef struct gonio_exposure {
    gonio_frame frame;
    double monitor;       // lamp monitor reading during it; NaN: none
    double monitor_sigma; // relative
    double utc_s;         // when it had arrived, seconds since 1970; 0: not told
    double monotonic_s;   // the same on a clock of this machine that nobody sets
} gonio_exposure;

typedef enum gonio_exposure_verdict {
    GONIO_EXPOSURE_DONE,  // every used pixel is well exposed somewhere
    GONIO_EXPOSURE_MORE,  // take *next_s too
    GONIO_EXPOSURE_LIMIT, // the camera's limits are reached; what lacks is in the pose's flags
} gonio_exposure_verdict;

// The light's theta at the reference steps; the camera stands at theta_o = 0.
#define GONIO_REFERENCE_THETA_I_DEG 45

// What gonio_calib_prepare found.
typedef struct gonio_calib_report {
    double gain_e_per_dn, read_noise_e, dark_e_per_s; // of linear DN
    double saturation_dn;                             // raw
    bool saturation_measured;                         // false: no frame saturated, so the camera's full scale
    int hot, noisy, dead;                             // defective pixels: dark signal, noise, response
    double flat_relative_sigma;                       // typical, of one pixel's responsivity
    double stray;                                     // as f_r of a sample at perpendicular light, 1/sr; 0: no trap
} gonio_calib_report;

// Standard uncertainty (1/sr) of one value, by cause. Photon, read, and the monitor's part of drift vary from pose to
// pose; the others are common to a session. angle, area (the averaged disc) and blur (finite light and aperture) need a
// model of the sample (0 without).
typedef struct gonio_budget {
    double value;
    double photon, read, dark, flat, reference, drift, stray, angle, area, blur;
    double random, systematic;   // as carried by the sample
    double area_bias, blur_bias; // relative, of the mean over the disc, and over light and aperture: what was corrected
} gonio_budget;

// What the finite light and aperture do: half the angle and the solid angle that each fills, seen from the sample's
// centre, half the angle by which directions vary over the averaged disc, and the relative bias that all three give the
// samples before it is corrected.
typedef struct gonio_blur {
    double light_deg, aperture_deg, region_deg;
    double light_sr, aperture_sr;
    double bias_median, bias_max;   // |bias| over the samples; 0 without a model
    double taken_median, taken_max; // of it, what was taken out
    double untouched;               // share of the samples of which nothing was: it counts as uncertainty there
} gonio_blur;

gonio_status gonio_calib_new(const gonio_camera_info *camera, const gonio_rig_facts *facts, const gonio_window *window,
                             gonio_calib **out, gonio_error *error);
void gonio_calib_free(gonio_calib *calib);
// Channels that the samples will have (1 mono, 3 Bayer) and their names.
int gonio_calib_channels(const gonio_calib *calib);
const char (*gonio_calib_channel_names(const gonio_calib *calib))[32];

// The shutter was closed. Frames are borrowed for the call only.
gonio_status gonio_calib_add_dark(gonio_calib *calib, const gonio_exposure *exposure, gonio_error *error);
// A light trap lay on the table and the lamp was on: what is seen is stray light, and is subtracted. Without such
// frames none is.
gonio_status gonio_calib_add_trap(gonio_calib *calib, const gonio_exposure *exposure, gonio_error *error);
// The white reference lay on the table at this pose.
gonio_status gonio_calib_add_reference(gonio_calib *calib, const gonio_pair *pose, const gonio_exposure *exposure,
                                       gonio_error *error);
// Derive dark maps, read noise, gain, flat field and scale. Polite failures are named: dark frame not dark, lamp off,
// reference overexposed, light trap that is not dark.
gonio_status gonio_calib_prepare(gonio_calib *calib, gonio_error *error);
// Write the flat field (relative responsivity of every pixel and its variance) for facts.flat_path of later sessions.
gonio_status gonio_calib_flat_save(const gonio_calib *calib, const char *path, gonio_error *error);
// The same maps, width x height, borrowed until gonio_calib_free: DN/s for unit f_r x relative irradiance, relative
// variance, and which pixels are defective (0: sound). After gonio_calib_prepare.
const float *gonio_calib_flat(const gonio_calib *calib);
const float *gonio_calib_flat_variance(const gonio_calib *calib);
const uint8_t *gonio_calib_defects(const gonio_calib *calib);
gonio_window gonio_calib_window(const gonio_calib *calib);
void gonio_calib_describe(const gonio_calib *calib, gonio_calib_report *report); // after gonio_calib_prepare

// After n exposures of the pose: enough, or which exposure next? Depends on the frames alone. n = 0 proposes the first
// exposure. Before gonio_calib_prepare the pose is taken as the reference's.
gonio_exposure_verdict gonio_calib_bracket(const gonio_calib *calib, const gonio_pair *pose, int n,
                                           const gonio_exposure *exposures, double *next_s);
// One pose's exposures -> samples added to `samples` (one for a flat plate, thousands for a sphere), sigma without the
// pointing term, which needs the slope of the BRDF: gonio_calib_pointing. GONIO_E_RANGE: the pose has no valid exposure
// (the message says what is wrong with it) and nothing was added; the scan may go on.
gonio_status gonio_calib_pose(const gonio_calib *calib, const gonio_pair *pose, int n, const gonio_exposure *exposures,
                              gonio_samples *samples, gonio_error *error);
// What of a pose reaches over the sample's edge (facts.sample_mm, facts.light_spot_mm), by its geometry alone. REGION,
// UNLIT: the averaged region does, or the lit spot does not cover it; gonio_calib_pose then gives no sample. SPILL: the
// lit spot does, so that light falls on what is beside the sample; the sample stands, but should be known as such.
// text: the worst of them in words.
enum { GONIO_EDGE_REGION = 1, GONIO_EDGE_UNLIT = 2, GONIO_EDGE_SPILL = 4 };
int gonio_calib_edges(const gonio_camera_info *camera, const gonio_rig_facts *facts, const gonio_pair *pose,
                      char text[256]);
// One frame, pixel by pixel: f_r times relative irradiance and its random variance (that of the flat field included);
// NaN where the pixel is saturated or defective. radiance, variance: the window's width x height. threads: 0 all; equal
// bits for any number.
gonio_status gonio_calib_radiance(const gonio_calib *calib, const gonio_exposure *exposure, int threads,
                                  float *radiance, float *variance, gonio_error *error);
// The pose's merged radiance (f_r times relative irradiance) at pixels of a lattice over the window that does not depend
// on the pose: what its samples are made of, before geometry. values: *count of them, NaN where a pixel has no valid
// exposure; mean: over the others, a channel each, NaN where there is none.
enum { GONIO_PROBES_MAX = 4096 };
gonio_status gonio_calib_probe(const gonio_calib *calib, int n, const gonio_exposure *exposures,
                               double values[GONIO_PROBES_MAX], size_t *count, double mean[3], gonio_error *error);
// After the reference was measured again: correct the samples for the lamp's drift between the two, linear in time, and
// replace the bound on drift in their systematic sigma by what remains. clock_s: the nominal clock of every sample.
// Does nothing where a monitor measured the lamp; *ratio (may be NULL): responsivity at the end / at the start.
gonio_status gonio_calib_drift(const gonio_calib *calib, const double *clock_s, gonio_samples *samples, double *ratio,
                               gonio_error *error);
// The budget of one pose's sample, budget[channels]; of a sphere's frame the sample nearest to `direction` (NULL: the
// pose). model: of the sample, for angle and area; NULL leaves them 0.
gonio_status gonio_calib_budget(const gonio_calib *calib, const gonio_pair *pose, int n,
                                const gonio_exposure *exposures, const gonio_model *model, const gonio_pair *direction,
                                gonio_budget *budget, gonio_error *error);
// model, samples: for the bias, with the model that was fitted to them; NULL without.
void gonio_calib_blur(const gonio_rig_facts *facts, const gonio_model *model, const gonio_samples *samples,
                      gonio_blur *blur);
// Add the angle, area and blur terms to the sigmas, from the slope of a model that was fitted to these samples, and
// correct the values for the curvature within what they average (docs/uncertainty.md). Once for a set.
gonio_status gonio_calib_pointing(const gonio_rig_facts *facts, const gonio_model *model, gonio_samples *samples,
                                  gonio_error *error);

GONIO_END
#endif
