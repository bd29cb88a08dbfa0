// SPDX-License-Identifier: BSD-3-Clause
// Functions that the library stands before: the next one of that name does the work.
#ifndef GONIO_TESTS_DURABILITY_NEXT_H
#define GONIO_TESTS_DURABILITY_NEXT_H

#include <dlfcn.h>
#include <stdlib.h>
#include <string.h>

#include "tests/durability/shim.h"

extern shim_shared *shim_memory; // NULL until the program waits

static inline void *next_symbol(const char *name) {
    void *symbol = dlsym(RTLD_NEXT, name);
    if (symbol == NULL) {
        abort();
    }
    return symbol;
}

// ISO C has no conversion from an object's to a function's address.
#define NEXT(type, function, name)                                                                                     \
    static type function;                                                                                              \
    if (function == NULL) {                                                                                            \
        void *symbol = next_symbol(name);                                                                              \
        memcpy(&function, &symbol, sizeof function);                                                                   \
    }

#endif
