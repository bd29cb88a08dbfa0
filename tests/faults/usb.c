// SPDX-License-Identifier: BSD-3-Clause
// A USBTMC power meter at libusb's calls: the transport and the driver above run unchanged. Written from the standard
// (USBTMC 1.0), as tests/unit/usbtmc_model.h is; that one also runs libusb itself.
#include <libusb.h>
#include <stdio.h>
#include <string.h>

#include "tests/faults/world.h"

enum { OUT = 0x02, IN = 0x81, TRANSFER_US = 150 };

double (*usb_power)(void);

static struct {
    char reply[8192];
    size_t reply_n;
    bool ready, asked, halted_out, halted_in;
    uint8_t tag;
} usb;
static int anything; // what libusb's pointers point at

void usb_model_reset(void) { memset(&usb, 0, sizeof usb); }

static bool gone(void) { return world_stands(FAULT_usb_unplugged); }

static void execute(const char *line) {
    usb.ready = false;
    if (strchr(line, '?') == NULL) {
        return;
    }
    const fault *f;
    if (strncmp(line, "*IDN?", 5) == 0) {
        snprintf(usb.reply, sizeof usb.reply, "GONIO,PM-1,S1,1.0\n");
    } else if ((f = world_strikes(FAULT_usb_reply_garbage)) != NULL) {
        static const char *const texts[] = {"not a number\n", "9.91E+37\n", "\n", "1.0E-3?\n"};
        snprintf(usb.reply, sizeof usb.reply, "%s", texts[f->parameter % 4]);
    } else {
        snprintf(usb.reply, sizeof usb.reply, "%.17g\n", usb_power());
    }
    usb.reply_n = strlen(usb.reply);
    usb.ready = world_strikes(FAULT_usb_silent) == NULL;
}

static int bulk_out(const uint8_t *b, int n) {
    const fault *f = usb.halted_out ? NULL : world_strikes(FAULT_usb_stall);
    // A clear that is to fail needs an occasion to be asked for.
    usb.halted_out = usb.halted_out || world_waits(FAULT_usb_clear_fails);
    if (usb.halted_out || f != NULL || n < 12 || (b[1] ^ b[2]) != 0xff || n % 4 != 0) {
        usb.halted_out = true;
        usb.halted_in = usb.halted_in || (f != NULL && f->parameter & 1);
        return LIBUSB_ERROR_PIPE;
    }
    if (b[0] == 1) {
        char line[512] = "";
        const int size = b[4] | b[5] << 8;
        snprintf(line, sizeof line, "%.*s", size < 500 ? size : 500, (const char *)b + 12);
        execute(line);
    } else {
        usb.asked = true;
        usb.tag = b[1];
    }
    return 0;
}

static int bulk_in(uint8_t *b, int room, int *got) {
    if (usb.halted_in) {
        return LIBUSB_ERROR_PIPE;
    }
    if (!usb.asked || !usb.ready || room < 12) {
        return LIBUSB_ERROR_TIMEOUT;
    }
    usb.asked = usb.ready = false;
    memset(b, 0, 12);
    b[0] = 2;
    b[1] = usb.tag;
    b[4] = (uint8_t)usb.reply_n;
    b[8] = 1;
    memcpy(b + 12, usb.reply, usb.reply_n);
    *got = 12 + (int)usb.reply_n;
    const fault *f;
    if ((f = world_strikes(FAULT_usb_reply_short)) != NULL) {
        *got = (int)(f->parameter % (uint32_t)*got);
    }
    if (world_strikes(FAULT_usb_reply_stale) != NULL) {
        b[1] = (uint8_t)(usb.tag % 255 + 2);
    }
    b[2] = (uint8_t)~b[1];
    return 0;
}

int libusb_bulk_transfer(libusb_device_handle *handle, unsigned char endpoint, unsigned char *data, int length,
                         int *transferred, unsigned int timeout) {
    (void)handle;
    *transferred = 0;
    w->counts[USB_TRANSFERS]++;
    world_pass(TRANSFER_US);
    clock_turn();
    if (gone()) {
        return LIBUSB_ERROR_NO_DEVICE;
    }
    if (endpoint == OUT) {
        const int code = bulk_out(data, length);
        *transferred = code == 0 ? length : 0;
        return code;
    }
    const int code = bulk_in(data, length, transferred);
    if (code == LIBUSB_ERROR_TIMEOUT) {
        world_pass(1000 * (int64_t)timeout);
        clock_turn();
        return gone() ? LIBUSB_ERROR_NO_DEVICE : code;
    }
    return code;
}

