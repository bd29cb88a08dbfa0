// SPDX-License-Identifier: BSD-3-Clause
// gonio fit: samples -> model.
#include <stdio.h>
#include <string.h>

#include "gonio/check.h"
#include "host/cli/fit_arguments.h"
#include "host/cli/input.h"
#include "host/cli/scene_fit.h"

typedef struct fit_arguments {
    const char *output, *physical;
    bool reciprocal, passive;
    gonio_physical_report made;
    gonio_errors physical_held; // of a fit that did not see them, made physical in the same way
    cli_input input;
    cli_scene_fit scene;
    gonio_fit_options options;
    gonio_coverage coverage;
    gonio_mueller_report mueller;
} fit_arguments;

static bool on_progress(void *context, double fraction, const char *what, double error_now) {
    cli_progress_update(context, fraction, what, error_now);
    return !cli_interrupted();
}

// Of samples with transmission each half; else empty.
static json_t *halves_json(const gonio_fit_report *r) {
    json_t *halves = json_array();
    for (int h = 0; h < GONIO_HALVES; h++) {
        const gonio_half_report *half = &r->half[h];
        if (half->samples > 0) {
            json_array_append_new(halves, json_pack("{s:s,s:I,s:s,s:o,s:o}", "half", gonio_half_name((gonio_half)h),
                                                    "samples", (json_int_t)half->samples, "options", half->options,
                                                    "train", cli_json_errors(&half->train), "held_out",
                                                    cli_json_errors(&half->held_out)));
        }
    }
    return halves;
}

static json_t *to_json(const fit_arguments *a, const char *input, const gonio_fit_report *r) {
    return json_pack("{s:s,s:i,s:s,s:s,s:I,s:i,s:I,s:I,s:o,s:o,s:o,s:s,s:s,s:s,s:s?,s:o,s:o,s:o}", "method", r->method,
                     "level", r->level, "coordinates", gonio_coordinates_name(r->coordinates), "domain",
                     gonio_domain_name(r->domain), "samples", (json_int_t)r->samples, "channels", r->channels,
                     "control_points", (json_int_t)r->control_points, "bytes", (json_int_t)r->bytes, "fit_seconds",
                     cli_json_real(r->fit_seconds), "train", cli_json_errors(&r->train), "held_out",
                     cli_json_errors(&r->held_out), "options", r->options, "note", r->note, "input", input, "model",
                     a->output, "sampled", cli_json_coverage(&a->coverage), "mueller", cli_json_mueller(&a->mueller),
                     "halves", halves_json(r));
}

static void print(const fit_arguments *a, const gonio_fit_report *r) {
    if (gonio_method_has_member(r->method, offsetof(gonio_fit_options, coordinates))) {
        printf("%s level %d, %s, %s %s\n", r->method, r->level, gonio_coordinates_name(r->coordinates),
               gonio_domain_name(r->domain), r->options);
    } else {
        printf("%s %s\n", r->method, r->options);
    }
    printf("%zu samples, %d channels -> %zu control points a channel, %zu bytes, %.3g s\n", r->samples, r->channels,
           r->control_points, r->bytes, r->fit_seconds);
    cli_print_coverage(&a->coverage);
    cli_print_mueller(&a->mueller);
    cli_print_errors("train", &r->train);
    cli_print_errors("held out", &r->held_out);
    char of[200];
    gonio_coverage_range_text(&a->coverage, of, sizeof of);
    printf("%-10s both are of %s\n", "", of);
    for (int h = 0; h < GONIO_HALVES; h++) {
        if (r->half[h].samples > 0) {
            printf("%s: %s\n", gonio_half_name((gonio_half)h), r->half[h].options);
            cli_print_errors("  train", &r->half[h].train);
            cli_print_errors("  held out", &r->half[h].held_out);
        }
    }
    if (r->note[0] != 0) {
        printf("note: %s\n", cli_text(r->note));
    }
    printf("%s\n", a->output != NULL ? a->output : "no -o: the model was not saved");
}

