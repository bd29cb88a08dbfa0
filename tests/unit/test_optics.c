// SPDX-License-Identifier: BSD-3-Clause
// The tables of optics programs: which number belongs to which pair of directions, units, colour; what is refused.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "gonio/io.h"
#include "tests/format_files.h"
#include "tests/fuzz/memory_file.h"
#include "tests/unit/near.h"

static gonio_samples *read_text(const char *text, const gonio_read_options *options) {
    gonio_samples *s;
    gonio_error error = {0};
    if (gonio_read(memory_file((const uint8_t *)text, strlen(text)), options, &s, NULL, &error) != GONIO_OK) {
        fail_msg("line %lld: %s", error.line, error.message);
    }
    return s;
}

// One value that must be there: degrees, phi_o relative to phi_i.
static void has(const gonio_samples *s, double ti, double to, double phi, double value) {
    for (size_t i = 0; i < s->n; i++) {
        const gonio_pair *p = &s->pairs[i];
        const double turn = remainder(p->phi_o - p->phi_i - gonio_radians(phi), 2 * GONIO_PI);
        if (fabs(p->theta_i - gonio_radians(ti)) < 1e-9 && fabs(p->theta_o - gonio_radians(to)) < 1e-9 &&
            (fabs(turn) < 1e-9 || fabs(sin(p->theta_o)) < 1e-9) &&
            fabs(s->values[i * (size_t)s->channels] - value) < 1e-4 * value) {
            return;
        }
    }
    for (size_t i = 0; i < s->n; i++) {
        print_message("%g %g %g: %g\n", gonio_degrees(s->pairs[i].theta_i), gonio_degrees(s->pairs[i].theta_o),
                      gonio_degrees(s->pairs[i].phi_o - s->pairs[i].phi_i), s->values[i * (size_t)s->channels]);
    }
    fail_msg("no %g at theta_i %g, theta_o %g, phi %g", value, ti, to, phi);
}

static gonio_samples *read_file(const char *name) {
    format_file files[FORMAT_FILES];
    format_bytes rgl;
    format_files(files, &rgl);
    for (int k = 0; k < FORMAT_FILES; k++) {
        if (strcmp(files[k].name, name) == 0) {
            gonio_samples *s;
            gonio_error error = {0};
            gonio_read_report report;
            if (gonio_read(memory_file(files[k].data, files[k].size), NULL, &s, &report, &error) != GONIO_OK) {
                fail_msg("%s: line %lld: %s", name, error.line, error.message);
            }
            assert_string_equal(report.format, name);
            return s;
        }
    }
    fail_msg("no file '%s'", name);
    return NULL;
}

static void zemax(void **state) {
    (void)state;
    gonio_samples *s = read_file("zemax");
    assert_true(s->isotropic && s->n == 8);
    has(s, 30, 30, 180, 5); // the mirror direction
    has(s, 30, 20, 180, 6); // azimuth 0: towards the normal
    has(s, 30, 40, 180, 8);
    has(s, 0, 10, 180, 4); // at normal incidence azimuth 180 points away from where the light will be... to -x
    gonio_samples_free(s);
}

