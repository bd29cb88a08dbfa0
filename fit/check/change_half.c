// SPDX-License-Identifier: BSD-3-Clause
// Samples of one half: as a table where they are one, else as they lie.
#include "fit/check/change.h"

gonio_status gonio_change_half(const gonio_samples *samples, const gonio_change *change, int threads,
                               gonio_samples **out, gonio_error *error) {
    gonio_table *table = NULL;
    gonio_status status = gonio_table_of(samples, &table, error);
    if (status == GONIO_OK) {
        status = table != NULL ? gonio_change_table(table, change, threads, out, error)
                               : gonio_change_scattered(samples, change, threads, out, error);
    }
    gonio_table_free(table);
    return status;
}
