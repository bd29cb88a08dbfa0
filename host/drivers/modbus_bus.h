// SPDX-License-Identifier: BSD-3-Clause
// A Modbus line with slaves of other makers: encoders, drives. Requests are repeated within bounds, so what is written
// must bear being written twice. One thread uses it at a time.
#ifndef GONIO_DRIVERS_MODBUS_BUS_H
#define GONIO_DRIVERS_MODBUS_BUS_H

#include "host/transport/modbus.h"

typedef struct gonio_modbus_bus gonio_modbus_bus;

typedef struct gonio_modbus_bus_config {
    gonio_modbus_config modbus;
    int retries;                   // of one request
    double replug_s;               // wait this long for a lost adapter or connection
    char record[256], replay[256]; // "": none
} gonio_modbus_bus_config;

void gonio_modbus_bus_defaults(gonio_modbus_bus_config *config);
gonio_status gonio_modbus_bus_open(const gonio_modbus_bus_config *config, gonio_modbus_bus **out, gonio_error *error);
void gonio_modbus_bus_close(gonio_modbus_bus *bus); // NULL is allowed

// function: 3 or 4; 16, or 6 for each word by itself. GONIO_E_TIMEOUT where the slave is silent, GONIO_E_DEVICE where
// it refuses (the exception is named) or nothing that makes sense comes back.
gonio_status gonio_modbus_bus_read(gonio_modbus_bus *bus, int slave, int function, int address, int n, uint16_t *words,
                                   gonio_error *error);
gonio_status gonio_modbus_bus_write(gonio_modbus_bus *bus, int slave, int function, int address, int n,
                                    const uint16_t *words, gonio_error *error);

#endif
