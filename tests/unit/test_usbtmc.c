// SPDX-License-Identifier: BSD-3-Clause
// The USBTMC transport and the meter on it, against the device model of usbtmc_model.h under umockdev.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <unistd.h>

#include <cmocka.h>

#include "host/drivers/meter_usbtmc.h"
#include "host/transport/clock.h"
#include "host/transport/usbtmc.h"
#include "tests/unit/usbtmc_model.h"

static const gonio_stamp stamp = {0};
static bool wrapped;

static int fresh(void **state) {
    (void)state;
    if (!wrapped) {
        return 0;
    }
    model.faults = (model_faults){0};
    model.split = 0;
    model.clears = model.aborts = model.queries = model.measured = 0;
    if (model.syspath == NULL) {
        assert_true(model_plug("S1"));
    }
    snprintf(model.serial, sizeof model.serial, "S1");
    return 0;
}

static void need_wrapper(void) {
    if (!wrapped) {
        skip();
    }
}

static gonio_meter_usbtmc_config quick(void) {
    gonio_meter_usbtmc_config config;
    gonio_meter_usbtmc_defaults(&config);
    config.match.vendor = MODEL_VENDOR;
    config.timeout_ms = 100;
    config.scpi.replug_s = 0.3;
    return config;
}

static void *open_meter(const gonio_meter_usbtmc_config *config) {
    void *device = NULL;
    gonio_error error = {0};
    if (gonio_meter_usbtmc_open(config, &device, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    return device;
}

static gonio_status read_meter(void *device, double *value, gonio_error *error) {
    double sigma;
    return gonio_meter_usbtmc.read(device, &stamp, 0, value, &sigma, error);
}

static void test_list_tells_what_is_there(void **state) {
    (void)state;
    need_wrapper();
    gonio_usbtmc_info *list = NULL;
    size_t n = 0;
    assert_int_equal(gonio_usbtmc_list(&list, &n, NULL), GONIO_OK);
    assert_int_equal(n, 1);
    assert_int_equal(list[0].vendor, MODEL_VENDOR);
    assert_int_equal(list[0].usb488, 1);
    assert_string_equal(list[0].model, "PM-1");
    assert_string_equal(list[0].serial, "S1");
    free(list);
}

static void test_no_match_is_named(void **state) {
    (void)state;
    need_wrapper();
    gonio_usbtmc *device = NULL;
    gonio_error error = {0};
    const gonio_usbtmc_match match = {MODEL_VENDOR, -1, "other"};
    assert_int_equal(gonio_usbtmc_open(&match, &device, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "other"));
    assert_null(device);
}

static void test_reading_and_its_sigma(void **state) {
    (void)state;
    need_wrapper();
    gonio_meter_usbtmc_config config = quick();
    config.scpi.scale = 1000;
    config.scpi.relative_sigma = 0.01;
    snprintf(config.scpi.setup, sizeof config.scpi.setup, "SENS:CORR:WAV 550");
    void *device = open_meter(&config);
    assert_string_equal(gonio_meter_usbtmc_identity(device), "GONIO,PM-1,S1,1.0");
    assert_string_equal(model.last_setup, "SENS:CORR:WAV 550\n");
    double value = 0, sigma = 0;
    assert_int_equal(gonio_meter_usbtmc.read(device, &stamp, 0.02, &value, &sigma, NULL), GONIO_OK);
    assert_true(fabs(value - 1.25) < 1e-9);
    assert_true(fabs(sigma - 0.0125) < 1e-9); // constant readings: only the stated part
    assert_true(model.measured >= 1);
    gonio_meter_usbtmc.close(device);
}

static void test_split_replies_are_joined(void **state) {
    (void)state;
    need_wrapper();
    const gonio_meter_usbtmc_config config = quick();
    for (size_t split = 1; split <= 17; split++) {
        model.split = split;
        void *device = open_meter(&config);
        double value = 0;
        assert_int_equal(read_meter(device, &value, NULL), GONIO_OK);
        assert_true(fabs(value - 1.25e-3) < 1e-12);
        gonio_meter_usbtmc.close(device);
    }
}

// Each fault once or twice: the reading still comes out right, and the next one without any recovery.
static void test_single_faults_are_survived(void **state) {
    (void)state;
    need_wrapper();
    int *const faults[] = {&model.faults.stall_out, &model.faults.stall_in,     &model.faults.mute,
                           &model.faults.stale,     &model.faults.headless,     &model.faults.long_claim,
                           &model.faults.wrong_id,  &model.faults.garbage,      &model.faults.bad_tag_check,
                           &model.faults.nan,       &model.faults.control_stall};
    const gonio_meter_usbtmc_config config = quick();
    for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) {
        for (int times = 1; times <= 2; times++) {
            void *device = open_meter(&config);
            *faults[i] = times;
            double value = 0;
            gonio_error error = {0};
            if (read_meter(device, &value, &error) != GONIO_OK || fabs(value - 1.25e-3) > 1e-12) {
                fail_msg("fault %zu x %d: %s, value %g", i, times, error.message, value);
            }
            *faults[i] = 0;
            const int clears = model.clears, aborts = model.aborts;
            model.power = 2.5e-3;
            assert_int_equal(read_meter(device, &value, NULL), GONIO_OK);
            model.power = 1.25e-3;
            assert_true(fabs(value - 2.5e-3) < 1e-12); // and it is the new one, not a left-over
            assert_int_equal(model.clears, clears);
            assert_int_equal(model.aborts, aborts);
            gonio_meter_usbtmc.close(device);
        }
    }
}

static void test_lasting_faults_end_in_time_and_named(void **state) {
    (void)state;
    need_wrapper();
    const struct {
        int *fault;
        const char *says;
        gonio_status status;
    } cases[] = {{&model.faults.mute, "no answer in time", GONIO_E_TIMEOUT},
                 {&model.faults.garbage, "not a number", GONIO_E_DEVICE},
                 {&model.faults.nan, "over range", GONIO_E_DEVICE},
                 {&model.faults.stale, "stale", GONIO_E_DEVICE},
                 {&model.faults.endless, "longer than", GONIO_E_DEVICE},
                 {&model.faults.stall_out, "PIPE", GONIO_E_DEVICE}};
    const gonio_meter_usbtmc_config config = quick();
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        void *device = open_meter(&config);
        *cases[i].fault = 1 << 20;
        double value = 0;
        gonio_error error = {0};
        const int64_t start = gonio_clock_ms();
        const gonio_status status = read_meter(device, &value, &error);
        // A generous bound: it only shows that nothing hangs.
        assert_true(gonio_clock_ms() - start < 20000);
        if (status != cases[i].status || strstr(error.message, cases[i].says) == NULL) {
            fail_msg("case %zu: status %d, '%s'", i, status, error.message);
        }
        *cases[i].fault = 0;
        assert_int_equal(read_meter(device, &value, NULL), GONIO_OK);
        gonio_meter_usbtmc.close(device);
    }
}

