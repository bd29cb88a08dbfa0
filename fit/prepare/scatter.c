// SPDX-License-Identifier: BSD-3-Clause
// Samples -> scatter: the coordinates, the transform of each channel, the weights, and the order.
#include "fit/prepare/scatter.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/order_statistic.h"
#include "base/thread_pool.h"

void gonio_scatter_release(gonio_scatter *scatter) {
    free(scatter->positions);
    free(scatter->values);
    free(scatter->weights);
    free(scatter->transforms);
    free(scatter->mean);
    *scatter = (gonio_scatter){0};
}

void gonio_scatter_locate(gonio_coordinates coordinates, int dims, const gonio_pair *pair, double x[GONIO_DIMS_MAX]) {
    if (dims == 3 && coordinates == GONIO_NUSSELT && pair->theta_i > 0) {
        // The difference of the azimuths needs three trigonometric calls instead of eight.
        const double r = sin(pair->theta_o), phi = pair->phi_o - pair->phi_i;
        x[0] = fmin((sin(pair->theta_i) + 1) / 2, 1);
        x[1] = fmin(fmax((r * cos(phi) + 1) / 2, 0), 1);
        x[2] = fmin(fmax((r * sin(phi) + 1) / 2, 0), 1);
        return;
    }
    const gonio_vec3 wi = gonio_direction(pair->theta_i, pair->phi_i);
    const gonio_vec3 wo = gonio_direction(pair->theta_o, pair->phi_o);
    if (dims == 3) {
        gonio_coordinates_isotropic(coordinates, wi, wo, x);
    } else {
        gonio_coordinates_anisotropic(coordinates, wi, wo, x);
    }
}

double gonio_scatter_distance2(const double *x, const double *y, size_t dims, unsigned mirror_axes) {
    double same = 0, image = 0;
    for (size_t k = 0; k < dims; k++) {
        const double mirrored = (mirror_axes >> k & 1u) != 0 ? 1 - x[k] : x[k];
        same += (x[k] - y[k]) * (x[k] - y[k]);
        image += (mirrored - y[k]) * (mirrored - y[k]);
    }
    return fmin(same, image);
}

double gonio_scatter_scale(size_t n, const double *values, size_t channels) {
    double largest = 0;
    for (size_t i = 0; i < n; i++) {
        largest = fmax(largest, fabs(values[i * channels]));
    }
    int exponent = 0;
    frexp(largest, &exponent);
    // 2^-1074 .. 2^1023 are the doubles' powers of two; a scale of 2^1024 would be infinite.
    return largest > 0 ? ldexp(1, exponent > 1023 ? 1023 : exponent) : 1;
}

// The log's offset, in units of the scale: the noise level where it is known, and never below a thousandth of the
// median magnitude, so that zeros (clamped noise) do not fall to minus infinity.
static double channel_eps(const gonio_samples *samples, size_t channel, double scale, double *ranked) {
    const size_t c = (size_t)samples->channels, n = samples->n;
    for (size_t i = 0; i < n; i++) {
        ranked[i] = fabs(samples->values[i * c + channel]) / scale;
    }
    double eps = fmax(gonio_order_statistic(ranked, n, n / 2) * 3e-2, gonio_order_statistic(ranked, n, n - 1) * 1e-7);
    if (samples->sigma_random != NULL) {
        for (size_t i = 0; i < n; i++) {
            ranked[i] = samples->sigma_random[i * c + channel] / scale;
        }
        eps = fmax(eps, gonio_order_statistic(ranked, n, n / 10));
    }
    return eps > 0 && isfinite(eps) ? eps : 1e-6;
}

static bool has_negatives(const gonio_samples *samples) {
    for (size_t i = 0; i < samples->n * (size_t)samples->channels; i++) {
        if (samples->values[i] < 0) {
            return true;
        }
    }
    return false;
}

