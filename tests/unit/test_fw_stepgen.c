// SPDX-License-Identifier: BSD-3-Clause
// Every step edge against the exact time of its step.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "firmware/core/stepgen.h"
#include "tests/unit/fw_reference.h"

enum { PULSE = 4 };
#define START 0xFFFFFF00u // the clock wraps under way

struct run {
    uint32_t steps[FW_AXES];
    long double worst;      // tick error of a rising edge
    uint32_t last[FW_AXES]; // tick of the last rising edge
    unsigned high;          // pins
};

static void check_edges(struct run *run, const struct fw_stepgen *g, const struct reference *reference) {
    const uint32_t tick = g->due - START;
    for (unsigned i = 0; i < FW_AXES; i++) {
        if ((g->edges >> i & 1) != 0) {
            assert_int_equal(run->high >> i & 1, 0);
            const long double wanted = reference_when(reference, (run->steps[i] + 0.5L) / (long double)g->distance[i]);
            // A step leaves with the first tick at or after its time: half a tick late in the mean, the same for all.
            const long double error = fabsl((long double)tick - 0.5L - wanted);
            if (error > run->worst)
                run->worst = error;
            if (run->steps[i]++ > 0)
                assert_true(tick - run->last[i] >= 15);
            run->last[i] = tick;
        }
        if ((g->edges >> (4 + i) & 1) != 0) {
            assert_int_equal(run->high >> i & 1, 1);
            assert_in_range(tick - run->last[i], g->pulse, FW_PULSE_MOST);
        }
    }
    run->high = (run->high | (g->edges & 15u)) & ~(g->edges >> 4u);
}

static struct run follow(struct fw_stepgen *g, const struct fw_ramp_limits *limits, const uint32_t distance[FW_AXES],
                         uint8_t down, uint8_t pulse) {
    struct fw_ramp ramp;
    assert_true(gonio_fw_ramp_plan(&ramp, limits));
    const struct reference reference = reference_of(&ramp);
    struct run run = {0};
    gonio_fw_stepgen_prepare(g, &ramp, distance, down, pulse);
    gonio_fw_stepgen_start(g, START);
    for (enum fw_step_action action = FW_STEP_ARM; action != FW_STEP_END;) {
        check_edges(&run, g, &reference);
        const uint32_t before = g->due;
        action = fw_stepgen_next(g);
        if (action != FW_STEP_END)
            assert_true(g->due != before && g->reading->end <= g->reading->event + FW_SEGMENT_EVENTS);
        if (action == FW_STEP_PRODUCE)
            gonio_fw_stepgen_produce(g);
    }
    gonio_fw_stepgen_book(g);
    assert_false(g->underrun);
    assert_int_equal(run.high, 0);
    for (unsigned i = 0; i < FW_AXES; i++)
        assert_int_equal(run.steps[i], distance[i]);
    return run;
}

static void every_edge_within_a_tick(void **state) {
    (void)state;
    // speed, acceleration, jerk in steps/s^n of an axis that goes `way` steps
    const struct {
        double speed, acceleration, jerk;
        uint32_t way;
    } cases[] = {{40000, 1e6, 1e8, 8000}, {62500, 4e6, 4e9, 4000}, {62500, 4e6, 0, 3000}, {40000, 2e5, 0, 6000},
                 {1000, 2000, 8000, 500}, {3, 10, 0, 9},           {0.5, 1, 1, 3},        {4000, 1e5, 1e7, 1},
                 {62500, 4e6, 4e9, 2},    {20000, 4e6, 4e9, 3000}};
    for (unsigned i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const double d = cases[i].way;
        const struct fw_ramp_limits limits = {cases[i].speed / d, cases[i].acceleration / d, cases[i].jerk / d};
        const uint32_t distance[FW_AXES] = {cases[i].way, cases[i].way * 2 / 3, 1, 0};
        struct fw_stepgen g;
        memset(&g, 0, sizeof g);
        const struct run run = follow(&g, &limits, distance, 2, PULSE);
        if (run.worst > 1.0L)
            fail_msg("case %u: %f ticks", i, (double)run.worst);
        assert_true(g.position[0] == (int64_t)distance[0] && g.position[1] == -(int64_t)distance[1]);
        assert_true(g.position[2] == (int64_t)distance[2] && g.position[3] == 0);
    }
}

// Four axes at nearly the same full speed: their edges meet in every phase, bursts of one a tick among them. Every
// pulse has its length, and none is up when its axis steps again.
static void edges_meet_in_every_phase(void **state) {
    (void)state;
    const uint32_t distances[][FW_AXES] = {
        {6006, 6004, 6002, 6000}, {6000, 5990, 5970, 5900}, {6000, 3001, 2003, 1507}};
    for (uint8_t pulse = 1; pulse <= 7; pulse += 3) {
        for (unsigned i = 0; i < sizeof distances / sizeof *distances; i++) {
            const double d = distances[i][0];
            const struct fw_ramp_limits limits = {62500 / d, 4e6 / d, 0};
            struct fw_stepgen g;
            memset(&g, 0, sizeof g);
            const struct run run = follow(&g, &limits, distances[i], 0, pulse);
            assert_true(run.worst <= 1.0L);
        }
    }
}

static void abort_counts_what_happened(void **state) {
    (void)state;
    const uint32_t distance[FW_AXES] = {10000, 6500, 7, 7500};
    const struct fw_ramp_limits limits = {2.0, 50.0, 5000.0};
    struct fw_ramp ramp;
    assert_true(gonio_fw_ramp_plan(&ramp, &limits));
    for (unsigned events = 0; events < 20000; events += 1999) {
        struct fw_stepgen g;
        memset(&g, 0, sizeof g);
        int64_t seen[FW_AXES] = {0};
        gonio_fw_stepgen_prepare(&g, &ramp, distance, 5, PULSE);
        gonio_fw_stepgen_start(&g, START);
        for (unsigned n = 0; n < events; n++) {
            for (unsigned i = 0; i < FW_AXES; i++)
                seen[i] += (g.edges >> i & 1) == 0 ? 0 : (5 >> i & 1) != 0 ? -1 : 1;
            if (fw_stepgen_next(&g) == FW_STEP_PRODUCE)
                gonio_fw_stepgen_produce(&g);
        }
        gonio_fw_stepgen_abort(&g);
        for (unsigned i = 0; i < FW_AXES; i++)
            assert_true(g.position[i] == seen[i]);
        // It can begin anew from there, with clean tables.
        const struct run run = follow(&g, &limits, distance, 0, PULSE);
        assert_true(run.worst <= 1.0L);
    }
}

static void underrun_shows(void **state) {
    (void)state;
    const uint32_t distance[FW_AXES] = {1000, 0, 0, 0};
    const struct fw_ramp_limits limits = {2.0, 50.0, 5000.0};
    struct fw_ramp ramp;
    struct fw_stepgen g;
    memset(&g, 0, sizeof g);
    assert_true(gonio_fw_ramp_plan(&ramp, &limits));
    gonio_fw_stepgen_prepare(&g, &ramp, distance, 0, PULSE);
    gonio_fw_stepgen_start(&g, START);
    while (fw_stepgen_next(&g) != FW_STEP_END) // the producer never comes
        assert_true(g.due - START <= 2 * FW_SEGMENT_TICKS);
    assert_true(g.underrun && !g.running);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_edge_within_a_tick),
                                       cmocka_unit_test(edges_meet_in_every_phase),
                                       cmocka_unit_test(abort_counts_what_happened), cmocka_unit_test(underrun_shows)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
