// SPDX-License-Identifier: BSD-3-Clause
// The uncertainty of large sets.
//
// No closed form: the choice is fitted once more without some geometries, scattered ones, all within some balls, and
// those of the largest angles. What is left unknown at a place is measured by the squared distance to the fourth
// nearest sample; the noise that the fit passes on, by fitting a draw of noise once (a replicate), and grows with the
// volume to that sample. The law that holds them against the residuals is that of small sets (fit/sigma/law.c).
// What the spline adds to the base (S) is taken about its median: without a base its mean value is no error's sign.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/nearest.h"
#include "base/order_statistic.h"
#include "base/random.h"
#include "base/statistics.h"
#include "fit/lobes/fit.h"
#include "fit/prepare/scatter.h"
#include "fit/sigma/field.h"
#include "fit/sigma/law.h"
#include "fit/sigma/sigma.h"
#include "fit/sigma/tuning.h"

#define NEAREST 4
#define SCATTERED 10    // one of so many is left out
#define BEYOND 12       // one of so many, of the largest theta_o and theta_i each
#define RECORDS 700     // of each kind
#define SEARCHED 100000 // samples among which the nearest are sought
#define HOLES 27        // balls: nine of each radius, over all 27 some per cent of the domain
static const double radii[] = {0.03, 0.06, 0.12};

#define FEWEST 20 // fewer geometries tell no error once some are left out: the model has no sigma

enum { KEPT, ALONE, IN_HOLE, AT_EDGE };

// ---- distances ----

typedef struct places {
    size_t n, d, stride;
    double *x; // n x d
    unsigned mirror_axes;
} places;

// In half-vector coordinates: projections shrink the angles near the horizon, where BRDFs change most.
static gonio_status places_init(places *p, const gonio_dataset *data, const gonio_smooth_form *form,
                                gonio_error *error) {
    *p = (places){.n = data->measured, .d = (size_t)data->dims, .stride = 1 + data->n / SEARCHED};
    p->mirror_axes = form->mirror ? gonio_coordinates_mirror_axes(GONIO_HALF_VECTOR, data->dims) : 0;
    p->x = malloc(data->n * p->d * sizeof *p->x);
    if (p->x == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty of %zu samples", data->n);
    }
    gonio_dataset_locate(data, GONIO_HALF_VECTOR, p->x);
    return GONIO_OK;
}

static double distance2(const places *p, size_t i, const double *at) {
    return gonio_scatter_distance2(p->x + i * p->d, at, p->d, p->mirror_axes);
}

// Squared distance to the NEAREST-th sample; where only some are looked at, as much less as there are more.
static double gap2(const places *p, const double *at) {
    gonio_nearest nearest = {.wanted = NEAREST};
    for (size_t i = 0; i < p->n; i += p->stride) {
        gonio_nearest_show(&nearest, distance2(p, i, at), i);
    }
    return gonio_nearest_reach(&nearest) * pow((double)p->stride, -2 / (double)p->d);
}

// ---- what to leave out ----

static int by_gap(const void *left, const void *right) {
    const double a = *(const double *)left, b = *(const double *)right;
    return (a > b) - (a < b);
}

static void mark_beyond(const gonio_dataset *data, bool outgoing, char *why, double *work) {
    for (size_t i = 0; i < data->measured; i++) {
        work[i] = outgoing ? data->pairs[i].theta_o : data->pairs[i].theta_i;
    }
    const double limit = gonio_order_statistic(work, data->measured, data->measured - 1 - data->measured / BEYOND);
    for (size_t i = 0; i < data->measured; i++) {
        why[i] = (outgoing ? data->pairs[i].theta_o : data->pairs[i].theta_i) > limit ? AT_EDGE : why[i];
    }
}

// Only what was measured is left out.
static void mark(const gonio_dataset *data, const places *p, char *why, double *work) {
    memset(why, KEPT, data->n);
    for (size_t i = 0; i < data->measured; i++) {
        why[i] = gonio_random(i) % SCATTERED == 0 ? ALONE : KEPT;
    }
    for (size_t h = 0; h < HOLES; h++) {
        const size_t centre = gonio_random(h) % data->measured;
        for (size_t i = 0; i < data->measured; i++) {
            if (distance2(p, i, p->x + centre * p->d) < radii[h % 3] * radii[h % 3]) {
                why[i] = IN_HOLE;
            }
        }
    }
    mark_beyond(data, true, why, work);
    mark_beyond(data, false, why, work);
    size_t kept = 0;
    for (size_t i = 0; i < data->measured; i++) {
        kept += why[i] == KEPT;
    }
    // All in a few places: gaps of that size would leave nothing.
    for (size_t i = 0; i < data->measured && 2 * kept < data->measured; i++) {
        why[i] = i % 5 == 4 ? ALONE : KEPT;
    }
}

