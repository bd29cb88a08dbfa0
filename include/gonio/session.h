// SPDX-License-Identifier: BSD-3-Clause
// A session: a folder that holds all of an acquisition, self-describing from its first second (docs/formats.md).
//
// session.db (SQLite, WAL, full sync) journals settings, steps, frames, samples and events; frames/ holds the pixels,
// 16-bit PNG. A frame is written to a temporary name, synced, renamed, and only then entered.
#ifndef GONIO_SESSION_H
#define GONIO_SESSION_H

#include "gonio/export.h"
#include "gonio/fit.h"
#include "gonio/plan.h"
#include "gonio/rig.h"
#include "gonio/sample.h"
#include "gonio/session_calibration.h"

GONIO_BEGIN

#define GONIO_SESSION_VERSION 2

typedef struct gonio_session gonio_session;

typedef enum gonio_step_kind {
    GONIO_STEP_DARK,
    GONIO_STEP_REFERENCE,
    GONIO_STEP_SAMPLE,
    GONIO_STEP_TRAP,
    GONIO_STEP_BURST, // frames alone: no scan has them
    GONIO_STEP_CHECK  // a full frame of the sample before and after the scan, to see whether anything moved
} gonio_step_kind;

#define GONIO_SHA256_HEX 65 // a SHA-256 as 64 hex digits

// What a sample step's frames say before geometry (gonio_calib_probe): a replay compares it.
typedef struct gonio_step_radiance {
    int channels;                  // 0: not known
    double mean[3];                // a channel each; NaN: no valid pixel
    char sha256[GONIO_SHA256_HEX]; // of the pixels' values
} gonio_step_radiance;

// One step of the session: a pose with a target, done as a whole or not at all.
typedef struct gonio_step {
    int64_t index; // running number; equals gonio_stamp.pose
    gonio_step_kind kind;
    gonio_pair pose;
    bool done;
    bool flagged;          // done since the last good audit of the stage, so steps may have been lost
    double clock_end_s;    // nominal clock when it was done
    double exposure_end_s; // the exposure to begin the next step with
    int frames;
    gonio_step_radiance radiance; // what gonio_session_finish_step enters; gonio_session_steps leaves it empty
} gonio_step;

gonio_status gonio_session_create(const char *path, gonio_session **out,
                                  gonio_error *error); // fails where one with steps exists
// Opening verifies the journal against its chain and its log (no frame is read): GONIO_E_INPUT with the table, row and
// column that is not what was written. Writable: a session of an older version becomes one of this version.
gonio_status gonio_session_open(const char *path, bool writable, gonio_session **out, gonio_error *error);
void gonio_session_close(gonio_session *session); // NULL is allowed
bool gonio_session_is(const char *path);          // a folder with a session.db
// The session's own file of that name is a plain one, not a link, a pipe or a device, of at most `limit` bytes; else
// GONIO_E_INPUT with what it is.
gonio_status gonio_session_check_file(gonio_session *session, const char *name, int64_t limit, gonio_error *error);
const char *gonio_session_path(const gonio_session *session); // as it was opened; lives as long as the session

// Make what follows one transaction: all of it is stored at the commit, or nothing. Not nested.
gonio_status gonio_session_begin(gonio_session *session, gonio_error *error);
gonio_status gonio_session_commit(gonio_session *session, gonio_error *error);
void gonio_session_rollback(gonio_session *session);
// Commit where what was done gave GONIO_OK, else roll back and return that.
gonio_status gonio_session_end(gonio_session *session, gonio_status status, gonio_error *error);

// Settings: key -> text. get, find: the caller frees the text; a key that is missing is GONIO_E_INPUT to get, and NULL
// with GONIO_OK to find. The session itself reads "camera.bits" (1..16, default 16): the bits that a frame's words
// carry.
gonio_status gonio_session_put(gonio_session *session, const char *key, const char *value, gonio_error *error);
gonio_status gonio_session_get(gonio_session *session, const char *key, char **value, gonio_error *error);
gonio_status gonio_session_find(gonio_session *session, const char *key, char **value, gonio_error *error);
// A file that the session was made from: what it was for ("rig", "plan" ...), its name as given, its bytes. Those of
// large ones are not stored, their checksum is.
gonio_status gonio_session_put_file(gonio_session *session, const char *role, const char *name, const void *bytes,
                                    size_t size, gonio_error *error);
gonio_status gonio_session_event(gonio_session *session, const char *kind, const char *text, gonio_error *error);
// The events, oldest first, as "UTC kind: text" lines, what is not fit for a terminal written as \\n, \\x1b or \\u202e;
// the caller frees the text.
gonio_status gonio_session_events(gonio_session *session, char **text, gonio_error *error);

