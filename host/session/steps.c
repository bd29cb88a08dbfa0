// SPDX-License-Identifier: BSD-3-Clause
// The steps of a session: entered once, finished one by one, undone by the doctor.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/session/internal.h"

static const char *const kind_names[] = {"dark", "reference", "sample", "trap", "burst", "check"};
#define KINDS ((int)(sizeof kind_names / sizeof *kind_names))

static gonio_status put_all(gonio_session *session, const gonio_step *steps, size_t n, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (size_t i = 0; status == GONIO_OK && i < n; i++) {
        const gonio_pair *pose = &steps[i].pose;
        status = gonio_session_do(
            session, error,
            "INSERT INTO steps(step, kind, theta_i_deg, phi_i_deg, theta_o_deg, phi_o_deg) VALUES(?,?,?,?,?,?)",
            "ltrrrr", steps[i].index, kind_names[steps[i].kind], gonio_degrees(pose->theta_i),
            gonio_degrees(pose->phi_i), gonio_degrees(pose->theta_o), gonio_degrees(pose->phi_o));
    }
    return status;
}

gonio_status gonio_session_put_steps(gonio_session *session, const gonio_step *steps, size_t n, gonio_error *error) {
    bool own;
    gonio_status status = gonio_session_begin_own(session, &own, error);
    if (status == GONIO_OK) {
        status = gonio_session_end_own(session, own, put_all(session, steps, n, error), error);
    }
    return status;
}

static bool read_step(sqlite3_stmt *row, gonio_step *step) {
    const char *kind = (const char *)sqlite3_column_text(row, 1);
    int k = 0;
    while (k < KINDS && (kind == NULL || strcmp(kind, kind_names[k]) != 0)) {
        k++;
    }
    if (k == KINDS) {
        return false;
    }
    *step = (gonio_step){
        .index = sqlite3_column_int64(row, 0),
        .kind = (gonio_step_kind)k,
        .pose = {gonio_radians(sqlite3_column_double(row, 2)), gonio_radians(sqlite3_column_double(row, 3)),
                 gonio_radians(sqlite3_column_double(row, 4)), gonio_radians(sqlite3_column_double(row, 5))},
        .done = sqlite3_column_int(row, 6) != 0,
        .frames = sqlite3_column_int(row, 7),
        .clock_end_s = sqlite3_column_double(row, 8),
        .exposure_end_s = sqlite3_column_double(row, 9),
        .flagged = sqlite3_column_int(row, 10) != 0,
    };
    return true;
}

static gonio_status read_rows(gonio_session *session, sqlite3_stmt *rows, gonio_step *steps, size_t n, size_t *got,
                              gonio_error *error) {
    int code;
    for (*got = 0; (code = sqlite3_step(rows)) == SQLITE_ROW && *got < n; ++*got) {
        if (!read_step(rows, &steps[*got])) {
            return gonio_fail_line(error, GONIO_E_INPUT, session->db_path, -1,
                                   "step %lld has an unknown kind; dark, trap, reference, check or sample is expected",
                                   (long long)sqlite3_column_int64(rows, 0));
        }
    }
    return code == SQLITE_DONE || code == SQLITE_ROW ? GONIO_OK
                                                     : gonio_session_db_fail(session, error, "read the steps");
}

gonio_status gonio_session_steps(gonio_session *session, gonio_step **steps, size_t *n, gonio_error *error) {
    *steps = NULL;
    *n = 0;
    int64_t count, flags = 0;
    gonio_status status = gonio_session_integer(session, "SELECT count(*) FROM steps", &count, error);
    sqlite3_stmt *rows = NULL;
    if (status == GONIO_OK) { // a session of the first releases, opened to read, has no flags
        status =
            gonio_session_integer(session, "SELECT count(*) FROM sqlite_master WHERE name = 'flagged'", &flags, error);
    }
    if (status == GONIO_OK) {
        char sql[256];
        snprintf(sql, sizeof sql,
                 "SELECT step, kind, theta_i_deg, phi_i_deg, theta_o_deg, phi_o_deg, done, frames, clock_end_s,"
                 " exposure_end_s, %s FROM steps ORDER BY step",
                 flags > 0 ? "step IN (SELECT step FROM flagged)" : "0");
        status = gonio_session_prepare(session, sql, &rows, error);
    }
    if (status != GONIO_OK) {
        return status;
    }
    gonio_step *list = calloc((size_t)count + 1, sizeof *list);
    status = list == NULL ? gonio_fail(error, GONIO_E_MEMORY, "no memory for %lld steps", (long long)count)
                          : read_rows(session, rows, list, (size_t)count, n, error);
    sqlite3_finalize(rows);
    if (status != GONIO_OK) {
        free(list);
        *n = 0;
        return status;
    }
    *steps = list;
    return GONIO_OK;
}

