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
    FW_OCCUPIED_WORDS = FW_SEGMENT_TICKS / 32,
    // Falling edges are put off to the end of an eighth of a word, where those of several axes meet: a pulse is up to 7
    // ticks longer than asked for, and there are a quarter fewer events at full speed.
    FW_FALL_GRID = 7
};

// The edges of one segment; edge[n] happens n + 1 ticks after its start: low nibble steps up, high nibble back down.
// The last tick of a segment is always an event, so that it gets left.
struct fw_segment {
    uint32_t occupied[FW_OCCUPIED_WORDS];              // bit 31 - n % 32 of word n / 32: edge[n] is an event
    uint8_t edge[FW_SEGMENT_TICKS + FW_FALL_GRID + 1]; // behind the end: falls that belong to the next segment
    uint8_t steps[FW_AXES];                            // rising edges in it, not yet booked
    bool last;
    volatile bool ready; // set by the producer, cleared by the consumer
    struct fw_segment *other;
};

struct fw_stepgen {
    // consumer: the next event, and where it looks for the one after
    uint32_t due;              // tick of the next event
    uint32_t pending;          // later events of the word it is in
    uint32_t first;            // tick of that word's first bit
    uint32_t *word, *end_word; // that word, and the last of the segment
    uint8_t *word_edges;       // edges of that word
    struct fw_segment *reading;
    uint8_t edges; // of the next event
    volatile bool running;
    volatile bool underrun;
    // producer
    bool producing; // ticks are still to be worked out
    bool draining;  // one more segment for the falling edges of the last
    struct fw_segment *writing;
    uint8_t pulse;
    uint8_t carry; // falling edges for the next segment
    uint8_t down;  // axes that count down
    uint32_t time; // of the ramp, half segments
    const struct fw_ramp *volatile ramp;
    uint32_t distance[FW_AXES];  // steps at s = 1
    uint32_t stride[FW_AXES];    // ticks between the last two steps
    uint32_t guess[FW_AXES];     // tick of the segment at which the next step may be due
    uint64_t at[FW_AXES];        // way at `time`, steps with 26 fraction bits
    uint64_t threshold[FW_AXES]; // way at which the next step is due
    int64_t position[FW_AXES];   // booked
    struct fw_segment segment[FW_SEGMENTS];
};

// Prepare a move of `distance` steps (absolute values) along `ramp`, axes in `down` counting down, pulses of at least
// `pulse` (1 to 7) ticks. Two segments are worked out at once; the caller then sets the directions and calls
// fw_stepgen_start. Not while running.
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

// What a caller of fw_stepgen_next has to do.
enum fw_step_action {
    FW_STEP_ARM = 0,     // interrupt again at g->due
    FW_STEP_PRODUCE = 1, // the same, and let the producer run
    FW_STEP_END = 2      // stop the timer
};

// From the last event of a segment to just before the first word of the other; false: there is none.
static inline bool fw_stepgen_leave(struct fw_stepgen *g) {
    struct fw_segment *old = g->reading, *segment = old->other;
    old->ready = false;
    g->edges = 0;
    g->reading = segment;
    if (old->last || !segment->ready) {
        g->underrun = !old->last;
        g->running = false;
        return false;
    }
    g->word = segment->occupied - 1;
    g->end_word = segment->occupied + FW_OCCUPIED_WORDS - 1;
    g->word_edges = segment->edge - 32;
    return true;
}

// After g->edges went to the pins: find the next event. An edge one tick behind is still on time only if this is short.
static inline enum fw_step_action fw_stepgen_next(struct fw_stepgen *g) {
    enum fw_step_action action = FW_STEP_ARM;
    uint32_t pending = g->pending;
    if (pending == 0) {
        if (g->word == g->end_word) {
            if (!fw_stepgen_leave(g))
                return FW_STEP_END;
            action = FW_STEP_PRODUCE;
        }
        uint32_t *word = g->word, first = g->first;
        uint8_t *edges = g->word_edges;
        do {
            word++;
            first += 32;
            edges += 32;
            pending = *word;
        } while (pending == 0);
        g->word = word;
        g->first = first;
        g->word_edges = edges;
    }
    const unsigned bit = (unsigned)__builtin_clz(pending);
    uint8_t *edge = g->word_edges + bit;
    g->pending = pending & ~(0x80000000u >> bit);
    g->due = g->first + bit;
    g->edges = *edge;
    *edge = 0;
    return action;
}

#endif
