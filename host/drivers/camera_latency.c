// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/camera_latency.h"

#include <math.h>
#include <stdlib.h>

enum { LATENCY_MAX = 30 };

static gonio_status next_mean(const gonio_latency_camera *camera, uint16_t *pixels, double *mean, gonio_error *error) {
    const gonio_status status = camera->frame(camera->device, pixels, error);
    double sum = 0;
    for (size_t i = 0; i < camera->n && status == GONIO_OK; i++) {
        sum += pixels[i];
    }
    *mean = sum / (double)camera->n;
    return status;
}

gonio_status gonio_camera_latency(const gonio_latency_camera *camera, double low_s, double high_s, int *frames,
                                  gonio_error *error) {
    double means[LATENCY_MAX] = {0}, before = 0;
    uint16_t *pixels = malloc(camera->n * sizeof *pixels);
    if (pixels == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a frame");
    }
    gonio_status status = camera->expose(camera->device, low_s, error);
    for (int i = 0; i < LATENCY_MAX && status == GONIO_OK; i++) { // long enough for the low exposure to have settled
        status = next_mean(camera, pixels, &before, error);
    }
    status = status == GONIO_OK ? camera->expose(camera->device, high_s, error) : status;
    for (int i = 0; i < LATENCY_MAX && status == GONIO_OK; i++) {
        status = next_mean(camera, pixels, &means[i], error);
    }
    free(pixels);
    if (status != GONIO_OK) {
        return status;
    }
    const double after = means[LATENCY_MAX - 1];
    if (!(fabs(after - before) > 0.05 * fabs(before) + 1)) {
        return gonio_fail(error, GONIO_E_FAILED,
                          "the frames' mean does not follow the exposure (%.1f at %g s, %.1f at "
                          "%g s): dark, or saturated?",
                          before, low_s, after, high_s);
    }
    // The first frame from which on every one is within a tenth of the whole step from the end.
    int settled = LATENCY_MAX;
    while (settled > 0 && fabs(means[settled - 1] - after) < 0.1 * fabs(after - before)) {
        settled--;
    }
    *frames = settled;
    return GONIO_OK;
}
