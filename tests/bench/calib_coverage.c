// SPDX-License-Identifier: BSD-3-Clause
// Is sigma true? Simulated sessions, each seed with its own reference scale, zero errors, lamp drift and flat field;
// few poses a seed, spread over theta bands and over lobe and base. A small camera of 56 x 56 pixels sees the same disc
// of 5 mm radius as the default one. usage: calib_coverage [SEEDS [SCENARIO [POSES]]] (default 200, all, 0)
//
// The angle, area and blur terms stand on the BRDF's slope and curvature: from the truth, or, with POSES, from what a
// scan gets them from: the default fit to a session of that many poses (nusselt:POSES, of another seed).
#include "gonio/fit.h"
#include "gonio/plan.h"
#include "tests/coverage.h"

typedef struct scenario {
    const char *name, *spec;
    double diffuse;
    bool drift;
    const char *settings[12];
} scenario;

#define WARD "ward:rho_d=0.3,rho_s=0.2,alpha=0.15"
#define SIDE 56
#define SMALL "camera.width=56", "camera.height=56", "camera.fx_px=4000"

static const scenario scenarios[] = {
    {"ward, default rig", WARD, 0.3 / GONIO_PI, false, {SMALL, NULL}},
    {"ward, no monitor, two hours, reference again at the end",
     WARD,
     0.3 / GONIO_PI,
     true,
     {SMALL, "meter.present=0", NULL}},
    {"ward, pointing 0.1 deg",
     WARD,
     0.3 / GONIO_PI,
     false,
     {SMALL, "axis light_theta.pointing_deg=0.1", "axis light_phi.pointing_deg=0.1",
      "axis camera_theta.pointing_deg=0.1", "axis camera_phi.pointing_deg=0.1", NULL}},
    {"ward, Bayer, dim: reference 0.02 %, pointing 0.001 deg",
     WARD,
     0.3 / GONIO_PI,
     false,
     {SMALL, "camera.pattern=rggb", "reference.sigma_percent=0.02", "axis light_theta.pointing_deg=0.001",
      "axis light_phi.pointing_deg=0.001", "axis camera_theta.pointing_deg=0.001", "axis camera_phi.pointing_deg=0.001",
      NULL}},
    {"ggx alpha=0.2, default rig", "ggx:rho_d=0.3,rho_s=0.2,alpha=0.2", 0.3 / GONIO_PI, false, {SMALL, NULL}},
    {"mirror-like ward, alpha=0.03", "ward:rho_d=0.3,rho_s=0.2,alpha=0.03", 0.3 / GONIO_PI, false, {SMALL, NULL}},
    {"ward, all at once: axes 0.5 deg off, drift 2 %/h, vignetting 3 %, 0.1 % defective pixels",
     WARD,
     0.3 / GONIO_PI,
     false,
     {SMALL, "axis light_theta.pointing_deg=0.5", "axis light_phi.pointing_deg=0.5",
      "axis camera_theta.pointing_deg=0.5", "axis camera_phi.pointing_deg=0.5", "lamp.drift_percent_per_hour=2",
      "camera.vignetting_percent=3", "camera.hot_pixel_percent=0.1", NULL}},
};

static int report(coverage *c) {
    int bad = 0;
    for (int lobe = 0; lobe < 2; lobe++) {
        for (int band = 0; band < COVERAGE_BANDS; band++) {
            coverage_cell *cell = &c->cell[lobe][band];
            if (cell->n == 0) {
                continue;
            }
            const double within = coverage_within(cell, 2), median = coverage_median(cell);
            const bool good = within >= 0.90 && within <= 0.99 && median >= 0.5 && median <= 0.85;
            bad += !good;
            printf(
                "  %s %2.0f..%2.0f deg  %6zu values  within 2 sigma %5.1f %%  |error|/sigma: median %.3f rms %.3f%s\n",
                lobe ? "lobe" : "base", coverage_edges_deg[band], coverage_edges_deg[band + 1], cell->n, 100 * within,
                median, coverage_rms(cell), good ? "" : "  <-- outside 90..99 %, 0.5..0.85");
        }
    }
    return bad;
}

// The model that a session of this scenario fits for its slopes.
static gonio_model *session_fit(const scenario *s, int poses) {
    sim_scan scan;
    gonio_samples *samples = NULL;
    gonio_plan *plan = NULL;
    gonio_model *model = NULL;
    gonio_fit_options options;
    gonio_fit_report report;
    char text[32];
    snprintf(text, sizeof text, "nusselt:%d", poses);
    bool ok = scan_open(&scan, s->spec, 100000, s->settings, SIDE) && scan_prepare(&scan) &&
              gonio_plan_make(text, 1, &plan, &scan.error) == GONIO_OK &&
              gonio_samples_new(gonio_calib_channels(scan.calib), true, &samples, &scan.error) == GONIO_OK;
    for (size_t i = 0; ok && i < plan->n; i++) {
        ok = scan_move(&scan, &plan->poses[i]) && scan_bracket(&scan, &plan->poses[i]);
        const gonio_status status =
            ok ? gonio_calib_pose(scan.calib, &plan->poses[i], scan.n, scan.exposures, samples, &scan.error) : GONIO_OK;
        ok = ok && (status == GONIO_OK || status == GONIO_E_RANGE);
    }
    gonio_fit_options_default(&options);
    options.hold_out = 0;
    if (ok) {
        samples->isotropic = true;
        scan_ok(&scan, gonio_fit(samples, &options, &model, &report, &scan.error), "fit");
    }
    gonio_samples_free(samples);
    gonio_plan_free(plan);
    scan_close(&scan);
    return model;
}

int main(int argc, char **argv) {
    const int seeds = argc > 1 ? atoi(argv[1]) : 200, only = argc > 2 ? atoi(argv[2]) : -1;
    const int poses = argc > 3 ? atoi(argv[3]) : 0;
    int bad = 0;
    for (size_t k = 0; k < sizeof scenarios / sizeof *scenarios; k++) {
        const scenario *s = &scenarios[k];
        coverage c = {0};
        if (only >= 0 && (size_t)only != k) {
            continue;
        }
        gonio_model *slopes = poses > 0 ? session_fit(s, poses) : NULL;
        if (poses > 0 && slopes == NULL) {
            return 1;
        }
        printf("%s, %d seeds, slopes of %s\n", s->name, seeds, slopes == NULL ? "the truth" : slopes->ops->kind);
        for (int seed = 1; seed <= seeds; seed++) {
            if (!coverage_plate(&c, s->spec, s->diffuse, (uint64_t)seed, 3, s->settings, SIDE, s->drift, slopes)) {
                return 1;
            }
        }
        bad += report(&c);
        fflush(stdout);
        coverage_free(&c);
        gonio_model_free(slopes);
    }
    printf("%d cells outside\n", bad);
    return 0;
}
