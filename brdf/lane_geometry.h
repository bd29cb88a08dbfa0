// SPDX-License-Identifier: BSD-3-Clause
// Four direction pairs at a time: the coordinates of brdf/coordinates.c and the lobes of brdf/analytic/, which
// explain the formulae; here each is written for vectors, with the functions of brdf/exp_log.h. The operations up to
// the half and the difference vector are those of brdf/coordinates.c one by one, so that pairs at which the azimuth of
// one of them is rounding alone (retro-reflection) get the coordinates that the fit gave them.
#ifndef GONIO_BRDF_LANE_GEOMETRY_H
#define GONIO_BRDF_LANE_GEOMETRY_H

#include <stddef.h>

#include "brdf/exp_log.h"
#include "brdf/kind/analytic.h"
#include "gonio/direction.h"

#define GONIO_LANES 4
#define GONIO_LANES_MAX 8

_Static_assert(GONIO_COORDINATES == 5, "a new coordinate system needs its form for vectors here");

// x, y, z of four incident and of four outgoing directions.
typedef struct gonio_pairs4 {
    gonio_d4 i[3], o[3];
} gonio_pairs4;

// 1 to 4 pairs; lanes beyond them repeat the last.
GONIO_INLINE void gonio_pairs4_set(gonio_pairs4 *p, size_t count, const gonio_vec3 *wi, const gonio_vec3 *wo) {
    const size_t b = count > 1, c = count > 2 ? 2 : b, d = count > 3 ? 3 : c;
    *p = (gonio_pairs4){.i = {{wi[0].x, wi[b].x, wi[c].x, wi[d].x},
                              {wi[0].y, wi[b].y, wi[c].y, wi[d].y},
                              {wi[0].z, wi[b].z, wi[c].z, wi[d].z}},
                        .o = {{wo[0].x, wo[b].x, wo[c].x, wo[d].x},
                              {wo[0].y, wo[b].y, wo[c].y, wo[d].y},
                              {wo[0].z, wo[b].z, wo[c].z, wo[d].z}}};
}

// How pairs are located: a system and its constants, kept by a model.
typedef struct gonio_locator {
    gonio_coordinates system;
    int dims;
    double per_stretch, limit;       // of the system: the inverse of its stretch, and its limit
    double per_narrow, narrow_limit; // of half-vector-narrow, the profile's
} gonio_locator;

static inline gonio_locator gonio_locator_of(gonio_coordinates system, int dims) {
    gonio_locator l = {.system = system, .dims = dims};
    double stretch, narrow;
    gonio_coordinates_stretch(system, &stretch, &l.limit);
    gonio_coordinates_stretch(GONIO_HALF_VECTOR_NARROW, &narrow, &l.narrow_limit);
    l.per_stretch = 1 / stretch;
    l.per_narrow = 1 / narrow;
    return l;
}

GONIO_INLINE void gonio_unit4(gonio_d4 *x) {
    *x = GONIO_MAX4(*x, GONIO_ALL4(0.0));
    *x = GONIO_MIN4(*x, GONIO_ALL4(1.0));
}

GONIO_INLINE void gonio_norm4(const gonio_d4 *x, const gonio_d4 *y, gonio_d4 *norm) {
    *norm = *x * *x + *y * *y;
    gonio_sqrt4(norm);
}

// Unit half vectors and the sines of their tilt.
typedef struct gonio_halves4 {
    gonio_d4 h[3], sin_h, length; // length: |wi + wo|
} gonio_halves4;

#define GONIO_TAN_H_MAX 20.0 // brdf/coordinates.c: the radius is held there

GONIO_INLINE void gonio_halves4_of(const gonio_pairs4 *p, gonio_halves4 *v) {
    const gonio_d4 sum[3] = {p->i[0] + p->o[0], p->i[1] + p->o[1], p->i[2] + p->o[2]}, zero = {0};
    gonio_d4 length = sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2];
    gonio_sqrt4(&length);
    const gonio_l4 proper = length > 1e-12;
    v->h[0] = GONIO_SELECT4(proper, sum[0] / length, zero);
    v->h[1] = GONIO_SELECT4(proper, sum[1] / length, zero);
    v->h[2] = GONIO_SELECT4(proper, sum[2] / length, zero + 1);
    v->length = length;
    gonio_norm4(&v->h[0], &v->h[1], &v->sin_h);
}

// length -> asinh(length per_stretch), at most limit.
GONIO_INLINE void gonio_radius4(gonio_d4 *length, double per_stretch, double limit) {
    *length *= per_stretch;
    gonio_asinh4(length);
    *length = GONIO_MIN4(*length, GONIO_ALL4(limit));
}

// The profile's radius beside the system's; one pair in all lanes needs a single asinh for both.
GONIO_INLINE void gonio_radii4(const gonio_locator *l, bool one_pair, gonio_d4 *radius, gonio_d4 *narrow) {
    if (one_pair) {
        const double a = l->per_stretch, b = l->per_narrow;
        gonio_d4 both = *radius * (gonio_d4){a, a, b, b};
        gonio_asinh4(&both);
        *radius = GONIO_ALL4(both[0]);
        *narrow = GONIO_ALL4(both[2]);
    } else {
        *narrow = *radius * l->per_narrow;
        gonio_asinh4(narrow);
        *radius *= l->per_stretch;
        gonio_asinh4(radius);
    }
    *radius = GONIO_MIN4(*radius, GONIO_ALL4(l->limit));
    *narrow = GONIO_MIN4(*narrow, GONIO_ALL4(l->narrow_limit));
}

