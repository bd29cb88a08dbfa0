// SPDX-License-Identifier: BSD-3-Clause
// Calibrating the devices themselves, apart from a scan: the sensor's noise, the camera's geometry, its response.
// (What a scan needs of its own dark and reference frames is in calib.h.)
#ifndef GONIO_CHARACTERISE_H
#define GONIO_CHARACTERISE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "gonio/export.h"
#include "gonio/model.h"
#include "gonio/rig.h"
#include "gonio/status.h"

GONIO_BEGIN

// ---- images from files ----
// A grey or colour image, rows from the top, channels interleaved (r g b). 8-bit files keep their values 0..255.
typedef struct gonio_image {
    int width, height, channels, bits; // bits: 8 or 16, of the file's samples
    uint16_t *pixels;                  // width x height x channels
} gonio_image;
// Any format that OpenCV reads (PNG, TIFF, JPEG, PGM ...). grey: one channel, by luminance where the file has three.
// The caller frees it with gonio_image_free.
gonio_status gonio_image_read(const char *path, bool grey, gonio_image *image, gonio_error *error);
void gonio_image_free(gonio_image *image);
// Write it as PNG or TIFF, 8 or 16 bits, by the path's ending.
gonio_status gonio_image_write(const gonio_image *image, const char *path, gonio_error *error);
// Write a map of floats as 32-bit TIFF (the path ends in .tiff).
gonio_status gonio_map_write(const char *path, int width, int height, const float *values, gonio_error *error);

// ---- noise: photon transfer after EMVA 1288 ----
typedef struct gonio_noise gonio_noise;

typedef struct gonio_noise_report {
    double gain_e_per_dn, gain_relative_sigma;
    double read_noise_dn, read_noise_e, read_noise_relative_sigma; // quantisation taken off
    double dark_e_per_s, dark_e_per_s_sigma;
    double black_dn;
    double saturation_dn, saturation_e; // raw level; electrons above black
    bool saturation_measured;           // false: no group saturated, saturation_dn is the full scale
    double linearity_error;             // mean |relative deviation| from a line, 5 to 95 % of saturation
    double linearity_error_max;
    double dsnu_e, prnu; // spatial standard deviations; prnu relative, after a smooth illumination is taken off
    double snr_max, dynamic_range;
    int hot, noisy, dead; // defective pixels
    int points;           // exposures that the gain rests on
} gonio_noise_report;

// A series of frames of a steadily and evenly lit sensor at several exposures, and dark frames at (some of) the same
// exposures; at least two frames each. The caller frees it with gonio_noise_free.
gonio_status gonio_noise_new(int width, int height, int bits, gonio_noise **out, gonio_error *error);
void gonio_noise_free(gonio_noise *noise);
gonio_status gonio_noise_add(gonio_noise *noise, const uint16_t *pixels, double exposure_s, bool lit,
                             gonio_error *error);
gonio_status gonio_noise_solve(gonio_noise *noise, gonio_noise_report *report, gonio_error *error);
// After gonio_noise_solve: width x height, borrowed until gonio_noise_free. Offsets (DN, about the black level),
// relative responsivity (about 1, smooth part taken off), and which pixels are defective (0: sound).
const float *gonio_noise_dsnu_map(const gonio_noise *noise);
const float *gonio_noise_prnu_map(const gonio_noise *noise);
const uint8_t *gonio_noise_defects(const gonio_noise *noise);

// ---- the white reference's certificate ----
// Wavelength (nm), reflectance, its standard uncertainty; wavelengths rise.
typedef struct gonio_reflectance {
    int n;
    double (*row)[3];
} gonio_reflectance;
// CSV: nm,reflectance,sigma, '#' comments, an optional header. GONIO_E_INPUT with file and line. The caller frees it.
gonio_status gonio_reflectance_read(const char *path, gonio_reflectance *out, gonio_error *error);
void gonio_reflectance_free(gonio_reflectance *reflectance);
// Mean over a Gaussian band and its standard uncertainty (correlated over wavelength). fwhm 0: at one wavelength.
// GONIO_E_INPUT where the band leaves the table.
gonio_status gonio_reflectance_band(const gonio_reflectance *reflectance, double centre_nm, double fwhm_nm,
                                    double *value, double *sigma, gonio_error *error);
// Radiance factor at the reference geometry (45/0) over the directional-hemispherical reflectance at theta_i: what
// turns an "8 deg/hemispherical" certificate into what calibration needs. 1 for a Lambertian BRDF.
double gonio_reflectance_factor(const gonio_model *brdf, int channel, double theta_i_deg);

// ---- camera geometry from a board ----
typedef enum gonio_board_kind { GONIO_CHESSBOARD, GONIO_CHARUCO } gonio_board_kind;

// A flat board. Chessboard: columns x rows of inner corners. ChArUco: columns x rows of squares, their side and the
// markers' side, and the number of the dictionary as OpenCV counts them (5 = DICT_5X5_100).
typedef struct gonio_board {
    gonio_board_kind kind;
    int columns, rows;
    double square_mm, marker_mm;
    int dictionary;
} gonio_board;

