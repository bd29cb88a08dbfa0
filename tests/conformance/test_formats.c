// SPDX-License-Identifier: BSD-3-Clause
// Every format of the list: its files are its own alone; what it writes it reads; a damaged file is refused with its
// place or read in part, and nothing is misread in silence; its options are its own.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "gonio/plan.h"
#include "io/format.h"
#include "tests/format_files.h"
#include "tests/fuzz/memory_file.h"
#include "tests/unit/scratch.h"

static size_t cases; // of the test that runs

static int count_formats(void) {
    int n = 0;
    while (gonio_format_at(n) != NULL) {
        n++;
    }
    return n;
}

static int tell(void **state) {
    (void)state;
    print_message("# %d formats, %zu cases\n", count_formats(), cases);
    cases = 0;
    return 0;
}

static const gonio_format *format_named(const char *name) {
    for (int i = 0; gonio_format_at(i) != NULL; i++) {
        if (strcmp(gonio_format_at(i)->name, name) == 0) {
            return gonio_format_at(i);
        }
    }
    fail_msg("no format '%s'", name);
    return NULL;
}

static bool has_option(const gonio_format *f, const char *name) {
    for (const gonio_format_option *o = f->options; o != NULL && o->name != NULL; o++) {
        if (strcmp(o->name, name) == 0) {
            return true;
        }
    }
    return false;
}

// A file for the process, for every format that reads a second one.
static const char *directions_file(void) {
    static char path[64];
    if (path[0] == 0) {
        char *text = format_directions();
        scratch_file(path, text, strlen(text));
        free(text);
    }
    return path;
}

static int remove_directions(void **state) {
    (void)state;
    return unlink(directions_file());
}

// Everything that the file holds, but of a table only about `limit` samples.
static gonio_read_options all_of(const gonio_format *f, const char *limit) {
    gonio_read_options options = {.seed = 1};
    if (has_option(f, "negatives")) {
        options.settings[0] = (gonio_format_setting){"negatives", "keep"};
    } else if (has_option(f, "limit")) {
        options.settings[0] = (gonio_format_setting){"limit", limit};
    }
    if (has_option(f, "scale")) {
        options.settings[0] = (gonio_format_setting){"scale", "1"};
    }
    if (has_option(f, "cone")) {
        options.settings[1] = (gonio_format_setting){"cone", "0.5"};
    }
    if (has_option(f, "directions")) {
        options.settings[1] = (gonio_format_setting){"directions", directions_file()};
    }
    if (f->by_mapping) {
        options.settings[1] = (gonio_format_setting){"columns", FORMAT_TABLE_COLUMNS};
        options.settings[2] = (gonio_format_setting){"quantity", "brf"};
    }
    return options;
}

static const char *put(const void *data, size_t size) { return memory_file(data, size); }

// How many formats take it for theirs; *last: one of them.
static int recognised(const void *data, size_t size, const gonio_format **last) {
    char *copy = malloc(size + 1);
    memcpy(copy, data, size);
    copy[size] = 0;
    const gonio_source source = {.path = "memory", .data = copy, .size = size};
    int n = 0;
    for (int i = 0; gonio_format_at(i) != NULL; i++) {
        if (gonio_format_at(i)->recognise(&source)) {
            n++;
            *last = gonio_format_at(i);
        }
    }
    assert_memory_equal(copy, data, size);
    free(copy);
    return n;
}

static void sound(const gonio_samples *s) {
    assert_true(s->n > 0 && s->channels > 0);
    const double largest = s->transmission ? GONIO_PI : GONIO_PI / 2;
    for (size_t i = 0; i < s->n; i++) {
        const gonio_pair *p = &s->pairs[i];
        assert_true(p->theta_i >= 0 && p->theta_i <= largest && p->theta_o >= 0 && p->theta_o <= largest);
        assert_true(isfinite(p->phi_i) && isfinite(p->phi_o));
        for (size_t c = 0; c < (size_t)s->channels; c++) {
            assert_true(isfinite(s->values[i * (size_t)s->channels + c]));
        }
    }
}

