// SPDX-License-Identifier: BSD-3-Clause
// Stage, lamp and monitor against the firmware's simulated machine over pty and TCP, on good and on bad lines.
#include "tests/unit/controller_rig.h"

static void check_handshake_and_motion(bool tcp) {
    start(tcp, 30, 1);
    open_stage();
    assert_int_equal(gonio_controller_identify(controller)->axes, 4);
    assert_int_equal(b.shared->motions, 0); // nothing moved so far
    gonio_error error = {0};
    double target[GONIO_AXES], at[GONIO_AXES];
    pose(30, 120, -45.125, 0, target);
    assert_int_equal(gonio_stage_modbus.move(stage, target, 1, &stamp, 10, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "not homed"));
    must(gonio_stage_modbus.home(stage, 30, &error), &error);
    // After homing every axis stands at its switch, outside the limits: one moves while the others stay there.
    must(gonio_stage_modbus.position(stage, at, &error), &error);
    at[2] = gonio_radians(10);
    must(gonio_stage_modbus.move(stage, at, 1, &stamp, 10, &error), &error);
    must(gonio_stage_modbus.move(stage, target, 1, &stamp, 10, &error), &error);
    must(gonio_stage_modbus.position(stage, at, &error), &error);
    assert_true(fabs(gonio_degrees(at[0]) - 30) < 1e-9 && fabs(gonio_degrees(at[1]) - 120) < 1e-9);
    assert_true(fabs(gonio_degrees(at[2]) + 45.13) < 0.0051); // to the next step
    pose(0, 400, 0, 0, target);
    assert_int_equal(gonio_stage_modbus.move(stage, target, 2, &stamp, 10, &error), GONIO_E_RANGE);
    assert_non_null(strstr(error.message, "light_phi"));
    double low, high;
    gonio_stage_modbus_limits(stage, 0, &low, &high);
    assert_true(fabs(low + 95) < 1e-9 && fabs(high - 95) < 1e-9);
    double drift[GONIO_AXES];
    must(gonio_stage_modbus.home(stage, 30, &error), &error);
    must(gonio_stage_modbus_audit(stage, drift, &error), &error);
    assert_int_equal(gonio_stage_modbus_lost_steps(stage), 0);
    stop();
}

static void test_rtu(void **state) {
    (void)state;
    check_handshake_and_motion(false);
}

static void test_tcp(void **state) {
    (void)state;
    check_handshake_and_motion(true);
}

static void test_zero_and_sign(void **state) {
    (void)state;
    start(true, 30, 1);
    axes.axes[0].zero_deg = 2;
    axes.axes[0].invert = true;
    open_stage();
    gonio_error error = {0};
    double target[GONIO_AXES], at[GONIO_AXES], low, high;
    must(gonio_stage_modbus.home(stage, 30, &error), &error);
    pose(30, 0, 0, 0, target);
    must(gonio_stage_modbus.move(stage, target, 1, &stamp, 10, &error), &error);
    assert_int_equal(b.shared->machine.core.registers.position[0], -2800); // dial = 2 - 30
    must(gonio_stage_modbus.position(stage, at, &error), &error);
    assert_true(fabs(gonio_degrees(at[0]) - 30) < 1e-9);
    gonio_stage_modbus_limits(stage, 0, &low, &high);
    assert_true(fabs(low + 93) < 1e-9 && fabs(high - 97) < 1e-9);
    stop();
}

