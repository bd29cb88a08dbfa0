// SPDX-License-Identifier: BSD-3-Clause
// Evaluation of the kind "lobe-spline" (brdf/kind/lobe_spline.h), one pair or many.
//
// f_r = T^-1(T(base) + spline), T the transform: of the positive transform, whose logarithm is taken of y + eps, e^(ln
// E + t) = E e^t, so the base needs no logarithm and each channel one exponential, of the spline alone. Everything is
// in double, with the functions of brdf/exp_log.h and the sums of brdf/spline/rows_double.h; the float of eval_f32 is
// that double, rounded.
//
// Four pairs are located together, a lane each; one pair alone fills all four lanes. The channels of a pair are then
// four lanes each, of a model of one channel four pairs. Every number goes through the same operations whatever lies
// beside it: so a batch gives the same bits however it is split, and with no FMA (Makefile) every clone does.
#include <math.h>
#include <string.h>

#include "brdf/kind/lobe_spline_model.h"
#include "brdf/spline/rows.h"
#include "brdf/spline/rows_double.h"

#define BLOCK 32 // channels at a time, on the stack
#define BATCH 16 // pairs at a time
#define AHEAD 3  // pairs between a prefetch and its use

// A batch of pairs, located.
typedef struct batch {
    gonio_position spline[BATCH], profile[BATCH];
    gonio_d4 units[BATCH / GONIO_LANES][1 + GONIO_LOBES_MAX], shares[BATCH / GONIO_LANES][1 + GONIO_LOBES_MAX];
} batch;

GONIO_INLINE void lobe(gonio_lobe_family family, const gonio_lobe_geometry4 *g, const gonio_d4 *per_alpha2,
                       const gonio_d4 *f0, gonio_d4 *out) {
    if (family == GONIO_LOBE_GGX) {
        gonio_ggx4(g, per_alpha2, f0, out);
    } else {
        gonio_cook_torrance4(g, per_alpha2, f0, out);
    }
}

// As gonio_lobe_base_units and gonio_lobe_shares.
GONIO_INLINE void base_of(const gonio_lobe_spline *m, const gonio_pairs4 *pairs, const gonio_halves4 *halves,
                          bool one_pair, gonio_d4 *units, gonio_d4 *shares) {
    const gonio_lobe_base *base = &m->parts.base;
    if (base->lobes == 0) {
        units[0] = (gonio_d4){0};
        if (base->grazing > 0) {
            const gonio_d4 least = GONIO_ALL4((double)base->cosine_min);
            gonio_d4 cosines = GONIO_MAX4(pairs->i[2], least) * GONIO_MAX4(pairs->o[2], least);
            gonio_log4(&cosines);
            units[0] = -(double)base->grazing * cosines;
        }
        return;
    }
    gonio_lobe_geometry4 geometry;
    gonio_lobe_geometry4_of(pairs, halves, (double)base->cosine_min, &geometry);
    units[0] = GONIO_ALL4(1.0);
    if (one_pair && base->lobes == 2) { // two lanes a lobe
        const double *p = m->per_alpha2, *f = base->f0;
        gonio_d4 both;
        lobe(base->family, &geometry, &(gonio_d4){p[0], p[0], p[1], p[1]}, &(gonio_d4){f[0], f[0], f[1], f[1]}, &both);
        units[1] = GONIO_ALL4(both[0]);
        units[2] = GONIO_ALL4(both[2]);
    } else {
        for (int j = 0; j < base->lobes; j++) {
            lobe(base->family, &geometry, &GONIO_ALL4(m->per_alpha2[j]), &GONIO_ALL4(base->f0[j]), &units[1 + j]);
        }
    }
    if (m->parts.shares != NULL) {
        gonio_d4 sum = {0};
        for (int j = 0; j <= base->lobes; j++) {
            shares[j] = m->mean_strength[j] * units[j];
            sum += shares[j];
        }
        const gonio_d4 per_sum = 1 / sum;
        for (int j = 0; j <= base->lobes; j++) {
            shares[j] = GONIO_SELECT4(sum > 0, shares[j] * per_sum, GONIO_ALL4(0.0));
        }
    }
}

GONIO_INLINE void fix(const gonio_d4 *x, gonio_position *out) {
    for (int k = 0; k < GONIO_LANES; k++) {
        gonio_position_set(&out[k], x[0][k], x[1][k], x[2][k], x[3][k]);
    }
}

