// SPDX-License-Identifier: BSD-3-Clause
// The exact gradient of the kind "lobe-spline" by (theta_i, phi_i, theta_o, phi_o): the formulae of
// brdf/kind/lobe_spline_eval.c in numbers that carry their derivatives (brdf/dual.h). Where a bound holds a number, its
// derivatives are 0; where the azimuth about the half vector is undefined (retro-reflection), so are the derivatives of
// it.
#include <math.h>

#include "brdf/dual.h"
#include "brdf/kind/lobe_spline_model.h"

typedef gonio_dual dual;

typedef struct direction {
    dual x, y, z;
} direction;

static direction direction_of(double theta, double phi, int k) {
    const dual t = gonio_dual_variable(theta, k), p = gonio_dual_variable(phi, k + 1), s = gonio_dual_sin(t);
    return (direction){gonio_dual_mul(s, gonio_dual_cos(p)), gonio_dual_mul(s, gonio_dual_sin(p)), gonio_dual_cos(t)};
}

static dual sum3(dual a, dual b, dual c) { return gonio_dual_add(gonio_dual_add(a, b), c); }

static dual squares(direction w) {
    return sum3(gonio_dual_square(w.x), gonio_dual_square(w.y), gonio_dual_square(w.z));
}

// ---- coordinates ----

// asinh(length / stretch) / (2 limit length), the factor that stretches an offset of that length; even in the length,
// so that its derivative at 0 is 0.
static dual stretch_of(const gonio_locator *l, dual length, dual stretched) {
    if (!(length.v > 0)) {
        return gonio_dual_constant(l->per_stretch * 0.5 / l->limit);
    }
    dual radius = gonio_dual_asinh(gonio_dual_scale(stretched, l->per_stretch));
    radius = gonio_dual_min(radius, gonio_dual_constant(l->limit));
    return gonio_dual_div(gonio_dual_scale(radius, 0.5 / l->limit), length);
}

static dual centred(dual offset) { return gonio_dual_shift(offset, 0.5); }

static void locate_half(const gonio_locator *l, direction i, direction o, dual x[4], dual *profile) {
    const direction sum = {gonio_dual_add(i.x, o.x), gonio_dual_add(i.y, o.y), gonio_dual_add(i.z, o.z)};
    const dual length = gonio_dual_sqrt(squares(sum)), one = gonio_dual_constant(1), none = gonio_dual_constant(0);
    const bool proper = length.v > 1e-12;
    const direction h = {proper ? gonio_dual_div(sum.x, length) : none, proper ? gonio_dual_div(sum.y, length) : none,
                         proper ? gonio_dual_div(sum.z, length) : one};
    const dual dot = gonio_dual_add(gonio_dual_mul(i.x, h.x), gonio_dual_mul(i.y, h.y));
    const dual k = gonio_dual_add(i.z, gonio_dual_div(dot, gonio_dual_shift(h.z, 1)));
    const direction d = {gonio_dual_sub(i.x, gonio_dual_mul(h.x, k)), gonio_dual_sub(i.y, gonio_dual_mul(h.y, k)),
                         gonio_dual_add(dot, gonio_dual_mul(i.z, h.z))};
    const dual sin_h = gonio_dual_norm(h.x, h.y), most = gonio_dual_constant(GONIO_TAN_H_MAX);
    const dual tan_h = h.z.v > 0 ? gonio_dual_min(gonio_dual_div(sin_h, h.z), most) : most;
    const dual stretch = stretch_of(l, sin_h, tan_h);
    if (l->dims == 4) {
        x[0] = centred(gonio_dual_mul(h.x, stretch));
        x[1] = centred(gonio_dual_mul(h.y, stretch));
        x[2] = centred(gonio_dual_scale(d.x, 0.5));
        x[3] = centred(gonio_dual_scale(d.y, 0.5));
        return;
    }
    const dual sin_d = gonio_dual_norm(d.x, d.y);
    const dual along = gonio_dual_add(gonio_dual_mul(d.x, h.x), gonio_dual_mul(d.y, h.y));
    const dual across = gonio_dual_sub(gonio_dual_mul(d.y, h.x), gonio_dual_mul(d.x, h.y));
    x[0] = centred(gonio_dual_mul(stretch, sin_d.v > 0 ? gonio_dual_div(along, sin_d) : sin_h));
    x[1] = centred(sin_d.v > 0 ? gonio_dual_mul(stretch, gonio_dual_div(across, sin_d)) : none);
    x[2] = gonio_dual_scale(gonio_dual_atan2(sin_d, d.z), 2 / GONIO_PI);
    if (profile != NULL) {
        const dual radius = gonio_dual_asinh(gonio_dual_scale(tan_h, l->per_narrow));
        profile[0] = gonio_dual_hold(gonio_dual_scale(radius, 1 / l->narrow_limit), 0, 1);
        profile[1] = x[2];
    }
}

