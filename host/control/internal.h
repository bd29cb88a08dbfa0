// SPDX-License-Identifier: BSD-3-Clause
// Where the sockets are: shared by who answers and who asks.
#ifndef GONIO_CONTROL_INTERNAL_H
#define GONIO_CONTROL_INTERNAL_H

#include <sys/socket.h>
#include <sys/un.h>

#include "host/control/control.h"

enum { CONTROL_FOLDERS = 3, CONTROL_NAME = 64, CONTROL_WORD = 32, CONTROL_PATIENCE_MS = 2000 };

// Open the folder number 0 to 2, which belongs to this user and nobody else can enter; make: make it where its parent
// is there. -1: there is none.
int gonio_control_folder(int number, bool make);
// "session-0123...", without an ending.
gonio_status gonio_control_name(gonio_control_kind kind, const char *identity, char name[CONTROL_NAME],
                                gonio_error *error);
// The socket's address through the open folder, so that its length does not matter and nobody can swap the folder.
void gonio_control_address(int folder, const char *name, struct sockaddr_un *address);
// A socket that is connected to whoever answers to the name; -1: nobody does.
int gonio_control_connect(const char *name);
// Whether the process at the other end belongs to this user.
bool gonio_control_mine(int socket);

#endif
