// SPDX-License-Identifier: BSD-3-Clause
// gonio resume: go on where a stopped, killed or powered-off measure was.
#include "host/cli/measuring.h"

static int run(int argc, char **argv);

const cli_verb cmd_resume = {"resume", "SESSION", "go on with a session that was stopped, killed or powered off", run};

static int run(int argc, char **argv) {
    cli_common common;
    cli_measuring measuring = {.common = &common, .resumed = true};
    cli_list set = {0};
    bool stored_rig = false;
    const cli_option options[] = {
        {"model", 0, CLI_TEXT, &measuring.model, NULL, "OUT", "where the model goes (where measure was told)"},
        {"set", 0, CLI_LIST, &set, NULL, "SECTION.KEY=VALUE", "change what has changed on the rig since"},
        {"stored-rig", 0, CLI_FLAG, &stored_rig, NULL, NULL,
         "open the real devices that the session names without asking; simulated ones need no leave"},
        {"yes", 'y', CLI_FLAG, &measuring.yes, NULL, NULL, "do not wait for hands: the targets lie where they must"},
        {0}};
    const char *path;
    int count;
    if (!cli_parse(&cmd_resume, options, argc, argv, &path, 1, 1, &count, &common)) {
        return 2;
    }
    gonio_error error = {.line = -1, .byte = -1};
    gonio_session *session = NULL;
    cli_rig rig = {0};
    cli_catch_interrupts();
    gonio_status status = gonio_session_open(path, true, &session, &error);
    status = status == GONIO_OK ? cli_rig_reopen(session, &set, stored_rig, common.threads, &rig, &error) : status;
    int exit_status = 2;
    if (status != GONIO_OK) {
        exit_status = cli_fail(&common, &error);
    } else if (cli_measuring_hands(&measuring, &rig)) {
        gonio_measure_options options;
        gonio_measure_options_default(&options);
        cli_measuring_options(&measuring, &options);
        exit_status = cli_measuring_run(&measuring, &options, session, &rig);
    }
    cli_rig_close(&rig);
    gonio_session_close(session);
    return exit_status;
}
