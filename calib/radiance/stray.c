// SPDX-License-Identifier: BSD-3-Clause
// Light that reaches the sensor otherwise than from the sample.
//
// Scattered by the room and the rig: a light trap on the table, the lamp on, shows it alone. It goes with the lamp, so
// it is kept as DN/s at the reference's lamp level, pixel by pixel, and taken off every lit frame like dark signal. The
// trap stands at one pose; that the scatter differs at others by facts.stray_variation is part of every sample's
// uncertainty, once for its own pose (random) and once for the trap's (common).
//
// Scattered by the lens (veiling glare): a share of the scene's mean radiance on every pixel. No frame shows it alone
// and it is not corrected. The reference fills the view with its own radiance, so that its responsivity is too large by
// just that share g; a sample that reads y is then wrong by g (M - y), M being its scene's mean. Of M the window's mean
// W is known, and that outside of the window there is something between nothing and the same: a rectangular
// distribution from W A_window / A_frame to W. g itself is uncertain by facts.glare_sigma about 0.
#include <math.h>

#include "calib/internal.h"

// A trap that returns more than this share of the white reference is none, or is not there.
#define TRAP_SHARE_MAX 0.05

// Lamp readings: all of them or none.
static void use_monitor(gonio_calib *calib) {
    double sum = 0;
    calib->monitored = true;
    calib->monitor_reference = 1;
    if (scale_by_irradiance(&calib->facts)) { // the lamp level at which the irradiance was read
        calib->monitored = calib->facts.irradiance_monitor > 0;
        calib->monitor_reference = calib->monitored ? calib->facts.irradiance_monitor : 1;
        return;
    }
    for (int i = 0; i < calib->reference.n; i++) {
        calib->monitored = calib->monitored && calib->reference.items[i].monitor > 0;
        sum += calib->reference.items[i].monitor;
    }
    if (calib->monitored) {
        calib->monitor_reference = sum / calib->reference.n;
    }
}

// One pixel's trap frames -> stray light. Adds its variance and sensitivities to the sums.
static bool merge_trap(gonio_calib *calib, size_t p, double *variance, double *bias, double *rate) {
    merge_term terms[MERGE_MAX];
    merge_result merged;
    const int n = calib->trap.n;
    for (int j = 0; j < n; j++) {
        const stored_frame *f = &calib->trap.items[j];
        const double lit_s = exposure_scale(calib, f->exposure_s, f->monitor);
        terms[j] = term_of(calib, p, f->pixels[p], f->exposure_s, 0, lit_s);
    }
    gonio_merge_pixel(&calib->noise, n, terms, &merged);
    if (merged.used == 0) {
        return false;
    }
    calib->stray[p] = (float)merged.value;
    *variance += merged.photon_variance + merged.read_variance;
    for (int j = 0; j < n; j++) {
        *bias -= merged.weight[j];
        *rate -= merged.weight[j] * calib->trap.items[j].exposure_s;
    }
    return true;
}

// DN/s of the white reference, mean over the window: of the frames that are not clipped, which read most a second.
static double white_rate(const gonio_calib *calib) {
    double best = 0;
    for (int j = 0; j < calib->reference.n; j++) {
        const stored_frame *f = &calib->reference.items[j];
        const double lit_s = exposure_scale(calib, f->exposure_s, f->monitor);
        double sum = 0;
        size_t n = 0;
        for (size_t p = 0; p < calib->pixels; p++) {
            if (!calib->defect[p]) {
                sum += term_of(calib, p, f->pixels[p], f->exposure_s, 0, lit_s).signal;
                n++;
            }
        }
        best = fmax(best, n > 0 ? sum / lit_s / (double)n : 0);
    }
    return best;
}

static gonio_status check_trap(const gonio_calib *calib, double trap_rate, gonio_error *error) {
    const double white = white_rate(calib);
    if (scale_by_irradiance(&calib->facts) || trap_rate <= TRAP_SHARE_MAX * white) {
        return GONIO_OK;
    }
    const stored_frame *first = &calib->trap.items[0];
    return gonio_fail_frame(error, GONIO_E_DEVICE, first->stamp.pose, first->stamp.frame,
                            "the light trap is not dark: it reads %.3g %% of the white reference",
                            100 * trap_rate / white);
}

