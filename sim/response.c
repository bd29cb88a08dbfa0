// SPDX-License-Identifier: BSD-3-Clause
#include "sim/response.h"

#include <ctype.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "base/text.h"

struct sim_response {
    double (*knots)[2]; // NULL: linear or gamma
    size_t n;
    double gamma; // 1: linear
};

// Below it the curve of gamma:G is a straight line to 0, as real transfer curves have one: the power's slope at 0 is
// infinite.
#define TOE 1e-3

static gonio_status parse_row(const gonio_text *text, char *line, double row[2], gonio_error *error) {
    static const char *const names[2] = {"relative exposure", "relative value"};
    char *fields[2];
    if (gonio_text_split(line, ',', fields, 2) != 2) {
        return gonio_text_fail(text, error, "expected relative exposure,relative value, both from 0 to 1");
    }
    for (int k = 0; k < 2; k++) {
        const gonio_status status = gonio_text_number(text, fields[k], names[k], &row[k], error);
        if (status != GONIO_OK) {
            return status;
        }
        if (!(row[k] >= 0 && row[k] <= 1)) {
            return gonio_text_fail(text, error, "%s: expected 0 to 1, found %s", names[k], fields[k]);
        }
    }
    return GONIO_OK;
}

static gonio_status add_row(sim_response *response, const double row[2], const gonio_text *text, gonio_error *error) {
    const size_t n = response->n;
    const double *last = n > 0 ? response->knots[n - 1] : NULL;
    if (last == NULL ? row[0] != 0 || row[1] != 0 : !(row[0] > last[0] && row[1] >= last[1])) {
        return gonio_text_fail(text, error, "a response curve begins with 0,0 and rises; found %g,%g", row[0], row[1]);
    }
    void *larger = realloc(response->knots, (n + 1) * sizeof *response->knots);
    if (larger == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the response curve");
    }
    response->knots = larger;
    memcpy(response->knots[n], row, sizeof *response->knots);
    response->n++;
    return GONIO_OK;
}

static gonio_status read_rows(sim_response *response, gonio_text *text, gonio_error *error) {
    gonio_status status = GONIO_OK;
    bool seen = false;
    for (char *line; status == GONIO_OK && (line = gonio_text_row(text)) != NULL; seen = true) {
        double row[2];
        if (!seen && isalpha((unsigned char)*line)) { // the header
            continue;
        }
        status = parse_row(text, line, row, error);
        status = status == GONIO_OK ? add_row(response, row, text, error) : status;
    }
    if (status == GONIO_OK && (response->n < 2 || response->knots[response->n - 1][0] != 1)) {
        status = gonio_fail_line(error, GONIO_E_INPUT, text->path, -1, "a response curve ends at relative exposure 1");
    }
    return status;
}

gonio_status gonio_sim_response_new(const char *text, sim_response **out, gonio_error *error) {
    *out = NULL;
    sim_response *response = calloc(1, sizeof *response);
    if (response == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the response curve");
    }
    response->gamma = 1;
    gonio_status status = GONIO_OK;
    if (strncmp(text, "gamma:", 6) == 0) {
        char *end;
        response->gamma = gonio_number_parse(text + 6, &end);
        if (*end != 0 || !(response->gamma >= 0.2 && response->gamma <= 5)) {
            status = gonio_fail(error, GONIO_E_INPUT, "response '%s': gamma must be from 0.2 to 5", text);
        }
    } else if (strcmp(text, "linear") != 0) {
        gonio_text curve;
        status = gonio_text_open(text, 0, &curve, error);
        if (status == GONIO_OK) {
            status = read_rows(response, &curve, error);
            gonio_text_free(&curve);
        }
    }
    if (status != GONIO_OK) {
        gonio_sim_response_free(response);
        return status;
    }
    *out = response;
    return GONIO_OK;
}

void gonio_sim_response_free(sim_response *response) {
    if (response != NULL) {
        free(response->knots);
        free(response);
    }
}

double gonio_sim_response_value(const sim_response *response, double exposure) {
    if (exposure >= 1) {
        return 1;
    }
    if (response->knots == NULL) {
        if (response->gamma == 1) {
            return exposure;
        }
        return exposure >= TOE ? pow(exposure, 1 / response->gamma) : exposure / TOE * pow(TOE, 1 / response->gamma);
    }
    size_t low = 0, high = response->n - 1;
    while (high - low > 1) {
        const size_t middle = (low + high) / 2;
        *(exposure >= response->knots[middle][0] ? &low : &high) = middle;
    }
    const double *a = response->knots[low], *b = response->knots[high];
    return a[1] + (b[1] - a[1]) * (exposure - a[0]) / (b[0] - a[0]);
}
