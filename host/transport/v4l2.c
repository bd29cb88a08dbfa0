// SPDX-License-Identifier: BSD-3-Clause
#include "host/transport/v4l2.h"

#include <errno.h>
#include <linux/videodev2.h>
#include <stdlib.h>
#include <string.h>

enum { BUFFERS_MAX = 16 };

struct gonio_v4l2 {
    const gonio_v4l2_io *io;
    void *state;
    int handle;
    char path[128], card[33], bus[33];
    bool multiplanar, streaming, gone;
    struct {
        void *memory;
        size_t length;
    } maps[BUFFERS_MAX];
    int mapped;
};

#define CALL(device, request, argument) call(device, request, argument, sizeof *(argument))

static int call(gonio_v4l2 *device, unsigned long request, void *argument, size_t size) {
    const int result = device->io->ioctl(device->state, device->handle, request, argument, size);
    if (result == -ENODEV) {
        device->gone = true;
    }
    return result;
}

static gonio_status fail_call(const gonio_v4l2 *device, int code, const char *what, gonio_error *error) {
    if (code == -ENODEV) {
        return gonio_fail(error, GONIO_E_DEVICE, "camera %s was unplugged (%s)", device->path, what);
    }
    return gonio_fail(error, GONIO_E_DEVICE, "camera %s: %s: %s", device->path, what, strerror(-code));
}

static uint32_t buffer_type(const gonio_v4l2 *device) {
    return device->multiplanar ? V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE : V4L2_BUF_TYPE_VIDEO_CAPTURE;
}

static gonio_status identify(gonio_v4l2 *device, gonio_error *error) {
    struct v4l2_capability capability = {0};
    const int code = CALL(device, VIDIOC_QUERYCAP, &capability);
    if (code != 0) {
        return code == -ENOTTY ? gonio_fail(error, GONIO_E_DEVICE, "%s is no V4L2 device", device->path)
                               : fail_call(device, code, "VIDIOC_QUERYCAP", error);
    }
    const uint32_t can =
        capability.capabilities & V4L2_CAP_DEVICE_CAPS ? capability.device_caps : capability.capabilities;
    if ((can & (V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_VIDEO_CAPTURE_MPLANE)) == 0 || (can & V4L2_CAP_STREAMING) == 0) {
        return gonio_fail(error, GONIO_E_DEVICE, "%s (%.32s) does not capture by streaming (capabilities 0x%08x)",
                          device->path, (const char *)capability.card, can);
    }
    device->multiplanar = (can & V4L2_CAP_VIDEO_CAPTURE) == 0;
    memcpy(device->card, capability.card, sizeof capability.card);
    memcpy(device->bus, capability.bus_info, sizeof capability.bus_info);
    return GONIO_OK;
}

gonio_status gonio_v4l2_open(const gonio_v4l2_io *io, void *state, const char *path, gonio_v4l2 **out,
                             gonio_error *error) {
    gonio_v4l2 *device = calloc(1, sizeof *device);
    if (device == NULL || strlen(path) >= sizeof device->path) {
        free(device);
        return gonio_fail(error, GONIO_E_INPUT, "camera path of %zu characters; expected fewer than %zu", strlen(path),
                          sizeof device->path);
    }
    device->io = io;
    device->state = state;
    strcpy(device->path, path);
    device->handle = io->open(state, path);
    if (device->handle < 0) {
        const int code = device->handle;
        free(device);
        return gonio_fail(error, GONIO_E_DEVICE, "camera %s cannot be opened: %s%s", path, strerror(-code),
                          code == -EACCES ? " (the user must be in the group video)" : "");
    }
    const gonio_status status = identify(device, error);
    if (status != GONIO_OK) {
        gonio_v4l2_close(device);
        return status;
    }
    *out = device;
    return GONIO_OK;
}

void gonio_v4l2_close(gonio_v4l2 *device) {
    if (device == NULL) {
        return;
    }
    gonio_v4l2_stop(device);
    device->io->close(device->state, device->handle);
    free(device);
}

