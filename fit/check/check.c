// SPDX-License-Identifier: BSD-3-Clause
// Physical plausibility of a model.
//
// The directional albedo is an integral over a hemisphere that may hold a lobe of any width, so it is estimated with a
// mixture of densities: the cosine, and Beckmann half vectors of four widths a decade apart (multiple importance
// sampling with the balance heuristic; Veach & Guibas 1995), at the points of a rank-1 lattice, which makes it
// deterministic. A grid would miss a mirror's lobe or spend everything on it.
#include "gonio/check.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/head.h"
#include "base/statistics.h"
#include "base/thread_pool.h"
#include "fit/smooth/matrix.h"
#include "gonio/fit.h"
#include "gonio/plan.h"

#define PAIRS ((size_t)4000)
#define ALBEDO_POINTS 16384
#define WIDTHS 4
static const double widths[WIDTHS] = {0.3, 0.05, 0.01, 0.002};

// ---- pairs ----

static double difference(double a, double b) { return 2 * fabs(a - b) / (fabs(a) + fabs(b) + 2e-3); }

static gonio_vec3 turned(gonio_vec3 v, double angle) {
    const double c = cos(angle), s = sin(angle);
    return (gonio_vec3){c * v.x - s * v.y, s * v.x + c * v.y, v.z};
}

static gonio_status check_pairs(const gonio_model *model, gonio_check_report *report, gonio_error *error) {
    const size_t c = (size_t)model->channels;
    gonio_plan *plan;
    gonio_status status = gonio_plan_make("nusselt:4000,theta_max=80,anisotropic=1", 1, &plan, error);
    if (status != GONIO_OK) {
        return status;
    }
    double *swap = malloc(PAIRS * c * sizeof *swap), *turn = malloc(PAIRS * c * sizeof *turn);
    double *rows = malloc(3 * c * sizeof *rows);
    if (swap == NULL || turn == NULL || rows == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to check a model of %zu channels", c);
    }
    for (size_t i = 0; i < PAIRS && status == GONIO_OK; i++) {
        const gonio_pair *p = &plan->poses[i];
        const gonio_vec3 wi = gonio_direction(p->theta_i, p->phi_i), wo = gonio_direction(p->theta_o, p->phi_o);
        const double angle = GONIO_PI * (sqrt(5) - 1) / 2;
        gonio_model_eval(model, wi, wo, rows);
        gonio_model_eval(model, wo, wi, rows + c);
        gonio_model_eval(model, turned(wi, angle), turned(wo, angle), rows + 2 * c);
        for (size_t k = 0; k < c; k++) {
            report->negative += rows[k] < 0 ? 1 : 0;
            report->not_finite += isfinite(rows[k]) ? 0 : 1;
            swap[i * c + k] = difference(rows[k], rows[c + k]);
            turn[i * c + k] = difference(rows[k], rows[2 * c + k]);
        }
    }
    if (status == GONIO_OK && report->not_finite > 0) {
        status = gonio_fail(error, GONIO_E_FAILED, "%zu of %zu values are not finite", report->not_finite, PAIRS * c);
    }
    if (status == GONIO_OK) {
        report->reciprocity = gonio_median(swap, PAIRS * c);
        report->isotropy = gonio_median(turn, PAIRS * c);
    }
    free(rows);
    free(turn);
    free(swap);
    gonio_plan_free(plan);
    return status;
}

// ---- albedo ----

static double beckmann(double tan2, double cos_h, double m) {
    return exp(-tan2 / (m * m)) / (GONIO_PI * m * m * cos_h * cos_h * cos_h);
}

