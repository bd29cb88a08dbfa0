// SPDX-License-Identifier: BSD-3-Clause
// gonio convert: what can be read, a session, a model or an analytic BRDF -> any format that has a writer, or a model
// file; a whole session -> HDF5 and back.
#include <stdio.h>
#include <string.h>

#include "base/head.h"
#include "base/text.h"
#include "gonio/session.h"
#include "host/cli/apart.h"
#include "host/cli/export.h"
#include "host/cli/hdf5_input.h"
#include "host/cli/model_input.h"

#define PLAN_DEFAULT "nusselt:20000"
#define MODEL_EXTENSION ".gonio"
// Whole sessions: what --to calls them.
#define TO_HDF5 "hdf5"
#define TO_SESSION "session"

typedef struct convert_arguments {
    const char *to, *plan;
    cli_input input;
    cli_export output;
} convert_arguments;

static bool ends_with(const char *text, const char *end) {
    const size_t n = strlen(text), m = strlen(end);
    return n >= m && strcmp(text + n - m, end) == 0;
}

static bool is_model(const char *name) { return strncmp(name, "spec:", 5) == 0 || gonio_model_file_is(name); }

// A model, or a table as one. Neither is read as samples, so the options of that do not apply.
static gonio_status open_model(const char *name, const cli_input *input, gonio_model **model, gonio_error *error) {
    const gonio_status status = cli_input_refuse(input, "a model or a table taken as one", error);
    return status == GONIO_OK ? gonio_model_resolve(name, model, error) : status;
}

static gonio_status to_samples(const char *in, const char *out, const char *format, const convert_arguments *a,
                               const cli_common *common, json_t *result, gonio_error *error) {
    gonio_samples *samples = NULL;
    gonio_status status = cli_export_refuse(&a->output, "samples", error);
    if (status != GONIO_OK) {
        return status;
    }
    if (is_model(in) || a->plan != NULL) {
        gonio_model *model;
        status = open_model(in, &a->input, &model, error);
        if (status == GONIO_OK) {
            status = cli_model_sampled(model, a->plan, PLAN_DEFAULT, common, &samples, error);
            gonio_model_free(model);
        }
    } else {
        status = cli_input_read(in, &a->input, common, &samples, error);
    }
    if (status == GONIO_OK) {
        status = gonio_write_as(samples, out, format, error);
        json_object_set_new(result, "samples", json_integer((json_int_t)samples->n));
        json_object_set_new(result, "channels", json_integer(samples->channels));
    }
    gonio_samples_free(samples);
    return status;
}

// What is known of the measurement has no place in other programs' tables.
static void tell_dropped(const gonio_model *model, const char *out, const char *format) {
    char key[GONIO_HEAD_KEY_MAX], value[16], keys[300] = "";
    for (const char *at = model->about; gonio_head_next(&at, key, value, sizeof value);) {
        if (strncmp(key, "sampled.", strlen("sampled.")) != 0) {
            gonio_text_append(keys, sizeof keys, "%s%s", keys[0] != 0 ? ", " : "", key);
        }
    }
    if (keys[0] != 0) {
        fprintf(stderr, "gonio: %s: %s has no place for what is known of the measurement; dropped: %s\n", cli_text(out),
                format, cli_text(keys));
    }
}

// format NULL: a model file.
static gonio_status to_table(const char *in, const char *out, const char *format, const convert_arguments *a,
                             const cli_common *common, json_t *result, gonio_error *error) {
    if (a->plan != NULL) {
        return gonio_fail(error, GONIO_E_USAGE,
                          "plan: says where to sample a model; %s is written from the model itself", out);
    }
    gonio_model *model;
    gonio_status status = format == NULL ? cli_export_refuse(&a->output, "a model file", error) : GONIO_OK;
    status = status == GONIO_OK ? cli_model_read(in, &a->input, common, result, &model, NULL, error) : status;
    if (status == GONIO_OK) {
        status = format == NULL ? gonio_model_save(model, out, error)
                                : cli_export_model(model, in, out, format, &a->output, common, result, error);
        if (status == GONIO_OK && format != NULL) {
            tell_dropped(model, out, format);
        }
        gonio_model_free(model);
    }
    return status;
}

// ---- a whole session ----

static bool is_hdf5_name(const char *name) {
    return ends_with(name, ".h5") || ends_with(name, ".hdf5") || ends_with(name, ".nxs");
}

static bool on_progress(void *context, double fraction, const char *what, double error_now) {
    cli_progress_update(context, fraction, what, error_now);
    return !cli_interrupted();
}

static gonio_status whole(const char *in, const char *out, const convert_arguments *a, gonio_error *error) {
    if (a->plan != NULL) {
        return gonio_fail(error, GONIO_E_USAGE, "plan: a session is converted as it is");
    }
    cli_progress progress;
    gonio_session *session;
    gonio_status status = cli_input_refuse(&a->input, "a session", error);
    if (status != GONIO_OK) {
        return status;
    }
    cli_catch_interrupts();
    cli_progress_start(&progress, "converting", 1);
    if (gonio_session_is_hdf5(in)) {
        status = cli_hdf5_import(in, out, on_progress, &progress, error);
    } else if ((status = gonio_session_open(in, false, &session, error)) == GONIO_OK) {
        status = gonio_session_export(session, out, on_progress, &progress, error);
        gonio_session_close(session);
    }
    cli_progress_end(&progress);
    return status;
}

