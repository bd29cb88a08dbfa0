// gonio replay: stored frames -> calibration -> samples -> fit again, held against what the measure journalled.
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "host/cli/measuring.h"

static int run(int argc, char **argv);
const cli_verb cmd_replay = {"replay", "SESSION [--model OUT]",
                             "compute samples and model again from a session's frames; exit 1 where they differ", run};

typedef struct request {
    const cli_common *common;
    const char *path, *model;
    cli_progress progress;
} request;

// What differs from the journal.
typedef struct verdict {
    size_t steps_differing;
    long long first_differing;
    bool finished; // the measure journalled its results
    bool samples_equal, model_equal;
    char *samples_sha256, *model_sha256; // as journalled; NULL: none
} verdict;

static bool on_progress(void *context, double fraction, const char *what, double error_now) {
    (void)what, (void)error_now;
    request *r = context;
    cli_progress_update(&r->progress, fraction * r->progress.total, "", NAN);
    return !cli_interrupted();
}

static bool may_go_on(void *context, double fraction, const char *what, double error_now) {
    (void)context, (void)fraction, (void)what, (void)error_now;
    return !cli_interrupted();
}

static bool same(const gonio_samples *a, const gonio_samples *b) {
    if (a == NULL || b == NULL) {
        return a == b;
    }
    const size_t bytes = a->n * (size_t)a->channels * sizeof(double);
    return a->n == b->n && a->channels == b->channels &&
           (a->n == 0 ||
            (memcmp(a->pairs, b->pairs, a->n * sizeof *a->pairs) == 0 && memcmp(a->values, b->values, bytes) == 0 &&
             memcmp(a->sigma_random, b->sigma_random, bytes) == 0 &&
             memcmp(a->sigma_systematic, b->sigma_systematic, bytes) == 0));
}

static gonio_status compare_sets(gonio_session *session, const gonio_process *process, gonio_samples *const *sets,
                                 verdict *v, gonio_error *error) {
    for (size_t i = process->n; i-- > 0;) {
        gonio_samples *stored = NULL;
        if (sets[i] != NULL) {
            const gonio_status status = gonio_session_step_samples(session, (int64_t)i, &stored, error);
            if (status != GONIO_OK) {
                return status;
            }
        }
        if (!same(sets[i], stored)) {
            v->steps_differing++;
            v->first_differing = (long long)i;
        }
        gonio_samples_free(stored);
    }
    return GONIO_OK;
}

// A model of its own for the checksum where none is asked for.
static gonio_status temporary_folder(char path[64], gonio_error *error) {
    const char *folder = getenv("TMPDIR");
    if (snprintf(path, 64, "%s/gonio-replay-XXXXXX", folder != NULL && strlen(folder) < 32 ? folder : "/tmp") >= 64) {
        return gonio_fail(error, GONIO_E_IO, "the path of the temporary folder is too long");
    }
    return mkdtemp(path) != NULL
               ? GONIO_OK
               : gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot make a temporary folder: %s", strerror(errno));
}

static gonio_status finish(const request *r, gonio_session *session, gonio_process *process, gonio_samples **sets,
                           gonio_outcome *outcome, gonio_error *error) {
    gonio_finish_options options = {
        .sets = sets, .threads = r->common->threads, .model_path = r->model, .progress = may_go_on};
    if (r->model != NULL) {
        return gonio_finish(session, process, &options, outcome, error);
    }
    char folder[64], file[80];
    gonio_status status = temporary_folder(folder, error);
    if (status != GONIO_OK) {
        return status;
    }
    snprintf(file, sizeof file, "%s/model", folder);
    options.model_path = file;
    status = gonio_finish(session, process, &options, outcome, error);
    unlink(file);
    rmdir(folder);
    return status;
}

