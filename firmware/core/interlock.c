// SPDX-License-Identifier: BSD-3-Clause
#include "firmware/core/interlock.h"

#include "firmware/contract/adc.h"
#include "firmware/contract/pin.h"
#include "firmware/core/core.h"

static bool active(const struct fw_core *core, enum fw_contact contact) {
    return (core->interlock.active >> contact & 1) != 0;
}

void gonio_fw_interlock_safe(struct fw_core *core) {
    gonio_fw_lamp_safe(core);
    gonio_fw_axis_release(core, (uint8_t)(core->axis.energised & ~(unsigned)core->registers.safe_motors[0]));
}

static uint16_t active_of(const struct fw_core *core, uint16_t raw) {
    return (uint16_t)((raw ^ core->registers.input_invert[0]) & core->registers.input_enable[0]);
}

bool gonio_fw_interlock_differs(struct fw_core *core) {
    return active_of(core, gonio_fw_board_inputs(core)) != core->interlock.active;
}

void gonio_fw_interlock_input(struct fw_core *core, uint16_t raw) {
    struct fw_interlock *interlock = &core->interlock;
    const uint16_t now = active_of(core, raw);
    const uint16_t changed = now ^ interlock->active;
    interlock->active = now;
    if ((now >> FW_CONTACT_estop & 1) != 0) {
        gonio_fw_axis_halt(core, true);
        interlock->dark = true;
        if (!interlock->estop)
            gonio_fw_interlock_safe(core);
        interlock->estop = true;
    }
    const unsigned onto =
        now & ((unsigned)core->axis.down << FW_CONTACT_limit_min_0 | (unsigned)core->axis.up << FW_CONTACT_limit_max_0);
    if (onto != 0) {
        gonio_fw_axis_halt(core, true);
        interlock->limit = (uint16_t)(interlock->limit | onto);
    }
    if ((changed & core->homing.armed) != 0) {
        core->homing.edges++;
        if ((now & core->homing.armed) != 0)
            gonio_fw_axis_halt(core, false);
    }
}

void gonio_fw_interlock_alarm(struct fw_core *core, enum fw_alarm alarm, unsigned axis, bool halt) {
    if (halt)
        gonio_fw_axis_halt(core, true);
    else
        gonio_fw_axis_stop(core);
    gonio_fw_homing_abandon(core);
    if (alarm == FW_ALARM_OVERHEAT || alarm == FW_ALARM_SENSOR)
        core->interlock.hot = true;
    if (alarm == FW_ALARM_EMERGENCY || alarm == FW_ALARM_OVERHEAT || alarm == FW_ALARM_SENSOR)
        core->interlock.dark = true;
    gonio_fw_lamp_safe(core); // the motors follow when they stand
    core->axis.settling = false;
    if (core->state != FW_STATE_ALARM && core->state != FW_STATE_ESTOP) {
        core->registers.alarm[0] = (uint16_t)alarm;
        core->registers.alarm_axis[0] = (uint16_t)axis;
        core->state = FW_STATE_ALARM;
    }
    if (alarm == FW_ALARM_EMERGENCY)
        core->state = FW_STATE_ESTOP;
}

static void poll_limits(struct fw_core *core) {
    const unsigned limit = core->interlock.limit;
    if (limit == 0)
        return;
    core->interlock.limit = 0;
    const unsigned bit = (unsigned)__builtin_ctz(limit);
    const bool low = bit < FW_CONTACT_limit_max_0;
    gonio_fw_interlock_alarm(core, low ? FW_ALARM_LIMIT_MIN : FW_ALARM_LIMIT_MAX,
                             bit - (low ? FW_CONTACT_limit_min_0 : FW_CONTACT_limit_max_0), true);
}

static void poll_lamp_temperature(struct fw_core *core) {
    if (core->lamp.output == 0)
        return;
    const int32_t temperature = core->registers.temperature[0];
    if (temperature == FW_NO_TEMPERATURE)
        gonio_fw_interlock_alarm(core, FW_ALARM_SENSOR, FW_NO_AXIS, false);
    else if (temperature > core->registers.temperature_max[0])
        gonio_fw_interlock_alarm(core, FW_ALARM_OVERHEAT, FW_NO_AXIS, false);
}

void gonio_fw_interlock_poll(struct fw_core *core) {
    if (core->interlock.estop) {
        gonio_fw_interlock_alarm(core, FW_ALARM_EMERGENCY, FW_NO_AXIS, true);
        gonio_fw_interlock_safe(core); // again: the interrupt may have come in the middle of switching something on
        core->interlock.estop = active(core, FW_CONTACT_estop);
    }
    poll_limits(core);
    gonio_fw_owner_poll(core);
    poll_lamp_temperature(core); // in an alarm as well: safe_lamp may keep it burning
    if (core->state == FW_STATE_ALARM || core->state == FW_STATE_ESTOP) {
        if (!core->axis.under_way && (core->axis.energised & ~(unsigned)core->registers.safe_motors[0]) != 0)
            gonio_fw_interlock_safe(core);
        return;
    }
    const bool exposed = core->state != FW_STATE_IDLE || core->lamp.on || core->lamp.open;
    if (active(core, FW_CONTACT_door) && exposed)
        gonio_fw_interlock_alarm(core, FW_ALARM_DOOR, FW_NO_AXIS, false);
}

// Whether what raised the alarm, or made the lamp go out, is still so.
static bool persists(const struct fw_core *core) {
    const int32_t temperature = core->registers.temperature[0];
    if (core->registers.alarm[0] == FW_ALARM_DOOR && active(core, FW_CONTACT_door))
        return true;
    return core->interlock.hot &&
           (temperature == FW_NO_TEMPERATURE || temperature > core->registers.temperature_max[0]);
}

enum fw_refusal gonio_fw_interlock_clear(struct fw_core *core) {
    if (core->state == FW_STATE_IDLE)
        return FW_REFUSAL_NONE;
    if (!gonio_fw_core_at_rest(core))
        return FW_REFUSAL_BUSY;
    if (active(core, FW_CONTACT_estop) || core->interlock.estop || persists(core))
        return FW_REFUSAL_ACTIVE;
    core->state = FW_STATE_IDLE;
    core->interlock.dark = false;
    core->interlock.hot = false;
    core->registers.alarm[0] = FW_ALARM_NONE;
    core->registers.alarm_axis[0] = FW_NO_AXIS;
    return FW_REFUSAL_NONE;
}

void gonio_fw_interlock_fault(struct fw_core *core) {
    gonio_fw_board_halt_steps(core);
    gonio_fw_lamp_dark(core);
    // A wrong bit here would only let a motor hold that stands, or a brake be open.
    gonio_fw_board_motors(
        core, (uint8_t)((core->registers.motors_invert[0] & 15) | (core->registers.brakes_invert[0] & 15) << FW_AXES));
}
