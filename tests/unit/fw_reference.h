// SPDX-License-Identifier: BSD-3-Clause
// The seven phases of a ramp in plain long double, by integrating phase after phase: the oracle for gonio_fw_ramp_at
// and the step times. It shares the phase lengths with the firmware, nothing else.
#ifndef FW_REFERENCE_H
#define FW_REFERENCE_H

#include "firmware/core/ramp.h"

struct reference {
    long double length[7], jerk_of[7];          // ticks; per tick^3
    long double speed, acceleration, jerk, end; // greatest of each, per tick^n; way at the end
    long double jump;                           // trapezoid: the acceleration that comes at once
};

static inline long double reference_at(const struct reference *r, long double ticks) {
    long double s = 0.0L, v = 0.0L, a = 0.0L;
    for (int i = 0; i < 7; i++) {
        const long double t = ticks < r->length[i] ? ticks : r->length[i], j = r->jerk_of[i];
        if (r->jump > 0.0L)
            a = i == 1 ? r->jump : i == 5 ? -r->jump : 0.0L;
        s += t * (v + t * (a / 2 + t * j / 6));
        v += t * (a + t * j / 2);
        a += t * j;
        ticks -= t;
        if (ticks <= 0.0L)
            break;
    }
    return s;
}

static inline struct reference reference_of(const struct fw_ramp *ramp) {
    struct reference r = {0};
    const long double tj = (long double)ramp->jerk_segments * FW_SEGMENT_TICKS,
                      ta = (long double)ramp->acceleration_segments * FW_SEGMENT_TICKS,
                      tv = (long double)ramp->cruise_segments * FW_SEGMENT_TICKS;
    const long double length[7] = {tj, ta, tj, tv, tj, ta, tj};
    const int sign[7] = {1, 0, -1, 0, -1, 0, 1};
    r.acceleration = (long double)ramp->acceleration / (128.0L * 128.0L);
    r.jerk = tj > 0.0L ? r.acceleration / tj : 0.0L;
    r.jump = tj > 0.0L ? 0.0L : r.acceleration;
    r.speed = r.acceleration * (tj + ta);
    for (int i = 0; i < 7; i++) {
        r.length[i] = length[i];
        r.jerk_of[i] = sign[i] * r.jerk;
    }
    r.end = reference_at(&r, 4 * tj + 2 * ta + tv);
    return r;
}

// The tick, not rounded, at which the way is `part` of the whole.
static inline long double reference_when(const struct reference *r, long double part) {
    long double low = 0.0L, high = 0.0L;
    for (int i = 0; i < 7; i++)
        high += r->length[i];
    for (int i = 0; i < 60; i++) {
        const long double middle = (low + high) / 2;
        if (reference_at(r, middle) < part)
            low = middle;
        else
            high = middle;
    }
    return high;
}

#endif
