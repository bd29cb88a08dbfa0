// SPDX-License-Identifier: BSD-3-Clause
#include "firmware/core/ramp.h"

#include "firmware/core/clock.h"

#define ONE ((double)(1ull << FW_RAMP_FRACTION_BITS))

// The core has no libm; Newton's iteration from the power of two above the root, converged when it no longer falls.
static double root(double x, int power) {
    if (x <= 0.0)
        return 0.0;
    union {
        double value;
        uint64_t bits; // IEEE 754 binary64
    } start = {x};
    const int exponent = (int)(start.bits >> 52) - 1022; // x < 2^exponent
    start.bits = (uint64_t)(1023 + (exponent > 0 ? (exponent + power - 1) / power : exponent / power)) << 52;
    double r = start.value;
    for (;;) {
        const double next = power == 2 ? 0.5 * (r + x / r) : (2.0 * r + x / (r * r)) / 3.0;
        if (next >= r)
            return r;
        r = next;
    }
}

static uint32_t ceiling(double x) {
    const uint32_t whole = (uint32_t)x;
    return (double)whole < x ? whole + 1 : whole;
}

static void fill_phase(struct fw_ramp_phase *phase, uint32_t segments, const double coefficient[4]) {
    phase->length = 2 * segments;
    if (segments == 0)
        return;
    phase->shift = (uint8_t)(31 - __builtin_clz(phase->length));
    const uint64_t one = 1ull << 63, rest = one % phase->length;
    phase->reciprocal = (one / phase->length << phase->shift) + (rest << phase->shift) / phase->length;
    phase->start = (uint64_t)(coefficient[0] * ONE);
    phase->linear = (uint64_t)(coefficient[1] * ONE);
    phase->quadratic = (uint64_t)(coefficient[2] * ONE);
    phase->cubic = (uint64_t)(coefficient[3] * ONE);
}

// Everything else from the phase lengths and the peak acceleration.
static void fill(struct fw_ramp *ramp) {
    const double a = ramp->acceleration, tj = 2.0 * ramp->jerk_segments, ta = 2.0 * ramp->acceleration_segments,
                 tv = 2.0 * ramp->cruise_segments;
    const double v1 = 0.5 * a * tj, s1 = a * tj * tj / 6.0; // after the first jerk phase
    const double v2 = v1 + a * ta, s2 = s1 + v1 * ta + 0.5 * a * ta * ta;
    const double v = a * (tj + ta), s3 = 0.5 * v * (2.0 * tj + ta);
    const double rise[4] = {0.0, 0.0, 0.0, s1}, steady[4] = {s1, v1 * ta, 0.5 * a * ta * ta, 0.0},
                 fall[4] = {s2, v2 * tj, 0.5 * a * tj * tj, s1}, cruise[4] = {s3, v * tv, 0.0, 0.0};
    fill_phase(&ramp->phase[0], ramp->jerk_segments, rise);
    fill_phase(&ramp->phase[1], ramp->acceleration_segments, steady);
    fill_phase(&ramp->phase[2], ramp->jerk_segments, fall);
    fill_phase(&ramp->phase[3], ramp->cruise_segments, cruise);
    ramp->duration = 2 * (4 * ramp->jerk_segments + 2 * ramp->acceleration_segments + ramp->cruise_segments);
    ramp->end = (uint64_t)(v * (2.0 * tj + ta + tv) * ONE);
}

// The phases' lengths in segments, not yet rounded.
struct shape {
    double tj, ta, tv;
};

static struct shape shape_of(const struct fw_ramp_limits *limits) {
    const double segment_s = (double)FW_SEGMENT_TICKS / FW_TICK_HZ;
    const double v = limits->speed * segment_s, a = limits->acceleration * segment_s * segment_s,
                 j = limits->jerk * segment_s * segment_s * segment_s;
    double tj = 0.0, ta = v / a;
    if (j > 0.0) {
        tj = a / j;
        ta = v / a - tj;
        if (ta < 0.0) { // the speed is reached before the acceleration
            ta = 0.0;
            tj = root(v / j, 2);
        }
    }
    double tv = 1.0 / v - (2.0 * tj + ta);
    if (tv < 0.0) { // too short a way to reach the speed
        tv = 0.0;
        tj = j > 0.0 ? a / j : 0.0;
        ta = 0.5 * (root(tj * tj + 4.0 / a, 2) - 3.0 * tj);
        if (ta < 0.0) { // nor the acceleration
            ta = 0.0;
            tj = root(0.5 / j, 3);
        }
    }
    return (struct shape){tj, ta, tv};
}

