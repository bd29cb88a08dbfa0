// SPDX-License-Identifier: BSD-3-Clause
// gonio learn: a prior from a library of models.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "gonio/library.h"
#include "host/cli/apart.h"

#define MODELS_MAX 1024

static int run(int argc, char **argv);
const cli_verb cmd_learn = {"learn", "MODEL MODEL ... -o PRIOR",
                            "a prior from a lab's own models, by which few samples of the next material are fitted",
                            run};

typedef struct request {
    const char *names[MODELS_MAX];
    int n;
    const char *output, *list;
    char *list_text;
    cli_progress progress;
    gonio_library_options options;
} request;

static bool on_progress(void *context, double fraction, const char *what, double error_now) {
    (void)error_now;
    cli_progress_update(context, fraction, what, NAN);
    return !cli_interrupted();
}

// A MODEL a line; empty lines and those that begin with # say nothing.
static gonio_status read_list(request *r, gonio_error *error) {
    gonio_text text;
    char *line;
    if (r->list == NULL) {
        return GONIO_OK;
    }
    gonio_status status = gonio_text_open(r->list, 0, &text, error);
    if (status != GONIO_OK) {
        return status;
    }
    while (status == GONIO_OK && (line = gonio_text_content(&text)) != NULL) {
        if (r->n == MODELS_MAX) {
            status = gonio_text_fail(&text, error, "more than %d models", MODELS_MAX);
        } else {
            r->names[r->n++] = line;
        }
    }
    r->list_text = text.data; // the names lie in it
    return status;
}

static gonio_status learn(request *r, const cli_common *common, gonio_library_facts *facts, gonio_error *error) {
    gonio_model *models[MODELS_MAX] = {NULL};
    gonio_library *library = NULL;
    gonio_status status = read_list(r, error);
    for (int i = 0; i < r->n && status == GONIO_OK; i++) {
        status = cli_apart_input(common, r->names[i], error);
        status = status == GONIO_OK ? gonio_model_resolve(r->names[i], &models[i], error) : status;
    }
    cli_progress_start(&r->progress, "learn", 1);
    if (status == GONIO_OK) {
        status = gonio_library_learn((const gonio_model *const *)models, r->names, (size_t)r->n, &r->options, &library,
                                     error);
    }
    cli_progress_end(&r->progress);
    status = status == GONIO_OK ? gonio_library_save(library, r->output, error) : status;
    if (status == GONIO_OK) {
        gonio_library_tell(library, facts);
    }
    gonio_library_free(library);
    for (int i = 0; i < r->n; i++) {
        gonio_model_free(models[i]);
    }
    free(r->list_text);
    return status;
}

static int report(const cli_common *common, const request *r, const gonio_library_facts *f) {
    if (common->json) {
        return cli_json(json_pack("{s:i,s:i,s:i,s:f,s:f,s:f,s:f,s:I,s:s}", "models", f->models, "columns", f->columns,
                                  "components", f->rank, "explained", f->explained, "inflation", f->inflation, "limit",
                                  sqrt(f->limit), "trial_median_rel", f->trial_error, "bytes", (json_int_t)f->bytes,
                                  "prior", r->output));
    }
    printf("%d models, %d channels -> %d components; of models that they were not learnt from they hold %.3g %% of the "
           "variance\n",
           f->models, f->columns, f->rank, 100 * f->explained);
    printf("left out and fitted from 20 poses, models are met to %.3g %% (median); sigma is widened %.3g times\n",
           100 * f->trial_error, f->inflation);
    printf("a sample whose left-out residuals exceed %.3g sigmas (rms) is not like this library\n%s\n", sqrt(f->limit),
           r->output);
    return 0;
}

static int run(int argc, char **argv) {
    request r = {0};
    cli_common common;
    gonio_library_facts facts;
    gonio_error error = {.line = -1, .byte = -1};
    const cli_option options[] = {
        {"output", 'o', CLI_OUTPUT, &r.output, NULL, "PRIOR", "where the prior goes"},
        {"list", 0, CLI_TEXT, &r.list, NULL, "FILE", "more models, one a line"},
        {"components", 0, CLI_INT, &r.options.rank, NULL, "N", "at most N principal components (40)"},
        {0},
    };
    if (!cli_parse(&cmd_learn, options, argc, argv, r.names, 0, MODELS_MAX, &r.n, &common)) {
        return 2;
    }
    if (r.output == NULL) {
        return cli_usage(&common, "learn: -o PRIOR is missing");
    }
    if (r.options.rank < 0 || r.options.rank > 40) {
        return cli_usage(&common, "learn: --components %d; expected 1 to 40", r.options.rank);
    }
    r.options.seed = common.seed;
    r.options.threads = common.threads;
    r.options.progress = on_progress;
    r.options.progress_context = &r.progress;
    cli_catch_interrupts();
    const gonio_status status = learn(&r, &common, &facts, &error);
    return status == GONIO_OK ? report(&common, &r, &facts) : cli_fail(&common, &error);
}
