// SPDX-License-Identifier: BSD-3-Clause
// What a samples table says in its comments, its header and its numbers is heeded or refused, in whatever words.
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

#include "gonio/io.h"
#include "gonio/plan.h"
#include "tests/fuzz/memory_file.h"
#include "tests/unit/near.h"

#define HEADER "theta_i,phi_i,theta_o,phi_o"
#define BODY HEADER ",r\n10,0,60,0,0.25\n20,0,30,0,0.5\n"

static gonio_samples *read_text(const char *text, char *notes) {
    gonio_samples *s;
    gonio_read_report report;
    gonio_error error = {0};
    if (gonio_read(memory_file((const uint8_t *)text, strlen(text)), NULL, &s, &report, &error) != GONIO_OK) {
        fail_msg("%s\nline %lld: %s", text, error.line, error.message);
    }
    if (notes != NULL) {
        snprintf(notes, sizeof report.notes, "%s", report.notes);
    }
    return s;
}

static void refused(const char *text, const char *says) {
    gonio_samples *s;
    gonio_error error = {0};
    if (gonio_read(memory_file((const uint8_t *)text, strlen(text)), NULL, &s, NULL, &error) != GONIO_E_INPUT ||
        strstr(error.message, says) == NULL) {
        fail_msg("%s\nexpected an error with '%s', found '%s'", text, says, error.message);
    }
}

static void remarks_that_could_change_values_are_refused(void **state) {
    (void)state;
    static const char *const lines[] = {"angles in rad",
                                        "angles in gradians",
                                        "Values in %",
                                        "theta is elevation",
                                        "Theta measured from surface",
                                        "phi_o relative to phi_i",
                                        "multiply by 0.01",
                                        "scale factor 0.01",
                                        "values x 1000",
                                        "log scale",
                                        "dB",
                                        "normalised to the peak",
                                        "normalized to 1 at 0/45",
                                        "relative to Spectralon",
                                        "arbitrary units",
                                        "counts",
                                        "luminance factor",
                                        "radiance coefficient",
                                        "theta_i phi_i BRDF [%]",
                                        "R = pi * BRDF",
                                        "Winkel in Bogenmass",
                                        "Einheit: %",
                                        "Gr\303\266\303\237e: Strahldichtekoeffizient",
                                        "grandeur = facteur de luminance",
                                        "bilateral symmetry",
                                        "symmetry: plane symmetrical",
                                        "s-polarized light",
                                        "lambda in angstrom",
                                        "BRDF multiplied by cosine of the viewing angle",
                                        "specular direction at phi = 0"};
    for (size_t k = 0; k < sizeof lines / sizeof *lines; k++) {
        char text[400];
        snprintf(text, sizeof text, "# %s\n" BODY, lines[k]);
        refused(text, lines[k]);
    }
    refused("# BTDF\n" BODY, "speaks of transmission");
    refused("# BSDF type: transmission\n" BODY, "speaks of transmission");
}

static void remarks_that_could_not_are_taken(void **state) {
    (void)state;
    static const char *const lines[] = {"units: sr\342\201\273\302\271",
                                        "Units = [1/sr]",
                                        "unit: 1/(sr)",
                                        "unit\303\251: 1/sr",
                                        "quantity: BRDF (sr^-1)",
                                        "angles in degrees",
                                        "Values are BRDF in 1/sr",
                                        "50 % humidity",
                                        "irradiance 300 lx",
                                        "radiance meter: LMT",
                                        "dark counts subtracted",
                                        "divided by the reference signal",
                                        "operator: Rad Kowalski",
                                        "lamp current in A",
                                        "Wavelength: 550 nm",
                                        "symmetry = isotropic",
                                        "BRDF [1/sr]",
                                        "3 scans averaged"};
    for (size_t k = 0; k < sizeof lines / sizeof *lines; k++) {
        char text[400];
        snprintf(text, sizeof text, "# %s\n" BODY, lines[k]);
        gonio_samples *s = read_text(text, NULL);
        assert_near(s->values[0], 0.25, 0);
        gonio_samples_free(s);
    }
}

