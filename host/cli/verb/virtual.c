// SPDX-License-Identifier: BSD-3-Clause
// gonio virtual: the BRDF of a patch of microgeometry, by rays.
#include <math.h>
#include <stdio.h>

#include "gonio/io.h"
#include "gonio/needs.h"
#include "gonio/patch.h"
#include "host/cli/cli.h"

static int run(int argc, char **argv);
const cli_verb cmd_virtual = {"virtual", "PATCH -o CSV [options]",
                              "a virtual gonioreflectometer: the BRDF that microgeometry has from afar", run};

typedef struct request {
    const char *patch, *output, *plan;
    gonio_virtual_options options;
} request;

static bool on_progress(void *context, double fraction, double rays_per_s) {
    char detail[48];
    snprintf(detail, sizeof detail, "  %.3g Mray/s", rays_per_s / 1e6);
    cli_progress_update(context, fraction, detail, NAN);
    return !cli_interrupted();
}

static gonio_status measure(request *r, gonio_patch_facts *facts, gonio_virtual_report *report, size_t *poses,
                            gonio_error *error) {
    gonio_patch *patch = NULL;
    gonio_plan *plan = NULL;
    gonio_samples *samples = NULL;
    cli_progress progress;
    gonio_status status = gonio_patch_open(r->patch, &patch, error);
    status = status == GONIO_OK ? gonio_plan_resolve(r->plan, r->options.seed, NULL, NULL, &plan, NULL, error) : status;
    if (status == GONIO_OK) {
        gonio_patch_describe(patch, facts);
        *poses = plan->n;
        cli_progress_start(&progress, "virtual", 1);
        r->options.progress = on_progress;
        r->options.progress_context = &progress;
        status = gonio_virtual_measure(patch, plan, &r->options, &samples, report, error);
        cli_progress_end(&progress);
    }
    status = status == GONIO_OK ? gonio_write_samples(samples, r->output, error) : status;
    gonio_samples_free(samples);
    gonio_plan_free(plan);
    gonio_patch_free(patch);
    return status;
}

static int report_json(const request *r, const gonio_patch_facts *f, const gonio_virtual_report *v, size_t poses) {
    return cli_json(json_pack("{s:s,s:I,s:i,s:i,s:s,s:I,s:s,s:b,s:I,s:I,s:I,s:f,s:I,s:f}", "patch", r->patch,
                              "triangles", (json_int_t)f->triangles, "materials", f->materials, "channels", f->channels,
                              "plan", r->plan, "poses", (json_int_t)poses, "output", r->output, "interreflection",
                              r->options.interreflection, "camera_rays", (json_int_t)v->camera_rays, "shadow_rays",
                              (json_int_t)v->shadow_rays, "bounces", (json_int_t)v->bounces, "error", v->error,
                              "missed", (json_int_t)v->missed, "seconds", v->seconds));
}

static int tell(const request *r, const gonio_patch_facts *f, const gonio_virtual_report *v, size_t poses) {
    printf("%s: %zu triangles, %d material%s, tile %g x %g, heights %g to %g\n", cli_text(r->patch), f->triangles,
           f->materials, f->materials == 1 ? "" : "s", f->width, f->height, f->low, f->high);
    printf("%s: %zu poses, standard error %.3g %% (rms), %zu poses above %.3g %%\n", cli_text(r->output), poses,
           100 * v->error, v->missed, 100 * r->options.target);
    printf("%.3g camera rays, %.3g shadow rays, %.3g bounces in %.2f s\n", (double)v->camera_rays,
           (double)v->shadow_rays, (double)v->bounces, v->seconds);
    return 0;
}

static int run(int argc, char **argv) {
    request r = {.plan = "uniform:10,anisotropic=1"};
    cli_common common;
    double percent = 1;
    int count;
    gonio_virtual_options_default(&r.options);
    const cli_option options[] = {
        {"output", 'o', CLI_OUTPUT, &r.output, NULL, "CSV", "where the samples go"},
        {"plan", 'p', CLI_TEXT, &r.plan, NULL, "PLAN", "poses, as measure has them (uniform:10,anisotropic=1)"},
        {"interreflection", 0, CLI_FLAG, &r.options.interreflection, NULL, NULL,
         "light that meets the patch more than once"},
        {"error", 0, CLI_DOUBLE, &percent, NULL, "PERCENT", "standard error that every pose is brought to (1)"},
        {"rays", 0, CLI_SIZE, &r.options.rays, NULL, "N", "camera rays for each direction at least (256)"},
        {"max-rays", 0, CLI_SIZE, &r.options.rays_max, NULL, "N", "... and at most (64k)"},
        {"light", 0, CLI_DOUBLE, &r.options.light_half_deg, NULL, "DEG",
         "half angle of the lamp seen from the patch (0)"},
        {"aperture", 0, CLI_DOUBLE, &r.options.camera_half_deg, NULL, "DEG", "half angle of the camera's aperture (0)"},
        {0}};
    if (!cli_parse(&cmd_virtual, options, argc, argv, &r.patch, 1, 1, &count, &common)) {
        return 2;
    }
    if (r.output == NULL) {
        return cli_usage(&common, "virtual: -o CSV is missing");
    }
    r.options.seed = common.seed;
    r.options.threads = common.threads;
    r.options.target = percent / 100;
    cli_catch_interrupts();
    gonio_error error = {.line = -1, .byte = -1};
    gonio_patch_facts facts;
    gonio_virtual_report report;
    size_t poses = 0;
    if (measure(&r, &facts, &report, &poses, &error) != GONIO_OK) {
        return cli_fail(&common, &error);
    }
    return common.json ? report_json(&r, &facts, &report, poses) : tell(&r, &facts, &report, poses);
}
