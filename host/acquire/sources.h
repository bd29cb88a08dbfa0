// SPDX-License-Identifier: BSD-3-Clause
// The files that a measure was told of, as they were when they were read: a session keeps them verbatim.
#ifndef GONIO_HOST_ACQUIRE_SOURCES_H
#define GONIO_HOST_ACQUIRE_SOURCES_H

#include "gonio/session.h"

enum { GONIO_SOURCES_MAX = 80 };
typedef struct gonio_sources {
    struct gonio_source_bytes {
        const char *role; // static
        char *name, *bytes;
        size_t size;
    } items[GONIO_SOURCES_MAX];
    int n;
} gonio_sources;

// A copy of bytes that were read from `name`; beyond GONIO_SOURCES_MAX there are no more.
gonio_status gonio_sources_add(gonio_sources *sources, const char *role, const char *name, const char *bytes,
                               size_t size, gonio_error *error);
// The file's bytes; what is no file (a pipe cannot be read twice) is left out.
gonio_status gonio_sources_add_file(gonio_sources *sources, const char *role, const char *path, gonio_error *error);
gonio_status gonio_sources_put(gonio_session *session, const gonio_sources *sources, gonio_error *error);
void gonio_sources_free(gonio_sources *sources);

#endif
