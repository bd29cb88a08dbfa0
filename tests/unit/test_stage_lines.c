// SPDX-License-Identifier: BSD-3-Clause
// The stage of text commands against emulators of four families of motion controllers: homing, moves, limits, faults of
// the line and of the controller, stops, keep-out zones of axes that move each at its own pace.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "host/drivers/keep_out.h"
#include "host/drivers/stage_lines.h"
#include "tests/unit/line_emulators.h"
#include "tests/unit/near.h"
#include "tests/unit/scratch.h"

static const struct {
    emulator_kind kind;
    const char *table, *axes[4];
    double units_per_deg;
    bool unhomed_known, stops;
} families[] = {
    {EMULATOR_GRBL, "grbl", {"X", "Y", "Z", "A"}, 2, true, true},
    {EMULATOR_ESP, "esp", {"1", "2", "3", "4"}, 1, false, true},
    {EMULATOR_SMC, "smc100", {"1", "2", "3", "4"}, 1, true, true},
    {EMULATOR_ELLIPTEC, "elliptec", {"0", "1", "2", "3"}, 143360.0 / 360, false, false},
};
enum { FAMILIES = sizeof families / sizeof *families };

static gonio_stage_lines_config config_of(int family, const emulator *e) {
    gonio_stage_lines_config c;
    gonio_stage_lines_defaults(&c);
    snprintf(c.line.port, sizeof c.line.port, "tcp:127.0.0.1:%d", e->port);
    snprintf(c.table, sizeof c.table, "%s", families[family].table);
    c.line.timeout_ms = 100;
    for (int k = 0; k < 4; k++) {
        snprintf(c.axes[k].name, sizeof c.axes[k].name, "%s", families[family].axes[k]);
        c.axes[k].free.units_per_deg = families[family].units_per_deg;
        c.axes[k].free.min_deg = -100;
        c.axes[k].free.max_deg = 100;
    }
    return c;
}

static emulator *emulate(int family, double deg_per_s) {
    return emulator_start(families[family].kind, deg_per_s * families[family].units_per_deg);
}

static void shut_down(emulator *e) { emulator_stop(e); }

#define BENCH_STAGE gonio_stage_lines
#define BENCH_OPEN gonio_stage_lines_open
#define BENCH_CONFIG gonio_stage_lines_config
#define BENCH_EMULATOR emulator
#include "tests/unit/free_stage_bench.h"

static void goes_where_it_is_sent(void **state) {
    (void)state;
    for (int f = 0; f < FAMILIES; f++) {
        bench b = begin(f);
        gonio_error error = {0};
        home(&b);
        good(move(&b, 30.25, -45, 60, 12.5, &error), &error);
        stands_at(&b, 30.25, -45, 60, 12.5);
        assert_near(emulator_at(b.e, 0), 30.25 * families[f].units_per_deg, 0.5);
        good(move(&b, 30.25, -45, 60, 12.5, &error), &error); // where it stands
        good(move(&b, -10, 5, -1, 0, &error), &error);
        stands_at(&b, -10, 5, -1, 0);
        end(&b);
    }
}

static void homing_is_asked_for(void **state) {
    (void)state;
    for (int f = 0; f < FAMILIES; f++) {
        bench b = begin(f);
        gonio_error error = {0};
        assert_int_equal(move(&b, 1, 0, 0, 0, &error), GONIO_E_DEVICE);
        assert_non_null(strstr(error.message, "homed"));
        assert_int_equal(b.e->moves, 0);
        home(&b);
        good(move(&b, 1, 0, 0, 0, &error), &error);
        end(&b);
    }
}

static void limits_hold(void **state) {
    (void)state;
    for (int f = 0; f < FAMILIES; f++) {
        bench b = begin(f);
        gonio_error error = {0};
        home(&b);
        const int moves = b.e->moves;
        assert_int_equal(move(&b, 100.01, 0, 0, 0, &error), GONIO_E_RANGE);
        assert_int_equal(move(&b, 0, 0, -100.01, 0, &error), GONIO_E_RANGE);
        assert_non_null(strstr(error.message, "camera_theta"));
        assert_int_equal(b.e->moves, moves);
        end(&b);
    }
}

static void with_backlash(gonio_stage_lines_config *c) {
    c->axes[0].free.backlash_deg = 5;
    c->axes[0].free.min_deg = -10;
    c->axes[1].free.invert = true;
    c->axes[1].free.zero_deg = 3;
    c->axes[3].name[0] = 0;
    c->axes[3].free.fixed_deg = 7;
}

