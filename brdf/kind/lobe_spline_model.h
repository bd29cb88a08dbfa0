// SPDX-License-Identifier: BSD-3-Clause
// Inside the kind "lobe-spline" (brdf/kind/lobe_spline.h): the model, shared by its evaluation, its gradient and its
// file.
#ifndef GONIO_BRDF_KIND_LOBE_SPLINE_MODEL_H
#define GONIO_BRDF_KIND_LOBE_SPLINE_MODEL_H

#include "brdf/kind/lobe_spline.h"
#include "brdf/lane_geometry.h"
#include "brdf/model_file.h"

// What evaluation needs of each channel, one array a quantity so that a vector load takes four channels; everything in
// units of the transform's scale. Computed when a model is made, never stored.
enum {
    GONIO_LOBE_STRENGTH,                                          // diffuse, lobes
    GONIO_LOBE_SHARE = GONIO_LOBE_STRENGTH + 1 + GONIO_LOBES_MAX, // multiples of the shares
    GONIO_LOBE_LOW = GONIO_LOBE_SHARE + 1 + GONIO_LOBES_MAX,      // the range of the spline's value
    GONIO_LOBE_HIGH,
    GONIO_LOBE_EPS,      // the transform's
    GONIO_LOBE_HALF_PER, // 1 / (2 eps)
    GONIO_LOBE_TOP,      // what an answer may reach above the base: T(1), of the positive transform its e-th power
    GONIO_LOBE_SCALE,
    GONIO_LOBE_TABLES,
};

typedef struct gonio_lobe_spline {
    gonio_model head;
    gonio_lobe_spline_parts parts;
    double mean_strength[1 + GONIO_LOBES_MAX], per_alpha2[GONIO_LOBES_MAX];
    gonio_locator locator, sigma_locator;
    size_t stride;       // of the tables, channels rounded up so that every channel can begin a load of eight
    double *tables;      // [GONIO_LOBE_TABLES][stride]
    char (*names)[32];   // NULL when they lie in the file
    gonio_mapped mapped; // base NULL: the arrays are our own
} gonio_lobe_spline;

static inline const double *gonio_lobe_table(const gonio_lobe_spline *m, int table, size_t channel) {
    return m->tables + (size_t)table * m->stride + channel;
}

// Channels first .. first + count of one pair, into values, narrow (each may be NULL); slopes (may be NULL): d f_r /
// d transformed value.
void gonio_lobe_spline_eval(const gonio_lobe_spline *m, const gonio_vec3 *wi, const gonio_vec3 *wo, size_t first,
                            size_t count, double *values, float *narrow, double *slopes);
void gonio_lobe_spline_eval_many(const gonio_lobe_spline *m, size_t n, const gonio_vec3 *wi, const gonio_vec3 *wo,
                                 double *values);
// The standard uncertainty that the sigma lattice gives to transformed values, for a factor of 1.
double gonio_lobe_spline_sigma_shape(const gonio_lobe_spline *m, const gonio_vec3 *wi, const gonio_vec3 *wo);
double gonio_lobe_spline_support(const gonio_lobe_spline *m, const gonio_vec3 *wi, const gonio_vec3 *wo);
void gonio_lobe_spline_gradient(const gonio_model *model, const gonio_pair *pair, int channel, double out[4]);

gonio_status gonio_lobe_spline_save(const gonio_model *model, FILE *stream, gonio_error *error);
// The parts of a file's section: their arrays lie in it.
gonio_status gonio_lobe_spline_read_parts(gonio_mapped *mapped, gonio_lobe_spline_parts *parts, gonio_error *error);

#endif
