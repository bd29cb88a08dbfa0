// SPDX-License-Identifier: BSD-3-Clause
// The stage of Modbus drives against emulators of two makers' drives and of one slave with four axes, over TCP and RTU:
// homing, moves, limits, faults of the line and of the drives, stops, keep-out zones, encoders on the same line.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "host/drivers/encoders.h"
#include "host/drivers/keep_out.h"
#include "host/drivers/stage_modbus_table.h"
#include "tests/unit/drive_emulators.h"
#include "tests/unit/near.h"
#include "tests/unit/scratch.h"

static const struct {
    drives_kind kind;
    const char *table;
    double units_per_deg;
    bool rtu, absolute;
    uint32_t alarm;
    const char *alarm_text;
} families[] = {
    {DRIVES_LEADSHINE, "leadshine", 100, false, false, 0x20, "0x20, position following error"},
    {DRIVES_AZ, "oriental-az", 1000, false, true, 0x30, "0x30, overload"},
    {DRIVES_SHARED, "", 50, false, false, 7, "0x7, hot"},
    {DRIVES_LEADSHINE, "leadshine", 100, true, false, 0x01, "0x1, over-current"},
};
enum { FAMILIES = sizeof families / sizeof *families };

// One slave with four axes, described in the rig file itself.
static const gonio_modbus_texts shared_texts = {
    .read = "4",
    .write = "6",
    .target = "0x04:s16",
    .position = "0x02:s16",
    .fault = "0x08",
    .move = "target && 0x06 = 1",
    .home = "0x06 = 2",
    .stop = "0x06 = 3",
    .reset = "0x06 = 4",
    .moving = "0x00 == 1 | 0x00 == 2 | @0x0100 == 0",
    .homed = "0x00 & 0x0f == 0 | 0x00 == 4",
    .alarm = "0x00 == 3",
    .limit = "0x00 == 4",
    .faults = "1 cold | 7 hot",
};

static gonio_stage_modbus_table_config config_of(int family, const drives *d) {
    gonio_stage_modbus_table_config c;
    gonio_stage_modbus_table_defaults(&c);
    snprintf(c.line.modbus.port, sizeof c.line.modbus.port, "%s", d->path);
    snprintf(c.table, sizeof c.table, "%s", families[family].table);
    c.line.modbus.timeout_ms = 50;
    c.line.retries = 3;
    c.line.replug_s = 0.5;
    c.absolute = families[family].absolute;
    const bool shared = families[family].kind == DRIVES_SHARED;
    c.texts = shared ? shared_texts : c.texts;
    for (int k = 0; k < 4; k++) {
        c.axes[k].slave = shared ? 1 : k + 1;
        c.axes[k].offset = shared ? 0x20 * k : 0;
        c.axes[k].speed = 300;
        c.axes[k].free.units_per_deg = families[family].units_per_deg;
        c.axes[k].free.min_deg = -100;
        c.axes[k].free.max_deg = 100;
    }
    if (shared) {
        c.axes[0].speed = c.axes[1].speed = c.axes[2].speed = c.axes[3].speed = 0;
    }
    return c;
}

static drives *emulate(int family, double deg_per_s) {
    return drives_start_up(families[family].kind, families[family].rtu, deg_per_s * families[family].units_per_deg);
}

static void shut_down(drives *d) { drives_shut_down(d); }

#define BENCH_STAGE gonio_stage_modbus_table
#define BENCH_OPEN gonio_stage_modbus_table_open
#define BENCH_CONFIG gonio_stage_modbus_table_config
#define BENCH_EMULATOR drives
#include "tests/unit/free_stage_bench.h"

