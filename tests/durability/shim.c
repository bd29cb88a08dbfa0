// SPDX-License-Identifier: BSD-3-Clause
// Preloaded into the program: wait with everything loaded, fork for each command (shim.h).
#include <dlfcn.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "tests/durability/next.h"
#include "tests/durability/trap.h"

typedef int (*main_fn)(int argc, char **argv, char **environment);
typedef int (*clock_fn)(clockid_t clock, struct timespec *now);
typedef int (*day_fn)(struct timeval *now, void *zone);
typedef int (*start_fn)(main_fn main, int argc, char **argv, void (*init)(void), void (*fini)(void),
                        void (*linker_fini)(void), void *stack_end);

shim_shared *shim_memory;
#define shared shim_memory
static main_fn program_main;

static void redirect(const char *path, int fd) {
    const int file = open(path, O_WRONLY | O_CREAT | O_TRUNC, 0600);
    if (file < 0 || dup2(file, fd) < 0) {
        _exit(125);
    }
    close(file);
}

static int run_command(char **environment) {
    static char *argv[SHIM_ARGUMENTS + 1];
    for (int i = 0; i < shared->argc; i++) {
        argv[i] = shared->text + shared->arguments[i];
    }
    argv[shared->argc] = NULL;
    const int nothing = open("/dev/null", O_RDONLY);
    dup2(nothing, 0);
    close(nothing);
    redirect(shared->out, 1);
    redirect(shared->err, 2);
    if (shared->memory_bytes > 0) {
        const struct rlimit limit = {(rlim_t)shared->memory_bytes, (rlim_t)shared->memory_bytes};
        setrlimit(RLIMIT_AS, &limit);
    }
    if (chdir(shared->folder) != 0 || (shared->order.mode != SHIM_OFF && !trap_install(shared))) {
        _exit(125);
    }
    return program_main(shared->argc, argv, environment);
}

static bool tell(int fd, const void *what, size_t n) { return write(fd, what, n) == (ssize_t)n; }

// The child returns from here as the program's main; the parent serves until the harness goes away.
static int serve(int argc, char **argv, char **environment) {
    (void)argc;
    (void)argv;
    int requests, replies, status;
    char letter;
    if (sscanf(getenv(SHIM_ENVIRONMENT), "%*[^:]:%d:%d", &requests, &replies) != 2) {
        _exit(125);
    }
    unsetenv(SHIM_ENVIRONMENT);
    unsetenv("LD_PRELOAD");
    while (read(requests, &letter, 1) == 1) {
        const pid_t child = fork();
        if (child == 0) {
            close(requests);
            close(replies);
            return run_command(environment);
        }
        if (!tell(replies, &child, sizeof child) || wait4(child, &status, 0, &shared->usage) != child ||
            !tell(replies, &status, sizeof status)) {
            break;
        }
    }
    _exit(0);
}

int __libc_start_main(main_fn main, int argc, char **argv, void (*init)(void), void (*fini)(void),
                      void (*linker_fini)(void), void *stack_end);
int __libc_start_main(main_fn main, int argc, char **argv, void (*init)(void), void (*fini)(void),
                      void (*linker_fini)(void), void *stack_end) {
    NEXT(start_fn, start, "__libc_start_main")
    const char *told = getenv(SHIM_ENVIRONMENT);
    if (told == NULL) {
        return start(main, argc, argv, init, fini, linker_fini, stack_end);
    }
    char path[SHIM_PATH];
    const size_t n = strcspn(told, ":");
    snprintf(path, sizeof path, "%.*s", (int)n, told);
    const int fd = open(path, O_RDWR | O_CLOEXEC);
    void *memory = fd < 0 ? MAP_FAILED : mmap(NULL, sizeof *shared, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    if (memory == MAP_FAILED) {
        _exit(125);
    }
    close(fd);
    shared = memory;
    program_main = main;
    return start(serve, argc, argv, init, fini, linker_fini, stack_end);
}

// ---- the wall clock, which the vDSO tells without a system call ----

static int64_t jump_s(void) {
    return shared != NULL && shared->order.clock_at > 0 && trap_changes() >= shared->order.clock_at
               ? shared->order.clock_jump_s
               : 0;
}

int clock_gettime(clockid_t clock, struct timespec *now) {
    NEXT(clock_fn, next, "clock_gettime")
    const int result = next(clock, now);
    if (result == 0 && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) {
        now->tv_sec += jump_s();
    }
    return result;
}

int gettimeofday(struct timeval *restrict now, void *restrict zone) {
    NEXT(day_fn, next, "gettimeofday")
    const int result = next(now, zone);
    if (result == 0) {
        now->tv_sec += jump_s();
    }
    return result;
}

time_t time(time_t *out) {
    struct timespec now = {0};
    clock_gettime(CLOCK_REALTIME, &now);
    if (out != NULL) {
        *out = now.tv_sec;
    }
    return now.tv_sec;
}
