// SPDX-License-Identifier: BSD-3-Clause
// Readers against entries of the real files, worked out by hand or by another route. Skipped without GONIO_DATA.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "gonio/io.h"
#include "tests/unit/near.h"
#include "tests/unit/scratch.h"

// The path of a data file, or a visible skip.
static const char *data_file(char *path, const char *name) {
    const char *folder = getenv("GONIO_DATA");
    snprintf(path, 512, "%s/%s", folder != NULL ? folder : "../shared/data", name);
    if (access(path, R_OK) != 0) {
        print_message("# %s is not there\n", path);
        skip();
    }
    return path;
}

static gonio_samples *read_with(const char *path, const gonio_read_options *options, gonio_read_report *report) {
    gonio_samples *s;
    gonio_error error = {0};
    if (gonio_read(path, options, &s, report, &error) != GONIO_OK) {
        fail_msg("%s:%lld: %s", path, error.line, error.message);
    }
    return s;
}

static gonio_samples *read_plainly(const char *path, gonio_read_report *report) {
    gonio_read_options options;
    gonio_read_options_default(&options);
    return read_with(path, &options, report);
}

// Written as CSV and read again: the same bits, whatever units the source had.
static void round_trip(const gonio_samples *s) {
    char path[64];
    scratch_file(path, "", 0);
    assert_int_equal(gonio_write_samples(s, path, NULL), GONIO_OK);
    gonio_samples *t = read_plainly(path, NULL);
    unlink(path);
    assert_int_equal(s->n, t->n);
    assert_memory_equal(s->pairs, t->pairs, s->n * sizeof *s->pairs);
    assert_memory_equal(s->values, t->values, s->n * (size_t)s->channels * sizeof(double));
    gonio_samples_free(t);
}

static void cornell(void **state) {
    (void)state;
    char path[512];
    gonio_read_report report;
    gonio_samples *s = read_plainly(data_file(path, "cornell/garnet_red.brdf"), &report);
    assert_string_equal(report.format, "cornell");
    assert_int_equal(s->n, 1439);
    assert_int_equal(s->channels, 31);
    assert_string_equal(s->channel_names[0], "400nm");
    assert_string_equal(s->channel_names[30], "700nm");
    // The first row: 0.872665 0 0.573513 0, then 0.023025 ... 0.050083.
    assert_near(s->pairs[0].theta_i, 0.872665, 1e-15);
    assert_near(s->pairs[0].theta_o, 0.573513, 1e-15);
    assert_true(s->values[0] == 0.023025 && s->values[30] == 0.050083);
    round_trip(s);
    gonio_samples_free(s);
    // The last row of mystique is the brightest place, near the mirror direction.
    s = read_plainly(data_file(path, "cornell/mystique.brdf"), &report);
    const size_t last = s->n - 1;
    assert_near(s->pairs[last].phi_o, 3.141593, 1e-6);
    assert_true(s->values[last * 31] == 625.997131);
    gonio_samples_free(s);
    s = read_plainly(data_file(path, "cornell/acryl_blue.brdf"), &report);
    size_t zeros = 0;
    for (size_t i = 0; i < s->n * 31; i++) {
        zeros += s->values[i] == 0;
    }
    assert_int_equal(zeros, 18901);
    gonio_samples_free(s);
}

