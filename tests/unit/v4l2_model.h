// SPDX-License-Identifier: BSD-3-Clause
// A camera behind the table of V4L2 system calls, in virtual time: each pixel carries the exposure that made it, so
// that a frame taken with the wrong setting or at the wrong time shows.
#ifndef GONIO_TESTS_V4L2_MODEL_H
#define GONIO_TESTS_V4L2_MODEL_H

#include <errno.h>
#include <linux/videodev2.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "host/transport/v4l2.h"

enum { CAM_WIDTH = 8, CAM_HEIGHT = 4, CAM_BUFFERS = 8, CAM_FRAME = CAM_WIDTH * CAM_HEIGHT * 2 };

// What a frame's stamp is. Of UVC: its first packet, which comes after the exposure, and flagged as the exposure's
// start all the same (uvcvideo flags every frame so).
typedef enum v4l2_stamp { STAMP_END, STAMP_START, STAMP_UVC, STAMPS } v4l2_stamp;

typedef struct v4l2_model {
    bool multiplanar, plugged, streaming, clockless;
    v4l2_stamp stamp;
    bool auto_exposure_sticks, no_exposure, mjpeg_only, plain;
    bool wide;          // the exposure control has 64 bits
    bool power_line;    // a compensation that cannot be switched off
    bool has_intervals; // the frame interval can be set, and cuts the exposure
    bool interval_sticks;
    int32_t exposure_max;
    int64_t read_out_ns;
    const char *card;
    int64_t now_ns, period_ns, next_end_ns;
    int latency; // frames after a change that still have the old exposure
    int32_t exposure, auto_exposure, white_balance, gain, power_line_frequency;
    int32_t history[64]; // exposure that each of the last frames was made with
    uint32_t sequence;
    int queue[CAM_BUFFERS], queued, done[CAM_BUFFERS], ready, buffers;
    struct v4l2_buffer filled[CAM_BUFFERS];
    uint8_t memory[CAM_BUFFERS][CAM_FRAME];
    // Faults: how many more times each happens.
    int silent, damage, cut, skip;
    int opens, stream_ons;
    bool triggered; // a frame only where it was fired
    int fired;
} v4l2_model;

static void cam_new(v4l2_model *m) {
    *m = (v4l2_model){.plugged = true,
                      .card = "Model",
                      .period_ns = 20000000,
                      .exposure = 100,
                      .exposure_max = 180,
                      .power_line_frequency = 1,
                      .auto_exposure = 3,
                      .white_balance = 1,
                      .gain = 16};
}

static void cam_fill(v4l2_model *m, int index) {
    struct v4l2_buffer *b = &m->filled[index];
    const int32_t exposure = m->history[(m->sequence - (uint32_t)m->latency) % 64];
    uint16_t *pixels = (uint16_t *)(void *)m->memory[index];
    for (int i = 0; i < CAM_WIDTH * CAM_HEIGHT; i++) {
        pixels[i] = (uint16_t)(exposure & 0xffff);
    }
    // Pixel 0 tells when the exposure began, in ms, unless frames are to be plain.
    const int64_t exposed_ns = m->next_end_ns - m->read_out_ns, begin_ns = exposed_ns - (int64_t)exposure * 100000;
    pixels[0] = m->plain ? pixels[1] : (uint16_t)(begin_ns / 1000000);
    const int64_t time = m->stamp == STAMP_START ? begin_ns : m->stamp == STAMP_UVC ? exposed_ns : m->next_end_ns;
    *b = (struct v4l2_buffer){.index = (uint32_t)index,
                              .bytesused = CAM_FRAME,
                              .flags =
                                  (m->clockless ? V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN : V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC) |
                                  (m->stamp != STAMP_END ? V4L2_BUF_FLAG_TSTAMP_SRC_SOE : 0),
                              .sequence = m->sequence};
    b->timestamp.tv_sec = time / 1000000000;
    b->timestamp.tv_usec = time % 1000000000 / 1000;
    if (m->damage > 0) {
        m->damage--;
        b->flags |= V4L2_BUF_FLAG_ERROR;
        memset(pixels, 0xee, CAM_FRAME);
    } else if (m->cut > 0) {
        m->cut--;
        b->bytesused = CAM_FRAME / 2;
    }
}