// Rotations and colours: the light turns by +R; X, Y, Z of white become equal r, g, b.
static void zemax_turned_and_coloured(void **state) {
    (void)state;
    gonio_samples *s =
        read_text("Source Measured\nSymmetry ASymmetrical4D\nSpectralContent XYZ\nScatterType BRDF\n"
                  "SampleRotation 2\n0 90\nAngleOfIncidence 1\n30\nScatterAzimuth 1\n0\nScatterRadial 2\n0 80\n\n"
                  "TristimulusX\nDataBegin\nTIS 0\n0.1901 0\nTIS 0\n0.09505 0\nDataEnd\n"
                  "TristimulusY\nDataBegin\nTIS 0\n0.2 0\nTIS 0\n0.1 0\nDataEnd\n"
                  "TristimulusZ\nDataBegin\nTIS 0\n0.2178 0\nTIS 0\n0.1089 0\nDataEnd\n",
                  NULL);
    assert_false(s->isotropic);
    assert_int_equal(s->n, 4);
    assert_int_equal(s->channels, 3);
    for (size_t i = 0; i < 4; i += 2) {
        assert_near(s->pairs[i].phi_i, gonio_radians(i == 0 ? 0 : 90), 1e-12);
        assert_near(remainder(s->pairs[i].phi_o - s->pairs[i].phi_i - GONIO_PI, 2 * GONIO_PI), 0, 1e-12);
        for (size_t c = 0; c < 3; c++) {
            assert_near(s->values[3 * i + c], i == 0 ? 0.2 : 0.1, 2e-4);
        }
    }
    gonio_samples_free(s);
}

// A block whose values integrate to something else than its TIS says.
static void zemax_scatter(void **state) {
    (void)state;
    // f_r = 1 / pi everywhere at normal incidence: .98 by these coarse cells.
    static const char text[] =
        "Source Measured\nSymmetry PlaneSymmetrical\nSpectralContent Monochrome\nScatterType BRDF\n"
        "SampleRotation 1\n0\nAngleOfIncidence 1\n0\nScatterAzimuth 2\n0 180\nScatterRadial 4\n0 30 60 90\n\n"
        "Monochrome\nDataBegin\nTIS %g\n.31831 .31831 .31831 .31831\n.31831 .31831 .31831 .31831\nDataEnd\n";
    static const struct {
        double tis;
        const char *rule;
        double value; // 0: refused
    } cases[] = {{1, "check", 0.31831}, {0.5, "check", 0},        {0.9, "check", 0.31831},
                 {0, "check", 0.31831}, {0.5, "values", 0.31831}, {0.5, "scale", 0.5 * 0.315}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        char file[sizeof text + 16];
        snprintf(file, sizeof file, text, cases[k].tis);
        const gonio_read_options options = {.seed = 1, .settings = {{"tis", cases[k].rule}}};
        gonio_samples *s;
        gonio_error error = {0};
        const gonio_status status =
            gonio_read(memory_file((const uint8_t *)file, strlen(file)), &options, &s, NULL, &error);
        assert_int_equal(status, cases[k].value > 0 ? GONIO_OK : GONIO_E_INPUT);
        if (status == GONIO_OK) {
            assert_near(s->values[0], cases[k].value, 0.005);
        } else {
            assert_non_null(strstr(error.message, "--tis"));
        }
        gonio_samples_free(s);
    }
}

static void speos(void **state) {
    (void)state;
    gonio_samples *s = read_file("speos");
    assert_int_equal(s->channels, 2);
    assert_string_equal(s->channel_names[0], "450nm");
    has(s, 30, 90, 180, 0.5 / GONIO_PI); // phi 0 is the mirror's side; a constant of reflectance 50 %
    has(s, 30, 90, 0, 0.5 / GONIO_PI);
    assert_near(s->values[1], 0.25 / GONIO_PI, 1e-9);
    gonio_samples_free(s);
}

static void pab(void **state) {
    (void)state;
    gonio_samples *s = read_file("pab");
    assert_int_equal(s->n, 4);
    has(s, 30, 120, 180, 6); // below the sample: transmission
    assert_false(s->isotropic);
    has(s, 30, 60, 180, 1); // over the cosine
    has(s, 30, 20, 120, 0.125 / cos(gonio_radians(20)));
    gonio_samples_free(s);
    // From behind, without the cosine, in colour.
    s = read_text("#format: theta phi BSDF\n#incident_angle 150 0\n#colorimetry: CIE-XYZ\n120 180 .9505 1 1.089\n",
                  NULL);
    has(s, 30, 60, 180, 1.0000);
    gonio_samples_free(s);
}

