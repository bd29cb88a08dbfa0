// SPDX-License-Identifier: BSD-3-Clause
// The angle and area terms, from the slope and curvature of a model that was fitted to the samples.
//
// A plate. The sample is stated at the nominal angles, but light and camera stood at the true ones. What was measured
// is f(true) cos(theta_i true) / cos(theta_i nominal), since the irradiance is assumed from the nominal angle; so an
// error of theta_i acts through d ln(f cos theta_i) / d theta_i = d ln f / d theta_i - tan theta_i, the others through
// d ln f. The white reference was lit at 45 deg through the same axis with the same zero error, which scaled every
// sample by cos 45 / cos(45 + error): + tan 45 for the systematic part of theta_i.
//
// Where the rig's alignment is known, the sample is stated at its true directions, and the alignment's own covariance,
// the correlation with the reference included, takes the place of the zero errors.
//
// A sphere about the centre of rotation looks the same to the camera wherever that stands; only the light's direction
// relative to the camera matters, in which both arms' errors meet: a tangential error of the light, in both directions
// (at most, where the axes cross at right angles), each of sqrt(2) times one axis' uncertainty.
//
// What a sample averages (its disc, the light's disc, the camera's aperture) is in blur.c: the value is corrected for
// it.
#include "calib/internal.h"

#include <math.h>

// A gradient needs a positive value to be relative to; below this share of a white plate it says nothing.
#define VALUE_MIN (1e-6 / GONIO_PI)

static double square(double x) { return x * x; }

static double model_at(const gonio_model *model, const gonio_pair *pair, int channel) {
    gonio_vec3 wi = gonio_direction(pair->theta_i, pair->phi_i), wo = gonio_direction(pair->theta_o, pair->phi_o);
    if (!model->ops->both_sides) {
        wi.z = fmax(wi.z, 0);
        wo.z = fmax(wo.z, 0);
    }
    return gonio_model_eval_channel(model, wi, wo, channel);
}

// Relative variance by the errors of a known alignment. d: relative slopes along theta_i, phi_i, theta_o, phi_o. An
// alignment turns directions by what a displacement on the sphere is, so a slope along phi is taken per unit of length.
static double alignment_variance(const gonio_rig_facts *facts, const gonio_pair *pair, const double d[4]) {
    const gonio_pair reference = {.theta_i = gonio_radians(GONIO_REFERENCE_THETA_I_DEG)};
    const double si = fmax(sin(pair->theta_i), 1e-3), so = fmax(sin(pair->theta_o), 1e-3);
    const double slope[5] = {d[0] - tan(pair->theta_i), d[1] / si, d[2], d[3] / so,
                             reference_slope(facts, reference.theta_i)};
    double c[5][5], variance = 0;
    gonio_alignment_covariance(&facts->alignment, pair, &reference, c);
    for (int i = 0; i < 5; i++) {
        for (int j = 0; j < 5; j++) {
            variance += slope[i] * c[i][j] * slope[j];
        }
    }
    return fmax(variance, 0);
}

slope_terms gonio_slope_terms_of(const gonio_rig_facts *facts, const gonio_model *model, int channel,
                                 const gonio_pair *pair, double measured) {
    const double value = model_at(model, pair, channel);
    const double floor = fmax(value, VALUE_MIN);
    const double random = square(gonio_radians(facts->pointing_random_deg));
    const double systematic = facts->alignment.known ? square(facts->alignment.sigma_rad)
                                                     : square(gonio_radians(facts->pointing_systematic_deg));
    double d[4];
    gonio_model_gradient(model, pair, channel, d);
    for (int i = 0; i < 4; i++) {
        d[i] /= floor;
    }
    const double own = d[0] - tan(pair->theta_i),
                 with_reference = own + reference_slope(facts, gonio_radians(GONIO_REFERENCE_THETA_I_DEG));
    slope_terms terms = {.factor = 1};
    if (value > VALUE_MIN) {
        gonio_blur_correct(facts, model, channel, pair, value, measured, &terms);
    }
    if (facts->sphere) {
        const double s = sin(pair->theta_i), across = s > 1e-3 ? d[1] / s : d[0];
        terms.angle_random = 2 * random * (square(own) + square(across));
        terms.angle_systematic = 2 * systematic * (square(own) + square(across)) + systematic;
        return terms;
    }
    const double others = square(d[1]) + square(d[2]) + square(d[3]);
    terms.angle_random = random * (square(own) + others);
    terms.angle_systematic =
        facts->alignment.known ? alignment_variance(facts, pair, d) : systematic * (square(with_reference) + others);
    return terms;
}

gonio_status gonio_calib_pointing(const gonio_rig_facts *facts, const gonio_model *model, gonio_samples *samples,
                                  gonio_error *error) {
    if (samples->sigma_random == NULL) {
        return gonio_fail(error, GONIO_E_USAGE, "the samples carry no sigma");
    }
    if (model->channels != samples->channels) {
        return gonio_fail(error, GONIO_E_USAGE, "a model of %d channels for samples of %d", model->channels,
                          samples->channels);
    }
    const size_t c = (size_t)samples->channels;
    for (size_t i = 0; i < samples->n; i++) {
        for (size_t k = 0; k < c; k++) {
            const slope_terms s =
                gonio_slope_terms_of(facts, model, (int)k, &samples->pairs[i], samples->values[i * c + k]);
            const double value = fabs(samples->values[i * c + k]);
            samples->values[i * c + k] *= s.factor;
            double *random = &samples->sigma_random[i * c + k], *systematic = &samples->sigma_systematic[i * c + k];
            *random = s.factor * hypot(*random, value * sqrt(s.angle_random));
            *systematic = s.factor * hypot(*systematic, value * sqrt(s.angle_systematic + s.area + s.blur));
        }
    }
    return GONIO_OK;
}
