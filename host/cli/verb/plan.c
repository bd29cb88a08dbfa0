// SPDX-License-Identifier: BSD-3-Clause
// gonio plan: the poses of a plan in the order they would be measured, and what that takes.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gonio/output.h"
#include "host/cli/rig_file.h"

static int run(int argc, char **argv);
const cli_verb cmd_plan = {"plan", "PLAN [--rig sim|RIG.ini | --check RIG.ini] [-o CSV]",
                           "a plan's poses in measuring order, travel, time and storage; nothing moves", run};

// Typical frames a pose; what bracketing really needs depends on the sample.
#define FRAMES_A_POSE 2.5

typedef struct estimate {
    size_t poses, edges_excluded, edges_flagged;
    double travel_s, total_s, storage_bytes;
} estimate;

static gonio_status write_poses(const gonio_step *steps, size_t n, FILE *stream) {
    bool behind = false;
    for (size_t i = 0; i < n; i++) {
        behind = behind || gonio_pairs_transmit(&steps[i].pose, 1);
    }
    fputs(behind ? "# halves = reflection,transmission\ntheta_i,phi_i,theta_o,phi_o\n"
                 : "theta_i,phi_i,theta_o,phi_o\n",
          stream);
    for (size_t i = 0; i < n; i++) {
        if (steps[i].kind == GONIO_STEP_SAMPLE) {
            const gonio_pair *p = &steps[i].pose;
            fprintf(stream, "%.17g,%.17g,%.17g,%.17g\n", gonio_degrees(p->theta_i), gonio_degrees(p->phi_i),
                    gonio_degrees(p->theta_o), gonio_degrees(p->phi_o));
        }
    }
    return GONIO_OK;
}

static gonio_status save(const gonio_step *steps, size_t n, const char *path, gonio_error *error) {
    gonio_output *output;
    const gonio_status status = gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    write_poses(steps, n, gonio_output_stream(output));
    return gonio_output_commit(output, error);
}

static void fill(const cli_rig *rig, const gonio_setup *setup, const gonio_step *steps, size_t n, estimate *e) {
    const size_t pixels = (size_t)setup->window.width * (size_t)setup->window.height;
    e->poses = 0;
    for (size_t i = 0; i < n; i++) {
        e->poses += steps[i].kind == GONIO_STEP_SAMPLE;
    }
    const double frames = FRAMES_A_POSE * (double)e->poses + 2 * setup->scan.dark_frames + setup->scan.trap_frames +
                          2 * (double)setup->scan.reference_frames;
    e->travel_s = gonio_scan_travel_s(&rig->rig, steps, n, setup->scan.settle_s);
    e->total_s = e->travel_s + frames * setup->camera.read_out_s + setup->scan.trap_frames +
                 setup->scan.dark_frames * (setup->camera.exposure_min_s + setup->camera.exposure_max_s);
    e->storage_bytes = frames * (double)pixels * setup->camera.bits / 8.0;
}

static gonio_status plan(const cli_rig_options *options, const char *text, cli_rig *rig, gonio_setup *setup,
                         gonio_step **steps, size_t *n, gonio_error *error) {
    gonio_plan *poses;
    gonio_status status = cli_rig_open(options, rig, error);
    status = status == GONIO_OK ? gonio_setup_of_rig(&rig->rig, &rig->scan, setup, error) : status;
    status = status == GONIO_OK ? gonio_plan_make(text, options->seed, &poses, error) : status;
    if (status == GONIO_OK) {
        status = gonio_scan_steps(&rig->rig, &setup->scan, poses, steps, n, error);
        gonio_plan_free(poses);
    }
    return status;
}

