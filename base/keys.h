// SPDX-License-Identifier: BSD-3-Clause
// The settings of a struct, one row a member: the command line, rig files, the journal, messages and --help follow the
// same table.
#ifndef GONIO_BASE_KEYS_H
#define GONIO_BASE_KEYS_H

#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#include "gonio/status.h"

typedef enum gonio_key_kind {
    GONIO_KEY_REAL,    // double
    GONIO_KEY_REALS,   // array of doubles; in text with / between them, or one number for all
    GONIO_KEY_INTEGER, // int
    GONIO_KEY_SIZE,    // size_t; in text with a suffix k, M or G
    GONIO_KEY_SEED,    // uint64_t
    GONIO_KEY_BOOLEAN, // bool; the names are those of false and true, by default 0 and 1
    GONIO_KEY_TEXT,    // array of char
    GONIO_KEY_LINE,    // array of char, not empty and without line breaks
    GONIO_KEY_NAME,    // const char *, one of the names, which are static; NULL: none
    GONIO_KEY_CHOICE,  // an enum's value that counts the names
    GONIO_KEY_FLAGS,   // int whose bits count the names; in text with commas between them, "none" without any
    GONIO_KEY_OWN,     // what the key's form says
} gonio_key_kind;

// How a value of a kind of its own is written.
typedef struct gonio_key_form {
    const char *expected;                         // "four hexadecimal digits"
    bool (*parse)(const char *text, void *value); // false where the text is impossible; the value is then as before
    void (*print)(const void *value, char *text, size_t size); // NULL: the key is never printed
} gonio_key_form;

typedef struct gonio_key {
    const char *name; // the member's, or in its section of a rig file; NULL ends a table
    gonio_key_kind kind;
    size_t offset, size;
    double low, high;     // of numbers, as the text has them; both 0: any finite value
    const char *standard; // the default as text; NULL: what the struct's maker says
    const char *section;  // of a rig file, "camera"; NULL: an option of the command line
    bool shared;          // of a driver's keys: the simulator has a key of this name, which means the same
    double times;         // of REAL: how many times the member the text's number is, 100 of a percentage; 0: once
    const gonio_key_form *form;
    const char *const *(*names)(void);
    double automatic;     // the value that is written "auto", -1 or (of REAL) NaN; 0: none
    const char *was;      // the member's name in files of earlier releases; NULL: the same
    bool late;            // earlier releases lack it; it then keeps its default
    const char *option;   // its name on the command line; NULL: the member's, with hyphens
    const char *argument; // "FRACTION"; NULL: none
    const char *help;
} gonio_key;

// The head of a row; designated members may follow it.
#define GONIO_KEY(type, member, key_kind) GONIO_KEY_NAMED(type, member, #member, key_kind)
// The same where the text has another name for the member; low and high may follow it.
#define GONIO_KEY_NAMED(type, member, text, key_kind)                                                                  \
    .name = text, .kind = GONIO_KEY_##key_kind, .offset = offsetof(type, member), .size = sizeof(((type *)0)->member)
// A function that gives names, for the column of that name.
#define GONIO_KEY_NAMES(function, ...)                                                                                 \
    static const char *const *function(void) {                                                                         \
        static const char *const names[] = {__VA_ARGS__, NULL};                                                        \
        return names;                                                                                                  \
    }

// The value of that name in a NULL-terminated array, -1 where there is none.
static inline int gonio_names_find(const char *const *names, const char *name) {
    for (int i = 0; names[i] != NULL; i++) {
        if (strcmp(names[i], name) == 0) {
            return i;
        }
    }
    return -1;
}

// The key of that name in that section; NULL: none, or no table.
const gonio_key *gonio_key_find(const gonio_key *table, const char *section, const char *name);
// Append " NAME" of every key in the section.
void gonio_key_list(const gonio_key *table, const char *section, char *text, size_t size);
// Set every member that has a standard to it.
void gonio_key_standards(const gonio_key *table, void *object);
// Take the value from text. Where it is impossible: GONIO_E_INPUT of a key in a section, else GONIO_E_USAGE, with what
// was found and expected; the object is then as before.
gonio_status gonio_key_parse(const gonio_key *key, void *object, const char *text, gonio_error *error);
// The value as text that gonio_key_parse turns back into the same bits (but for rounding where a key has `times`).
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
