// SPDX-License-Identifier: BSD-3-Clause
// gonio info: what a session or a model says of itself.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "brdf/kind.h"
#include "gonio/io.h"
#include "host/cli/cli.h"
#include "host/session/info.h"

static int run(int argc, char **argv);
const cli_verb cmd_info = {"info", "SESSION|MODEL [--json]",
                           "what a session (who, what, with which devices, files and options, when) or a model is",
                           run};

// ---- a session ----

static gonio_status session_info(const char *path, json_t **out, gonio_error *error) {
    gonio_session *session;
    const gonio_status status = gonio_session_open(path, false, &session, error);
    if (status != GONIO_OK) {
        return status;
    }
    const gonio_status read = gonio_session_info(session, out, error);
    gonio_session_close(session);
    return read;
}

// What is wanted at a glance comes first: a label and where in the object it stands.
static const struct {
    const char *label, *path[3];
} glance[] = {
    {"sample", {"settings", "facts", "sample_id"}},
    {"simulated", {"settings", "sim.spec"}},
    {"operator", {"settings", "facts", "operator_name"}},
    {"notes", {"settings", "facts", "notes"}},
    {"plan", {"settings", "plan"}},
    {"begun", {"progress", "begun"}},
    {"last event", {"progress", "last_event"}},
    {"poses", {"progress", "poses"}},
    {"poses done", {"progress", "poses_done"}},
    {"frames", {"progress", "frames"}},
    {"samples", {"progress", "samples"}},
    {"camera", {"settings", "camera", "name"}},
    {"serial", {"settings", "camera", "serial"}},
    {"serials", {"settings", "facts", "serials"}},
    {"rig", {"settings", "rig.driver"}},
    {"stage", {"settings", "devices", "stage"}},
    {"lamp", {"settings", "devices", "lamp"}},
    {"meter", {"settings", "devices", "meter"}},
    {"firmware", {"settings", "devices", "controller", /* of it */}},
    {"regmap", {"settings", "devices", "regmap"}},
};

// The caller frees it. What a terminal would obey rather than show becomes '?'.
static char *text_of(const json_t *value) {
    char *text = json_is_string(value) ? strdup(json_string_value(value))
                                       : json_dumps(value, JSON_ENCODE_ANY | JSON_COMPACT | JSON_REAL_PRECISION(9));
    for (char *c = text; c != NULL && *c != 0; c++) {
        *c = ((unsigned char)*c < ' ' && *c != '\n') || *c == 0x7f ? '?' : *c;
    }
    return text;
}

static void print_scalar(const char *label, const json_t *value) {
    if (json_array_size(value) > 16) { // of a covariance nobody reads the numbers here
        printf("%-23s (%zu numbers; --json has them)\n", label, json_array_size(value));
        return;
    }
    char *text = text_of(value);
    // A text of several lines stands under its label.
    printf("%-23s", label);
    char *rest = text;
    const char *line;
    for (bool first = true; text != NULL && (line = strsep(&rest, "\n")) != NULL; first = false) {
        if (line[0] != 0 || rest != NULL || first) {
            printf("%s%s\n", first ? " " : "                        ", line);
        }
    }
    free(text);
}

// A row of a table on one line.
static void print_row(const json_t *row) {
    const char *key, *separator = "  ";
    json_t *value;
    json_object_foreach((json_t *)row, key, value) {
        if (json_is_null(value)) {
            continue;
        }
        char *text = text_of(value);
        for (char *c = text; c != NULL && *c != 0; c++) {
            *c = *c == '\n' ? ' ' : *c;
        }
        // Events are read as sentences; of other tables the columns' names are needed.
        const bool plain = json_object_get(row, "text") != NULL;
        printf("%s%s%s%s", separator, plain ? "" : key, plain ? "" : "=", text != NULL ? text : "");
        free(text);
        separator = "  ";
    }
    putchar('\n');
}

static void print_part(const char *name, const json_t *part) {
    const char *key;
    size_t i;
    json_t *value;
    if (json_is_array(part)) {
        if (json_array_size(part) > 0) {
            printf("\n%s\n", name);
        }
        json_array_foreach(part, i, value) { print_row(value); }
        return;
    }
    if (json_is_object(part)) {
        printf("\n%s\n", name);
        json_object_foreach((json_t *)part, key, value) { print_scalar(key, value); }
    }
}

