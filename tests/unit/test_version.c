// SPDX-License-Identifier: BSD-3-Clause
// The version of the library is that of the header, part by part.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "gonio/gonio.h"

static void it_is_the_headers(void **state) {
    (void)state;
    char text[64];
    snprintf(text, sizeof text, "%d.%d.%d", GONIO_VERSION_MAJOR, GONIO_VERSION_MINOR, GONIO_VERSION_PATCH);
    assert_string_equal(gonio_version(), text);
    assert_string_equal(GONIO_VERSION, text);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(it_is_the_headers)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
