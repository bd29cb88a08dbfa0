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
        if (key->kind == GONIO_KEY_TEXT) { // any text that fits
            char long_text[2 * sizeof(gonio_fit_options)];
            memset(long_text, 'x', sizeof long_text - 1);
            long_text[sizeof long_text - 1] = 0;
            refused(key, long_text);
            continue;
        }
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
        if (key->automatic == 0 && (key->names == NULL || gonio_names_find(key->names(), "auto") < 0)) {
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

// ---- keys of rig files ----

typedef struct rig_values {
    double percent, rgb[3], centre;
    int count;
    bool closed;
    char line[8];
} rig_values;
GONIO_KEY_NAMES(open_or_closed, "open", "closed")
#define RIG_KEY(text, kind, member) .section = "rig", GONIO_KEY_NAMED(rig_values, member, text, kind)
static const gonio_key rig_table[] = {
    {RIG_KEY("a_percent", REAL, percent), 0, 100, "0.2", .times = 100},
    {RIG_KEY("rgb", REALS, rgb), 0.01, 1, "0.99"},
    {RIG_KEY("centre", REAL, centre), -1e5, 1e5, "auto", .automatic = NAN},
    {RIG_KEY("count", INTEGER, count), 0, 1e6, "3"},
    {RIG_KEY("contact", BOOLEAN, closed), .standard = "closed", .names = open_or_closed},
    {RIG_KEY("line", LINE, line), .standard = "x"},
    {0}};

static void rig_take(rig_values *v, const char *name, const char *text, const char *printed) {
    gonio_error error = {0};
    char back[64];
    const gonio_key *key = gonio_key_find(rig_table, "rig", name);
    if (gonio_key_parse(key, v, text, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    gonio_key_print(key, v, back, sizeof back);
    assert_string_equal(back, printed);
}

static void rig_refuse(const char *name, const char *text, const char *expected) {
    rig_values v = {.line = "before"}, before = v;
    gonio_error error = {0};
    char message[200];
    snprintf(message, sizeof message, "[rig] %s: found '%s', expected %s", name, text, expected);
    assert_int_equal(gonio_key_parse(gonio_key_find(rig_table, "rig", name), &v, text, &error), GONIO_E_INPUT);
    assert_string_equal(error.message, message);
    assert_memory_equal(&v, &before, sizeof v);
}

static void keys_of_rig_files(void **state) {
    (void)state;
    rig_values v = {0};
    gonio_key_standards(rig_table, &v);
    assert_true(v.percent == 0.002 && v.rgb[0] == 0.99 && v.rgb[2] == 0.99 && isnan(v.centre) && v.count == 3);
    assert_true(v.closed && strcmp(v.line, "x") == 0);
    rig_take(&v, "a_percent", "12.5", "12.5");
    assert_true(v.percent == 0.125);
    rig_take(&v, "rgb", "0.050000000000000003/0.30000000000000004/1", "0.05/0.30000000000000004/1");
    rig_take(&v, "centre", "-1", "-1");
    rig_take(&v, "centre", "auto", "auto");
    rig_take(&v, "count", "1e3", "1000");
    rig_take(&v, "contact", "open", "open");
    assert_false(v.closed);
    rig_take(&v, "line", "1234567", "1234567");
    rig_refuse("a_percent", "100.1", "a number from 0 to 100");
    rig_refuse("rgb", "0.5/0.5", "a number from 0.01 to 1, or 3 with / between them");
    rig_refuse("rgb", "0.5/", "a number from 0.01 to 1, or 3 with / between them");
    rig_refuse("rgb", "0.5/0.5/0.5/0.5", "a number from 0.01 to 1, or 3 with / between them");
    rig_refuse("rgb", "0.5/0.5/2", "a number from 0.01 to 1, or 3 with / between them");
    rig_refuse("centre", "Auto", "a number from -100000 to 100000, or auto");
    rig_refuse("count", "0.5", "a whole number from 0 to 1e+06");
    rig_refuse("contact", "1", "open or closed");
    rig_refuse("line", "", "one line of 1 to 7 bytes");
    rig_refuse("line", "12345678", "one line of 1 to 7 bytes");
    rig_refuse("line", "a\nb", "one line of 1 to 7 bytes");
    char list[64] = "there are";
    gonio_key_list(rig_table, "rig", list, sizeof list);
    assert_string_equal(list, "there are a_percent rgb centre count contact line");
    assert_null(gonio_key_find(rig_table, "rig", "lin"));
    assert_null(gonio_key_find(rig_table, "camera", "line"));
    assert_null(gonio_key_find(NULL, "rig", "line"));
}

// The members that the header declares, one by one: each is in the table, or one of those that no file or command line
// can hold.
static void every_member_is_in_the_table(void **state) {
    (void)state;
    static const char *const apart[] = {"threads", "progress", "progress_context", "fill_store", NULL};
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
            char *bracket = strchr(item, '['), *name = bracket != NULL ? bracket : item + strlen(item);
            *name = 0;
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
    assert_int_equal(members, GONIO_FIT_KEYS + 4);
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
        cmocka_unit_test(keys_of_rig_files),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
