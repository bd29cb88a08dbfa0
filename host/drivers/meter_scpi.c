// SPDX-License-Identifier: BSD-3-Clause
// A fault of the line is answered by a clean line, a lost port by opening it again.
#include "host/drivers/meter_scpi.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/drivers/driver.h"
#include "host/transport/clock.h"

typedef struct meter {
    gonio_meter_scpi_config config;
    gonio_line *line;
    bool lost; // the port was
    gonio_scpi_meter scpi;
} meter;

void gonio_meter_scpi_defaults(gonio_meter_scpi_config *config) {
    *config = (gonio_meter_scpi_config){.line = {.baud = 9600, .timeout_ms = 2000}, .replug_s = 10};
    gonio_scpi_defaults(&config->scpi);
}

static gonio_status link_send(void *device, const char *line, size_t n, gonio_error *error) {
    meter *m = device;
    gonio_line_drain(m->line); // a late answer to an earlier query answers none of now
    const gonio_status status = gonio_line_send(m->line, line, n, error);
    m->lost = m->lost || status == GONIO_E_DEVICE;
    return status;
}

static gonio_status link_receive(void *device, char reply[GONIO_SCPI_REPLY], gonio_error *error) {
    meter *m = device;
    char answer[GONIO_LINE_MAX];
    const gonio_status status = gonio_line_receive(m->line, -1, answer, error);
    m->lost = m->lost || status == GONIO_E_DEVICE;
    snprintf(reply, GONIO_SCPI_REPLY, "%.*s", GONIO_SCPI_REPLY - 1, status == GONIO_OK ? answer : "");
    return status;
}

static gonio_status link_recover(void *device, gonio_error *error) {
    meter *m = device;
    gonio_status status = GONIO_OK;
    const gonio_deadline deadline = gonio_deadline_in_s(m->config.replug_s);
    while (m->lost) {
        m->lost = false;
        status = gonio_line_reopen(m->line, error);
        status = status == GONIO_OK ? gonio_scpi_begin(&m->scpi, error) : status;
        m->lost = status != GONIO_OK;
        if (m->lost && gonio_deadline_left_ms(deadline) == 0) {
            return status;
        }
        gonio_clock_sleep_ms(m->lost ? 100 : 0);
    }
    gonio_line_drain(m->line);
    return GONIO_OK;
}

static void link_clean(void *device) { gonio_line_drain(((meter *)device)->line); }

static const gonio_scpi_link line_link = {link_send, link_receive, link_recover, link_clean};

static gonio_status meter_read(void *device, const gonio_stamp *stamp, double integration_s, double *value,
                               double *sigma, gonio_error *error) {
    (void)stamp;
    return gonio_scpi_read(&((meter *)device)->scpi, integration_s, value, sigma, error);
}

static void meter_close(void *device) {
    meter *m = device;
    gonio_line_close(m->line);
    free(m);
}

const gonio_meter_ops gonio_meter_scpi = {.name = "scpi", .read = meter_read, .close = meter_close};

gonio_status gonio_meter_scpi_open(const gonio_meter_scpi_config *config, void **device, gonio_error *error) {
    meter *m = calloc(1, sizeof *m);
    if (m == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a meter");
    }
    m->config = *config;
    m->scpi = (gonio_scpi_meter){.config = config->scpi, .link = &line_link, .device = m};
    gonio_status status = gonio_line_open(&config->line, "", "", &m->line, error);
    status = status == GONIO_OK ? gonio_scpi_begin(&m->scpi, error) : status;
    if (status != GONIO_OK) {
        meter_close(m);
        return status;
    }
    *device = m;
    return GONIO_OK;
}

typedef gonio_meter_scpi_config settings;
#define KEY(text, kind, member) .section = "meter", GONIO_KEY_NAMED(settings, member, text, kind)
static const gonio_key keys[] = {{KEY("port", LINE, line.port)},
                                 {KEY("baud", INTEGER, line.baud), 1200, 921600},
                                 GONIO_SCPI_KEYS(settings, scpi),
                                 {KEY("timeout_ms", INTEGER, line.timeout_ms), 10, 100000},
                                 {KEY("replug_s", REAL, replug_s), 0, 3600},
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
