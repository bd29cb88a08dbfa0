// SPDX-License-Identifier: BSD-3-Clause
// USBTMC over libusb. Each Bulk-OUT transfer starts with a 12-byte header that carries a tag (USBTMC 1.0, table 1);
// the reply repeats the tag, so that a stale reply shows.
#include "host/transport/usbtmc.h"

#include <libusb.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/transport/clock.h"

enum { CLASS_APPLICATION = 0xfe, SUBCLASS_TMC = 3, PROTOCOL_USB488 = 1 }; // section 4.3, table 4 of USB488 3.3
enum { MESSAGE_OUT = 1, MESSAGE_REQUEST_IN = 2, HEADER = 12, EOM = 1 };   // section 3.2, table 2
// Section 4.2.1, table 15, and USB488 section 4.3.1.
enum {
    INITIATE_ABORT_BULK_OUT = 1,
    CHECK_ABORT_BULK_OUT_STATUS,
    INITIATE_ABORT_BULK_IN,
    CHECK_ABORT_BULK_IN_STATUS,
    INITIATE_CLEAR,
    CHECK_CLEAR_STATUS
};
enum { STATUS_SUCCESS = 1, STATUS_PENDING = 2 }; // table 16
enum { REQUEST_TO_INTERFACE = 0xa1, REQUEST_TO_ENDPOINT = 0xa2 };
enum { CONTROL_MS = 1000, RECOVERY_MS = 2000, CHUNK = 4096 };

struct gonio_usbtmc {
    libusb_context *context;
    libusb_device_handle *handle;
    gonio_usbtmc_info info;
    int interface;
    uint8_t out, in, tag;
    int packet; // of the Bulk-IN endpoint: reads are multiples of it, or libusb reports an overflow
    bool gone;
};

static gonio_status fail_usb(gonio_usbtmc *device, int code, const char *what, gonio_error *error) {
    if (device != NULL && (code == LIBUSB_ERROR_NO_DEVICE || code == LIBUSB_ERROR_NOT_FOUND)) {
        device->gone = true;
        return gonio_fail(error, GONIO_E_DEVICE, "USB device %04x:%04x %s was unplugged (%s)",
                          (unsigned)device->info.vendor, (unsigned)device->info.product, device->info.serial, what);
    }
    if (code == LIBUSB_ERROR_TIMEOUT) {
        return gonio_fail(error, GONIO_E_TIMEOUT, "USB: no answer in time (%s)", what);
    }
    return gonio_fail(error, GONIO_E_DEVICE, "USB: %s: %s", what, libusb_error_name(code));
}

// The device's first USBTMC interface with a bulk endpoint either way; false where it has none.
static bool find_interface(libusb_device *usb, gonio_usbtmc *device) {
    struct libusb_config_descriptor *config;
    if (libusb_get_active_config_descriptor(usb, &config) != 0) {
        return false;
    }
    bool found = false;
    for (int i = 0; i < config->bNumInterfaces && !found; i++) {
        if (config->interface[i].num_altsetting < 1) {
            continue;
        }
        const struct libusb_interface_descriptor *d = &config->interface[i].altsetting[0];
        if (d->bInterfaceClass != CLASS_APPLICATION || d->bInterfaceSubClass != SUBCLASS_TMC) {
            continue;
        }
        device->out = device->in = 0;
        for (int e = 0; e < d->bNumEndpoints; e++) {
            const struct libusb_endpoint_descriptor *p = &d->endpoint[e];
            if ((p->bmAttributes & LIBUSB_TRANSFER_TYPE_MASK) != LIBUSB_TRANSFER_TYPE_BULK) {
                continue;
            }
            if (p->bEndpointAddress & LIBUSB_ENDPOINT_IN) {
                device->in = p->bEndpointAddress;
                device->packet = p->wMaxPacketSize;
            } else {
                device->out = p->bEndpointAddress;
            }
        }
        device->interface = d->bInterfaceNumber;
        device->info.usb488 = d->bInterfaceProtocol == PROTOCOL_USB488;
        found = device->out != 0 && device->in != 0 && device->packet > 0;
    }
    libusb_free_config_descriptor(config);
    return found;
}

