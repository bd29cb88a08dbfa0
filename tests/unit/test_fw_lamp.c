// SPDX-License-Identifier: BSD-3-Clause
// Lamp, monitor and trigger on the simulated machine.
#include "tests/unit/fw_rig.h"

static void starts_softly_and_warms_up(void **state) {
    (void)state;
    struct machine *m = rig_new();
    m->core.registers.lamp_rise[0] = 1000;
    m->core.registers.lamp_warm_up[0] = 3000;
    m->core.registers.lamp_level[0] = 8000;
    assert_true(gonio_fw_lamp_switch(&m->core, true));
    uint16_t before = 0;
    for (unsigned ms = 0; ms < 799; ms++) {
        gonio_machine_run(m, 1000);
        assert_in_range(m->lamp - before, 9, 12); // 10000 / 1000 ms
        before = m->lamp;
        assert_int_equal(m->core.lamp.state, FW_LAMP_RISING);
    }
    gonio_machine_run(m, 5000);
    assert_int_equal(m->lamp, 8000);
    assert_int_equal(m->core.lamp.state, FW_LAMP_WARMING);
    gonio_machine_run(m, 2980000);
    assert_int_equal(m->core.lamp.state, FW_LAMP_WARMING);
    gonio_machine_run(m, 30000);
    assert_int_equal(m->core.lamp.state, FW_LAMP_READY);
    m->core.registers.lamp_level[0] = 5000; // another level warms up anew
    gonio_machine_run(m, 2000);
    assert_int_equal(m->lamp, 5000);
    assert_int_equal(m->core.lamp.state, FW_LAMP_WARMING);
    assert_true(gonio_fw_lamp_switch(&m->core, false));
    gonio_machine_run(m, 2000);
    assert_int_equal(m->lamp, 0);
    assert_int_equal(m->core.lamp.state, FW_LAMP_OFF);
    free(m);
}

static void level_zero_is_a_level(void **state) {
    (void)state;
    struct machine *m = rig_new();
    m->core.registers.lamp_level[0] = 0;
    m->core.registers.lamp_warm_up[0] = 10;
    assert_true(gonio_fw_lamp_switch(&m->core, true));
    gonio_machine_run(m, 20000);
    assert_int_equal(m->core.lamp.state, FW_LAMP_READY);
    assert_int_equal(m->lamp, 0);
    free(m);
}

static void monitor_is_a_mean_with_a_time(void **state) {
    (void)state;
    struct machine *m = rig_new();
    m->core.registers.lamp_rise[0] = 0;
    m->core.registers.lamp_level[0] = 4000;
    m->core.registers.monitor_average[0] = 100;
    assert_true(gonio_fw_lamp_switch(&m->core, true));
    gonio_machine_run(m, 250000);
    assert_int_equal(m->core.registers.monitor[0], (4000u * 6 + 100) << 16);
    const int64_t middle = m->core.registers.monitor_time[0];
    gonio_fw_core_refresh(&m->core);
    const int64_t age = m->core.registers.time[0] - middle;
    assert_true(age >= 50000 - 2000 && age <= 150000 + 2000);
    gonio_machine_run(m, 100000);
    assert_true(m->core.registers.monitor_time[0] - middle == 100000);
    free(m);
}

static void trigger_follows_the_settling(void **state) {
    (void)state;
    struct machine *m = rig_homed();
    m->core.registers.trigger_auto[0] = 1;
    m->core.registers.settle[0] = 30;
    m->core.registers.trigger_pulse[0] = 3;
    const int64_t target[FW_AXES] = {1500, 0, 0, 0};
    assert_int_equal(gonio_machine_move(m, 1, target), FW_REFUSAL_NONE);
    uint64_t stood = 0, rose = 0, fell = 0;
    while (fell == 0) {
        gonio_machine_run(m, 500);
        if (stood == 0 && !m->core.axis.under_way)
            stood = m->now_us;
        if (rose == 0 && m->trigger)
            rose = m->now_us;
        if (rose != 0 && fell == 0 && !m->trigger)
            fell = m->now_us;
        assert_true(m->now_us < MINUTE_US);
    }
    assert_in_range(rose - stood, 29000, 32500);
    assert_in_range(fell - rose, 2500, 4500);
    assert_int_equal(m->core.registers.trigger_count[0], 1);
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_TRIGGER, 0), FW_REFUSAL_NONE);
    assert_true(m->trigger);
    assert_int_equal(m->core.registers.trigger_count[0], 2);
    free(m);
}

// Each output of either polarity, in every state of the lamp, and in a processor fault.
static void outputs_of_either_polarity(void **state) {
    (void)state;
    for (unsigned invert = 0; invert < 8; invert++) {
        struct machine *m = rig_homed();
        const bool shutter = invert >> FW_OUTPUT_shutter & 1, lamp = invert >> FW_OUTPUT_lamp & 1,
                   trigger = invert >> FW_OUTPUT_trigger & 1;
        struct fw_registers *r = &m->core.registers;
        r->output_invert[0] = (uint16_t)invert;
        r->lamp_rise[0] = 0;
        r->lamp_level[0] = 4000;
        gonio_fw_core_parameters_changed(&m->core);
        assert_true(m->shutter == shutter && m->trigger == trigger && m->lamp == (lamp ? 10000 : 0));
        assert_true(gonio_fw_lamp_switch(&m->core, true) && gonio_fw_lamp_shutter(&m->core, true));
        gonio_machine_run(m, 3000);
        assert_true(m->shutter != shutter && m->lamp == (lamp ? 6000 : 4000));
        assert_int_equal(gonio_machine_command(m, FW_COMMAND_TRIGGER, 0), FW_REFUSAL_NONE);
        assert_true(m->trigger != trigger);
        gonio_machine_run(m, 3000);
        assert_true(m->trigger == trigger);
        gonio_machine_hold(m, FW_CONTACT_estop, true);
        gonio_machine_run(m, 100);
        assert_true(m->shutter == shutter && m->lamp == (lamp ? 10000 : 0));
        gonio_machine_release(m, FW_CONTACT_estop);
        gonio_machine_run(m, 2000);
        assert_int_equal(gonio_machine_command(m, FW_COMMAND_CLEAR, 0), FW_REFUSAL_NONE);
        assert_true(gonio_fw_lamp_switch(&m->core, true) && gonio_fw_lamp_shutter(&m->core, true));
        gonio_machine_run(m, 3000);
        gonio_fw_interlock_fault(&m->core);
        assert_true(m->shutter == shutter && m->lamp == (lamp ? 10000 : 0));
        free(m);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(starts_softly_and_warms_up), cmocka_unit_test(level_zero_is_a_level),
        cmocka_unit_test(monitor_is_a_mean_with_a_time), cmocka_unit_test(trigger_follows_the_settling),
        cmocka_unit_test(outputs_of_either_polarity)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
