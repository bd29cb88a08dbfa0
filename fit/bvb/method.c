// SPDX-License-Identifier: BSD-3-Clause
// Method "bvb": the tabular form, and a B-spline volume of it (Park and Lee 2015; brdf/kind/bvb.c, fit/bvb/loft.c).
//
// Samples on the nodes of a grid are the table. Scattered ones are fitted first (fit/tables/fill.h), and the table is
// of that fit.
#include "fit/bvb/bvb.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/keys.h"
#include "fit/bvb/table.h"
#include "fit/method.h"
#include "fit/names.h"
#include "fit/prepare/dataset.h"
#include "fit/prepare/scatter.h"
#include "fit/tables/fill.h"

extern const gonio_method gonio_method_auto; // the default method, which fills

// Chosen on the 100 materials of Bagher et al. 2012 (docs/fitting.md): a peak above SHARP times the mean value takes
// the lowest order, as the paper advises where f_r exceeds 50, which the mean value of 0.1 that it reports makes 500.
static const struct {
    double sharp, rate, sharp_rate, log_rate;
    int intervals[2]; // of the table over 90 deg: anisotropic, isotropic
} tuning = {500, 0.02, 0.005, 0.002, {18, 90}};

// ---- a table ----

static void take_range(gonio_bvb_table *t, bool from_zero, double *range, double *shift) {
    const size_t nodes = gonio_bvb_nodes(t), c = (size_t)t->channels;
    for (size_t k = 0; k < c; k++) {
        range[2 * k] = INFINITY;
        range[2 * k + 1] = -INFINITY;
        for (size_t i = 0; i < nodes; i++) {
            range[2 * k] = fmin(range[2 * k], (double)t->values[i * c + k]);
            range[2 * k + 1] = fmax(range[2 * k + 1], (double)t->values[i * c + k]);
        }
        shift[k] = from_zero ? range[2 * k] : 0;
    }
    for (size_t i = 0; i < nodes * c && from_zero; i++) {
        t->values[i] -= (float)shift[i % c];
    }
}

static gonio_loft loft_of(const gonio_fit_options *o, const gonio_bvb_table *t, const gonio_bvb_lengths *lengths,
                          bool linear, double unit) {
    const bool sharp = lengths->largest > tuning.sharp * lengths->mean;
    const double rate = !linear ? tuning.log_rate : sharp ? tuning.sharp_rate : tuning.rate;
    const int knots = o->knots != NULL ? gonio_names_find(gonio_knots_names(), o->knots) : GONIO_KNOTS_ADAPTIVE;
    gonio_loft loft = {.order = o->order != GONIO_ORDER_AUTO ? o->order
                                : sharp                      ? 2
                                                             : 4,
                       .knots = (gonio_knots)knots, // the driver has checked the name
                       .tolerance = (o->rate > 0 ? o->rate : rate) * lengths->largest,
                       .unit = unit,
                       .threads = o->threads};
    for (int d = 0; d < t->dims; d++) {
        // Both azimuths of an anisotropic table take the same number.
        loft.count[d] = (size_t)o->points[d < 3 ? d : 2];
    }
    return loft;
}

static gonio_status make_model(gonio_bvb_parts *parts, gonio_transform_kind kind, const gonio_transform *transforms,
                               const double *range, const double *shift, const char (*names)[32], gonio_model **out,
                               gonio_error *error) {
    const size_t c = (size_t)parts->channels;
    for (size_t i = 0; i < gonio_bvb_points(parts) * c; i++) {
        parts->points[i] += (float)shift[i % c];
    }
    const gonio_status status = gonio_bvb_model_new(parts, kind, transforms, range, names, out, error);
    gonio_bvb_parts_release(parts);
    return status;
}

