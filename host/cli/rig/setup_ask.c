// SPDX-License-Identifier: BSD-3-Clause
#include "host/cli/rig/setup_ask.h"

#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/number.h"

enum { WATCH_MS = 100 };

static gonio_status look(setup_watched *w, gonio_error *error) {
    gonio_controller_status now;
    if (w == NULL) {
        return GONIO_OK;
    }
    const gonio_status status = gonio_controller_read_status(w->c, &now, error);
    const bool level = status == GONIO_OK && (now.inputs >> w->contact & 1) != 0;
    if (status == GONIO_OK && level != w->level) {
        fprintf(stderr, "\n    %s: %s ", gonio_parameter_contacts()[w->contact], level ? "high" : "low");
        w->level = level;
        w->moved = true;
    }
    return status;
}

// One line of standard input, read byte by byte so that poll tells of what is left. What is watched is looked at until
// it is there, and once more then.
static gonio_status read_line(setup_watched *w, char *line, size_t size, gonio_error *error) {
    size_t n = 0;
    for (;;) {
        struct pollfd in = {STDIN_FILENO, POLLIN, 0};
        const int ready = poll(&in, 1, WATCH_MS);
        char byte;
        if (cli_interrupted()) {
            return gonio_fail(error, GONIO_E_INTERRUPTED, "setup: interrupted; no rig file was written");
        }
        if (ready <= 0) {
            const gonio_status status = look(w, error);
            if (status != GONIO_OK) {
                return status;
            }
            continue;
        }
        const ssize_t got = read(STDIN_FILENO, &byte, 1);
        if (got < 0 && errno == EINTR) {
            continue;
        }
        if (got <= 0) {
            return gonio_fail(error, GONIO_E_USAGE, "setup: the answers ended; no rig file was written");
        }
        if (byte == '\n') {
            line[n] = 0;
            return look(w, error);
        }
        if (n + 1 < size && byte != '\r') {
            line[n++] = byte;
        }
    }
}

// Ask; an empty answer is the one in brackets. A pipe's answers are shown, so that the dialogue can be read.
gonio_status setup_ask(setup_watched *w, const char *question, const char *usual, char *answer, size_t size,
                       gonio_error *error) {
    fprintf(stderr, "%s [%s]: ", question, usual);
    fflush(stderr);
    const gonio_status status = read_line(w, answer, size, error);
    if (status == GONIO_OK && isatty(STDIN_FILENO) != 1) {
        fprintf(stderr, "%s\n", cli_text(answer));
    }
    if (status == GONIO_OK && answer[0] == 0) {
        snprintf(answer, size, "%s", usual);
    }
    return status;
}

gonio_status setup_ask_number(const char *question, double usual, double low, double high, double *value,
                              gonio_error *error) {
    char text[32], answer[64];
    snprintf(text, sizeof text, "%.9g", usual);
    for (;;) {
        const gonio_status status = setup_ask(NULL, question, text, answer, sizeof answer, error);
        char *end;
        *value = gonio_number_parse(answer, &end);
        if (status != GONIO_OK || (end != answer && *end == 0 && *value >= low && *value <= high)) {
            return status;
        }
        fprintf(stderr, "    expected a number from %.9g to %.9g\n", low, high);
    }
}

// One of some words, by its first letters; *which counts them.
gonio_status setup_ask_word(setup_watched *w, const char *question, const char *const *words, int usual, int *which,
                            gonio_error *error) {
    char answer[32];
    for (;;) {
        const gonio_status status = setup_ask(w, question, words[usual], answer, sizeof answer, error);
        for (int i = 0; status == GONIO_OK && words[i] != NULL; i++) {
            if (strncmp(words[i], answer, strlen(answer)) == 0) {
                *which = i;
                return GONIO_OK;
            }
        }
        if (status != GONIO_OK) {
            return status;
        }
        fprintf(stderr, "    expected");
        for (int i = 0; words[i] != NULL; i++) {
            fprintf(stderr, "%s %s", i > 0 ? "," : "", words[i]);
        }
        fprintf(stderr, "\n");
    }
}

gonio_status setup_ask_yes(const char *question, bool *yes, gonio_error *error) {
    static const char *const words[] = {"yes", "no", NULL};
    int which = 0;
    const gonio_status status = setup_ask_word(NULL, question, words, 0, &which, error);
    *yes = which == 0;
    return status;
}
