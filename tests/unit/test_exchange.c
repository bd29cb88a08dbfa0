// SPDX-License-Identifier: BSD-3-Clause
// What other programs trip over in the tables that they are given: swapped directions, turned frames, wrong colour
// quantities, numbers that are none, scales that a reader takes for its own. The files are looked at as text, or by
// what their formats define, not only by our own readers.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/statistics.h"
#include "io/format.h"
#include "io/radiance/radiance.h"
#include "io/rgl.h"
#include "tests/unit/near.h"
#include "tests/unit/scratch.h"

static int cases;

static int tell(void **state) {
    (void)state;
    print_message("# %d cases\n", cases);
    cases = 0;
    return 0;
}

static bool has_write_option(const gonio_format *f, const char *name) {
    for (const gonio_format_option *o = f->write_options; o != NULL && o->name != NULL; o++) {
        if (strcmp(o->name, name) == 0) {
            return true;
        }
    }
    return false;
}

// The next option of writing; false past the last.
static void set(gonio_write_options *options, const char *name, const char *value) {
    int n = 0;
    while (options->settings[n].name != NULL) {
        n++;
    }
    options->settings[n] = (gonio_format_setting){name, value};
}

static gonio_write_options small(const gonio_format *f) {
    gonio_write_options options = {.max_bytes = 60000};
    if (has_write_option(f, "grid-step")) {
        set(&options, "grid-step", "15");
    }
    return options;
}

static void written(const gonio_model *model, const char *format, const gonio_write_options *options, char *path) {
    gonio_error error = {0};
    scratch_file(path, "", 0);
    if (gonio_write_table_as(model, path, format, options, NULL, &error) != GONIO_OK) {
        fail_msg("%s: %s", format, error.message);
    }
    cases++;
}

// The file's bytes, with a 0 behind them; the caller frees them. The file goes.
static char *bytes_of(const char *path, size_t *size) {
    char *data;
    size_t n;
    gonio_error error = {0};
    assert_int_equal(gonio_file_read(path, 0, &data, &n, &error), GONIO_OK);
    if (size != NULL) {
        *size = n;
    }
    unlink(path);
    return data;
}

static char *text_of(const char *spec, const char *format, const gonio_write_options *options) {
    char path[64];
    gonio_model *model;
    assert_int_equal(gonio_model_from_spec(spec, &model, NULL), GONIO_OK);
    written(model, format, options, path);
    gonio_model_free(model);
    return bytes_of(path, NULL);
}

static const char *behind(const char *text, const char *word) {
    const char *at = strstr(text, word);
    if (at == NULL) {
        fail_msg("no '%s'", word);
        return text;
    }
    return at + strlen(word);
}

static double number(const char **at) {
    char *end;
    const double value = strtod(*at, &end);
    if (end == *at) {
        fail_msg("expected a number, found '%.20s'", *at);
    }
    *at = end;
    return value;
}

// ---- models that no formula gives ----

static const char visible[1][32] = {"visible"};
static void leave(gonio_model *model) { (void)model; }

// Far from reciprocal: brighter, the steeper the light and the flatter the camera.
static void eval_ordered(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    (void)model;
    values[0] = 0.1 + 0.5 * wi.z * wi.z + 0.1 * (1 - wo.z) + 0.05 * (wi.x * wo.x + wi.y * wo.y);
}
static const gonio_model_ops ordered_ops = {.kind = "measured", .eval = eval_ordered, .free = leave};
static const gonio_model ordered = {.ops = &ordered_ops, .channels = 1, .isotropic = true, .channel_names = visible};

// Below 0 toward the horizon, as splines may be; not a number where the light comes from there.
static void eval_bad(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    (void)model;
    values[0] = wi.z < 0.15 ? NAN : 0.3 * wo.z - 0.1;
}
static const gonio_model_ops bad_ops = {.kind = "measured", .eval = eval_bad, .free = leave};
static const gonio_model bad = {.ops = &bad_ops, .channels = 1, .isotropic = true, .channel_names = visible};

