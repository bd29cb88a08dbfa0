// SPDX-License-Identifier: BSD-3-Clause
// Pictures by a map, by the original and by a normal map, against the original with many paths: how far apart, and how
// long a processor takes for them. The interior is where an object covers a pixel and all around it.
#include "host/cli/cpm_compare.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"

#define MAP_SAMPLES 4
#define NORMAL_MAP_SAMPLES 64

typedef struct contender {
    const char *name;
    gonio_picture *picture;
    double samples; // rays or paths a pixel
    double seconds; // of a processor, all threads together: what else runs is no part of it
    gonio_picture_error apart, interior;
} contender;
// The order of the paper's strips, and behind it what the original takes to be as near to the truth as the map is.
enum { NORMAL_MAP, TRUTH, MAP, EQUAL_TIME, PICTURES, EQUAL_INTERIOR = PICTURES, EQUAL_WHOLE, CONTENDERS };

typedef struct race {
    const cpm_compare_request *request;
    const cli_common *common;
    const gonio_scene *scene;
    const gonio_cpm *cpm;
    gonio_scene_options options;
    cli_progress progress;
    gonio_cpm_render_report report;
    double scale;
    contender all[CONTENDERS];
    gonio_picture *coverage, *levels, *density;
    size_t interior;        // pixels
    unsigned char *covered; // [pixels]: inside, and all around as well
} race;

static bool on_progress(void *context, double fraction, double rate) {
    (void)rate;
    cli_progress_update(context, fraction, "", NAN);
    return !cli_interrupted();
}

// ---- how far apart ----

static void find_interior(race *r) {
    const int width = r->options.width, height = r->options.height;
    for (int pixel = 0; pixel < width * height; pixel++) {
        const int x = pixel % width, y = pixel / width;
        bool all = x > 0 && y > 0 && x + 1 < width && y + 1 < height;
        for (int k = 0; k < 9 && all; k++) {
            const size_t other = (size_t)((y + k / 3 - 1) * width + x + k % 3 - 1);
            all = r->coverage->rgb[3 * other] >= 1;
        }
        r->covered[pixel] = all;
        r->interior += all;
    }
}

// The interior's pixels in a row; its picture is the caller's to free.
static gonio_picture *interior_of(const race *r, const gonio_picture *picture) {
    gonio_picture *row = malloc(sizeof *row);
    float *rgb = malloc((3 * r->interior + 1) * sizeof *rgb);
    if (row == NULL || rgb == NULL) {
        free(row);
        free(rgb);
        return NULL;
    }
    size_t n = 0;
    for (size_t pixel = 0; pixel < (size_t)picture->width * (size_t)picture->height; pixel++) {
        if (r->covered[pixel] != 0) {
            memcpy(rgb + 3 * n++, picture->rgb + 3 * pixel, 3 * sizeof *rgb);
        }
    }
    *row = (gonio_picture){(int)n, 1, rgb};
    return row;
}

static gonio_status judge(const race *r, contender *c, gonio_error *error) {
    const gonio_picture *truth = r->all[TRUTH].picture;
    gonio_status status = gonio_picture_compare(c->picture, truth, r->scale, &c->apart, error);
    c->interior = (gonio_picture_error){.psnr_db = NAN, .snr_db = NAN};
    if (status != GONIO_OK || r->interior == 0) {
        return status;
    }
    gonio_picture *inside = interior_of(r, c->picture), *reference = interior_of(r, truth);
    status = inside != NULL && reference != NULL
                 ? gonio_picture_compare(inside, reference, r->scale, &c->interior, error)
                 : gonio_fail(error, GONIO_E_MEMORY, "no memory for a picture");
    gonio_picture_free(inside);
    gonio_picture_free(reference);
    return status;
}

// ---- pictures ----

static gonio_status trace(race *r, int samples, contender *c, gonio_error *error) {
    const double started_s = gonio_clock_process_s();
    r->options.samples = samples;
    const gonio_status status = gonio_scene_render(r->scene, &r->options, &c->picture, NULL, error);
    c->samples = samples;
    c->seconds = gonio_clock_process_s() - started_s;
    return status;
}

