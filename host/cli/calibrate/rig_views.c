// SPDX-License-Identifier: BSD-3-Clause
// Frames that show a rig's axes: put board, ball and mirror on the table in turn and look at each from many poses.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "gonio/output.h"
#include "host/cli/calibrate/calibrate.h"

#define TIMEOUT_S 600
#define CAPTURE_MARGIN_S 10
#define SQUARE_PX 100 // of the picture that the simulator's board shows
// An image is well exposed where its brightest pixels lie in this range of full scale.
#define PEAK_LOW 0.3
#define PEAK_HIGH 0.95

const char *const calibrate_rig_objects[GONIO_RIG_OBJECTS + 1] = {"board", "ball", "mirror", NULL};

gonio_status calibrate_rig_room(calibrate_rig_views *views, int n, gonio_error *error) {
    views->items = calloc((size_t)n, sizeof *views->items);
    views->corners = calloc((size_t)n, sizeof *views->corners);
    views->names = calloc((size_t)n, sizeof *views->names);
    if (views->items == NULL || views->corners == NULL || views->names == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %d views", n);
    }
    return GONIO_OK;
}

void calibrate_rig_free(calibrate_rig_views *views) {
    free(views->items);
    free(views->corners);
    free(views->names);
    *views = (calibrate_rig_views){0};
}

gonio_status calibrate_rig_look(const calibrate_rig_request *request, const gonio_image *image, gonio_rig_view *view,
                                gonio_corners *corners, gonio_error *error) {
    gonio_error why = {.line = -1, .byte = -1};
    view->corners = corners;
    corners->n = 0;
    const gonio_status status = view->object == GONIO_RIG_BOARD
                                    ? gonio_board_find(image, &request->board, request->half_window, corners, &why)
                                    : gonio_highlight_find(image, view->highlight, &why);
    view->used = status == GONIO_OK;
    snprintf(view->reason, sizeof view->reason, "%.150s", why.message);
    if (status != GONIO_OK && status != GONIO_E_INPUT && error != NULL) {
        *error = why;
    }
    return status == GONIO_E_INPUT ? GONIO_OK : status;
}

typedef struct taking {
    calibrate_rig_request *request;
    calibrate_rig_views *views;
    gonio_rig *rig;
    gonio_image image;
    gonio_stamp stamp;
    double exposure_s[GONIO_RIG_OBJECTS]; // that the last frame of each object ended with
    FILE *list;
    cli_progress progress;
} taking;

// A colour mosaic becomes grey by the tent [1 2 1], which holds each colour in equal measure at every pixel.
static void smooth_mosaic(gonio_image *image) {
    const int w = image->width, h = image->height;
    uint16_t *row[3], *rows = malloc(3 * (size_t)w * sizeof *rows);
    if (rows == NULL) {
        return; // the pattern then shows as noise
    }
    for (int k = 0; k < 3; k++) {
        row[k] = rows + (size_t)k * (size_t)w;
    }
    for (int v = 0; v < h; v++) {
        for (int k = 0; k < 3; k++) {
            const int from = v + k - 1 < 0 ? 1 : v + k - 1 >= h ? h - 2 : v + k - 1;
            // Rows above have been smoothed already: what they were is still in the buffer.
            if (k == 2 || v == 0) {
                memcpy(row[k], image->pixels + (size_t)from * (size_t)w, (size_t)w * sizeof *rows);
            }
        }
        for (int u = 0; u < w; u++) {
            const int left = u > 0 ? u - 1 : 1, right = u + 1 < w ? u + 1 : w - 2;
            const int sum = row[0][left] + row[0][right] + row[2][left] + row[2][right] +
                            2 * (row[0][u] + row[2][u] + row[1][left] + row[1][right]) + 4 * row[1][u];
            image->pixels[(size_t)v * (size_t)w + (size_t)u] = (uint16_t)(sum / 16);
        }
        uint16_t *first = row[0];
        row[0] = row[1];
        row[1] = row[2];
        row[2] = first;
    }
    free(rows);
}

static gonio_status capture(taking *t, double exposure_s, double *peak, gonio_error *error) {
    const gonio_camera_info *camera = &t->views->camera;
    const gonio_window all = {0, 0, camera->width, camera->height};
    const size_t n = (size_t)camera->width * (size_t)camera->height;
    gonio_frame frame = {.pixels = t->image.pixels};
    const gonio_status status = t->rig->camera->capture(t->rig->camera_device, &all, exposure_s, 0, &t->stamp,
                                                        exposure_s + CAPTURE_MARGIN_S, &frame, error);
    t->image.pixels = frame.pixels;
    t->stamp.frame++;
    t->stamp.clock_s += exposure_s + camera->read_out_s;
    *peak = 0;
    for (size_t i = 0; status == GONIO_OK && i < n; i++) {
        *peak = fmax(*peak, t->image.pixels[i]);
    }
    return status;
}

