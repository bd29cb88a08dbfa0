// SPDX-License-Identifier: BSD-3-Clause
// Scenes' pictures against closed forms, and the files that they are made of.
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

#include "gonio/scene.h"
#include "tests/unit/near.h"

static void put(const char *name, const char *text) {
    FILE *file = fopen(name, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

#define SQUARE "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
#define CAMERA "[camera]\neye = 0/0/4\nfov = 20\n[image]\nwidth = 8\nheight = 8\n"

static gonio_scene *open_text(const char *text) {
    gonio_scene *scene;
    gonio_error error = {.line = -1};
    put("s.ini", text);
    if (gonio_scene_open("s.ini", &scene, &error) != GONIO_OK) {
        fail_msg("%s:%lld: %s", error.file, error.line, error.message);
    }
    return scene;
}

static gonio_picture *render(const gonio_scene *scene, int samples, bool interreflection, int threads) {
    gonio_scene_options options;
    gonio_picture *picture;
    gonio_scene_options_default(scene, &options);
    options.samples = samples;
    options.interreflection = interreflection;
    options.threads = threads;
    assert_int_equal(gonio_scene_render(scene, &options, &picture, NULL, NULL), GONIO_OK);
    return picture;
}

static gonio_picture *picture_of(const char *text, int samples, bool interreflection) {
    gonio_scene *scene = open_text(text);
    gonio_picture *picture = render(scene, samples, interreflection, 1);
    gonio_scene_free(scene);
    return picture;
}

static double at(const gonio_picture *p, int x, int y, int c) { return (double)p->rgb[3 * (y * p->width + x) + c]; }

// Lambert under both kinds of small lights: rho / pi times intensity cos / d^2, or irradiance times the cosine.
static void small_lights(void **state) {
    (void)state;
    put("square.obj", SQUARE "f 1/1 2/2 3/3 4/4\n");
    gonio_picture *p = picture_of(CAMERA "[material a]\nmodel = lambert:rho=0.5/0.25/1\n[mesh]\nfile = square.obj\n"
                                         "[light p]\nkind = point\nposition = 0.5/0/2\nintensity = 3\n"
                                         "[light d]\ntoward = 0/3/4\nintensity = 2/1/0\n",
                                  1024, false);
    const double side = 2 * 4 * tan(gonio_radians(10)) / 8;
    for (int y = 2; y < 6; y++) {
        for (int x = 2; x < 6; x++) {
            // The mean over the pixel is its middle's to second order, as both lights vary slowly.
            const double dx = (x + 0.5 - 4) * side - 0.5, dy = (4 - y - 0.5) * side, d2 = dx * dx + dy * dy + 4;
            const double point = 3 * 2 / (d2 * sqrt(d2));
            const double rho[3] = {0.5, 0.25, 1}, sun[3] = {2 * 0.8, 0.8, 0};
            for (int c = 0; c < 3; c++) {
                const double expected = rho[c] / GONIO_PI * (point + sun[c]);
                assert_near(at(p, x, y, c), expected, 3e-3 * expected);
            }
        }
    }
    gonio_picture_free(p);
}

// Under the same light all around, a place that sees all of it shows the albedo toward the eye; a rough one by both
// ways of drawing a direction, a narrow lobe mostly by its own.
static void furnace(void **state) {
    (void)state;
    put("square.obj", SQUARE "f 1/1 2/2 3/3 4/4\n");
    const char *const models[] = {"lambert:rho=0.7", "ggx:rho_d=0.2,rho_s=0.3,alpha=0.3",
                                  "ward:rho_d=0.1,rho_s=0.2,alpha=0.05"};
    for (int k = 0; k < 3; k++) {
        char text[1000];
        snprintf(text, sizeof text,
                 "[camera]\neye = 0/-2/2\nfov = 5\n[image]\nwidth = 2\nheight = 2\n[mesh]\nfile = square.obj\n"
                 "[material m]\nmodel = %s\n[light]\nkind = environment\nintensity = 2\nvisible = 0\n",
                 models[k]);
        gonio_picture *p = picture_of(text, 4096, false);
        gonio_model *model;
        assert_int_equal(gonio_model_from_spec(models[k], &model, NULL), GONIO_OK);
        double albedo = 0;
        const int n = 1 << 14;
        const gonio_vec3 wo = {0, -sqrt(0.5), sqrt(0.5)};
        for (int i = 0; i < n; i++) {
            gonio_vec3 wi;
            double f;
            const double u[2] = {(i + 0.5) / n, fmod(i * 0.6180339887498949, 1)};
            const double pdf = gonio_model_sample(model, wo, u, &wi, &f);
            albedo += f * wi.z / pdf / n;
        }
        const double mean = (at(p, 0, 0, 0) + at(p, 1, 0, 0) + at(p, 0, 1, 0) + at(p, 1, 1, 0)) / 4;
        assert_near(mean, 2 * albedo, 0.005 * 2 * albedo);
        gonio_model_free(model);
        gonio_picture_free(p);
    }
}

// A white cup loses no light: with interreflection it shows what comes in, whatever the number of bounces; without,
// less.
static void cup(void **state) {
    (void)state;
    put("cup.obj", "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n"
                   "f 1 2 3 4\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n");
    const char *text = "[camera]\neye = 0/0/9\nfov = 8\n[image]\nwidth = 2\nheight = 2\n[material w]\n"
                       "model = lambert:rho=1\n[mesh]\nfile = cup.obj\n[light]\nkind = environment\n";
    gonio_picture *once = picture_of(text, 1024, false), *often = picture_of(text, 4096, true);
    for (int i = 0; i < 4; i++) {
        assert_true(at(once, i % 2, i / 2, 1) < 0.75);
        assert_near(at(often, i % 2, i / 2, 1), 1, 0.02);
    }
    gonio_picture_free(once);
    gonio_picture_free(often);
}

// Half the picture's sky shines: the drawing follows it, and shadows are cast by what stands there.
static void environment_picture(void **state) {
    (void)state;
    put("square.obj", SQUARE "f 1/1 2/2 3/3 4/4\n");
    FILE *file = fopen("sky.pfm", "wb");
    fprintf(file, "Pf\n4 2\n-1\n");
    const float rows[8] = {0, 0, 0, 0, 0, 8, 0, 0}; // from the bottom: only the upper row's second quarter shines
    fwrite(rows, sizeof *rows, 8, file);
    fclose(file);
    // Columns 1 and 2 of 4 lie left and right of -z; with up = z about +x: azimuths 0 to 90 deg lie to the left of it.
    gonio_picture *p = picture_of("[camera]\neye = 0/0/4\nfov = 5\n[image]\nwidth = 2\nheight = 2\n[mesh]\nfile = "
                                  "square.obj\n[material m]\nmodel = lambert:rho=0.5\n[light]\nkind = environment\n"
                                  "file = sky.pfm\nup = z\n",
                                  256, false);
    for (int i = 0; i < 4; i++) { // a quarter of the cosine-weighted hemisphere, pi
        assert_near(at(p, i % 2, i / 2, 0), 0.5 * 8 / 4, 0.01);
    }
    gonio_picture_free(p);
    put("wall.obj", "v -9 0.5 0\nv 9 0.5 0\nv 9 0.5 1000\nv -9 0.5 1000\nf 1 2 3 4\n"); // hides what lies toward +y
    p = picture_of("[camera]\neye = 0/0/4\ntarget = 0.001/0/0\nfov = 1\n[image]\nwidth = 1\nheight = 1\n[mesh a]\n"
                   "file = square.obj\n[mesh b]\nfile = wall.obj\nmove = 0/-0.4/0\n[light]\nkind = environment\n"
                   "file = sky.pfm\nup = z\n",
                   256, false);
    assert_true(at(p, 0, 0, 0) < 0.3);
    gonio_picture_free(p);
}

static void count_uses(void *context, const gonio_scene_use *use) {
    double *sum = context;
    double f = 0;
    gonio_model *model = *(gonio_model **)(void *)(sum + 8);
    gonio_model_eval(model, use->wi, use->wo, &f);
    sum[use->pixel] += f * use->weight[0];
}

// What a scene asks of its materials adds up to the picture; threads change no bit of it.
static void uses_and_threads(void **state) {
    (void)state;
    put("square.obj", SQUARE "f 1/1 2/2 3/3 4/4\n");
    const char *spec = "ward:rho_d=0.1,rho_s=0.2,alpha=0.2";
    gonio_scene *scene =
        open_text("[camera]\neye = 0/-2/2\nfov = 30\n[image]\nwidth = 4\nheight = 2\nsamples = 32\n"
                  "[mesh]\nfile = square.obj\n[material m]\nmodel = ward:rho_d=0.1,rho_s=0.2,alpha=0.2\n"
                  "albedo = 0.5\n[light e]\nkind = environment\nvisible = 0\n[light d]\n");
    struct {
        double sums[8];
        gonio_model *model;
    } got = {.model = NULL};
    assert_int_equal(gonio_model_from_spec(spec, &got.model, NULL), GONIO_OK);
    gonio_scene_options options;
    gonio_scene_options_default(scene, &options);
    options.interreflection = true;
    options.threads = 1;
    options.use = count_uses;
    options.use_context = &got;
    gonio_picture *p, *q;
    assert_int_equal(gonio_scene_render(scene, &options, &p, NULL, NULL), GONIO_OK);
    for (int i = 0; i < 8; i++) {
        assert_near(got.sums[i], at(p, i % 4, i / 4, 0), 1e-5 * got.sums[i]);
    }
    q = render(scene, 32, true, 3);
    assert_memory_equal(p->rgb, q->rgb, 8 * 3 * sizeof *p->rgb);
    gonio_picture_free(p);
    gonio_picture_free(q);
    gonio_model_free(got.model);
    gonio_scene_free(scene);
}

// A face's own material, a map of materials, a map of albedo; v = 0 is the picture's bottom.
static void materials(void **state) {
    (void)state;
    put("two.obj", "v -1 -1 0\nv 0 -1 0\nv 0 1 0\nv -1 1 0\nv 1 -1 0\nv 1 1 0\n"
                   "usemtl green\nf 1 2 3 4\nusemtl else\nf 2 5 6 3\n");
    const char *rest = "[camera]\neye = 0/0/4\nfov = 5\n[image]\nwidth = 2\nheight = 2\n[light]\n"
                       "[material first]\nmodel = lambert:rho=0.1\n"
                       "[material green]\nmodel = lambert:rho=0/1/0\n[material blue]\nmodel = lambert:rho=0/0/1\n";
    char text[2000];
    snprintf(text, sizeof text, "%s[mesh]\nfile = two.obj\nmaterial = blue\n", rest);
    gonio_picture *p = picture_of(text, 4, false);
    assert_near(at(p, 0, 0, 1), 1 / GONIO_PI, 1e-6);
    assert_near(at(p, 1, 0, 2), 1 / GONIO_PI, 1e-6);
    assert_near(at(p, 1, 0, 1), 0, 0);
    gonio_picture_free(p);
    put("square.obj", SQUARE "f 1/1 2/2 3/3 4/4\n");
    FILE *file = fopen("albedo.pfm", "wb");
    fprintf(file, "PF\n2 2\n-1\n");
    const float rows[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1}; // from the bottom: red green, blue white
    fwrite(rows, sizeof *rows, 12, file);
    fclose(file);
    snprintf(text, sizeof text,
             "%s[material m]\nmodel = lambert:rho=1\nalbedo_map = albedo.pfm\n[mesh]\n"
             "file = square.obj\nmaterial = m\n",
             rest);
    // The camera's four pixels lie around the middle, where the four texels are mixed alike; look at the corners.
    memcpy(strstr(text, "fov = 5"), "fov =25", 7);
    p = picture_of(text, 64, false);
    assert_true(at(p, 0, 1, 0) > 4 * at(p, 0, 1, 1) / 3 && at(p, 1, 1, 1) > 4 * at(p, 1, 1, 0) / 3);
    assert_true(at(p, 0, 0, 2) > 4 * at(p, 0, 0, 0) / 3 && at(p, 1, 0, 0) > 0.1);
    gonio_picture_free(p);
}

// ---- what is refused ----

#define GOOD                                                                                                           \
    "[camera front]\neye = 0/-2/3\n[camera side]\neye = 3/0/2\n[material lid]\nmodel = lambert:rho=0.5\n"              \
    "[mesh plate]\nfile = square.obj\n[light lamp]\nkind = point\nposition = 0/0/2\n[light sky]\n"                     \
    "kind = environment\n"

// The good scene with one text in another's place.
static void change(const char *from, const char *to) {
    char text[2000];
    const char *at = strstr(GOOD, from);
    assert_non_null(at);
    snprintf(text, sizeof text, "%.*s%s%s", (int)(at - GOOD), GOOD, to, at + strlen(from));
    put("s.ini", text);
}

static void bad_scenes(void **state) {
    (void)state;
    put("square.obj", SQUARE "f 1/1 2/2 3/3 4/4\n");
    put("box.obj", "v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n"
                   "f 1 2 3 4\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n");
    put("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 2\nf 1 1 3\n");
    put("cut.png", "P5");
    put("albedo.pfm", "PF\n1 1\n-1.0\n\001\001\200\177\001\001\001\001\001\001\001\001"); // NaN
    put("sky.pfm", "Pf\n1 1\n1.0\n\277\200\001\001");                                     // -1
    const gonio_picture codes = {2, 1, (float[6]){0, 0, 0, 1, 1, 1}};
    assert_int_equal(gonio_picture_write(&codes, "p.png", 1, NULL), GONIO_OK);
    static const struct {
        const char *from, *to, *file, *text;
        long long line;
    } cases[] = {
        {"[camera side]", "[cam]", "s.ini", "unknown section [cam]; there are image, camera", 3},
        {"[camera front]", "camera", "s.ini", "found 'camera', expected [SECTION]", 1},
        {"[camera front]", "eye = 0", "s.ini", "before any section", 1},
        {"eye = 3", "eyes = 3", "s.ini", "[camera] has no key 'eyes'; it has eye", 4},
        {"3/0/2", "3/0", "s.ini", "eye", 4},
        {"3/0/2", "inf", "s.ini", "eye", 4},
        {"camera side", "camera front", "s.ini", "a second [camera front]; the first stands on line 1", 3},
        {"lambert:rho", "lamb:rho", "s.ini", "[material lid]: ", 5},
        {"lambert:rho=0.5", "none.gonio", "none.gonio", "", -1},
        {"square.obj", "none.obj", "none.obj", "cannot read it", -1},
        {"square.obj", "none.stl", "none.stl", "a mesh is a .ply, .obj", -1},
        {"file = square.obj", "", "s.ini", "[mesh plate] has no file", 7},
        {"file =", "material = tin\nfile =", "s.ini", "no section [material tin]", 7},
        {"file =", "material = lid,  tin \nfile =", "s.ini", "no section [material tin]", 7},
        {"model =", "albedo_map = wood.png\nmodel =", "wood.png", "cannot read it", -1},
        {"model =", "albedo_map = cut.png\nmodel =", "cut.png", "not a PNG picture", -1},
        {"model =", "albedo_map = s.ini\nmodel =", "s.ini", "a picture is a .png", -1},
        {"model =", "albedo_map = albedo.pfm\nmodel =", "albedo.pfm", "column 0, row 0: found", -1},
        {"kind = environment", "kind = environment\nfile = sky.pfm", "sky.pfm", "expected light of 0 or more", -1},
        {"kind = environment", "kind = environment\nfile = sky.hdr", "sky.hdr", "cannot read it", -1},
        {"kind = point", "kind = point\nfile = sky.pfm", "s.ini", "only a light of kind environment", 9},
        {"kind = point", "kind = environment", "s.ini", "a second environment", 12},
        {"kind = point", "toward = 0", "s.ini", "is no direction", 9},
        {"eye = 0/-2/3", "target = 0/-2/3\neye = 0/-2/3", "s.ini", "[camera front]: eye and target are one", 1},
        {"eye = 0/-2/3", "eye = 0/5/0", "s.ini", "up points along the view", 1},
        {"file = square.obj", "file = box.obj\nmove = 0/0/2", "s.ini", "[light lamp] lies inside a closed mesh", 10},
        {"file =", "material_map = p.png\nfile =", "p.png", "code 255 at column 1, row 0; the 1 materials", -1},
        {"file = square.obj", "material_map = p.png\nfile = box.obj", "box.obj", "it has no texture coordinates", -1},
        {"rho=0.5\n[mesh plate]\nfile = square.obj", "rho=1\nalbedo_map = p.png\n[mesh]\nfile = box.obj", "box.obj",
         "it has no texture coordinates, which the albedo_map of [material lid]", -1},
        {"square.obj", "flat.obj", "flat.obj", "its faces have no area", -1},
    };
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        gonio_scene *scene;
        gonio_error error = {.line = -1};
        change(cases[k].from, cases[k].to);
        const gonio_status status = gonio_scene_open("s.ini", &scene, &error);
        if (status != GONIO_E_INPUT || scene != NULL || strcmp(error.file, cases[k].file) != 0 ||
            error.line != cases[k].line || strstr(error.message, cases[k].text) == NULL) {
            fail_msg("'%s' in place of '%s': status %d, %s:%lld: %s", cases[k].to, cases[k].from, status, error.file,
                     error.line, error.message);
        }
    }
}

// Degenerate faces among others, and open edges, are counted.
static void faults_of_meshes(void **state) {
    (void)state;
    put("square.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\nf 1 1 2\n");
    gonio_scene *scene = open_text(GOOD);
    gonio_scene_facts facts;
    gonio_scene_describe(scene, &facts);
    assert_int_equal(facts.degenerate, 1);
    assert_int_equal(facts.open_edges, 4);
    assert_int_equal(facts.triangles, 3);
    gonio_scene_free(scene);
}

// ---- pictures' files ----

static void every_format_keeps_a_picture(void **state) {
    (void)state;
    gonio_scene *scene = open_text("[camera]\neye = 0/-2/2\n[image]\nwidth = 7\nheight = 5\n[mesh]\nfile = square.obj\n"
                                   "[light]\n[light e]\nkind = environment\nintensity = 0.1/0.2/0.3\n");
    gonio_picture *p = render(scene, 4, false, 1), *q;
    gonio_picture_error apart;
    const char *const names[] = {"p.exr", "p.pfm", "p.png"};
    for (int k = 0; k < 3; k++) {
        assert_int_equal(gonio_picture_write(p, names[k], 1, NULL), GONIO_OK);
        assert_int_equal(gonio_picture_read(names[k], &q, NULL), GONIO_OK);
        assert_int_equal(gonio_picture_compare(p, q, 1, &apart, NULL), GONIO_OK);
        assert_near(apart.mae, 0, 0);
        assert_true(k == 2 || memcmp(p->rgb, q->rgb, 7 * 5 * 3 * sizeof *p->rgb) == 0);
        gonio_picture_free(q);
        // Every truncation is refused: of the header, of the rows, of the last byte.
        FILE *file = fopen(names[k], "rb");
        unsigned char bytes[4000];
        const size_t size = fread(bytes, 1, sizeof bytes, file);
        fclose(file);
        for (size_t cut = 0; cut + 16 < size; cut += size / 9 + 1) { // but for what stands behind all pixels
            const char *name = k == 0 ? "cut.exr" : k == 1 ? "cut.pfm" : "cut.png";
            file = fopen(name, "wb");
            fwrite(bytes, 1, cut, file);
            fclose(file);
            if (gonio_picture_read(name, &q, NULL) != GONIO_E_INPUT) {
                fail_msg("%s: read though cut at byte %zu of %zu", name, cut, size);
            }
        }
    }
    gonio_picture_free(p);
    gonio_scene_free(scene);
}

// The three ways in which Radiance has coded rows; exponent 129 makes mantissa 128.5 the value 1.00390625.
static void radiance_rows(void **state) {
    (void)state;
    const unsigned char planes[] = {2, 2, 0, 8, 136, 128, 136, 64, 4, 0, 32, 64, 128, 132, 200, 136, 129};
    const unsigned char flat[] = {128, 64, 0, 129, 1, 1, 1, 3, 128, 64, 255, 129, 1, 1, 1, 3};
    for (int k = 0; k < 2; k++) {
        FILE *file = fopen("r.hdr", "wb");
        fprintf(file, "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=1\n\n-Y 1 +X 8\n");
        fwrite(k == 0 ? planes : flat, 1, k == 0 ? sizeof planes : sizeof flat, file);
        fclose(file);
        gonio_picture *p;
        gonio_error error = {.line = -1};
        if (gonio_picture_read("r.hdr", &p, &error) != GONIO_OK) {
            fail_msg("%d: %s", k, error.message);
        }
        for (int x = 0; x < 8; x++) {
            const double blue[2][8] = {{0, 32, 64, 128, 200, 200, 200, 200}, {0, 0, 0, 0, 255, 255, 255, 255}};
            assert_near(at(p, x, 0, 0), 128.5 / 128, 0);
            assert_near(at(p, x, 0, 1), 64.5 / 128, 0);
            assert_near(at(p, x, 0, 2), (blue[k][x] + 0.5) / 128, 0);
        }
        gonio_picture_free(p);
    }
}

static void picture_errors(void **state) {
    (void)state;
    float a[12] = {0, 0, 0, 1, 1, 1, 0, 0, 0, 1, 1, 1}, b[12];
    memcpy(b, a, sizeof b);
    b[0] = b[1] = 1; // one pixel of four: distance 255 sqrt 2
    const gonio_picture p = {2, 2, a}, q = {2, 2, b}, wide = {4, 1, a};
    gonio_picture_error apart;
    assert_int_equal(gonio_picture_compare(&p, &q, 1, &apart, NULL), GONIO_OK);
    assert_near(apart.mae, 255 * sqrt(2) / 4, 1e-9);
    assert_near(apart.psnr_db, 10 * log10(6), 1e-9); // 12 values, of which 2 are 255 apart
    assert_near(apart.largest, 255, 0);
    assert_near(apart.snr_db, 10 * log10(8.0 / 2), 1e-9);
    assert_int_equal(gonio_picture_compare(&p, &wide, 1, &apart, NULL), GONIO_E_RANGE);
}

static char folder[64];

static int enter(void **state) {
    (void)state;
    const char *parent = getenv("TMPDIR");
    snprintf(folder, sizeof folder, "%.40s/gonio-world-XXXXXX", parent != NULL ? parent : "/tmp");
    return mkdtemp(folder) != NULL && chdir(folder) == 0 ? 0 : -1;
}

static int leave(void **state) {
    (void)state;
    static const char *const names[] = {"s.ini", "square.obj", "box.obj", "flat.obj", "cup.obj", "wall.obj", "two.obj",
                                        "sky.pfm", "albedo.pfm", "p.exr",   "p.pfm",    "p.png",
                                        "cut.exr", "cut.pfm",    "cut.png", "r.hdr"};
    for (size_t k = 0; k < sizeof names / sizeof *names; k++) {
        unlink(names[k]);
    }
    return chdir("/") == 0 ? rmdir(folder) : -1;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(small_lights),
        cmocka_unit_test(furnace),
        cmocka_unit_test(cup),
        cmocka_unit_test(environment_picture),
        cmocka_unit_test(uses_and_threads),
        cmocka_unit_test(materials),
        cmocka_unit_test(bad_scenes),
        cmocka_unit_test(faults_of_meshes),
        cmocka_unit_test(every_format_keeps_a_picture),
        cmocka_unit_test(radiance_rows),
        cmocka_unit_test(picture_errors),
    };
    return cmocka_run_group_tests(tests, enter, leave);
}
