// SPDX-License-Identifier: BSD-3-Clause
// The keys of a rig file that the host itself understands.
#ifndef GONIO_HOST_ACQUIRE_RIG_KEYS_H
#define GONIO_HOST_ACQUIRE_RIG_KEYS_H

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
// *known: whether the host has this key; stated: the driver states the rig's numbers itself (the simulator), so that
// only the host's own keys are taken here. GONIO_E_INPUT where the value is impossible.
gonio_status gonio_rig_keys_set(rig_keys *keys, bool stated, const char *section, const char *key, const char *value,
                                bool *known, gonio_error *error);
// " key" of every key of the section that would be taken, for messages.
void gonio_rig_keys_list(bool stated, const char *section, char *text, size_t size);

#endif
