// SPDX-License-Identifier: BSD-3-Clause
// The transforms of a model, and a model that is physical by construction (brdf/kind/transformed.h does the
// evaluating).
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread_pool.h"
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

// Albedos of every knot, azimuth and channel, shared out over theta_o.
typedef struct albedos {
    const gonio_model *model;
    double after;   // of the knots' distance behind each knot
    size_t rows;    // azimuths x channels
    double *shares; // [KNOTS][rows][KNOTS]
} albedos;

static void find_shares(void *context, size_t knot) {
    const albedos *a = context;
    const size_t channels = (size_t)a->model->channels, turns = a->rows / channels;
    for (size_t k = 0; k < turns; k++) {
        // The horizon itself is a limit that no light comes from.
        gonio_check_albedo_shares(a->model, fmin(theta_of(knot) + a->after * theta_of(1), gonio_radians(89.9)),
                                  2 * GONIO_PI * (double)k / (double)turns, NODES, KNOTS,
                                  a->shares + (knot * a->rows + k * channels) * KNOTS);
    }
}

static gonio_status albedos_of(const gonio_model *model, double after, int threads, albedos *a, gonio_error *error) {
    *a = (albedos){.model = model, .after = after, .rows = (size_t)model->channels * (model->isotropic ? 1 : AZIMUTHS)};
    a->shares = malloc(KNOTS * KNOTS * a->rows * sizeof *a->shares);
    if (a->shares == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for albedos of %d channels", model->channels);
    }
    gonio_pool_for(threads, KNOTS, find_shares, a);
    return GONIO_OK;
}

// The largest albedo of each knot, f times the factors c of theta_o (NULL: 1).
static void largest_of(const albedos *a, const double *c, double *largest) {
    for (size_t k = 0; k < KNOTS; k++) {
        largest[k] = -INFINITY;
        for (size_t r = 0; r < a->rows; r++) {
            double sum = 0;
            for (size_t j = 0; j < KNOTS; j++) {
                sum += a->shares[(k * a->rows + r) * KNOTS + j] * (c != NULL ? c[j] : 1);
            }
            largest[k] = fmax(largest[k], sum);
        }
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

static gonio_status conserve(gonio_model *model, const gonio_change *change, int threads, gonio_model **out,
                             gonio_error *error) {
    double largest[KNOTS] = {0}, factors[KNOTS];
    size_t where;
    const gonio_status status = find_albedos(model, 0, threads, largest, error);
    const double worst = most(largest, KNOTS, &where);
    if (status != GONIO_OK || !(worst > change->ceiling)) {
        *out = model;
        return status;
    }
    for (size_t k = 0; k < KNOTS; k++) {
        factors[k] = gonio_change_factor(change, change->one_scalar ? worst : largest[k]);
    }
    const gonio_transformed_parts parts = {.what = GONIO_MADE_SCALED, .delta = 1, .knots = KNOTS, .factors = factors};
    return gonio_transformed_new(model, &parts, out, error);
}

static gonio_status change_model(gonio_model *model, const gonio_change *change, int threads, gonio_model **out,
                                 gonio_error *error) {
    gonio_transformed_parts parts = {.delta = change->delta, .geometric = change->geometric};
    const bool swap = change->kind == GONIO_CHANGE_RECIPROCITY;
    double *tables = NULL, largest, squares;
    gonio_status status;
    if (change->kind == GONIO_CHANGE_ENERGY) {
        return conserve(model, change, threads, out, error);
    }
    if (swap || change->kind == GONIO_CHANGE_ISOTROPY) {
        parts.what = swap ? GONIO_MADE_RECIPROCAL : GONIO_MADE_ISOTROPIC;
        status = compare(model, swap, &largest, &squares, error);
        if (status != GONIO_OK || largest <= holds) {
            *out = model;
            return status;
        }
    } else if (change->kind == GONIO_CHANGE_SEPARABLE) {
        parts.what = GONIO_MADE_SEPARABLE;
        parts.products = (size_t)change->products;
        parts.thetas = THETAS;
        parts.phis = 4 * THETAS;
        status = gonio_change_products(model, change->products, THETAS, &tables, threads, error);
        parts.tables = tables;
    } else {
        status = gonio_fail(error, GONIO_E_USAGE, "%s changes samples, not a model", gonio_change_name(change->kind));
    }
    status = status == GONIO_OK ? gonio_transformed_new(model, &parts, out, error) : status;
    free(tables);
    return status;
}

// Transmission's exchanged value is that of the other side, and what goes through counts in the albedo.
static gonio_status refuse_halves(const gonio_model *model, gonio_error *error) {
    return !model->ops->both_sides
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_UNSUPPORTED,
                            "reflection from the front alone can be changed; this model has other halves");
}

gonio_status gonio_check_change_model(gonio_model *model, const gonio_change *change, int threads, gonio_model **out,
                                      gonio_error *error) {
    *out = NULL;
    gonio_status status = gonio_change_check(change, error);
    status = status == GONIO_OK ? refuse_halves(model, error) : status;
    status = status == GONIO_OK ? change_model(model, change, threads, out, error) : status;
    if (status != GONIO_OK) {
        gonio_model_free(model);
        *out = NULL;
    } else if (*out != model) {
        status = gonio_model_tell(*out, model->about, error);
    }
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
            where = (size_t)fmin(r.energy_theta_rad / theta_of(1), KNOTS - 2);
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

static gonio_status make_passive(gonio_model **model, int threads, gonio_physical_report *report, gonio_error *error) {
    double c[KNOTS];
    albedos a;
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
        const gonio_transformed_parts parts = {.what = GONIO_MADE_PASSIVE, .delta = 1, .knots = KNOTS, .factors = c};
        gonio_model *made;
        status = gonio_transformed_new(*model, &parts, &made, error);
        status = status == GONIO_OK ? lower_where_above(made, c, threads, &report->energy, error) : status;
        if (status == GONIO_OK && report->energy <= 1) {
            *model = made;
            break;
        }
        if (status == GONIO_OK) {
            gonio_transformed_abandon(made);
        }
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

gonio_status gonio_check_make_physical(gonio_model *model, bool reciprocal, bool passive, int threads,
                                       gonio_model **out, gonio_physical_report *report, gonio_error *error) {
    *out = NULL;
    *report = (gonio_physical_report){.least_factor = 1, .least_factor_bound = 1};
    gonio_model *made = model;
    double largest;
    gonio_status status = refuse_halves(model, error);
    status = status == GONIO_OK ? compare(model, true, &largest, &report->reciprocity_before, error) : status;
    if (status == GONIO_OK && reciprocal && largest > holds) {
        const gonio_transformed_parts parts = {.what = GONIO_MADE_RECIPROCAL, .delta = 1};
        status = gonio_transformed_new(model, &parts, &made, error);
        made = status == GONIO_OK ? made : model;
    }
    status = status == GONIO_OK && passive ? make_passive(&made, threads, report, error) : status;
    if (status != GONIO_OK) {
        gonio_model_free(made);
        return status;
    }
    *out = made;
    return GONIO_OK;
}
