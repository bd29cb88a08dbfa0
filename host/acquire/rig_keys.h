// SPDX-License-Identifier: BSD-3-Clause
// The keys of a rig file that the host itself understands.
#ifndef GONIO_HOST_ACQUIRE_RIG_KEYS_H
#define GONIO_HOST_ACQUIRE_RIG_KEYS_H

#include "base/keys.h"
#include "host/acquire/acquire.h"

// What they set. Sizes of the texts are those of gonio_rig_facts.
typedef struct rig_keys {
    char driver[16];
    char sample[256];    // SPEC of the simulated sample
    char alignment[256]; // file of the rig's true axes; empty: none
    gonio_scan_options scan;
    gonio_rig_facts facts; // texts always; numbers where the rig does not state its own
} rig_keys;

void gonio_rig_keys_default(rig_keys *keys);
// Every rig's, and those that state its numbers, where its driver (the simulator) does not state them itself.
extern const gonio_key gonio_rig_keys[], gonio_rig_fact_keys[];

#endif
