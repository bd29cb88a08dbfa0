// SPDX-License-Identifier: BSD-3-Clause
// What one ray of the camera sees, against the BRDF itself and against geometry written out anew.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "sim/scene.h"
#include "tests/unit/near.h"

#define ANISOTROPIC "ward:rho_d=0.3,rho_s=0.2,alpha_x=0.1,alpha_y=0.3"

static gonio_model *model_of(const char *spec) {
    gonio_model *model;
    assert_int_equal(gonio_model_from_spec(spec, &model, NULL), GONIO_OK);
    return model;
}

static sim_scene place(const sim_settings *settings, const gonio_model *model, double ti, double pi, double to,
                       double po) {
    sim_scene scene = {.target = GONIO_TARGET_SAMPLE, .sample = model};
    const double angles[GONIO_AXES] = {gonio_radians(ti), gonio_radians(pi), gonio_radians(to), gonio_radians(po)};
    gonio_sim_scene_place(&scene, settings, NULL, angles);
    return scene;
}

// On the axis a flat sample shows pi f_r cos(theta_i) of the pose, azimuths included.
static void axis_shows_the_pose(void **state) {
    (void)state;
    sim_settings settings;
    gonio_sim_settings_default(&settings);
    gonio_model *model = model_of(ANISOTROPIC);
    const double poses[][4] = {{0, 0, 0, 0},      {30, 0, 30, 180},  {60, 90, 55, -80},  {10, -170, 80, 45},
                               {80, 33, 79, 200}, {89, 10, 89, 191}, {45, 120, 0.01, 77}};
    for (size_t k = 0; k < sizeof poses / sizeof *poses; k++) {
        const double *p = poses[k];
        const sim_scene scene = place(&settings, model, p[0], p[1], p[2], p[3]);
        const gonio_pair pair = {gonio_radians(p[0]), gonio_radians(p[1]), gonio_radians(p[2]), gonio_radians(p[3])};
        double f;
        gonio_model_eval_pair(model, &pair, &f);
        const double expected = GONIO_PI * f * cos(pair.theta_i);
        assert_near(gonio_sim_scene_radiance(&scene, 0, 0, 0), expected, 1e-9 * expected);
    }
    gonio_model_free(model);
}

// Off the axis the point, both directions and the distance change: written out for a camera straight above, where image
// x runs along +y and image y along +x.
static void off_axis_geometry(void **state) {
    (void)state;
    sim_settings settings;
    gonio_sim_settings_default(&settings);
    settings.rig.light_distance_mm = 300;
    settings.rig.camera_distance_mm = 400;
    gonio_model *model = model_of(ANISOTROPIC);
    const sim_scene scene = place(&settings, model, 50, 20, 0, 0);
    const double px = 12, py = -7, d0 = 300, ti = gonio_radians(50), pi = gonio_radians(20);
    const double lx = d0 * sin(ti) * cos(pi) - px, ly = d0 * sin(ti) * sin(pi) - py, lz = d0 * cos(ti);
    const double l = sqrt(lx * lx + ly * ly + lz * lz), c = sqrt(px * px + py * py + 400.0 * 400);
    double f;
    gonio_model_eval(model, (gonio_vec3){lx / l, ly / l, lz / l}, (gonio_vec3){-px / c, -py / c, 400 / c}, &f);
    const double expected = GONIO_PI * f * lz / l * d0 * d0 / l / l;
    assert_near(gonio_sim_scene_radiance(&scene, py / 400, px / 400, 0), expected, 1e-9 * expected);
    // Beyond the plate of 50 mm there is nothing.
    assert_near(gonio_sim_scene_radiance(&scene, 0, 25.1 / 400, 0), 0, 0);
    assert_true(gonio_sim_scene_radiance(&scene, 0, 24.9 / 400, 0) > 0);
    gonio_model_free(model);
}

