// SPDX-License-Identifier: BSD-3-Clause
// The disk under the session: a process that dies in the middle of a write, power that goes (what was not synced is
// then partly lost), a disk that is full or fails. System calls of SQLite and of the frame store end here.
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "tests/faults/line.h"
#include "tests/faults/world.h"

// What was written and not synced yet, to be taken back when power goes.
typedef struct change {
    char path[160], former[160]; // former: of a rename
    int64_t offset, size_before;
    size_t n; // bytes of content that stood there before
    uint8_t *content;
} change;

static change *changes;
static int n_changes, room;

static int real_open(int folder, const char *path, int flags, mode_t mode) {
    return (int)syscall(SYS_openat, folder, path, flags, mode);
}

static bool path_of(int fd, char path[160]) {
    char link[40];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    const ssize_t n = readlink(link, path, 159);
    path[n > 0 ? n : 0] = 0;
    return n > 0 && strncmp(path, w->folder, strlen(w->folder)) == 0;
}

static bool power_matters(void) {
    for (int i = 0; i < w->n; i++) {
        if (w->faults[i].kind == FAULT_host_power_cut || w->faults[i].kind == FAULT_power_cut) {
            return !w->faults[i].over;
        }
    }
    return false;
}

static change *add(void) {
    if (n_changes == room) {
        room += 256;
        changes = realloc(changes, (size_t)room * sizeof *changes);
    }
    changes[n_changes] = (change){0};
    return &changes[n_changes++];
}

static void remember_write(const char *path, int fd, int64_t offset, size_t n) {
    if (!power_matters()) {
        return;
    }
    struct stat info;
    if (fstat(fd, &info) != 0) {
        return;
    }
    change *c = add();
    snprintf(c->path, sizeof c->path, "%s", path);
    c->offset = offset;
    c->size_before = info.st_size;
    const int64_t stood = info.st_size - offset;
    c->n = stood <= 0 ? 0 : (size_t)stood < n ? (size_t)stood : n;
    c->content = malloc(c->n + 1);
    const int reader = real_open(AT_FDCWD, path, O_RDONLY | O_CLOEXEC, 0);
    if (reader < 0 || syscall(SYS_pread64, reader, c->content, c->n, offset) != (long)c->n) {
        c->n = 0;
    }
    if (reader >= 0) {
        syscall(SYS_close, reader);
    }
}

// A synced file keeps its content, a synced folder its names.
static void forget(int fd) {
    char path[160];
    if (!path_of(fd, path)) {
        return;
    }
    const size_t length = strlen(path);
    int kept = 0;
    for (int i = 0; i < n_changes; i++) {
        change *c = &changes[i];
        const bool within =
            strncmp(c->path, path, length) == 0 && c->path[length] == '/' && strchr(c->path + length + 1, '/') == NULL;
        if (c->former[0] != 0 ? within : strcmp(c->path, path) == 0) {
            free(c->content);
        } else {
            changes[kept++] = *c;
        }
    }
    n_changes = kept;
}

static void undo(const change *c) {
    if (c->former[0] != 0) {
        syscall(SYS_rename, c->path, c->former);
        return;
    }
    const int fd = real_open(AT_FDCWD, c->path, O_WRONLY | O_CLOEXEC, 0);
    if (fd < 0) {
        return;
    }
    if (c->n > 0) {
        syscall(SYS_pwrite64, fd, c->content, c->n, c->offset);
    }
    struct stat info;
    if (fstat(fd, &info) == 0 && c->offset + (int64_t)c->n >= c->size_before && info.st_size > c->size_before) {
        syscall(SYS_ftruncate, fd, c->size_before);
    }
    syscall(SYS_close, fd);
}

static void power_off(const fault *f) {
    // Each write that was not synced is lost or not, by chance; all of them with one parameter in four.
    for (int i = n_changes - 1; i >= 0; i--) {
        if (f->parameter % 4 == 0 || world_random() & 1) {
            undo(&changes[i]);
        }
    }
    if (f->kind == FAULT_power_cut) {
        gonio_machine_start(&w->machine, FW_CAUSE_POWER);
    }
    _exit(137);
}

// Before each operation that changes something; 0, or the errno that it fails with. *n may become less.
static int happens(size_t *n, bool writes) {
    w->counts[DISK_WRITES]++;
    const fault *f;
    if ((f = world_strikes(FAULT_host_power_cut)) != NULL || (f = world_strikes(FAULT_power_cut)) != NULL) {
        power_off(f);
    }
    if (world_strikes(FAULT_disk_error) != NULL) {
        return EIO;
    }
    // Full is full until somebody makes room.
    for (int i = 0; writes && i < w->n; i++) {
        fault *full = &w->faults[i];
        if (full->kind == FAULT_disk_full && !full->over && w->counts[DISK_WRITES] >= full->at) {
            full->used = 1;
            full->hits++;
            return ENOSPC;
        }
    }
    if (world_strikes(FAULT_host_killed_writing) != NULL) {
        *n = writes && *n > 0 ? world_random() % (*n + 1) : 0;
        return -1;
    }
    return 0;
}

