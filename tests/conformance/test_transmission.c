// SPDX-License-Identifier: BSD-3-Clause
// Transmission over the lists: every format that can be told of it, every kind of model in each half, every method's
// fit of each half.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "fit/options.h"
#include "io/format.h"
#include "tests/conformance/make_kind.h"
#include "tests/format_files.h"
#include "tests/fuzz/memory_file.h"
#include "tests/unit/scratch.h"

#define PAIRS 40
#define CHANNELS 3

static bool has_option(const gonio_format *f, const char *name) {
    const gonio_format_option *o = f->options;
    while (o != NULL && o->name != NULL && strcmp(o->name, name) != 0) {
        o++;
    }
    return o != NULL && o->name != NULL;
}

// ---- formats ----

// A row of transmission, theta_i about 30 deg, theta_o about 150, in every format that takes the option; a file that
// only the option tells from one of reflection says so. # comments: the format has them.
static const struct {
    const char *format, *text;
    bool declares, comments;
} through[] = {
    {"samples", "theta_i,phi_i,theta_o,phi_o,r\n30,0,150,180,0.25\n", true, true},
    {"cornell", "1\n550\n0.5 0 2.5 3.141593 0.25\n", true, true},
    {"nist",
     "lambda,thetai,phii,thetar,phir,f_r11,a,b,c,d,e,f,g,h,i,j,k,l,m,n,o\n"
     "0.5,-30,0,150,0,0.25,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0\n",
     true, true},
    {"retro", "#SAMPLE\n#PARAM_IN ISOTROPIC_TL_TV_PROJ_DPHI\n0.5 -2.5 0 0.25\n", true, false},
    {"astm", "NUM_POINTS 1\nVARS theta_i,phi_i,theta_s,phi_s,R\n0.5,0,2.5,3.141593,0.25\n", true, false},
    {"alta",
     "#DIM 4 1\n#PARAM_IN SPHERICAL_TL_PL_TV_PV\n#PARAM_OUT INV_STERADIAN\n0.5 0 2.5 3.1415926 0.25\n"
     "0.6 0 2.5 3.1415926 0.25\n",
     true, false},
    {"tracepro",
     "TracePro Surface Property Data\nScatter 5\nInteraction 0\nTable_BSDF_Data\nTemperature Wavelength IncAngle "
     "AziAngle ScatterBeta ScatterAzimuth BRDF BTDF\n300 0.55 30 0 0 0 0 0.25\n",
     false, false},
    {"curet", NULL, true, false}, // made by through_curet
    {"table", "theta_i;theta_o;phi;f_r\n30;150;180;0,25\n31;151;180;0,25\n", true, false},
    {"ddr",
     "Source Measured\nTypeSym AxiSymmetrical\nTypeColorModel BW\nTypeData Luminance Absolute\nsigma 1\n30\n"
     "phi 1\n0\ntheta 1\n0\nbw\nkbdf 3.141592653589793\ndef\n0.25\n",
     false, false},
    {"sdr", "Source Measured\nTypeColorModel BW\nsigma 1\n30\nbw\ndef\n0.020509778639465858\nenddef\n", false,
     false}, // of a cone of 10 deg
};

// A sample's row, and its table of directions.
static const char *through_curet(char directions[64]) {
    static char text[8 * (FORMAT_CURET + 1)], table[64 * FORMAT_CURET];
    char *at = text + sprintf(text, "7"), *to = table;
    for (int m = 0; m < FORMAT_CURET; m++) {
        at += sprintf(at, " 0.25");
        to += sprintf(to, "%d %.4f 3.141593 0.5 0\n", m + 1, 2.5 + 0.001 * m);
    }
    sprintf(at, "\n");
    scratch_file(directions, table, (size_t)(to - table));
    return text;
}

static const char *directions; // of "curet"

static gonio_status read_through(const gonio_format *f, const char *text, bool asked, gonio_samples **out) {
    gonio_read_options options = {.seed = 1};
    int n = 0;
    if (has_option(f, "directions")) {
        options.settings[n++] = (gonio_format_setting){"directions", directions};
    }
    if (has_option(f, "cone")) {
        options.settings[n++] = (gonio_format_setting){"cone", "10"};
    }
    if (f->by_mapping) {
        options.settings[n++] = (gonio_format_setting){"columns", "theta_i=theta_i,theta_o=theta_o,phi=phi,value=f_r"};
    }
    if (asked) {
        options.settings[n++] = (gonio_format_setting){"transmission", "yes"};
    }
    gonio_error error = {.line = -1};
    const gonio_status status =
        gonio_read(memory_file((const uint8_t *)text, strlen(text)), &options, out, NULL, &error);
    if (status != GONIO_OK && asked) {
        fail_msg("%s: line %lld: %s", f->name, error.line, error.message);
    }
    return status;
}

