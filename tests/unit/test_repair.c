// SPDX-License-Identifier: BSD-3-Clause
// Repair and resume lose nothing: whatever is wrong with a session, and wherever a repair is stopped or fails, every
// intact frame is there afterwards, and the session is as it was or a verified one has its place.
#include <sys/wait.h>

#include "tests/unit/damaged_session.h"
// after cmocka
#include "tests/unit/disk_seam.h"

static gonio_doctor_report report;
static gonio_error why;

static gonio_status doctor(bool repair) {
    memset(&why, 0, sizeof why);
    return gonio_session_doctor(path, repair, &report, &why);
}

static int start(void **state) {
    memset(&seam, 0, sizeof seam);
    if (set_up(state) != 0) {
        return -1;
    }
    make_session();
    take_inventory(path, "before");
    return 0;
}

static void is_sound(void) {
    assert_int_equal(doctor(false), GONIO_OK);
    if (!gonio_doctor_sound(&report)) {
        fail_msg("%s", report.detail);
    }
    assert_int_equal(report.steps, STEPS);
}

// Refused: nothing at all is changed, and nothing lies about.
static void is_refused(gonio_status status, const char *text) {
    take_trace("trace");
    assert_int_equal(doctor(true), status);
    if (strstr(why.message, text) == NULL) {
        fail_msg("'%s' does not tell '%s'", why.message, text);
    }
    take_trace("trace2");
    assert_true(same_file("trace", "trace2"));
    assert_false(exists("%s.damaged-1", path) || leftover());
}

static void damage_frame(const char *name) {
    assert_int_equal(shell("truncate -s 100 %s/frames/%s", path, name), 0);
    take_inventory(path, "before");
}

// Repaired: the session as it was stands beside with every byte, and every frame that was there is still there.
static void is_repaired(void) {
    const gonio_status status = doctor(true);
    if (status != GONIO_OK) {
        fail_msg("%s", why.message);
    }
    assert_true(report.repaired);
    assert_true(has_all(report.damaged_path, "before"));
    assert_int_equal(frames_lost("before"), 0);
    assert_false(leftover());
}

// ---- looking ----

static void test_looking_leaves_no_trace(void **state) {
    (void)state;
    take_trace("trace");
    is_sound();
    take_trace("trace2");
    assert_true(same_file("trace", "trace2"));
    // Killed in the middle: a WAL lies there.
    const pid_t child = fork();
    if (child == 0) {
        gonio_session *session;
        if (gonio_session_open(path, true, &session, NULL) == GONIO_OK) {
            gonio_session_event(session, "test", "and then it died", NULL);
        }
        kill(getpid(), SIGKILL);
    }
    waitpid(child, NULL, 0);
    assert_true(exists("%s/session.db-wal", path));
    take_trace("trace");
    assert_int_equal(doctor(false), GONIO_OK);
    assert_true(report.database_ok);
    gonio_session *session;
    assert_int_equal(gonio_session_open(path, false, &session, NULL), GONIO_OK);
    gonio_session_close(session);
    take_trace("trace2");
    assert_true(same_file("trace", "trace2"));
}

// ---- what cannot be read is not damaged ----

static void test_a_read_error_is_retried(void **state) {
    (void)state;
    take_trace("trace");
    seam.bad_file = "frames/000002-00.png";
    seam.bad_with = EIO;
    seam.bad_times = 1;
    assert_int_equal(doctor(true), GONIO_OK);
    assert_true(gonio_doctor_sound(&report) && !report.repaired);
    take_trace("trace2");
    assert_true(same_file("trace", "trace2"));
}

static void test_what_stays_unreadable_is_refused(void **state) {
    (void)state;
    static const int codes[] = {EIO, EACCES, ESTALE, EMFILE};
    static const char *const files[] = {"000002-00.png", "session.db"};
    for (int i = 0; i < 16; i++) {
        seam.bad_open = i & 1;
        seam.bad_file = files[i / 2 % 2];
        seam.bad_with = codes[i / 4];
        seam.bad_times = 1000;
        is_refused(GONIO_E_IO, "unreadable");
        seam.bad_file = NULL;
    }
    is_sound();
}

// ---- damage ----

