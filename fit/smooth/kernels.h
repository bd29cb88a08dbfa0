// SPDX-License-Identifier: BSD-3-Clause
// The inner loops of fit/smooth, compiled for several instruction sets. Each works in lanes of eight doubles, however
// many of them a register holds, so all give the same bits. (GCC keeps a generic vector that is wider than the
// registers in memory: five times slower. So each set has its own width, and target_clones would not do.)
#ifndef GONIO_FIT_SMOOTH_KERNELS_H
#define GONIO_FIT_SMOOTH_KERNELS_H

#include <stddef.h>

enum { GONIO_TILE_ROWS = 8, GONIO_TILE_COLUMNS = 4 };

typedef struct gonio_kernels {
    const char *name;
    // sum[columns x rows of a tile] of depth products; a and b hold a tile's rows and columns, product by product.
    void (*tile)(size_t depth, const double *a, const double *b, double *sum);
    double (*dot)(size_t n, const double *x, const double *y);
    void (*add_scaled)(size_t n, double alpha, const double *x, double *y);
    void (*turn)(size_t n, double c, double s, double *x, double *y); // (x, y) = (c x + s y, c y - s x)
    // y += A x of four columns below the block on the diagonal: y[i] += sum_q column_q[i] x[q], out[q] = column_q^T v.
    void (*four)(size_t n, const double *columns, size_t step, const double x[4], const double *v, double *y,
                 double out[4]);
    // sum weight / (delta - x) and, with the square of the denominator, its slope.
    void (*secular)(size_t n, const double *delta, const double *weight, double x, double out[2]);
} gonio_kernels;

// Those for this processor; and all that it can run, for tests: *count of them.
const gonio_kernels *gonio_kernels_best(void);
const gonio_kernels *const *gonio_kernels_all(size_t *count);

#endif
