// SPDX-License-Identifier: BSD-3-Clause
// Characteristic points by our greedy choice and by the paper's random one (Wu, Dorsey and Rushmeier 2009): how many
// reach the same signal-to-noise ratio at pairs that are held out, what they have at yet others, and how long the
// choice takes. usage: cpm_selection [TEXELS [POINTS [PAIRS]]]    (20, 512, 2048)
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/random.h"
#include "base/statistics.h"
#include "base/vector.h"
#include "gonio/scene.h"
#include "scene/cpm/texel.h"

#define HELD_OUT_DB 30
#define MARGIN_DB 0.5 // as in scene/cpm/texel.c
#define TEXELS_MAX 32
#define MOST 400
#define RIDGES 48
#define ROWS 16

enum { GREEDY, SAMPLED, GREEDY_ALONE, SAMPLED_ALONE, WAYS };

typedef struct matrix {
    size_t rows, columns;
    float *a;
    double *b;
} matrix;
// What is fitted, what is held out to know when to stop, and what both are judged by: other pairs of the fitted
// directions, and pairs of directions of their own.
enum { FIT, HELD, PAIRED, INDEPENDENT, MATRICES };

// Ridges along the axis, whose two sides are yellow and blue in turn, as tools/scenes.py makes them.
static void write_scene(const char *folder) {
    char path[128];
    snprintf(path, sizeof path, "%s/c.obj", folder);
    FILE *f = fopen(path, "w");
    for (int k = 0, n = 1; k < 2 * RIDGES; k++) {
        fprintf(f, "usemtl %s\n", k % 2 == 0 ? "blue" : "yellow");
        for (int j = 0; j < ROWS; j++, n += 4) {
            for (int c = 0; c < 4; c++) {
                const int i = k + (c == 1 || c == 2);
                const double angle = GONIO_PI * i / RIDGES, r = i % 2 != 0 ? 1 : 0.955;
                fprintf(f, "v %.7g %.7g %.7g\n", r * sin(angle), 2.0 * (j + (c > 1)) / ROWS - 1, r * cos(angle));
            }
            fprintf(f, "f %d %d %d %d\n", n, n + 1, n + 2, n + 3);
        }
    }
    fclose(f);
    snprintf(path, sizeof path, "%s/c.ini", folder);
    f = fopen(path, "w");
    fprintf(f,
            "[material blue]\nmodel = lambert:rho=0.08/0.12/0.8\n[material yellow]\nmodel = lambert:rho=0.8/0.7/0.05\n"
            "[mesh c]\nfile = c.obj\nsmooth = 0\n[light]\n");
    fclose(f);
}

// Points on a patch of a 32nd of the girth, of that number of ridges.
static void scatter(const gonio_scene *scene, int texel, cpm_place *places, size_t n) {
    for (size_t j = 0; j < n; j++) {
        const uint64_t seed = gonio_random((uint64_t)texel * 100000 + j);
        const double wide = gonio_random_uniform(seed), high = gonio_random_uniform(seed + 1);
        const int side = texel * 3 + (int)(3 * ((double)j + wide) / (double)n); // stratified over three sides
        const double a = gonio_random_uniform(seed + 2), root = sqrt(gonio_random_uniform(seed + 3));
        const int row = texel % 8 * 2 + (int)(2 * high);
        const size_t triangle = 2 * ((size_t)(side % (2 * RIDGES)) * ROWS + (size_t)row) + (gonio_random(seed + 4) & 1);
        gonio_cpm_place(scene, (uint32_t)triangle, root * (1 - a), root * a, &places[j]);
    }
}

static void fill(const gonio_scene *scene, const cpm_place *places, size_t points, const cpm_views *v, uint64_t seed,
                 size_t shares, matrix *m) {
    m->rows = v->n * shares * 3;
    m->columns = points;
    m->a = calloc(m->rows * points, sizeof *m->a);
    m->b = calloc(m->rows, sizeof *m->b);
    for (size_t q = 0; q < v->n * shares; q++) {
        const size_t i = q % v->n, o = (size_t)(gonio_random_uniform(seed + q) * (double)v->n);
        for (size_t j = 0; j < points; j++) {
            double f[3] = {0};
            if (v->seen[i * points + j] != 0 && v->seen[o * points + j] != 0) {
                gonio_cpm_apparent(scene, &places[j], v->directions[i], v->directions[o], f);
            }
            for (size_t c = 0; c < 3; c++) {
                m->a[j * m->rows + c * v->n * shares + q] = (float)(f[c] / v->area[o]);
                m->b[c * v->n * shares + q] += (double)(float)(f[c] / v->area[o]);
            }
        }
    }
}

static cpm_rows rows_of(const matrix *m) { return (cpm_rows){m->rows, m->rows, m->a, m->b}; }

enum { POINTS, HELD_DB, PAIRED_DB, INDEPENDENT_DB, SECONDS, FIGURES };
typedef struct figures {
    double values[FIGURES][TEXELS_MAX];
} figures;