static void test_bad_frames(void **state) {
    (void)state;
    assert_int_equal(
        shell("echo mine >%s/frames/notes.txt; mkdir -p %s/frames/mine/deep; echo too >%s/frames/mine/deep/x;"
              "ln -s ../model.gonio %s/frames/link",
              path, path, path, path),
        0);
    damage_frame("000003-01.png");
    is_repaired();
    assert_int_equal(report.steps_lost, 1);
    assert_int_equal(report.files_aside, 2); // the bad one, and the good one of its step
    assert_true(exists("%s/frames/notes.txt", path) && exists("%s/frames/mine/deep/x", path));
    assert_true(exists("%s/lost+found/LIST", path) && exists("%s/lost+found/000003-00.png", path));
    gonio_session *session;
    assert_int_equal(gonio_session_open(path, true, &session, NULL), GONIO_OK);
    assert_int_equal(measure_step(session, 3), GONIO_OK);
    finish_results(session);
    gonio_session_close(session);
    is_sound();
    // And again: neither the first journal nor what was set aside gives way.
    assert_int_equal(shell("mv %s.damaged-1 %s/first", path, root), 0);
    assert_int_equal(shell("mv %s/first %s.damaged-1", root, path), 0);
    damage_frame("000003-01.png");
    is_repaired();
    assert_true(exists("%s.damaged-1/session.db", path) && exists("%s.damaged-2/session.db", path));
    assert_true(exists("%s/lost+found/000003-00.png", path) && exists("%s/lost+found/000003-00.png.1", path));
}

static long file_size(const char *name) {
    char file[160];
    struct stat facts;
    snprintf(file, sizeof file, "%s/%s", path, name);
    assert_int_equal(stat(file, &facts), 0);
    return (long)facts.st_size;
}

static void fresh(const char *copy) {
    assert_int_equal(shell("rm -rf %s*; cp -a %s/%s %s", path, root, copy, path), 0);
}

// Each page of the journal in turn, and each half of the log: the other one restores all of it.
static void test_a_damaged_journal_costs_nothing(void **state) {
    (void)state;
    assert_int_equal(shell("cp -a %s %s/good", path, root), 0);
    const long pages = file_size("session.db") / 4096;
    for (long i = 0; i < pages + 4; i++) {
        fresh("good");
        if (i < pages) {
            assert_int_equal(
                shell("dd if=/dev/zero of=%s/session.db bs=4096 seek=%ld count=1 conv=notrunc 2>/dev/null", path, i),
                0);
        } else {
            static const char *const damages[] = {"rm %s/session.db", "truncate -s 0 %s/session.db",
                                                  "truncate -s 5000 %s/session.log", "rm %s/session.log"};
            assert_int_equal(shell(damages[i - pages], path), 0);
        }
        take_inventory(path, "before");
        assert_int_equal(doctor(true), GONIO_OK);
        assert_int_equal(report.rows_lost + report.steps_missing + report.steps_lost, 0);
        assert_int_equal(frames_lost("before"), 0);
        is_sound();
    }
}

// The same pages without chain and log: repaired with what is lost told, or refused; no frame is lost.
static void test_a_damaged_journal_of_version_1(void **state) {
    (void)state;
    to_version_1();
    assert_int_equal(shell("cp -a %s %s/first", path, root), 0);
    const long pages = file_size("session.db") / 4096;
    for (long i = 0; i < pages; i++) {
        fresh("first");
        assert_int_equal(
            shell("dd if=/dev/zero of=%s/session.db bs=4096 seek=%ld count=1 conv=notrunc 2>/dev/null", path, i), 0);
        take_inventory(path, "before");
        const gonio_status status = doctor(true);
        assert_int_equal(frames_lost("before"), 0);
        assert_true(has_all(status == GONIO_OK ? report.damaged_path : path, "before"));
        assert_true(status != GONIO_OK || report.rows_lost + report.steps_missing + report.steps_lost > 0);
    }
}

// Where no copy of the journal can be made it is read where it is.
static void test_reading_without_room_for_a_copy(void **state) {
    (void)state;
    setenv("TMPDIR", "/nowhere", 1);
    is_sound();
    unsetenv("TMPDIR");
}

