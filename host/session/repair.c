// SPDX-License-Identifier: BSD-3-Clause
// Repair: a second session is made of all that is intact, beside the damaged one; it is verified, and only then the two
// folders swap their names in one system call. Whatever stops this before leaves the session as it was; the damaged one
// stays beside the new one.
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "host/session/folder.h"
#include "host/session/internal.h"
#include "host/session/repair.h"

// ---- places ----

static gonio_status fail(const session_repair *r, gonio_status status, gonio_error *error, const char *what) {
    return gonio_fail_line(error, status, r->path, -1, "%s: %s", what, strerror(errno));
}

bool gonio_repair_leftover(const session_repair *r, const char *prefix, char found[FOLDER_NAME]) {
    DIR *list = gonio_folder_list(r->parent);
    const char *entry = NULL;
    while (list != NULL && (entry = gonio_folder_next(list)) != NULL && strncmp(entry, prefix, strlen(prefix)) != 0) {
    }
    snprintf(found, FOLDER_NAME, "%s", entry != NULL ? entry : "");
    if (list != NULL) {
        closedir(list);
    }
    return found[0] != 0;
}

static gonio_status open_parent(session_repair *r, const char *path, gonio_error *error) {
    char *real = realpath(path, NULL);
    if (real == NULL) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "cannot find the session: %s", strerror(errno));
    }
    r->path = real;
    char *slash = strrchr(real, '/');
    r->base = slash + 1;
    if (slash == real || strlen(r->base) > SESSION_NAME_BYTES) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1,
                               "a session whose name has room for a second one beside it is expected");
    }
    *slash = 0;
    r->parent = open(real, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    *slash = '/';
    return r->parent >= 0 ? GONIO_OK : fail(r, GONIO_E_IO, error, "cannot open the folder that it stands in");
}

static gonio_status open_places(session_repair *r, const char *path, gonio_error *error) {
    gonio_status status = open_parent(r, path, error);
    if (status != GONIO_OK) {
        return status;
    }
    r->folder = gonio_folder_open(r->parent, r->base);
    if (r->folder < 0 || fstat(r->folder, &r->facts) != 0) {
        return fail(r, errno == ENOENT || errno == ENOTDIR ? GONIO_E_INPUT : GONIO_E_IO, error,
                    "cannot open the session");
    }
    return gonio_session_lock(r->folder, r->path, error);
}

static gonio_status make_beside(session_repair *r, gonio_error *error) {
    char prefix[FOLDER_NAME], left[FOLDER_NAME];
    snprintf(prefix, sizeof prefix, "%.200s.repair", r->base); // and SESSION_REPAIRED
    if (gonio_repair_leftover(r, prefix, left)) {
        gonio_doctor_note(r->report,
                          "%s beside it is of a repair that was stopped; it holds only second names and "
                          "copies, and may be removed",
                          left);
    }
    r->beside = gonio_repair_make_folder(r, r->name, &r->beside_path);
    if (r->beside < 0) {
        return fail(r, GONIO_E_IO, error, "cannot make a folder beside it");
    }
    return r->beside_path != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a path");
}

static void leave(session_repair *r) {
    gonio_session_close(r->session);
    gonio_session_findings_free(&r->findings);
    if (r->beside >= 0) {
        close(r->beside);
    }
    if (r->name[0] != 0) {
        gonio_folder_discard(r->parent, r->name);
    }
    if (r->folder >= 0) {
        close(r->folder);
    }
    if (r->parent >= 0) {
        close(r->parent);
    }
    free(r->beside_path);
    free(r->path);
}

// ---- may it be repaired? ----

static gonio_status refuse(const session_repair *r, gonio_error *error, const char *why) {
    return gonio_fail_line(error, GONIO_E_INPUT, r->path, -1, "%s; nothing was changed", why);
}

// Too much is bad for damage: then frames that are intact would be laid aside for a wrong setting or a disk that is not
// there.
static gonio_status verdict(const session_repair *r, gonio_error *error) {
    const gonio_doctor_report *report = r->report;
    struct stat frames;
    gonio_error why = {0};
    char text[400];
    if (r->session->frames_fd < 0) {
        const gonio_status status = gonio_session_open_frames(r->session, &why);
        return status == GONIO_E_IO
                   ? gonio_fail_line(error, status, r->path, -1, "%s; nothing was changed", why.message)
                   : refuse(r, error, why.message);
    }
    if (fstat(r->session->frames_fd, &frames) != 0 || frames.st_dev != r->facts.st_dev) {
        return refuse(r, error, "its frames/ is another device's: a repair needs them on one");
    }
    if (report->frames_unreadable > 0) {
        return gonio_fail_line(error, GONIO_E_IO, r->path, -1,
                               "%lld frames are unreadable, which is not to say damaged: mend the disk or the "
                               "permissions first; nothing was changed",
                               (long long)report->frames_unreadable);
    }
    if (report->frames >= 4 && 2 * report->frames_bad > report->frames) {
        snprintf(
            text, sizeof text,
            "%lld of %lld frames are missing or not those that were stored, which is a setting of the journal or a "
            "disk (is it mounted?) rather than damage",
            (long long)report->frames_bad, (long long)report->frames);
        return refuse(r, error, text);
    }
    return GONIO_OK;
}