static void goes_where_it_is_sent(void **state) {
    (void)state;
    for (int f = 0; f < FAMILIES; f++) {
        bench b = begin(f);
        gonio_error error = {0};
        home(&b);
        good(move(&b, 30.5, -45, 60, 12.5, &error), &error);
        stands_at(&b, 30.5, -45, 60, 12.5);
        assert_near(drives_at(b.e, 1), -45 * families[f].units_per_deg, 0.5);
        assert_int_equal(b.e->axis[2].speed_seen, families[f].kind == DRIVES_SHARED ? 0 : 300);
        good(move(&b, 30.5, -45, 60, 12.5, &error), &error); // where it stands
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
        if (!families[f].absolute) {
            assert_int_equal(move(&b, 1, 0, 0, 0, &error), GONIO_E_DEVICE);
            assert_non_null(strstr(error.message, "homed"));
            assert_int_equal(b.e->moves, 0);
            home(&b);
        }
        good(move(&b, 1, 0, 0, 0, &error), &error);
        b.e->axis[1].homed = false; // its supply failed meanwhile
        assert_int_equal(move(&b, 2, 0, 0, 0, &error), families[f].absolute ? GONIO_OK : GONIO_E_DEVICE);
        end(&b);
    }
}

static void limits_hold(void **state) {
    (void)state;
    for (int f = 0; f < FAMILIES; f++) {
        bench b = begin(f);
        gonio_error error = {0};
        home(&b);
        assert_int_equal(move(&b, 100.01, 0, 0, 0, &error), GONIO_E_RANGE);
        assert_int_equal(move(&b, 0, 0, -100.01, 0, &error), GONIO_E_RANGE);
        assert_non_null(strstr(error.message, "camera_theta"));
        assert_int_equal(b.e->moves, 0);
        end(&b);
    }
}

static void with_backlash(gonio_stage_modbus_table_config *c) {
    c->axes[0].free.backlash_deg = 5;
    c->axes[0].free.min_deg = -10;
    c->axes[1].free.invert = true;
    c->axes[1].free.zero_deg = 3;
    c->axes[3].slave = 0;
    c->axes[3].free.fixed_deg = 7;
}

// The take-up passes the target, never a limit, nor a zone.
static void takes_up_within_limits_and_zones(void **state) {
    (void)state;
    for (int f = 0; f < FAMILIES; f++) {
        bench b = begin_with(f, 2000, with_backlash);
        gonio_error error = {0};
        home(&b);
        good(move(&b, 20, -3, 0, 7, &error), &error);
        assert_near(drives_at(b.e, 1), 6 * families[f].units_per_deg, 0.5); // dial = -user + zero
        b.e->lowest = 1e9;
        good(move(&b, 10, -3, 0, 7, &error), &error); // down: past it by 5, then up
        assert_near(b.e->lowest, 5 * families[f].units_per_deg, 0.5);
        b.e->lowest = 1e9;
        assert_int_equal(move(&b, -8, -3, 0, 7, &error), GONIO_E_RANGE); // would have to pass -10
        assert_int_equal(move(&b, 10, -3, 0, 8, &error), GONIO_E_RANGE); // an axis that does not exist
        gonio_rig rig;
        guard(&rig, &b, -1, 1);
        const double to[4] = {gonio_radians(3), gonio_radians(-3), 0, gonio_radians(7)}; // by way of -2
        assert_int_equal(rig.stage->move(rig.stage_device, to, 1, NULL, 5, &error), GONIO_E_RANGE);
        assert_non_null(strstr(error.message, "take-up"));
        assert_true(b.e->lowest > 1e8);
        rig.stage->close(rig.stage_device);
        drives_shut_down(b.e);
    }
}

// The straight line passes the zone by, the box does not.
static void zones_count_for_the_box(void **state) {
    (void)state;
    bench b = begin(0);
    gonio_error error = {0};
    home(&b);
    gonio_rig rig;
    guard(&rig, &b, 40, 50);
    const double beyond[4] = {gonio_radians(60), 0, 0, 0}, before[4] = {gonio_radians(30), 0, 0, 0};
    assert_int_equal(rig.stage->move(rig.stage_device, beyond, 1, NULL, 5, &error), GONIO_E_RANGE);
    assert_non_null(strstr(error.message, "each at its own pace"));
    good(rig.stage->move(rig.stage_device, before, 1, NULL, 5, &error), &error);
    rig.stage->close(rig.stage_device);
    drives_shut_down(b.e);
}