static void lighttools(void **state) {
    (void)state;
    gonio_samples *s = read_file("lighttools");
    assert_int_equal(s->n, 8); // of them four from behind, through the sample, of 0
    assert_int_equal(gonio_samples_halves(s), 1u << GONIO_REFLECTION | 1u << GONIO_TRANSMISSION_BACK);
    has(s, 30, 30, 0, 2); // azimuth 90 is the light's own
    has(s, 30, 30, 180, 4);
    gonio_samples_free(s);
}

static void ssdd(void **state) {
    (void)state;
    gonio_samples *s = read_file("ssdd");
    assert_int_equal(s->channels, 2);
    assert_string_equal(s->channel_names[1], "550nm");
    has(s, 30, 30, 180, 3); // parameter 0 is the fastest
    has(s, 30, 20, 180, 7);
    has(s, 30, 40, 180, 15);
    gonio_samples_free(s);
    // Half and difference angles: theta_h 0, theta_d 30 is the mirror direction; theta_h 30, theta_d 0 looks back.
    s = read_text(
        "VERSION 0.2\nDATA_TYPE brdf\nCOLOR_MODEL monochrome\nPARAM_TYPE half_difference_coordinate_system\n"
        "PARAM0_LIST 0 30\nPARAM2_LIST 0 30\nPARAM3_LIST 0\nDATA ascii\n1\n2\n3\n4\n\nDATA_TYPE specular_reflectance\n",
        NULL);
    has(s, 0, 0, 0, 1);
    has(s, 30, 30, 0, 2);
    has(s, 30, 30, 180, 3);
    has(s, 60, 0, 0, 4);
    gonio_samples_free(s);
    // Absolute angles, binary.
    static const char binary[] =
        "VERSION 0.3\nDATA_TYPE brdf\nCOLOR_MODEL monochrome\nPARAM_TYPE "
        "spherical_coordinate_system\nPARAM0_LIST 45\nPARAM1_LIST 0 90\nPARAM2_LIST 20\nPARAM3_LIST "
        "180\nDATA binary\n\0\0\x80\x3f\0\0\0\x40";
    assert_int_equal(gonio_read(memory_file((const uint8_t *)binary, sizeof binary - 1), NULL, &s, NULL, NULL),
                     GONIO_OK);
    has(s, 45, 20, 180, 1);
    has(s, 45, 20, 90, 2);
    gonio_samples_free(s);
}

static void ddr(void **state) {
    (void)state;
    gonio_samples *s = read_file("ddr");
    has(s, 30, 30, 180, 0.25 * 5 / GONIO_PI);
    has(s, 30, 20, 180, 0.25 * 6 / GONIO_PI);
    has(s, 0, 10, 0, 0.5 * 2 / GONIO_PI);
    gonio_samples_free(s);
    s = read_text(
        "Source Measured\nTypeSym AxiSymmetrical\nTypeColorModel Spectral 1\nTypeData Intensity Absolute\nsigma 1\n60\n"
        "phi 1\n0\ntheta 1\n0\nwl 550\nkbdf 0.5\ndef\n2\n",
        NULL);
    assert_string_equal(s->channel_names[0], "550nm");
    has(s, 60, 60, 180, 0.5 * 2 / GONIO_PI / 0.5); // over the cosine of 60 deg
    gonio_samples_free(s);
}

