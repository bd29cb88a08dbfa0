// SPDX-License-Identifier: BSD-3-Clause
#include "fit/check/kernel.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/statistics.h"

static const struct {
    size_t judges;   // samples that choose: their mean log error is then known to a few per cent
    double exact2;   // squared distance below which a sample stands at the place itself
    double reach;    // of the typical distance of the j-th neighbour
    double eps_part; // of the median magnitude: where logarithms end
} tuning = {800, 1e-10, 2, 0.01};

static void unit_place(bool is_turned, gonio_vec3 wi, gonio_vec3 wo, double *x) {
    if (is_turned) {
        const double s = hypot(wi.x, wi.y), c = s > 0 ? wi.x / s : 1, d = s > 0 ? wi.y / s : 0;
        const double own[5] = {s, wi.z, wo.x * c + wo.y * d, fabs(wo.y * c - wo.x * d), wo.z};
        memcpy(x, own, sizeof own);
    } else {
        const double own[6] = {wi.x, wi.y, wi.z, wo.x, wo.y, wo.z};
        memcpy(x, own, sizeof own);
    }
}

static void place(const gonio_kernel *k, gonio_vec3 wi, gonio_vec3 wo, double *x) {
    if (k->half_vector && k->turned) {
        gonio_coordinates_isotropic(GONIO_HALF_VECTOR, wi, wo, x);
        x[1] = fabs(x[1] - 0.5); // mirror images are the same
    } else if (k->half_vector) {
        gonio_coordinates_anisotropic(GONIO_HALF_VECTOR, wi, wo, x);
    } else {
        unit_place(k->turned, wi, wo, x);
    }
}

static double in(const gonio_kernel *k, double z, int c) { return k->log ? asinh(z / k->eps[c]) : z; }
static double out_of(const gonio_kernel *k, double y, int c) { return k->log ? k->eps[c] * sinh(y) : y; }

// The neighbours' weights, which add up to 1.
static void weigh(const gonio_nearest *near, double *weight) {
    double mean = 0, sum = 0;
    for (size_t i = 0; i < near->found; i++) {
        mean += sqrt(near->distance[i]) / (double)near->found;
    }
    for (size_t i = 0; i < near->found; i++) {
        weight[i] = mean > 0 ? exp(-near->distance[i] / (2 * mean * mean)) : 1;
        sum += weight[i];
    }
    for (size_t i = 0; i < near->found; i++) {
        weight[i] /= sum;
    }
}

size_t gonio_kernel_at(const gonio_kernel *k, gonio_vec3 wi, gonio_vec3 wo, size_t without, size_t *rows) {
    const size_t skip[2] = {without, without == SIZE_MAX ? without : without + 1};
    gonio_nearest near = {.wanted = GONIO_NEAREST_MAX};
    double x[GONIO_NEIGHBOURS_DIMS];
    size_t n = 0;
    unit_place(k->turned, wi, wo, x);
    // One suffices where nothing stands there, as is the rule.
    gonio_nearest first = {.wanted = 1};
    gonio_neighbours_find(&k->exact, x, skip, &first);
    if (first.found == 0 || first.distance[0] >= tuning.exact2) {
        return 0;
    }
    gonio_neighbours_find(&k->exact, x, skip, &near);
    while (n < near.found && near.distance[n] < tuning.exact2) {
        rows[n] = near.index[n];
        n++;
    }
    return n;
}

size_t gonio_kernel_nearest(const gonio_kernel *k, const gonio_pair *p) {
    gonio_nearest near = {.wanted = 1};
    double x[GONIO_NEIGHBOURS_DIMS];
    unit_place(k->turned, gonio_direction(p->theta_i, p->phi_i), gonio_direction(p->theta_o, p->phi_o), x);
    gonio_neighbours_find(&k->exact, x, (const size_t[2]){SIZE_MAX, SIZE_MAX}, &near);
    return near.index[0];
}