gonio_status gonio_bvb_fit_table(gonio_bvb_table *table, gonio_transform_kind kind, const gonio_transform *transforms,
                                 const char (*names)[32], const gonio_fit_options *options, gonio_model **out,
                                 gonio_bvb_report *report, gonio_error *error) {
    const size_t c = (size_t)table->channels;
    double range[2 * c], shift[c], held[2 * c];
    const bool linear = kind == GONIO_TRANSFORM_LINEAR;
    take_range(table, !linear, range, shift);
    for (size_t k = 0; k < 2 * c; k++) {
        held[k] = range[k] - shift[k / 2];
    }
    report->table = gonio_bvb_table_lengths(table);
    const gonio_loft loft = loft_of(options, table, &report->table, linear, linear ? transforms->scale : 1);
    for (int d = 0; d < table->dims; d++) {
        if (loft.count[d] > 0 && (loft.count[d] < (size_t)loft.order || loft.count[d] > table->size[d])) {
            return gonio_fail(error, GONIO_E_USAGE,
                              "--points asks for %zu along an axis; order %d and a table of %zu points there allow %d "
                              "to %zu",
                              loft.count[d], loft.order, table->size[d], loft.order, table->size[d]);
        }
    }
    gonio_bvb_parts parts;
    gonio_status status = gonio_bvb_loft(table, &loft, &parts, error);
    if (status != GONIO_OK) {
        return status;
    }
    report->order = loft.order;
    memcpy(report->count, parts.count, sizeof report->count);
    status = gonio_bvb_errors(table, &parts, held, options->threads, &report->error, error);
    if (status != GONIO_OK) {
        gonio_bvb_parts_release(&parts);
        return status;
    }
    return make_model(&parts, kind, transforms, range, shift, names, out, error);
}

// ---- samples ----

