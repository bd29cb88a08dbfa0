// SPDX-License-Identifier: BSD-3-Clause
// Poses that reach over the sample's edge: what is flagged, held against what the simulated lamp really lights.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "gonio/session_calibration.h"
#include "sim/scene.h"
#include "tests/unit/near.h"

static const gonio_camera_info camera = {.width = 640, .height = 512, .fx = 10000, .fy = 10000};

static gonio_rig_facts facts_of(double size_mm, double spot_mm) {
    return (gonio_rig_facts){.light_distance_mm = 1000,
                             .camera_distance_mm = 1000,
                             .region_radius_mm = 5,
                             .sample_mm = {size_mm, size_mm},
                             .light_spot_mm = spot_mm};
}

static gonio_pair pose(double ti, double pi, double to, double po) {
    return (gonio_pair){gonio_radians(ti), gonio_radians(pi), gonio_radians(to), gonio_radians(po)};
}

static int edges(double size_mm, double spot_mm, gonio_pair p) {
    const gonio_rig_facts facts = facts_of(size_mm, spot_mm);
    char text[256];
    const int flags = gonio_calib_edges(&camera, &facts, &p, text);
    assert_true((flags != 0) == (text[0] != '\0'));
    return flags;
}

// How far the simulated lamp lights the table along +x or +y, seen from straight above.
static double lit_reach(double theta_deg, double spot_mm, bool along_y) {
    sim_settings settings;
    gonio_sim_settings_default(&settings);
    settings.rig.light_spot_mm = spot_mm;
    settings.sample.plate_mm = 1e4;
    gonio_model *model;
    assert_int_equal(gonio_model_from_spec("lambert:rho=0.5", &model, NULL), GONIO_OK);
    double reach = 0;
    for (int turned = 0; turned < 2; turned++) { // toward the lamp and away from it
        sim_scene scene = {.target = GONIO_TARGET_SAMPLE, .sample = model};
        const double angles[GONIO_AXES] = {gonio_radians(theta_deg), turned ? GONIO_PI : 0, 0, 0};
        gonio_sim_scene_place(&scene, &settings, NULL, angles);
        double low = 0, high = 5;
        for (int k = 0; k < 50; k++) {
            const double middle = (low + high) / 2; // of the image plane: +x of the table points down
            *(gonio_sim_scene_radiance(&scene, along_y ? middle : 0, along_y ? 0 : middle, 0) > 0 ? &low : &high) =
                middle;
        }
        reach = fmax(reach, 1000 * low);
    }
    gonio_model_free(model);
    return reach;
}

// The spot is flagged exactly where the lamp lights beyond the sample. Across the beam it is as wide as stated.
static void test_spill_is_where_the_lamp_lights(void **state) {
    (void)state;
    for (int theta = 0; theta <= 85; theta += 17) {
        const double reach = lit_reach(theta, 12, false);
        assert_int_equal(edges(2 * reach * 1.001, 12, pose(theta, 0, 0, 0)), 0);
        assert_int_equal(edges(2 * reach * 0.999, 12, pose(theta, 0, 0, 0)), GONIO_EDGE_SPILL);
        assert_near(lit_reach(theta, 12, true), 12, 0.01 * 12);
    }
    // 11-fold at 85 deg, and more on the far side of a diverging beam.
    assert_true(lit_reach(85, 12, false) > 12 / cos(gonio_radians(85)));
    // Turned by 45 deg an ellipse reaches less far along x and y.
    const double reach = lit_reach(80, 12, false);
    assert_int_equal(edges(2 * reach * 0.9, 12, pose(80, 45, 0, 0)), 0);
}

static void test_region_beyond_the_edge(void **state) {
    (void)state;
    assert_int_equal(edges(11, 0, pose(10, 0, 20, 0)), 0);
    assert_int_equal(edges(9.9, 0, pose(10, 0, 20, 0)), GONIO_EDGE_REGION);
    // A pixel of 0.1 mm covers 1.15 mm at 85 deg: half of it at either side.
    assert_int_equal(edges(11.1, 0, pose(10, 0, 85, 0)), GONIO_EDGE_REGION);
    assert_int_equal(edges(11.2, 0, pose(10, 0, 85, 0)), 0);
    assert_int_equal(edges(0, 0, pose(80, 0, 89, 0)), 0); // its size is not known
}

static void test_a_small_spot_is_named(void **state) {
    (void)state;
    char text[256];
    const gonio_rig_facts facts = facts_of(50, 4);
    const gonio_pair p = pose(30, 0, 0, 0);
    assert_int_equal(gonio_calib_edges(&camera, &facts, &p, text), GONIO_EDGE_UNLIT);
    assert_non_null(strstr(text, "does not cover"));
    gonio_rig_facts sphere = facts_of(1, 1);
    sphere.sphere = true;
    assert_int_equal(gonio_calib_edges(&camera, &sphere, &p, text), 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_spill_is_where_the_lamp_lights),
        cmocka_unit_test(test_region_beyond_the_edge),
        cmocka_unit_test(test_a_small_spot_is_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