// The nearest samples and their weights: all that were measured at the place itself alike, or the j nearest.
static size_t neighbours_of(const gonio_kernel *k, gonio_vec3 wi, gonio_vec3 wo, size_t without, size_t *rows,
                            double *weight, bool *there) {
    size_t n = gonio_kernel_at(k, wi, wo, without, rows);
    *there = n > 0;
    for (size_t i = 0; i < n; i++) {
        weight[i] = 1 / (double)n;
    }
    if (n == 0) {
        const size_t skip[2] = {without, without == SIZE_MAX ? without : without + 1};
        gonio_nearest near = {.wanted = (size_t)k->wanted};
        double x[GONIO_NEIGHBOURS_DIMS];
        place(k, wi, wo, x);
        gonio_neighbours_find(&k->tree, x, skip, &near);
        weigh(&near, weight);
        n = near.found;
        memcpy(rows, near.index, n * sizeof *rows);
        *there = n > 0 && near.distance[0] <= k->reach * k->reach;
    }
    return n;
}

bool gonio_kernel_value(const gonio_kernel *k, gonio_vec3 wi, gonio_vec3 wo, size_t without, double *values,
                        double *sigma) {
    const gonio_samples *s = k->samples;
    const size_t c = (size_t)s->channels;
    size_t rows[GONIO_NEAREST_MAX];
    double weight[GONIO_NEAREST_MAX];
    bool there;
    const size_t n = neighbours_of(k, wi, wo, without, rows, weight, &there);
    for (size_t j = 0; j < c; j++) {
        double sum = 0, variance = 0;
        for (size_t i = 0; i < n; i++) {
            const size_t at = rows[i] * c + j;
            sum += weight[i] * in(k, s->values[at], (int)j);
            variance += sigma != NULL && s->sigma_random != NULL ? pow(weight[i] * s->sigma_random[at], 2) : 0;
        }
        values[j] = out_of(k, sum, (int)j);
        if (sigma != NULL) {
            sigma[j] = sqrt(variance);
        }
    }
    return there;
}

// ---- the choice ----

static gonio_status build(gonio_kernel *k, gonio_error *error) {
    const gonio_samples *s = k->samples;
    k->dims = k->half_vector ? (k->turned ? 3 : 4) : (k->turned ? 5 : 6);
    for (size_t i = 0; i < s->n; i++) {
        const gonio_pair *p = &s->pairs[i];
        place(k, gonio_direction(p->theta_i, p->phi_i), gonio_direction(p->theta_o, p->phi_o),
              k->at + i * (size_t)k->dims);
    }
    gonio_neighbours_free(&k->tree);
    return gonio_neighbours_new(k->at, s->n, k->dims, &k->tree, error);
}

// Mean over the judges and channels of |log error|, each predicted from the others.
static double judged(const gonio_kernel *k) {
    const gonio_samples *s = k->samples;
    const size_t step = s->n / tuning.judges + 1, c = (size_t)s->channels;
    double sum = 0, values[GONIO_CHANNELS_MAX];
    for (size_t i = 0; i < s->n; i += step) {
        const gonio_pair *p = &s->pairs[i];
        gonio_kernel_value(k, gonio_direction(p->theta_i, p->phi_i), gonio_direction(p->theta_o, p->phi_o), i, values,
                           NULL);
        for (size_t j = 0; j < c; j++) {
            sum += fabs(asinh(values[j] / k->eps[j]) - asinh(s->values[i * c + j] / k->eps[j]));
        }
    }
    return sum;
}

static gonio_status choose(gonio_kernel *k, gonio_error *error) {
    static const int wanted[] = {4, 8, 16};
    gonio_kernel best = *k;
    double least = INFINITY;
    for (int half = 0; half < 2; half++) {
        k->half_vector = half == 1;
        const gonio_status status = build(k, error);
        if (status != GONIO_OK) {
            return status;
        }
        for (int way = 0; way < 6; way++) {
            k->wanted = wanted[way % 3];
            k->log = way >= 3;
            const double score = judged(k);
            if (score < least) {
                least = score;
                best.half_vector = k->half_vector;
                best.wanted = k->wanted;
                best.log = k->log;
            }
        }
    }
    k->half_vector = best.half_vector;
    k->wanted = best.wanted;
    k->log = best.log;
    return k->half_vector ? GONIO_OK : build(k, error);
}

