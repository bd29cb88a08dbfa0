// SPDX-License-Identifier: BSD-3-Clause
// The scan loop: move, settle, expose, calibrate, store; one step at a time, as a whole or not at all.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/acquire/acquire.h"
#include "host/transport/clock.h"

#define HOME_TIMEOUT_S 300
#define WARM_UP_TIMEOUT_S 7200
// A move may take this much longer than the stage's own estimate before it counts as stuck.
#define MOVE_SLACK 5
#define MOVE_MARGIN_S 30
// So many audits, or poses, one after the other that each found lost steps: the axis will not do better the next time.
#define BAD_AUDITS_MAX 3

enum { TARGET_UNKNOWN = -1 };

struct gonio_scan {
    gonio_session *session;
    const gonio_rig *rig;
    gonio_scan_hooks hooks;
    gonio_process process;
    size_t next;            // first undone step
    bool ready;             // the calibration is prepared
    int target;             // what lies on the table
    double waited_s;        // for the lamp, before the first step of this run
    int bad_audits;         // in a row
    bool slipped;           // an encoder has found lost steps at this step
    int slips;              // so often one after the other
    bool compared;          // every axis has an encoder
    double monitor;         // the lamp's, at the last frame; 0: none yet
    gonio_samples *samples; // of the last step
    gonio_step_radiance radiance;
};

static size_t flagged_poses(const gonio_scan *scan, bool *any) {
    size_t poses = 0;
    *any = false;
    for (size_t i = 0; i < scan->process.n; i++) {
        const gonio_step *step = &scan->process.steps[i];
        *any = *any || step->flagged;
        poses += step->flagged && step->kind == GONIO_STEP_SAMPLE;
    }
    return poses;
}

static void to_next(gonio_scan *scan) {
    while (scan->next < scan->process.n && scan->process.steps[scan->next].done) {
        scan->next++;
    }
}

static void note(gonio_scan *scan, const char *kind, const char *text) {
    gonio_session_event(scan->session, kind, text, NULL);
    if (scan->hooks.note != NULL) {
        scan->hooks.note(scan->hooks.context, text);
    }
}

void gonio_scan_halt(gonio_scan *scan) {
    const gonio_rig *rig = scan->rig;
    rig->stage->stop(rig->stage_device, NULL);
    rig->lamp->set_shutter(rig->lamp_device, false, NULL);
}

static double clock_before(const gonio_scan *scan, size_t step) {
    return step > 0 ? scan->process.steps[step - 1].clock_end_s : 0;
}

// Wait until the lamp is warm; the first step of a session counts that on its nominal clock.
static gonio_status warm_up(gonio_scan *scan, gonio_error *error) {
    const gonio_stamp stamp = {(int64_t)scan->next, 0, clock_before(scan, scan->next)};
    return scan->rig->lamp->wait_ready(scan->rig->lamp_device, &stamp, WARM_UP_TIMEOUT_S, &scan->waited_s, error);
}

// Go on after steps were taken back: frames of theirs that lie about are removed, and a calibration that lost a step is
// no longer one.
static gonio_status go_back(gonio_scan *scan, size_t undone, const char *why, gonio_error *error) {
    char text[400];
    snprintf(text, sizeof text, "%s; %zu steps are measured again", why, undone);
    note(scan, "measured again", text);
    scan->next = 0;
    to_next(scan);
    if (scan->hooks.undone != NULL) {
        scan->hooks.undone(scan->hooks.context, undone);
    }
    const gonio_status status = gonio_session_sweep(scan->session, NULL, error);
    return status == GONIO_OK && scan->next < scan->process.first_sample
               ? gonio_process_prepare(scan->session, &scan->process, NULL, NULL, 0, &scan->ready, error)
               : status;
}

static gonio_status audit(gonio_scan *scan, gonio_error *error) {
    gonio_audit_verdict verdict;
    size_t undone;
    char text[256];
    const gonio_status status =
        gonio_audit(scan->session, scan->rig, &scan->process, HOME_TIMEOUT_S, &verdict, &undone, text, error);
    if (status != GONIO_OK) {
        return status;
    }
    scan->bad_audits = verdict == GONIO_AUDIT_BAD ? scan->bad_audits + 1 : 0;
    if (undone > 0 && go_back(scan, undone, text, error) != GONIO_OK) {
        return GONIO_E_FAILED;
    }
    return scan->bad_audits < BAD_AUDITS_MAX
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_DEVICE, "%d audits in a row found lost steps (%s)", scan->bad_audits, text);
}

