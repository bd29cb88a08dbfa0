// SPDX-License-Identifier: BSD-3-Clause
// One frame -> radiance and variance of every pixel, streaming: linearise, dark, flat, variance, no remapping.
//
//   L = (lin(DN) - bias - rate t - stray t m) / (K t m),  var = ((x + rate t + stray t m) g + r^2 + q) / (K t m)^2 +
//   L^2 var(K)/K^2
//
// in float: the maps are float and a frame's own noise is far above their rounding. Rows are shared out among threads;
// pixels are independent, so the result does not depend on their number.
#include <math.h>

#include "base/thread_pool.h"
#include "calib/internal.h"

// A frame's constants.
typedef struct frame_terms {
    float exposure_s, scale, dn_per_e, read_variance, saturation;
} frame_terms;

static void linear_pixels(const gonio_calib *calib, const frame_terms *f, size_t first, size_t n,
                          const uint16_t *restrict in, float *restrict radiance, float *restrict variance) {
    const float *restrict bias = calib->bias + first, *restrict rate = calib->dark_rate + first;
    const float *restrict flat = calib->flat + first, *restrict flat_variance = calib->flat_variance + first;
    const float *restrict stray = calib->stray + first;
    const uint8_t *restrict defect = calib->defect + first;
    const float quantum = 1.0F / 12, t = f->exposure_s;
    for (size_t i = 0; i < n; i++) {
        const float raw = in[i], dark = rate[i] * t + stray[i] * f->scale, x = raw - bias[i] - dark,
                    inverse = 1 / (flat[i] * f->scale);
        const float electrons = (x > 0 ? x : 0) + (dark > 0 ? dark : 0), value = x * inverse;
        const float noise = electrons * f->dn_per_e + f->read_variance + quantum;
        const bool valid = (raw < f->saturation) & (defect[i] == 0);
        radiance[i] = valid ? value : NAN;
        variance[i] = valid ? noise * inverse * inverse + value * value * flat_variance[i] : NAN;
    }
}

static void curved_pixels(const gonio_calib *calib, const frame_terms *f, size_t first, size_t n, const uint16_t *in,
                          float *radiance, float *variance) {
    for (size_t i = 0; i < n; i++) {
        const size_t p = first + i;
        const float dark = calib->dark_rate[p] * f->exposure_s + calib->stray[p] * f->scale;
        const float x = (float)linear_dn(calib, in[i]) - calib->bias[p] - dark,
                    inverse = 1 / (calib->flat[p] * f->scale);
        const float electrons = fmaxf(x, 0) + fmaxf(dark, 0), value = x * inverse;
        const float noise = electrons * f->dn_per_e + f->read_variance + (float)quantum_variance(calib, in[i]);
        const bool valid = in[i] < calib->saturation && calib->defect[p] == 0;
        radiance[i] = valid ? value : NAN;
        variance[i] = valid ? noise * inverse * inverse + value * value * calib->flat_variance[p] : NAN;
    }
}

typedef struct job {
    const gonio_calib *calib;
    const frame_terms *terms;
    const uint16_t *pixels;
    float *radiance, *variance;
} job;

#define ROWS 32 // at once: about as long as it takes to wake a thread

static void do_rows(void *context, size_t block) {
    const job *j = context;
    const size_t width = (size_t)j->calib->window.width, first = block * ROWS * width;
    const size_t left = (size_t)j->calib->window.height * width - first, n = left < ROWS * width ? left : ROWS * width;
    (j->calib->response.linear == NULL ? linear_pixels : curved_pixels)(j->calib, j->terms, first, n, j->pixels + first,
                                                                        j->radiance + first, j->variance + first);
}

gonio_status gonio_calib_radiance(const gonio_calib *calib, const gonio_exposure *exposure, int threads,
                                  float *radiance, float *variance, gonio_error *error) {
    if (!calib->prepared) {
        return gonio_fail(error, GONIO_E_USAGE, "the calibration is not prepared");
    }
    const gonio_status status = gonio_exposure_check(calib, exposure, error);
    if (status != GONIO_OK) {
        return status;
    }
    const gonio_frame *frame = &exposure->frame;
    const frame_terms f = {.exposure_s = (float)frame->exposure_s,
                           .scale = (float)exposure_scale(calib, frame->exposure_s, exposure->monitor),
                           .dn_per_e = (float)calib->noise.dn_per_e,
                           .read_variance = (float)calib->noise.read_variance,
                           .saturation = (float)calib->saturation};
    gonio_pool_for(threads, ((size_t)calib->window.height + ROWS - 1) / ROWS, do_rows,
                   &(job){calib, &f, frame->pixels, radiance, variance});
    return GONIO_OK;
}