// Errors of samples predicted from the others, and how far neighbours are.
static gonio_status judge(gonio_kernel *k, gonio_error *error) {
    const gonio_samples *s = k->samples;
    const size_t step = s->n / tuning.judges + 1, c = (size_t)s->channels, n = (s->n + step - 1) / step;
    double *part = malloc((n * c + n) * sizeof *part), *far = part != NULL ? part + n * c : NULL;
    double values[GONIO_CHANNELS_MAX];
    if (part == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to judge an interpolation of %zu samples", s->n);
    }
    for (size_t i = 0, m = 0; i < s->n; i += step, m++) {
        const gonio_pair *p = &s->pairs[i];
        gonio_nearest near = {.wanted = (size_t)k->wanted};
        gonio_neighbours_find(&k->tree, k->at + i * (size_t)k->dims, (const size_t[2]){i, i + 1}, &near);
        far[m] = near.found > 0 ? sqrt(near.distance[near.found - 1]) : 0;
        gonio_kernel_value(k, gonio_direction(p->theta_i, p->phi_i), gonio_direction(p->theta_o, p->phi_o), i, values,
                           NULL);
        for (size_t j = 0; j < c; j++) {
            const double error_now = values[j] - s->values[i * c + j];
            part[m * c + j] = fabs(error_now) / (fabs(s->values[i * c + j]) + k->eps[j]);
            k->left_out_squares[j] += error_now * error_now / (double)n;
        }
    }
    k->left_out = gonio_median(part, n * c);
    k->reach = tuning.reach * gonio_median(far, n);
    free(part);
    return GONIO_OK;
}

static bool find_eps(gonio_kernel *k) {
    const gonio_samples *s = k->samples;
    const size_t c = (size_t)s->channels;
    double *values = malloc((s->n + 1) * sizeof *values);
    for (size_t j = 0; j < c && values != NULL; j++) {
        for (size_t i = 0; i < s->n; i++) {
            values[i] = fabs(s->values[i * c + j]);
        }
        const double median = gonio_median(values, s->n);
        k->eps[j] = median > 0 ? tuning.eps_part * median : 1e-6;
    }
    free(values);
    return values != NULL;
}

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    gonio_kernel_value((const gonio_kernel *)model, wi, wo, SIZE_MAX, values, NULL);
}

static const gonio_model_ops ops = {.kind = "kernel", .eval = eval};

gonio_status gonio_kernel_new(const gonio_samples *samples, bool turned, gonio_kernel *k, gonio_error *error) {
    const size_t c = (size_t)samples->channels;
    *k = (gonio_kernel){.samples = samples, .turned = turned || samples->isotropic};
    k->head = (gonio_model){.ops = &ops,
                            .channels = samples->channels,
                            .isotropic = k->turned,
                            .channel_names = (const char(*)[32])samples->channel_names};
    k->at = malloc((samples->n + 1) * GONIO_NEIGHBOURS_DIMS * sizeof *k->at);
    k->units = malloc((samples->n + 1) * GONIO_NEIGHBOURS_DIMS * sizeof *k->units);
    k->eps = malloc(c * sizeof *k->eps);
    k->left_out_squares = calloc(c, sizeof *k->left_out_squares);
    gonio_status status = GONIO_OK;
    if (k->at == NULL || k->units == NULL || k->eps == NULL || k->left_out_squares == NULL || !find_eps(k)) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to interpolate %zu samples", samples->n);
    }
    const int dims = k->turned ? 5 : 6;
    for (size_t i = 0; i < samples->n && status == GONIO_OK; i++) {
        const gonio_pair *p = &samples->pairs[i];
        unit_place(k->turned, gonio_direction(p->theta_i, p->phi_i), gonio_direction(p->theta_o, p->phi_o),
                   k->units + i * (size_t)dims);
    }
    status = status == GONIO_OK ? gonio_neighbours_new(k->units, samples->n, dims, &k->exact, error) : status;
    status = status == GONIO_OK ? choose(k, error) : status;
    status = status == GONIO_OK ? judge(k, error) : status;
    if (status != GONIO_OK) {
        gonio_kernel_free(k);
    }
    return status;
}

void gonio_kernel_free(gonio_kernel *k) {
    gonio_neighbours_free(&k->tree);
    gonio_neighbours_free(&k->exact);
    free(k->at);
    free(k->units);
    free(k->eps);
    free(k->left_out_squares);
    *k = (gonio_kernel){0};
}
