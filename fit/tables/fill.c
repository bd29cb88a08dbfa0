// SPDX-License-Identifier: BSD-3-Clause
#include "fit/tables/fill.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/thread_pool.h"
#include "brdf/checksum.h"
#include "fit/memory.h"

// Those that may fill, in the order of gonio_fill_names; none of them is filled itself.
extern const gonio_method gonio_method_auto, gonio_method_lsq, gonio_method_mba, gonio_method_kernel;
static const gonio_method *const fillers[] = {&gonio_method_auto, &gonio_method_lsq, &gonio_method_mba,
                                              &gonio_method_kernel};
#define FILLERS (sizeof fillers / sizeof *fillers)

// ---- the store: fits by what they were fitted to ----

typedef struct stored {
    const char *method;
    uint64_t samples;
    gonio_model *model;
    double seconds; // that the fit took
} stored;

struct gonio_fill_store {
    stored *fits;
    size_t n;
};

gonio_fill_store *gonio_fill_store_new(void) { return calloc(1, sizeof(gonio_fill_store)); }

void gonio_fill_store_free(gonio_fill_store *store) {
    for (size_t k = 0; store != NULL && k < store->n; k++) {
        gonio_model_free(store->fits[k].model);
    }
    free(store != NULL ? store->fits : NULL);
    free(store);
}

static uint64_t checksum_of(const gonio_samples *samples) {
    gonio_checksum sum = gonio_checksum_begin();
    const size_t values = samples->n * (size_t)samples->channels * sizeof *samples->values;
    gonio_checksum_add(&sum, samples->pairs, samples->n * sizeof *samples->pairs);
    gonio_checksum_add(&sum, samples->values, values);
    if (samples->sigma_random != NULL) {
        gonio_checksum_add(&sum, samples->sigma_random, values);
    }
    return gonio_checksum_end(&sum);
}

static const stored *look_up(const gonio_fill_store *store, const char *method, uint64_t samples) {
    for (size_t k = 0; store != NULL && k < store->n; k++) {
        if (store->fits[k].samples == samples && strcmp(store->fits[k].method, method) == 0) {
            return &store->fits[k];
        }
    }
    return NULL;
}

// Does the store have the model from here on? Where it has no memory, it does not.
static bool keep(gonio_fill_store *store, stored fit) {
    stored *fits = store != NULL ? realloc(store->fits, (store->n + 1) * sizeof *fits) : NULL;
    if (fits == NULL) {
        return false;
    }
    store->fits = fits;
    store->fits[store->n++] = fit;
    return true;
}

// ---- the fill ----

static gonio_status fit_with(const gonio_method *method, const gonio_samples *samples, const gonio_fit_options *options,
                             gonio_model **out, gonio_error *error) {
    gonio_fit_options o = *options; // what the tables' methods do not have is at its default
    gonio_fit_report unused = {0};
    o.method = method->name;
    o.level = GONIO_LEVEL_AUTO;
    o.domain = GONIO_DOMAIN_AUTO;
    o.order = GONIO_ORDER_AUTO;
    o.drop_percent = -1;
    if (method == &gonio_method_mba) { // what predicts best of its forms
        o.coordinates = GONIO_HALF_VECTOR;
        o.domain = GONIO_LOG;
    }
    return method->fit(samples, &o, out, &unused, error);
}

gonio_status gonio_fill_init(gonio_fill *fill, const gonio_samples *samples, const gonio_fit_options *options,
                             gonio_error *error) {
    *fill = (gonio_fill){.threads = options->threads};
    const gonio_method *method = fillers[0];
    for (size_t k = 0; k < FILLERS && options->fill != NULL; k++) {
        method = strcmp(options->fill, fillers[k]->name) == 0 ? fillers[k] : method;
    }
    const gonio_dataset_options how = {.mirror = samples->isotropic,
                                       .domain = options->domain != GONIO_DOMAIN_AUTO ? options->domain : GONIO_LOG};
    gonio_status status = gonio_dataset_init(&fill->data, samples, &how, error);
    if (status != GONIO_OK) {
        return status;
    }
    const uint64_t sum = options->fill_store != NULL ? checksum_of(samples) : 0;
    fill->method = method->name;
    const stored *known = look_up(options->fill_store, method->name, sum);
    if (known != NULL) {
        fill->model = known->model;
        fill->seconds = known->seconds;
    } else {
        const double start = gonio_clock_s();
        gonio_model *model = NULL;
        status = fit_with(method, samples, options, &model, error);
        fill->model = model;
        const stored now = {method->name, sum, model, gonio_clock_s() - start};
        fill->own = status == GONIO_OK && !keep(options->fill_store, now) ? model : NULL;
    }
    if (status != GONIO_OK) {
        gonio_dataset_release(&fill->data);
    }
    return status;
}

