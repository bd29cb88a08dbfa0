// SPDX-License-Identifier: BSD-3-Clause
// A camera behind the table of V4L2 system calls, in the world's time. What a frame shows is rendered only where it is
// the frame that was asked for: begun after the capture was called and the arms stood still, with the exposure that was
// set. Every other one shows nonsense, so that taking it shows in the samples.
#include <errno.h>
#include <linux/videodev2.h>
#include <string.h>

#include "tests/faults/world.h"

enum { BUFFERS = 4, FRAME_BYTES = CAMERA_WIDTH * CAMERA_HEIGHT * 2, READ_OUT_US = 1000, MAP_STRIDE = 16384 };

void (*camera_render)(double exposure_s, uint16_t *pixels);
int64_t camera_asked_us;

static struct {
    bool streaming;
    int32_t exposure, in_effect, auto_exposure, gain; // exposure in microseconds
    int change_in;                                    // frames until the exposure takes effect
    int64_t begins_us;                                // of the frame that is being exposed
    uint32_t sequence;
    int queue[BUFFERS], queued, done[BUFFERS], ready;
    int64_t late_until_us; // what is done is seen then
    struct v4l2_buffer filled[BUFFERS];
    uint16_t memory[BUFFERS][FRAME_BYTES / 2];
} cam;

void camera_model_reset(void) {
    memset(&cam, 0, sizeof cam);
    cam.exposure = cam.in_effect = 1000;
    cam.auto_exposure = 3;
}

static bool gone(void) { return world_stands(FAULT_camera_unplugged); }

static int64_t ends_us(void) { return cam.begins_us + cam.in_effect; } // the exposure
static int64_t arrives_us(void) { return ends_us() + READ_OUT_US; }    // the last of it

static void fill(int index) {
    uint16_t *pixels = cam.memory[index];
    const int64_t still_us = (int64_t)(w->machine.now_us - w->stepped_us) - (w->now_us - cam.begins_us);
    const bool wanted = cam.begins_us >= camera_asked_us && still_us >= SWING_US && cam.in_effect == cam.exposure;
    if (wanted) {
        camera_render((double)cam.in_effect * 1e-6, pixels);
    } else {
        for (int i = 0; i < FRAME_BYTES / 2; i++) {
            pixels[i] = (uint16_t)(i * 37 % 4096);
        }
    }
    struct v4l2_buffer *b = &cam.filled[index];
    *b = (struct v4l2_buffer){.index = (uint32_t)index,
                              .bytesused = FRAME_BYTES,
                              .flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC,
                              .sequence = cam.sequence};
    const bool uvc = world_stands(FAULT_uvc_stamps); // of the first packet, and called the exposure's start
    const int64_t stamp_us = 1000000000 + (uvc ? ends_us() : arrives_us()); // clock.c's epoch
    b->flags |= uvc ? V4L2_BUF_FLAG_TSTAMP_SRC_SOE : 0;
    b->timestamp.tv_sec = stamp_us / 1000000;
    b->timestamp.tv_usec = stamp_us % 1000000;
    if (world_strikes(FAULT_frame_damaged) != NULL) {
        b->flags |= V4L2_BUF_FLAG_ERROR;
        memset(pixels, 0xee, FRAME_BYTES);
    } else if (world_strikes(FAULT_frame_short) != NULL) {
        b->bytesused = world_random() % FRAME_BYTES;
    }
    const fault *late = world_strikes(FAULT_frame_late);
    if (late != NULL) {
        cam.late_until_us = w->now_us + 1000 + late->parameter % 400000;
    }
}

static bool frame_is_there(void) { return cam.ready > 0 && w->now_us >= cam.late_until_us; }

static void next_frame(void) {
    cam.begins_us = ends_us() + READ_OUT_US;
    cam.sequence++;
    if (cam.change_in > 0 && --cam.change_in == 0) {
        cam.in_effect = cam.exposure;
    }
}

// Frames that have ended by now: into buffers while there are any, lost when there are none.
static void catch_up(void) {
    while (cam.streaming && arrives_us() <= w->now_us) {
        w->counts[FRAMES] += cam.queued > 0;
        if (world_stands(FAULT_camera_silent)) {
        } else if (cam.queued > 0 && world_strikes(FAULT_frame_dropped) == NULL) {
            const int index = cam.queue[0];
            memmove(cam.queue, cam.queue + 1, sizeof cam.queue - sizeof *cam.queue);
            cam.queued--;
            fill(index);
            cam.done[cam.ready++] = index;
        } else if (cam.queued == 0 && cam.change_in == 0) {
            const int64_t period = cam.in_effect + READ_OUT_US, missed = (w->now_us - arrives_us()) / period;
            cam.begins_us += missed * period;
            cam.sequence += (uint32_t)missed;
        }
        next_frame();
    }
}

static int model_open(void *state, const char *path) {
    (void)state;
    (void)path;
    if (gone()) {
        return -ENOENT;
    }
    camera_model_reset();
    return 3;
}

static void model_close(void *state, int handle) {
    (void)state;
    (void)handle;
    cam.streaming = false;
}

static int query_control(struct v4l2_query_ext_ctrl *q) {
    const uint32_t id = q->id;
    switch (id) {
    case V4L2_CID_EXPOSURE_AUTO:
        *q = (struct v4l2_query_ext_ctrl){.id = id, .type = V4L2_CTRL_TYPE_MENU, .maximum = 3, .step = 1};
        return 0;
    case V4L2_CID_EXPOSURE_ABSOLUTE:
        *q = (struct v4l2_query_ext_ctrl){.id = id, .minimum = 20, .maximum = 50000, .step = 1};
        return 0;
    case V4L2_CID_GAIN:
        *q = (struct v4l2_query_ext_ctrl){.id = id, .minimum = 0, .maximum = 96, .step = 4};
        return 0;
    default:
        return -EINVAL;
    }
}

