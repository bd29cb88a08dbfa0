// SPDX-License-Identifier: BSD-3-Clause
#include "firmware/core/axis.h"

#include "firmware/contract/pin.h"
#include "firmware/contract/tick.h"
#include "firmware/core/core.h"

static uint64_t magnitude(int64_t x) { return x < 0 ? 0 - (uint64_t)x : (uint64_t)x; }

static double least(double a, double b) { return a < b ? a : b; }

// The limits of the common ramp: each axis' own, divided by its way; and the step interrupt's, by the sum of the ways.
static struct fw_ramp_limits limits_of(const struct fw_core *core, const uint32_t distance[FW_AXES],
                                       const uint32_t speed[FW_AXES]) {
    struct fw_ramp_limits limits = {1.0e9, 1.0e9, 0.0};
    double sum = 0.0;
    for (unsigned i = 0; i < FW_AXES; i++) {
        if (distance[i] == 0)
            continue;
        const double d = distance[i], jerk = core->registers.jerk[i];
        const uint32_t v = speed[i] < core->registers.speed_max[i] ? speed[i] : core->registers.speed_max[i];
        limits.speed = least(limits.speed, v / d);
        limits.acceleration = least(limits.acceleration, core->registers.acceleration[i] / d);
        if (jerk > 0.0)
            limits.jerk = limits.jerk > 0.0 ? least(limits.jerk, jerk / d) : jerk / d;
        sum += d;
    }
    limits.speed = least(limits.speed, core->registers.step_rate_max[0] / sum);
    return limits;
}

void gonio_fw_axis_enable(struct fw_core *core) {
    const unsigned motors = core->axis.energised | core->axis.gripping;
    const unsigned brakes = core->axis.opened ^ core->registers.brakes_invert[0];
    gonio_fw_board_motors(core, (uint8_t)((motors ^ core->registers.motors_invert[0]) | brakes << FW_AXES));
}

// Motors on; their brakes open when they hold. Whether the move has to wait for either.
static bool energise(struct fw_core *core, uint8_t axes) {
    struct fw_axis *axis = &core->axis;
    const bool off = (axes & ~(unsigned)axis->energised) != 0,
               closed = (axes & core->registers.brakes[0] & ~(unsigned)axis->opened) != 0;
    axis->energised |= axes;
    axis->gripping &= (uint8_t)~axes;
    axis->starting_ms[0] = off ? core->registers.energise[0] : 0;
    axis->starting_ms[1] = closed ? core->registers.brake_delay[0] : 0;
    axis->starting_since = gonio_fw_board_now(core);
    gonio_fw_axis_enable(core);
    return off || closed;
}

// The move that was begun leaves: its motors hold, its brakes are open.
static void start(struct fw_core *core) {
    const uint32_t lead = 200; // ticks: directions must stand before the first step, and the timer be armed
    struct fw_axis *axis = &core->axis;
    axis->starting = false;
    gonio_fw_board_lock(core);
    gonio_fw_stepgen_prepare(&core->step, &axis->ramp[axis->current], axis->distance, axis->down,
                             (uint8_t)core->registers.pulse[0]);
    gonio_fw_stepgen_start(&core->step, gonio_fw_board_now(core) + lead);
    gonio_fw_board_step_arm(core);
    gonio_fw_board_unlock(core);
    if (core->interlock.estop) // pressed, and perhaps let go, since the command was checked
        gonio_fw_axis_halt(core, true);
    gonio_fw_board_inputs_pend(core); // a limit switch may be active already
}

static bool over(struct fw_core *core, uint32_t since, uint32_t ms) {
    return gonio_fw_board_now(core) - since >= ms * 1000;
}

// Motors whose brakes have had their time. An emergency stop may add one at any moment, and the time begins again.
static void poll_gripping(struct fw_core *core) {
    struct fw_axis *axis = &core->axis;
    if (!axis->gripping_timed) {
        axis->gripping_timed = true;
        axis->gripping_since = gonio_fw_board_now(core);
        return;
    }
    if (!over(core, axis->gripping_since, core->registers.brake_delay[0]))
        return;
    gonio_fw_board_lock(core);
    if (axis->gripping_timed) {
        axis->gripping = 0;
        gonio_fw_axis_enable(core);
    }
    gonio_fw_board_unlock(core);
}

