// gonio fit: samples -> model.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gonio/fit.h"
#include "host/cli/input.h"

// The options as text; fill_options turns them into the library's.
typedef struct fit_arguments {
    const char *output, *level, *coordinates, *domain, *symmetry;
    bool has_hold_out, has_folds;
    cli_input input;
    gonio_fit_options options;
} fit_arguments;

static bool parse_level(const cli_common *common, fit_arguments *a) {
    gonio_fit_options *o = &a->options;
    if (a->level == NULL || strcmp(a->level, "auto") == 0) {
        return true;
    }
    char *end;
    const long level = strtol(a->level, &end, 10);
    if (end == a->level || *end != 0 || level < 0 || level > GONIO_LEVEL_MAX) {
        cli_usage(common, "fit: --level: expected auto or 0 to %d, found '%s'", GONIO_LEVEL_MAX, a->level);
        return false;
    }
    o->level = (int)level;
    o->specular_level = (int)level; // the S of cbmba's (D,S,C)
    return true;
}

static bool parse_symmetry(const cli_common *common, fit_arguments *a) {
    if (a->symmetry == NULL || strcmp(a->symmetry, "auto") == 0) {
        return true;
    }
    char copy[64], *rest;
    snprintf(copy, sizeof copy, "%s", a->symmetry);
    a->options.symmetry = 0;
    for (char *item = strtok_r(copy, ",", &rest); item != NULL; item = strtok_r(NULL, ",", &rest)) {
        if (strcmp(item, "mirror") == 0) {
            a->options.symmetry |= GONIO_SYMMETRY_MIRROR;
        } else if (strcmp(item, "reciprocity") == 0) {
            a->options.symmetry |= GONIO_SYMMETRY_RECIPROCITY;
        } else if (strcmp(item, "none") != 0) {
            cli_usage(common,
                      "fit: --symmetry: expected auto, none, mirror, reciprocity or both with a comma, found '%s'",
                      item);
            return false;
        }
    }
    return true;
}

static bool fill_options(const cli_common *common, fit_arguments *a) {
    gonio_fit_options *o = &a->options;
    o->seed = common->seed;
    o->threads = common->threads;
    if (a->coordinates != NULL && strcmp(a->coordinates, "auto") != 0) {
        o->coordinates_set = true;
        if (!gonio_coordinates_parse(a->coordinates, &o->coordinates)) {
            cli_usage(
                common,
                "fit: --coordinates: expected auto, nusselt, half-vector (-narrow, -wide) or reflected, found '%s'",
                a->coordinates);
            return false;
        }
    }
    if (a->domain != NULL && strcmp(a->domain, "auto") != 0) {
        o->domain_set = true;
        o->domain = strcmp(a->domain, "log") == 0 ? GONIO_LOG : GONIO_LINEAR;
        if (o->domain == GONIO_LINEAR && strcmp(a->domain, "linear") != 0) {
            cli_usage(common, "fit: --domain: expected auto, linear or log, found '%s'", a->domain);
            return false;
        }
    }
    if (a->has_folds && a->has_hold_out) {
        cli_usage(common, "fit: --hold-out and --folds exclude each other");
        return false;
    }
    if (a->has_folds) {
        o->hold_out = 0;
    }
    return parse_level(common, a) && parse_symmetry(common, a);
}

static bool on_progress(void *context, double fraction, const char *what, double error_now) {
    cli_progress_update(context, fraction, what, error_now);
    return !cli_interrupted();
}

static json_t *to_json(const fit_arguments *a, const char *input, const gonio_fit_report *r) {
    return json_pack("{s:s,s:i,s:s,s:s,s:I,s:i,s:I,s:I,s:o,s:o,s:o,s:s,s:s,s:s,s:o}", "method", r->method, "level",
                     r->level, "coordinates", gonio_coordinates_name(r->coordinates), "domain",
                     r->domain == GONIO_LOG ? "log" : "linear", "samples", (json_int_t)r->samples, "channels",
                     r->channels, "control_points", (json_int_t)r->control_points, "bytes", (json_int_t)r->bytes,
                     "fit_seconds", cli_json_real(r->fit_seconds), "train", cli_json_errors(&r->train), "held_out",
                     cli_json_errors(&r->held_out), "options", r->options, "note", r->note, "input", input, "model",
                     a->output != NULL ? json_string(a->output) : json_null());
}

static void print(const fit_arguments *a, const gonio_fit_report *r) {
    printf("%s level %d, %s, %s %s\n", r->method, r->level, gonio_coordinates_name(r->coordinates),
           r->domain == GONIO_LOG ? "log" : "linear", r->options);
    printf("%zu samples, %d channels -> %zu control points a channel, %zu bytes, %.3g s\n", r->samples, r->channels,
           r->control_points, r->bytes, r->fit_seconds);
    cli_print_errors("train", &r->train);
    cli_print_errors("held out", &r->held_out);
    if (r->note[0] != 0) {
        printf("note: %s\n", r->note);
    }
    printf("%s\n", a->output != NULL ? a->output : "no -o: the model was not saved");
}

