// SPDX-License-Identifier: BSD-3-Clause
// What devices answer and what a rig file asks of them: keys, tables of drives, tapes of a controller, of drives and of
// a camera, raw frames.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/drivers/hardware.h"
#include "host/drivers/stage_modbus.h"
#include "host/drivers/stage_modbus_table.h"
#include "tests/fuzz/memory_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

// section, key and value, each ended by a line feed.
static void keys(const uint8_t *data, size_t size) {
    const gonio_hardware_hooks hooks = {0};
    gonio_hardware *hardware;
    char text[400], list[1024];
    if (size >= sizeof text || gonio_hardware_new(&hooks, &hardware, NULL) != GONIO_OK) {
        return;
    }
    memcpy(text, data, size);
    text[size] = 0;
    char *rest = text;
    while (rest != NULL) {
        const char *section = strsep(&rest, "\n"), *key = rest != NULL ? strsep(&rest, "\n") : NULL;
        const char *value = rest != NULL ? strsep(&rest, "\n") : NULL;
        bool taken, shared;
        gonio_error error = {0};
        if (value != NULL && gonio_hardware_set(hardware, section, key, value, &taken, &shared, &error) != GONIO_OK &&
            error.message[0] == 0) {
            abort();
        }
    }
    gonio_hardware_list(hardware, "camera", list, sizeof list);
    gonio_hardware_elsewhere(hardware, "camera", "device", NULL);
    gonio_hardware_free(hardware);
}

static void controller(const char *path) {
    gonio_tape *tape;
    if (gonio_tape_open(path, &tape, NULL) != GONIO_OK) {
        return;
    }
    gonio_controller_config config;
    gonio_controller_defaults(&config);
    strcpy(config.modbus.port, "tape");
    config.tape = tape;
    config.mode = GONIO_TAPE_REPLAY;
    config.replug_s = 0;
    gonio_controller *c;
    if (gonio_controller_open(&config, &c, NULL) == GONIO_OK) {
        gonio_stage_modbus_config stage_config;
        gonio_stage_modbus_defaults(&stage_config);
        void *stage;
        const gonio_stamp stamp = {0};
        double rad[GONIO_AXES] = {0.1, 0.2, 0.3, 0.4};
        if (gonio_stage_modbus_open(&stage_config, c, &stage, NULL) == GONIO_OK) {
            gonio_stage_modbus.home(stage, 0.01, NULL);
            gonio_stage_modbus.move(stage, rad, 1, &stamp, 0.01, NULL);
            gonio_stage_modbus.position(stage, rad, NULL);
            gonio_stage_modbus.duration_s(stage, rad, (double[]){0, 0, 0, 0});
            gonio_stage_modbus.close(stage);
        }
        gonio_controller_release(c);
    }
    gonio_tape_close(tape);
}

static void drives(const char *path) {
    gonio_stage_modbus_table_config config;
    const gonio_driver_context context = {0};
    void *stage;
    double rad[GONIO_AXES] = {0.1, 0.2, 0.3, 0.4};
    gonio_stage_modbus_table_defaults(&config);
    strcpy(config.line.modbus.port, "tape");
    snprintf(config.line.replay, sizeof config.line.replay, "%s", path);
    strcpy(config.table, "leadshine");
    config.line.replug_s = 0;
    config.axes[0].slave = 1;
    if (gonio_stage_modbus_table_open(&config, &context, &stage, NULL) == GONIO_OK) {
        gonio_stage_modbus_table.home(stage, 0.01, NULL);
        gonio_stage_modbus_table.move(stage, rad, 1, NULL, 0.01, NULL);
        gonio_stage_modbus_table.position(stage, rad, NULL);
        gonio_stage_modbus_table.close(stage);
    }
}

static void table(const char *path) {
    const gonio_modbus_texts none = {.read = ""};
    gonio_modbus_table read;
    gonio_error error = {0};
    if (gonio_modbus_table_read(path, &none, &read, &error) != GONIO_OK && error.message[0] == 0) {
        abort();
    }
}

static void camera(const char *path) {
    gonio_tape *tape;
    gonio_v4l2_recorder *recorder;
    if (gonio_tape_open(path, &tape, NULL) != GONIO_OK) {
        return;
    }
    gonio_camera_v4l2_config config;
    gonio_camera_v4l2_defaults(&config);
    config.replug_s = 0;
    config.fixed_exposure_s = 0.01;
    void *device;
    if (gonio_v4l2_recorder_new(tape, &gonio_v4l2_system, NULL, &recorder, NULL) == GONIO_OK) {
        if (gonio_camera_v4l2_open(&config, &gonio_v4l2_replaying, recorder, &device, NULL) == GONIO_OK) {
            uint16_t pixels[64];
            gonio_frame frame = {.pixels = pixels};
            const gonio_stamp stamp = {0};
            gonio_camera_v4l2.capture(device, &(gonio_window){0, 0, 8, 8}, 0.01, 0, &stamp, 0.01, &frame, NULL);
            gonio_camera_v4l2.close(device);
        }
        gonio_v4l2_recorder_free(recorder);
    }
    gonio_tape_close(tape);
}

static void frame(const uint8_t *data, size_t size) {
    static const char *const names[] = {"GREY", "Y16", "Y12", "Y10P", "Y12P", "Y14P", "Y10BPACK", "UYVY", "Y16_BE"};
    if (size < 8) {
        return;
    }
    const gonio_pixel_format *format = gonio_pixel_format_named(names[data[0] % 9]);
    const int width = data[1] % 33, height = data[2] % 33;
    const gonio_window window = {data[3] % 40 - 2, data[4] % 40 - 2, data[5] % 34, data[6] % 34};
    uint16_t *out = malloc(34 * 34 * sizeof *out);
    uint8_t *bytes = malloc(size - 7); // of its own, so that a byte too many shows
    memcpy(bytes, data + 8, size - 8);
    gonio_pixels_unpack(format, bytes, size - 8, data[7], width, height, &window, 0, out, NULL);
    free(bytes);
    free(out);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size == 0) {
        return 0;
    }
    switch (data[0] % 6) {
    case 0:
        keys(data + 1, size - 1);
        break;
    case 1:
        controller(memory_file(data + 1, size - 1));
        break;
    case 2:
        camera(memory_file(data + 1, size - 1));
        break;
    case 3:
        frame(data + 1, size - 1);
        break;
    case 4:
        drives(memory_file(data + 1, size - 1));
        break;
    default:
        table(memory_file(data + 1, size - 1));
    }
    return 0;
}
