// SPDX-License-Identifier: BSD-3-Clause
// The journal proves itself: whatever is changed behind its back is found and named, and session.db and session.log are
// each enough to have all of it again.
#include <fcntl.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "host/session/internal.h"
#include "tests/unit/small_session.h"

static session_proof proof_of(const char *folder) {
    gonio_session *session;
    session_proof proof;
    gonio_error error = {0};
    assert_int_equal(gonio_session_open_unproven(folder, false, &session, &error), GONIO_OK);
    assert_int_equal(gonio_session_verify(session, &proof, &error), GONIO_OK);
    gonio_session_close(session);
    return proof;
}

static void assert_sound(const char *folder) {
    const session_proof proof = proof_of(folder);
    assert_string_equal(proof.what, "");
    assert_true(proof.sound && proof.database && proof.log == SESSION_LOG_SOUND);
    assert_int_equal(proof.log_seq, proof.seq);
}

// Refused with table, row and column, or what else the text is.
static void assert_refused(const char *folder, const char *why) {
    for (int writable = 0; writable < 2; writable++) {
        gonio_session *session;
        gonio_error error = {0};
        assert_int_equal(gonio_session_open(folder, writable, &session, &error), GONIO_E_INPUT);
        if (strstr(error.message, why) == NULL) {
            print_message("expected: %s\nfound: %s\n", why, error.message);
        }
        assert_non_null(strstr(error.message, why));
    }
}

// All rows as JSON, those of events and hosts left out where they are not to be compared.
static char *dump(const char *folder, bool all) {
    gonio_session *session;
    char *text;
    size_t size;
    FILE *stream = open_memstream(&text, &size);
    assert_int_equal(gonio_session_open_unproven(folder, false, &session, NULL), GONIO_OK);
    for (const session_table *t = gonio_session_tables; t->name != NULL; t++) {
        char columns[SESSION_COLUMNS_SQL], query[SESSION_COLUMNS_SQL + 64];
        sqlite3_stmt *rows;
        if (!all && (strcmp(t->name, "events") == 0 || strcmp(t->name, "hosts") == 0)) {
            continue;
        }
        gonio_session_list_columns(t, "", columns);
        snprintf(query, sizeof query, "SELECT %s FROM %s ORDER BY 1, 2", columns, t->name);
        if (t->columns[1] == NULL) {
            snprintf(query, sizeof query, "SELECT %s FROM %s ORDER BY 1", columns, t->name);
        }
        assert_int_equal(sqlite3_prepare_v2(session->db, query, -1, &rows, NULL), SQLITE_OK);
        while (sqlite3_step(rows) == SQLITE_ROW) {
            json_t *row = gonio_session_row_json(t, rows, 0);
            json_dumpf(row, stream, JSON_COMPACT | JSON_REAL_PRECISION(17));
            fprintf(stream, " %s\n", t->name);
            json_decref(row);
        }
        sqlite3_finalize(rows);
    }
    fclose(stream);
    gonio_session_close(session);
    return text;
}

static void assert_same_rows(const char *a, const char *b, bool all) {
    char *one = dump(a, all), *other = dump(b, all);
    assert_string_equal(one, other);
    free(one);
    free(other);
}

// Finished, with a row or more in every table, and of two hosts.
static void make_finished(void) {
    gonio_session *session = make_session();
    finish_all(session);
    gonio_session_close(session);
    session = reopen(true);
    gonio_samples *samples;
    assert_int_equal(gonio_session_samples(session, &samples, NULL), GONIO_OK);
    assert_int_equal(gonio_session_begin(session, NULL), GONIO_OK);
    assert_int_equal(gonio_session_put_final(session, samples, NULL), GONIO_OK);
    assert_int_equal(gonio_session_put(session, "result.samples_sha256", "x", NULL), GONIO_OK);
    const gonio_step_radiance radiance = {.channels = 2, .mean = {0.1, 1.0 / 3}, .sha256 = "y"};
    assert_int_equal(gonio_session_put_radiance(session, 3, &radiance, NULL), GONIO_OK);
    assert_int_equal(gonio_session_put_file(session, "plan", "a/b.csv", "1,2", 3, NULL), GONIO_OK);
    assert_int_equal(gonio_session_do(session, NULL, "INSERT INTO flagged VALUES(3)", ""), GONIO_OK);
    assert_int_equal(gonio_session_commit(session, NULL), GONIO_OK);
    assert_int_equal(gonio_session_event(session, "test", "line\nZ\xc3\xbcrich \xff and \x01", NULL), GONIO_OK);
    gonio_samples_free(samples);
    gonio_session_close(session);
}

