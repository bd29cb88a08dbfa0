// SPDX-License-Identifier: BSD-3-Clause
#ifndef GONIO_HOST_ACQUIRE_IDENTITY_H
#define GONIO_HOST_ACQUIRE_IDENTITY_H

#include <jansson.h>

#include "host/acquire/rig_file.h"

// The drivers of an open rig, its sensor, and versions and serial numbers as far as the devices tell them. The caller
// releases *out.
gonio_status gonio_rig_describe(const gonio_rig_file *rig, json_t **out, gonio_error *error);
// The same as a text for the journal, with the version of the register table that this host knows; the caller frees it.
gonio_status gonio_rig_identity_text(const gonio_rig_file *rig, char **text, gonio_error *error);

#endif
