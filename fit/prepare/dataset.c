// SPDX-License-Identifier: BSD-3-Clause
// Samples -> geometries for least squares.
//
// Equal geometries are merged first: the leave-one-out errors that choose everything else would otherwise see a
// sample's twin among its neighbours. Merging also orders the set by geometry, so the order of the samples is
// forgotten.
#include "fit/prepare/dataset.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/nearest.h"
#include "base/order_statistic.h"
#include "base/random.h"
#include "base/statistics.h"
#include "fit/prepare/scatter.h"

void gonio_dataset_release(gonio_dataset *data) {
    free(data->pairs);
    free(data->values);
    free(data->targets);
    free(data->weights);
    free(data->transforms);
    free(data->noise);
    *data = (gonio_dataset){0};
}

void gonio_dataset_locate(const gonio_dataset *data, gonio_coordinates coordinates, double *x) {
    for (size_t i = 0; i < data->n; i++) {
        gonio_scatter_locate(coordinates, data->dims, &data->pairs[i], x + i * (size_t)data->dims);
    }
}

// ---- merging ----

static double wrapped(double phi) { return remainder(phi, 2 * GONIO_PI); }

// One name for all ways to write a geometry: isotropic sets are turned to phi_i = 0, mirrored ones to phi_o >= 0.
static gonio_pair canonical(gonio_pair p, bool isotropic, bool mirror) {
    p.theta_i = fmin(fmax(p.theta_i, 0), GONIO_PI / 2);
    p.theta_o = fmin(fmax(p.theta_o, 0), GONIO_PI / 2);
    if (isotropic) {
        p.phi_o = p.theta_i > 0 && p.theta_o > 0 ? wrapped(p.phi_o - p.phi_i) : 0;
        p.phi_i = 0;
        p.phi_o = mirror ? fabs(p.phi_o) : p.phi_o;
        return p;
    }
    p.phi_i = p.theta_i > 0 ? wrapped(p.phi_i) : 0;
    p.phi_o = p.theta_o > 0 ? wrapped(p.phi_o) : 0;
    return mirror && (p.phi_i < 0 || (p.phi_i == 0 && p.phi_o < 0)) ? gonio_pair_mirrored(p) : p;
}

typedef struct entry {
    int64_t key[4]; // nanoradians: far below any rig's pointing
    uint64_t value; // bits of the first value, so that the order of equal geometries is the data's too
    size_t sample;
    gonio_pair pair;
} entry;

static int by_key(const void *left, const void *right) {
    const entry *a = left, *b = right;
    for (int d = 0; d < 4; d++) {
        if (a->key[d] != b->key[d]) {
            return a->key[d] > b->key[d] ? 1 : -1;
        }
    }
    if (a->value != b->value) {
        return a->value > b->value ? 1 : -1;
    }
    return (a->sample > b->sample) - (a->sample < b->sample);
}

static bool same_geometry(const entry *a, const entry *b) { return memcmp(a->key, b->key, sizeof a->key) == 0; }

static void fill_entry(entry *e, const gonio_samples *samples, size_t sample, const gonio_dataset_options *o,
                       bool swapped) {
    const gonio_pair pair = swapped ? gonio_pair_swapped(samples->pairs[sample]) : samples->pairs[sample];
    const double first = samples->values[sample * (size_t)samples->channels];
    *e = (entry){.sample = sample, .pair = canonical(pair, samples->isotropic, o->mirror)};
    const double angles[4] = {e->pair.theta_i, e->pair.theta_o, e->pair.phi_i, e->pair.phi_o};
    for (int d = 0; d < 4; d++) {
        e->key[d] = llround(angles[d] * 1e9);
    }
    memcpy(&e->value, &first, sizeof first);
}

// Variance of a sample's values relative to their size, mean over channels; 0 where there is no usable sigma.
static double relative_variance(const gonio_samples *samples, const gonio_dataset *data, size_t i) {
    if (samples->sigma_random == NULL) {
        return 0;
    }
    const size_t c = (size_t)samples->channels;
    double sum = 0;
    for (size_t k = 0; k < c; k++) {
        const double sigma = samples->sigma_random[i * c + k];
        if (!(sigma > 0 && isfinite(sigma))) {
            return 0;
        }
        const double t = gonio_transform_apply(data->kind, &data->transforms[k], samples->values[i * c + k]);
        const double slope = gonio_transform_slope(data->kind, &data->transforms[k], t);
        // In units of the spread that the transform leaves: ln for logs, the scale for linear values.
        sum += (sigma / slope) * (sigma / slope);
    }
    return sum / (double)c;
}

