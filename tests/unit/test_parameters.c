// SPDX-License-Identifier: BSD-3-Clause
// The controller's parameters by name: every register has a key in the rig file, or a reason why not; keys and
// registers have the same bounds; what a rig file says is written when the rig is claimed, and told.
#include "tests/unit/controller_rig.h"

#include "host/drivers/driver.h"
#include "host/drivers/parameters.h"

// Of the stage's table and [controller]'s, by what gonio_parameter_key says.
static const gonio_key *key_of(const controller_register_info *p) {
    const char *shown = gonio_parameter_key(p, NULL);
    const char *const name = shown != NULL ? strchr(shown, ']') + 2 : "";
    const bool axis = shown != NULL && strncmp(shown, "[axis", 5) == 0,
               of_stage = axis || strncmp(name, "home_", 5) == 0;
    return of_stage ? gonio_key_find(gonio_driver_find(GONIO_DEVICE_STAGE, "modbus")->keys,
                                     axis ? "axis light_phi" : "stage", name)
                    : gonio_key_find(gonio_controller_keys, "controller", name);
}

static void test_every_register_has_a_key_or_a_reason(void **state) {
    (void)state;
    int n = 0, without = 0;
    const controller_register_info *p;
    for (int i = 0; (p = gonio_controller_register_at(i)) != NULL; i++) {
        if (!p->parameter) {
            continue;
        }
        const char *why = NULL, *key = gonio_parameter_key(p, &why);
        n++;
        without += key == NULL;
        if ((key == NULL) == (why == NULL)) {
            fail_msg("%s: %s", p->name, key == NULL ? "has neither a key nor a reason" : "has both");
        }
        if (key != NULL && key_of(p) == NULL) {
            fail_msg("%s: there is no key %s", p->name, key);
        }
        assert_ptr_equal(gonio_parameter_find(p->name), p);
    }
    assert_true(n >= 30);
    assert_int_equal(without, 2); // slave_address and baud
    assert_null(gonio_parameter_find("position"));
}

