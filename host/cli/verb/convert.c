// gonio convert: any readable BRDF -> a samples CSV or a MERL table; an analytic BRDF -> a model file.
#include <stdio.h>
#include <string.h>

#include "gonio/plan.h"
#include "host/cli/input.h"

#define PLAN_DEFAULT "nusselt:20000"

typedef struct convert_arguments {
    const char *to, *plan;
    cli_input input;
} convert_arguments;

static bool ends_with(const char *text, const char *end) {
    const size_t n = strlen(text), m = strlen(end);
    return n >= m && strcmp(text + n - m, end) == 0;
}

static bool is_model(const char *name) { return strncmp(name, "spec:", 5) == 0 || gonio_model_file_is(name); }

// A model, or a table as one.
static gonio_status open_model(const char *name, gonio_model **model, gonio_error *error) {
    return is_model(name) ? gonio_model_resolve(name, model, error) : gonio_read_table(name, model, error);
}

static gonio_status to_merl(const char *in, const char *out, gonio_error *error) {
    gonio_model *model;
    gonio_status status = open_model(in, &model, error);
    if (status == GONIO_OK) {
        status = gonio_write_merl(model, out, error);
        gonio_model_free(model);
    }
    return status;
}

static gonio_status to_model(const char *in, const char *out, gonio_error *error) {
    gonio_model *model;
    gonio_status status = open_model(in, &model, error);
    if (status == GONIO_OK) {
        status = gonio_model_save(model, out, error);
        gonio_model_free(model);
    }
    return status;
}

static gonio_status sampled(const char *in, const char *plan_text, uint64_t seed, gonio_samples **samples,
                            gonio_error *error) {
    *samples = NULL;
    gonio_model *model;
    gonio_status status = open_model(in, &model, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_plan *plan;
    status = gonio_plan_make(plan_text, seed, &plan, error);
    if (status == GONIO_OK) {
        status = gonio_samples_of_model(model, plan->poses, plan->n, samples, error);
        gonio_plan_free(plan);
    }
    gonio_model_free(model);
    return status;
}

static gonio_status to_samples(const char *in, const char *out, const convert_arguments *a, const cli_common *common,
                               json_t *result, gonio_error *error) {
    gonio_samples *samples;
    gonio_status status;
    if (is_model(in) || a->plan != NULL) {
        status = sampled(in, a->plan != NULL ? a->plan : PLAN_DEFAULT, common->seed, &samples, error);
    } else {
        status = cli_input_read(in, &a->input, common, &samples, error);
    }
    if (status == GONIO_OK) {
        status = gonio_write_samples(samples, out, error);
        json_object_set_new(result, "samples", json_integer((json_int_t)samples->n));
        json_object_set_new(result, "channels", json_integer(samples->channels));
    }
    gonio_samples_free(samples);
    return status;
}

static int run(int argc, char **argv) {
    convert_arguments a = {0};
    const cli_option options[] = {
        {"to", 0, CLI_TEXT, &a.to, NULL, "FORMAT",
         "samples, merl or model (by OUT's ending: .binary, .gonio; else samples)"},
        {"plan", 0, CLI_TEXT, &a.plan, NULL, "PLAN", "where to sample a model or table (" PLAN_DEFAULT ")"},
        CLI_INPUT_OPTIONS(a.input),
        {0}};
    extern const cli_verb cmd_convert;
    const char *names[2];
    int count;
    cli_common common;
    if (!cli_parse(&cmd_convert, options, argc, argv, names, 2, 2, &count, &common)) {
        return 2;
    }
    const char *to = a.to != NULL                     ? a.to
                     : ends_with(names[1], ".binary") ? "merl"
                     : ends_with(names[1], ".gonio")  ? "model"
                                                      : "samples";
    const bool merl = strcmp(to, "merl") == 0, is_to_model = strcmp(to, "model") == 0;
    if (!merl && !is_to_model && strcmp(to, "samples") != 0) {
        return cli_usage(&common, "convert: --to: expected samples, merl or model, found '%s'", to);
    }
    cli_use_threads(&common);
    gonio_error error = {.line = -1, .byte = -1};
    json_t *result = json_pack("{s:s,s:s,s:s}", "input", names[0], "output", names[1], "format", to);
    const gonio_status status = merl          ? to_merl(names[0], names[1], &error)
                                : is_to_model ? to_model(names[0], names[1], &error)
                                              : to_samples(names[0], names[1], &a, &common, result, &error);
    if (status != GONIO_OK) {
        json_decref(result);
        return cli_fail(&common, &error);
    }
    if (common.json) {
        return cli_json(result);
    }
    json_decref(result);
    fprintf(stderr, "%s: %s\n", names[1], to);
    return 0;
}

const cli_verb cmd_convert = {"convert", "IN OUT [options]",
                              "any readable BRDF to a samples CSV, a MERL table, or a spec to a model file", run};
