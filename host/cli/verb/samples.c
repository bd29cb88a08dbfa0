// SPDX-License-Identifier: BSD-3-Clause
// gonio samples: a session's scattered samples, and the uncertainty budget of one direction.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gonio/io.h"
#include "host/acquire/acquire.h"
#include "host/cli/input.h"

static int run(int argc, char **argv);
const cli_verb cmd_samples = {"samples", "SESSION [-o CSV] [--budget TI,PI,TO,PO]",
                              "write a session's samples, or the uncertainty budget of one direction", run};

typedef struct request {
    const cli_common *common;
    const char *path, *output, *budget;
    bool edges;
} request;

// ---- the sample's edges ----

static gonio_status find_edges(gonio_session *session, gonio_setup *setup, gonio_step **steps, size_t *n,
                               gonio_edges_report *report, gonio_error *error) {
    gonio_status status = gonio_setup_get(session, setup, error);
    status = status == GONIO_OK ? gonio_session_steps(session, steps, n, error) : status;
    if (status == GONIO_OK) {
        gonio_scan_edges(setup, *steps, *n, report);
    }
    return status;
}

static int list_edges(const request *r, gonio_session *session) {
    static const struct {
        int flag;
        const char *name;
    } kinds[] = {{GONIO_EDGE_REGION, "region"}, {GONIO_EDGE_UNLIT, "unlit"}, {GONIO_EDGE_SPILL, "spill"}};
    gonio_error error = {.line = -1, .byte = -1};
    gonio_setup setup;
    gonio_step *steps = NULL;
    size_t n = 0;
    gonio_edges_report report;
    if (find_edges(session, &setup, &steps, &n, &report, &error) != GONIO_OK) {
        free(steps);
        return cli_fail(r->common, &error);
    }
    json_t *list = json_array();
    if (!r->common->json) {
        puts("step,theta_i,phi_i,theta_o,phi_o,edge");
    }
    for (size_t i = 0; i < n; i++) {
        char text[256];
        const gonio_pair *p = &steps[i].pose;
        const int flags =
            steps[i].kind == GONIO_STEP_SAMPLE ? gonio_calib_edges(&setup.camera, &setup.facts, p, text) : 0;
        for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++) {
            if ((flags & kinds[k].flag) != 0 && r->common->json) {
                json_array_append_new(list, json_pack("{s:I,s:s}", "step", (json_int_t)i, "edge", kinds[k].name));
            } else if ((flags & kinds[k].flag) != 0) {
                printf("%zu,%.10g,%.10g,%.10g,%.10g,%s\n", i, gonio_degrees(p->theta_i), gonio_degrees(p->phi_i),
                       gonio_degrees(p->theta_o), gonio_degrees(p->phi_o), kinds[k].name);
            }
        }
    }
    free(steps);
    if (r->common->json) {
        return cli_json(json_pack("{s:s,s:I,s:I,s:o}", "session", r->path, "excluded", (json_int_t)report.excluded,
                                  "flagged", (json_int_t)report.spilled, "edges", list));
    }
    json_decref(list);
    return 0;
}

static void mention_edges(gonio_session *session) {
    gonio_setup setup;
    gonio_step *steps = NULL;
    size_t n = 0;
    gonio_edges_report report;
    if (find_edges(session, &setup, &steps, &n, &report, NULL) == GONIO_OK && report.excluded + report.spilled > 0) {
        fprintf(stderr, "%zu poses gave no sample and %zu are flagged: they reach over the sample's edge (--edges)\n",
                report.excluded, report.spilled);
    }
    free(steps);
}

static size_t flagged_steps(gonio_session *session) {
    gonio_step *steps;
    size_t n, flagged = 0;
    if (gonio_session_steps(session, &steps, &n, NULL) != GONIO_OK) {
        return 0;
    }
    for (size_t i = 0; i < n; i++) {
        flagged += steps[i].flagged && steps[i].kind == GONIO_STEP_SAMPLE;
    }
    free(steps);
    return flagged;
}

