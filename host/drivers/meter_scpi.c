// SPDX-License-Identifier: BSD-3-Clause
// A fault of the line is answered by a clean line, a lost port by opening it again.
#include "host/drivers/meter_scpi.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/drivers/driver.h"

typedef struct meter {
    gonio_scpi_meter scpi;
    gonio_line_config config;
    gonio_line *line;
    bool lost; // the port was
} meter;

void gonio_meter_scpi_defaults(gonio_meter_scpi_config *config) {
    *config = (gonio_meter_scpi_config){.line = {.baud = 9600, .timeout_ms = 2000}};
    gonio_scpi_defaults(&config->scpi);
}

static gonio_status link_open(gonio_scpi_meter *device, gonio_error *error) {
    meter *m = (meter *)device;
    const gonio_status status = gonio_line_open(&m->config, "", "", &m->line, error);
    m->lost = status != GONIO_OK;
    return status;
}

static void link_close(gonio_scpi_meter *device) {
    meter *m = (meter *)device;
    gonio_line_close(m->line);
    m->line = NULL;
    m->lost = true;
}

static bool link_clear(gonio_scpi_meter *device) {
    const meter *m = (meter *)device;
    if (!m->lost) {
        gonio_line_drain(m->line);
    }
    return !m->lost;
}

static gonio_status gone(const meter *m, gonio_error *error) {
    return gonio_fail(error, GONIO_E_DEVICE, "%.120s is gone", m->config.port);
}

static gonio_status link_send(gonio_scpi_meter *device, const char *line, size_t n, gonio_error *error) {
    meter *m = (meter *)device;
    if (!link_clear(device)) { // a late answer to an earlier query answers none of now
        return gone(m, error);
    }
    const gonio_status status = gonio_line_send(m->line, line, n, error);
    m->lost = status == GONIO_E_DEVICE;
    return status;
}

static gonio_status link_receive(gonio_scpi_meter *device, char reply[GONIO_SCPI_REPLY], gonio_error *error) {
    meter *m = (meter *)device;
    char answer[GONIO_LINE_MAX];
    const gonio_status status = gonio_line_receive(m->line, -1, answer, error);
    m->lost = status == GONIO_E_DEVICE;
    snprintf(reply, GONIO_SCPI_REPLY, "%.*s", GONIO_SCPI_REPLY - 1, status == GONIO_OK ? answer : "");
    return status;
}

static const gonio_scpi_link line_link = {link_open, link_close, link_send, link_receive, link_clear};

const gonio_meter_ops gonio_meter_scpi = {.name = "scpi", .read = gonio_scpi_read, .close = gonio_scpi_close};

gonio_status gonio_meter_scpi_open(const gonio_meter_scpi_config *config, void **device, gonio_error *error) {
    meter *m = calloc(1, sizeof *m);
    if (m == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a meter");
    }
    m->config = config->line;
    m->scpi = (gonio_scpi_meter){.config = config->scpi, .link = &line_link};
    const gonio_status status = gonio_scpi_begin(&m->scpi, error);
    *device = status == GONIO_OK ? m : NULL;
    return status;
}

typedef gonio_meter_scpi_config settings;
#define KEY(text, kind, member) .section = "meter", GONIO_KEY_NAMED(settings, member, text, kind)
static const gonio_key keys[] = {{KEY("port", LINE, line.port)},
                                 {KEY("baud", INTEGER, line.baud), 1200, 921600},
                                 GONIO_SCPI_KEYS(settings, scpi),
                                 {KEY("timeout_ms", INTEGER, line.timeout_ms), 10, 100000},
                                 {0}};

static void defaults(void *config) { gonio_meter_scpi_defaults(config); }

static gonio_status make(void *config, const gonio_driver_context *context, void **device, gonio_error *error) {
    (void)context;
    return gonio_meter_scpi_open(config, device, error);
}

const gonio_driver gonio_driver_meter_scpi = {.name = "scpi",
                                              .device = GONIO_DEVICE_METER,
                                              .summary = "an SCPI power meter on a serial line or on TCP",
                                              .keys = keys,
                                              .settings = sizeof(settings),
                                              .defaults = defaults,
                                              .ops = &gonio_meter_scpi,
                                              .open = make};
