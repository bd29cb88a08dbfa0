// SPDX-License-Identifier: BSD-3-Clause
// Frames -> samples on the simulated rig: what calibration finds of the camera, the samples' values, exposure control,
// and every polite failure.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "tests/unit/calib_scan.h"
#include "tests/unit/near.h"

// Gain within 1 %, read noise within 3 %, saturation exact. 128 x 128 pixels and 31 pairs of reference frames give the
// gain a standard error of sqrt(2 / 500,000) = 0.2 %, 7 pairs of dark frames the read noise one of 0.2 %: both limits
// lie 5 standard errors away or more, a false alarm below 1e-6.
static void test_camera_is_found(void **state) {
    (void)state;
    sim_scan scan;
    gonio_calib_report r;
    assert_true(scan_open(&scan, "lambert:rho=0.5", 5, NULL, 128));
    scan.reference_frames = 32;
    assert_true(scan_prepare(&scan));
    gonio_calib_describe(scan.calib, &r);
    assert_near(r.gain_e_per_dn, 10000.0 / (4095 - 64), 0.01 * 2.48);
    assert_near(r.read_noise_e, 5, 0.15);
    assert_near(r.dark_e_per_s, 5, 0.1);
    assert_true(r.saturation_measured);
    assert_true(r.saturation_dn == 4095);
    scan_close(&scan);
}

// A full well that clips below the converter's range is found where it is: 1.1 x 5000 e- of a scale of 10000 is at
// 64 + 0.55 x 4031 DN once the converter's gain is halved by hand.
static void test_early_saturation_is_measured(void **state) {
    (void)state;
    sim_scan scan;
    gonio_calib_report r;
    const gonio_pair pose = pose_deg(GONIO_REFERENCE_THETA_I_DEG, 0, 0, 0);
    assert_true(scan_open(&scan, "lambert:rho=0.5", 6, small, SIDE));
    for (int i = 0; i < 8; i++) {
        assert_true(scan_capture(&scan, 0, i < 4 ? 2e-5 : 1));
        assert_int_equal(gonio_calib_add_dark(scan.calib, &scan.exposures[0], NULL), GONIO_OK);
    }
    scan.rig.lamp->set_shutter(scan.rig.lamp_device, true, NULL);
    scan.rig.mount->mount(scan.rig.mount_device, GONIO_TARGET_REFERENCE, NULL);
    assert_true(scan_move(&scan, &pose));
    for (int i = 0; i < 8; i++) {
        assert_true(scan_capture(&scan, 0, i < 6 ? 0.006 : 0.03));
        for (int p = 0; p < SIDE * SIDE; p++) {
            uint16_t *dn = &scan.exposures[0].frame.pixels[p];
            if (*dn > 2500) { // clips before the last noise is added
                *dn = (uint16_t)(2500 + p % 3);
            }
        }
        assert_int_equal(gonio_calib_add_reference(scan.calib, &pose, &scan.exposures[0], NULL), GONIO_OK);
    }
    assert_true(scan_ok(&scan, gonio_calib_prepare(scan.calib, &scan.error), "prepare"));
    gonio_calib_describe(scan.calib, &r);
    assert_true(r.saturation_measured);
    assert_true(r.saturation_dn == 2500);
    scan_close(&scan);
}

// Without any error but noise the values are the truth: Lambert's at every angle, to five sigma of what is claimed.
static void test_lambert_is_recovered(void **state) {
    (void)state;
    static const char *const settings[] = {"sample.region_radius_mm=2",
                                           "reference.sigma_percent=0",
                                           "axis light_theta.pointing_deg=0",
                                           "axis light_phi.pointing_deg=0",
                                           "axis camera_theta.pointing_deg=0",
                                           "axis camera_phi.pointing_deg=0",
                                           NULL};
    sim_scan scan;
    assert_true(scan_open(&scan, "lambert:rho=0.5", 7, settings, SIDE) && scan_prepare(&scan));
    gonio_samples *samples = new_samples(scan.calib);
    const double deg[][4] = {{0, 0, 0, 0},    {45, 0, 0, 0},    {60, 30, 60, 200},
                             {80, 0, 10, 90}, {20, 0, 80, 180}, {85, 0, 85, 7}};
    for (int k = 0; k < 6; k++) {
        const gonio_pair pose = pose_deg(deg[k][0], deg[k][1], deg[k][2], deg[k][3]);
        assert_true(scan_pose(&scan, &pose, samples));
        const double sigma = gonio_samples_sigma(samples, (size_t)k, 0);
        assert_near(samples->values[k], 0.5 / GONIO_PI, 5 * sigma);
        assert_true(sigma < 0.002 * 0.5 / GONIO_PI && sigma > 0);
        assert_memory_equal(&samples->pairs[k], &pose, sizeof pose);
    }
    gonio_samples_free(samples);
    scan_close(&scan);
}

