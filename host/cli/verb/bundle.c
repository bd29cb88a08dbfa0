// SPDX-License-Identifier: BSD-3-Clause
// gonio bundle: one folder for colleagues, of a model in every format, with scenes, pictures and a report. It appears
// whole or not at all.
#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/text.h"
#include "gonio/version.h"
#include "host/cli/apart.h"
#include "host/cli/bundle/bundle.h"
#include "host/cli/model_input.h"
#include "host/session/folder.h"

#define SAMPLED "nusselt:2000"

// ---- the parts ----

static gonio_status put_samples(cli_bundle *b, gonio_error *error) {
    char path[CLI_BUNDLE_PATH];
    gonio_samples *made = NULL;
    gonio_status status =
        b->samples != NULL ? GONIO_OK : cli_model_sampled(b->model, NULL, SAMPLED, b->common, &made, error);
    if (status == GONIO_OK) {
        const gonio_samples *samples = b->samples != NULL ? b->samples : made;
        snprintf(path, sizeof path, "%s/samples.csv", b->folder);
        b->sampled = samples->n;
        status = gonio_write_samples(samples, path, error);
    }
    gonio_samples_free(made);
    return status;
}

// A table that was read is no model file; its samples and its formats stand for it.
static gonio_status put_model(cli_bundle *b, gonio_error *error) {
    char path[CLI_BUNDLE_PATH];
    gonio_error own = {.line = -1, .byte = -1};
    snprintf(path, sizeof path, "%s/model.gonio", b->folder);
    const gonio_status status = gonio_model_save(b->model, path, &own);
    b->has_model = status == GONIO_OK;
    if (status != GONIO_OK && status != GONIO_E_UNSUPPORTED) {
        *error = own;
        return status;
    }
    return GONIO_OK;
}

static gonio_status put_pictures(cli_bundle *b, gonio_error *error) {
    static const char *const shown[][2] = {{"rgl", "rgl-rgb.bsdf"},
                                           {"merl", "merl.binary"},
                                           {"radiance", "radiance-tree.xml"},
                                           {"radiance", "radiance-klems.xml"}};
    enum { SHOWN = sizeof shown / sizeof *shown };
    const gonio_model *models[1 + SHOWN] = {b->model};
    gonio_model *read[SHOWN] = {NULL};
    gonio_render_options options;
    gonio_render_result result;
    char path[CLI_BUNDLE_PATH];
    int n = 1;
    gonio_render_options_default(&options);
    options.threads = b->common->threads;
    options.width = options.height = b->side;
    snprintf(path, sizeof path, "%s/pictures/sphere.png", b->folder);
    gonio_status status = gonio_render(models, 1, &options, path, &result, error);
    b->exposure_ev = status == GONIO_OK ? result.exposure_ev : 0;
    for (int k = 0; k < SHOWN && status == GONIO_OK; k++) {
        if (cli_bundle_find(b, shown[k][0], shown[k][1]) != NULL) {
            snprintf(path, sizeof path, "%s/formats/%s", b->folder, shown[k][1]);
            status = gonio_read_table(path, &read[k], error);
            models[n++] = read[k];
            gonio_text_append(b->strip, sizeof b->strip, "%s`%s`", n > 2 ? ", " : "the model, ", shown[k][1]);
        }
    }
    options.exposure_auto = false;
    options.exposure_ev = b->exposure_ev;
    options.width = options.height = b->side > 32 ? b->side / 2 : b->side;
    snprintf(path, sizeof path, "%s/pictures/formats.png", b->folder);
    if (status == GONIO_OK && n > 1) {
        status = gonio_render(models, n, &options, path, &result, error);
    }
    for (int k = 0; k < SHOWN; k++) {
        gonio_model_free(read[k]);
    }
    return status;
}