// ---- the chain ----

static void test_every_change_is_chained(void **state) {
    (void)state;
    gonio_session *session = make_session();
    assert_sound(path);
    finish_all(session);
    assert_sound(path); // beside the writer
    assert_int_equal(gonio_session_put(session, "notes", "a", NULL), GONIO_OK);
    assert_int_equal(gonio_session_put(session, "notes", "b", NULL), GONIO_OK);
    assert_int_equal(gonio_session_undo_step(session, 3, "test", NULL), GONIO_OK);
    assert_sound(path);
    const int64_t before = proof_of(path).seq;
    assert_int_equal(gonio_session_begin(session, NULL), GONIO_OK);
    assert_int_equal(gonio_session_put(session, "notes", "never", NULL), GONIO_OK);
    assert_int_equal(gonio_session_undo_step(session, 4, "never", NULL), GONIO_OK);
    gonio_session_rollback(session);
    assert_int_equal(proof_of(path).seq, before);
    assert_int_equal(finish(session, 3, NULL), GONIO_OK);
    assert_int_equal(gonio_session_exec(session, "DELETE FROM settings WHERE key = 'notes'", NULL), GONIO_OK);
    gonio_session_close(session);
    assert_sound(path);
    gonio_session_close(reopen(true)); // changes nothing, and is no host that wrote
    session = reopen(false);
    int64_t hosts;
    assert_int_equal(gonio_session_integer(session, "SELECT count(*) FROM hosts", &hosts, NULL), GONIO_OK);
    assert_int_equal(hosts, 1);
    gonio_session_close(session);
}

static void flip(const char *table, const char *column, char key[SESSION_KEY]) {
    char file[128], query[512];
    sqlite3 *db;
    sqlite3_stmt *row;
    snprintf(file, sizeof file, "%s/session.db", path);
    assert_int_equal(sqlite3_open(file, &db), SQLITE_OK);
    char key_sql[SESSION_KEY_SQL] = "CAST(seq AS TEXT)";
    if (gonio_session_table(table) != NULL) {
        gonio_session_key_sql(gonio_session_table(table), "", key_sql);
    }
    // The last row that has a value there; the last of all where none has.
    snprintf(query, sizeof query, "SELECT %s FROM %s ORDER BY %s IS NULL, 1 DESC LIMIT 1", key_sql, table, column);
    assert_int_equal(sqlite3_prepare_v2(db, query, -1, &row, NULL), SQLITE_OK);
    assert_int_equal(sqlite3_step(row), SQLITE_ROW);
    snprintf(key, SESSION_KEY, "%s", (const char *)sqlite3_column_text(row, 0));
    sqlite3_finalize(row);
    snprintf(query, sizeof query,
             "UPDATE %s SET %s = CASE typeof(%s) WHEN 'integer' THEN %s + 1000 WHEN 'real' THEN %s * 1.5 + 0.125"
             " WHEN 'blob' THEN zeroblob(length(%s)) WHEN 'text' THEN replace(%s || 'x', 'commitx', 'put') ELSE 7 END"
             " WHERE %s = '%s'",
             table, column, column, column, column, column, column, key_sql, key);
    assert_int_equal(sqlite3_exec(db, query, NULL, NULL, NULL), SQLITE_OK);
    assert_int_equal(sqlite3_changes(db), 1);
    sqlite3_close(db);
}

static void flip_each(const char *table, const char *const *columns, const char *const *keys) {
    for (int i = 0; columns[i] != NULL; i++) {
        char key[SESSION_KEY], expected[SESSION_KEY + 80];
        shell_does("rm -rf %s && cp -r %s/whole %s", path, root, path);
        flip(table, columns[i], key);
        const bool is_key = strcmp(columns[i], keys[0]) == 0 || (keys[1] != NULL && strcmp(columns[i], keys[1]) == 0);
        snprintf(expected, sizeof expected, is_key ? "table %s, row %s" : "table %s, row %s, column %s:", table, key,
                 columns[i]);
        assert_refused(path, expected);
    }
}

