// SPDX-License-Identifier: BSD-3-Clause
// Characteristic points by our greedy choice and by the paper's random one (Wu, Dorsey and Rushmeier 2009): how many
// reach the same signal-to-noise ratio, what they have at directions that were not in the matrix, and how long the
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
#define FIRST_DB 30 // asked of the matrix; then STEP_DB more, until the others reach theirs
#define STEP_DB 2
#define LAST_DB 46
#define MOST 400
#define RIDGES 48
#define ROWS 16

enum { GREEDY, SAMPLED, WAYS };

typedef struct matrix {
    size_t rows, columns;
    float *a;
    double *b;
} matrix;

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

static double snr(const matrix *m, const cpm_choice *c) {
    double rest = 0, all = 0;
    for (size_t q = 0; q < m->rows; q++) {
        double sum = 0;
        for (size_t k = 0; k < c->n; k++) {
            sum += c->weights[k] * (double)m->a[c->columns[k] * m->rows + q];
        }
        rest += (m->b[q] - sum) * (m->b[q] - sum);
        all += m->b[q] * m->b[q];
    }
    return 10 * log10(all / rest);
}

typedef struct figures {
    double points[32], held_out[32], asked[32], seconds[32];
} figures;

static void measure(const gonio_scene *scene, int texel, size_t points, size_t pairs, figures *figures) {
    cpm_place *places = malloc(points * sizeof *places);
    cpm_views train, test;
    matrix m, held;
    size_t columns[MOST];
    double weights[MOST];
    scatter(scene, texel, places, points);
    gonio_cpm_views_new(scene, places, points, 1, pairs / 4, gonio_random((uint64_t)texel), &train);
    gonio_cpm_views_new(scene, places, points, 1, pairs / 4, gonio_random((uint64_t)texel + 1000), &test);
    fill(scene, places, points, &train, 7, 4, &m);
    fill(scene, places, points, &test, 8, 2, &held);
    for (int way = 0; way < WAYS; way++) {
        cpm_choice c = {.columns = columns, .weights = weights};
        const cpm_matrix matrix = {m.rows, m.columns, m.a, m.b};
        double asked = FIRST_DB - STEP_DB, reached = 0, started = 0;
        while (reached < HELD_OUT_DB && asked < LAST_DB) {
            asked += STEP_DB;
            started = gonio_clock_s();
            if (way == GREEDY) {
                gonio_cpm_select_greedy(&matrix, asked, MOST, &c);
            } else {
                gonio_cpm_select_sampled(&matrix, asked, MOST, 0.97, 5, 1, &c);
            }
            started = gonio_clock_s() - started;
            reached = snr(&held, &c);
        }
        figures[way].seconds[texel] = started; // of the last choice alone
        figures[way].points[texel] = (double)c.n;
        figures[way].asked[texel] = asked;
        figures[way].held_out[texel] = reached;
    }
    free(m.a);
    free(m.b);
    free(held.a);
    free(held.b);
    gonio_cpm_views_free(&train);
    gonio_cpm_views_free(&test);
    free(places);
}

int main(int argc, char **argv) {
    const int texels = argc > 1 ? atoi(argv[1]) : 20;
    const size_t points = argc > 2 ? (size_t)atol(argv[2]) : 512, pairs = argc > 3 ? (size_t)atol(argv[3]) : 2048;
    char folder[] = "/tmp/gonio-bench-XXXXXX", path[128];
    static figures all[WAYS];
    gonio_scene *scene;
    if (mkdtemp(folder) == NULL || texels < 1 || texels > 32) {
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
    static const char *const names[WAYS] = {"greedy", "sampled"};
    double median[WAYS][4];
    printf("%d texels of a ridged cylinder, %zu points, %zu pairs, %d dB held out\n", texels, points, pairs,
           HELD_OUT_DB);
    printf("%-10s %10s %10s %14s %12s   (medians)\n", "choice", "points", "asked, dB", "held out, dB", "seconds");
    for (int way = 0; way < WAYS; way++) {
        median[way][0] = gonio_median(all[way].points, (size_t)texels);
        median[way][1] = gonio_median(all[way].held_out, (size_t)texels);
        median[way][2] = gonio_median(all[way].seconds, (size_t)texels);
        median[way][3] = gonio_median(all[way].asked, (size_t)texels);
        printf("%-10s %10.1f %10.0f %14.2f %12.4f\n", names[way], median[way][0], median[way][3], median[way][1],
               median[way][2]);
    }
    printf("greedy over sampled: %.3f of the points, %.1f times as fast\n", median[GREEDY][0] / median[SAMPLED][0],
           median[SAMPLED][2] / median[GREEDY][2]);
    return 0;
}