// The mixture's density at wo, per solid angle: half of it the cosine, the rest the four half-vector densities
// (D cos_h per half vector, 1 / (4 h.wo) for the change of variables).
static double density(gonio_vec3 wi, gonio_vec3 wo) {
    const gonio_vec3 sum = {wi.x + wo.x, wi.y + wo.y, wi.z + wo.z};
    const double length = sqrt(sum.x * sum.x + sum.y * sum.y + sum.z * sum.z);
    const double cos_h = sum.z / length, tan2 = (sum.x * sum.x + sum.y * sum.y) / (sum.z * sum.z);
    double lobes = 0;
    for (int k = 0; k < WIDTHS; k++) {
        lobes += beckmann(tan2, cos_h, widths[k]);
    }
    return 0.5 * wo.z / GONIO_PI + 0.5 * lobes / WIDTHS / (2 * length);
}

// The point (u, v) of the component k (-1: the cosine); false where it falls below the horizon.
static bool sampled(gonio_vec3 wi, int k, double u, double v, gonio_vec3 *wo) {
    const double phi = 2 * GONIO_PI * v;
    if (k < 0) {
        *wo = (gonio_vec3){sqrt(u) * cos(phi), sqrt(u) * sin(phi), sqrt(1 - u)};
        return wo->z > 0;
    }
    const double tan_h = widths[k] * sqrt(-log1p(-u)), cos_h = 1 / sqrt(1 + tan_h * tan_h), sin_h = tan_h * cos_h;
    const gonio_vec3 h = {sin_h * cos(phi), sin_h * sin(phi), cos_h};
    const double dot = 2 * (wi.x * h.x + wi.z * h.z);
    *wo = (gonio_vec3){dot * h.x - wi.x, dot * h.y, dot * h.z - wi.z};
    return wo->z > 0 && dot > 0;
}

void gonio_check_albedo(const gonio_model *model, double theta_i_rad, double *albedo) {
    const int c = model->channels;
    const gonio_vec3 wi = gonio_direction(theta_i_rad, 0);
    double values[GONIO_CHANNELS_MAX];
    for (int k = 0; k < c; k++) {
        albedo[k] = 0;
    }
    for (int i = 0; i < ALBEDO_POINTS; i++) {
        // Of eight points in turn four go to the cosine and one to each width, as the mixture's weights say. The second
        // coordinate steps by the golden ratio within each component.
        const int component = i % 8 < 4 ? -1 : i % 8 - 4, turn = component < 0 ? i / 8 * 4 + i % 8 : i / 8;
        const int count = component < 0 ? ALBEDO_POINTS / 2 : ALBEDO_POINTS / 8;
        gonio_vec3 wo;
        if (!sampled(wi, component, (turn + 0.5) / count, fmod(turn * 0.6180339887498949, 1), &wo)) {
            continue;
        }
        const double weight = wo.z / density(wi, wo) / ALBEDO_POINTS;
        gonio_model_eval(model, wi, wo, values);
        for (int k = 0; k < c; k++) {
            albedo[k] += values[k] * weight;
        }
    }
}

#define ALBEDO_ANGLES 18

typedef struct albedo_job {
    const gonio_model *model;
    double *albedos;
} albedo_job;

static void find_albedo(void *context, size_t t) {
    const albedo_job *job = context;
    gonio_check_albedo(job->model, gonio_radians(5 * (double)t), job->albedos + t * (size_t)job->model->channels);
}

static gonio_status check_energy(const gonio_model *model, int threads, gonio_check_report *report,
                                 gonio_error *error) {
    const size_t c = (size_t)model->channels;
    double *albedos = malloc(ALBEDO_ANGLES * c * sizeof *albedos);
    if (albedos == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to check a model of %zu channels", c);
    }
    gonio_pool_for(threads, ALBEDO_ANGLES, find_albedo, &(albedo_job){model, albedos});
    report->energy = -INFINITY;
    for (size_t k = 0; k < ALBEDO_ANGLES * c; k++) {
        if (albedos[k] > report->energy) {
            report->energy = albedos[k];
            report->energy_theta_rad = gonio_radians(5 * (double)(k / c));
            report->energy_channel = (int)(k % c);
        }
    }
    free(albedos);
    return GONIO_OK;
}

// ---- separability ----

