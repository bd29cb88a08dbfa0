// SPDX-License-Identifier: BSD-3-Clause
// gonio render: a picture of one or more models, or of a scene.
#include <stdio.h>
#include <string.h>

#include "gonio/render.h"
#include "host/cli/scene_render.h"

typedef struct request {
    const char *models[GONIO_RENDER_MODELS_MAX];
    int count;
    const char *image, *size, *up;
    gonio_render_options options;
    scene_request scene;
} request;

static bool complete(request *r, const cli_common *common) {
    r->options.threads = common->threads;
    if (r->image == NULL) {
        cli_usage(common, "render: -o IMAGE.png is missing");
        return false;
    }
    if (r->size != NULL && !cli_parse_size(r->size, &r->options.width, &r->options.height)) {
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
const cli_verb cmd_render = {"render", "MODEL [MODEL ...] | SCENE.ini -o IMAGE [options]",
                             "picture of a sphere or a mesh, several models side by side; or of a scene", run};

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

// Options that only one kind of picture has, by what was given of them; NULL: none is wrong.
static const char *misplaced(const bool *given_of_models, const bool *given_of_scenes, bool is_scene) {
    static const char *const of_models[] = {"mesh", "up", "light-theta", "light-phi"};
    static const char *const of_scenes[] = {"samples", "camera", "interreflection", "compare", "difference",
                                            "cpm",     "show"};
    for (int k = 0; k < 4 && is_scene; k++) {
        if (given_of_models[k]) {
            return of_models[k];
        }
    }
    for (int k = 0; k < 7 && !is_scene; k++) {
        if (given_of_scenes[k]) {
            return of_scenes[k];
        }
    }
    return NULL;
}

static int render_scene(request *r, const cli_common *common) {
    scene_request *s = &r->scene;
    s->scene = r->models[0];
    s->image = r->image;
    s->exposure_auto = r->options.exposure_auto;
    s->exposure_ev = r->options.exposure_ev;
    if (r->count > 1) {
        return cli_usage(common, "render: one scene at a time, found '%s' as well", r->models[1]);
    }
    if (r->size != NULL && !cli_parse_size(r->size, &s->width, &s->height)) {
        return cli_usage(common, "render: --size: expected N or WIDTHxHEIGHT, found '%s'", r->size);
    }
    if (r->image == NULL && s->reference == NULL) {
        return cli_usage(common, "render: -o IMAGE (.png, .exr, .pfm) or --compare REFERENCE is missing");
    }
    if (s->difference != NULL && s->reference == NULL) {
        return cli_usage(common, "render: --difference needs --compare REFERENCE");
    }
    if (strcmp(s->show, "light") != 0 && strcmp(s->show, "levels") != 0 && strcmp(s->show, "density") != 0) {
        return cli_usage(common, "render: --show: expected light, levels or density, found '%s'", s->show);
    }
    return cli_scene_render(s, common);
}

static int run(int argc, char **argv) {
    request r = {.up = "y", .scene.show = "light"};
    bool ev_given = false, models[4] = {false}, scenes[7] = {false};
    gonio_render_options_default(&r.options);
    const cli_option options[] = {
        {"output", 'o', CLI_OUTPUT, &r.image, NULL, "IMAGE",
         "where the picture goes: .png; of a scene also .exr, .pfm"},
        {"ev", 0, CLI_DOUBLE, &r.options.exposure_ev, &ev_given, "EV", "exposure; 0: a lit white diffuser is 1 (auto)"},
        {"size", 0, CLI_TEXT, &r.size, NULL, "N|WxH", "pixels of one model's picture (384), of a scene's (its own)"},
        {"mesh", 0, CLI_TEXT, &r.options.mesh, &models[0], "FILE", "a PLY, OBJ or glTF mesh instead of the sphere"},
        {"up", 0, CLI_TEXT, &r.up, &models[1], "y|z", "the mesh's upward axis (y)"},
        {"light-theta", 0, CLI_DOUBLE, &r.options.light_theta_deg, &models[2], "DEG", "light from the view axis (40)"},
        {"light-phi", 0, CLI_DOUBLE, &r.options.light_phi_deg, &models[3], "DEG",
         "... and from the right, upward (120)"},
        {"samples", 0, CLI_INT, &r.scene.samples, &scenes[0], "N", "paths a pixel of a scene (its own; 16)"},
        {"camera", 0, CLI_TEXT, &r.scene.camera, &scenes[1], "NAME", "which of a scene's cameras (the first)"},
        {"interreflection", 0, CLI_FLAG, &r.scene.interreflection, &scenes[2], NULL,
         "light that meets a scene more than once"},
        {"compare", 0, CLI_TEXT, &r.scene.reference, &scenes[3], "REF", "picture that a scene's is held against"},
        {"difference", 0, CLI_OUTPUT, &r.scene.difference, &scenes[4], "IMAGE", "... and where their difference goes"},
        {"cpm", 0, CLI_TEXT, &r.scene.map, &scenes[5], "DIR",
         "by a characteristic point map of the scene (4 rays a pixel)"},
        {"show", 0, CLI_TEXT, &r.scene.show, &scenes[6], "light|levels|density",
         "of the map: light, levels, density of points"},
        {0}};
    cli_common common;
    if (!cli_parse(&cmd_render, options, argc, argv, r.models, 1, GONIO_RENDER_MODELS_MAX, &r.count, &common)) {
        return 2;
    }
    r.options.exposure_auto = !ev_given;
    const bool scene = cli_is_scene(r.models[0]);
    const char *wrong = misplaced(models, scenes, scene);
    if (wrong != NULL) {
        return cli_usage(&common, "render: --%s is an option for %s", wrong,
                         scene ? "models; a scene's file says it" : "scenes (SCENE.ini)");
    }
    if (r.scene.samples < 0) {
        return cli_usage(&common, "render: --samples %d: expected 1 or more", r.scene.samples);
    }
    if (scene) {
        return render_scene(&r, &common);
    }
    return complete(&r, &common) ? render(&r, &common) : 2;
}
