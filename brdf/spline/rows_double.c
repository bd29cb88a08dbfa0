// SPDX-License-Identifier: BSD-3-Clause
// The rows of brdf/spline/rows.h summed in double.
//
// A channel's value is (l0 S0 + l1 S1) + (l2 S2 + l3 S3): l the weights of the last axis, S_k the sum over the rows of
// their weights times their k-th point, even rows and odd rows apart. Whatever is computed side by side (a row's four
// points, eight channels, one channel alone), each channel's sums are added in this one order: the same bits.
#include "brdf/spline/rows_double.h"

#include "brdf/spline/rows.h"

// Floats to doubles, element by element: of __builtin_convertvector GCC 12 makes two conversions and a shuffle.
#define WIDE4(p) ((gonio_d4){(double)(p)[0], (double)(p)[1], (double)(p)[2], (double)(p)[3]})

#define ROWS_MAX 64

// A position in a lattice of 2 to 4 dimensions: where its rows are, and all weights.
typedef struct rows {
    const float *base;
    int count, channels;
    double last[4];
    double weight[ROWS_MAX];
    size_t offset[ROWS_MAX]; // floats
} rows;

GONIO_INLINE void set_rows(const gonio_lattice *l, const uint32_t *position, const int dims, rows *out) {
    gonio_place place;
    gonio_rows_locate(position, l->level, l->size, dims, &place);
    const gonio_d4 *b = place.basis;
    const size_t c = (size_t)l->channels;
    *(gonio_d4 *)out->last = (gonio_d4){b[0][dims - 1], b[1][dims - 1], b[2][dims - 1], b[3][dims - 1]};
    out->base = l->points + place.first * c;
    out->channels = l->channels;
    out->count = 1 << 2 * (dims - 1);
    const gonio_d4 second = {b[0][1], b[1][1], b[2][1], b[3][1]}, third = {b[0][2], b[1][2], b[2][2], b[3][2]};
    const size_t line = l->size * c;
    GONIO_UNROLL
    for (int i = 0; i < 4; i++) {
        const size_t n = (size_t)i;
        if (dims == 2) {
            out->weight[i] = b[i][0];
            out->offset[i] = n * line;
            continue;
        }
        const gonio_d4 w = b[i][0] * second;
        for (size_t j = 0; j < 4; j++) {
            if (dims == 3) {
                out->weight[4 * n + j] = w[j];
                out->offset[4 * n + j] = (n * l->size + j) * line;
                continue;
            }
            *(gonio_d4 *)(out->weight + 16 * n + 4 * j) = w[j] * third;
            for (size_t k = 0; k < 4; k++) {
                out->offset[16 * n + 4 * j + k] = ((n * l->size + j) * l->size + k) * line;
            }
        }
    }
}

GONIO_INLINE void sum_ends(const rows *r, const gonio_d4 *s, double *value) {
    *value = (r->last[0] * (*s)[0] + r->last[1] * (*s)[1]) + (r->last[2] * (*s)[2] + r->last[3] * (*s)[3]);
}

// All channels of a lattice of 1 to 3: a row is that many vectors of 4.
GONIO_INLINE void sum_few(const rows *r, const int channels, double *values) {
    double sums[12];
    GONIO_UNROLL
    for (int v = 0; v < channels; v++) {
        gonio_d4 even = {0}, odd = {0};
        for (int k = 0; k < r->count; k += 2) {
            even += r->weight[k] * WIDE4(r->base + r->offset[k] + 4 * v);
            odd += r->weight[k + 1] * WIDE4(r->base + r->offset[k + 1] + 4 * v);
        }
        *(gonio_d4 *)(sums + 4 * v) = even + odd;
    }
    GONIO_UNROLL
    for (int c = 0; c < channels; c++) {
        const gonio_d4 s = {sums[c], sums[channels + c], sums[2 * channels + c], sums[3 * channels + c]};
        sum_ends(r, &s, &values[c]);
    }
}

