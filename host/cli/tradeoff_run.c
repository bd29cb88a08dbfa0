// SPDX-License-Identifier: BSD-3-Clause
// Which forms are measured, in which order and for how long; their pictures; the front as it grows.
//
// Of forms that differ by their domain alone one that is halfway up the levels is measured in each, and the domain with
// the smaller held-out error goes on alone. Under a budget the methods take turns, so that each has a row before one
// has many.
#include "host/cli/tradeoff_run.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "fit/options.h"
#include "host/cli/cli.h"
#include "scene/model_pictures.h"

#define LEVEL_MAX_4D 5

typedef enum state { WAITING, MEASURED, LEFT_OUT } state;

typedef struct run {
    const gonio_samples *samples;
    const gonio_fit_options *options;
    const cli_tradeoff_request *request;
    gonio_tradeoff_form *forms;
    gonio_tradeoff_row *rows; // of each form
    float **pictures;         // of each form; NULL where there are none
    state *states;
    size_t n, done;
    double end; // of the budget, by the clock
    bool over;
    gonio_image_scene *scene;
    cli_progress progress;
} run;

// ---- the list of methods ----

static bool listed(const char *list, const char *method) {
    const size_t length = strlen(method);
    for (const char *at = list; at != NULL && *at != 0; at += strcspn(at, ","), at += *at == ',') {
        if (strcspn(at, ",") == length && strncmp(at, method, length) == 0) {
            return true;
        }
    }
    return list == NULL;
}

const char *cli_tradeoff_unknown(const char *list, char *name, size_t size) {
    for (const char *at = list; at != NULL && *at != 0; at += strcspn(at, ","), at += *at == ',') {
        snprintf(name, size, "%.*s", (int)strcspn(at, ","), at);
        const char *found = name;
        if (gonio_method_find(&found) == NULL) {
            return name;
        }
    }
    return list != NULL && list[0] == 0 ? "" : NULL;
}

// ---- one form ----

static bool keep_going(void *context, double fraction, const char *what, double error_now) {
    run *r = context;
    (void)fraction;
    (void)what;
    (void)error_now;
    r->over = r->over || gonio_clock_s() > r->end;
    return !cli_interrupted() && !r->over;
}

// A row that no other one beats so far, on a line of its own.
static void tell_front(run *r, size_t index) {
    gonio_tradeoff_row *rows = malloc(r->n * sizeof *rows);
    size_t n = 0, at = 0;
    for (size_t i = 0; rows != NULL && i < r->n; i++) {
        at = i == index ? n : at;
        if (r->states[i] == MEASURED && r->rows[i].status == GONIO_OK) {
            rows[n++] = r->rows[i];
        }
    }
    if (rows != NULL && r->rows[index].status == GONIO_OK) {
        gonio_tradeoff_mark_pareto(rows, n);
        if (rows[at].pareto) {
            const gonio_tradeoff_row *row = &rows[at];
            cli_progress_end(&r->progress);
            fprintf(stderr, "front: %-20s error %-8.4g %9.4g kB %9.3g ns   (%zu of %zu rows, %.0f s)\n",
                    row->form.method, gonio_tradeoff_error(row), (double)row->report.bytes / 1024, row->eval_ns,
                    r->done, r->n, gonio_clock_s() - r->progress.started_s);
        }
    }
    free(rows);
}

