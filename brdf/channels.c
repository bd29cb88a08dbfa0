// SPDX-License-Identifier: BSD-3-Clause
#include "brdf/channels.h"

#include <stdlib.h>
#include <string.h>

gonio_status gonio_channels_init(gonio_channels *channels, size_t count, const gonio_transform *transforms,
                                 const char (*names)[32], gonio_error *error) {
    channels->transforms = malloc(count * sizeof *transforms);
    channels->names = names != NULL ? malloc(count * sizeof *channels->names) : NULL;
    if (channels->transforms == NULL || (names != NULL && channels->names == NULL)) {
        gonio_channels_release(channels);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a model of %zu channels", count);
    }
    memcpy(channels->transforms, transforms, count * sizeof *transforms);
    if (names != NULL) {
        memcpy(channels->names, names, count * sizeof *channels->names);
    }
    return GONIO_OK;
}

void gonio_channels_release(gonio_channels *channels) {
    free(channels->transforms);
    free(channels->names);
    *channels = (gonio_channels){0};
}