// The steps, entered at the start, or behind the last one, in one transaction (the caller's own where one is open).
// Poses are stored in degrees: pass them through gonio_angle_canonical first and they come back bit for bit.
gonio_status gonio_session_put_steps(gonio_session *session, const gonio_step *steps, size_t n, gonio_error *error);
gonio_status gonio_session_steps(gonio_session *session, gonio_step **steps, size_t *n,
                                 gonio_error *error); // caller frees
// GONIO_E_INPUT where the journal has lost steps of the plan (damage took their rows): such a session can be read, not
// finished.
gonio_status gonio_session_check_steps(gonio_session *session, gonio_error *error);

// Finish a step: store the frames (files synced and renamed), then enter frames, samples and the step in one
// transaction.
gonio_status gonio_session_finish_step(gonio_session *session, const gonio_step *step, const gonio_exposure *exposures,
                                       int n, const gonio_samples *samples, gonio_error *error);
// Whether a step waits until the disk has it, so that no power cut loses it (true, from the start).
gonio_status gonio_session_set_sync(gonio_session *session, bool sync, gonio_error *error);
// Store frames as they are, not compressed (false: compressed, as from the start): as fast as the disk, and still a PNG
// that any viewer opens.
void gonio_session_set_plain(gonio_session *session, bool plain);
// Compress every frame that was stored so. Pixels and checksums stay what they are; each file is verified first and
// replaced as a whole. *saved_bytes: how much smaller frames/ has become. threads 0: all.
gonio_status gonio_session_compress(gonio_session *session, int threads, int64_t *saved_bytes, gonio_error *error);

// A burst: frames at the camera's full rate, stored uncompressed by a thread of its own in groups, each synced and
// entered at once: one group, one step. Nobody else uses the session while one is open. `steps` are in the session and
// not done; the burst takes as many as it needs.
typedef struct gonio_burst gonio_burst;
typedef struct gonio_burst_options {
    gonio_window window;
    int group;           // frames a step; the last may have fewer
    size_t memory_bytes; // for frames that wait for the disk; two groups or more
    const gonio_step *steps;
    size_t n_steps;
} gonio_burst_options;
typedef struct gonio_burst_counts {
    int64_t stored, groups, waits; // waits: how often a frame had to wait for memory
    int most_waiting;              // frames in memory at one time
} gonio_burst_counts;
gonio_status gonio_burst_open(gonio_session *session, const gonio_burst_options *options, gonio_burst **out,
                              gonio_error *error);
// Room for the next frame: frame->window and frame->pixels are set. Waits where there is none; an error is what ended
// the storing. Then fill in pixels, exposure and stamp.clock_s and put it, or ask for room again and it is not stored.
gonio_status gonio_burst_room(gonio_burst *burst, gonio_frame *frame, gonio_error *error);
void gonio_burst_put(gonio_burst *burst, const gonio_frame *frame);
// Store what still waits and end. counts may be NULL.
gonio_status gonio_burst_close(gonio_burst *burst, gonio_burst_counts *counts, gonio_error *error);

// Read a step's exposures back; every checksum is verified. The caller frees with gonio_exposures_free.
gonio_status gonio_session_exposures(gonio_session *session, int64_t step, gonio_exposure **exposures, int *n,
                                     gonio_error *error);
void gonio_exposures_free(gonio_exposure *exposures, int n);
// The lamp monitor's reading at the last frame that has one; 0: none has.
gonio_status gonio_session_monitor(gonio_session *session, double *value, gonio_error *error);
// All samples in step order, as journalled (before the pointing term). The caller frees them.
gonio_status gonio_session_samples(gonio_session *session, gonio_samples **out, gonio_error *error);
// One step's samples; *out is NULL, with GONIO_OK, where the step has none. The caller frees them.
gonio_status gonio_session_step_samples(gonio_session *session, int64_t step, gonio_samples **out, gonio_error *error);
// Replace a done step's samples (NULL: remove them), when the calibration that they stand on was taken again.
gonio_status gonio_session_put_step_samples(gonio_session *session, int64_t step, const gonio_samples *samples,
                                            gonio_error *error);

// A step's radiance before geometry: replace it, or read it (channels 0 where there is none).
gonio_status gonio_session_put_radiance(gonio_session *session, int64_t step, const gonio_step_radiance *radiance,
                                        gonio_error *error);
gonio_status gonio_session_radiance(gonio_session *session, int64_t step, gonio_step_radiance *radiance,
                                    gonio_error *error);

