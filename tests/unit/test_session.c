// SPDX-License-Identifier: BSD-3-Clause
// The session: what is stored comes back bit for bit, a step is there as a whole or not at all, and damage is found.
#include <fcntl.h>
#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <sqlite3.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "gonio/session.h"
#include "tests/unit/small_session.h"

static void test_settings_and_events(void **state) {
    (void)state;
    gonio_session *session = make_session();
    char *text;
    assert_int_equal(gonio_session_put(session, "notes", "line 1\nZ\xc3\xbcrich", NULL), GONIO_OK);
    assert_int_equal(gonio_session_put(session, "notes", "again", NULL), GONIO_OK);
    assert_int_equal(gonio_session_event(session, "test", "hello", NULL), GONIO_OK);
    gonio_session_close(session);
    session = reopen(false);
    assert_int_equal(gonio_session_get(session, "notes", &text, NULL), GONIO_OK);
    assert_string_equal(text, "again");
    free(text);
    gonio_error error = {0};
    assert_int_equal(gonio_session_get(session, "nothing", &text, &error), GONIO_E_INPUT);
    assert_null(text);
    assert_int_equal(gonio_session_events(session, &text, NULL), GONIO_OK);
    assert_non_null(strstr(text, "Z test: hello\n"));
    free(text);
    assert_int_equal(gonio_session_put(session, "notes", "read only", &error), GONIO_E_IO);
    gonio_session_close(session);
}

static void test_steps_come_back(void **state) {
    (void)state;
    gonio_session *session = make_session();
    finish_all(session);
    gonio_session_close(session);
    session = reopen(false);
    gonio_step *steps;
    size_t n;
    assert_int_equal(gonio_session_steps(session, &steps, &n, NULL), GONIO_OK);
    assert_int_equal(n, STEPS);
    for (int i = 0; i < STEPS; i++) {
        assert_true(steps[i].index == i && steps[i].done && steps[i].frames == 2);
        assert_true(steps[i].pose.theta_i == gonio_radians(10.1 * i) &&
                    steps[i].pose.phi_o == gonio_radians(-33.3 * i));
        assert_true(steps[i].clock_end_s == 10.0 * i / 3 && steps[i].exposure_end_s == 0.01 / 3);
    }
    free(steps);
    gonio_session_close(session);
}

static void test_frames_come_back(void **state) {
    (void)state;
    gonio_session *session = make_session();
    finish_all(session);
    gonio_exposure *exposures;
    int n;
    gonio_error error = {0};
    assert_int_equal(gonio_session_exposures(session, 3, &exposures, &n, &error), GONIO_OK);
    assert_int_equal(n, 2);
    for (int i = 0; i < n; i++) {
        const gonio_exposure e = i == 0 ? make_exposure(3, 0, 31, 17, 12, 3) : make_exposure(3, 1, 16, 16, 12, 99);
        const gonio_frame *f = &exposures[i].frame;
        assert_memory_equal(&f->window, &e.frame.window, sizeof f->window);
        assert_memory_equal(f->pixels, e.frame.pixels, (size_t)(f->window.width * f->window.height) * 2);
        assert_true(f->exposure_s == e.frame.exposure_s && f->stamp.clock_s == e.frame.stamp.clock_s);
        assert_true(f->stamp.pose == 3 && f->stamp.frame == i);
        assert_true(exposures[i].monitor == e.monitor || (isnan(exposures[i].monitor) && isnan(e.monitor)));
        assert_true(exposures[i].monitor_sigma == e.monitor_sigma);
        free(e.frame.pixels);
    }
    gonio_exposures_free(exposures, n);
    gonio_session_close(session);
}

