// SPDX-License-Identifier: BSD-3-Clause
// Included by fit/smooth/kernels.c once an instruction set, with
//   VECTOR, LANES   the vector and its elements, 1 < LANES <= 8
//   TARGET, NAME(x) the functions' attribute and names
#define PARTS (8 / LANES)
#define EACH_PART GONIO_UNROLL for (size_t p = 0; p < PARTS; p++)
#define AT(x, i) (*(const VECTOR *)((x) + (i) + p * LANES))
#define PUT(x, i) (*(VECTOR *)((x) + (i) + p * LANES))

// Lanes in pairs of a fixed order.
TARGET static double NAME(total)(const VECTOR *s) {
    const double *v = (const double *)s;
    return ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]));
}

TARGET static void NAME(tile)(size_t depth, const double *a, const double *b, double *sum) {
    VECTOR s[GONIO_TILE_COLUMNS][PARTS] = {{{0}}};
    for (size_t k = 0; k < depth; k++, a += GONIO_TILE_ROWS, b += GONIO_TILE_COLUMNS) {
        EACH_PART {
            const VECTOR x = AT(a, 0);
            GONIO_UNROLL for (size_t j = 0; j < GONIO_TILE_COLUMNS; j++) {
                s[j][p] += x * b[j];
            }
        }
    }
    GONIO_UNROLL for (size_t j = 0; j < GONIO_TILE_COLUMNS; j++) {
        EACH_PART { PUT(sum, j * GONIO_TILE_ROWS) = s[j][p]; }
    }
}

TARGET static double NAME(dot)(size_t n, const double *x, const double *y) {
    VECTOR s[PARTS] = {{0}}, t[PARTS] = {{0}};
    size_t i = 0;
    for (; i + 16 <= n; i += 16) {
        EACH_PART {
            s[p] += AT(x, i) * AT(y, i);
            t[p] += AT(x, i + 8) * AT(y, i + 8);
        }
    }
    EACH_PART { s[p] += t[p]; }
    double sum = NAME(total)(s);
    for (; i < n; i++) {
        sum += x[i] * y[i];
    }
    return sum;
}

TARGET static void NAME(add_scaled)(size_t n, double alpha, const double *x, double *y) {
    size_t i = 0;
    for (; i + 8 <= n; i += 8) {
        EACH_PART { PUT(y, i) += alpha * AT(x, i); }
    }
    for (; i < n; i++) {
        y[i] += alpha * x[i];
    }
}

TARGET static void NAME(turn)(size_t n, double c, double s, double *x, double *y) {
    size_t i = 0;
    for (; i + 8 <= n; i += 8) {
        EACH_PART {
            const VECTOR a = AT(x, i), b = AT(y, i);
            PUT(x, i) = c * a + s * b;
            PUT(y, i) = c * b - s * a;
        }
    }
    for (; i < n; i++) {
        const double a = x[i], b = y[i];
        x[i] = c * a + s * b;
        y[i] = c * b - s * a;
    }
}

TARGET static void NAME(four)(size_t n, const double *columns, size_t step, const double x[4], const double *v,
                              double *y, double out[4]) {
    const double *c0 = columns, *c1 = c0 + step, *c2 = c1 + step, *c3 = c2 + step;
    const double x0 = x[0], x1 = x[1], x2 = x[2], x3 = x[3];
    VECTOR s0[PARTS] = {{0}}, s1[PARTS] = {{0}}, s2[PARTS] = {{0}}, s3[PARTS] = {{0}};
    size_t i = 0;
    for (; i + 8 <= n; i += 8) {
        EACH_PART {
            const VECTOR a0 = AT(c0, i), a1 = AT(c1, i), a2 = AT(c2, i), a3 = AT(c3, i), w = AT(v, i);
            PUT(y, i) += (a0 * x0 + a1 * x1) + (a2 * x2 + a3 * x3);
            s0[p] += a0 * w;
            s1[p] += a1 * w;
            s2[p] += a2 * w;
            s3[p] += a3 * w;
        }
    }
    out[0] = NAME(total)(s0);
    out[1] = NAME(total)(s1);
    out[2] = NAME(total)(s2);
    out[3] = NAME(total)(s3);
    for (; i < n; i++) {
        y[i] += (c0[i] * x0 + c1[i] * x1) + (c2[i] * x2 + c3[i] * x3);
        out[0] += c0[i] * v[i];
        out[1] += c1[i] * v[i];
        out[2] += c2[i] * v[i];
        out[3] += c3[i] * v[i];
    }
}

TARGET static void NAME(secular)(size_t n, const double *delta, const double *weight, double x, double out[2]) {
    VECTOR value[PARTS] = {{0}}, slope[PARTS] = {{0}};
    size_t i = 0;
    for (; i + 8 <= n; i += 8) {
        EACH_PART {
            const VECTOR away = AT(delta, i) - x, term = AT(weight, i) / away;
            value[p] += term;
            slope[p] += term / away;
        }
    }
    out[0] = NAME(total)(value);
    out[1] = NAME(total)(slope);
    for (; i < n; i++) {
        const double term = weight[i] / (delta[i] - x);
        out[0] += term;
        out[1] += term / (delta[i] - x);
    }
}

static const gonio_kernels NAME(kernels) = {
    .name = NAME_TEXT,
    .tile = NAME(tile),
    .dot = NAME(dot),
    .add_scaled = NAME(add_scaled),
    .turn = NAME(turn),
    .four = NAME(four),
    .secular = NAME(secular),
};

#undef PARTS
#undef EACH_PART
#undef AT
#undef PUT
#undef VECTOR
#undef LANES
#undef TARGET
#undef NAME
#undef NAME_TEXT
