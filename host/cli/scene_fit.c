// SPDX-License-Identifier: BSD-3-Clause
#include "host/cli/scene_fit.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "host/cli/apart.h"

bool cli_scene_fit_check(cli_scene_fit *f, const cli_common *common) {
    const bool any = f->given[0] || f->given[1] || f->given[2] || f->given[3] || f->material != NULL;
    if (f->needs == NULL) {
        if (any) {
            cli_usage(common, "fit: --image-error, --psnr, --material, --least and --truth go with --scene NEEDS");
        }
        return !any;
    }
    if (f->given[0] == f->given[1]) {
        cli_usage(common, "fit --scene: --image-error E or --psnr DB is needed, one of them");
        return false;
    }
    if ((f->given[0] && !(f->how.image_error > 0 && f->how.image_error < 442)) ||
        (f->given[1] && !(f->how.psnr_db > 0 && f->how.psnr_db < 150))) {
        cli_usage(common, "fit --scene: a mean distance of 8-bit RGB lies above 0 and below 442, a PSNR above 0 and "
                          "below 150 dB");
        return false;
    }
    if (f->least != NULL && strcmp(f->least, "bytes") != 0 && strcmp(f->least, "ns") != 0) {
        cli_usage(common, "fit --scene: --least: expected bytes or ns, found '%s'", f->least);
        return false;
    }
    f->how.least_ns = f->least != NULL && f->least[0] == 'n';
    return true;
}

typedef struct progress {
    cli_progress line;
    int done;
} progress;

static bool on_progress(void *context, const char *what) {
    progress *p = context;
    if (what != NULL) {
        char detail[200];
        snprintf(detail, sizeof detail, "  %s", what);
        cli_progress_update(&p->line, ++p->done, detail, NAN);
    }
    return !cli_interrupted();
}

gonio_status cli_scene_fit_run(cli_scene_fit *f, const gonio_samples *samples, const gonio_fit_options *options,
                               const cli_common *common, gonio_model **model, gonio_fit_report *report,
                               gonio_error *error) {
    gonio_needs *needs;
    int material = 0;
    progress p = {.done = 0};
    *model = NULL;
    gonio_status status = gonio_needs_open(f->needs, &needs, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_needs_scene scene;
    gonio_needs_describe_scene(needs, &scene);
    status = cli_apart_input(common, scene.path, error);
    status = status == GONIO_OK ? gonio_needs_material(needs, f->material, &material, error) : status;
    f->how.progress = on_progress;
    f->how.progress_context = &p;
    cli_progress_start(&p.line, "scene", 0);
    status = status == GONIO_OK
                 ? gonio_fit_scene(samples, options, needs, material, &f->how, model, report, &f->report, error)
                 : status;
    cli_progress_end(&p.line);
    gonio_needs_free(needs);
    return status;
}

void cli_scene_fit_print(const cli_scene_fit *f) {
    const gonio_scene_fit_report *r = &f->report;
    printf("for %s: %d models compared at its pairs of directions, these in its pictures:\n", cli_text(f->needs),
           r->compared);
    printf("  %-52s %9s %7s %9s %9s %8s\n", "model", "bytes", "bricks", "promised", "MAE", "PSNR dB");
    for (int k = 0; k < r->steps; k++) {
        const gonio_scene_fit_step *s = &r->step[k];
        printf("%c %-52s %9zu %7zu %9.4g %9.4g %8.2f%s\n", s->chosen ? '>' : ' ', s->what, s->bytes, s->bricks,
               s->predicted, s->mae, s->psnr_db, s->met ? "  met" : "");
    }
    printf("image error %.4g codes of 255, PSNR %.2f dB", r->image.mae, r->image.psnr_db);
    if (f->how.turn_deg != 0) {
        printf("; cameras turned by %g deg: %.4g, %.2f dB", f->how.turn_deg, r->turned.mae, r->turned.psnr_db);
    }
    printf("\n");
    if (f->how.truth != NULL) {
        printf("the samples' fit at its best is off by %.4g from %s; %zu bytes\n", r->best.mae, cli_text(f->how.truth),
               r->best_bytes);
    }
    if (r->lattice_bytes > 0) {
        printf("a lattice of this level has %zu bytes, %zu of them where directions reach\n", r->lattice_bytes,
               r->reachable_bytes);
    }
}

static json_t *error_json(const gonio_picture_error *e) {
    return json_pack("{s:f,s:o,s:f,s:o}", "mae", e->mae, "psnr_db", cli_json_real(e->psnr_db), "largest", e->largest,
                     "snr_db", cli_json_real(e->snr_db));
}

json_t *cli_scene_fit_json(const cli_scene_fit *f) {
    const gonio_scene_fit_report *r = &f->report;
    json_t *steps = json_array();
    for (int k = 0; k < r->steps; k++) {
        const gonio_scene_fit_step *s = &r->step[k];
        json_array_append_new(steps,
                              json_pack("{s:s,s:I,s:I,s:o,s:o,s:f,s:o,s:b,s:b}", "model", s->what, "bytes",
                                        (json_int_t)s->bytes, "bricks", (json_int_t)s->bricks, "ns",
                                        cli_json_real(s->ns), "promised", cli_json_real(s->predicted), "mae", s->mae,
                                        "psnr_db", cli_json_real(s->psnr_db), "met", s->met, "chosen", s->chosen));
    }
    return json_pack("{s:s,s:i,s:o,s:o,s:o,s:o,s:o,s:I,s:I,s:I}", "needs", f->needs, "compared", r->compared, "steps",
                     steps, "image", error_json(&r->image), "turned",
                     f->how.turn_deg != 0 ? error_json(&r->turned) : json_null(), "best",
                     f->how.truth != NULL ? error_json(&r->best) : json_null(), "expected_mae",
                     cli_json_real(r->expected), "best_bytes", (json_int_t)r->best_bytes, "lattice_bytes",
                     (json_int_t)r->lattice_bytes, "reachable_bytes", (json_int_t)r->reachable_bytes);
}
