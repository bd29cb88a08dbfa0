// SPDX-License-Identifier: BSD-3-Clause
// Tables of members: text to value and back, what is refused, and that the fit's table names every member.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "fit/options.h"
#include "tests/unit/key_values.h"

static void values_come_back(void **state) {
    (void)state;
    for (const gonio_key *key = gonio_fit_keys; key->name != NULL; key++) {
        gonio_fit_options usual, other, back;
        gonio_error error = {0};
        char text[256];
        gonio_fit_options_default(&usual);
        other = back = usual;
        set_other(key, &other);
        assert_false(gonio_key_equal(key, &usual, &other));
        gonio_key_print(key, &other, text, sizeof text);
        assert_string_equal(text, other_value(key));
        assert_int_equal(gonio_key_parse(key, &back, text, &error), GONIO_OK);
        assert_true(gonio_key_equal(key, &back, &other));
        gonio_key_copy(key, &back, &usual);
        assert_memory_equal(&back, &usual, sizeof back); // no other member was touched
        assert_int_equal(gonio_key_check(key, &other, &error), GONIO_OK);
        assert_int_equal(gonio_key_check(key, &usual, &error), GONIO_OK);
    }
}

static void refused(const gonio_key *key, const char *text) {
    gonio_fit_options o, before;
    gonio_error error = {0};
    gonio_fit_options_default(&o);
    before = o;
    if (gonio_key_parse(key, &o, text, &error) != GONIO_E_USAGE) {
        fail_msg("%s takes '%s'", key->name, text);
    }
    assert_memory_equal(&o, &before, sizeof o);
    assert_non_null(strstr(error.message, "expected"));
}

static void impossible_texts_are_refused(void **state) {
    (void)state;
    int n = 0;
    for (const gonio_key *key = gonio_fit_keys; key->name != NULL; key++) {
        static const char *const never[] = {
            "", " ", "x", "nan", "inf", "1 2", "1x", "auto,auto", "99999999999999999999999"};
        for (size_t k = 0; k < sizeof never / sizeof *never; k++) {
            // A real number has room for the last one.
            if (key->kind != GONIO_KEY_REAL || k + 1 < sizeof never / sizeof *never) {
                refused(key, never[k]);
                n++;
            }
        }
        const bool bounded = key->low != 0 || key->high != 0;
        char text[64];
        if (bounded && isfinite(key->high)) {
            snprintf(text, sizeof text, "%.0f", key->high + 1);
            refused(key, text);
        }
        if (bounded) {
            snprintf(text, sizeof text, "%.0f", key->low - 2);
            refused(key, text);
        }
        if (!key->automatic && (key->names == NULL || gonio_names_find(key->names(), "auto") < 0)) {
            refused(key, "auto");
        }
    }
    print_message("# %d impossible texts\n", n);
}

static const gonio_key *named(const char *name) {
    const gonio_key *key = gonio_fit_keys;
    while (key->name != NULL && strcmp(key->name, name) != 0) {
        key++;
    }
    return key->name != NULL ? key : NULL;
}

static void special_texts(void **state) {
    (void)state;
    gonio_fit_options o;
    gonio_fit_options_default(&o);
    assert_int_equal(gonio_key_parse(named("symmetry"), &o, "reciprocity,mirror", NULL), GONIO_OK);
    assert_int_equal(o.symmetry, GONIO_SYMMETRY_MIRROR | GONIO_SYMMETRY_RECIPROCITY);
    assert_int_equal(gonio_key_parse(named("symmetry"), &o, "none", NULL), GONIO_OK);
    assert_int_equal(o.symmetry, 0);
    assert_int_equal(gonio_key_parse(named("symmetry"), &o, "auto", NULL), GONIO_OK);
    assert_int_equal(o.symmetry, GONIO_SYMMETRY_AUTO);
    assert_int_equal(gonio_key_parse(named("max_bytes"), &o, "1.5k", NULL), GONIO_OK);
    assert_int_equal(o.max_bytes, 1500);
    assert_int_equal(gonio_key_parse(named("max_bytes"), &o, "9007199254740993", NULL), GONIO_OK); // 2^53 + 1
    assert_true(o.max_bytes == 9007199254740993u);
    assert_int_equal(gonio_key_parse(named("lambda"), &o, "-3", NULL), GONIO_OK);
    assert_true(o.lambda == -3);
    // Values that no text gives, set by a program.
    o.symmetry = 64;
    assert_int_equal(gonio_key_check(named("symmetry"), &o, NULL), GONIO_E_USAGE);
    o.coordinates = GONIO_COORDINATES;
    assert_int_equal(gonio_key_check(named("coordinates"), &o, NULL), GONIO_E_USAGE);
    o.hold_out = NAN;
    assert_int_equal(gonio_key_check(named("hold_out"), &o, NULL), GONIO_E_USAGE);
}

// The members that the header declares, one by one: each is in the table, or one of those that no file or command line
// can hold.
static void every_member_is_in_the_table(void **state) {
    (void)state;
    static const char *const apart[] = {"threads", "progress", "progress_context", NULL};
    FILE *header = fopen("include/gonio/fit.h", "r");
    char line[256];
    bool inside = false;
    int members = 0;
    assert_non_null(header);
    while (fgets(line, sizeof line, header) != NULL) {
        if (strncmp(line, "typedef struct gonio_fit_options {", 34) == 0) {
            inside = true;
            continue;
        }
        if (line[0] == '}') {
            inside = false;
        }
        char *comment = strstr(line, "//");
        if (comment != NULL) {
            *comment = 0;
        }
        char *end = strchr(line, ';');
        if (!inside || end == NULL) {
            continue;
        }
        *end = 0;
        // "double max_ns, max_seconds": every name behind the type's last blank or star.
        for (char *rest, *item = strtok_r(line, ",", &rest); item != NULL; item = strtok_r(NULL, ",", &rest)) {
            char *name = item + strlen(item);
            while (name > item && name[-1] != ' ' && name[-1] != '*') {
                name--;
            }
            members++;
            if (named(name) == NULL && gonio_names_find(apart, name) < 0) {
                fail_msg("gonio_fit_options.%s is not in the table of fit/options.c", name);
            }
        }
    }
    fclose(header);
    assert_int_equal(members, GONIO_FIT_KEYS + 3);
}

// Two keys never share a byte: a row names the member that its offset is of.
static void members_do_not_overlap(void **state) {
    (void)state;
    unsigned char taken[sizeof(gonio_fit_options)] = {0};
    for (const gonio_key *key = gonio_fit_keys; key->name != NULL; key++) {
        for (size_t k = 0; k < key->size; k++) {
            assert_int_equal(taken[key->offset + k]++, 0);
        }
    }
}

static void every_option_has_its_help(void **state) {
    (void)state;
    char help[512];
    for (const gonio_key *key = gonio_fit_keys; key->name != NULL; key++) {
        gonio_fit_option_help(key, help, sizeof help);
        assert_true(strlen(help) > 10 && strlen(help) < 400);
        if (key->names != NULL) {
            for (int i = 0; key->names()[i] != NULL; i++) {
                assert_non_null(strstr(help, key->names()[i]));
            }
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_come_back),       cmocka_unit_test(impossible_texts_are_refused),
        cmocka_unit_test(special_texts),          cmocka_unit_test(every_member_is_in_the_table),
        cmocka_unit_test(members_do_not_overlap), cmocka_unit_test(every_option_has_its_help),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
