// SPDX-License-Identifier: BSD-3-Clause
// The preview against closed forms: a Lambert sphere's every pixel, exposure, strips, shadows, meshes, tangent frames.
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
#include <png.h>

#include "gonio/render.h"
#include "tests/unit/near.h"

static char folder[] = "/tmp/gonio-render-XXXXXX";

static int set_up(void **state) {
    (void)state;
    return mkdtemp(folder) == NULL;
}

static int tear_down(void **state) {
    (void)state;
    return rmdir(folder); // fails where a test left anything behind, a temporary file too
}

typedef struct picture {
    int width, height;
    unsigned char *rgb;
    gonio_render_result result;
} picture;

static picture take(const char *const *specs, int n, const gonio_render_options *options) {
    gonio_model *models[8];
    gonio_error error = {0};
    picture p;
    char path[64];
    snprintf(path, sizeof path, "%s/picture.png", folder);
    for (int k = 0; k < n; k++) {
        assert_int_equal(gonio_model_from_spec(specs[k], &models[k], NULL), GONIO_OK);
    }
    if (gonio_render((const gonio_model *const *)models, n, options, path, &p.result, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    for (int k = 0; k < n; k++) {
        gonio_model_free(models[k]);
    }
    png_image png = {.version = PNG_IMAGE_VERSION};
    assert_true(png_image_begin_read_from_file(&png, path));
    assert_int_equal(png.format & PNG_FORMAT_FLAG_COLOR, PNG_FORMAT_FLAG_COLOR);
    png.format = PNG_FORMAT_RGB;
    p.width = (int)png.width;
    p.height = (int)png.height;
    p.rgb = malloc(PNG_IMAGE_SIZE(png));
    assert_true(png_image_finish_read(&png, NULL, p.rgb, 0, NULL));
    unlink(path);
    return p;
}

static picture take_one(const char *spec, const gonio_render_options *options) { return take(&spec, 1, options); }

static double code(const picture *p, int column, int row) { return p->rgb[3 * (row * p->width + column)]; }

static double encoded(double linear) {
    const double v = fmin(fmax(linear, 0), 1);
    return 255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1 / 2.4) - 0.055);
}

static gonio_render_options small_options(void) {
    gonio_render_options o;
    gonio_render_options_default(&o);
    o.width = o.height = 64;
    o.exposure_auto = false;
    o.threads = 1;
    return o;
}

// Eye at 4 radii, the outline filling the frame but for 6 %: the ray of a pixel, its nearer hit, rho cos(theta_i).
static double lambert_sphere(double rho, double column, double row, int size, const double light[3], bool *inside) {
    const double half = 1.06 * tan(asin(0.25)), x = (2 * column - size) / size * half,
                 y = (size - 2 * row) / size * half;
    const double a = x * x + y * y + 1, b = -4, root = b * b - a * 15;
    *inside = root > 0;
    if (!*inside) {
        return 0;
    }
    const double s = (-b - sqrt(root)) / a;
    return rho * fmax(0, s * x * light[0] + s * y * light[1] + (4 - s) * light[2]);
}

static void lambert_sphere_pixel_by_pixel(void **state) {
    (void)state;
    gonio_render_options o = small_options();
    o.light_theta_deg = 55;
    o.light_phi_deg = 200;
    o.exposure_ev = 0.5;
    const double ti = gonio_radians(55), phi = gonio_radians(200);
    const double light[3] = {sin(ti) * cos(phi), sin(ti) * sin(phi), cos(ti)};
    picture p = take_one("lambert:rho=0.5", &o);
    assert_int_equal(p.width, 64);
    int compared = 0;
    for (int row = 0; row < 64; row++) {
        for (int column = 0; column < 64; column++) {
            double lowest = 1e9, highest = -1e9;
            bool whole = true, none = true;
            for (int corner = 0; corner < 4; corner++) {
                bool inside;
                const double value =
                    sqrt(2) * lambert_sphere(0.5, column + corner % 2, row + corner / 2, 64, light, &inside);
                lowest = fmin(lowest, value);
                highest = fmax(highest, value);
                whole = whole && inside;
                none = none && !inside;
            }
            if (whole) { // between its corners' values, give or take the curvature and the rounding
                assert_true(code(&p, column, row) >= encoded(lowest - 0.002) - 0.51);
                assert_true(code(&p, column, row) <= encoded(highest + 0.002) + 0.51);
                compared++;
            } else if (none) {
                assert_near(code(&p, column, row), encoded(0.03), 0.5);
            }
        }
    }
    assert_true(compared > 2300); // of pi/4 (64/1.06)^2 = 2863
    free(p.rgb);
}

