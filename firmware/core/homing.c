// SPDX-License-Identifier: BSD-3-Clause
#include "firmware/core/homing.h"

#include "firmware/core/core.h"

static void fail(struct fw_core *core, enum fw_alarm alarm) {
    gonio_fw_interlock_alarm(core, alarm, core->homing.axis, false);
}

static bool pressed(const struct fw_core *core) { return (core->interlock.active >> core->homing.axis & 1) != 0; }

// Begin a move of the axis in hand, `steps` towards the switch (negative: away).
static void go(struct fw_core *core, int64_t steps, uint32_t speed, enum fw_homing_phase phase) {
    const unsigned axis = core->homing.axis;
    int64_t way[FW_AXES] = {0};
    uint32_t speeds[FW_AXES] = {0};
    way[axis] = core->registers.home_up[axis] != 0 ? steps : -steps;
    speeds[axis] = speed;
    core->homing.phase = (uint8_t)phase;
    if (!gonio_fw_axis_begin(core, way, speeds)) // home_travel at home_fast would take days
        fail(core, FW_ALARM_HOME_MISSING);
}

static void approach(struct fw_core *core) {
    const unsigned axis = core->homing.axis;
    go(core, core->registers.home_travel[axis], core->registers.home_fast[axis], FW_HOMING_FAST);
}

static void finish_axis(struct fw_core *core) {
    const uint8_t bit = (uint8_t)(1u << core->homing.axis);
    core->known |= bit;
    core->homing.homed_before |= bit;
    core->homing.left &= (uint8_t)~bit;
    core->homing.phase = FW_HOMING_NONE;
}

static void set_position(struct fw_core *core) {
    const unsigned axis = core->homing.axis;
    const int64_t home = core->registers.home_position[axis], found = core->step.position[axis];
    const bool before = (core->homing.homed_before >> axis & 1) != 0;
    const int64_t off = found - home;
    core->registers.home_difference[axis] = !before            ? 0
                                            : off < -INT32_MAX ? -INT32_MAX
                                            : off > INT32_MAX  ? INT32_MAX
                                                               : (int32_t)off;
    core->step.position[axis] = home;
}

// Next axis by home_order, lower number first among equals; none left: done.
static void next_axis(struct fw_core *core) {
    struct fw_homing *homing = &core->homing;
    unsigned best = FW_AXES;
    for (unsigned i = 0; i < FW_AXES; i++)
        if ((homing->left >> i & 1) != 0 &&
            (best == FW_AXES || core->registers.home_order[i] < core->registers.home_order[best]))
            best = i;
    if (best == FW_AXES) {
        core->state = FW_STATE_IDLE;
        core->registers.finished_id[0] = core->registers.accepted_id[0];
        return;
    }
    homing->axis = (uint8_t)best;
    if (core->registers.home_order[best] == 0) {
        core->step.position[best] = core->registers.home_position[best];
        finish_axis(core);
    } else if (!pressed(core)) {
        approach(core);
    } else if (core->registers.home_pressed[0] != 0) {
        go(core, -(int64_t)core->registers.home_travel[best], core->registers.home_fast[best], FW_HOMING_RELEASE);
    } else {
        fail(core, FW_ALARM_HOME_PRESSED);
    }
}

enum fw_refusal gonio_fw_homing_begin(struct fw_core *core) {
    const uint8_t axes = (uint8_t)core->registers.command_axes[0];
    if (axes == 0)
        return FW_REFUSAL_NO_AXIS;
    core->known &= (uint16_t) ~(unsigned)axes;
    core->homing.left = axes;
    core->homing.phase = FW_HOMING_NONE;
    core->state = FW_STATE_HOMING;
    return FW_REFUSAL_NONE;
}

void gonio_fw_homing_abandon(struct fw_core *core) {
    core->homing.left = 0;
    core->homing.armed = 0;
    core->homing.phase = FW_HOMING_NONE;
}

static void back_off(struct fw_core *core) {
    const unsigned axis = core->homing.axis;
    const int64_t past = core->step.position[axis] - core->homing.seen;
    go(core, -((past < 0 ? -past : past) + (int64_t)core->registers.home_backoff[axis]),
       core->registers.home_fast[axis], FW_HOMING_BACK_OFF);
}

static void begin_hold(struct fw_core *core) {
    core->homing.phase = FW_HOMING_HOLD;
    core->homing.since = core->ms;
}

static void begin_slow(struct fw_core *core) {
    const unsigned axis = core->homing.axis;
    core->homing.edges = 0;
    core->homing.armed = (uint16_t)(1u << axis);
    // Twice the back-off: further away than that it cannot be.
    go(core, 2 * (int64_t)core->registers.home_backoff[axis], core->registers.home_slow[axis], FW_HOMING_SLOW);
}

static void end_hold(struct fw_core *core) {
    const unsigned axis = core->homing.axis;
    if (core->ms - core->homing.since < core->registers.debounce[0])
        return;
    core->homing.armed = 0;
    if (!pressed(core) || core->homing.edges > core->registers.bounce_max[0]) {
        fail(core, FW_ALARM_HOME_BOUNCE);
        return;
    }
    set_position(core);
    go(core, -(int64_t)core->registers.home_backoff[axis], core->registers.home_fast[axis], FW_HOMING_LEAVE);
}

// A movement of the sequence came to rest.
static void arrived(struct fw_core *core) {
    const unsigned axis = core->homing.axis;
    switch (core->homing.phase) {
    case FW_HOMING_RELEASE:
    case FW_HOMING_RELEASED:
        if (pressed(core))
            fail(core, FW_ALARM_HOME_PRESSED);
        else
            approach(core);
        break;
    case FW_HOMING_FAST:
        if (!pressed(core)) {
            fail(core, FW_ALARM_HOME_MISSING);
            break;
        }
        core->homing.seen = core->step.position[axis]; // met with the very last steps
        back_off(core);
        break;
    case FW_HOMING_OVERSHOOT:
        back_off(core);
        break;
    case FW_HOMING_BACK_OFF:
        if (pressed(core))
            fail(core, FW_ALARM_HOME_STUCK);
        else
            begin_slow(core);
        break;
    case FW_HOMING_SLOW:
        if (core->homing.edges > 0)
            begin_hold(core);
        else
            fail(core, FW_ALARM_HOME_MISSING);
        break;
    case FW_HOMING_LEAVE:
        if (pressed(core))
            fail(core, FW_ALARM_HOME_STUCK);
        else
            finish_axis(core);
        break;
    default:
        break;
    }
}

void gonio_fw_homing_poll(struct fw_core *core, bool came_to_rest) {
    if (came_to_rest) {
        arrived(core);
        return;
    }
    switch (core->homing.phase) {
    case FW_HOMING_NONE:
        next_axis(core);
        break;
    case FW_HOMING_RELEASE:
        if (!pressed(core)) {
            core->homing.phase = FW_HOMING_RELEASED;
            gonio_fw_axis_stop(core);
        }
        break;
    case FW_HOMING_FAST:
        if (pressed(core)) {
            int64_t position[FW_AXES];
            gonio_fw_axis_positions(core, position);
            core->homing.seen = position[core->homing.axis];
            core->homing.phase = FW_HOMING_OVERSHOOT;
            gonio_fw_axis_stop(core);
        }
        break;
    case FW_HOMING_HOLD:
        end_hold(core);
        break;
    default:
        break;
    }
}
