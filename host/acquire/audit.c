// SPDX-License-Identifier: BSD-3-Clause
// The lost-step audit. An open-loop axis that slips goes on as if nothing had happened; only its home switch can tell.
// So every step is flagged until a homing has found the switch where it must be.
#include <math.h>
#include <stdio.h>

#include "host/acquire/acquire.h"

static void describe(const double difference_rad[GONIO_AXES], const char *what, char text[256]) {
    snprintf(text, 256,
             "%s: light_theta %+.4f, light_phi %+.4f, camera_theta %+.4f, camera_phi %+.4f deg since the last homing",
             what, gonio_degrees(difference_rad[GONIO_LIGHT_THETA]), gonio_degrees(difference_rad[GONIO_LIGHT_PHI]),
             gonio_degrees(difference_rad[GONIO_CAMERA_THETA]), gonio_degrees(difference_rad[GONIO_CAMERA_PHI]));
}

static gonio_status home(const gonio_rig *rig, double timeout_s, gonio_audit_verdict *verdict, char text[256],
                         gonio_error *error) {
    double difference_rad[GONIO_AXES] = {0};
    gonio_error why = {.line = -1, .byte = -1};
    if (rig->stage->audit == NULL) {
        *verdict = GONIO_AUDIT_GOOD; // nothing is flagged on such a stage
        text[0] = 0;
        return rig->stage->home(rig->stage_device, timeout_s, error);
    }
    const gonio_status status = rig->stage->audit(rig->stage_device, timeout_s, difference_rad, &why);
    if (status != GONIO_OK && status != GONIO_E_MISMATCH) {
        if (error != NULL) {
            *error = why;
        }
        return status;
    }
    bool known = true;
    for (int k = 0; k < GONIO_AXES; k++) {
        known = known && isfinite(difference_rad[k]);
    }
    *verdict = status == GONIO_E_MISMATCH ? GONIO_AUDIT_BAD : known ? GONIO_AUDIT_GOOD : GONIO_AUDIT_UNKNOWN;
    if (known) {
        describe(difference_rad, *verdict == GONIO_AUDIT_GOOD ? "good" : "steps were lost", text);
    } else {
        snprintf(text, 256, "homed; whether steps had been lost before is not known");
    }
    return GONIO_OK;
}

// What stands on the calibration is computed anew when it has been measured again.
static gonio_status drop_samples(gonio_session *session, const gonio_process *process, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (size_t i = process->first_sample; status == GONIO_OK && i < process->n; i++) {
        if (process->steps[i].done) {
            status = gonio_session_put_step_samples(session, (int64_t)i, NULL, error);
        }
    }
    return status;
}

static gonio_status undo_flagged(gonio_session *session, gonio_process *process, size_t *undone, gonio_error *error) {
    gonio_status status = GONIO_OK;
    bool calibration = false;
    for (size_t i = 0; status == GONIO_OK && i < process->n; i++) {
        gonio_step *step = &process->steps[i];
        if (!step->done || !step->flagged) {
            continue;
        }
        status = gonio_session_undo_step(session, step->index, NULL, error);
        step->done = step->flagged = false;
        step->frames = 0;
        calibration = calibration || i < process->first_sample;
        ++*undone;
    }
    return status == GONIO_OK && calibration ? drop_samples(session, process, error) : status;
}

static gonio_status judge(gonio_session *session, gonio_process *process, gonio_audit_verdict verdict, const char *text,
                          size_t *undone, gonio_error *error) {
    gonio_status status = gonio_session_event(session, "audit", text, error);
    if (status == GONIO_OK && verdict != GONIO_AUDIT_GOOD) {
        return undo_flagged(session, process, undone, error);
    }
    for (size_t i = 0; i < process->n; i++) {
        process->steps[i].flagged = false;
    }
    return status == GONIO_OK ? gonio_session_unflag(session, error) : status;
}

gonio_status gonio_audit(gonio_session *session, const gonio_rig *rig, gonio_process *process, double timeout_s,
                         gonio_audit_verdict *verdict, size_t *undone, char text[256], gonio_error *error) {
    *undone = 0;
    gonio_status status = home(rig, timeout_s, verdict, text, error);
    if (status != GONIO_OK || text[0] == 0) {
        return status;
    }
    // One transaction: a kill in between must not leave a calibration without the samples' removal.
    status = gonio_session_begin(session, error);
    return status == GONIO_OK
               ? gonio_session_end(session, judge(session, process, *verdict, text, undone, error), error)
               : status;
}
