// SPDX-License-Identifier: BSD-3-Clause
// The measures of a model: the limits of a table's sums as its grid is refined.
//
// A table's P_r and P_i are means over equal steps of theta and azimuth, so here they are means over theta and azimuth,
// without the sine. The integral over the outgoing direction adapts itself (fit/check/cubature.h); its first panels
// close in on the mirror direction and on the light's from 0.2 rad down to 1e-4, so that no lobe slips through between
// them, and the albedo is held against one by importance (fit/check/albedo.c). Outside, theta_i runs over
// Gauss-Legendre nodes and phi_i, of anisotropic models, over equal steps.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/statistics.h"
#include "base/thread_pool.h"
#include "fit/check/albedo.h"
#include "fit/check/cubature.h"
#include "fit/check/measures.h"
#include "fit/check/significance.h"
#include "gonio/plan.h"

enum { NODES = 24, ANGLES = 18, AZIMUTHS = 16, EDGES = 40, PAIRS = 4000, CONTROL = 4096 };
static const struct {
    double tolerance, agreement;   // of the adaptive integrals; between both albedos
    size_t most, most_anisotropic; // evaluations of an incidence, a turned set counting as one
} tuning = {1e-6, 0.01, 16000, 16000};

// Eight Gauss-Legendre nodes in each of three panels that close in on grazing incidence.
static double node(int k, double *weight) {
    static const double x[4] = {0.1834346424956498, 0.5255324099163290, 0.7966664774136267, 0.9602898564975363};
    static const double w[4] = {0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763};
    static const double border[4] = {0, 45, 75, 90};
    const double low = gonio_radians(border[k / 8]), high = gonio_radians(border[k / 8 + 1]);
    const int j = k % 8 < 4 ? 3 - k % 8 : k % 8 - 4;
    *weight = w[j] * (high - low) / GONIO_PI; // of the mean over 0 to 90 deg
    return (low + high) / 2 + (high - low) / 2 * (k % 8 < 4 ? -x[j] : x[j]);
}

typedef struct model_job {
    const gonio_model *model;
    int azimuths;
    double *sums; // [NODES + ANGLES][azimuths channels + 3]: albedos, P_r, P_i, mean square of f
    double *gap;  // [NODES + ANGLES] error estimates, relative
} model_job;

typedef struct place {
    const gonio_model *model;
    int azimuths;
    double theta_i;
} place;

// Every azimuth's f sin cos, then the mean squares' half of f - f', the standard deviation over azimuths, and the
// squares of f.
static void integrand(void *context, double theta, double phi, double *out) {
    const place *p = context;
    const size_t c = (size_t)p->model->channels, n = (size_t)p->azimuths;
    double there[GONIO_CHANNELS_MAX], back[GONIO_CHANNELS_MAX], *extra = out + n * c;
    const double area = 1 / (GONIO_PI * GONIO_PI); // of theta_r x phi, for means
    memset(extra, 0, 3 * sizeof *extra);
    for (size_t j = 0; j < n; j++) {
        const double turn = 2 * GONIO_PI * (double)j / (double)n;
        const gonio_vec3 wi = gonio_direction(p->theta_i, turn), wo = gonio_direction(theta, phi + turn);
        gonio_model_eval(p->model, wi, wo, there);
        gonio_model_eval(p->model, wo, wi, back);
        for (size_t k = 0; k < c; k++) {
            out[j * c + k] = there[k];
            extra[0] += (there[k] - back[k]) * (there[k] - back[k]) / 2 * area / (double)(n * c);
            extra[2] += there[k] * there[k] * area / (double)(n * c);
        }
    }
    for (size_t k = 0; k < c && n > 1; k++) {
        double mean = 0, squares = 0;
        for (size_t j = 0; j < n; j++) {
            mean += out[j * c + k] / (double)n;
        }
        for (size_t j = 0; j < n; j++) {
            squares += (out[j * c + k] - mean) * (out[j * c + k] - mean);
        }
        extra[1] += sqrt(squares / (double)n) * area / (double)c;
    }
    for (size_t j = 0; j < n * c; j++) {
        out[j] *= sin(theta) * cos(theta);
    }
}

