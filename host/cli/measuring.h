// SPDX-License-Identifier: BSD-3-Clause
// What measure, resume and replay share: progress, the operator's hands, the result.
#ifndef GONIO_CLI_MEASURING_H
#define GONIO_CLI_MEASURING_H

#include "host/cli/rig_file.h"

typedef struct cli_measuring {
    const cli_common *common;
    const char *model; // NULL: model.gonio in the session
    bool yes;          // steps that need hands do not wait
    bool resumed;
    cli_progress progress;
    int phase; // that the progress shows; -1: none yet
} cli_measuring;

// Nobody can be asked: wrong usage, said before anything moves.
bool cli_measuring_hands(const cli_measuring *measuring, const cli_rig *rig);
// Fill in the model's path, the threads and the hooks; they borrow `measuring`.
void cli_measuring_options(cli_measuring *measuring, gonio_measure_options *options);
// Returns the exit status; session and rig stay the caller's.
int cli_measuring_run(cli_measuring *measuring, const gonio_measure_options *options, gonio_session *session,
                      cli_rig *rig);

// What a finished session yielded, for people; the JSON that measure and replay share. The caller adds to the object.
void cli_outcome_print(const gonio_outcome *outcome);
json_t *cli_outcome_json(const char *session, const gonio_outcome *outcome);

#endif
