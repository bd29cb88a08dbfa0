// SPDX-License-Identifier: BSD-3-Clause
#include "firmware/core/core.h"

#include "firmware/contract/pin.h"
#include "firmware/contract/tick.h"
#include "firmware/contract/watchdog.h"

void gonio_fw_core_init(struct fw_core *core, uint16_t board, enum fw_cause cause) {
    gonio_fw_interlock_fault(core); // everything off
    gonio_fw_registers_initialise(core, false);
    core->registers.board[0] = board;
    core->registers.reset_cause[0] = (uint16_t)cause;
    gonio_fw_parameters_load(core);
    gonio_fw_parameters_note(core);
    gonio_fw_axis_enable(core);
    gonio_fw_lamp_outputs(core);
    core->state = FW_STATE_IDLE;
    core->last_tick = gonio_fw_board_now(core);
    gonio_fw_modbus_setup(core, core->registers.baud[0]);
    gonio_fw_board_watchdog_start(core, FW_WATCHDOG_MS);
    gonio_fw_board_inputs_pend(core);
}

bool gonio_fw_core_at_rest(const struct fw_core *core) {
    return !core->axis.under_way &&
           (core->state == FW_STATE_IDLE || core->state == FW_STATE_ALARM || core->state == FW_STATE_ESTOP);
}

enum fw_refusal gonio_fw_core_ready(const struct fw_core *core) {
    switch (core->state) {
    case FW_STATE_IDLE:
        return (core->interlock.active >> FW_CONTACT_door & 1) != 0 ? FW_REFUSAL_ACTIVE : FW_REFUSAL_NONE;
    case FW_STATE_ALARM:
        return FW_REFUSAL_ALARMED;
    case FW_STATE_ESTOP:
        return FW_REFUSAL_STOPPED;
    default:
        return FW_REFUSAL_BUSY;
    }
}

void gonio_fw_core_refresh(struct fw_core *core) {
    struct fw_registers *r = &core->registers;
    r->state[0] = core->state;
    r->moving[0] = core->axis.up | core->axis.down;
    r->homed[0] = core->known;
    r->inputs[0] = core->interlock.active;
    r->owner[0] = r->heartbeat[0] = core->owner.number;
    gonio_fw_axis_positions(core, r->position);
    r->lamp_state[0] = core->lamp.state;
    r->lamp_output[0] = core->lamp.output;
    r->time[0] = core->time_us;
}

void gonio_fw_core_parameters_changed(struct fw_core *core) {
    gonio_fw_parameters_note(core);
    gonio_fw_axis_enable(core);
    gonio_fw_lamp_outputs(core);
    gonio_fw_board_inputs_pend(core);
}

static void stop(struct fw_core *core, bool at_once) {
    if (at_once)
        gonio_fw_axis_halt(core, true);
    else
        gonio_fw_axis_stop(core);
    gonio_fw_homing_abandon(core);
    core->axis.settling = false;
    if (core->state == FW_STATE_MOVING || core->state == FW_STATE_HOMING)
        core->state = FW_STATE_STOPPING;
}

static enum fw_refusal keep(struct fw_core *core, enum fw_command command) {
    if (!gonio_fw_core_at_rest(core))
        return FW_REFUSAL_BUSY;
    if (command == FW_COMMAND_SAVE) {
        // Erasing may take as long as the watchdog waits, and the processor may stand meanwhile.
        if (core->lamp.on || core->lamp.output != 0)
            return FW_REFUSAL_NOT_SAFE;
        gonio_fw_board_watchdog_feed(core);
        return gonio_fw_parameters_save(core) ? FW_REFUSAL_NONE : FW_REFUSAL_STORE;
    }
    if (command == FW_COMMAND_LOAD && !gonio_fw_parameters_load(core))
        return FW_REFUSAL_STORE;
    if (command == FW_COMMAND_DEFAULTS)
        gonio_fw_registers_initialise(core, true);
    gonio_fw_core_parameters_changed(core);
    return FW_REFUSAL_NONE;
}

static enum fw_refusal release(struct fw_core *core) {
    if (!gonio_fw_core_at_rest(core))
        return FW_REFUSAL_BUSY;
    if (core->registers.command_axes[0] == 0)
        return FW_REFUSAL_NO_AXIS;
    gonio_fw_axis_release(core, (uint8_t)core->registers.command_axes[0]);
    return FW_REFUSAL_NONE;
}

