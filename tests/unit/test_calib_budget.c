// SPDX-License-Identifier: BSD-3-Clause
// Frames -> samples on the simulated rig: what is taken off the values, and what the budget and sigma say of them.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "tests/coverage.h"
#include "tests/unit/calib_scan.h"
#include "tests/unit/near.h"

// The budget's parts add up to what the sample carries.
static void test_budget_adds_up(void **state) {
    (void)state;
    sim_scan scan;
    gonio_budget b;
    const gonio_pair pose = pose_deg(60, 0, 50, 175);
    assert_true(scan_open(&scan, "ward:rho_d=0.3,rho_s=0.2,alpha=0.15", 15, small, SIDE) && scan_prepare(&scan));
    gonio_samples *samples = new_samples(scan.calib);
    const gonio_model *truth = gonio_sim_truth(scan.sim);
    assert_true(scan_pose(&scan, &pose, samples));
    assert_int_equal(gonio_calib_pointing(&scan.rig.facts, truth, samples, NULL), GONIO_OK);
    assert_int_equal(gonio_calib_budget(scan.calib, &pose, scan.n, scan.exposures, truth, NULL, &b, NULL), GONIO_OK);
    assert_true(b.value == samples->values[0]);
    assert_near(b.random, samples->sigma_random[0], 1e-12 * b.value);
    assert_near(b.systematic, samples->sigma_systematic[0], 1e-12 * b.value);
    const double parts = b.photon * b.photon + b.read * b.read + b.dark * b.dark + b.flat * b.flat +
                         b.reference * b.reference + b.drift * b.drift + b.stray * b.stray + b.angle * b.angle +
                         b.area * b.area + b.blur * b.blur;
    assert_near(parts, b.random * b.random + b.systematic * b.systematic, 1e-9 * parts);
    assert_near(b.reference, 0.002 * b.value, 1e-12);
    assert_true(b.photon > 0 && b.read > 0 && b.dark > 0 && b.flat > 0 && b.drift > 0 && b.stray > 0 && b.angle > 0 &&
                b.area > 0);
    gonio_samples_free(samples);
    scan_close(&scan);
}

// Half a per cent of white scattered by the room, five times what the sample itself returns: the light trap takes it
// out within what the budget says of it, 6 sigma; without a trap it stays in whole. The trap's noise and the
// pose-to-pose variation (2 %) are the budget's stray term.
static void test_stray_light_is_taken_off(void **state) {
    (void)state;
    static const char *const settings[] = {"sample.region_radius_mm=2", "stray.ambient_percent=0.5",
                                           "stray.variation_percent=2", NULL};
    const gonio_pair pose = pose_deg(30, 0, 20, 180);
    double found[2];
    for (int trap = 0; trap < 2; trap++) {
        sim_scan scan;
        gonio_budget b;
        gonio_calib_report r;
        assert_true(scan_open(&scan, "lambert:rho=0.001", 25, settings, SIDE));
        scan.trap_frames = 4 * trap;
        assert_true(scan_prepare(&scan));
        gonio_samples *samples = new_samples(scan.calib);
        assert_true(scan_pose(&scan, &pose, samples));
        gonio_calib_describe(scan.calib, &r);
        found[trap] = samples->values[0];
        assert_int_equal(gonio_calib_budget(scan.calib, &pose, scan.n, scan.exposures, NULL, NULL, &b, NULL), GONIO_OK);
        if (trap) {
            assert_near(found[1], 0.001 / GONIO_PI, 6 * gonio_samples_sigma(samples, 0, 0));
            // Once for this pose, once for the trap's.
            assert_near(b.stray, sqrt(2) * 0.02 * r.stray / cos(pose.theta_i), 0.2 * b.stray);
            assert_near(found[0] - found[1], r.stray / cos(pose.theta_i), 0.1 * r.stray);
            assert_true(found[0] > 3 * 0.001 / GONIO_PI);
        } else {
            assert_true(r.stray == 0);
        }
        gonio_samples_free(samples);
        scan_close(&scan);
    }
}

// What the dark maps' errors do to a black sample partly cancels, since they were taken off the trap too: with like
// exposures hardly any of it is left. 20 seeds of nothing but read noise: within 2 sigma at least 14 times (17 to 20
// expected, 13 twice in 1e5), and the dark term is far below what independent maps would give.
static void test_correlated_maps_are_not_counted_twice(void **state) {
    (void)state;
    static const char *const settings[] = {"sample.region_radius_mm=2", "stray.variation_percent=0",
                                           "stray.glare_percent=0",     "camera.dark_e_per_s=0",
                                           "camera.read_noise_e=30",    "camera.offset_nonuniformity_e=0",
                                           "camera.exposure_max_s=1",   NULL};
    const gonio_pair pose = pose_deg(30, 0, 20, 180);
    int within = 0;
    for (uint64_t seed = 1; seed <= 20; seed++) {
        sim_scan scan;
        gonio_budget b[2];
        assert_true(scan_open(&scan, "lambert:rho=0.0001", seed, settings, SIDE));
        scan.dark_frames = 2;
        scan.trap_frames = 32;
        scan.reference_frames = 4;
        scan.exposure_s = 1;
        assert_true(scan_prepare(&scan) && scan_move(&scan, &pose));
        for (scan.n = 0; scan.n < 8; scan.n++) {
            assert_true(scan_capture(&scan, scan.n, 1));
        }
        assert_int_equal(gonio_calib_budget(scan.calib, &pose, 8, scan.exposures, NULL, NULL, b, NULL), GONIO_OK);
        within += fabs(b->value - 0.0001 / GONIO_PI) <= 2 * hypot(b->random, b->systematic);
        // Two dark frames at this exposure against eight frames of the pose: on its own twice the read term.
        assert_true(b->dark < 0.5 * b->read);
        scan_close(&scan);
    }
    assert_true(within >= 14);
}

