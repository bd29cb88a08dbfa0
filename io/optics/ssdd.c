// SPDX-License-Identifier: BSD-3-Clause
// SSDD, surface scattering distribution data, version 0.x (K. Ryo, libbsdf's SSDD file format specification 0.3): the
// block of type brdf, ASCII or binary, monochrome, rgb, xyz or spectra, in spherical, specular or half-difference
// coordinates. Blocks of other types behind it are not read; before it they are refused.
#include <endian.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/number.h"
#include "io/optics/grid.h"

static bool recognise(const gonio_source *source) {
    return gonio_source_begins(source, "#", "VERSION") && strstr(source->data, "DATA_TYPE") != NULL;
}

typedef struct ssdd {
    gonio_words words;
    gonio_grid grid;
    bool spectral, has_frame, binary;
    double wavelengths[GONIO_CHANNELS_MAX];
    int n_wavelengths;
} ssdd;

// The words of a list stand on its line: count them, then read them through the common reader.
static gonio_status read_list(ssdd *s, int axis, const char *what, double high, gonio_error *error) {
    char *line = gonio_words_line(&s->words), *copy = strdup(line);
    if (copy == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a list");
    }
    int n = 0;
    for (char *rest = copy, *one; (one = strsep(&rest, " \t\r")) != NULL && *one != '#';) {
        n += *one != 0;
    }
    free(copy);
    s->words.rest = line;
    return gonio_grid_axis_read(&s->grid, axis, &s->words, what, n, 0, high, error);
}

static gonio_status read_wavelengths(ssdd *s, gonio_error *error) {
    char *line = gonio_words_line(&s->words), *end;
    while (line[strspn(line, " \t\r")] != 0) {
        const double nm = gonio_number_parse(line, &end);
        if (end == line || !(nm >= 1 && nm <= 1e6) || s->n_wavelengths == GONIO_CHANNELS_MAX) {
            return gonio_text_fail(&s->words.text, error,
                                   "WAVELENGTH_LIST: expected up to %d wavelengths in nm, found "
                                   "'%.20s'",
                                   GONIO_CHANNELS_MAX, line);
        }
        s->wavelengths[s->n_wavelengths++] = nm;
        line = end;
    }
    return GONIO_OK;
}

static gonio_status read_reduction(ssdd *s, gonio_error *error) {
    char *rest = gonio_words_line(&s->words);
    for (char *one; (one = strsep(&rest, " \t\r")) != NULL;) {
        // Either leaves out what the symmetry tells: the nodes that are there are samples all the same.
        if (*one != 0 && strcmp(one, "bilateral_symmetry") != 0 && strcmp(one, "reciprocity") != 0) {
            return gonio_text_fail(&s->words.text, error,
                                   "REDUCTION_TYPE: expected bilateral_symmetry, reciprocity, found '%.40s'", one);
        }
    }
    return GONIO_OK;
}

static gonio_status read_kind(ssdd *s, const char *word, bool *done, gonio_error *error) {
    int choice;
    gonio_status status;
    if (strcmp(word, "DATA_TYPE") == 0) {
        status = gonio_word_choice(&s->words, "DATA_TYPE", "brdf|btdf", &choice, error);
        s->grid.half = choice == 1 ? GONIO_TRANSMISSION : GONIO_REFLECTION;
        return status;
    }
    if (strcmp(word, "COLOR_MODEL") == 0) {
        status = gonio_word_choice(&s->words, "COLOR_MODEL", "monochrome|rgb|xyz|spectrum", &choice, error);
        s->spectral = choice == 3;
        s->grid.xyz = choice == 2;
        s->grid.channels = choice == 0 ? 1 : 3;
        return status;
    }
    if (strcmp(word, "PARAM_TYPE") == 0) {
        static const gonio_grid_frame frames[] = {GONIO_GRID_ABSOLUTE, GONIO_GRID_SPECULAR, GONIO_GRID_HALF};
        status = gonio_word_choice(
            &s->words, "PARAM_TYPE",
            "spherical_coordinate_system|specular_coordinate_system|half_difference_coordinate_system", &choice, error);
        s->has_frame = status == GONIO_OK;
        s->grid.frame = s->has_frame ? frames[choice] : s->grid.frame;
        return status;
    }
    status = gonio_word_choice(&s->words, "DATA", "ascii|binary", &choice, error);
    s->binary = choice == 1;
    *done = status == GONIO_OK;
    return status;
}

