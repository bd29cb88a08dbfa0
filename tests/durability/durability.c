// SPDX-License-Identifier: BSD-3-Clause
// The durability campaign: the real program's verbs, killed, cut off from power, failed by the disk, on damaged
// sessions. What a session once promised is there afterwards, and what is not there is told (docs/reliability.md).
#include <errno.h>
#include <limits.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "tests/durability/campaign.h"
#include "tests/durability/cost.h"

static const campaign campaigns[] = {
    {"situations", "situations: writers and readers beside, clocks, copies, paths", case_situation, 0},
    {"kill", "kill -9", case_kill, 1000},
    {"strict", "power cuts, strict POSIX", case_cut_strict, 500},
    {"ordered", "power cuts, like ext4", case_cut_ordered, 500},
    {"enospc", "ENOSPC", case_enospc, 300},
    {"eio", "EIO", case_eio, 300},
    {"eintr", "EINTR", case_eintr, 300},
    {"emfile", "EMFILE", case_emfile, 300},
    {"eacces", "EACCES", case_eacces, 300},
    {"short", "short transfers", case_short, 300},
    {"damage", "damages", case_damage, 10000},
};
enum { CAMPAIGNS = sizeof campaigns / sizeof *campaigns, JOBS_MAX = 64 };

typedef struct options {
    const char *program, *shim, *only, *report, *root, *cost;
    long long seed, first;
    int count, jobs, seconds; // count 0: full; seconds: stop after so many, 0: never
} options;

static const char *const outcome_names[OUTCOMES] = {"pending", "same",     "named",  "dead",  "detected",
                                                    "refused", "harmless", "missed", "FAILED"};

