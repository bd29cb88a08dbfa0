// SPDX-License-Identifier: BSD-3-Clause
// A file of the folder that is being made.
#include <stdio.h>

#include "host/cli/bundle/bundle.h"
#include "io/format.h"

gonio_status cli_bundle_open(const cli_bundle *bundle, const char *name, gonio_output **out, gonio_error *error) {
    char path[CLI_BUNDLE_PATH];
    snprintf(path, sizeof path, "%s/%s", bundle->folder, name);
    return gonio_output_open(path, out, error);
}

gonio_status cli_bundle_close(gonio_output *output, const char *name, gonio_error *error) {
    const gonio_status status = gonio_write_flushed(gonio_output_stream(output), name, GONIO_OK, error);
    if (status != GONIO_OK) {
        gonio_output_abandon(output);
        return status;
    }
    return gonio_output_commit(output, error);
}
