// SPDX-License-Identifier: BSD-3-Clause
// Dark frames -> bias and dark rate of every pixel, read noise, hot and noisy pixels.
//
// Every pixel gets the straight line through its dark readings over exposure time, all frames weighted alike (the read
// noise dominates). Noise is measured between successive frames of one exposure, so that nothing fixed enters it.
#include "base/statistics.h"
#include "calib/internal.h"

#include <math.h>

// A normal distribution passes 8 sigma once in 1e15 pixels; hot pixels lie far beyond.
#define OUTLIER_SIGMAS 8

typedef struct line_sums {
    double n, t, tt;
} line_sums;

// The pixel's line: v = bias + rate t. With a single exposure time the rate cannot be known and is 0.
static void fit_line(const gonio_calib *calib, const line_sums *s, size_t p, double *bias, double *rate) {
    double v = 0, tv = 0;
    for (int i = 0; i < calib->dark.n; i++) {
        const double x = linear_dn(calib, calib->dark.items[i].pixels[p]);
        v += x;
        tv += x * calib->dark.items[i].exposure_s;
    }
    const double determinant = s->n * s->tt - s->t * s->t;
    *rate = determinant > 1e-9 * s->n * s->tt ? (s->n * tv - s->t * v) / determinant : 0;
    *bias = (v - *rate * s->t) / s->n;
}

// The largest exposure count of frames at one exposure time: that time; 0 where none occurs twice.
static double repeated_exposure(const stored_frames *frames) {
    double best = 0;
    for (int i = 0; i < frames->n; i++) {
        for (int j = 0; j < i; j++) {
            const double t = frames->items[i].exposure_s;
            if (frames->items[j].exposure_s == t && (best == 0 || t < best)) {
                best = t;
            }
        }
    }
    return best;
}

// Temporal variance of one pixel at one exposure, from successive differences (each has twice the variance).
static double temporal_variance(const gonio_calib *calib, size_t p, double exposure_s) {
    double sum = 0, last = 0;
    int n = 0;
    for (int i = 0; i < calib->dark.n; i++) {
        if (calib->dark.items[i].exposure_s == exposure_s) {
            const double x = linear_dn(calib, calib->dark.items[i].pixels[p]);
            sum += n > 0 ? (x - last) * (x - last) / 2 : 0;
            last = x;
            n++;
        }
    }
    return sum / (n - 1);
}

static gonio_status find_hot(gonio_calib *calib, gonio_error *error) {
    double rate, rate_sigma, bias, bias_sigma;
    gonio_status status = gonio_median_mad_f32(calib->dark_rate, calib->pixels, &rate, &rate_sigma, error);
    if (status == GONIO_OK) {
        status = gonio_median_mad_f32(calib->bias, calib->pixels, &bias, &bias_sigma, error);
    }
    if (status != GONIO_OK) {
        return status;
    }
    for (size_t p = 0; p < calib->pixels; p++) {
        // The noise of the two maps bounds their spread from below: a map of all-equal values has no scatter.
        const double rate_floor = sqrt(calib->dark_covariance[2]), bias_floor = sqrt(calib->dark_covariance[0]);
        if (fabs(calib->dark_rate[p] - rate) > OUTLIER_SIGMAS * fmax(rate_sigma, rate_floor) ||
            fabs(calib->bias[p] - bias) > OUTLIER_SIGMAS * fmax(bias_sigma, bias_floor)) {
            calib->defect[p] = 1;
            calib->report.hot++;
        }
    }
    calib->report.dark_e_per_s = rate; // DN/s until the gain is known
    return GONIO_OK;
}

// Mean temporal variance of the sound pixels. A pixel is noisy when its own exceeds the mean so far that chance makes
// one such pixel in 1e9: chi-square over its degrees of freedom, by Wilson and Hilferty's cube-root approximation.
static void measure_noise(gonio_calib *calib, double exposure_s) {
    int frames = 0;
    for (int i = 0; i < calib->dark.n; i++) {
        frames += calib->dark.items[i].exposure_s == exposure_s;
    }
    // Successive differences have (2/3) (frames - 1) effective degrees of freedom (von Neumann 1941), at least 1.
    const double dof = fmax((frames - 1) * 2.0 / 3, 1), a = 2 / (9 * dof);
    const double limit = pow(1 - a + 6 * sqrt(a), 3);
    double mean = 0;
    for (int pass = 0; pass < 3; pass++) {
        double sum = 0;
        size_t n = 0;
        for (size_t p = 0; p < calib->pixels; p++) {
            const double v = calib->defect[p] ? 0 : temporal_variance(calib, p, exposure_s);
            if (!calib->defect[p] && (pass == 0 || v <= limit * mean)) {
                sum += v;
                n++;
            } else if (!calib->defect[p] && pass == 2) {
                calib->defect[p] = 2;
                calib->report.noisy++;
            }
        }
        mean = n > 0 ? sum / (double)n : 0;
    }
    calib->noise.read_variance = mean;
}

