// SPDX-License-Identifier: BSD-3-Clause
#include "tests/durability/run.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

bool run_told;

struct runner {
    shim_shared *shared;
    pid_t server, child;
    int requests, replies;
    int bound_s;
    char folder[SHIM_PATH];
};

static double processor_s;
static int64_t runs;
double run_processor_s(void) { return processor_s; }
int64_t run_count(void) { return runs; }

static shim_shared *share(const char *path) {
    const int fd = open(path, O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    if (fd < 0 || ftruncate(fd, sizeof(shim_shared)) != 0) {
        return NULL;
    }
    void *memory = mmap(NULL, sizeof(shim_shared), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    close(fd);
    return memory == MAP_FAILED ? NULL : memory;
}

static void become(const runner *r, const char *program, const char *shim, int requests, int replies) {
    char told[SHIM_PATH + 40];
    snprintf(told, sizeof told, "%s/shared:%d:%d", r->folder, requests, replies);
    setenv(SHIM_ENVIRONMENT, told, 1);
    setenv("LD_PRELOAD", shim, 1);
    setenv("OPENBLAS_NUM_THREADS", "1", 1); // no threads before a fork
    setenv("OMP_NUM_THREADS", "1", 1);
    setenv("TZ", "UTC", 1);
    execl(program, program, (char *)NULL);
    _exit(125);
}

runner *runner_start(const char *program, const char *shim, const char *folder) {
    runner *r = calloc(1, sizeof *r);
    int down[2], up[2];
    if (r == NULL || pipe(down) != 0 || pipe(up) != 0) {
        abort();
    }
    snprintf(r->folder, sizeof r->folder, "%s", folder);
    char path[SHIM_PATH + 16];
    snprintf(path, sizeof path, "%s/shared", folder);
    r->shared = share(path);
    if (r->shared == NULL) {
        free(r);
        return NULL;
    }
    snprintf(r->shared->folder, sizeof r->shared->folder, "%s", folder);
    r->server = fork();
    if (r->server == 0) {
        close(down[1]);
        close(up[0]);
        become(r, program, shim, down[0], up[1]);
    }
    close(down[0]);
    close(up[1]);
    r->bound_s = RUN_BOUND_S;
    r->requests = down[1];
    r->replies = up[0];
    fcntl(r->requests, F_SETFD, FD_CLOEXEC);
    fcntl(r->replies, F_SETFD, FD_CLOEXEC);
    return r;
}

void runner_stop(runner *r) {
    if (r != NULL) {
        close(r->requests);
        close(r->replies);
        waitpid(r->server, NULL, 0);
        munmap(r->shared, sizeof *r->shared);
        free(r);
    }
}

void runner_set(runner *r, const char *working_folder, int64_t memory_bytes) {
    snprintf(r->shared->folder, sizeof r->shared->folder, "%s", working_folder != NULL ? working_folder : r->folder);
    r->shared->memory_bytes = memory_bytes;
}

void runner_bound(runner *r, int seconds) { r->bound_s = seconds; }

static void put_command(shim_shared *s, const char *const *command) {
    size_t at = 0;
    s->argc = 0;
    for (int i = -1; i < 0 || command[i] != NULL; i++) {
        const char *word = i < 0 ? "gonio" : command[i];
        const size_t n = strlen(word) + 1;
        if (s->argc == SHIM_ARGUMENTS || at + n > sizeof s->text) {
            abort();
        }
        s->arguments[s->argc++] = (unsigned)at;
        memcpy(s->text + at, word, n);
        at += n;
    }
}

static void tell_command(const shim_shared *s) {
    for (int i = 0; i < s->argc; i++) {
        printf("%s%s", i == 0 ? "  $ " : " ", s->text + s->arguments[i]);
    }
    printf("\n");
    fflush(stdout);
}

void run_begin(runner *r, const shim_order *order, const char *const *command) {
    shim_shared *s = r->shared;
    s->order = order != NULL ? *order : (shim_order){.mode = SHIM_PASS};
    put_command(s, command);
    snprintf(s->out, sizeof s->out, "%.1000s/out", r->folder);
    snprintf(s->err, sizeof s->err, "%.1000s/err", r->folder);
    s->calls = s->hits = 0;
    s->hit[0] = 0;
    memset(s->timers_ns, 0, sizeof s->timers_ns);
    if (run_told) {
        tell_command(s);
    }
    if (write(r->requests, "r", 1) != 1 || read(r->replies, &r->child, sizeof r->child) != sizeof r->child) {
        fprintf(stderr, "the waiting program has gone\n");
        exit(1);
    }
}

bool run_is_over(runner *r) {
    struct pollfd wait = {.fd = r->replies, .events = POLLIN};
    return poll(&wait, 1, 0) == 1;
}

void run_until(runner *r, int64_t calls) {
    while (!run_is_over(r) && __atomic_load_n(&r->shared->calls, __ATOMIC_SEQ_CST) < calls) {
        poll(NULL, 0, 1);
    }
}

void run_signal(runner *r, int signal) {
    if (!run_is_over(r)) {
        kill(r->child, signal);
    }
}

static char *read_file(const char *path) {
    FILE *file = fopen(path, "r");
    char *text = NULL;
    size_t n = 0;
    if (file == NULL || getdelim(&text, &n, 0, file) < 0) {
        free(text);
        text = NULL;
    }
    if (file != NULL) {
        fclose(file);
    }
    return text;
}

static void last_line(char *text, char *line, size_t room) {
    for (size_t n = strlen(text); n > 0 && (text[n - 1] == '\n' || text[n - 1] == '\r'); n--) {
        text[n - 1] = 0;
    }
    const char *at = strrchr(text, '\n');
    snprintf(line, room, "%s", at != NULL ? at + 1 : text);
}

static void read_output(runner *r, run_result *result) {
    const json_t *error = NULL;
    char *out = read_file(r->shared->out), *err = read_file(r->shared->err);
    result->json = out != NULL ? json_loads(out, 0, NULL) : NULL;
    error = json_object_get(json_object_get(result->json, "error"), "message");
    if (json_string_value(error) != NULL) {
        snprintf(result->message, sizeof result->message, "%s", json_string_value(error));
    } else if (err != NULL) {
        last_line(err, result->message, sizeof result->message);
    }
    if (run_told && err != NULL) {
        printf("%s\n", err);
    }
    if (run_told && run_text(result, "detail")[0] != 0) {
        printf("%s", run_text(result, "detail"));
    }
    free(out);
    free(err);
}

void run_end(runner *r, run_result *result) {
    *result = (run_result){0};
    struct pollfd wait = {.fd = r->replies, .events = POLLIN};
    int status;
    if (poll(&wait, 1, r->bound_s * 1000) != 1) {
        kill(r->child, SIGKILL);
        result->hangs = true;
    }
    if (read(r->replies, &status, sizeof status) != sizeof status) {
        fprintf(stderr, "the waiting program has gone\n");
        exit(1);
    }
    const struct rusage *u = &r->shared->usage;
    result->processor_s =
        (double)(u->ru_utime.tv_sec + u->ru_stime.tv_sec) + 1e-6 * (double)(u->ru_utime.tv_usec + u->ru_stime.tv_usec);
    processor_s += result->processor_s;
    runs++;
    result->status = WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
    result->calls = r->shared->calls;
    result->hits = r->shared->hits;
    memcpy(result->timers_ns, r->shared->timers_ns, sizeof result->timers_ns);
    snprintf(result->hit, sizeof result->hit, "%.255s", r->shared->hit);
    read_output(r, result);
    if (run_told) {
        printf("  = %d%s %s%s%s\n", result->status, result->hangs ? " HANGS" : "", result->message,
               result->hits > 0 ? "; hit: " : "", result->hit);
    }
    if (result->status == 125) {
        fprintf(stderr, "the preloaded library could not do its work: no seccomp filters here?\n");
        exit(RUN_IMPOSSIBLE);
    }
}

void run(runner *r, const shim_order *order, const char *const *command, run_result *result) {
    run_begin(r, order, command);
    run_end(r, result);
}

void run_free(run_result *result) {
    json_decref(result->json);
    result->json = NULL;
}

const char *run_text(const run_result *result, const char *key) {
    const char *text = json_string_value(json_object_get(result->json, key));
    return text != NULL ? text : "";
}
