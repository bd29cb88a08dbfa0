// SPDX-License-Identifier: BSD-3-Clause
// The function space and the penalty of a least-squares fit, shared by the direct and the iterative solver.
//
// Minimised is  sum_c w_c (f(x_c) - t_c)^2 + lambda R(f),  f a cubic B-spline on the lattice of a level, and
//   R = 2^h sum_d stretch_d |D_d^2 phi|^2 + ridge |phi|^2,
// D_d^2 the second differences of the control points along axis d (Eilers & Marx 1996, "Flexible smoothing with
// B-splines and penalties", section 3, in each axis). 2^h makes the sum approximate the integral of the squared second
// derivative, so that a lambda means the same at every level; the ridge draws what no sample says to the base.
#ifndef GONIO_FIT_SMOOTH_FORM_H
#define GONIO_FIT_SMOOTH_FORM_H

#include "fit/prepare/dataset.h"

#define GONIO_SMOOTH_RIDGE 1e-4

typedef struct gonio_smooth_form {
    gonio_coordinates coordinates;
    int level;
    bool mirror;
    double stretch[4];  // how stiff each axis is; 1: as the others
    double reciprocity; // 0: none; 1: forced. Half-vector coordinates: the non-reciprocal part's prior variance is
                        // multiplied by 1 - reciprocity
    double profile;     // weight of the profile's prior variance (brdf/spline/profile.h); 0: there is none
    int profile_level;
    bool shares;               // the base's shares are terms of the fit
    double profile_stretch[2]; // how stiff its r and theta_d are
} gonio_smooth_form;

gonio_smooth_form gonio_smooth_form_default(gonio_coordinates coordinates, int level, bool mirror);

#endif
