// SPDX-License-Identifier: BSD-3-Clause
// Which exposure next? A pixel is well exposed where one exposure puts it between 15 % of the usable range and its top.
//
// Too bright everywhere: an eighth of the shortest exposure. Too dim: the exposure that brings the brightest of the dim
// pixels to 70 % of the range; dimmer ones follow with the next frame. Each frame so covers a factor of about five, and
// eight of them more than five decades.
#include "calib/internal.h"

#include <math.h>

#define FRAMES_MAX 8
#define LOW_SHARE 0.15
#define AIM_SHARE 0.70
#define SHORTEN 8
#define LENGTHEN_MAX 32 // a signal lost in noise says little about how much longer

typedef struct bracket_state {
    double ceiling; // usable signal, linear DN
    double shortest_s, longest_s;
    size_t used, bright, dim;
    double dim_rate, dim_exposure_s; // of the brightest dim pixel: signal a second, from this exposure
} bracket_state;

// Before the maps exist the first dark frame stands for the bias.
static double signal_of(const gonio_calib *calib, size_t p, const gonio_frame *f) {
    const double x = linear_dn(calib, f->pixels[p]);
    if (calib->prepared) {
        return x - calib->bias[p] - calib->dark_rate[p] * f->exposure_s;
    }
    return calib->dark.n > 0 ? x - linear_dn(calib, calib->dark.items[0].pixels[p]) : x;
}

static void look_at(const gonio_calib *calib, size_t p, int n, const gonio_exposure *exposures, bracket_state *s) {
    double best = -INFINITY, exposure_s = 0;
    for (int j = 0; j < n; j++) {
        const gonio_frame *f = &exposures[j].frame;
        const double signal = signal_of(calib, p, f);
        // Of the exposures in range, the longest one says most.
        if (f->pixels[p] < calib->saturation && signal <= s->ceiling && f->exposure_s > exposure_s) {
            best = signal;
            exposure_s = f->exposure_s;
        }
    }
    s->used++;
    if (exposure_s == 0) {
        s->bright++;
    } else if (best < LOW_SHARE * s->ceiling) {
        s->dim++;
        if (best / exposure_s > s->dim_rate) {
            s->dim_rate = best / exposure_s;
            s->dim_exposure_s = exposure_s;
        }
        if (s->dim_exposure_s == 0) {
            s->dim_exposure_s = exposure_s;
        }
    }
}

static void survey(const gonio_calib *calib, const gonio_pair *pose, int n, const gonio_exposure *exposures,
                   bracket_state *s) {
    const geometry g = gonio_geometry_of_pose(&calib->facts, pose);
    for (int j = 0; j < n; j++) {
        s->shortest_s = fmin(s->shortest_s, exposures[j].frame.exposure_s);
        s->longest_s = fmax(s->longest_s, exposures[j].frame.exposure_s);
    }
    for (size_t p = 0; p < calib->pixels; p++) {
        geometry_hit hit;
        // The whole panel matters while the reference is measured: its map serves every pixel.
        if (!calib->prepared || gonio_pixel_used(calib, &g, p, &hit, NULL)) {
            look_at(calib, p, n, exposures, s);
        }
    }
}

static double clamped(const gonio_calib *calib, double exposure_s) {
    return fmin(fmax(exposure_s, calib->camera.exposure_min_s), calib->camera.exposure_max_s);
}

// The first exposure of a pose: a white plate lit like this at half the range.
static double first_exposure(const gonio_calib *calib, const gonio_pair *pose) {
    double rate = 0;
    for (size_t p = 0; p < calib->pixels && calib->prepared; p++) {
        rate = fmax(rate, calib->defect[p] ? 0 : calib->flat[p]);
    }
    rate *= fmax(cos(gonio_geometry_pair(&calib->facts, pose).theta_i), 0.05) / GONIO_PI;
    return clamped(calib, rate > 0 ? 0.5 * calib->noise.ceiling / rate : 0.01);
}

gonio_exposure_verdict gonio_calib_bracket(const gonio_calib *calib, const gonio_pair *pose, int n,
                                           const gonio_exposure *exposures, double *next_s) {
    *next_s = n > 0 ? exposures[n - 1].frame.exposure_s : first_exposure(calib, pose);
    if (n == 0) {
        return GONIO_EXPOSURE_MORE;
    }
    const double full = linear_dn(calib, (uint16_t)calib->saturation);
    bracket_state s = {.ceiling = calib->prepared ? calib->noise.ceiling : 0.85 * full, .shortest_s = INFINITY};
    survey(calib, pose, n, exposures, &s);
    // Unknown hot pixels must not drive the reference's exposure; a thousandth of the window bounds them.
    const size_t ignored = calib->prepared ? 0 : s.used / 1000;
    const bool bright = s.bright > ignored, dim = s.dim > ignored;
    if (!bright && !dim) {
        return GONIO_EXPOSURE_DONE;
    }
    const bool shorter = bright && s.shortest_s > calib->camera.exposure_min_s * 1.0001;
    const bool longer = dim && s.dim_exposure_s < calib->camera.exposure_max_s * 0.9999;
    if (n >= FRAMES_MAX || (!shorter && !longer)) {
        return GONIO_EXPOSURE_LIMIT;
    }
    if (shorter) {
        *next_s = clamped(calib, s.shortest_s / SHORTEN);
        return GONIO_EXPOSURE_MORE;
    }
    const double wanted = s.dim_rate > 0 ? AIM_SHARE * s.ceiling / s.dim_rate : INFINITY;
    *next_s = clamped(calib, fmin(fmax(wanted, 2 * s.dim_exposure_s), LENGTHEN_MAX * s.dim_exposure_s));
    // Taken already, and these pixels were too bright or too dim in it: nothing between helps.
    for (int j = 0; j < n; j++) {
        if (fabs(exposures[j].frame.exposure_s - *next_s) <= 1e-9 * *next_s) {
            return GONIO_EXPOSURE_LIMIT;
        }
    }
    return GONIO_EXPOSURE_MORE;
}
