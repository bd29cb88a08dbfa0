// SPDX-License-Identifier: BSD-3-Clause
// Every system call on files of this process, to a handler that does what the order says.
#ifndef GONIO_TESTS_DURABILITY_TRAP_H
#define GONIO_TESTS_DURABILITY_TRAP_H

#include <stdbool.h>

#include "tests/durability/shim.h"

// From here on until the process ends; false where the kernel has no seccomp filters.
bool trap_install(shim_shared *shared);
// How many calls that change something under the watched folder there have been.
int64_t trap_changes(void);

// ---- trap_calls.c: which calls there are ----
typedef struct trap_call {
    int number;
    unsigned kind;
    signed char fd, folder, path, folder2, path2; // which arguments; -1: has none. A folder of -1 is the working one
} trap_call;
extern const trap_call trap_calls[];
extern const int trap_calls_n;
const trap_call *trap_find(int number);
long trap_raw(long number, long a, long b, long c, long d, long e, long f); // never trapped
bool trap_filter(void);
// Where the call's files are: two absolute paths, empty where there are none.
void trap_paths(const trap_call *call, const long *arguments, char paths[2][SHIM_PATH]);

// ---- trap_trace.c ----
bool trap_trace_open(const char *path);
// Do the call and record what it changed.
long trap_traced(const trap_call *call, const long *arguments, char paths[2][SHIM_PATH]);

#endif
