// SPDX-License-Identifier: BSD-3-Clause
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/keys.h"
#include "fit/method.h"
#include "fit/names.h"
#include "scene/needs/search.h"

#define FORMULA_SAMPLES 600 // some dozens a parameter
#define DIFFUSE_FIRST 1
#define DIFFUSE_LAST 4

static double ns_of(const search_work *w, const gonio_model *model) {
    enum { RUNS = 5, EVALUATIONS = 4000 };
    float values[model->channels];
    double least = INFINITY;
    for (int run = 0; run < RUNS; run++) {
        const double start = gonio_clock_s();
        for (size_t i = 0; i < EVALUATIONS; i++) {
            const gonio_need *cell = &w->cells[i * 7919 % w->n_cells];
            gonio_model_eval_f32(model, cell->wi, cell->wo, values);
        }
        least = fmin(least, (gonio_clock_s() - start) * 1e9 / EVALUATIONS);
    }
    return least;
}

static void cost_of(const search_work *w, const gonio_model *model, search_candidate *c) {
    c->bytes = model->bytes + (c->formula == NULL ? gonio_needed_sigma_bytes(w->best->isotropic ? 3 : 4) : 0);
    c->ns = w->how->least_ns ? ns_of(w, model) : NAN;
    c->cost = w->how->least_ns ? c->ns : (double)c->bytes;
}

// ---- formulae ----

// Of the cells, evenly in their order: each stands for its neighbours.
static gonio_status thin(const search_work *w, gonio_samples **out, gonio_error *error) {
    bool *keep = calloc(w->told->n + 1, sizeof *keep);
    if (keep == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu samples", w->told->n);
    }
    const size_t step = 1 + w->n_cells / FORMULA_SAMPLES, fill = 1 + GONIO_SEARCH_FILL / (FORMULA_SAMPLES / 4);
    for (size_t i = 0; i < w->told->n; i++) {
        keep[i] = i < w->n_cells ? i % step == 0 : i % fill == 0;
    }
    const gonio_status status = gonio_samples_select(w->told, keep, out, error);
    free(keep);
    return status;
}

static gonio_status fit_formula(const search_work *w, const char *method, gonio_model **out, gonio_fit_report *report,
                                gonio_error *error) {
    gonio_samples *few;
    gonio_fit_options o;
    gonio_fit_options_default(&o);
    o.method = method;
    o.hold_out = 0;
    o.seed = w->options->seed;
    o.threads = w->options->threads;
    o.max_memory = w->options->max_memory;
    *out = NULL;
    gonio_status status = thin(w, &few, error);
    if (status == GONIO_OK) {
        status = gonio_fit(few, &o, out, report, error);
        gonio_samples_free(few);
    }
    return status;
}

gonio_status gonio_search_formulae(search_work *w, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int m = 0; gonio_method_at(m) != NULL && status == GONIO_OK; m++) {
        const gonio_method *method = gonio_method_at(m);
        gonio_model *model = NULL;
        gonio_fit_report report;
        gonio_error why;
        if (strcmp(method->kind, "analytic") != 0 || w->n == GONIO_SEARCH_CANDIDATES) {
            continue;
        }
        status = gonio_search_checkpoint(w, method->name, error);
        // One that such samples cannot be fitted by is none.
        if (status == GONIO_OK && fit_formula(w, method->name, &model, &report, &why) == GONIO_OK) {
            search_candidate *c = &w->candidates[w->n++];
            *c = (search_candidate){.formula = method->name,
                                    .predicted = gonio_search_promise(w, model),
                                    .target = w->limit * GONIO_SEARCH_SAFETY};
            cost_of(w, model, c);
            c->out = !(c->predicted <= 2 * w->limit);
            gonio_model_free(model);
            w->report->compared++;
        }
    }
    return status;
}

// ---- bricks ----

