// SPDX-License-Identifier: BSD-3-Clause
// gonio plan: the poses of a plan in the order they would be measured, and what that takes.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "gonio/needs.h"
#include "gonio/output.h"
#include "host/acquire/pose_time.h"
#include "host/cli/rig_file.h"

static int run(int argc, char **argv);
const cli_verb cmd_plan = {"plan", "PLAN [--rig sim|RIG.ini | --check RIG.ini] [-o CSV]",
                           "a plan's poses in measuring order, travel, time and storage; nothing moves", run};

typedef struct estimate {
    size_t poses, edges_excluded, edges_flagged;
    double travel_s, total_s, storage_bytes;
    gonio_needs_plan_report pictures; // of a plan for a scene; else 0
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
    const double frames = GONIO_FRAMES_A_POSE * (double)e->poses + 2 * setup->scan.dark_frames +
                          setup->scan.trap_frames + 2 * (double)setup->scan.reference_frames;
    e->travel_s = gonio_scan_travel_s(&rig->rig, steps, n, setup->scan.settle_s);
    e->total_s = e->travel_s + frames * setup->camera.read_out_s + setup->scan.trap_frames +
                 setup->scan.dark_frames * (setup->camera.exposure_min_s + setup->camera.exposure_max_s);
    e->storage_bytes = frames * (double)pixels * setup->camera.bits / 8.0;
}

// As many of the first poses as the budget (0: none) has time for.
static gonio_status fit_budget(const cli_rig *rig, const gonio_setup *setup, gonio_plan *poses, double budget_s,
                               gonio_error *error) {
    size_t low = 0, high = budget_s > 0 ? poses->n + 1 : 0;
    while (high > low + 1) {
        gonio_step *steps;
        size_t n;
        estimate e = {0};
        const gonio_plan first = {.n = low + (high - low) / 2, .poses = poses->poses};
        const gonio_status status = gonio_scan_steps(&rig->rig, &setup->scan, &first, &steps, &n, error);
        if (status != GONIO_OK) {
            return status;
        }
        fill(rig, setup, steps, n, &e);
        free(steps);
        low = e.total_s <= budget_s ? first.n : low;
        high = e.total_s <= budget_s ? high : first.n;
    }
    poses->n = budget_s > 0 ? low : poses->n;
    return poses->n > 0 ? GONIO_OK
                        : gonio_fail(error, GONIO_E_USAGE, "--budget: %g s are too short for a single pose", budget_s);
}

// A plan for a scene that names no number has as many poses as the budget has time for, or more.
static void complete_text(const char *text, double budget_s, char *out, size_t size) {
    const bool open = budget_s > 0 && strncmp(text, "scene:", 6) == 0 && strstr(text, ",N=") == NULL;
    gonio_number_format(out, size, open ? "%s,N=3000,seconds=%g" : "%s", text, budget_s);
}

static gonio_status plan(const cli_rig_options *options, const char *text, double budget_s, cli_rig *rig,
                         gonio_setup *setup, gonio_step **steps, size_t *n, estimate *e, gonio_error *error) {
    char whole[4200];
    gonio_plan *poses = NULL;
    gonio_status status = cli_rig_open(options, rig, error);
    status = status == GONIO_OK ? gonio_setup_of_rig(&rig->rig, &rig->scan, setup, error) : status;
    if (status == GONIO_OK) {
        gonio_pose_time time = gonio_pose_time_of(&rig->rig, setup);
        complete_text(text, budget_s, whole, sizeof whole);
        status = gonio_plan_resolve(whole, options->seed, gonio_pose_time_s, &time, &poses, &e->pictures, error);
    }
    status = status == GONIO_OK ? fit_budget(rig, setup, poses, budget_s, error) : status;
    status = status == GONIO_OK ? gonio_scan_steps(&rig->rig, &setup->scan, poses, steps, n, error) : status;
    gonio_plan_free(poses);
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

static bool parse_time(const char *text, double *seconds) {
    static const struct {
        const char *unit;
        double seconds;
    } units[] = {{"", 1}, {"s", 1}, {"min", 60}, {"h", 3600}};
    char *end;
    const double number = gonio_number_parse(text, &end);
    for (size_t k = 0; k < sizeof units / sizeof *units; k++) {
        if (end != text && strcmp(end, units[k].unit) == 0 && number > 0 && isfinite(number)) {
            *seconds = number * units[k].seconds;
            return true;
        }
    }
    return false;
}

static int report(const cli_common *common, const char *text, const char *path, const estimate *e) {
    if (common->json) {
        json_t *pictures = e->pictures.before > 0
                               ? json_pack("{s:f,s:f}", "before", e->pictures.before, "after", e->pictures.after)
                               : json_null();
        return cli_json(json_pack("{s:s,s:I,s:I,s:I,s:f,s:f,s:f,s:o,s:s?}", "plan", text, "poses", (json_int_t)e->poses,
                                  "edges_excluded", (json_int_t)e->edges_excluded, "edges_flagged",
                                  (json_int_t)e->edges_flagged, "travel_s", e->travel_s, "total_s", e->total_s,
                                  "storage_bytes", e->storage_bytes, "pictures", pictures, "output", path));
    }
    FILE *to = path != NULL ? stdout : stderr; // the poses themselves went to stdout
    fprintf(to,
            "%zu poses; moving and settling %.0f s, with dark frames and read-out %.0f s and the exposures; about "
            "%.3g MB of frames\n",
            e->poses, e->travel_s, e->total_s, e->storage_bytes / 1e6);
    if (e->pictures.before > 0) {
        fprintf(to, "what is unknown of a material shows as %.3g of what it does before\n",
                sqrt(e->pictures.after / e->pictures.before));
    }
    return 0;
}

static int run(int argc, char **argv) {
    cli_common common;
    cli_rig_options rig_options = {0};
    const char *output = NULL, *check = NULL, *budget = NULL, *text;
    double budget_s = 0;
    const cli_option options[] = {
        CLI_RIG_OPTIONS(rig_options),
        {"output", 'o', CLI_OUTPUT, &output, NULL, "CSV", "write the poses there (standard output)"},
        {"check", 0, CLI_TEXT, &check, NULL, "RIG.ini", "the same as --rig, and hold every move against its limits"},
        {"budget", 0, CLI_TEXT, &budget, NULL, "TIME", "as many of the first poses as fit in 30min, 2h or 900s"},
        {0},
    };
    int count;
    if (!cli_parse(&cmd_plan, options, argc, argv, &text, 1, 1, &count, &common)) {
        return 2;
    }
    if (budget != NULL && !parse_time(budget, &budget_s)) {
        return cli_usage(&common, "plan: --budget '%s'; expected a time above 0 as 900s, 30min or 2h", budget);
    }
    cli_rig_any_sample(&rig_options, &common);
    rig_options.rig = check != NULL ? check : rig_options.rig;
    gonio_error error = {.line = -1, .byte = -1};
    cli_rig rig = {0};
    gonio_setup setup = {0};
    gonio_step *steps = NULL;
    size_t n = 0;
    estimate e = {0};
    gonio_status status = plan(&rig_options, text, budget_s, &rig, &setup, &steps, &n, &e, &error);
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
