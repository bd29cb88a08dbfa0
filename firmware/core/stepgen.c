#include "firmware/core/stepgen.h"

enum { FRACTION_BITS = 26, HALF = FW_SEGMENT_TICKS / 2, HALF_BITS = 7 };
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

static int64_t parabola_at(const struct parabola *p, uint32_t u) {
    return (int64_t)(p->b + ((p->c * (int32_t)u) >> HALF_BITS)) * (int32_t)u;
}

// First tick in (after, 256] at which the way has come to `wanted`, which it has at tick 256. The guess is the tick at
// the speed of the middle between: right or next to it, but for the first steps from rest.
static uint32_t crossing(const struct parabola *p, uint32_t after, int32_t wanted) {
    const int64_t target = (int64_t)wanted << (HALF_BITS + 1);
    uint32_t low = after, high = FW_SEGMENT_TICKS; // target is reached at high, not yet at low
    const int32_t mean = p->b + ((p->c * (int32_t)(after + 16)) >> HALF_BITS);
    uint32_t u = mean > 256 ? (uint32_t)wanted / ((uint32_t)mean >> (HALF_BITS + 1)) + 1 : HALF;
    for (unsigned tries = 0; high - low > 1; tries++) {
        if (tries >= 3 || u <= low || u >= high) {
            if (tries < 3 && u <= low)
                u = low + 1;
            else if (tries < 3)
                u = high - 1;
            else
                u = (low + high) / 2;
        }
        if (parabola_at(p, u) >= target)
            high = u--;
        else
            low = u++;
    }
    return high;
}

static void produce_axis(struct fw_stepgen *g, struct fw_segment *segment, unsigned axis, uint64_t middle_s,
                         uint64_t end_s) {
    const uint64_t from = g->at[axis], middle = way(g->distance[axis], middle_s), to = way(g->distance[axis], end_s);
    g->at[axis] = to;
    if (to < g->threshold[axis])
        return;
    const int32_t first = (int32_t)(middle - from), second = (int32_t)(to - middle);
    const struct parabola p = {3 * first - second, second - first};
    int32_t wanted = (int32_t)(g->threshold[axis] - from);
    const int32_t reached = (int32_t)(to - from);
    uint32_t tick = 0;
    unsigned steps = 0;
    for (; wanted <= reached; wanted += (int32_t)STEP) {
        tick = crossing(&p, tick, wanted);
        set_edge(segment, tick - 1, 1u << axis);
        const uint32_t fall = tick - 1 + g->pulse;
        if (fall < FW_SEGMENT_TICKS)
            set_edge(segment, fall, 16u << axis);
        else
            g->carry[fall - FW_SEGMENT_TICKS] |= (uint8_t)(16u << axis);
        steps++;
    }
    g->threshold[axis] += steps * STEP;
    segment->steps[axis] = (uint8_t)steps;
}

static void produce_segment(struct fw_stepgen *g) {
    struct fw_segment *segment = &g->segment[g->writing];
    for (unsigned i = 0; i < FW_OCCUPIED_WORDS; i++)
        segment->occupied[i] = 0;
    for (unsigned i = 0; i < FW_PULSE_MAX; i++) {
        if (g->carry[i] != 0)
            set_edge(segment, i, g->carry[i]);
        g->carry[i] = 0;
    }
    set_edge(segment, FW_END_EDGE, 0);
    segment->last = g->draining;
    if (g->draining) {
        g->producing = false;
        return;
    }
    const struct fw_ramp *ramp = g->ramp;
    const uint64_t middle_s = fw_ramp_at(ramp, g->time + 1), end_s = fw_ramp_at(ramp, g->time + 2);
    g->time += 2;
    for (unsigned axis = 0; axis < FW_AXES; axis++)
        if (g->distance[axis] != 0)
            produce_axis(g, segment, axis, middle_s, end_s);
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
        if (!g->ready[i])
            book_segment(g, &g->segment[i]);
}

void fw_stepgen_produce(struct fw_stepgen *g) {
    while (g->producing && !g->ready[g->writing]) {
        book_segment(g, &g->segment[g->writing]);
        produce_segment(g);
        g->ready[g->writing] = true;
        g->writing ^= 1;
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
        g->threshold[axis] = STEP / 2;
    }
    g->reading = g->writing = 0;
    g->underrun = g->draining = false;
    g->producing = true;
    fw_stepgen_produce(g);
}

void fw_stepgen_start(struct fw_stepgen *g, uint32_t start) {
    struct fw_segment *segment = &g->segment[0];
    g->base = start;
    g->word = 0;
    g->pending = segment->occupied[0];
    fw_stepgen_find(g, segment);
    g->running = true;
}

static void forget(struct fw_segment *segment, unsigned edges) {
    for (unsigned axis = 0; axis < FW_AXES; axis++)
        if ((edges >> axis & 1) != 0)
            segment->steps[axis]--;
}

void fw_stepgen_abort(struct fw_stepgen *g) {
    g->running = g->producing = false;
    forget(&g->segment[g->reading], g->edges); // found, not yet put out
    g->edges = 0;
    for (unsigned i = 0; i < FW_SEGMENTS; i++) {
        struct fw_segment *segment = &g->segment[i];
        for (unsigned tick = 0; g->ready[i] && tick < FW_SEGMENT_TICKS; tick++) {
            forget(segment, segment->edge[tick]);
            segment->edge[tick] = 0;
        }
        g->ready[i] = false;
    }
    for (unsigned i = 0; i <= FW_PULSE_MAX; i++)
        g->carry[i] = 0;
    fw_stepgen_book(g);
}
