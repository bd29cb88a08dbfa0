// SPDX-License-Identifier: BSD-3-Clause
// The three tables of system calls: the kernel, the kernel written down, and the tape.
#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include "base/clock.h"
#include "host/transport/v4l2.h"

enum { BUFFERS_MAX = 16 };

// ---- the kernel ----

static int system_open(void *state, const char *path) {
    (void)state;
    const int handle = open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC);
    return handle < 0 ? -errno : handle;
}

static void system_close(void *state, int handle) {
    (void)state;
    close(handle);
}

static int system_ioctl(void *state, int handle, unsigned long request, void *argument, size_t size) {
    (void)state;
    (void)size;
    int result;
    do {
        result = ioctl(handle, request, argument);
    } while (result < 0 && errno == EINTR);
    return result < 0 ? -errno : 0;
}

static int system_map(void *state, int handle, size_t length, int64_t offset, void **memory) {
    (void)state;
    *memory = mmap(NULL, length, PROT_READ | PROT_WRITE, MAP_SHARED, handle, (off_t)offset);
    return *memory == MAP_FAILED ? -errno : 0;
}

static void system_unmap(void *state, void *memory, size_t length) {
    (void)state;
    munmap(memory, length);
}

static int system_wait(void *state, int handle, int timeout_ms) {
    (void)state;
    struct pollfd waiting = {.fd = handle, .events = POLLIN};
    const int n = poll(&waiting, 1, timeout_ms);
    if (n <= 0) {
        return n < 0 && errno != EINTR ? -errno : 0;
    }
    return waiting.revents & (POLLHUP | POLLNVAL) ? -ENODEV : 1; // POLLERR: DQBUF tells why
}

static int64_t system_now(void *state) {
    (void)state;
    return gonio_clock_ns();
}

const gonio_v4l2_io gonio_v4l2_system = {system_open,  system_close, system_ioctl, system_map,
                                         system_unmap, system_wait,  system_now};

// ---- record and replay ----

struct gonio_v4l2_recorder {
    gonio_tape *tape;
    const gonio_v4l2_io *inner; // what a recorder passes calls on to
    void *inner_state;
    struct {
        int64_t offset;
        void *memory;
        size_t length;
    } maps[BUFFERS_MAX];
};

gonio_status gonio_v4l2_recorder_new(gonio_tape *tape, const gonio_v4l2_io *inner, void *inner_state,
                                     gonio_v4l2_recorder **out, gonio_error *error) {
    *out = calloc(1, sizeof **out);
    if (*out == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a recorder");
    }
    (*out)->tape = tape;
    (*out)->inner = inner;
    (*out)->inner_state = inner_state;
    return GONIO_OK;
}

void gonio_v4l2_recorder_free(gonio_v4l2_recorder *recorder) { free(recorder); }

// An ioctl's argument as it goes on the tape: the request's number, the argument without the address in it, and what
// the address leads to: a plane, or a control.
typedef struct packed {
    uint32_t request;
    uint8_t bytes[512];
    size_t n;
    void *beyond;
    size_t beyond_n;
} packed;

static bool is_buffer(uint32_t request) {
    return request == (uint32_t)VIDIOC_QUERYBUF || request == (uint32_t)VIDIOC_QBUF ||
           request == (uint32_t)VIDIOC_DQBUF;
}

static bool is_control(uint32_t request) {
    return request == (uint32_t)VIDIOC_G_EXT_CTRLS || request == (uint32_t)VIDIOC_S_EXT_CTRLS;
}

