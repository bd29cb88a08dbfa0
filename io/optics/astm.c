// SPDX-License-Identifier: BSD-3-Clause
// The text of ASTM E1392 and E2387 as the Cornell laboratory's site had it: header lines, NUM_POINTS n, VARS with the
// columns' names, then rows theta_i,phi_i,theta_s,phi_s in radians and values of f_r in 1/sr. The standards' own text
// was not at hand: a header line that speaks of degrees or of a cosine is refused, one that speaks of transmission
// declares it.
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/number.h"
#include "io/optics/grid.h"

enum { CHANNELS_MAX = GONIO_CHANNELS_MAX };

// A line that begins with VARS, behind nothing that is not text.
static bool recognise(const gonio_source *source) {
    for (const char *at = source->data; at != NULL; at = strchr(at, '\n')) {
        at += *at == '\n';
        if (strncasecmp(at, "VARS", 4) == 0 && (at[4] == ' ' || at[4] == '\t')) {
            return strncasecmp(at + 4 + strspn(at + 4, " \t"), "theta_i", 7) == 0;
        }
        if (at - source->data > 1 << 16) {
            break;
        }
    }
    return false;
}

typedef struct astm {
    gonio_text text;
    gonio_row_collector collector;
    double points; // stated; < 0: not
    bool xyz;
} astm;

static gonio_status read_names(astm *a, char *line, gonio_error *error) {
    static const char *const angles[4] = {"theta_i", "phi_i", "theta_s", "phi_s"};
    char *fields[4 + CHANNELS_MAX];
    const int n = gonio_text_split(line, ',', fields, 4 + CHANNELS_MAX);
    for (int k = 0; k < 4; k++) {
        if (n < 5 || n > 4 + CHANNELS_MAX || strcasecmp(fields[k], angles[k]) != 0) {
            return gonio_text_fail(&a->text, error, "VARS: expected theta_i,phi_i,theta_s,phi_s and 1 to %d names",
                                   CHANNELS_MAX);
        }
    }
    const gonio_status status = gonio_row_collector_room(&a->collector, n - 4, false, error);
    if (status != GONIO_OK) {
        return status;
    }
    a->xyz = n == 7 && strcmp(fields[4], "X") == 0 && strcmp(fields[5], "Y") == 0 && strcmp(fields[6], "Z") == 0;
    const bool rgb =
        n == 7 && strcmp(fields[4], "R") == 0 && strcmp(fields[5], "G") == 0 && strcmp(fields[6], "B") == 0;
    for (int c = 0; c < n - 4; c++) {
        if (strlen(fields[4 + c]) >= GONIO_CHANNEL_NAME_MAX) {
            return gonio_text_fail(&a->text, error, "VARS: the name '%.40s' is longer than %d bytes", fields[4 + c],
                                   GONIO_CHANNEL_NAME_MAX - 1);
        }
        if (a->xyz || rgb) {
            snprintf(a->collector.samples->channel_names[c], GONIO_CHANNEL_NAME_MAX, "%c", "rgb"[c]);
        } else {
            snprintf(a->collector.samples->channel_names[c], GONIO_CHANNEL_NAME_MAX, "%s", fields[4 + c]);
        }
    }
    return GONIO_OK;
}

static gonio_status read_header(astm *a, gonio_error *error) {
    static const char *const changing[] = {"degree", "cos", "specular", "relative"};
    for (char *line; (line = gonio_text_line(&a->text)) != NULL;) {
        if (strncasecmp(line, "VARS", 4) == 0 && (line[4] == ' ' || line[4] == '\t')) {
            return read_names(a, line + 5, error);
        }
        if (strncasecmp(line, "NUM_POINTS", 10) == 0) {
            const gonio_status status =
                gonio_text_number(&a->text, line + 10 + strspn(line + 10, " \t"), "NUM_POINTS", &a->points, error);
            if (status != GONIO_OK) {
                return status;
            }
        }
        if (strcasestr(line, "transmi") != NULL || strcasestr(line, "btdf") != NULL) {
            a->collector.declared.through = a->collector.declared.transmission = a->text.transmission = true;
        }
        for (size_t k = 0; k < sizeof changing / sizeof *changing; k++) {
            if (strcasestr(line, changing[k]) != NULL) {
                return gonio_text_fail(
                    &a->text, error, "'%.60s' may change what the values mean; f_r in 1/sr over radians is read", line);
            }
        }
    }
    return gonio_text_fail(&a->text, error, "the file ends before VARS");
}

static double azimuth(double phi) { return gonio_angle_canonical(remainder(phi, 2 * GONIO_PI)); }

