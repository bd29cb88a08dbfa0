// SPDX-License-Identifier: BSD-3-Clause
// Verify a session: the database, every frame's and every sample set's checksum, and what lies about. Nothing is
// changed.
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/text.h"
#include "host/session/internal.h"

void gonio_doctor_note(gonio_doctor_report *report, const char *format, ...) {
    const size_t used = strlen(report->detail), room = sizeof report->detail - used;
    char raw[1024], line[1024];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(raw, sizeof raw, format, arguments);
    va_end(arguments);
    gonio_text_printable(raw, line, sizeof line); // names of others' files may hold anything
    report->findings++;
    report->findings_cut += strlen(line) + 2 >= room;
    if (strlen(line) + 2 < room) {
        snprintf(report->detail + used, room, "%s\n", line);
    }
}

void gonio_session_findings_free(session_findings *findings) {
    free(findings->undo);
    free(findings->drop);
    *findings = (session_findings){0};
}

static gonio_status append(int64_t **list, size_t *n, int64_t step, gonio_error *error) {
    int64_t *larger = realloc(*list, (*n + 1) * sizeof *larger);
    if (larger == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu findings", *n);
    }
    *list = larger;
    larger[(*n)++] = step;
    return GONIO_OK;
}

bool gonio_session_is_damage(gonio_status status, const gonio_error *why) {
    return status == GONIO_E_INPUT && strstr(why->message, "damaged") != NULL;
}

bool gonio_doctor_sound(const gonio_doctor_report *r) {
    return r->database_ok && r->frames_bad == 0 && r->frames_unreadable == 0 && r->samples_bad == 0 &&
           r->steps_lost == 0 && r->steps_missing == 0 && r->rows_lost == 0 && r->results_ok;
}

// ---- the journal ----

static gonio_status check_integrity(gonio_session *session, gonio_doctor_report *report, gonio_error *error) {
    session_rows rows;
    gonio_error why = {0};
    report->database_ok = true;
    gonio_rows_open(&rows, session, "sqlite_master", 0, "PRAGMA integrity_check(10)", &why);
    while (gonio_rows_next(&rows)) {
        const char *text = gonio_row_text(&rows, 0, SESSION_SETTING_MAX);
        if (text != NULL && strcmp(text, "ok") != 0) {
            gonio_doctor_note(report, "session.db: %s", text);
            report->database_ok = false;
        }
    }
    const gonio_status status = gonio_rows_close(&rows);
    if (status == GONIO_OK || status == GONIO_E_INPUT) {
        report->database_ok = report->database_ok && status == GONIO_OK;
        if (status != GONIO_OK) {
            gonio_doctor_note(report, "%s", why.message);
        }
        return GONIO_OK;
    }
    return gonio_fail(error, status, "%s", why.message);
}