static int32_t *control(uint32_t id) {
    return id == V4L2_CID_EXPOSURE_AUTO       ? &cam.auto_exposure
           : id == V4L2_CID_EXPOSURE_ABSOLUTE ? &cam.exposure
           : id == V4L2_CID_GAIN              ? &cam.gain
                                              : NULL;
}

static int set_control(const struct v4l2_control *c) {
    int32_t *value = control(c->id);
    if (value == NULL) {
        return -EINVAL;
    }
    catch_up();
    if (c->id == V4L2_CID_EXPOSURE_ABSOLUTE) {
        if (world_stands(FAULT_exposure_stuck)) {
            return 0; // says yes and does nothing
        }
        cam.change_in = 1 + (int)(world_random() % 3);
    }
    *value = c->value;
    return 0;
}

static int dequeue(struct v4l2_buffer *b) {
    catch_up();
    if (!frame_is_there()) {
        return -EAGAIN;
    }
    const int index = cam.done[0];
    memmove(cam.done, cam.done + 1, sizeof cam.done - sizeof *cam.done);
    cam.ready--;
    const uint32_t type = b->type;
    *b = cam.filled[index];
    b->type = type;
    return 0;
}

static int stream(bool on) {
    cam.streaming = on;
    if (on) {
        cam.begins_us = w->now_us;
        cam.sequence = 0;
    } else {
        cam.queued = cam.ready = 0;
        cam.late_until_us = 0;
    }
    return 0;
}

static int model_ioctl(void *state, int handle, unsigned long request, void *argument, size_t size) {
    (void)state;
    (void)handle;
    (void)size;
    if (gone()) {
        return -ENODEV;
    }
    switch ((uint32_t)request) {
    case (uint32_t)VIDIOC_QUERYCAP: {
        struct v4l2_capability *c = argument;
        strcpy((char *)c->card, "Model");
        c->capabilities = V4L2_CAP_STREAMING | V4L2_CAP_VIDEO_CAPTURE;
        return 0;
    }
    case (uint32_t)VIDIOC_ENUM_FMT: {
        struct v4l2_fmtdesc *f = argument;
        f->pixelformat = V4L2_PIX_FMT_Y16;
        return f->index == 0 ? 0 : -EINVAL;
    }
    case (uint32_t)VIDIOC_G_FMT:
    case (uint32_t)VIDIOC_S_FMT:
        ((struct v4l2_format *)argument)->fmt.pix = (struct v4l2_pix_format){.width = CAMERA_WIDTH,
                                                                             .height = CAMERA_HEIGHT,
                                                                             .pixelformat = V4L2_PIX_FMT_Y16,
                                                                             .bytesperline = CAMERA_WIDTH * 2,
                                                                             .sizeimage = FRAME_BYTES};
        return 0;
    case (uint32_t)VIDIOC_QUERY_EXT_CTRL:
        return query_control(argument);
    case (uint32_t)VIDIOC_G_CTRL: {
        struct v4l2_control *c = argument;
        const int32_t *value = control(c->id);
        c->value = value != NULL ? *value : 0;
        return value != NULL ? 0 : -EINVAL;
    }
    case (uint32_t)VIDIOC_S_CTRL:
        return set_control(argument);
    case (uint32_t)VIDIOC_REQBUFS: {
        struct v4l2_requestbuffers *r = argument;
        r->count = r->count > BUFFERS ? BUFFERS : r->count;
        return 0;
    }
    case (uint32_t)VIDIOC_QUERYBUF: {
        struct v4l2_buffer *b = argument;
        b->length = FRAME_BYTES;
        b->m.offset = b->index * MAP_STRIDE;
        return b->index < BUFFERS ? 0 : -EINVAL;
    }
    case (uint32_t)VIDIOC_QBUF:
        catch_up();
        cam.queue[cam.queued++] = (int)((struct v4l2_buffer *)argument)->index;
        return 0;
    case (uint32_t)VIDIOC_DQBUF:
        return dequeue(argument);
    case (uint32_t)VIDIOC_STREAMON:
        return stream(true);
    case (uint32_t)VIDIOC_STREAMOFF:
        return stream(false);
    default:
        return -ENOTTY;
    }
}

static int model_map(void *state, int handle, size_t length, int64_t offset, void **memory) {
    (void)state;
    (void)handle;
    (void)length;
    *memory = cam.memory[offset / MAP_STRIDE];
    return 0;
}

static void model_unmap(void *state, void *memory, size_t length) {
    (void)state;
    (void)memory;
    (void)length;
}

static int model_wait(void *state, int handle, int timeout_ms) {
    (void)state;
    (void)handle;
    const int64_t until = w->now_us + (int64_t)timeout_ms * 1000;
    catch_up();
    while (!gone() && !frame_is_there() && w->now_us < until) {
        const int64_t next = cam.ready > 0                               ? cam.late_until_us
                             : cam.streaming && arrives_us() > w->now_us ? arrives_us()
                                                                         : w->now_us + 10000;
        world_pass((next < until ? next : until) - w->now_us);
        clock_turn();
        catch_up();
    }
    return gone() ? -ENODEV : frame_is_there();
}

static int64_t model_now(void *state) {
    (void)state;
    return (1000000000 + w->now_us) * 1000;
}

const gonio_v4l2_io camera_model_io = {model_open,  model_close, model_ioctl, model_map,
                                       model_unmap, model_wait,  model_now};
