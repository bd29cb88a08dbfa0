// SPDX-License-Identifier: BSD-3-Clause
// The transforms of a model, and a model that is physical by construction (brdf/kind/transformed.h does the
// evaluating).
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread_pool.h"
#include "brdf/kind/halves.h"
#include "brdf/kind/transformed.h"
#include "fit/check/albedo.h"
#include "fit/check/change.h"
#include "fit/check/products.h"
#include "gonio/io.h"
#include "gonio/plan.h"

enum {
    KNOTS = 73,    // of a factor of theta: 1.25 deg
    NODES = 4096,  // of an albedo
    AZIMUTHS = 12, // at which an anisotropic model's albedo is taken
    THETAS = 18,   // of the products' tables: 5 deg
    PASSES = 8,    // of the search for them
    ROUNDS = 200,  // of lowering factors
    CORRECTIONS = 12,
    PAIRS = 4000,
};
static const double holds = 1e-9; // relative: a property that holds to this is not asked for again

// ---- separability ----

typedef struct grid {
    const gonio_model *model;
    int channel;
    size_t thetas, phis;
    double *matrix; // row by row: every pass of the search reads all of it
} grid;

static gonio_vec3 direction_of(const grid *g, size_t k) {
    return gonio_direction(GONIO_PI / 2 * ((double)(k / g->phis) + 0.5) / (double)g->thetas,
                           2 * GONIO_PI * (double)(k % g->phis) / (double)g->phis);
}

static void fill_row(void *context, size_t row) {
    const grid *g = context;
    const size_t side = g->thetas * g->phis;
    const gonio_vec3 wi = direction_of(g, row);
    for (size_t q = 0; q < side; q++) {
        g->matrix[row * side + q] = gonio_model_eval_channel(g->model, wi, direction_of(g, q), g->channel);
    }
}

static void read_row(void *context, size_t row, double *values) {
    const grid *g = context;
    const size_t side = g->thetas * g->phis;
    memcpy(values, g->matrix + row * side, side * sizeof *values);
}

static gonio_status find_channel(grid *g, size_t products, int threads, double *tables, gonio_error *error) {
    const size_t side = g->thetas * g->phis, channels = (size_t)g->model->channels, c = (size_t)g->channel;
    const gonio_row_source rows = {side, side, read_row, g};
    gonio_products p;
    gonio_pool_for(threads, side, fill_row, g);
    const gonio_status status = gonio_products_find(&rows, products, PASSES, &p, error);
    for (size_t k = 0; status == GONIO_OK && k < p.k; k++) {
        double *in = tables + 2 * (k * channels + c) * side, *out = in + side;
        for (size_t i = 0; i < side; i++) {
            in[i] = p.value[k] * p.u[k * side + i];
            out[i] = p.v[k * side + i];
        }
    }
    if (status == GONIO_OK) {
        gonio_products_free(&p);
    }
    return status;
}

gonio_status gonio_change_products(const gonio_model *model, int products, int thetas, double **tables, int threads,
                                   gonio_error *error) {
    const size_t side = 4 * (size_t)thetas * (size_t)thetas;
    grid g = {model, 0, (size_t)thetas, 4 * (size_t)thetas, malloc(side * side * sizeof(double))};
    double *made = calloc((size_t)products * (size_t)model->channels * 2 * side, sizeof *made);
    gonio_status status = GONIO_OK;
    if (g.matrix == NULL || made == NULL) {
        status =
            gonio_fail(error, GONIO_E_MEMORY, "no memory for %d products of %d channels", products, model->channels);
    }
    for (; g.channel < model->channels && status == GONIO_OK; g.channel++) {
        status = find_channel(&g, (size_t)products, threads, made, error);
    }
    free(g.matrix);
    if (status != GONIO_OK) {
        free(made);
        made = NULL;
    }
    *tables = made;
    return status;
}

// ---- albedos at the knots ----

static double theta_of(size_t knot) { return GONIO_PI / 2 * (double)knot / (KNOTS - 1); }

