// SPDX-License-Identifier: BSD-3-Clause
// Contacts: the filter against a plain statement of what it must say, and the interlock on modelled lines.
#include <errno.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "host/drivers/interlock_gpio.h"
#include "host/drivers/lamp_gpio.h"

enum { MS = 1000000, QUEUE = 16 };

// A line as the kernel keeps it: a level, and a queue of 16 edges that loses what comes after.
typedef struct model_line {
    char name[64];
    bool level, output, broken;
    gonio_gpio_edge queue[QUEUE];
    int n;
} model_line;

static struct {
    model_line lines[4];
    int n;
    int64_t now_ns;
    bool drop_edges;
} gpio;

static int model_open(const char *name, bool output, bool level, void **handle) {
    for (int i = 0; i < gpio.n; i++) {
        if (strcmp(gpio.lines[i].name, name) == 0) {
            *handle = &gpio.lines[i];
            gpio.lines[i].output = output;
            gpio.lines[i].level = output ? level : gpio.lines[i].level;
            return 0;
        }
    }
    return -ENOENT;
}

static int open_input(void *state, const char *name, gonio_gpio_bias bias, void **handle) {
    (void)state;
    (void)bias;
    return model_open(name, false, false, handle);
}

static int open_output(void *state, const char *name, bool initial, void **handle) {
    (void)state;
    return model_open(name, true, initial, handle);
}

static pthread_mutex_t model_lock = PTHREAD_MUTEX_INITIALIZER;
static int looks;

static int get(void *state, void *handle) {
    (void)state;
    const model_line *l = handle;
    pthread_mutex_lock(&model_lock);
    const int level = l->broken ? -ENODEV : l->level;
    looks++;
    pthread_mutex_unlock(&model_lock);
    return level;
}

static int set(void *state, void *handle, bool level) {
    (void)state;
    ((model_line *)handle)->level = level;
    return 0;
}

static int next_edge(void *state, void *handle, gonio_gpio_edge *edge) {
    (void)state;
    model_line *l = handle;
    if (l->n == 0) {
        return 0;
    }
    *edge = l->queue[0];
    memmove(l->queue, l->queue + 1, sizeof l->queue - sizeof *l->queue);
    l->n--;
    return 1;
}

static void close_line(void *state, void *handle) {
    (void)state;
    (void)handle;
}

static int64_t now_ns(void *state) {
    (void)state;
    return gpio.now_ns;
}

static const gonio_gpio_io io = {open_input, open_output, get, set, next_edge, close_line, now_ns};

static void drive(int line, bool level) {
    model_line *l = &gpio.lines[line];
    if (l->level != level && !gpio.drop_edges && l->n < QUEUE) {
        l->queue[l->n++] = (gonio_gpio_edge){level, gpio.now_ns};
    }
    l->level = level;
}

static void *open_interlock_watched(double watch_s) {
    memset(&gpio, 0, sizeof gpio);
    strcpy(gpio.lines[0].name, "estop");
    strcpy(gpio.lines[1].name, "gpiochip0:3");
    gpio.n = 2;
    gonio_interlock_gpio_config config;
    gonio_interlock_gpio_defaults(&config);
    assert_true(config.watch_s == 0.05);
    config.watch_s = watch_s;
    strcpy(config.contacts[0].line, "estop");
    strcpy(config.contacts[1].line, "gpiochip0:3");
    void *device = NULL;
    assert_int_equal(gonio_interlock_gpio_open(&config, &io, NULL, &device, NULL), GONIO_OK);
    return device;
}

// Most tests have a clock of their own, and look themselves.
static void *open_interlock(void) { return open_interlock_watched(0); }

static gonio_status check_after(void *device, int64_t ms, gonio_error *error) {
    gpio.now_ns += ms * MS;
    return gonio_interlock_gpio.check(device, error);
}

static void test_pressed_and_released(void **state) {
    (void)state;
    void *device = open_interlock();
    gonio_error error = {0};
    assert_int_equal(check_after(device, 10, NULL), GONIO_OK);
    drive(0, true); // normally closed: the wire opens, the line goes high
    assert_int_equal(check_after(device, 10, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "emergency stop is active"));
    assert_null(strstr(error.message, "door"));
    assert_int_equal(check_after(device, 1000, NULL), GONIO_E_DEVICE); // as long as it lasts
    drive(0, false);
    assert_int_equal(check_after(device, 2, NULL), GONIO_E_DEVICE); // not yet held
    check_after(device, 10, NULL);
    assert_int_equal(check_after(device, 10, NULL), GONIO_OK);
    drive(1, true);
    assert_int_equal(check_after(device, 10, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "door is active"));
    gonio_interlock_gpio.close(device);
}

