// SPDX-License-Identifier: BSD-3-Clause
// A fitted (or analytic) BRDF that can be evaluated: the only part of Gonio that a renderer needs.
//
// libgonio-eval holds what this header declares for model files and depends on libc and libm only. A model is immutable
// once made, so any number of threads may evaluate it; evaluation allocates nothing and takes no lock.
#ifndef GONIO_MODEL_H
#define GONIO_MODEL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "gonio/direction.h"
#include "gonio/export.h"
#include "gonio/status.h"

GONIO_BEGIN

typedef struct gonio_model gonio_model;

// What a kind of model must provide; a new kind is one such table (fit/ fills them).
typedef struct gonio_model_ops {
    const char *kind; // "lattice" "cbmba" "analytic" "measured" ...
    // Required; any thread, does not block or allocate. f_r (1/sr) of every channel, for unit vectors with z >= 0, with
    // both_sides for all.
    void (*eval)(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values);
    // Optional, as eval; for renderers. NULL: eval and narrow.
    void (*eval_f32)(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, float *values);
    // Optional, as eval: one channel. NULL: through eval.
    double (*eval_channel)(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, int channel);
    // Optional: n pairs, values n x channels; may reorder its work inside. NULL: eval in turn.
    void (*eval_many)(const gonio_model *model, size_t n, const gonio_vec3 *wi, const gonio_vec3 *wo, double *values);
    // Optional, as eval: derivatives of one channel by (theta_i, phi_i, theta_o, phi_o). NULL: by differences of eval.
    void (*gradient)(const gonio_model *model, const gonio_pair *pair, int channel, double gradient[4]);
    // Optional: standard uncertainty of every channel. NULL: the model carries none.
    void (*sigma)(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *sigma);
    // Optional: how far the samples support the model there, 0 to 1. NULL: the model does not tell.
    double (*support)(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo);
    // Optional, both or neither; as eval: draw wo from a density about proportional to f_r cos(theta_o), summed over
    // the channels, and return that density (1/sr); the density at wo. It integrates to 1 over the upper hemisphere and
    // is above 0 wherever f_r cos(theta_o) is. NULL: a cosine and a broad lobe.
    double (*sample)(const gonio_model *model, gonio_vec3 wi, const double u[2], gonio_vec3 *wo);
    double (*pdf)(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo);
    // Write a model file to the stream, whose own failures are the caller's matter; see docs/formats.md. NULL: cannot
    // be saved.
    gonio_status (*save)(const gonio_model *model, FILE *stream, gonio_error *error);
    // Required: release everything, the model itself too.
    void (*free)(gonio_model *model);
    // Does it answer for directions behind the surface? Others are not asked: there their values are 0.
    bool both_sides;
} gonio_model_ops;

// The common head of every model; kinds embed it as their first member. Read-only for users.
struct gonio_model {
    const gonio_model_ops *ops;
    int channels;
    bool isotropic;
    const char (*channel_names)[32]; // [channels], owned by the model
    size_t bytes;                    // what evaluation needs in memory: control points, tables, hashes
    size_t control_points;           // a channel
    // What it was made of: lines "key = value" of the measurement and of what was sampled (docs/formats.md), which its
    // file keeps; NULL: nothing is known. gonio_model_tell sets it.
    char *about;
    struct gonio_sampler *sampler;   // what gonio_model_prepare_sampling built; NULL: nothing
};

// Map a model file; every length and the checksum are checked before use. The caller frees it with gonio_model_free.
// GONIO_E_INPUT with file and byte where the file is not a sound model of a version that this code reads.
gonio_status gonio_model_open(const char *path, gonio_model **out, gonio_error *error);
// The same but for the checksum, which takes a pass over the file: for files that are known to be sound. Lengths and
// tables are checked, control points are read when they are evaluated; microseconds, whatever the size. As with
// every mapped file, whoever shortens it in place while the model lives makes evaluations end with SIGBUS; Gonio itself
// only replaces files.
gonio_status gonio_model_map(const char *path, gonio_model **out, gonio_error *error);
// The bytes of a model file in memory (a resource of the program, an entry of an archive, a received message), with all
// the checks of gonio_model_open. Borrowed: data must stay where it is, unchanged, until the model is freed. Data that
// begin at a multiple of 64 bytes are used in place; others cost a copy. Messages call the file "(memory)".
gonio_status gonio_model_open_memory(const void *data, size_t length, gonio_model **out, gonio_error *error);
// Write it (beside, sync, rename). GONIO_E_UNSUPPORTED for kinds that have no file form.
gonio_status gonio_model_save(const gonio_model *model, const char *path, gonio_error *error);
void gonio_model_free(gonio_model *model); // NULL is allowed
// Put a copy of these lines in place of model->about; NULL: none. Evaluation does not depend on them.
gonio_status gonio_model_tell(gonio_model *model, const char *about, gonio_error *error);

