// SPDX-License-Identifier: BSD-3-Clause
// MBSDF, the measured BSDF of NVIDIA's Material Definition Language (MDL specification, appendix "MBSDF file format"):
// a header line, lines name="value", then MBSDF_DATA_REFLECTION= (or MBSDF_DATA=), MBSDF_DATA_TRANSMISSION= or both,
// each followed by, little-endian, u32 type (0 scalar, 1 rgb), u32 thetas, u32 phis, float32 f_r in 1/sr at cells'
// centres: [theta_in][theta_out][dphi][type]. dphi = 0 is the light's side; theta_out counts from the normal of the
// side where the light leaves. Isotropic and mirror-symmetric.
#include <endian.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread_pool.h"
#include "io/format.h"

#define MAGIC "NVIDIA ARC MBSDF V1\n"
enum { SIDE_MAX = 4096 };

static bool recognise(const gonio_source *source) {
    return source->size >= sizeof MAGIC - 1 && memcmp(source->data, MAGIC, sizeof MAGIC - 1) == 0;
}

static uint32_t word_at(const gonio_source *source, size_t byte) {
    uint32_t raw;
    memcpy(&raw, source->data + byte, 4);
    return le32toh(raw);
}

static bool is_line(const char *begin, size_t n, const char *text) {
    return n == strlen(text) && memcmp(begin, text, n) == 0;
}

// From a line's begin at *at on: where the numbers of the next table begin, and of which half. 0: there is none.
static gonio_status find_data(const gonio_source *source, size_t line, size_t *at, gonio_half *half,
                              gonio_error *error) {
    *at = 0;
    while (line < source->size) {
        const char *begin = source->data + line, *end = memchr(begin, '\n', source->size - line);
        if (end == NULL) {
            return source->size - line >= 5 && memcmp(begin, "MBSDF", 5) == 0
                       ? gonio_fail_byte(error, GONIO_E_INPUT, source->path, (long long)line,
                                         "the file ends inside the line of a table")
                       : GONIO_OK;
        }
        const size_t n = (size_t)(end - begin);
        const bool through = is_line(begin, n, "MBSDF_DATA_TRANSMISSION=");
        if (through || is_line(begin, n, "MBSDF_DATA_REFLECTION=") || is_line(begin, n, "MBSDF_DATA=")) {
            *at = line + n + 1;
            *half = through ? GONIO_TRANSMISSION : GONIO_REFLECTION;
            return GONIO_OK;
        }
        const char *equals = memchr(begin, '=', n);
        if (n > 0 && (equals == NULL || n > 1000)) {
            return gonio_fail_byte(error, GONIO_E_INPUT, source->path, (long long)line,
                                   "expected name=\"value\", MBSDF_DATA_REFLECTION= or MBSDF_DATA_TRANSMISSION=, found "
                                   "'%.30s'",
                                   begin);
        }
        line += n + 1;
    }
    return GONIO_OK;
}

typedef struct table {
    size_t begin, thetas, phis, channels, end;
    gonio_half half;
} table;

// The next table from a line on; begin 0: there is none.
static gonio_status read_head(const gonio_source *source, size_t line, table *t, gonio_error *error) {
    size_t at;
    *t = (table){0};
    const gonio_status status = find_data(source, line, &at, &t->half, error);
    if (status != GONIO_OK || at == 0) {
        return status;
    }
    const gonio_half half = t->half;
    if (source->size - at < 12) {
        return gonio_fail_byte(error, GONIO_E_INPUT, source->path, (long long)at, "the file ends inside its table");
    }
    const uint32_t type = word_at(source, at);
    *t = (table){at + 12, word_at(source, at + 4), word_at(source, at + 8), type == 1 ? 3 : 1, 0, half};
    if (type > 1 || t->thetas < 1 || t->phis < 1 || t->thetas > SIDE_MAX || t->phis > SIDE_MAX) {
        return gonio_fail_byte(error, GONIO_E_INPUT, source->path, (long long)at,
                               "type %u, %zu thetas, %zu azimuths; expected type 0 or 1 and 1 to %d", type, t->thetas,
                               t->phis, SIDE_MAX);
    }
    const size_t bytes = 4 * t->thetas * t->thetas * t->phis * t->channels;
    t->end = t->begin + bytes;
    return source->size - t->begin >= bytes
               ? GONIO_OK
               : gonio_fail_byte(error, GONIO_E_INPUT, source->path, (long long)source->size,
                                 "the file ends inside its table: %zu bytes of it are there, %zu were expected",
                                 source->size - t->begin, bytes);
}