// Let virtual time pass: frames end, fill what is queued, and are lost where nothing is.
static void cam_pass(v4l2_model *m, int64_t until_ns) {
    while (m->streaming && m->next_end_ns <= until_ns) {
        m->now_ns = m->next_end_ns > m->now_ns ? m->next_end_ns : m->now_ns;
        if (m->triggered && m->fired == 0) {
            m->next_end_ns += m->period_ns;
            continue;
        }
        m->fired -= m->triggered;
        const int32_t cap = m->has_intervals ? (int32_t)(m->period_ns / 100000) : INT32_MAX;
        m->history[m->sequence % 64] = m->exposure < cap ? m->exposure : cap;
        if (m->silent > 0) {
            m->silent--;
        } else if (m->skip > 0) {
            m->skip--;
        } else if (m->queued > 0) {
            const int index = m->queue[0];
            memmove(m->queue, m->queue + 1, sizeof m->queue - sizeof *m->queue);
            m->queued--;
            cam_fill(m, index);
            m->done[m->ready++] = index;
        }
        m->sequence++;
        m->next_end_ns += m->period_ns;
    }
    m->now_ns = until_ns > m->now_ns ? until_ns : m->now_ns;
}

static int cam_open(void *state, const char *path) {
    v4l2_model *m = state;
    m->opens++;
    (void)path;
    return m->plugged ? 3 : -ENOENT;
}

static void cam_close(void *state, int handle) {
    (void)state;
    (void)handle;
}

static int cam_query_control(const v4l2_model *m, struct v4l2_query_ext_ctrl *q) {
    const uint32_t id = q->id;
    switch (id) {
    case V4L2_CID_EXPOSURE_AUTO:
        *q = (struct v4l2_query_ext_ctrl){.id = id, .type = V4L2_CTRL_TYPE_MENU, .maximum = 3, .step = 1};
        return 0;
    case V4L2_CID_AUTO_WHITE_BALANCE:
        *q = (struct v4l2_query_ext_ctrl){.id = id, .type = V4L2_CTRL_TYPE_BOOLEAN, .maximum = 1, .step = 1};
        return 0;
    case V4L2_CID_EXPOSURE_ABSOLUTE:
        *q = (struct v4l2_query_ext_ctrl){.id = id,
                                          .type = m->wide ? V4L2_CTRL_TYPE_INTEGER64 : V4L2_CTRL_TYPE_INTEGER,
                                          .minimum = 1,
                                          .maximum = m->exposure_max,
                                          .step = 1};
        return m->no_exposure ? -EINVAL : 0;
    case V4L2_CID_POWER_LINE_FREQUENCY:
        *q = (struct v4l2_query_ext_ctrl){.id = id, .type = V4L2_CTRL_TYPE_MENU, .minimum = 1, .maximum = 2, .step = 1};
        return m->power_line ? 0 : -EINVAL;
    case V4L2_CID_GAIN:
        *q = (struct v4l2_query_ext_ctrl){.id = id, .minimum = 0, .maximum = 96, .step = 4};
        return 0;
    default:
        return -EINVAL;
    }
}

static int32_t *cam_control(v4l2_model *m, uint32_t id) {
    return id == V4L2_CID_EXPOSURE_AUTO          ? &m->auto_exposure
           : id == V4L2_CID_AUTO_WHITE_BALANCE   ? &m->white_balance
           : id == V4L2_CID_EXPOSURE_ABSOLUTE    ? &m->exposure
           : id == V4L2_CID_GAIN                 ? &m->gain
           : id == V4L2_CID_POWER_LINE_FREQUENCY ? &m->power_line_frequency
                                                 : NULL;
}

static int cam_set_control(v4l2_model *m, uint32_t id, int64_t to) {
    int32_t *value = cam_control(m, id);
    if (value == NULL) {
        return -EINVAL;
    }
    if (id == V4L2_CID_POWER_LINE_FREQUENCY && (to < 1 || to > 2)) {
        return -ERANGE;
    }
    if (!(id == V4L2_CID_EXPOSURE_AUTO && m->auto_exposure_sticks)) {
        *value = (int32_t)to;
    }
    return 0;
}

// VIDIOC_G_CTRL and VIDIOC_S_CTRL, which know nothing of 64 bits.
static int cam_plain_control(v4l2_model *m, bool set, struct v4l2_control *c) {
    const int32_t *value = cam_control(m, c->id);
    if (value == NULL || (c->id == V4L2_CID_EXPOSURE_ABSOLUTE && m->wide)) {
        return -EINVAL;
    }
    if (set) {
        return cam_set_control(m, c->id, c->value);
    }
    c->value = *value;
    return 0;
}

