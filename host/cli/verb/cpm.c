// SPDX-License-Identifier: BSD-3-Clause
// gonio cpm: characteristic point maps.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "gonio/cpm.h"
#include "host/cli/scene_render.h"

typedef struct request {
    const char *action, *scene, *output, *map, *channels, *method, *strip;
    gonio_cpm_options build;
    gonio_cpm_render_options how;
    int truth; // paths a pixel
    const char *size;
    int width, height;
    const char *camera;
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

// ---- compare ----

typedef struct contender {
    const char *name;
    gonio_picture *picture;
    int samples;
    double seconds;
    gonio_picture_error apart;
} contender;
enum { TRUTH, MAP, EQUAL, CONTENDERS };

static gonio_status trace(const gonio_scene *scene, gonio_scene_options *o, contender *c, gonio_error *error) {
    gonio_scene_report report;
    o->samples = c->samples;
    const gonio_status status = gonio_scene_render(scene, o, &c->picture, &report, error);
    c->seconds = report.seconds;
    return status;
}

// As many paths a pixel of the original as take the map's time, by the truth's speed.
static int equal_samples(const contender *all) {
    const double samples = all[TRUTH].samples * all[MAP].seconds / fmax(all[TRUTH].seconds, 1e-9);
    return (int)fmax(1, fmin(samples, all[TRUTH].samples));
}

static gonio_status race(const request *r, const gonio_scene *scene, const gonio_cpm *cpm, const cli_common *common,
                         contender *all, gonio_cpm_render_report *report, gonio_error *error) {
    gonio_scene_options o;
    cli_progress progress;
    double scale;
    gonio_scene_options_default(scene, &o);
    o.camera = r->camera;
    o.width = r->width > 0 ? r->width : o.width;
    o.height = r->height > 0 ? r->height : o.height;
    o.threads = common->threads;
    o.interreflection = false;
    o.progress = on_progress;
    o.progress_context = &progress;
    all[TRUTH] = (contender){.name = "truth", .samples = r->truth};
    all[MAP] = (contender){.name = "map", .samples = 4};
    o.seed = common->seed + 1; // the truth's errors are its own
    cli_progress_start(&progress, "compare", 1);
    gonio_status status = trace(scene, &o, &all[TRUTH], error);
    o.seed = common->seed;
    o.samples = 4;
    status = status == GONIO_OK ? gonio_cpm_render(cpm, &o, &r->how, &all[MAP].picture, report, error) : status;
    all[MAP].seconds = report->seconds;
    all[EQUAL] = (contender){.name = "equal time", .samples = equal_samples(all)};
    status = status == GONIO_OK ? trace(scene, &o, &all[EQUAL], error) : status;
    cli_progress_end(&progress);
    status = status == GONIO_OK ? gonio_picture_exposure(all[TRUTH].picture, &scale, error) : status;
    for (int k = 0; k < CONTENDERS && status == GONIO_OK; k++) {
        status = gonio_picture_compare(all[k].picture, all[TRUTH].picture, scale, &all[k].apart, error);
    }
    return status;
}

static json_t *json_of(const contender *c) {
    return json_pack("{s:s,s:i,s:f,s:f,s:o,s:o}", "name", c->name, "samples", c->samples, "seconds", c->seconds, "mae",
                     c->apart.mae, "psnr_db", cli_json_real(c->apart.psnr_db), "snr_db",
                     cli_json_real(c->apart.snr_db));
}

// Wu, Dorsey and Rushmeier 2009, table 3.
static void print_published(void) {
    printf(
        "published (2.66 GHz, 4 cores, 2009): cylinder 3,072 faces, 558 min, 2.2 MB, 32^2, 62.4 against 2.4 min; bolt "
        "10,496, 1,248 min, 21.0 MB, 128^2, 69.1 against 10.1;\nwall 491,164, 1,856 min, 28.0 MB, 128^2, 49.9 against "
        "14.5; gargoyle 200,000, 4,840 min, 79.1 MB, 256^2, 191.4 against 52.1\n");
}

static int tell_race(const request *r, const contender *all, const gonio_cpm_facts *f,
                     const gonio_cpm_render_report *report, const cli_common *common) {
    if (common->json) {
        json_t *list = json_array();
        for (int k = 0; k < CONTENDERS; k++) {
            json_array_append_new(list, json_of(&all[k]));
        }
        return cli_json(json_pack("{s:s,s:s,s:I,s:I,s:I,s:I,s:o}", "scene", r->scene, "map", r->map, "triangles",
                                  (json_int_t)f->triangles, "bytes", (json_int_t)f->bytes, "texels",
                                  (json_int_t)report->texels, "original", (json_int_t)report->original, "pictures",
                                  list));
    }
    printf("%zu faces, %.2f MB, finest %d^2; %zu texels evaluated, %.2g %% of the rays by the original\n", f->triangles,
           (double)f->bytes / 1e6, f->resolution, report->texels,
           100 * (double)report->original / (double)report->rays);
    printf("%-12s %8s %10s %8s %8s %8s\n", "picture", "samples", "seconds", "MAE", "PSNR dB", "SNR dB");
    for (int k = 0; k < CONTENDERS; k++) {
        printf("%-12s %8d %10.3f %8.3f %8.2f %8.2f\n", all[k].name, all[k].samples, all[k].seconds, all[k].apart.mae,
               all[k].apart.psnr_db, all[k].apart.snr_db);
    }
    print_published();
    return 0;
}

static int compare(request *r, const cli_common *common) {
    gonio_error error = {.line = -1, .byte = -1};
    gonio_scene *scene;
    gonio_cpm *cpm = NULL;
    contender all[CONTENDERS] = {{.name = NULL}};
    gonio_cpm_facts facts;
    gonio_cpm_render_report report;
    int result = 0;
    gonio_status status = gonio_scene_open(r->scene, &scene, &error);
    status = status == GONIO_OK ? gonio_cpm_open(r->map, scene, &cpm, &error) : status;
    if (status == GONIO_OK) {
        gonio_cpm_describe(cpm, &facts);
        status = race(r, scene, cpm, common, all, &report, &error);
    }
    result = status == GONIO_OK ? tell_race(r, all, &facts, &report, common) : cli_fail(common, &error);
    for (int k = 0; k < CONTENDERS; k++) {
        gonio_picture_free(all[k].picture);
    }
    gonio_cpm_free(cpm);
    gonio_scene_free(scene);
    return result;
}

// ---- options ----

static int complete(request *r, const cli_common *common) {
    if (strcmp(r->channels, "joint") != 0 && strcmp(r->channels, "separate") != 0) {
        return cli_usage(common, "cpm: --channels: expected joint or separate, found '%s'", r->channels);
    }
    if (strcmp(r->method, "greedy") != 0 && strcmp(r->method, "sampled") != 0) {
        return cli_usage(common, "cpm: --method: expected greedy or sampled, found '%s'", r->method);
    }
    if (r->size != NULL && !cli_parse_size(r->size, &r->width, &r->height)) {
        return cli_usage(common, "cpm: --size: expected N or WIDTHxHEIGHT, found '%s'", r->size);
    }
    r->build.separate = r->channels[0] == 's';
    r->build.paper = r->method[0] == 's';
    cli_catch_interrupts();
    if (strcmp(r->action, "build") == 0) {
        return r->output != NULL ? build(r, common) : cli_usage(common, "cpm build: -o DIR is missing");
    }
    if (strcmp(r->action, "compare") == 0) {
        return r->map != NULL ? compare(r, common) : cli_usage(common, "cpm compare: --cpm DIR is missing");
    }
    return cli_usage(common, "cpm: expected build or compare, found '%s'", r->action);
}

static int run(int argc, char **argv) {
    request r = {.channels = "joint", .method = "greedy", .truth = 256};
    const char *words[2];
    cli_common common;
    int count;
    gonio_cpm_options_default(&r.build);
    gonio_cpm_render_options_default(&r.how);
    gonio_cpm_options *b = &r.build;
    const cli_option options[] = {
        {"output", 'o', CLI_OUTPUT, &r.output, NULL, "DIR",
         "build: where the map goes; a build that was stopped goes on"},
        {"resolution", 0, CLI_INT, &b->resolution, NULL, "N", "texels a side of the finest level, a power of two (32)"},
        {"points", 0, CLI_SIZE, &b->points, NULL, "N", "dense points for a finest texel, on average (1024)"},
        {"dense", 0, CLI_SIZE, &b->dense, NULL, "N", "... and for a coarser one at most (4096)"},
        {"pairs", 0, CLI_INT, &b->pairs, NULL, "N", "pairs of directions that points are chosen by (4096)"},
        {"snr", 0, CLI_DOUBLE, &b->snr_db, NULL, "DB", "that the chosen points must reach (30)"},
        {"most", 0, CLI_SIZE, &b->most, NULL, "N", "points of a texel and channel at most (512)"},
        {"channels", 0, CLI_TEXT, &r.channels, NULL, "joint|separate", "points for all channels, or for each (joint)"},
        {"method", 0, CLI_TEXT, &r.method, NULL, "greedy|sampled",
         "how points are chosen; sampled is the paper's (greedy)"},
        {"energy", 0, CLI_DOUBLE, &b->energy, NULL, "SHARE", "of the squares that its rank keeps (0.97)"},
        {"batch", 0, CLI_SIZE, &b->batch, NULL, "N", "points of one matrix at most (1024)"},
        {"memory", 0, CLI_SIZE, &b->memory, NULL, "BYTES", "for the texels in work at most (no bound)"},
        {"faces", 0, CLI_INT, &b->faces, NULL, "N", "pixels a side of the cube that keeps the visible area (32)"},
        {"keep", 0, CLI_DOUBLE, &b->keep, NULL, "SHARE", "of its Haar coefficients (0.05)"},
        {"simplify", 0, CLI_DOUBLE, &b->share, NULL, "SHARE", "of the triangles that the simplified mesh keeps (0.1)"},
        {"own-charts", 0, CLI_FLAG, &b->own_charts, NULL, NULL, "even where the mesh has texture coordinates"},
        {"cpm", 0, CLI_TEXT, &r.map, NULL, "DIR", "compare: the map"},
        {"truth", 0, CLI_INT, &r.truth, NULL, "N", "... paths a pixel of the original (256)"},
        {"size", 0, CLI_TEXT, &r.size, NULL, "N|WxH", "... pixels (the scene's)"},
        {"bias", 0, CLI_DOUBLE, &r.how.bias, NULL, "LEVELS", "... coarser texels, below 0 finer (-1)"},
        {"camera", 0, CLI_TEXT, &r.camera, NULL, "NAME", "... which of the scene's cameras (the first)"},
        {0}};
    if (!cli_parse(&cmd_cpm, options, argc, argv, words, 2, 2, &count, &common)) {
        return 2;
    }
    r.action = words[0];
    r.scene = words[1];
    return complete(&r, &common);
}
