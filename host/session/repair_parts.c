// SPDX-License-Identifier: BSD-3-Clause
// What a repair is made of: the new session's journal, second names of the other files, and the exchange.
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "host/session/repair.h"

int gonio_repair_make_folder(const session_repair *r, char name[FOLDER_NAME], char **path) {
    char prefix[FOLDER_NAME];
    *path = NULL;
    snprintf(prefix, sizeof prefix, "%.200s.repair-", r->base);
    const int fd = gonio_folder_make(r->parent, prefix, name);
    if (fd < 0) {
        name[0] = 0;
    } else if (asprintf(path, "%.*s/%s", (int)(r->base - 1 - r->path), r->path, name) < 0) {
        *path = NULL;
    }
    return fd;
}

// ---- the journal ----

static char *database_in(const char *folder) {
    char *path;
    return asprintf(&path, "%s/session.db", folder) < 0 ? NULL : path;
}

// The session as it lies there, with the journal of another folder.
static gonio_status open_with(session_repair *r, const char *folder, gonio_session **out, gonio_error *error) {
    gonio_session *session;
    gonio_status status = gonio_session_new(r->path, &session, error);
    if (status != GONIO_OK) {
        return status;
    }
    session->private_folder = strdup(folder);
    session->private_path = database_in(folder);
    session->folder_fd = fcntl(r->folder, F_DUPFD_CLOEXEC, 0);
    if (session->private_folder == NULL || session->private_path == NULL || session->folder_fd < 0) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for a session");
    }
    status = status == GONIO_OK ? gonio_session_open_database(session, error) : status;
    if (status != GONIO_OK) {
        gonio_session_close(session);
        return status;
    }
    gonio_session_open_frames(session, NULL);
    *out = session;
    return GONIO_OK;
}

static gonio_status copy_sound(session_repair *r, gonio_session *old, const char *file, gonio_error *error) {
    sqlite3 *fresh = NULL;
    sqlite3_backup *copy = NULL;
    int code = sqlite3_open(file, &fresh);
    if (code == SQLITE_OK && (copy = sqlite3_backup_init(fresh, "main", old->db, "main")) != NULL) {
        sqlite3_backup_step(copy, -1);
        code = sqlite3_backup_finish(copy);
    } else {
        code = sqlite3_errcode(fresh);
    }
    const gonio_status status =
        code == SQLITE_OK
            ? GONIO_OK
            : gonio_fail_line(error, GONIO_E_IO, r->path, -1, "cannot copy the journal: %s", sqlite3_errmsg(fresh));
    sqlite3_close(fresh);
    return status;
}

// The old journal proves itself; its log goes with it unless that does not.
static gonio_status keep_journal(session_repair *r, gonio_session *old, const session_proof *proof,
                                 gonio_error *error) {
    char *file = database_in(r->beside_path);
    gonio_status status =
        file != NULL ? copy_sound(r, old, file, error) : gonio_fail(error, GONIO_E_MEMORY, "no memory");
    free(file);
    bool reading;
    r->journal_kept = !proof->chained || proof->log == SESSION_LOG_SOUND;
    if (status == GONIO_OK && proof->chained && r->journal_kept &&
        gonio_folder_copy(r->folder, "session.log", r->beside, "session.log", &reading) != 0 && errno != ENOENT) {
        status = gonio_fail_line(error, GONIO_E_IO, r->path, -1, "cannot copy session.log: %s", strerror(errno));
    }
    return status;
}

// From what database and log prove, each alone or both together; of a session that has no chain yet, from what SQLite
// still reads.
static gonio_status make_anew(session_repair *r, bool salvage, gonio_error *error) {
    session_rebuilt rebuilt;
    gonio_error why = {0};
    gonio_status status = gonio_session_rebuild(r->path, r->beside_path, &rebuilt, &why);
    if (status == GONIO_OK) {
        r->report->rows_lost += rebuilt.lost + !rebuilt.complete;
        if (!rebuilt.complete) {
            gonio_doctor_note(r->report,
                              "the chain of the journal has gaps: rows, or later states of some, may be lost");
        }
        for (char *line = strtok(rebuilt.detail, "\n"); line != NULL; line = strtok(NULL, "\n")) {
            gonio_doctor_note(r->report, "%s", line);
        }
        return GONIO_OK;
    }
    if (status != GONIO_E_INPUT || !salvage) {
        return gonio_fail_line(error, status, r->path, -1, "%s; nothing was changed", why.message);
    }
    char *damaged = database_in(r->old_path), *fresh = database_in(r->beside_path);
    status = damaged != NULL && fresh != NULL ? gonio_session_salvage(damaged, fresh, r->report, error)
                                              : gonio_fail(error, GONIO_E_MEMORY, "no memory for a path");
    free(damaged);
    free(fresh);
    return status;
}

