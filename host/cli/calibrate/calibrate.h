// SPDX-License-Identifier: BSD-3-Clause
// The devices' calibrations behind `gonio calibrate`, one file each.
#ifndef GONIO_HOST_CLI_CALIBRATE_CALIBRATE_H
#define GONIO_HOST_CLI_CALIBRATE_CALIBRATE_H

#include "base/text.h"
#include "gonio/characterise.h"
#include "host/cli/apart.h"
#include "host/cli/cli.h"
#include "host/cli/rig_file.h"

// argv[0] is the kind ("camera"); each returns the exit status.
int calibrate_camera(int argc, char **argv);
int calibrate_noise(int argc, char **argv);
int calibrate_response(int argc, char **argv);
int calibrate_rig(int argc, char **argv);
int calibrate_flat(int argc, char **argv);
int calibrate_reference(int argc, char **argv);

// The board that a command line names: put the options into the verb's table. `b` is a calibrate_board.
typedef struct calibrate_board {
    const char *chessboard, *charuco;
    double square_mm, marker_mm;
    int dictionary, half_window;
} calibrate_board;
#define CALIBRATE_BOARD_OPTIONS(b, standard)                                                                           \
    {"board", 0, CLI_TEXT, &(b).chessboard, NULL, "9x6", "chessboard: inner corners, columns x rows"},                 \
        {"charuco", 0, CLI_TEXT, &(b).charuco, NULL, "8x6", "ChArUco board: squares, columns x rows"},                 \
        {"square-mm", 0, CLI_DOUBLE, &(b).square_mm, NULL, "MM", "a square's side (" standard ")"},                    \
        {"marker-mm", 0, CLI_DOUBLE, &(b).marker_mm, NULL, "MM", "a marker's side (three quarters of the square's)"},  \
        {"dictionary", 0, CLI_INT, &(b).dictionary, NULL, "N", "OpenCV's number of the marker set (5: DICT_5X5_100)"}, \
    {                                                                                                                  \
        "window", 0, CLI_INT, &(b).half_window, NULL, "PX", "half the sub-pixel search window (5)"                     \
    }
gonio_status calibrate_board_parse(const calibrate_board *options, gonio_board *board, gonio_error *error);

// Intrinsics and, where the file states them, their standard uncertainties, from what `calibrate camera -o` writes.
gonio_status calibrate_camera_read(const char *path, gonio_camera_info *camera, double sigma[9], gonio_error *error);

// Take the frames that show a rig's axes; views' corners point into *corners. The caller frees both.
typedef struct calibrate_rig_request {
    const cli_common *common;
    cli_rig_options rig;
    gonio_board board;
    int half_window;
    const char *camera; // file with the intrinsics; NULL: the rig's own
    const char *save;   // folder for the frames; NULL: none
    bool yes;           // do not wait for hands
    gonio_rig_options options;
} calibrate_rig_request;
typedef struct calibrate_rig_views {
    gonio_camera_info camera;
    gonio_rig_view *items;
    gonio_corners *corners; // one a view
    char (*names)[64];
    int n;
} calibrate_rig_views;
gonio_status calibrate_rig_take(calibrate_rig_request *request, calibrate_rig_views *views, gonio_error *error);
gonio_status calibrate_rig_room(calibrate_rig_views *views, int n, gonio_error *error);
void calibrate_rig_free(calibrate_rig_views *views);
// Look for the view's object in its frame; a frame without it is no failure but has its reason.
gonio_status calibrate_rig_look(const calibrate_rig_request *request, const gonio_image *image, gonio_rig_view *view,
                                gonio_corners *corners, gonio_error *error);

// A list of files to be read line by line, and the folder that it lies in; the caller frees *text and *folder.
gonio_status calibrate_list_read(const char *path, char **folder, gonio_text *text, gonio_error *error);
// The path of a file that the list names, which is none that will be written.
gonio_status calibrate_list_path(const cli_common *common, const gonio_text *text, const char *folder, const char *file,
                                 char path[1024], gonio_error *error);

// One row of a frame list: CSV with the header "file,exposure_s" and optionally ",light" (1: lit, 0: dark). Paths are
// relative to the list's folder.
typedef struct frame_row {
    char path[1024];
    double exposure_s;
    bool lit;
    long long line;
} frame_row;
// The caller frees *rows.
gonio_status frame_list_read(const cli_common *common, const char *path, frame_row **rows, size_t *n,
                             gonio_error *error);

// How high the words of a list's frames go: what tells the sensor's bits apart from the file's.
typedef struct frame_top {
    int bits; // that were taken: those given, or the files'
    bool given;
    unsigned top; // the largest word
    unsigned any; // every bit that some word has
    size_t count; // how many there are of it
} frame_top;
// The image of a row, bits (0: the file's) put into it. GONIO_E_INPUT where a word lies beyond them.
gonio_status frame_image_read(const frame_row *row, bool grey, int bits, frame_top *top, gonio_image *image,
                              gonio_error *error);
// After all of them: GONIO_E_INPUT where the words end as those of fewer bits do, and none were given.
gonio_status frame_top_check(const char *list, const frame_top *top, gonio_error *error);

// What stands in the lists of views for each gonio_rig_object.
extern const char *const calibrate_rig_objects[GONIO_RIG_OBJECTS + 1]; // NULL ends them

#endif
