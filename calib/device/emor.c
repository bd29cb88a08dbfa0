// SPDX-License-Identifier: BSD-3-Clause
// The file emor.txt of Grossberg and Nayar, "What is the space of camera response functions?" (CVPR 2003): blocks
// "E =", "f0 =", "h(1)=" ... of 1024 numbers each.
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "calib/device/curve.h"

#define SAMPLES 1024

// Go on to the line that begins with the label.
static bool find_label(FILE *stream, const char *label, long long *line) {
    char text[512];
    while (fgets(text, sizeof text, stream) != NULL) {
        (*line)++;
        if (strncmp(text, label, strlen(label)) == 0) {
            return true;
        }
    }
    return false;
}

static gonio_status read_block(FILE *stream, const char *path, const char *label, double *out, long long *line,
                               gonio_error *error) {
    if (!find_label(stream, label, line)) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, *line, "no block '%s'", label);
    }
    for (int i = 0; i < SAMPLES; i++) {
        if (fscanf(stream, "%lf", &out[i]) != 1 || !isfinite(out[i])) {
            return gonio_fail_line(error, GONIO_E_INPUT, path, *line, "block '%s' holds %d of %d numbers", label, i,
                                   SAMPLES);
        }
    }
    return GONIO_OK;
}

gonio_status gonio_emor_read(const char *path, int terms, double **basis, int *samples, gonio_error *error) {
    FILE *stream = fopen(path, "r");
    if (stream == NULL) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "cannot read it: %s", strerror(errno));
    }
    *samples = SAMPLES;
    *basis = malloc((size_t)(terms + 1) * SAMPLES * sizeof **basis);
    gonio_status status =
        *basis == NULL ? gonio_fail(error, GONIO_E_MEMORY, "no memory for a response basis") : GONIO_OK;
    long long line = 0;
    for (int k = 0; status == GONIO_OK && k <= terms; k++) {
        char label[16];
        snprintf(label, sizeof label, k == 0 ? "f0" : "h(%d)", k);
        status = read_block(stream, path, label, *basis + (size_t)k * SAMPLES, &line, error);
    }
    fclose(stream);
    if (status != GONIO_OK) {
        free(*basis);
        *basis = NULL;
    }
    return status;
}
