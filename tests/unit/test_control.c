// SPDX-License-Identifier: BSD-3-Clause
// A measurement that other programs steer: names and who has them, answers while it works, pause, stop, and a disk that
// has no room. Whatever happens on the way, the samples are those of an undisturbed one.
#include <fcntl.h>
#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cmocka.h>

#include "gonio/gonio.h"
#include "host/control/internal.h"
#include "tests/unit/session_folder.h"

static int begin(void **state) {
    const int failed = set_up(state);
    setenv("XDG_RUNTIME_DIR", root, 1);
    return failed;
}

// ---- the module ----

static void names_belong_to_one(void **state) {
    (void)state;
    gonio_control *one, *other;
    gonio_error error = {0};
    char answer[GONIO_CONTROL_ANSWER];
    assert_int_equal(gonio_control_new(&one, &error), GONIO_OK);
    assert_int_equal(gonio_control_new(&other, &error), GONIO_OK);
    assert_int_equal(gonio_control_request(GONIO_CONTROL_RIG, "a", "status", answer, &error), GONIO_E_FAILED);
    assert_int_equal(gonio_control_listen(one, GONIO_CONTROL_RIG, "a", &error), GONIO_OK);
    assert_int_equal(gonio_control_listen(other, GONIO_CONTROL_RIG, "a", &error), GONIO_E_FAILED);
    // Another kind and another identity are other names.
    assert_int_equal(gonio_control_listen(other, GONIO_CONTROL_SESSION, "a", &error), GONIO_OK);
    assert_int_equal(gonio_control_listen(other, GONIO_CONTROL_RIG, "b", &error), GONIO_OK);
    gonio_control_tell(one, "\"done\":3");
    assert_int_equal(gonio_control_request(GONIO_CONTROL_RIG, "a", "status", answer, &error), GONIO_OK);
    assert_non_null(strstr(answer, "\"stopping\":false,\"paused\":false,\"done\":3}"));
    assert_int_equal(gonio_control_request(GONIO_CONTROL_RIG, "a", "pause", answer, &error), GONIO_OK);
    assert_true(gonio_control_paused(one) && !gonio_control_paused(other));
    assert_int_equal(gonio_control_request(GONIO_CONTROL_RIG, "a", "go", answer, &error), GONIO_OK);
    assert_true(!gonio_control_paused(one) && !gonio_control_stopping(one));
    assert_int_equal(gonio_control_request(GONIO_CONTROL_RIG, "a", "stop", answer, &error), GONIO_OK);
    assert_true(gonio_control_stopping(one) && !gonio_control_stopping(other));
    assert_false(gonio_control_wait_gone(GONIO_CONTROL_RIG, "a", 0.1));
    gonio_control_free(one);
    assert_true(gonio_control_wait_gone(GONIO_CONTROL_RIG, "a", 0.1));
    // What was given back can be had, and a name of its own can be taken anew.
    assert_int_equal(gonio_control_listen(other, GONIO_CONTROL_RIG, "a", &error), GONIO_OK);
    assert_int_equal(gonio_control_listen(other, GONIO_CONTROL_RIG, "a", &error), GONIO_OK);
    gonio_control_leave(other, GONIO_CONTROL_RIG);
    assert_int_equal(gonio_control_request(GONIO_CONTROL_RIG, "a", "status", answer, &error), GONIO_E_FAILED);
    gonio_control_free(other);
    gonio_control_free(NULL);
}

static int folder_mode(void) {
    struct stat info;
    char folder[300];
    snprintf(folder, sizeof folder, "%s/gonio", root);
    return stat(folder, &info) == 0 ? (int)(info.st_mode & 0777) : -1;
}

