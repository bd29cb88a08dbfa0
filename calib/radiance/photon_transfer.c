// SPDX-License-Identifier: BSD-3-Clause
// The camera's gain and saturation from the reference frames.
//
// Photon transfer (EMVA 1288 release 4.0, section 2.2): the temporal variance of a linear camera grows with its mean as
// var = var_dark + K mean, K DN an electron. Two frames of one exposure differ by noise alone; their difference, after
// the lamp's flicker is scaled out, carries twice the variance. Summing variance and mean over all pixels and dividing
// is unbiased whatever the illumination's shape.
#include "base/statistics.h"
#include "calib/internal.h"

#include <math.h>
#include <stdlib.h>

static double signal_of(const gonio_calib *calib, const stored_frame *f, size_t p) {
    return linear_dn(calib, f->pixels[p]) - calib->bias[p] - calib->dark_rate[p] * f->exposure_s;
}

// Frames of one exposure and pose in a row.
static bool alike(const stored_frame *a, const stored_frame *b) {
    return a->exposure_s == b->exposure_s && a->pose.theta_i == b->pose.theta_i && a->pose.theta_o == b->pose.theta_o &&
           a->pose.phi_i == b->pose.phi_i && a->pose.phi_o == b->pose.phi_o;
}

// Share of the sound pixels at or above `level` in the frame.
static double share_above(const gonio_calib *calib, const stored_frame *f, double level) {
    size_t above = 0, n = 0;
    for (size_t p = 0; p < calib->pixels; p++) {
        if (!calib->defect[p]) {
            above += f->pixels[p] >= level;
            n++;
        }
    }
    return n > 0 ? (double)above / (double)n : 1;
}

static double mean_signal(const gonio_calib *calib, const stored_frame *f) {
    double sum = 0;
    size_t n = 0;
    for (size_t p = 0; p < calib->pixels; p++) {
        if (!calib->defect[p]) {
            sum += signal_of(calib, f, p);
            n++;
        }
    }
    return sum / (double)(n > 0 ? n : 1);
}

// The brightest reference frame that is surely unsaturated: its mean is at most 0.6 of the brightest mean of all.
static const stored_frame *unsaturated_frame(const gonio_calib *calib) {
    const stored_frame *best = NULL;
    double top = 0, found = 0;
    for (int i = 0; i < calib->reference.n; i++) {
        top = fmax(top, mean_signal(calib, &calib->reference.items[i]));
    }
    for (int i = 0; i < calib->reference.n; i++) {
        const double mean = mean_signal(calib, &calib->reference.items[i]);
        if (mean <= 0.6 * top && mean > found) {
            found = mean;
            best = &calib->reference.items[i];
        }
    }
    return best;
}

// Saturation: pixels that a shorter exposure predicts 15 % above what they read (ten times its noise, and above any
// plausible non-linearity) have clipped, at the level read. The low end of those levels is taken, so that a full well
// that clips before the read noise is added counts as well.
static gonio_status measure_saturation(gonio_calib *calib, gonio_error *error) {
    const stored_frame *base = unsaturated_frame(calib);
    float *levels = malloc(calib->pixels * sizeof *levels);
    if (levels == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for saturation levels");
    }
    double lowest = calib->saturation;
    for (int i = 0; i < calib->reference.n && base != NULL; i++) {
        const stored_frame *f = &calib->reference.items[i];
        const double ratio = f->exposure_s / base->exposure_s;
        size_t n = 0;
        for (size_t p = 0; p < calib->pixels && ratio > 1.15; p++) {
            const double x = signal_of(calib, f, p), predicted = ratio * signal_of(calib, base, p);
            if (!calib->defect[p] && x > 0.2 * calib->saturation && predicted > 1.15 * x) {
                levels[n++] = (float)f->pixels[p];
            }
        }
        if (n > calib->pixels / 100) {
            lowest = fmin(lowest, gonio_quantile_f32(levels, n, 0.01));
            calib->report.saturation_measured = true;
        }
    }
    free(levels);
    calib->saturation = (int)lowest;
    calib->report.saturation_dn = calib->saturation;
    return GONIO_OK;
}