static void assert_through(const gonio_samples *s) {
    assert_true(s->transmission);
    assert_int_equal(gonio_samples_halves(s), 1u << GONIO_TRANSMISSION);
    assert_true(gonio_degrees(s->pairs[0].theta_i) < 40 && gonio_degrees(s->pairs[0].theta_o) > 140);
    assert_true(fabs(remainder(s->pairs[0].phi_o - s->pairs[0].phi_i - GONIO_PI, 2 * GONIO_PI)) < 1e-5);
    assert_true(fabs(s->values[0] - 0.25) < 1e-12);
}

// Beyond 90 deg lies nothing unless the option or the file says so; then it is the transmitted half.
static void transmission_is_declared(void **state) {
    (void)state;
    char path[64];
    const char *const curet = through_curet(path);
    size_t found = 0;
    directions = path;
    for (int i = 0; gonio_format_at(i) != NULL; i++) {
        const gonio_format *f = gonio_format_at(i);
        size_t k = 0;
        while (k < sizeof through / sizeof *through && strcmp(through[k].format, f->name) != 0) {
            k++;
        }
        if (k == sizeof through / sizeof *through) {
            if (has_option(f, "transmission")) {
                fail_msg("format %s takes --transmission and has no file here", f->name);
            }
            continue;
        }
        gonio_samples *s;
        const char *const own = through[k].text != NULL ? through[k].text : curet;
        assert_int_equal(read_through(f, own, false, &s), through[k].declares ? GONIO_E_INPUT : GONIO_OK);
        gonio_samples_free(s);
        assert_int_equal(read_through(f, own, true, &s), GONIO_OK);
        assert_through(s);
        gonio_samples_free(s);
        static const char *const marks[] = {"# halves = reflection,transmission\n", "#half: transmission\n"};
        for (size_t m = 0; m < 2 && through[k].comments; m++) {
            char text[2048];
            snprintf(text, sizeof text, "%s%s", marks[m], own);
            assert_int_equal(read_through(f, text, false, &s), GONIO_OK);
            assert_through(s);
            gonio_samples_free(s);
        }
        found++;
    }
    unlink(path);
    assert_int_equal(found, sizeof through / sizeof *through);
}

// ---- kinds ----

static gonio_vec3 flipped(gonio_vec3 v, bool flip) { return (gonio_vec3){v.x, v.y, flip ? -v.z : v.z}; }

// Of the half `where`: is its light behind, is its camera?
static bool light_behind(int where) { return where >= GONIO_REFLECTION_BACK; }
static bool camera_behind(int where) { return light_behind(where) != (where % 2 == GONIO_TRANSMISSION); }

// A model of reflection answers 0 behind the surface; as the half h it answers there what it answers in front.
static void answers_in_half(const gonio_model *model, const gonio_model *whole, int h) {
    const double nothing[CHANNELS] = {0};
    double front[CHANNELS], there[CHANNELS];
    uint64_t seed = 5;
    for (int i = 0; i < PAIRS; i++) {
        const gonio_pair p = simulate_pair(&seed, 0);
        const gonio_vec3 wi = gonio_direction(p.theta_i, p.phi_i), wo = gonio_direction(p.theta_o, p.phi_o);
        gonio_model_eval(model, wi, wo, front);
        for (int where = 0; where < GONIO_HALVES; where++) {
            const gonio_vec3 in = flipped(wi, light_behind(where)), out = flipped(wo, camera_behind(where));
            gonio_model_eval(whole, in, out, there);
            assert_memory_equal(there, where == h ? front : nothing, sizeof there);
            gonio_model_eval(model, in, out, there);
            assert_memory_equal(there, where == 0 ? front : nothing, sizeof there);
        }
    }
}

static void kinds_live_in_every_half(void **state) {
    (void)state;
    char path[64];
    scratch_file(path, "", 0);
    kind_maker maker;
    for (size_t m = 0; kind_maker_at(m, &maker); m++) {
        gonio_model *model = kind_make(&maker, true, CHANNELS);
        assert_int_equal(gonio_model_save(model, path, NULL), GONIO_OK);
        for (int h = 0; h < GONIO_HALVES && !model->ops->both_sides; h++) {
            gonio_model *parts[GONIO_HALVES] = {NULL}, *whole;
            assert_int_equal(gonio_model_open(path, &parts[h], NULL), GONIO_OK);
            assert_int_equal(gonio_model_of_halves(parts, &whole, NULL), GONIO_OK);
            assert_ptr_equal(gonio_model_half(whole, (gonio_half)h), parts[h]);
            answers_in_half(model, whole, h);
            gonio_model_free(whole);
        }
        gonio_model_free(model);
    }
    unlink(path);
}

