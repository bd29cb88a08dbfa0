// SPDX-License-Identifier: BSD-3-Clause
#include "firmware/board/posix/machine.h"

#include <stddef.h>
#include <string.h>

#include "firmware/contract/adc.h"
#include "firmware/contract/pin.h"
#include "firmware/contract/tick.h"
#include "firmware/contract/uart.h"
#include "firmware/contract/watchdog.h"

enum { POLL_US = 100, IDLE_POLL_US = 1000, BOUNCE_PERIOD_US = 200 };

static struct machine *machine_of(struct fw_core *core) { return (struct machine *)core; }

// ---- switches ----

static bool home_level(struct machine *m, unsigned i) {
    struct machine_axis *axis = &m->axis[i];
    const bool truly = axis->home_up ? axis->steps >= axis->home_at : axis->steps <= axis->home_at;
    if (truly != axis->home_before) {
        axis->home_before = truly;
        axis->home_changed_us = m->now_us;
        if (truly && axis->home_switch == MACHINE_SWITCH_STUCK)
            axis->home_switch = MACHINE_SWITCH_PRESSED;
    }
    switch (axis->home_switch) {
    case MACHINE_SWITCH_MISSING:
        return false;
    case MACHINE_SWITCH_PRESSED:
        return true;
    case MACHINE_SWITCH_BOUNCING: {
        const uint64_t since = m->now_us - axis->home_changed_us;
        return since < axis->bounce_us ? truly != (since / BOUNCE_PERIOD_US % 2 != 0) : truly;
    }
    default:
        return truly;
    }
}

uint16_t gonio_fw_board_inputs(struct fw_core *core) {
    struct machine *m = machine_of(core);
    unsigned active = 0;
    for (unsigned i = 0; i < FW_AXES; i++) {
        const struct machine_axis *axis = &m->axis[i];
        active |= (unsigned)home_level(m, i) << (FW_CONTACT_home_0 + i);
        active |= (unsigned)(axis->steps <= axis->limit_min_at) << (FW_CONTACT_limit_min_0 + i);
        active |= (unsigned)(axis->steps >= axis->limit_max_at) << (FW_CONTACT_limit_max_0 + i);
    }
    active = (active | m->forced_on) & ~(unsigned)m->forced_off;
    return (uint16_t)(active ^ core->registers.input_invert[0]);
}

static void inputs_interrupt(struct machine *m) {
    m->inputs_pending = false;
    gonio_fw_interlock_input(&m->core, gonio_fw_board_inputs(&m->core));
}

static void interrupt_on_change(struct machine *m) {
    if (gonio_fw_interlock_differs(&m->core))
        inputs_interrupt(m);
}

void gonio_fw_board_inputs_pend(struct fw_core *core) { machine_of(core)->inputs_pending = true; }

void gonio_machine_hold(struct machine *m, enum fw_contact contact, bool active) {
    gonio_machine_release(m, contact);
    if (active)
        m->forced_on = (uint16_t)(m->forced_on | 1u << contact);
    else
        m->forced_off = (uint16_t)(m->forced_off | 1u << contact);
    inputs_interrupt(m);
}

void gonio_machine_release(struct machine *m, enum fw_contact contact) {
    m->forced_on &= (uint16_t) ~(1u << contact);
    m->forced_off &= (uint16_t) ~(1u << contact);
    inputs_interrupt(m);
}

// ---- outputs ----

void gonio_fw_board_halt_steps(struct fw_core *core) {
    machine_of(core)->armed = false;
    machine_of(core)->pins = 0;
}
void gonio_fw_board_directions(struct fw_core *core, uint8_t levels) { machine_of(core)->directions = levels; }
void gonio_fw_board_motors(struct fw_core *core, uint8_t axes) { machine_of(core)->motors = axes; }
void gonio_fw_board_shutter(struct fw_core *core, bool open) { machine_of(core)->shutter = open; }
void gonio_fw_board_lamp(struct fw_core *core, uint16_t level) { machine_of(core)->lamp = level; }
void gonio_fw_board_trigger(struct fw_core *core, bool high) { machine_of(core)->trigger = high; }

