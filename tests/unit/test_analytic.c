// SPDX-License-Identifier: BSD-3-Clause
// Analytic BRDFs: their properties, then values from formulae worked out independently, then the specs' errors.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "brdf/kind/analytic.h"
#include "io/spec.h"
#include "tests/simulate.h"
#include "tests/unit/near.h"
#include "tests/unit/scratch.h"

static const char *const specs[] = {
    "lambert:rho=0.5",
    "ward:rho_d=0.3,rho_s=0.2,alpha=0.15",
    "ward:rho_d=0.3,rho_s=0.2,alpha_x=0.1,alpha_y=0.4",
    "ward:rho_s=1,alpha=1e-5",
    "blinn-phong:rho_d=0.1,rho_s=0.4,n=50",
    "blinn-phong:rho_s=0.4,n=1e9",
    "cook-torrance:rho_d=0.2,rho_s=0.5,m=0.2,f0=0.05",
    "cook-torrance:rho_s=1,m=1e-5",
    "ggx:rho_d=0.2,rho_s=0.5,alpha=0.3,f0=0.04",
    "ggx:rho_s=0.5,alpha_x=0.3,alpha_y=0.05",
    "ggx:rho_s=1,alpha=1e-5",
    "oren-nayar:rho=0.6,sigma_deg=25",
    "phong:rho_d=0.1,rho_s=0.4,n=50",
    "lafortune:rho_d=0.1,cxy=-0.9,cz=0.95,n=20",
    "lafortune:rho_d=0.1,rho_s=0.3,cx=-0.9,cy=-0.8,cz=0.95,n=20",
    "ward-duer:rho_d=0.3,rho_s=0.2,alpha_x=0.1,alpha_y=0.4",
    "ngan:rho_d=0.2,rho_s=0.5,m=0.2,f0=0.05",
    "ashikhmin-shirley:rho_d=0.3,n_u=10,n_v=400,f0=0.05",
    "schlick:rho_d=0.2,rho_s=0.5,r=0.1,p=0.4,f0=0.05",
    "he:rho_d=0.1,sigma=0.28,tau=1.77,f0=0.6",
    "principled:base=0.4/0.3/0.2,metallic=0.3,roughness=0.4,anisotropic=-0.5",
    ("sgd:rho_d=0.048,rho_s=0.0365,alpha=0.0148,p=0.459,f0=6.055,f1=5.055,scale=46.38,lambda=2.6,c=1e-7,k=47.8,"
     "theta_0=0.2"),
    "lambert:rho=0.1/0.2/0.3+ggx:rho_s=0.5,alpha=0.1+ward:rho_s=1e-3,alpha=0.5",
};
#define SPECS (sizeof specs / sizeof *specs)

static gonio_model *from(const char *spec) {
    gonio_model *m;
    gonio_error error = {0};
    if (gonio_model_from_spec(spec, &m, &error) != GONIO_OK) {
        fail_msg("%s: %s", spec, error.message);
    }
    return m;
}

static double at(const gonio_model *m, double ti, double pi, double to, double po) {
    double v[64];
    const gonio_pair p = {gonio_radians(ti), gonio_radians(pi), gonio_radians(to), gonio_radians(po)};
    gonio_model_eval_pair(m, &p, v);
    return v[0];
}

static void finite_reciprocal_mirrored_everywhere(void **state) {
    (void)state;
    static const double theta[] = {0, 1e-9, 1, 30, 60, 75, 85, 89, 89.9, 89.999, 89.99999, 90};
    static const double phi[] = {0, 1e-9, 45, 90, 135, 180, 200, 360};
    for (size_t s = 0; s < SPECS; s++) {
        gonio_model *m = from(specs[s]);
        for (size_t a = 0; a < 12; a++) {
            for (size_t b = 0; b < 12; b++) {
                for (size_t c = 0; c < 8; c++) {
                    for (size_t d = 0; d < 8; d++) {
                        const double f = at(m, theta[a], phi[d], theta[b], phi[c]);
                        assert_true(isfinite(f) && f >= 0);
                        const double back = at(m, theta[b], phi[c], theta[a], phi[d]);
                        const double mirrored = at(m, theta[a], -phi[d], theta[b], -phi[c]);
                        assert_near(back, f, 1e-9 * f);
                        assert_near(mirrored, f, 1e-9 * f);
                    }
                }
            }
        }
        gonio_model_free(m);
    }
}

