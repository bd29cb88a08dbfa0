// SPDX-License-Identifier: BSD-3-Clause
// Verify a session: the database, every frame's and every sample set's checksum, and what lies about; repair it.
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "host/session/internal.h"

static void note(gonio_doctor_report *report, const char *format, ...) __attribute__((format(printf, 2, 3)));
static void note(gonio_doctor_report *report, const char *format, ...) {
    const size_t used = strlen(report->detail), room = sizeof report->detail - used;
    char line[1024];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    if (strlen(line) + 2 < room) {
        snprintf(report->detail + used, room, "%s\n", line);
    }
}

// ---- stray files ----

static bool owned(sqlite3_stmt *query, const char *name) {
    sqlite3_reset(query);
    sqlite3_bind_text(query, 1, name, -1, SQLITE_TRANSIENT);
    return sqlite3_step(query) == SQLITE_ROW;
}

typedef gonio_status (*stray_fn)(gonio_session *session, const char *name, void *context, gonio_error *error);

static gonio_status for_strays(gonio_session *session, stray_fn call, void *context, gonio_error *error) {
    const int fd = openat(session->frames_fd, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    DIR *folder = fd >= 0 ? fdopendir(fd) : NULL;
    if (folder == NULL) {
        return gonio_fail_line(error, GONIO_E_IO, session->path, -1, "cannot list frames/: %s", strerror(errno));
    }
    // The step that owns a file is in its name, and the primary key finds it without an index on names.
    sqlite3_stmt *query;
    gonio_status status = gonio_session_prepare(
        session, "SELECT 1 FROM frames WHERE step = CAST(?1 AS INTEGER) AND file = ?1", &query, error);
    const struct dirent *entry;
    while (status == GONIO_OK && (entry = readdir(folder)) != NULL) {
        if (strcmp(entry->d_name, ".") != 0 && strcmp(entry->d_name, "..") != 0 && !owned(query, entry->d_name)) {
            status = call(session, entry->d_name, context, error);
        }
    }
    sqlite3_finalize(query);
    closedir(folder);
    return status;
}

static gonio_status remove_stray(gonio_session *session, const char *name, void *context, gonio_error *error) {
    char text[300];
    snprintf(text, sizeof text, "frames/%s of an unfinished step was dropped", name);
    if (unlinkat(session->frames_fd, name, 0) != 0) {
        return gonio_fail_line(error, GONIO_E_IO, session->path, -1, "cannot remove frames/%s: %s", name,
                               strerror(errno));
    }
    ++*(int *)context;
    return gonio_session_event(session, "dropped", text, error);
}

gonio_status gonio_session_sweep(gonio_session *session, int *removed, gonio_error *error) {
    int count = 0;
    bool own;
    gonio_status status = gonio_session_begin_own(session, &own, error);
    if (status == GONIO_OK) {
        status = gonio_session_end_own(session, own, for_strays(session, remove_stray, &count, error), error);
    }
    if (removed != NULL) {
        *removed = count;
    }
    return status;
}

static gonio_status count_stray(gonio_session *session, const char *name, void *context, gonio_error *error) {
    (void)session, (void)error;
    gonio_doctor_report *report = context;
    report->strays++;
    note(report, "frames/%s belongs to no finished step; resume drops it", name);
    return GONIO_OK;
}

// ---- checks ----

static bool proven(gonio_session *session, gonio_doctor_report *report) {
    session_proof proof;
    gonio_error why = {0};
    const gonio_status status = gonio_session_verify(session, &proof, &why);
    if (status != GONIO_OK || proof.what[0] != 0) {
        note(report, "%s", status != GONIO_OK ? why.message : proof.what);
    }
    if (status == GONIO_OK && !proof.chained) {
        note(report, "a session of version 1: its rows have no chain that proves them; resume begins one");
    }
    return status == GONIO_OK && proof.sound;
}

static bool integrity(gonio_session *session, gonio_doctor_report *report) {
    session_rows rows;
    gonio_error why = {0};
    bool sound = true;
    gonio_rows_open(&rows, session, "sqlite_master", 0, "PRAGMA integrity_check(8)", &why);
    while (gonio_rows_next(&rows)) {
        const char *text = gonio_row_text(&rows, 0, SESSION_SETTING_MAX);
        if (text != NULL && strcmp(text, "ok") != 0) {
            note(report, "session.db: %s", text);
            sound = false;
        }
    }
    if (gonio_rows_close(&rows) != GONIO_OK) {
        note(report, "%s", why.message);
        sound = false;
    }
    return sound;
}

typedef struct frame_check {
    gonio_doctor_report *report;
    int bits, *bad;
} frame_check;

// Every frame of a step on its own, so that one bad frame does not hide the next.
static gonio_status check_frame(gonio_session *session, const session_frame *row, void *context, gonio_error *error) {
    const frame_check *c = context;
    gonio_frame frame = row->exposure.frame;
    gonio_error why = {0};
    (void)error;
    if (gonio_session_frame_read(session, row->file, row->sha256, c->bits, &frame, &why) != GONIO_OK) {
        ++*c->bad;
        note(c->report, "step %lld: %s%s%s", (long long)frame.stamp.pose, why.file, why.file[0] != 0 ? ": " : "",
             why.message);
    }
    free(frame.pixels);
    return GONIO_OK;
}

static gonio_status check_frames(gonio_session *session, const gonio_step *step, int bits, gonio_doctor_report *report,
                                 int *bad) {
    int found = 0;
    gonio_error why = {0};
    const gonio_status status =
        gonio_session_for_frames(session, step->index, check_frame, &(frame_check){report, bits, bad}, &found, &why);
    if (status != GONIO_OK) {
        note(report, "step %lld: %s", (long long)step->index, why.message);
    }
    if (status != GONIO_OK || found != step->frames) {
        note(report, "step %lld: %d of %d frames are in the journal", (long long)step->index, found, step->frames);
        *bad += found < step->frames ? step->frames - found : 1;
    }
    return status == GONIO_E_MEMORY ? status : GONIO_OK;
}

static bool samples_sound(gonio_session *session, const gonio_step *step, gonio_doctor_report *report) {
    gonio_samples *samples = NULL;
    gonio_error why = {0};
    const gonio_status status = gonio_session_step_samples(session, step->index, &samples, &why);
    const bool sound = status == GONIO_OK && samples != NULL;
    gonio_samples_free(samples);
    if (!sound) {
        note(report, "step %lld: %s", (long long)step->index,
             status == GONIO_OK ? "its samples are missing; resume restores them from the frames" : why.message);
    }
    return sound;
}

static gonio_status drop_samples(gonio_session *session, int64_t step, gonio_error *error) {
    char sql[256], number[24] = "";
    if (step >= 0) {
        snprintf(number, sizeof number, "%lld", (long long)step);
    }
    snprintf(sql, sizeof sql,
             "DELETE FROM final_samples; DELETE FROM settings WHERE key LIKE 'result.%%';"
             "DELETE FROM samples%s%s",
             step >= 0 ? " WHERE step = " : "", number);
    return gonio_session_exec(session, sql, error);
}

typedef struct check {
    bool repair;
    gonio_doctor_report *report;
} check;

static gonio_status check_step(gonio_session *session, const gonio_step *step, int bits, void *context,
                               gonio_error *error) {
    const check *c = context;
    gonio_doctor_report *report = c->report;
    int bad = 0;
    gonio_status status = check_frames(session, step, bits, report, &bad);
    report->steps_done++;
    report->frames += step->frames;
    report->flagged += step->flagged;
    report->frames_bad += bad;
    if (status == GONIO_OK && bad > 0) {
        report->steps_lost++;
        if (c->repair) {
            status = gonio_session_undo_step(session, step->index, "bad frames", error);
            // All samples stand on the calibration: they are computed anew once it has been measured again.
            if (status == GONIO_OK && step->kind != GONIO_STEP_SAMPLE) {
                status = drop_samples(session, -1, error);
            }
        }
    } else if (status == GONIO_OK && step->kind == GONIO_STEP_SAMPLE && !samples_sound(session, step, report)) {
        report->samples_bad++;
        status = c->repair ? drop_samples(session, step->index, error) : GONIO_OK;
    }
    return status;
}

static gonio_status check_final(gonio_session *session, bool repair, gonio_doctor_report *report, gonio_error *error) {
    gonio_samples *samples = NULL;
    bool final = false;
    char hash[GONIO_SHA256_HEX];
    char *expected = NULL;
    gonio_error why = {0};
    gonio_status status = gonio_session_final_samples(session, &samples, &final, &why);
    const bool unreadable = status != GONIO_OK && strstr(why.message, "no samples yet") == NULL;
    if (unreadable) {
        note(report, "%s", why.message);
    } else if (final && samples != NULL &&
               gonio_session_get(session, "result.samples_sha256", &expected, NULL) == GONIO_OK &&
               gonio_sha256_samples(samples, hash, &why) == GONIO_OK && strcmp(hash, expected) != 0) {
        note(report, "the final samples have SHA-256 %.12s..., %.12s... was journalled", hash, expected);
        report->results_ok = false;
    }
    gonio_samples_free(samples);
    free(expected);
    if (unreadable && report->samples_bad == 0) {
        report->results_ok = false;
    }
    return repair && !report->results_ok
               ? gonio_session_exec(session,
                                    "DELETE FROM final_samples; DELETE FROM settings WHERE key LIKE 'result.%'", error)
               : GONIO_OK;
}

// The model is a file like any other: its owner may have moved it. Another content is worth a word.
static void check_model(gonio_session *session, gonio_doctor_report *report) {
    char *path = NULL, *expected = NULL, hash[GONIO_SHA256_HEX];
    if (gonio_session_model_path(session, &path, NULL) == GONIO_OK &&
        gonio_session_get(session, "result.model_sha256", &expected, NULL) == GONIO_OK) {
        if (access(path, F_OK) != 0) {
            note(report, "%s: the model is not there any more; resume fits it again", path);
        } else if (gonio_sha256_file(path, hash, NULL) != GONIO_OK || strcmp(hash, expected) != 0) {
            note(report, "%s: not the model that was journalled; resume fits it again", path);
            report->results_ok = false;
        }
    }
    free(path);
    free(expected);
}

static gonio_status examine(gonio_session *session, bool repair, gonio_doctor_report *report, gonio_error *error) {
    check c = {repair, report};
    gonio_status status = gonio_session_for_done(session, check_step, &c, &report->steps, error);
    if (status == GONIO_OK) {
        report->results_ok = true;
        check_model(session, report);
        status = check_final(session, repair, report, error);
    }
    status = status == GONIO_OK ? for_strays(session, count_stray, report, error) : status;
    return status == GONIO_OK && repair ? gonio_session_sweep(session, NULL, error) : status;
}

// A newer version, a locked or a missing session are answers about the session as a whole, not damage.
static bool is_damage(gonio_status status, const gonio_error *why) {
    return status == GONIO_E_INPUT && strstr(why->message, "damaged") != NULL;
}

gonio_status gonio_session_doctor(const char *path, bool repair, gonio_doctor_report *report, gonio_error *error) {
    *report = (gonio_doctor_report){0};
    gonio_session *session;
    gonio_error why = {0};
    gonio_status status = gonio_session_open_unproven(path, repair, &session, &why);
    if (status != GONIO_OK && !is_damage(status, &why)) {
        if (error != NULL) {
            *error = why;
        }
        return status;
    }
    report->database_ok = status == GONIO_OK && integrity(session, report) && proven(session, report);
    if (!report->database_ok && status != GONIO_OK) {
        note(report, "%s", why.message);
    }
    if (!report->database_ok && repair) {
        gonio_session_close(session);
        status = gonio_session_salvage(path, error);
        status = status == GONIO_OK ? gonio_session_open_unproven(path, repair, &session, error) : status;
        if (status != GONIO_OK) {
            return status;
        }
    }
    if (session == NULL) {
        return GONIO_OK; // the report says that the database cannot be read
    }
    status = examine(session, repair, report, &why);
    gonio_session_close(session);
    if (status != GONIO_OK && is_damage(status, &why)) {
        report->database_ok = false;
        note(report, "%s", why.message);
        return GONIO_OK;
    }
    if (status != GONIO_OK && error != NULL) {
        *error = why;
    }
    return status;
}
