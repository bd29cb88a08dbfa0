// SPDX-License-Identifier: BSD-3-Clause
// A lab's models -> a library.
//
// Each channel of each model is a column of z (fit/library/library.h) at the nodes of a grid. Principal components come
// from the columns' Gram matrix, which is small. What they leave of a material that they were not learnt from, how much
// sigma must be widened and how large residuals of the library's own kind get is seen on materials that are left out: a
// part of them in its turn, and fitted from a few poses by what the others taught.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/statistics.h"
#include "base/thread_pool.h"
#include "fit/library/learn.h"
#include "fit/smooth/matrix.h"
#include "fit/tables/grid_method.h"

#define PARTS 4        // materials are left out in
#define RIDGE 1e-3     // variance of z, of a projection on components
#define REST_MIN 0.005 // standard deviation of z that no component explains, at least
#define VALUE_MAX 1e6  // 1/sr: beyond it a peak is a mirror's

static bool learn_go_on(const gonio_library_options *o, double fraction, const char *what) {
    return o->progress == NULL || o->progress(o->progress_context, fraction, what, NAN);
}

// ---- columns ----

// Nodes that hold two directions above the horizon: the others follow their neighbours, and do not count.
gonio_pair gonio_library_node(const gonio_grid *grid, size_t node, bool *real) {
    gonio_vec3 wi, wo;
    gonio_grid_node(grid, node, &wi, &wo);
    gonio_pair pair = gonio_pair_from_vectors(wi, wo);
    const double limit = gonio_radians(LIBRARY_THETA_MAX_DEG);
    *real = pair.theta_i <= limit && pair.theta_o <= limit;
    pair.theta_i = fmin(pair.theta_i, limit);
    pair.theta_o = fmin(pair.theta_o, limit);
    return pair;
}

typedef struct reading {
    learning *l;
    const gonio_model *const *models;
} reading;

// ln(f w + eps) of every column at a node.
static gonio_status read_node(void *context, size_t node, gonio_error *error) {
    const reading *r = context;
    learning *l = r->l;
    double values[GONIO_CHANNELS_MAX];
    bool real;
    const gonio_pair pair = gonio_library_node(&l->grid, node, &real);
    const gonio_vec3 wi = gonio_direction(pair.theta_i, pair.phi_i), wo = gonio_direction(pair.theta_o, pair.phi_o);
    const double weight = fmax(wi.z * wo.z, LIBRARY_EPS);
    l->real[node] = real;
    (void)error;
    for (size_t i = 0, column = 0; i < l->models; column += (size_t)r->models[i++]->channels) {
        gonio_model_eval(r->models[i], wi, wo, values);
        for (int c = 0; c < r->models[i]->channels; c++) {
            const double f = isfinite(values[c]) ? fmin(fmax(values[c], 0), VALUE_MAX) : VALUE_MAX;
            l->z[(column + (size_t)c) * l->nodes + node] = log(f * weight + LIBRARY_EPS);
        }
    }
    return GONIO_OK;
}

// The median over the columns, which z is relative to.
static gonio_status take_reference(learning *l, gonio_error *error) {
    double *work = malloc((l->columns + 1) * sizeof *work);
    if (work == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to learn");
    }
    for (size_t node = 0; node < l->nodes; node++) {
        for (size_t c = 0; c < l->columns; c++) {
            work[c] = l->z[c * l->nodes + node];
        }
        l->reference[node] = gonio_median(work, l->columns);
        for (size_t c = 0; c < l->columns; c++) {
            l->z[c * l->nodes + node] -= l->reference[node];
        }
    }
    free(work);
    return GONIO_OK;
}

static void gram_row(void *context, size_t i) {
    const learning *l = context;
    const double *a = l->z + i * l->nodes;
    for (size_t j = 0; j <= i; j++) {
        const double *b = l->z + j * l->nodes;
        double sum[4] = {0};
        for (size_t k = 0; k < l->real_n; k++) {
            const size_t node = l->real_nodes[k];
            sum[k % 4] += a[node] * b[node];
        }
        l->gram[i * l->columns + j] = l->gram[j * l->columns + i] = sum[0] + sum[1] + sum[2] + sum[3];
    }
}

void gonio_learning_release(learning *l) {
    free(l->z);
    free(l->reference);
    free(l->gram);
    free(l->real);
    free(l->real_nodes);
    free(l->model_of);
    *l = (learning){0};
}

