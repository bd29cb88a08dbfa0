// SPDX-License-Identifier: BSD-3-Clause
#include "sim/response.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"

struct sim_response {
    double (*knots)[2]; // NULL: linear or gamma
    size_t n;
    double gamma; // 1: linear
};

// Below it the curve of gamma:G is a straight line to 0, as real transfer curves have one: the power's slope at 0 is
// infinite.
#define TOE 1e-3

static gonio_status parse_row(char *line, const char *path, long long number, bool *is_row, double row[2],
                              gonio_error *error) {
    char *text = line + strspn(line, " \t"), *end;
    *is_row = false;
    if (*text == '#' || *text == '\r' || *text == '\n' || *text == 0) {
        return GONIO_OK;
    }
    for (int k = 0; k < 2; k++) {
        row[k] = gonio_number_parse(text, &end);
        const bool ends = k == 0 ? *end == ',' : end[strspn(end, " \t\r\n")] == 0;
        if (end == text || !ends || !(row[k] >= 0 && row[k] <= 1)) {
            return gonio_fail_line(error, GONIO_E_INPUT, path, number,
                                   "expected relative exposure,relative value, both from 0 to 1, found '%.*s'",
                                   (int)strcspn(line, "\r\n"), line);
        }
        text = end + 1;
    }
    *is_row = true;
    return GONIO_OK;
}

static gonio_status add_row(sim_response *response, const double row[2], const char *path, long long number,
                            gonio_error *error) {
    const size_t n = response->n;
    const double *last = n > 0 ? response->knots[n - 1] : NULL;
    if (last == NULL ? row[0] != 0 || row[1] != 0 : !(row[0] > last[0] && row[1] >= last[1])) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, number,
                               "a response curve begins with 0,0 and rises; found %g,%g", row[0], row[1]);
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

static gonio_status read_rows(sim_response *response, FILE *file, const char *path, gonio_error *error) {
    char line[512];
    bool seen = false;
    gonio_status status = GONIO_OK;
    for (long long number = 1; status == GONIO_OK && fgets(line, sizeof line, file) != NULL; number++) {
        double row[2];
        bool is_row;
        const char first = line[strspn(line, " \t")];
        if (!seen && ((first >= 'a' && first <= 'z') || (first >= 'A' && first <= 'Z'))) {
            seen = true; // the header
            continue;
        }
        status = parse_row(line, path, number, &is_row, row, error);
        if (status == GONIO_OK && is_row) {
            seen = true;
            status = add_row(response, row, path, number, error);
        }
    }
    if (status == GONIO_OK && (response->n < 2 || response->knots[response->n - 1][0] != 1)) {
        status = gonio_fail_line(error, GONIO_E_INPUT, path, -1, "a response curve ends at relative exposure 1");
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
        FILE *file = fopen(text, "r");
        if (file == NULL) {
            status =
                gonio_fail_line(error, GONIO_E_INPUT, text, -1, "cannot read the response curve: %s", strerror(errno));
        } else {
            status = read_rows(response, file, text, error);
            fclose(file);
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
