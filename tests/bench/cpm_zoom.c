// SPDX-License-Identifier: BSD-3-Clause
// Are the boundaries of a map's levels seen? A plate of ridges is left behind, until it is 8 times as far away; of
// pairs of neighbouring frames among 240, how much pixels change: by maps of box and of tent filters, and by the
// original with many paths. usage: cpm_zoom [PAIRS [SIZE [PATHS]]]    (12 of the 239, 48 pixels, 256)
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/vector.h"
#include "gonio/cpm.h"
#include "scene/world/world.h"

#define FRAMES 240
#define ZOOM 8
#define RIDGES 96
#define NEAREST 6.5  // of the eye; the plate is 2 wide
#define EXPOSURE 2.5 // of the codes

enum { BOX, TENT, WAYS };

static void write_scene(const char *folder) {
    char path[160];
    snprintf(path, sizeof path, "%s/plate.obj", folder);
    FILE *f = fopen(path, "w");
    for (int k = 0; k < 2 * RIDGES; k++) {
        const int n = 4 * k + 1;
        fprintf(f, "usemtl %s\n", k % 2 == 0 ? "blue" : "yellow");
        for (int c = 0; c < 4; c++) {
            const int i = k + (c == 1 || c == 2);
            const double u = i / (2.0 * RIDGES);
            fprintf(f, "v %.7g %d %.7g\nvt %.7g %d\n", 2 * u - 1, c > 1 ? 1 : -1, i % 2 != 0 ? 0.01 : 0.0, u, c > 1);
        }
        fprintf(f, "f %d/%d %d/%d %d/%d %d/%d\n", n, n, n + 1, n + 1, n + 2, n + 2, n + 3, n + 3);
    }
    fclose(f);
    snprintf(path, sizeof path, "%s/plate.ini", folder);
    f = fopen(path, "w");
    fprintf(f,
            "[camera c]\nfov = 24\n[material blue]\nmodel = lambert:rho=0.08/0.12/0.8\n[material yellow]\n"
            "model = lambert:rho=0.8/0.7/0.05\n[mesh p]\nfile = plate.obj\nsmooth = 0\n[light]\ntoward = -0.6/0.2/1\n");
    fclose(f);
}

// Frame k's eye: the distance grows by the same share from frame to frame.
static void place_camera(gonio_scene *scene, int frame) {
    const double distance = NEAREST * pow(ZOOM, frame / (FRAMES - 1.0));
    scene_camera_settings *c = &scene->settings->camera[0];
    const double toward[3] = {0.5, 0.1, 0.86};
    for (int k = 0; k < 3; k++) {
        c->eye[k] = distance * toward[k];
        c->target[k] = 0;
    }
}

static double code(float light) {
    const double x = fmin(fmax((double)light * EXPOSURE, 0), 1);
    return 255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1 / 2.4) - 0.055);
}

typedef struct changes {
    size_t n;
    double *jumps;  // of codes
    double squares; // against the truth
    size_t compared;
    double seconds;
} changes;