static void test_a_setting_is_no_damage(void **state) {
    (void)state;
    // With the chain and the log it is put right; without them nothing is touched.
    sql("UPDATE settings SET value = '13' WHERE key = 'camera.bits'");
    take_inventory(path, "before");
    is_repaired();
    is_sound();
    to_version_1();
    sql("UPDATE settings SET value = '13' WHERE key = 'camera.bits'");
    assert_int_equal(shell("rm -rf %s.damaged-1", path), 0);
    is_refused(GONIO_E_INPUT, "16 of 16 frames");
    sql("UPDATE settings SET value = '12' WHERE key = 'camera.bits'; DELETE FROM frames");
    is_refused(GONIO_E_INPUT, "16 of 16 frames");
}

static void test_frames_that_are_elsewhere(void **state) {
    (void)state;
    assert_int_equal(shell("mv %s/frames %s/away", path, root), 0);
    gonio_session *session;
    is_refused(GONIO_E_INPUT, "missing");
    assert_int_equal(gonio_session_open(path, true, &session, NULL), GONIO_E_INPUT);
    assert_int_equal(shell("mkdir %s/frames", path), 0); // an empty mount point
    is_refused(GONIO_E_INPUT, "16 of 16 frames");
    assert_int_equal(shell("rmdir %s/frames; ln -s %s/away %s/frames", path, root, path), 0);
    is_refused(GONIO_E_INPUT, "a link or a file");
    assert_int_equal(gonio_session_open(path, true, &session, NULL), GONIO_E_INPUT);
    assert_int_equal(shell("rm %s/frames; echo x >%s/frames", path, path), 0);
    is_refused(GONIO_E_INPUT, "a link or a file");
    assert_int_equal(shell("rm %s/frames; mv %s/away %s/frames", path, root, path), 0);
    is_sound();
    assert_true(has_all(path, "before"));
}

static void test_a_lost_journal(void **state) {
    (void)state;
    gonio_session *session;
    assert_int_equal(shell("mv %s/session.db %s/session.db.away", path, root), 0);
    take_trace("trace");
    assert_int_equal(gonio_session_create(path, &session, &why), GONIO_E_INPUT);
    assert_non_null(strstr(why.message, "16 of its frames are there"));
    take_trace("trace2");
    assert_true(same_file("trace", "trace2"));
    take_inventory(path, "before");
    is_repaired();
    is_sound();
    // A session of version 1 has no log: there is nothing to make a journal of.
    to_version_1();
    assert_int_equal(shell("rm -r %s/session.db %s.damaged-1", path, path), 0);
    assert_int_equal(gonio_session_create(path, &session, &why), GONIO_E_INPUT);
    is_refused(GONIO_E_INPUT, "proves any");
    assert_int_equal(frames_lost("before"), 0);
}

// A row that is gone is missed, in sessions with and without a count of their steps.
static void test_a_lost_pose_is_told(void **state) {
    (void)state;
    for (int64_t lost = 0; lost < STEPS; lost++) {
        char text[200];
        gonio_session *session;
        assert_int_equal(shell("rm -rf %s*", path), 0);
        make_session();
        to_version_1();
        snprintf(text, sizeof text,
                 "DELETE FROM frames WHERE step = %d; DELETE FROM samples WHERE step = %d;"
                 "DELETE FROM final_samples WHERE step = %d; DELETE FROM steps WHERE step = %d",
                 (int)lost, (int)lost, (int)lost, (int)lost);
        sql(text);
        take_inventory(path, "before");
        assert_int_equal(doctor(false), GONIO_OK);
        assert_false(gonio_doctor_sound(&report));
        assert_int_equal(report.steps_missing, 1);
        assert_int_equal(doctor(true), GONIO_OK);
        assert_int_equal(report.steps_missing, 1);
        assert_int_equal(frames_lost("before"), 0);
        assert_int_equal(gonio_session_open(path, false, &session, NULL), GONIO_OK);
        bool finished = true;
        assert_int_equal(gonio_session_check_steps(session, &why), GONIO_E_INPUT);
        assert_int_equal(gonio_session_finished(session, &finished, NULL), GONIO_OK);
        assert_false(finished);
        gonio_session_close(session);
    }
}

