// SPDX-License-Identifier: BSD-3-Clause
// Ramp: how far a move has come after a given time, for all its axes at once.
//
// A move runs along a straight line in joint space, q_i(t) = q_i(0) + D_i s(t), so its axes arrive together by
// construction. s rises from 0 to 1 with bounded speed, acceleration and jerk, symmetrically: jerk phase tj, constant
// acceleration ta, jerk phase tj, cruise tv, and back (tj = 0: a trapezoid). With the peak acceleration A,
//     A = 1 / ((tj + ta) (2 tj + ta + tv)),    peak speed v = A (tj + ta),    jerk = A / tj,
// all of which fall when any phase gets longer: rounding the phases up to whole segments keeps every limit.
//
// Planning is done in double, outside interrupts. What the interrupt evaluates is one cubic a phase in 64-bit fixed
// point; the falling half is the mirror image of the rising one.
#ifndef FW_RAMP_H
#define FW_RAMP_H

#include <stdbool.h>
#include <stdint.h>

enum {
    FW_SEGMENT_TICKS = 256,    // step times are worked out a segment at a time
    FW_RAMP_FRACTION_BITS = 62 // of s
};

// One of the four rising phases: s = start + x (linear + x (quadratic +- x cubic)), x = time in the phase / length.
struct fw_ramp_phase {
    uint32_t length;     // half segments
    uint8_t shift;       // floor(log2(length)): keeps all 63 bits of the reciprocal however long the phase
    uint64_t reciprocal; // 2^(63 + shift) / length
    uint64_t start, linear, quadratic, cubic; // 62 fraction bits
};

struct fw_ramp {
    uint32_t jerk_segments, acceleration_segments, cruise_segments; // tj, ta, tv
    double acceleration;                                            // A, per half segment squared
    struct fw_ramp_phase phase[4];
    uint32_t duration; // half segments
    uint64_t end;      // s at the end; 2^62, less for one that was cut short
};

// The limits of s, per second: each the least of limit_i / D_i over the axes. jerk 0: trapezoid.
struct fw_ramp_limits {
    double speed, acceleration, jerk;
};

// Plan the fastest ramp within the limits (all > 0 but jerk >= 0). False: it would take more than 38 hours.
bool gonio_fw_ramp_plan(struct fw_ramp *ramp, const struct fw_ramp_limits *limits);
// Plan the earliest end within the same limits for a ramp that is followed up to `time` (half segments, even). The
// result equals `ramp` up to that time at least.
void gonio_fw_ramp_cut(struct fw_ramp *result, const struct fw_ramp *ramp, uint32_t time);
// s at a time in half segments, 62 fraction bits; `end` from the duration on. Callable in interrupts.
uint64_t gonio_fw_ramp_at(const struct fw_ramp *ramp, uint32_t time);
// Seconds from start to end.
double gonio_fw_ramp_seconds(const struct fw_ramp *ramp);
// Seconds that the limits alone would take, phases not rounded up.
double gonio_fw_ramp_least_seconds(const struct fw_ramp_limits *limits);

#endif
