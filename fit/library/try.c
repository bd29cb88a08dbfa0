// SPDX-License-Identifier: BSD-3-Clause
// How good a library is for a material that it has not seen.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/random.h"
#include "base/statistics.h"
#include "base/thread_pool.h"
#include "fit/library/learn.h"

#define MODELS_MAX 60 // more tell the quantiles no better
#define POSES 20
#define DIRECTIONS 200
#define WITHIN 0.95 // of the errors are to lie within 1.96 sigma
#define WITHIN_SIGMAS 1.96
#define LIKE 0.95      // of the library's own have smaller residuals than what the limit is made of,
#define LIMIT_MARGIN 2 // times this
#define TINY 1e-3      // of the figures

typedef struct trial {
    const gonio_model *const *models;
    size_t n, step, parts_n; // every step-th model
    gonio_library *const *parts;
    const gonio_library_options *options;
    gonio_plan *plans[2]; // poses, directions
    double *z;            // [tried][DIRECTIONS], standardised errors, channel 0
    double *relative;     // the same, relative errors
    double *residual;     // [tried]
} trial;

static gonio_status sample(const gonio_model *model, const gonio_plan *plan, gonio_samples **out, gonio_error *error) {
    gonio_status status = gonio_samples_new(model->channels, false, out, error);
    double values[GONIO_CHANNELS_MAX];
    for (size_t i = 0; i < plan->n && status == GONIO_OK; i++) {
        gonio_model_eval_pair(model, &plan->poses[i], values);
        for (int c = 0; c < model->channels; c++) {
            values[c] = isfinite(values[c]) ? values[c] : 0;
        }
        status = gonio_samples_add(*out, &plan->poses[i], values, NULL, NULL, error);
    }
    if (status == GONIO_OK) {
        (*out)->isotropic = true;
    }
    return status;
}

static gonio_status try_one(void *context, size_t k, gonio_error *error) {
    const trial *t = context;
    const gonio_model *model = t->models[k * t->step];
    const gonio_library *library = t->parts[k * t->step % t->parts_n];
    gonio_samples *few = NULL;
    library_posterior p = {0};
    double *work = malloc((POSES + (size_t)library->rank + (size_t)model->channels) * sizeof *work);
    gonio_status status = work != NULL ? sample(model, t->plans[0], &few, error)
                                       : gonio_fail(error, GONIO_E_MEMORY, "no memory to learn");
    status = status == GONIO_OK ? gonio_library_condition(library, few, &p, error) : status;
    for (size_t i = 0; i < DIRECTIONS && status == GONIO_OK; i++) {
        library_place place;
        double *z = work + POSES + (size_t)library->rank, variance, f[GONIO_CHANNELS_MAX];
        gonio_model_eval_pair(model, &t->plans[1]->poses[i], f);
        gonio_library_place(library, &t->plans[1]->poses[i], work + POSES, &place);
        gonio_library_predict(&p, &place, z, &variance, work);
        const double by = z[0] - gonio_library_map(&place, f[0]);
        t->z[k * DIRECTIONS + i] = fabs(by) / sqrt(variance + 1e-12);
        t->relative[k * DIRECTIONS + i] = fabs(gonio_library_unmap(&place, z[0]) - f[0]) / (f[0] + TINY);
    }
    // As gonio_library_fit does: residuals widen sigma.
    for (size_t i = 0; i < DIRECTIONS && status == GONIO_OK; i++) {
        t->z[k * DIRECTIONS + i] /= sqrt(fmax(p.residual, 1));
    }
    t->residual[k] = p.residual;
    gonio_library_posterior_release(&p);
    gonio_samples_free(few);
    free(work);
    return status;
}

static void conclude(trial *t, size_t tried, gonio_library *out) {
    const size_t all = tried * DIRECTIONS;
    gonio_sort(t->z, all);
    out->facts.inflation = fmax(t->z[(size_t)(WITHIN * (double)(all - 1))] / WITHIN_SIGMAS, 1);
    out->facts.trial_error = gonio_median(t->relative, all);
    gonio_sort(t->residual, tried);
    out->facts.limit = LIMIT_MARGIN * fmax(t->residual[(size_t)(LIKE * (double)(tried - 1))], 1);
}

gonio_status gonio_library_try(const gonio_model *const *models, size_t n, size_t parts_n, gonio_library *const *parts,
                               const gonio_library_options *options, gonio_library *out, gonio_error *error) {
    const size_t step = (n + MODELS_MAX - 1) / MODELS_MAX, tried = (n + step - 1) / step;
    char text[2][32];
    trial t = {.models = models, .n = n, .step = step, .parts_n = parts_n, .parts = parts, .options = options};
    snprintf(text[0], sizeof text[0], "nusselt:%d", POSES);
    snprintf(text[1], sizeof text[1], "nusselt:%d", DIRECTIONS);
    t.z = malloc((2 * DIRECTIONS + 1) * tried * sizeof *t.z);
    gonio_status status = t.z != NULL ? gonio_plan_make(text[0], options->seed, &t.plans[0], error)
                                      : gonio_fail(error, GONIO_E_MEMORY, "no memory to learn");
    status =
        status == GONIO_OK ? gonio_plan_make(text[1], gonio_random(options->seed) >> 1, &t.plans[1], error) : status;
    if (status == GONIO_OK) {
        t.relative = t.z + tried * DIRECTIONS;
        t.residual = t.relative + tried * DIRECTIONS;
        status = gonio_pool_try(options->threads, tried, try_one, &t, error);
    }
    if (status == GONIO_OK) {
        conclude(&t, tried, out);
    }
    gonio_plan_free(t.plans[0]);
    gonio_plan_free(t.plans[1]);
    free(t.z);
    return status;
}