gonio_status gonio_session_check_journal(gonio_session *session, session_proof *proof, gonio_doctor_report *report,
                                         gonio_error *error) {
    *proof = (session_proof){0};
    gonio_status status = check_integrity(session, report, error);
    status = status == GONIO_OK ? gonio_session_verify(session, proof, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    if (proof->what[0] != 0) {
        gonio_doctor_note(report, "%s", proof->what);
    }
    if (!proof->chained) {
        gonio_doctor_note(report, "a session of version 1: its rows have no chain that proves them; resume begins one");
    }
    proof->database = proof->database && report->database_ok;
    report->database_ok = proof->database && (!proof->chained || proof->sound);
    return GONIO_OK;
}

// ---- frames ----

typedef struct examination {
    gonio_doctor_report *report;
    session_findings *findings;
} examination;

typedef struct frame_check {
    gonio_doctor_report *report;
    int bits, bad;
} frame_check;

static gonio_status check_frame(gonio_session *session, const session_frame *row, void *context, gonio_error *error) {
    frame_check *c = context;
    gonio_frame frame = row->exposure.frame;
    gonio_error why = {0};
    if (session->frames_fd < 0) {
        c->report->frames_unreadable++;
        return GONIO_OK; // told once for all of them
    }
    const gonio_status status = gonio_session_frame_read(session, row->file, row->sha256, c->bits, &frame, &why);
    free(frame.pixels);
    if (status != GONIO_OK && status != GONIO_E_INPUT && status != GONIO_E_IO) {
        return gonio_fail(error, status, "%s", why.message);
    }
    c->report->frames_unreadable += status == GONIO_E_IO;
    c->bad += status == GONIO_E_INPUT;
    if (status != GONIO_OK) {
        gonio_doctor_note(c->report, "step %lld: %s%s%s", (long long)frame.stamp.pose, why.file,
                          why.file[0] != 0 ? ": " : "", why.message);
    }
    return GONIO_OK;
}

// Every frame of a step on its own, so that one bad frame does not hide the next.
static gonio_status check_frames(gonio_session *session, const gonio_step *step, int bits, gonio_doctor_report *report,
                                 int *bad, gonio_error *error) {
    int found = 0;
    gonio_error why = {0};
    frame_check c = {report, bits, 0};
    const gonio_status status = gonio_session_for_frames(session, step->index, check_frame, &c, &found, &why);
    *bad = c.bad;
    if (status != GONIO_OK && status != GONIO_E_INPUT) {
        return gonio_fail(error, status, "%s", why.message);
    }
    if (status != GONIO_OK) {
        gonio_doctor_note(report, "step %lld: %s", (long long)step->index, why.message);
    }
    if (status != GONIO_OK || found != step->frames) {
        gonio_doctor_note(report, "step %lld: %d of %d frames are in the journal", (long long)step->index, found,
                          step->frames);
        *bad += found < step->frames ? step->frames - found : 1;
    }
    return GONIO_OK;
}

static bool samples_sound(gonio_session *session, const gonio_step *step, gonio_doctor_report *report) {
    gonio_samples *samples = NULL;
    gonio_error why = {0};
    const gonio_status status = gonio_session_step_samples(session, step->index, &samples, &why);
    const bool sound = status == GONIO_OK && samples != NULL;
    gonio_samples_free(samples);
    if (!sound) {
        gonio_doctor_note(report, "step %lld: %s", (long long)step->index,
                          status == GONIO_OK ? "its samples are missing; resume restores them from the frames"
                                             : why.message);
    }
    return sound;
}

static gonio_status check_step(gonio_session *session, const gonio_step *step, int bits, void *context,
                               gonio_error *error) {
    const examination *e = context;
    gonio_doctor_report *report = e->report;
    session_findings *found = e->findings;
    int bad = 0;
    gonio_status status = check_frames(session, step, bits, report, &bad, error);
    report->steps_done++;
    report->frames += step->frames;
    report->flagged += step->flagged;
    report->frames_bad += bad;
    if (status == GONIO_OK && bad > 0) {
        report->steps_lost++;
        found->calibration |= step->kind != GONIO_STEP_SAMPLE;
        found->frames_undone += step->frames;
        status = append(&found->undo, &found->n_undo, step->index, error);
    } else if (status == GONIO_OK && step->kind == GONIO_STEP_SAMPLE && !samples_sound(session, step, report)) {
        report->samples_bad++;
        status = append(&found->drop, &found->n_drop, step->index, error);
    }
    return status;
}

static gonio_status check_plan(gonio_session *session, gonio_doctor_report *report, gonio_error *error) {
    char which[400];
    const gonio_status status =
        gonio_session_missing_steps(session, &report->steps_missing, which, sizeof which, error);
    if (status == GONIO_OK && report->steps_missing != 0) {
        gonio_doctor_note(report, "the journal has lost %s of the plan", which);
    }
    return status;
}

// ---- results ----

static void check_final(gonio_session *session, gonio_doctor_report *report) {
    gonio_samples *samples = NULL;
    bool final = false;
    char hash[GONIO_SHA256_HEX];
    char *expected = NULL;
    gonio_error why = {0};
    const gonio_status status = gonio_session_final_samples(session, &samples, &final, &why);
    const bool unreadable = status != GONIO_OK && strstr(why.message, "no samples yet") == NULL;
    if (unreadable) {
        gonio_doctor_note(report, "%s", why.message);
    } else if (final && samples != NULL &&
               gonio_session_get(session, "result.samples_sha256", &expected, NULL) == GONIO_OK &&
               gonio_sha256_samples(samples, hash, &why) == GONIO_OK && !gonio_sha256_samples_is(samples, expected)) {
        gonio_doctor_note(report, "the final samples have SHA-256 %.12s..., %.12s... was journalled", hash, expected);
        report->results_ok = false;
    }
    gonio_samples_free(samples);
    free(expected);
    if (unreadable && report->samples_bad == 0) {
        report->results_ok = false;
    }
}

// The model is a file like any other: its owner may have moved it. Another content is worth a word.
static void check_model(gonio_session *session, gonio_doctor_report *report) {
    char *path = NULL, *expected = NULL, hash[GONIO_SHA256_HEX];
    if (gonio_session_model_path(session, &path, NULL) == GONIO_OK &&
        gonio_session_get(session, "result.model_sha256", &expected, NULL) == GONIO_OK) {
        if (access(path, F_OK) != 0) {
            gonio_doctor_note(report, "%s: the model is not there any more; resume fits it again", path);
        } else if (gonio_sha256_file(path, hash, NULL) != GONIO_OK || strcmp(hash, expected) != 0) {
            gonio_doctor_note(report, "%s: not the model that was journalled; resume fits it again", path);
            report->results_ok = false;
        }
    }
    free(path);
    free(expected);
}

// ---- all ----

static gonio_status count_stray(gonio_session *session, const session_stray *stray, void *context, gonio_error *error) {
    (void)session, (void)error;
    gonio_doctor_report *report = context;
    report->strays += stray->ours;
    report->foreign += !stray->ours;
    gonio_doctor_note(report, stray->ours ? "%s%s: no step owns it" : "%s%s: not Gonio's; it stays where it is",
                      stray->where, stray->name);
    return GONIO_OK;
}

gonio_status gonio_session_examine(gonio_session *session, session_findings *findings, gonio_doctor_report *report,
                                   gonio_error *error) {
    examination e = {report, findings};
    gonio_error why = {0};
    if (session->frames_fd < 0 && gonio_session_open_frames(session, &why) != GONIO_OK) {
        gonio_doctor_note(report, "%s", why.message);
    }
    gonio_status status = gonio_session_for_done(session, check_step, &e, &report->steps, error);
    status = status == GONIO_OK ? check_plan(session, report, error) : status;
    if (status == GONIO_OK) {
        report->results_ok = true;
        check_model(session, report);
        check_final(session, report);
        status = gonio_session_for_strays(session, count_stray, report, error);
    }
    return status;
}

static gonio_status look(gonio_session *session, gonio_doctor_report *report, gonio_error *error) {
    session_findings findings = {0};
    session_proof proof;
    gonio_error why = {0};
    gonio_status status = gonio_session_check_journal(session, &proof, report, &why);
    status = status == GONIO_OK ? gonio_session_examine(session, &findings, report, &why) : status;
    gonio_session_findings_free(&findings);
    // What cannot be read for damage that is known already is a finding like any other.
    if (gonio_session_is_damage(status, &why) || (status == GONIO_E_INPUT && !report->database_ok)) {
        report->database_ok = false;
        gonio_doctor_note(report, "%s", why.message);
        return GONIO_OK;
    }
    if (status != GONIO_OK && error != NULL) {
        *error = why;
    }
    return status;
}

gonio_status gonio_session_look(const char *path, gonio_doctor_report *report, gonio_error *error) {
    gonio_session *session;
    gonio_error why = {0};
    gonio_status status = gonio_session_open_private(path, &session, &why);
    if (gonio_session_is_damage(status, &why)) {
        gonio_doctor_note(report, "%s", why.message);
        return GONIO_OK; // the report says that the database cannot be read
    }
    if (status != GONIO_OK) {
        if (error != NULL) {
            *error = why;
        }
        return status;
    }
    status = look(session, report, error);
    gonio_session_close(session);
    return status;
}
