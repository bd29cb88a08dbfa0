// SPDX-License-Identifier: BSD-3-Clause
// gonio info: what a session, a model or a file of samples says of itself.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/head.h"
#include "brdf/kind.h"
#include "brdf/kind/analytic.h"
#include "gonio/io.h"
#include "host/cli/input.h"
#include "host/session/info.h"

static int run(int argc, char **argv);
const cli_verb cmd_info = {"info", "SESSION|MODEL|FILE [options]",
                           "what a session (who, what, with which devices, files and options, when), a model or a file "
                           "of samples is and tells of its measurement",
                           run};

typedef struct info_request {
    const char *path;
    const cli_common *common;
    cli_input input;
} info_request;

// ---- a session ----

static gonio_status session_info(const info_request *r, json_t **out, gonio_error *error) {
    gonio_session *session;
    gonio_status status = cli_input_refuse(&r->input, "a session", error);
    status = status == GONIO_OK ? gonio_session_open(r->path, false, &session, error) : status;
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

// ---- what is known of a measurement ----

static json_t *head_json(const char *lines) {
    char key[GONIO_HEAD_KEY_MAX], value[4096];
    json_t *object = json_object();
    for (const char *at = lines; gonio_head_next(&at, key, value, sizeof value);) {
        json_t *before = json_object_get(object, key), *text = cli_json_text(value);
        if (strncmp(key, "sampled.", strlen("sampled.")) == 0) {
            json_decref(text);
        } else if (before == NULL) {
            json_object_set_new(object, key, text);
        } else if (json_is_array(before)) {
            json_array_append_new(before, text);
        } else {
            json_object_set_new(object, key, json_pack("[O,o]", before, text));
        }
    }
    return object;
}

static void print_head(const json_t *head) {
    const char *key;
    json_t *value, *one;
    size_t i;
    json_object_foreach((json_t *)head, key, value) {
        if (json_is_array(value)) {
            json_array_foreach(value, i, one) { print_scalar(cli_text(key), one); }
        } else {
            print_scalar(cli_text(key), value);
        }
    }
}

static void print_sampled(const json_t *sampled) {
    if (json_is_object(sampled)) {
        print_scalar("sampled", json_object_get(sampled, "text"));
        if (json_is_true(json_object_get(sampled, "narrow"))) {
            printf("%-23s errors, the held-out ones too, are of what was sampled and say nothing of the rest\n", "");
        }
    }
}

// Everything but the parts that have their own form.
static void print_members(const json_t *info) {
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)info, key, value) {
        if (strcmp(key, "sampled") == 0) {
            print_sampled(value);
        } else if (strcmp(key, "head") == 0) {
            print_head(value);
        } else if (json_is_array(value) && json_is_object(json_array_get(value, 0))) {
            print_part(key, value);
        } else if (!json_is_null(value)) {
            print_scalar(key, value);
        }
    }
}

// ---- a model ----

static const gonio_kind *kind_of(const gonio_model *model) {
    const gonio_kind *const *k = gonio_kinds();
    while (*k != NULL && (*k)->ops != model->ops) {
        k++;
    }
    return *k;
}

// A row a term and channel: its parameters, and their sigmas where the model has them.
static json_t *terms_of(const gonio_model *model) {
    const gonio_analytic_term *terms;
    const int n = gonio_analytic_terms(model, &terms);
    const double *sigmas = gonio_analytic_sigmas(model);
    json_t *rows = json_array();
    for (int t = 0; t < n; t++) {
        const gonio_formula *formula = terms[t].formula;
        for (int c = 0; c < model->channels; c++) {
            json_t *row = json_pack("{s:s,s:s}", "formula", formula->name, "channel", model->channel_names[c]);
            for (int k = 0; k < formula->n; k++) {
                char name[48];
                json_object_set_new(row, formula->parameters[k].name,
                                    cli_json_real(terms[t].parameters[c * formula->n + k]));
                snprintf(name, sizeof name, "sigma_%s", formula->parameters[k].name);
                const double sigma = sigmas != NULL ? sigmas[c * formula->n + k] : 0;
                if (sigma > 0) { // null: the data did not decide
                    json_object_set_new(row, name, cli_json_real(sigma));
                }
            }
            json_array_append_new(rows, row);
        }
        sigmas = sigmas != NULL ? sigmas + (ptrdiff_t)model->channels * formula->n : NULL;
    }
    return rows;
}

static bool is_model(const char *path) { return strncmp(path, "spec:", 5) == 0 || gonio_model_file_is(path); }

static json_t *names_json(const char (*names)[32], int n) {
    json_t *list = json_array();
    for (int c = 0; c < n; c++) {
        json_array_append_new(list, json_string(names[c]));
    }
    return list;
}

