// SPDX-License-Identifier: BSD-3-Clause
// Characteristic point maps: their parts against closed forms, and a small map from beginning to end.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/random.h"
#include "base/vector.h"
#include "gonio/cpm.h"
#include "scene/cpm/area.h"
#include "scene/cpm/select.h"
#include "scene/cpm/surface.h"
#include "tests/unit/near.h"

// ---- the visible area ----

static void transform_keeps_lengths_and_comes_back(void **state) {
    (void)state;
    static float v[6 * 16 * 16], w[6 * 16 * 16];
    double before = 0, after = 0;
    for (int i = 0; i < 6 * 256; i++) {
        v[i] = w[i] = (float)gonio_random_uniform((uint64_t)i);
        before += (double)v[i] * (double)v[i];
    }
    gonio_cpm_haar(w, 16);
    for (int i = 0; i < 6 * 256; i++) {
        after += (double)w[i] * (double)w[i];
    }
    assert_near(after, before, 1e-4 * before);
    gonio_cpm_haar_back(w, 16);
    for (int i = 0; i < 6 * 256; i++) {
        assert_near((double)w[i], (double)v[i], 1e-5);
    }
}

// A flat disc's area is its cosine: kept and restored it is found again at any direction, within what was left out.
static void area_of_a_disc(void **state) {
    (void)state;
    enum { SIDE = 32 };
    static float v[6 * SIDE * SIDE];
    static cpm_coefficient kept[6 * SIDE * SIDE];
    const gonio_vec3 n = normalised((gonio_vec3){0.3, -0.5, 0.8});
    for (size_t i = 0; i < 6 * SIDE * SIDE; i++) {
        v[i] = (float)fmax(0, dot(n, gonio_cpm_area_direction(SIDE, i)));
        const gonio_vec3 w = gonio_cpm_area_direction(SIDE, i);
        assert_near(dot(w, w), 1, 1e-12);
    }
    for (int k = 0; k < 2; k++) {
        float scale;
        static float back[6 * SIDE * SIDE];
        memcpy(back, v, sizeof back);
        gonio_cpm_haar(back, SIDE);
        const size_t n_kept = gonio_cpm_area_keep(back, SIDE, k == 0 ? 6 * SIDE * SIDE : 307, kept, &scale);
        assert_true(k == 0 || n_kept <= 307);
        gonio_cpm_area_restore(kept, n_kept, scale, SIDE, back);
        double squares = 0;
        for (int i = 0; i < 500; i++) {
            const double z = 1 - (2 * i + 1) / 500.0, r = sqrt(1 - z * z);
            const gonio_vec3 w = {r * cos(2.4 * i), r * sin(2.4 * i), z};
            const double apart = gonio_cpm_area_at(back, SIDE, w) - fmax(0, dot(n, w));
            assert_near(gonio_cpm_area_of(kept, n_kept, scale, SIDE, w), gonio_cpm_area_at(back, SIDE, w), 1e-5);
            squares += apart * apart / 500;
        }
        assert_true(sqrt(squares) < (k == 0 ? 0.004 : 0.03));
    }
}

// ---- choosing ----

enum { ROWS = 200, COLUMNS = 60 };

// Columns are bumps at random places; their sum is smooth, so few do.
static void bumps(float *a, double *b) {
    memset(b, 0, ROWS * sizeof *b);
    for (int j = 0; j < COLUMNS; j++) {
        const double at = gonio_random_uniform(77 + (uint64_t)j);
        for (int q = 0; q < ROWS; q++) {
            const double x = (q + 0.5) / ROWS - at;
            a[j * ROWS + q] = (float)exp(-20 * x * x);
            b[q] += (double)a[j * ROWS + q];
        }
    }
}

static double snr_of(const float *a, const double *b, const cpm_choice *c) {
    double rest = 0, all = 0;
    for (int q = 0; q < ROWS; q++) {
        double sum = 0;
        for (size_t k = 0; k < c->n; k++) {
            sum += c->weights[k] * (double)a[c->columns[k] * ROWS + (size_t)q];
        }
        rest += (b[q] - sum) * (b[q] - sum);
        all += b[q] * b[q];
    }
    return 10 * log10(all / rest);
}

