// SPDX-License-Identifier: BSD-3-Clause
// GenICam's names are those of the Standard Features Naming Convention (EMVA). Aravis' objects are released here and
// nowhere else; GLib's errors become Gonio's at once.
#include "host/drivers/camera_aravis.h"

#include <arv.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/drivers/camera_latency.h"
#include "host/drivers/pixels.h"
#include "host/transport/clock.h"

enum { BUFFERS = 4, BAD_FRAMES_MAX = 8 };
#define GIVE_UP_S 2 // over the exposure and the read-out; a frame that takes longer is lost

typedef struct camera {
    gonio_camera_aravis_config config;
    ArvCamera *arv; // NULL: it is gone
    ArvStream *stream;
    const gonio_pixel_format *pixels;
    char card[64], id[128];
    int width, height;
    double exposure_min_s, exposure_max_s;
    double exposure_s, gain_db; // as set; NaN: not yet
    bool free;                  // it runs at its own rate, without the trigger
    guint64 frame_id;           // of the last frame of that; 0: none
} camera;

void gonio_camera_aravis_defaults(gonio_camera_aravis_config *config) {
    *config =
        (gonio_camera_aravis_config){.settle_frames = 1, .replug_s = 10, .exposure_tolerance = 0.2, .info = {.fx = 0}};
}

// Takes GLib's error; GONIO_OK where there is none.
static gonio_status told(const camera *c, GError *why, const char *what, gonio_error *error) {
    if (why == NULL) {
        return GONIO_OK;
    }
    const gonio_status status = gonio_fail(error, GONIO_E_DEVICE, "camera %.60s, %s: %.300s",
                                           c->id[0] != 0 ? c->id : c->config.id, what, why->message);
    g_error_free(why);
    return status;
}

// ---- formats ----

// V4L2's name of a GenICam format whose words Gonio reads: unpacked grey and Bayer.
static const gonio_pixel_format *format_of(const char *name) {
    static const char *const bayer[][2] = {
        {"BayerRG", "SRGGB"}, {"BayerGR", "SGRBG"}, {"BayerGB", "SGBRG"}, {"BayerBG", "SBGGR"}};
    char own[16];
    if (strncmp(name, "Mono", 4) == 0) {
        snprintf(own, sizeof own, "Y%.6s", name + 4);
        return gonio_pixel_format_named(strcmp(name, "Mono8") == 0 ? "GREY" : own);
    }
    for (size_t k = 0; k < 4; k++) {
        if (strncmp(name, bayer[k][0], 7) == 0) {
            snprintf(own, sizeof own, "%s%.6s", bayer[k][1], name + 7);
            return gonio_pixel_format_named(own);
        }
    }
    return NULL;
}

// Mono12p and Mono12Packed are other layouts than V4L2's Y12P: digits alone are a plain format.
static bool plain(const char *name) {
    const size_t head = strncmp(name, "Mono", 4) == 0 ? 4 : 7;
    return strlen(name) > head && strspn(name + head, "0123456789") == strlen(name) - head;
}

// More bits before fewer, grey before Bayer.
static gonio_status choose_format(camera *c, gonio_error *error) {
    GError *why = NULL;
    guint n = 0;
    const char **names = arv_camera_dup_available_pixel_formats_as_strings(c->arv, &n, &why);
    if (why != NULL) {
        return told(c, why, "pixel formats", error);
    }
    const char *best = NULL;
    char list[200] = "";
    for (guint k = 0; k < n; k++) {
        const gonio_pixel_format *f = plain(names[k]) ? format_of(names[k]) : NULL;
        const size_t used = strlen(list);
        snprintf(list + used, sizeof list - used, " %s", names[k]);
        const bool wanted = c->config.format[0] == 0 || strcmp(c->config.format, names[k]) == 0;
        const bool better =
            c->pixels == NULL ||
            (f != NULL && (f->bits > c->pixels->bits || (f->bits == c->pixels->bits && f->pattern == GONIO_MONO)));
        if (f != NULL && wanted && better) {
            c->pixels = f;
            best = names[k];
        }
    }
    gonio_status status = GONIO_OK;
    if (best == NULL) {
        status = gonio_fail(error, GONIO_E_DEVICE, "camera %.60s: no linear, unpacked format%s%s; it offers%s", c->id,
                            c->config.format[0] != 0 ? " " : "", c->config.format, list);
    } else {
        arv_camera_set_pixel_format_from_string(c->arv, best, &why);
        status = told(c, why, best, error);
    }
    g_free(names);
    return status;
}

