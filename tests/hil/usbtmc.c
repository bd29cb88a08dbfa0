// SPDX-License-Identifier: BSD-3-Clause
// The meter's driver on the USBTMC gadget, through the kernel's USB stack: readings, recovery, plugging.
// usage: usbtmc GADGET_FOLDER UDC    the gadget is bound to the UDC, its serial number is S1
#include <fcntl.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "host/drivers/meter_usbtmc.h"
#include "host/transport/clock.h"
#include "tests/hil/tap.h"

#define POWER 1.25e-3
static const char *gadget, *udc;
static const gonio_stamp stamp = {0};

static void put(const char *name, const char *text) {
    char path[256];
    snprintf(path, sizeof path, "%s/%s", gadget, name);
    const int fd = open(path, O_WRONLY);
    if (write(fd, text, strlen(text)) < 0) {
        check(false, path, "cannot be written");
    }
    close(fd);
}

static void plug(void) { put("UDC", udc); }
static void unplug(void) { put("UDC", "\n"); }

static gonio_meter_usbtmc_config config_of(const char *query) {
    gonio_meter_usbtmc_config config;
    gonio_meter_usbtmc_defaults(&config);
    config.match.vendor = 0x1209;
    config.timeout_ms = 700;
    config.scpi.replug_s = 10;
    snprintf(config.scpi.query, sizeof config.scpi.query, "%s", query);
    return config;
}

static void *open_meter(const char *query) {
    const gonio_meter_usbtmc_config config = config_of(query);
    gonio_error error = {0};
    void *device = NULL;
    for (int i = 0; i < 100; i++) { // until the bus has found it
        if (gonio_meter_usbtmc_open(&config, &device, &error) == GONIO_OK) {
            return device;
        }
        gonio_clock_sleep_ms(50);
    }
    check(false, query, "cannot be opened: %s", error.message);
    return NULL;
}

static void reads(void *device, const char *name) {
    double value = NAN, sigma = NAN;
    gonio_error error = {0};
    const gonio_status status = gonio_meter_usbtmc.read(device, &stamp, 0, &value, &sigma, &error);
    check(status == GONIO_OK && fabs(value - POWER) < 1e-12, name, "%s; read %g", error.message, value);
}

static void describe(void) {
    gonio_usbtmc_info *list = NULL;
    size_t n = 0;
    gonio_error error = {0};
    const gonio_status status = gonio_usbtmc_list(&list, &n, &error);
    check(status == GONIO_OK && n == 1 && strcmp(list[0].serial, "S1") == 0 && list[0].usb488 == 1,
          "the instrument is listed with its serial number", "%s; %zu found", error.message, n);
    free(list);
}

static void faults(void) {
    static const char *const queries[][2] = {{"STALL:MEAS?", "a stalled endpoint is cleared"},
                                             {"MUTE:MEAS?", "a query without an answer is aborted and repeated"},
                                             {"STALE:MEAS?", "an answer to another request is not taken"},
                                             {"SPLIT:MEAS?", "an answer in pieces is joined"},
                                             {"GARBAGE:MEAS?", "what is no number is asked for again"},
                                             {"ENDLESS:MEAS?", "an answer without an end is cut off"}};
    for (size_t i = 0; i < sizeof queries / sizeof *queries; i++) {
        void *device = open_meter(queries[i][0]);
        if (device != NULL) {
            reads(device, queries[i][1]);
            gonio_meter_usbtmc.close(device);
        }
    }
}

static void *plug_later(void *unused) {
    (void)unused;
    gonio_clock_sleep_ms(500);
    plug();
    return NULL;
}

static void plugging(void) {
    void *device = open_meter("MEAS:POW?");
    if (device == NULL) {
        return;
    }
    reads(device, "a reading over the kernel's USB stack");
    pthread_t thread;
    unplug();
    pthread_create(&thread, NULL, plug_later, NULL);
    reads(device, "unplugged and plugged in again, it goes on");
    pthread_join(thread, NULL);
    gonio_meter_usbtmc.close(device);

    gonio_meter_usbtmc_config config = config_of("MEAS:POW?");
    config.scpi.replug_s = 1;
    gonio_error error = {0};
    double value, sigma;
    if (gonio_meter_usbtmc_open(&config, &device, &error) != GONIO_OK) {
        check(false, "opened again", "%s", error.message);
        return;
    }
    unplug();
    put("strings/0x409/serialnumber", "S2");
    plug();
    gonio_clock_sleep_ms(1500);
    check(gonio_meter_usbtmc.read(device, &stamp, 0, &value, &sigma, &error) == GONIO_E_DEVICE &&
              strstr(error.message, "S1") != NULL,
          "another instrument is not taken for it", "%s", error.message);
    unplug();
    const int64_t start = gonio_clock_ms();
    check(gonio_meter_usbtmc.read(device, &stamp, 0, &value, &sigma, &error) == GONIO_E_DEVICE &&
              gonio_clock_ms() - start < 30000,
          "one that stays away is given up in time", "%s", error.message);
    gonio_meter_usbtmc.close(device);
}

int main(int argc, char **argv) {
    if (argc != 3) {
        return 2;
    }
    gadget = argv[1];
    udc = argv[2];
    void *device = open_meter("MEAS:POW?");
    if (device != NULL) {
        gonio_meter_usbtmc.close(device);
        describe();
        faults();
        plugging();
    }
    return failures > 0;
}