static void folders_that_others_may_enter_are_not_used(void **state) {
    (void)state;
    char folder[300], victim[300];
    snprintf(folder, sizeof folder, "%s/gonio", root);
    snprintf(victim, sizeof victim, "%s/victim", root);
    int fd = gonio_control_folder(0, true);
    assert_true(fd >= 0 && folder_mode() == 0700);
    close(fd);
    for (int mode = 0701; mode <= 0777; mode++) {
        assert_int_equal(chmod(folder, (mode_t)mode), 0);
        assert_int_equal(gonio_control_folder(0, true), -1);
    }
    assert_int_equal(rmdir(folder), 0);
    assert_int_equal(mkdir(victim, 0700), 0);
    assert_int_equal(symlink(victim, folder), 0);
    assert_int_equal(gonio_control_folder(0, true), -1);
    unlink(folder);
    setenv("XDG_RUNTIME_DIR", "relative", 1);
    assert_int_equal(gonio_control_folder(0, true), -1);
    setenv("XDG_RUNTIME_DIR", root, 1);
    // However long the folder's path, the socket has its name.
    char deep[300];
    snprintf(deep, sizeof deep, "%s/%0150d", root, 0);
    assert_int_equal(mkdir(deep, 0700), 0);
    setenv("XDG_RUNTIME_DIR", deep, 1);
    gonio_control *c;
    char answer[GONIO_CONTROL_ANSWER];
    assert_int_equal(gonio_control_new(&c, NULL), GONIO_OK);
    assert_int_equal(gonio_control_listen(c, GONIO_CONTROL_RIG, "a", NULL), GONIO_OK);
    assert_int_equal(gonio_control_request(GONIO_CONTROL_RIG, "a", "status", answer, NULL), GONIO_OK);
    gonio_control_free(c);
}

// ---- a measure ----

#define QUICK                                                                                                          \
    "camera.width=44,camera.height=44,camera.white_e_per_s=4e6,camera.exposure_max_s=0.06,camera.exposure_min_s=1e-6," \
    "sample.region_radius_mm=1,scan.settle_s=0.05,scan.audit_poses=0"

// No room while this is above 0, which every look lowers. In place of libc's.
static atomic_int tight;
int fstatvfs(int fd, struct statvfs *out) {
    *out = (struct statvfs){.f_blocks = 1 << 30, .f_frsize = 4096};
    const bool none = fcntl(fd, F_GETFD) >= 0 && atomic_load(&tight) > 0 && atomic_fetch_sub(&tight, 1) > 0;
    out->f_bavail = none ? 100 : 1 << 29;
    return 0;
}

typedef struct watcher {
    char identity[300];
    const char *word; // sent to oneself at this pose
    size_t at, pauses;
    bool stop_in_pause, go_in_pause, tighten;
    char notes[2000], told[GONIO_CONTROL_ANSWER];
} watcher;

static bool watch(void *context, const gonio_measure_progress *now) {
    watcher *w = context;
    char answer[GONIO_CONTROL_ANSWER];
    if (now->phase == GONIO_MEASURE_PAUSED) {
        w->pauses++;
        assert_true(now->what[0] != 0);
        assert_int_equal(gonio_control_request(GONIO_CONTROL_SESSION, w->identity, "status", w->told, NULL), GONIO_OK);
        if (w->go_in_pause) {
            assert_int_equal(gonio_control_request(GONIO_CONTROL_SESSION, w->identity, "go", answer, NULL), GONIO_OK);
        }
        return !w->stop_in_pause;
    }
    if (now->phase == GONIO_MEASURE_POSES && now->done == w->at) {
        w->at = SIZE_MAX;
        atomic_store(&tight, w->tighten ? 3 : 0);
        if (w->word != NULL) {
            assert_int_equal(gonio_control_request(GONIO_CONTROL_SESSION, w->identity, w->word, answer, NULL),
                             GONIO_OK);
        }
    }
    return true;
}

static void take_note(void *context, const char *text) {
    watcher *w = context;
    strncat(w->notes, text, sizeof w->notes - strlen(w->notes) - 2);
    strcat(w->notes, "\n");
}

