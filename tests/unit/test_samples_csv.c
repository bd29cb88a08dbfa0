// SPDX-License-Identifier: BSD-3-Clause
// Samples CSV and recognition by content: exact round trips, then every kind of bad input with its line.
#include <locale.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "gonio/io.h"
#include "tests/unit/near.h"
#include "tests/unit/scratch.h"

#define HEADER "theta_i,phi_i,theta_o,phi_o,"

static uint64_t state64 = 88172645463325252u;
static uint64_t bits(void) {
    state64 ^= state64 << 13;
    state64 ^= state64 >> 7;
    return state64 ^= state64 << 17;
}
static double uniform(void) { return (double)(bits() >> 11) * 0x1p-53; }

// Any finite double, over the whole range of exponents.
static double any_double(void) {
    for (;;) {
        const uint64_t raw = bits();
        double value;
        memcpy(&value, &raw, 8);
        if (isfinite(value)) {
            return value;
        }
    }
}

static void same_sets(const gonio_samples *a, const gonio_samples *b) {
    const size_t c = (size_t)a->channels;
    assert_int_equal(a->n, b->n);
    assert_int_equal(a->channels, b->channels);
    assert_int_equal(a->isotropic, b->isotropic);
    assert_memory_equal(a->pairs, b->pairs, a->n * sizeof *a->pairs);
    assert_memory_equal(a->values, b->values, a->n * c * sizeof(double));
    assert_memory_equal(a->channel_names, b->channel_names, c * sizeof *a->channel_names);
    assert_int_equal(a->sigma_random != NULL, b->sigma_random != NULL);
    if (a->sigma_random != NULL) {
        assert_memory_equal(a->sigma_random, b->sigma_random, a->n * c * sizeof(double));
        assert_memory_equal(a->sigma_systematic, b->sigma_systematic, a->n * c * sizeof(double));
    }
    assert_int_equal(a->group != NULL, b->group != NULL);
    if (a->group != NULL) {
        assert_memory_equal(a->group, b->group, a->n * sizeof *a->group);
    }
}

static gonio_samples *read_back(const char *path) {
    gonio_read_options options;
    gonio_read_options_default(&options);
    options.settings[0] = (gonio_format_setting){"negatives", "keep"};
    gonio_samples *s;
    gonio_error error = {0};
    if (gonio_read(path, &options, &s, NULL, &error) != GONIO_OK) {
        fail_msg("%s:%lld: %s", path, error.line, error.message);
    }
    return s;
}

static gonio_samples *random_set(int channels, bool sigma, bool systematic, size_t n) {
    gonio_samples *s;
    assert_int_equal(gonio_samples_new(channels, sigma, &s, NULL), GONIO_OK);
    for (int c = 0; c < channels; c++) {
        snprintf(s->channel_names[c], 32, "%dnm", 400 + 10 * c);
    }
    for (size_t i = 0; i < n; i++) {
        const gonio_pair p = {gonio_angle_canonical(uniform() * GONIO_PI / 2),
                              gonio_angle_canonical((2 * uniform() - 1) * GONIO_PI),
                              gonio_angle_canonical(uniform() * 1e-9), gonio_angle_canonical(2 * uniform() * GONIO_PI)};
        double v[8], r[8], y[8];
        for (int c = 0; c < channels; c++) {
            v[c] = any_double();
            r[c] = fabs(any_double() * 0x1p-600);
            y[c] = systematic ? fabs(any_double() * 0x1p-600) : 0;
        }
        assert_int_equal(gonio_samples_add(s, &p, v, r, y, NULL), GONIO_OK);
    }
    return s;
}

static void every_double_comes_back(void **state) {
    (void)state;
    for (int k = 0; k < 6; k++) {
        gonio_samples *s = random_set(1 + k, k % 3 != 0, k % 3 == 2, 500);
        s->isotropic = k % 2 == 0;
        for (size_t i = 0; i < s->n && k == 5; i++) { // as of several sessions
            assert_int_equal(gonio_samples_set_group(s, i, (uint16_t)(i < 3 ? 1 : UINT16_MAX), NULL), GONIO_OK);
        }
        char path[64], again[64];
        scratch_file(path, "", 0);
        scratch_file(again, "", 0);
        assert_int_equal(gonio_write_samples(s, path, NULL), GONIO_OK);
        gonio_samples *t = read_back(path);
        same_sets(s, t);
        // And the file itself: writing what was read gives the same bytes.
        assert_int_equal(gonio_write_samples(t, again, NULL), GONIO_OK);
        char command[200];
        snprintf(command, sizeof command, "cmp -s %s %s", path, again);
        assert_int_equal(system(command), 0);
        unlink(path);
        unlink(again);
        gonio_samples_free(s);
        gonio_samples_free(t);
    }
}

