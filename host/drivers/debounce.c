// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/debounce.h"

// What raw has come to count as by the time `now_ns`.
static void settle(gonio_debounce *d, int64_t now_ns) {
    if (d->raw != d->stable && now_ns - d->since_ns >= d->hold_ns) {
        d->stable = d->raw;
    }
    d->tripped = d->tripped || d->stable;
}

// An edge that was not seen: the contact has been the other way round for an unknown time, which counts as long.
static void lose(gonio_debounce *d) {
    d->lost_edges++;
    d->tripped = true;
}

static void change(gonio_debounce *d, bool active, int64_t time_ns) {
    settle(d, time_ns);
    if (d->raw != d->stable) {
        d->glitches++; // back again before it counted
    }
    d->raw = active;
    d->since_ns = time_ns;
}

void gonio_debounce_start(gonio_debounce *d, bool active, int64_t now_ns, int64_t hold_ns) {
    *d = (gonio_debounce){.hold_ns = hold_ns, .raw = active, .stable = active, .since_ns = now_ns, .tripped = active};
}

void gonio_debounce_edge(gonio_debounce *d, bool active, int64_t time_ns) {
    if (active == d->raw) {
        lose(d);
        d->since_ns = time_ns;
        return;
    }
    change(d, active, time_ns);
}

void gonio_debounce_level(gonio_debounce *d, bool active, int64_t now_ns) {
    if (active != d->raw) {
        lose(d);
        change(d, active, now_ns);
    }
    settle(d, now_ns);
}

void gonio_debounce_clear(gonio_debounce *d) { d->tripped = d->stable; }
