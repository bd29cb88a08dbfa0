// SPDX-License-Identifier: BSD-3-Clause
#include "firmware/board/lm3s6965evb/trace.h"

#include "firmware/contract/watchdog.h"

#ifdef FW_TRACE

// Four axes at 40,000 steps/s and more: at incommensurable rates, and at nearly the same one, so that their edges meet
// in every phase and stay in it for many segments.
static const int64_t ways[][FW_AXES] = {{10300, -10200, 10100, -10000}, {10006, -10004, 10002, -10000}};
enum { SPEED = 45000, ACCELERATION = 1000000, JERK = 100000000, RATE = 162400, CYCLES = 50, REST_MS = 20 };
// The same move goes forth and back, each time another part of it is looked at: the start, the middle of the
// acceleration, full speed, the deceleration.
static const uint32_t from_ms[] = {0, 25, 120, 250};
enum { PARTS = sizeof from_ms / sizeof from_ms[0], RUNS = PARTS * (sizeof ways / sizeof ways[0]) };
enum { BINS = 20, BIN_CYCLES = 10, EVENTS = 8000 };

static uint32_t log[EVENTS];
uint32_t *volatile trace_at = log + EVENTS;
uint32_t *const trace_end = log + EVENTS;
static uint32_t bin[BINS]; // of lateness, 0.2 ticks each, bin 10 from 0 on
static uint32_t hash = 2166136261u, looked_at, wrong, turns;
static uint32_t produced, producing_cycles, producing_most; // segments; cycles that they took
static uint32_t rest_turns, moving_turns, moving_ms;
static uint32_t began_ms;
static bool begun, armed, rested;
static unsigned run;

// ---- semihosting (Arm, "Semihosting for AArch32 and AArch64") ----