// Bits of the whole file, at random: found or without effect, and no frame is ever lost.
static void flip_bits(const char *copy, unsigned *random, int flips) {
    for (int i = 0; i < flips; i++) {
        fresh(copy);
        *random = *random * 1664525u + 1013904223u;
        const long at = (long)(*random >> 8) % file_size("session.db");
        char file[160];
        snprintf(file, sizeof file, "%s/session.db", path);
        FILE *f = fopen(file, "r+b");
        assert_non_null(f);
        fseek(f, at, SEEK_SET);
        const int byte = fgetc(f);
        fseek(f, at, SEEK_SET);
        fputc(byte ^ 1 << (*random & 7), f);
        fclose(f);
        take_inventory(path, "before");
        const gonio_status status = doctor(true);
        assert_int_equal(frames_lost("before"), 0);
        if (status != GONIO_OK || report.damaged_path[0] == 0) {
            assert_true(has_all(path, "before"));
        } else {
            assert_true(has_all(report.damaged_path, "before"));
        }
        const bool whole = report.steps == STEPS && report.frames_bad == 0;
        assert_true(status != GONIO_OK || whole || report.steps_missing + report.rows_lost + report.steps_lost > 0);
    }
}

static void test_flipped_bits(void **state) {
    (void)state;
    unsigned random = 5;
    const int flips = getenv("GONIO_TEST_ALL") != NULL ? 300 : 20;
    assert_int_equal(shell("cp -a %s %s/good", path, root), 0);
    flip_bits("good", &random, flips);
    fresh("good");
    to_version_1();
    assert_int_equal(shell("cp -a %s %s/first", path, root), 0);
    flip_bits("first", &random, flips);
}

// ---- sweeping ----

static void test_strays_and_others(void **state) {
    (void)state;
    gonio_session *session;
    static const char *const ours[] = {"000099-00.png", ".000001-00.png.new", "1234567-123.png"};
    static const char *const others[] = {"notes.png", "000001-00.png.bak", "00001-00.png", ".000001-00.png"};
    int moved;
    for (int i = 0; i < 3; i++) {
        assert_int_equal(shell("echo %d >%s/frames/%s", i, path, ours[i]), 0);
    }
    for (int i = 0; i < 4; i++) {
        assert_int_equal(shell("mkdir -p %s/frames/folder%d; echo %d >%s/frames/%s", path, i, i, path, others[i]), 0);
    }
    assert_int_equal(shell("echo x >%s/session.db.new; echo x >%s/model.gonio.0a1b2c", path, path), 0);
    assert_int_equal(shell("mkdir %s/frames/000077-00.png", path), 0);
    assert_int_equal(gonio_session_open(path, true, &session, NULL), GONIO_OK);
    assert_int_equal(gonio_session_sweep(session, &moved, &why), GONIO_OK);
    assert_int_equal(moved, 6);
    assert_int_equal(gonio_session_sweep(session, &moved, &why), GONIO_OK);
    assert_int_equal(moved, 0);
    gonio_session_close(session);
    for (int i = 0; i < 4; i++) {
        assert_true(i == 3 || exists("%s/lost+found/%s", path, ours[i]));
        assert_true(exists("%s/frames/%s", path, others[i]) && exists("%s/frames/folder%d", path, i));
    }
    assert_int_equal(shell("[ $(wc -l <%s/lost+found/LIST) = 6 ]", path), 0);
    is_sound();
}

// What has the name of a frame that is stored gives way to it, and is kept.
static void test_a_name_that_is_taken(void **state) {
    (void)state;
    gonio_session *session;
    assert_int_equal(shell("echo victim >%s/victim", root), 0);
    assert_int_equal(gonio_session_open(path, true, &session, NULL), GONIO_OK);
    assert_int_equal(gonio_session_undo_step(session, 4, "test", NULL), GONIO_OK);
    assert_int_equal(shell("ln -s %s/victim %s/frames/.000004-01.png.new", root, path), 0);
    for (int i = 0; i < 2; i++) { // the first time in a file system that cannot but replace
        seam.no_exchange = i == 0;
        assert_int_equal(measure_step(session, 4), GONIO_OK);
        assert_int_equal(gonio_session_undo_step(session, 4, "test", NULL), GONIO_OK);
    }
    assert_int_equal(measure_step(session, 4), GONIO_OK);
    finish_results(session);
    gonio_session_close(session);
    assert_int_equal(shell("[ $(cat %s/victim) = victim ]", root), 0);
    assert_true(exists("%s/lost+found/000004-00.png", path) && exists("%s/lost+found/000004-00.png.2", path));
    is_sound();
}

