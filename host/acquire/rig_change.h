// SPDX-License-Identifier: BSD-3-Clause
// A rig file that was edited since a session was begun, held against what the session keeps of it.
#ifndef GONIO_HOST_ACQUIRE_RIG_CHANGE_H
#define GONIO_HOST_ACQUIRE_RIG_CHANGE_H

#include <stdbool.h>

#include "gonio/session.h"

// The rig file and the settings over it, a line of section.key=value each, as journalled; earlier releases had them in
// one text. The caller frees both.
gonio_status gonio_rig_journalled(gonio_session *session, char **text, char **settings, gonio_error *error);
// Put before *extra, lines of section.key=value that the caller frees, those keys of the file `path` that say where a
// device is reached and are others than the session's. *whole: the file has every key of a device that the session has,
// so it is the file that names what is opened. GONIO_E_INPUT with the file's line where any other key differs: its
// samples would be others'.
gonio_status gonio_rig_change(gonio_session *session, const char *path, char **extra, bool *whole, gonio_error *error);

#endif