static gonio_status allocate(gonio_dataset *data, size_t n, gonio_error *error) {
    const size_t c = (size_t)data->channels;
    data->n = data->measured = n;
    data->pairs = malloc(n * sizeof *data->pairs);
    data->values = calloc(n * c, sizeof *data->values);
    data->targets = malloc(n * c * sizeof *data->targets);
    data->weights = calloc(n, sizeof *data->weights);
    data->transforms = malloc(c * sizeof *data->transforms);
    data->noise = calloc(c, sizeof *data->noise);
    const bool all = data->pairs != NULL && data->values != NULL && data->targets != NULL && data->weights != NULL &&
                     data->transforms != NULL && data->noise != NULL;
    if (!all) {
        gonio_dataset_release(data);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to prepare %zu samples (%.3g GB)", n,
                          (double)n * (double)(2 * c + 6) * 8 / 1e9);
    }
    return GONIO_OK;
}

static void merge(gonio_dataset *data, const gonio_samples *samples, const entry *entries, size_t n) {
    const size_t c = (size_t)data->channels;
    size_t at = 0;
    for (size_t i = 0; i < n; at++) {
        data->pairs[at] = entries[i].pair;
        size_t count = 0;
        for (; i + count < n && same_geometry(&entries[i], &entries[i + count]); count++) {
            for (size_t k = 0; k < c; k++) {
                data->values[at * c + k] += samples->values[entries[i + count].sample * c + k];
            }
        }
        for (size_t k = 0; k < c; k++) {
            data->values[at * c + k] /= (double)count;
        }
        data->weights[at] = (double)count;
        i += count;
    }
}

// ---- transforms ----

#define PROBES 1200 // geometries whose nearest neighbours tell the noise: enough for a median to 3 %

// near[i]: for every probe the geometry nearest to it in half-vector coordinates; step: between probes.
static gonio_status find_neighbours(const gonio_dataset *data, size_t step, size_t probes, size_t *near,
                                    gonio_error *error) {
    const size_t d = (size_t)data->dims;
    double *x = malloc(data->n * d * sizeof *x);
    if (x == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to estimate the noise of %zu samples", data->n);
    }
    gonio_dataset_locate(data, GONIO_HALF_VECTOR, x);
    for (size_t p = 0; p < probes; p++) {
        const size_t i = p * step;
        gonio_nearest nearest = {.wanted = 1};
        // Sets of millions are probed against a part of themselves; neighbours are near enough then all the same.
        const size_t stride = 1 + data->n / 50000;
        for (size_t j = p % stride; j < data->n; j += stride) {
            double distance = 0;
            for (size_t k = 0; k < d; k++) {
                distance += (x[i * d + k] - x[j * d + k]) * (x[i * d + k] - x[j * d + k]);
            }
            if (j != i) {
                gonio_nearest_show(&nearest, distance, j);
            }
        }
        near[p] = nearest.found > 0 ? nearest.index[0] : i;
    }
    free(x);
    return GONIO_OK;
}

// The noise level of the dark half of a channel, in units of its scale, between 0.003 and 0.3 of a typical value.
static double channel_noise(const gonio_dataset *data, size_t channel, size_t step, size_t probes, const size_t *near,
                            double *work) {
    const size_t c = (size_t)data->channels;
    const double scale = data->transforms[channel].scale;
    for (size_t p = 0; p < probes; p++) {
        work[p] = fabs(data->values[p * step * c + channel]) / scale;
    }
    gonio_sort(work, probes);
    const double middle = work[probes / 2];
    double typical = 0;
    const size_t most = probes - probes / 10; // without the tenth that holds the peak
    for (size_t p = 0; p < most; p++) {
        typical += work[p] / (double)most;
    }
    size_t dark = 0;
    for (size_t p = 0; p < probes; p++) {
        const double a = data->values[p * step * c + channel] / scale, b = data->values[near[p] * c + channel] / scale;
        if (fabs(a) + fabs(b) <= 2 * middle && near[p] != p * step) {
            work[dark++] = fabs(a - b);
        }
    }
    // Median of |difference of two normals|: 0.6745 sqrt(2) sigma.
    const double noise = gonio_upper_median(work, dark) / (GONIO_MEDIAN_OF_NORMAL * 1.4142135623730951);
    return fmin(fmax(noise, 3e-3 * typical), 0.3 * typical);
}

