// SPDX-License-Identifier: BSD-3-Clause
#include "io/long_rows.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/channel.h"
#include "base/number.h"

static gonio_status note_wavelength(const gonio_text *text, gonio_long_rows *all, double lambda, gonio_error *error) {
    int at = 0;
    while (at < all->n_lambdas && all->lambdas_um[at] < lambda) {
        at++;
    }
    if (at < all->n_lambdas && all->lambdas_um[at] == lambda) {
        return GONIO_OK;
    }
    if (all->n_lambdas == GONIO_CHANNELS_MAX) {
        return gonio_text_fail(text, error, "more than %d wavelengths", GONIO_CHANNELS_MAX);
    }
    memmove(&all->lambdas_um[at + 1], &all->lambdas_um[at], (size_t)(all->n_lambdas - at) * sizeof(double));
    all->lambdas_um[at] = lambda;
    all->n_lambdas++;
    return GONIO_OK;
}

gonio_status gonio_long_rows_add(const gonio_text *text, gonio_long_rows *all, const gonio_long_row *row,
                                 gonio_error *error) {
    if (all->n == all->capacity) {
        const size_t larger = all->capacity * 2 + 256;
        gonio_long_row *rows = realloc(all->rows, larger * sizeof *rows);
        if (rows == NULL) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu rows", larger);
        }
        all->rows = rows;
        all->capacity = larger;
    }
    all->rows[all->n++] = *row;
    return note_wavelength(text, all, row->lambda_um, error);
}

gonio_status gonio_long_rows_choose(const gonio_text *text, gonio_long_rows *all, double lambda_um, char *notes,
                                    size_t size, gonio_error *error) {
    const int chosen = gonio_wavelength_nearest(all->lambdas_um, all->n_lambdas, lambda_um);
    if (chosen < 0) {
        char list[200] = "";
        for (int k = 0; k < all->n_lambdas; k++) {
            gonio_text_append(list, sizeof list, "%s%g", k > 0 ? ", " : "", all->lambdas_um[k]);
        }
        return gonio_fail_line(error, GONIO_E_INPUT, text->path, -1, "no wavelength %g um; it holds %s", lambda_um,
                               list);
    }
    const double nearest = all->lambdas_um[chosen];
    if (fabs(nearest - lambda_um) > 1e-6 * lambda_um) {
        gonio_text_append(notes, size, "no wavelength of %g nm: %g nm, the nearest, is taken\n", 1000 * lambda_um,
                          1000 * nearest);
    }
    size_t kept = 0;
    for (size_t i = 0; i < all->n; i++) {
        if (all->rows[i].lambda_um == nearest) {
            all->rows[kept++] = all->rows[i];
        }
    }
    all->n = kept;
    all->lambdas_um[0] = nearest;
    all->n_lambdas = 1;
    return GONIO_OK;
}

gonio_status gonio_long_rows_wavelength(const gonio_text *text, const char *field, double to_um, double *um,
                                        gonio_error *error) {
    double number = 0;
    const gonio_status status = gonio_text_number(text, field, "wavelength", &number, error);
    *um = number * (to_um > 0 ? to_um : number < 20 ? 1 : 1e-3);
    return status == GONIO_OK && !(*um >= 0.02 && *um <= 100)
               ? gonio_text_fail(text, error, "wavelength: expected 20 nm to 100 um, found %s", field)
               : status;
}

static int by_geometry(const void *left, const void *right) {
    const gonio_long_row *a = left, *b = right;
    const int geometry = memcmp(&a->pair, &b->pair, sizeof a->pair);
    if (geometry != 0) {
        return geometry;
    }
    const int wavelength = (a->lambda_um > b->lambda_um) - (a->lambda_um < b->lambda_um);
    return wavelength != 0 ? wavelength : (a->line > b->line) - (a->line < b->line);
}

static int by_line(const void *left, const void *right) {
    const gonio_long_row *const *a = left, *const *b = right;
    return ((*a)->line > (*b)->line) - ((*a)->line < (*b)->line);
}

// Every geometry must come with each wavelength once; groups[g] then points to its run of n_lambdas rows.
static gonio_status group(const gonio_text *text, gonio_long_rows *all, gonio_long_row **groups, size_t *n,
                          gonio_error *error) {
    const size_t wide = (size_t)all->n_lambdas;
    qsort(all->rows, all->n, sizeof *all->rows, by_geometry);
    *n = 0;
    for (size_t i = 0; i < all->n; i += wide) {
        for (size_t k = 0; k < wide; k++) {
            const gonio_long_row *row = &all->rows[i + k < all->n ? i + k : i];
            if (i + k >= all->n || row->lambda_um != all->lambdas_um[k] ||
                memcmp(&row->pair, &all->rows[i].pair, sizeof row->pair) != 0) {
                return gonio_fail_line(error, GONIO_E_INPUT, text->path, all->rows[i].line,
                                       "this geometry does not come once with each of the %d wavelengths; choose one "
                                       "with --wavelength",
                                       all->n_lambdas);
            }
        }
        groups[(*n)++] = &all->rows[i];
    }
    qsort(groups, *n, sizeof *groups, by_line);
    return GONIO_OK;
}

static gonio_status add_groups(gonio_text *text, const gonio_long_rows *all, bool with_sigma, gonio_long_row **groups,
                               size_t n, gonio_row_collector *collector, gonio_error *error) {
    gonio_status status = gonio_row_collector_room(collector, all->n_lambdas, with_sigma, error);
    for (int k = 0; k < all->n_lambdas && status == GONIO_OK; k++) {
        gonio_number_format(collector->samples->channel_names[k], GONIO_CHANNEL_NAME_MAX, "%.10gnm",
                            1000 * all->lambdas_um[k]);
    }
    for (size_t g = 0; g < n && status == GONIO_OK; g++) {
        double values[GONIO_CHANNELS_MAX], sigmas[GONIO_CHANNELS_MAX], none[GONIO_CHANNELS_MAX];
        for (int k = 0; k < all->n_lambdas; k++) {
            values[k] = groups[g][k].value;
            sigmas[k] = groups[g][k].sigma;
            none[k] = 0;
        }
        text->line = groups[g]->line;
        status = gonio_row_collector_add(collector, &groups[g]->pair, values, with_sigma ? sigmas : NULL,
                                         with_sigma ? none : NULL, error);
    }
    return status;
}

gonio_status gonio_long_rows_collect(gonio_text *text, gonio_long_rows *all, bool with_sigma,
                                     gonio_row_collector *collector, gonio_error *error) {
    if (all->n == 0) {
        return gonio_text_fail(text, error, "no rows after the header");
    }
    gonio_long_row **groups = malloc(all->n * sizeof *groups);
    if (groups == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu rows", all->n);
    }
    size_t n;
    gonio_status status = group(text, all, groups, &n, error);
    status = status == GONIO_OK ? add_groups(text, all, with_sigma, groups, n, collector, error) : status;
    free(groups);
    return status;
}
