// SPDX-License-Identifier: BSD-3-Clause
// gonio compare: the error figures of a model on an input's samples, or of a scene's pictures.
#include <stdio.h>
#include <stdlib.h>

#include "gonio/needs.h"
#include "host/cli/compare_scene.h"
#include "host/cli/input.h"
#include "host/cli/scene_render.h"

// Of samples with transmission, each half's; else none has samples.
static gonio_status compare_halves(const gonio_model *model, const gonio_samples *samples, int threads,
                                   gonio_errors halves[GONIO_HALVES], gonio_error *error) {
    bool *mask = malloc(samples->n * sizeof *mask);
    gonio_status status = mask != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for the halves");
    for (int h = 0; h < GONIO_HALVES && status == GONIO_OK && samples->transmission; h++) {
        gonio_samples *half;
        status = gonio_samples_half(samples, (gonio_half)h, mask, &half, error);
        gonio_samples_free(half);
        status = status == GONIO_OK ? gonio_errors_model(model, samples, mask, threads, &halves[h], error) : status;
    }
    free(mask);
    return status;
}

static gonio_status compare(const char *const *names, const cli_input *in, const cli_common *common,
                            gonio_errors *errors, gonio_errors halves[GONIO_HALVES], int *channels,
                            gonio_error *error) {
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
        status = status == GONIO_OK ? compare_halves(model, samples, common->threads, halves, error) : status;
        gonio_samples_free(samples);
    }
    gonio_model_free(model);
    return status;
}

static json_t *halves_json(const gonio_errors halves[GONIO_HALVES]) {
    json_t *object = json_object();
    for (int h = 0; h < GONIO_HALVES; h++) {
        if (halves[h].samples > 0) {
            json_object_set_new(object, gonio_half_name((gonio_half)h), cli_json_errors(&halves[h]));
        }
    }
    return object;
}

static int run(int argc, char **argv) {
    cli_input in = {0};
    compare_request pictures = {.model = NULL};
    bool turned = false;
    const cli_option options[] = {
        CLI_INPUT_OPTIONS(in),
        {"truth", 0, CLI_TEXT, &pictures.truth, NULL, "MODEL",
         "of a scene: what its pictures should be (its own model)"},
        {"material", 0, CLI_TEXT, &pictures.material, NULL, "NAME", "... which of its materials the models are of"},
        {"turn", 0, CLI_DOUBLE, &pictures.turn_deg, &turned, "DEG", "... its cameras go that far round their targets"},
        {0}};
    extern const cli_verb cmd_compare;
    const char *names[2];
    int count, channels = 0;
    cli_common common;
    if (!cli_parse(&cmd_compare, options, argc, argv, names, 2, 2, &count, &common)) {
        return 2;
    }
    pictures.model = names[0];
    pictures.scene = names[1];
    if (cli_is_scene(names[1]) || gonio_needs_file_is(names[1])) {
        return cli_compare_scene(&pictures, &common);
    }
    if (pictures.truth != NULL || pictures.material != NULL || turned) {
        return cli_usage(&common, "compare: --truth, --material and --turn are options of scenes (SCENE.ini, NEEDS)");
    }
    gonio_error error = {.line = -1, .byte = -1};
    gonio_errors errors, halves[GONIO_HALVES] = {{0}};
    if (compare(names, &in, &common, &errors, halves, &channels, &error) != GONIO_OK) {
        return cli_fail(&common, &error);
    }
    if (common.json) {
        return cli_json(json_pack("{s:s,s:s,s:i,s:I,s:o,s:o}", "model", names[0], "input", names[1], "channels",
                                  channels, "samples", (json_int_t)errors.samples, "errors", cli_json_errors(&errors),
                                  "halves", halves_json(halves)));
    }
    printf("%s on %s, %d channels\n", names[0], names[1], channels);
    cli_print_errors("errors", &errors);
    for (int h = 0; h < GONIO_HALVES; h++) {
        if (halves[h].samples > 0) {
            cli_print_errors(gonio_half_name((gonio_half)h), &halves[h]);
        }
    }
    return 0;
}

const cli_verb cmd_compare = {"compare", "MODEL INPUT|SCENE.ini|NEEDS [options]",
                              "error figures of a model on an input's samples, or of a scene's pictures with it", run};