// ---- physical by construction ----

static bool parse_physical(const cli_common *common, fit_arguments *a) {
    char copy[64], *rest;
    snprintf(copy, sizeof copy, "%s", a->physical != NULL ? a->physical : "");
    for (char *item = strtok_r(copy, ",", &rest); item != NULL; item = strtok_r(NULL, ",", &rest)) {
        if (strcmp(item, "reciprocal") == 0) {
            a->reciprocal = true;
        } else if (strcmp(item, "passive") == 0) {
            a->passive = true;
        } else {
            cli_usage(common, "fit: --physical '%s'; expected reciprocal, passive or both with a comma between them",
                      item);
            return false;
        }
    }
    return true;
}

static gonio_status make_physical(const fit_arguments *a, int threads, gonio_model **model, gonio_physical_report *made,
                                  gonio_error *error) {
    gonio_model *given = *model;
    return gonio_check_make_physical(given, a->reciprocal, a->passive, threads, model, made, error);
}

// The same way from the samples that are not held out to the errors on those that are.
static gonio_status price(const gonio_samples *samples, fit_arguments *a, int threads, gonio_error *error) {
    bool *held = calloc(samples->n + 1, sizeof *held);
    gonio_samples *rest = NULL;
    gonio_model *model = NULL;
    gonio_fit_report report;
    gonio_physical_report made;
    gonio_fit_options options = a->options;
    options.hold_out = 0;
    options.folds = 0;
    gonio_status status = held != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a hold-out");
    status = status == GONIO_OK ? gonio_samples_hold_out(samples, a->options.hold_out, a->options.seed, held, error)
                                : status;
    for (size_t i = 0; status == GONIO_OK && i < samples->n; i++) {
        held[i] = !held[i];
    }
    status = status == GONIO_OK ? gonio_samples_select(samples, held, &rest, error) : status;
    status = status == GONIO_OK ? gonio_fit(rest, &options, &model, &report, error) : status;
    status = status == GONIO_OK ? make_physical(a, threads, &model, &made, error) : status;
    for (size_t i = 0; status == GONIO_OK && i < samples->n; i++) {
        held[i] = !held[i];
    }
    status = status == GONIO_OK ? gonio_errors_model(model, samples, held, threads, &a->physical_held, error) : status;
    gonio_model_free(model);
    gonio_samples_free(rest);
    free(held);
    return status;
}

static json_t *physical_json(const fit_arguments *a) {
    const gonio_physical_report *r = &a->made;
    return json_pack("{s:b,s:b,s:f,s:f,s:f,s:f,s:f,s:f,s:o}", "reciprocal", (int)a->reciprocal, "passive",
                     (int)a->passive, "reciprocity_before", r->reciprocity_before, "energy_before", r->energy_before,
                     "energy", r->energy, "least_factor", r->least_factor, "least_factor_bound", r->least_factor_bound,
                     "least_factor_theta", gonio_degrees(r->theta_rad), "held_out", cli_json_errors(&a->physical_held));
}

static void print_physical(const fit_arguments *a, const gonio_fit_report *fitted) {
    const gonio_physical_report *r = &a->made;
    if (a->reciprocal) {
        printf("reciprocal: P_r was %.3g /sr^2 and is 0\n", r->reciprocity_before);
    }
    if (a->passive) {
        printf("passive: the largest albedo was %.5g and is %.5g; the least factor is %.5g, at %g deg (no others have "
               "a least "
               "one above %.5g)\n",
               r->energy_before, r->energy, r->least_factor, gonio_degrees(r->theta_rad), r->least_factor_bound);
    }
    cli_print_errors("physical", &a->physical_held);
    if (a->physical_held.samples > 0) {
        printf("price: held-out median error %.4g %% instead of %.4g %%\n", 100 * a->physical_held.median_rel,
               100 * fitted->held_out.median_rel);
    }
}