// How far homing looks for a switch, and what it does with an axis that stands on its switch, go to the controller
// where they are given and stay what they are where not.
static void test_homing_parameters(void **state) {
    (void)state;
    start(true, 30, 1);
    const struct fw_registers *r = &b.shared->machine.core.registers;
    const uint32_t travel = r->home_travel[1];
    const uint16_t pressed = r->home_pressed[0];
    open_stage();
    assert_true(r->home_travel[1] == travel && r->home_pressed[0] == pressed);
    close_drivers();
    axes.home_pressed = 1;
    axes.axes[1].home_travel_deg = 0.05; // 5 steps, and the axis stands further from its switch
    open_stage();
    assert_true(r->home_travel[0] == travel && r->home_travel[1] == 5 && r->home_pressed[0] == 1);
    gonio_error error = {0};
    assert_int_equal(gonio_stage_modbus.home(stage, 30, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "HOME_MISSING"));
    close_drivers();
    axes.home_pressed = 0;
    axes.axes[1].home_travel_deg = 800;
    open_stage();
    assert_true(r->home_travel[1] == 80000 && r->home_pressed[0] == 0);
    must(gonio_stage_modbus.home(stage, 30, &error), &error);
    stop();
}

// The nominal duration against the firmware's own: the simulated machine in its own time.
static void test_duration(void **state) {
    (void)state;
    start(true, 30, 1);
    open_stage();
    static const double ways_deg[] = {0.02, 0.3, 1, 3, 10, 60, 180};
    for (size_t i = 0; i < sizeof ways_deg / sizeof *ways_deg; i++) {
        static struct machine m;
        gonio_machine_new(&m);
        gonio_machine_start(&m, FW_CAUSE_POWER);
        memcpy(&m.core.registers, &b.shared->machine.core.registers, sizeof m.core.registers);
        m.core.known = 15;
        m.core.registers.settle[0] = 0;
        m.core.registers.energise[0] = 0;
        double from[GONIO_AXES] = {0}, to[GONIO_AXES];
        pose(0, ways_deg[i], 0, 0, to);
        const int64_t target[FW_AXES] = {0, llround(ways_deg[i] * 100), 0, 0};
        const uint64_t start = m.now_us;
        assert_int_equal(gonio_machine_move(&m, 15, target), FW_REFUSAL_NONE);
        assert_true(gonio_machine_settle(&m, 60000000));
        const double real = (double)(m.now_us - start) * 1e-6;
        const double nominal = gonio_stage_modbus.duration_s(stage, from, to);
        if (!(fabs(nominal - real) < 0.05 * real + 0.01)) {
            fail_msg("%g deg: nominal %g s, the controller takes %g s", ways_deg[i], nominal, real);
        }
    }
    stop();
}

static void test_lamp_and_monitor(void **state) {
    (void)state;
    start(false, 30, 1);
    open_controller();
    void *lamp = NULL, *meter = NULL;
    gonio_error error = {0};
    must(gonio_lamp_modbus_open(controller, 0, &lamp, &error), &error);
    must(gonio_meter_modbus_open(controller, 2, 0.01, &meter, &error), &error);
    double waited = -1, dark = -1, bright = -1, sigma = -1;
    assert_int_equal(gonio_lamp_modbus.wait_ready(lamp, &stamp, 1, &waited, &error), GONIO_E_DEVICE);
    must(gonio_meter_modbus.read(meter, &stamp, 0, &dark, &sigma, &error), &error);
    must(gonio_lamp_modbus.set_level(lamp, 0.8, &error), &error);
    must(gonio_lamp_modbus.set_shutter(lamp, true, &error), &error);
    assert_int_equal(gonio_lamp_modbus.set_level(lamp, 1.5, &error), GONIO_E_RANGE);
    must(gonio_lamp_modbus.wait_ready(lamp, &stamp, 10, &waited, &error), &error);
    must(gonio_meter_modbus.read(meter, &stamp, 0.05, &bright, &sigma, &error), &error);
    assert_true(b.shared->machine.shutter);
    assert_int_equal(b.shared->machine.lamp, 8000);
    assert_true(bright > dark + 0.05);
    assert_true(sigma >= 0.01 * bright - 1e-12);
    // The lamp stays as it is when the program goes, and for longer than the dead-man would wait.
    gonio_lamp_modbus.close(lamp);
    gonio_meter_modbus.close(meter);
    close_drivers();
    usleep(500000); // 10 s of the controller's time
    assert_int_equal(b.shared->machine.lamp, 8000);
    assert_true(b.shared->machine.shutter);
    bench_stop(&b);
}

