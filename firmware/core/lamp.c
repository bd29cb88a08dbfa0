// SPDX-License-Identifier: BSD-3-Clause
#include "firmware/core/lamp.h"

#include "firmware/contract/adc.h"
#include "firmware/contract/pin.h"
#include "firmware/core/core.h"

enum { FULL_DRIVE = 10000, DRIVE_BITS = 16 };

// The emergency stop's interrupt has made the lamp safe before the main loop learns of it.
static bool alarmed(const struct fw_core *core) {
    return core->state == FW_STATE_ALARM || core->state == FW_STATE_ESTOP || core->interlock.estop;
}

static bool inverted(const struct fw_core *core, enum fw_output output) {
    return (core->registers.output_invert[0] >> output & 1) != 0;
}

void gonio_fw_lamp_outputs(struct fw_core *core) {
    const uint16_t drive = core->lamp.output;
    gonio_fw_board_lamp(core, inverted(core, FW_OUTPUT_lamp) ? (uint16_t)(FULL_DRIVE - drive) : drive);
    gonio_fw_board_shutter(core, core->lamp.open != inverted(core, FW_OUTPUT_shutter));
    gonio_fw_board_trigger(core, core->lamp.pulsing != inverted(core, FW_OUTPUT_trigger));
}

void gonio_fw_lamp_dark(struct fw_core *core) {
    gonio_fw_board_lamp(core, inverted(core, FW_OUTPUT_lamp) ? FULL_DRIVE : 0);
    gonio_fw_board_shutter(core, inverted(core, FW_OUTPUT_shutter));
}

static void put(struct fw_core *core, uint32_t drive) {
    core->lamp.drive = drive;
    core->lamp.output = (uint16_t)(drive >> DRIVE_BITS);
    gonio_fw_lamp_outputs(core);
}

bool gonio_fw_lamp_switch(struct fw_core *core, bool on) {
    if (on && gonio_fw_core_ready(core) != FW_REFUSAL_NONE && gonio_fw_core_ready(core) != FW_REFUSAL_BUSY)
        return false;
    if (on && !core->lamp.on)
        core->lamp.state = FW_LAMP_RISING;
    core->lamp.on = on;
    return true;
}

bool gonio_fw_lamp_shutter(struct fw_core *core, bool open) {
    if (open && gonio_fw_core_ready(core) != FW_REFUSAL_NONE && gonio_fw_core_ready(core) != FW_REFUSAL_BUSY)
        return false;
    core->lamp.open = open;
    gonio_fw_lamp_outputs(core);
    return true;
}

void gonio_fw_lamp_safe(struct fw_core *core) {
    struct fw_lamp *lamp = &core->lamp;
    const uint32_t most = core->interlock.dark ? 0 : (uint32_t)core->registers.safe_lamp[0] << DRIVE_BITS;
    lamp->on = lamp->open = false;
    lamp->state = FW_LAMP_SAFE;
    put(core, lamp->drive < most ? lamp->drive : most);
}

void gonio_fw_lamp_trigger(struct fw_core *core) {
    core->lamp.pulsing = true;
    core->lamp.pulse_since = core->ms;
    core->registers.trigger_count[0]++;
    gonio_fw_lamp_outputs(core);
}

static void poll_drive(struct fw_core *core) {
    struct fw_lamp *lamp = &core->lamp;
    if (alarmed(core))
        return; // as gonio_fw_lamp_safe left it
    if (!lamp->on) {
        lamp->state = FW_LAMP_OFF;
        if (lamp->drive != 0)
            put(core, 0);
        return;
    }
    const uint32_t wanted = (uint32_t)core->registers.lamp_level[0] << DRIVE_BITS;
    const uint32_t rise_ms = core->registers.lamp_rise[0];
    const uint32_t full = (uint32_t)FULL_DRIVE << DRIVE_BITS, slope = rise_ms > 0 ? full / rise_ms + 1 : full;
    if (lamp->drive != wanted) {
        const bool rising = lamp->drive < wanted && wanted - lamp->drive > slope;
        put(core, rising ? lamp->drive + slope : wanted);
        lamp->state = rising ? FW_LAMP_RISING : FW_LAMP_WARMING;
        lamp->since = core->ms;
    } else if (lamp->state == FW_LAMP_RISING) { // to level 0
        lamp->state = FW_LAMP_WARMING;
        lamp->since = core->ms;
    } else if (lamp->state == FW_LAMP_WARMING && core->ms - lamp->since >= core->registers.lamp_warm_up[0]) {
        lamp->state = FW_LAMP_READY;
    }
}

static void poll_monitor(struct fw_core *core) {
    struct fw_lamp *lamp = &core->lamp;
    if (lamp->readings == 0)
        lamp->first_us = core->time_us;
    lamp->sum += gonio_fw_board_photodiode(core);
    lamp->readings++;
    if (lamp->readings < core->registers.monitor_average[0])
        return;
    core->registers.monitor[0] = (uint32_t)(((uint64_t)lamp->sum << 16) / lamp->readings);
    core->registers.monitor_time[0] = lamp->first_us + (core->time_us - lamp->first_us) / 2;
    lamp->sum = 0;
    lamp->readings = 0;
}

void gonio_fw_lamp_poll(struct fw_core *core) {
    struct fw_lamp *lamp = &core->lamp;
    core->registers.temperature[0] = gonio_fw_board_temperature(core);
    poll_drive(core);
    poll_monitor(core);
    if (lamp->pulsing && core->ms - lamp->pulse_since >= core->registers.trigger_pulse[0]) {
        lamp->pulsing = false;
        gonio_fw_lamp_outputs(core);
    }
}