static void test_a_model_makes_way(void **state) {
    (void)state;
    gonio_session *session;
    assert_int_equal(gonio_session_open(path, true, &session, NULL), GONIO_OK);
    assert_int_equal(gonio_session_make_way(session, "model.gonio", "test", NULL), GONIO_OK);
    assert_int_equal(gonio_session_make_way(session, "model.gonio", "test", NULL), GONIO_OK);
    gonio_session_close(session);
    assert_true(exists("%s/lost+found/model.gonio", path) && !exists("%s/model.gonio", path));
}

static void test_a_folder_with_files_of_others(void **state) {
    (void)state;
    static const char *const names[] = {"model.gonio",     "session.db-wal", "flat.map",   "response.csv",
                                        "reference.model", "library.prior",  "scene.needs"};
    gonio_session *session;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        assert_int_equal(shell("rm -rf %s; mkdir %s; echo mine >%s/%s", path, path, path, names[i]), 0);
        assert_int_equal(gonio_session_create(path, &session, &why), GONIO_E_USAGE);
        assert_int_equal(shell("[ $(cat %s/%s) = mine ]", path, names[i]), 0);
    }
    assert_int_equal(
        shell("rm -rf %s; mkdir -p %s/frames; echo mine >%s/notes; echo mine >%s/frames/notes", path, path, path, path),
        0);
    take_inventory(path, "before");
    make_session();
    assert_true(has_all(path, "before"));
    // Two at once: the second is told, and the first has its session.
    assert_int_equal(gonio_session_open(path, true, &session, NULL), GONIO_OK);
    gonio_session *second;
    assert_true(gonio_session_create(path, &second, &why) < 0);
    gonio_session_close(session);
    is_sound();
}

// ---- stopped and failing repairs ----

static void damage_twice(void) {
    assert_int_equal(shell("truncate -s 100 %s/frames/000005-00.png; echo stray >%s/frames/000044-00.png", path, path),
                     0);
    sql("UPDATE frames SET monitor = 7 WHERE step = 2");
    take_inventory(path, "before");
    assert_int_equal(shell("cp -a %s %s/damaged", path, root), 0);
}

static int between; // kills between two renames

// The child's calls; 0: it was killed.
static bool repair_killed_at(long n) {
    const pid_t child = fork();
    if (child == 0) {
        seam.calls = 0;
        seam.kill_at = n;
        _exit(doctor(true) == GONIO_OK ? 0 : 1);
    }
    int status;
    waitpid(child, &status, 0);
    assert_true(WIFSIGNALED(status) || WEXITSTATUS(status) == 0);
    return WIFSIGNALED(status);
}

// Stopped between two renames the session has no name until somebody asks for it, to read it or to write it, and is the
// repaired one then; true where that was so.
static bool settles(void) {
    static int asked;
    gonio_session *session = NULL;
    if (exists("%s", path)) {
        return false;
    }
    assert_int_equal(asked % 3 == 2 ? doctor(false) : gonio_session_open(path, asked % 3 == 1, &session, &why),
                     GONIO_OK);
    asked++;
    gonio_session_close(session);
    assert_false(leftover());
    assert_true(exists("%s.damaged-1", path));
    return true;
}

static void repaired_after_all(bool must_be_there) {
    const bool settled = settles();
    assert_false(must_be_there && settled);
    between += settled;
    assert_true(
        has_all(path, "before") || has_all("/dev/null", "before") ||
        shell("cd %s && for d in s.damaged-*; do (cd $d && sha256sum -c --quiet %s/before >/dev/null 2>&1) && exit 0;"
              " done; exit 1",
              root, root) == 0);
    assert_int_equal(doctor(true), GONIO_OK);
    assert_int_equal(frames_lost("before"), 0);
    assert_int_equal(doctor(false), GONIO_OK);
    assert_true(report.database_ok && report.frames_bad == 0 && report.steps == STEPS &&
                report.steps_done == STEPS - 1);
}

// Calls of an undisturbed repair.
static long count_calls(void) {
    seam.calls = 0;
    assert_int_equal(doctor(true), GONIO_OK);
    fresh("damaged");
    return seam.calls;
}

