// SPDX-License-Identifier: BSD-3-Clause
// A small finished session to damage, and an inventory of what must never get lost: every file by its SHA-256.
#pragma once
#include <math.h>
#include <setjmp.h>
#include <sqlite3.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
// cmocka needs those first
#include <cmocka.h>

#include "gonio/session.h"
#include "tests/unit/session_folder.h"

enum { STEPS = 8, FRAMES = 2 * STEPS };

static gonio_exposure make_exposure(int64_t step, int frame) {
    gonio_exposure e = {.frame = {.window = {0, 0, 12, 9}, .exposure_s = 0.01, .stamp = {step, frame, (double)step}},
                        .monitor = 1.0 / 3,
                        .monitor_sigma = 1e-3};
    e.frame.pixels = malloc(12 * 9 * sizeof(uint16_t));
    assert_non_null(e.frame.pixels);
    for (int i = 0; i < 12 * 9; i++) {
        e.frame.pixels[i] = (uint16_t)((i * 37 + step * 101 + frame * 11) % 4096);
    }
    return e;
}

static gonio_samples *make_samples(int64_t step) {
    gonio_samples *samples;
    assert_int_equal(gonio_samples_new(1, true, &samples, NULL), GONIO_OK);
    strcpy(samples->channel_names[0], "y");
    const gonio_pair pair = {0.01 * (double)step, 0, 0.5, 1};
    const double v = 0.3 + 0.01 * (double)step, r = 0.01, s = 0.02;
    assert_int_equal(gonio_samples_add(samples, &pair, &v, &r, &s, NULL), GONIO_OK);
    return samples;
}

static gonio_step step_of(int64_t i) {
    return (gonio_step){.index = i,
                        .kind = i == 0                     ? GONIO_STEP_DARK
                                : i == 1 || i == STEPS - 1 ? GONIO_STEP_REFERENCE
                                                           : GONIO_STEP_SAMPLE,
                        .pose = {0.1, 0, 0.01 * (double)i, 0}};
}

static gonio_status measure_step(gonio_session *session, int64_t i) {
    gonio_exposure exposures[2] = {make_exposure(i, 0), make_exposure(i, 1)};
    gonio_step step = step_of(i);
    gonio_samples *samples = step.kind == GONIO_STEP_SAMPLE ? make_samples(i) : NULL;
    step.clock_end_s = (double)i + 1;
    const gonio_status status = gonio_session_finish_step(session, &step, exposures, 2, samples, NULL);
    free(exposures[0].frame.pixels);
    free(exposures[1].frame.pixels);
    gonio_samples_free(samples);
    return status;
}

static void finish_results(gonio_session *session) {
    gonio_samples *samples;
    char hash[GONIO_SHA256_HEX];
    bool final;
    assert_int_equal(gonio_session_final_samples(session, &samples, &final, NULL), GONIO_OK);
    assert_int_equal(gonio_sha256_samples(samples, hash, NULL), GONIO_OK);
    assert_int_equal(gonio_session_put_final(session, samples, NULL), GONIO_OK);
    assert_int_equal(gonio_session_put(session, "result.samples_sha256", hash, NULL), GONIO_OK);
    gonio_samples_free(samples);
    assert_int_equal(shell("echo a model >%s/model.gonio", path), 0);
    char file[160];
    snprintf(file, sizeof file, "%s/model.gonio", path);
    assert_int_equal(gonio_sha256_file(file, hash, NULL), GONIO_OK);
    assert_int_equal(gonio_session_put(session, "result.model_sha256", hash, NULL), GONIO_OK);
    assert_int_equal(gonio_session_put(session, "result.model_path", "model.gonio", NULL), GONIO_OK);
}

static void make_session(void) {
    gonio_session *session;
    gonio_step steps[STEPS];
    for (int i = 0; i < STEPS; i++) {
        steps[i] = step_of(i);
    }
    assert_int_equal(gonio_session_create(path, &session, NULL), GONIO_OK);
    assert_int_equal(gonio_session_put(session, "camera.bits", "12", NULL), GONIO_OK);
    assert_int_equal(gonio_session_put(session, "plan", "poses.csv", NULL), GONIO_OK);
    assert_int_equal(gonio_session_put_steps(session, steps, STEPS, NULL), GONIO_OK);
    for (int64_t i = 0; i < STEPS; i++) {
        assert_int_equal(measure_step(session, i), GONIO_OK);
    }
    finish_results(session);
    gonio_session_close(session);
}

static void sql(const char *text) {
    char file[128];
    sqlite3 *db;
    snprintf(file, sizeof file, "%s/session.db", path);
    assert_int_equal(sqlite3_open(file, &db), SQLITE_OK);
    if (sqlite3_exec(db, text, NULL, NULL, NULL) != SQLITE_OK) {
        fail_msg("%s: %s", text, sqlite3_errmsg(db));
    }
    sqlite3_close(db);
}

// As the first releases wrote it: no chain, no log, no count of the steps.
static void to_version_1(void) {
    sql("DROP TABLE chain; DROP TABLE hosts; ALTER TABLE steps DROP COLUMN utc; ALTER TABLE frames DROP COLUMN utc;"
        "ALTER TABLE frames DROP COLUMN monotonic_s; ALTER TABLE frames DROP COLUMN bytes;"
        "DELETE FROM settings WHERE key = 'steps'; PRAGMA user_version = 1; VACUUM;");
    assert_int_equal(shell("rm -f %s/session.log", path), 0);
}

// ---- what is there ----

// Every file of a folder with its checksum into ROOT/NAME.
static void take_inventory(const char *folder, const char *name) {
    assert_int_equal(
        shell("cd %s && find . -type f -print0 | sort -z | xargs -0 -r sha256sum >%s/%s", folder, root, name), 0);
}

// Everything that the inventory has is in that folder, as it was.
static bool has_all(const char *folder, const char *name) {
    return shell("cd %s 2>/dev/null && sha256sum -c --quiet %s/%s >/dev/null 2>&1", folder, root, name) == 0;
}

// Names, contents and times: not even a look has left a trace.
static void take_trace(const char *name) {
    assert_int_equal(shell("cd %s && find . -printf '%%p %%s %%m %%T@ %%C@ %%i\\n' | sort >%s/%s", path, root, name),
                     0);
}
static bool same_file(const char *a, const char *b) { return shell("cmp -s %s/%s %s/%s", root, a, root, b) == 0; }

// The frames of the inventory that are, by content, neither in the session's frames/ nor in its lost+found/.
static int frames_lost(const char *inventory) {
    char command[1024];
    snprintf(
        command, sizeof command,
        "grep 'frames/0' %s/%s | cut -d' ' -f1 | sort >%s/wanted; find %s/frames %s/lost+found -type f 2>/dev/null |"
        " xargs -r sha256sum | cut -d' ' -f1 | sort >%s/there; comm -23 %s/wanted %s/there | wc -l",
        root, inventory, root, path, path, root, root, root);
    FILE *pipe = popen(command, "r");
    int n = -1;
    assert_non_null(pipe);
    assert_int_equal(fscanf(pipe, "%d", &n), 1);
    pclose(pipe);
    return n;
}

static bool exists(const char *format, ...) __attribute__((format(printf, 1, 2)));
static bool exists(const char *format, ...) {
    char name[256];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(name, sizeof name, format, arguments);
    va_end(arguments);
    return access(name, F_OK) == 0;
}
static bool leftover(void) { return shell("ls -d %s.repair* >/dev/null 2>&1", path) == 0; }
