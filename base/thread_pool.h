// SPDX-License-Identifier: BSD-3-Clause
// Threads that share the items of a loop and sleep while there is nothing to do.
//
// A pool belongs to whoever makes it, usually for the length of one call: there is no pool of the process, so several
// threads of a user's program may call the library at once, and the child of a fork finds nothing that its parent's
// threads left half done. The threads are started by the first loop that can use them. They take no signal that is sent
// to the process: a handler runs in the threads of the program, where it ran before.
//
// Which thread does which item is not determined; what an item computes must not depend on it. A sum over items is
// therefore kept an item and added up in order afterwards.
#ifndef GONIO_BASE_THREAD_POOL_H
#define GONIO_BASE_THREAD_POOL_H

#include <pthread.h>
#include <stdbool.h>
#include <stddef.h>

#include "gonio/status.h"

typedef struct gonio_pool gonio_pool;
typedef void gonio_pool_work(void *context, size_t item);
typedef gonio_status gonio_pool_step(void *context, size_t item, gonio_error *error);

// threads 0: as many as there are processors that the calling thread may run on. NULL comes back for one thread, or
// where there is no memory: the loops below then run in the caller alone.
gonio_pool *gonio_pool_new(int threads);
void gonio_pool_free(gonio_pool *pool); // not while a loop runs on it
// Threads of a pool, the caller's among them (NULL: 1), and those that a number asked for would mean.
size_t gonio_pool_size(const gonio_pool *pool);
size_t gonio_pool_threads(int threads);

// A thread as those of a pool are, to be joined by whoever starts it: every signal is blocked in it but those that an
// instruction of its own raises. False: it could not be started.
bool gonio_thread_start(pthread_t *thread, void *(*run)(void *), void *context);

// Call work(context, item) for every item in [0, items), in any order, by any thread, the caller's among them; returns
// when all are done. Any number of threads may run loops on one pool. A loop that an item runs on a pool, whichever it
// is, is shared by the idle threads of the pool that the item itself runs on: nested loops neither wait for each other
// nor start more threads than the outermost one was given.
void gonio_pool_run(gonio_pool *pool, size_t items, gonio_pool_work *work, void *context);
// A loop on a pool of its own.
void gonio_pool_for(int threads, size_t items, gonio_pool_work *work, void *context);
// The same for work that may fail: what comes after an item that has failed is left out, and the status and the error
// of the first item that fails come back, whatever the number of threads.
gonio_status gonio_pool_try(int threads, size_t items, gonio_pool_step *step, void *context, gonio_error *error);

// Chunks of a fixed size, so that what a chunk computes does not depend on the number of threads. Below
// GONIO_POOL_SAMPLES samples, waking a thread costs more than it saves.
#define GONIO_POOL_CHUNK ((size_t)16384)
#define GONIO_POOL_SAMPLES (2 * GONIO_POOL_CHUNK)

#endif