static gonio_status by_map(race *r, gonio_cpm_show show, gonio_picture **picture, gonio_error *error) {
    const double started_s = gonio_clock_process_s();
    gonio_cpm_render_options how = r->request->how;
    gonio_cpm_render_report report;
    how.show = show;
    r->options.samples = show == GONIO_CPM_COVERAGE ? NORMAL_MAP_SAMPLES : MAP_SAMPLES;
    const gonio_status status = gonio_cpm_render(r->cpm, &r->options, &how, picture, &report, error);
    if (show == GONIO_CPM_LIGHT) {
        r->report = report;
        r->all[MAP].seconds = gonio_clock_process_s() - started_s;
    }
    return status;
}

// As many paths of the original as make it as near to the truth as the map is, between powers of two.
static void note_equal(const contender *map, const contender *now, const contender *last, bool interior,
                       contender *equal) {
    const double wanted = interior ? map->interior.psnr_db : map->apart.psnr_db;
    const double reached = interior ? now->interior.psnr_db : now->apart.psnr_db;
    const double before = interior ? last->interior.psnr_db : last->apart.psnr_db;
    if (equal->samples > 0 || !(reached >= wanted)) {
        return;
    }
    const double way = last->samples > 0 && reached > before ? (wanted - before) / (reached - before) : 1;
    const double part = exp2(fmin(fmax(way, 0), 1) - 1); // of the paths
    equal->samples = now->samples * part;
    equal->seconds = now->seconds * part;
    equal->apart = now->apart;
    equal->interior = now->interior;
    *(interior ? &equal->interior.psnr_db : &equal->apart.psnr_db) = wanted;
}

static gonio_status find_equals(race *r, gonio_error *error) {
    contender last = {0};
    gonio_status status = GONIO_OK;
    for (int samples = 1; samples <= r->request->truth / 4 && status == GONIO_OK; samples *= 2) {
        contender now = {0};
        status = trace(r, samples, &now, error);
        status = status == GONIO_OK ? judge(r, &now, error) : status;
        gonio_picture_free(now.picture);
        now.picture = NULL;
        note_equal(&r->all[MAP], &now, &last, true, &r->all[EQUAL_INTERIOR]);
        note_equal(&r->all[MAP], &now, &last, false, &r->all[EQUAL_WHOLE]);
        if (r->all[EQUAL_WHOLE].samples > 0 && (r->all[EQUAL_INTERIOR].samples > 0 || r->interior == 0)) {
            break;
        }
        last = now;
    }
    return status;
}

static gonio_status make_pictures(race *r, gonio_error *error) {
    contender *all = r->all;
    gonio_status status = by_map(r, GONIO_CPM_COVERAGE, &r->coverage, error);
    if (status == GONIO_OK) {
        find_interior(r);
    }
    r->options.seed = r->common->seed + 1; // the truth's errors are its own
    status = status == GONIO_OK ? trace(r, r->request->truth, &all[TRUTH], error) : status;
    r->options.seed = r->common->seed;
    status = status == GONIO_OK ? by_map(r, GONIO_CPM_LIGHT, &all[MAP].picture, error) : status;
    all[MAP].samples = MAP_SAMPLES;
    all[NORMAL_MAP].samples = fmin(NORMAL_MAP_SAMPLES, r->request->truth);
    r->options.samples = (int)all[NORMAL_MAP].samples;
    const double started_s = gonio_clock_process_s();
    status = status == GONIO_OK
                 ? gonio_cpm_render_normal_map(r->cpm, &r->options, &all[NORMAL_MAP].picture, NULL, error)
                 : status;
    all[NORMAL_MAP].seconds = gonio_clock_process_s() - started_s;
    const double equal = all[TRUTH].samples * all[MAP].seconds / fmax(all[TRUTH].seconds, 1e-9);
    status =
        status == GONIO_OK ? trace(r, (int)fmax(1, fmin(equal, all[TRUTH].samples)), &all[EQUAL_TIME], error) : status;
    if (r->request->strip != NULL) {
        status = status == GONIO_OK ? by_map(r, GONIO_CPM_LEVELS, &r->levels, error) : status;
        status = status == GONIO_OK ? by_map(r, GONIO_CPM_DENSITY, &r->density, error) : status;
    }
    status = status == GONIO_OK ? gonio_picture_exposure(all[TRUTH].picture, &r->scale, error) : status;
    for (int k = 0; k < PICTURES && status == GONIO_OK; k++) {
        status = judge(r, &all[k], error);
    }
    return status == GONIO_OK ? find_equals(r, error) : status;
}

