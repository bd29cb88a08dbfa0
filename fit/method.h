// What a fitting method provides. A new method is one gonio_fit_method and one line in fit/methods.h.
#ifndef GONIO_FIT_METHOD_H
#define GONIO_FIT_METHOD_H

#include "gonio/fit.h"

typedef struct gonio_fit_method {
    const char *summary; // one line for --help
    bool levels;         // --level and --tolerance mean something
    // Fit the samples (at least one). Every choice that the options leave open is made from these samples alone: the
    // driver (fit/fit.c) calls it for the whole set and again without each held-out part. Fills *out and, of the
    // report, level, coordinates, domain, options and note; the driver fills the rest. On failure nothing leaks.
    gonio_status (*fit)(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                        gonio_fit_report *report, gonio_error *error);
} gonio_fit_method;

// The method of that name, or NULL. *name NULL stands for the default method and is replaced by its name.
const gonio_fit_method *gonio_fit_method_find(const char **name);

#endif