static void isotropic_models_depend_on_the_difference_of_azimuths(void **state) {
    (void)state;
    for (size_t s = 0; s < SPECS; s++) {
        gonio_model *m = from(specs[s]);
        const double a = at(m, 40, 0, 50, 160), b = at(m, 40, 33, 50, 193);
        if (m->isotropic) {
            assert_near(a, b, 1e-12 * a);
        } else {
            assert_true(fabs(a - b) > 1e-3 * a);
        }
        gonio_model_free(m);
    }
}

// Directional albedo by the midpoint rule; n = 400 resolves lobes down to alpha = 0.1.
static double albedo(const gonio_model *m, double theta_i_deg, int n) {
    double sum = 0;
    const gonio_vec3 wi = gonio_direction(gonio_radians(theta_i_deg), 0);
    for (int a = 0; a < n; a++) {
        // Midpoints in sin^2(theta): each ring carries the same cos-weighted solid angle, pi in all.
        const double s2 = (a + 0.5) / n;
        for (int b = 0; b < 2 * n; b++) {
            const double phi = GONIO_PI * (b + 0.5) / n;
            const gonio_vec3 wo = {sqrt(s2) * cos(phi), sqrt(s2) * sin(phi), sqrt(1 - s2)};
            sum += gonio_model_eval_channel(m, wi, wo, 0);
        }
    }
    return sum * GONIO_PI / (2.0 * n * n);
}

static void albedos(void **state) {
    (void)state;
    gonio_model *m = from("lambert:rho=0.5");
    assert_near(albedo(m, 30, 50), 0.5, 1e-12);
    gonio_model_free(m);
    // Blinn-Phong's factor makes the albedo at normal incidence exactly rho_s, whatever the exponent.
    const char *const blinn[] = {"blinn-phong:rho_s=0.4,n=0", "blinn-phong:rho_s=0.4,n=7",
                                 "blinn-phong:rho_s=0.4,n=100"};
    for (int i = 0; i < 3; i++) {
        m = from(blinn[i]);
        assert_near(albedo(m, 0, 400), 0.4, 2e-4);
        gonio_model_free(m);
    }
    // Ward's lobe: 1 - 3 alpha^2 + O(alpha^4) at normal incidence. The figures come from a quadrature of eq. 3.3 over
    // the facets' slopes, a parametrisation that has nothing in common with albedo().
    m = from("ward:rho_d=0.3,rho_s=0.2,alpha=0.1");
    assert_near(albedo(m, 0, 400), 0.3 + 0.2 * 0.9710516755670214, 1e-4);
    assert_near(albedo(m, 20, 400), 0.3 + 0.2 * 0.912783239914856, 1e-4);
    assert_near(albedo(m, 40, 400), 0.3 + 0.2 * 0.7451352277925649, 1e-4);
    gonio_model_free(m);
    // A smooth GGX or Beckmann mirror without Fresnel loses little, a rough one more, and none creates energy.
    static const char *const micro[] = {"ggx:rho_s=1,alpha=0.1", "cook-torrance:rho_s=1,m=0.1", "ggx:rho_s=1,alpha=0.5",
                                        "ggx:rho_s=1,alpha_x=0.2,alpha_y=0.6", "cook-torrance:rho_s=1,m=0.3"};
    for (int i = 0; i < 5; i++) {
        m = from(micro[i]);
        for (double theta = 0; theta <= 75; theta += 25) {
            const double a = albedo(m, theta, 400);
            assert_true(a < 1.002 && a > (i < 2 ? 0.9 : 0.5));
        }
        gonio_model_free(m);
    }
    m = from("oren-nayar:rho=0.6,sigma_deg=0");
    assert_near(albedo(m, 50, 100), 0.6, 1e-12); // smooth facets: Lambert
    gonio_model_free(m);
}