// Both halves in one file, whose tables stand by turns or one half behind the other; a third at the same percentages.
static void speos_of_both_halves(void **state) {
    (void)state;
    static const char head[] = "OPTIS - brdf surface file v9.0\n0\na\n0\n\n1\t1\n1\n2\t1\n0\t30\n550\n";
    static const char *const tables[2][2] = {
        {"25\n2 2\n\t0\t180\n0 1 1\n90 1 1\n", "30\n2 2\n\t0\t180\n0 2 2\n90 2 2\n"},
        {"50\n2 2\n\t0\t180\n90 1 1\n180 1 1\n", "10\n2 2\n\t0\t180\n90 1 1\n180 1 1\n"}};
    for (int apart = 0; apart < 2; apart++) {
        char text[1000];
        snprintf(text, sizeof text, "%s%s%s%s%s", head, tables[0][0], tables[apart ? 0 : 1][apart ? 1 : 0],
                 tables[apart ? 1 : 0][apart ? 0 : 1], tables[1][1]);
        gonio_samples *s = read_text(text, NULL);
        assert_true(s->transmission);
        has(s, 30, 90, 180, 0.3 / GONIO_PI);
        has(s, 0, 180, 0, 0.5 / GONIO_PI);
        has(s, 30, 180, 0, 0.1 / GONIO_PI);
        gonio_samples_free(s);
    }
}

// Azimuth 0 of beta - beta_0: an axis of the sample, or orthogonal to the plane of incidence, in which 90 deg is
// outwards.
static void tracepro_azimuths(void **state) {
    (void)state;
    static const char text[] =
        "TracePro Surface Property Data\nScatter 5\nInteraction 0\nTable_BSDF_Data\n"
        "Temperature\tWavelength\tIncAngle\tAziAngle\tScatterBeta\tScatterAzimuth\tBRDF\tBTDF\n"
        "300\t0.55\t30\t0\t0.25\t0\t1\t0\n300\t0.55\t30\t0\t0.25\t90\t2\t0\n300\t0.55\t30\t0\t0.25\t180\t3\t0\n"
        "300\t0.55\t30\t90\t0.25\t90\t4\t0\n";
    const double out = gonio_degrees(asin(0.75)), in = gonio_degrees(asin(0.25));
    for (int floating = 0; floating < 2; floating++) {
        gonio_read_options options = {.seed = 1};
        gonio_read_report report;
        if (floating == 1) {
            options.settings[0] = (gonio_format_setting){"zero-azimuth", "floating"};
        }
        gonio_samples *s;
        assert_int_equal(gonio_read(memory_file((const uint8_t *)text, sizeof text - 1), &options, &s, &report, NULL),
                         GONIO_OK);
        assert_true((strstr(report.notes, "--zero-azimuth") != NULL) == (floating == 0));
        if (floating == 1) {
            has(s, 30, out, 180, 2);
        } else {
            has(s, 30, out, 180, 1);
            has(s, 30, in, 180, 3);
        }
        // Light at azimuth 90: the axis of the sample is the same, and so is beta_0's side.
        const gonio_pair *last = &s->pairs[s->n - 1];
        assert_near(gonio_degrees(last->theta_o), floating == 1 ? gonio_degrees(asin(0.75)) : out, 1e-9);
        gonio_samples_free(s);
    }
}

// A reflectance has no f_r in 1/sr before a cone is stated; a cone of 1 deg of half angle has the projected solid angle
// pi sin(1 deg)^2 cos(theta).
static void sdr(void **state) {
    (void)state;
    format_file files[FORMAT_FILES];
    format_bytes rgl;
    format_files(files, &rgl);
    for (int k = 0; k < FORMAT_FILES; k++) {
        if (strcmp(files[k].name, "sdr") != 0) {
            continue;
        }
        const char *path = memory_file(files[k].data, files[k].size);
        gonio_samples *s;
        gonio_error error = {0};
        assert_int_equal(gonio_read(path, NULL, &s, NULL, &error), GONIO_E_USAGE);
        assert_non_null(strstr(error.message, "--cone"));
        for (int through = 0; through < 2; through++) {
            const gonio_read_options options = {
                .seed = 1, .settings = {{"cone", "1"}, {"transmission", through == 1 ? "yes" : "no"}}};
            assert_int_equal(gonio_read(path, &options, &s, NULL, &error), GONIO_OK);
            assert_int_equal(s->n, 3); // not at the horizon
            const double cone = GONIO_PI * pow(sin(gonio_radians(1)), 2);
            has(s, 60, through == 1 ? 120 : 60, 180, 0.1 / (cone * cos(gonio_radians(60))));
            assert_non_null(strstr(s->head, "aperture_half_angle_deg = 1"));
            gonio_samples_free(s);
        }
    }
}

