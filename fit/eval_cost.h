// SPDX-License-Identifier: BSD-3-Clause
// What an evaluation of a model costs on this machine, measured before the model is fitted.
#ifndef GONIO_FIT_EVAL_COST_H
#define GONIO_FIT_EVAL_COST_H

#include "brdf/kind/lobe_spline.h"
#include "fit/smooth/form.h"

// ns of one evaluation of every channel at random directions: of a model of this form over these lobes (NULL: none).
// The least of several short runs, so that other work on the machine counts little. Takes some milliseconds.
gonio_status gonio_eval_cost_ns(const gonio_dataset *data, const gonio_smooth_form *form, const gonio_lobe_base *lobes,
                                double *ns, gonio_error *error);

#endif
