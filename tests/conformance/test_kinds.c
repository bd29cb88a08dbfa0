// SPDX-License-Identifier: BSD-3-Clause
// Every kind of model in brdf/kinds.def, in every form that its file takes, isotropic and not, with 1, 3 and 31
// channels: a file brings the same bits back, the ways to evaluate agree, and a damaged file is refused or answers
// finite numbers.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include <fcntl.h>
#include <string.h>

#include "brdf/kind.h"
#include "brdf/spline/sparse.h"
#include "tests/conformance/make_kind.h"
#include "tests/unit/near.h"
#include "tests/unit/scratch.h"

#define PAIRS 64
#define CHANNELS_MAX 31

static char path[64], copy_path[64];
static const char *model_name; // for messages
static int cases;
static bool behind; // the model answers behind the surface too

// Directions all over the hemisphere, with both poles, the horizon, a mirror pair and a retro pair among them.
static void set_directions(gonio_vec3 *wi, gonio_vec3 *wo) {
    static const double special[][4] = {{0, 0, 0, 0},     {0, 0, 60, 30},    {50, 10, 0, 0},
                                        {40, 0, 40, 180}, {40, 0, 40, 0},    {90, 0, 90, 180},
                                        {90, 45, 90, 45}, {89.9, 0, 10, 90}, {30, 359.9, 30, 180.1}};
    uint64_t seed = 7;
    for (size_t i = 0; i < PAIRS; i++) {
        gonio_pair p = simulate_pair(&seed, 0);
        if (i < sizeof special / sizeof *special) {
            const double *s = special[i];
            p = (gonio_pair){gonio_radians(s[0]), gonio_radians(s[1]), gonio_radians(s[2]), gonio_radians(s[3])};
        }
        p = behind ? gonio_pair_lowered(p, (gonio_half)(i % GONIO_HALVES)) : p;
        wi[i] = gonio_direction(p.theta_i, p.phi_i);
        wo[i] = gonio_direction(p.theta_o, p.phi_o);
    }
}

// All that a model answers.
typedef struct answers {
    double eval[PAIRS][CHANNELS_MAX], channel[PAIRS][CHANNELS_MAX], many[PAIRS * CHANNELS_MAX];
    float narrow[PAIRS][CHANNELS_MAX];
    double gradient[PAIRS][4], sigma[PAIRS][CHANNELS_MAX], support[PAIRS];
    bool has_sigma;
} answers;

static gonio_pair pair_of(gonio_vec3 wi, gonio_vec3 wo) { return gonio_pair_from_vectors(wi, wo); }

// At the first of the pairs; one by one every step-th channel, the gradient at every step-th pair.
static void ask(const gonio_model *model, size_t pairs, int step, answers *a) {
    gonio_vec3 wi[PAIRS], wo[PAIRS];
    memset(a, 0, sizeof *a);
    set_directions(wi, wo);
    for (size_t i = 0; i < pairs; i++) {
        const gonio_pair pair = pair_of(wi[i], wo[i]);
        gonio_model_eval(model, wi[i], wo[i], a->eval[i]);
        gonio_model_eval_f32(model, wi[i], wo[i], a->narrow[i]);
        for (int c = 0; c < model->channels; c += step) {
            a->channel[i][c] = gonio_model_eval_channel(model, wi[i], wo[i], c);
        }
        if (i % (size_t)step == 0) {
            gonio_model_gradient(model, &pair, (int)i % model->channels, a->gradient[i]);
        }
        a->has_sigma = gonio_model_sigma(model, wi[i], wo[i], a->sigma[i]);
        a->support[i] = gonio_model_support(model, wi[i], wo[i]);
    }
    gonio_model_eval_many(model, pairs, wi, wo, a->many);
}

