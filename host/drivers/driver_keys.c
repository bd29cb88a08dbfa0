// SPDX-License-Identifier: BSD-3-Clause
// A key's value from the text of a rig file.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "host/drivers/driver.h"
#include "host/transport/gpio.h"

// Of the kinds that are words: each followed by a blank, in the order of their numbers.
static const char *const choices[] = {[GONIO_DRIVER_YES] = "0 1 ",
                                      [GONIO_DRIVER_NO] = "0 1 ",
                                      [GONIO_DRIVER_SIGN] = "0 1 ",
                                      [GONIO_DRIVER_PARITY] = "N E O ",
                                      [GONIO_DRIVER_BIAS] = "as-is pull-up pull-down "};

void gonio_driver_key_expected(const gonio_driver_key *key, char *text, size_t size) {
    switch (key->kind) {
    case GONIO_DRIVER_TEXT:
        snprintf(text, size, "1 to %zu characters", key->size - 1);
        return;
    case GONIO_DRIVER_WHOLE:
    case GONIO_DRIVER_REAL:
    case GONIO_DRIVER_MILLI:
    case GONIO_DRIVER_MICRO:
    case GONIO_DRIVER_PERCENT:
        snprintf(text, size, "%s from %g to %g", key->kind == GONIO_DRIVER_WHOLE ? "a whole number" : "a number",
                 key->low, key->high);
        return;
    case GONIO_DRIVER_HEX:
        snprintf(text, size, "four hexadecimal digits, as lsusb prints them");
        return;
    case GONIO_DRIVER_YES:
    case GONIO_DRIVER_NO:
    case GONIO_DRIVER_PARITY:
    case GONIO_DRIVER_BIAS:
    case GONIO_DRIVER_SIGN:
        snprintf(text, size, "one of: %.*s", (int)strlen(choices[key->kind]) - 1, choices[key->kind]);
        return;
    }
}

static bool set_number(const gonio_driver_key *key, void *at, const char *value) {
    static const double scales[] = {
        [GONIO_DRIVER_MILLI] = 1e-3, [GONIO_DRIVER_MICRO] = 1e-6, [GONIO_DRIVER_PERCENT] = 1e-2};
    char *end;
    const double number = gonio_number_parse(value, &end);
    const bool whole = key->kind == GONIO_DRIVER_WHOLE;
    if (end == value || *end != 0 || !(number >= key->low && number <= key->high) ||
        (whole && number != floor(number))) {
        return false;
    }
    if (whole) {
        *(int *)at = (int)number;
    } else {
        *(double *)at = key->kind == GONIO_DRIVER_REAL ? number : number * scales[key->kind];
    }
    return true;
}

// The index of the value among the choices; -1: none.
static int choice(const char *words, const char *value) {
    int index = 0;
    for (const char *c = words; *c != 0; c += strcspn(c, " ") + 1, index++) {
        if (strlen(value) == strcspn(c, " ") && strncmp(c, value, strlen(value)) == 0) {
            return index;
        }
    }
    return -1;
}

static bool set_choice(const gonio_driver_key *key, void *at, const char *value) {
    const int index = choice(choices[key->kind], value);
    if (index < 0) {
        return false;
    }
    if (key->kind == GONIO_DRIVER_PARITY) {
        *(char *)at = value[0];
    } else if (key->kind == GONIO_DRIVER_BIAS) {
        *(gonio_gpio_bias *)at = (gonio_gpio_bias)index;
    } else if (key->kind == GONIO_DRIVER_SIGN) {
        *(int *)at = index == 1 ? -1 : 1;
    } else {
        *(bool *)at = (index == 1) == (key->kind == GONIO_DRIVER_YES);
    }
    return true;
}

static bool set_text(const gonio_driver_key *key, char *at, const char *value) {
    const bool fits = value[0] != 0 && strlen(value) < key->size;
    if (fits) {
        strcpy(at, value);
    }
    return fits;
}

static bool set_hex(int *at, const char *value) {
    char *end;
    const unsigned long number = strtoul(value, &end, 16);
    const bool good = end != value && *end == 0 && number <= 0xffff;
    if (good) {
        *at = (int)number;
    }
    return good;
}

gonio_status gonio_driver_key_set(const gonio_driver_key *key, const char *section, void *settings, const char *value,
                                  gonio_error *error) {
    void *at = (char *)settings + key->offset;
    const bool number = key->kind >= GONIO_DRIVER_WHOLE && key->kind <= GONIO_DRIVER_PERCENT;
    const bool good = key->kind == GONIO_DRIVER_TEXT  ? set_text(key, at, value)
                      : key->kind == GONIO_DRIVER_HEX ? set_hex(at, value)
                      : number                        ? set_number(key, at, value)
                                                      : set_choice(key, at, value);
    if (good) {
        return GONIO_OK;
    }
    char expected[96];
    gonio_driver_key_expected(key, expected, sizeof expected);
    return gonio_fail(error, GONIO_E_INPUT, "[%s] %s: found '%.80s', expected %s", section, key->name, value, expected);
}