static gonio_rig_file *open_rig(void) {
    const char *const settings[] = {QUICK};
    const gonio_rig_file_options options = {.sample = "ward:rho_d=0.3,rho_s=0.2,alpha=0.3",
                                            .settings = settings,
                                            .n_settings = 1,
                                            .seed = 3,
                                            .threads = 1,
                                            .control = true};
    gonio_rig_file *rig;
    gonio_error error = {0};
    if (gonio_rig_file_open(&options, &rig, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    return rig;
}

// To its end or its stop, then, where it was stopped, to its end; the hash of the samples.
static gonio_status measure(watcher *w, const char *name, bool wait_for_room, char hash[GONIO_SHA256_HEX]) {
    gonio_measure_options options;
    gonio_measure_options_default(&options);
    options.plan = "nusselt:12";
    options.fit.method = "mba";
    options.threads = 1;
    options.wait_for_room = wait_for_room;
    options.hooks = (gonio_measure_hooks){w, watch, NULL, take_note};
    gonio_error error = {0};
    gonio_rig_file *rig = open_rig();
    gonio_session *session;
    gonio_outcome outcome;
    snprintf(w->identity, sizeof w->identity, "%s/%s", root, name);
    char *at = strdup(w->identity);
    assert_int_equal(gonio_measure_begin(at, rig, &options, &session, &error), GONIO_OK);
    char *real = realpath(at, NULL);
    snprintf(w->identity, sizeof w->identity, "%s", real);
    free(real);
    free(at);
    const gonio_status status = gonio_measure_run(session, rig, &options, &outcome, &error);
    if (status != GONIO_OK) {
        gonio_rig_file_close(rig);
        rig = open_rig();
        w->word = NULL;
        w->stop_in_pause = false;
        assert_int_equal(gonio_measure_run(session, rig, &options, &outcome, &error), GONIO_OK);
    }
    strcpy(hash, outcome.samples_sha256);
    gonio_outcome_free(&outcome);
    gonio_session_close(session);
    gonio_rig_file_close(rig);
    return status;
}

static void steered(void **state) {
    (void)state;
    const struct {
        const char *what;
        watcher w;
        bool wait_for_room;
        gonio_status status;
        const char *state, *note;
    } cases[] = {
        {"undisturbed", {.at = SIZE_MAX}, true, GONIO_OK, NULL, ""},
        {"paused", {.word = "pause", .at = 4, .go_in_pause = true}, true, GONIO_OK, "\"state\":\"paused\"", "goes on"},
        {"stopped", {.word = "stop", .at = 4}, true, GONIO_E_INTERRUPTED, NULL, ""},
        {"paused and stopped by its hook",
         {.word = "pause", .at = 4, .stop_in_pause = true},
         true,
         GONIO_E_INTERRUPTED,
         "\"state\":\"paused\"",
         "shutter closed"},
        {"no room", {.at = 4, .tighten = true}, true, GONIO_OK, "\"state\":\"waiting for room\"", "MB are free"},
        {"no room and stopped",
         {.at = 4, .tighten = true, .stop_in_pause = true},
         true,
         GONIO_E_INTERRUPTED,
         "\"state\":\"waiting for room\"",
         "MB are free"},
        {"no room, and not to wait for it", {.at = 4, .tighten = true}, false, GONIO_OK, NULL, ""},
    };
    char expected[GONIO_SHA256_HEX] = "", hash[GONIO_SHA256_HEX];
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        watcher w = cases[k].w;
        char name[16];
        snprintf(name, sizeof name, "s%zu", k);
        atomic_store(&tight, 0);
        const gonio_status status = measure(&w, name, cases[k].wait_for_room, hash);
        if (k == 0) {
            strcpy(expected, hash);
        }
        if (status != cases[k].status || strcmp(hash, expected) != 0 || (w.pauses > 0) != (cases[k].state != NULL) ||
            strstr(w.notes, cases[k].note) == NULL ||
            (cases[k].state != NULL && strstr(w.told, cases[k].state) == NULL)) {
            fail_msg("%s: status %d, %zu looks in a pause, told %s, notes %s", cases[k].what, (int)status, w.pauses,
                     w.told, w.notes);
        }
        char answer[GONIO_CONTROL_ANSWER];
        assert_int_equal(gonio_control_request(GONIO_CONTROL_SESSION, w.identity, "status", answer, NULL),
                         GONIO_E_FAILED);
    }
}

int main(void) {
#define T(name) cmocka_unit_test_setup_teardown(name, begin, tear_down)
    const struct CMUnitTest tests[] = {T(names_belong_to_one), T(folders_that_others_may_enter_are_not_used),
                                       T(steered)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
