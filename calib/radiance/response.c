// SPDX-License-Identifier: BSD-3-Clause
// A given camera response: CSV rows "relative exposure, relative value", both 0..1 and increasing, undone by a table.
#include "calib/internal.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"

#define POINTS_MAX 65536

static gonio_status add_row(response *c, const gonio_text *text, char *line, gonio_error *error) {
    char *fields[2];
    double exposure, value;
    if (gonio_text_split(line, ',', fields, 2) != 2) {
        return gonio_text_fail(text, error, "expected relative exposure,relative value");
    }
    gonio_status status = gonio_text_number(text, fields[0], "relative exposure", &exposure, error);
    status = status == GONIO_OK ? gonio_text_number(text, fields[1], "relative value", &value, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    if (!(exposure >= 0 && exposure <= 1 && value >= 0 && value <= 1)) {
        return gonio_text_fail(text, error, "%g,%g: both must lie in 0..1", exposure, value);
    }
    const int n = c->points;
    if (n > 0 && (exposure <= c->exposure[n - 1] || value < c->value[n - 1])) {
        return gonio_text_fail(text, error, "%g,%g falls below the row before", exposure, value);
    }
    if (n == POINTS_MAX) {
        return gonio_text_fail(text, error, "more than %d rows", POINTS_MAX);
    }
    // Where the curve stands still it has no inverse; the first of equal values stands for them.
    if (n == 0 || value > c->value[n - 1]) {
        c->exposure[n] = exposure;
        c->value[n] = value;
        c->points++;
    }
    return GONIO_OK;
}

// The exposure comes first: a header that says otherwise would turn the curve round.
static gonio_status check_header(const gonio_text *text, char *line, gonio_error *error) {
    char *fields[2];
    const int n = gonio_text_split(line, ',', fields, 2);
    return n >= 2 && strcasestr(fields[1], "exposure") != NULL
               ? gonio_text_fail(text, error, "the columns are '%.40s' and '%.40s'; expected the exposure first",
                                 fields[0], fields[1])
               : GONIO_OK;
}

static gonio_status read_rows(response *c, gonio_text *text, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (char *line; status == GONIO_OK && (line = gonio_text_row(text)) != NULL;) {
        const bool header = c->points == 0 && isalpha((unsigned char)*line);
        status = header ? check_header(text, line, error) : add_row(c, text, line, error);
    }
    if (status == GONIO_OK && c->points < 2) {
        status =
            gonio_fail_line(error, GONIO_E_INPUT, text->path, -1, "%d rising rows; a curve has at least 2", c->points);
    }
    return status;
}

gonio_status gonio_response_load(const char *path, int bits, response *out, gonio_error *error) {
    *out = (response){.levels = 1 << bits};
    gonio_text text;
    gonio_status status = gonio_text_open(path, 0, &text, error);
    if (status != GONIO_OK) {
        return status;
    }
    out->exposure = malloc(POINTS_MAX * sizeof *out->exposure);
    out->value = malloc(POINTS_MAX * sizeof *out->value);
    if (out->exposure == NULL || out->value == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for a response curve");
    } else {
        status = read_rows(out, &text, error);
    }
    gonio_text_free(&text);
    if (status != GONIO_OK) {
        gonio_response_free(out);
    }
    return status;
}

// Invert by linear interpolation between the points; outside them the end pieces go on, so that noise about black stays
// symmetric.
gonio_status gonio_response_tabulate(response *r, double black, gonio_error *error) {
    r->linear = malloc((size_t)r->levels * sizeof *r->linear);
    r->slope = malloc((size_t)r->levels * sizeof *r->slope);
    if (r->linear == NULL || r->slope == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a response table");
    }
    const double span = r->levels - 1 - black;
    int k = 0;
    for (int raw = 0; raw < r->levels; raw++) {
        const double value = (raw - black) / span;
        while (k < r->points - 2 && value > r->value[k + 1]) {
            k++;
        }
        const double slope = (r->exposure[k + 1] - r->exposure[k]) / (r->value[k + 1] - r->value[k]);
        r->linear[raw] = (float)((r->exposure[k] + slope * (value - r->value[k])) * span);
        r->slope[raw] = (float)slope;
    }
    return GONIO_OK;
}

void gonio_response_free(response *r) {
    free(r->exposure);
    free(r->value);
    free(r->linear);
    free(r->slope);
    *r = (response){0};
}
