// SPDX-License-Identifier: BSD-3-Clause
// A session as one HDF5 file: it comes back as it was, and a file that is not what it was is refused, with nothing left
// behind.
#include <dirent.h>
#include <hdf5.h>
#include <math.h>
#include <setjmp.h>
#include <sqlite3.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "gonio/session.h"
#include "tests/unit/session_folder.h"

enum { STEPS = 4, FRAMES = 2 };

// What libhdf5 itself loses of damaged files; ours is still told.
const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void) { return "leak:libhdf5"; }

static char file[128], other[128];
static bool plain; // frames are stored as a burst stores them

static int set_up_paths(void **state) {
    const int failed = set_up(state);
    snprintf(file, sizeof file, "%s/s.h5", root);
    snprintf(other, sizeof other, "%s/other", root);
    return failed;
}

static uint32_t next(uint32_t *state) { return *state = *state * 1664525u + 1013904223u; }

static gonio_exposure make_exposure(int64_t step, int number) {
    // The second frame of a step is a full one, as those are that look for motion.
    const int width = number == 0 ? 23 : 40, height = number == 0 ? 17 : 30;
    uint32_t seed = (uint32_t)(step * 7 + number);
    gonio_exposure e = {.frame = {.window = {number == 0 ? 3 : 0, number, width, height},
                                  .exposure_s = 0.1 / 3,
                                  .stamp = {step, number, (double)step / 7}},
                        .monitor = number == 0 ? NAN : 1.0 / 3,
                        .monitor_sigma = 1e-3 / 3};
    e.frame.pixels = malloc((size_t)(width * height) * sizeof(uint16_t));
    assert_non_null(e.frame.pixels);
    for (int i = 0; i < width * height; i++) {
        e.frame.pixels[i] = (uint16_t)(next(&seed) >> 20);
    }
    return e;
}

static gonio_samples *make_samples(int64_t step) {
    gonio_samples *samples;
    assert_int_equal(gonio_samples_new(2, true, &samples, NULL), GONIO_OK);
    strcpy(samples->channel_names[0], "550nm");
    strcpy(samples->channel_names[1], "650nm");
    for (int64_t i = 0; i < step; i++) { // another number at every step; none at the first
        const double x = (double)(step + i) / 3;
        const double v[2] = {x, -x}, r[2] = {0.1, x / 9}, s[2] = {1e-300, x};
        assert_int_equal(gonio_samples_add(samples, &(gonio_pair){x / 9, 0, x / 7, 1}, v, r, s, NULL), GONIO_OK);
    }
    return samples;
}

static void finish_step(gonio_session *session, int64_t k) {
    gonio_exposure exposures[FRAMES] = {make_exposure(k, 0), make_exposure(k, 1)};
    gonio_samples *samples = make_samples(k);
    const gonio_step step = {.index = k, .clock_end_s = 10.0 * (double)k / 3, .exposure_end_s = 0.01 / 3};
    gonio_error error = {0};
    assert_int_equal(gonio_session_finish_step(session, &step, exposures, FRAMES, samples, &error), GONIO_OK);
    for (int i = 0; i < FRAMES; i++) {
        free(exposures[i].frame.pixels);
    }
    gonio_samples_free(samples);
}

// The last step is not done: its numbers are NULL.
static void make_session(int done) {
    gonio_session *session;
    gonio_step steps[STEPS];
    for (int i = 0; i < STEPS; i++) {
        steps[i] = (gonio_step){.index = i, .kind = GONIO_STEP_SAMPLE, .pose = {0.1 * i, 0, 0.2 * i, 0}};
    }
    assert_int_equal(gonio_session_create(path, &session, NULL), GONIO_OK);
    assert_int_equal(gonio_session_put(session, "camera.bits", "12", NULL), GONIO_OK);
    assert_int_equal(gonio_session_put(session, "empty", "", NULL), GONIO_OK);
    assert_int_equal(gonio_session_put(session, "facts", "{\"operator_name\":\"Z\xc3\xbcrich\"}", NULL), GONIO_OK);
    assert_int_equal(gonio_session_put_steps(session, steps, STEPS, NULL), GONIO_OK);
    gonio_session_set_plain(session, plain);
    for (int64_t k = 0; k < done; k++) {
        finish_step(session, k);
    }
    assert_int_equal(gonio_session_event(session, "test", "line 1\nline 2", NULL), GONIO_OK);
    gonio_session_close(session);
}

