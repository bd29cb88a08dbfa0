// SPDX-License-Identifier: BSD-3-Clause
// A value of a key that is possible and not the default of gonio_fit_options.
#ifndef GONIO_TESTS_KEY_VALUES_H
#define GONIO_TESTS_KEY_VALUES_H

#include "base/keys.h"

static inline const char *other_value(const gonio_key *key) {
    switch (key->kind) {
    case GONIO_KEY_REAL:
        return "0.30000000000000004";
    case GONIO_KEY_INTEGER:
        return "3";
    case GONIO_KEY_SIZE:
        return "3000000000";
    case GONIO_KEY_SEED:
        return "18446744073709551615";
    case GONIO_KEY_BOOLEAN:
        return "1";
    case GONIO_KEY_NAME:
    case GONIO_KEY_CHOICE:
        return key->names()[0];
    case GONIO_KEY_FLAGS:
        return "reciprocity";
    case GONIO_KEY_REALS:
        return "7/8/9";
    case GONIO_KEY_TEXT:
    case GONIO_KEY_LINE:
        return "spec:another"; // names no file, which a session would copy
    case GONIO_KEY_OWN:
        break;
    }
    return NULL;
}

static inline void set_other(const gonio_key *key, void *object) {
    gonio_error error = {0};
    if (gonio_key_parse(key, object, other_value(key), &error) != GONIO_OK) {
        fail_msg("%s: %s", key->name, error.message);
    }
}

#endif