// Each of ALTA's parametrisations that tells both directions, from its definition: l is the light, v the view.
enum { ALTA_FORMS = 8 };
static const struct {
    const char *name;
    int n;
} alta_forms[ALTA_FORMS] = {
    {"NEUMANN_3D", 3},    {"STARK_3D", 3},       {"SCHLICK_TL_TK_PROJ_DPHI", 3}, {"RETRO_TL_TVL_PROJ_DPHI", 3},
    {"STEREOGRAPHIC", 4}, {"RUSIN_TH_TD_PD", 3}, {"ISOTROPIC_TV_TL_DPHI", 3},    {"CARTESIAN", 6}};

static double between(double ay, double ax, double by, double bx) { return atan2(ay, ax) - atan2(by, bx); }

static void alta_coordinates(int form, gonio_vec3 l, gonio_vec3 v, double *x) {
    const double hx = (l.x + v.x) / 2, hy = (l.y + v.y) / 2, hz = (l.z + v.z) / 2;
    const double bx = (l.x - v.x) / 2, by = (l.y - v.y) / 2, bz = (l.z - v.z) / 2;
    const double kx = v.x - l.x, ky = v.y - l.y, kz = v.z + l.z, k = sqrt(kx * kx + ky * ky + kz * kz);
    const double lv = l.x * v.x + l.y * v.y + l.z * v.z, h = sqrt(hx * hx + hy * hy + hz * hz);
    const double tl = acos(l.z), tv = acos(v.z), apart = acos(lv);
    if (form < 2) {
        x[0] = hypot(hx, hy);
        x[1] = form == 0 ? hypot(bx, by) : sqrt(bx * bx + by * by + bz * bz);
        x[2] = between(by, bx, hy, hx);
    } else if (form == 2) {
        const double dphi = between(l.y, l.x, ky, kx), tk = acos(kz / k);
        x[0] = tl;
        x[1] = tk * cos(dphi);
        x[2] = tk * sin(dphi);
    } else if (form == 3) { // the spherical triangle of light, view and normal, at the light
        const double c = (v.z - l.z * lv) / (sin(tl) * sin(apart));
        const double s = sin(between(l.y, l.x, v.y, v.x)) * sin(tv) / sin(apart);
        x[0] = tl;
        x[1] = apart * c;
        x[2] = apart * s;
    } else if (form == 4) {
        const double own[4] = {v.x / (1 + v.z), v.y / (1 + v.z), l.x / (1 + l.z), l.y / (1 + l.z)};
        memcpy(x, own, sizeof own);
    } else if (form == 5) { // the view in the half vector's frame
        const double phi = atan2(hy, hx), theta = acos(hz / h);
        const double ax = v.x * cos(phi) + v.y * sin(phi), ay = v.y * cos(phi) - v.x * sin(phi);
        x[0] = theta;
        x[1] = acos(fmin((v.x * hx + v.y * hy + v.z * hz) / h, 1));
        x[2] = atan2(ay, ax * cos(theta) - v.z * sin(theta));
    } else if (form == 6) {
        const double own[3] = {tv, tl, between(l.y, l.x, v.y, v.x)};
        memcpy(x, own, sizeof own);
    } else {
        const double own[6] = {v.x, v.y, v.z, l.x, l.y, l.z};
        memcpy(x, own, sizeof own);
    }
}