static void degrees_are_as_short_as_they_were(void **state) {
    (void)state;
    gonio_samples *s;
    assert_int_equal(gonio_samples_new(1, false, &s, NULL), GONIO_OK);
    strcpy(s->channel_names[0], "y");
    const double deg[] = {0.1, 10.1, 33.3333, 45, 89.9, 1e-5, 75};
    for (int i = 0; i < 7; i++) {
        const gonio_pair p = {gonio_radians(deg[i]), 0, gonio_radians(deg[6 - i]), gonio_radians(180)};
        const double v = 0.1;
        assert_int_equal(gonio_samples_add(s, &p, &v, NULL, NULL, NULL), GONIO_OK);
    }
    char *data;
    size_t size;
    FILE *stream = open_memstream(&data, &size);
    assert_int_equal(gonio_write_samples_stream(s, stream, NULL), GONIO_OK);
    fclose(stream);
    assert_string_equal(data, HEADER "y\n0.1,0,75,180,0.1\n10.1,0,1e-05,180,0.1\n33.3333,0,89.9,180,0.1\n"
                                     "45,0,45,180,0.1\n89.9,0,33.3333,180,0.1\n1e-05,0,10.1,180,0.1\n"
                                     "75,0,0.1,180,0.1\n");
    free(data);
    gonio_samples_free(s);
}

// A name that the reader takes for something else than a channel is refused by the writer, and by every other reader.
static void channels_have_names_of_channels(void **state) {
    (void)state;
    static const char *const bad[][2] = {{"y", "%"},
                                         {"y", "std"},
                                         {"y", "wavelength"},
                                         {"y", "time"},
                                         {"y", "sigma_y"},
                                         {"y", "y_std"},
                                         {"unc_y", "y"},
                                         {"y", "brf"},
                                         {"y", "a,b"},
                                         {"y", "temp"},
                                         {"y", "y"},
                                         {"y", ""},
                                         {"y", "systematic_group"}};
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        gonio_samples *s = random_set(2, false, false, 3);
        strcpy(s->channel_names[0], bad[k][0]);
        strcpy(s->channel_names[1], bad[k][1]);
        char *data;
        size_t size;
        FILE *stream = open_memstream(&data, &size);
        gonio_error error = {0};
        assert_int_equal(gonio_write_samples_stream(s, stream, &error), GONIO_E_INPUT);
        fclose(stream);
        assert_int_equal(size, 0);
        assert_string_not_equal(error.message, "");
        free(data);
        gonio_samples_free(s);
        char path[64], text[256];
        const int n = snprintf(text, sizeof text, "NUM_POINTS 1\nVARS theta_i,phi_i,theta_s,phi_s,%s,%s\n0,0,0,0,1,2\n",
                               bad[k][0], bad[k][1]);
        scratch_file(path, text, (size_t)n);
        assert_int_equal(gonio_read(path, NULL, &s, NULL, &error), GONIO_E_INPUT);
        unlink(path);
    }
}

static void a_comma_locale_changes_nothing(void **state) {
    (void)state;
    if (setlocale(LC_NUMERIC, "de_DE.UTF-8") == NULL && setlocale(LC_NUMERIC, "fr_FR.UTF-8") == NULL) {
        skip(); // no such locale is installed
    }
    gonio_samples *s = random_set(2, true, true, 50);
    char path[64];
    scratch_file(path, "", 0);
    assert_int_equal(gonio_write_samples(s, path, NULL), GONIO_OK);
    gonio_samples *t = read_back(path);
    setlocale(LC_NUMERIC, "C");
    same_sets(s, t);
    unlink(path);
    gonio_samples_free(s);
    gonio_samples_free(t);
}

