// SPDX-License-Identifier: BSD-3-Clause
// The sample changer and the interlock.
#include "sim/internal.h"

static gonio_status mount(void *device, gonio_target target, gonio_error *error) {
    if (target < GONIO_TARGET_SAMPLE || target > GONIO_TARGET_MIRROR) {
        return gonio_fail(error, GONIO_E_RANGE, "sample changer: there is no target %d", (int)target);
    }
    gonio_sim *sim = device;
    if (target == GONIO_TARGET_FIDUCIAL && sim->texture.pixels == NULL) {
        return gonio_fail(error, GONIO_E_USAGE, "sample changer: there is no fiducial (gonio_sim_fiducial)");
    }
    sim->target = target;
    return GONIO_OK;
}

// It has no stamp of its own: a fault strikes at the pose that the stage was last sent to.
static gonio_status check(void *device, gonio_error *error) {
    gonio_sim *sim = device;
    const bool open = gonio_sim_fault_strikes(sim, SIM_FAULT_INTERLOCK_OPEN, &sim->moved);
    gonio_machine_hold(&sim->machine, FW_CONTACT_door, open);
    if (open) {
        return gonio_fail(error, GONIO_E_DEVICE, "interlock: the door is open");
    }
    return GONIO_OK;
}

static void nothing_to_close(void *device) { (void)device; }

const gonio_mount_ops gonio_sim_mount_ops = {
    .name = "simulated sample changer", .mount = mount, .close = nothing_to_close};
const gonio_interlock_ops gonio_sim_interlock_ops = {
    .name = "simulated interlock", .check = check, .close = nothing_to_close};