static gonio_status export_it(gonio_progress_fn progress, gonio_error *error) {
    gonio_session *session;
    assert_int_equal(gonio_session_open(path, false, &session, NULL), GONIO_OK);
    const gonio_status status = gonio_session_export(session, file, progress, NULL, error);
    gonio_session_close(session);
    return status;
}

static gonio_status import_it(gonio_error *error) {
    *error = (gonio_error){0};
    return gonio_session_import(file, other, NULL, NULL, error);
}

static int entries(const char *folder) {
    DIR *d = opendir(folder);
    assert_non_null(d);
    int n = -2;
    while (readdir(d) != NULL) {
        n++;
    }
    closedir(d);
    return n;
}

static void remove_other(void) {
    char command[160];
    snprintf(command, sizeof command, "rm -rf %s", other);
    assert_int_equal(system(command), 0);
}

// Every row of every table as text; the caller frees it.
static char *dump(const char *folder) {
    char db_path[160], *text;
    size_t size;
    sqlite3 *db;
    sqlite3_stmt *tables, *rows;
    FILE *stream = open_memstream(&text, &size);
    snprintf(db_path, sizeof db_path, "%s/session.db", folder);
    assert_int_equal(sqlite3_open_v2(db_path, &db, SQLITE_OPEN_READONLY, NULL), SQLITE_OK);
    assert_int_equal(sqlite3_prepare_v2(db, "SELECT name, sql FROM sqlite_master ORDER BY name", -1, &tables, NULL), 0);
    while (sqlite3_step(tables) == SQLITE_ROW) {
        char sql[200];
        fprintf(stream, "%s\n", (const char *)sqlite3_column_text(tables, 1));
        snprintf(sql, sizeof sql, "SELECT * FROM %s", (const char *)sqlite3_column_text(tables, 0));
        if (sqlite3_prepare_v2(db, sql, -1, &rows, NULL) != SQLITE_OK) {
            continue; // an index
        }
        while (sqlite3_step(rows) == SQLITE_ROW) {
            for (int k = 0; k < sqlite3_column_count(rows); k++) {
                const int type = sqlite3_column_type(rows, k);
                fprintf(stream, "%d:", type);
                if (type == SQLITE_FLOAT) {
                    fprintf(stream, "%a;", sqlite3_column_double(rows, k));
                    continue;
                }
                const unsigned char *bytes = sqlite3_column_blob(rows, k);
                for (int i = 0; i < sqlite3_column_bytes(rows, k); i++) {
                    fprintf(stream, "%02x", bytes[i]);
                }
                fputc(';', stream);
            }
            fputc('\n', stream);
        }
        sqlite3_finalize(rows);
    }
    sqlite3_finalize(tables);
    sqlite3_close(db);
    fclose(stream);
    return text;
}

static void assert_same_frames(void) {
    gonio_session *session;
    assert_int_equal(gonio_session_open(other, false, &session, NULL), GONIO_OK);
    for (int64_t k = 0; k < STEPS - 1; k++) {
        gonio_exposure *exposures;
        int n;
        gonio_error error = {0};
        assert_int_equal(gonio_session_exposures(session, k, &exposures, &n, &error), GONIO_OK);
        assert_int_equal(n, FRAMES);
        for (int i = 0; i < n; i++) {
            const gonio_exposure e = make_exposure(k, i);
            const gonio_window *w = &e.frame.window;
            assert_memory_equal(&exposures[i].frame.window, w, sizeof *w);
            assert_memory_equal(exposures[i].frame.pixels, e.frame.pixels, (size_t)(w->width * w->height) * 2);
            free(e.frame.pixels);
        }
        gonio_exposures_free(exposures, n);
    }
    gonio_session_close(session);
}

static void assert_same_file(const char *name) {
    char command[320];
    snprintf(command, sizeof command, "cmp %s/%s %s/%s", path, name, other, name);
    assert_int_equal(system(command), 0);
}

