// SPDX-License-Identifier: BSD-3-Clause
// The flat field's file, the white reference's own BRDF, and its certificate.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "gonio/characterise.h"
#include "tests/sim_scan.h"
#include "tests/unit/near.h"
#include "tests/unit/scratch.h"

#define SIDE 64
#define PIXELS (SIDE * SIDE)

// ---- flat field ----

static bool open_scan(sim_scan *scan, uint64_t seed, const char *setting, int reference_frames, const char *flat) {
    const char *const settings[] = {"sample.region_radius_mm=2", setting, NULL};
    if (!scan_open(scan, "lambert:rho=0.5", seed, settings, SIDE)) {
        return false;
    }
    scan->reference_frames = reference_frames;
    if (flat != NULL) {
        gonio_calib_free(scan->calib);
        scan->calib = NULL;
        snprintf(scan->rig.facts.flat_path, sizeof scan->rig.facts.flat_path, "%s", flat);
        return gonio_calib_new(&scan->camera, &scan->rig.facts, &scan->window, &scan->calib, &scan->error) == GONIO_OK;
    }
    return true;
}

// The same camera, another day: what is fixed in it stays, every noise is new.
static void another_day(sim_scan *scan) { scan->stamp.pose = 1000; }

// A session with few reference frames and the file of one with many: its map has the file's small variance, and differs
// from a third, independent one by just what both state, to 5 standard errors of a variance of 4096 pixels.
static void test_file_stands_in_for_the_reference(void **state) {
    (void)state;
    char path[] = "/tmp/gonio-flat-XXXXXX";
    close(mkstemp(path));
    sim_scan many, few, third;
    assert_true(open_scan(&many, 31, NULL, 48, NULL) && scan_prepare(&many));
    assert_int_equal(gonio_calib_flat_save(many.calib, path, &many.error), GONIO_OK);
    assert_true(open_scan(&few, 31, NULL, 4, path));
    another_day(&few);
    assert_true(scan_prepare(&few) && open_scan(&third, 31, NULL, 32, NULL));
    third.stamp.pose = 2000;
    assert_true(scan_prepare(&third));
    const float *a = gonio_calib_flat(few.calib), *b = gonio_calib_flat(third.calib);
    double ratio = 0, square = 0, claimed = 0;
    int n = 0;
    for (int pass = 0; pass < 2; pass++) {
        for (int p = 0; p < PIXELS; p++) {
            if (gonio_calib_defects(few.calib)[p] || gonio_calib_defects(third.calib)[p]) {
                continue;
            }
            if (pass == 0) {
                ratio += a[p] / b[p];
                n++;
                continue;
            }
            const double d = a[p] / b[p] / (ratio / n) - 1;
            square += d * d;
            claimed +=
                (double)gonio_calib_flat_variance(few.calib)[p] + (double)gonio_calib_flat_variance(third.calib)[p];
        }
    }
    assert_true(n > PIXELS - 20);
    assert_near(square / claimed, 1, 5 * sqrt(2.0 / PIXELS));
    assert_near(gonio_calib_flat_variance(few.calib)[0], gonio_calib_flat_variance(many.calib)[0],
                0.1 * gonio_calib_flat_variance(many.calib)[0]);
    scan_close(&many);
    scan_close(&few);
    scan_close(&third);
    unlink(path);
}

static void test_files_that_do_not_fit(void **state) {
    (void)state;
    char path[] = "/tmp/gonio-flat-XXXXXX";
    static unsigned char bytes[104 + 8 * PIXELS + 4];
    close(mkstemp(path));
    sim_scan scan;
    assert_true(open_scan(&scan, 32, NULL, 8, NULL) && scan_prepare(&scan));
    assert_int_equal(gonio_calib_flat_save(scan.calib, path, NULL), GONIO_OK);
    scan_close(&scan);
    FILE *file = fopen(path, "rb");
    assert_true(fread(bytes, 1, sizeof bytes, file) == sizeof bytes && fgetc(file) == EOF);
    fclose(file);

    assert_false(open_scan(&scan, 33, NULL, 8, path));
    assert_int_equal(scan.error.status, GONIO_E_INPUT);
    assert_non_null(strstr(scan.error.message, "of the camera 'SIM-32'"));
    scan_close(&scan);
    // Another aperture or focus: the same sensor with another vignetting.
    assert_true(open_scan(&scan, 32, "camera.prnu_percent=3", 8, path));
    assert_false(scan_prepare(&scan));
    assert_int_equal(scan.error.status, GONIO_E_INPUT);
    assert_non_null(strstr(scan.error.message, "does not fit this session"));
    scan_close(&scan);
    assert_false(open_scan(&scan, 32, "camera.width=800", 8, path));
    assert_non_null(strstr(scan.error.message, "of a sensor of 640 x 512"));
    scan_close(&scan);

    const struct {
        size_t at, size;
        unsigned char with;
        const char *says;
    } faults[] = {{0, sizeof bytes, 'X', "not a flat field"},
                  {8, sizeof bytes, 9, "not a flat field of version"},
                  {24, sizeof bytes, 255, "of the window"},
                  {104 + 1000, sizeof bytes, 1, "checksum"},
                  {sizeof bytes - 1, sizeof bytes, 77, "checksum"},
                  {0, 50, 'G', "header"},
                  {0, 104 + 8 * PIXELS, 'G', "shorter"}};
    for (size_t k = 0; k < sizeof faults / sizeof *faults; k++) {
        const unsigned char kept = bytes[faults[k].at];
        bytes[faults[k].at] = bytes[faults[k].at] == faults[k].with && faults[k].size == sizeof bytes
                                  ? (unsigned char)~faults[k].with
                                  : faults[k].with;
        file = fopen(path, "wb");
        fwrite(bytes, 1, faults[k].size, file);
        fclose(file);
        bytes[faults[k].at] = kept;
        assert_false(open_scan(&scan, 32, NULL, 8, path));
        assert_int_equal(scan.error.status, GONIO_E_INPUT);
        assert_string_equal(scan.error.file, path);
        if (strstr(scan.error.message, faults[k].says) == NULL) {
            fail_msg("case %zu says: %s", k, scan.error.message);
        }
        scan_close(&scan);
    }
    unlink(path);
}

