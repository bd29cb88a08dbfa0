// SPDX-License-Identifier: BSD-3-Clause
// gonio calibrate rig: the true axes of both arms, from frames that a rig takes of itself or from a list of frames.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/keys.h"
#include "host/cli/calibrate/calibrate.h"

#define HEADER "file,object,light_theta,light_phi,camera_theta,camera_phi"
#define VIEWS_MAX 4096

static const char *const axis_names[4] = {"light_theta", "light_phi", "camera_theta", "camera_phi"};

// ---- frames from a list ----

static gonio_status parse_row(const gonio_text *text, char *line, char **file, gonio_rig_view *view,
                              gonio_error *error) {
    char *fields[6];
    double deg[4];
    if (gonio_text_split(line, ',', fields, 6) != 6) {
        return gonio_text_fail(text, error, "expected a row of " HEADER);
    }
    *file = fields[0];
    const int object = gonio_names_find(calibrate_rig_objects, fields[1]);
    if (object < 0) {
        return gonio_text_fail(text, error, "found '%s', expected board, ball or mirror", fields[1]);
    }
    gonio_status status = GONIO_OK;
    for (int a = 0; status == GONIO_OK && a < 4; a++) {
        status = gonio_text_number(text, fields[2 + a], axis_names[a], &deg[a], error);
        if (status == GONIO_OK && fabs(deg[a]) > 720) {
            status = gonio_text_fail(text, error, "%s: found %g, expected degrees", axis_names[a], deg[a]);
        }
    }
    if (status == GONIO_OK) {
        *view = (gonio_rig_view){
            .axes = {gonio_radians(deg[0]), gonio_radians(deg[1]), gonio_radians(deg[2]), gonio_radians(deg[3])},
            .object = (gonio_rig_object)object};
    }
    return status;
}

