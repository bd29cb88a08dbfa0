// SPDX-License-Identifier: BSD-3-Clause
// Sessions come from elsewhere. One of version 1 vouches for nothing, so whatever stands in its tables reaches the
// readers: each value that is not what it must be is refused with its table, row and column, and whatever lies in the
// folder is neither waited for, followed nor run.
#include <errno.h>
#include <fcntl.h>
#include <setjmp.h>
#include <sqlite3.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/text.h"
#include "host/session/internal.h"
#include "tests/session_readers.h"
#include "tests/unit/session_folder.h"

// ---- one session, put back before each attack ----

static struct {
    char *data;
    size_t size;
} whole[2]; // session.db of versions 1 and 2
static uint64_t undamaged;

static const char *in(const char *name) {
    static char text[4][192];
    static int next;
    char *file = text[next++ % 4];
    snprintf(file, sizeof text[0], "%s/%s", path, name);
    return file;
}

static void write_file(const char *file, const void *data, size_t size) {
    FILE *f = fopen(file, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(data, 1, size, f), size);
    fclose(f);
}

static void put_back(int version) {
    static const char *const names[] = {"session.db", "session.db-wal", "session.db-shm", "session.db-journal"};
    for (int i = 0; i < 4; i++) {
        unlink(in(names[i]));
    }
    write_file(in("session.db"), whole[version - 1].data, whole[version - 1].size);
}

static void sql(const char *text) {
    char message[200];
    if (!run_loose_sql(in("session.db"), text, message)) {
        fail_msg("%s: %s", text, message);
    }
}

