// SPDX-License-Identifier: BSD-3-Clause
// USBTMC and its USB488 subclass over libusb: messages out and in, and the recovery the standard gives them.
//
// Source: USB Test and Measurement Class Specification 1.0 and its USB488 subclass specification 1.0 (USB-IF, 2003);
// sections are cited in usbtmc.c. One thread uses a device at a time.
#ifndef GONIO_TRANSPORT_USBTMC_H
#define GONIO_TRANSPORT_USBTMC_H

#include <stddef.h>
#include <stdint.h>

#include "gonio/status.h"

typedef struct gonio_usbtmc gonio_usbtmc;

// Which device: -1 and "" match any. More than one match is refused, so that no other instrument is driven by chance.
typedef struct gonio_usbtmc_match {
    int vendor, product;
    char serial[64];
} gonio_usbtmc_match;

// What a device says of itself.
typedef struct gonio_usbtmc_info {
    int vendor, product, bus, address;
    char manufacturer[64], model[64], serial[64]; // empty where unknown or not readable
    int usb488;                                   // 1: speaks the USB488 subclass
} gonio_usbtmc_info;

// Every USBTMC device that is plugged in; *list is the caller's to free().
gonio_status gonio_usbtmc_list(gonio_usbtmc_info **list, size_t *n, gonio_error *error);

// Open and claim the device and clear its buffers. GONIO_E_DEVICE where none or several match; where access is denied
// the message says which udev rule gives it.
gonio_status gonio_usbtmc_open(const gonio_usbtmc_match *match, gonio_usbtmc **out, gonio_error *error);
void gonio_usbtmc_close(gonio_usbtmc *device);                              // NULL is allowed
const gonio_usbtmc_info *gonio_usbtmc_describe(const gonio_usbtmc *device); // lives as long as the device

// Send one message. On a failure the transfer is aborted, so that the next message starts clean.
gonio_status gonio_usbtmc_write(gonio_usbtmc *device, const void *message, size_t n, int timeout_ms,
                                gonio_error *error);
// Ask for one message and receive all of it: at most size bytes, *n of them filled. A longer one is GONIO_E_DEVICE.
// GONIO_E_TIMEOUT: the device had nothing to say in time; the request has been aborted.
gonio_status gonio_usbtmc_read(gonio_usbtmc *device, void *message, size_t size, size_t *n, int timeout_ms,
                               gonio_error *error);
// Clear both buffers of the device (INITIATE_CLEAR) and both endpoints' halts; also ends a stall.
gonio_status gonio_usbtmc_clear(gonio_usbtmc *device, gonio_error *error);
// True after a transfer found the device unplugged: nothing but close helps then.
int gonio_usbtmc_gone(const gonio_usbtmc *device);

#endif