static void assert_same_model(const gonio_model *a, const gonio_model *b, const char *how) {
    answers *x = malloc(sizeof *x), *y = malloc(sizeof *y);
    if (a->channels != b->channels || a->isotropic != b->isotropic || a->bytes != b->bytes ||
        a->control_points != b->control_points || strcmp(a->ops->kind, b->ops->kind) != 0 ||
        memcmp(a->channel_names, b->channel_names, 32 * (size_t)a->channels) != 0) {
        fail_msg("%s: %s, it has another head", model_name, how);
    }
    ask(a, PAIRS, 1, x);
    ask(b, PAIRS, 1, y);
    if (memcmp(x, y, sizeof *x) != 0) {
        fail_msg("%s: %s, it answers other bits", model_name, how);
    }
    free(x);
    free(y);
}

static unsigned char *slurp(const char *file, size_t *length) {
    FILE *f = fopen(file, "rb");
    assert_non_null(f);
    fseek(f, 0, SEEK_END);
    *length = (size_t)ftell(f);
    rewind(f);
    unsigned char *bytes = malloc(*length);
    assert_int_equal(fread(bytes, 1, *length, f), *length);
    fclose(f);
    return bytes;
}

static void saved_is_the_same(const gonio_model *model) {
    gonio_error error = {0};
    gonio_model *back;
    // Of one channel both ways, of 3 mapped, of 31 opened.
    for (int mapped = model->channels == 3; mapped < (model->channels == CHANNELS_MAX ? 1 : 2); mapped++) {
        if (gonio_model_save(model, path, &error) != GONIO_OK ||
            (mapped ? gonio_model_map : gonio_model_open)(path, &back, &error) != GONIO_OK) {
            fail_msg("%s: %s", model_name, error.message);
        }
        assert_same_model(model, back, mapped ? "mapped" : "opened");
        // Saved from its file, it is the same file.
        size_t a, b;
        assert_int_equal(gonio_model_save(back, copy_path, &error), GONIO_OK);
        unsigned char *one = slurp(path, &a), *two = slurp(copy_path, &b);
        assert_int_equal(a, b);
        assert_memory_equal(one, two, a);
        free(one);
        free(two);
        gonio_model_free(back);
    }
}

// ---- the ways to evaluate ----

// The least accurate way sums at most 4^4 = 256 products in float. The weights are not negative and sum to 1, so each
// rounding errs by at most 2^-24 of the largest control point, and 256 independent ones by 16 times that, twice over
// for the weights' own: 2^-19. A control point is at most 4 times the largest value where the spline is that of f_r,
// and at most 32 = -ln(1e-14) where it is of a logarithm, whose error is relative.
static double tolerance(double value, double largest) { return 0x1p-14 * fabs(value) + 0x1p-17 * largest; }

static double largest_of(const answers *a, int channels) {
    double largest = 0;
    for (size_t i = 0; i < PAIRS; i++) {
        for (int c = 0; c < channels; c++) {
            largest = fmax(largest, fabs(a->eval[i][c]));
        }
    }
    return largest;
}

static void assert_agree(const char *how, size_t pair, int channel, double is, double expected, double allowed) {
    if (!(fabs(is - expected) <= allowed)) {
        fail_msg("%s: pair %zu, channel %d: %s %.9g, expected %.9g within %.2g", model_name, pair, channel, how, is,
                 expected, allowed);
    }
}

static void values_agree(const gonio_model *model, const answers *a) {
    // Grazing lobes tower over everything else: an error is held against the largest value of its own pair.
    for (size_t i = 0; i < PAIRS; i++) {
        double largest = 0;
        for (int c = 0; c < model->channels; c++) {
            largest = fmax(largest, fabs(a->eval[i][c]));
            assert_true(isfinite(a->eval[i][c]));
        }
        // Not told where there is no model: behind one of reflection, in a half that is not there.
        const bool told = a->support[i] >= 0 && a->support[i] <= 1;
        assert_true(model->ops->support != NULL ? told || (isnan(a->support[i]) && largest == 0)
                                                : isnan(a->support[i]));
        for (int c = 0; c < model->channels; c++) {
            const double value = a->eval[i][c], allowed = tolerance(value, fmax(largest, 0.1));
            assert_agree("eval_f32", i, c, (double)a->narrow[i][c], value, allowed);
            assert_agree("eval_channel", i, c, a->channel[i][c], value, allowed);
            assert_agree("eval_many", i, c, a->many[i * (size_t)model->channels + (size_t)c], value, allowed);
            assert_true(!a->has_sigma || (isfinite(a->sigma[i][c]) && a->sigma[i][c] >= 0));
        }
    }
}

