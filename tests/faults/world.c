// SPDX-License-Identifier: BSD-3-Clause
#include "tests/faults/world.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

const fault_info fault_infos[FAULT_COUNT] = {
#define X(name, unit, area) [FAULT_##name] = {#name, area, unit},
    FAULT_KINDS(X)
#undef X
};

world *w;

// splitmix64
uint32_t world_random(void) {
    uint64_t z = w->random += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return (uint32_t)((z ^ z >> 31) >> 16);
}

void world_trouble(const char *format, ...) {
    const size_t used = strlen(w->trouble);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(w->trouble + used, sizeof w->trouble - used, format, arguments);
    va_end(arguments);
}

static fault *find(fault_kind kind) {
    for (int i = 0; i < w->n; i++) {
        if (w->faults[i].kind == kind && !w->faults[i].over) {
            return &w->faults[i];
        }
    }
    return NULL;
}

bool world_waits(fault_kind kind) {
    const fault *f = find(kind);
    return f != NULL && w->counts[fault_infos[kind].unit] >= f->at && f->used < f->burst;
}

fault *world_strikes(fault_kind kind) {
    if (!world_waits(kind)) {
        return NULL;
    }
    fault *f = find(kind);
    f->used++;
    f->hits++;
    return f;
}

bool world_stands(fault_kind kind) {
    fault *f = find(kind);
    if (f == NULL || !f->standing) {
        return false;
    }
    f->hits++;
    return true;
}

// ---- what lasts: begin and end ----

static void set_switch(const fault *f, enum machine_switch state) {
    struct machine_axis *axis = &w->machine.axis[f->parameter % FW_AXES];
    axis->home_switch = state;
    axis->bounce_us = 20000 + f->parameter % 60000;
}

static void restart(enum fw_cause cause) { gonio_machine_start(&w->machine, cause); }

static void hold(const fault *f, bool active) {
    const enum fw_contact contact = f->kind == FAULT_emergency_stop ? FW_CONTACT_estop
                                    : f->kind == FAULT_door_opened  ? FW_CONTACT_door
                                                                    : FW_CONTACT_limit_max_0 + f->parameter % FW_AXES;
    if (active) {
        gonio_machine_hold(&w->machine, contact, true);
    } else {
        gonio_machine_release(&w->machine, contact);
    }
}

static void begin(fault *f) {
    static const enum machine_switch switches[] = {MACHINE_SWITCH_MISSING, MACHINE_SWITCH_STUCK, MACHINE_SWITCH_PRESSED,
                                                   MACHINE_SWITCH_BOUNCING};
    if (w->verbose) {
        printf("%10.3f s  begins: %s, for %.3f s\n", (double)w->now_us * 1e-6, fault_infos[f->kind].name,
               (double)f->duration_us * 1e-6);
    }
    f->standing = true;
    f->until_us = w->now_us + f->duration_us;
    const int steps = 30 + (int)(f->parameter >> 8) % 270;
    switch (f->kind) {
    case FAULT_home_switch_missing:
    case FAULT_home_switch_stuck:
    case FAULT_home_switch_pressed:
    case FAULT_home_switch_bouncing:
        set_switch(f, switches[f->kind - FAULT_home_switch_missing]);
        break;
    case FAULT_steps_lost_encoder:
        // A homing does not see what is lost in its middle; nor do encoders whose zero it tells.
        w->slip_seen = w->host_runs && w->now_us - w->homing_us > 1000000;
        // fall through
    case FAULT_steps_lost:
        w->machine.axis[f->parameter % FW_AXES].steps += f->parameter >> 31 ? steps : -steps;
        w->slip_allowed += steps;
        f->until_us = w->now_us;
        f->hits++;
        break;
    case FAULT_emergency_stop:
    case FAULT_door_opened:
    case FAULT_limit_switch:
        hold(f, true);
        f->hits++;
        break;
    case FAULT_controller_brown_out:
        w->controller_off = true;
        gonio_fw_interlock_fault(&w->machine.core);
        f->hits++;
        break;
    case FAULT_controller_hangs:
        w->machine.core.hang = true;
        f->until_us = w->now_us;
        f->hits++;
        break;
    case FAULT_controller_reset:
        restart(FW_CAUSE_PIN);
        f->until_us = w->now_us;
        f->hits++;
        break;
    case FAULT_lamp_too_hot:
    case FAULT_lamp_sensor_broken:
        w->machine.temperature = f->kind == FAULT_lamp_too_hot ? 120000 : INT32_MIN;
        f->hits++;
        break;
    case FAULT_encoder_frozen:
        for (int k = 0; k < FW_AXES; k++) {
            w->frozen[k] = w->machine.axis[k].steps;
        }
        break;
    case FAULT_line_echo:
        w->machine.echo = true;
        w->machine.echo_us = f->parameter % 90;
        f->hits++;
        break;
    case FAULT_rig_file_edited:
        f->until_us = INT64_MAX; // until somebody comes by
        break;
    case FAULT_adapter_unplugged:
        w->line_broken = true;
        f->hits++;
        break;
    case FAULT_ctrl_c:
        w->interrupted = w->host_runs;
        f->until_us = w->now_us;
        f->hits += w->host_runs;
        break;
    case FAULT_host_killed:
        f->over = w->host_runs;
        f->hits += w->host_runs;
        if (w->host_runs) {
            _exit(137);
        }
        break;
    default:
        break;
    }
}

