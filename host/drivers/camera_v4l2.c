// SPDX-License-Identifier: BSD-3-Clause
// The stream runs all the time. A capture sets what changed, throws away what was exposed before it was asked for (by
// the frames' timestamps, or by count where the driver's clock is another), and takes the first frame after that.
#include "host/drivers/camera_v4l2.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/drivers/camera_controls.h"
#include "host/drivers/camera_latency.h"
#include "host/transport/clock.h"

enum { BAD_FRAMES_MAX = 16, OFFERED_MAX = 64, TRIES = 3 };
#define UNTOLD_INTERVAL_S 0.1 // between frames of a camera that does not tell

typedef struct camera {
    gonio_camera_v4l2_config config;
    const gonio_v4l2_io *io;
    void *state;
    gonio_v4l2 *v4l2; // NULL while unplugged
    const gonio_pixel_format *pixels;
    gonio_v4l2_format format;
    gonio_camera_controls controls;
    gonio_camera_v4l2_counts counts;
    char card[33];
    int64_t exposure_steps, gain_steps; // as set; -1: not yet
    double exposure_s, gain_db;
    double longest_s;               // exposure that a frame may have that comes next: the one before the last change
    double interval_s, interval0_s; // between frames: now, and the driver's own choice; 0: the driver tells none
    bool capped;                    // the longest interval ends the range of exposures
    char warning[80];
    int stale_left; // frames that may have been in the queue already, counted where they carry no usable time
    int to_discard; // frames that may still have older settings
    bool proven;    // no frame comes without a trigger pulse, since the stream began
    bool sequence_known;
    uint32_t sequence; // of the last frame
    int64_t time_ns;   // its stamp
    double step_s;     // from the stamp before it
} camera;

void gonio_camera_v4l2_defaults(gonio_camera_v4l2_config *config) {
    *config = (gonio_camera_v4l2_config){
        .path = "/dev/video0", .settle_frames = 3, .buffers = 4, .replug_s = 10, .exposure_tolerance = 0.2};
}

static gonio_status choose_format(camera *c, gonio_error *error) {
    uint32_t offered[OFFERED_MAX];
    int n = 0;
    while (n < OFFERED_MAX && gonio_v4l2_offered(c->v4l2, n, &offered[n], NULL) == GONIO_OK) {
        n++;
    }
    if (c->config.format[0] == 0) {
        c->pixels = gonio_pixel_format_choose(offered, (size_t)n);
        return c->pixels != NULL ? GONIO_OK
                                 : gonio_fail(error, GONIO_E_UNSUPPORTED,
                                              "camera %s (%s) offers no pixel format that is fit for radiometry; "
                                              "`gonio rig camera` lists them",
                                              c->config.path, gonio_v4l2_card(c->v4l2));
    }
    c->pixels = gonio_pixel_format_named(c->config.format);
    if (c->pixels == NULL) {
        return gonio_fail(error, GONIO_E_INPUT, "unknown pixel format '%s'", c->config.format);
    }
    if (c->pixels->fitness == GONIO_UNFIT) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED, "pixel format %s is refused: %s", c->pixels->name,
                          c->pixels->why);
    }
    return GONIO_OK;
}

// An exposure is no longer than the interval between frames.
static void find_intervals(camera *c) {
    gonio_camera_controls *k = &c->controls;
    c->interval_s = 0;
    c->capped = false;
    if (gonio_v4l2_get_interval(c->v4l2, &c->interval_s, NULL) != GONIO_OK) {
        c->interval_s = 0;
    }
    c->interval0_s = c->interval_s;
    const double longest_s = c->interval_s > 0 ? gonio_camera_interval(c->v4l2, &c->format, INFINITY) : 0;
    if (k->exposure != 0 && longest_s > 0 && longest_s < (double)k->exposure_max * k->exposure_unit_s) {
        const int64_t most = (int64_t)(longest_s / k->exposure_unit_s * (1 + 1e-6));
        k->exposure_max = most > k->exposure_min ? most : k->exposure_min;
        c->capped = true;
    }
}

