// SPDX-License-Identifier: BSD-3-Clause
// A folder for one test, and the path of a session in it: cmocka's set_up and tear_down.
#pragma once
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

static char root[64], path[96];

static int set_up(void **state) {
    (void)state;
    snprintf(root, sizeof root, "%s", "/tmp/gonio-test-XXXXXX");
    if (mkdtemp(root) == NULL) {
        return -1;
    }
    snprintf(path, sizeof path, "%s/s", root);
    return 0;
}

static inline int shell(const char *format, ...) __attribute__((format(printf, 1, 2)));
static inline int shell(const char *format, ...) {
    char command[1024];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(command, sizeof command, format, arguments);
    va_end(arguments);
    return system(command);
}
#define shell_does(...) assert_int_equal(shell(__VA_ARGS__), 0)

static int tear_down(void **state) {
    (void)state;
    return shell("rm -rf %s", root);
}