GONIO_INLINE void gonio_locate4_half(const gonio_locator *l, const gonio_pairs4 *p, const gonio_halves4 *v,
                                     bool one_pair, gonio_d4 x[4], gonio_d4 *profile) {
    const gonio_d4 dot = p->i[0] * v->h[0] + p->i[1] * v->h[1], k = dot / (1 + v->h[2]),
                   most = GONIO_ALL4(GONIO_TAN_H_MAX);
    // The incident direction about the half vector.
    const gonio_d4 d[3] = {p->i[0] - v->h[0] * (p->i[2] + k), p->i[1] - v->h[1] * (p->i[2] + k),
                           dot + p->i[2] * v->h[2]};
    gonio_d4 scale = GONIO_SELECT4(v->h[2] > 0, v->sin_h / v->h[2], most), sin_d;
    scale = GONIO_MIN4(scale, most);
    if (profile != NULL) {
        gonio_radii4(l, one_pair, &scale, &profile[0]);
        profile[0] *= 1 / l->narrow_limit;
    } else {
        gonio_radius4(&scale, l->per_stretch, l->limit);
    }
    scale *= 0.5 / l->limit;
    if (l->dims == 4) {
        const gonio_d4 per = GONIO_SELECT4(v->sin_h > 0, scale / v->sin_h, GONIO_ALL4(0.0));
        x[0] = 0.5 + v->h[0] * per;
        x[1] = 0.5 + v->h[1] * per;
        x[2] = (d[0] + 1) * 0.5;
        x[3] = (d[1] + 1) * 0.5;
        return;
    }
    gonio_norm4(&d[0], &d[1], &sin_d);
    const gonio_d4 product = v->sin_h * sin_d, per = scale / product;
    const gonio_l4 proper = product > 0;
    const gonio_d4 along = (d[0] * v->h[0] + d[1] * v->h[1]) * per, across = (d[1] * v->h[0] - d[0] * v->h[1]) * per;
    x[0] = 0.5 + GONIO_SELECT4(proper, along, scale);
    x[1] = 0.5 + GONIO_SELECT4(proper, across, GONIO_ALL4(0.0));
    gonio_quarter_turns4(&sin_d, &d[2], &x[2]);
    if (profile != NULL) {
        profile[1] = x[2];
    }
}

// The outgoing direction's offset (u, v) from the mirror direction, stretched.
GONIO_INLINE void gonio_locate4_offset(const gonio_locator *l, const gonio_d4 *u, const gonio_d4 *v, gonio_d4 x[2]) {
    gonio_d4 length, radius;
    gonio_norm4(u, v, &length);
    radius = length;
    gonio_radius4(&radius, l->per_stretch, l->limit);
    const gonio_d4 scale = GONIO_SELECT4(length > 0, radius * (0.5 / l->limit) / length, GONIO_ALL4(0.0));
    x[0] = 0.5 + *u * scale;
    x[1] = 0.5 + *v * scale;
}

GONIO_INLINE void gonio_locate4_planar(const gonio_locator *l, const gonio_pairs4 *p, gonio_d4 x[4]) {
    gonio_d4 i[2] = {p->i[0], p->i[1]}, o[2] = {p->o[0], p->o[1]};
    const bool iso = l->dims == 3;
    if (iso) { // turned so that phi_i = 0
        gonio_d4 sin_i;
        gonio_norm4(&i[0], &i[1], &sin_i);
        const gonio_d4 c = GONIO_SELECT4(sin_i > 0, i[0] / sin_i, GONIO_ALL4(1.0));
        const gonio_d4 d = GONIO_SELECT4(sin_i > 0, i[1] / sin_i, GONIO_ALL4(0.0));
        o[0] = p->o[0] * c + p->o[1] * d;
        o[1] = p->o[1] * c - p->o[0] * d;
        i[0] = sin_i;
        i[1] = GONIO_ALL4(0.0);
    }
    x[0] = (i[0] + 1) * 0.5;
    x[1] = (i[1] + 1) * 0.5; // overwritten where there are three coordinates
    gonio_d4 *rest = x + (iso ? 1 : 2);
    if (l->system == GONIO_NUSSELT) {
        rest[0] = (o[0] + 1) * 0.5;
        rest[1] = (o[1] + 1) * 0.5;
    } else {
        const gonio_d4 u = o[0] + i[0], v = o[1] + i[1];
        gonio_locate4_offset(l, &u, &v, rest);
    }
}

