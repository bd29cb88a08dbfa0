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

#include "fit/lsq_cg.h"
#include "fit/uncertainty_blocks.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SIGMA_LEVEL_3D 4
#define SIGMA_LEVEL_4D 2
#define PROBES 1000 // where the law is asked
#define SIGMA_LAMBDA 1e-3
#define EXACT                                                                                                          \
    1e-4 // of the link's unit: no sigma is smaller, as no instrument's is; exact data fitted exactly leave rounding
#define HORIZON 0.01F     // the cosine at which lobes are held in any case: they divide by it
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

// Steele, Lea and Flood (2014): SplitMix64.
static double uniform(uint64_t *state) {
    uint64_t x = *state += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return (double)((x ^ (x >> 31)) >> 11) * 0x1p-53;
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
        factor[k] = fmax(work[n / 2] / MEDIAN_OF_NORMAL, fmax(0.05 * sqrt(squares / (double)n), EXACT));
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

static gonio_status attach_nodes(const nodes *g, double *factor, gonio_lobe_model_parts *parts, gonio_error *error) {
    const gonio_status status = nodes_to_lattice(g, &parts->sigma, error);
    if (status == GONIO_OK) {
        parts->sigma_factor = factor;
    }
    return status;
}

// ---- the field that the model carries ----

// Places where the law is asked: half spread over all pairs of directions, half about the mirror direction, where the
// lobe is.
static gonio_pair probe_pair(uint64_t *state, bool isotropic, bool mirror) {
    const double phi_i = isotropic ? 0 : 2 * GONIO_PI * uniform(state);
    const gonio_pair p = {acos(uniform(state)), phi_i, acos(uniform(state)), 2 * GONIO_PI * uniform(state)};
    if (!mirror) {
        return p;
    }
    // The half vector's tan(theta_h) = sinh(r)/10, even in r: as half-vector coordinates see it.
    const double tilt = atan(0.1 * sinh(4 * uniform(state)));
    const gonio_vec3 i = gonio_direction(p.theta_i, p.phi_i), h = gonio_direction(tilt, 2 * GONIO_PI * uniform(state));
    const double twice = 2 * (i.x * h.x + i.y * h.y + i.z * h.z);
    const gonio_vec3 o = {twice * h.x - i.x, twice * h.y - i.y, twice * h.z - i.z};
    return o.z > 0 ? gonio_pair_from_vectors(i, o) : p;
}

static gonio_status probes_init(gonio_lsq_data *probes, const gonio_lsq_data *data, gonio_error *error) {
    gonio_samples *samples;
    gonio_status status = gonio_samples_new(1, false, &samples, error);
    if (status != GONIO_OK) {
        return status;
    }
    samples->isotropic = data->dims == 3;
    uint64_t state = 1;
    const double none = 1;
    for (size_t i = 0; i < PROBES && status == GONIO_OK; i++) {
        const gonio_pair pair = probe_pair(&state, samples->isotropic, i % 2 == 1);
        status = gonio_samples_add(samples, &pair, &none, NULL, NULL, error);
    }
    if (status == GONIO_OK) {
        const gonio_lsq_data_options how = {.mirror = data->mirror, .domain = GONIO_LINEAR};
        status = gonio_lsq_data_init(probes, samples, &how, error);
    }
    gonio_samples_free(samples);
    return status;
}

// A smooth spline through ln sigma at the probes (their targets), and the model has an uncertainty.
static gonio_status attach(gonio_lsq_data *probes, double *factor, gonio_lobe_model_parts *parts, gonio_error *error) {
    gonio_lsq_form form =
        gonio_lsq_form_default(GONIO_HALF_VECTOR, probes->dims == 3 ? SIGMA_LEVEL_3D : SIGMA_LEVEL_4D, probes->mirror);
    double mean = 0;
    for (size_t i = 0; i < probes->n; i++) {
        mean += probes->targets[i] / (double)probes->n;
    }
    for (size_t i = 0; i < probes->n; i++) {
        probes->targets[i] -= mean;
    }
    gonio_lsq_cg *cg = NULL;
    gonio_lsq_cg_report unused;
    gonio_status status = gonio_lattice_init(&parts->sigma, probes->dims, form.level, 1, error);
    if (status != GONIO_OK) {
        return status;
    }
    double *points = malloc(parts->sigma.count * sizeof *points);
    status = points != NULL ? gonio_lsq_cg_new(probes, &form, 1, &cg, error)
                            : gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    if (status == GONIO_OK) {
        status = gonio_lsq_cg_cascade(cg, probes->targets, 1, SIGMA_LAMBDA, 200, 1e-3, points, &unused, error);
    }
    for (size_t i = 0; i < parts->sigma.count && status == GONIO_OK; i++) {
        parts->sigma.points[i] = (float)(points[i] + mean);
    }
    gonio_lsq_cg_free(cg);
    free(points);
    if (status == GONIO_OK) {
        parts->sigma_factor = factor;
        parts->sigma_half_vector = true;
    } else {
        gonio_lattice_release(&parts->sigma);
    }
    return status;
}

// ---- small sets ----

// Leave-one-out residuals of every channel with its own lambda.
static gonio_status leave_one_out(const gonio_lsq_dense *dense, const gonio_lsq_data *data, const gonio_lsq_base *base,
                                  const double *lambdas, double *out, gonio_error *error) {
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
            out[i * c + k] = residual[i];
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

// Variance of the samples' noise, mean over channels in their factors' units; -1 where they do not tell it.
static double told_noise(const gonio_lsq_data *data, const double *factor) {
    double sum = 0;
    for (int k = 0; k < data->channels; k++) {
        const double noise = data->noise[k] / factor[k];
        sum += noise * noise / data->channels;
    }
    return sum > 0 ? sum : -1;
}

// Beyond the samples' angles the lobes are held at the values that they have there (fit/lobe_model.h). Nobody knows
// whether the material follows the lobes instead, or goes twice as far: the mean square of a step uniform from none to
// twice the lobes' own is 4/3 of its square. Added to the variance, mean over channels.
static double held_back(const gonio_lsq_data *data, const gonio_lsq_base *base, const double *factor,
                        const gonio_pair *pair) {
    const gonio_lobe_base *held = &base->lobes;
    if (held->lobes == 0) {
        return 0;
    }
    const gonio_vec3 wi = gonio_direction(pair->theta_i, pair->phi_i), wo = gonio_direction(pair->theta_o, pair->phi_o);
    gonio_lobe_base free = *held;
    free.cosine_min = HORIZON;
    double units[2][1 + GONIO_LOBES_MAX], sum = 0;
    gonio_lobe_base_units(held, wi, wo, units[0]);
    gonio_lobe_base_units(&free, wi, wo, units[1]);
    for (int k = 0; k < data->channels; k++) {
        const double *strength = held->strength + (ptrdiff_t)k * (1 + GONIO_LOBES_MAX);
        const double step = gonio_lobe_base_link(&free, strength, units[1], data->kind, &data->links[k]) -
                            gonio_lobe_base_link(held, strength, units[0], data->kind, &data->links[k]);
        sum += 4.0 / 3 * step * step / (factor[k] * factor[k]) / data->channels;
    }
    return sum;
}

// ln sigma of the law at the probes, in the channels' factors.
static gonio_status fill_probes(const gonio_influence *f, const gonio_sigma_law *law, const double *factor,
                                gonio_lsq_data *probes, gonio_error *error) {
    const size_t m = probes->n, d = (size_t)probes->dims;
    double *noise = malloc((2 + d) * m * sizeof *noise), *work = malloc(4 * (law->records->n + 1) * sizeof *work);
    gonio_status status =
        noise != NULL && work != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    if (status == GONIO_OK) {
        double *unknown = noise + m, *x = unknown + m, least = 0;
        for (int k = 0; k < f->data->channels; k++) {
            least += EXACT * EXACT / (factor[k] * factor[k]) / f->data->channels;
        }
        gonio_lsq_data_locate(probes, gonio_lsq_dense_form(f->dense)->coordinates, x);
        status = gonio_influence_at(f, m, probes->pairs, x, noise, unknown, error);
        for (size_t i = 0; i < m && status == GONIO_OK; i++) {
            double place[2];
            gonio_sigma_place(&probes->pairs[i], place);
            const double learnt = gonio_sigma_law_variance(law, place, noise[i], unknown[i], work);
            const double held = held_back(f->data, f->base, factor, &probes->pairs[i]);
            probes->targets[i] = 0.5 * log(fmax(learnt + held, least));
        }
    }
    free(noise);
    free(work);
    return status;
}

gonio_status gonio_uncertainty_dense(const gonio_lsq_dense *dense, const gonio_lsq_data *data,
                                     const gonio_lsq_base *base, const double *lambdas, gonio_lobe_model_parts *parts,
                                     gonio_error *error) {
    const size_t n = data->n, c = (size_t)data->channels;
    double *residuals = calloc(n * c, sizeof *residuals), *work = malloc((n + c) * sizeof *work);
    double *factor = malloc(c * sizeof *factor);
    gonio_influence f = {0};
    gonio_sigma_records records = {0};
    gonio_sigma_law law;
    gonio_lsq_data probes = {0};
    gonio_status status = residuals != NULL && work != NULL && factor != NULL
                              ? leave_one_out(dense, data, base, lambdas, residuals, error)
                              : gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    if (status == GONIO_OK) {
        channel_factors(n, c, residuals, factor, work);
        status = gonio_influence_init(&f, dense, data, base, middle_of(lambdas, c, work), factor[c / 2], error);
    }
    if (status == GONIO_OK) {
        status = gonio_influence_records(&f, factor, &records, error);
    }
    if (status == GONIO_OK) {
        status = gonio_sigma_law_fit(&records, told_noise(data, factor), &law, error);
    }
    if (status == GONIO_OK) {
        status = probes_init(&probes, data, error);
    }
    if (status == GONIO_OK) {
        status = fill_probes(&f, &law, factor, &probes, error);
    }
    if (status == GONIO_OK) {
        status = attach(&probes, factor, parts, error);
    }
    if (status != GONIO_OK) {
        free(factor);
    }
    free(residuals);
    free(work);
    gonio_influence_release(&f);
    gonio_sigma_records_release(&records);
    gonio_lsq_data_release(&probes);
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
        status = attach_nodes(&g, factor, parts, error);
    }
    if (status != GONIO_OK) {
        free(factor);
    }
    free(work);
    field_release(&f);
    nodes_release(&g);
    return status;
}
