// SPDX-License-Identifier: BSD-3-Clause
// gonio replay: stored frames -> calibration -> samples -> fit again, held against what the measure journalled.
#include <math.h>
#include <stdio.h>

#include "host/cli/measuring.h"

static int run(int argc, char **argv);
const cli_verb cmd_replay = {
    "replay", "SESSION [--model OUT]",
    "compute samples and model again from a session's frames; exit 1 where they differ beyond rounding", run};

// A model of another form is infinitely far apart: null.
#define SHARE(member) CLI_FIGURE(gonio_agreement, member)
static const cli_figure shares[] = {SHARE(angle), SHARE(value), SHARE(sigma), SHARE(model), {0}};

static void print_agreement(const gonio_agreement *a, bool rounding) {
    printf("%s: in shares of what rounding may come to, angles differ by %.2g, values by %.2g, sigmas by %.2g, ",
           rounding ? "rounding" : "CHANGED", a->angle, a->value, a->sigma);
    if (isinf(a->model)) {
        printf("and the model is of another form, or its file is gone\n");
    } else {
        printf("the model by %.2g\n", a->model);
    }
}

static json_t *stages_json(const gonio_replay_report *r) {
    json_t *list = json_array();
    for (int k = 0; k < GONIO_STAGES; k++) {
        const gonio_stage_report *s = &r->stages[k];
        json_array_append_new(list,
                              json_pack("{s:s,s:o,s:o,s:o,s:I,s:o,s:o}", "stage", gonio_stage_name(k), "journalled",
                                        cli_json_text(s->journalled), "again", cli_json_text(s->again), "equal",
                                        s->known ? json_boolean(s->equal) : json_null(), "steps_differing",
                                        (json_int_t)s->steps_differing, "first_step",
                                        s->first_step >= 0 ? json_integer(s->first_step) : json_null(),
                                        "largest_relative", cli_json_real(s->largest)));
    }
    return list;
}

static void print_stages(const gonio_replay_report *r) {
    for (int k = 0; k < GONIO_STAGES; k++) {
        const gonio_stage_report *s = &r->stages[k];
        printf("stage      %-9s %s", gonio_stage_name(k),
               !s->known  ? "not journalled, nothing to compare with"
               : s->equal ? "equal"
                          : "DIFFERENT");
        if (s->known && !s->equal && s->steps_differing > 0) {
            printf(" in %zu steps, the first is step %lld", s->steps_differing, s->first_step);
        }
        if (s->known && !s->equal && s->largest > 0) {
            printf(", by up to %.2g relative", s->largest);
        }
        putchar('\n');
    }
    if (r->first_stage >= 0) {
        printf("the first stage that differs is %s; what comes after it follows\n", gonio_stage_name(r->first_stage));
    }
}

static int report_json(const char *path, const gonio_outcome *outcome, const gonio_replay_report *r) {
    json_t *object = cli_outcome_json(path, outcome);
    json_object_set_new(object, "journalled_samples_sha256", cli_json_text(r->samples_sha256));
    json_object_set_new(object, "journalled_model_sha256", cli_json_text(r->model_sha256));
    json_object_set_new(object, "finished", json_boolean(r->finished));
    json_object_set_new(object, "steps_differing", json_integer((json_int_t)r->steps_differing));
    json_object_set_new(object, "batches", json_integer((json_int_t)r->batches));
    json_object_set_new(object, "batches_differing", json_integer((json_int_t)r->batches_differing));
    json_object_set_new(object, "equal", json_boolean(r->equal));
    json_object_set_new(object, "verdict", json_string(r->equal ? "identical" : r->rounding ? "rounding" : "changed"));
    json_object_set_new(object, "shares_of_bounds", cli_json_figures(shares, &r->agreement));
    json_object_set_new(object, "stages", stages_json(r));
    json_object_set_new(object, "first_stage_differing",
                        r->first_stage >= 0 ? json_string(gonio_stage_name(r->first_stage)) : json_null());
    if (outcome->model_path != NULL) {
        json_object_set_new(object, "model", json_string(outcome->model_path));
    }
    return cli_json(object);
}

static int report(const cli_common *common, const char *path, const gonio_outcome *outcome,
                  const gonio_replay_report *r) {
    if (common->json) {
        report_json(path, outcome, r);
    } else {
        cli_outcome_print(outcome);
        if (r->finished) {
            printf("journalled samples %s: %s\n", r->samples_sha256, r->samples_equal ? "equal" : "DIFFERENT");
            printf("journalled model   %s: %s\n", r->model_sha256, r->model_equal ? "equal" : "DIFFERENT");
        } else {
            printf("the session is not finished, so there is no result to compare with; `gonio resume` goes on\n");
        }
        print_stages(r);
        if (r->batches > 0) {
            printf("batches    %zu of %zu were chosen on these very samples\n", r->batches - r->batches_differing,
                   r->batches);
        }
    }
    if (!common->json && !r->equal) {
        print_agreement(&r->agreement, r->rounding);
    }
    if (r->steps_differing > 0 && !r->rounding) {
        fprintf(stderr, "gonio: %zu steps give other samples than were journalled, the first is step %lld\n",
                r->steps_differing, r->first_differing);
    }
    return r->equal || r->rounding ? 0 : gonio_status_exit(GONIO_E_MISMATCH);
}

static int run(int argc, char **argv) {
    cli_common common;
    cli_measuring measuring = {.common = &common};
    const cli_option options[] = {
        {"model", 0, CLI_OUTPUT, &measuring.model, NULL, "OUT", "save the model there too"},
        {0},
    };
    const char *path;
    int count;
    if (!cli_parse(&cmd_replay, options, argc, argv, &path, 1, 1, &count, &common)) {
        return 2;
    }
    gonio_error error = {.line = -1, .byte = -1};
    gonio_session *session = NULL;
    gonio_outcome outcome = {0};
    gonio_replay_report r;
    gonio_measure_options how;
    gonio_measure_options_default(&how);
    cli_measuring_options(&measuring, &how);
    cli_catch_interrupts();
    gonio_status status = gonio_session_open(path, false, &session, &error);
    status = status == GONIO_OK ? gonio_replay(session, &how, &outcome, &r, &error) : status;
    cli_progress_end(&measuring.progress);
    const int exit_status = status == GONIO_OK ? report(&common, path, &outcome, &r) : cli_fail(&common, &error);
    gonio_outcome_free(&outcome);
    gonio_session_close(session);
    return exit_status;
}