static void end(fault *f) {
    if (!f->standing) {
        return;
    }
    f->standing = false;
    f->over = true;
    switch (f->kind) {
    case FAULT_home_switch_missing:
    case FAULT_home_switch_stuck:
    case FAULT_home_switch_pressed:
    case FAULT_home_switch_bouncing:
        f->hits += f->homing_seen;
        set_switch(f, MACHINE_SWITCH_GOOD);
        break;
    case FAULT_emergency_stop:
    case FAULT_door_opened:
    case FAULT_limit_switch:
        hold(f, false);
        break;
    case FAULT_controller_brown_out:
        w->controller_off = false;
        restart(FW_CAUSE_BROWN_OUT);
        break;
    case FAULT_lamp_too_hot:
    case FAULT_lamp_sensor_broken:
        w->machine.temperature = 25000;
        break;
    case FAULT_line_echo:
        w->machine.echo = false;
        break;
    default:
        break;
    }
}

// An axis that was stopped on its home switch is moved off it by hand, as alarm 5 asks for (docs/hardware.md).
static void move_off_switches(void) {
    for (int k = 0; k < FW_AXES; k++) {
        struct machine_axis *axis = &w->machine.axis[k];
        if (w->machine.core.registers.alarm[0] == FW_ALARM_HOME_PRESSED && axis->steps <= axis->home_at) {
            axis->steps = axis->home_at + 150;
        }
    }
}

int64_t world_encoder(int axis) {
    const fault *f = find(FAULT_encoder_frozen);
    const bool frozen = f != NULL && (int)(f->parameter % FW_AXES) == axis && world_stands(FAULT_encoder_frozen);
    return frozen ? w->frozen[axis] : w->machine.axis[axis].steps;
}

void world_repair(void) {
    move_off_switches();
    for (int i = 0; i < w->n; i++) {
        fault *f = &w->faults[i];
        end(f);
        f->over = f->over || f->used > 0;
    }
}

// ---- other programs ----

enum { SECOND_CHANNEL = 77, SECOND_NUMBER = 4711, SECOND_PERIOD_US = 100000 };

static unsigned say(const uint8_t *pdu, size_t length) {
    uint8_t reply[FW_PDU_MAX];
    const size_t n = gonio_fw_modbus_pdu(&w->machine.core, SECOND_CHANNEL, pdu, length, reply);
    return n == 2 && (reply[0] & 0x80) != 0 ? reply[1] : 0;
}

