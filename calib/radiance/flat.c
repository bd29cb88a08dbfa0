// SPDX-License-Identifier: BSD-3-Clause
// Responsivity of every pixel (flat field times absolute scale) from the frames of the white reference.
//
// The panel's radiance is known: f_r = reflectance / pi times the irradiance of a point light at its distance and
// angle, pixel by pixel. All reference exposures are merged; the result is DN/s for unit f_r x relative irradiance, so
// that vignetting, PRNU and the lamp's intensity stand in one map and cancel from every sample.
#include "base/statistics.h"
#include "calib/internal.h"

#include <math.h>
#include <stdlib.h>

// Known signal of the panel at this pixel, f_r x relative irradiance; 0 where the pixel does not see it lit.
static double panel_signal(const gonio_calib *calib, const geometry *g, size_t p) {
    geometry_hit hit;
    if (scale_by_irradiance(&calib->facts)) {
        return gonio_white_signal(calib, NULL, calib->channel[p]);
    }
    if (!gonio_geometry_plate(g, calib->ray[2 * p], calib->ray[2 * p + 1], &hit, NULL) || hit.irradiance <= 0) {
        return 0;
    }
    return gonio_white_signal(calib, &hit, calib->channel[p]);
}

static double square(double x) { return x * x; }

typedef struct flat_work {
    geometry *poses;  // one a reference frame
    double *share;    // sum over pixels of each frame's share in the value
    size_t n, failed; // pixels measured, and without a valid exposure
} flat_work;

static void merge_panel(gonio_calib *calib, flat_work *work, size_t p) {
    merge_term terms[MERGE_MAX];
    merge_result merged;
    const int n = calib->reference.n;
    for (int j = 0; j < n; j++) {
        const stored_frame *f = &calib->reference.items[j];
        const double known = panel_signal(calib, &work->poses[j], p);
        const double scale = reference_scale(calib, f), lit_s = scale_by_irradiance(&calib->facts) ? 0 : scale;
        terms[j] = term_of(calib, p, f->pixels[p], f->exposure_s, lit_s, known * scale);
        terms[j].clipped = terms[j].clipped || known == 0;
    }
    gonio_merge_pixel(&calib->noise, n, terms, &merged);
    if (merged.used == 0 || !(merged.value > 0)) {
        work->failed += merged.saturated;
        calib->defect[p] = 3;
        return;
    }
    const double variance = merged.photon_variance + merged.read_variance;
    calib->flat[p] = (float)merged.value;
    calib->flat_variance[p] = (float)(variance / (merged.value * merged.value));
    for (int j = 0; j < n; j++) {
        work->share[j] += merged.weight[j] * terms[j].signal / merged.value;
    }
    work->n++;
}

// Pixels that answer less than half or more than twice as much as their colour's median are dead, or do not see the
// panel: vignetting and PRNU stay far inside.
static gonio_status find_dead(gonio_calib *calib, gonio_error *error) {
    float *values = malloc(calib->pixels * sizeof *values), *noise = malloc(calib->pixels * sizeof *noise);
    if (values == NULL || noise == NULL) {
        free(values);
        free(noise);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the flat field's median");
    }
    size_t sound = 0;
    for (int c = 0; c < calib->channels; c++) {
        size_t n = 0;
        for (size_t p = 0; p < calib->pixels; p++) {
            if (!calib->defect[p] && calib->channel[p] == c) {
                values[n++] = calib->flat[p];
            }
        }
        const double median = n > 0 ? gonio_quantile_f32(values, n, 0.5) : 0;
        for (size_t p = 0; p < calib->pixels; p++) {
            const bool mine = calib->channel[p] == c && !calib->defect[p];
            if (mine && (calib->flat[p] < 0.5 * median || calib->flat[p] > 2 * median)) {
                calib->defect[p] = 3;
                calib->report.dead++;
            } else if (mine) {
                noise[sound++] = calib->flat_variance[p];
            }
        }
    }
    calib->report.flat_relative_sigma = sound > 0 ? sqrt(gonio_quantile_f32(noise, sound, 0.5)) : 0;
    free(values);
    free(noise);
    return GONIO_OK;
}

// When and at which angle the reference was measured, and how well its lamp readings are known.
static void describe_reference(gonio_calib *calib, const flat_work *work) {
    // The uncertainty of an irradiance reading is part of the stated one.
    const bool panel_monitored = calib->monitored && !scale_by_irradiance(&calib->facts);
    const stored_frames *frames = &calib->reference;
    double clock = 0, variance = 0, theta = 0;
    int poses = 0;
    for (int j = 0; j < frames->n; j++) {
        const stored_frame *f = &frames->items[j];
        const double share = work->share[j] / (double)work->n;
        clock += share * f->stamp.clock_s;
        theta += share * gonio_geometry_pair(&calib->facts, &f->pose).theta_i;
        variance += panel_monitored ? share * share * f->monitor_sigma * f->monitor_sigma : 0;
        poses += j == 0 || f->stamp.pose != frames->items[j - 1].stamp.pose;
    }
    calib->reference_clock_s = clock;
    calib->reference_theta_i = theta;
    calib->monitor_reference_variance = variance;
    calib->reference_poses = poses;
}

