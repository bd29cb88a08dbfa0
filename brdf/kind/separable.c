// SPDX-License-Identifier: BSD-3-Clause
// k-separable BRDFs, DeYoung, "Properties of tabulated bidirectional reflectance distribution functions" (1996),
// section 4.2.4, eq. 4.11 to 4.20 and 5.13, 5.14: with A[p][q] the table as a matrix,
//   A = sum over j = 1 .. k of u_j(p) v_j(q),
// the first k terms of its singular value decomposition, so the nearest matrix of rank k. p are the nodes of the
// incident and q those of the outgoing direction, whose azimuth is counted from the incident one's; or, Kautz and
// McCool, "Interactive rendering with arbitrary BRDFs using separable approximations" (1999), p the half vector's and q
// the difference vector's, where a lobe is a function of p alone and k stays small. Between nodes each factor is
// linear, and so the product is what the whole table of the products would be (brdf/kind/table.c) at the price of k (2
// + 4) numbers, or k (4 + 4) in four dimensions. What is summed is transformed values: f_r itself in the linear domain,
// as in both texts; logarithms in the log domain, where a sum is a product of k factors.
#include "brdf/kind/separable.h"

#include <stdlib.h>
#include <string.h>

#include "brdf/grid/grid_model.h"

typedef struct separable_model {
    gonio_grid_model base;
    int terms;
    const float *left, *right;
} separable_model;

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const separable_model *m = (const separable_model *)model;
    const size_t channels = (size_t)model->channels, row = (size_t)m->terms * channels;
    size_t at[4];
    double x[4], weights[4], u[row], v[row], sums[channels];
    gonio_grid_locate(&m->base.grid, wi, wo, x);
    int n = gonio_grid_rows(&m->base.grid, x, at, weights);
    gonio_grid_sum(m->left, row, n, at, weights, u);
    n = gonio_grid_columns(&m->base.grid, x, at, weights);
    gonio_grid_sum(m->right, row, n, at, weights, v);
    memset(sums, 0, sizeof sums);
    for (size_t k = 0; k < row; k++) {
        sums[k % channels] += u[k] * v[k];
    }
    gonio_grid_invert(&m->base, sums, values);
}

static void release(gonio_model *model) {
    separable_model *m = (separable_model *)model;
    if (m->base.channels.mapped.base == NULL) {
        free((void *)(uintptr_t)m->left);
        free((void *)(uintptr_t)m->right);
    }
    gonio_channels_free(&m->base.channels);
}

static size_t left_floats(const gonio_grid *grid, int terms, int channels) {
    return grid->count / gonio_grid_columns_n(grid) * (size_t)terms * (size_t)channels;
}

static size_t right_floats(const gonio_grid *grid, int terms, int channels) {
    return gonio_grid_columns_n(grid) * (size_t)terms * (size_t)channels;
}

static gonio_status save(const gonio_model *model, FILE *stream, gonio_error *error) {
    const separable_model *m = (const separable_model *)model;
    const gonio_grid *grid = &m->base.grid;
    gonio_grid_description about = gonio_grid_describe(&m->base);
    about.own[0] = (uint32_t)m->terms;
    const gonio_file_part parts[] = {
        {&about, sizeof about},
        {m->base.channels.transforms, (size_t)model->channels * sizeof(gonio_transform)},
        {m->left, left_floats(grid, m->terms, model->channels) * sizeof(float)},
        {m->right, right_floats(grid, m->terms, model->channels) * sizeof(float)},
    };
    return gonio_model_file_write(model, stream, parts, 4, error);
}

static const gonio_model_ops ops = {.kind = "separable", .eval = eval, .save = save, .free = release};

static void finish(separable_model *m, int terms, const float *left, const float *right) {
    gonio_model *head = &m->base.channels.head;
    m->terms = terms;
    m->left = left;
    m->right = right;
    head->control_points = left_floats(&m->base.grid, terms, 1) + right_floats(&m->base.grid, terms, 1);
    head->bytes += head->control_points * (size_t)head->channels * sizeof(float);
}

gonio_status gonio_separable_new(const gonio_separable_parts *p, gonio_model **out, gonio_error *error) {
    const size_t left_bytes = left_floats(&p->grid, p->terms, p->channels) * sizeof(float);
    const size_t right_bytes = right_floats(&p->grid, p->terms, p->channels) * sizeof(float);
    float *left = malloc(left_bytes), *right = malloc(right_bytes);
    void *model;
    gonio_status status = left != NULL && right != NULL
                              ? gonio_grid_model_new(sizeof(separable_model), &ops, &p->grid, p->channels, p->kind,
                                                     p->transforms, p->names, &model, error)
                              : gonio_fail(error, GONIO_E_MEMORY, "no memory for %d products of tables", p->terms);
    *out = NULL;
    if (status != GONIO_OK) {
        free(left);
        free(right);
        return status;
    }
    memcpy(left, p->left, left_bytes);
    memcpy(right, p->right, right_bytes);
    finish(model, p->terms, left, right);
    *out = model;
    return GONIO_OK;
}

static gonio_status read_model(gonio_mapped *mapped, gonio_model **out, gonio_error *error) {
    const gonio_grid_description *about;
    void *model;
    size_t at = 0;
    const gonio_status status =
        gonio_grid_model_read(mapped, sizeof(separable_model), &ops, &at, &about, &model, error);
    if (status != GONIO_OK) {
        return status;
    }
    separable_model *m = model;
    const bool possible = about->own[0] >= 1 && about->own[0] <= GONIO_SEPARABLE_TERMS_MAX;
    const int terms = possible ? (int)about->own[0] : 1;
    const size_t factors_at = at;
    const float *left =
        gonio_mapped_take(mapped, &at, left_floats(&m->base.grid, terms, mapped->channels) * sizeof(float));
    const float *right =
        left != NULL
            ? gonio_mapped_take(mapped, &at, right_floats(&m->base.grid, terms, mapped->channels) * sizeof(float))
            : NULL;
    if (!possible || right == NULL) {
        gonio_channels_free(&m->base.channels);
        return gonio_mapped_fail(mapped, possible ? factors_at : 0,
                                 possible ? "fewer numbers than its products need" : "an impossible number of products",
                                 error);
    }
    finish(m, terms, left, right);
    gonio_channels_adopt(&m->base.channels, mapped);
    *out = &m->base.channels.head;
    return GONIO_OK;
}

const gonio_kind gonio_kind_separable = {
    .name = "separable",
    .summary = "sums of products of two tables, of either direction or of half and difference vector",
    .ops = &ops,
    .read = read_model,
};
