// SPDX-License-Identifier: BSD-3-Clause
// Numbers in text are the same whatever locale the process has set: a German one, with a comma as the decimal point, is
// made for the test, and everything that reads or writes numbers is run in it and in "C".
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include <locale.h>

#include "base/number.h"
#include "base/text.h"
#include "gonio/gonio.h"
#include "tests/unit/near.h"
#include "tests/unit/session_folder.h"

// False where the system has no localedef or no sources of locales.
static bool set_comma_locale(void) {
    char command[256];
    snprintf(command, sizeof command, "localedef -c -i de_DE -f UTF-8 %s/de_DE.UTF-8 >/dev/null 2>&1", root);
    if (system(command) < 0) {
        return false;
    }
    setenv("LOCPATH", root, 1);
    const bool set = setlocale(LC_ALL, "de_DE.UTF-8") != NULL;
    unsetenv("LOCPATH");
    char text[8];
    snprintf(text, sizeof text, "%.1f", 0.5);
    return set && strcmp(text, "0,5") == 0;
}

static void put(const char *name, const char *text) {
    char file[160];
    snprintf(file, sizeof file, "%s/%s", root, name);
    FILE *stream = fopen(file, "wb");
    assert_non_null(stream);
    fputs(text, stream);
    fclose(stream);
}

static char *in_root(const char *name) {
    static char file[160];
    snprintf(file, sizeof file, "%s/%s", root, name);
    return file;
}

