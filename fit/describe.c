// SPDX-License-Identifier: BSD-3-Clause
// What a fitted model tells of itself: the measurement's head, what was sampled, how it was fitted and how well.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/head.h"
#include "base/number.h"
#include "base/text.h"
#include "fit/names.h"
#include "gonio/fit.h"

typedef struct lines {
    char *text;
    gonio_status status;
    gonio_error *error;
} lines;

static void add(lines *l, const char *key, const char *value) {
    l->status = l->status == GONIO_OK ? gonio_head_add(&l->text, key, value, l->error) : l->status;
}

static void add_errors(lines *l, const char *key, const gonio_errors *e) {
    char text[200];
    if (e->samples == 0) {
        return;
    }
    // Fewer digits than a compiler or a libm could change.
    gonio_number_format(text, sizeof text, "rmse %.4g, median_rel %.3g %%, rms_log %.3g, max_rel %.3g (%zu samples)",
                        e->rmse, 100 * e->median_rel, e->rms_log, e->max_rel, e->samples);
    add(l, key, text);
}

gonio_status gonio_model_describe(gonio_model *model, const gonio_coverage *coverage, const gonio_fit_report *report,
                                  gonio_error *error) {
    lines l = {.error = error};
    char text[400];
    l.status = gonio_head_copy(model->about, &l.text, error);
    if (l.status == GONIO_OK) {
        l.status = gonio_coverage_put(coverage, &l.text, error);
    }
    snprintf(text, sizeof text, "%s level %d, %s, %s %s", report->method, report->level,
             gonio_coordinates_name(report->coordinates), gonio_domain_name(report->domain), report->options);
    add(&l, "fit", text);
    add_errors(&l, "train", &report->train);
    add_errors(&l, "held_out", &report->held_out);
    l.status = l.status == GONIO_OK ? gonio_model_tell(model, l.text, error) : l.status;
    free(l.text);
    return l.status;
}
