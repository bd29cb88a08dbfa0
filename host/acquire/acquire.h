// SPDX-License-Identifier: BSD-3-Clause
// The acquisition: plan -> steps -> frames -> samples -> model, journalled as it happens. gonio/acquire.h is what
// others use of it.
//
// gonio_scan_* drive a rig; gonio_process_* are plain functions of what the session holds, so that a replay runs the
// same code on the same frames and gets the same bits.
#ifndef GONIO_HOST_ACQUIRE_ACQUIRE_H
#define GONIO_HOST_ACQUIRE_ACQUIRE_H

#include "gonio/acquire.h"

// How to scan. gonio_scan_options_default() first.
typedef struct gonio_scan_options {
    int dark_frames;                 // at the shortest exposure, and as many at the longest
    int trap_frames;                 // of a light trap, the lamp on; 0: no light trap, stray light stays in
    int motion_check;                // 1: a full frame of the sample before and after the scan
    int reference_frames;            // at each reference step
    double settle_s;                 // after every move
    double exposure_max_s;           // longest exposure to use; 0: the camera's own limit
    int window_width, window_height; // read-out window; 0: around the sample; -1: the full frame
    int audit_poses;                 // home and compare after so many poses, and at the end; 0: at the end alone
    int encoder_audit_poses;         // the same where encoders on every axis compare at every pose
    bool unsynced;                   // the session waits for no disk; not journalled: a resume waits again
    char needs[256];                 // what scenes need, by which an adaptive plan goes; empty: all directions alike
    bool hands;                      // targets are put on the table by hand even where a sample changer is there
} gonio_scan_options;

// All that a resume or a replay must know; journalled at the start.
typedef struct gonio_setup {
    gonio_camera_info camera; // exposure_max_s already limited by the scan's options
    gonio_rig_facts facts;
    gonio_scan_options scan;
    gonio_window window;
    gonio_fit_options fit; // without threads and callback
} gonio_setup;

void gonio_scan_options_default(gonio_scan_options *options);
// Ask the rig what it is and fix the read-out window; fit stays untouched.
gonio_status gonio_setup_of_rig(const gonio_rig *rig, const gonio_scan_options *scan, gonio_setup *setup,
                                gonio_error *error);
gonio_status gonio_setup_put(gonio_session *session, const gonio_setup *setup, gonio_error *error);
gonio_status gonio_setup_get(gonio_session *session, gonio_setup *setup, gonio_error *error);
// A SPEC that a session tells may name a file ("file:PATH", "spec:file:PATH"): GONIO_E_INPUT where that is no plain
// one, so that nobody waits for a pipe or reads a device without an end. file: for the error.
gonio_status gonio_spec_check_file(const char *spec, const char *file, gonio_error *error);
// The fit whose slopes give the pointing term, and which runs along with a measure: nothing is held out, no limit of
// time or memory acts on it, and the hundreds of thousands of samples of a sphere are so dense that the quickest method
// tells their slopes.
gonio_fit_options gonio_setup_slope_fit(const gonio_setup *setup);

// The window around the sample as the camera sees it; see gonio_scan_options.
gonio_status gonio_scan_window(const gonio_camera_info *camera, const gonio_rig_facts *facts,
                               const gonio_scan_options *options, gonio_window *window, gonio_error *error);

// The steps of a plan: dark frames, the light trap, the white reference, the poses in an order of short moves, the
// reference again. The caller frees *steps.
gonio_status gonio_scan_steps(const gonio_rig *rig, const gonio_scan_options *options, const gonio_plan *plan,
                              gonio_step **steps, size_t *n, gonio_error *error);
// The plan's poses in an order of short moves from `start`, as sample steps without an index; which[i]: the number of
// steps[i]'s pose in the plan. steps and which: plan->n.
gonio_status gonio_scan_tour(const gonio_rig *rig, const gonio_pair *start, const gonio_plan *plan, gonio_step *steps,
                             size_t *which, gonio_error *error);
// The steps behind the last pose, at the reference's, without an index; returns how many.
size_t gonio_scan_ending(const gonio_scan_options *options, const gonio_pair *reference, gonio_step ending[2]);
bool gonio_scan_reaches(const gonio_rig *rig, const gonio_pair *pose); // by one of its spellings
// The axes' targets of a pose.
void gonio_scan_target(const gonio_pair *pose, double target_rad[GONIO_AXES]);
// The time that moves and settling take, from the stage's limits.
double gonio_scan_travel_s(const gonio_rig *rig, const gonio_step *steps, size_t n, double settle_s);