// All side by side; colours of levels and densities are no light, and stay as they are.
static gonio_status write_strip(const race *r, gonio_error *error) {
    const gonio_picture *tiles[PICTURES + 2] = {r->all[NORMAL_MAP].picture,
                                                r->all[TRUTH].picture,
                                                r->all[MAP].picture,
                                                r->all[EQUAL_TIME].picture,
                                                r->levels,
                                                r->density};
    const size_t width = (size_t)r->options.width, height = (size_t)r->options.height, n = PICTURES + 2;
    gonio_picture strip = {(int)(n * width), (int)height, malloc(3 * n * width * height * sizeof(float))};
    if (strip.rgb == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a picture");
    }
    for (size_t k = 0; k < n; k++) {
        const float scale = k < PICTURES ? (float)r->scale : 1;
        for (size_t y = 0; y < height; y++) {
            for (size_t i = 0; i < 3 * width; i++) {
                strip.rgb[3 * width * (y * n + k) + i] = tiles[k]->rgb[3 * width * y + i] * scale;
            }
        }
    }
    const gonio_status status = gonio_picture_write(&strip, r->request->strip, 1, error);
    free(strip.rgb);
    return status;
}

// ---- what is told ----

// Wu, Dorsey and Rushmeier 2009, table 3: 4 cores of 2.66 GHz and a GPU.
static const struct published {
    const char *model;
    int faces;
    double minutes[3], megabytes; // visible areas, reflectances, choice
    int finest;
    double truth_min, ours_min;
} published[] = {{"cylinder", 3072, {12.5, 59.2, 485.9}, 2.2, 32, 62.4, 2.4},
                 {"bolt", 10496, {57.4, 366.3, 824.7}, 21.0, 128, 69.1, 10.1},
                 {"wall", 491164, {86.5, 856.6, 913.1}, 28.0, 128, 49.9, 14.5},
                 {"gargoyle", 200000, {203.6, 1063.9, 3572.3}, 79.1, 256, 191.4, 52.1}};

static void print_table(const race *r, const gonio_cpm_facts *f) {
    const contender *all = r->all;
    printf("%-10s %8s  %12s %12s %12s %9s %7s  %12s %10s %6s\n", "model", "faces", "visible area", "reflectances",
           "choice", "size", "finest", "ground truth", "map", "ratio");
    for (size_t k = 0; k < sizeof published / sizeof *published; k++) {
        const struct published *p = &published[k];
        printf("%-10s %8d %9.1f min %8.1f min %8.1f min %6.1f MB %5d^2 %9.1f min %6.1f min %6.1f\n", p->model, p->faces,
               p->minutes[0], p->minutes[1], p->minutes[2], p->megabytes, p->finest, p->truth_min, p->ours_min,
               p->truth_min / p->ours_min);
    }
    printf("%-10s %8zu %9.2f min %8.2f min %8.2f min %6.2f MB %5d^2 %9.3f min %6.3f min %6.1f\n", "this", f->triangles,
           f->area_s / 60, f->reflectance_s / 60, f->choice_s / 60, (double)f->bytes / 1e6, f->resolution,
           all[TRUTH].seconds / 60, all[MAP].seconds / 60, all[TRUTH].seconds / all[MAP].seconds);
    printf(
        "(published: Wu, Dorsey and Rushmeier 2009, table 3, 4 cores of 2.66 GHz and a GPU, 512^2 pixels; this map's "
        "minutes are of one core)\n");
}

static void print_contenders(const race *r) {
    printf("%-22s %8s %9s %8s %9s %9s %12s\n", "picture", "samples", "seconds", "MAE", "PSNR dB", "SNR dB",
           "interior dB");
    static const char *const names[CONTENDERS] = {"normal map",       "truth",        "map", "original, equal time",
                                                  "  equal interior", "  equal whole"};
    for (int k = 0; k < CONTENDERS; k++) {
        const contender *c = &r->all[k];
        if (!(c->samples > 0)) {
            printf("%-22s needs more than %d paths a pixel, if it ever is\n", names[k], r->request->truth / 4);
        } else {
            printf("%-22s %8.3g %9.3f %8.3f %9.2f %9.2f %12.2f\n", names[k], c->samples, c->seconds, c->apart.mae,
                   c->apart.psnr_db, c->apart.snr_db, c->interior.psnr_db);
        }
    }
    for (int k = EQUAL_INTERIOR; k < CONTENDERS; k++) {
        const contender *c = &r->all[k];
        if (c->samples > 0) {
            printf("at equal PSNR of the %s the map is %.2f times as fast as the original\n",
                   k == EQUAL_INTERIOR ? "interior" : "whole picture", c->seconds / r->all[MAP].seconds);
        }
    }
}

