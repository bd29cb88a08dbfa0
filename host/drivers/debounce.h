// SPDX-License-Identifier: BSD-3-Clause
// A contact: from edges and level readings to what it really did, glitches left out, short openings and lost edges not.
//
// libgpiod 1.6 neither debounces nor numbers its events, so both are done here: a level counts once it has held, and an
// edge is known to be lost where two equal ones follow each other or where the level contradicts the last edge.
#ifndef GONIO_DRIVERS_DEBOUNCE_H
#define GONIO_DRIVERS_DEBOUNCE_H

#include <stdbool.h>
#include <stdint.h>

typedef struct gonio_debounce {
    int64_t hold_ns;  // a level that holds this long counts
    bool raw, stable; // active?
    int64_t since_ns; // of raw
    bool tripped;     // has been active since the last gonio_debounce_clear
    int64_t glitches, lost_edges;
} gonio_debounce;

void gonio_debounce_start(gonio_debounce *d, bool active, int64_t now_ns, int64_t hold_ns);
void gonio_debounce_edge(gonio_debounce *d, bool active, int64_t time_ns);
// The level as read just now.
void gonio_debounce_level(gonio_debounce *d, bool active, int64_t now_ns);
// Forget what has been; tripped stays set while the contact is active.
void gonio_debounce_clear(gonio_debounce *d);

#endif