static void test_every_column_is_vouched_for(void **state) {
    (void)state;
    make_finished();
    shell_does("mv %s %s/whole", path, root);
    for (const session_table *t = gonio_session_tables; t->name != NULL; t++) {
        flip_each(t->name, t->columns, t->keys);
    }
    static const char *const columns[] = {"seq", "tbl", "key", "op", "content", "hash", NULL}, *const keys[2] = {"seq"};
    flip_each("chain", columns, keys);
}

// The last text of a column as a blob of the same bytes, or with more after a 0: what reads texts alone sees the same.
static void retype_each(const char *table, const char *const *columns) {
    static const char *const ways[] = {"CAST(%s AS BLOB)", "%s || char(0) || 'x'"};
    for (int i = 0; columns[i] != NULL; i++) {
        for (int w = 0; w < 2; w++) {
            char text[512], value[96], expected[64];
            snprintf(value, sizeof value, ways[w], columns[i]);
            snprintf(
                text, sizeof text,
                "UPDATE %s SET %s = %s WHERE typeof(%s) = 'text' AND %s = (SELECT max(%s) FROM %s WHERE typeof(%s) "
                "= 'text')",
                table, columns[i], value, columns[i], columns[i], columns[i], table, columns[i]);
            shell_does("rm -rf %s && cp -r %s/whole %s", path, root, path);
            if (sql(text) > 0) {
                snprintf(expected, sizeof expected, "table %s, row ", table);
                assert_refused(path, expected);
            }
        }
    }
}

static void test_types_are_vouched_for(void **state) {
    (void)state;
    make_finished();
    shell_does("mv %s %s/whole", path, root);
    for (const session_table *t = gonio_session_tables; t->name != NULL; t++) {
        retype_each(t->name, t->columns);
    }
    static const char *const columns[] = {"tbl", "key", "op", "content", "hash", NULL};
    retype_each("chain", columns);
}

static void test_every_row_is_vouched_for(void **state) {
    (void)state;
    make_finished();
    shell_does("mv %s %s/whole", path, root);
    for (int i = 0; i <= SESSION_TABLES; i++) {
        const char *table = i < SESSION_TABLES ? gonio_session_tables[i].name : "chain";
        char text[512], expected[64];
        shell_does("rm -rf %s && cp -r %s/whole %s", path, root, path);
        snprintf(text, sizeof text,
                 "CREATE TEMP TABLE one AS SELECT * FROM %s LIMIT 1 OFFSET 1; DELETE FROM %s WHERE (SELECT count(*)"
                 " FROM one) = 0; DELETE FROM %s WHERE %s = (SELECT %s FROM one) ",
                 table, table, table, i < SESSION_TABLES ? gonio_session_tables[i].keys[0] : "seq",
                 i < SESSION_TABLES ? gonio_session_tables[i].keys[0] : "seq");
        sql(text);
        snprintf(expected, sizeof expected, "table %s, row ", table);
        assert_refused(path, expected);
        assert_refused(path, "missing");
    }
    shell_does("rm -rf %s && cp -r %s/whole %s", path, root, path);
    sql("INSERT INTO settings VALUES('camera.gain', '2')");
    assert_refused(path, "table settings, row camera.gain: it is there and was never journalled");
}

// One letter of a table's text in the other case: to SQLite the same table, and yet not what was written.
static void test_the_schema_is_vouched_for(void **state) {
    (void)state;
    make_finished();
    shell_does("mv %s %s/whole", path, root);
    for (int i = 0; i <= 3 * SESSION_TABLES + 2; i++) {
        const char *table = i / 3 < SESSION_TABLES ? gonio_session_tables[i / 3].name : "chain";
        char text[512], expected[64];
        shell_does("rm -rf %s && cp -r %s/whole %s", path, root, path);
        // C of CREATE, the first column's first letter, the last letter.
        snprintf(text, sizeof text,
                 "PRAGMA writable_schema = ON; UPDATE sqlite_master SET sql = (SELECT substr(sql, 1, n - 1) || "
                 "iif(upper(c) = c, lower(c), upper(c)) || substr(sql, n + 1) FROM (SELECT n, substr(sql, n, 1) AS c "
                 "FROM (SELECT %s AS n))) WHERE type = 'table' AND name = '%s'",
                 i % 3 == 0   ? "1"
                 : i % 3 == 1 ? "instr(sql, '(') + 1"
                              : "length(rtrim(sql, ')'))",
                 table);
        sql(text);
        snprintf(expected, sizeof expected, "table %s", table);
        assert_refused(path, expected);
    }
}

