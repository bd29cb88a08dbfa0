// SPDX-License-Identifier: BSD-3-Clause
#include "base/keys.h"

#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "base/text.h"

static void *at(const gonio_key *key, void *object) { return (char *)object + key->offset; }
static const void *in(const gonio_key *key, const void *object) { return (const char *)object + key->offset; }

void gonio_key_option(const gonio_key *key, char *text, size_t size) {
    snprintf(text, size, "%s", key->option != NULL ? key->option : key->name);
    for (char *c = text; *c != 0; c++) {
        *c = *c == '_' ? '-' : *c;
    }
}

// ---- tables ----

static bool is_in(const gonio_key *key, const char *section) {
    return key->section != NULL && strcmp(key->section, section) == 0;
}

const gonio_key *gonio_key_find(const gonio_key *table, const char *section, const char *name) {
    const gonio_key *key = table;
    while (key != NULL && key->name != NULL && !(is_in(key, section) && strcmp(key->name, name) == 0)) {
        key++;
    }
    return key != NULL && key->name != NULL ? key : NULL;
}

void gonio_key_list(const gonio_key *table, const char *section, char *text, size_t size) {
    for (const gonio_key *key = table; key != NULL && key->name != NULL; key++) {
        if (is_in(key, section)) {
            gonio_text_append(text, size, " %s", key->name);
        }
    }
}

void gonio_key_standards(const gonio_key *table, void *object) {
    for (const gonio_key *key = table; key->name != NULL; key++) {
        if (key->standard != NULL) {
            gonio_key_parse(key, object, key->standard, NULL);
        }
    }
}

// ---- what a value may be ----

// "a, b or c", with last (may be NULL) behind the names.
static void list_names(const char *const *names, const char *last, char *text, size_t size) {
    for (int i = 0; names[i] != NULL; i++) {
        const bool is_last = names[i + 1] == NULL && last == NULL;
        gonio_text_append(text, size, "%s%s", i == 0 ? "" : is_last ? " or " : ", ", names[i]);
    }
    if (last != NULL) {
        gonio_text_append(text, size, " or %s", last);
    }
}

static bool bounded(const gonio_key *key) { return key->low != 0 || key->high != 0; }

static void expected_number(const gonio_key *key, const char *what, char *text, size_t size) {
    if (!bounded(key)) {
        snprintf(text, size, "%s", what);
    } else if (isinf(key->high)) {
        snprintf(text, size, "%s from %g on", what, key->low);
    } else {
        snprintf(text, size, "%s from %g to %g", what, key->low, key->high);
    }
    gonio_text_append(text, size, "%s", key->automatic != 0 ? ", or auto" : "");
}

// False comes first.
static const char *const *boolean_names(const gonio_key *key) {
    static const char *const usual[] = {"0", "1", NULL};
    return key->names != NULL ? key->names() : usual;
}

void gonio_key_expected(const gonio_key *key, char *text, size_t size) {
    text[0] = 0;
    switch (key->kind) {
    case GONIO_KEY_REAL:
        expected_number(key, "a number", text, size);
        return;
    case GONIO_KEY_INTEGER:
        expected_number(key, "a whole number", text, size);
        return;
    case GONIO_KEY_REALS:
        expected_number(key, "a number", text, size);
        gonio_text_append(text, size, ", or %zu with / between them", key->size / sizeof(double));
        return;
    case GONIO_KEY_SIZE:
        snprintf(text, size, "a number of bytes, with k, M or G where it is large");
        return;
    case GONIO_KEY_SEED:
        snprintf(text, size, "a whole number from 0 to 2^64 - 1");
        return;
    case GONIO_KEY_BOOLEAN:
        list_names(boolean_names(key), NULL, text, size);
        return;
    case GONIO_KEY_LINE:
        snprintf(text, size, "one line of 1 to %zu bytes", key->size - 1);
        return;
    case GONIO_KEY_OWN:
        snprintf(text, size, "%s", key->form->expected);
        return;
    case GONIO_KEY_TEXT:
        snprintf(text, size, "at most %zu bytes", key->size - 1);
        return;
    case GONIO_KEY_NAME:
    case GONIO_KEY_CHOICE:
        list_names(key->names(), key->automatic != 0 ? "auto" : NULL, text, size);
        return;
    case GONIO_KEY_FLAGS:
        list_names(key->names(), "none", text, size);
        gonio_text_append(text, size, ", several with commas%s", key->automatic != 0 ? " between them, or auto" : "");
        return;
    }
}

// ---- text to value ----

// The number at the head of a text, and where it ends; NULL where there is none within the bounds.
static const char *number_at(const gonio_key *key, const char *text, double *value) {
    char *end;
    const double v = gonio_number_parse(text, &end);
    *value = v;
    return end != text && isfinite(v) && (!bounded(key) || (v >= key->low && v <= key->high)) ? end : NULL;
}

