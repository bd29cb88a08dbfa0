// SPDX-License-Identifier: BSD-3-Clause
// The fault campaign: measures of a modelled rig by the real drivers, each with faults that follow from its seed. Each
// must end with the samples of the undisturbed one, or with a named fault and a session that goes on to those samples.
#include <ftw.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "tests/faults/world.h"

enum { RUNS_MAX = 8, WALL_BOUND_S = 60, QUIET_S = 13, JOBS_MAX = 64 };

typedef struct result {
    fault_kind kinds[FAULTS_MAX];
    int64_t hits[FAULTS_MAX];
    int n, runs;              // host processes
    bool done, passed, named; // done: to its end; named: some host ended with a named fault
    bool silent;              // the first one finished
    int64_t longest_us;       // of a host, in the world's time
    double wall_s;
    char message[160], trouble[300];
} result;

static struct {
    char sha256[GONIO_SHA256_HEX];
    int64_t counts[UNITS];
    long long samples;
} undisturbed;

static double wall_s(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now); // no host runs in this process
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static int remove_one(const char *path, const struct stat *info, int kind, struct FTW *walk) {
    (void)info;
    (void)kind;
    (void)walk;
    return remove(path);
}

static void remove_folder(const char *path) { nftw(path, remove_one, 16, FTW_DEPTH | FTW_PHYS); }

// ---- what goes wrong, by seed ----

static void schedule(uint64_t seed) {
    w->n = 1 + (world_random() % 4 == 0);
    const bool visited =
        seed % FAULT_COUNT == FAULT_rig_file_edited; // somebody can come by where the measure was stopped
    w->n = visited ? 2 : w->n;
    for (int i = 0; i < w->n; i++) {
        fault *f = &w->faults[i];
        *f = (fault){.kind = i == 0 ? (fault_kind)(seed % FAULT_COUNT) : (fault_kind)(world_random() % FAULT_COUNT)};
        const int64_t total = undisturbed.counts[fault_infos[f->kind].unit];
        f->kind = i == 1 && visited ? FAULT_ctrl_c : f->kind;
        f->at = 1 + (int64_t)(0.98 * (double)total * (world_random() / 4294967296.0));
        const uint32_t long_or_short = world_random() % 3, some = world_random();
        const double share = some / 4294967296.0;
        f->duration_us = (int64_t)(1e6 * (long_or_short == 0   ? 0.05 + 1.5 * share
                                          : long_or_short == 1 ? 1.5 + 14 * share
                                                               : 15 + 120 * share));
        if (f->kind >= FAULT_home_switch_missing && f->kind <= FAULT_home_switch_bouncing) {
            f->duration_us += 20000000; // or the next homing is missed
        }
        if (f->kind == FAULT_exposure_stuck) {
            f->duration_us += 5000000; // the exposure does not change at every frame
        }
        const uint32_t burst = world_random() % 10;
        f->burst = burst < 5 ? 1 : burst < 8 ? 2 + (int)(some % 4) : 6 + (int)(some % 40);
        if (fault_infos[f->kind].unit == DISK_WRITES) {
            f->burst = 1;
        }
        f->parameter = world_random();
        w->encoders = w->encoders || (f->kind >= FAULT_steps_lost_encoder && f->kind <= FAULT_encoder_frozen);
    }
}

// ---- one seed ----

