// SPDX-License-Identifier: BSD-3-Clause
// A whole session in an HDF5 file as INPUT.
#ifndef GONIO_CLI_HDF5_INPUT_H
#define GONIO_CLI_HDF5_INPUT_H

#include "gonio/sample.h"

// Its samples, read in a process of their own: a file whose damage libhdf5 does not survive is bad input like any
// other.
gonio_status cli_hdf5_read(const char *path, gonio_samples **out, gonio_error *error);
// Whatever reads such a file, in a process of its own; nothing but its status and its error comes back.
typedef gonio_status cli_hdf5_work(void *context, gonio_error *error);
gonio_status cli_hdf5_apart(const char *path, cli_hdf5_work *work, void *context, gonio_error *error);

#endif
