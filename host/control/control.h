// SPDX-License-Identifier: BSD-3-Clause
// A running program, seen and steered from another terminal: local sockets of the same user on the same machine.
//
// A program takes the name of what it works on: of a session, its folder's real path; of a rig, the line to its
// controller or its rig file. A thread then answers requests, one a connection: a line with one word, answered by one
// line of JSON. The program looks at its checkpoints whether it is to stop or to pause; the thread itself touches no
// device and no session, so nothing that a client does can hold up a measurement.
//
//   status    {"pid":..., "stopping":..., "paused":..., ...} and what the program last told
//   pause, go, stop    the same, after having taken note
//
// Sockets are KIND-HASH.socket in the first folder there is of $XDG_RUNTIME_DIR/gonio, /run/user/UID/gonio and
// /tmp/gonio-UID, which nobody else can enter; a lock beside each tells that its owner lives.
#ifndef GONIO_CONTROL_CONTROL_H
#define GONIO_CONTROL_CONTROL_H

#include <stdbool.h>
#include <stddef.h>

#include "gonio/status.h"

typedef enum gonio_control_kind { GONIO_CONTROL_SESSION, GONIO_CONTROL_RIG, GONIO_CONTROL_KINDS } gonio_control_kind;

enum { GONIO_CONTROL_ANSWER = 16384 }; // bytes of an answer, its end included

// ---- the program that works ----

typedef struct gonio_control gonio_control;

gonio_status gonio_control_new(gonio_control **out, gonio_error *error);
void gonio_control_free(gonio_control *control); // gives back its names; NULL is allowed
// Take a name and answer to it, one of each kind. GONIO_E_FAILED where another program has it; GONIO_E_IO where there
// is no folder for the socket.
gonio_status gonio_control_listen(gonio_control *control, gonio_control_kind kind, const char *identity,
                                  gonio_error *error);
void gonio_control_leave(gonio_control *control, gonio_control_kind kind);
// What `status` answers besides: `members` is the inside of a JSON object ("\"done\":3"), copied.
void gonio_control_tell(gonio_control *control, const char *members);
// The same, made when it is asked for: write members into text. Called by the thread, until it is taken back with NULL.
typedef void (*gonio_control_members)(void *context, char *text, size_t size);
void gonio_control_ask(gonio_control *control, gonio_control_members members, void *context);
// NULL: never.
bool gonio_control_stopping(const gonio_control *control);
bool gonio_control_paused(const gonio_control *control);

// ---- who looks at it ----

// Send a word to the program that works on this and take its answer. GONIO_E_FAILED: there is no such program of this
// user on this machine. GONIO_E_TIMEOUT: it did not answer.
gonio_status gonio_control_request(gonio_control_kind kind, const char *identity, const char *word,
                                   char answer[GONIO_CONTROL_ANSWER], gonio_error *error);
// Wait until no program has the name any more; false: one still has after timeout_s.
bool gonio_control_wait_gone(gonio_control_kind kind, const char *identity, double timeout_s);

#endif