static void test_same_frames_give_the_same_bits(void **state) {
    (void)state;
    double found[2][2];
    for (int run = 0; run < 2; run++) {
        sim_scan scan;
        const gonio_pair pose = pose_deg(50, 0, 40, 180);
        assert_true(scan_open(&scan, "ward:rho_d=0.3,rho_s=0.2,alpha=0.15", 8, small, SIDE) && scan_prepare(&scan));
        gonio_samples *samples = new_samples(scan.calib);
        assert_true(scan_pose(&scan, &pose, samples));
        found[run][0] = samples->values[0];
        found[run][1] = samples->sigma_random[0];
        gonio_samples_free(samples);
        scan_close(&scan);
    }
    assert_memory_equal(found[0], found[1], sizeof found[0]);
}

// A hundredfold too long and too short a start both end with every used pixel well exposed, in few frames.
static void test_bracketing_converges(void **state) {
    (void)state;
    const double start_s[] = {2e-5, 1, 20};
    sim_scan scan;
    assert_true(scan_open(&scan, "ward:rho_d=0.3,rho_s=0.2,alpha=0.15", 9, small, SIDE) && scan_prepare(&scan));
    for (int k = 0; k < 3; k++) {
        const gonio_pair pose = pose_deg(60, 0, 55, 178);
        double next;
        scan.exposure_s = start_s[k];
        assert_true(scan_move(&scan, &pose) && scan_bracket(&scan, &pose));
        assert_true(scan.n <= 8);
        assert_int_equal(gonio_calib_bracket(scan.calib, &pose, scan.n, scan.exposures, &next), GONIO_EXPOSURE_DONE);
        const uint16_t centre = scan.exposures[scan.n - 1].frame.pixels[SIDE * SIDE / 2 + SIDE / 2];
        assert_in_range(centre, 64 + 600, 3900);
    }
    scan_close(&scan);
}

// A camera that cannot expose short enough says so, and the pose is refused with its reason, nothing added.
static void test_no_valid_exposure(void **state) {
    (void)state;
    sim_scan scan;
    double next;
    const gonio_pair pose = pose_deg(10, 0, 10, 180);
    assert_true(scan_open(&scan, "lambert:rho=0.9", 10, small, SIDE) && scan_prepare(&scan));
    gonio_samples *samples = new_samples(scan.calib);
    assert_true(scan_move(&scan, &pose) && scan_capture(&scan, 0, 0.5));
    assert_int_equal(gonio_calib_bracket(scan.calib, &pose, 1, scan.exposures, &next), GONIO_EXPOSURE_MORE);
    assert_true(next < 0.5);
    assert_int_equal(gonio_calib_pose(scan.calib, &pose, 1, scan.exposures, samples, &scan.error), GONIO_E_RANGE);
    assert_non_null(strstr(scan.error.message, "no valid exposure"));
    assert_int_equal(samples->n, 0);
    gonio_samples_free(samples);
    scan_close(&scan);
}

static void test_defects_are_found_and_left_out(void **state) {
    (void)state;
    static const char *const settings[] = {"sample.region_radius_mm=2", "camera.hot_pixel_percent=1", NULL};
    sim_scan scan;
    gonio_calib_report r;
    const gonio_pair pose = pose_deg(45, 0, 20, 180);
    assert_true(scan_open(&scan, "lambert:rho=0.5", 11, settings, SIDE) && scan_prepare(&scan));
    gonio_calib_describe(scan.calib, &r);
    assert_in_range(r.hot, 15, 80); // 41 expected of 4096: 4 sigma either side and more
    gonio_samples *samples = new_samples(scan.calib);
    assert_true(scan_pose(&scan, &pose, samples));
    assert_near(samples->values[0], 0.5 / GONIO_PI, 5 * gonio_samples_sigma(samples, 0, 0));
    gonio_samples_free(samples);
    scan_close(&scan);
}