// The take-up passes the target, never a limit.
static void takes_up_within_limits(void **state) {
    (void)state;
    for (int f = 0; f < FAMILIES; f++) {
        bench b = begin_with(f, 2000, with_backlash);
        gonio_error error = {0};
        home(&b);
        good(move(&b, 20, -3, 0, 7, &error), &error);
        assert_near(emulator_at(b.e, 1), 6 * families[f].units_per_deg, 0.5); // dial = -user + zero
        b.e->lowest = 1e9;
        good(move(&b, 10, -3, 0, 7, &error), &error); // down: past it by 5, then up
        assert_near(b.e->lowest, 5 * families[f].units_per_deg, 0.5);
        stands_at(&b, 10, -3, 0, 7);
        b.e->lowest = 1e9;
        assert_int_equal(move(&b, -8, -3, 0, 7, &error), GONIO_E_RANGE); // would have to pass -10
        assert_non_null(strstr(error.message, "backlash"));
        assert_int_equal(move(&b, 10, -3, 0, 8, &error), GONIO_E_RANGE); // an axis that does not exist
        assert_true(b.e->lowest > 1e8);
        end(&b);
    }
}

// A controller that says that it is idle, or has arrived, until it begins.
static void a_late_start_is_waited_for(void **state) {
    (void)state;
    for (int f = 0; f < FAMILIES; f++) {
        bench b = begin_with(f, 400, with_backlash);
        gonio_error error = {0};
        home(&b);
        good(move(&b, 40, -3, 20, 7, &error), &error);
        b.e->lag_s = 0.1;
        b.e->lowest = 1e9;
        good(move(&b, 10, 10, -30, 7, &error), &error);
        stands_at(&b, 10, 10, -30, 7);
        assert_near(b.e->lowest, 5 * families[f].units_per_deg, 0.5); // not without the take-up
        home(&b);
        assert_near(emulator_at(b.e, 2), 0, 0.5);
        end(&b);
    }
}

static void faults_of_the_line_are_asked_again(void **state) {
    (void)state;
    for (int f = 0; f < FAMILIES; f++) {
        for (int kind = 0; kind < 2; kind++) {
            bench b = begin(f);
            gonio_error error = {0};
            home(&b);
            good(move(&b, 5, 0, 0, 0, &error), &error);
            (kind == 0 ? (b.e->mute = 2) : (b.e->garble = 2));
            stands_at(&b, 5, 0, 0, 0);
            b.e->mute = 1000;
            double rad[4];
            assert_int_equal(gonio_stage_lines.position(b.stage, rad, &error), GONIO_E_TIMEOUT);
            b.e->mute = 0;
            stands_at(&b, 5, 0, 0, 0);
            end(&b);
        }
    }
}

static void a_wrong_place_is_told(void **state) {
    (void)state;
    for (int f = 0; f < FAMILIES; f++) {
        bench b = begin(f);
        gonio_error error = {0};
        home(&b);
        b.e->lost = families[f].units_per_deg;
        assert_int_equal(move(&b, 20, 0, 0, 0, &error), GONIO_E_DEVICE);
        assert_non_null(strstr(error.message, "stands at"));
        end(&b);
    }
}

static void the_controllers_errors_are_told(void **state) {
    (void)state;
    gonio_error error = {0};
    for (int f = 1; f < FAMILIES; f++) {
        bench b = begin(f);
        home(&b);
        b.e->error = families[f].kind == EMULATOR_SMC ? 'C' : 7;
        assert_int_equal(move(&b, 20, 0, 0, 0, &error), GONIO_E_DEVICE);
        good(move(&b, 20, 0, 0, 0, &error), &error); // it was told once
        end(&b);
    }
    bench b = begin(0); // GRBL: an alarm in between takes the position away
    home(&b);
    b.e->homed = false;
    assert_int_equal(move(&b, 1, 0, 0, 0, &error), GONIO_E_DEVICE);
    end(&b);
}