static gonio_status start_rig(gonio_scan *scan, gonio_error *error) {
    const gonio_rig *rig = scan->rig;
    gonio_status status = GONIO_OK;
    if (rig->interlock != NULL) {
        status = rig->interlock->check(rig->interlock_device, error);
    }
    // Homing first: it ends an alarm that a fault has left behind, and with one standing the lamp stays dark.
    status = status == GONIO_OK ? audit(scan, error) : status;
    status = status == GONIO_OK ? rig->lamp->set_level(rig->lamp_device, 1, error) : status;
    status = status == GONIO_OK ? warm_up(scan, error) : status;
    if (status == GONIO_OK) {
        char text[64];
        snprintf(text, sizeof text, "level 1, ready after %.6g s", scan->waited_s);
        status = gonio_session_event(scan->session, "lamp", text, error);
    }
    return status;
}

// Samples that the journal lacks although their frames are there: the calibration they stood on was measured again, or
// the doctor dropped them.
static gonio_status restore_samples(gonio_scan *scan, gonio_error *error) {
    gonio_samples **sets;
    gonio_step_radiance *radiance;
    gonio_status status =
        gonio_process_samples(scan->session, &scan->process, true, 0, NULL, NULL, &sets, &radiance, error);
    int restored = 0;
    for (size_t i = 0; status == GONIO_OK && i < scan->process.n; i++) {
        if (sets[i] != NULL) {
            status = gonio_session_put_step_samples(scan->session, (int64_t)i, sets[i], error);
            restored++;
        }
        if (sets[i] != NULL && status == GONIO_OK && radiance[i].channels > 0) {
            status = gonio_session_put_radiance(scan->session, (int64_t)i, &radiance[i], error);
        }
    }
    gonio_sets_free(sets, scan->process.n);
    free(radiance);
    if (status == GONIO_OK && restored > 0) {
        char text[64];
        snprintf(text, sizeof text, "samples of %d steps were computed anew", restored);
        note(scan, "restored", text);
    }
    return status;
}

gonio_status gonio_scan_new(gonio_session *session, const gonio_rig *rig, const gonio_scan_hooks *hooks,
                            gonio_scan **out, gonio_error *error) {
    *out = NULL;
    gonio_scan *scan = calloc(1, sizeof *scan);
    if (scan == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a scan");
    }
    scan->session = session;
    scan->rig = rig;
    scan->hooks = *hooks;
    scan->target = TARGET_UNKNOWN;
    gonio_status status = gonio_session_check_present(session, error);
    status = status == GONIO_OK ? gonio_session_drop_undone(session, error) : status;
    status = status == GONIO_OK ? gonio_session_sweep(session, NULL, error) : status;
    status = status == GONIO_OK ? gonio_process_begin(session, &scan->process, error) : status;
    if (status == GONIO_OK) {
        status = gonio_process_prepare(session, &scan->process, NULL, NULL, 0, &scan->ready, error);
    }
    status = status == GONIO_OK && scan->ready ? restore_samples(scan, error) : status;
    status = status == GONIO_OK ? gonio_session_monitor(session, &scan->monitor, error) : status;
    to_next(scan);
    bool unaudited = false;
    flagged_poses(scan, &unaudited); // killed after the last step: what is left to do is the audit
    if (status == GONIO_OK && (!gonio_scan_done(scan) || unaudited)) {
        status = start_rig(scan, error);
    }
    if (status != GONIO_OK) {
        if (status != GONIO_E_INTERRUPTED) {
            gonio_session_event(session, "fault", error != NULL ? error->message : gonio_status_text(status), NULL);
        }
        gonio_scan_free(scan);
        return status;
    }
    *out = scan;
    return GONIO_OK;
}

void gonio_scan_free(gonio_scan *scan) {
    if (scan != NULL) {
        gonio_scan_halt(scan);
        gonio_process_end(&scan->process);
        gonio_samples_free(scan->samples);
        free(scan);
    }
}

bool gonio_scan_done(const gonio_scan *scan) { return scan->next == scan->process.n; }

int64_t gonio_scan_next(const gonio_scan *scan) { return (int64_t)scan->next; }

