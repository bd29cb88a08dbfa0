// What an evaluation of a model costs on this machine, measured before the model is fitted.
#ifndef GONIO_FIT_AUTO_COST_H
#define GONIO_FIT_AUTO_COST_H

#include "fit/lobe_model.h"
#include "fit/lsq_form.h"

// ns of one evaluation of every channel at random directions: of a model of this form over these lobes (NULL: none).
// The least of several short runs, so that other work on the machine counts little. Takes some milliseconds.
gonio_status gonio_auto_cost_ns(const gonio_lsq_data *data, const gonio_lsq_form *form, const gonio_lobe_base *lobes,
                                double *ns, gonio_error *error);

#endif
