// SPDX-License-Identifier: BSD-3-Clause
// Measure a sample: open a rig, run a plan on it into a session, fit a model to the samples; go on with a session that
// was stopped; compute a session's results again from its stored frames.
//
// The order of calls (docs/examples/measure.c is a whole program):
//   gonio_rig_file_open      the devices that an INI file names, or simulated ones
//   gonio_measure_begin      make the session's folder and journal rig, plan and settings; nothing moves yet
//   gonio_measure_run        measure all that is not measured yet, then fit
//   gonio_session_close, gonio_rig_file_close
// and after a stop, a fault or a power cut
//   gonio_session_open, gonio_rig_file_reopen, gonio_measure_run ...
//
// Every step is journalled when it is done, so that nothing measured is lost whatever ends the program. The same
// session gives the same samples and model, bit for bit, however often it was stopped.
//
// Threads: one rig and one session belong to one thread at a time. Every hook is called before the call that it was
// given to returns; the thread is the caller's, except for `event`, which a device's own thread may call. A hook may
// not call into the same rig or session.
#ifndef GONIO_ACQUIRE_H
#define GONIO_ACQUIRE_H

#include "gonio/characterise.h"
#include "gonio/export.h"
#include "gonio/fit.h"
#include "gonio/session.h"

GONIO_BEGIN

// ---- the rig ----

// An open rig: its devices, what is known of it, and how to scan with it.
typedef struct gonio_rig_file gonio_rig_file;

// Which rig. Zero-initialise, then set members; texts and lists are borrowed for the call, the hooks until the rig is
// closed.
typedef struct gonio_rig_file_options {
    const char *path;     // of the INI file (docs/hardware.md); NULL or "sim": the simulator with its defaults
    const char *sample;   // SPEC of the simulated sample ("ward:rho_d=0.3,..."); NULL: the file's
    const char *stand_in; // SPEC where neither says one, for work that does not depend on it; NULL: that is an error
    const char *const *fragments; // paths of further INI files whose keys are added, as `gonio calibrate` writes them
    size_t n_fragments;
    const char *const *settings; // "section.key=value" (also several behind commas), after all files
    size_t n_settings;
    const char *operator_name, *sample_id, *notes; // stored in the session; NULL: as the files say
    uint64_t seed;                                 // of the simulator
    int threads;                                   // of the simulator; 0: all
    // Something that a device survived and the operator should know: kind is a word or two. NULL: nobody is told. A
    // session that is being measured journals it in any case.
    void (*event)(void *context, const char *kind, const char *text);
    // Asked while axes move; true stops them and the call that moved them gives GONIO_E_INTERRUPTED. NULL: never.
    bool (*cancelled)(void *context);
    void *context;
    // gonio_rig_file_reopen: may this machine's devices, and hosts of its network, be opened that the session names? It
    // may come from elsewhere. devices: which, for people. NULL: they may not; simulated ones are opened unasked.
    bool (*trust)(void *context, const char *devices);
    // Let other programs of this user on this machine (`gonio rig status`, `gonio rig stop`; while a session is
    // measured `gonio status`, `gonio pause` and `gonio stop`) ask and steer this one, through local sockets that a
    // thread answers until the rig is closed. A rig whose controller another such program drives is then
    // GONIO_E_DEVICE. False: nobody.
    bool control;
} gonio_rig_file_options;

// Read and check everything, then open the devices; nothing moves. The caller closes it with gonio_rig_file_close.
// GONIO_E_INPUT with file and line for unknown keys and bad values, GONIO_E_USAGE for bad settings, GONIO_E_DEVICE for
// a device that does not answer. On failure *out is NULL.
gonio_status gonio_rig_file_open(const gonio_rig_file_options *options, gonio_rig_file **out, gonio_error *error);
// The rig that the session was begun with, from the journal. The journal then says "resumed". options: settings for
// what has changed since (a port, a fault that is gone), threads, hooks and control; path: the rig file as it is now,
// of which only where devices are reached may have changed (GONIO_E_INPUT with its line); the rest is not used. NULL:
// none. GONIO_E_USAGE where the session's rig has real devices that no such file names and `trust` does not allow them.
gonio_status gonio_rig_file_reopen(gonio_session *session, const gonio_rig_file_options *options, gonio_rig_file **out,
                                   gonio_error *error);