static void read_string(libusb_device_handle *handle, uint8_t index, char *text, size_t size) {
    text[0] = 0;
    if (index != 0 && libusb_get_string_descriptor_ascii(handle, index, (unsigned char *)text, (int)size) < 0) {
        text[0] = 0;
    }
}

// Fill device->info and endpoints from usb; opens it to read its strings and leaves it open where keep is set. *code
// tells why it could not be opened.
static bool examine(libusb_device *usb, gonio_usbtmc *device, bool keep, int *code) {
    struct libusb_device_descriptor d;
    if (libusb_get_device_descriptor(usb, &d) != 0 || !find_interface(usb, device)) {
        return false;
    }
    device->info.vendor = d.idVendor;
    device->info.product = d.idProduct;
    device->info.bus = libusb_get_bus_number(usb);
    device->info.address = libusb_get_device_address(usb);
    *code = libusb_open(usb, &device->handle);
    if (*code != 0) {
        device->handle = NULL;
        return true;
    }
    read_string(device->handle, d.iManufacturer, device->info.manufacturer, sizeof device->info.manufacturer);
    read_string(device->handle, d.iProduct, device->info.model, sizeof device->info.model);
    read_string(device->handle, d.iSerialNumber, device->info.serial, sizeof device->info.serial);
    if (!keep) {
        libusb_close(device->handle);
        device->handle = NULL;
    }
    return true;
}

gonio_status gonio_usbtmc_list(gonio_usbtmc_info **list, size_t *n, gonio_error *error) {
    libusb_context *context;
    libusb_device **devices;
    int code = libusb_init(&context);
    if (code != 0) {
        return fail_usb(NULL, code, "libusb_init", error);
    }
    const ssize_t count = libusb_get_device_list(context, &devices);
    if (count < 0) {
        libusb_exit(context);
        return fail_usb(NULL, (int)count, "list of devices", error);
    }
    *n = 0;
    *list = calloc((size_t)count + 1, sizeof **list);
    for (ssize_t i = 0; i < count && *list != NULL; i++) {
        gonio_usbtmc device = {0};
        if (examine(devices[i], &device, false, &code)) {
            (*list)[(*n)++] = device.info;
        }
    }
    libusb_free_device_list(devices, 1);
    libusb_exit(context);
    return *list != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "not enough memory for the list of devices");
}

static bool matches(const gonio_usbtmc_match *match, libusb_device *usb) {
    struct libusb_device_descriptor d;
    return libusb_get_device_descriptor(usb, &d) == 0 && (match->vendor < 0 || match->vendor == d.idVendor) &&
           (match->product < 0 || match->product == d.idProduct);
}

static gonio_status fail_access(const gonio_usbtmc_info *info, int code, gonio_error *error) {
    return gonio_fail(error, GONIO_E_DEVICE, "USB device %04x:%04x cannot be opened (%s)%s", (unsigned)info->vendor,
                      (unsigned)info->product, libusb_error_name(code),
                      code == LIBUSB_ERROR_ACCESS
                          ? ": no right to access it; install host/transport/60-gonio.rules as "
                            "/etc/udev/rules.d/60-gonio.rules, join the group plugdev, then plug it in again"
                          : "");
}

static gonio_status fail_none(const gonio_usbtmc_match *match, gonio_error *error) {
    char ids[2][16] = {"any vendor", "any"};
    if (match->vendor >= 0) {
        snprintf(ids[0], sizeof ids[0], "%04x", (unsigned)match->vendor);
    }
    if (match->product >= 0) {
        snprintf(ids[1], sizeof ids[1], "%04x", (unsigned)match->product);
    }
    return gonio_fail(error, GONIO_E_DEVICE, "no USBTMC device %s:%s%s%s is plugged in", ids[0], ids[1],
                      match->serial[0] ? " with serial " : "", match->serial);
}