static gonio_status replay(request *r, gonio_session *session, gonio_process *process, gonio_outcome *outcome,
                           verdict *v, gonio_error *error) {
    bool ready;
    gonio_status status = gonio_process_begin(session, process, error);
    if (status == GONIO_OK) {
        status = gonio_process_prepare(session, process, NULL, NULL, 0, &ready, error);
    }
    if (status == GONIO_OK && !ready) {
        return gonio_fail_line(error, GONIO_E_INPUT, r->path, -1,
                               "its dark and reference frames are not complete; `gonio resume` takes them");
    }
    gonio_samples **sets = NULL;
    if (status == GONIO_OK) {
        cli_progress_start(&r->progress, "poses", (double)process->n);
        status = gonio_process_samples(session, process, false, r->common->threads, on_progress, r, &sets, error);
        cli_progress_end(&r->progress);
    }
    if (status == GONIO_OK) {
        status = compare_sets(session, process, sets, v, error);
    }
    if (status == GONIO_OK) {
        status = finish(r, session, process, sets, outcome, error);
    }
    gonio_sets_free(sets, process->n);
    v->finished = gonio_session_get(session, "result.samples_sha256", &v->samples_sha256, NULL) == GONIO_OK &&
                  gonio_session_get(session, "result.model_sha256", &v->model_sha256, NULL) == GONIO_OK;
    if (status == GONIO_OK && v->finished) {
        v->samples_equal = strcmp(v->samples_sha256, outcome->samples_sha256) == 0;
        v->model_equal = strcmp(v->model_sha256, outcome->model_sha256) == 0;
    }
    return status;
}

static json_t *text_or_null(const char *text) { return text != NULL ? json_string(text) : json_null(); }

static int report(const request *r, const gonio_outcome *outcome, const verdict *v) {
    const bool equal = v->steps_differing == 0 && (!v->finished || (v->samples_equal && v->model_equal));
    if (r->common->json) {
        json_t *object = cli_outcome_json(r->path, outcome);
        json_object_set_new(object, "journalled_samples_sha256", text_or_null(v->samples_sha256));
        json_object_set_new(object, "journalled_model_sha256", text_or_null(v->model_sha256));
        json_object_set_new(object, "finished", json_boolean(v->finished));
        json_object_set_new(object, "steps_differing", json_integer((json_int_t)v->steps_differing));
        json_object_set_new(object, "equal", json_boolean(equal));
        if (r->model != NULL) {
            json_object_set_new(object, "model", json_string(r->model));
        }
        cli_json(object);
    } else {
        cli_outcome_print(outcome);
        if (v->finished) {
            printf("journalled samples %s: %s\n", v->samples_sha256, v->samples_equal ? "equal" : "DIFFERENT");
            printf("journalled model   %s: %s\n", v->model_sha256, v->model_equal ? "equal" : "DIFFERENT");
        } else {
            printf("the session is not finished, so there is no result to compare with; `gonio resume` goes on\n");
        }
    }
    if (v->steps_differing > 0) {
        fprintf(stderr, "gonio: %zu steps give other samples than were journalled, the first is step %lld\n",
                v->steps_differing, v->first_differing);
    }
    return equal ? 0 : gonio_status_exit(GONIO_E_MISMATCH);
}

static int run(int argc, char **argv) {
    cli_common common;
    request r = {.common = &common};
    const cli_option options[] = {
        {"model", 0, CLI_TEXT, &r.model, NULL, "OUT", "save the model there too"},
        {0},
    };
    int count;
    if (!cli_parse(&cmd_replay, options, argc, argv, &r.path, 1, 1, &count, &common)) {
        return 2;
    }
    gonio_error error = {.line = -1, .byte = -1};
    gonio_session *session = NULL;
    gonio_process process = {0};
    gonio_outcome outcome = {0};
    verdict v = {0};
    cli_catch_interrupts();
    gonio_status status = gonio_session_open(r.path, false, &session, &error);
    if (status == GONIO_OK) {
        status = replay(&r, session, &process, &outcome, &v, &error);
    }
    const int exit_status = status == GONIO_OK ? report(&r, &outcome, &v) : cli_fail(&common, &error);
    free(v.samples_sha256);
    free(v.model_sha256);
    gonio_outcome_free(&outcome);
    gonio_process_end(&process);
    gonio_session_close(session);
    return exit_status;
}
