// SPDX-License-Identifier: BSD-3-Clause
#include "fit/options.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/nearest.h"
#include "fit/names.h"

// ---- the table ----

#define ROW(member, kind) GONIO_KEY(gonio_fit_options, member, kind)

const gonio_key gonio_fit_keys[] = {
    {ROW(method, NAME), .names = gonio_fit_methods, .was = "fit_method", .argument = "NAME",
     .help = "how to fit (auto)"},
    {ROW(hold_out, REAL), .low = 0, .high = 1, .argument = "FRACTION",
     .help = "of the geometries, to measure the error on (0.2); 0: none"},
    {ROW(folds, INTEGER), .low = 0, .high = 1e6, .late = true, .argument = "K",
     .help = "K-fold errors instead of one hold-out"},
    {ROW(seed, SEED), .argument = "N", .help = "seed of everything random (1)"},
    {ROW(max_memory, SIZE), .late = true, .argument = "BYTES", .help = "memory that fitting may take (what is free)"},
    {ROW(prior, TEXT), .late = true, .argument = "PRIOR",
     .help = "what `gonio learn` made of a library: few samples are fitted by it"},
    {ROW(level, INTEGER), .automatic = -1, .low = 0, .high = GONIO_LEVEL_MAX, .argument = "N|auto",
     .help = "lattice level (auto: by held-out error)"},
    {ROW(tolerance, REAL), .low = 0, .high = INFINITY, .argument = "RMSE", .help = "the smallest level that meets it"},
    {ROW(coordinates, CHOICE), .names = gonio_coordinates_names, .automatic = -1, .late = true, .argument = "NAME"},
    {ROW(domain, CHOICE), .names = gonio_domain_names, .automatic = -1, .late = true, .argument = "NAME"},
    {ROW(symmetry, FLAGS), .names = gonio_symmetry_names, .automatic = -1, .late = true, .argument = "LIST"},
    {ROW(thesis, BOOLEAN), .late = true, .help = "exactly Kameya's form: Nusselt, linear, no offset"},
    {ROW(diffuse_level, INTEGER), .automatic = -1, .low = 0, .high = GONIO_LEVEL_MAX, .late = true, .argument = "D",
     .help = "level of the diffuse lattice"},
    {ROW(specular_start, INTEGER), .automatic = -1, .low = 0, .high = GONIO_LEVEL_MAX, .late = true, .argument = "N",
     .help = "level at which the second fit begins"},
    {ROW(drop_percent, REAL), .automatic = -1, .low = 0, .high = 100, .late = true, .option = "drop", .argument = "C",
     .help = "per cent of the control points to drop"},
    {ROW(storage, NAME), .names = gonio_storage_names, .late = true, .argument = "NAME",
     .help = "bricks of such numbers, or the thesis' hash"},
    {ROW(lambda, REAL), .automatic = -1, .late = true, .argument = "X",
     .help = "smoothness (below 0: from the training data)"},
    {ROW(iterations, INTEGER), .low = 0, .high = 1e9, .late = true, .argument = "N", .help = "at most N iterations"},
    {ROW(max_error, REAL), .low = 0, .high = INFINITY, .late = true, .argument = "X",
     .help = "the largest held-out error"},
    {ROW(max_bytes, SIZE), .late = true, .argument = "BYTES", .help = "the largest model"},
    {ROW(max_ns, REAL), .low = 0, .high = INFINITY, .late = true, .argument = "X", .help = "the slowest evaluation"},
    {ROW(max_seconds, REAL), .low = 0, .high = INFINITY, .late = true, .argument = "X", .help = "the longest fit"},
    {ROW(loss, CHOICE), .names = gonio_loss_names, .automatic = -1, .late = true, .argument = "NAME",
     .help = "what the residuals of formulae measure"},
    {ROW(lobes, INTEGER), .automatic = -1, .low = 1, .high = 5, .late = true, .argument = "N",
     .help = "lobes of a formula"},
    {ROW(shapes, CHOICE), .names = gonio_shapes_names, .automatic = -1, .late = true, .argument = "NAME",
     .help = "widths for all channels, or each channel's own"},
    {ROW(order, INTEGER), .automatic = -1, .low = 0, .high = GONIO_ORDER_MAX, .late = true, .argument = "N",
     .help = "of a linear basis, or of B-splines"},
    {ROW(points, REALS), .low = 0, .high = 1024, .late = true, .argument = "N/N/N",
     .help = "control points along theta_i, theta_o and the azimuth (0: as few as the rate allows)"},
    {ROW(rate, REAL), .low = 0, .high = 1, .late = true, .argument = "X",
     .help = "largest error at the table's points, over the largest value (0.02; of sharp peaks 0.005, in the log "
             "domain 0.002)"},
    {ROW(knots, NAME), .names = gonio_knots_names, .late = true, .argument = "NAME",
     .help = "where knots stand (adaptive)"},
    {ROW(table_step, REAL), .low = 0, .high = 30, .late = true, .argument = "DEG",
     .help = "step of the table (that of the samples' grid, else 1; 5 of anisotropic samples)"},
    {ROW(grid, CHOICE), .names = gonio_grid_names, .automatic = -1, .late = true, .argument = "NAME",
     .help = "what a table's axes are (half-angles)"},
    {ROW(fill, NAME), .names = gonio_fill_names, .late = true, .argument = "NAME",
     .help = "the method that a table is filled by (auto)"},
    {ROW(wavelet, CHOICE), .names = gonio_wavelet_names, .automatic = -1, .late = true, .argument = "NAME",
     .help = "(cdf53)"},
    {ROW(neighbours, INTEGER), .automatic = -1, .low = 1, .high = GONIO_NEAREST_MAX, .late = true, .argument = "N",
     .help = "how many samples are averaged"},
    {ROW(distance, CHOICE), .names = gonio_distance_names, .automatic = -1, .late = true, .argument = "NAME",
     .help = "what tells which samples are near"},
    {0}};
