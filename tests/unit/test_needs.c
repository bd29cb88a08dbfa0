// SPDX-License-Identifier: BSD-3-Clause
// What scenes need: collected, written, read, and what plans and fits make of it.
#include <inttypes.h>
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
#include "base/text.h"
#include "brdf/checksum.h"
#include "fit/bilevel/needed.h"
#include "fit/needs/needs.h"
#include "gonio/scene_needs.h"
#include "tests/unit/near.h"

static void put(const char *name, const char *text, size_t size) {
    FILE *file = fopen(name, "w");
    assert_non_null(file);
    assert_int_equal(fwrite(text, 1, size, file), size);
    fclose(file);
}

#define SQUARE "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n"

static gonio_needs *collect(const char *ini, int threads, size_t cells, int orbit) {
    gonio_scene *scene;
    gonio_needs *needs;
    gonio_error error = {.line = -1};
    gonio_needs_frame frames[4] = {{.camera = ""}};
    put("square.obj", SQUARE, strlen(SQUARE));
    put("s.ini", ini, strlen(ini));
    if (gonio_scene_open("s.ini", &scene, &error) != GONIO_OK) {
        fail_msg("%s:%lld: %s", error.file, error.line, error.message);
    }
    gonio_scene_needs_options o = {.cells = cells};
    gonio_scene_options_default(scene, &o.render);
    o.render.threads = threads;
    for (int k = 0; k < orbit; k++) {
        frames[k].turn_deg = 360.0 * k / orbit;
    }
    if (gonio_scene_needs(scene, "s.ini", &o, frames, orbit, &needs, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    gonio_scene_free(scene);
    return needs;
}

// A row of pixels across the plane, in the plane of the light.
#define ROW                                                                                                            \
    "[image]\nwidth = 64\nheight = 1\nsamples = 16\n[camera]\neye = 0/0/3\nfov = 0.3\n[mesh]\nfile = square.obj\n"     \
    "[light sun]\ntoward = 1/0/1\nintensity = 3\n"
// The plane, seen askew.
#define PLANE                                                                                                          \
    "[image]\nwidth = 24\nheight = 16\nsamples = 4\n[camera]\neye = 1/-2/2\nfov = 40\n[mesh]\nfile = square.obj\n"     \
    "[light sun]\ntoward = 1/0/1\nintensity = 3\n[material paint]\nmodel = ward:rho_d=0.3,rho_s=0.1,alpha=0.2\n"

static void one_line(void **state) {
    (void)state;
    gonio_needs *needs = collect(ROW, 1, 0, 1);
    gonio_needs_facts facts;
    gonio_needs_describe(needs, 0, &facts);
    assert_true(facts.isotropic && facts.cells > 3 && facts.behind == 0);
    const gonio_need *cells = gonio_needs_cells(needs, 0);
    double codes = 0, squares = 0;
    for (size_t i = 0; i < facts.cells; i++) {
        const gonio_pair p = gonio_pair_from_vectors(cells[i].wi, cells[i].wo);
        assert_near(p.theta_i, gonio_radians(45), 1e-6);
        assert_near(cells[i].wo.y, 0, 0.005); // half a pixel's height about the plane of incidence
        assert_near(cells[i].value, 0.5 / GONIO_PI, 1e-4);
        codes += cells[i].codes;
        squares += cells[i].squares;
    }
    assert_near(codes, facts.codes, 1e-9 * codes);
    // Lambert under a sun: every pixel that sees the plane is as bright, nearly white by the exposure.
    gonio_needs_scene about;
    gonio_needs_describe_scene(needs, &about);
    const double light = about.frame[0].exposure * 0.5 / GONIO_PI * 3 * sqrt(0.5);
    const double each = sqrt(3) * 255 * 1.055 / 2.4 * pow(light, 1 / 2.4);
    assert_in_range(100 * codes / each, 1, 100);
    assert_near(squares / codes, each, 1e-3 * each);
    gonio_needs_free(needs);
}

// What is off by a small share everywhere shows as the cells promise.
static void promises(void **state) {
    (void)state;
    gonio_needs *needs = collect(PLANE, 2, 0, 1);
    gonio_needs_facts facts;
    gonio_scene *scene;
    gonio_needs_describe(needs, 0, &facts);
    assert_int_equal(gonio_needs_open_scene(needs, &scene, NULL), GONIO_OK);
    gonio_scene_options o;
    gonio_needs_scene about;
    gonio_needs_render_options(needs, scene, &o);
    gonio_needs_describe_scene(needs, &about);
    gonio_frames *truth, *off;
    gonio_model *brighter;
    gonio_picture_error apart;
    assert_int_equal(gonio_frames_render(scene, &o, about.frame, 1, 0, &truth, NULL), GONIO_OK);
    assert_int_equal(gonio_model_from_spec("ward:rho_d=0.33,rho_s=0.11,alpha=0.2", &brighter, NULL), GONIO_OK);
    assert_int_equal(gonio_scene_exchange_model(scene, 0, &brighter, NULL), GONIO_OK);
    assert_int_equal(gonio_frames_render(scene, &o, about.frame, 1, 0, &off, NULL), GONIO_OK);
    assert_int_equal(gonio_frames_compare(off, truth, &apart, NULL), GONIO_OK);
    // 10 %; codes are rounded, and pixels of a plane are much alike.
    assert_near(apart.mae, 0.1 * facts.codes, 0.15 * apart.mae);
    gonio_model_free(brighter);
    gonio_frames_free(truth);
    gonio_frames_free(off);
    gonio_scene_free(scene);
    gonio_needs_free(needs);
}

static void same_for_any_threads(void **state) {
    (void)state;
    char *bytes[3];
    size_t size[3];
    for (int k = 0; k < 3; k++) {
        gonio_needs *needs = collect(PLANE, k + 1, 0, 2);
        assert_int_equal(gonio_needs_save(needs, "n.needs", NULL), GONIO_OK);
        assert_int_equal(gonio_file_read("n.needs", 0, &bytes[k], &size[k], NULL), GONIO_OK);
        gonio_needs_free(needs);
        assert_int_equal(size[k], size[0]);
        assert_memory_equal(bytes[k], bytes[0], size[0]);
    }
    for (int k = 0; k < 3; k++) {
        free(bytes[k]);
    }
}

// Few cells: coarser ones, of the same sums.
static void bounded(void **state) {
    (void)state;
    gonio_needs *fine = collect(PLANE, 1, 0, 1), *coarse = collect(PLANE, 2, 20, 1);
    gonio_needs_facts f, c;
    gonio_needs_describe(fine, 0, &f);
    gonio_needs_describe(coarse, 0, &c);
    assert_true(f.cells > 20 && c.cells <= 20 && c.resolution < f.resolution);
    assert_near(c.codes, f.codes, 1e-6 * f.codes);
    assert_near(c.squares, f.squares, 1e-4 * f.squares);
    gonio_needs_free(fine);
    gonio_needs_free(coarse);
}

// ---- the file ----

static gonio_status open_bytes(const char *text, size_t size, gonio_error *error) {
    gonio_needs *needs;
    put("b.needs", text, size);
    *error = (gonio_error){.line = -1};
    const gonio_status status = gonio_needs_open("b.needs", &needs, error);
    gonio_needs_free(needs);
    return status;
}

static void file_round_trip(void **state) {
    (void)state;
    gonio_needs *a = collect(PLANE, 1, 0, 2), *b;
    assert_int_equal(gonio_needs_save(a, "n.needs", NULL), GONIO_OK);
    assert_true(gonio_needs_file_is("n.needs"));
    assert_false(gonio_needs_file_is("s.ini"));
    assert_int_equal(gonio_needs_open("n.needs", &b, NULL), GONIO_OK);
    gonio_needs_facts f, g;
    gonio_needs_describe(a, 0, &f);
    gonio_needs_describe(b, 0, &g);
    assert_int_equal(f.cells, g.cells);
    assert_string_equal(g.name, "paint");
    for (size_t i = 0; i < f.cells; i++) {
        const gonio_need *x = gonio_needs_cells(a, 0) + i, *y = gonio_needs_cells(b, 0) + i;
        assert_near(x->wi.x, y->wi.x, 1e-9);
        assert_near(x->wo.y, y->wo.y, 1e-8);
        assert_near(x->codes, y->codes, 1e-8 * x->codes);
        assert_near(x->squares, y->squares, 1e-8 * x->squares);
    }
    gonio_scene *scene;
    assert_int_equal(gonio_needs_open_scene(b, &scene, NULL), GONIO_OK);
    gonio_scene_free(scene);
    gonio_error error = {.line = -1};
    put("s.ini", ROW, strlen(ROW));
    assert_int_equal(gonio_needs_open_scene(b, &scene, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.message, "has changed"));
    gonio_needs_free(a);
    gonio_needs_free(b);
}

static void damage_is_seen(void **state) {
    (void)state;
    char *data;
    size_t size;
    gonio_error error;
    gonio_needs *needs = collect(ROW, 1, 0, 1);
    assert_int_equal(gonio_needs_save(needs, "n.needs", NULL), GONIO_OK);
    gonio_needs_free(needs);
    assert_int_equal(gonio_file_read("n.needs", 0, &data, &size, NULL), GONIO_OK);
    assert_int_equal(open_bytes(data, size, &error), GONIO_OK);
    for (size_t k = 0; k < 60; k++) {
        const size_t at = k * (size - 1) / 59;
        data[at] ^= 4;
        assert_int_equal(open_bytes(data, size, &error), GONIO_E_INPUT);
        data[at] ^= 4;
        assert_int_equal(open_bytes(data, at, &error), GONIO_E_INPUT);
    }
    free(data);
}

// Whatever is wrong with a file of a true checksum is told with its line.
static void bad_lines(void **state) {
    (void)state;
#define HEAD                                                                                                           \
    "# gonio needs 1\n# scene = s.ini\n# scene_checksum = 0\n# picture = "                                             \
    "width=8,height=8,samples=1,interreflection=0\n"                                                                   \
    "# frame = camera=,light=,turn=0,exposure=1\n"
#define COLUMNS "material,theta_i,phi_i,theta_o,phi_o,codes,squares,value\n"
#define PAINT "# material = name=paint,isotropic=1,resolution=8,cells=1,behind=0\n"
    static const struct {
        const char *text, *says;
        int line;
    } bad[] = {
        {HEAD PAINT COLUMNS "paint,95,0,10,0,1,1,1\n", "95", 8},
        {HEAD PAINT COLUMNS "paint,10,0,10,0,1,1\n", "expected the 8 columns", 8},
        {HEAD PAINT COLUMNS "paint,10,0,10,0,-1,1,1\n", "codes is -1", 8},
        {HEAD PAINT COLUMNS "paint,10,0,10,0,nan,1,1\n", "codes", 8},
        {HEAD PAINT COLUMNS "wood,10,0,10,0,1,1,1\n", "material 'wood'", 8},
        {HEAD PAINT COLUMNS "paint,10,0,10,0,1,1,1\npaint,20,0,10,0,1,1,1\n", "fewer", 9},
        {HEAD PAINT COLUMNS, "0 cells of material 'paint'", -2},
        {HEAD COLUMNS, "lacks", -2},
        {HEAD PAINT, "found '# checksum", 7},
        {HEAD "# material = name=paint,isotropic=1\n" COLUMNS, "expected 5 settings", 6},
        {HEAD "# material = name=paint,isotropic=1,resolution=8,cells=1e12,behind=0\n" COLUMNS, "cells is 1e12", 6},
        {HEAD "# metal = 3\n", "found '# metal", 6},
        {"# gonio needs 1\n# frame = camera=,light=,turn=0,exposure=0\n", "exposure is 0", 2},
        {"theta_i\n", "not a file of needs", 1},
    };
    char text[2000];
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        gonio_error error;
        gonio_checksum sum = gonio_checksum_begin();
        gonio_checksum_add(&sum, bad[k].text, strlen(bad[k].text));
        snprintf(text, sizeof text, "%s# checksum = %016" PRIx64 "\n", bad[k].text, gonio_checksum_end(&sum));
        assert_int_equal(open_bytes(text, strlen(text), &error), GONIO_E_INPUT);
        if (strstr(error.message, bad[k].says) == NULL || (bad[k].line > 0 && error.line != bad[k].line)) {
            fail_msg("case %zu, line %lld: %s", k, error.line, error.message);
        }
    }
}

// ---- cells ----

// Coordinates of a pair are inverted to the same coordinates, in every system of both dimensions.
static void inverse(void **state) {
    (void)state;
    uint64_t random = 7;
    for (int k = 0; k < 2000; k++) {
        const gonio_vec3 wi = gonio_direction(acos(gonio_random_next(&random)),
                                              2 * GONIO_PI * gonio_random_next(&random)),
                         wo = gonio_direction(acos(gonio_random_next(&random)),
                                              2 * GONIO_PI * gonio_random_next(&random));
        for (int s = 0; s < GONIO_COORDINATES; s++) {
            for (int dims = 3; dims <= 4; dims++) {
                double x[4] = {0}, y[4] = {0};
                gonio_vec3 a, b;
                void (*map)(gonio_coordinates, gonio_vec3, gonio_vec3, double *) =
                    dims == 3 ? gonio_coordinates_isotropic : gonio_coordinates_anisotropic;
                map((gonio_coordinates)s, wi, wo, x);
                // Beyond the stretch's limit places are held: no pair comes back.
                if (!gonio_needs_pair_at((gonio_coordinates)s, dims == 3, x, &a, &b)) {
                    assert_true(fmin(wi.z, wo.z) < 1e-3 || hypot(2 * x[0] - 1, 2 * x[1] - 1) > 1 - 1e-9);
                    continue;
                }
                map((gonio_coordinates)s, a, b, y);
                for (int d = 0; d < dims; d++) {
                    assert_near(x[d], y[d], 1e-6);
                }
            }
        }
    }
}

// Cells that no pair reaches are told apart, and none of them is asked for.
static void unreachable(void **state) {
    (void)state;
    gonio_needs *needs = collect(PLANE, 2, 0, 2);
    for (int s = 0; s < GONIO_COORDINATES; s++) {
        for (int level = 1; level <= 4; level++) {
            gonio_needs_count c;
            assert_int_equal(gonio_needs_count_cells(needs, 0, (gonio_coordinates)s, level, &c, NULL), GONIO_OK);
            assert_int_equal(c.cells, (size_t)1 << 3 * level);
            assert_true(c.asked > 0 && c.asked <= c.reachable && c.reachable <= c.cells);
            assert_true(c.reachable < c.cells || level < 3);
        }
    }
    // Nusselt's discs: pi/4 of a square of cells, of half of the light's axis, and the cells at their rims.
    gonio_needs_count c;
    assert_int_equal(gonio_needs_count_cells(needs, 0, GONIO_NUSSELT, 6, &c, NULL), GONIO_OK);
    assert_near((double)c.reachable / (double)c.cells, GONIO_PI / 8, 0.03);
    // Behind the surface nothing is asked for.
    assert_true(gonio_needs_weight(needs, 0, (gonio_vec3){0, 0, -1}, (gonio_vec3){0, 0, 1}) == 0);
    gonio_needs_free(needs);
}

static void weights(void **state) {
    (void)state;
    gonio_needs *needs = collect(PLANE, 2, 0, 1);
    gonio_needs_facts facts;
    gonio_needs_describe(needs, 0, &facts);
    double mean = 0;
    for (size_t i = 0; i < facts.cells; i++) {
        const gonio_need *c = gonio_needs_cells(needs, 0) + i;
        mean += c->squares * gonio_needs_weight(needs, 0, c->wi, c->wo) / facts.squares;
    }
    assert_near(mean, 1, 1e-9);
    // Light straight back from grazing: this camera never sees it.
    const gonio_vec3 grazing = gonio_direction(gonio_radians(85), 0);
    assert_true(gonio_needs_weight(needs, 0, grazing, grazing) == 0);
    gonio_needs_free(needs);
}

// ---- plans ----

static double by_theta(void *context, const gonio_pair *from, const gonio_pair *to, double value) {
    (void)context;
    assert_true(value > 0);
    return 1 + (from != NULL ? fabs(from->theta_o - to->theta_o) : 0);
}

static void plans(void **state) {
    (void)state;
    gonio_needs *needs = collect(PLANE, 2, 0, 2);
    gonio_needs_plan_options o;
    gonio_plan *many, *few;
    gonio_needs_plan_report far, near;
    gonio_needs_plan_options_default(&o);
    o.seconds = by_theta;
    o.poses = 40;
    o.threads = 3;
    assert_int_equal(gonio_needs_plan(needs, 0, &o, &many, &far, NULL), GONIO_OK);
    o.threads = 1;
    assert_int_equal(gonio_needs_plan(needs, 0, &o, &few, &near, NULL), GONIO_OK);
    assert_int_equal(many->n, 40);
    assert_memory_equal(many->poses, few->poses, 40 * sizeof *few->poses);
    assert_true(far.after < 0.5 * far.before && far.after > 0);
    int asked = 0;
    for (size_t i = 0; i < many->n; i++) {
        const gonio_pair *p = &many->poses[i];
        assert_true(p->theta_i <= gonio_radians(85.0001) && p->theta_o <= gonio_radians(85.0001));
        asked += gonio_needs_weight(needs, 0, gonio_direction(p->theta_i, p->phi_i),
                                    gonio_direction(p->theta_o, p->phi_o)) > 0;
    }
    // A tenth is spread out.
    assert_true(asked >= 36);
    gonio_plan_free(many);
    gonio_plan_free(few);
    // More poses than there are cells: the rest is spread out too.
    gonio_needs *small = collect(ROW, 1, 4, 1);
    assert_int_equal(gonio_needs_plan(small, 0, &o, &few, NULL, NULL), GONIO_OK);
    assert_int_equal(few->n, 40);
    gonio_plan_free(few);
    gonio_needs_free(small);
    gonio_needs_free(needs);
}

static void plan_texts(void **state) {
    (void)state;
    gonio_needs *needs = collect(PLANE, 2, 0, 1);
    gonio_plan *plan;
    assert_int_equal(gonio_needs_save(needs, "n.needs", NULL), GONIO_OK);
    gonio_needs_free(needs);
    assert_int_equal(gonio_plan_resolve("scene:n.needs,N=7,material=paint,explore=0", 1, NULL, NULL, &plan, NULL, NULL),
                     GONIO_OK);
    assert_int_equal(plan->n, 7);
    gonio_plan_free(plan);
    assert_int_equal(gonio_plan_resolve("nusselt:5", 1, NULL, NULL, &plan, NULL, NULL), GONIO_OK);
    assert_int_equal(plan->n, 5);
    gonio_plan_free(plan);
    static const struct {
        const char *text, *says;
        gonio_status status;
    } bad[] = {{"scene:", "expected scene:NEEDS", GONIO_E_USAGE},
               {"scene:n.needs,N=0", "'N=0'", GONIO_E_USAGE},
               {"scene:n.needs,N=2.5", "'N=2.5'", GONIO_E_USAGE},
               {"scene:n.needs,poses=3", "'poses=3'", GONIO_E_USAGE},
               {"scene:n.needs,explore=2", "'explore=2'", GONIO_E_USAGE},
               {"scene:n.needs,material=tin", "no material 'tin'; it has paint", GONIO_E_USAGE},
               {"scene:none.needs", "cannot open it", GONIO_E_INPUT},
               {"scene:s.ini", "not a file of needs", GONIO_E_INPUT}};
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        gonio_error error = {.line = -1};
        assert_int_equal(gonio_plan_resolve(bad[k].text, 1, NULL, NULL, &plan, NULL, &error), bad[k].status);
        if (strstr(error.message, bad[k].says) == NULL) {
            fail_msg("%s: %s", bad[k].text, error.message);
        }
    }
}

