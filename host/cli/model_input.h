// SPDX-License-Identifier: BSD-3-Clause
// MODEL of a verb that also takes samples: these become a model by the default method, which is said.
#ifndef GONIO_CLI_MODEL_INPUT_H
#define GONIO_CLI_MODEL_INPUT_H

#include "gonio/model.h"
#include "host/cli/input.h"

// A model file, spec:SPEC, a table that is one by itself, or samples of any file or session that can be read. Options
// of reading apply to samples alone. result takes "fitted" where a model had to be fitted. samples may be NULL; else it
// takes what was read, NULL where nothing was. The caller frees both.
gonio_status cli_model_read(const char *name, const cli_input *in, const cli_common *common, json_t *result,
                            gonio_model **model, gonio_samples **samples, gonio_error *error);
// Its values where a plan says, or where usual says, in the halves that the model has, where plan is NULL.
gonio_status cli_model_sampled(const gonio_model *model, const char *plan, const char *usual, const cli_common *common,
                               gonio_samples **samples, gonio_error *error);

#endif
