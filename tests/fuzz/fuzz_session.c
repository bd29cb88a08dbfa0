// SPDX-License-Identifier: BSD-3-Clause
// A whole session, spoiled: its database by SQL and by bytes, its log, its frames, its settings. Every reader refuses
// it with a reason, or reads on; none crashes, hangs, or takes memory without a bound. The input is a list of
// operations on a small finished session, of version 1 (whose readers see every value) or 2 (which proves itself).
#include <fcntl.h>
#include <stdio.h>
#include <unistd.h>

#include "base/text.h"
#include "host/session/internal.h"
#include "tests/session_readers.h"

int LLVMFuzzerInitialize(int *argc, char ***argv);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static char root[64], session[96];

typedef struct kept_file {
    char name[64];
    char *data;
    size_t size;
    bool spoiled;
} kept_file;
enum { DATABASE, DATABASE_1, LOG, FRAME, FILES = 9 };
static kept_file files[FILES];

static void path_of(const char *name, char path[192]) { snprintf(path, 192, "%s/%s", session, name); }

static void keep(kept_file *file, const char *name) {
    char path[192];
    snprintf(file->name, sizeof file->name, "%s", name);
    path_of(name, path);
    if (gonio_file_read(path, 0, &file->data, &file->size, NULL) != GONIO_OK) {
        abort();
    }
}

static void put(const char *name, const void *data, size_t size) {
    char path[192];
    path_of(name, path);
    unlink(path);
    const int fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (fd < 0 || write(fd, data, size) != (ssize_t)size) {
        abort();
    }
    close(fd);
}

static void clean_up(void) {
    char command[128];
    snprintf(command, sizeof command, "rm -rf %s", root);
    if (system(command) != 0) {
        abort();
    }
}