#define HALF_THETAS 24
#define HALF_PHIS 8
#define DIFFERENCE_THETAS 12
#define DIFFERENCE_PHIS 16
#define ROWS (HALF_THETAS * HALF_PHIS)
#define COLUMNS (DIFFERENCE_THETAS * DIFFERENCE_PHIS)

// Below the horizon the direction is lifted to it, which continues f; zeros there would look like structure.
static gonio_vec3 lifted(gonio_vec3 v) {
    const double s = hypot(v.x, v.y);
    return v.z >= 0 || s == 0 ? (gonio_vec3){v.x, v.y, fabs(v.z)} : (gonio_vec3){v.x / s, v.y / s, 0};
}

static void half_difference(int row, int column, gonio_vec3 *wi, gonio_vec3 *wo) {
    // Half vectors up to 75 deg, denser toward the normal; difference vectors up to 75 deg, beyond which f is grazing
    // everywhere.
    const double u = (row / HALF_PHIS + 0.5) / HALF_THETAS;
    const double theta_h = gonio_radians(75) * u * u, phi_h = 2 * GONIO_PI * (row % HALF_PHIS) / HALF_PHIS;
    const double theta_d = gonio_radians(75) * (column / DIFFERENCE_PHIS + 0.5) / DIFFERENCE_THETAS;
    const double phi_d = 2 * GONIO_PI * (column % DIFFERENCE_PHIS + 0.5) / DIFFERENCE_PHIS;
    const gonio_vec3 d = gonio_direction(theta_d, phi_d);
    const double c = cos(theta_h), s = sin(theta_h);
    const gonio_vec3 i = {c * d.x + s * d.z, d.y, c * d.z - s * d.x};
    const double dot = 2 * (i.x * s + i.z * c);
    const gonio_vec3 o = {dot * s - i.x, -i.y, dot * c - i.z};
    *wi = turned(lifted(i), phi_h);
    *wo = turned(lifted(o), phi_h);
}

static gonio_status check_separability(const gonio_model *model, gonio_check_report *report, gonio_error *error) {
    const size_t c = (size_t)model->channels, cells = (size_t)ROWS * COLUMNS;
    double *matrices = malloc(cells * c * sizeof *matrices), *values = malloc(c * sizeof *values);
    double singular[COLUMNS];
    gonio_status status = GONIO_OK;
    if (matrices == NULL || values == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to check a model of %zu channels", c);
    }
    for (size_t at = 0; at < cells && status == GONIO_OK; at++) {
        gonio_vec3 wi, wo;
        half_difference((int)(at / COLUMNS), (int)(at % COLUMNS), &wi, &wo);
        gonio_model_eval(model, wi, wo, values);
        for (size_t k = 0; k < c; k++) {
            matrices[k * cells + at] = values[k];
        }
    }
    double squares[GONIO_CHECK_RANKS] = {0};
    for (size_t k = 0; k < c && status == GONIO_OK; k++) {
        // Seen column by column it is the transpose, which has the same singular values.
        if (!gonio_singular_values(COLUMNS, matrices + k * cells, singular)) {
            status = gonio_fail(error, GONIO_E_CONVERGENCE, "no singular values of the half/difference matrix");
            break;
        }
        double tail = 0, tails[COLUMNS];
        for (int j = COLUMNS - 1; j >= 0; j--) {
            tails[j] = tail; // what rank j + 1 leaves
            tail += singular[j] * singular[j];
        }
        for (int j = 0; j < GONIO_CHECK_RANKS; j++) {
            squares[j] += tail > 0 ? tails[j] / tail : 0;
        }
    }
    for (int j = 0; j < GONIO_CHECK_RANKS; j++) {
        report->separability[j] = sqrt(squares[j] / (double)c);
    }
    free(values);
    free(matrices);
    return status;
}

gonio_status gonio_check_model(const gonio_model *model, int threads, gonio_check_report *report, gonio_error *error) {
    *report = (gonio_check_report){0};
    gonio_status status = check_pairs(model, report, error);
    status = status == GONIO_OK ? check_energy(model, threads, report, error) : status;
    return status == GONIO_OK ? check_separability(model, report, error) : status;
}

