// SPDX-License-Identifier: BSD-3-Clause
// gonio look: what an input seems to be, before anything is made of it.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/statistics.h"
#include "gonio/session.h"
#include "host/cli/input.h"

static int run(int argc, char **argv);
const cli_verb cmd_look = {"look", "INPUT [options]",
                           "what samples cover: channels, incidences, planes, ranges, holes, the horizon", run};

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
    return json_pack("{s:s,s:b,s:b,s:o,s:o}", "input", path, "isotropic", (int)s->isotropic, "sigma",
                     s->sigma_random != NULL, "channels", channels, "sampled", cli_json_coverage(coverage));
}

static void print(const gonio_samples *s, const channel_range *ranges, const gonio_coverage *coverage) {
    printf("%-10s %s, %s\n", "samples", s->isotropic ? "isotropic" : "anisotropic",
           s->sigma_random != NULL ? "with sigma" : "without sigma");
    for (int c = 0; c < s->channels; c++) {
        printf("%-10s %.4g to %.4g 1/sr, median %.4g\n", s->channel_names[c], ranges[c].low, ranges[c].high,
               ranges[c].median);
    }
    cli_print_coverage(coverage);
}

static gonio_status look(const gonio_samples *s, channel_range *ranges, gonio_coverage *coverage, gonio_error *error) {
    gonio_status status = gonio_coverage_of(s, coverage, error);
    for (int c = 0; c < s->channels && status == GONIO_OK; c++) {
        status = range_of(s, c, &ranges[c], error);
    }
    return status;
}

static int run(int argc, char **argv) {
    cli_input in = {0};
    const cli_option options[] = {CLI_INPUT_OPTIONS(in), {0}};
    const char *path;
    int count;
    cli_common common;
    if (!cli_parse(&cmd_look, options, argc, argv, &path, 1, 1, &count, &common)) {
        return 2;
    }
    gonio_error error = {.line = -1, .byte = -1};
    gonio_samples *samples;
    gonio_status status = cli_input_read(path, &in, &common, &samples, &error);
    if (status != GONIO_OK) {
        return cli_fail(&common, &error);
    }
    static channel_range ranges[GONIO_CHANNELS_MAX];
    gonio_coverage coverage;
    status = look(samples, ranges, &coverage, &error);
    int exit_status = 0;
    if (status != GONIO_OK) {
        exit_status = cli_fail(&common, &error);
    } else if (common.json) {
        exit_status = cli_json(to_json(path, samples, ranges, &coverage));
    } else {
        print(samples, ranges, &coverage);
    }
    gonio_samples_free(samples);
    return exit_status;
}