static gonio_status fit(const char *path, fit_arguments *a, const cli_common *common, gonio_fit_report *report,
                        gonio_error *error) {
    gonio_samples *samples;
    gonio_status status = cli_input_read(path, &a->input, common, &samples, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_check_mueller(samples, &a->mueller);
    status = gonio_coverage_of(samples, &a->coverage, error);
    if (status != GONIO_OK) {
        gonio_samples_free(samples);
        return status;
    }
    cli_catch_interrupts();
    cli_progress progress;
    cli_progress_start(&progress, "fit", 1);
    a->options.progress = on_progress;
    a->options.progress_context = &progress;
    gonio_model *model;
    status = a->scene.needs == NULL ? gonio_fit(samples, &a->options, &model, report, error) : GONIO_OK;
    cli_progress_end(&progress);
    if (a->scene.needs != NULL) {
        a->options.progress = NULL;
        status = cli_scene_fit_run(&a->scene, samples, &a->options, common, &model, report, error);
    }
    if (status == GONIO_OK && cli_interrupted()) {
        status = gonio_fail(error, GONIO_E_INTERRUPTED, "interrupted; nothing was written");
    }
    if (status == GONIO_OK && a->physical != NULL) {
        status = make_physical(a, common->threads, &model, &a->made, error);
        status = status == GONIO_OK && a->options.hold_out > 0 ? price(samples, a, common->threads, error) : status;
    }
    status = status == GONIO_OK ? gonio_model_describe(model, &a->coverage, report, error) : status;
    status = status == GONIO_OK && a->output != NULL ? gonio_model_save(model, a->output, error) : status;
    gonio_model_free(model);
    gonio_samples_free(samples);
    return status;
}

static int run(int argc, char **argv) {
    fit_arguments a = {.scene.how.turn_deg = 5};
    cli_fit_arguments arguments = {0};
    const cli_option input_rows[] = {CLI_INPUT_OPTIONS(a.input), CLI_SCENE_FIT_OPTIONS(a.scene), {0}};
    cli_option options[2 + GONIO_FIT_KEYS + sizeof input_rows / sizeof *input_rows] = {
        {"output", 'o', CLI_OUTPUT, &a.output, NULL, "MODEL", "the model file to write"},
        {"physical", 0, CLI_TEXT, &a.physical, NULL, "LIST",
         "reciprocal,passive: make the model so, with the smallest change that does"}};
    const int n = 2 + cli_fit_rows(&arguments, options + 2);
    memcpy(options + n, input_rows, sizeof input_rows);
    extern const cli_verb cmd_fit;
    const char *input;
    int count;
    cli_common common;
    if (!cli_parse(&cmd_fit, options, argc, argv, &input, 1, 1, &count, &common) ||
        !cli_fit_read(&arguments, "fit", &common, &a.options) || !parse_physical(&common, &a) ||
        !cli_scene_fit_check(&a.scene, &common)) {
        return 2;
    }
    gonio_error error = {.line = -1, .byte = -1};
    gonio_fit_report report = {0};
    if (fit(input, &a, &common, &report, &error) != GONIO_OK) {
        return cli_fail(&common, &error);
    }
    if (common.json) {
        json_t *result = to_json(&a, input, &report);
        if (a.physical != NULL) {
            json_object_set_new(result, "physical", physical_json(&a));
        }
        if (a.scene.needs != NULL) {
            json_object_set_new(result, "scene", cli_scene_fit_json(&a.scene));
        }
        return cli_json(result);
    }
    print(&a, &report);
    if (a.scene.needs != NULL) {
        cli_scene_fit_print(&a.scene);
    }
    if (a.physical != NULL) {
        print_physical(&a, &report);
    }
    return 0;
}

const cli_verb cmd_fit = {"fit", "INPUT -o MODEL [options]",
                          "fit a model to samples; prints training and held-out errors", run};