// Albedos of every knot, side that the light is on, azimuth and channel, shared out over theta_o. What goes through
// counts with what is reflected.
typedef struct albedos {
    const gonio_model *model;
    double after;   // of the knots' distance behind each knot
    size_t sides;   // 2 of a model of halves
    size_t turns;   // azimuths
    size_t rows;    // of a side: azimuths x channels
    double *shares; // [KNOTS][sides][rows][KNOTS]
} albedos;

static double *shares_of(const albedos *a, size_t knot, size_t side, size_t row) {
    return a->shares + ((knot * a->sides + side) * a->rows + row) * KNOTS;
}

static void find_shares(void *context, size_t knot) {
    const albedos *a = context;
    // The horizon itself is a limit that no light comes from.
    const double theta = fmin(theta_of(knot) + a->after * theta_of(1), gonio_radians(89.9));
    for (size_t h = 0; h < 2 * a->sides; h++) {
        const gonio_model *part = gonio_model_half(a->model, (gonio_half)h);
        for (size_t k = 0; part != NULL && k < a->turns; k++) {
            gonio_check_albedo_shares(part, theta, 2 * GONIO_PI * (double)k / (double)a->turns, NODES, KNOTS,
                                      shares_of(a, knot, h / 2, k * (size_t)part->channels));
        }
    }
}

static gonio_status albedos_of(const gonio_model *model, double after, int threads, albedos *a, gonio_error *error) {
    *a = (albedos){.model = model,
                   .after = after,
                   .sides = model->ops->both_sides ? 2 : 1,
                   .turns = model->isotropic ? 1 : AZIMUTHS};
    a->rows = (size_t)model->channels * a->turns;
    a->shares = calloc(KNOTS * KNOTS * a->sides * a->rows, sizeof *a->shares);
    if (a->shares == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for albedos of %d channels", model->channels);
    }
    gonio_pool_for(threads, KNOTS, find_shares, a);
    return GONIO_OK;
}

// The largest albedo of each knot for light on one side, f times the factors c of theta_o (NULL: 1).
static void largest_from(const albedos *a, size_t side, const double *c, double *largest) {
    for (size_t k = 0; k < KNOTS; k++) {
        for (size_t r = 0; r < a->rows; r++) {
            const double *shares = shares_of(a, k, side, r);
            double sum = 0;
            for (size_t j = 0; j < KNOTS; j++) {
                sum += shares[j] * (c != NULL ? c[j] : 1);
            }
            largest[k] = fmax(largest[k], sum);
        }
    }
}

// The same on whichever side it is larger.
static void largest_of(const albedos *a, const double *c, double *largest) {
    for (size_t k = 0; k < KNOTS; k++) {
        largest[k] = -INFINITY;
    }
    for (size_t side = 0; side < a->sides; side++) {
        largest_from(a, side, c, largest);
    }
}

static gonio_status find_albedos(const gonio_model *model, double after, int threads, double *largest,
                                 gonio_error *error) {
    albedos a;
    const gonio_status status = albedos_of(model, after, threads, &a, error);
    if (status == GONIO_OK) {
        largest_of(&a, NULL, largest);
        free(a.shares);
    }
    return status;
}

static double most(const double *values, size_t n, size_t *where) {
    *where = 0;
    for (size_t k = 1; k < n; k++) {
        *where = values[k] > values[*where] ? k : *where;
    }
    return values[*where];
}

// ---- what holds already ----

static gonio_status compare(const gonio_model *model, bool swap, double *largest, double *rms, gonio_error *error) {
    gonio_plan *plan;
    const size_t c = (size_t)model->channels;
    double here[GONIO_CHANNELS_MAX], there[GONIO_CHANNELS_MAX], sum = 0;
    const gonio_status status = gonio_plan_make("nusselt:4000,theta_max=88,anisotropic=1", 1, &plan, error);
    *largest = 0;
    for (size_t i = 0; status == GONIO_OK && i < plan->n; i++) {
        gonio_pair p = plan->poses[i], q = gonio_pair_swapped(p);
        if (!swap) {
            q = (gonio_pair){p.theta_i, p.phi_i + 2.4, p.theta_o, p.phi_o + 2.4};
        }
        gonio_model_eval_pair(model, &p, here);
        gonio_model_eval_pair(model, &q, there);
        for (size_t k = 0; k < c; k++) {
            const double d = here[k] - there[k];
            *largest = fmax(*largest, fabs(d) / (fabs(here[k]) + fabs(there[k]) + 1e-300));
            sum += d * d / 2 / (double)(PAIRS * c);
        }
    }
    *rms = sum;
    if (status == GONIO_OK) {
        gonio_plan_free(plan);
    }
    return status;
}