// x[dims] in [0, 1] and, with half-vector systems of three coordinates, the profile's two (NULL: none).
GONIO_INLINE void gonio_locate4(const gonio_locator *l, const gonio_pairs4 *p, const gonio_halves4 *halves,
                                bool one_pair, gonio_d4 x[4], gonio_d4 *profile) {
    if (gonio_coordinates_are_half_vector(l->system)) {
        gonio_locate4_half(l, p, halves, one_pair, x, profile);
    } else {
        gonio_locate4_planar(l, p, x);
    }
    for (int d = 0; d < l->dims; d++) {
        gonio_unit4(&x[d]);
    }
}

// ---- lobes ----

// gonio_lobe_geometry of four pairs, as far as isotropic lobes need it.
typedef struct gonio_lobe_geometry4 {
    gonio_d4 cos_i, cos_o, sin2_i, sin2_o, sin2_h, cos_h, cos_d, tan2;
} gonio_lobe_geometry4;

GONIO_INLINE void gonio_lift4(gonio_d4 v[3], double cosine_min) {
    const gonio_l4 low = v[2] < cosine_min;
    gonio_d4 shrink = (1 - cosine_min * cosine_min) / (v[0] * v[0] + v[1] * v[1]);
    gonio_sqrt4(&shrink);
    v[0] = GONIO_SELECT4(low, v[0] * shrink, v[0]);
    v[1] = GONIO_SELECT4(low, v[1] * shrink, v[1]);
    v[2] = GONIO_SELECT4(low, GONIO_ALL4(cosine_min), v[2]);
    v[2] = GONIO_MAX4(v[2], GONIO_ALL4(GONIO_LOBE_COSINE_MIN));
}

// Both directions are raised to cosine_min along their azimuth first: lobes are held beyond the samples. Where none of
// the four is that low, the pairs' own half vectors (halves) serve.
GONIO_INLINE void gonio_lobe_geometry4_of(const gonio_pairs4 *pairs, const gonio_halves4 *halves, double cosine_min,
                                          gonio_lobe_geometry4 *g) {
    gonio_pairs4 p = *pairs;
    gonio_halves4 v = *halves;
    const double least = cosine_min > GONIO_LOBE_COSINE_MIN ? cosine_min : GONIO_LOBE_COSINE_MIN;
    const gonio_l4 low = (p.i[2] < least) | (p.o[2] < least);
    if ((low[0] | low[1] | low[2] | low[3]) != 0) {
        gonio_lift4(p.i, cosine_min);
        gonio_lift4(p.o, cosine_min);
        gonio_halves4_of(&p, &v);
    }
    g->cos_h = v.h[2];
    g->sin2_h = v.h[0] * v.h[0] + v.h[1] * v.h[1];
    g->tan2 = g->sin2_h / (v.h[2] * v.h[2]);
    v.length *= 0.5;
    g->cos_d = GONIO_MIN4(v.length, GONIO_ALL4(1.0));
    g->cos_i = p.i[2];
    g->cos_o = p.o[2];
    g->sin2_i = p.i[0] * p.i[0] + p.i[1] * p.i[1];
    g->sin2_o = p.o[0] * p.o[0] + p.o[1] * p.o[1];
}

GONIO_INLINE void gonio_fresnel4(const gonio_lobe_geometry4 *g, const gonio_d4 *f0, gonio_d4 *out) {
    const gonio_d4 p = 1 - g->cos_d, p2 = p * p;
    *out = *f0 + (1 - *f0) * (p2 * p2 * p);
}

// per_m2: 1 / m^2, lane by lane.
GONIO_INLINE void gonio_cook_torrance4(const gonio_lobe_geometry4 *g, const gonio_d4 *per_m2, const gonio_d4 *f0,
                                       gonio_d4 *out) {
    gonio_d4 d = -g->tan2 * *per_m2, fresnel;
    gonio_exp4(&d);
    const gonio_d4 lower = GONIO_MIN4(g->cos_i, g->cos_o), shadow = 2 * g->cos_h * lower;
    gonio_fresnel4(g, f0, &fresnel);
    // The shadow term min(1, shadow / cos_d) and the division by 4 cos_i cos_o as one quotient, the same for all lobes.
    const gonio_d4 top = GONIO_MIN4(g->cos_d, shadow), slope = 1 + g->tan2;
    const gonio_d4 common = slope * slope * top / (g->cos_d * (g->cos_i * g->cos_o));
    *out = d * (*per_m2 * (1 / (4 * GONIO_PI))) * fresnel * common;
}

GONIO_INLINE void gonio_ggx4(const gonio_lobe_geometry4 *g, const gonio_d4 *per_a2, const gonio_d4 *f0, gonio_d4 *out) {
    const gonio_d4 a2 = 1 / *per_a2;
    gonio_d4 root_i = g->cos_i * g->cos_i + a2 * g->sin2_i, root_o = g->cos_o * g->cos_o + a2 * g->sin2_o, fresnel;
    gonio_sqrt4(&root_i);
    gonio_sqrt4(&root_o);
    gonio_fresnel4(g, f0, &fresnel);
    const gonio_d4 q = g->sin2_h * *per_a2 + g->cos_h * g->cos_h;
    *out = fresnel * *per_a2 / (GONIO_PI * (q * q) * ((g->cos_i + root_i) * (g->cos_o + root_o)));
}

#endif