static void test_bayer_gives_three_channels(void **state) {
    (void)state;
    static const char *const settings[] = {"camera.pattern=grbg", "reference.reflectance=0.99/0.9/0.8",
                                           "sample.region_radius_mm=2", NULL};
    sim_scan scan;
    const gonio_pair pose = pose_deg(30, 0, 20, 180);
    assert_true(scan_open(&scan, "ward:rho_d=0.3/0.2/0.1,rho_s=0,alpha=0.2", 12, settings, SIDE) &&
                scan_prepare(&scan));
    assert_int_equal(gonio_calib_channels(scan.calib), 3);
    assert_string_equal(gonio_calib_channel_names(scan.calib)[2], "b");
    gonio_samples *samples = new_samples(scan.calib);
    assert_true(scan_pose(&scan, &pose, samples));
    for (int c = 0; c < 3; c++) {
        assert_near(samples->values[c], (0.3 - 0.1 * c) / GONIO_PI, 5 * gonio_samples_sigma(samples, 0, c));
    }
    gonio_samples_free(samples);
    scan_close(&scan);
}

// A camera with a gamma, its curve given in a file.
static void test_given_response_is_undone(void **state) {
    (void)state;
    char path[] = "/tmp/gonio-response-XXXXXX", setting[128];
    const int fd = mkstemp(path);
    FILE *stream = fdopen(fd, "w");
    fprintf(stream, "relative exposure,relative value\n0,0\n");
    for (int i = 1; i <= 1000; i++) {
        fprintf(stream, "%.6f,%.9f\n", i / 1000.0, pow(i / 1000.0, 0.6));
    }
    fclose(stream);
    snprintf(setting, sizeof setting, "camera.response=%s", path);
    const char *const settings[] = {"sample.region_radius_mm=2", setting, NULL};
    sim_scan scan;
    assert_true(scan_open(&scan, "lambert:rho=0.2", 13, settings, SIDE) && scan_prepare(&scan));
    gonio_samples *samples = new_samples(scan.calib);
    for (int k = 0; k < 3; k++) {
        const gonio_pair pose = pose_deg(10 + 30 * k, 0, 20, 180);
        assert_true(scan_pose(&scan, &pose, samples));
        assert_near(samples->values[k], 0.2 / GONIO_PI, 5 * gonio_samples_sigma(samples, (size_t)k, 0));
    }
    gonio_samples_free(samples);
    scan_close(&scan);
    unlink(path);
}

static void test_bad_response_files(void **state) {
    (void)state;
    static const char *const texts[] = {"",          "0,0\n", "0,0\n1,x\n", "0,0\n0.5,0.7\n0.4,0.8\n", "0,0\n1,nan\n",
                                        "0;0\n1;1\n"};
    static const long long lines[] = {-1, -1, 2, 3, 2, 1};
    char path[] = "/tmp/gonio-response-XXXXXX";
    close(mkstemp(path));
    for (int k = 0; k < 6; k++) {
        FILE *stream = fopen(path, "w");
        fputs(texts[k], stream);
        fclose(stream);
        const gonio_camera_info camera = {.width = 8, .height = 8, .bits = 12, .fx = 100, .fy = 100};
        gonio_rig_facts facts = {.light_distance_mm = 100,
                                 .camera_distance_mm = 100,
                                 .region_radius_mm = 1,
                                 .reference_reflectance = {0.99}};
        snprintf(facts.response_path, sizeof facts.response_path, "%s", path);
        gonio_calib *calib;
        gonio_error error = {0};
        assert_int_equal(gonio_calib_new(&camera, &facts, &(gonio_window){0, 0, 8, 8}, &calib, &error), GONIO_E_INPUT);
        assert_null(calib);
        assert_string_equal(error.file, path);
        assert_int_equal(error.line, lines[k]);
    }
    unlink(path);
}

