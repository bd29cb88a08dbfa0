// SPDX-License-Identifier: BSD-3-Clause
// The uncertainty budget of one sample (GUM, JCGM 100:2008, section 8), and the correction for lamp drift.
#include "calib/internal.h"

#include <math.h>

#include "base/vector.h"

typedef struct nearest {
    gonio_vec3 wi, wo;
    estimate found;
    double score; // cosines' sum; -INFINITY: none yet
} nearest;

static gonio_status keep_nearest(void *context, const estimate *e, gonio_error *error) {
    (void)error;
    nearest *n = context;
    const double score = dot(n->wi, gonio_direction(e->pair.theta_i, e->pair.phi_i)) +
                         dot(n->wo, gonio_direction(e->pair.theta_o, e->pair.phi_o));
    if (score > n->score) {
        n->score = score;
        n->found = *e;
    }
    return GONIO_OK;
}

static gonio_budget budget_of(const gonio_calib *calib, const gonio_model *model, int channel, const estimate *e) {
    const uncertainty *u = &e->variance[channel];
    slope_terms s = {.factor = 1};
    if (model != NULL) {
        s = gonio_slope_terms_of(&calib->facts, model, channel < model->channels ? channel : 0, &e->pair,
                                 e->value[channel]);
    }
    const double v2 = e->value[channel] * e->value[channel], f = s.factor;
    return (gonio_budget){
        .value = f * e->value[channel],
        .photon = f * sqrt(u->photon),
        .read = f * sqrt(u->read),
        .dark = f * sqrt(u->dark),
        .flat = f * sqrt(u->flat),
        .reference = f * sqrt(u->reference),
        .drift = f * sqrt(u->monitor + u->drift),
        .stray = f * sqrt(u->stray_random + u->stray),
        .angle = f * sqrt(v2 * (s.angle_random + s.angle_systematic) + u->alignment),
        .area = f * sqrt(v2 * s.area),
        .blur = f * sqrt(v2 * s.blur),
        .random = f * hypot(gonio_uncertainty_random(u), sqrt(v2 * s.angle_random)),
        .systematic = f * hypot(gonio_uncertainty_systematic(u), sqrt(v2 * (s.angle_systematic + s.area + s.blur))),
        .area_bias = s.area_bias,
        .blur_bias = s.blur_bias,
    };
}

gonio_status gonio_calib_budget(const gonio_calib *calib, const gonio_pair *pose, int n,
                                const gonio_exposure *exposures, const gonio_model *model, const gonio_pair *direction,
                                gonio_budget *budget, gonio_error *error) {
    gonio_pair wanted = direction != NULL ? *direction : *pose;
    if (calib->facts.sphere) {
        wanted.phi_o -= wanted.phi_i;
        wanted.phi_i = 0;
    }
    nearest found = {.wi = gonio_direction(wanted.theta_i, wanted.phi_i),
                     .wo = gonio_direction(wanted.theta_o, wanted.phi_o),
                     .score = -INFINITY};
    const gonio_status status = gonio_pose_estimates(calib, pose, n, exposures, keep_nearest, &found, error);
    for (int k = 0; status == GONIO_OK && k < calib->channels; k++) {
        budget[k] = budget_of(calib, model, k, &found.found);
    }
    return status;
}

// Responsivity in the later reference frames over the map's, and its relative variance from noise.
static gonio_status later_ratio(const gonio_calib *calib, double *ratio, double *clock_s, gonio_error *error) {
    double sum = 0, clock = 0;
    size_t used = 0;
    for (int j = 0; j < calib->later.n; j++) {
        const stored_frame *f = &calib->later.items[j];
        const geometry g = gonio_geometry_of_pose(&calib->facts, &f->pose);
        const double scale = reference_scale(calib, f), lit_s = scale_by_irradiance(&calib->facts) ? 0 : scale;
        double read = 0, expected = 0;
        size_t n = 0, clipped = 0;
        for (size_t p = 0; p < calib->pixels; p++) {
            geometry_hit hit;
            if (calib->defect[p] || !gonio_geometry_plate(&g, calib->ray[2 * p], calib->ray[2 * p + 1], &hit, NULL)) {
                continue;
            }
            const double known = gonio_white_signal(calib, &hit, calib->channel[p]);
            const merge_term t = term_of(calib, p, f->pixels[p], f->exposure_s, lit_s, calib->flat[p] * known * scale);
            read += t.signal;
            expected += t.scale;
            clipped += t.clipped;
            n++;
        }
        if (clipped * 1000 < n && expected > 0) {
            sum += read / expected;
            clock += f->stamp.clock_s;
            used++;
        }
    }
    if (used == 0) {
        return gonio_fail(error, GONIO_E_INPUT, "no reference frame after the scan that is not saturated");
    }
    *ratio = sum / (double)used;
    *clock_s = clock / (double)used;
    return GONIO_OK;
}

gonio_status gonio_calib_drift(const gonio_calib *calib, const double *clock_s, gonio_samples *samples, double *ratio,
                               gonio_error *error) {
    double end = 1, end_clock_s = 0;
    gonio_status status = later_ratio(calib, &end, &end_clock_s, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (ratio != NULL) {
        *ratio = end;
    }
    const double span = end_clock_s - calib->reference_clock_s;
    // A source that lights itself tells nothing of the lamp.
    if (calib->monitored || scale_by_irradiance(&calib->facts) || !(span > 0)) {
        return GONIO_OK;
    }
    const gonio_rig_facts *facts = &calib->facts;
    // Both references were aligned independently, each to the axes' repeatability.
    const double alignment =
        gonio_radians(facts->pointing_random_deg) * reference_slope(facts, calib->reference_theta_i);
    for (size_t i = 0; i < samples->n; i++) {
        const double share = (clock_s[i] - calib->reference_clock_s) / span;
        const double lamp = 1 + share * (end - 1);
        const double bound = facts->lamp_drift_per_h * (clock_s[i] - calib->reference_clock_s) / 3600;
        for (int k = 0; k < samples->channels; k++) {
            const size_t at = i * (size_t)samples->channels + (size_t)k;
            const double v = samples->values[at], before = bound * v, after = share * alignment * v;
            const double sigma = samples->sigma_systematic[at];
            samples->sigma_systematic[at] = sqrt(fmax(sigma * sigma - before * before, 0) + after * after) / lamp;
            samples->sigma_random[at] /= lamp;
            samples->values[at] = v / lamp;
        }
    }
    return GONIO_OK;
}