// ---- edges.c: poses that reach over the sample's edge (gonio_calib_edges) ----
#define GONIO_EDGES_TOLD 10
typedef struct gonio_edges_report {
    size_t excluded, spilled; // no sample; flagged, but a sample
    int told;
    char text[GONIO_EDGES_TOLD][320]; // the first ones
} gonio_edges_report;
void gonio_scan_edges(const gonio_setup *setup, const gonio_step *steps, size_t n, gonio_edges_report *report);

// ---- expose.c: the frames of one step ----
typedef struct gonio_exposures {
    gonio_exposure *items;
    int n, capacity;
    double clock_s; // nominal; moves on with every frame
    double end_s;   // the exposure to begin the next step of this kind with
    double monitor; // of the lamp, in: an earlier reading (0: none) that tells a failing lamp; out: the latest
} gonio_exposures;
// Take the frames that the step's kind asks for, from out->clock_s on, at the pose where the rig stands. first_s: the
// exposure to begin with; 0: calibration proposes one. What was taken is in out, also on failure; the caller frees
// out->items with gonio_exposures_free.
gonio_status gonio_expose_step(const gonio_rig *rig, const gonio_setup *setup, const gonio_calib *calib,
                               const gonio_step *step, double first_s, gonio_exposures *out, gonio_error *error);

// ---- process.c: from frames to samples ----
typedef struct gonio_process {
    gonio_setup setup;
    gonio_calib *calib;
    gonio_step *steps;
    size_t n;
    size_t first_sample; // steps before it calibrate; those after the last sample bound the drift
    bool isotropic;      // the plan never turns the sample
    bool transmission;   // it goes behind the sample
} gonio_process;

// Read the setup and the steps; the calibration is new and empty. Release with gonio_process_end, also on failure.
gonio_status gonio_process_begin(gonio_session *session, gonio_process *process, gonio_error *error);
void gonio_process_end(gonio_process *process);
// Calibrate anew from the steps before the first sample step, in their order: from stored frames where they are done,
// from fresh's exposures where one has just been taken and is not stored yet (NULL: none). Stops at the first that is
// neither; where all are there, the calibration is prepared and *ready set.
gonio_status gonio_process_prepare(gonio_session *session, gonio_process *process, const gonio_step *fresh,
                                   const gonio_exposure *exposures, int n, bool *ready, gonio_error *error);
// Add the done reference steps after the samples, from their stored frames; *any: there were some.
gonio_status gonio_process_late_references(gonio_session *session, gonio_process *process, bool *any,
                                           gonio_error *error);
// Compare the check's frames before and after the samples; motion->known is false where there are no two of them. text:
// what moved, with the frames; empty where nothing did.
gonio_status gonio_process_motion(gonio_session *session, const gonio_process *process, gonio_motion *motion,
                                  char text[256], gonio_error *error);
// A new set of the session's channels; the caller frees it.
gonio_status gonio_process_new_samples(const gonio_process *process, gonio_samples **out, gonio_error *error);
// A pose's samples, none where the pose has no valid exposure (then why says what was wrong), and its radiance before
// geometry. The caller frees *out.
gonio_status gonio_process_pose(const gonio_process *process, const gonio_step *step, const gonio_exposure *exposures,
                                int n, gonio_samples **out, gonio_step_radiance *radiance, char why[512],
                                gonio_error *error);
// The same from stored frames, for every done sample step at once: out[i] and (*radiance)[i] belong to steps[i]; out[i]
// is NULL where it is not a done sample step (only_missing: nor where the journal holds its samples). Equal bits for
// any thread count. The caller frees with gonio_sets_free and free.
gonio_status gonio_process_samples(gonio_session *session, const gonio_process *process, bool only_missing, int threads,
                                   gonio_progress_fn progress, void *context, gonio_samples ***out,
                                   gonio_step_radiance **radiance, gonio_error *error);
void gonio_sets_free(gonio_samples **sets, size_t n);

// ---- audit.c: has the stage lost steps? ----
typedef enum gonio_audit_verdict { GONIO_AUDIT_GOOD, GONIO_AUDIT_BAD, GONIO_AUDIT_UNKNOWN } gonio_audit_verdict;
// Home the stage and compare with its last homing (a stage that cannot tell is homed). Good: every flagged step is
// vouched for. Else they are taken back, in the journal and in process->steps, to be measured again: *undone of them.
// The difference goes to the journal; text (at least 256 bytes): the same for people.
gonio_status gonio_audit(gonio_session *session, const gonio_rig *rig, gonio_process *process, double timeout_s,
                         gonio_audit_verdict *verdict, size_t *undone, char text[256], gonio_error *error);