static uint32_t semihost(uint32_t operation, uintptr_t argument) {
    register uint32_t r0 __asm("r0") = operation;
    register uintptr_t r1 __asm("r1") = argument;
    __asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static void text(const char *string) {
    enum { SYS_WRITE0 = 4 };
    semihost(SYS_WRITE0, (uintptr_t)string);
}

static void number(const char *name, uint32_t value) {
    char digits[12] = "";
    unsigned at = sizeof digits - 1;
    do
        digits[--at] = (char)('0' + value % 10);
    while ((value /= 10) > 0);
    text(name);
    text(" ");
    text(digits + at);
    text("\n");
}

// ---- the moves ----

static int64_t target_of(unsigned axis) { return run % 2 == 0 ? ways[run / PARTS][axis] : 0; }

static void begin_run(void) {
    struct fw_registers *r = &fw_core.registers;
    for (unsigned i = 0; i < FW_AXES; i++)
        r->target[i] = target_of(i);
    r->command_axes[0] = 15;
    r->command_id[0] = run + 1;
    began_ms = fw_core.ms;
    turns = 0;
    armed = true;
    if (gonio_fw_core_command(&fw_core, FW_COMMAND_MOVE) != FW_REFUSAL_NONE)
        text("refused\n");
}

static void begin(void) {
    struct fw_registers *r = &fw_core.registers;
    for (unsigned i = 0; i < FW_AXES; i++) {
        r->speed_max[i] = SPEED;
        r->acceleration[i] = ACCELERATION;
        r->jerk[i] = JERK;
    }
    r->step_rate_max[0] = RATE;
    r->settle[0] = 0;
    fw_core.known = 15;
}

// Cycles from the tick to the event; the clock counts down, through 24 bits.
static int32_t lateness(uint32_t event, uint32_t due) { return -((int32_t)(((event >> 8) + due * CYCLES) << 8) >> 8); }

static void look_at(uint32_t event, uint32_t due, uint8_t edges) {
    const uint32_t at = ((uint32_t)lateness(event, due) + BINS / 2 * BIN_CYCLES) / BIN_CYCLES;
    bin[at < BINS ? at : BINS - 1]++;
    looked_at++;
    wrong += (event & 255) != edges;
    hash = (hash ^ event) * 16777619u;
}

static void produce(struct fw_stepgen *g) {
    const uint32_t before = SYST_CVR;
    gonio_fw_stepgen_produce(g);
    const uint32_t took = (before - SYST_CVR) & 0xFFFFFF;
    produced++;
    producing_cycles += took;
    producing_most = took > producing_most ? took : producing_most;
}

// Work the same steps out again, without a timer, to learn when each event was due.
static void look_at_run(uint32_t first) {
    static struct fw_stepgen again;
    const int64_t *way = ways[run / PARTS];
    uint32_t distance[FW_AXES];
    uint8_t down = 0;
    for (unsigned i = 0; i < FW_AXES; i++) {
        distance[i] = (uint32_t)(way[i] < 0 ? -way[i] : way[i]);
        down |= (uint8_t)(((way[i] < 0) != (run % 2 != 0)) << i);
    }
    gonio_fw_stepgen_prepare(&again, fw_core.step.ramp, distance, down, fw_core.step.pulse);
    gonio_fw_stepgen_start(&again, first);
    const uint32_t *event = log;
    while (event < trace_at) {
        // The log begins somewhere under way.
        const int32_t late = lateness(*event, again.due);
        if (event > log || (late > -40 && late < 40 && again.edges == (*event & 255)))
            look_at(*event++, again.due, again.edges);
        const enum fw_step_action action = fw_stepgen_next(&again);
        if (action == FW_STEP_PRODUCE)
            produce(&again);
        else if (action == FW_STEP_END)
            break;
        gonio_fw_board_watchdog_feed(&fw_core);
    }
    gonio_fw_stepgen_abort(&again); // it may not have come to the end
    trace_at = trace_end;
}

static bool arrived(void) {
    bool all = true;
    for (unsigned i = 0; i < FW_AXES; i++)
        all = all && fw_core.step.position[i] == target_of(i);
    return all;
}

static void report(void) {
    number("alarm", fw_core.registers.alarm[0]);
    number("looked_at", looked_at);
    number("wrong_edges", wrong);
    number("late_edges", fw_core.registers.late_edges[0]);
    // Of what the main loop has at rest.
    number("main_percent", 100 * (moving_turns / moving_ms) / (rest_turns / REST_MS));
    number("producer_percent", 100 * (producing_cycles / produced) / (CYCLES * FW_SEGMENT_TICKS));
    number("producer_percent_most", 100 * producing_most / (CYCLES * FW_SEGMENT_TICKS));
    for (unsigned i = 0; i < BINS; i++)
        number("bin", bin[i]);
    number("hash", hash);
}

// How often the main loop turns while nothing moves.
static bool resting(void) {
    if (!begun) {
        begun = true;
        begin();
        began_ms = fw_core.ms;
    }
    turns++;
    if (!rested && fw_core.ms - began_ms >= REST_MS) {
        rested = true;
        rest_turns = turns;
        begin_run();
    }
    return !rested;
}

void trace_poll(void) {
    enum { SYS_EXIT = 0x18, STOPPED = 0x20026 };
    if (resting())
        return;
    if (armed && fw_core.ms - began_ms >= from_ms[run % PARTS]) {
        trace_at = log;
        armed = false;
    }
    if (fw_core.state == FW_STATE_MOVING)
        return;
    moving_turns += turns;
    moving_ms += fw_core.ms - began_ms;
    number("arrived", arrived());
    // The last event ends the segment after the last of the ramp.
    look_at_run(fw_core.step.due - (fw_core.step.ramp->duration / 2 + 1) * FW_SEGMENT_TICKS);
    if (++run < RUNS && fw_core.state == FW_STATE_IDLE) {
        begin_run();
        return;
    }
    report();
    semihost(SYS_EXIT, STOPPED);
}
#endif
