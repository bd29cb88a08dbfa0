// SPDX-License-Identifier: BSD-3-Clause
// The device interface: what a gonioreflectometer is to the scan loop, be it hardware or the simulator.
//
// Each device is a table of operations plus its own state. sim/ and host/drivers/ both fill these tables; only host/cli
// registers them. Operations are called from one thread, may block up to the bound they are given, and return a status;
// a device fault is GONIO_E_DEVICE or GONIO_E_TIMEOUT with the fault named in the error.
//
// ---- Geometry: where the light, the camera and a pixel are ----
// Everything stands in the sample's frame (direction.h), its origin at the centre of rotation, lengths in mm. For a
// pose (theta_i, phi_i, theta_o, phi_o), whose angles are the axes' positions in the order of the enum below:
//
//   light     L = light_distance_mm  * (sin theta_i cos phi_i, sin theta_i sin phi_i, cos theta_i), a point source
//   camera    C = camera_distance_mm * (sin theta_o cos phi_o, sin theta_o sin phi_o, cos theta_o), its pinhole
//   right     R = (-sin phi_o, cos phi_o, 0)                                          direction of increasing phi_o
//   up        U = (-cos theta_o cos phi_o, -cos theta_o sin phi_o, sin theta_o)       direction of decreasing theta_o
//   forward   F = -C / |C|, and R = F x U. These formulas also hold at theta_o = 0, where phi_o alone turns the image.
//
// A point P is seen at (u, v), u to the right and v downward, in OpenCV's model (its camera axes are R, -U, F):
//   Z = F.(P - C),  x = R.(P - C) / Z,  y = -U.(P - C) / Z,  r2 = x x + y y,  d = 1 + k1 r2 + k2 r2^2 + k3 r2^3
//   x' = x d + 2 p1 x y + p2 (r2 + 2 x x),  y' = y d + p1 (r2 + 2 y y) + 2 p2 x y
//   u = fx x' + cx,  v = fy y' + cy
// Integer (u, v) are pixel centres: column i, row j of the full frame has its centre at u = i, v = j, so that (0, 0) is
// the centre of the first pixel. The inverse, pixel to ray: undistort (u, v) to (x, y); the ray is C + s (F + x R - y
// U), s > 0. A flat sample or reference is the plane z = 0 (its face toward +z); a sphere has its centre at the origin.
// At a point P with normal N, w_i = (L - P)/|L - P| and w_o = (C - P)/|C - P|, and the radiance toward the camera is
//   f_r(w_i, w_o) (N.w_i) I / |L - P|^2.
// Bayer patterns name the colours of the full frame's pixels (0,0), (1,0), (0,1), (1,1) as (u, v).
#ifndef GONIO_RIG_H
#define GONIO_RIG_H

#include <stdbool.h>
#include <stdint.h>

#include "gonio/alignment.h"
#include "gonio/direction.h"
#include "gonio/export.h"
#include "gonio/status.h"

GONIO_BEGIN

enum { GONIO_LIGHT_THETA, GONIO_LIGHT_PHI, GONIO_CAMERA_THETA, GONIO_CAMERA_PHI, GONIO_AXES };

// When, on the plan's nominal clock, and for which pose and frame something happens. Real devices may ignore it; the
// simulator's every effect depends on the seed and this stamp alone, which makes resume and replay bit-identical.
typedef struct gonio_stamp {
    int64_t pose;   // running number of the step in the session
    int32_t frame;  // within the pose
    double clock_s; // nominal session time
} gonio_stamp;

