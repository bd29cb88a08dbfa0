// SPDX-License-Identifier: BSD-3-Clause
// gonio pause: let a running measure stand still at its next checkpoint, and go on.
#include <poll.h>
#include <stdio.h>
#include <string.h>

#include "base/clock.h"
#include "host/cli/steering.h"

#define LOOK_MS 100

static int run(int argc, char **argv);

const cli_verb cmd_pause = {"pause", "SESSION [--off]",
                            "let the program that measures a session stand still, the shutter closed, and go on", run};

static bool is_paused(json_t *answer) {
    const char *state = json_string_value(json_object_get(answer, "state"));
    return state != NULL && strcmp(state, "paused") == 0;
}

// Until it stands still, or goes on. *answer is replaced by the newest.
static gonio_status wait_for(const cli_steering *steering, bool off, double timeout_s, json_t **answer,
                             gonio_error *error) {
    const double until_s = gonio_clock_s() + timeout_s;
    gonio_status status = GONIO_OK;
    while (status == GONIO_OK && is_paused(*answer) == off) {
        if (gonio_clock_s() >= until_s) {
            return gonio_fail(error, GONIO_E_TIMEOUT,
                              "it has taken note and has not come to a checkpoint within %.3g s; it will", timeout_s);
        }
        poll(NULL, 0, LOOK_MS);
        json_decref(*answer);
        status = cli_steering_ask(steering, "status", answer, error);
    }
    return status;
}

static gonio_status pause_it(const char *path, bool off, double timeout_s, json_t **out, gonio_error *error) {
    cli_steering steering;
    json_t *answer = NULL;
    gonio_status status = cli_steering_begin(&steering, path, error);
    if (status == GONIO_OK) {
        status = cli_steering_ask(&steering, off ? "go" : "pause", &answer, error);
    }
    status = status == GONIO_OK ? wait_for(&steering, off, timeout_s, &answer, error) : status;
    json_decref(answer);
    status = status == GONIO_OK ? cli_steering_status(&steering, NULL, out, error) : status;
    cli_steering_end(&steering);
    return status;
}

static int run(int argc, char **argv) {
    cli_common common;
    bool off = false;
    double timeout_s = 60;
    const cli_option options[] = {
        {"off", 0, CLI_FLAG, &off, NULL, NULL, "go on"},
        {"timeout", 0, CLI_DOUBLE, &timeout_s, NULL, "S", "wait so long for the next checkpoint (60)"},
        {0}};
    const char *path;
    int count;
    if (!cli_parse(&cmd_pause, options, argc, argv, &path, 1, 1, &count, &common)) {
        return 2;
    }
    gonio_error error = {.line = -1, .byte = -1};
    json_t *answer = NULL;
    if (pause_it(path, off, timeout_s, &answer, &error) != GONIO_OK) {
        return cli_fail(&common, &error);
    }
    if (common.json) {
        return cli_json(answer);
    }
    cli_steering_print(answer);
    json_decref(answer);
    return 0;
}
