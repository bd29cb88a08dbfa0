// SPDX-License-Identifier: BSD-3-Clause
// gonio cpm: characteristic point maps.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "host/cli/cpm_compare.h"
#include "host/cli/scene_render.h"

typedef struct request {
    const char *action, *scene, *output, *channels, *method, *filter, *size;
    gonio_cpm_options build;
    cpm_compare_request compare;
} request;

static int run(int argc, char **argv);
const cli_verb cmd_cpm = {
    "cpm", "ACTION SCENE.ini [options]",
    "characteristic point maps: build one (-o DIR), compare its picture with the original's (--cpm DIR)", run};

static bool on_progress(void *context, double fraction, double rate) {
    (void)rate;
    cli_progress_update(context, fraction, "", NAN);
    return !cli_interrupted();
}

// ---- build ----

static int tell_build(const request *r, const gonio_cpm_facts *f, double seconds, const cli_common *common) {
    if (common->json) {
        return cli_json(json_pack("{s:s,s:s,s:i,s:i,s:I,s:I,s:b,s:I,s:I,s:I,s:I,s:I,s:I,s:I,s:f,s:f}", "scene",
                                  r->scene, "map", r->output, "resolution", f->resolution, "levels", f->levels,
                                  "triangles", (json_int_t)f->triangles, "simplified", (json_int_t)f->simplified,
                                  "own_charts", f->own_charts, "open_edges", (json_int_t)f->open_edges, "texels",
                                  (json_int_t)f->texels, "empty", (json_int_t)f->empty, "points", (json_int_t)f->points,
                                  "coefficients", (json_int_t)f->coefficients, "missed", (json_int_t)f->missed, "bytes",
                                  (json_int_t)f->bytes, "snr_db", f->mean_snr_db, "seconds", seconds));
    }
    printf("%s: %d x %d texels, %d levels, on %zu of %zu triangles, %s texture coordinates\n", cli_text(r->output),
           f->resolution, f->resolution, f->levels, f->simplified, f->triangles,
           f->own_charts ? "its own" : "the mesh's");
    printf("%zu texels with points, %zu without; %.1f points a texel at %.2f dB, %zu texels below %g dB; %.2f MB in "
           "%.1f s\n",
           f->texels, f->empty, (double)f->points / fmax(1, (double)f->texels), f->mean_snr_db, f->missed,
           r->build.snr_db, (double)f->bytes / 1e6, seconds);
    if (f->open_edges > 0) {
        printf("the meshes have %zu open edges: what is seen of their backs is not in the map\n", f->open_edges);
    }
    return 0;
}

static int build(request *r, const cli_common *common) {
    gonio_error error = {.line = -1, .byte = -1};
    gonio_scene *scene;
    gonio_cpm_facts facts;
    cli_progress progress;
    gonio_status status = gonio_scene_open(r->scene, &scene, &error);
    if (status == GONIO_OK) {
        r->build.seed = common->seed;
        r->build.threads = common->threads;
        r->build.progress = on_progress;
        r->build.progress_context = &progress;
        cli_progress_start(&progress, "cpm", 1);
        status = gonio_cpm_build(scene, r->output, &r->build, &facts, &error);
        cli_progress_end(&progress);
        gonio_scene_free(scene);
        if (status == GONIO_OK) {
            return tell_build(r, &facts, facts.seconds, common);
        }
    }
    return cli_fail(common, &error);
}

// ---- options ----

static int complete(request *r, const cli_common *common) {
    if (strcmp(r->channels, "joint") != 0 && strcmp(r->channels, "separate") != 0) {
        return cli_usage(common, "cpm: --channels: expected joint or separate, found '%s'", r->channels);
    }
    if (strcmp(r->method, "greedy") != 0 && strcmp(r->method, "sampled") != 0) {
        return cli_usage(common, "cpm: --method: expected greedy or sampled, found '%s'", r->method);
    }
    if (strcmp(r->filter, "box") != 0 && strcmp(r->filter, "tent") != 0) {
        return cli_usage(common, "cpm: --filter: expected box or tent, found '%s'", r->filter);
    }
    if (r->size != NULL && !cli_parse_size(r->size, &r->compare.width, &r->compare.height)) {
        return cli_usage(common, "cpm: --size: expected N or WIDTHxHEIGHT, found '%s'", r->size);
    }
    r->build.separate = r->channels[0] == 's';
    r->build.paper = r->method[0] == 's';
    r->build.filter = r->filter[0] == 't' ? GONIO_CPM_TENT : GONIO_CPM_BOX;
    cli_catch_interrupts();
    if (strcmp(r->action, "build") == 0) {
        return r->output != NULL ? build(r, common) : cli_usage(common, "cpm build: -o DIR is missing");
    }
    if (strcmp(r->action, "compare") == 0) {
        r->compare.scene = r->scene;
        return r->compare.map != NULL ? cli_cpm_compare(&r->compare, common)
                                      : cli_usage(common, "cpm compare: --cpm DIR is missing");
    }
    return cli_usage(common, "cpm: expected build or compare, found '%s'", r->action);
}

