// SPDX-License-Identifier: BSD-3-Clause
#include "host/cli/export.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "gonio/output.h"
#include "gonio/render.h"
#include "gonio/version.h"

#define OWN 4 // rows that belong to no format

// ---- options ----

static void add_row(cli_export *out, int *n, const char *format, const gonio_format_option *o) {
    for (int k = OWN; k < *n; k++) {
        if (strcmp(out->rows[k].name, o->name) == 0) {
            return;
        }
    }
    if (*n + 1 < CLI_EXPORT_ROWS) {
        snprintf(out->help[*n], CLI_EXPORT_HELP, "%s (written %s: %s)", o->help, format, o->standard);
        out->rows[*n] = (cli_option){o->name, 0, CLI_TEXT, &out->given[*n], NULL, o->argument, out->help[*n]};
        (*n)++;
    }
}

cli_option *cli_export_table(cli_export *out) {
    out->rows[0] = (cli_option){"max-error",
                                0,
                                CLI_DOUBLE,
                                &out->max_error,
                                NULL,
                                "FRACTION",
                                "write no table of whose values half are off by more, read back (any)"};
    out->rows[1] = (cli_option){"max-bytes",
                                0,
                                CLI_SIZE,
                                &out->max_bytes,
                                NULL,
                                "N",
                                "of a table whose size can be chosen (each format's own)"};
    out->rows[2] = (cli_option){
        "no-report", 0, CLI_FLAG, &out->no_report, NULL, NULL, "neither read a table back nor write OUT.report.json"};
    out->rows[3] = (cli_option){"half",
                                0,
                                CLI_TEXT,
                                &out->half,
                                NULL,
                                "reflection|transmission",
                                "of a sheet, where the format holds one a file: zemax, astm, speos (the first it has)"};
    int n = OWN;
    gonio_format_facts f;
    for (int i = 0; gonio_format_get(i, &f); i++) {
        for (const gonio_format_option *o = f.write_options; o->name != NULL; o++) {
            add_row(out, &n, f.name, o);
        }
    }
    out->rows[n] = (cli_option){0};
    return out->rows;
}

gonio_status cli_export_refuse(const cli_export *out, const char *what, gonio_error *error) {
    const char *name = out->max_error != 0   ? "max-error"
                       : out->max_bytes != 0 ? "max-bytes"
                       : out->half != NULL   ? "half"
                                             : NULL;
    for (int k = OWN; k < CLI_EXPORT_ROWS && out->rows[k].name != NULL; k++) {
        name = out->given[k] != NULL ? out->rows[k].name : name;
    }
    return name == NULL ? GONIO_OK
                        : gonio_fail(error, GONIO_E_USAGE,
                                     "%s: an option of tables that are written from a model, not of %s", name, what);
}

static gonio_half half_of(const char *name) {
    return name != NULL && strcmp(name, gonio_half_name(GONIO_TRANSMISSION)) == 0 ? GONIO_TRANSMISSION
                                                                                  : GONIO_REFLECTION;
}

static gonio_write_options options_of(const cli_export *out, const cli_common *common) {
    gonio_write_options options = {.threads = common->threads,
                                   .max_bytes = out->max_bytes,
                                   .half = half_of(out->half),
                                   .max_error = out->max_error};
    int n = 0;
    for (int k = OWN; k < CLI_EXPORT_ROWS && out->rows[k].name != NULL && n < GONIO_FORMAT_SETTINGS_MAX; k++) {
        if (out->given[k] != NULL) {
            options.settings[n++] = (gonio_format_setting){out->rows[k].name, out->given[k]};
        }
    }
    return options;
}

// ---- the report ----

// Mean difference of the pictures of a lit sphere, in 8-bit codes; NaN where the file is no table by itself.
static double picture(const gonio_model *model, const char *path, const gonio_write_report *report, int threads) {
    gonio_model *found;
    double mean = NAN;
    if (report->at_its_nodes || gonio_read_table(path, &found, NULL) != GONIO_OK) {
        return mean;
    }
    gonio_render_options options;
    gonio_render_options_default(&options);
    options.width = options.height = 96;
    options.threads = threads;
    if (gonio_render_difference(model, found, &options, &mean, NULL) != GONIO_OK) {
        mean = NAN;
    }
    gonio_model_free(found);
    return mean;
}

