// SPDX-License-Identifier: BSD-3-Clause
// A whole session in an HDF5 file as INPUT.
#ifndef GONIO_CLI_HDF5_INPUT_H
#define GONIO_CLI_HDF5_INPUT_H

#include "gonio/fit.h"
#include "gonio/sample.h"

// Its samples, or the session that it was. Read in a process of its own: a file whose damage libhdf5 does not survive
// is bad input like any other, and nothing of it stays.
gonio_status cli_hdf5_read(const char *path, gonio_samples **out, gonio_error *error);
gonio_status cli_hdf5_import(const char *path, const char *session, gonio_progress_fn progress, void *context,
                             gonio_error *error);

#endif