static gonio_status look_at_file(const calibrate_rig_request *request, calibrate_rig_views *views,
                                 const gonio_text *text, const char *folder, const char *file, gonio_error *error) {
    char path[1024];
    gonio_image image;
    gonio_status status = calibrate_list_path(request->common, text, folder, file, path, error);
    status = status == GONIO_OK ? gonio_image_read(path, true, &image, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    const int i = views->n++;
    snprintf(views->names[i], sizeof views->names[i], "%.60s", file);
    if (image.width != views->camera.width || image.height != views->camera.height) {
        status = gonio_text_fail(text, error, "%s: %d x %d pixels, the camera's file says %d x %d", file, image.width,
                                 image.height, views->camera.width, views->camera.height);
    } else {
        status = calibrate_rig_look(request, &image, &views->items[i], &views->corners[i], error);
    }
    gonio_image_free(&image);
    return status;
}

static gonio_status read_rows(gonio_text *text, const char *folder, const calibrate_rig_request *request,
                              calibrate_rig_views *views, gonio_error *error) {
    static const char *const header[] = {"file",         "object",     "light_theta", "light_phi",
                                         "camera_theta", "camera_phi", NULL};
    char *line = gonio_text_row(text), *file = NULL, *fields[6];
    const int columns = line != NULL ? gonio_text_split(line, ',', fields, 6) : 0;
    if (!gonio_text_is_header(fields, columns, header)) {
        return gonio_text_fail(text, error, "found %d columns, '%.60s' the first; expected the header " HEADER, columns,
                               columns > 0 ? fields[0] : "");
    }
    gonio_status status = GONIO_OK;
    while (status == GONIO_OK && (line = gonio_text_row(text)) != NULL) {
        status = views->n < VIEWS_MAX ? parse_row(text, line, &file, &views->items[views->n], error)
                                      : gonio_text_fail(text, error, "more than %d frames", VIEWS_MAX);
        status = status == GONIO_OK ? look_at_file(request, views, text, folder, file, error) : status;
    }
    return status;
}

static gonio_status from_list(const char *path, calibrate_rig_request *request, calibrate_rig_views *views,
                              gonio_error *error) {
    if (request->camera == NULL) {
        return gonio_fail(error, GONIO_E_USAGE,
                          "--camera: the camera's intrinsics (gonio calibrate camera -o) are needed");
    }
    char *folder;
    gonio_text text;
    gonio_status status = calibrate_camera_read(request->camera, &views->camera, request->options.camera_sigma, error);
    status = status == GONIO_OK ? calibrate_rig_room(views, VIEWS_MAX, error) : status;
    status = status == GONIO_OK ? calibrate_list_read(path, &folder, &text, error) : status;
    if (status == GONIO_OK) {
        status = read_rows(&text, folder, request, views, error);
        gonio_text_free(&text);
        free(folder);
    }
    return status;
}

// ---- results ----

static json_t *as_json(const gonio_rig_report *r, const calibrate_rig_views *views, const char *out) {
    json_t *axes = json_object(), *left_out = json_array(), *counts = json_object(), *noise = json_object();
    for (int k = 0; k < 4; k++) {
        json_object_set_new(axes, axis_names[k],
                            json_pack("{s:f,s:f,s:f}", "tilt_deg", r->tilt_deg[k], "sigma_deg", r->tilt_sigma_deg[k],
                                      "range_deg", r->range_deg[k]));
    }
    for (int k = 0; k < GONIO_RIG_OBJECTS; k++) {
        json_object_set_new(counts, calibrate_rig_objects[k], json_integer(r->views[k]));
        json_object_set_new(noise, calibrate_rig_objects[k], cli_json_real(r->noise_px[k]));
    }
    for (int i = 0; i < views->n; i++) {
        if (!views->items[i].used) {
            json_array_append_new(left_out,
                                  json_pack("{s:s,s:s}", "frame", views->names[i], "reason", views->items[i].reason));
        }
    }
    return json_pack("{s:o,s:o,s:o,s:[f,f],s:f,s:o,s:s?}", "views", counts, "noise_px", noise, "axes", axes,
                     "origin_mm", r->origin_mm[0], r->origin_mm[1], "direction_sigma_deg", r->direction_sigma_deg,
                     "left_out", left_out, "output", out);
}

static void print(const gonio_rig_report *r, const calibrate_rig_views *views) {
    for (int i = 0; i < views->n; i++) {
        if (!views->items[i].used) {
            printf("%-16s left out: %s\n", cli_text(views->names[i]), views->items[i].reason);
        }
    }
    for (int k = 0; k < GONIO_RIG_OBJECTS; k++) {
        if (r->views[k] > 0) {
            printf("%-14s %3d frames, noise %.3f px\n", calibrate_rig_objects[k], r->views[k], r->noise_px[k]);
        }
    }
    for (int k = 0; k < 4; k++) {
        printf("%-14s %8.4f deg off its nominal direction, +- %.4f deg%s\n", axis_names[k], r->tilt_deg[k],
               r->tilt_sigma_deg[k], r->range_deg[k] < 10 ? " (it hardly moved)" : "");
    }
    printf("%-14s at (%.3f, %.3f) mm from the board's first corner\n", "origin", r->origin_mm[0], r->origin_mm[1]);
    printf("%-14s +- %.4f deg\n", "directions", r->direction_sigma_deg);
}

static gonio_status run(const char *list, calibrate_rig_request *request, const char *out, calibrate_rig_views *views,
                        gonio_rig_report *report, gonio_error *error) {
    gonio_alignment found;
    request->options.reversible = request->board.kind == GONIO_CHESSBOARD;
    gonio_status status =
        list != NULL ? from_list(list, request, views, error) : calibrate_rig_take(request, views, error);
    if (status == GONIO_OK) {
        status = gonio_rig_calibrate(&views->camera, &request->options, views->n, views->items, &found, report, error);
    }
    return status == GONIO_OK && out != NULL ? gonio_alignment_write(&found, out, error) : status;
}

int calibrate_rig(int argc, char **argv) {
    calibrate_board board = {.square_mm = 5, .dictionary = 5, .half_window = 5};
    calibrate_rig_request request = {0};
    gonio_rig_options *o = &request.options;
    const char *out = NULL, *list = NULL;
    gonio_rig_options_default(o);
    const cli_option options[] = {
        CLI_RIG_OPTIONS(request.rig),
        CALIBRATE_BOARD_OPTIONS(board, "5"),
        {"azimuth-deg", 0, CLI_DOUBLE, &o->board_azimuth_deg, NULL, "DEG", "of the board's right side from +x (0)"},
        {"ball-radius-mm", 0, CLI_DOUBLE, &o->ball_radius_mm, NULL, "MM", "of the polished ball (20)"},
        {"camera", 0, CLI_TEXT, &request.camera, NULL, "INI", "intrinsics, as calibrate camera -o writes them"},
        {"light-mm", 0, CLI_DOUBLE, &o->light_distance_mm, NULL, "MM", "with a LIST: the light's distance (1000)"},
        {"camera-mm", 0, CLI_DOUBLE, &o->camera_distance_mm, NULL, "MM", "with a LIST: the camera's distance (1000)"},
        {"pointing-deg", 0, CLI_DOUBLE, &o->pointing_random_deg, NULL, "DEG", "with a LIST: repeatability (0.01)"},
        {"save", 0, CLI_TEXT, &request.save, NULL, "FOLDER", "keep the frames and their LIST there"},
        {"out", 'o', CLI_OUTPUT, &out, NULL, "CSV", "write the alignment: [rig] alignment = CSV"},
        {"yes", 'y', CLI_FLAG, &request.yes, NULL, NULL, "do not wait for hands: the targets lie where they must"},
        {0}};
    static const cli_verb verb = {"calibrate rig", "[LIST.csv --camera INI | --rig sim|RIG.ini] [-o CSV]",
                                  "the true axes of the arms, from frames of a board, a ball and a mirror", NULL};
    int count;
    cli_common common;
    if (!cli_parse(&verb, options, argc, argv, &list, 0, 1, &count, &common) ||
        !cli_apart_folder(&common, request.save, (const char *const[]){"frames.csv", NULL})) {
        return 2;
    }
    if (board.charuco == NULL && board.chessboard == NULL) {
        board.charuco = "8x6";
    }
    request.common = &common;
    list = count > 0 ? list : NULL;
    cli_rig_any_sample(&request.rig, &common);
    request.half_window = board.half_window;
    gonio_error error = {.line = -1, .byte = -1};
    calibrate_rig_views views = {0};
    gonio_rig_report report;
    cli_catch_interrupts();
    gonio_status status = calibrate_board_parse(&board, &request.board, &error);
    status = status == GONIO_OK ? run(list, &request, out, &views, &report, &error) : status;
    int exit_status = 0;
    if (status != GONIO_OK) {
        for (int i = 0; i < views.n; i++) {
            if (views.items[i].reason[0] != '\0') {
                fprintf(stderr, "%s: %s\n", cli_text(views.names[i]), views.items[i].reason);
            }
        }
        exit_status = cli_fail(&common, &error);
    } else if (common.json) {
        exit_status = cli_json(as_json(&report, &views, out));
    } else {
        print(&report, &views);
    }
    calibrate_rig_free(&views);
    return exit_status;
}
