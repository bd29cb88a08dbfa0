// SPDX-License-Identifier: BSD-3-Clause
#include "brdf/channels.h"

#include <stdlib.h>
#include <string.h>

gonio_status gonio_channels_new(size_t size, int count, gonio_transform_kind kind, const gonio_transform *transforms,
                                const char (*names)[32], void **out, gonio_error *error) {
    const size_t n = (size_t)count;
    gonio_channels *m = calloc(1, size);
    if (m == NULL || (m->transforms = malloc(n * sizeof *transforms)) == NULL ||
        (names != NULL && (m->names = malloc(n * sizeof *names)) == NULL)) {
        gonio_channels_free(m);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a model of %d channels", count);
    }
    memcpy(m->transforms, transforms, n * sizeof *transforms);
    if (names != NULL) {
        memcpy(m->names, names, n * sizeof *names);
    }
    m->head.channels = count;
    m->head.channel_names = (const char(*)[32])m->names;
    m->kind = kind;
    *out = m;
    return GONIO_OK;
}

void gonio_channels_adopt(gonio_channels *m, gonio_mapped *mapped) {
    m->mapped = *mapped;
    *mapped = (gonio_mapped){0};
    m->head.channel_names = m->mapped.names;
}

void gonio_channels_free(gonio_channels *m) {
    if (m != NULL) {
        gonio_mapped_release(&m->mapped);
        free(m->transforms);
        free(m->names);
        free(m);
    }
}
