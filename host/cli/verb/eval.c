// SPDX-License-Identifier: BSD-3-Clause
// gonio eval: a model's values at the directions of a CSV.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "gonio/io.h"
#include "gonio/output.h"
#include "host/cli/input.h"

// The rows as they were written, for echoing, and as angles.
typedef struct directions {
    gonio_text text;
    char **lines;
    gonio_pair *pairs;
    size_t n, capacity;
} directions;

static void release(directions *d) {
    gonio_text_free(&d->text);
    free(d->lines);
    free(d->pairs);
}

static gonio_status append(directions *d, char *line, const gonio_pair *pair, gonio_error *error) {
    if (d->n == d->capacity) {
        const size_t larger = d->capacity * 2 + 1024;
        char **lines = realloc(d->lines, larger * sizeof *lines);
        d->lines = lines != NULL ? lines : d->lines;
        gonio_pair *pairs = realloc(d->pairs, larger * sizeof *pairs);
        d->pairs = pairs != NULL ? pairs : d->pairs;
        if (lines == NULL || pairs == NULL) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu directions", larger);
        }
        d->capacity = larger;
    }
    d->lines[d->n] = line;
    d->pairs[d->n++] = *pair;
    return GONIO_OK;
}

// Four fields of a row; the text itself stays whole for the echo.
static gonio_status parse_row(const gonio_text *text, const char *line, char *copy, size_t size, char **fields,
                              gonio_error *error) {
    if (strlen(line) >= size) {
        return gonio_text_fail(text, error, "the line is longer than %zu characters", size - 1);
    }
    strcpy(copy, line);
    const int n = gonio_text_split(copy, ',', fields, 4);
    return n == 4 ? GONIO_OK
                  : gonio_text_fail(text, error, "expected the 4 columns " GONIO_PAIR_HEADER ", found %d", n);
}

// transmission: thetas go to 180 deg, whether the text declares it or not.
static gonio_status read_directions(const char *path, bool transmission, directions *d, gonio_error *error) {
    gonio_status status = gonio_text_open(path, 0, &d->text, error);
    if (status != GONIO_OK) {
        return status;
    }
    d->text.transmission = transmission || gonio_text_declares_transmission(&d->text);
    char copy[1024], *fields[4];
    char *line = gonio_text_row(&d->text);
    if (line == NULL) {
        return gonio_text_fail(&d->text, error, "nothing in it; expected the header " GONIO_PAIR_HEADER);
    }
    status = parse_row(&d->text, line, copy, sizeof copy, fields, error);
    if (status == GONIO_OK && !gonio_text_is_pair_header(fields, 4)) {
        status = gonio_text_fail(&d->text, error, "expected the header " GONIO_PAIR_HEADER ", found '%.80s'", line);
    }
    while (status == GONIO_OK && (line = gonio_text_row(&d->text)) != NULL) {
        gonio_pair pair;
        status = parse_row(&d->text, line, copy, sizeof copy, fields, error);
        status = status == GONIO_OK ? gonio_text_pair(&d->text, fields, &pair, error) : status;
        status = status == GONIO_OK ? append(d, line, &pair, error) : status;
    }
    return status;
}

// What is asked for beside the values. model NULL: no support.
typedef struct columns {
    bool sigma;
    const gonio_model *model;
} columns;

static double support_of(const gonio_model *model, const gonio_pair *p) {
    return gonio_model_support(model, gonio_direction(p->theta_i, p->phi_i), gonio_direction(p->theta_o, p->phi_o));
}

static void put_csv(FILE *stream, const directions *d, const gonio_samples *s, columns more) {
    fputs(GONIO_PAIR_HEADER, stream);
    for (int c = 0; c < s->channels; c++) {
        fprintf(stream, ",%s", s->channel_names[c]);
    }
    for (int c = 0; c < s->channels && more.sigma; c++) {
        fprintf(stream, ",sigma_%s", s->channel_names[c]);
    }
    fputs(more.model != NULL ? ",support\n" : "\n", stream);
    for (size_t i = 0; i < d->n && !ferror(stream); i++) {
        char text[32];
        fputs(d->lines[i], stream);
        for (int c = 0; c < s->channels; c++) {
            gonio_text_shortest(s->values[i * (size_t)s->channels + (size_t)c], text);
            fprintf(stream, ",%s", text);
        }
        for (int c = 0; c < s->channels && more.sigma; c++) {
            gonio_text_shortest(gonio_samples_sigma(s, i, c), text);
            fprintf(stream, ",%s", text);
        }
        if (more.model != NULL) {
            fprintf(stream, ",%.4f", support_of(more.model, &d->pairs[i]));
        }
        fputc('\n', stream);
    }
}