// Every depth that cameras have, the extreme words included, through the PNG and back.
static void test_every_depth(void **state) {
    (void)state;
    static const int depths[] = {1, 8, 10, 12, 14, 16};
    for (size_t d = 0; d < sizeof depths / sizeof *depths; d++) {
        char text[8];
        snprintf(path, sizeof path, "%s/depth%d", root, depths[d]);
        snprintf(text, sizeof text, "%d", depths[d]);
        gonio_session *session = make_session();
        assert_int_equal(gonio_session_put(session, "camera.bits", text, NULL), GONIO_OK);
        gonio_exposure e = make_exposure(0, 0, 7, 3, depths[d], 5), *back;
        e.frame.pixels[0] = 0;
        e.frame.pixels[20] = (uint16_t)((1u << depths[d]) - 1);
        const gonio_step step = {.index = 0};
        assert_int_equal(gonio_session_finish_step(session, &step, &e, 1, NULL, NULL), GONIO_OK);
        int n;
        assert_int_equal(gonio_session_exposures(session, 0, &back, &n, NULL), GONIO_OK);
        assert_memory_equal(back->frame.pixels, e.frame.pixels, 21 * sizeof(uint16_t));
        gonio_exposures_free(back, n);
        free(e.frame.pixels);
        gonio_session_close(session);
    }
}

static void test_more_bits_than_stated(void **state) {
    (void)state;
    gonio_session *session = make_session();
    gonio_exposure e = make_exposure(0, 0, 8, 8, 12, 1);
    e.frame.pixels[40] = 4096;
    const gonio_step step = {.index = 0};
    gonio_error error = {0};
    assert_int_equal(gonio_session_finish_step(session, &step, &e, 1, NULL, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "more bits"));
    free(e.frame.pixels);
    gonio_session_close(session);
}

static void test_samples_come_back(void **state) {
    (void)state;
    gonio_session *session = make_session();
    finish_all(session);
    gonio_samples *samples;
    assert_int_equal(gonio_session_samples(session, &samples, NULL), GONIO_OK);
    assert_int_equal(samples->n, 2 + 3 + 4);
    assert_string_equal(samples->channel_names[2], "b");
    size_t at = 0;
    for (int64_t k = 2; k < STEPS; k++) {
        gonio_samples *expected = make_samples(k, (size_t)k);
        assert_memory_equal(samples->pairs + at, expected->pairs, (size_t)k * sizeof(gonio_pair));
        assert_memory_equal(samples->values + 3 * at, expected->values, (size_t)k * 24);
        assert_memory_equal(samples->sigma_random + 3 * at, expected->sigma_random, (size_t)k * 24);
        assert_memory_equal(samples->sigma_systematic + 3 * at, expected->sigma_systematic, (size_t)k * 24);
        at += (size_t)k;
        gonio_samples_free(expected);
    }
    gonio_samples_free(samples);
    gonio_session_close(session);
}

static void test_final_samples(void **state) {
    (void)state;
    gonio_session *session = make_session();
    finish_all(session);
    gonio_samples *samples, *back;
    bool final;
    assert_int_equal(gonio_session_final_samples(session, &samples, &final, NULL), GONIO_OK);
    assert_false(final);
    for (size_t i = 0; i < samples->n * 3; i++) {
        samples->sigma_random[i] += (double)i / 3;
        samples->sigma_systematic[i] += (double)i;
        samples->values[i] *= 1.01;
    }
    assert_int_equal(gonio_session_put_final(session, samples, NULL), GONIO_OK);
    assert_int_equal(gonio_session_final_samples(session, &back, &final, NULL), GONIO_OK);
    assert_true(final);
    assert_memory_equal(back->sigma_random, samples->sigma_random, samples->n * 24);
    assert_memory_equal(back->sigma_systematic, samples->sigma_systematic, samples->n * 24);
    assert_memory_equal(back->values, samples->values, samples->n * 24);
    gonio_samples_free(back);
    // A step that is taken back takes the final samples with it.
    assert_int_equal(gonio_session_undo_step(session, 3, "test", NULL), GONIO_OK);
    assert_int_equal(gonio_session_final_samples(session, &back, &final, NULL), GONIO_OK);
    assert_false(final);
    assert_int_equal(back->n, 2 + 4);
    gonio_samples_free(back);
    samples->n--; // no longer what the journal holds
    gonio_error error = {0};
    assert_int_equal(gonio_session_put_final(session, samples, &error), GONIO_E_FAILED);
    gonio_samples_free(samples);
    gonio_session_close(session);
}

static void test_a_step_is_finished_once(void **state) {
    (void)state;
    gonio_session *session = make_session();
    gonio_error error = {0};
    assert_int_equal(finish(session, 0, &error), GONIO_OK);
    assert_true(finish(session, 0, &error) < 0);
    assert_true(finish(session, 77, &error) < 0);
    gonio_step *steps;
    size_t n;
    assert_int_equal(gonio_session_steps(session, &steps, &n, NULL), GONIO_OK);
    assert_true(steps[0].done && !steps[1].done);
    free(steps);
    gonio_session_close(session);
}