int libusb_control_transfer(libusb_device_handle *handle, uint8_t type, uint8_t request, uint16_t value, uint16_t index,
                            unsigned char *data, uint16_t length, unsigned int timeout) {
    (void)handle;
    (void)type;
    (void)index;
    (void)timeout;
    world_pass(TRANSFER_US);
    if (gone()) {
        return LIBUSB_ERROR_NO_DEVICE;
    }
    if (request == 5 && world_strikes(FAULT_usb_clear_fails) != NULL) {
        return LIBUSB_ERROR_PIPE;
    }
    memset(data, 0, length);
    data[0] = 1;
    if (request == 1 || request == 3) { // INITIATE_ABORT
        data[1] = (uint8_t)value;
    }
    if (request <= 5) {
        usb.ready = usb.asked = false;
    }
    return length;
}

int libusb_clear_halt(libusb_device_handle *handle, unsigned char endpoint) {
    (void)handle;
    *(endpoint == OUT ? &usb.halted_out : &usb.halted_in) = false;
    return gone() ? LIBUSB_ERROR_NO_DEVICE : 0;
}

// ---- one device on the bus, or none ----

static libusb_device *device(void) { return (libusb_device *)(void *)&anything; }

int libusb_init(libusb_context **context) {
    *context = (libusb_context *)(void *)&anything;
    return 0;
}
void libusb_exit(libusb_context *context) { (void)context; }

ssize_t libusb_get_device_list(libusb_context *context, libusb_device ***list) {
    (void)context;
    static libusb_device *devices[2];
    devices[0] = device();
    *list = devices;
    world_pass(TRANSFER_US);
    return gone() ? 0 : 1;
}
void libusb_free_device_list(libusb_device **list, int unref) {
    (void)list;
    (void)unref;
}

int libusb_get_device_descriptor(libusb_device *d, struct libusb_device_descriptor *descriptor) {
    (void)d;
    *descriptor = (struct libusb_device_descriptor){.idVendor = 0x1313, .idProduct = 0x8078, .iSerialNumber = 3};
    return 0;
}

int libusb_get_active_config_descriptor(libusb_device *d, struct libusb_config_descriptor **config) {
    (void)d;
    static const struct libusb_endpoint_descriptor endpoints[] = {
        {.bEndpointAddress = OUT, .bmAttributes = LIBUSB_TRANSFER_TYPE_BULK, .wMaxPacketSize = 512},
        {.bEndpointAddress = IN, .bmAttributes = LIBUSB_TRANSFER_TYPE_BULK, .wMaxPacketSize = 512}};
    static const struct libusb_interface_descriptor setting = {.bInterfaceClass = 0xfe,
                                                               .bInterfaceSubClass = 3,
                                                               .bInterfaceProtocol = 1,
                                                               .bNumEndpoints = 2,
                                                               .endpoint = endpoints};
    static const struct libusb_interface interface = {.altsetting = &setting, .num_altsetting = 1};
    static struct libusb_config_descriptor only = {.bNumInterfaces = 1, .interface = &interface};
    *config = &only;
    return 0;
}
void libusb_free_config_descriptor(struct libusb_config_descriptor *config) { (void)config; }

uint8_t libusb_get_bus_number(libusb_device *d) {
    (void)d;
    return 1;
}
uint8_t libusb_get_device_address(libusb_device *d) {
    (void)d;
    return 2;
}

int libusb_open(libusb_device *d, libusb_device_handle **handle) {
    *handle = (libusb_device_handle *)(void *)d;
    usb_model_reset();
    return gone() ? LIBUSB_ERROR_NO_DEVICE : 0;
}
void libusb_close(libusb_device_handle *handle) { (void)handle; }

int libusb_get_string_descriptor_ascii(libusb_device_handle *handle, uint8_t index, unsigned char *data, int length) {
    (void)handle;
    return snprintf((char *)data, (size_t)length, "%s", index == 3 ? "S1" : "PM-1");
}

int libusb_set_auto_detach_kernel_driver(libusb_device_handle *handle, int enable) {
    (void)handle;
    (void)enable;
    return 0;
}
int libusb_claim_interface(libusb_device_handle *handle, int interface) {
    (void)handle;
    (void)interface;
    return 0;
}
int libusb_release_interface(libusb_device_handle *handle, int interface) {
    (void)handle;
    (void)interface;
    return 0;
}
