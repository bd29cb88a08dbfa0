// SPDX-License-Identifier: BSD-3-Clause
// The file of what a scene needs (docs/formats.md): a head of comments, a row a cell, a checksum of all before it.
#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/number.h"
#include "base/text.h"
#include "brdf/checksum.h"
#include "fit/needs/needs.h"
#include "gonio/output.h"

#define FIRST "# gonio needs 1"
#define COLUMNS "material,theta_i,phi_i,theta_o,phi_o,codes,squares,value"
#define BYTES_MAX ((size_t)1 << 31)
#define CELLS_MAX 10000000

// ---- writing ----

// The scene's path as the file says it: relative where it lies in the file's folder or below.
static void relate(const char *scene, const char *path, char *out, size_t size) {
    char whole[PATH_MAX], folder[PATH_MAX], resolved[PATH_MAX];
    snprintf(folder, sizeof folder, "%s", path);
    char *slash = strrchr(folder, '/');
    snprintf(slash != NULL ? slash + (slash == folder) : folder,
             sizeof folder - (size_t)(slash != NULL ? slash + (slash == folder) - folder : 0), "%s",
             slash != NULL ? "" : ".");
    if (realpath(scene, whole) == NULL || realpath(folder, resolved) == NULL) {
        snprintf(out, size, "%s", scene);
        return;
    }
    const size_t length = strlen(resolved);
    const bool within = strncmp(whole, resolved, length) == 0 && whole[length] == '/';
    snprintf(out, size, "%s", within ? whole + length + 1 : whole);
}

static void write_head(const gonio_needs *n, const char *path, FILE *to) {
    char scene[PATH_MAX];
    relate(n->scene, path, scene, sizeof scene);
    gonio_number_write(to, "%s\n# scene = %s\n# scene_checksum = %016" PRIx64 "\n", FIRST, scene, n->scene_checksum);
    gonio_number_write(to, "# picture = width=%d,height=%d,samples=%d,interreflection=%d\n", n->width, n->height,
                       n->samples, n->interreflection);
    for (int f = 0; f < n->frames; f++) {
        const gonio_needs_frame *frame = &n->frame[f];
        gonio_number_write(to, "# frame = camera=%s,light=%s,turn=%.17g,exposure=%.17g\n", frame->camera, frame->light,
                           frame->turn_deg, frame->exposure);
    }
    for (int k = 0; k < n->materials; k++) {
        const needs_material *m = &n->material[k];
        gonio_number_write(to, "# material = name=%s,isotropic=%d,resolution=%d,cells=%zu,behind=%.9g\n", m->name,
                           m->isotropic, m->resolution, m->cells, m->behind);
    }
    fprintf(to, "%s\n", COLUMNS);
}

static void write_cells(const gonio_needs *n, FILE *to) {
    for (int k = 0; k < n->materials; k++) {
        const needs_material *m = &n->material[k];
        for (size_t i = 0; i < m->cells; i++) {
            const gonio_need *c = &m->cell[i];
            const gonio_pair p = gonio_pair_from_vectors(c->wi, c->wo);
            gonio_number_write(to, "%s,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g\n", m->name, gonio_degrees(p.theta_i),
                               gonio_degrees(p.phi_i), gonio_degrees(p.theta_o), gonio_degrees(p.phi_o), c->codes,
                               c->squares, c->value);
        }
    }
}

gonio_status gonio_needs_save(const gonio_needs *needs, const char *path, gonio_error *error) {
    char *text = NULL;
    size_t size = 0;
    gonio_output *output = NULL;
    FILE *to = open_memstream(&text, &size);
    if (to == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to write %s", path);
    }
    write_head(needs, path, to);
    write_cells(needs, to);
    gonio_status status = fclose(to) == 0 ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory to write %s", path);
    status = status == GONIO_OK ? gonio_output_open(path, &output, error) : status;
    if (status == GONIO_OK) {
        gonio_checksum sum = gonio_checksum_begin();
        gonio_checksum_add(&sum, text, size);
        fwrite(text, 1, size, gonio_output_stream(output));
        fprintf(gonio_output_stream(output), "# checksum = %016" PRIx64 "\n", gonio_checksum_end(&sum));
        status = gonio_output_commit(output, error);
    }
    free(text);
    return status;
}

