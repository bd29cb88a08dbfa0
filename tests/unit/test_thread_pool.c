// SPDX-License-Identifier: BSD-3-Clause
// Loops on a pool: every item exactly once, nested and from many callers at once; the same error whatever the number of
// threads; helpers that sleep, take no signal and leave nothing behind for the child of a fork.
#include <pthread.h>
#include <sched.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/thread_pool.h"

#define MOST 20000

static const int thread_counts[] = {1, 2, 3, 8, 40};
#define COUNTS (sizeof thread_counts / sizeof *thread_counts)

static void count_item(void *context, size_t item) {
    atomic_int *counts = context;
    counts[item]++;
}

static void assert_once(const atomic_int *counts, size_t items) {
    for (size_t i = 0; i < items; i++) {
        assert_int_equal(counts[i], 1);
    }
    assert_int_equal(counts[items], 0);
}

static void every_item_once(void **state) {
    (void)state;
    static const size_t items[] = {0, 1, 2, 7, 256, MOST};
    atomic_int *counts = calloc(MOST + 1, sizeof *counts);
    for (size_t t = 0; t < COUNTS; t++) {
        gonio_pool *pool = gonio_pool_new(thread_counts[t]);
        for (size_t k = 0; k < sizeof items / sizeof *items; k++) {
            for (int way = 0; way < 2; way++) {
                memset(counts, 0, (MOST + 1) * sizeof *counts);
                if (way == 0) {
                    gonio_pool_run(pool, items[k], count_item, counts);
                } else {
                    gonio_pool_for(thread_counts[t], items[k], count_item, counts);
                }
                assert_once(counts, items[k]);
            }
        }
        gonio_pool_free(pool);
    }
    free(counts);
}

// ---- nested ----

#define WIDTH 6

typedef struct nest {
    gonio_pool *pools[3]; // of the depths; the first may be the same
    int depth;
    size_t at; // of the items before it
    atomic_int *counts, *inside, *most;
} nest;

static void go_deeper(void *context, size_t item) {
    const nest *outer = context;
    nest inner = *outer;
    inner.depth++;
    inner.at = outer->at * WIDTH + item;
    if (inner.depth < 3) {
        if (item % 2 == 0) {
            gonio_pool_run(inner.pools[inner.depth], WIDTH, go_deeper, &inner);
        } else {
            gonio_pool_for(5, WIDTH, go_deeper, &inner);
        }
        return;
    }
    const int inside = ++*inner.inside;
    for (int most = *inner.most; inside > most && !atomic_compare_exchange_weak(inner.most, &most, inside);) {
    }
    inner.counts[inner.at]++;
    sched_yield();
    --*inner.inside;
}

// Every leaf once, by no more threads at a time than the outermost loop was given.
static bool nested_well(gonio_pool *first, gonio_pool *second, gonio_pool *third) {
    atomic_int counts[WIDTH * WIDTH * WIDTH + 1] = {0}, inside = 0, most = 0;
    nest n = {.pools = {first, second, third}, .counts = counts, .inside = &inside, .most = &most};
    gonio_pool_run(first, WIDTH, go_deeper, &n);
    for (size_t i = 0; i < WIDTH * WIDTH * WIDTH; i++) {
        if (counts[i] != 1) {
            return false;
        }
    }
    return most >= 1 && (size_t)most <= gonio_pool_size(first);
}

static void nested_loops_share_the_outer_threads(void **state) {
    (void)state;
    for (int round = 0; round < 30; round++) {
        gonio_pool *a = gonio_pool_new(2 + round % 3), *b = gonio_pool_new(4), *c = gonio_pool_new(2);
        assert_true(nested_well(a, a, a));
        assert_true(nested_well(a, b, c));
        assert_true(nested_well(b, NULL, b));
        gonio_pool_free(a);
        gonio_pool_free(b);
        gonio_pool_free(c);
    }
}

