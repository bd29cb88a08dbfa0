// SPDX-License-Identifier: BSD-3-Clause
// A USBTMC / USB488 power meter emulated under umockdev: usbfs requests in, the standard's behaviour and its faults
// out. Written from the standard (USBTMC 1.0), not from the driver.
#ifndef GONIO_TESTS_USBTMC_MODEL_H
#define GONIO_TESTS_USBTMC_MODEL_H

#include <errno.h>
#include <linux/usbdevice_fs.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <umockdev.h>

enum { MODEL_OUT = 0x02, MODEL_IN = 0x81, MODEL_VENDOR = 0x1313, MODEL_PRODUCT = 0x8078 };

// Faults: how many times each is still to happen, from the next chance on.
typedef struct model_faults {
    int stall_out, stall_in, mute, stale, headless, long_claim, wrong_id, bad_tag_check, garbage, nan, clear_pending,
        clear_refused, control_stall, endless;
} model_faults;

typedef struct usbtmc_model {
    GMutex lock;
    GList *flying, *done;
    UMockdevTestbed *testbed;
    UMockdevIoctlBase *handler;
    model_faults faults;
    char serial[32], command[1024], reply[8192];
    size_t command_n, reply_n, reply_at;
    bool reply_ready, asked, halted_out, halted_in;
    uint8_t asked_tag;
    size_t asked_size, split; // split: payload bytes a transfer, 0: as asked
    int clear_left;
    double power;
    int clears, aborts, queries, measured;
    char last_setup[256];
    char *syspath;
} usbtmc_model;

static usbtmc_model model;

static bool use(int *fault) {
    if (*fault <= 0) {
        return false;
    }
    (*fault)--;
    return true;
}

static void model_reset_buffers(void) {
    model.command_n = model.reply_n = model.reply_at = 0;
    model.reply_ready = model.asked = false;
}

// One SCPI line has arrived.
static void model_execute(const char *line) {
    model.reply_n = model.reply_at = 0;
    model.reply_ready = false;
    if (strchr(line, '?') == NULL) {
        snprintf(model.last_setup, sizeof model.last_setup, "%.255s", line);
        return;
    }
    model.queries++;
    if (use(&model.faults.mute)) {
        return;
    }
    if (strncmp(line, "*IDN?", 5) == 0) {
        snprintf(model.reply, sizeof model.reply, "GONIO,PM-1,%s,1.0\n", model.serial);
    } else if (use(&model.faults.garbage)) {
        snprintf(model.reply, sizeof model.reply, "not a number\n");
    } else if (use(&model.faults.nan)) {
        snprintf(model.reply, sizeof model.reply, "9.91E+37\n");
    } else if (use(&model.faults.endless)) {
        memset(model.reply, '1', sizeof model.reply);
        model.reply_n = sizeof model.reply;
        model.reply_ready = true;
        return;
    } else {
        model.measured++;
        snprintf(model.reply, sizeof model.reply, "%.9E\n", model.power);
    }
    model.reply_n = strlen(model.reply);
    model.reply_ready = true;
}

static int model_bulk_out(const uint8_t *b, int n) {
    if (model.halted_out || use(&model.faults.stall_out)) {
        model.halted_out = true;
        return -EPIPE;
    }
    if (n < 12 || b[1] == 0 || (b[1] ^ b[2]) != 0xff || n % 4 != 0) {
        model.halted_out = true; // section 3.2.2.3: an unusable header halts the endpoint
        return -EPIPE;
    }
    const size_t size = (size_t)b[4] | (size_t)b[5] << 8 | (size_t)b[6] << 16 | (size_t)b[7] << 24;
    if (b[0] == 1) {
        const size_t room = sizeof model.command - 1 - model.command_n;
        const size_t take = size < room ? size : room;
        memcpy(model.command + model.command_n, b + 12, take);
        model.command_n += take;
        if (b[8] & 1) {
            model.command[model.command_n] = 0;
            model.command_n = 0;
            model_execute(model.command);
        }
    } else if (b[0] == 2) {
        model.asked = true;
        model.asked_tag = b[1];
        model.asked_size = size;
    }
    return n;
}