// ---- reading by hand ----

static gonio_status read_text(const char *text, size_t size, const char *policy, gonio_samples **s,
                              gonio_read_report *report, gonio_error *error) {
    char path[64];
    scratch_file(path, text, size);
    gonio_read_options options;
    gonio_read_options_default(&options);
    if (policy != NULL) {
        options.settings[0] = (gonio_format_setting){"negatives", policy};
    }
    const gonio_status status = gonio_read(path, &options, s, report, error);
    unlink(path);
    return status;
}

static void what_people_write_is_read(void **state) {
    (void)state;
    const char *text = "\xef\xbb\xbf# by hand\r\n\r\n theta_i, phi_i ,theta_o,phi_o, r ,g\r\n"
                       "# a comment between\r\n10, -20.5,+30,180, 1e-3 ,.5\r\n\r\n0,0,90,360,0,2.";
    gonio_samples *s;
    gonio_read_report report;
    gonio_error error = {0};
    assert_int_equal(read_text(text, strlen(text), "reject", &s, &report, &error), GONIO_OK);
    assert_string_equal(report.format, "samples");
    assert_int_equal(s->n, 2);
    assert_string_equal(s->channel_names[0], "r");
    assert_true(s->pairs[0].phi_i == gonio_radians(-20.5));
    assert_true(s->values[0] == 1e-3 && s->values[1] == 0.5 && s->values[3] == 2);
    assert_null(s->sigma_random);
    gonio_samples_free(s);
    text = HEADER "r,sigma_r\n1,2,3,4,5,0.5\n";
    assert_int_equal(read_text(text, strlen(text), "reject", &s, &report, &error), GONIO_OK);
    assert_near(gonio_samples_sigma(s, 0, 0), 0.5, 0);
    gonio_samples_free(s);
}

static void negatives_follow_the_policy(void **state) {
    (void)state;
    const char *text = HEADER "r,g\n1,0,1,0,1,1\n1,0,2,0,1,-0.25\n1,0,3,0,-1,-2\n1,0,4,0,-0.0,1\n";
    gonio_samples *s;
    gonio_read_report report;
    gonio_error error = {0};
    assert_int_equal(read_text(text, strlen(text), "reject", &s, &report, &error), GONIO_E_INPUT);
    assert_null(s);
    assert_int_equal(error.line, 3);
    assert_non_null(strstr(error.message, "3 negative values, the first here: g = -0.25"));
    assert_int_equal(read_text(text, strlen(text), "clamp", &s, &report, &error), GONIO_OK);
    assert_int_equal(report.negatives, 3);
    assert_int_equal(report.first_negative_line, 3);
    assert_true(s->values[3] == 0 && s->values[4] == 0 && s->values[0] == 1);
    gonio_samples_free(s);
    assert_int_equal(read_text(text, strlen(text), "keep", &s, &report, &error), GONIO_OK);
    assert_true(s->values[3] == -0.25 && s->values[5] == -2);
    gonio_samples_free(s);
}

// Noise about zero passes by default, where sigma says that it is noise.
static void negative_noise_is_kept(void **state) {
    (void)state;
    const char *noise = HEADER "r,sigma_r\n1,0,1,0,1,0.1\n1,0,2,0,-0.4,0.1\n1,0,3,0,-0.5,0.1\n";
    const char *beyond = HEADER "r,sigma_r\n1,0,1,0,1,0.1\n1,0,2,0,-0.4,0.1\n1,0,3,0,-0.6,0.1\n1,0,4,0,-1,0.1\n";
    const char *parts = HEADER "r,sigma_r,sigma_random_r,sigma_systematic_r\n1,0,1,0,-0.6,0.125,0.1,0.075\n";
    const char *none = HEADER "r\n1,0,1,0,-1e-9\n";
    const char *exact = HEADER "r,sigma_r\n1,0,1,0,-1e-9,0\n";
    gonio_samples *s;
    gonio_read_report report;
    gonio_error error = {0};
    assert_int_equal(read_text(noise, strlen(noise), "noise", &s, &report, &error), GONIO_OK);
    assert_true(report.negatives == 2 && report.noise == 2 && report.first_negative_line == 3);
    assert_true(s->values[1] == -0.4 && s->values[2] == -0.5);
    gonio_samples_free(s);
    assert_int_equal(read_text(noise, strlen(noise), "reject", &s, &report, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.message, "2 negative values, the first here: r = -0.4;"));
    assert_int_equal(read_text(beyond, strlen(beyond), "noise", &s, &report, &error), GONIO_E_INPUT);
    assert_int_equal(error.line, 4);
    assert_non_null(
        strstr(error.message, "2 negative values more than 5 sigma below 0, the first here: r = -0.6 with"));
    assert_int_equal(read_text(beyond, strlen(beyond), "keep", &s, &report, &error), GONIO_OK);
    assert_true(report.negatives == 3 && report.noise == 1);
    gonio_samples_free(s);
    assert_int_equal(read_text(parts, strlen(parts), "noise", &s, &report, &error), GONIO_OK);
    gonio_samples_free(s);
    assert_int_equal(read_text(none, strlen(none), "noise", &s, &report, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.message, "1 negative values, the first here: r = -1e-09;"));
    assert_int_equal(read_text(exact, strlen(exact), "noise", &s, &report, &error), GONIO_E_INPUT);
}

