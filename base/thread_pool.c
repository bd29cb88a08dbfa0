// SPDX-License-Identifier: BSD-3-Clause
#include "base/thread_pool.h"

#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>

#define THREADS_MAX 256

// One loop; it lives on its caller's stack.
typedef struct loop {
    struct loop *next;
    gonio_pool_work *work;
    void *context;
    size_t items;
    atomic_size_t begun;
    int busy; // helpers inside; the pool's mutex guards it
    pthread_cond_t left;
} loop;

struct gonio_pool {
    pthread_mutex_t mutex;
    pthread_cond_t wake;
    loop *loops; // under way, the latest first
    bool stop;
    int wanted, count; // helpers beside the caller: asked for, running
    pthread_t threads[];
};

// The pool whose item this thread is inside of.
static _Thread_local gonio_pool *current;

static void take_items(gonio_pool *pool, loop *l) {
    gonio_pool *const outer = current;
    current = pool;
    for (size_t item; (item = atomic_fetch_add(&l->begun, 1)) < l->items;) {
        l->work(l->context, item);
    }
    current = outer;
}

static loop *find_loop(const gonio_pool *pool) {
    loop *l = pool->loops;
    while (l != NULL && atomic_load(&l->begun) >= l->items) {
        l = l->next;
    }
    return l;
}

static void *helper(void *argument) {
    gonio_pool *pool = argument;
    pthread_mutex_lock(&pool->mutex);
    while (!pool->stop) {
        loop *l = find_loop(pool);
        if (l == NULL) {
            pthread_cond_wait(&pool->wake, &pool->mutex);
            continue;
        }
        l->busy++;
        pthread_mutex_unlock(&pool->mutex);
        take_items(pool, l);
        pthread_mutex_lock(&pool->mutex);
        if (--l->busy == 0) {
            pthread_cond_signal(&l->left);
        }
    }
    pthread_mutex_unlock(&pool->mutex);
    return NULL;
}

size_t gonio_pool_threads(int threads) {
    cpu_set_t set;
    const int n = threads > 0 ? threads : sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : THREADS_MAX;
    return n > THREADS_MAX ? THREADS_MAX : (size_t)n;
}

size_t gonio_pool_size(const gonio_pool *pool) { return pool != NULL ? (size_t)pool->wanted + 1 : 1; }

gonio_pool *gonio_pool_new(int threads) {
    const size_t helpers = gonio_pool_threads(threads) - 1;
    gonio_pool *pool = helpers > 0 ? calloc(1, sizeof *pool + helpers * sizeof *pool->threads) : NULL;
    if (pool != NULL) {
        pthread_mutex_init(&pool->mutex, NULL);
        pthread_cond_init(&pool->wake, NULL);
        pool->wanted = (int)helpers;
    }
    return pool;
}

void gonio_pool_free(gonio_pool *pool) {
    if (pool == NULL) {
        return;
    }
    pthread_mutex_lock(&pool->mutex);
    pool->stop = true;
    pthread_cond_broadcast(&pool->wake);
    pthread_mutex_unlock(&pool->mutex);
    for (int i = 0; i < pool->count; i++) {
        pthread_join(pool->threads[i], NULL);
    }
    pthread_cond_destroy(&pool->wake);
    pthread_mutex_destroy(&pool->mutex);
    free(pool);
}

bool gonio_thread_start(pthread_t *thread, void *(*run)(void *), void *context) {
    static const int own[] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGTRAP, SIGSYS, SIGABRT};
    sigset_t blocked, before;
    sigfillset(&blocked);
    for (size_t i = 0; i < sizeof own / sizeof *own; i++) {
        sigdelset(&blocked, own[i]);
    }
    pthread_sigmask(SIG_SETMASK, &blocked, &before);
    const bool started = pthread_create(thread, NULL, run, context) == 0;
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return started;
}

// Start the helpers that a loop can use. What cannot be started is done without.
static void start_helpers(gonio_pool *pool, size_t useful) {
    while (pool->count < pool->wanted && (size_t)pool->count < useful &&
           gonio_thread_start(&pool->threads[pool->count], helper, pool)) {
        pool->count++;
    }
}

// A caller that has nothing left to begin sleeps until the helpers have left its loop. A helper inside it may itself
// wait so for a loop that one of its items runs, but never for one further out: no two can wait for each other.
static void share_loop(gonio_pool *pool, loop *l) {
    pthread_cond_init(&l->left, NULL);
    pthread_mutex_lock(&pool->mutex);
    if (pool->count < pool->wanted && (size_t)pool->count < l->items - 1) {
        start_helpers(pool, l->items - 1);
    }
    l->next = pool->loops;
    pool->loops = l;
    pthread_cond_broadcast(&pool->wake);
    pthread_mutex_unlock(&pool->mutex);
    take_items(pool, l);
    pthread_mutex_lock(&pool->mutex);
    loop **link = &pool->loops;
    while (*link != l) {
        link = &(*link)->next;
    }
    *link = l->next;
    while (l->busy > 0) {
        pthread_cond_wait(&l->left, &pool->mutex);
    }
    pthread_mutex_unlock(&pool->mutex);
    pthread_cond_destroy(&l->left);
}

void gonio_pool_run(gonio_pool *pool, size_t items, gonio_pool_work *work, void *context) {
    loop l = {.work = work, .context = context, .items = items};
    if (pool != NULL && items > 1) {
        share_loop(current != NULL ? current : pool, &l);
        return;
    }
    for (size_t item = 0; item < items; item++) {
        work(context, item);
    }
}

void gonio_pool_for(int threads, size_t items, gonio_pool_work *work, void *context) {
    gonio_pool *pool = items > 1 ? gonio_pool_new(threads) : NULL;
    gonio_pool_run(pool, items, work, context);
    gonio_pool_free(pool);
}

// ---- work that may fail ----

typedef struct attempt {
    gonio_pool_step *step;
    void *context;
    atomic_size_t first; // that failed; SIZE_MAX: none
    pthread_mutex_t mutex;
    gonio_status status;
    gonio_error *error;
} attempt;

// Only what comes after a failed item is left out, so the first of those that fail is always tried.
static void try_item(void *context, size_t item) {
    attempt *a = context;
    if (item > atomic_load(&a->first)) {
        return;
    }
    gonio_error error = {.line = -1, .byte = -1};
    const gonio_status status = a->step(a->context, item, &error);
    if (status == GONIO_OK) {
        return;
    }
    pthread_mutex_lock(&a->mutex);
    if (item < atomic_load(&a->first)) {
        atomic_store(&a->first, item);
        a->status = status;
        if (a->error != NULL) {
            *a->error = error;
        }
    }
    pthread_mutex_unlock(&a->mutex);
}

gonio_status gonio_pool_try(int threads, size_t items, gonio_pool_step *step, void *context, gonio_error *error) {
    attempt a = {.step = step, .context = context, .first = SIZE_MAX, .error = error};
    pthread_mutex_init(&a.mutex, NULL);
    gonio_pool_for(threads, items, try_item, &a);
    pthread_mutex_destroy(&a.mutex);
    return a.status;
}
