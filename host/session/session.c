// SPDX-License-Identifier: BSD-3-Clause
// The parts of a session that is opened: its folder and lock, frames/, the journal; and closing it.
#include "gonio/session.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "host/session/folder.h"
#include "host/session/internal.h"

#define SETTING_UP_TURNS 50 // of 20 ms: a writer on a busy machine

static char *join(const char *folder, const char *name) {
    char *path;
    return asprintf(&path, "%s/%s", folder, name) < 0 ? NULL : path;
}

const char *gonio_session_path(const gonio_session *session) { return session->path; }

gonio_status gonio_session_new(const char *path, gonio_session **out, gonio_error *error) {
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

// The copy that was read instead of the journal.
static void forget_copy(gonio_session *session) {
    free(session->private_path);
    if (session->private_made) {
        gonio_folder_discard(AT_FDCWD, session->private_folder);
    }
    free(session->private_folder);
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
    forget_copy(session);
    free(session->db_path);
    free(session->path);
    free(session);
}

gonio_status gonio_session_lock(int fd, const char *path, gonio_error *error) {
    // A reader looks for a moment whether somebody writes.
    for (int tries = 0; tries < 10; tries++) {
        if (flock(fd, LOCK_EX | LOCK_NB) == 0) {
            return GONIO_OK;
        }
        if (errno != EWOULDBLOCK) {
            break;
        }
        nanosleep(&(struct timespec){.tv_nsec = 5000000}, NULL);
    }
    if (errno == EWOULDBLOCK) {
        return gonio_fail_line(error, GONIO_E_FAILED, path, -1,
                               "another process is writing this session; `gonio status` shows it");
    }
    return gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot lock it: %s", strerror(errno));
}

gonio_status gonio_session_open_frames(gonio_session *session, gonio_error *error) {
    session->frames_fd = gonio_folder_open(session->folder_fd, "frames");
    if (session->frames_fd >= 0) {
        return GONIO_OK;
    }
    const int why = errno;
    if (why == ENOENT) {
        return gonio_fail_line(error, GONIO_E_INPUT, session->path, -1,
                               "its frames/ is missing; where they are on another disk, is it mounted?");
    }
    if (why == ELOOP || why == ENOTDIR) {
        return gonio_fail_line(error, GONIO_E_INPUT, session->path, -1,
                               "cannot open its frames/: a link or a file; a folder of its own is expected");
    }
    return gonio_fail_line(error, GONIO_E_IO, session->path, -1, "cannot open its frames/: %s", strerror(why));
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

static const char *database_file(const gonio_session *session) {
    return session->private_path != NULL ? session->private_path : session->db_path;
}

static int open_database_folder(const gonio_session *session) {
    return session->private_path != NULL ? open(session->private_folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC)
                                         : fcntl(session->folder_fd, F_DUPFD_CLOEXEC, 0);
}

static bool connect_as(gonio_session *session, const char *name, int flags) {
    const int folder = open_database_folder(session);
    const bool opened =
        folder >= 0 && sqlite3_open_v2(name, &session->db, flags | SQLITE_OPEN_FULLMUTEX, NULL) == SQLITE_OK;
    if (opened) {
        sqlite3_busy_timeout(session->db, 5000); // from the first look on: a writer may just be setting its log up
        gonio_session_secure(session->db, folder, &session->budget);
    }
    if (folder >= 0) {
        close(folder);
    }
    return opened;
}

// Open with these flags, and see whether it can be read.
static bool open_with(gonio_session *session, int flags) {
    return connect_as(session, database_file(session), flags) &&
           sqlite3_exec(session->db, "SELECT 1 FROM sqlite_master", NULL, NULL, NULL) == SQLITE_OK;
}

// Between a writer's making of -wal and -shm nobody can read, and no busy handler waits for that.
static bool open_beside_writer(gonio_session *session) {
    const struct timespec pause = {.tv_nsec = 20 * 1000 * 1000};
    for (int turn = 0; !open_with(session, SQLITE_OPEN_READONLY); turn++) {
        if ((sqlite3_errcode(session->db) & 0xff) != SQLITE_CANTOPEN || turn == SETTING_UP_TURNS ||
            faccessat(session->folder_fd, ".", W_OK, 0) != 0) {
            return false;
        }
        sqlite3_close(session->db);
        nanosleep(&pause, NULL);
    }
    return true;
}

static bool open_read_only(gonio_session *session) {
    if (session->private_path != NULL) {
        return open_with(session, SQLITE_OPEN_READWRITE) &&
               sqlite3_exec(session->db, "PRAGMA query_only = ON", NULL, NULL, NULL) == SQLITE_OK;
    }
    if (open_beside_writer(session)) {
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
        asprintf(&uri, "file:%s?immutable=1", database_file(session)) < 0) {
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

static gonio_status check_files(gonio_session *session, gonio_error *error) {
    const int folder = open_database_folder(session);
    const gonio_status status =
        folder >= 0 ? gonio_session_check_database_files(folder, session->path, error)
                    : gonio_fail_line(error, GONIO_E_IO, session->path, -1, "cannot open it: %s", strerror(errno));
    if (folder >= 0) {
        close(folder);
    }
    return status;
}

gonio_status gonio_session_open_database(gonio_session *session, gonio_error *error) {
    gonio_status status = check_files(session, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (!(session->writable ? connect_as(session, database_file(session), SQLITE_OPEN_READWRITE)
                            : open_read_only(session))) {
        return gonio_session_db_fail(session, error, "open the journal");
    }
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
gonio_status gonio_session_prove(gonio_session *session, int how, gonio_error *error) {
    session_proof proof;
    gonio_status status = session->writable ? gonio_session_verify(session, &proof, error)
                                            : gonio_session_verify_rows(session, &proof, error);
    status = status == GONIO_OK && (how & SESSION_UNPROVEN) == 0 ? gonio_session_vouch(session, &proof, error) : status;
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
    proof.database = proof.database || (how & SESSION_JOURNAL) != 0;
    return status == GONIO_OK ? gonio_session_log_open(session, &proof, error) : status;
}
