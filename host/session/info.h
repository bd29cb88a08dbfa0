// SPDX-License-Identifier: BSD-3-Clause
#ifndef GONIO_SESSION_INFO_H
#define GONIO_SESSION_INFO_H

#include <jansson.h>

#include "gonio/session.h"

// All that a session says of itself, pixels and samples apart, as one JSON object (docs/formats.md): progress, every
// setting, who wrote, the files it was made from, counts and times, readings of the monitor, events. The caller
// releases *out.
gonio_status gonio_session_info(gonio_session *session, json_t **out, gonio_error *error);

#endif
