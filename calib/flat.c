// Responsivity of every pixel (flat field times absolute scale) from the frames of the white reference.
//
// The panel's radiance is known: f_r = reflectance / pi times the irradiance of a point light at its distance and
// angle, pixel by pixel. All reference exposures are merged; the result is DN/s for unit f_r x relative irradiance, so
// that vignetting, PRNU and the lamp's intensity stand in one map and cancel from every sample.
#include "calib/internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// Known signal of the panel at this pixel, f_r x relative irradiance; 0 where the pixel does not see it lit.
static double panel_signal(const gonio_calib *calib, const geometry *g, size_t p) {
    geometry_hit hit;
    if (!geometry_plate(g, calib->ray[2 * p], calib->ray[2 * p + 1], &hit, NULL) || hit.irradiance <= 0) {
        return 0;
    }
    return calib->facts.reference_reflectance[calib->channel[p]] / GONIO_PI * hit.irradiance;
}

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
        const double lit_s = exposure_scale(calib, f->exposure_s, f->monitor);
        terms[j] = term_of(calib, p, f->pixels[p], f->exposure_s, lit_s, known * lit_s);
        terms[j].clipped = terms[j].clipped || known == 0;
    }
    merge_pixel(&calib->noise, n, terms, &merged);
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
        const double median = n > 0 ? statistics_quantile(values, n, 0.5) : 0;
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
    calib->report.flat_relative_sigma = sound > 0 ? sqrt(statistics_quantile(noise, sound, 0.5)) : 0;
    free(values);
    free(noise);
    return GONIO_OK;
}

// When and at which angle the reference was measured, and how well its lamp readings are known.
static void describe_reference(gonio_calib *calib, const flat_work *work) {
    const stored_frames *frames = &calib->reference;
    double clock = 0, variance = 0, theta = 0;
    int poses = 0;
    for (int j = 0; j < frames->n; j++) {
        const stored_frame *f = &frames->items[j];
        const double share = work->share[j] / (double)work->n;
        clock += share * f->stamp.clock_s;
        theta += share * geometry_pair(&calib->facts, &f->pose).theta_i;
        variance += calib->monitored ? share * share * f->monitor_sigma * f->monitor_sigma : 0;
        poses += j == 0 || f->stamp.pose != frames->items[j - 1].stamp.pose;
    }
    calib->reference_clock_s = clock;
    calib->reference_theta_i = theta;
    calib->monitor_reference_variance = variance;
    calib->reference_poses = poses;
}

gonio_status flat_prepare(gonio_calib *calib, gonio_error *error) {
    const int n = calib->reference.n;
    flat_work work = {.poses = calloc((size_t)n, sizeof *work.poses), .share = calloc((size_t)n, sizeof *work.share)};
    gonio_status status = GONIO_OK;
    if (work.poses == NULL || work.share == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for the flat field");
        goto done;
    }
    for (int j = 0; j < n; j++) {
        work.poses[j] = geometry_of_pose(&calib->facts, &calib->reference.items[j].pose);
    }
    for (size_t p = 0; p < calib->pixels; p++) {
        if (!calib->defect[p]) {
            merge_panel(calib, &work, p);
        }
    }
    if (work.failed * 100 > calib->pixels || work.n == 0) {
        const stored_frame *f = &calib->reference.items[0];
        status = gonio_fail(error, GONIO_E_DEVICE,
                            "step %lld frame %d: reference overexposed: %zu of %zu pixels have no valid exposure",
                            (long long)f->stamp.pose, f->stamp.frame, work.failed, calib->pixels);
        goto done;
    }
    describe_reference(calib, &work);
    status = find_dead(calib, error);
done:
    free(work.poses);
    free(work.share);
    return status;
}
