// SPDX-License-Identifier: BSD-3-Clause
// DeYoung's measures of samples on no grid: missing values come from the kernel (fit/check/kernel.h), integrals from
// triangles where an incidence has samples enough, and the tests from fit/check/partial.h.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/statistics.h"
#include "base/thread_pool.h"
#include "fit/check/albedo.h"
#include "fit/check/kernel.h"
#include "fit/check/measures.h"
#include "fit/check/partial.h"
#include "fit/check/significance.h"
#include "fit/check/triangles.h"

enum {
    TURNS = GONIO_CHECK_TURNS,
    GROUP_LEAST = 12, // samples of an incidence that is triangulated
    NODES = 4096,     // of a hemisphere's quadrature of the interpolant
};

typedef struct scattered {
    const gonio_samples *s;
    const gonio_kernel *kernel;
    double *partner; // [n][channels] interpolated where the directions are exchanged
    double *turn;    // [n][channels] (4.9), and before it [n][TURNS][channels]
    bool *there;     // [n]
} scattered;

static gonio_vec3 turned(gonio_vec3 v, double angle) {
    const double c = cos(angle), s = sin(angle);
    return (gonio_vec3){c * v.x - s * v.y, s * v.x + c * v.y, v.z};
}

// ---- reciprocity ----

// A sample whose exchanged directions are its own is reciprocal by itself.
static void exchange(void *context, size_t i) {
    const scattered *x = context;
    const gonio_pair *p = &x->s->pairs[i];
    const size_t c = (size_t)x->s->channels;
    const gonio_vec3 wi = gonio_direction(p->theta_i, p->phi_i), wo = gonio_direction(p->theta_o, p->phi_o);
    size_t rows[GONIO_NEAREST_MAX];
    bool own = false;
    for (size_t n = gonio_kernel_at(x->kernel, wo, wi, SIZE_MAX, rows); n > 0; n--) {
        own = own || rows[n - 1] == i;
    }
    if (own) {
        memcpy(x->partner + i * c, x->s->values + i * c, c * sizeof *x->partner);
    }
    x->there[i] = own || gonio_kernel_value(x->kernel, wo, wi, i, x->partner + i * c, NULL);
}

static gonio_status reciprocity(const scattered *x, int threads, gonio_check_report *r, gonio_error *error) {
    const gonio_samples *s = x->s;
    const size_t c = (size_t)s->channels;
    gonio_differences d;
    if (!gonio_differences_begin(&d, s->n * c)) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to compare %zu samples", s->n);
    }
    gonio_pool_for(threads, s->n, exchange, (void *)x);
    double sum = 0, expected = 0;
    size_t n = 0;
    for (size_t i = 0; i < s->n; i++) {
        for (size_t k = 0; k < c && x->there[i]; k++) {
            const double a = s->values[i * c + k], b = x->partner[i * c + k];
            sum += (a - b) * (a - b) / 2;
            gonio_differences_add(&d, a, b, &s->pairs[i], (int)k);
        }
        n += x->there[i];
    }
    for (size_t k = 0; k < c; k++) {
        expected += x->kernel->left_out_squares[k] / 2 / (double)c;
    }
    r->reciprocity = n > 0 ? sum / (double)(n * c) : NAN;
    r->reciprocity_expected = expected;
    r->reciprocity_range = gonio_differences_end(&d, &r->reciprocity_median);
    return gonio_partial_test(s, GONIO_TEST_RECIPROCITY, threads, &r->reciprocity_test, &r->reciprocity_part, error);
}

// ---- isotropy ----

static void turn_sample(void *context, size_t i) {
    const scattered *x = context;
    const gonio_samples *s = x->s;
    const size_t c = (size_t)s->channels;
    const gonio_pair *p = &s->pairs[i];
    const gonio_vec3 wi = gonio_direction(p->theta_i, p->phi_i), wo = gonio_direction(p->theta_o, p->phi_o);
    double sum[GONIO_CHANNELS_MAX], squares[GONIO_CHANNELS_MAX], values[GONIO_CHANNELS_MAX];
    x->there[i] = true;
    for (int t = 0; t < TURNS; t++) {
        const double angle = 2 * GONIO_PI * t / TURNS;
        x->there[i] =
            gonio_kernel_value(x->kernel, turned(wi, angle), turned(wo, angle), t == 0 ? SIZE_MAX : i, values, NULL) &&
            x->there[i];
        for (size_t k = 0; k < c; k++) {
            const double z = t == 0 ? s->values[i * c + k] : values[k];
            sum[k] = (t == 0 ? 0 : sum[k]) + z;
            squares[k] = (t == 0 ? 0 : squares[k]) + z * z;
        }
    }
    for (size_t k = 0; k < c; k++) {
        const double mean = sum[k] / TURNS;
        x->partner[i * c + k] = mean;
        x->turn[i * c + k] = sqrt(fmax(squares[k] / TURNS - mean * mean, 0));
    }
}

