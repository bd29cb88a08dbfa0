// SPDX-License-Identifier: BSD-3-Clause
// The system calls on files, the filter that traps them, and the way round it.
#include <errno.h>
#include <fcntl.h>
#include <linux/filter.h>
#include <linux/fs.h>
#include <linux/seccomp.h>
#include <stddef.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>

#include "tests/durability/trap.h"

const trap_call trap_calls[] = {
    {SYS_openat, SHIM_OPEN, -1, 0, 1, -1, -1},
    {SYS_read, SHIM_READ, 0, -1, -1, -1, -1},
    {SYS_pread64, SHIM_READ, 0, -1, -1, -1, -1},
    {SYS_readv, SHIM_READ, 0, -1, -1, -1, -1},
    {SYS_getdents64, SHIM_READ, 0, -1, -1, -1, -1},
    {SYS_write, SHIM_WRITE, 0, -1, -1, -1, -1},
    {SYS_pwrite64, SHIM_WRITE, 0, -1, -1, -1, -1},
    {SYS_writev, SHIM_WRITE, 0, -1, -1, -1, -1},
    {SYS_copy_file_range, SHIM_WRITE, 2, -1, -1, -1, -1},
    {SYS_sendfile, SHIM_WRITE, 0, -1, -1, -1, -1},
    {SYS_ioctl, SHIM_WRITE, 0, -1, -1, -1, -1},
    {SYS_ftruncate, SHIM_TRUNCATE, 0, -1, -1, -1, -1},
    {SYS_truncate, SHIM_TRUNCATE, -1, -1, 0, -1, -1},
    {SYS_fallocate, SHIM_TRUNCATE, 0, -1, -1, -1, -1},
    {SYS_fsync, SHIM_SYNC, 0, -1, -1, -1, -1},
    {SYS_fdatasync, SHIM_SYNC, 0, -1, -1, -1, -1},
    {SYS_sync_file_range, SHIM_SYNC, 0, -1, -1, -1, -1},
    {SYS_syncfs, SHIM_SYNC, 0, -1, -1, -1, -1},
    {SYS_mkdirat, SHIM_NAME, -1, 0, 1, -1, -1},
    {SYS_unlinkat, SHIM_NAME, -1, 0, 1, -1, -1},
    {SYS_symlinkat, SHIM_NAME, -1, 1, 2, -1, -1},
    {SYS_linkat, SHIM_NAME, -1, 0, 1, 2, 3},
    {SYS_renameat2, SHIM_NAME, -1, 0, 1, 2, 3},
    {SYS_close, SHIM_CLOSE, 0, -1, -1, -1, -1},
    {SYS_flock, SHIM_LOCK, 0, -1, -1, -1, -1},
    {SYS_newfstatat, SHIM_LOOK, -1, 0, 1, -1, -1},
    {SYS_statx, SHIM_LOOK, -1, 0, 1, -1, -1},
    {SYS_faccessat, SHIM_LOOK, -1, 0, 1, -1, -1},
    {SYS_faccessat2, SHIM_LOOK, -1, 0, 1, -1, -1},
    {SYS_mmap, SHIM_MAP, 4, -1, -1, -1, -1},
#ifdef SYS_renameat
    {SYS_renameat, SHIM_NAME, -1, 0, 1, 2, 3},
#endif
#ifdef SYS_open // machines older than the *at calls
    {SYS_open, SHIM_OPEN, -1, -1, 0, -1, -1},
    {SYS_creat, SHIM_CREATE, -1, -1, 0, -1, -1},
    {SYS_mkdir, SHIM_NAME, -1, -1, 0, -1, -1},
    {SYS_rmdir, SHIM_NAME, -1, -1, 0, -1, -1},
    {SYS_unlink, SHIM_NAME, -1, -1, 0, -1, -1},
    {SYS_symlink, SHIM_NAME, -1, -1, 1, -1, -1},
    {SYS_link, SHIM_NAME, -1, -1, 0, -1, 1},
    {SYS_rename, SHIM_NAME, -1, -1, 0, -1, 1},
    {SYS_stat, SHIM_LOOK, -1, -1, 0, -1, -1},
    {SYS_lstat, SHIM_LOOK, -1, -1, 0, -1, -1},
    {SYS_access, SHIM_LOOK, -1, -1, 0, -1, -1},
    {SYS_fstat, SHIM_LOOK, 0, -1, -1, -1, -1},
#endif
};
const int trap_calls_n = sizeof trap_calls / sizeof *trap_calls;

const trap_call *trap_find(int number) {
    for (int i = 0; i < trap_calls_n; i++) {
        if (trap_calls[i].number == number) {
            return &trap_calls[i];
        }
    }
    return NULL;
}

// The one place whose system calls the filter lets pass: it knows the address after the instruction.
extern const char trap_stub_after[];
long trap_stub(long number, long a, long b, long c, long d, long e, long f);
#if defined(__x86_64__)
__asm__(".text\n"
        "trap_stub:\n"
        "  mov %rdi, %rax\n  mov %rsi, %rdi\n  mov %rdx, %rsi\n  mov %rcx, %rdx\n"
        "  mov %r8, %r10\n  mov %r9, %r8\n  mov 8(%rsp), %r9\n"
        "  syscall\n"
        "trap_stub_after:\n"
        "  ret\n");
#elif defined(__aarch64__)
__asm__(".text\n"
        "trap_stub:\n"
        "  mov x8, x0\n  mov x0, x1\n  mov x1, x2\n  mov x2, x3\n  mov x3, x4\n  mov x4, x5\n  mov x5, x6\n"
        "  svc #0\n"
        "trap_stub_after:\n"
        "  ret\n");