static enum fw_refusal restart(struct fw_core *core) {
    if (!gonio_fw_core_at_rest(core))
        return FW_REFUSAL_BUSY;
    gonio_fw_interlock_fault(core);
    gonio_fw_board_restart(core);
    return FW_REFUSAL_NONE;
}

static enum fw_refusal begin(struct fw_core *core, enum fw_command command) {
    const enum fw_refusal refusal = gonio_fw_core_ready(core);
    if (refusal != FW_REFUSAL_NONE)
        return refusal;
    switch (command) {
    case FW_COMMAND_MOVE:
        return gonio_fw_axis_move(core);
    case FW_COMMAND_HOME:
        return gonio_fw_homing_begin(core);
    case FW_COMMAND_JOG:
        return gonio_fw_axis_jog(core);
    default:
        gonio_fw_lamp_trigger(core);
        return FW_REFUSAL_NONE;
    }
}

static enum fw_refusal execute(struct fw_core *core, enum fw_command command) {
    switch (command) {
    case FW_COMMAND_CLEAR:
        return gonio_fw_interlock_clear(core);
    case FW_COMMAND_SAVE:
    case FW_COMMAND_LOAD:
    case FW_COMMAND_DEFAULTS:
        return keep(core, command);
    case FW_COMMAND_RELEASE:
        return release(core);
    case FW_COMMAND_RESTART:
        return restart(core);
    case FW_COMMAND_YIELD:
        return gonio_fw_owner_yield(core);
    default:
        return begin(core, command);
    }
}

enum fw_refusal gonio_fw_core_command(struct fw_core *core, uint16_t command) {
    const uint32_t id = core->registers.command_id[0];
    if (command < FW_COMMAND_MOVE || command > FW_COMMAND_JOG)
        return FW_REFUSAL_UNKNOWN;
    if (command == FW_COMMAND_STOP || command == FW_COMMAND_HALT) {
        stop(core, command == FW_COMMAND_HALT);
        return FW_REFUSAL_NONE;
    }
    if (id == 0)
        return FW_REFUSAL_NO_ID;
    if (id == core->registers.accepted_id[0])
        return FW_REFUSAL_NONE;
    const uint32_t before = core->registers.accepted_id[0];
    core->registers.accepted_id[0] = id;
    const enum fw_refusal refusal = execute(core, (enum fw_command)command);
    if (refusal != FW_REFUSAL_NONE)
        core->registers.accepted_id[0] = before;
    return refusal;
}

enum fw_refusal gonio_fw_core_self_test(struct fw_core *core, uint16_t key) {
    const uint16_t hang = 0xDEAD, fault = 0xFA17;
    if (key != hang && key != fault)
        return FW_REFUSAL_UNKNOWN;
    if (core->state != FW_STATE_IDLE || core->lamp.output != 0)
        return FW_REFUSAL_NOT_SAFE;
    if (key == hang)
        core->hang = true;
    else
        gonio_fw_board_fault(core);
    return FW_REFUSAL_NONE;
}

static void keep_time(struct fw_core *core) {
    const uint32_t now = gonio_fw_board_now(core), passed = now - core->last_tick;
    core->last_tick = now;
    core->time_us += passed;
    core->ms_remainder_us += passed;
    if (core->ms_remainder_us < 1000)
        return;
    core->ms += core->ms_remainder_us / 1000;
    core->ms_remainder_us %= 1000;
    if (gonio_fw_interlock_differs(
            core)) // a change too short to interrupt; else the step timer need not wait for nothing
        gonio_fw_board_inputs_pend(core);
    gonio_fw_lamp_poll(core);
}

// Whether the step timer still serves its events: the watchdog is fed only then.
static bool alive(const struct fw_core *core, uint32_t now) {
    const uint32_t grace = 10000;
    return !core->step.running || fw_before(now, core->step.due + grace);
}

void gonio_fw_core_poll(struct fw_core *core) {
    keep_time(core);
    gonio_fw_modbus_poll(core);
    gonio_fw_interlock_poll(core);
    const bool came_to_rest = gonio_fw_axis_poll(core);
    if (!gonio_fw_core_at_rest(core))
        core->modbus.listen_only = false;
    switch (core->state) {
    case FW_STATE_MOVING:
        gonio_fw_axis_continue(core, came_to_rest);
        break;
    case FW_STATE_HOMING:
        gonio_fw_homing_poll(core, came_to_rest);
        break;
    case FW_STATE_STOPPING:
        if (!core->axis.under_way)
            core->state = FW_STATE_IDLE;
        break;
    default:
        break;
    }
    if (!core->hang && alive(core, core->last_tick))
        gonio_fw_board_watchdog_feed(core);
}
