// SPDX-License-Identifier: BSD-3-Clause
// Nobody waits: sleeping, and waiting in the drivers' thread, let the world's time pass. That thread (the one that
// feeds the controller's dead-man) becomes a coroutine that has its turn whenever the other one sleeps, and is as
// repeatable as everything else.
#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <stdlib.h>
#include <sys/syscall.h>
#include <time.h>
#include <ucontext.h>
#include <unistd.h>

#include "tests/faults/world.h"

#define EPOCH_S 1000

enum { STACK_BYTES = 1 << 18 };

static ucontext_t main_context, thread_context;
static char stack[STACK_BYTES];
static bool exists, inside, done, woken;
static int64_t wakes_us;
static void *(*body)(void *);
static void *argument;

static void run_body(void) {
    body(argument);
    done = true;
    for (;;) {
        swapcontext(&thread_context, &main_context);
    }
}

static void resume_thread(void) {
    inside = true;
    swapcontext(&main_context, &thread_context);
    inside = false;
}

void clock_turn(void) {
    if (exists && !done && !inside && (woken || w->now_us >= wakes_us)) {
        resume_thread();
    }
}

void clock_forget_threads(void) { exists = inside = done = woken = false; }

// Libraries that start threads of their own when the program begins get real ones.
static bool ours(void) { return w != NULL && w->host_runs; }

int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*start)(void *), void *context) {
    if (!ours()) {
        int (*create)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
        *(void **)&create = dlsym(RTLD_NEXT, "pthread_create");
        return create(thread, attributes, start, context);
    }
    if (exists && !done) {
        return EAGAIN;
    }
    *thread = pthread_self();
    body = start;
    argument = context;
    exists = true;
    done = woken = false;
    getcontext(&thread_context);
    thread_context.uc_stack.ss_sp = stack;
    thread_context.uc_stack.ss_size = sizeof stack;
    thread_context.uc_link = NULL;
    makecontext(&thread_context, run_body, 0);
    resume_thread(); // to its first wait
    return 0;
}

int pthread_join(pthread_t thread, void **result) {
    if (!ours()) {
        int (*join)(pthread_t, void **);
        *(void **)&join = dlsym(RTLD_NEXT, "pthread_join");
        return join(thread, result);
    }
    while (exists && !done) {
        woken = true;
        resume_thread();
    }
    exists = false;
    return 0;
}

int pthread_cond_timedwait(pthread_cond_t *condition, pthread_mutex_t *lock, const struct timespec *until) {
    (void)condition;
    if (!ours() || !inside) {
        abort(); // nobody else waits like this
    }
    wakes_us = (until->tv_sec - EPOCH_S) * 1000000 + until->tv_nsec / 1000;
    woken = false;
    pthread_mutex_unlock(lock);
    swapcontext(&thread_context, &main_context);
    pthread_mutex_lock(lock);
    return woken ? 0 : ETIMEDOUT;
}

int clock_gettime(clockid_t clock, struct timespec *now) {
    if (clock != CLOCK_MONOTONIC || !ours()) {
        return (int)syscall(SYS_clock_gettime, clock, now);
    }
    world_pass(1); // so that nobody who looks at the clock alone looks for ever
    now->tv_sec = EPOCH_S + w->now_us / 1000000;
    now->tv_nsec = w->now_us % 1000000 * 1000;
    return 0;
}

int nanosleep(const struct timespec *time, struct timespec *rest) {
    if (!ours()) {
        return (int)syscall(SYS_nanosleep, time, rest);
    }
    const int64_t until = w->now_us + time->tv_sec * 1000000 + time->tv_nsec / 1000;
    while (w->now_us < until) {
        const int64_t wake = exists && !done && !inside && wakes_us > w->now_us && wakes_us < until ? wakes_us : until;
        world_pass(wake - w->now_us);
        clock_turn();
    }
    return 0;
}