// ---- one transform ----

// The half of `model` that is to be changed. A model of one reflection is its own.
static gonio_model *part_of(gonio_model *model, int half) {
    return model->ops->both_sides     ? gonio_halves_part(model, (gonio_half)half)
           : half == GONIO_REFLECTION ? model
                                      : NULL;
}

// `part` takes the place of that half.
static void put(gonio_model **model, int half, gonio_model *part) {
    if ((*model)->ops->both_sides) {
        gonio_halves_put(*model, (gonio_half)half, part);
    } else {
        *model = part;
    }
}

static gonio_status transform(gonio_model **model, int half, const gonio_transformed_parts *parts, gonio_error *error) {
    gonio_model *made;
    const gonio_status status = gonio_transformed_new(part_of(*model, half), parts, &made, error);
    if (status == GONIO_OK) {
        put(model, half, made);
    }
    return status;
}

// Energy: both halves of the light's side by the same factors, for they share what comes in.
static gonio_status conserve(gonio_model **model, const gonio_change *change, int threads, gonio_error *error) {
    double largest[KNOTS], factors[2][KNOTS], worst = -INFINITY, of_side[2] = {0};
    size_t where;
    albedos a;
    gonio_status status = albedos_of(*model, 0, threads, &a, error);
    for (size_t side = 0; status == GONIO_OK && side < a.sides; side++) {
        for (size_t k = 0; k < KNOTS; k++) {
            factors[side][k] = -INFINITY;
        }
        largest_from(&a, side, NULL, factors[side]);
        of_side[side] = most(factors[side], KNOTS, &where);
        worst = fmax(worst, of_side[side]);
    }
    for (size_t side = 0; status == GONIO_OK && side < a.sides; side++) {
        memcpy(largest, factors[side], sizeof largest);
        for (size_t k = 0; k < KNOTS; k++) {
            factors[side][k] = gonio_change_factor(change, change->one_scalar ? worst : largest[k]);
        }
    }
    for (size_t h = 0; status == GONIO_OK && h < 2 * a.sides; h++) {
        const gonio_transformed_parts parts = {
            .what = GONIO_MADE_SCALED, .delta = 1, .knots = KNOTS, .factors = factors[h / 2]};
        if (part_of(*model, (int)h) != NULL && (change->one_scalar ? worst : of_side[h / 2]) > change->ceiling) {
            status = transform(model, (int)h, &parts, error);
        }
    }
    free(a.shares);
    return status;
}

static gonio_status change_half(gonio_model **model, int half, const gonio_change *change, int threads,
                                gonio_error *error) {
    gonio_transformed_parts parts = {.delta = change->delta, .geometric = change->geometric};
    const bool swap = change->kind == GONIO_CHANGE_RECIPROCITY;
    double *tables = NULL, largest, squares;
    gonio_status status;
    if (swap || change->kind == GONIO_CHANGE_ISOTROPY) {
        parts.what = swap ? GONIO_MADE_RECIPROCAL : GONIO_MADE_ISOTROPIC;
        status = compare(part_of(*model, half), swap, &largest, &squares, error);
        if (status != GONIO_OK || largest <= holds) {
            return status;
        }
    } else if (change->kind == GONIO_CHANGE_SEPARABLE) {
        parts.what = GONIO_MADE_SEPARABLE;
        parts.products = (size_t)change->products;
        parts.thetas = THETAS;
        parts.phis = 4 * THETAS;
        status = gonio_change_products(part_of(*model, half), change->products, THETAS, &tables, threads, error);
        parts.tables = tables;
    } else {
        status = gonio_fail(error, GONIO_E_USAGE, "%s changes samples, not a model", gonio_change_name(change->kind));
    }
    status = status == GONIO_OK ? transform(model, half, &parts, error) : status;
    free(tables);
    return status;
}

