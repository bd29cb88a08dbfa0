// SPDX-License-Identifier: BSD-3-Clause
// A stage of free axes before an emulator of its devices. Before it is included: BENCH_STAGE, BENCH_OPEN and
// BENCH_CONFIG (its operations, its opening and what that takes), BENCH_EMULATOR, and
//     static BENCH_EMULATOR *emulate(int family, double deg_per_s);
//     static BENCH_CONFIG config_of(int family, const BENCH_EMULATOR *e);
//     static void shut_down(BENCH_EMULATOR *e);
#pragma once

typedef struct bench {
    BENCH_EMULATOR *e;
    void *stage;
    int family;
} bench;

static gonio_driver_context around; // of the stage that is opened next

static void good(gonio_status status, const gonio_error *error) {
    if (status != GONIO_OK) {
        fail_msg("%s: %s", gonio_status_name(status), error->message);
    }
}

static bench begin_with(int family, double deg_per_s, void (*change)(BENCH_CONFIG *c)) {
    bench b = {emulate(family, deg_per_s), NULL, family};
    BENCH_CONFIG c = config_of(family, b.e);
    gonio_error error = {0};
    around = (gonio_driver_context){0};
    if (change != NULL) {
        change(&c);
    }
    good(BENCH_OPEN(&c, &around, &b.stage, &error), &error);
    return b;
}

static bench begin(int family) { return begin_with(family, 2000, NULL); }

static void end(bench *b) {
    BENCH_STAGE.close(b->stage);
    shut_down(b->e);
}

static gonio_status move(const bench *b, double a, double c, double d, double f, gonio_error *error) {
    const double to[4] = {gonio_radians(a), gonio_radians(c), gonio_radians(d), gonio_radians(f)};
    return BENCH_STAGE.move(b->stage, to, 1, NULL, 5, error);
}

static void home(const bench *b) {
    gonio_error error = {0};
    good(BENCH_STAGE.home(b->stage, 5, &error), &error);
}

static void stands_at(const bench *b, double a, double c, double d, double f) {
    const double expected[4] = {a, c, d, f};
    double rad[4];
    gonio_error error = {0};
    good(BENCH_STAGE.position(b->stage, rad, &error), &error);
    for (int k = 0; k < 4; k++) {
        assert_near(gonio_degrees(rad[k]), expected[k], 0.0101);
    }
}

// A zone of axis 0 that the stage keeps out of from now on.
static inline void guard(gonio_rig *rig, const bench *b, double low_deg, double high_deg) {
    gonio_keep_out keep_out = {0};
    gonio_error error = {0};
    *rig = (gonio_rig){.stage = &BENCH_STAGE, .stage_device = b->stage};
    const int zone = gonio_keep_out_zone(&keep_out, "post");
    keep_out.zones[zone].minimum_deg[0] = low_deg;
    keep_out.zones[zone].maximum_deg[0] = high_deg;
    good(gonio_keep_out_guard(&keep_out, rig, &error), &error);
}

// ---- what stops a move ----

static int strikes_after;
static gonio_status struck(void *device, gonio_error *error) {
    (void)device;
    return strikes_after-- > 0 ? GONIO_OK : gonio_fail(error, GONIO_E_DEVICE, "the door is open");
}
static const gonio_interlock_ops door = {.name = "door", .check = struck};
static void with_door(BENCH_CONFIG *c) { (void)c, around.interlock = &door; }
static bool asked(void *context) { return struck(context, NULL) != GONIO_OK; }
static void with_stop(BENCH_CONFIG *c) { (void)c, around.cancelled = asked; }