// ---- the log ----

static long file_size(const char *name) {
    char file[160];
    struct stat info;
    snprintf(file, sizeof file, "%s/%s", path, name);
    return stat(file, &info) == 0 ? (long)info.st_size : -1;
}

static void assert_log_is(const char *folder) { shell_does("cmp %s/session.log %s/session.log", path, folder); }

static void test_log_torn_anywhere(void **state) {
    (void)state;
    gonio_session *session = make_session();
    assert_int_equal(finish(session, 0, NULL), GONIO_OK);
    const long before = file_size("session.log");
    assert_int_equal(gonio_session_put(session, "notes", "the last transaction", NULL), GONIO_OK);
    const long after = file_size("session.log");
    gonio_session_close(session);
    shell_does("cp -r %s %s/whole", path, root);
    char whole[96], file[128];
    snprintf(whole, sizeof whole, "%.64s/whole", root);
    snprintf(file, sizeof file, "%s/session.log", path);
    assert_true(before > 0 && after > before + 100);
    for (long size = after - 1; size >= before; size--) {
        assert_int_equal(truncate(file, size), 0);
        const session_proof proof = proof_of(path);
        assert_true(proof.sound && proof.log_lag == 1);
        if ((size - before) % 4 == 0) {
            gonio_session_close(reopen(true));
            assert_int_equal(file_size("session.log"), after);
        }
    }
    assert_log_is(whole);
    assert_int_equal(file_size("lost+found"), -1);
    // Sectors that never reached the disk read as zeros: what stands there is kept, and the lines come back.
    for (long at = before; at < after; at += 97) {
        char zeros[64] = {0};
        overwrite("session.log", at, zeros, sizeof zeros < (size_t)(after - at) ? sizeof zeros : (size_t)(after - at));
        assert_true(proof_of(path).sound);
        gonio_session_close(reopen(true));
        assert_log_is(whole);
    }
    assert_true(file_size("lost+found/session.log.tail") > 0 && file_size("lost+found/session.log.tail.1") > 0);
}

static void test_log_behind(void **state) {
    (void)state;
    gonio_session *session = make_session();
    assert_int_equal(finish(session, 0, NULL), GONIO_OK);
    shell_does("cp %s/session.log %s/log", path, root);
    assert_int_equal(finish(session, 1, NULL), GONIO_OK);
    assert_int_equal(finish(session, 2, NULL), GONIO_OK);
    assert_int_equal(gonio_session_put(session, "camera.bits", "12", NULL), GONIO_OK);
    gonio_session_close(session);
    shell_does("cp -r %s %s/whole && cp %s/log %s/session.log", path, root, root, path);
    session_proof proof = proof_of(path);
    assert_true(!proof.sound && proof.database && proof.log == SESSION_LOG_SHORT && proof.log_lag == 3);
    gonio_session_close(reopen(false)); // the database proves itself
    assert_false(proof_of(path).sound);
    gonio_session_close(reopen(true));
    assert_sound(path);
    shell_does("cmp %s/lost+found/session.log %s/log && grep -q 'session.log' %s/lost+found/LIST", path, root, path);
    // No log at all, and one with a damaged line amid it.
    shell_does("rm -r %s && cp -r %s/whole %s && rm %s/session.log", path, root, path, path);
    assert_int_equal(proof_of(path).log, SESSION_LOG_MISSING);
    gonio_session_close(reopen(true));
    assert_sound(path);
    shell_does("rm -r %s && cp -r %s/whole %s", path, root, path);
    overwrite("session.log", 700, "#", 1);
    proof = proof_of(path);
    assert_true(proof.database && !proof.sound && proof.log == SESSION_LOG_DAMAGED);
    assert_non_null(strstr(proof.what, "session.log, line "));
    gonio_session_close(reopen(true));
    assert_sound(path);
}