// Channels first .. first + count, of which there are 8 or more: 8 at a time, the last 8 overlapping those before. Two
// vectors of 4, since GCC 12 takes vectors of 8 doubles through memory where there is no AVX-512.
GONIO_INLINE void sum_many(const rows *r, size_t first, size_t count, double *values) {
    for (size_t v = 0; v < count; v += 8) {
        const size_t at = v + 8 <= count ? v : count - 8;
        gonio_d4 low[4], high[4];
        GONIO_UNROLL
        for (size_t p = 0; p < 4; p += 2) { // two points at a time: eight sums hide the latency of additions
            const float *base = r->base + p * (size_t)r->channels + first + at, *next = base + r->channels;
            gonio_d4 even[4] = {{0}}, odd[4] = {{0}};
            for (int k = 0; k < r->count; k += 2) {
                const double w = r->weight[k], x = r->weight[k + 1];
                const size_t a = r->offset[k], b = r->offset[k + 1];
                even[0] += w * WIDE4(base + a);
                even[1] += w * WIDE4(base + a + 4);
                even[2] += w * WIDE4(next + a);
                even[3] += w * WIDE4(next + a + 4);
                odd[0] += x * WIDE4(base + b);
                odd[1] += x * WIDE4(base + b + 4);
                odd[2] += x * WIDE4(next + b);
                odd[3] += x * WIDE4(next + b + 4);
            }
            low[p] = even[0] + odd[0];
            high[p] = even[1] + odd[1];
            low[p + 1] = even[2] + odd[2];
            high[p + 1] = even[3] + odd[3];
        }
        const double *l = r->last;
        *(gonio_d4 *)(values + at) = (l[0] * low[0] + l[1] * low[1]) + (l[2] * low[2] + l[3] * low[3]);
        *(gonio_d4 *)(values + at + 4) = (l[0] * high[0] + l[1] * high[1]) + (l[2] * high[2] + l[3] * high[3]);
    }
}

#ifdef GONIO_WIDE
#define WIDE8(p)                                                                                                       \
    ((gonio_d8){(double)(p)[0], (double)(p)[1], (double)(p)[2], (double)(p)[3], (double)(p)[4], (double)(p)[5],        \
                (double)(p)[6], (double)(p)[7]})

// As sum_many.
GONIO_WIDE_TARGET static void sum_wide(const rows *r, size_t first, size_t count, double *values) {
    const size_t c = (size_t)r->channels;
    const double *l = r->last;
    for (size_t v = 0; v < count; v += 8) {
        const size_t at = v + 8 <= count ? v : count - 8;
        const float *base = r->base + first + at;
        gonio_d8 even[4] = {{0}}, odd[4] = {{0}};
        for (int k = 0; k < r->count; k += 2) {
            const float *a = base + r->offset[k], *b = base + r->offset[k + 1];
            GONIO_UNROLL
            for (size_t p = 0; p < 4; p++) {
                even[p] += r->weight[k] * WIDE8(a + p * c);
                odd[p] += r->weight[k + 1] * WIDE8(b + p * c);
            }
        }
        *(gonio_d8 *)(values + at) = (l[0] * (even[0] + odd[0]) + l[1] * (even[1] + odd[1])) +
                                     (l[2] * (even[2] + odd[2]) + l[3] * (even[3] + odd[3]));
    }
}
#endif

GONIO_INLINE void sum_one(const rows *r, size_t channel, double *value) {
    const size_t c = (size_t)r->channels;
    gonio_d4 even = {0}, odd = {0};
    for (int k = 0; k < r->count; k += 2) {
        const float *a = r->base + r->offset[k] + channel, *b = r->base + r->offset[k + 1] + channel;
        even += r->weight[k] * (gonio_d4){(double)a[0], (double)a[c], (double)a[2 * c], (double)a[3 * c]};
        odd += r->weight[k + 1] * (gonio_d4){(double)b[0], (double)b[c], (double)b[2 * c], (double)b[3 * c]};
    }
    even += odd;
    sum_ends(r, &even, value);
}

GONIO_INLINE void set_any_rows(const gonio_lattice *l, const gonio_position *position, rows *out) {
    if (l->dims == 3) {
        set_rows(l, position->x, 3, out);
    } else if (l->dims == 4) {
        set_rows(l, position->x, 4, out);
    } else {
        set_rows(l, position->x, 2, out);
    }
}

GONIO_CLONES static void lattice_double(const gonio_lattice *l, const gonio_position *position, size_t first,
                                        size_t count, double *values) {
    rows r;
    set_any_rows(l, position, &r);
    if (l->channels == 1) {
        sum_few(&r, 1, values);
    } else if (l->channels == 3 && count == 3) {
        sum_few(&r, 3, values);
    } else if (count >= 8) {
        sum_many(&r, first, count, values);
    } else {
        for (size_t k = 0; k < count; k++) {
            sum_one(&r, first + k, &values[k]);
        }
    }
}

#ifdef GONIO_WIDE
GONIO_WIDE_TARGET static void lattice_wide(const gonio_lattice *l, const gonio_position *position, size_t first,
                                           size_t count, double *values) {
    rows r;
    set_any_rows(l, position, &r);
    sum_wide(&r, first, count, values);
}
#endif

void gonio_lattice_eval_double(const gonio_lattice *lattice, const gonio_position *position, size_t first, size_t count,
                               double *values) {
#ifdef GONIO_WIDE
    if (count >= 8 && GONIO_WIDE) {
        lattice_wide(lattice, position, first, count, values);
        return;
    }
#endif
    lattice_double(lattice, position, first, count, values);
}