// A sphere gives thousands of samples a frame, all at local angles; five sigma in all but 1e-6 of them, tested as the
// share within two sigma (known to 0.3 % from the samples' noise; the frame's common error widens that: 5 %).
static void test_sphere_gives_thousands(void **state) {
    (void)state;
    static const char *const settings[] = {"reference.sigma_percent=0.05", NULL};
    sim_scan scan;
    const gonio_pair pose = pose_deg(40, 0, 20, 180);
    assert_true(scan_open(&scan, "ward:rho_d=0.3,rho_s=0.2,alpha=0.3,shape=sphere,radius_mm=5", 14, settings, 128));
    scan.reference_frames = 8;
    assert_true(scan_prepare(&scan));
    gonio_samples *samples = new_samples(scan.calib);
    assert_true(scan_pose(&scan, &pose, samples));
    assert_true(samples->n > 3000);
    const gonio_model *truth = gonio_sim_truth(scan.sim);
    assert_int_equal(gonio_calib_pointing(&scan.rig.facts, truth, samples, NULL), GONIO_OK);
    size_t within = 0;
    double most = 0;
    for (size_t i = 0; i < samples->n; i++) {
        double f;
        gonio_model_eval_pair(truth, &samples->pairs[i], &f);
        within += fabs(samples->values[i] - f) <= 2 * gonio_samples_sigma(samples, i, 0);
        most = fmax(most, fmax(samples->pairs[i].theta_i, samples->pairs[i].theta_o));
    }
    assert_true((double)within > 0.90 * (double)samples->n && (double)within < 0.99 * (double)samples->n);
    assert_true(gonio_degrees(most) <= 85 && gonio_degrees(most) > 80);
    gonio_samples_free(samples);
    scan_close(&scan);
}

// The streaming kernel agrees with the merge of a single exposure, whatever the threads.
static void test_radiance_of_a_frame(void **state) {
    (void)state;
    static float radiance[2][SIDE * SIDE], variance[2][SIDE * SIDE];
    sim_scan scan;
    const gonio_pair pose = pose_deg(30, 0, 20, 180);
    assert_true(scan_open(&scan, "lambert:rho=0.5", 18, small, SIDE) && scan_prepare(&scan));
    assert_true(scan_move(&scan, &pose) && scan_capture(&scan, 0, 0.006));
    for (int run = 0; run < 2; run++) {
        assert_int_equal(
            gonio_calib_radiance(scan.calib, scan.exposures, 1 + 2 * run, radiance[run], variance[run], NULL),
            GONIO_OK);
    }
    assert_memory_equal(radiance[0], radiance[1], sizeof radiance[0]);
    assert_memory_equal(variance[0], variance[1], sizeof variance[0]);
    double sum = 0, claimed = 0, squares = 0;
    const double expected = 0.5 / GONIO_PI * cos(pose.theta_i);
    int n = 0;
    for (int p = 0; p < SIDE * SIDE; p++) {
        if (isfinite(radiance[0][p])) {
            sum += radiance[0][p];
            squares += (radiance[0][p] - expected) * (radiance[0][p] - expected);
            claimed += variance[0][p];
            n++;
        }
    }
    assert_true(n > SIDE * SIDE - 20);
    assert_near(sum / n / expected, 1, 0.008); // the reference's scale: 4 sigma
    const double offset = sum / n - expected;
    assert_near((squares / n - offset * offset) / (claimed / n), 1, 0.15); // 6 sigma of a variance of 4096 pixels
    gonio_exposure e = scan.exposures[0];
    e.frame.window.x++;
    assert_int_equal(gonio_calib_radiance(scan.calib, &e, 1, radiance[0], variance[0], NULL), GONIO_E_INPUT);
    scan_close(&scan);
}