// However the pairs are split into batches, the same bits come.
static void batches_agree(const gonio_model *model, const answers *a) {
    static const size_t batches[] = {1, 2, 3, 7, 16, 63};
    gonio_vec3 wi[PAIRS], wo[PAIRS];
    static double values[PAIRS * CHANNELS_MAX];
    set_directions(wi, wo);
    for (size_t b = 0; b < sizeof batches / sizeof *batches; b++) {
        for (size_t at = 0; at < PAIRS; at += batches[b]) {
            const size_t n = PAIRS - at < batches[b] ? PAIRS - at : batches[b];
            gonio_model_eval_many(model, n, wi + at, wo + at, values + at * (size_t)model->channels);
        }
        if (memcmp(values, a->many, PAIRS * (size_t)model->channels * sizeof *values) != 0) {
            fail_msg("%s: batches of %zu give other bits", model_name, batches[b]);
        }
    }
}

// Against differences of eval_channel on both sides of a pair, over h: the gradient lies between them, or within the
// tolerance of that. Their truncation is h^2/6 f''' < 1e-3 f for lobes of slope 0.25 and the half vector's stretch of
// 0.1 (f''' < 1000 f), their rounding in float 2^-20 f / h. Between, not at the mean: shadowing has kinks.
static void gradient_agrees(const gonio_model *model, double largest) {
    const double h = 2e-3;
    uint64_t seed = 11;
    for (int i = 0; i < 24; i++) {
        const gonio_pair p = simulate_pair(&seed, 0);
        // Away from the poles and the horizon, where a step would leave the hemisphere.
        const gonio_pair front = {fmin(0.1 + 0.9 * p.theta_i, 1.3), p.phi_i, fmin(0.1 + 0.9 * p.theta_o, 1.3), p.phi_o};
        const gonio_pair pair = gonio_pair_lowered(front, (gonio_half)(behind ? i % GONIO_HALVES : 0));
        const double at[4] = {pair.theta_i, pair.phi_i, pair.theta_o, pair.phi_o};
        const int channel = i % model->channels;
        double gradient[4];
        gonio_model_gradient(model, &pair, channel, gradient);
        for (int k = 0; k < 4; k++) {
            double value[3];
            for (int s = 0; s < 3; s++) {
                double moved[4];
                memcpy(moved, at, sizeof moved);
                moved[k] += (s - 1) * h;
                value[s] = gonio_model_eval_channel(model, gonio_direction(moved[0], moved[1]),
                                                    gonio_direction(moved[2], moved[3]), channel);
            }
            const double left = (value[1] - value[0]) / h, right = (value[2] - value[1]) / h;
            assert_agree("gradient", (size_t)i, channel, gradient[k], (left + right) / 2,
                         fabs(right - left) / 2 + 2e-3 * (largest + fabs(gradient[k])));
        }
    }
}

// Isotropic: nothing changes where both directions turn about the normal, beyond the rounding of coordinates.
static void isotropy_holds(const gonio_model *model) {
    double before[CHANNELS_MAX], after[CHANNELS_MAX];
    uint64_t seed = 13;
    for (int i = 0; model->isotropic && i < 50; i++) {
        gonio_pair pair = simulate_pair(&seed, 0);
        gonio_model_eval_pair(model, &pair, before);
        const double turn = 6 * simulate_uniform(&seed);
        pair.phi_i += turn;
        pair.phi_o += turn;
        gonio_model_eval_pair(model, &pair, after);
        for (int c = 0; c < model->channels; c++) {
            assert_agree("turned", (size_t)i, c, after[c], before[c], tolerance(before[c], fabs(before[c])));
        }
    }
}

