// SPDX-License-Identifier: BSD-3-Clause
// The simulated rig as a whole: specs, settings, truth, response files, bad input.
//
// Statistics: 2000 fixed seeds; one bound of 5 standard errors, 6e-7 for fresh seeds.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <unistd.h>

#include <cmocka.h>

#include "sim/internal.h"
#include "sim/response.h"
#include "tests/unit/near.h"
#include "tests/unit/sim_rig.h"

static const char *const small[] = {"camera.width=8", "camera.height=8", NULL};

static void shape_keys_are_taken_off(void **state) {
    (void)state;
    sim_rig r;
    sim_rig_open(&r, "ward:rho_d=0.3,rho_s=0.2,alpha=0.15,radius_mm=12,shape=sphere", 1, 1, small, NULL);
    assert_true(r.rig.facts.sphere);
    assert_near(r.rig.facts.sphere_radius_mm, 12, 0);
    sim_rig_close(&r);
    sim_rig_open(&r, "lambert:rho=0.5,plate_mm=80", 1, 1, small, NULL);
    assert_near(r.sim->settings.sample.plate_mm, 80, 0);
    sim_rig_close(&r);
    gonio_sim *sim;
    gonio_error error = {0};
    assert_int_equal(gonio_sim_new("lambert:rho=0.5,shape=cube", 1, &sim, &error), GONIO_E_USAGE);
    assert_non_null(strstr(error.message, "flat or sphere"));
    assert_null(sim);
    assert_int_equal(gonio_sim_new("velvet:rho=0.5", 1, &sim, &error), GONIO_E_USAGE);
    assert_null(sim);
}

static void settings_round_trip(void **state) {
    (void)state;
    const char *const changed[] = {"camera.width=48",
                                   "camera.height=40",
                                   "camera.k1=-0.3333333333333333",
                                   "camera.cx_px=22.1",
                                   "axis light_phi.max_deg=200",
                                   "reference.reflectance=0.9/0.8/0.7",
                                   "faults.camera_timeout=3:4x5",
                                   "faults.lamp_off=7",
                                   "sample.shape=sphere",
                                   "camera.pattern=grbg",
                                   NULL};
    sim_rig a, b;
    sim_rig_open(&a, "lambert:rho=0.6/0.3/0.1", 77, 1, changed, NULL);
    char *text = gonio_sim_settings(a.sim);
    assert_non_null(strstr(text, "faults.camera_timeout=3:4x5\n"));
    assert_non_null(strstr(text, "camera.fx_px=auto\n"));
    const char *lines[128];
    size_t n = 0;
    char *copy = strdup(text);
    for (char *line = strtok(copy, "\n"); line != NULL; line = strtok(NULL, "\n")) {
        lines[n++] = line;
    }
    lines[n] = NULL;
    sim_rig_open(&b, "lambert:rho=0.6/0.3/0.1", 77, 1, lines, NULL);
    char *again = gonio_sim_settings(b.sim);
    assert_string_equal(text, again);
    uint16_t *pixels[2];
    sim_rig *rigs[2] = {&a, &b};
    for (int k = 0; k < 2; k++) {
        pixels[k] = sim_rig_capture(rigs[k], sim_rig_full(&a), 0.01, sim_rig_move(rigs[k], 1, 20, 0, 30, 90));
        sim_rig_close(rigs[k]);
    }
    assert_memory_equal(pixels[0], pixels[1], 48 * 40 * 2);
    free(pixels[0]);
    free(pixels[1]);
    free(text);
    free(again);
    free(copy);
}

static void bad_settings_are_refused(void **state) {
    (void)state;
    const char *const bad[] = {"lamps.level=1",
                               "camera.colour=1",
                               "camera.width=7",
                               "camera.width=640.5",
                               "camera.bits=x",
                               "camera.read_noise_e=nan",
                               "camera.read_noise_e=-1",
                               "camera.pattern=xtrans",
                               "reference.reflectance=0.9/0.8",
                               "reference.reflectance=2",
                               "faults.lamp_off=-1",
                               "faults.lamp_off=3:x2",
                               "faults.lamp_off=3y",
                               "camera.response=",
                               "axis light_theta.speed_deg_per_s=0",
                               "camera.read_noise_e=",
                               "reference.reflectance=0.9/0.8/0.7/0.6"};
    gonio_sim *sim;
    assert_int_equal(gonio_sim_new("lambert:rho=0.5", 1, &sim, NULL), GONIO_OK);
    char *before = gonio_sim_settings(sim);
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        gonio_error error = {0};
        if (sim_rig_set(sim, bad[k], &error) != GONIO_E_INPUT || error.message[0] == 0) {
            fail_msg("'%s' was not refused", bad[k]);
        }
    }
    gonio_error error = {0};
    sim_rig_set(sim, "camera.colour=1", &error);
    assert_non_null(strstr(error.message, " read_noise_e "));
    sim_rig_set(sim, "lamps.level=1", &error);
    assert_non_null(strstr(error.message, "[axis camera_phi] [camera] [lamp]"));
    char *after = gonio_sim_settings(sim);
    assert_string_equal(before, after);
    free(before);
    free(after);
    gonio_sim_free(sim);
}