// Values by other routes: GGX's weak furnace test, Ward and Blinn-Phong in angles, Oren-Nayar in its published form.
static void closed_forms(void **state) {
    (void)state;
    gonio_model *m = from("ward:rho_d=0.3,rho_s=0.2,alpha=0.15");
    // At the mirror direction the exponent is 0.
    assert_near(at(m, 40, 0, 40, 180), 0.3 / GONIO_PI + 0.2 / (4 * GONIO_PI * 0.0225 * cos(gonio_radians(40))), 1e-12);
    // In the plane of incidence theta_h = (theta_o - theta_i)/2.
    const double t = tan(gonio_radians(10));
    assert_near(at(m, 30, 0, 50, 180),
                0.3 / GONIO_PI + 0.2 * exp(-t * t / 0.0225) /
                                     (4 * GONIO_PI * 0.0225 * sqrt(cos(gonio_radians(30)) * cos(gonio_radians(50)))),
                1e-12);
    gonio_model_free(m);
    m = from("ward:rho_s=0.2,alpha_x=0.1,alpha_y=0.4");
    // Normal incidence, theta_o = 20 along y: theta_h = 10 with slope along y only.
    assert_near(at(m, 0, 0, 20, 90), 0.2 * exp(-t * t / 0.16) / (4 * GONIO_PI * 0.04 * sqrt(cos(gonio_radians(20)))),
                1e-12);
    gonio_model_free(m);
    m = from("blinn-phong:rho_s=1,n=20");
    assert_near(at(m, 30, 0, 50, 180),
                22.0 * 24 / (8 * GONIO_PI * (20 + pow(2, -10))) * pow(cos(gonio_radians(10)), 20), 1e-12);
    gonio_model_free(m);
    m = from("ggx:rho_s=1,alpha=0.3,f0=0.04");
    // Mirror direction at 60 deg: D = 1/(pi a^2), G1 = 2/(1 + sqrt(1 + a^2 tan^2)), F = f0 + (1 - f0)(1 - cos 60)^5.
    const double g1 = 2 / (1 + sqrt(1 + 0.09 * 3)), f = 0.04 + 0.96 / 32;
    assert_near(at(m, 60, 0, 60, 180), g1 * g1 * f / (GONIO_PI * 0.09 * 4 * 0.25), 1e-12);
    gonio_model_free(m);
    m = from("cook-torrance:rho_s=1,m=0.3,f0=0.04");
    // Mirror direction at 60 deg: D = 1/(pi m^2), G = min(1, 2 cos 60 / cos 60) = 1.
    assert_near(at(m, 60, 0, 60, 180), f / (GONIO_PI * 0.09 * 4 * 0.25), 1e-12);
    // Retro-reflection at 70 deg: h = wi, tan = tan 70, G = min(1, 2 cos^2 70), F = f0.
    const double c = cos(gonio_radians(70)), tan2 = 1 / (c * c) - 1;
    assert_near(at(m, 70, 0, 70, 0) /
                    (exp(-tan2 / 0.09) / (GONIO_PI * 0.09 * c * c * c * c) * 2 * c * c * 0.04 / (4 * c * c)),
                1, 1e-9);
    gonio_model_free(m);
    m = from("oren-nayar:rho=0.6,sigma=0.4");
    const double s2 = 0.16, a = 1 - 0.5 * s2 / (s2 + 0.33), b = 0.45 * s2 / (s2 + 0.09);
    assert_near(at(m, 60, 0, 30, 40),
                0.6 / GONIO_PI * (a + b * cos(gonio_radians(40)) * sin(gonio_radians(60)) * tan(gonio_radians(30))),
                1e-12);
    assert_near(at(m, 60, 0, 30, 140), 0.6 / GONIO_PI * a, 1e-12);
    gonio_model_free(m);
}

