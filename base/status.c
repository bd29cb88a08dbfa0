// SPDX-License-Identifier: BSD-3-Clause
#include "gonio/status.h"

#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>

const char *gonio_status_text(gonio_status status) {
    switch (status) {
#define X(name, value, exit_status, text)                                                                              \
    case GONIO_##name:                                                                                                 \
        return text;
        GONIO_STATUS_LIST(X)
#undef X
    }
    return "unknown status";
}

const char *gonio_status_name(gonio_status status) {
    switch (status) {
#define X(name, value, exit_status, text)                                                                              \
    case GONIO_##name:                                                                                                 \
        return #name;
        GONIO_STATUS_LIST(X)
#undef X
    }
    return "E_UNKNOWN";
}

int gonio_status_exit(gonio_status status) {
    switch (status) {
#define X(name, value, exit_status, text)                                                                              \
    case GONIO_##name:                                                                                                 \
        return exit_status;
        GONIO_STATUS_LIST(X)
#undef X
    }
    return 1;
}

static void fill(gonio_error *error, gonio_status status, const char *file, long long line, long long byte,
                 const char *format, va_list arguments) {
    if (error == NULL) {
        return;
    }
    error->status = status;
    error->line = line;
    error->byte = byte;
    error->step = error->frame = -1;
    // A message may quote the error it wraps, so it is formatted aside first.
    char text[sizeof error->message];
    vsnprintf(text, sizeof text, format, arguments);
    snprintf(error->message, sizeof error->message, "%s", text);
    snprintf(error->file, sizeof error->file, "%s", file != NULL ? file : "");
}

gonio_status gonio_fail(gonio_error *error, gonio_status status, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    fill(error, status, NULL, -1, -1, format, arguments);
    va_end(arguments);
    return status;
}

gonio_status gonio_fail_line(gonio_error *error, gonio_status status, const char *file, long long line,
                             const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    fill(error, status, file, line, -1, format, arguments);
    va_end(arguments);
    return status;
}

gonio_status gonio_fail_byte(gonio_error *error, gonio_status status, const char *file, long long byte,
                             const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    fill(error, status, file, -1, byte, format, arguments);
    va_end(arguments);
    return status;
}

gonio_status gonio_fail_frame(gonio_error *error, gonio_status status, long long step, int frame, const char *format,
                              ...) {
    char text[sizeof error->message];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    gonio_fail(error, status, "step %lld frame %d: %s", step, frame, text);
    if (error != NULL) {
        error->step = step;
        error->frame = frame;
    }
    return status;
}
