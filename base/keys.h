// SPDX-License-Identifier: BSD-3-Clause
// The settings of a struct, one row a member: the command line, the journal, messages and --help follow the same table.
#ifndef GONIO_BASE_KEYS_H
#define GONIO_BASE_KEYS_H

#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#include "gonio/status.h"

typedef enum gonio_key_kind {
    GONIO_KEY_REAL,    // double
    GONIO_KEY_REALS,   // array of doubles
    GONIO_KEY_INTEGER, // int
    GONIO_KEY_SIZE,    // size_t; in text with a suffix k, M or G
    GONIO_KEY_SEED,    // uint64_t
    GONIO_KEY_BOOLEAN, // bool
    GONIO_KEY_TEXT,    // array of char
    GONIO_KEY_NAME,    // const char *, one of the names, which are static; NULL: none
    GONIO_KEY_CHOICE,  // an enum's value that counts the names
    GONIO_KEY_FLAGS,   // int whose bits count the names; in text with commas between them, "none" without any
} gonio_key_kind;

typedef struct gonio_key {
    const char *name; // the member's; NULL ends a table
    gonio_key_kind kind;
    size_t offset, size;
    const char *const *(*names)(void);
    bool automatic;       // -1 is written "auto"
    double low, high;     // of REAL and INTEGER; both 0: any finite value
    const char *was;      // the member's name in files of earlier releases; NULL: the same
    bool late;            // earlier releases lack it; it then keeps its default
    const char *option;   // its name on the command line; NULL: the member's, with hyphens
    const char *argument; // "FRACTION"; NULL: none
    const char *help;
} gonio_key;

// The head of a row; designated members may follow it.
#define GONIO_KEY(type, member, key_kind)                                                                              \
    .name = #member, .kind = GONIO_KEY_##key_kind, .offset = offsetof(type, member), .size = sizeof(((type *)0)->member)

// The value of that name in a NULL-terminated array, -1 where there is none.
static inline int gonio_names_find(const char *const *names, const char *name) {
    for (int i = 0; names[i] != NULL; i++) {
        if (strcmp(names[i], name) == 0) {
            return i;
        }
    }
    return -1;
}

// Take the value from text. GONIO_E_USAGE where it is impossible, with what was expected; the object is then as before.
gonio_status gonio_key_parse(const gonio_key *key, void *object, const char *text, gonio_error *error);
// The value as text that gonio_key_parse turns back into the same bits.
void gonio_key_print(const gonio_key *key, const void *object, char *text, size_t size);
// GONIO_E_USAGE where the object's value is one that no text gives.
gonio_status gonio_key_check(const gonio_key *key, const void *object, gonio_error *error);
bool gonio_key_equal(const gonio_key *key, const void *a, const void *b);
void gonio_key_copy(const gonio_key *key, void *to, const void *from);
// What a value may be: "a whole number from 0 to 9, or auto"; "linear, log or auto".
void gonio_key_expected(const gonio_key *key, char *text, size_t size);
// The option's name, "hold-out".
void gonio_key_option(const gonio_key *key, char *text, size_t size);

#endif