static gonio_status isotropy(const scattered *x, int threads, gonio_check_report *r, gonio_error *error) {
    const gonio_samples *s = x->s;
    const size_t c = (size_t)s->channels;
    r->isotropy_test = gonio_check_no_test;
    if (s->isotropic) {
        return GONIO_OK;
    }
    gonio_differences d;
    if (!gonio_differences_begin(&d, s->n * c)) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to compare %zu samples", s->n);
    }
    gonio_pool_for(threads, s->n, turn_sample, (void *)x);
    double sum = 0;
    size_t n = 0;
    for (size_t i = 0; i < s->n; i++) {
        for (size_t k = 0; k < c && x->there[i]; k++) {
            sum += x->turn[i * c + k];
            gonio_differences_add(&d, s->values[i * c + k], x->partner[i * c + k], &s->pairs[i], (int)k);
        }
        n += x->there[i];
    }
    r->isotropy = n > 0 ? sum / (double)(n * c) : NAN;
    r->isotropy_range = gonio_differences_end(&d, &r->isotropy_median);
    return gonio_partial_test(s, GONIO_TEST_ISOTROPY, threads, &r->isotropy_test, &r->isotropy_part, error);
}

// ---- energy ----

typedef struct incidence {
    double theta, phi;
    size_t sample;
} incidence;

static int by_incidence(const void *left, const void *right) {
    const incidence *a = left, *b = right;
    if (a->theta != b->theta) {
        return a->theta < b->theta ? -1 : 1;
    }
    return a->phi != b->phi ? (a->phi < b->phi ? -1 : 1) : (a->sample > b->sample) - (a->sample < b->sample);
}

static void sort_incidences(const gonio_samples *s, incidence *in) {
    for (size_t i = 0; i < s->n; i++) {
        const gonio_pair *p = &s->pairs[i];
        const double turn = 2 * GONIO_PI, phi = p->phi_i - turn * floor(p->phi_i / turn);
        // Rounded, so that what is equal within the tolerance stands together.
        const double unit = 4 * GONIO_TABLE_TOLERANCE, theta = round(p->theta_i / unit) * unit;
        in[i] = (incidence){theta, s->isotropic || theta == 0 || phi > turn - unit ? 0 : round(phi / unit) * unit, i};
    }
    qsort(in, s->n, sizeof *in, by_incidence);
}

typedef struct energies {
    gonio_check_albedo_point *points;
    double *values, *sigmas;
    size_t n;
} energies;

static gonio_status add_group(const gonio_samples *s, const incidence *in, size_t n, energies *e, gonio_error *error) {
    const size_t c = (size_t)s->channels;
    gonio_vec3 *d = malloc(n * sizeof *d);
    double *weight = calloc(3 * n, sizeof *weight), *other = weight + n;
    size_t *sample = malloc(n * sizeof *sample);
    gonio_check_albedo_point *point = &e->points[e->n];
    gonio_status status = GONIO_OK;
    if (d == NULL || weight == NULL || sample == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to triangulate %zu directions", n);
    } else {
        *point = (gonio_check_albedo_point){.theta_i = in[0].theta, .phi_i = in[0].phi};
        for (size_t k = 0; k < n; k++) {
            const gonio_pair *p = &s->pairs[in[k].sample];
            d[k] = gonio_direction(p->theta_o, p->phi_o - (s->isotropic ? p->phi_i : 0));
            sample[k] = in[k].sample;
        }
        status = gonio_triangles_weigh(d, n, s->isotropic, weight, &point->covered, error);
    }
    if (status == GONIO_OK && point->covered >= GONIO_CHECK_COVERED) {
        // How much the triangles may miss: linear pieces over half the directions err four times as much, so a third of
        // the difference is left.
        double covered;
        size_t half = 0;
        for (size_t k = 0; k < n; k += 2) {
            d[half++] = d[k];
        }
        status = gonio_triangles_weigh(d, half, s->isotropic, weight + 2 * n, &covered, error);
        for (size_t k = 0; k < n; k++) {
            other[k] = weight[k] + ((k % 2 == 0 ? weight[2 * n + k / 2] : 0) - weight[k]) / 3;
        }
        gonio_check_integrate(s, n, sample, weight, other, false, e->values + e->n * c, e->sigmas + e->n * c, point);
        e->n++;
    }
    free(sample);
    free(weight);
    free(d);
    return status;
}

