// The settings of real devices in one struct, and the table of their keys.
#ifndef GONIO_DRIVERS_HARDWARE_KEYS_H
#define GONIO_DRIVERS_HARDWARE_KEYS_H

#include "host/drivers/hardware.h"
#include "host/drivers/keep_out.h"

typedef struct hardware_settings {
    char stage_driver[16], lamp_driver[16], meter_driver[16], camera_driver[16], interlock_driver[16];
    gonio_controller_config controller;
    char controller_record[256], controller_replay[256];
    gonio_stage_modbus_config stage;
    double shutter_settle_s;
    gonio_lamp_gpio_config lamp;
    gonio_meter_usbtmc_config meter;
    gonio_camera_v4l2_config camera;
    char camera_record[256], camera_replay[256];
    char trigger_line[64];
    bool trigger_low;
    double trigger_settle_s, trigger_pulse_s;
    gonio_interlock_gpio_config interlock;
    gonio_keep_out keep_out;
} hardware_settings;

void hardware_settings_default(hardware_settings *settings);
gonio_status hardware_settings_set(hardware_settings *settings, const char *section, const char *key, const char *value,
                                   bool *taken, bool *shared, gonio_error *error);
void hardware_settings_list(const hardware_settings *settings, char *text, size_t size);

#endif
