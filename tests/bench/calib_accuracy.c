// SPDX-License-Identifier: BSD-3-Clause
// Accuracy of the samples of a simulated flat plate against the truth, default rig, nusselt:1400, one session: median
// and 95th percentile of the relative error for theta <= 75 deg, and apart where the specular term exceeds 10 % of the
// diffuse one. Then what the uncertainty consists of, and what calibration found of the camera.
#include "base/clock.h"
#include "tests/sim_scan.h"

#include "gonio/fit.h"
#include "gonio/plan.h"

#define SPEC "ward:rho_d=0.3,rho_s=0.2,alpha=0.15"
#define DIFFUSE (0.3 / GONIO_PI)

static int by_value(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void print_errors(const char *label, double *errors, size_t n) {
    qsort(errors, n, sizeof *errors, by_value);
    if (n > 0) {
        printf("%-44s %6zu samples  median %.3f %%  95th percentile %.3f %%\n", label, n, 100 * errors[n / 2],
               100 * errors[(size_t)(0.95 * (double)n)]);
    }
}

static void compare(const gonio_samples *samples, const gonio_model *truth) {
    double *errors = malloc(samples->n * sizeof *errors), *lobe = malloc(samples->n * sizeof *lobe);
    double *pull = malloc(samples->n * sizeof *pull);
    const double limit = gonio_radians(75);
    size_t n = 0, in_lobe = 0, within = 0;
    for (size_t i = 0; i < samples->n; i++) {
        const gonio_pair *p = &samples->pairs[i];
        double f;
        gonio_model_eval_pair(truth, p, &f);
        if (p->theta_i > limit || p->theta_o > limit) {
            continue;
        }
        const double error = fabs(samples->values[i] - f), sigma = gonio_samples_sigma(samples, i, 0);
        errors[n] = error / f;
        pull[n++] = error / sigma;
        within += error <= 2 * sigma;
        if (f - DIFFUSE > 0.1 * DIFFUSE) {
            lobe[in_lobe++] = error / f;
        }
    }
    qsort(pull, n, sizeof *pull, by_value);
    printf("this session: %.1f %% within 2 sigma, median |error|/sigma %.2f\n", 100 * (double)within / (double)n,
           pull[n / 2]);
    print_errors("theta <= 75 deg", errors, n);
    print_errors("  where specular > 10 % of diffuse", lobe, in_lobe);
    free(errors);
    free(lobe);
    free(pull);
}

int main(void) {
    sim_scan scan;
    gonio_plan *plan = NULL;
    gonio_samples *samples = NULL;
    gonio_model *model = NULL;
    gonio_fit_options options;
    gonio_fit_report fit;
    gonio_calib_report found;
    gonio_error error = {0};
    if (!scan_open(&scan, SPEC, 1, NULL, 0) || !scan_prepare(&scan) ||
        gonio_plan_make("nusselt:1400", 1, &plan, &error) != GONIO_OK ||
        gonio_samples_new(1, true, &samples, &error) != GONIO_OK) {
        return 1;
    }
    gonio_calib_describe(scan.calib, &found);
    printf("gain %.4f e-/DN (10000/%d = %.4f)  read noise %.3f e-  dark %.3f e-/s  saturation %.0f%s  hot %d noisy %d "
           "dead %d  flat %.3f %%\n",
           found.gain_e_per_dn, 4095 - 64, 10000.0 / (4095 - 64), found.read_noise_e, found.dark_e_per_s,
           found.saturation_dn, found.saturation_measured ? " (measured)" : "", found.hot, found.noisy, found.dead,
           100 * found.flat_relative_sigma);
    int frames = 0;
    double calib_s = 0;
    const double start = gonio_clock_s();
    for (size_t i = 0; i < plan->n; i++) {
        if (!scan_move(&scan, &plan->poses[i]) || !scan_bracket(&scan, &plan->poses[i])) {
            return 1;
        }
        const double before = gonio_clock_s();
        const gonio_status status =
            gonio_calib_pose(scan.calib, &plan->poses[i], scan.n, scan.exposures, samples, &scan.error);
        calib_s += gonio_clock_s() - before;
        frames += scan.n;
        if (status != GONIO_OK && status != GONIO_E_RANGE) {
            return 1;
        }
    }
    printf("%zu poses, %d frames, %zu samples in %.1f s; calibration %.2f ms a frame\n", plan->n, frames, samples->n,
           gonio_clock_s() - start, 1e3 * calib_s / frames);
    gonio_fit_options_default(&options);
    if (gonio_fit(samples, &options, &model, &fit, &error) != GONIO_OK ||
        gonio_calib_pointing(&scan.rig.facts, model, samples, &error) != GONIO_OK) {
        fprintf(stderr, "%s\n", error.message);
        return 1;
    }
    compare(samples, gonio_sim_truth(scan.sim));
    gonio_model_free(model);
    gonio_samples_free(samples);
    gonio_plan_free(plan);
    scan_close(&scan);
    return 0;
}
