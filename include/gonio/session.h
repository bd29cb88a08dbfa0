// A session: a folder that holds all of an acquisition, self-describing from its first second (docs/formats.md).
//
// session.db (SQLite, WAL, full sync) journals settings, steps, frames, samples and events; frames/ holds the pixels,
// 16-bit PNG. A frame is written to a temporary name, synced, renamed, and only then entered.
#ifndef GONIO_SESSION_H
#define GONIO_SESSION_H

#include "gonio/calib.h"
#include "gonio/plan.h"
#include "gonio/rig.h"
#include "gonio/sample.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GONIO_SESSION_VERSION 1

typedef struct gonio_session gonio_session;

typedef enum gonio_step_kind { GONIO_STEP_DARK, GONIO_STEP_REFERENCE, GONIO_STEP_SAMPLE } gonio_step_kind;

// One step of the session: a pose with a target, done as a whole or not at all.
typedef struct gonio_step {
    int64_t index; // running number; equals gonio_stamp.pose
    gonio_step_kind kind;
    gonio_pair pose;
    bool done;
    double clock_end_s;    // nominal clock when it was done
    double exposure_end_s; // the exposure to begin the next step with
    int frames;
} gonio_step;

gonio_status gonio_session_create(const char *path, gonio_session **out, gonio_error *error); // fails where one exists
gonio_status gonio_session_open(const char *path, bool writable, gonio_session **out, gonio_error *error);
void gonio_session_close(gonio_session *session); // NULL is allowed
bool gonio_session_is(const char *path);          // a folder with a session.db

// Settings: key -> text. get: the caller frees the text; GONIO_E_INPUT where the key is missing.
gonio_status gonio_session_put(gonio_session *session, const char *key, const char *value, gonio_error *error);
gonio_status gonio_session_get(gonio_session *session, const char *key, char **value, gonio_error *error);
gonio_status gonio_session_event(gonio_session *session, const char *kind, const char *text, gonio_error *error);

// The steps, entered once at the start, in one transaction.
gonio_status gonio_session_put_steps(gonio_session *session, const gonio_step *steps, size_t n, gonio_error *error);
gonio_status gonio_session_steps(gonio_session *session, gonio_step **steps, size_t *n,
                                 gonio_error *error); // caller frees

// Finish a step: store the frames (files synced and renamed), then enter frames, samples and the step in one
// transaction.
gonio_status gonio_session_finish_step(gonio_session *session, const gonio_step *step, const gonio_exposure *exposures,
                                       int n, const gonio_samples *samples, gonio_error *error);
// Read a step's exposures back; every checksum is verified. The caller frees with gonio_exposures_free.
gonio_status gonio_session_exposures(gonio_session *session, int64_t step, gonio_exposure **exposures, int *n,
                                     gonio_error *error);
void gonio_exposures_free(gonio_exposure *exposures, int n);
// All samples in step order, as journalled (before the pointing term). The caller frees them.
gonio_status gonio_session_samples(gonio_session *session, gonio_samples **out, gonio_error *error);

typedef struct gonio_doctor_report {
    int64_t frames, frames_bad, steps_done, steps_lost;
    bool database_ok;
} gonio_doctor_report;
gonio_status gonio_session_doctor(const char *path, bool repair, gonio_doctor_report *report, gonio_error *error);

#ifdef __cplusplus
}
#endif
#endif
