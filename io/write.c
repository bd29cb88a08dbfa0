// SPDX-License-Identifier: BSD-3-Clause
// Writing a model as a table of a format.
#include <stdio.h>

#include "gonio/output.h"
#include "io/format.h"

// The table, written beside, read back and held against the model before it takes its place.
static gonio_status put_table(const gonio_format *f, const gonio_model *model, const char *path,
                              const gonio_format_values *values, double max_error, bool measure,
                              gonio_write_report *told, gonio_error *error) {
    gonio_output *output;
    gonio_status status = gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    FILE *stream = gonio_output_stream(output);
    status = gonio_write_flushed(stream, path, f->write_table(model, values, stream, told, error), error);
    const char *written = gonio_output_temporary(output); // a pipe cannot be read back
    if (status == GONIO_OK && written != NULL && (measure || max_error > 0)) {
        status = gonio_write_measure(model, f, written, values->threads, told, error);
    }
    if (status == GONIO_OK && max_error > 0 && !(told->median <= max_error)) {
        status = gonio_fail(error, GONIO_E_MISMATCH,
                            "%s: half of the values read back are off by %.3g or more; at most %g"
                            " is asked for. Nothing is written",
                            path, told->median, max_error);
    }
    if (status != GONIO_OK) {
        gonio_output_abandon(output);
        return status;
    }
    return gonio_output_commit(output, error);
}

gonio_status gonio_write_table_as(const gonio_model *model, const char *path, const char *format,
                                  const gonio_write_options *options, gonio_write_report *report, gonio_error *error) {
    const gonio_format *f;
    gonio_format_values values;
    gonio_status status = gonio_format_find_writer(format, path, &f, error);
    if (status == GONIO_OK && f->write_table == NULL) {
        return gonio_fail(error, GONIO_E_USAGE, "a %s is written from samples, not from a model", f->summary);
    }
    status = status == GONIO_OK ? gonio_format_parse_write(f, format, options, &values, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    gonio_write_report told = {.quantity = f->quantity,
                               .convention = f->convention,
                               .theta_max_deg = f->theta_max_deg > 0 ? f->theta_max_deg : 90};
    snprintf(told.format, sizeof told.format, "%s", f->name);
    if (model->ops->both_sides) {
        model = gonio_model_half(model, GONIO_REFLECTION);
        gonio_write_lost(&told, "all halves but the front reflection");
    }
    if (model == NULL) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED,
                          "a %s is written of the front reflection, which the model does not hold", f->summary);
    }
    status = put_table(f, model, path, &values, options != NULL ? options->max_error : 0, report != NULL, &told, error);
    if (report != NULL) {
        *report = told;
    }
    return status;
}
