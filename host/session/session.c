// SPDX-License-Identifier: BSD-3-Clause
// Create, open and close a session folder.
#include "gonio/session.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "host/session/internal.h"

// How to open: JOURNAL: without frames/, and with a log that goes with the database although rows are missing.
enum { CREATE = 1, WRITE = 2, UNPROVEN = 4, JOURNAL = 8 };

static char *join(const char *folder, const char *name) {
    char *path;
    return asprintf(&path, "%s/%s", folder, name) < 0 ? NULL : path;
}

bool gonio_session_is(const char *path) {
    char *db = join(path, "session.db");
    struct stat info; // of a link or a pipe too: opening it then says what is wrong
    const bool is = db != NULL && lstat(db, &info) == 0 && !S_ISDIR(info.st_mode);
    free(db);
    return is;
}

const char *gonio_session_path(const gonio_session *session) { return session->path; }

static gonio_status allocate(const char *path, gonio_session **out, gonio_error *error) {
    gonio_session *session = calloc(1, sizeof *session);
    if (session == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a session");
    }
    session->folder_fd = session->frames_fd = session->log.fd = -1;
    session->log.off = true; // until it is known to go with the database
    snprintf(session->log.hash, sizeof session->log.hash, "%s", SESSION_CHAIN_START);
    session->path = strdup(path);
    session->db_path = join(path, "session.db");
    if (session->path == NULL || session->db_path == NULL) {
        gonio_session_close(session);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a session");
    }
    *out = session;
    return GONIO_OK;
}

void gonio_session_close(gonio_session *session) {
    if (session == NULL) {
        return;
    }
    if (session->in_transaction) {
        gonio_session_rollback(session);
    }
    if (session->hooks != NULL && session->log.lags) {
        gonio_session_log_catch_up(session, NULL);
    }
    gonio_session_chain_end(session);
    sqlite3_close(session->db);
    if (session->log.fd >= 0) {
        close(session->log.fd);
    }
    if (session->frames_fd >= 0) {
        close(session->frames_fd);
    }
    if (session->folder_fd >= 0) {
        close(session->folder_fd);
    }
    free(session->db_path);
    free(session->path);
    free(session);
}

gonio_status gonio_session_lock(int fd, const char *path, gonio_error *error) {
    if (flock(fd, LOCK_EX | LOCK_NB) == 0) {
        return GONIO_OK;
    }
    if (errno == EWOULDBLOCK) {
        return gonio_fail_line(error, GONIO_E_FAILED, path, -1,
                               "another process is writing this session; `gonio status` shows it");
    }
    return gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot lock it: %s", strerror(errno));
}