// K over alpha Gamma(1 - p, alpha) is the published alum-bronze's: the distribution's integral over slopes is 1 there.
static void further_closed_forms(void **state) {
    (void)state;
    gonio_model *m = from("phong:rho_s=1,n=20");
    assert_near(at(m, 30, 0, 50, 180), 22 / (2 * GONIO_PI) * pow(cos(gonio_radians(20)), 20), 1e-12);
    assert_near(at(m, 30, 0, 70, 0), 0, 1e-12); // 100 deg off the mirror direction
    assert_near(albedo(m, 0, 400), 1, 1e-4);
    gonio_model_free(m);
    gonio_model *phong = from("phong:rho_s=0.3,n=20"), *lobe = from("lafortune:rho_s=1.0504226244065091,n=20");
    assert_near(at(lobe, 20, 0, 50, 150), at(phong, 20, 0, 50, 150), 1e-12); // 0.3 * 22 / (2 pi)
    gonio_model_free(phong);
    gonio_model_free(lobe);
    m = from("ward-duer:rho_s=0.2,alpha=0.15");
    assert_near(at(m, 40, 0, 40, 180), 0.2 / (4 * GONIO_PI * 0.0225 * gonio_square(cos(gonio_radians(40)))), 1e-12);
    gonio_model_free(m);
    gonio_model *four = from("cook-torrance:rho_s=0.4,m=0.3,f0=0.04"), *pi = from("ngan:rho_s=0.4,m=0.3,f0=0.04");
    assert_near(at(pi, 20, 0, 50, 150), at(four, 20, 0, 50, 150) * 4 / GONIO_PI, 1e-12);
    gonio_model_free(four);
    gonio_model_free(pi);
    m = from("ashikhmin-shirley:n_u=10,n_v=1000,f0=1");
    // Normal incidence, theta_o = 20 along y: h is 10 deg along y, where the exponent is n_v.
    assert_near(at(m, 0, 0, 20, 90),
                sqrt(11.0 * 1001) / (8 * GONIO_PI) * pow(cos(gonio_radians(10)), 1000) / cos(gonio_radians(10)), 1e-12);
    gonio_model_free(m);
    m = from("ashikhmin-shirley:rho_d=0.5,rho_s=0,n=10,f0=0.05");
    // 28/23 makes up for 23/28, the mean of 1 - (1 - cos/2)^5; at normal incidence the other factor is 31/32.
    assert_near(albedo(m, 0, 200), 0.5 * 0.95 * 31 / 32, 1e-4);
    gonio_model_free(m);
    // Schlick's Z with r = alpha^2 is GGX's distribution.
    m = from("schlick:rho_s=1,r=0.09");
    lobe = from("ggx:rho_s=1,alpha=0.3");
    assert_near(at(m, 0, 0, 0, 0), at(lobe, 0, 0, 0, 0), 1e-12);
    gonio_model_free(m);
    gonio_model_free(lobe);
    // He's surface, very rough: Beckmann's slopes of m = 2 sigma / tau, where little is shadowed.
    m = from("he:sigma=4,tau=40");
    lobe = from("cook-torrance:rho_s=1,m=0.2");
    assert_near(at(m, 20, 0, 35, 170) / at(lobe, 20, 0, 35, 170), 1, 5e-3);
    gonio_model_free(m);
    gonio_model_free(lobe);
    m = from("principled:base=0.8,metallic=1,roughness=0.5");
    lobe = from("ggx:rho_s=1,alpha=0.25,f0=0.8");
    assert_near(at(m, 20, 0, 35, 170), at(lobe, 20, 0, 35, 170), 1e-12);
    gonio_model_free(m);
    gonio_model_free(lobe);
    m = from("sgd:rho_s=1,alpha=0.25,p=0.5,f0=1,scale=4.70648125,theta_0=1.5");
    // 1 / (0.25 Gamma(0.5, 0.25)), Gamma(0.5, 0.25) = sqrt(pi) erfc(0.5); F = 1, G = 1: D / pi = K e^-a / (pi^2 a^p).
    assert_near(4.70648125, 1 / (0.25 * sqrt(GONIO_PI) * erfc(0.5)), 1e-8);
    assert_near(at(m, 0, 0, 0, 0), 4.70648125 * exp(-0.25) / (GONIO_PI * GONIO_PI * 0.5), 1e-12);
    gonio_model_free(m);
}

// A parameter within its bounds that no lobe is too narrow for.
static double tame(const gonio_formula_parameter *p, uint64_t *seed) {
    const double low = fmax(p->minimum, p->minimum < 0 ? -0.9 : 0.05),
                 high = fmin(p->maximum, p->maximum > 10 ? 30 : 0.9);
    return low + (high - low) * gonio_random_next(seed);
}