static json_t *report_json(const gonio_write_report *r, const gonio_model *model, const char *source, double image) {
    json_t *albedo = json_array(), *channels = json_array();
    for (int k = 0; k < GONIO_WRITE_TILTS; k++) {
        json_array_append_new(albedo, json_pack("{s:f,s:o,s:o}", "theta_i_deg", r->tilt_deg[k], "model",
                                                cli_json_real(r->albedo[k]), "relative_error",
                                                cli_json_real(r->albedo_error[k])));
    }
    for (int c = 0; c < model->channels; c++) {
        json_array_append_new(channels, json_string(model->channel_names[c]));
    }
    json_t *object =
        json_pack("{s:s,s:s,s:s,s:s,s:s,s:s,s:f,s:I,s:i}", "written_by", "Gonio " GONIO_VERSION, "source", source,
                  "format", r->format, "quantity", r->quantity, "convention", r->convention, "about", r->about,
                  "theta_max_deg", r->theta_max_deg, "bytes", (json_int_t)r->bytes, "channels", r->channels);
    json_object_set_new(object, "model_kind", json_string(model->ops->kind));
    json_object_set_new(object, "model_channels", channels);
    json_t *halves = json_array();
    for (int h = 0; h < GONIO_HALVES; h++) {
        if (r->halves >> h & 1) {
            json_array_append_new(halves, json_string(gonio_half_name((gonio_half)h)));
        }
    }
    json_object_set_new(object, "halves", halves);
    json_object_set_new(object, "lost", cli_json_text(r->lost));
    json_object_set_new(object, "read_back",
                        json_pack("{s:s,s:I,s:o,s:o,s:o}", "at",
                                  r->at_its_nodes ? "the file's nodes" : "random pairs up to 80 deg", "pairs",
                                  (json_int_t)r->pairs, "median", cli_json_real(r->median), "p95",
                                  cli_json_real(r->p95), "largest", cli_json_real(r->largest)));
    json_object_set_new(object, "albedo", albedo);
    json_object_set_new(object, "picture_mean_8bit", cli_json_real(image));
    return object;
}

static gonio_status store(const json_t *report, const char *path, gonio_error *error) {
    gonio_output *output;
    const gonio_status status = gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    json_dumpf(report, gonio_output_stream(output), JSON_INDENT(2) | JSON_REAL_PRECISION(6));
    fputc('\n', gonio_output_stream(output));
    return gonio_output_commit(output, error);
}

static void print_report(const gonio_write_report *r, double image) {
    fprintf(stderr, "  %s\n  read back at %zu %s: median %.2g, p95 %.2g, largest %.2g\n", r->about, r->pairs,
            r->at_its_nodes ? "nodes of its own" : "pairs up to 80 deg", r->median, r->p95, r->largest);
    if (!r->at_its_nodes) {
        fprintf(stderr, "  albedo");
        for (int k = 0; k < GONIO_WRITE_TILTS; k++) {
            fprintf(stderr, "%s %+.2g %% at %g deg", k > 0 ? "," : "", 100 * r->albedo_error[k], r->tilt_deg[k]);
        }
        if (isfinite(image)) {
            fprintf(stderr, "; picture off by %.2g of 255", image);
        }
        fputc('\n', stderr);
    }
    if (r->lost[0] != 0) {
        fprintf(stderr, "  lost: %s\n", r->lost);
    }
}

gonio_status cli_export_table_file(const gonio_model *model, const char *source, const char *path, const char *format,
                                   const gonio_write_options *options, const json_t *fitted, cli_export_result *out,
                                   gonio_error *error) {
    out->json = NULL;
    out->image = NAN;
    const gonio_status status = gonio_write_table_as(model, path, format, options, &out->report, error);
    if (status != GONIO_OK || out->report.pairs == 0) {
        return status;
    }
    out->image = picture(model, path, &out->report, options->threads);
    out->json = report_json(&out->report, model, source, out->image);
    if (fitted != NULL) { // samples, which the model was made of
        json_object_set_new(out->json, "fitted", json_deep_copy(fitted));
    }
    char name[4096];
    snprintf(name, sizeof name, "%s.report.json", path);
    return store(out->json, name, error);
}

gonio_status cli_export_model(const gonio_model *model, const char *source, const char *path, const char *format,
                              const cli_export *out, const cli_common *common, json_t *result, gonio_error *error) {
    const gonio_write_options options = options_of(out, common);
    if (out->half != NULL && strcmp(out->half, gonio_half_name(options.half)) != 0) {
        return gonio_fail(error, GONIO_E_USAGE, "half: expected reflection or transmission, found '%s'", out->half);
    }
    if (out->no_report) {
        return gonio_write_table_as(model, path, format, &options, NULL, error);
    }
    cli_export_result written;
    const gonio_status status = cli_export_table_file(model, source, path, format, &options,
                                                      json_object_get(result, "fitted"), &written, error);
    if (written.json != NULL) {
        if (!common->json) {
            print_report(&written.report, written.image);
        }
        json_object_set_new(result, "report", written.json);
    }
    return status;
}
