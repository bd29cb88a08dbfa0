// SPDX-License-Identifier: BSD-3-Clause
// No target of a verb is one of its inputs, and none lies in a session. Every CLI_OUTPUT of a verb's options is
// checked by cli_parse, before anything is read; what options do not show is for the verb to ask.
#ifndef GONIO_CLI_APART_H
#define GONIO_CLI_APART_H

#include "host/cli/cli.h"

// May this file be written, with what was given? False after having reported wrong usage: return 2 then.
bool cli_apart(const cli_common *common, const char *output);
// The same of the files, up to NULL, that a verb writes in a folder, which may be NULL.
bool cli_apart_folder(cli_common *common, const char *folder, const char *const *files);
// The same of the folder of a session that the verb makes.
bool cli_apart_session(const cli_common *common, const char *session);
// The same of the model of a verb that owns the session: SESSION/model.gonio is its place. output may be NULL.
bool cli_apart_model(const cli_common *common, const char *output, const char *session);
// The same of every CLI_OUTPUT that was given; and no two are one file.
bool cli_apart_all(const cli_common *common);
// Does the file's ending belong to another kind of file than the one that is written? what: "CSV", "MODEL", "PNG" ...,
// or a format's name. False after having reported wrong usage.
bool cli_ending(const cli_common *common, const char *output, const char *what);
// GONIO_E_USAGE where this input, which another one names, would be written over.
gonio_status cli_apart_input(const cli_common *common, const char *path, gonio_error *error);

#endif