// ---- scan.c: drive the rig through the session's steps ----
typedef struct gonio_scan gonio_scan;
typedef struct gonio_scan_hooks {
    void *context;
    // The operator puts the target on the table; returns when it lies there. NULL where there are no hands.
    gonio_status (*mount)(void *context, gonio_target target, gonio_error *error);
    // Something that the scan survives and the operator should know. May be NULL.
    void (*note)(void *context, const char *text);
    // An audit took steps back that were done: what was made of their samples no longer stands. May be NULL.
    void (*undone)(void *context, size_t steps);
} gonio_scan_hooks;

// Prepare to go on with the session's first undone step: what was calibrated is calibrated again from its frames, the
// axes are homed and audited, the lamp is warm. rig, session and hooks are borrowed until gonio_scan_free.
gonio_status gonio_scan_new(gonio_session *session, const gonio_rig *rig, const gonio_scan_hooks *hooks,
                            gonio_scan **out, gonio_error *error);
bool gonio_scan_done(const gonio_scan *scan);
int64_t gonio_scan_next(const gonio_scan *scan); // the first undone step
// Do the next undone step as a whole and journal it; where an audit is due (every scan.audit_poses poses, and after the
// last step), it follows, and may take steps back. *samples (borrowed until the next call): what it yielded, NULL for
// a calibration step. On failure the axes are stopped, the shutter closed, the fault journalled; the step is undone.
gonio_status gonio_scan_step(gonio_scan *scan, const gonio_samples **samples, gonio_error *error);
// The setup, calibration and steps (up to date with what was done), borrowed.
gonio_process *gonio_scan_process(gonio_scan *scan);
// Go on with more steps, behind the last one, which are in the journal.
gonio_status gonio_scan_extend(gonio_scan *scan, const gonio_step *more, size_t n, gonio_error *error);
// Stop the axes and close the shutter; callable at any time.
void gonio_scan_halt(gonio_scan *scan);
void gonio_scan_free(gonio_scan *scan); // NULL is allowed

// ---- finish.c: all samples -> final samples and model ----
// How to finish. sets: of gonio_process_samples, each released as it is joined; NULL: as the journal holds them. stream
// (may be NULL): was given exactly these samples in this order and stands in for the first fit. progress may be NULL.
typedef struct gonio_finish_options {
    gonio_samples **sets;
    gonio_fit_stream *stream;
    int threads;
    const char *model_path;
    const char *replaces; // the model's name where it is a file of the session's folder: an old one goes to lost+found/
    bool keep_old;        // elsewhere: a file that is there gets another name, since nobody has named it in this run
    gonio_progress_fn progress;
    void *context;
} gonio_finish_options;
// Join the steps' samples, correct drift, fit, add the pointing term, fit again, save the model and hash. Release the
// outcome with gonio_outcome_free.
gonio_status gonio_finish(gonio_session *session, gonio_process *process, const gonio_finish_options *options,
                          gonio_outcome *out, gonio_error *error);
// Store the final samples and the results' checksums ("result.samples_sha256" ...), in one transaction.
gonio_status gonio_outcome_put(gonio_session *session, const gonio_outcome *outcome, gonio_error *error);

// ---- agreement.c: what was computed again beside what was journalled, where bits differ ----

// Widen `all` by one set of samples: as journalled, and again.
void gonio_agreement_add(gonio_agreement *all, const gonio_samples *journalled, const gonio_samples *again);
// And by the final samples and the model of a finished session.
gonio_status gonio_agreement_finish(gonio_agreement *all, gonio_session *session, const gonio_outcome *again,
                                    gonio_error *error);
double gonio_agreement_largest(const gonio_agreement *all);
// The largest difference of a value, relative to it and its sigma.
double gonio_agreement_relative(const gonio_agreement *all);

// Widen `all` by another.
void gonio_agreement_join(gonio_agreement *all, const gonio_agreement *other);

// ---- stages.c: a replay's stages beside the journal's ----
// The steps' samples and radiance, as gonio_process_samples gives them.
gonio_status gonio_stages_steps(gonio_session *session, const gonio_process *process, gonio_samples *const *sets,
                                const gonio_step_radiance *radiance, gonio_replay_report *report, gonio_error *error);
// Final samples and model, and the verdict on all.
gonio_status gonio_stages_results(gonio_session *session, const gonio_outcome *outcome, gonio_replay_report *report,
                                  gonio_error *error);

#endif
