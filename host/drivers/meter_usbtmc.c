// SPDX-License-Identifier: BSD-3-Clause
// Queries are repeated at will (reading changes nothing), so every fault of the transport is answered by a clear and a
// bounded retry, an unplugged device by opening it again under the same serial number.
#include "host/drivers/meter_usbtmc.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "host/drivers/driver.h"
#include "host/transport/clock.h"

// SCPI-1999 section 7.2.1: these numbers stand for infinity and for "not a number".
#define SCPI_INFINITY 9.9e37
enum { REPLY_MAX = 512, READINGS_MAX = 10000 };

typedef struct meter {
    gonio_meter_usbtmc_config config;
    gonio_usbtmc *usb; // NULL while unplugged
    char identity[256];
} meter;

void gonio_meter_usbtmc_defaults(gonio_meter_usbtmc_config *config) {
    *config = (gonio_meter_usbtmc_config){.match = {-1, -1, ""},
                                          .query = "MEAS:POW?",
                                          .scale = 1,
                                          .relative_sigma = 0.005,
                                          .retries = 3,
                                          .timeout_ms = 2000,
                                          .replug_s = 10};
}

// One query, one answer: blanks and line ends at its end cut off, terminated.
static gonio_status query_once(meter *m, const char *query, char *reply, gonio_error *error) {
    char line[sizeof m->config.setup + 1];
    const int length = snprintf(line, sizeof line, "%s\n", query);
    size_t n = 0;
    gonio_status status = gonio_usbtmc_write(m->usb, line, (size_t)length, m->config.timeout_ms, error);
    if (status == GONIO_OK) {
        status = gonio_usbtmc_read(m->usb, reply, REPLY_MAX - 1, &n, m->config.timeout_ms, error);
    }
    while (n > 0 && (reply[n - 1] == '\n' || reply[n - 1] == '\r' || reply[n - 1] == ' ')) {
        n--;
    }
    reply[n] = 0;
    return status;
}