// Open the one device that matches; device->handle stays NULL on failure.
static gonio_status select_device(gonio_usbtmc *device, const gonio_usbtmc_match *match, gonio_error *error) {
    libusb_device **devices;
    const ssize_t count = libusb_get_device_list(device->context, &devices);
    if (count < 0) {
        return fail_usb(NULL, (int)count, "list of devices", error);
    }
    gonio_status status = GONIO_OK, access = GONIO_OK;
    for (ssize_t i = 0; i < count && status == GONIO_OK; i++) {
        gonio_usbtmc candidate = {.context = device->context};
        int code = 0;
        if (!matches(match, devices[i]) || !examine(devices[i], &candidate, true, &code)) {
            continue;
        }
        if (code != 0) {
            access = fail_access(&candidate.info, code, error);
        } else if (match->serial[0] != 0 && strcmp(match->serial, candidate.info.serial) != 0) {
            libusb_close(candidate.handle);
        } else if (device->handle != NULL) {
            libusb_close(candidate.handle);
            status = gonio_fail(error, GONIO_E_DEVICE,
                                "several USBTMC devices match (serials '%s' and '%s'): name one by its serial",
                                device->info.serial, candidate.info.serial);
        } else {
            *device = candidate;
        }
    }
    libusb_free_device_list(devices, 1);
    if (status == GONIO_OK && device->handle == NULL) {
        status = access != GONIO_OK ? access : fail_none(match, error);
    }
    return status;
}

gonio_status gonio_usbtmc_open(const gonio_usbtmc_match *match, gonio_usbtmc **out, gonio_error *error) {
    gonio_usbtmc *device = calloc(1, sizeof *device);
    if (device == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a USB device");
    }
    // A context of our own enumerates afresh, which also finds a device that was plugged in again.
    int code = libusb_init(&device->context);
    if (code != 0) {
        free(device);
        return fail_usb(NULL, code, "libusb_init", error);
    }
    gonio_status status = select_device(device, match, error);
    if (status != GONIO_OK) {
        goto err;
    }
    libusb_set_auto_detach_kernel_driver(device->handle, 1); // the kernel's usbtmc may hold it
    code = libusb_claim_interface(device->handle, device->interface);
    if (code != 0) {
        status = code == LIBUSB_ERROR_BUSY
                     ? gonio_fail(error, GONIO_E_DEVICE, "USB device %04x:%04x is in use by another program",
                                  (unsigned)device->info.vendor, (unsigned)device->info.product)
                     : fail_usb(device, code, "claim interface", error);
        goto err;
    }
    status = gonio_usbtmc_clear(device, error);
    if (status != GONIO_OK) {
        goto err;
    }
    *out = device;
    return GONIO_OK;
err:
    gonio_usbtmc_close(device);
    return status;
}

void gonio_usbtmc_close(gonio_usbtmc *device) {
    if (device == NULL) {
        return;
    }
    if (device->handle != NULL) {
        libusb_release_interface(device->handle, device->interface);
        libusb_close(device->handle);
    }
    libusb_exit(device->context);
    free(device);
}

const gonio_usbtmc_info *gonio_usbtmc_describe(const gonio_usbtmc *device) { return &device->info; }

int gonio_usbtmc_gone(const gonio_usbtmc *device) { return device->gone; }

// A class request that answers `size` bytes, the first of them a USBTMC status; returns libusb's code.
static int ask(gonio_usbtmc *device, uint8_t type, uint8_t request, uint16_t value, uint16_t index, uint8_t *reply,
               uint16_t size) {
    const int got = libusb_control_transfer(device->handle, type, request, value, index, reply, size, CONTROL_MS);
    if (got == LIBUSB_ERROR_NO_DEVICE) {
        device->gone = true;
    }
    return got < 0 ? got : got < 1 ? LIBUSB_ERROR_IO : 0;
}

// Throw away what the device still sends until a short packet ends it (section 4.2.1.4).
static void drain(gonio_usbtmc *device) {
    uint8_t scrap[CHUNK];
    const int whole = CHUNK / device->packet * device->packet;
    for (int i = 0; i < 64; i++) {
        int got = 0;
        const int code = libusb_bulk_transfer(device->handle, device->in, scrap, whole, &got, 50);
        if (code != 0 || got < whole) {
            return;
        }
    }
}

