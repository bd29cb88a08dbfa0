// SPDX-License-Identifier: BSD-3-Clause
// A trace: every change of files and folders, in the order in which they happen, with what is written.
#include <fcntl.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#include "tests/durability/trap.h"

static int trace_fd = -1;
static atomic_flag busy = ATOMIC_FLAG_INIT;

bool trap_trace_open(const char *path) {
    const int fd = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    if (fd < 0) {
        return false;
    }
    trace_fd = fcntl(fd, F_DUPFD_CLOEXEC, 500); // away from the numbers that the program sees
    close(fd);
    return trace_fd >= 0;
}

static void record(shim_record *r, const char *name, const char *name2, const void *data, size_t n) {
    r->name_size = (uint16_t)(strlen(name) + 1);
    r->name2_size = (uint16_t)(strlen(name2) + 1);
    r->data_size = (uint32_t)n;
    r->size = (uint32_t)(sizeof *r + r->name_size + r->name2_size + n);
    const struct iovec parts[] = {{r, sizeof *r},
                                  {(void *)(uintptr_t)name, r->name_size},
                                  {(void *)(uintptr_t)name2, r->name2_size},
                                  {(void *)(uintptr_t)data, n}};
    trap_raw(SYS_writev, trace_fd, (long)parts, 4, 0, 0, 0);
}

static uint64_t inode_at(long folder, const char *path, int flags, int64_t *size) {
    struct stat info;
    const bool known = trap_raw(SYS_newfstatat, folder, (long)path, (long)&info, flags, 0, 0) == 0;
    if (size != NULL) {
        *size = known ? (int64_t)info.st_size : 0;
    }
    return known ? info.st_ino : 0;
}
static uint64_t inode_of(const char *path) { return inode_at(AT_FDCWD, path, AT_SYMLINK_NOFOLLOW, NULL); }
static uint64_t inode_of_fd(long fd, int64_t *size) { return inode_at(fd, "", AT_EMPTY_PATH, size); }

// Cut a path in two; the folder's inode comes back.
static uint64_t folder_of(const char *path, const char **name) {
    char folder[SHIM_PATH];
    const char *slash = strrchr(path, '/');
    if (slash == NULL) {
        *name = path;
        return 0;
    }
    memcpy(folder, path, (size_t)(slash - path));
    folder[slash - path] = 0;
    *name = slash + 1;
    return inode_of(folder[0] != 0 ? folder : "/");
}

static void record_made(const char *path, uint64_t inode, bool is_folder) {
    const char *name;
    shim_record r = {.kind = SHIM_R_MAKE, .inode = inode, .is_folder = is_folder};
    r.folder = folder_of(path, &name);
    record(&r, name, "", NULL, 0);
}

static void record_open(const trap_call *call, const long *a, const char *path, bool existed, long fd) {
    const long flags = call->number == SYS_openat ? a[2] : call->kind == SHIM_CREATE ? O_CREAT | O_TRUNC : a[1];
    shim_record r = {.inode = inode_of_fd(fd, NULL)};
    if ((flags & O_TMPFILE) == O_TMPFILE) {
        r.kind = SHIM_R_MAKE;
        record(&r, "", "", NULL, 0);
    } else if (!existed) {
        record_made(path, r.inode, false);
    } else if (flags & O_TRUNC) {
        r.kind = SHIM_R_SIZE;
        record(&r, "", "", NULL, 0);
    }
}

static void record_write(const trap_call *call, const long *a, long n) {
    shim_record r = {.kind = SHIM_R_DATA, .inode = inode_of_fd(a[0], NULL)};
    r.offset = call->number == SYS_pwrite64 ? a[3] : trap_raw(SYS_lseek, a[0], 0, SEEK_CUR, 0, 0, 0) - n;
    if (call->number != SYS_writev) {
        record(&r, "", "", (const void *)a[1], (size_t)n);
        return;
    }
    const struct iovec *part = (const struct iovec *)a[1];
    for (long left = n; left > 0; part++) {
        const long now = (long)part->iov_len < left ? (long)part->iov_len : left;
        record(&r, "", "", part->iov_base, (size_t)now);
        r.offset += now;
        left -= now;
    }
}

