// SPDX-License-Identifier: BSD-3-Clause
// The keys of [camera] that every real camera has: its geometry, as calibration finds it, and what it is called.
#ifndef GONIO_DRIVERS_CAMERA_KEYS_H
#define GONIO_DRIVERS_CAMERA_KEYS_H

#include "base/keys.h"

#define GONIO_CAMERA_KEY(settings, text, kind, member)                                                                 \
    .section = "camera", GONIO_KEY_NAMED(settings, member, text, kind)
// at: the gonio_camera_info in the driver's settings.
#define GONIO_CAMERA_INFO_KEYS(settings, at)                                                                           \
    {GONIO_CAMERA_KEY(settings, "serial", LINE, at.serial)},                                                           \
        {GONIO_CAMERA_KEY(settings, "fx_px", REAL, at.fx), 1, 1e7},                                                    \
        {GONIO_CAMERA_KEY(settings, "fy_px", REAL, at.fy), 1, 1e7},                                                    \
        {GONIO_CAMERA_KEY(settings, "cx_px", REAL, at.cx), -1e5, 1e5},                                                 \
        {GONIO_CAMERA_KEY(settings, "cy_px", REAL, at.cy), -1e5, 1e5},                                                 \
        {GONIO_CAMERA_KEY(settings, "k1", REAL, at.k1), -1e3, 1e3},                                                    \
        {GONIO_CAMERA_KEY(settings, "k2", REAL, at.k2), -1e6, 1e6},                                                    \
        {GONIO_CAMERA_KEY(settings, "p1", REAL, at.p1), -10, 10},                                                      \
        {GONIO_CAMERA_KEY(settings, "p2", REAL, at.p2), -10, 10},                                                      \
        {GONIO_CAMERA_KEY(settings, "k3", REAL, at.k3), -1e9, 1e9}, {                                                  \
        GONIO_CAMERA_KEY(settings, "read_out_s", REAL, at.read_out_s), 0, 100                                          \
    }

#endif
