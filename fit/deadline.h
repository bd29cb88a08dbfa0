// SPDX-License-Identifier: BSD-3-Clause
// Whether long work may go on: Ctrl-C through the caller's progress function, and the time that --max-seconds leaves.
#ifndef GONIO_FIT_DEADLINE_H
#define GONIO_FIT_DEADLINE_H

#include <math.h>

#include "base/clock.h"
#include "gonio/fit.h"

// One for a fit; used by the thread that called the fit alone.
typedef struct gonio_deadline {
    const gonio_fit_options *options;
    double start, seconds; // of this fit; INFINITY: no limit
    double until;          // when the step under way must end
    double fraction;       // told last
    const char *what;
} gonio_deadline;

// max_seconds is shared evenly by the saved model's fit and those that only tell the held-out errors.
static inline gonio_deadline gonio_deadline_begin(const gonio_fit_options *options) {
    const int fits = 1 + (options->folds >= 2 ? options->folds : options->hold_out > 0 ? 1 : 0);
    return (gonio_deadline){.options = options,
                            .start = gonio_clock_s(),
                            .seconds = options->max_seconds > 0 ? options->max_seconds / fits : INFINITY,
                            .until = INFINITY,
                            .what = "fitting"};
}

// The next step must end when `share` of the fit's time is over.
static inline void gonio_deadline_step(gonio_deadline *w, double share) { w->until = w->start + share * w->seconds; }

static inline double gonio_deadline_left(const gonio_deadline *w) { return w->until - gonio_clock_s(); }

// Tell how far the fit is; GONIO_E_INTERRUPTED where the caller wants it to stop.
static inline gonio_status gonio_deadline_report(gonio_deadline *w, double fraction, const char *what,
                                                 gonio_error *error) {
    const gonio_fit_options *o = w->options;
    w->fraction = fraction;
    w->what = what;
    return o->progress == NULL || o->progress(o->progress_context, fraction, what, NAN)
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_INTERRUPTED, "interrupted while %s; nothing was written", what);
}

// Ask only. NULL: nobody watches.
static inline gonio_status gonio_deadline_poll(gonio_deadline *w, gonio_error *error) {
    return w != NULL ? gonio_deadline_report(w, w->fraction, w->what, error) : GONIO_OK;
}

static inline bool gonio_deadline_over(const gonio_deadline *w) { return w != NULL && gonio_deadline_left(w) <= 0; }

#endif