static gonio_samples *read_whole(const char *path, const gonio_format *f) {
    gonio_samples *s;
    gonio_read_report report;
    gonio_error error = {.line = -1, .byte = -1};
    const gonio_read_options options = all_of(f, "3k");
    if (gonio_read(path, &options, &s, &report, &error) != GONIO_OK) {
        fail_msg("%s: line %lld, byte %lld: %s", f->name, error.line, error.byte, error.message);
    }
    assert_string_equal(report.format, f->name);
    assert_false(report.open_end);
    sound(s);
    return s;
}

// ---- files that are written ----

// A set that strains a text: every magnitude, signs, values that need all digits.
static gonio_samples *strained(int channels, bool sigma, bool systematic, bool isotropic) {
    gonio_samples *s;
    assert_int_equal(gonio_samples_new(channels, sigma, &s, NULL), GONIO_OK);
    s->isotropic = isotropic;
    for (int c = 0; c < channels; c++) {
        snprintf(s->channel_names[c], GONIO_CHANNEL_NAME_MAX, "%dnm", 400 + c);
    }
    uint64_t x = 88172645463325252u;
    for (int i = 0; i < 40; i++) {
        double v[GONIO_CHANNELS_MAX], random[GONIO_CHANNELS_MAX], fixed[GONIO_CHANNELS_MAX], u[4];
        for (int k = 0; k < 4 + 3 * channels; k++) {
            x ^= x << 13, x ^= x >> 7, x ^= x << 17;
            const double unit = (double)(x >> 11) * 0x1p-53;
            if (k < 4) {
                u[k] = unit;
            } else {
                const double wide = (k % 2 == 0 ? 1 : -1) * ldexp(1 + unit, (int)(x % 120) - 60);
                double *const lists[3] = {v, random, fixed};
                lists[(k - 4) % 3][(k - 4) / 3] = (k - 4) % 3 == 0 ? wide : fabs(wide);
            }
        }
        if (!systematic) {
            memset(fixed, 0, sizeof fixed);
        }
        const gonio_pair p = {gonio_angle_canonical(u[0] * GONIO_PI / 2), gonio_angle_canonical(u[1] * 6),
                              gonio_angle_canonical(u[2] * GONIO_PI / 2), gonio_angle_canonical(-u[3] * 6)};
        assert_int_equal(gonio_samples_add(s, &p, v, sigma ? random : NULL, sigma ? fixed : NULL, NULL), GONIO_OK);
    }
    return s;
}

static void near_enough(const double *a, const double *b, size_t n, double precision) {
    for (size_t i = 0; i < n; i++) {
        if (!(precision > 0 ? fabs(a[i] - b[i]) <= precision * fabs(a[i]) : memcmp(&a[i], &b[i], sizeof *a) == 0)) {
            fail_msg("wrote %.17g, read %.17g; stated precision %g", a[i], b[i], precision);
        }
    }
}

static void samples_come_back(const gonio_format *f, int channels, int sigma, bool isotropic) {
    char path[64];
    scratch_file(path, "", 0);
    gonio_samples *s = strained(channels, sigma > 0, sigma > 1, isotropic);
    s->transmission = channels == 3;
    for (size_t i = 0; i < s->n && s->transmission; i++) {
        s->pairs[i] = gonio_pair_lowered(s->pairs[i], (gonio_half)(i % GONIO_HALVES));
    }
    assert_int_equal(gonio_write_as(s, path, f->name, NULL), GONIO_OK);
    gonio_samples *t = read_whole(path, f);
    const size_t n = s->n * (size_t)channels;
    assert_int_equal(s->n, t->n);
    assert_int_equal(s->channels, t->channels);
    near_enough(s->values, t->values, n, f->precision);
    if (f->precision == 0) {
        assert_memory_equal(s->pairs, t->pairs, s->n * sizeof *s->pairs);
        assert_memory_equal(s->channel_names, t->channel_names, (size_t)channels * sizeof *s->channel_names);
        assert_int_equal(s->isotropic, t->isotropic);
        assert_int_equal(s->transmission, t->transmission);
        assert_true((sigma > 0) == (t->sigma_random != NULL));
    }
    if (sigma > 0 && t->sigma_random != NULL) {
        near_enough(s->sigma_random, t->sigma_random, n, f->precision);
        near_enough(s->sigma_systematic, t->sigma_systematic, n, f->precision);
    }
    gonio_samples_free(s);
    gonio_samples_free(t);
    unlink(path);
    cases++;
}

