// SPDX-License-Identifier: BSD-3-Clause
// The camera driver on the kernel's vivid: formats, gain, injected errors, a pulled plug, record and replay.
// usage: vivid DEVICE MULTIPLANAR_DEVICE TAPE
#include <fcntl.h>
#include <linux/videodev2.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "host/drivers/camera_v4l2.h"
#include "host/transport/clock.h"
#include "tests/hil/tap.h"

enum { WIDTH = 320, HEIGHT = 180, PIXELS = WIDTH * HEIGHT };
#define FIXED_S 0.01 // vivid has no exposure control

static const char *path;
static uint16_t pixels[PIXELS], others[PIXELS];

// ---- vivid's own controls, by their names ----

static bool find(int fd, const char *name, struct v4l2_query_ext_ctrl *control) {
    memset(control, 0, sizeof *control);
    control->id = V4L2_CTRL_FLAG_NEXT_CTRL;
    while (ioctl(fd, VIDIOC_QUERY_EXT_CTRL, control) == 0) {
        if (strcmp(control->name, name) == 0) {
            return true;
        }
        control->id |= V4L2_CTRL_FLAG_NEXT_CTRL;
    }
    return false;
}

// The value of a menu's item; the number itself for other controls.
static int32_t value_of(int fd, const struct v4l2_query_ext_ctrl *control, const char *value) {
    if (control->type != V4L2_CTRL_TYPE_MENU) {
        return atoi(value);
    }
    for (uint32_t i = 0; i <= (uint32_t)control->maximum; i++) {
        struct v4l2_querymenu item = {.id = control->id, .index = i};
        if (ioctl(fd, VIDIOC_QUERYMENU, &item) == 0 && strcmp((const char *)item.name, value) == 0) {
            return (int32_t)i;
        }
    }
    return -1;
}

static bool set(const char *device, const char *name, const char *value) {
    const int fd = open(device, O_RDWR);
    struct v4l2_query_ext_ctrl control;
    bool done = fd >= 0 && find(fd, name, &control);
    if (done) {
        struct v4l2_control c = {control.id, value_of(fd, &control, value)};
        done = ioctl(fd, VIDIOC_S_CTRL, &c) == 0;
    }
    close(fd);
    return done || check(false, name, "cannot be set to %s", value);
}

static int32_t get(uint32_t id) {
    const int fd = open(path, O_RDWR);
    struct v4l2_control c = {.id = id, .value = -1};
    if (ioctl(fd, VIDIOC_G_CTRL, &c) != 0) {
        c.value = -1;
    }
    close(fd);
    return c.value;
}

// ---- the driver ----

static gonio_camera_v4l2_config config_of(const char *format) {
    gonio_camera_v4l2_config config;
    gonio_camera_v4l2_defaults(&config);
    snprintf(config.path, sizeof config.path, "%s", path);
    snprintf(config.format, sizeof config.format, "%s", format);
    config.width = WIDTH;
    config.height = HEIGHT;
    config.fixed_exposure_s = FIXED_S;
    config.settle_frames = 1;
    config.replug_s = 5;
    return config;
}

static void *open_camera(const gonio_camera_v4l2_config *config) {
    void *device = NULL;
    gonio_error error = {0};
    const gonio_status status = gonio_camera_v4l2_open(config, &gonio_v4l2_system, NULL, &device, &error);
    if (status != GONIO_OK) {
        check(false, config->format, "cannot be opened: %s", error.message);
        return NULL;
    }
    return device;
}

static gonio_status capture(void *device, double gain_db, uint16_t *to, gonio_error *error) {
    const gonio_window all = {0, 0, WIDTH, HEIGHT};
    const gonio_stamp stamp = {0};
    gonio_frame frame = {.pixels = to};
    return gonio_camera_v4l2.capture(device, &all, FIXED_S, gain_db, &stamp, 4, &frame, error);
}