// Borders that close in on `centre` from both sides, within [low, high].
static size_t close_in(double low, double high, double centre, double *edge, size_t n) {
    static const double distance[] = {0.2, 0.05, 0.01, 1e-3, 1e-4};
    edge[n++] = fmin(fmax(centre, low), high);
    for (size_t k = 0; k < sizeof distance / sizeof *distance; k++) {
        for (int side = -1; side <= 1; side += 2) {
            const double e = centre + side * distance[k];
            if (e > low && e < high) {
                edge[n++] = e;
            }
        }
    }
    return n;
}

static size_t unite(double *edge, size_t n) {
    size_t count = 0;
    gonio_sort(edge, n);
    for (size_t k = 0; k < n; k++) {
        if (count == 0 || edge[k] - edge[count - 1] > 1e-9) {
            edge[count++] = edge[k];
        }
    }
    return count;
}

// Integrals over the outgoing hemisphere for light at theta_i: panels close in on the mirror direction and the light's.
static gonio_status over_hemisphere(void (*f)(void *context, double theta, double phi, double *out), void *context,
                                    double theta_i, size_t n, bool turns, double *sums, double *gap,
                                    gonio_error *error) {
    double theta[EDGES] = {0, GONIO_PI / 2, 0.6, 1.1, 1.4}, phi[EDGES] = {0, 2 * GONIO_PI, 0.8, 1.6, 2.4};
    size_t nx = close_in(0, GONIO_PI / 2, theta_i, theta, 5), ny = close_in(0, 2 * GONIO_PI, GONIO_PI, phi, 5);
    ny = close_in(0, 2 * GONIO_PI, 0, phi, ny);
    for (int side = 0; side < 3; side++) {
        phi[ny++] = 2 * GONIO_PI - phi[2 + side];
    }
    const gonio_cubature c = {.f = f,
                              .context = context,
                              .n = n,
                              .x = theta,
                              .y = phi,
                              .nx = unite(theta, nx),
                              .ny = unite(phi, ny),
                              .tolerance = tuning.tolerance,
                              .most = turns ? tuning.most_anisotropic : tuning.most};
    return gonio_cubature_run(&c, sums, gap, error);
}

static gonio_status integrate(void *context, size_t k, gonio_error *error) {
    const model_job *j = context;
    const size_t n = (size_t)(j->azimuths * j->model->channels) + 3;
    double weight;
    place p = {j->model, j->azimuths, k < NODES ? node((int)k, &weight) : gonio_radians(5.0 * (double)(k - NODES))};
    return over_hemisphere(integrand, &p, p.theta_i, n, j->azimuths > 1, j->sums + k * n, &j->gap[k], error);
}

// ---- albedos alone ----

static void reflected(void *context, double theta, double phi, double *out) {
    const place *p = context;
    const size_t c = (size_t)p->model->channels, n = (size_t)p->azimuths;
    for (size_t j = 0; j < n; j++) {
        const double turn = 2 * GONIO_PI * (double)j / (double)n;
        gonio_model_eval(p->model, gonio_direction(p->theta_i, turn), gonio_direction(theta, phi + turn), out + j * c);
    }
    for (size_t j = 0; j < n * c; j++) {
        out[j] *= sin(theta) * cos(theta);
    }
}

gonio_status gonio_check_albedo_exactly(const gonio_model *model, double theta_i, int azimuths, double *albedos,
                                        double *gap, gonio_error *error) {
    place p = {model, azimuths, theta_i};
    const size_t c = (size_t)model->channels;
    double other[GONIO_CHANNELS_MAX];
    const gonio_status status =
        over_hemisphere(reflected, &p, theta_i, c * (size_t)azimuths, azimuths > 1, albedos, gap, error);
    for (int j = 0; status == GONIO_OK && j < azimuths; j++) {
        memset(other, 0, sizeof other);
        gonio_check_albedo_shares(model, theta_i, 2 * GONIO_PI * j / azimuths, CONTROL, 1, other);
        for (size_t k = 0; k < c; k++) {
            double *value = &albedos[(size_t)j * c + k];
            if (other[k] - *value > tuning.agreement * fabs(other[k])) { // a lobe that the panels missed
                *gap = fmax(*gap, (other[k] - *value) / other[k]);
                *value = other[k];
            }
        }
    }
    return status;
}

