// SPDX-License-Identifier: BSD-3-Clause
// The GenICam camera against Aravis' own fake GigE Vision camera over the loopback interface.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <arv.h>
#include <cmocka.h>

#include "host/drivers/camera_aravis.h"
#include "tests/unit/near.h"

#define SERIAL "GONIO1"
static ArvGvFakeCamera *fake;
static const gonio_stamp stamp = {7, 3, 1.5};

static bool start(const char *serial) {
    fake = arv_gv_fake_camera_new("lo", serial);
    if (fake == NULL || !arv_gv_fake_camera_is_running(fake)) {
        return false;
    }
    // Small frames at 250 a second, or the tests do nothing but wait for them.
    ArvFakeCamera *inner = arv_gv_fake_camera_get_fake_camera(fake);
    arv_fake_camera_write_register(inner, ARV_FAKE_CAMERA_REGISTER_ACQUISITION_FRAME_PERIOD_US, 4000);
    arv_fake_camera_write_register(inner, ARV_FAKE_CAMERA_REGISTER_SENSOR_WIDTH, 512);
    arv_fake_camera_write_register(inner, ARV_FAKE_CAMERA_REGISTER_SENSOR_HEIGHT, 512);
    return true;
}

static void stop(void) {
    if (fake != NULL) {
        g_object_unref(fake);
    }
    fake = NULL;
}

