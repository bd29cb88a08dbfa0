// SPDX-License-Identifier: BSD-3-Clause
// One HDF5 file -> a session: made beside under a name of its own, verified, then renamed.
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <libgen.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include "host/session/hdf5.h"

bool gonio_session_is_hdf5(const char *path) {
    static const unsigned char magic[8] = {0x89, 'H', 'D', 'F', '\r', '\n', 0x1a, '\n'};
    unsigned char found[8];
    struct stat facts;
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    const bool is = fd >= 0 && fstat(fd, &facts) == 0 && S_ISREG(facts.st_mode) &&
                    read(fd, found, sizeof found) == (ssize_t)sizeof found && memcmp(found, magic, sizeof magic) == 0;
    if (fd >= 0) {
        close(fd);
    }
    return is;
}

// ---- the folder ----

// A new folder beside the session to be, and the one for frames in it.
static gonio_status make_folder(const char *path, char **made, gonio_error *error) {
    struct stat there;
    uint32_t number;
    *made = NULL;
    const gonio_status fits = gonio_session_check_length(path, error);
    if (fits != GONIO_OK) {
        return fits;
    }
    if (lstat(path, &there) == 0) {
        return gonio_fail_line(error, GONIO_E_USAGE, path, -1, "something is already there; name a new session");
    }
    if (getrandom(&number, sizeof number, 0) != sizeof number || asprintf(made, "%s.%06" PRIx32, path, number) < 0) {
        *made = NULL;
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a path");
    }
    char *frames;
    if (mkdir(*made, 0777) != 0) {
        const gonio_status status =
            gonio_fail_line(error, GONIO_E_IO, *made, -1, "cannot make the session's folder: %s", strerror(errno));
        free(*made);
        *made = NULL;
        return status;
    }
    if (asprintf(&frames, "%s/frames", *made) < 0) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a path");
    }
    const bool good = mkdir(frames, 0777) == 0;
    const gonio_status status =
        good ? GONIO_OK : gonio_fail_line(error, GONIO_E_IO, frames, -1, "cannot make it: %s", strerror(errno));
    free(frames);
    return status;
}

// A folder of nobody else's; the caller frees *made.
static gonio_status make_temporary(char **made, gonio_error *error) {
    const char *folder = getenv("TMPDIR");
    if (asprintf(made, "%s/gonio-XXXXXX", folder != NULL && folder[0] == '/' ? folder : "/tmp") < 0) {
        *made = NULL;
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a path");
    }
    if (mkdtemp(*made) == NULL) {
        const gonio_status status =
            gonio_fail_line(error, GONIO_E_IO, *made, -1, "cannot make a folder for the journal: %s", strerror(errno));
        free(*made);
        *made = NULL;
        return status;
    }
    char *frames;
    if (asprintf(&frames, "%s/frames", *made) < 0) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a path");
    }
    const bool good = mkdir(frames, 0777) == 0;
    free(frames);
    return good ? GONIO_OK : gonio_fail_line(error, GONIO_E_IO, *made, -1, "cannot write there: %s", strerror(errno));
}

// Everything in a folder that this call made, and nobody else knows of.
static void remove_folder(int parent, const char *name) {
    const int fd = openat(parent, name, O_RDONLY | O_DIRECTORY | O_CLOEXEC | O_NOFOLLOW);
    DIR *folder = fd >= 0 ? fdopendir(fd) : NULL;
    const struct dirent *entry;
    while (folder != NULL && (entry = readdir(folder)) != NULL) {
        if (strcmp(entry->d_name, "frames") == 0) {
            remove_folder(fd, entry->d_name);
        } else if (strcmp(entry->d_name, ".") != 0 && strcmp(entry->d_name, "..") != 0) {
            unlinkat(fd, entry->d_name, 0);
        }
    }
    if (folder != NULL) {
        closedir(folder);
    }
    unlinkat(parent, name, AT_REMOVEDIR);
}

