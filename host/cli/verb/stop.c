// SPDX-License-Identifier: BSD-3-Clause
// gonio stop: end a running measure at its next checkpoint, as Ctrl-C in its own terminal does.
#include <poll.h>
#include <stdio.h>

#include "host/cli/steering.h"

#define LOOK_MS 50
#define CLOSE_MS 10000 // the program has left; so long may it take to close its devices and its journal

static int run(int argc, char **argv);

const cli_verb cmd_stop = {"stop", "SESSION", "end the program that measures a session, as Ctrl-C does; resume goes on",
                           run};

static gonio_status stop_it(const char *path, double timeout_s, json_t **out, gonio_error *error) {
    cli_steering steering;
    json_t *answer = NULL;
    gonio_status status = cli_steering_begin(&steering, path, error);
    if (status == GONIO_OK) {
        status = cli_steering_ask(&steering, "stop", &answer, error);
    }
    json_decref(answer);
    if (status == GONIO_OK && !gonio_control_wait_gone(GONIO_CONTROL_SESSION, steering.place, timeout_s)) {
        status = gonio_fail(error, GONIO_E_TIMEOUT,
                            "it has taken note and has not come to a checkpoint within %.3g s; it will", timeout_s);
    }
    long pid;
    for (int ms = 0; status == GONIO_OK && gonio_session_writer(path, &pid) && ms < CLOSE_MS; ms += LOOK_MS) {
        poll(NULL, 0, LOOK_MS);
    }
    status = status == GONIO_OK ? cli_steering_status(&steering, NULL, out, error) : status;
    cli_steering_end(&steering);
    return status;
}

static int run(int argc, char **argv) {
    cli_common common;
    double timeout_s = 60;
    const cli_option options[] = {
        {"timeout", 0, CLI_DOUBLE, &timeout_s, NULL, "S", "wait so long for the next checkpoint (60)"}, {0}};
    const char *path;
    int count;
    if (!cli_parse(&cmd_stop, options, argc, argv, &path, 1, 1, &count, &common)) {
        return 2;
    }
    gonio_error error = {.line = -1, .byte = -1};
    json_t *answer = NULL;
    if (stop_it(path, timeout_s, &answer, &error) != GONIO_OK) {
        return cli_fail(&common, &error);
    }
    if (common.json) {
        return cli_json(answer);
    }
    cli_steering_print(answer);
    json_decref(answer);
    return 0;
}