// A killed host: the controller stops by itself. Here the host is a process that moves and is killed in mid-move.
static void test_killed_host(void **state) {
    (void)state;
    start(true, 1, 1);
    config.deadman_s = 0.5;
    const pid_t host = bench_fork();
    if (host == 0) {
        axes.axes[1].speed_deg_per_s = 20;
        open_stage();
        double target[GONIO_AXES];
        b.shared->machine.core.known = 15; // homing would take longer than the test
        pose(0, 340, 0, 0, target);
        gonio_stage_modbus.move(stage, target, 1, &stamp, 60, NULL);
        _exit(0);
    }
    for (int i = 0; i < 2000 && b.shared->machine.core.state != FW_STATE_MOVING; i++) {
        usleep(2000);
    }
    assert_int_equal(b.shared->machine.core.state, FW_STATE_MOVING);
    kill(host, SIGKILL);
    waitpid(host, NULL, 0);
    for (int i = 0; i < 2000 && b.shared->machine.core.state != FW_STATE_ALARM; i++) {
        usleep(2000);
    }
    assert_int_equal(b.shared->machine.core.state, FW_STATE_ALARM);
    assert_int_equal(b.shared->machine.core.registers.alarm[0], FW_ALARM_DEADMAN);
    // Who looks at it changes nothing; the next host that holds the rig clears it, and nothing goes on by itself.
    open_controller();
    gonio_controller_status now;
    gonio_error error = {0};
    must(gonio_controller_read_status(controller, &now, &error), &error);
    assert_int_equal(now.state, CONTROLLER_STATE_ALARM);
    must(gonio_controller_claim(controller, &error), &error);
    must(gonio_controller_read_status(controller, &now, &error), &error);
    assert_int_equal(now.state, CONTROLLER_STATE_IDLE);
    const int64_t position = now.position[1];
    usleep(200000);
    must(gonio_controller_read_status(controller, &now, &error), &error);
    assert_int_equal(now.position[1], position);
    assert_non_null(strstr(events, "DEADMAN"));
    stop();
}

// The host is busy elsewhere for longer than the dead-man waits: it is fed. Hung for longer than feed_s: it is not.
static void test_feeding(void **state) {
    (void)state;
    start(true, 1, 1);
    config.deadman_s = 0.3;
    config.feed_s = 1;
    open_controller();
    gonio_error error = {0};
    must(gonio_controller_claim(controller, &error), &error);
    usleep(900000);
    assert_int_equal(b.shared->machine.core.state, FW_STATE_IDLE);
    usleep(1500000);
    assert_int_equal(b.shared->machine.core.state, FW_STATE_ALARM);
    gonio_controller_counts counts;
    gonio_controller_count(controller, &counts);
    assert_true(counts.feeds >= 4);
    stop();
}

static bool stop_now;
static bool cancelled(void *context) {
    (void)context;
    return stop_now;
}

static gonio_status pressed(void *device, gonio_error *error) {
    return *(bool *)device ? gonio_fail(error, GONIO_E_DEVICE, "interlock: door is active") : GONIO_OK;
}