static double length_of(struct shape shape) { return 4.0 * shape.tj + 2.0 * shape.ta + shape.tv; }

double gonio_fw_ramp_least_seconds(const struct fw_ramp_limits *limits) {
    return length_of(shape_of(limits)) * ((double)FW_SEGMENT_TICKS / FW_TICK_HZ);
}

bool gonio_fw_ramp_plan(struct fw_ramp *ramp, const struct fw_ramp_limits *limits) {
    const double longest = 536870912.0; // 2^29, so that half segments, twice as many, fit well into 32 bits
    const struct shape shape = shape_of(limits);
    if (length_of(shape) > longest)
        return false;
    ramp->jerk_segments = ceiling(shape.tj);
    ramp->acceleration_segments = ceiling(shape.ta);
    ramp->cruise_segments = ceiling(shape.tv);
    const double half_tj = 2.0 * ramp->jerk_segments, half_ta = 2.0 * ramp->acceleration_segments;
    ramp->acceleration = 1.0 / ((half_tj + half_ta) * (2.0 * half_tj + half_ta + 2.0 * ramp->cruise_segments));
    fill(ramp);
    ramp->end = 1ull << FW_RAMP_FRACTION_BITS; // exactly, whatever the rounding
    return true;
}

void gonio_fw_ramp_cut(struct fw_ramp *result, const struct fw_ramp *ramp, uint32_t time) {
    const uint32_t at = time / 2, tj = ramp->jerk_segments, ta = ramp->acceleration_segments;
    *result = *ramp;
    if (at >= 2 * tj + ta + ramp->cruise_segments)
        return; // it is slowing down already
    if (at < tj) {
        // Give back the acceleration reached so far with the same jerk; at least one segment of it.
        result->jerk_segments = at > 0 ? at : 1;
        result->acceleration_segments = 0;
        result->acceleration = ramp->acceleration * result->jerk_segments / tj;
        result->cruise_segments = 0;
    } else if (at < tj + ta) {
        result->acceleration_segments = at - tj;
        if (tj == 0 && at == 0)
            result->acceleration_segments = 1;
        result->cruise_segments = 0;
    } else {
        const uint32_t rise = 2 * tj + ta;
        result->cruise_segments = at > rise ? at - rise : 0;
    }
    fill(result);
}

static uint64_t multiply_high(uint64_t a, uint64_t b) {
    const uint32_t a0 = (uint32_t)a, a1 = (uint32_t)(a >> 32), b0 = (uint32_t)b, b1 = (uint32_t)(b >> 32);
    const uint64_t low = (uint64_t)a0 * b0, middle = (uint64_t)a1 * b0 + (low >> 32);
    const uint64_t other = (uint64_t)a0 * b1 + (uint32_t)middle;
    return (uint64_t)a1 * b1 + (middle >> 32) + (other >> 32);
}

static uint64_t rising(const struct fw_ramp *ramp, uint32_t time) {
    int i = 0;
    while (i < 3 && time >= ramp->phase[i].length)
        time -= ramp->phase[i++].length;
    const struct fw_ramp_phase *phase = &ramp->phase[i];
    if (phase->length == 0) // no cruise: the top of the rise
        return ramp->end / 2;
    const uint64_t high = (phase->reciprocal >> 32) * time, low = (phase->reciprocal & 0xFFFFFFFFu) * time;
    const uint64_t x = (high << (32 - phase->shift)) + (low >> phase->shift); // 63 fraction bits
    const uint64_t cubic = multiply_high(phase->cubic, x) << 1;
    uint64_t sum = i == 2 ? phase->quadratic - cubic : phase->quadratic + cubic;
    sum = (multiply_high(sum, x) << 1) + phase->linear;
    return (multiply_high(sum, x) << 1) + phase->start;
}

uint64_t gonio_fw_ramp_at(const struct fw_ramp *ramp, uint32_t time) {
    if (time >= ramp->duration)
        return ramp->end;
    const uint32_t mirrored = ramp->duration - time;
    if (mirrored < time)
        return ramp->end - rising(ramp, mirrored);
    return rising(ramp, time);
}

double gonio_fw_ramp_seconds(const struct fw_ramp *ramp) {
    return (double)ramp->duration * (0.5 * FW_SEGMENT_TICKS / FW_TICK_HZ);
}