static void truth_has_the_cameras_channels(void **state) {
    (void)state;
    const gonio_vec3 w = gonio_direction(0.3, 0);
    const struct {
        const char *spec, *pattern;
        int channels;
        double value[3];
    } cases[] = {{"lambert:rho=0.5", "camera.pattern=auto", 1, {0.5}},
                 {"lambert:rho=0.6/0.3/0.1", "camera.pattern=auto", 3, {0.6, 0.3, 0.1}},
                 {"lambert:rho=0.6/0.3/0.3", "camera.pattern=mono", 1, {0.4}},
                 {"lambert:rho=0.5", "camera.pattern=bggr", 3, {0.5, 0.5, 0.5}}};
    for (int k = 0; k < 4; k++) {
        const char *const extra[] = {cases[k].pattern, NULL};
        sim_rig r;
        sim_rig_open(&r, cases[k].spec, 1, 1, small, extra);
        const gonio_model *truth = gonio_sim_truth(r.sim);
        assert_int_equal(truth->channels, cases[k].channels);
        double values[3];
        gonio_model_eval(truth, w, w, values);
        for (int c = 0; c < cases[k].channels; c++) {
            assert_near(values[c], cases[k].value[c] / GONIO_PI, 1e-12);
            assert_near(gonio_model_eval_channel(truth, w, w, c), values[c], 0);
        }
        sim_rig_close(&r);
    }
}

static void reference_scale_is_as_stated(void **state) {
    (void)state;
    enum { SEEDS = 2000 };
    double square = 0;
    for (uint64_t seed = 0; seed < SEEDS; seed++) {
        sim_rig r;
        sim_rig_open(&r, "lambert:rho=0.5", seed, 1, small, NULL);
        const double relative = r.sim->truth.reflectance[0] / r.rig.facts.reference_reflectance[0] - 1;
        assert_near(r.rig.facts.reference_relative_sigma, 0.002, 1e-15);
        square += relative * relative / SEEDS;
        sim_rig_close(&r);
    }
    assert_near(square / (0.002 * 0.002), 1, 5 * sqrt(2.0 / SEEDS));
}

static gonio_status read_curve(const char *content, sim_response **response, gonio_error *error) {
    char path[] = "/tmp/gonio-curve-XXXXXX";
    const int fd = mkstemp(path);
    assert_int_equal(write(fd, content, strlen(content)), (ssize_t)strlen(content));
    close(fd);
    const gonio_status status = gonio_sim_response_new(path, response, error);
    unlink(path);
    return status;
}

static void response_files(void **state) {
    (void)state;
    sim_response *response;
    gonio_error error = {0};
    assert_int_equal(read_curve("# curve\nexposure,value\n0,0\n0.25,0.5\n\n1,1\n", &response, &error), GONIO_OK);
    assert_near(gonio_sim_response_value(response, 0.25), 0.5, 1e-15);
    assert_near(gonio_sim_response_value(response, 0.625), 0.75, 1e-15);
    assert_near(gonio_sim_response_value(response, -0.01), -0.02, 1e-15);
    assert_near(gonio_sim_response_value(response, 3), 1, 0);
    gonio_sim_response_free(response);
    const struct {
        const char *content;
        long long line;
    } bad[] = {{"", -1},
               {"0,0\n0.5,0.6\n", -1},
               {"0,0\n0.5,0.6\n0.4,0.7\n1,1\n", 3},
               {"0,0\n0.5,0.6\n0.7,0.5\n1,1\n", 3},
               {"0,0\nx,0.6\n1,1\n", 2},
               {"0,0\n0.5;0.6\n1,1\n", 2},
               {"0,0\n0.5,nan\n1,1\n", 2},
               {"0,0\n0.5,0.6,7\n1,1\n", 2},
               {"0,0\n1,1.5\n", 2},
               {"0.1,0\n1,1\n", 1}};
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        if (read_curve(bad[k].content, &response, &error) != GONIO_E_INPUT || error.line != bad[k].line) {
            fail_msg("curve %zu: line %lld, expected %lld: %s", k, error.line, bad[k].line, error.message);
        }
        assert_null(response);
    }
    assert_int_equal(gonio_sim_response_new("/nonexistent/curve.csv", &response, &error), GONIO_E_INPUT);
    assert_int_equal(gonio_sim_response_new("gamma:0", &response, &error), GONIO_E_INPUT);
}