// ---- methods ----

// A sheet with light on either side, its samples in turn of each half.
static gonio_samples *sheet(void) {
    gonio_samples *s = simulate_samples("ward:rho_d=0.3,rho_s=0.2,alpha=0.3", GONIO_HALVES * PAIRS, 1, 3);
    s->transmission = true;
    for (size_t i = 0; i < s->n; i++) {
        s->pairs[i] = gonio_pair_lowered(s->pairs[i], (gonio_half)(i % GONIO_HALVES));
        s->values[i] *= 1 + (double)(i % GONIO_HALVES);
    }
    return s;
}

static gonio_model *fitted(const gonio_samples *samples, const gonio_fit_options *o, gonio_fit_report *report) {
    gonio_model *model;
    gonio_error error = {0};
    if (gonio_fit(samples, o, &model, report, &error) != GONIO_OK) {
        fail_msg("%s: %s", o->method, error.message);
    }
    return model;
}

// The half is the fit of its own samples, raised in front of the surface, bit for bit.
static void half_is_its_own_fit(const gonio_samples *samples, const gonio_model *whole, int h,
                                const gonio_fit_options *o) {
    gonio_samples *raised;
    assert_int_equal(gonio_samples_half(samples, (gonio_half)h, NULL, &raised, NULL), GONIO_OK);
    assert_int_equal(raised->n, PAIRS);
    gonio_model *alone = fitted(raised, o, NULL);
    assert_string_equal(alone->ops->kind, gonio_model_half(whole, (gonio_half)h)->ops->kind);
    for (size_t i = 0; i < raised->n; i++) {
        double there, here;
        const gonio_pair *p = &raised->pairs[i];
        const gonio_vec3 wi = gonio_direction(p->theta_i, p->phi_i), wo = gonio_direction(p->theta_o, p->phi_o);
        gonio_model_eval(whole, flipped(wi, light_behind(h)), flipped(wo, camera_behind(h)), &there);
        gonio_model_eval(alone, wi, wo, &here);
        assert_memory_equal(&there, &here, sizeof here);
    }
    gonio_model_free(alone);
    gonio_samples_free(raised);
}

// The quickest fit of a method.
static gonio_fit_options quick(const gonio_method *method) {
    gonio_fit_options o;
    gonio_fit_options_default(&o);
    o.method = method->name;
    o.threads = 1;
    for (int k = 0; k < GONIO_FIT_KEYS; k++) {
        const bool has = gonio_method_has(method, &gonio_fit_keys[k]);
        o.level = has && gonio_fit_keys[k].offset == offsetof(gonio_fit_options, level) ? 2 : o.level;
        o.fill = has && gonio_fit_keys[k].offset == offsetof(gonio_fit_options, fill) ? "kernel" : o.fill;
        o.table_step = has && gonio_fit_keys[k].offset == offsetof(gonio_fit_options, table_step) ? 30 : o.table_step;
        o.diffuse_level =
            has && gonio_fit_keys[k].offset == offsetof(gonio_fit_options, diffuse_level) ? 1 : o.diffuse_level;
    }
    return o;
}

static void methods_fit_each_half(void **state) {
    (void)state;
    gonio_samples *samples = sheet();
    gonio_fit_options o;
    assert_int_equal(gonio_samples_halves(samples), 15);
    for (int m = 0; gonio_method_at(m) != NULL; m++) {
        gonio_fit_report report;
        o = quick(gonio_method_at(m));
        o.hold_out = m == 0 ? 0.2 : 0;
        gonio_model *whole = fitted(samples, &o, &report);
        assert_string_equal(whole->ops->kind, "halves");
        o.hold_out = 0;
        for (int h = 0; h < GONIO_HALVES; h++) {
            // Of the slow ones one half stands for all: the driver is the same.
            if (h == m % GONIO_HALVES) {
                half_is_its_own_fit(samples, whole, h, &o);
            }
            assert_int_equal(report.half[h].samples, PAIRS);
            assert_int_equal(report.half[h].train.samples, PAIRS);
            assert_int_equal(report.half[h].held_out.samples > 0, m == 0);
        }
        gonio_model_free(whole);
    }
    // Where nobody said that it is transmission, it is an error.
    gonio_model *model;
    gonio_error error = {0};
    samples->transmission = false;
    assert_int_equal(gonio_fit(samples, &o, &model, NULL, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.message, "thetas must be 0 to 90"));
    gonio_samples_free(samples);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(transmission_is_declared),
        cmocka_unit_test(kinds_live_in_every_half),
        cmocka_unit_test(methods_fit_each_half),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