// A lamp of 1.4 deg and an aperture of 1.1 deg half-width blur a lobe of alpha = 0.08 by a per cent or so. What the
// budget says of it against what the simulated rig, which has such a lamp (32 points) and such a lens (16), really
// measures: the bias to 2 % of itself beside noise, and the corrected value as near. Nothing else is wrong with this
// rig.
static void test_blur_is_what_the_apertures_do(void **state) {
    (void)state;
    static const char *const apertures[] = {"rig.light_radius_mm=25", "rig.aperture_radius_mm=20"};
    const gonio_pair poses[] = {pose_deg(40, 0, 40, 180), pose_deg(30, 0, 45, 178), pose_deg(65, 0, 60, 180)};
    for (int k = 0; k < 6; k++) {
        const char *const settings[] = {"sample.region_radius_mm=2",
                                        "camera.full_well_e=1e6",
                                        "camera.bits=16",
                                        "meter.noise_percent=0.001",
                                        "reference.sigma_percent=0",
                                        "stray.glare_percent=0",
                                        "axis light_theta.pointing_deg=0",
                                        "axis light_phi.pointing_deg=0",
                                        "axis camera_theta.pointing_deg=0",
                                        "axis camera_phi.pointing_deg=0",
                                        apertures[k % 2],
                                        NULL};
        const gonio_pair *pose = &poses[k / 2];
        sim_scan scan;
        gonio_budget b;
        gonio_blur blur;
        double f;
        assert_true(scan_open(&scan, "ward:rho_d=0.3,rho_s=0.2,alpha=0.08", 26, settings, SIDE) && scan_prepare(&scan));
        gonio_samples *samples = new_samples(scan.calib);
        const gonio_model *truth = gonio_sim_truth(scan.sim);
        gonio_model_eval_pair(truth, pose, &f);
        assert_true(scan_pose(&scan, pose, samples));
        assert_int_equal(gonio_calib_budget(scan.calib, pose, scan.n, scan.exposures, truth, NULL, &b, NULL), GONIO_OK);
        const double noise = b.random / b.value, measured = samples->values[0] / (f * (1 + b.area_bias)) - 1;
        assert_true(fabs(b.blur_bias) > 0.005);
        assert_near(measured, b.blur_bias, 0.02 * fabs(b.blur_bias) + 5 * noise);
        assert_near(b.value, f, 5 * hypot(b.random, b.systematic) + 0.02 * fabs(b.blur_bias) * f);
        assert_true(b.blur > 0 && b.blur < 0.2 * fabs(b.blur_bias) * f);
        assert_int_equal(gonio_calib_pointing(&scan.rig.facts, truth, samples, NULL), GONIO_OK);
        gonio_calib_blur(&scan.rig.facts, truth, samples, &blur);
        assert_near(k % 2 == 0 ? blur.light_deg : blur.aperture_deg, k % 2 == 0 ? 1.4321 : 1.1458, 1e-4);
        assert_near(k % 2 == 0 ? blur.light_sr : blur.aperture_sr, GONIO_PI * (k % 2 == 0 ? 625e-6 : 400e-6), 1e-6);
        gonio_samples_free(samples);
        scan_close(&scan);
    }
}

