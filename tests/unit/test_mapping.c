// SPDX-License-Identifier: BSD-3-Clause
// Tables as labs have them: one and the same few samples in many dresses, each read by its mapping to the known ones;
// what a mapping may not be; and what is guessed of such tables.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "gonio/io.h"
#include "io/map_file.h"
#include "io/table_guess.h"
#include "tests/unit/near.h"
#include "tests/unit/scratch.h"

enum { SETTINGS = 8 };

// The samples that all these tables hold: theta_i, phi_i, theta_o, phi_o in degrees, f_r in 1/sr.
static const double truth[5][5] = {
    {30, 0, 40, 0, 0.25}, {30, 0, 20, 0, 0.125}, {30, 0, 0, 180, 0.5}, {30, 0, 30, 180, 4}, {30, 0, 60, 180, 0.0625}};

typedef struct dress {
    const char *what, *text;
    gonio_format_setting settings[SETTINGS];
} dress;

// Values in another quantity are made of those above.
static const dress dresses[] = {
    {"semicolons and decimal commas, signed, behind a preamble",
     "Messung vom 3.4.2020; Labor 7\nProbe;Blech 3\n\nIncident_angle;Measure_angle;Wert\nGrad;Grad;1/sr\n"
     "30,0;-40;0,25\n30,0;-20;0,125\n30,0;0;0,5\n30,0;30,0;4\n30,0;60;6,25e-2\n",
     {{"columns", "theta_i=Incident_angle,theta_o=Measure_angle,value=Wert"},
      {"signed", "yes"},
      {"separator", ";"},
      {"decimal", ","},
      {"mirror-at", "0"}}},
    {"the same, separator and decimal sign as the text shows",
     "Incident_angle;Measure_angle;Wert\n30,0;-40;0,25\n30,0;-20;0,125\n30,0;0;0,5\n30,0;30,0;4\n30,0;60;0,0625\n",
     {{"columns", "theta_i=Incident_angle,theta_o=Measure_angle"}, {"signed", "yes"}, {"mirror-at", "0"}}},
    {"the mirror direction where the lobe is",
     "a\tb\tv\n30\t-40\t0.25\n30\t-20\t0.125\n30\t0\t0.5\n30\t30\t4\n30\t60\t0.0625\n",
     {{"columns", "theta_i=a,theta_o=b,value=v"}, {"signed", "yes"}, {"separator", "tab"}}},
    {"light and detector signed alike",
     "b v a\n-40 0.25 -30\n-20 0.125 -30\n0 0.5 -30\n30 4 -30\n60 0.0625 -30\n",
     {{"columns", "theta_i=a,theta_o=b,value=v"}, {"signed", "yes"}, {"mirror-at", "180"}}},
    {"no header, columns by number, the incidence a constant",
     "-40, 0.25\n-20, 0.125\n0, 0.5\n30, 4\n60, 0.0625\n",
     {{"columns", "theta_i=30,theta_o=#1,value=2"}, {"signed", "yes"}, {"mirror-at", "0"}}},
    {"theta_o and phi, mirror at 0",
     "theta_o|phi|v\n40|180|0.25\n20|-180|0.125\n0|0|0.5\n30|360|4\n60|0|0.0625\n",
     {{"columns", "theta_i=30deg,theta_o=theta_o,phi=phi,value=v"}, {"mirror-at", "0"}}},
    {"radians",
     "theta_i,theta_o,phi_o,v\n0.523598775598,0.698131700798,0,0.25\n0.523598775598,0.349065850399,0,0.125\n0."
     "523598775598,0,3."
     "141592653590,0.5\n"
     "0.523598775598,0.523598775598,3.141592653590,4\n0.523598775598,1.047197551197,3.141592653590,0.0625\n",
     {{"columns", "theta_i=theta_i,theta_o=theta_o,phi_o=phi_o,value=v"}, {"angles", "rad"}}},
    {"a constant in degrees in a table of radians",
     "to,po,v\n0.698131700798,0,0.25\n0.349065850399,0,0.125\n0,3.141592653590,0.5\n"
     "0.523598775598,3.141592653590,4\n1.047197551197,3.141592653590,0.0625\n",
     {{"columns", "theta_i=30deg,theta_o=to,phi_o=po,value=v"}, {"angles", "rad"}}},
    {"reflectance factors",
     "Theta in,Theta out,Azimuth,BRF\n30,40,0,0.785398163397448\n30,20,0,0.392699081698724\n30,0,180,1.5707963267949\n"
     "30,30,180,12.5663706143592\n30,60,180,0.196349540849362\n",
     {{"columns", "theta_i=Theta in,theta_o=Theta out,phi_o=Azimuth,value=BRF"}, {"quantity", "brf"}}},
    {"percent",
     "thetai,thetar,phir,R [%]\n30,40,0,78.5398163397448\n30,20,0,39.2699081698724\n30,0,180,157.07963267949\n"
     "30,30,180,1256.63706143592\n30,60,180,19.6349540849362\n",
     {{"columns", "theta_i=thetai,theta_o=thetar,phi_o=phir,value=R [%]"}, {"quantity", "percent"}}},
    {"f_r cos(theta_o), with a row at the horizon",
     "ti,to,po,v\n30,40,0,0.191511110779744\n30,20,0,0.117461577598239\n30,0,180,0.5\n30,30,180,3.46410161513775\n"
     "30,60,180,0.03125\n30,90,180,0\n",
     {{"columns", "theta_i=ti,theta_o=to,phi_o=po,value=v"}, {"quantity", "f_r_cos"}}},
    {"names alone, quotes, a comment mark before the header, other columns",
     "# made by hand\n# \"Incident angle (deg)\";\"View zenith\";\"View azimuth\";\"date\";\"BRDF\"\n"
     "30;40;0;\"1.1.\";0.25\n30;20;0;\"1.1.\";0.125\n30;0;180;\"1.1.\";0.5\n% remark\n30;30;180;\"1.1.\";4\n\n"
     "30;60;180;\"2.1.\";0.0625;\n",
     {{"columns", "auto"}, {"separator", "semicolon"}}},
    {"missing values",
     "ti to po v\n30 40 0 0.25\n30 20 0 0.125\n30 10 0 0\n30 0 180 0.5\n30 30 180 4\n30 35 180 0\n30 60 180 0.0625\n",
     {{"columns", "theta_i=ti,theta_o=to,phi_o=po,value=v"}, {"missing", "0"}}},
};