// ---- the list itself ----

static void for_every_model(void (*test)(const kind_maker *maker, const gonio_model *model)) {
    static const int channels[] = {1, 3, CHANNELS_MAX};
    kind_maker maker;
    for (size_t m = 0; kind_maker_at(m, &maker); m++) {
        for (int isotropic = 1; isotropic >= (maker.isotropic_only ? 1 : 0); isotropic--) {
            for (size_t k = 0; k < 3; k++) {
                if (maker.formula != NULL && k != m % 3) {
                    continue; // all formulae are one kind, and among them they have every number of channels
                }
                char name[128];
                snprintf(name, sizeof name, "%s (%s), %s, %d channels", maker.kind, maker.form,
                         isotropic ? "isotropic" : "anisotropic", channels[k]);
                model_name = name;
                gonio_model *model = kind_make(&maker, isotropic != 0, channels[k]);
                assert_int_equal(model->channels, channels[k]);
                if (model->isotropic != (isotropic != 0) || strcmp(model->ops->kind, maker.kind) != 0) {
                    fail_msg("%s: its builder made a model of kind %s", name, model->ops->kind);
                }
                behind = model->ops->both_sides;
                test(&maker, model);
                cases++;
                gonio_model_free(model);
            }
        }
    }
}

static void kinds_are_registered_and_built(void **state) {
    (void)state;
    size_t n = 0;
    for (const gonio_kind *const *k = gonio_kinds(); *k != NULL; k++, n++) {
        const gonio_kind *kind = *k;
        assert_true(strlen(kind->name) > 0 && strlen(kind->name) < GONIO_KIND_NAME_MAX);
        assert_true(strlen(kind->summary) > 0 && strchr(kind->summary, '\n') == NULL);
        assert_ptr_equal(gonio_kind_find(kind->name), kind); // no two of a name
        assert_string_equal(kind->ops->kind, kind->name);
        assert_true(kind->ops->eval != NULL && kind->ops->free != NULL && kind->ops->save != NULL &&
                    kind->read != NULL);
        bool built = false;
        kind_maker maker;
        for (size_t m = 0; kind_maker_at(m, &maker); m++) {
            built = built || strcmp(maker.kind, kind->name) == 0;
        }
        if (!built) {
            fail_msg("kind %s has no builder in tests/conformance/make_kind.h", kind->name);
        }
    }
    assert_true(n > 0);
}

static void evaluate_and_save(const kind_maker *maker, const gonio_model *model) {
    (void)maker;
    static answers a;
    ask(model, PAIRS, 1, &a);
    values_agree(model, &a);
    batches_agree(model, &a);
    gradient_agrees(model, fmin(largest_of(&a, model->channels), 1));
    isotropy_holds(model);
    saved_is_the_same(model);
}

static void models_evaluate_alike_and_come_back(void **state) {
    (void)state;
    cases = 0;
    for_every_model(evaluate_and_save);
    size_t kinds = 0;
    while (gonio_kinds()[kinds] != NULL) {
        kinds++;
    }
    print_message("# %zu kinds x %d cases\n", kinds, cases);
}

// ---- damage ----

#define PROBES 10  // pairs that are asked of a damaged model: the special ones
#define SMALL 3072 // bytes of a file that is damaged at every place

static void put(int fd, const void *data, size_t length, size_t at) {
    assert_int_equal(pwrite(fd, data, length, (off_t)at), length);
}