// Derivatives by parameters against central differences, whose truncation is (1e-5)^2 of the third derivative and whose
// rounding is 1e-16 / 1e-5; and what `linear` and `absolute` say.
static void slopes_are_derivatives(void **state) {
    (void)state;
    uint64_t seed = 5;
    for (const gonio_formula *const *at = gonio_formulae(); *at != NULL; at++) {
        const gonio_formula *f = *at;
        for (int round = 0; round < 100; round++) {
            double p[GONIO_FORMULA_PARAMETERS_MAX], d[GONIO_FORMULA_PARAMETERS_MAX], sum = 0;
            for (int k = 0; k < f->n; k++) {
                p[k] = tame(&f->parameters[k], &seed);
            }
            const gonio_pair pair = simulate_pair(&seed, 0);
            const gonio_lobe_geometry g = gonio_lobe_geometry_of(gonio_direction(pair.theta_i, pair.phi_i),
                                                                 gonio_direction(pair.theta_o, pair.phi_o));
            const double value = f->value(&g, p);
            assert_near(f->slope(&g, p, d), value, 1e-13 * value);
            for (int k = 0; k < f->n; k++) {
                const double kept = p[k], h = 1e-5 * fmax(fabs(kept), 0.05);
                p[k] = kept + h;
                const double above = f->value(&g, p);
                p[k] = kept - h;
                const double below = f->value(&g, p);
                p[k] = kept;
                const double expected = (above - below) / (2 * h);
                if (!(fabs(d[k] - expected) <= 1e-6 * (fabs(expected) + value / fmax(fabs(kept), 0.05)))) {
                    fail_msg("%s: d/d%s is %.9g, by differences %.9g, of %g", f->name, f->parameters[k].name, d[k],
                             expected, value);
                }
                sum += (f->linear & GONIO_LINEAR(k)) != 0 ? p[k] * d[k] : 0;
                if ((f->linear & GONIO_LINEAR(k)) != 0) {
                    assert_near(above - value, value - below, 1e-10 * value);
                }
            }
            assert_true(f->absolute || fabs(sum - value) <= 1e-12 * value);
        }
    }
}

static void parameters_are_one_vector(void **state) {
    (void)state;
    gonio_model *m = from("lambert:rho=0.1/0.2/0.3+ggx:rho_s=0.5,alpha=0.1");
    assert_int_equal(m->channels, 3);
    assert_string_equal(m->channel_names[2], "b");
    size_t count;
    double *p = gonio_analytic_parameters(m, &count);
    assert_int_equal(count, 3 * 1 + 3 * 5);
    assert_near(p[1], 0.2, 0);
    assert_near(p[3 + 5 + 1], 0.5, 0); // green: rho_d, rho_s
    double before[3], after[3];
    gonio_model_eval(m, gonio_direction(0.3, 0), gonio_direction(1, 0), before);
    p[1] += 0.1;
    gonio_model_eval(m, gonio_direction(0.3, 0), gonio_direction(1, 0), after);
    assert_near(after[1] - before[1], 0.1 / GONIO_PI, 1e-15);
    assert_near(after[0], before[0], 0);
    gonio_model_free(m);
}

// A saved model gives the same bits; a file with parameters out of bounds is refused.
static void saved_and_opened(void **state) {
    (void)state;
    char path[64];
    scratch_file(path, "", 0);
    for (size_t k = 0; k < SPECS; k++) {
        gonio_model *m = from(specs[k]), *again;
        assert_int_equal(gonio_model_save(m, path, NULL), GONIO_OK);
        assert_int_equal(gonio_model_open(path, &again, NULL), GONIO_OK);
        assert_int_equal(again->channels, m->channels);
        assert_int_equal(again->isotropic, m->isotropic);
        assert_string_equal(again->channel_names[0], m->channel_names[0]);
        for (int i = 0; i < 100; i++) {
            const gonio_pair p = {0.0157 * i, 0.3, 1.5 - 0.01 * i, 0.1 * i};
            double a[3], b[3];
            gonio_model_eval_pair(m, &p, a);
            gonio_model_eval_pair(again, &p, b);
            assert_memory_equal(a, b, (size_t)m->channels * sizeof *a);
        }
        gonio_model_free(again);
        size_t count;
        gonio_analytic_parameters(m, &count)[count - 1] = -1e9;
        gonio_error error = {0};
        assert_int_equal(gonio_model_save(m, path, NULL), GONIO_OK);
        assert_int_equal(gonio_model_open(path, &again, &error), GONIO_E_INPUT);
        assert_non_null(strstr(error.message, "outside its bounds"));
        gonio_model_free(m);
    }
    unlink(path);
}

