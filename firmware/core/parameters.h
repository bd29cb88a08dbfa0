// SPDX-License-Identifier: BSD-3-Clause
// Parameters in flash: two slots, written in turn, so that a cut at any moment leaves the older one.
#ifndef FW_PARAMETERS_H
#define FW_PARAMETERS_H

#include <stdbool.h>
#include <stdint.h>

#include "firmware/core/stepgen.h"

struct fw_core;

// What the parameters make a position mean: where they differ from what an axis was homed with, it is not homed.
struct fw_meaning {
    uint32_t steps_per_deg[FW_AXES];
    int64_t home_position[FW_AXES];
    uint16_t home_up[FW_AXES];
    uint16_t direction_invert;
};

// They may have changed: bring generation and checksum up to date, and forget the positions that mean something else
// now.
void gonio_fw_parameters_note(struct fw_core *core);
// Take the newest valid slot; false: none is, nothing changed.
bool gonio_fw_parameters_load(struct fw_core *core);
// Write the other slot; false: flash did not take it, the older slot stands.
bool gonio_fw_parameters_save(struct fw_core *core);

#endif
