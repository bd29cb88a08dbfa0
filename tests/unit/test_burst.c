// SPDX-License-Identifier: BSD-3-Clause
// Frames stored as they are, bursts of them, and compressing afterwards: the pixels and their checksums never change.
#include <fcntl.h>
#include <math.h>
#include <png.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "gonio/session.h"
#include "tests/unit/session_folder.h"

enum { WIDTH = 64, HEIGHT = 48, PIXELS = WIDTH * HEIGHT, STEPS = 4, BITS = 12 };
static gonio_step steps[STEPS];

static gonio_session *make_session(void) {
    gonio_session *session;
    for (int i = 0; i < STEPS; i++) {
        steps[i] = (gonio_step){.index = i, .kind = GONIO_STEP_BURST};
    }
    assert_int_equal(gonio_session_create(path, &session, NULL), GONIO_OK);
    assert_int_equal(gonio_session_put(session, "camera.bits", "12", NULL), GONIO_OK);
    assert_int_equal(gonio_session_put_steps(session, steps, STEPS, NULL), GONIO_OK);
    return session;
}

// A smooth picture with a little noise, so that compressing has something to do.
static uint16_t value(int number, int i) {
    return (uint16_t)((unsigned)(number * 37 + i / 8 + (i * 7919 % 5)) & ((1u << BITS) - 1));
}

static gonio_frame make_frame(int number, uint16_t *pixels) {
    for (int i = 0; i < PIXELS; i++) {
        pixels[i] = value(number, i);
    }
    return (gonio_frame){
        .window = {2, 3, WIDTH, HEIGHT}, .exposure_s = 0.01, .stamp = {0, 0, number / 60.0}, .pixels = pixels};
}

static void file_of(int step, int frame, char name[160]) {
    snprintf(name, 160, "%s/frames/%06d-%02d.png", path, step, frame);
}

static off_t size_of(int step, int frame) {
    char name[160];
    struct stat info;
    file_of(step, frame, name);
    assert_int_equal(stat(name, &info), 0);
    return info.st_size;
}

// What any viewer sees: libpng's own simple reader, 16-bit grey with the sensor's bits at the top.
static void check_file(int step, int frame, int number) {
    char name[160];
    file_of(step, frame, name);
    png_image image = {.version = PNG_IMAGE_VERSION};
    assert_true(png_image_begin_read_from_file(&image, name));
    assert_int_equal(image.width, WIDTH);
    assert_int_equal(image.height, HEIGHT);
    image.format = PNG_FORMAT_LINEAR_Y;
    uint16_t *pixels = malloc(PNG_IMAGE_SIZE(image));
    // The reader takes the file for sRGB and gives linear light: black stays black and brighter stays brighter.
    assert_true(png_image_finish_read(&image, NULL, pixels, 0, NULL));
    for (int i = 0; i < PIXELS; i++) {
        for (int k = 1; k <= 16 && i + k < PIXELS; k *= 4) {
            const int stored = value(number, i) - value(number, i + k), seen = pixels[i] - pixels[i + k];
            assert_true((stored > 0) == (seen > 0) || stored == 0 || seen == 0);
        }
    }
    free(pixels);
}

static void check_frames(int frames, int group) {
    gonio_session *session;
    assert_int_equal(gonio_session_open(path, false, &session, NULL), GONIO_OK);
    for (int number = 0; number < frames;) {
        gonio_exposure *exposures;
        int n;
        gonio_error error = {0};
        if (gonio_session_exposures(session, number / group, &exposures, &n, &error) != GONIO_OK) {
            fail_msg("%s", error.message);
        }
        assert_int_equal(n, frames - number < group ? frames - number : group);
        for (int i = 0; i < n; i++, number++) {
            assert_true(exposures[i].frame.stamp.clock_s == number / 60.0);
            for (int k = 0; k < PIXELS; k++) {
                assert_int_equal(exposures[i].frame.pixels[k], value(number, k));
            }
        }
        gonio_exposures_free(exposures, n);
    }
    gonio_session_close(session);
}

