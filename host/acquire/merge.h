// SPDX-License-Identifier: BSD-3-Clause
#ifndef GONIO_HOST_ACQUIRE_MERGE_H
#define GONIO_HOST_ACQUIRE_MERGE_H

#include <jansson.h>

#include "gonio/session.h"

// The final samples of several sessions of one sample on one rig as one set, each session a group whose systematic
// errors are its own. GONIO_E_INPUT, naming what differs, where rig, camera, sample or calibration do; `force` lets
// stated uncertainties and the rig's serial numbers differ. *sessions: where each group is from, an object a session,
// which stands in the set's head as well. The caller frees and releases both.
gonio_status gonio_sessions_merge(const char *const *paths, int n, bool force, gonio_samples **out, json_t **sessions,
                                  gonio_error *error);

#endif