static int write_samples(const request *r, gonio_session *session) {
    gonio_error error = {.line = -1, .byte = -1};
    gonio_samples *samples = NULL;
    bool final = false;
    char hash[GONIO_SHA256_HEX] = "";
    gonio_status status = gonio_session_final_samples(session, &samples, &final, &error);
    if (status == GONIO_OK && r->output != NULL) {
        status = gonio_write_samples(samples, r->output, &error);
    } else if (status == GONIO_OK && !r->common->json) {
        status = gonio_write_samples_stream(samples, stdout, &error);
    }
    status = status == GONIO_OK && r->common->json ? gonio_sha256_samples(samples, hash, &error) : status;
    if (status != GONIO_OK) {
        gonio_samples_free(samples);
        return cli_fail(r->common, &error);
    }
    mention_edges(session);
    if (!final) {
        fprintf(stderr, "the session is not finished: these samples lack the pointing term and any drift correction\n");
    }
    const size_t flagged = flagged_steps(session);
    if (flagged > 0) {
        fprintf(stderr, "samples of %zu poses are flagged: no audit of the stage has vouched for them yet\n", flagged);
    }
    if (r->common->json) {
        cli_json(json_pack("{s:s,s:I,s:i,s:b,s:s,s:I,s:s?}", "session", r->path, "samples", (json_int_t)samples->n,
                           "channels", samples->channels, "final", final, "samples_sha256", hash, "flagged",
                           (json_int_t)flagged, "output", r->output));
    } else if (r->output != NULL) {
        printf("%s: %zu samples\n", r->output, samples->n);
    }
    gonio_samples_free(samples);
    return 0;
}

// A whole session in one file, of which the samples alone are read.
static int write_file(const request *r) {
    if (r->budget != NULL || r->edges) {
        return cli_usage(r->common, "samples: %s: `gonio convert` makes a session of %s first",
                         r->edges ? "edges" : "budget", r->path);
    }
    gonio_error error = {.line = -1, .byte = -1};
    gonio_samples *samples = NULL;
    char hash[GONIO_SHA256_HEX] = "";
    const cli_input nothing = {0};
    gonio_status status = cli_input_read(r->path, &nothing, r->common, &samples, &error);
    if (status == GONIO_OK && r->output != NULL) {
        status = gonio_write_samples(samples, r->output, &error);
    } else if (status == GONIO_OK && !r->common->json) {
        status = gonio_write_samples_stream(samples, stdout, &error);
    }
    status = status == GONIO_OK ? gonio_sha256_samples(samples, hash, &error) : status;
    if (status != GONIO_OK) {
        gonio_samples_free(samples);
        return cli_fail(r->common, &error);
    }
    if (r->common->json) {
        cli_json(json_pack("{s:o,s:I,s:i,s:s,s:o}", "session", cli_json_text(r->path), "samples",
                           (json_int_t)samples->n, "channels", samples->channels, "samples_sha256", hash, "output",
                           r->output != NULL ? cli_json_text(r->output) : json_null()));
    } else if (r->output != NULL) {
        printf("%s: %zu samples\n", cli_text(r->output), samples->n);
    }
    gonio_samples_free(samples);
    return 0;
}

// ---- the budget ----

static bool parse_pair(const char *text, gonio_pair *pair) {
    double deg[4];
    int used = 0;
    if (sscanf(text, "%lf,%lf,%lf,%lf%n", &deg[0], &deg[1], &deg[2], &deg[3], &used) != 4 || text[used] != 0) {
        return false;
    }
    for (int k = 0; k < 4; k++) {
        if (!isfinite(deg[k]) || (k % 2 == 0 && !(deg[k] >= 0 && deg[k] <= 180))) {
            return false;
        }
    }
    *pair = (gonio_pair){gonio_radians(deg[0]), gonio_radians(deg[1]), gonio_radians(deg[2]), gonio_radians(deg[3])};
    return true;
}

static double angle_between(const gonio_pair *a, const gonio_pair *b) {
    const gonio_vec3 ai = gonio_direction(a->theta_i, a->phi_i), bi = gonio_direction(b->theta_i, b->phi_i);
    const gonio_vec3 ao = gonio_direction(a->theta_o, a->phi_o), bo = gonio_direction(b->theta_o, b->phi_o);
    const double i = hypot(hypot(ai.x - bi.x, ai.y - bi.y), ai.z - bi.z);
    const double o = hypot(hypot(ao.x - bo.x, ao.y - bo.y), ao.z - bo.z);
    return i + o;
}

