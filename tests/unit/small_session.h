// SPDX-License-Identifier: BSD-3-Clause
// A session of five steps at `path`, made through the public functions, and ways to spoil it.
#pragma once
#include <math.h>
#include <sqlite3.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gonio/session.h"
#include "tests/unit/session_folder.h"

static uint32_t next(uint32_t *state) { return *state = *state * 1664525u + 1013904223u; }

static gonio_exposure make_exposure(int64_t step, int frame, int width, int height, int bits, uint32_t seed) {
    gonio_exposure e = {.frame = {.window = {3, 5, width, height},
                                  .exposure_s = 0.001 * (frame + 1) / 3.0,
                                  .gain_db = 0,
                                  .stamp = {step, frame, 12.1 * (double)step + frame / 7.0}},
                        .monitor = frame % 2 == 0 ? NAN : 1.0 / 3,
                        .monitor_sigma = 1e-3 / 3};
    const size_t n = (size_t)width * (size_t)height;
    e.frame.pixels = malloc(n * sizeof(uint16_t));
    assert_non_null(e.frame.pixels);
    for (size_t i = 0; i < n; i++) {
        e.frame.pixels[i] = (uint16_t)(next(&seed) >> (32 - bits));
    }
    return e;
}

static gonio_samples *make_samples(int64_t step, size_t n) {
    gonio_samples *samples;
    assert_int_equal(gonio_samples_new(3, true, &samples, NULL), GONIO_OK);
    const char *names[] = {"r", "g", "b"};
    for (int c = 0; c < 3; c++) {
        strcpy(samples->channel_names[c], names[c]);
    }
    for (size_t i = 0; i < n; i++) {
        const double x = (double)step + (double)i / 3;
        const gonio_pair pair = {x / 1000, 0, 1 / (1 + x), sqrt(x)};
        const double v[3] = {x, 1 / (x + 1), -x}, r[3] = {0.1, 0.2, 0.3}, s[3] = {1e-9, x / 7, 0};
        assert_int_equal(gonio_samples_add(samples, &pair, v, r, s, NULL), GONIO_OK);
    }
    return samples;
}

enum { STEPS = 5 };

static gonio_session *make_session(void) {
    gonio_session *session;
    gonio_error error = {0};
    assert_int_equal(gonio_session_create(path, &session, &error), GONIO_OK);
    gonio_step steps[STEPS];
    for (int i = 0; i < STEPS; i++) {
        steps[i] = (gonio_step){.index = i,
                                .kind = i == 0   ? GONIO_STEP_DARK
                                        : i == 1 ? GONIO_STEP_REFERENCE
                                                 : GONIO_STEP_SAMPLE,
                                .pose = {gonio_radians(10.1 * i), 0, gonio_radians(7.7 * i), gonio_radians(-33.3 * i)}};
    }
    assert_int_equal(gonio_session_begin(session, NULL), GONIO_OK);
    assert_int_equal(gonio_session_put(session, "camera.bits", "12", NULL), GONIO_OK);
    assert_int_equal(gonio_session_put_steps(session, steps, STEPS, NULL), GONIO_OK);
    assert_int_equal(gonio_session_commit(session, NULL), GONIO_OK);
    return session;
}

// Finish step k as the scan loop does: two frames, and k samples where it is a sample step.
static gonio_status finish(gonio_session *session, int64_t k, gonio_error *error) {
    gonio_exposure exposures[2] = {make_exposure(k, 0, 31, 17, 12, (uint32_t)k), make_exposure(k, 1, 16, 16, 12, 99)};
    gonio_samples *samples = k >= 2 ? make_samples(k, (size_t)k) : NULL;
    const gonio_step step = {.index = k, .clock_end_s = 10.0 * (double)k / 3, .exposure_end_s = 0.01 / 3};
    const gonio_status status = gonio_session_finish_step(session, &step, exposures, 2, samples, error);
    free(exposures[0].frame.pixels);
    free(exposures[1].frame.pixels);
    gonio_samples_free(samples);
    return status;
}

static void finish_all(gonio_session *session) {
    for (int64_t k = 0; k < STEPS; k++) {
        gonio_error error = {0};
        assert_int_equal(finish(session, k, &error), GONIO_OK);
    }
}

static gonio_session *reopen(bool writable) {
    gonio_session *session;
    gonio_error error = {0};
    assert_int_equal(gonio_session_open(path, writable, &session, &error), GONIO_OK);
    return session;
}

// How many rows the last statement changed.
static int sql(const char *text) {
    char file[128];
    sqlite3 *db;
    snprintf(file, sizeof file, "%s/session.db", path);
    assert_int_equal(sqlite3_open(file, &db), SQLITE_OK);
    assert_int_equal(sqlite3_exec(db, text, NULL, NULL, NULL), SQLITE_OK);
    const int changes = sqlite3_changes(db);
    sqlite3_close(db);
    return changes;
}

static void overwrite(const char *name, long offset, const char *bytes, size_t n) {
    char file[160];
    snprintf(file, sizeof file, "%s/%s", path, name);
    FILE *f = fopen(file, "r+b");
    assert_non_null(f);
    fseek(f, offset, SEEK_SET);
    fwrite(bytes, 1, n, f);
    fclose(f);
}