#define GONIO_CORNERS_MAX 1024
// Corners found in one image: (u, v) in px, pixel centres at whole numbers, and (x, y) on the board in mm.
typedef struct gonio_corners {
    int n;
    double pixel[GONIO_CORNERS_MAX][2], board[GONIO_CORNERS_MAX][2];
} gonio_corners;

// One image's part in a calibration.
typedef struct gonio_view {
    bool used;
    char reason[160];                      // why it was not
    double rms;                            // reprojection, px
    double rotation[3], translation_mm[3]; // board to camera, OpenCV's (rotation vector)
} gonio_view;

typedef struct gonio_camera_calibration {
    int width, height, views_used;
    // fx fy cx cy (px), k1 k2 p1 p2 k3, in this order, and their standard uncertainties (k = 1). k3 is 0 with an
    // uncertainty of 0 where the corners do not ask for it.
    double value[9], sigma[9];
    double rms; // over all used corners, px
} gonio_camera_calibration;

// Draw the board to be printed: square_px pixels a square, a white margin of one square. The caller frees the image.
gonio_status gonio_board_draw(const gonio_board *board, int square_px, gonio_image *image, gonio_error *error);
// Find the board; sub-pixel positions from a window of +-half_window px. GONIO_E_INPUT with the reason where it is not
// there, or (ChArUco only: a chessboard is its own mirror image) where it is mirrored.
gonio_status gonio_board_find(const gonio_image *image, const gonio_board *board, int half_window,
                              gonio_corners *corners, gonio_error *error);
// Intrinsics from n views of size width x height (views with corners[i].n = 0 are left out; their reason stays). Views
// that fit far worse than the others are rejected. Fails for fewer than 3 views, or views too alike to tell the focal
// length.
gonio_status gonio_camera_calibrate(int n, const gonio_corners *corners, int width, int height, gonio_view *views,
                                    gonio_camera_calibration *out, gonio_error *error);
// Copy fx .. k3 into the camera's description.
void gonio_camera_apply(const gonio_camera_calibration *calibration, gonio_camera_info *camera);
// Where each pixel of an undistorted image is found in the distorted one: map[height][width][2] (u, v). For previews;
// radiometry never resamples.
gonio_status gonio_camera_undistortion_map(const gonio_camera_info *camera, float *map, gonio_error *error);

// ---- the rig's true axes, from frames at known counters ----
// What lies on the table. The board shows how the camera stands; a polished ball and a flat mirror (black glass) show
// by the lamp's highlight how the light stands: the ball from everywhere, the mirror a hundred times as sharply, but
// only about the mirror direction, and only up to its own tilt, which the ball settles.
typedef enum gonio_rig_object { GONIO_RIG_BOARD, GONIO_RIG_BALL, GONIO_RIG_MIRROR, GONIO_RIG_OBJECTS } gonio_rig_object;

// One frame of an object.
typedef struct gonio_rig_view {
    gonio_pair axes; // the counters, rad
    gonio_rig_object object;
    const gonio_corners *corners; // board: n = 0 leaves the view out (its reason stays); borrowed
    double highlight[2];          // ball, mirror: (u, v), px
    bool used;                    // ball, mirror: set where there is a highlight; then filled by gonio_rig_calibrate
    char reason[160];             // why it was not
    double rms;                   // reprojection, px
} gonio_rig_view;

// gonio_rig_options_default() first.
typedef struct gonio_rig_options {
    double light_distance_mm, camera_distance_mm; // nominal; the light's is known to about 20 mm only
    double pointing_random_deg;                   // repeatability of each axis
    double ball_radius_mm;
    double board_azimuth_deg; // of the board's right side, from the sample's +x
    bool reversible;          // the corners may come in reverse order: a chessboard
    double camera_sigma[9];   // of fx fy cx cy k1 k2 p1 p2 k3; 0: held
} gonio_rig_options;

typedef struct gonio_rig_report {
    int views[GONIO_RIG_OBJECTS];       // used
    double noise_px[GONIO_RIG_OBJECTS]; // of one coordinate, from the residuals
    // By axis (rig.h's order): angle to the sample's z (azimuths) or y (tilts); k = 1 of one component; the range of
    // the counters in the frames that tell of it.
    double tilt_deg[4], tilt_sigma_deg[4], range_deg[4];
    double
        origin_mm[2]; // of the sample's frame, where the camera's azimuth axis meets the board, from its first corner
    double direction_sigma_deg; // of a direction, one component, over the poses
} gonio_rig_report;

void gonio_rig_options_default(gonio_rig_options *options);
// The axes of both arms by least squares over all reprojections (calib/rig/rig_axes.c). The board defines the sample's
// frame: its face is z = 0, its right side points along +x (turned by board_azimuth_deg), and the origin is where the
// camera's azimuth axis meets it. GONIO_E_INPUT: too few views, none of the ball, a board that lies otherwise than
// stated. An axis that never moved keeps its place and a large uncertainty.
gonio_status gonio_rig_calibrate(const gonio_camera_info *camera, const gonio_rig_options *options, int n,
                                 gonio_rig_view *views, gonio_alignment *out, gonio_rig_report *report,
                                 gonio_error *error);