static void few_columns_stand_for_all(void **state) {
    (void)state;
    static float a[ROWS * COLUMNS];
    static double b[ROWS], weights[COLUMNS];
    static size_t columns[COLUMNS];
    cpm_choice choice = {.columns = columns, .weights = weights};
    bumps(a, b);
    const cpm_matrix m = {COLUMNS, {ROWS, ROWS, a, b}, {0}};
    size_t greedy = 0;
    for (int k = 0; k < 2; k++) {
        const bool good = k == 0 ? gonio_cpm_select_greedy(&m, 40, COLUMNS, &choice)
                                 : gonio_cpm_select_sampled(&m, 40, COLUMNS, 0.97, 5, 1, &choice);
        assert_true(good);
        assert_true(choice.snr_db >= 40);
        assert_near(snr_of(a, b, &choice), choice.snr_db, 0.2); // the sampled one's ridge, and float32
        for (size_t i = 0; i < choice.n; i++) {
            assert_true(choice.weights[i] > 0 && choice.columns[i] < COLUMNS);
            for (size_t j = 0; j < i; j++) {
                assert_true(choice.columns[i] != choice.columns[j]);
            }
        }
        greedy = k == 0 ? choice.n : greedy;
    }
    assert_true(greedy <= 12 && greedy < choice.n);
    // What cannot be reached ends with what there is; nothing wanted needs nothing.
    assert_true(gonio_cpm_select_greedy(&m, 80, 3, &choice) && choice.n <= 3 && choice.snr_db < 80);
    memset(b, 0, sizeof b);
    assert_true(gonio_cpm_select_greedy(&m, 40, COLUMNS, &choice) && choice.n == 0);
    assert_true(gonio_cpm_select_sampled(&m, 40, COLUMNS, 0.97, 5, 1, &choice) && choice.n == 0);
}

// Columns are noise around few shapes: what fits the rows at hand is no measure of other rows. Both ways go on until
// those that are held out are met, and stop where more columns no longer help.
static void rows_held_out_decide(void **state) {
    (void)state;
    enum { FITTED = 60, HELD = 140 };
    static float a[ROWS * COLUMNS];
    static double b[ROWS], weights[COLUMNS];
    static size_t columns[COLUMNS];
    cpm_choice choice = {.columns = columns, .weights = weights};
    for (int q = 0; q < ROWS; q++) { // in no order, so that both parts are of one kind
        for (int j = 0; j < COLUMNS; j++) {
            const double x = (q * 37 % ROWS + 0.5) / ROWS - gonio_random_uniform(77 + (uint64_t)j);
            a[j * ROWS + q] =
                (float)(exp(-20 * x * x) * (0.5 + gonio_random_uniform((uint64_t)(1000 + q * COLUMNS + j))));
            b[q] += (double)a[j * ROWS + q];
        }
    }
    cpm_matrix m = {COLUMNS, {FITTED, ROWS, a, b}, {HELD, ROWS, a + FITTED, b + FITTED}};
    for (int k = 0; k < 2; k++) {
        const cpm_rows held = m.held;
        m.held.n = 0;
        assert_true(k == 0 ? gonio_cpm_select_greedy(&m, 22, COLUMNS, &choice)
                           : gonio_cpm_select_sampled(&m, 22, COLUMNS, 0.97, 5, 1, &choice));
        const size_t few = choice.n;
        assert_true(choice.snr_db >= 22 && gonio_cpm_snr(&held, choice.n, columns, weights) < 22);
        m.held = held;
        assert_true(k == 0 ? gonio_cpm_select_greedy(&m, 22, COLUMNS, &choice)
                           : gonio_cpm_select_sampled(&m, 22, COLUMNS, 0.97, 5, 1, &choice));
        assert_true(choice.snr_db >= 22 && choice.n > few);
        assert_near(gonio_cpm_snr(&held, choice.n, columns, weights), choice.snr_db, 1e-9);
    }
    // What cannot be reached: the best that was met, and not all columns.
    for (int q = FITTED; q < ROWS; q += 2) {
        b[q] *= 1.2;
    }
    assert_true(gonio_cpm_select_greedy(&m, 60, COLUMNS, &choice));
    assert_true(choice.snr_db > 15 && choice.snr_db < 60 && choice.n < COLUMNS);
}