static bool parse_real(const gonio_key *key, const char *text, double *value) {
    const char *end = number_at(key, text, value);
    *value /= key->times > 0 ? key->times : 1;
    return end != NULL && *end == 0;
}

static bool parse_reals(const gonio_key *key, const char *text, double *values) {
    const size_t n = key->size / sizeof *values;
    size_t given = 0;
    for (;; text++) {
        text = number_at(key, text, &values[given++]);
        if (text == NULL || *text != '/' || given == n) {
            break;
        }
    }
    for (size_t k = 1; k < n && given == 1; k++) {
        values[k] = values[0];
    }
    return text != NULL && *text == 0 && (given == 1 || given == n);
}

static bool parse_integer(const gonio_key *key, const char *text, int *value) {
    double v;
    const char *end = number_at(key, text, &v);
    const bool good = end != NULL && *end == 0 && v == floor(v) && v >= INT_MIN && v <= INT_MAX;
    *value = good ? (int)v : 0;
    return good;
}

static bool parse_seed(const char *text, uint64_t *value) {
    char *end;
    errno = 0;
    *value = strtoull(text, &end, 10);
    return end != text && *end == 0 && errno == 0 && strchr(text, '-') == NULL;
}

static bool parse_flags(const char *const *names, const char *text, int *value) {
    *value = 0;
    if (strcmp(text, "none") == 0) {
        return true;
    }
    for (;; text++) {
        const size_t length = strcspn(text, ",");
        char name[32];
        snprintf(name, sizeof name, "%.*s", (int)length, text);
        const int bit = length < sizeof name ? gonio_names_find(names, name) : -1;
        if (bit < 0) {
            return false;
        }
        *value |= 1 << bit;
        text += length;
        if (*text == 0) {
            return true;
        }
    }
}

static bool parse_choice(const char *const *names, const char *text, int *value) {
    *value = gonio_names_find(names, text);
    return *value >= 0;
}

static bool parse_name(const char *const *names, const char *text, const char **value) {
    const int found = gonio_names_find(names, text);
    *value = found >= 0 ? names[found] : NULL;
    return found >= 0;
}

// Room for one value of a kind that has one.
typedef union value {
    double real;
    int integer;
    size_t size;
    uint64_t seed;
    bool boolean;
    const char *name;
} value;

static bool parse_single(const gonio_key *key, const char *text, value *v) {
    if (key->automatic != 0 && strcmp(text, "auto") == 0) {
        if (key->kind == GONIO_KEY_REAL) {
            v->real = key->automatic;
        } else {
            v->integer = (int)key->automatic;
        }
        return true;
    }
    switch (key->kind) {
    case GONIO_KEY_REAL:
        return parse_real(key, text, &v->real);
    case GONIO_KEY_INTEGER:
        return parse_integer(key, text, &v->integer);
    case GONIO_KEY_SIZE:
        return gonio_text_count(text, &v->size);
    case GONIO_KEY_SEED:
        return parse_seed(text, &v->seed);
    case GONIO_KEY_BOOLEAN:
        v->boolean = gonio_names_find(boolean_names(key), text) == 1;
        return gonio_names_find(boolean_names(key), text) >= 0;
    case GONIO_KEY_NAME:
        return parse_name(key->names(), text, &v->name);
    case GONIO_KEY_CHOICE:
        return parse_choice(key->names(), text, &v->integer);
    case GONIO_KEY_FLAGS:
        return parse_flags(key->names(), text, &v->integer);
    case GONIO_KEY_REALS:
    case GONIO_KEY_TEXT:
    case GONIO_KEY_LINE:
    case GONIO_KEY_OWN:
        break;
    }
    return false;
}

static bool parse(const gonio_key *key, void *object, const char *text) {
    if (key->kind == GONIO_KEY_OWN) {
        return key->form->parse(text, at(key, object));
    }
    if (key->kind == GONIO_KEY_TEXT || key->kind == GONIO_KEY_LINE) {
        const bool line = text[0] != 0 && strpbrk(text, "\r\n") == NULL;
        const bool fits = strlen(text) < key->size && (line || key->kind == GONIO_KEY_TEXT);
        if (fits) {
            strcpy(at(key, object), text);
        }
        return fits;
    }
    if (key->kind == GONIO_KEY_REALS) {
        double values[key->size / sizeof(double)];
        const bool good = parse_reals(key, text, values);
        if (good) {
            memcpy(at(key, object), values, key->size);
        }
        return good;
    }
    value v = {0};
    const bool good = parse_single(key, text, &v);
    if (good) {
        memcpy(at(key, object), &v, key->size);
    }
    return good;
}

