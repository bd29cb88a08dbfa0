// SPDX-License-Identifier: BSD-3-Clause
// gonio resume: go on where a stopped, killed or powered-off measure was.
#include <stdio.h>
#include <stdlib.h>

#include "host/cli/apart.h"
#include "host/cli/measuring.h"

static int run(int argc, char **argv);

const cli_verb cmd_resume = {"resume", "SESSION", "go on with a session that was stopped, killed or powered off", run};

// ---- nothing left to do ----

static json_t *describe(gonio_session *session) {
    gonio_samples *samples = NULL;
    gonio_step *steps = NULL;
    size_t n = 0, poses = 0, frames = 0;
    bool final;
    char *model = NULL;
    gonio_session_steps(session, &steps, &n, NULL);
    for (size_t i = 0; i < n; i++) {
        poses += steps[i].kind == GONIO_STEP_SAMPLE;
        frames += (size_t)steps[i].frames;
    }
    gonio_session_final_samples(session, &samples, &final, NULL);
    gonio_session_model_path(session, &model, NULL);
    json_t *object =
        json_pack("{s:s,s:b,s:b,s:I,s:I,s:I,s:o}", "session", gonio_session_path(session), "finished", 1, "resumed", 0,
                  "poses", (json_int_t)poses, "frames", (json_int_t)frames, "samples",
                  (json_int_t)(samples != NULL ? samples->n : 0), "model", cli_json_text(model != NULL ? model : ""));
    for (int i = 0; i < 2; i++) {
        static const char *const keys[][2] = {{"samples_sha256", "result.samples_sha256"},
                                              {"model_sha256", "result.model_sha256"}};
        char *hash = NULL;
        if (gonio_session_get(session, keys[i][1], &hash, NULL) == GONIO_OK) {
            json_object_set_new(object, keys[i][0], json_string(hash));
        }
        free(hash);
    }
    free(steps);
    free(model);
    gonio_samples_free(samples);
    return object;
}

// A finished session is not touched; it is not even opened to be written.
static bool is_finished(const cli_common *common, const char *path) {
    gonio_session *session;
    bool finished = false;
    if (gonio_session_open(path, false, &session, NULL) != GONIO_OK) {
        return false; // opening it to be written says why
    }
    if (gonio_session_finished(session, &finished, NULL) == GONIO_OK && finished) {
        json_t *object = describe(session);
        if (common->json) {
            cli_json(object);
        } else {
            printf(
                "session    %s\nfinished   nothing is left to do, and nothing was changed; --model OUT fits it anew\n",
                path);
            json_decref(object);
        }
    }
    gonio_session_close(session);
    return finished;
}

static int run(int argc, char **argv) {
    cli_common common;
    cli_measuring measuring = {.common = &common, .resumed = true};
    cli_list set = {0};
    const char *file = NULL;
    bool stored_rig = false;
    const cli_option options[] = {
        {"rig", 0, CLI_TEXT, &file, NULL, "RIG.ini",
         "the rig file as it is now: devices may be reached elsewhere, nothing else may differ"},
        {"model", 0, CLI_TEXT, &measuring.model, NULL, "OUT", "where the model goes (where measure was told)"},
        {"set", 0, CLI_LIST, &set, NULL, "SECTION.KEY=VALUE", "change what has changed on the rig since"},
        {"stored-rig", 0, CLI_FLAG, &stored_rig, NULL, NULL,
         "open the real devices that the session names without asking; simulated ones need no leave"},
        {"yes", 'y', CLI_FLAG, &measuring.yes, NULL, NULL, "do not wait for hands: the targets lie where they must"},
        {0}};
    const char *path;
    int count;
    if (!cli_parse(&cmd_resume, options, argc, argv, &path, 1, 1, &count, &common) ||
        !cli_apart_model(&common, measuring.model, path) || !cli_ending(&common, measuring.model, "MODEL")) {
        return 2;
    }
    if (measuring.model == NULL && set.n == 0 && is_finished(&common, path)) {
        return 0;
    }
    gonio_error error = {.line = -1, .byte = -1};
    gonio_session *session = NULL;
    cli_rig rig = {0};
    cli_catch_interrupts();
    gonio_status status = gonio_session_open(path, true, &session, &error);
    status =
        status == GONIO_OK ? cli_rig_reopen(session, file, &set, stored_rig, common.threads, &rig, &error) : status;
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
