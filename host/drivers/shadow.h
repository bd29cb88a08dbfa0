// SPDX-License-Identifier: BSD-3-Clause
// A real stage or lamp that simulated devices follow: real arms with a simulated camera, for tests and dry runs.
//
// The real device does the work and its faults count; the simulated one is told the same. Nominal times and positions
// are the simulated one's, so that simulated effects do not depend on which stage moves (equal seeds, equal samples).
#ifndef GONIO_DRIVERS_SHADOW_H
#define GONIO_DRIVERS_SHADOW_H

#include "gonio/rig.h"

// Put the real device into the rig in front of the simulated one that is there; closing it closes both. On failure the
// real device stays the caller's.
gonio_status gonio_shadow_stage(gonio_rig *rig, const gonio_stage_ops *stage, void *device, gonio_error *error);
gonio_status gonio_shadow_lamp(gonio_rig *rig, const gonio_lamp_ops *lamp, void *device, gonio_error *error);

#endif
