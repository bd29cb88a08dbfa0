// SPDX-License-Identifier: BSD-3-Clause
#include "fit/check/measures.h"

#include <math.h>
#include <stdlib.h>

#include "base/statistics.h"
#include "fit/check/significance.h"

const char *gonio_check_form_name(gonio_check_form form) {
    static const char *const names[] = {"uniform", "semi-uniform", "scattered", "model"};
    return names[form];
}

void gonio_check_report_free(gonio_check_report *report) {
    free(report->albedos);
    free(report->channel_albedos);
    free(report->channel_sigmas);
    report->albedos = NULL;
    report->channel_albedos = report->channel_sigmas = NULL;
}

// ---- differences ----

bool gonio_differences_begin(gonio_differences *d, size_t expected) {
    *d = (gonio_differences){.range = {.low = INFINITY, .high = -1, .channel = -1}};
    d->stride = expected / GONIO_CHECK_KEPT + 1;
    const size_t kept = expected < GONIO_CHECK_KEPT ? expected : GONIO_CHECK_KEPT;
    d->room = kept;
    d->kept = malloc((kept + 1) * sizeof *d->kept);
    return d->kept != NULL;
}

void gonio_differences_add(gonio_differences *d, double a, double b, const gonio_pair *where, int channel) {
    const double size = fabs(a) + fabs(b), part = size > 0 ? 200 * fabs(a - b) / size : 0;
    gonio_check_range *r = &d->range;
    r->low = fmin(r->low, part);
    r->mean += part;
    if (part > r->high) {
        r->high = part;
        r->where = *where;
        r->channel = channel;
    }
    if (r->compared++ % d->stride == 0 && d->kept_n < d->room) {
        d->kept[d->kept_n++] = 2 * fabs(a - b) / (size + 2e-3);
    }
}

gonio_check_range gonio_differences_end(gonio_differences *d, double *median) {
    gonio_check_range r = d->range;
    *median = r.compared > 0 && d->kept != NULL ? gonio_median(d->kept, d->kept_n) : NAN;
    free(d->kept);
    d->kept = NULL;
    if (r.compared == 0) {
        r.low = r.high = r.mean = NAN;
    } else {
        r.mean /= (double)r.compared;
    }
    return r;
}

// ---- albedos ----

void gonio_check_sum_up_albedos(gonio_check_report *r) {
    r->energy = -INFINITY;
    r->energy_range = (gonio_check_range){.low = INFINITY, .high = -INFINITY};
    size_t n = 0;
    for (size_t k = 0; k < r->incidences; k++) {
        const gonio_check_albedo_point *a = &r->albedos[k];
        if (!isfinite(a->value)) {
            continue;
        }
        n++;
        r->excess += fmax(0, a->value - 1);
        r->albedo += a->value;
        r->energy_range.low = fmin(r->energy_range.low, 100 * a->value);
        r->energy_range.high = fmax(r->energy_range.high, 100 * a->value);
        if (a->largest > r->energy) {
            r->energy = a->largest;
            r->energy_theta_rad = a->theta_i;
            r->energy_phi_rad = a->phi_i;
            r->energy_channel = a->channel;
        }
    }
    r->excess = n > 0 ? r->excess / (double)n : NAN;
    r->albedo = n > 0 ? r->albedo / (double)n : NAN;
    r->energy = n > 0 ? r->energy : NAN;
    r->energy_range.mean = 100 * r->albedo;
    r->energy_range.low = n > 0 ? r->energy_range.low : NAN;
    r->energy_range.high = n > 0 ? r->energy_range.high : NAN;
    r->energy_range.compared = n;
    r->energy_range.channel = r->energy_channel;
    r->energy_range.where = (gonio_pair){r->energy_theta_rad, r->energy_phi_rad, 0, 0};
}

void gonio_check_test_energy(gonio_check_report *r, int channels) {
    const double *values = r->channel_albedos, *sigmas = r->channel_sigmas;
    const size_t c = (size_t)channels;
    int joined = 0;
    r->energy_test = gonio_check_no_test;
    for (size_t k = 0; k < r->incidences * c; k++) {
        if (sigmas[k] > 0 && isfinite(values[k])) {
            const double z = fmax((values[k] - 1) / sigmas[k], 0);
            const double p = gonio_normal_beyond((values[k] - 1) / sigmas[k]);
            gonio_check_join(&r->energy_test, &joined, &(gonio_check_test){z * z, 1, p, (int)(k % c), p});
        }
    }
}

bool gonio_check_sums_begin(gonio_check_sums *s, size_t channels) {
    s->square = calloc(4 * channels, sizeof *s->square);
    s->chi2 = s->square != NULL ? s->square + channels : NULL;
    s->dof = s->square != NULL ? s->chi2 + channels : NULL;
    s->expected = s->square != NULL ? s->dof + channels : NULL;
    return s->square != NULL;
}

gonio_check_test gonio_check_sums_test(const gonio_check_sums *s, int channels) {
    gonio_check_test one = gonio_check_no_test;
    int n = 0;
    for (int c = 0; c < channels; c++) {
        if (s->dof[c] > 0) {
            const double p = gonio_chi_square_beyond(s->dof[c], s->chi2[c]);
            gonio_check_join(&one, &n, &(gonio_check_test){s->chi2[c], s->dof[c], p, c, p});
        }
    }
    return one;
}

double gonio_check_mean(const double *values, size_t n) {
    double sum = 0;
    for (size_t k = 0; k < n; k++) {
        sum += values[k];
    }
    return sum / (double)n;
}