// ---- the report ----

static void take_albedo(const model_job *j, size_t k, gonio_check_albedo_point *a) {
    const size_t c = (size_t)j->model->channels, n = (size_t)j->azimuths * c + 3;
    const double *sum = j->sums + (NODES + k) * n;
    double other[GONIO_CHANNELS_MAX];
    gonio_check_albedo_nodes(j->model, gonio_radians(5.0 * (double)k), CONTROL, other);
    *a = (gonio_check_albedo_point){.theta_i = gonio_radians(5.0 * (double)k), .largest = -INFINITY, .covered = 1};
    const double gap = j->gap[NODES + k];
    for (size_t i = 0; i < (size_t)j->azimuths * c; i++) {
        // A lobe that the panels missed is in the other one.
        const bool missed = i < c && other[i] - sum[i] > tuning.agreement * fabs(other[i]);
        const double value = missed ? other[i] : sum[i];
        a->integration = missed ? fmax(a->integration, other[i] - sum[i]) : a->integration;
        a->value += value / (double)(j->azimuths * (int)c);
        a->integration = fmax(a->integration, fmin(gap, 1) * fabs(value));
        if (value > a->largest) {
            a->largest = value;
            a->channel = (int)(i % c);
            a->phi_i = 2 * GONIO_PI * (double)(i / c) / j->azimuths;
        }
    }
}

static gonio_status take_sums(const model_job *j, gonio_check_report *r, gonio_error *error) {
    const size_t c = (size_t)j->model->channels, n = (size_t)j->azimuths * c + 3;
    r->albedos = calloc(ANGLES, sizeof *r->albedos);
    if (r->albedos == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for albedos");
    }
    r->incidences = ANGLES;
    for (size_t k = 0; k < ANGLES; k++) {
        take_albedo(j, k, &r->albedos[k]);
    }
    gonio_check_sum_up_albedos(r);
    // The means over theta_i come from the nodes of the quadrature, not from the curve.
    r->excess = r->albedo = r->reciprocity = r->isotropy = 0;
    for (size_t k = 0; k < NODES; k++) {
        double weight;
        node((int)k, &weight);
        const double *sum = j->sums + k * n;
        for (size_t a = 0; a < (size_t)j->azimuths; a++) {
            double albedo = 0;
            for (size_t q = 0; q < c; q++) {
                albedo += sum[a * c + q] / (double)c;
                if (sum[a * c + q] > r->energy) {
                    double unused;
                    r->energy = sum[a * c + q];
                    r->energy_theta_rad = node((int)k, &unused);
                    r->energy_phi_rad = 2 * GONIO_PI * (double)a / j->azimuths;
                    r->energy_channel = (int)q;
                }
            }
            r->albedo += weight * albedo / j->azimuths;
            r->excess += weight * fmax(0, albedo - 1) / j->azimuths;
        }
        r->reciprocity += weight * sum[n - 3];
        r->isotropy += weight * sum[n - 2];
    }
    r->energy_range.mean = 100 * r->albedo;
    return GONIO_OK;
}

// ---- pairs of directions ----

static gonio_vec3 turned(gonio_vec3 v, double angle) {
    const double c = cos(angle), s = sin(angle);
    return (gonio_vec3){c * v.x - s * v.y, s * v.x + c * v.y, v.z};
}