static void poll_motors(struct fw_core *core) {
    struct fw_axis *axis = &core->axis;
    if (axis->gripping != 0)
        poll_gripping(core);
    if (!axis->starting || !over(core, axis->starting_since, axis->starting_ms[0]))
        return;
    const uint8_t open = (uint8_t)((axis->up | axis->down) & core->registers.brakes[0]);
    if ((open & ~(unsigned)axis->opened) != 0) {
        axis->opened |= open;
        axis->starting_since = gonio_fw_board_now(core);
        axis->starting_ms[0] = axis->starting_ms[1];
        gonio_fw_axis_enable(core);
        return;
    }
    start(core);
}

bool gonio_fw_axis_begin(struct fw_core *core, const int64_t way[FW_AXES], const uint32_t speed[FW_AXES]) {
    uint32_t *distance = core->axis.distance;
    uint8_t up = 0, down = 0;
    for (unsigned i = 0; i < FW_AXES; i++) {
        distance[i] = (uint32_t)magnitude(way[i]);
        if (way[i] > 0)
            up |= (uint8_t)(1u << i);
        else if (way[i] < 0)
            down |= (uint8_t)(1u << i);
    }
    struct fw_ramp *ramp = &core->axis.ramp[core->axis.current];
    if ((up | down) != 0) {
        const struct fw_ramp_limits limits = limits_of(core, distance, speed);
        if (!gonio_fw_ramp_plan(ramp, &limits))
            return false;
    }
    core->axis.under_way = true;
    if ((up | down) == 0)
        return true; // comes to rest with the next poll
    gonio_fw_board_directions(core, (uint8_t)(up ^ core->registers.direction_invert[0]));
    core->axis.up = up;
    core->axis.down = down;
    core->axis.starting = true;
    if (core->interlock.estop) // the motors stay as they are
        gonio_fw_axis_halt(core, true);
    else if (!energise(core, up | down))
        start(core);
    return true;
}

static bool onto_limit(const struct fw_core *core, unsigned axis, int64_t way) {
    const unsigned active = core->interlock.active;
    if (way > 0)
        return (active >> (FW_CONTACT_limit_max_0 + axis) & 1) != 0;
    return way < 0 && (active >> (FW_CONTACT_limit_min_0 + axis) & 1) != 0;
}

// The leg before the final approach ends here; the target itself where there is no overshoot.
static int64_t approach_point(const struct fw_core *core, unsigned axis, int64_t from, int64_t target) {
    const int64_t backlash = core->registers.backlash[axis];
    if ((backlash > 0 && target < from) || (backlash < 0 && target > from))
        return target - backlash;
    return target;
}

double gonio_fw_axis_seconds(const struct fw_core *core, const int64_t from[FW_AXES], const int64_t target[FW_AXES]) {
    double seconds = 0.0;
    uint32_t approach[FW_AXES], rest[FW_AXES];
    uint32_t moved = 0, left = 0;
    for (unsigned i = 0; i < FW_AXES; i++) {
        const int64_t over = approach_point(core, i, from[i], target[i]);
        moved |= approach[i] = (uint32_t)magnitude(over - from[i]);
        left |= rest[i] = (uint32_t)magnitude(target[i] - over);
    }
    if (moved != 0) {
        const struct fw_ramp_limits limits = limits_of(core, approach, core->registers.speed_max);
        seconds = gonio_fw_ramp_least_seconds(&limits);
    }
    if (left != 0) {
        const struct fw_ramp_limits limits = limits_of(core, rest, core->registers.speed_max);
        seconds += gonio_fw_ramp_least_seconds(&limits);
    }
    return seconds;
}

