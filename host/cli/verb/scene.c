// SPDX-License-Identifier: BSD-3-Clause
// gonio scene: what a scene asks of its materials.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gonio/scene_needs.h"
#include "host/cli/needs_picture.h"
#include "host/cli/scene_render.h"

enum { FRAMES_MAX = 4096 };

typedef struct request {
    const char *action, *scene, *output, *picture, *size;
    cli_list cameras, lights;
    int orbit, level, width, height, samples;
    bool interreflection, ev_given;
    double ev;
    size_t cells;
    gonio_needs_frame *frames;
    int n;
} request;

static int run(int argc, char **argv);
const cli_verb cmd_scene = {"scene", "needs SCENE.ini -o NEEDS [options]",
                            "which pairs of directions a scene's pictures ask its materials for", run};

// ---- frames ----

// The names that were given; "all" stands for those of the scene; none for the one that `none` says.
static int names_of(const cli_list *list, const gonio_scene *scene, const char *(*name)(const gonio_scene *, int),
                    const char *none, const char *names[256]) {
    int n = 0;
    if (list->n == 1 && strcmp(list->items[0], "all") == 0) {
        while (n < 256 && (names[n] = name(scene, n)) != NULL) {
            n++;
        }
        return n;
    }
    for (; n < list->n; n++) {
        names[n] = list->items[n];
    }
    names[n] = none;
    return n > 0 ? n : 1;
}

static gonio_status make_frames(request *r, const gonio_scene *scene, gonio_error *error) {
    const char *cameras[256], *lights[256];
    const int n_cameras = names_of(&r->cameras, scene, gonio_scene_camera_name, "", cameras);
    const int n_lights = names_of(&r->lights, scene, gonio_scene_light_name, "", lights);
    if ((long)n_cameras * n_lights * r->orbit > FRAMES_MAX) {
        return gonio_fail(error, GONIO_E_USAGE, "%d cameras, %d lights and an orbit of %d; at most %d frames in all",
                          n_cameras, n_lights, r->orbit, FRAMES_MAX);
    }
    r->frames = calloc((size_t)n_cameras * (size_t)n_lights * (size_t)r->orbit, sizeof *r->frames);
    if (r->frames == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the frames");
    }
    for (int c = 0; c < n_cameras; c++) {
        for (int l = 0; l < n_lights; l++) {
            for (int k = 0; k < r->orbit; k++) {
                gonio_needs_frame *f = &r->frames[r->n++];
                snprintf(f->camera, sizeof f->camera, "%s", cameras[c]);
                snprintf(f->light, sizeof f->light, "%s", lights[l]);
                f->turn_deg = 360.0 * k / r->orbit;
                f->exposure = r->ev_given ? exp2(r->ev) : 0;
            }
        }
    }
    return GONIO_OK;
}

// ---- results ----

static gonio_status count(const gonio_needs *needs, int material, int level, gonio_needs_count *counts,
                          gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int s = 0; s < GONIO_COORDINATES && status == GONIO_OK; s++) {
        status = gonio_needs_count_cells(needs, material, (gonio_coordinates)s, level, &counts[s], error);
    }
    return status;
}

static int level_of(const request *r, const gonio_needs_facts *m) {
    return m->isotropic || r->level < 4 ? r->level : 4;
}

static json_t *material_json(const request *r, const gonio_needs_facts *m, const gonio_needs_count *counts) {
    json_t *systems = json_array();
    for (int s = 0; s < GONIO_COORDINATES; s++) {
        json_array_append_new(systems, json_pack("{s:s,s:i,s:I,s:I,s:I}", "coordinates",
                                                 gonio_coordinates_name((gonio_coordinates)s), "level", level_of(r, m),
                                                 "cells", (json_int_t)counts[s].cells, "unreachable",
                                                 (json_int_t)(counts[s].cells - counts[s].reachable), "asked",
                                                 (json_int_t)counts[s].asked));
    }
    return json_pack("{s:s,s:b,s:i,s:I,s:f,s:f,s:f,s:o}", "material", m->name, "isotropic", m->isotropic, "resolution",
                     m->resolution, "cells", (json_int_t)m->cells, "codes", m->codes, "squares", m->squares, "behind",
                     m->behind, "coordinates", systems);
}

static void print_material(const request *r, const gonio_needs_facts *m, const gonio_needs_count *counts) {
    printf("%s: %zu cells of 1/%d; 1 %% off in f_r shows as %.3g codes of 255 (rms %.3g)", cli_text(m->name), m->cells,
           m->resolution, m->codes / 100, sqrt(m->squares) / 100);
    printf(m->behind > 0 ? "; behind the surface %.3g\n" : "\n", m->behind / 100);
    for (int s = 0; s < GONIO_COORDINATES && m->cells > 0; s++) {
        const gonio_needs_count *c = &counts[s];
        printf("  %-20s level %d: %zu of %zu cells that directions reach (%.3g %%); %zu cells no scene reaches\n",
               gonio_coordinates_name((gonio_coordinates)s), level_of(r, m), c->asked, c->reachable,
               100 * (double)c->asked / (double)c->reachable, c->cells - c->reachable);
    }
}