// ---- stage: the four axes ----
typedef struct gonio_stage_ops {
    const char *name;
    gonio_status (*home)(void *device, double timeout_s, gonio_error *error);
    // Absolute, coordinated, always approached from the same side; blocks until settled. id: of this move, a repeat is
    // harmless.
    gonio_status (*move)(void *device, const double target_rad[GONIO_AXES], uint32_t id, const gonio_stamp *stamp,
                         double timeout_s, gonio_error *error);
    gonio_status (*position)(void *device, double position_rad[GONIO_AXES],
                             gonio_error *error);           // as the encoders or counters say
    gonio_status (*stop)(void *device, gonio_error *error); // decelerate and hold; callable at any time
    // How long a move will take, from the limits alone (the nominal clock); no motion.
    double (*duration_s)(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES]);
    void (*close)(void *device);
    // Optional: whether this move would be allowed, without motion; GONIO_E_RANGE naming the limit or zone in its way.
    gonio_status (*check)(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES],
                          gonio_error *error);
    // Optional: home again and tell by how much each axis had drifted since its last homing; NaN where nobody can know,
    // because positions were lost in between. GONIO_E_MISMATCH where it is more than the stage is allowed: steps were
    // lost. The stage is homed either way.
    gonio_status (*audit)(void *device, double timeout_s, double difference_rad[GONIO_AXES], gonio_error *error);
    bool independent; // the axes move each at its own pace: a move may pass any place of the box between its ends
    // Optional: whether this move, which is straight else, passes its target to take up backlash; it then goes straight
    // to `turn`, and from there to the target.
    bool (*turns)(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES],
                  double turn_rad[GONIO_AXES]);
    // Optional: the largest of the axes' steps. A position is rounded to whole steps, so it is off by half of one at
    // most.
    double (*step_rad)(void *device);
    bool real; // there are arms that swing: the time to settle after a move is truly waited for
    // Optional: where the stage's own encoders say that the axes are; NaN of an axis without one.
    gonio_status (*encoders)(void *device, double position_rad[GONIO_AXES], gonio_error *error);
    // Optional: compare encoders with where the axes should be; the differences, NaN where there is none.
    // GONIO_E_MISMATCH where one is more than is allowed: steps were lost, and `audit` or `home` puts it right. move
    // does it too.
    gonio_status (*verify)(void *device, double difference_rad[GONIO_AXES], gonio_error *error);
} gonio_stage_ops;

// ---- lamp and shutter ----
typedef struct gonio_lamp_ops {
    const char *name;
    gonio_status (*set_level)(void *device, double level, gonio_error *error); // 0..1
    gonio_status (*set_shutter)(void *device, bool open, gonio_error *error);
    gonio_status (*wait_ready)(void *device, const gonio_stamp *stamp, double timeout_s, double *waited_s,
                               gonio_error *error); // warm-up over
    void (*close)(void *device);
} gonio_lamp_ops;

// ---- meter: the lamp's monitor photodiode or a reference detector ----
typedef struct gonio_meter_ops {
    const char *name;
    // A reading in the device's unit and its standard uncertainty, averaged over integration_s.
    gonio_status (*read)(void *device, const gonio_stamp *stamp, double integration_s, double *value, double *sigma,
                         gonio_error *error);
    void (*close)(void *device);
} gonio_meter_ops;

// ---- camera ----
typedef enum gonio_pattern { GONIO_MONO, GONIO_RGGB, GONIO_BGGR, GONIO_GRBG, GONIO_GBRG } gonio_pattern;

typedef struct gonio_window { // read-out window, pixels of the full frame
    int x, y, width, height;
} gonio_window;

// What the camera is (fixed while a session runs) and its geometry; journalled, so that a replay needs no rig.
typedef struct gonio_camera_info {
    char name[64], serial[64];
    int width, height, bits; // full frame; bits a pixel that carry information (8, 10, 12, 16)
    gonio_pattern pattern;
    double exposure_min_s, exposure_max_s;
    double fx, fy, cx, cy;     // pinhole, px
    double k1, k2, p1, p2, k3; // OpenCV's distortion coefficients
    double read_out_s;         // a frame's nominal read-out time
} gonio_camera_info;

// One captured frame, row by row, in the low bits of each word.
typedef struct gonio_frame {
    gonio_window window;
    double exposure_s, gain_db;
    gonio_stamp stamp;
    uint16_t *pixels; // window.width x window.height, owned by whoever made the frame
} gonio_frame;

typedef struct gonio_camera_ops {
    const char *name;
    gonio_status (*info)(void *device, gonio_camera_info *info, gonio_error *error);
    // Blocks until a frame that was exposed wholly after this call, with exactly these settings, has arrived.
    // frame->pixels holds window.width x window.height words and belongs to the caller.
    gonio_status (*capture)(void *device, const gonio_window *window, double exposure_s, double gain_db,
                            const gonio_stamp *stamp, double timeout_s, gonio_frame *frame, gonio_error *error);
    void (*close)(void *device);
    // Optional, both or neither: every frame, at the camera's own rate, until the next capture. stream: set exposure
    // and gain and wait until frames have them. next: the frame after the last one, into frame->pixels as above;
    // frame->stamp.clock_s is its time in seconds on a clock of the camera's own. *lost: how many the camera numbered
    // in between, or delivered damaged. A camera that is gone is an error.
    gonio_status (*stream)(void *device, double exposure_s, double gain_db, double timeout_s, gonio_error *error);
    gonio_status (*next)(void *device, const gonio_window *window, double timeout_s, gonio_frame *frame, int64_t *lost,
                         gonio_error *error);
    // Optional: how many frames after a change of exposure still have the old one; steps it between two levels.
    // GONIO_E_FAILED where the frames' mean does not follow at all (dark, or saturated?).
    gonio_status (*latency)(void *device, double low_s, double high_s, int *frames, gonio_error *error);
} gonio_camera_ops;

