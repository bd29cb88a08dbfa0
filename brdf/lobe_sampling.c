// SPDX-License-Identifier: BSD-3-Clause
// Mixtures of lobes. A lobe draws a facet's normal n that is visible from wi and mirrors wi about it; its density is
//   D(n) G1(wi) / (4 cos_i),
// with Smith's G1 for GGX (Heitz, "Sampling the GGX distribution of visible normals", 2018; drawn as in Dupuy and
// Benyoub, "Sampling visible GGX normals with spherical caps", 2023) and V-cavities' G1 = min(1, 2 n_z cos_i / (wi.n))
// for the others (Heitz and d'Eon, "Importance sampling microfacet-based BSDFs using the distribution of visible
// normals", 2014), whose shadowing is that of Torrance and Sparrow.
//
// What a facet mirrors below the surface is turned up about it, (x, y, z) -> (x, y, -z), and its density added to what
// the lobe has there: so the density over the upper hemisphere integrates to 1, and no sample is lost.
#include "brdf/lobe_sampling.h"

#include <math.h>
#include <stddef.h>

#include "brdf/analytic/formula.h"

#define COSINE_SHARE 1e-3 // of the cosine that is always in the mixture
#define ONE (1 - 0x1p-53) // the largest number below 1

// ---- distributions of normals ----

static double distribution(const gonio_proposal *p, gonio_vec3 n) {
    if (p->shape == GONIO_PROPOSE_POWER) {
        // cos^n from tan^2: for a large exponent the cosine itself is 1 minus rounding.
        const double tan2 = (n.x * n.x + n.y * n.y) / (n.z * n.z);
        return (p->alpha_x + 2) / (2 * GONIO_PI) * exp(-0.5 * p->alpha_x * log1p(tan2));
    }
    const double x = n.x / p->alpha_x, y = n.y / p->alpha_y, z2 = n.z * n.z;
    const double per_area = 1 / (GONIO_PI * p->alpha_x * p->alpha_y);
    if (p->shape == GONIO_PROPOSE_GGX) {
        return per_area / gonio_square(x * x + y * y + z2);
    }
    return per_area * exp(-(x * x + y * y) / z2) / (z2 * z2);
}

// Does what mirrors wi into wo, wherever wo points, face up? Its normal and the cosine between it and wi.
static bool facet(gonio_vec3 wi, double x, double y, double z, gonio_vec3 *n, double *cos_d) {
    const gonio_vec3 sum = {wi.x + x, wi.y + y, wi.z + z};
    const double length = sqrt(sum.x * sum.x + sum.y * sum.y + sum.z * sum.z);
    if (!(sum.z > 0)) {
        return false;
    }
    *n = (gonio_vec3){sum.x / length, sum.y / length, sum.z / length};
    *cos_d = length / 2;
    return true;
}

// Density of wo = (x, y, z) over the whole sphere.
static double lobe_density(const gonio_proposal *p, gonio_vec3 wi, double x, double y, double z) {
    gonio_vec3 n;
    double cos_d;
    if (!facet(wi, x, y, z, &n, &cos_d)) {
        return 0;
    }
    if (p->shape == GONIO_PROPOSE_GGX) { // G1 / (2 cos_i), finite at the horizon
        return distribution(p, n) * 0.5 /
               (wi.z + sqrt(wi.z * wi.z + gonio_square(p->alpha_x * wi.x) + gonio_square(p->alpha_y * wi.y)));
    }
    return distribution(p, n) * fmin(1, 2 * n.z * wi.z / cos_d) / (4 * wi.z);
}

static double density(const gonio_proposal *p, gonio_vec3 wi, gonio_vec3 wo) {
    if (p->shape == GONIO_PROPOSE_COSINE) {
        return wo.z / GONIO_PI;
    }
    return lobe_density(p, wi, wo.x, wo.y, wo.z) + lobe_density(p, wi, wo.x, wo.y, -wo.z);
}

// ---- drawing ----

static gonio_vec3 unit(double x, double y, double z) {
    const double length = sqrt(x * x + y * y + z * z);
    return (gonio_vec3){x / length, y / length, z / length};
}

static gonio_vec3 draw_cosine(const double u[2]) {
    const double r = sqrt(u[0]), phi = 2 * GONIO_PI * u[1];
    return (gonio_vec3){r * cos(phi), r * sin(phi), sqrt(1 - u[0])};
}

static gonio_vec3 draw_ggx(const gonio_proposal *p, gonio_vec3 wi, const double u[2]) {
    const gonio_vec3 w = unit(p->alpha_x * wi.x, p->alpha_y * wi.y, wi.z);
    const double phi = 2 * GONIO_PI * u[0], z = (1 - u[1]) * (1 + w.z) - w.z, s = sqrt(fmax(0, 1 - z * z));
    return unit(p->alpha_x * (s * cos(phi) + w.x), p->alpha_y * (s * sin(phi) + w.y), fmax(z + w.z, 0x1p-60));
}

