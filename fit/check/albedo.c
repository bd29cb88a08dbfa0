// SPDX-License-Identifier: BSD-3-Clause
// The directional albedo by importance.
//
// It is an integral over a hemisphere that may hold a lobe of any width, so it is estimated with a mixture of
// densities: the cosine, and Beckmann half vectors of four widths a decade apart (multiple importance sampling with the
// balance heuristic; Veach & Guibas 1995), at the points of a rank-1 lattice, which makes it deterministic. A grid
// would miss a mirror's lobe or spend everything on it.
#include "fit/check/albedo.h"

#include <math.h>
#include <string.h>

#include "base/vector.h"

#define WIDTHS 4
static const double widths[WIDTHS] = {0.3, 0.05, 0.01, 0.002};

static double beckmann(double tan2, double cos_h, double m) {
    return exp(-tan2 / (m * m)) / (GONIO_PI * m * m * cos_h * cos_h * cos_h);
}

// The mixture's density at wo, per solid angle: half of it the cosine, the rest the four half-vector densities
// (D cos_h per half vector, 1 / (4 h.wo) for the change of variables).
static double density(gonio_vec3 wi, gonio_vec3 wo) {
    const gonio_vec3 sum = {wi.x + wo.x, wi.y + wo.y, wi.z + wo.z};
    const double length = sqrt(sum.x * sum.x + sum.y * sum.y + sum.z * sum.z);
    const double cos_h = sum.z / length, tan2 = (sum.x * sum.x + sum.y * sum.y) / (sum.z * sum.z);
    double lobes = 0;
    for (int k = 0; k < WIDTHS; k++) {
        lobes += beckmann(tan2, cos_h, widths[k]);
    }
    return 0.5 * wo.z / GONIO_PI + 0.5 * lobes / WIDTHS / (2 * length);
}

// The point (u, v) of the component k (-1: the cosine); false where it falls below the horizon.
static bool sampled(gonio_vec3 wi, int k, double u, double v, gonio_vec3 *wo) {
    const double phi = 2 * GONIO_PI * v;
    if (k < 0) {
        *wo = (gonio_vec3){sqrt(u) * cos(phi), sqrt(u) * sin(phi), sqrt(1 - u)};
        return wo->z > 0;
    }
    const double tan_h = widths[k] * sqrt(-log1p(-u)), cos_h = 1 / sqrt(1 + tan_h * tan_h), sin_h = tan_h * cos_h;
    const gonio_vec3 h = {sin_h * cos(phi), sin_h * sin(phi), cos_h};
    const double dot = 2 * (wi.x * h.x + wi.z * h.z);
    *wo = (gonio_vec3){dot * h.x - wi.x, dot * h.y, dot * h.z - wi.z};
    return wo->z > 0 && dot > 0;
}

static gonio_vec3 turned_about(gonio_vec3 v, double c, double s) {
    return (gonio_vec3){c * v.x - s * v.y, s * v.x + c * v.y, v.z};
}

void gonio_check_albedo_shares(const gonio_model *model, double theta_i_rad, double turn, int nodes, size_t knots,
                               double *shares) {
    const size_t channels = (size_t)model->channels;
    const gonio_vec3 wi = gonio_direction(theta_i_rad, 0);
    const double c = cos(turn), s = sin(turn);
    double values[GONIO_CHANNELS_MAX];
    for (int i = 0; i < nodes; i++) {
        // Of eight points in turn four go to the cosine and one to each width, as the mixture's weights say. The second
        // coordinate steps by the golden ratio within each component.
        const int component = i % 8 < 4 ? -1 : i % 8 - 4, at = component < 0 ? i / 8 * 4 + i % 8 : i / 8;
        const int count = component < 0 ? nodes / 2 : nodes / 8;
        gonio_vec3 wo;
        if (!sampled(wi, component, (at + 0.5) / count, fmod(at * 0.6180339887498949, 1), &wo)) {
            continue;
        }
        const double weight = wo.z / density(wi, wo) / nodes;
        const double x = knots > 1 ? gonio_direction_theta(wo) / (GONIO_PI / 2) * (double)(knots - 1) : 0;
        const size_t k = knots > 1 ? (size_t)fmin(x, (double)(knots - 2)) : 0;
        gonio_model_eval(model, turned_about(wi, c, s), turned_about(wo, c, s), values);
        for (size_t j = 0; j < channels; j++) {
            shares[j * knots + k] += values[j] * weight * (1 - (x - (double)k));
            if (knots > 1) {
                shares[j * knots + k + 1] += values[j] * weight * (x - (double)k);
            }
        }
    }
}