// The fewest units whose promise keeps the candidate's target; false: all of them do not.
static gonio_status shrink(const search_work *w, const gonio_needed *needed, search_candidate *c, bool *keeps,
                           gonio_error *error) {
    size_t low = 0, high = gonio_needed_units(needed);
    gonio_status status = GONIO_OK;
    *keeps = false;
    for (size_t units = high; status == GONIO_OK; units = low + (high - low) / 2) {
        gonio_model *model;
        status = gonio_needed_model(needed, units, c->storage, &model, error);
        if (status == GONIO_E_RANGE) {
            return GONIO_OK; // more bricks than a table numbers
        }
        const double promised = status == GONIO_OK ? gonio_search_promise(w, model) : NAN;
        if (status == GONIO_OK && promised <= c->target) {
            *keeps = true;
            c->units = high = units;
            c->predicted = promised;
            cost_of(w, model, c);
        } else if (!*keeps) {
            c->predicted = promised;
            high = low;
        } else {
            low = units;
        }
        gonio_model_free(status == GONIO_OK ? model : NULL);
        // Within a fortieth: finer steps cost more fits than bytes.
        if (high <= low + 1 + high / 40) {
            break;
        }
    }
    return status;
}

static gonio_status make_needed(const search_work *w, const gonio_needed_form *form, gonio_needed **out,
                                gonio_error *error) {
    return gonio_needed_new(w->told, w->cells, w->n_cells, !w->best->isotropic, form, w->options->threads, out, error);
}

// The storages that may be, smallest first.
static int storages_of(const search_work *w, gonio_storage list[3]) {
    const bool asked = w->options->method != NULL && strcmp(w->options->method, "cbmba") == 0;
    if (asked && w->options->storage != NULL) {
        list[0] = (gonio_storage)gonio_names_find(gonio_storage_names(), w->options->storage);
        return 1;
    }
    if (!w->best->isotropic) {
        list[0] = GONIO_STORAGE_JENKINS;
        return 1;
    }
    list[0] = GONIO_STORAGE_BYTE;
    list[1] = GONIO_STORAGE_HALF;
    list[2] = GONIO_STORAGE_FLOAT;
    return 3;
}

// The smallest model of a form that keeps the promise, if any; *cost: its cost, else infinity.
static gonio_status try_form(search_work *w, const gonio_needed_form *form, double *cost, gonio_error *error) {
    gonio_storage storages[3];
    gonio_needed *needed;
    const int n = storages_of(w, storages);
    *cost = INFINITY;
    gonio_status status = make_needed(w, form, &needed, error);
    for (int k = 0; k < n && status == GONIO_OK && *cost == INFINITY && w->n < GONIO_SEARCH_CANDIDATES; k++) {
        search_candidate c = {.form = *form, .storage = storages[k], .target = w->limit * GONIO_SEARCH_SAFETY};
        bool keeps;
        status = shrink(w, needed, &c, &keeps, error);
        w->report->compared++;
        if (status == GONIO_OK && keeps) {
            w->candidates[w->n++] = c;
            *cost = c.cost;
        }
    }
    gonio_needed_free(status == GONIO_OK ? needed : NULL);
    return status;
}

// Levels from the coarsest on, as long as they get cheaper; then the diffuse level.
static gonio_status try_levels(search_work *w, gonio_needed_form form, double *cheapest, gonio_error *error) {
    const gonio_fit_options *o = w->options;
    const bool own = o->method != NULL && strcmp(o->method, "cbmba") == 0;
    const int first = own && o->level >= 0 ? o->level : 3;
    const int last = own && o->level >= 0 ? o->level : w->best->isotropic ? 7 : 4;
    double least = INFINITY, cost;
    gonio_status status = GONIO_OK;
    for (int level = first; level <= last && status == GONIO_OK; level++) {
        form.level = level;
        form.diffuse = own && o->diffuse_level >= 0 ? o->diffuse_level : level > 3 ? 2 : 1;
        if (form.diffuse >= level) {
            return gonio_fail(error, GONIO_E_USAGE, "levels D = %d and S = %d: D < S is needed", form.diffuse, level);
        }
        status = try_form(w, &form, &cost, error);
        if (cost > least || (cost < INFINITY && cost > 2 * *cheapest)) {
            break;
        }
        least = fmin(least, cost);
    }
    *cheapest = fmin(*cheapest, least);
    return status;
}

