// SPDX-License-Identifier: BSD-3-Clause
// What a library holds, and the Gaussian process that it is.
//
// Nielsen, Jensen and Ramamoorthi, "On optimal, minimal BRDF sampling for reflectance acquisition" (2015), map values
// to
//   z = ln((f w + eps) / (r w + eps)),   w = max(cos(theta_i) cos(theta_o), eps),
// r the library's median, and take principal components of z. Here z is a Gaussian process: mean m, components b_k of
// variance 1 (so that sum b_k b_k^T is the library's covariance), and what the components leave of materials that they
// were not learnt from, of standard deviation s and alike over a kernel's lengths:
//   k(x, y) = sum_k b_k(x) b_k(y) + s(x) s(y) exp(-|x - y|^2 / 2).
// Their ridge is the noise. The posterior of the process is the fit: for few samples it is theirs of the components,
// for more it follows the samples.
#ifndef GONIO_FIT_LIBRARY_LIBRARY_H
#define GONIO_FIT_LIBRARY_LIBRARY_H

#include "brdf/grid/grid.h"
#include "gonio/library.h"

#define LIBRARY_LEVEL 5 // of the grid of half-angles: 33 nodes an axis
#define LIBRARY_EPS 1e-3
#define LIBRARY_RANK_MAX 40
#define LIBRARY_THETA_MAX_DEG 87 // nodes nearer to the horizon, or below it, take the values of there
#define LIBRARY_NAME_MAX 64

// Arrays hold nodes x rank, the component fastest. mean, reference and components are control points of cubic splines.
struct gonio_library {
    gonio_grid grid;
    int rank;
    gonio_library_facts facts;
    double *mean, *reference; // of z; ln(r w + eps)
    double *components;
    double *rest;                    // s, at the nodes
    char (*names)[LIBRARY_NAME_MAX]; // [facts.models]
};

// A place with all that the process knows of it.
typedef struct library_place {
    gonio_pair pair;
    double weight;      // w
    double mean;        // of z
    double reference;   // ln(r w + eps)
    double rest;        // s
    double at[3];       // in the kernel's lengths
    double *components; // [rank], borrowed
} library_place;

// The pair that a node stands for; *real: both of its directions lie above that limit.
gonio_pair gonio_library_node(const gonio_grid *grid, size_t node, bool *real);
gonio_status gonio_library_new(int rank, int models, gonio_library **out, gonio_error *error);
// components: room for [rank].
void gonio_library_place(const gonio_library *library, const gonio_pair *pair, double *components,
                         library_place *place);
double gonio_library_covariance(const gonio_library *library, const library_place *p, const library_place *q);
// z of a value, and back; d z / d f.
double gonio_library_map(const library_place *place, double f);
double gonio_library_unmap(const library_place *place, double z);
double gonio_library_slope(const library_place *place, double f);

// The process given samples of one or several channels: weights, and what leaves each out.
typedef struct library_posterior {
    const gonio_library *learnt;
    size_t n;
    int channels;
    library_place *places; // [n]
    double *components;    // [n][rank]
    double *factor;        // n x n, Cholesky's
    double *weights;       // [channels][n]
    double residual;       // mean square of the standardised leave-one-out residuals
    double loo_rel;
} library_posterior;

gonio_status gonio_library_condition(const gonio_library *library, const gonio_samples *samples, library_posterior *p,
                                     gonio_error *error);
void gonio_library_posterior_release(library_posterior *p);
// z[channels] and its variance (of all channels alike) at a place; work[n].
void gonio_library_predict(const library_posterior *p, const library_place *at, double *z, double *variance,
                           double *work);

#endif