static void test_stops_in_mid_move(void **state) {
    (void)state;
    start(true, 1, 1);
    config.cancelled = cancelled;
    const gonio_interlock_ops interlock = {.check = pressed};
    bool door = false;
    axes.interlock = &interlock;
    axes.interlock_device = &door;
    axes.axes[1].speed_deg_per_s = 20;
    open_stage();
    b.shared->machine.core.known = 15;
    gonio_error error = {0};
    double target[GONIO_AXES], at[GONIO_AXES];
    pose(0, 340, 0, 0, target);
    stop_now = true;
    assert_int_equal(gonio_stage_modbus.move(stage, target, 1, &stamp, 60, &error), GONIO_E_INTERRUPTED);
    stop_now = false;
    must(gonio_stage_modbus.position(stage, at, &error), &error);
    assert_true(gonio_degrees(at[1]) < 20);
    assert_int_equal(b.shared->machine.core.state, FW_STATE_IDLE); // stopped, position known
    assert_int_equal(b.shared->machine.core.known, 15);
    assert_int_equal(gonio_stage_modbus.move(stage, target, 2, &stamp, 0.2, &error), GONIO_E_TIMEOUT);
    assert_int_equal(b.shared->machine.core.state, FW_STATE_IDLE);
    door = true;
    const int64_t motions = b.shared->motions;
    assert_int_equal(gonio_stage_modbus.move(stage, target, 3, &stamp, 60, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "door"));
    assert_int_equal(b.shared->motions, motions); // not even begun
    // The controller's own emergency stop, pressed in mid-move.
    door = false;
    const pid_t presser = bench_fork();
    if (presser == 0) {
        while (b.shared->machine.core.state != FW_STATE_MOVING) {
            usleep(1000);
        }
        usleep(200000);
        b.shared->machine.forced_on |= 1 << FW_CONTACT_estop;
        _exit(0);
    }
    const gonio_status status = gonio_stage_modbus.move(stage, target, 4, &stamp, 60, &error);
    waitpid(presser, NULL, 0);
    assert_int_equal(status, GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "alarm 1 EMERGENCY"));
    stop();
}

static void test_restart_is_noticed(void **state) {
    (void)state;
    start(true, 30, 1);
    open_controller();
    gonio_controller_status now;
    gonio_error error = {0};
    must(gonio_controller_read_status(controller, &now, &error), &error);
    usleep(50000);
    must(gonio_controller_read_status(controller, &now, &error), &error);
    b.shared->restart = 1;
    usleep(20000);
    assert_int_equal(gonio_controller_read_status(controller, &now, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "restarted"));
    // Nothing goes on with the parameters of its start; it is told once.
    assert_int_equal(gonio_controller_read_status(controller, &now, &error), GONIO_E_DEVICE);
    assert_null(strstr(strstr(events, "controller-restart") + 1, "controller-restart"));
    close_drivers();
    open_controller();
    must(gonio_controller_read_status(controller, &now, &error), &error);
    stop();
}

// A controller that had just been switched on is reset between its set-up and the first move: its clock does not go
// back, and it would have moved with the parameters, and the limits, of its start.
static void test_early_restart_is_noticed(void **state) {
    (void)state;
    start(true, 30, 1);
    open_stage();
    gonio_error error = {0};
    b.shared->restart = 1;
    usleep(300000); // of thirty-fold time: more than it had been up before
    const int64_t motions = b.shared->motions;
    assert_int_equal(gonio_stage_modbus.home(stage, 30, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "restarted"));
    assert_int_equal(b.shared->motions, motions);
    stop();
}

// An axis slips: an audit finds by how much, once. Where the position was lost in between, nobody can know.
static void test_audit(void **state) {
    (void)state;
    start(true, 30, 1);
    open_stage();
    gonio_error error = {0};
    double difference[GONIO_AXES];
    must(gonio_stage_modbus.audit(stage, 60, difference, &error), &error);
    assert_true(isnan(difference[0])); // never homed before
    must(gonio_stage_modbus.audit(stage, 60, difference, &error), &error);
    for (int k = 0; k < GONIO_AXES; k++) {
        assert_true(fabs(gonio_degrees(difference[k])) < 0.0101);
    }
    b.shared->machine.axis[2].steps += 70;
    assert_int_equal(gonio_stage_modbus.audit(stage, 60, difference, &error), GONIO_E_MISMATCH);
    assert_non_null(strstr(error.message, "camera_theta"));
    assert_true(fabs(gonio_degrees(difference[2]) + 0.7) < 0.0101 && fabs(gonio_degrees(difference[1])) < 0.0101);
    must(gonio_stage_modbus.audit(stage, 60, difference, &error), &error);
    assert_true(fabs(gonio_degrees(difference[2])) < 0.0101);
    assert_int_equal(gonio_stage_modbus_lost_steps(stage), 1);
    b.shared->machine.core.known = 7;
    must(gonio_stage_modbus.audit(stage, 60, difference, &error), &error);
    assert_true(isnan(difference[0]));
    stop();
}

