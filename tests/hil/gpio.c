// SPDX-License-Identifier: BSD-3-Clause
// Contacts, lamp and a move on lines of the kernel's gpio-sim. The arms are the controller's posix board.
// usage: gpio SYSFS_FOLDER_OF_THE_CHIP CONTROLLER_PORT    lines 0..3: gonio-estop, gonio-door, gonio-lamp,
// gonio-shutter
#include <fcntl.h>
#include <math.h>
#include <pthread.h>
#include <string.h>
#include <unistd.h>

#include "host/drivers/interlock_gpio.h"
#include "host/drivers/lamp_gpio.h"
#include "host/drivers/stage_modbus.h"
#include "host/transport/clock.h"
#include "tests/hil/tap.h"

enum { ESTOP, DOOR, LAMP, SHUTTER };
static const char *chip;

static void pull(int line, bool up) {
    char path[200];
    snprintf(path, sizeof path, "%s/sim_gpio%d/pull", chip, line);
    const int fd = open(path, O_WRONLY);
    const char *text = up ? "pull-up" : "pull-down";
    if (write(fd, text, strlen(text)) < 0) {
        check(false, path, "cannot be written");
    }
    close(fd);
}

static int level(int line) {
    char path[200], text[4] = "";
    snprintf(path, sizeof path, "%s/sim_gpio%d/value", chip, line);
    const int fd = open(path, O_RDONLY);
    const ssize_t n = read(fd, text, sizeof text - 1);
    close(fd);
    return n > 0 ? text[0] - '0' : -1;
}

static gonio_interlock_gpio_config contacts(void) {
    gonio_interlock_gpio_config config;
    gonio_interlock_gpio_defaults(&config);
    snprintf(config.contacts[0].line, sizeof config.contacts[0].line, "gonio-estop");
    snprintf(config.contacts[1].line, sizeof config.contacts[1].line, "gonio-door");
    for (int i = 0; i < 2; i++) {
        config.contacts[i].bias = GONIO_GPIO_AS_IS; // the simulated pull is the contact itself
    }
    return config;
}

// Closed contacts pull their lines down.
static void close_contacts(void) {
    pull(ESTOP, false);
    pull(DOOR, false);
}

static void expect(void *interlock, const char *says, const char *name) {
    gonio_error error = {0};
    const gonio_status status = gonio_interlock_gpio.check(interlock, &error);
    check(says == NULL ? status == GONIO_OK : status == GONIO_E_DEVICE && strstr(error.message, says) != NULL, name,
          "status %d, '%s'", status, error.message);
}

static void interlock(void) {
    const gonio_interlock_gpio_config config = contacts();
    gonio_error error = {0};
    void *device;
    close_contacts();
    if (gonio_interlock_gpio_open(&config, &gonio_gpio_system, NULL, &device, &error) != GONIO_OK) {
        check(false, "contacts by name", "%s", error.message);
        return;
    }
    expect(device, NULL, "closed contacts let everything run");
    pull(ESTOP, true);
    gonio_clock_sleep_ms(20);
    expect(device, "emergency stop is active", "an open emergency stop is told");
    pull(DOOR, true);
    gonio_clock_sleep_ms(20);
    expect(device, "door is active", "so is the door");
    close_contacts();
    gonio_clock_sleep_ms(20);
    gonio_interlock_gpio.check(device, NULL);
    gonio_clock_sleep_ms(20);
    expect(device, NULL, "closed again, they are quiet");
    // The edges wait in the kernel: what was pressed and let go between two looks is not lost.
    pull(ESTOP, true);
    gonio_clock_sleep_ms(20);
    pull(ESTOP, false);
    gonio_clock_sleep_ms(20);
    expect(device, "emergency stop was active", "a press between two looks is not lost");
    gonio_clock_sleep_ms(20);
    expect(device, NULL, "and is told once");
    // More edges than the kernel's queue of 16 holds, all bounces, ending closed.
    for (int i = 0; i < 40; i++) {
        pull(DOOR, i % 2 == 0);
    }
    gonio_clock_sleep_ms(20);
    gonio_interlock_gpio.check(device, NULL);
    gonio_clock_sleep_ms(20);
    expect(device, NULL, "after more edges than the kernel keeps, the level counts");
    gonio_interlock_gpio.close(device);
    gonio_interlock_gpio_config offset = config;
    snprintf(offset.contacts[0].line, sizeof offset.contacts[0].line, "%s:0", strrchr(chip, '/') + 1);
    check(gonio_interlock_gpio_open(&offset, &gonio_gpio_system, NULL, &device, &error) == GONIO_OK,
          "a contact by chip and offset", "%s", error.message);
    void *second;
    check(gonio_interlock_gpio_open(&config, &gonio_gpio_system, NULL, &second, &error) == GONIO_E_DEVICE &&
              strstr(error.message, "holds it") != NULL,
          "a line that another program holds is named", "%s", error.message);
    gonio_interlock_gpio.close(device);
}