static gonio_read_options options_of(const gonio_format_setting *settings) {
    gonio_read_options options = {.seed = 1};
    for (int k = 0; k < SETTINGS && settings[k].name != NULL; k++) {
        options.settings[k] = settings[k];
    }
    return options;
}

static gonio_samples *read_text(const char *text, const gonio_read_options *options, const char *what) {
    char path[64];
    gonio_samples *s;
    gonio_error error = {.line = -1};
    scratch_file(path, text, strlen(text));
    const gonio_status status = gonio_read(path, options, &s, NULL, &error);
    unlink(path);
    if (status != GONIO_OK) {
        fail_msg("%s: line %lld: %s", what, error.line, error.message);
    }
    return s;
}

static void check_truth(const gonio_samples *s, const char *what) {
    if (s->n != 5 || s->channels != 1) {
        fail_msg("%s: %zu samples of %d channels", what, s->n, s->channels);
    }
    for (size_t i = 0; i < 5; i++) {
        const double *t = truth[i];
        const gonio_pair *p = &s->pairs[i],
                         q = {gonio_radians(t[0]), gonio_radians(t[1]), gonio_radians(t[2]), gonio_radians(t[3])};
        // Spellings differ: the directions are compared, turned about the normal so that the light stands at 0.
        const double turn = p->phi_i - q.phi_i;
        assert_near(p->theta_i, q.theta_i, 1e-11);
        assert_near(p->theta_o, q.theta_o, 1e-11);
        assert_near(sin(p->theta_o) * cos(p->phi_o - turn), sin(q.theta_o) * cos(q.phi_o), 1e-9);
        assert_near(sin(p->theta_o) * sin(p->phi_o - turn), sin(q.theta_o) * sin(q.phi_o), 1e-9);
        assert_near(s->values[i], t[4], 1e-12 * fabs(t[4]) + (t[4] == 0));
    }
}

static void every_dress_gives_the_same_samples(void **state) {
    (void)state;
    for (size_t k = 0; k < sizeof dresses / sizeof *dresses; k++) {
        const gonio_read_options options = options_of(dresses[k].settings);
        gonio_samples *s = read_text(dresses[k].text, &options, dresses[k].what);
        check_truth(s, dresses[k].what);
        gonio_samples_free(s);
    }
}