static gonio_status tell(const request *r, const gonio_needs *needs, const cli_common *common, int *result,
                         gonio_error *error) {
    json_t *materials = json_array();
    gonio_status status = GONIO_OK;
    for (int m = 0; m < gonio_needs_materials(needs) && status == GONIO_OK; m++) {
        gonio_needs_facts facts;
        gonio_needs_count counts[GONIO_COORDINATES] = {{0}};
        gonio_needs_describe(needs, m, &facts);
        status = facts.cells > 0 ? count(needs, m, level_of(r, &facts), counts, error) : GONIO_OK;
        if (status == GONIO_OK && common->json) {
            json_array_append_new(materials, material_json(r, &facts, counts));
        } else if (status == GONIO_OK) {
            print_material(r, &facts, counts);
        }
    }
    if (status != GONIO_OK || !common->json) {
        json_decref(materials);
        return status;
    }
    gonio_needs_scene scene;
    gonio_needs_describe_scene(needs, &scene);
    *result = cli_json(json_pack("{s:s,s:s,s:i,s:i,s:i,s:i,s:o,s:s?}", "scene", r->scene, "output", r->output, "width",
                                 scene.width, "height", scene.height, "samples", scene.samples, "frames", scene.frames,
                                 "materials", materials, "picture", r->picture));
    return GONIO_OK;
}

// ---- the verb ----

static bool on_progress(void *context, double fraction, double paths_per_s) {
    char detail[48];
    snprintf(detail, sizeof detail, "  %.3g Mpaths/s", paths_per_s / 1e6);
    cli_progress_update(context, fraction, detail, NAN);
    return !cli_interrupted();
}

static gonio_status make_needs(request *r, const cli_common *common, gonio_needs **needs, gonio_error *error) {
    gonio_scene *scene;
    cli_progress progress;
    gonio_status status = gonio_scene_open(r->scene, &scene, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_scene_needs_options o = {.cells = r->cells};
    gonio_scene_options_default(scene, &o.render);
    o.render.width = r->width > 0 ? r->width : o.render.width;
    o.render.height = r->height > 0 ? r->height : o.render.height;
    o.render.samples = r->samples != 0 ? r->samples : o.render.samples;
    o.render.interreflection = o.render.interreflection || r->interreflection;
    o.render.seed = common->seed;
    o.render.threads = common->threads;
    o.render.progress = on_progress;
    o.render.progress_context = &progress;
    status = make_frames(r, scene, error);
    cli_progress_start(&progress, "needs", 1);
    status = status == GONIO_OK ? gonio_scene_needs(scene, r->scene, &o, r->frames, r->n, needs, error) : status;
    cli_progress_end(&progress);
    gonio_scene_free(scene);
    return status;
}

static int collect(request *r, const cli_common *common) {
    gonio_error error = {.line = -1, .byte = -1};
    gonio_needs *needs = NULL;
    int result = 0;
    cli_catch_interrupts();
    gonio_status status = make_needs(r, common, &needs, &error);
    status = status == GONIO_OK ? gonio_needs_save(needs, r->output, &error) : status;
    status = status == GONIO_OK && r->picture != NULL ? cli_needs_picture(needs, r->picture, &error) : status;
    status = status == GONIO_OK ? tell(r, needs, common, &result, &error) : status;
    gonio_needs_free(needs);
    free(r->frames);
    return status == GONIO_OK ? result : cli_fail(common, &error);
}

static int complete(request *r, const cli_common *common) {
    if (strcmp(r->action, "needs") != 0) {
        return cli_usage(common, "scene: expected needs, found '%s'", r->action);
    }
    if (r->output == NULL) {
        return cli_usage(common, "scene needs: -o NEEDS is missing");
    }
    if (r->size != NULL && !cli_parse_size(r->size, &r->width, &r->height)) {
        return cli_usage(common, "scene: --size: expected N or WIDTHxHEIGHT, found '%s'", r->size);
    }
    if (r->orbit < 1 || r->samples < 0 || r->level < 0 || r->level > GONIO_NEEDS_LEVEL_MAX) {
        return cli_usage(common, "scene: --orbit %d, --samples %d, --level %d: expected 1 or more, 1 or more, 0 to %d",
                         r->orbit, r->samples, r->level, GONIO_NEEDS_LEVEL_MAX);
    }
    return collect(r, common);
}

static int run(int argc, char **argv) {
    request r = {.orbit = 1, .level = 6};
    const char *words[2];
    cli_common common;
    int count;
    const cli_option options[] = {
        {"output", 'o', CLI_OUTPUT, &r.output, NULL, "NEEDS", "where they go"},
        {"camera", 0, CLI_LIST, &r.cameras, NULL, "NAME", "one of the scene's (the first); all; may be repeated"},
        {"orbit", 0, CLI_INT, &r.orbit, NULL, "N", "each camera from N places round its target (1)"},
        {"light", 0, CLI_LIST, &r.lights, NULL, "NAME",
         "a frame with this light alone (all at once); all: one each; may be repeated"},
        {"size", 0, CLI_TEXT, &r.size, NULL, "N|WxH", "pixels of a frame (the scene's)"},
        {"samples", 0, CLI_INT, &r.samples, NULL, "N", "paths a pixel (the scene's)"},
        {"interreflection", 0, CLI_FLAG, &r.interreflection, NULL, NULL, "light that meets the scene more than once"},
        {"ev", 0, CLI_DOUBLE, &r.ev, &r.ev_given, "EV", "exposure of every frame (auto, each its own)"},
        {"cells", 0, CLI_SIZE, &r.cells, NULL, "N",
         "at most so many of a material; coarser where it asks for more (200k)"},
        {"level", 0, CLI_INT, &r.level, NULL, "N", "of the lattices whose cells are counted (6; anisotropic 4)"},
        {"picture", 0, CLI_OUTPUT, &r.picture, NULL, "FILE.svg|png", "the densities as a picture"},
        {0}};
    if (!cli_parse(&cmd_scene, options, argc, argv, words, 2, 2, &count, &common)) {
        return 2;
    }
    r.action = words[0];
    r.scene = words[1];
    return complete(&r, &common);
}
