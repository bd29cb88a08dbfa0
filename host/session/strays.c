// SPDX-License-Identifier: BSD-3-Clause
// Files that no step owns: what a stopped step or a stopped program left. They go to lost+found/; what has no name that
// Gonio gives is its owner's and stays.
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "host/session/folder.h"
#include "host/session/internal.h"

// ---- names ----

static const char *digits(const char *at, size_t least) {
    const size_t n = strspn(at, "0123456789");
    return n >= least ? at + n : "?";
}

// 000123-04.png; while it is written .000123-04.png.1f0a33c8.new, of earlier releases .000123-04.png.new.
static bool is_frame(const char *name) {
    const bool temporary = name[0] == '.';
    const char *at = digits(name + temporary, 6);
    at = *at == '-' ? digits(at + 1, 2) : "?";
    if (strncmp(at, ".png", 4) != 0) {
        return false;
    }
    at += 4;
    if (temporary && at[0] == '.' && strspn(at + 1, "0123456789abcdef") == 8) {
        at += 9;
    }
    return strcmp(at, temporary ? ".new" : "") == 0;
}

// A file beside the journal under the name it has until it is whole.
static bool is_temporary(const char *name) {
    static const char *const finals[] = {"model.gonio.", "response.csv.",  "reference.model.",
                                         "flat.map.",    "library.prior.", "scene.needs."};
    if (strncmp(name, SESSION_NEW_JOURNAL, strlen(SESSION_NEW_JOURNAL)) == 0) {
        return true;
    }
    for (size_t i = 0; i < sizeof finals / sizeof *finals; i++) {
        const size_t n = strlen(finals[i]);
        if (strncmp(name, finals[i], n) == 0 && strlen(name + n) == 6 && strspn(name + n, "0123456789abcdef") == 6) {
            return true;
        }
    }
    return false;
}

// ---- looking for them ----

static gonio_status fail(const gonio_session *session, gonio_error *error, const char *what) {
    return gonio_fail_line(error, GONIO_E_IO, session->path, -1, "cannot list %s: %s", what, strerror(errno));
}

static gonio_status is_owned(gonio_session *session, sqlite3_stmt *query, const char *name, bool *owned,
                             gonio_error *error) {
    sqlite3_reset(query);
    sqlite3_bind_text(query, 1, name, -1, SQLITE_TRANSIENT);
    const int code = sqlite3_step(query);
    *owned = code == SQLITE_ROW;
    return code == SQLITE_ROW || code == SQLITE_DONE ? GONIO_OK
                                                     : gonio_session_db_fail(session, error, "look for a frame");
}

static gonio_status walk_frames(gonio_session *session, session_stray_fn call, void *context, DIR *list,
                                gonio_error *error) {
    // The step that owns a file is in its name, and the primary key finds it without an index on names.
    sqlite3_stmt *query = NULL;
    gonio_status status = GONIO_OK;
    if (session->db != NULL) { // without a journal nothing is owned
        status = gonio_session_prepare(session, "SELECT 1 FROM frames WHERE step = CAST(?1 AS INTEGER) AND file = ?1",
                                       &query, error);
    }
    const char *name = NULL;
    while (status == GONIO_OK && (name = gonio_folder_next(list)) != NULL) {
        bool owned = false;
        const bool ours = is_frame(name);
        status = ours && query != NULL ? is_owned(session, query, name, &owned, error) : GONIO_OK;
        if (status == GONIO_OK && !owned) {
            status = call(session, &(session_stray){session->frames_fd, "frames/", name, ours}, context, error);
        }
    }
    if (status == GONIO_OK && errno != 0) {
        status = fail(session, error, "frames/");
    }
    sqlite3_finalize(query);
    return status;
}

static gonio_status walk_folder(gonio_session *session, session_stray_fn call, void *context, DIR *list,
                                gonio_error *error) {
    gonio_status status = GONIO_OK;
    const char *name = NULL;
    while (status == GONIO_OK && (name = gonio_folder_next(list)) != NULL) {
        if (is_temporary(name)) {
            status = call(session, &(session_stray){session->folder_fd, "", name, true}, context, error);
        }
    }
    return status == GONIO_OK && errno != 0 ? fail(session, error, "the folder") : status;
}

gonio_status gonio_session_for_strays(gonio_session *session, session_stray_fn call, void *context,
                                      gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int i = 0; status == GONIO_OK && i < 2; i++) {
        const int folder = i == 0 ? session->frames_fd : session->folder_fd;
        DIR *list = folder >= 0 ? gonio_folder_list(folder) : NULL;
        if (list == NULL) {
            status = folder < 0 ? GONIO_OK : fail(session, error, i == 0 ? "frames/" : "the folder");
            continue;
        }
        status = i == 0 ? walk_frames(session, call, context, list, error)
                        : walk_folder(session, call, context, list, error);
        closedir(list);
    }
    return status;
}

// ---- sweeping ----

typedef struct sweep {
    session_lost lost;
    int moved;
} sweep;

static gonio_status sweep_one(gonio_session *session, const session_stray *stray, void *context, gonio_error *error) {
    sweep *s = context;
    if (!stray->ours) {
        return GONIO_OK;
    }
    gonio_status status = s->lost.fd < 0 ? gonio_session_lost_open(session, &s->lost, error) : GONIO_OK;
    if (status == GONIO_OK) {
        status = gonio_session_lost_put(
            &s->lost, stray->folder, stray->where, stray->name,
            stray->where[0] != 0 ? "no step of the journal owns it" : "a file that was never finished", error);
    }
    if (status != GONIO_OK) {
        return status;
    }
    char text[400];
    s->moved++;
    snprintf(text, sizeof text, "%s%s, which no step owns, went to lost+found/", stray->where, stray->name);
    return gonio_session_event(session, "set aside", text, error);
}

gonio_status gonio_session_sweep(gonio_session *session, int *moved, gonio_error *error) {
    sweep s = {.lost = {session, -1, -1}};
    bool own;
    gonio_status status = gonio_session_begin_own(session, &own, error);
    if (status == GONIO_OK) {
        status = gonio_session_for_strays(session, sweep_one, &s, error);
        status = gonio_session_end_own(session, own, gonio_session_lost_close(&s.lost, status, error), error);
    }
    if (moved != NULL) {
        *moved = s.moved;
    }
    return status;
}