// ---- records ----

// What was left out, and why; gap[i] < 0: one of too many, not looked at.
typedef struct evidence {
    gonio_left_out left;
    char *why;            // [held]
    double *gap;          // [held], squared
    double passed, power; // noise passed on: passed gap^power
    size_t dims;
} evidence;

static void evidence_release(evidence *e) {
    gonio_left_out_release(&e->left);
    free(e->why);
    free(e->gap);
}

static gonio_status measure_gaps(evidence *e, const gonio_smooth_form *form, gonio_error *error) {
    places kept = {0}, held = {0};
    gonio_status status = places_init(&kept, &e->left.kept, form, error);
    status = status == GONIO_OK ? places_init(&held, &e->left.held, form, error) : status;
    size_t count[4] = {0}, seen[4] = {0};
    for (size_t i = 0; i < e->left.held.n; i++) {
        count[(int)e->why[i]]++;
    }
    for (size_t i = 0; i < e->left.held.n && status == GONIO_OK; i++) {
        const int kind = e->why[i];
        const bool chosen = seen[kind]++ % (1 + count[kind] / RECORDS) == 0;
        e->gap[i] = chosen ? gap2(&kept, held.x + i * held.d) : -1;
    }
    free(kept.x);
    free(held.x);
    return status;
}

// No more noise than one sample's can come from a mean of samples.
static double noise_at(const evidence *e, double gap) { return fmin(e->passed * pow(gap, e->power), 1); }