static void test_database_behind(void **state) {
    (void)state;
    gonio_session *session = make_session();
    assert_int_equal(finish(session, 0, NULL), GONIO_OK);
    gonio_session_close(session);
    shell_does("cp -r %s %s/early", path, root);
    session = reopen(true);
    for (int64_t k = 1; k < STEPS; k++) {
        assert_int_equal(finish(session, k, NULL), GONIO_OK);
    }
    gonio_session_close(session);
    // As of a folder that was copied while a measure ran: the database first, the log last.
    shell_does("cp -r %s %s/whole && cp %s/early/session.db %s/session.db", path, root, root, path);
    assert_int_equal(proof_of(path).log, SESSION_LOG_AHEAD);
    assert_refused(path, "session.log has what session.db lacks");
    char made[96], whole[96];
    snprintf(made, sizeof made, "%.64s/made", root);
    snprintf(whole, sizeof whole, "%.64s/whole", root);
    shell_does("mkdir -p %s/frames", made);
    session_rebuilt report;
    assert_int_equal(gonio_session_rebuild(path, made, &report, NULL), GONIO_OK);
    assert_true(report.complete && report.lost == 0 && !report.forked);
    assert_sound(made);
    assert_same_rows(made, whole, false);
    // Another way to go on from the same beginning: neither may be taken for the other.
    session = NULL;
    shell_does("mv %s %s/x && mv %s/early %s", path, root, root, path);
    session = reopen(true);
    assert_int_equal(gonio_session_put(session, "notes", "another way", NULL), GONIO_OK);
    gonio_session_close(session);
    shell_does("cp %s/session.log %s/session.log", whole, path);
    assert_refused(path, "session.log contradicts session.db");
    shell_does("rm -r %s && mkdir -p %s/frames", made, made);
    assert_int_equal(gonio_session_rebuild(path, made, &report, NULL), GONIO_OK);
    assert_true(report.forked);
}

// The log cannot grow: what is committed stands, one transaction may lag, and the next one says why it cannot be.
static void test_no_room_for_the_log(void **state) {
    (void)state;
    gonio_session *session = make_session();
    char *text = malloc(100001);
    memset(text, 'x', 100000);
    text[100000] = 0;
    for (int i = 0; i < 12; i++) {
        text[0] = (char)('a' + i);
        assert_int_equal(gonio_session_put(session, "notes", text, NULL), GONIO_OK);
    }
    gonio_session_close(session);
    session = reopen(true);
    struct rlimit before, small;
    getrlimit(RLIMIT_FSIZE, &before);
    signal(SIGXFSZ, SIG_IGN);
    small = (struct rlimit){700000, before.rlim_max};
    setrlimit(RLIMIT_FSIZE, &small);
    gonio_error error = {0};
    const gonio_status first = gonio_session_put(session, "one", "1", &error);
    const gonio_status second = gonio_session_put(session, "two", "2", &error);
    setrlimit(RLIMIT_FSIZE, &before);
    assert_int_equal(first, GONIO_OK);
    assert_int_equal(second, GONIO_E_IO);
    assert_non_null(strstr(error.message, "session.log"));
    session_proof proof = proof_of(path);
    assert_true(proof.sound && proof.log_lag == 1);
    assert_int_equal(gonio_session_put(session, "two", "2", &error), GONIO_OK);
    gonio_session_close(session);
    assert_sound(path);
    free(text);
}

// ---- made anew ----

static session_rebuilt rebuild(char made[96]) {
    session_rebuilt report;
    gonio_error error = {0};
    snprintf(made, 96, "%.64s/made", root);
    shell_does("rm -rf %s && mkdir -p %s && cp -r %s/frames %s/frames", made, made, path, made);
    const gonio_status status = gonio_session_rebuild(path, made, &report, &error);
    if (status != GONIO_OK) {
        print_message("%s\n", error.message);
    }
    assert_int_equal(status, GONIO_OK);
    return report;
}

static void assert_rebuilt(const char *whole) {
    char made[96];
    const session_rebuilt report = rebuild(made);
    assert_string_equal(report.detail, "");
    assert_true(report.complete && report.lost == 0 && report.rows > 20);
    assert_sound(made);
    assert_same_rows(made, whole, false);
    gonio_doctor_report doctor;
    assert_int_equal(gonio_session_doctor(made, false, &doctor, NULL), GONIO_OK);
    assert_true(doctor.database_ok && doctor.frames_bad == 0 && doctor.samples_bad == 0);
    shell_does("ls -A %s | grep -q copy && exit 1 || exit 0", made);
}