// Abort the transfer of `tag` and wait until the device agrees; a refusal (no such transfer) is as good.
static void abort_transfer(gonio_usbtmc *device, bool in, uint8_t tag) {
    const uint8_t endpoint = in ? device->in : device->out;
    uint8_t reply[8] = {0};
    int code = ask(device, REQUEST_TO_ENDPOINT, in ? INITIATE_ABORT_BULK_IN : INITIATE_ABORT_BULK_OUT, tag, endpoint,
                   reply, 2);
    if (code == 0 && reply[0] == STATUS_SUCCESS) {
        const gonio_deadline deadline = gonio_deadline_in_ms(RECOVERY_MS);
        do {
            if (in) {
                drain(device);
            }
            code = ask(device, REQUEST_TO_ENDPOINT, in ? CHECK_ABORT_BULK_IN_STATUS : CHECK_ABORT_BULK_OUT_STATUS, 0,
                       endpoint, reply, 8);
            if (code == 0 && reply[0] == STATUS_PENDING) {
                gonio_clock_sleep_ms(5);
            }
        } while (code == 0 && reply[0] == STATUS_PENDING && gonio_deadline_left_ms(deadline) > 0);
    }
    if (!in) {
        libusb_clear_halt(device->handle, device->out); // section 4.2.1.2: the host clears it after the abort
    }
}

gonio_status gonio_usbtmc_clear(gonio_usbtmc *device, gonio_error *error) {
    uint8_t reply[2] = {0};
    const uint16_t interface = (uint16_t)device->interface;
    int code = ask(device, REQUEST_TO_INTERFACE, INITIATE_CLEAR, 0, interface, reply, 1);
    if (code != 0) {
        return fail_usb(device, code, "INITIATE_CLEAR", error);
    }
    if (reply[0] != STATUS_SUCCESS) { // section 4.2.1.6: anything else, and it has not begun
        return gonio_fail(error, GONIO_E_DEVICE, "INITIATE_CLEAR: the device answers status 0x%02x", reply[0]);
    }
    const gonio_deadline deadline = gonio_deadline_in_ms(RECOVERY_MS);
    do {
        code = ask(device, REQUEST_TO_INTERFACE, CHECK_CLEAR_STATUS, 0, interface, reply, 2);
        if (code == 0 && reply[0] == STATUS_PENDING) {
            if (reply[1] & 1) { // bmClear.D0: data waits in the Bulk-IN FIFO (section 4.2.1.7)
                drain(device);
            }
            gonio_clock_sleep_ms(5);
        }
    } while (code == 0 && reply[0] == STATUS_PENDING && gonio_deadline_left_ms(deadline) > 0);
    if (code != 0 || reply[0] == STATUS_PENDING) {
        return fail_usb(device, code != 0 ? code : LIBUSB_ERROR_TIMEOUT, "CHECK_CLEAR_STATUS", error);
    }
    code = libusb_clear_halt(device->handle, device->out);
    if (code == 0) {
        code = libusb_clear_halt(device->handle, device->in);
    }
    return code == 0 ? GONIO_OK : fail_usb(device, code, "clear halt", error);
}

static void put_header(gonio_usbtmc *device, uint8_t *header, uint8_t id, size_t size, uint8_t attributes) {
    device->tag = (uint8_t)(device->tag % 255 + 1); // 1 to 255 (table 1)
    memset(header, 0, HEADER);
    header[0] = id;
    header[1] = device->tag;
    header[2] = (uint8_t)~device->tag;
    for (int i = 0; i < 4; i++) {
        header[4 + i] = (uint8_t)(size >> (8 * i));
    }
    header[8] = attributes;
}

// One Bulk-OUT transfer; a failed one is aborted.
static gonio_status send_out(gonio_usbtmc *device, uint8_t *transfer, size_t n, int timeout_ms, const char *what,
                             gonio_error *error) {
    int sent = 0;
    const int code = libusb_bulk_transfer(device->handle, device->out, transfer, (int)n, &sent, (unsigned)timeout_ms);
    if (code == 0 && (size_t)sent == n) {
        return GONIO_OK;
    }
    if (code == LIBUSB_ERROR_PIPE) {
        libusb_clear_halt(device->handle, device->out);
    }
    if (code != LIBUSB_ERROR_NO_DEVICE) {
        abort_transfer(device, false, device->tag);
    }
    return fail_usb(device, code != 0 ? code : LIBUSB_ERROR_IO, what, error);
}