void gonio_check_albedo_nodes(const gonio_model *model, double theta_i_rad, int nodes, double *albedo) {
    memset(albedo, 0, (size_t)model->channels * sizeof *albedo);
    gonio_check_albedo_shares(model, theta_i_rad, 0, nodes, 1, albedo);
}

void gonio_check_albedo(const gonio_model *model, double theta_i_rad, double *albedo) {
    gonio_check_albedo_nodes(model, theta_i_rad, 16384, albedo);
}

// ---- the nine reflectances ----

// The point (u, v) of a solid angle, evenly by projected solid angle: a direction, a cone about it, the hemisphere.
// False: below the horizon.
static bool within(int kind, gonio_vec3 axis, double cone, double u, double v, gonio_vec3 *d) {
    if (kind == 0) {
        *d = axis;
        return true;
    }
    const double phi = 2 * GONIO_PI * v;
    if (kind == 2) {
        *d = (gonio_vec3){sqrt(u) * cos(phi), sqrt(u) * sin(phi), sqrt(1 - u)};
        return true;
    }
    const double z = 1 - u * (1 - cos(cone)), r = sqrt(1 - z * z);
    const gonio_vec3 side = normalised(cross(fabs(axis.z) < 0.9 ? (gonio_vec3){0, 0, 1} : (gonio_vec3){1, 0, 0}, axis));
    const gonio_vec3 other = cross(axis, side);
    *d = sum(scaled(axis, z), sum(scaled(side, r * cos(phi)), scaled(other, r * sin(phi))));
    return d->z > 0;
}

// Mean of f over both solid angles by projected solid angle, times that of the reflected one.
static double reflectance(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double cone, int in, int out) {
    enum { NODES = 8192 };
    double values[GONIO_CHANNELS_MAX], total = 0, weight = 0, area = 0;
    for (int k = 0; k < NODES; k++) {
        // A rank-1 lattice in four dimensions: Roberts' generalised golden ratio, the root of x^5 = x + 1.
        static const double step[4] = {0.8566748838545029, 0.7338918566271260, 0.6287067210378087, 0.5385972572236101};
        double u[4];
        for (int d = 0; d < 4; d++) {
            u[d] = fmod(0.5 + step[d] * (k + 1), 1);
        }
        gonio_vec3 i, o;
        const bool lit = within(in, wi, cone, u[0], u[1], &i), seen = within(out, wo, cone, u[2], u[3], &o);
        const double wo_weight = out == 1 ? o.z : 1, wi_weight = in == 1 ? i.z : 1;
        area += seen && out == 1 ? o.z : 0;
        weight += lit && seen ? wi_weight * wo_weight : 0;
        if (lit && seen) {
            gonio_model_eval(model, i, o, values);
            for (int c = 0; c < model->channels; c++) {
                total += wi_weight * wo_weight * values[c] / model->channels;
            }
        }
    }
    const double omega = out == 1 ? 2 * GONIO_PI * (1 - cos(cone)) * area / NODES : GONIO_PI;
    return weight > 0 ? total / weight * omega : 0;
}

void gonio_check_reflectances(const gonio_model *model, const gonio_pair *pair, double cone_rad, double out[3][3]) {
    const gonio_vec3 wi = gonio_direction(pair->theta_i, pair->phi_i), wo = gonio_direction(pair->theta_o, pair->phi_o);
    for (int i = 0; i < 3; i++) {
        for (int o = 0; o < 3; o++) {
            out[i][o] = reflectance(model, wi, wo, cone_rad, i, o);
        }
    }
}
