// SPDX-License-Identifier: BSD-3-Clause
// INPUT of a verb: a session's folder, a samples file or any BRDF file that can be read.
#ifndef GONIO_CLI_INPUT_H
#define GONIO_CLI_INPUT_H

#include "gonio/io.h"
#include "host/cli/cli.h"

enum { CLI_INPUT_ROWS = 32, CLI_INPUT_HELP = 240 };

// What the options below fill; zero-initialise it. It must stay where it is.
typedef struct cli_input {
    const char *channel;
    double wavelength;
    // The options of all formats, each name once: a row of the table, what the user gave (NULL: nothing), its help.
    cli_option rows[CLI_INPUT_ROWS];
    const char *given[CLI_INPUT_ROWS];
    bool flags[CLI_INPUT_ROWS]; // of those without an argument
    bool save_map;
    char help[CLI_INPUT_ROWS][CLI_INPUT_HELP];
} cli_input;

// The options of every verb that takes INPUT: a row of its table.
#define CLI_INPUT_OPTIONS(in)                                                                                          \
    { "", 0, CLI_TABLE, cli_input_table(&(in)), NULL, NULL, NULL }
cli_option *cli_input_table(cli_input *in);
// GONIO_E_USAGE where an option of a file format was given; what: "a model", which has none of them.
gonio_status cli_input_refuse(const cli_input *in, const char *what, gonio_error *error);

// Is a mapping of a table given, or one kept beside it?
bool cli_input_maps(const char *path, const cli_input *in);
// What the report of a read says, on stderr.
void cli_input_tell(const char *path, const gonio_read_report *report);
// Read INPUT; what was clamped or left out is told on stderr. The caller frees the samples.
gonio_status cli_input_read_reported(const char *path, const cli_input *in, const cli_common *common,
                                     gonio_samples **out, gonio_read_report *report, gonio_error *error);
gonio_status cli_input_read(const char *path, const cli_input *in, const cli_common *common, gonio_samples **out,
                            gonio_error *error);

#endif