// Mean of every second pixel from (x, y) on, relative to the format's full scale.
static double mean_from(int x0, int y0, int bits) {
    double sum = 0;
    for (int y = y0; y < HEIGHT; y += 2) {
        for (int x = x0; x < WIDTH; x += 2) {
            sum += pixels[y * WIDTH + x];
        }
    }
    return sum / (PIXELS / 4.0) / (1 << bits);
}

// A grey format shows what 8 bits of grey show, in its own number of bits; luma of a processed picture has black at 16
// and white at 235 (ITU-R BT.601).
static void mono_format(const char *name, const uint16_t *grey, bool luma) {
    const gonio_camera_v4l2_config config = config_of(name);
    void *device = open_camera(&config);
    gonio_error error = {0};
    if (device == NULL) {
        return;
    }
    const gonio_status status = capture(device, 0, pixels, &error);
    const int bits = gonio_camera_v4l2_format(device)->bits;
    int differ = 0;
    for (int i = 0; status == GONIO_OK && i < PIXELS; i++) {
        const double wanted = luma ? 16 + grey[i] * 219 / 255.0 : grey[i];
        differ += fabs((pixels[i] >> (bits - 8)) - wanted) > (luma ? 1.5 : 0);
    }
    check(status == GONIO_OK && differ == 0, name, "%s; %d pixels differ from GREY", error.message, differ);
    gonio_camera_v4l2.close(device);
}

// Under a red picture only the red pixels of the pattern are lit.
static void bayer_format(const char *name) {
    static const int red[][2] = {
        [GONIO_RGGB] = {0, 0}, [GONIO_BGGR] = {1, 1}, [GONIO_GRBG] = {1, 0}, [GONIO_GBRG] = {0, 1}};
    const gonio_camera_v4l2_config config = config_of(name);
    void *device = open_camera(&config);
    gonio_error error = {0};
    if (device == NULL) {
        return;
    }
    const gonio_pixel_format *format = gonio_camera_v4l2_format(device);
    const gonio_status status = capture(device, 0, pixels, &error);
    const int *at = red[format->pattern];
    const double lit = mean_from(at[0], at[1], format->bits);
    const double dark = mean_from(1 - at[0], 1 - at[1], format->bits),
                 green = mean_from(1 - at[0], at[1], format->bits);
    check(status == GONIO_OK && lit > 0.8 && dark < 0.1 && green < 0.1, name, "%s; red %.3f, green %.3f, blue %.3f",
          error.message, lit, green, dark);
    gonio_camera_v4l2.close(device);
}

static void formats(const char *multiplanar) {
    static uint16_t grey[PIXELS];
    static const char *const mono[] = {"Y10", "Y12", "Y16", "Y16_BE", "YUYV", "UYVY"};
    static const char *const bayer[] = {"SRGGB8",  "SBGGR8",  "SGRBG8",  "SGBRG8",  "SRGGB10", "SBGGR10",
                                        "SGRBG12", "SGBRG12", "SRGGB16", "SBGGR16", "SGRBG16", "SGBRG16"};
    gonio_camera_v4l2_config config = config_of("GREY");
    void *device = open_camera(&config);
    gonio_error error = {0};
    if (device == NULL) {
        return;
    }
    check(capture(device, 0, grey, &error) == GONIO_OK && grey[0] != grey[WIDTH - 1], "GREY", "%s; %d, %d",
          error.message, grey[0], grey[WIDTH - 1]);
    gonio_camera_v4l2.close(device);
    for (size_t i = 0; i < sizeof mono / sizeof *mono; i++) {
        mono_format(mono[i], grey, mono[i][0] != 'Y' || mono[i][1] == 'U');
    }
    const char *single = path;
    path = multiplanar;
    set(path, "OSD Text Mode", "None");
    set(path, "Test Pattern", "Gray Ramp");
    mono_format("Y16", grey, false);
    path = single;
    set(path, "Test Pattern", "100% Red");
    for (size_t i = 0; i < sizeof bayer / sizeof *bayer; i++) {
        bayer_format(bayer[i]);
    }
    set(path, "Test Pattern", "Gray Ramp");
    config = config_of("MJPG");
    check(gonio_camera_v4l2_open(&config, &gonio_v4l2_system, NULL, &device, &error) == GONIO_E_UNSUPPORTED &&
              strstr(error.message, "compressed") != NULL,
          "MJPG is refused", "%s", error.message);
    config = config_of("Y12");
    config.fixed_exposure_s = 0;
    check(gonio_camera_v4l2_open(&config, &gonio_v4l2_system, NULL, &device, &error) == GONIO_E_UNSUPPORTED &&
              strstr(error.message, "no exposure control") != NULL,
          "a camera without an exposure control is refused", "%s", error.message);
}