static bool pack(packed *p, unsigned long request, const void *argument, size_t size) {
    *p = (packed){.request = (uint32_t)request};
    if (size + sizeof(struct v4l2_plane) > sizeof p->bytes) {
        return false;
    }
    memcpy(p->bytes, argument, size);
    p->n = size;
    if (is_buffer(p->request)) {
        struct v4l2_buffer buffer;
        memcpy(&buffer, argument, sizeof buffer);
        if (buffer.type == V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE) {
            p->beyond = buffer.m.planes;
            p->beyond_n = sizeof *buffer.m.planes;
            buffer.m.planes = NULL;
            memcpy(p->bytes, &buffer, sizeof buffer);
        }
    } else if (is_control(p->request)) {
        struct v4l2_ext_controls controls;
        memcpy(&controls, argument, sizeof controls);
        p->beyond = controls.controls;
        p->beyond_n = sizeof *controls.controls;
        controls.controls = NULL;
        memcpy(p->bytes, &controls, sizeof controls);
    }
    if (p->beyond != NULL) {
        memcpy(p->bytes + size, p->beyond, p->beyond_n);
        p->n += p->beyond_n;
    }
    return true;
}

static void unpack(const packed *p, void *argument, size_t size) {
    memcpy(argument, p->bytes, size);
    if (p->beyond != NULL && is_buffer(p->request)) {
        ((struct v4l2_buffer *)argument)->m.planes = p->beyond;
    } else if (p->beyond != NULL) {
        ((struct v4l2_ext_controls *)argument)->controls = p->beyond;
    }
    if (p->beyond != NULL) {
        memcpy(p->beyond, p->bytes + size, p->beyond_n);
    }
}

// Where the frame of a dequeued buffer lies; its used length.
static size_t frame_of(const gonio_v4l2_recorder *recorder, const packed *p, void **memory) {
    struct v4l2_buffer buffer;
    memcpy(&buffer, p->bytes, sizeof buffer);
    struct v4l2_plane plane = {0};
    if (p->beyond != NULL) {
        memcpy(&plane, p->bytes + sizeof buffer, sizeof plane);
    }
    const size_t used = p->beyond != NULL ? plane.bytesused : buffer.bytesused;
    if (buffer.index >= BUFFERS_MAX || recorder->maps[buffer.index].memory == NULL) {
        return 0;
    }
    *memory = recorder->maps[buffer.index].memory;
    return used < recorder->maps[buffer.index].length ? used : recorder->maps[buffer.index].length;
}

static void note_map(gonio_v4l2_recorder *recorder, int64_t offset, void *memory, size_t length) {
    for (int i = 0; i < BUFFERS_MAX; i++) {
        if (recorder->maps[i].memory == NULL) {
            recorder->maps[i].offset = offset;
            recorder->maps[i].memory = memory;
            recorder->maps[i].length = length;
            return;
        }
    }
}

static void forget_map(gonio_v4l2_recorder *recorder, const void *memory) {
    for (int i = 0; i < BUFFERS_MAX; i++) {
        if (recorder->maps[i].memory == memory) {
            recorder->maps[i].memory = NULL;
        }
    }
}

static int recording_open(void *state, const char *path) {
    gonio_v4l2_recorder *recorder = state;
    const int result = recorder->inner->open(recorder->inner_state, path);
    gonio_tape_put(recorder->tape, "v4l2-open", path, strlen(path), result < 0 ? result : 0, NULL, 0);
    return result;
}

static int recording_ioctl(void *state, int handle, unsigned long request, void *argument, size_t size) {
    gonio_v4l2_recorder *recorder = state;
    packed before, after;
    const bool fits = pack(&before, request, argument, size);
    const int result = recorder->inner->ioctl(recorder->inner_state, handle, request, argument, size);
    if (!fits || !pack(&after, request, argument, size)) {
        return result;
    }
    uint8_t asked[sizeof before.bytes + sizeof before.request];
    memcpy(asked, &before.request, sizeof before.request);
    memcpy(asked + sizeof before.request, before.bytes, before.n);
    gonio_tape_put(recorder->tape, "v4l2-ioctl", asked, sizeof before.request + before.n, result, after.bytes, after.n);
    if (result == 0 && before.request == (uint32_t)VIDIOC_DQBUF) {
        void *memory = NULL;
        const size_t n = frame_of(recorder, &after, &memory);
        gonio_tape_put(recorder->tape, "v4l2-frame", NULL, 0, (long long)n, memory, n);
    }
    return result;
}

static int recording_map(void *state, int handle, size_t length, int64_t offset, void **memory) {
    gonio_v4l2_recorder *recorder = state;
    const int result = recorder->inner->map(recorder->inner_state, handle, length, offset, memory);
    if (result == 0) {
        note_map(recorder, offset, *memory, length);
    }
    return result;
}

