// SPDX-License-Identifier: BSD-3-Clause
// Rays, hits and projections against the convention that rig.h states.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>
#include <math.h>

#include "calib/geometry.h"
#include "calib/opencv.h"
#include "tests/unit/near.h"

static const gonio_rig_facts facts = {.light_distance_mm = 700, .camera_distance_mm = 900};
static const gonio_camera_info camera = {.width = 640,
                                         .height = 512,
                                         .fx = 1500,
                                         .fy = 1490,
                                         .cx = 322,
                                         .cy = 250,
                                         .k1 = -0.25,
                                         .k2 = 0.1,
                                         .p1 = 1e-3,
                                         .p2 = -2e-3,
                                         .k3 = 0.05};

static gonio_pair pose(double ti, double pi, double to, double po) {
    return (gonio_pair){gonio_radians(ti), gonio_radians(pi), gonio_radians(to), gonio_radians(po)};
}

// Seen from straight above with phi_o = 0 the sample's +y lies to the right and its +x downward.
static void test_image_stands_as_rig_h_says(void **state) {
    (void)state;
    const gonio_pair p = pose(30, 0, 0, 0);
    const geometry g = gonio_geometry_of_pose(&facts, &p);
    double centre[2], x[2], y[2];
    assert_true(gonio_geometry_project(&g, &camera, (gonio_vec3){0, 0, 0}, centre));
    assert_true(gonio_geometry_project(&g, &camera, (gonio_vec3){1, 0, 0}, x));
    assert_true(gonio_geometry_project(&g, &camera, (gonio_vec3){0, 1, 0}, y));
    assert_near(centre[0], camera.cx, 1e-9);
    assert_near(centre[1], camera.cy, 1e-9);
    assert_true(x[1] > centre[1] + 1 && fabs(x[0] - centre[0]) < 0.01);
    assert_true(y[0] > centre[0] + 1 && fabs(y[1] - centre[1]) < 0.01);
    assert_false(gonio_geometry_project(&g, &camera, (gonio_vec3){0, 0, 1000}, x)); // behind the camera
}

// Project a point of the sample, undistort the pixel, cast the ray: the same point, at any pose.
static void test_rays_return_to_their_points(void **state) {
    (void)state;
    for (int k = 0; k < 200; k++) {
        const gonio_pair p = pose(10 + k % 70, 2 * k, k % 85, 3.3 * k);
        const geometry g = gonio_geometry_of_pose(&facts, &p);
        const gonio_vec3 at = {20 * sin(k * 1.7), 20 * cos(k * 2.3), 0};
        double pixel[2], point[2];
        geometry_hit hit;
        assert_true(gonio_geometry_project(&g, &camera, at, pixel));
        assert_int_equal(gonio_opencv_undistort(&camera, 1, pixel, point, NULL), GONIO_OK);
        assert_true(gonio_geometry_plate(&g, point[0], point[1], &hit, NULL));
        // At grazing view a millionth of a pixel is magnified by 1/cos(theta_o).
        assert_near(hit.point.x, at.x, 1e-4);
        assert_near(hit.point.y, at.y, 1e-4);
        assert_true(hit.point.z == 0);
    }
}

static void test_centre_has_the_nominal_directions(void **state) {
    (void)state;
    const gonio_pair p = pose(50, 20, 35, 250);
    const geometry g = gonio_geometry_of_pose(&facts, &p);
    geometry_hit hit;
    assert_true(gonio_geometry_plate(&g, 0, 0, &hit, NULL));
    assert_near(hit.irradiance, cos(p.theta_i), 1e-12);
    const gonio_pair found = gonio_pair_from_vectors(hit.to_light, hit.to_camera);
    assert_near(found.theta_i, p.theta_i, 1e-12);
    assert_near(found.theta_o, p.theta_o, 1e-12);
    assert_near(remainder(found.phi_i - p.phi_i, 2 * GONIO_PI), 0, 1e-12);
    assert_near(remainder(found.phi_o - p.phi_o, 2 * GONIO_PI), 0, 1e-12);
}

// Light at half the distance from a point is four times as strong.
static void test_irradiance_is_inverse_square_times_cosine(void **state) {
    (void)state;
    const gonio_pair p = pose(0, 0, 40, 90);
    const geometry g = gonio_geometry_of_pose(&facts, &p);
    geometry_hit hit;
    for (double x = -0.05; x <= 0.05; x += 0.01) {
        assert_true(gonio_geometry_plate(&g, x, 0.02, &hit, NULL));
        const double d2 = hit.point.x * hit.point.x + hit.point.y * hit.point.y + 700 * 700;
        assert_near(hit.irradiance, 700.0 * 700 / d2 * 700 / sqrt(d2), 1e-12);
    }
}