static void alta(void **state) {
    (void)state;
    for (int form = 0; form < ALTA_FORMS; form++) {
        char text[4000];
        int at = sprintf(text, "#DIM %d 1\n#PARAM_IN %s\n#PARAM_OUT INV_STERADIAN\n", alta_forms[form].n,
                         alta_forms[form].name);
        gonio_pair pairs[20];
        for (int i = 0; i < 20; i++) {
            double x[6];
            pairs[i] = (gonio_pair){0.1 + 0.07 * i, 0.3, 1.5 - 0.06 * i, 0.3 + 0.31 * i + 0.1};
            alta_coordinates(form, gonio_direction(pairs[i].theta_i, pairs[i].phi_i),
                             gonio_direction(pairs[i].theta_o, pairs[i].phi_o), x);
            for (int k = 0; k < alta_forms[form].n; k++) {
                at += sprintf(text + at, "%.15g ", x[k]);
            }
            at += sprintf(text + at, "%d\n", i + 1);
        }
        gonio_samples *s = read_text(text, NULL);
        assert_int_equal(s->n, 20);
        for (size_t i = 0; i < s->n; i++) {
            const gonio_pair *p = &s->pairs[i];
            assert_near(p->theta_i, pairs[i].theta_i, 1e-7);
            assert_near(p->theta_o, pairs[i].theta_o, 1e-7);
            assert_near(cos(p->phi_o - p->phi_i), cos(pairs[i].phi_o - pairs[i].phi_i), 1e-7);
        }
        gonio_samples_free(s);
    }
}

static void astm(void **state) {
    (void)state;
    gonio_samples *s = read_file("astm");
    assert_int_equal(s->n, 2);
    assert_string_equal(s->channel_names[0], "r");
    has(s, gonio_degrees(0.5), gonio_degrees(0.2), gonio_degrees(3), 4);
    gonio_samples_free(s);
}

static void mbsdf(void **state) {
    (void)state;
    gonio_samples *s = read_file("mbsdf");
    has(s, 45, 45, 45, 1); // centres of one theta and two azimuths
    has(s, 45, 45, 135, 0.5);
    gonio_samples_free(s);
}

static void utia(void **state) {
    (void)state;
    unsigned char *data = format_utia();
    const char *path = memory_file(data, FORMAT_UTIA_NUMBERS * 8);
    free(data);
    gonio_samples *s;
    gonio_error error = {0};
    assert_int_equal(gonio_read(path, NULL, &s, NULL, &error), GONIO_E_USAGE);
    assert_non_null(strstr(error.message, "--scale"));
    const gonio_read_options options = {.seed = 1, .settings = {{"scale", "0.5"}}};
    assert_int_equal(gonio_read(path, &options, &s, NULL, &error), GONIO_OK);
    assert_int_equal(s->n, (1 + 5 * 48) * (1 + 5 * 48)); // the poles once
    // theta_i 30, phi_i 7.5; theta_o 15, phi_o 15: row 2 * 48 + 1, column 48 + 2.
    has(s, 30, 15, 7.5, 0.5 * (97 * 288 + 50) / FORMAT_UTIA_NUMBERS);
    gonio_samples_free(s);
}

