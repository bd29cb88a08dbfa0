// SPDX-License-Identifier: BSD-3-Clause
// A rig that is driven by this program, as other programs of the same user see it (host/control).
#ifndef GONIO_HOST_ACQUIRE_RIG_CONTROL_H
#define GONIO_HOST_ACQUIRE_RIG_CONTROL_H

#include "host/acquire/rig_file.h"

// What the rig's name is made of: the line to its controller, else the rig file; *identity is NULL where there is
// neither, as for the simulator, which every program has for itself. The caller frees it.
gonio_status gonio_rig_identity(const gonio_rig_file *rig, char **identity, gonio_error *error);
// The same before any device is opened, for who wants to ask the program that drives it.
gonio_status gonio_rig_file_identity(const gonio_rig_file_options *options, char **identity, gonio_error *error);
// Take the rig's name before its devices are opened. GONIO_E_DEVICE where another program drives the same controller.
// What else goes wrong is told and survived.
gonio_status gonio_rig_control_begin(gonio_rig_file *rig, gonio_error *error);
// From here on a request is answered with what the devices last said.
void gonio_rig_control_opened(gonio_rig_file *rig);

#endif
