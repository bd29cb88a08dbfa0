// SPDX-License-Identifier: BSD-3-Clause
// The controller: all its state, and how a board, a test or a simulator runs it.
//
// A board has one struct fw_core in static memory (zeroed). It calls gonio_fw_core_init once, gonio_fw_core_poll for
// ever, and from its interrupts gonio_fw_interlock_input, the step interrupt of contract/tick.h,
// gonio_fw_modbus_receive and gonio_fw_stepgen_produce. A simulator does the same with a clock of its own:
// board/posix/machine.h runs the core from event to event in simulated time. Nothing here allocates, blocks, or uses
// floating point in what interrupts call.
#ifndef FW_CORE_H
#define FW_CORE_H

#include <stdbool.h>
#include <stdint.h>

#include "firmware/core/axis.h"
#include "firmware/core/clock.h"
#include "firmware/core/enums.h"
#include "firmware/core/homing.h"
#include "firmware/core/interlock.h"
#include "firmware/core/lamp.h"
#include "firmware/core/modbus_slave.h"
#include "firmware/core/owner.h"
#include "firmware/core/parameters.h"
#include "firmware/core/registers.h"
#include "firmware/core/stepgen.h"

struct fw_core {
    struct fw_stepgen step;
    struct fw_axis axis;
    struct fw_homing homing;
    struct fw_interlock interlock;
    struct fw_lamp lamp;
    struct fw_modbus modbus;
    struct fw_owner owner;
    struct fw_registers registers;
    struct fw_meaning meaning;
    uint8_t state;      // enum fw_state
    uint16_t known;     // axes whose position is known
    uint32_t last_tick; // when time_us was brought up to date
    int64_t time_us;
    uint32_t ms, ms_remainder_us;
    bool hang;   // self_test: feed the watchdog no more
    void *board; // the board's own, untouched by the core
};

enum { FW_WATCHDOG_MS = 500 };

// board: value of register board. cause: why it starts. Loads the parameters, makes the outputs safe, starts the
// watchdog.
void gonio_fw_core_init(struct fw_core *core, uint16_t board, enum fw_cause cause);
// One turn of the main loop; at least every millisecond. Never blocks.
void gonio_fw_core_poll(struct fw_core *core);

// ---- for the modules ----
enum fw_refusal gonio_fw_core_command(struct fw_core *core, uint16_t command);
enum fw_refusal gonio_fw_core_self_test(struct fw_core *core, uint16_t key);
// Bring the read-only registers up to date.
void gonio_fw_core_refresh(struct fw_core *core);
// Parameters were written or loaded.
void gonio_fw_core_parameters_changed(struct fw_core *core);
// Whether nothing moves and no homing is under way: parameters may change.
bool gonio_fw_core_at_rest(const struct fw_core *core);
// Why a command that starts something must not, as far as the state goes.
enum fw_refusal gonio_fw_core_ready(const struct fw_core *core);

#endif