int LLVMFuzzerInitialize(int *argc, char ***argv) {
    (void)argc, (void)argv;
    gonio_error error = {0};
    snprintf(root, sizeof root, "%s/gonio-fuzz-XXXXXX", access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp");
    if (mkdtemp(root) == NULL) {
        abort();
    }
    atexit(clean_up);
    snprintf(session, sizeof session, "%s/s", root);
    if (make_small_session(session, NULL, &error) != GONIO_OK) {
        fprintf(stderr, "%s\n", error.message);
        abort();
    }
    static const char *const names[] = {"session.db",           "session.db",           "session.log",
                                        "frames/000000-00.png", "frames/000001-00.png", "frames/000002-01.png",
                                        "frames/000004-00.png", "model.gonio",          "frames/000005-00.png"};
    for (int i = 0; i < FILES; i++) {
        if (i == DATABASE_1) {
            char path[192];
            path_of("session.db", path);
            make_it_version_1(path);
        }
        keep(&files[i], names[i]);
    }
    return 0;
}

// ---- operations, 8 bytes each ----

typedef struct operation {
    uint8_t what, a;
    uint16_t b;
    uint32_t c;
} operation;

static const char *const values[] = {"NULL",
                                     "0",
                                     "-1",
                                     "1",
                                     "2",
                                     "1 << 31",
                                     "1 << 61",
                                     "-1 << 62",
                                     "9e999",
                                     "-9e999",
                                     "1e308",
                                     "0.5",
                                     "'x'",
                                     "''",
                                     "x''",
                                     "x'00'",
                                     "zeroblob(100)",
                                     "zeroblob(1000000)",
                                     "CAST(x'1b5b326a' AS TEXT)",
                                     "CAST(x'00ff' AS TEXT)",
                                     "'../../../etc/passwd'",
                                     "'/dev/zero'",
                                     "'file:/dev/zero'",
                                     "'tcp:127.0.0.1:1'",
                                     "hex(zeroblob(5000))",
                                     "replace(hex(zeroblob(5000)), '0', '[')",
                                     "'30000'",
                                     "30000",
                                     "65536",
                                     "-0.0"};
#define VALUES (sizeof values / sizeof *values)

static const char *const statements[] = {
    "CREATE VIEW v AS WITH RECURSIVE t(x) AS (SELECT 1 UNION ALL SELECT x FROM t) SELECT x FROM t",
    "CREATE TRIGGER g AFTER UPDATE ON settings BEGIN DELETE FROM frames; END",
    "CREATE INDEX i ON events(text)",
    "CREATE TABLE more(x)",
    "DROP TABLE flagged",
    "DROP TABLE events",
    "ALTER TABLE steps ADD COLUMN more",
    "PRAGMA user_version = 2",
    "PRAGMA user_version = 1",
    "DELETE FROM settings WHERE key LIKE 'sample%'",
    "DELETE FROM steps WHERE step % 2 = 0",
    "DELETE FROM frames WHERE frame = 0",
    "DELETE FROM samples WHERE step = 4",
    "DELETE FROM final_samples WHERE step = 4",
    "UPDATE steps SET done = 0",
    "INSERT INTO flagged SELECT step FROM steps",
    "UPDATE steps SET kind = 'sample'",
    "UPDATE steps SET kind = 'dark' WHERE step > 3",
    "PRAGMA encoding = 'UTF-16'; VACUUM",
    "PRAGMA page_size = 512; VACUUM",
};
#define STATEMENTS (sizeof statements / sizeof *statements)

static void run(const char *text) {
    char path[192], message[200];
    path_of("session.db", path);
    run_loose_sql(path, text, message); // what cannot be done is not
}

static void set_value(const operation *o) {
    const session_table *t = &gonio_session_tables[o->a % SESSION_TABLES];
    const char *column = t->columns[o->b % (unsigned)gonio_session_columns(t)];
    char text[400];
    snprintf(text, sizeof text, "UPDATE %s SET %s = %s WHERE %s = (SELECT %s FROM %s LIMIT 1 OFFSET %u)", t->name,
             column, values[o->c % VALUES], t->keys[0], t->keys[0], t->name, (o->c >> 8) % 16);
    run(text);
}

// One member of a JSON setting.
static void set_member(const operation *o) {
    static const char *const parts[] = {"camera", "facts", "alignment", "scan", "window", "fit"};
    char text[400];
    snprintf(text, sizeof text,
             "UPDATE settings SET value = json_set(value, '$.\"' || (SELECT j.key FROM json_each(settings.value) AS j "
             "LIMIT 1 OFFSET %u) || '\"', %s) WHERE key = '%s'",
             o->b % 32, values[o->c % VALUES], parts[o->a % 6]);
    run(text);
}

// One character of a setting, or a line of its own behind it.
static void edit_setting(const operation *o) {
    static const char *const lines[] = {"camera.width=65536",       "camera.height=100000000",
                                        "camera.bits=64",           "camera.response=/dev/zero",
                                        "[stage]\ndriver = modbus", "camera.pattern=rggb",
                                        "sample.radius_mm=1e308",   "lamp.drift_percent_per_hour=-1"};
    char text[400];
    if (o->a % 2 == 0) {
        snprintf(text, sizeof text, "UPDATE settings SET value = value || char(10) || '%s' WHERE key = '%s'",
                 lines[o->b % 8], o->c % 2 == 0 ? "sim.settings" : "rig.ini");
    } else {
        snprintf(
            text, sizeof text,
            "UPDATE settings SET value = substr(value, 1, %u) || char(%u) || substr(value, %u) WHERE key = (SELECT "
            "key FROM settings LIMIT 1 OFFSET %u)",
            o->b % 2048, 1 + o->a / 2, o->b % 2048 + 2, o->c % 24);
    }
    run(text);
}

static void set_byte(const char *name, const operation *o) {
    char path[192];
    path_of(name, path);
    const int fd = open(path, O_RDWR | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    struct stat info;
    if (fd < 0 || fstat(fd, &info) != 0 || info.st_size == 0) {
        if (fd >= 0) {
            close(fd);
        }
        return;
    }
    // Half of the time among the first bytes of a page, where its structure stands.
    const off_t any = (off_t)o->c % info.st_size, at = o->b % 2 == 0 ? any : any / 4096 * 4096 + o->b / 2 % 128;
    if (pwrite(fd, &o->a, 1, at) != 1) {
        abort();
    }
    close(fd);
}

// Another page's content in the place of one.
static void copy_page(const operation *o) {
    char path[192], page[4096];
    path_of("session.db", path);
    const int fd = open(path, O_RDWR | O_CLOEXEC);
    struct stat info;
    if (fd < 0 || fstat(fd, &info) != 0) {
        abort();
    }
    const uint32_t pages = (uint32_t)(info.st_size / (off_t)sizeof page);
    if (pages > 1 && pread(fd, page, sizeof page, (off_t)(o->b % pages) * 4096) == (ssize_t)sizeof page &&
        pwrite(fd, page, sizeof page, (off_t)(1 + o->c % (pages - 1)) * 4096) != (ssize_t)sizeof page) {
        abort();
    }
    close(fd);
}

static void spoil_file(const operation *o) {
    kept_file *file = &files[LOG + o->a % (FILES - LOG)];
    char path[192];
    path_of(file->name, path);
    file->spoiled = true;
    switch (o->b % 8) {
    case 0:
        unlink(path);
        break;
    case 1:
        unlink(path);
        mkfifo(path, 0666);
        break;
    case 2:
        unlink(path);
        symlink("/dev/zero", path);
        break;
    case 3:
        truncate(path, (off_t)(o->c % 8192));
        break;
    case 4:
        truncate(path, o->c % 2 == 0 ? (off_t)1 << (file == &files[LOG] ? 26 : 40)
                                     : (off_t)o->c % (1 << 20)); // much of it a hole
        break;
    default:
        set_byte(file->name, o);
    }
}

static void do_operation(const operation *o) {
    switch (o->what % 8) {
    case 0:
    case 1:
        set_value(o);
        return;
    case 2:
        set_member(o);
        return;
    case 3:
        edit_setting(o);
        return;
    case 4:
        set_byte("session.db", o);
        return;
    case 5:
        copy_page(o);
        return;
    case 6:
        spoil_file(o);
        return;
    default:
        run(statements[o->b % STATEMENTS]);
    }
}

// ---- one input ----

static void put_back(int version) {
    static const char *const others[] = {"session.db-wal", "session.db-shm", "session.db-journal"};
    char path[192];
    for (int i = 0; i < 3; i++) {
        path_of(others[i], path);
        unlink(path);
    }
    put("session.db", files[version == 1 ? DATABASE_1 : DATABASE].data,
        files[version == 1 ? DATABASE_1 : DATABASE].size);
    for (int i = LOG; i < FILES; i++) {
        if (files[i].spoiled) {
            put(files[i].name, files[i].data, files[i].size);
            files[i].spoiled = false;
        }
    }
}

static void must_tell(gonio_status status, const gonio_error *error) {
    if (status != GONIO_OK && (error->message[0] == 0 || error->status != status)) {
        abort();
    }
}

// What a resume reads before anything moves: the rig of the journal, simulated ones alone.
static void reopen_rig(void) {
    gonio_session *s;
    gonio_rig_file *rig;
    gonio_error error = {0};
    if (gonio_session_open(session, false, &s, &error) == GONIO_OK) {
        must_tell(gonio_rig_file_reopen(s, NULL, &rig, &error), &error);
        gonio_rig_file_close(rig);
        gonio_session_close(s);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size == 0) {
        return 0;
    }
    put_back(data[0] % 4 == 0 ? 2 : 1);
    for (size_t at = 1, n = 0; at + 8 <= size && n < 8; at += 8, n++) {
        operation o = {data[at], data[at + 1], 0, 0};
        memcpy(&o.b, data + at + 2, sizeof o.b);
        memcpy(&o.c, data + at + 4, sizeof o.c);
        do_operation(&o);
    }
    uint64_t digest;
    gonio_error error = {0};
    must_tell(read_everything(session, &digest, &error), &error);
    if (data[0] % 8 >= 6) {
        reopen_rig();
    }
    return 0;
}