static void test_either_is_enough(void **state) {
    (void)state;
    make_finished();
    char whole[96];
    snprintf(whole, sizeof whole, "%.64s/whole", root);
    shell_does("cp -r %s %s", path, whole);
    assert_rebuilt(whole);
    shell_does("rm %s/session.log", path);
    assert_rebuilt(whole);
    shell_does("cp %s/session.log %s/ && rm %s/session.db", whole, path, path);
    assert_rebuilt(whole);
    // Something else under its name, and each of its pages gone.
    shell_does("head -c 100000 /dev/urandom > %s/session.db", path);
    assert_rebuilt(whole);
    char junk[4096];
    memset(junk, 0xa5, sizeof junk);
    for (long at = 0; at < 14; at += 2) {
        shell_does("cp %s/session.db %s/", whole, path);
        overwrite("session.db", 4096 * at, junk, sizeof junk);
        assert_rebuilt(whole);
    }
}

// A part of each is gone, and what the two have together is all of it.
static void test_both_together(void **state) {
    (void)state;
    make_finished();
    char whole[96];
    snprintf(whole, sizeof whole, "%.64s/whole", root);
    shell_does("cp -r %s %s", path, whole);
    for (const session_table *t = gonio_session_tables; t->name != NULL; t++) {
        char spoil[128];
        shell_does("cp %s/session.db %s/session.log %s/", whole, whole, path);
        snprintf(spoil, sizeof spoil, "DELETE FROM %s", t->name);
        sql(spoil);
        // Every line that tells of another table's rows.
        shell_does("sed -i '/\"tbl\":\"%s\"/!s/\"op\"/\"OP\"/' %s/session.log", t->name, path);
        assert_rebuilt(whole);
    }
    // What neither has is told, row by row, and nothing is called finished that lost something.
    shell_does("cp %s/session.db %s/session.log %s/", whole, whole, path);
    sql("DELETE FROM samples WHERE step = 3; UPDATE settings SET value = '13' WHERE key = 'camera.bits'");
    shell_does("sed -i '/\"tbl\":\"samples\",\"key\":\"3\"/s/\"op\"/\"OP\"/; /\"key\":\"camera.bits\"/s/12/11/'"
               " %s/session.log",
               path);
    char made[96];
    const session_rebuilt report = rebuild(made);
    assert_true(report.complete && report.lost == 2);
    assert_non_null(strstr(report.detail, "table samples, row 3 is lost"));
    assert_non_null(strstr(report.detail, "table settings, row camera.bits is lost"));
    assert_sound(made);
    gonio_session *session;
    char *text;
    assert_int_equal(gonio_session_open(made, false, &session, NULL), GONIO_OK);
    assert_int_equal(gonio_session_get(session, "result.samples_sha256", &text, NULL), GONIO_E_INPUT);
    gonio_session_close(session);
}

// Any damage to one of the two: all is there again.
static void test_random_damage(void **state) {
    (void)state;
    make_finished();
    char whole[96];
    snprintf(whole, sizeof whole, "%.64s/whole", root);
    shell_does("cp -r %s %s", path, whole);
    uint32_t seed = 7;
    for (int i = 0; i < 24; i++) {
        const char *name = i % 2 == 0 ? "session.db" : "session.log";
        shell_does("cp %s/session.db %s/session.log %s/", whole, whole, path);
        for (int k = 0; k < 1 + 2 * i; k++) {
            char byte = (char)(next(&seed) >> 24);
            overwrite(name, (long)(next(&seed) % (uint32_t)file_size(name)), &byte, 1);
        }
        assert_rebuilt(whole);
        // What is read at all is what was written.
        gonio_session *session;
        if (gonio_session_open(path, false, &session, NULL) == GONIO_OK) {
            gonio_session_close(session);
            assert_same_rows(path, whole, true);
        }
    }
}

// ---- version 1 ----