static void threads_do_not_matter(void **state) {
    (void)state;
    gonio_render_options o = small_options();
    o.exposure_auto = true;
    picture one = take_one("ward:rho_d=0.3/0.2/0.1,rho_s=0.2,alpha=0.15", &o);
    o.threads = 3;
    picture three = take_one("ward:rho_d=0.3/0.2/0.1,rho_s=0.2,alpha=0.15", &o);
    assert_memory_equal(one.rgb, three.rgb, 64 * 64 * 3);
    free(one.rgb);
    free(three.rgb);
}

// One exposure for the strip: half the reflectance is half the light; equal models give equal tiles.
static void a_strip_shares_its_exposure(void **state) {
    (void)state;
    gonio_render_options o = small_options();
    o.exposure_auto = true;
    o.light_theta_deg = 0;
    const char *const specs[] = {"lambert:rho=0.8", "lambert:rho=0.4", "lambert:rho=0.8"};
    picture p = take(specs, 3, &o);
    assert_int_equal(p.width, 3 * 64 + 2 * 4);
    assert_int_equal(p.result.width, p.width);
    assert_int_equal(p.result.height, 64);
    // The brightest percentile, rho = 0.8 straight on, has become 0.9.
    assert_near(p.result.exposure_ev, log2(0.9 / 0.8), 0.01);
    assert_near(code(&p, 32, 32), encoded(0.9), 1);
    assert_near(code(&p, 68 + 32, 32), encoded(0.45), 1);
    assert_near(code(&p, 66, 32), 255, 0);
    for (int row = 0; row < 64; row++) {
        assert_memory_equal(p.rgb + 3 * row * p.width, p.rgb + 3 * (row * p.width + 136), 64 * 3);
    }
    // The exposure that was found, given by hand, makes the same picture.
    o.exposure_auto = false;
    o.exposure_ev = p.result.exposure_ev;
    picture again = take(specs, 3, &o);
    assert_memory_equal(p.rgb, again.rgb, (size_t)(3 * p.width * p.height));
    free(p.rgb);
    free(again.rgb);
}