// -EAGAIN: nothing to send yet, the transfer stays in flight.
static int model_bulk_in(uint8_t *b, int room) {
    if (model.halted_in || (model.asked && use(&model.faults.stall_in))) {
        model.halted_in = true;
        model.asked = false;
        return -EPIPE;
    }
    if (!model.asked || !model.reply_ready) {
        return -EAGAIN;
    }
    size_t n = model.reply_n - model.reply_at;
    n = n < model.asked_size ? n : model.asked_size;
    n = model.split != 0 && n > model.split ? model.split : n;
    memset(b, 0, 12);
    b[0] = use(&model.faults.wrong_id) ? 3 : 2;
    b[1] = use(&model.faults.stale) ? (uint8_t)(model.asked_tag % 255 + 2) : model.asked_tag;
    b[2] = (uint8_t)~b[1];
    if (use(&model.faults.bad_tag_check)) {
        b[2] ^= 0x10;
    }
    const size_t claim = use(&model.faults.long_claim) ? n + 100 : n;
    for (int i = 0; i < 4; i++) {
        b[4 + i] = (uint8_t)(claim >> (8 * i));
    }
    memcpy(b + 12, model.reply + model.reply_at, n);
    model.reply_at += n;
    b[8] = model.reply_at == model.reply_n;
    model.asked = false;
    if (b[8]) {
        model.reply_ready = false;
    }
    (void)room;
    return use(&model.faults.headless) ? 5 : (int)((12 + n + 3) / 4 * 4);
}

static int model_string(uint8_t index, uint8_t *data) {
    const char *texts[] = {NULL, "Gonio", "PM-1", model.serial};
    if (index == 0) {
        memcpy(data, (uint8_t[]){4, 3, 9, 4}, 4);
        return 4;
    }
    if (index > 3) {
        return -EPIPE;
    }
    const size_t n = strlen(texts[index]);
    data[0] = (uint8_t)(2 + 2 * n);
    data[1] = 3;
    for (size_t i = 0; i < n; i++) {
        data[2 + 2 * i] = (uint8_t)texts[index][i];
        data[3 + 2 * i] = 0;
    }
    return data[0];
}

static int model_class_request(uint8_t request, uint16_t value, uint8_t *data) {
    data[0] = 1;
    switch (request) {
    case 1: // INITIATE_ABORT_BULK_OUT
    case 3: // INITIATE_ABORT_BULK_IN
        model.aborts++;
        model_reset_buffers();
        data[1] = (uint8_t)value;
        return 2;
    case 2: // CHECK_ABORT_..._STATUS
    case 4:
        memset(data + 1, 0, 7);
        return 8;
    case 5: // INITIATE_CLEAR
        if (use(&model.faults.clear_refused)) {
            return -EPIPE;
        }
        model.clears++;
        model_reset_buffers();
        model.clear_left = model.faults.clear_pending;
        return 1;
    case 6: // CHECK_CLEAR_STATUS
        data[0] = model.clear_left > 0 ? 2 : 1;
        data[1] = 0;
        model.clear_left -= model.clear_left > 0;
        return 2;
    case 128: // READ_STATUS_BYTE
        data[1] = (uint8_t)value;
        data[2] = model.reply_ready ? 0x10 : 0;
        return 3;
    default:
        return -EPIPE;
    }
}

static int model_control(uint8_t *b) {
    const uint16_t value = (uint16_t)(b[2] | b[3] << 8), size = (uint16_t)(b[6] | b[7] << 8);
    uint8_t data[256] = {0};
    int n = -EPIPE;
    if (b[0] == 0x80 && b[1] == 6 && b[3] == 3) {
        n = model_string(b[2], data);
    } else if ((b[0] & 0x60) == 0x20 && !use(&model.faults.control_stall)) {
        n = model_class_request(b[1], value, data);
    }
    if (n > (int)size) {
        n = size;
    }
    if (n > 0) {
        memcpy(b + 8, data, (size_t)n);
    }
    return n;
}