gonio_status gonio_key_parse(const gonio_key *key, void *object, const char *text, gonio_error *error) {
    if (parse(key, object, text)) {
        return GONIO_OK;
    }
    char option[64], expected[256];
    gonio_key_expected(key, expected, sizeof expected);
    if (key->section != NULL) {
        return gonio_fail(error, GONIO_E_INPUT, "[%s] %s: found '%.80s', expected %s", key->section, key->name, text,
                          expected);
    }
    gonio_key_option(key, option, sizeof option);
    return gonio_fail(error, GONIO_E_USAGE, "--%s: expected %s, found '%s'", option, expected, text);
}

// ---- value to text ----

static void print_flags(const char *const *names, int flags, char *text, size_t size) {
    snprintf(text, size, "%s", flags == 0 ? "none" : "");
    for (int bit = 0; names[bit] != NULL; bit++) {
        if ((flags & 1 << bit) != 0) {
            gonio_text_append(text, size, "%s%s", text[0] != 0 ? "," : "", names[bit]);
        }
    }
}

static int names_count(const char *const *names) {
    int n = 0;
    while (names[n] != NULL) {
        n++;
    }
    return n;
}

static void print_integer(const gonio_key *key, int v, char *text, size_t size) {
    if (key->automatic != 0 && v == (int)key->automatic) {
        snprintf(text, size, "auto");
    } else if (key->kind == GONIO_KEY_FLAGS) {
        print_flags(key->names(), v, text, size);
    } else if (key->kind == GONIO_KEY_CHOICE && v >= 0 && v < names_count(key->names())) {
        snprintf(text, size, "%s", key->names()[v]);
    } else {
        snprintf(text, size, "%d", v);
    }
}

static void print_reals(const gonio_key *key, const double *values, char *text, size_t size) {
    text[0] = 0;
    if (key->automatic != 0 && (values[0] == key->automatic || (isnan(values[0]) && isnan(key->automatic)))) {
        snprintf(text, size, "auto");
        return;
    }
    for (size_t k = 0; k < key->size / sizeof *values; k++) {
        char number[32];
        gonio_text_shortest(values[k] * (key->times > 0 ? key->times : 1), number);
        gonio_text_append(text, size, "%s%s", k > 0 ? "/" : "", number);
    }
}

void gonio_key_print(const gonio_key *key, const void *object, char *text, size_t size) {
    const void *v = in(key, object);
    switch (key->kind) {
    case GONIO_KEY_REAL:
    case GONIO_KEY_REALS:
        print_reals(key, v, text, size);
        return;
    case GONIO_KEY_INTEGER:
    case GONIO_KEY_CHOICE:
    case GONIO_KEY_FLAGS:
        print_integer(key, *(const int *)v, text, size);
        return;
    case GONIO_KEY_SIZE:
        snprintf(text, size, "%zu", *(const size_t *)v);
        return;
    case GONIO_KEY_SEED:
        snprintf(text, size, "%" PRIu64, *(const uint64_t *)v);
        return;
    case GONIO_KEY_BOOLEAN:
        snprintf(text, size, "%s", boolean_names(key)[*(const bool *)v]);
        return;
    case GONIO_KEY_OWN:
        key->form->print(v, text, size);
        return;
    case GONIO_KEY_TEXT:
    case GONIO_KEY_LINE:
        snprintf(text, size, "%s", (const char *)v);
        return;
    case GONIO_KEY_NAME: {
        const char *name = *(const char *const *)v;
        snprintf(text, size, "%s", name != NULL ? name : "");
        return;
    }
    }
}

// ---- values of the object ----

bool gonio_key_equal(const gonio_key *key, const void *a, const void *b) {
    const void *x = in(key, a), *y = in(key, b);
    if (key->kind == GONIO_KEY_TEXT || key->kind == GONIO_KEY_LINE) {
        return strcmp(x, y) == 0;
    }
    if (key->kind == GONIO_KEY_NAME) {
        const char *left = *(const char *const *)x, *right = *(const char *const *)y;
        return left == right || (left != NULL && right != NULL && strcmp(left, right) == 0);
    }
    return memcmp(x, y, key->size) == 0;
}

void gonio_key_copy(const gonio_key *key, void *to, const void *from) { memcpy(at(key, to), in(key, from), key->size); }

gonio_status gonio_key_check(const gonio_key *key, const void *object, gonio_error *error) {
    if (key->kind == GONIO_KEY_NAME && *(const char *const *)in(key, object) == NULL) {
        return GONIO_OK;
    }
    char text[1024];
    _Alignas(max_align_t) char copy[key->offset + key->size];
    gonio_key_print(key, object, text, sizeof text);
    gonio_status status = gonio_key_parse(key, copy, text, error);
    if (status == GONIO_OK && !gonio_key_equal(key, copy, object)) {
        status = gonio_fail(error, GONIO_E_USAGE, "%s: a value that stands for nothing", key->name);
    }
    return status;
}
