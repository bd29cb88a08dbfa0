// SPDX-License-Identifier: BSD-3-Clause
// The rig options of the command line -> an open rig.
#include "host/cli/rig_file.h"

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "host/acquire/rig_control.h"

static void tell(void *context, const char *kind, const char *text) {
    (void)context;
    fprintf(stderr, "gonio: %s: %s\n", cli_text(kind), cli_text(text));
}

static bool cancelled(void *context) {
    (void)context;
    return cli_interrupted();
}

void cli_rig_any_sample(cli_rig_options *options, const cli_common *common) {
    options->seed = common->seed;
    options->threads = common->threads;
    options->stand_in = "lambert:rho=0.5";
}

const char *cli_rig_named(const cli_rig_options *options) {
    const char *usual = getenv("GONIO_RIG");
    return options->rig != NULL ? options->rig : usual != NULL && usual[0] != 0 ? usual : NULL;
}

static gonio_rig_file_options file_options(const cli_rig_options *options) {
    return (gonio_rig_file_options){.path = cli_rig_named(options),
                                    .sample = options->sample,
                                    .stand_in = options->stand_in,
                                    .fragments = options->with.items,
                                    .n_fragments = (size_t)options->with.n,
                                    .settings = options->set.items,
                                    .n_settings = (size_t)options->set.n,
                                    .operator_name = options->operator_name,
                                    .sample_id = options->sample_id,
                                    .notes = options->notes,
                                    .seed = options->seed,
                                    .threads = options->threads,
                                    .event = tell,
                                    .cancelled = cancelled,
                                    .control = true};
}

gonio_status cli_rig_open(const cli_rig_options *options, cli_rig *rig, gonio_error *error) {
    const gonio_rig_file_options all = file_options(options);
    const gonio_status status = gonio_rig_file_fill(&all, rig, error);
    cli_steered_by(rig->control);
    return status;
}

gonio_status cli_rig_identity(const cli_rig_options *options, char **identity, gonio_error *error) {
    const gonio_rig_file_options all = file_options(options);
    return gonio_rig_file_identity(&all, identity, error);
}

// A session may come from elsewhere: its devices are opened when the user says so.
static bool trust(void *context, const char *devices) {
    const bool *stored_rig = context;
    char line[64] = "";
    if (*stored_rig || isatty(STDIN_FILENO) != 1 || isatty(STDERR_FILENO) != 1) {
        return *stored_rig;
    }
    fprintf(stderr, "the session's rig opens what it names: %s\nopen it (--stored-rig does not ask)? [y/N] ", devices);
    fflush(stderr);
    return fgets(line, sizeof line, stdin) != NULL && (line[0] == 'y' || line[0] == 'Y');
}

gonio_status cli_rig_reopen(gonio_session *session, const char *file, const cli_list *set, bool stored_rig, int threads,
                            cli_rig *rig, gonio_error *error) {
    const gonio_rig_file_options changes = {.path = file,
                                            .settings = set->items,
                                            .n_settings = (size_t)set->n,
                                            .threads = threads,
                                            .event = tell,
                                            .cancelled = cancelled,
                                            .context = &stored_rig,
                                            .trust = trust,
                                            .control = true};
    const gonio_status status = gonio_rig_file_refill(session, &changes, rig, error);
    rig->context = NULL; // nobody but trust uses it
    cli_steered_by(rig->control);
    return status;
}

void cli_rig_close(cli_rig *rig) {
    cli_steered_by(NULL);
    gonio_rig_file_release(rig);
}