static void test_slow_clear_is_waited_for(void **state) {
    (void)state;
    need_wrapper();
    model.faults.clear_pending = 5;
    const gonio_meter_usbtmc_config config = quick();
    void *device = open_meter(&config);
    gonio_meter_usbtmc.close(device);
    model.faults.clear_refused = 1;
    gonio_error error = {0};
    assert_int_equal(gonio_meter_usbtmc_open(&config, &device, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "INITIATE_CLEAR"));
}

static void test_tags_wrap(void **state) {
    (void)state;
    need_wrapper();
    const gonio_meter_usbtmc_config config = quick();
    void *device = open_meter(&config);
    for (int i = 0; i < 300; i++) {
        model.power = 1e-3 * i;
        double value = -1;
        assert_int_equal(read_meter(device, &value, NULL), GONIO_OK);
        assert_true(fabs(value - 1e-3 * i) < 1e-9);
    }
    model.power = 1.25e-3;
    gonio_meter_usbtmc.close(device);
}

static void *plug_later(void *serial) {
    gonio_clock_sleep_ms(150);
    model_plug(serial);
    return NULL;
}

static void test_unplugged_and_plugged_again(void **state) {
    (void)state;
    need_wrapper();
    gonio_meter_usbtmc_config config = quick();
    config.scpi.replug_s = 5;
    void *device = open_meter(&config);
    double value = 0;
    model_unplug();
    GThread *thread = g_thread_new("plug", plug_later, "S1");
    gonio_error error = {0};
    const gonio_status status = read_meter(device, &value, &error);
    g_thread_join(thread);
    if (status != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    assert_true(fabs(value - 1.25e-3) < 1e-12);
    // A different instrument is not taken for it.
    model_unplug();
    assert_true(model_plug("S2"));
    gonio_meter_usbtmc.close(device);
    snprintf(config.match.serial, sizeof config.match.serial, "S1");
    assert_int_equal(gonio_meter_usbtmc_open(&config, &device, &error), GONIO_E_DEVICE);
    model_unplug();
}

static void test_unplugged_for_good(void **state) {
    (void)state;
    need_wrapper();
    const gonio_meter_usbtmc_config config = quick();
    void *device = open_meter(&config);
    model_unplug();
    double value = 0;
    gonio_error error = {0};
    assert_int_equal(read_meter(device, &value, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "plugged"));
    gonio_meter_usbtmc.close(device);
}

int main(int argc, char **argv) {
    (void)argc;
    const char *preload = getenv("LD_PRELOAD");
    wrapped = preload != NULL && strstr(preload, "libumockdev-preload") != NULL;
    if (!wrapped && getenv("GONIO_UMOCKDEV") == NULL) {
        setenv("GONIO_UMOCKDEV", "1", 1);
        // The wrapper preloads itself before the sanitizer's runtime; both work all the same.
        char options[256];
        const char *before = getenv("ASAN_OPTIONS");
        snprintf(options, sizeof options, "%s:verify_asan_link_order=0", before != NULL ? before : "");
        setenv("ASAN_OPTIONS", options, 1);
        execlp("umockdev-wrapper", "umockdev-wrapper", argv[0], (char *)NULL);
    }
    if (wrapped && !model_start()) {
        wrapped = false;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(test_list_tells_what_is_there, fresh),
        cmocka_unit_test_setup(test_no_match_is_named, fresh),
        cmocka_unit_test_setup(test_reading_and_its_sigma, fresh),
        cmocka_unit_test_setup(test_split_replies_are_joined, fresh),
        cmocka_unit_test_setup(test_single_faults_are_survived, fresh),
        cmocka_unit_test_setup(test_lasting_faults_end_in_time_and_named, fresh),
        cmocka_unit_test_setup(test_slow_clear_is_waited_for, fresh),
        cmocka_unit_test_setup(test_tags_wrap, fresh),
        cmocka_unit_test_setup(test_unplugged_and_plugged_again, fresh),
        cmocka_unit_test_setup(test_unplugged_for_good, fresh),
    };
    const int failed = cmocka_run_group_tests_name("usbtmc", tests, NULL, NULL);
    if (wrapped) {
        model_stop();
    }
    return failed;
}