static bool has_write_option(const gonio_format *f, const char *name) {
    for (const gonio_format_option *o = f->write_options; o != NULL && o->name != NULL; o++) {
        if (strcmp(o->name, name) == 0) {
            return true;
        }
    }
    return false;
}

// A small table, which is quickly made.
static gonio_write_options small(const gonio_format *f) {
    gonio_write_options options = {.max_bytes = 60000};
    if (has_write_option(f, "grid-step")) {
        options.settings[0] = (gonio_format_setting){"grid-step", "15"};
    }
    return options;
}

// What was read as a model and is written again is the same file.
static void file_is_itself(const char *path) {
    char again[64];
    size_t n[2];
    char *data[2];
    gonio_model *model;
    gonio_error error = {0};
    scratch_file(again, "", 0);
    assert_int_equal(gonio_read_table(path, &model, &error), GONIO_OK);
    const gonio_format *f = NULL;
    assert_int_equal(gonio_file_read(path, 0, &data[0], &n[0], &error), GONIO_OK);
    assert_int_equal(recognised(data[0], n[0], &f), 1);
    assert_int_equal(gonio_write_table_as(model, again, f->name, NULL, NULL, &error), GONIO_OK);
    assert_int_equal(gonio_file_read(again, 0, &data[1], &n[1], &error), GONIO_OK);
    if (n[0] != n[1] || memcmp(data[0], data[1], n[0]) != 0) {
        fail_msg("%s: read and written again, %zu bytes became %zu others", f->name, n[0], n[1]);
    }
    gonio_model_free(model);
    free(data[0]);
    free(data[1]);
    unlink(again);
    cases++;
}

// Half the values within what a small table can hold; asked for more, it is not written at all.
static void table_comes_close(const gonio_format *f, const char *path, const gonio_model *model) {
    gonio_write_options options = small(f);
    gonio_write_report report;
    gonio_error error = {0};
    assert_int_equal(gonio_write_table_as(model, path, f->name, &options, &report, &error), GONIO_OK);
    // Parameters of another formula than the model's are a quarter off.
    if (!(report.median < (f->meant != NULL ? 0.4 : 0.1) && report.p95 >= report.median && report.pairs > 100 &&
          report.about[0] != 0 && report.quantity != NULL && report.convention != NULL && report.theta_max_deg > 0)) {
        fail_msg("%s: median error %g at %zu pairs", f->name, report.median, report.pairs);
    }
    unlink(path);
    options.max_error = 1e-15;
    assert_int_equal(gonio_write_table_as(model, path, f->name, &options, NULL, &error), GONIO_E_MISMATCH);
    assert_int_not_equal(access(path, F_OK), 0);
    cases++;
}

