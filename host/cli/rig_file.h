// SPDX-License-Identifier: BSD-3-Clause
// What the command line says of a rig, and opening it.
#ifndef GONIO_CLI_RIG_FILE_H
#define GONIO_CLI_RIG_FILE_H

#include "host/acquire/rig_file.h"
#include "host/cli/cli.h"

typedef struct cli_rig_options {
    const char *rig;      // "sim" or the path of a rig file
    const char *sample;   // SPEC of the simulated sample
    const char *stand_in; // SPEC where neither --sample nor a file names one; NULL: that is an error
    cli_list with;        // rig-file fragments, after the rig file
    cli_list set;         // section.key=value, also several behind commas
    const char *operator_name, *sample_id, *notes;
    uint64_t seed;
    int threads;
} cli_rig_options;

// The options of every verb that opens a rig: put them into its table. `o` is a cli_rig_options.
#define CLI_RIG_OPTIONS(o)                                                                                               \
    {"rig", 0, CLI_TEXT, &(o).rig, NULL, "sim|RIG.ini", "a rig file, or sim: the simulator; else as GONIO_RIG says"},    \
        {"sample", 0, CLI_TEXT, &(o).sample, NULL, "SPEC", "the simulated sample, e.g. ward:rho_d=0.3,shape=sphere"},    \
        {"with", 0, CLI_LIST, &(o).with, NULL, "INI", "take these keys too, as gonio calibrate writes them; repeat it"}, \
    {                                                                                                                    \
        "set", 0, CLI_LIST, &(o).set, NULL, "SECTION.KEY=VALUE", "override the rig file; repeat it or use commas"        \
    }

typedef gonio_rig_file cli_rig;

// The seed, the threads and a stand-in for the sample, for a verb whose answer does not depend on it.
void cli_rig_any_sample(cli_rig_options *options, const cli_common *common);
// What --rig says, else GONIO_RIG; NULL where neither does, which is the simulator.
const char *cli_rig_named(const cli_rig_options *options);
// The name by which a program that drives this rig is found (host/acquire/rig_control.h); no device is opened.
gonio_status cli_rig_identity(const cli_rig_options *options, char **identity, gonio_error *error);
// Read and check everything, open the devices; their events go to stderr. Release with cli_rig_close, also on failure.
// The rig must stay where it is.
gonio_status cli_rig_open(const cli_rig_options *options, cli_rig *rig, gonio_error *error);
// The rig that the session was begun with; set overrides what must have changed since (a port, a fault that is gone),
// and so does file, the rig file as it is now (NULL: none), of where devices are reached. Its real devices are opened
// where the file names them, stored_rig is true or the user says so at the terminal.
gonio_status cli_rig_reopen(gonio_session *session, const char *file, const cli_list *set, bool stored_rig, int threads,
                            cli_rig *rig, gonio_error *error);
void cli_rig_close(cli_rig *rig);

#endif
