// SPDX-License-Identifier: BSD-3-Clause
// The handler of trapped system calls: count them, do them, let them fail, or die in them.
#include "tests/durability/trap.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdatomic.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <ucontext.h>
#include <unistd.h>

static shim_shared *shared;
static atomic_llong changes;

int64_t trap_changes(void) { return changes; }

static bool is_watched(const char *path) {
    const char *folder = shared->order.watched;
    const size_t n = strlen(folder);
    return n > 0 && strncmp(path, folder, n) == 0 && (path[n] == '/' || path[n] == 0);
}

static unsigned kind_of(const trap_call *call, const long *arguments) {
    if (call->kind != SHIM_OPEN) {
        return call->kind;
    }
    const long flags = arguments[call->path + 1];
    return flags & (O_CREAT | O_TRUNC) ? SHIM_CREATE : SHIM_OPEN;
}

static long raw(const trap_call *call, const long *a) {
    return trap_raw(call->number, a[0], a[1], a[2], a[3], a[4], a[5]);
}

static void note_hit(const char *path, unsigned kind) {
    static const char *const names[] = {"open", "create", "read", "write", "truncate", "sync",
                                        "name", "close",  "lock", "stat",  "map"};
    size_t k = 0, at = 0;
    while (k + 1 < sizeof names / sizeof *names && (kind >> k & 1) == 0) {
        k++;
    }
    for (const char *c = names[k]; *c != 0; c++) {
        shared->hit[at++] = *c;
    }
    shared->hit[at++] = ' ';
    for (const char *c = path; *c != 0 && at + 1 < sizeof shared->hit; c++) {
        shared->hit[at++] = *c;
    }
    shared->hit[at] = 0;
}

// A transfer of a part: at least one byte, at most all but one; -1 where it cannot be parted.
static long do_part(const trap_call *call, const long *arguments) {
    long a[6];
    memcpy(a, arguments, sizeof a);
    trap_call plain = *call;
    if (call->number == SYS_writev || call->number == SYS_readv) {
        const struct iovec *first = (const struct iovec *)a[1];
        plain.number = call->number == SYS_writev ? SYS_write : SYS_read;
        a[1] = (long)first->iov_base;
        a[2] = (long)first->iov_len;
    }
    const bool parts = plain.number == SYS_write || plain.number == SYS_pwrite64 || plain.number == SYS_read ||
                       plain.number == SYS_pread64;
    if (!parts || a[2] < 2) {
        return -1;
    }
    a[2] = 1 + (long)(shared->order.random % (uint64_t)(a[2] - 1));
    return raw(&plain, a);
}

static void die(void) {
    trap_raw(SYS_kill, trap_raw(SYS_getpid, 0, 0, 0, 0, 0, 0), SIGKILL, 0, 0, 0, 0);
    for (;;) { // until it arrives
    }
}

static long kill_in(const trap_call *call, const long *arguments) {
    const int part = shared->order.part;
    if (part == SHIM_AFTER || (part == SHIM_WITHIN && call->kind != SHIM_WRITE && shared->order.random & 1)) {
        raw(call, arguments);
    } else if (part == SHIM_WITHIN && call->kind == SHIM_WRITE) {
        do_part(call, arguments);
    }
    die();
    return 0;
}

static long fail_in(const trap_call *call, const long *arguments) {
    const int why = shared->order.error;
    if (why == 0) {
        const long part = do_part(call, arguments);
        return part != -1 ? part : raw(call, arguments);
    }
    if (call->kind == SHIM_CLOSE) {
        raw(call, arguments); // a close that fails has closed
    }
    return -why;
}

static long act(const trap_call *call, const long *arguments) {
    char paths[2][SHIM_PATH];
    trap_paths(call, arguments, paths);
    if (!is_watched(paths[0]) && !is_watched(paths[1])) {
        return raw(call, arguments);
    }
    const shim_order *order = &shared->order;
    const unsigned kind = kind_of(call, arguments);
    // Ways round write(): whoever uses them has another way where a file system lacks them.
    if (call->number == SYS_copy_file_range || call->number == SYS_sendfile || call->number == SYS_ioctl) {
        return call->number == SYS_copy_file_range ? -EXDEV : -EINVAL;
    }
    changes += (kind & SHIM_CHANGES) != 0;
    const int64_t n = kind & order->kinds ? __atomic_add_fetch(&shared->calls, 1, __ATOMIC_SEQ_CST) : 0;
    if (order->mode == SHIM_TRACE) {
        return trap_traced(call, arguments, paths);
    }
    if (n == 0 || n < order->at || (order->mode != SHIM_FAIL && order->mode != SHIM_KILL) ||
        n >= order->at + (order->mode == SHIM_KILL ? 1 : order->times)) {
        return raw(call, arguments);
    }
    if (__atomic_fetch_add(&shared->hits, 1, __ATOMIC_SEQ_CST) == 0) {
        note_hit(paths[0], kind);
    }
    return order->mode == SHIM_KILL ? kill_in(call, arguments) : fail_in(call, arguments);
}

// Whatever a thread blocks, SIGSYS stays free: a trap that meets a blocked signal ends the process.
static long set_mask(const long *arguments, uint64_t *mask) {
    const uint64_t *set = (const uint64_t *)arguments[1];
    uint64_t *former = (uint64_t *)arguments[2], now = *mask;
    if (set != NULL) {
        now = arguments[0] == SIG_BLOCK ? now | *set : arguments[0] == SIG_UNBLOCK ? now & ~*set : *set;
    }
    if (former != NULL) {
        *former = *mask;
    }
    *mask = now & ~(UINT64_C(1) << (SIGSYS - 1));
    return 0;
}

static void on_trap(int signal, siginfo_t *info, void *context) {
    (void)signal;
    ucontext_t *machine = context;
    const int number = info->si_syscall;
#if defined(__x86_64__)
    greg_t *r = machine->uc_mcontext.gregs;
    const long arguments[6] = {r[REG_RDI], r[REG_RSI], r[REG_RDX], r[REG_R10], r[REG_R8], r[REG_R9]};
#else
    unsigned long long *r = machine->uc_mcontext.regs;
    const long arguments[6] = {(long)r[0], (long)r[1], (long)r[2], (long)r[3], (long)r[4], (long)r[5]};
#endif
    const trap_call *call = trap_find(number);
    uint64_t mask;
    memcpy(&mask, &machine->uc_sigmask, sizeof mask);
    const long result = call != NULL                   ? act(call, arguments)
                        : number == SYS_rt_sigprocmask ? set_mask(arguments, &mask)
                                                       : -ENOSYS;
    memcpy(&machine->uc_sigmask, &mask, sizeof mask);
#if defined(__x86_64__)
    r[REG_RAX] = result;
#else
    r[0] = (unsigned long long)result;
#endif
}

bool trap_install(shim_shared *memory) {
    shared = memory;
    struct sigaction action = {.sa_flags = SA_SIGINFO | SA_NODEFER | SA_RESTART};
    action.sa_sigaction = on_trap;
    if (shared->order.mode == SHIM_TRACE && !trap_trace_open(shared->order.trace)) {
        return false;
    }
    return sigaction(SIGSYS, &action, NULL) == 0 && trap_filter();
}
