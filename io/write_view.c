// SPDX-License-Identifier: BSD-3-Clause
// What writers of tables share: a model's channels as red, green and blue, its halves, and what the report says is
// lost.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "io/colour.h"
#include "io/format.h"

typedef struct rgb_view {
    gonio_model head;
    const gonio_model *model;
    gonio_colour_weights weights;
} rgb_view;

static void eval_rgb(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const rgb_view *v = (const rgb_view *)model;
    double own[v->model->channels];
    gonio_model_eval(v->model, wi, wo, own);
    gonio_colour_rgb(&v->weights, own, values);
}

static void release(gonio_model *model) {
    gonio_colour_free(&((rgb_view *)model)->weights);
    free(model);
}

static const gonio_model_ops rgb_ops = {.kind = "measured", .eval = eval_rgb, .free = release},
                             sheet_ops = {.kind = "measured", .eval = eval_rgb, .free = release, .both_sides = true};
static const char rgb_names[3][32] = {"r", "g", "b"};

gonio_status gonio_model_as_rgb(const gonio_model *model, gonio_model **view, gonio_error *error) {
    *view = (gonio_model *)(uintptr_t)model;
    bool named = model->channels == 3;
    for (int c = 0; named && c < 3; c++) {
        named = isnan(gonio_model_wavelength_nm(model, c));
    }
    if (named) {
        return GONIO_OK;
    }
    rgb_view *v = calloc(1, sizeof *v);
    if (v == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the colours of a model");
    }
    v->head = (gonio_model){.ops = model->ops->both_sides ? &sheet_ops : &rgb_ops,
                            .channels = 3,
                            .isotropic = model->isotropic,
                            .channel_names = rgb_names};
    v->model = model;
    const gonio_status status = gonio_colour_new(model->channels, model->channel_names, &v->weights, error);
    if (status != GONIO_OK) {
        free(v);
        *view = NULL;
        return status;
    }
    *view = &v->head;
    return GONIO_OK;
}

// ---- what is lost ----

void gonio_write_lost(gonio_write_report *report, const char *what) {
    const size_t used = strlen(report->lost);
    snprintf(report->lost + used, sizeof report->lost - used, "%s%s", used > 0 ? "; " : "", what);
}

void gonio_write_lost_channels(const gonio_model *model, int channels, gonio_write_report *report) {
    char text[128];
    if (model->ops->sigma != NULL) {
        gonio_write_lost(report, "the uncertainty");
    }
    if (channels == 3 && model->channels == 1) {
        gonio_write_lost(report, "nothing of the one channel, which stands three times");
    } else if (channels != model->channels) {
        snprintf(text, sizeof text, "the spectrum: of %d channels %s", model->channels,
                 channels == 3 ? "linear sRGB under equal-energy light" : "the mean");
        gonio_write_lost(report, text);
    }
}

const gonio_model *gonio_written_half(const gonio_model *model, const gonio_format_values *values, gonio_half half) {
    return model->ops->both_sides ? gonio_model_half(model, half) : half == values->half ? model : NULL;
}
