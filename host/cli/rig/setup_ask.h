// SPDX-License-Identifier: BSD-3-Clause
// The questions of gonio rig setup: they go to stderr, the answers come from the terminal or a pipe, one a line.
#ifndef GONIO_CLI_RIG_SETUP_ASK_H
#define GONIO_CLI_RIG_SETUP_ASK_H

#include "host/cli/rig/actions.h"

// A contact whose levels are printed as they change, while an answer is waited for.
typedef struct setup_watched {
    gonio_controller *c;
    int contact;
    bool level, moved;
} setup_watched;

// An empty answer is the usual one, which is shown in brackets. watched: NULL: nothing.
gonio_status setup_ask(setup_watched *watched, const char *question, const char *usual, char *answer, size_t size,
                       gonio_error *error);
gonio_status setup_ask_number(const char *question, double usual, double low, double high, double *value,
                              gonio_error *error);
// One of some words, by its first letters; *which counts them.
gonio_status setup_ask_word(setup_watched *watched, const char *question, const char *const *words, int usual,
                            int *which, gonio_error *error);
gonio_status setup_ask_yes(const char *question, bool *yes, gonio_error *error);

// The devices beside the stage: lists what is attached, asks, tries each. What the rig file is to say of them is
// appended to `ini`.
gonio_status setup_devices(gonio_controller *c, char *ini, size_t size, gonio_error *error);

#endif
