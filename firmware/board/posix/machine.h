// SPDX-License-Identifier: BSD-3-Clause
// A simulated machine around the firmware core: motors, switches, lamp, flash and a clock, in memory.
//
// It implements contract/ and runs the core from event to event in simulated time, as fast as it can: the posix board
// puts a line and a real clock around it, tests and the simulated rig call it directly. A simulator's whole loop is
//     gonio_machine_start(m);  gonio_machine_command(m, FW_COMMAND_HOME, 0xF);  while (m->core.state != FW_STATE_IDLE)
//     gonio_machine_run(m, 1000);
// Interrupts happen between the core's calls, never inside: this shows what the core does, not how it shares data with
// interrupts; that is for the emulated boards. Several machines may run side by side; one is not thread safe.
#ifndef FW_MACHINE_H
#define FW_MACHINE_H

#include <stdbool.h>
#include <stdint.h>

#include "firmware/contract/store.h"
#include "firmware/core/core.h"

enum { MACHINE_BOARD = 1, MACHINE_SENT_MAX = 1024 };

enum machine_switch {
    MACHINE_SWITCH_GOOD,
    MACHINE_SWITCH_MISSING, // never active
    MACHINE_SWITCH_STUCK,   // once active, always
    MACHINE_SWITCH_PRESSED, // always active
    MACHINE_SWITCH_BOUNCING // changes every 200 us for bounce_us after each true change
};

struct machine_axis {
    int64_t steps;                      // where the motor truly stands
    int64_t play, arm;                  // backlash, and where the arm behind it stands: steps <= arm <= steps + play
    int64_t home_at;                    // its switch is active from here on outwards
    bool home_up;                       // ... which is upwards
    int64_t limit_min_at, limit_max_at; // limit switches active from here on outwards
    enum machine_switch home_switch;
    uint32_t bounce_us;
    bool home_before;
    uint64_t home_changed_us;
};

struct machine {
    struct fw_core core; // first: the contract's functions find the machine by it
    uint64_t now_us;
    uint64_t poll_us; // of the next turn of the main loop
    struct machine_axis axis[FW_AXES];
    uint16_t forced_on, forced_off; // contacts held by hand, as levels
    uint8_t directions, motors, pins;
    uint8_t reversed;   // motors that go down at the direction level 1
    uint8_t enable_low; // motors that are on at the enable level 0
    bool armed, produce_pending, inputs_pending, shutter, trigger, driving;
    uint16_t lamp;
    int32_t temperature; // 0.001 degC
    uint64_t fed_us;
    uint32_t watchdog_ms;
    bool bitten, restart, fault;        // it wants a new start
    uint64_t rising_edges, wrong_edges; // wrong: steps of a motor that is off
    uint32_t flash[FW_STORE_SLOTS][FW_STORE_WORDS];
    int64_t flash_operations_left;  // until power fails in the middle of one; < 0: never
    uint8_t sent[MACHINE_SENT_MAX]; // by the UART
    unsigned sent_length;
    // A line that takes its time and whose receiver stays on: each byte comes back when it has left, echo_us later.
    bool echo;
    uint32_t echo_us;
    uint64_t line_free_us; // when the last byte has left
    bool echo_pending;
    uint8_t echo_byte;
    // Told of each step event as it happens (may be NULL): the edges byte as in fw_stepgen.
    void (*on_edges)(void *context, uint64_t now_us, uint8_t edges, uint8_t directions);
    void *context;
};

// A machine as it comes from the factory: flash erased, switches some way outside the soft limits, cold.
void gonio_machine_new(struct machine *m);
// Power up, or start anew after m->bitten, m->restart or m->fault; flash and mechanics stay as they are.
void gonio_machine_start(struct machine *m, enum fw_cause cause);
// Put the switches where, and on the side on which, the parameters have them: home switch at home_position, limit
// switches well outside of it and of the soft limits. An axis that is not homed is put where homing finds its switch,
// if it stands elsewhere.
void gonio_machine_place(struct machine *m);
// Let simulated time pass. Returns early when the machine wants a new start.
void gonio_machine_run(struct machine *m, uint64_t us);
// The same until state, alarm free or not, is no longer MOVING, STOPPING or HOMING, or the time is over; true: it came
// to rest.
bool gonio_machine_settle(struct machine *m, uint64_t us_at_most);
// Give a command through the register interface with a fresh id.
enum fw_refusal gonio_machine_command(struct machine *m, enum fw_command command, uint16_t axes);
// A MOVE of the axes to absolute targets.
enum fw_refusal gonio_machine_move(struct machine *m, uint16_t axes, const int64_t target[FW_AXES]);
// Hold a contact active or inactive, or let go of it.
void gonio_machine_hold(struct machine *m, enum fw_contact contact, bool active);
void gonio_machine_release(struct machine *m, enum fw_contact contact);
// Bytes on the line, one character time apart, then silence long enough to end a frame and get the reply into m->sent.
void gonio_machine_receive(struct machine *m, const uint8_t *bytes, unsigned length);

#endif
