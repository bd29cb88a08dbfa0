// SPDX-License-Identifier: BSD-3-Clause
// A USBTMC / USB488 power meter behind FunctionFS: what the kernel's USB stack sees of a real one. Written from USBTMC
// 1.0. A query that begins with one of the words below misbehaves the first time that it is asked, and is answered as
// MEAS:POW? is from then on.
// usage: usbtmc_gadget FUNCTIONFS_FOLDER    says "ready" once it can be bound
#include <endian.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/usb/ch9.h>
#include <linux/usb/functionfs.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { HEADER = 12 };

// ---- descriptors ----

typedef struct function {
    struct usb_interface_descriptor interface;
    struct usb_endpoint_descriptor_no_audio out, in;
} __attribute__((packed)) function;

static struct {
    struct usb_functionfs_descs_head_v2 head;
    __le32 full_count, high_count;
    function full, high;
} __attribute__((packed)) descriptors;

static struct {
    struct usb_functionfs_strings_head head;
    __le16 language;
    char text[6];
} __attribute__((packed)) strings;

static function describe(uint16_t packet) {
    return (function){
        {.bLength = USB_DT_INTERFACE_SIZE,
         .bDescriptorType = USB_DT_INTERFACE,
         .bNumEndpoints = 2,
         .bInterfaceClass = 0xfe,
         .bInterfaceSubClass = 3,
         .bInterfaceProtocol = 1,
         .iInterface = 1},
        {USB_DT_ENDPOINT_SIZE, USB_DT_ENDPOINT, 1, USB_ENDPOINT_XFER_BULK, htole16(packet), 0},
        {USB_DT_ENDPOINT_SIZE, USB_DT_ENDPOINT, 2 | USB_DIR_IN, USB_ENDPOINT_XFER_BULK, htole16(packet), 0}};
}

static bool introduce(int ep0) {
    descriptors.head =
        (struct usb_functionfs_descs_head_v2){htole32(FUNCTIONFS_DESCRIPTORS_MAGIC_V2), htole32(sizeof descriptors),
                                              htole32(FUNCTIONFS_HAS_FS_DESC | FUNCTIONFS_HAS_HS_DESC)};
    descriptors.full_count = descriptors.high_count = htole32(3);
    descriptors.full = describe(64);
    descriptors.high = describe(512);
    strings.head = (struct usb_functionfs_strings_head){htole32(FUNCTIONFS_STRINGS_MAGIC), htole32(sizeof strings),
                                                        htole32(1), htole32(1)};
    strings.language = htole16(0x409);
    memcpy(strings.text, "meter", 6);
    return write(ep0, &descriptors, sizeof descriptors) > 0 && write(ep0, &strings, sizeof strings) > 0;
}

// ---- the meter ----

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static char reply[8192];
static size_t reply_n, reply_at;
static bool asked_before[8];
static int out, in;

static const char *const faults[] = {"MUTE", "STALL", "STALE", "SPLIT", "GARBAGE", "ENDLESS"};
enum fault { MUTE, STALL, STALE, SPLIT, GARBAGE, ENDLESS, NONE };
static enum fault fault = NONE;

static void forget(void) {
    pthread_mutex_lock(&lock);
    reply_n = reply_at = 0;
    pthread_mutex_unlock(&lock);
}

static void obey(const char *line) {
    reply_n = reply_at = 0;
    fault = NONE;
    if (strchr(line, '?') == NULL) {
        return;
    }
    for (enum fault f = MUTE; f < NONE; f++) {
        if (strncmp(line, faults[f], strlen(faults[f])) == 0 && !asked_before[f]) {
            asked_before[f] = true;
            fault = f;
        }
    }
    const char *text = strncmp(line, "*IDN?", 5) == 0 ? "GONIO,PM-2,S1,1.0\n"
                       : fault == GARBAGE             ? "---\n"
                                                      : "1.250000E-03\n";
    reply_n = fault == MUTE ? 0 : strlen(text);
    memcpy(reply, text, reply_n);
    if (fault == ENDLESS) {
        reply_n = sizeof reply;
        memset(reply, '1', sizeof reply);
    }
}

// The endpoint of the other direction halts, which is how FunctionFS is told to (Documentation/usb/functionfs.rst).
static void halt(int endpoint, bool is_in) {
    char byte = 0;
    const ssize_t refused = is_in ? read(endpoint, &byte, 1) : write(endpoint, &byte, 1);
    (void)refused;
}