// The poses that a rig takes to calibrate itself: first of the board and the ball; then, aimed with the alignment that
// those gave (NULL: a perfect rig), of the mirror. Each returns how many, at most GONIO_RIG_POSES_MAX.
#define GONIO_RIG_POSES_MAX 256
typedef struct gonio_rig_pose {
    gonio_pair axes;
    gonio_rig_object object;
} gonio_rig_pose;
int gonio_rig_poses(gonio_rig_pose *poses);
int gonio_rig_mirror_poses(const gonio_alignment *alignment, gonio_rig_pose *poses);
// The centre of the one highlight in an image, px. GONIO_E_INPUT: there is none, it is cut by the image's edge, or
// there are several.
gonio_status gonio_highlight_find(const gonio_image *image, double at[2], gonio_error *error);
// Where a point of the sample's frame is seen from these counters. false: not in the frame.
bool gonio_rig_project(const gonio_camera_info *camera, const gonio_alignment *alignment, const gonio_pair *axes,
                       gonio_vec3 point, double pixel[2]);

// ---- has anything moved? ----
typedef struct gonio_motion {
    double shift_px[2]; // of the second frame against the first
    double correlation; // of the two once the shift is undone
    bool known;         // false: too little is seen in the first frame to tell, or no shift makes the second like it
    bool moved;         // known, by more than GONIO_MOTION_MAX_PX
} gonio_motion;
#define GONIO_MOTION_MAX_PX 0.5
// Two frames of the same thing from the same pose, grey and equal in size, at whatever brightness.
gonio_status gonio_motion_between(const gonio_image *first, const gonio_image *second, gonio_motion *motion,
                                  gonio_error *error);

// ---- response of a camera that is not linear ----
typedef enum gonio_response_method {
    GONIO_RESPONSE_SPLINE,    // monotone, no model assumed
    GONIO_RESPONSE_EMOR,      // Grossberg and Nayar's basis of real cameras, from their file emor.txt
    GONIO_RESPONSE_DEBEVEC,   // OpenCV; 8 bits, exposure times trusted
    GONIO_RESPONSE_ROBERTSON, // OpenCV; 8 bits, exposure times trusted
} gonio_response_method;

typedef struct gonio_response_options {
    gonio_response_method method;
    const char *emor_path;
    int terms;          // EMoR: how many basis functions
    double times_sigma; // relative standard uncertainty of the nominal exposure times; 0: exact
    double low, high;   // the range of relative values that is used
} gonio_response_options;

#define GONIO_RESPONSE_POINTS 257
#define GONIO_RESPONSE_FRAMES 64
// The curve: relative exposure of evenly spaced relative values 0..1 (1 at full scale), rising; and the exposure times
// as fitted. Response and times are known jointly up to a power only: the first and last times are held at nominal.
typedef struct gonio_response_curve {
    double exposure[GONIO_RESPONSE_POINTS];
    double low, high; // relative values between which readings are used
    int frames;
    double exposure_s[GONIO_RESPONSE_FRAMES];
    double rms_stops; // residuals, weighted
    // How far each image lies from what the others say, median |ln|, and whether that is so much more than theirs (it
    // is shifted, or something moved) that the merge leaves it out.
    double disagreement[GONIO_RESPONSE_FRAMES];
    bool rejected[GONIO_RESPONSE_FRAMES];
    // The relative values that the readings behind the curve really have: their 1 % and 99 % quantiles, in how many
    // pixels, and the widest gap between two of them. low and high are limits that were set.
    double covered_low, covered_high, covered_gap;
    int pixels;
} gonio_response_curve;

void gonio_response_options_default(gonio_response_options *options);
// From n images of one still scene, equal in size and kind, at different exposures. channel: 0..2 of colour images.
gonio_status gonio_response_fit(int n, const gonio_image *images, int channel, const double *exposure_s,
                                const gonio_response_options *options, gonio_response_curve *curve, gonio_error *error);
// Shift images of one scene that were taken by hand onto the one of middle exposure, by whole pixels (Ward's median
// threshold bitmaps, through OpenCV); what comes in from outside is 0. shifts (may be NULL): [n][2], u and v.
gonio_status gonio_images_align(int n, gonio_image *images, const double *exposure_s, int (*shifts)[2],
                                gonio_error *error);
// The CSV that gonio_rig_facts.response_path names.
gonio_status gonio_response_write(const gonio_response_curve *curve, const char *path, gonio_error *error);
// Relative radiance of every pixel (relative exposure / s), weighted by the curve's own precision; NaN: no valid
// exposure.
void gonio_response_merge(int n, const gonio_image *images, int channel, const gonio_response_curve *curve,
                          float *radiance);

GONIO_END
#endif