// Every move of the plan against the stage's limits and the keep-out zones, without motion. Tells the first ten.
static gonio_status check_moves(const cli_rig *rig, const gonio_step *steps, size_t n, gonio_error *error) {
    const gonio_rig *r = &rig->rig;
    double from[GONIO_AXES], to[GONIO_AXES];
    size_t refused = 0;
    if (r->stage->check == NULL || n == 0) {
        return GONIO_OK;
    }
    gonio_scan_target(&steps[0].pose, from);
    for (size_t i = 0; i < n; i++) {
        gonio_error why = {.line = -1, .byte = -1};
        gonio_scan_target(&steps[i].pose, to);
        if (r->stage->check(r->stage_device, from, to, &why) != GONIO_OK && refused++ < 10) {
            fprintf(stderr, "step %zu: %s\n", i, cli_text(why.message));
        }
        memcpy(from, to, sizeof from);
    }
    return refused == 0
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_RANGE, "%zu of %zu steps would be refused; nothing has moved", refused, n);
}

// Tell which poses reach over the sample's edge; with `check` those without a sample are a failure.
static gonio_status check_edges(const gonio_setup *setup, const gonio_step *steps, size_t n, bool check, estimate *e,
                                gonio_error *error) {
    gonio_edges_report edges;
    gonio_scan_edges(setup, steps, n, &edges);
    for (int i = 0; i < edges.told; i++) {
        fprintf(stderr, "%s\n", edges.text[i]);
    }
    e->edges_excluded = edges.excluded;
    e->edges_flagged = edges.spilled;
    return check && edges.excluded > 0
               ? gonio_fail(error, GONIO_E_RANGE,
                            "%zu poses would give no sample: they reach over its edge; %zu more would be flagged",
                            edges.excluded, edges.spilled)
               : GONIO_OK;
}

static int report(const cli_common *common, const char *text, const char *path, const estimate *e) {
    if (common->json) {
        return cli_json(json_pack("{s:s,s:I,s:I,s:I,s:f,s:f,s:f,s:s?}", "plan", text, "poses", (json_int_t)e->poses,
                                  "edges_excluded", (json_int_t)e->edges_excluded, "edges_flagged",
                                  (json_int_t)e->edges_flagged, "travel_s", e->travel_s, "total_s", e->total_s,
                                  "storage_bytes", e->storage_bytes, "output", path));
    }
    FILE *to = path != NULL ? stdout : stderr; // the poses themselves went to stdout
    fprintf(to,
            "%zu poses; moving and settling %.0f s, with dark frames and read-out %.0f s and the exposures; about "
            "%.3g MB of frames\n",
            e->poses, e->travel_s, e->total_s, e->storage_bytes / 1e6);
    return 0;
}

static int run(int argc, char **argv) {
    cli_common common;
    cli_rig_options rig_options = {0};
    const char *output = NULL, *check = NULL, *text;
    const cli_option options[] = {
        CLI_RIG_OPTIONS(rig_options),
        {"output", 'o', CLI_OUTPUT, &output, NULL, "CSV", "write the poses there (standard output)"},
        {"check", 0, CLI_TEXT, &check, NULL, "RIG.ini", "the same as --rig, and hold every move against its limits"},
        {0},
    };
    int count;
    if (!cli_parse(&cmd_plan, options, argc, argv, &text, 1, 1, &count, &common)) {
        return 2;
    }
    cli_rig_any_sample(&rig_options, &common);
    rig_options.rig = check != NULL ? check : rig_options.rig;
    gonio_error error = {.line = -1, .byte = -1};
    cli_rig rig = {0};
    gonio_setup setup = {0};
    gonio_step *steps = NULL;
    size_t n = 0;
    estimate e = {0};
    gonio_status status = plan(&rig_options, text, &rig, &setup, &steps, &n, &error);
    status = status == GONIO_OK && check != NULL ? check_moves(&rig, steps, n, &error) : status;
    status = status == GONIO_OK ? check_edges(&setup, steps, n, check != NULL, &e, &error) : status;
    if (status == GONIO_OK) {
        fill(&rig, &setup, steps, n, &e);
        if (output != NULL) {
            status = save(steps, n, output, &error);
        } else if (!common.json) {
            write_poses(steps, n, stdout);
        }
    }
    const int exit_status = status == GONIO_OK ? report(&common, text, output, &e) : cli_fail(&common, &error);
    free(steps);
    cli_rig_close(&rig);
    return exit_status;
}
