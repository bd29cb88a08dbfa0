// SPDX-License-Identifier: BSD-3-Clause
// NIST's Mueller-matrix BRDF of sintered PTFE (Germer 2017; docs/formats.md): a row is one geometry at one wavelength,
// lambda (um), thetai, phii, thetar, phir (deg), f_r11 (1/sr), then the 15 other elements divided by f_r11.
//
// thetai is signed: a negative one lies on the side of phii + 180 deg, so that light at -60 deg is mirrored to phir =
// 0. Without a chosen wavelength every wavelength becomes a channel, which takes the same geometries at each.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "io/format.h"

#define COLUMNS 21
enum { NEGATIVES, MUELLER }; // options

typedef struct nist_row {
    gonio_pair pair;
    double lambda_um, value;
    long long line;
} nist_row;

typedef struct nist_rows {
    nist_row *rows;
    size_t n, capacity;
    double lambdas_um[GONIO_CHANNELS_MAX]; // ascending
    int n_lambdas;
    int element; // column beside f_r11: 0 f_r11 itself, 1 f_r12 ... 15 f_r44
} nist_rows;

static bool recognise(const gonio_source *source) {
    long long number;
    char line[64], *fields[1];
    gonio_source_first_line(source, line, sizeof line, &number);
    return gonio_text_split(line, ',', fields, 1) > 1 && strcmp(fields[0], "lambda") == 0;
}

// "f_r23" -> 6; -1: no such element.
static int element_of(const char *name) {
    const bool sound = strlen(name) == 5 && strncmp(name, "f_r", 3) == 0 && name[3] >= '1' && name[3] <= '4' &&
                       name[4] >= '1' && name[4] <= '4';
    return sound ? 4 * (name[3] - '1') + (name[4] - '1') : -1;
}

// A negative polar angle lies half a turn further; the sum stays within a turn, as every samples file wants it.
static double azimuth_deg(double polar_deg, double phi_deg) {
    return polar_deg >= 0 ? phi_deg : phi_deg > 180 ? phi_deg - 180 : phi_deg + 180;
}

static gonio_status parse_row(const gonio_text *text, char **fields, int element, nist_row *row, gonio_error *error) {
    static const char *const names[5] = {"lambda", "thetai", "phii", "thetar", "phir"};
    double number[5], f11, ratio = 1;
    gonio_status status = GONIO_OK;
    for (int k = 0; k < 5 && status == GONIO_OK; k++) {
        status = gonio_text_number(text, fields[k], names[k], &number[k], error);
    }
    status = status == GONIO_OK ? gonio_text_number(text, fields[5], "f_r11", &f11, error) : status;
    if (status == GONIO_OK && element > 0) {
        status = gonio_text_number(text, fields[5 + element], "Mueller element", &ratio, error);
    }
    if (status != GONIO_OK) {
        return status;
    }
    if (!(fabs(number[1]) <= 90 && fabs(number[3]) <= 90)) {
        return gonio_text_fail(text, error, "thetai, thetar: expected -90 to 90 degrees, found %s and %s", fields[1],
                               fields[3]);
    }
    if (!(fabs(number[2]) <= 360 && fabs(number[4]) <= 360 && number[0] > 0)) {
        return gonio_text_fail(text, error, "expected lambda above 0 and azimuths of -360 to 360 degrees");
    }
    row->lambda_um = number[0];
    row->value = f11 * ratio;
    row->line = text->line;
    row->pair = (gonio_pair){gonio_radians(fabs(number[1])), gonio_radians(azimuth_deg(number[1], number[2])),
                             gonio_radians(fabs(number[3])), gonio_radians(azimuth_deg(number[3], number[4]))};
    return GONIO_OK;
}

static gonio_status append(nist_rows *all, const nist_row *row, gonio_error *error) {
    if (all->n == all->capacity) {
        const size_t larger = all->capacity * 2 + 256;
        nist_row *rows = realloc(all->rows, larger * sizeof *rows);
        if (rows == NULL) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu rows", larger);
        }
        all->rows = rows;
        all->capacity = larger;
    }
    all->rows[all->n++] = *row;
    return GONIO_OK;
}