static void *call_often(void *argument) {
    for (int round = 0; round < 20; round++) {
        atomic_int counts[101] = {0};
        gonio_pool_run(argument, 100, count_item, counts);
        for (int i = 0; i < 100; i++) {
            if (counts[i] != 1) {
                return argument;
            }
        }
        if (!nested_well(argument, NULL, argument)) {
            return argument;
        }
    }
    return NULL;
}

static void many_callers_at_once(void **state) {
    (void)state;
    gonio_pool *pool = gonio_pool_new(3);
    pthread_t callers[8];
    for (size_t i = 0; i < 8; i++) {
        assert_int_equal(pthread_create(&callers[i], NULL, call_often, pool), 0);
    }
    for (size_t i = 0; i < 8; i++) {
        void *wrong;
        pthread_join(callers[i], &wrong);
        assert_null(wrong);
    }
    gonio_pool_free(pool);
}

// ---- work that fails ----

typedef struct trial {
    uint64_t seed;
    size_t items;
    atomic_int *tried;
} trial;

static bool fails(const trial *t, size_t item) { return (item * 2654435761u + t->seed * 40503u) % 97 < 3; }

static gonio_status may_fail(void *context, size_t item, gonio_error *error) {
    const trial *t = context;
    t->tried[item]++;
    if (item % 5 == t->seed % 5) {
        sched_yield();
    }
    return fails(t, item) ? gonio_fail(error, item % 2 == 0 ? GONIO_E_INTERRUPTED : GONIO_E_INPUT, "item %zu", item)
                          : GONIO_OK;
}

static void the_first_failure_is_told(void **state) {
    (void)state;
    atomic_int tried[400];
    for (uint64_t seed = 0; seed < 60; seed++) {
        for (size_t t = 0; t < COUNTS; t++) {
            trial work = {.seed = seed, .items = seed % 3 == 0 ? 20 : 400, .tried = tried};
            size_t first = 0;
            while (first < work.items && !fails(&work, first)) {
                first++;
            }
            memset(tried, 0, sizeof tried);
            gonio_error error = {0};
            char expected[32];
            snprintf(expected, sizeof expected, "item %zu", first);
            const gonio_status status = gonio_pool_try(thread_counts[t], work.items, may_fail, &work, &error);
            if (first == work.items) {
                assert_int_equal(status, GONIO_OK);
                assert_string_equal(error.message, ""); // what succeeds leaves the error alone
            } else {
                assert_int_equal(status, first % 2 == 0 ? GONIO_E_INTERRUPTED : GONIO_E_INPUT);
                assert_string_equal(error.message, expected);
            }
            for (size_t i = 0; i < work.items; i++) {
                // Nothing before the first failure is left out; one thread begins nothing after it.
                assert_true(i <= first ? tried[i] == 1 : tried[i] <= (thread_counts[t] > 1));
            }
        }
    }
}

// ---- helpers ----

#define TEAM 3

typedef struct meeting {
    pthread_barrier_t barrier;
    sigset_t masks[TEAM];
    pid_t tasks[TEAM];
} meeting;

// No item returns before all have begun, so each has a thread to itself.
static void meet(void *context, size_t item) {
    meeting *m = context;
    m->tasks[item] = gettid();
    pthread_sigmask(SIG_BLOCK, NULL, &m->masks[item]);
    pthread_barrier_wait(&m->barrier);
}