// One dark frame and three reference frames, each with something wrong, and what the error says.
static void test_polite_failures(void **state) {
    (void)state;
    enum { LIT_DARK, LAMP_OFF, OVEREXPOSED, NO_DARK, NO_REFERENCE, NO_PAIR, LIT_TRAP, CASES };
    static const char *const says[CASES] = {"step 0 frame 3: dark frame not dark",
                                            "lamp is off",
                                            "reference overexposed",
                                            "0 dark frames",
                                            "no reference frames",
                                            "no two reference frames",
                                            "step 0 frame 8: the light trap is not dark: it reads 1"};
    const gonio_pair pose = pose_deg(GONIO_REFERENCE_THETA_I_DEG, 0, 0, 0);
    for (int fault = 0; fault < CASES; fault++) {
        sim_scan scan;
        assert_true(scan_open(&scan, "lambert:rho=0.5", 16, small, SIDE));
        scan.rig.mount->mount(scan.rig.mount_device, GONIO_TARGET_REFERENCE, NULL);
        for (int i = 0; i < 8 && fault != NO_DARK; i++) {
            scan.rig.lamp->set_shutter(scan.rig.lamp_device, fault == LIT_DARK && i == 3, NULL);
            assert_true(scan_capture(&scan, 0, i < 4 ? 2e-4 : 0.1));
            assert_int_equal(gonio_calib_add_dark(scan.calib, &scan.exposures[0], NULL), GONIO_OK);
        }
        scan.rig.lamp->set_shutter(scan.rig.lamp_device, fault != LAMP_OFF, NULL);
        if (fault == LIT_TRAP) { // the white panel lies there
            assert_true(scan_capture(&scan, 0, 0.001));
            assert_int_equal(gonio_calib_add_trap(scan.calib, &scan.exposures[0], NULL), GONIO_OK);
        }
        assert_true(scan_move(&scan, &pose));
        for (int i = 0; i < 4 && fault != NO_REFERENCE; i++) {
            const double exposure_s = fault == OVEREXPOSED ? 1 : fault == NO_PAIR ? 0.002 * (i + 1) : 0.006;
            assert_true(scan_capture(&scan, 0, exposure_s));
            assert_int_equal(gonio_calib_add_reference(scan.calib, &pose, &scan.exposures[0], NULL), GONIO_OK);
        }
        assert_int_not_equal(gonio_calib_prepare(scan.calib, &scan.error), GONIO_OK);
        if (strstr(scan.error.message, says[fault]) == NULL) {
            fail_msg("case %d says: %s", fault, scan.error.message);
        }
        scan_close(&scan);
    }
}

static void test_frames_that_do_not_fit(void **state) {
    (void)state;
    sim_scan scan;
    const gonio_pair pose = pose_deg(20, 0, 10, 180);
    assert_true(scan_open(&scan, "lambert:rho=0.5", 17, small, SIDE));
    gonio_samples *samples = new_samples(scan.calib);
    assert_true(scan_capture(&scan, 0, 0.01));
    assert_int_equal(gonio_calib_pose(scan.calib, &pose, 1, scan.exposures, samples, NULL), GONIO_E_USAGE);
    assert_true(scan_prepare(&scan) && scan_move(&scan, &pose) && scan_capture(&scan, 0, 0.01));
    gonio_exposure e = scan.exposures[0];
    e.frame.window.width--;
    assert_int_equal(gonio_calib_pose(scan.calib, &pose, 1, &e, samples, &scan.error), GONIO_E_INPUT);
    assert_non_null(strstr(scan.error.message, "window 63x64"));
    e = scan.exposures[0];
    e.frame.gain_db = 6;
    assert_int_equal(gonio_calib_pose(scan.calib, &pose, 1, &e, samples, &scan.error), GONIO_E_INPUT);
    e = scan.exposures[0];
    e.frame.exposure_s = NAN;
    assert_int_equal(gonio_calib_pose(scan.calib, &pose, 1, &e, samples, &scan.error), GONIO_E_INPUT);
    e = scan.exposures[0];
    e.monitor = 0;
    assert_int_equal(gonio_calib_pose(scan.calib, &pose, 1, &e, samples, &scan.error), GONIO_E_DEVICE);
    assert_int_equal(gonio_calib_pose(scan.calib, &pose, 0, &e, samples, &scan.error), GONIO_E_INPUT);
    assert_int_equal(samples->n, 0);
    gonio_samples_free(samples);
    scan_close(&scan);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_camera_is_found),
        cmocka_unit_test(test_early_saturation_is_measured),
        cmocka_unit_test(test_lambert_is_recovered),
        cmocka_unit_test(test_same_frames_give_the_same_bits),
        cmocka_unit_test(test_bracketing_converges),
        cmocka_unit_test(test_no_valid_exposure),
        cmocka_unit_test(test_defects_are_found_and_left_out),
        cmocka_unit_test(test_bayer_gives_three_channels),
        cmocka_unit_test(test_given_response_is_undone),
        cmocka_unit_test(test_bad_response_files),
        cmocka_unit_test(test_sphere_gives_thousands),
        cmocka_unit_test(test_radiance_of_a_frame),
        cmocka_unit_test(test_polite_failures),
        cmocka_unit_test(test_frames_that_do_not_fit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
