// SPDX-License-Identifier: BSD-3-Clause
#include "host/acquire/steer.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"

// The journal grows in pages, and its write-ahead log is emptied only every 4 MB.
#define JOURNAL_BYTES (8 << 20)
#define LOOK_MS 100
// A controller's dead-man is fed for a host that calls; so often, a host that pauses does.
#define CALL_S 2

// ---- telling ----

static const char *state_of(const gonio_steer *s) {
    const gonio_control *control = s->rig->control;
    return gonio_control_stopping(control)                    ? "stopping"
           : s->what[0] != 0 && gonio_control_paused(control) ? "paused"
           : s->what[0] != 0                                  ? "waiting for room"
           : gonio_control_paused(control)                    ? "pausing"
                                                              : "running";
}

static json_t *real(double value) { return isfinite(value) ? json_real(value) : json_null(); }

// phase: what is at work, or would be without the pause.
static void tell(const gonio_steer *s, gonio_measure_phase phase, const gonio_measure_progress *now) {
    if (s->rig->control == NULL) {
        return;
    }
    const double worked_s = gonio_clock_s() - s->started_s - s->paused_s;
    const bool poses = phase == GONIO_MEASURE_POSES;
    const double rate = poses && now->done > now->done_before ? (double)(now->done - now->done_before) / worked_s : NAN;
    json_t *object =
        json_pack("{s:s,s:s,s:s,s:I,s:I,s:I,s:f,s:o,s:o,s:o}", "session", s->place, "phase", poses ? "poses" : "fit",
                  "doing", now->what, "poses_done", (json_int_t)now->done, "poses", (json_int_t)now->total,
                  "done_before", (json_int_t)now->done_before, "fraction", now->fraction, "rate_per_s", real(rate),
                  "eta_s", real((double)(now->total - now->done) / rate), "held_out_rmse", real(now->error));
    if (object == NULL) { // a path that is not UTF-8: who asks knows it
        return;
    }
    json_object_set_new(object, "state", json_string(state_of(s)));
    char *text = json_dumps(object, JSON_COMPACT | JSON_PRESERVE_ORDER | JSON_EMBED);
    if (text != NULL) {
        gonio_control_tell(s->rig->control, text);
    }
    free(text);
    json_decref(object);
}

static void note(const gonio_steer *s, const char *kind, const char *text) {
    const gonio_measure_hooks *hooks = &s->options->hooks;
    gonio_session_event(s->session, kind, text, NULL);
    if (hooks->note != NULL) {
        hooks->note(hooks->context, text);
    }
}

// ---- a run ----

void gonio_steer_begin(gonio_steer *s, gonio_session *session, const gonio_rig_file *rig,
                       const gonio_measure_options *options) {
    *s = (gonio_steer){.session = session,
                       .rig = rig,
                       .options = options,
                       .started_s = gonio_clock_s(),
                       .place = realpath(gonio_session_path(session), NULL),
                       .needed_bytes = JOURNAL_BYTES};
    gonio_error why = {.line = -1, .byte = -1};
    char text[600];
    if (rig->control == NULL || s->place == NULL) {
        return;
    }
    if (gonio_control_listen(rig->control, GONIO_CONTROL_SESSION, s->place, &why) != GONIO_OK) {
        snprintf(text, sizeof text, "cannot be steered from another terminal: %s", why.message);
        note(s, "control", text);
    }
}

void gonio_steer_end(gonio_steer *s) {
    gonio_control_leave(s->rig->control, GONIO_CONTROL_SESSION);
    free(s->place);
    s->place = NULL;
}

gonio_status gonio_steer_stored(gonio_steer *s, int64_t from, gonio_error *error) {
    int64_t bytes;
    const gonio_status status = gonio_session_largest_step(s->session, from, &bytes, error);
    if (status == GONIO_OK && bytes + JOURNAL_BYTES > s->needed_bytes) {
        s->needed_bytes = bytes + JOURNAL_BYTES;
    }
    return status;
}