// *anew: it cannot be kept.
static gonio_status keep_if_sound(session_repair *r, bool *anew, gonio_error *error) {
    gonio_session *old = NULL;
    session_proof proof;
    gonio_status status = open_with(r, r->old_path, &old, error);
    status = status == GONIO_OK ? gonio_session_check_journal(old, &proof, r->report, error) : status;
    // What the log alone tells, or tells otherwise, is not thrown away for a database that is sound.
    *anew = status == GONIO_OK && (!proof.database || proof.log == SESSION_LOG_AHEAD || proof.log == SESSION_LOG_OTHER);
    status = status == GONIO_OK && !*anew ? keep_journal(r, old, &proof, error) : status;
    gonio_session_close(old);
    return status;
}

static gonio_status make_journal(session_repair *r, bool database, gonio_error *error) {
    bool anew = true;
    gonio_error why = {0};
    const gonio_status status = database ? keep_if_sound(r, &anew, &why) : GONIO_OK;
    const bool newer = strstr(why.message, "a session of version") != NULL; // to those who know more of it
    if (status == GONIO_E_INPUT && !newer) {                                // not to be opened, or not as it must be
        gonio_doctor_note(r->report, "%s", why.message);
        return make_anew(r, gonio_session_is_damage(status, &why), error);
    }
    if (status != GONIO_OK && error != NULL) {
        *error = why;
    }
    return status == GONIO_OK && anew ? make_anew(r, database, error) : status;
}

static gonio_status like_old(session_repair *r, gonio_error *error) {
    struct stat facts = r->facts;
    const int fd = openat(r->beside, "session.db", O_WRONLY | O_NOFOLLOW | O_CLOEXEC);
    facts.st_mode &= 0666;
    fstatat(r->folder, "session.db", &facts, AT_SYMLINK_NOFOLLOW);
    const bool done = fd >= 0 && gonio_folder_like(fd, &facts) == 0 && fsync(fd) == 0;
    const int why = errno;
    if (fd >= 0) {
        close(fd);
    }
    return done ? GONIO_OK
                : gonio_fail_line(error, GONIO_E_IO, r->path, -1, "cannot write the new journal: %s", strerror(why));
}

// The copy has a folder of its own beside the session: SQLite's paths are as long as may be, and no longer.
gonio_status gonio_repair_journal(session_repair *r, gonio_error *error) {
    char name[FOLDER_NAME];
    const int fd = gonio_repair_make_folder(r, name, &r->old_path);
    if (fd < 0) {
        return gonio_fail_line(error, GONIO_E_IO, r->path, -1, "cannot copy its journal: %s", strerror(errno));
    }
    struct stat facts;
    const bool database = fstatat(r->folder, "session.db", &facts, AT_SYMLINK_NOFOLLOW) == 0 || errno != ENOENT;
    bool room;
    gonio_status status = r->old_path != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a path");
    if (!database) {
        gonio_doctor_note(r->report, "its session.db is missing");
    } else if (status == GONIO_OK) {
        status = gonio_session_copy_journal(r->folder, r->path, fd, &room, error);
    }
    close(fd);
    status = status == GONIO_OK ? make_journal(r, database, error) : status;
    gonio_folder_discard(r->parent, name);
    free(r->old_path);
    r->old_path = NULL;
    status = status == GONIO_OK ? like_old(r, error) : status;
    return status == GONIO_OK ? open_with(r, r->beside_path, &r->session, error) : status;
}

// ---- the other files ----

static gonio_status link_tree(session_repair *r, int from, int to, const char *where, gonio_error *error);