// What a reader must do without the checksum: give the file at fd the one it would have been written with.
static void seal(int fd, const unsigned char *bytes, size_t length) {
    gonio_model_file_head head;
    if (length < sizeof head) {
        return;
    }
    memcpy(&head, bytes, sizeof head);
    head.length = length;
    gonio_checksum sum = gonio_model_file_checksum(&head);
    gonio_checksum_add(&sum, bytes + sizeof head, length - sizeof head);
    head.checksum = gonio_checksum_end(&sum);
    put(fd, &head, sizeof head, 0);
}

static void assert_refused(gonio_status status, const gonio_model *model, const gonio_error *error, const char *what,
                           size_t at) {
    if (status != GONIO_E_INPUT || model != NULL || strcmp(error->file, path) != 0 || error->byte < 0 ||
        error->message[0] == 0) {
        fail_msg("%s: %s %zu: status %d, %s, byte %lld: %s", model_name, what, at, status,
                 model != NULL ? "opened" : "no model", error->byte, error->message);
    }
}

static void open_refused(bool mapped, const char *what, size_t at) {
    gonio_error error = {.byte = -1};
    gonio_model *model;
    const gonio_status status = (mapped ? gonio_model_map : gonio_model_open)(path, &model, &error);
    assert_refused(status, model, &error, what, at);
}

// Where the file is opened, every answer must be finite, unless `wild` allows for what a control point may be.
static void refused_or_finite(const char *what, size_t at, bool wild) {
    static answers a;
    gonio_error error = {.byte = -1};
    gonio_model *model;
    const gonio_status status = gonio_model_open(path, &model, &error);
    if (status != GONIO_OK) {
        assert_refused(status, model, &error, what, at);
        return;
    }
    if (model->channels <= CHANNELS_MAX) {
        ask(model, PROBES, 16, &a);
        for (size_t i = 0; i < PROBES; i++) {
            for (int c = 0; c < model->channels; c++) {
                if (!wild && !isfinite(a.eval[i][c])) {
                    fail_msg("%s: %s %zu: pair %zu, channel %d answers %g", model_name, what, at, i, c, a.eval[i][c]);
                }
            }
        }
    }
    gonio_model_free(model);
}

static void cut_files(int fd, const unsigned char *bytes, size_t length) {
    // Every multiple of 8 (of large files some 40 of them), and odd lengths beside them.
    const size_t stride = length > SMALL ? length / 320 * 8 : 8;
    for (size_t n = length - 1; n-- > 0;) {
        if (n % stride != 0 && (n + 1) % (8 * stride) > 2) {
            continue;
        }
        assert_int_equal(ftruncate(fd, (off_t)n), 0);
        open_refused(false, "cut to", n);
        open_refused(true, "cut to", n);
    }
    // Cut, but with a head that says so: what is missing must be found by the kind. Less than 64 bytes are padding.
    put(fd, bytes, length, 0);
    const size_t step = length > SMALL ? length / 40 : 20;
    for (size_t n = length - 64; n >= sizeof(gonio_model_file_head); n -= n < step ? n : step) {
        put(fd, bytes, sizeof(gonio_model_file_head), 0);
        assert_int_equal(ftruncate(fd, (off_t)n), 0);
        seal(fd, bytes, n);
        open_refused(false, "sealed and cut to", n);
    }
    put(fd, bytes, length, 0);
}

// Did the damage make a number that is no error by itself, and too large? A control point may be any float, and readers
// do not look at it: beyond 100 the exponential overflows. Scales follow the data: any power of two is possible.
// Whatever stands before the scales is not wild, however it reads.
static bool wild(const unsigned char *bytes, size_t at, size_t section, int channels) {
    const size_t scales = section + 64, points = scales + (16 * (size_t)channels + 63) / 64 * 64;
    float narrow;
    double number;
    memcpy(&narrow, bytes + at / 4 * 4, sizeof narrow);
    memcpy(&number, bytes + at / 8 * 8, sizeof number);
    uint16_t half;
    memcpy(&half, bytes + at / 2 * 2, sizeof half);
    return at >= scales && (!(fabs(number) < 0x1p500) ||
                            (at >= points && (!(fabsf(narrow) < 100) || !(fabsf(gonio_half_decode(half)) < 100))));
}

