// SPDX-License-Identifier: BSD-3-Clause
// What a fitting method provides. A new method is one file, with its registration at the end, and one line in
// fit/methods.def.
#ifndef GONIO_FIT_METHOD_H
#define GONIO_FIT_METHOD_H

#include <stddef.h>

#include "gonio/fit.h"

// An option that a method has: a member of gonio_fit_options, and what it is to this method where that differs from
// others: its default, say. NULL: nothing to add.
typedef struct gonio_method_option {
    size_t offset;
    const char *note;
} gonio_method_option;

#define GONIO_METHOD_OPTION(member, text)                                                                              \
    { offsetof(gonio_fit_options, member), text }

// Rows of `gonio tradeoff`: every level from `first` to `last` in these coordinates and this domain.
typedef struct gonio_method_form {
    int first, last;         // GONIO_LEVEL_AUTO: one row, the method chooses
    int coordinates, domain; // of the enums, AUTO among them, or GONIO_METHOD_EVERY: a row for each
    const char *with;        // other options, "order=2 grid=angles", by the names of gonio_fit_keys; NULL: none
} gonio_method_form;

#define GONIO_METHOD_EVERY (-2)
#define GONIO_METHOD_FORM_AUTO                                                                                         \
    { GONIO_LEVEL_AUTO, GONIO_LEVEL_AUTO, GONIO_COORDINATES_AUTO, GONIO_DOMAIN_AUTO, NULL }

// Bytes that fitting n samples takes at most beside the samples themselves, a model that comes out of it included.
// size->samples is not looked at: n is of a part.
typedef double gonio_method_memory(const gonio_fit_size *size, double n);

typedef struct gonio_method {
    const char *name;
    const char *summary;                // one line for --help
    const char *kind;                   // of the models that it makes (gonio_model_ops)
    const gonio_method_option *options; // beside those that all methods have (fit/options.c); ends with {0}
    // Fit the samples (at least one). Every choice that the options leave open is made from these samples alone: the
    // driver (fit/fit.c) calls it for the whole set and again without each held-out part. Fills *out and, of the
    // report, level, coordinates, domain, options and note; the driver fills the rest. On failure nothing leaks.
    gonio_status (*fit)(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                        gonio_fit_report *report, gonio_error *error);
    gonio_method_memory *memory;
    const gonio_method_form *forms; // rows of the trade-off
    int forms_n;
} gonio_method;

// The method of that name, or NULL. *name NULL stands for the default method and is replaced by its name.
const gonio_method *gonio_method_find(const char **name);
// By number, from 0 on; NULL past the last one.
const gonio_method *gonio_method_at(int index);

#endif
