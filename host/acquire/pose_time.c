// SPDX-License-Identifier: BSD-3-Clause
#include "host/acquire/pose_time.h"

#include <math.h>
#include <stdlib.h>

#include "base/statistics.h"

// A white panel (f_r = 1/pi) fills the range of a usual camera in about ten milliseconds.
#define LIGHT (0.01 / GONIO_PI)
#define DARKEST 1e-6 // f_r cos(theta_i), 1/sr, below which no exposure gets longer

gonio_pose_time gonio_pose_time_of(const gonio_rig *rig, const gonio_setup *setup) {
    return (gonio_pose_time){.rig = rig,
                             .settle_s = setup->scan.settle_s,
                             .read_out_s = setup->camera.read_out_s,
                             .exposure_min_s = setup->camera.exposure_min_s,
                             .exposure_max_s = setup->camera.exposure_max_s,
                             .frames = GONIO_FRAMES_A_POSE,
                             .light = LIGHT};
}

double gonio_pose_time_travel_s(const gonio_pose_time *time, const gonio_pair *from, const gonio_pair *to) {
    double a[GONIO_AXES], b[GONIO_AXES];
    gonio_scan_target(from, a);
    gonio_scan_target(to, b);
    return time->rig->stage->duration_s(time->rig->stage_device, a, b);
}

// f_r cos(theta_i): what the camera sees of the sample's light.
static double seen(const gonio_pair *pose, double value) {
    return fmax((isfinite(value) ? value : 1 / GONIO_PI) * fabs(cos(pose->theta_i)), DARKEST);
}

double gonio_pose_time_dwell_s(const gonio_pose_time *time, const gonio_pair *pose, double value) {
    const double each_s = time->light / seen(pose, value);
    return time->settle_s + time->frames * time->read_out_s +
           fmin(fmax(each_s, time->frames * time->exposure_min_s), time->frames * time->exposure_max_s);
}

double gonio_pose_time_s(void *time, const gonio_pair *from, const gonio_pair *to, double value) {
    return (from != NULL ? gonio_pose_time_travel_s(time, from, to) : 0) + gonio_pose_time_dwell_s(time, to, value);
}

void gonio_pose_time_learn(gonio_pose_time *time, const gonio_step *steps, const double *values, size_t n) {
    double *light = malloc((n + 1) * sizeof *light);
    size_t known = 0, poses = 0, frames = 0;
    for (size_t i = 1; light != NULL && i < n; i++) {
        const gonio_step *s = &steps[i];
        if (s->kind != GONIO_STEP_SAMPLE || !s->done || !steps[i - 1].done) {
            continue;
        }
        poses++;
        frames += (size_t)s->frames;
        const double exposures_s = s->clock_end_s - steps[i - 1].clock_end_s - time->settle_s -
                                   gonio_pose_time_travel_s(time, &steps[i - 1].pose, &s->pose) -
                                   s->frames * time->read_out_s;
        // At a limit of the camera the exposure says nothing about the light; a wait for the lamp is none.
        if (values != NULL && isfinite(values[i]) && s->exposure_end_s < 0.99 * time->exposure_max_s &&
            s->exposure_end_s > 1.01 * time->exposure_min_s && exposures_s > 0) {
            light[known++] = exposures_s * seen(&s->pose, values[i]);
        }
    }
    time->frames = poses > 0 ? (double)frames / (double)poses : time->frames;
    time->light = known > 0 ? gonio_median(light, known) : time->light;
    free(light);
}
