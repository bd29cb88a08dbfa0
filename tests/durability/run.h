// SPDX-License-Identifier: BSD-3-Clause
// Run the program's verbs under an order, each in bounded time.
#ifndef GONIO_TESTS_DURABILITY_RUN_H
#define GONIO_TESTS_DURABILITY_RUN_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

#include "tests/durability/shim.h"

enum { RUN_BOUND_S = 60, RUN_IMPOSSIBLE = 77 }; // the exit status where the kernel traps no system calls

// A waiting program (shim.h); one command at a time.
typedef struct runner runner;
// program, shim: absolute paths; folder: for its own files, outside of all sessions. NULL where it does not start.
runner *runner_start(const char *program, const char *shim, const char *folder);
void runner_stop(runner *r);

typedef struct run_result {
    int status; // exit status; -signal
    bool hangs; // it was killed after RUN_BOUND_S
    int64_t calls, hits;
    char hit[256];      // the first call that was hit
    double processor_s; // the command's own
    char message[400];  // of the error, or the last line of stderr
    int64_t timers_ns[SHIM_TIMERS];
    json_t *json; // what it printed; NULL where that is no JSON
} run_result;

// order may be NULL. command: words ended by NULL, without the program's name. The caller calls run_free.
void run(runner *r, const shim_order *order, const char *const *command, run_result *result);
// The same in two parts, for commands beside each other.
void run_begin(runner *r, const shim_order *order, const char *const *command);
void run_end(runner *r, run_result *result);
bool run_is_over(runner *r); // since run_begin
// Wait until the command has made so many calls of the order's kinds, or is over.
void run_until(runner *r, int64_t calls);
void run_signal(runner *r, int signal);
void run_free(run_result *result);
#define RUN(r, order, result, ...) run(r, order, (const char *const[]){__VA_ARGS__, NULL}, result)
// The working folder and the memory limit of the commands to come.
void runner_set(runner *r, const char *working_folder, int64_t memory_bytes);
void runner_bound(runner *r, int seconds); // instead of RUN_BOUND_S
// A text of the JSON; "" where it has none.
const char *run_text(const run_result *result, const char *key);
double run_processor_s(void); // of all commands of this process so far
int64_t run_count(void);
// Tell every command and its end on stdout.
extern bool run_told;

#endif