// ---- faults ----

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
        assert_near(drives_at(b.e, 2), 0, 0.5);
        end(&b);
    }
}

static void faults_of_the_line_are_asked_again(void **state) {
    (void)state;
    for (int f = 0; f < FAMILIES; f++) {
        bench b = begin(f);
        gonio_error error = {0};
        double rad[4];
        home(&b);
        good(move(&b, 5, 0, 0, 0, &error), &error);
        b.e->mute = 2;
        stands_at(&b, 5, 0, 0, 0);
        b.e->wrong = 2;
        stands_at(&b, 5, 0, 0, 0);
        b.e->mute = 2;
        good(move(&b, 6, 0, 0, 0, &error), &error); // commands as well: their targets are absolute
        stands_at(&b, 6, 0, 0, 0);
        b.e->mute = 1000;
        assert_int_equal(gonio_stage_modbus_table.position(b.stage, rad, &error), GONIO_E_TIMEOUT);
        assert_non_null(strstr(error.message, "light_theta"));
        b.e->mute = 0;
        b.e->refuse = 1;
        assert_int_equal(gonio_stage_modbus_table.position(b.stage, rad, &error), GONIO_E_DEVICE);
        assert_non_null(strstr(error.message, "refuses register"));
        if (!families[f].rtu) {
            b.e->hang_up = true;
        }
        stands_at(&b, 6, 0, 0, 0);
        end(&b);
    }
}

static void a_lost_step_is_told(void **state) {
    (void)state;
    for (int f = 0; f < FAMILIES; f++) {
        bench b = begin(f);
        gonio_error error = {0};
        home(&b);
        b.e->lost = families[f].units_per_deg;
        assert_int_equal(move(&b, 20, 0, 0, 0, &error), GONIO_E_DEVICE);
        assert_non_null(strstr(error.message, "light_theta stands at 21 deg, asked for 20 deg"));
        home(&b);
        good(move(&b, 20, 0, 0, 0, &error), &error);
        end(&b);
    }
}

// An interlock that looks, and in between raises the alarm of axis 0.
static bench *looked_at;
static int looks;
static gonio_status raises(void *device, gonio_error *error) {
    (void)device, (void)error;
    if (looks-- == 0) {
        drives_halt(looked_at->e, 0);
        looked_at->e->alarm = families[looked_at->family].alarm;
        looked_at->e->cause = true;
    }
    return GONIO_OK;
}
static const gonio_interlock_ops raising = {.name = "raising", .check = raises};
static void with_alarm(gonio_stage_modbus_table_config *c) { (void)c, around.interlock = &raising; }

static void an_alarm_is_named_and_cleared_by_homing(void **state) {
    (void)state;
    for (int f = 0; f < FAMILIES; f++) {
        looks = 100000;
        bench b = begin_with(f, 100, with_alarm);
        gonio_error error = {0};
        looked_at = &b;
        home(&b);
        looks = 4;
        assert_int_equal(move(&b, 90, 0, 0, 0, &error), GONIO_E_DEVICE);
        assert_non_null(strstr(error.message, families[f].alarm_text));
        assert_non_null(strstr(error.message, "light_theta"));
        looks = 100000;
        assert_int_equal(move(&b, 10, 0, 0, 0, &error), GONIO_E_DEVICE);                     // it stands
        assert_int_equal(gonio_stage_modbus_table.home(b.stage, 5, &error), GONIO_E_DEVICE); // and its cause
        assert_true(b.e->resets == 1);
        b.e->cause = false;
        home(&b);
        b.e->speed *= 20;
        good(move(&b, 10, 0, 0, 0, &error), &error);
        end(&b);
    }
}

