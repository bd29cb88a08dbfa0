// SPDX-License-Identifier: BSD-3-Clause
#include "host/cli/fit_arguments.h"

int cli_fit_rows(cli_fit_arguments *a, cli_option *rows) {
    int n = 0;
    for (int k = 0; k < GONIO_FIT_KEYS; k++) {
        const gonio_key *key = &gonio_fit_keys[k];
        const bool flag = key->kind == GONIO_KEY_BOOLEAN;
        if (key->kind == GONIO_KEY_SEED) {
            continue;
        }
        gonio_key_option(key, a->names[k], sizeof a->names[k]);
        gonio_fit_option_help(key, a->helps[k], sizeof a->helps[k]);
        rows[n++] = (cli_option){.name = a->names[k],
                                 .kind = flag ? CLI_FLAG : CLI_TEXT,
                                 .value = flag ? (void *)&a->flags[k] : (void *)&a->texts[k],
                                 .given = &a->given[k],
                                 .argument = key->argument,
                                 .help = a->helps[k]};
    }
    return n;
}

static bool was_given(const cli_fit_arguments *a, size_t offset) {
    for (int k = 0; k < GONIO_FIT_KEYS; k++) {
        if (gonio_fit_keys[k].offset == offset) {
            return a->given[k];
        }
    }
    return false;
}

// An option given by hand is refused where the method lacks it, though its value be the default.
static gonio_status take(const cli_fit_arguments *a, gonio_fit_options *o, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int k = 0; k < GONIO_FIT_KEYS && status == GONIO_OK; k++) {
        if (a->given[k]) {
            status = gonio_key_parse(&gonio_fit_keys[k], o, a->flags[k] ? "1" : a->texts[k], error);
        }
    }
    const gonio_method *method = gonio_fit_method_of(o);
    for (int k = 0; k < GONIO_FIT_KEYS && status == GONIO_OK; k++) {
        if (a->given[k] && !gonio_method_has(method, &gonio_fit_keys[k])) {
            status = gonio_method_refuse(method, &gonio_fit_keys[k], error);
        }
    }
    return status == GONIO_OK ? gonio_fit_options_check(o, method, error) : status;
}

bool cli_fit_read(const cli_fit_arguments *a, const char *verb, const cli_common *common, gonio_fit_options *options) {
    gonio_error error;
    gonio_fit_options_default(options);
    options->seed = common->seed;
    options->threads = common->threads;
    const bool folds = was_given(a, offsetof(gonio_fit_options, folds));
    if (folds && was_given(a, offsetof(gonio_fit_options, hold_out))) {
        cli_usage(common, "%s: --hold-out and --folds exclude each other", verb);
        return false;
    }
    if (take(a, options, &error) != GONIO_OK) {
        cli_usage(common, "%s: %s", verb, error.message);
        return false;
    }
    options->hold_out = folds ? 0 : options->hold_out;
    return true;
}