static void refused(const char *text, long long line, const char *expected) {
    gonio_samples *s;
    gonio_error error = {.line = -1, .byte = -1};
    const gonio_status status = read_text(text, strlen(text), "reject", &s, NULL, &error);
    assert_null(s);
    if (status != GONIO_E_INPUT || error.line != line || strstr(error.message, expected) == NULL ||
        error.file[0] == 0) {
        fail_msg("'%s': %s, line %lld: '%s'; expected line %lld, '%s'", text, gonio_status_name(status), error.line,
                 error.message, line, expected);
    }
}

static void bad_samples(void **state) {
    (void)state;
    refused("", -1, "empty");
    refused("\n\n", -1, "expected samples CSV");
    refused("# only a comment\n", -1, "expected samples CSV");
    refused("1,2,3,4,5\n", 1, "unknown text, beginning with '1,2,3,4,5'");
    refused("# a\n\nhello world\n", 3, "unknown text");
    refused("theta,phi,theta_o,phi_o,r\n1,2,3,4,5\n", 1, "expected a header that begins with theta_i,phi_i");
    refused("theta_i,phi_i,theta_o,r\n1,2,3,4\n", 1, "expected a header that begins");
    refused("theta_i;phi_i;theta_o;phi_o;r\n", 1, "expected a header that begins");
    refused("theta_i,phi_i,theta_o,phi_o\n1,2,3,4\n", 1, "0 value columns");
    refused(HEADER "r,r\n1,2,3,4,5,6\n", 1, "'r' stands twice");
    refused(HEADER "r,\n1,2,3,4,5,6\n", 1, "expected a channel name");
    refused(HEADER "r,sigma_g\n1,2,3,4,5,6\n", 1, "expected sigma_<channel>");
    refused(HEADER "r,g,sigma_r\n1,2,3,4,5,6,7\n", 1, "1 of 2 channels");
    refused(HEADER "r,sigma_r,g\n1,2,3,4,5,6,7\n", 1, "sigma_ columns for 1 of 2 channels");
    refused(HEADER "r,sigma_r,sigma_r\n1,2,3,4,5,6,7\n", 1, "column 7");
    refused(HEADER "r,sigma_random_r\n1,2,3,4,5,6\n", 1, "must stand together");
    refused(HEADER "r\n", 1, "no samples");
    refused(HEADER "r\n1,2,3,4\n", 2, "expected 5 columns as in the header, found 4");
    refused(HEADER "r\n1,2,3,4,5\n1,2,3,4,5,6\n", 3, "found 6");
    refused(HEADER "r\n1,2,3,4,nan\n", 2, "r: expected a finite number, found 'nan'");
    refused(HEADER "r\n1,2,3,4,inf\n", 2, "expected a finite number");
    refused(HEADER "r\n1,2,3,4,-Infinity\n", 2, "expected a finite number");
    refused(HEADER "r\n1,2,3,4,1e999\n", 2, "expected a finite number");
    refused(HEADER "r\n1,2,3,4,0x10\n", 2, "expected a finite number");
    refused(HEADER "r\n1,2,3,4,\n", 2, "expected a finite number, found ''");
    refused(HEADER "r\n1,2,3,4,1.5.2\n", 2, "expected a finite number");
    refused(HEADER "r\n1,2,3,4,1 2\n", 2, "expected a finite number");
    refused(HEADER "r\nnan,2,3,4,5\n", 2, "theta_i: expected a finite number");
    refused(HEADER "r\n90.0001,2,3,4,5\n", 2,
            "theta_i: expected 0 to 90 degrees, or -90 to 0 on the other side, found 90.0001");
    refused(HEADER "r\n1,2,120,4,5\n", 2, "theta_o: expected 0 to 90");
    refused(HEADER "r\n-90.1,2,3,4,5\n", 2, "theta_i: expected 0 to 90");
    refused(HEADER "r\n1,40000,3,4,5\n", 2, "phi_i: expected -360 to 360");
    refused(HEADER "r,sigma_r\n1,2,3,4,5,-1\n", 2, "sigma: expected 0 or more");
    static const char *const groups[] = {"0", "-1", "65536", "1.5", "", "x", "1e99"};
    for (size_t k = 0; k < sizeof groups / sizeof *groups; k++) {
        char text[160];
        snprintf(text, sizeof text, HEADER "r,sigma_random_r,sigma_systematic_r,systematic_group\n1,2,3,4,5,1,1,%s\n",
                 groups[k]);
        refused(text, 2, "systematic_group: expected 1 to 65535");
    }
    refused(HEADER "r,sigma_r,systematic_group\n1,2,3,4,5,1,1\n", 1, "systematic_group: of what is common to a group");
}