static void append_file(FILE *all, const char *name) {
    char *data;
    size_t size;
    gonio_error error = {0};
    if (gonio_file_read(in_root(name), 0, &data, &size, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    fwrite(data, 1, size, all);
    free(data);
}

#define DO(call)                                                                                                       \
    do {                                                                                                               \
        gonio_error error = {0};                                                                                       \
        if ((call) != GONIO_OK) {                                                                                      \
            fail_msg("%s: %s", #call, error.message);                                                                  \
        }                                                                                                              \
    } while (0)

static void add_bytes(FILE *all, const void *data, size_t size) { fwrite(data, 1, size, all); }

static void texts_of_base_and_fit(FILE *all) {
    gonio_model *model;
    gonio_plan *plan;
    gonio_samples *samples, *back;
    DO(gonio_model_from_spec("ward:rho_d=0.31,rho_s=0.25,alpha=0.15", &model, &error));
    DO(gonio_plan_make("nusselt:30,theta_max=71.5", 1, &plan, &error));
    add_bytes(all, plan->poses, plan->n * sizeof *plan->poses);
    DO(gonio_samples_of_model(model, plan->poses, plan->n, 0, &samples, &error));
    strcpy(samples->channel_names[0], "550.5nm");
    add_bytes(all, samples->values, samples->n * sizeof *samples->values);
    DO(gonio_write_samples(samples, in_root("samples.csv"), &error));
    append_file(all, "samples.csv");
    gonio_read_options options;
    gonio_read_options_default(&options);
    DO(gonio_read(in_root("samples.csv"), &options, &back, NULL, &error));
    add_bytes(all, back->values, back->n * sizeof *back->values);
    assert_true(gonio_samples_wavelength_nm(back, 0) == 550.5);
    gonio_samples_free(back);
    gonio_samples_free(samples);
    gonio_plan_free(plan);
    gonio_model_free(model);
}

static void texts_of_calib(FILE *all) {
    gonio_alignment alignment, back;
    gonio_alignment_nominal(1000.25, 900.125, &alignment);
    for (int k = 0; k < GONIO_ALIGNMENT_PARAMETERS; k++) {
        alignment.covariance[k * (GONIO_ALIGNMENT_PARAMETERS + 1)] = 1e-6 * (k + 0.1);
    }
    DO(gonio_alignment_write(&alignment, in_root("alignment.csv"), &error));
    append_file(all, "alignment.csv");
    DO(gonio_alignment_read(in_root("alignment.csv"), &back, &error));
    add_bytes(all, back.value, sizeof back.value);
    static gonio_response_curve curve = {.low = 0.125, .high = 0.875};
    for (size_t j = 0; j < sizeof curve.exposure / sizeof *curve.exposure; j++) {
        curve.exposure[j] = (double)j / (double)(sizeof curve.exposure / sizeof *curve.exposure);
    }
    DO(gonio_response_write(&curve, in_root("response.csv"), &error));
    append_file(all, "response.csv");
    put("tile.csv", "nm,reflectance,sigma\n380.5,0.97,0.002\n780.5,0.985,0.0025\n");
    gonio_reflectance tile;
    DO(gonio_reflectance_read(in_root("tile.csv"), &tile, &error));
    assert_int_equal(tile.n, 2);
    add_bytes(all, tile.row, sizeof *tile.row * 2);
    gonio_reflectance_free(&tile);
}

// A rig file with fractions, measured and replayed: the journal's texts and all results are those of "C".
static void a_measure(FILE *all, const char *session_name) {
    put("rig.ini", "[rig]\nlight_distance_mm = 950.5\n[camera]\nwidth = 44\nheight = 44\nwhite_e_per_s = 4e6\n"
                   "read_noise_e = 4.5\nexposure_max_s = 0.06\nexposure_min_s = 0.000001\n[sample]\n"
                   "region_radius_mm = 1.5\nspec = ward:rho_d=0.3,rho_s=0.2,alpha=0.35\n[scan]\nsettle_s = 0.25\n");
    put("curve.csv", "0,0\n0.25,0.5\n0.625,0.875\n1,1\n"); // the camera's response, simulated and undone
    char ini[200], response[200];
    snprintf(ini, sizeof ini, "%s/rig.ini", root);
    snprintf(response, sizeof response, "camera.response=%s/curve.csv", root);
    const char *const settings[] = {response};
    const gonio_rig_file_options which = {.path = ini, .settings = settings, .n_settings = 1, .seed = 3, .threads = 1};
    gonio_rig_file *rig;
    gonio_session *session;
    gonio_measure_options options;
    gonio_outcome outcome;
    gonio_replay_report report;
    gonio_measure_options_default(&options);
    options.plan = "nusselt:6,theta_max=70.5";
    options.fit.method = "mba";
    options.threads = 1;
    DO(gonio_rig_file_open(&which, &rig, &error));
    DO(gonio_measure_begin(in_root(session_name), rig, &options, &session, &error));
    gonio_rig_file_close(rig);
    DO(gonio_rig_file_reopen(session, NULL, &rig, &error)); // what was journalled is read back
    DO(gonio_measure_run(session, rig, &options, &outcome, &error));
    char *text;
    DO(gonio_session_get(session, "sim.settings", &text, &error));
    fputs(text, all);
    free(text);
    add_bytes(all, outcome.samples->values, outcome.samples->n * sizeof *outcome.samples->values);
    fputs(outcome.samples_sha256, all);
    fputs(outcome.model_sha256, all);
    gonio_outcome_free(&outcome);
    DO(gonio_replay(session, &options, &outcome, &report, &error));
    assert_true(report.equal);
    gonio_outcome_free(&outcome);
    gonio_session_close(session);
    gonio_rig_file_close(rig);
}

static char *everything(const char *session_name, size_t *size) {
    char *all;
    FILE *stream = open_memstream(&all, size);
    texts_of_base_and_fit(stream);
    texts_of_calib(stream);
    a_measure(stream, session_name);
    fclose(stream);
    return all;
}

static void a_comma_changes_nothing(void **state) {
    (void)state;
    size_t size, size_there;
    char *here = everything("c", &size);
    if (!set_comma_locale()) {
        free(here);
        setlocale(LC_ALL, "C");
        print_message("no locale with a decimal comma can be made here\n");
        skip();
    }
    char *there = everything("de", &size_there);
    char comma[8];
    snprintf(comma, sizeof comma, "%.1f", 0.5); // the process still has its own locale
    setlocale(LC_ALL, "C");
    assert_string_equal(comma, "0,5");
    assert_int_equal(size, size_there);
    assert_memory_equal(here, there, size);
    free(here);
    free(there);
}

static void numbers_have_points(void **state) {
    (void)state;
    const bool comma = set_comma_locale();
    char *end, text[16];
    assert_true(gonio_number_parse("1.5,7", &end) == 1.5 && *end == ',');
    gonio_number_format(text, sizeof text, "%.2f", 2.25);
    assert_string_equal(text, "2.25");
    setlocale(LC_ALL, "C");
    if (!comma) {
        skip();
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(numbers_have_points, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_comma_changes_nothing, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