// What a whole session becomes: NULL where that is not what is asked for.
static const char *whole_format(const char *const *names, const convert_arguments *a) {
    if (gonio_session_is_hdf5(names[0])) {
        gonio_format_facts facts;
        return a->to != NULL ? (strcmp(a->to, TO_SESSION) == 0 ? TO_SESSION : NULL)
               : ends_with(names[1], MODEL_EXTENSION) || gonio_format_writer(NULL, names[1], &facts, NULL) == GONIO_OK
                   ? NULL
                   : TO_SESSION;
    }
    return a->to != NULL ? (strcmp(a->to, TO_HDF5) == 0 ? TO_HDF5 : NULL) : is_hdf5_name(names[1]) ? TO_HDF5 : NULL;
}

static gonio_status convert(const char *const *names, const convert_arguments *a, const cli_common *common,
                            json_t *result, gonio_error *error) {
    gonio_format_facts facts;
    const char *session_format = whole_format(names, a);
    if (session_format != NULL) {
        json_object_set_new(result, "format", json_string(session_format));
        return whole(names[0], names[1], a, error);
    }
    if (a->to != NULL ? strcmp(a->to, "model") == 0 : ends_with(names[1], MODEL_EXTENSION)) {
        json_object_set_new(result, "format", json_string("model"));
        return to_table(names[0], names[1], NULL, a, common, result, error);
    }
    const gonio_status status = gonio_format_writer(a->to, names[1], &facts, error);
    if (status != GONIO_OK) {
        const size_t used = strlen(error->message);
        snprintf(error->message + used, sizeof error->message - used,
                 ", model (%s), hdf5 (.h5 .hdf5 .nxs, of a session); choose one with --to", MODEL_EXTENSION);
        return status;
    }
    json_object_set_new(result, "format", json_string(facts.name));
    const char *format = a->to != NULL ? a->to : facts.name; // an alias may choose options
    return facts.writes ? to_samples(names[0], names[1], format, a, common, result, error)
                        : to_table(names[0], names[1], format, a, common, result, error);
}

// "samples (.csv), merl (.binary), model (.gonio)"
static void list_writers(char *text, size_t size) {
    gonio_format_facts f;
    size_t used = 0;
    for (int i = 0; gonio_format_get(i, &f) && used < size; i++) {
        if (f.writes || f.writes_table) {
            used += (size_t)snprintf(text + used, size - used, "%s", f.name);
            for (const gonio_format_alias *o = f.aliases; o->name != NULL && used < size; o++) {
                used += (size_t)snprintf(text + used, size - used, "=%s", o->name);
            }
            used += used < size ? (size_t)snprintf(text + used, size - used, " (%s), ", f.extensions) : 0;
        }
    }
    if (used < size) {
        snprintf(text + used, size - used,
                 "model (" MODEL_EXTENSION "), hdf5 (.h5 .hdf5 .nxs) of a whole session, session from that; without it "
                 "OUT's ending chooses");
    }
}

// May OUT have its ending? What --to says that is not written is refused later.
static bool is_ending(const cli_common *common, const char *out, const char *to) {
    gonio_format_facts facts;
    if (to == NULL || strcmp(to, "model") == 0) {
        return to == NULL || cli_ending(common, out, to);
    }
    return gonio_format_writer(to, "", &facts, NULL) != GONIO_OK || cli_ending(common, out, facts.name);
}

static int run(int argc, char **argv) {
    convert_arguments a = {0};
    char writers[700];
    list_writers(writers, sizeof writers);
    const cli_option options[] = {
        {"to", 0, CLI_TEXT, &a.to, NULL, "FORMAT", writers},
        {"plan", 0, CLI_TEXT, &a.plan, NULL, "PLAN", "where to sample a model or table (" PLAN_DEFAULT ")"},
        CLI_EXPORT_OPTIONS(a.output),
        CLI_INPUT_OPTIONS(a.input),
        {0}};
    extern const cli_verb cmd_convert;
    const char *names[2];
    int count;
    cli_common common;
    if (!cli_parse(&cmd_convert, options, argc, argv, names, 2, 2, &count, &common) || !cli_apart(&common, names[1]) ||
        !is_ending(&common, names[1], a.to)) {
        return 2;
    }
    gonio_error error = {.line = -1, .byte = -1};
    json_t *result = json_pack("{s:s,s:s}", "input", names[0], "output", names[1]);
    if (convert(names, &a, &common, result, &error) != GONIO_OK) {
        json_decref(result);
        return cli_fail(&common, &error);
    }
    if (!common.json) {
        fprintf(stderr, "%s: %s\n", names[1], json_string_value(json_object_get(result, "format")));
        json_decref(result);
        return 0;
    }
    return cli_json(result);
}

const cli_verb cmd_convert = {"convert", "IN OUT [options]",
                              "any readable BRDF, session or model to any format that is written, or to a model file "
                              "(samples by way of the default fit); sessions to HDF5 and back",
                              run};