static gonio_status note_wavelength(const gonio_text *text, nist_rows *all, double lambda, gonio_error *error) {
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

static gonio_status read_rows(gonio_text *text, nist_rows *all, gonio_error *error) {
    char *fields[COLUMNS];
    char *line = gonio_text_content(text);
    int n = gonio_text_split(line, ',', fields, COLUMNS);
    if (n != COLUMNS || strcmp(fields[1], "thetai") != 0) {
        return gonio_text_fail(text, error, "expected a header of %d columns, lambda,thetai,..., found %d", COLUMNS, n);
    }
    gonio_status status = GONIO_OK;
    while (status == GONIO_OK && (line = gonio_text_content(text)) != NULL) {
        n = gonio_text_split(line, ',', fields, COLUMNS);
        nist_row row;
        status = n == COLUMNS ? parse_row(text, fields, all->element, &row, error)
                              : gonio_text_fail(text, error, "expected %d columns, found %d", COLUMNS, n);
        status = status == GONIO_OK ? append(all, &row, error) : status;
        status = status == GONIO_OK ? note_wavelength(text, all, row.lambda_um, error) : status;
    }
    return status;
}

// Keep one wavelength only.
static gonio_status choose(const gonio_text *text, nist_rows *all, double lambda_um, gonio_error *error) {
    char list[200] = "";
    double nearest = 0;
    for (int k = 0; k < all->n_lambdas; k++) {
        const size_t used = strlen(list);
        snprintf(list + used, sizeof list - used, "%s%g", k > 0 ? ", " : "", all->lambdas_um[k]);
        if (fabs(all->lambdas_um[k] - lambda_um) <= 1e-6 * lambda_um) {
            nearest = all->lambdas_um[k];
        }
    }
    if (nearest == 0) {
        return gonio_fail_line(error, GONIO_E_INPUT, text->path, -1, "no wavelength %g um; it holds %s", lambda_um,
                               list);
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

static int by_geometry(const void *left, const void *right) {
    const nist_row *a = left, *b = right;
    const int geometry = memcmp(&a->pair, &b->pair, sizeof a->pair);
    if (geometry != 0) {
        return geometry;
    }
    const int wavelength = (a->lambda_um > b->lambda_um) - (a->lambda_um < b->lambda_um);
    return wavelength != 0 ? wavelength : (a->line > b->line) - (a->line < b->line);
}

static int by_line(const void *left, const void *right) {
    const nist_row *const *a = left, *const *b = right;
    return ((*a)->line > (*b)->line) - ((*a)->line < (*b)->line);
}

// Every geometry must come with each wavelength once; groups[g] then points to its run of n_lambdas rows.
static gonio_status group(const gonio_text *text, nist_rows *all, nist_row **groups, size_t *n, gonio_error *error) {
    const size_t wide = (size_t)all->n_lambdas;
    qsort(all->rows, all->n, sizeof *all->rows, by_geometry);
    *n = 0;
    for (size_t i = 0; i < all->n; i += wide) {
        for (size_t k = 0; k < wide; k++) {
            const nist_row *row = &all->rows[i + k < all->n ? i + k : i];
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

static gonio_status add_groups(gonio_text *text, const nist_rows *all, nist_row **groups, size_t n,
                               gonio_row_collector *collector, gonio_error *error) {
    gonio_status status = gonio_samples_new(all->n_lambdas, false, &collector->samples, error);
    for (int k = 0; k < all->n_lambdas && status == GONIO_OK; k++) {
        gonio_number_format(collector->samples->channel_names[k], GONIO_CHANNEL_NAME_MAX, "%.10gnm",
                            1000 * all->lambdas_um[k]);
    }
    for (size_t g = 0; g < n && status == GONIO_OK; g++) {
        double values[GONIO_CHANNELS_MAX];
        for (int k = 0; k < all->n_lambdas; k++) {
            values[k] = groups[g][k].value;
        }
        text->line = groups[g]->line;
        status = gonio_row_collector_add(collector, &groups[g]->pair, values, NULL, NULL, error);
    }
    return status;
}

static gonio_status collect(gonio_text *text, nist_rows *all, gonio_row_collector *collector, gonio_error *error) {
    if (all->n == 0) {
        return gonio_text_fail(text, error, "no rows after the header");
    }
    nist_row **groups = malloc(all->n * sizeof *groups);
    if (groups == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu rows", all->n);
    }
    size_t n;
    gonio_status status = group(text, all, groups, &n, error);
    status = status == GONIO_OK ? add_groups(text, all, groups, n, collector, error) : status;
    free(groups);
    return status;
}

static gonio_status read_nist(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                              gonio_read_report *report, gonio_error *error) {
    gonio_text text = gonio_text_begin(source->path, source->data, source->size);
    gonio_row_collector collector =
        gonio_row_collector_begin(&text, (gonio_negatives)values->at[NEGATIVES].choice, "nist");
    nist_rows all = {.element = element_of(values->at[MUELLER].text)};
    if (all.element < 0) {
        return gonio_fail(error, GONIO_E_USAGE, "Mueller element '%s'; expected f_r11 to f_r44",
                          values->at[MUELLER].text);
    }
    if (all.element > 0) {
        collector.policy = GONIO_NEGATIVES_KEEP; // every element but the first is signed by nature
    }
    gonio_status status = read_rows(&text, &all, error);
    if (status == GONIO_OK && values->wavelength_nm > 0) {
        status = choose(&text, &all, values->wavelength_nm / 1000, error);
    }
    status = status == GONIO_OK ? collect(&text, &all, &collector, error) : status;
    free(all.rows);
    return gonio_row_collector_end(&collector, status, out, report, error);
}

static const gonio_format_option options[] = {
    [NEGATIVES] = GONIO_OPTION_NEGATIVES,
    [MUELLER] = {"mueller", GONIO_FORMAT_TEXT, "ELEMENT", "f_r11", "Mueller element, f_r11 to f_r44"},
    {0}};

const gonio_format gonio_format_nist = {.name = "nist",
                                        .summary = "NIST Mueller-matrix CSV",
                                        .extensions = ".csv",
                                        .recognise = recognise,
                                        .read = read_nist,
                                        .options = options};