// Every half that a file states, where it stands: azimuths are kept, the way straight through lies half a turn from the
// light.
static void halves(void **state) {
    (void)state;
    gonio_samples *s =
        read_text("Source Measured\nSymmetry PlaneSymmetrical\nSpectralContent Monochrome\nScatterType BTDF\n"
                  "SampleRotation 1\n0\nAngleOfIncidence 1\n30\nScatterAzimuth 2\n0 180\nScatterRadial 2\n0 10\n\n"
                  "Monochrome\nDataBegin\nTIS 0\n1 2\n3 4\nDataEnd\n",
                  NULL);
    has(s, 30, 150, 180, 1); // straight through
    has(s, 30, 160, 180, 2); // toward the normal
    has(s, 30, 140, 180, 4);
    gonio_samples_free(s);
    s = read_text(
        "Symmetry PlaneSymmetrical\nSpectralContent Monochrome\nScatterAzimuth 2\n90 270\nScatterRadial 1\n20\n"
        "DataBegin\nAOI 30\nPOI 0\nSide Front\nScatterType BRDF\nTIS 0\n1 2\nAOI 30\nSide Front\n"
        "ScatterType BTDF\nTIS 0\n3 4\nAOI 40\nSide Back\nScatterType BRDF\nTIS 0\n5 6\n"
        "AOI 50\nSide Back\nScatterType BTDF\nTIS 0\n7 8\nDataEnd\n",
        NULL);
    assert_int_equal(s->n, 8);
    has(s, 30, 20, 180, 2);
    has(s, 30, 160, 0, 3);
    has(s, 30, 160, 180, 4);
    has(s, 140, 160, 180, 6);
    has(s, 130, 20, 0, 7);
    gonio_samples_free(s);
#define SSDD(type, value)                                                                                              \
    "DATA_TYPE " type "\nCOLOR_MODEL monochrome\nPARAM_TYPE spherical_coordinate_system\nPARAM0_LIST "                 \
    "45\nPARAM2_LIST 20\nPARAM3_LIST 180\nDATA ascii\n" value "\n"
    s = read_text("VERSION 0.3\n" SSDD("brdf", "1") SSDD("btdf", "2") "DATA_TYPE specular_reflectance\n", NULL);
    assert_int_equal(s->n, 2);
    has(s, 45, 20, 180, 1);
    has(s, 45, 160, 180, 2);
    gonio_samples_free(s);
    // Thetas of transmission from either normal; 40 % of the light.
    s = read_text("OPTIS - brdf surface file v8.0\n0\nc\n1\n-\n0 1\n1\n1 1\n30\n550\n40\n2 1\n0\n0 1\n90 1\n", NULL);
    has(s, 30, 180, 0, 0.4 / GONIO_PI);
    gonio_samples_free(s);
    s = read_text("OPTIS - brdf surface file v8.0\n0\nc\n1\n-\n0 1\n1\n1 1\n30\n550\n40\n2 1\n0\n90 1\n180 1\n", NULL);
    has(s, 30, 180, 0, 0.4 / GONIO_PI);
    gonio_samples_free(s);
    static const char mbsdf_text[] = "NVIDIA ARC MBSDF V1\nMBSDF_DATA_REFLECTION=\n"
                                     "\0\0\0\0\1\0\0\0\1\0\0\0\0\0\x80\x3f\nMBSDF_DATA_TRANSMISSION=\n"
                                     "\0\0\0\0\1\0\0\0\1\0\0\0\0\0\0\x3f";
    assert_int_equal(gonio_read(memory_file((const uint8_t *)mbsdf_text, sizeof mbsdf_text - 1), NULL, &s, NULL, NULL),
                     GONIO_OK);
    has(s, 45, 45, 90, 1);
    has(s, 45, 135, 90, 0.5);
    gonio_samples_free(s);
    // A header of ASTM's that speaks of it; thetas from the far normal.
    s = read_text("BTDF of a diffuser\nVARS theta_i,phi_i,theta_s,phi_s,R\n0.5,0,0.2,3,4\n", NULL);
    has(s, gonio_degrees(0.5), 180 - gonio_degrees(0.2), gonio_degrees(3), 4);
    gonio_samples_free(s);
}

