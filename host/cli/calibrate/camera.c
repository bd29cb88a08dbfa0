// SPDX-License-Identifier: BSD-3-Clause
// gonio calibrate camera: photographs of a board -> intrinsics with uncertainties, as a rig file's [camera] section.
#include <stdio.h>
#include <stdlib.h>

#include "gonio/output.h"
#include "host/cli/calibrate/calibrate.h"

#define IMAGES_MAX 512

static const char *const keys[9] = {"fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "p1", "p2", "k3"};

typedef struct settings {
    calibrate_board board;
    const char *out;
} settings;

typedef struct work {
    int n, width, height;
    const char *paths[IMAGES_MAX];
    gonio_corners *corners;
    gonio_view *views;
    gonio_camera_calibration found;
} work;

// Find the board in one image; a view without it is no failure, but an unreadable file is.
static gonio_status look(work *w, int i, const gonio_board *board, int half_window, gonio_error *error) {
    gonio_image image;
    gonio_status status = gonio_image_read(w->paths[i], true, &image, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_error why = {0};
    if (w->width == 0) {
        w->width = image.width;
        w->height = image.height;
    }
    if (image.width != w->width || image.height != w->height) {
        snprintf(w->views[i].reason, sizeof w->views[i].reason, "%d x %d pixels; the first image has %d x %d",
                 image.width, image.height, w->width, w->height);
    } else {
        status = gonio_board_find(&image, board, half_window, &w->corners[i], &why);
        snprintf(w->views[i].reason, sizeof w->views[i].reason, "%.150s", why.message);
    }
    gonio_image_free(&image);
    if (status == GONIO_E_INPUT) {
        return GONIO_OK;
    }
    if (status != GONIO_OK) {
        *error = why;
    }
    return status;
}

static gonio_status write_ini(const work *w, const char *path, gonio_error *error) {
    gonio_output *output;
    gonio_status status = gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    FILE *stream = gonio_output_stream(output);
    fprintf(stream, "# gonio calibrate camera: %d views of %d, rms %.4f px\n[camera]\nwidth = %d\nheight = %d\n",
            w->found.views_used, w->n, w->found.rms, w->width, w->height);
    for (int k = 0; k < 9; k++) {
        fprintf(stream, "%s = %.10g ; +- %.2g\n", keys[k], w->found.value[k], w->found.sigma[k]);
    }
    return gonio_output_commit(output, error);
}

static json_t *as_json(const work *w) {
    json_t *parameters = json_object(), *sigmas = json_object(), *views = json_array();
    for (int k = 0; k < 9; k++) {
        json_object_set_new(parameters, keys[k], cli_json_real(w->found.value[k]));
        json_object_set_new(sigmas, keys[k], cli_json_real(w->found.sigma[k]));
    }
    for (int i = 0; i < w->n; i++) {
        const gonio_view *v = &w->views[i];
        json_t *view = json_pack("{s:s,s:b,s:i}", "file", w->paths[i], "used", v->used, "corners", w->corners[i].n);
        json_object_set_new(view, v->used ? "rms_px" : "reason",
                            v->used ? cli_json_real(v->rms) : json_string(v->reason));
        json_array_append_new(views, view);
    }
    return json_pack("{s:i,s:i,s:i,s:o,s:o,s:o,s:o}", "width", w->width, "height", w->height, "views_used",
                     w->found.views_used, "rms_px", cli_json_real(w->found.rms), "parameters", parameters, "sigma",
                     sigmas, "views", views);
}

static void print(const work *w) {
    for (int i = 0; i < w->n; i++) {
        const gonio_view *v = &w->views[i];
        if (v->used) {
            printf("%-40s %4d corners  rms %.3f px\n", cli_text(w->paths[i]), w->corners[i].n, v->rms);
        } else {
            printf("%-40s rejected: %s\n", cli_text(w->paths[i]), v->reason);
        }
    }
    printf("%d of %d views, rms %.4f px\n", w->found.views_used, w->n, w->found.rms);
    for (int k = 0; k < 9; k++) {
        printf("%-6s %14.6g +- %.2g\n", keys[k], w->found.value[k], w->found.sigma[k]);
    }
}

static gonio_status calibrate(work *w, const settings *s, gonio_error *error) {
    gonio_board board;
    gonio_status status = calibrate_board_parse(&s->board, &board, error);
    w->corners = calloc((size_t)w->n, sizeof *w->corners);
    w->views = calloc((size_t)w->n, sizeof *w->views);
    if (status == GONIO_OK && (w->corners == NULL || w->views == NULL)) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %d views", w->n);
    }
    for (int i = 0; status == GONIO_OK && i < w->n; i++) {
        status = look(w, i, &board, s->board.half_window, error);
    }
    if (status == GONIO_OK) {
        status = gonio_camera_calibrate(w->n, w->corners, w->width, w->height, w->views, &w->found, error);
    }
    return status == GONIO_OK && s->out != NULL ? write_ini(w, s->out, error) : status;
}

int calibrate_camera(int argc, char **argv) {
    settings s = {.board = {.chessboard = "9x6", .square_mm = 25, .dictionary = 5, .half_window = 5}};
    const cli_option options[] = {CALIBRATE_BOARD_OPTIONS(s.board, "25"),
                                  {"out", 'o', CLI_OUTPUT, &s.out, NULL, "INI", "write a rig file's [camera] section"},
                                  {0}};
    static const cli_verb verb = {"calibrate camera", "IMAGE ... [-o INI]",
                                  "intrinsics and distortion from photographs of a board", NULL};
    work w = {0};
    cli_common common;
    if (!cli_parse(&verb, options, argc, argv, w.paths, 1, IMAGES_MAX, &w.n, &common)) {
        return 2;
    }
    gonio_error error = {.line = -1, .byte = -1};
    const gonio_status status = calibrate(&w, &s, &error);
    int exit_status = 0;
    if (status != GONIO_OK) {
        for (int i = 0; w.views != NULL && i < w.n; i++) {
            if (w.views[i].reason[0] != '\0') {
                fprintf(stderr, "%s: %s\n", cli_text(w.paths[i]), w.views[i].reason);
            }
        }
        exit_status = cli_fail(&common, &error);
    } else if (common.json) {
        exit_status = cli_json(as_json(&w));
    } else {
        print(&w);
    }
    free(w.corners);
    free(w.views);
    return exit_status;
}
