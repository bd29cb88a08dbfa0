// SPDX-License-Identifier: BSD-3-Clause
// The controls that would change pixels behind our back, and those that set exposure and gain.
#ifndef GONIO_DRIVERS_CAMERA_CONTROLS_H
#define GONIO_DRIVERS_CAMERA_CONTROLS_H

#include "host/transport/v4l2.h"

typedef struct gonio_camera_controls {
    uint32_t exposure, gain; // control ids; 0: there is none
    double exposure_unit_s;
    int64_t exposure_min, exposure_max, exposure_step, gain_min, gain_max, gain_step;
} gonio_camera_controls;

// One automatic function of the device: its name, whether it is there and whether it is on.
typedef struct gonio_auto_function {
    const char *name;
    uint32_t id;
    int32_t off;   // the value that switches it off
    bool may_stay; // where it cannot be switched off, it does little to a manual exposure: a warning will do
} gonio_auto_function;

// The functions that are looked for; the last has a NULL name. Static storage.
extern const gonio_auto_function gonio_auto_functions[];

// True where the device has the control and it can be set.
bool gonio_camera_has(gonio_v4l2 *device, uint32_t id, gonio_v4l2_control *control);
// Switch every automatic function off and read it back; one that stays on is GONIO_E_DEVICE, or, where it may stay, a
// sentence in `warning`, which is empty else.
gonio_status gonio_camera_autos_off(gonio_v4l2 *device, char *warning, size_t size, gonio_error *error);
// Find exposure and gain. exposure_unit_s: of the plain exposure control, which has no unit of its own; 0: not known,
// and such a control is then not used.
gonio_status gonio_camera_controls_find(gonio_v4l2 *device, double exposure_unit_s, gonio_camera_controls *controls,
                                        gonio_error *error);
// Of the frame intervals that the driver offers for a format the shortest that is at least `least_s`, or the longest
// where none is; 0 where it offers none.
double gonio_camera_interval(gonio_v4l2 *device, const gonio_v4l2_format *format, double least_s);
// The value of a control's range that is nearest.
int64_t gonio_camera_nearest_step(double value, int64_t minimum, int64_t maximum, int64_t step);

#endif