static int cam_extended_control(v4l2_model *m, bool set, struct v4l2_ext_controls *all) {
    struct v4l2_ext_control *c = all->controls;
    const int32_t *value = all->count == 1 ? cam_control(m, c->id) : NULL;
    const bool wide = c->id == V4L2_CID_EXPOSURE_ABSOLUTE && m->wide;
    if (value == NULL) {
        return -EINVAL;
    }
    if (set) {
        return cam_set_control(m, c->id, wide ? c->value64 : c->value);
    }
    if (wide) {
        c->value64 = *value;
    } else {
        c->value = *value;
    }
    return 0;
}

static const int cam_intervals_ms[] = {20, 50, 100, 1000};

// Only while it stands still, and to what is nearest, as uvcvideo does it.
static int cam_set_interval(v4l2_model *m, struct v4l2_streamparm *parm) {
    struct v4l2_fract *f = &parm->parm.capture.timeperframe;
    if (m->streaming) {
        return -EBUSY;
    }
    const double asked_ms = 1000.0 * f->numerator / f->denominator;
    double nearest = INFINITY;
    for (size_t i = 0; i < sizeof cam_intervals_ms / sizeof *cam_intervals_ms && !m->interval_sticks; i++) {
        const double distance = fabs(cam_intervals_ms[i] - asked_ms);
        if (distance < nearest) {
            nearest = distance;
            m->period_ns = cam_intervals_ms[i] * INT64_C(1000000);
        }
    }
    *f = (struct v4l2_fract){(uint32_t)(m->period_ns / 1000), 1000000};
    return 0;
}

static int cam_interval(const v4l2_model *m, struct v4l2_streamparm *parm) {
    parm->parm.capture.capability = V4L2_CAP_TIMEPERFRAME;
    parm->parm.capture.timeperframe = (struct v4l2_fract){(uint32_t)(m->period_ns / 1000), 1000000};
    return 0;
}

static int cam_offered_interval(struct v4l2_frmivalenum *e) {
    e->type = V4L2_FRMIVAL_TYPE_DISCRETE;
    e->discrete = (struct v4l2_fract){(uint32_t)cam_intervals_ms[e->index % 4], 1000};
    return e->index < 4 ? 0 : -EINVAL;
}

static int cam_format(const v4l2_model *m, struct v4l2_format *f) {
    if (m->multiplanar) {
        struct v4l2_pix_format_mplane *p = &f->fmt.pix_mp;
        memset(p, 0, sizeof *p);
        p->width = CAM_WIDTH;
        p->height = CAM_HEIGHT;
        p->pixelformat = V4L2_PIX_FMT_Y16;
        p->num_planes = 1;
        p->plane_fmt[0].bytesperline = CAM_WIDTH * 2;
        p->plane_fmt[0].sizeimage = CAM_FRAME;
    } else {
        f->fmt.pix = (struct v4l2_pix_format){.width = CAM_WIDTH,
                                              .height = CAM_HEIGHT,
                                              .pixelformat = V4L2_PIX_FMT_Y16,
                                              .bytesperline = CAM_WIDTH * 2,
                                              .sizeimage = CAM_FRAME};
    }
    return 0;
}

static int cam_query_buffer(const v4l2_model *m, struct v4l2_buffer *b) {
    const uint32_t offset = b->index * 4096;
    if (m->multiplanar) {
        b->m.planes[0].length = CAM_FRAME;
        b->m.planes[0].m.mem_offset = offset;
    } else {
        b->length = CAM_FRAME;
        b->m.offset = offset;
    }
    return (int)b->index < m->buffers ? 0 : -EINVAL;
}

static int cam_dequeue(v4l2_model *m, struct v4l2_buffer *b) {
    if (m->ready == 0) {
        return -EAGAIN;
    }
    const int index = m->done[0];
    memmove(m->done, m->done + 1, sizeof m->done - sizeof *m->done);
    m->ready--;
    struct v4l2_buffer filled = m->filled[index];
    if (m->multiplanar) {
        b->m.planes[0].bytesused = filled.bytesused;
        filled.m.planes = b->m.planes;
    }
    filled.type = b->type;
    *b = filled;
    return 0;
}