// ---- the reference's own BRDF ----

// Responsivity from a panel that is not Lambertian: the "reference" is a sample of a broad lobe, measured where its
// brightness changes by some ten per cent over the view. With its BRDF the map is flat within its noise (this sensor
// has neither PRNU nor vignetting); taken as Lambertian it is not.
static void test_panel_that_is_not_lambertian(void **state) {
    (void)state;
    static const char spec[] = "ward:rho_d=0.5,rho_s=0.3,alpha=0.4";
    static const char *const settings[] = {"camera.prnu_percent=0",
                                           "camera.vignetting_percent=0",
                                           "camera.hot_pixel_percent=0",
                                           "axis light_theta.pointing_deg=0",
                                           "axis camera_theta.pointing_deg=0",
                                           "stray.glare_percent=0",
                                           "camera.fx_px=2000",
                                           NULL};
    const gonio_pair pose = {.theta_i = gonio_radians(GONIO_REFERENCE_THETA_I_DEG)};
    double scatter[2];
    for (int own = 0; own < 2; own++) {
        sim_scan scan;
        assert_true(scan_open(&scan, spec, 34, settings, SIDE));
        gonio_rig_facts *facts = &scan.rig.facts;
        double f;
        gonio_model_eval_pair(gonio_sim_truth(scan.sim), &pose, &f);
        facts->reference_reflectance[0] = GONIO_PI * f;
        snprintf(facts->reference_brdf, sizeof facts->reference_brdf, "%s%s", own ? "spec:" : "", own ? spec : "");
        gonio_calib_free(scan.calib);
        assert_int_equal(gonio_calib_new(&scan.camera, facts, &scan.window, &scan.calib, NULL), GONIO_OK);
        for (int i = 0; i < 8; i++) {
            assert_true(scan_capture(&scan, 0, i < 4 ? 2e-5 : 1));
            assert_int_equal(gonio_calib_add_dark(scan.calib, &scan.exposures[0], NULL), GONIO_OK);
        }
        scan.rig.lamp->set_shutter(scan.rig.lamp_device, true, NULL);
        assert_true(scan_move(&scan, &pose));
        for (int i = 0; i < 32; i++) {
            assert_true(scan_capture(&scan, 0, 0.012));
            assert_int_equal(gonio_calib_add_reference(scan.calib, &pose, &scan.exposures[0], NULL), GONIO_OK);
        }
        assert_true(scan_ok(&scan, gonio_calib_prepare(scan.calib, &scan.error), "prepare"));
        double sum = 0, square = 0, claimed = 0;
        for (int p = 0; p < PIXELS; p++) {
            const double k = gonio_calib_flat(scan.calib)[p];
            sum += k / PIXELS;
            square += k * k / PIXELS;
            claimed += (double)gonio_calib_flat_variance(scan.calib)[p] / PIXELS;
        }
        scatter[own] = sqrt((square / (sum * sum) - 1) / claimed);
        scan_close(&scan);
    }
    assert_near(scatter[1], 1, 5 * sqrt(0.5 / PIXELS));
    assert_true(scatter[0] > 3);
}

static void test_brdf_that_is_none(void **state) {
    (void)state;
    const gonio_camera_info camera = {.width = 8, .height = 8, .bits = 12, .fx = 100, .fy = 100};
    gonio_rig_facts facts = {.light_distance_mm = 100,
                             .camera_distance_mm = 100,
                             .region_radius_mm = 1,
                             .reference_reflectance = {0.99},
                             .reference_brdf = "/nowhere/white.gonio"};
    gonio_calib *calib;
    assert_int_not_equal(gonio_calib_new(&camera, &facts, &(gonio_window){0, 0, 8, 8}, &calib, NULL), GONIO_OK);
    assert_null(calib);
    gonio_error error = {0};
    strcpy(facts.reference_brdf, "spec:lambert:rho=0");
    assert_int_equal(gonio_calib_new(&camera, &facts, &(gonio_window){0, 0, 8, 8}, &calib, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.message, "must be above 0"));
}

