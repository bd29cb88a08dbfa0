// SPDX-License-Identifier: BSD-3-Clause
// gonio status: how far a session is, while a program is at work on it and afterwards.
#include <poll.h>
#include <stdio.h>
#include <string.h>

#include "host/cli/steering.h"

#define LOOK_MS 1000

static int run(int argc, char **argv);

const cli_verb cmd_status = {"status", "SESSION [--watch] [--frame IMAGE.png]",
                             "how far a session is and what its program does; the last frame as a file", run};

typedef struct request {
    cli_steering steering;
    const char *frame;
    bool watch, json;
} request;

static gonio_status copy_frame(const request *r, const gonio_session_overview *overview, gonio_error *error) {
    gonio_session *session;
    if (overview->last_step < 0) {
        return gonio_fail(error, GONIO_E_FAILED, "the session has no frame yet");
    }
    gonio_status status = gonio_session_open(r->steering.path, false, &session, error);
    if (status == GONIO_OK) {
        status = gonio_session_copy_frame(session, overview->last_step, (int)overview->last_frame, r->frame, error);
        gonio_session_close(session);
    }
    return status;
}

static void show(const request *r, json_t *status) {
    if (r->json) {
        cli_json(json_incref(status));
    } else {
        cli_steering_print(status);
        if (r->watch) {
            putchar('\n');
        }
    }
    fflush(stdout);
}

// Whether somebody is still at work on it.
static bool goes_on(json_t *status) {
    const char *state = json_string_value(json_object_get(status, "state"));
    return strcmp(state, "finished") != 0 && strcmp(state, "stopped") != 0;
}

static gonio_status look(const request *r, bool *again, gonio_error *error) {
    gonio_session_overview overview;
    json_t *answer = NULL;
    gonio_status status = cli_steering_status(&r->steering, &overview, &answer, error);
    *again = false;
    if (status == GONIO_OK && r->frame != NULL && !(r->watch && overview.last_step < 0)) {
        status = copy_frame(r, &overview, error);
        json_object_set_new(answer, "frame", json_string(r->frame));
    }
    if (status == GONIO_OK) {
        show(r, answer);
        *again = r->watch && goes_on(answer);
    }
    json_decref(answer);
    return status;
}

static int run(int argc, char **argv) {
    cli_common common;
    request r = {0};
    const cli_option options[] = {
        {"watch", 'w', CLI_FLAG, &r.watch, NULL, NULL, "again every second, until nobody is at work on it"},
        {"frame", 0, CLI_OUTPUT, &r.frame, NULL, "IMAGE.png", "write the last frame that was stored there"},
        {0}};
    const char *path;
    int count;
    if (!cli_parse(&cmd_status, options, argc, argv, &path, 1, 1, &count, &common)) {
        return 2;
    }
    r.json = common.json;
    gonio_error error = {.line = -1, .byte = -1};
    gonio_status status = cli_steering_begin(&r.steering, path, &error);
    bool again = status == GONIO_OK;
    while (again && (status = look(&r, &again, &error)) == GONIO_OK && again) {
        poll(NULL, 0, LOOK_MS);
    }
    cli_steering_end(&r.steering);
    return status == GONIO_OK ? 0 : cli_fail(&common, &error);
}