static gonio_status read_models(learning *l, const gonio_model *const *models, size_t n, int threads,
                                gonio_error *error) {
    l->grid = gonio_grid_of(GONIO_GRID_HALF_ANGLES, 3, LIBRARY_LEVEL);
    l->nodes = l->grid.count;
    l->models = n;
    for (size_t i = 0; i < n; i++) {
        l->columns += (size_t)models[i]->channels;
    }
    l->z = malloc(l->columns * l->nodes * sizeof *l->z);
    l->reference = malloc(l->nodes * sizeof *l->reference);
    l->gram = malloc(l->columns * l->columns * sizeof *l->gram);
    l->real = malloc(l->nodes * sizeof *l->real);
    l->real_nodes = malloc(l->nodes * sizeof *l->real_nodes);
    l->model_of = malloc(l->columns * sizeof *l->model_of);
    if (l->z == NULL || l->reference == NULL || l->gram == NULL || l->real == NULL || l->real_nodes == NULL ||
        l->model_of == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to learn from %zu models", n);
    }
    for (size_t i = 0, column = 0; i < n; i++) {
        for (int c = 0; c < models[i]->channels; c++) {
            l->model_of[column++] = i;
        }
    }
    reading r = {l, models};
    gonio_status status = gonio_pool_try(threads, l->nodes, read_node, &r, error);
    status = status == GONIO_OK ? take_reference(l, error) : status;
    for (size_t node = 0; node < l->nodes; node++) {
        l->real_nodes[l->real_n] = node;
        l->real_n += l->real[node];
    }
    if (status == GONIO_OK) {
        gonio_pool_for(threads, l->columns, gram_row, l);
    }
    return status;
}

// ---- components ----

// The Gram matrix of the kept columns about their mean, and its eigenvectors in `vectors` [kept x kept].
static gonio_status decompose(const learning *l, const size_t *kept, size_t n, double *vectors, double *values,
                              gonio_error *error) {
    double *mean = calloc(n + 1, sizeof *mean), all = 0;
    if (mean == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to learn");
    }
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++) {
            vectors[j * n + i] = l->gram[kept[i] * l->columns + kept[j]];
            mean[i] += vectors[j * n + i] / (double)n;
        }
        all += mean[i] / (double)n;
    }
    for (size_t i = 0; i < n * n; i++) {
        vectors[i] += all - mean[i % n] - mean[i / n];
    }
    free(mean);
    return gonio_eigen(n, vectors, values) ? GONIO_OK
                                           : gonio_fail(error, GONIO_E_CONVERGENCE, "no components were found");
}

// b_k = sum_j (z_j - mean) v_jk / sqrt(n - 1): the sign is that of the largest weight, so that no bit is left open.
static void fill_components(const learning *l, const size_t *kept, size_t n, const double *vectors,
                            gonio_library *out) {
    const size_t rank = (size_t)out->rank;
    for (size_t j = 0; j < n; j++) {
        const double *column = l->z + kept[j] * l->nodes;
        for (size_t node = 0; node < l->nodes; node++) {
            out->mean[node] += column[node] / (double)n;
        }
    }
    for (size_t k = 0; k < rank; k++) {
        const double *vector = vectors + (n - 1 - k) * n;
        size_t largest = 0;
        for (size_t j = 1; j < n; j++) {
            largest = fabs(vector[j]) > fabs(vector[largest]) ? j : largest;
        }
        const double unit = (vector[largest] < 0 ? -1 : 1) / sqrt((double)n - 1);
        for (size_t j = 0; j < n; j++) {
            const double *column = l->z + kept[j] * l->nodes, weight = vector[j] * unit;
            for (size_t node = 0; node < l->nodes; node++) {
                out->components[node * rank + k] += weight * (column[node] - out->mean[node]);
            }
        }
    }
}

static size_t keep(const learning *l, size_t left_out, size_t *kept) {
    size_t n = 0;
    for (size_t c = 0; c < l->columns; c++) {
        if (left_out >= PARTS || l->model_of[c] % PARTS != left_out) {
            kept[n++] = c;
        }
    }
    return n;
}

gonio_status gonio_learning_components(const learning *l, size_t left_out, int rank, gonio_library **out,
                                       gonio_error *error) {
    size_t *kept = malloc((l->columns + 1) * sizeof *kept);
    double *vectors = malloc(l->columns * (l->columns + 1) * sizeof *vectors);
    gonio_status status = GONIO_OK;
    if (kept == NULL || vectors == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to learn");
    } else {
        const size_t n = keep(l, left_out, kept);
        const int most = n > 2 ? (int)n - 2 : 1;
        status = decompose(l, kept, n, vectors, vectors + l->columns * l->columns, error);
        status = status == GONIO_OK
                     ? gonio_library_new(rank < most ? rank : most, left_out < PARTS ? 0 : (int)l->models, out, error)
                     : status;
        if (status == GONIO_OK) {
            fill_components(l, kept, n, vectors, *out);
            memcpy((*out)->reference, l->reference, l->nodes * sizeof *l->reference);
        }
    }
    free(kept);
    free(vectors);
    return status;
}

// ---- what components leave ----