// The controller counts another position though nothing was asked to move: any exchange that reads it back tells.
static void test_position_is_read_back(void **state) {
    (void)state;
    start(true, 30, 1);
    open_stage();
    gonio_error error = {0};
    double target[GONIO_AXES], at[GONIO_AXES];
    pose(10, 20, 30, 40, target);
    must(gonio_stage_modbus.home(stage, 30, &error), &error);
    must(gonio_stage_modbus.move(stage, target, 1, &stamp, 10, &error), &error);
    must(gonio_stage_modbus.position(stage, at, &error), &error);
    b.shared->machine.core.step.position[1] += 3;
    assert_int_equal(gonio_stage_modbus.position(stage, at, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "nothing was asked to move"));
    assert_non_null(strstr(events, "lost-steps: axis 1"));
    must(gonio_stage_modbus.move(stage, target, 2, &stamp, 10, &error), &error); // absolute: it goes there again
    stop();
}

static void test_wrong_partners(void **state) {
    (void)state;
    start(true, 1, 1);
    gonio_error error = {0};
    b.shared->machine.core.registers.protocol[0] = 9;
    assert_int_equal(gonio_controller_open(&config, &controller, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "protocol 9"));
    b.shared->machine.core.registers.magic[0] = 0x1234;
    assert_int_equal(gonio_controller_open(&config, &controller, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "0x1234"));
    b.shared->frozen = 1;
    config.modbus.timeout_ms = 20;
    const int64_t began = gonio_clock_ms();
    assert_int_equal(gonio_controller_open(&config, &controller, &error), GONIO_E_TIMEOUT);
    assert_true(gonio_clock_ms() - began < 20000); // bounded; no figure of speed
    bench_stop(&b);
    strcpy(config.modbus.port, "/dev/no-such-port");
    assert_int_equal(gonio_controller_open(&config, &controller, &error), GONIO_E_DEVICE);
    strcpy(config.modbus.port, "tcp:127.0.0.1:1");
    assert_int_equal(gonio_controller_open(&config, &controller, &error), GONIO_E_DEVICE);
    config.modbus.port[0] = 0;
    assert_int_equal(gonio_controller_open(&config, &controller, &error), GONIO_E_INPUT);
    assert_null(controller);
}

// A whole run of moves over a line that mangles 8 % of all frames: every move ends where it was sent, each moved once,
// and the controller's count agrees with the driver's.
static void check_bad_line(bool tcp, uint32_t kinds, uint32_t seed) {
    start(tcp, 30, seed);
    config.modbus.timeout_ms = 60;
    config.deadman_s = 120; // of the controller's time, which runs 30 times as fast
    open_stage();
    gonio_error error = {0};
    must(gonio_stage_modbus.home(stage, 30, &error), &error);
    double middle[GONIO_AXES] = {0};
    must(gonio_stage_modbus.move(stage, middle, 0, &stamp, 20, &error), &error); // the switch is outside the limits
    b.shared->moves_past_limit = 0;
    b.shared->kinds = kinds;
    b.shared->permille = 80;
    const int64_t motions = b.shared->motions;
    uint32_t random = seed;
    enum { MOVES = 15 };
    for (int i = 0; i < MOVES; i++) {
        double target[GONIO_AXES], at[GONIO_AXES];
        for (int k = 0; k < GONIO_AXES; k++) {
            random = random * 1664525u + 1013904223u;
            target[k] = gonio_radians((double)((random >> 16) % 18000) / 100 - 90);
        }
        must(gonio_stage_modbus.move(stage, target, (uint32_t)i, &stamp, 20, &error), &error);
        for (int k = 0; k < GONIO_AXES; k++) {
            assert_int_equal(b.shared->machine.core.registers.position[k], llround(gonio_degrees(target[k]) * 100));
            assert_int_equal(b.shared->machine.axis[k].steps, b.shared->machine.core.registers.position[k]);
        }
        must(gonio_stage_modbus.position(stage, at, &error), &error);
    }
    b.shared->permille = 0;
    assert_int_equal(b.shared->motions - motions, MOVES);
    assert_int_equal(b.shared->moves_past_limit, 0);
    gonio_controller_counts counts;
    gonio_controller_count(controller, &counts);
    assert_true(counts.retries > 0);
    stop();
}