static gonio_status configure(camera *c, gonio_error *error) {
    gonio_status status = choose_format(c, error);
    if (status != GONIO_OK) {
        return status;
    }
    c->format = (gonio_v4l2_format){.fourcc = c->pixels->fourcc, .width = c->config.width, .height = c->config.height};
    status = gonio_v4l2_set_format(c->v4l2, &c->format, error);
    status = status == GONIO_OK ? gonio_camera_autos_off(c->v4l2, c->warning, sizeof c->warning, error) : status;
    if (status == GONIO_OK) {
        status = gonio_camera_controls_find(c->v4l2, c->config.exposure_unit_s, &c->controls, error);
    }
    if (status == GONIO_OK && c->controls.exposure == 0 && !(c->config.fixed_exposure_s > 0)) {
        status = gonio_fail(error, GONIO_E_UNSUPPORTED,
                            "camera %s (%s) has no exposure control in seconds: give exposure_unit_us (of its own "
                            "control) or fixed_exposure_ms",
                            c->config.path, gonio_v4l2_card(c->v4l2));
    }
    if (status == GONIO_OK) {
        find_intervals(c);
    }
    return status;
}

static gonio_status start(camera *c, gonio_error *error) {
    c->exposure_steps = c->gain_steps = -1;
    c->sequence_known = c->proven = false;
    c->to_discard = c->config.settle_frames;
    return gonio_v4l2_start(c->v4l2, c->config.buffers, error);
}

static gonio_status connect_camera(camera *c, gonio_error *error) {
    gonio_status status = gonio_v4l2_open(c->io, c->state, c->config.path, &c->v4l2, error);
    if (status != GONIO_OK) {
        c->v4l2 = NULL;
        return status;
    }
    if (c->card[0] != 0 && strcmp(c->card, gonio_v4l2_card(c->v4l2)) != 0) {
        status = gonio_fail(error, GONIO_E_DEVICE, "another camera came back at %s: '%s', expected '%s'",
                            c->config.path, gonio_v4l2_card(c->v4l2), c->card);
    }
    if (status == GONIO_OK) {
        snprintf(c->card, sizeof c->card, "%s", gonio_v4l2_card(c->v4l2));
        status = configure(c, error);
    }
    status = status == GONIO_OK ? start(c, error) : status;
    if (status != GONIO_OK) {
        gonio_v4l2_close(c->v4l2);
        c->v4l2 = NULL;
    }
    return status;
}

// Wait, bounded, until the same camera is there again.
static gonio_status reconnect(camera *c, gonio_deadline deadline, gonio_error *error) {
    gonio_v4l2_close(c->v4l2);
    c->v4l2 = NULL;
    c->counts.replugs++;
    gonio_status status;
    while ((status = connect_camera(c, error)) != GONIO_OK && gonio_deadline_left_ms(deadline) > 0) {
        gonio_clock_sleep_ms(gonio_deadline_left_ms(deadline) < 100 ? gonio_deadline_left_ms(deadline) : 100);
    }
    return status;
}

// The driver cuts an exposure to the interval between frames without a word: a longer interval first, for which the
// stream must stand still, and the driver's own again when that is enough.
static gonio_status fit_interval(camera *c, double exposure_s, gonio_error *error) {
    if (!(c->interval0_s > 0)) {
        return GONIO_OK;
    }
    const double least_s = fmax(c->interval0_s, exposure_s),
                 offered_s = gonio_camera_interval(c->v4l2, &c->format, least_s);
    double wanted_s = offered_s > 0 ? offered_s : least_s;
    if (fabs(wanted_s - c->interval_s) > 1e-4 * wanted_s) {
        gonio_v4l2_stop(c->v4l2);
        gonio_status status = gonio_v4l2_set_interval(c->v4l2, &wanted_s, error);
        c->interval_s = wanted_s > 0 ? wanted_s : c->interval_s;
        status = status == GONIO_OK ? start(c, error) : status;
        if (status != GONIO_OK) {
            return status;
        }
    }
    return exposure_s <= c->interval_s * (1 + 1e-4)
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_RANGE,
                            "camera %s: exposure of %g s asked for, but the frame interval of %g s, longer than which "
                            "the driver gives none, caps it",
                            c->config.path, exposure_s, c->interval_s);
}