static void lamp(void) {
    gonio_lamp_gpio_config config = {.shutter_low = true};
    snprintf(config.enable_line, sizeof config.enable_line, "gonio-lamp");
    snprintf(config.shutter_line, sizeof config.shutter_line, "gonio-shutter");
    gonio_error error = {0};
    void *device;
    if (gonio_lamp_gpio_open(&config, &gonio_gpio_system, NULL, &device, &error) != GONIO_OK) {
        check(false, "lamp lines", "%s", error.message);
        return;
    }
    check(level(LAMP) == 0 && level(SHUTTER) == 1, "lamp and shutter start off and closed", "%d, %d", level(LAMP),
          level(SHUTTER));
    gonio_lamp_gpio.set_level(device, 1, &error);
    gonio_lamp_gpio.set_shutter(device, true, &error);
    check(level(LAMP) == 1 && level(SHUTTER) == 0, "lamp on, shutter (active low) open", "%d, %d: %s", level(LAMP),
          level(SHUTTER), error.message);
    gonio_lamp_gpio.close(device);
}

static void *press_later(void *unused) {
    (void)unused;
    gonio_clock_sleep_ms(400);
    pull(ESTOP, true);
    return NULL;
}

static double light_deg(void *stage) {
    double at[GONIO_AXES] = {NAN};
    return gonio_stage_modbus.position(stage, at, NULL) == GONIO_OK ? at[GONIO_LIGHT_THETA] * 180 / GONIO_PI : NAN;
}

// The emergency stop opens while the arms move: they stop on the way, and stay there.
static void stop_in_mid_move(const char *port) {
    gonio_controller_config line;
    gonio_controller_defaults(&line);
    snprintf(line.modbus.port, sizeof line.modbus.port, "%s", port);
    line.modbus.timeout_ms = 1000;
    gonio_stage_modbus_config config;
    gonio_stage_modbus_defaults(&config);
    for (int i = 0; i < GONIO_AXES; i++) {
        config.axes[i] = (gonio_axis_config){100, 20, 2000, 40000, -180, 180, 0, NAN, NAN, NAN, NAN, NAN, 0, 0, 0, 1};
    }
    const gonio_interlock_gpio_config wired = contacts();
    gonio_controller *controller = NULL;
    gonio_error error = {0};
    void *stage = NULL;
    close_contacts();
    config.interlock = &gonio_interlock_gpio;
    const bool ready =
        gonio_interlock_gpio_open(&wired, &gonio_gpio_system, NULL, &config.interlock_device, &error) == GONIO_OK &&
        gonio_controller_open(&line, &controller, &error) == GONIO_OK &&
        gonio_stage_modbus_open(&config, controller, &stage, &error) == GONIO_OK &&
        gonio_stage_modbus.home(stage, 30, &error) == GONIO_OK;
    if (check(ready, "arms and contacts are there", "%s", error.message)) {
        const double to[GONIO_AXES] = {GONIO_PI / 2, 0, 0, 0}; // 4.5 s of way
        const gonio_stamp stamp = {0};
        pthread_t thread;
        pthread_create(&thread, NULL, press_later, NULL);
        const gonio_status status = gonio_stage_modbus.move(stage, to, 1, &stamp, 60, &error);
        pthread_join(thread, NULL);
        const double here = light_deg(stage);
        gonio_clock_sleep_ms(200);
        check(status == GONIO_E_DEVICE && strstr(error.message, "emergency stop") != NULL,
              "an emergency stop in mid-move ends the move and is named", "status %d, '%s'", status, error.message);
        check(here > 0.5 && here < 89 && light_deg(stage) == here, "the arms stand on the way", "at %g, then %g deg",
              here, light_deg(stage));
        check(gonio_stage_modbus.move(stage, to, 2, &stamp, 60, &error) == GONIO_E_DEVICE && light_deg(stage) == here,
              "nothing moves while it is pressed", "at %g deg, '%s'", light_deg(stage), error.message);
    }
    if (stage != NULL) {
        gonio_stage_modbus.close(stage);
    }
    gonio_controller_release(controller);
    if (config.interlock_device != NULL) {
        gonio_interlock_gpio.close(config.interlock_device);
    }
}

int main(int argc, char **argv) {
    if (argc != 3) {
        return 2;
    }
    chip = argv[1];
    interlock();
    lamp();
    stop_in_mid_move(argv[2]);
    return failures > 0;
}
