// Where and how far a model may be wrong.
//
// Small sets: the smoothing prior makes the fit a Gaussian process (Rasmussen & Williams 2006, "Gaussian processes for
// machine learning", eqs. 2.26 and 5.12), whose variance grows with the distance from the samples. Its scale is not
// believed but measured: leave-one-out residuals, divided by their own predicted spread, give a factor that varies
// slowly over the domain, since measured BRDFs are rougher near the peak and the horizon. What the samples' own
// uncertainty explains of the residuals is noise in the samples, not an error of the model, and is taken off.
//
// Large sets: the local spread of the residuals on the geometries that the inner fit did not see; where there are none,
// the spread of all that the spline had to describe.
//
// The result, ln sigma in the link's units, is a coarse spline; a channel's share is a factor.
#include "fit/uncertainty.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SIGMA_LEVEL_3D 3
#define SIGMA_LEVEL_4D 2
#define WINDOW 0.08       // standard deviation, in coordinates, of the window over which residuals are averaged
#define PRIOR_SAMPLES 4.0 // weight of the global spread beside the local one
#define MEAN_OF_NORMAL 0.7978845608028654 // mean |x| of a standard normal, sqrt(2/pi)
#define SHARE_MIN 0.05 // of the independent part of the residuals that stays with the model, if all looks like noise
#define SHARE_UNKNOWN                                                                                                  \
    0.1 // the same for samples that do not tell their noise: most of what does not vary smoothly is it
#define MEDIAN_OF_NORMAL 0.6744897501960817

typedef struct nodes {
    int level, dims;
    size_t side, count; // 2^level + 1 an axis
    double *x;          // count x dims
    double *sigma;      // [count]
} nodes;

static void nodes_release(nodes *g) {
    free(g->x);
    free(g->sigma);
}