// Kept beside the data the mapping says the same; and what is given comes before it.
static void a_map_file_says_the_same(void **state) {
    (void)state;
    for (size_t k = 0; k < sizeof dresses / sizeof *dresses; k++) {
        char path[64], map[96];
        const gonio_read_options options = options_of(dresses[k].settings);
        gonio_read_report report;
        gonio_samples *s;
        gonio_error error = {0};
        scratch_file(path, dresses[k].text, strlen(dresses[k].text));
        snprintf(map, sizeof map, "%s" GONIO_MAP_ENDING, path);
        assert_int_equal(gonio_map_save(path, &options, &error), GONIO_OK);
        if (gonio_read(path, NULL, &s, &report, &error) != GONIO_OK) {
            fail_msg("%s: %s", dresses[k].what, error.message);
        }
        assert_non_null(strstr(report.notes, map));
        check_truth(s, dresses[k].what);
        gonio_samples_free(s);
        const gonio_read_options other = {.settings = {{"columns", "theta_i=no such,theta_o=#1"}}};
        assert_int_equal(gonio_read(path, &other, &s, NULL, &error), GONIO_E_INPUT);
        assert_non_null(strstr(error.message, "no such"));
        unlink(map);
        // Under another name it is given as that.
        assert_int_equal(gonio_map_save("/nonexistent/x", &options, &error), GONIO_E_IO);
        unlink(path);
    }
}

static void channels_sigma_and_wavelengths(void **state) {
    (void)state;
    static const char wide[] = "ti to po 450 550 std_x\n30 0 0 1 2 9\n30 10 0 3 4 9\n30 20 0 5 6 9\n";
    gonio_read_options options = {.settings = {{"columns", "theta_i=ti,theta_o=to,phi_o=po,450nm=#4,x=#5"}}};
    gonio_samples *s = read_text(wide, &options, "channels by name");
    assert_int_equal(s->channels, 2);
    assert_string_equal(s->channel_names[1], "x");
    assert_near(s->values[3], 4, 0);
    gonio_samples_free(s);
    static const char named[] = "theta_i;theta_o;phi;r;g;r_std;std_g\n30;0;0;1;2;0.5;0.25\n30;10;0;1;2;0.5;0.25\n";
    const gonio_read_options by_name = {.settings = {{"columns", "auto"}}};
    s = read_text(named, &by_name, "sigmas by name");
    assert_int_equal(s->channels, 2);
    assert_near(gonio_samples_sigma(s, 1, 1), 0.25, 0);
    gonio_samples_free(s);
    static const char with[] = "ti;to;po;v;u\n30;0;0;50;1\n30;10;0;25;2\n30;20;0;10;4\n";
    options.settings[0].value = "theta_i=ti,theta_o=to,phi_o=po,value=v,sigma=u";
    options.settings[1] = (gonio_format_setting){"quantity", "percent"};
    s = read_text(with, &options, "sigma");
    assert_non_null(s->sigma_random);
    assert_near(gonio_samples_sigma(s, 2, 0), 0.04 / GONIO_PI, 1e-15);
    gonio_samples_free(s);
    static const char tall[] = "w [nm];ti;to;po;v\n450;30;0;0;1\n550;30;0;0;2\n450;30;10;0;3\n550;30;10;0;4\n";
    options.settings[0].value = "theta_i=ti,theta_o=to,phi_o=po,value=v";
    options.settings[1] = (gonio_format_setting){"wavelength-column", "w [nm]"};
    s = read_text(tall, &options, "wavelengths in rows");
    assert_int_equal(s->channels, 2);
    assert_string_equal(s->channel_names[1], "550nm");
    assert_near(s->values[3], 4, 0);
    gonio_samples_free(s);
    options.wavelength_nm = 550;
    s = read_text(tall, &options, "one wavelength");
    assert_int_equal(s->channels, 1);
    assert_near(s->values[1], 4, 0);
    gonio_samples_free(s);
}

