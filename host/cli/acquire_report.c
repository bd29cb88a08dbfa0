// SPDX-License-Identifier: BSD-3-Clause
// What `gonio tradeoff --acquire` prints and writes.
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "gonio/output.h"
#include "host/cli/acquire_tradeoff.h"
#include "host/cli/apart.h"

static gonio_status make_folder(const char *folder, gonio_error *error) {
    return mkdir(folder, 0777) == 0 || errno == EEXIST
               ? GONIO_OK
               : gonio_fail_line(error, GONIO_E_IO, folder, -1, "cannot make the folder: %s", strerror(errno));
}

static void print_number(FILE *f, double value) {
    if (isfinite(value)) {
        fprintf(f, ",%.6g", value);
    } else {
        fputc(',', f);
    }
}

static const char *const acquire_files[] = {"acquire.csv", "error_poses.svg", "error_minutes.svg", NULL};

static gonio_status write_acquired(const cli_acquire_row *rows, size_t n, const char *folder, gonio_error *error) {
    char path[4096];
    gonio_output *output;
    gonio_status status = make_folder(folder, error);
    snprintf(path, sizeof path, "%s/%s", folder, acquire_files[0]);
    status = status == GONIO_OK ? gonio_output_open(path, &output, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    FILE *f = gonio_output_stream(output);
    fputs("kind,plan,exposure_max_s,aperture_radius_mm,poses,frames,rig_min,poses_min,choosing_s", f);
    for (const cli_figure *figure = cli_figures; figure->name != NULL; figure++) {
        fprintf(f, ",%s", figure->name);
    }
    fputc('\n', f);
    for (size_t i = 0; i < n; i++) {
        const cli_acquire_row *r = &rows[i];
        if (r->status == GONIO_OK) {
            fprintf(f, "%s,\"%s\"", r->kind, r->plan);
            print_number(f, r->exposure_s > 0 ? r->exposure_s : NAN);
            print_number(f, r->aperture_mm >= 0 ? r->aperture_mm : NAN);
            fprintf(f, ",%zu,%zu", r->poses, r->frames);
            print_number(f, r->rig_min);
            print_number(f, r->poses_min);
            print_number(f, r->choosing_s);
            for (const cli_figure *figure = cli_figures; figure->name != NULL; figure++) {
                print_number(f, cli_figure_of(figure, &r->errors));
            }
            fputc('\n', f);
        }
    }
    status = gonio_output_commit(output, error);
    for (int k = 0; k < 2 && status == GONIO_OK; k++) {
        snprintf(path, sizeof path, "%s/%s", folder, acquire_files[1 + k]);
        status = cli_acquire_plot(rows, n, k == 1, path, error);
    }
    return status;
}

static json_t *acquired_json(const cli_acquire_row *rows, size_t n, const char *sample) {
    json_t *list = json_array(), *failed = json_array();
    for (size_t i = 0; i < n; i++) {
        const cli_acquire_row *r = &rows[i];
        if (r->status != GONIO_OK) {
            json_array_append_new(failed, json_pack("{s:s,s:s}", "plan", r->plan, "message", r->error.message));
            continue;
        }
        json_array_append_new(
            list, json_pack("{s:s,s:s,s:o,s:o,s:I,s:I,s:f,s:f,s:f,s:o}", "kind", r->kind, "plan", r->plan,
                            "exposure_max_s", cli_json_real(r->exposure_s > 0 ? r->exposure_s : NAN),
                            "aperture_radius_mm", cli_json_real(r->aperture_mm >= 0 ? r->aperture_mm : NAN), "poses",
                            (json_int_t)r->poses, "frames", (json_int_t)r->frames, "rig_min", r->rig_min, "poses_min",
                            r->poses_min, "choosing_s", r->choosing_s, "errors", cli_json_errors(&r->errors)));
    }
    return json_pack("{s:s,s:o,s:o}", "sample", sample, "rows", list, "failed", failed);
}

static void print_acquired(const cli_acquire_row *rows, size_t n, const char *folder) {
    printf("%-10s %7s %9s %9s %9s %9s %10s %9s  %s\n", "kind", "poses", "rig min", "poses min", "exposure", "aperture",
           "median_rel", "rms_log", "plan (errors at directions that nobody measured)");
    for (size_t i = 0; i < n; i++) {
        const cli_acquire_row *r = &rows[i];
        char exposure[16] = "-", aperture[16] = "-";
        if (r->status != GONIO_OK) {
            printf("%-10s failed: %s\n", r->kind, cli_text(r->error.message));
            continue;
        }
        if (r->exposure_s > 0) {
            snprintf(exposure, sizeof exposure, "%.4g s", r->exposure_s);
        }
        if (r->aperture_mm >= 0) {
            snprintf(aperture, sizeof aperture, "%.4g mm", r->aperture_mm);
        }
        printf("%-10s %7zu %9.2f %9.2f %9s %9s %10.4g %9.4g  %s\n", r->kind, r->poses, r->rig_min, r->poses_min,
               exposure, aperture, r->errors.median_rel, r->errors.rms_log, cli_text(r->plan));
    }
    printf("%s/acquire.csv, error_poses.svg, error_minutes.svg\n", folder);
}

int cli_acquire(cli_acquire_request *r, const char *folder, cli_common *common) {
    gonio_error error = {.line = -1, .byte = -1};
    cli_acquire_row *rows = NULL;
    size_t n = 0;
    if (r->rig.sample == NULL) {
        return cli_usage(common, "tradeoff: --acquire needs --sample SPEC, whose BRDF is known");
    }
    if (!cli_apart_folder(common, folder, acquire_files)) {
        return 2;
    }
    r->sample = r->rig.sample;
    r->rig.seed = common->seed;
    r->rig.threads = r->threads = common->threads;
    cli_catch_interrupts();
    gonio_status status = cli_acquire_run(r, &rows, &n, &error);
    status = status == GONIO_OK ? write_acquired(rows, n, folder, &error) : status;
    int exit_status = 0;
    if (status != GONIO_OK) {
        exit_status = cli_fail(common, &error);
    } else if (common->json) {
        exit_status = cli_json(acquired_json(rows, n, r->sample));
    } else {
        print_acquired(rows, n, folder);
    }
    free(rows);
    return exit_status;
}
