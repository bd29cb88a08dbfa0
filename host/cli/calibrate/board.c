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

// The standard uncertainty stands in the comment behind a value, "+- NUMBER", where no other reader of the file minds
// it.
static gonio_status parse_sigma(const gonio_text *text, char *comment, double *sigma, gonio_error *error) {
    if (comment == NULL || strncmp(comment, "+-", 2) != 0) {
        return GONIO_OK;
    }
    const gonio_status status =
        gonio_text_number(text, comment + 2 + strspn(comment + 2, " \t"), "uncertainty", sigma, error);
    return status == GONIO_OK && *sigma < 0 ? gonio_text_fail(text, error, "uncertainty: expected 0 or more") : status;
}

static gonio_status parse_line(const gonio_text *text, const char *key, char *found, char *comment, double value[KEYS],
                               double sigma[KEYS], gonio_error *error) {
    for (size_t k = 0; found != NULL && k < KEYS; k++) {
        if (strcmp(key, keys[k]) == 0) {
            const gonio_status status = gonio_text_number(text, found, key, &value[k], error);
            return status == GONIO_OK ? parse_sigma(text, comment, &sigma[k], error) : status;
        }
    }
    return found == NULL && key[0] == '['
               ? GONIO_OK
               : gonio_text_fail(text, error, "found '%.60s', expected fx_px = NUMBER, fy_px ... k3, width or height",
                                 key);
}

gonio_status calibrate_camera_read(const char *path, gonio_camera_info *camera, double sigma[9], gonio_error *error) {
    gonio_text text;
    char *key, *found, *comment;
    gonio_status status = gonio_text_open(path, FILE_MAX_BYTES, &text, error);
    if (status != GONIO_OK) {
        return status;
    }
    double value[KEYS], spread[KEYS] = {0};
    for (size_t k = 0; k < KEYS; k++) {
        value[k] = k < 4 || k >= 9 ? NAN : 0;
    }
    while (status == GONIO_OK && (key = gonio_text_setting(&text, &found, &comment)) != NULL) {
        status = parse_line(&text, key, found, comment, value, spread, error);
    }
    gonio_text_free(&text);
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
