// SPDX-License-Identifier: BSD-3-Clause
// Homomorphic factorisation, McCool, Ang and Ahmad, "Homomorphic factorization of BRDFs for high-performance rendering"
// (2001), of which Kameya (2002), section 3.5, tells:
//   f_r(wi, wo) = p(wi) q(h) p(wo),   ln f_r = ln p(wi) + ln q(h) + ln p(wo),
// reciprocal as it stands. p and q are tables of their logarithms over the nodes of tilt and azimuth (brdf/grid/grid.h:
// the rows of the grids of angles and of half-angles), linear between them; of an isotropic material both are functions
// of the tilt alone, and the whole model is a hundred numbers. What is summed is transformed values, whose logarithm
// has a floor where f_r is 0.
#include "brdf/kind/homomorphic.h"

#include <stdlib.h>
#include <string.h>

#include "brdf/grid/grid_model.h"

typedef struct homomorphic_model {
    gonio_grid_model base;
    const float *factors;
} homomorphic_model;

size_t gonio_homomorphic_rows(int dims, int level) {
    const gonio_grid grid = gonio_grid_of(GONIO_GRID_ANGLES, dims, level);
    return grid.count / gonio_grid_columns_n(&grid);
}

int gonio_homomorphic_row(int dims, int level, gonio_vec3 wi, gonio_vec3 wo, size_t at[12], double weights[12]) {
    const gonio_grid angles = gonio_grid_of(GONIO_GRID_ANGLES, dims, level);
    const gonio_grid halves = gonio_grid_of(GONIO_GRID_HALF_ANGLES, dims, level);
    double x[4];
    gonio_grid_locate(&angles, wi, wo, x);
    int n = gonio_grid_rows(&angles, x, at, weights);
    gonio_grid_locate(&angles, wo, wi, x);
    n += gonio_grid_rows(&angles, x, at + n, weights + n);
    gonio_grid_locate(&halves, wi, wo, x);
    const int q = gonio_grid_rows(&halves, x, at + n, weights + n);
    for (int k = n; k < n + q; k++) {
        at[k] += angles.count / gonio_grid_columns_n(&angles);
    }
    return n + q;
}

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const homomorphic_model *m = (const homomorphic_model *)model;
    size_t at[12];
    double weights[12], sums[model->channels];
    const int n = gonio_homomorphic_row(m->base.grid.dims, m->base.grid.level, wi, wo, at, weights);
    gonio_grid_sum(m->factors, (size_t)model->channels, n, at, weights, sums);
    gonio_grid_invert(&m->base, sums, values);
}

static void release(gonio_model *model) {
    homomorphic_model *m = (homomorphic_model *)model;
    if (m->base.channels.mapped.base == NULL) {
        free((void *)(uintptr_t)m->factors);
    }
    gonio_channels_free(&m->base.channels);
}

static size_t factor_bytes(const gonio_grid *grid, int channels) {
    return 2 * gonio_homomorphic_rows(grid->dims, grid->level) * (size_t)channels * sizeof(float);
}

static gonio_status save(const gonio_model *model, FILE *stream, gonio_error *error) {
    const homomorphic_model *m = (const homomorphic_model *)model;
    const gonio_grid_description about = gonio_grid_describe(&m->base);
    const gonio_file_part parts[] = {
        {&about, sizeof about},
        {m->base.channels.transforms, (size_t)model->channels * sizeof(gonio_transform)},
        {m->factors, factor_bytes(&m->base.grid, model->channels)},
    };
    return gonio_model_file_write(model, stream, parts, 3, error);
}

static const gonio_model_ops ops = {.kind = "homomorphic", .eval = eval, .save = save, .free = release};

static void finish(homomorphic_model *m, const float *factors) {
    gonio_model *head = &m->base.channels.head;
    const size_t bytes = factor_bytes(&m->base.grid, head->channels);
    m->factors = factors;
    head->control_points = bytes / sizeof(float) / (size_t)head->channels;
    head->bytes += bytes;
}

gonio_status gonio_homomorphic_new(const gonio_homomorphic_parts *p, gonio_model **out, gonio_error *error) {
    const gonio_grid grid = gonio_grid_of(GONIO_GRID_HALF_ANGLES, p->dims, p->level);
    const size_t bytes = factor_bytes(&grid, p->channels);
    float *factors = malloc(bytes);
    void *model;
    const gonio_status status = factors != NULL
                                    ? gonio_grid_model_new(sizeof(homomorphic_model), &ops, &grid, p->channels, p->kind,
                                                           p->transforms, p->names, &model, error)
                                    : gonio_fail(error, GONIO_E_MEMORY, "no memory for factors of %zu bytes", bytes);
    *out = NULL;
    if (status != GONIO_OK) {
        free(factors);
        return status;
    }
    memcpy(factors, p->factors, bytes);
    finish(model, factors);
    *out = model;
    return GONIO_OK;
}

static gonio_status read_model(gonio_mapped *mapped, gonio_model **out, gonio_error *error) {
    const gonio_grid_description *about;
    void *model;
    size_t at = 0;
    const gonio_status status =
        gonio_grid_model_read(mapped, sizeof(homomorphic_model), &ops, &at, &about, &model, error);
    if (status != GONIO_OK) {
        return status;
    }
    homomorphic_model *m = model;
    const size_t factors_at = at;
    const float *factors = gonio_mapped_take(mapped, &at, factor_bytes(&m->base.grid, mapped->channels));
    if (factors == NULL) {
        gonio_channels_free(&m->base.channels);
        return gonio_mapped_fail(mapped, factors_at, "fewer numbers than its factors need", error);
    }
    finish(m, factors);
    gonio_channels_adopt(&m->base.channels, mapped);
    *out = &m->base.channels.head;
    return GONIO_OK;
}

const gonio_kind gonio_kind_homomorphic = {
    .name = "homomorphic",
    .summary = "a function of either direction, the same for both, times one of the half vector",
    .ops = &ops,
    .read = read_model,
};
