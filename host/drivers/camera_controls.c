// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/camera_controls.h"

#include <linux/videodev2.h>
#include <math.h>
#include <stdio.h>

enum { INTERVALS_MAX = 256 };

const gonio_auto_function gonio_auto_functions[] = {
    {"automatic exposure", V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL, false},
    {"automatic frame rate for exposure", V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0, false},
    {"automatic gain", V4L2_CID_AUTOGAIN, 0, false},
    {"automatic ISO", V4L2_CID_ISO_SENSITIVITY_AUTO, V4L2_ISO_SENSITIVITY_MANUAL, false},
    {"automatic white balance", V4L2_CID_AUTO_WHITE_BALANCE, 0, false},
    {"white balance preset", V4L2_CID_AUTO_N_PRESET_WHITE_BALANCE, V4L2_WHITE_BALANCE_MANUAL, false},
    {"automatic brightness", V4L2_CID_AUTOBRIGHTNESS, 0, false},
    {"automatic hue", V4L2_CID_HUE_AUTO, 0, false},
    {"chroma gain control", V4L2_CID_CHROMA_AGC, 0, false},
    {"backlight compensation", V4L2_CID_BACKLIGHT_COMPENSATION, 0, false},
    {"wide dynamic range", V4L2_CID_WIDE_DYNAMIC_RANGE, 0, false},
    {"image stabilisation", V4L2_CID_IMAGE_STABILIZATION, 0, false},
    {"power line compensation", V4L2_CID_POWER_LINE_FREQUENCY, V4L2_CID_POWER_LINE_FREQUENCY_DISABLED, true},
    {"scene mode", V4L2_CID_SCENE_MODE, V4L2_SCENE_MODE_NONE, false},
    {"colour effect", V4L2_CID_COLORFX, V4L2_COLORFX_NONE, false},
    {"automatic focus", V4L2_CID_FOCUS_AUTO, 0, false},
    {NULL, 0, 0, false}};

bool gonio_camera_has(gonio_v4l2 *device, uint32_t id, gonio_v4l2_control *control) {
    return gonio_v4l2_find_control(device, id, false, control, NULL) == GONIO_OK &&
           (control->flags & V4L2_CTRL_FLAG_DISABLED) == 0;
}

gonio_status gonio_camera_autos_off(gonio_v4l2 *device, char *warning, size_t size, gonio_error *error) {
    warning[0] = 0;
    for (const gonio_auto_function *f = gonio_auto_functions; f->name != NULL; f++) {
        gonio_v4l2_control control;
        if (!gonio_camera_has(device, f->id, &control)) {
            continue;
        }
        int64_t value = f->off;
        gonio_error detail = {0};
        gonio_status status = gonio_v4l2_get_control(device, f->id, &value, &detail);
        if (status == GONIO_OK && value != f->off) {
            status = gonio_v4l2_set_control(device, f->id, f->off, &detail);
        }
        if (status != GONIO_OK && f->may_stay && !gonio_v4l2_gone(device)) {
            snprintf(warning, size, "%s cannot be switched off", f->name);
        } else if (status != GONIO_OK) {
            return gonio_fail(error, status, "%s cannot be switched off: %.400s", f->name, detail.message);
        }
    }
    return GONIO_OK;
}

gonio_status gonio_camera_controls_find(gonio_v4l2 *device, double exposure_unit_s, gonio_camera_controls *controls,
                                        gonio_error *error) {
    static const uint32_t gains[] = {V4L2_CID_ANALOGUE_GAIN, V4L2_CID_GAIN, 0};
    gonio_v4l2_control control;
    *controls = (gonio_camera_controls){0};
    // exposure_absolute counts units of 100 us; plain exposure has a unit that only the sensor's data sheet tells.
    if (gonio_camera_has(device, V4L2_CID_EXPOSURE_ABSOLUTE, &control)) {
        controls->exposure = V4L2_CID_EXPOSURE_ABSOLUTE;
        controls->exposure_unit_s = exposure_unit_s > 0 ? exposure_unit_s : 1e-4;
    } else if (exposure_unit_s > 0 && gonio_camera_has(device, V4L2_CID_EXPOSURE, &control)) {
        controls->exposure = V4L2_CID_EXPOSURE;
        controls->exposure_unit_s = exposure_unit_s;
    }
    if (controls->exposure != 0) {
        controls->exposure_min = control.minimum > 0 ? control.minimum : 1;
        controls->exposure_max = control.maximum;
        controls->exposure_step = control.step > 0 ? control.step : 1;
    }
    for (const uint32_t *id = gains; *id != 0 && controls->gain == 0; id++) {
        if (gonio_camera_has(device, *id, &control)) {
            controls->gain = *id;
            controls->gain_min = control.minimum;
            controls->gain_max = control.maximum;
            controls->gain_step = control.step > 0 ? control.step : 1;
        }
    }
    if (controls->exposure != 0 && controls->exposure_max < controls->exposure_min) {
        return gonio_fail(error, GONIO_E_DEVICE, "exposure control of no range (%lld to %lld)",
                          (long long)controls->exposure_min, (long long)controls->exposure_max);
    }
    return GONIO_OK;
}

double gonio_camera_interval(gonio_v4l2 *device, const gonio_v4l2_format *format, double least_s) {
    double best = 0;
    gonio_v4l2_interval offered;
    for (int i = 0; i < INTERVALS_MAX && gonio_v4l2_offered_interval(device, format, i, &offered, NULL) == GONIO_OK;
         i++) {
        const double low = offered.shortest_s, high = offered.longest_s, step = offered.step_s;
        double here = least_s * (1 - 1e-6) <= low ? low : fmin(least_s, high);
        if (step > 0 && here > low && here < high) {
            here = fmin(high, low + ceil((here - low) / step - 1e-6) * step);
        }
        const bool enough = here >= least_s * (1 - 1e-6), had_enough = best >= least_s * (1 - 1e-6);
        if (best == 0 || (enough ? !had_enough || here < best : !had_enough && here > best)) {
            best = here;
        }
    }
    return best;
}

int64_t gonio_camera_nearest_step(double value, int64_t minimum, int64_t maximum, int64_t step) {
    const double steps = round((value - (double)minimum) / (double)step);
    const int64_t result = minimum + (int64_t)(steps > 0 ? steps : 0) * step;
    return result < maximum ? result : minimum + (maximum - minimum) / step * step;
}
