// SPDX-License-Identifier: BSD-3-Clause
// Any answers of a USB device to the USBTMC transport and the meter on it. libusb is stood in for: its functions are
// defined here, and the input says what each transfer gives.
#include <libusb.h>
#include <stdlib.h>
#include <string.h>

#include "host/drivers/meter_usbtmc.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static const uint8_t *input;
static size_t left;
static uint8_t last_out[12]; // header of the last Bulk-OUT transfer

static uint8_t take(void) {
    if (left == 0) {
        return 0;
    }
    left--;
    return *input++;
}

static int take_bytes(unsigned char *to, int n) {
    const size_t got = (size_t)n < left ? (size_t)n : left;
    memcpy(to, input, got);
    input += got;
    left -= got;
    return (int)got;
}

// An answer's first byte: how it ends. Past the input's end the device is gone, so that every loop ends.
static int outcome(uint8_t code) {
    static const int codes[] = {LIBUSB_ERROR_TIMEOUT, LIBUSB_ERROR_PIPE, LIBUSB_ERROR_NO_DEVICE, LIBUSB_ERROR_OVERFLOW,
                                LIBUSB_ERROR_IO};
    return left == 0 ? LIBUSB_ERROR_NO_DEVICE : code < 0xf0 ? 0 : codes[code % 5];
}

static struct libusb_endpoint_descriptor endpoints[] = {
    {.bEndpointAddress = 0x02, .bmAttributes = LIBUSB_TRANSFER_TYPE_BULK, .wMaxPacketSize = 64},
    {.bEndpointAddress = 0x81, .bmAttributes = LIBUSB_TRANSFER_TYPE_BULK, .wMaxPacketSize = 64}};
static const struct libusb_interface_descriptor setting = {.bInterfaceClass = 0xfe,
                                                           .bInterfaceSubClass = 3,
                                                           .bInterfaceProtocol = 1,
                                                           .bNumEndpoints = 2,
                                                           .endpoint = endpoints};
static const struct libusb_interface interfaces[] = {{&setting, 1}};
static struct libusb_config_descriptor configuration = {.bNumInterfaces = 1, .interface = interfaces};

int libusb_init(libusb_context **context) {
    *context = (libusb_context *)&configuration;
    return 0;
}
void libusb_exit(libusb_context *context) { (void)context; }

ssize_t libusb_get_device_list(libusb_context *context, libusb_device ***list) {
    static libusb_device *devices[] = {(libusb_device *)endpoints, NULL};
    (void)context;
    *list = devices;
    return left == 0 ? 0 : 1;
}
void libusb_free_device_list(libusb_device **list, int unref) { (void)list, (void)unref; }

int libusb_get_device_descriptor(libusb_device *usb, struct libusb_device_descriptor *d) {
    (void)usb;
    *d = (struct libusb_device_descriptor){
        .idVendor = 0x1313, .idProduct = 0x8078, .iManufacturer = 1, .iProduct = 2, .iSerialNumber = take() % 4};
    return 0;
}
int libusb_get_active_config_descriptor(libusb_device *usb, struct libusb_config_descriptor **config) {
    static const uint16_t packets[] = {64, 512, 1024, 8, 0, 4096, 0xffff, 1};
    (void)usb;
    endpoints[1].wMaxPacketSize = packets[take() % 8];
    *config = &configuration;
    return 0;
}
void libusb_free_config_descriptor(struct libusb_config_descriptor *config) { (void)config; }
uint8_t libusb_get_bus_number(libusb_device *usb) { return usb != NULL; }
uint8_t libusb_get_device_address(libusb_device *usb) { return usb != NULL; }

int libusb_open(libusb_device *usb, libusb_device_handle **handle) {
    *handle = (libusb_device_handle *)usb;
    return outcome(take());
}
void libusb_close(libusb_device_handle *handle) { (void)handle; }

int libusb_get_string_descriptor_ascii(libusb_device_handle *handle, uint8_t index, unsigned char *text, int size) {
    (void)handle;
    const int n = take() % (index == 3 ? 64 : 8);
    const int got = take_bytes(text, n < size ? n : size - 1);
    text[got] = 0;
    return got;
}