// Killed after the files were renamed and before the journal knew: the step is not done, and the files are set aside.
static void test_killed_before_entered(void **state) {
    (void)state;
    gonio_session *session = make_session();
    assert_int_equal(finish(session, 0, NULL), GONIO_OK);
    gonio_session_close(session);
    char file[160];
    static const char *const left[] = {"000001-00.png", ".000001-01.png.new", "junk"};
    for (int i = 0; i < 3; i++) {
        snprintf(file, sizeof file, "%s/frames/%s", path, left[i]);
        fclose(fopen(file, "w"));
    }
    session = reopen(true);
    int moved;
    assert_int_equal(gonio_session_sweep(session, &moved, NULL), GONIO_OK);
    assert_int_equal(moved, 2);
    assert_int_equal(access(file, F_OK), 0); // junk is nobody's business
    for (int i = 0; i < 2; i++) {
        snprintf(file, sizeof file, "%s/frames/%s", path, left[i]);
        assert_int_equal(access(file, F_OK), -1);
        snprintf(file, sizeof file, "%s/lost+found/%s", path, left[i]);
        assert_int_equal(access(file, F_OK), 0);
    }
    snprintf(file, sizeof file, "%s/frames/000000-00.png", path);
    assert_int_equal(access(file, F_OK), 0);
    char *events;
    assert_int_equal(gonio_session_events(session, &events, NULL), GONIO_OK);
    assert_non_null(strstr(events, "000001-00.png"));
    free(events);
    gonio_session_close(session);
}

// A process that dies without closing anything: all committed steps are there.
static void test_killed_process(void **state) {
    (void)state;
    gonio_session_close(make_session());
    const pid_t child = fork();
    if (child == 0) {
        gonio_session *session;
        if (gonio_session_open(path, true, &session, NULL) != GONIO_OK) {
            _exit(1);
        }
        for (int64_t k = 0; k < 3; k++) {
            if (finish(session, k, NULL) != GONIO_OK) {
                _exit(1);
            }
        }
        kill(getpid(), SIGKILL);
    }
    int status;
    waitpid(child, &status, 0);
    assert_true(WIFSIGNALED(status));
    gonio_session *session = reopen(false);
    gonio_step *steps;
    size_t n;
    assert_int_equal(gonio_session_steps(session, &steps, &n, NULL), GONIO_OK);
    assert_true(steps[2].done && !steps[3].done);
    free(steps);
    gonio_session_close(session);
    gonio_doctor_report report;
    assert_int_equal(gonio_session_doctor(path, false, &report, NULL), GONIO_OK);
    assert_true(report.database_ok && report.steps_done == 3 && report.frames == 6 && report.frames_bad == 0);
}

static void test_one_writer(void **state) {
    (void)state;
    gonio_session *session = make_session(), *second;
    gonio_error error = {0};
    assert_int_equal(gonio_session_open(path, true, &second, &error), GONIO_E_FAILED);
    assert_non_null(strstr(error.message, "another process"));
    assert_int_equal(gonio_session_open(path, false, &second, &error), GONIO_OK);
    gonio_session_close(second);
    gonio_session_close(session);
    assert_int_equal(gonio_session_create(path, &second, &error), GONIO_E_USAGE);
}

static void test_what_is_no_session(void **state) {
    (void)state;
    gonio_session *session;
    gonio_error error = {0};
    assert_int_equal(gonio_session_open(path, false, &session, &error), GONIO_E_INPUT);
    gonio_session_close(make_session());
    sql("PRAGMA user_version = 3");
    assert_int_equal(gonio_session_open(path, true, &session, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.message, "version 3"));
    gonio_doctor_report report;
    assert_int_equal(gonio_session_doctor(path, true, &report, &error), GONIO_E_INPUT);
    sql("PRAGMA user_version = 2; PRAGMA application_id = 7");
    assert_int_equal(gonio_session_open(path, true, &session, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.message, "another application"));
}