// ---- reading ----

// The value behind "# key = " where the line is of that key; else NULL.
static char *value_of(char *line, const char *key) {
    const size_t length = strlen(key);
    return strncmp(line, "# ", 2) == 0 && strncmp(line + 2, key, length) == 0 &&
                   strncmp(line + 2 + length, " = ", 3) == 0
               ? line + 5 + length
               : NULL;
}

static gonio_status check_sum(const gonio_text *text, const char *data, size_t size, gonio_error *error) {
    static const char mark[] = "# checksum = ";
    const size_t tail = sizeof mark - 1 + 16 + 1;
    gonio_text at = *text;
    if (size < tail || memcmp(data + size - tail, mark, sizeof mark - 1) != 0 || data[size - 1] != '\n') {
        at.line = -1;
        return gonio_text_fail(&at, error, "no checksum on its last line: it was cut short, or is no file of needs");
    }
    char *end;
    const uint64_t told = strtoull(data + size - 17, &end, 16);
    gonio_checksum sum = gonio_checksum_begin();
    gonio_checksum_add(&sum, data, size - tail);
    if (end != data + size - 1 || told != gonio_checksum_end(&sum)) {
        at.line = -1;
        return gonio_text_fail(&at, error,
                               "its checksum is %016" PRIx64 ", not the %.16s that it states: it was changed",
                               gonio_checksum_end(&sum), data + size - 17);
    }
    return GONIO_OK;
}

// "name=value,name=value": the values, in the order of the names.
static gonio_status take_settings(const gonio_text *text, char *line, const char *const *names, int n, char **values,
                                  gonio_error *error) {
    char *items[8];
    const int found = gonio_text_split(line, ',', items, 8);
    bool good = found == n;
    for (int k = 0; k < n && good; k++) {
        const size_t length = strlen(names[k]);
        good = strncmp(items[k], names[k], length) == 0 && items[k][length] == '=';
        values[k] = items[k] + length + 1;
    }
    return good ? GONIO_OK
                : gonio_text_fail(text, error, "expected %d settings from %s=... to %s=..., found %d", n, names[0],
                                  names[n - 1], found);
}

static gonio_status take_number(const gonio_text *text, const char *field, const char *what, double low, double high,
                                double *value, gonio_error *error) {
    const gonio_status status = gonio_text_number(text, field, what, value, error);
    return status == GONIO_OK && !(*value >= low && *value <= high)
               ? gonio_text_fail(text, error, "%s is %.40s; %g to %g is possible", what, field, low, high)
               : status;
}

static gonio_status take_picture(const gonio_text *text, char *line, gonio_needs *n, gonio_error *error) {
    static const char *const names[] = {"width", "height", "samples", "interreflection"};
    char *values[4];
    double v[4] = {0};
    gonio_status status = take_settings(text, line, names, 4, values, error);
    for (int k = 0; k < 4 && status == GONIO_OK; k++) {
        status = take_number(text, values[k], names[k], k < 3 ? 1 : 0, k < 3 ? 1 << 20 : 1, &v[k], error);
    }
    n->width = (int)v[0];
    n->height = (int)v[1];
    n->samples = (int)v[2];
    n->interreflection = v[3] != 0;
    return status;
}

static gonio_status take_name(const gonio_text *text, const char *value, char *name, gonio_error *error) {
    if (strlen(value) >= GONIO_NEEDS_NAME_MAX) {
        return gonio_text_fail(text, error, "a name of more than %d bytes: %.40s...", GONIO_NEEDS_NAME_MAX - 1, value);
    }
    strcpy(name, value);
    return GONIO_OK;
}