// ---- set-up ----

// A function of the camera's own that must stay off.
static gonio_status switch_off(const camera *c, const char *name, const char *off, gonio_error *error) {
    GError *why = NULL;
    if (!arv_camera_is_feature_available(c->arv, name, NULL)) {
        return GONIO_OK;
    }
    ArvDevice *device = arv_camera_get_device(c->arv);
    bool is_off;
    if (off == NULL) {
        arv_device_set_boolean_feature_value(device, name, FALSE, &why);
        g_clear_error(&why); // what counts is what it then says
        is_off = !arv_device_get_boolean_feature_value(device, name, &why);
    } else {
        arv_device_set_string_feature_value(device, name, off, &why);
        g_clear_error(&why);
        const char *now = arv_device_get_string_feature_value(device, name, &why);
        is_off = now != NULL && strcmp(now, off) == 0;
    }
    if (why != NULL) {
        return told(c, why, name, error);
    }
    return is_off ? GONIO_OK
                  : gonio_fail(error, GONIO_E_DEVICE, "camera %.60s: %s stays on, and its frames are then not linear",
                               c->id, name);
}

static gonio_status switch_all_off(const camera *c, gonio_error *error) {
    static const struct {
        const char *name, *off;
    } functions[] = {{"ExposureAuto", "Off"},     {"GainAuto", "Off"},        {"BlackLevelAuto", "Off"},
                     {"BalanceWhiteAuto", "Off"}, {"GammaEnable", NULL},      {"LUTEnable", NULL},
                     {"SharpnessEnable", NULL},   {"SaturationEnable", NULL}, {"ExposureMode", "Timed"}};
    gonio_status status = GONIO_OK;
    for (size_t k = 0; status == GONIO_OK && k < sizeof functions / sizeof *functions; k++) {
        status = switch_off(c, functions[k].name, functions[k].off, error);
    }
    return status;
}

static gonio_status set_region(camera *c, gonio_error *error) {
    GError *why = NULL;
    int low, x, y;
    arv_camera_get_width_bounds(c->arv, &low, &c->width, &why);
    if (why == NULL) {
        arv_camera_get_height_bounds(c->arv, &low, &c->height, &why);
    }
    if (why == NULL) {
        arv_camera_set_region(c->arv, 0, 0, c->width, c->height, &why);
    }
    if (why == NULL) {
        arv_camera_get_region(c->arv, &x, &y, &c->width, &c->height, &why);
    }
    return told(c, why, "read-out region", error);
}

static gonio_status set_trigger(camera *c, gonio_error *error) {
    GError *why = NULL;
    const bool can = arv_camera_is_software_trigger_supported(c->arv, &why);
    if (why == NULL && !can) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED,
                          "camera %.60s has no software trigger, without which nobody knows when a frame was exposed",
                          c->id);
    }
    if (why == NULL) {
        arv_camera_set_acquisition_mode(c->arv, ARV_ACQUISITION_MODE_CONTINUOUS, &why);
    }
    if (why == NULL) {
        arv_camera_set_trigger(c->arv, "Software", &why);
    }
    return told(c, why, "software trigger", error);
}

static void let_go(camera *c) {
    if (c->stream != NULL) {
        arv_camera_stop_acquisition(c->arv, NULL);
        g_object_unref(c->stream);
    }
    if (c->arv != NULL) {
        g_object_unref(c->arv);
    }
    c->stream = NULL;
    c->arv = NULL;
    c->free = false;
}

static gonio_status start_stream(camera *c, gonio_error *error) {
    GError *why = NULL;
    const guint payload = arv_camera_get_payload(c->arv, &why);
    if (why == NULL) {
        c->stream = arv_camera_create_stream(c->arv, NULL, NULL, &why);
    }
    for (int k = 0; why == NULL && k < BUFFERS; k++) {
        arv_stream_push_buffer(c->stream, arv_buffer_new(payload, NULL));
    }
    if (why == NULL) {
        arv_camera_start_acquisition(c->arv, &why);
    }
    return told(c, why, "stream", error);
}

bool gonio_camera_aravis_listed(int number, char id[128]) {
    if (number == 0) {
        arv_update_device_list();
    }
    const bool there = number >= 0 && (guint)number < arv_get_n_devices();
    snprintf(id, 128, "%s", there ? arv_get_device_id((guint)number) : "");
    return there;
}

