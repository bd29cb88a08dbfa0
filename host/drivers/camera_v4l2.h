// SPDX-License-Identifier: BSD-3-Clause
// A camera behind V4L2: manual settings only, and frames that were exposed wholly after they were asked for.
#ifndef GONIO_DRIVERS_CAMERA_V4L2_H
#define GONIO_DRIVERS_CAMERA_V4L2_H

#include "gonio/rig.h"
#include "host/drivers/pixels.h"
#include "host/transport/v4l2.h"

typedef struct gonio_camera_v4l2_config {
    char path[128];            // "/dev/video0"
    char format[16];           // "Y12"; empty: the best that is offered
    int width, height;         // 0: the driver's present size
    int bits;                  // that carry information; 0: the format's
    int shift;                 // how far they stand above bit 0
    int settle_frames;         // discarded after a change of exposure or gain; 3
    int buffers;               // 4
    double exposure_unit_s;    // of the control: 1e-4 for exposure_time_absolute; 0: by the control's definition
    double fixed_exposure_s;   // of a camera without an exposure control; 0: refuse such a camera
    double gain_unit_db;       // decibels a step of the gain control; 0: gain is never touched but set to its minimum
    double replug_s;           // wait this long for an unplugged camera; 10
    double exposure_tolerance; // relative; a coarser step of the control than this is refused; 0.2
    // A camera that exposes on a pulse: called before each frame. NULL: it runs freely.
    gonio_status (*trigger)(void *context, gonio_error *error);
    void *trigger_context;
    // Geometry, read-out and names: copied to gonio_camera_info, which calibration fills.
    gonio_camera_info info;
} gonio_camera_v4l2_config;

void gonio_camera_v4l2_defaults(gonio_camera_v4l2_config *config);

// What was seen on the way, for the session's events and the tests.
typedef struct gonio_camera_v4l2_counts {
    int64_t captured, discarded, damaged, short_frames, gaps, lost, timeouts, restarts, replugs;
} gonio_camera_v4l2_counts;

extern const gonio_camera_ops gonio_camera_v4l2;
// Open on the system calls of `io` (gonio_v4l2_system with NULL); both must outlive the camera. Automatic functions are
// switched off and read back here: one that stays on is GONIO_E_DEVICE and named.
gonio_status gonio_camera_v4l2_open(const gonio_camera_v4l2_config *config, const gonio_v4l2_io *io, void *state,
                                    void **device, gonio_error *error);
const gonio_camera_v4l2_counts *gonio_camera_v4l2_count(const void *device);
const gonio_pixel_format *gonio_camera_v4l2_format(const void *device);
const char *gonio_camera_v4l2_warning(const void *device); // what stays on and does no harm; empty: nothing

#endif
