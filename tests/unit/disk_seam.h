// SPDX-License-Identifier: BSD-3-Clause
// The system calls by which a session changes or reads its files, SQLite's among them: each can be counted, and at a
// given one the process dies, or the call fails. The program's own definitions come before the C library's.
#pragma once
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

static struct {
    long calls;       // so many that change something
    long kill_at;     // die before this one; 0: never
    long fail_at;     // this one fails with fail_with; 0: none
    int fail_with;    //
    bool no_exchange; // a file system that only renames
    bool no_links;
    const char *bad_file; // reading (bad_open: opening) a file whose path ends so fails with bad_with ...
    bool bad_open;
    int bad_with, bad_times; // ... so many times
} seam;

// Before a call that changes something; true: it fails.
static bool seam_strikes(void) {
    seam.calls++;
    if (seam.kill_at > 0 && seam.calls == seam.kill_at) {
        kill(getpid(), SIGKILL);
    }
    if (seam.fail_at > 0 && seam.calls == seam.fail_at) {
        errno = seam.fail_with;
        return true;
    }
    return false;
}

static bool seam_is_bad(const char *path) {
    const size_t n = strlen(path), m = seam.bad_file != NULL ? strlen(seam.bad_file) : 0;
    if (m == 0 || n < m || strcmp(path + n - m, seam.bad_file) != 0 || seam.bad_times == 0) {
        return false;
    }
    seam.bad_times--;
    errno = seam.bad_with;
    return true;
}

static int seam_open(int folder, const char *path, int flags, mode_t mode) {
    if (((flags & O_CREAT) != 0 && seam_strikes()) || (seam.bad_open && seam_is_bad(path))) {
        return -1;
    }
    return (int)syscall(SYS_openat, folder, path, flags, mode);
}

int openat(int folder, const char *path, int flags, ...) {
    va_list arguments;
    va_start(arguments, flags);
    const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(arguments, mode_t) : 0;
    va_end(arguments);
    return seam_open(folder, path, flags, mode);
}

ssize_t read(int fd, void *to, size_t n) {
    if (seam.bad_file != NULL && !seam.bad_open) {
        char link[40], path[512];
        snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
        const ssize_t size = readlink(link, path, sizeof path - 1);
        path[size > 0 ? size : 0] = 0;
        if (seam_is_bad(path)) {
            return -1;
        }
    }
    return (ssize_t)syscall(SYS_read, fd, to, n);
}

ssize_t write(int fd, const void *from, size_t n) {
    return fd > 2 && seam_strikes() ? -1 : (ssize_t)syscall(SYS_write, fd, from, n);
}

ssize_t pwrite64(int fd, const void *from, size_t n, off64_t at) {
    return seam_strikes() ? -1 : (ssize_t)syscall(SYS_pwrite64, fd, from, n, at);
}

// Counted, but not waited for: no power goes here.
int fsync(int fd) {
    (void)fd;
    return seam_strikes() ? -1 : 0;
}
int fdatasync(int fd) { return fsync(fd); }
int fchmod(int fd, mode_t mode) { return seam_strikes() ? -1 : (int)syscall(SYS_fchmod, fd, mode); }

int mkdirat(int folder, const char *name, mode_t mode) {
    return seam_strikes() ? -1 : (int)syscall(SYS_mkdirat, folder, name, mode);
}

int unlinkat(int folder, const char *name, int flags) {
    return seam_strikes() ? -1 : (int)syscall(SYS_unlinkat, folder, name, flags);
}

int linkat(int from, const char *name, int to, const char *new_name, int flags) {
    if (seam.no_links) {
        errno = EPERM;
        return -1;
    }
    return seam_strikes() ? -1 : (int)syscall(SYS_linkat, from, name, to, new_name, flags);
}

int renameat2(int from, const char *name, int to, const char *new_name, unsigned flags) {
    if (seam.no_exchange && flags != 0) {
        errno = EINVAL;
        return -1;
    }
    return seam_strikes() ? -1 : (int)syscall(SYS_renameat2, from, name, to, new_name, flags);
}

int renameat(int from, const char *name, int to, const char *new_name) {
    return seam_strikes() ? -1 : (int)syscall(SYS_renameat2, from, name, to, new_name, 0);
}