int libusb_set_auto_detach_kernel_driver(libusb_device_handle *handle, int enable) {
    (void)handle;
    return enable - 1;
}
int libusb_claim_interface(libusb_device_handle *handle, int number) {
    (void)handle;
    return number;
}
int libusb_release_interface(libusb_device_handle *handle, int number) {
    (void)handle;
    return number;
}
int libusb_clear_halt(libusb_device_handle *handle, unsigned char endpoint) {
    (void)handle, (void)endpoint;
    return outcome(take());
}

int libusb_control_transfer(libusb_device_handle *handle, uint8_t type, uint8_t request, uint16_t value, uint16_t index,
                            unsigned char *reply, uint16_t size, unsigned timeout) {
    (void)handle, (void)type, (void)request, (void)value, (void)index, (void)timeout;
    const uint8_t how = take();
    const int code = outcome(how);
    if (code != 0) {
        return code;
    }
    if (how < 0x80 && size > 0) { // a device that agrees
        reply[0] = 1;
        return size < 2 ? 1 : 2;
    }
    return take_bytes(reply, how % 16 < size ? how % 16 : size);
}

// A reply with a sound header around the input's bytes, or the bytes as they are.
static int bulk_in(unsigned char *transfer, int size, uint8_t how) {
    const int n = (how & 0x3f) * ((how & 0x40) != 0 ? 16 : 1);
    if (how & 0x80 || size < 12) {
        return take_bytes(transfer, n < size ? n : size);
    }
    const int payload = take_bytes(transfer + 12, n < size - 12 ? n : size - 12);
    memset(transfer, 0, 12);
    transfer[0] = 2;
    transfer[1] = last_out[1];
    transfer[2] = (uint8_t)~last_out[1];
    transfer[4] = (uint8_t)payload;
    transfer[5] = (uint8_t)(payload >> 8);
    transfer[8] = take() != 0xff;
    return 12 + payload;
}

int libusb_bulk_transfer(libusb_device_handle *handle, unsigned char endpoint, unsigned char *transfer, int size,
                         int *moved, unsigned timeout) {
    (void)handle, (void)timeout;
    const uint8_t how = take();
    const int code = outcome(how);
    *moved = 0;
    if (code != 0) {
        return code;
    }
    if (endpoint & LIBUSB_ENDPOINT_IN) {
        *moved = bulk_in(transfer, size, how);
    } else {
        memcpy(last_out, transfer, (size_t)size < sizeof last_out ? (size_t)size : sizeof last_out);
        *moved = how == 0xef ? size / 2 : size;
    }
    return 0;
}

const char *LIBUSB_CALL libusb_error_name(int code) { return code == 0 ? "LIBUSB_SUCCESS" : "LIBUSB_ERROR"; }

static void require(int condition) {
    if (!condition) {
        abort();
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    input = data;
    left = size;
    gonio_meter_usbtmc_config config;
    gonio_meter_usbtmc_defaults(&config);
    config.scpi.replug_s = 0;
    config.timeout_ms = 1000;
    strcpy(config.scpi.setup, "SENS:CORR:WAV 550");
    void *device = NULL;
    gonio_error error = {0};
    gonio_usbtmc_info *list;
    size_t n;
    if (take() % 8 == 0 && gonio_usbtmc_list(&list, &n, NULL) == GONIO_OK) {
        free(list);
    }
    if (gonio_meter_usbtmc_open(&config, &device, &error) != GONIO_OK) {
        require(error.message[0] != 0);
        return 0;
    }
    require(strlen(gonio_meter_usbtmc_identity(device)) < 256);
    const gonio_stamp stamp = {0};
    for (int k = 0; k < 3; k++) {
        double value = 0, sigma = -1;
        error = (gonio_error){0};
        const gonio_status status = gonio_meter_usbtmc.read(device, &stamp, 0, &value, &sigma, &error);
        require(status == GONIO_OK ? value > -1e300 && value < 1e300 && sigma >= 0 : error.message[0] != 0);
    }
    gonio_meter_usbtmc.close(device);
    return 0;
}
