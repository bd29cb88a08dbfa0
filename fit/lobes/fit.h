// SPDX-License-Identifier: BSD-3-Clause
// Robust fits of one or two analytic lobes and a diffuse term, the base that a spline then corrects.
#ifndef GONIO_FIT_LOBES_FIT_H
#define GONIO_FIT_LOBES_FIT_H

#include "brdf/kind/lobe_spline.h"
#include "fit/prepare/dataset.h"

// Fit the base to the data: shapes to the mean over channels, strengths to each channel. base->strength is the
// caller's to free. near: a base of the same family and lobes, fitted to much the same data, to begin from (NULL: many
// starts). GONIO_E_CONVERGENCE where no start leads anywhere; GONIO_E_INPUT for signed data.
gonio_status gonio_lobe_fit(const gonio_dataset *data, gonio_lobe_family family, int lobes, const gonio_lobe_base *near,
                            gonio_lobe_base *base, gonio_error *error);
// The smallest cosine of either direction among the geometries.
float gonio_lobe_cosine_min(const gonio_dataset *data);
// The base's transformed values at the data's geometries, n x channels.
void gonio_lobe_targets(const gonio_lobe_base *base, const gonio_dataset *data, double *targets);

#endif