gonio_status gonio_session_for_done(gonio_session *session, session_step_fn call, void *context, int64_t *steps,
                                    gonio_error *error) {
    gonio_step *list = NULL;
    size_t n = 0;
    int bits;
    gonio_status status = gonio_session_frame_bits(session, &bits, error);
    status = status == GONIO_OK ? gonio_session_steps(session, &list, &n, error) : status;
    if (status == GONIO_OK && steps != NULL) {
        *steps = (int64_t)n;
    }
    for (size_t i = 0; status == GONIO_OK && i < n; i++) {
        if (list[i].done) {
            status = call(session, &list[i], bits, context, error);
        }
    }
    free(list);
    return status;
}

static gonio_status delete_step_rows(gonio_session *session, int64_t step, gonio_error *error) {
    static const char *const deletions[] = {
        "DELETE FROM frames WHERE step = ?", "DELETE FROM final_samples WHERE step = ?",
        "DELETE FROM samples WHERE step = ?", "DELETE FROM flagged WHERE step = ?",
        "UPDATE steps SET done = 0, frames = 0, clock_end_s = NULL, exposure_end_s = NULL, utc = NULL WHERE step = ?"};
    gonio_status status = GONIO_OK;
    for (size_t i = 0; status == GONIO_OK && i < sizeof deletions / sizeof *deletions; i++) {
        status = gonio_session_do(session, error, deletions[i], "l", step);
    }
    return status == GONIO_OK
               ? gonio_session_exec(session,
                                    "DELETE FROM settings WHERE key LIKE 'result.%'; DELETE FROM final_samples", error)
               : status;
}

gonio_status gonio_session_undo_step(gonio_session *session, int64_t step, const char *why, gonio_error *error) {
    bool own;
    gonio_status status = gonio_session_begin_own(session, &own, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = delete_step_rows(session, step, error);
    if (status == GONIO_OK && why != NULL) {
        char text[512];
        snprintf(text, sizeof text, "step %lld is to be measured again: %s", (long long)step, why);
        status = gonio_session_event(session, "undone", text, error);
    }
    return gonio_session_end_own(session, own, status, error);
}

static gonio_status drop_undone(gonio_session *session, int *rows, gonio_error *error) {
    static const char *const tables[] = {"frames", "final_samples", "samples", "flagged"};
    gonio_status status = GONIO_OK;
    for (size_t i = 0; status == GONIO_OK && i < sizeof tables / sizeof *tables; i++) {
        char sql[128];
        snprintf(sql, sizeof sql, "DELETE FROM %s WHERE step IN (SELECT step FROM steps WHERE done = 0)", tables[i]);
        status = gonio_session_do(session, error, sql, "");
        *rows += status == GONIO_OK ? sqlite3_changes(session->db) : 0;
    }
    return status;
}

gonio_status gonio_session_drop_undone(gonio_session *session, gonio_error *error) {
    bool own;
    int rows = 0;
    gonio_status status = gonio_session_begin_own(session, &own, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = drop_undone(session, &rows, error);
    if (status == GONIO_OK && rows > 0) {
        char text[128];
        snprintf(text, sizeof text, "%d rows of steps that are not done; session.log keeps them", rows);
        status = gonio_session_event(session, "dropped", text, error);
    }
    return gonio_session_end_own(session, own, status, error);
}

gonio_status gonio_session_unflag(gonio_session *session, gonio_error *error) {
    return gonio_session_exec(session, "DELETE FROM flagged", error);
}