void gonio_rig_file_close(gonio_rig_file *rig); // NULL is allowed
// The devices, for work of one's own (move, expose); borrowed until the rig is closed.
gonio_rig *gonio_rig_file_devices(gonio_rig_file *rig);
// Are reference and sample put on the table by hand, so that gonio_measure_run needs its mount hook?
bool gonio_rig_file_needs_hands(const gonio_rig_file *rig);

// ---- measuring ----

typedef enum gonio_measure_phase {
    GONIO_MEASURE_POSES, // frames are taken (gonio_replay: evaluated)
    GONIO_MEASURE_FIT,   // the final model is fitted
    GONIO_MEASURE_PAUSED // nothing is done: somebody asked for it, or the disk has no room; `what` tells which
} gonio_measure_phase;

typedef struct gonio_measure_progress {
    gonio_measure_phase phase;
    size_t done, total; // poses of the plan, those of earlier runs among them
    size_t done_before; // of them, when this run began
    double fraction;    // of the phase, 0 to 1
    const char *what;   // what the fit is doing, what a pause waits for; "" while poses. Valid during the call
    double error;       // held-out RMSE of the model as it is now, 1/sr; NaN: not known
} gonio_measure_progress;

// What the caller does meanwhile. Every member may be NULL.
typedef struct gonio_measure_hooks {
    void *context;
    // Called at the start of a phase, after every pose, and now and then by the fit and in a pause. Returning false
    // stops at the next checkpoint: the call gives GONIO_E_INTERRUPTED, and the session can be gone on with.
    bool (*progress)(void *context, const gonio_measure_progress *now);
    // The operator puts the target on the table; return when it lies there, or a failure, which ends the run. Needed
    // where gonio_rig_file_needs_hands says so.
    gonio_status (*mount)(void *context, gonio_target target, gonio_error *error);
    // A sentence for the operator: something that the scan survives (a pose without a sample, poses measured again).
    void (*note)(void *context, const char *text);
} gonio_measure_hooks;

// What to measure. gonio_measure_options_default() first, then change members.
typedef struct gonio_measure_options {
    // As gonio_plan_make takes it, or a plan that is made while it is measured, from the model so far
    // (docs/adaptive.md): "adaptive:N[,until=X][,batch=N][,share=X][,first=N][,theta_max=DEG][,anisotropic=1]". The
    // default is "nusselt:1400".
    const char *plan;
    uint64_t seed;          // of the plan; 1
    gonio_fit_options fit;  // the final fit: method, level, hold-out ...; its threads and progress are not used
    const char *model_path; // where the model goes; NULL: model.gonio in the session's folder
    int threads;            // for evaluating and fitting; 0: all. Results do not depend on it
    gonio_measure_hooks hooks;
    // Where the session's disk has less room than its largest step took, pause until it has, the shutter closed. False:
    // go on until a step cannot be stored, which is GONIO_E_IO and takes nothing from the session.
    bool wait_for_room;
} gonio_measure_options;

void gonio_measure_options_default(gonio_measure_options *options);

// What a plan that is made while it is measured ("adaptive:N,...") came to. Figures are of poses that no model had seen
// when it predicted them; NaN: not known yet.
typedef struct gonio_adaptive_report {
    size_t batches, poses; // 0 batches: the plan was made before
    size_t held_out;       // poses that the figures are of
    double median_rel, rms_log;
    double until; // the median_rel that was asked for; 0: none
    bool met;     // it was reached, and ended the measure
    double share; // of the last batch: poses that fill the space whatever the model says
    // How errors fall with the number of poses: about scale x poses^-power.
    double median_rel_scale, median_rel_power, rms_log_scale, rms_log_power;
    double choosing_s; // that choosing took, of this run
} gonio_adaptive_report;