static gonio_status find(camera *c, gonio_error *error) {
    GError *why = NULL;
    const char *id = c->id[0] != 0 ? c->id : c->config.id;
    arv_update_device_list(); // opened without it (0.8.26), a camera streams to another interface
    if (id[0] == 0) {
        const guint n = arv_get_n_devices();
        if (n != 1) {
            return gonio_fail(error, GONIO_E_DEVICE,
                              "%u GenICam cameras are there; [camera] device names one (`arv-tool-0.8` lists them)", n);
        }
        id = arv_get_device_id(0);
    }
    c->arv = arv_camera_new(id, &why);
    if (c->arv == NULL) {
        snprintf(c->id, sizeof c->id, "%.127s", id);
        return why != NULL ? told(c, why, "opening", error)
                           : gonio_fail(error, GONIO_E_DEVICE, "camera %.60s cannot be opened", id);
    }
    return GONIO_OK;
}

static gonio_status connect_camera(camera *c, gonio_error *error) {
    gonio_status status = find(c, error);
    if (status != GONIO_OK) {
        return status;
    }
    // Aravis' strings live until the next question.
    char serial[64];
    const char *text = arv_camera_get_vendor_name(c->arv, NULL);
    snprintf(c->card, sizeof c->card, "%.30s ", text != NULL ? text : "");
    text = arv_camera_get_model_name(c->arv, NULL);
    snprintf(c->card + strlen(c->card), sizeof c->card - strlen(c->card), "%.30s", text != NULL ? text : "");
    text = arv_camera_get_device_id(c->arv, NULL);
    if (c->id[0] == 0) {
        snprintf(c->id, sizeof c->id, "%.127s", c->config.id[0] != 0 ? c->config.id : text != NULL ? text : "?");
    }
    text = arv_camera_get_device_serial_number(c->arv, NULL);
    snprintf(serial, sizeof serial, "%.63s", text != NULL ? text : "");
    if (c->config.info.serial[0] == 0) {
        memcpy(c->config.info.serial, serial, sizeof serial);
    } else if (serial[0] != 0 && strcmp(serial, c->config.info.serial) != 0) {
        return gonio_fail(error, GONIO_E_DEVICE, "camera %.60s has the serial number %.60s, %.60s was expected", c->id,
                          serial, c->config.info.serial);
    }
    c->pixels = NULL;
    c->exposure_s = c->gain_db = NAN;
    GError *why = NULL;
    double low, high;
    status = choose_format(c, error);
    status = status == GONIO_OK ? set_region(c, error) : status;
    status = status == GONIO_OK ? switch_all_off(c, error) : status;
    status = status == GONIO_OK ? set_trigger(c, error) : status;
    if (status == GONIO_OK) {
        arv_camera_get_exposure_time_bounds(c->arv, &low, &high, &why);
        c->exposure_min_s = low * 1e-6;
        c->exposure_max_s = high * 1e-6;
        status = told(c, why, "exposure", error);
    }
    return status == GONIO_OK ? start_stream(c, error) : status;
}

// Wait, bounded, until it is there again.
static gonio_status reconnect(camera *c, gonio_error *error) {
    const gonio_deadline deadline = gonio_deadline_in_s(c->config.replug_s);
    gonio_status status;
    do {
        let_go(c);
        status = connect_camera(c, error);
        gonio_clock_sleep_ms(status != GONIO_OK ? 200 : 0);
    } while (status != GONIO_OK && gonio_deadline_left_ms(deadline) > 0);
    if (status != GONIO_OK) {
        let_go(c);
    }
    return status;
}

// ---- capture ----

static gonio_status set_exposure(camera *c, double exposure_s, bool *changed, gonio_error *error) {
    if (c->exposure_s == exposure_s) {
        return GONIO_OK;
    }
    GError *why = NULL;
    if (!(exposure_s >= c->exposure_min_s * (1 - 1e-9) && exposure_s <= c->exposure_max_s * (1 + 1e-9))) {
        return gonio_fail(error, GONIO_E_RANGE, "camera %.60s exposes %g to %g s; %g s was asked for", c->id,
                          c->exposure_min_s, c->exposure_max_s, exposure_s);
    }
    arv_camera_set_exposure_time(c->arv, exposure_s * 1e6, &why);
    const double now_s = why == NULL ? arv_camera_get_exposure_time(c->arv, &why) * 1e-6 : 0;
    if (why != NULL) {
        return told(c, why, "exposure", error);
    }
    if (!(fabs(now_s - exposure_s) <= c->config.exposure_tolerance * exposure_s)) {
        return gonio_fail(error, GONIO_E_RANGE, "camera %.60s exposes %g s where %g s was asked for", c->id, now_s,
                          exposure_s);
    }
    c->exposure_s = exposure_s;
    *changed = true;
    return GONIO_OK;
}