static gonio_status fail_name(const session_repair *r, const char *where, const char *name, bool reading,
                              gonio_error *error) {
    return gonio_fail_line(error, GONIO_E_IO, r->path, -1, "%s %s%s: %s; nothing was changed",
                           reading ? "unreadable:" : "cannot link", where, name, strerror(errno));
}

static gonio_status link_folder(session_repair *r, int from, int to, const char *where, const char *name,
                                const struct stat *facts, gonio_error *error) {
    char below[PATH_MAX];
    if (snprintf(below, sizeof below, "%s%s/", where, name) >= (int)sizeof below) {
        errno = ENAMETOOLONG;
        return fail_name(r, where, name, false, error);
    }
    const int source = gonio_folder_open(from, name);
    const int target = source >= 0 && mkdirat(to, name, 0700) == 0 ? gonio_folder_open(to, name) : -1;
    gonio_status status =
        target >= 0 ? link_tree(r, source, target, below, error) : fail_name(r, where, name, source < 0, error);
    if (status == GONIO_OK && gonio_folder_like(target, facts) != 0) {
        status = fail_name(r, where, name, false, error);
    }
    if (source >= 0) {
        close(source);
    }
    if (target >= 0) {
        close(target);
    }
    return status;
}

static gonio_status link_symbolic(session_repair *r, int from, int to, const char *where, const char *name,
                                  gonio_error *error) {
    char target[PATH_MAX];
    const ssize_t n = readlinkat(from, name, target, sizeof target - 1);
    target[n > 0 ? n : 0] = 0;
    if (n < 0 || symlinkat(target, to, name) != 0) {
        return fail_name(r, where, name, n < 0, error);
    }
    r->report->files_copied++;
    return GONIO_OK;
}

static gonio_status link_file(session_repair *r, int from, int to, const char *where, const char *name,
                              gonio_error *error) {
    bool reading = false, copied = true;
    // What Gonio goes on writing in place must not be one with the damaged session's.
    const bool apart = strcmp(where, "lost+found/") == 0 && strcmp(name, "LIST") == 0;
    const int result = apart ? gonio_folder_copy(from, name, to, name, &reading)
                             : gonio_folder_link(from, name, to, name, &copied, &reading);
    if (result != 0) {
        return fail_name(r, where, name, reading, error);
    }
    r->report->files_linked += !copied;
    r->report->files_copied += copied;
    return GONIO_OK;
}

static gonio_status link_one(session_repair *r, int from, int to, const char *where, const char *name,
                             gonio_error *error) {
    struct stat facts;
    if (fstatat(from, name, &facts, AT_SYMLINK_NOFOLLOW) != 0) {
        return fail_name(r, where, name, true, error);
    }
    if (S_ISREG(facts.st_mode)) {
        return link_file(r, from, to, where, name, error);
    }
    if (S_ISDIR(facts.st_mode) && facts.st_dev == r->facts.st_dev) {
        return link_folder(r, from, to, where, name, &facts, error);
    }
    if (S_ISLNK(facts.st_mode)) {
        return link_symbolic(r, from, to, where, name, error);
    }
    gonio_doctor_note(r->report, "%s%s: a device, a pipe or another disk; it stays with the damaged session", where,
                      name);
    return GONIO_OK;
}

// The journal is the new session's own.
static bool is_journal(const char *where, const char *name) {
    static const char *const own[] = {"session.db", "session.db-wal", "session.db-shm", "session.db-journal",
                                      "session.log"};
    for (size_t i = 0; where[0] == 0 && i < sizeof own / sizeof *own; i++) {
        if (strcmp(name, own[i]) == 0) {
            return true;
        }
    }
    return false;
}

static gonio_status link_tree(session_repair *r, int from, int to, const char *where, gonio_error *error) {
    DIR *list = gonio_folder_list(from);
    if (list == NULL) {
        return fail_name(r, where, "", true, error);
    }
    gonio_status status = GONIO_OK;
    const char *name = NULL;
    while (status == GONIO_OK && (name = gonio_folder_next(list)) != NULL) {
        status = is_journal(where, name) ? GONIO_OK : link_one(r, from, to, where, name, error);
    }
    if (status == GONIO_OK && errno != 0) {
        status = fail_name(r, where, "", true, error);
    }
    closedir(list);
    return status;
}