static void median_sigmas(const gonio_samples *samples, gonio_dataset *data, double *work) {
    const size_t c = (size_t)samples->channels, step = 1 + samples->n / PROBES;
    for (size_t k = 0; k < c; k++) {
        size_t m = 0;
        for (size_t i = 0; i < samples->n && m < PROBES; i += step) {
            const double sigma = samples->sigma_random[i * c + k];
            if (isfinite(sigma)) {
                work[m++] = sigma / data->transforms[k].scale;
            }
        }
        data->transforms[k].eps = fmax(data->transforms[k].eps, gonio_order_statistic(work, m, m / 10));
    }
}

// No channel's eps far below the others': clamped zeros hide the noise of a dark channel.
static void level_eps(gonio_dataset *data, double *work) {
    const size_t c = (size_t)data->channels;
    for (size_t k = 0; k < c; k++) {
        work[k] = data->transforms[k].eps * data->transforms[k].scale;
    }
    const double common = 0.5 * gonio_upper_median(work, c);
    for (size_t k = 0; k < c; k++) {
        gonio_transform *transform = &data->transforms[k];
        transform->eps = fmax(transform->eps, fmin(common / transform->scale, 0.1));
        transform->eps = transform->eps > 0 && isfinite(transform->eps) ? fmax(transform->eps, 1e-12) : 1e-6;
    }
}

#define NEGATIVES 10       // below as many, where they lie is chance
#define TOGETHER_LEAST 0.4 // noise about zero: 0.29 of independent normals; a smooth quantity: above 0.6

// Do negative values lie together, as those of a signed quantity do, or is it noise about zero? By how much of each its
// nearest neighbour has as well.
static bool negatives_together(const gonio_dataset *data, size_t step, size_t probes, const size_t *near) {
    const size_t c = (size_t)data->channels;
    double negative = 0, shared = 0;
    size_t n = 0;
    for (size_t i = 0; i < probes * c; i++) {
        const double value = -data->values[i / c * step * c + i % c];
        if (value > 0) {
            negative += value;
            shared += fmin(value, fmax(-data->values[near[i / c] * c + i % c], 0));
            n++;
        }
    }
    return n < NEGATIVES || shared >= TOGETHER_LEAST * negative;
}

// together: see negatives_together.
static gonio_status choose_links(gonio_dataset *data, const gonio_samples *samples, bool *together,
                                 gonio_error *error) {
    const size_t c = (size_t)data->channels, step = 1 + (data->n - 1) / PROBES;
    const size_t probes = (data->n + step - 1) / step;
    size_t *near = malloc(probes * sizeof *near);
    double *work = malloc((probes + c + PROBES) * sizeof *work);
    gonio_status status = near != NULL && work != NULL
                              ? find_neighbours(data, step, probes, near, error)
                              : gonio_fail(error, GONIO_E_MEMORY, "no memory to estimate the noise");
    if (status == GONIO_OK) {
        for (size_t k = 0; k < c; k++) {
            data->transforms[k].scale = gonio_scatter_scale(data->n, data->values + k, c);
            data->transforms[k].eps = channel_noise(data, k, step, probes, near, work);
        }
        if (samples->sigma_random != NULL) {
            median_sigmas(samples, data, work);
        }
        level_eps(data, work);
        *together = negatives_together(data, step, probes, near);
    }
    free(near);
    free(work);
    return status;
}

// A signed quantity (a Mueller element, say), where the negative values lie together.
static bool is_signed(const gonio_dataset *data) {
    double negative = 0, all = 0;
    for (size_t i = 0; i < data->n * (size_t)data->channels; i++) {
        negative += fmax(-data->values[i], 0);
        all += fabs(data->values[i]);
    }
    return negative > 0.02 * all;
}