static gonio_status add_cell(const gonio_source *source, const table *t, size_t cell, gonio_samples *samples,
                             gonio_error *error) {
    const size_t k = cell % t->phis, o = cell / t->phis % t->thetas, i = cell / t->phis / t->thetas;
    const double step = 90.0 / (double)t->thetas;
    const gonio_pair pair = {gonio_angle_canonical(gonio_radians(((double)i + 0.5) * step)), 0,
                             gonio_angle_canonical(gonio_radians(((double)o + 0.5) * step)),
                             gonio_angle_canonical(gonio_radians(((double)k + 0.5) * 180 / (double)t->phis))};
    double values[3];
    for (size_t c = 0; c < t->channels; c++) {
        const size_t byte = t->begin + 4 * (cell * t->channels + c);
        const uint32_t raw = word_at(source, byte);
        float single;
        memcpy(&single, &raw, 4);
        values[c] = (double)single;
        if (!isfinite(values[c]) || values[c] < 0) {
            return gonio_fail_byte(error, GONIO_E_INPUT, source->path, (long long)byte,
                                   "expected a finite number, 0 or more, found %g", values[c]);
        }
    }
    const gonio_pair lowered = gonio_pair_lowered(pair, t->half);
    return gonio_samples_add(samples, &lowered, values, NULL, NULL, error);
}

static gonio_status begin_samples(const table *t, gonio_samples **out, gonio_error *error) {
    const gonio_status status = gonio_samples_new((int)t->channels, false, out, error);
    for (size_t c = 0; status == GONIO_OK && c < t->channels; c++) {
        snprintf((*out)->channel_names[c], GONIO_CHANNEL_NAME_MAX, "%.*s", t->channels == 1 ? 7 : 1,
                 t->channels == 1 ? "visible" : &"rgb"[c]);
    }
    return status;
}

static gonio_status add_table(const gonio_source *source, const table *t, gonio_samples **out, gonio_error *error) {
    gonio_status status = *out == NULL ? begin_samples(t, out, error) : GONIO_OK;
    if (status == GONIO_OK && (*out)->channels != (int)t->channels) {
        return gonio_fail_byte(error, GONIO_E_INPUT, source->path, (long long)t->begin - 12,
                               "a table of %zu channels; the one before it has %d", t->channels, (*out)->channels);
    }
    for (size_t cell = 0; status == GONIO_OK && cell < t->thetas * t->thetas * t->phis; cell++) {
        status = add_cell(source, t, cell, *out, error);
    }
    if (status == GONIO_OK) {
        (*out)->transmission = (*out)->transmission || t->half != GONIO_REFLECTION;
    }
    return status;
}

static gonio_status read_mbsdf(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                               gonio_read_report *report, gonio_error *error) {
    (void)values;
    table t;
    *out = NULL;
    gonio_status status = read_head(source, sizeof MAGIC - 1, &t, error);
    if (status == GONIO_OK && t.begin == 0) {
        status = gonio_fail_byte(error, GONIO_E_INPUT, source->path, (long long)source->size,
                                 "there is neither MBSDF_DATA_REFLECTION= nor MBSDF_DATA_TRANSMISSION=");
    }
    while (status == GONIO_OK && t.begin != 0) {
        const size_t end = t.end + (t.end < source->size && source->data[t.end] == '\n');
        status = add_table(source, &t, out, error);
        status = status == GONIO_OK ? read_head(source, end, &t, error) : status;
    }
    if (status != GONIO_OK) {
        gonio_samples_free(*out);
        *out = NULL;
    } else if (report != NULL) {
        *report = (gonio_read_report){.format = "mbsdf", .rows = (*out)->n, .first_negative_line = -1};
    }
    return status;
}

// ---- writing ----

typedef struct writing {
    const gonio_model *model;
    size_t thetas, phis, channels;
    float *values;
} writing;

