// SPDX-License-Identifier: BSD-3-Clause
// Few samples and a library -> a model: the posterior at the nodes of the library's grid, as a cubic table with sigma.
#include <math.h>
#include <stdlib.h>

#include "base/thread_pool.h"
#include "brdf/kind/table.h"
#include "fit/library/library.h"
#include "fit/tables/grid_method.h"

#define CHUNK ((size_t)256) // nodes
#define EPS 1e-6            // of the table's logarithm, 1/sr

typedef struct filling {
    const library_posterior *posterior;
    double inflation;
    double *values; // [nodes][channels], ln(f + EPS)
    float *spread;  // the same, sigma of it
} filling;

static gonio_status fill_chunk(void *context, size_t chunk, gonio_error *error) {
    const filling *f = context;
    const library_posterior *p = f->posterior;
    const gonio_grid *grid = &p->learnt->grid;
    const size_t channels = (size_t)p->channels, rank = (size_t)p->learnt->rank;
    double *work = malloc((p->n + rank + channels) * sizeof *work);
    if (work == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the prior's fit");
    }
    double *components = work + p->n, *z = components + rank, variance;
    for (size_t node = chunk * CHUNK; node < (chunk + 1) * CHUNK && node < grid->count; node++) {
        library_place place;
        bool real;
        const gonio_pair pair = gonio_library_node(grid, node, &real);
        gonio_library_place(p->learnt, &pair, components, &place);
        gonio_library_predict(p, &place, z, &variance, work);
        const double sigma = f->inflation * sqrt(variance);
        for (size_t c = 0; c < channels; c++) {
            const double value = gonio_library_unmap(&place, z[c]);
            f->values[node * channels + c] = log(value + EPS);
            f->spread[node * channels + c] = (float)(sigma / gonio_library_slope(&place, value) / (value + EPS));
        }
    }
    free(work);
    return GONIO_OK;
}

static gonio_status make_table(const gonio_library *library, const gonio_samples *samples, double *values,
                               float **spread, gonio_model **out, gonio_error *error) {
    const size_t count = library->grid.count * (size_t)samples->channels;
    gonio_status status = gonio_grid_interpolate(&library->grid, samples->channels, values, error);
    float *points = malloc(count * sizeof *points);
    gonio_transform *transforms = malloc((size_t)samples->channels * sizeof *transforms);
    if (status == GONIO_OK && (points == NULL || transforms == NULL)) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for a table of %zu values", count);
    }
    for (size_t k = 0; status == GONIO_OK && k < count; k++) {
        points[k] = (float)values[k];
    }
    for (int c = 0; status == GONIO_OK && c < samples->channels; c++) {
        transforms[c] = (gonio_transform){1, EPS};
    }
    const gonio_table_parts parts = {.grid = library->grid,
                                     .degree = GONIO_GRID_CUBIC,
                                     .channels = samples->channels,
                                     .kind = GONIO_TRANSFORM_LOG,
                                     .transforms = transforms,
                                     .names = (const char(*)[32])samples->channel_names,
                                     .points = points,
                                     .spread = *spread};
    status = status == GONIO_OK ? gonio_table_new(&parts, out, error) : status;
    free(transforms);
    if (status == GONIO_OK) {
        *spread = NULL; // the model's
    } else {
        free(points);
    }
    return status;
}

static gonio_status check(const gonio_samples *samples, gonio_error *error) {
    if (samples->n < 1 || samples->n > GONIO_LIBRARY_SAMPLES_MAX) {
        return gonio_fail(error, GONIO_E_USAGE, "a fit with a prior takes 1 to %d samples, there are %zu: %s",
                          GONIO_LIBRARY_SAMPLES_MAX, samples->n,
                          samples->n > 0 ? "so many tell the material without one" : "measure some");
    }
    if (samples->transmission || !samples->isotropic) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED, "a prior is of isotropic reflection; these samples are %s",
                          samples->transmission ? "of transmission too" : "anisotropic");
    }
    return gonio_samples_check(samples, error);
}

static gonio_status judge(const library_posterior *p, const gonio_library_facts *facts, gonio_library_report *report,
                          gonio_error *error) {
    *report = (gonio_library_report){p->n, p->residual, facts->limit, p->loo_rel};
    // Of fewer residuals than in the trial, the mean square scatters more.
    const double limit = facts->limit * sqrt(fmax(20.0 / (double)p->n, 1));
    return p->residual <= limit
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_MISMATCH,
                            "the sample is not like the library: left out, samples lie %.3g sigmas (rms) from what the "
                            "prior and the others tell of them, %.3g at most of the library's own materials; fit it "
                            "without the prior",
                            sqrt(p->residual), sqrt(limit));
}

gonio_status gonio_library_fit(const gonio_library *library, const gonio_samples *samples, int threads,
                               gonio_model **out, gonio_library_report *report, gonio_error *error) {
    const size_t count = library->grid.count;
    gonio_library_report own;
    library_posterior p;
    *out = NULL;
    gonio_status status = check(samples, error);
    status = status == GONIO_OK ? gonio_library_condition(library, samples, &p, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    const size_t channels = (size_t)samples->channels;
    // Where left-out samples lie further off than the process expects, it varies more than the library's materials do.
    filling f = {&p, library->facts.inflation * sqrt(fmax(p.residual, 1)), malloc(count * channels * sizeof(double)),
                 malloc(count * channels * sizeof(float))};
    status = judge(&p, &library->facts, report != NULL ? report : &own, error);
    if (status == GONIO_OK && (f.values == NULL || f.spread == NULL)) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for a table of %zu values", count * channels);
    }
    status = status == GONIO_OK ? gonio_pool_try(threads, (count + CHUNK - 1) / CHUNK, fill_chunk, &f, error) : status;
    status = status == GONIO_OK ? make_table(library, samples, f.values, &f.spread, out, error) : status;
    free(f.values);
    free(f.spread);
    gonio_library_posterior_release(&p);
    return status;
}