// The turn d from wi's azimuth, in [0, pi], at which a share u of the visible facets of one slope lies nearer to it.
// The share of a cavity's two sides, at d and pi - d, that wi sees of this one is (1 + k cos d) / 2, held within 0 and
// 1; its integral from 0 to d is to be u pi / 2. Newton's method, from the solution for a line in place of the cosine.
static double visible_turn(double k, double u) {
    const double target = u * (GONIO_PI / 2);
    const double beta = k > 1 ? asin(1 / k) : GONIO_PI / (2 * fmax(k, 1e-9)), first = fmax(GONIO_PI / 2 - beta, 0);
    if (target <= first) {
        return target;
    }
    const double rest = target - first, top = fmin(0.5 * (1 + k), 1), last = GONIO_PI - first;
    const double sine_first = k > 1 ? sqrt(1 - 1 / (k * k)) : 0;
    double d = first + 2 * rest / (top + sqrt(fmax(top * top - rest / beta, 0)));
    for (int i = 0; i < 4; i++) {
        const double value = 0.5 * (d - first + k * (sin(d) - sine_first)) - rest;
        const double slope = 0.5 * (1 + k * cos(d)), step = value / fmax(slope, 1e-6);
        d = fmin(fmax(d - step, first), last);
        if (fabs(step) < 1e-5) { // its square is what is left
            break;
        }
    }
    return d;
}

// A normal of density D n_z, of its cavity's two sides the one that wi sees.
static gonio_vec3 draw_cavity(const gonio_proposal *p, gonio_vec3 wi, const double u[2]) {
    // The slope's length from u[0]: 1 - exp(-t^2) of Beckmann, 1 - (1 + t^2)^(-n / 2 - 1) of a power.
    const double log_rest = log1p(-u[0]);
    const bool power = p->shape == GONIO_PROPOSE_POWER;
    const double slope = sqrt(power ? expm1(-2 * log_rest / (p->alpha_x + 2)) : -log_rest);
    const double ax = power ? 1 : p->alpha_x, ay = power ? 1 : p->alpha_y;
    const double x = ax * wi.x, y = ay * wi.y, toward = hypot(x, y);
    const double side = u[1] < 0.5 ? 2 * u[1] : 2 * u[1] - 1;
    const double d = visible_turn(fmin(slope * toward / wi.z, 1e9), side), turn = u[1] < 0.5 ? d : -d;
    const double c = slope * cos(turn), s = slope * sin(turn);
    const double cx = toward > 0 ? x / toward : 1, sx = toward > 0 ? y / toward : 0;
    return unit(ax * (c * cx - s * sx), ay * (c * sx + s * cx), 1);
}

static gonio_vec3 draw(const gonio_proposal *p, gonio_vec3 wi, const double u[2]) {
    if (p->shape == GONIO_PROPOSE_COSINE) {
        return draw_cosine(u);
    }
    const gonio_vec3 n = p->shape == GONIO_PROPOSE_GGX ? draw_ggx(p, wi, u) : draw_cavity(p, wi, u);
    const double dot = 2 * (wi.x * n.x + wi.y * n.y + wi.z * n.z);
    const gonio_vec3 wo = unit(dot * n.x - wi.x, dot * n.y - wi.y, dot * n.z - wi.z);
    return (gonio_vec3){wo.x, wo.y, fabs(wo.z)};
}

// ---- mixtures ----

int gonio_proposals_standard(gonio_proposal *out) {
    out[0] = (gonio_proposal){.shape = GONIO_PROPOSE_COSINE, .strength = 0.5, .f0 = 1};
    out[1] = (gonio_proposal){GONIO_PROPOSE_GGX, 0.3, 0.3, .strength = 0.5, .f0 = 1};
    return 2;
}

// The weights of the proposals, and last that of the cosine that is always there; they sum to 1.
static void weigh(const gonio_proposal *proposals, int n, double cos_i, double *weights) {
    const double gap = 1 - cos_i, rest = gap * gap * gap * gap * gap; // Schlick's
    double total = 0;
    for (int k = 0; k < n; k++) {
        weights[k] = fmax(proposals[k].strength, 0) * (proposals[k].f0 + (1 - proposals[k].f0) * rest);
        total += weights[k];
    }
    for (int k = 0; k < n; k++) {
        weights[k] *= total > 0 ? (1 - COSINE_SHARE) / total : 0;
    }
    weights[n] = total > 0 ? COSINE_SHARE : 1;
}

static gonio_vec3 raised(gonio_vec3 w) { return (gonio_vec3){w.x, w.y, fmax(w.z, GONIO_LOBE_COSINE_MIN)}; }

static double mixture(const gonio_proposal *proposals, int n, const double *weights, gonio_vec3 wi, gonio_vec3 wo) {
    double pdf = weights[n] * wo.z / GONIO_PI;
    for (int k = 0; k < n; k++) {
        pdf += weights[k] > 0 ? weights[k] * density(&proposals[k], wi, wo) : 0;
    }
    return pdf;
}

double gonio_proposals_sample(const gonio_proposal *proposals, int n, gonio_vec3 wi, const double u[2],
                              gonio_vec3 *wo) {
    double weights[GONIO_PROPOSALS_MAX + 1];
    wi = raised(wi);
    weigh(proposals, n, wi.z, weights);
    // The first number chooses the proposal, and what it leaves is uniform again.
    double v[2] = {u[0], u[1]};
    int k = 0;
    while (k < n && v[0] >= weights[k]) {
        v[0] -= weights[k++];
    }
    v[0] = fmin(v[0] / weights[k], ONE);
    *wo = k < n ? draw(&proposals[k], wi, v) : draw_cosine(v);
    wo->z = fmax(wo->z, 0x1p-60);
    return mixture(proposals, n, weights, wi, *wo);
}

double gonio_proposals_pdf(const gonio_proposal *proposals, int n, gonio_vec3 wi, gonio_vec3 wo) {
    double weights[GONIO_PROPOSALS_MAX + 1];
    wi = raised(wi);
    weigh(proposals, n, wi.z, weights);
    return mixture(proposals, n, weights, wi, wo);
}