static gonio_status nodes_init(nodes *g, int dims, gonio_error *error) {
    *g = (nodes){.level = dims == 3 ? SIGMA_LEVEL_3D : SIGMA_LEVEL_4D, .dims = dims, .count = 1};
    g->side = ((size_t)1 << g->level) + 1;
    for (int d = 0; d < dims; d++) {
        g->count *= g->side;
    }
    g->x = malloc(g->count * (size_t)dims * sizeof *g->x);
    g->sigma = malloc(g->count * sizeof *g->sigma);
    if (g->x == NULL || g->sigma == NULL) {
        nodes_release(g);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    for (size_t i = 0; i < g->count; i++) {
        size_t rest = i;
        for (int d = dims - 1; d >= 0; d--, rest /= g->side) {
            g->x[i * (size_t)dims + (size_t)d] = (double)(rest % g->side) / (double)(g->side - 1);
        }
    }
    return GONIO_OK;
}

// Node values -> control points: each stands on its node, the outermost repeat the border's. Smooths a little, never
// overshoots.
static gonio_status nodes_to_lattice(const nodes *g, gonio_lattice *lattice, gonio_error *error) {
    const gonio_status status = gonio_lattice_init(lattice, g->dims, g->level, 1, error);
    for (size_t i = 0; i < lattice->count && status == GONIO_OK; i++) {
        size_t rest = i, node = 0, step = 1;
        for (int d = g->dims - 1; d >= 0; d--, rest /= lattice->size, step *= g->side) {
            const size_t at = rest % lattice->size, k = at == 0 ? 0 : at - 1;
            node += step * (k < g->side ? k : g->side - 1);
        }
        lattice->points[i] = (float)log(fmax(g->sigma[node], 1e-30));
    }
    return status;
}

static int by_value(const void *left, const void *right) {
    const double a = *(const double *)left, b = *(const double *)right;
    return (a > b) - (a < b);
}

// A channel's spread: the standard deviation of a normal with the same median |residual|.
static void channel_factors(size_t n, size_t c, const double *residuals, double *factor, double *work) {
    for (size_t k = 0; k < c; k++) {
        double squares = 0;
        for (size_t i = 0; i < n; i++) {
            work[i] = fabs(residuals[i * c + k]);
            squares += work[i] * work[i];
        }
        qsort(work, n, sizeof *work, by_value);
        // A median of 0 (clamped zeros) is no spread.
        factor[k] = fmax(work[n / 2] / MEDIAN_OF_NORMAL, fmax(0.05 * sqrt(squares / (double)n), 1e-12));
    }
}

typedef struct field {
    size_t n, d;
    double *x;    // n x d
    double *size; // [n] |residual| in units of the channel's factor, mean over channels, over the mean of a normal
    unsigned mirror_axes;
} field;

static void field_release(field *f) {
    free(f->x);
    free(f->size);
}

static gonio_status field_init(field *f, const gonio_lsq_data *data, const gonio_lsq_form *form,
                               const double *residuals, const double *factor, gonio_error *error) {
    const size_t c = (size_t)data->channels;
    *f = (field){.n = data->n,
                 .d = (size_t)data->dims,
                 .x = malloc(data->n * (size_t)data->dims * sizeof(double)),
                 .size = calloc(data->n, sizeof(double)),
                 .mirror_axes = form->mirror ? gonio_lsq_mirror_axes(form->coordinates, data->dims) : 0};
    if (f->x == NULL || f->size == NULL) {
        field_release(f);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    gonio_lsq_data_locate(data, form->coordinates, f->x);
    for (size_t i = 0; i < f->n; i++) {
        for (size_t k = 0; k < c; k++) {
            f->size[i] += fabs(residuals[i * c + k]) / factor[k] / MEAN_OF_NORMAL / (double)c;
        }
    }
    return GONIO_OK;
}

// Squared distance to sample i, to the nearer of its two mirror images.
static double distance2(const field *f, size_t i, const double *at) {
    double same = 0, image = 0;
    for (size_t d = 0; d < f->d; d++) {
        const double x = f->x[i * f->d + d], y = (f->mirror_axes >> d & 1u) != 0 ? 1 - x : x;
        same += (x - at[d]) * (x - at[d]);
        image += (y - at[d]) * (y - at[d]);
    }
    return fmin(same, image);
}

// The local mean of the sizes about `at`; *near: how many samples it rests on.
static double local_size(const field *f, const double *at, double *near) {
    // Half the samples of a set of millions tell no more.
    const size_t step = 1 + f->n / 20000;
    double sum = PRIOR_SAMPLES, weight = PRIOR_SAMPLES;
    for (size_t i = 0; i < f->n; i += step) {
        const double k = exp(-0.5 * distance2(f, i, at) / (WINDOW * WINDOW));
        sum += k * f->size[i];
        weight += k;
    }
    *near = weight - PRIOR_SAMPLES;
    return sum / weight;
}

// The share of the residuals' variance at full weight that is not the samples' noise.
static double model_share(const gonio_lsq_data *data, const double *factor) {
    double share = 0;
    for (int k = 0; k < data->channels; k++) {
        const double noise = data->noise[k] / factor[k];
        share += (noise > 0 ? fmax(1 - noise * noise, SHARE_MIN) : SHARE_UNKNOWN) / data->channels;
    }
    return share;
}

static gonio_status attach(const nodes *g, double *factor, gonio_lobe_model_parts *parts, gonio_error *error) {
    const gonio_status status = nodes_to_lattice(g, &parts->sigma, error);
    if (status == GONIO_OK) {
        parts->sigma_factor = factor;
    }
    return status;
}

// Leave-one-out residuals of every channel with its own lambda, each divided by the spread that is expected of it.
static gonio_status standardised(const gonio_lsq_dense *dense, const gonio_lsq_data *data, const gonio_lsq_base *base,
                                 const double *lambdas, const double *own, double *out, gonio_error *error) {
    const size_t c = (size_t)data->channels;
    double *target = malloc(2 * data->n * sizeof *target);
    if (target == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    double *residual = target + data->n;
    gonio_status status = GONIO_OK;
    for (size_t k = 0; k < c && status == GONIO_OK; k++) {
        for (size_t i = 0; i < data->n; i++) {
            target[i] = base->rest[i * c + k];
        }
        status = gonio_lsq_dense_loo(dense, target, 1, 1, &lambdas[k], &residual, error);
        for (size_t i = 0; i < data->n; i++) {
            out[i * c + k] = residual[i] / own[i];
        }
    }
    free(target);
    return status;
}

static double middle_of(const double *values, size_t n, double *work) {
    memcpy(work, values, n * sizeof *work);
    qsort(work, n, sizeof *work, by_value);
    return work[n / 2];
}

gonio_status gonio_uncertainty_dense(const gonio_lsq_dense *dense, const gonio_lsq_data *data,
                                     const gonio_lsq_base *base, const double *lambdas, gonio_lobe_model_parts *parts,
                                     gonio_error *error) {
    const size_t n = data->n, c = (size_t)data->channels;
    nodes g;
    gonio_status status = nodes_init(&g, data->dims, error);
    if (status != GONIO_OK) {
        return status;
    }
    double *own = malloc(n * sizeof *own), *residuals = malloc(n * c * sizeof *residuals);
    double *factor = malloc(c * sizeof *factor), *work = malloc((n + c) * sizeof *work);
    field f = {0};
    if (own == NULL || residuals == NULL || factor == NULL || work == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    if (status == GONIO_OK) {
        status = gonio_lsq_dense_spread(dense, middle_of(lambdas, c, work), own, g.count, g.x, g.sigma, error);
    }
    if (status == GONIO_OK) {
        status = standardised(dense, data, base, lambdas, own, residuals, error);
    }
    if (status == GONIO_OK) {
        channel_factors(n, c, residuals, factor, work);
        status = field_init(&f, data, gonio_lsq_dense_form(dense), residuals, factor, error);
    }
    if (status == GONIO_OK) {
        const double share = model_share(data, factor);
        for (size_t i = 0; i < g.count; i++) {
            double near;
            g.sigma[i] = sqrt(g.sigma[i] * g.sigma[i] + share) * local_size(&f, g.x + i * f.d, &near);
        }
        status = attach(&g, factor, parts, error);
    }
    if (status != GONIO_OK) {
        free(factor);
    }
    free(own);
    free(residuals);
    free(work);
    field_release(&f);
    nodes_release(&g);
    return status;
}

// Root mean square of the held-out targets about their mean, in units of the channels' factors: what is unknown where
// nothing was measured.
static double unknown_spread(const gonio_lsq_data *held, const double *factor) {
    const size_t c = (size_t)held->channels;
    double total = 0;
    for (size_t k = 0; k < c; k++) {
        double mean = 0, squares = 0;
        for (size_t i = 0; i < held->n; i++) {
            mean += held->targets[i * c + k] / (double)held->n;
        }
        for (size_t i = 0; i < held->n; i++) {
            const double d = held->targets[i * c + k] - mean;
            squares += d * d / (double)held->n;
        }
        total += squares / (factor[k] * factor[k]) / (double)c;
    }
    return sqrt(total);
}

gonio_status gonio_uncertainty_held(const gonio_lsq_large_choice *choice, const gonio_lsq_data *data,
                                    gonio_lobe_model_parts *parts, gonio_error *error) {
    const gonio_lsq_data *held = &choice->held;
    const size_t tried = (size_t)held->channels, c = (size_t)data->channels;
    nodes g;
    gonio_status status = nodes_init(&g, data->dims, error);
    if (status != GONIO_OK) {
        return status;
    }
    double some[8], *work = malloc(held->n * sizeof *work), *factor = malloc(c * sizeof *factor);
    field f = {0};
    if (work == NULL || factor == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    if (status == GONIO_OK) {
        channel_factors(held->n, tried, choice->residuals, some, work);
        status = field_init(&f, held, &choice->form, choice->residuals, some, error);
    }
    if (status == GONIO_OK) {
        const double share = model_share(held, some), unknown = unknown_spread(held, some);
        for (size_t i = 0; i < g.count; i++) {
            double near;
            const double local = local_size(&f, g.x + i * f.d, &near);
            const double hole = unknown * exp(-near);
            g.sigma[i] = sqrt(share * local * local + hole * hole);
        }
        for (size_t k = 0; k < c; k++) {
            // Each channel takes the spread of the nearest one that was tried.
            factor[k] = some[(2 * k + 1) * tried / (2 * c)];
        }
        status = attach(&g, factor, parts, error);
    }
    if (status != GONIO_OK) {
        free(factor);
    }
    free(work);
    field_release(&f);
    nodes_release(&g);
    return status;
}