// The turn to phi_i = 0 of three coordinates is one of the angles.
static void locate_planar(const gonio_locator *l, const gonio_pair *pair, dual x[4]) {
    const dual sin_i = gonio_dual_sin(gonio_dual_variable(pair->theta_i, 0));
    const dual sin_o = gonio_dual_sin(gonio_dual_variable(pair->theta_o, 2));
    dual phi_i = gonio_dual_variable(pair->phi_i, 1), phi_o = gonio_dual_variable(pair->phi_o, 3);
    const bool turn = l->dims == 3;
    if (turn) {
        phi_o = gonio_dual_sub(phi_o, phi_i);
        phi_i = gonio_dual_constant(0);
    }
    const dual i[2] = {gonio_dual_mul(sin_i, gonio_dual_cos(phi_i)), gonio_dual_mul(sin_i, gonio_dual_sin(phi_i))};
    const dual o[2] = {gonio_dual_mul(sin_o, gonio_dual_cos(phi_o)), gonio_dual_mul(sin_o, gonio_dual_sin(phi_o))};
    dual *rest = x + (turn ? 1 : 2);
    x[0] = centred(gonio_dual_scale(i[0], 0.5));
    x[1] = centred(gonio_dual_scale(i[1], 0.5)); // overwritten where there are three
    if (l->system == GONIO_NUSSELT) {
        rest[0] = centred(gonio_dual_scale(o[0], 0.5));
        rest[1] = centred(gonio_dual_scale(o[1], 0.5));
        return;
    }
    const dual u = gonio_dual_add(o[0], i[0]), v = gonio_dual_add(o[1], i[1]), length = gonio_dual_norm(u, v);
    const dual stretch = stretch_of(l, length, length);
    rest[0] = centred(gonio_dual_mul(u, stretch));
    rest[1] = centred(gonio_dual_mul(v, stretch));
}

// ---- the base ----

static direction lifted(direction w, double cosine_min) {
    if (w.z.v < cosine_min) {
        const dual planar = gonio_dual_norm(w.x, w.y);
        const dual shrink = gonio_dual_div(gonio_dual_constant(sqrt(1 - cosine_min * cosine_min)), planar);
        w = (direction){gonio_dual_mul(w.x, shrink), gonio_dual_mul(w.y, shrink), gonio_dual_constant(cosine_min)};
    }
    w.z = gonio_dual_max(w.z, gonio_dual_constant(GONIO_LOBE_COSINE_MIN));
    return w;
}

static dual fresnel(dual cos_d, double f0) {
    const double p = 1 - cos_d.v, p4 = p * p * p * p;
    return gonio_dual_chain(cos_d, f0 + (1 - f0) * p4 * p, -5 * (1 - f0) * p4);
}

static dual cook_torrance(direction i, direction o, dual cos_h, dual cos_d, dual tan2, double m, double f0) {
    const dual slope = gonio_dual_square(gonio_dual_shift(tan2, 1));
    const dual d = gonio_dual_mul(gonio_dual_exp(gonio_dual_scale(tan2, -1 / (m * m))), slope);
    const dual side = gonio_dual_scale(gonio_dual_mul(cos_h, gonio_dual_min(i.z, o.z)), 2);
    const dual top = gonio_dual_mul(gonio_dual_mul(d, gonio_dual_min(cos_d, side)), fresnel(cos_d, f0));
    const dual below = gonio_dual_mul(cos_d, gonio_dual_mul(i.z, o.z));
    return gonio_dual_scale(gonio_dual_div(top, below), 1 / (4 * GONIO_PI * m * m));
}

