// SPDX-License-Identifier: BSD-3-Clause
// The direct solver of small sets: everything that depends on lambda in closed form, leave-one-out errors too.
//
// R is diagonal in products of the one-dimensional penalty's eigenvectors, so the smoothing prior's covariance between
// samples, K = B R^-1 B^T, is a sum of outer products, and the fit in sample space is t = K (K + lambda I)^-1 t (for
// the duality see Wahba 1990, "Spline models for observational data", section 1.3). One eigendecomposition of the n x n
// K serves every lambda, channel and base.
#ifndef GONIO_FIT_SMOOTH_DENSE_H
#define GONIO_FIT_SMOOTH_DENSE_H

#include "brdf/kind/lobe_spline.h"
#include "brdf/spline/lattice.h"
#include "fit/smooth/form.h"

typedef struct gonio_smooth_dense gonio_smooth_dense;

// More geometries than this take minutes (n^3) and the iterative solver has them.
#define GONIO_SMOOTH_DENSE_MAX 2000
// The finest level that is worth its n^2 8^level here.
#define GONIO_SMOOTH_DENSE_LEVEL_MAX_3D 5
#define GONIO_SMOOTH_DENSE_LEVEL_MAX_4D 3

// Build and decompose; data is borrowed until the solver is freed. shares (NULL: none): lobes whose shares
// (brdf/kind/lobe_spline.h) are further terms of the fit, each as free a priori as a standard deviation of the spline's
// unit; nothing of the lobes is kept. A profile is for isotropic half-vector coordinates; elsewhere there is none. Uses
// one thread, so that callers can run several at once with the same bits.
gonio_status gonio_smooth_dense_new(const gonio_dataset *data, const gonio_smooth_form *form,
                                    const gonio_lobe_base *shares, gonio_smooth_dense **out, gonio_error *error);
void gonio_smooth_dense_free(gonio_smooth_dense *dense); // NULL is allowed
const gonio_smooth_form *gonio_smooth_dense_form(const gonio_smooth_dense *dense);

// Leave-one-out residuals (target minus the prediction of the fit without that geometry), n x channels, for `count`
// lambdas at once: residuals[l] is n x channels. targets: n x channels.
gonio_status gonio_smooth_dense_loo(const gonio_smooth_dense *dense, const double *targets, int channels, int count,
                                    const double *lambdas, double *const *residuals, gonio_error *error);
// The fit of targets, channel c with lambdas[c], as a lattice that the caller releases.
gonio_status gonio_smooth_dense_solve(const gonio_smooth_dense *dense, const double *targets, int channels,
                                      const double *lambdas, gonio_lattice *lattice, gonio_error *error);
// The profile's lattice (two-dimensional, brdf/spline/profile.h) of the same fit; points NULL where there is none.
gonio_status gonio_smooth_dense_profile_solve(const gonio_smooth_dense *dense, const double *targets, int channels,
                                              const double *lambdas, gonio_lattice *lattice, gonio_error *error);
// The shares' coefficients of the same fit: out[channels][1 + GONIO_LOBES_MAX]; the caller frees it, NULL where there
// are none.
gonio_status gonio_smooth_dense_shares_solve(const gonio_smooth_dense *dense, const double *targets, int channels,
                                             const double *lambdas, double **out, gonio_error *error);
// At m points (at[m x dims]): weights[n x m], sample fastest, of the prediction in the samples' targets times their
// root weights; variance[m] of the prediction in units of the noise's, what smoothing and gaps leave unknown included.
// shares: of the base at them (gonio_smooth_shares); not looked at where they are no terms of the fit.
gonio_status gonio_smooth_dense_spread(const gonio_smooth_dense *dense, double lambda, size_t m, const double *at,
                                       const double *shares, double *weights, double *variance, gonio_error *error);
#define GONIO_SMOOTH_SHARES (1 + GONIO_LOBES_MAX)
// out[n x GONIO_SMOOTH_SHARES], pair fastest: the shares of a base's terms at n pairs.
void gonio_smooth_shares(const gonio_lobe_base *lobes, int channels, size_t n, const gonio_pair *pairs, double *out);
// out[n x n] = lambda (K + lambda)^-1: targets times root weights -> the fit's residuals times root weights.
gonio_status gonio_smooth_dense_influence(const gonio_smooth_dense *dense, double lambda, double *out,
                                          gonio_error *error);
const double *
gonio_smooth_dense_roots(const gonio_smooth_dense *dense); // [n] square roots of the weights; the solver's

#endif