static gonio_status read_entry(ssdd *s, const char *word, bool *done, gonio_error *error) {
    static const struct {
        const char *name;
        int axis;
        double high;
    } lists[] = {{"PARAM0_LIST", GONIO_GRID_IN_THETA, 90},
                 {"PARAM1_LIST", GONIO_GRID_IN_PHI, 360},
                 {"PARAM2_LIST", GONIO_GRID_OUT_THETA, 180},
                 {"PARAM3_LIST", GONIO_GRID_OUT_PHI, 360}};
    static const char *const told[] = {
        "VERSION", "SOFTWARE", "API", "DATE", "NAME", "SOURCE_TYPE", "DEVICE", "CREATION_DATE", "MEASUREMENT_DATE"};
    for (int k = 0; k < 4; k++) {
        if (strcmp(word, lists[k].name) == 0) {
            return read_list(s, lists[k].axis, lists[k].name, lists[k].high, error);
        }
    }
    for (size_t k = 0; k < sizeof told / sizeof *told; k++) {
        if (strcmp(word, told[k]) == 0) {
            gonio_words_line(&s->words);
            return GONIO_OK;
        }
    }
    if (strcmp(word, "WAVELENGTH_LIST") == 0) {
        return read_wavelengths(s, error);
    }
    if (strcmp(word, "REDUCTION_TYPE") == 0) {
        return read_reduction(s, error);
    }
    if (strcmp(word, "DATA_TYPE") == 0 || strcmp(word, "COLOR_MODEL") == 0 || strcmp(word, "PARAM_TYPE") == 0 ||
        strcmp(word, "DATA") == 0) {
        return read_kind(s, word, done, error);
    }
    return gonio_text_fail(&s->words.text, error, "unknown entry '%.40s' of an SSDD file", word);
}

static gonio_status read_header(ssdd *s, gonio_error *error) {
    bool done = false;
    gonio_status status = GONIO_OK;
    while (status == GONIO_OK && !done) {
        const char *word = gonio_word(&s->words);
        status = word != NULL ? read_entry(s, word, &done, error)
                              : gonio_text_fail(&s->words.text, error, "the file ends before its DATA");
    }
    const int channels = s->spectral ? s->n_wavelengths : s->grid.channels;
    if (status == GONIO_OK && (channels == 0 || !s->has_frame)) {
        status = gonio_text_fail(&s->words.text, error, "there is no %s before DATA",
                                 channels > 0  ? "PARAM_TYPE"
                                 : s->spectral ? "WAVELENGTH_LIST"
                                               : "COLOR_MODEL");
    }
    status = status == GONIO_OK ? gonio_grid_channels(&s->grid, channels, error) : status;
    for (int c = 0; status == GONIO_OK && s->spectral && c < channels; c++) {
        gonio_number_format(s->grid.names[c], sizeof s->grid.names[c], "%.10gnm", s->wavelengths[c]);
    }
    status = status == GONIO_OK ? gonio_grid_allocate(&s->grid, &s->words, error) : status;
    s->grid.report.open_end = s->grid.report.open_end && !s->binary;
    return status;
}

// float32 behind the line of DATA.
static gonio_status binary_value(ssdd *s, double *value, gonio_error *error) {
    uint32_t raw;
    if (s->words.text.end - s->words.text.next < (ptrdiff_t)sizeof raw) {
        return gonio_text_fail(&s->words.text, error, "the file ends inside its binary values");
    }
    memcpy(&raw, s->words.text.next, sizeof raw);
    s->words.text.next += sizeof raw;
    raw = le32toh(raw);
    float single;
    memcpy(&single, &raw, sizeof single);
    *value = (double)single;
    if (!isfinite(*value) || (*value < 0 && s->grid.policy < GONIO_NEGATIVES_CLAMP)) {
        return gonio_text_fail(&s->words.text, error, "a binary value is %g; expected a finite number, 0 or more",
                               *value);
    }
    if (*value < 0) {
        s->grid.report.first_negative_line = s->words.text.line;
        s->grid.report.negatives++;
        s->grid.report.clamped += s->grid.policy == GONIO_NEGATIVES_CLAMP;
        *value = s->grid.policy == GONIO_NEGATIVES_CLAMP ? 0 : *value;
    }
    return GONIO_OK;
}

