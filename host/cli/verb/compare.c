// SPDX-License-Identifier: BSD-3-Clause
// gonio compare: the error figures of a model on an input's samples.
#include <stdio.h>

#include "host/cli/input.h"

static gonio_status compare(const char *const *names, const cli_input *in, const cli_common *common,
                            gonio_errors *errors, int *channels, gonio_error *error) {
    gonio_model *model;
    gonio_status status = gonio_model_resolve(names[0], &model, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_samples *samples;
    status = cli_input_read(names[1], in, common, &samples, error);
    if (status == GONIO_OK) {
        *channels = samples->channels;
        status = gonio_errors_model(model, samples, NULL, common->threads, errors, error);
        gonio_samples_free(samples);
    }
    gonio_model_free(model);
    return status;
}

static int run(int argc, char **argv) {
    cli_input in = {0};
    const cli_option options[] = {CLI_INPUT_OPTIONS(in), {0}};
    extern const cli_verb cmd_compare;
    const char *names[2];
    int count, channels = 0;
    cli_common common;
    if (!cli_parse(&cmd_compare, options, argc, argv, names, 2, 2, &count, &common)) {
        return 2;
    }
    gonio_error error = {.line = -1, .byte = -1};
    gonio_errors errors;
    if (compare(names, &in, &common, &errors, &channels, &error) != GONIO_OK) {
        return cli_fail(&common, &error);
    }
    if (common.json) {
        return cli_json(json_pack("{s:s,s:s,s:i,s:I,s:o}", "model", names[0], "input", names[1], "channels", channels,
                                  "samples", (json_int_t)errors.samples, "errors", cli_json_errors(&errors)));
    }
    printf("%s on %s, %d channels\n", names[0], names[1], channels);
    cli_print_errors("errors", &errors);
    return 0;
}

const cli_verb cmd_compare = {"compare", "MODEL INPUT [options]", "error figures of a model on an input's samples",
                              run};
