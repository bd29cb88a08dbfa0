#include "firmware/core/stepgen.h"

#include <stddef.h>

enum { FRACTION_BITS = 26, HALF = FW_SEGMENT_TICKS / 2, HALF_BITS = 7, FAST_STRIDE = 64 };
#define STEP ((uint64_t)1 << FRACTION_BITS)

// distance x s, 62 fraction bits -> 26.
static uint64_t way(uint32_t distance, uint64_t s) {
    const uint64_t high = (s >> 32) * distance, low = (s & 0xFFFFFFFFu) * distance;
    return (high + (low >> 32)) >> (FW_RAMP_FRACTION_BITS - FRACTION_BITS - 32);
}

static void set_edge(struct fw_segment *segment, unsigned tick, unsigned bits) {
    segment->edge[tick] = (uint8_t)(segment->edge[tick] | bits);
    segment->occupied[tick / 32] |= 0x80000000u >> (tick % 32);
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
    uint32_t tick, stride, guess, slots, steps;
};

// Put the edges of a step at c->tick into the segment. Falling edges note their place on the grid; one behind the end
// notes the first place instead, an event too many.
static inline void put_step(struct course *c, struct fw_segment *segment, unsigned bit, unsigned pulse) {
    const unsigned rise = c->tick - 1, fall = (rise + pulse) | FW_FALL_GRID;
    set_edge(segment, rise, bit);
    segment->edge[fall] = (uint8_t)(segment->edge[fall] | bit << 4);
    c->slots |= 1u << (fall / (FW_FALL_GRID + 1) & 31);
    c->wanted += (int32_t)STEP;
    c->steps++;
}

// At full speed, without a look at the parabola: a step's interval differs from the one before, which the guess is made
// with, by at most a tick (4e6 steps/s^2, 64 ticks), so that the mean speed up to the guess is off by less than 2e-4 of
// it, and the tick by 0.05.
static struct course fast_steps(struct course c, struct fw_segment *segment, unsigned bit, unsigned pulse) {
    while (c.wanted <= c.reached && c.stride <= FAST_STRIDE) {
        const int32_t mean = c.p.b + ((c.p.c * (int32_t)c.guess) >> HALF_BITS);
        uint32_t tick = (uint32_t)c.wanted / ((uint32_t)mean / FW_SEGMENT_TICKS) + 1;
        tick = tick > c.tick ? tick : c.tick + 1;
        c.tick = tick < FW_SEGMENT_TICKS ? tick : FW_SEGMENT_TICKS;
        c.stride += c.tick - c.guess; // wraps and comes right: the guess was the step before and the stride before
        c.guess = c.tick + c.stride;
        put_step(&c, segment, bit, pulse);
    }
    return c;
}

static void slow_step(struct course *c, struct fw_segment *segment, unsigned bit, unsigned pulse) {
    c->tick = crossing(c->p, c->tick, c->guess, c->wanted);
    c->stride += c->tick - c->guess;
    c->guess = c->tick + c->stride;
    put_step(c, segment, bit, pulse);
}

// Returns the places on the grid where falling edges are.
static uint32_t produce_axis(struct fw_stepgen *g, struct fw_segment *segment, unsigned axis, uint64_t middle_s,
                             uint64_t end_s) {
    const uint64_t from = g->at[axis], middle = way(g->distance[axis], middle_s), to = way(g->distance[axis], end_s);
    g->at[axis] = to;
    if (to < g->threshold[axis]) {
        forget_stride(g, axis);
        return 0;
    }
    const int32_t first = (int32_t)(middle - from), second = (int32_t)(to - middle);
    struct course c = {.p = {3 * first - second, second - first},
                       .wanted = (int32_t)(g->threshold[axis] - from),
                       .reached = (int32_t)(to - from),
                       .stride = g->stride[axis],
                       .guess = g->guess[axis]};
    while (c.wanted <= c.reached) {
        c = fast_steps(c, segment, 1u << axis, g->pulse);
        if (c.wanted <= c.reached)
            slow_step(&c, segment, 1u << axis, g->pulse);
    }
    g->stride[axis] = c.stride;
    g->guess[axis] = c.guess > FW_SEGMENT_TICKS ? c.guess - FW_SEGMENT_TICKS : 0;
    g->threshold[axis] += c.steps * STEP;
    segment->steps[axis] = (uint8_t)c.steps;
    return c.slots;
}