// The done sample step whose pose, or for a sphere whose nearest sample, lies nearest to the direction.
static gonio_status find_step(gonio_session *session, const gonio_process *process, const gonio_pair *pair,
                              const gonio_step **found, gonio_error *error) {
    double best = INFINITY;
    *found = NULL;
    for (size_t i = 0; i < process->n; i++) {
        const gonio_step *step = &process->steps[i];
        if (step->kind != GONIO_STEP_SAMPLE || !step->done) {
            continue;
        }
        gonio_samples *samples = NULL;
        const gonio_status status = gonio_session_step_samples(session, step->index, &samples, error);
        if (status != GONIO_OK) {
            return status;
        }
        for (size_t k = 0; samples != NULL && k < samples->n; k++) {
            const double distance = angle_between(pair, &samples->pairs[k]);
            if (distance < best) {
                best = distance;
                *found = step;
            }
        }
        gonio_samples_free(samples);
    }
    return *found != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_INPUT, "the session holds no samples yet");
}

// The session's own model where it is still the journalled one; else the same fit again.
static gonio_status find_model(gonio_session *session, const gonio_process *process, gonio_model **model,
                               gonio_error *error) {
    char *path = NULL, *expected = NULL, hash[GONIO_SHA256_HEX];
    *model = NULL;
    if (gonio_session_model_path(session, &path, NULL) == GONIO_OK &&
        gonio_session_get(session, "result.model_sha256", &expected, NULL) == GONIO_OK &&
        gonio_sha256_file(path, hash, NULL) == GONIO_OK && strcmp(hash, expected) == 0) {
        gonio_model_open(path, model, NULL);
    }
    free(path);
    free(expected);
    if (*model != NULL) {
        return GONIO_OK;
    }
    gonio_samples *samples;
    gonio_fit_report report;
    bool final;
    const gonio_fit_options options = process->setup.fit;
    gonio_status status = gonio_session_final_samples(session, &samples, &final, error);
    status = status == GONIO_OK ? gonio_fit(samples, &options, model, &report, error) : status;
    gonio_samples_free(samples);
    return status;
}

// The terms of the budget, in the order of their printing.
#define TERM(member) CLI_FIGURE(gonio_budget, member)
static const cli_figure terms[] = {TERM(photon), TERM(read),       TERM(dark),  TERM(flat), TERM(reference),
                                   TERM(drift),  TERM(stray),      TERM(angle), TERM(area), TERM(blur),
                                   TERM(random), TERM(systematic), {0}};

static json_t *pair_json(const gonio_pair *p) {
    return json_pack("[f,f,f,f]", gonio_degrees(p->theta_i), gonio_degrees(p->phi_i), gonio_degrees(p->theta_o),
                     gonio_degrees(p->phi_o));
}

static void print_budget(const request *r, const gonio_step *step, const gonio_process *process,
                         const gonio_budget *budget) {
    const int channels = gonio_calib_channels(process->calib);
    const char(*names)[32] = gonio_calib_channel_names(process->calib);
    gonio_blur blur;
    gonio_calib_blur(&process->setup.facts, NULL, NULL, &blur);
    if (r->common->json) {
        json_t *list = json_array();
        for (int c = 0; c < channels; c++) {
            json_t *one = json_pack("{s:s,s:o}", "channel", names[c], "value", cli_json_real(budget[c].value));
            json_object_update_new(one, cli_json_figures(terms, &budget[c]));
            json_object_set_new(one, "area_bias", cli_json_real(budget[c].area_bias));
            json_object_set_new(one, "blur_bias", cli_json_real(budget[c].blur_bias));
            json_object_set_new(one, "sigma", cli_json_real(hypot(budget[c].random, budget[c].systematic)));
            json_array_append_new(list, one);
        }
        cli_json(json_pack("{s:s,s:I,s:o,s:o,s:o}", "session", r->path, "step", (json_int_t)step->index, "pose",
                           pair_json(&step->pose), "budget", list, "blur", cli_json_figures(cli_blur_figures, &blur)));
        return;
    }
    printf("step %lld at theta_i %.6g, phi_i %.6g, theta_o %.6g, phi_o %.6g deg; standard uncertainties (k = 1)\n",
           (long long)step->index, gonio_degrees(step->pose.theta_i), gonio_degrees(step->pose.phi_i),
           gonio_degrees(step->pose.theta_o), gonio_degrees(step->pose.phi_o));
    printf("blur: light +-%.3g deg (%.3g sr), aperture +-%.3g deg (%.3g sr), averaged disc +-%.3g deg\n",
           blur.light_deg, blur.light_sr, blur.aperture_deg, blur.aperture_sr, blur.region_deg);
    for (int c = 0; c < channels; c++) {
        const gonio_budget *b = &budget[c];
        const double combined = hypot(b->random, b->systematic);
        printf("%s: %.6g 1/sr\n", cli_text(names[c]), b->value);
        for (const cli_figure *t = terms; t->name != NULL; t++) {
            const double sigma = cli_figure_of(t, b);
            printf("  %-12s %12.4g 1/sr  %8.4f %%\n", t->name, sigma, 100 * sigma / fabs(b->value));
        }
        printf("  %-12s %12.4g 1/sr  %8.4f %%\n", "combined", combined, 100 * combined / fabs(b->value));
        printf("  bias taken out: averaged disc %+.4f %%, light and aperture %+.4f %%\n", 100 * b->area_bias,
               100 * b->blur_bias);
    }
}