const char *gonio_v4l2_card(const gonio_v4l2 *device) { return device->card; }
const char *gonio_v4l2_bus(const gonio_v4l2 *device) { return device->bus; }
bool gonio_v4l2_multiplanar(const gonio_v4l2 *device) { return device->multiplanar; }
bool gonio_v4l2_gone(const gonio_v4l2 *device) { return device->gone; }
int64_t gonio_v4l2_now_ns(const gonio_v4l2 *device) { return device->io->now_ns(device->state); }

gonio_status gonio_v4l2_offered(gonio_v4l2 *device, int index, uint32_t *fourcc, gonio_error *error) {
    struct v4l2_fmtdesc format = {.index = (uint32_t)index, .type = buffer_type(device)};
    const int code = CALL(device, VIDIOC_ENUM_FMT, &format);
    if (code == -EINVAL) {
        return gonio_fail(error, GONIO_E_RANGE, "no format %d", index);
    }
    *fourcc = format.pixelformat;
    return code == 0 ? GONIO_OK : fail_call(device, code, "VIDIOC_ENUM_FMT", error);
}

gonio_status gonio_v4l2_offered_size(gonio_v4l2 *device, uint32_t fourcc, int index, int *width, int *height,
                                     gonio_error *error) {
    struct v4l2_frmsizeenum size = {.index = (uint32_t)index, .pixel_format = fourcc};
    const int code = CALL(device, VIDIOC_ENUM_FRAMESIZES, &size);
    if (code == -EINVAL || code == -ENOTTY) {
        return gonio_fail(error, GONIO_E_RANGE, "no frame size %d", index);
    }
    if (code != 0) {
        return fail_call(device, code, "VIDIOC_ENUM_FRAMESIZES", error);
    }
    const bool discrete = size.type == V4L2_FRMSIZE_TYPE_DISCRETE;
    *width = (int)(discrete ? size.discrete.width : size.stepwise.max_width);
    *height = (int)(discrete ? size.discrete.height : size.stepwise.max_height);
    return GONIO_OK;
}

static void fourcc_text(uint32_t fourcc, char text[5]) {
    for (int i = 0; i < 4; i++) {
        const char c = (char)(fourcc >> (8 * i) & 0x7f);
        text[i] = (char)(c >= ' ' ? c : '?');
    }
    text[4] = 0;
}

static void from_kernel(const gonio_v4l2 *device, const struct v4l2_format *f, gonio_v4l2_format *format) {
    if (device->multiplanar) {
        const struct v4l2_pix_format_mplane *p = &f->fmt.pix_mp;
        *format = (gonio_v4l2_format){p->pixelformat, (int)p->width, (int)p->height, p->plane_fmt[0].bytesperline,
                                      p->plane_fmt[0].sizeimage};
    } else {
        const struct v4l2_pix_format *p = &f->fmt.pix;
        *format = (gonio_v4l2_format){p->pixelformat, (int)p->width, (int)p->height, p->bytesperline, p->sizeimage};
    }
}

gonio_status gonio_v4l2_set_format(gonio_v4l2 *device, gonio_v4l2_format *format, gonio_error *error) {
    const gonio_v4l2_format asked = *format;
    struct v4l2_format f = {.type = buffer_type(device)};
    int code = CALL(device, VIDIOC_G_FMT, &f);
    if (code != 0) {
        return fail_call(device, code, "VIDIOC_G_FMT", error);
    }
    gonio_v4l2_format present;
    from_kernel(device, &f, &present);
    const uint32_t width = asked.width > 0 ? (uint32_t)asked.width : (uint32_t)present.width;
    const uint32_t height = asked.width > 0 ? (uint32_t)asked.height : (uint32_t)present.height;
    memset(&f.fmt, 0, sizeof f.fmt);
    if (device->multiplanar) {
        f.fmt.pix_mp = (struct v4l2_pix_format_mplane){
            .width = width, .height = height, .pixelformat = asked.fourcc, .field = V4L2_FIELD_NONE, .num_planes = 1};
    } else {
        f.fmt.pix = (struct v4l2_pix_format){
            .width = width, .height = height, .pixelformat = asked.fourcc, .field = V4L2_FIELD_NONE};
    }
    code = CALL(device, VIDIOC_S_FMT, &f);
    if (code != 0) {
        return fail_call(device, code, "VIDIOC_S_FMT", error);
    }
    from_kernel(device, &f, format);
    char wanted[5], got[5];
    fourcc_text(asked.fourcc, wanted);
    fourcc_text(format->fourcc, got);
    if (format->fourcc != asked.fourcc || format->width != (int)width || format->height != (int)height) {
        return gonio_fail(error, GONIO_E_DEVICE, "camera %s: asked for %s %ux%u, the device gives %s %dx%d",
                          device->path, wanted, width, height, got, format->width, format->height);
    }
    if (device->multiplanar && f.fmt.pix_mp.num_planes != 1) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED, "camera %s: %s in %u memory planes; expected one", device->path,
                          got, f.fmt.pix_mp.num_planes);
    }
    return GONIO_OK;
}

