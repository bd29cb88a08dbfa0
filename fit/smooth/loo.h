// SPDX-License-Identifier: BSD-3-Clause
// Which fit predicts samples that it has not seen: leave-one-out scores of forms, bases and lambdas.
#ifndef GONIO_FIT_SMOOTH_LOO_H
#define GONIO_FIT_SMOOTH_LOO_H

#include "brdf/kind/lobe_spline.h"
#include "fit/smooth/dense.h"

// A base, and what it leaves to the spline.
typedef struct gonio_smooth_base {
    gonio_lobe_base lobes; // lobes 0: none
    double *rest;          // n x channels: targets minus the base's transformed values minus mean
    double *mean;          // [channels]
    double *low, *high;    // [channels]: what the spline may say of `rest`
} gonio_smooth_base;

// lobes NULL: no base; else taken over. Release with gonio_smooth_base_release.
gonio_status gonio_smooth_base_init(gonio_smooth_base *base, const gonio_dataset *data, gonio_lobe_base *lobes,
                                    gonio_error *error);
void gonio_smooth_base_release(gonio_smooth_base *base);

// How well a choice predicts; lower is better. score: mean over channels of ln(rms) + ln(median) / 2 of the residuals
// of transformed values: of the worst and the typical alike. rmse: of f_r.
typedef struct gonio_smooth_score {
    double score, rmse;
} gonio_smooth_score;

// The score of leave-one-out (or held-out) residuals n x channels. work: n doubles.
gonio_smooth_score gonio_smooth_score_of(const gonio_dataset *data, const double *residuals, double *work);

// lambdas[channels]: each channel's best on the grid (fixed >= 0: that one for all), and the score with them.
gonio_status gonio_smooth_choose_lambda(const gonio_smooth_dense *dense, const gonio_dataset *data,
                                        const gonio_smooth_base *base, double fixed, double *lambdas,
                                        gonio_smooth_score *score, gonio_error *error);
// Solve with them and make the model's parts: coordinates, transforms, base (copied), lattice with the mean in it.
gonio_status gonio_smooth_dense_parts(const gonio_smooth_dense *dense, const gonio_dataset *data,
                                      const gonio_smooth_base *base, const double *lambdas,
                                      gonio_lobe_spline_parts *parts, gonio_error *error);
// The parts that every model of these data has: transforms, base, names. The lattice is added by the caller.
gonio_status gonio_smooth_parts_init(gonio_lobe_spline_parts *parts, const gonio_dataset *data,
                                     const gonio_lobe_base *lobes, gonio_coordinates coordinates, gonio_error *error);
// Between which the spline's values are to be held.
gonio_status gonio_smooth_parts_hold(gonio_lobe_spline_parts *parts, const gonio_smooth_base *base, gonio_error *error);

#endif
