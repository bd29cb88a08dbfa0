// SPDX-License-Identifier: BSD-3-Clause
// gonio tradeoff: every method on the same samples; a CSV, plots, the Pareto front.
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "fit/options.h"
#include "fit/tradeoff.h"
#include "gonio/output.h"
#include "host/cli/acquire_tradeoff.h"
#include "host/cli/apart.h"
#include "host/cli/input.h"
#include "host/cli/tradeoff_plot.h"
#include "host/cli/tradeoff_run.h"

typedef struct table {
    cli_tradeoff_table measured;
    gonio_tradeoff_row *rows; // of it
    size_t n;
    gonio_coverage coverage;
} table;

// What was asked for and what the method made of it, for people: "half-vector log lambda=1e-5".
static void describe(const gonio_tradeoff_row *row, char *text, size_t size) {
    if (!gonio_method_has_member(row->form.method, offsetof(gonio_fit_options, coordinates))) {
        snprintf(text, size, "%s", row->report.options); // formulae and bases have neither coordinates nor domain
        return;
    }
    snprintf(text, size, "%s %s%s%s", gonio_coordinates_name(row->report.coordinates),
             gonio_domain_name(row->report.domain), row->report.options[0] != '\0' ? " " : "", row->report.options);
}

static void print_number(FILE *f, double value) {
    if (isfinite(value)) {
        fprintf(f, ",%.6g", value);
    } else {
        fputc(',', f);
    }
}

static void print_errors(FILE *f, const gonio_errors *e) {
    for (const cli_figure *figure = cli_figures; figure->name != NULL; figure++) {
        print_number(f, e->samples > 0 ? cli_figure_of(figure, e) : NAN);
    }
}

static gonio_status write_csv(const table *t, const char *path, gonio_error *error) {
    gonio_output *output;
    const gonio_status status = gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    FILE *f = gonio_output_stream(output);
    fputs("method,level,options,fit_seconds,eval_ns,batch_ns,bytes,file_bytes", f);
    for (int side = 0; side < 2; side++) {
        for (const cli_figure *figure = cli_figures; figure->name != NULL; figure++) {
            fprintf(f, ",%s_%s", side == 0 ? "train" : "held_out", figure->name);
        }
    }
    fputs(",image_error,pareto\n", f);
    for (size_t i = 0; i < t->n; i++) {
        const gonio_tradeoff_row *r = &t->rows[i];
        if (r->status != GONIO_OK) {
            continue;
        }
        char text[512];
        describe(r, text, sizeof text);
        for (char *c = text; *c != '\0'; c++) {
            *c = *c == ',' ? ';' : *c;
        }
        fprintf(f, "%s,%d,%s,%.4g", r->form.method, r->report.level, text, r->report.fit_seconds);
        print_number(f, r->eval_ns);
        print_number(f, r->batch_ns);
        fprintf(f, ",%zu,%zu", r->report.bytes, r->file_bytes);
        print_errors(f, &r->report.train);
        print_errors(f, &r->report.held_out);
        print_number(f, r->image_error);
        fprintf(f, ",%s\n", r->pareto ? "true" : "false");
    }
    return gonio_output_commit(output, error);
}

static const char *const files[] = {"tradeoff.csv", "error_bytes.png", "error_ns.png", "error_seconds.png", NULL};

static gonio_status write_all(const table *t, const char *folder, gonio_error *error) {
    char path[4096];
    snprintf(path, sizeof path, "%s/%s", folder, files[0]);
    gonio_status status = write_csv(t, path, error);
    for (int axis = CLI_TRADEOFF_BYTES; axis <= CLI_TRADEOFF_SECONDS && status == GONIO_OK; axis++) {
        snprintf(path, sizeof path, "%s/%s", folder, files[1 + axis]);
        status = cli_tradeoff_plot(t->rows, t->n, (cli_tradeoff_axis)axis, path, error);
    }
    return status;
}

