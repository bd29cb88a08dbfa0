// SPDX-License-Identifier: BSD-3-Clause
// A plan that is made while it is measured: "adaptive:N,...".
//
// The first batch fills the space; with a learned prior the other part of it are the poses that the prior's plan begins
// with. Before each further one the samples so far are fitted, and the batch is made of
//   fill    the next poses of the nusselt plan, evenly over all pairs of directions, whatever the model says;
//   mirror  the next poses about the mirror direction, where a peak may hide from a coarse filling;
//   sigma   poses where the model's sigma, the need and the rig's time say that most is gained (fit/design);
//   again   poses that gave no sample the first time;
//   prior   (the first batch) poses that a library says tell most.
// fill and mirror are the stated share of a batch, more where the model's sigma was too small about them. The model has
// not seen the fill poses of a batch when it predicts them, and they lie where the figures are taken: they tell the
// held-out error, and by it when to stop and what more poses would buy.
//
// Everything here is a function of what is journalled, so that a stopped measure goes on as if it had not been.
#ifndef GONIO_HOST_ACQUIRE_ADAPTIVE_H
#define GONIO_HOST_ACQUIRE_ADAPTIVE_H

#include "host/acquire/acquire.h"
#include "host/acquire/pose_time.h"

typedef struct gonio_adaptive_plan {
    size_t poses, first, batch; // at most; of the first batch, of a further one; 0: chosen
    double until;               // held-out median_rel at which it stops; 0: at `poses`
    double codes;               // the scenes' expected image error at which it stops; 0: at `poses`
    char scene[256];            // file of what scenes need; empty: all directions alike
    double share;               // of fill and mirror poses
    double theta_max_deg;
    bool anisotropic;
} gonio_adaptive_plan;

bool gonio_adaptive_is(const char *plan);
// GONIO_E_USAGE with the character at fault.
gonio_status gonio_adaptive_parse(const char *plan, gonio_adaptive_plan *out, gonio_error *error);

typedef enum gonio_adaptive_why {
    GONIO_ADAPTIVE_FILL,
    GONIO_ADAPTIVE_MIRROR,
    GONIO_ADAPTIVE_SIGMA,
    GONIO_ADAPTIVE_AGAIN,
    GONIO_ADAPTIVE_PRIOR,
    GONIO_ADAPTIVE_WHYS
} gonio_adaptive_why;
extern const char *const gonio_adaptive_whys[]; // their names

#define GONIO_ADAPTIVE_CHANNELS 3 // of a camera, at most

// A pose as it was chosen, and what became of it.
typedef struct gonio_adaptive_pose {
    gonio_adaptive_why why;
    size_t batch;
    gonio_pair pose;                             // of the plan; the step may spell it otherwise
    double sigma, gain, seconds;                 // of gonio_design_pose; NaN where it was not asked
    double predicted[GONIO_ADAPTIVE_CHANNELS];   // by the model that the batch was chosen with; NaN of the first batch
    double uncertainty[GONIO_ADAPTIVE_CHANNELS]; // of that, and of the sample when it is there
    ptrdiff_t sample;                            // its number; -1: none
} gonio_adaptive_pose;

// All that is known before a choice.
typedef struct gonio_adaptive {
    gonio_adaptive_plan plan;
    uint64_t seed;
    gonio_adaptive_pose *poses;
    size_t n, batches;
    gonio_samples *samples; // of the poses that gave one, in their order
    double shares[2];       // of the last batch, and of the next
    double codes;           // mean 8-bit codes that the pictures are off, as sigma expects it; NaN: not known
    const char *needs;      // file of what scenes need; borrowed; NULL: none
    const char *prior;      // file of a learned prior, by which the first batches are chosen; borrowed; NULL: none
} gonio_adaptive;

void gonio_adaptive_release(gonio_adaptive *a);

// ---- adaptive_figures.c ----
// What the fill poses say: errors of the models so far, and how they fall.
gonio_status gonio_adaptive_figures(const gonio_adaptive *a, gonio_adaptive_report *report, gonio_error *error);
// Is it over: is the plan full, or the error asked for met?
bool gonio_adaptive_over(const gonio_adaptive *a, const gonio_adaptive_report *report);
// The share of fill poses for the next batch.
double gonio_adaptive_share(const gonio_adaptive *a);

// ---- adaptive_choose.c ----
typedef struct gonio_adaptive_how {
    const gonio_pose_time *time;
    gonio_pair here;            // where the rig stands
    int threads;                // 0: all; changes nothing
    gonio_progress_fn progress; // of the fit; may be NULL
    void *context;
} gonio_adaptive_how;
// The next batch, appended to a->poses; *count: how many. The first one needs no samples.
gonio_status gonio_adaptive_choose(gonio_adaptive *a, const gonio_adaptive_how *how, size_t *count, gonio_error *error);

// ---- adaptive_journal.c ----
// The first batch of steps, behind the calibration's, and its entry in the journal, as JSON; the caller frees both.
gonio_status gonio_adaptive_begin(const gonio_rig *rig, const gonio_setup *setup, const char *plan, uint64_t seed,
                                  gonio_step **steps, size_t *n, char **record, gonio_error *error);
gonio_status gonio_adaptive_put(gonio_session *session, size_t batch, const char *record, gonio_error *error);
// The state that the journal tells of a session whose steps are these; a->plan is the session's. Release with
// gonio_adaptive_release, also on failure.
gonio_status gonio_adaptive_get(gonio_session *session, const gonio_step *steps, size_t n, gonio_adaptive *a,
                                gonio_error *error);
// Where all steps so far are done: enter the next batch in the journal, or, where it is over, the steps that end a
// scan. *more: those steps, entered; the caller frees them. 0 of them: the scan has its end already.
gonio_status gonio_adaptive_next(gonio_session *session, const gonio_rig *rig, const gonio_setup *setup,
                                 const gonio_step *steps, size_t n, int threads, gonio_progress_fn progress,
                                 void *context, gonio_step **more, size_t *count, gonio_error *error);
// Were the batches chosen on the samples that `sets` (of gonio_process_samples) holds? *differing: how many were not.
gonio_status gonio_adaptive_verify(gonio_session *session, const gonio_step *steps, size_t n,
                                   gonio_samples *const *sets, size_t *batches, size_t *differing, gonio_error *error);

#endif