// ---- charts ----

static void charts_of_a_box(void **state) {
    (void)state;
    static const float p[24] = {0, 0, 0, 2, 0, 0, 2, 1, 0, 0, 1, 0, 0, 0, 3, 2, 0, 3, 2, 1, 3, 0, 1, 3};
    static const unsigned faces[6][4] = {{3, 2, 1, 0}, {4, 5, 6, 7}, {0, 1, 5, 4},
                                         {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}};
    unsigned indices[36];
    float uv[72];
    for (int f = 0; f < 6; f++) {
        const unsigned *c = faces[f], six[6] = {c[0], c[1], c[2], c[0], c[2], c[3]};
        memcpy(indices + 6 * f, six, sizeof six);
    }
    assert_true(gonio_cpm_charts(p, indices, 12, 32, uv));
    double low[6][2], high[6][2], areas = 0;
    for (int f = 0; f < 6; f++) {
        for (int k = 0; k < 2; k++) {
            low[f][k] = 2;
            high[f][k] = -2;
            for (int c = 0; c < 6; c++) {
                low[f][k] = fmin(low[f][k], (double)uv[12 * f + 2 * c + k]);
                high[f][k] = fmax(high[f][k], (double)uv[12 * f + 2 * c + k]);
            }
            assert_true(low[f][k] >= 0 && high[f][k] <= 1);
        }
        areas += (high[f][0] - low[f][0]) * (high[f][1] - low[f][1]);
        for (int g = 0; g < f; g++) { // a texel of room between any two
            bool apart = false;
            for (int k = 0; k < 2; k++) {
                apart = apart || low[f][k] > high[g][k] + 0.99 / 32 || low[g][k] > high[f][k] + 0.99 / 32;
            }
            assert_true(apart);
        }
    }
    assert_true(areas > 0.4);
    // All at one scale: the three kinds of sides are 2, 3 and 6 large.
    assert_near((high[0][0] - low[0][0]) * (high[0][1] - low[0][1]) * 22 / 2, areas, 1e-4);
}

// ---- a map ----