// A frame far above its own fit saw light. One that is merely noisy differs by read noise / sqrt(pixels).
static gonio_status check_dark(const gonio_calib *calib, gonio_error *error) {
    double worst = 0;
    const stored_frame *at = NULL;
    for (int i = 0; i < calib->dark.n; i++) {
        const stored_frame *f = &calib->dark.items[i];
        double sum = 0;
        size_t n = 0;
        for (size_t p = 0; p < calib->pixels; p++) {
            if (!calib->defect[p]) {
                sum += linear_dn(calib, f->pixels[p]) - calib->bias[p] - calib->dark_rate[p] * f->exposure_s;
                n++;
            }
        }
        const double mean = sum / (double)(n > 0 ? n : 1);
        if (mean > worst) {
            worst = mean;
            at = f;
        }
    }
    // Half the read noise, everywhere at once, is hundreds of standard errors of a window's mean.
    if (at != NULL && worst > 0.5 * sqrt(calib->noise.read_variance) + 0.5) {
        return gonio_fail_frame(error, GONIO_E_DEVICE, at->stamp.pose, at->stamp.frame,
                                "dark frame not dark: its mean lies %.1f DN above the other dark frames", worst);
    }
    return GONIO_OK;
}

static gonio_status check_level(const gonio_calib *calib, gonio_error *error) {
    for (int i = 0; i < calib->dark.n; i++) {
        const stored_frame *f = &calib->dark.items[i];
        double sum = 0;
        for (size_t p = 0; p < calib->pixels; p++) {
            sum += f->pixels[p];
        }
        const double mean = sum / (double)calib->pixels;
        if (mean > 0.5 * calib->saturation) {
            return gonio_fail_frame(error, GONIO_E_DEVICE, f->stamp.pose, f->stamp.frame,
                                    "dark frame not dark: mean %.0f DN of %d at %g s", mean, calib->saturation,
                                    f->exposure_s);
        }
    }
    return GONIO_OK;
}

// The black level, raw: the mean of the shortest dark frames.
static double black_level(const gonio_calib *calib, double exposure_s) {
    double sum = 0;
    int n = 0;
    for (int i = 0; i < calib->dark.n; i++) {
        const stored_frame *f = &calib->dark.items[i];
        for (size_t p = 0; p < calib->pixels && f->exposure_s == exposure_s; p++) {
            sum += f->pixels[p];
        }
        n += f->exposure_s == exposure_s;
    }
    return sum / ((double)calib->pixels * n);
}

gonio_status gonio_dark_prepare(gonio_calib *calib, gonio_error *error) {
    const double exposure_s = repeated_exposure(&calib->dark);
    if (exposure_s == 0) {
        return gonio_fail(error, GONIO_E_INPUT,
                          "%d dark frames, none twice at one exposure; the read noise needs at least two alike",
                          calib->dark.n);
    }
    gonio_status status = check_level(calib, error);
    if (status == GONIO_OK && calib->response.points > 0) {
        status = gonio_response_tabulate(&calib->response, black_level(calib, exposure_s), error);
    }
    if (status != GONIO_OK) {
        return status;
    }
    line_sums s = {0};
    for (int i = 0; i < calib->dark.n; i++) {
        const double t = calib->dark.items[i].exposure_s;
        s.n++;
        s.t += t;
        s.tt += t * t;
    }
    for (size_t p = 0; p < calib->pixels; p++) {
        double bias, rate;
        fit_line(calib, &s, p, &bias, &rate);
        calib->bias[p] = (float)bias;
        calib->dark_rate[p] = (float)rate;
    }
    double quantum = 0;
    for (size_t p = 0; p < calib->pixels; p++) {
        quantum += quantum_variance(calib, calib->dark.items[0].pixels[p]);
    }
    calib->dark_quantum = quantum / (double)calib->pixels;
    measure_noise(calib, exposure_s);
    // A camera of few bits may hide its noise below one step; the step itself is then the noise.
    calib->noise.read_variance = fmax(calib->noise.read_variance, calib->dark_quantum);
    const double determinant = s.n * s.tt - s.t * s.t, v = calib->noise.read_variance;
    const bool line = determinant > 1e-9 * s.n * s.tt;
    calib->dark_covariance[0] = line ? v * s.tt / determinant : v / s.n;
    calib->dark_covariance[1] = line ? -v * s.t / determinant : 0;
    calib->dark_covariance[2] = line ? v * s.n / determinant : 0;
    status = find_hot(calib, error);
    return status == GONIO_OK ? check_dark(calib, error) : status;
}
