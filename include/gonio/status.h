// SPDX-License-Identifier: BSD-3-Clause
// Status codes and the error context that every Gonio call fills.
//
// Libraries never print and never exit: a call returns a status (0 is success, negative failed) and writes the detail,
// what was found, what was expected, file and line or byte, into the gonio_error it was given (NULL: no detail wanted).
#ifndef GONIO_STATUS_H
#define GONIO_STATUS_H

#include "gonio/export.h"

GONIO_BEGIN

// X(name, value, exit status of the command line, text)
#define GONIO_STATUS_LIST(X)                                                                                           \
    X(OK, 0, 0, "done")                                                                                                \
    X(E_FAILED, -1, 1, "the work failed")                                                                              \
    X(E_USAGE, -2, 2, "wrong usage")                                                                                   \
    X(E_INPUT, -3, 3, "bad input")                                                                                     \
    X(E_INTERRUPTED, -4, 4, "interrupted")                                                                             \
    X(E_MEMORY, -5, 1, "not enough memory")                                                                            \
    X(E_IO, -6, 1, "input/output failed")                                                                              \
    X(E_DEVICE, -7, 1, "a device failed")                                                                              \
    X(E_TIMEOUT, -8, 1, "a device did not answer in time")                                                             \
    X(E_RANGE, -9, 1, "outside the permitted range")                                                                   \
    X(E_UNSUPPORTED, -10, 1, "not supported")                                                                          \
    X(E_CONVERGENCE, -11, 1, "did not converge")                                                                       \
    X(E_MISMATCH, -12, 1, "a check failed")

typedef enum gonio_status {
#define X(name, value, exit_status, text) GONIO_##name = (value),
    GONIO_STATUS_LIST(X)
#undef X
} gonio_status;

// Where a call failed and why. Zero-initialise it; a call that succeeds leaves it alone.
typedef struct gonio_error {
    gonio_status status;
    char message[512]; // what was found and what was expected
    char file[256];    // the file at fault; empty where none is
    long long line;    // 1-based line of a text file; -1 where there is none
    long long byte;    // 0-based offset in a binary file; -1 where there is none
    long long step;    // of a session, the frame at fault; -1 where none is
    int frame;         // its number within the step; -1
} gonio_error;

// The short text of a status; static storage.
const char *gonio_status_text(gonio_status status);
// The enumerator's name without its prefix ("E_INPUT"); static storage.
const char *gonio_status_name(gonio_status status);
// The exit status that the command line gives for it (0 to 4).
int gonio_status_exit(gonio_status status);

// Fill *error (may be NULL) and return status, so that a call can `return gonio_fail(error, GONIO_E_IO, "...")`.
gonio_status gonio_fail(gonio_error *error, gonio_status status, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
// The same for a text file: line is 1-based, or -1.
gonio_status gonio_fail_line(gonio_error *error, gonio_status status, const char *file, long long line,
                             const char *format, ...) __attribute__((format(printf, 5, 6)));
// The same for a binary file: byte is a 0-based offset, or -1.
gonio_status gonio_fail_byte(gonio_error *error, gonio_status status, const char *file, long long byte,
                             const char *format, ...) __attribute__((format(printf, 5, 6)));

// The same for a frame of a step; the message begins with both.
gonio_status gonio_fail_frame(gonio_error *error, gonio_status status, long long step, int frame, const char *format,
                              ...) __attribute__((format(printf, 5, 6)));

GONIO_END
#endif