static void recording_unmap(void *state, void *memory, size_t length) {
    gonio_v4l2_recorder *recorder = state;
    forget_map(recorder, memory);
    recorder->inner->unmap(recorder->inner_state, memory, length);
}

static int recording_wait(void *state, int handle, int timeout_ms) {
    gonio_v4l2_recorder *recorder = state;
    const int result = recorder->inner->wait(recorder->inner_state, handle, timeout_ms);
    gonio_tape_put(recorder->tape, "v4l2-wait", NULL, 0, result, NULL, 0);
    return result;
}

static int64_t recording_now(void *state) {
    gonio_v4l2_recorder *recorder = state;
    const int64_t now = recorder->inner->now_ns(recorder->inner_state);
    gonio_tape_put(recorder->tape, "v4l2-clock", NULL, 0, now, NULL, 0);
    return now;
}

static void recording_close(void *state, int handle) {
    gonio_v4l2_recorder *recorder = state;
    recorder->inner->close(recorder->inner_state, handle);
}

const gonio_v4l2_io gonio_v4l2_recording = {recording_open,  recording_close, recording_ioctl, recording_map,
                                            recording_unmap, recording_wait,  recording_now};

// The result of the next exchange; -EPROTO where the tape says something else.
static int64_t played(gonio_v4l2_recorder *recorder, const char *kind, const void *request, size_t n, void *reply,
                      size_t size, size_t *m) {
    long long result = 0;
    return gonio_tape_get(recorder->tape, kind, request, n, &result, reply, size, m, NULL) == GONIO_OK ? result
                                                                                                       : -EPROTO;
}

static int replaying_open(void *state, const char *path) {
    size_t m;
    return (int)played(state, "v4l2-open", path, strlen(path), NULL, 0, &m);
}

static void replaying_close(void *state, int handle) {
    (void)state;
    (void)handle;
}

static int replaying_ioctl(void *state, int handle, unsigned long request, void *argument, size_t size) {
    (void)handle;
    gonio_v4l2_recorder *recorder = state;
    packed p;
    if (!pack(&p, request, argument, size)) {
        return -EPROTO;
    }
    uint8_t asked[sizeof p.bytes + sizeof p.request];
    memcpy(asked, &p.request, sizeof p.request);
    memcpy(asked + sizeof p.request, p.bytes, p.n);
    size_t m = 0;
    const int result = (int)played(recorder, "v4l2-ioctl", asked, sizeof p.request + p.n, p.bytes, sizeof p.bytes, &m);
    if (m != p.n) {
        return -EPROTO;
    }
    unpack(&p, argument, size);
    if (result == 0 && p.request == (uint32_t)VIDIOC_DQBUF) {
        void *memory = NULL;
        const size_t n = frame_of(recorder, &p, &memory);
        if (played(recorder, "v4l2-frame", NULL, 0, memory, n, &m) < 0) {
            return -EPROTO;
        }
    }
    return result;
}

static int replaying_map(void *state, int handle, size_t length, int64_t offset, void **memory) {
    (void)handle;
    *memory = calloc(1, length > 0 ? length : 1);
    if (*memory == NULL) {
        return -ENOMEM;
    }
    note_map(state, offset, *memory, length);
    return 0;
}

static void replaying_unmap(void *state, void *memory, size_t length) {
    (void)length;
    forget_map(state, memory);
    free(memory);
}

static int replaying_wait(void *state, int handle, int timeout_ms) {
    (void)handle;
    (void)timeout_ms;
    size_t m;
    return (int)played(state, "v4l2-wait", NULL, 0, NULL, 0, &m);
}

static int64_t replaying_now(void *state) {
    size_t m;
    return played(state, "v4l2-clock", NULL, 0, NULL, 0, &m);
}

const gonio_v4l2_io gonio_v4l2_replaying = {replaying_open,  replaying_close, replaying_ioctl, replaying_map,
                                            replaying_unmap, replaying_wait,  replaying_now};
