// SPDX-License-Identifier: BSD-3-Clause
// How alike the deviations of a material from what physics tells are at two places.
//
// A Gaussian of the distance in half-vector coordinates, in each of them over a length of its own, made symmetric under
// reciprocity and, where the samples are, under mirroring: k(x, y) = sum_g e^(-|x - g y|^2 / 2) over the images g,
// scaled to k(x, x) = 1 (the symmetries are isometries, so that it stays positive definite: Ginsbourger, Roustant and
// Durrande, "On degeneracy and invariances of random fields paths", 2016).
#ifndef GONIO_FIT_PRIOR_KERNEL_H
#define GONIO_FIT_PRIOR_KERNEL_H

#include "fit/prepare/dataset.h"

typedef struct gonio_prior_kernel {
    int dims;
    unsigned images[4]; // axes to reflect
    int images_n;
    size_t n;
    double *x;      // n x dims, in the kernel's lengths
    double *norm;   // [n]
    double *factor; // n x n: Cholesky factor of the samples' covariance, their nugget included
} gonio_prior_kernel;

// Without samples, for the two calls below it.
void gonio_prior_kernel_start(gonio_prior_kernel *kernel, int dims, bool mirror);
// A pair's place in the kernel's lengths; x[dims].
void gonio_prior_kernel_place(const gonio_prior_kernel *kernel, const gonio_pair *pair, double *x);
// Before it is scaled, of lengths that are `times` the kernel's.
double gonio_prior_kernel_covariance(const gonio_prior_kernel *kernel, const double *x, const double *y, double times);

gonio_status gonio_prior_kernel_init(gonio_prior_kernel *kernel, const gonio_dataset *data, gonio_error *error);
void gonio_prior_kernel_release(gonio_prior_kernel *kernel);
// The support of a pair: the part of its deviation's prior variance that the samples take away, 0 to 1. work[n] is then
// what gonio_prior_kernel_weights turns into the weights of the deviations at the samples in the one at the pair.
double gonio_prior_kernel_support(const gonio_prior_kernel *kernel, const gonio_pair *pair, double *work);
void gonio_prior_kernel_weights(const gonio_prior_kernel *kernel, double *work);
// How many deviations the samples determine: the trace of K (K + nugget)^-1.
gonio_status gonio_prior_kernel_freedom(const gonio_prior_kernel *kernel, double *freedom, gonio_error *error);

#endif