static void helpers_take_no_signal(void **state) {
    (void)state;
    static const int theirs[] = {SIGINT, SIGTERM, SIGHUP, SIGUSR1, SIGALRM, SIGCHLD, SIGPROF, SIGWINCH},
                     own[] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL};
    sigset_t before, after;
    pthread_sigmask(SIG_BLOCK, NULL, &before);
    meeting m;
    pthread_barrier_init(&m.barrier, NULL, TEAM);
    gonio_pool_for(TEAM, TEAM, meet, &m);
    pthread_barrier_destroy(&m.barrier);
    pthread_sigmask(SIG_BLOCK, NULL, &after);
    for (int s = 1; s < SIGRTMAX; s++) {
        assert_int_equal(sigismember(&before, s), sigismember(&after, s));
    }
    for (size_t i = 0; i < TEAM; i++) {
        const bool helper = m.tasks[i] != gettid();
        for (size_t k = 0; k < sizeof theirs / sizeof *theirs; k++) {
            assert_int_equal(sigismember(&m.masks[i], theirs[k]), helper || sigismember(&before, theirs[k]));
        }
        for (size_t k = 0; k < sizeof own / sizeof *own; k++) {
            assert_int_equal(sigismember(&m.masks[i], own[k]), 0);
        }
    }
}

// The kernel's letter for what a task does: R runs, S sleeps.
static char task_state(pid_t task) {
    char path[64], letter = 0;
    snprintf(path, sizeof path, "/proc/self/task/%d/stat", task);
    FILE *file = fopen(path, "r");
    if (file != NULL) {
        if (fscanf(file, "%*d (%*[^)]) %c", &letter) != 1) {
            letter = 0;
        }
        fclose(file);
    }
    return letter;
}

static void idle_helpers_sleep(void **state) {
    (void)state;
    meeting m;
    pthread_barrier_init(&m.barrier, NULL, TEAM);
    gonio_pool *pool = gonio_pool_new(TEAM);
    gonio_pool_run(pool, TEAM, meet, &m);
    for (size_t i = 0; i < TEAM; i++) {
        char letter = 'R';
        // One that spins is never found asleep; a sleeping one is as soon as it has had a processor.
        for (int look = 0; m.tasks[i] != gettid() && look < 10000 && (letter = task_state(m.tasks[i])) != 'S'; look++) {
            usleep(1000);
        }
        assert_true(m.tasks[i] == gettid() || letter == 'S');
    }
    gonio_pool_free(pool);
    pthread_barrier_destroy(&m.barrier);
}

static void a_fork_finds_nothing(void **state) {
    (void)state;
    atomic_int counts[301] = {0};
    gonio_pool_for(4, 300, count_item, counts);
    fflush(NULL);
    const pid_t child = fork();
    if (child == 0) {
        gonio_pool_for(4, 300, count_item, counts);
        for (int i = 0; i < 300; i++) {
            if (counts[i] != 2) {
                _exit(1);
            }
        }
        _exit(0);
    }
    int status = -1;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 0);
}

static void all_processors_are_those_allowed(void **state) {
    (void)state;
    cpu_set_t all, one;
    assert_int_equal(sched_getaffinity(0, sizeof all, &all), 0);
    assert_int_equal(gonio_pool_threads(0), CPU_COUNT(&all));
    CPU_ZERO(&one);
    for (size_t cpu = 0; cpu < CPU_SETSIZE && CPU_COUNT(&one) == 0; cpu++) {
        if (CPU_ISSET(cpu, &all)) {
            CPU_SET(cpu, &one);
        }
    }
    assert_int_equal(sched_setaffinity(0, sizeof one, &one), 0);
    const size_t threads = gonio_pool_threads(0);
    gonio_pool *pool = gonio_pool_new(0);
    assert_int_equal(sched_setaffinity(0, sizeof all, &all), 0);
    assert_int_equal(threads, 1);
    assert_null(pool);
    assert_int_equal(gonio_pool_size(NULL), 1);
    assert_int_equal(gonio_pool_threads(7), 7);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_item_once),        cmocka_unit_test(nested_loops_share_the_outer_threads),
        cmocka_unit_test(many_callers_at_once),   cmocka_unit_test(the_first_failure_is_told),
        cmocka_unit_test(helpers_take_no_signal), cmocka_unit_test(idle_helpers_sleep),
        cmocka_unit_test(a_fork_finds_nothing),   cmocka_unit_test(all_processors_are_those_allowed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