// What a session yielded. Release with gonio_outcome_free.
typedef struct gonio_outcome {
    gonio_samples *samples; // final; owned
    gonio_model *model;     // owned
    char *model_path;       // where it was saved; owned. NULL: not saved (gonio_replay without a path)
    gonio_fit_report fit;
    gonio_blur blur;    // of light, aperture and averaged disc
    double drift_ratio; // responsivity at the end / at the start; NaN: not known
    size_t poses, frames;
    gonio_motion motion;                  // between the frames before and after the scan
    char motion_text[256];                // where something moved: what, and in which frame
    size_t edges_excluded, edges_spilled; // poses over the sample's edge: without a sample, and flagged
    gonio_adaptive_report adaptive;
    char samples_sha256[GONIO_SHA256_HEX], model_sha256[GONIO_SHA256_HEX];
} gonio_outcome;
void gonio_outcome_free(gonio_outcome *outcome); // the struct itself is the caller's; zeros are allowed

// Make the folder `path` and journal all that a later gonio_measure_run and a replay need. Everything that can be wrong
// with the request is found before the folder exists: GONIO_E_USAGE for an impossible plan, method, or a missing mount
// hook. The caller closes *out with gonio_session_close; the rig stays the caller's.
gonio_status gonio_measure_begin(const char *path, const gonio_rig_file *rig, const gonio_measure_options *options,
                                 gonio_session **out, gonio_error *error);
// Measure the session's poses that are not measured yet, with a fit running along; then correct drift, fit, save the
// model and journal the results. Of the options model_path, threads, hooks and wait_for_room are used; the rest was
// journalled by gonio_measure_begin. On failure *outcome is zeros, the axes stand, the shutter is closed and the reason
// is journalled; call it again (after gonio_rig_file_reopen, where the rig was closed) to go on. A finished session is
// fitted again.
gonio_status gonio_measure_run(gonio_session *session, gonio_rig_file *rig, const gonio_measure_options *options,
                               gonio_outcome *outcome, gonio_error *error);

// ---- replay ----

// Largest differences, each as a share of what rounding alone may make of it (docs/reliability.md): up to 1 is
// rounding. INFINITY: others in number or form, or (the model) no file to compare with.
typedef struct gonio_agreement {
    double angle, value, sigma; // of samples
    double model;               // evaluated at the samples' directions
} gonio_agreement;

// One stage of a result beside the journalled one.
typedef struct gonio_stage_report {
    char journalled[GONIO_SHA256_HEX], again[GONIO_SHA256_HEX]; // empty: none
    bool known, equal;                                          // known: both are there
    size_t steps_differing; // up to GONIO_STAGE_SAMPLES; of frames none: each is verified as it is read
    long long first_step;   // of them; -1: none
    double largest; // relative difference: of a step's mean radiance, of a value beside its sigma; NaN: not known
} gonio_stage_report;

typedef struct gonio_replay_report {
    bool equal;                      // everything that could be compared is equal, bit for bit
    bool rounding;                   // not equal, but no further apart than other processors and libraries round
    gonio_agreement agreement;       // where something is not equal: how far apart
    size_t steps_differing;          // poses whose samples are not the journalled ones
    long long first_differing;       // the first of those steps; where none is: -1
    bool finished;                   // the session has journalled results to compare with
    bool samples_equal, model_equal; // by checksum; false where not finished
    char samples_sha256[GONIO_SHA256_HEX], model_sha256[GONIO_SHA256_HEX]; // as journalled; empty: none
    gonio_stage_report stages[GONIO_STAGES];
    int first_stage; // that differs, a gonio_stage; -1: none
    // Of an adaptive plan: its batches, and of them those that were chosen on other samples than the frames give now:
    // steps were measured again after the choice, or samples differ. What `equal` says does not depend on it.
    size_t batches, batches_differing;
} gonio_replay_report;

// Stored frames -> calibration -> samples -> model again, held against the journal; the session is only read. Of the
// options model_path (NULL: the model is kept in memory alone), threads and hooks.progress are used. GONIO_OK also
// where something differs: the report tells. GONIO_E_INPUT where the calibration's frames are not complete.
gonio_status gonio_replay(gonio_session *session, const gonio_measure_options *options, gonio_outcome *outcome,
                          gonio_replay_report *report, gonio_error *error);

GONIO_END
#endif