static void gain(void) {
    gonio_camera_v4l2_config config = config_of("Y16");
    config.gain_unit_db = 0.1;
    gonio_error error = {0};
    set(path, "Gain, Automatic", "1");
    void *device = open_camera(&config);
    if (device == NULL) {
        return;
    }
    check(get(V4L2_CID_AUTOGAIN) == 0, "automatic gain is switched off", "it reads %d", get(V4L2_CID_AUTOGAIN));
    check(capture(device, 12, pixels, &error) == GONIO_OK && get(V4L2_CID_GAIN) == 120, "a gain of 12 dB is set",
          "%s; the control reads %d", error.message, get(V4L2_CID_GAIN));
    check(capture(device, 0, pixels, &error) == GONIO_OK && get(V4L2_CID_GAIN) == 0, "and taken back",
          "%s; the control reads %d", error.message, get(V4L2_CID_GAIN));
    check(capture(device, 60, pixels, &error) == GONIO_E_RANGE, "more gain than there is, is refused",
          "the control reads %d", get(V4L2_CID_GAIN));
    gonio_camera_v4l2.close(device);
}

// Inject by `control` while the camera runs: the next captures must come out whole, with `counted` raised.
static void injected(const char *control, const char *value, const char *name, const int64_t *counted, void *device) {
    gonio_error error = {0};
    const int64_t before = *counted;
    gonio_status status = capture(device, 0, others, &error);
    set(path, control, value);
    for (int i = 0; status == GONIO_OK && i < 8 && *counted == before; i++) {
        memset(pixels, 0xff, sizeof pixels);
        status = capture(device, 0, pixels, &error);
    }
    const bool same = memcmp(pixels, others, sizeof pixels) == 0;
    check(status == GONIO_OK && same && *counted > before, name, "%s; picture %s, counted %lld", error.message,
          same ? "whole" : "not whole", (long long)(*counted - before));
}

static void errors(void) {
    const gonio_camera_v4l2_config config = config_of("Y16");
    void *device = open_camera(&config);
    if (device == NULL) {
        return;
    }
    const gonio_camera_v4l2_counts *counts = gonio_camera_v4l2_count(device);
    injected("Inject V4L2_BUF_FLAG_ERROR", "1", "a frame marked as damaged is not taken", &counts->damaged, device);
    injected("Percentage of Dropped Buffers", "50", "frames that were dropped show as gaps", &counts->gaps, device);
    set(path, "Percentage of Dropped Buffers", "0");
    injected("Inject Fatal Streaming Error", "1", "a stream that failed is started again", &counts->restarts, device);
    injected("Inject VIDIOC_QBUF Error", "1", "a buffer that was refused is got over", &counts->restarts, device);
    gonio_camera_v4l2.close(device);
    gonio_error error = {0};
    set(path, "Inject VIDIOC_STREAMON Error", "1");
    check(gonio_camera_v4l2_open(&config, &gonio_v4l2_system, NULL, &device, &error) == GONIO_E_DEVICE &&
              strstr(error.message, "STREAMON") != NULL,
          "a stream that does not start is named", "%s", error.message);
}

