// SPDX-License-Identifier: BSD-3-Clause
// Models of every kind, for tests that go over the list of kinds.
//
// A kind has at least one line in the table below, a line for each form that its file can take; tests/conformance/
// test_kinds.c fails for a kind that has none. The analytic kind has one for each formula beside.
#ifndef TESTS_MAKE_KIND_H
#define TESTS_MAKE_KIND_H

#include "brdf/analytic/formula.h"
#include "brdf/grid/lifting.h"
#include "brdf/kind/analytic.h"
#include "brdf/kind/bvb.h"
#include "brdf/kind/kernel.h"
#include "brdf/kind/linear.h"
#include "brdf/kind/lobe_spline.h"
#include "brdf/kind/transformed.h"
#include "fit/options.h"
#include "tests/simulate.h"

// What a constructed lobe-spline has.
enum { KIND_SPLINE = 1, KIND_RANGE = 2, KIND_SIGMA = 4, KIND_GRAZING = 8, KIND_PROFILE = 16, KIND_SHARES = 32 };

typedef struct kind_maker {
    const char *kind;
    const char *form; // for messages
    bool isotropic_only;
    const char *method, *storage;    // of a fitted one
    const gonio_formula *formula;    // of one analytic term
    const gonio_linear_basis *basis; // of one with coefficients
    int order;                       // of a B-spline volume
    int lobes, parts; // of a constructed lobe-spline: how many lobes, KIND_ bits; of others: which
    gonio_domain domain;
    gonio_coordinates coordinates;
} kind_maker;

static const kind_maker kind_forms[] = {
    {"lattice", "linear", .method = "mba"},
    {"lattice", "log, half-vector", .method = "mba", .domain = GONIO_LOG, .coordinates = GONIO_HALF_VECTOR},
    {"cbmba", "float", true, "cbmba", "float", .domain = GONIO_LINEAR},
    {"cbmba", "half", true, "cbmba", "half", .domain = GONIO_LOG},
    {"cbmba", "byte", true, "cbmba", "byte", .coordinates = GONIO_HALF_VECTOR},
    {"cbmba", "hash", true, "cbmba", "hash", .domain = GONIO_LINEAR},
    {"cbmba", "jenkins", .method = "cbmba", .storage = "jenkins", .domain = GONIO_LINEAR},
    {"koenderink", "order 8", true, .basis = &gonio_basis_koenderink},
    {"harmonics", "usual orders", .basis = &gonio_basis_harmonics},
    {"harmonics", "with sigma", true, .basis = &gonio_basis_harmonics, .parts = KIND_SIGMA},
    {"bvb", "order 2, log", .order = 2, .domain = GONIO_LOG},
    {"bvb", "order 4", .order = 4},
    {"table", "linear, angles", .method = "table", .parts = GONIO_GRID_ANGLES, .domain = GONIO_LINEAR},
    {"table", "cubic, half-angles", .method = "interpolating-spline", .parts = GONIO_GRID_HALF_ANGLES,
     .domain = GONIO_LOG},
    {"kernel", "directions", .method = "kernel", .parts = GONIO_DISTANCE_DIRECTIONS, .domain = GONIO_LINEAR},
    {"kernel", "half-vector", .method = "kernel", .parts = GONIO_DISTANCE_HALF_VECTOR, .domain = GONIO_LOG},
    {"separable", "directions", .method = "separable", .parts = GONIO_GRID_ANGLES, .domain = GONIO_LINEAR},
    {"separable", "half and difference", .method = "separable", .parts = GONIO_GRID_HALF_ANGLES, .domain = GONIO_LOG},
    {"wavelet", "haar", .method = "wavelet", .parts = GONIO_WAVELET_HAAR, .domain = GONIO_LINEAR},
    {"wavelet", "cdf53", .method = "wavelet", .parts = GONIO_WAVELET_CDF53, .domain = GONIO_LOG},
    {"hierarchical", "linear", .method = "hierarchical"},
    {"hierarchical", "log, half-vector", .method = "hierarchical", .domain = GONIO_LOG,
     .coordinates = GONIO_HALF_VECTOR},
    {"homomorphic", "factors", .method = "homomorphic"},
    {"geodesic", "facets", .method = "geodesic", .domain = GONIO_LOG},
    {"lobe-spline", "lobes alone", .domain = GONIO_LOG, .lobes = 2},
    {"lobe-spline", "linear spline", .parts = KIND_SPLINE | KIND_SIGMA},
    {"lobe-spline", "grazing factor", .domain = GONIO_LOG, .parts = KIND_SPLINE | KIND_RANGE | KIND_GRAZING},
    {"lobe-spline", "profile", true, .domain = GONIO_LOG, .coordinates = GONIO_HALF_VECTOR,
     .parts = KIND_SPLINE | KIND_RANGE | KIND_SIGMA | KIND_PROFILE},
    {"lobe-spline", "lobes and shares", .domain = GONIO_LOG, .coordinates = GONIO_REFLECTED, .lobes = 2,
     .parts = KIND_SPLINE | KIND_RANGE | KIND_SIGMA | KIND_SHARES},
    {"transformed", "reciprocal", .parts = GONIO_MADE_RECIPROCAL},
    {"transformed", "isotropic", true, .parts = GONIO_MADE_ISOTROPIC},
    {"transformed", "scaled", .parts = GONIO_MADE_SCALED},
    {"transformed", "passive", .parts = GONIO_MADE_PASSIVE},
    {"transformed", "separable", .parts = GONIO_MADE_SEPARABLE},
    {"halves", "all four, with sigma", .parts = KIND_SPLINE | KIND_SIGMA},
    {"halves", "of several kinds, one not there", .lobes = 1, .parts = KIND_SPLINE},
};
#define KIND_FORMS (sizeof kind_forms / sizeof *kind_forms)