// ---- bricks ----

static gonio_samples *told_of(const gonio_model *model, const gonio_needs *needs) {
    gonio_samples *told;
    gonio_plan *plan;
    gonio_needs_facts facts;
    const double none = 0;
    gonio_needs_describe(needs, 0, &facts);
    assert_int_equal(gonio_samples_new(1, true, &told, NULL), GONIO_OK);
    told->isotropic = true;
    assert_int_equal(gonio_plan_make("nusselt:600,theta_max=90", 1, &plan, NULL), GONIO_OK);
    for (size_t i = 0; i < facts.cells + plan->n; i++) {
        const gonio_need *c = gonio_needs_cells(needs, 0) + i;
        const gonio_pair p = i < facts.cells ? gonio_pair_from_vectors(c->wi, c->wo) : plan->poses[i - facts.cells];
        const double value = gonio_model_eval_channel(model, gonio_direction(p.theta_i, p.phi_i),
                                                      gonio_direction(p.theta_o, p.phi_o), 0),
                     sigma = 1e-4 * value;
        assert_int_equal(gonio_samples_add(told, &p, &value, &sigma, &none, NULL), GONIO_OK);
    }
    gonio_plan_free(plan);
    return told;
}

// Mean of |ln| of model over truth at the cells; what sigma says of it in *sigma.
static double off_at_cells(const gonio_model *model, const gonio_model *truth, const gonio_needs *needs,
                           double *sigma) {
    gonio_needs_facts facts;
    double sum = 0;
    gonio_needs_describe(needs, 0, &facts);
    *sigma = 0;
    for (size_t i = 0; i < facts.cells; i++) {
        const gonio_need *c = gonio_needs_cells(needs, 0) + i;
        const double f = gonio_model_eval_channel(truth, c->wi, c->wo, 0);
        double s = 0;
        gonio_model_sigma(model, c->wi, c->wo, &s);
        sum += fabs(gonio_model_eval_channel(model, c->wi, c->wo, 0) / f - 1) / (double)facts.cells;
        *sigma += s / f / (double)facts.cells;
    }
    return sum;
}