static gonio_status measure(run *r, size_t i, gonio_error *error) {
    gonio_fit_options o = *r->options;
    gonio_model *model = NULL;
    cli_progress_update(&r->progress, (double)r->done, r->forms[i].method, NAN);
    if (isfinite(r->end) && gonio_method_has_member(r->forms[i].method, offsetof(gonio_fit_options, max_seconds))) {
        o.max_seconds = fmax(r->end - gonio_clock_s(), 1e-3);
    }
    gonio_status status = gonio_tradeoff_measure(r->samples, &o, &r->forms[i], &r->rows[i], &model, error);
    if (status == GONIO_E_INTERRUPTED && r->over && !cli_interrupted()) {
        return GONIO_OK; // the budget's end; the form stays as it was
    }
    r->states[i] = MEASURED;
    r->done++;
    if (status == GONIO_OK && model != NULL) {
        status = gonio_image_render(r->scene, model, o.threads, &r->pictures[i], error);
    }
    gonio_model_free(model);
    if (status == GONIO_OK && cli_interrupted()) {
        status = gonio_fail(error, GONIO_E_INTERRUPTED, "stopped after %zu of %zu rows", r->done, r->n);
    }
    if (status == GONIO_OK) {
        tell_front(r, i);
    }
    return status;
}

// ---- which ----

// The levels of the form's rivals in its own domain, of which this is how many.
static size_t levels_of(const run *r, size_t i, size_t *lower) {
    size_t n = 0;
    *lower = 0;
    for (size_t k = 0; k < r->n; k++) {
        if (gonio_tradeoff_rivals(&r->forms[i], &r->forms[k]) && r->forms[i].domain == r->forms[k].domain) {
            n++;
            *lower += r->forms[k].level < r->forms[i].level;
        }
    }
    return n;
}

static void drop_domain(run *r, size_t loser) {
    for (size_t k = 0; k < r->n; k++) {
        if (gonio_tradeoff_rivals(&r->forms[loser], &r->forms[k]) && r->forms[loser].domain == r->forms[k].domain) {
            r->done += r->states[k] == WAITING;
            r->states[k] = LEFT_OUT;
            free(r->pictures[k]);
            r->pictures[k] = NULL;
        }
    }
}

// Measure the form; where other domains are its rivals, they are compared halfway up the levels first.
static gonio_status visit(run *r, size_t i, gonio_error *error) {
    size_t best = r->n, lower;
    gonio_status status = GONIO_OK;
    for (size_t k = 0; k < r->n && !r->request->all_forms; k++) {
        if (!gonio_tradeoff_rivals(&r->forms[i], &r->forms[k]) || r->states[k] == LEFT_OUT) {
            continue;
        }
        const size_t levels = levels_of(r, k, &lower);
        bool rivals = false;
        for (size_t j = 0; j < r->n; j++) {
            rivals = rivals || (r->states[j] != LEFT_OUT && gonio_tradeoff_rivals(&r->forms[k], &r->forms[j]) &&
                                r->forms[k].domain != r->forms[j].domain);
        }
        if (!rivals || lower != levels / 2) {
            continue;
        }
        status = r->states[k] == WAITING ? measure(r, k, error) : GONIO_OK;
        if (status != GONIO_OK || r->states[k] != MEASURED) {
            return status;
        }
        const double now = gonio_tradeoff_error(&r->rows[k]);
        if (best == r->n || !(gonio_tradeoff_error(&r->rows[best]) <= now)) {
            if (best != r->n) {
                drop_domain(r, best);
            }
            best = k;
        } else {
            drop_domain(r, k);
        }
    }
    return r->states[i] == WAITING ? measure(r, i, error) : GONIO_OK;
}

// How many forms of the same method stand before it.
static size_t turn_of(const run *r, size_t i) {
    size_t before = 0;
    for (size_t k = 0; k < i; k++) {
        before += strcmp(r->forms[k].method, r->forms[i].method) == 0;
    }
    return before;
}

static gonio_status measure_all(run *r, gonio_error *error) {
    const bool turns = isfinite(r->end);
    gonio_status status = GONIO_OK;
    for (size_t turn = 0; turn < (turns ? r->n : 1); turn++) {
        for (size_t i = 0; i < r->n && status == GONIO_OK && !r->over; i++) {
            if (r->states[i] == WAITING && (!turns || turn_of(r, i) == turn)) {
                r->over = gonio_clock_s() > r->end;
                status = r->over ? GONIO_OK : visit(r, i, error);
            }
        }
    }
    return status;
}