static void nist(void **state) {
    (void)state;
    char path[512];
    gonio_read_options options;
    gonio_read_options_default(&options);
    gonio_read_report report;
    gonio_samples *s = read_with(data_file(path, "nist_ptfe/PTFE.data.csv"), &options, &report);
    assert_string_equal(report.format, "nist");
    assert_int_equal(s->n, 1824);
    assert_int_equal(s->channels, 4);
    assert_string_equal(s->channel_names[0], "351nm");
    assert_string_equal(s->channel_names[3], "1064nm");
    double low = 1e9, high = 0;
    for (size_t i = 0; i < s->n * 4; i++) {
        low = fmin(low, s->values[i]);
        high = fmax(high, s->values[i]);
    }
    assert_near(low, 0.232, 1e-12);
    assert_near(high, 0.714, 1e-12);
    round_trip(s);
    gonio_samples_free(s);
    // Line 5168: 0.633,-60,0,80.0258,23.9625,4.21E-01,0.00447785: light at 60 deg on the side of phi = 180.
    options.wavelength_nm = 633;
    for (int element = 0; element < 2; element++) {
        options.settings[0] = (gonio_format_setting){"mueller", element == 0 ? "f_r11" : "f_r12"};
        s = read_with(path, &options, &report);
        assert_int_equal(s->channels, 1);
        assert_int_equal(s->n, 1824);
        int found = 0;
        for (size_t i = 0; i < s->n; i++) {
            const gonio_pair *p = &s->pairs[i];
            if (p->theta_i == gonio_radians(60) && p->theta_o == gonio_radians(80.0258) &&
                p->phi_o == gonio_radians(23.9625)) {
                found++;
                assert_near(p->phi_i, GONIO_PI, 0);
                assert_near(s->values[i], element == 0 ? 0.421 : 0.421 * 0.00447785, 1e-16);
            }
        }
        assert_int_equal(found, 1);
        gonio_samples_free(s);
    }
    gonio_error error = {0};
    options.wavelength_nm = 1200; // 600 nm is 633 nm, the nearest
    assert_int_equal(gonio_read(path, &options, &s, NULL, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.message, "it holds 0.351, 0.532, 0.633, 1.064"));
    options.wavelength_nm = 0;
    options.settings[0].value = "f_r15";
    assert_int_equal(gonio_read(path, &options, &s, NULL, &error), GONIO_E_USAGE);
}

// Sintered PTFE scatters forward at 75 deg: the brightest place must lie opposite to the light, not beside it.
static void nist_mirror_side(void **state) {
    (void)state;
    char path[512];
    gonio_samples *s = read_plainly(data_file(path, "nist_ptfe/PTFE.data.csv"), NULL);
    size_t best = 0;
    for (size_t i = 0; i < s->n; i++) {
        best = s->values[4 * i] > s->values[4 * best] ? i : best;
    }
    assert_true(cos(s->pairs[best].phi_o - s->pairs[best].phi_i) < -0.7);
    gonio_samples_free(s);
}

static void retro(void **state) {
    (void)state;
    char path[512];
    gonio_read_report report;
    gonio_samples *s = read_plainly(data_file(path, "retro/retro-gray-tape.dat"), &report);
    assert_string_equal(report.format, "retro");
    assert_int_equal(s->n, 7405);
    // 72.4568 1/sr at theta_l = theta_v = 15 deg, dphi = 0: straight back to the light.
    size_t best = 0;
    for (size_t i = 0; i < s->n; i++) {
        best = s->values[i] > s->values[best] ? i : best;
    }
    assert_near(s->values[best], 72.45680592991914181766333058476448, 0);
    assert_near(s->pairs[best].theta_i, gonio_radians(15), 1e-15);
    assert_near(s->pairs[best].theta_o, gonio_radians(15), 1e-15);
    assert_near(s->pairs[best].phi_o, 0, 0);
    round_trip(s);
    gonio_samples_free(s);
}

