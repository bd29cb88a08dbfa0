// SPDX-License-Identifier: BSD-3-Clause
#include "host/cli/model_input.h"

#include <stdio.h>
#include <string.h>

#include "gonio/fit.h"
#include "gonio/needs.h"
#include "gonio/plan.h"
#include "gonio/session.h"
#include "io/format.h"

static bool on_progress(void *context, double fraction, const char *what, double error_now) {
    cli_progress_update(context, fraction, what, error_now);
    return !cli_interrupted();
}

static void tell(const char *name, const gonio_fit_report *r, json_t *result) {
    fprintf(stderr,
            "gonio: %s: %zu samples; a model was fitted to them by the default method (%s %s), held-out median error "
            "%.3g %%; `gonio fit` has others\n",
            cli_text(name), r->samples, r->method, r->options, 100 * r->held_out.median_rel);
    if (r->note[0] != 0) {
        fprintf(stderr, "gonio: note: %s\n", cli_text(r->note));
    }
    json_object_set_new(result, "fitted",
                        json_pack("{s:s,s:s,s:I,s:o,s:o,s:s}", "method", r->method, "options", r->options, "samples",
                                  (json_int_t)r->samples, "train", cli_json_errors(&r->train), "held_out",
                                  cli_json_errors(&r->held_out), "note", r->note));
}

static gonio_status fit(const char *name, const gonio_samples *samples, const cli_common *common, json_t *result,
                        gonio_model **model, gonio_error *error) {
    gonio_fit_options options;
    gonio_fit_report report;
    gonio_coverage coverage;
    gonio_status status = gonio_coverage_of(samples, &coverage, error);
    if (status != GONIO_OK) {
        return status;
    }
    cli_progress progress;
    gonio_fit_options_default(&options);
    options.seed = common->seed;
    options.threads = common->threads;
    options.progress = on_progress;
    options.progress_context = &progress;
    cli_catch_interrupts();
    cli_progress_start(&progress, "fit", 1);
    status = gonio_fit(samples, &options, model, &report, error);
    cli_progress_end(&progress);
    status = status == GONIO_OK ? gonio_model_describe(*model, &coverage, &report, error) : status;
    if (status == GONIO_OK) {
        tell(name, &report, result);
    }
    return status;
}

// Samples, of which a model is made.
static gonio_status of_samples(const char *name, const cli_input *in, const cli_common *common, json_t *result,
                               gonio_model **model, gonio_samples **out, gonio_error *error) {
    gonio_samples *samples;
    gonio_status status = cli_input_read(name, in, common, &samples, error);
    status = status == GONIO_OK ? fit(name, samples, common, result, model, error) : status;
    if (status != GONIO_OK) {
        gonio_model_free(*model);
        *model = NULL;
    }
    if (status != GONIO_OK || out == NULL) {
        gonio_samples_free(samples);
        return status;
    }
    *out = samples;
    return status;
}

gonio_status cli_model_read(const char *name, const cli_input *in, const cli_common *common, json_t *result,
                            gonio_model **model, gonio_samples **samples, gonio_error *error) {
    *model = NULL;
    if (samples != NULL) {
        *samples = NULL;
    }
    const bool is_model = strncmp(name, "spec:", 5) == 0 || gonio_model_file_is(name);
    if (!is_model && (gonio_session_is(name) || gonio_session_is_hdf5(name) || cli_input_maps(name, in) ||
                      !gonio_format_is_table(name))) {
        return of_samples(name, in, common, result, model, samples, error);
    }
    const gonio_status status = cli_input_refuse(in, "a model or a table taken as one", error);
    return status == GONIO_OK ? gonio_model_resolve(name, model, error) : status;
}

gonio_status cli_model_sampled(const gonio_model *model, const char *plan, const char *usual, const cli_common *common,
                               gonio_samples **samples, gonio_error *error) {
    const bool back = gonio_model_half(model, GONIO_REFLECTION_BACK) != NULL ||
                      gonio_model_half(model, GONIO_TRANSMISSION_BACK) != NULL;
    const bool through =
        gonio_model_half(model, GONIO_TRANSMISSION) != NULL || gonio_model_half(model, GONIO_TRANSMISSION_BACK) != NULL;
    char text[80];
    snprintf(text, sizeof text, "%s%s%s", usual, through ? ",transmission=1" : "", back ? ",back=1" : "");
    gonio_plan *poses;
    gonio_status status = gonio_plan_resolve(plan != NULL ? plan : text, common->seed, NULL, NULL, &poses, NULL, error);
    if (status == GONIO_OK) {
        status = gonio_samples_of_model(model, poses->poses, poses->n, common->threads, samples, error);
        gonio_plan_free(poses);
    }
    return status;
}
