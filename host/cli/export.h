// SPDX-License-Identifier: BSD-3-Clause
// Writing a model as a table of a file format: its options, and the report of what was lost.
#ifndef GONIO_CLI_EXPORT_H
#define GONIO_CLI_EXPORT_H

#include "gonio/io.h"
#include "host/cli/cli.h"

enum { CLI_EXPORT_ROWS = 32, CLI_EXPORT_HELP = 240 };

// What the options below fill; zero-initialise it. It must stay where it is.
typedef struct cli_export {
    double max_error;
    size_t max_bytes;
    bool no_report;
    const char *half; // of formats that hold one a file
    cli_option rows[CLI_EXPORT_ROWS];
    const char *given[CLI_EXPORT_ROWS]; // of the formats' own options
    char help[CLI_EXPORT_ROWS][CLI_EXPORT_HELP];
} cli_export;

#define CLI_EXPORT_OPTIONS(out)                                                                                        \
    { "", 0, CLI_TABLE, cli_export_table(&(out)), NULL, NULL, NULL }
cli_option *cli_export_table(cli_export *out);
// GONIO_E_USAGE where one of them was given; what: "samples", which have none.
gonio_status cli_export_refuse(const cli_export *out, const char *what, gonio_error *error);
// A table that was written: what its report says.
typedef struct cli_export_result {
    gonio_write_report report;
    double image; // mean difference of a sphere's pictures, 8-bit codes; NaN: the file is no table by itself
    json_t *json; // to be released; NULL: no report, or a file that cannot be read back
} cli_export_result;
// Write and store the report beside as PATH.report.json, without a word. fitted: how samples became the model, NULL.
gonio_status cli_export_table_file(const gonio_model *model, const char *source, const char *path, const char *format,
                                   const gonio_write_options *options, const json_t *fitted, cli_export_result *out,
                                   gonio_error *error);
// Write, print the report and store it beside as PATH.report.json. source: where the model is from.
gonio_status cli_export_model(const gonio_model *model, const char *source, const char *path, const char *format,
                              const cli_export *out, const cli_common *common, json_t *result, gonio_error *error);

#endif