static void *open_camera(const char *format) {
    gonio_camera_aravis_config c;
    gonio_camera_aravis_defaults(&c);
    snprintf(c.id, sizeof c.id, "Aravis-Fake-%s", SERIAL);
    snprintf(c.format, sizeof c.format, "%s", format);
    c.replug_s = 5;
    void *device = NULL;
    gonio_error error = {0};
    if (gonio_camera_aravis_open(&c, &device, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    return device;
}

static void need_fake(void) {
    if (fake == NULL && !start(SERIAL)) {
        print_message("# no fake camera on the loopback interface here\n");
        stop();
        skip();
    }
}

static gonio_status capture(void *camera, gonio_window window, double exposure_s, gonio_frame *frame,
                            gonio_error *error) {
    return gonio_camera_aravis.capture(camera, &window, exposure_s, 0, &stamp, 20, frame, error);
}

static void tells_what_it_is(void **state) {
    (void)state;
    need_fake();
    void *camera = open_camera("");
    gonio_camera_info info;
    assert_int_equal(gonio_camera_aravis.info(camera, &info, NULL), GONIO_OK);
    assert_int_equal(info.bits, 16); // Mono16 before Mono8 and Bayer
    assert_int_equal(info.pattern, GONIO_MONO);
    assert_string_equal(info.serial, SERIAL);
    assert_true(info.width >= 512 && info.height >= 512);
    assert_near(info.exposure_min_s, 1e-5, 1e-9);
    assert_near(info.exposure_max_s, 10, 1e-6);
    gonio_camera_aravis.close(camera);
    camera = open_camera("BayerGR8");
    assert_int_equal(gonio_camera_aravis.info(camera, &info, NULL), GONIO_OK);
    assert_int_equal(info.bits, 8);
    assert_int_equal(info.pattern, GONIO_GRBG);
    gonio_camera_aravis.close(camera);
}

// The fake camera's picture is a ramp that wraps; what a window holds must be that part of it.
static void windows_are_parts_of_the_frame(void **state) {
    (void)state;
    need_fake();
    void *camera = open_camera("Mono8");
    gonio_frame frame;
    gonio_error error = {0};
    const gonio_window window = {100, 37, 64, 20};
    for (int k = 0; k < 3; k++) {
        assert_int_equal(capture(camera, window, 0.01, &frame, &error), GONIO_OK);
        assert_memory_equal(&frame.window, &window, sizeof window);
        assert_true(frame.stamp.pose == stamp.pose && frame.stamp.frame == stamp.frame);
        assert_near(frame.exposure_s, 0.01, 0);
        for (int y = 0; y + 1 < window.height; y++) { // a step to the right is a step down
            for (int x = 0; x + 1 < window.width; x++) {
                assert_int_equal(frame.pixels[y * window.width + x + 1], frame.pixels[(y + 1) * window.width + x]);
            }
        }
        free(frame.pixels);
    }
    gonio_camera_aravis.close(camera);
}

static double mean_of(void *camera, double exposure_s) {
    gonio_frame frame;
    gonio_error error = {0};
    if (capture(camera, (gonio_window){0, 0, 256, 256}, exposure_s, &frame, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    double sum = 0;
    for (int k = 0; k < 256 * 256; k++) {
        sum += frame.pixels[k];
    }
    free(frame.pixels);
    return sum / 65536;
}

// Its values grow with the logarithm of the exposure: the frame that comes has the exposure that was asked for.
static void exposures_are_set(void **state) {
    (void)state;
    need_fake();
    void *camera = open_camera("Mono16");
    const double at10 = mean_of(camera, 0.01), at100 = mean_of(camera, 0.1), again = mean_of(camera, 0.01);
    assert_true(at100 > 1.3 * at10);
    assert_near(again / at10, 1, 0.05);
    gonio_frame frame;
    gonio_error error = {0};
    assert_int_equal(capture(camera, (gonio_window){0, 0, 8, 8}, 1e-6, &frame, &error), GONIO_E_RANGE);
    assert_int_equal(capture(camera, (gonio_window){0, 0, 8, 8}, 11, &frame, &error), GONIO_E_RANGE);
    assert_non_null(strstr(error.message, "11 s was asked for"));
    gonio_camera_aravis.close(camera);
}

static void a_missing_camera_is_named(void **state) {
    (void)state;
    gonio_camera_aravis_config c;
    gonio_camera_aravis_defaults(&c);
    snprintf(c.id, sizeof c.id, "Nobody-1");
    void *device = NULL;
    gonio_error error = {0};
    assert_int_equal(gonio_camera_aravis_open(&c, &device, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "Nobody-1"));
    need_fake();
    snprintf(c.id, sizeof c.id, "Aravis-Fake-%s", SERIAL);
    snprintf(c.format, sizeof c.format, "Mono12p");
    assert_int_equal(gonio_camera_aravis_open(&c, &device, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "Mono12p"));
    c.format[0] = 0;
    snprintf(c.info.serial, sizeof c.info.serial, "OTHER");
    assert_int_equal(gonio_camera_aravis_open(&c, &device, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "OTHER was expected"));
}

static void a_lost_camera_is_waited_for(void **state) {
    (void)state;
    need_fake();
    void *camera = open_camera("Mono8");
    gonio_frame frame;
    gonio_error error = {0};
    const gonio_window window = {0, 0, 16, 16};
    assert_int_equal(capture(camera, window, 0.01, &frame, &error), GONIO_OK);
    free(frame.pixels);
    stop();
    if (!start(SERIAL)) {
        fail_msg("the fake camera does not come back");
    }
    if (capture(camera, window, 0.01, &frame, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    free(frame.pixels);
    gonio_camera_aravis.close(camera);
}

// At the camera's own rate every frame comes, with the exposure that was asked for; a capture ends that.
static void every_frame_of_a_stream(void **state) {
    (void)state;
    need_fake();
    void *camera = open_camera("Mono16");
    const gonio_window window = {0, 0, 256, 256};
    uint16_t pixels[256 * 256];
    const double at10 = mean_of(camera, 0.01), at30 = mean_of(camera, 0.03);
    gonio_error error = {0};
    for (int round = 0; round < 2; round++) {
        const double exposure_s = round == 0 ? 0.01 : 0.03;
        assert_int_equal(gonio_camera_aravis.stream(camera, exposure_s, 0, 5, &error), GONIO_OK);
        double last_s = -INFINITY;
        int64_t missing = 0;
        for (int k = 0; k < 12; k++) {
            gonio_frame frame = {.pixels = pixels};
            int64_t lost = -1;
            if (gonio_camera_aravis.next(camera, &window, 5, &frame, &lost, &error) != GONIO_OK) {
                fail_msg("%s", error.message);
            }
            assert_true(lost >= 0 && frame.stamp.clock_s > last_s && frame.exposure_s == exposure_s);
            missing += lost;
            last_s = frame.stamp.clock_s;
            double sum = 0;
            for (int i = 0; i < 256 * 256; i++) {
                sum += pixels[i];
            }
            assert_near(sum / 65536 / (round == 0 ? at10 : at30), 1, 0.05);
        }
        assert_true(missing < 1000); // a busy computer may miss some; no number is misread
    }
    assert_near(mean_of(camera, 0.01) / at10, 1, 0.05);
    gonio_frame frame = {.pixels = pixels};
    int64_t lost;
    assert_int_equal(gonio_camera_aravis.next(camera, &window, 1, &frame, &lost, &error), GONIO_E_DEVICE);
    int frames = -1;
    assert_int_equal(gonio_camera_aravis.latency(camera, 0.002, 0.02, &frames, &error), GONIO_OK);
    assert_int_equal(frames, 0);
    gonio_camera_aravis.close(camera);
}

static int end(void **state) {
    (void)state;
    stop();
    arv_shutdown();
    return 0;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tells_what_it_is),          cmocka_unit_test(windows_are_parts_of_the_frame),
        cmocka_unit_test(exposures_are_set),         cmocka_unit_test(every_frame_of_a_stream),
        cmocka_unit_test(a_missing_camera_is_named), cmocka_unit_test(a_lost_camera_is_waited_for),
    };
    return cmocka_run_group_tests(tests, NULL, end);
}
