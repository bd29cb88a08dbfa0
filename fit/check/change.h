// SPDX-License-Identifier: BSD-3-Clause
// What the transforms of tables and of scattered samples share.
#ifndef GONIO_FIT_CHECK_CHANGE_H
#define GONIO_FIT_CHECK_CHANGE_H

#include "fit/check/table.h"

// GONIO_E_USAGE where a number is none that a change can have.
gonio_status gonio_change_check(const gonio_change *change, gonio_error *error);
// f of the way from a to its target.
double gonio_change_between(const gonio_change *change, double a, double target);
// Value and sigma of sample i, channel c of `out` become those of `in` on the way to sum weight value over the samples
// `of` [n], whose weights add up to 1; i is one of them, or not.
void gonio_change_towards(const gonio_change *change, const gonio_samples *in, size_t i, size_t c, size_t n,
                          const size_t *of, const double *weight, gonio_samples *out);
// weight[n] of the samples `of` in a mean of channel c: inverse variances, or equal ones where any is unknown.
void gonio_change_weigh(const gonio_samples *in, size_t c, size_t n, const size_t *of, double *weight);
// The factor that (5.5), (5.8) give an incidence of this albedo.
double gonio_change_factor(const gonio_change *change, double albedo);

// Squares of element `at` of k orthonormal vectors of n: how much of an entry the products take from itself.
double gonio_change_leverage(const double *vectors, size_t n, size_t k, size_t at);
// What is left of an entry's random sigma on the way to products of these leverages.
double gonio_change_product_sigma(const gonio_change *change, double u, double v);

// A copy of the samples; twice: each with its mirror image. The caller frees it.
gonio_status gonio_change_copy(const gonio_samples *in, bool twice, gonio_samples **out, gonio_error *error);
// Samples of the front reflection; *out is a copy of them and may become longer, or another set.
gonio_status gonio_change_half(const gonio_samples *samples, const gonio_change *change, int threads,
                               gonio_samples **out, gonio_error *error);
// Towards the best sum of products; out is a copy of the table's samples.
gonio_status gonio_change_separable(const gonio_table *table, const gonio_change *change, gonio_samples *out,
                                    gonio_error *error);
// Change *out, a copy of the table's samples.
gonio_status gonio_change_table(const gonio_table *table, const gonio_change *change, int threads, gonio_samples **out,
                                gonio_error *error);
// The same of scattered samples; *out may become longer, or another set.
gonio_status gonio_change_scattered(const gonio_samples *samples, const gonio_change *change, int threads,
                                    gonio_samples **out, gonio_error *error);
// Energy of samples of any form, in place.
gonio_status gonio_change_conserve(const gonio_change *change, int threads, gonio_samples *out, gonio_error *error);
// Samples with other halves than the front reflection.
gonio_status gonio_change_sheet(const gonio_samples *samples, const gonio_change *change, int threads,
                                gonio_samples *out, gonio_error *error);
// A model with the products of the best approximation of `model`, from a table of it at equal steps; borrowed models
// stay the caller's. tables of gonio_transformed_parts in *tables, which the caller frees.
gonio_status gonio_change_products(const gonio_model *model, int products, int thetas, double **tables, int threads,
                                   gonio_error *error);

#endif