// Without a white panel: a source of known radiance and a reading of the lamp's irradiance. The panel under the lamp
// plays the source (its radiance over E is reflectance / pi cos 45) at the lamp's nominal level. The values are the
// truth to 5 sigma, and a doubled reading halves them.
static void test_irradiance_gives_the_scale(void **state) {
    (void)state;
    static const char *const settings[] = {"sample.region_radius_mm=2",
                                           "reference.sigma_percent=0",
                                           "meter.noise_percent=0.001",
                                           "lamp.drift_percent_per_hour=0",
                                           "lamp.wander_percent=0",
                                           "stray.glare_percent=0",
                                           NULL};
    const gonio_pair pose = pose_deg(60, 0, 20, 180);
    double found[2];
    for (int k = 0; k < 2; k++) {
        sim_scan scan;
        assert_true(scan_open(&scan, "lambert:rho=0.5", 27, settings, SIDE));
        gonio_rig_facts *facts = &scan.rig.facts;
        facts->irradiance = 250 * (1 + k);
        facts->reference_radiance = 250 * 0.99 / GONIO_PI * cos(gonio_radians(GONIO_REFERENCE_THETA_I_DEG));
        facts->irradiance_monitor = 1;
        facts->reference_relative_sigma = 0.001;
        gonio_calib_free(scan.calib);
        assert_int_equal(gonio_calib_new(&scan.camera, facts, &scan.window, &scan.calib, NULL), GONIO_OK);
        scan.trap_frames = 0;
        assert_true(scan_prepare(&scan));
        gonio_samples *samples = new_samples(scan.calib);
        gonio_budget b;
        assert_true(scan_pose(&scan, &pose, samples));
        assert_int_equal(gonio_calib_budget(scan.calib, &pose, scan.n, scan.exposures, NULL, NULL, &b, NULL), GONIO_OK);
        found[k] = samples->values[0];
        assert_near(b.reference, 0.001 * found[k], 1e-12);
        assert_true(b.angle == 0); // no slope is given, and no panel's cosine comes in
        // Axes of 0.01 deg at 60 deg: 0.03 %, of the panel that plays the source another 0.02 %; stray light 0.02 %.
        assert_near(found[k] * (1 + k), 0.5 / GONIO_PI, 5 * hypot(b.random, b.systematic) + 0.002 * 0.5 / GONIO_PI);
        gonio_samples_free(samples);
        scan_close(&scan);
    }
    assert_near(found[0] / found[1], 2, 1e-6);
}

// Sigma is honest: 100 seeds, each with its own reference scale, zero errors, drift and noise; 8 poses a seed over four
// theta bands, lobe and base apart. Within a seed the reference's error is common, so the 100 seeds count as the
// trials: of 100 normal draws, 16 or more beyond 2 sigma happen once in 3e4, and their median |z|, 0.674 +- 0.079, lies
// outside 0.34..1.01 once in 4e4.
static void test_sigma_is_honest(void **state) {
    (void)state;
    coverage c = {0};
    for (uint64_t seed = 1; seed <= 100; seed++) {
        assert_true(coverage_plate(&c, "ward:rho_d=0.3,rho_s=0.2,alpha=0.15", 0.3 / GONIO_PI, seed, 1, small, SIDE,
                                   false, NULL));
    }
    for (int lobe = 0; lobe < 2; lobe++) {
        for (int band = 0; band < COVERAGE_BANDS; band++) {
            const double within = coverage_within(&c.cell[lobe][band], 2),
                         median = coverage_median(&c.cell[lobe][band]);
            if (!(within >= 0.85 && median >= 0.34 && median <= 1.01)) {
                fail_msg("%s, band %d: %.3f within 2 sigma, median |error|/sigma %.3f", lobe ? "lobe" : "base", band,
                         within, median);
            }
        }
    }
    coverage_free(&c);
}

// Without a monitor the lamp's 2 %/h shows; the reference at the end takes it out.
static void test_drift_is_corrected_by_the_second_reference(void **state) {
    (void)state;
    static const char *const settings[] = {"sample.region_radius_mm=2",     "meter.present=0",
                                           "lamp.drift_percent_per_hour=2", "lamp.wander_percent=0",
                                           "reference.sigma_percent=0",     NULL};
    sim_scan scan;
    double clock_s[4], ratio;
    assert_true(scan_open(&scan, "lambert:rho=0.5", 21, settings, SIDE) && scan_prepare(&scan));
    gonio_samples *samples = new_samples(scan.calib);
    for (int k = 0; k < 4; k++) {
        const gonio_pair pose = pose_deg(20 * k, 0, 30, 180);
        clock_s[k] = scan.stamp.clock_s;
        assert_true(scan_pose(&scan, &pose, samples));
        scan.stamp.clock_s += 3600;
    }
    // The bound on drift is part of sigma: 2 % after the first hour, 6 % after the third.
    assert_near(samples->sigma_systematic[3] / samples->values[3], 0.06, 0.002);
    assert_int_equal(gonio_calib_drift(scan.calib, clock_s, samples, &ratio, &scan.error), GONIO_E_INPUT);
    assert_true(scan_reference(&scan));
    assert_true(scan_ok(&scan, gonio_calib_drift(scan.calib, clock_s, samples, &ratio, &scan.error), "drift"));
    assert_true(fabs(ratio - 1) > 1e-3);
    for (size_t k = 0; k < 4; k++) {
        // Four axes of 0.01 deg at theta_i = 60 deg: 0.03 %; noise 0.05 %.
        assert_near(samples->values[k] / (0.5 / GONIO_PI), 1, 0.004);
        assert_true(samples->sigma_systematic[k] / samples->values[k] < 0.003);
    }
    gonio_samples_free(samples);
    scan_close(&scan);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_budget_adds_up),
        cmocka_unit_test(test_stray_light_is_taken_off),
        cmocka_unit_test(test_correlated_maps_are_not_counted_twice),
        cmocka_unit_test(test_blur_is_what_the_apertures_do),
        cmocka_unit_test(test_irradiance_gives_the_scale),
        cmocka_unit_test(test_drift_is_corrected_by_the_second_reference),
        cmocka_unit_test(test_sigma_is_honest),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