gonio_status gonio_scan_extend(gonio_scan *scan, const gonio_step *more, size_t n, gonio_error *error) {
    gonio_process *process = &scan->process;
    gonio_step *larger = realloc(process->steps, (process->n + n) * sizeof *larger);
    if (larger == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu steps", process->n + n);
    }
    process->steps = larger;
    memcpy(larger + process->n, more, n * sizeof *more);
    process->n += n;
    return GONIO_OK;
}

gonio_process *gonio_scan_process(gonio_scan *scan) { return &scan->process; }

// ---- one step ----

static gonio_status tell_mounted(gonio_scan *scan, gonio_target target, gonio_error *error) {
    static const char *const names[] = {
        [GONIO_TARGET_SAMPLE] = "sample", [GONIO_TARGET_REFERENCE] = "reference", [GONIO_TARGET_TRAP] = "light trap"};
    const bool hands = scan->process.setup.scan.hands || scan->rig->mount == NULL;
    char text[64];
    snprintf(text, sizeof text, "%s, by %s", names[target], hands ? "the operator" : "the changer");
    return gonio_session_event(scan->session, "mounted", text, error);
}

static gonio_status mount(gonio_scan *scan, gonio_step_kind kind, gonio_error *error) {
    const int target = kind == GONIO_STEP_REFERENCE ? GONIO_TARGET_REFERENCE
                       : kind == GONIO_STEP_TRAP    ? GONIO_TARGET_TRAP
                                                    : GONIO_TARGET_SAMPLE;
    if (kind == GONIO_STEP_DARK || scan->target == target) {
        return GONIO_OK; // dark frames do not see the table
    }
    gonio_status status = GONIO_OK;
    if (scan->process.setup.scan.hands || scan->rig->mount == NULL) {
        status = scan->hooks.mount != NULL
                     ? scan->hooks.mount(scan->hooks.context, (gonio_target)target, error)
                     : gonio_fail(error, GONIO_E_DEVICE, "no sample changer, and nobody to change the sample");
    }
    if (status == GONIO_OK && scan->rig->mount != NULL) {
        status = scan->rig->mount->mount(scan->rig->mount_device, (gonio_target)target, error);
    }
    scan->target = status == GONIO_OK ? target : TARGET_UNKNOWN;
    return status == GONIO_OK ? tell_mounted(scan, (gonio_target)target, error) : status;
}

static gonio_status move(gonio_scan *scan, const gonio_step *step, double *clock_s, gonio_error *error) {
    const gonio_rig *rig = scan->rig;
    double from[GONIO_AXES] = {0}, to[GONIO_AXES];
    if (step->index > 0) {
        gonio_scan_target(&scan->process.steps[step->index - 1].pose, from);
    }
    gonio_scan_target(&step->pose, to);
    const double takes_s = rig->stage->duration_s(rig->stage_device, from, to);
    const gonio_stamp stamp = {step->index, 0, *clock_s};
    // After a resume the arms start from elsewhere; the nominal clock knows only the nominal way.
    const gonio_status status = rig->stage->move(rig->stage_device, to, (uint32_t)(step->index + 1), &stamp,
                                                 MOVE_SLACK * takes_s + HOME_TIMEOUT_S + MOVE_MARGIN_S, error);
    const double settle_s = scan->process.setup.scan.settle_s;
    scan->slipped = status == GONIO_E_MISMATCH;
    if (status == GONIO_OK && rig->stage->real) {
        gonio_clock_sleep_ms((int)ceil(settle_s * 1000));
    }
    *clock_s += takes_s + settle_s;
    return status;
}

// The exposure that the last step of this kind ended with; 0: there was none.
static double first_exposure(const gonio_scan *scan, const gonio_step *step) {
    for (int64_t i = step->index - 1; i >= 0; i--) {
        if (scan->process.steps[i].kind == step->kind) {
            return scan->process.steps[i].exposure_end_s;
        }
    }
    return 0;
}

static gonio_status approach(gonio_scan *scan, const gonio_step *step, double *clock_s, gonio_error *error) {
    const gonio_rig *rig = scan->rig;
    *clock_s = clock_before(scan, scan->next) + scan->waited_s;
    gonio_status status = mount(scan, step->kind, error);
    if (status == GONIO_OK && rig->interlock != NULL) {
        status = rig->interlock->check(rig->interlock_device, error);
    }
    if (status == GONIO_OK) {
        // A source of known radiance lights itself.
        const gonio_rig_facts *facts = &scan->process.setup.facts;
        const bool own_light =
            step->kind == GONIO_STEP_REFERENCE && facts->irradiance > 0 && facts->reference_radiance > 0;
        status = rig->lamp->set_shutter(rig->lamp_device, step->kind != GONIO_STEP_DARK && !own_light, error);
    }
    return status == GONIO_OK ? move(scan, step, clock_s, error) : status;
}