// Pressed and released between two checks: told once, by the edges' times.
static void test_short_press_is_not_lost(void **state) {
    (void)state;
    void *device = open_interlock();
    gonio_error error = {0};
    gpio.now_ns += MS;
    drive(0, true);
    gpio.now_ns += 6 * MS;
    drive(0, false);
    assert_int_equal(check_after(device, 20, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "emergency stop was active"));
    assert_int_equal(check_after(device, 20, NULL), GONIO_OK);
    gonio_interlock_gpio.close(device);
}

static void test_glitches_are_left_out(void **state) {
    (void)state;
    void *device = open_interlock();
    for (int i = 0; i < 50; i++) {
        drive(0, true);
        gpio.now_ns += 2 * MS;
        drive(0, false);
        assert_int_equal(check_after(device, 20, NULL), GONIO_OK);
    }
    const char *name;
    assert_int_equal(gonio_interlock_gpio_contact(device, 0, &name)->glitches, 50);
    assert_int_equal(gonio_interlock_gpio_contact(device, 0, &name)->lost_edges, 0);
    gonio_interlock_gpio.close(device);
}

static void test_lost_edges_show(void **state) {
    (void)state;
    void *device = open_interlock();
    const char *name;
    gpio.drop_edges = true;
    drive(0, true); // no event at all: the level tells
    assert_int_equal(check_after(device, 20, NULL), GONIO_E_DEVICE);
    assert_int_equal(gonio_interlock_gpio_contact(device, 0, &name)->lost_edges, 1);
    drive(0, false);
    check_after(device, 20, NULL);
    check_after(device, 20, NULL);
    assert_int_equal(check_after(device, 20, NULL), GONIO_OK);
    // The edge down is lost, the edge up comes: two equal ones in a row.
    gpio.drop_edges = false;
    drive(0, true);
    gpio.drop_edges = true;
    drive(0, false);
    gpio.drop_edges = false;
    gpio.now_ns += MS;
    drive(0, true);
    gpio.drop_edges = true;
    drive(0, false);
    assert_int_equal(check_after(device, 1, NULL), GONIO_E_DEVICE);
    assert_true(gonio_interlock_gpio_contact(device, 0, &name)->lost_edges >= 4);
    gonio_interlock_gpio.close(device);
}

// A contact that chatters overflows the kernel's queue of 16: it must not pass as quiet.
static void test_overflow_is_noticed(void **state) {
    (void)state;
    void *device = open_interlock();
    for (int i = 0; i < 41; i++) {
        drive(0, i % 2 == 0);
        gpio.now_ns += MS;
    }
    assert_true(gpio.lines[0].level);
    assert_int_equal(check_after(device, 20, NULL), GONIO_E_DEVICE);
    gonio_interlock_gpio.close(device);
}

static void test_open_at_start_and_broken_line(void **state) {
    (void)state;
    void *device = open_interlock();
    gonio_interlock_gpio.close(device);
    gpio.lines[1].level = true;
    gonio_interlock_gpio_config config;
    gonio_interlock_gpio_defaults(&config);
    config.watch_s = 0;
    strcpy(config.contacts[1].line, "gpiochip0:3");
    gonio_error error = {0};
    assert_int_equal(gonio_interlock_gpio_open(&config, &io, NULL, &device, NULL), GONIO_OK);
    assert_int_equal(check_after(device, 0, &error), GONIO_E_DEVICE);
    gpio.lines[1].broken = true;
    assert_int_equal(check_after(device, 10, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "gpiochip0:3"));
    gonio_interlock_gpio.close(device);
    strcpy(config.contacts[1].line, "nowhere");
    assert_int_equal(gonio_interlock_gpio_open(&config, &io, NULL, &device, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "nowhere"));
}

// The filter against its definition: whatever the edges, it tells a trip exactly where an active stretch of at least
// the hold time was there, or lasts so long at the moment of looking.
static void test_filter_against_definition(void **state) {
    (void)state;
    uint32_t seed = 7;
    for (int trial = 0; trial < 2000; trial++) {
        gonio_debounce d;
        gonio_debounce_start(&d, false, 0, 5);
        int64_t now = 0, since = 0;
        bool raw = false, stable = false, expected = false;
        for (int i = 0; i < 12; i++) {
            seed = seed * 1664525u + 1013904223u;
            now += 1 + (seed >> 16) % 9;
            // The definition, from the stretch that ends here.
            if (raw != stable && now - since >= 5) {
                stable = raw;
            }
            expected = expected || stable;
            raw = !raw;
            since = now;
            gonio_debounce_edge(&d, raw, now);
        }
        now += (seed >> 8) % 9;
        if (raw != stable && now - since >= 5) {
            stable = raw;
        }
        expected = expected || stable;
        gonio_debounce_level(&d, raw, now);
        assert_int_equal(d.tripped, expected);
        assert_int_equal(d.lost_edges, 0);
    }
}

