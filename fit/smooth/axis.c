// SPDX-License-Identifier: BSD-3-Clause
// The modes of an axis (fit/smooth/axis.h).
#include "fit/smooth/axis.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "brdf/spline/bspline.h"
#include "fit/smooth/matrix.h"

static void second_differences(double *gram, size_t m) {
    static const double stencil[3] = {1, -2, 1};
    memset(gram, 0, m * m * sizeof *gram);
    for (size_t r = 0; r + 2 < m; r++) {
        for (size_t i = 0; i < 3; i++) {
            for (size_t j = 0; j < 3; j++) {
                gram[(r + i) * m + r + j] += stencil[i] * stencil[j];
            }
        }
    }
}

// The null space (constant and linear) comes out of the eigensolver in any mixture; parity needs it pure.
static void purify_null_space(double *modes, double *stiffness, size_t m) {
    const double middle = 0.5 * (double)(m - 1);
    double norm = 0;
    for (size_t i = 0; i < m; i++) {
        norm += ((double)i - middle) * ((double)i - middle);
    }
    for (size_t i = 0; i < m; i++) {
        modes[i] = 1 / sqrt((double)m);
        modes[m + i] = ((double)i - middle) / sqrt(norm);
    }
    stiffness[0] = stiffness[1] = 0;
}

static void find_parity(gonio_smooth_axis *axis) {
    for (size_t j = 0; j < axis->m; j++) {
        const double *v = axis->modes + j * axis->m;
        double symmetry = 0;
        for (size_t i = 0; i < axis->m; i++) {
            symmetry += v[i] * v[axis->m - 1 - i];
        }
        axis->odd[j] = symmetry < 0;
    }
}

gonio_status gonio_smooth_axis_init(gonio_smooth_axis *axis, int level, gonio_error *error) {
    const size_t m = gonio_bspline_size(level);
    *axis = (gonio_smooth_axis){.level = level,
                                .m = m,
                                .modes = malloc(m * m * sizeof(double)),
                                .stiffness = malloc(m * sizeof(double)),
                                .odd = malloc(m * sizeof(bool))};
    if (axis->modes == NULL || axis->stiffness == NULL || axis->odd == NULL) {
        gonio_smooth_axis_release(axis);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu modes", m);
    }
    second_differences(axis->modes, m);
    if (!gonio_eigen(m, axis->modes, axis->stiffness)) {
        gonio_smooth_axis_release(axis);
        return gonio_fail(error, GONIO_E_CONVERGENCE, "the penalty's eigenvectors were not found");
    }
    purify_null_space(axis->modes, axis->stiffness, m);
    find_parity(axis);
    for (size_t j = 0; j < m; j++) {
        axis->stiffness[j] *= ldexp(1, level);
    }
    return GONIO_OK;
}

void gonio_smooth_axis_release(gonio_smooth_axis *axis) {
    free(axis->modes);
    free(axis->stiffness);
    free(axis->odd);
    *axis = (gonio_smooth_axis){0};
}

void gonio_smooth_axis_features(const gonio_smooth_axis *axis, size_t count, const double *x, size_t stride,
                                double *feature) {
    for (size_t i = 0; i < count; i++) {
        const uint32_t fixed = gonio_bspline_fix(x[i * stride]);
        const uint32_t cell = gonio_bspline_cell(fixed, axis->level);
        double w[4];
        gonio_bspline_weights(gonio_bspline_place(fixed, axis->level), w);
        for (size_t j = 0; j < axis->m; j++) {
            const double *v = axis->modes + j * axis->m + cell;
            feature[j * count + i] = w[0] * v[0] + w[1] * v[1] + w[2] * v[2] + w[3] * v[3];
        }
    }
}

void gonio_smooth_axis_transform(const gonio_smooth_axis *axis, size_t outer, size_t inner, const double *from,
                                 double *to) {
    const size_t m = axis->m;
    for (size_t o = 0; o < outer; o++) {
        // `inner` runs fastest, so both blocks are transposed: (inner x points) = (inner x modes) modes^T.
        gonio_multiply(1, gonio_matrix_of(from + o * m * inner, inner, m),
                       gonio_matrix_transposed(gonio_matrix_of(axis->modes, m, m)), 0,
                       gonio_matrix_of(to + o * m * inner, inner, m));
    }
}