static void refused_with_words(void **state) {
    (void)state;
    static const struct {
        const char *text, *words;
    } bad[] = {
        {"Source Measured\nSymmetry PlaneSymmetrical\nSpectralContent Monochrome\nScatterType BSSRDF\nAngleOfIncidence "
         "ScatterRadial\n",
         "ScatterType"},
        {"Source Measured\nUnits degrees\nAngleOfIncidence ScatterRadial\n", "unknown keyword 'Units'"},
        {"Source Measured\nSpectralContent Monochrome\nAngleOfIncidence 2\n30 0\nScatterRadial 1\n", "ascending"},
        {"Source Measured\nSpectralContent Monochrome\nAngleOfIncidence 1\n30\nScatterAzimuth 1\n0\nScatterRadial "
         "1\n0\n"
         "Monochrome\nDataBegin\nTIS 1\n-1\n",
         "negative"},
        {"Source Measured\nTypeSym ASymmetrical 4D\nTypeColorModel BW\nTypeData Luminance Relative\n", "relative"},
        {"note\nunits: degrees\nVARS theta_i,phi_i,theta_s,phi_s,R\n", "may change"},
        {"VARS theta_i,phi_i,theta_s,phi_s,R\n1,2,3\n", "expected 5 columns"},
        {"NUM_POINTS 3\nVARS theta_i,phi_i,theta_s,phi_s,R\n0,0,0,0,1\n", "NUM_POINTS states 3"},
        {"VERSION 0.3\nDATA_TYPE specular_reflectance\n", "DATA_TYPE"},
        {"VERSION 0.3\nDATA_TYPE btdf\n", "ends before its DATA"},
        {"OPTIS - brdf surface file v7.0\n0\n", "version '7.0'"},
        {"OPTIS - brdf surface file v8.0\n0\nc\n1\n-\n1 1\n1\n1 1\n30\n550\n50\n2 1\n0\n0 1\n90 1\n50\n2 1\n0\n0 1\n90 "
         "1\n",
         "a table of reflection too many"},
        {"OPTIS - brdf surface file v8.0\n0\nc\n1\n-\n0 0\n", "neither"},
        {"OPTIS - brdf surface file v8.0\n0\nc\n1\n-\n1 0\n1\n1 1\n30\n550\n50\n2 1\n0\n0 0\n90 0\n",
         "without any light"},
        {"#format: theta phi power\n#intheta 3\n", "expected theta phi DSF"},
        {"#format: theta phi DSF\n#intheta 3\n1 2 3\n", "the rows begin"},
        {"#format: theta phi DSF\n#incident_angle 3 0\n#colorimetry: CIE-Lab\n1 2 3\n", "colorimetry"},
        {"VERSION 0.3\nDATA_TYPE brdf\nCOLOR_MODEL rgb\nPARAM_TYPE distorted_spherical_coordinate_system\n",
         "PARAM_TYPE"},
        {"VERSION 0.3\nDATA_TYPE brdf\nPOLARISATION s\n", "unknown entry"},
        {"Symmetry PlaneSymmetrical\nSpectralContent Monochrome\nScatterAzimuth 1\n0\nScatterRadial "
         "1\n0\nDataBegin\nAOI 30\n"
         "POI 45\nTIS 0\n1\nDataEnd\n",
         "POI 45"},
    };
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        gonio_samples *s;
        gonio_error error = {.line = -1};
        const char *path = memory_file((const uint8_t *)bad[k].text, strlen(bad[k].text));
        assert_int_equal(gonio_read(path, NULL, &s, NULL, &error), GONIO_E_INPUT);
        if (strstr(error.message, bad[k].words) == NULL || error.line < 1) {
            fail_msg("line %lld: %s; expected '%s'", error.line, error.message, bad[k].words);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(zemax),
        cmocka_unit_test(zemax_turned_and_coloured),
        cmocka_unit_test(zemax_scatter),
        cmocka_unit_test(speos),
        cmocka_unit_test(pab),
        cmocka_unit_test(lighttools),
        cmocka_unit_test(ssdd),
        cmocka_unit_test(ddr),
        cmocka_unit_test(speos_of_both_halves),
        cmocka_unit_test(tracepro_azimuths),
        cmocka_unit_test(sdr),
        cmocka_unit_test(alta),
        cmocka_unit_test(astm),
        cmocka_unit_test(mbsdf),
        cmocka_unit_test(halves),
        cmocka_unit_test(utia),
        cmocka_unit_test(refused_with_words),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