void gonio_flat_means(const gonio_calib *calib, double mean[3]) {
    double sum[3] = {0};
    size_t n[3] = {0};
    for (size_t p = 0; p < calib->pixels; p++) {
        if (!calib->defect[p]) {
            sum[calib->channel[p]] += calib->flat[p];
            n[calib->channel[p]]++;
        }
    }
    for (int c = 0; c < 3; c++) {
        mean[c] = n[c] > 0 ? sum[c] / (double)n[c] : 1;
    }
}

// A flat field of another lens setting or light differs by more than noise.
#define FLAT_MISFIT_MAX 0.005

// Scale of the known flat field in one channel, by weights of the reference's noise; *misfit: robust relative scatter
// beyond the noise.
static gonio_status fit_scale(const gonio_calib *calib, int channel, double *scale, double *variance, double *misfit,
                              gonio_error *error) {
    float *ratio = malloc((calib->pixels + 1) * sizeof *ratio);
    if (ratio == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the flat field's scale");
    }
    double sum = 0, weight = 0, noise = 0;
    size_t n = 0;
    for (size_t p = 0; p < calib->pixels; p++) {
        if (!calib->defect[p] && calib->channel[p] == channel && calib->known_flat[p] > 0) {
            const double v = (double)calib->flat_variance[p] + (double)calib->known_flat[calib->pixels + p];
            ratio[n++] = calib->flat[p] / calib->known_flat[p];
            sum += ratio[n - 1] / v;
            weight += 1 / v;
            noise += v;
        }
    }
    gonio_status status = GONIO_OK;
    double median = 1, scatter = 0;
    if (n == 0) {
        status = gonio_fail_line(error, GONIO_E_INPUT, calib->facts.flat_path, -1,
                                 "no pixel of channel %s in it is sound", calib->names[channel]);
    } else {
        status = gonio_median_mad_f32(ratio, n, &median, &scatter, error);
    }
    free(ratio);
    if (status == GONIO_OK) {
        *scale = sum / weight;
        *variance = 1 / weight;
        *misfit = sqrt(fmax(square(scatter / median) - noise / (double)n, 0));
    }
    return status;
}

// The file's flat field in the place of this reference's own, which gives each channel's scale.
static gonio_status use_known(gonio_calib *calib, gonio_error *error) {
    double scale[3], variance[3], misfit = 0;
    for (int c = 0; c < calib->channels; c++) {
        const gonio_status status = fit_scale(calib, c, &scale[c], &variance[c], &misfit, error);
        if (status != GONIO_OK) {
            return status;
        }
        if (misfit > FLAT_MISFIT_MAX) {
            return gonio_fail_line(error, GONIO_E_INPUT, calib->facts.flat_path, -1,
                                   "does not fit this session: its reference differs from this flat field by %.2g %% "
                                   "from pixel to pixel, beyond noise",
                                   100 * misfit);
        }
    }
    for (size_t p = 0; p < calib->pixels; p++) {
        const float known = calib->known_flat[p];
        const int c = calib->channel[p];
        if (isnan(known) && !calib->defect[p]) {
            calib->defect[p] = 3;
        } else if (!calib->defect[p]) {
            calib->flat[p] = (float)(scale[c] * (double)known);
            calib->flat_variance[p] = (float)((double)calib->known_flat[calib->pixels + p] + variance[c]);
        }
    }
    return GONIO_OK;
}

gonio_status gonio_flat_prepare(gonio_calib *calib, gonio_error *error) {
    const int n = calib->reference.n;
    flat_work work = {.poses = calloc((size_t)n, sizeof *work.poses), .share = calloc((size_t)n, sizeof *work.share)};
    gonio_status status = GONIO_OK;
    if (work.poses == NULL || work.share == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for the flat field");
        goto done;
    }
    for (int j = 0; j < n; j++) {
        work.poses[j] = gonio_geometry_of_pose(&calib->facts, &calib->reference.items[j].pose);
    }
    for (size_t p = 0; p < calib->pixels; p++) {
        if (!calib->defect[p]) {
            merge_panel(calib, &work, p);
        }
    }
    if (work.failed * 100 > calib->pixels || work.n == 0) {
        const stored_frame *f = &calib->reference.items[0];
        status = gonio_fail_frame(error, GONIO_E_DEVICE, f->stamp.pose, f->stamp.frame,
                                  "reference overexposed: %zu of %zu pixels have no valid exposure", work.failed,
                                  calib->pixels);
        goto done;
    }
    describe_reference(calib, &work);
    status = calib->known_flat != NULL ? use_known(calib, error) : GONIO_OK;
    status = status == GONIO_OK ? find_dead(calib, error) : status;
done:
    free(work.poses);
    free(work.share);
    return status;
}
