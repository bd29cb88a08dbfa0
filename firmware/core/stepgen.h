// Step generator: from a ramp to the edges on the step outputs, each at its own tick.
//
// Two interrupts share the work. The producer (fw_stepgen_produce, low priority) works out a segment of 256 ticks ahead
// in which tick each axis passes the middle between two steps, and notes rising and falling edges in a table with
// one byte a tick. The consumer (fw_stepgen_next, in the board's step timer interrupt) only puts a byte on the pins and
// looks up when the next one is due: a dozen instructions, so edges one tick apart are still on time, however many axes
// step. Per-axis interval queues would cost an interrupt an axis and delay each other.
#ifndef FW_STEPGEN_H
#define FW_STEPGEN_H

#include <stdbool.h>
#include <stdint.h>

#include "firmware/core/ramp.h"

enum {
    FW_AXES = 4,
    FW_SEGMENTS = 2,
    FW_PULSE_MAX = 7, // ticks
    FW_OCCUPIED_WORDS = FW_SEGMENT_TICKS / 32,
    FW_STEP_RATE_AXIS_MAX = 62500,     // steps/s: 16 ticks a step
    FW_END_EDGE = FW_SEGMENT_TICKS - 1 // every segment has an event here, so that it gets left
};

// The edges of one segment; edge[n] happens n + 1 ticks after its start: low nibble steps up, high nibble back down.
struct fw_segment {
    uint32_t occupied[FW_OCCUPIED_WORDS]; // bit 31 - n % 32 of word n / 32: edge[n] is an event
    uint8_t edge[FW_SEGMENT_TICKS];
    uint8_t steps[FW_AXES]; // rising edges in it, not yet booked
    bool last;
};

struct fw_stepgen {
    struct fw_segment segment[FW_SEGMENTS];
    volatile bool ready[FW_SEGMENTS]; // set by the producer, cleared by the consumer
    // consumer
    volatile bool running;
    volatile bool underrun;
    uint8_t reading;  // segment
    uint8_t edges;    // of the next event
    uint8_t word;     // of occupied, that of the next event
    uint32_t pending; // later events in that word
    uint32_t base;    // tick at which the segment began
    uint32_t due;     // tick of the next event
    // producer
    bool producing; // ticks are still to be worked out
    bool draining;  // one more segment for the falling edges of the last
    uint8_t writing;
    uint8_t pulse;
    uint8_t carry[FW_PULSE_MAX + 1]; // falling edges that belong to the next segment
    uint8_t down;                    // axes that count down
    uint32_t time;                   // of the ramp, half segments
    const struct fw_ramp *volatile ramp;
    uint32_t distance[FW_AXES];  // steps at s = 1
    uint64_t at[FW_AXES];        // way at `time`, steps with 26 fraction bits
    uint64_t threshold[FW_AXES]; // way at which the next step is due
    int64_t position[FW_AXES];   // booked
};

// Prepare a move of `distance` steps (absolute values) along `ramp`, axes in `down` counting down. Two segments are
// worked out at once; the caller then sets the directions and calls fw_stepgen_start. Not while running.
void fw_stepgen_prepare(struct fw_stepgen *g, const struct fw_ramp *ramp, const uint32_t distance[FW_AXES],
                        uint8_t down, uint8_t pulse);
// Let the prepared move begin at tick `start`; the first event is then due at g->due.
void fw_stepgen_start(struct fw_stepgen *g, uint32_t start);
// Work out the segments that are free; the board calls it from a low priority interrupt after fw_stepgen_next asked for
// it.
void fw_stepgen_produce(struct fw_stepgen *g);
// Add the steps of segments that were left to the positions. Caller keeps the producer out.
void fw_stepgen_book(struct fw_stepgen *g);
// After the board stopped the step timer: forget the edges that did not happen and book those that did. Caller keeps
// the producer out.
void fw_stepgen_abort(struct fw_stepgen *g);

static inline void fw_stepgen_find(struct fw_stepgen *g, struct fw_segment *segment) {
    uint32_t pending = g->pending;
    unsigned word = g->word;
    while (pending == 0)
        pending = segment->occupied[++word];
    const unsigned bit = (unsigned)__builtin_clz(pending), tick = 32 * word + bit;
    g->pending = pending & ~(0x80000000u >> bit);
    g->word = (uint8_t)word;
    g->edges = segment->edge[tick];
    segment->edge[tick] = 0;
    g->due = g->base + tick + 1;
}

// What a caller of fw_stepgen_next has to do.
enum fw_step_action {
    FW_STEP_ARM = 0,     // interrupt again at g->due
    FW_STEP_PRODUCE = 1, // the same, and let the producer run
    FW_STEP_END = 2      // stop the timer
};

// After g->edges went to the pins: find the next event.
static inline enum fw_step_action fw_stepgen_next(struct fw_stepgen *g) {
    struct fw_segment *segment = &g->segment[g->reading];
    if (g->due - g->base != FW_SEGMENT_TICKS) {
        fw_stepgen_find(g, segment);
        return FW_STEP_ARM;
    }
    const bool last = segment->last;
    g->ready[g->reading] = false;
    g->reading ^= 1;
    g->edges = 0;
    if (last || !g->ready[g->reading]) {
        g->underrun = !last;
        g->running = false;
        return FW_STEP_END;
    }
    g->base += FW_SEGMENT_TICKS;
    segment = &g->segment[g->reading];
    g->word = 0;
    g->pending = segment->occupied[0];
    fw_stepgen_find(g, segment);
    return FW_STEP_PRODUCE;
}

#endif