static json_t *to_json(const char *model, const gonio_samples *s, columns more) {
    json_t *channels = json_array(), *rows = json_array();
    for (int c = 0; c < s->channels; c++) {
        json_array_append_new(channels, json_string(s->channel_names[c]));
    }
    for (size_t i = 0; i < s->n; i++) {
        const gonio_pair *p = &s->pairs[i];
        json_t *values = json_array(), *sigmas = json_array();
        for (int c = 0; c < s->channels; c++) {
            json_array_append_new(values, cli_json_real(s->values[i * (size_t)s->channels + (size_t)c]));
            json_array_append_new(sigmas, cli_json_real(gonio_samples_sigma(s, i, c)));
        }
        json_t *row =
            json_pack("{s:f,s:f,s:f,s:f,s:o}", "theta_i", gonio_degrees(p->theta_i), "phi_i", gonio_degrees(p->phi_i),
                      "theta_o", gonio_degrees(p->theta_o), "phi_o", gonio_degrees(p->phi_o), "values", values);
        if (more.sigma) {
            json_object_set(row, "sigma", sigmas);
        }
        if (more.model != NULL) {
            json_object_set_new(row, "support", cli_json_real(support_of(more.model, p)));
        }
        json_decref(sigmas);
        json_array_append_new(rows, row);
    }
    return json_pack("{s:s,s:o,s:o}", "model", model, "channels", channels, "rows", rows);
}

static gonio_status write_csv(const char *path, const directions *d, const gonio_samples *s, columns more,
                              gonio_error *error) {
    if (path == NULL) {
        put_csv(stdout, d, s, more);
        return GONIO_OK; // main() checks the stream when all is written
    }
    gonio_output *output;
    const gonio_status status = gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    put_csv(gonio_output_stream(output), d, s, more);
    return gonio_output_commit(output, error);
}

static int run(int argc, char **argv) {
    const char *output = NULL, *names[2] = {NULL, "-"};
    bool sigma = false, support = false, transmission = false;
    const cli_option options[] = {
        {"output", 'o', CLI_OUTPUT, &output, NULL, "CSV", "where to write (standard output)"},
        {"sigma", 0, CLI_FLAG, &sigma, NULL, NULL, "add sigma_<channel>, the standard uncertainty"},
        {"transmission", 0, CLI_FLAG, &transmission, NULL, NULL,
         "directions go behind the sample, to 180 deg; so they do for a model with such halves"},
        {"support", 0, CLI_FLAG, &support, NULL, NULL,
         "add support: 1 beside a sample of the fit, 0 where physics alone speaks"},
        {0}};
    extern const cli_verb cmd_eval;
    int count;
    cli_common common;
    if (!cli_parse(&cmd_eval, options, argc, argv, names, 1, 2, &count, &common)) {
        return 2;
    }
    if (count < 2) {
        names[1] = "-";
    }
    gonio_error error = {.line = -1, .byte = -1};
    directions d = {0};
    gonio_model *model = NULL;
    gonio_samples *values = NULL;
    gonio_status status = gonio_model_resolve(names[0], &model, &error);
    if (status == GONIO_OK && sigma && model->ops->sigma == NULL) {
        status = gonio_fail(&error, GONIO_E_UNSUPPORTED, "%s carries no uncertainty", names[0]);
    }
    if (status == GONIO_OK && support && model->ops->support == NULL) {
        status = gonio_fail(&error, GONIO_E_UNSUPPORTED, "%s does not tell its support", names[0]);
    }
    transmission = transmission || (status == GONIO_OK && gonio_model_half(model, GONIO_REFLECTION) != model);
    status = status == GONIO_OK ? read_directions(names[1], transmission, &d, &error) : status;
    if (status == GONIO_OK) {
        status = gonio_samples_of_model(model, d.pairs, d.n, common.threads, &values, &error);
    }
    const columns more = {sigma, support ? model : NULL};
    if (status == GONIO_OK && common.json && output == NULL) {
        cli_json(to_json(names[0], values, more));
    } else if (status == GONIO_OK) {
        status = write_csv(output, &d, values, more, &error);
        if (status == GONIO_OK && common.json) {
            cli_json(json_pack("{s:s,s:s,s:I}", "model", names[0], "output", output, "rows", (json_int_t)d.n));
        }
    }
    gonio_samples_free(values);
    gonio_model_free(model);
    release(&d);
    return status == GONIO_OK ? 0 : cli_fail(&common, &error);
}

const cli_verb cmd_eval = {"eval", "MODEL [DIRECTIONS.csv] [options]",
                           "values of a model (or spec:SPEC) at directions, from a CSV or standard input", run};