// A table holds values at places of its own: there it must say what the model says.
static void table_comes_back(const gonio_format *f, const char *path, const gonio_model *model) {
    const gonio_write_options options = small(f);
    assert_int_equal(gonio_write_table_as(model, path, f->name, &options, NULL, NULL), GONIO_OK);
    if (f->table != NULL) {
        file_is_itself(path);
    }
    gonio_samples *s = read_whole(path, f);
    // Of a format of wavelengths alone the smooth spectra of the model's colours.
    gonio_write_report told = {0};
    gonio_model *colours = NULL, *written = (gonio_model *)(uintptr_t)model;
    if (s->channels > 3) {
        assert_int_equal(gonio_model_as_wavelengths(model, &colours, &written, &told, NULL), GONIO_OK);
        assert_int_equal(s->channels, written->channels);
    }
    for (size_t i = 0; i < s->n; i++) {
        double v[GONIO_CHANNELS_MAX];
        gonio_model_eval_pair(written, &s->pairs[i], v);
        for (int c = 0; c < s->channels; c++) {
            const double wrote = v[written->channels == 1 ? 0 : c],
                         read = s->values[i * (size_t)s->channels + (size_t)c];
            // The place itself is computed from the pair that was read: its rounding moves a smooth value by as much.
            if (!(fabs(read - wrote) <= (f->precision + 1e-12) * wrote)) {
                fail_msg("%s: wrote %.17g, read %.17g", f->name, wrote, read);
            }
        }
    }
    gonio_model_free(written != model ? written : NULL);
    gonio_model_free(colours != model ? colours : NULL);
    gonio_samples_free(s);
    cases++;
}

static void what_is_written_is_read(void **state) {
    (void)state;
    int written = 0;
    for (int i = 0; gonio_format_at(i) != NULL; i++) {
        const gonio_format *f = gonio_format_at(i);
        written += f->write != NULL || f->write_table != NULL;
        for (int k = 0; f->write != NULL && k < 18; k++) {
            samples_come_back(f, (int[]){1, 3, 31}[k % 3], k / 3 % 3, k / 9 == 0);
        }
        for (int k = 0; f->write_table != NULL && k < 2; k++) {
            static const char *const specs[] = {"lambert:rho=0.3", "ward:rho_d=0.3/0.2/0.1,rho_s=0.2,alpha=0.3"};
            gonio_model *model;
            char path[64];
            assert_int_equal(gonio_model_from_spec(specs[k], &model, NULL), GONIO_OK);
            scratch_file(path, "", 0);
            if (f->meant == NULL && !f->fitted) {
                table_comes_back(f, path, model);
            } else if (f->table != NULL) {
                const gonio_write_options options = small(f);
                assert_int_equal(gonio_write_table_as(model, path, f->name, &options, NULL, NULL), GONIO_OK);
                file_is_itself(path);
            }
            if (k > 0 && (f->meant != NULL || f->fitted)) {
                table_comes_close(f, path, model);
            }
            unlink(path);
            gonio_model_free(model);
        }
    }
    assert_true(written >= 2);
}

// ---- whose file it is ----

static void every_file_is_one_formats_own(void **state) {
    (void)state;
    format_file files[FORMAT_FILES];
    format_bytes rgl;
    format_files(files, &rgl);
    for (int i = 0; gonio_format_at(i) != NULL; i++) {
        const gonio_format *f = gonio_format_at(i), *owner = NULL;
        int found = f->write_table != NULL || strcmp(f->name, "utia") == 0; // in the tests of large files
        for (int k = 0; k < FORMAT_FILES; k++) {
            if (strcmp(files[k].format, f->name) == 0) {
                found++;
                assert_int_equal(recognised(files[k].data, files[k].size, &owner), 1 - f->by_mapping);
                assert_ptr_equal(owner, f->by_mapping ? NULL : f);
                gonio_samples_free(read_whole(put(files[k].data, files[k].size), f));
                cases++;
            }
        }
        if (found == 0) {
            fail_msg("%s: tests/format_files.h has no file of it", f->name);
        }
        assert_true((f->read != NULL || f->meant != NULL) && f->extensions[0] == '.' && f->summary[0] != 0 &&
                    f->precision >= 0);
    }
    static const char *const foreign[] = {"hello\n",          "1,2,3\n",    "a,b,c\n1,2,3\n", "# only\n",
                                          "GONIOMDL\1\0\0\0", "tensor_fil", "\x1f\x8b",       "",
                                          "theta,phi\n",      "1.5\n400\n", "-3\n",           "<xml/>"};
    for (size_t k = 0; k < sizeof foreign / sizeof *foreign; k++) {
        const gonio_format *owner;
        assert_int_equal(recognised(foreign[k], strlen(foreign[k]), &owner), 0);
        cases++;
    }
}