static enum fw_refusal check(const struct fw_core *core, unsigned axis, int64_t from) {
    const int64_t target = core->registers.target[axis], low = core->registers.soft_min[axis],
                  high = core->registers.soft_max[axis];
    if ((core->known >> axis & 1) == 0)
        return FW_REFUSAL_NOT_HOMED;
    if (target < low || target > high)
        return FW_REFUSAL_SOFT_LIMIT;
    const int64_t over = approach_point(core, axis, from, target);
    if (over < low || over > high)
        return FW_REFUSAL_SOFT_LIMIT;
    // Unsigned: the way between any two 64-bit positions fits.
    const uint64_t way = over > from ? (uint64_t)over - (uint64_t)from : (uint64_t)from - (uint64_t)over;
    if (way >= 0x80000000u)
        return FW_REFUSAL_TOO_FAR;
    return onto_limit(core, axis, over - from) ? FW_REFUSAL_HARD_LIMIT : FW_REFUSAL_NONE;
}

// Start the next leg of the standing MOVE; false: it would take too long.
static bool begin_leg(struct fw_core *core, bool final) {
    int64_t position[FW_AXES], way[FW_AXES] = {0};
    uint32_t speed[FW_AXES];
    gonio_fw_axis_positions(core, position);
    bool overshoots = false;
    for (unsigned i = 0; i < FW_AXES; i++) {
        speed[i] = (uint32_t)(((uint64_t)core->registers.speed_max[i] * core->axis.permille + 999) / 1000);
        if ((core->axis.axes >> i & 1) == 0)
            continue;
        const int64_t target = core->axis.target[i];
        const int64_t to = final ? target : approach_point(core, i, position[i], target);
        overshoots = overshoots || to != target;
        way[i] = to - position[i];
    }
    core->axis.final_leg = final || !overshoots;
    return gonio_fw_axis_begin(core, way, speed);
}

enum fw_refusal gonio_fw_axis_move(struct fw_core *core) {
    int64_t position[FW_AXES];
    gonio_fw_axis_positions(core, position);
    const unsigned axes = core->registers.command_axes[0];
    if (axes == 0)
        return FW_REFUSAL_NO_AXIS;
    for (unsigned i = 0; i < FW_AXES; i++) {
        const enum fw_refusal refusal = (axes >> i & 1) != 0 ? check(core, i, position[i]) : FW_REFUSAL_NONE;
        if (refusal != FW_REFUSAL_NONE)
            return refusal;
    }
    for (unsigned i = 0; i < FW_AXES; i++)
        core->axis.target[i] = core->registers.target[i];
    core->axis.axes = (uint16_t)axes;
    core->axis.permille = core->registers.command_speed[0];
    core->axis.settling = false;
    if (!begin_leg(core, false))
        return FW_REFUSAL_TOO_FAR;
    core->state = FW_STATE_MOVING;
    return FW_REFUSAL_NONE;
}

enum fw_refusal gonio_fw_axis_jog(struct fw_core *core) {
    const unsigned axes = core->registers.command_axes[0];
    if (axes == 0 || (axes & (axes - 1)) != 0)
        return FW_REFUSAL_NO_AXIS;
    const unsigned axis = (unsigned)__builtin_ctz(axes);
    const int64_t way = core->registers.target[axis];
    const uint32_t slow = core->registers.home_slow[axis];
    if (magnitude(way) > (uint64_t)FW_JOG_SECONDS * slow)
        return FW_REFUSAL_TOO_FAR;
    if (onto_limit(core, axis, way))
        return FW_REFUSAL_HARD_LIMIT;
    int64_t ways[FW_AXES] = {0};
    uint32_t speeds[FW_AXES] = {0};
    gonio_fw_axis_positions(core, ways);
    const int64_t to = ways[axis] + way;
    if ((core->known >> axis & 1) != 0 && (to < core->registers.soft_min[axis] || to > core->registers.soft_max[axis]))
        return FW_REFUSAL_SOFT_LIMIT;
    for (unsigned i = 0; i < FW_AXES; i++)
        ways[i] = i == axis ? way : 0;
    speeds[axis] = slow;
    if (!gonio_fw_axis_begin(core, ways, speeds))
        return FW_REFUSAL_TOO_FAR;
    core->axis.settling = false;
    core->axis.final_leg = true; // it takes up no backlash
    core->state = FW_STATE_MOVING;
    return FW_REFUSAL_NONE;
}

