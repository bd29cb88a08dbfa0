// SPDX-License-Identifier: BSD-3-Clause
// gonio render: a picture of one or more models.
#include <stdio.h>
#include <string.h>

#include "gonio/render.h"
#include "host/cli/cli.h"

typedef struct request {
    const char *models[GONIO_RENDER_MODELS_MAX];
    int count;
    const char *image, *size, *up;
    gonio_render_options options;
} request;

// "N" or "WIDTHxHEIGHT".
static bool parse_size(const char *text, int *width, int *height) {
    int used = 0;
    if (sscanf(text, "%6dx%6d%n", width, height, &used) == 2 && text[used] == 0) {
        return true;
    }
    used = 0;
    const bool one = sscanf(text, "%6d%n", width, &used) == 1 && text[used] == 0;
    *height = *width;
    return one;
}

static bool complete(request *r, const cli_common *common) {
    r->options.threads = common->threads;
    if (r->image == NULL) {
        cli_usage(common, "render: -o IMAGE.png is missing");
        return false;
    }
    if (r->size != NULL && !parse_size(r->size, &r->options.width, &r->options.height)) {
        cli_usage(common, "render: --size: expected N or WIDTHxHEIGHT, found '%s'", r->size);
        return false;
    }
    if (strcmp(r->up, "y") != 0 && strcmp(r->up, "z") != 0) {
        cli_usage(common, "render: --up: expected y or z, found '%s'", r->up);
        return false;
    }
    r->options.mesh_z_up = r->up[0] == 'z';
    return true;
}

static int report(const request *r, const gonio_render_result *result, const cli_common *common) {
    if (!common->json) {
        printf("%s: %d x %d, exposure %+.2f EV\n", r->image, result->width, result->height, result->exposure_ev);
        return 0;
    }
    json_t *models = json_array();
    for (int k = 0; k < r->count; k++) {
        json_array_append_new(models, json_string(r->models[k]));
    }
    return cli_json(json_pack("{s:s,s:i,s:i,s:o,s:o}", "image", r->image, "width", result->width, "height",
                              result->height, "ev", cli_json_real(result->exposure_ev), "models", models));
}

static int run(int argc, char **argv);
const cli_verb cmd_render = {"render", "MODEL [MODEL ...] -o IMAGE.png [options]",
                             "picture of a sphere or a mesh; several models side by side, at one exposure", run};

static int render(const request *r, const cli_common *common) {
    gonio_model *models[GONIO_RENDER_MODELS_MAX] = {NULL};
    gonio_error error = {.line = -1, .byte = -1};
    gonio_render_result result;
    gonio_status status = GONIO_OK;
    for (int k = 0; k < r->count && status == GONIO_OK; k++) {
        status = gonio_model_resolve(r->models[k], &models[k], &error);
    }
    if (status == GONIO_OK) {
        status = gonio_render((const gonio_model *const *)models, r->count, &r->options, r->image, &result, &error);
    }
    for (int k = 0; k < r->count; k++) {
        gonio_model_free(models[k]);
    }
    return status == GONIO_OK ? report(r, &result, common) : cli_fail(common, &error);
}

static int run(int argc, char **argv) {
    request r = {.up = "y"};
    bool ev_given = false;
    gonio_render_options_default(&r.options);
    const cli_option options[] = {
        {"output", 'o', CLI_OUTPUT, &r.image, NULL, "IMAGE.png", "where the picture goes"},
        {"mesh", 0, CLI_TEXT, &r.options.mesh, NULL, "FILE", "a PLY or OBJ mesh instead of the sphere"},
        {"up", 0, CLI_TEXT, &r.up, NULL, "y|z", "the mesh's upward axis (y)"},
        {"light-theta", 0, CLI_DOUBLE, &r.options.light_theta_deg, NULL, "DEG", "light from the view axis (40)"},
        {"light-phi", 0, CLI_DOUBLE, &r.options.light_phi_deg, NULL, "DEG", "... and from the right, upward (120)"},
        {"ev", 0, CLI_DOUBLE, &r.options.exposure_ev, &ev_given, "EV", "exposure; 0: a lit white diffuser is 1 (auto)"},
        {"size", 0, CLI_TEXT, &r.size, NULL, "N|WxH", "pixels of one model's picture (384)"},
        {0}};
    cli_common common;
    if (!cli_parse(&cmd_render, options, argc, argv, r.models, 1, GONIO_RENDER_MODELS_MAX, &r.count, &common)) {
        return 2;
    }
    r.options.exposure_auto = !ev_given;
    return complete(&r, &common) ? render(&r, &common) : 2;
}