// The maker of that index, false behind the last one: the forms above, then a term of every formula.
static inline bool kind_maker_at(size_t index, kind_maker *out) {
    if (index < KIND_FORMS) {
        *out = kind_forms[index];
        return true;
    }
    const gonio_formula *const *formula = gonio_formulae();
    for (index -= KIND_FORMS; *formula != NULL && index > 0; index--) {
        formula++;
    }
    if (*formula != NULL) {
        *out = (kind_maker){"analytic", (*formula)->name, (*formula)->isotropic == NULL, .formula = *formula};
    }
    return *formula != NULL;
}

// A value within the bounds of parameter k: 0.3, so that no lobe is narrow; without symmetry each parameter has
// another.
static inline double kind_parameter(const gonio_formula *formula, int k, bool isotropic, int channel) {
    const gonio_formula_parameter *p = &formula->parameters[k];
    return fmin(fmax((isotropic ? 0.3 : 0.3 + 0.1 * k) * (1 + 0.002 * channel), p->minimum), p->maximum);
}

static inline gonio_model *kind_make_analytic(const kind_maker *maker, bool isotropic, int channels) {
    const gonio_formula *formula = maker->formula;
    double *values = malloc((size_t)channels * (size_t)formula->n * sizeof *values);
    for (int c = 0; values != NULL && c < channels; c++) {
        for (int k = 0; k < formula->n; k++) {
            // Both slopes of an isotropic lobe are the same number; elsewhere the channels differ.
            values[c * formula->n + k] = kind_parameter(formula, k, isotropic, c);
        }
        for (int k = 0; k < formula->n && isotropic && formula->isotropic != NULL; k++) {
            // What says by itself how far the lobe is from round keeps the value that a SPEC leaves out.
            const double left_out = formula->parameters[k].initial;
            if (!formula->isotropic(values + c * formula->n) && !isnan(left_out)) {
                values[c * formula->n + k] = left_out;
            }
        }
    }
    const gonio_analytic_term term = {formula, values};
    gonio_model *model = NULL;
    gonio_error error = {0};
    if (values == NULL || gonio_analytic_new(&term, 1, channels, NULL, &model, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    free(values);
    return model;
}

// Coefficients that fall as those of smooth functions do.
static inline gonio_model *kind_make_linear(const kind_maker *maker, bool isotropic, int channels) {
    const int order = maker->basis->order_usual[isotropic];
    const size_t terms = (size_t)maker->basis->terms(order, isotropic), count = terms * (size_t)channels;
    double *coefficients = malloc(count * sizeof *coefficients);
    char names[GONIO_CHANNELS_MAX][32] = {{0}};
    for (size_t k = 0; coefficients != NULL && k < count; k++) {
        coefficients[k] = sin(1 + (double)k) / (1 + (double)(k % terms) * (double)(k % terms));
    }
    for (int c = 0; c < channels; c++) {
        snprintf(names[c], sizeof names[c], "%dnm", 400 + 10 * c);
    }
    float *matrix = calloc(terms * terms, sizeof *matrix);
    double *factors = calloc((size_t)channels, sizeof *factors);
    for (size_t k = 0; matrix != NULL && factors != NULL && k < terms; k++) {
        matrix[k * terms + k] = 0.01F;
        factors[k % (size_t)channels] = 1 + 0.1 * (double)(k % (size_t)channels);
    }
    const gonio_linear_spread spread = {matrix, factors};
    gonio_model *model = NULL;
    gonio_error error = {0};
    if (coefficients == NULL ||
        gonio_linear_new(maker->basis, order, isotropic, channels, coefficients, maker->parts != 0 ? &spread : NULL,
                         (const char(*)[32])names, &model, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    free(coefficients);
    free(matrix);
    free(factors);
    return model;
}

// Control points of a smooth function between 0 and 1.
static inline gonio_lattice kind_lattice(int dims, int level, int channels) {
    gonio_lattice lattice;
    gonio_error error = {0};
    if (gonio_lattice_init(&lattice, dims, level, channels, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    for (size_t i = 0; i < lattice.count; i++) {
        double sum = 0;
        size_t rest = i;
        for (int d = 0; d < dims; d++, rest /= lattice.size) {
            sum += sin(1 + d + 2 * (double)(rest % lattice.size) / (double)lattice.size) / dims;
        }
        for (int c = 0; c < channels; c++) {
            lattice.points[i * (size_t)channels + (size_t)c] = (float)(0.5 + 0.5 * sum / (1 + 0.01 * c));
        }
    }
    return lattice;
}

static inline double *kind_numbers(size_t n, double value) {
    double *numbers = malloc(n * sizeof *numbers);
    for (size_t i = 0; numbers != NULL && i < n; i++) {
        numbers[i] = value * (1 + 0.001 * (double)i);
    }
    return numbers;
}

// A lobe-spline with the parts that the maker asks for; a fit of one takes seconds.
static inline gonio_model *kind_make_lobes(const kind_maker *maker, bool isotropic, int channels) {
    char names[GONIO_CHANNELS_MAX][32] = {{0}};
    const size_t c = (size_t)channels;
    const int dims = isotropic ? 3 : 4, level = isotropic ? 2 : 1, has = maker->parts;
    gonio_lobe_spline_parts p = {.channels = channels,
                                 .dims = dims,
                                 .coordinates = maker->coordinates,
                                 .kind = maker->domain == GONIO_LOG ? GONIO_TRANSFORM_POSITIVE : GONIO_TRANSFORM_LINEAR,
                                 .transforms = malloc(c * sizeof *p.transforms),
                                 .base = {.lobes = maker->lobes,
                                          .family = GONIO_LOBE_GGX,
                                          .alpha = {0.3, 0.5},
                                          .f0 = {0.04, 0.5},
                                          .cosine_min = 0.05F,
                                          .grazing = (has & KIND_GRAZING) != 0 ? 0.5F : 0},
                                 .channel_names = (const char(*)[32])names};
    for (size_t k = 0; k < c; k++) {
        p.transforms[k] = (gonio_transform){0.5, 1e-3};
        snprintf(names[k], sizeof names[k], "%zunm", 400 + 10 * k);
    }
    p.base.strength = maker->lobes > 0 ? kind_numbers(c * (1 + GONIO_LOBES_MAX), 0.1) : NULL;
    p.lattice = (has & KIND_SPLINE) != 0 ? kind_lattice(dims, level, channels) : p.lattice;
    p.range = (has & KIND_RANGE) != 0 ? kind_numbers(2 * c, -2) : NULL;
    for (size_t k = 0; p.range != NULL && k < c; k++) {
        p.range[2 * k + 1] = 2;
    }
    if ((has & KIND_SIGMA) != 0) {
        p.sigma = kind_lattice(dims, 1, 1);
        p.sigma_factor = kind_numbers(c, 0.01);
        p.sigma_half_vector = maker->coordinates != GONIO_REFLECTED;
        p.support = p.sigma_half_vector ? kind_lattice(dims, 1, 1) : p.support;
    }
    p.profile = (has & KIND_PROFILE) != 0 ? kind_lattice(2, 3, channels) : p.profile;
    p.shares = (has & KIND_SHARES) != 0 ? kind_numbers(c * (1 + GONIO_LOBES_MAX), 0.2) : NULL;
    gonio_model *model = NULL;
    gonio_error error = {0};
    if (gonio_lobe_spline_new(&p, &model, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    return model;
}

// A volume of a smooth function between 0 and 1, its knots closer toward the ends.
static inline gonio_model *kind_make_bvb(const kind_maker *maker, bool isotropic, int channels) {
    const size_t order = (size_t)maker->order, c = (size_t)channels;
    gonio_bvb_parts p = {.dims = isotropic ? 3 : 4,
                         .order = maker->order,
                         .channels = channels,
                         .count = {5, 6, 7, isotropic ? 1 : 5}};
    char names[GONIO_CHANNELS_MAX][32] = {{0}};
    for (int d = 0; d < p.dims; d++) {
        p.knots[d] = malloc((p.count[d] + order) * sizeof(double));
        for (size_t k = 0; p.knots[d] != NULL && k < p.count[d] + order; k++) {
            const double inside = fmin(fmax((double)k - (double)order + 1, 0) / (double)(p.count[d] - order + 1), 1);
            p.knots[d][k] = inside - 0.1 * sin(2 * GONIO_PI * inside) / GONIO_PI;
            p.knots[d][k] = k + 1 > p.count[d] ? 1 : p.knots[d][k];
        }
    }
    const size_t points = gonio_bvb_points(&p);
    p.points = calloc(points * c + GONIO_BVB_PAD, sizeof *p.points);
    for (size_t i = 0; p.points != NULL && i < points * c; i++) {
        // Of phi_d as a cosine is, so that both ends are alike.
        const double turn = 2 * GONIO_PI * (double)(i / c % p.count[2]) / (double)(p.count[2] - 1);
        const double slow = (double)(i / c / p.count[2]) / (double)(points / p.count[2]);
        p.points[i] = (float)(0.4 + 0.3 * cos(turn) * slow + 0.2 * slow + 0.001 * (double)(i % c));
    }
    gonio_transform *transforms = malloc(c * sizeof *transforms);
    double *range = malloc(2 * c * sizeof *range);
    for (size_t k = 0; transforms != NULL && range != NULL && k < c; k++) {
        transforms[k] = (gonio_transform){0.5, 1e-3};
        range[2 * k] = 0.1;
        range[2 * k + 1] = 0.9;
        snprintf(names[k], sizeof names[k], "%zunm", 400 + 10 * k);
    }
    gonio_model *model = NULL;
    gonio_error error = {0};
    if (gonio_bvb_model_new(&p, maker->domain == GONIO_LOG ? GONIO_TRANSFORM_POSITIVE : GONIO_TRANSFORM_LINEAR,
                            transforms, range, (const char(*)[32])names, &model, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    free(transforms);
    free(range);
    return model;
}

// A model fitted to a few hundred samples of a smooth lobe.
static inline gonio_model *kind_make_fitted(const kind_maker *maker, bool isotropic, int channels) {
    gonio_samples *samples = simulate_samples(isotropic ? "ward:rho_d=0.3,rho_s=0.2,alpha=0.3"
                                                        : "ward:rho_d=0.3,rho_s=0.2,alpha_x=0.25,alpha_y=0.4",
                                              strcmp(maker->kind, "kernel") == 0 ? 50 : 400, channels, 1);
    gonio_fit_options options;
    gonio_model *model = NULL;
    gonio_error error = {0};
    gonio_fit_options_default(&options);
    options.method = maker->method;
    options.hold_out = 0;
    options.level = isotropic ? 3 : maker->storage != NULL ? 2 : 1;
    options.domain = maker->domain;
    options.coordinates = maker->coordinates;
    options.diffuse_level = 1;
    if (maker->storage != NULL) {
        options.drop_percent = 50;
        options.storage = maker->storage;
    }
    options.grid = options.distance = options.wavelet = maker->parts;
    if (gonio_method_has_member(maker->method, offsetof(gonio_fit_options, fill))) { // small and quick
        options.level = isotropic ? 2 : 1;
        options.fill = "kernel";
    }
    gonio_fit_options_for(&options, maker->method);
    if (gonio_fit(samples, &options, &model, NULL, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    gonio_samples_free(samples);
    return model;
}

// A Ward lobe, half of the way to the maker's property.
static inline gonio_model *kind_make_transformed(const kind_maker *maker, bool isotropic, int channels) {
    const kind_maker ward = {"analytic", "ward", .formula = gonio_formula_find("ward")};
    gonio_model *inner = kind_make_analytic(&ward, isotropic, channels), *model = NULL;
    gonio_transformed_parts p = {.what = (gonio_transformation)maker->parts, .delta = 0.5};
    gonio_error error = {0};
    double *numbers = kind_numbers(2 * 2 * (size_t)channels * 2 * 8, 0.5);
    if (p.what == GONIO_MADE_SCALED || p.what == GONIO_MADE_PASSIVE) {
        p.knots = 5;
        p.factors = numbers;
    } else if (p.what == GONIO_MADE_SEPARABLE) {
        p.products = p.thetas = 2;
        p.phis = 8;
        p.tables = numbers;
    }
    if (numbers == NULL || gonio_transformed_new(inner, &p, &model, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    free(numbers);
    // Products of tables are not isotropic; the mean over azimuths of them is, and stands around them.
    const gonio_transformed_parts mean = {.what = GONIO_MADE_ISOTROPIC, .delta = 1};
    if (isotropic && p.what == GONIO_MADE_SEPARABLE &&
        gonio_transformed_new(model, &mean, &model, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    return model;
}

// Four models of the form, which differ by their scale and in the second form by their kind.
static inline gonio_model *kind_make_halves(const kind_maker *maker, bool isotropic, int channels) {
    gonio_model *halves[GONIO_HALVES] = {NULL}, *model = NULL;
    gonio_error error = {0};
    for (int h = 0; h < GONIO_HALVES; h++) {
        kind_maker own = *maker;
        own.coordinates = h % 2 == 0 ? GONIO_NUSSELT : GONIO_HALF_VECTOR;
        own.formula = maker->lobes > 0 && h == GONIO_TRANSMISSION ? gonio_formula_find("lambert") : NULL;
        if (maker->lobes == 0 || h != GONIO_TRANSMISSION_BACK) {
            halves[h] = own.formula != NULL ? kind_make_analytic(&own, isotropic, channels)
                                            : kind_make_lobes(&own, isotropic, channels);
        }
    }
    if (gonio_model_of_halves(halves, &model, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    return model;
}

// A model of the maker's form on a small lattice: its file is short enough to be damaged byte by byte. The caller frees
// it.
static inline gonio_model *kind_make(const kind_maker *maker, bool isotropic, int channels) {
    return strcmp(maker->kind, "halves") == 0        ? kind_make_halves(maker, isotropic, channels)
           : maker->formula != NULL                  ? kind_make_analytic(maker, isotropic, channels)
           : maker->order > 0                        ? kind_make_bvb(maker, isotropic, channels)
           : maker->basis != NULL                    ? kind_make_linear(maker, isotropic, channels)
           : strcmp(maker->kind, "transformed") == 0 ? kind_make_transformed(maker, isotropic, channels)
           : maker->method != NULL                   ? kind_make_fitted(maker, isotropic, channels)
                                                     : kind_make_lobes(maker, isotropic, channels);
}

#endif
