// SPDX-License-Identifier: BSD-3-Clause
// The SCPI meter on TCP against an emulated one: readings, units, faults of the line and of the meter.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "host/drivers/meter_scpi.h"
#include "tests/unit/line_emulators.h"
#include "tests/unit/near.h"

static emulator *begin(void) {
    emulator *e = emulator_start(EMULATOR_METER, 1);
    e->reading = "1.25E-03";
    e->identity = "GONIO,PM-3,S1,1.0";
    e->setup_error = "0,\"No error\"";
    return e;
}

static gonio_meter_scpi_config config_of(const emulator *e) {
    gonio_meter_scpi_config c;
    gonio_meter_scpi_defaults(&c);
    snprintf(c.line.port, sizeof c.line.port, "tcp:127.0.0.1:%d", e->port);
    c.line.timeout_ms = 100;
    c.scpi.replug_s = 2;
    return c;
}

static void *open_meter(const gonio_meter_scpi_config *c) {
    void *device = NULL;
    gonio_error error = {0};
    if (gonio_meter_scpi_open(c, &device, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    return device;
}

static gonio_status read_meter(void *device, double *value, gonio_error *error) {
    double sigma;
    return gonio_meter_scpi.read(device, NULL, 0, value, &sigma, error);
}

static void readings_and_units(void **state) {
    (void)state;
    static const struct {
        const char *reply;
        int unit;
        double value; // NaN: refused
        const char *words;
    } cases[] = {{"1.25E-03", GONIO_SCPI_LINEAR, 1.25e-3, ""},
                 {"2.5,0", GONIO_SCPI_LINEAR, 2.5, ""},
                 {"-10", GONIO_SCPI_DBM, 1e-4, ""},
                 {"-10.0 dBm", GONIO_SCPI_DBM, 1e-4, ""},
                 {"-10.0 dBm", GONIO_SCPI_LINEAR, NAN, "decibels"},
                 {"9.91E+37", GONIO_SCPI_LINEAR, NAN, "over range"},
                 {"over", GONIO_SCPI_LINEAR, NAN, "expected a number"}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        emulator *e = begin();
        gonio_meter_scpi_config c = config_of(e);
        c.scpi.unit = cases[k].unit;
        c.scpi.scale = 2;
        void *m = open_meter(&c);
        e->reading = cases[k].reply;
        double value = 0, sigma = 0;
        gonio_error error = {0};
        const gonio_status status = gonio_meter_scpi.read(m, NULL, 0.02, &value, &sigma, &error);
        if (isnan(cases[k].value)) {
            assert_true(status != GONIO_OK && strstr(error.message, cases[k].words) != NULL);
        } else {
            assert_int_equal(status, GONIO_OK);
            assert_near(value, 2 * cases[k].value, 1e-12);
            assert_near(sigma, 0.005 * value, 1e-12); // constant readings: only the stated part
        }
        gonio_meter_scpi.close(m);
        emulator_stop(e);
    }
}

static void faults_of_the_line_are_survived(void **state) {
    (void)state;
    for (int k = 0; k < 3; k++) {
        emulator *e = begin();
        gonio_meter_scpi_config c = config_of(e);
        void *m = open_meter(&c);
        if (k == 0) {
            e->mute = 2;
        } else if (k == 1) {
            e->garble = 1;
        } else {
            e->hang_up = true;
        }
        double value = 0;
        gonio_error error = {0};
        if (read_meter(m, &value, &error) != GONIO_OK) {
            fail_msg("%s", error.message);
        }
        assert_near(value, 1.25e-3, 1e-12);
        gonio_meter_scpi.close(m);
        emulator_stop(e);
    }
}

static void lasting_faults_are_named(void **state) {
    (void)state;
    emulator *e = begin();
    gonio_meter_scpi_config c = config_of(e);
    void *m = open_meter(&c);
    double value;
    gonio_error error = {0};
    e->mute = 1000;
    assert_int_equal(read_meter(m, &value, &error), GONIO_E_TIMEOUT);
    assert_non_null(strstr(error.message, "PM-3"));
    e->mute = 0;
    assert_int_equal(read_meter(m, &value, &error), GONIO_OK);
    e->identity = "GONIO,PM-3,S2,1.0"; // another one took its place
    e->hang_up = true;
    assert_true(read_meter(m, &value, &error) != GONIO_OK);
    assert_non_null(strstr(error.message, "another meter"));
    gonio_meter_scpi.close(m);
    emulator_stop(e);
}

static void a_refused_setup_is_told(void **state) {
    (void)state;
    static const char *const answers[] = {"0,\"No error\"", "-113,\"Undefined header\"", NULL, "what?"};
    for (int k = 0; k < 4; k++) {
        emulator *e = begin();
        e->setup_error = answers[k];
        gonio_meter_scpi_config c = config_of(e);
        snprintf(c.scpi.setup, sizeof c.scpi.setup, "SENS:CORR:WAV 550");
        void *m = NULL;
        gonio_error error = {0};
        assert_int_equal(gonio_meter_scpi_open(&c, &m, &error), k == 1 ? GONIO_E_INPUT : GONIO_OK);
        if (k == 1) {
            assert_non_null(strstr(error.message, "Undefined header"));
        } else {
            double value;
            assert_int_equal(read_meter(m, &value, &error), GONIO_OK);
            gonio_meter_scpi.close(m);
        }
        emulator_stop(e);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(readings_and_units),
        cmocka_unit_test(faults_of_the_line_are_survived),
        cmocka_unit_test(lasting_faults_are_named),
        cmocka_unit_test(a_refused_setup_is_told),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