static void a_limit_switch_ends_a_move(void **state) {
    (void)state;
    bench b = begin(2);
    gonio_error error = {0};
    home(&b);
    b.e->limit = true;
    assert_int_equal(move(&b, 10, 0, 0, 0, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "limit switch"));
    home(&b); // it may stand on one there
    b.e->limit = false;
    good(move(&b, 10, 0, 0, 0, &error), &error);
    end(&b);
}

// ---- stops ----

static void stopped_by(void (*change)(gonio_stage_modbus_table_config *), gonio_status status, const char *says) {
    for (int f = 0; f < FAMILIES; f++) {
        strikes_after = 1000;
        bench b = begin_with(f, 100, change);
        gonio_error error = {0};
        home(&b);
        strikes_after = 4;
        assert_int_equal(move(&b, 90, 50, 0, 0, &error), status);
        assert_non_null(strstr(error.message, says));
        assert_true(drives_at(b.e, 0) / families[f].units_per_deg < 80);
        for (int k = 0; k < 4; k++) {
            assert_false(drives_move(b.e, k));
        }
        strikes_after = 100000;
        b.e->speed *= 20;
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
        bench b = begin(f);
        gonio_error error = {0};
        home(&b);
        b.e->speed = 1e-3;
        const double to[4] = {1, 0, 0, 0};
        assert_int_equal(gonio_stage_modbus_table.move(b.stage, to, 1, NULL, 0.2, &error), GONIO_E_TIMEOUT);
        assert_false(drives_move(b.e, 0));
        end(&b);
    }
}

// ---- tables ----

static void tables_are_checked(void **state) {
    (void)state;
    static const struct {
        const char *text, *words;
        int line;
    } bad[] = {
        {"target = 0x10\nfly = 1\n", "unknown key 'fly'", 2},
        {"target = 70000\n", "target", 1},
        {"target = 0x10:s64\n", "ADDRESS[:u16|s16|u32|s32]", 1},
        {"moving = 0x10 & \n", "MASK", 1},
        {"moving = 0x10 & 1 |\n", "MASK", 1},
        {"moving = 1|1|1|1|1|1|1\n", "MASK", 1},
        {"move = target && go\n", "REGISTER = NUMBER", 1},
        {"move = 0x10 = \n", "REGISTER = NUMBER", 1},
        {"faults = 1 | 2\n", "NUMBER text", 1},
        {"read = 5\n", "read", 1},
    };
    static const struct {
        const char *text, *words;
    } incomplete[] = {
        {"target = 0x10\nposition = 0x12\nhome = 1 = 1\nmoving = 5\nmove = 1 = 1\n", "needs target"},
        {"target = 0x10\nposition = 0x12\nhome = 1 = 1\nmoving = 5\nmove = target && speed\n", "register `speed`"},
        {"target = 0x10\nposition = 0x12\nhome = 1 = 1\nmoving = 5\nmove = target\nwrite = 7\n", "6 or 16"},
    };
    const gonio_modbus_texts none = {.read = ""};
    gonio_modbus_table table;
    gonio_error error;
    char path[64];
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        scratch_file(path, bad[k].text, strlen(bad[k].text));
        error = (gonio_error){.line = -1};
        assert_int_equal(gonio_modbus_table_read(path, &none, &table, &error), GONIO_E_INPUT);
        if (strstr(error.message, bad[k].words) == NULL || error.line != bad[k].line) {
            fail_msg("line %lld: %s; expected line %d '%s'", error.line, error.message, bad[k].line, bad[k].words);
        }
        unlink(path);
    }
    for (size_t k = 0; k < sizeof incomplete / sizeof *incomplete; k++) {
        scratch_file(path, incomplete[k].text, strlen(incomplete[k].text));
        assert_int_equal(gonio_modbus_table_read(path, &none, &table, &error), GONIO_E_INPUT);
        assert_non_null(strstr(error.message, incomplete[k].words));
        unlink(path);
    }
    assert_int_equal(gonio_modbus_table_read("ledshine", &none, &table, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.message, "leadshine oriental-az"));
    const gonio_modbus_texts changed = {.words = "low-first", .stop = "@0x99 = -1"}, wrong = {.stop = "0x99"};
    assert_int_equal(gonio_modbus_table_read("leadshine", &changed, &table, &error), GONIO_OK); // its keys are defaults
    assert_true(table.stop.writes[0].at.shared && table.stop.writes[0].value == -1 && table.homed.n == 1);
    assert_int_equal(gonio_modbus_table_read("leadshine", &wrong, &table, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.message, "[drive]"));
}