static gonio_status open_folders(gonio_session *session, bool frames, gonio_error *error) {
    session->folder_fd = open(session->path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (session->folder_fd < 0) {
        return gonio_fail_line(error, GONIO_E_INPUT, session->path, -1, "cannot open the session: %s", strerror(errno));
    }
    if (session->writable) {
        const gonio_status status = gonio_session_lock(session->folder_fd, session->path, error);
        if (status != GONIO_OK) {
            return status;
        }
        if (frames && mkdirat(session->folder_fd, "frames", 0777) != 0 && errno != EEXIST) {
            return gonio_fail_line(error, GONIO_E_IO, session->path, -1, "cannot make frames/: %s", strerror(errno));
        }
    }
    session->frames_fd = openat(session->folder_fd, "frames", O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    if (frames && session->frames_fd < 0) { // ENOTDIR of a symbolic link too
        return gonio_fail_line(error, GONIO_E_INPUT, session->path, -1,
                               "cannot open its frames/: %s; a folder of its own is expected", strerror(errno));
    }
    return GONIO_OK;
}

// The schema is written beside and renamed: a session.db is a whole journal from the first moment it exists.
static gonio_status create_database(gonio_session *session, gonio_error *error) {
    char *final_path = session->db_path;
    session->db_path = join(session->path, "session.db.new");
    if (session->db_path == NULL) {
        session->db_path = final_path;
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a session");
    }
    unlink(session->db_path); // left by a run that was stopped here, or anything: SQLite makes its own anew
    char versions[96];
    snprintf(versions, sizeof versions, "PRAGMA application_id = %d; PRAGMA user_version = %d;", SESSION_APPLICATION_ID,
             GONIO_SESSION_VERSION);
    gonio_status status = GONIO_OK;
    if (sqlite3_open(session->db_path, &session->db) != SQLITE_OK) {
        status = gonio_session_db_fail(session, error, "create the journal");
    }
    status = status == GONIO_OK ? gonio_session_exec(session, "PRAGMA synchronous = FULL", error) : status;
    status = status == GONIO_OK ? gonio_session_begin(session, error) : status;
    if (status == GONIO_OK) {
        status = gonio_session_exec(session, versions, error);
        status = status == GONIO_OK ? gonio_session_exec(session, gonio_session_schema, error) : status;
        status = gonio_session_end(session, status, error);
    }
    sqlite3_close(session->db);
    session->db = NULL;
    if (status == GONIO_OK && (rename(session->db_path, final_path) != 0 || fsync(session->folder_fd) != 0)) {
        status = gonio_fail_line(error, GONIO_E_IO, final_path, -1, "cannot write it: %s", strerror(errno));
    }
    if (status != GONIO_OK) {
        unlink(session->db_path);
    }
    free(session->db_path);
    session->db_path = final_path;
    return status;
}

static gonio_status check_version(gonio_session *session, gonio_error *error) {
    int64_t application = 0, version = 0;
    gonio_status status = gonio_session_integer(session, "PRAGMA application_id", &application, error);
    status = status == GONIO_OK ? gonio_session_integer(session, "PRAGMA user_version", &version, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    if (application != SESSION_APPLICATION_ID) {
        return gonio_fail_line(error, GONIO_E_INPUT, session->db_path, -1,
                               "not a Gonio session: an SQLite file of another application (id %lld)",
                               (long long)application);
    }
    session->version = (int)version;
    if (version > GONIO_SESSION_VERSION || version < 1) {
        return gonio_fail_line(error, GONIO_E_INPUT, session->db_path, -1,
                               "a session of version %lld; this Gonio reads versions 1 to %d", (long long)version,
                               GONIO_SESSION_VERSION);
    }
    return GONIO_OK;
}

static bool connect_as(gonio_session *session, const char *name, int flags) {
    const bool opened = sqlite3_open_v2(name, &session->db, flags | SQLITE_OPEN_FULLMUTEX, NULL) == SQLITE_OK;
    if (opened) {
        gonio_session_secure(session->db, session->folder_fd, &session->budget);
    }
    return opened;
}

// Open with these flags, and see whether it can be read.
static bool open_with(gonio_session *session, int flags) {
    return connect_as(session, session->db_path, flags) &&
           sqlite3_exec(session->db, "SELECT 1 FROM sqlite_master", NULL, NULL, NULL) == SQLITE_OK;
}

static bool open_read_only(gonio_session *session) {
    if (open_with(session, SQLITE_OPEN_READONLY)) {
        return true;
    }
    // Power went in the middle of a change: it has to be rolled back before anybody can read.
    if ((sqlite3_errcode(session->db) & 0xff) == SQLITE_READONLY) {
        sqlite3_close(session->db);
        if (open_with(session, SQLITE_OPEN_READWRITE)) {
            return true;
        }
    }
    // On a medium that cannot be written SQLite cannot make its -shm file: there the file cannot change either.
    const int code = sqlite3_errcode(session->db) & 0xff;
    char *uri = NULL;
    if ((code != SQLITE_CANTOPEN && code != SQLITE_READONLY) || faccessat(session->folder_fd, ".", W_OK, 0) == 0 ||
        asprintf(&uri, "file:%s?immutable=1", session->db_path) < 0) {
        return false;
    }
    sqlite3_close(session->db);
    const bool opened = connect_as(session, uri, SQLITE_OPEN_READONLY | SQLITE_OPEN_URI);
    free(uri);
    return opened;
}

// Of a version that is known here, with its tables and nothing else; what is in them, its proof tells.
static gonio_status check_database(gonio_session *session, gonio_error *error) {
    const gonio_status status = check_version(session, error);
    return status == GONIO_OK ? gonio_session_check_schema(session, error) : status;
}

static gonio_status open_database(gonio_session *session, gonio_error *error) {
    gonio_status status = gonio_session_check_database_files(session->folder_fd, session->path, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (!(session->writable ? connect_as(session, session->db_path, SQLITE_OPEN_READWRITE) : open_read_only(session))) {
        return gonio_session_db_fail(session, error, "open the journal");
    }
    sqlite3_busy_timeout(session->db, 5000);
    status = check_database(session, error);
    if (status == GONIO_OK && session->writable) {
        // FULL in WAL mode: a committed step survives a power cut.
        status = gonio_session_exec(session,
                                    "PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL; PRAGMA foreign_keys = ON;"
                                    " PRAGMA temp_store = MEMORY",
                                    error);
    }
    return status;
}

// What is opened proves itself, before it is read and before it is added to.
static gonio_status prove(gonio_session *session, int how, gonio_error *error) {
    session_proof proof;
    gonio_status status = session->writable ? gonio_session_verify(session, &proof, error)
                                            : gonio_session_verify_rows(session, &proof, error);
    status = status == GONIO_OK && (how & UNPROVEN) == 0 ? gonio_session_vouch(session, &proof, error) : status;
    if (status != GONIO_OK || !session->writable) {
        return status;
    }
    if (session->version == 1 && !proof.database) {
        return GONIO_OK; // damage is not taken into a chain
    }
    if (session->version == 1) {
        status = gonio_session_adopt(session, error);
        status = status == GONIO_OK ? gonio_session_verify(session, &proof, error) : status;
        // A log that is there is of another journal in the same folder.
        proof.log = proof.log == SESSION_LOG_SOUND ? SESSION_LOG_SOUND : SESSION_LOG_MISSING;
    } else {
        status = gonio_session_chain_begin(session, error);
    }
    proof.database = proof.database || (how & JOURNAL) != 0;
    return status == GONIO_OK ? gonio_session_log_open(session, &proof, error) : status;
}

static gonio_status open_at(const char *path, int how, gonio_session **out, gonio_error *error) {
    gonio_session *session = NULL;
    gonio_status status = allocate(path, &session, error);
    if (status != GONIO_OK) {
        return status;
    }
    session->writable = (how & WRITE) != 0;
    status = open_folders(session, (how & JOURNAL) == 0, error);
    status = status == GONIO_OK && (how & CREATE) != 0 ? create_database(session, error) : status;
    status = status == GONIO_OK ? open_database(session, error) : status;
    status = status == GONIO_OK ? prove(session, how, error) : status;
    if (status != GONIO_OK) {
        gonio_session_close(session);
        return status;
    }
    *out = session;
    return GONIO_OK;
}

// Stopped before its steps were entered: nothing was measured, and the next measure may have the folder.
static bool holds_nothing(const char *path) {
    gonio_session *session;
    if (gonio_session_open(path, true, &session, NULL) != GONIO_OK) {
        return false;
    }
    int64_t steps = 1;
    const bool nothing =
        gonio_session_integer(session, "SELECT count(*) FROM steps", &steps, NULL) == GONIO_OK && steps == 0;
    gonio_session_close(session); // which leaves no -wal behind
    return nothing;
}

gonio_status gonio_session_create(const char *path, gonio_session **out, gonio_error *error) {
    *out = NULL;
    if (gonio_session_is(path) && !holds_nothing(path)) {
        return gonio_fail_line(error, GONIO_E_USAGE, path, -1,
                               "a session is already there; `gonio resume` goes on with it, or name another folder");
    }
    if (mkdir(path, 0777) != 0 && errno != EEXIST) {
        return gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot make the session's folder: %s", strerror(errno));
    }
    return open_at(path, CREATE | WRITE, out, error);
}

static gonio_status open_existing(const char *path, int how, gonio_session **out, gonio_error *error) {
    *out = NULL;
    if (!gonio_session_is(path)) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "not a session: a folder with a session.db is expected");
    }
    return open_at(path, how, out, error);
}

gonio_status gonio_session_open(const char *path, bool writable, gonio_session **out, gonio_error *error) {
    return open_existing(path, writable ? WRITE : 0, out, error);
}

gonio_status gonio_session_open_unproven(const char *path, bool writable, gonio_session **out, gonio_error *error) {
    return open_existing(path, UNPROVEN | (writable ? WRITE : 0), out, error);
}

gonio_status gonio_session_open_journal(const char *path, gonio_session **out, gonio_error *error) {
    return open_existing(path, WRITE | UNPROVEN | JOURNAL, out, error);
}