// cos + sqrt(cos^2 + alpha^2 sin^2)
static dual smith(direction w, double a2) {
    const dual sin2 = gonio_dual_add(gonio_dual_square(w.x), gonio_dual_square(w.y));
    return gonio_dual_add(w.z, gonio_dual_sqrt(gonio_dual_add(gonio_dual_square(w.z), gonio_dual_scale(sin2, a2))));
}

static dual ggx(direction i, direction o, dual sin2_h, dual cos_h, dual cos_d, double alpha, double f0) {
    const double a2 = alpha * alpha;
    const dual q = gonio_dual_add(gonio_dual_scale(sin2_h, 1 / a2), gonio_dual_square(cos_h));
    const dual below = gonio_dual_mul(gonio_dual_square(q), gonio_dual_mul(smith(i, a2), smith(o, a2)));
    return gonio_dual_div(fresnel(cos_d, f0), gonio_dual_scale(below, GONIO_PI * a2));
}

// As gonio_lobe_base_units.
static void base_units(const gonio_lobe_base *base, direction i, direction o, dual units[1 + GONIO_LOBES_MAX]) {
    const double least = (double)base->cosine_min;
    units[0] = gonio_dual_constant(base->lobes > 0);
    if (base->lobes == 0) {
        if (base->grazing > 0) {
            const dual floor = gonio_dual_constant(least);
            const dual cosines = gonio_dual_mul(gonio_dual_max(i.z, floor), gonio_dual_max(o.z, floor));
            units[0] = gonio_dual_scale(gonio_dual_log(cosines), -(double)base->grazing);
        }
        return;
    }
    i = lifted(i, least);
    o = lifted(o, least);
    const direction sum = {gonio_dual_add(i.x, o.x), gonio_dual_add(i.y, o.y), gonio_dual_add(i.z, o.z)};
    const dual planar = gonio_dual_add(gonio_dual_square(sum.x), gonio_dual_square(sum.y)), square = squares(sum);
    const dual length = gonio_dual_sqrt(square), cos_h = gonio_dual_div(sum.z, length);
    const dual cos_d = gonio_dual_min(gonio_dual_scale(length, 0.5), gonio_dual_constant(1));
    for (int j = 0; j < base->lobes; j++) {
        units[1 + j] = base->family == GONIO_LOBE_GGX
                           ? ggx(i, o, gonio_dual_div(planar, square), cos_h, cos_d, base->alpha[j], base->f0[j])
                           : cook_torrance(i, o, cos_h, cos_d, gonio_dual_div(planar, gonio_dual_square(sum.z)),
                                           base->alpha[j], base->f0[j]);
    }
}

// ---- a channel ----

static double entry(const gonio_lobe_spline *m, int table, int channel) {
    return *gonio_lobe_table(m, table, (size_t)channel);
}

static dual lattice_at(const gonio_lattice *lattice, const dual *x, int channel) {
    double at[GONIO_DIMS_MAX], slope[GONIO_DIMS_MAX];
    for (int d = 0; d < lattice->dims; d++) {
        at[d] = x[d].v;
    }
    dual value = gonio_dual_constant(gonio_lattice_gradient(lattice, at, channel, slope));
    for (int d = 0; d < lattice->dims; d++) {
        for (int k = 0; k < 4 && at[d] >= 0 && at[d] <= 1; k++) {
            value.d[k] += slope[d] * x[d].d[k];
        }
    }
    return value;
}

static dual spline_at(const gonio_lobe_spline *m, const gonio_pair *pair, direction i, direction o, int channel) {
    const gonio_lobe_spline_parts *p = &m->parts;
    if (p->lattice.points == NULL) {
        return gonio_dual_constant(0);
    }
    dual x[4], y[2];
    const bool profile = p->profile.points != NULL;
    if (gonio_coordinates_are_half_vector(m->locator.system)) {
        locate_half(&m->locator, i, o, x, profile ? y : NULL);
    } else {
        locate_planar(&m->locator, pair, x);
    }
    const dual value = lattice_at(&p->lattice, x, channel);
    return profile ? gonio_dual_add(value, lattice_at(&p->profile, y, channel)) : value;
}