_Static_assert(sizeof gonio_fit_keys / sizeof *gonio_fit_keys == GONIO_FIT_KEYS + 1, "the number of the options");

void gonio_fit_options_default(gonio_fit_options *options) {
    *options = (gonio_fit_options){.level = GONIO_LEVEL_AUTO,
                                   .coordinates = GONIO_COORDINATES_AUTO,
                                   .domain = GONIO_DOMAIN_AUTO,
                                   .hold_out = 0.2,
                                   .seed = 1,
                                   .diffuse_level = -1,
                                   .specular_start = -1,
                                   .drop_percent = -1,
                                   .lambda = -1,
                                   .loss = GONIO_LOSS_AUTO,
                                   .lobes = GONIO_LOBES_AUTO,
                                   .shapes = GONIO_SHAPES_AUTO,
                                   .order = GONIO_ORDER_AUTO,
                                   .grid = GONIO_GRID_AUTO,
                                   .wavelet = GONIO_WAVELET_AUTO,
                                   .neighbours = GONIO_NEIGHBOURS_AUTO,
                                   .distance = GONIO_DISTANCE_AUTO,
                                   .symmetry = GONIO_SYMMETRY_AUTO};
}

// ---- which method has which ----

static const gonio_method_option *option_of(const gonio_method *method, const gonio_key *key) {
    const gonio_method_option *o = method->options;
    while (o->offset != 0 && o->offset != key->offset) {
        o++;
    }
    return o->offset != 0 ? o : NULL;
}

const gonio_method *gonio_fit_method_of(const gonio_fit_options *options) {
    const char *name = options->thesis && options->method == NULL ? "mba" : options->method;
    return gonio_method_find(&name);
}

bool gonio_method_has(const gonio_method *method, const gonio_key *key) {
    return key - gonio_fit_keys < GONIO_FIT_KEYS_COMMON || option_of(method, key) != NULL;
}

bool gonio_method_has_member(const char *name, size_t offset) {
    const gonio_method *method = gonio_method_find(&name);
    const gonio_key *key = gonio_fit_keys;
    while (key->name != NULL && key->offset != offset) {
        key++;
    }
    return method != NULL && key->name != NULL && gonio_method_has(method, key);
}

gonio_status gonio_method_refuse(const gonio_method *method, const gonio_key *key, gonio_error *error) {
    char option[64], list[600] = "";
    for (const gonio_key *k = gonio_fit_keys; k->name != NULL; k++) {
        const size_t used = strlen(list);
        gonio_key_option(k, option, sizeof option);
        if (gonio_method_has(method, k)) {
            snprintf(list + used, sizeof list - used, " --%s", option);
        }
    }
    gonio_key_option(key, option, sizeof option);
    return gonio_fail(error, GONIO_E_USAGE, "method '%s' has no --%s; it has%s", method->name, option, list);
}