static gonio_status make_budget(gonio_session *session, gonio_process *process, const gonio_pair *pair,
                                const gonio_step **step, gonio_budget *budget, gonio_error *error) {
    bool ready;
    gonio_model *model = NULL;
    gonio_exposure *exposures = NULL;
    int n = 0;
    gonio_status status = gonio_process_begin(session, process, error);
    if (status == GONIO_OK && !process->transmission && gonio_pair_half(*pair) != GONIO_REFLECTION) {
        status = gonio_fail(error, GONIO_E_USAGE,
                            "samples: --budget: expected TI and TO from 0 to 90 deg: the session has no transmission");
    }
    status = status == GONIO_OK ? gonio_process_prepare(session, process, NULL, NULL, 0, &ready, error) : status;
    status = status == GONIO_OK ? find_step(session, process, pair, step, error) : status;
    status = status == GONIO_OK ? find_model(session, process, &model, error) : status;
    status = status == GONIO_OK ? gonio_session_exposures(session, (*step)->index, &exposures, &n, error) : status;
    if (status == GONIO_OK) {
        status = gonio_calib_budget(process->calib, &(*step)->pose, n, exposures, model, pair, budget, error);
    }
    gonio_exposures_free(exposures, n);
    gonio_model_free(model);
    return status;
}

static int show_budget(const request *r, gonio_session *session) {
    gonio_pair pair;
    if (!parse_pair(r->budget, &pair)) {
        return cli_usage(
            r->common,
            "samples: --budget: expected TI,PI,TO,PO in degrees with TI and TO from 0 to 90 (180 of transmission), "
            "found '%s'",
            r->budget);
    }
    gonio_error error = {.line = -1, .byte = -1};
    gonio_process process = {0};
    const gonio_step *step;
    gonio_budget budget[3];
    const gonio_status status = make_budget(session, &process, &pair, &step, budget, &error);
    if (status == GONIO_OK) {
        print_budget(r, step, &process, budget);
    }
    gonio_process_end(&process);
    return status == GONIO_OK ? 0 : cli_fail(r->common, &error);
}

static int run(int argc, char **argv) {
    cli_common common;
    request r = {.common = &common};
    const cli_option options[] = {
        {"output", 'o', CLI_OUTPUT, &r.output, NULL, "CSV", "write the samples there (standard output)"},
        {"budget", 0, CLI_TEXT, &r.budget, NULL, "TI,PI,TO,PO",
         "instead: every term of the uncertainty of the sample nearest to this direction (deg)"},
        {"edges", 0, CLI_FLAG, &r.edges, NULL, NULL, "instead: the poses that reach over the sample's edge, and how"},
        {0},
    };
    int count;
    if (!cli_parse(&cmd_samples, options, argc, argv, &r.path, 1, 1, &count, &common)) {
        return 2;
    }
    gonio_error error = {.line = -1, .byte = -1};
    gonio_session *session;
    if (gonio_session_is_hdf5(r.path)) {
        return write_file(&r);
    }
    if (gonio_session_open(r.path, false, &session, &error) != GONIO_OK) {
        return cli_fail(&common, &error);
    }
    const int exit_status = r.budget != NULL ? show_budget(&r, session)
                            : r.edges        ? list_edges(&r, session)
                                             : write_samples(&r, session);
    gonio_session_close(session);
    return exit_status;
}