static gonio_status set_exposure(camera *c, double exposure_s, gonio_error *error) {
    const gonio_camera_controls *k = &c->controls;
    const int64_t steps = k->exposure == 0 ? 0
                                           : gonio_camera_nearest_step(exposure_s / k->exposure_unit_s, k->exposure_min,
                                                                       k->exposure_max, k->exposure_step);
    const double nearest_s = k->exposure == 0 ? c->config.fixed_exposure_s : (double)steps * k->exposure_unit_s;
    if (!(fabs(nearest_s - exposure_s) <= c->config.exposure_tolerance * exposure_s)) {
        return gonio_fail(error, GONIO_E_RANGE, "camera %s: exposure of %g s asked for, the nearest it has is %g s%s",
                          c->config.path, exposure_s, nearest_s,
                          c->capped && nearest_s < exposure_s ? ", which its longest frame interval caps" : "");
    }
    if (k->exposure != 0 && steps != c->exposure_steps) {
        gonio_status status = fit_interval(c, nearest_s, error);
        status = status == GONIO_OK ? gonio_v4l2_set_control(c->v4l2, k->exposure, steps, error) : status;
        if (status != GONIO_OK) {
            return status;
        }
        c->exposure_steps = steps;
        c->to_discard = c->config.settle_frames;
    }
    c->longest_s = fmax(c->longest_s, nearest_s);
    c->exposure_s = nearest_s;
    return GONIO_OK;
}

static gonio_status set_gain(camera *c, double gain_db, gonio_error *error) {
    const gonio_camera_controls *k = &c->controls;
    if (k->gain == 0 || !(c->config.gain_unit_db > 0)) {
        if (gain_db > 0) {
            return gonio_fail(error, GONIO_E_RANGE, "camera %s: gain of %g dB asked for, but %s", c->config.path,
                              gain_db, k->gain == 0 ? "it has no gain control" : "gain_db_per_step is not given");
        }
    }
    c->gain_db = 0;
    if (k->gain == 0) {
        return GONIO_OK;
    }
    int64_t steps = k->gain_min;
    if (c->config.gain_unit_db > 0) {
        steps = gonio_camera_nearest_step((double)k->gain_min + gain_db / c->config.gain_unit_db, k->gain_min,
                                          k->gain_max, k->gain_step);
        c->gain_db = (double)(steps - k->gain_min) * c->config.gain_unit_db;
    }
    if (fabs(c->gain_db - gain_db) > 0.51 * (double)k->gain_step * c->config.gain_unit_db) {
        return gonio_fail(error, GONIO_E_RANGE, "camera %s: gain of %g dB asked for, the nearest it has is %g dB",
                          c->config.path, gain_db, c->gain_db);
    }
    if (steps != c->gain_steps) {
        const gonio_status status = gonio_v4l2_set_control(c->v4l2, k->gain, steps, error);
        if (status != GONIO_OK) {
            return status;
        }
        c->gain_steps = steps;
        c->to_discard = c->config.settle_frames;
    }
    return GONIO_OK;
}

// From the exposure's begin to the stamp, at most. Stamps stand at the exposure's start, at its end (the first packet
// of a UVC camera) or at the end of the read-out, and uvcvideo flags all its frames as the first: the longest way
// counts. A read-out that is not stated takes no longer than the interval between frames.
static double stamp_delay_s(const camera *c, const gonio_v4l2_buffer *buffer) {
    if (c->config.trigger != NULL) { // it begins after its own pulse, before which the queue was emptied
        return buffer->start_of_exposure ? 0 : c->exposure_s;
    }
    const double read_out_s = c->config.info.read_out_s > 0 ? c->config.info.read_out_s
                              : c->interval0_s > 0          ? c->interval0_s
                                                            : c->step_s;
    return fmax(c->longest_s, c->exposure_s) + read_out_s;
}

// Was the frame's exposure begun after `since_ns`? Without a usable time, that is told by count.
static bool exposed_after(camera *c, const gonio_v4l2_buffer *buffer, int64_t since_ns) {
    if (buffer->time_ns < 0) {
        return c->stale_left-- <= 0;
    }
    return buffer->time_ns - (int64_t)(stamp_delay_s(c, buffer) * 1e9) >= since_ns;
}