gonio_status gonio_v4l2_find_control(gonio_v4l2 *device, uint32_t id, bool next, gonio_v4l2_control *control,
                                     gonio_error *error) {
    struct v4l2_query_ext_ctrl query = {.id = next ? id | V4L2_CTRL_FLAG_NEXT_CTRL : id};
    const int code = CALL(device, VIDIOC_QUERY_EXT_CTRL, &query);
    if (code == -EINVAL || code == -ENOTTY) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED, "camera %s has no control 0x%08x", device->path, id);
    }
    if (code != 0) {
        return fail_call(device, code, "VIDIOC_QUERY_EXT_CTRL", error);
    }
    *control = (gonio_v4l2_control){.id = query.id,
                                    .type = query.type,
                                    .flags = query.flags,
                                    .minimum = query.minimum,
                                    .maximum = query.maximum,
                                    .step = (int64_t)query.step,
                                    .fallback = query.default_value};
    memcpy(control->name, query.name, sizeof control->name);
    control->name[sizeof control->name - 1] = 0;
    return GONIO_OK;
}

// Get or set by the call that the control's type asks for: VIDIOC_G_CTRL and VIDIOC_S_CTRL refuse those of 64 bits.
static gonio_status move_control(gonio_v4l2 *device, uint32_t id, bool set, int64_t *value, gonio_error *error) {
    gonio_v4l2_control about;
    const gonio_status status = gonio_v4l2_find_control(device, id, false, &about, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (about.type == V4L2_CTRL_TYPE_INTEGER64) {
        struct v4l2_ext_control one = {.id = id, .value64 = set ? *value : 0};
        struct v4l2_ext_controls all = {.which = V4L2_CTRL_WHICH_CUR_VAL, .count = 1, .controls = &one};
        const int code = set ? CALL(device, VIDIOC_S_EXT_CTRLS, &all) : CALL(device, VIDIOC_G_EXT_CTRLS, &all);
        *value = one.value64;
        return code == 0 ? GONIO_OK : fail_call(device, code, set ? "VIDIOC_S_EXT_CTRLS" : "VIDIOC_G_EXT_CTRLS", error);
    }
    struct v4l2_control one = {.id = id, .value = set ? (int32_t)*value : 0};
    const int code = set ? CALL(device, VIDIOC_S_CTRL, &one) : CALL(device, VIDIOC_G_CTRL, &one);
    *value = one.value;
    return code == 0 ? GONIO_OK : fail_call(device, code, set ? "VIDIOC_S_CTRL" : "VIDIOC_G_CTRL", error);
}

gonio_status gonio_v4l2_get_control(gonio_v4l2 *device, uint32_t id, int64_t *value, gonio_error *error) {
    return move_control(device, id, false, value, error);
}

gonio_status gonio_v4l2_set_control(gonio_v4l2 *device, uint32_t id, int64_t value, gonio_error *error) {
    int64_t now = value;
    gonio_status status = move_control(device, id, true, &now, error);
    status = status == GONIO_OK ? move_control(device, id, false, &now, error) : status;
    if (status == GONIO_OK && now != value) {
        return gonio_fail(error, GONIO_E_DEVICE, "camera %s: control 0x%08x set to %lld reads back %lld", device->path,
                          id, (long long)value, (long long)now);
    }
    return status;
}

static double seconds(struct v4l2_fract f) { return f.denominator > 0 ? (double)f.numerator / f.denominator : 0; }

gonio_status gonio_v4l2_offered_interval(gonio_v4l2 *device, const gonio_v4l2_format *format, int index,
                                         gonio_v4l2_interval *interval, gonio_error *error) {
    struct v4l2_frmivalenum e = {.index = (uint32_t)index,
                                 .pixel_format = format->fourcc,
                                 .width = (uint32_t)format->width,
                                 .height = (uint32_t)format->height};
    const int code = CALL(device, VIDIOC_ENUM_FRAMEINTERVALS, &e);
    if (code == -EINVAL || code == -ENOTTY) {
        return gonio_fail(error, GONIO_E_RANGE, "no frame interval %d", index);
    }
    if (code != 0) {
        return fail_call(device, code, "VIDIOC_ENUM_FRAMEINTERVALS", error);
    }
    if (e.type == V4L2_FRMIVAL_TYPE_DISCRETE) {
        interval->shortest_s = interval->longest_s = seconds(e.discrete);
        interval->step_s = 0;
    } else {
        *interval = (gonio_v4l2_interval){seconds(e.stepwise.min), seconds(e.stepwise.max),
                                          e.type == V4L2_FRMIVAL_TYPE_CONTINUOUS ? 0 : seconds(e.stepwise.step)};
    }
    return GONIO_OK;
}

gonio_status gonio_v4l2_get_interval(gonio_v4l2 *device, double *interval_s, gonio_error *error) {
    struct v4l2_streamparm parm = {.type = buffer_type(device)};
    const int code = CALL(device, VIDIOC_G_PARM, &parm);
    if (code != 0 && code != -EINVAL && code != -ENOTTY) {
        return fail_call(device, code, "VIDIOC_G_PARM", error);
    }
    *interval_s = seconds(parm.parm.capture.timeperframe);
    return code == 0 && (parm.parm.capture.capability & V4L2_CAP_TIMEPERFRAME) != 0 && *interval_s > 0
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_UNSUPPORTED, "camera %s has no frame interval to set", device->path);
}