// Of a column that the components were not learnt from: the squares of what a ridge projection leaves, added up.
static gonio_status add_rest(const learning *l, const gonio_library *part, size_t column, double *squares, double *sums,
                             gonio_error *error) {
    const size_t rank = (size_t)part->rank;
    double *normal = calloc(rank * (rank + 1), sizeof *normal);
    if (normal == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to learn");
    }
    double *right = normal + rank * rank;
    const double *z = l->z + column * l->nodes;
    for (size_t k = 0; k < l->real_n; k++) {
        const size_t node = l->real_nodes[k];
        const double *b = part->components + node * rank;
        gonio_add_scaled(rank, z[node] - part->mean[node], b, right);
        for (size_t j = 0; j < rank; j++) {
            gonio_add_scaled(rank - j, b[j], b + j, normal + j * rank + j);
        }
    }
    for (size_t j = 0; j < rank; j++) {
        normal[j * rank + j] += RIDGE * (double)l->real_n / (double)rank;
    }
    const bool solved = gonio_cholesky(rank, normal);
    if (solved) {
        gonio_cholesky_solve(rank, normal, gonio_matrix_of(right, rank, 1));
    }
    for (size_t node = 0; solved && node < l->nodes; node++) {
        const double centred = z[node] - part->mean[node];
        const double left = centred - gonio_dot(rank, part->components + node * rank, right);
        squares[node] += left * left;
        sums[0] += l->real[node] ? left * left : 0;
        sums[1] += l->real[node] ? centred * centred : 0;
    }
    free(normal);
    return solved ? GONIO_OK : gonio_fail(error, GONIO_E_CONVERGENCE, "no components were found");
}

static gonio_status learn_rest(const learning *l, gonio_library *const *parts, gonio_library *out, gonio_error *error) {
    double sums[2] = {0};
    gonio_status status = GONIO_OK;
    for (size_t c = 0; c < l->columns && status == GONIO_OK; c++) {
        status = add_rest(l, parts[l->model_of[c] % PARTS], c, out->rest, sums, error);
    }
    for (size_t node = 0; node < l->nodes; node++) {
        out->rest[node] = fmax(sqrt(out->rest[node] / (double)l->columns), REST_MIN);
    }
    out->facts.explained = sums[1] > 0 ? 1 - sums[0] / sums[1] : 1;
    for (size_t p = 0; p < PARTS; p++) {
        memcpy(parts[p]->rest, out->rest, l->nodes * sizeof *out->rest);
    }
    return status;
}

static gonio_status interpolate(gonio_library *l, gonio_error *error) {
    gonio_status status = gonio_grid_interpolate(&l->grid, 1, l->mean, error);
    status = status == GONIO_OK ? gonio_grid_interpolate(&l->grid, 1, l->reference, error) : status;
    return status == GONIO_OK ? gonio_grid_interpolate(&l->grid, l->rank, l->components, error) : status;
}

// ---- all of it ----

static gonio_status check(const gonio_model *const *models, const char *const *names, size_t n, gonio_error *error) {
    if (n < GONIO_LIBRARY_MODELS_MIN) {
        return gonio_fail(error, GONIO_E_INPUT, "%zu models; a prior is learnt from %d at least", n,
                          GONIO_LIBRARY_MODELS_MIN);
    }
    for (size_t i = 0; i < n; i++) {
        if (!models[i]->isotropic) {
            return gonio_fail(error, GONIO_E_INPUT, "%.200s is anisotropic; a prior is of isotropic reflection",
                              names[i]);
        }
    }
    return GONIO_OK;
}

// The library, and those of which a part of the materials is left out.
static gonio_status learn_all(learning *l, const gonio_library_options *o, gonio_library *parts[PARTS + 1],
                              gonio_error *error) {
    const int rank = o->rank > 0 ? o->rank : LIBRARY_RANK_MAX;
    gonio_status status = GONIO_OK;
    for (size_t p = 0; p <= PARTS && status == GONIO_OK; p++) {
        status = gonio_learning_components(l, p, rank, &parts[p], error);
        if (status == GONIO_OK && !learn_go_on(o, 0.3 + 0.1 * (double)p, "components")) {
            status = gonio_fail(error, GONIO_E_INTERRUPTED, "interrupted; nothing was written");
        }
    }
    status = status == GONIO_OK ? learn_rest(l, parts, parts[PARTS], error) : status;
    for (size_t p = 0; p <= PARTS && status == GONIO_OK; p++) {
        status = interpolate(parts[p], error);
    }
    return status;
}

gonio_status gonio_library_learn(const gonio_model *const *models, const char *const *names, size_t n,
                                 const gonio_library_options *options, gonio_library **out, gonio_error *error) {
    learning l = {0};
    gonio_library *parts[PARTS + 1] = {0};
    *out = NULL;
    gonio_status status = check(models, names, n, error);
    if (status == GONIO_OK && !learn_go_on(options, 0, "models")) {
        status = gonio_fail(error, GONIO_E_INTERRUPTED, "interrupted; nothing was written");
    }
    status = status == GONIO_OK ? read_models(&l, models, n, options->threads, error) : status;
    status = status == GONIO_OK ? learn_all(&l, options, parts, error) : status;
    status = status == GONIO_OK ? gonio_library_try(models, n, PARTS, parts, options, parts[PARTS], error) : status;
    if (status == GONIO_OK) {
        *out = parts[PARTS];
        parts[PARTS] = NULL;
        (*out)->facts.columns = (int)l.columns;
        for (size_t i = 0; i < n; i++) {
            snprintf((*out)->names[i], LIBRARY_NAME_MAX, "%s", names[i]);
        }
    }
    for (size_t p = 0; p <= PARTS; p++) {
        gonio_library_free(parts[p]);
    }
    gonio_learning_release(&l);
    return status;
}