static gonio_status fit(const char *path, fit_arguments *a, const cli_common *common, gonio_fit_report *report,
                        gonio_error *error) {
    gonio_samples *samples;
    gonio_status status = cli_input_read(path, &a->input, common, &samples, error);
    if (status != GONIO_OK) {
        return status;
    }
    cli_catch_interrupts();
    cli_progress progress;
    cli_progress_start(&progress, "fit", 1);
    a->options.progress = on_progress;
    a->options.progress_context = &progress;
    gonio_model *model;
    status = gonio_fit(samples, &a->options, &model, report, error);
    cli_progress_end(&progress);
    if (status == GONIO_OK && cli_interrupted()) {
        status = gonio_fail(error, GONIO_E_INTERRUPTED, "interrupted; nothing was written");
    }
    if (status == GONIO_OK && a->output != NULL) {
        status = gonio_model_save(model, a->output, error);
    }
    gonio_model_free(model);
    gonio_samples_free(samples);
    return status;
}

static int run(int argc, char **argv) {
    fit_arguments a = {0};
    gonio_fit_options_default(&a.options);
    gonio_fit_options *o = &a.options;
    const cli_option options[] = {
        {"output", 'o', CLI_TEXT, &a.output, NULL, "MODEL", "the model file to write"},
        {"method", 0, CLI_TEXT, &o->method, NULL, "NAME", "mba, cbmba, lsq, auto ...; an unknown name lists them"},
        {"level", 0, CLI_TEXT, &a.level, NULL, "N|auto", "lattice level (auto: by held-out error)"},
        {"tolerance", 0, CLI_DOUBLE, &o->tolerance, NULL, "RMSE", "the smallest level that meets it"},
        {"coordinates", 0, CLI_TEXT, &a.coordinates, NULL, "NAME",
         "nusselt, half-vector (-narrow, -wide), reflected or auto"},
        {"domain", 0, CLI_TEXT, &a.domain, NULL, "NAME", "linear, log or auto"},
        {"symmetry", 0, CLI_TEXT, &a.symmetry, NULL, "LIST", "mirror,reciprocity; none; auto"},
        {"thesis", 0, CLI_FLAG, &o->thesis, NULL, NULL, "exactly Kameya's form: Nusselt, linear, no offset"},
        {"hold-out", 0, CLI_DOUBLE, &o->hold_out, &a.has_hold_out, "FRACTION", "of the geometries (0.2); 0: none"},
        {"folds", 0, CLI_INT, &o->folds, &a.has_folds, "K", "K-fold errors instead of one hold-out"},
        {"diffuse-level", 0, CLI_INT, &o->diffuse_level, NULL, "D", "cbmba: level of the diffuse lattice"},
        {"drop", 0, CLI_DOUBLE, &o->drop_percent, NULL, "C", "cbmba: per cent of the cells to drop"},
        {"storage", 0, CLI_TEXT, &o->storage, NULL, "NAME", "cbmba: bricks of float, half or byte, or the hash (byte)"},
        {"lambda", 0, CLI_DOUBLE, &o->lambda, NULL, "X", "lsq: smoothness; below 0: from the training data"},
        {"iterations", 0, CLI_INT, &o->iterations, NULL, "N", "lsq: at most N iterations"},
        {"max-error", 0, CLI_DOUBLE, &o->max_error, NULL, "X", "auto: the largest held-out error"},
        {"max-bytes", 0, CLI_SIZE, &o->max_bytes, NULL, "N", "auto: the largest model"},
        {"max-memory", 0, CLI_SIZE, &o->max_memory, NULL, "N", "memory that fitting may take (what is free)"},
        {"max-ns", 0, CLI_DOUBLE, &o->max_ns, NULL, "X", "auto: the slowest evaluation"},
        {"max-seconds", 0, CLI_DOUBLE, &o->max_seconds, NULL, "X", "auto: the longest fit"},
        CLI_INPUT_OPTIONS(a.input),
        {0}};
    extern const cli_verb cmd_fit;
    const char *input;
    int count;
    cli_common common;
    if (!cli_parse(&cmd_fit, options, argc, argv, &input, 1, 1, &count, &common) || !fill_options(&common, &a)) {
        return 2;
    }
    gonio_error error = {.line = -1, .byte = -1};
    gonio_fit_report report = {0};
    if (fit(input, &a, &common, &report, &error) != GONIO_OK) {
        return cli_fail(&common, &error);
    }
    if (common.json) {
        return cli_json(to_json(&a, input, &report));
    }
    print(&a, &report);
    return 0;
}

const cli_verb cmd_fit = {"fit", "INPUT -o MODEL [options]",
                          "fit a model to samples; prints training and held-out errors", run};
