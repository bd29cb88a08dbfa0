// SPDX-License-Identifier: BSD-3-Clause
// A list of frames with their exposures, as CSV.
#include <libgen.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "host/cli/calibrate/calibrate.h"

#define HEADER "file,exposure_s"
#define LIST_MAX_BYTES ((size_t)64 << 20)

gonio_status calibrate_list_read(const char *path, char **folder, gonio_text *text, gonio_error *error) {
    char *copy = strdup(path);
    gonio_status status = copy != NULL ? gonio_text_open(path, LIST_MAX_BYTES, text, error)
                                       : gonio_fail(error, GONIO_E_MEMORY, "no memory to read %s", path);
    if (status == GONIO_OK && (*folder = strdup(dirname(copy))) == NULL) {
        gonio_text_free(text);
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to read %s", path);
    }
    free(copy);
    return status;
}

gonio_status calibrate_list_path(const cli_common *common, const gonio_text *text, const char *folder, const char *file,
                                 char path[1024], gonio_error *error) {
    const bool absolute = file[0] == '/';
    return snprintf(path, 1024, "%s%s%s", absolute ? "" : folder, absolute ? "" : "/", file) < 1024
               ? cli_apart_input(common, path, error)
               : gonio_text_fail(text, error, "the file's name is too long");
}

static gonio_status parse_row(const cli_common *common, const gonio_text *text, const char *folder, char *line,
                              bool has_light, frame_row *row, gonio_error *error) {
    char *fields[3];
    const int columns = has_light ? 3 : 2;
    if (gonio_text_split(line, ',', fields, 3) != columns || fields[0][0] == '\0') {
        return gonio_text_fail(text, error, "expected %d columns, a file's name the first", columns);
    }
    const gonio_status status = gonio_text_ratio(text, fields[1], "exposure_s", &row->exposure_s, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (!(row->exposure_s > 0)) {
        return gonio_text_fail(text, error, "an exposure above 0 s expected");
    }
    if (has_light && strcmp(fields[2], "0") != 0 && strcmp(fields[2], "1") != 0) {
        return gonio_text_fail(text, error, "light must be 0 or 1");
    }
    row->lit = !has_light || fields[2][0] == '1';
    row->line = text->line;
    return calibrate_list_path(common, text, folder, fields[0], row->path, error);
}

static gonio_status read_rows(const cli_common *common, gonio_text *text, const char *folder, frame_row **rows,
                              size_t *n, gonio_error *error) {
    static const char *const header[] = {"file", "exposure_s", NULL}, *const lit[] = {"file", "exposure_s", "light",
                                                                                      NULL};
    char *line = gonio_text_row(text), *fields[3];
    const int columns = line != NULL ? gonio_text_split(line, ',', fields, 3) : 0;
    const bool has_light = gonio_text_is_header(fields, columns, lit);
    if (!has_light && !gonio_text_is_header(fields, columns, header)) {
        return gonio_text_fail(
            text, error, "found %d columns, '%.60s' the first; expected the header " HEADER " or " HEADER ",light",
            columns, columns > 0 ? fields[0] : "");
    }
    gonio_status status = GONIO_OK;
    while (status == GONIO_OK && (line = gonio_text_row(text)) != NULL) {
        frame_row *larger = realloc(*rows, (*n + 1) * sizeof *larger);
        if (larger == NULL) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu frames", *n);
        }
        *rows = larger;
        status = parse_row(common, text, folder, line, has_light, &larger[(*n)++], error);
    }
    return status == GONIO_OK && *n == 0 ? gonio_fail_line(error, GONIO_E_INPUT, text->path, -1, "no frames listed")
                                         : status;
}

gonio_status frame_list_read(const cli_common *common, const char *path, frame_row **rows, size_t *n,
                             gonio_error *error) {
    *rows = NULL;
    *n = 0;
    char *folder;
    gonio_text text;
    gonio_status status = calibrate_list_read(path, &folder, &text, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = read_rows(common, &text, folder, rows, n, error);
    gonio_text_free(&text);
    free(folder);
    if (status != GONIO_OK) {
        free(*rows);
        *rows = NULL;
    }
    return status;
}

gonio_status frame_image_read(const frame_row *row, bool grey, int bits, frame_top *top, gonio_image *image,
                              gonio_error *error) {
    const gonio_status status = gonio_image_read(row->path, grey, image, error);
    if (status != GONIO_OK) {
        return status;
    }
    image->bits = bits > 0 ? bits : image->bits;
    top->bits = image->bits;
    top->given = bits > 0;
    const size_t n = (size_t)image->width * (size_t)image->height * (size_t)image->channels;
    for (size_t p = 0; p < n; p++) {
        const unsigned word = image->pixels[p];
        if (word >> image->bits != 0) {
            const gonio_status refused =
                gonio_fail_line(error, GONIO_E_INPUT, row->path, -1, "pixel %zu reads %u; %d bits end at %u",
                                p / (size_t)image->channels, word, image->bits, (1u << image->bits) - 1);
            gonio_image_free(image);
            return refused;
        }
        top->any |= word;
        if (word > top->top) {
            top->top = word;
            top->count = 0;
        }
        top->count += word == top->top;
    }
    return GONIO_OK;
}

// Words of 16 bits that clip at 4095 are those of 12: a converter's end stands in many pixels, a scene's brightest
// point in few.
#define CLIPPED_PIXELS 8

gonio_status frame_top_check(const char *list, const frame_top *top, gonio_error *error) {
    int bits = 8;
    while (bits < top->bits && top->top > (1u << bits) - 1) {
        bits++;
    }
    const bool clips = top->count >= CLIPPED_PIXELS && top->top == (1u << bits) - 1;
    // A sixteenth of the range: nobody exposes so. Words whose lowest bits are never set stand at the top already, as
    // a session's frames do: those are dark indeed.
    const bool dark = top->top < 1u << (top->bits - 4) && (top->any & 1) != 0;
    return top->given || bits >= top->bits || (!clips && !dark)
               ? GONIO_OK
               : gonio_fail_line(
                     error, GONIO_E_INPUT, list, -1,
                     "the frames have words of %d bits, but none beyond %u%s; --bits %d says how many carry "
                     "information, --bits %d that all do",
                     top->bits, top->top, clips ? ", where they clip" : "", bits, top->bits);
}