// ---- damage ----

static void refused_with_its_place(const gonio_format *f, size_t at, gonio_status status, const gonio_samples *s,
                                   const gonio_error *error) {
    if (status != GONIO_E_INPUT || s != NULL || error->message[0] == 0 || error->file[0] == 0 ||
        (error->line < 1 && error->byte < 0)) {
        fail_msg("%s, at byte %zu: %s, file '%s', line %lld, byte %lld: '%s'", f->name, at, gonio_status_name(status),
                 error->file, error->line, error->byte, error->message);
    }
}

// Every value of part stands in whole for the same pair and channel; the last row of a file with an open end may not.
static void holds_only(const gonio_format *f, size_t cut, const gonio_samples *part, bool open_end,
                       const gonio_samples *whole) {
    const size_t rows = part->n - open_end;
    assert_true(part->n <= whole->n);
    for (size_t i = 0; i < rows; i++) {
        for (int c = 0; c < part->channels; c++) {
            bool found = false;
            for (size_t j = 0; j < whole->n && !found; j++) {
                for (int d = 0; d < whole->channels && !found; d++) {
                    found = memcmp(&part->pairs[i], &whole->pairs[j], sizeof *part->pairs) == 0 &&
                            strcmp(part->channel_names[c], whole->channel_names[d]) == 0 &&
                            part->values[i * (size_t)part->channels + (size_t)c] ==
                                whole->values[j * (size_t)whole->channels + (size_t)d];
                }
            }
            if (!found) {
                fail_msg("%s, cut at byte %zu: row %zu, %s is not of the whole file", f->name, cut, i,
                         part->channel_names[c]);
            }
        }
    }
}

static void cut_at(const gonio_format *f, const char *path, size_t cut, bool line_end, const gonio_samples *whole) {
    gonio_samples *s;
    gonio_read_report report;
    gonio_error error = {.line = -1, .byte = -1};
    gonio_read_options options = all_of(f, "3k");
    gonio_status status = gonio_read(path, &options, &s, &report, &error);
    if (status == GONIO_E_USAGE) { // a beginning may be another format's file
        options.settings[0].name = NULL;
        status = gonio_read(path, &options, &s, &report, &error);
    }
    if (status != GONIO_OK) {
        refused_with_its_place(f, cut, status, s, &error);
    } else {
        if (f->table != NULL || report.open_end == line_end) {
            fail_msg("%s, cut at byte %zu: read in silence", f->name, cut);
        }
        holds_only(f, cut, s, report.open_end, whole);
        assert_true(report.open_end || s->n * (size_t)s->channels <= whole->n * (size_t)whole->channels);
        gonio_samples_free(s);
    }
    if (f->table != NULL) {
        gonio_model *model;
        error = (gonio_error){.line = -1, .byte = -1};
        const gonio_status as_table = gonio_read_table(path, &model, &error);
        refused_with_its_place(f, cut, as_table, NULL, &error);
    }
    cases++;
}

static void a_cut_file_is_refused_or_shorter(void **state) {
    (void)state;
    format_file files[FORMAT_FILES];
    format_bytes rgl;
    format_files(files, &rgl);
    for (int k = 0; k < FORMAT_FILES; k++) {
        const gonio_format *f = format_named(files[k].format);
        gonio_samples *whole = read_whole(put(files[k].data, files[k].size), f);
        for (size_t cut = 0; cut < files[k].size; cut++) {
            const bool line_end = cut > 0 && ((const char *)files[k].data)[cut - 1] == '\n';
            cut_at(f, put(files[k].data, cut), cut, line_end, whole);
        }
        gonio_samples_free(whole);
    }
}