static gonio_status try_diffuse(search_work *w, gonio_error *error) {
    int best = -1;
    for (int k = 0; k < w->n; k++) {
        best = w->candidates[k].formula == NULL && (best < 0 || w->candidates[k].cost < w->candidates[best].cost)
                   ? k
                   : best;
    }
    gonio_status status = GONIO_OK;
    for (int d = DIFFUSE_FIRST; best >= 0 && d <= DIFFUSE_LAST && status == GONIO_OK; d++) {
        gonio_needed_form form = w->candidates[best].form;
        double cost;
        if (d != form.diffuse && d < form.level) {
            form.diffuse = d;
            status = try_form(w, &form, &cost, error);
        }
    }
    return status;
}

gonio_status gonio_search_bricks(search_work *w, gonio_error *error) {
    const gonio_fit_options *o = w->options;
    const bool own = o->method != NULL && strcmp(o->method, "cbmba") == 0;
    double cheapest = INFINITY;
    gonio_status status = GONIO_OK;
    for (int s = 0; s < GONIO_COORDINATES && status == GONIO_OK; s++) {
        for (int d = 0; d < GONIO_DOMAINS && status == GONIO_OK; d++) {
            const bool wanted =
                !own || ((o->coordinates == GONIO_COORDINATES_AUTO || o->coordinates == (gonio_coordinates)s) &&
                         (o->domain == GONIO_DOMAIN_AUTO || o->domain == (gonio_domain)d));
            char what[80];
            snprintf(what, sizeof what, "bricks, %s, %s", gonio_coordinates_name((gonio_coordinates)s),
                     gonio_domain_name((gonio_domain)d));
            status = wanted ? gonio_search_checkpoint(w, what, error) : GONIO_OK;
            if (wanted && status == GONIO_OK) {
                status =
                    try_levels(w, (gonio_needed_form){(gonio_coordinates)s, (gonio_domain)d, 0, 0}, &cheapest, error);
            }
        }
    }
    return status == GONIO_OK && !(own && o->diffuse_level >= 0) ? try_diffuse(w, error) : status;
}

// ---- one of them ----

gonio_status gonio_search_model(const search_work *w, const search_candidate *c, bool final, gonio_model **out,
                                gonio_error *error) {
    gonio_fit_report report;
    gonio_needed *needed;
    if (c->formula != NULL) {
        return fit_formula(w, c->formula, out, &report, error);
    }
    *out = NULL;
    gonio_status status = make_needed(w, &c->form, &needed, error);
    if (status == GONIO_OK) {
        status = final ? gonio_needed_finish(needed, c->units, c->storage, out, error)
                       : gonio_needed_model(needed, c->units, c->storage, out, error);
        gonio_needed_free(needed);
    }
    return status;
}

void gonio_search_describe(const search_candidate *c, char *text, size_t size) {
    if (c->formula != NULL) {
        snprintf(text, size, "%s", c->formula);
    } else {
        snprintf(text, size, "cbmba (%d,%d) %s, %s, %s", c->form.diffuse, c->form.level,
                 gonio_coordinates_name(c->form.coordinates), gonio_domain_name(c->form.domain),
                 gonio_storage_names()[c->storage]);
    }
}

// The candidate with another target; *keeps: there is such a model.
gonio_status gonio_search_retarget(const search_work *w, search_candidate *c, double target, bool *keeps,
                                   gonio_error *error) {
    gonio_needed *needed;
    *keeps = false;
    if (c->formula != NULL) {
        return GONIO_OK;
    }
    gonio_status status = make_needed(w, &c->form, &needed, error);
    if (status == GONIO_OK) {
        c->target = target;
        status = shrink(w, needed, c, keeps, error);
        gonio_needed_free(needed);
    }
    return status;
}