// A second master that looks on, and writes what it must not: the dead-man off, a scale, a light, a move of its own.
static void speak(fault *f) {
    static const uint8_t status[] = {23, 0, 0x10, 0, 0x40, 0, 0x10, 0, 1, 2, 5, 5};
    static const uint8_t deadman[] = {16, 2, 0x92, 0, 2, 4, 0, 0, 0, 0}, scale[] = {16, 2, 0, 0, 2, 4, 0, 0, 0, 99},
                         shutter[] = {5, 0, 1, 0xFF, 0}, level[] = {6, 1, 0x18, 0, 9};
    uint8_t move[6 + 42] = {16, 1, 0, 0, 21, 42, 0x7F, 0, 0, 1, 0, 1, 3, 0xE8};
    move[sizeof move - 1] = FW_COMMAND_MOVE;
    if (w->controller_off || w->now_us - w->spoke_us < SECOND_PERIOD_US) {
        return;
    }
    w->spoke_us = w->now_us;
    f->hits++;
    bool taken = say(status, sizeof status) != 0;
    if (w->machine.core.owner.number != 0) { // else it may
        taken |= say(deadman, sizeof deadman) == 0 || say(scale, sizeof scale) == 0 ||
                 say(shutter, sizeof shutter) == 0 || say(level, sizeof level) == 0 || say(move, sizeof move) == 0;
    }
    if (taken) {
        world_trouble("what a second master wrote was taken; ");
    }
}

static void put(int address, int words, int64_t value) {
    uint8_t pdu[14] = {16, (uint8_t)(address >> 8), (uint8_t)address, 0, (uint8_t)words, (uint8_t)(2 * words)};
    for (int i = 0; i < 2 * words; i++) {
        pdu[6 + i] = (uint8_t)((uint64_t)value >> 8 * (2 * words - 1 - i));
    }
    if (say(pdu, 6 + 2 * (size_t)words) != 0 && w->verbose) {
        printf("%10.3f s  the visitor is refused\n", (double)w->now_us * 1e-6);
    }
}

void world_visit(void) {
    fault *f = find(FAULT_rig_file_edited);
    if (f == NULL || !f->standing || w->controller_off) {
        return;
    }
    static const struct {
        int address, words;
        int64_t value;
    } edits[] = {{FW_REGISTER_steps_per_deg, 2, 200000},
                 {FW_REGISTER_home_position, 4, -950},
                 {FW_REGISTER_soft_max, 4, 300},
                 {FW_REGISTER_speed_max, 2, 500}};
    const unsigned which = f->parameter % 4, axis = f->parameter / 4 % FW_AXES;
    put(FW_REGISTER_heartbeat, 2, SECOND_NUMBER);
    put(edits[which].address + (int)axis * edits[which].words, edits[which].words, edits[which].value);
    f->hits++;
    f->standing = false;
    f->over = true;
}

// ---- time ----

static void run_machine(int64_t us) {
    struct machine *m = &w->machine;
    if (w->controller_off) {
        m->now_us += (uint64_t)us;
        m->poll_us = m->now_us;
        m->fed_us = m->now_us;
        return;
    }
    const uint64_t until = m->now_us + (uint64_t)us;
    while (m->now_us < until) {
        gonio_machine_run(m, until - m->now_us);
        if (m->bitten || m->restart || m->fault) {
            restart(m->bitten ? FW_CAUSE_WATCHDOG : m->fault ? FW_CAUSE_FAULT : FW_CAUSE_COMMAND);
        }
    }
}

// A bad home switch has done something once there was a homing.
static void see_homing(void) {
    const struct fw_core *core = &w->machine.core;
    w->homing_us = core->state == FW_STATE_HOMING ? w->now_us : w->homing_us;
    const unsigned alarm = core->registers.alarm[0];
    for (int i = 0; i < w->n; i++) {
        w->faults[i].homing_seen |=
            w->faults[i].standing &&
            (core->state == FW_STATE_HOMING || (alarm >= FW_ALARM_HOME_PRESSED && alarm <= FW_ALARM_HOME_BOUNCE));
    }
}

