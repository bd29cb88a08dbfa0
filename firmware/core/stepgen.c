// SPDX-License-Identifier: BSD-3-Clause
#include "firmware/core/stepgen.h"

#include <stddef.h>

enum { FRACTION_BITS = 26, HALF = FW_SEGMENT_TICKS / 2, HALF_BITS = 7, FAST_STRIDE = 64 };
#define STEP ((uint64_t)1 << FRACTION_BITS)

// distance x s, 62 fraction bits -> 26.
static uint64_t way(uint32_t distance, uint64_t s) {
    const uint64_t high = (s >> 32) * distance, low = (s & 0xFFFFFFFFu) * distance;
    return (high + (low >> 32)) >> (FW_RAMP_FRACTION_BITS - FRACTION_BITS - 32);
}

// The parabola through the ways at ticks 0, 128, 256 of a segment, all less the way at 0: way(u) = u (b + c u) / 256.
struct parabola {
    int32_t b, c; // c: per 128 ticks
};

static int64_t parabola_at(struct parabola p, uint32_t u) {
    return (int64_t)(p.b + ((p.c * (int32_t)u) >> HALF_BITS)) * (int32_t)u;
}

// First tick in (low, 256] at which the way has come to `wanted`, which it has at tick 256 and not yet at `low`. With
// the mean speed up to a guess near it, the way over that speed is right or next to it, but for the first steps from
// rest; bisection catches those.
__attribute__((noinline)) static uint32_t crossing(struct parabola p, uint32_t low, uint32_t guess, int32_t wanted) {
    enum { PROBES = 4 };
    const int64_t target = (int64_t)wanted << (HALF_BITS + 1);
    uint32_t high = FW_SEGMENT_TICKS;
    const int32_t mean = p.b + ((p.c * (int32_t)(guess < high ? guess : high)) >> HALF_BITS);
    uint32_t u = mean >= FW_SEGMENT_TICKS ? (uint32_t)wanted / ((uint32_t)mean / FW_SEGMENT_TICKS) + 1 : HALF;
    for (unsigned probes = 0; high - low > 1; probes++) {
        if (u >= high)
            u = high - 1;
        if (u <= low)
            u = low + 1;
        if (probes >= PROBES)
            u = (low + high) / 2;
        if (parabola_at(p, u) >= target)
            high = u--;
        else
            low = u++;
    }
    return high;
}

// Of a slow axis, or one at rest: the next two steps are looked for without a guess.
static void forget_stride(struct fw_stepgen *g, unsigned axis) {
    g->stride[axis] = 4 * FW_SEGMENT_TICKS;
    g->guess[axis] = FW_SEGMENT_TICKS;
}

// What the steps of one axis in one segment have in common, and where they have got to.
struct course {
    struct parabola p;
    int32_t wanted, reached; // way at the next step and at the end of the segment
    uint32_t tick, stride, guess;
};

static inline void put_step(struct course *c, struct fw_stepgen *g, unsigned bit) {
    const unsigned tick = c->tick - 1;
    g->rise[tick] = (uint8_t)(g->rise[tick] | bit);
    g->occupied[tick / 32] |= 0x80000000u >> (tick % 32);
    c->wanted += (int32_t)STEP;
}

// At full speed, without a look at the parabola: a step's interval differs from the one before, which the guess is made
// with, by at most a tick (4e6 steps/s^2, 64 ticks), so that the mean speed up to the guess is off by less than 2e-4 of
// it, and the tick by 0.05.
static struct course fast_steps(struct course c, struct fw_stepgen *g, unsigned bit) {
    while (c.wanted <= c.reached && c.stride <= FAST_STRIDE) {
        const int32_t mean = c.p.b + ((c.p.c * (int32_t)c.guess) >> HALF_BITS);
        uint32_t tick = (uint32_t)c.wanted / ((uint32_t)mean / FW_SEGMENT_TICKS) + 1;
        tick = tick > c.tick ? tick : c.tick + 1;
        c.tick = tick < FW_SEGMENT_TICKS ? tick : FW_SEGMENT_TICKS;
        c.stride += c.tick - c.guess; // wraps and comes right: the guess was the step before and the stride before
        c.guess = c.tick + c.stride;
        put_step(&c, g, bit);
    }
    return c;
}