static void give(const uint8_t *request) {
    uint8_t transfer[HEADER + sizeof reply + 4] = {2, request[1], (uint8_t)~request[1]};
    const size_t room = (size_t)request[4] | (size_t)request[5] << 8 | (size_t)request[6] << 16;
    size_t n = reply_n - reply_at;
    n = n < room ? n : room;
    n = fault == SPLIT && n > 3 ? 3 : n;
    if (n == 0 && reply_n == 0) {
        return; // nothing to say: the host will lose its patience
    }
    if (fault == STALL) {
        fault = NONE;
        halt(in, true);
        return;
    }
    if (fault == STALE) {
        fault = NONE;
        transfer[1] = (uint8_t)(request[1] % 255 + 1);
        transfer[2] = (uint8_t)~transfer[1];
    }
    transfer[4] = (uint8_t)n;
    transfer[5] = (uint8_t)(n >> 8);
    memcpy(transfer + HEADER, reply + reply_at, n);
    reply_at += n;
    transfer[8] = reply_at == reply_n;
    const size_t whole = (HEADER + n + 3) / 4 * 4;
    pthread_mutex_unlock(&lock);
    const ssize_t sent = write(in, transfer, whole);
    (void)sent;
    pthread_mutex_lock(&lock);
}

static void *talk(void *unused) {
    (void)unused;
    static uint8_t transfer[16384];
    for (;;) {
        const ssize_t n = read(out, transfer, sizeof transfer - 1);
        if (n < 0) {
            usleep(2000); // not plugged in
            continue;
        }
        pthread_mutex_lock(&lock);
        if (n < HEADER || transfer[1] == 0 || (transfer[1] ^ transfer[2]) != 0xff) {
            halt(out, false); // USBTMC 1.0, 3.2.2.3
        } else if (transfer[0] == 1) {
            transfer[n] = 0;
            obey((const char *)transfer + HEADER);
        } else if (transfer[0] == 2) {
            give(transfer);
        }
        pthread_mutex_unlock(&lock);
    }
    return NULL;
}

// ---- class requests, USBTMC 1.0 table 15 ----

static void answer(int ep0, const struct usb_ctrlrequest *setup) {
    uint8_t data[24] = {1};
    const uint16_t size = le16toh(setup->wLength);
    size_t n = 0;
    switch (setup->bRequest) {
    case 1: // INITIATE_ABORT_BULK_OUT, _IN
    case 3:
        forget();
        data[1] = (uint8_t)setup->wValue;
        n = 2;
        break;
    case 2: // CHECK_ABORT_BULK_OUT_STATUS, _IN
    case 4:
        n = 8;
        break;
    case 5: // INITIATE_CLEAR
        forget();
        n = 1;
        break;
    case 6: // CHECK_CLEAR_STATUS
        n = 2;
        break;
    case 128: // READ_STATUS_BYTE
        data[1] = (uint8_t)setup->wValue;
        data[2] = reply_n > reply_at ? 0x10 : 0;
        n = 3;
        break;
    }
    ssize_t moved;
    if (n == 0) { // stall by going the wrong way
        moved = setup->bRequestType & USB_DIR_IN ? read(ep0, NULL, 0) : write(ep0, NULL, 0);
    } else {
        moved = write(ep0, data, n < size ? n : size);
    }
    (void)moved;
}

static int endpoint(const char *folder, const char *name) {
    char path[256];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    const int fd = open(path, O_RDWR);
    if (fd < 0) {
        perror(path);
        exit(1);
    }
    return fd;
}

int main(int argc, char **argv) {
    if (argc != 2) {
        return 2;
    }
    const int ep0 = endpoint(argv[1], "ep0");
    if (!introduce(ep0)) {
        perror("ep0");
        return 1;
    }
    out = endpoint(argv[1], "ep1");
    in = endpoint(argv[1], "ep2");
    puts("ready");
    fflush(stdout);
    pthread_t thread;
    pthread_create(&thread, NULL, talk, NULL);
    struct usb_functionfs_event event;
    while (read(ep0, &event, sizeof event) == sizeof event) {
        if (event.type == FUNCTIONFS_SETUP) {
            answer(ep0, &event.u.setup);
        } else if (event.type == FUNCTIONFS_DISABLE) {
            forget();
        }
    }
    return 0;
}