void gonio_fw_axis_continue(struct fw_core *core, bool came_to_rest) {
    if (came_to_rest) {
        if (!core->axis.final_leg) {
            begin_leg(core, true); // no further than the leg before: it cannot take too long
            return;
        }
        core->axis.settling = true;
        core->axis.at_rest_since = core->ms;
    }
    if (!core->axis.settling || core->ms - core->axis.at_rest_since < core->registers.settle[0])
        return;
    core->axis.settling = false;
    core->state = FW_STATE_IDLE;
    core->registers.finished_id[0] = core->registers.accepted_id[0];
    if (core->registers.trigger_auto[0] != 0)
        gonio_fw_lamp_trigger(core);
}

void gonio_fw_axis_stop(struct fw_core *core) {
    struct fw_axis *axis = &core->axis;
    struct fw_stepgen *g = &core->step;
    axis->starting = false;
    if (!g->running)
        return;
    struct fw_ramp *spare = &axis->ramp[axis->current ^ 1];
    // Planning takes a while, in which the producer goes on: aim some segments ahead, further if that was too few.
    for (uint32_t ahead = 4;; ahead *= 2) {
        const uint32_t cut = (g->time + ahead) & ~1u;
        gonio_fw_ramp_cut(spare, &axis->ramp[axis->current], cut);
        gonio_fw_board_lock(core);
        const bool in_time = g->time <= cut;
        if (in_time)
            g->ramp = spare;
        gonio_fw_board_unlock(core);
        if (in_time)
            break;
    }
    axis->current ^= 1;
}

void gonio_fw_axis_halt(struct fw_core *core, bool lost) {
    core->axis.starting = false; // where it waits, nothing has moved yet
    if (!core->step.running)
        return;
    core->step.running = false;
    gonio_fw_board_halt_steps(core);
    core->axis.lost = core->axis.lost || lost;
    core->axis.halted = true;
}

bool gonio_fw_axis_poll(struct fw_core *core) {
    struct fw_axis *axis = &core->axis;
    poll_motors(core);
    if (!axis->under_way || axis->starting || core->step.running)
        return false;
    if (core->step.underrun) {
        core->step.underrun = false;
        axis->halted = axis->lost = true;
        gonio_fw_interlock_alarm(core, FW_ALARM_UNDERRUN, FW_NO_AXIS, true);
    }
    gonio_fw_board_lock(core);
    if (axis->halted) {
        gonio_fw_board_halt_steps(core); // the step interrupt may have been in the middle of it
        gonio_fw_stepgen_abort(&core->step);
        if (axis->lost)
            core->known &= (uint16_t) ~(unsigned)(axis->up | axis->down);
    }
    gonio_fw_stepgen_book(&core->step);
    gonio_fw_board_unlock(core);
    axis->halted = axis->lost = false;
    axis->up = axis->down = 0;
    axis->under_way = false;
    return true;
}

void gonio_fw_axis_positions(struct fw_core *core, int64_t position[FW_AXES]) {
    gonio_fw_board_lock(core);
    for (unsigned i = 0; i < FW_AXES; i++)
        position[i] = core->step.position[i];
    gonio_fw_board_unlock(core);
}

void gonio_fw_axis_release(struct fw_core *core, uint8_t axes) {
    struct fw_axis *axis = &core->axis;
    const uint8_t grip = (uint8_t)(axes & axis->energised & axis->opened);
    if (grip != 0) {
        axis->gripping |= grip;
        axis->gripping_timed = false;
    }
    axis->energised &= (uint8_t)~axes;
    axis->opened &= (uint8_t)~axes;
    core->known &= (uint16_t) ~(unsigned)axes;
    gonio_fw_axis_enable(core);
}