static gonio_status take_frame(const gonio_text *text, char *line, gonio_needs_frame *frame, gonio_error *error) {
    static const char *const names[] = {"camera", "light", "turn", "exposure"};
    char *values[4];
    gonio_status status = take_settings(text, line, names, 4, values, error);
    status = status == GONIO_OK ? take_name(text, values[0], frame->camera, error) : status;
    status = status == GONIO_OK ? take_name(text, values[1], frame->light, error) : status;
    status = status == GONIO_OK ? take_number(text, values[2], names[2], -360, 360, &frame->turn_deg, error) : status;
    return status == GONIO_OK ? take_number(text, values[3], names[3], 1e-30, 1e30, &frame->exposure, error) : status;
}

static gonio_status take_material(const gonio_text *text, char *line, needs_material *m, gonio_error *error) {
    static const char *const names[] = {"name", "isotropic", "resolution", "cells", "behind"};
    char *values[5];
    double v[5] = {0};
    static const double low[] = {0, 0, 1, 0, 0}, high[] = {0, 1, 4096, CELLS_MAX, 1e30};
    gonio_status status = take_settings(text, line, names, 5, values, error);
    status = status == GONIO_OK ? take_name(text, values[0], m->name, error) : status;
    for (int k = 1; k < 5 && status == GONIO_OK; k++) {
        status = take_number(text, values[k], names[k], low[k], high[k], &v[k], error);
    }
    m->isotropic = v[1] != 0;
    m->resolution = (int)v[2];
    m->behind = v[4];
    m->cells = 0;
    if (status == GONIO_OK && (m->cell = malloc(((size_t)v[3] + 1) * sizeof *m->cell)) == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %.0f cells", v[3]);
    }
    // Until the rows are read: how many there will be.
    m->codes = v[3];
    return status;
}

static gonio_status take_row(const gonio_text *text, char *line, gonio_needs *n, int *at, gonio_error *error) {
    char *fields[8];
    const int columns = gonio_text_split(line, ',', fields, 8);
    gonio_pair pair;
    gonio_need c;
    if (columns != 8) {
        return gonio_text_fail(text, error, "expected the 8 columns %s, found %d", COLUMNS, columns);
    }
    while (*at < n->materials && (strcmp(n->material[*at].name, fields[0]) != 0 ||
                                  (double)n->material[*at].cells >= n->material[*at].codes)) {
        ++*at;
    }
    if (*at >= n->materials) {
        return gonio_text_fail(text, error, "a row of material '%.60s', of which the head states fewer, or none",
                               fields[0]);
    }
    needs_material *m = &n->material[*at];
    gonio_status status = gonio_text_pair(text, fields + 1, &pair, error);
    status = status == GONIO_OK ? take_number(text, fields[5], "codes", 0, 1e30, &c.codes, error) : status;
    status = status == GONIO_OK ? take_number(text, fields[6], "squares", 0, 1e30, &c.squares, error) : status;
    status = status == GONIO_OK ? take_number(text, fields[7], "value", 0, 1e30, &c.value, error) : status;
    if (status == GONIO_OK) {
        c.wi = gonio_direction(pair.theta_i, pair.phi_i);
        c.wo = gonio_direction(pair.theta_o, pair.phi_o);
        gonio_needs_normal_pair(m->isotropic, &c.wi, &c.wo);
        m->cell[m->cells++] = c;
    }
    return status;
}

// The head's lines up to the columns' names.
static gonio_status read_head(gonio_text *text, char **scene, gonio_needs *n, gonio_error *error) {
    char *line = gonio_text_line(text), *value;
    gonio_status status = GONIO_OK;
    bool begun = line != NULL && strcmp(line, FIRST) == 0, pictured = false, ended = false;
    if (!begun) {
        return gonio_text_fail(text, error, "expected '%s': not a file of needs", FIRST);
    }
    n->frames = n->materials = 0;
    while (status == GONIO_OK && !ended && (line = gonio_text_line(text)) != NULL) {
        if ((value = value_of(line, "scene")) != NULL) {
            *scene = value;
        } else if ((value = value_of(line, "scene_checksum")) != NULL) {
            n->scene_checksum = strtoull(value, NULL, 16);
        } else if ((value = value_of(line, "picture")) != NULL) {
            status = take_picture(text, value, n, error);
            pictured = true;
        } else if ((value = value_of(line, "frame")) != NULL) {
            status = take_frame(text, value, &n->frame[n->frames++], error);
        } else if ((value = value_of(line, "material")) != NULL) {
            status = take_material(text, value, &n->material[n->materials++], error);
        } else if (strcmp(line, COLUMNS) == 0) {
            ended = true;
        } else {
            status = gonio_text_fail(text, error, "found '%.60s', expected # scene, picture, frame, material or %s",
                                     line, COLUMNS);
        }
    }
    return status == GONIO_OK && (!ended || !pictured || *scene == NULL || n->frames == 0 || n->materials == 0)
               ? gonio_text_fail(text, error, "the head lacks its scene, picture, frame, material or columns")
               : status;
}