// ---- every format ----

static double median_error(const gonio_samples *s, bool swapped) {
    double *errors = malloc(s->n * sizeof *errors);
    for (size_t i = 0; i < s->n; i++) {
        const gonio_pair *p = &s->pairs[i];
        const gonio_vec3 wi = gonio_direction(p->theta_i, p->phi_i), wo = gonio_direction(p->theta_o, p->phi_o);
        double v;
        eval_ordered(NULL, swapped ? wo : wi, swapped ? wi : wo, &v);
        errors[i] = fabs(s->values[i * (size_t)s->channels] - v) / v;
    }
    gonio_sort(errors, s->n);
    const double median = errors[s->n / 2];
    free(errors);
    return median;
}

// A query of (out, in) where (in, out) is meant is found by data that is not reciprocal alone. Radiance's bsdfquery has
// swapped them since 2021.
static void the_light_comes_first(void **state) {
    (void)state;
    for (int i = 0; gonio_format_at(i) != NULL; i++) {
        const gonio_format *f = gonio_format_at(i);
        // A MERL table holds either order as one value.
        if (f->write_table == NULL || f->read == NULL || strcmp(f->name, "merl") == 0) {
            continue;
        }
        const gonio_write_options options = small(f);
        gonio_samples *s;
        char path[64];
        written(&ordered, f->name, &options, path);
        assert_int_equal(gonio_read(path, NULL, &s, NULL, NULL), GONIO_OK);
        unlink(path);
        const double right = median_error(s, false), swapped = median_error(s, true);
        if (!(right < 0.1 && swapped > 0.2)) { // Speos' percentage scales what so coarse a table cuts off
            fail_msg("%s: median error %g, with the directions swapped %g", f->name, right, swapped);
        }
        gonio_samples_free(s);
    }
}

// What was read of a file, at its nodes; elsewhere the model that it was written of.
typedef struct read_back {
    gonio_model head;
    const gonio_model *model;
    const gonio_samples *samples;
    size_t asked; // nodes that were
} read_back;

static double turn_apart(const gonio_pair *a, const gonio_pair *b) {
    if (a->theta_i < 1e-7 || a->theta_o < 1e-7) {
        return 0; // a pole
    }
    return fabs(remainder((a->phi_o - a->phi_i) - (b->phi_o - b->phi_i), 2 * GONIO_PI));
}

static void eval_read(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    read_back *r = (read_back *)(uintptr_t)model;
    const gonio_pair pair = gonio_pair_from_vectors(wi, wo);
    const gonio_samples *s = r->samples;
    for (size_t i = 0; i < s->n; i++) {
        const gonio_pair *p = &s->pairs[i];
        if (fabs(p->theta_i - pair.theta_i) < 1e-7 && fabs(p->theta_o - pair.theta_o) < 1e-7 &&
            turn_apart(p, &pair) < 1e-7) {
            memcpy(values, s->values + i * (size_t)s->channels, (size_t)s->channels * sizeof *values);
            r->asked++;
            return;
        }
    }
    gonio_model_eval(r->model, wi, wo, values);
}

static const gonio_model_ops read_ops = {.kind = "measured", .eval = eval_read, .free = leave};

// Written, read and written again the bytes are the same: what is read is what was written, to the last digit. (MERL,
// RGL and Radiance, which are read as models: tests/conformance. Speos' values are scaled by their percentage.)
static void written_again(const gonio_format *f, const gonio_model *model) {
    gonio_write_options options = small(f);
    options.max_bytes = 12000;
    options.threads = 1;
    gonio_samples *s;
    char path[64];
    size_t size[2];
    written(model, f->name, &options, path);
    assert_int_equal(gonio_read(path, NULL, &s, NULL, NULL), GONIO_OK);
    char *first = bytes_of(path, &size[0]);
    if (s->channels == model->channels) {
        read_back r = {.head = *model, .model = model, .samples = s};
        r.head.ops = &read_ops;
        r.head.sampler = NULL;
        written(&r.head, f->name, &options, path);
        char *second = bytes_of(path, &size[1]);
        if (size[0] != size[1] || memcmp(first, second, size[0]) != 0 || r.asked < s->n / 2) {
            fail_msg("%s: read and written again, %zu bytes became %zu others; %zu of %zu nodes asked", f->name,
                     size[0], size[1], r.asked, s->n);
        }
        free(second);
    }
    gonio_samples_free(s);
    free(first);
}

