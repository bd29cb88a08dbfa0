// SPDX-License-Identifier: BSD-3-Clause
// MODEL of the command line: a model file, spec:SPEC, or a measured table.
#include <string.h>

#include "gonio/io.h"

gonio_status gonio_model_resolve(const char *name, gonio_model **out, gonio_error *error) {
    if (strncmp(name, "spec:", 5) == 0) {
        return gonio_model_from_spec(name + 5, out, error);
    }
    return gonio_model_file_is(name) ? gonio_model_open(name, out, error) : gonio_read_table(name, out, error);
}