static void put(const char *name, const char *text) {
    FILE *file = fopen(name, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

// A ridged roof: seen from one side it is red, from the other blue.
static void put_scene(void) {
    FILE *file = fopen("roof.obj", "w");
    assert_non_null(file);
    for (int k = 0; k < 16; k++) {
        const double x0 = k / 8.0 - 1, x1 = (k + 1) / 8.0 - 1, z0 = k % 2 * 0.125, z1 = (k + 1) % 2 * 0.125;
        fprintf(file, "v %g -1 %g\nv %g -1 %g\nv %g 1 %g\nv %g 1 %g\n", x0, z0, x1, z1, x1, z1, x0, z0);
        fprintf(file, "vt %g 0\nvt %g 0\nvt %g 1\nvt %g 1\n", k / 16.0, (k + 1) / 16.0, (k + 1) / 16.0, k / 16.0);
        const int n = 4 * k + 1;
        fprintf(file, "usemtl %s\nf %d/%d %d/%d %d/%d %d/%d\n", k % 2 == 0 ? "red" : "blue", n, n, n + 1, n + 1, n + 2,
                n + 2, n + 3, n + 3);
    }
    fclose(file);
    put("roof.ini", "[image]\nwidth = 12\nheight = 12\nsamples = 1024\n[camera left]\neye = -20/0/20\nfov = 8\n"
                    "[camera right]\neye = 20/0/20\nfov = 8\n[material red]\nmodel = lambert:rho=0.8/0.1/0.1\n"
                    "[material blue]\nmodel = lambert:rho=0.1/0.1/0.8\n[mesh roof]\nfile = roof.obj\nsmooth = 0\n"
                    "[light lamp]\ntoward = 0.2/-0.3/1\nintensity = 3\n");
}

static gonio_cpm_options small(void) {
    gonio_cpm_options o;
    gonio_cpm_options_default(&o);
    o.resolution = 4;
    o.points = 64;
    o.dense = 128;
    o.batch = 64;
    o.pairs = 512;
    o.faces = 8;
    o.keep = 0.2;
    o.snr_db = 24;
    return o;
}

static char *bytes_of(const char *path, size_t *size) {
    FILE *file = fopen(path, "rb");
    char *bytes = malloc(1 << 20);
    assert_true(file != NULL && bytes != NULL);
    *size = fread(bytes, 1, 1 << 20, file);
    fclose(file);
    return bytes;
}

static bool stop_after(void *context, double fraction, double rate) {
    (void)fraction;
    (void)rate;
    return --*(int *)context > 0;
}

// The same bytes however often it was stopped, with any number of threads.
static void build_goes_on(void **state) {
    (void)state;
    put_scene();
    gonio_scene *scene;
    gonio_cpm_facts facts;
    assert_int_equal(gonio_scene_open("roof.ini", &scene, NULL), GONIO_OK);
    gonio_cpm_options o = small();
    o.threads = 1;
    assert_int_equal(gonio_cpm_build(scene, "map", &o, &facts, NULL), GONIO_OK);
    assert_int_equal(facts.texels, 21);
    assert_int_equal(facts.missed, 0);
    assert_false(facts.own_charts);
    assert_true(facts.simplified < facts.triangles);
    size_t a_size, b_size;
    char *a = bytes_of("map/map.cpm", &a_size);
    o.threads = 2;
    o.memory = 1000;
    assert_int_equal(gonio_cpm_build(scene, "again", &o, &facts, NULL), GONIO_E_RANGE);
    o.memory = 2 << 20; // of one texel at a time
    o.progress = stop_after;
    gonio_status status = GONIO_E_INTERRUPTED;
    int rounds = 0;
    while (status == GONIO_E_INTERRUPTED && rounds++ < 30) {
        int steps = 2; // a part at most
        o.progress_context = &steps;
        status = gonio_cpm_build(scene, "again", &o, &facts, NULL);
        // A part that was cut off in the middle does not count.
        if (rounds == 2) {
            FILE *file = fopen("again/part-00-0000000", "r+b");
            if (file != NULL) {
                assert_int_equal(ftruncate(fileno(file), 100), 0);
                fclose(file);
            }
        }
    }
    assert_int_equal(status, GONIO_OK);
    assert_true(rounds >= 2);
    char *b = bytes_of("again/map.cpm", &b_size);
    assert_int_equal(a_size, b_size);
    assert_memory_equal(a, b, a_size);
    assert_int_equal(access("again/part-00-0000000", F_OK), -1);
    // A finished one is told, not built; other options want another folder.
    o.progress = NULL;
    assert_int_equal(gonio_cpm_build(scene, "again", &o, &facts, NULL), GONIO_OK);
    assert_int_equal(facts.texels, 21);
    o.snr_db = 23;
    assert_int_equal(gonio_cpm_build(scene, "again", &o, &facts, NULL), GONIO_E_INPUT);
    free(a);
    free(b);
    gonio_scene_free(scene);
}

// By the map the roof looks as it does from both sides: red here, blue there.
static void pictures(void **state) {
    (void)state;
    gonio_scene *scene;
    gonio_cpm *cpm;
    assert_int_equal(gonio_scene_open("roof.ini", &scene, NULL), GONIO_OK);
    assert_int_equal(gonio_cpm_open("map", scene, &cpm, NULL), GONIO_OK);
    const char *const cameras[] = {"left", "right"};
    for (int k = 0; k < 2; k++) {
        gonio_scene_options o;
        gonio_cpm_render_options how;
        gonio_cpm_render_report report;
        gonio_picture *truth, *picture, *again;
        gonio_scene_options_default(scene, &o);
        gonio_cpm_render_options_default(&how);
        o.camera = cameras[k];
        assert_int_equal(gonio_scene_render(scene, &o, &truth, NULL, NULL), GONIO_OK);
        o.samples = 4;
        how.bias = 1; // the finest texels are larger than pixels
        assert_int_equal(gonio_cpm_render(cpm, &o, &how, &picture, &report, NULL), GONIO_OK);
        assert_true(report.original <= 8); // slivers at the rim
        assert_true(report.texels > 0);
        double mean[2][3] = {{0}};
        for (int i = 0; i < 3 * 144; i++) {
            mean[0][i % 3] += (double)truth->rgb[i] / 144;
            mean[1][i % 3] += (double)picture->rgb[i] / 144;
        }
        for (int c = 0; c < 3; c++) {
            assert_near(mean[1][c], mean[0][c], 0.04 * mean[0][c]); // 24 dB are 6 %, and 3.2 % is the most
        }
        assert_true((mean[1][0] > mean[1][2]) == (k == 0));
        o.threads = 1;
        assert_int_equal(gonio_cpm_render(cpm, &o, &how, &again, &report, NULL), GONIO_OK);
        assert_memory_equal(picture->rgb, again->rgb, 3 * 144 * sizeof *again->rgb);
        gonio_picture_free(truth);
        gonio_picture_free(picture);
        gonio_picture_free(again);
    }
    gonio_cpm_free(cpm);
    gonio_scene_free(scene);
}

// Damage anywhere is found: at once, or where the texel is used. Another scene's map is refused.
static void damage(void **state) {
    (void)state;
    gonio_scene *scene;
    gonio_cpm *cpm;
    size_t size;
    assert_int_equal(gonio_scene_open("roof.ini", &scene, NULL), GONIO_OK);
    char *bytes = bytes_of("map/map.cpm", &size);
    for (size_t at = 0; at < size; at += size / 23 + 1) {
        FILE *file = fopen("again/map.cpm", "wb");
        bytes[at] ^= 0x10;
        fwrite(bytes, 1, size, file);
        fclose(file);
        bytes[at] ^= 0x10;
        gonio_status status = gonio_cpm_open("again", scene, &cpm, NULL);
        if (status == GONIO_OK) {
            gonio_scene_options o;
            gonio_cpm_render_options how;
            gonio_picture *picture = NULL;
            gonio_scene_options_default(scene, &o);
            gonio_cpm_render_options_default(&how);
            o.samples = 1;
            for (double bias = 0; bias < 3 && status == GONIO_OK; bias++) { // so that every level is used
                how.bias = bias;
                status = gonio_cpm_render(cpm, &o, &how, &picture, NULL, NULL);
                gonio_picture_free(picture);
            }
            gonio_cpm_free(cpm);
        }
        if (status != GONIO_E_INPUT) {
            fail_msg("byte %zu of %zu may be wrong", at, size);
        }
    }
    free(bytes);
    gonio_scene_free(scene);
    put("other.ini", "[material red]\nmodel = lambert:rho=0.9\n[mesh roof]\nfile = roof.obj\nsmooth = 0\n[light]\n");
    assert_int_equal(gonio_scene_open("other.ini", &scene, NULL), GONIO_OK);
    assert_int_equal(gonio_cpm_open("map", scene, &cpm, NULL), GONIO_E_INPUT);
    gonio_scene_free(scene);
}

// Meshes that are not as one would wish: each gives a map that tells so, and a picture of finite light.
static void odd_meshes(void **state) {
    (void)state;
    static const char *const corners = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nv 0 0 1\n";
    static const char *const pyramid = "f 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\nf 3 2 1\nf 4 3 1\n";
    static const char *const uvs = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 0.5 0.5\n";
    static const char *const far_uvs = "vt 0 0\nvt 3 0\nvt 3 3\nvt 0 3\nvt 1.5 1.5\n";
    static const char *const sides = "f 1/1 2/2 5/5\nf 2/2 3/3 5/5\nf 3/3 4/4 5/5\nf 4/4 1/1 5/5\n";
    static const char *const half = "f 1/1 2/2 5/5\n";
    const struct {
        const char *name, *parts[3];
        bool own_charts, open, degenerate, empty;
    } cases[] = {{"without texture coordinates", {corners, pyramid, ""}, true, false, false, false},
                 {"beyond the unit square", {corners, far_uvs, sides}, true, true, false, false},
                 {"open, with texture coordinates", {corners, uvs, sides}, false, true, false, false},
                 {"a face without an area", {corners, pyramid, "f 1 1 2\n"}, true, false, true, false},
                 {"texels without points", {corners, uvs, half}, false, true, false, true}};
    put("odd.ini", "[camera c]\neye = 1/2/6\n[mesh odd]\nfile = odd.obj\nsmooth = 0\n[light]\ntoward = 1/1/2\n");
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        char text[600];
        gonio_scene *scene;
        gonio_cpm *cpm;
        gonio_cpm_facts facts;
        gonio_scene_facts whole;
        gonio_scene_options o;
        gonio_cpm_render_options how;
        gonio_picture *picture;
        snprintf(text, sizeof text, "%s%s%s", cases[k].parts[0], cases[k].parts[1], cases[k].parts[2]);
        put("odd.obj", text);
        gonio_cpm_options options = small();
        options.points = options.dense = 16;
        options.pairs = 64;
        options.faces = 4;
        options.filter = k % 2 == 0 ? GONIO_CPM_BOX : GONIO_CPM_TENT;
        assert_int_equal(gonio_scene_open("odd.ini", &scene, NULL), GONIO_OK);
        assert_int_equal(gonio_cpm_build(scene, "odd", &options, &facts, NULL), GONIO_OK);
        gonio_scene_describe(scene, &whole);
        if (facts.own_charts != cases[k].own_charts || (facts.open_edges > 0) != cases[k].open ||
            (whole.degenerate > 0) != cases[k].degenerate || (cases[k].empty && facts.empty == 0)) {
            fail_msg("%s: told otherwise", cases[k].name);
        }
        assert_int_equal(gonio_cpm_open("odd", scene, &cpm, NULL), GONIO_OK);
        gonio_scene_options_default(scene, &o);
        gonio_cpm_render_options_default(&how);
        o.width = o.height = 8;
        o.samples = 2;
        double light = 0;
        for (int way = 0; way < 2; way++) {
            assert_int_equal(way == 0 ? gonio_cpm_render(cpm, &o, &how, &picture, NULL, NULL)
                                      : gonio_cpm_render_normal_map(cpm, &o, &picture, NULL, NULL),
                             GONIO_OK);
            for (int i = 0; i < 3 * 64; i++) {
                assert_true(isfinite(picture->rgb[i]));
                light += (double)picture->rgb[i];
            }
            gonio_picture_free(picture);
        }
        assert_true(light > 0);
        gonio_cpm_free(cpm);
        gonio_scene_free(scene);
        unlink("odd/map.cpm");
        unlink("odd/milliseconds");
        assert_int_equal(rmdir("odd"), 0);
    }
}

static char folder[64];

static int enter(void **state) {
    (void)state;
    const char *parent = getenv("TMPDIR");
    snprintf(folder, sizeof folder, "%.40s/gonio-cpm-XXXXXX", parent != NULL ? parent : "/tmp");
    return mkdtemp(folder) != NULL && chdir(folder) == 0 ? 0 : -1;
}

static int leave(void **state) {
    (void)state;
    static const char *const names[] = {"roof.obj",           "roof.ini",      "other.ini",
                                        "map/map.cpm",        "again/map.cpm", "map/milliseconds",
                                        "again/milliseconds", "odd.obj",       "odd.ini"};
    for (size_t k = 0; k < sizeof names / sizeof *names; k++) {
        unlink(names[k]);
    }
    rmdir("map");
    rmdir("again");
    return chdir("/") == 0 ? rmdir(folder) : -1;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(transform_keeps_lengths_and_comes_back),
        cmocka_unit_test(area_of_a_disc),
        cmocka_unit_test(few_columns_stand_for_all),
        cmocka_unit_test(rows_held_out_decide),
        cmocka_unit_test(charts_of_a_box),
        cmocka_unit_test(build_goes_on),
        cmocka_unit_test(pictures),
        cmocka_unit_test(damage),
        cmocka_unit_test(odd_meshes),
    };
    return cmocka_run_group_tests(tests, enter, leave);
}