// Let every transfer in flight go as far as it can.
static void model_work(void) {
    for (GList *l = model.flying, *next; l != NULL; l = next) {
        next = l->next;
        UMockdevIoctlData *data = l->data;
        struct usbdevfs_urb *urb = (void *)data->data;
        int n;
        if (urb->type == USBDEVFS_URB_TYPE_CONTROL) {
            n = model_control(urb->buffer);
        } else if (urb->endpoint == MODEL_OUT) {
            n = model_bulk_out(urb->buffer, urb->buffer_length);
        } else {
            n = model_bulk_in(urb->buffer, urb->buffer_length);
        }
        if (n == -EAGAIN) {
            continue;
        }
        urb->status = n < 0 ? n : 0;
        urb->actual_length = n < 0 ? 0 : n;
        model.flying = g_list_delete_link(model.flying, l);
        model.done = g_list_append(model.done, data);
    }
}

static int model_discard(gulong address) {
    for (GList *l = model.flying; l != NULL; l = l->next) {
        UMockdevIoctlData *data = l->data;
        if (data->client_addr == address) {
            ((struct usbdevfs_urb *)(void *)data->data)->status = -ENOENT;
            model.flying = g_list_delete_link(model.flying, l);
            model.done = g_list_append(model.done, data);
            return 0;
        }
    }
    return EINVAL;
}

static int model_submit(UMockdevIoctlData *argument) {
    UMockdevIoctlData *data = umockdev_ioctl_data_resolve(argument, 0, sizeof(struct usbdevfs_urb), NULL);
    struct usbdevfs_urb *urb = (void *)data->data;
    if (urb->buffer_length > 0) {
        umockdev_ioctl_data_resolve(data, G_STRUCT_OFFSET(struct usbdevfs_urb, buffer), (gsize)urb->buffer_length,
                                    NULL);
    }
    model.flying = g_list_append(model.flying, data);
    model_work();
    return 0;
}

static int model_reap(UMockdevIoctlData *argument) {
    if (model.done == NULL) {
        return EAGAIN;
    }
    UMockdevIoctlData *slot = umockdev_ioctl_data_resolve(argument, 0, sizeof(gpointer), NULL);
    umockdev_ioctl_data_set_ptr(slot, 0, model.done->data);
    g_object_unref(model.done->data);
    model.done = g_list_delete_link(model.done, model.done);
    g_object_unref(slot);
    return 0;
}

static int model_clear_halt(UMockdevIoctlData *argument) {
    UMockdevIoctlData *endpoint = umockdev_ioctl_data_resolve(argument, 0, sizeof(unsigned), NULL);
    const unsigned address = *(unsigned *)(void *)endpoint->data;
    g_object_unref(endpoint);
    *(address == MODEL_OUT ? &model.halted_out : &model.halted_in) = false;
    return 0;
}