gonio_status gonio_stray_prepare(gonio_calib *calib, gonio_error *error) {
    use_monitor(calib);
    const stored_frame *first = &calib->trap.items[0];
    if (calib->trap.n > MERGE_MAX) {
        return gonio_fail(error, GONIO_E_INPUT, "%d light-trap frames; at most %d are used", calib->trap.n, MERGE_MAX);
    }
    double variance = 0, bias = 0, rate = 0, sum = 0;
    size_t sound = 0, lost = 0;
    for (size_t p = 0; p < calib->pixels && calib->trap.n > 0; p++) {
        if (!calib->defect[p]) {
            const bool merged = merge_trap(calib, p, &variance, &bias, &rate);
            sound += merged;
            sum += merged ? calib->stray[p] : 0;
            lost += !merged;
        }
    }
    if (lost * 100 > sound) {
        return gonio_fail_frame(error, GONIO_E_DEVICE, first->stamp.pose, first->stamp.frame,
                                "light trap overexposed: %zu of %zu pixels have no valid exposure", lost,
                                calib->pixels);
    }
    if (sound == 0) {
        return GONIO_OK; // no trap
    }
    calib->stray_variance = variance / (double)sound;
    calib->stray_bias = bias / (double)sound;
    calib->stray_rate = rate / (double)sound;
    return check_trap(calib, sum / (double)sound, error);
}

void gonio_stray_describe(gonio_calib *calib) {
    double sum = 0;
    size_t n = 0;
    for (size_t p = 0; p < calib->pixels && calib->trap.n > 0; p++) {
        if (!calib->defect[p]) {
            sum += calib->stray[p] / calib->flat[p];
            n++;
        }
    }
    calib->report.stray = n > 0 ? sum / (double)n : 0;
}

// The dark maps act directly and, with the opposite sign, through the stray light that they were taken off: where trap
// and pose have like exposures they cancel.
sensitivity gonio_sensitivity_of(const gonio_calib *calib, int n, const gonio_exposure *exposures, const double *scale,
                                 const merge_result *merged) {
    sensitivity s = {0};
    for (int j = 0; j < n; j++) {
        const double w = merged->weight[j];
        s.bias += w * (1 + scale[j] * calib->stray_bias);
        s.rate += w * (exposures[j].frame.exposure_s + scale[j] * calib->stray_rate);
        s.stray += w * scale[j];
    }
    return s;
}

double gonio_dark_variance(const gonio_calib *calib, const sensitivity *s) {
    const double *c = calib->dark_covariance;
    return s->bias * s->bias * c[0] + 2 * s->bias * s->rate * c[1] + s->rate * s->rate * c[2];
}

// Every eighth 2 x 2 quad in both directions tells the mean: quads, so that every colour has its part. Where all
// exposures are too bright the shortest one's reading is a lower bound.
#define QUAD_STEP 8

void gonio_stray_surroundings(const gonio_calib *calib, int n, const gonio_exposure *exposures, const double *scale,
                              double mean[3]) {
    size_t count[3] = {0};
    int shortest = 0;
    for (int j = 1; j < n; j++) {
        shortest = scale[j] < scale[shortest] ? j : shortest;
    }
    mean[0] = mean[1] = mean[2] = 0;
    for (size_t p = 0; p < calib->pixels && calib->facts.glare_sigma > 0; p++) {
        const size_t column = p % (size_t)calib->window.width, row = p / (size_t)calib->window.width;
        if (column % QUAD_STEP > 1 || row % QUAD_STEP > 1 || calib->defect[p]) {
            continue;
        }
        merge_result merged;
        gonio_pixel_merge(calib, p, n, exposures, scale, &merged);
        if (merged.used == 0) {
            const merge_term t = term_of(calib, p, exposures[shortest].frame.pixels[p],
                                         exposures[shortest].frame.exposure_s, scale[shortest], 1);
            merged.value = t.signal / (calib->flat[p] * scale[shortest]);
        }
        mean[calib->channel[p]] += merged.value;
        count[calib->channel[p]]++;
    }
    for (int k = 0; k < 3; k++) {
        mean[k] = count[k] > 0 ? fmax(mean[k] / (double)count[k], 0) : 0;
    }
}

double gonio_glare_variance(const gonio_calib *calib, double seen, double surroundings) {
    const double frame = (double)calib->camera.width * calib->camera.height, cover = (double)calib->pixels / frame;
    const double middle = surroundings * (1 + cover) / 2 - seen, half = surroundings * (1 - cover) / 2;
    return calib->facts.glare_sigma * calib->facts.glare_sigma * (middle * middle + half * half / 3);
}