// A character that no number holds in place of the last row's first one: the line is named.
static void a_bad_row_is_named(void **state) {
    (void)state;
    format_file files[FORMAT_FILES];
    format_bytes rgl;
    format_files(files, &rgl);
    for (int k = 0; k < FORMAT_FILES; k++) {
        const gonio_format *f = format_named(files[k].format);
        const size_t size = files[k].size;
        if (((const char *)files[k].data)[size - 1] != '\n') {
            continue; // no text of lines
        }
        char *copy = malloc(size);
        memcpy(copy, files[k].data, size);
        size_t at = size - 1;
        while (at > 0 && copy[at - 1] != '\n') {
            at--;
        }
        copy[at] = 'x';
        long long line = 0;
        for (size_t i = 0; i < size; i++) {
            line += copy[i] == '\n';
        }
        gonio_samples *s;
        gonio_error error = {.line = -1, .byte = -1};
        const gonio_read_options options = all_of(f, "3k");
        const gonio_status status = gonio_read(put(copy, size), &options, &s, NULL, &error);
        refused_with_its_place(f, at, status, s, &error);
        assert_int_equal(error.line, line);
        free(copy);
        cases++;
    }
}

// Whatever is read must be sound; whatever is not has a reason.
static void flipped(const gonio_format *f, const char *path, size_t at) {
    gonio_samples *s;
    gonio_error error = {.line = -1, .byte = -1};
    gonio_read_options options = all_of(f, "20");
    gonio_status status = gonio_read(path, &options, &s, NULL, &error);
    if (status == GONIO_E_USAGE) { // a flip may make it a file of another format
        options.settings[0].name = NULL;
        status = gonio_read(path, &options, &s, NULL, &error);
    }
    if (status == GONIO_OK) {
        sound(s);
        gonio_samples_free(s);
    } else if (s != NULL || error.message[0] == 0 || error.file[0] == 0) {
        fail_msg("%s, flipped at byte %zu: %s '%s'", f->name, at, gonio_status_name(status), error.message);
    }
    gonio_model *model;
    if (gonio_read_table(path, &model, &error) == GONIO_OK) {
        double v[GONIO_CHANNELS_MAX];
        for (int k = 0; k < 5; k++) {
            gonio_model_eval(model, gonio_direction(0.3 * k, k), gonio_direction(1.5 - 0.3 * k, 2 * k), v);
            for (int c = 0; c < model->channels; c++) {
                assert_true(!isnan(v[c]));
            }
        }
        gonio_model_free(model);
    }
    cases++;
}

static void flipped_bits_never_crash(void **state) {
    (void)state;
    format_file files[FORMAT_FILES];
    format_bytes rgl;
    format_files(files, &rgl);
    for (int k = 0; k < FORMAT_FILES; k++) {
        const gonio_format *f = format_named(files[k].format), *owner;
        unsigned char *copy = malloc(files[k].size);
        memcpy(copy, files[k].data, files[k].size);
        for (size_t bit = 0; bit < 8 * files[k].size; bit += f->table != NULL ? 3u : 1u) {
            copy[bit / 8] ^= (unsigned char)(1 << bit % 8);
            assert_true(recognised(copy, files[k].size, &owner) <= 1);
            flipped(f, put(copy, files[k].size), bit / 8);
            copy[bit / 8] ^= (unsigned char)(1 << bit % 8);
        }
        free(copy);
    }
}

// Tables that only a writer makes are large: cuts at every byte of the beginning and at some of the rest, flips
// likewise.
static void damaged_table(const gonio_format *f, const char *path) {
    gonio_error error;
    char *data;
    size_t size;
    assert_int_equal(gonio_file_read(path, 0, &data, &size, &error), GONIO_OK);
    const gonio_format *owner = NULL;
    assert_int_equal(recognised(data, size, &owner), 1);
    assert_ptr_equal(owner, f);
    for (size_t cut = 0; cut < 128 && cut < size; cut++) {
        cut_at(f, put(data, cut), cut, false, NULL);
    }
    for (size_t k = 0; k < 18; k++) {
        const size_t at = k < 12 ? k : (size / 6) * (k - 11) - 1;
        data[at] ^= (char)(1 << (k * 5 % 8));
        const char *whole = put(data, size);
        flipped(f, whole, at);
        data[at] ^= (char)(1 << (k * 5 % 8));
    }
    const char *whole = put(data, size);
    for (size_t k = 16; k > 0; k--) { // from the last byte on down
        const size_t cut = k == 16 ? size - 1 : size / 16 * k;
        assert_int_equal(truncate(whole, (off_t)cut), 0);
        cut_at(f, whole, cut, false, NULL);
    }
    free(data);
}