static int ascending(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double percentile(changes *c, double share) {
    qsort(c->jumps, c->n, sizeof *c->jumps, ascending);
    return c->n > 0 ? c->jumps[(size_t)((double)(c->n - 1) * share)] : NAN;
}

// Pixels that the plate covers in both frames count.
static void note_pair(gonio_picture *const *pictures, gonio_picture *const *covered, gonio_picture *const *truth,
                      changes *c) {
    const size_t pixels = (size_t)pictures[0]->width * (size_t)pictures[0]->height;
    for (size_t i = 0; i < 3 * pixels; i++) {
        if (covered[0]->rgb[i] >= 1 && covered[1]->rgb[i] >= 1) {
            c->jumps[c->n++] = fabs(code(pictures[0]->rgb[i]) - code(pictures[1]->rgb[i]));
            const double apart = code(pictures[0]->rgb[i]) - code(truth[0]->rgb[i]);
            c->squares += apart * apart;
            c->compared++;
        }
    }
}

static void print(const char *name, changes *c, double of_truth) {
    const double p = percentile(c, 0.999);
    printf("%-10s %10.2f %10.2f %22.2f %12.2f %12.1f\n", name, percentile(c, 0.5), p, p - of_truth,
           10 * log10(255.0 * 255.0 * (double)c->compared / c->squares), c->seconds);
}

static gonio_status draw(const gonio_scene *scene, const gonio_cpm *cpm, const gonio_scene_options *o,
                         gonio_cpm_show show, changes *c, gonio_picture **picture) {
    gonio_cpm_render_options how;
    gonio_cpm_render_options_default(&how);
    how.show = show;
    const double started = gonio_clock_process_s();
    const gonio_status status = cpm == NULL ? gonio_scene_render(scene, o, picture, NULL, NULL)
                                            : gonio_cpm_render(cpm, o, &how, picture, NULL, NULL);
    c->seconds += gonio_clock_process_s() - started;
    return status;
}

static gonio_status measure(gonio_scene *scene, gonio_cpm *const *maps, int pairs, int size, int paths,
                            changes all[WAYS + 1]) {
    gonio_scene_options o;
    changes unused = {0};
    gonio_scene_options_default(scene, &o);
    o.width = o.height = size;
    gonio_status status = GONIO_OK;
    for (int pair = 0; pair < pairs && status == GONIO_OK; pair++) {
        const int first = (int)((pair + 0.5) * (FRAMES - 1) / pairs);
        gonio_picture *pictures[WAYS + 1][2] = {{NULL}}, *covered[2] = {NULL};
        for (int k = 0; k < 2 && status == GONIO_OK; k++) {
            place_camera(scene, first + k);
            o.samples = paths;
            status = draw(scene, NULL, &o, GONIO_CPM_LIGHT, &all[WAYS], &pictures[WAYS][k]);
            o.samples = 4;
            for (int way = 0; way < WAYS && status == GONIO_OK; way++) {
                status = draw(scene, maps[way], &o, GONIO_CPM_LIGHT, &all[way], &pictures[way][k]);
            }
            o.samples = 16;
            status = status == GONIO_OK ? draw(scene, maps[0], &o, GONIO_CPM_COVERAGE, &unused, &covered[k]) : status;
        }
        for (int way = 0; way <= WAYS && status == GONIO_OK; way++) {
            note_pair(pictures[way], covered, pictures[WAYS], &all[way]);
        }
        for (int k = 0; k < 2 * (WAYS + 1); k++) {
            gonio_picture_free(pictures[k / 2][k % 2]);
        }
        gonio_picture_free(covered[0]);
        gonio_picture_free(covered[1]);
    }
    return status;
}

static gonio_status build(const gonio_scene *scene, const char *folder, int way, gonio_cpm **map) {
    gonio_cpm_options o;
    gonio_cpm_facts facts;
    gonio_cpm_options_default(&o);
    o.resolution = 32;
    o.points = o.dense = way == TENT ? 128 : 96;
    o.pairs = 512;
    o.faces = 16;
    o.keep = 0.2;
    o.snr_db = 26;
    o.share = 0.02;
    o.filter = way == TENT ? GONIO_CPM_TENT : GONIO_CPM_BOX;
    const double started = gonio_clock_process_s();
    const gonio_status status = gonio_cpm_build(scene, folder, &o, &facts, NULL);
    printf("%s: %.1f points a texel at %.2f dB, %zu of %zu below %g dB, %.2f MB, %.1f s of a processor\n",
           way == TENT ? "tent" : "box", (double)facts.points / (double)facts.texels, facts.mean_snr_db, facts.missed,
           facts.texels, o.snr_db, (double)facts.bytes / 1e6, gonio_clock_process_s() - started);
    return status == GONIO_OK ? gonio_cpm_open(folder, scene, map, NULL) : status;
}

int main(int argc, char **argv) {
    const int pairs = argc > 1 ? atoi(argv[1]) : 12, size = argc > 2 ? atoi(argv[2]) : 48;
    const int paths = argc > 3 ? atoi(argv[3]) : 256;
    char folder[] = "/tmp/gonio-bench-XXXXXX", path[160];
    gonio_scene *scene = NULL;
    gonio_cpm *maps[WAYS] = {NULL};
    changes all[WAYS + 1] = {{0}};
    if (pairs < 1 || pairs >= FRAMES || size < 8 || paths < 1 || mkdtemp(folder) == NULL) {
        return 1;
    }
    write_scene(folder);
    snprintf(path, sizeof path, "%s/plate.ini", folder);
    gonio_status status = gonio_scene_open(path, &scene, NULL);
    for (int way = 0; way <= WAYS; way++) {
        all[way].jumps = malloc(3 * (size_t)size * (size_t)size * (size_t)pairs * sizeof(double));
        if (way < WAYS && status == GONIO_OK) {
            snprintf(path, sizeof path, "%s/%d", folder, way);
            status = build(scene, path, way, &maps[way]);
        }
    }
    status = status == GONIO_OK ? measure(scene, maps, pairs, size, paths, all) : status;
    printf("%d pairs of neighbouring frames of %d over a zoom of %d, %d^2 pixels, %d paths; changes in codes of 255\n",
           pairs, FRAMES, ZOOM, size, paths);
    printf("%-10s %10s %10s %22s %12s %12s\n", "picture", "median", "99.9 %", "beyond the truth's", "PSNR, dB",
           "seconds");
    const double of_truth = percentile(&all[WAYS], 0.999);
    print("truth", &all[WAYS], of_truth);
    print("box", &all[BOX], of_truth);
    print("tent", &all[TENT], of_truth);
    for (int way = 0; way <= WAYS; way++) {
        free(all[way].jumps);
        if (way < WAYS) {
            static const char *const files[] = {"map.cpm", "milliseconds", ""};
            gonio_cpm_free(maps[way]);
            for (int k = 0; k < 3; k++) {
                snprintf(path, sizeof path, "%s/%d/%s", folder, way, files[k]);
                k < 2 ? unlink(path) : rmdir(path);
            }
        }
    }
    gonio_scene_free(scene);
    snprintf(path, sizeof path, "%s/plate.obj", folder);
    unlink(path);
    snprintf(path, sizeof path, "%s/plate.ini", folder);
    unlink(path);
    rmdir(folder);
    return status == GONIO_OK ? 0 : 1;
}