// A host in a process of its own, after a look at what the one before it left behind; its exit status, or -signal.
static int in_process(void) {
    fflush(NULL);
    const pid_t child = fork();
    if (child == 0) {
        alarm(WALL_BOUND_S);
        w->finished = false;
        host_doctor();
        w->host_runs = true;
        w->host_started_us = w->now_us;
        host_run();
        w->host_runs = false;
        if (w->finished) {
            host_doctor();
        }
        _exit(w->finished ? 0 : 1);
    }
    int status;
    waitpid(child, &status, 0);
    w->host_runs = false;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

// Nobody drives the rig: it must come to rest by itself and stay there.
static void leave_alone(void) {
    world_pass(INT64_C(8) * 1000000);
    world_visit();
    const uint64_t edges = w->machine.rising_edges;
    world_pass(INT64_C(QUIET_S - 8) * 1000000);
    if (w->machine.rising_edges != edges) {
        world_trouble("it moves without a host; ");
    }
}

static bool any_hit(bool by_host) {
    for (int i = 0; i < w->n; i++) {
        const bool host = strcmp(fault_infos[w->faults[i].kind].area, "host") == 0;
        if (w->faults[i].hits > 0 && (!by_host || host)) {
            return true;
        }
    }
    return false;
}

static void judge_end(int code, result *r) {
    if (code == -SIGALRM) {
        world_trouble("hangs: no end within %d s of the wall clock; ", WALL_BOUND_S);
    } else if (code < 0) {
        world_trouble("the host died of signal %d; ", -code);
    } else if (code == 137 && !any_hit(true)) {
        world_trouble("the host was killed by nobody; ");
    } else if (code == 1 && (w->status == GONIO_OK || w->message[0] == 0)) {
        world_trouble("a fault without a name; ");
    } else if (code == 1) {
        r->named = true;
        snprintf(r->message, sizeof r->message, "%.150s", w->message);
    }
}

static void run_seed(uint64_t seed, result *r) {
    const double started = wall_s();
    world_new(seed);
    schedule(seed);
    remove_folder(w->folder);
    for (r->runs = 1; r->runs <= RUNS_MAX; r->runs++) {
        const int64_t begun_us = w->now_us;
        const int code = in_process();
        r->longest_us = w->now_us - begun_us > r->longest_us ? w->now_us - begun_us : r->longest_us;
        judge_end(code, r);
        r->silent = r->runs == 1 && w->finished && code == 0;
        w->finished = code == 0 && w->finished;
        if (w->finished || w->trouble[0] != 0) {
            break;
        }
        leave_alone();
        if (r->runs > 1 || world_random() % 4 != 0) { // else the first resume still meets what stands
            world_repair();
        }
    }
    if (!w->finished && w->trouble[0] == 0) {
        world_trouble("not finished after %d runs; last: %s; ", RUNS_MAX, w->message);
    }
    if (w->finished && strcmp(w->sha256, undisturbed.sha256) != 0) {
        world_trouble("other samples than undisturbed (%lld, %lld expected); ", w->samples, undisturbed.samples);
    }
    if (w->n == 1 && w->slip_seen && w->taken_back > 0) {
        world_trouble("steps were lost under an encoder, and an audit took other steps back; ");
    }
    if (w->past_limit > 0) {
        world_trouble("%lld steps beyond a limit; ", (long long)w->past_limit);
    }
    if (w->finished && !any_hit(false) && !r->silent) {
        world_trouble("failed without a fault: %s; ", w->message);
    }
    r->n = w->n;
    for (int i = 0; i < w->n; i++) {
        r->kinds[i] = w->faults[i].kind;
        r->hits[i] = w->faults[i].hits;
    }
    r->passed = w->trouble[0] == 0;
    r->done = true;
    snprintf(r->trouble, sizeof r->trouble, "%.299s", w->trouble);
    r->wall_s = wall_s() - started;
    remove_folder(w->folder);
}

static bool measure_undisturbed(void) {
    world_new(0);
    remove_folder(w->folder);
    const int code = in_process();
    if (code != 0 || !w->finished || w->trouble[0] != 0) {
        fprintf(stderr, "the undisturbed measure failed (%d): %s %s\n", code, w->message, w->trouble);
        return false;
    }
    memcpy(undisturbed.sha256, w->sha256, sizeof undisturbed.sha256);
    memcpy(undisturbed.counts, w->counts, sizeof undisturbed.counts);
    undisturbed.samples = w->samples;
    printf("undisturbed: %lld samples, %s; %lld requests, %lld USB transfers, %lld frames, %lld disk operations, %.1f "
           "s of "
           "the rig's time\n",
           w->samples, w->sha256, (long long)w->counts[EXCHANGES], (long long)w->counts[USB_TRANSFERS],
           (long long)w->counts[FRAMES], (long long)w->counts[DISK_WRITES], (double)w->now_us * 1e-6);
    remove_folder(w->folder);
    return true;
}

// ---- all of them ----

static void print_fault(const result *r, int i) {
    printf(" %s (%lld hits)", fault_infos[r->kinds[i]].name, (long long)r->hits[i]);
}

static void print_result(long long seed, const result *r) {
    printf("seed %lld: %s,", seed, r->passed ? "passed" : "FAILED");
    for (int i = 0; i < r->n; i++) {
        print_fault(r, i);
    }
    printf("; %d runs%s%s%s%s\n", r->runs, r->named ? ", named: " : "", r->named ? r->message : "",
           r->passed ? "" : "; TROUBLE: ", r->trouble);
}

static void worker(int job, int jobs, long long first, long long count, result *results, const char *root) {
    w = mmap(NULL, sizeof *w, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    snprintf(w->folder, sizeof w->folder, "%s/%d", root, job);
    for (long long i = job; i < count; i += jobs) {
        run_seed((uint64_t)(first + i), &results[i]);
        if (!results[i].passed) {
            print_result(first + i, &results[i]);
        }
        if ((i + 1) % 500 == 0) {
            printf("seed %lld is done\n", first + i);
        }
        fflush(stdout);
    }
    _exit(0);
}

typedef struct tally {
    long long measures, injected, hit, silent, named, failed, hits;
} tally;

static void sum_up(const result *results, long long count, tally *tallies, tally *all) {
    for (long long i = 0; i < count; i++) {
        const result *r = &results[i];
        bool hit = false;
        all->measures += r->done;
        for (int k = 0; k < r->n; k++) {
            tally *t = &tallies[r->kinds[k]];
            t->injected++;
            t->hits += r->hits[k];
            if (r->hits[k] > 0) {
                hit = true;
                t->hit++;
                t->silent += r->silent;
                t->named += !r->silent && r->passed;
                t->failed += !r->passed;
            }
        }
        all->injected += r->n;
        all->hit += hit;
        all->silent += hit && r->silent;
        all->named += hit && !r->silent && r->passed;
        all->failed += r->done && !r->passed;
    }
}

static void report(FILE *to, const result *results, long long count, double seconds) {
    tally tallies[FAULT_COUNT] = {0}, all = {0};
    double slowest = 0;
    int64_t longest = 0;
    sum_up(results, count, tallies, &all);
    fprintf(to, "%-8s %-24s %8s %8s %10s %10s %10s %6s\n", "area", "fault", "injected", "measures", "hits", "recovered",
            "resumed", "failed");
    for (int k = 0; k < FAULT_COUNT; k++) {
        const tally *t = &tallies[k];
        fprintf(to, "%-8s %-24s %8lld %8lld %10lld %10lld %10lld %6lld\n", fault_infos[k].area, fault_infos[k].name,
                t->injected, t->hit, t->hits, t->silent, t->named, t->failed);
    }
    for (long long i = 0; i < count; i++) {
        slowest = results[i].wall_s > slowest ? results[i].wall_s : slowest;
        longest = results[i].longest_us > longest ? results[i].longest_us : longest;
    }
    fprintf(to,
            "%lld measures, %lld faults injected; %lld measures were hit: %lld finished, %lld ended with a named fault "
            "or a "
            "dead host and were resumed to the same samples; %lld failed\n",
            all.measures, all.injected, all.hit, all.silent, all.named, all.failed);
    fprintf(to, "longest measure %.0f s of the rig's time (undisturbed %.0f s), slowest seed %.2f s; %.0f s in all\n",
            (double)longest * 1e-6, (double)undisturbed.counts[TIME_US] * 1e-6, slowest, seconds);
}

static int run_one(long long seed) {
    static result r;
    w->verbose = true;
    setvbuf(stdout, NULL, _IOLBF, 0);
    run_seed((uint64_t)seed, &r);
    print_result(seed, &r);
    return r.passed ? 0 : 1;
}

static int run_all(long long first, long long count, int jobs, const char *path, const char *root) {
    const double started = wall_s();
    const size_t bytes = (size_t)count * sizeof(result);
    result *results = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (results == MAP_FAILED) {
        return 1;
    }
    fflush(NULL);
    for (int job = 0; job < jobs; job++) {
        if (fork() == 0) {
            worker(job, jobs, first, count, results, root);
        }
    }
    int status, bad = 0;
    for (int job = 0; job < jobs; job++) {
        wait(&status);
        bad += status != 0;
    }
    report(stdout, results, count, wall_s() - started);
    FILE *file = path != NULL ? fopen(path, "w") : NULL;
    if (file != NULL) {
        report(file, results, count, wall_s() - started);
        fclose(file);
    }
    for (long long i = 0; i < count; i++) {
        bad += !results[i].passed;
    }
    return bad > 0;
}

int main(int argc, char **argv) {
    long long count = 300, first = 1, seed = -1;
    int jobs = (int)sysconf(_SC_NPROCESSORS_ONLN);
    const char *path = NULL;
    for (int i = 1; i + 1 < argc; i += 2) {
        if (strcmp(argv[i], "--count") == 0) {
            count = atoll(argv[i + 1]);
        } else if (strcmp(argv[i], "--first") == 0) {
            first = atoll(argv[i + 1]);
        } else if (strcmp(argv[i], "--seed") == 0) {
            seed = atoll(argv[i + 1]);
        } else if (strcmp(argv[i], "--jobs") == 0) {
            jobs = atoi(argv[i + 1]);
        } else if (strcmp(argv[i], "--report") == 0) {
            path = argv[i + 1];
        }
    }
    if (count < 1 || jobs < 1 || jobs > JOBS_MAX) {
        fprintf(stderr, "usage: faults [--count N] [--first SEED] [--jobs N] [--report FILE] [--seed SEED]\n");
        return 2;
    }
    signal(SIGPIPE, SIG_IGN);
    // Sessions live in memory: the campaign models what a disk does to them.
    char root[] = "/dev/shm/gonio-faults-XXXXXX", elsewhere[] = "/tmp/gonio-faults-XXXXXX";
    char *made = mkdtemp(root);
    made = made != NULL ? made : mkdtemp(elsewhere);
    if (made == NULL) {
        fprintf(stderr, "no folder for the sessions\n");
        return 1;
    }
    world *own = mmap(NULL, sizeof *w, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    snprintf(own->folder, sizeof own->folder, "%s/one", made);
    w = own;
    int exit_status = measure_undisturbed() ? 0 : 1;
    if (exit_status == 0) {
        exit_status = seed >= 0 ? run_one(seed) : run_all(first, count, jobs, path, made);
    }
    remove_folder(made);
    return exit_status;
}