static int cam_ioctl(void *state, int handle, unsigned long request, void *argument, size_t size) {
    (void)handle;
    (void)size;
    v4l2_model *m = state;
    if (!m->plugged) {
        return -ENODEV;
    }
    switch ((uint32_t)request) {
    case (uint32_t)VIDIOC_QUERYCAP: {
        struct v4l2_capability *c = argument;
        strcpy((char *)c->card, m->card);
        strcpy((char *)c->bus_info, "model:1");
        c->capabilities =
            V4L2_CAP_STREAMING | (m->multiplanar ? V4L2_CAP_VIDEO_CAPTURE_MPLANE : V4L2_CAP_VIDEO_CAPTURE);
        return 0;
    }
    case (uint32_t)VIDIOC_ENUM_FMT: {
        struct v4l2_fmtdesc *f = argument;
        const uint32_t formats[] = {V4L2_PIX_FMT_MJPEG, V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_Y16};
        f->pixelformat = formats[f->index % 3];
        return f->index < (m->mjpeg_only ? 1u : 3u) ? 0 : -EINVAL;
    }
    case (uint32_t)VIDIOC_G_FMT:
    case (uint32_t)VIDIOC_S_FMT:
        return cam_format(m, argument);
    case (uint32_t)VIDIOC_QUERY_EXT_CTRL:
        return cam_query_control(m, argument);
    case (uint32_t)VIDIOC_G_CTRL:
    case (uint32_t)VIDIOC_S_CTRL:
        return cam_plain_control(m, (uint32_t)request == (uint32_t)VIDIOC_S_CTRL, argument);
    case (uint32_t)VIDIOC_G_EXT_CTRLS:
    case (uint32_t)VIDIOC_S_EXT_CTRLS:
        return cam_extended_control(m, (uint32_t)request == (uint32_t)VIDIOC_S_EXT_CTRLS, argument);
    case (uint32_t)VIDIOC_G_PARM:
        return m->has_intervals ? cam_interval(m, argument) : -ENOTTY;
    case (uint32_t)VIDIOC_S_PARM:
        return m->has_intervals ? cam_set_interval(m, argument) : -ENOTTY;
    case (uint32_t)VIDIOC_ENUM_FRAMEINTERVALS:
        return m->has_intervals ? cam_offered_interval(argument) : -ENOTTY;
    case (uint32_t)VIDIOC_REQBUFS: {
        struct v4l2_requestbuffers *r = argument;
        r->count = r->count > CAM_BUFFERS ? CAM_BUFFERS : r->count;
        m->buffers = (int)r->count;
        return 0;
    }
    case (uint32_t)VIDIOC_QUERYBUF:
        return cam_query_buffer(m, argument);
    case (uint32_t)VIDIOC_QBUF:
        m->queue[m->queued++] = (int)((struct v4l2_buffer *)argument)->index;
        return 0;
    case (uint32_t)VIDIOC_DQBUF:
        return cam_dequeue(m, argument);
    case (uint32_t)VIDIOC_STREAMON:
        m->stream_ons++;
        m->streaming = true;
        m->next_end_ns = m->now_ns + m->period_ns;
        for (int i = 0; i < 64; i++) {
            m->history[i] = m->exposure;
        }
        return 0;
    case (uint32_t)VIDIOC_STREAMOFF:
        m->streaming = false;
        m->queued = m->ready = 0;
        return 0;
    default:
        return -ENOTTY;
    }
}

static int cam_map(void *state, int handle, size_t length, int64_t offset, void **memory) {
    (void)handle;
    (void)length;
    *memory = ((v4l2_model *)state)->memory[offset / 4096];
    return 0;
}

static void cam_unmap(void *state, void *memory, size_t length) {
    (void)state;
    (void)memory;
    (void)length;
}

static int cam_wait(void *state, int handle, int timeout_ms) {
    (void)handle;
    v4l2_model *m = state;
    const int64_t end = m->now_ns + (int64_t)timeout_ms * 1000000;
    while (m->plugged && m->ready == 0 && m->now_ns < end) {
        const int64_t next = m->streaming ? m->next_end_ns : end;
        cam_pass(m, next < end ? next : end);
    }
    return !m->plugged ? -ENODEV : m->ready > 0;
}

static int64_t cam_now(void *state) { return ((v4l2_model *)state)->now_ns; }

static const gonio_v4l2_io cam_io = {cam_open, cam_close, cam_ioctl, cam_map, cam_unmap, cam_wait, cam_now};

#endif