gonio_status gonio_v4l2_set_interval(gonio_v4l2 *device, double *interval_s, gonio_error *error) {
    struct v4l2_streamparm parm = {.type = buffer_type(device)};
    // In units of 100 ns, which are those of UVC.
    parm.parm.capture.timeperframe = (struct v4l2_fract){(uint32_t)(*interval_s * 1e7 + 0.5), 10000000};
    const int code = CALL(device, VIDIOC_S_PARM, &parm);
    *interval_s = seconds(parm.parm.capture.timeperframe);
    return code == 0 ? GONIO_OK : fail_call(device, code, "VIDIOC_S_PARM", error);
}

static void init_buffer(const gonio_v4l2 *device, struct v4l2_buffer *buffer, struct v4l2_plane *plane) {
    *buffer = (struct v4l2_buffer){.type = buffer_type(device), .memory = V4L2_MEMORY_MMAP};
    *plane = (struct v4l2_plane){0};
    if (device->multiplanar) {
        buffer->m.planes = plane;
        buffer->length = 1;
    }
}

static gonio_status map_and_queue(gonio_v4l2 *device, int index, gonio_error *error) {
    struct v4l2_buffer buffer;
    struct v4l2_plane plane;
    init_buffer(device, &buffer, &plane);
    buffer.index = (uint32_t)index;
    int code = CALL(device, VIDIOC_QUERYBUF, &buffer);
    if (code != 0) {
        return fail_call(device, code, "VIDIOC_QUERYBUF", error);
    }
    const size_t length = device->multiplanar ? plane.length : buffer.length;
    const int64_t offset = device->multiplanar ? plane.m.mem_offset : buffer.m.offset;
    code = device->io->map(device->state, device->handle, length, offset, &device->maps[index].memory);
    if (code != 0) {
        return fail_call(device, code, "mmap", error);
    }
    device->maps[index].length = length;
    device->mapped = index + 1;
    return gonio_v4l2_give(device, index, error);
}

