// SPDX-License-Identifier: BSD-3-Clause
// An SCPI meter on USB: a fault of the transport is answered by a clear, an unplugged device by opening it again under
// the same serial number.
#include "host/drivers/meter_usbtmc.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/drivers/driver.h"

typedef struct meter {
    gonio_scpi_meter scpi;
    gonio_usbtmc_match match;
    int timeout_ms;
    gonio_usbtmc *usb; // NULL while unplugged
} meter;

void gonio_meter_usbtmc_defaults(gonio_meter_usbtmc_config *config) {
    *config = (gonio_meter_usbtmc_config){.match = {-1, -1, ""}, .timeout_ms = 2000};
    gonio_scpi_defaults(&config->scpi);
}

static gonio_status link_open(gonio_scpi_meter *device, gonio_error *error) {
    meter *m = (meter *)device;
    return gonio_usbtmc_open(&m->match, &m->usb, error);
}

static void link_close(gonio_scpi_meter *device) {
    meter *m = (meter *)device;
    gonio_usbtmc_close(m->usb);
    m->usb = NULL;
}

static bool link_clear(gonio_scpi_meter *device) {
    const meter *m = (meter *)device;
    return m->usb != NULL && !gonio_usbtmc_gone(m->usb) && gonio_usbtmc_clear(m->usb, NULL) == GONIO_OK;
}

static gonio_status link_send(gonio_scpi_meter *device, const char *line, size_t n, gonio_error *error) {
    const meter *m = (meter *)device;
    return m->usb != NULL ? gonio_usbtmc_write(m->usb, line, n, m->timeout_ms, error)
                          : gonio_fail(error, GONIO_E_DEVICE, "the meter is unplugged");
}

static gonio_status link_receive(gonio_scpi_meter *device, char reply[GONIO_SCPI_REPLY], gonio_error *error) {
    const meter *m = (meter *)device;
    size_t n = 0;
    const gonio_status status = gonio_usbtmc_read(m->usb, reply, GONIO_SCPI_REPLY - 1, &n, m->timeout_ms, error);
    reply[status == GONIO_OK ? n : 0] = 0;
    return status;
}

static const gonio_scpi_link usb_link = {link_open, link_close, link_send, link_receive, link_clear};

const gonio_meter_ops gonio_meter_usbtmc = {.name = "usbtmc", .read = gonio_scpi_read, .close = gonio_scpi_close};

gonio_status gonio_meter_usbtmc_open(const gonio_meter_usbtmc_config *config, void **device, gonio_error *error) {
    meter *m = calloc(1, sizeof *m);
    if (m == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a meter");
    }
    m->match = config->match;
    m->timeout_ms = config->timeout_ms;
    m->scpi = (gonio_scpi_meter){.config = config->scpi, .link = &usb_link};
    const gonio_status status = gonio_scpi_begin(&m->scpi, error);
    if (status != GONIO_OK) {
        return status;
    }
    // From now on only this very instrument will do.
    const gonio_usbtmc_info *info = gonio_usbtmc_describe(m->usb);
    m->match = (gonio_usbtmc_match){info->vendor, info->product, ""};
    snprintf(m->match.serial, sizeof m->match.serial, "%s", info->serial);
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
