// SPDX-License-Identifier: BSD-3-Clause
// What a lab's own models tell of a material that is yet to be measured: a low-rank prior, by which a few samples tell
// the rest (docs/adaptive.md).
#ifndef GONIO_LIBRARY_H
#define GONIO_LIBRARY_H

#include "gonio/export.h"
#include "gonio/fit.h"
#include "gonio/model.h"
#include "gonio/plan.h"
#include "gonio/sample.h"

GONIO_BEGIN

typedef struct gonio_library gonio_library;

#define GONIO_LIBRARY_MODELS_MIN 4     // fewer tell nothing of what else there is
#define GONIO_LIBRARY_SAMPLES_MAX 2000 // that the prior's fit takes; more need no prior

typedef struct gonio_library_options {
    int rank;                   // components; 0: chosen
    uint64_t seed;              // of the directions at which it is tried
    int threads;                // 0: all; changes nothing
    gonio_progress_fn progress; // NULL: none
    void *progress_context;
} gonio_library_options;

typedef struct gonio_library_facts {
    int models, columns; // a column a channel of a model
    int rank;
    double explained;   // part of the variance that the components hold, of models that they were not learnt from
    double inflation;   // by which sigma is widened so that left-out models lie within it
    double limit;       // mean square of the standardised leave-one-out residuals beyond which a sample is refused
    double trial_error; // median relative error of left-out models from 20 poses
    size_t bytes;
} gonio_library_facts;

// Learn from isotropic models in front of the surface; names[i] is told in messages and kept. GONIO_E_INPUT for fewer
// than GONIO_LIBRARY_MODELS_MIN, and for an anisotropic one. The caller frees *out.
gonio_status gonio_library_learn(const gonio_model *const *models, const char *const *names, size_t n,
                                 const gonio_library_options *options, gonio_library **out, gonio_error *error);
gonio_status gonio_library_save(const gonio_library *library, const char *path, gonio_error *error);
// Every length and the checksum are checked before use: GONIO_E_INPUT with the byte. The caller frees *out.
gonio_status gonio_library_open(const char *path, gonio_library **out, gonio_error *error);
void gonio_library_free(gonio_library *library); // NULL is allowed
void gonio_library_tell(const gonio_library *library, gonio_library_facts *facts);

typedef struct gonio_library_report {
    size_t samples;
    double residual; // mean square of the standardised leave-one-out residuals; about 1 of what is like the library
    double limit;    // that the library has for it
    double loo_rel;  // median relative leave-one-out error
} gonio_library_report;

// The posterior of the library's components, and of what they leave, given the samples: a model with sigma. Samples of
// 1 to GONIO_LIBRARY_SAMPLES_MAX; isotropic. GONIO_E_MISMATCH, with words, where leave-one-out residuals show that the
// sample is not like the library. report may be NULL. The caller frees *out.
gonio_status gonio_library_fit(const gonio_library *library, const gonio_samples *samples, int threads,
                               gonio_model **out, gonio_library_report *report, gonio_error *error);
// n poses with thetas up to theta_max (rad) after which least is unknown of a material of the library, the next always
// being the one that takes most of the expected variance away. The caller frees *out.
gonio_status gonio_library_plan(const gonio_library *library, size_t n, double theta_max, uint64_t seed, int threads,
                                gonio_plan **out, gonio_error *error);

// The same from text: "prior:FILE[,N=20][,theta_max=85]". _is: does a plan's text begin so?
bool gonio_library_plan_is(const char *text);
gonio_status gonio_library_plan_make(const char *text, uint64_t seed, int threads, gonio_plan **out,
                                     gonio_error *error);

GONIO_END
#endif