// Colour by colour, parameter 0 fastest.
static gonio_status read_values(ssdd *s, gonio_error *error) {
    const gonio_grid_axis *a = s->grid.axis;
    const size_t n = (size_t)a[0].n * (size_t)a[1].n * (size_t)a[2].n * (size_t)a[3].n;
    gonio_status status = GONIO_OK;
    for (size_t k = 0; status == GONIO_OK && k < n; k++) {
        size_t rest = k;
        const int t = (int)(rest % (size_t)a[GONIO_GRID_IN_THETA].n);
        rest /= (size_t)a[GONIO_GRID_IN_THETA].n;
        const int p = (int)(rest % (size_t)a[GONIO_GRID_IN_PHI].n);
        rest /= (size_t)a[GONIO_GRID_IN_PHI].n;
        const int o = (int)(rest % (size_t)a[GONIO_GRID_OUT_THETA].n);
        const int f = (int)(rest / (size_t)a[GONIO_GRID_OUT_THETA].n);
        for (int c = 0; status == GONIO_OK && c < s->grid.channels; c++) {
            double *to = gonio_grid_at(&s->grid, c, p, t, f, o);
            status = s->binary ? binary_value(s, to, error) : gonio_grid_value(&s->grid, &s->words, to, error);
        }
    }
    return status;
}

// What follows must be a further block: *more, one that is read, of which the word is still to come.
static gonio_status check_end(ssdd *s, bool *more, gonio_error *error) {
    const char *word = gonio_word(&s->words);
    *more = false;
    if (word == NULL) {
        return GONIO_OK;
    }
    if (strcmp(word, "DATA_TYPE") != 0) {
        return gonio_text_fail(&s->words.text, error, "expected the end or a further DATA_TYPE, found '%.40s'", word);
    }
    const char *kind = s->words.rest != NULL ? s->words.rest + strspn(s->words.rest, " \t") : "";
    *more = strncmp(kind, "brdf", 4) == 0 || strncmp(kind, "btdf", 4) == 0;
    return GONIO_OK;
}

// One block of the file; *more: another one of scattering follows, whose DATA_TYPE was read.
static gonio_status read_block(ssdd *s, bool begun, const gonio_source *source, gonio_samples **out, bool *more,
                               gonio_read_report *report, gonio_error *error) {
    bool done;
    gonio_status status = begun ? read_kind(s, "DATA_TYPE", &done, error) : GONIO_OK;
    status = status == GONIO_OK ? read_header(s, error) : status;
    status = status == GONIO_OK ? read_values(s, error) : status;
    status = status == GONIO_OK ? check_end(s, more, error) : status;
    return gonio_grid_end(&s->grid, status, source, "ssdd", out, report, error);
}

static gonio_status read_ssdd(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                              gonio_read_report *report, gonio_error *error) {
    ssdd *s = calloc(1, sizeof *s);
    *out = NULL;
    if (s == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to read %s", source->path);
    }
    const gonio_words words = gonio_words_begin(source, "#");
    s->words = words;
    gonio_status status = GONIO_OK;
    bool more = false, begun = false;
    do {
        // Wavelengths, colours and coordinates are stated once a block.
        const ssdd next = {.words = s->words, .grid = {.policy = (gonio_negatives)values->at[0].choice}};
        *s = next;
        status = read_block(s, begun, source, out, &more, report, error);
        begun = true;
    } while (status == GONIO_OK && more);
    free(s);
    return status;
}

static const gonio_format_option options[] = {GONIO_OPTION_NEGATIVES, {0}};

// ---- writing ----

static void put_list(const gonio_grid *g, int axis, const char *name, FILE *stream) {
    fputs(name, stream);
    for (int k = 0; k < g->axis[axis].n; k++) {
        fprintf(stream, " %.9g", g->axis[axis].deg[k]);
    }
    fputc('\n', stream);
}

static void put_value(double value, bool binary, FILE *stream) {
    if (!binary) {
        fprintf(stream, "%.9g\n", value);
        return;
    }
    const float single = (float)value;
    uint32_t raw;
    memcpy(&raw, &single, sizeof raw);
    raw = htole32(raw);
    fwrite(&raw, sizeof raw, 1, stream);
}

