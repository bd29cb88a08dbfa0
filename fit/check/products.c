// SPDX-License-Identifier: BSD-3-Clause
// The arithmetic is fit/smooth/matrix.h's, whose sums have one order: a BLAS or LAPACK gives other bits on other
// machines.
//
// How good is it? Let Q be an orthonormal basis of the range that was searched and E = A - Q Q^T A. Then A^T A is
// (Q^T A)^T (Q^T A) + E^T E, so by Ky Fan's inequality the k largest squared singular values of A exceed those found by
// at most the k largest of E, and these add up to at most |E|_F^2, which is |A|_F^2 - |Q^T A|_F^2: known, not
// estimated.
#include "fit/check/products.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/random.h"
#include "fit/smooth/matrix.h"

// Columns beside the k that are asked for: values that lie close together are told apart by them. A matrix with a side
// of WHOLE or less is searched with all of them, which is exact. BLOCK: rows that are read at a time.
enum { OVER = 32, WHOLE = 400, BLOCK = 64 };

typedef struct search {
    const gonio_row_source *a;
    size_t l;
    double *y, *z, *block, *small, *value; // [l][rows], [l][columns], [BLOCK][columns], [l][l] twice, [l]
    double squares;
} search;

// Columns made orthonormal, each against those before it, twice; what vanishes becomes 0.
static void orthonormalise(double *m, size_t rows, size_t columns) {
    for (size_t j = 0; j < columns; j++) {
        double *x = m + j * rows;
        const double before = sqrt(gonio_dot(rows, x, x));
        for (int pass = 0; pass < 2; pass++) {
            for (size_t i = 0; i < j; i++) {
                gonio_add_scaled(rows, -gonio_dot(rows, m + i * rows, x), m + i * rows, x);
            }
        }
        const double length = sqrt(gonio_dot(rows, x, x));
        const double scale = length > 1e-14 * before && length > 0 ? 1 / length : 0;
        for (size_t i = 0; i < rows; i++) {
            x[i] *= scale;
        }
    }
}

// y = A z, or z = A^T y; the squares of all elements by the way.
static void pass(search *s, bool transposed) {
    const size_t rows = s->a->rows, columns = s->a->columns, l = s->l;
    if (transposed) {
        memset(s->z, 0, l * columns * sizeof *s->z);
    }
    s->squares = 0;
    for (size_t from = 0; from < rows; from += BLOCK) {
        const size_t n = rows - from < BLOCK ? rows - from : BLOCK;
        for (size_t j = 0; j < n; j++) {
            s->a->row(s->a->context, from + j, s->block + j * columns);
        }
        for (size_t j = 0; j < n; j++) {
            s->squares += gonio_dot(columns, s->block + j * columns, s->block + j * columns);
        }
        const gonio_matrix rows_t = gonio_matrix_of(s->block, columns, n); // of A's rows, one a column
        const gonio_matrix y = gonio_matrix_part(gonio_matrix_of(s->y, rows, l), from, 0, n, l);
        const gonio_matrix z = gonio_matrix_of(s->z, columns, l);
        if (transposed) {
            gonio_multiply(1, rows_t, y, 1, z);
        } else {
            gonio_multiply(1, gonio_matrix_transposed(rows_t), z, 0, y);
        }
    }
}

// Of z = A^T y with orthonormal y: z = v value w^T, and y w is u.
static bool take(search *s, gonio_products *out) {
    const size_t rows = s->a->rows, columns = s->a->columns, l = s->l;
    const gonio_matrix z = gonio_matrix_of(s->z, columns, l);
    gonio_multiply(1, gonio_matrix_transposed(z), z, 0, gonio_matrix_of(s->small, l, l));
    if (!gonio_eigen(l, s->small, s->value)) {
        return false;
    }
    double found = 0;
    for (size_t j = 0; j < l; j++) {
        found += fmax(s->value[j], 0);
    }
    out->squares = s->squares;
    out->left = fmax(s->squares - found, 0);
    for (size_t j = 0; j < out->k; j++) {
        const double *w = s->small + (l - 1 - j) * l;
        double *u = out->u + j * rows, *v = out->v + j * columns;
        gonio_multiply(1, gonio_matrix_of(s->y, rows, l), gonio_matrix_of(w, l, 1), 0, gonio_matrix_of(u, rows, 1));
        gonio_multiply(1, z, gonio_matrix_of(w, l, 1), 0, gonio_matrix_of(v, columns, 1));
        const double length = sqrt(gonio_dot(columns, v, v));
        out->value[j] = length;
        for (size_t i = 0; i < columns; i++) {
            v[i] = length > 0 ? v[i] / length : 0;
        }
    }
    return true;
}

static bool allocate(search *s, gonio_products *out) {
    const size_t rows = s->a->rows, columns = s->a->columns, l = s->l;
    s->y = malloc(l * rows * sizeof *s->y);
    s->z = malloc(l * columns * sizeof *s->z);
    s->block = malloc(BLOCK * columns * sizeof *s->block);
    s->small = malloc(l * l * sizeof *s->small);
    s->value = malloc(l * sizeof *s->value);
    out->value = calloc(out->k, sizeof *out->value);
    out->u = calloc(out->k * rows, sizeof *out->u);
    out->v = calloc(out->k * columns, sizeof *out->v);
    return s->y != NULL && s->z != NULL && s->block != NULL && s->small != NULL && s->value != NULL &&
           out->value != NULL && out->u != NULL && out->v != NULL;
}

void gonio_products_free(gonio_products *p) {
    free(p->value);
    free(p->u);
    free(p->v);
    *p = (gonio_products){0};
}

gonio_status gonio_products_find(const gonio_row_source *a, size_t k, int passes, gonio_products *out,
                                 gonio_error *error) {
    const size_t least = a->rows < a->columns ? a->rows : a->columns;
    *out = (gonio_products){.rows = a->rows, .columns = a->columns, .k = k < least ? k : least};
    search s = {.a = a, .l = least > WHOLE && out->k + OVER < least ? out->k + OVER : least};
    gonio_status status = GONIO_OK;
    if (out->k == 0 || !allocate(&s, out)) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to separate a matrix of %zu x %zu", a->rows, a->columns);
    } else {
        for (size_t i = 0; i < s.l * a->columns; i++) {
            s.z[i] = gonio_random_uniform(i) - 0.5;
        }
        for (int p = 0; p < passes; p++) {
            pass(&s, false);
            orthonormalise(s.y, a->rows, s.l);
            pass(&s, true);
            if (p + 1 < passes) {
                orthonormalise(s.z, a->columns, s.l);
            }
        }
        if (!take(&s, out)) {
            status = gonio_fail(error, GONIO_E_CONVERGENCE, "no singular values of a matrix of %zu x %zu", a->rows,
                                a->columns);
        }
    }
    free(s.value);
    free(s.small);
    free(s.block);
    free(s.z);
    free(s.y);
    if (status != GONIO_OK) {
        gonio_products_free(out);
    }
    return status;
}