// The replicate's mean square over the geometries left out alone, below and above their median gap, tells how the noise
// passed on grows with the gap: not at all, to with the volume.
static gonio_status passed_on(evidence *e, gonio_error *error) {
    double(*rows)[2] = malloc((e->left.held.n + 1) * sizeof *rows);
    if (rows == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    size_t n = 0;
    for (size_t i = 0; i < e->left.held.n; i++) {
        if (e->why[i] == ALONE && e->gap[i] > 0) {
            rows[n][0] = e->gap[i];
            rows[n++][1] = e->left.replicate[i] * e->left.replicate[i];
        }
    }
    qsort(rows, n, sizeof *rows, by_gap); // which comes first
    double gap[2] = {0}, square[2] = {0};
    for (size_t i = 0; i < n; i++) {
        gap[i >= n / 2] += log(rows[i][0]);
        square[i >= n / 2] += rows[i][1];
    }
    free(rows);
    const double below = (double)(n / 2), above = (double)(n - n / 2);
    if (below == 0 || !(square[0] > 0 && square[1] > 0)) {
        return GONIO_OK;
    }
    const double rise = log(square[1] / above) - log(square[0] / below), step = gap[1] / above - gap[0] / below;
    e->power = step > 0 ? fmin(fmax(rise / step, 0), 0.5 * (double)e->dims) : 0;
    double squares = 0, gaps = 0;
    for (size_t i = 0; i < e->left.held.n; i++) {
        if (e->why[i] == ALONE && e->gap[i] > 0) {
            squares += e->left.replicate[i] * e->left.replicate[i];
            gaps += pow(e->gap[i], e->power);
        }
    }
    e->passed = squares / gaps;
    return GONIO_OK;
}

static gonio_status evidence_init(evidence *e, const gonio_iterative_choice *choice, const gonio_dataset *data,
                                  gonio_deadline *watch, gonio_error *error) {
    *e = (evidence){.dims = (size_t)data->dims};
    places p = {0};
    char *why = malloc(data->n);
    bool *keep = malloc(data->n * sizeof *keep);
    double *work = malloc(data->n * sizeof *work);
    gonio_status status = why != NULL && keep != NULL && work != NULL
                              ? places_init(&p, data, &choice->form, error)
                              : gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    if (status == GONIO_OK) {
        mark(data, &p, why, work);
        for (size_t i = 0; i < data->n; i++) {
            keep[i] = why[i] == KEPT;
        }
        status = gonio_iterative_leave_out(data, watch, choice, keep, &e->left, error);
    }
    if (status == GONIO_OK) {
        e->why = malloc(e->left.held.n + 1);
        e->gap = malloc((e->left.held.n + 1) * sizeof *e->gap);
        status = e->why != NULL && e->gap != NULL ? GONIO_OK
                                                  : gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    for (size_t i = 0, at = 0; i < data->n && status == GONIO_OK; i++) {
        if (why[i] != KEPT) {
            e->why[at++] = why[i];
        }
    }
    status = status == GONIO_OK ? measure_gaps(e, &choice->form, error) : status;
    status = status == GONIO_OK ? passed_on(e, error) : status;
    free(p.x);
    free(why);
    free(keep);
    free(work);
    return status;
}

// square[n]: of n x c spline values less their channel's median, mean over channels in their factors. work: [n].
static void square_about_median(size_t n, size_t c, const double *spline, const double *factor, double *square,
                                double *work) {
    memset(square, 0, n * sizeof *square);
    for (size_t k = 0; k < c; k++) {
        for (size_t i = 0; i < n; i++) {
            work[i] = spline[i * c + k];
        }
        const double middle = gonio_upper_median(work, n);
        for (size_t i = 0; i < n; i++) {
            const double x = (spline[i * c + k] - middle) / factor[k];
            square[i] += x * x / (double)c;
        }
    }
}

// correction[held n]: S of the left-out predictions.
static gonio_status held_corrections(const evidence *e, const gonio_lobe_base *lobes, const double *factor,
                                     double *correction, gonio_error *error) {
    const gonio_dataset *held = &e->left.held;
    const size_t n = held->n, c = (size_t)held->channels;
    double *spline = calloc(n * c + n, sizeof *spline);
    if (spline == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    if (lobes != NULL && lobes->lobes > 0) {
        gonio_lobe_targets(lobes, held, spline);
    }
    for (size_t i = 0; i < n * c; i++) {
        spline[i] = held->targets[i] - spline[i] - e->left.residuals[i];
    }
    square_about_median(n, c, spline, factor, correction, spline + n * c);
    free(spline);
    return GONIO_OK;
}

static gonio_status add_records(const evidence *e, const double *factor, const double *correction,
                                gonio_sigma_records *records, gonio_error *error) {
    const gonio_dataset *held = &e->left.held;
    const size_t c = (size_t)held->channels;
    gonio_status status = GONIO_OK;
    for (int others = 0; others < 2 && status == GONIO_OK; others++) {
        for (size_t i = 0; i < held->n && status == GONIO_OK; i++) {
            if (e->gap[i] < 0 || (e->why[i] != ALONE) != (others == 1)) {
                continue;
            }
            gonio_sigma_record r = {
                .noise = 1 / held->weights[i] + noise_at(e, e->gap[i]),
                .signs = {[GONIO_SIGMA_UNKNOWN] = e->gap[i], [GONIO_SIGMA_CORRECTION] = correction[i]},
                .weight = others ? 0.5 : 1,
                .centre = i};
            for (size_t k = 0; k < c; k++) {
                const double x = e->left.residuals[i * c + k] / factor[k];
                r.square += x * x / (double)c;
            }
            gonio_sigma_place(&held->pairs[i], r.x);
            status = gonio_sigma_records_add(records, &r, error);
        }
        records->near = others ? records->near : records->n;
    }
    return status;
}

// work: [held n].
static gonio_status learn(const evidence *e, const gonio_lobe_base *lobes, const double *factor,
                          gonio_sigma_records *records, gonio_sigma_law *law, double *work, gonio_error *error) {
    gonio_status status = held_corrections(e, lobes, factor, work, error);
    status = status == GONIO_OK ? add_records(e, factor, work, records, error) : status;
    return status == GONIO_OK
               ? gonio_sigma_law_fit(records, gonio_sample_noise_variance(&e->left.held, factor), law, error)
               : status;
}

// ---- the field ----

// The model's spline at a place, held in its range as in brdf/kind/lobe_spline.c.
static void spline_at(const gonio_lobe_spline_parts *parts, const double *x, double *value) {
    gonio_lattice_eval(&parts->lattice, x, value);
    for (int k = 0; k < parts->channels && parts->range != NULL; k++) {
        value[k] = fmin(fmax(value[k], parts->range[2 * k]), parts->range[2 * k + 1]);
    }
}

// correction[probes n]: S of the model's spline.
static gonio_status probe_corrections(const gonio_lobe_spline_parts *parts, const double *factor,
                                      const gonio_dataset *probes, double *correction, gonio_error *error) {
    const size_t n = probes->n, c = (size_t)parts->channels, d = (size_t)probes->dims;
    double *spline = malloc(n * (c + 1 + d) * sizeof *spline), *x = spline != NULL ? spline + n * (c + 1) : NULL;
    if (spline == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    gonio_dataset_locate(probes, parts->coordinates, x);
    for (size_t i = 0; i < n; i++) {
        spline_at(parts, x + i * d, spline + i * c);
    }
    square_about_median(n, c, spline, factor, correction, spline + n * c);
    free(spline);
    return GONIO_OK;
}

// The larger theta of all samples.
static double widest(const gonio_dataset *data) {
    double theta = 0;
    for (size_t i = 0; i < data->n; i++) {
        theta = fmax(theta, fmax(data->pairs[i].theta_i, data->pairs[i].theta_o));
    }
    return theta;
}

// Beyond the samples' angles the spline goes on alone, and nobody knows whether the material does: the square of how
// far it goes from where the samples end is added to the variance, mean over channels.
static double gone_on(const gonio_lobe_spline_parts *parts, const double *factor, double theta,
                      const gonio_pair *pair) {
    const gonio_pair edge = {fmin(pair->theta_i, theta), pair->phi_i, fmin(pair->theta_o, theta), pair->phi_o};
    const gonio_pair *at[2] = {pair, &edge};
    double value[2][GONIO_CHANNELS_MAX], x[4], sum = 0;
    for (int s = 0; s < 2; s++) {
        const gonio_vec3 wi = gonio_direction(at[s]->theta_i, at[s]->phi_i);
        const gonio_vec3 wo = gonio_direction(at[s]->theta_o, at[s]->phi_o);
        if (parts->dims == 3) {
            gonio_coordinates_isotropic(parts->coordinates, wi, wo, x);
        } else {
            gonio_coordinates_anisotropic(parts->coordinates, wi, wo, x);
        }
        spline_at(parts, x, value[s]);
    }
    for (int k = 0; k < parts->channels; k++) {
        const double step = (value[0][k] - value[1][k]) / factor[k];
        sum += step * step / parts->channels;
    }
    return sum;
}

// In: probes->targets are their S; out: their variances.
static gonio_status fill_probes(const evidence *e, const gonio_sigma_law *law, const gonio_dataset *data,
                                const gonio_iterative_choice *choice, const gonio_lobe_spline_parts *parts,
                                const double *factor, gonio_dataset *probes, gonio_error *error) {
    places all = {0}, at = {0};
    const double theta = widest(data);
    double *work = malloc(4 * (law->records->n + 1) * sizeof *work);
    gonio_status status = work != NULL ? places_init(&all, data, &choice->form, error)
                                       : gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    status = status == GONIO_OK ? places_init(&at, probes, &choice->form, error) : status;
    for (size_t i = 0; i < probes->n && status == GONIO_OK; i++) {
        const double gap = gap2(&all, at.x + i * at.d);
        const double signs[GONIO_SIGMA_SIGNS] = {
            [GONIO_SIGMA_UNKNOWN] = gap, [GONIO_SIGMA_CORRECTION] = probes->targets[i]};
        double place[2];
        gonio_sigma_place(&probes->pairs[i], place);
        probes->targets[i] = gonio_sigma_law_variance(law, place, noise_at(e, gap), signs, work) +
                             gonio_sigma_held_back(data, choice->lobes, factor, &probes->pairs[i]) +
                             gone_on(parts, factor, theta, &probes->pairs[i]);
    }
    free(all.x);
    free(at.x);
    free(work);
    return status;
}

gonio_status gonio_sigma_large(const gonio_iterative_choice *choice, const gonio_dataset *data, gonio_deadline *watch,
                               gonio_prior *prior, gonio_lobe_spline_parts *parts, gonio_error *error) {
    const size_t c = (size_t)data->channels;
    if (data->n < FEWEST) {
        return GONIO_OK;
    }
    evidence e;
    // U is a distance here: its exponent is the method's order, and the samples' to tell.
    const double *power = gonio_sigma_tuned.power, spread = gonio_sigma_tuned.spread;
    gonio_sigma_records records = {.power = {gonio_sigma_tuned.gap_power, power[1], power[2]},
                                   .spread = {1, spread, spread}};
    gonio_sigma_law law;
    gonio_dataset probes = {0};
    double some[8], *work = malloc(data->n * sizeof *work), *factor = malloc(c * sizeof *factor);
    gonio_status status = evidence_init(&e, choice, data, watch, error);
    if (status == GONIO_OK && (work == NULL || factor == NULL)) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    if (status == GONIO_OK) {
        const size_t tried = (size_t)e.left.held.channels;
        gonio_sigma_factors(e.left.held.n, tried, e.left.residuals, some, work);
        for (size_t k = 0; k < c; k++) {
            factor[k] = some[(2 * k + 1) * tried / (2 * c)]; // of the nearest channel that was tried
        }
        status = learn(&e, choice->lobes, some, &records, &law, work, error);
    }
    status = status == GONIO_OK ? gonio_sigma_probes(&probes, &prior->data, error) : status;
    status = status == GONIO_OK ? probe_corrections(parts, factor, &probes, probes.targets, error) : status;
    status = status == GONIO_OK ? fill_probes(&e, &law, data, choice, parts, factor, &probes, error) : status;
    status = status == GONIO_OK ? gonio_sigma_attach(&probes, prior, factor, parts, error) : status;
    if (status != GONIO_OK) {
        free(factor);
    }
    free(work);
    evidence_release(&e);
    gonio_sigma_records_release(&records);
    gonio_dataset_release(&probes);
    return status;
}
