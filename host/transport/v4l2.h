// SPDX-License-Identifier: BSD-3-Clause
// V4L2 capture: formats, controls and memory-mapped streaming, single- and multi-planar; bytes out, no pixels.
//
// Source: the Linux media subsystem's userspace API, Video for Linux part. All system calls go through a table, so
// that a tape (record, replay) or a test can stand in for the kernel.
#ifndef GONIO_TRANSPORT_V4L2_H
#define GONIO_TRANSPORT_V4L2_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "gonio/status.h"
#include "host/transport/tape.h"

// The system calls in use; each returns a negative errno where it fails.
typedef struct gonio_v4l2_io {
    int (*open)(void *state, const char *path); // a handle
    void (*close)(void *state, int handle);
    int (*ioctl)(void *state, int handle, unsigned long request, void *argument, size_t size);
    int (*map)(void *state, int handle, size_t length, int64_t offset, void **memory);
    void (*unmap)(void *state, void *memory, size_t length);
    int (*wait)(void *state, int handle, int timeout_ms); // 1: a buffer or a fault is ready, 0: timeout
    int64_t (*now_ns)(void *state);                       // CLOCK_MONOTONIC
} gonio_v4l2_io;

extern const gonio_v4l2_io gonio_v4l2_system; // state: not used
// Pass every call on to another table and write it down; state: a gonio_v4l2_recorder.
typedef struct gonio_v4l2_recorder gonio_v4l2_recorder;
extern const gonio_v4l2_io gonio_v4l2_recording;
// Borrows all three; inner is not used for a replay.
gonio_status gonio_v4l2_recorder_new(gonio_tape *tape, const gonio_v4l2_io *inner, void *inner_state,
                                     gonio_v4l2_recorder **out, gonio_error *error);
void gonio_v4l2_recorder_free(gonio_v4l2_recorder *recorder); // after every device on it is closed
// Answer every call from a tape; state: a gonio_v4l2_recorder. A call that is not on the tape gives -EPROTO.
extern const gonio_v4l2_io gonio_v4l2_replaying;

typedef struct gonio_v4l2 gonio_v4l2;

typedef struct gonio_v4l2_format {
    uint32_t fourcc;
    int width, height;
    size_t stride, size; // bytes a row, bytes a frame
} gonio_v4l2_format;

typedef struct gonio_v4l2_control {
    uint32_t id, type, flags;
    char name[32];
    int64_t minimum, maximum, step, fallback;
} gonio_v4l2_control;

// A frame in the driver's memory: valid until it is given back by its index.
typedef struct gonio_v4l2_buffer {
    int index;
    const uint8_t *bytes;
    size_t n;
    uint32_t sequence;
    int64_t time_ns;        // CLOCK_MONOTONIC; -1 where the driver's clock is another
    bool start_of_exposure; // the driver says that time_ns is the exposure's start, which uvcvideo says of every frame
    bool damaged;           // the driver says that the content is
} gonio_v4l2_buffer;

// GONIO_E_DEVICE where it is no streaming capture device. io and state must outlive the device.
gonio_status gonio_v4l2_open(const gonio_v4l2_io *io, void *state, const char *path, gonio_v4l2 **out,
                             gonio_error *error);
void gonio_v4l2_close(gonio_v4l2 *device);             // NULL is allowed
const char *gonio_v4l2_card(const gonio_v4l2 *device); // lives as long as the device
const char *gonio_v4l2_bus(const gonio_v4l2 *device);
bool gonio_v4l2_multiplanar(const gonio_v4l2 *device);
bool gonio_v4l2_gone(const gonio_v4l2 *device); // unplugged: only close helps
int64_t gonio_v4l2_now_ns(const gonio_v4l2 *device);

// The index-th offered format's FourCC; GONIO_E_RANGE past the last.
gonio_status gonio_v4l2_offered(gonio_v4l2 *device, int index, uint32_t *fourcc, gonio_error *error);
// The index-th discrete frame size of a format, or the largest of a range at index 0; GONIO_E_RANGE past the last.
gonio_status gonio_v4l2_offered_size(gonio_v4l2 *device, uint32_t fourcc, int index, int *width, int *height,
                                     gonio_error *error);
// Ask for a format; `format` comes back as the driver took it. Another FourCC or size than asked is GONIO_E_DEVICE;
// width 0 takes the driver's present size. Not while streaming.
gonio_status gonio_v4l2_set_format(gonio_v4l2 *device, gonio_v4l2_format *format, gonio_error *error);

// The control, or with next the first one after that id; GONIO_E_UNSUPPORTED where there is none.
gonio_status gonio_v4l2_find_control(gonio_v4l2 *device, uint32_t id, bool next, gonio_v4l2_control *control,
                                     gonio_error *error);
// Controls of 32 and of 64 bits.
gonio_status gonio_v4l2_get_control(gonio_v4l2 *device, uint32_t id, int64_t *value, gonio_error *error);
// Set and read back; GONIO_E_DEVICE where the device took another value.
gonio_status gonio_v4l2_set_control(gonio_v4l2 *device, uint32_t id, int64_t value, gonio_error *error);

// Intervals between frames, in seconds. A range has a step, a single interval has shortest = longest.
typedef struct gonio_v4l2_interval {
    double shortest_s, longest_s, step_s;
} gonio_v4l2_interval;
// The index-th that the driver offers for a format; GONIO_E_RANGE past the last.
gonio_status gonio_v4l2_offered_interval(gonio_v4l2 *device, const gonio_v4l2_format *format, int index,
                                         gonio_v4l2_interval *interval, gonio_error *error);
// GONIO_E_UNSUPPORTED where the driver has no interval that can be set.
gonio_status gonio_v4l2_get_interval(gonio_v4l2 *device, double *interval_s, gonio_error *error);
// *interval_s comes back as the driver took it. Not while streaming.
gonio_status gonio_v4l2_set_interval(gonio_v4l2 *device, double *interval_s, gonio_error *error);

gonio_status gonio_v4l2_start(gonio_v4l2 *device, int buffers, gonio_error *error);
void gonio_v4l2_stop(gonio_v4l2 *device); // gives every buffer back; harmless where it does not stream
// The next filled buffer. GONIO_E_TIMEOUT after timeout_ms; GONIO_E_DEVICE where the device failed or is gone.
gonio_status gonio_v4l2_take(gonio_v4l2 *device, int timeout_ms, gonio_v4l2_buffer *buffer, gonio_error *error);
gonio_status gonio_v4l2_give(gonio_v4l2 *device, int index, gonio_error *error);

#endif