static gonio_status model_info(const info_request *r, json_t **out, gonio_error *error) {
    gonio_model *model;
    char hash[GONIO_SHA256_HEX] = "";
    gonio_coverage coverage;
    gonio_status status = cli_input_refuse(&r->input, "a model", error);
    status = status == GONIO_OK ? gonio_model_resolve(r->path, &model, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    status = gonio_model_file_is(r->path) ? gonio_sha256_file(r->path, hash, error) : GONIO_OK;
    const gonio_kind *kind = kind_of(model);
    *out = json_pack("{s:s,s:o,s:s?,s:s?,s:b,s:i,s:o,s:I,s:I,s:b,s:o}", "kind", "model", "path", cli_json_text(r->path),
                     "form", kind != NULL ? kind->name : NULL, "summary", kind != NULL ? kind->summary : NULL,
                     "isotropic", (int)model->isotropic, "channels", model->channels, "names",
                     names_json(model->channel_names, model->channels), "control_points",
                     (json_int_t)model->control_points, "bytes", (json_int_t)model->bytes, "sigma",
                     model->ops->sigma != NULL, "sha256", cli_json_text(hash));
    for (int h = 0; h < GONIO_HALVES && *out != NULL && model->ops->both_sides; h++) {
        const gonio_model *part = gonio_model_half(model, (gonio_half)h);
        if (part != NULL) {
            json_object_set_new(*out, gonio_half_name((gonio_half)h), json_string(part->ops->kind));
        }
    }
    json_object_set_new(*out, "head", head_json(model->about));
    json_object_set_new(*out, "sampled",
                        gonio_coverage_take(model->about, &coverage) ? cli_json_coverage(&coverage) : json_null());
    json_t *terms = terms_of(model);
    if (*out != NULL && json_array_size(terms) > 0) {
        json_object_set(*out, "terms", terms);
    }
    json_decref(terms);
    gonio_model_free(model);
    return status;
}

// ---- a file of samples, or a table that is read as such ----

static bool is_any(const char *path) {
    (void)path;
    return true;
}

static gonio_status file_info(const info_request *r, json_t **out, gonio_error *error) {
    gonio_samples *s;
    gonio_read_report report;
    gonio_coverage coverage;
    char hash[GONIO_SHA256_HEX] = "";
    gonio_status status = cli_input_read_reported(r->path, &r->input, r->common, &s, &report, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = gonio_coverage_of(s, &coverage, error);
    if (status == GONIO_OK && strcmp(r->path, "-") != 0) {
        gonio_sha256_file(r->path, hash, NULL); // of a pipe there is none
    }
    if (status == GONIO_OK) {
        gonio_mueller_report mueller;
        gonio_check_mueller(s, &mueller);
        *out = json_pack("{s:s,s:o,s:s,s:I,s:b,s:b,s:i,s:o,s:o,s:o,s:o,s:o}", "kind", "file", "path",
                         cli_json_text(r->path), "format", report.format, "samples", (json_int_t)s->n, "isotropic",
                         (int)s->isotropic, "sigma", s->sigma_random != NULL, "channels", s->channels, "names",
                         names_json((const char(*)[32])s->channel_names, s->channels), "sha256",
                         hash[0] != 0 ? json_string(hash) : json_null(), "head", head_json(s->head), "sampled",
                         cli_json_coverage(&coverage), "mueller", cli_json_mueller(&mueller));
    }
    gonio_samples_free(s);
    return status;
}

// ---- what there is to describe: the first that recognises it ----

static const struct {
    bool (*recognise)(const char *path);
    gonio_status (*describe)(const info_request *request, json_t **out, gonio_error *error);
    void (*print)(const json_t *info);
} subjects[] = {
    {gonio_session_is, session_info, print_session},
    {is_model, model_info, print_members},
    {is_any, file_info, print_members},
};

static int run(int argc, char **argv) {
    info_request r = {0};
    const cli_option options[] = {CLI_INPUT_OPTIONS(r.input), {0}};
    int count;
    cli_common common;
    if (!cli_parse(&cmd_info, options, argc, argv, &r.path, 1, 1, &count, &common)) {
        return 2;
    }
    r.common = &common;
    gonio_error error = {.line = -1, .byte = -1};
    size_t k = 0;
    while (!subjects[k].recognise(r.path)) {
        k++;
    }
    json_t *info = NULL;
    if (subjects[k].describe(&r, &info, &error) != GONIO_OK) {
        json_decref(info);
        return cli_fail(&common, &error);
    }
    if (common.json) {
        return cli_json(info);
    }
    subjects[k].print(info);
    json_decref(info);
    return 0;
}
