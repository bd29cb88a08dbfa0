// The angle and area terms, from the slope and curvature of a model that was fitted to the samples.
//
// A plate. The sample is stated at the nominal angles, but light and camera stood at the true ones. What was measured
// is f(true) cos(theta_i true) / cos(theta_i nominal), since the irradiance is assumed from the nominal angle; so an
// error of theta_i acts through d ln(f cos theta_i) / d theta_i = d ln f / d theta_i - tan theta_i, the others through
// d ln f. The white reference was lit at 45 deg through the same axis with the same zero error, which scaled every
// sample by cos 45 / cos(45 + error): + tan 45 for the systematic part of theta_i.
//
// A sphere about the centre of rotation looks the same to the camera wherever that stands; only the light's direction
// relative to the camera matters, in which both arms' errors meet: a tangential error of the light, in both directions
// (at most, where the axes cross at right angles), each of sqrt(2) times one axis' uncertainty.
//
// Area: the mean over the averaged disc, every point with its own directions, differs from the value at the centre by
// the BRDF's curvature. The model, averaged likewise, tells by how much. Up to AREA_CORRECTED the value is corrected
// for it, with half the correction as its uncertainty (a fitted model's curvature is no better known); a larger
// difference means that the model does not resolve the lobe, so the value is left alone and the whole difference is its
// uncertainty.
#include "calib/internal.h"

#include <math.h>

#define AREA_CORRECTED 0.05

// A gradient needs a positive value to be relative to; below this share of a white plate it says nothing.
#define VALUE_MIN (1e-6 / GONIO_PI)

static double square(double x) { return x * x; }

static double model_at(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, int channel) {
    wi.z = fmax(wi.z, 0);
    wo.z = fmax(wo.z, 0);
    return gonio_model_eval_channel(model, wi, wo, channel);
}

static gonio_vec3 direction_from(gonio_vec3 from, double x, double y) {
    const gonio_vec3 d = {from.x - x, from.y - y, from.z};
    const double length = sqrt(d.x * d.x + d.y * d.y + d.z * d.z);
    return (gonio_vec3){d.x / length, d.y / length, d.z / length};
}

// Mean of the model over the disc relative to its centre, minus 1. Seven points of equal weight, at the centre and on a
// circle of radius sqrt(7/12) R about it, have the disc's second moments, which is all that curvature sees.
static double area_bias(const gonio_rig_facts *facts, const gonio_model *model, int channel, const gonio_pair *pair,
                        double centre) {
    const geometry g = geometry_of_pose(facts, pair);
    const double ring = sqrt(7.0 / 12) * facts->region_radius_mm;
    double sum = centre;
    for (int k = 0; k < 6; k++) {
        const double x = ring * cos(k * GONIO_PI / 3), y = ring * sin(k * GONIO_PI / 3);
        sum += model_at(model, direction_from(g.light, x, y), direction_from(g.camera, x, y), channel);
    }
    return sum / 7 / centre - 1;
}

slope_terms slope_terms_of(const gonio_rig_facts *facts, const gonio_model *model, int channel,
                           const gonio_pair *pair) {
    const double value = model_at(model, gonio_direction(pair->theta_i, pair->phi_i),
                                  gonio_direction(pair->theta_o, pair->phi_o), channel);
    const double floor = fmax(value, VALUE_MIN);
    const double random = square(gonio_radians(facts->pointing_random_deg));
    const double systematic = square(gonio_radians(facts->pointing_systematic_deg));
    double d[4];
    gonio_model_gradient(model, pair, channel, d);
    for (int i = 0; i < 4; i++) {
        d[i] /= floor;
    }
    const double own = d[0] - tan(pair->theta_i),
                 with_reference = own + tan(gonio_radians(GONIO_REFERENCE_THETA_I_DEG));
    slope_terms terms = {.factor = 1};
    if (facts->sphere) {
        const double s = sin(pair->theta_i), across = s > 1e-3 ? d[1] / s : d[0];
        terms.angle_random = 2 * random * (square(own) + square(across));
        terms.angle_systematic = 2 * systematic * (square(own) + square(across)) + systematic;
        return terms;
    }
    const double others = square(d[1]) + square(d[2]) + square(d[3]);
    terms.angle_random = random * (square(own) + others);
    terms.angle_systematic = systematic * (square(with_reference) + others);
    if (facts->region_radius_mm > 0 && value > VALUE_MIN) {
        const double bias = area_bias(facts, model, channel, pair, value);
        const bool corrected = fabs(bias) <= AREA_CORRECTED;
        terms.factor = corrected ? 1 / (1 + bias) : 1;
        terms.area = square(corrected ? bias / 4 : bias);
    }
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
            const slope_terms s = slope_terms_of(facts, model, (int)k, &samples->pairs[i]);
            const double value = fabs(samples->values[i * c + k]);
            samples->values[i * c + k] *= s.factor;
            double *random = &samples->sigma_random[i * c + k], *systematic = &samples->sigma_systematic[i * c + k];
            *random = s.factor * hypot(*random, value * sqrt(s.angle_random));
            *systematic = s.factor * hypot(*systematic, value * sqrt(s.angle_systematic + s.area));
        }
    }
    return GONIO_OK;
}