bool gonio_steer_no_room(const gonio_steer *s) {
    int64_t bytes;
    return s->options->wait_for_room && gonio_session_room(s->session, &bytes, NULL) == GONIO_OK &&
           bytes < s->needed_bytes;
}

static gonio_status go_on(const gonio_steer *s, gonio_measure_phase phase, const gonio_measure_progress *now,
                          gonio_error *error) {
    const gonio_measure_hooks *hooks = &s->options->hooks;
    tell(s, phase, now);
    if (gonio_control_stopping(s->rig->control)) {
        return gonio_fail(error, GONIO_E_INTERRUPTED, "stopped from another terminal, after %zu of %zu poses",
                          now->done, now->total);
    }
    return hooks->progress == NULL || hooks->progress(hooks->context, now)
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_INTERRUPTED, "stopped after %zu of %zu poses", now->done, now->total);
}

// ---- pauses ----

static bool must_wait(gonio_steer *s, gonio_measure_phase phase) {
    int64_t bytes;
    if (gonio_control_paused(s->rig->control)) {
        snprintf(s->what, sizeof s->what, "`gonio pause --off`");
    } else if (phase == GONIO_MEASURE_POSES && gonio_steer_no_room(s) &&
               gonio_session_room(s->session, &bytes, NULL) == GONIO_OK) {
        snprintf(s->what, sizeof s->what, "room on the disk: %.1f MB are free, the next step may need %.1f MB",
                 1e-6 * (double)bytes, 1e-6 * (double)s->needed_bytes);
    } else {
        s->what[0] = 0;
    }
    return s->what[0] != 0;
}

// The stage's answer feeds the dead-man, and tells an alarm. An open door is no fault while nothing is measured.
static gonio_status wait_a_moment(const gonio_steer *s, double *called_s, gonio_error *error) {
    const gonio_rig *rig = &s->rig->rig;
    const struct timespec moment = {0, LOOK_MS * 1000000L};
    nanosleep(&moment, NULL); // a signal ends it early, which is right
    if (gonio_clock_s() - *called_s < CALL_S) {
        return GONIO_OK;
    }
    double position[GONIO_AXES];
    *called_s = gonio_clock_s();
    return rig->stage->position(rig->stage_device, position, error);
}

static gonio_status wait_on(gonio_steer *s, const gonio_measure_progress *now, gonio_error *error) {
    const gonio_rig *rig = &s->rig->rig;
    gonio_measure_progress standing = *now;
    standing.phase = GONIO_MEASURE_PAUSED;
    standing.what = s->what;
    double called_s = 0;
    gonio_status status = rig->lamp->set_shutter(rig->lamp_device, false, error);
    while (status == GONIO_OK && must_wait(s, now->phase)) {
        status = go_on(s, now->phase, &standing, error);
        status = status == GONIO_OK ? wait_a_moment(s, &called_s, error) : status;
    }
    s->what[0] = 0;
    return status;
}

gonio_status gonio_steer_checkpoint(gonio_steer *s, const gonio_measure_progress *now, gonio_error *error) {
    gonio_status status = go_on(s, now->phase, now, error);
    if (status != GONIO_OK || !must_wait(s, now->phase)) {
        return status;
    }
    char text[256];
    const double began_s = gonio_clock_s();
    snprintf(text, sizeof text, "paused, the shutter closed; waits for %s", s->what);
    note(s, gonio_control_paused(s->rig->control) ? "paused" : "no room", text);
    status = wait_on(s, now, error);
    const double took_s = gonio_clock_s() - began_s;
    s->paused_s += took_s;
    if (status == GONIO_OK) {
        snprintf(text, sizeof text, "goes on after a pause of %.0f s", took_s);
        note(s, "continued", text);
        status = go_on(s, now->phase, now, error);
    }
    return status;
}
