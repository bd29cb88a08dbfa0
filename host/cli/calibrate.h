// The devices' calibrations behind `gonio calibrate`, one file each.
#ifndef GONIO_CLI_CALIBRATE_H
#define GONIO_CLI_CALIBRATE_H

#include "gonio/calibrate.h"
#include "host/cli/cli.h"

// argv[0] is the kind ("camera"); each returns the exit status.
int calibrate_camera(int argc, char **argv);
int calibrate_noise(int argc, char **argv);
int calibrate_response(int argc, char **argv);

// One row of a frame list: CSV with the header "file,exposure_s" and optionally ",light" (1: lit, 0: dark). Paths are
// relative to the list's folder.
typedef struct frame_row {
    char path[1024];
    double exposure_s;
    bool lit;
    long long line;
} frame_row;
// The caller frees *rows.
gonio_status frame_list_read(const char *path, frame_row **rows, size_t *n, gonio_error *error);

#endif