// The transforms of the samples' channels; in the linear domain all have one scale, so that a vector of channels has a
// length.
static gonio_status take_transforms(const gonio_samples *samples, gonio_domain domain, gonio_transform_kind *kind,
                                    gonio_transform *transforms, gonio_error *error) {
    const size_t c = (size_t)samples->channels;
    gonio_status status = gonio_samples_check(samples, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (domain == GONIO_LINEAR) {
        const double scale = gonio_scatter_scale(samples->n * c, samples->values, 1);
        for (size_t k = 0; k < c; k++) {
            transforms[k] = (gonio_transform){.scale = scale};
        }
        *kind = GONIO_TRANSFORM_LINEAR;
        return GONIO_OK;
    }
    gonio_dataset data;
    status = gonio_dataset_init(&data, samples,
                                &(gonio_dataset_options){.mirror = samples->isotropic, .domain = domain}, error);
    if (status == GONIO_OK) {
        memcpy(transforms, data.transforms, c * sizeof *transforms);
        *kind = data.kind;
        gonio_dataset_release(&data);
    }
    return status;
}

// The steps over 90 deg that grids have, a whole number of degrees or of halves; the given one alone.
static bool grid_of_samples(const gonio_samples *samples, double step, gonio_transform_kind kind,
                            const gonio_transform *transforms, gonio_bvb_table *table) {
    static const int grids[] = {180, 90, 60, 45, 36, 30, 18, 15, 12, 10, 9, 6, 5, 4, 3};
    for (size_t k = 0; k < sizeof grids / sizeof *grids; k++) {
        const double theta = grids[k] + 1, phi = 4.0 * grids[k] + 1;
        // Mirror images, poles and held thetas make at most some four nodes of a sample.
        const bool enough = 4 * (double)samples->n >= theta * theta * phi * (samples->isotropic ? 1 : phi);
        const bool asked = step == 0 || lround(90 / step) == grids[k];
        if (asked && enough &&
            gonio_bvb_table_init(table, samples->isotropic, samples->channels, grids[k], NULL) == GONIO_OK) {
            if (gonio_bvb_table_of_samples(table, samples, kind, transforms)) {
                return true;
            }
            gonio_bvb_table_release(table);
        }
    }
    return false;
}

static gonio_status table_of_fit(const gonio_samples *samples, const gonio_fit_options *o, gonio_transform_kind kind,
                                 const gonio_transform *transforms, gonio_bvb_table *table, gonio_fit_report *report,
                                 gonio_error *error) {
    gonio_fill fill;
    gonio_status status = gonio_fill_init(&fill, samples, o, error);
    if (status != GONIO_OK) {
        return status;
    }
    const int intervals =
        o->table_step > 0 ? (int)fmax(round(90 / o->table_step), 3) : tuning.intervals[samples->isotropic];
    status = gonio_bvb_table_init(table, samples->isotropic, samples->channels, intervals, error);
    if (status == GONIO_OK) {
        gonio_bvb_table_of_model(table, fill.model, kind, transforms, o->threads);
        report->fill_seconds = fill.seconds;
        snprintf(report->note, sizeof report->note, "the table is of a fit by method %s", fill.method);
    }
    gonio_fill_release(&fill);
    return status;
}

static void describe(const gonio_bvb_table *t, const gonio_bvb_report *r, const char *knots, gonio_fit_report *report) {
    char counts[2][48] = {"", ""};
    for (int d = 0; d < t->dims; d++) {
        for (int k = 0; k < 2; k++) {
            const size_t used = strlen(counts[k]);
            snprintf(counts[k] + used, sizeof counts[k] - used, "%s%zu", d > 0 ? "x" : "",
                     k == 0 ? r->count[d] : t->size[d]);
        }
    }
    const double largest = r->table.largest > 0 ? r->table.largest : 1;
    snprintf(report->options, sizeof report->options, "order=%d knots=%.24s points=%s table=%s error=%.3g mean=%.3g",
             r->order, knots, counts[0], counts[1], r->error.largest / largest, r->error.mean / largest);
}

static gonio_status check_options(const gonio_fit_options *o, gonio_error *error) {
    if (o->order != GONIO_ORDER_AUTO && (o->order < GONIO_BVB_ORDER_MIN || o->order > GONIO_BVB_ORDER_MAX)) {
        return gonio_fail(error, GONIO_E_USAGE, "--order %d; method 'bvb' has %d to %d", o->order, GONIO_BVB_ORDER_MIN,
                          GONIO_BVB_ORDER_MAX);
    }
    for (int d = 0; d < 3; d++) {
        if (o->points[d] != floor(o->points[d])) {
            return gonio_fail(error, GONIO_E_USAGE, "--points %g; a number of control points is whole", o->points[d]);
        }
    }
    return GONIO_OK;
}

static gonio_status fit(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                        gonio_fit_report *report, gonio_error *error) {
    *out = NULL;
    gonio_transform transforms[samples->channels];
    gonio_transform_kind kind;
    gonio_bvb_table table = {0};
    const gonio_domain domain = options->domain != GONIO_DOMAIN_AUTO ? options->domain : GONIO_LINEAR;
    gonio_status status = check_options(options, error);
    status = status == GONIO_OK ? take_transforms(samples, domain, &kind, transforms, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    if (grid_of_samples(samples, options->table_step, kind, transforms, &table)) {
        snprintf(report->note, sizeof report->note, "the samples are a grid: they are the table");
    } else {
        status = table_of_fit(samples, options, kind, transforms, &table, report, error);
    }
    gonio_bvb_report told = {0};
    if (status == GONIO_OK) {
        status = gonio_bvb_fit_table(&table, kind, transforms, (const char(*)[32])samples->channel_names, options, out,
                                     &told, error);
    }
    if (status == GONIO_OK) {
        describe(&table, &told, options->knots != NULL ? options->knots : gonio_knots_names()[0], report);
    }
    report->coordinates = GONIO_NUSSELT;
    report->domain = domain;
    gonio_bvb_table_release(&table);
    return status;
}

// The table, its heights, and what a pass makes of it; and what the fit before it takes.
static double memory(const gonio_fit_size *size, double n) {
    const double theta = 1 + tuning.intervals[size->dims == 3], phi = 4 * (theta - 1) + 1;
    const double nodes = theta * theta * phi * (size->dims == 3 ? 1 : phi);
    return gonio_method_auto.memory(size, n) + nodes * (8.0 * size->channels + 4);
}

static const gonio_method_option options_of_bvb[] = {
    GONIO_METHOD_OPTION(domain, "linear"), GONIO_METHOD_OPTION(order, "2 to 4 (4; 2 of sharp peaks)"),
    GONIO_METHOD_OPTION(points, NULL),     GONIO_METHOD_OPTION(rate, NULL),
    GONIO_METHOD_OPTION(knots, NULL),      GONIO_METHOD_OPTION(table_step, NULL),
    GONIO_METHOD_OPTION(fill, NULL),       {0}};

static const gonio_method_form forms[] = {
    {GONIO_LEVEL_AUTO, GONIO_LEVEL_AUTO, GONIO_COORDINATES_AUTO, GONIO_LINEAR, NULL},
    {GONIO_LEVEL_AUTO, GONIO_LEVEL_AUTO, GONIO_COORDINATES_AUTO, GONIO_LOG, NULL}};

const gonio_method gonio_method_bvb = {
    .name = "bvb",
    .summary = "a B-spline volume of a table, with knots where it needs them (Park and Lee 2015)",
    .kind = "bvb",
    .options = options_of_bvb,
    .fit = fit,
    .memory = memory,
    .forms = forms,
    .forms_n = sizeof forms / sizeof *forms,
};