// Values that Radiance's own testBSDF (its src/common, 2025) gives for the same files and pairs.
static void radiance(void **state) {
    (void)state;
    static const struct {
        const char *name;
        double f[4];
    } expected[] = {
        {"radiance/aerc6216_kf.xml", {4.556e-2, 5.143e-2, 6.111e-2, 5.617e-2}},
        {"radiance/cl_Tn0.06_blinds.xml", {1.766, 2.733e-3, 4.725, 8.039e-5}},
        {"radiance/blinds_20deg_t45.xml", {38.59, 4.461e-3, 64.03, 2.958e-3}},
    };
    static const double poses[4][4] = {{0, 0, 0, 0}, {32, 200, 47, 20}, {60, 45, 60, 225}, {81, 300, 12.5, 77}};
    for (int m = 0; m < 3; m++) {
        char path[512];
        gonio_model *model;
        gonio_error error = {0};
        if (gonio_read_table(data_file(path, expected[m].name), &model, &error) != GONIO_OK) {
            fail_msg("%s: %s", path, error.message);
        }
        for (int k = 0; k < 4; k++) {
            const gonio_pair p = {gonio_radians(poses[k][0]), gonio_radians(poses[k][1]), gonio_radians(poses[k][2]),
                                  gonio_radians(poses[k][3])};
            double v;
            gonio_model_eval_pair(model, &p, &v);
            assert_near(v, expected[m].f[k], 2e-3 * expected[m].f[k]); // four digits, and a ripple of 2e-4 on trees
        }
        gonio_model_free(model);
    }
}

static void rgl(void **state) {
    (void)state;
    // From reference_values.txt: f_r cos(theta_o) of the published evaluator at (0,0;45,0), (45,0;0,0) and in the
    // mirror direction at 45 deg, then the directional albedos at 0 and 60 deg of the files whose lobes are broad.
    static const struct {
        const char *name;
        double f[9], albedo[6];
    } expected[] = {
        {"aurora_white_rgb",
         {0.1373, 0.1063, 0.1288, 0.1962, 0.1513, 0.1862, 1.7097, 3.1433, 2.3080},
         {0.698, 0.761, 0.703, 0.691, 0.737, 0.716}},
        {"chm_orange_rgb", {0.0062, 0.0033, 0.0028, 0.0065, 0.0030, 0.0024, 493.2952, 92.5541, 50.9621}, {0}},
        {"cm_military_green_rgb",
         {0.0051, 0.0095, 0.0037, 0.0079, 0.0138, 0.0059, 0.4329, 0.4307, 0.4140},
         {0.066, 0.084, 0.060, 0.115, 0.136, 0.108}},
        {"ilm_solo_m_68_rgb", {0, 0, 0.0041, 0, 0.0001, 0.0062, 93.4598, 92.6291, 98.9243}, {0}},
        {"vch_silk_blue_rgb",
         {0.0034, 0.0014, 0.0144, 0.0062, 0.0031, 0.0214, 0, 0.6685, 3.0625},
         {0.025, 0.089, 0.443, 0.084, 0.129, 0.360}},
    };
    const double pose[3][4] = {{0, 0, 45, 0}, {45, 0, 0, 0}, {45, 0, 45, 180}};
    for (int m = 0; m < 5; m++) {
        char path[512], name[64];
        snprintf(name, sizeof name, "rgl/%s.bsdf", expected[m].name);
        gonio_model *model;
        gonio_error error = {0};
        if (gonio_read_table(data_file(path, name), &model, &error) != GONIO_OK) {
            fail_msg("%s: %s", path, error.message);
        }
        for (int k = 0; k < 3; k++) {
            const gonio_pair p = {gonio_radians(pose[k][0]), gonio_radians(pose[k][1]), gonio_radians(pose[k][2]),
                                  gonio_radians(pose[k][3])};
            double v[3];
            gonio_model_eval_pair(model, &p, v);
            for (int c = 0; c < 3; c++) {
                // The file gives four decimals; the published evaluator works in single precision, which shows where a
                // mirror's peak is 1e5 times its surroundings.
                const double f = expected[m].f[3 * k + c];
                assert_near(v[c] * cos(p.theta_o), f, 5.1e-5 + 4e-4 * f);
            }
        }
        for (int t = 0; t < 2 && expected[m].albedo[0] > 0; t++) {
            double sum[3] = {0};
            const gonio_vec3 wi = gonio_direction(gonio_radians(60 * t), 0);
            const int n = 120;
            for (int a = 0; a < n * n; a++) {
                const double s2 = (a / n + 0.5) / n, phi = 2 * GONIO_PI * (a % n + 0.5) / n;
                double v[3];
                gonio_model_eval(model, wi, (gonio_vec3){sqrt(s2) * cos(phi), sqrt(s2) * sin(phi), sqrt(1 - s2)}, v);
                for (int c = 0; c < 3; c++) {
                    sum[c] += v[c] * GONIO_PI / (n * n);
                }
            }
            for (int c = 0; c < 3; c++) {
                assert_near(sum[c], expected[m].albedo[3 * t + c], 0.004);
            }
        }
        gonio_model_free(model);
    }
}