static gonio_status choose_transforms(gonio_scatter *scatter, const gonio_samples *samples, gonio_domain domain,
                                      gonio_error *error) {
    scatter->kind = domain == GONIO_LINEAR   ? GONIO_TRANSFORM_LINEAR
                    : has_negatives(samples) ? GONIO_TRANSFORM_ASINH
                                             : GONIO_TRANSFORM_LOG;
    const bool offset = domain != GONIO_LINEAR;
    double *ranked = offset ? malloc(samples->n * sizeof *ranked) : NULL;
    if (offset && ranked == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to rank %zu values", samples->n);
    }
    for (size_t c = 0; c < (size_t)samples->channels; c++) {
        const double scale = gonio_scatter_scale(samples->n, samples->values + c, (size_t)samples->channels);
        scatter->transforms[c] = (gonio_transform){scale, offset ? channel_eps(samples, c, scale, ranked) : 0};
    }
    free(ranked);
    return GONIO_OK;
}

static gonio_status allocate(gonio_scatter *scatter, bool weighted, gonio_error *error) {
    const size_t c = (size_t)scatter->channels;
    // One more: kernels read positions four at a time.
    scatter->positions = calloc(scatter->n * (size_t)scatter->dims + 1, sizeof *scatter->positions);
    scatter->values = malloc(scatter->n * c * sizeof *scatter->values);
    scatter->weights = weighted ? malloc(scatter->n * sizeof *scatter->weights) : NULL;
    scatter->transforms = malloc(c * sizeof *scatter->transforms);
    scatter->mean = malloc(c * sizeof *scatter->mean);
    const bool all = scatter->positions != NULL && scatter->values != NULL && scatter->transforms != NULL &&
                     scatter->mean != NULL && (!weighted || scatter->weights != NULL);
    return all ? GONIO_OK
               : gonio_fail(error, GONIO_E_MEMORY, "no memory to prepare %zu samples (%.3g GB)", scatter->n,
                            (double)scatter->n * 4 * (double)(c + (size_t)scatter->dims + 1) / 1e9);
}

// Variance of a sample's transformed values, mean over channels; 0 where a channel's sigma is 0 or unusable.
static double sample_variance(const gonio_scatter *scatter, const gonio_samples *samples, size_t i) {
    const size_t c = (size_t)samples->channels;
    double sum = 0;
    for (size_t k = 0; k < c; k++) {
        const double sigma = samples->sigma_random[i * c + k];
        if (!(sigma > 0 && isfinite(sigma))) {
            return 0;
        }
        const double v = (double)scatter->values[i * c + k];
        const double relative = sigma / gonio_transform_slope(scatter->kind, &scatter->transforms[k], v);
        sum += relative * relative;
    }
    return sum / (double)c;
}

// 1/variance, the largest 1. Samples without a usable sigma get the largest weight that the others have.
static void scale_weights(gonio_scatter *scatter, const double *variances, size_t n) {
    double least = INFINITY;
    for (size_t i = 0; i < n; i++) {
        least = variances[i] > 0 ? fmin(least, variances[i]) : least;
    }
    for (size_t i = 0; i < n; i++) {
        // Below 2^-60 a weight would drown in the rounding of any sum it meets, and its cube leave the float range.
        scatter->weights[i] = variances[i] > 0 ? (float)fmax(least / variances[i], 0x1p-60) : 1;
    }
}

static void fill_mean(gonio_scatter *scatter) {
    const size_t c = (size_t)scatter->channels;
    double total = 0;
    memset(scatter->mean, 0, c * sizeof *scatter->mean);
    for (size_t i = 0; i < scatter->n; i++) {
        const double w = scatter->weights != NULL ? (double)scatter->weights[i] : 1;
        total += w;
        for (size_t k = 0; k < c; k++) {
            scatter->mean[k] += w * (double)scatter->values[i * c + k];
        }
    }
    for (size_t k = 0; k < c; k++) {
        scatter->mean[k] /= total;
    }
}

// What the threads share: each chunk of samples fills its own part of the scatter.
typedef struct filling {
    gonio_scatter *scatter;
    const gonio_samples *samples;
    double *variances; // NULL: no weights
    bool reciprocal;
} filling;

static void fill_positions(const filling *f, size_t begin, size_t end, bool swapped) {
    gonio_scatter *scatter = f->scatter;
    uint32_t *out = scatter->positions + ((swapped ? f->samples->n : 0) + begin) * (size_t)scatter->dims;
    for (size_t i = begin; i < end; i++) {
        double x[GONIO_DIMS_MAX];
        const gonio_pair pair = swapped ? gonio_pair_swapped(f->samples->pairs[i]) : f->samples->pairs[i];
        gonio_scatter_locate(scatter->coordinates, scatter->dims, &pair, x);
        for (int d = 0; d < scatter->dims; d++) {
            *out++ = gonio_bspline_fix(x[d]);
        }
    }
}

