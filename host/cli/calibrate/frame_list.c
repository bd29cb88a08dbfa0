// SPDX-License-Identifier: BSD-3-Clause
// A list of frames with their exposures, as CSV.
#include <errno.h>
#include <libgen.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "host/cli/calibrate/calibrate.h"

#define HEADER "file,exposure_s"

static gonio_status parse_header(const char *path, const char *text, bool *has_light, gonio_error *error) {
    const size_t length = strcspn(text, "\r\n");
    *has_light = length == strlen(HEADER ",light") && strncmp(text, HEADER ",light", length) == 0;
    if (!*has_light && (length != strlen(HEADER) || strncmp(text, HEADER, length) != 0)) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, 1,
                               "found '%.*s', expected the header " HEADER " or " HEADER ",light",
                               (int)(length < 60 ? length : 60), text);
    }
    return GONIO_OK;
}

static gonio_status parse_row(const char *path, const char *folder, char *text, bool has_light, frame_row *row,
                              gonio_error *error) {
    char *end, *comma = strchr(text, ',');
    if (comma == NULL || comma == text) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, row->line, "expected a file name and an exposure");
    }
    *comma = '\0';
    row->exposure_s = gonio_number_parse(comma + 1, &end);
    if (end == comma + 1 || !(row->exposure_s > 0) || !isfinite(row->exposure_s)) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, row->line, "an exposure above 0 s expected");
    }
    row->lit = true;
    if (has_light) {
        if (*end != ',' || (end[1] != '0' && end[1] != '1')) {
            return gonio_fail_line(error, GONIO_E_INPUT, path, row->line, "light must be 0 or 1");
        }
        row->lit = end[1] == '1';
        end += 2;
    }
    if (end[strspn(end, " \t\r\n")] != '\0') {
        return gonio_fail_line(error, GONIO_E_INPUT, path, row->line, "more columns than the header names");
    }
    const int written = text[0] == '/' ? snprintf(row->path, sizeof row->path, "%s", text)
                                       : snprintf(row->path, sizeof row->path, "%s/%s", folder, text);
    return written < (int)sizeof row->path
               ? GONIO_OK
               : gonio_fail_line(error, GONIO_E_INPUT, path, row->line, "the file's name is too long");
}

static gonio_status read_rows(FILE *stream, const char *path, const char *folder, frame_row **rows, size_t *n,
                              gonio_error *error) {
    char text[1024];
    bool has_light = false;
    gonio_status status = GONIO_OK;
    for (long long line = 1; status == GONIO_OK && fgets(text, sizeof text, stream) != NULL; line++) {
        if (line == 1) {
            status = parse_header(path, text, &has_light, error);
        } else if (text[0] != '#' && text[strspn(text, " \t\r\n")] != '\0') {
            frame_row *larger = realloc(*rows, (*n + 1) * sizeof *larger);
            if (larger == NULL) {
                return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu frames", *n);
            }
            *rows = larger;
            larger[*n] = (frame_row){.line = line};
            status = parse_row(path, folder, text, has_light, &larger[(*n)++], error);
        }
    }
    if (status == GONIO_OK && *n == 0) {
        status = gonio_fail_line(error, GONIO_E_INPUT, path, -1, "no frames listed");
    }
    return status;
}

gonio_status frame_list_read(const char *path, frame_row **rows, size_t *n, gonio_error *error) {
    *rows = NULL;
    *n = 0;
    FILE *stream = fopen(path, "r");
    if (stream == NULL) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "cannot read it: %s", strerror(errno));
    }
    char *copy = strdup(path);
    gonio_status status = copy == NULL ? gonio_fail(error, GONIO_E_MEMORY, "no memory")
                                       : read_rows(stream, path, dirname(copy), rows, n, error);
    fclose(stream);
    free(copy);
    if (status != GONIO_OK) {
        free(*rows);
        *rows = NULL;
    }
    return status;
}