static void the_same_bytes_again(void **state) {
    (void)state;
    int formats = 0;
    gonio_model *colours;
    assert_int_equal(gonio_model_from_spec("ward:rho_d=0.3/0.2/0.1,rho_s=0.2,alpha=0.3", &colours, NULL), GONIO_OK);
    for (int i = 0; gonio_format_at(i) != NULL; i++) {
        const gonio_format *f = gonio_format_at(i);
        if (f->write_table != NULL && f->read != NULL && f->table == NULL && strcmp(f->name, "speos") != 0) {
            written_again(f, &ordered);
            written_again(f, colours);
            formats++;
        }
    }
    assert_true(formats > 5);
    gonio_model_free(colours);
}

// What a model should not say must not get into a file: readers raise negative values or not, and JSON has null for
// what is no number.
static void every_number_is_one(void **state) {
    (void)state;
    for (int i = 0; gonio_format_at(i) != NULL; i++) {
        const gonio_format *f = gonio_format_at(i);
        if (f->write_table == NULL || strcmp(f->name, "merl") == 0) { // whose -1 says that there is none
            continue;
        }
        const gonio_write_options options = small(f);
        char path[64];
        written(&bad, f->name, &options, path);
        if (f->read != NULL) {
            gonio_samples *s;
            gonio_error error = {0};
            if (gonio_read(path, NULL, &s, NULL, &error) != GONIO_OK) {
                fail_msg("%s: %s", f->name, error.message);
            }
            for (size_t k = 0; k < s->n * (size_t)s->channels; k++) {
                assert_true(s->values[k] >= 0);
            }
            gonio_samples_free(s);
        }
        size_t size;
        char *data = bytes_of(path, &size);
        if (memchr(data, 0, size) == NULL && (strcasestr(data, "nan") != NULL || strcasestr(data, "null") != NULL ||
                                              strcasestr(data, "inf,") != NULL || strcasestr(data, "inf ") != NULL)) {
            fail_msg("%s: holds what is no number", f->name);
        }
        free(data);
    }
}

// ---- Radiance ----

// Matrices carry X and Z, trees u' and v'; either under the other's name would be read in silence.
static void colour_quantities(void **state) {
    (void)state;
    static const char *const bases[] = {"tree3", "tree4", "klems-quarter"};
    for (size_t k = 0; k < sizeof bases / sizeof *bases; k++) {
        gonio_write_options options = {.max_bytes = 60000};
        set(&options, "radiance-basis", bases[k]);
        char *text = text_of("ward:rho_d=0.3/0.2/0.1,rho_s=0.2,alpha=0.3", "radiance", &options);
        const bool tree = k < 2;
        assert_true((strstr(text, ">CIE-u<") != NULL) == tree && (strstr(text, ">CIE-v<") != NULL) == tree);
        assert_true((strstr(text, ">CIE-X<") != NULL) != tree && (strstr(text, ">CIE-Z<") != NULL) != tree);
        free(text);
    }
}

