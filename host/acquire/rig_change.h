// SPDX-License-Identifier: BSD-3-Clause
// A rig file that was edited since a session was begun, held against what the session keeps of it.
#ifndef GONIO_HOST_ACQUIRE_RIG_CHANGE_H
#define GONIO_HOST_ACQUIRE_RIG_CHANGE_H

#include <stdbool.h>

#include "gonio/status.h"

// text, settings: the journalled rig file and the lines of section.key=value over it. *lines: those keys of the file
// that say where a device is reached and are others now, a line of section.key=value each; the caller frees it. *whole:
// the file has every key of a device that the session has, so it is the file that names what is opened. GONIO_E_INPUT with the
// file's line where any other key differs: its samples would be others'.
gonio_status gonio_rig_change(const char *text, const char *settings, const char *path, char **lines, bool *whole,
                              gonio_error *error);

#endif