void gonio_fill_release(gonio_fill *fill) {
    gonio_dataset_release(&fill->data);
    gonio_model_free(fill->own);
    *fill = (gonio_fill){0};
}

#define PART 256 // pairs that a thread takes at a time

typedef struct filling {
    const gonio_fill *fill;
    size_t n;
    void (*place)(const void *context, size_t item, gonio_vec3 *wi, gonio_vec3 *wo);
    const void *context;
    double *values;
} filling;

static void fill_part(void *context, size_t part) {
    const filling *f = context;
    const gonio_dataset *data = &f->fill->data;
    const size_t channels = (size_t)data->channels;
    for (size_t i = part * PART; i < f->n && i < (part + 1) * PART; i++) {
        gonio_vec3 wi, wo;
        double *values = f->values + i * channels;
        f->place(f->context, i, &wi, &wo);
        gonio_model_eval(f->fill->model, wi, wo, values);
        for (size_t c = 0; c < channels; c++) {
            values[c] = gonio_transform_apply(data->kind, &data->transforms[c], values[c]);
        }
    }
}

gonio_status gonio_fill_values(const gonio_fill *fill, size_t n,
                               void (*place)(const void *context, size_t item, gonio_vec3 *wi, gonio_vec3 *wo),
                               const void *context, double *values, gonio_error *error) {
    filling f = {fill, n, place, context, values};
    gonio_pool_for(fill->threads, (n + PART - 1) / PART, fill_part, &f);
    for (size_t k = 0; k < n * (size_t)fill->data.channels; k++) {
        if (!isfinite(values[k])) {
            return gonio_fail(error, GONIO_E_CONVERGENCE, "the fit by '%s' that was to fill the table is not finite",
                              fill->method);
        }
    }
    return GONIO_OK;
}

static void place_node(const void *context, size_t node, gonio_vec3 *wi, gonio_vec3 *wo) {
    gonio_grid_node(context, node, wi, wo);
}

gonio_status gonio_fill_grid(const gonio_fill *fill, const gonio_grid *grid, double **values, gonio_error *error) {
    const size_t count = grid->count * (size_t)fill->data.channels;
    *values = malloc(count * sizeof **values);
    if (*values == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu nodes of %d channels", grid->count,
                          fill->data.channels);
    }
    const gonio_status status = gonio_fill_values(fill, grid->count, place_node, grid, *values, error);
    if (status != GONIO_OK) {
        free(*values);
        *values = NULL;
    }
    return status;
}

gonio_grid gonio_fill_grid_of(const gonio_fit_options *options, bool isotropic, const int level_usual[2]) {
    const gonio_grid_system system =
        options->grid != GONIO_GRID_AUTO ? (gonio_grid_system)options->grid : GONIO_GRID_HALF_ANGLES;
    const int dims = isotropic ? 3 : 4,
              level = options->level != GONIO_LEVEL_AUTO ? options->level : level_usual[dims - 3];
    return gonio_grid_of(system, dims, level);
}

double gonio_fill_memory(const gonio_fit_size *size, double n) {
    gonio_fit_size lattice = *size;
    lattice.level = lattice.level > 5 ? 5 : lattice.level; // of the fit that fills
    return gonio_lattice_fit_memory(&lattice, n);
}

double gonio_fill_grid_memory(const gonio_fit_size *size, double n) {
    const gonio_grid grid = gonio_grid_of(GONIO_GRID_ANGLES, size->dims, size->level);
    return gonio_fill_memory(size, n) + (double)grid.count * size->channels * (sizeof(double) + sizeof(float));
}

void gonio_fill_describe(const gonio_fill *fill, const gonio_grid *grid, gonio_fit_report *report) {
    report->level = grid->level;
    report->fill_seconds = fill->seconds;
    report->coordinates = grid->system == GONIO_GRID_ANGLES ? GONIO_NUSSELT : GONIO_HALF_VECTOR;
    report->domain = fill->data.kind == GONIO_TRANSFORM_LINEAR ? GONIO_LINEAR : GONIO_LOG;
    snprintf(report->options, sizeof report->options, "%s %s fill=%s %zu", gonio_grid_names()[grid->system],
             gonio_domain_name(report->domain), fill->method, grid->size[0]);
    for (int d = 1; d < grid->dims; d++) {
        gonio_fill_add(report, "x%zu", grid->size[d]);
    }
}

void gonio_fill_add(gonio_fit_report *report, const char *format, ...) {
    const size_t used = strlen(report->options);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(report->options + used, sizeof report->options - used, format, arguments);
    va_end(arguments);
}