// More bricks, less error; where they are, sigma is small, and elsewhere it says what falls back.
static void bricks(void **state) {
    (void)state;
    gonio_needs *needs = collect(PLANE, 2, 0, 1);
    gonio_model *truth, *model;
    gonio_needs_facts facts;
    gonio_needs_describe(needs, 0, &facts);
    assert_int_equal(gonio_model_from_spec("ward:rho_d=0.3,rho_s=0.1,alpha=0.2", &truth, NULL), GONIO_OK);
    gonio_samples *told = told_of(truth, needs);
    for (int hashed = 0; hashed < 2; hashed++) {
        const gonio_needed_form form = {GONIO_HALF_VECTOR, GONIO_LOG, 1, 4};
        const gonio_storage storage = hashed ? GONIO_STORAGE_JENKINS : GONIO_STORAGE_FLOAT;
        gonio_needed *needed;
        double before = INFINITY, off, sigma;
        assert_int_equal(
            gonio_needed_new(told, gonio_needs_cells(needs, 0), facts.cells, hashed, &form, 2, &needed, NULL),
            GONIO_OK);
        const size_t all = gonio_needed_units(needed);
        assert_true(all > 4);
        for (size_t k = 0; k <= 2; k++) {
            assert_int_equal(gonio_needed_model(needed, k * all / 2, storage, &model, NULL), GONIO_OK);
            off = off_at_cells(model, truth, needs, &sigma);
            assert_true(off < 1.05 * before);
            before = k == 0 ? off / 4 : off;
            gonio_model_free(model);
        }
        assert_true(off < 0.01);
        assert_int_equal(gonio_needed_finish(needed, all, storage, &model, NULL), GONIO_OK);
        off_at_cells(model, truth, needs, &sigma);
        assert_true(sigma < 0.05);
        // Far from all that is asked: no garbage, and a sigma that covers the error.
        const gonio_vec3 wi = gonio_direction(gonio_radians(80), 0), wo = gonio_direction(gonio_radians(75), 0.4);
        double s, f = gonio_model_eval_channel(model, wi, wo, 0), t = gonio_model_eval_channel(truth, wi, wo, 0);
        assert_true(gonio_model_sigma(model, wi, wo, &s));
        assert_true(f > 0 && fabs(f - t) < 3 * s && s > 0.005 * t);
        // And so it is in a file.
        assert_int_equal(gonio_model_save(model, "m.gonio", NULL), GONIO_OK);
        gonio_model *again;
        double r;
        assert_int_equal(gonio_model_open("m.gonio", &again, NULL), GONIO_OK);
        assert_true(gonio_model_sigma(again, wi, wo, &r) && r == s);
        assert_int_equal(again->bytes, model->bytes);
        gonio_model_free(again);
        gonio_model_free(model);
        gonio_needed_free(needed);
    }
    gonio_samples_free(told);
    gonio_model_free(truth);
    gonio_needs_free(needs);
}

static char folder[64];

static int enter(void **state) {
    (void)state;
    const char *parent = getenv("TMPDIR");
    snprintf(folder, sizeof folder, "%.40s/gonio-needs-XXXXXX", parent != NULL ? parent : "/tmp");
    return mkdtemp(folder) != NULL && chdir(folder) == 0 ? 0 : -1;
}

static int leave(void **state) {
    (void)state;
    static const char *const names[] = {"s.ini", "square.obj", "n.needs", "b.needs", "m.gonio"};
    for (size_t k = 0; k < sizeof names / sizeof *names; k++) {
        unlink(names[k]);
    }
    return chdir("/") == 0 ? rmdir(folder) : -1;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_line),  cmocka_unit_test(promises),        cmocka_unit_test(same_for_any_threads),
        cmocka_unit_test(bounded),   cmocka_unit_test(file_round_trip), cmocka_unit_test(damage_is_seen),
        cmocka_unit_test(bad_lines), cmocka_unit_test(inverse),         cmocka_unit_test(unreachable),
        cmocka_unit_test(weights),   cmocka_unit_test(plans),           cmocka_unit_test(plan_texts),
        cmocka_unit_test(bricks),
    };
    return cmocka_run_group_tests(tests, enter, leave);
}
