// SPDX-License-Identifier: BSD-3-Clause
// What makes conjugate gradients converge on a fine lattice: corrections from all coarser lattices at once.
#ifndef GONIO_FIT_SMOOTH_PRECONDITION_H
#define GONIO_FIT_SMOOTH_PRECONDITION_H

#include "base/thread_pool.h"
#include "fit/smooth/form.h"

typedef struct gonio_smooth_precondition gonio_smooth_precondition;

// For (B^T W B + lambda R) on form's lattice at `level`. lumped[count]: B^T W 1; diagonal[count]: that of B^T W B; both
// are only read here. Free with gonio_smooth_precondition_free.
gonio_status gonio_smooth_precondition_new(int dims, const gonio_smooth_form *form, int level, double lambda,
                                           const double *lumped, const double *diagonal, gonio_pool *pool,
                                           gonio_smooth_precondition **out, gonio_error *error);
// Bytes of one.
double gonio_smooth_precondition_memory(int dims, const gonio_smooth_form *form, int level);
void gonio_smooth_precondition_free(gonio_smooth_precondition *p); // NULL is allowed
// z = P^-1 r, P symmetric and positive definite. By one thread (and its pool) at a time; the pool changes no bit.
void gonio_smooth_precondition_apply(gonio_smooth_precondition *p, gonio_pool *pool, const double *r, double *z);

#endif
