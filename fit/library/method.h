// SPDX-License-Identifier: BSD-3-Clause
// `fit --prior`: a method's fit with a learned prior before it.
#ifndef GONIO_FIT_LIBRARY_METHOD_H
#define GONIO_FIT_LIBRARY_METHOD_H

#include "fit/method.h"

// Few samples are the prior's to fit, or GONIO_E_MISMATCH where they are not like its library; of more, whichever of
// prior and method tells held-out ones better fits; many need no prior. The report says what was done.
gonio_status gonio_library_method(const gonio_method *method, const gonio_samples *samples,
                                  const gonio_fit_options *options, gonio_model **out, gonio_fit_report *report,
                                  gonio_error *error);

#endif
