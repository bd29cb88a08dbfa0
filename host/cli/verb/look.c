// SPDX-License-Identifier: BSD-3-Clause
// gonio look: what an input seems to be, before anything is made of it.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/statistics.h"
#include "gonio/session.h"
#include "host/cli/input.h"
#include "host/cli/samples_picture.h"
#include "io/map_file.h"
#include "io/table_guess.h"

static int run(int argc, char **argv);
const cli_verb cmd_look = {
    "look", "INPUT [options]",
    "what samples cover: channels, incidences, planes, ranges, holes, the horizon; what an unknown table seems to be",
    run};

typedef struct channel_range {
    double low, median, high;
} channel_range;

static gonio_status range_of(const gonio_samples *s, int channel, channel_range *range, gonio_error *error) {
    double *values = malloc(s->n * sizeof *values);
    if (values == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu values", s->n);
    }
    for (size_t i = 0; i < s->n; i++) {
        values[i] = s->values[i * (size_t)s->channels + (size_t)channel];
    }
    gonio_sort(values, s->n);
    *range = (channel_range){values[0], gonio_median(values, s->n), values[s->n - 1]};
    free(values);
    return GONIO_OK;
}

static json_t *to_json(const char *path, const gonio_samples *s, const channel_range *ranges,
                       const gonio_coverage *coverage) {
    json_t *channels = json_array();
    for (int c = 0; c < s->channels; c++) {
        json_array_append_new(channels, json_pack("{s:s,s:f,s:f,s:f}", "name", s->channel_names[c], "low",
                                                  ranges[c].low, "median", ranges[c].median, "high", ranges[c].high));
    }
    gonio_mueller_report mueller;
    gonio_check_mueller(s, &mueller);
    return json_pack("{s:s,s:b,s:b,s:o,s:o,s:o}", "input", path, "isotropic", (int)s->isotropic, "sigma",
                     s->sigma_random != NULL, "channels", channels, "sampled", cli_json_coverage(coverage), "mueller",
                     cli_json_mueller(&mueller));
}

static void print(const gonio_samples *s, const channel_range *ranges, const gonio_coverage *coverage) {
    printf("%-10s %s, %s\n", "samples", s->isotropic ? "isotropic" : "anisotropic",
           s->sigma_random != NULL ? "with sigma" : "without sigma");
    for (int c = 0; c < s->channels; c++) {
        printf("%-10s %.4g to %.4g 1/sr, median %.4g\n", s->channel_names[c], ranges[c].low, ranges[c].high,
               ranges[c].median);
    }
    cli_print_coverage(coverage);
    gonio_mueller_report mueller;
    gonio_check_mueller(s, &mueller);
    cli_print_mueller(&mueller);
}

static gonio_status look(const gonio_samples *s, channel_range *ranges, gonio_coverage *coverage, gonio_error *error) {
    gonio_status status = gonio_coverage_of(s, coverage, error);
    for (int c = 0; c < s->channels && status == GONIO_OK; c++) {
        status = range_of(s, c, &ranges[c], error);
    }
    return status;
}

// ---- a table that no format knows ----

static json_t *table_json(const gonio_table_guess *g) {
    json_t *columns = json_array();
    for (int k = 0; k < g->layout.columns; k++) {
        const gonio_table_column_facts *c = &g->columns[k];
        json_array_append_new(columns, json_pack("{s:s,s:o,s:I,s:I,s:f,s:f}", "name", c->name, "as",
                                                 cli_json_text(c->key), "numbers", (json_int_t)c->numbers, "distinct",
                                                 (json_int_t)c->distinct, "low", c->low, "high", c->high));
    }
    return json_pack("{s:I,s:I,s:s,s:s,s:o,s:s,s:o,s:b}", "rows", (json_int_t)g->rows, "header_line",
                     (json_int_t)g->layout.header_line, "separator", g->separator, "decimal", g->decimal, "columns",
                     columns, "options", g->command, "open", cli_json_text(g->open), "whole", (int)g->whole);
}