// What goes through comes back, exchanged, from the other side: there is nothing on its own side to be the mean with.
static bool stays(const gonio_change *change, int half) {
    return change->kind == GONIO_CHANGE_RECIPROCITY && (half & GONIO_TRANSMISSION) != 0;
}

gonio_status gonio_check_change_model(gonio_model *model, const gonio_change *change, int threads, gonio_model **out,
                                      gonio_error *error) {
    gonio_model *made = model;
    gonio_status status = gonio_change_check(change, error);
    if (status == GONIO_OK && change->kind == GONIO_CHANGE_ENERGY) {
        status = conserve(&made, change, threads, error);
    } else {
        for (int h = 0; h < GONIO_HALVES && status == GONIO_OK; h++) {
            status = part_of(model, h) != NULL && !stays(change, h) ? change_half(&made, h, change, threads, error)
                                                                    : GONIO_OK;
        }
    }
    status = status == GONIO_OK && made != model ? gonio_model_tell(made, model->about, error) : status;
    if (status != GONIO_OK) {
        gonio_model_free(made);
        made = NULL;
    }
    *out = made;
    return status;
}

// ---- physical by construction ----

// Factors c <= 1 such that at every knot either c(theta) = 1 or the albedo of c(theta_i) c(theta_o) f is 1: none of
// them could be raised by itself. The fixed point c = min(1, 1 / (albedo / c)), half of the way in logarithms each
// round, as symmetric scaling of matrices converges (Knight, Ruiz & Ucar 2014); the whole way goes to and fro. 1e-4 is
// kept for what two quadratures differ by.
static void find_factors(const albedos *a, double *c) {
    double largest[KNOTS], moved = 1;
    for (size_t k = 0; k < KNOTS; k++) {
        c[k] = 1;
    }
    for (int round = 0; round < ROUNDS && moved > 1e-9; round++) {
        largest_of(a, c, largest);
        moved = 0;
        for (size_t k = 0; k < KNOTS; k++) {
            const double next = sqrt(c[k] * fmin(1, (1 - 1e-4) / fmax(largest[k], 1e-300)));
            moved = fmax(moved, fabs(next - c[k]));
            c[k] = next;
        }
    }
}

// The largest albedo of a model at the knots and midway and, where none of those exceeds 1, by the other quadrature
// too. c, if not NULL: the factors on both sides of each place where it exceeds 1 are lowered by as much.
static gonio_status lower_where_above(const gonio_model *model, double *c, int threads, double *worst,
                                      gonio_error *error) {
    gonio_check_report r;
    double at[2][KNOTS];
    size_t where;
    gonio_status status = find_albedos(model, 0, threads, at[0], error);
    status = status == GONIO_OK ? find_albedos(model, 0.5, threads, at[1], error) : status;
    if (status == GONIO_OK && most(at[0], KNOTS, &where) <= 1 && most(at[1], KNOTS, &where) <= 1) {
        status = gonio_check_model(model, threads, &r, error);
        if (status == GONIO_OK) {
            const double theta = fmin(r.energy_theta_rad, GONIO_PI - r.energy_theta_rad); // from either side
            where = (size_t)fmin(theta / theta_of(1), KNOTS - 2);
            at[1][where] = fmax(at[1][where], r.energy);
            gonio_check_report_free(&r);
        }
    }
    if (status != GONIO_OK) {
        return status;
    }
    *worst = fmax(most(at[0], KNOTS, &where), most(at[1], KNOTS, &where));
    for (size_t k = 0; c != NULL && k < KNOTS; k++) {
        const double over[2] = {fmax(at[0][k], 1), fmax(at[1][k], 1)};
        c[k] *= over[0] > 1 ? (1 - 1e-7) / over[0] : 1;
        c[k] *= over[1] > 1 ? (1 - 1e-7) / over[1] : 1;
        c[k + 1 < KNOTS ? k + 1 : k] *= over[1] > 1 ? (1 - 1e-7) / over[1] : 1;
    }
    return GONIO_OK;
}