// Calibrate with the new frames before they are stored: what is no calibration (a dark frame that is not dark) must not
// count as done. The fault may be in the steps before it, so they are all taken again.
static gonio_status evaluate_calibration(gonio_scan *scan, const gonio_step *step, const gonio_exposures *exposures,
                                         gonio_error *error) {
    if (scan->next > scan->process.first_sample) {
        return GONIO_OK; // the reference after the samples: gonio_finish reads it from the session
    }
    const gonio_status status =
        gonio_process_prepare(scan->session, &scan->process, step, exposures->items, exposures->n, &scan->ready, error);
    for (size_t i = 0; status != GONIO_OK && i < scan->process.first_sample; i++) {
        if (scan->process.steps[i].done) {
            gonio_session_undo_step(scan->session, (int64_t)i, "the calibration failed", NULL);
        }
    }
    return status;
}

static gonio_status evaluate(gonio_scan *scan, const gonio_step *step, const gonio_exposures *exposures,
                             gonio_error *error) {
    if (step->kind == GONIO_STEP_CHECK) {
        return GONIO_OK; // gonio_finish compares them
    }
    if (step->kind != GONIO_STEP_SAMPLE) {
        return evaluate_calibration(scan, step, exposures, error);
    }
    char why[512], text[600];
    const gonio_status status = gonio_process_pose(&scan->process, step, exposures->items, exposures->n, &scan->samples,
                                                   &scan->radiance, why, error);
    if (status == GONIO_OK && why[0] != 0) {
        snprintf(text, sizeof text, "no sample: %s", why);
        note(scan, "no sample", text);
    }
    return status;
}

// What the encoders say, where there are any; those of a step vouch for all of its frames.
static gonio_status verify(gonio_scan *scan, gonio_error *error) {
    const gonio_rig *rig = scan->rig;
    double difference_rad[GONIO_AXES];
    if (rig->stage->verify == NULL) {
        return GONIO_OK;
    }
    const gonio_status status = rig->stage->verify(rig->stage_device, difference_rad, error);
    scan->slipped = status == GONIO_E_MISMATCH;
    scan->compared = true;
    for (int k = 0; k < GONIO_AXES; k++) {
        scan->compared = scan->compared && isfinite(difference_rad[k]);
    }
    return status;
}

// What was exposed counts only where the arms stood, the lamp burned and nobody stopped the rig to the end.
static gonio_status still_sound(gonio_scan *scan, const gonio_exposures *exposures, gonio_error *error) {
    const gonio_rig *rig = scan->rig;
    const gonio_stamp stamp = {(int64_t)scan->next, exposures->n, exposures->clock_s};
    double waited_s;
    scan->monitor = exposures->monitor;
    gonio_status status = rig->lamp->wait_ready(rig->lamp_device, &stamp, 0, &waited_s, error);
    if (status == GONIO_OK && rig->interlock != NULL) {
        status = rig->interlock->check(rig->interlock_device, error);
    }
    return status == GONIO_OK ? verify(scan, error) : status;
}

static gonio_status do_step(gonio_scan *scan, gonio_exposures *exposures, gonio_error *error) {
    gonio_step *step = &scan->process.steps[scan->next];
    gonio_status status = approach(scan, step, &exposures->clock_s, error);
    if (status == GONIO_OK) {
        status = gonio_expose_step(scan->rig, &scan->process.setup, scan->process.calib, step,
                                   first_exposure(scan, step), exposures, error);
    }
    status = status == GONIO_OK ? still_sound(scan, exposures, error) : status;
    status = status == GONIO_OK ? evaluate(scan, step, exposures, error) : status;
    gonio_step finished = *step;
    finished.done = true;
    finished.flagged = scan->rig->stage->audit != NULL;
    finished.frames = exposures->n;
    finished.clock_end_s = exposures->clock_s;
    finished.exposure_end_s = exposures->end_s;
    finished.radiance = step->kind == GONIO_STEP_SAMPLE ? scan->radiance : (gonio_step_radiance){0};
    if (status == GONIO_OK) {
        status =
            gonio_session_finish_step(scan->session, &finished, exposures->items, exposures->n, scan->samples, error);
    }
    if (status == GONIO_OK) {
        *step = finished;
    }
    return status;
}

