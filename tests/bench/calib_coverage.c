// Is sigma true? Simulated sessions, each seed with its own reference scale, zero errors, lamp drift and flat field;
// few poses a seed, spread over theta bands and over lobe and base. usage: calib_coverage [SEEDS [SCENARIO]]
// (default 100, all)
#include "tests/coverage.h"

typedef struct scenario {
    const char *name, *spec;
    double diffuse;
    bool drift;
    const char *settings[8];
} scenario;

#define WARD "ward:rho_d=0.3,rho_s=0.2,alpha=0.15"

static const scenario scenarios[] = {
    {"ward, default rig", WARD, 0.3 / GONIO_PI, false, {NULL}},
    {"ward, no monitor, two hours, reference again at the end", WARD, 0.3 / GONIO_PI, true, {"meter.present=0", NULL}},
    {"ward, pointing 0.1 deg",
     WARD,
     0.3 / GONIO_PI,
     false,
     {"axis light_theta.pointing_deg=0.1", "axis light_phi.pointing_deg=0.1", "axis camera_theta.pointing_deg=0.1",
      "axis camera_phi.pointing_deg=0.1", NULL}},
    {"ward, Bayer, dim: reference 0.02 %, pointing 0.001 deg",
     WARD,
     0.3 / GONIO_PI,
     false,
     {"camera.pattern=rggb", "reference.sigma_percent=0.02", "axis light_theta.pointing_deg=0.001",
      "axis light_phi.pointing_deg=0.001", "axis camera_theta.pointing_deg=0.001", "axis camera_phi.pointing_deg=0.001",
      NULL}},
    {"ggx alpha=0.2, default rig", "ggx:rho_d=0.3,rho_s=0.2,alpha=0.2", 0.3 / GONIO_PI, false, {NULL}},
    {"mirror-like ward, alpha=0.03", "ward:rho_d=0.3,rho_s=0.2,alpha=0.03", 0.3 / GONIO_PI, false, {NULL}},
    {"ward, all at once: axes 0.5 deg off, drift 2 %/h, vignetting 3 %, 0.1 % defective pixels",
     WARD,
     0.3 / GONIO_PI,
     false,
     {"axis light_theta.pointing_deg=0.5", "axis light_phi.pointing_deg=0.5", "axis camera_theta.pointing_deg=0.5",
      "axis camera_phi.pointing_deg=0.5", "lamp.drift_percent_per_hour=2", "camera.vignetting_percent=3",
      "camera.hot_pixel_percent=0.1", NULL}},
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
            printf("  %s %2.0f..%2.0f deg  %6zu values  within 2 sigma %5.1f %%  median |error|/sigma %.3f%s\n",
                   lobe ? "lobe" : "base", coverage_edges_deg[band], coverage_edges_deg[band + 1], cell->n,
                   100 * within, median, good ? "" : "  <-- outside 90..99 %, 0.5..0.85");
        }
    }
    return bad;
}

int main(int argc, char **argv) {
    const int seeds = argc > 1 ? atoi(argv[1]) : 100, only = argc > 2 ? atoi(argv[2]) : -1;
    int bad = 0;
    for (size_t k = 0; k < sizeof scenarios / sizeof *scenarios; k++) {
        const scenario *s = &scenarios[k];
        coverage c = {0};
        if (only >= 0 && (size_t)only != k) {
            continue;
        }
        printf("%s, %d seeds\n", s->name, seeds);
        for (int seed = 1; seed <= seeds; seed++) {
            if (!coverage_plate(&c, s->spec, s->diffuse, (uint64_t)seed, 3, s->settings, 0, s->drift)) {
                return 1;
            }
        }
        bad += report(&c);
        fflush(stdout);
        coverage_free(&c);
    }
    printf("%d cells outside\n", bad);
    return 0;
}