static gonio_status set_gain(camera *c, double gain_db, bool *changed, gonio_error *error) {
    if (c->gain_db == gain_db || !arv_camera_is_gain_available(c->arv, NULL)) {
        return gain_db == 0 || c->gain_db == gain_db
                   ? GONIO_OK
                   : gonio_fail(error, GONIO_E_RANGE, "camera %.60s has no gain; %g dB was asked for", c->id, gain_db);
    }
    GError *why = NULL;
    double low = 0, high = 0;
    arv_camera_get_gain_bounds(c->arv, &low, &high, &why);
    if (why == NULL && !(gain_db >= 0 && low + gain_db <= high)) {
        return gonio_fail(error, GONIO_E_RANGE, "camera %.60s has %g dB of gain; %g dB was asked for", c->id,
                          high - low, gain_db);
    }
    const double now = why == NULL ? arv_camera_get_gain(c->arv, &why) : 0;
    if (why == NULL && fabs(now - (low + gain_db)) > 1e-6) {
        arv_camera_set_gain(c->arv, low + gain_db, &why);
        *changed = true;
    }
    c->gain_db = gain_db;
    return told(c, why, "gain", error);
}

// What came without being asked for, or too late, goes back to the queue.
static void drain(camera *c) {
    for (ArvBuffer *old; (old = arv_stream_try_pop_buffer(c->stream)) != NULL;) {
        arv_stream_push_buffer(c->stream, old);
    }
}

// At its own rate, or by the trigger again.
static gonio_status run_freely(camera *c, bool freely, gonio_error *error) {
    GError *why = NULL;
    arv_camera_stop_acquisition(c->arv, &why);
    gonio_status status = told(c, why, "stop", error);
    if (status == GONIO_OK && freely) {
        arv_camera_clear_triggers(c->arv, &why);
        status = told(c, why, "free run", error);
    } else if (status == GONIO_OK) {
        status = set_trigger(c, error);
    }
    if (status == GONIO_OK) {
        drain(c);
        arv_camera_start_acquisition(c->arv, &why);
        status = told(c, why, "start", error);
    }
    c->free = status == GONIO_OK && freely;
    c->frame_id = 0;
    return status;
}

// One triggered frame; *buffer goes back to the stream by its user. *again: a fault that another trigger may mend.
static gonio_status trigger(camera *c, ArvBuffer **buffer, bool *again, gonio_error *error) {
    const double bound_s = c->exposure_s + c->config.info.read_out_s + GIVE_UP_S;
    GError *why = NULL;
    *again = true;
    drain(c);
    arv_camera_software_trigger(c->arv, &why);
    if (why != NULL) {
        *again = false;
        return told(c, why, "trigger", error);
    }
    *buffer = arv_stream_timeout_pop_buffer(c->stream, (guint64)(1e6 * bound_s));
    if (*buffer == NULL) {
        // One that was reset meanwhile takes a trigger and waits for none: only setting it up anew helps.
        const char *mode = arv_camera_get_string(c->arv, "TriggerMode", NULL);
        *again = mode != NULL && strcmp(mode, "On") == 0;
        return gonio_fail(error, GONIO_E_TIMEOUT, "camera %.60s sends no frame within %.3g s", c->id, bound_s);
    }
    const ArvBufferStatus status = arv_buffer_get_status(*buffer);
    if (status != ARV_BUFFER_STATUS_SUCCESS) {
        arv_stream_push_buffer(c->stream, *buffer);
        *buffer = NULL;
        return gonio_fail(error, GONIO_E_DEVICE, "camera %.60s: a frame arrived damaged (Aravis' status %d)", c->id,
                          (int)status);
    }
    return GONIO_OK;
}

