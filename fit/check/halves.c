// SPDX-License-Identifier: BSD-3-Clause
// The measures of a thin sheet that transmits. Energy counts what each side's two halves give off together; the rest is
// of one half, as if it were all there is.
#include <math.h>
#include <stdlib.h>

#include "base/thread_pool.h"
#include "fit/check/measures.h"

enum { ANGLES = 18, AZIMUTHS = 8 };

static gonio_half first_of(unsigned halves) {
    static const gonio_half order[] = {GONIO_REFLECTION, GONIO_REFLECTION_BACK, GONIO_TRANSMISSION,
                                       GONIO_TRANSMISSION_BACK};
    int k = 0;
    while (k < GONIO_HALVES - 1 && !(halves >> order[k] & 1)) {
        k++;
    }
    return order[k];
}

static bool has_side(unsigned halves, int side) { return (halves >> side & 3) != 0; }

// A half's theta_i as the sheet has it.
static double theta_from(int side, double theta) { return side == GONIO_REFLECTION ? theta : GONIO_PI - theta; }

// ---- a model ----

typedef struct sheet_job {
    const gonio_model *model;
    size_t turns;    // azimuths of the light
    double *albedos; // [half][ANGLES][turns][channels]
    double *gaps;    // [half][ANGLES], relative
} sheet_job;

static double *albedos_at(const sheet_job *j, size_t half, size_t angle, size_t turn) {
    const size_t c = (size_t)j->model->channels;
    return j->albedos + ((half * ANGLES + angle) * j->turns + turn) * c;
}

static gonio_status find_albedos(void *context, size_t at, gonio_error *error) {
    const sheet_job *j = context;
    const gonio_model *part = gonio_model_half(j->model, (gonio_half)(at / ANGLES));
    return part != NULL ? gonio_check_albedo_exactly(part, gonio_radians(5.0 * (double)(at % ANGLES)), (int)j->turns,
                                                     albedos_at(j, at / ANGLES, at % ANGLES, 0), &j->gaps[at], error)
                        : GONIO_OK;
}

static void take_point(const sheet_job *j, int side, size_t angle, gonio_check_albedo_point *a) {
    const size_t c = (size_t)j->model->channels, n = j->turns * c;
    *a = (gonio_check_albedo_point){
        .theta_i = theta_from(side, gonio_radians(5.0 * (double)angle)), .largest = -INFINITY, .covered = 1};
    const double gap[2] = {j->gaps[(size_t)side * ANGLES + angle],
                           j->gaps[((size_t)side + GONIO_TRANSMISSION) * ANGLES + angle]};
    for (size_t turn = 0; turn < j->turns; turn++) {
        const double *reflected = albedos_at(j, (size_t)side, angle, turn);
        const double *through = albedos_at(j, (size_t)side + GONIO_TRANSMISSION, angle, turn);
        for (size_t k = 0; k < c; k++) {
            const double sum = reflected[k] + through[k];
            a->reflected += reflected[k] / (double)n;
            a->transmitted += through[k] / (double)n;
            a->integration =
                fmax(a->integration, fmin(gap[0], 1) * fabs(reflected[k]) + fmin(gap[1], 1) * fabs(through[k]));
            if (sum > a->largest) {
                a->largest = sum;
                a->channel = (int)k;
                a->phi_i = 2 * GONIO_PI * (double)turn / (double)j->turns;
            }
        }
    }
    a->value = a->reflected + a->transmitted;
}