// ---- its certificate ----

static void read_text(const char *text, gonio_reflectance *r, gonio_status expected, long long line) {
    char path[64];
    gonio_error error = {0};
    scratch_file(path, text, strlen(text));
    assert_int_equal(gonio_reflectance_read(path, r, &error), expected);
    if (expected != GONIO_OK) {
        assert_string_equal(error.file, path);
        assert_int_equal(error.line, line);
        assert_null(r->row);
    }
    unlink(path);
}

// A straight line's mean over a symmetric band is its value at the centre; a bent one's lies between.
static void test_bands(void **state) {
    (void)state;
    gonio_reflectance r;
    double value, sigma;
    read_text("# made up\nnm, reflectance, sigma\n400,0.90,0.002\n500,0.94,0.004\r\n\n700,1.02,0.008\n", &r, GONIO_OK,
              0);
    assert_int_equal(r.n, 3);
    assert_int_equal(gonio_reflectance_band(&r, 550, 100, &value, &sigma, NULL), GONIO_OK);
    assert_near(value, 0.96, 1e-12);
    assert_near(sigma, 0.005, 1e-12);
    assert_int_equal(gonio_reflectance_band(&r, 700, 0, &value, &sigma, NULL), GONIO_OK);
    assert_near(value, 1.02, 1e-12);
    gonio_error error = {0};
    assert_int_equal(gonio_reflectance_band(&r, 450, 80, &value, &sigma, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.message, "370"));
    assert_int_equal(gonio_reflectance_band(&r, NAN, 1, &value, &sigma, NULL), GONIO_E_INPUT);
    gonio_reflectance_free(&r);
    read_text("400,0.9,0\n500,1.0,0\n600,0.9,0\n", &r, GONIO_OK, 0);
    assert_int_equal(gonio_reflectance_band(&r, 500, 50, &value, &sigma, NULL), GONIO_OK);
    // Of a Gaussian, cut at one FWHM, the mean distance is 0.318 FWHM: 1.6 % at 1 per 1000 nm.
    assert_near(value, 1 - 0.001 * 0.318 * 50, 1e-3);
    gonio_reflectance_free(&r);
}

static void test_bad_certificates(void **state) {
    (void)state;
    gonio_reflectance r;
    static const char *const texts[] = {"",
                                        "nm,reflectance,sigma\n",
                                        "400,0.9\n",
                                        "400,0.9,0.1,7\n",
                                        "400,0.9,0.01\n400,0.9,0.01\n",
                                        "400,-1,0.01\n",
                                        "400,0.9,nan\n",
                                        "400,0.9,1\n",
                                        "400,0.9,0.1\nx\n"};
    static const long long lines[] = {-1, -1, 1, 1, 2, 1, 1, 1, 2};
    for (size_t k = 0; k < sizeof texts / sizeof *texts; k++) {
        read_text(texts[k], &r, GONIO_E_INPUT, lines[k]);
    }
    gonio_error error = {0};
    assert_int_equal(gonio_reflectance_read("/nowhere/table.csv", &r, &error), GONIO_E_INPUT);
}

// Lambert: 1. A broad lobe: against the plain midpoint rule over the hemisphere, 400 x 800 directions.
static void test_factor(void **state) {
    (void)state;
    gonio_model *model;
    assert_int_equal(gonio_model_from_spec("lambert:rho=0.7", &model, NULL), GONIO_OK);
    assert_near(gonio_reflectance_factor(model, 0, 8), 1, 1e-12);
    gonio_model_free(model);
    assert_int_equal(gonio_model_from_spec("ward:rho_d=0.8,rho_s=0.1,alpha=0.6", &model, NULL), GONIO_OK);
    const gonio_vec3 wi = gonio_direction(gonio_radians(8), 0);
    double sum = 0;
    for (int i = 0; i < 400; i++) {
        const double theta = (i + 0.5) * GONIO_PI / 800;
        for (int j = 0; j < 800; j++) {
            sum += gonio_model_eval_channel(model, wi, gonio_direction(theta, (j + 0.5) * GONIO_PI / 400), 0) *
                   cos(theta) * sin(theta) * (GONIO_PI / 800) * (GONIO_PI / 400);
        }
    }
    const double f = gonio_model_eval_channel(model, gonio_direction(GONIO_PI / 4, 0), (gonio_vec3){0, 0, 1}, 0);
    assert_near(gonio_reflectance_factor(model, 0, 8), GONIO_PI * f / sum, 1e-3);
    gonio_model_free(model);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_file_stands_in_for_the_reference),
        cmocka_unit_test(test_files_that_do_not_fit),
        cmocka_unit_test(test_panel_that_is_not_lambertian),
        cmocka_unit_test(test_brdf_that_is_none),
        cmocka_unit_test(test_bands),
        cmocka_unit_test(test_bad_certificates),
        cmocka_unit_test(test_factor),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
