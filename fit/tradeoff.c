// The rows of the trade-off, their measurement and the Pareto front.
#include "fit/tradeoff.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/clock.h"
#include "base/random.h"

#define MULTILEVEL_MAX 7
#define EVALUATIONS 2000

// Methods with one row each; multilevel fits have one a level, coordinates and domain. A method that this build does
// not have gives no row.
static const gonio_tradeoff_form single_forms[] = {
    {"cbmba", GONIO_LEVEL_AUTO, -1, -1},
    {"lsq", GONIO_LEVEL_AUTO, GONIO_NUSSELT, GONIO_LINEAR},
    {"lsq", GONIO_LEVEL_AUTO, GONIO_NUSSELT, GONIO_LOG},
    {"lsq", GONIO_LEVEL_AUTO, GONIO_HALF_VECTOR, GONIO_LOG},
    {"lsq", GONIO_LEVEL_AUTO, -1, -1},
    {"auto", GONIO_LEVEL_AUTO, -1, -1},
    {"cook-torrance", GONIO_LEVEL_AUTO, -1, -1},
    {"ggx", GONIO_LEVEL_AUTO, -1, -1},
};

static bool exists(const char *method) {
    for (const char *const *m = gonio_fit_methods(); *m != NULL; m++) {
        if (strcmp(*m, method) == 0) {
            return true;
        }
    }
    return false;
}

static void append(gonio_tradeoff_form *forms, size_t limit, size_t *n, gonio_tradeoff_form form) {
    if (exists(form.method)) {
        if (*n < limit) {
            forms[*n] = form;
        }
        ++*n;
    }
}

size_t gonio_tradeoff_forms(gonio_tradeoff_form *forms, size_t limit) {
    size_t n = 0;
    for (int c = 0; c < GONIO_COORDINATES; c++) {
        for (int d = GONIO_LINEAR; d <= GONIO_LOG; d++) {
            for (int level = 0; level <= MULTILEVEL_MAX; level++) {
                append(forms, limit, &n, (gonio_tradeoff_form){"mba", level, c, d});
            }
        }
    }
    for (size_t k = 0; k < sizeof single_forms / sizeof *single_forms; k++) {
        append(forms, limit, &n, single_forms[k]);
    }
    return n;
}

// ---- timing ----

static gonio_vec3 random_direction(uint64_t *state) {
    const double z = gonio_random_next(state), phi = 2 * GONIO_PI * gonio_random_next(state), s = sqrt(1 - z * z);
    return (gonio_vec3){s * cos(phi), s * sin(phi), z};
}

// The quicker of three passes: what else the machine does only ever adds.
static gonio_status time_model(const gonio_model *model, uint64_t seed, gonio_tradeoff_row *row, gonio_error *error) {
    gonio_vec3 *directions = malloc(2 * EVALUATIONS * sizeof *directions);
    double *values = malloc(EVALUATIONS * (size_t)model->channels * sizeof *values);
    if (directions == NULL || values == NULL) {
        free(directions);
        free(values);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to time evaluations");
    }
    uint64_t state = seed;
    for (size_t i = 0; i < 2 * EVALUATIONS; i++) {
        directions[i] = random_direction(&state);
    }
    row->eval_ns = row->batch_ns = INFINITY;
    for (int pass = 0; pass < 3; pass++) {
        const int64_t start = gonio_clock_ns();
        for (size_t i = 0; i < EVALUATIONS; i++) {
            gonio_model_eval(model, directions[i], directions[EVALUATIONS + i], values + i * (size_t)model->channels);
        }
        const int64_t middle = gonio_clock_ns();
        gonio_model_eval_many(model, EVALUATIONS, directions, directions + EVALUATIONS, values);
        row->eval_ns = fmin(row->eval_ns, (double)(middle - start) / EVALUATIONS);
        row->batch_ns = fmin(row->batch_ns, (double)(gonio_clock_ns() - middle) / EVALUATIONS);
    }
    free(directions);
    free(values);
    return GONIO_OK;
}

gonio_status gonio_tradeoff_measure(const gonio_samples *samples, const gonio_fit_options *options,
                                    const gonio_tradeoff_form *form, gonio_tradeoff_row *row, gonio_error *error) {
    *row = (gonio_tradeoff_row){.form = *form, .eval_ns = NAN, .batch_ns = NAN};
    gonio_fit_options o = *options;
    o.method = form->method;
    o.level = form->level;
    o.coordinates_set = form->coordinates >= 0;
    o.coordinates = o.coordinates_set ? (gonio_coordinates)form->coordinates : GONIO_NUSSELT;
    o.domain_set = form->domain >= 0;
    o.domain = o.domain_set ? (gonio_domain)form->domain : GONIO_LINEAR;
    gonio_model *model;
    row->error = (gonio_error){.line = -1, .byte = -1};
    row->status = gonio_fit(samples, &o, &model, &row->report, &row->error);
    if (row->status != GONIO_OK) {
        if (row->status == GONIO_E_INTERRUPTED && error != NULL) {
            *error = row->error;
        }
        return row->status == GONIO_E_INTERRUPTED ? GONIO_E_INTERRUPTED : GONIO_OK;
    }
    const gonio_status status = time_model(model, options->seed, row, error);
    gonio_model_free(model);
    return status;
}

// ---- the front ----

double gonio_tradeoff_error(const gonio_tradeoff_row *row) {
    if (row->status != GONIO_OK) {
        return NAN;
    }
    return row->report.held_out.samples > 0 ? row->report.held_out.rms_log : row->report.train.rms_log;
}

// Times within some 10 % of each other are the same time.
static double time_class(double ns) { return floor(log(ns) / log(1.2)); }

static bool dominates(const gonio_tradeoff_row *a, const gonio_tradeoff_row *b) {
    const double x[3] = {gonio_tradeoff_error(a), (double)a->report.bytes, time_class(a->eval_ns)};
    const double y[3] = {gonio_tradeoff_error(b), (double)b->report.bytes, time_class(b->eval_ns)};
    bool better = false;
    for (int k = 0; k < 3; k++) {
        if (!(x[k] <= y[k])) {
            return false;
        }
        better = better || x[k] < y[k];
    }
    return better;
}

void gonio_tradeoff_mark_pareto(gonio_tradeoff_row *rows, size_t n) {
    for (size_t i = 0; i < n; i++) {
        rows[i].pareto = isfinite(gonio_tradeoff_error(&rows[i]));
        for (size_t j = 0; j < n && rows[i].pareto; j++) {
            rows[i].pareto = !dominates(&rows[j], &rows[i]);
        }
    }
}
