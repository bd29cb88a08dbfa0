// gonio measure: a plan on a rig, into a session.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "host/cli/fit_arguments.h"
#include "host/cli/measuring.h"

typedef struct request {
    cli_rig_options rig;
    const char *plan;
    gonio_fit_options fit;
    cli_measuring measuring;
} request;

// A resume may run in another folder: the model's place is kept as an absolute path.
static gonio_status put_model_place(gonio_session *session, const char *model, gonio_error *error) {
    char folder[4096] = "", *place;
    if (model[0] != '/' && getcwd(folder, sizeof folder) == NULL) {
        return gonio_fail(error, GONIO_E_IO, "cannot tell the working folder, in which the model is to go");
    }
    if (asprintf(&place, "%s%s%s", folder, folder[0] != 0 ? "/" : "", model) < 0) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a path");
    }
    const gonio_status status = gonio_session_put(session, "model", place, error);
    free(place);
    return status;
}

static gonio_status journal(gonio_session *session, const request *r, const cli_rig *rig, const gonio_setup *setup,
                            const gonio_step *steps, size_t n, gonio_error *error) {
    gonio_status status = gonio_session_begin(session, error);
    if (status != GONIO_OK) {
        return status;
    }
    const char *const texts[][2] = {{"gonio.version", GONIO_VERSION}, {"plan", r->plan}};
    for (size_t i = 0; status == GONIO_OK && i < sizeof texts / sizeof *texts; i++) {
        status = gonio_session_put(session, texts[i][0], texts[i][1], error);
    }
    if (status == GONIO_OK) {
        status = cli_rig_put(session, &r->rig, rig, error);
    }
    if (status == GONIO_OK) {
        status = gonio_setup_put(session, setup, error);
    }
    if (status == GONIO_OK && r->measuring.model != NULL) {
        status = put_model_place(session, r->measuring.model, error);
    }
    if (status == GONIO_OK) {
        status = gonio_session_put_steps(session, steps, n, error);
    }
    if (status == GONIO_OK) {
        status = gonio_session_event(session, "begun", r->plan, error);
    }
    if (status == GONIO_OK) {
        return gonio_session_commit(session, error);
    }
    gonio_session_rollback(session);
    return status;
}

// Everything that can be wrong with the request is found before the session's folder exists.
static gonio_status prepare(request *r, const cli_rig *rig, gonio_setup *setup, gonio_step **steps, size_t *n,
                            gonio_error *error) {
    *setup = (gonio_setup){.fit = r->fit};
    gonio_plan *plan;
    gonio_status status = gonio_setup_of_rig(&rig->rig, &rig->scan, setup, error);
    if (status == GONIO_OK) {
        status = gonio_plan_make(r->plan, r->rig.seed, &plan, error);
    }
    if (status != GONIO_OK) {
        return status;
    }
    status = plan->n > 0 ? gonio_scan_steps(&rig->rig, &setup->scan, plan, steps, n, error)
                         : gonio_fail(error, GONIO_E_INPUT, "plan '%s' has no poses", r->plan);
    gonio_plan_free(plan);
    return status;
}

static int run_request(request *r, const char *path) {
    gonio_error error = {.line = -1, .byte = -1};
    cli_rig rig = {0};
    gonio_setup setup;
    gonio_step *steps = NULL;
    size_t n = 0;
    gonio_session *session = NULL;
    int exit_status = 2;
    cli_catch_interrupts();
    gonio_status status = cli_rig_open(&r->rig, &rig, &error);
    if (status == GONIO_OK) {
        status = prepare(r, &rig, &setup, &steps, &n, &error);
    }
    if (status == GONIO_OK && !cli_measuring_hands(&r->measuring, &rig.rig, setup.scan.hands)) {
        goto out;
    }
    if (status == GONIO_OK) {
        status = gonio_session_create(path, &session, &error);
    }
    if (status == GONIO_OK) {
        status = journal(session, r, &rig, &setup, steps, n, &error);
    }
    rig.journal = status == GONIO_OK ? session : NULL;
    exit_status = status == GONIO_OK ? cli_measuring_run(&r->measuring, session, &rig.rig)
                                     : cli_fail(r->measuring.common, &error);
out:
    rig.journal = NULL;
    gonio_session_close(session);
    free(steps);
    cli_rig_close(&rig);
    return exit_status;
}

static int run(int argc, char **argv);

const cli_verb cmd_measure = {"measure", "[--rig sim|RIG.ini] [--sample SPEC] [--plan PLAN] SESSION",
                              "measure a sample into a session and fit it", run};

static int run(int argc, char **argv) {
    request r = {.plan = "nusselt:1400"};
    cli_fit_arguments arguments = {0};
    cli_common common;
    const cli_option own[] = {
        CLI_RIG_OPTIONS(r.rig),
        {"plan", 0, CLI_TEXT, &r.plan, NULL, "PLAN", "uniform:STEP, nusselt:N (nusselt:1400) or a CSV of poses"},
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
        !cli_fit_read(&arguments, "measure", &common, &r.fit)) {
        return 2;
    }
    r.rig.seed = common.seed;
    r.rig.threads = common.threads;
    r.measuring.common = &common;
    return run_request(&r, session);
}