static const char schema_1[] =
    "CREATE TABLE settings(key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;"
    "CREATE TABLE steps(step INTEGER PRIMARY KEY, kind TEXT NOT NULL, theta_i_deg REAL NOT NULL,"
    " phi_i_deg REAL NOT NULL, theta_o_deg REAL NOT NULL, phi_o_deg REAL NOT NULL, done INTEGER NOT NULL DEFAULT 0,"
    " frames INTEGER NOT NULL DEFAULT 0, clock_end_s REAL, exposure_end_s REAL);"
    "CREATE TABLE frames(step INTEGER NOT NULL REFERENCES steps(step), frame INTEGER NOT NULL, file TEXT NOT NULL,"
    " sha256 TEXT NOT NULL, x INTEGER NOT NULL, y INTEGER NOT NULL, width INTEGER NOT NULL, height INTEGER NOT NULL,"
    " exposure_s REAL NOT NULL, gain_db REAL NOT NULL, clock_s REAL NOT NULL, monitor REAL, monitor_sigma REAL,"
    " PRIMARY KEY(step, frame)) WITHOUT ROWID;"
    "CREATE TABLE samples(step INTEGER PRIMARY KEY REFERENCES steps(step), n INTEGER NOT NULL,"
    " channels INTEGER NOT NULL, rows BLOB NOT NULL, sha256 TEXT NOT NULL);"
    "CREATE TABLE final_samples(step INTEGER PRIMARY KEY REFERENCES steps(step), n INTEGER NOT NULL,"
    " channels INTEGER NOT NULL, rows BLOB NOT NULL, sha256 TEXT NOT NULL);"
    "CREATE TABLE events(event INTEGER PRIMARY KEY, utc TEXT NOT NULL, kind TEXT NOT NULL, text TEXT NOT NULL);";

// The session at `path` as the first release would have left it.
static void make_version_1(void) {
    char text[4096];
    snprintf(text, sizeof text,
             "ATTACH '%s/old.db' AS old; PRAGMA application_id = %d; PRAGMA user_version = 1; %s"
             "INSERT INTO settings SELECT * FROM old.settings; INSERT INTO events SELECT * FROM old.events;"
             "INSERT INTO steps SELECT step, kind, theta_i_deg, phi_i_deg, theta_o_deg, phi_o_deg, done, frames,"
             " clock_end_s, exposure_end_s FROM old.steps;"
             "INSERT INTO frames SELECT step, frame, file, sha256, x, y, width, height, exposure_s, gain_db, clock_s,"
             " monitor, monitor_sigma FROM old.frames; INSERT INTO samples SELECT * FROM old.samples;"
             "INSERT INTO final_samples SELECT * FROM old.final_samples",
             path, SESSION_APPLICATION_ID, schema_1);
    shell_does("cd %s && mv session.db old.db && rm session.log", path);
    sql(text);
    shell_does("rm %s/old.db", path);
}

static char *schema_of(const char *folder) {
    char command[160];
    static char text[16384];
    snprintf(command, sizeof command, "%s/session.db", folder);
    sqlite3 *db;
    sqlite3_stmt *rows;
    text[0] = 0;
    assert_int_equal(sqlite3_open(command, &db), SQLITE_OK);
    assert_int_equal(
        sqlite3_prepare_v2(db, "SELECT sql FROM sqlite_master WHERE sql NOT NULL ORDER BY name", -1, &rows, NULL),
        SQLITE_OK);
    while (sqlite3_step(rows) == SQLITE_ROW) {
        strcat(strcat(text, (const char *)sqlite3_column_text(rows, 0)), "\n");
    }
    sqlite3_finalize(rows);
    sqlite3_close(db);
    return strdup(text);
}

static void test_version_1_is_adopted(void **state) {
    (void)state;
    make_finished();
    char *schema = schema_of(path);
    make_version_1();
    shell_does("cp -r %s %s/whole", path, root);
    const session_proof proof = proof_of(path);
    assert_true(!proof.chained && proof.database);
    gonio_session *session = reopen(false); // read as it is
    gonio_step *steps;
    size_t n;
    gonio_exposure *exposures;
    int frames;
    assert_int_equal(gonio_session_steps(session, &steps, &n, NULL), GONIO_OK);
    assert_true(n == STEPS && steps[4].done);
    free(steps);
    assert_int_equal(gonio_session_exposures(session, 4, &exposures, &frames, NULL), GONIO_OK);
    gonio_exposures_free(exposures, frames);
    gonio_session_close(session);
    shell_does("cmp %s/session.db %s/whole/session.db && test ! -e %s/session.log", path, root, path);
    gonio_doctor_report report;
    assert_int_equal(gonio_session_doctor(path, false, &report, NULL), GONIO_OK);
    assert_true(report.database_ok && report.frames_bad == 0);
    assert_non_null(strstr(report.detail, "version 1"));
    session = reopen(true);
    assert_int_equal(gonio_session_put(session, "notes", "adopted", NULL), GONIO_OK);
    gonio_session_close(session);
    assert_sound(path);
    char *adopted = schema_of(path), *events;
    assert_string_equal(adopted, schema);
    free(adopted);
    free(schema);
    session = reopen(false);
    assert_int_equal(gonio_session_events(session, &events, NULL), GONIO_OK);
    assert_non_null(strstr(events, "adopted: "));
    free(events);
    gonio_session_close(session);
    char whole[96];
    snprintf(whole, sizeof whole, "%.64s/copy", root);
    shell_does("cp -r %s %s && rm %s/session.db", path, whole, path);
    assert_rebuilt(whole);
}