static void print_table(const char *path, const gonio_table_guess *g) {
    printf("%-10s %zu rows of %d columns from line %lld on, ", "table", g->rows, g->layout.columns,
           g->layout.first_row);
    if (g->layout.header_line > 0) {
        printf("header in line %lld, ", g->layout.header_line);
    }
    printf("separator %s, decimal sign %s\n", g->separator, g->decimal);
    for (int k = 0; k < g->layout.columns && k < 40; k++) {
        const gonio_table_column_facts *c = &g->columns[k];
        printf("column %-3d '%s': ", k + 1, cli_text(c->name));
        if (c->numbers > 0) {
            printf("%.6g to %.6g, %zu%s distinct", c->low, c->high, c->distinct,
                   c->distinct == GONIO_TABLE_DISTINCT_MAX ? " or more" : "");
        } else {
            printf("no numbers");
        }
        printf("%s%s\n", c->key[0] != 0 ? " -> " : "", strcmp(c->key, "values") == 0 ? "value" : c->key);
    }
    for (const char *line = g->reasons; *line != 0; line += strcspn(line, "\n"), line += *line == '\n') {
        char one[300];
        snprintf(one, sizeof one, "%.*s", (int)strcspn(line, "\n"), line);
        printf("%-10s %s\n", "guess", cli_text(one));
    }
    if (!g->whole) {
        printf("%-10s %s\n", "open", g->open);
    }
    printf("%-10s gonio fit %s %s -o MODEL.gonio\n", "propose", cli_text(path), cli_text(g->command));
}

// ---- the verb ----

typedef struct look_arguments {
    cli_input in;
    const char *picture;
} look_arguments;

// Read the input; where no format knows it and it is a table, as what the table seems to be.
static gonio_status read_or_guess(const char *path, const look_arguments *a, const cli_common *common,
                                  gonio_table_guess *g, bool *guessed, gonio_samples **samples, gonio_error *error) {
    *guessed = false;
    gonio_status status = cli_input_read(path, &a->in, common, samples, error);
    gonio_error other = {.line = -1, .byte = -1};
    if (status != GONIO_E_INPUT || strcmp(path, "-") == 0 || cli_input_maps(path, &a->in) ||
        gonio_table_guess_make(path, g, &other) != GONIO_OK) {
        return status;
    }
    *guessed = true;
    status = GONIO_OK;
    if (g->whole) {
        gonio_read_report report;
        status = gonio_read(path, &g->options, samples, &report, error);
        cli_input_tell(path, &report);
    }
    return status == GONIO_OK && a->in.save_map ? gonio_map_save(path, &g->options, error) : status;
}

static int show(const char *path, const gonio_samples *samples, const gonio_table_guess *g, bool guessed,
                const cli_common *common) {
    static channel_range ranges[GONIO_CHANNELS_MAX];
    gonio_coverage coverage;
    gonio_error error = {.line = -1, .byte = -1};
    if (samples != NULL && look(samples, ranges, &coverage, &error) != GONIO_OK) {
        return cli_fail(common, &error);
    }
    if (common->json) {
        json_t *result =
            samples != NULL ? to_json(path, samples, ranges, &coverage) : json_pack("{s:s}", "input", path);
        if (guessed) {
            json_object_set_new(result, "table", table_json(g));
        }
        return cli_json(result);
    }
    if (guessed) {
        print_table(path, g);
    }
    if (samples != NULL) {
        print(samples, ranges, &coverage);
    }
    return 0;
}

static int run(int argc, char **argv) {
    look_arguments a = {0};
    const cli_option options[] = {{"picture", 0, CLI_OUTPUT, &a.picture, NULL, "FILE.svg|png",
                                   "directions in the projected disc, values by colour"},
                                  CLI_INPUT_OPTIONS(a.in),
                                  {0}};
    const char *path;
    int count;
    cli_common common;
    if (!cli_parse(&cmd_look, options, argc, argv, &path, 1, 1, &count, &common)) {
        return 2;
    }
    gonio_error error = {.line = -1, .byte = -1};
    gonio_samples *samples = NULL;
    gonio_table_guess guess = {0};
    bool guessed;
    gonio_status status = read_or_guess(path, &a, &common, &guess, &guessed, &samples, &error);
    if (status == GONIO_OK && a.picture != NULL) {
        status = samples != NULL ? cli_samples_picture(samples, a.picture, &error)
                                 : gonio_fail(&error, GONIO_E_USAGE, "picture: %s", guess.open);
    }
    const int exit_status =
        status == GONIO_OK ? show(path, samples, &guess, guessed, &common) : cli_fail(&common, &error);
    gonio_table_guess_free(&guess);
    gonio_samples_free(samples);
    return exit_status;
}
