// SPDX-License-Identifier: BSD-3-Clause
#include "host/cli/scene_render.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "gonio/cpm.h"

#define MAP_SAMPLES 4 // rays a pixel by a map

typedef struct outcome {
    gonio_scene_facts facts;
    gonio_scene_options options;
    gonio_scene_report report;
    gonio_picture_error apart;
    double scale;
} outcome;

bool cli_parse_size(const char *text, int *width, int *height) {
    int used = 0;
    if (sscanf(text, "%6dx%6d%n", width, height, &used) == 2 && text[used] == 0) {
        return true;
    }
    used = 0;
    const bool one = sscanf(text, "%6d%n", width, &used) == 1 && text[used] == 0;
    *height = *width;
    return one;
}

bool cli_is_scene(const char *name) {
    const char *dot = strrchr(name, '.');
    return dot != NULL && strcasecmp(dot, ".ini") == 0;
}

static bool on_progress(void *context, double fraction, double paths_per_s) {
    char detail[48];
    snprintf(detail, sizeof detail, "  %.3g Mpaths/s", paths_per_s / 1e6);
    cli_progress_update(context, fraction, detail, NAN);
    return !cli_interrupted();
}

static gonio_status trace_by_map(const scene_request *r, const gonio_scene *scene, outcome *o, gonio_picture **picture,
                                 gonio_error *error) {
    gonio_cpm *cpm;
    gonio_cpm_render_options how;
    gonio_cpm_render_report report;
    gonio_status status = gonio_cpm_open(r->map, scene, &cpm, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_cpm_render_options_default(&how);
    how.show = strcmp(r->show, "levels") == 0    ? GONIO_CPM_LEVELS
               : strcmp(r->show, "density") == 0 ? GONIO_CPM_DENSITY
                                                 : GONIO_CPM_LIGHT;
    o->options.samples = r->samples != 0 ? r->samples : MAP_SAMPLES;
    status = gonio_cpm_render(cpm, &o->options, &how, picture, &report, error);
    o->report = (gonio_scene_report){.paths = report.rays, .rays = report.rays, .seconds = report.seconds};
    gonio_cpm_free(cpm);
    return status;
}

static gonio_status trace(const scene_request *r, const cli_common *common, outcome *o, gonio_picture **picture,
                          gonio_error *error) {
    gonio_scene *scene;
    gonio_status status = gonio_scene_open(r->scene, &scene, error);
    if (status != GONIO_OK) {
        return status;
    }
    cli_progress progress;
    gonio_scene_describe(scene, &o->facts);
    gonio_scene_options_default(scene, &o->options);
    gonio_scene_options *s = &o->options;
    s->width = r->width > 0 ? r->width : s->width;
    s->height = r->height > 0 ? r->height : s->height;
    s->samples = r->samples != 0 ? r->samples : s->samples;
    s->interreflection = s->interreflection || r->interreflection;
    s->camera = r->camera;
    s->seed = common->seed;
    s->threads = common->threads;
    s->progress = on_progress;
    s->progress_context = &progress;
    cli_progress_start(&progress, "render", 1);
    status = r->map != NULL ? trace_by_map(r, scene, o, picture, error)
                            : gonio_scene_render(scene, s, picture, &o->report, error);
    cli_progress_end(&progress);
    gonio_scene_free(scene);
    return status;
}

// A PNG shows light at an exposure of its own: it is taken to be the picture's.
static void take_exposure(gonio_picture *reference, double scale) {
    for (size_t i = 0; i < 3 * (size_t)reference->width * (size_t)reference->height; i++) {
        reference->rgb[i] = (float)((double)reference->rgb[i] / scale);
    }
}

// One exposure for both: that of the reference where it holds light.
static gonio_status finish(const scene_request *r, const gonio_picture *picture, gonio_picture *reference, outcome *o,
                           gonio_error *error) {
    gonio_status status = GONIO_OK;
    const char *dot = r->reference != NULL ? strrchr(r->reference, '.') : NULL;
    const bool codes = dot != NULL && strcasecmp(dot, ".png") == 0;
    o->scale = exp2(r->exposure_ev);
    if (r->exposure_auto) {
        status = gonio_picture_exposure(reference != NULL && !codes ? reference : picture, &o->scale, error);
    }
    if (status == GONIO_OK && codes) {
        take_exposure(reference, o->scale);
    }
    if (status == GONIO_OK && reference != NULL) {
        status = gonio_picture_compare(picture, reference, o->scale, &o->apart, error);
    }
    if (status == GONIO_OK && r->difference != NULL) {
        status = gonio_picture_write_difference(picture, reference, o->scale, r->difference, error);
    }
    return status == GONIO_OK && r->image != NULL ? gonio_picture_write(picture, r->image, o->scale, error) : status;
}

static int tell(const scene_request *r, const outcome *o) {
    const gonio_scene_facts *f = &o->facts;
    printf("%s: %d mesh%s of %zu triangles", cli_text(r->scene), f->meshes, f->meshes == 1 ? "" : "es", f->triangles);
    if (f->degenerate > 0) {
        printf(", %zu of them degenerate", f->degenerate);
    }
    printf("; %d material%s, %d light%s\n", f->materials, f->materials == 1 ? "" : "s", f->lights,
           f->lights == 1 ? "" : "s");
    printf("%s: %d x %d, %d samples a pixel, exposure %+.2f EV, %.3g rays in %.2f s\n",
           r->image != NULL ? cli_text(r->image) : "(not written)", o->options.width, o->options.height,
           o->options.samples, log2(o->scale), (double)o->report.rays, o->report.seconds);
    if (r->reference != NULL) {
        printf("against %s: MAE %.4g of 255 (8-bit RGB distance), PSNR %.2f dB, largest %.0f, light %.2f dB\n",
               cli_text(r->reference), o->apart.mae, o->apart.psnr_db, o->apart.largest, o->apart.snr_db);
    }
    return 0;
}

static int tell_json(const scene_request *r, const outcome *o) {
    const gonio_scene_facts *f = &o->facts;
    json_t *apart = r->reference != NULL
                        ? json_pack("{s:s,s:f,s:o,s:f,s:o}", "reference", r->reference, "mae", o->apart.mae, "psnr_db",
                                    cli_json_real(o->apart.psnr_db), "largest", o->apart.largest, "snr_db",
                                    cli_json_real(o->apart.snr_db))
                        : json_null();
    json_t *image = r->image != NULL ? json_string(r->image) : json_null();
    return cli_json(json_pack("{s:s,s:o,s:i,s:i,s:i,s:b,s:f,s:I,s:I,s:I,s:i,s:i,s:i,s:I,s:f,s:o}", "scene", r->scene,
                              "image", image, "width", o->options.width, "height", o->options.height, "samples",
                              o->options.samples, "interreflection", o->options.interreflection, "ev", log2(o->scale),
                              "triangles", (json_int_t)f->triangles, "degenerate", (json_int_t)f->degenerate,
                              "open_edges", (json_int_t)f->open_edges, "meshes", f->meshes, "materials", f->materials,
                              "lights", f->lights, "rays", (json_int_t)o->report.rays, "seconds", o->report.seconds,
                              "compared", apart));
}

int cli_scene_render(const scene_request *r, const cli_common *common) {
    outcome o = {.scale = 1};
    gonio_picture *picture = NULL, *reference = NULL;
    gonio_error error = {.line = -1, .byte = -1};
    gonio_status status = GONIO_OK;
    cli_catch_interrupts();
    if (r->image != NULL) {
        status = gonio_picture_check_name(r->image, &error);
    }
    if (status == GONIO_OK && r->difference != NULL) {
        status = gonio_picture_check_name(r->difference, &error);
    }
    if (status == GONIO_OK && r->reference != NULL) {
        status = gonio_picture_read(r->reference, &reference, &error);
    }
    status = status == GONIO_OK ? trace(r, common, &o, &picture, &error) : status;
    status = status == GONIO_OK ? finish(r, picture, reference, &o, &error) : status;
    gonio_picture_free(picture);
    gonio_picture_free(reference);
    if (status != GONIO_OK) {
        return cli_fail(common, &error);
    }
    return common->json ? tell_json(r, &o) : tell(r, &o);
}