// A spline is no better than a per cent or so between samples, however small their noise: weights that trusted sigmas
// of 0.1 % would fit a few samples and ignore the rest.
#define MODEL_SIGMA 0.02

static void fill_weights(gonio_dataset *data, const gonio_samples *samples, const entry *entries, size_t n) {
    size_t i = 0;
    double sum = 0;
    for (size_t at = 0; at < data->n; at++) {
        const size_t first = i;
        double weight = 0;
        while (i < n && same_geometry(&entries[first], &entries[i])) {
            const double variance = relative_variance(samples, data, entries[i].sample);
            weight += 1 / (1 + variance / (MODEL_SIGMA * MODEL_SIGMA));
            i++;
        }
        // Below 1e-9 of full weight a sample says nothing, and 0 would divide.
        data->weights[at] = fmax(weight, 1e-9);
        sum += data->weights[at];
    }
    for (size_t at = 0; at < data->n; at++) {
        data->weights[at] *= (double)data->n / sum;
    }
}

static gonio_status fill_noise(gonio_dataset *data, const gonio_samples *samples, gonio_error *error) {
    const size_t c = (size_t)data->channels, step = 1 + samples->n / PROBES;
    if (samples->sigma_random == NULL) {
        return GONIO_OK;
    }
    double *work = malloc((samples->n / step + 1) * sizeof *work);
    if (work == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to rank uncertainties");
    }
    for (size_t k = 0; k < c; k++) {
        size_t m = 0;
        for (size_t i = 0; i < samples->n; i += step) {
            const double t = gonio_transform_apply(data->kind, &data->transforms[k], samples->values[i * c + k]);
            const double slope = gonio_transform_slope(data->kind, &data->transforms[k], t);
            const double sigma = samples->sigma_random[i * c + k] / slope;
            work[m++] = isfinite(sigma) ? sigma : 0;
        }
        data->noise[k] = gonio_upper_median(work, m);
    }
    free(work);
    return GONIO_OK;
}

static void fill_targets(gonio_dataset *data) {
    const size_t c = (size_t)data->channels;
    for (size_t i = 0; i < data->n * c; i++) {
        data->targets[i] = gonio_transform_apply(data->kind, &data->transforms[i % c], data->values[i]);
    }
}

gonio_status gonio_dataset_init(gonio_dataset *data, const gonio_samples *samples, const gonio_dataset_options *options,
                                gonio_error *error) {
    *data =
        (gonio_dataset){.dims = samples->isotropic ? 3 : 4, .channels = samples->channels, .mirror = options->mirror};
    gonio_status status = gonio_samples_check(samples, error);
    if (status != GONIO_OK) {
        return status;
    }
    const size_t sides = options->reciprocal ? 2 : 1, n = sides * samples->n;
    entry *entries = malloc(n * sizeof *entries);
    if (entries == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to order %zu samples", n);
    }
    for (size_t i = 0; i < n; i++) {
        fill_entry(&entries[i], samples, i % samples->n, options, i >= samples->n);
    }
    qsort(entries, n, sizeof *entries, by_key);
    size_t unique = 0;
    for (size_t i = 0; i < n; i++) {
        unique += i == 0 || !same_geometry(&entries[i - 1], &entries[i]);
    }
    bool together = true;
    status = allocate(data, unique, error);
    if (status == GONIO_OK) {
        merge(data, samples, entries, n);
        status = choose_links(data, samples, &together, error);
    }
    if (status == GONIO_OK) {
        data->kind = options->domain == GONIO_LINEAR ? GONIO_TRANSFORM_LINEAR
                     : together && is_signed(data)   ? GONIO_TRANSFORM_ASINH
                                                     : GONIO_TRANSFORM_POSITIVE;
        fill_weights(data, samples, entries, n);
        fill_targets(data);
        status = fill_noise(data, samples, error);
    }
    free(entries);
    if (status != GONIO_OK) {
        gonio_dataset_release(data);
    }
    return status;
}

