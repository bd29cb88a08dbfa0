// SPDX-License-Identifier: BSD-3-Clause
// A correction for what a sample averages is no larger than what the fitted model can vouch for.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "gonio/fit.h"
#include "gonio/plan.h"
#include "tests/sim_scan.h"

#define SIDE 56
#define POSES 80

// Nothing but photons and rounding stands between the samples and the truth; the disc is the default one of 5 mm.
static const char *const perfect[] = {"axis light_theta.pointing_deg=0",
                                      "axis light_phi.pointing_deg=0",
                                      "axis camera_theta.pointing_deg=0",
                                      "axis camera_phi.pointing_deg=0",
                                      "camera.width=56",
                                      "camera.height=56",
                                      "camera.fx_px=4000",
                                      "lamp.drift_percent_per_hour=0",
                                      "lamp.wander_percent=0",
                                      "stray.ambient_percent=0",
                                      "stray.glare_percent=0",
                                      "meter.noise_percent=0",
                                      "reference.sigma_percent=0",
                                      NULL};

static gonio_samples *measure(sim_scan *scan) {
    gonio_plan *plan;
    gonio_samples *samples;
    assert_true(scan_open(scan, "ward:rho_d=0.3,rho_s=0.2,alpha=0.15", 1, perfect, SIDE) && scan_prepare(scan));
    assert_int_equal(gonio_plan_make("nusselt:80", 1, &plan, NULL), GONIO_OK);
    assert_int_equal(gonio_samples_new(1, true, &samples, NULL), GONIO_OK);
    samples->isotropic = true;
    for (size_t i = 0; i < plan->n; i++) {
        assert_true(scan_pose(scan, &plan->poses[i], samples));
    }
    assert_int_equal(samples->n, POSES);
    gonio_plan_free(plan);
    return samples;
}

static gonio_samples *corrected(const sim_scan *scan, const gonio_samples *samples, const gonio_model *model) {
    gonio_samples *out;
    bool keep[POSES];
    memset(keep, true, sizeof keep);
    assert_int_equal(gonio_samples_select(samples, keep, &out, NULL), GONIO_OK);
    assert_int_equal(gonio_calib_pointing(&scan->rig.facts, model, out, NULL), GONIO_OK);
    return out;
}

// 80 samples leave a fit free to bend. Near the pole, where all azimuths meet, its curvature over a disc of 0.3 deg was
// worth up to 2.6 %, of samples that are right to 0.05 %; the BRDF itself asks for 0.09 % at most. No sample comes to
// lie further than 2.5 times its stated sigma from where the truth's own curvature takes it (2.24 is the most), and
// so it stays within 4 of the truth (of 320 normal draws 1 in 49 tests, but the seed is fixed: this pins down that
// sigma carries the bias and not the chance).
static void test_few_samples_stay_as_measured(void **state) {
    (void)state;
    static const char *const methods[] = {"mba", "cbmba", "lsq", "auto"};
    sim_scan scan;
    gonio_samples *samples = measure(&scan), *best = corrected(&scan, samples, gonio_sim_truth(scan.sim));
    for (int m = 0; m < 4; m++) {
        gonio_fit_options options;
        gonio_fit_report report;
        gonio_model *model;
        gonio_fit_options_default(&options);
        options.method = methods[m];
        options.hold_out = 0;
        assert_int_equal(gonio_fit(samples, &options, &model, &report, NULL), GONIO_OK);
        gonio_samples *after = corrected(&scan, samples, model);
        for (size_t i = 0; i < POSES; i++) {
            const double sigma = gonio_samples_sigma(after, i, 0), apart = after->values[i] - best->values[i];
            double truth;
            gonio_model_eval_pair(gonio_sim_truth(scan.sim), &samples->pairs[i], &truth);
            if (!(fabs(apart) <= 2.5 * sigma && fabs(after->values[i] - truth) <= 4 * sigma)) {
                fail_msg("%s, theta_i %.2f deg: %.3f %% apart, off by %.3f %%, sigma %.3f %%", methods[m],
                         gonio_degrees(samples->pairs[i].theta_i), 100 * apart / truth,
                         100 * (after->values[i] / truth - 1), 100 * sigma / truth);
            }
        }
        gonio_samples_free(after);
        gonio_model_free(model);
    }
    gonio_samples_free(best);
    gonio_samples_free(samples);
    scan_close(&scan);
}

// What the model does know is taken out still: with the slopes of the truth, which is reciprocal, every factor is the
// disc's own to a tenth, and sigma grows by less than a tenth of it.
static void test_what_is_known_is_corrected(void **state) {
    (void)state;
    sim_scan scan;
    gonio_samples *samples = measure(&scan);
    gonio_samples *after = corrected(&scan, samples, gonio_sim_truth(scan.sim));
    int seen = 0;
    for (size_t i = 0; i < POSES; i++) {
        const double moved = after->values[i] / samples->values[i] - 1;
        seen += fabs(moved) > 2e-4;
        assert_true(fabs(moved) < 1e-3);
        assert_true(gonio_samples_sigma(after, i, 0) < 2e-3 * samples->values[i]);
    }
    assert_true(seen >= 3);
    gonio_samples_free(after);
    gonio_samples_free(samples);
    scan_close(&scan);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_few_samples_stay_as_measured),
        cmocka_unit_test(test_what_is_known_is_corrected),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