// ---- interlock: emergency stop and door ----
typedef struct gonio_interlock_ops {
    const char *name;
    gonio_status (*check)(void *device, gonio_error *error); // OK, or GONIO_E_DEVICE naming what is open or pressed
    void (*close)(void *device);
} gonio_interlock_ops;

// ---- mount: what lies on the table ----
// FIDUCIAL: a board, which shows how the camera stands; BALL, MIRROR: a polished ball and a black glass plate, whose
// highlights show where the light stands.
typedef enum gonio_target {
    GONIO_TARGET_SAMPLE,
    GONIO_TARGET_REFERENCE,
    GONIO_TARGET_TRAP,
    GONIO_TARGET_FIDUCIAL,
    GONIO_TARGET_BALL,
    GONIO_TARGET_MIRROR
} gonio_target;
typedef struct gonio_mount_ops {
    const char *name;
    // Put the target on the table. A rig without a changer has no mount device: the host then asks the operator.
    gonio_status (*mount)(void *device, gonio_target target, gonio_error *error);
    void (*close)(void *device);
} gonio_mount_ops;

// Facts about the rig that calibration needs: geometry and stated standard uncertainties (k = 1); journalled.
typedef struct gonio_rig_facts {
    double light_distance_mm, camera_distance_mm;        // to the centre of rotation
    double pointing_random_deg, pointing_systematic_deg; // of each axis: repeatability, zero error
    gonio_alignment alignment;                           // of the axes; not known: perfect up to pointing_*
    double reference_reflectance[3]; // of the near-Lambertian white reference, a channel (mono: [0])
    double reference_relative_sigma;
    // Another absolute scale, without a white panel: the reference is a source of known radiance (W/m^2/sr), uniform
    // over the view and lit by itself, and a meter read the lamp's irradiance (W/m^2) at the centre of rotation, facing
    // it, when the lamp's monitor read irradiance_monitor (0: there is none). reference_relative_sigma is that of
    // radiance / irradiance. 0: a white panel.
    double reference_radiance, irradiance, irradiance_monitor;
    double lamp_drift_per_h; // stated relative drift, used where no meter measures it
    double stray_variation;  // relative, of the lamp's stray light from pose to pose; the light trap shows it at one
    double glare_sigma;      // of the share of the scene's mean radiance that the lens spreads over every pixel
    bool sphere;             // sample shape: flat plate or sphere
    double sphere_radius_mm;
    double region_radius_mm;                    // flat: the averaged disc on the sample
    double sample_mm[2];                        // flat: its size along x and y; 0: not known, edges are not checked
    double light_spot_mm;                       // radius of the lit spot on a plane that faces the light; 0: all is lit
    double light_radius_mm, aperture_radius_mm; // of the lamp's disc and the camera's entrance pupil; 0: points
    char reference_brdf[256]; // MODEL of the white reference's own BRDF, for its shape alone; empty: Lambertian
    char flat_path[256];      // flat field that gonio_calib_flat_save wrote; empty: the session's reference tells it
    char response_path[256];  // camera response curve (CSV: relative exposure, relative value); empty: linear
    char operator_name[64], notes[512], sample_id[64], serials[256];
    // What goes with the samples and changes none of them; empty: not known. Polarisations as docs/formats.md spells
    // them; of the room; of the reference, a certificate's number.
    char light_polarisation[16], detector_polarisation[16], temperature_c[16], traceability[160];
} gonio_rig_facts;

typedef struct gonio_rig {
    const gonio_stage_ops *stage;
    void *stage_device;
    const gonio_lamp_ops *lamp;
    void *lamp_device;
    const gonio_camera_ops *camera;
    void *camera_device;
    const gonio_meter_ops *meter;
    void *meter_device; // NULL: none
    const gonio_interlock_ops *interlock;
    void *interlock_device; // NULL: none
    const gonio_mount_ops *mount;
    void *mount_device; // NULL: the operator's hands
    gonio_rig_facts facts;
} gonio_rig;

// Close every device that is there; the struct may then be reused.
void gonio_rig_close(gonio_rig *rig);

GONIO_END
#endif