static bool beside(int64_t a, int64_t b) { return a - b <= 1 && b - a <= 1; }

// One step of a motor; whether a switch may have changed with it. Most steps are far from any.
static bool step(struct machine_axis *axis, int way) {
    axis->steps += way;
    if (axis->arm < axis->steps)
        axis->arm = axis->steps;
    else if (axis->arm > axis->steps + axis->play)
        axis->arm = axis->steps + axis->play;
    return axis->home_switch == MACHINE_SWITCH_BOUNCING || beside(axis->steps, axis->home_at) ||
           beside(axis->steps, axis->limit_min_at) || beside(axis->steps, axis->limit_max_at);
}

static void put_edges(struct machine *m, uint8_t edges) {
    const unsigned up = edges & 0x0Fu;
    m->pins = (uint8_t)((m->pins | up) & ~(edges >> 4u));
    if (m->on_edges != NULL)
        m->on_edges(m->context, m->now_us, edges, m->directions);
    if (up == 0)
        return;
    const unsigned upward = m->directions ^ m->reversed;
    bool near = false;
    for (unsigned i = 0; i < FW_AXES; i++) {
        if ((up >> i & 1) == 0)
            continue;
        m->rising_edges++;
        if (((m->motors ^ m->enable_low) >> i & 1) == 0)
            m->wrong_edges++;
        else
            near |= step(&m->axis[i], (upward >> i & 1) != 0 ? 1 : -1);
    }
    if (near)
        interrupt_on_change(m);
}

// ---- time ----

uint32_t gonio_fw_board_now(struct fw_core *core) { return (uint32_t)machine_of(core)->now_us; }
void gonio_fw_board_step_arm(struct fw_core *core) { machine_of(core)->armed = true; }
void gonio_fw_board_lock(struct fw_core *core) { (void)core; }
void gonio_fw_board_unlock(struct fw_core *core) { (void)core; }

static void step_interrupt(struct machine *m) {
    struct fw_stepgen *g = &m->core.step;
    do {
        put_edges(m, g->edges);
        if (!g->running) { // one of these edges closed a switch
            fw_stepgen_next(g);
            g->running = false;
            return;
        }
        switch (fw_stepgen_next(g)) {
        case FW_STEP_END:
            m->armed = false;
            return;
        case FW_STEP_PRODUCE:
            m->produce_pending = true;
            break;
        default:
            break;
        }
    } while (g->due == (uint32_t)m->now_us);
}

// ---- line ----

void gonio_fw_board_uart_setup(struct fw_core *core, uint32_t baud) {
    (void)core;
    (void)baud;
}
bool gonio_fw_board_uart_send(struct fw_core *core, uint8_t byte) {
    struct machine *m = machine_of(core);
    if (m->sent_length == MACHINE_SENT_MAX || m->now_us < m->line_free_us || m->echo_pending)
        return false;
    m->sent[m->sent_length++] = byte;
    m->line_free_us = m->now_us + (m->echo ? core->modbus.character : 0);
    m->echo_pending = m->echo;
    m->echo_byte = byte;
    return true;
}
bool gonio_fw_board_uart_sent(struct fw_core *core) {
    return machine_of(core)->now_us >= machine_of(core)->line_free_us;
}

static void echo(struct machine *m) {
    const uint64_t at_us = m->line_free_us + m->echo_us;
    if (!m->echo_pending || m->now_us < at_us)
        return;
    m->echo_pending = false;
    gonio_fw_modbus_receive(&m->core, m->echo_byte, (uint32_t)at_us);
}
void gonio_fw_board_uart_drive(struct fw_core *core, bool on) { machine_of(core)->driving = on; }

void gonio_machine_receive(struct machine *m, const uint8_t *bytes, unsigned length) {
    m->sent_length = 0;
    for (unsigned i = 0; i < length; i++) {
        gonio_machine_run(m, m->core.modbus.character);
        gonio_fw_modbus_receive(&m->core, bytes[i], (uint32_t)m->now_us);
    }
    gonio_machine_run(m, m->core.modbus.silence + 2 * IDLE_POLL_US);
}

// ---- watchdog and starts ----