static bool sync_path(const char *path) {
    const int fd = open(path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    const bool good = fd >= 0 && fsync(fd) == 0;
    if (fd >= 0) {
        close(fd);
    }
    return good;
}

static gonio_status give_name(const char *made, const char *path, gonio_error *error) {
    char *copy = strdup(path);
    const bool good = copy != NULL && sync_path(made) &&
                      renameat2(AT_FDCWD, made, AT_FDCWD, path, RENAME_NOREPLACE) == 0 && sync_path(dirname(copy));
    const gonio_status status =
        good ? GONIO_OK : gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot write it: %s", strerror(errno));
    free(copy);
    return status;
}

// ---- the journal ----

typedef struct both {
    const h5_file *file;
    gonio_session *session;
    size_t tables;
} both;

static gonio_status get_one_table(void *context, const char *name, gonio_error *error) {
    both *b = context;
    char path[160];
    snprintf(path, sizeof path, "/entry/journal/%s", name);
    if (!gonio_h5_exists(b->file, path)) {
        return GONIO_OK; // of a version that lacks it
    }
    b->tables++;
    return gonio_h5_get_table(b->file, b->session, name, error);
}

// Are the tables that were read all that the file says it has?
static gonio_status check_tables(const both *b, gonio_error *error) {
    char *names;
    size_t named = 1;
    gonio_status status = gonio_h5_read_text(b->file, "/entry/journal", "tables", &names, error);
    for (const char *c = names; status == GONIO_OK && *c != 0; c++) {
        named += *c == ',';
    }
    if (status == GONIO_OK && b->tables != named) {
        status = gonio_fail_line(error, GONIO_E_INPUT, b->file->path, -1,
                                 "/entry/journal has other tables than this Gonio knows: %s", names);
    }
    free(names);
    return status;
}

static gonio_status fill_database(const h5_file *file, gonio_session *session, int64_t version, gonio_error *error) {
    char versions[128];
    both b = {file, session, 0};
    snprintf(versions, sizeof versions, "PRAGMA application_id = %d; PRAGMA user_version = %lld;",
             SESSION_APPLICATION_ID, (long long)version);
    gonio_status status = gonio_session_exec(session, versions, error);
    status = status == GONIO_OK ? gonio_session_exec(session, gonio_session_schema, error) : status;
    status = status == GONIO_OK ? gonio_h5_for_tables(session, get_one_table, &b, error) : status;
    status = status == GONIO_OK ? check_tables(&b, error) : status;
    return status;
}

static gonio_status check_references(const h5_file *file, gonio_session *session, gonio_error *error) {
    sqlite3_stmt *rows;
    gonio_status status = gonio_session_prepare(session, "PRAGMA foreign_key_check", &rows, error);
    if (status == GONIO_OK && sqlite3_step(rows) == SQLITE_ROW) {
        status = gonio_fail_line(error, GONIO_E_INPUT, file->path, -1, "/entry/journal/%s: row %lld is of no step",
                                 (const char *)sqlite3_column_text(rows, 0), (long long)sqlite3_column_int64(rows, 1));
    }
    sqlite3_finalize(rows);
    return status;
}

// The journal's rows as they were, keys and checksums included.
static gonio_status make_database(const h5_file *file, const char *made, int64_t version, gonio_error *error) {
    gonio_session bare = {.path = (char *)made, .folder_fd = -1, .frames_fd = -1, .writable = true, .log.fd = -1};
    if (asprintf(&bare.db_path, "%s/session.db", made) < 0) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a path");
    }
    gonio_status status = sqlite3_open(bare.db_path, &bare.db) == SQLITE_OK
                              ? gonio_session_begin(&bare, error)
                              : gonio_session_db_fail(&bare, error, "create the journal");
    if (status == GONIO_OK) {
        status = fill_database(file, &bare, version, error);
        status = status == GONIO_OK ? check_references(file, &bare, error) : status;
        status = gonio_session_end(&bare, status, error);
    }
    sqlite3_close(bare.db);
    free(bare.db_path);
    return status;
}

// ---- the rest ----

// only: NULL, or the one that is wanted.
static gonio_status get_files(const h5_file *file, const char *made, const char *only, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (const char *const *name = gonio_h5_folder_files; status == GONIO_OK && *name != NULL; name++) {
        char group[160], *path;
        snprintf(group, sizeof group, "/entry/files/%s", *name);
        if ((only != NULL && strcmp(*name, only) != 0) || !gonio_h5_exists(file, group)) {
            continue;
        }
        if (asprintf(&path, "%s/%s", made, *name) < 0) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for a path");
        }
        status = gonio_h5_get_file(file, *name, path, error);
        free(path);
    }
    return status;
}

static gonio_status ignore_set(void *context, int64_t step, const gonio_samples *set, gonio_error *error) {
    (void)context, (void)step, (void)set, (void)error;
    return GONIO_OK;
}

// What the journal says of its own samples and steps is read once as everybody will read it.
static gonio_status check_session(gonio_session *session, gonio_error *error) {
    gonio_step *steps = NULL;
    size_t n;
    int64_t sets = 0;
    bool final;
    gonio_status status = gonio_session_steps(session, &steps, &n, error);
    free(steps);
    status = status == GONIO_OK ? gonio_session_integer(session, "SELECT count(*) FROM samples", &sets, error) : status;
    if (status != GONIO_OK || sets == 0) {
        return status;
    }
    status = gonio_session_each_set(session, false, ignore_set, NULL, error);
    status = status == GONIO_OK ? gonio_session_is_final(session, &final, error) : status;
    return status == GONIO_OK && final ? gonio_session_each_set(session, true, ignore_set, NULL, error) : status;
}

// Frames and what else stands beside the journal, which proves itself when it is opened. *write: something is to be
// entered.
static gonio_status fill_frames(const h5_file *file, const char *made, const h5_progress *progress, bool *write,
                                gonio_error *error) {
    gonio_session *session = NULL;
    gonio_status status = gonio_session_open(made, false, &session, error);
    status = status == GONIO_OK ? check_session(session, error) : status;
    status = status == GONIO_OK ? gonio_h5_get_frames(file, session, progress, error) : status;
    status = status == GONIO_OK ? gonio_h5_sizes_differ(session, write, error) : status;
    gonio_session_close(session);
    return status;
}