// The final samples: the journalled ones after what only the whole session tells (drift between the references, the
// pointing term). put: as many, in the same order. get: *final tells whether the session is finished; until then the
// journalled ones come.
gonio_status gonio_session_put_final(gonio_session *session, const gonio_samples *samples, gonio_error *error);
gonio_status gonio_session_final_samples(gonio_session *session, gonio_samples **out, bool *final, gonio_error *error);
// The file of the journalled model, "result.model_path" (in the session's folder where it is relative, or where the
// place that it names is empty and model.gonio is there); the caller frees it. GONIO_E_INPUT where the session is not
// finished.
gonio_status gonio_session_model_path(gonio_session *session, char **path, gonio_error *error);
// Open, read the final samples, close: what a verb does whose INPUT is a session.
gonio_status gonio_session_read(const char *path, gonio_samples **out, gonio_error *error);

// How far a session is, as its journal has it at one moment, also while another program writes it.
typedef struct gonio_session_note {
    char utc[32], kind[48], text[512]; // of an event; empty: there is none
} gonio_session_note;
typedef struct gonio_session_overview {
    int64_t steps, steps_done, poses, poses_done, frames;
    int64_t last_step, last_frame;         // the last frame that was stored, in the plan's order; -1: none
    int64_t results;                       // more than 0: the session is finished
    gonio_session_note first, last, alarm; // events: how it began, the newest, the newest that somebody should look at
} gonio_session_overview;
gonio_status gonio_session_overview_read(gonio_session *session, gonio_session_overview *out, gonio_error *error);
// Whether a process of this machine has the session open for writing, and which.
bool gonio_session_writer(const char *path, long *pid);
// A stored frame's file, 16-bit PNG, to another path, which appears whole.
gonio_status gonio_session_copy_frame(gonio_session *session, int64_t step, int frame, const char *path,
                                      gonio_error *error);
// Bytes that the session's disk has left for its user; INT64_MAX where the file system does not tell.
gonio_status gonio_session_room(gonio_session *session, int64_t *bytes, gonio_error *error);
// Bytes of pixels of the largest step from this one on; 0: none is done.
gonio_status gonio_session_largest_step(gonio_session *session, int64_t from, int64_t *bytes, gonio_error *error);

// Take a step back: its frames and samples leave the journal, and so do the results, which no longer stand. why: for
// the events; NULL: the caller tells them itself.
gonio_status gonio_session_undo_step(gonio_session *session, int64_t step, const char *why, gonio_error *error);
// Before a session goes on. Rows that stand under a step which is not done are dropped, with an event: no session that
// Gonio wrote has any, and the step is measured as if they were not there. And every frame of a done step is there,
// with the size that was journalled or with the same pixels; GONIO_E_INPUT names the first that is not.
gonio_status gonio_session_drop_undone(gonio_session *session, gonio_error *error);
gonio_status gonio_session_check_present(gonio_session *session, gonio_error *error);
// A good audit: no step is flagged any more.
gonio_status gonio_session_unflag(gonio_session *session, gonio_error *error);
// Move what a stopped step or program left under frames/ and beside the journal into lost+found/, whose LIST says what
// came from where and why; each is an event. Files under names that Gonio does not give stay where they are. *moved may
// be NULL.
gonio_status gonio_session_sweep(gonio_session *session, int *moved, gonio_error *error);

// Before a file of the session's folder is written anew: what has its name goes to lost+found/. Nothing has it:
// GONIO_OK.
gonio_status gonio_session_make_way(gonio_session *session, const char *name, const char *why, gonio_error *error);
// The same for a file elsewhere, which becomes PATH.old-N.
gonio_status gonio_session_keep_file(const char *path, gonio_error *error);
// Is nothing left to do: every step is done and none is flagged, and the final samples and the model's file are those
// whose checksums are journalled?
gonio_status gonio_session_finished(gonio_session *session, bool *finished, gonio_error *error);

// The stages of a result, each of which is made of the one before.
typedef enum gonio_stage {
    GONIO_STAGE_FRAMES,   // all frames' pixels
    GONIO_STAGE_RADIANCE, // calibrated and merged, before geometry
    GONIO_STAGE_SAMPLES,  // of every step, as it was evaluated
    GONIO_STAGE_FINAL,    // of the whole session: after drift and pointing
    GONIO_STAGE_MODEL,
    GONIO_STAGES
} gonio_stage;
const char *gonio_stage_name(int stage); // "frames" ...
// One checksum of a stage up to GONIO_STAGE_SAMPLES, from what the journal holds: SHA-256 over a line a frame, "STEP
// FRAME SHA256\n", or a line a step, "STEP SHA256\n", in their order. Empty where there is nothing.
gonio_status gonio_session_stage_hash(gonio_session *session, gonio_stage stage, char hex[GONIO_SHA256_HEX],
                                      gonio_error *error);

