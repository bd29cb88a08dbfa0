// gonio resume: go on where a stopped, killed or powered-off measure was.
#include <stdio.h>
#include <stdlib.h>

#include "host/cli/measuring.h"

static bool is_finished(gonio_session *session) {
    char *hash = NULL;
    const bool finished = gonio_session_get(session, "result.model_sha256", &hash, NULL) == GONIO_OK;
    free(hash);
    return finished;
}

static gonio_status check(gonio_session *session, gonio_setup *setup, gonio_error *error) {
    gonio_step *steps;
    size_t n;
    gonio_status status = gonio_session_steps(session, &steps, &n, error);
    if (status != GONIO_OK) {
        return status;
    }
    free(steps);
    if (n == 0) {
        return gonio_fail_line(error, GONIO_E_INPUT, gonio_session_path(session), -1,
                               "stopped before its plan was entered, so nothing was measured; measure it again");
    }
    return gonio_setup_get(session, setup, error);
}

static int go_on(cli_measuring *measuring, gonio_session *session, cli_rig *rig) {
    char *place = NULL; // of the model, as measure was told
    if (is_finished(session)) {
        fprintf(stderr, "the session is finished; fitting it again\n");
    }
    if (measuring->model == NULL && gonio_session_get(session, "model", &place, NULL) == GONIO_OK) {
        measuring->model = place;
    }
    gonio_session_event(session, "resumed", "", NULL);
    rig->journal = session;
    const int exit_status = cli_measuring_run(measuring, session, &rig->rig);
    free(place);
    return exit_status;
}

static int run(int argc, char **argv);

const cli_verb cmd_resume = {"resume", "SESSION", "go on with a session that was stopped, killed or powered off", run};

static int run(int argc, char **argv) {
    cli_common common;
    cli_measuring measuring = {.common = &common, .resumed = true};
    cli_list set = {0};
    const cli_option options[] = {
        {"model", 0, CLI_TEXT, &measuring.model, NULL, "OUT", "where the model goes (where measure was told)"},
        {"set", 0, CLI_LIST, &set, NULL, "SECTION.KEY=VALUE", "change what has changed on the rig since"},
        {"yes", 'y', CLI_FLAG, &measuring.yes, NULL, NULL, "do not wait for hands: the targets lie where they must"},
        {0}};
    const char *path;
    int count;
    if (!cli_parse(&cmd_resume, options, argc, argv, &path, 1, 1, &count, &common)) {
        return 2;
    }
    gonio_error error = {.line = -1, .byte = -1};
    gonio_session *session = NULL;
    gonio_setup setup;
    cli_rig rig = {0};
    cli_catch_interrupts();
    gonio_status status = gonio_session_open(path, true, &session, &error);
    if (status == GONIO_OK) {
        status = check(session, &setup, &error);
    }
    if (status == GONIO_OK) {
        status = cli_rig_reopen(session, &set, common.threads, &rig, &error);
    }
    int exit_status = 2;
    if (status != GONIO_OK) {
        exit_status = cli_fail(&common, &error);
    } else if (cli_measuring_hands(&measuring, &rig.rig, setup.scan.hands)) {
        exit_status = go_on(&measuring, session, &rig);
    }
    cli_rig_close(&rig);
    gonio_session_close(session);
    return exit_status;
}