static gboolean model_ioctl(UMockdevIoctlBase *handler, UMockdevIoctlClient *client, void *unused) {
    (void)handler;
    (void)unused;
    UMockdevIoctlData *argument = umockdev_ioctl_client_get_arg(client);
    int code = 0;
    gboolean handled = TRUE;
    g_mutex_lock(&model.lock);
    switch (umockdev_ioctl_client_get_request(client)) {
    case USBDEVFS_GET_CAPABILITIES: {
        UMockdevIoctlData *data = umockdev_ioctl_data_resolve(argument, 0, 4, NULL);
        *(guint32 *)(void *)data->data =
            USBDEVFS_CAP_BULK_CONTINUATION | USBDEVFS_CAP_NO_PACKET_SIZE_LIM | USBDEVFS_CAP_ZERO_PACKET;
        g_object_unref(data);
        break;
    }
    case USBDEVFS_DISCONNECT_CLAIM:
    case USBDEVFS_CLAIMINTERFACE:
    case USBDEVFS_RELEASEINTERFACE:
    case USBDEVFS_RESET:
        break;
    case USBDEVFS_GETDRIVER:
    case USBDEVFS_IOCTL:
        code = ENODATA;
        break;
    case USBDEVFS_CLEAR_HALT:
        code = model_clear_halt(argument);
        break;
    case USBDEVFS_SUBMITURB:
        code = model.syspath == NULL ? ENODEV : model_submit(argument);
        break;
    case USBDEVFS_REAPURB:
    case USBDEVFS_REAPURBNDELAY:
        code = model.syspath == NULL && model.done == NULL ? ENODEV : model_reap(argument);
        break;
    case USBDEVFS_DISCARDURB:
        code = model_discard(*(gulong *)(void *)argument->data);
        break;
    default:
        handled = FALSE;
    }
    g_mutex_unlock(&model.lock);
    if (handled) {
        umockdev_ioctl_client_complete(client, code != 0 ? -1 : 0, code);
    }
    return handled;
}

// A client that closes takes its transfers with it.
static void model_vanished(UMockdevIoctlBase *handler, UMockdevIoctlClient *client, void *unused) {
    (void)handler;
    (void)client;
    (void)unused;
    g_mutex_lock(&model.lock);
    g_list_free_full(model.flying, g_object_unref);
    g_list_free_full(model.done, g_object_unref);
    model.flying = model.done = NULL;
    g_mutex_unlock(&model.lock);
}

static bool model_plug(const char *serial) {
    static const char text[] =
        "P: /devices/pci0000:00/0000:00:14.0/usb1/1-1\nN: bus/usb/001/002\nE: DEVNAME=/dev/bus/usb/001/002\n"
        "E: DEVTYPE=usb_device\nE: SUBSYSTEM=usb\nE: BUSNUM=001\nE: DEVNUM=002\nE: MAJOR=189\nE: MINOR=1\n"
        "A: bConfigurationValue=1\\n\nA: busnum=1\\n\nA: devnum=2\\n\nA: speed=480\\n\nA: idVendor=1313\\n\n"
        "A: idProduct=8078\\n\n"
        "H: descriptors=120100020000004013137880000101020301" // device: 1313:8078, strings 1, 2, 3
        "0902200001010080320904000002FE030100"                // configuration; interface of class fe/03/01
        "0705020200020007058102000200\n";                     // endpoints 02 and 81, 512 bytes
    GError *error = NULL;
    g_mutex_lock(&model.lock);
    snprintf(model.serial, sizeof model.serial, "%s", serial);
    model_reset_buffers();
    model.halted_in = model.halted_out = false;
    model.syspath = "/sys/devices/pci0000:00/0000:00:14.0/usb1/1-1";
    g_mutex_unlock(&model.lock);
    if (!umockdev_testbed_add_from_string(model.testbed, text, &error)) {
        fprintf(stderr, "# umockdev: %s\n", error->message);
        return false;
    }
    return true;
}

static void model_unplug(void) {
    g_mutex_lock(&model.lock);
    model.syspath = NULL;
    g_mutex_unlock(&model.lock);
    umockdev_testbed_remove_device(model.testbed, "/sys/devices/pci0000:00/0000:00:14.0/usb1/1-1");
}

static bool model_start(void) {
    model.testbed = umockdev_testbed_new();
    model.handler = umockdev_ioctl_base_new();
    model.power = 1.25e-3;
    g_object_connect(model.handler, "signal-after::handle-ioctl", model_ioctl, NULL, "signal-after::client-vanished",
                     model_vanished, NULL, NULL);
    return umockdev_testbed_attach_ioctl(model.testbed, "/dev/bus/usb/001/002", model.handler, NULL);
}

static void model_stop(void) {
    g_object_unref(model.handler);
    g_object_unref(model.testbed);
}

#endif