static gonio_status read_rows(gonio_text *text, gonio_needs *n, gonio_error *error) {
    char *line;
    int at = 0;
    gonio_status status = GONIO_OK;
    while (status == GONIO_OK && (line = gonio_text_content(text)) != NULL) {
        status = take_row(text, line, n, &at, error);
    }
    for (int k = 0; k < n->materials && status == GONIO_OK; k++) {
        const needs_material *m = &n->material[k];
        if ((double)m->cells != m->codes) {
            status = gonio_text_fail(text, error, "%zu cells of material '%s'; the head states %.0f", m->cells, m->name,
                                     m->codes);
        }
    }
    return status;
}

static gonio_status resolve(const char *path, const char *scene, gonio_needs *n, gonio_error *error) {
    const char *slash = strrchr(path, '/');
    const size_t folder = slash != NULL && scene[0] != '/' ? (size_t)(slash - path) + 1 : 0;
    n->scene = malloc(folder + strlen(scene) + 1);
    if (n->scene == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for what a scene needs");
    }
    memcpy(n->scene, path, folder);
    strcpy(n->scene + folder, scene);
    return GONIO_OK;
}

// Lines that begin so, so that there is room for what they tell.
static int count_lines(const char *data, const char *start) {
    int n = 0;
    for (const char *at = data; (at = strstr(at, start)) != NULL && n < 100000; at++) {
        n++;
    }
    return n;
}

bool gonio_needs_file_is(const char *path) {
    char first[sizeof FIRST] = "";
    struct stat facts;
    // Nobody waits for a pipe.
    FILE *file = stat(path, &facts) == 0 && S_ISREG(facts.st_mode) ? fopen(path, "re") : NULL;
    const bool is = file != NULL && fread(first, 1, sizeof FIRST - 1, file) == sizeof FIRST - 1 &&
                    memcmp(first, FIRST, sizeof FIRST - 1) == 0;
    if (file != NULL) {
        fclose(file);
    }
    return is;
}

gonio_status gonio_needs_open(const char *path, gonio_needs **out, gonio_error *error) {
    char *data, *scene = NULL;
    size_t size;
    *out = NULL;
    gonio_needs *n = NULL;
    gonio_status status = gonio_file_read(path, BYTES_MAX, &data, &size, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_text text = gonio_text_begin(path, data, size);
    text.line = 1;
    if (strncmp(data, FIRST, sizeof FIRST - 1) != 0) {
        status =
            gonio_text_fail(&text, error, "found '%.*s', expected '%s': not a file of needs",
                            (int)strnlen(data, strcspn(data, "\r\n") < 40 ? strcspn(data, "\r\n") : 40), data, FIRST);
    }
    text.line = 0;
    status = status == GONIO_OK ? check_sum(&text, data, size, error) : status;
    status = status == GONIO_OK
                 ? gonio_needs_new(count_lines(data, "\n# material = "), count_lines(data, "\n# frame = "), &n, error)
                 : status;
    status = status == GONIO_OK ? read_head(&text, &scene, n, error) : status;
    status = status == GONIO_OK ? read_rows(&text, n, error) : status;
    status = status == GONIO_OK ? resolve(path, scene, n, error) : status;
    status = status == GONIO_OK ? gonio_needs_finish(n, error) : status;
    free(data);
    if (status != GONIO_OK) {
        gonio_needs_free(n);
        return status;
    }
    *out = n;
    return GONIO_OK;
}
