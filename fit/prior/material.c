// SPDX-License-Identifier: BSD-3-Clause
// Places of the unit cube -> materials. Ranges are those of the analytic fits to measured materials that are published:
// widths of 0.02 to 0.7 (Ngan, Durand and Matusik, "Experimental analysis of BRDF models", 2005), reflectances at
// normal incidence of 0.02 to 0.1 for dielectrics and to 1 for metals, facets of diffuse surfaces to 40 deg (Oren and
// Nayar 1994).
#include "fit/prior/material.h"

#include <math.h>
#include <string.h>

enum { SLOPE, LOBES, FIRST, SECOND = FIRST + 4, RATIO = SECOND + 4, TURN };
enum { FAMILY, WIDTH, FRESNEL, STRENGTH };
_Static_assert(TURN + 1 == GONIO_MATERIAL_DIMS, "a number a dimension");

enum { GGX, COOK_TORRANCE, WARD, BLINN_PHONG, FAMILIES };

static double between(double u, double low, double high) { return low * exp(u * log(high / low)); }

// Dielectrics are the most, then metals; a part has no Fresnel term at all, as paints with a rough coat seem to.
static double fresnel_of(double u) {
    return u < 0.6 ? between(u / 0.6, 0.02, 0.1) : u < 0.85 ? between((u - 0.6) / 0.25, 0.1, 1) : 1;
}

void gonio_material_of(const double place[GONIO_MATERIAL_DIMS], bool isotropic, gonio_material *out) {
    memcpy(out->place, place, sizeof out->place);
    const double u = place[LOBES];
    out->lobes = u < 0.15 ? 0 : u < 0.65 ? 1 : 2;
    out->slope = fmax(place[SLOPE] - 0.5, 0) * 1.4;
    const double ratio = isotropic || place[RATIO] < 0.4 ? 1 : between((place[RATIO] - 0.4) / 0.6, 1, 3);
    for (int j = 0; j < 2; j++) {
        const double *p = place + (j == 0 ? FIRST : SECOND);
        // The second lobe is the broader one.
        const double alpha =
            j == 0 ? between(p[WIDTH], 0.02, 0.7) : fmin(out->lobe[0].alpha[0] * between(p[WIDTH], 1.3, 8), 0.9);
        out->lobe[j].family = (int)fmin(p[FAMILY] * FAMILIES, FAMILIES - 1);
        out->lobe[j].alpha[0] = alpha * sqrt(ratio);
        out->lobe[j].alpha[1] = alpha / sqrt(ratio);
        out->lobe[j].f0 = fresnel_of(p[FRESNEL]);
        out->lobe[j].strength = between(p[STRENGTH], 0.01, 30);
    }
    out->turn[0] = cos(GONIO_PI * place[TURN]);
    out->turn[1] = sin(GONIO_PI * place[TURN]);
}

static gonio_vec3 turned(gonio_vec3 v, const double turn[2]) {
    return (gonio_vec3){v.x * turn[0] + v.y * turn[1], v.y * turn[0] - v.x * turn[1], v.z};
}

// Of the family's own normalisation: about 1 of the light at normal incidence.
static double unit_lobe(int family, const double alpha[2], const gonio_lobe_geometry *g) {
    const double a = sqrt(alpha[0] * alpha[1]);
    switch (family) {
    case GGX:
        return gonio_lobe_ggx(g, alpha[0], alpha[1], 1);
    case COOK_TORRANCE:
        return gonio_lobe_cook_torrance(g, a, 1);
    case WARD:
        return exp(-gonio_square(g->tan_x / alpha[0]) - gonio_square(g->tan_y / alpha[1])) /
               (4 * GONIO_PI * a * a * sqrt(g->wi.z * g->wo.z));
    default:
        break;
    }
    const double n = 2 / (a * a);
    return (n + 2) / (8 * GONIO_PI) * exp(-0.5 * n * log1p(g->tan2));
}

double gonio_material_ln(const gonio_material *m, const gonio_lobe_geometry *geometry) {
    gonio_lobe_geometry g = *geometry;
    const double s2 = m->slope * m->slope;
    const double dot = fmax(g.wi.x * g.wo.x + g.wi.y * g.wo.y, 0) / fmax(g.wi.z, g.wo.z);
    double sum = (1 - 0.5 * s2 / (s2 + 0.33) + 0.45 * s2 / (s2 + 0.09) * dot) / GONIO_PI;
    if (m->lobe[0].alpha[0] != m->lobe[0].alpha[1]) {
        const gonio_vec3 tan = turned((gonio_vec3){g.tan_x, g.tan_y, 0}, m->turn);
        g.wi = turned(g.wi, m->turn);
        g.wo = turned(g.wo, m->turn);
        g.h = turned(g.h, m->turn);
        g.tan_x = tan.x;
        g.tan_y = tan.y;
    }
    for (int j = 0; j < m->lobes; j++) {
        const double f0 = m->lobe[j].f0;
        sum += m->lobe[j].strength * unit_lobe(m->lobe[j].family, m->lobe[j].alpha, &g) *
               (gonio_fresnel_schlick(g.cos_d, f0) / f0);
    }
    return log(sum);
}