GONIO_CLONES static void lobe_spline_locate(const gonio_lobe_spline *m, size_t n, const gonio_vec3 *wi,
                                            const gonio_vec3 *wo, batch *b) {
    const bool profile = m->parts.profile.points != NULL;
    for (size_t k = 0; k < n; k += GONIO_LANES) {
        gonio_pairs4 pairs = {.i = {{0}}}; // GCC 12 takes the vectors stored next for uninitialised
        gonio_halves4 halves;
        gonio_d4 x[4] = {{0}}, y[4] = {{0}};
        gonio_pairs4_set(&pairs, n - k, wi + k, wo + k);
        gonio_halves4_of(&pairs, &halves);
        base_of(m, &pairs, &halves, n == 1, b->units[k / GONIO_LANES], b->shares[k / GONIO_LANES]);
        if (m->parts.lattice.points != NULL) {
            gonio_locate4(&m->locator, &pairs, &halves, n == 1, x, profile ? y : NULL);
            fix(x, b->spline + k);
        }
        if (profile) {
            fix(y, b->profile + k);
        }
    }
}

// The lattices' part of the spline's value, pair k.
static void spline_of(const gonio_lobe_spline *m, const batch *b, size_t k, size_t first, size_t count,
                      double *values) {
    const gonio_lobe_spline_parts *p = &m->parts;
    if (p->lattice.points == NULL) {
        memset(values, 0, count * sizeof *values);
        return;
    }
    gonio_lattice_eval_double(&p->lattice, &b->spline[k], first, count, values);
    if (p->profile.points != NULL) {
        double more[BLOCK];
        gonio_lattice_eval_double(&p->profile, &b->profile[k], first, count, more);
        for (size_t c = 0; c < count; c++) {
            values[c] += more[c];
        }
    }
}

#define GONIO_WIDTH 4
#include "brdf/kind/lobe_spline_finish.h"
#undef GONIO_WIDTH
#ifdef GONIO_WIDE
#define GONIO_WIDTH 8
#include "brdf/kind/lobe_spline_finish.h"
#undef GONIO_WIDTH
#endif

// count <= BLOCK channels from first of pair k; both arrays are padded to whole vectors.
GONIO_CLONES static void lobe_spline_channels(const gonio_lobe_spline *m, const batch *b, size_t k, size_t first,
                                              size_t count, double *values, double *slopes) {
    gonio_d4 units[1 + GONIO_LOBES_MAX], shares[1 + GONIO_LOBES_MAX], slope;
    const size_t g = k / GONIO_LANES, lane = k % GONIO_LANES;
    for (int j = 0; j <= m->parts.base.lobes; j++) {
        units[j] = GONIO_ALL4(b->units[g][j][lane]);
        shares[j] = m->parts.shares != NULL ? GONIO_ALL4(b->shares[g][j][lane]) : GONIO_ALL4(0.0);
    }
    for (size_t c = 0; c < count; c += GONIO_LANES) {
        finish4(m, first + c, false, units, shares, (gonio_d4 *)(values + c), &slope);
        *(gonio_d4 *)(slopes + c) = slope;
    }
}

#ifdef GONIO_WIDE
// The same, eight channels a vector.
GONIO_WIDE_TARGET static void lobe_spline_channels_wide(const gonio_lobe_spline *m, const batch *b, size_t k,
                                                        size_t first, size_t count, double *values, double *slopes) {
    gonio_d8 units[1 + GONIO_LOBES_MAX], shares[1 + GONIO_LOBES_MAX], slope;
    const size_t g = k / GONIO_LANES, lane = k % GONIO_LANES;
    for (int j = 0; j <= m->parts.base.lobes; j++) {
        units[j] = GONIO_ALL8(b->units[g][j][lane]);
        shares[j] = m->parts.shares != NULL ? GONIO_ALL8(b->shares[g][j][lane]) : GONIO_ALL8(0.0);
    }
    for (size_t c = 0; c < count; c += 8) {
        finish8(m, first + c, false, units, shares, (gonio_d8 *)(values + c), &slope);
        *(gonio_d8 *)(slopes + c) = slope;
    }
}
#endif

static void channels_of(const gonio_lobe_spline *m, const batch *b, size_t k, size_t first, size_t count,
                        double *values, double *slopes) {
#ifdef GONIO_WIDE
    if (count > GONIO_LANES && GONIO_WIDE) {
        lobe_spline_channels_wide(m, b, k, first, count, values, slopes);
        return;
    }
#endif
    lobe_spline_channels(m, b, k, first, count, values, slopes);
}

// A model of one channel: four pairs are a vector.
GONIO_CLONES static void lobe_spline_pairs(const gonio_lobe_spline *m, const batch *b, size_t n, double *values) {
    for (size_t k = 0; k < n; k += GONIO_LANES) {
        const size_t g = k / GONIO_LANES;
        gonio_d4 slope;
        finish4(m, 0, true, b->units[g], b->shares[g], (gonio_d4 *)(values + k), &slope);
    }
}

// Where to put the channels of one pair: each may be NULL.
typedef struct answers {
    double *values, *slopes;
    float *narrow;
} answers;

