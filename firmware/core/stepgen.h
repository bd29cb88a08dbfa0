// SPDX-License-Identifier: BSD-3-Clause
// Step generator: from a ramp to the edges on the step outputs, each at its own tick.
//
// Two interrupts share the work. The producer (gonio_fw_stepgen_produce, low priority) works out a segment of 256 ticks
// ahead in which tick each axis passes the middle between two steps, brings the edges of all axes into one order and
// writes them down as a list of events. The consumer (fw_stepgen_next, in the board's step timer interrupt) only puts a
// byte on the pins and takes the next event from the list: so edges one tick apart are still on time, however many axes
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
    // A falling edge goes with the next rising one of another axis after the shortest pulse, and costs no event of its
    // own; alone only when none has come this many ticks after it rose.
    FW_PULSE_MOST = 14,
    // Steps of an axis are at least 15 ticks apart: 18 rising edges an axis, falling ones alone, and the end.
    FW_SEGMENT_EVENTS = 4 * 18 + FW_SEGMENT_TICKS / 7 + 2
};

// The edges of one segment, in order. Low byte: ticks since the event before, less one; high byte: edges, its low
// nibble steps up, its high nibble back down. The last tick of a segment is always an event.
struct fw_segment {
    uint16_t event[FW_SEGMENT_EVENTS];
    uint16_t *end;
    uint8_t steps[FW_AXES]; // rising edges in it, not yet booked
    bool last;
    volatile bool ready; // set by the producer, cleared by the consumer
    struct fw_segment *other;
};

// Pulses that are up, and fall together: from tick `fall` of the segment on, by `alone` at the latest.
struct fw_pulses {
    int32_t fall, alone;
    uint32_t axes; // 0: none
};

struct fw_stepgen {
    // consumer: the next event, and where the one after stands
    uint32_t due;       // tick of the next event
    uint16_t *at, *end; // behind it in the list; the list's end
    struct fw_segment *reading;
    uint8_t edges; // of the next event
    volatile bool running;
    volatile bool underrun;
    // producer
    bool producing; // ticks are still to be worked out
    bool draining;  // one more segment for the falling edges of the last
    struct fw_segment *writing;
    uint8_t pulse;
    uint8_t down;               // axes that count down
    struct fw_pulses up, later; // between segments; those that fall after the others
    uint32_t time;              // of the ramp, half segments
    const struct fw_ramp *volatile ramp;
    uint32_t distance[FW_AXES];  // steps at s = 1
    uint32_t stride[FW_AXES];    // ticks between the last two steps
    uint32_t guess[FW_AXES];     // tick of the segment at which the next step may be due
    uint64_t way_at[FW_AXES];    // way at `time`, steps with 26 fraction bits
    uint64_t threshold[FW_AXES]; // way at which the next step is due
    int64_t position[FW_AXES];   // booked
    struct fw_segment segment[FW_SEGMENTS];
    // scratch of the producer: rising edges by tick, and in which ticks some are (bit 31 - n % 32 of word n / 32)
    uint32_t occupied[FW_OCCUPIED_WORDS];
    uint8_t rise[FW_SEGMENT_TICKS];
};

// Prepare a move of `distance` steps (absolute values) along `ramp`, axes in `down` counting down, pulses of at least
// `pulse` (1 to 7) ticks. Two segments are worked out at once; the caller then sets the directions and calls
// gonio_fw_stepgen_start. Not while running.
void gonio_fw_stepgen_prepare(struct fw_stepgen *g, const struct fw_ramp *ramp, const uint32_t distance[FW_AXES],
                              uint8_t down, uint8_t pulse);
// Let the prepared move begin at tick `start`; the first event is then due at g->due.
void gonio_fw_stepgen_start(struct fw_stepgen *g, uint32_t start);
// Work out the segments that are free; the board calls it from a low priority interrupt after fw_stepgen_next asked for
// it.
void gonio_fw_stepgen_produce(struct fw_stepgen *g);
// Add the steps of segments that were left to the positions. Caller keeps the producer out.
void gonio_fw_stepgen_book(struct fw_stepgen *g);
// After the board stopped the step timer: forget the edges that did not happen and book those that did. Caller keeps
// the producer out.
void gonio_fw_stepgen_abort(struct fw_stepgen *g);

// What a caller of fw_stepgen_next has to do.
enum fw_step_action {
    FW_STEP_ARM = 0,     // interrupt again at g->due
    FW_STEP_PRODUCE = 1, // the same, and let the producer run
    FW_STEP_END = 2      // stop the timer
};

// From the last event of a segment to the other; false: there is none.
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
    g->at = segment->event;
    g->end = segment->end;
    return true;
}

// After g->edges went to the pins: the next event. An edge one tick behind is still on time only if this is short.
static inline enum fw_step_action fw_stepgen_next(struct fw_stepgen *g) {
    enum fw_step_action action = FW_STEP_ARM;
    if (g->at == g->end) {
        if (!fw_stepgen_leave(g))
            return FW_STEP_END;
        action = FW_STEP_PRODUCE;
    }
    const unsigned event = *g->at++;
    g->due += (event & 255) + 1;
    g->edges = (uint8_t)(event >> 8);
    return action;
}

#endif
