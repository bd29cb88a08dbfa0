// SPDX-License-Identifier: BSD-3-Clause
// What status, pause, stop and rig share: asking the program that is at work.
#ifndef GONIO_CLI_STEERING_H
#define GONIO_CLI_STEERING_H

#include "gonio/session.h"
#include "host/cli/cli.h"

// A session and the program that is at work on it.
typedef struct cli_steering {
    const char *path; // as given
    char *place;      // its real path; owned
} cli_steering;

// GONIO_E_INPUT where there is no session. Release with cli_steering_end.
gonio_status cli_steering_begin(cli_steering *steering, const char *path, gonio_error *error);
void cli_steering_end(cli_steering *steering);
// The program's answer to a word; an error names the session.
gonio_status cli_steering_ask(const cli_steering *steering, const char *word, json_t **answer, gonio_error *error);
// What the session is and how far, of the journal and, where one is at work, of the program: {"session", "state", ...}.
// overview may be NULL.
gonio_status cli_steering_status(const cli_steering *steering, gonio_session_overview *overview, json_t **out,
                                 gonio_error *error);
void cli_steering_print(json_t *status);
// Answer of the program to a word as an object.
gonio_status cli_ask(gonio_control_kind kind, const char *identity, const char *word, json_t **answer,
                     gonio_error *error);

#endif