static gonio_status enter_sizes(const char *made, gonio_error *error) {
    gonio_session *session = NULL;
    gonio_status status = gonio_session_open(made, true, &session, error);
    status = status == GONIO_OK ? gonio_h5_enter_sizes(session, error) : status;
    gonio_session_close(session);
    return status;
}

static gonio_status read_versions(const h5_file *file, int64_t *version, gonio_error *error) {
    int64_t format = 0;
    gonio_status status = gonio_h5_read_integer(file, "/", "gonio_format", &format, error);
    status = status == GONIO_OK ? gonio_h5_read_integer(file, "/", "gonio_session_version", version, error) : status;
    if (status == GONIO_OK && (format != H5_FORMAT_VERSION || *version < 1 || *version > GONIO_SESSION_VERSION)) {
        status = gonio_fail_line(error, GONIO_E_INPUT, file->path, -1,
                                 "format %lld with a session of version %lld; this Gonio reads format %d with sessions "
                                 "of versions 1 to %d",
                                 (long long)format, (long long)*version, H5_FORMAT_VERSION, GONIO_SESSION_VERSION);
    }
    return status;
}

static gonio_status fill_folder(const h5_file *file, const char *made, const h5_progress *progress,
                                gonio_error *error) {
    int64_t version = 0;
    bool write = false;
    gonio_status status = read_versions(file, &version, error);
    status = status == GONIO_OK ? make_database(file, made, version, error) : status;
    status = status == GONIO_OK ? get_files(file, made, NULL, error) : status;
    status = status == GONIO_OK ? fill_frames(file, made, progress, &write, error) : status;
    // A session of version 1 becomes one of this version; another only says where it has changed.
    return status == GONIO_OK && (write || version < GONIO_SESSION_VERSION) ? enter_sizes(made, error) : status;
}

gonio_status gonio_h5_folder(const char *path, char **made, gonio_error *error) {
    *made = NULL;
    return path != NULL ? make_folder(path, made, error) : make_temporary(made, error);
}

gonio_status gonio_h5_fill(const char *hdf5, const char *made, gonio_progress_fn progress, void *context,
                           gonio_error *error) {
    h5_file file;
    gonio_status status = gonio_h5_open(hdf5, &file, error);
    status = status == GONIO_OK ? fill_folder(&file, made, &(h5_progress){progress, context}, error) : status;
    return gonio_h5_close(&file, status, error);
}

gonio_status gonio_h5_folder_end(const char *path, char *made, gonio_status status, gonio_error *error) {
    status = status == GONIO_OK && path != NULL ? give_name(made, path, error) : status;
    if (made != NULL && (status != GONIO_OK || path == NULL)) {
        remove_folder(AT_FDCWD, made);
    }
    free(made);
    return status;
}

gonio_status gonio_session_import(const char *hdf5, const char *path, gonio_progress_fn progress, void *context,
                                  gonio_error *error) {
    char *made;
    gonio_status status = gonio_h5_folder(path, &made, error);
    status = status == GONIO_OK ? gonio_h5_fill(hdf5, made, progress, context, error) : status;
    return gonio_h5_folder_end(path, made, status, error);
}

// ---- the samples alone ----

static gonio_status read_journal(const char *made, gonio_samples **out, gonio_error *error) {
    gonio_session *session = NULL;
    bool final;
    gonio_status status = gonio_session_open(made, false, &session, error);
    status = status == GONIO_OK ? check_session(session, error) : status;
    status = status == GONIO_OK ? gonio_session_final_samples(session, out, &final, error) : status;
    gonio_session_close(session);
    return status;
}

gonio_status gonio_h5_samples(const char *hdf5, const char *made, gonio_samples **out, gonio_error *error) {
    h5_file file;
    int64_t version = 0;
    gonio_error own = {.line = -1, .byte = -1};
    *out = NULL;
    gonio_status status = gonio_h5_open(hdf5, &file, &own);
    status = status == GONIO_OK ? read_versions(&file, &version, &own) : status;
    status = status == GONIO_OK ? make_database(&file, made, version, &own) : status;
    status = status == GONIO_OK ? get_files(&file, made, "session.log", &own) : status;
    status = status == GONIO_OK ? read_journal(made, out, &own) : status;
    status = gonio_h5_close(&file, status, &own);
    if (strncmp(own.file, made, strlen(made)) == 0) {
        snprintf(own.file, sizeof own.file, "%s", hdf5); // the folder will be no more
    }
    if (status != GONIO_OK) {
        gonio_samples_free(*out);
        *out = NULL;
        if (error != NULL) {
            *error = own;
        }
    }
    return status;
}

gonio_status gonio_session_read_hdf5(const char *hdf5, gonio_samples **out, gonio_error *error) {
    char *made;
    *out = NULL;
    gonio_status status = gonio_h5_folder(NULL, &made, error);
    status = status == GONIO_OK ? gonio_h5_samples(hdf5, made, out, error) : status;
    return gonio_h5_folder_end(NULL, made, status, error);
}