// The front's incident patches are turned by half a turn: then a patch's mirror has its number, in every column.
static void klems_front_is_turned(void **state) {
    (void)state;
    enum { PATCHES = 41, FROM = 9, TO = 33 }; // from wide enough for the lobe to not yet grazing
    static double values[PATCHES * PATCHES];
    gonio_write_options options = {0};
    set(&options, "radiance-basis", "klems-quarter");
    char *text = text_of("ggx:rho_s=1,alpha=0.2,f0=0.5", "radiance", &options);
    const char *at = behind(text, "<ScatteringData>");
    for (int i = 0; i < PATCHES * PATCHES; i++) {
        values[i] = number(&at);
    }
    for (int in = FROM; in < TO; in++) {
        int brightest = 0;
        for (int out = 0; out < PATCHES; out++) {
            brightest = values[out * PATCHES + in] > values[brightest * PATCHES + in] ? out : brightest;
        }
        assert_int_equal(brightest, in);
    }
    free(text);
}

// What Radiance takes out of a three-dimensional tree in colour, together with all of its colour, is not in it.
static void no_floor_in_a_coloured_tree(void **state) {
    (void)state;
    static const char *const specs[] = {"lambert:rho=0.5/0.2/0.1", "ggx:rho_d=0.9/0.02/0.02,rho_s=1,alpha=0.3,f0=0.04",
                                        "ward:rho_d=0.3/0.3/0.3,rho_s=0.2,alpha=0.3"};
    for (size_t k = 0; k < sizeof specs / sizeof *specs; k++) {
        gonio_model *model, *read;
        gonio_write_options options = {.max_bytes = 100000};
        char path[64];
        set(&options, "radiance-basis", "tree3");
        assert_int_equal(gonio_model_from_spec(specs[k], &model, NULL), GONIO_OK);
        written(model, "radiance", &options, path);
        assert_int_equal(gonio_read_table(path, &read, NULL), GONIO_OK);
        const gonio_radiance_model *m = gonio_radiance_own(read);
        assert_true(m != NULL && m->is_tree && m->parts == 3);
        double least = INFINITY;
        for (int i = 0; i < 500; i++) {
            const gonio_vec3 wi = gonio_direction(0.003 * i, 0), wo = gonio_direction(1.5 - 0.003 * i, 0.5 * i);
            least = fmin(least, gonio_tensor_tree_value(&m->tree[0], wi, wo));
        }
        assert_true(least < 0.01 / GONIO_PI);
        assert_true(m->floor[0] > 0.01 / GONIO_PI);
        gonio_model_free(read);
        gonio_model_free(model);
        unlink(path);
    }
}

// ---- RGL ----

// A row of zeros in vndf has no direction: readers divide by its sum.
static void no_row_of_zeros(void **state) {
    (void)state;
    static const char *const specs[] = {"lambert:rho=0", "ggx:rho_s=1,alpha=0.01,f0=0.5",
                                        "ggx:rho_d=0.1,rho_s=1,alpha_x=0.02,alpha_y=0.4",
                                        "blinn-phong:rho_s=1,n=100000"};
    for (size_t k = 0; k < sizeof specs / sizeof *specs; k++) {
        gonio_model *model, *read;
        const gonio_write_options options = {.max_bytes = k == 2 ? 200000 : 60000};
        char path[64];
        assert_int_equal(gonio_model_from_spec(specs[k], &model, NULL), GONIO_OK);
        written(model, "rgl", &options, path);
        assert_int_equal(gonio_read_table(path, &read, NULL), GONIO_OK);
        assert_ptr_equal(read->ops, &gonio_rgl_ops);
        const gonio_rgl_stack *v = &((const gonio_rgl *)read)->vndf;
        for (size_t row = 0; row < v->slices * v->h; row++) {
            float sum = 0;
            for (size_t x = 0; x < v->w; x++) {
                assert_true(v->values[row * v->w + x] >= 0);
                sum += v->values[row * v->w + x];
            }
            assert_true(sum > 0);
        }
        gonio_model_free(read);
        gonio_model_free(model);
        unlink(path);
    }
}

// ---- programs that scale ----