static gonio_status unpack(const camera *c, ArvBuffer *buffer, const gonio_window *window, uint16_t *out,
                           gonio_error *error) {
    size_t n = 0;
    const uint8_t *bytes = arv_buffer_get_data(buffer, &n);
    const int width = arv_buffer_get_image_width(buffer), height = arv_buffer_get_image_height(buffer);
    if (width != c->width || height != c->height) {
        return gonio_fail(error, GONIO_E_DEVICE, "camera %.60s: a frame of %d x %d; %d x %d was set", c->id, width,
                          height, c->width, c->height);
    }
    return gonio_pixels_unpack(c->pixels, bytes, n, gonio_pixel_row_bytes(c->pixels, width), width, height, window,
                               c->config.shift, out, error);
}

// A frame into words, of those that follow a change the last one.
static gonio_status take(camera *c, const gonio_window *window, bool changed, uint16_t *out, gonio_error *error) {
    gonio_status status = GONIO_OK;
    int left = changed ? c->config.settle_frames : 0;
    for (int bad = 0; bad < BAD_FRAMES_MAX;) {
        ArvBuffer *buffer = NULL;
        bool again = false;
        status = trigger(c, &buffer, &again, error);
        if (status == GONIO_OK && left-- <= 0) {
            status = unpack(c, buffer, window, out, error);
            arv_stream_push_buffer(c->stream, buffer);
            return status;
        }
        if (buffer != NULL) {
            arv_stream_push_buffer(c->stream, buffer);
        }
        if (status != GONIO_OK && !again) {
            return status;
        }
        bad += status != GONIO_OK;
        left += status != GONIO_OK; // this one did not count
    }
    return status;
}

static gonio_status camera_capture(void *device, const gonio_window *window, double exposure_s, double gain_db,
                                   const gonio_stamp *stamp, double timeout_s, gonio_frame *frame, gonio_error *error) {
    camera *c = device;
    const gonio_deadline deadline = gonio_deadline_in_s(timeout_s);
    uint16_t *pixels = malloc((size_t)window->width * (size_t)window->height * sizeof *pixels);
    if (pixels == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a frame");
    }
    gonio_status status;
    bool first = true;
    do { // a camera that is gone is waited for; the frame is then asked for anew
        bool changed = false;
        status = c->arv == NULL || !first ? reconnect(c, error) : GONIO_OK;
        first = false;
        status = status == GONIO_OK && c->free ? run_freely(c, false, error) : status;
        if (status != GONIO_OK) {
            break;
        }
        status = set_exposure(c, exposure_s, &changed, error);
        status = status == GONIO_OK ? set_gain(c, gain_db, &changed, error) : status;
        status = status == GONIO_OK ? take(c, window, changed, pixels, error) : status;
    } while ((status == GONIO_E_DEVICE || status == GONIO_E_TIMEOUT) && gonio_deadline_left_ms(deadline) > 0);
    if (status != GONIO_OK) {
        free(pixels);
        return status;
    }
    *frame = (gonio_frame){*window, c->exposure_s, gain_db, *stamp, pixels};
    return GONIO_OK;
}

// ---- every frame ----

// How many a camera numbered since the last frame: block numbers have 16 bits, of which 0 is not used, or 64.
static int64_t note_id(camera *c, ArvBuffer *buffer) {
    const guint64 id = arv_buffer_get_frame_id(buffer), last = c->frame_id;
    c->frame_id = id;
    const int64_t step = (int64_t)(id - last);
    const int64_t ahead = step <= 0 && last <= 65535 ? step + 65535 : step;
    return last == 0 || ahead <= 0 ? 0 : ahead - 1;
}

static gonio_status camera_next(void *device, const gonio_window *window, double timeout_s, gonio_frame *frame,
                                int64_t *lost, gonio_error *error) {
    camera *c = device;
    const gonio_deadline deadline = gonio_deadline_in_s(timeout_s);
    *lost = 0;
    if (c->arv == NULL || !c->free) {
        return gonio_fail(error, GONIO_E_DEVICE, "camera %.60s does not stream", c->id);
    }
    for (;;) {
        const int left_ms = gonio_deadline_left_ms(deadline);
        ArvBuffer *buffer = arv_stream_timeout_pop_buffer(c->stream, (guint64)left_ms * 1000);
        if (buffer == NULL) {
            return gonio_fail(error, GONIO_E_TIMEOUT, "camera %.60s sends no frame within %.3g s", c->id, timeout_s);
        }
        *lost += note_id(c, buffer);
        const bool good = arv_buffer_get_status(buffer) == ARV_BUFFER_STATUS_SUCCESS;
        const guint64 own_ns = arv_buffer_get_timestamp(buffer);
        const gonio_status status = good ? unpack(c, buffer, window, frame->pixels, error) : GONIO_OK;
        frame->window = *window;
        frame->exposure_s = c->exposure_s;
        frame->gain_db = c->gain_db;
        frame->stamp.clock_s = (double)(own_ns != 0 ? own_ns : arv_buffer_get_system_timestamp(buffer)) * 1e-9;
        arv_stream_push_buffer(c->stream, buffer);
        if (good) {
            return status;
        }
        ++*lost;
    }
}