static gonio_status energy_of_groups(const gonio_samples *s, const incidence *in, energies *e, size_t *samples,
                                     gonio_error *error) {
    gonio_status status = GONIO_OK;
    *samples = 0;
    for (size_t from = 0, to; from < s->n && status == GONIO_OK; from = to) {
        for (to = from + 1; to < s->n && in[to].theta == in[from].theta && in[to].phi == in[from].phi;) {
            to++;
        }
        const size_t before = e->n;
        if (to - from >= GROUP_LEAST) {
            status = add_group(s, in + from, to - from, e, error);
        }
        *samples += e->n > before ? to - from : 0;
    }
    return status;
}

// No incidence has samples enough: the interpolant's albedo at every 5 deg that samples reach.
static void energy_of_kernel(const scattered *x, energies *e) {
    const gonio_samples *s = x->s;
    const size_t c = (size_t)s->channels;
    double low = INFINITY, high = 0, part = 0, size = 0;
    for (size_t i = 0; i < s->n; i++) {
        low = fmin(low, s->pairs[i].theta_i);
        high = fmax(high, s->pairs[i].theta_i);
    }
    for (size_t k = 0; s->sigma_systematic != NULL && k < s->n * c; k++) {
        part += s->sigma_systematic[k];
        size += fabs(s->values[k]);
    }
    for (int t = 0; t < 18; t++) {
        const double theta = gonio_radians(5.0 * t);
        if (theta < low - gonio_radians(5) || theta > high + gonio_radians(2.5)) {
            continue;
        }
        gonio_check_albedo_point *p = &e->points[e->n];
        double *values = e->values + e->n * c;
        gonio_check_albedo_nodes(&x->kernel->head, theta, NODES, values);
        *p = (gonio_check_albedo_point){.theta_i = theta, .largest = -INFINITY, .covered = 1};
        for (size_t k = 0; k < c; k++) {
            p->value += values[k] / (double)c;
            p->channel = values[k] > p->largest ? (int)k : p->channel;
            p->largest = fmax(p->largest, values[k]);
            const double own = values[k] * (size > 0 ? part / size : 0), gap = values[k] * x->kernel->left_out;
            e->sigmas[e->n * c + k] = s->sigma_random != NULL ? hypot(own, gap) : 0;
        }
        p->systematic = p->value * (size > 0 ? part / size : 0);
        p->integration = p->value * x->kernel->left_out;
        e->n++;
    }
}

static gonio_status energy(const scattered *x, gonio_check_report *r, gonio_error *error) {
    const gonio_samples *s = x->s;
    const size_t c = (size_t)s->channels, room = s->n / GROUP_LEAST + 20;
    incidence *in = malloc(s->n * sizeof *in);
    energies e = {calloc(room, sizeof *e.points), malloc(room * c * sizeof *e.values),
                  malloc(room * c * sizeof *e.sigmas), 0};
    gonio_status status = GONIO_OK;
    if (in == NULL || e.points == NULL || e.values == NULL || e.sigmas == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for the albedos of %zu samples", s->n);
    } else {
        size_t samples;
        sort_incidences(s, in);
        status = energy_of_groups(s, in, &e, &samples, error);
        if (status == GONIO_OK && 2 * samples < s->n) {
            e.n = 0;
            energy_of_kernel(x, &e);
        }
    }
    r->albedos = e.points;
    r->channel_albedos = e.values;
    r->channel_sigmas = e.sigmas;
    r->incidences = e.n;
    if (status == GONIO_OK) {
        gonio_check_sum_up_albedos(r);
        gonio_check_test_energy(r, (int)c);
    }
    free(in);
    return status;
}

// ---- all ----

gonio_status gonio_check_interpolated(const gonio_samples *s, unsigned what, int threads, gonio_check_report *report,
                                      gonio_error *error) {
    const size_t c = (size_t)s->channels;
    gonio_kernel kernel;
    gonio_status status = gonio_kernel_new(s, false, &kernel, error);
    if (status != GONIO_OK) {
        return status;
    }
    scattered x = {s, &kernel, malloc(s->n * c * sizeof(double)), malloc(s->n * c * sizeof(double)),
                   malloc(s->n * sizeof(bool))};
    if (x.partner == NULL || x.turn == NULL || x.there == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to compare %zu samples", s->n);
    }
    if (status == GONIO_OK && (what & GONIO_CHECK_OF_RECIPROCITY) != 0) {
        status = reciprocity(&x, threads, report, error);
    }
    if (status == GONIO_OK && (what & GONIO_CHECK_OF_ISOTROPY) != 0) {
        status = isotropy(&x, threads, report, error);
    }
    if (status == GONIO_OK && (what & GONIO_CHECK_OF_ENERGY) != 0) {
        status = energy(&x, report, error);
    }
    if (status == GONIO_OK && (what & GONIO_CHECK_OF_RANKS) != 0) {
        status = gonio_check_gridded_ranks(&kernel.head, threads, report, error);
    }
    free(x.there);
    free(x.turn);
    free(x.partner);
    gonio_kernel_free(&kernel);
    return status;
}