// The next call to strike at, of so many: each of the last ones, among which the names are exchanged, and of the many
// before them some, or all where GONIO_TEST_ALL asks for it.
static long next_call(long n, long calls) {
    return n + (getenv("GONIO_TEST_ALL") != NULL || n > calls - 12 ? 1 : 1 + calls / 20);
}

static void kill_everywhere(bool no_exchange, bool no_links) {
    seam.no_exchange = no_exchange;
    seam.no_links = no_links;
    damage_twice();
    const long calls = count_calls();
    assert_true(calls > 100);
    for (long n = 1; n <= calls; n = next_call(n, calls)) {
        assert_true(repair_killed_at(n));
        repaired_after_all(!no_exchange);
        fresh("damaged");
    }
    assert_false(repair_killed_at(calls + 1));
    repaired_after_all(true);
    assert_true((between > 0) == no_exchange);
}

// What has another name than a repaired session's stays what it is, and a name that is taken stays taken.
static void test_only_a_repaired_session_takes_a_name(void **state) {
    (void)state;
    gonio_session *session;
    static const char *const others[] = {".repaired-1234", ".repaired-12345x", ".repaired-", ".repair-12345",
                                         ".damaged-1"};
    // Each way of asking for it.
    shell_does("mv %s %s.repaired-0a1b2", path, path);
    assert_true(gonio_session_is(path));
    shell_does("mv %s %s.repaired-0a1b2", path, path);
    is_sound();
    for (size_t i = 0; i < sizeof others / sizeof *others; i++) {
        shell_does("mv %s %s%s", path, path, others[i]);
        assert_int_equal(gonio_session_open(path, true, &session, &why), GONIO_E_INPUT);
        assert_false(gonio_session_is(path));
        shell_does("mv %s%s %s", path, others[i], path);
    }
    shell_does("cp -a %s %s.repaired-0a1b2; rm %s/session.db %s/session.log", path, path, path, path);
    assert_false(gonio_session_is(path));
    shell_does("rm -r %s; ln -s nowhere %s", path, path);
    assert_false(gonio_session_is(path));
    shell_does("rm %s", path);
    assert_int_equal(gonio_session_create(path, &session, &why), GONIO_E_USAGE); // it is there again
    is_sound();
}

static void test_killed_anywhere(void **state) {
    (void)state;
    kill_everywhere(false, false);
}

static void test_killed_anywhere_without_exchange(void **state) {
    (void)state;
    kill_everywhere(true, true);
}

// Any call fails once: the repair succeeds all the same, or the session is as it was and nothing lies about.
static void test_any_call_fails(void **state) {
    (void)state;
    static const int codes[] = {EIO, ENOSPC, EACCES};
    damage_twice();
    const long calls = count_calls();
    for (long n = 1; n <= calls; n = next_call(n, calls)) {
        seam.calls = 0;
        seam.fail_at = n;
        seam.fail_with = codes[n % 3];
        const gonio_status status = doctor(true);
        assert_true(seam.calls >= n);
        seam.fail_at = 0;
        assert_int_equal(frames_lost("before"), 0);
        if (status != GONIO_OK && !report.repaired) {
            assert_true(has_all(path, "before"));
            assert_false(exists("%s.damaged-1", path));
        } else {
            assert_true(has_all(report.damaged_path, "before"));
        }
        fresh("damaged");
    }
}

int main(void) {
#define T(name) cmocka_unit_test_setup_teardown(name, start, tear_down)
    const struct CMUnitTest tests[] = {
        T(test_looking_leaves_no_trace),
        T(test_a_read_error_is_retried),
        T(test_what_stays_unreadable_is_refused),
        T(test_bad_frames),
        T(test_a_damaged_journal_costs_nothing),
        T(test_a_damaged_journal_of_version_1),
        T(test_reading_without_room_for_a_copy),
        T(test_a_setting_is_no_damage),
        T(test_frames_that_are_elsewhere),
        T(test_a_lost_journal),
        T(test_a_lost_pose_is_told),
        T(test_flipped_bits),
        T(test_strays_and_others),
        T(test_a_name_that_is_taken),
        T(test_a_model_makes_way),
        T(test_a_folder_with_files_of_others),
        T(test_killed_anywhere),
        T(test_killed_anywhere_without_exchange),
        T(test_only_a_repaired_session_takes_a_name),
        T(test_any_call_fails),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
