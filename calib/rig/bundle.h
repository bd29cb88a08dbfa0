// SPDX-License-Identifier: BSD-3-Clause
// The least-squares problem behind gonio_rig_calibrate: its parameters, its frames, its residuals.
#ifndef GONIO_CALIB_RIG_BUNDLE_H
#define GONIO_CALIB_RIG_BUNDLE_H

#include "calib/geometry.h"
#include "gonio/characterise.h"

#define BUNDLE_INTRINSICS 9
#define BUNDLE_PARAMETERS_MAX (GONIO_ALIGNMENT_PARAMETERS + BUNDLE_INTRINSICS + 6)

// Bands of obliquity, 15 deg each about multiples of 15 deg, each with a noise of its own (bundle_noise.c).
#define BUNDLE_BANDS 7

// A frame's part in the problem.
typedef struct bundle_frame {
    gonio_rig_view *view;
    int band;             // of obliquity
    int points;           // corners, or 1
    double (*at)[2];      // board: corners on the board in the sample's axes, mm
    double (*pixel)[2];   // measured
    double *direction[4]; // orthonormal directions of common motion in the residuals' space, 2 points each
    double spread[4];     // standard deviation along each, px
    int directions;
} bundle_frame;

typedef struct bundle {
    const gonio_camera_info *camera;
    const gonio_rig_options *options;
    bundle_frame *frames;
    int n, residuals, parameters;
    int intrinsic[BUNDLE_INTRINSICS], intrinsics; // those that have an uncertainty
    int ball, mirror;                             // indices of the ball's centre, of the mirror's tilt and height
    double nominal[GONIO_ALIGNMENT_PARAMETERS];
    double noise_px[GONIO_RIG_OBJECTS][BUNDLE_BANDS];
} bundle;

static inline bool bundle_is_board(const bundle_frame *f) { return f->view->object == GONIO_RIG_BOARD; }

// Where light and camera stand at these counters.
geometry gonio_bundle_geometry(const double *value, const gonio_pair *axes);
// The camera with p's intrinsics.
gonio_camera_info gonio_bundle_camera(const bundle *q, const double *p);
// Raw residuals of one frame, px, 2 a point. false: it cannot be seen at all.
bool gonio_bundle_residuals(const bundle *q, const double *p, const gonio_camera_info *camera, const bundle_frame *f,
                            double *r);
// Residuals in units of their standard deviation, the frame's common motion taken for what it is.
void gonio_bundle_whiten(const bundle_frame *f, double noise, double *r);
static inline double bundle_noise(const bundle *q, const bundle_frame *f) {
    return q->noise_px[f->view->object][f->band];
}
// The band of a view, from its counters.
int gonio_bundle_band(const gonio_rig_view *view);
// Set the noise of every object and band from the residuals where p stands.
void gonio_bundle_measure_noise(bundle *q, const double *p);
// An object's root mean square over its coordinates; where it has none, what is assumed of it.
void gonio_bundle_mean_noise(const bundle *q, double noise_px[GONIO_RIG_OBJECTS]);
// Find that common motion where p stands.
void gonio_bundle_common_motion(const bundle *q, const double *p, bundle_frame *f);
// All residuals: the used frames', then the priors'; and their derivatives, column-major, residuals x parameters.
// work: two rows of residuals.
void gonio_bundle_evaluate(const bundle *q, const double *p, double *r);
void gonio_bundle_jacobian(const bundle *q, const double *p, double *j, double *work);

// Frames from views, their origin in the middle of the board, which is at `centre` from its first corner. GONIO_E_INPUT
// where the board lies otherwise than stated.
gonio_status gonio_bundle_frames_make(bundle *q, int n, gonio_rig_view *views, double centre[2], gonio_error *error);
void gonio_bundle_frames_free(bundle *q);
void gonio_bundle_move_origin(bundle *q, const double by[2]);

#endif