static void note_sequence(camera *c, const gonio_v4l2_buffer *buffer) {
    const uint32_t missing = buffer->sequence - c->sequence - 1;
    if (c->sequence_known && missing != 0 && missing < UINT32_MAX / 2) {
        c->counts.gaps++;
        c->counts.lost += missing;
    }
    if (c->sequence_known && missing == 0 && buffer->time_ns > c->time_ns && c->time_ns >= 0) {
        c->step_s = (double)(buffer->time_ns - c->time_ns) * 1e-9;
    }
    c->sequence_known = true;
    c->sequence = buffer->sequence;
    c->time_ns = buffer->time_ns;
}

// Whether this frame is the one; what is wrong with it is counted, and in *bad.
static bool accept(camera *c, const gonio_v4l2_buffer *buffer, int64_t since_ns, int *bad) {
    note_sequence(c, buffer);
    if (buffer->damaged) {
        c->counts.damaged++;
        (*bad)++;
        return false;
    }
    if (buffer->n <
        c->format.stride * (size_t)(c->format.height - 1) + gonio_pixel_row_bytes(c->pixels, c->format.width)) {
        c->counts.short_frames++;
        (*bad)++;
        return false;
    }
    // Only frames begun after the change count as settling; older ones may still wait in the queue.
    if (!exposed_after(c, buffer, since_ns)) {
        c->counts.discarded++;
        return false;
    }
    if (c->to_discard > 0) {
        c->to_discard--;
        c->counts.discarded++;
        return false;
    }
    c->longest_s = c->exposure_s;
    return true;
}

// Frames of earlier triggers that still wait: thrown away before the next trigger, which would else be spent on them.
static gonio_status drop_waiting(camera *c, gonio_error *error) {
    gonio_status status;
    gonio_v4l2_buffer buffer;
    for (int i = 0; i <= c->config.buffers; i++) {
        status = gonio_v4l2_take(c->v4l2, 0, &buffer, error);
        if (status != GONIO_OK) {
            return status == GONIO_E_TIMEOUT ? GONIO_OK : status;
        }
        note_sequence(c, &buffer);
        c->counts.discarded++;
        status = gonio_v4l2_give(c->v4l2, buffer.index, error);
        if (status != GONIO_OK) {
            return status;
        }
    }
    return GONIO_OK;
}

// Once a stream: a camera whose trigger is off gives frames without a pulse, and nobody knows of which moment. A single
// one may be somebody else's pulse.
static gonio_status prove_trigger(camera *c, gonio_error *error) {
    gonio_v4l2_buffer buffer;
    const double interval_s = c->interval_s > 0 ? c->interval_s : UNTOLD_INTERVAL_S;
    for (int frames = 0; frames < 2 && !c->proven; frames++) {
        gonio_status status = gonio_v4l2_take(c->v4l2, (int)ceil(2e3 * interval_s), &buffer, error);
        c->proven = status == GONIO_E_TIMEOUT;
        if (status == GONIO_OK) {
            note_sequence(c, &buffer);
            status = gonio_v4l2_give(c->v4l2, buffer.index, error);
        }
        if (status != GONIO_OK && !c->proven) {
            return status;
        }
    }
    if (c->proven) {
        return GONIO_OK;
    }
    return gonio_fail(error, GONIO_E_UNSUPPORTED,
                      "camera %s gives frames without a trigger pulse: switch its external trigger on, or leave "
                      "trigger_line out",
                      c->config.path);
}

static gonio_status wait_frame(camera *c, int64_t since_ns, gonio_deadline deadline, gonio_v4l2_buffer *buffer,
                               gonio_error *error) {
    int bad = 0;
    for (;;) {
        gonio_status status =
            c->config.trigger != NULL ? c->config.trigger(c->config.trigger_context, error) : GONIO_OK;
        if (status != GONIO_OK) {
            return status;
        }
        status = gonio_v4l2_take(c->v4l2, gonio_deadline_left_ms(deadline), buffer, error);
        if (status != GONIO_OK) {
            c->counts.timeouts += status == GONIO_E_TIMEOUT;
            return status;
        }
        if (accept(c, buffer, since_ns, &bad)) {
            return GONIO_OK;
        }
        const gonio_status given = gonio_v4l2_give(c->v4l2, buffer->index, error);
        if (given != GONIO_OK) {
            return given;
        }
        if (bad >= BAD_FRAMES_MAX) {
            return gonio_fail(error, GONIO_E_DEVICE, "camera %s: %d damaged or short frames in a row", c->config.path,
                              bad);
        }
    }
}