void gonio_fw_board_watchdog_start(struct fw_core *core, uint32_t ms) {
    machine_of(core)->watchdog_ms = ms;
    gonio_fw_board_watchdog_feed(core);
}
void gonio_fw_board_watchdog_feed(struct fw_core *core) { machine_of(core)->fed_us = machine_of(core)->now_us; }
void gonio_fw_board_restart(struct fw_core *core) { machine_of(core)->restart = true; }
void gonio_fw_board_fault(struct fw_core *core) {
    gonio_fw_interlock_fault(core);
    machine_of(core)->fault = true;
}

// ---- analogue ----

uint16_t gonio_fw_board_photodiode(struct fw_core *core) {
    const struct machine *m = machine_of(core);
    return (uint16_t)(m->lamp * 6u + 100u); // some dark current
}
int32_t gonio_fw_board_temperature(struct fw_core *core) { return machine_of(core)->temperature; }

// ---- flash: bits only fall; power may fail in the middle of an operation ----

// 0: the operation fails half way; > 0: it works.
static bool powered(struct machine *m, bool *half) {
    *half = false;
    if (m->flash_operations_left < 0)
        return true;
    *half = m->flash_operations_left == 1;
    if (m->flash_operations_left > 0)
        m->flash_operations_left--;
    return m->flash_operations_left > 0;
}

const uint32_t *gonio_fw_board_store_page(struct fw_core *core, unsigned slot) { return machine_of(core)->flash[slot]; }

bool gonio_fw_board_store_erase(struct fw_core *core, unsigned slot) {
    struct machine *m = machine_of(core);
    bool half;
    const bool whole = powered(m, &half);
    // A half-done erase leaves some words blank and some bits of others risen.
    for (unsigned i = 0; i < FW_STORE_WORDS && (whole || half); i++)
        m->flash[slot][i] |= whole || i % 3 == 0 ? 0xFFFFFFFFu : 0x9E3779B9u * (i + 1);
    return whole;
}

bool gonio_fw_board_store_program(struct fw_core *core, unsigned slot, unsigned index, uint32_t word) {
    struct machine *m = machine_of(core);
    bool half;
    const bool whole = powered(m, &half);
    if (whole || half)
        m->flash[slot][index] &= half ? word | 0xA5A5A5A5u : word;
    return whole;
}

// ---- running it ----

void gonio_machine_new(struct machine *m) {
    memset(m, 0, sizeof *m);
    memset(m->flash, 0xFF, sizeof m->flash);
    m->temperature = 25000;
    m->flash_operations_left = -1;
    for (unsigned i = 0; i < FW_AXES; i++) {
        m->axis[i].steps = m->axis[i].arm = 1000 * ((int64_t)i + 1);
        m->axis[i].home_at = -37000;
        m->axis[i].limit_min_at = -40000;
        m->axis[i].limit_max_at = 40000;
        m->axis[i].home_changed_us = 0 - (1ull << 40); // long ago
    }
}

void gonio_machine_start(struct machine *m, enum fw_cause cause) {
    memset(&m->core, 0, sizeof m->core);
    m->bitten = m->restart = m->fault = false;
    m->armed = m->produce_pending = false;
    m->poll_us = m->now_us;
    gonio_fw_core_init(&m->core, MACHINE_BOARD, cause);
    inputs_interrupt(m);
}

// Steps from a limit switch to what must be reached without it: more than stopping from full speed takes, v^2/a without
// bounded jerk and 2 v sqrt(v/j) where the jerk bounds it.
static int64_t margin_of(const struct fw_registers *r, unsigned i) {
    const int64_t speed = r->speed_max[i], jerk = r->jerk[i], straight = speed * speed / r->acceleration[i];
    int64_t smooth = jerk > 0 ? 1 : 0;
    while (jerk > 0 && smooth * smooth < 4 * speed * speed / jerk * speed)
        smooth *= 2;
    return 1000 + (straight > smooth ? straight : smooth);
}

static int64_t within(int64_t steps) { // so that nothing overflows
    const int64_t far = 1ll << 60;
    return steps < -far ? -far : steps > far ? far : steps;
}