gonio_status gonio_dataset_select(const gonio_dataset *data, const bool *keep, gonio_dataset *out, gonio_error *error) {
    *out = (gonio_dataset){.dims = data->dims, .channels = data->channels, .mirror = data->mirror, .kind = data->kind};
    const size_t c = (size_t)data->channels;
    size_t n = 0;
    for (size_t i = 0; i < data->n; i++) {
        n += keep[i];
    }
    const gonio_status status = allocate(out, n, error);
    if (status != GONIO_OK) {
        return status;
    }
    memcpy(out->transforms, data->transforms, c * sizeof *out->transforms);
    memcpy(out->noise, data->noise, c * sizeof *out->noise);
    size_t at = 0;
    for (size_t i = 0; i < data->n; i++) {
        out->measured -= keep[i] && i >= data->measured;
        if (keep[i]) {
            out->pairs[at] = data->pairs[i];
            out->weights[at] = data->weights[i];
            memcpy(out->values + at * c, data->values + i * c, c * sizeof(double));
            memcpy(out->targets + at * c, data->targets + i * c, c * sizeof(double));
            at++;
        }
    }
    return GONIO_OK;
}

// realloc; the old block stays where there is no memory.
static bool grow(void *block, size_t size) {
    void **at = block, *larger = realloc(*at, size);
    *at = larger != NULL ? larger : *at;
    return larger != NULL;
}

gonio_status gonio_dataset_append(gonio_dataset *data, size_t count, const gonio_pair *pairs, const double *values,
                                  const double *weights, gonio_error *error) {
    const size_t n = data->n + count, c = (size_t)data->channels;
    if (!grow(&data->pairs, n * sizeof *data->pairs) || !grow(&data->values, n * c * sizeof *data->values) ||
        !grow(&data->targets, n * c * sizeof *data->targets) || !grow(&data->weights, n * sizeof *data->weights)) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu geometries more", count);
    }
    memcpy(data->pairs + data->n, pairs, count * sizeof *pairs);
    memcpy(data->weights + data->n, weights, count * sizeof *weights);
    memcpy(data->values + data->n * c, values, count * c * sizeof *values);
    for (size_t k = 0; k < count * c; k++) {
        data->targets[data->n * c + k] = gonio_transform_apply(data->kind, &data->transforms[k % c], values[k]);
    }
    data->n = n;
    return GONIO_OK;
}

gonio_status gonio_dataset_channels(const gonio_dataset *data, const int *which, int count, gonio_dataset *out,
                                    gonio_error *error) {
    *out = (gonio_dataset){.dims = data->dims, .channels = count, .mirror = data->mirror, .kind = data->kind};
    const gonio_status status = allocate(out, data->n, error);
    if (status != GONIO_OK) {
        return status;
    }
    out->measured = data->measured;
    memcpy(out->pairs, data->pairs, data->n * sizeof *out->pairs);
    memcpy(out->weights, data->weights, data->n * sizeof *out->weights);
    for (size_t k = 0; k < (size_t)count; k++) {
        const size_t c = (size_t)data->channels, channel = (size_t)which[k];
        out->transforms[k] = data->transforms[channel];
        out->noise[k] = data->noise[channel];
        for (size_t i = 0; i < data->n; i++) {
            out->values[i * (size_t)count + k] = data->values[i * c + channel];
            out->targets[i * (size_t)count + k] = data->targets[i * c + channel];
        }
    }
    return GONIO_OK;
}

gonio_status gonio_dataset_thin(const gonio_dataset *data, size_t count, uint64_t seed, gonio_dataset *out,
                                gonio_error *error) {
    bool *keep = malloc(data->n * sizeof *keep);
    if (keep == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to thin %zu samples", data->n);
    }
    // One of every n/count neighbours in the order of geometry: stratified, not merely random.
    for (size_t i = 0; i < data->n; i++) {
        keep[i] = i >= data->measured;
    }
    for (size_t s = 0; s < count; s++) {
        const size_t first = s * data->measured / count, end = (s + 1) * data->measured / count;
        if (end > first) {
            keep[first + gonio_random(seed ^ gonio_random(s)) % (end - first)] = true;
        }
    }
    const gonio_status status = gonio_dataset_select(data, keep, out, error);
    free(keep);
    return status;
}