gonio_status gonio_fit_options_check(const gonio_fit_options *options, const gonio_method *method, gonio_error *error) {
    gonio_fit_options usual;
    gonio_fit_options_default(&usual);
    gonio_status status = GONIO_OK;
    for (const gonio_key *k = gonio_fit_keys; k->name != NULL && status == GONIO_OK; k++) {
        if (!gonio_method_has(method, k) && !gonio_key_equal(k, options, &usual)) {
            return gonio_method_refuse(method, k, error);
        }
        status = gonio_key_check(k, options, error);
    }
    if (status == GONIO_OK && (options->hold_out == 1 || options->folds == 1)) {
        status = gonio_fail(error, GONIO_E_USAGE, "hold-out %g, %d folds; 0 <= hold-out < 1 and folds 0 or >= 2",
                            options->hold_out, options->folds);
    }
    const bool other_coordinates =
        options->coordinates != GONIO_COORDINATES_AUTO && options->coordinates != GONIO_NUSSELT;
    const bool other_domain = options->domain != GONIO_DOMAIN_AUTO && options->domain != GONIO_LINEAR;
    if (status == GONIO_OK && options->thesis && (other_coordinates || other_domain)) {
        status = gonio_fail(error, GONIO_E_USAGE, "the thesis' form is in Nusselt coordinates and the linear domain");
    }
    return status;
}

void gonio_fit_options_for(gonio_fit_options *options, const char *name) {
    const gonio_method *method = gonio_method_find(&name);
    gonio_fit_options usual;
    gonio_fit_options_default(&usual);
    options->method = name;
    for (const gonio_key *k = gonio_fit_keys; k->name != NULL; k++) {
        if (!gonio_method_has(method, k)) {
            gonio_key_copy(k, options, &usual);
        }
    }
}

// ---- help ----

static void append(char *text, size_t size, const char *before, const char *more) {
    const size_t used = strlen(text);
    snprintf(text + used, size - used, "%s%s", before, more);
}

// Has every method of this kind the option, with this note? Kinds of three methods and more are named as one.
static bool whole_kind(const char *kind, const gonio_key *key, const char *note) {
    int n = 0;
    for (int i = 0; gonio_method_at(i) != NULL; i++) {
        const gonio_method *method = gonio_method_at(i);
        if (strcmp(method->kind, kind) == 0) {
            const gonio_method_option *o = option_of(method, key);
            n++;
            if (o == NULL || strcmp(o->note != NULL ? o->note : "", note) != 0) {
                return false;
            }
        }
    }
    return n > 2;
}

// The methods that have the option with this note: "mba, lsq", "analytic methods: log".
static void append_methods(char *text, size_t size, const gonio_key *key, const char *note, const char *before) {
    const char *named = "";
    for (int i = 0; gonio_method_at(i) != NULL; i++) {
        const gonio_method *method = gonio_method_at(i);
        const gonio_method_option *o = option_of(method, key);
        if (o == NULL || strcmp(o->note != NULL ? o->note : "", note) != 0 || strcmp(method->kind, named) == 0) {
            continue;
        }
        const bool whole = whole_kind(method->kind, key, note);
        named = whole ? method->kind : named;
        append(text, size, before, whole ? method->kind : method->name);
        append(text, size, whole ? " methods" : "", "");
        before = ", ";
    }
    append(text, size, note[0] != 0 ? ": " : "", note);
}

static bool noted_before(const gonio_key *key, int method, const char *note) {
    for (int i = 0; i < method; i++) {
        const gonio_method_option *o = option_of(gonio_method_at(i), key);
        if (o != NULL && strcmp(o->note != NULL ? o->note : "", note) == 0) {
            return true;
        }
    }
    return false;
}

void gonio_fit_option_help(const gonio_key *key, char *text, size_t size) {
    text[0] = 0;
    if (key->names != NULL) {
        gonio_key_expected(key, text, size);
    }
    if (key->help != NULL) {
        append(text, size, text[0] != 0 ? ": " : "", key->help);
    }
    const char *before = " [";
    for (int i = 0; key - gonio_fit_keys >= GONIO_FIT_KEYS_COMMON && gonio_method_at(i) != NULL; i++) {
        const gonio_method_option *o = option_of(gonio_method_at(i), key);
        const char *note = o != NULL && o->note != NULL ? o->note : "";
        if (o != NULL && !noted_before(key, i, note)) {
            append_methods(text, size, key, note, before);
            before = "; ";
        }
    }
    append(text, size, before[0] == ';' ? "]" : "", "");
}