static ssize_t change_file(int fd, const void *bytes, size_t n, int64_t offset, bool at) {
    char path[160];
    if (!w->host_runs || !path_of(fd, path)) {
        return at ? (ssize_t)syscall(SYS_pwrite64, fd, bytes, n, offset) : (ssize_t)syscall(SYS_write, fd, bytes, n);
    }
    const int code = happens(&n, true);
    if (code > 0) {
        errno = code;
        return -1;
    }
    const int64_t where = at ? offset : (int64_t)syscall(SYS_lseek, fd, 0, SEEK_CUR);
    remember_write(path, fd, where, n);
    const ssize_t wrote =
        at ? (ssize_t)syscall(SYS_pwrite64, fd, bytes, n, offset) : (ssize_t)syscall(SYS_write, fd, bytes, n);
    if (code < 0) {
        _exit(137);
    }
    return wrote;
}

ssize_t write(int fd, const void *bytes, size_t n) {
    if (line_is(fd)) {
        return line_or_write(fd, bytes, n);
    }
    return w != NULL && fd > 2 ? change_file(fd, bytes, n, 0, false) : (ssize_t)syscall(SYS_write, fd, bytes, n);
}

ssize_t pwrite64(int fd, const void *bytes, size_t n, off64_t offset) {
    return change_file(fd, bytes, n, offset, true);
}

static int sync_file(int fd, long number) {
    char path[160];
    if (w == NULL || !w->host_runs || !path_of(fd, path)) {
        return (int)syscall(number, fd);
    }
    size_t none = 0;
    const int code = happens(&none, false);
    if (code > 0) {
        errno = code;
        return -1;
    }
    if (code < 0) {
        _exit(137);
    }
    forget(fd);
    return 0; // in memory: there is nothing to wait for
}

int fsync(int fd) { return sync_file(fd, SYS_fsync); }
int fdatasync(int fd) { return sync_file(fd, SYS_fdatasync); }

int renameat2(int old_folder, const char *old_name, int new_folder, const char *new_name, unsigned flags) {
    char folder[160], old[160];
    if (w == NULL || !w->host_runs || !path_of(new_folder, folder) || !path_of(old_folder, old)) {
        return (int)syscall(SYS_renameat2, old_folder, old_name, new_folder, new_name, flags);
    }
    size_t none = 0;
    const int code = happens(&none, false);
    if (code > 0) {
        errno = code;
        return -1;
    }
    const int result = (int)syscall(SYS_renameat2, old_folder, old_name, new_folder, new_name, flags);
    if (result == 0 && power_matters()) {
        change *c = add();
        snprintf(c->path, sizeof c->path, "%.100s/%.50s", folder, new_name);
        snprintf(c->former, sizeof c->former, "%.100s/%.50s", old, old_name);
        // The content was synced under the old name; what is kept of it moves with the name.
    }
    if (code < 0) {
        _exit(137);
    }
    return result;
}

int renameat(int old_folder, const char *old_name, int new_folder, const char *new_name) {
    return renameat2(old_folder, old_name, new_folder, new_name, 0);
}

int rename(const char *from, const char *to) {
    if (w == NULL || !w->host_runs || strncmp(to, w->folder, strlen(w->folder)) != 0) {
        return (int)syscall(SYS_rename, from, to);
    }
    size_t none = 0;
    const int code = happens(&none, false);
    if (code > 0) {
        errno = code;
        return -1;
    }
    const int result = (int)syscall(SYS_rename, from, to);
    if (result == 0 && power_matters()) {
        change *c = add();
        snprintf(c->path, sizeof c->path, "%s", to);
        snprintf(c->former, sizeof c->former, "%s", from);
    }
    if (code < 0) {
        _exit(137);
    }
    return result;
}

static mode_t mode_of(int flags, va_list arguments) {
    return flags & (O_CREAT | O_TMPFILE) ? va_arg(arguments, mode_t) : 0;
}

int open(const char *path, int flags, ...) {
    va_list arguments;
    va_start(arguments, flags);
    const mode_t mode = mode_of(flags, arguments);
    va_end(arguments);
    const int fd = w != NULL ? line_open(path) : -2;
    return fd != -2 ? fd : real_open(AT_FDCWD, path, flags, mode);
}

int close(int fd) {
    line_close(fd);
    return (int)syscall(SYS_close, fd);
}