// ---- audits on the way ----

// To the pose where the session began, and where it ends: from there the way to the home switches is known to be free.
static gonio_status park(gonio_scan *scan, gonio_error *error) {
    const gonio_rig *rig = scan->rig;
    const gonio_step *here = &scan->process.steps[scan->next - 1];
    double target[GONIO_AXES];
    gonio_scan_target(&scan->process.steps[0].pose, target);
    const gonio_stamp stamp = {here->index, 0, here->clock_end_s};
    const gonio_status status = rig->stage->move(rig->stage_device, target, (uint32_t)(here->index + 1), &stamp,
                                                 HOME_TIMEOUT_S + MOVE_MARGIN_S, error);
    return status == GONIO_E_MISMATCH ? GONIO_OK : status; // lost steps, which the homing that follows puts right
}

// The nominal clock does not count audits, so that a resumed session, which has others, has the same clock.
static gonio_status audit_if_due(gonio_scan *scan, gonio_error *error) {
    bool any;
    const size_t poses = flagged_poses(scan, &any);
    const gonio_scan_options *options = &scan->process.setup.scan;
    const int every = scan->compared ? options->encoder_audit_poses : options->audit_poses;
    const size_t before = scan->next;
    const bool at_end = scan->next == scan->process.n;
    if (!any || !(at_end || (every > 0 && poses >= (size_t)every))) {
        return GONIO_OK;
    }
    gonio_status status = at_end ? GONIO_OK : scan->rig->lamp->set_shutter(scan->rig->lamp_device, false, error);
    status = status == GONIO_OK ? park(scan, error) : status;
    status = status == GONIO_OK ? audit(scan, error) : status;
    // Taken back to the first step: it waited for the lamp.
    return status == GONIO_OK && scan->next < before ? warm_up(scan, error) : status;
}

// Steps were lost at this one: home again, and do it again. Those before it stand, for the encoders vouched for each;
// whether they did that truly the audit tells.
static gonio_status recover(gonio_scan *scan, gonio_error *error) {
    char text[600];
    const size_t before = scan->next;
    scan->slipped = false;
    snprintf(text, sizeof text, "step %zu: %.400s; home again, and measure it again", scan->next, error->message);
    note(scan, "lost-steps", text);
    if (++scan->slips >= BAD_AUDITS_MAX) {
        gonio_error why = *error;
        return gonio_fail(error, GONIO_E_DEVICE, "%d times in a row, %.400s", scan->slips, why.message);
    }
    gonio_status status = scan->rig->lamp->set_shutter(scan->rig->lamp_device, false, error);
    status = status == GONIO_OK && scan->next > 0 ? park(scan, error) : status;
    status = status == GONIO_OK ? audit(scan, error) : status;
    status = status == GONIO_OK ? gonio_session_sweep(scan->session, NULL, error) : status;
    return status == GONIO_OK && scan->next < before ? warm_up(scan, error) : status;
}

static gonio_status finish_step(gonio_scan *scan, const gonio_samples **samples, gonio_error *error) {
    const bool restores = scan->ready && scan->next < scan->process.first_sample;
    const gonio_status status = restores ? restore_samples(scan, error) : GONIO_OK;
    if (status != GONIO_OK) {
        return status;
    }
    scan->waited_s = 0;
    to_next(scan);
    *samples = scan->samples;
    return audit_if_due(scan, error);
}

gonio_status gonio_scan_step(gonio_scan *scan, const gonio_samples **samples, gonio_error *error) {
    gonio_samples_free(scan->samples);
    scan->samples = NULL;
    *samples = NULL;
    gonio_error own = {.line = -1, .byte = -1};
    gonio_exposures exposures = {.monitor = scan->monitor};
    scan->slipped = false;
    gonio_status status = do_step(scan, &exposures, &own);
    gonio_exposures_free(exposures.items, exposures.n);
    if (scan->slipped) {
        status = recover(scan, &own);
    } else if (status == GONIO_OK) {
        scan->slips = 0;
        status = finish_step(scan, samples, &own);
    }
    if (status != GONIO_OK) {
        char text[600];
        gonio_scan_halt(scan);
        snprintf(text, sizeof text, "step %zu: %s", scan->next, own.message);
        if (status != GONIO_E_INTERRUPTED) {
            gonio_session_event(scan->session, "fault", text, NULL);
        }
        if (error != NULL) {
            *error = own;
        }
    }
    return status;
}