static void slow_step(struct course *c, struct fw_stepgen *g, unsigned bit) {
    c->tick = crossing(c->p, c->tick, c->guess, c->wanted);
    c->stride += c->tick - c->guess;
    c->guess = c->tick + c->stride;
    put_step(c, g, bit);
}

static void produce_axis(struct fw_stepgen *g, struct fw_segment *segment, unsigned axis, uint64_t middle_s,
                         uint64_t end_s) {
    const uint64_t from = g->way_at[axis], middle = way(g->distance[axis], middle_s),
                   to = way(g->distance[axis], end_s);
    g->way_at[axis] = to;
    if (to < g->threshold[axis]) {
        forget_stride(g, axis);
        return;
    }
    const int32_t first = (int32_t)(middle - from), second = (int32_t)(to - middle),
                  wanted = (int32_t)(g->threshold[axis] - from);
    struct course c = {.p = {3 * first - second, second - first},
                       .wanted = wanted,
                       .reached = (int32_t)(to - from),
                       .stride = g->stride[axis],
                       .guess = g->guess[axis]};
    while (c.wanted <= c.reached) {
        c = fast_steps(c, g, 1u << axis);
        if (c.wanted <= c.reached)
            slow_step(&c, g, 1u << axis);
    }
    g->stride[axis] = c.stride;
    g->guess[axis] = c.guess > FW_SEGMENT_TICKS ? c.guess - FW_SEGMENT_TICKS : 0;
    const uint32_t way_in = (uint32_t)(c.wanted - wanted);
    g->threshold[axis] += way_in;
    segment->steps[axis] = (uint8_t)(way_in / STEP);
}

// The list of a segment being written. The pulses that are up are kept beside it: this loop is half of the producer.
struct list {
    uint16_t *to;
    int32_t next;        // the tick after the last event
    int32_t fall, alone; // pulses that are up may fall from the one tick on (NEVER: none is), and must by the other
    uint32_t up;         // their axes
};
#define NEVER INT32_MAX

static inline void put_event(struct list *list, int32_t tick, uint32_t edges) {
    *list->to++ = (uint16_t)(edges << 8 | (uint32_t)(tick - list->next));
    list->next = tick + 1;
}

static inline uint32_t take_falls(struct fw_stepgen *g, struct list *list) {
    const uint32_t falling = list->up << 4;
    list->up = g->later.axes;
    list->fall = NEVER;
    if (list->up != 0) { // rare: see note_rise
        list->fall = g->later.fall;
        list->alone = g->later.alone;
        g->later.axes = 0;
    }
    return falling;
}

// All that is up falls together; a pulse that rose too late for that falls after it.
static inline void note_rise(struct fw_stepgen *g, struct list *list, int32_t tick, int32_t fall, uint32_t axes) {
    if (list->up == 0)
        list->alone = tick + FW_PULSE_MOST;
    if (fall <= list->alone) {
        list->up |= axes;
        list->fall = fall;
        return;
    }
    if (g->later.axes == 0)
        g->later.alone = tick + FW_PULSE_MOST;
    g->later.axes |= axes;
    g->later.fall = fall;
}

// Falling edges that go with an event at `tick`; those that cannot wait for it get events of their own.
static inline uint32_t falls_until(struct fw_stepgen *g, struct list *list, int32_t tick) {
    while (list->alone < tick) {
        const int32_t alone = list->alone;
        put_event(list, alone, take_falls(g, list));
        if (list->fall > tick)
            return 0;
    }
    return take_falls(g, list);
}

static struct fw_pulses in_next_segment(struct fw_pulses p) {
    if (p.axes == 0)
        return (struct fw_pulses){0, 0, 0};
    return (struct fw_pulses){p.fall - FW_SEGMENT_TICKS, p.alone - FW_SEGMENT_TICKS, p.axes};
}

// The edges of all axes in one order; clears the scratch.
static void write_list(struct fw_stepgen *g, struct fw_segment *segment) {
    struct list list = {segment->event, 0, g->up.axes != 0 ? g->up.fall : NEVER, g->up.alone, g->up.axes};
    const int32_t pulse = g->pulse;
    g->occupied[FW_OCCUPIED_WORDS - 1] |= 1; // the last tick
    for (int32_t first = 0; first < FW_SEGMENT_TICKS; first += 32) {
        uint32_t ticks = g->occupied[first / 32];
        g->occupied[first / 32] = 0;
        while (ticks != 0) {
            const int32_t bit = __builtin_clz(ticks), tick = first + bit;
            const uint32_t axes = g->rise[tick];
            g->rise[tick] = 0;
            ticks &= ~(0x80000000u >> bit);
            const uint32_t falling = list.fall <= tick ? falls_until(g, &list, tick) : 0;
            put_event(&list, tick, axes | falling);
            if (axes != 0)
                note_rise(g, &list, tick, tick + pulse, axes);
        }
    }
    segment->end = list.to;
    g->up = in_next_segment((struct fw_pulses){list.fall, list.alone, list.up});
    g->later = in_next_segment(g->later);
}

