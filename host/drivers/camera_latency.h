// SPDX-License-Identifier: BSD-3-Clause
// How many frames a change of exposure takes to show in the pixels.
#ifndef GONIO_DRIVERS_CAMERA_LATENCY_H
#define GONIO_DRIVERS_CAMERA_LATENCY_H

#include <stddef.h>
#include <stdint.h>

#include "gonio/status.h"

typedef struct gonio_latency_camera {
    void *device;
    size_t n;                                                                    // pixels of a frame
    gonio_status (*expose)(void *device, double exposure_s, gonio_error *error); // set it, and wait for nothing
    gonio_status (*frame)(void *device, uint16_t *pixels, gonio_error *error);   // the next, whatever exposed it
} gonio_latency_camera;

// As gonio_camera_ops.latency.
gonio_status gonio_camera_latency(const gonio_latency_camera *camera, double low_s, double high_s, int *frames,
                                  gonio_error *error);

#endif