static void what_is_wrong_is_named(void **state) {
    (void)state;
    static const struct {
        const char *text;
        gonio_format_setting settings[SETTINGS];
        gonio_status status;
        long long line; // -1: none
        const char *says;
    } cases[] = {
        {"a b v\n30 0 1\n30 1x 1\n30 2 1\n", {{"columns", "theta_i=a,theta_o=b,value=v"}}, GONIO_E_INPUT, 3, "1x"},
        {"a b v\n30 0 1\n30 -1 1\n30 2 1\n", {{"columns", "theta_i=a,theta_o=b"}}, GONIO_E_INPUT, 3, "--signed"},
        {"a b v\n30 0 1\n30 91 1\n30 2 1\n", {{"columns", "theta_i=a,theta_o=b"}}, GONIO_E_INPUT, 3, "at most 90"},
        {"a b v\n1 0 1\n1 1.6 1\n1 1 1\n",
         {{"columns", "theta_i=a,theta_o=b"}, {"angles", "rad"}},
         GONIO_E_INPUT,
         3,
         "1.5707"},
        {"a b v\n30 0 1\n30 1\n30 2 1\n", {{"columns", "theta_i=a,theta_o=b"}}, GONIO_E_INPUT, 3, "3 columns"},
        {"a b v\n30 0 1\n30 1 1\n30 2 1\ntotal: 3\n",
         {{"columns", "theta_i=a,theta_o=b"}},
         GONIO_E_INPUT,
         5,
         "3 columns"},
        {"a b v\n30 0 1\n", {{"columns", "theta_i=c,theta_o=b"}}, GONIO_E_INPUT, 1, "'c'"},
        {"30 0 1\n", {{"columns", "theta_i=#1,theta_o=#2,value=#4"}}, GONIO_E_INPUT, 1, "#4"},
        {"a b v\n30 0 1\n", {{"columns", "theta_i=a"}}, GONIO_E_INPUT, 1, "theta_o"},
        {"a b v\n30 0 1\n", {{"columns", "theta_o=b"}}, GONIO_E_INPUT, 1, "theta_i"},
        {"a b c v\n30 0 1 1\n", {{"columns", "theta_i=a,theta_o=b,phi=c,phi_o=0"}}, GONIO_E_INPUT, 1, "phi"},
        {"a b v\n30 0 1\n", {{"columns", "theta_i=a,theta_o=a"}}, GONIO_E_INPUT, 1, "two things"},
        {"a b v %\n30 0 1 1\n", {{"columns", "theta_i=a,theta_o=b,value=%"}}, GONIO_E_INPUT, 1, "--quantity"},
        {"a;b;v\n30;0;1,5\n30;1;1,5\n30;1.5;1,5\n", {{"columns", "theta_i=a,theta_o=b"}}, GONIO_E_INPUT, 4, "comma"},
        {"hello\nyou\n", {{"columns", "theta_i=a,theta_o=b"}}, GONIO_E_INPUT, 1, "no table"},
        {"a b v\n30 0 1\n", {{"columns", "theta_i"}}, GONIO_E_USAGE, -1, "key=COLUMN"},
        {"a b v\n30 0 1\n", {{"columns", "theta_i=a,theta_i=b"}}, GONIO_E_USAGE, -1, "twice"},
        {"a b v\n30 0 1\n", {{"columns", "theta_i=30deg,theta_o=20deg"}}, GONIO_E_USAGE, -1, "constants"},
        {"a b v\n30 0 1\n", {{"columns", "theta_i=a,theta_o=b,percent=v"}}, GONIO_E_USAGE, -1, "percent"},
        {"a b v\n30 0 1\n", {{"separator", "x"}}, GONIO_E_USAGE, -1, "separator"},
        {"a b v\n30 0 1\n", {{"decimal", "x"}}, GONIO_E_USAGE, -1, "decimal"},
        {"a b v\n30 0 1\n", {{"separator", ","}, {"decimal", ","}}, GONIO_E_USAGE, -1, "comma"},
        {"a b v\n30 0 1\n", {{"quantity", "x"}}, GONIO_E_USAGE, -1, "quantity"},
        {"a b v\n30 0 1\n", {{"mirror-at", "90"}}, GONIO_E_USAGE, -1, "mirror-at"},
        {"a b v\n30 0 1\n", {{"map", "/nonexistent/map"}}, GONIO_E_INPUT, -1, "open"},
    };
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        char path[64];
        gonio_samples *s;
        gonio_error error = {.line = -1};
        const gonio_read_options options = options_of(cases[k].settings);
        scratch_file(path, cases[k].text, strlen(cases[k].text));
        const gonio_status status = gonio_read(path, &options, &s, NULL, &error);
        unlink(path);
        if (status != cases[k].status || s != NULL || error.line != cases[k].line ||
            strstr(error.message, cases[k].says) == NULL) {
            fail_msg("case %zu: %s, line %lld: %s", k, gonio_status_name(status), error.line, error.message);
        }
    }
}