static void fill_values(const filling *f, size_t begin, size_t end) {
    gonio_scatter *scatter = f->scatter;
    const size_t c = (size_t)scatter->channels;
    for (size_t i = begin; i < end; i++) {
        for (size_t k = 0; k < c; k++) {
            scatter->values[i * c + k] =
                (float)gonio_transform_apply(scatter->kind, &scatter->transforms[k], f->samples->values[i * c + k]);
        }
        if (f->variances != NULL) {
            f->variances[i] = sample_variance(scatter, f->samples, i);
        }
    }
}

static void fill_chunk(void *context, size_t item) {
    const filling *f = context;
    const size_t begin = item * GONIO_POOL_CHUNK, n = f->samples->n;
    const size_t end = n - begin < GONIO_POOL_CHUNK ? n : begin + GONIO_POOL_CHUNK;
    fill_positions(f, begin, end, false);
    fill_values(f, begin, end);
    if (f->reciprocal) {
        fill_positions(f, begin, end, true);
    }
}

static gonio_status fill(gonio_scatter *scatter, const gonio_samples *samples, const gonio_scatter_options *options,
                         gonio_error *error) {
    const size_t n = samples->n;
    filling f = {scatter, samples, NULL, (options->symmetry & GONIO_SYMMETRY_RECIPROCITY) != 0};
    if (scatter->weights != NULL && (f.variances = malloc(n * sizeof *f.variances)) == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the weights of %zu samples", n);
    }
    gonio_pool *pool = n >= GONIO_POOL_SAMPLES ? gonio_pool_new(options->threads) : NULL;
    gonio_pool_run(pool, (n + GONIO_POOL_CHUNK - 1) / GONIO_POOL_CHUNK, fill_chunk, &f);
    gonio_pool_free(pool);
    if (f.variances != NULL) {
        scale_weights(scatter, f.variances, n);
        free(f.variances);
    }
    return GONIO_OK;
}

// The swapped copies stand behind the originals.
static void repeat_values(gonio_scatter *scatter, size_t n) {
    const size_t row = n * (size_t)scatter->channels;
    memcpy(scatter->values + row, scatter->values, row * sizeof *scatter->values);
    if (scatter->weights != NULL) {
        memcpy(scatter->weights + n, scatter->weights, n * sizeof *scatter->weights);
    }
}

gonio_status gonio_scatter_prepare(gonio_scatter *scatter, const gonio_samples *samples,
                                   const gonio_scatter_options *options, gonio_error *error) {
    const bool reciprocal = (options->symmetry & GONIO_SYMMETRY_RECIPROCITY) != 0;
    *scatter = (gonio_scatter){.n = samples->n * (reciprocal ? 2 : 1),
                               .dims = samples->isotropic ? 3 : 4,
                               .channels = samples->channels,
                               .coordinates = options->coordinates};
    gonio_status status = gonio_samples_check(samples, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (options->symmetry & GONIO_SYMMETRY_MIRROR) {
        scatter->mirror_axes = gonio_coordinates_mirror_axes(options->coordinates, scatter->dims);
    }
    status = allocate(scatter, options->weighted && samples->sigma_random != NULL, error);
    status = status == GONIO_OK ? choose_transforms(scatter, samples, options->domain, error) : status;
    status = status == GONIO_OK ? fill(scatter, samples, options, error) : status;
    if (status != GONIO_OK) {
        gonio_scatter_release(scatter);
        return status;
    }
    if (reciprocal) {
        repeat_values(scatter, samples->n);
    }
    fill_mean(scatter);
    return GONIO_OK;
}

gonio_status gonio_scatter_init(gonio_scatter *scatter, const gonio_samples *samples,
                                const gonio_scatter_options *options, gonio_error *error) {
    gonio_status status = gonio_scatter_prepare(scatter, samples, options, error);
    if (status == GONIO_OK) {
        status = gonio_scatter_sort(scatter, options->threads, error);
        if (status != GONIO_OK) {
            gonio_scatter_release(scatter);
        }
    }
    return status;
}