// Frames that were not compressed come back compressed; the journal says their new sizes, and goes on being proved.
static void test_plain_frames(void **state) {
    (void)state;
    gonio_error error = {0};
    plain = true;
    make_session(STEPS - 1);
    plain = false;
    assert_int_equal(export_it(NULL, &error), GONIO_OK);
    assert_int_equal(import_it(&error), GONIO_OK);
    assert_same_frames();
    gonio_doctor_report report;
    assert_int_equal(gonio_session_doctor(other, false, &report, &error), GONIO_OK);
    assert_true(report.database_ok && report.frames_bad == 0 && report.frames == FRAMES * (STEPS - 1));
}

static void test_round_trip(void **state) {
    (void)state;
    gonio_error error = {0};
    make_session(STEPS - 1);
    assert_int_equal(export_it(NULL, &error), GONIO_OK);
    assert_true(gonio_session_is_hdf5(file) && !gonio_session_is_hdf5(path));
    assert_int_equal(import_it(&error), GONIO_OK);
    char *before = dump(path), *after = dump(other);
    assert_string_equal(before, after);
    free(before);
    free(after);
    assert_same_frames();
    assert_same_file("session.log");
    assert_same_file("frames/000001-01.png");
    assert_int_equal(entries(root), 3); // session, file and session; nothing temporary
}

// Nothing measured yet: empty tables.
static void test_empty(void **state) {
    (void)state;
    gonio_error error = {0};
    make_session(0);
    assert_int_equal(export_it(NULL, &error), GONIO_OK);
    assert_int_equal(import_it(&error), GONIO_OK);
    char *before = dump(path), *after = dump(other);
    assert_string_equal(before, after);
    free(before);
    free(after);
}

static void test_nothing_is_overwritten(void **state) {
    (void)state;
    gonio_error error = {0};
    make_session(1);
    assert_int_equal(export_it(NULL, &error), GONIO_OK);
    assert_int_equal(gonio_session_import(file, path, NULL, NULL, &error), GONIO_E_USAGE);
    assert_int_equal(entries(root), 2);
}

static bool stop(void *context, double fraction, const char *what, double error_now) {
    (void)context, (void)what, (void)error_now;
    return fraction < 0.5;
}

static void test_stopped(void **state) {
    (void)state;
    gonio_error error = {0};
    make_session(STEPS - 1);
    assert_int_equal(export_it(stop, &error), GONIO_E_INTERRUPTED);
    assert_int_equal(entries(root), 1);
    assert_int_equal(export_it(NULL, &error), GONIO_OK);
    assert_int_equal(gonio_session_import(file, other, stop, NULL, &error), GONIO_E_INTERRUPTED);
    assert_int_equal(entries(root), 2);
}

// A frame that is not what was journalled has no place in the copy.
static void test_bad_frame_is_not_exported(void **state) {
    (void)state;
    char frame[160];
    gonio_error error = {0};
    make_session(STEPS - 1);
    snprintf(frame, sizeof frame, "%s/frames/000001-01.png", path);
    assert_int_equal(truncate(frame, 100), 0);
    assert_int_equal(export_it(NULL, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.file, "000001-01.png"));
    assert_int_equal(entries(root), 1);
}

// ---- damage ----

static unsigned char *read_all(size_t *size) {
    struct stat facts;
    assert_int_equal(stat(file, &facts), 0);
    unsigned char *bytes = malloc((size_t)facts.st_size);
    FILE *stream = fopen(file, "rb");
    *size = (size_t)facts.st_size;
    assert_int_equal(fread(bytes, 1, *size, stream), *size);
    fclose(stream);
    return bytes;
}

static void write_all(const unsigned char *bytes, size_t size) {
    FILE *stream = fopen(file, "wb");
    assert_int_equal(fwrite(bytes, 1, size, stream), size);
    fclose(stream);
}