static void large_files_are_checked_as_well(void **state) {
    (void)state;
    for (int i = 0; gonio_format_at(i) != NULL; i++) {
        const gonio_format *f = gonio_format_at(i);
        if (f->write_table != NULL && f->table != NULL) {
            const gonio_write_options options = small(f);
            gonio_model *model;
            char path[64];
            assert_int_equal(gonio_model_from_spec("lambert:rho=0.3", &model, NULL), GONIO_OK);
            scratch_file(path, "", 0);
            assert_int_equal(gonio_write_table_as(model, path, f->name, &options, NULL, NULL), GONIO_OK);
            gonio_model_free(model);
            damaged_table(f, path);
            unlink(path);
        }
    }
    unsigned char *utia = format_utia();
    gonio_samples_free(read_whole(put(utia, FORMAT_UTIA_NUMBERS * 8), format_named("utia")));
    damaged_table(format_named("utia"), put(utia, FORMAT_UTIA_NUMBERS * 8));
    free(utia);
}

// ---- options ----

static void write_options_are_its_own(const gonio_format *f) {
    gonio_format_values values;
    gonio_error error = {0};
    gonio_write_options options = {.settings = {{"no-such-option", "1"}}};
    assert_int_equal(gonio_format_parse_write(f, NULL, NULL, &values, &error), GONIO_OK);
    assert_int_equal(gonio_format_parse_write(f, NULL, &options, &values, &error), GONIO_E_USAGE);
    for (const gonio_format_option *o = f->write_options; o != NULL && o->name != NULL; o++) {
        assert_non_null(strstr(error.message, o->name));
        gonio_error wrong = {0};
        options.settings[0] = (gonio_format_setting){o->name, o->standard};
        assert_int_equal(gonio_format_parse_write(f, NULL, &options, &values, &wrong), GONIO_OK);
        options.settings[0].value = "no such value";
        assert_int_equal(gonio_format_parse_write(f, NULL, &options, &values, &wrong), GONIO_E_USAGE);
        assert_true(o->help[0] != 0 && o->argument[0] != 0);
        cases++;
    }
}

// An alias is the name of one format alone, and what it sets is one of the format's options.
static void aliases_are_its_own(const gonio_format *f) {
    for (const gonio_format_alias *a = f->aliases; a != NULL && a->name != NULL; a++) {
        const gonio_format *found;
        gonio_format_values values;
        int owners = 0;
        for (int i = 0; gonio_format_at(i) != NULL; i++) {
            assert_string_not_equal(gonio_format_at(i)->name, a->name);
            for (const gonio_format_alias *b = gonio_format_at(i)->aliases; b != NULL && b->name != NULL; b++) {
                owners += strcmp(a->name, b->name) == 0;
            }
        }
        assert_int_equal(owners, 1);
        assert_int_equal(gonio_format_find_writer(a->name, "", &found, NULL), GONIO_OK);
        assert_ptr_equal(found, f);
        assert_int_equal(gonio_format_parse_write(f, a->name, NULL, &values, NULL), GONIO_OK);
        for (int k = 0; a->setting != NULL; k++) {
            assert_non_null(f->write_options[k].name);
            if (strcmp(f->write_options[k].name, a->setting) == 0) {
                assert_string_equal(values.at[k].text, a->value);
                break;
            }
        }
    }
}