#else
#error "the durability campaign knows the system calls of x86-64 and arm64"
#endif

long trap_raw(long number, long a, long b, long c, long d, long e, long f) {
    return trap_stub(number, a, b, c, d, e, f);
}

// ---- the filter ----

enum { FILTER_ROOM = 160 };
static struct sock_filter filter[FILTER_ROOM];
static unsigned short filter_n;

static void add(unsigned short code, uint32_t k, unsigned char yes, unsigned char no) {
    filter[filter_n++] = (struct sock_filter){code, yes, no, k};
}

static void load(size_t offset) { add(BPF_LD | BPF_W | BPF_ABS, (uint32_t)offset, 0, 0); }
static void answer(uint32_t what) { add(BPF_RET | BPF_K, what, 0, 0); }

// Trap this call only where an argument's low word has one of the bits, or is the value.
static void trap_where(int number, unsigned short test, int argument, uint32_t k) {
    add(BPF_JMP | BPF_JEQ | BPF_K, (uint32_t)number, 0, 4);
    load(offsetof(struct seccomp_data, args) + 8 * (size_t)argument);
    add((unsigned short)(BPF_JMP | test | BPF_K), k, 0, 1);
    answer(SECCOMP_RET_TRAP);
    answer(SECCOMP_RET_ALLOW);
}

bool trap_filter(void) {
    const uint64_t after = (uint64_t)(uintptr_t)trap_stub_after;
    load(offsetof(struct seccomp_data, instruction_pointer));
    add(BPF_JMP | BPF_JEQ | BPF_K, (uint32_t)after, 0, 3);
    load(offsetof(struct seccomp_data, instruction_pointer) + 4);
    add(BPF_JMP | BPF_JEQ | BPF_K, (uint32_t)(after >> 32), 0, 1);
    answer(SECCOMP_RET_ALLOW);
    load(offsetof(struct seccomp_data, nr));
    trap_where(SYS_mmap, BPF_JSET, 3, MAP_SHARED);
    trap_where(SYS_ioctl, BPF_JEQ, 1, FICLONE);
    for (int i = 0; i < trap_calls_n; i++) {
        add(BPF_JMP | BPF_JEQ | BPF_K, (uint32_t)trap_calls[i].number, 0, 1);
        answer(SECCOMP_RET_TRAP);
    }
    add(BPF_JMP | BPF_JEQ | BPF_K, SYS_rt_sigprocmask, 0, 1);
    answer(SECCOMP_RET_TRAP);
    answer(SECCOMP_RET_ALLOW);
    const struct sock_fprog program = {filter_n, filter};
    return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 && prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0;
}

// ---- paths ----

static size_t put(char *path, size_t at, const char *text) {
    while (*text != 0 && at + 1 < SHIM_PATH) {
        path[at++] = *text++;
    }
    path[at] = 0;
    return at;
}

static size_t put_link(char *path, const char *prefix, long fd) {
    char link[64], digits[24];
    size_t n = sizeof digits - 1;
    digits[n] = 0;
    for (long rest = fd; n == sizeof digits - 1 || rest > 0; rest /= 10) {
        digits[--n] = (char)('0' + rest % 10);
    }
    size_t at = 0;
    for (const char *c = prefix; *c != 0; c++) {
        link[at++] = *c;
    }
    memcpy(link + at, digits + n, sizeof digits - n);
    const long got = trap_raw(SYS_readlinkat, AT_FDCWD, (long)link, (long)path, SHIM_PATH - 1, 0, 0);
    path[got > 0 ? got : 0] = 0;
    char *gone = strstr(path, " (deleted)");
    if (gone != NULL) {
        *gone = 0;
    }
    return strlen(path);
}

// Of a descriptor; AT_FDCWD is the working folder.
static size_t put_descriptor(char *path, long fd) {
    if ((int)fd == AT_FDCWD) {
        const long got = trap_raw(SYS_readlinkat, AT_FDCWD, (long)"/proc/self/cwd", (long)path, SHIM_PATH - 1, 0, 0);
        path[got > 0 ? got : 0] = 0;
        return strlen(path);
    }
    return fd < 0 ? (size_t)(path[0] = 0) : put_link(path, "/proc/self/fd/", fd);
}

static void put_path(char *path, long folder, const char *name) {
    static const char own[] = "/proc/self/fd/";
    size_t at = 0;
    if (name == NULL) {
        return;
    }
    if (strncmp(name, own, sizeof own - 1) == 0) { // a descriptor under another name
        long fd = 0;
        for (name += sizeof own - 1; *name >= '0' && *name <= '9'; name++) {
            fd = 10 * fd + (*name - '0');
        }
        at = put_descriptor(path, fd);
    } else if (name[0] != '/') {
        at = put_descriptor(path, folder);
        at = name[0] != 0 ? put(path, at, "/") : at;
    }
    at = put(path, at, name);
    while (at > 1 && path[at - 1] == '/') {
        path[--at] = 0;
    }
}

void trap_paths(const trap_call *call, const long *arguments, char paths[2][SHIM_PATH]) {
    paths[0][0] = paths[1][0] = 0;
    if (call->fd >= 0) {
        put_descriptor(paths[0], (int)arguments[call->fd]);
        return;
    }
    if (call->path >= 0) {
        put_path(paths[0], call->folder >= 0 ? arguments[call->folder] : AT_FDCWD, (const char *)arguments[call->path]);
    }
    if (call->path2 >= 0) {
        put_path(paths[1], call->folder2 >= 0 ? arguments[call->folder2] : AT_FDCWD,
                 (const char *)arguments[call->path2]);
    }
}
