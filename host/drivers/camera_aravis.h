// SPDX-License-Identifier: BSD-3-Clause
// A GenICam camera (GigE Vision, USB3 Vision) through Aravis: manual settings only, and a software trigger for every
// frame, so that a frame was exposed wholly after it was asked for.
#ifndef GONIO_DRIVERS_CAMERA_ARAVIS_H
#define GONIO_DRIVERS_CAMERA_ARAVIS_H

#include "gonio/rig.h"

typedef struct gonio_camera_aravis_config {
    char id[128];              // as arv-tool-0.8 lists it, or an address; empty: the only one that is there
    char format[32];           // "Mono12"; empty: the best that is offered
    int bits;                  // that carry information; 0: the format's
    int shift;                 // how far they stand above bit 0
    int settle_frames;         // discarded after a change of exposure or gain; 1
    double replug_s;           // wait this long for a camera that is gone; 10
    double exposure_tolerance; // relative; a coarser step of the exposure than this is refused; 0.2
    gonio_camera_info info;    // geometry, read-out and names
} gonio_camera_aravis_config;

void gonio_camera_aravis_defaults(gonio_camera_aravis_config *config);

extern const gonio_camera_ops gonio_camera_aravis;
// Automatic functions are switched off and read back here: one that stays on is GONIO_E_DEVICE and named.
gonio_status gonio_camera_aravis_open(const gonio_camera_aravis_config *config, void **device, gonio_error *error);

// The id of one of the cameras that are there, looked for anew with number 0; false past the last.
bool gonio_camera_aravis_listed(int number, char id[128]);

#endif