static double wall_s(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static int count_of(const campaign *c, const options *o) {
    if (c->one == case_situation) {
        return situations_count() * (o->count > 0 ? 1 : 10);
    }
    return o->count > 0 ? o->count : c->full;
}

static void one_case(worker *w, const campaign *c, uint64_t seed, verdict *v) {
    *v = (verdict){0};
    w->verdict = v;
    w->salt = (uint64_t)(c - campaigns) << 40;
    const double before = run_processor_s();
    c->one(w, seed);
    v->processor_s = run_processor_s() - before;
    if (case_failed(w)) {
        v->outcome = OUT_FAILED;
    }
}

static void work(const options *o, const campaign *c, int job, int count, verdict *verdicts, double until) {
    worker w;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    worker_start(&w, o->root, job, o->program, o->shim);
    for (int i = job; i < count && (until == 0 || wall_s() < until); i += o->jobs) {
        verdict v;
        one_case(&w, c, (uint64_t)(o->first + i), &v);
        const int outcome = v.outcome;
        v.outcome = OUT_PENDING;
        verdicts[i] = v;
        __atomic_store_n(&verdicts[i].outcome, outcome, __ATOMIC_RELEASE);
    }
    worker_stop(&w);
    exit(0);
}

typedef struct sum {
    int outcomes[OUTCOMES];
    int done, hit;
    double processor_s;
} sum;

static sum add_up(const verdict *verdicts, int count) {
    sum s = {0};
    for (int i = 0; i < count; i++) {
        const int outcome = __atomic_load_n(&verdicts[i].outcome, __ATOMIC_ACQUIRE);
        s.outcomes[outcome]++;
        s.done += outcome != OUT_PENDING;
        s.hit += outcome != OUT_PENDING && outcome != OUT_MISSED;
        s.processor_s += outcome != OUT_PENDING ? verdicts[i].processor_s : 0;
    }
    return s;
}

static void tell_failures(const campaign *c, const options *o, const verdict *verdicts, int count, bool *told) {
    for (int i = 0; i < count; i++) {
        if (!told[i] && __atomic_load_n(&verdicts[i].outcome, __ATOMIC_ACQUIRE) == OUT_FAILED) {
            told[i] = true;
            printf("# FAILED %s %lld: %s: %s\n", c->name, o->first + i, verdicts[i].story, verdicts[i].trouble);
        }
    }
}

static void tell_counts(const campaign *c, const options *o, const sum *s, int count) {
    printf("%s: %d of %d, seeds from %lld, %d hit:", c->what, s->done, count, o->first, s->hit);
    for (int i = 1; i < OUTCOMES; i++) {
        if (s->outcomes[i] > 0 || i == OUT_FAILED) {
            printf(" %d %s", s->outcomes[i], outcome_names[i]);
        }
    }
    printf("; %.0f s of a processor\n", s->processor_s);
    fflush(stdout);
}

// Tell what fails and how far it is until all workers have ended; how many of them died.
static int watch(const campaign *c, const options *o, const verdict *verdicts, int count) {
    bool *told = calloc((size_t)count, sizeof *told);
    int alive = o->jobs, died = 0;
    double next = wall_s() + 15;
    while (alive > 0) {
        int status;
        const pid_t pid = waitpid(-1, &status, WNOHANG);
        alive -= pid > 0;
        if (pid > 0 && (!WIFEXITED(status) || WEXITSTATUS(status) != 0)) {
            printf("# FAILED %s: a worker of the harness died (%d)\n", c->name, status);
            died++;
        }
        if (pid == 0) {
            poll(NULL, 0, 20);
        }
        tell_failures(c, o, verdicts, count, told);
        if (wall_s() > next) {
            const sum s = add_up(verdicts, count);
            printf("# ... ");
            tell_counts(c, o, &s, count);
            next = wall_s() + 15;
        }
    }
    free(told);
    return died;
}

// All cases of a campaign, with a line of TAP; how many failed.
static int run_campaign(const campaign *c, const options *o, int number, double until, FILE *report) {
    const int count = count_of(c, o);
    const size_t size = (size_t)count * sizeof(verdict);
    verdict *verdicts = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    for (int job = 0; job < o->jobs; job++) {
        fflush(stdout);
        if (fork() == 0) {
            work(o, c, job, count, verdicts, until);
        }
    }
    const int died = watch(c, o, verdicts, count);
    const sum s = add_up(verdicts, count);
    const int failed = died + s.outcomes[OUT_FAILED];
    printf("%s %d - ", failed == 0 ? "ok" : "not ok", number);
    tell_counts(c, o, &s, count);
    if (report != NULL) {
        fprintf(report, "| %s | %lld | %d | %d | %d | %d | %d | %d | %d | %d | %d |\n", c->what, o->first, s.done,
                s.outcomes[OUT_SAME], s.outcomes[OUT_NAMED], s.outcomes[OUT_DEAD], s.outcomes[OUT_DETECTED],
                s.outcomes[OUT_HARMLESS], s.outcomes[OUT_REFUSED], s.outcomes[OUT_MISSED], failed);
        fflush(report);
    }
    munmap(verdicts, size);
    return failed;
}

static bool is_wanted(const campaign *c, const options *o) {
    const size_t n = strlen(c->name);
    for (const char *at = o->only; at != NULL; at = strchr(at, ',')) {
        at += *at == ',';
        if (strncmp(at, c->name, n) == 0 && (at[n] == 0 || at[n] == ',')) {
            return true;
        }
    }
    return o->only == NULL;
}

static int run_all(const options *o) {
    const double begun = wall_s();
    FILE *report = o->report != NULL ? fopen(o->report, "w") : NULL;
    int failed = 0, left = 0, number = 0;
    for (int i = 0; i < CAMPAIGNS; i++) {
        left += is_wanted(&campaigns[i], o);
    }
    if (report != NULL) {
        fprintf(report, "| campaign | first seed | cases | same | named | dead | detected | harmless | refused | "
                        "missed | failed |\n"
                        "|---|---|---|---|---|---|---|---|---|---|---|\n");
    }
    for (int i = 0; i < CAMPAIGNS; i++) {
        if (is_wanted(&campaigns[i], o)) {
            const double now = wall_s(); // what is left is shared evenly
            const double until = o->seconds > 0 ? now + (begun + o->seconds - now) / left : 0;
            failed += run_campaign(&campaigns[i], o, ++number, until, report);
            left--;
        }
    }
    if (report != NULL) {
        fclose(report);
    }
    printf("1..%d\n# %d cases failed; make durability ONLY=NAME SEED=n repeats one\n", number, failed);
    return failed > 0;
}

static int run_one(const options *o) {
    worker w;
    verdict v;
    int failed = 0;
    worker_start(&w, o->root, 0, o->program, o->shim);
    run_told = true;
    for (int i = 0; i < CAMPAIGNS; i++) {
        if (is_wanted(&campaigns[i], o)) {
            printf("%s, seed %lld\n", campaigns[i].what, o->seed);
            one_case(&w, &campaigns[i], (uint64_t)o->seed, &v);
            printf("%s: %s: %s\n", v.story, outcome_names[v.outcome], v.trouble);
            failed += v.outcome == OUT_FAILED;
        }
    }
    worker_stop(&w);
    return failed > 0;
}

static bool read_options(int argc, char **argv, options *o) {
    *o = (options){.seed = -1, .first = 1, .jobs = (int)sysconf(_SC_NPROCESSORS_ONLN)};
    for (int i = 1; i + 1 < argc; i += 2) {
        const char *name = argv[i], *value = argv[i + 1];
        const long long number = strtoll(value, NULL, 10);
        if (strcmp(name, "--program") == 0) {
            o->program = value;
        } else if (strcmp(name, "--library") == 0) {
            o->shim = value;
        } else if (strcmp(name, "--only") == 0) {
            o->only = value;
        } else if (strcmp(name, "--report") == 0) {
            o->report = value;
        } else if (strcmp(name, "--cost") == 0) {
            o->cost = value;
        } else if (strcmp(name, "--seed") == 0) {
            o->seed = number;
        } else if (strcmp(name, "--first") == 0) {
            o->first = number;
        } else if (strcmp(name, "--count") == 0) {
            o->count = (int)number;
        } else if (strcmp(name, "--jobs") == 0) {
            o->jobs = (int)number;
        } else if (strcmp(name, "--seconds") == 0) {
            o->seconds = (int)number;
        } else {
            return false;
        }
    }
    return argc % 2 == 1 && o->program != NULL && o->shim != NULL && o->jobs > 0 && o->jobs <= JOBS_MAX;
}

static pid_t guarded;

static void pass_on(int signal) { kill(guarded, signal); }

// In a process of its own, so that whatever ends it, the folder goes.
static int run_guarded(const options *o) {
    int status;
    guarded = fork();
    if (guarded == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        const bool made = campaign_prepare(o->root, o->program, o->shim);
        exit(!made ? 1 : o->seed >= 0 ? run_one(o) : run_all(o));
    }
    signal(SIGINT, pass_on);
    signal(SIGTERM, pass_on);
    while (waitpid(guarded, &status, 0) < 0 && errno == EINTR) {
    }
    poll(NULL, 0, 50); // its workers die with it
    tree_remove(o->root);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

int main(int argc, char **argv) {
    options o;
    if (!read_options(argc, argv, &o)) {
        fprintf(stderr, "usage: durability --program GONIO --library SHIM [--only NAME,...] [--count N] [--first SEED]"
                        " [--seconds S] [--jobs N] [--report FILE] [--seed SEED]\n"
                        "       durability --program GONIO --library SHIM --cost FOLDER [--count PAIRS]\n");
        return 2;
    }
    char program[PATH_MAX], shim[PATH_MAX];
    if (realpath(o.program, program) == NULL || realpath(o.shim, shim) == NULL) {
        perror("durability");
        return 1;
    }
    o.program = program;
    o.shim = shim;
    if (o.cost != NULL) {
        return cost_tell(program, shim, o.cost, o.count) ? 0 : 1;
    }
    // Sessions live in memory: what a disk does to them is the campaign's own doing.
    char root[] = "/dev/shm/gonio-durability-XXXXXX", elsewhere[] = "/tmp/gonio-durability-XXXXXX";
    o.root = mkdtemp(root);
    o.root = o.root != NULL ? o.root : mkdtemp(elsewhere);
    if (o.root == NULL) {
        perror("no folder for the sessions");
        return 1;
    }
    return run_guarded(&o);
}