// Refused, by a message about this file, or the session is what it was: no third way.
static void refused_or_same(const char *whole, int *refused) {
    gonio_error error;
    const gonio_status status = import_it(&error);
    if (status == GONIO_OK) {
        char *after = dump(other);
        assert_string_equal(whole, after);
        free(after);
        assert_same_frames();
        remove_other();
    } else {
        assert_true(status == GONIO_E_INPUT || status == GONIO_E_MEMORY);
        assert_true(error.message[0] != 0);
        ++*refused;
    }
    assert_int_equal(entries(root), 2);
}

static void test_flipped_bits(void **state) {
    (void)state;
    gonio_error error = {0};
    make_session(STEPS - 1);
    assert_int_equal(export_it(NULL, &error), GONIO_OK);
    char *whole = dump(path);
    size_t size;
    unsigned char *bytes = read_all(&size);
    uint32_t seed = 1;
    int refused = 0;
    for (int i = 0; i < (getenv("FLIPS") != NULL ? atoi(getenv("FLIPS")) : 120); i++) {
        // The first bytes are the library's own; then anywhere.
        const size_t at = i < 40 ? (size_t)i : ((size_t)next(&seed) << 8 ^ next(&seed) >> 8) % size;
        const unsigned char bit = (unsigned char)(1u << (next(&seed) >> 29));
        bytes[at] ^= bit;
        write_all(bytes, size);
        refused_or_same(whole, &refused);
        bytes[at] ^= bit;
    }
    assert_true(refused > 60); // what is not, lies between the parts of the file
    free(bytes);
    free(whole);
}

static void test_cut_short(void **state) {
    (void)state;
    gonio_error error = {0};
    make_session(STEPS - 1);
    assert_int_equal(export_it(NULL, &error), GONIO_OK);
    size_t size;
    unsigned char *bytes = read_all(&size);
    for (size_t k = 0; k < 12; k++) {
        write_all(bytes, size * k / 12);
        assert_int_equal(import_it(&error), GONIO_E_INPUT);
        assert_int_equal(entries(root), 2);
    }
    free(bytes);
}

// ---- files that are whole but not a session ----

static void replace(const char *name, hid_t type, int rank, const hsize_t *dims, hid_t list) {
    const hid_t h5 = H5Fopen(file, H5F_ACC_RDWR, H5P_DEFAULT), space = H5Screate_simple(rank, dims, NULL);
    assert_true(h5 >= 0 && H5Ldelete(h5, name, H5P_DEFAULT) >= 0);
    const hid_t dataset = H5Dcreate2(h5, name, type, space, H5P_DEFAULT, list, H5P_DEFAULT);
    assert_true(dataset >= 0);
    H5Dclose(dataset);
    H5Sclose(space);
    H5Fclose(h5);
}

static void link_instead(const char *name, bool external) {
    const hid_t h5 = H5Fopen(file, H5F_ACC_RDWR, H5P_DEFAULT);
    assert_true(h5 >= 0 && H5Ldelete(h5, name, H5P_DEFAULT) >= 0);
    assert_true((external ? H5Lcreate_external("/etc/passwd", "/x", h5, name, H5P_DEFAULT, H5P_DEFAULT)
                          : H5Lcreate_soft("/entry/journal/steps/step", h5, name, H5P_DEFAULT, H5P_DEFAULT)) >= 0);
    H5Fclose(h5);
}

static void in_another_file(void) {
    const hsize_t n = STEPS;
    const hid_t list = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_external(list, "/etc/passwd", 0, 8 * STEPS);
    replace("/entry/journal/steps/frames", H5T_STD_I64LE, 1, &n, list);
    H5Pclose(list);
}

static void huge(void) {
    const hsize_t dims[3] = {1, 60000, 60000}, chunk[3] = {1, 100, 100};
    const hid_t list = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_chunk(list, 3, chunk);
    replace("/entry/instrument/detector/data", H5T_STD_U16LE, 3, dims, list);
    H5Pclose(list);
}

static void other_type(void) {
    const hsize_t n = STEPS;
    replace("/entry/journal/steps/theta_i_deg", H5T_IEEE_F32LE, 1, &n, H5P_DEFAULT);
}

static void other_length(void) {
    const hsize_t n = STEPS - 1;
    replace("/entry/journal/steps/theta_i_deg", H5T_IEEE_F64LE, 1, &n, H5P_DEFAULT);
}