// An interlock that opens in mid-move, or somebody who wants to stop, stops the axes; the next move goes on from there.
static void stopped_by(void (*change)(gonio_stage_lines_config *), gonio_status status, const char *says) {
    for (int f = 0; f < FAMILIES; f++) {
        strikes_after = 1000;
        bench b = begin_with(f, 100, change);
        gonio_error error = {0};
        home(&b);
        strikes_after = 4;
        assert_int_equal(move(&b, 90, 0, 0, 0, &error), status);
        assert_non_null(strstr(error.message, says));
        const double at = emulator_at(b.e, 0) / families[f].units_per_deg;
        if (families[f].stops) {
            assert_true(at < 80 && !emulator_moves(b.e));
        }
        strikes_after = 100000;
        b.e->speed = 2000 * families[f].units_per_deg;
        good(move(&b, 10, 0, 0, 0, &error), &error);
        end(&b);
    }
}

static void an_interlock_stops_it(void **state) {
    (void)state;
    stopped_by(with_door, GONIO_E_DEVICE, "door");
}

static void whoever_asks_stops_it(void **state) {
    (void)state;
    stopped_by(with_stop, GONIO_E_INTERRUPTED, "interrupted");
}

static void a_move_without_end_is_stopped(void **state) {
    (void)state;
    for (int f = 0; f < FAMILIES; f++) {
        bench b = begin_with(f, 2000, NULL);
        gonio_error error = {0};
        home(&b);
        b.e->speed = 1e-3;
        const double to[4] = {1, 0, 0, 0};
        assert_int_equal(gonio_stage_lines.move(b.stage, to, 1, NULL, 0.2, &error), GONIO_E_TIMEOUT);
        assert_true(!families[f].stops || !emulator_moves(b.e));
        end(&b);
    }
}

// The straight line passes the zone by, the box does not.
static void zones_count_for_the_box(void **state) {
    (void)state;
    bench b = begin(0);
    gonio_rig rig = {.stage = &gonio_stage_lines, .stage_device = b.stage};
    gonio_keep_out keep_out = {0};
    const int zone = gonio_keep_out_zone(&keep_out, "post");
    keep_out.zones[zone].minimum_deg[0] = 40;
    keep_out.zones[zone].maximum_deg[0] = 50;
    keep_out.zones[zone].minimum_deg[2] = 0;
    keep_out.zones[zone].maximum_deg[2] = 10;
    gonio_error error = {0};
    assert_int_equal(gonio_keep_out_guard(&keep_out, &rig, &error), GONIO_OK);
    good(rig.stage->home(rig.stage_device, 5, &error), &error);
    const double aside[4] = {gonio_radians(-20), 0, gonio_radians(5), 0};
    const double over[4] = {gonio_radians(45), 0, gonio_radians(90), 0};
    const double up[4] = {gonio_radians(-20), 0, gonio_radians(90), 0};
    good(rig.stage->move(rig.stage_device, aside, 1, NULL, 5, &error), &error);
    const int moves = b.e->moves;
    assert_int_equal(rig.stage->move(rig.stage_device, over, 1, NULL, 5, &error), GONIO_E_RANGE);
    assert_non_null(strstr(error.message, "post"));
    assert_int_equal(b.e->moves, moves);
    good(rig.stage->move(rig.stage_device, up, 1, NULL, 5, &error), &error);
    good(rig.stage->move(rig.stage_device, over, 1, NULL, 5, &error), &error);
    rig.stage->close(rig.stage_device);
    emulator_stop(b.e);
}

// A zone behind the target, into which only the take-up of backlash leads.
static void zones_hold_for_the_take_up(void **state) {
    (void)state;
    for (int f = 0; f < FAMILIES; f++) {
        bench b = begin_with(f, 2000, with_backlash);
        gonio_rig rig;
        gonio_error error = {0};
        guard(&rig, &b, 4, 8);
        double from[4] = {gonio_radians(30), 0, 0, gonio_radians(7)}, to[4] = {gonio_radians(10), 0, 0, from[3]};
        assert_int_equal(rig.stage->check(rig.stage_device, from, to, &error), GONIO_E_RANGE); // by way of 5 deg
        assert_non_null(strstr(error.message, "take-up"));
        to[0] = gonio_radians(14);
        good(rig.stage->check(rig.stage_device, from, to, &error), &error);
        from[0] = gonio_radians(9);
        to[0] = gonio_radians(10);
        good(rig.stage->check(rig.stage_device, from, to, &error), &error); // upwards: there is nothing to take up
        rig.stage->close(rig.stage_device);
        emulator_stop(b.e);
    }
}

// ---- tables ----