static json_t *to_json(const table *t, const char *input) {
    json_t *rows = json_array(), *failed = json_array();
    for (size_t i = 0; i < t->n; i++) {
        const gonio_tradeoff_row *r = &t->rows[i];
        if (r->status != GONIO_OK) {
            json_array_append_new(failed, json_pack("{s:s,s:i,s:s}", "method", r->form.method, "level", r->form.level,
                                                    "message", r->error.message));
            continue;
        }
        char text[512];
        describe(r, text, sizeof text);
        json_array_append_new(
            rows, json_pack("{s:s,s:i,s:s,s:o,s:o,s:o,s:I,s:I,s:o,s:o,s:o,s:b}", "method", r->form.method, "level",
                            r->report.level, "options", text, "fit_seconds", cli_json_real(r->report.fit_seconds),
                            "eval_ns", cli_json_real(r->eval_ns), "batch_ns", cli_json_real(r->batch_ns), "bytes",
                            (json_int_t)r->report.bytes, "file_bytes", (json_int_t)r->file_bytes, "image_error",
                            cli_json_real(r->image_error), "train", cli_json_errors(&r->report.train), "held_out",
                            cli_json_errors(&r->report.held_out), "pareto", (int)r->pareto));
    }
    return json_pack("{s:s,s:o,s:o,s:I,s:s,s:o}", "input", input, "rows", rows, "failed", failed, "not_reached",
                     (json_int_t)t->measured.left, "image_reference", t->measured.reference, "sampled",
                     cli_json_coverage(&t->coverage));
}

static void print(const table *t, const char *folder) {
    cli_print_coverage(&t->coverage);
    printf("%-20s %5s %9s %9s %9s %10s %10s  %9s  %s\n", "method", "level", "fit s", "ns", "kB", "median_rel",
           "rms_log", "image", "form (held-out errors; * none better in error, bytes and ns)");
    for (size_t i = 0; i < t->n; i++) {
        const gonio_tradeoff_row *r = &t->rows[i];
        if (r->status != GONIO_OK) {
            printf("%-20s %5d  failed: %s\n", r->form.method, r->form.level, cli_text(r->error.message));
            continue;
        }
        const gonio_errors *e = r->report.held_out.samples > 0 ? &r->report.held_out : &r->report.train;
        char text[512];
        describe(r, text, sizeof text);
        char level[16] = "-";
        if (gonio_method_has_member(r->form.method, offsetof(gonio_fit_options, level))) {
            snprintf(level, sizeof level, "%d", r->report.level);
        }
        printf("%-20s %5s %9.3g %9.3g %9.4g %10.4g %10.4g%c %9.3g  %s\n", r->form.method, level, r->report.fit_seconds,
               r->eval_ns, (double)r->report.bytes / 1024, e->median_rel, e->rms_log, r->pareto ? '*' : ' ',
               r->image_error, text);
    }
    printf("image: mean distance of 8-bit colours in four pictures, against %s\n", t->measured.reference);
    if (t->measured.left > 0) {
        printf("the budget left %zu forms out\n", t->measured.left);
    }
    printf("%s/tradeoff.csv, error_bytes.png, error_ns.png, error_seconds.png\n", folder);
}

static gonio_status prepare(const char *folder, gonio_error *error) {
    if (mkdir(folder, 0777) != 0 && errno != EEXIST) {
        return gonio_fail_line(error, GONIO_E_IO, folder, -1, "cannot make the folder: %s", strerror(errno));
    }
    return GONIO_OK;
}

typedef struct request {
    const char *input, *folder, *truth;
    cli_tradeoff_request how;
} request;

static gonio_status measure_and_write(request *what, const gonio_samples *samples, gonio_fit_options *fit, table *t,
                                      gonio_error *error) {
    gonio_model *truth = NULL;
    gonio_status status = what->truth != NULL ? gonio_model_resolve(what->truth, &truth, error) : GONIO_OK;
    what->how.truth = truth;
    status = status == GONIO_OK ? gonio_coverage_of(samples, &t->coverage, error) : status;
    status = status == GONIO_OK ? prepare(what->folder, error) : status;
    status = status == GONIO_OK ? cli_tradeoff_run(samples, fit, &what->how, &t->measured, error) : status;
    t->rows = t->measured.rows;
    t->n = t->measured.n;
    status = status == GONIO_OK ? write_all(t, what->folder, error) : status;
    gonio_model_free(truth);
    return status;
}