static void flip_files(int fd, unsigned char *bytes, size_t length, int channels) {
    uint64_t seed = 17;
    uint64_t section;
    memcpy(&section, bytes + offsetof(gonio_model_file_head, section), sizeof section);
    for (size_t at = 0; at < length; at++) {
        // Every byte of small files; of the others the head, what says what the section is, and 100 more.
        const bool telling = at < sizeof(gonio_model_file_head) || (at >= section && at < section + 192);
        if (length > SMALL && !telling && simulate_uniform(&seed) * (double)length > 100) {
            continue;
        }
        const unsigned char was = bytes[at], bit = (unsigned char)(1 << (int)(8 * simulate_uniform(&seed)));
        bytes[at] ^= bit;
        put(fd, bytes + at, 1, at);
        open_refused(false, "flipped at", at);
        seal(fd, bytes, length);
        refused_or_finite("sealed and flipped at", at, wild(bytes, at, section, channels));
        bytes[at] = was;
        put(fd, bytes, sizeof(gonio_model_file_head), 0);
        put(fd, bytes + at, 1, at);
    }
}

static void damage(const kind_maker *maker, const gonio_model *model) {
    size_t length;
    if (maker->formula != NULL  ? strcmp(maker->formula->name, "ward") != 0
        : maker->isotropic_only ? model->channels == 3
                                : model->channels != (model->isotropic ? 1 : CHANNELS_MAX)) {
        return; // the file of one formula is like another's, that of 3 channels like those of 1 and 31
    }
    assert_int_equal(gonio_model_save(model, path, NULL), GONIO_OK);
    unsigned char *bytes = slurp(path, &length);
    const int fd = open(path, O_RDWR);
    assert_true(fd >= 0);
    cut_files(fd, bytes, length);
    flip_files(fd, bytes, length, model->channels);
    close(fd);
    free(bytes);
}

static void damaged_files_are_refused(void **state) {
    (void)state;
    for_every_model(damage);
}

// ---- the analytic formulae ----

static gonio_model *formula_model(const gonio_formula *formula, const double *parameters) {
    const gonio_analytic_term term = {formula, parameters};
    gonio_model *model;
    gonio_error error = {0};
    if (gonio_analytic_new(&term, 1, 1, NULL, &model, &error) != GONIO_OK) {
        fail_msg("%s: %s", formula->name, error.message);
    }
    return model;
}

// Finite, not negative, reciprocal and isotropic as declared, at 64 pairs.
static void check_formula(const gonio_formula *formula, const double *parameters) {
    gonio_vec3 wi[PAIRS], wo[PAIRS];
    gonio_model *model = formula_model(formula, parameters);
    set_directions(wi, wo);
    for (size_t i = 0; i < PAIRS; i++) {
        double there, back;
        gonio_model_eval(model, wi[i], wo[i], &there);
        gonio_model_eval(model, wo[i], wi[i], &back);
        assert_true(isfinite(there) && there >= 0);
        if (!formula->not_reciprocal && fabs(back - there) > 1e-9 * there) {
            fail_msg("%s: pair %zu: %.17g, with light and eye exchanged %.17g", formula->name, i, there, back);
        }
    }
    gonio_model_free(model);
}

