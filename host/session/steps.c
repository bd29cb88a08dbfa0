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
    char count[24]; // a row that is lost later is missed
    snprintf(count, sizeof count, "%lld", n > 0 ? (long long)steps[n - 1].index + 1 : 0);
    return status == GONIO_OK ? gonio_session_put(session, "steps", count, error) : status;
}

gonio_status gonio_session_put_steps(gonio_session *session, const gonio_step *steps, size_t n, gonio_error *error) {
    bool own;
    gonio_status status = gonio_session_begin_own(session, &own, error);
    if (status == GONIO_OK) {
        status = gonio_session_end_own(session, own, put_all(session, steps, n, error), error);
    }
    return status;
}

static gonio_step_kind read_kind(session_rows *rows, int column) {
    const char *name = gonio_row_text(rows, column, 16);
    int k = 0;
    while (name != NULL && k < KINDS && strcmp(name, kind_names[k]) != 0) {
        k++;
    }
    if (k == KINDS) {
        gonio_row_fail(rows, column, "dark, reference, sample, trap, burst or check");
    }
    return name != NULL && k < KINDS ? (gonio_step_kind)k : GONIO_STEP_DARK;
}

// Angles are canonical (-180 to 180) where a plan gave them; rounding and other tools have room beside.
static double read_angle(session_rows *rows, int column) {
    return gonio_radians(gonio_row_real(rows, column, -720, 720));
}

static gonio_status read_step(session_rows *rows, gonio_step *step) {
    *step = (gonio_step){
        .index = gonio_row_integer(rows, 0, 0, SESSION_STEP_MAX),
        .kind = read_kind(rows, 1),
        .pose = {read_angle(rows, 2), read_angle(rows, 3), read_angle(rows, 4), read_angle(rows, 5)},
        .done = gonio_row_integer(rows, 6, 0, 1) != 0,
        .frames = (int)gonio_row_integer(rows, 7, 0, SESSION_FRAMES_MAX),
        .clock_end_s = gonio_row_real_or(rows, 8, -SESSION_CLOCK_MAX, SESSION_CLOCK_MAX, 0),
        .exposure_end_s = gonio_row_real_or(rows, 9, 0, SESSION_EXPOSURE_MAX, 0),
        .flagged = gonio_row_integer(rows, 10, 0, 1) != 0,
    };
    return rows->status;
}

// The rows, as many as there are: their number is not asked first, for a damaged table may give any.
static gonio_status read_rows(session_rows *rows, gonio_step **steps, size_t *n) {
    size_t capacity = 0;
    while (gonio_rows_next(rows)) {
        if (*n == capacity) {
            capacity += capacity / 2 + 256;
            gonio_step *larger = realloc(*steps, capacity * sizeof *larger);
            if (larger == NULL) {
                return rows->status = gonio_fail(rows->error, GONIO_E_MEMORY, "no memory for %zu steps", capacity);
            }
            *steps = larger;
        }
        *n += read_step(rows, &(*steps)[*n]) == GONIO_OK;
    }
    return rows->status;
}

gonio_status gonio_session_steps(gonio_session *session, gonio_step **steps, size_t *n, gonio_error *error) {
    *steps = NULL;
    *n = 0;
    int64_t flags = 0;
    // A session of the first releases, opened to read, has no flags.
    gonio_status status =
        gonio_session_integer(session, "SELECT count(*) FROM sqlite_master WHERE name = 'flagged'", &flags, error);
    if (status != GONIO_OK) {
        return status;
    }
    char sql[256];
    snprintf(sql, sizeof sql,
             "SELECT step, kind, theta_i_deg, phi_i_deg, theta_o_deg, phi_o_deg, done, frames, clock_end_s,"
             " exposure_end_s, %s AS flagged FROM steps ORDER BY step",
             flags > 0 ? "step IN (SELECT step FROM flagged)" : "0");
    session_rows rows;
    gonio_rows_open(&rows, session, "steps", 1, sql, error);
    read_rows(&rows, steps, n);
    status = gonio_rows_close(&rows);
    if (status == GONIO_OK && *steps == NULL) { // none
        *steps = calloc(1, sizeof **steps);
        status = *steps != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for steps");
    }
    if (status != GONIO_OK) {
        free(*steps);
        *steps = NULL;
        *n = 0;
    }
    return status;
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
        "DELETE FROM frames WHERE step = ?",
        "DELETE FROM final_samples WHERE step = ?",
        "DELETE FROM samples WHERE step = ?",
        "DELETE FROM radiance WHERE step = ?",
        "DELETE FROM flagged WHERE step = ?",
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