// Colour by colour within a node, parameter 0 fastest, as they are read.
static void put_values(gonio_grid *g, bool binary, FILE *stream) {
    for (int f = 0; f < g->axis[GONIO_GRID_OUT_PHI].n; f++) {
        for (int o = 0; o < g->axis[GONIO_GRID_OUT_THETA].n; o++) {
            for (int p = 0; p < g->axis[GONIO_GRID_IN_PHI].n; p++) {
                for (int t = 0; t < g->axis[GONIO_GRID_IN_THETA].n; t++) {
                    for (int c = 0; c < g->channels; c++) {
                        put_value(gonio_grid_written(g, c, p, t, f, o), binary, stream);
                    }
                }
            }
        }
    }
}

static void put_head(const gonio_grid *g, const gonio_model *model, bool binary, FILE *stream) {
    const bool spectral = !isnan(gonio_model_wavelength_nm(model, 0));
    fprintf(stream, "%sDATA_TYPE %s\nCOLOR_MODEL %s\n", g->first ? "VERSION 0.3\n" : "",
            g->half == GONIO_TRANSMISSION ? "btdf" : "brdf",
            spectral           ? "spectrum"
            : g->channels == 3 ? "rgb"
                               : "monochrome");
    if (spectral) {
        fputs("WAVELENGTH_LIST", stream);
        for (int c = 0; c < g->channels; c++) {
            fprintf(stream, " %.9g", gonio_model_wavelength_nm(model, c));
        }
        fputc('\n', stream);
    }
    fputs("PARAM_TYPE spherical_coordinate_system\n", stream);
    put_list(g, GONIO_GRID_IN_THETA, "PARAM0_LIST", stream);
    put_list(g, GONIO_GRID_IN_PHI, "PARAM1_LIST", stream);
    put_list(g, GONIO_GRID_OUT_THETA, "PARAM2_LIST", stream);
    put_list(g, GONIO_GRID_OUT_PHI, "PARAM3_LIST", stream);
    fprintf(stream, "SOURCE_TYPE measured\nDEVICE Gonio\nDATA %s\n", binary ? "binary" : "ascii");
}

static gonio_status write_block(const gonio_model *model, const gonio_format_values *values, gonio_half half,
                                bool first, FILE *stream, gonio_write_report *told, gonio_error *error) {
    int named = 0;
    for (int c = 0; c < model->channels; c++) {
        named += !isnan(gonio_model_wavelength_nm(model, c));
    }
    gonio_model *written = (gonio_model *)(uintptr_t)model;
    const bool whole = model->channels == 1 || named == model->channels; // as it is
    gonio_status status = whole ? GONIO_OK : gonio_model_as_rgb(model, &written, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_grid g = {.frame = GONIO_GRID_ABSOLUTE, .half = half, .first = first};
    status = gonio_grid_of_model(&g, written, values->at[0].count, false, values->threads, error);
    if (status == GONIO_OK) {
        const bool binary = values->at[1].choice == 1;
        put_head(&g, written, binary, stream);
        put_values(&g, binary, stream);
        if (first) {
            gonio_grid_tell(&g, model, told);
        }
    }
    gonio_grid_free(&g);
    if (written != model) {
        gonio_model_free(written);
    }
    return status;
}

static gonio_status write_ssdd(const gonio_model *model, const gonio_format_values *values, FILE *stream,
                               gonio_write_report *told, gonio_error *error) {
    gonio_status status = GONIO_OK;
    bool first = true;
    for (int h = GONIO_REFLECTION; h <= GONIO_TRANSMISSION && status == GONIO_OK; h++) {
        const gonio_model *half = gonio_written_half(model, values, (gonio_half)h);
        if (half != NULL) {
            status = write_block(half, values, (gonio_half)h, first, stream, told, error);
            first = false;
        }
    }
    return status;
}

static const gonio_format_option write_options[] = {
    GONIO_OPTION_GRID_STEP,
    {"ssdd-data", GONIO_FORMAT_CHOICE, "ascii|binary", "ascii", "how the values are written"},
    {0}};

const gonio_format gonio_format_ssdd = {.name = "ssdd",
                                        .summary = "SSDD",
                                        .extensions = ".ssdd",
                                        .write_table = write_ssdd,
                                        .write_options = write_options,
                                        .halves = 1u << GONIO_REFLECTION | 1u << GONIO_TRANSMISSION,
                                        .quantity = "f_r, 1/sr",
                                        .convention = "degrees; phi_o absolute, the mirror of phi_i = 0 at 180",
                                        .theta_max_deg = GONIO_GRID_WRITE_MAX_DEG,
                                        .precision = 1e-7,
                                        .recognise = recognise,
                                        .read = read_ssdd,
                                        .options = options};