// ---- going on ----

// Frames that a finished step has and the folder has not; and files of another size, whose pixels decide.
static void test_frames_are_there(void **state) {
    (void)state;
    gonio_session *session = make_session();
    finish_all(session);
    gonio_error error = {0};
    assert_int_equal(gonio_session_check_present(session, &error), GONIO_OK);
    static const char *const spoiled[] = {"rm 000003-01.png",
                                          "truncate -s 100 000003-01.png",
                                          "truncate -s 0 000003-01.png",
                                          "rm 000003-01.png; mkdir 000003-01.png",
                                          "ln -sf 000003-00.png 000003-01.png",
                                          "cp 000003-00.png 000003-01.png"};
    shell_does("cp -r %s/frames %s/frames", path, root);
    for (size_t i = 0; i < sizeof spoiled / sizeof *spoiled; i++) {
        shell_does("cd %s/frames && %s", path, spoiled[i]);
        assert_int_equal(gonio_session_check_present(session, &error), GONIO_E_INPUT);
        assert_non_null(strstr(error.message, "1 of 10 frames"));
        assert_non_null(strstr(error.message, "frames/000003-01.png"));
        shell_does("rm -r %s/frames/000003-01.png; cp %s/frames/000003-01.png %s/frames/", path, root, path);
    }
    // Compressed without the row knowing: the same pixels.
    assert_int_equal(gonio_session_exec(session, "UPDATE frames SET bytes = bytes + 9 WHERE step = 3", NULL), GONIO_OK);
    assert_int_equal(gonio_session_check_present(session, &error), GONIO_OK);
    assert_int_equal(gonio_session_exec(session, "UPDATE frames SET bytes = NULL", NULL), GONIO_OK);
    assert_int_equal(gonio_session_check_present(session, &error), GONIO_OK);
    gonio_session_close(session);
}

// Rows under a step that is not done: the step is measured all the same.
static void test_rows_of_undone_steps(void **state) {
    (void)state;
    make_finished();
    sql("UPDATE steps SET done = 0 WHERE step = 3");
    make_version_1();
    gonio_session *session = reopen(true);
    gonio_error error = {0};
    assert_true(finish(session, 3, &error) < 0);
    assert_int_equal(gonio_session_drop_undone(session, &error), GONIO_OK);
    assert_int_equal(gonio_session_drop_undone(session, &error), GONIO_OK); // once
    assert_int_equal(finish(session, 3, &error), GONIO_OK);
    char *events;
    assert_int_equal(gonio_session_events(session, &events, NULL), GONIO_OK);
    assert_non_null(strstr(events, "dropped: 4 rows of steps that are not done"));
    free(events);
    gonio_session_close(session);
    assert_sound(path);
    shell_does("grep -q '\"tbl\":\"frames\",\"key\":\"3/1\",\"op\":\"put\",\"row\"' %s/session.log", path);
}

int main(void) {
#define T(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        T(test_every_change_is_chained),
        T(test_every_column_is_vouched_for),
        T(test_types_are_vouched_for),
        T(test_every_row_is_vouched_for),
        T(test_the_schema_is_vouched_for),
        T(test_log_torn_anywhere),
        T(test_log_behind),
        T(test_database_behind),
        T(test_no_room_for_the_log),
        T(test_either_is_enough),
        T(test_both_together),
        T(test_random_damage),
        T(test_version_1_is_adopted),
        T(test_frames_are_there),
        T(test_rows_of_undone_steps),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