static gonio_status compare(const gonio_model *model, const gonio_plan *plan, gonio_differences d[2],
                            gonio_check_report *r, gonio_error *error) {
    const size_t c = (size_t)model->channels;
    double here[GONIO_CHANNELS_MAX], swap[GONIO_CHANNELS_MAX], turn[GONIO_CHANNELS_MAX], apart = 0;
    for (size_t i = 0; i < plan->n; i++) {
        const gonio_pair *p = &plan->poses[i];
        const gonio_vec3 wi = gonio_direction(p->theta_i, p->phi_i), wo = gonio_direction(p->theta_o, p->phi_o);
        const double angle = GONIO_PI * (sqrt(5) - 1) / 2;
        gonio_model_eval(model, wi, wo, here);
        gonio_model_eval(model, wo, wi, swap);
        gonio_model_eval(model, turned(wi, angle), turned(wo, angle), turn);
        for (size_t k = 0; k < c; k++) {
            r->negative += here[k] < 0 ? 1 : 0;
            r->not_finite += isfinite(here[k]) ? 0 : 1;
            apart += fabs(here[k] - turn[k]) / 2 / (double)(plan->n * c);
            gonio_differences_add(&d[0], here[k], swap[k], p, (int)k);
            gonio_differences_add(&d[1], here[k], turn[k], p, (int)k);
        }
    }
    r->isotropy = model->isotropic ? apart : 0; // of two azimuths the standard deviation is half the difference
    return r->not_finite > 0
               ? gonio_fail(error, GONIO_E_FAILED, "%zu of %zu values are not finite", r->not_finite, plan->n * c)
               : GONIO_OK;
}

static gonio_status check_pairs(const gonio_model *model, gonio_check_report *r, gonio_error *error) {
    const size_t n = PAIRS * (size_t)model->channels;
    gonio_plan *plan;
    gonio_status status = gonio_plan_make("nusselt:4000,theta_max=80,anisotropic=1", 1, &plan, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_differences d[2];
    const bool first = gonio_differences_begin(&d[0], n), ready = gonio_differences_begin(&d[1], n) && first;
    status = ready ? compare(model, plan, d, r, error)
                   : gonio_fail(error, GONIO_E_MEMORY, "no memory to check a model of %d channels", model->channels);
    r->reciprocity_range = gonio_differences_end(&d[0], &r->reciprocity_median);
    r->isotropy_range = gonio_differences_end(&d[1], &r->isotropy_median);
    gonio_plan_free(plan);
    return status;
}

gonio_status gonio_check_half_model(const gonio_model *model, int threads, gonio_check_report *report,
                                    gonio_error *error) {
    *report = (gonio_check_report){.form = GONIO_CHECK_MODEL, .reciprocity_expected = NAN};
    report->reciprocity_test = report->isotropy_test = report->energy_test = gonio_check_no_test;
    gonio_status status = check_pairs(model, report, error);
    const double apart = report->isotropy;
    model_job j = {.model = model, .azimuths = model->isotropic ? 1 : AZIMUTHS};
    const size_t n = (size_t)(j.azimuths * model->channels) + 3;
    j.sums = calloc((NODES + ANGLES) * n, sizeof *j.sums);
    j.gap = calloc(NODES + ANGLES, sizeof *j.gap);
    if (status == GONIO_OK && (j.sums == NULL || j.gap == NULL)) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to check a model of %d channels", model->channels);
    }
    status = status == GONIO_OK ? gonio_pool_try(threads, NODES + ANGLES, integrate, &j, error) : status;
    status = status == GONIO_OK ? take_sums(&j, report, error) : status;
    report->isotropy = model->isotropic ? apart : report->isotropy;
    double squares = 0;
    for (int k = 0; k < NODES && status == GONIO_OK; k++) {
        double weight;
        node(k, &weight);
        squares += weight * j.sums[((size_t)k + 1) * n - 1];
    }
    free(j.gap);
    free(j.sums);
    status = status == GONIO_OK ? gonio_check_gridded_ranks(model, threads, report, error) : status;
    report->mean_square_seen = squares > 0 ? report->mean_square / squares : 1;
    return status;
}
