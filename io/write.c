// SPDX-License-Identifier: BSD-3-Clause
// Writing a model as a table of a format.
#include <stdio.h>

#include "base/text.h"
#include "gonio/output.h"
#include "io/format.h"

// The table, of the model or of one half of it, written beside, read back and held against the model before it takes
// its place.
static gonio_status put_table(const gonio_format *f, const gonio_model *model, const gonio_model *half,
                              const char *path, const gonio_format_values *values, double max_error, bool measure,
                              gonio_write_report *told, gonio_error *error) {
    gonio_output *output;
    gonio_status status = gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    FILE *stream = gonio_output_stream(output);
    status = gonio_write_flushed(stream, path, f->write_table(half, values, stream, told, error), error);
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

static void tell_halves(unsigned there, unsigned held, gonio_write_report *told) {
    char text[160] = "";
    for (int h = 0; h < GONIO_HALVES; h++) {
        if ((there & ~held) >> h & 1) {
            gonio_text_append(text, sizeof text, "%s%s", text[0] != 0 ? ", " : "", gonio_half_name((gonio_half)h));
        }
    }
    if (text[0] != 0) {
        char all[200];
        snprintf(all, sizeof all, "the halves %s", text);
        gonio_write_lost(told, all);
    }
}

// What of the model the format holds: *written is all of it, or one half.
static gonio_status choose_halves(const gonio_format *f, const gonio_model *model, gonio_format_values *values,
                                  gonio_write_report *told, const gonio_model **written, gonio_error *error) {
    const unsigned holds = f->halves != 0 ? f->halves : 1u << GONIO_REFLECTION;
    unsigned there = 0;
    int first = -1;
    for (int h = GONIO_HALVES - 1; h >= 0; h--) {
        there |= (unsigned)(gonio_model_half(model, (gonio_half)h) != NULL) << h;
        first = (there & holds) >> h & 1 ? h : first;
    }
    if (first < 0) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED, "a %s is written of the %s, which the model does not hold",
                          f->summary, f->halves != 0 ? "light's side in front" : "front reflection");
    }
    unsigned held = there & holds;
    if ((held >> values->half & 1) == 0) {
        values->half = (gonio_half)first;
    }
    if (f->one_half) {
        held = 1u << values->half;
    }
    *written = held == 1u << values->half && model->ops->both_sides ? gonio_model_half(model, values->half) : model;
    told->halves = held;
    tell_halves(there, held, told);
    return GONIO_OK;
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
    const gonio_model *written = model;
    status = choose_halves(f, model, &values, &told, &written, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = put_table(f, model, written, path, &values, options != NULL ? options->max_error : 0, report != NULL,
                       &told, error);
    if (report != NULL) {
        *report = told;
    }
    return status;
}