static void faults_are_named(void **state) {
    (void)state;
    static const struct {
        const char *table;
        uint32_t number;
        const char *text;
    } known[] = {
        {"leadshine", 0x20, "position following error"},
        {"leadshine", 0x102, "over-voltage, auto-tuning"},
        {"leadshine", 0x400, ""},
        {"leadshine", 0x402, ""},
        {"oriental-az", 0x30, "overload"}, // and not 0x10 and 0x20
        {"oriental-az", 0x85, "RS-485 timeout"},
        {"oriental-az", 0x50, ""},
        {"oriental-az", 0, ""},
    };
    for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
        const gonio_modbus_texts none = {.read = ""};
        gonio_modbus_table table;
        gonio_error error;
        char text[64];
        assert_int_equal(gonio_modbus_table_read(known[i].table, &none, &table, &error), GONIO_OK);
        gonio_modbus_fault_text(&table, known[i].number, text, sizeof text);
        assert_string_equal(text, known[i].text);
    }
}

static void words_keep_their_sign_and_order(void **state) {
    (void)state;
    static const int64_t values[] = {0, 1, -1, 32767, -32768, 65535, 65536, -65537, INT32_MAX, INT32_MIN, UINT32_MAX};
    for (int low_first = 0; low_first < 2; low_first++) {
        const gonio_modbus_table table = {.low_first = low_first};
        for (int i = 0; i < 4 * (int)(sizeof values / sizeof *values); i++) {
            const int64_t value = values[i / 4];
            const gonio_modbus_register r = {.words = 1 + i % 2, .is_signed = i / 2 % 2};
            const int64_t low = !r.is_signed ? 0 : r.words == 1 ? INT16_MIN : INT32_MIN;
            const int64_t high = low + (r.words == 1 ? UINT16_MAX : UINT32_MAX);
            uint16_t words[2] = {0};
            gonio_modbus_pack(&table, &r, value, words);
            const int64_t back = gonio_modbus_unpack(&table, &r, words);
            assert_true(value < low || value > high || back == value);
        }
        uint16_t words[2];
        gonio_modbus_pack(&table, &(gonio_modbus_register){.words = 2}, 0x12345678, words);
        assert_int_equal(words[low_first], 0x1234);
    }
}

// ---- encoders on the drives' own line ----

static void encoders_share_the_line(void **state) {
    (void)state;
    bench b = begin(0);
    gonio_rig rig = {.stage = &gonio_stage_modbus_table, .stage_device = b.stage};
    gonio_encoders encoders;
    gonio_encoders_defaults(&encoders);
    // The motor's own position again, as an encoder beside axis 1 would give it: 32 bits, the other way round.
    encoders.axes[1].encoder_deg = 0.5;
    encoders.axes[1].slave = 2;
    encoders.axes[1].address = 0x1014;
    encoders.axes[1].bits = 1;
    encoders.axes[1].counts_per_deg = 100;
    const gonio_encoder_lines lines = {.bus = gonio_stage_modbus_table_bus(b.stage)};
    void *device;
    gonio_error error = {0};
    good(gonio_encoders_guard(&encoders, &lines, &rig, &device, &error), &error);
    good(rig.stage->home(rig.stage_device, 5, &error), &error);
    const double to[4] = {0, gonio_radians(-40), 0, 0};
    double difference_rad[4];
    good(rig.stage->move(rig.stage_device, to, 1, NULL, 5, &error), &error);
    good(rig.stage->verify(rig.stage_device, difference_rad, &error), &error);
    assert_true(isnan(difference_rad[0]) && fabs(difference_rad[1]) < 1e-9);
    gonio_encoder_reading r[4];
    good(gonio_encoders_read(device, r, &error), &error);
    assert_true(r[1].there && r[1].known && !r[0].there && r[1].counts == 4294967296.0 - 4000);
    rig.stage->close(rig.stage_device);
    drives_shut_down(b.e);
}

