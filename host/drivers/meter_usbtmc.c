// SPDX-License-Identifier: BSD-3-Clause
// An SCPI meter on USB: a fault of the transport is answered by a clear, an unplugged device by opening it again under
// the same serial number.
#include "host/drivers/meter_usbtmc.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/drivers/driver.h"
#include "host/transport/clock.h"

typedef struct meter {
    gonio_meter_usbtmc_config config;
    gonio_usbtmc *usb; // NULL while unplugged
    gonio_scpi_meter scpi;
} meter;

void gonio_meter_usbtmc_defaults(gonio_meter_usbtmc_config *config) {
    *config = (gonio_meter_usbtmc_config){.match = {-1, -1, ""}, .timeout_ms = 2000, .replug_s = 10};
    gonio_scpi_defaults(&config->scpi);
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
            status = gonio_scpi_begin(&m->scpi, error);
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

static gonio_status link_recover(void *device, gonio_error *error) {
    meter *m = device;
    if (m->usb != NULL && !gonio_usbtmc_gone(m->usb) && gonio_usbtmc_clear(m->usb, error) == GONIO_OK) {
        return GONIO_OK;
    }
    return reopen(m, error);
}

static gonio_status link_send(void *device, const char *line, size_t n, gonio_error *error) {
    const meter *m = device;
    return m->usb != NULL ? gonio_usbtmc_write(m->usb, line, n, m->config.timeout_ms, error)
                          : gonio_fail(error, GONIO_E_DEVICE, "the meter is unplugged");
}

static gonio_status link_receive(void *device, char reply[GONIO_SCPI_REPLY], gonio_error *error) {
    const meter *m = device;
    size_t n = 0;
    const gonio_status status = gonio_usbtmc_read(m->usb, reply, GONIO_SCPI_REPLY - 1, &n, m->config.timeout_ms, error);
    reply[status == GONIO_OK ? n : 0] = 0;
    return status;
}

static void link_clean(void *device) { gonio_usbtmc_clear(((meter *)device)->usb, NULL); }

static const gonio_scpi_link usb_link = {link_send, link_receive, link_recover, link_clean};

static gonio_status meter_read(void *device, const gonio_stamp *stamp, double integration_s, double *value,
                               double *sigma, gonio_error *error) {
    (void)stamp;
    return gonio_scpi_read(&((meter *)device)->scpi, integration_s, value, sigma, error);
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
    m->scpi = (gonio_scpi_meter){.config = config->scpi, .link = &usb_link, .device = m};
    gonio_status status = gonio_usbtmc_open(&config->match, &m->usb, error);
    status = status == GONIO_OK ? gonio_scpi_begin(&m->scpi, error) : status;
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

const char *gonio_meter_usbtmc_identity(const void *device) { return ((const meter *)device)->scpi.identity; }

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
                                 GONIO_SCPI_KEYS(settings, scpi),
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