// f_r of every channel (values: channels); wi and wo must be unit vectors. Behind the surface (z < 0 by more than
// rounding, 1e-9) lie transmission and what the back reflects: f is then dL_o / dE_i all the same, E_i with |cos
// theta_i|. Halves that the model does not hold are 0, as all behind the surface are of a model of reflection alone; so
// are their gradients and sigmas.
void gonio_model_eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values);
void gonio_model_eval_f32(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, float *values);
double gonio_model_eval_channel(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, int channel);
void gonio_model_eval_pair(const gonio_model *model, const gonio_pair *pair, double *values);
// n pairs at once; values: n x channels, channel fastest.
void gonio_model_eval_many(const gonio_model *model, size_t n, const gonio_vec3 *wi, const gonio_vec3 *wo,
                           double *values);
// Gradient of one channel with respect to (theta_i, phi_i, theta_o, phi_o), 1/sr/rad.
void gonio_model_gradient(const gonio_model *model, const gonio_pair *pair, int channel, double gradient[4]);
// Standard uncertainty of every channel; false where the model carries none (sigma untouched).
bool gonio_model_sigma(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *sigma);

// How far the samples that a model was fitted to support it there: 1 beside a sample, 0 where physics alone speaks. It
// is the part of the variance of an unknown deviation from physics that the samples take away (docs/uncertainty.md).
// NaN where the model does not tell.
double gonio_model_support(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo);

// Importance sampling: draw wo for light from wi. u: two numbers of [0, 1), uniform for an estimate. Returns the
// density at wo (1/sr, above 0), with f_r of every channel in values (may be NULL), so that values[c] wo.z / density
// averages to the albedo at wi. wo lies above the surface; no sample is lost. Any thread, allocates nothing. Whoever
// follows light from the eye exchanges the two directions, which a reciprocal model allows. Of a model of halves all of
// this is of its front reflection, whose wi and wo lie above the surface.
double gonio_model_sample(const gonio_model *model, gonio_vec3 wi, const double u[2], gonio_vec3 *wo, double *values);
// That density at wo. It integrates to 1 over the upper hemisphere and is above 0 wherever f_r cos(theta_o) is.
double gonio_model_pdf(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo);
// Tabulate the model's own f_r cos(theta_o) for both, once and before other threads use the model; a tenth of a second
// and half a megabyte of an isotropic model of few channels. Without it a kind draws from its lobes, or from a cosine
// and a broad lobe; with it splines and measured tables are drawn as they are. A table that would scatter more than the
// lobes is not kept. Done again, it changes nothing.
gonio_status gonio_model_prepare_sampling(gonio_model *model, gonio_error *error);
// ---- the halves of a thin sheet (gonio_half) ----

// The model of one half, which takes directions in front of the surface (gonio_pair_raised). Borrowed: it lives as long
// as the model. A model of reflection alone is its own front reflection. NULL: the model has no such half.
const gonio_model *gonio_model_half(const gonio_model *model, gonio_half half);
// One model of up to four, NULL where there is none; they have the same number of channels, and the names of the first.
// The new model owns them and its caller frees it; on failure they stay the caller's. A front reflection alone is given
// back as it is.
gonio_status gonio_model_of_halves(gonio_model *const halves[GONIO_HALVES], gonio_model **out, gonio_error *error);

// The wavelength in nm of a channel whose name states it ("550nm"); NaN where it is not known.
double gonio_model_wavelength_nm(const gonio_model *model, int channel);

// An exact analytic BRDF: "lambert:rho=0.5", "ward:rho_d=0.3,rho_s=0.2,alpha=0.15", "ggx:...", a channel triple as
// rho_d=0.3/0.2/0.1, or "file:PATH" (a measured table or a model file). A thin sheet is "SPEC|SPEC|SPEC|SPEC", the
// specs of its halves in the order of gonio_half, of which any may be empty, or
// "translucent:rho=,rho_s=,tau=,tau_s=,alpha=, alpha_t=": two like faces, of diffuse parts and Ward's lobes, about the
// way straight through as about the mirror. Not in libgonio-eval. Unknown names, keys and impossible values are
// GONIO_E_USAGE, and the message lists what exists. The caller frees the model.
gonio_status gonio_model_from_spec(const char *spec, gonio_model **out, gonio_error *error);
// MODEL of the command line: a model file, "spec:SPEC", or a measured table (MERL, RGL). The caller frees the model.
gonio_status gonio_model_resolve(const char *name, gonio_model **out, gonio_error *error);

GONIO_END
#endif