// An absolute encoder on a line of its own: right from the first moment, and a homing that finds another place is told.
static void an_absolute_encoder_holds_homing_against_it(void **state) {
    (void)state;
    bench b = begin(0);
    gonio_encoders encoders;
    const gonio_encoder_lines none = {0};
    gonio_error error = {0};
    void *device;
    gonio_encoders_defaults(&encoders);
    gonio_encoder *one = &encoders.axes[2];
    one->encoder_deg = 0.5;
    one->slave = 3;
    one->address = 0x1015; // the low word alone: it wraps
    one->counts_per_deg = 100;
    one->zero_counts = 0;
    gonio_rig rig = {.stage = &gonio_stage_modbus_table, .stage_device = b.stage};
    assert_int_equal(gonio_encoders_guard(&encoders, &none, &rig, &device, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.message, "has no Modbus line"));
    const gonio_encoder_lines lines = {.bus = gonio_stage_modbus_table_bus(b.stage)};
    one->counts_per_deg = 0;
    assert_int_equal(gonio_encoders_guard(&encoders, &lines, &rig, &device, &error), GONIO_E_INPUT);
    one->counts_per_deg = 100;
    one->slave = 77;
    assert_int_equal(gonio_encoders_guard(&encoders, &lines, &rig, &device, &error), GONIO_E_TIMEOUT);
    assert_non_null(strstr(error.message, "encoder of camera_theta"));
    one->slave = 3;
    one->zero_counts = 65000; // 5.36 deg off, beyond the end of its 16 bits
    good(gonio_encoders_guard(&encoders, &lines, &rig, &device, &error), &error);
    gonio_encoder_reading r[4];
    good(gonio_encoders_read(device, r, &error), &error);
    assert_near(gonio_degrees(r[2].difference_rad), 5.36, 1e-9);
    assert_int_equal(rig.stage->home(rig.stage_device, 5, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "has moved"));
    const double to[4] = {0, 0, gonio_radians(20), 0};
    assert_int_equal(rig.stage->move(rig.stage_device, to, 1, NULL, 5, &error), GONIO_E_MISMATCH);
    assert_non_null(strstr(error.message, "lost steps: camera_theta"));
    rig.stage->close(rig.stage_device);
    drives_shut_down(b.e);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(goes_where_it_is_sent),
        cmocka_unit_test(homing_is_asked_for),
        cmocka_unit_test(limits_hold),
        cmocka_unit_test(takes_up_within_limits_and_zones),
        cmocka_unit_test(zones_count_for_the_box),
        cmocka_unit_test(a_late_start_is_waited_for),
        cmocka_unit_test(faults_of_the_line_are_asked_again),
        cmocka_unit_test(a_lost_step_is_told),
        cmocka_unit_test(an_alarm_is_named_and_cleared_by_homing),
        cmocka_unit_test(a_limit_switch_ends_a_move),
        cmocka_unit_test(an_interlock_stops_it),
        cmocka_unit_test(whoever_asks_stops_it),
        cmocka_unit_test(a_move_without_end_is_stopped),
        cmocka_unit_test(tables_are_checked),
        cmocka_unit_test(faults_are_named),
        cmocka_unit_test(words_keep_their_sign_and_order),
        cmocka_unit_test(encoders_share_the_line),
        cmocka_unit_test(an_absolute_encoder_holds_homing_against_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