static void options_are_the_formats_own(void **state) {
    (void)state;
    for (int i = 0; gonio_format_at(i) != NULL; i++) {
        const gonio_format *f = gonio_format_at(i);
        gonio_format_values values;
        gonio_error error = {0};
        assert_int_equal(gonio_format_parse(f, NULL, &values, &error), GONIO_OK);
        gonio_read_options options = {.seed = 7, .settings = {{"no-such-option", "1"}}};
        assert_int_equal(gonio_format_parse(f, &options, &values, &error), GONIO_E_USAGE);
        assert_non_null(strstr(error.message, f->name));
        int n = 0;
        for (const gonio_format_option *o = f->options; o != NULL && o->name != NULL; o++, n++) {
            assert_non_null(strstr(error.message, o->name));
            options.settings[0] = (gonio_format_setting){o->name, o->standard};
            gonio_error wrong = {0};
            assert_int_equal(gonio_format_parse(f, &options, &values, &wrong), GONIO_OK);
            options.settings[0].value = "no such value";
            assert_true(o->type == GONIO_FORMAT_TEXT ||
                        gonio_format_parse(f, &options, &values, &wrong) == GONIO_E_USAGE);
            assert_true(o->type == GONIO_FORMAT_TEXT || strstr(wrong.message, o->argument) != NULL);
            assert_true(o->help[0] != 0 && o->argument[0] != 0);
            cases++;
        }
        assert_true(n < GONIO_FORMAT_SETTINGS_MAX);
        write_options_are_its_own(f);
        aliases_are_its_own(f);
    }
}

static void the_writer_is_found(void **state) {
    (void)state;
    gonio_format_facts facts;
    gonio_error error = {0};
    assert_int_equal(gonio_format_writer(NULL, "a.nothing", &facts, &error), GONIO_E_USAGE);
    for (int i = 0; gonio_format_get(i, &facts); i++) {
        const bool written = facts.writes || facts.writes_table;
        assert_true((strstr(error.message, facts.extensions) != NULL) >= written);
        gonio_format_facts found;
        char path[64];
        snprintf(path, sizeof path, "folder/a%.*s", (int)strcspn(facts.extensions, " "), facts.extensions);
        assert_true(gonio_format_writer(facts.name, "a.nothing", &found, NULL) == (written ? GONIO_OK : GONIO_E_USAGE));
        if (written) {
            assert_string_equal(found.name, facts.name);
            // An ending that several formats have is that of the first.
            assert_int_equal(gonio_format_writer(NULL, path, &found, NULL), GONIO_OK);
            assert_non_null(strstr(found.extensions, strrchr(path, '.')));
        }
        // What it is not written from is wrong usage, not a crash.
        gonio_samples *s = strained(1, false, false, true);
        gonio_model *model;
        assert_int_equal(gonio_model_from_spec("lambert:rho=0.3", &model, NULL), GONIO_OK);
        if (!facts.writes) {
            assert_int_equal(gonio_write_as(s, "/nonexistent/a", facts.name, NULL), GONIO_E_USAGE);
        }
        if (!facts.writes_table) {
            assert_int_equal(gonio_write_table_as(model, "/nonexistent/a", facts.name, NULL, NULL, NULL),
                             GONIO_E_USAGE);
        }
        gonio_model_free(model);
        gonio_samples_free(s);
        cases++;
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(every_file_is_one_formats_own, tell),
        cmocka_unit_test_teardown(what_is_written_is_read, tell),
        cmocka_unit_test_teardown(a_cut_file_is_refused_or_shorter, tell),
        cmocka_unit_test_teardown(a_bad_row_is_named, tell),
        cmocka_unit_test_teardown(flipped_bits_never_crash, tell),
        cmocka_unit_test_teardown(large_files_are_checked_as_well, tell),
        cmocka_unit_test_teardown(options_are_the_formats_own, tell),
        cmocka_unit_test_teardown(the_writer_is_found, tell),
    };
    return cmocka_run_group_tests(tests, NULL, remove_directions);
}
