// SPDX-License-Identifier: BSD-3-Clause
// What a pose's frames say before any geometry: the merged radiance of pixels on a lattice over the window.
//
// A replay by another version compares it with what was journalled, and so tells a difference in dark, flat field or
// merging from one in angles and irradiance. The lattice does not depend on the pose: which pixels a sample averages is
// geometry already. Some thousand pixels tell; all of them would cost as much as the sample itself.
#include <math.h>
#include <string.h>

#include "calib/internal.h"

// Blocks of 2 x 2, so that every colour is there, every 2 s pixels: of each s x s pixels one.
static size_t spacing(size_t pixels) {
    size_t s = 1;
    while (pixels / (s * s) > GONIO_PROBES_MAX / 2) { // the window's edges may hold a few more than their share
        s++;
    }
    return s;
}

gonio_status gonio_calib_probe(const gonio_calib *calib, int n, const gonio_exposure *exposures,
                               double values[GONIO_PROBES_MAX], size_t *count, double mean[3], gonio_error *error) {
    *count = 0;
    if (!calib->prepared || n < 1 || n > MERGE_MAX) {
        return gonio_fail(error, GONIO_E_USAGE, "a prepared calibration and 1 to %d exposures are expected", MERGE_MAX);
    }
    double scale[MERGE_MAX];
    size_t valid[3] = {0};
    memset(mean, 0, 3 * sizeof *mean);
    for (int j = 0; j < n; j++) {
        const gonio_status status = gonio_exposure_check(calib, &exposures[j], error);
        if (status != GONIO_OK) {
            return status;
        }
        scale[j] = exposure_scale(calib, exposures[j].frame.exposure_s, exposures[j].monitor);
    }
    const size_t width = (size_t)calib->window.width, step = 2 * spacing(calib->pixels);
    for (size_t p = 0; p < calib->pixels && *count < GONIO_PROBES_MAX; p++) {
        if ((p / width) % step > 1 || (p % width) % step > 1) {
            continue;
        }
        merge_result merged = {0};
        if (calib->defect[p] == 0) {
            gonio_pixel_merge(calib, p, n, exposures, scale, &merged);
        }
        values[(*count)++] = merged.used > 0 ? merged.value : NAN;
        mean[calib->channel[p]] += merged.used > 0 ? merged.value : 0;
        valid[calib->channel[p]] += merged.used > 0;
    }
    for (int k = 0; k < calib->channels; k++) {
        mean[k] = valid[k] > 0 ? mean[k] / (double)valid[k] : NAN;
    }
    return GONIO_OK;
}