static void refused(const char *spec, const char *expected) {
    gonio_model *m;
    gonio_error error = {0};
    assert_int_equal(gonio_model_from_spec(spec, &m, &error), GONIO_E_USAGE);
    assert_null(m);
    if (strstr(error.message, expected) == NULL) {
        fail_msg("%s: '%s' does not say '%s'", spec, error.message, expected);
    }
}

static void bad_specs(void **state) {
    (void)state;
    refused("", "expected one of lambert, phong");
    refused("fong:n=3", "unknown BRDF 'fong'; expected one of lambert, phong");
    refused("ward:rho_d=0.3,rho_s=0.2,alfa=0.15", "unknown key 'alfa'; expected one of rho_d, rho_s, alpha_x");
    refused("ward:rho_d=0.3,rho_s=0.2", "alpha_x is missing");
    refused("ward:rho_d=0.3,rho_s=0.2,alpha_x=0.1", "alpha_y is missing");
    refused("ward:rho_d=0.3,rho_s=0.2,alpha=0.1,alpha_x=0.1", "alpha_x is given twice");
    refused("ward:rho_d=0.3,rho_s=0.2,alpha=0", "alpha_x=0; expected 1e-05 to 10");
    refused("lambert:rho=1.5", "rho=1.5; expected 0 to 1");
    refused("lambert:rho=-0.1", "expected 0 to 1");
    refused("lambert:rho=nan", "expected a number");
    refused("lambert:rho=inf", "expected a number");
    refused("lambert:rho=0.5x", "expected a number");
    refused("lambert:rho=0.5/", "expected a number");
    refused("lambert:rho", "expected key=value");
    refused("lambert:rho=0.1/0.2+ggx:rho_s=0.1/0.2/0.3,alpha=0.1", "has 3 values, another key has 2");
    refused("lambert:rho=0.5,shape=cube", "expected flat or sphere");
    refused("lambert:rho=0.5,shape=sphere,radius_mm=-2", "expected a number above 0");
}

// Keys of the sample's body are cut off the end, the last one first; they stand nowhere else.
static void bodies(void **state) {
    (void)state;
    char text[] = "lambert:rho=1e-1,shape=sphere,radius_mm=15";
    const char *key;
    assert_string_equal(gonio_spec_take_body(text, &key), "15");
    assert_string_equal(key, "radius_mm");
    assert_string_equal(gonio_spec_take_body(text, &key), "sphere");
    assert_string_equal(key, "shape");
    assert_null(gonio_spec_take_body(text, &key));
    assert_string_equal(text, "lambert:rho=1e-1");
    gonio_model *m = from("lambert:rho=1e-1,shape=sphere,radius_mm=15,plate_mm=40");
    assert_near(at(m, 0, 0, 0, 0), 0.1 / GONIO_PI, 1e-16);
    gonio_model_free(m);
    // It was taken there, and the sample was flat all the same.
    refused("lambert:rho=0.1,shape=sphere+ggx:rho_s=0.1,alpha=0.1", "unknown key 'shape'");
    refused("file:", "the path is missing");
    refused("file:,shape=flat", "the path is missing");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(finite_reciprocal_mirrored_everywhere),
        cmocka_unit_test(isotropic_models_depend_on_the_difference_of_azimuths),
        cmocka_unit_test(albedos),
        cmocka_unit_test(closed_forms),
        cmocka_unit_test(further_closed_forms),
        cmocka_unit_test(slopes_are_derivatives),
        cmocka_unit_test(parameters_are_one_vector),
        cmocka_unit_test(saved_and_opened),
        cmocka_unit_test(bad_specs),
        cmocka_unit_test(bodies),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