static void declarations_are_heeded_in_many_words(void **state) {
    (void)state;
    static const struct {
        const char *line;
        double first; // value
    } cases[] = {{"value: f_r*cos(theta_r)", 0.5},
                 {"Quantity: BRDF cos(theta_o)", 0.5},
                 {"values are pi*BRDF", 0.25 / GONIO_PI},
                 {"Values: reflectance factor", 0.25 / GONIO_PI},
                 {"missing values are 0.25", 0.5},
                 {"NaN value = 0.25", 0.5},
                 {"no data: 0.25", 0.5}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        char text[400];
        snprintf(text, sizeof text, "# %s\n" BODY, cases[k].line);
        gonio_samples *s = read_text(text, NULL);
        assert_near(s->values[0], cases[k].first, 1e-12);
        gonio_samples_free(s);
    }
    gonio_samples *s = read_text("# type: BTDF\n" BODY, NULL);
    assert_near(gonio_degrees(s->pairs[0].theta_o), 120, 1e-9);
    gonio_samples_free(s);
    s = read_text("# BTDF\n# halves = reflection,transmission\n" BODY, NULL);
    assert_near(gonio_degrees(s->pairs[0].theta_o), 60, 1e-9);
    gonio_samples_free(s);
}

// A column beside one of values; %s is its name.
static char *beside(const char *name, char text[300]) {
    snprintf(text, 300, HEADER ",brdf,%s\n1,0,2,0,0.5,0.25\n1,0,3,0,0.5,0.25\n", name);
    return text;
}

static void names_of_columns(void **state) {
    (void)state;
    char text[300];
    static const char *const sigmas[] = {
        "std", "STDEV",        "std. dev.",         "u",        "u(f_r)",   "uncert", "standard_error",
        "sem", "Unsicherheit", "\303\251cart-type", "\302\261", "brdf err", "u_brdf", "brdf-std"};
    for (size_t k = 0; k < sizeof sigmas / sizeof *sigmas; k++) {
        gonio_samples *s = read_text(beside(sigmas[k], text), NULL);
        assert_true(s->channels == 1 && s->sigma_random != NULL && s->sigma_random[0] == 0.25);
        gonio_samples_free(s);
    }
    static const char *const others[] = {
        "U",    "U(k=2)",          "U95", "expanded_uncertainty", "rel_unc", "unc_rel", "uncertainty (%)", "variance",
        "ci95", "brdf_std_percent"};
    for (size_t k = 0; k < sizeof others / sizeof *others; k++) {
        refused(beside(others[k], text), "no standard uncertainty");
    }
    static const char *const asides[] = {
        "id",       "sampleID", "tempC", "Temperature [K]", "Zeit",      "Temperatur", "monitor",
        "int_time", "rep",      "aoi",   "phase_angle",     "serial no", "gain_db"};
    for (size_t k = 0; k < sizeof asides / sizeof *asides; k++) {
        gonio_samples *s = read_text(beside(asides[k], text), NULL);
        assert_true(s->channels == 1 && s->sigma_random == NULL);
        gonio_samples_free(s);
    }
    static const char *const unknown[] = {"noise",  "min", "n",    "x_mm", "spot", "alpha",
                                          "filter", "pol", "band", "t",    "L"};
    for (size_t k = 0; k < sizeof unknown / sizeof *unknown; k++) {
        refused(beside(unknown[k], text), "may be a channel or not");
    }
    static const char *const foreign[] = {"brdf [%]",    "r (V)",     "BRDFcos",         "lnBRDF", "ccBRDF",
                                          "reflectance", "luminance", "radiance_factor", "f_r_pi", "relative_brdf",
                                          "brdf_norm",   "signal",    "wavenumber",      "eV",     "Frequency (THz)"};
    for (size_t k = 0; k < sizeof foreign / sizeof *foreign; k++) {
        refused(beside(foreign[k], text), "no f_r");
    }
    static const char *const channels[] = {"BRDF [1/sr]", "g (sr^-1)", "550nm", "550 nm", "f_r11", "nir", "ch2", "Y"};
    for (size_t k = 0; k < sizeof channels / sizeof *channels; k++) {
        gonio_samples *s = read_text(beside(channels[k], text), NULL);
        assert_true(s->channels == 2 && strcmp(s->channel_names[1], channels[k]) == 0);
        gonio_samples_free(s);
    }
}

