// SPDX-License-Identifier: BSD-3-Clause
#include "firmware/core/owner.h"

#include "firmware/core/core.h"

bool gonio_fw_owner_stops(const struct fw_claim *claim) {
    return claim->command == FW_COMMAND_STOP || claim->command == FW_COMMAND_HALT;
}

static bool free_to_take(const struct fw_owner *owner) {
    return owner->number == 0 || owner->channel == FW_CHANNEL_NONE;
}

static bool named(const struct fw_owner *owner) { return owner->number != FW_OWNER_UNNAMED; }

static bool of_its_channel(const struct fw_core *core) { return core->owner.channel == core->modbus.channel; }

bool gonio_fw_owner_allows(const struct fw_core *core, const struct fw_claim *claim) {
    const struct fw_owner *owner = &core->owner;
    if (claim->harmless || gonio_fw_owner_stops(claim) || free_to_take(owner))
        return true;
    if (claim->number != 0)
        return named(owner) ? claim->number == owner->number : of_its_channel(core);
    // On a line that several share the channel tells nothing: what moves must carry the number.
    return of_its_channel(core) && (claim->command == 0 || !named(owner));
}

static void claim_or_feed(struct fw_core *core, uint32_t number) {
    core->owner = (struct fw_owner){number, core->modbus.channel, core->ms};
}

void gonio_fw_owner_wrote(struct fw_core *core, const struct fw_claim *claim) {
    struct fw_owner *owner = &core->owner;
    const bool fresh = free_to_take(owner);
    if (claim->harmless || claim->command == FW_COMMAND_YIELD)
        return;
    if (gonio_fw_owner_stops(claim) && (fresh || (claim->number != 0 ? claim->number != owner->number : named(owner))))
        return; // nobody takes the rig by stopping it
    if (claim->number != 0)
        claim_or_feed(core, claim->number);
    else if (fresh ? claim->command != 0 : !named(owner) && of_its_channel(core))
        claim_or_feed(core, FW_OWNER_UNNAMED);
}

bool gonio_fw_owner_allows_coils(const struct fw_core *core, bool any_on) {
    return !any_on || free_to_take(&core->owner) || of_its_channel(core);
}

void gonio_fw_owner_switched(struct fw_core *core, bool any_on) {
    const struct fw_owner *owner = &core->owner;
    if (free_to_take(owner) ? any_on : !named(owner) && of_its_channel(core))
        claim_or_feed(core, FW_OWNER_UNNAMED);
}

enum fw_refusal gonio_fw_owner_yield(struct fw_core *core) {
    if (!gonio_fw_core_at_rest(core))
        return FW_REFUSAL_BUSY;
    core->owner = (struct fw_owner){0, FW_CHANNEL_NONE, 0};
    return FW_REFUSAL_NONE;
}

void gonio_fw_owner_hung_up(struct fw_core *core, uint32_t channel) {
    if (core->owner.number == FW_OWNER_UNNAMED && core->owner.channel == channel)
        core->owner.channel = FW_CHANNEL_NONE; // the dead-man still counts
}

void gonio_fw_owner_poll(struct fw_core *core) {
    struct fw_owner *owner = &core->owner;
    const uint32_t limit = core->registers.deadman[0], silent = core->ms - owner->heard;
    if (owner->number == 0 || silent <= (limit != 0 ? limit : FW_OWNER_IDLE_MS))
        return;
    if (limit == 0 && !gonio_fw_core_at_rest(core))
        return; // it may be silent for any time, and wants its move to end
    owner->number = 0;
    if (limit != 0 && core->state != FW_STATE_ALARM && core->state != FW_STATE_ESTOP)
        gonio_fw_interlock_alarm(core, FW_ALARM_DEADMAN, FW_NO_AXIS, false);
}