gonio_status gonio_v4l2_start(gonio_v4l2 *device, int buffers, gonio_error *error) {
    struct v4l2_requestbuffers request = {
        .count = (uint32_t)buffers, .type = buffer_type(device), .memory = V4L2_MEMORY_MMAP};
    int code = CALL(device, VIDIOC_REQBUFS, &request);
    if (code != 0) {
        return fail_call(device, code, code == -EBUSY ? "in use by another program" : "VIDIOC_REQBUFS", error);
    }
    device->streaming = true; // from here on stop has something to undo
    if (request.count < 2) {
        gonio_v4l2_stop(device);
        return gonio_fail(error, GONIO_E_DEVICE, "camera %s gives %u buffers; expected 2 or more", device->path,
                          request.count);
    }
    gonio_status status = GONIO_OK;
    for (int i = 0; i < (int)request.count && i < BUFFERS_MAX && status == GONIO_OK; i++) {
        status = map_and_queue(device, i, error);
    }
    if (status == GONIO_OK) {
        int type = (int)buffer_type(device);
        code = CALL(device, VIDIOC_STREAMON, &type);
        status = code == 0 ? GONIO_OK : fail_call(device, code, "VIDIOC_STREAMON", error);
    }
    if (status != GONIO_OK) {
        gonio_v4l2_stop(device);
    }
    return status;
}

void gonio_v4l2_stop(gonio_v4l2 *device) {
    if (!device->streaming) {
        return;
    }
    int type = (int)buffer_type(device);
    CALL(device, VIDIOC_STREAMOFF, &type);
    for (int i = 0; i < device->mapped; i++) {
        device->io->unmap(device->state, device->maps[i].memory, device->maps[i].length);
    }
    device->mapped = 0;
    struct v4l2_requestbuffers request = {.type = buffer_type(device), .memory = V4L2_MEMORY_MMAP};
    CALL(device, VIDIOC_REQBUFS, &request);
    device->streaming = false;
}

static void fill(const gonio_v4l2 *device, const struct v4l2_buffer *b, const struct v4l2_plane *plane,
                 gonio_v4l2_buffer *out) {
    const size_t length = device->maps[b->index].length;
    const size_t start = device->multiplanar ? plane->data_offset : 0;
    const size_t used = device->multiplanar ? plane->bytesused : b->bytesused;
    const bool monotonic = (b->flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
    *out = (gonio_v4l2_buffer){
        .index = (int)b->index,
        .bytes = (const uint8_t *)device->maps[b->index].memory + (start <= length ? start : 0),
        .n = used <= length && start <= used ? used - start : 0,
        .sequence = b->sequence,
        .time_ns = monotonic ? (int64_t)b->timestamp.tv_sec * 1000000000 + (int64_t)b->timestamp.tv_usec * 1000 : -1,
        .start_of_exposure = (b->flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE,
        .damaged = (b->flags & V4L2_BUF_FLAG_ERROR) != 0};
}

gonio_status gonio_v4l2_take(gonio_v4l2 *device, int timeout_ms, gonio_v4l2_buffer *out, gonio_error *error) {
    const int ready = device->io->wait(device->state, device->handle, timeout_ms);
    if (ready == 0) {
        return gonio_fail(error, GONIO_E_TIMEOUT, "camera %s: no frame in %d ms", device->path, timeout_ms);
    }
    if (ready < 0) {
        device->gone = device->gone || ready == -ENODEV;
        return fail_call(device, ready, "poll", error);
    }
    struct v4l2_buffer buffer;
    struct v4l2_plane plane;
    init_buffer(device, &buffer, &plane);
    const int code = CALL(device, VIDIOC_DQBUF, &buffer);
    if (code == -EAGAIN) {
        return gonio_fail(error, GONIO_E_TIMEOUT, "camera %s: no frame", device->path);
    }
    if (code != 0 || buffer.index >= (uint32_t)device->mapped) {
        return fail_call(device, code != 0 ? code : -EPROTO, "VIDIOC_DQBUF", error);
    }
    fill(device, &buffer, &plane, out);
    return GONIO_OK;
}

gonio_status gonio_v4l2_give(gonio_v4l2 *device, int index, gonio_error *error) {
    struct v4l2_buffer buffer;
    struct v4l2_plane plane;
    init_buffer(device, &buffer, &plane);
    buffer.index = (uint32_t)index;
    const int code = CALL(device, VIDIOC_QBUF, &buffer);
    return code == 0 ? GONIO_OK : fail_call(device, code, "VIDIOC_QBUF", error);
}
