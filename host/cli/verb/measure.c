// SPDX-License-Identifier: BSD-3-Clause
// gonio measure: a plan on a rig, into a session.
#include <string.h>

#include "host/cli/apart.h"
#include "host/cli/fit_arguments.h"
#include "host/cli/measuring.h"

typedef struct request {
    cli_rig_options rig;
    gonio_measure_options measure;
    cli_measuring measuring;
} request;

static int run_request(request *r, const char *path) {
    gonio_error error = {.line = -1, .byte = -1};
    cli_rig rig;
    gonio_session *session = NULL;
    cli_catch_interrupts();
    gonio_status status = cli_rig_open(&r->rig, &rig, &error);
    if (status == GONIO_OK && !cli_measuring_hands(&r->measuring, &rig)) {
        cli_rig_close(&rig);
        return 2;
    }
    status = status == GONIO_OK ? gonio_measure_begin(path, &rig, &r->measure, &session, &error) : status;
    const int exit_status = status == GONIO_OK ? cli_measuring_run(&r->measuring, &r->measure, session, &rig)
                                               : cli_fail(r->measuring.common, &error);
    gonio_session_close(session);
    cli_rig_close(&rig);
    return exit_status;
}

static int run(int argc, char **argv);

const cli_verb cmd_measure = {"measure", "[--rig sim|RIG.ini] [--sample SPEC] [--plan PLAN] SESSION",
                              "measure a sample into a session and fit it", run};

static int run(int argc, char **argv) {
    request r = {0};
    gonio_measure_options_default(&r.measure);
    cli_fit_arguments arguments = {0};
    cli_common common;
    const cli_option own[] = {
        CLI_RIG_OPTIONS(r.rig),
        {"plan", 0, CLI_TEXT, &r.measure.plan, NULL, "PLAN",
         "uniform:STEP, nusselt:N (nusselt:1400), adaptive:N[,until=X] (the next poses where the model so far knows "
         "least), "
         "prior:PRIOR,N=20 (of `gonio learn`), or a CSV of poses"},
        {"model", 0, CLI_TEXT, &r.measuring.model, NULL, "OUT", "where the model goes (SESSION/model.gonio)"},
        {"operator", 0, CLI_TEXT, &r.rig.operator_name, NULL, "NAME", "stored in the session"},
        {"sample-id", 0, CLI_TEXT, &r.rig.sample_id, NULL, "TEXT", "stored in the session"},
        {"notes", 0, CLI_TEXT, &r.rig.notes, NULL, "TEXT", "stored in the session"},
        {"yes", 'y', CLI_FLAG, &r.measuring.yes, NULL, NULL, "do not wait for hands: the targets lie where they must"}};
    const int own_n = sizeof own / sizeof *own;
    cli_option options[sizeof own / sizeof *own + GONIO_FIT_KEYS + 1] = {0};
    memcpy(options, own, sizeof own);
    cli_fit_rows(&arguments, options + own_n);
    const char *session;
    int count;
    if (!cli_parse(&cmd_measure, options, argc, argv, &session, 1, 1, &count, &common) ||
        !cli_fit_read(&arguments, "measure", &common, &r.measure.fit) || !cli_apart_session(&common, session) ||
        !cli_apart_model(&common, r.measuring.model, session) || !cli_ending(&common, r.measuring.model, "MODEL")) {
        return 2;
    }
    r.measure.seed = r.rig.seed = common.seed;
    r.rig.threads = common.threads;
    r.measuring.common = &common;
    cli_measuring_options(&r.measuring, &r.measure);
    return run_request(&r, session);
}