static void begin_segment(struct fw_stepgen *g, struct fw_segment *segment) {
    for (unsigned i = 0; i < FW_OCCUPIED_WORDS; i++)
        segment->occupied[i] = 0;
    if (g->carry != 0)
        set_edge(segment, FW_FALL_GRID, g->carry);
    g->carry = 0;
    set_edge(segment, FW_SEGMENT_TICKS - 1, 0);
    segment->last = g->draining;
}

static void produce_segment(struct fw_stepgen *g) {
    struct fw_segment *segment = g->writing;
    begin_segment(g, segment);
    if (g->draining) {
        g->producing = false;
        return;
    }
    const struct fw_ramp *ramp = g->ramp;
    const uint64_t middle_s = fw_ramp_at(ramp, g->time + 1), end_s = fw_ramp_at(ramp, g->time + 2);
    g->time += 2;
    uint32_t slots = 0;
    for (unsigned axis = 0; axis < FW_AXES; axis++)
        if (g->distance[axis] != 0)
            slots |= produce_axis(g, segment, axis, middle_s, end_s);
    for (unsigned i = 0; i < FW_OCCUPIED_WORDS; i++, slots >>= 4) // four places a word: bits 24, 16, 8 and 0
        segment->occupied[i] |= (slots & 1) << 24 | (slots & 2) << 15 | (slots & 4) << 6 | (slots & 8) >> 3;
    g->carry = segment->edge[FW_SEGMENT_TICKS + FW_FALL_GRID];
    segment->edge[FW_SEGMENT_TICKS + FW_FALL_GRID] = 0;
    g->draining = g->time >= ramp->duration;
}

static void book_segment(struct fw_stepgen *g, struct fw_segment *segment) {
    for (unsigned axis = 0; axis < FW_AXES; axis++) {
        const int64_t steps = segment->steps[axis];
        segment->steps[axis] = 0;
        g->position[axis] += (g->down >> axis & 1) != 0 ? -steps : steps;
    }
}

void fw_stepgen_book(struct fw_stepgen *g) {
    for (unsigned i = 0; i < FW_SEGMENTS; i++)
        if (!g->segment[i].ready)
            book_segment(g, &g->segment[i]);
}

void fw_stepgen_produce(struct fw_stepgen *g) {
    while (g->producing && !g->writing->ready) {
        book_segment(g, g->writing);
        produce_segment(g);
        g->writing->ready = true;
        g->writing = g->writing->other;
    }
}

void fw_stepgen_prepare(struct fw_stepgen *g, const struct fw_ramp *ramp, const uint32_t distance[FW_AXES],
                        uint8_t down, uint8_t pulse) {
    fw_stepgen_book(g); // in the old directions
    g->ramp = ramp;
    g->down = down;
    g->pulse = pulse;
    g->time = 0;
    for (unsigned axis = 0; axis < FW_AXES; axis++) {
        g->distance[axis] = distance[axis];
        g->at[axis] = 0;
        forget_stride(g, axis);
        g->threshold[axis] = STEP / 2;
    }
    for (unsigned i = 0; i < FW_SEGMENTS; i++)
        g->segment[i].other = &g->segment[(i + 1) % FW_SEGMENTS];
    g->reading = g->writing = &g->segment[0];
    g->underrun = g->draining = false;
    g->producing = true;
    fw_stepgen_produce(g);
}

void fw_stepgen_start(struct fw_stepgen *g, uint32_t start) {
    // As if the other segment had just been left.
    g->first = start + 1 - 32;
    g->reading = g->segment[0].other;
    g->reading->last = false;
    g->pending = 0;
    g->word = g->end_word = NULL;
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

void fw_stepgen_abort(struct fw_stepgen *g) {
    g->running = g->producing = false;
    forget(g->reading, g->edges); // found, not yet put out
    g->edges = 0;
    for (unsigned i = 0; i < FW_SEGMENTS; i++) {
        struct fw_segment *segment = &g->segment[i];
        for (unsigned tick = 0; segment->ready && tick < FW_SEGMENT_TICKS; tick++) {
            forget(segment, segment->edge[tick]);
            segment->edge[tick] = 0;
        }
        segment->ready = false;
    }
    g->carry = 0;
    fw_stepgen_book(g);
}