static json_t *report_of(const cli_bundle *b) {
    json_t *files = json_array();
    for (int k = 0; k < b->n; k++) {
        const cli_bundle_file *f = &b->files[k];
        json_t *file = json_pack("{s:s,s:s,s:b}", "format", f->format, "file", f->name, "written", (int)f->written);
        if (!f->written) {
            json_object_set_new(file, "refused", json_string(f->refused));
        } else if (f->result.json != NULL) {
            json_object_set(file, "report", f->result.json);
        }
        json_array_append_new(files, file);
    }
    json_t *report =
        json_pack("{s:s,s:s,s:s,s:b,s:i,s:b,s:I,s:f,s:s,s:o}", "written_by", "Gonio " GONIO_VERSION, "source",
                  b->source, "model_kind", b->model->ops->kind, "isotropic", (int)b->model->isotropic, "channels",
                  b->model->channels, "model_file", (int)b->has_model, "samples", (json_int_t)b->sampled, "picture_ev",
                  b->exposure_ev, "about", b->model->about != NULL ? b->model->about : "", "formats", files);
    if (b->fitted != NULL) {
        json_object_set_new(report, "fitted", json_deep_copy(b->fitted));
    }
    return report;
}

static gonio_status put_report(const cli_bundle *b, const json_t *report, gonio_error *error) {
    gonio_output *output;
    const gonio_status status = cli_bundle_open(b, "report.json", &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    json_dumpf(report, gonio_output_stream(output), JSON_INDENT(2) | JSON_REAL_PRECISION(6));
    fputc('\n', gonio_output_stream(output));
    return cli_bundle_close(output, "report.json", error);
}

static gonio_status fill(cli_bundle *b, const char *list, json_t **report, gonio_error *error) {
    static const char *const folders[] = {"formats", "pictures", "scenes"};
    char path[CLI_BUNDLE_PATH];
    for (size_t k = 0; k < sizeof folders / sizeof *folders; k++) {
        snprintf(path, sizeof path, "%s/%s", b->folder, folders[k]);
        if (mkdir(path, 0777) != 0) {
            return gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot make it: %s", strerror(errno));
        }
    }
    gonio_status status = put_model(b, error);
    status = status == GONIO_OK ? put_samples(b, error) : status;
    status = status == GONIO_OK ? cli_bundle_formats(b, list, error) : status;
    status = status == GONIO_OK ? put_pictures(b, error) : status;
    status = status == GONIO_OK ? cli_bundle_scenes(b, error) : status;
    status = status == GONIO_OK ? cli_bundle_frame(b, error) : status;
    status = status == GONIO_OK ? cli_bundle_readme(b, error) : status;
    *report = status == GONIO_OK ? report_of(b) : NULL;
    return status == GONIO_OK ? put_report(b, *report, error) : status;
}

// ---- the folder ----

// Beside the folder that it becomes, under a name of its own.
static gonio_status make_folder(const char *path, char made[CLI_BUNDLE_FOLDER], gonio_error *error) {
    char parent[CLI_BUNDLE_FOLDER], name[CLI_BUNDLE_FOLDER];
    snprintf(parent, sizeof parent, "%s", path);
    snprintf(name, sizeof name, "%s", path);
    const char *folder = dirname(parent), *base = basename(name);
    for (long k = 0; k < 100; k++) {
        if (snprintf(made, CLI_BUNDLE_FOLDER, "%s/.%s.%ld.new", folder, base, (long)getpid() + k) >=
            CLI_BUNDLE_FOLDER) {
            errno = ENAMETOOLONG;
            break;
        }
        if (mkdir(made, 0777) == 0) {
            return GONIO_OK;
        }
        if (errno != EEXIST) {
            break;
        }
    }
    return gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot make it: %s", strerror(errno));
}

static gonio_status give_name(const char *made, const char *path, gonio_error *error) {
    const int fd = gonio_folder_open(AT_FDCWD, made);
    bool good = fd >= 0 && gonio_folder_sync(fd) == 0 && gonio_folder_rename(AT_FDCWD, made, AT_FDCWD, path) == 0;
    const int why = errno;
    if (fd >= 0) {
        close(fd);
    }
    return good ? GONIO_OK : gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot write it: %s", strerror(why));
}

static gonio_status bundle(const char *path, cli_bundle *b, const char *list, json_t **report, gonio_error *error) {
    char made[CLI_BUNDLE_FOLDER];
    gonio_status status = make_folder(path, made, error);
    if (status != GONIO_OK) {
        return status;
    }
    b->folder = made;
    status = fill(b, list, report, error);
    status = status == GONIO_OK ? give_name(made, path, error) : status;
    if (status != GONIO_OK) {
        gonio_folder_discard(AT_FDCWD, made);
    }
    for (int k = 0; k < b->n; k++) {
        json_decref(b->files[k].result.json);
    }
    return status;
}

// ---- the verb ----

typedef struct request {
    const char *name, *formats;
    int side;
    size_t max_bytes;
    cli_input input;
} request;

static gonio_status work(const request *r, const char *path, const cli_common *common, json_t **report,
                         gonio_error *error) {
    static cli_bundle b; // of some size
    json_t *fitted = json_object();
    gonio_model *model;
    gonio_samples *samples;
    gonio_status status = cli_model_read(r->name, &r->input, common, fitted, &model, &samples, error);
    if (status == GONIO_OK) {
        b = (cli_bundle){.model = model,
                         .samples = samples,
                         .source = r->name,
                         .side = r->side,
                         .max_bytes = r->max_bytes,
                         .common = common,
                         .fitted = json_object_get(fitted, "fitted")};
        cli_catch_interrupts();
        status = bundle(path, &b, r->formats, report, error);
    }
    gonio_model_free(model);
    gonio_samples_free(samples);
    json_decref(fitted);
    return status;
}

static bool is_free(const cli_common *common, char *path) {
    struct stat facts;
    for (size_t n = strlen(path); n > 1 && path[n - 1] == '/'; n--) {
        path[n - 1] = 0;
    }
    if (lstat(path, &facts) == 0) {
        cli_usage(common, "bundle: %s is there already; name a folder to be made", path);
        return false;
    }
    return cli_apart(common, path);
}

static int run(int argc, char **argv) {
    request r = {.side = 384};
    const char *names[2];
    const cli_option options[] = {
        {"formats", 0, CLI_TEXT, &r.formats, NULL, "LIST",
         "only these, with commas between them, as `gonio formats` has them (all)"},
        {"size", 0, CLI_INT, &r.side, NULL, "N", "pixels of pictures and scenes, 16 to 8192 (384)"},
        {"max-bytes", 0, CLI_SIZE, &r.max_bytes, NULL, "N",
         "of each table whose size can be chosen (each format's own)"},
        CLI_INPUT_OPTIONS(r.input),
        {0}};
    extern const cli_verb cmd_bundle;
    cli_common common;
    int count;
    char path[CLI_BUNDLE_FOLDER];
    gonio_error error = {.line = -1, .byte = -1};
    if (!cli_parse(&cmd_bundle, options, argc, argv, names, 2, 2, &count, &common)) {
        return 2;
    }
    r.name = names[0];
    snprintf(path, sizeof path, "%s", names[1]);
    if (!is_free(&common, path)) {
        return 2;
    }
    if (r.side < 16 || r.side > 8192) {
        return cli_usage(&common, "bundle: --size: expected 16 to 8192, found %d", r.side);
    }
    json_t *report = NULL;
    gonio_status status = cli_bundle_check_list(r.formats, &error);
    status = status == GONIO_OK ? work(&r, path, &common, &report, &error) : status;
    if (status != GONIO_OK) {
        json_decref(report);
        return cli_fail(&common, &error);
    }
    if (common.json) {
        return cli_json(report);
    }
    json_decref(report);
    printf("%s: README.md tells what is in it\n", cli_text(path));
    return 0;
}

const cli_verb cmd_bundle = {"bundle", "MODEL|INPUT DIR [options]",
                             "a folder for colleagues: the model, samples, every format with its report, pictures, "
                             "scenes for Mitsuba, pbrt, Radiance, Blender and three.js",
                             run};
