// SPDX-License-Identifier: BSD-3-Clause
// Status codes: names, exit statuses, and the error that calls fill.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gonio/status.h"

static void every_status_has_its_texts(void **state) {
    (void)state;
#define X(name, value, exit_status, text)                                                                              \
    assert_int_equal(GONIO_##name, value);                                                                             \
    assert_string_equal(gonio_status_name(GONIO_##name), #name);                                                       \
    assert_string_equal(gonio_status_text(GONIO_##name), text);                                                        \
    assert_int_equal(gonio_status_exit(GONIO_##name), exit_status);
    GONIO_STATUS_LIST(X)
#undef X
    // The command line's promise.
    assert_int_equal(gonio_status_exit(GONIO_OK), 0);
    assert_int_equal(gonio_status_exit(GONIO_E_USAGE), 2);
    assert_int_equal(gonio_status_exit(GONIO_E_INPUT), 3);
    assert_int_equal(gonio_status_exit(GONIO_E_INTERRUPTED), 4);
    assert_int_equal(gonio_status_exit((gonio_status)-99), 1);
    assert_string_equal(gonio_status_name((gonio_status)-99), "E_UNKNOWN");
}

static void an_error_tells_which_frame(void **state) {
    (void)state;
    gonio_error e = {0};
    assert_int_equal(gonio_fail_frame(&e, GONIO_E_DEVICE, 12, 3, "%d of %d", 4, 5), GONIO_E_DEVICE);
    assert_string_equal(e.message, "step 12 frame 3: 4 of 5");
    assert_true(e.step == 12 && e.frame == 3);
    gonio_fail(&e, GONIO_E_DEVICE, "none");
    assert_true(e.step == -1 && e.frame == -1);
    assert_int_equal(gonio_fail_frame(NULL, GONIO_E_IO, 0, 0, "nobody listens"), GONIO_E_IO);
}

static void an_error_tells_where(void **state) {
    (void)state;
    gonio_error e = {0};
    assert_int_equal(gonio_fail_line(&e, GONIO_E_INPUT, "a.csv", 7, "found %d", 3), GONIO_E_INPUT);
    assert_int_equal(e.status, GONIO_E_INPUT);
    assert_string_equal(e.message, "found 3");
    assert_string_equal(e.file, "a.csv");
    assert_true(e.line == 7 && e.byte == -1);
    assert_int_equal(gonio_fail_byte(&e, GONIO_E_IO, "b.bin", 12, "cut off"), GONIO_E_IO);
    assert_true(e.line == -1 && e.byte == 12);
    assert_int_equal(gonio_fail(&e, GONIO_E_USAGE, "no"), GONIO_E_USAGE);
    assert_string_equal(e.file, "");
    assert_int_equal(gonio_fail(NULL, GONIO_E_MEMORY, "nobody asks"), GONIO_E_MEMORY);
}

static void an_error_may_quote_itself_and_be_too_long(void **state) {
    (void)state;
    gonio_error e = {0};
    gonio_fail(&e, GONIO_E_INPUT, "inner");
    gonio_fail_line(&e, GONIO_E_INPUT, e.file, -1, "outer: %s", e.message);
    assert_string_equal(e.message, "outer: inner");
    char long_text[2000];
    memset(long_text, 'x', sizeof long_text - 1);
    long_text[sizeof long_text - 1] = 0;
    gonio_fail_line(&e, GONIO_E_INPUT, long_text, 1, "%s", long_text);
    assert_int_equal(strlen(e.message), sizeof e.message - 1);
    assert_int_equal(strlen(e.file), sizeof e.file - 1);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_status_has_its_texts),
        cmocka_unit_test(an_error_tells_where),
        cmocka_unit_test(an_error_tells_which_frame),
        cmocka_unit_test(an_error_may_quote_itself_and_be_too_long),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