static int make_base(void **state) {
    gonio_error error = {0};
    set_up(state);
    if (make_small_session(path, NULL, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    for (int version = 2; version >= 1; version--) {
        if (version == 1) {
            make_it_version_1(in("session.db"));
        }
        assert_int_equal(gonio_file_read(in("session.db"), 0, &whole[version - 1].data, &whole[version - 1].size, NULL),
                         GONIO_OK);
        put_back(version);
        if (read_everything(path, &undamaged, &error) != GONIO_OK) {
            fail_msg("%s", error.message);
        }
    }
    return 0;
}

static int remove_base(void **state) {
    free(whole[0].data);
    free(whole[1].data);
    return tear_down(state);
}

// ---- values ----

static const struct attack {
    const char *sql, *where; // where: in the message; NULL: nothing that is read changes
} attacks[] = {
    {"UPDATE steps SET kind = 'nonsense' WHERE step = 1", "table steps, row step = 1, column kind: found 'nonsense'"},
    {"UPDATE steps SET kind = NULL WHERE step = 1", "NULL value in steps.kind"},
    {"UPDATE steps SET kind = x'00' WHERE step = 1", "table steps, row step = 1, column kind: found a blob of 1 bytes"},
    {"UPDATE steps SET kind = CAST(x'64006b' AS TEXT) WHERE step = 1", "table steps, row step = 1, column kind"},
    {"UPDATE steps SET theta_i_deg = 'steep' WHERE step = 2", "row step = 2, column theta_i_deg: found 'steep'"},
    {"UPDATE steps SET phi_o_deg = NULL WHERE step = 2", "NULL value in steps.phi_o_deg"},
    {"UPDATE steps SET theta_o_deg = 9e999 WHERE step = 2", "row step = 2, column theta_o_deg"},
    {"UPDATE steps SET phi_i_deg = 1e300 WHERE step = 2", "row step = 2, column phi_i_deg"},
    {"UPDATE steps SET done = 7 WHERE step = 2", "row step = 2, column done: found 7"},
    {"UPDATE steps SET frames = -1 WHERE step = 2", "row step = 2, column frames: found -1"},
    {"UPDATE steps SET frames = 1 << 62 WHERE step = 2", "row step = 2, column frames"},
    {"UPDATE steps SET frames = 2.5 WHERE step = 2", "row step = 2, column frames: found 2.5"},
    {"UPDATE steps SET frames = frames + 1 WHERE step = 2", "table frames: step 2"},
    {"UPDATE steps SET frames = frames - 1 WHERE step = 2", "table frames: step 2"},
    {"UPDATE steps SET clock_end_s = 'late' WHERE step = 2", "row step = 2, column clock_end_s"},
    {"UPDATE steps SET exposure_end_s = -1 WHERE step = 2", "row step = 2, column exposure_end_s: found -1"},
    {"UPDATE steps SET step = -3 WHERE step = 2", "table steps, row step = -3, column step"},
    {"UPDATE steps SET step = 9000000000000000000 WHERE step = 2", "column step: found 9000000000000000000"},
    {"UPDATE frames SET file = '../../etc/passwd' WHERE step = 0 AND frame = 1",
     "table frames, row step = 0, frame = 1, column file: found '../../etc/passwd', expected '000000-01.png'"},
    {"UPDATE frames SET file = '000000-00.png' WHERE step = 0 AND frame = 1", "frame = 1, column file"},
    {"UPDATE frames SET file = '/dev/zero' WHERE step = 0 AND frame = 1", "frame = 1, column file"},
    {"UPDATE frames SET file = NULL WHERE step = 0 AND frame = 1", "NULL value in frames.file"},
    {"UPDATE frames SET sha256 = 'abc' WHERE step = 0 AND frame = 1", "frame = 1, column sha256: found 'abc'"},
    {"UPDATE frames SET sha256 = replace(sha256, substr(sha256, 1, 1), 'g') WHERE step = 0 AND frame = 1",
     "frame = 1, column sha256"},
    {"UPDATE frames SET sha256 = (SELECT sha256 FROM frames WHERE step = 3 AND frame = 0) WHERE step = 0 AND frame = 1",
     "was journalled"},
    {"UPDATE frames SET x = -1 WHERE step = 0 AND frame = 1", "frame = 1, column x: found -1"},
    {"UPDATE frames SET y = 'low' WHERE step = 0 AND frame = 1", "frame = 1, column y: found 'low'"},
    {"UPDATE frames SET width = 0 WHERE step = 0 AND frame = 1", "frame = 1, column width: found 0"},
    {"UPDATE frames SET width = 4294967297 WHERE step = 0 AND frame = 1", "frame = 1, column width"},
    {"UPDATE frames SET width = 30000, height = 30000 WHERE step = 0 AND frame = 1", "frame = 1, column height"},
    {"UPDATE frames SET width = 65536, height = 4096 WHERE step = 0 AND frame = 1", "not the frame that was stored"},
    {"UPDATE frames SET height = NULL WHERE step = 0 AND frame = 1", "NULL value in frames.height"},
    {"UPDATE frames SET exposure_s = -1 WHERE step = 0 AND frame = 1", "frame = 1, column exposure_s: found -1"},
    {"UPDATE frames SET exposure_s = 9e999 WHERE step = 0 AND frame = 1", "frame = 1, column exposure_s"},
    {"UPDATE frames SET gain_db = 'x' WHERE step = 0 AND frame = 1", "frame = 1, column gain_db: found 'x'"},
    {"UPDATE frames SET clock_s = NULL WHERE step = 0 AND frame = 1", "NULL value in frames.clock_s"},
    {"UPDATE frames SET monitor = x'00' WHERE step = 0 AND frame = 1", "frame = 1, column monitor: found a blob"},
    {"UPDATE frames SET monitor_sigma = -1 WHERE step = 0 AND frame = 1", "frame = 1, column monitor_sigma"},
    {"UPDATE frames SET frame = 77 WHERE step = 0 AND frame = 1",
     "table frames, row step = 0, frame = 2, column frame"},
    {"UPDATE frames SET frame = -1 WHERE step = 0 AND frame = 0",
     "table frames, row step = 0, frame = -1, column frame"},
    {"DELETE FROM frames WHERE step = 0 AND frame = 3", "row step = 0, frame = 4, column frame"},
    {"DELETE FROM frames WHERE step = 3 AND frame = (SELECT max(frame) FROM frames WHERE step = 3)",
     "table frames: step 3"},
    {"UPDATE samples SET n = n + (1 << 61)", "table samples, row step = 4, column n"},
    {"UPDATE samples SET n = -1", "table samples, row step = 4, column n: found -1"},
    {"UPDATE samples SET n = 0", "table samples, row step = 4, column rows"},
    {"UPDATE samples SET n = NULL", "NULL value in samples.n"},
    {"UPDATE samples SET channels = 2", "table samples, row step = 4, column channels: found 2"},
    {"UPDATE samples SET channels = 1 << 40", "table samples, row step = 4, column channels"},
    {"UPDATE samples SET rows = zeroblob(length(rows)) WHERE step = 5", "table samples, row step = 5, column sha256"},
    {"UPDATE samples SET rows = zeroblob(7) WHERE step = 5", "table samples, row step = 5, column rows: found a blob"},
    {"UPDATE samples SET rows = 'text' WHERE step = 5", "table samples, row step = 5, column rows: found 'text'"},
    {"UPDATE samples SET rows = NULL WHERE step = 5", "NULL value in samples.rows"},
    {"UPDATE samples SET sha256 = NULL WHERE step = 5", "NULL value in samples.sha256"},
    {"UPDATE final_samples SET n = 1 << 61 WHERE step = 5", "table final_samples, row step = 5, column n"},
    {"UPDATE final_samples SET rows = zeroblob(16) WHERE step = 5", "table final_samples, row step = 5, column rows"},
    {"UPDATE radiance SET channels = 4 WHERE step = 5", "table radiance, row step = 5, column channels: found 4"},
    {"UPDATE radiance SET channels = 2 WHERE step = 5",
     "row step = 5, column means: found a blob of 8 bytes, expected a"},
    {"UPDATE radiance SET channels = -1 << 40 WHERE step = 5", "table radiance, row step = 5, column channels"},
    {"UPDATE radiance SET channels = 'one' WHERE step = 5", "row step = 5, column channels: found 'one'"},
    {"UPDATE radiance SET channels = NULL WHERE step = 5", "NULL value in radiance.channels"},
    {"UPDATE radiance SET means = zeroblob(7) WHERE step = 5", "row step = 5, column means: found a blob of 7 bytes"},
    {"UPDATE radiance SET means = 'text' WHERE step = 5", "table radiance, row step = 5, column means: found 'text'"},
    {"UPDATE radiance SET means = NULL WHERE step = 5", "NULL value in radiance.means"},
    {"UPDATE radiance SET sha256 = 'abc' WHERE step = 5", "table radiance, row step = 5, column sha256: found 'abc'"},
    {"UPDATE radiance SET sha256 = zeroblob(64) WHERE step = 5", "table radiance, row step = 5, column sha256"},
    {"UPDATE radiance SET sha256 = NULL WHERE step = 5", "NULL value in radiance.sha256"},
    {"UPDATE radiance SET step = -3 WHERE step = 5", "table radiance, row step = -3, column step: found -3"},
    {"UPDATE radiance SET step = 1 << 40 WHERE step = 5", "table radiance, row step = 1099511627776, column step"},
    {"UPDATE events SET text = NULL WHERE event = 1", "NULL value in events.text"},
    {"UPDATE events SET utc = x'1b' WHERE event = 1", "table events, row event = 1, column utc: found a blob"},
    {"UPDATE events SET kind = 7 WHERE event = 1", NULL},
    {"UPDATE settings SET value = NULL WHERE key = 'plan'", "NULL value in settings.value"},
    {"UPDATE settings SET value = x'00ff' WHERE key = 'camera.bits'", "row key = 'camera.bits', column value"},
    {"UPDATE settings SET value = '17' WHERE key = 'camera.bits'", "row key = 'camera.bits', column value: found '17'"},
    {"UPDATE settings SET value = '12 ' WHERE key = 'camera.bits'", "row key = 'camera.bits', column value"},
    {"UPDATE settings SET value = CAST(zeroblob(99) AS TEXT) WHERE key = 'plan'", "row key = 'plan', column value"},
    {"UPDATE settings SET value = CAST(zeroblob(20000000) AS TEXT) WHERE key = 'plan'", "row key = 'plan'"},
    {"UPDATE settings SET value = ',' || hex(zeroblob(600)) || ','", "row key = 'camera"},
    {"UPDATE settings SET value = replace(hex(zeroblob(600)), '0', ',') WHERE key = 'samples.channels'",
     "row key = 'samples.channels', column value: found 1201 names"},
    {"UPDATE settings SET value = 'r' || char(27) || '[2J' WHERE key = 'samples.channels'",
     "row key = 'samples.channels', column value"},
    {"DELETE FROM settings WHERE key = 'camera'", "no setting 'camera'"},
    {"DELETE FROM settings WHERE key = 'samples.channels'", "no row key = 'samples.channels'"},
    {"UPDATE settings SET value = '[]' WHERE key = 'camera'", "row key = 'camera', column value: found []"},
    {"UPDATE settings SET value = 'null' WHERE key = 'facts'", "row key = 'facts', column value: found"},
    {"UPDATE settings SET value = replace(hex(zeroblob(200000)), '0', '[') WHERE key = 'facts'", "row key = 'facts'"},
    // The schema.
    {"CREATE VIEW more AS SELECT 1", "the view more"},
    {"DROP TABLE events; CREATE VIEW events AS WITH RECURSIVE t(event) AS (SELECT 1 UNION ALL SELECT event + 1 FROM t)"
     " SELECT event, 'a' AS utc, 'b' AS kind, 'c' AS text FROM t",
     "the view events"},
    {"CREATE TRIGGER t AFTER INSERT ON events BEGIN DELETE FROM frames; END", "the trigger t"},
    {"CREATE INDEX i ON frames(file)", "the index i"},
    {"CREATE TABLE more(x)", "the table more"},
    {"CREATE VIRTUAL TABLE more USING fts3(x)", "the table more"},
    {"DROP TABLE flagged", NULL},
    {"DROP TABLE events", "found 5 of its tables"},
    {"ALTER TABLE events ADD COLUMN more", "table events: found the column 'more "},
    {"ALTER TABLE events DROP COLUMN text", "table events"},
    {"ALTER TABLE events RENAME COLUMN text TO texts", "table events: found the column 'texts"},
    {"DROP TABLE flagged; CREATE TABLE flagged(step INTEGER PRIMARY KEY CHECK(step > 0))",
     "the table flagged with CHECK"},
    {"DROP TABLE flagged; CREATE TABLE flagged(step INTEGER PRIMARY KEY, x AS (1))", "the table flagged"},
    {"PRAGMA application_id = 7", "another application"},
    {"PRAGMA user_version = 99", "version 99"},
    {"PRAGMA user_version = -1", "version -1"},
    {"PRAGMA user_version = 2", "not the journal of a session"},
};

static void test_values_are_held_against_their_columns(void **state) {
    (void)state;
    int wrong = 0;
    for (size_t i = 0; i < sizeof attacks / sizeof *attacks; i++) {
        const struct attack *a = &attacks[i];
        gonio_error error = {0};
        uint64_t digest;
        put_back(1);
        sql(a->sql);
        const gonio_status status = read_everything(path, &digest, &error);
        if (a->where == NULL ? status != GONIO_OK || digest != undamaged
                             : status != GONIO_E_INPUT || strstr(error.message, a->where) == NULL) {
            wrong++;
            print_error("%s: expected '%s', found %s: %s\n", a->sql, a->where != NULL ? a->where : "nothing",
                        gonio_status_name(status), error.message);
        }
        assert_true(gonio_text_is_printable(error.message));
    }
    assert_int_equal(wrong, 0);
}

// A session of this version proves itself: the same changes are refused before anything else is read.
static void test_a_chained_session_refuses_them_at_once(void **state) {
    (void)state;
    for (size_t i = 0; i < sizeof attacks / sizeof *attacks; i++) {
        gonio_error error = {0};
        gonio_session *session;
        put_back(2);
        if (strncmp(attacks[i].sql, "UPDATE", 6) == 0 || strncmp(attacks[i].sql, "DELETE", 6) == 0) {
            sql(attacks[i].sql);
            if (gonio_session_open(path, false, &session, &error) != GONIO_E_INPUT) {
                fail_msg("%s: %s", attacks[i].sql, error.message);
            }
        }
    }
}

// A chain is made by whoever makes the session: that it agrees says nothing of what the values are. (NULL is refused by
// the tables themselves.)
static void test_a_chain_vouches_for_no_type(void **state) {
    (void)state;
    static const struct attack of_files[] = {
        {"UPDATE files SET role = x'00'", "table files, row role = a blob of 1 bytes"},
        {"UPDATE files SET role = CAST(x'706c00616e' AS TEXT)", "column role"},
        {"UPDATE files SET name = zeroblob(20)", "column name: found a blob of 20 bytes"},
        {"UPDATE files SET name = CAST(zeroblob(20000000) AS TEXT)", "column name"},
        {"UPDATE files SET sha256 = 'abc'", "column sha256: found 'abc'"},
        {"UPDATE files SET sha256 = zeroblob(64)", "column sha256"},
        {"UPDATE files SET size = -1", "column size: found -1"},
        {"UPDATE files SET size = 'large'", "column size: found 'large'"},
        {"UPDATE files SET size = 0.5", "column size: found 0.5"},
        {"UPDATE files SET bytes = NULL", NULL},
    };
    const struct attack *const lists[] = {of_files, attacks};
    const size_t counts[] = {sizeof of_files / sizeof *of_files, sizeof attacks / sizeof *attacks};
    int tried = 0, wrong = 0;
    char *log;
    size_t log_size;
    assert_int_equal(gonio_file_read(in("session.log"), 0, &log, &log_size, NULL), GONIO_OK);
    for (size_t l = 0; l < 2; l++) {
        for (size_t i = 0; i < counts[l]; i++) {
            const struct attack *a = &lists[l][i];
            gonio_session *session;
            gonio_error error = {0};
            uint64_t digest;
            if (l == 1 && strncmp(a->sql, "UPDATE radiance", 15) != 0) {
                continue; // the other tables' readers are the same in both versions
            }
            put_back(2);
            write_file(in("session.log"), log, log_size);
            assert_int_equal(gonio_session_open(path, true, &session, &error), GONIO_OK);
            assert_int_equal(gonio_session_put_file(session, "plan", "poses.csv", "0", 1, NULL), GONIO_OK);
            const bool taken = gonio_session_exec(session, a->sql, &error) == GONIO_OK;
            gonio_session_close(session);
            if (!taken) {
                continue;
            }
            tried++;
            const gonio_status status = read_everything(path, &digest, &error);
            if (a->where == NULL ? status != GONIO_OK
                                 : status != GONIO_E_INPUT || strstr(error.message, a->where) == NULL) {
                wrong++;
                print_error("%s: expected '%s', found %s: %s\n", a->sql, a->where != NULL ? a->where : "nothing",
                            gonio_status_name(status), error.message);
            }
        }
    }
    write_file(in("session.log"), log, log_size);
    free(log);
    assert_int_equal(wrong, 0);
    assert_true(tried > 15);
}

// Every member of every JSON setting, made absent, NULL, huge, negative, of another type.
static void test_settings_are_held_against_their_bounds(void **state) {
    (void)state;
    static const char *const parts[] = {"camera", "facts", "alignment", "scan", "window", "fit"};
    static const char *const values[] = {"json('null')",        "1e308",       "-1e308",     "json('[1,2]')",
                                         "json('{}')",          "-2147483649", "4294967297", "json('true')",
                                         "hex(zeroblob(2000))", "9.5",         "''"};
    size_t tried = 0, refused = 0;
    for (size_t p = 0; p < sizeof parts / sizeof *parts; p++) {
        char text[400];
        int members = 1;
        for (int m = 0; m < members; m++) {
            for (size_t v = 0; v < sizeof values / sizeof *values; v++) {
                gonio_session *session;
                gonio_setup setup;
                gonio_error error = {0};
                put_back(1);
                snprintf(text, sizeof text,
                         "UPDATE settings SET value = json_set(value, '$.\"' || (SELECT j.key FROM "
                         "json_each(settings.value) AS j LIMIT 1"
                         " OFFSET %d) || '\"', %s) WHERE key = '%s'",
                         m, values[v], parts[p]);
                sql(text);
                assert_int_equal(gonio_session_open(path, false, &session, &error), GONIO_OK);
                if (v == 0 && m == 0) {
                    char *json = NULL;
                    assert_int_equal(gonio_session_get(session, parts[p], &json, NULL), GONIO_OK);
                    for (const char *c = json; *c != 0; c++) {
                        members += *c == ':';
                    }
                    members--;
                    free(json);
                }
                const gonio_status status = gonio_setup_get(session, &setup, &error);
                gonio_session_close(session);
                tried++;
                if (status != GONIO_OK) {
                    refused++;
                    if (status != GONIO_E_INPUT || strstr(error.message, parts[p]) == NULL) {
                        fail_msg("%s: %s: %s", text, gonio_status_name(status), error.message);
                    }
                }
            }
        }
    }
    if (!(tried > 700 && refused > tried / 2)) {
        fail_msg("%zu tried, %zu refused", tried, refused);
    }
}

// ---- what lies in the folder ----

static void refused_with(const char *text) {
    gonio_error error = {0};
    uint64_t digest;
    const gonio_status status = read_everything(path, &digest, &error);
    if (status != GONIO_E_INPUT || strstr(error.message, text) == NULL) {
        fail_msg("expected '%s', found %s: %s", text, gonio_status_name(status), error.message);
    }
}

// In the place of each file: what is no file. Nothing is waited for and no link is followed.
static void test_only_plain_files_are_opened(void **state) {
    (void)state;
    static const char *const names[] = {"session.db", "session.db-wal", "session.db-shm", "session.db-journal",
                                        "frames/000000-01.png"};
    char kept[192];
    snprintf(kept, sizeof kept, "%s/kept", root);
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        for (int how = 0; how < 4; how++) {
            put_back(1);
            const bool there = rename(in(names[i]), kept) == 0;
            const int made = how == 0   ? mkfifo(in(names[i]), 0666)
                             : how == 1 ? symlink("/dev/zero", in(names[i]))
                             : how == 2 ? symlink(kept, in(names[i]))
                                        : symlink("nowhere", in(names[i]));
            assert_int_equal(made, 0);
            refused_with(how == 0 ? "found a pipe" : "found a symbolic link");
            assert_int_equal(unlink(in(names[i])), 0);
            if (there) {
                assert_int_equal(rename(kept, in(names[i])), 0);
            }
        }
    }
    put_back(1);
    // A frame that is far too large, without its bytes on the disk.
    assert_int_equal(rename(in("frames/000000-01.png"), kept), 0);
    write_file(in("frames/000000-01.png"), "\x89PNG", 4);
    assert_int_equal(truncate(in("frames/000000-01.png"), (off_t)1 << 40), 0);
    refused_with("expected at most");
    assert_int_equal(rename(kept, in("frames/000000-01.png")), 0);
    assert_int_equal(rename(in("frames"), kept), 0);
    assert_int_equal(symlink(kept, in("frames")), 0);
    refused_with("cannot open its frames/");
    assert_int_equal(unlink(in("frames")), 0);
    assert_int_equal(rename(kept, in("frames")), 0);
}

// A model that the journal names outside: neither waited for nor read without an end, and no file but a model replaced.
static void test_the_model_is_a_file(void **state) {
    (void)state;
    char fifo[192], text[400];
    snprintf(fifo, sizeof fifo, "%s/fifo", root);
    assert_int_equal(mkfifo(fifo, 0666), 0);
    const char *const places[] = {"/dev/zero", fifo, root, "/dev/tty"};
    for (size_t i = 0; i < sizeof places / sizeof *places; i++) {
        gonio_doctor_report report;
        put_back(1);
        snprintf(text, sizeof text,
                 "UPDATE settings SET value = '%s' WHERE key = 'result.model_path'; INSERT OR REPLACE INTO settings "
                 "VALUES('model', '%s')",
                 places[i], places[i]);
        sql(text);
        assert_int_equal(gonio_session_doctor(path, false, &report, NULL), GONIO_OK);
        assert_false(report.results_ok);
    }
    snprintf(text, sizeof text, "UPDATE settings SET value = 'spec:file:%s' WHERE key = 'sim.spec'", fifo);
    static const char *const specs[] = {"UPDATE settings SET value = 'file:%s' WHERE key = 'sim.spec'",
                                        "UPDATE settings SET value = json_set(value, '$.reference_brdf', "
                                        "'spec:file:%s,shape=flat') WHERE key = 'facts'",
                                        "UPDATE settings SET value = value || char(10) || 'camera.response=%s' WHERE "
                                        "key = 'sim.settings'"};
    for (size_t i = 0; i < sizeof specs / sizeof *specs; i++) {
        gonio_session *session;
        gonio_rig_file *rig;
        gonio_error error = {0};
        put_back(1);
        snprintf(text, sizeof text, specs[i], fifo);
        sql(text);
        assert_int_equal(gonio_session_open(path, false, &session, NULL), GONIO_OK);
        assert_int_equal(gonio_rig_file_reopen(session, NULL, &rig, &error), GONIO_E_INPUT);
        assert_non_null(strstr(error.message, "a pipe or a device"));
        gonio_session_close(session);
    }
}

// A rollback journal that names a file elsewhere: SQLite would delete that file.
static void test_no_file_elsewhere_is_deleted(void **state) {
    (void)state;
    char victim[160], journal[2048] = "\xd9\xd5\x05\xf9\x20\xa1\x63\xd7";
    snprintf(victim, sizeof victim, "%s/victim", root);
    write_file(victim, "precious", 8);
    put_back(1);
    // A header of no records, then the name, its page, length, sum and the mark at the end.
    journal[8 + 15] = 1; // initial pages, big-endian, is not looked at for no record
    journal[8 + 14] = 2; // sector size 512
    const size_t n = strlen(victim), at = 512;
    uint32_t sum = 0;
    memcpy(journal + at + 4, victim, n);
    for (size_t i = 0; i < n; i++) {
        sum += (unsigned char)victim[i];
    }
    unsigned char *end = (unsigned char *)journal + at + 4 + n;
    for (int i = 0; i < 4; i++) {
        end[i] = (unsigned char)((uint32_t)n >> (24 - 8 * i));
        end[4 + i] = (unsigned char)(sum >> (24 - 8 * i));
    }
    memcpy(end + 8, "\xd9\xd5\x05\xf9\x20\xa1\x63\xd7", 8);
    for (int writable = 0; writable < 2; writable++) {
        gonio_session *session;
        gonio_error error = {0};
        write_file(in("session.db-journal"), journal, at + 4 + n + 16);
        assert_int_equal(gonio_session_open(path, writable == 1, &session, &error), GONIO_E_INPUT);
        assert_non_null(strstr(error.message, "names another file"));
        assert_int_equal(access(victim, F_OK), 0);
    }
}

// Whatever lies where a temporary might go is not written to.
static void test_compressing_writes_through_no_link(void **state) {
    (void)state;
    char victim[160], *data;
    size_t size;
    int64_t saved;
    snprintf(victim, sizeof victim, "%s/precious", root);
    write_file(victim, "precious", 8);
    put_back(2);
    gonio_session *session;
    gonio_exposure *exposures;
    int n;
    gonio_error error = {0};
    assert_int_equal(symlink(victim, in("frames/.000000-01.png.new")), 0);
    // A frame as a burst stores it, so that there is something to make small.
    assert_int_equal(gonio_session_open(path, true, &session, &error), GONIO_OK);
    assert_int_equal(gonio_session_exposures(session, 0, &exposures, &n, NULL), GONIO_OK);
    gonio_exposures_free(exposures, n);
    if (gonio_session_compress(session, 1, &saved, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    gonio_session_close(session);
    assert_int_equal(gonio_file_read(victim, 0, &data, &size, NULL), GONIO_OK);
    assert_int_equal(size, 8);
    free(data);
    assert_int_equal(unlink(in("frames/.000000-01.png.new")), 0);
}

// ---- what a session would make this machine do ----

static bool allow(void *context, const char *devices) {
    snprintf(context, 400, "%s", devices);
    return false;
}

static bool allow_all(void *context, const char *devices) {
    (void)context, (void)devices;
    return true;
}

static void test_stored_devices_need_leave(void **state) {
    (void)state;
    static const char *const rigs[] = {
        "[stage]\ndriver = modbus\n[controller]\nport = tcp:127.0.0.1:1\n",
        "[camera]\ndriver = v4l2\ndevice = /dev/video99\n",
        "[lamp]\ndriver = modbus\n[controller]\nport = /dev/ttyUSB99\nrecord = /tmp/x\n"};
    static const char *const names[] = {"controller.port = tcp:127.0.0.1:1", "/dev/video99", "record = /tmp/x"};
    for (size_t i = 0; i < sizeof rigs / sizeof *rigs; i++) {
        gonio_session *session;
        gonio_rig_file *rig;
        char asked[400] = "", text[400];
        put_back(1);
        snprintf(text, sizeof text, "UPDATE settings SET value = '%s' WHERE key = 'rig.ini'", rigs[i]);
        sql(text);
        assert_int_equal(gonio_session_open(path, false, &session, NULL), GONIO_OK);
        gonio_error error = {0};
        assert_int_equal(gonio_rig_file_reopen(session, NULL, &rig, &error), GONIO_E_USAGE);
        assert_non_null(strstr(error.message, names[i]));
        gonio_rig_file_options options = {.trust = allow, .context = asked};
        assert_int_equal(gonio_rig_file_reopen(session, &options, &rig, &error), GONIO_E_USAGE);
        assert_non_null(strstr(asked, names[i]));
        options.trust = allow_all;
        const gonio_status status = gonio_rig_file_reopen(session, &options, &rig, &error);
        assert_true(status != GONIO_OK && status != GONIO_E_USAGE); // it was tried
        gonio_session_close(session);
    }
}

// No character of an option's text means anything, whatever reads the rig file later.
static void test_texts_come_back_as_they_were(void **state) {
    (void)state;
    static const char *const texts[] = {
        "a ; b", "a # b", "; x", " a ", "a\n[rig]\ndriver = null", "\"a\" = b", "[x]", "Z\xc3\xbcrich\t\x1b[2J"};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        char where[160], setting[100];
        snprintf(where, sizeof where, "%s/texts%zu", root, i);
        snprintf(setting, sizeof setting, "camera.width=24,camera.height=24,rig.serials=1 ; 2 %zu", i);
        const char *const settings[] = {setting};
        const gonio_rig_file_options options = {.sample = "lambert:rho=0.4",
                                                .operator_name = texts[i],
                                                .sample_id = texts[i],
                                                .notes = texts[i],
                                                .settings = settings,
                                                .n_settings = 1,
                                                .seed = 1,
                                                .threads = 1};
        gonio_rig_file *rig;
        gonio_session *session = NULL;
        gonio_measure_options measure;
        gonio_setup setup;
        gonio_error error = {0};
        gonio_measure_options_default(&measure);
        measure.plan = "nusselt:1";
        if (gonio_rig_file_open(&options, &rig, &error) != GONIO_OK ||
            gonio_measure_begin(where, rig, &measure, &session, &error) != GONIO_OK) {
            fail_msg("'%s': %s", texts[i], error.message);
        }
        gonio_rig_file_close(rig);
        assert_int_equal(gonio_setup_get(session, &setup, NULL), GONIO_OK);
        assert_string_equal(setup.facts.operator_name, texts[i]);
        assert_string_equal(setup.facts.sample_id, texts[i]);
        assert_string_equal(setup.facts.notes, texts[i]);
        assert_true(strncmp(setup.facts.serials, "1 ; 2 ", 6) == 0);
        assert_int_equal(gonio_rig_file_reopen(session, NULL, &rig, &error), GONIO_OK);
        gonio_rig_file_close(rig);
        gonio_session_close(session);
    }
}

static void test_events_are_lines(void **state) {
    (void)state;
    gonio_session *session;
    char *events;
    put_back(1);
    sql("INSERT INTO events(utc, kind, text) VALUES('now', 'k' || char(27), 'a' || char(10) || 'b' || char(0x9b) || "
        "char(0x202e) || char(252))");
    assert_int_equal(gonio_session_open(path, false, &session, NULL), GONIO_OK);
    assert_int_equal(gonio_session_events(session, &events, NULL), GONIO_OK);
    assert_non_null(strstr(events, "\nnow k\\x1b: a\\nb\\u009b\\u202e\xc3\xbc\n"));
    free(events);
    gonio_session_close(session);
}

static void test_printable(void **state) {
    (void)state;
    static const char *const texts[][2] = {
        {"plain", "plain"},
        {"Z\xc3\xbcrich \xe2\x82\xac \xf0\x9f\x99\x82", "Z\xc3\xbcrich \xe2\x82\xac \xf0\x9f\x99\x82"},
        {"\x1b[31m", "\\x1b[31m"},
        {"a\r\nb\t", "a\\x0d\\nb\\t"},
        {"\x7f", "\\x7f"},
        {"\xc2\x9b", "\\u009b"},
        {"\xe2\x80\xae", "\\u202e"},
        {"\xff\xc3", "\\xff\\xc3"},
        {"\xc0\xaf", "\\xc0\\xaf"},
        {"\xed\xa0\x80", "\\xed\\xa0\\x80"},
        {"", ""},
    };
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        char out[64];
        gonio_text_printable(texts[i][0], out, sizeof out);
        assert_string_equal(out, texts[i][1]);
        assert_int_equal(gonio_text_is_printable(texts[i][0]), strcmp(texts[i][0], texts[i][1]) == 0);
        for (size_t size = 4; size < sizeof out; size++) {
            gonio_text_printable(texts[i][0], out, size);
            assert_true(strlen(out) < size && gonio_text_is_printable(out));
            assert_true(strcmp(out, texts[i][1]) == 0 || strcmp(out + strlen(out) - 3, "...") == 0);
        }
    }
}

int main(void) {
    alarm(900); // whatever waits for ever is a failure; on a machine that others load it takes minutes
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_values_are_held_against_their_columns),
        cmocka_unit_test(test_a_chained_session_refuses_them_at_once),
        cmocka_unit_test(test_a_chain_vouches_for_no_type),
        cmocka_unit_test(test_settings_are_held_against_their_bounds),
        cmocka_unit_test(test_only_plain_files_are_opened),
        cmocka_unit_test(test_the_model_is_a_file),
        cmocka_unit_test(test_no_file_elsewhere_is_deleted),
        cmocka_unit_test(test_compressing_writes_through_no_link),
        cmocka_unit_test(test_stored_devices_need_leave),
        cmocka_unit_test(test_texts_come_back_as_they_were),
        cmocka_unit_test(test_events_are_lines),
        cmocka_unit_test(test_printable),
    };
    return cmocka_run_group_tests(tests, make_base, remove_base);
}