static void burst(gonio_session *session, int frames, int group, gonio_burst_counts *counts) {
    gonio_burst *b;
    gonio_error error = {0};
    const gonio_burst_options options = {
        {2, 3, WIDTH, HEIGHT}, group, 2 * (size_t)group * PIXELS * sizeof(uint16_t), steps, STEPS};
    assert_int_equal(gonio_burst_open(session, &options, &b, &error), GONIO_OK);
    for (int i = 0; i < frames; i++) {
        gonio_frame frame;
        assert_int_equal(gonio_burst_room(b, &frame, &error), GONIO_OK);
        assert_int_equal(gonio_burst_room(b, &frame, &error), GONIO_OK); // asked again: the same room
        const gonio_frame made = make_frame(i, frame.pixels);
        gonio_burst_put(b, &made);
    }
    if (gonio_burst_close(b, counts, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
}

static void check_sound(void) {
    gonio_doctor_report report;
    assert_int_equal(gonio_session_doctor(path, false, &report, NULL), GONIO_OK);
    if (!report.database_ok || report.frames_bad != 0 || report.samples_bad != 0 || report.strays != 0) {
        fail_msg("%s", report.detail);
    }
}

static void test_burst_is_stored_in_groups_and_order(void **state) {
    (void)state;
    gonio_session *session = make_session();
    gonio_burst_counts counts;
    burst(session, 25, 10, &counts);
    assert_int_equal(counts.stored, 25);
    assert_int_equal(counts.groups, 3);
    assert_true(counts.most_waiting <= 20);
    gonio_session_close(session);
    check_frames(25, 10);
    check_file(1, 3, 13);
    assert_true(size_of(0, 0) > PIXELS * 2); // as they are
    check_sound();
}

static void test_compressing_changes_no_pixel(void **state) {
    (void)state;
    gonio_session *session = make_session();
    burst(session, 25, 10, NULL);
    const off_t before = size_of(2, 4);
    int64_t saved = 0, again = -1;
    assert_int_equal(gonio_session_compress(session, 0, &saved, NULL), GONIO_OK);
    const off_t after = size_of(2, 4);
    assert_true(after < before);
    assert_true(saved > 20 * (before - after) && saved < 30 * (before - after));
    assert_int_equal(gonio_session_compress(session, 0, &again, NULL), GONIO_OK);
    assert_int_equal(again, 0);
    gonio_session_close(session);
    check_frames(25, 10);
    check_file(1, 3, 13);
    check_sound();
}

// Plain or compressed, a frame has the same checksum in the journal.
static void test_checksums_are_of_pixels(void **state) {
    (void)state;
    gonio_session *session = make_session();
    static uint16_t pixels[PIXELS];
    for (int k = 0; k < 2; k++) {
        const gonio_exposure exposure = {.frame = make_frame(5, pixels), .monitor = NAN, .monitor_sigma = NAN};
        gonio_session_set_plain(session, k == 1);
        assert_int_equal(gonio_session_finish_step(session, &steps[k], &exposure, 1, NULL, NULL), GONIO_OK);
    }
    gonio_session_close(session);
    assert_true(size_of(1, 0) > size_of(0, 0));
    char command[256];
    snprintf(command, sizeof command,
             "test \"$(sqlite3 '%s/session.db' 'select count(distinct sha256) from frames')\" = 1", path);
    if (system("command -v sqlite3 >/dev/null") == 0) {
        assert_int_equal(system(command), 0);
    }
    check_sound();
}

static void test_a_damaged_frame_is_not_compressed_over(void **state) {
    (void)state;
    gonio_session *session = make_session();
    burst(session, 10, 10, NULL);
    char name[160];
    file_of(0, 7, name);
    const int fd = open(name, O_RDWR);
    assert_true(pwrite(fd, "\x55", 1, size_of(0, 7) / 2) == 1);
    close(fd);
    int64_t saved;
    gonio_error error = {0};
    assert_int_equal(gonio_session_compress(session, 0, &saved, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.file, "000000-07"));
    gonio_session_close(session);
    gonio_doctor_report report;
    assert_int_equal(gonio_session_doctor(path, false, &report, NULL), GONIO_OK);
    assert_int_equal(report.frames_bad, 1);
}

// A disk that takes no more ends the burst with an error; what was entered before is whole, and nothing else is left.
static void test_a_full_disk_ends_a_burst(void **state) {
    (void)state;
    gonio_session *session = make_session();
    gonio_burst *b;
    gonio_error error = {0};
    const gonio_burst_options options = {{2, 3, WIDTH, HEIGHT}, 2, 4 * (size_t)PIXELS * sizeof(uint16_t), steps, STEPS};
    assert_int_equal(gonio_burst_open(session, &options, &b, &error), GONIO_OK);
    struct rlimit before, small;
    getrlimit(RLIMIT_FSIZE, &before);
    small = before;
    small.rlim_cur = PIXELS; // half a frame
    signal(SIGXFSZ, SIG_IGN);
    setrlimit(RLIMIT_FSIZE, &small);
    gonio_status status = GONIO_OK;
    for (int i = 0; i < 40 && status == GONIO_OK; i++) {
        gonio_frame frame;
        status = gonio_burst_room(b, &frame, &error);
        if (status == GONIO_OK) {
            const gonio_frame made = make_frame(i, frame.pixels);
            gonio_burst_put(b, &made);
        }
    }
    setrlimit(RLIMIT_FSIZE, &before);
    assert_int_equal(status, GONIO_E_IO);
    assert_non_null(strstr(error.message, "cannot store frames/"));
    assert_int_equal(gonio_burst_close(b, NULL, &error), GONIO_E_IO);
    gonio_session_close(session);
    check_sound();
}

static void test_what_cannot_be_is_refused(void **state) {
    (void)state;
    gonio_session *session = make_session();
    gonio_burst *b;
    gonio_error error = {0};
    gonio_burst_options options = {{0, 0, WIDTH, HEIGHT}, 10, 19 * PIXELS * sizeof(uint16_t), steps, STEPS};
    assert_int_equal(gonio_burst_open(session, &options, &b, &error), GONIO_E_RANGE); // less than two groups
    assert_null(b);
    options = (gonio_burst_options){{0, 0, WIDTH, HEIGHT}, 1, 4 * PIXELS * sizeof(uint16_t), steps, 2};
    assert_int_equal(gonio_burst_open(session, &options, &b, &error), GONIO_OK);
    gonio_status status = GONIO_OK;
    for (int i = 0; i < 20 && status == GONIO_OK; i++) { // more frames than steps
        gonio_frame frame;
        status = gonio_burst_room(b, &frame, &error);
        if (status == GONIO_OK) {
            const gonio_frame made = make_frame(i, frame.pixels);
            gonio_burst_put(b, &made);
        }
    }
    assert_int_equal(gonio_burst_close(b, NULL, &error), GONIO_E_RANGE);
    gonio_session_close(session);
    check_frames(2, 1);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_burst_is_stored_in_groups_and_order, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_compressing_changes_no_pixel, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_checksums_are_of_pixels, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_a_damaged_frame_is_not_compressed_over, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_a_full_disk_ends_a_burst, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_what_cannot_be_is_refused, set_up, tear_down),
    };
    return cmocka_run_group_tests_name("burst", tests, NULL, NULL);
}
