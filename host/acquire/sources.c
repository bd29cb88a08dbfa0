// SPDX-License-Identifier: BSD-3-Clause
#include "host/acquire/sources.h"

#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/text.h"

gonio_status gonio_sources_add(gonio_sources *sources, const char *role, const char *name, const char *bytes,
                               size_t size, gonio_error *error) {
    if (sources->n == GONIO_SOURCES_MAX) {
        return GONIO_OK;
    }
    struct gonio_source_bytes *s = &sources->items[sources->n];
    *s = (struct gonio_source_bytes){role, strdup(name), malloc(size + 1), size};
    if (s->name == NULL || s->bytes == NULL) {
        free(s->name);
        free(s->bytes);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to keep %s", name);
    }
    memcpy(s->bytes, bytes, size);
    sources->n++;
    return GONIO_OK;
}

gonio_status gonio_sources_add_file(gonio_sources *sources, const char *role, const char *path, gonio_error *error) {
    struct stat facts;
    char *bytes;
    size_t size;
    if (stat(path, &facts) != 0 || !S_ISREG(facts.st_mode)) {
        return GONIO_OK;
    }
    gonio_status status = gonio_file_read(path, 0, &bytes, &size, error);
    if (status == GONIO_OK) {
        status = gonio_sources_add(sources, role, path, bytes, size, error);
        free(bytes);
    }
    return status;
}

gonio_status gonio_sources_put(gonio_session *session, const gonio_sources *sources, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int i = 0; status == GONIO_OK && i < sources->n; i++) {
        const struct gonio_source_bytes *s = &sources->items[i];
        status = gonio_session_put_file(session, s->role, s->name, s->bytes, s->size, error);
    }
    return status;
}

void gonio_sources_free(gonio_sources *sources) {
    for (int i = 0; i < sources->n; i++) {
        free(sources->items[i].name);
        free(sources->items[i].bytes);
    }
    sources->n = 0;
}