// The footprints of a grid of rays sum to the area of the disc that they hit.
static void test_footprints_sum_to_the_area(void **state) {
    (void)state;
    const gonio_pair p = pose(0, 0, 70, 33);
    const geometry g = gonio_geometry_of_pose(&facts, &p);
    const double step = 2e-5;
    double area = 0;
    for (double x = -0.012; x < 0.012; x += step) {
        for (double y = -0.012; y < 0.012; y += step) {
            geometry_hit hit;
            double footprint;
            if (gonio_geometry_plate(&g, x, y, &hit, &footprint) &&
                hit.point.x * hit.point.x + hit.point.y * hit.point.y <= 100) {
                area += footprint * step * step;
            }
        }
    }
    assert_near(area, GONIO_PI * 100, 0.2);
}

static void test_grazing_and_missing_rays(void **state) {
    (void)state;
    const gonio_pair p = pose(30, 0, 89, 0);
    const geometry g = gonio_geometry_of_pose(&facts, &p);
    geometry_hit hit;
    assert_false(gonio_geometry_plate(&g, 0, -0.1, &hit, NULL)); // above the horizon
    assert_false(gonio_geometry_sphere(&g, 0.2, 0, 20, &hit));
}

static void test_sphere_hits_its_surface_on_the_near_side(void **state) {
    (void)state;
    const gonio_pair p = pose(40, 10, 25, 200);
    const geometry g = gonio_geometry_of_pose(&facts, &p);
    for (int k = 0; k < 100; k++) {
        geometry_hit hit;
        assert_true(gonio_geometry_sphere(&g, 0.014 * sin(k), 0.014 * cos(1.7 * k), 20, &hit));
        const double r = sqrt(hit.point.x * hit.point.x + hit.point.y * hit.point.y + hit.point.z * hit.point.z);
        assert_near(r, 20, 1e-10);
        assert_true(hit.normal.x * hit.to_camera.x + hit.normal.y * hit.to_camera.y + hit.normal.z * hit.to_camera.z >
                    0);
    }
}

// The isotropic pair keeps both thetas and the angle between light and camera.
static void test_isotropic_pair_keeps_what_matters(void **state) {
    (void)state;
    const gonio_pair p = pose(40, 10, 25, 200);
    const geometry g = gonio_geometry_of_pose(&facts, &p);
    for (int k = 0; k < 100; k++) {
        geometry_hit hit;
        assert_true(gonio_geometry_sphere(&g, 0.015 * sin(k), 0.015 * cos(1.7 * k), 20, &hit));
        const gonio_pair local = gonio_geometry_isotropic_pair(&hit);
        const gonio_vec3 wi = gonio_direction(local.theta_i, local.phi_i), l = hit.to_light, n = hit.normal;
        const gonio_vec3 wo = gonio_direction(local.theta_o, local.phi_o), c = hit.to_camera;
        assert_near(wi.z, n.x * l.x + n.y * l.y + n.z * l.z, 1e-12);
        assert_near(wo.z, n.x * c.x + n.y * c.y + n.z * c.z, 1e-12);
        assert_near(wi.x * wo.x + wi.y * wo.y + wi.z * wo.z, l.x * c.x + l.y * c.y + l.z * c.z, 1e-12);
        assert_true(local.phi_i == 0);
        // Handedness: n . (l x c) has the sign of phi_o.
        const double triple =
            n.x * (l.y * c.z - l.z * c.y) + n.y * (l.z * c.x - l.x * c.z) + n.z * (l.x * c.y - l.y * c.x);
        assert_true(triple * local.phi_o >= 0);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_image_stands_as_rig_h_says),
        cmocka_unit_test(test_rays_return_to_their_points),
        cmocka_unit_test(test_centre_has_the_nominal_directions),
        cmocka_unit_test(test_irradiance_is_inverse_square_times_cosine),
        cmocka_unit_test(test_footprints_sum_to_the_area),
        cmocka_unit_test(test_grazing_and_missing_rays),
        cmocka_unit_test(test_sphere_hits_its_surface_on_the_near_side),
        cmocka_unit_test(test_isotropic_pair_keeps_what_matters),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