gonio_status gonio_check_samples(const gonio_samples *samples, uint64_t seed, int threads, gonio_check_report *report,
                                 gonio_error *error) {
    *report = (gonio_check_report){0};
    gonio_fit_options options;
    gonio_fit_options_default(&options);
    options.method = "mba"; // the figures are medians and integrals: no solve is needed for them
    options.hold_out = 0;
    options.seed = seed;
    options.threads = threads;
    options.symmetry = GONIO_SYMMETRY_MIRROR; // half a hemisphere is often all that was measured; not reciprocity,
                                              // which is what is asked for
    gonio_model *model;
    gonio_fit_report fit;
    gonio_status status = gonio_fit(samples, &options, &model, &fit, error);
    if (status == GONIO_OK) {
        status = gonio_check_model(model, threads, report, error);
        gonio_model_free(model);
    }
    return status;
}

// ---- transforms ----

static gonio_status add_transformed(const gonio_samples *in, size_t i, const gonio_pair *pair, int transforms,
                                    double divisor, gonio_samples *out, gonio_error *error) {
    const size_t c = (size_t)in->channels;
    double values[GONIO_CHANNELS_MAX], random[GONIO_CHANNELS_MAX], systematic[GONIO_CHANNELS_MAX];
    const bool sigma = in->sigma_random != NULL;
    for (size_t k = 0; k < c; k++) {
        const double value = in->values[i * c + k] / divisor;
        values[k] = transforms & GONIO_APPLY_CLAMP ? fmax(value, 0) : value;
        random[k] = sigma ? in->sigma_random[i * c + k] / divisor : 0;
        systematic[k] = sigma ? in->sigma_systematic[i * c + k] / divisor : 0;
    }
    gonio_pair p = *pair;
    if (transforms & GONIO_APPLY_ISOTROPY) {
        p.phi_o = gonio_angle_canonical(remainder(p.phi_o - p.phi_i, 2 * GONIO_PI));
        p.phi_i = 0;
    }
    const gonio_status status = gonio_samples_add(out, &p, values, random, systematic, error);
    return status == GONIO_OK && in->group != NULL ? gonio_samples_set_group(out, out->n - 1, in->group[i], error)
                                                   : status;
}

gonio_status gonio_check_apply(const gonio_samples *samples, int transforms, double energy, gonio_samples **out,
                               gonio_error *error) {
    const double divisor = (transforms & GONIO_APPLY_ENERGY) && energy > 1 ? energy : 1;
    gonio_status status = gonio_samples_new(samples->channels, samples->sigma_random != NULL, out, error);
    if (status != GONIO_OK) {
        return status;
    }
    (*out)->isotropic = samples->isotropic || (transforms & GONIO_APPLY_ISOTROPY);
    for (int c = 0; c < samples->channels; c++) {
        snprintf((*out)->channel_names[c], GONIO_CHANNEL_NAME_MAX, "%s", samples->channel_names[c]);
    }
    status = gonio_head_copy(samples->head, &(*out)->head, error);
    for (size_t i = 0; i < samples->n && status == GONIO_OK; i++) {
        gonio_pair images[4] = {samples->pairs[i]};
        int n = 1;
        if (transforms & GONIO_APPLY_MIRROR) {
            images[n++] = gonio_pair_mirrored(images[0]);
        }
        if (transforms & GONIO_APPLY_RECIPROCITY) {
            for (int k = n; k-- > 0;) {
                images[n + k] = gonio_pair_swapped(images[k]);
            }
            n *= 2;
        }
        for (int k = 0; k < n && status == GONIO_OK; k++) {
            status = add_transformed(samples, i, &images[k], transforms, divisor, *out, error);
        }
    }
    if (status != GONIO_OK) {
        gonio_samples_free(*out);
        *out = NULL;
    }
    return status;
}