static void formulae_keep_what_they_declare(void **state) {
    (void)state;
    uint64_t seed = 19;
    for (const gonio_formula *const *f = gonio_formulae(); *f != NULL; f++) {
        const gonio_formula *formula = *f;
        assert_true(strlen(formula->name) > 0 && strlen(formula->name) < GONIO_FORMULA_NAME_MAX);
        assert_true(strlen(formula->summary) > 0 && strlen(formula->source) > 0);
        assert_ptr_equal(gonio_formula_find(formula->name), formula);
        char cut[GONIO_FORMULA_FILE_NAME_MAX] = "";
        strncpy(cut, formula->name, sizeof cut - 1);
        assert_ptr_equal(gonio_formula_of_file(cut), formula);
        assert_true(formula->n >= 1 && formula->n <= GONIO_FORMULA_PARAMETERS_MAX);
        double values[GONIO_FORMULA_PARAMETERS_MAX];
        for (int round = 0; round < 200; round++) {
            for (int k = 0; k < formula->n; k++) {
                const gonio_formula_parameter *p = &formula->parameters[k];
                assert_true(p->name != NULL && p->text != NULL && p->minimum < p->maximum);
                // Both bounds, then values of every magnitude between them.
                const double u = simulate_uniform(&seed), low = fmax(p->minimum, 1e-5 * p->maximum);
                values[k] = u < 0.1 ? p->minimum : u > 0.9 ? p->maximum : low * pow(p->maximum / low, u);
            }
            check_formula(formula, values);
        }
    }
}

// "name:first=0.3,second=0.4": parameters out of a SPEC are those of the table, and its bounds are held.
static void spec_of(const gonio_formula *formula, const double *values, int without, char *text, size_t size) {
    snprintf(text, size, "%s:", formula->name);
    for (int k = 0; k < formula->n; k++) {
        const size_t used = strlen(text);
        if (k != without) {
            snprintf(text + used, size - used, "%s%s=%.17g", text[used - 1] == ':' ? "" : ",",
                     formula->parameters[k].name, values[k]);
        }
    }
}

static void specs_follow_the_tables(void **state) {
    (void)state;
    for (const gonio_formula *const *f = gonio_formulae(); *f != NULL; f++) {
        const gonio_formula *formula = *f;
        double values[GONIO_FORMULA_PARAMETERS_MAX];
        char text[512];
        gonio_model *model;
        for (int k = 0; k < formula->n; k++) {
            values[k] = kind_parameter(formula, k, false, 0);
        }
        spec_of(formula, values, -1, text, sizeof text);
        model = simulate_truth(text);
        const gonio_analytic_term *term;
        assert_int_equal(gonio_analytic_terms(model, &term), 1);
        assert_memory_equal(term->parameters, values, (size_t)formula->n * sizeof *values);
        gonio_model_free(model);
        for (int k = 0; k < formula->n; k++) {
            const gonio_formula_parameter *p = &formula->parameters[k];
            gonio_error error = {0};
            spec_of(formula, values, k, text, sizeof text);
            const gonio_status status = gonio_model_from_spec(text, &model, &error);
            assert_int_equal(status, isnan(p->initial) && formula->n > 1 ? GONIO_E_USAGE : status);
            if (status == GONIO_OK) {
                assert_int_equal(gonio_analytic_terms(model, &term), 1);
                assert_true(term->parameters[k] == p->initial);
                gonio_model_free(model);
            } else {
                assert_non_null(strstr(error.message, p->name));
            }
            const double kept = values[k];
            for (int side = 0; side < 2; side++) {
                values[k] = side == 0 ? p->minimum - 1e-3 * (p->maximum - p->minimum) : p->maximum * 1.001;
                spec_of(formula, values, -1, text, sizeof text);
                assert_int_equal(gonio_model_from_spec(text, &model, &error), GONIO_E_USAGE);
                assert_non_null(strstr(error.message, p->text));
            }
            values[k] = kept;
        }
    }
}

int main(void) {
    scratch_file(path, "", 0);
    scratch_file(copy_path, "", 0);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(kinds_are_registered_and_built), cmocka_unit_test(models_evaluate_alike_and_come_back),
        cmocka_unit_test(damaged_files_are_refused),      cmocka_unit_test(formulae_keep_what_they_declare),
        cmocka_unit_test(specs_follow_the_tables),
    };
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    unlink(path);
    unlink(copy_path);
    return failed;
}