static gonio_status expose(taking *t, gonio_rig_object object, gonio_error *error) {
    const gonio_camera_info *camera = &t->views->camera;
    const double full = (1 << camera->bits) - 1;
    double exposure_s = t->exposure_s[object] > 0 ? t->exposure_s[object] : fmax(camera->exposure_min_s, 1e-3);
    gonio_status status = GONIO_OK;
    for (int i = 0; status == GONIO_OK && i < 16; i++) {
        double peak;
        status = capture(t, exposure_s, &peak, error);
        t->exposure_s[object] = exposure_s;
        const double share = peak / full;
        if (share >= PEAK_LOW && share < PEAK_HIGH) {
            break;
        }
        const double factor = share >= PEAK_HIGH ? 0.25 : fmin(0.7 / fmax(share, 0.03), 8);
        const double next_s = fmin(fmax(exposure_s * factor, camera->exposure_min_s), fmin(camera->exposure_max_s, 1));
        if (next_s == exposure_s) {
            break;
        }
        exposure_s = next_s;
    }
    if (status == GONIO_OK && camera->pattern != GONIO_MONO) {
        smooth_mosaic(&t->image);
    }
    return status;
}

static gonio_status put_down(taking *t, gonio_rig_object object, gonio_error *error) {
    static const gonio_target targets[] = {GONIO_TARGET_FIDUCIAL, GONIO_TARGET_BALL, GONIO_TARGET_MIRROR};
    static const char *const names[] = {"board", "polished ball", "mirror"};
    cli_progress_end(&t->progress);
    if (t->rig->mount != NULL) {
        return t->rig->mount->mount(t->rig->mount_device, targets[object], error);
    }
    if (t->request->yes) {
        return GONIO_OK;
    }
    fprintf(stderr, "put the %s on the table, close the door, then press Enter ", names[object]);
    for (int c = getchar(); c != '\n'; c = getchar()) {
        if (c == EOF) {
            return gonio_fail(error, GONIO_E_DEVICE, "waiting for the %s on the table: no answer", names[object]);
        }
    }
    return GONIO_OK;
}

static gonio_status keep(taking *t, const gonio_rig_view *view, const char *name, gonio_error *error) {
    char path[1200];
    if (t->list == NULL) {
        return GONIO_OK;
    }
    snprintf(path, sizeof path, "%s/%s", t->request->save, name);
    fprintf(t->list, "%s,%s,%.17g,%.17g,%.17g,%.17g\n", name, calibrate_rig_objects[view->object],
            gonio_degrees(view->axes.theta_i), gonio_degrees(view->axes.phi_i), gonio_degrees(view->axes.theta_o),
            gonio_degrees(view->axes.phi_o));
    return gonio_image_write(&t->image, path, error);
}

// A pose out of the stage's reach is left out with its reason: what the others tell may suffice.
static gonio_status take_pose(taking *t, const gonio_rig_pose *pose, gonio_error *error) {
    const double to[GONIO_AXES] = {pose->axes.theta_i, pose->axes.phi_i, pose->axes.theta_o, pose->axes.phi_o};
    const int i = t->views->n++;
    gonio_rig_view *view = &t->views->items[i];
    *view = (gonio_rig_view){.axes = pose->axes, .object = pose->object, .corners = &t->views->corners[i]};
    snprintf(t->views->names[i], sizeof t->views->names[i], "pose%03d.png", i);
    t->stamp.pose++;
    t->stamp.frame = 0;
    t->stamp.clock_s += 1;
    gonio_error own = {.line = -1, .byte = -1};
    gonio_status status =
        t->rig->stage->move(t->rig->stage_device, to, (uint32_t)t->stamp.pose, &t->stamp, TIMEOUT_S, &own);
    if (status == GONIO_E_RANGE) {
        snprintf(view->reason, sizeof view->reason, "%.150s", own.message);
        return GONIO_OK;
    }
    if (status != GONIO_OK) {
        *error = own;
        return status;
    }
    status = expose(t, pose->object, error);
    status = status == GONIO_OK ? keep(t, view, t->views->names[i], error) : status;
    return status == GONIO_OK ? calibrate_rig_look(t->request, &t->image, view, &t->views->corners[i], error) : status;
}

static gonio_status take_poses(taking *t, const gonio_rig_pose *poses, int n, gonio_error *error) {
    gonio_status status = GONIO_OK;
    cli_progress_start(&t->progress, "frames", n);
    for (int i = 0; status == GONIO_OK && i < n; i++) {
        if (i == 0 || poses[i].object != poses[i - 1].object) {
            status = put_down(t, poses[i].object, error);
        }
        if (status == GONIO_OK && cli_interrupted()) {
            status = gonio_fail(error, GONIO_E_INTERRUPTED, "stopped after %d frames", t->views->n);
        }
        status = status == GONIO_OK ? take_pose(t, &poses[i], error) : status;
        cli_progress_update(&t->progress, i + 1, "", NAN);
    }
    cli_progress_end(&t->progress);
    return status;
}