gonio_status gonio_repair_link_all(session_repair *r, gonio_error *error) {
    return link_tree(r, r->folder, r->beside, "", error);
}

// ---- the exchange ----

static gonio_status fail_exchange(const session_repair *r, gonio_error *error) {
    return gonio_fail_line(error, GONIO_E_IO, r->path, -1,
                           "the repaired session cannot take its place: %s; nothing was changed", strerror(errno));
}

static int rename_to_free(const session_repair *r, const char *name, char to[FOLDER_NAME]) {
    int result = -1;
    errno = EEXIST;
    for (int n = 1; result != 0 && errno == EEXIST && n < INT_MAX; n++) {
        if (snprintf(to, FOLDER_NAME, "%s.damaged-%d", r->base, n) >= FOLDER_NAME) {
            errno = ENAMETOOLONG;
            break;
        }
        result = gonio_folder_rename(r->parent, name, r->parent, to);
    }
    return result;
}

// Has somebody who asked for the session given it its name already?
static bool is_settled(const session_repair *r) {
    struct stat there, ours;
    const int why = errno;
    const bool is = fstatat(r->parent, r->base, &there, AT_SYMLINK_NOFOLLOW) == 0 && fstat(r->beside, &ours) == 0 &&
                    there.st_dev == ours.st_dev && there.st_ino == ours.st_ino;
    errno = why;
    return is;
}

// A file system that cannot exchange: two renames. Stopped between them, gonio_session_settle makes the second.
static gonio_status rename_twice(session_repair *r, char damaged[FOLDER_NAME], gonio_error *error) {
    char ready[FOLDER_NAME];
    const char *digits = strrchr(r->name, '-') + 1;
    if (snprintf(ready, sizeof ready, "%s" SESSION_REPAIRED "%s", r->base, digits) >= FOLDER_NAME ||
        gonio_folder_rename(r->parent, r->name, r->parent, ready) != 0) {
        return fail_exchange(r, error);
    }
    memcpy(r->name, ready, sizeof r->name);
    if (fsync(r->parent) != 0 || rename_to_free(r, r->base, damaged) != 0) {
        return fail_exchange(r, error);
    }
    fsync(r->parent);
    if (gonio_folder_rename(r->parent, r->name, r->parent, r->base) == 0 || is_settled(r)) {
        return GONIO_OK;
    }
    const gonio_status status = fail_exchange(r, error);
    gonio_folder_rename(r->parent, damaged, r->parent, r->base);
    return status;
}

static gonio_status exchange(session_repair *r, char damaged[FOLDER_NAME], gonio_error *error) {
    // The new session has the damaged one's future name before they swap: killed at any point, nothing that is to be
    // kept has the name of something temporary.
    char temporary[FOLDER_NAME];
    memcpy(temporary, r->name, sizeof temporary);
    if (rename_to_free(r, r->name, damaged) != 0) {
        return fail_exchange(r, error);
    }
    memcpy(r->name, damaged, sizeof r->name);
    if (fsync(r->parent) == 0 && gonio_folder_exchange(r->parent, r->base, damaged) == 0) {
        return GONIO_OK;
    }
    const bool unknown = errno == EINVAL || errno == ENOSYS || errno == EOPNOTSUPP;
    if (!unknown || gonio_folder_rename(r->parent, damaged, r->parent, temporary) != 0) {
        return fail_exchange(r, error);
    }
    memcpy(r->name, temporary, sizeof r->name);
    return rename_twice(r, damaged, error);
}

gonio_status gonio_repair_exchange(session_repair *r, gonio_error *error) {
    char damaged[FOLDER_NAME];
    const gonio_status status = exchange(r, damaged, error);
    if (status != GONIO_OK) {
        return status;
    }
    r->name[0] = 0; // it is the session now
    r->report->repaired = true;
    snprintf(r->report->damaged_path, sizeof r->report->damaged_path, "%.*s/%s", (int)(r->base - 1 - r->path), r->path,
             damaged);
    return fsync(r->parent) == 0
               ? GONIO_OK
               : gonio_fail_line(error, GONIO_E_IO, r->path, -1,
                                 "repaired, but the folder that it stands in cannot be synced: %s", strerror(errno));
}
