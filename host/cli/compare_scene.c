// SPDX-License-Identifier: BSD-3-Clause
#include "host/cli/compare_scene.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "gonio/scene_needs.h"

typedef struct outcome {
    gonio_picture_error apart;
    int frames, material;
    gonio_scene *scene;
} outcome;

static gonio_status find_material(const gonio_scene *scene, const char *name, int *material, gonio_error *error) {
    gonio_scene_facts facts;
    gonio_scene_describe(scene, &facts);
    *material = 0;
    if (name == NULL && facts.materials > 1) {
        return gonio_fail(error, GONIO_E_USAGE, "the scene has several materials: name the model's by --material");
    }
    return name != NULL ? gonio_scene_material_find(scene, name, material, error) : GONIO_OK;
}

static gonio_status set_model(gonio_scene *scene, int material, const char *name, gonio_error *error) {
    gonio_model *model;
    gonio_status status = gonio_model_resolve(name, &model, error);
    status = status == GONIO_OK ? gonio_scene_exchange_model(scene, material, &model, error) : status;
    gonio_model_free(model); // the one that the scene had
    return status;
}

static bool on_progress(void *context, double fraction, double paths_per_s) {
    (void)context;
    (void)fraction;
    (void)paths_per_s;
    return !cli_interrupted();
}

// The frames of the needs, or the scene's first camera.
static gonio_status compare(const compare_request *r, const gonio_needs *needs, const cli_common *common, outcome *o,
                            gonio_error *error) {
    gonio_needs_frame one = {.camera = ""};
    gonio_needs_scene about = {.frame = &one, .frames = 1};
    gonio_scene_options render;
    gonio_frames *truth = NULL, *pictures = NULL;
    gonio_scene_options_default(o->scene, &render);
    if (needs != NULL) {
        gonio_needs_describe_scene(needs, &about);
        gonio_needs_render_options(needs, o->scene, &render);
    }
    render.seed = common->seed;
    render.threads = common->threads;
    render.progress = on_progress;
    o->frames = about.frames;
    gonio_status status = find_material(o->scene, r->material, &o->material, error);
    status = status == GONIO_OK && r->truth != NULL ? set_model(o->scene, o->material, r->truth, error) : status;
    if (status == GONIO_OK) {
        status = gonio_frames_render(o->scene, &render, about.frame, about.frames, r->turn_deg, &truth, error);
    }
    status = status == GONIO_OK ? set_model(o->scene, o->material, r->model, error) : status;
    if (status == GONIO_OK) {
        status = gonio_frames_render(o->scene, &render, about.frame, about.frames, r->turn_deg, &pictures, error);
    }
    status = status == GONIO_OK ? gonio_frames_compare(pictures, truth, &o->apart, error) : status;
    gonio_frames_free(truth);
    gonio_frames_free(pictures);
    return status;
}

static int report(const compare_request *r, const outcome *o, const cli_common *common) {
    const char *name = gonio_scene_material_name(o->scene, o->material);
    if (common->json) {
        return cli_json(json_pack("{s:s,s:s,s:s?,s:s,s:i,s:f,s:f,s:o,s:f,s:o}", "model", r->model, "scene", r->scene,
                                  "truth", r->truth, "material", name, "frames", o->frames, "turn_deg", r->turn_deg,
                                  "mae", o->apart.mae, "psnr_db", cli_json_real(o->apart.psnr_db), "largest",
                                  o->apart.largest, "snr_db", cli_json_real(o->apart.snr_db)));
    }
    printf("%s as %s of %s, %d frame%s, against %s\n", cli_text(r->model),
           name[0] != 0 ? cli_text(name) : "the material", cli_text(r->scene), o->frames, o->frames == 1 ? "" : "s",
           r->truth != NULL ? cli_text(r->truth) : "the scene's own model");
    printf("image error: MAE %.4g of 255 (8-bit RGB distance), PSNR %.2f dB, largest %.0f, light %.2f dB\n",
           o->apart.mae, o->apart.psnr_db, o->apart.largest, o->apart.snr_db);
    return 0;
}

int cli_compare_scene(const compare_request *r, const cli_common *common) {
    gonio_error error = {.line = -1, .byte = -1};
    gonio_needs *needs = NULL;
    outcome o = {.scene = NULL};
    cli_catch_interrupts();
    gonio_status status = gonio_needs_file_is(r->scene) ? gonio_needs_open(r->scene, &needs, &error) : GONIO_OK;
    if (status == GONIO_OK) {
        status = needs != NULL ? gonio_needs_open_scene(needs, &o.scene, &error)
                               : gonio_scene_open(r->scene, &o.scene, &error);
    }
    status = status == GONIO_OK ? compare(r, needs, common, &o, &error) : status;
    const int result = status == GONIO_OK ? report(r, &o, common) : cli_fail(common, &error);
    gonio_needs_free(needs);
    gonio_scene_free(o.scene);
    return result;
}