// Those of [controller] are the register's own, in another unit.
static void test_bounds_are_the_registers(void **state) {
    (void)state;
#define PARAMETER(key_name, key_kind, type, register_name, lowest, highest, factor)                                    \
    {                                                                                                                  \
        const controller_register_info *p = gonio_controller_register(CONTROLLER_##register_name);                     \
        const gonio_key *k = key_of(p);                                                                                \
        assert_string_equal(k->name, #key_name);                                                                       \
        if (k->kind == GONIO_KEY_FLAGS) {                                                                              \
            int names = 0;                                                                                             \
            while (k->names()[names] != NULL) {                                                                        \
                names++;                                                                                               \
            }                                                                                                          \
            assert_int_equal(p->maximum, (1 << names) - 1);                                                            \
        } else {                                                                                                       \
            assert_true(k->low *(factor) == (double)p->minimum && k->high * (factor) == (double)p->maximum);           \
        }                                                                                                              \
    }
#include "host/drivers/controller_parameters.def"
}

// Every parameter, at its bounds: as text and back; beyond them it is refused with what is possible.
static void test_text_and_back(void **state) {
    (void)state;
    const controller_register_info *p;
    for (int i = 0; (p = gonio_controller_register_at(i)) != NULL; i++) {
        const int64_t ends[] = {p->minimum, p->maximum, p->minimum / 2 + p->maximum / 2};
        for (int e = 0; p->parameter && e < 3; e++) {
            char text[400];
            int64_t back = -1;
            gonio_error error = {0};
            gonio_parameter_print(p, ends[e], text, sizeof text);
            must(gonio_parameter_parse(p, text, &back, &error), &error);
            if (back != ends[e]) {
                fail_msg("%s: %lld is '%s' is %lld", p->name, (long long)ends[e], text, (long long)back);
            }
        }
        int64_t value = 7;
        gonio_error error = {0};
        if (p->parameter) {
            assert_int_equal(gonio_parameter_parse(p, "1e30", &value, &error), GONIO_E_USAGE);
            assert_non_null(strstr(error.message, p->name));
            assert_non_null(strstr(error.message, "expected"));
            assert_int_equal(gonio_parameter_parse(p, "", &value, &error), GONIO_E_USAGE);
        }
    }
    int64_t value;
    gonio_error error = {0};
    assert_int_equal(gonio_parameter_parse(gonio_parameter_find("pulse"), "2.5", &value, &error), GONIO_E_USAGE);
    must(gonio_parameter_parse(gonio_parameter_find("temperature_max"), "80.125", &value, &error), &error);
    assert_int_equal(value, 80125);
    assert_string_equal(gonio_parameter_unit(gonio_parameter_find("temperature_max")), "degC");
}

// Read and written one by one: what is read is what the controller has, and no neighbour changes.
static void test_each_is_written_alone(void **state) {
    (void)state;
    start(true, 30, 1);
    open_controller();
    gonio_error error = {0};
    must(gonio_controller_claim(controller, &error), &error);
    const controller_register_info *p;
    for (int i = 0; (p = gonio_controller_register_at(i)) != NULL; i++) {
        for (int k = 0; p->parameter && p->address != CONTROLLER_deadman && k < p->count; k++) {
            int64_t before[GONIO_AXES], after[GONIO_AXES];
            must(gonio_parameter_read(controller, p, before, &error), &error);
            const int64_t other = before[k] == p->maximum ? p->minimum : p->maximum;
            must(gonio_parameter_write(controller, p, k, other, &error), &error);
            must(gonio_parameter_read(controller, p, after, &error), &error);
            for (int j = 0; j < p->count; j++) {
                if (after[j] != (j == k ? other : before[j])) {
                    fail_msg("%s %d: wrote %lld to %d, there is %lld", p->name, j, (long long)other, k,
                             (long long)after[j]);
                }
            }
            must(gonio_parameter_write(controller, p, k, before[k], &error), &error);
        }
    }
    stop();
}

// What the rig file says is written with the first command, told, and un-homes where a step means something else then;
// who only looks writes nothing.
static void test_rig_file_is_written_when_claimed(void **state) {
    (void)state;
    start(true, 30, 1);
    config.parameters.settle_ms = 7;
    config.parameters.safe_lamp_percent = 12.5;
    config.parameters.lamp_rise_s = 1.5;
    config.parameters.temperature_max_c = -3.25;
    config.parameters.input_enable = 0x1001;
    config.parameters.direction_invert = 4;
    struct fw_core *core = &b.shared->machine.core;
    const struct fw_registers before = core->registers;
    core->known = 15;
    open_controller();
    gonio_error error = {0};
    gonio_controller_status now;
    must(gonio_controller_read_status(controller, &now, &error), &error);
    assert_true(core->registers.settle[0] == before.settle[0] && events[0] == 0);
    must(gonio_controller_claim(controller, &error), &error);
    const struct fw_registers *r = &core->registers;
    assert_true(r->settle[0] == 7 && r->safe_lamp[0] == 1250 && r->lamp_rise[0] == 1500);
    assert_true(r->temperature_max[0] == -3250 && r->input_enable[0] == 0x1001 && r->direction_invert[0] == 4);
    assert_true(r->pulse[0] == before.pulse[0] && r->monitor_average[0] == before.monitor_average[0]);
    assert_int_equal(core->known, 11);
    assert_non_null(strstr(events, "settle: the controller had 50 ms, the rig file has 7 ms"));
    assert_non_null(strstr(events, "the rig file has home_light_theta,estop"));
    assert_non_null(strstr(events, "the rig file has camera_theta; home those axes again"));
    assert_true(gonio_controller_gives(controller, CONTROLLER_settle));
    assert_false(gonio_controller_gives(controller, CONTROLLER_pulse));
    events[0] = 0;
    close_drivers();
    open_controller();
    must(gonio_controller_claim(controller, &error), &error);
    assert_null(strstr(events, "parameters")); // there is no difference any more
    stop();
}

// One axis is homed, jogged and released, the others stay as they are.
static void test_single_axes(void **state) {
    (void)state;
    start(true, 30, 1);
    open_stage();
    struct fw_core *core = &b.shared->machine.core;
    gonio_error error = {0};
    for (int k = 0; k < GONIO_AXES; k++) {
        core->known = 0;
        must(gonio_stage_modbus_home(stage, 1u << k, 100, &error), &error);
        assert_int_equal(core->known, 1 << k);
        const int64_t from = core->step.position[k];
        must(gonio_stage_modbus_release(stage, 1u << k, &error), &error);
        assert_true(core->known == 0 && (core->axis.energised >> k & 1) == 0);
        must(gonio_stage_modbus_jog(stage, k, 3, &error), &error);
        assert_true(core->step.position[k] == from + 300 && core->known == 0);
        assert_int_equal(gonio_stage_modbus_jog(stage, k, 100.01, &error), GONIO_E_RANGE);
        assert_non_null(strstr(error.message, "100 deg"));
        assert_true(core->step.position[k] == from + 300);
    }
    stop();
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_register_has_a_key_or_a_reason),
        cmocka_unit_test(test_bounds_are_the_registers),
        cmocka_unit_test(test_text_and_back),
        cmocka_unit_test(test_each_is_written_alone),
        cmocka_unit_test(test_rig_file_is_written_when_claimed),
        cmocka_unit_test(test_single_axes),
    };
    return cmocka_run_group_tests_name("parameters", tests, NULL, NULL);
}