gonio_status gonio_usbtmc_write(gonio_usbtmc *device, const void *message, size_t n, int timeout_ms,
                                gonio_error *error) {
    if (n == 0 || n > CHUNK - HEADER) {
        return gonio_fail(error, GONIO_E_RANGE, "a USBTMC message of %zu bytes; expected 1 to %d", n, CHUNK - HEADER);
    }
    uint8_t transfer[CHUNK + 4] = {0};
    put_header(device, transfer, MESSAGE_OUT, n, EOM);
    memcpy(transfer + HEADER, message, n);
    const size_t padded = (HEADER + n + 3) / 4 * 4; // section 3.2: whole 4-byte words
    return send_out(device, transfer, padded, timeout_ms > 0 ? timeout_ms : 1, "message out", error);
}

// Receive the one transfer asked for last: payload to *message; *end where it was the last of the message.
static gonio_status receive_in(gonio_usbtmc *device, uint8_t *message, size_t room, size_t *n, bool *end,
                               int timeout_ms, gonio_error *error) {
    uint8_t transfer[CHUNK + 1024];
    const int size = (int)sizeof transfer / device->packet * device->packet;
    int got = 0;
    const int code = libusb_bulk_transfer(device->handle, device->in, transfer, size, &got, (unsigned)timeout_ms);
    if (code != 0) {
        if (code == LIBUSB_ERROR_PIPE) {
            libusb_clear_halt(device->handle, device->in);
        }
        if (code != LIBUSB_ERROR_NO_DEVICE) {
            abort_transfer(device, true, device->tag);
        }
        return fail_usb(device, code, "message in", error);
    }
    size_t payload = 0;
    for (int i = 0; i < 4 && got >= HEADER; i++) {
        payload |= (size_t)transfer[4 + i] << (8 * i);
    }
    const char *fault = got < HEADER                          ? "reply shorter than its header"
                        : transfer[0] != MESSAGE_REQUEST_IN   ? "reply of another kind"
                        : transfer[1] != device->tag          ? "stale reply (tag of another request)"
                        : (transfer[1] ^ transfer[2]) != 0xff ? "reply with a damaged tag"
                        : payload > (size_t)got - HEADER      ? "reply shorter than it says"
                        : payload > room                      ? "reply longer than was asked for"
                                                              : NULL;
    if (fault != NULL) {
        abort_transfer(device, true, device->tag);
        gonio_usbtmc_clear(device, NULL);
        return gonio_fail(error, GONIO_E_DEVICE, "USBTMC: %s", fault);
    }
    memcpy(message, transfer + HEADER, payload);
    *n = payload;
    *end = (transfer[8] & EOM) != 0;
    return GONIO_OK;
}

gonio_status gonio_usbtmc_read(gonio_usbtmc *device, void *message, size_t size, size_t *n, int timeout_ms,
                               gonio_error *error) {
    const gonio_deadline deadline = gonio_deadline_in_ms(timeout_ms);
    bool end = false;
    for (*n = 0; !end;) {
        const size_t room = size - *n < CHUNK ? size - *n : CHUNK;
        const int left = gonio_deadline_left_ms(deadline);
        if (room == 0 || left == 0) {
            gonio_usbtmc_clear(device, NULL);
            return left == 0 ? gonio_fail(error, GONIO_E_TIMEOUT, "USBTMC: the reply does not end in %d ms", timeout_ms)
                             : gonio_fail(error, GONIO_E_DEVICE, "USBTMC: reply longer than %zu bytes", size);
        }
        uint8_t request[HEADER];
        put_header(device, request, MESSAGE_REQUEST_IN, room, 0);
        gonio_status status = send_out(device, request, HEADER, left, "request for a message", error);
        size_t got = 0;
        if (status == GONIO_OK) {
            status = receive_in(device, (uint8_t *)message + *n, room, &got, &end, left, error);
        }
        if (status != GONIO_OK) {
            return status;
        }
        *n += got;
    }
    return GONIO_OK;
}