static bool third_time(void *context) {
    static int asked;
    (void)context;
    return ++asked >= 3;
}

static void test_lamp_and_trigger(void **state) {
    (void)state;
    memset(&gpio, 0, sizeof gpio);
    strcpy(gpio.lines[0].name, "lamp");
    strcpy(gpio.lines[1].name, "shutter");
    strcpy(gpio.lines[2].name, "trigger");
    gpio.n = 3;
    const gonio_lamp_gpio_config config = {.enable_line = "lamp", .shutter_line = "shutter", .enable_low = true};
    void *device = NULL;
    gonio_error error = {0};
    assert_int_equal(gonio_lamp_gpio_open(&config, &io, NULL, &device, NULL), GONIO_OK);
    assert_true(gpio.lines[0].level && !gpio.lines[1].level); // off and closed
    double waited = -1;
    const gonio_stamp stamp = {0};
    assert_int_equal(gonio_lamp_gpio.wait_ready(device, &stamp, 1, &waited, NULL), GONIO_E_DEVICE);
    assert_int_equal(gonio_lamp_gpio.set_level(device, 1, NULL), GONIO_OK);
    assert_false(gpio.lines[0].level);
    assert_int_equal(gonio_lamp_gpio.set_level(device, 0.5, &error), GONIO_E_RANGE);
    assert_int_equal(gonio_lamp_gpio.set_shutter(device, true, NULL), GONIO_OK);
    assert_true(gpio.lines[1].level);
    assert_int_equal(gonio_lamp_gpio.wait_ready(device, &stamp, 1, &waited, NULL), GONIO_OK);
    gonio_lamp_gpio.close(device);
    // A lamp that warms up for hours does not hold up whoever wants to stop.
    gonio_lamp_gpio_config slow = config;
    slow.warm_up_s = 3600;
    slow.cancelled = third_time;
    assert_int_equal(gonio_lamp_gpio_open(&slow, &io, NULL, &device, NULL), GONIO_OK);
    assert_int_equal(gonio_lamp_gpio.set_level(device, 1, NULL), GONIO_OK);
    assert_int_equal(gonio_lamp_gpio.wait_ready(device, &stamp, 7200, &waited, &error), GONIO_E_INTERRUPTED);
    gonio_lamp_gpio.close(device);
    gonio_trigger_gpio trigger = {.io = &io, .line = "trigger"};
    assert_int_equal(gonio_trigger_gpio_open(&trigger, NULL), GONIO_OK);
    assert_int_equal(gonio_trigger_gpio_fire(&trigger, NULL), GONIO_OK);
    assert_false(gpio.lines[2].level);
    gonio_trigger_gpio_close(&trigger);
}

// A contact that opens and closes again without leaving an edge, while the caller waits for something else: the levels
// are read all the same, and the next check tells.
static void test_watched_while_nobody_asks(void **state) {
    (void)state;
    void *device = open_interlock_watched(0.002);
    gonio_error error = {0};
    assert_int_equal(gonio_interlock_gpio.check(device, &error), GONIO_OK);
    pthread_mutex_lock(&model_lock);
    gpio.drop_edges = true;
    gpio.now_ns += MS;
    drive(1, true);
    const int seen = looks;
    pthread_mutex_unlock(&model_lock);
    for (int enough = 0; enough < 10;) { // until its thread has looked at both lines some times
        pthread_mutex_lock(&model_lock);
        enough = looks - seen;
        pthread_mutex_unlock(&model_lock);
        usleep(1000);
    }
    pthread_mutex_lock(&model_lock);
    gpio.now_ns += MS;
    drive(1, false);
    pthread_mutex_unlock(&model_lock);
    assert_int_equal(gonio_interlock_gpio.check(device, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "door"));
    gonio_interlock_gpio.close(device);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pressed_and_released),      cmocka_unit_test(test_short_press_is_not_lost),
        cmocka_unit_test(test_glitches_are_left_out),     cmocka_unit_test(test_lost_edges_show),
        cmocka_unit_test(test_overflow_is_noticed),       cmocka_unit_test(test_open_at_start_and_broken_line),
        cmocka_unit_test(test_watched_while_nobody_asks), cmocka_unit_test(test_filter_against_definition),
        cmocka_unit_test(test_lamp_and_trigger),
    };
    return cmocka_run_group_tests_name("interlock_gpio", tests, NULL, NULL);
}