// The facts name the curve's file, unless the rig is told to keep it to itself.
static void facts_name_the_curve(void **state) {
    (void)state;
    char path[] = "/tmp/gonio-curve-XXXXXX", setting[64];
    const int fd = mkstemp(path);
    assert_int_equal(write(fd, "0,0\n0.25,0.5\n1,1\n", 17), 17);
    close(fd);
    snprintf(setting, sizeof setting, "camera.response=%s", path);
    for (int known = 0; known < 2; known++) {
        const char *const extra[] = {setting, known ? "camera.response_known=1" : "camera.response_known=0", NULL};
        sim_rig r;
        sim_rig_open(&r, "lambert:rho=0.5", 1, 1, small, extra);
        assert_string_equal(r.rig.facts.response_path, known ? path : "");
        sim_rig_close(&r);
    }
    unlink(path);
}

// What the sim says to have drawn is what the devices show.
static void true_facts(void **state) {
    (void)state;
    sim_rig r;
    sim_rig_open(&r, "lambert:rho=0.5", 31, 1, small, NULL);
    const gonio_stamp stamp = sim_rig_move(&r, 4, 10, 20, 30, 40);
    gonio_sim_facts facts;
    gonio_sim_true_facts(r.sim, stamp.clock_s, &facts);
    double value, sigma;
    assert_int_equal(r.rig.meter->read(r.sim, &stamp, 0, &value, &sigma, NULL), GONIO_OK);
    assert_near(value, facts.lamp_output, 6 * sigma);
    for (int k = 0; k < GONIO_AXES; k++) {
        const double off = gonio_degrees(facts.angles_rad[k]) - 10 * (k + 1);
        assert_true(off != 0 && fabs(off) < 6 * 0.01);
    }
    assert_near(facts.reference_reflectance[1], 0.99, 6 * 0.002);
    assert_true(facts.reference_reflectance[1] != 0.99);
    sim_rig_close(&r);
}

// A model from outside may be anything: a sample whose values are negative, infinite or no numbers gives frames all the
// same.
static void odd_eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    (void)wi;
    (void)wo;
    values[0] = *(const double *)(model + 1);
}

static void odd_models_give_frames(void **state) {
    (void)state;
    static const gonio_model_ops ops = {.kind = "odd", .eval = odd_eval};
    const double values[] = {-1, NAN, INFINITY, 1e300, -INFINITY};
    for (int k = 0; k < 5; k++) {
        struct {
            gonio_model head;
            double value;
        } odd = {{.ops = &ops, .channels = 1, .isotropic = true}, values[k]};
        sim_rig r;
        sim_rig_open(&r, "lambert:rho=0.5", 31, 1, small, NULL);
        gonio_model *seen = r.sim->seen;
        r.sim->seen = &odd.head;
        uint16_t *pixels = sim_rig_capture(&r, sim_rig_full(&r), 0.01, sim_rig_move(&r, 4, 10, 20, 30, 40));
        for (int i = 0; i < 64; i++) {
            const bool bright = values[k] > 1;
            assert_in_range(pixels[i], bright ? 4095 : 44, bright ? 4095 : 84); // black level and read noise
        }
        free(pixels);
        r.sim->seen = seen;
        sim_rig_close(&r);
    }
}

static void impossible_samples_are_refused(void **state) {
    (void)state;
    gonio_sim *sim;
    gonio_rig rig;
    gonio_error error = {0};
    assert_int_equal(gonio_sim_new("ward:rho_d=0.3,rho_s=0.2,alpha_x=0.1,alpha_y=0.3,shape=sphere", 1, &sim, &error),
                     GONIO_OK);
    assert_int_equal(gonio_sim_open(sim, 1, &rig, &error), GONIO_E_USAGE);
    assert_non_null(strstr(error.message, "anisotropic"));
    gonio_sim_free(sim);
    assert_int_equal(gonio_sim_new("lambert:rho=0.5,shape=sphere,radius_mm=1000", 1, &sim, &error), GONIO_OK);
    assert_int_equal(gonio_sim_open(sim, 1, &rig, &error), GONIO_E_USAGE);
    gonio_sim_free(sim);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(shape_keys_are_taken_off),
        cmocka_unit_test(settings_round_trip),
        cmocka_unit_test(bad_settings_are_refused),
        cmocka_unit_test(truth_has_the_cameras_channels),
        cmocka_unit_test(reference_scale_is_as_stated),
        cmocka_unit_test(response_files),
        cmocka_unit_test(impossible_samples_are_refused),
        cmocka_unit_test(facts_name_the_curve),
        cmocka_unit_test(true_facts),
        cmocka_unit_test(odd_models_give_frames),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