static json_t *json_of(const contender *c, const char *name) {
    return json_pack("{s:s,s:f,s:f,s:f,s:o,s:o,s:o}", "name", name, "samples", c->samples, "seconds", c->seconds, "mae",
                     c->apart.mae, "psnr_db", cli_json_real(c->apart.psnr_db), "snr_db", cli_json_real(c->apart.snr_db),
                     "interior_db", cli_json_real(c->interior.psnr_db));
}

static int tell(const race *r) {
    static const char *const names[CONTENDERS] = {"normal map", "truth",          "map",
                                                  "equal time", "equal interior", "equal whole"};
    gonio_cpm_facts f;
    gonio_cpm_describe(r->cpm, &f);
    if (r->common->json) {
        json_t *list = json_array();
        for (int k = 0; k < CONTENDERS; k++) {
            if (r->all[k].samples > 0) {
                json_array_append_new(list, json_of(&r->all[k], names[k]));
            }
        }
        return cli_json(json_pack("{s:s,s:s,s:I,s:I,s:I,s:I,s:I,s:f,s:f,s:f,s:o}", "scene", r->request->scene, "map",
                                  r->request->map, "triangles", (json_int_t)f.triangles, "bytes", (json_int_t)f.bytes,
                                  "texels", (json_int_t)r->report.texels, "original", (json_int_t)r->report.original,
                                  "interior", (json_int_t)r->interior, "area_s", f.area_s, "reflectance_s",
                                  f.reflectance_s, "choice_s", f.choice_s, "pictures", list));
    }
    printf("%d x %d pixels, %zu of them interior; %zu texels evaluated, %.2g %% of the rays by the original\n",
           r->options.width, r->options.height, r->interior, r->report.texels,
           100 * (double)r->report.original / (double)r->report.rays);
    print_contenders(r);
    print_table(r, &f);
    return 0;
}

// ---- all ----

static void release(race *r) {
    for (int k = 0; k < CONTENDERS; k++) {
        gonio_picture_free(r->all[k].picture);
    }
    gonio_picture_free(r->coverage);
    gonio_picture_free(r->levels);
    gonio_picture_free(r->density);
    free(r->covered);
}

static gonio_status run(race *r, gonio_error *error) {
    const cpm_compare_request *request = r->request;
    gonio_scene_options *o = &r->options;
    gonio_scene_options_default(r->scene, o);
    o->camera = request->camera;
    o->width = request->width > 0 ? request->width : o->width;
    o->height = request->height > 0 ? request->height : o->height;
    o->seed = r->common->seed;
    o->threads = r->common->threads;
    o->interreflection = false;
    o->progress = on_progress;
    o->progress_context = &r->progress;
    r->covered = calloc((size_t)o->width * (size_t)o->height, 1);
    if (r->covered == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a picture");
    }
    cli_progress_start(&r->progress, "compare", 1);
    const gonio_status status = make_pictures(r, error);
    cli_progress_end(&r->progress);
    return status == GONIO_OK && request->strip != NULL ? write_strip(r, error) : status;
}

int cli_cpm_compare(const cpm_compare_request *request, const cli_common *common) {
    gonio_error error = {.line = -1, .byte = -1};
    gonio_scene *scene = NULL;
    gonio_cpm *cpm = NULL;
    race *r = calloc(1, sizeof *r);
    gonio_status status = r != NULL ? GONIO_OK : gonio_fail(&error, GONIO_E_MEMORY, "no memory for a comparison");
    status = status == GONIO_OK && request->strip != NULL ? gonio_picture_check_name(request->strip, &error) : status;
    status = status == GONIO_OK ? gonio_scene_open(request->scene, &scene, &error) : status;
    status = status == GONIO_OK ? gonio_cpm_open(request->map, scene, &cpm, &error) : status;
    if (status == GONIO_OK) {
        r->request = request;
        r->common = common;
        r->scene = scene;
        r->cpm = cpm;
        status = run(r, &error);
    }
    const int result = status == GONIO_OK ? tell(r) : cli_fail(common, &error);
    if (r != NULL) {
        release(r);
        free(r);
    }
    gonio_cpm_free(cpm);
    gonio_scene_free(scene);
    return result;
}