static gonio_status sheet_energy(const gonio_model *model, unsigned halves, int threads, gonio_check_report *r,
                                 gonio_error *error) {
    sheet_job j = {.model = model, .turns = model->isotropic ? 1 : AZIMUTHS};
    j.albedos = calloc(GONIO_HALVES * ANGLES * j.turns * (size_t)model->channels, sizeof *j.albedos);
    j.gaps = calloc((size_t)GONIO_HALVES * ANGLES, sizeof *j.gaps);
    gonio_check_report_free(r);
    r->albedos = calloc(2 * (size_t)ANGLES, sizeof *r->albedos);
    r->incidences = 0;
    gonio_status status =
        j.albedos != NULL && j.gaps != NULL && r->albedos != NULL
            ? gonio_pool_try(threads, (size_t)GONIO_HALVES * ANGLES, find_albedos, &j, error)
            : gonio_fail(error, GONIO_E_MEMORY, "no memory to check a model of %d channels", model->channels);
    for (int side = 0; side < GONIO_HALVES && status == GONIO_OK; side += GONIO_REFLECTION_BACK) {
        for (size_t angle = 0; angle < ANGLES && has_side(halves, side); angle++) {
            take_point(&j, side, angle, &r->albedos[r->incidences++]);
        }
    }
    free(j.albedos);
    free(j.gaps);
    r->excess = r->albedo = 0;
    if (status == GONIO_OK) {
        gonio_check_sum_up_albedos(r);
    }
    return status;
}

gonio_status gonio_check_model(const gonio_model *model, int threads, gonio_check_report *report, gonio_error *error) {
    if (!model->ops->both_sides) {
        return gonio_check_half_model(model, threads, report, error);
    }
    unsigned halves = 0;
    for (int h = 0; h < GONIO_HALVES; h++) {
        halves |= gonio_model_half(model, (gonio_half)h) != NULL ? 1u << h : 0;
    }
    const gonio_half first = first_of(halves);
    gonio_status status = gonio_check_half_model(gonio_model_half(model, first), threads, report, error);
    report->transmission = true;
    report->half = first;
    status = status == GONIO_OK ? sheet_energy(model, halves, threads, report, error) : status;
    if (status != GONIO_OK) {
        gonio_check_report_free(report);
    }
    return status;
}

// ---- samples ----

typedef struct merger {
    const gonio_check_report *part; // [GONIO_HALVES]
    gonio_check_report *r;          // whose arrays are filled
    size_t channels;
    bool isotropic;
} merger;

// The albedo of the half `other` for the light of this one; NULL: none was measured.
static const gonio_check_albedo_point *partner(const merger *m, int other, const gonio_check_albedo_point *a) {
    const gonio_check_report *part = &m->part[other];
    for (size_t k = 0; k < part->incidences; k++) {
        const gonio_check_albedo_point *b = &part->albedos[k];
        const double turn = fabs(remainder(a->phi_i - b->phi_i, 2 * GONIO_PI));
        if (fabs(a->theta_i - b->theta_i) < 1e-6 && (m->isotropic || a->theta_i < 1e-6 || turn < 1e-6)) {
            return b;
        }
    }
    return NULL;
}

// The channels' sums; the largest is theirs where there are several.
static void add_channels(merger *m, int half, const gonio_check_albedo_point *a, int other,
                         const gonio_check_albedo_point *b, gonio_check_albedo_point *sum) {
    const size_t c = m->channels, at = m->r->incidences * c;
    const gonio_check_report *one = &m->part[half], *two = &m->part[other];
    const size_t i = (size_t)(a - one->albedos) * c, j = b != NULL ? (size_t)(b - two->albedos) * c : 0;
    sum->largest = -INFINITY;
    for (size_t k = 0; k < c; k++) {
        m->r->channel_albedos[at + k] = one->channel_albedos[i + k] + (b != NULL ? two->channel_albedos[j + k] : 0);
        m->r->channel_sigmas[at + k] = hypot(one->channel_sigmas[i + k], b != NULL ? two->channel_sigmas[j + k] : 0);
        if (m->r->channel_albedos[at + k] > sum->largest) {
            sum->largest = m->r->channel_albedos[at + k];
            sum->channel = (int)k;
        }
    }
    sum->largest = c == 1 ? sum->value : fmax(sum->largest, sum->value);
    sum->largest = isfinite(sum->value) ? sum->largest : NAN;
}