static void produce_segment(struct fw_stepgen *g) {
    struct fw_segment *segment = g->writing;
    segment->last = g->draining;
    if (g->draining) {
        g->producing = false;
    } else {
        const struct fw_ramp *ramp = g->ramp;
        const uint64_t middle_s = gonio_fw_ramp_at(ramp, g->time + 1), end_s = gonio_fw_ramp_at(ramp, g->time + 2);
        g->time += 2;
        for (unsigned axis = 0; axis < FW_AXES; axis++)
            if (g->distance[axis] != 0)
                produce_axis(g, segment, axis, middle_s, end_s);
        g->draining = g->time >= ramp->duration;
    }
    write_list(g, segment);
}

static void book_segment(struct fw_stepgen *g, struct fw_segment *segment) {
    for (unsigned axis = 0; axis < FW_AXES; axis++) {
        const int64_t steps = segment->steps[axis];
        segment->steps[axis] = 0;
        g->position[axis] += (g->down >> axis & 1) != 0 ? -steps : steps;
    }
}

void gonio_fw_stepgen_book(struct fw_stepgen *g) {
    for (unsigned i = 0; i < FW_SEGMENTS; i++)
        if (!g->segment[i].ready)
            book_segment(g, &g->segment[i]);
}

void gonio_fw_stepgen_produce(struct fw_stepgen *g) {
    while (g->producing && !g->writing->ready) {
        book_segment(g, g->writing);
        produce_segment(g);
        g->writing->ready = true;
        g->writing = g->writing->other;
    }
}

void gonio_fw_stepgen_prepare(struct fw_stepgen *g, const struct fw_ramp *ramp, const uint32_t distance[FW_AXES],
                              uint8_t down, uint8_t pulse) {
    gonio_fw_stepgen_book(g); // in the old directions
    g->ramp = ramp;
    g->down = down;
    g->pulse = pulse;
    g->time = 0;
    for (unsigned axis = 0; axis < FW_AXES; axis++) {
        g->distance[axis] = distance[axis];
        g->way_at[axis] = 0;
        forget_stride(g, axis);
        g->threshold[axis] = STEP / 2;
    }
    for (unsigned i = 0; i < FW_SEGMENTS; i++)
        g->segment[i].other = &g->segment[(i + 1) % FW_SEGMENTS];
    g->reading = g->writing = &g->segment[0];
    g->underrun = g->draining = false;
    g->up.axes = g->later.axes = 0;
    g->producing = true;
    gonio_fw_stepgen_produce(g);
}

void gonio_fw_stepgen_start(struct fw_stepgen *g, uint32_t start) {
    // As if the other segment had just been left.
    g->due = start;
    g->reading = g->segment[0].other;
    g->reading->last = false;
    g->at = g->end = NULL;
    const bool other_ready = g->reading->ready;
    fw_stepgen_next(g);
    g->segment[0].other->ready = other_ready;
    g->running = true;
}

static void forget(struct fw_segment *segment, unsigned edges) {
    for (unsigned axis = 0; axis < FW_AXES; axis++)
        if ((edges >> axis & 1) != 0)
            segment->steps[axis]--;
}

void gonio_fw_stepgen_abort(struct fw_stepgen *g) {
    g->running = g->producing = false;
    forget(g->reading, g->edges); // found, not yet put out
    g->edges = 0;
    for (unsigned i = 0; i < FW_SEGMENTS; i++) {
        struct fw_segment *segment = &g->segment[i];
        if (segment->ready)
            for (const uint16_t *at = segment == g->reading ? g->at : segment->event; at < segment->end; at++)
                forget(segment, *at >> 8u);
        segment->ready = false;
    }
    g->up.axes = g->later.axes = 0;
    gonio_fw_stepgen_book(g);
}
