// SPDX-License-Identifier: BSD-3-Clause
// Reading lines, rows of tables and settings, as every list and rig file is read.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "base/text.h"
#include "tests/unit/scratch.h"

// What a text's rows are, joined by '|'.
static void rows_are(const char *data, size_t size, const char *expected) {
    char path[64], found[256] = "";
    gonio_text text;
    scratch_file(path, data, size);
    assert_int_equal(gonio_text_open(path, 0, &text, NULL), GONIO_OK);
    for (char *line; (line = gonio_text_row(&text)) != NULL;) {
        char *fields[8];
        const int n = gonio_text_split(line, ',', fields, 8);
        for (int k = 0; k < n; k++) {
            gonio_text_append(found, sizeof found, "%s%s", fields[k], k + 1 < n ? "," : "|");
        }
    }
    gonio_text_free(&text);
    unlink(path);
    assert_string_equal(found, expected);
}

static void rows(void **state) {
    (void)state;
    static const char *const same[] = {"a,b,c\n1,2,3\n",
                                       "a,b,c\n1,2,3",
                                       "\xef\xbb\xbf"
                                       "a,b,c\r\n1,2,3\r\n",
                                       " a , b , c \n\n1\t,\t2,3\t\n\n",
                                       "# x\na,b,c\n  # y\n1,2,3\n",
                                       "a b c\n1 2 3\n",
                                       "a\tb\tc\n1\t2\t3\n",
                                       "  a   b \t c  \r\n1 2\t3\n",
                                       "\xc2\xa0"
                                       "a,\xc2\xa0"
                                       "b,c\xc2\xa0\n1\xc2\xa0"
                                       "2\xc2\xa0"
                                       "3\n"};
    for (size_t k = 0; k < sizeof same / sizeof *same; k++) {
        rows_are(same[k], strlen(same[k]), "a,b,c|1,2,3|");
    }
    rows_are("", 0, "");
    rows_are("a,,c\n", 5, "a,,c|");
    rows_are("\xc2", 1, "\xc2|");
}

static void other_kinds(void **state) {
    (void)state;
    static const struct {
        const char *data;
        size_t size;
        const char *says;
    } cases[] = {{"\xff\xfe"
                  "a\0,\0b\0\n\0",
                  10, "UTF-16"},
                 {"\xfe\xff\0a\0,\0b\0\n", 10, "UTF-16"},
                 {"a\0,\0b\0\n\0", 8, "UTF-16"},
                 {"\0a\0,\0b\0\n", 8, "UTF-16"},
                 {"\xff\xfe\0\0a\0\0\0", 8, "UTF-32"},
                 {"\0\0\xfe\xff\0\0\0a", 8, "UTF-32"},
                 {"a,b\r1,2\r", 8, "CR alone"},
                 {"a,b\r\r", 5, "CR alone"}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        gonio_error error = {0};
        assert_int_equal(gonio_text_check("x", cases[k].data, cases[k].size, &error), GONIO_E_INPUT);
        assert_non_null(strstr(error.message, cases[k].says));
    }
    static const char *const good[] = {"", "a", "a\r", "a\r\n", "a\r\nb\rc\n", "\357\273\277a"};
    for (size_t k = 0; k < sizeof good / sizeof *good; k++) {
        assert_int_equal(gonio_text_check("x", good[k], strlen(good[k]), NULL), GONIO_OK);
    }
}

static void settings(void **state) {
    (void)state;
    char data[] = "[s]\n; c\n# c\na = 1\n b=2 ; why\nc = 3\t# +- 4\nd = x;y#z\ne =\nf = ; none\n";
    static const char *const expected[][3] = {{"[s]", NULL, NULL}, {"a", "1", NULL},     {"b", "2", "why"},
                                              {"c", "3", "+- 4"},  {"d", "x;y#z", NULL}, {"e", "", NULL},
                                              {"f", "", "none"}};
    gonio_text text = gonio_text_begin("x", data, strlen(data));
    for (size_t k = 0; k < sizeof expected / sizeof *expected; k++) {
        char *value, *comment, *key = gonio_text_setting(&text, &value, &comment);
        const char *const found[3] = {key, value, comment};
        for (int i = 0; i < 3; i++) {
            if (expected[k][i] == NULL) {
                assert_null(found[i]);
            } else {
                assert_string_equal(found[i], expected[k][i]);
            }
        }
    }
    char *value, *comment;
    assert_null(gonio_text_setting(&text, &value, &comment));
}

static void missing(void **state) {
    (void)state;
    static const char *const words[] = {"NaN", "nan", "-nan", "NA", "n/a", "#N/A", "null", "None", "-", "--"};
    gonio_text text = gonio_text_begin("x", (char[]){""}, 0);
    for (size_t k = 0; k < sizeof words / sizeof *words; k++) {
        gonio_error error = {0};
        double value;
        assert_int_equal(gonio_text_number(&text, words[k], "v", &value, &error), GONIO_E_INPUT);
        assert_non_null(strstr(error.message, "missing"));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(rows), cmocka_unit_test(other_kinds),
                                       cmocka_unit_test(settings), cmocka_unit_test(missing)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