static void bad_files_of_other_formats(void **state) {
    (void)state;
    // Cornell
    refused("2\n400 500\n0.1 0 0.2 0 1\n", 3, "expected 4 angles and 2 values, found 5 numbers");
    refused("2\n400 500 600\n", 2, "expected 2 more wavelengths, found 3");
    refused("2\n400\n", 2, "expected 2 wavelengths, found 1 before the file ended");
    refused("99999\n400\n", 1, "99999 wavelengths");
    refused("1\n400\n", 2, "no samples");
    refused("2\n400 400\n0.1 0 0.2 0 1 1\n", -1, "both named '400nm'");
    refused("1\n400\n0.1 0 1.7 0 1\n", 3, "theta_s: expected 0 to pi/2");
    refused("1\n400\n0.1 0 0.7 0 nan\n", 3, "400nm: expected a finite number");
    refused("1\n400\n0.1 0 0.7 0 -2\n", 3, "1 negative values");
    // NIST
    refused("lambda,thetai,phi\n", 1, "expected a header of 21 columns");
    const char *nist = "lambda,thetai,phi,thetar,phir,f_r11,a,b,c,d,e,f,g,h,i,j,k,l,m,n,o\n";
    char text[600];
    snprintf(text, sizeof text, "%s", nist);
    refused(text, 1, "no rows");
    snprintf(text, sizeof text, "%s0.5,10,0,20\n", nist);
    refused(text, 2, "expected 21 columns, found 4");
    snprintf(text, sizeof text, "%s0.5,95,0,20,0,1,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0\n", nist);
    refused(text, 2, "expected -90 to 90");
    snprintf(text, sizeof text,
             "%s0.5,5,0,20,0,1,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0\n0.6,6,0,20,0,1,0,0,0,0,0,0,0,0,0,0,"
             "0,0,0,0,0\n",
             nist);
    refused(text, 2, "does not come once with each of the 2 wavelengths");
    // CEA
    refused("#SAMPLE\n#PARAM_IN ISOTROPIC_TL_TV_PROJ_DPHI\n0.1 0.2 0.3\n", 3, "expected 4 numbers, found 3");
    refused("#PARAM_IN ISOTROPIC_TL_TV_PROJ_DPHI\n0.1 1.5 1.5 1\n", 2, "theta_v: expected 0 to pi/2");
    // Compressed
    refused("\xfd"
            "7zXZ",
            -1, "compressed (xz)");
    refused("\x1f\x8b\x08", -1, "compressed (gzip)");
    refused("GONIOMDL.......", -1, "fitted model");
}