static void columns_of_wavelengths(void **state) {
    (void)state;
    static const char *const names[] = {"wavelength",  "Wavelength / nm", "lambda/nm",
                                        "wave_length", "wavelengthNm",    "WL(nm)",
                                        "\316\273",    "\316\273 [nm]",   "Wellenl\303\244nge"};
    char text[400];
    for (size_t k = 0; k < sizeof names / sizeof *names; k++) {
        snprintf(text, sizeof text, HEADER ",%s,brdf\n1,0,2,0,450,1\n1,0,2,0,550,2\n", names[k]);
        gonio_samples *s = read_text(text, NULL);
        assert_true(s->n == 1 && s->channels == 2 && strcmp(s->channel_names[1], "550nm") == 0 && s->values[1] == 2);
        gonio_samples_free(s);
    }
    snprintf(text, sizeof text, HEADER ",\316\273 (\302\265m),brdf\n1,0,2,0,0.45,1\n1,0,2,0,0.55,2\n");
    gonio_samples *s = read_text(text, NULL);
    assert_string_equal(s->channel_names[1], "550nm");
    gonio_samples_free(s);
    refused(HEADER ",wavelength_A,brdf\n1,0,2,0,4500,1\n", "nm and um are read");
    refused(HEADER ",wavelength [\303\205],brdf\n1,0,2,0,4500,1\n", "nm and um are read");
}

// Which columns are channels the file may say, and does where their names would not.
static void channels_are_declared(void **state) {
    (void)state;
    gonio_samples *s = read_text("# channels = r, spot\n" HEADER ",r,spot,bar\n1,0,2,0,1,2,3\n", NULL), *again;
    assert_true(s->channels == 2 && s->values[1] == 2);
    char path[] = "/tmp/gonio-tables-XXXXXX";
    close(mkstemp(path));
    assert_int_equal(gonio_write_samples(s, path, NULL), GONIO_OK);
    assert_int_equal(gonio_read(path, NULL, &again, NULL, NULL), GONIO_OK);
    assert_true(again->channels == 2 && strcmp(again->channel_names[1], "spot") == 0 && again->values[1] == 2);
    gonio_samples_free(again);
    gonio_samples_free(s);
    s = read_text(HEADER ",r,foo,sigma_r,sigma_foo\n1,0,2,0,1,2,3,4\n", NULL); // what has a sigma is a channel
    assert_true(s->channels == 2 && s->sigma_random[1] == 4);
    gonio_samples_free(s);
    s = read_text(HEADER ",left eye,right eye\n1,0,2,0,1,2\n", NULL);
    assert_int_equal(s->channels, 2);
    gonio_samples_free(s);
    unlink(path);
}

static void numbers_that_stand_for_none(void **state) {
    (void)state;
    static const char *const fills[] = {"99",
                                        "999",
                                        "9999",
                                        "99999",
                                        "999.9",
                                        "4095",
                                        "65535",
                                        "1e10",
                                        "1e20",
                                        "1e300",
                                        "3.4028235e38",
                                        "9.96921e36",
                                        "1.7976931348623157e308"};
    char text[400], notes[4096];
    for (size_t k = 0; k < sizeof fills / sizeof *fills; k++) {
        snprintf(text, sizeof text, HEADER ",r\n1,0,2,0,1\n1,0,3,0,%s\n1,0,4,0,%s\n1,0,5,0,2\n1,0,6,0,3\n", fills[k],
                 fills[k]);
        gonio_samples *s = read_text(text, notes);
        assert_true(s->n == 3 && s->values[1] == 2 && strstr(notes, "2 rows with") != NULL &&
                    strstr(notes, "line 3") != NULL);
        gonio_samples_free(s);
    }
    // A peak may be any number.
    gonio_samples *s = read_text(HEADER ",r\n1,0,2,0,1\n1,0,3,0,60\n1,0,4,0,99\n1,0,5,0,2\n", notes);
    assert_true(s->n == 4 && notes[0] == 0);
    gonio_samples_free(s);
    // And what has all digits of a double was computed.
    s = read_text(HEADER ",r\n1,0,2,0,1\n1,0,3,0,2\n1,0,4,0,1.2345678912345e20\n1,0,5,0,2\n", notes);
    assert_true(s->n == 4);
    gonio_samples_free(s);
    refused(HEADER ",r\n1,0,2,0,-5\n1,0,3,0,1\n", "--missing -5");
}

