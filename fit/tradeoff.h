// SPDX-License-Identifier: BSD-3-Clause
// Every method beside every other on the same samples: cost against error.
#ifndef GONIO_FIT_TRADEOFF_H
#define GONIO_FIT_TRADEOFF_H

#include "gonio/fit.h"

// A way to fit: one of the forms that the methods name (fit/method.h).
typedef struct gonio_tradeoff_form {
    const char *method;
    int level;
    gonio_coordinates coordinates;
    gonio_domain domain;
    const char *with; // other options (fit/method.h)
} gonio_tradeoff_form;

typedef struct gonio_tradeoff_row {
    gonio_tradeoff_form form;
    gonio_status status; // not GONIO_OK: the method could not fit these samples; `error` says why
    gonio_error error;
    gonio_fit_report report;
    double eval_ns, batch_ns; // one evaluation of all channels: at random directions one by one, and batched
    size_t file_bytes;        // of the model's file
    double image_error;       // of its pictures (scene/model_pictures.h), which is the caller's to set; NaN: not known
    bool pareto;              // no other row is at least as good in held-out rms_log, bytes and eval_ns
} gonio_tradeoff_row;

// All forms that exist, into forms[limit] (may be NULL with limit 0); returns how many there are.
size_t gonio_tradeoff_forms(gonio_tradeoff_form *forms, size_t limit);
// Fit and measure one form. `options` gives hold-out, seed, threads and limits. Only a lack of memory for the row
// itself or an interruption fails; a method that fails marks its row. model: NULL, or where the fitted model goes,
// which the caller then frees; NULL comes back where there is none.
gonio_status gonio_tradeoff_measure(const gonio_samples *samples, const gonio_fit_options *options,
                                    const gonio_tradeoff_form *form, gonio_tradeoff_row *row, gonio_model **model,
                                    gonio_error *error);
// Do two forms differ by their domain alone, or not at all but for the level?
bool gonio_tradeoff_rivals(const gonio_tradeoff_form *a, const gonio_tradeoff_form *b);
// Mark the rows that no other one dominates.
void gonio_tradeoff_mark_pareto(gonio_tradeoff_row *rows, size_t n);
// The error that rows are compared by; NaN where there is none.
double gonio_tradeoff_error(const gonio_tradeoff_row *row);

#endif
