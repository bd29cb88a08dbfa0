// SPDX-License-Identifier: BSD-3-Clause
// What an adaptive plan is worth beside a fixed one, and beside the rig's time.
//
// Five materials; samples of the truth with the default rig's noise (tests/adaptive_run.h: no frames are rendered, so
// that plans of thousands of poses can be compared), seen by a camera without colours. Each row: the errors at 20,000
// directions that nobody measured, uniform over the projections of both, of the default fit of so many poses; the rig's
// minutes; the processor's seconds that choosing took, as a share of the rig's.
//
// bench_adaptive [POSES (350)] [SEEDS (1)] [MATERIAL (all)] [FIXED (1400)] [OPTIONS]: a larger nusselt plan beside;
// more of the adaptive one (,share=0.3)
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "gonio/gonio.h"
#include "tests/adaptive_run.h"

#define DIRECTIONS 20000

static const struct material {
    const char *name, *spec;
    bool anisotropic;
} materials[] = {
    {"Ward .15", "ward:rho_d=0.3,rho_s=0.2,alpha=0.15", false},
    {"GGX .05", "ggx:rho_d=0.2,rho_s=1,alpha=0.05,f0=0.04", false},
    {"brushed", "ward:rho_d=0.1,rho_s=0.3,alpha_x=0.08,alpha_y=0.3", true},
    {"RGL silk", "file:%s/rgl/vch_silk_blue_rgb.bsdf", false},
    {"RGL green", "file:%s/rgl/cm_military_green_rgb.bsdf", false},
};
#define MATERIALS ((int)(sizeof materials / sizeof *materials))

static gonio_error error;

static void must(gonio_status status) {
    if (status != GONIO_OK) {
        fprintf(stderr, "%s: %s\n", gonio_status_text(status), error.message);
        exit(1);
    }
}

static double processor_s(void) { return (double)clock() / CLOCKS_PER_SEC; }

static gonio_samples *held_out(const gonio_model *truth, bool anisotropic) {
    gonio_plan *plan;
    gonio_samples *samples;
    char text[64];
    snprintf(text, sizeof text, "nusselt:%d,anisotropic=%d", DIRECTIONS, anisotropic);
    must(gonio_plan_make(text, 987654321, &plan, &error));
    must(gonio_samples_of_model(truth, plan->poses, plan->n, 1, &samples, &error));
    samples->isotropic = !anisotropic;
    gonio_plan_free(plan);
    return samples->channels > 1 ? simulate_channel_mean(samples) : samples;
}

static char chosen[128];              // what the last fit chose
static const char *more_options = ""; // of the adaptive plan

static gonio_errors fit_and_compare(const gonio_samples *samples, const gonio_samples *all, double *seconds) {
    gonio_fit_options options;
    gonio_errors e;
    gonio_model *model;
    gonio_fit_options_default(&options);
    options.hold_out = 0;
    options.threads = 1;
    const double started = processor_s();
    gonio_fit_report report;
    must(gonio_fit(samples, &options, &model, &report, &error));
    snprintf(chosen, sizeof chosen, "%s %s %.90s", gonio_coordinates_name(report.coordinates),
             gonio_domain_name(report.domain), report.options);
    *seconds = processor_s() - started;
    must(gonio_errors_model(model, all, NULL, 1, &e, &error));
    gonio_model_free(model);
    return e;
}

static void print_row(const char *plan, size_t n, const adaptive_run *run, gonio_errors e, double fit_s,
                      double choosing_s) {
    printf(
        "  %-9s %5zu poses %6.1f min  median_rel %7.3f %%  rms_log %.4f  fit %.1f s  choosing %.1f s = %.1f %%  %s\n",
        plan, n, run->rig_s / 60, 100 * e.median_rel, e.rms_log, fit_s, choosing_s, 100 * choosing_s / run->rig_s,
        chosen);
    fflush(stdout);
}

// nusselt:N as it is measured: in one tour.
static void fixed(const struct material *m, const gonio_model *truth, const gonio_samples *all, size_t n,
                  uint64_t seed) {
    adaptive_run run;
    char text[64];
    double fit_s;
    snprintf(text, sizeof text, "adaptive:%zu,first=%zu,anisotropic=%d", n, n < 5000 ? n : 5000, m->anisotropic);
    run_begin(&run, truth, text, seed);
    run.channels = 1;
    gonio_plan *plan;
    snprintf(text, sizeof text, "nusselt:%zu,anisotropic=%d", n, m->anisotropic);
    must(gonio_plan_make(text, seed, &plan, &error));
    run.a.poses = calloc(n, sizeof *run.a.poses);
    for (run.a.n = 0; run.a.n < n; run.a.n++) {
        run.a.poses[run.a.n] = (gonio_adaptive_pose){.pose = plan->poses[run.a.n], .sample = -1};
    }
    run.time.rig = &run.rig;
    run_measure(&run, 0);
    const gonio_errors e = fit_and_compare(run.a.samples, all, &fit_s);
    print_row("nusselt", n, &run, e, fit_s, 0);
    gonio_plan_free(plan);
    run_end(&run);
}

static void adaptive(const struct material *m, const gonio_model *truth, const gonio_samples *all, size_t n,
                     uint64_t seed) {
    adaptive_run run;
    char text[64];
    double choosing_s = 0, fit_s;
    snprintf(text, sizeof text, "adaptive:%zu,anisotropic=%d%s", n, m->anisotropic, more_options);
    run_begin(&run, truth, text, seed);
    run.channels = 1;
    size_t shown = n / 4;
    while (run.a.n < n) {
        const double started = processor_s();
        if (run_batch(&run) == 0) {
            break;
        }
        choosing_s += processor_s() - started;
        if (run.a.n >= shown || run.a.n == n) {
            const gonio_errors e = fit_and_compare(run.a.samples, all, &fit_s);
            print_row("adaptive", run.a.n, &run, e, fit_s, choosing_s);
            shown = 2 * run.a.n;
        }
    }
    run_end(&run);
}

int main(int argc, char **argv) {
    const size_t poses = argc > 1 ? strtoul(argv[1], NULL, 10) : 350;
    const int seeds = argc > 2 ? atoi(argv[2]) : 1, only = argc > 3 ? atoi(argv[3]) : -1;
    const size_t most = argc > 4 ? strtoul(argv[4], NULL, 10) : 1400;
    more_options = argc > 5 ? argv[5] : "";
    for (int k = 0; k < MATERIALS; k++) {
        gonio_model *truth;
        if (only >= 0 && only != k) {
            continue;
        }
        char spec[512];
        const char *data = getenv("GONIO_DATA"), *place = strstr(materials[k].spec, "%s");
        snprintf(spec, sizeof spec, "%.*s%s%s", place != NULL ? (int)(place - materials[k].spec) : 512,
                 materials[k].spec,
                 place == NULL  ? ""
                 : data != NULL ? data
                                : "../shared/data",
                 place != NULL ? place + 2 : "");
        if (gonio_model_from_spec(spec, &truth, &error) != GONIO_OK) {
            printf("%s: SKIP (%s)\n", materials[k].name, error.message);
            continue;
        }
        gonio_samples *all = held_out(truth, materials[k].anisotropic);
        for (int s = 1; s <= seeds; s++) {
            printf("%s, seed %d\n", materials[k].name, s);
            adaptive(&materials[k], truth, all, poses, (uint64_t)s);
            fixed(&materials[k], truth, all, poses, (uint64_t)s);
            if (most > poses) {
                fixed(&materials[k], truth, all, most, (uint64_t)s);
            }
        }
        gonio_samples_free(all);
        gonio_model_free(truth);
    }
    return 0;
}