// The next moment at which something begins or ends; at most `until`.
static int64_t next_event_us(int64_t until) {
    for (int i = 0; i < w->n; i++) {
        const fault *f = &w->faults[i];
        if (f->over || fault_infos[f->kind].unit != TIME_US) {
            continue;
        }
        const int64_t at = f->standing ? f->until_us : f->at;
        until = at > w->now_us && at < until ? at : until;
    }
    return until;
}

static void events(void) {
    for (int i = 0; i < w->n; i++) {
        fault *f = &w->faults[i];
        if (f->over || fault_infos[f->kind].unit != TIME_US) {
            continue;
        }
        if (!f->standing && f->at <= w->now_us) {
            begin(f);
        }
        if (f->standing && f->until_us <= w->now_us) {
            end(f);
        }
    }
}

void world_pass(int64_t us) {
    const int64_t until = w->now_us + us;
    do {
        const int64_t to = next_event_us(until);
        run_machine(to - w->now_us);
        see_homing();
        w->now_us = to;
        fault *second = find(FAULT_second_master);
        if (second != NULL && second->standing) {
            speak(second);
        }
        w->counts[TIME_US] = to;
        events();
    } while (w->now_us < until);
    if (w->host_runs && w->now_us - w->host_started_us > w->host_bound_us) {
        world_trouble("beyond its bound of %lld s; ", (long long)(w->host_bound_us / 1000000));
        _exit(99);
    }
}

// ---- the motors, watched step by step ----

static void watch(void *context, uint64_t now_us, uint8_t edges, uint8_t directions) {
    (void)context;
    (void)directions;
    const struct machine *m = &w->machine;
    const bool homing = m->core.state == FW_STATE_HOMING;
    for (unsigned i = 0; i < FW_AXES; i++) {
        if ((edges >> i & 1) == 0) {
            continue;
        }
        w->stepped_us = now_us;
        const int64_t at = m->axis[i].steps, allowed = w->slip_allowed + 1;
        // The mechanical ends bound every motion, the soft limits all but homing, whose switches stand beyond them.
        w->past_limit += at < m->axis[i].limit_min_at - allowed || at > m->axis[i].limit_max_at + allowed;
        if (!homing && (m->core.state == FW_STATE_MOVING)) {
            w->past_limit += at < m->core.registers.soft_min[i] - allowed && m->core.axis.down >> i & 1;
            w->past_limit += at > m->core.registers.soft_max[i] + allowed && m->core.axis.up >> i & 1;
        }
    }
}

void world_new(uint64_t seed) {
    const bool verbose = w->verbose;
    char folder[sizeof w->folder];
    memcpy(folder, w->folder, sizeof folder);
    memset(w, 0, sizeof *w);
    memcpy(w->folder, folder, sizeof folder);
    w->verbose = verbose;
    w->random = seed;
    w->host_bound_us = INT64_C(1800) * 1000000;
    gonio_machine_new(&w->machine);
    w->machine.on_edges = watch;
    for (int k = 0; k < FW_AXES; k++) { // short ways to the switches, which stand outside the soft limits
        w->machine.axis[k].home_at = -1000;
        w->machine.axis[k].limit_min_at = -5000;
    }
    gonio_machine_start(&w->machine, FW_CAUSE_POWER);
    // A lamp that is soon warm, kept over resets.
    w->machine.core.registers.lamp_rise[0] = 200;
    w->machine.core.registers.lamp_warm_up[0] = 300;
    for (int k = 0; k < FW_AXES; k++) {
        w->machine.core.registers.home_backoff[k] = 60;
    }
    gonio_fw_core_parameters_changed(&w->machine.core);
    gonio_machine_command(&w->machine, FW_COMMAND_SAVE, 0);
    gonio_machine_run(&w->machine, 10000);
}
