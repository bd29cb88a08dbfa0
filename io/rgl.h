// SPDX-License-Identifier: BSD-3-Clause
// The model in an RGL file (io/rgl.c), which its writer builds too.
#ifndef GONIO_IO_RGL_H
#define GONIO_IO_RGL_H

#include "io/format.h"

#define GONIO_RGL_COSINE_MIN 1e-4 // the division by cos(theta_o) ends at 89.994 deg

// A stack of `slices` images of h x w values, row by row.
typedef struct gonio_rgl_stack {
    size_t slices, h, w;
    float *values;
} gonio_rgl_stack;

typedef struct gonio_rgl {
    gonio_model head;
    size_t n_phi, n_theta;
    double *phi_i, *theta_i;                   // ascending, rad
    int reduction;                             // the files' phi_i cover a turn over 1, 2 or 4
    bool jacobian;                             // the stored spectra are without ndf/(4 sigma)
    gonio_rgl_stack ndf, sigma, vndf, spectra; // spectra: slices = n_phi x n_theta (x channels)
    float *conditional, *marginal;             // of vndf: running integrals along each row, and over the rows
    char (*names)[32];
} gonio_rgl;

extern const gonio_model_ops gonio_rgl_ops;

// Which slices to blend for an incident direction.
typedef struct gonio_rgl_blend {
    size_t slice[4];
    double weight[4];
} gonio_rgl_blend;

// Scale vndf to integrate to 1 in each slice, and fill the running integrals. path: for messages.
gonio_status gonio_rgl_integrate(gonio_rgl *m, const char *path, gonio_error *error);
// Where in the uniform square (x, y) the file holds a pair's values, in which slices, and what they are to be
// multiplied by. Directions of a reduced file must have been turned.
gonio_rgl_blend gonio_rgl_locate(const gonio_rgl *m, gonio_vec3 wi, gonio_vec3 wo, double *x, double *y, double *scale);
// The half vector's u_theta and u_phi at a point of the uniform square of one slice.
void gonio_rgl_warp(const gonio_rgl *m, size_t slice, double x, double y, double u[2]);
// Bilinear in one image at (x, y) of the unit square.
double gonio_rgl_bilinear(const gonio_rgl_stack *s, size_t slice, double x, double y);
// The lower of n nodes around x of [0, 1], and the fraction toward the next.
size_t gonio_rgl_node(double x, size_t n, double *fraction);

#define GONIO_RGL_COSINE_LEAST 1e-3 // of a written node's outgoing direction, where it lies below the horizon
// wo that the facet at u of a slice mirrors wi into; isotropic files count azimuths from wi's, which is 0 then.
gonio_vec3 gonio_rgl_mirrored(gonio_vec3 wi, const double u[2]);
// Change the nodes' values, which hold the model's at the nodes, to those from which readers interpolate best.
gonio_status gonio_rgl_refine(const gonio_model *model, gonio_rgl *m, int threads, gonio_error *error);
// Write a model as such a file (io/rgl_write.c).
gonio_status gonio_rgl_write(const gonio_model *model, const gonio_format_values *values, FILE *stream,
                             gonio_write_report *told, gonio_error *error);
extern const gonio_format_option gonio_rgl_write_options[];

#endif