// ---- MERL ----

// The published look-up, transcribed from the format's description: rotate by -phi_h about z, by -theta_h about y.
static size_t merl_index(gonio_vec3 wi, gonio_vec3 wo) {
    const double hx = wi.x + wo.x, hy = wi.y + wo.y, hz = wi.z + wo.z, length = sqrt(hx * hx + hy * hy + hz * hz);
    const double theta_h = acos(fmin(1, hz / length)), phi_h = atan2(hy, hx);
    const double x1 = cos(-phi_h) * wi.x - sin(-phi_h) * wi.y, y1 = sin(-phi_h) * wi.x + cos(-phi_h) * wi.y;
    const double x2 = cos(-theta_h) * x1 + sin(-theta_h) * wi.z, z2 = -sin(-theta_h) * x1 + cos(-theta_h) * wi.z;
    const double theta_d = acos(fmin(1, z2));
    double phi_d = atan2(y1, x2);
    phi_d += phi_d < 0 ? GONIO_PI : 0;
    int h = (int)floor(90 * sqrt(theta_h / (GONIO_PI / 2)));
    int d = (int)floor(theta_d / (GONIO_PI / 2) * 90), p = (int)floor(phi_d / GONIO_PI * 180);
    h = h > 89 ? 89 : h;
    d = d > 89 ? 89 : d;
    p = p > 179 ? 179 : p;
    return (size_t)p + 180 * ((size_t)d + 90 * (size_t)h);
}

#define CELLS ((size_t)90 * 90 * 180)

static void merl_against_raw(const char *path) {
    FILE *file = fopen(path, "rb");
    double *raw = malloc(3 * CELLS * sizeof *raw);
    assert_int_equal(fseek(file, 12, SEEK_SET), 0);
    assert_int_equal(fread(raw, sizeof *raw, 3 * CELLS, file), 3 * CELLS);
    fclose(file);
    gonio_read_report report;
    gonio_samples *s = read_plainly(path, &report);
    assert_string_equal(report.format, "merl");
    assert_int_equal(report.rows, CELLS);
    assert_int_equal(s->n + report.invalid, CELLS);
    assert_true(s->n > CELLS / 2);
    const double scale[3] = {1.0 / 1500, 1.15 / 1500, 1.66 / 1500};
    for (size_t i = 0; i < s->n; i += 7) {
        const gonio_pair *p = &s->pairs[i];
        const size_t at = merl_index(gonio_direction(p->theta_i, p->phi_i), gonio_direction(p->theta_o, p->phi_o));
        for (size_t c = 0; c < 3; c++) {
            assert_near(s->values[3 * i + c], raw[c * CELLS + at] * scale[c], 0);
        }
    }
    // The model reproduces the cells at their centres.
    gonio_model *model;
    assert_int_equal(gonio_read_table(path, &model, NULL), GONIO_OK);
    for (size_t i = 0; i < s->n; i += 101) {
        double v[3];
        gonio_model_eval_pair(model, &s->pairs[i], v);
        for (int c = 0; c < 3; c++) {
            const double f = s->values[3 * i + (size_t)c];
            assert_near(v[c], f, 1e-6 * f + 1e-9);
        }
    }
    gonio_model_free(model);
    gonio_samples_free(s);
    free(raw);
}

