// SPDX-License-Identifier: BSD-3-Clause
// Queries are repeated at will: reading changes nothing, so every fault of the carrier is answered by a recovery and a
// bounded retry.
#include "host/drivers/scpi_meter.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/keys.h"
#include "base/number.h"
#include "host/transport/clock.h"

// SCPI-1999 section 7.2.1: these numbers stand for infinity and for "not a number".
#define SCPI_INFINITY 9.9e37
enum { READINGS_MAX = 10000 };

GONIO_KEY_NAMES(units, "linear", "dBm")
const char *const *gonio_scpi_units(void) { return units(); }

void gonio_scpi_defaults(gonio_scpi_config *config) {
    *config =
        (gonio_scpi_config){.query = "MEAS:POW?", .scale = 1, .relative_sigma = 0.005, .retries = 3, .replug_s = 10};
}

static gonio_status send(gonio_scpi_meter *m, const char *text, gonio_error *error) {
    char line[sizeof m->config.setup + 1];
    const int length = snprintf(line, sizeof line, "%s\n", text);
    return m->link->send(m, line, (size_t)length, error);
}

// One query, one answer: blanks and line ends at its end cut off.
static gonio_status ask_once(gonio_scpi_meter *m, const char *query, char reply[GONIO_SCPI_REPLY], gonio_error *error) {
    gonio_status status = send(m, query, error);
    reply[0] = 0;
    status = status == GONIO_OK ? m->link->receive(m, reply, error) : status;
    size_t n = strlen(reply);
    while (n > 0 && (reply[n - 1] == '\n' || reply[n - 1] == '\r' || reply[n - 1] == ' ')) {
        reply[--n] = 0;
    }
    return status;
}

// SCPI-1999 section 21.8: number,"text"; 0 is none. A meter that does not know the question is not blamed for it.
static gonio_status check_setup(gonio_scpi_meter *m, gonio_error *error) {
    char reply[GONIO_SCPI_REPLY], *end;
    if (ask_once(m, "SYST:ERR?", reply, NULL) != GONIO_OK) {
        m->link->clear(m);
        return GONIO_OK;
    }
    const long code = strtol(reply, &end, 10);
    return end == reply || *end != ',' || code == 0
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_INPUT, "[meter] setup '%.80s': the meter answers %.120s", m->config.setup,
                            reply);
}

static gonio_status connect_meter(gonio_scpi_meter *m, gonio_error *error) {
    char reply[GONIO_SCPI_REPLY];
    gonio_status status = m->link->open(m, error);
    status = status == GONIO_OK ? ask_once(m, "*IDN?", reply, error) : status;
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
    status = send(m, m->config.setup, error);
    return status == GONIO_OK ? check_setup(m, error) : status;
}

gonio_status gonio_scpi_begin(gonio_scpi_meter *m, gonio_error *error) {
    const gonio_status status = connect_meter(m, error);
    if (status != GONIO_OK) {
        gonio_scpi_close(m);
    }
    return status;
}

void gonio_scpi_close(void *device) {
    gonio_scpi_meter *m = device;
    m->link->close(m);
    free(m);
}

// Make a clean start after a fault; where the meter is gone wait, bounded, until the same one is there again.
static gonio_status recover(gonio_scpi_meter *m, gonio_error *error) {
    const gonio_deadline deadline = gonio_deadline_in_s(m->config.replug_s);
    gonio_status status = m->link->clear(m) ? GONIO_OK : GONIO_E_DEVICE;
    while (status != GONIO_OK) {
        m->link->close(m);
        status = connect_meter(m, error);
        const int left_ms = gonio_deadline_left_ms(deadline);
        if (status != GONIO_OK && left_ms == 0) {
            m->link->close(m);
            break;
        }
        gonio_clock_sleep_ms(status == GONIO_OK ? 0 : left_ms < 100 ? left_ms : 100);
    }
    return status;
}

static gonio_status parse_reading(const gonio_scpi_meter *m, const char *reply, double *value, gonio_error *error) {
    char *end;
    const double number = gonio_number_parse(reply, &end);
    if (end == reply || (*end != 0 && *end != ',' && *end != ' ')) {
        return gonio_fail(error, GONIO_E_DEVICE, "meter: expected a number, found '%.60s'", reply);
    }
    if (!isfinite(number) || fabs(number) >= SCPI_INFINITY) {
        return gonio_fail(error, GONIO_E_DEVICE, "meter: over range or no reading ('%.60s')", reply);
    }
    end += strspn(end, " ");
    if (strncasecmp(end, "dB", 2) == 0 && m->config.unit != GONIO_SCPI_DBM) {
        return gonio_fail(
            error, GONIO_E_INPUT,
            "meter: it answers in decibels ('%.60s'); [meter] unit = dBm, or a setup that has it answer in "
            "watts",
            reply);
    }
    *value = m->config.unit == GONIO_SCPI_DBM ? 1e-3 * pow(10, number / 10) : number;
    return GONIO_OK;
}

static gonio_status read_one(gonio_scpi_meter *m, double *value, gonio_error *error) {
    gonio_error last = {.line = -1, .byte = -1};
    gonio_status status = GONIO_E_DEVICE;
    for (int attempt = 0; attempt <= m->config.retries; attempt++) {
        if (attempt > 0 && recover(m, &last) != GONIO_OK) {
            break; // what it waited for did not come
        }
        char reply[GONIO_SCPI_REPLY];
        status = ask_once(m, m->config.query, reply, &last);
        status = status == GONIO_OK ? parse_reading(m, reply, value, &last) : status;
        if (status == GONIO_OK) {
            return GONIO_OK;
        }
        if (status == GONIO_E_INPUT) {
            break;
        }
    }
    status = last.status != GONIO_OK ? last.status : status;
    return gonio_fail(error, status, "meter '%.80s': %.300s (query '%.40s')", m->identity, last.message,
                      m->config.query);
}

// The standard uncertainty joins what the readings scatter and the instrument's stated one, which averaging does not
// take away.
gonio_status gonio_scpi_read(void *device, const gonio_stamp *stamp, double integration_s, double *value, double *sigma,
                             gonio_error *error) {
    (void)stamp;
    gonio_scpi_meter *m = device;
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
