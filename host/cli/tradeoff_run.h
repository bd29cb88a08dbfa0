// SPDX-License-Identifier: BSD-3-Clause
// Measuring the rows of `gonio tradeoff`.
#ifndef GONIO_CLI_TRADEOFF_RUN_H
#define GONIO_CLI_TRADEOFF_RUN_H

#include "fit/tradeoff.h"

typedef struct cli_tradeoff_request {
    const char *methods;      // a list with commas; NULL: all
    bool all_forms;           // each domain, instead of the better one
    double budget;            // s; 0: as long as it takes
    const gonio_model *truth; // what pictures are compared with; NULL: the most accurate row's
} cli_tradeoff_request;

typedef struct cli_tradeoff_table {
    gonio_tradeoff_row *rows; // the caller frees them
    size_t n, left;           // left: forms that the budget left out
    char reference[128];      // what pictures were compared with
} cli_tradeoff_table;

// The first name of the list that is no method's, in name; NULL where all are.
const char *cli_tradeoff_unknown(const char *list, char *name, size_t size);
// Fit and measure; rows that join the front are told on stderr as they come.
gonio_status cli_tradeoff_run(const gonio_samples *samples, gonio_fit_options *options,
                              const cli_tradeoff_request *request, cli_tradeoff_table *table, gonio_error *error);

#endif
