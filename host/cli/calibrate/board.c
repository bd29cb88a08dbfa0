// SPDX-License-Identifier: BSD-3-Clause
// What the verbs that look at boards share: the board's options, and the file of a camera's intrinsics.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/cli/calibrate/calibrate.h"

static bool parse_size(const char *text, int *columns, int *rows) {
    char tail;
    return sscanf(text, "%dx%d%c", columns, rows, &tail) == 2;
}

gonio_status calibrate_board_parse(const calibrate_board *options, gonio_board *board, gonio_error *error) {
    *board = (gonio_board){.kind = options->charuco != NULL ? GONIO_CHARUCO : GONIO_CHESSBOARD,
                           .square_mm = options->square_mm,
                           .marker_mm = options->marker_mm > 0 ? options->marker_mm : 0.75 * options->square_mm,
                           .dictionary = options->dictionary};
    const char *size = options->charuco != NULL ? options->charuco : options->chessboard;
    if (!parse_size(size, &board->columns, &board->rows)) {
        return gonio_fail(error, GONIO_E_USAGE, "'%s' is not a board's size; expected COLUMNSxROWS", size);
    }
    return GONIO_OK;
}

static const char *const keys[] = {"fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "p1", "p2", "k3", "width", "height"};
#define FILE_MAX_BYTES ((size_t)1 << 20)
#define KEYS (sizeof keys / sizeof *keys)

// The standard uncertainty stands in the comment behind a value, where no other reader of the file minds it.
static gonio_status parse_line(const gonio_text *text, const char *line, double value[KEYS], double sigma[KEYS],
                               gonio_error *error) {
    char key[32];
    double v, s = 0;
    const int got = sscanf(line, "%31[a-z0-9_] = %lf ; +- %lf", key, &v, &s);
    for (size_t k = 0; got >= 2 && k < KEYS; k++) {
        if (strcmp(key, keys[k]) == 0 && isfinite(v) && s >= 0) {
            value[k] = v;
            sigma[k] = s;
            return GONIO_OK;
        }
    }
    return line[0] == ';' || line[0] == '['
               ? GONIO_OK
               : gonio_text_fail(text, error, "found '%.60s', expected fx_px = NUMBER, fy_px ... k3, width or height",
                                 line);
}

gonio_status calibrate_camera_read(const char *path, gonio_camera_info *camera, double sigma[9], gonio_error *error) {
    char *data, *line;
    size_t size;
    gonio_status status = gonio_file_read(path, FILE_MAX_BYTES, &data, &size, error);
    if (status != GONIO_OK) {
        return status;
    }
    double value[KEYS], spread[KEYS] = {0};
    for (size_t k = 0; k < KEYS; k++) {
        value[k] = k < 4 || k >= 9 ? NAN : 0;
    }
    gonio_text text = gonio_text_begin(path, data, size);
    while (status == GONIO_OK && (line = gonio_text_content(&text)) != NULL) {
        status = parse_line(&text, line, value, spread, error);
    }
    free(data);
    for (size_t k = 0; status == GONIO_OK && k < KEYS; k++) {
        const bool positive = k < 2 || k >= 9;
        if (!isfinite(value[k]) || (positive && !(value[k] > 0))) {
            status = gonio_fail_line(error, GONIO_E_INPUT, path, -1, "no sound value of %s", keys[k]);
        }
    }
    if (status == GONIO_OK) {
        gonio_camera_calibration found = {0};
        memcpy(found.value, value, sizeof found.value);
        memcpy(sigma, spread, 9 * sizeof *sigma);
        gonio_camera_apply(&found, camera);
        camera->width = (int)value[9];
        camera->height = (int)value[10];
    }
    return status;
}