// An albedo of the half with its partner of the other one of the same side, where there is one.
static void add_point(merger *m, int half, const gonio_check_albedo_point *a, const gonio_check_albedo_point *b) {
    const int side = half & GONIO_REFLECTION_BACK, other = half ^ GONIO_TRANSMISSION;
    gonio_check_albedo_point sum = *a;
    sum.theta_i = theta_from(side, a->theta_i);
    if (b != NULL) {
        sum.value += b->value;
        sum.random = hypot(a->random, b->random);
        sum.systematic += b->systematic;
        sum.integration += b->integration;
        sum.covered = fmin(a->covered, b->covered);
    }
    const double there = b != NULL ? b->value : NAN;
    sum.reflected = half == side ? a->value : there;
    sum.transmitted = half == side ? there : a->value;
    add_channels(m, half, a, other, b, &sum);
    m->r->albedos[m->r->incidences++] = sum;
}

static gonio_status merge(merger *m, gonio_error *error) {
    size_t room = 1;
    for (int h = 0; h < GONIO_HALVES; h++) {
        room += m->part[h].incidences;
    }
    m->r->incidences = 0;
    m->r->albedos = calloc(room, sizeof *m->r->albedos);
    m->r->channel_albedos = calloc(room * m->channels, sizeof(double));
    m->r->channel_sigmas = calloc(room * m->channels, sizeof(double));
    if (m->r->albedos == NULL || m->r->channel_albedos == NULL || m->r->channel_sigmas == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu albedos", room);
    }
    for (int h = 0; h < GONIO_HALVES; h++) {
        const int other = h ^ GONIO_TRANSMISSION;
        for (size_t k = 0; k < m->part[h].incidences; k++) {
            const gonio_check_albedo_point *a = &m->part[h].albedos[k], *b = partner(m, other, a);
            if ((h & GONIO_TRANSMISSION) == 0 || b == NULL) { // else it stands with its reflection
                add_point(m, h, a, b);
            }
        }
    }
    m->r->excess = m->r->albedo = 0;
    gonio_check_sum_up_albedos(m->r);
    gonio_check_test_energy(m->r, (int)m->channels);
    return GONIO_OK;
}

static gonio_status check_half(const gonio_samples *samples, gonio_half half, int threads, gonio_check_report *part,
                               gonio_error *error) {
    gonio_samples *raised;
    gonio_error why = {.line = -1, .byte = -1};
    gonio_status status = gonio_samples_half(samples, half, NULL, &raised, error);
    if (status == GONIO_OK) {
        status = gonio_check_half_samples(raised, threads, part, &why);
        gonio_samples_free(raised);
        status =
            status == GONIO_OK ? GONIO_OK : gonio_fail(error, status, "%s: %s", gonio_half_name(half), why.message);
    }
    return status;
}

static gonio_status check_sheet(const gonio_samples *samples, int threads, gonio_check_report *report,
                                gonio_error *error) {
    gonio_check_report part[GONIO_HALVES] = {0};
    const unsigned halves = gonio_samples_halves(samples);
    const gonio_half first = first_of(halves);
    *report = (gonio_check_report){0};
    gonio_status status = gonio_samples_check(samples, error);
    for (int h = 0; h < GONIO_HALVES && status == GONIO_OK; h++) {
        status = halves >> h & 1 ? check_half(samples, (gonio_half)h, threads, &part[h], error) : GONIO_OK;
    }
    if (status == GONIO_OK) {
        *report = part[first];
        report->albedos = NULL;
        report->channel_albedos = report->channel_sigmas = NULL;
        report->transmission = true;
        report->half = first;
        report->negative = report->not_finite = 0;
        for (int h = 0; h < GONIO_HALVES; h++) {
            report->negative += part[h].negative;
            report->not_finite += part[h].not_finite;
        }
        merger m = {part, report, (size_t)samples->channels, samples->isotropic};
        status = merge(&m, error);
    }
    for (int h = 0; h < GONIO_HALVES; h++) {
        gonio_check_report_free(&part[h]);
    }
    if (status != GONIO_OK) {
        gonio_check_report_free(report);
    }
    return status;
}

gonio_status gonio_check_samples(const gonio_samples *samples, int threads, gonio_check_report *report,
                                 gonio_error *error) {
    return samples->transmission && samples->n > 0 && gonio_samples_halves(samples) != 1u << GONIO_REFLECTION
               ? check_sheet(samples, threads, report, error)
               : gonio_check_half_samples(samples, threads, report, error);
}