static void merl(void **state) {
    (void)state;
    char packed[512], path[64], command[700];
    data_file(packed, "merl_layout/red-plastic_nn.binary.xz");
    scratch_file(path, "", 0);
    snprintf(command, sizeof command, "xz -dc '%s' > '%s'", packed, path);
    if (system(command) != 0) {
        unlink(path);
        print_message("# xz is not installed\n");
        skip();
    }
    merl_against_raw(path);
    gonio_read_options options;
    gonio_read_options_default(&options);
    options.settings[0] = (gonio_format_setting){"limit", "5k"};
    gonio_samples *a = read_with(path, &options, NULL), *b = read_with(path, &options, NULL);
    assert_in_range(a->n, 3000, 5400);
    assert_int_equal(a->n, b->n);
    assert_memory_equal(a->pairs, b->pairs, a->n * sizeof *a->pairs);
    gonio_samples_free(a);
    gonio_samples_free(b);
    assert_int_equal(truncate(path, 34992011), 0);
    gonio_error error = {0};
    assert_int_equal(gonio_read(path, &options, &a, NULL, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.message, "34992011 bytes"));
    unlink(path);
}

// An analytic BRDF written as a table and read back: exact at the centres, close in between.
static void merl_written(void **state) {
    (void)state;
    gonio_model *truth, *table;
    assert_int_equal(gonio_model_from_spec("ggx:rho_d=0.3/0.2/0.1,rho_s=0.5,alpha=0.2,f0=0.05", &truth, NULL),
                     GONIO_OK);
    char path[64], spec[100];
    scratch_file(path, "", 0);
    const gonio_write_options centre = {.settings = {{"merl-nodes", "centre"}}};
    assert_int_equal(gonio_write_table_as(truth, path, "merl", &centre, NULL, NULL), GONIO_OK);
    merl_against_raw(path);
    snprintf(spec, sizeof spec, "file:%s,shape=sphere", path);
    assert_int_equal(gonio_model_from_spec(spec, &table, NULL), GONIO_OK);
    double worst = 0;
    for (int i = 0; i < 20000; i++) {
        const double u = fmod(i * 0.8191725, 1), v = fmod(i * 0.6710436, 1), w = fmod(i * 0.5497005, 1);
        const gonio_pair p = {asin(0.97 * u), w, asin(0.97 * v), w + 2 * GONIO_PI * fmod(i * 0.7548777, 1)};
        double a[3], b[3];
        gonio_model_eval_pair(truth, &p, a);
        gonio_model_eval_pair(table, &p, b);
        for (int c = 0; c < 3; c++) {
            worst = fmax(worst, fabs(a[c] - b[c]) / a[c]);
        }
    }
    assert_true(worst < 0.02);
    gonio_model_free(table);
    // At the cells' edges, as interpolating programs read it: index i of theta_h, theta_d, phi_d is i^2 / 90, i, i deg.
    assert_int_equal(gonio_write_table_as(truth, path, "merl", NULL, NULL, NULL), GONIO_OK);
    FILE *file = fopen(path, "rb");
    double raw, values[3];
    assert_int_equal(fseek(file, 12 + 8 * (long)(40 + 180 * (30 + 90 * 20)), SEEK_SET), 0);
    assert_int_equal(fread(&raw, sizeof raw, 1, file), 1);
    fclose(file);
    const double h = gonio_radians(400.0 / 90), c = cos(h), s = sin(h);
    const gonio_vec3 d = gonio_direction(gonio_radians(30), gonio_radians(40));
    const gonio_vec3 wi = {c * d.x + s * d.z, d.y, c * d.z - s * d.x};
    const gonio_vec3 wo = {-c * d.x + s * d.z, -d.y, c * d.z + s * d.x};
    gonio_model_eval(truth, wi, wo, values);
    assert_near(raw / 1500, values[0], 1e-7 * values[0]);
    gonio_model_free(truth);
    unlink(path);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cornell), cmocka_unit_test(nist),         cmocka_unit_test(nist_mirror_side),
        cmocka_unit_test(retro),   cmocka_unit_test(rgl),          cmocka_unit_test(radiance),
        cmocka_unit_test(merl),    cmocka_unit_test(merl_written),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
