// SPDX-License-Identifier: BSD-3-Clause
// From a lattice's sums to values: included by brdf/kind/lobe_spline_eval.c once for each GONIO_WIDTH, the number of
// channels (or pairs) in a vector.
GONIO_INLINE bool GONIO_LANED(any)(const GONIO_L *mask) {
    int64_t all = 0;
    GONIO_UNROLL
    for (int k = 0; k < GONIO_WIDTH; k++) {
        all |= (*mask)[k];
    }
    return all != 0;
}

// Channels at c, or the channel at c in every lane.
GONIO_INLINE void GONIO_LANED(table)(const gonio_lobe_spline *m, int table, size_t c, const bool spread, GONIO_D *out) {
    const double *at = gonio_lobe_table(m, table, c);
    *out = spread ? GONIO_ALL(*at) : *(const GONIO_D *)at;
}

// Base of the positive transform: e to its transformed value.
GONIO_INLINE void GONIO_LANED(positive_base)(const GONIO_D *y, const GONIO_D *eps, const GONIO_D *half_per,
                                             GONIO_D *out) {
    const GONIO_L low = *y < *eps;
    *out = *y + *eps;
    if (GONIO_LANED(any)(&low)) {
        GONIO_D share = 2 * (*y * *half_per);
        share = GONIO_MAX(share, GONIO_ALL(GONIO_POSITIVE_FLOOR));
        GONIO_LANED(gonio_sqrt)(&share);
        *out = GONIO_SELECT(low, 2 * *eps * share, *out);
    }
}

// y and dy/dt of e^t of the positive transform (brdf/transform.h); t is held within 60 of 0, e^60 = 1e26.
GONIO_INLINE void GONIO_LANED(positive_value)(GONIO_D *value, const GONIO_D *eps, const GONIO_D *half_per,
                                              GONIO_D *slope) {
    const GONIO_D low_end = GONIO_ALL(0x1.5ae191a99585ap-87), high_end = GONIO_ALL(0x1.79dbc9dc53c66p+86);
    GONIO_D e = GONIO_MAX(*value, low_end);
    e = GONIO_MIN(e, high_end);
    const GONIO_D over = e * *half_per, low = *eps * over * over;
    *value = GONIO_SELECT(over >= 1, e - *eps, low);
    *slope = GONIO_SELECT(over >= 1, e, 2 * low);
}

// asinh(y / eps) of either sign.
GONIO_INLINE void GONIO_LANED(signed_base)(GONIO_D *y, const GONIO_D *half_per) {
    const GONIO_D z = 2 * *half_per * *y, size = GONIO_MAX(z, -z);
    *y = GONIO_MIN(size, GONIO_ALL(1e150));
    GONIO_LANED(gonio_asinh)(y);
    *y = GONIO_SELECT(z < 0, -*y, *y);
}

// value: the spline's -> f_r; slope: d f_r / d transformed value.
GONIO_INLINE void GONIO_LANED(finish)(const gonio_lobe_spline *m, size_t c, const bool spread, const GONIO_D *units,
                                      const GONIO_D *shares, GONIO_D *value, GONIO_D *slope) {
    const int lobes = m->parts.base.lobes;
    const gonio_transform_kind kind = m->parts.kind;
    GONIO_D t = *value, base = {0}, a, eps, half_per, top;
    for (int j = 0; j <= lobes && m->parts.shares != NULL; j++) {
        GONIO_LANED(table)(m, GONIO_LOBE_SHARE + j, c, spread, &a);
        t += a * shares[j];
    }
    if (lobes == 0) {
        t += units[0];
    }
    GONIO_LANED(table)(m, GONIO_LOBE_LOW, c, spread, &a);
    t = GONIO_MAX(t, a);
    GONIO_LANED(table)(m, GONIO_LOBE_HIGH, c, spread, &a);
    t = GONIO_MIN(t, a);
    for (int j = 0; j <= lobes && lobes > 0; j++) {
        GONIO_LANED(table)(m, GONIO_LOBE_STRENGTH + j, c, spread, &a);
        base += a * units[j];
    }
    base = GONIO_MIN(base, GONIO_ALL(GONIO_LOBE_CEILING));
    GONIO_LANED(table)(m, GONIO_LOBE_EPS, c, spread, &eps);
    GONIO_LANED(table)(m, GONIO_LOBE_HALF_PER, c, spread, &half_per);
    GONIO_LANED(table)(m, GONIO_LOBE_TOP, c, spread, &top);
    if (kind == GONIO_TRANSFORM_POSITIVE) {
        GONIO_LANED(gonio_exp)(&t);
        if (lobes > 0) {
            a = base;
            GONIO_LANED(positive_base)(&a, &eps, &half_per, &base);
            t *= base;
        }
    } else if (lobes > 0) {
        if (kind == GONIO_TRANSFORM_ASINH) {
            GONIO_LANED(signed_base)(&base, &half_per);
        }
        t += base;
    }
    if (lobes > 0) {
        top = GONIO_MAX(base, top);
        t = GONIO_MIN(t, top);
    }
    *slope = GONIO_ALL(1.0);
    if (kind == GONIO_TRANSFORM_POSITIVE) {
        GONIO_LANED(positive_value)(&t, &eps, &half_per, slope);
    } else if (kind == GONIO_TRANSFORM_ASINH) {
        GONIO_D rise = t;
        GONIO_LANED(gonio_sinh)(&t);
        GONIO_LANED(gonio_exp)(&rise);
        *slope = eps * 0.5 * (rise + 1 / rise);
        t *= eps;
    }
    GONIO_LANED(table)(m, GONIO_LOBE_SCALE, c, spread, &a);
    *value = t * a;
    *slope *= a;
}