static void test_bad_serial_line(void **state) {
    (void)state;
    check_bad_line(false, (1u << BENCH_CLOSE) - 2, 3);
}

static void test_bad_tcp_line(void **state) {
    (void)state;
    // TCP carries no checksum of its own in Modbus: bits do not flip there.
    check_bad_line(true, (1u << BENCH_DELAY) | (1u << BENCH_DROP) | (1u << BENCH_SPLIT) | (1u << BENCH_CLOSE), 5);
}

static void test_replugged_adapter(void **state) {
    (void)state;
    check_bad_line(false, 1u << BENCH_CLOSE, 11);
}

static void test_record_and_replay(void **state) {
    (void)state;
    start(false, 30, 3);
    char path[] = "/tmp/gonio-tape-XXXXXX";
    close(mkstemp(path));
    unlink(path);
    double at[2][GONIO_AXES];
    gonio_status ends[2];
    char told[2][512];
    for (int replay = 0; replay < 2; replay++) {
        gonio_tape *tape = NULL;
        assert_int_equal((replay ? gonio_tape_open : gonio_tape_create)(path, &tape, NULL), GONIO_OK);
        config.tape = tape;
        config.mode = replay ? GONIO_TAPE_REPLAY : GONIO_TAPE_RECORD;
        open_stage();
        gonio_error error = {0};
        must(gonio_stage_modbus.home(stage, 30, &error), &error);
        b.shared->kinds = 1u << BENCH_FLIP | 1u << BENCH_CUT;
        b.shared->permille = 100;
        double target[GONIO_AXES];
        pose(10, 20, 30, 40, target);
        must(gonio_stage_modbus.move(stage, target, 1, &stamp, 20, &error), &error);
        must(gonio_stage_modbus.position(stage, at[replay], &error), &error);
        b.shared->permille = 0;
        if (!replay) {
            b.shared->machine.forced_on |= 1 << FW_CONTACT_estop;
            usleep(100000);
        }
        ends[replay] = gonio_stage_modbus.move(stage, target, 2, &stamp, 20, &error);
        strcpy(told[replay], error.message);
        close_drivers();
        gonio_tape_close(tape);
        if (!replay) {
            bench_stop(&b); // the replay has nothing to talk to
            b.shared = calloc(1, sizeof *b.shared);
        }
    }
    free(b.shared);
    unlink(path);
    assert_memory_equal(at[0], at[1], sizeof at[0]);
    assert_int_equal(ends[0], GONIO_E_DEVICE);
    assert_int_equal(ends[0], ends[1]);
    assert_string_equal(told[0], told[1]);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rtu),
        cmocka_unit_test(test_tcp),
        cmocka_unit_test(test_zero_and_sign),
        cmocka_unit_test(test_homing_parameters),
        cmocka_unit_test(test_duration),
        cmocka_unit_test(test_lamp_and_monitor),
        cmocka_unit_test(test_killed_host),
        cmocka_unit_test(test_feeding),
        cmocka_unit_test(test_stops_in_mid_move),
        cmocka_unit_test(test_restart_is_noticed),
        cmocka_unit_test(test_early_restart_is_noticed),
        cmocka_unit_test(test_audit),
        cmocka_unit_test(test_position_is_read_back),
        cmocka_unit_test(test_wrong_partners),
        cmocka_unit_test(test_bad_serial_line),
        cmocka_unit_test(test_bad_tcp_line),
        cmocka_unit_test(test_replugged_adapter),
        cmocka_unit_test(test_record_and_replay),
    };
    return cmocka_run_group_tests_name("controller", tests, NULL, NULL);
}