static bool renames(int number) {
#ifdef SYS_rename
    if (number == SYS_rename) {
        return true;
    }
#endif
#ifdef SYS_renameat
    if (number == SYS_renameat) {
        return true;
    }
#endif
    return number == SYS_renameat2;
}

static bool removes(int number) {
#ifdef SYS_unlink
    if (number == SYS_unlink || number == SYS_rmdir) {
        return true;
    }
#endif
    return number == SYS_unlinkat;
}

static void record_name(const trap_call *call, const long *a, char paths[2][SHIM_PATH]) {
    const char *name, *name2 = "";
    shim_record r = {.folder = folder_of(paths[0], &name)};
    if (removes(call->number)) {
        r.kind = SHIM_R_UNLINK;
    } else if (renames(call->number)) {
        r.kind = call->number == SYS_renameat2 && a[4] & RENAME_EXCHANGE ? SHIM_R_EXCHANGE : SHIM_R_RENAME;
        r.folder2 = folder_of(paths[1], &name2);
    } else if (call->path2 >= 0) { // a further link
        r.kind = SHIM_R_LINK;
        r.folder = folder_of(paths[1], &name);
        r.inode = inode_of(paths[1]);
    } else {
        struct stat info = {0};
        trap_raw(SYS_newfstatat, AT_FDCWD, (long)paths[0], (long)&info, AT_SYMLINK_NOFOLLOW, 0, 0);
        record_made(paths[0], info.st_ino, S_ISDIR(info.st_mode));
        return;
    }
    record(&r, name, name2, NULL, 0);
}

static void record_content(const trap_call *call, const long *a, const char *path) {
    shim_record r = {.kind = SHIM_R_SIZE};
    if (call->kind == SHIM_TRUNCATE) {
        r.inode = call->fd >= 0 ? inode_of_fd(a[0], &r.offset) : inode_at(AT_FDCWD, path, 0, &r.offset);
    } else if (call->kind == SHIM_MAP) {
        r.kind = SHIM_R_MAPPED;
        r.inode = inode_of_fd(a[4], NULL);
    } else if (call->number == SYS_fsync || call->number == SYS_fdatasync) {
        r.kind = SHIM_R_SYNC;
        r.inode = inode_of_fd(a[0], NULL);
    } else if (call->number == SYS_syncfs) {
        r.kind = SHIM_R_SYNC_ALL;
    } else {
        return; // sync_file_range promises nothing
    }
    record(&r, "", "", NULL, 0);
}

long trap_traced(const trap_call *call, const long *a, char paths[2][SHIM_PATH]) {
    const bool opens = call->kind == SHIM_OPEN || call->kind == SHIM_CREATE;
    const bool changes = opens || (call->kind & SHIM_CHANGES) != 0 || (call->kind == SHIM_MAP && a[2] & PROT_WRITE);
    if (!changes) {
        return trap_raw(call->number, a[0], a[1], a[2], a[3], a[4], a[5]);
    }
    while (atomic_flag_test_and_set(&busy)) {
        trap_raw(SYS_sched_yield, 0, 0, 0, 0, 0, 0);
    }
    const bool existed = opens && inode_of(paths[0]) != 0;
    const long result = trap_raw(call->number, a[0], a[1], a[2], a[3], a[4], a[5]);
    if (result >= 0 && opens) {
        record_open(call, a, paths[0], existed, result);
    } else if (result > 0 && call->kind == SHIM_WRITE) {
        record_write(call, a, result);
    } else if (result >= 0 && call->kind == SHIM_NAME) {
        record_name(call, a, paths);
    } else if (result >= 0 && call->kind != SHIM_WRITE) {
        record_content(call, a, paths[0]);
    }
    atomic_flag_clear(&busy);
    return result;
}