static void bad_map_files_are_named(void **state) {
    (void)state;
    static const struct {
        const char *map, *says;
        long long line;
    } cases[] = {{"# a\nhello\n", "key = value", 2},          {"sigend = yes\n", "sigend", 1},
                 {"signed = perhaps\n", "no|yes", 1},         {"\ncolumns = theta_i\n", "key=COLUMN", 2},
                 {"signed = yes\nsigned = no\n", "twice", 2}, {"map = other\n", "map", 1}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        char path[64], map[96];
        gonio_samples *s;
        gonio_error error = {.line = -1};
        scratch_file(path, "a b v\n30 0 1\n", 13);
        snprintf(map, sizeof map, "%s" GONIO_MAP_ENDING, path);
        FILE *file = fopen(map, "w");
        assert_non_null(file);
        fputs(cases[k].map, file);
        fclose(file);
        const gonio_status status = gonio_read(path, NULL, &s, NULL, &error);
        unlink(path);
        unlink(map);
        if (status != GONIO_E_INPUT || error.line != cases[k].line || strstr(error.message, cases[k].says) == NULL ||
            strstr(error.file, GONIO_MAP_ENDING) == NULL) {
            fail_msg("case %zu: %s, '%s' line %lld: %s", k, gonio_status_name(status), error.file, error.line,
                     error.message);
        }
    }
}

// What is proposed for each dress reads the same samples.
static void the_proposal_reads_the_same(void **state) {
    (void)state;
    int whole = 0;
    for (size_t k = 0; k < sizeof dresses / sizeof *dresses; k++) {
        char path[64];
        gonio_table_guess *g = malloc(sizeof *g);
        gonio_error error = {0};
        scratch_file(path, dresses[k].text, strlen(dresses[k].text));
        if (gonio_table_guess_make(path, g, &error) != GONIO_OK) {
            fail_msg("%s: %s", dresses[k].what, error.message);
        }
        assert_int_equal(g->rows, 5 + 2 * (strstr(dresses[k].what, "missing") != NULL) +
                                      (strstr(dresses[k].what, "horizon") != NULL));
        const bool sure = strstr(dresses[k].what, "missing") == NULL && strstr(dresses[k].what, "cos") == NULL;
        whole += g->whole && sure;
        gonio_samples *s;
        if (g->whole && gonio_read(path, &g->options, &s, NULL, &error) != GONIO_OK) {
            fail_msg("%s: %s: %s", dresses[k].what, g->command, error.message);
        }
        if (g->whole && sure) {
            check_truth(s, g->command);
        }
        if (g->whole) {
            gonio_samples_free(s);
        } else {
            assert_true(g->open[0] != 0);
        }
        unlink(path);
        gonio_table_guess_free(g);
        free(g);
    }
    assert_true(whole >= 6); // where the names tell the angles
}

static void what_a_lab_calls_its_angles(void **state) {
    (void)state;
    static const struct {
        const char *name;
        int role; // -1: none
    } cases[] = {{"theta_i", GONIO_MAPPED_THETA_I},
                 {"Theta_in [deg]", GONIO_MAPPED_THETA_I},
                 {"Incident_angle", GONIO_MAPPED_THETA_I},
                 {"AOI", GONIO_MAPPED_THETA_I},
                 {"Measure_angle", GONIO_MAPPED_THETA_O},
                 {"thetar", GONIO_MAPPED_THETA_O},
                 {"View zenith", GONIO_MAPPED_THETA_O},
                 {"scatter-angle", GONIO_MAPPED_THETA_O},
                 {"VZA", GONIO_MAPPED_THETA_O},
                 {"phi_in", GONIO_MAPPED_PHI_I},
                 {"View azimuth", GONIO_MAPPED_PHI_O},
                 {"SAA", GONIO_MAPPED_PHI_I},
                 {"dphi", GONIO_MAPPED_PHI},
                 {"relative azimuth", GONIO_MAPPED_PHI},
                 {"phi", GONIO_MAPPED_PHI},
                 {"BRDF", -1},
                 {"theta", -1},
                 {"r", -1},
                 {"550nm", -1},
                 {"", -1}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        gonio_mapped_role role;
        const int found = gonio_table_angle_of_name(cases[k].name, &role) ? (int)role : -1;
        if (found != cases[k].role) {
            fail_msg("'%s': %d, expected %d", cases[k].name, found, cases[k].role);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_dress_gives_the_same_samples),
        cmocka_unit_test(a_map_file_says_the_same),
        cmocka_unit_test(channels_sigma_and_wavelengths),
        cmocka_unit_test(what_is_wrong_is_named),
        cmocka_unit_test(bad_map_files_are_named),
        cmocka_unit_test(the_proposal_reads_the_same),
        cmocka_unit_test(what_a_lab_calls_its_angles),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