// Board and ball; then the mirror, aimed with what those tell.
static gonio_status take_all(taking *t, gonio_error *error) {
    gonio_rig_pose poses[GONIO_RIG_POSES_MAX];
    gonio_alignment rough;
    gonio_rig_report report;
    gonio_status status = calibrate_rig_room(t->views, 2 * GONIO_RIG_POSES_MAX, error);
    status = status == GONIO_OK ? take_poses(t, poses, gonio_rig_poses(poses), error) : status;
    if (status == GONIO_OK) {
        status = gonio_rig_calibrate(&t->views->camera, &t->request->options, t->views->n, t->views->items, &rough,
                                     &report, error);
    }
    if (status == GONIO_OK) {
        for (int i = 0; i < t->views->n; i++) { // whatever was left out may count again beside the mirror
            t->views->items[i].used = t->views->items[i].used || t->views->items[i].rms > 0;
        }
        status = take_poses(t, poses, gonio_rig_mirror_poses(&rough, poses), error);
    }
    return status;
}

static gonio_status start_rig(taking *t, gonio_error *error) {
    gonio_rig *rig = t->rig;
    double waited_s = 0;
    gonio_status status = rig->interlock != NULL ? rig->interlock->check(rig->interlock_device, error) : GONIO_OK;
    status = status == GONIO_OK ? rig->stage->home(rig->stage_device, TIMEOUT_S, error) : status;
    status = status == GONIO_OK ? rig->lamp->set_level(rig->lamp_device, 1, error) : status;
    if (status == GONIO_OK) {
        status = rig->lamp->wait_ready(rig->lamp_device, &t->stamp, 2 * TIMEOUT_S, &waited_s, error);
        t->stamp.clock_s += waited_s;
    }
    return status == GONIO_OK ? rig->lamp->set_shutter(rig->lamp_device, true, error) : status;
}

// The simulated table holds the board that the command line names.
static gonio_status show_board(gonio_sim *sim, const gonio_board *board, gonio_error *error) {
    gonio_image drawn;
    gonio_status status = gonio_board_draw(board, SQUARE_PX, &drawn, error);
    if (status == GONIO_OK) {
        status = gonio_sim_fiducial(sim, drawn.width, drawn.height, drawn.pixels, board->square_mm / SQUARE_PX, error);
    }
    gonio_image_free(&drawn);
    return status;
}

static gonio_status open_rig(taking *t, cli_rig *opened, gonio_error *error) {
    calibrate_rig_request *request = t->request;
    gonio_camera_info *camera = &t->views->camera;
    gonio_status status = cli_rig_open(&request->rig, opened, error);
    status = status == GONIO_OK ? opened->rig.camera->info(opened->rig.camera_device, camera, error) : status;
    status = status == GONIO_OK && opened->sim != NULL ? show_board(opened->sim, &request->board, error) : status;
    const int width = camera->width, height = camera->height;
    if (status == GONIO_OK && request->camera != NULL) {
        status = calibrate_camera_read(request->camera, camera, request->options.camera_sigma, error);
    }
    if (status == GONIO_OK && (camera->width != width || camera->height != height || !(camera->fx > 0))) {
        status = gonio_fail(error, GONIO_E_INPUT,
                            "intrinsics of %d x %d pixels, focal length %g px, for a camera of %d x %d", camera->width,
                            camera->height, camera->fx, width, height);
    }
    if (status == GONIO_OK) {
        request->options.light_distance_mm = opened->rig.facts.light_distance_mm;
        request->options.camera_distance_mm = opened->rig.facts.camera_distance_mm;
        request->options.pointing_random_deg = opened->rig.facts.pointing_random_deg;
        t->image = (gonio_image){width, height, 1, 16, malloc((size_t)width * (size_t)height * sizeof(uint16_t))};
        status = t->image.pixels != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a frame");
    }
    return status;
}

gonio_status calibrate_rig_take(calibrate_rig_request *request, calibrate_rig_views *views, gonio_error *error) {
    cli_rig opened = {0};
    taking t = {.request = request, .views = views, .rig = &opened.rig};
    gonio_output *output = NULL;
    char path[1200];
    gonio_status status = open_rig(&t, &opened, error);
    if (status == GONIO_OK && opened.rig.mount == NULL && !request->yes && isatty(STDIN_FILENO) != 1) {
        status = gonio_fail(error, GONIO_E_USAGE,
                            "board, ball and mirror are put on the table by hand and there is no terminal to ask at; "
                            "--yes goes on without asking");
    }
    if (status == GONIO_OK && request->save != NULL) {
        mkdir(request->save, 0777);
        snprintf(path, sizeof path, "%s/frames.csv", request->save);
        status = gonio_output_open(path, &output, error);
    }
    if (output != NULL) {
        t.list = gonio_output_stream(output);
        fputs("file,object,light_theta,light_phi,camera_theta,camera_phi\n", t.list);
    }
    status = status == GONIO_OK ? start_rig(&t, error) : status;
    status = status == GONIO_OK ? take_all(&t, error) : status;
    if (opened.rig.lamp != NULL) {
        opened.rig.lamp->set_shutter(opened.rig.lamp_device, false, NULL);
    }
    if (output != NULL && status == GONIO_OK) {
        status = gonio_output_commit(output, error);
    } else {
        gonio_output_abandon(output);
    }
    gonio_image_free(&t.image);
    cli_rig_close(&opened);
    return status;
}