// The halves as they were before they were transformed.
static void take_back(gonio_model **model, gonio_model *const before[GONIO_HALVES]) {
    gonio_model *const given = *model;
    for (int h = 0; h < GONIO_HALVES; h++) {
        gonio_model *part = part_of(given, h);
        if (part != NULL && part != before[h]) {
            gonio_transformed_abandon(part);
            put(model, h, before[h]);
        }
    }
}

// Every half times c(theta_i) c(theta_o). On failure all is as it was.
static gonio_status scale_halves(gonio_model **model, const double *c, gonio_model *before[GONIO_HALVES],
                                 gonio_error *error) {
    const gonio_transformed_parts parts = {.what = GONIO_MADE_PASSIVE, .delta = 1, .knots = KNOTS, .factors = c};
    gonio_model *const given = *model;
    gonio_status status = GONIO_OK;
    for (int h = 0; h < GONIO_HALVES; h++) {
        before[h] = part_of(given, h);
    }
    for (int h = 0; h < GONIO_HALVES && status == GONIO_OK; h++) {
        status = before[h] != NULL ? transform(model, h, &parts, error) : GONIO_OK;
    }
    if (status != GONIO_OK) {
        take_back(model, before);
    }
    return status;
}

static gonio_status make_passive(gonio_model **model, int threads, gonio_physical_report *report, gonio_error *error) {
    double c[KNOTS];
    albedos a;
    gonio_model *before[GONIO_HALVES];
    gonio_status status = lower_where_above(*model, NULL, threads, &report->energy_before, error);
    report->energy = report->energy_before;
    if (status != GONIO_OK || report->energy_before <= 1) {
        return status;
    }
    report->least_factor_bound = 1 / sqrt(report->energy_before);
    status = albedos_of(*model, 0, threads, &a, error);
    if (status != GONIO_OK) {
        return status;
    }
    find_factors(&a, c);
    free(a.shares);
    // What the first quadrature and the line between knots missed is lowered where it is.
    for (int round = 0; round < CORRECTIONS && status == GONIO_OK; round++) {
        status = scale_halves(model, c, before, error);
        status = status == GONIO_OK ? lower_where_above(*model, c, threads, &report->energy, error) : status;
        if (status != GONIO_OK || report->energy <= 1) {
            break;
        }
        take_back(model, before);
    }
    for (size_t k = 0; k < KNOTS; k++) {
        if (c[k] < report->least_factor) {
            report->least_factor = c[k];
            report->theta_rad = theta_of(k);
        }
    }
    return status == GONIO_OK && report->energy > 1
               ? gonio_fail(error, GONIO_E_CONVERGENCE, "the albedo stays at %g", report->energy)
               : status;
}

// The halves that reflect. What goes through is made no more reciprocal: its exchanged value is the other side's.
static gonio_status make_reciprocal(gonio_model **model, bool wanted, gonio_physical_report *report,
                                    gonio_error *error) {
    const gonio_transformed_parts parts = {.what = GONIO_MADE_RECIPROCAL, .delta = 1};
    const int reflecting[] = {GONIO_REFLECTION, GONIO_REFLECTION_BACK};
    gonio_model *const given = *model;
    gonio_status status = GONIO_OK;
    for (size_t k = 0; k < 2 && status == GONIO_OK; k++) {
        const gonio_model *part = part_of(given, reflecting[k]);
        double largest, squares;
        if (part == NULL) {
            continue;
        }
        status = compare(part, true, &largest, &squares, error);
        report->reciprocity_before = fmax(report->reciprocity_before, squares);
        if (status == GONIO_OK && wanted && largest > holds) {
            status = transform(model, reflecting[k], &parts, error);
        }
    }
    return status;
}

gonio_status gonio_check_make_physical(gonio_model *model, bool reciprocal, bool passive, int threads,
                                       gonio_model **out, gonio_physical_report *report, gonio_error *error) {
    *report = (gonio_physical_report){.least_factor = 1, .least_factor_bound = 1};
    gonio_model *made = model;
    gonio_status status = make_reciprocal(&made, reciprocal, report, error);
    status = status == GONIO_OK && passive ? make_passive(&made, threads, report, error) : status;
    if (status != GONIO_OK) {
        gonio_model_free(made);
        made = NULL;
    }
    *out = made;
    return status;
}
