// SPDX-License-Identifier: BSD-3-Clause
// The file emor.txt of Grossberg and Nayar, "What is the space of camera response functions?" (CVPR 2003): blocks
// "E =", "f0 =", "h(1)=" ... of 1024 numbers each.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "calib/device/curve.h"

#define SAMPLES 1024

// Go on to the line that begins with the label.
static bool find_label(gonio_text *text, const char *label) {
    const char *line;
    do {
        line = gonio_text_line(text);
    } while (line != NULL && strncmp(line, label, strlen(label)) != 0);
    return line != NULL;
}

static gonio_status read_block(gonio_text *text, const char *label, double *out, gonio_error *error) {
    if (!find_label(text, label)) {
        return gonio_text_fail(text, error, "no block '%s'", label);
    }
    char *fields[SAMPLES], *line;
    int found = 0;
    gonio_status status = GONIO_OK;
    while (status == GONIO_OK && found < SAMPLES && (line = gonio_text_content(text)) != NULL) {
        const int n = gonio_text_split(line, ' ', fields, SAMPLES);
        for (int i = 0; i < n && found < SAMPLES && status == GONIO_OK; i++) {
            status = gonio_text_number(text, fields[i], label, &out[found++], error);
        }
    }
    return status != GONIO_OK || found == SAMPLES
               ? status
               : gonio_text_fail(text, error, "block '%s' holds %d of %d numbers", label, found, SAMPLES);
}

gonio_status gonio_emor_read(const char *path, int terms, double **basis, int *samples, gonio_error *error) {
    gonio_text text;
    *basis = NULL;
    gonio_status status = gonio_text_open(path, 0, &text, error);
    if (status != GONIO_OK) {
        return status;
    }
    *samples = SAMPLES;
    *basis = malloc((size_t)(terms + 1) * SAMPLES * sizeof **basis);
    status = *basis == NULL ? gonio_fail(error, GONIO_E_MEMORY, "no memory for a response basis") : GONIO_OK;
    for (int k = 0; status == GONIO_OK && k <= terms; k++) {
        char label[16];
        snprintf(label, sizeof label, k == 0 ? "f0" : "h(%d)", k);
        status = read_block(&text, label, *basis + (size_t)k * SAMPLES, error);
    }
    gonio_text_free(&text);
    if (status != GONIO_OK) {
        free(*basis);
        *basis = NULL;
    }
    return status;
}