// ---- the steps of a repair ----

static gonio_status mend_journal(session_repair *r, gonio_session *session, gonio_error *error) {
    gonio_status status = GONIO_OK;
    const session_findings *f = &r->findings;
    for (size_t i = 0; status == GONIO_OK && i < f->n_undo; i++) {
        status = gonio_session_undo_step(session, f->undo[i], "bad frames", error);
    }
    if (status == GONIO_OK && f->calibration) { // all samples stand on it, and are computed anew
        status = gonio_session_exec(session, "DELETE FROM samples", error);
    }
    for (size_t i = 0; status == GONIO_OK && i < f->n_drop; i++) {
        status = gonio_session_put_step_samples(session, f->drop[i], NULL, error);
    }
    if (status == GONIO_OK && (f->n_undo > 0 || f->calibration || f->n_drop > 0 || r->report->rows_lost > 0 ||
                               r->report->steps_missing > 0 || !r->report->results_ok)) {
        status = gonio_session_exec(session,
                                    "DELETE FROM final_samples; DELETE FROM settings WHERE key LIKE 'result.%'", error);
    }
    return status == GONIO_OK ? gonio_session_event(session, "repaired", "by gonio doctor --repair", error) : status;
}

static gonio_status mend(session_repair *r, gonio_error *error) {
    gonio_session *session;
    int moved = 0;
    gonio_status status = gonio_session_open(r->beside_path, true, &session, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = gonio_session_begin(session, error);
    if (status == GONIO_OK) {
        status = gonio_session_end(session, mend_journal(r, session, error), error);
    }
    status = status == GONIO_OK ? gonio_session_sweep(session, &moved, error) : status;
    r->report->files_aside = moved;
    gonio_session_close(session);
    return status;
}

// As any doctor would: what is not exactly as planned is not given the session's name.
static gonio_status verify(const session_repair *r, gonio_error *error) {
    gonio_doctor_report after = {0};
    const gonio_status status = gonio_session_look(r->beside_path, &after, error);
    if (status != GONIO_OK) {
        return status;
    }
    const gonio_doctor_report *before = r->report;
    if (!after.database_ok || after.frames_bad > 0 || after.frames_unreadable > 0 || after.steps != before->steps ||
        after.steps_done != before->steps_done - before->steps_lost ||
        after.frames != before->frames - r->findings.frames_undone) {
        return gonio_fail_line(
            error, GONIO_E_FAILED, r->path, -1,
            "the repaired session is not sound (%lld frames, %lld bad), so it was not taken; nothing "
            "was changed. %.200s",
            (long long)after.frames, (long long)after.frames_bad, after.detail);
    }
    return GONIO_OK;
}

static gonio_status build(session_repair *r, gonio_error *error) {
    gonio_session_close(r->session);
    r->session = NULL;
    gonio_status status = gonio_repair_link_all(r, error);
    status = status == GONIO_OK ? mend(r, error) : status;
    status = status == GONIO_OK ? verify(r, error) : status;
    if (status == GONIO_OK && (gonio_folder_like(r->beside, &r->facts) != 0 || gonio_folder_sync(r->beside) != 0)) {
        status = fail(r, GONIO_E_IO, error, "cannot sync the repaired session");
    }
    return status == GONIO_OK ? gonio_repair_exchange(r, error) : status;
}

static gonio_status sweep_only(session_repair *r, gonio_error *error) {
    gonio_session_close(r->session);
    r->session = NULL;
    close(r->folder); // and its lock, which the session takes again
    r->folder = -1;
    gonio_session *session;
    int moved = 0;
    gonio_status status = gonio_session_open(r->path, true, &session, error);
    if (status == GONIO_OK) {
        status = gonio_session_sweep(session, &moved, error);
        gonio_session_close(session);
    }
    r->report->files_aside = moved;
    r->report->repaired = status == GONIO_OK;
    return status;
}

static gonio_status run(session_repair *r, const char *path, gonio_error *error) {
    gonio_status status = open_places(r, path, error);
    status = status == GONIO_OK ? make_beside(r, error) : status;
    status = status == GONIO_OK ? gonio_repair_journal(r, error) : status;
    status = status == GONIO_OK ? gonio_session_examine(r->session, &r->findings, r->report, error) : status;
    status = status == GONIO_OK ? verdict(r, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    if (r->journal_kept && gonio_doctor_sound(r->report)) {
        return r->report->strays > 0 ? sweep_only(r, error) : GONIO_OK;
    }
    return build(r, error);
}

gonio_status gonio_session_repair(const char *path, gonio_doctor_report *report, gonio_error *error) {
    session_repair r = {.report = report, .parent = -1, .folder = -1, .beside = -1};
    const gonio_status status = run(&r, path, error);
    leave(&r);
    return status;
}
