// SPDX-License-Identifier: BSD-3-Clause
// The camera driver on a modelled device in virtual time: fresh frames with the right exposure, faults, record, replay.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include <cmocka.h>

#include "host/drivers/camera_v4l2.h"
#include "tests/unit/v4l2_model.h"

static v4l2_model model;
static const gonio_window all = {0, 0, CAM_WIDTH, CAM_HEIGHT};
static uint16_t pixels[CAM_WIDTH * CAM_HEIGHT];

static gonio_camera_v4l2_config config(void) {
    gonio_camera_v4l2_config c;
    gonio_camera_v4l2_defaults(&c);
    c.replug_s = 0.3;
    return c;
}

static void *open_camera(const gonio_camera_v4l2_config *c) {
    void *device = NULL;
    gonio_error error = {0};
    if (gonio_camera_v4l2_open(c, &cam_io, &model, &device, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    return device;
}

static gonio_status capture_within(double timeout_s, void *device, double exposure_s, gonio_frame *frame,
                                   gonio_error *error) {
    const gonio_stamp stamp = {7, 2, 1.5};
    frame->pixels = pixels;
    return gonio_camera_v4l2.capture(device, &all, exposure_s, 0, &stamp, timeout_s, frame, error);
}

static gonio_status capture(void *device, double exposure_s, gonio_frame *frame, gonio_error *error) {
    return capture_within(1, device, exposure_s, frame, error);
}

// Take one frame; how many of 300 random captures had another exposure, or began before they were asked for.
static int wrong_frames_of(const v4l2_model *like, int settle, double read_out_s) {
    model = *like;
    gonio_camera_v4l2_config c = config();
    c.settle_frames = settle;
    c.info.read_out_s = read_out_s;
    void *device = open_camera(&c);
    uint32_t seed = 99;
    int wrong = 0;
    for (int i = 0; i < 300; i++) {
        seed = seed * 1664525u + 1013904223u;
        const int32_t steps = (seed >> 8) % 3 == 0 ? model.exposure : (int32_t)(1 + (seed >> 12) % 180);
        cam_pass(&model, model.now_ns + (int64_t)(seed >> 20) * 100000); // the host was busy with something else
        const int64_t asked_ms = model.now_ns / 1000000;
        gonio_frame frame = {0};
        assert_int_equal(capture_within(10, device, steps * 1e-4, &frame, NULL), GONIO_OK);
        assert_true(fabs(frame.exposure_s - steps * 1e-4) < 1e-12);
        assert_int_equal(frame.stamp.pose, 7);
        wrong += pixels[1] != steps || (int16_t)(pixels[0] - (uint16_t)asked_ms) < 0;
    }
    gonio_camera_v4l2.close(device);
    return wrong;
}

// Whatever the stamps are and the flag says; with a read-out of up to 50 ms that is stated, that the frame interval
// bounds, or that nothing tells but the frames.
static void test_frames_are_fresh_and_exposed_as_asked(void **state) {
    (void)state;
    for (int latency = 0; latency <= 3; latency++) {
        for (int mode = 0; mode < 4 * STAMPS * 5; mode++) {
            v4l2_model like;
            cam_new(&like);
            like.latency = latency;
            like.clockless = mode & 1;
            like.multiplanar = mode & 2;
            like.stamp = (v4l2_stamp)(mode / 4 % STAMPS);
            const int read_out = mode / (4 * STAMPS); // 0: none; stated, told by the interval, not told; short
            like.read_out_ns = read_out == 0 ? 0 : read_out < 4 ? 50000000 : 2000000;
            like.period_ns = read_out == 0 || read_out == 4 ? 20000000 : 60000000;
            like.has_intervals = read_out == 2;
            const int wrong = wrong_frames_of(&like, 3, read_out == 1 ? 0.05 : 0);
            if (wrong != 0) {
                fail_msg("latency %d, mode %d (stamp %d, read-out %d): %d wrong frames of 300", latency, mode,
                         like.stamp, read_out, wrong);
            }
        }
    }
    // The model does show what the discarding is for.
    v4l2_model like;
    cam_new(&like);
    like.latency = 3;
    assert_true(wrong_frames_of(&like, 0, 0) > 50);
}

// Without a frame to settle, too: the one that is being exposed while the exposure changes has the longer one.
static void test_an_older_exposure_does_not_make_a_frame_look_fresh(void **state) {
    (void)state;
    for (int stamp = 0; stamp < STAMPS; stamp++) {
        v4l2_model like;
        cam_new(&like);
        like.stamp = (v4l2_stamp)stamp;
        like.read_out_ns = 1000000;
        like.latency = 0;
        assert_int_equal(wrong_frames_of(&like, 1, 0.001), 0);
    }
}

// uvcvideo cuts an exposure to the frame interval without a word.
static void test_exposures_beyond_the_frame_interval(void **state) {
    (void)state;
    for (int stamp = 0; stamp < STAMPS; stamp++) {
        cam_new(&model);
        model.stamp = (v4l2_stamp)stamp;
        model.has_intervals = true;
        model.exposure_max = 50000; // 5 s
        const gonio_camera_v4l2_config c = config();
        void *device = open_camera(&c);
        gonio_camera_info info;
        assert_int_equal(gonio_camera_v4l2.info(device, &info, NULL), GONIO_OK);
        assert_true(fabs(info.exposure_max_s - 1) < 1e-9); // of the longest interval
        static const int asked[] = {100, 300, 600, 10000, 150}, interval_ms[] = {20, 50, 100, 1000, 20};
        for (int i = 0; i < 5; i++) {
            gonio_frame frame = {0};
            assert_int_equal(capture_within(30, device, asked[i] * 1e-4, &frame, NULL), GONIO_OK);
            assert_int_equal(pixels[1], asked[i]);
            assert_int_equal(model.period_ns / 1000000, interval_ms[i]);
        }
        gonio_frame frame = {0};
        gonio_error error = {0};
        assert_int_equal(capture_within(30, device, 3, &frame, &error), GONIO_E_RANGE);
        assert_non_null(strstr(error.message, "frame interval"));
        assert_int_equal(capture_within(30, device, 0.015, &frame, NULL), GONIO_OK);
        model.interval_sticks = true;
        assert_int_equal(capture_within(30, device, 0.5, &frame, &error), GONIO_E_RANGE);
        assert_non_null(strstr(error.message, "frame interval of 0.02 s"));
        assert_int_equal(capture_within(30, device, 0.015, &frame, &error), GONIO_OK);
        gonio_camera_v4l2.close(device);
    }
}

static void test_controls_of_64_bits(void **state) {
    (void)state;
    cam_new(&model);
    model.wide = true;
    const gonio_camera_v4l2_config c = config();
    void *device = open_camera(&c);
    gonio_frame frame = {0};
    assert_int_equal(capture(device, 0.0123, &frame, NULL), GONIO_OK);
    assert_int_equal(pixels[1], 123);
    gonio_camera_v4l2.close(device);
}

static void test_latency_is_measured(void **state) {
    (void)state;
    for (int latency = 0; latency <= 4; latency++) {
        cam_new(&model);
        model.latency = latency;
        model.plain = true;
        const gonio_camera_v4l2_config c = config();
        void *device = open_camera(&c);
        int frames = -1;
        assert_int_equal(gonio_camera_v4l2.latency(device, 0.001, 0.015, &frames, NULL), GONIO_OK);
        assert_int_equal(frames, latency);
        gonio_camera_v4l2.close(device);
    }
}

static void test_automatic_functions(void **state) {
    (void)state;
    cam_new(&model);
    const gonio_camera_v4l2_config c = config();
    void *device = open_camera(&c);
    assert_int_equal(model.auto_exposure, V4L2_EXPOSURE_MANUAL);
    assert_int_equal(model.white_balance, 0);
    gonio_frame frame = {0};
    assert_int_equal(capture(device, 0.01, &frame, NULL), GONIO_OK);
    assert_int_equal(model.gain, 0);
    gonio_camera_v4l2.close(device);

    cam_new(&model);
    model.auto_exposure_sticks = true;
    gonio_error error = {0};
    device = NULL;
    assert_int_equal(gonio_camera_v4l2_open(&c, &cam_io, &model, &device, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "automatic exposure"));
    assert_null(device);

    // The mains' frequency that some cameras ask for, and have no "off", changes no pixel of a manual exposure.
    cam_new(&model);
    model.power_line = true;
    device = open_camera(&c);
    assert_int_equal(capture(device, 0.01, &frame, NULL), GONIO_OK);
    assert_non_null(strstr(gonio_camera_v4l2_warning(device), "power line"));
    gonio_camera_v4l2.close(device);
}

static void test_refusals(void **state) {
    (void)state;
    gonio_camera_v4l2_config c = config();
    gonio_error error = {0};
    void *device = NULL;
    cam_new(&model);
    model.mjpeg_only = true;
    assert_int_equal(gonio_camera_v4l2_open(&c, &cam_io, &model, &device, &error), GONIO_E_UNSUPPORTED);
    cam_new(&model);
    strcpy(c.format, "MJPG");
    assert_int_equal(gonio_camera_v4l2_open(&c, &cam_io, &model, &device, &error), GONIO_E_UNSUPPORTED);
    assert_non_null(strstr(error.message, "compressed"));
    strcpy(c.format, "Y99");
    assert_int_equal(gonio_camera_v4l2_open(&c, &cam_io, &model, &device, &error), GONIO_E_INPUT);
    strcpy(c.format, "YUYV"); // the model gives Y16 whatever is asked
    assert_int_equal(gonio_camera_v4l2_open(&c, &cam_io, &model, &device, &error), GONIO_E_DEVICE);
    c.format[0] = 0;
    model.no_exposure = true;
    assert_int_equal(gonio_camera_v4l2_open(&c, &cam_io, &model, &device, &error), GONIO_E_UNSUPPORTED);
    assert_non_null(strstr(error.message, "fixed_exposure_ms"));
    c.fixed_exposure_s = 0.01;
    device = open_camera(&c);
    gonio_frame frame = {0};
    assert_int_equal(capture(device, 0.01, &frame, NULL), GONIO_OK);
    assert_int_equal(capture(device, 0.1, &frame, &error), GONIO_E_RANGE);
    gonio_camera_v4l2.close(device);
}

static void test_info(void **state) {
    (void)state;
    cam_new(&model);
    gonio_camera_v4l2_config c = config();
    c.shift = 4;
    c.info.fx = 800;
    void *device = open_camera(&c);
    gonio_camera_info info;
    assert_int_equal(gonio_camera_v4l2.info(device, &info, NULL), GONIO_OK);
    assert_string_equal(info.name, "Model");
    assert_int_equal(info.width, CAM_WIDTH);
    assert_int_equal(info.bits, 12);
    assert_true(info.fx == 800 && fabs(info.exposure_max_s - 0.018) < 1e-12);
    gonio_frame frame = {0};
    assert_int_equal(capture(device, 0.0160, &frame, NULL), GONIO_OK);
    assert_int_equal(pixels[1], 160 >> 4);
    gonio_camera_v4l2.close(device);
}

static void test_bad_frames_are_left_out(void **state) {
    (void)state;
    cam_new(&model);
    const gonio_camera_v4l2_config c = config();
    void *device = open_camera(&c);
    gonio_frame frame = {0};
    assert_int_equal(capture(device, 0.01, &frame, NULL), GONIO_OK);
    model.damage = 3;
    model.cut = 2;
    assert_int_equal(capture(device, 0.01, &frame, NULL), GONIO_OK);
    assert_int_equal(pixels[1], 100);
    model.skip = 4;
    assert_int_equal(capture(device, 0.01, &frame, NULL), GONIO_OK);
    const gonio_camera_v4l2_counts *counts = gonio_camera_v4l2_count(device);
    assert_int_equal(counts->damaged, 3);
    assert_int_equal(counts->short_frames, 2);
    assert_int_equal(counts->gaps, 1);
    assert_int_equal(counts->lost, 4);
    model.damage = 1 << 20;
    gonio_error error = {0};
    assert_int_equal(capture(device, 0.01, &frame, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "damaged"));
    model.damage = 0;
    assert_int_equal(capture(device, 0.01, &frame, NULL), GONIO_OK);
    gonio_camera_v4l2.close(device);
}

static int fires;
static gonio_status fire(void *context, gonio_error *error) {
    (void)error;
    fires++;
    ((v4l2_model *)context)->fired++;
    // The pulse takes effect with the next frame's time.
    cam_pass(context, model.now_ns + model.period_ns / 2);
    return GONIO_OK;
}

// A camera that exposes on a pulse: what an earlier pulse left in the queue costs no pulse of its own.
static void test_one_pulse_a_frame(void **state) {
    (void)state;
    cam_new(&model);
    model.triggered = true;
    gonio_camera_v4l2_config c = config();
    c.settle_frames = 0;
    c.trigger = fire;
    c.trigger_context = &model;
    void *device = open_camera(&c);
    for (int i = 0; i < 20; i++) {
        model.fired += i % 3; // somebody else's pulses: up to two old frames
        cam_pass(&model, model.now_ns + 4 * model.period_ns);
        const int64_t asked_ms = model.now_ns / 1000000;
        gonio_frame frame = {0};
        fires = 0;
        assert_int_equal(capture(device, 0.001, &frame, NULL), GONIO_OK);
        assert_int_equal(fires, 1);
        assert_true((int16_t)(pixels[0] - (uint16_t)asked_ms) >= 0);
    }
    gonio_camera_v4l2.close(device);
}

// A camera that runs freely, whatever pulses come: no frame of it is of a known moment. One stray frame is no such
// sign.
static void test_a_trigger_that_is_off_is_told(void **state) {
    (void)state;
    for (int with_intervals = 0; with_intervals < 2; with_intervals++) {
        cam_new(&model);
        model.has_intervals = with_intervals;
        gonio_camera_v4l2_config c = config();
        c.settle_frames = 0;
        c.trigger = fire;
        c.trigger_context = &model;
        void *device = open_camera(&c);
        gonio_frame frame = {0};
        gonio_error error = {0};
        fires = 0;
        assert_int_equal(capture(device, 0.001, &frame, &error), GONIO_E_UNSUPPORTED);
        assert_non_null(strstr(error.message, "without a trigger pulse"));
        assert_int_equal(fires, 0);
        model.triggered = true; // somebody switches it on
        model.fired = 1;
        assert_int_equal(capture(device, 0.001, &frame, &error), GONIO_OK);
        assert_int_equal(fires, 1);
        gonio_camera_v4l2.close(device);
    }
}

static void test_gain_is_as_asked_or_refused(void **state) {
    (void)state;
    cam_new(&model);
    gonio_camera_v4l2_config c = config();
    c.gain_unit_db = 0.5; // 0 to 48 dB in steps of 2 dB
    void *device = open_camera(&c);
    gonio_frame frame = {.pixels = pixels};
    gonio_error error = {0};
    const gonio_stamp stamp = {0};
    assert_int_equal(gonio_camera_v4l2.capture(device, &all, 0.01, 13, &stamp, 1, &frame, &error), GONIO_OK);
    assert_true(model.gain == 24 || model.gain == 28);
    assert_true(frame.gain_db == model.gain * 0.5);
    assert_int_equal(gonio_camera_v4l2.capture(device, &all, 0.01, 60, &stamp, 1, &frame, &error), GONIO_E_RANGE);
    assert_non_null(strstr(error.message, "48 dB"));
    gonio_camera_v4l2.close(device);
}

// At full rate every frame comes, in order, with the setting that was asked for; what is missing or damaged is told.
static void test_every_frame_of_a_stream(void **state) {
    (void)state;
    cam_new(&model);
    model.latency = 2;
    const gonio_camera_v4l2_config c = config();
    void *device = open_camera(&c);
    assert_int_equal(gonio_camera_v4l2.stream(device, 0.0077, 0, 1, NULL), GONIO_OK);
    double last_s = 0;
    for (int i = 0; i < 200; i++) {
        gonio_frame frame = {.pixels = pixels};
        int64_t lost = -1;
        model.skip = i == 50 ? 3 : 0;
        model.damage = i == 70 ? 2 : 0;
        model.cut = i == 90;
        assert_int_equal(gonio_camera_v4l2.next(device, &all, 1, &frame, &lost, NULL), GONIO_OK);
        assert_int_equal(pixels[1], 77);
        const int missing = i == 50 ? 3 : i == 70 ? 2 : i == 90 ? 1 : 0;
        assert_int_equal(lost, missing);
        if (i > 0) {
            assert_true(fabs(frame.stamp.clock_s - last_s - 0.02 * (1 + missing)) < 1e-5);
        }
        last_s = frame.stamp.clock_s;
    }
    model.plugged = false;
    gonio_frame frame = {.pixels = pixels};
    int64_t lost;
    assert_int_equal(gonio_camera_v4l2.next(device, &all, 1, &frame, &lost, NULL), GONIO_E_DEVICE);
    gonio_camera_v4l2.close(device);
}

static void test_silence_restarts_the_stream(void **state) {
    (void)state;
    cam_new(&model);
    const gonio_camera_v4l2_config c = config();
    void *device = open_camera(&c);
    gonio_frame frame = {0};
    const int before = model.stream_ons;
    model.silent = 30; // 0.6 s of 1 s; the first try has half of it
    assert_int_equal(capture(device, 0.01, &frame, NULL), GONIO_OK);
    assert_int_equal(model.stream_ons, before + 1);
    model.silent = 1 << 20;
    gonio_error error = {0};
    assert_int_equal(capture(device, 0.01, &frame, &error), GONIO_E_TIMEOUT);
    gonio_camera_v4l2.close(device);
}

static void test_unplugged(void **state) {
    (void)state;
    cam_new(&model);
    const gonio_camera_v4l2_config c = config();
    void *device = open_camera(&c);
    gonio_frame frame = {0};
    gonio_error error = {0};
    model.plugged = false;
    assert_int_equal(capture(device, 0.01, &frame, &error), GONIO_E_DEVICE);
    model.plugged = true; // plugged in again with its defaults: everything is set anew
    model.auto_exposure = 3;
    model.exposure = 7;
    model.streaming = false;
    assert_int_equal(capture(device, 0.01, &frame, &error), GONIO_OK);
    assert_int_equal(pixels[1], 100);
    assert_int_equal(model.auto_exposure, V4L2_EXPOSURE_MANUAL);
    model.plugged = false;
    capture(device, 0.01, &frame, &error);
    model.plugged = true;
    model.card = "Other";
    assert_int_equal(capture(device, 0.01, &frame, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "another camera"));
    gonio_camera_v4l2.close(device);
}

// What a recorded session saw, its replay sees: the same frames and the same fault.
static void test_record_and_replay(void **state) {
    (void)state;
    for (int planes = 0; planes < 2; planes++) {
        char path[] = "/tmp/gonio-tape-XXXXXX";
        close(mkstemp(path));
        unlink(path);
        uint16_t seen[2][6];
        char fault[2][512];
        for (int replay = 0; replay < 2; replay++) {
            gonio_tape *tape = NULL;
            gonio_v4l2_recorder *recorder = NULL;
            cam_new(&model);
            model.multiplanar = planes;
            model.wide = planes; // what an address in an argument leads to is on the tape, too
            assert_int_equal((replay ? gonio_tape_open : gonio_tape_create)(path, &tape, NULL), GONIO_OK);
            assert_int_equal(gonio_v4l2_recorder_new(tape, &cam_io, &model, &recorder, NULL), GONIO_OK);
            const gonio_camera_v4l2_config c = config();
            void *device = NULL;
            gonio_error error = {0};
            assert_int_equal(gonio_camera_v4l2_open(&c, replay ? &gonio_v4l2_replaying : &gonio_v4l2_recording,
                                                    recorder, &device, &error),
                             GONIO_OK);
            for (int i = 0; i < 6; i++) {
                gonio_frame frame = {0};
                model.cut = i == 2;
                assert_int_equal(capture(device, 0.001 * (1 + i / 2), &frame, NULL), GONIO_OK);
                seen[replay][i] = pixels[5];
            }
            model.damage = 1 << 20;
            gonio_frame frame = {0};
            assert_int_equal(capture(device, 0.01, &frame, &error), GONIO_E_DEVICE);
            strcpy(fault[replay], error.message);
            gonio_camera_v4l2.close(device);
            gonio_v4l2_recorder_free(recorder);
            gonio_tape_close(tape);
        }
        unlink(path);
        assert_memory_equal(seen[0], seen[1], sizeof seen[0]);
        assert_string_equal(fault[0], fault[1]);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_frames_are_fresh_and_exposed_as_asked),
        cmocka_unit_test(test_an_older_exposure_does_not_make_a_frame_look_fresh),
        cmocka_unit_test(test_exposures_beyond_the_frame_interval),
        cmocka_unit_test(test_controls_of_64_bits),
        cmocka_unit_test(test_latency_is_measured),
        cmocka_unit_test(test_automatic_functions),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_info),
        cmocka_unit_test(test_bad_frames_are_left_out),
        cmocka_unit_test(test_one_pulse_a_frame),
        cmocka_unit_test(test_a_trigger_that_is_off_is_told),
        cmocka_unit_test(test_gain_is_as_asked_or_refused),
        cmocka_unit_test(test_every_frame_of_a_stream),
        cmocka_unit_test(test_silence_restarts_the_stream),
        cmocka_unit_test(test_unplugged),
        cmocka_unit_test(test_record_and_replay),
    };
    return cmocka_run_group_tests_name("camera_v4l2", tests, NULL, NULL);
}