static void binary(const void *data, size_t size, long long byte, const char *expected) {
    gonio_samples *s;
    gonio_error error = {.line = -1, .byte = -1};
    const gonio_status status = read_text(data, size, NULL, &s, NULL, &error);
    assert_null(s);
    if (status != GONIO_E_INPUT || (byte >= 0 && error.byte != byte) || strstr(error.message, expected) == NULL) {
        fail_msg("%s, byte %lld: '%s'; expected byte %lld, '%s'", gonio_status_name(status), error.byte, error.message,
                 byte, expected);
    }
}

static void bad_tables(void **state) {
    (void)state;
    const int32_t merl[4] = {90, 90, 180, 0}, absurd[4] = {2000000000, 90, 2000000000, 0};
    binary(merl, 12, 12, "the file has 12 bytes; a MERL table has 34992012");
    binary(merl, 16, 16, "the file has 16 bytes");
    binary(absurd, 12, 0, "dimensions 2000000000 x 90 x 2000000000");
    binary(merl, 8, -1, "no BRDF file");
    binary("tensor_file\0", 12, 12, "the file ends inside its header");
    binary("tensor_file\0\7\0\0\0\0\0", 18, 12, "unknown version");
    binary("tensor_file\0\1\0\0\0\0\377", 18, 14, "more than 64 fields");
    binary("tensor_file\0\1\0\1\0\0\0", 18, 18, "ends inside a field's description");
    binary("tensor_file\0\1\0\0\0\0\0", 18, 18, "expected a float32 field 'phi_i'");
    // One field "a" of 2^60 elements, and one whose data lie beyond the end.
    static const char huge[] = "tensor_file\0\1\0\1\0\0\0\1\0a\1\0\12\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\20";
    binary(huge, sizeof huge - 1, -1, "a size of 0 or beyond the file's");
    static const char beyond[] =
        "tensor_file\0\1\0\1\0\0\0\1\0a\1\0\12\377\377\377\377\377\377\377\377\1\0\0\0\0\0\0\0";
    binary(beyond, sizeof beyond - 1, -1, "beyond the end of the file");
}

static void a_zero_byte_ends_nothing(void **state) {
    (void)state;
    static const char text[] = HEADER "r\n1,2,3,4,5\0"
                                      "6\n";
    // Behind the part that recognition looks at, too.
    binary(text, sizeof text - 1, -1, "no BRDF file");
    char *long_text = malloc(70000 + sizeof text);
    memcpy(long_text, HEADER "r\n", sizeof HEADER "r\n" - 1);
    memset(long_text + sizeof HEADER "r\n" - 1, '\n', 70000);
    memcpy(long_text + sizeof HEADER "r\n" - 1 + 70000,
           "1,2,3,4,5\0"
           "6\n",
           13);
    binary(long_text, sizeof HEADER "r\n" - 1 + 70000 + 13, -1, "found '5?6'");
    free(long_text);
}

static void missing_files(void **state) {
    (void)state;
    gonio_read_options options;
    gonio_read_options_default(&options);
    gonio_samples *s;
    gonio_error error = {0};
    assert_int_equal(gonio_read("/nonexistent/x", &options, &s, NULL, &error), GONIO_E_INPUT);
    assert_string_equal(error.file, "/nonexistent/x");
    assert_int_equal(gonio_read("/tmp", &options, &s, NULL, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.message, "folder"));
    gonio_model *m;
    char path[64];
    scratch_file(path, HEADER "r\n1,2,3,4,5\n", sizeof HEADER "r\n1,2,3,4,5\n" - 1);
    assert_int_equal(gonio_read_table(path, &m, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.message, "gonio fit"));
    unlink(path);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_double_comes_back),         cmocka_unit_test(degrees_are_as_short_as_they_were),
        cmocka_unit_test(channels_have_names_of_channels), cmocka_unit_test(a_comma_locale_changes_nothing),
        cmocka_unit_test(what_people_write_is_read),       cmocka_unit_test(negatives_follow_the_policy),
        cmocka_unit_test(negative_noise_is_kept),          cmocka_unit_test(bad_samples),
        cmocka_unit_test(bad_files_of_other_formats),      cmocka_unit_test(bad_tables),
        cmocka_unit_test(a_zero_byte_ends_nothing),        cmocka_unit_test(missing_files),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
