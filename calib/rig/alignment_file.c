// SPDX-License-Identifier: BSD-3-Clause
// The file of an alignment: CSV, one row a parameter with its value and its row of the covariance.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/number.h"
#include "base/text.h"
#include "gonio/alignment.h"
#include "gonio/output.h"

#define P GONIO_ALIGNMENT_PARAMETERS
#define HEADER "parameter,value,covariance"

const char *gonio_alignment_parameter_name(int index) {
    static const char *const names[P] = {"camera azimuth axis a",
                                         "camera azimuth axis b",
                                         "camera azimuth axis c_mm",
                                         "camera azimuth axis d_mm",
                                         "camera tilt axis a",
                                         "camera tilt axis b",
                                         "camera tilt axis c_mm",
                                         "camera tilt axis d_mm",
                                         "camera x_mm",
                                         "camera y_mm",
                                         "camera z_mm",
                                         "camera turn x_rad",
                                         "camera turn y_rad",
                                         "camera turn z_rad",
                                         "light azimuth axis a",
                                         "light azimuth axis b",
                                         "light azimuth axis c_mm",
                                         "light azimuth axis d_mm",
                                         "light tilt axis a",
                                         "light tilt axis b",
                                         "light tilt axis c_mm",
                                         "light tilt axis d_mm",
                                         "light x_mm",
                                         "light y_mm",
                                         "light z_mm"};
    return index >= 0 && index < P ? names[index] : "";
}

gonio_status gonio_alignment_write(const gonio_alignment *alignment, const char *path, gonio_error *error) {
    gonio_output *output;
    const gonio_status status = gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    FILE *stream = gonio_output_stream(output);
    fputs("# The true axes of a rig (gonio calibrate rig); [rig] alignment = this file\n" HEADER "\n", stream);
    for (int k = 0; k < P; k++) {
        gonio_number_write(stream, "%s,%.17g", gonio_alignment_parameter_name(k), alignment->value[k]);
        for (int l = 0; l < P; l++) {
            gonio_number_write(stream, ",%.17g", alignment->covariance[k * P + l]);
        }
        fputc('\n', stream);
    }
    return gonio_output_commit(output, error);
}

static gonio_status parse_row(const gonio_text *text, int k, char *line, gonio_alignment *out, gonio_error *error) {
    const char *name = gonio_alignment_parameter_name(k);
    char *fields[P + 2];
    const int n = gonio_text_split(line, ',', fields, P + 2);
    if (strcmp(fields[0], name) != 0) {
        return gonio_text_fail(text, error, "found '%.60s', expected the row of '%s'", fields[0], name);
    }
    if (n != P + 2) {
        return gonio_text_fail(text, error, "%d numbers behind '%s' expected, found %d", P + 1, name, n - 1);
    }
    for (int column = 0; column <= P; column++) {
        double *to = column == 0 ? &out->value[k] : &out->covariance[k * P + column - 1];
        const gonio_status status = gonio_text_number(text, fields[column + 1], name, to, error);
        if (status != GONIO_OK) {
            return status;
        }
    }
    return GONIO_OK;
}

static gonio_status read_rows(gonio_text *text, gonio_alignment *out, gonio_error *error) {
    char *fields[3], *line = gonio_text_content(text);
    const int n = line != NULL ? gonio_text_split(line, ',', fields, 3) : 0;
    if (!gonio_text_is_header(fields, n, (const char *const[]){"parameter", "value", "covariance", NULL})) {
        return gonio_text_fail(text, error, "found '%.40s', expected the header " HEADER, n > 0 ? fields[0] : "");
    }
    int rows = 0;
    gonio_status status = GONIO_OK;
    while (status == GONIO_OK && (line = gonio_text_content(text)) != NULL) {
        status = rows < P ? parse_row(text, rows, line, out, error)
                          : gonio_text_fail(text, error, "more than %d parameters", P);
        rows++;
    }
    return status != GONIO_OK || rows == P
               ? status
               : gonio_fail_line(error, GONIO_E_INPUT, text->path, -1, "%d parameters, expected %d", rows, P);
}

// A covariance is symmetric and no variance is negative; half of the file from elsewhere would not be.
static gonio_status check(const gonio_alignment *a, const char *path, gonio_error *error) {
    for (int k = 0; k < P; k++) {
        for (int l = 0; l < P; l++) {
            const double c = a->covariance[k * P + l],
                         limit = sqrt(a->covariance[k * P + k] * a->covariance[l * P + l]);
            if (!(fabs(c) <= 1.000001 * limit) || fabs(c - a->covariance[l * P + k]) > 1e-9 * limit) {
                return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "the covariance of '%s' and '%s' is none",
                                       gonio_alignment_parameter_name(k), gonio_alignment_parameter_name(l));
            }
        }
    }
    if (!(a->value[GONIO_CAMERA_ZERO + 2] > 0 && a->value[GONIO_LIGHT_ZERO + 2] > 0)) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "camera or light below the sample");
    }
    return GONIO_OK;
}

gonio_status gonio_alignment_read(const char *path, gonio_alignment *out, gonio_error *error) {
    *out = (gonio_alignment){.known = false};
    gonio_text text;
    gonio_status status = gonio_text_open(path, 0, &text, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = read_rows(&text, out, error);
    gonio_text_free(&text);
    status = status == GONIO_OK ? check(out, path, error) : status;
    if (status == GONIO_OK) {
        out->sigma_rad = gonio_alignment_sigma(out);
        out->known = true;
    }
    return status;
}