static void answer(const double *values, const double *slopes, size_t at, size_t count, const answers *out) {
    if (out->values != NULL) {
        memcpy(out->values + at, values, count * sizeof *values);
    }
    if (out->slopes != NULL) {
        memcpy(out->slopes + at, slopes, count * sizeof *slopes);
    }
    for (size_t c = 0; c < count && out->narrow != NULL; c++) {
        out->narrow[at + c] = (float)values[c];
    }
}

// Blocks of like size, so that none is too short for the wide sums.
static void eval_pair(const gonio_lobe_spline *m, const batch *b, size_t k, size_t first, size_t count,
                      const answers *out) {
    double values[BLOCK] = {0}, slopes[BLOCK];
    const size_t blocks = (count + BLOCK - 1) / BLOCK;
    for (size_t i = 0; i < blocks; i++) {
        const size_t begin = count * i / blocks, length = count * (i + 1) / blocks - begin;
        spline_of(m, b, k, first + begin, length, values);
        channels_of(m, b, k, first + begin, length, values, slopes);
        answer(values, slopes, begin, length, out);
    }
}

void gonio_lobe_spline_eval(const gonio_lobe_spline *m, const gonio_vec3 *wi, const gonio_vec3 *wo, size_t first,
                            size_t count, double *values, float *narrow, double *slopes) {
    const answers out = {values, slopes, narrow};
    batch b;
    lobe_spline_locate(m, 1, wi, wo, &b);
    eval_pair(m, &b, 0, first, count, &out);
}

static void prefetch(const gonio_lobe_spline *m, const batch *b, size_t k, size_t n) {
    if (k < n && m->parts.lattice.count * (size_t)m->head.channels > GONIO_ROWS_PREFETCH_MIN) {
        gonio_rows_prefetch(&m->parts.lattice, b->spline[k].x, m->parts.dims);
    }
}

// n <= BATCH pairs.
static void eval_batch(const gonio_lobe_spline *m, size_t n, const gonio_vec3 *wi, const gonio_vec3 *wo,
                       double *values) {
    const size_t channels = (size_t)m->head.channels;
    double one[BATCH] = {0};
    batch b;
    lobe_spline_locate(m, n, wi, wo, &b);
    for (size_t k = 0; k < n; k++) {
        const answers out = {values + k * channels, NULL, NULL};
        prefetch(m, &b, k + AHEAD, n);
        if (channels == 1) {
            spline_of(m, &b, k, 0, 1, &one[k]);
        } else {
            eval_pair(m, &b, k, 0, channels, &out);
        }
    }
    if (channels == 1) {
        lobe_spline_pairs(m, &b, n, one);
        memcpy(values, one, n * sizeof *values);
    }
}

void gonio_lobe_spline_eval_many(const gonio_lobe_spline *m, size_t n, const gonio_vec3 *wi, const gonio_vec3 *wo,
                                 double *values) {
    for (size_t begin = 0; begin < n; begin += BATCH) {
        const size_t count = n - begin < BATCH ? n - begin : BATCH;
        eval_batch(m, count, wi + begin, wo + begin, values + begin * (size_t)m->head.channels);
    }
}

// A lattice of one channel that lies where sigma's does.
GONIO_CLONES static void lobe_spline_aside(const gonio_lobe_spline *m, const gonio_lattice *lattice,
                                           const gonio_vec3 *wi, const gonio_vec3 *wo, double *value) {
    gonio_pairs4 pairs = {.i = {{0}}};
    gonio_halves4 halves;
    gonio_d4 x[4] = {{0}};
    gonio_position position[GONIO_LANES];
    gonio_pairs4_set(&pairs, 1, wi, wo);
    gonio_halves4_of(&pairs, &halves);
    gonio_locate4(&m->sigma_locator, &pairs, &halves, true, x, NULL);
    fix(x, position);
    gonio_lattice_eval_double(lattice, position, 0, 1, value);
}

// ln sigma is held within 60 of 0.
GONIO_CLONES static void lobe_spline_sigma(double ln_sigma, double *shape) {
    gonio_d4 e = GONIO_ALL4(fmin(fmax(ln_sigma, -60), 60));
    gonio_exp4(&e);
    *shape = e[0];
}

double gonio_lobe_spline_sigma_shape(const gonio_lobe_spline *m, const gonio_vec3 *wi, const gonio_vec3 *wo) {
    double ln_sigma, shape;
    lobe_spline_aside(m, &m->parts.sigma, wi, wo, &ln_sigma);
    lobe_spline_sigma(ln_sigma, &shape);
    return shape;
}

double gonio_lobe_spline_support(const gonio_lobe_spline *m, const gonio_vec3 *wi, const gonio_vec3 *wo) {
    double value;
    lobe_spline_aside(m, &m->parts.support, wi, wo, &value);
    return value;
}