static void write_text(const char *path, const char *text) {
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

// A floor across the view and a small roof in front of it, lit from the eye's side at 45 deg from the right: the roof's
// shadow falls to the left.
static void shadows_fall(void **state) {
    (void)state;
    char path[64];
    snprintf(path, sizeof path, "%s/scene.obj", folder);
    write_text(path, "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n"
                     "v -0.2 -0.2 0.4\nv 0.2 -0.2 0.4\nv 0.2 0.2 0.4\nv -0.2 0.2 0.4\nf 5 6 7 8\n");
    gonio_render_options o = small_options();
    o.mesh = path;
    o.light_theta_deg = 45;
    o.light_phi_deg = 0;
    picture p = take_one("lambert:rho=0.5", &o);
    const double lit = encoded(0.5 * cos(GONIO_PI / 4));
    assert_near(code(&p, 32, 32), lit, 1); // the roof
    assert_near(code(&p, 23, 32), 0, 0);   // its shadow
    assert_near(code(&p, 42, 32), lit, 1); // the floor on the lit side
    assert_near(code(&p, 23, 14), lit, 1); // and above the shadow
    free(p.rgb);
    unlink(path);
}

// A mesh of a sphere, 128 x 64 faces with smooth normals, makes the sphere's picture.
static void a_fine_mesh_of_a_sphere_is_the_sphere(void **state) {
    (void)state;
    enum { AROUND = 128, DOWN = 64 };
    char path[64];
    snprintf(path, sizeof path, "%s/sphere.obj", folder);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    for (int j = 0; j <= DOWN; j++) {
        for (int i = 0; i < AROUND; i++) {
            const double t = GONIO_PI * j / DOWN, f = 2 * GONIO_PI * i / AROUND;
            fprintf(file, "v %.9g %.9g %.9g\n", 70 * sin(t) * sin(f), 70 * cos(t), 70 * sin(t) * cos(f));
        }
    }
    for (int j = 0; j < DOWN; j++) {
        for (int i = 1; i <= AROUND; i++) {
            const int next = i % AROUND + 1;
            fprintf(file, "f %d %d %d %d\n", j * AROUND + i, (j + 1) * AROUND + i, (j + 1) * AROUND + next,
                    j * AROUND + next);
        }
    }
    fclose(file);
    gonio_render_options o = small_options();
    picture sphere = take_one("ward:rho_d=0.3,rho_s=0.1,alpha=0.3", &o);
    o.mesh = path;
    picture mesh = take_one("ward:rho_d=0.3,rho_s=0.1,alpha=0.3", &o);
    int different = 0;
    for (int i = 0; i < 64 * 64 * 3; i++) {
        different += abs(sphere.rgb[i] - mesh.rgb[i]) > 3;
    }
    assert_in_range(different, 0, 64 * 64 * 3 / 50); // the outline and the terminator
    free(sphere.rgb);
    free(mesh.rgb);
    unlink(path);
}

// The sample's +x runs horizontally around the sphere: a lobe narrow along x and wide along y is tall.
static void anisotropic_highlight_is_upright(void **state) {
    (void)state;
    gonio_render_options o = small_options();
    o.light_theta_deg = 0;
    for (int turned = 0; turned < 2; turned++) {
        picture p = take_one(turned ? "ward:rho_d=0,rho_s=0.2,alpha_x=0.4,alpha_y=0.1"
                                    : "ward:rho_d=0,rho_s=0.2,alpha_x=0.1,alpha_y=0.4",
                             &o);
        const double along = code(&p, 32, 20), across = code(&p, 20, 32);
        assert_true(turned ? across > along + 50 : along > across + 50);
        free(p.rgb);
    }
}

static void impossible_options_are_refused(void **state) {
    (void)state;
    gonio_model *model;
    gonio_error error = {0};
    char path[64];
    snprintf(path, sizeof path, "%s/none.png", folder);
    assert_int_equal(gonio_model_from_spec("lambert:rho=0.5", &model, NULL), GONIO_OK);
    const gonio_model *models[1] = {model};
    const struct {
        int width, n;
        double theta, ev;
        const char *mesh;
        gonio_status status;
    } bad[] = {{15, 1, 40, 0, NULL, GONIO_E_RANGE},
               {100000, 1, 40, 0, NULL, GONIO_E_RANGE},
               {64, 0, 40, 0, NULL, GONIO_E_RANGE},
               {64, 65, 40, 0, NULL, GONIO_E_RANGE},
               {64, 1, NAN, 0, NULL, GONIO_E_RANGE},
               {64, 1, 40, NAN, NULL, GONIO_E_RANGE},
               {64, 1, 40, 0, "/nonexistent/x.ply", GONIO_E_INPUT}};
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        gonio_render_options o = small_options();
        o.width = bad[k].width;
        o.light_theta_deg = bad[k].theta;
        o.exposure_ev = bad[k].ev;
        o.mesh = bad[k].mesh;
        assert_int_equal(gonio_render(models, bad[k].n, &o, path, NULL, &error), bad[k].status);
        assert_int_not_equal(access(path, F_OK), 0);
    }
    gonio_render_options o = small_options();
    assert_int_equal(gonio_render(models, 1, &o, "/nonexistent/x.png", NULL, &error), GONIO_E_IO);
    gonio_model_free(model);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lambert_sphere_pixel_by_pixel),         cmocka_unit_test(threads_do_not_matter),
        cmocka_unit_test(a_strip_shares_its_exposure),           cmocka_unit_test(shadows_fall),
        cmocka_unit_test(a_fine_mesh_of_a_sphere_is_the_sphere), cmocka_unit_test(anisotropic_highlight_is_upright),
        cmocka_unit_test(impossible_options_are_refused),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