static void print_session(const json_t *info) {
    const json_t *progress = json_object_get(info, "progress"), *settings = json_object_get(info, "settings");
    const bool finished = json_integer_value(json_object_get(progress, "finished")) != 0;
    printf("%-23s %s, %s, format version %lld\n", "session", json_string_value(json_object_get(info, "path")),
           finished ? "finished" : "not finished: `gonio resume` goes on",
           (long long)json_integer_value(json_object_get(info, "version")));
    for (size_t k = 0; k < sizeof glance / sizeof *glance; k++) {
        const json_t *value = info;
        for (int d = 0; d < 3 && glance[k].path[d] != NULL; d++) {
            value = json_object_get(value, glance[k].path[d]);
        }
        if (value != NULL && !json_is_null(value) && !(json_is_string(value) && json_string_length(value) == 0)) {
            print_scalar(glance[k].label, value);
        }
    }
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)info, key, value) {
        if (strcmp(key, "settings") != 0 && strcmp(key, "progress") != 0 && strcmp(key, "events") != 0) {
            print_part(key, value);
        }
    }
    json_object_foreach((json_t *)settings, key, value) { // those that are whole structs
        if (json_is_object(value)) {
            print_part(key, value);
        }
    }
    printf("\nsettings\n");
    json_object_foreach((json_t *)settings, key, value) {
        if (!json_is_object(value)) {
            print_scalar(key, value);
        }
    }
    print_part("events", json_object_get(info, "events"));
}

// ---- a model ----

static const gonio_kind *kind_of(const gonio_model *model) {
    const gonio_kind *const *k = gonio_kinds();
    while (*k != NULL && (*k)->ops != model->ops) {
        k++;
    }
    return *k;
}

static gonio_status model_info(const char *path, json_t **out, gonio_error *error) {
    gonio_model *model;
    char hash[GONIO_SHA256_HEX] = "";
    gonio_status status = gonio_model_open(path, &model, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = gonio_sha256_file(path, hash, error);
    json_t *names = json_array();
    for (int c = 0; c < model->channels; c++) {
        json_array_append_new(names, json_string(model->channel_names[c]));
    }
    const gonio_kind *kind = kind_of(model);
    *out = json_pack("{s:s,s:s,s:s?,s:s?,s:b,s:i,s:o,s:I,s:I,s:b,s:s}", "kind", "model", "path", path, "form",
                     kind != NULL ? kind->name : NULL, "summary", kind != NULL ? kind->summary : NULL, "isotropic",
                     (int)model->isotropic, "channels", model->channels, "names", names, "control_points",
                     (json_int_t)model->control_points, "bytes", (json_int_t)model->bytes, "sigma",
                     model->ops->sigma != NULL, "sha256", hash);
    gonio_model_free(model);
    if (status == GONIO_OK && *out == NULL) {
        status = gonio_fail(error, GONIO_E_INPUT, "the model's path is not UTF-8");
    }
    return status;
}

static void print_model(const json_t *info) {
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)info, key, value) { print_scalar(key, value); }
}

// ---- what there is to describe: the first that recognises it ----

static const struct {
    bool (*recognise)(const char *path);
    gonio_status (*describe)(const char *path, json_t **out, gonio_error *error);
    void (*print)(const json_t *info);
} subjects[] = {
    {gonio_session_is, session_info, print_session},
    {gonio_model_file_is, model_info, print_model},
};

static int run(int argc, char **argv) {
    const char *path;
    int count;
    cli_common common;
    if (!cli_parse(&cmd_info, NULL, argc, argv, &path, 1, 1, &count, &common)) {
        return 2;
    }
    gonio_error error = {.line = -1, .byte = -1};
    for (size_t k = 0; k < sizeof subjects / sizeof *subjects; k++) {
        if (!subjects[k].recognise(path)) {
            continue;
        }
        json_t *info;
        if (subjects[k].describe(path, &info, &error) != GONIO_OK) {
            return cli_fail(&common, &error);
        }
        if (common.json) {
            return cli_json(info);
        }
        subjects[k].print(info);
        json_decref(info);
        return 0;
    }
    gonio_fail_line(&error, GONIO_E_INPUT, path, -1, "a session's folder or a model file is expected");
    return cli_fail(&common, &error);
}
