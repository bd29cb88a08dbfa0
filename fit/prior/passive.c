// SPDX-License-Identifier: BSD-3-Clause
// Albedos by importance sampling: a mixture of the cosine and of two lobes about the mirror direction, each a
// distribution of half vectors as wide as broad and as narrow lobes are (Walter et al., "Microfacet models for
// refraction through rough surfaces", 2007, eqs. 33 and 38), so that no ray of a narrow lobe counts for much.
#include "fit/prior/passive.h"

#include <math.h>

#include "base/order_statistic.h"

#define RAYS_PRIOR 192
#define RAYS_MODEL 768

static const double squares[] = {0.0625, 0.0009}; // of the slopes

// Of half vectors, as a density of outgoing directions.
static double lobe_density(double square, double cos_h, double cos_d) {
    const double z2 = cos_h * cos_h, q = z2 + (1 - z2) / square;
    return cos_h / (GONIO_PI * square * q * q) / (4 * cos_d);
}

// The k-th of n directions, whose density is *density; below the horizon there is no light.
static gonio_vec3 ray(gonio_vec3 wi, int k, int n, double *density) {
    const double u = (k / 4 + 0.5) / (n / 4), phi = 2 * GONIO_PI * fmod(0.6180339887498949 * k, 1);
    gonio_vec3 o = gonio_direction(asin(sqrt(k % 2 == 0 ? (k / 2 + 0.5) / (n / 2) : u)), phi);
    if (k % 2 == 1) {
        const gonio_vec3 h = gonio_direction(atan(sqrt(squares[k / 2 % 2] * u / (1 - u))), phi);
        const double twice = 2 * (wi.x * h.x + wi.y * h.y + wi.z * h.z);
        o = (gonio_vec3){twice * h.x - wi.x, twice * h.y - wi.y, twice * h.z - wi.z};
    }
    const gonio_vec3 sum = {wi.x + o.x, wi.y + o.y, wi.z + o.z};
    const double length = sqrt(sum.x * sum.x + sum.y * sum.y + sum.z * sum.z);
    *density = 0.5 * fmax(o.z, 0) / GONIO_PI;
    for (int j = 0; j < 2; j++) {
        *density += 0.25 * lobe_density(squares[j], sum.z / length, length / 2);
    }
    return o;
}

static double incidence(int k) { return GONIO_PI / 2 * (0.05 + 0.9 * k / (GONIO_PASSIVE_INCIDENCES - 1)); }

void gonio_passive_factors(gonio_prior *p, double supported, double factor[GONIO_PASSIVE_INCIDENCES]) {
    double out[GONIO_PRIOR_MATERIALS], colour[GONIO_CHANNELS_MAX];
    for (int t = 0; t < GONIO_PASSIVE_INCIDENCES; t++) {
        double told[GONIO_CHANNELS_MAX] = {0}, open[GONIO_CHANNELS_MAX] = {0};
        const gonio_vec3 wi = gonio_direction(incidence(t), 0);
        for (int k = 0; k < RAYS_PRIOR; k++) {
            double density;
            const gonio_vec3 wo = ray(wi, k, RAYS_PRIOR, &density);
            if (wo.z > 0) {
                const gonio_pair pair = gonio_pair_from_vectors(wi, wo);
                double *part = gonio_prior_at(p, &pair, out, colour) >= supported ? told : open;
                const double middle = gonio_order_statistic(out, GONIO_PRIOR_MATERIALS, GONIO_PRIOR_MATERIALS / 2);
                for (int c = 0; c < p->data.channels; c++) {
                    part[c] += p->data.transforms[c].scale * exp(middle + colour[c]) * wo.z / density / RAYS_PRIOR;
                }
            }
        }
        factor[t] = 1;
        for (int c = 0; c < p->data.channels; c++) {
            factor[t] = told[c] < 1 && told[c] + open[c] > 1 ? fmin(factor[t], (1 - told[c]) / open[c]) : factor[t];
        }
    }
}

static double factor_at(const double factor[GONIO_PASSIVE_INCIDENCES], double theta) {
    const int last = GONIO_PASSIVE_INCIDENCES - 1;
    const double at = fmin(fmax((theta / (GONIO_PI / 2) - 0.05) / 0.9 * last, 0), last);
    const int k = (int)fmin(at, last - 1);
    return factor[k] + (at - k) * (factor[k + 1] - factor[k]);
}

double gonio_passive_factor(const double factor[GONIO_PASSIVE_INCIDENCES], const gonio_pair *pair) {
    return fmin(factor_at(factor, pair->theta_i), factor_at(factor, pair->theta_o));
}

double gonio_passive_albedo(const gonio_model *model, double theta_i) {
    double albedo[GONIO_CHANNELS_MAX] = {0}, value[GONIO_CHANNELS_MAX], most = 0;
    const gonio_vec3 wi = gonio_direction(theta_i, 0);
    for (int k = 0; k < RAYS_MODEL; k++) {
        double density;
        const gonio_vec3 wo = ray(wi, k, RAYS_MODEL, &density);
        if (wo.z > 0) {
            gonio_model_eval(model, wi, wo, value);
            for (int c = 0; c < model->channels; c++) {
                albedo[c] += value[c] * wo.z / density / RAYS_MODEL;
            }
        }
    }
    for (int c = 0; c < model->channels; c++) {
        most = fmax(most, albedo[c]);
    }
    return most;
}