// ---- the table ----

static gonio_status compare_pictures(run *r, cli_tradeoff_table *table, gonio_error *error) {
    float *truth = NULL;
    size_t best = r->n;
    for (size_t i = 0; i < r->n; i++) {
        const bool better = r->pictures[i] != NULL &&
                            (best == r->n || gonio_tradeoff_error(&r->rows[i]) < gonio_tradeoff_error(&r->rows[best]));
        best = better ? i : best;
    }
    gonio_status status = GONIO_OK;
    if (r->request->truth != NULL) {
        status = gonio_image_render(r->scene, r->request->truth, r->options->threads, &truth, error);
        snprintf(table->reference, sizeof table->reference, "the truth");
    } else if (best < r->n) {
        snprintf(table->reference, sizeof table->reference, "%s, the most accurate row", r->forms[best].method);
    }
    const float *reference = truth != NULL ? truth : best < r->n ? r->pictures[best] : NULL;
    for (size_t i = 0; i < r->n && status == GONIO_OK && reference != NULL; i++) {
        if (r->pictures[i] != NULL) {
            status = gonio_image_error(r->scene, reference, r->pictures[i], &r->rows[i].image_error, error);
        }
    }
    free(truth);
    return status;
}

static void collect(const run *r, cli_tradeoff_table *table) {
    for (size_t i = 0; i < r->n; i++) {
        if (r->states[i] == MEASURED) {
            table->rows[table->n++] = r->rows[i];
        }
        table->left += r->states[i] == WAITING;
    }
    gonio_tradeoff_mark_pareto(table->rows, table->n);
}

static gonio_status prepare(run *r, gonio_error *error) {
    const size_t all = gonio_tradeoff_forms(NULL, 0);
    r->forms = malloc(all * sizeof *r->forms);
    r->rows = calloc(all, sizeof *r->rows);
    r->pictures = calloc(all, sizeof *r->pictures);
    r->states = calloc(all, sizeof *r->states);
    if (r->forms == NULL || r->rows == NULL || r->pictures == NULL || r->states == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu rows", all);
    }
    gonio_tradeoff_forms(r->forms, all);
    for (size_t i = 0; i < all; i++) {
        // A lattice of level 7 has 1.2 GB a channel in four dimensions.
        const bool small = r->samples->isotropic || r->request->all_forms || r->forms[i].level <= LEVEL_MAX_4D;
        if (small && listed(r->request->methods, r->forms[i].method)) {
            r->forms[r->n++] = r->forms[i];
        }
    }
    return gonio_image_scene_new(&r->scene, error);
}

gonio_status cli_tradeoff_run(const gonio_samples *samples, gonio_fit_options *options,
                              const cli_tradeoff_request *request, cli_tradeoff_table *table, gonio_error *error) {
    run r = {.samples = samples,
             .options = options,
             .request = request,
             .end = request->budget > 0 ? gonio_clock_s() + request->budget : INFINITY};
    gonio_status status = prepare(&r, error);
    options->progress = keep_going;
    options->progress_context = &r;
    options->fill_store = gonio_fill_store_new();
    cli_progress_start(&r.progress, "tradeoff", (double)r.n);
    status = status == GONIO_OK ? measure_all(&r, error) : status;
    cli_progress_end(&r.progress);
    status = status == GONIO_OK ? compare_pictures(&r, table, error) : status;
    table->rows = status == GONIO_OK ? calloc(r.n + 1, sizeof *table->rows) : NULL;
    if (table->rows != NULL) {
        collect(&r, table);
    } else if (status == GONIO_OK) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu rows", r.n);
    }
    for (size_t i = 0; i < r.n; i++) {
        free(r.pictures[i]);
    }
    free(r.forms);
    free(r.rows);
    free(r.pictures);
    free(r.states);
    gonio_image_scene_free(r.scene);
    gonio_fill_store_free(options->fill_store);
    options->fill_store = NULL;
    return status;
}