static gonio_status set_up(meter *m, gonio_error *error) {
    char reply[REPLY_MAX];
    gonio_status status = query_once(m, "*IDN?", reply, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (m->identity[0] != 0 && strncmp(reply, m->identity, sizeof m->identity - 1) != 0) {
        return gonio_fail(error, GONIO_E_DEVICE, "another meter came back: *IDN? gives '%.100s', expected '%.100s'",
                          reply, m->identity);
    }
    snprintf(m->identity, sizeof m->identity, "%.255s", reply);
    if (m->config.setup[0] == 0) {
        return GONIO_OK;
    }
    char line[sizeof m->config.setup + 1];
    const int length = snprintf(line, sizeof line, "%s\n", m->config.setup);
    return gonio_usbtmc_write(m->usb, line, (size_t)length, m->config.timeout_ms, error);
}

// Wait, bounded, until the same meter is there again and set it up anew.
static gonio_status reopen(meter *m, gonio_error *error) {
    gonio_usbtmc_close(m->usb);
    m->usb = NULL;
    const gonio_deadline deadline = gonio_deadline_in_s(m->config.replug_s);
    gonio_status status;
    do {
        status = gonio_usbtmc_open(&m->config.match, &m->usb, error);
        if (status == GONIO_OK) {
            status = set_up(m, error);
            if (status == GONIO_OK) {
                return GONIO_OK;
            }
            gonio_usbtmc_close(m->usb);
            m->usb = NULL;
        }
        gonio_clock_sleep_ms(gonio_deadline_left_ms(deadline) < 100 ? gonio_deadline_left_ms(deadline) : 100);
    } while (gonio_deadline_left_ms(deadline) > 0);
    return status;
}

static gonio_status recover(meter *m, gonio_error *error) {
    if (m->usb != NULL && !gonio_usbtmc_gone(m->usb) && gonio_usbtmc_clear(m->usb, error) == GONIO_OK) {
        return GONIO_OK;
    }
    return reopen(m, error);
}

static gonio_status parse_reading(const char *reply, double *value, gonio_error *error) {
    char *end;
    const double number = gonio_number_parse(reply, &end);
    if (end == reply || (*end != 0 && *end != ',' && *end != ' ')) {
        return gonio_fail(error, GONIO_E_DEVICE, "meter: expected a number, found '%.60s'", reply);
    }
    if (!isfinite(number) || fabs(number) >= SCPI_INFINITY) {
        return gonio_fail(error, GONIO_E_DEVICE, "meter: over range or no reading ('%.60s')", reply);
    }
    *value = number;
    return GONIO_OK;
}

static gonio_status read_one(meter *m, double *value, gonio_error *error) {
    gonio_error last = {.line = -1, .byte = -1};
    gonio_status status = GONIO_E_DEVICE;
    for (int attempt = 0; attempt <= m->config.retries; attempt++) {
        if ((attempt > 0 || m->usb == NULL) && recover(m, &last) != GONIO_OK) {
            break; // what it waited for did not come
        }
        char reply[REPLY_MAX];
        status = query_once(m, m->config.query, reply, &last);
        status = status == GONIO_OK ? parse_reading(reply, value, &last) : status;
        if (status == GONIO_OK) {
            return GONIO_OK;
        }
    }
    status = last.status != GONIO_OK ? last.status : status;
    return gonio_fail(error, status, "meter '%.80s': %.300s (query '%.40s')", m->identity, last.message,
                      m->config.query);
}

// Averages as many readings as fit the integration time, at least one. The standard uncertainty joins what
// the readings scatter and the instrument's stated one, which averaging does not take away.
static gonio_status meter_read(void *device, const gonio_stamp *stamp, double integration_s, double *value,
                               double *sigma, gonio_error *error) {
    (void)stamp;
    meter *m = device;
    const gonio_deadline deadline = gonio_deadline_in_s(integration_s);
    double mean = 0, squares = 0; // Welford's running mean and sum of squared deviations
    int n = 0;
    do {
        double reading = 0;
        const gonio_status status = read_one(m, &reading, error);
        if (status != GONIO_OK) {
            return status;
        }
        n++;
        const double delta = reading - mean;
        mean += delta / n;
        squares += delta * (reading - mean);
    } while (n < READINGS_MAX && gonio_deadline_left_ms(deadline) > 0);
    const double scatter = n > 1 ? sqrt(squares / (n - 1) / n) : 0;
    *value = mean * m->config.scale;
    *sigma = fabs(m->config.scale) * hypot(scatter, m->config.relative_sigma * fabs(mean));
    return GONIO_OK;
}

static void meter_close(void *device) {
    meter *m = device;
    gonio_usbtmc_close(m->usb);
    free(m);
}

const gonio_meter_ops gonio_meter_usbtmc = {.name = "usbtmc", .read = meter_read, .close = meter_close};

gonio_status gonio_meter_usbtmc_open(const gonio_meter_usbtmc_config *config, void **device, gonio_error *error) {
    meter *m = calloc(1, sizeof *m);
    if (m == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a meter");
    }
    m->config = *config;
    gonio_status status = gonio_usbtmc_open(&config->match, &m->usb, error);
    status = status == GONIO_OK ? set_up(m, error) : status;
    if (status != GONIO_OK) {
        meter_close(m);
        return status;
    }
    // From now on only this very instrument will do.
    const gonio_usbtmc_info *info = gonio_usbtmc_describe(m->usb);
    m->config.match = (gonio_usbtmc_match){info->vendor, info->product, ""};
    snprintf(m->config.match.serial, sizeof m->config.match.serial, "%s", info->serial);
    *device = m;
    return GONIO_OK;
}

const char *gonio_meter_usbtmc_identity(const void *device) { return ((const meter *)device)->identity; }

static bool parse_hexadecimal(const char *text, void *value) {
    char *end;
    const unsigned long number = strtoul(text, &end, 16);
    const bool good = end != text && *end == 0 && number <= 0xffff;
    if (good) {
        *(int *)value = (int)number;
    }
    return good;
}

static const gonio_key_form hexadecimal = {"four hexadecimal digits, as lsusb prints them", parse_hexadecimal, NULL};
typedef gonio_meter_usbtmc_config settings;
#define KEY(text, kind, member) .section = "meter", GONIO_KEY_NAMED(settings, member, text, kind)
static const gonio_key keys[] = {{KEY("vendor", OWN, match.vendor), .form = &hexadecimal},
                                 {KEY("product", OWN, match.product), .form = &hexadecimal},
                                 {KEY("serial", LINE, match.serial)},
                                 {KEY("setup", LINE, setup)},
                                 {KEY("query", LINE, query)},
                                 {KEY("scale", REAL, scale), -1e30, 1e30},
                                 {KEY("sigma_percent", REAL, relative_sigma), 0, 100, .times = 100},
                                 {KEY("retries", INTEGER, retries), 0, 100},
                                 {KEY("timeout_ms", INTEGER, timeout_ms), 10, 100000},
                                 {KEY("replug_s", REAL, replug_s), 0, 3600},
                                 {0}};

static void defaults(void *config) { gonio_meter_usbtmc_defaults(config); }

static gonio_status make(void *config, const gonio_driver_context *context, void **device, gonio_error *error) {
    (void)context;
    return gonio_meter_usbtmc_open(config, device, error);
}

const gonio_driver gonio_driver_meter_usbtmc = {.name = "usbtmc",
                                                .device = GONIO_DEVICE_METER,
                                                .summary = "an SCPI power meter on USB",
                                                .keys = keys,
                                                .settings = sizeof(settings),
                                                .defaults = defaults,
                                                .ops = &gonio_meter_usbtmc,
                                                .open = make};
