// SPDX-License-Identifier: BSD-3-Clause
// A tape of what went through a transport: recorded at a user's rig, replayed in a test.
//
// Text, one exchange a line: kind, request (hex), result (a number), reply (hex); "-" stands for no bytes.
#ifndef GONIO_TRANSPORT_TAPE_H
#define GONIO_TRANSPORT_TAPE_H

#include <stddef.h>

#include "gonio/status.h"

typedef struct gonio_tape gonio_tape;

gonio_status gonio_tape_create(const char *path, gonio_tape **out, gonio_error *error); // to record; flushed each line
gonio_status gonio_tape_open(const char *path, gonio_tape **out, gonio_error *error);   // to replay
// To replay where that names a file, else to record where that does, else none: *out is NULL.
gonio_status gonio_tape_choose(const char *record, const char *replay, gonio_tape **out, gonio_error *error);
void gonio_tape_close(gonio_tape *tape);                                                // NULL is allowed

// Add one exchange; a failure to write shows as the tape's end, never as the device's fault.
void gonio_tape_put(gonio_tape *tape, const char *kind, const void *request, size_t n, long long result,
                    const void *reply, size_t m);
// Take the next exchange, which must be of this kind with this request (GONIO_E_MISMATCH with the line's number where
// it is not, or where the tape has ended). *m: bytes of the reply, at most `size` (more is GONIO_E_INPUT).
gonio_status gonio_tape_get(gonio_tape *tape, const char *kind, const void *request, size_t n, long long *result,
                            void *reply, size_t size, size_t *m, gonio_error *error);

#endif
