// SPDX-License-Identifier: BSD-3-Clause
// Files that appear whole or not at all.
#ifndef GONIO_OUTPUT_H
#define GONIO_OUTPUT_H

#include <stdio.h>

#include "gonio/export.h"
#include "gonio/status.h"

GONIO_BEGIN

// A file that appears whole or not at all: write to ->stream, then commit (sync, rename, sync folder) or abandon.
typedef struct gonio_output gonio_output;
gonio_status gonio_output_open(const char *path, gonio_output **out, gonio_error *error);
FILE *gonio_output_stream(gonio_output *output);
// The file's name until the commit, for a library that opens files itself; NULL: a pipe or device, which has none.
const char *gonio_output_temporary(const gonio_output *output);
gonio_status gonio_output_commit(gonio_output *output, gonio_error *error); // frees it in every case
void gonio_output_abandon(gonio_output *output);                            // NULL is allowed

GONIO_END
#endif