static int work(request *what, const cli_input *in, gonio_fit_options *fit, const cli_common *common) {
    gonio_error error = {.line = -1, .byte = -1};
    gonio_samples *samples;
    table t = {0};
    gonio_status status = cli_input_read(what->input, in, common, &samples, &error);
    if (status == GONIO_OK) {
        status = measure_and_write(what, samples, fit, &t, &error);
        gonio_samples_free(samples);
    }
    int exit_status = 0;
    if (status != GONIO_OK) {
        exit_status = cli_fail(common, &error);
    } else if (common->json) {
        exit_status = cli_json(to_json(&t, what->input));
    } else {
        print(&t, what->folder);
    }
    free(t.rows);
    return exit_status;
}

extern const cli_verb cmd_tradeoff;

static int compare_methods(request *what, const cli_input *in, gonio_fit_options *fit, cli_common *common) {
    char name[64];
    if (!(what->how.budget >= 0)) {
        return cli_usage(common, "tradeoff: --budget %g; expected seconds, 0 or more", what->how.budget);
    }
    const char *none = cli_tradeoff_unknown(what->how.methods, name, sizeof name);
    if (none != NULL) {
        return cli_usage(common, "tradeoff: --methods: no method '%s'; `gonio fit --help` lists them", none);
    }
    if (!cli_apart_folder(common, what->folder, files)) {
        return 2;
    }
    cli_catch_interrupts();
    fit->seed = common->seed;
    fit->threads = common->threads;
    return work(what, in, fit, common);
}

static int run(int argc, char **argv) {
    cli_input in = {0};
    gonio_fit_options fit;
    gonio_fit_options_default(&fit);
    request what = {0};
    cli_acquire_request acquired = {.poses = "40,80,160"};
    cli_common common;
    bool acquires = false;
    int count;
    const cli_option options[] = {
        {"output", 'o', CLI_TEXT, &what.folder, NULL, "DIR", "folder for the table (CSV) and the plots"},
        {"methods", 0, CLI_TEXT, &what.how.methods, NULL, "LIST", "only these, with commas between them (all)"},
        {"all-forms", 0, CLI_FLAG, &what.how.all_forms, NULL, NULL, "every domain, instead of the better one of each"},
        {"budget", 0, CLI_DOUBLE, &what.how.budget, NULL, "SECONDS", "stop then; the methods take turns"},
        {"truth", 0, CLI_TEXT, &what.truth, NULL, "MODEL", "what pictures are compared with (the most accurate row)"},
        {"hold-out", 0, CLI_DOUBLE, &fit.hold_out, NULL, "FRACTION", "of the geometries (0.2); 0: none"},
        {"folds", 0, CLI_INT, &fit.folds, NULL, "K", "K-fold errors instead of one hold-out"},
        {"acquire", 0, CLI_FLAG, &acquires, NULL, NULL,
         "measure a known sample on the simulated rig instead: error against poses and minutes, for each plan"},
        CLI_ACQUIRE_OPTIONS(acquired),
        CLI_RIG_OPTIONS(acquired.rig),
        CLI_INPUT_OPTIONS(in),
        {0}};
    if (!cli_parse(&cmd_tradeoff, options, argc, argv, &what.input, 0, 1, &count, &common)) {
        return 2;
    }
    if (what.folder == NULL || acquires != (count == 0)) {
        return cli_usage(&common, what.folder == NULL ? "tradeoff: where to? -o DIR"
                                  : acquires          ? "tradeoff: --acquire measures --sample and takes no INPUT"
                                                      : "tradeoff: INPUT is missing");
    }
    return acquires ? cli_acquire(&acquired, what.folder, &common) : compare_methods(&what, &in, &fit, &common);
}

const cli_verb cmd_tradeoff = {"tradeoff", "INPUT -o DIR | --acquire --sample SPEC -o DIR [options]",
                               "every method on the same samples: fit time, ns, bytes, errors, the Pareto front", run};