static gonio_status unpack_and_give(camera *c, const gonio_v4l2_buffer *buffer, const gonio_window *window,
                                    uint16_t *pixels, gonio_error *error) {
    const gonio_status status =
        gonio_pixels_unpack(c->pixels, buffer->bytes, buffer->n, c->format.stride, c->format.width, c->format.height,
                            window, c->config.shift, pixels, error);
    const gonio_status given = gonio_v4l2_give(c->v4l2, buffer->index, error);
    return status != GONIO_OK ? status : given;
}

static gonio_status attempt(camera *c, const gonio_window *window, double exposure_s, double gain_db,
                            gonio_deadline deadline, uint16_t *pixels, gonio_error *error) {
    gonio_status status = set_exposure(c, exposure_s, error);
    status = status == GONIO_OK ? set_gain(c, gain_db, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    c->stale_left = c->config.buffers + 2; // the queue's, the one that is read out, and the one that is exposed
    if (c->config.trigger != NULL) {
        status = drop_waiting(c, error);
        status = status == GONIO_OK ? prove_trigger(c, error) : status;
        if (status != GONIO_OK) {
            return status;
        }
        c->stale_left = 0;
    }
    gonio_v4l2_buffer buffer;
    status = wait_frame(c, gonio_v4l2_now_ns(c->v4l2), deadline, &buffer, error);
    if (status != GONIO_OK) {
        return status;
    }
    return unpack_and_give(c, &buffer, window, pixels, error);
}

// A frame that does not come is asked for by a restarted stream, a camera that is gone by opening it again.
static gonio_status recover(camera *c, gonio_error *error) {
    if (c->v4l2 == NULL || gonio_v4l2_gone(c->v4l2)) {
        return reconnect(c, gonio_deadline_in_s(c->config.replug_s), error);
    }
    c->counts.restarts++;
    gonio_v4l2_stop(c->v4l2);
    return start(c, error);
}

static gonio_status camera_capture(void *device, const gonio_window *window, double exposure_s, double gain_db,
                                   const gonio_stamp *stamp, double timeout_s, gonio_frame *frame, gonio_error *error) {
    camera *c = device;
    const gonio_deadline end = gonio_deadline_in_s(timeout_s);
    gonio_status status = GONIO_E_DEVICE;
    for (int tries = 0; tries < TRIES; tries++) {
        // A stream that has stopped must leave time for the next try.
        const int left_ms = gonio_deadline_left_ms(end) / (tries + 1 < TRIES ? 2 : 1);
        if (c->v4l2 == NULL || tries > 0) {
            status = recover(c, error);
            if (status != GONIO_OK) {
                return status;
            }
        }
        status = attempt(c, window, exposure_s, gain_db, gonio_deadline_in_ms(left_ms), frame->pixels, error);
        if (status == GONIO_OK) {
            c->counts.captured++;
            frame->window = *window;
            frame->exposure_s = c->exposure_s;
            frame->gain_db = c->gain_db;
            frame->stamp = *stamp;
            return GONIO_OK;
        }
        if (status != GONIO_E_TIMEOUT && status != GONIO_E_DEVICE) {
            return status;
        }
    }
    return status;
}

static gonio_status camera_info(void *device, gonio_camera_info *info, gonio_error *error) {
    (void)error;
    const camera *c = device;
    *info = c->config.info;
    if (info->name[0] == 0) {
        snprintf(info->name, sizeof info->name, "%s", c->card);
    }
    info->width = c->format.width;
    info->height = c->format.height;
    info->bits = c->config.bits > 0 ? c->config.bits : c->pixels->bits - c->config.shift;
    info->pattern = c->pixels->pattern;
    const gonio_camera_controls *k = &c->controls;
    info->exposure_min_s = k->exposure != 0 ? (double)k->exposure_min * k->exposure_unit_s : c->config.fixed_exposure_s;
    info->exposure_max_s = k->exposure != 0 ? (double)k->exposure_max * k->exposure_unit_s : c->config.fixed_exposure_s;
    return GONIO_OK;
}

static void camera_close(void *device) {
    camera *c = device;
    gonio_v4l2_close(c->v4l2);
    free(c);
}

static gonio_status camera_stream(void *device, double exposure_s, double gain_db, double timeout_s,
                                  gonio_error *error) {
    camera *c = device;
    const gonio_deadline deadline = gonio_deadline_in_s(timeout_s);
    gonio_status status = c->v4l2 == NULL ? recover(c, error) : GONIO_OK;
    status = status == GONIO_OK ? set_exposure(c, exposure_s, error) : status;
    status = status == GONIO_OK ? set_gain(c, gain_db, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    c->stale_left = c->config.buffers + 2;
    gonio_v4l2_buffer buffer;
    status = wait_frame(c, gonio_v4l2_now_ns(c->v4l2), deadline, &buffer, error);
    return status == GONIO_OK ? gonio_v4l2_give(c->v4l2, buffer.index, error) : status;
}

static gonio_status camera_next(void *device, const gonio_window *window, double timeout_s, gonio_frame *frame,
                                int64_t *lost, gonio_error *error) {
    camera *c = device;
    const gonio_deadline deadline = gonio_deadline_in_s(timeout_s);
    const int64_t lost_before = c->counts.lost, bad_before = c->counts.damaged + c->counts.short_frames;
    gonio_v4l2_buffer buffer;
    gonio_status status = wait_frame(c, INT64_MIN, deadline, &buffer, error);
    *lost = c->counts.lost - lost_before + c->counts.damaged + c->counts.short_frames - bad_before;
    if (status != GONIO_OK) {
        return status;
    }
    frame->window = *window;
    frame->exposure_s = c->exposure_s;
    frame->gain_db = c->gain_db;
    frame->stamp.clock_s = (double)buffer.time_ns * 1e-9;
    return unpack_and_give(c, &buffer, window, frame->pixels, error);
}

static gonio_status expose(void *device, double exposure_s, gonio_error *error) {
    return set_exposure(device, exposure_s, error);
}

static gonio_status any_frame(void *device, uint16_t *pixels, gonio_error *error) {
    camera *c = device;
    const gonio_window all = {0, 0, c->format.width, c->format.height};
    c->to_discard = 0;
    gonio_v4l2_buffer buffer;
    const gonio_status status = wait_frame(c, INT64_MIN, gonio_deadline_in_s(2 + 2 * c->exposure_s), &buffer, error);
    return status == GONIO_OK ? unpack_and_give(c, &buffer, &all, pixels, error) : status;
}

static gonio_status camera_latency(void *device, double low_s, double high_s, int *frames, gonio_error *error) {
    camera *c = device;
    const gonio_latency_camera own = {c, (size_t)c->format.width * (size_t)c->format.height, expose, any_frame};
    return gonio_camera_latency(&own, low_s, high_s, frames, error);
}

const gonio_camera_ops gonio_camera_v4l2 = {.name = "v4l2",
                                            .info = camera_info,
                                            .capture = camera_capture,
                                            .close = camera_close,
                                            .stream = camera_stream,
                                            .next = camera_next,
                                            .latency = camera_latency};

gonio_status gonio_camera_v4l2_open(const gonio_camera_v4l2_config *config, const gonio_v4l2_io *io, void *state,
                                    void **device, gonio_error *error) {
    camera *c = calloc(1, sizeof *c);
    if (c == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a camera");
    }
    c->config = *config;
    c->io = io;
    c->state = state;
    const gonio_status status = connect_camera(c, error);
    if (status != GONIO_OK) {
        free(c);
        return status;
    }
    *device = c;
    return GONIO_OK;
}

const gonio_camera_v4l2_counts *gonio_camera_v4l2_count(const void *device) {
    return &((const camera *)device)->counts;
}

const gonio_pixel_format *gonio_camera_v4l2_format(const void *device) { return ((const camera *)device)->pixels; }
const char *gonio_camera_v4l2_warning(const void *device) { return ((const camera *)device)->warning; }