// Begun anew, the camera exposes nothing with older settings but what settle_frames are for.
static gonio_status camera_stream(void *device, double exposure_s, double gain_db, double timeout_s,
                                  gonio_error *error) {
    camera *c = device;
    bool changed = false;
    gonio_status status = c->arv == NULL ? reconnect(c, error) : GONIO_OK;
    status = status == GONIO_OK ? set_exposure(c, exposure_s, &changed, error) : status;
    status = status == GONIO_OK ? set_gain(c, gain_db, &changed, error) : status;
    status = status == GONIO_OK ? run_freely(c, true, error) : status;
    gonio_frame frame = {.pixels = malloc(sizeof *frame.pixels)};
    if (frame.pixels == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a frame");
    }
    for (int i = 0; i < c->config.settle_frames && status == GONIO_OK; i++) {
        int64_t lost;
        status = camera_next(c, &(gonio_window){0, 0, 1, 1}, timeout_s, &frame, &lost, error);
    }
    free(frame.pixels);
    return status;
}

// ---- latency, in triggered frames ----

static gonio_status expose(void *device, double exposure_s, gonio_error *error) {
    bool changed;
    return set_exposure(device, exposure_s, &changed, error);
}

static gonio_status any_frame(void *device, uint16_t *pixels, gonio_error *error) {
    camera *c = device;
    ArvBuffer *buffer = NULL;
    bool again;
    const gonio_window all = {0, 0, c->width, c->height};
    gonio_status status = trigger(c, &buffer, &again, error);
    if (status == GONIO_OK) {
        status = unpack(c, buffer, &all, pixels, error);
        arv_stream_push_buffer(c->stream, buffer);
    }
    return status;
}

static gonio_status camera_latency(void *device, double low_s, double high_s, int *frames, gonio_error *error) {
    camera *c = device;
    gonio_status status = c->arv == NULL ? reconnect(c, error) : GONIO_OK;
    status = status == GONIO_OK && c->free ? run_freely(c, false, error) : status;
    const gonio_latency_camera own = {c, (size_t)c->width * (size_t)c->height, expose, any_frame};
    return status == GONIO_OK ? gonio_camera_latency(&own, low_s, high_s, frames, error) : status;
}

static gonio_status camera_info(void *device, gonio_camera_info *info, gonio_error *error) {
    (void)error;
    const camera *c = device;
    *info = c->config.info;
    if (info->name[0] == 0) {
        snprintf(info->name, sizeof info->name, "%s", c->card);
    }
    info->width = c->width;
    info->height = c->height;
    info->bits = c->config.bits > 0 ? c->config.bits : c->pixels->bits - c->config.shift;
    info->pattern = c->pixels->pattern;
    info->exposure_min_s = c->exposure_min_s;
    info->exposure_max_s = c->exposure_max_s;
    return GONIO_OK;
}

static void camera_close(void *device) {
    let_go(device);
    free(device);
}

const gonio_camera_ops gonio_camera_aravis = {.name = "aravis",
                                              .info = camera_info,
                                              .capture = camera_capture,
                                              .close = camera_close,
                                              .stream = camera_stream,
                                              .next = camera_next,
                                              .latency = camera_latency};

gonio_status gonio_camera_aravis_open(const gonio_camera_aravis_config *config, void **device, gonio_error *error) {
    camera *c = calloc(1, sizeof *c);
    if (c == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a camera");
    }
    c->config = *config;
    const gonio_status status = connect_camera(c, error);
    if (status != GONIO_OK) {
        camera_close(c);
        return status;
    }
    *device = c;
    return GONIO_OK;
}