static gonio_status read_row(astm *a, char **fields, double *numbers, gonio_error *error) {
    const gonio_samples *s = a->collector.samples;
    gonio_status status = GONIO_OK;
    for (int k = 0; k < 4 + s->channels && status == GONIO_OK; k++) {
        status = gonio_text_number(&a->text, fields[k], k < 4 ? "angle" : s->channel_names[k - 4], &numbers[k], error);
    }
    gonio_pair pair = {0};
    status = status == GONIO_OK ? gonio_polar_rad(&a->text, "theta_i", numbers[0], &pair.theta_i, error) : status;
    status = status == GONIO_OK ? gonio_polar_rad(&a->text, "theta_s", numbers[2], &pair.theta_o, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    pair.phi_i = azimuth(numbers[1]);
    pair.phi_o = azimuth(numbers[3]);
    if (a->xyz) {
        gonio_xyz_to_rgb((double[3]){numbers[4], numbers[5], numbers[6]}, numbers + 4);
    }
    return gonio_row_collector_add(&a->collector, &pair, numbers + 4, NULL, NULL, error);
}

static gonio_status read_rows(astm *a, gonio_error *error) {
    char *fields[4 + CHANNELS_MAX];
    const int columns = 4 + a->collector.samples->channels;
    double *numbers = malloc((size_t)columns * sizeof *numbers);
    gonio_status status = numbers != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a row");
    for (char *line; status == GONIO_OK && (line = gonio_text_content(&a->text)) != NULL;) {
        const int n = gonio_text_split(line, ',', fields, columns);
        status = n == columns ? read_row(a, fields, numbers, error)
                              : gonio_text_fail(&a->text, error, "expected %d columns, found %d", columns, n);
    }
    free(numbers);
    const size_t found = status == GONIO_OK ? a->collector.samples->n : 0;
    return status == GONIO_OK && a->points >= 0 && (double)found != a->points
               ? gonio_text_fail(&a->text, error, "NUM_POINTS states %g rows, found %zu", a->points, found)
               : status;
}

static const gonio_declaration declarations[] = {
    {"radian", NULL, GONIO_DECLARED_NOTHING}, {"angle_units", "radian|radians|rad", GONIO_DECLARED_NOTHING}, {0}};

static gonio_status read_astm(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                              gonio_read_report *report, gonio_error *error) {
    astm a = {.text = gonio_text_begin(source->path, source->data, source->size), .points = -1};
    gonio_status status = gonio_row_collector_begin(&a.collector, &a.text, source, values, declarations, "astm", error);
    status = status == GONIO_OK ? read_header(&a, error) : status;
    status = status == GONIO_OK ? read_rows(&a, error) : status;
    return gonio_row_collector_end(&a.collector, status, out, report, error);
}

static const gonio_format_option options[] = {GONIO_TEXT_OPTIONS, {0}};

// ---- writing: a grid, row by row ----

static void put_row(gonio_grid *g, const int at[GONIO_GRID_AXES], FILE *stream) {
    fprintf(stream, "%.9g,%.9g,%.9g,%.9g", gonio_radians(g->axis[1].deg[at[1]]), gonio_radians(g->axis[0].deg[at[0]]),
            gonio_radians(g->axis[3].deg[at[3]]), gonio_radians(g->axis[2].deg[at[2]]));
    for (int c = 0; c < g->channels; c++) {
        fprintf(stream, ",%.9g", gonio_grid_written(g, c, at[0], at[1], at[2], at[3]));
    }
    fputc('\n', stream);
}

static gonio_status write_astm(const gonio_model *model, const gonio_format_values *values, FILE *stream,
                               gonio_write_report *told, gonio_error *error) {
    gonio_grid g = {.frame = GONIO_GRID_ABSOLUTE};
    const gonio_status status = gonio_grid_of_model(&g, model, values->at[0].count, false, values->threads, error);
    if (status == GONIO_OK) {
        if (values->half == GONIO_TRANSMISSION) {
            fputs("Transmission (BTDF): theta_s from the normal of the far side\n", stream);
        }
        fprintf(stream, "NUM_POINTS %d\nVARS theta_i,phi_i,theta_s,phi_s",
                g.axis[0].n * g.axis[1].n * g.axis[2].n * g.axis[3].n);
        for (int c = 0; c < g.channels; c++) {
            const char *name = model->channel_names[c];
            const bool rgb = g.channels == 3 && name[0] == "rgb"[c] && name[1] == 0;
            fprintf(stream, ",%s", rgb ? (const char *const[]){"R", "G", "B"}[c] : name);
        }
        fputc('\n', stream);
        int at[GONIO_GRID_AXES] = {0};
        for (; at[0] < g.axis[0].n; at[0]++) {
            for (at[1] = 0; at[1] < g.axis[1].n; at[1]++) {
                for (at[2] = 0; at[2] < g.axis[2].n; at[2]++) {
                    for (at[3] = 0; at[3] < g.axis[3].n; at[3]++) {
                        put_row(&g, at, stream);
                    }
                }
            }
        }
        gonio_grid_tell(&g, model, told);
    }
    gonio_grid_free(&g);
    return status;
}

static const gonio_format_option write_options[] = {GONIO_OPTION_GRID_STEP, {0}};

const gonio_format gonio_format_astm = {.name = "astm",
                                        .summary = "ASTM E1392/E2387 text",
                                        .extensions = ".astm",
                                        .write_table = write_astm,
                                        .write_options = write_options,
                                        .halves = 1u << GONIO_REFLECTION | 1u << GONIO_TRANSMISSION,
                                        .one_half = true,
                                        .quantity = "f_r, 1/sr",
                                        .convention = "radians; phi_s absolute, the mirror of phi_i = 0 at pi",
                                        .theta_max_deg = GONIO_GRID_WRITE_MAX_DEG,
                                        .precision = 1e-7,
                                        .recognise = recognise,
                                        .read = read_astm,
                                        .options = options};
