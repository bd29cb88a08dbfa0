// SPDX-License-Identifier: BSD-3-Clause
#include "sim/internal.h"

bool gonio_sim_fault_strikes(gonio_sim *sim, sim_fault_kind kind, const gonio_stamp *stamp) {
    const sim_fault *fault = &sim->settings.fault[kind];
    if (fault->pose < 0 || stamp->pose != fault->pose || (fault->frame >= 0 && stamp->frame != fault->frame) ||
        (fault->times > 0 && sim->fault_hits[kind] >= fault->times)) {
        return false;
    }
    sim->fault_hits[kind]++;
    return true;
}