// vivid's nodes answer ENODEV from now on, and come back when the last user has closed them.
static void plug(void) {
    gonio_camera_v4l2_config config = config_of("Y16");
    gonio_error error = {0};
    void *device = open_camera(&config);
    if (device == NULL) {
        return;
    }
    injected("Disconnect", "1", "a camera that was unplugged and comes back goes on",
             &gonio_camera_v4l2_count(device)->replugs, device);
    gonio_camera_v4l2.close(device);
    config.replug_s = 0.4;
    device = open_camera(&config);
    if (device == NULL) {
        return;
    }
    const int holder = open(path, O_RDWR); // with another user it does not come back
    set(path, "Disconnect", "1");
    const int64_t start = gonio_clock_ms();
    const gonio_status status = capture(device, 0, pixels, &error);
    check(status == GONIO_E_DEVICE && gonio_clock_ms() - start < 30000, "one that stays away is given up in time",
          "status %d after %lld ms: %s", status, (long long)(gonio_clock_ms() - start), error.message);
    close(holder);
    gonio_camera_v4l2.close(device);
}

static void timestamps(void) {
    gonio_v4l2 *device;
    gonio_error error = {0};
    gonio_v4l2_format format = {.fourcc = V4L2_PIX_FMT_Y16, .width = WIDTH, .height = HEIGHT};
    if (gonio_v4l2_open(&gonio_v4l2_system, NULL, path, &device, &error) != GONIO_OK) {
        check(false, "timestamps", "%s", error.message);
        return;
    }
    bool good =
        gonio_v4l2_set_format(device, &format, &error) == GONIO_OK && gonio_v4l2_start(device, 4, &error) == GONIO_OK;
    gonio_v4l2_buffer last = {.time_ns = -1}, buffer = {0};
    for (int i = 0; i < 6 && good; i++) {
        good = gonio_v4l2_take(device, 4000, &buffer, &error) == GONIO_OK &&
               gonio_v4l2_give(device, buffer.index, &error) == GONIO_OK && buffer.time_ns > last.time_ns &&
               llabs(buffer.time_ns - gonio_v4l2_now_ns(device)) < 1000000000 &&
               (i == 0 || buffer.sequence > last.sequence);
        last = good ? buffer : last;
    }
    check(good, "timestamps are monotonic and of this clock; the sequence rises",
          "%s; frame %u at %lld ns after %u at %lld, now %lld", error.message, buffer.sequence,
          (long long)buffer.time_ns, last.sequence, (long long)last.time_ns, (long long)gonio_v4l2_now_ns(device));
    gonio_v4l2_close(device);
}

// What the kernel answered, written down, gives the same picture without it.
static void tape(const char *file) {
    const gonio_camera_v4l2_config config = config_of("Y12");
    gonio_error error = {0};
    bool same = true;
    uint16_t *const pictures[] = {pixels, others};
    for (int replay = 0; replay < 2 && same; replay++) {
        gonio_tape *written = NULL;
        gonio_v4l2_recorder *recorder = NULL;
        void *device = NULL;
        same = (replay ? gonio_tape_open(file, &written, &error) : gonio_tape_create(file, &written, &error)) ==
                   GONIO_OK &&
               gonio_v4l2_recorder_new(written, &gonio_v4l2_system, NULL, &recorder, &error) == GONIO_OK &&
               gonio_camera_v4l2_open(&config, replay ? &gonio_v4l2_replaying : &gonio_v4l2_recording, recorder,
                                      &device, &error) == GONIO_OK &&
               capture(device, 0, pictures[replay], &error) == GONIO_OK;
        if (device != NULL) {
            gonio_camera_v4l2.close(device);
        }
        gonio_v4l2_recorder_free(recorder);
        gonio_tape_close(written);
    }
    same = same && memcmp(pixels, others, sizeof pixels) == 0;
    check(same, "a recorded capture replays to the same picture", "%s", error.message);
}

int main(int argc, char **argv) {
    if (argc != 4) {
        return 2;
    }
    path = argv[1];
    set(path, "OSD Text Mode", "None"); // a picture that stands still
    set(path, "Test Pattern", "Gray Ramp");
    formats(argv[2]);
    gain();
    timestamps();
    tape(argv[3]);
    errors();
    plug();
    return failures > 0;
}