// A lobe on a matt surface, scanned in its plane, with another value within 8 deg of the light.
static gonio_samples *scan(double value, double floor_at, char *notes) {
    char *text = malloc(60000);
    size_t n = (size_t)sprintf(text, HEADER ",r\n");
    static const int incidences[] = {10, 20, 30, 45, 60};
    for (int i = 0; i < 5; i++) {
        for (int o = -75; o <= 75; o += 3) {
            const int ti = incidences[i];
            const double matt = fmax(0.1 * (floor_at == 0) + exp(-pow((ti + o) / 10.0, 2)), floor_at);
            n += (size_t)sprintf(text + n, "%d,0,%d,%d,%.6g\n", ti, abs(o), o >= 0 ? 0 : 180,
                                 abs(ti - o) < 8 && value >= 0 ? value : matt);
        }
    }
    gonio_samples *s = read_text(text, notes);
    free(text);
    return s;
}

static void blocks_of_one_value(void **state) {
    (void)state;
    static const double blocks[] = {0, 1e-5, 0.002};
    char notes[4096];
    for (size_t k = 0; k < sizeof blocks / sizeof *blocks; k++) {
        gonio_samples *s = scan(blocks[k], 0, notes);
        assert_int_equal(s->n, 5 * 51 - 25);
        assert_non_null(strstr(notes, "25 rows of"));
        gonio_samples_free(s);
    }
    // Nothing is left out of a plain scan, a plateau, a floor or a bright block, which may be a lobe.
    for (int k = 0; k < 4; k++) {
        gonio_samples *s = scan(k == 1 ? 0.1 : k == 3 ? 5 : -1, k == 2 ? 0.002 : 0, notes);
        assert_int_equal(s->n, 5 * 51);
        gonio_samples_free(s);
    }
}

// Tables of models have many equal values by symmetry, which mean nothing.
static void symmetry_is_no_block(void **state) {
    (void)state;
    static const char *const specs[] = {"ward:rho_d=0.1,rho_s=0.3,alpha_x=0.05,alpha_y=0.3",
                                        "phong:rho_d=0.2,rho_s=0.7,n=40", "ggx:rho_s=0.9,alpha=0.05"};
    for (size_t k = 0; k < sizeof specs / sizeof *specs; k++) {
        gonio_model *m;
        gonio_plan *plan;
        gonio_samples *s, *back;
        char path[] = "/tmp/gonio-tables-XXXXXX";
        close(mkstemp(path));
        assert_int_equal(gonio_model_from_spec(specs[k], &m, NULL), GONIO_OK);
        assert_int_equal(gonio_plan_make("uniform:30,anisotropic=1", 1, &plan, NULL), GONIO_OK);
        assert_int_equal(gonio_samples_of_model(m, plan->poses, plan->n, 1, &s, NULL), GONIO_OK);
        for (int over = 0; over < 2; over++) {
            for (size_t i = 0; i < s->n && over == 1; i++) {
                s->values[i] /= cos(s->pairs[i].theta_i);
            }
            assert_int_equal(gonio_write_samples(s, path, NULL), GONIO_OK);
            assert_int_equal(gonio_read(path, NULL, &back, NULL, NULL), GONIO_OK);
            assert_int_equal(back->n, s->n);
            gonio_samples_free(back);
        }
        unlink(path);
        gonio_samples_free(s);
        gonio_plan_free(plan);
        gonio_model_free(m);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(remarks_that_could_change_values_are_refused),
        cmocka_unit_test(remarks_that_could_not_are_taken),
        cmocka_unit_test(declarations_are_heeded_in_many_words),
        cmocka_unit_test(names_of_columns),
        cmocka_unit_test(columns_of_wavelengths),
        cmocka_unit_test(channels_are_declared),
        cmocka_unit_test(numbers_that_stand_for_none),
        cmocka_unit_test(blocks_of_one_value),
        cmocka_unit_test(symmetry_is_no_block),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
