// SPDX-License-Identifier: BSD-3-Clause
// The rows of the trade-off, their measurement and the Pareto front.
#include "fit/tradeoff.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/random.h"

#include "fit/options.h"

#define EVALUATIONS 2000

static size_t append(gonio_tradeoff_form *forms, size_t limit, size_t n, gonio_tradeoff_form form) {
    if (n < limit) {
        forms[n] = form;
    }
    return n + 1;
}

// A method's form: every level, in each of the coordinates and domains that it names.
static size_t expand(const gonio_method *method, const gonio_method_form *form, gonio_tradeoff_form *forms,
                     size_t limit, size_t n) {
    for (int c = GONIO_COORDINATES_AUTO; c < GONIO_COORDINATES; c++) {
        for (int d = GONIO_DOMAIN_AUTO; d < GONIO_DOMAINS; d++) {
            const bool every_c = form->coordinates == GONIO_METHOD_EVERY && c != GONIO_COORDINATES_AUTO;
            const bool every_d = form->domain == GONIO_METHOD_EVERY && d != GONIO_DOMAIN_AUTO;
            for (int level = form->first;
                 level <= form->last && (every_c || form->coordinates == c) && (every_d || form->domain == d);
                 level++) {
                n = append(
                    forms, limit, n,
                    (gonio_tradeoff_form){method->name, level, (gonio_coordinates)c, (gonio_domain)d, form->with});
            }
        }
    }
    return n;
}

size_t gonio_tradeoff_forms(gonio_tradeoff_form *forms, size_t limit) {
    size_t n = 0;
    for (int i = 0; gonio_method_at(i) != NULL; i++) {
        const gonio_method *method = gonio_method_at(i);
        for (int k = 0; k < method->forms_n; k++) {
            n = expand(method, &method->forms[k], forms, limit, n);
        }
    }
    return n;
}

// Options as text, "order=2 grid=angles".
static gonio_status apply(const char *with, gonio_fit_options *options, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (const char *at = with; at != NULL && *at != 0 && status == GONIO_OK; at += strspn(at, " ")) {
        char value[32];
        const size_t length = strcspn(at, " "), split = strcspn(at, "=");
        const gonio_key *key = gonio_fit_keys;
        while (key->name != NULL && (strncmp(key->name, at, split) != 0 || key->name[split] != 0)) {
            key++;
        }
        snprintf(value, sizeof value, "%.*s", split < length ? (int)(length - split - 1) : 0, at + split + 1);
        status = key->name != NULL ? gonio_key_parse(key, options, value, error)
                                   : gonio_fail(error, GONIO_E_USAGE, "'%s': no such option of a fit", at);
        at += length;
    }
    return status;
}

// ---- timing ----

static gonio_vec3 random_direction(uint64_t *state) {
    const double z = gonio_random_next(state), phi = 2 * GONIO_PI * gonio_random_next(state), s = sqrt(1 - z * z);
    return (gonio_vec3){s * cos(phi), s * sin(phi), z};
}

// Pairs of all the halves that the model has, by turns.
static void spread_over_halves(const gonio_model *model, gonio_vec3 *directions) {
    int halves[GONIO_HALVES], n = 0;
    for (int h = 0; h < GONIO_HALVES; h++) {
        halves[n] = h;
        n += gonio_model_half(model, (gonio_half)h) != NULL;
    }
    for (size_t i = 0; n > 0 && i < EVALUATIONS; i++) {
        const int half = halves[i % (size_t)n], back = half & GONIO_REFLECTION_BACK,
                  through = half & GONIO_TRANSMISSION;
        directions[i].z *= back != 0 ? -1 : 1;
        directions[EVALUATIONS + i].z *= (back != 0) != (through != 0) ? -1 : 1;
    }
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
    spread_over_halves(model, directions);
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

// Bytes that are written, which go nowhere.
static ssize_t count_bytes(void *cookie, const char *data, size_t length) {
    (void)data;
    *(size_t *)cookie += length;
    return (ssize_t)length;
}

static size_t file_bytes(const gonio_model *model) {
    size_t bytes = 0;
    FILE *stream = fopencookie(&bytes, "w", (cookie_io_functions_t){.write = count_bytes});
    if (stream != NULL) {
        const gonio_status status = model->ops->save(model, stream, NULL);
        bytes = fclose(stream) == 0 && status == GONIO_OK ? bytes : 0;
    }
    return bytes;
}

gonio_status gonio_tradeoff_measure(const gonio_samples *samples, const gonio_fit_options *options,
                                    const gonio_tradeoff_form *form, gonio_tradeoff_row *row, gonio_model **model,
                                    gonio_error *error) {
    *row = (gonio_tradeoff_row){.form = *form, .eval_ns = NAN, .batch_ns = NAN, .image_error = NAN};
    gonio_fit_options o = *options;
    gonio_fit_options_for(&o, form->method); // what it does not have, others may
    o.level = form->level;
    o.coordinates = form->coordinates;
    o.domain = form->domain;
    gonio_model *fitted = NULL;
    row->error = (gonio_error){.line = -1, .byte = -1};
    row->status = apply(form->with, &o, &row->error);
    row->status = row->status == GONIO_OK ? gonio_fit(samples, &o, &fitted, &row->report, &row->error) : row->status;
    if (row->status != GONIO_OK && error != NULL) {
        *error = row->error;
    }
    gonio_status status = row->status == GONIO_E_INTERRUPTED ? row->status : GONIO_OK;
    if (row->status == GONIO_OK) {
        row->file_bytes = file_bytes(fitted);
        status = time_model(fitted, options->seed, row, error);
    }
    if (model != NULL && status == GONIO_OK) {
        *model = fitted;
    } else {
        gonio_model_free(fitted);
    }
    return status;
}

static bool same_text(const char *a, const char *b) { return a == b || (a != NULL && b != NULL && strcmp(a, b) == 0); }

bool gonio_tradeoff_rivals(const gonio_tradeoff_form *a, const gonio_tradeoff_form *b) {
    return same_text(a->method, b->method) && same_text(a->with, b->with) && a->coordinates == b->coordinates;
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