// Both sides of the plane of incidence are one in the file: their mean.
static void fill_incidence(void *context, size_t i) {
    const writing *w = context;
    const double step = GONIO_PI / 2 / (double)w->thetas;
    for (size_t k = 0; k < w->thetas * w->phis; k++) {
        const double theta_o = ((double)(k / w->phis) + 0.5) * step;
        const double phi = ((double)(k % w->phis) + 0.5) * GONIO_PI / (double)w->phis;
        double values[2][3];
        for (int side = 0; side < 2; side++) {
            gonio_model_eval_pair(w->model, &(gonio_pair){((double)i + 0.5) * step, 0, theta_o, side ? -phi : phi},
                                  values[side]);
        }
        for (size_t c = 0; c < w->channels; c++) {
            w->values[(i * w->thetas * w->phis + k) * w->channels + c] =
                (float)fmax(0.5 * (values[0][c] + values[1][c]), 0);
        }
    }
}

static void put_word(uint32_t word, FILE *stream) {
    word = htole32(word);
    fwrite(&word, sizeof word, 1, stream);
}

static void put_mbsdf(const writing *w, gonio_half half, FILE *stream) {
    fprintf(stream, "MBSDF_DATA_%s=\n", half == GONIO_TRANSMISSION ? "TRANSMISSION" : "REFLECTION");
    put_word(w->channels == 3, stream);
    put_word((uint32_t)w->thetas, stream);
    put_word((uint32_t)w->phis, stream);
    for (size_t k = 0; k < w->thetas * w->thetas * w->phis * w->channels; k++) {
        uint32_t bits;
        memcpy(&bits, &w->values[k], sizeof bits);
        put_word(bits, stream);
    }
}

#define WRITE_BYTES 2300000 // 45 x 45 x 90 of r, g, b

static gonio_status write_half(const gonio_model *model, gonio_half half, const gonio_format_values *values,
                               FILE *stream, gonio_write_report *told, gonio_error *error) {
    gonio_model *rgb = (gonio_model *)(uintptr_t)model;
    gonio_status status = model->channels == 1 ? GONIO_OK : gonio_model_as_rgb(model, &rgb, error);
    if (status != GONIO_OK) {
        return status;
    }
    const size_t bytes = values->max_bytes > 0 ? values->max_bytes : WRITE_BYTES;
    writing w = {.model = rgb, .channels = (size_t)rgb->channels};
    for (w.thetas = 4; w.thetas < 180 && 8 * w.channels * (w.thetas + 1) * (w.thetas + 1) * (w.thetas + 1) <= bytes;) {
        w.thetas++;
    }
    w.phis = 2 * w.thetas;
    w.values = malloc(w.thetas * w.thetas * w.phis * w.channels * sizeof *w.values);
    if (w.values == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for an MBSDF table");
    } else {
        gonio_pool_for(values->threads, w.thetas, fill_incidence, &w);
        put_mbsdf(&w, half, stream);
        snprintf(told->about, sizeof told->about, "%zu x %zu polar angles, %zu azimuths, at cells' centres", w.thetas,
                 w.thetas, w.phis);
    }
    free(w.values);
    if (rgb != model) {
        gonio_model_free(rgb);
    }
    return status;
}

static gonio_status write_mbsdf(const gonio_model *model, const gonio_format_values *values, FILE *stream,
                                gonio_write_report *told, gonio_error *error) {
    if (!model->isotropic) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED, "an MBSDF table is isotropic; the model is not");
    }
    gonio_status status = GONIO_OK;
    fputs(MAGIC "generator=\"Gonio\"\n", stream);
    for (int h = GONIO_REFLECTION; h <= GONIO_TRANSMISSION && status == GONIO_OK; h++) {
        const gonio_model *half = gonio_written_half(model, values, (gonio_half)h);
        status = half != NULL ? write_half(half, (gonio_half)h, values, stream, told, error) : status;
    }
    gonio_write_lost_channels(model, model->channels == 1 ? 1 : 3, told);
    gonio_write_lost(told, "the side of the plane of incidence; f_r(wi, wo) and f_r(wo, wi) are averaged by readers");
    return status;
}

static const gonio_format_alias aliases[] = {{"mdl", NULL, NULL}, {0}};

const gonio_format gonio_format_mbsdf = {.name = "mbsdf",
                                         .summary = "MBSDF (MDL)",
                                         .extensions = ".mbsdf",
                                         .recognise = recognise,
                                         .read = read_mbsdf,
                                         .write_table = write_mbsdf,
                                         .halves = 1u << GONIO_REFLECTION | 1u << GONIO_TRANSMISSION,
                                         .aliases = aliases,
                                         .quantity = "f_r, 1/sr",
                                         .convention =
                                             "cells' centres; azimuth 0 is the light's side, the mirror at 180 deg",
                                         .precision = 0x1p-23};
