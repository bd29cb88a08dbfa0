// A team of threads that waits without spinning, for the length of one fit.
//
// OpenMP's waiting policy can only be set from outside, before the program starts, and its default spins: on a busy
// machine that made small fits 16 to 70 times slower (DESIGN section 5). Here an idle thread sleeps on a condition
// variable.
#ifndef GONIO_FIT_TEAM_H
#define GONIO_FIT_TEAM_H

#include <stddef.h>

#include "gonio/status.h"

typedef struct gonio_team gonio_team;

// threads 0: as many as the machine has. NULL comes back for one thread, or where no thread can be started:
// gonio_team_run then does all the work itself.
gonio_team *gonio_team_new(int threads);
void gonio_team_free(gonio_team *team);
// Threads of a team, the caller's among them (NULL: 1), and those that a number asked for would mean.
size_t gonio_team_size(const gonio_team *team);
size_t gonio_team_threads(int threads);
// Call work(context, item) for every item in [0, items), in any order, by any thread; returns when all are done.
void gonio_team_run(gonio_team *team, size_t items, void (*work)(void *context, size_t item), void *context);

// Chunks of a fixed size, so that what a chunk computes does not depend on the number of threads. Below
// GONIO_TEAM_SAMPLES samples, waking a thread costs more than it saves.
#define GONIO_TEAM_CHUNK ((size_t)16384)
#define GONIO_TEAM_SAMPLES (2 * GONIO_TEAM_CHUNK)

#endif