static void choose(const matrix *m, int way, int texel, figures *all) {
    size_t columns[MOST];
    double weights[MOST];
    cpm_choice c = {.columns = columns, .weights = weights};
    const bool held_out = way == GREEDY || way == SAMPLED;
    cpm_matrix matrix = {m[FIT].columns, rows_of(&m[FIT]), held_out ? rows_of(&m[HELD]) : (cpm_rows){0}};
    const double started = gonio_clock_thread_s();
    if (way == GREEDY || way == GREEDY_ALONE) {
        gonio_cpm_select_greedy(&matrix, HELD_OUT_DB + MARGIN_DB, MOST, &c);
    } else {
        gonio_cpm_select_sampled(&matrix, HELD_OUT_DB + MARGIN_DB, MOST, 0.97, 5, 1, &c);
    }
    const cpm_rows paired = rows_of(&m[PAIRED]), independent = rows_of(&m[INDEPENDENT]);
    all[way].values[SECONDS][texel] = gonio_clock_thread_s() - started;
    all[way].values[POINTS][texel] = (double)c.n;
    all[way].values[HELD_DB][texel] = c.snr_db;
    all[way].values[PAIRED_DB][texel] = gonio_cpm_snr(&paired, c.n, columns, weights);
    all[way].values[INDEPENDENT_DB][texel] = gonio_cpm_snr(&independent, c.n, columns, weights);
}

static void measure(const gonio_scene *scene, int texel, size_t points, size_t pairs, figures *all) {
    cpm_place *places = malloc(points * sizeof *places);
    double *areas = malloc(points * sizeof *areas);
    cpm_views views[3];
    matrix m[MATRICES];
    scatter(scene, texel, places, points);
    for (size_t j = 0; j < points; j++) {
        areas[j] = 1;
    }
    for (int k = 0; k < 3; k++) { // as scene/cpm/texel.c has it
        const size_t n = pairs / (k == FIT ? 4 : 8);
        gonio_cpm_views_new(scene, places, points, areas, n, gonio_random((uint64_t)(texel + 1000 * k)), &views[k]);
    }
    fill(scene, places, points, &views[0], 7, 4, &m[FIT]);
    fill(scene, places, points, &views[1], 8, 2, &m[HELD]);
    fill(scene, places, points, &views[0], 9, 1, &m[PAIRED]);
    fill(scene, places, points, &views[2], 10, 2, &m[INDEPENDENT]);
    for (int way = 0; way < WAYS; way++) {
        choose(m, way, texel, all);
    }
    for (int k = 0; k < MATRICES; k++) {
        free(m[k].a);
        free(m[k].b);
    }
    for (int k = 0; k < 3; k++) {
        gonio_cpm_views_free(&views[k]);
    }
    free(places);
    free(areas);
}

static void print(figures *all, int texels) {
    static const char *const names[WAYS] = {"greedy", "paper's", "greedy, alone", "paper's, alone"};
    double median[WAYS][FIGURES];
    printf("%-15s %8s %14s %12s %17s %10s   (medians; alone: stopped by what was fitted)\n", "choice", "points",
           "held out, dB", "paired, dB", "independent, dB", "seconds");
    for (int way = 0; way < WAYS; way++) {
        for (int k = 0; k < FIGURES; k++) {
            median[way][k] = gonio_median(all[way].values[k], (size_t)texels);
        }
        printf("%-15s %8.1f %14.2f %12.2f %17.2f %10.4f\n", names[way], median[way][POINTS], median[way][HELD_DB],
               median[way][PAIRED_DB], median[way][INDEPENDENT_DB], median[way][SECONDS]);
    }
    printf("greedy over the paper's: %.3f of the points, %.1f times as fast\n",
           median[GREEDY][POINTS] / median[SAMPLED][POINTS], median[SAMPLED][SECONDS] / median[GREEDY][SECONDS]);
}

int main(int argc, char **argv) {
    const int texels = argc > 1 ? atoi(argv[1]) : 20;
    const size_t points = argc > 2 ? (size_t)atol(argv[2]) : 512, pairs = argc > 3 ? (size_t)atol(argv[3]) : 2048;
    char folder[] = "/tmp/gonio-bench-XXXXXX", path[128];
    static figures all[WAYS];
    gonio_scene *scene;
    if (mkdtemp(folder) == NULL || texels < 1 || texels > TEXELS_MAX) {
        return 1;
    }
    write_scene(folder);
    snprintf(path, sizeof path, "%s/c.ini", folder);
    if (gonio_scene_open(path, &scene, NULL) != GONIO_OK) {
        return 1;
    }
    for (int t = 0; t < texels; t++) {
        measure(scene, t, points, pairs, all);
    }
    gonio_scene_free(scene);
    unlink(path);
    snprintf(path, sizeof path, "%s/c.obj", folder);
    unlink(path);
    rmdir(folder);
    printf("%d texels of a ridged cylinder, %zu points, %zu pairs, %d dB held out\n", texels, points, pairs,
           HELD_OUT_DB);
    print(all, texels);
    return 0;
}