static void vlen_text(void) {
    const hsize_t n = 3;
    const hid_t type = H5Tcopy(H5T_C_S1);
    H5Tset_size(type, H5T_VARIABLE);
    replace("/entry/journal/settings/value", type, 1, &n, H5P_DEFAULT);
    H5Tclose(type);
}

// The same step twice: the journal's keys are kept.
static void doubled_key(void) {
    const hid_t h5 = H5Fopen(file, H5F_ACC_RDWR, H5P_DEFAULT);
    const hid_t dataset = H5Dopen2(h5, "/entry/journal/steps/step", H5P_DEFAULT);
    const int64_t same[STEPS] = {0, 1, 1, 3};
    assert_true(H5Dwrite(dataset, H5T_NATIVE_INT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, same) >= 0);
    H5Dclose(dataset);
    H5Fclose(h5);
}

static void newer(void) {
    const hid_t h5 = H5Fopen(file, H5F_ACC_RDWR, H5P_DEFAULT);
    const hid_t attribute = H5Aopen(h5, "gonio_session_version", H5P_DEFAULT);
    const int64_t version = 99;
    assert_true(H5Awrite(attribute, H5T_NATIVE_INT64, &version) >= 0);
    H5Aclose(attribute);
    H5Fclose(h5);
}

static void link_out(void) { link_instead("/entry/journal/steps/frames", true); }
static void link_soft(void) { link_instead("/entry/journal/steps/frames", false); }
static void lost_table(void) {
    const hid_t h5 = H5Fopen(file, H5F_ACC_RDWR, H5P_DEFAULT);
    assert_true(H5Ldelete(h5, "/entry/journal/steps", H5P_DEFAULT) >= 0);
    H5Fclose(h5);
}
static void unknown_table(void) {
    const hid_t h5 = H5Fopen(file, H5F_ACC_RDWR, H5P_DEFAULT);
    const hid_t group = H5Gopen2(h5, "/entry/journal", H5P_DEFAULT);
    const hid_t attribute = H5Aopen(group, "tables", H5P_DEFAULT);
    const hid_t type = H5Aget_type(attribute);
    char names[1024] = "";
    assert_true(H5Tget_size(type) < sizeof names && H5Aread(attribute, type, names) >= 0);
    names[0] = ','; // of the first one's name the end, and one more without a name
    assert_true(H5Awrite(attribute, type, names) >= 0);
    H5Tclose(type);
    H5Aclose(attribute);
    H5Gclose(group);
    H5Fclose(h5);
}

static void test_crafted(void **state) {
    (void)state;
    static void (*const crafts[])(void) = {in_another_file, huge,        other_type,   other_length,
                                           vlen_text,       doubled_key, newer,        link_out,
                                           link_soft,       lost_table,  unknown_table};
    gonio_error error = {0};
    make_session(STEPS - 1);
    assert_int_equal(export_it(NULL, &error), GONIO_OK);
    size_t size;
    unsigned char *bytes = read_all(&size);
    for (size_t k = 0; k < sizeof crafts / sizeof *crafts; k++) {
        write_all(bytes, size);
        crafts[k]();
        const gonio_status status = import_it(&error);
        if (status != GONIO_E_INPUT) {
            fail_msg("craft %zu: %s %s", k, gonio_status_name(status), error.message);
        }
        assert_int_equal(entries(root), 2);
    }
    // No HDF5 at all, and one by another program.
    write_all((const unsigned char *)"hello", 5);
    assert_int_equal(import_it(&error), GONIO_E_INPUT);
    H5Fclose(H5Fcreate(file, H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT));
    assert_int_equal(import_it(&error), GONIO_E_INPUT);
    free(bytes);
}

int main(void) {
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up_paths, tear_down)
    const struct CMUnitTest tests[] = {
        TEST(test_round_trip),   TEST(test_plain_frames),
        TEST(test_empty),        TEST(test_nothing_is_overwritten),
        TEST(test_stopped),      TEST(test_bad_frame_is_not_exported),
        TEST(test_flipped_bits), TEST(test_cut_short),
        TEST(test_crafted),
    };
    H5dont_atexit();
    return cmocka_run_group_tests(tests, NULL, NULL);
}
