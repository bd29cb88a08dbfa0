// SPDX-License-Identifier: BSD-3-Clause
// How far a session is, from its journal alone, also while another program writes it; and what room it has.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <sys/sysmacros.h>

#include "gonio/output.h"
#include "host/session/internal.h"

static void copy_text(sqlite3_stmt *statement, int column, char *text, size_t size) {
    const unsigned char *value = sqlite3_column_text(statement, column);
    snprintf(text, size, "%s", value != NULL ? (const char *)value : "");
}

static gonio_status read_event(gonio_session *session, const char *sql, gonio_session_note *note, gonio_error *error) {
    sqlite3_stmt *statement;
    const gonio_status status = gonio_session_prepare(session, sql, &statement, error);
    if (status != GONIO_OK) {
        return status;
    }
    const int code = sqlite3_step(statement);
    *note = (gonio_session_note){0};
    if (code == SQLITE_ROW) {
        copy_text(statement, 0, note->utc, sizeof note->utc);
        copy_text(statement, 1, note->kind, sizeof note->kind);
        copy_text(statement, 2, note->text, sizeof note->text);
    }
    sqlite3_finalize(statement);
    return code == SQLITE_ROW || code == SQLITE_DONE ? GONIO_OK : gonio_session_db_fail(session, error, sql);
}

static gonio_status read_last_frame(gonio_session *session, gonio_session_overview *out, gonio_error *error) {
    sqlite3_stmt *statement;
    const gonio_status status = gonio_session_prepare(
        session, "SELECT step, frame FROM frames ORDER BY step DESC, frame DESC LIMIT 1", &statement, error);
    if (status != GONIO_OK) {
        return status;
    }
    out->last_step = out->last_frame = -1;
    const int code = sqlite3_step(statement);
    if (code == SQLITE_ROW) {
        out->last_step = sqlite3_column_int64(statement, 0);
        out->last_frame = sqlite3_column_int64(statement, 1);
    }
    sqlite3_finalize(statement);
    return code == SQLITE_ROW || code == SQLITE_DONE ? GONIO_OK : gonio_session_db_fail(session, error, "last frame");
}

static gonio_status read_counts(gonio_session *session, gonio_session_overview *out, gonio_error *error) {
    const struct {
        const char *sql;
        int64_t *value;
    } counts[] = {{"SELECT count(*) FROM steps", &out->steps},
                  {"SELECT count(*) FROM steps WHERE done", &out->steps_done},
                  {"SELECT count(*) FROM steps WHERE kind = 'sample'", &out->poses},
                  {"SELECT count(*) FROM steps WHERE kind = 'sample' AND done", &out->poses_done},
                  {"SELECT count(*) FROM frames", &out->frames},
                  {"SELECT count(*) FROM settings WHERE key = 'result.samples_sha256'", &out->results}};
    gonio_status status = GONIO_OK;
    for (size_t i = 0; status == GONIO_OK && i < sizeof counts / sizeof *counts; i++) {
        status = gonio_session_integer(session, counts[i].sql, counts[i].value, error);
    }
    return status;
}

static gonio_status read_all(gonio_session *session, gonio_session_overview *out, gonio_error *error) {
    static const char last[] = "SELECT utc, kind, text FROM events ORDER BY event DESC LIMIT 1";
    static const char begun[] = "SELECT utc, kind, text FROM events ORDER BY event LIMIT 1";
    // What an operator would want to be woken for, and not what happens in every measure.
    static const char alarm[] =
        "SELECT utc, kind, text FROM events WHERE kind IN ('alarm', 'fault', 'lost-steps',"
        " 'controller-restart', 'measured again', 'moved', 'no room') ORDER BY event DESC LIMIT 1";
    gonio_status status = read_counts(session, out, error);
    status = status == GONIO_OK ? read_last_frame(session, out, error) : status;
    status = status == GONIO_OK ? read_event(session, begun, &out->first, error) : status;
    status = status == GONIO_OK ? read_event(session, last, &out->last, error) : status;
    return status == GONIO_OK ? read_event(session, alarm, &out->alarm, error) : status;
}

// One state of the journal, though another program goes on writing.
gonio_status gonio_session_overview_read(gonio_session *session, gonio_session_overview *out, gonio_error *error) {
    *out = (gonio_session_overview){0};
    gonio_status status = gonio_session_exec(session, "BEGIN", error);
    if (status == GONIO_OK) {
        status = read_all(session, out, error);
        sqlite3_exec(session->db, "ROLLBACK", NULL, NULL, NULL);
    }
    return status;
}

// ---- who writes it, and its newest frame ----

// The lock of a writer, as the kernel lists it: nobody is disturbed by being looked for.
bool gonio_session_writer(const char *path, long *pid) {
    struct stat folder;
    FILE *locks = stat(path, &folder) == 0 ? fopen("/proc/locks", "re") : NULL;
    char line[256];
    bool found = false;
    while (locks != NULL && !found && fgets(line, sizeof line, locks) != NULL) {
        unsigned major_number, minor_number;
        unsigned long long inode;
        found = sscanf(line, "%*d: FLOCK %*s WRITE %ld %x:%x:%llu", pid, &major_number, &minor_number, &inode) == 4 &&
                inode == folder.st_ino && major_number == major(folder.st_dev) && minor_number == minor(folder.st_dev);
    }
    if (locks != NULL) {
        fclose(locks);
    }
    return found;
}

gonio_status gonio_session_copy_frame(gonio_session *session, int64_t step, int frame, const char *path,
                                      gonio_error *error) {
    char name[SESSION_FRAME_NAME];
    session_png png;
    gonio_output *output;
    gonio_session_frame_name(step, frame, name);
    gonio_status status = gonio_session_frame_file(session, name, (int64_t)1 << 30, &png, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = gonio_output_open(path, &output, error);
    if (status == GONIO_OK) {
        fwrite(png.data, 1, png.size, gonio_output_stream(output)); // commit tells where it failed
        status = gonio_output_commit(output, error);
    }
    free(png.data);
    return status;
}

// ---- room ----

gonio_status gonio_session_room(gonio_session *session, int64_t *bytes, gonio_error *error) {
    struct statvfs disk;
    if (fstatvfs(session->folder_fd, &disk) != 0) {
        return gonio_fail_line(error, GONIO_E_IO, session->path, -1, "cannot tell how much room its disk has");
    }
    const double room = (double)disk.f_bavail * (double)disk.f_frsize;
    *bytes = disk.f_blocks == 0 || room > 9e18 ? INT64_MAX : (int64_t)room; // some file systems do not tell
    return GONIO_OK;
}

gonio_status gonio_session_largest_step(gonio_session *session, int64_t from, int64_t *bytes, gonio_error *error) {
    char sql[160];
    snprintf(sql, sizeof sql,
             "SELECT coalesce(max(bytes), 0) FROM (SELECT sum(2 * width * height) AS bytes FROM frames"
             " WHERE step >= %lld GROUP BY step)",
             (long long)from);
    return gonio_session_integer(session, sql, bytes, error);
}
