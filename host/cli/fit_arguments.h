// SPDX-License-Identifier: BSD-3-Clause
// The options of a fit on a command line: fit and measure take the same ones, from the fit's own table.
#ifndef GONIO_CLI_FIT_ARGUMENTS_H
#define GONIO_CLI_FIT_ARGUMENTS_H

#include "fit/options.h"
#include "host/cli/cli.h"

// What the rows point to; zero-initialise it.
typedef struct cli_fit_arguments {
    const char *texts[GONIO_FIT_KEYS];
    bool flags[GONIO_FIT_KEYS], given[GONIO_FIT_KEYS];
    char names[GONIO_FIT_KEYS][32], helps[GONIO_FIT_KEYS][400];
} cli_fit_arguments;

// Write a row for every option but the seed, which every verb has, to rows[GONIO_FIT_KEYS]; returns how many.
int cli_fit_rows(cli_fit_arguments *arguments, cli_option *rows);
// The options that were given, the others at their defaults. Returns false after having reported wrong usage: an
// impossible value, or an option that the method does not have.
bool cli_fit_read(const cli_fit_arguments *arguments, const char *verb, const cli_common *common,
                  gonio_fit_options *options);

#endif
