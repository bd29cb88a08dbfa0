// SPDX-License-Identifier: BSD-3-Clause
// Spheres before and after a transform, and their difference, pixel by pixel.
#include "host/cli/check_pictures.h"

#include <cairo.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "gonio/output.h"
#include "gonio/render.h"

enum { SIDE = 320, AMPLIFIED = 8 };
static const double lobe_theta_deg = 50; // DeYoung's figures 5.1 and 5.3

// The model, lent to a transform, which frees what it is given.
typedef struct lent {
    gonio_model head;
    const gonio_model *model;
} lent;

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    gonio_model_eval(((const lent *)model)->model, wi, wo, values);
}
static void give_back(gonio_model *model) { free(model); }
static const gonio_model_ops lent_ops = {.kind = "lent", .eval = eval, .free = give_back};

static gonio_model *lend(const gonio_model *model) {
    lent *l = malloc(sizeof *l);
    if (l == NULL) {
        return NULL;
    }
    *l = (lent){*model, model};
    l->head.ops = &lent_ops;
    l->head.about = NULL; // the model's own, which is not lent
    return &l->head;
}

static cairo_status_t write_bytes(void *closure, const unsigned char *data, unsigned int length) {
    return fwrite(data, 1, length, closure) == length ? CAIRO_STATUS_SUCCESS : CAIRO_STATUS_WRITE_ERROR;
}

// Both tiles of the strip stand at its ends. The difference goes over the left one.
static void subtract(cairo_surface_t *strip, cairo_surface_t *out, cli_picture_error *e) {
    const int width = cairo_image_surface_get_width(strip), step = cairo_image_surface_get_stride(strip);
    const int out_step = cairo_image_surface_get_stride(out);
    const unsigned char *data = cairo_image_surface_get_data(strip);
    unsigned char *to = cairo_image_surface_get_data(out);
    double sum = 0, squares = 0;
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            const unsigned char *a = data + y * step + 4 * x, *b = data + y * step + 4 * (width - SIDE + x);
            for (int c = 0; c < 3; c++) {
                const int d = b[c] - a[c];
                sum += abs(d);
                squares += d * d;
                e->largest = fmax(e->largest, abs(d));
                to[y * out_step + 4 * x + c] = (unsigned char)fmin(fmax(128 + AMPLIFIED * d, 0), 255);
            }
        }
    }
    e->mean = sum / (3.0 * SIDE * SIDE);
    e->rms = sqrt(squares / (3.0 * SIDE * SIDE));
}

static gonio_status difference(const char *strip_path, const char *path, cli_picture_error *e, gonio_error *error) {
    cairo_surface_t *strip = cairo_image_surface_create_from_png(strip_path);
    cairo_surface_t *out = cairo_image_surface_create(CAIRO_FORMAT_RGB24, SIDE, SIDE);
    gonio_output *output = NULL;
    gonio_status status = GONIO_OK;
    if (cairo_surface_status(strip) != CAIRO_STATUS_SUCCESS || cairo_surface_status(out) != CAIRO_STATUS_SUCCESS ||
        cairo_image_surface_get_width(strip) < 2 * SIDE || cairo_image_surface_get_height(strip) != SIDE) {
        status = gonio_fail_line(error, GONIO_E_IO, strip_path, -1, "cannot read the picture back");
    } else {
        subtract(strip, out, e);
        cairo_surface_mark_dirty(out);
        status = gonio_output_open(path, &output, error);
    }
    if (status == GONIO_OK &&
        cairo_surface_write_to_png_stream(out, write_bytes, gonio_output_stream(output)) != CAIRO_STATUS_SUCCESS) {
        gonio_output_abandon(output);
        status = gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot write the picture");
    } else if (status == GONIO_OK) {
        status = gonio_output_commit(output, error);
    }
    cairo_surface_destroy(out);
    cairo_surface_destroy(strip);
    return status;
}

static gonio_status show_change(const char *folder, const gonio_model *model, const gonio_change *change, int threads,
                                cli_picture_error *e, gonio_error *error) {
    char path[600], other[600];
    if (change->kind == GONIO_CHANGE_SEPARABLE) {
        snprintf(e->name, sizeof e->name, "separable-%d", change->products);
    } else {
        snprintf(e->name, sizeof e->name, "%s", gonio_change_name(change->kind));
    }
    gonio_model *after = lend(model);
    gonio_status status = after != NULL ? gonio_check_change_model(after, change, threads, &after, error)
                                        : gonio_fail(error, GONIO_E_MEMORY, "no memory for a model");
    if (status != GONIO_OK) {
        return status;
    }
    const gonio_model *both[2] = {model, after};
    gonio_render_options options;
    gonio_render_options_default(&options);
    options.width = options.height = SIDE;
    options.threads = threads;
    snprintf(path, sizeof path, "%s/%s.png", folder, e->name);
    snprintf(other, sizeof other, "%s/%s-difference.png", folder, e->name);
    status = gonio_render(both, 2, &options, path, NULL, error);
    status = status == GONIO_OK ? difference(path, other, e, error) : status;
    snprintf(path, sizeof path, "%s/%s-lobe", folder, e->name);
    status = status == GONIO_OK ? cli_plot_lobes(path, model, after, gonio_radians(lobe_theta_deg), error) : status;
    gonio_model_free(after);
    return status;
}

gonio_status cli_check_pictures(const char *folder, const gonio_model *model, const gonio_change *changes, int n,
                                const gonio_check_report *report, int threads, cli_picture_error *errors,
                                gonio_error *error) {
    char path[600];
    if (mkdir(folder, 0777) != 0 && errno != EEXIST) {
        return gonio_fail_line(error, GONIO_E_IO, folder, -1, "cannot make the folder: %s", strerror(errno));
    }
    if (strlen(folder) > 500) {
        return gonio_fail_line(error, GONIO_E_USAGE, folder, -1, "the folder's name is too long");
    }
    snprintf(path, sizeof path, "%s/albedo", folder);
    gonio_status status = cli_plot_albedo(path, report, error);
    snprintf(path, sizeof path, "%s/separability", folder);
    status = status == GONIO_OK ? cli_plot_separability(path, report, error) : status;
    for (int k = 0; k < n && status == GONIO_OK; k++) {
        errors[k] = (cli_picture_error){0};
        status = show_change(folder, model, &changes[k], threads, &errors[k], error);
    }
    return status;
}
