// SPDX-License-Identifier: BSD-3-Clause
// How noisy the frames of each object are, from their residuals, band by band of obliquity: corners that are
// foreshortened are found less well, and a mirror's highlight at grazing incidence is drawn out. One figure for all
// would claim too much of the oblique frames and ask too little of the others.
#include "calib/rig/bundle.h"

#include <math.h>

#define A GONIO_ALIGNMENT_PARAMETERS
#define NOISE_MIN_PX 0.005
#define NOISE_MAX_PX 100
#define BAND_DEG 15
// The logarithm of a noise differs from band to band by about 0.5, which n coordinates tell to 1/sqrt(2 n): the mean of
// all bands counts as this many coordinates.
#define MEAN_COUNTS 2

typedef struct counts {
    int of[GONIO_RIG_OBJECTS][BUNDLE_BANDS], all[GONIO_RIG_OBJECTS];
} counts;

int gonio_bundle_band(const gonio_rig_view *view) {
    double angle = view->axes.theta_o;
    if (view->object == GONIO_RIG_BALL) { // its surface's normal halves the directions
        const gonio_vec3 i = gonio_direction(view->axes.theta_i, view->axes.phi_i);
        const gonio_vec3 o = gonio_direction(view->axes.theta_o, view->axes.phi_o);
        angle = acos(fmax(-1, fmin(1, i.x * o.x + i.y * o.y + i.z * o.z))) / 2;
    }
    const double band = round(fabs(gonio_degrees(angle)) / BAND_DEG);
    return (int)fmin(band, BUNDLE_BANDS - 1);
}

static counts count(const bundle *q) {
    counts n = {0};
    for (int i = 0; i < q->n; i++) {
        const bundle_frame *f = &q->frames[i];
        if (f->view->used) {
            n.of[f->view->object][f->band] += 2 * f->points;
            n.all[f->view->object] += 2 * f->points;
        }
    }
    return n;
}

// Sum of squares of the residuals of an object's band, whitened with this noise.
static double chi_square(const bundle *q, const double *p, int object, int band, double noise) {
    const gonio_camera_info camera = gonio_bundle_camera(q, p);
    double r[2 * GONIO_CORNERS_MAX], total = 0;
    for (int i = 0; i < q->n; i++) {
        const bundle_frame *f = &q->frames[i];
        if (f->view->used && (int)f->view->object == object && f->band == band &&
            gonio_bundle_residuals(q, p, &camera, f, r)) {
            gonio_bundle_whiten(f, noise, r);
            for (int k = 0; k < 2 * f->points; k++) {
                total += r[k] * r[k];
            }
        }
    }
    return total;
}

// Logarithm of the noise with which a band's chi square is what it should have; it falls with the noise, so halving
// finds it. The axes' repeatability is in the whitening and must not count twice.
static double log_noise(const bundle *q, const double *p, int object, int band, double expected) {
    double low = log(NOISE_MIN_PX), high = log(NOISE_MAX_PX);
    for (int k = 0; k < 24; k++) {
        const double middle = (low + high) / 2;
        *(chi_square(q, p, object, band, exp(middle)) > expected ? &low : &high) = middle;
    }
    return high;
}

static void measure_object(bundle *q, const double *p, int object, int all, const int n[BUNDLE_BANDS], int told) {
    double log_of[BUNDLE_BANDS] = {0}, mean = 0;
    for (int b = 0; b < BUNDLE_BANDS; b++) {
        if (n[b] > 0) {
            // Each band tells its share of the parameters.
            log_of[b] = log_noise(q, p, object, b, n[b] * (1 - (double)told / all));
            mean += n[b] * log_of[b] / all;
        }
    }
    for (int b = 0; b < BUNDLE_BANDS; b++) {
        q->noise_px[object][b] = exp((n[b] * log_of[b] + MEAN_COUNTS * mean) / (n[b] + MEAN_COUNTS));
    }
}

void gonio_bundle_measure_noise(bundle *q, const double *p) {
    // The camera's arm is told by the corners; the light's by the mirror where there is one, else by the ball.
    const int light = A - GONIO_LIGHT_AZIMUTH_AXIS;
    const counts n = count(q);
    const bool mirror = n.all[GONIO_RIG_MIRROR] > light;
    const int told[GONIO_RIG_OBJECTS] = {GONIO_LIGHT_AZIMUTH_AXIS, mirror ? 6 : light + 3, mirror ? light : 0};
    for (int o = 0; o < GONIO_RIG_OBJECTS; o++) {
        if (n.all[o] > told[o]) {
            measure_object(q, p, o, n.all[o], n.of[o], told[o]);
        }
    }
}

void gonio_bundle_mean_noise(const bundle *q, double noise_px[GONIO_RIG_OBJECTS]) {
    const counts n = count(q);
    for (int o = 0; o < GONIO_RIG_OBJECTS; o++) {
        double total = 0;
        for (int b = 0; b < BUNDLE_BANDS; b++) {
            total += n.of[o][b] * q->noise_px[o][b] * q->noise_px[o][b];
        }
        noise_px[o] = n.all[o] > 0 ? sqrt(total / n.all[o]) : q->noise_px[o][0];
    }
}