void gonio_machine_place(struct machine *m) {
    const struct fw_registers *r = &m->core.registers;
    for (unsigned i = 0; i < FW_AXES; i++) {
        struct machine_axis *axis = &m->axis[i];
        const bool up = r->home_up[i] != 0;
        const int64_t home = within(r->home_position[i]), low = within(r->soft_min[i]), high = within(r->soft_max[i]),
                      margin = margin_of(r, i), inside = up ? home - axis->steps : axis->steps - home;
        if ((m->core.known >> i & 1) == 0 && (inside <= 0 || inside >= r->home_travel[i])) {
            const int64_t off = r->home_travel[i] / 2 < 1000 ? r->home_travel[i] / 2 : 1000;
            axis->steps = axis->arm = up ? home - off : home + off;
        }
        axis->home_at = home;
        axis->home_up = up;
        axis->limit_min_at = (home < low ? home : low) - margin;
        axis->limit_max_at = (home > high ? home : high) + margin;
    }
    inputs_interrupt(m);
}

static bool wants_start(const struct machine *m) { return m->bitten || m->restart || m->fault; }

static void run_pending(struct machine *m) {
    if (m->inputs_pending)
        inputs_interrupt(m);
    if (m->produce_pending) {
        m->produce_pending = false;
        gonio_fw_stepgen_produce(&m->core.step);
    }
}

static void poll_once(struct machine *m) {
    interrupt_on_change(m); // a switch may bounce on while nothing moves
    echo(m);
    gonio_fw_core_poll(&m->core);
    const unsigned phase = m->core.homing.phase;
    const bool busy = m->core.modbus.length > 0 || m->core.modbus.sending || phase == FW_HOMING_RELEASE ||
                      phase == FW_HOMING_FAST || phase == FW_HOMING_HOLD;
    m->poll_us = m->now_us + (busy ? POLL_US : IDLE_POLL_US);
    if (m->now_us - m->fed_us > m->watchdog_ms * 1000ull)
        m->bitten = true;
    run_pending(m);
}

void gonio_machine_run(struct machine *m, uint64_t us) {
    const uint64_t end = m->now_us + us;
    while (!wants_start(m)) {
        // The step events are never more than a segment ahead, so 32 bits tell which side of now they are on.
        const int32_t wait = (int32_t)(m->core.step.due - (uint32_t)m->now_us);
        const uint64_t step_us = m->now_us + (wait > 0 ? (uint32_t)wait : 0);
        const bool step = m->armed && step_us < m->poll_us;
        const uint64_t next = step ? step_us : m->poll_us > m->now_us ? m->poll_us : m->now_us;
        if (next > end)
            break;
        m->now_us = next;
        if (step)
            step_interrupt(m);
        else
            poll_once(m);
        run_pending(m);
    }
    if (!wants_start(m))
        m->now_us = end;
}

bool gonio_machine_settle(struct machine *m, uint64_t us_at_most) {
    for (uint64_t end = m->now_us + us_at_most; m->now_us < end && !wants_start(m);) {
        const unsigned state = m->core.state;
        const bool moving = state == FW_STATE_MOVING || state == FW_STATE_STOPPING || state == FW_STATE_HOMING;
        if (!moving && !m->core.axis.under_way)
            return true;
        gonio_machine_run(m, IDLE_POLL_US);
    }
    return false;
}

enum fw_refusal gonio_machine_command(struct machine *m, enum fw_command command, uint16_t axes) {
    struct fw_registers *r = &m->core.registers;
    r->command_id[0] = r->accepted_id[0] + 1 != 0 ? r->accepted_id[0] + 1 : 1;
    r->command_axes[0] = axes;
    const enum fw_refusal refusal = gonio_fw_core_command(&m->core, (uint16_t)command);
    run_pending(m);
    return refusal;
}

enum fw_refusal gonio_machine_move(struct machine *m, uint16_t axes, const int64_t target[FW_AXES]) {
    for (unsigned i = 0; i < FW_AXES; i++)
        m->core.registers.target[i] = target[i];
    return gonio_machine_command(m, FW_COMMAND_MOVE, axes);
}
