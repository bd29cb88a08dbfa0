// SPDX-License-Identifier: BSD-3-Clause
// Who holds the rig. One master at a time does; only what it writes feeds the dead-man, whoever reads meanwhile.
//
// A master that writes its number to `heartbeat` claims the rig while nobody holds it, and feeds the dead-man from then
// on: with `heartbeat` alone, or with a command block that begins there. A command block without it, or switching
// something on, claims for whoever speaks on that channel; every write of that channel then feeds. STOP, HALT and
// switching off are free to all.
#ifndef FW_OWNER_H
#define FW_OWNER_H

#include <stdbool.h>
#include <stdint.h>

#include "firmware/core/enums.h"

struct fw_core;

// The serial line is one channel, each TCP connection another, with a number that is not used again before long.
enum { FW_CHANNEL_LINE = 0, FW_OWNER_IDLE_MS = 5000 };
#define FW_CHANNEL_NONE 0xFFFFFFFFu
#define FW_OWNER_UNNAMED 0xFFFFFFFFu

struct fw_owner {
    uint32_t number;  // 0: nobody
    uint32_t channel; // that it last wrote from; NONE: an unnamed one's connection is closed, anybody may take over
    uint32_t heard;   // ms when it last fed
};

// A write, as far as the owner is concerned.
struct fw_claim {
    uint32_t number;  // of `heartbeat` in it; 0: it has none
    uint16_t command; // in it; 0: none
    bool harmless;    // nothing but the token
};

// STOP and HALT.
bool gonio_fw_owner_stops(const struct fw_claim *claim);
// Whether the channel in hand (modbus.channel) may write this.
bool gonio_fw_owner_allows(const struct fw_core *core, const struct fw_claim *claim);
// It has been written, without an exception: claim or feed.
void gonio_fw_owner_wrote(struct fw_core *core, const struct fw_claim *claim);
// The same for coils.
bool gonio_fw_owner_allows_coils(const struct fw_core *core, bool any_on);
void gonio_fw_owner_switched(struct fw_core *core, bool any_on);
// The YIELD command: nobody holds the rig, the dead-man rests.
enum fw_refusal gonio_fw_owner_yield(struct fw_core *core);
// A connection is gone.
void gonio_fw_owner_hung_up(struct fw_core *core, uint32_t channel);
// Main loop: the dead-man.
void gonio_fw_owner_poll(struct fw_core *core);

#endif