// Zemax rescales a block to its TIS, Speos to its percentage: so these are the albedo itself, which the nodes' values,
// coarse and ending before the horizon, do not integrate to.
static void scales_are_the_albedo(void **state) {
    (void)state;
    static const struct {
        const char *format, *before;
        int blocks;
        double unit;
    } scaled[] = {{"zemax", "TIS ", 6, 1}, {"lighttools", "TIS ", 6, 1}, {"speos", "550\n", 1, 100}};
    for (size_t k = 0; k < sizeof scaled / sizeof *scaled; k++) {
        gonio_write_options options = {0};
        set(&options, "grid-step", "15");
        char *text = text_of("lambert:rho=0.3", scaled[k].format, &options);
        const char *at = text;
        for (int block = 0; block < scaled[k].blocks; block++) {
            at = behind(at, scaled[k].before);
            assert_near(number(&at), 0.3 * scaled[k].unit, 1e-4 * scaled[k].unit);
        }
        free(text);
    }
}

// ---- frames ----

// The column of the largest value among `columns` of a row, each row behind its own angle where `angle` is set.
static int brightest_column(const char **at, int rows, int columns, bool angle) {
    int best = 0;
    double largest = -1;
    for (int r = 0; r < rows; r++) {
        if (angle) {
            number(at);
        }
        for (int c = 0; c < columns; c++) {
            const double value = number(at);
            best = value > largest ? c : best;
            largest = fmax(largest, value);
        }
    }
    return best;
}

// Speos' mirror direction lies at phi 0, LightTools' light at azimuth 90 deg and its mirror direction at 270, Zemax
// counts from the mirror direction.
static void mirrors_are_where_programs_look(void **state) {
    (void)state;
    static const char lobe[] = "ggx:rho_s=1,alpha=0.1,f0=0.5";
    gonio_write_options options = {0};
    set(&options, "grid-step", "15");
    char *text = text_of(lobe, "speos", &options);
    const char *at = behind(text, "550\n"); // tables of 0, 15, 30 and 45 deg
    for (int t = 0; t < 4; t++) {
        number(&at); // per cent
        const int thetas = (int)number(&at), phis = (int)number(&at);
        assert_near(number(&at), 0, 0);
        for (int k = 1; k < phis; k++) {
            number(&at);
        }
        const int best = brightest_column(&at, thetas, phis, true);
        assert_true(t == 0 || best == 0 || best == phis - 1); // 360 deg
    }
    free(text);
    text = text_of(lobe, "lighttools", &options);
    at = behind(text, "ScatterAzimuth ");
    const int azimuths = (int)number(&at);
    double degrees[100];
    for (int k = 0; k < azimuths; k++) {
        degrees[k] = number(&at);
    }
    at = behind(at, "ScatterRadial ");
    const int radials = (int)number(&at);
    at = behind(behind(at, "AOI 45"), "TIS ");
    number(&at);
    double largest = -1, found = NAN;
    for (int a = 0; a < azimuths; a++) {
        for (int r = 0; r < radials; r++) {
            const double value = number(&at);
            found = value > largest ? degrees[a] : found;
            largest = fmax(largest, value);
        }
    }
    assert_near(found, 270, 0);
    free(text);
    text = text_of(lobe, "zemax", &options);
    at = behind(text, "ScatterRadial ");
    const int n = (int)number(&at);
    for (int t = 0; t < 4; t++) {
        at = behind(at, "TIS ");
        number(&at);
        assert_int_equal(brightest_column(&at, 1, n, false), 0);
    }
    free(text);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(the_light_comes_first, tell),
        cmocka_unit_test_teardown(the_same_bytes_again, tell),
        cmocka_unit_test_teardown(every_number_is_one, tell),
        cmocka_unit_test_teardown(colour_quantities, tell),
        cmocka_unit_test_teardown(klems_front_is_turned, tell),
        cmocka_unit_test_teardown(no_floor_in_a_coloured_tree, tell),
        cmocka_unit_test_teardown(no_row_of_zeros, tell),
        cmocka_unit_test_teardown(scales_are_the_albedo, tell),
        cmocka_unit_test_teardown(mirrors_are_where_programs_look, tell),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
