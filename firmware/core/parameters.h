// SPDX-License-Identifier: BSD-3-Clause
// Parameters in flash: two slots, written in turn, so that a cut at any moment leaves the older one.
#ifndef FW_PARAMETERS_H
#define FW_PARAMETERS_H

#include <stdbool.h>

struct fw_core;

// Take the newest valid slot; false: none is, nothing changed.
bool gonio_fw_parameters_load(struct fw_core *core);
// Write the other slot; false: flash did not take it, the older slot stands.
bool gonio_fw_parameters_save(struct fw_core *core);

#endif