// On a sphere the normal turns: at the point that faces the camera theta_o is 0 and theta_i the angle between the arms.
// The exact distances are those from the sphere's surface.
static void sphere_geometry(void **state) {
    (void)state;
    sim_settings settings;
    gonio_sim_settings_default(&settings);
    settings.sample.sphere = 1;
    settings.rig.light_distance_mm = 1e5;
    gonio_model *model = model_of("ward:rho_d=0.3,rho_s=0.2,alpha=0.3");
    const sim_scene scene = place(&settings, model, 20, 0, 40, 180);
    const gonio_pair pair = {gonio_radians(60), 0, 0, 0};
    double f;
    gonio_model_eval_pair(model, &pair, &f);
    const double expected = GONIO_PI * f * cos(pair.theta_i);
    assert_near(gonio_sim_scene_radiance(&scene, 0, 0, 0), expected, 1e-3 * expected); // the light is 5000 radii away
    // The mirror point lies half-way between the arms, 30 deg toward the light: up the image, since theta_o falls.
    const double y = -20 * sin(gonio_radians(30)) / (1000 - 20 * cos(gonio_radians(30)));
    assert_true(gonio_sim_scene_radiance(&scene, 0, y, 0) > 5 * expected);
    assert_true(gonio_sim_scene_radiance(&scene, 0, y, 0) > gonio_sim_scene_radiance(&scene, 0.002, y, 0));
    assert_near(gonio_sim_scene_radiance(&scene, 0.0199, 0, 0) > 0, 1, 0);
    assert_near(gonio_sim_scene_radiance(&scene, 0.0201, 0, 0), 0, 0);
    gonio_model_free(model);
}

static void targets(void **state) {
    (void)state;
    sim_settings settings;
    gonio_sim_settings_default(&settings);
    settings.sample.sphere = 1; // the reference is a flat panel all the same
    gonio_model *model = model_of("lambert:rho=0.5");
    sim_scene scene = place(&settings, model, 30, 0, 0, 0);
    scene.target = GONIO_TARGET_REFERENCE;
    scene.reflectance[0] = 0.97;
    scene.reflectance[2] = 0.9;
    assert_near(gonio_sim_scene_radiance(&scene, 0, 0, 0), 0.97 * cos(gonio_radians(30)), 1e-12);
    assert_near(gonio_sim_scene_radiance(&scene, 0, 0, 2), 0.9 * cos(gonio_radians(30)), 1e-12);
    assert_true(gonio_sim_scene_radiance(&scene, 0, 0.049, 0) > 0);
    assert_near(gonio_sim_scene_radiance(&scene, 0, 0.051, 0), 0, 0);
    scene.target = GONIO_TARGET_TRAP;
    assert_near(gonio_sim_scene_radiance(&scene, 0, 0, 0), 0, 0);
    gonio_model_free(model);
}

static void behind_the_plate_is_dark(void **state) {
    (void)state;
    sim_settings settings;
    gonio_sim_settings_default(&settings);
    gonio_model *model = model_of("lambert:rho=0.5");
    const double poses[][2] = {{90.01, 0}, {0, 90.01}, {95, 95}};
    for (int k = 0; k < 3; k++) {
        const sim_scene scene = place(&settings, model, poses[k][0], 0, poses[k][1], 180);
        assert_near(gonio_sim_scene_radiance(&scene, 0, 0, 0), 0, 0);
    }
    gonio_model_free(model);
}

// The mean of cos / d^2 over a disc of radius R at distance d, of points that shine alike in every direction:
// (2 d^3 / R^2) (1/d - 1/sqrt(d^2 + R^2)); 32 points come within 1 %.
static void a_large_lamp(void **state) {
    (void)state;
    sim_settings settings;
    gonio_sim_settings_default(&settings);
    settings.rig.light_distance_mm = 200;
    settings.rig.light_radius_mm = 150;
    gonio_model *model = model_of("lambert:rho=1");
    const sim_scene scene = place(&settings, model, 0, 0, 0, 0);
    const double d = 200, r = 150, expected = 2 * d * d * d / r / r * (1 / d - 1 / sqrt(d * d + r * r));
    assert_near(gonio_sim_scene_radiance(&scene, 0, 0, 0), expected, 0.01 * expected);
    gonio_model_free(model);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(axis_shows_the_pose),      cmocka_unit_test(off_axis_geometry),
        cmocka_unit_test(sphere_geometry),          cmocka_unit_test(targets),
        cmocka_unit_test(behind_the_plate_is_dark), cmocka_unit_test(a_large_lamp),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