// The disk's end, by the process' own limit on file sizes: a clean error, and the session goes on afterwards.
static void test_full_disk(void **state) {
    (void)state;
    gonio_session *session = make_session();
    assert_int_equal(finish(session, 0, NULL), GONIO_OK);
    struct rlimit before, small;
    getrlimit(RLIMIT_FSIZE, &before);
    signal(SIGXFSZ, SIG_IGN);
    small = (struct rlimit){512, before.rlim_max};
    setrlimit(RLIMIT_FSIZE, &small);
    gonio_error error = {0};
    const gonio_status status = finish(session, 1, &error);
    setrlimit(RLIMIT_FSIZE, &before);
    assert_int_equal(status, GONIO_E_IO);
    assert_int_equal(finish(session, 1, &error), GONIO_OK);
    gonio_session_close(session);
    gonio_doctor_report report;
    assert_int_equal(gonio_session_doctor(path, false, &report, NULL), GONIO_OK);
    assert_true(report.steps_done == 2 && report.frames_bad == 0 && report.strays == 0);
}

static void remove_file(const char *name) {
    char file[160];
    snprintf(file, sizeof file, "%s/%s", path, name);
    assert_int_equal(unlink(file), 0);
}

static void test_doctor_finds_bad_frames(void **state) {
    (void)state;
    gonio_session *session = make_session();
    finish_all(session);
    gonio_session_close(session);
    char file[160];
    snprintf(file, sizeof file, "%s/frames/000002-00.png", path);
    assert_int_equal(truncate(file, 200), 0);
    snprintf(file, sizeof file, "%s/frames/000004-01.png", path);
    assert_int_equal(unlink(file), 0);
    // A sound PNG of other pixels: only the checksum tells.
    char copy[512];
    snprintf(copy, sizeof copy, "cd %s/frames && cp 000002-01.png 000003-01.png && cp 000003-00.png 000004-00.png",
             path);
    assert_int_equal(system(copy), 0);
    gonio_doctor_report report;
    assert_int_equal(gonio_session_doctor(path, false, &report, NULL), GONIO_OK);
    assert_true(report.database_ok);
    assert_int_equal(report.frames, 10);
    assert_int_equal(report.frames_bad, 3); // 000003-01 holds the same pixels as 000002-01 did
    assert_int_equal(report.steps_lost, 2);
    assert_non_null(strstr(report.detail, "000002-00.png"));
    assert_int_equal(gonio_session_doctor(path, true, &report, NULL), GONIO_OK);
    session = reopen(true);
    gonio_step *steps;
    size_t n;
    assert_int_equal(gonio_session_steps(session, &steps, &n, NULL), GONIO_OK);
    assert_true(steps[0].done && steps[1].done && !steps[2].done && steps[3].done && !steps[4].done);
    free(steps);
    assert_int_equal(finish(session, 2, NULL), GONIO_OK);
    assert_int_equal(finish(session, 4, NULL), GONIO_OK);
    gonio_session_close(session);
    assert_int_equal(gonio_session_doctor(path, false, &report, NULL), GONIO_OK);
    assert_true(report.database_ok && report.frames_bad == 0 && report.samples_bad == 0 && report.strays == 0);
    assert_string_equal(report.detail, "");
}

// A lost dark or reference step undoes the samples that stand on it; a row of bad samples is taken from session.log.
static void test_doctor_and_samples(void **state) {
    (void)state;
    gonio_session *session = make_session();
    finish_all(session);
    gonio_session_close(session);
    sql("UPDATE samples SET rows = zeroblob(length(rows)) WHERE step = 3");
    gonio_doctor_report report;
    assert_int_equal(gonio_session_doctor(path, true, &report, NULL), GONIO_OK);
    assert_true(report.repaired && !report.database_ok && report.rows_lost == 0 && report.steps_lost == 0);
    session = reopen(false);
    gonio_samples *samples;
    assert_int_equal(gonio_session_step_samples(session, 3, &samples, NULL), GONIO_OK);
    assert_int_equal(samples->n, 3);
    gonio_samples_free(samples);
    assert_int_equal(gonio_session_step_samples(session, 4, &samples, NULL), GONIO_OK);
    assert_int_equal(samples->n, 4);
    gonio_samples_free(samples);
    gonio_session_close(session);
    char file[160];
    snprintf(file, sizeof file, "%s/frames/000001-00.png", path);
    assert_int_equal(unlink(file), 0);
    assert_int_equal(gonio_session_doctor(path, true, &report, NULL), GONIO_OK);
    session = reopen(false);
    gonio_step *steps;
    size_t n;
    assert_int_equal(gonio_session_steps(session, &steps, &n, NULL), GONIO_OK);
    assert_true(!steps[1].done && steps[4].done);
    free(steps);
    assert_int_equal(gonio_session_step_samples(session, 4, &samples, NULL), GONIO_OK);
    assert_null(samples);
    gonio_session_close(session);
}