static void tables_are_checked(void **state) {
    (void)state;
    static const struct {
        const char *text, *words;
        int line;
    } bad[] = {
        {"home = H\nfly = 1\n", "unknown key 'fly'", 2},
        {"home\n", "expected key = value", 1},
        {"home = H\nmove = M\n", "needs home, move", 2},
        {"home = H\nmove = M\nstate = S\nidle = I\nposition = P\nposition_answer = x\n", "needs home, move", 6},
        {"number = octal\n", "number", 1},
    };
    gonio_lines_table table;
    gonio_error error;
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        char path[64];
        scratch_file(path, bad[k].text, strlen(bad[k].text));
        error = (gonio_error){.line = -1};
        assert_int_equal(gonio_lines_table_read(path, &table, &error), GONIO_E_INPUT);
        if (strstr(error.message, bad[k].words) == NULL || error.line != bad[k].line) {
            fail_msg("line %lld: %s; expected line %d '%s'", error.line, error.message, bad[k].line, bad[k].words);
        }
        unlink(path);
    }
    assert_int_equal(gonio_lines_table_read("grlb", &table, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.message, "grbl esp smc100 elliptec"));
    static const char own[] =
        "; mine\nend = \\r ; a comment\nhome = H{axis} && W\nmove = M[;{axis}{value}]\\x41\nstate = S\n"
        "idle = I*|J?\nposition = P\nposition_answer = *p={values}\nnumber = integer\n";
    char path[64];
    scratch_file(path, own, sizeof own - 1);
    assert_int_equal(gonio_lines_table_read(path, &table, &error), GONIO_OK);
    unlink(path);
    const gonio_lines_axes axes = {2, {"a", "b"}, {1.6, -3.2}};
    char command[GONIO_LINES_COMMAND], part[GONIO_LINES_TEXT];
    size_t n;
    assert_int_equal(gonio_lines_command(&table, table.move, &axes, 0, command, &n, &error), GONIO_OK);
    assert_int_equal(n, strlen("M;a2;b-3A\r"));
    assert_memory_equal(command, "M;a2;b-3A\r", n);
    assert_true(gonio_lines_part(table.home, 0, part) && gonio_lines_each(part));
    assert_true(gonio_lines_part(table.home, 1, part) && !gonio_lines_each(part) &&
                !gonio_lines_part(table.home, 2, part));
    assert_true(gonio_lines_match(table.idle, NULL, "Idle") && gonio_lines_match(table.idle, NULL, "J3"));
    assert_false(gonio_lines_match(table.idle, NULL, "J33"));
    double value;
    assert_true(gonio_lines_number_in(&table, table.position_answer, NULL, 1, "x p=1.5,-2,3", &value));
    assert_near(value, -2, 0);
    assert_false(gonio_lines_number_in(&table, table.position_answer, NULL, 3, "x p=1.5,-2,3", &value));
}

static void a_tape_plays_back(void **state) {
    (void)state;
    char path[64];
    scratch_file(path, "", 0);
    unlink(path);
    bench b = {emulator_start(EMULATOR_SMC, 2000), NULL, 2};
    gonio_stage_lines_config c = config_of(2, b.e);
    snprintf(c.record, sizeof c.record, "%s", path);
    gonio_error error = {0};
    good(gonio_stage_lines_open(&c, &around, &b.stage, &error), &error);
    stands_at(&b, 0, 0, 0, 0);
    end(&b);
    c.record[0] = 0;
    snprintf(c.replay, sizeof c.replay, "%s", path);
    c.line.port[0] = 0;
    good(gonio_stage_lines_open(&c, &around, &b.stage, &error), &error);
    stands_at(&b, 0, 0, 0, 0);
    gonio_stage_lines.close(b.stage);
    unlink(path);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(goes_where_it_is_sent),
        cmocka_unit_test(homing_is_asked_for),
        cmocka_unit_test(limits_hold),
        cmocka_unit_test(takes_up_within_limits),
        cmocka_unit_test(a_late_start_is_waited_for),
        cmocka_unit_test(faults_of_the_line_are_asked_again),
        cmocka_unit_test(a_wrong_place_is_told),
        cmocka_unit_test(the_controllers_errors_are_told),
        cmocka_unit_test(an_interlock_stops_it),
        cmocka_unit_test(whoever_asks_stops_it),
        cmocka_unit_test(a_move_without_end_is_stopped),
        cmocka_unit_test(zones_count_for_the_box),
        cmocka_unit_test(zones_hold_for_the_take_up),
        cmocka_unit_test(tables_are_checked),
        cmocka_unit_test(a_tape_plays_back),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