static dual add_shares(const gonio_lobe_spline *m, const dual *units, int channel, dual value) {
    dual sum = gonio_dual_constant(0), weighted = sum;
    for (int j = 0; j <= m->parts.base.lobes; j++) {
        const dual part = gonio_dual_scale(units[j], m->mean_strength[j]);
        sum = gonio_dual_add(sum, part);
        weighted = gonio_dual_add(weighted, gonio_dual_scale(part, entry(m, GONIO_LOBE_SHARE + j, channel)));
    }
    return sum.v > 0 ? gonio_dual_add(value, gonio_dual_div(weighted, sum)) : value;
}

// e to the positive transform's value of a base y.
static dual positive_base(dual y, double eps) {
    if (y.v >= eps) {
        return gonio_dual_shift(y, eps);
    }
    const dual share = gonio_dual_max(gonio_dual_scale(y, 1 / eps), gonio_dual_constant(GONIO_POSITIVE_FLOOR));
    return gonio_dual_scale(gonio_dual_sqrt(share), 2 * eps);
}

// Base and spline together -> y.
static dual value_of(const gonio_lobe_spline *m, dual t, const dual *y, int channel) {
    const gonio_transform_kind kind = m->parts.kind;
    const double eps = entry(m, GONIO_LOBE_EPS, channel);
    const dual top = gonio_dual_constant(entry(m, GONIO_LOBE_TOP, channel));
    if (kind == GONIO_TRANSFORM_POSITIVE) {
        t = gonio_dual_exp(gonio_dual_hold(t, -708, 709));
        if (y != NULL) {
            const dual base = positive_base(*y, eps);
            t = gonio_dual_min(gonio_dual_mul(t, base), gonio_dual_max(base, top));
        }
        t = gonio_dual_hold(t, exp(-60), exp(60));
        const dual over = gonio_dual_scale(t, entry(m, GONIO_LOBE_HALF_PER, channel));
        return over.v >= 1 ? gonio_dual_shift(t, -eps) : gonio_dual_scale(gonio_dual_square(over), eps);
    }
    if (y != NULL) {
        const dual base = kind == GONIO_TRANSFORM_ASINH ? gonio_dual_asinh(gonio_dual_scale(*y, 1 / eps)) : *y;
        t = gonio_dual_min(gonio_dual_add(t, base), gonio_dual_max(base, top));
    }
    return kind == GONIO_TRANSFORM_ASINH ? gonio_dual_chain(t, eps * sinh(t.v), eps * cosh(t.v)) : t;
}

void gonio_lobe_spline_gradient(const gonio_model *model, const gonio_pair *pair, int channel, double out[4]) {
    const gonio_lobe_spline *m = (const gonio_lobe_spline *)model;
    const int lobes = m->parts.base.lobes;
    const direction i = direction_of(pair->theta_i, pair->phi_i, 0), o = direction_of(pair->theta_o, pair->phi_o, 2);
    dual units[1 + GONIO_LOBES_MAX], base = gonio_dual_constant(0);
    base_units(&m->parts.base, i, o, units);
    dual t = spline_at(m, pair, i, o, channel);
    if (m->parts.shares != NULL) {
        t = add_shares(m, units, channel, t);
    }
    if (lobes == 0) {
        t = gonio_dual_add(t, units[0]);
    }
    t = gonio_dual_hold(t, entry(m, GONIO_LOBE_LOW, channel), entry(m, GONIO_LOBE_HIGH, channel));
    for (int j = 0; j <= lobes && lobes > 0; j++) {
        base = gonio_dual_add(base, gonio_dual_scale(units[j], entry(m, GONIO_LOBE_STRENGTH + j, channel)));
    }
    base = gonio_dual_min(base, gonio_dual_constant(GONIO_LOBE_CEILING));
    const dual value = value_of(m, t, lobes > 0 ? &base : NULL, channel);
    for (int k = 0; k < 4; k++) {
        out[k] = value.d[k] * entry(m, GONIO_LOBE_SCALE, channel);
    }
}