static void test_doctor_salvages_a_damaged_journal(void **state) {
    (void)state;
    gonio_session *session;
    assert_int_equal(gonio_session_create(path, &session, NULL), GONIO_OK);
    enum { MANY = 2000 };
    gonio_step *steps = calloc(MANY, sizeof *steps);
    for (int i = 0; i < MANY; i++) {
        steps[i] = (gonio_step){.index = i, .kind = GONIO_STEP_SAMPLE, .pose = {0.1, 0.2, 0.3, 1e-3 * i}};
    }
    assert_int_equal(gonio_session_put(session, "camera.bits", "12", NULL), GONIO_OK);
    assert_int_equal(gonio_session_put_steps(session, steps, MANY, NULL), GONIO_OK);
    free(steps);
    for (int64_t k = 2; k < 5; k++) {
        assert_int_equal(finish(session, k, NULL), GONIO_OK);
    }
    gonio_session_close(session);
    // Wipe one page in the middle of the file: part of the steps' table.
    char junk[4096];
    memset(junk, 0xa5, sizeof junk);
    overwrite("session.db", 4096 * 20, junk, sizeof junk);
    gonio_doctor_report report;
    gonio_error error = {0};
    assert_int_equal(gonio_session_doctor(path, false, &report, &error), GONIO_OK);
    assert_false(report.database_ok);
    assert_int_equal(gonio_session_doctor(path, true, &report, &error), GONIO_OK);
    assert_true(report.repaired && report.rows_lost == 0);
    assert_int_equal(gonio_session_doctor(path, false, &report, &error), GONIO_OK);
    assert_string_equal(report.detail, "");
    assert_true(gonio_doctor_sound(&report) && report.steps == MANY && report.frames == 6);
    // The same without session.log: what the damaged page held is lost, and told.
    overwrite("session.db", 4096 * 20, junk, sizeof junk);
    remove_file("session.log");
    assert_int_equal(gonio_session_doctor(path, true, &report, &error), GONIO_OK);
    assert_true(report.repaired && report.rows_lost > 0);
    assert_int_equal(gonio_session_doctor(path, false, &report, &error), GONIO_OK);
    assert_non_null(strstr(report.detail, "has lost step"));
    assert_true(report.database_ok && report.steps + report.steps_missing == MANY);
    assert_true(report.steps > MANY * 3 / 4 && report.steps < MANY);
    assert_int_equal(report.frames, 6);
    assert_int_equal(report.frames_bad, 0);
    // Not a database at all, and no log: said so, nothing lost.
    overwrite("session.db", 0, junk, sizeof junk);
    remove_file("session.log");
    assert_int_equal(gonio_session_doctor(path, false, &report, &error), GONIO_OK);
    assert_false(report.database_ok);
    assert_int_equal(gonio_session_doctor(path, true, &report, &error), GONIO_E_INPUT);
    assert_int_equal(gonio_session_open(path, false, &session, &error), GONIO_E_INPUT);
}

static void test_sha256(void **state) {
    (void)state;
    // FIPS 180-2, appendix B.1.
    char hex[GONIO_SHA256_HEX];
    assert_int_equal(gonio_sha256("abc", 3, hex, NULL), GONIO_OK);
    assert_string_equal(hex, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

int main(void) {
#define T(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        T(test_settings_and_events),
        T(test_steps_come_back),
        T(test_frames_come_back),
        T(test_every_depth),
        T(test_more_bits_than_stated),
        T(test_samples_come_back),
        T(test_final_samples),
        T(test_a_step_is_finished_once),
        T(test_killed_before_entered),
        T(test_killed_process),
        T(test_one_writer),
        T(test_what_is_no_session),
        T(test_full_disk),
        T(test_doctor_finds_bad_frames),
        T(test_doctor_and_samples),
        T(test_doctor_salvages_a_damaged_journal),
        T(test_sha256),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