// Add one pair's variance (both noises taken off) and mean signal, dark current included, to the sums.
static void add_pair(const gonio_calib *calib, const stored_frame *a, const stored_frame *b, double *variance,
                     double *mean) {
    const double flicker = mean_signal(calib, b) / mean_signal(calib, a);
    for (size_t p = 0; p < calib->pixels; p++) {
        if (!calib->defect[p]) {
            const double xa = signal_of(calib, a, p), xb = signal_of(calib, b, p), d = xb - flicker * xa;
            const double quantum = quantum_variance(calib, a->pixels[p]) - calib->dark_quantum;
            *variance += d * d / (1 + flicker * flicker) - calib->noise.read_variance - quantum;
            *mean += (xa + xb) / 2 + calib->dark_rate[p] * a->exposure_s;
        }
    }
}

static gonio_status measure_gain(gonio_calib *calib, gonio_error *error) {
    const stored_frames *frames = &calib->reference;
    const double high = 0.9 * calib->saturation;
    double variance = 0, mean = 0;
    int pairs = 0;
    for (int i = 1; i < frames->n; i++) {
        const stored_frame *a = &frames->items[i - 1], *b = &frames->items[i];
        if (alike(a, b) && share_above(calib, a, high) < 0.01 && share_above(calib, b, high) < 0.01) {
            add_pair(calib, a, b, &variance, &mean);
            pairs++;
        }
    }
    if (pairs == 0) {
        return gonio_fail(error, GONIO_E_INPUT,
                          "no two reference frames in a row at one exposure below saturation; "
                          "the gain needs at least one such pair");
    }
    calib->noise.dn_per_e = variance / mean;
    if (!(variance > 0 && mean > 0)) {
        return gonio_fail(error, GONIO_E_INPUT, "the reference frames show no photon noise (variance %g over mean %g)",
                          variance, mean);
    }
    return GONIO_OK;
}

// Is there light at all, and at least one exposure that is not saturated?
static gonio_status check_light(const gonio_calib *calib, gonio_error *error) {
    const stored_frame *best = NULL, *first = &calib->reference.items[0];
    double brightest = -INFINITY;
    for (int i = 0; i < calib->reference.n; i++) {
        const stored_frame *f = &calib->reference.items[i];
        brightest = fmax(brightest, mean_signal(calib, f));
        if (share_above(calib, f, 0.98 * calib->saturation) < 0.01) {
            best = f;
        }
    }
    if (best == NULL) {
        return gonio_fail_frame(error, GONIO_E_DEVICE, first->stamp.pose, first->stamp.frame,
                                "reference overexposed, as is every other one");
    }
    if (brightest < 5 * sqrt(calib->noise.read_variance)) {
        return gonio_fail_frame(error, GONIO_E_DEVICE, first->stamp.pose, first->stamp.frame,
                                "the lamp is off: the reference reads %.1f DN above dark at %g s", brightest,
                                best->exposure_s);
    }
    return GONIO_OK;
}

gonio_status gonio_transfer_prepare(gonio_calib *calib, gonio_error *error) {
    if (calib->reference.n == 0) {
        return gonio_fail(error, GONIO_E_INPUT, "no reference frames");
    }
    gonio_status status = check_light(calib, error);
    status = status == GONIO_OK ? measure_saturation(calib, error) : status;
    status = status == GONIO_OK ? measure_gain(calib, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    const double gain = 1 / calib->noise.dn_per_e;
    // The read variance contains the quantisation at the bias level; the merge adds it at the signal's own level.
    const double read = calib->noise.read_variance;
    calib->noise.read_variance = fmax(read - calib->dark_quantum, 0);
    calib->report.gain_e_per_dn = gain;
    calib->report.read_noise_e = sqrt(calib->noise.read_variance) * gain;
    calib->report.dark_e_per_s *= gain;
    double bias, scatter;
    status = gonio_median_mad_f32(calib->bias, calib->pixels, &bias, &scatter, error);
    const double well = linear_dn(calib, (uint16_t)calib->saturation) - bias;
    // Far enough below clipping that the pooled estimate is not censored: merge.c.
    const double margin = 6 * sqrt(well * calib->noise.dn_per_e + read);
    calib->noise.ceiling = well - fmax(0.05 * well, margin);
    return status;
}