// All of a session as one HDF5 file with NeXus' names (docs/formats.md), and back: every table of the journal whole,
// the frames, the model and the files of the folder; equal checksums. Memory is that of a few frames. Either appears
// whole or not at all; progress (may be NULL) returning false stops with GONIO_E_INTERRUPTED.
gonio_status gonio_session_export(gonio_session *session, const char *path, gonio_progress_fn progress, void *context,
                                  gonio_error *error);
// path: of the new session; GONIO_E_USAGE where something is there. The file is held against its own checksums, and
// GONIO_E_INPUT says where it is not what it should be.
gonio_status gonio_session_import(const char *hdf5, const char *path, gonio_progress_fn progress, void *context,
                                  gonio_error *error);
// The samples of such a file, as gonio_session_read gives a session's; its journal is verified, its frames are not
// read. The caller frees them.
gonio_status gonio_session_read_hdf5(const char *hdf5, gonio_samples **out, gonio_error *error);
bool gonio_session_is_hdf5(const char *path); // a file that begins as HDF5 files do

// What the doctor found.
typedef struct gonio_doctor_report {
    int64_t steps, steps_done;
    int64_t steps_lost;    // done steps with bad frames; a repair undoes them, and `gonio resume` measures them again
    int64_t steps_missing; // of the plan, whose rows the journal has lost: nobody can measure them again
    int64_t frames;        // of the steps that are done
    int64_t frames_bad;    // missing, truncated, or of another checksum
    int64_t frames_unreadable; // the disk or the permissions do not give them: not known to be damaged
    int64_t samples_bad;       // steps whose samples do not match their checksum or lack; frames can restore them
    int64_t rows_lost;         // parts of a damaged journal that could not be read, at the least
    int64_t flagged;           // done steps that no audit of the stage has vouched for yet
    int64_t strays;            // files that a stopped step or program left
    int64_t foreign;           // entries of frames/ that are not Gonio's; they stay where they are
    bool database_ok;
    bool results_ok; // the journalled checksums of the final samples and of the model file are theirs, where there are
                     // any
    // Of a repair:
    bool repaired;          // another session took the path, or strays were set aside
    int64_t files_linked;   // of the new session, which are second names of the old one's files
    int64_t files_copied;   // where the file system gives none
    int64_t files_aside;    // in the new session's lost+found/
    char damaged_path[512]; // where the session as it was stands now; "": nowhere, it was not replaced
    int64_t findings_cut;   // findings that detail has no room for
    int64_t findings;       // all of them
    char detail[8192];      // one line a finding
} gonio_doctor_report;
// Is everything there and as it was stored?
bool gonio_doctor_sound(const gonio_doctor_report *report);
// Verify everything; nothing at all is changed. A damaged session is GONIO_OK with what is wrong in the report; an
// error is what prevented the examination.
//
// repair: make a session of all that is intact, beside this one (frames are hard links), without the steps that have
// bad frames (`gonio resume` measures them again) and the samples that frames can restore; of a damaged journal
// whatever can be read. It is verified, takes the path in one exchange, and the session as it was stays beside it as
// SESSION.damaged-N; nothing is deleted. What no step owns goes to its lost+found/. GONIO_E_IO where something is
// unreadable, GONIO_E_INPUT where nearly all frames are bad or frames/ is not there, which is a disk or a setting
// rather than damage: then, and after every other failure, the session is as it was.
gonio_status gonio_session_doctor(const char *path, bool repair, gonio_doctor_report *report, gonio_error *error);

// What the session knows of its measurement, as gonio_samples.head has it, whose samples carry it; the caller frees
// *head, which is NULL where nothing is known.
gonio_status gonio_session_head(gonio_session *session, char **head, gonio_error *error);
// SHA-256 as 64 hex digits: of bytes, of a file, and of the CSV that gonio_write_samples makes of a set, but for the
// lines of its head that say with which instrument, and when.
gonio_status gonio_sha256(const void *data, size_t size, char hex[GONIO_SHA256_HEX], gonio_error *error);
gonio_status gonio_sha256_file(const char *path, char hex[GONIO_SHA256_HEX], gonio_error *error);
gonio_status gonio_sha256_samples(const gonio_samples *samples, char hex[GONIO_SHA256_HEX], gonio_error *error);
// Is that the SHA-256 of the set, or, as earlier releases had it, of the set without its head?
bool gonio_sha256_samples_is(const gonio_samples *samples, const char *expected);
// Of a step's samples as the journal holds them (docs/formats.md).
gonio_status gonio_sha256_rows(const gonio_samples *samples, char hex[GONIO_SHA256_HEX], gonio_error *error);

GONIO_END
#endif
