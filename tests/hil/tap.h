// SPDX-License-Identifier: BSD-3-Clause
// One line a check, as tests/run.sh counts them. A program's status says whether all passed.
#ifndef GONIO_TESTS_HIL_TAP_H
#define GONIO_TESTS_HIL_TAP_H

#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>

static int failures;

// Passes where good is set; name and a detail, which is shown where it is not.
__attribute__((format(printf, 3, 4))) static inline bool check(bool good, const char *name, const char *detail, ...) {
    char text[700];
    va_list arguments;
    va_start(arguments, detail);
    vsnprintf(text, sizeof text, detail, arguments);
    va_end(arguments);
    failures += !good;
    if (good) {
        printf("ok - %s\n", name);
    } else {
        printf("not ok - %s\n# %s\n", name, text);
    }
    fflush(stdout);
    return good;
}

#endif