static int run(int argc, char **argv) {
    request r = {.channels = "joint", .method = "greedy", .filter = "box", .compare = {.truth = 256}};
    const char *words[2];
    cli_common common;
    int count;
    gonio_cpm_options_default(&r.build);
    gonio_cpm_render_options_default(&r.compare.how);
    gonio_cpm_options *b = &r.build;
    const cli_option options[] = {
        {"output", 'o', CLI_OUTPUT, &r.output, NULL, "DIR",
         "build: where the map goes; a build that was stopped goes on"},
        {"resolution", 0, CLI_INT, &b->resolution, NULL, "N", "texels a side of the finest level, a power of two (32)"},
        {"points", 0, CLI_SIZE, &b->points, NULL, "N", "dense points for a finest texel, on average (1024)"},
        {"dense", 0, CLI_SIZE, &b->dense, NULL, "N", "... and for a coarser one at most (4096)"},
        {"pairs", 0, CLI_INT, &b->pairs, NULL, "N", "pairs of directions that points are chosen by (4096)"},
        {"snr", 0, CLI_DOUBLE, &b->snr_db, NULL, "DB", "that the chosen points must reach at pairs held out (30)"},
        {"filter", 0, CLI_TEXT, &r.filter, NULL, "box|tent",
         "what a texel is the mean over; a tent is twice as wide (box)"},
        {"most", 0, CLI_SIZE, &b->most, NULL, "N", "points of a texel and channel at most (512)"},
        {"channels", 0, CLI_TEXT, &r.channels, NULL, "joint|separate", "points for all channels, or for each (joint)"},
        {"method", 0, CLI_TEXT, &r.method, NULL, "greedy|sampled",
         "how points are chosen; sampled is the paper's (greedy)"},
        {"energy", 0, CLI_DOUBLE, &b->energy, NULL, "SHARE", "of the squares that its rank keeps (0.97)"},
        {"batch", 0, CLI_SIZE, &b->batch, NULL, "N", "points of one matrix at most (1024)"},
        {"memory", 0, CLI_SIZE, &b->memory, NULL, "BYTES", "for the mesh's points and the texels in work at most (no bound)"},
        {"faces", 0, CLI_INT, &b->faces, NULL, "N", "pixels a side of the cube that keeps the visible area (32)"},
        {"keep", 0, CLI_DOUBLE, &b->keep, NULL, "SHARE", "of its Haar coefficients (0.05)"},
        {"simplify", 0, CLI_DOUBLE, &b->share, NULL, "SHARE", "of the triangles that the simplified mesh keeps (0.1)"},
        {"own-charts", 0, CLI_FLAG, &b->own_charts, NULL, NULL, "even where the mesh has texture coordinates"},
        {"cpm", 0, CLI_TEXT, &r.compare.map, NULL, "DIR", "compare: the map"},
        {"truth", 0, CLI_INT, &r.compare.truth, NULL, "N", "... paths a pixel of the original (256)"},
        {"size", 0, CLI_TEXT, &r.size, NULL, "N|WxH", "... pixels (the scene's)"},
        {"bias", 0, CLI_DOUBLE, &r.compare.how.bias, NULL, "LEVELS", "... coarser texels, below 0 finer (0)"},
        {"camera", 0, CLI_TEXT, &r.compare.camera, NULL, "NAME", "... which of the scene's cameras (the first)"},
        {"strip", 0, CLI_OUTPUT, &r.compare.strip, NULL, "IMAGE",
         "... all pictures side by side: normal map, truth, map, original in equal time, levels, density"},
        {0}};
    if (!cli_parse(&cmd_cpm, options, argc, argv, words, 2, 2, &count, &common)) {
        return 2;
    }
    r.action = words[0];
    r.scene = words[1];
    return complete(&r, &common);
}
