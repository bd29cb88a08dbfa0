// SPDX-License-Identifier: BSD-3-Clause
// RGL/EPFL's adaptively parameterised BRDF files (docs/formats.md): container, evaluation, as samples and as a model.
//
// Dupuy & Jakob, "An adaptive parameterization for efficient material acquisition and rendering" (2018), eq. 9 ff.: the
// stored spectra live on the unit square of a warp that the visible-normal distribution `vndf` defines, so
//   f_r cos(theta_o) = rgb(g(u_m); theta_i, phi_i) ndf(u_m) / (4 sigma(u_i)),
// u_m and u_i being the half vector and the incident direction in (u_theta, u_phi) = (sqrt(2 theta/pi), (phi + pi)/(2
// pi)) and g the inverse of the sampling map of vndf: bilinear density, marginal over rows, then within the row. Every
// field is interpolated linearly over theta_i and phi_i. rgb has out-of-gamut negatives, raised to 0 as the published
// evaluator does; the cosine is divided out here.
//
// Up to two phi_i are an isotropic file, whose half vector's azimuth counts from the light's. With more it is
// anisotropic and counts from the mark; a file over half or a quarter of a turn, [-pi, 0] or [-pi, -pi/2], stands for
// the rest by a half turn or by two mirror planes (Mitsuba 3's `measured` reads it so).
#include <byteswap.h>
#include <endian.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "gonio/plan.h"
#include "io/declaration_words.h"
#include "io/rgl.h"

#define MAGIC "tensor_file"
#define HEADER 18
#define FIELDS_MAX 64
#define TYPE_F32 10

// ---- the container ----

typedef struct field {
    char name[64];
    int ndim, dtype;
    size_t shape[8], count;
    const char *data;
} field;

typedef struct tensor_file {
    const gonio_source *source;
    field fields[FIELDS_MAX];
    int n;
} tensor_file;

static bool recognise(const gonio_source *source) {
    return source->size >= sizeof MAGIC && memcmp(source->data, MAGIC, sizeof MAGIC) == 0;
}

static uint64_t little(const char *at, int bytes) {
    uint64_t value = 0;
    for (int k = bytes - 1; k >= 0; k--) {
        value = value << 8 | (unsigned char)at[k];
    }
    return value;
}

static size_t type_size(int dtype) {
    static const size_t sizes[] = {0, 1, 1, 2, 2, 4, 4, 8, 8, 2, 4, 8};
    return dtype >= 1 && dtype <= 11 ? sizes[dtype] : 0;
}

static gonio_status bad(const tensor_file *file, size_t byte, gonio_error *error, const char *what) {
    return gonio_fail_byte(error, GONIO_E_INPUT, file->source->path, (long long)byte, "%s", what);
}

// One field's description at *at, which moves on; its data are checked to lie inside the file.
static gonio_status parse_field(const tensor_file *file, size_t *at, field *f, gonio_error *error) {
    const char *data = file->source->data;
    const size_t size = file->source->size, begin = *at;
    if (size - *at < 2) {
        return bad(file, begin, error, "the file ends inside a field's description");
    }
    const size_t length = little(data + *at, 2);
    *at += 2;
    if (size - *at < length + 11) {
        return bad(file, begin, error, "the file ends inside a field's description");
    }
    if (length == 0 || length >= sizeof f->name) {
        return bad(file, begin, error, "a field's name should have 1 to 63 bytes");
    }
    memcpy(f->name, data + *at, length);
    f->name[length] = 0;
    *at += length;
    f->ndim = (int)little(data + *at, 2);
    f->dtype = (unsigned char)data[*at + 2];
    const uint64_t offset = little(data + *at + 3, 8);
    *at += 11;
    if (f->ndim < 1 || f->ndim > 8 || type_size(f->dtype) == 0) {
        return bad(file, begin, error, "a field should have 1 to 8 dimensions and a type of 1 to 11");
    }
    if (size - *at < 8 * (size_t)f->ndim) {
        return bad(file, begin, error, "the file ends inside a field's description");
    }
    f->count = 1;
    for (int k = 0; k < f->ndim; k++, *at += 8) {
        const uint64_t extent = little(data + *at, 8);
        if (extent == 0 || extent > size / f->count) {
            return bad(file, *at, error, "a field has a size of 0 or beyond the file's");
        }
        f->shape[k] = extent;
        f->count *= extent;
    }
    const size_t bytes = f->count * type_size(f->dtype);
    if (offset > size || bytes > size - offset) {
        return bad(file, begin, error, "a field's data lie beyond the end of the file (is it truncated?)");
    }
    f->data = data + offset;
    return GONIO_OK;
}

// A field beside the published ones that speaks of units, factors or the like declares what nobody here would heed.
static gonio_status check_names(const tensor_file *file, gonio_error *error) {
    static const char *const known[] = {"phi_i", "theta_i", "sigma",       "ndf",      "vndf",        "luminance",
                                        "rgb",   "spectra", "wavelengths", "jacobian", "description", NULL};
    for (int k = 0; k < file->n; k++) {
        const char *name = file->fields[k].name;
        int at = 0;
        while (known[at] != NULL && strcmp(known[at], name) != 0) {
            at++;
        }
        if (known[at] == NULL && gonio_declaration_weight(name) != NULL) {
            return gonio_fail_byte(error, GONIO_E_INPUT, file->source->path, HEADER,
                                   "a field '%s', which could change the values and is not known here", name);
        }
    }
    return GONIO_OK;
}

static gonio_status parse_container(const gonio_source *source, tensor_file *file, gonio_error *error) {
    *file = (tensor_file){.source = source};
    if (source->size < HEADER) {
        return bad(file, source->size, error, "the file ends inside its header");
    }
    if (source->data[12] != 1) {
        return bad(file, 12, error, "an unknown version of the tensor file; expected 1.x");
    }
    const uint64_t count = little(source->data + 14, 4);
    if (bswap_32((uint32_t)count) <= FIELDS_MAX && count > FIELDS_MAX) {
        return bad(file, 14, error, "its numbers are big-endian; a tensor file is little-endian");
    }
    if (count > FIELDS_MAX) {
        return bad(file, 14, error, "more than 64 fields");
    }
    size_t at = HEADER;
    for (uint64_t k = 0; k < count; k++) {
        const gonio_status status = parse_field(file, &at, &file->fields[file->n], error);
        if (status != GONIO_OK) {
            return status;
        }
        file->n++;
    }
    return check_names(file, error);
}

static const field *find(const tensor_file *file, const char *name) {
    for (int k = 0; k < file->n; k++) {
        if (strcmp(file->fields[k].name, name) == 0) {
            return &file->fields[k];
        }
    }
    return NULL;
}

// A float32 field of that many dimensions.
static gonio_status require(const tensor_file *file, const char *name, int ndim, const field **out,
                            gonio_error *error) {
    *out = find(file, name);
    if (*out == NULL || (*out)->dtype != TYPE_F32 || (*out)->ndim != ndim) {
        return gonio_fail_byte(error, GONIO_E_INPUT, file->source->path, HEADER,
                               "expected a float32 field '%s' of %d dimensions, found %s", name, ndim,
                               *out != NULL ? "another type or shape" : "none");
    }
    return GONIO_OK;
}

static float float_at(const field *f, size_t index) {
    const uint32_t raw = (uint32_t)little(f->data + 4 * index, 4);
    float value;
    memcpy(&value, &raw, 4);
    return value;
}

// ---- building ----

// The last two dimensions are an image, the ones before it slices. The copy's values must be finite.
static gonio_status copy_stack(const tensor_file *file, const field *f, gonio_rgl_stack *s, gonio_error *error) {
    s->h = f->shape[f->ndim - 2];
    s->w = f->shape[f->ndim - 1];
    if (s->h < 2 || s->w < 2) {
        return gonio_fail_byte(error, GONIO_E_INPUT, file->source->path, HEADER,
                               "field '%s': expected at least 2 x 2 values, found %zu x %zu", f->name, s->h, s->w);
    }
    s->slices = f->count / (s->h * s->w);
    s->values = malloc(f->count * sizeof *s->values);
    if (s->values == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for field '%s' (%zu values)", f->name, f->count);
    }
    for (size_t i = 0; i < f->count; i++) {
        s->values[i] = float_at(f, i);
        if (!isfinite(s->values[i])) {
            return gonio_fail_byte(error, GONIO_E_INPUT, file->source->path,
                                   f->data - file->source->data + (long long)(4 * i),
                                   "field '%s': expected finite numbers, found %g", f->name, (double)s->values[i]);
        }
    }
    return GONIO_OK;
}

// Ascending angles, rad.
static gonio_status copy_angles(const tensor_file *file, const field *f, double low, double high, double **out,
                                size_t *n, gonio_error *error) {
    *n = f->count;
    double *angles = malloc(f->count * sizeof *angles);
    *out = angles;
    if (angles == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu angles", f->count);
    }
    for (size_t k = 0; k < f->count; k++) {
        angles[k] = (double)float_at(f, k);
        if (!(angles[k] >= (k > 0 ? angles[k - 1] + 1e-9 : low) && angles[k] <= high)) {
            return gonio_fail_byte(
                error, GONIO_E_INPUT, file->source->path, f->data - file->source->data + (long long)(4 * k),
                "field '%s': expected ascending angles of %g to %g, found %g", f->name, low, high, angles[k]);
        }
    }
    return GONIO_OK;
}

#define TURN_SLACK 1e-3 // of angles in single precision

// What part of a turn the phi_i of an anisotropic file cover.
static gonio_status set_reduction(const tensor_file *file, gonio_rgl *m, gonio_error *error) {
    m->reduction = 1;
    m->head.isotropic = m->n_phi <= 2;
    if (m->head.isotropic) {
        return GONIO_OK;
    }
    const double first = m->phi_i[0], last = m->phi_i[m->n_phi - 1];
    for (m->reduction = 1; m->reduction <= 4; m->reduction *= 2) {
        if (fabs(first + GONIO_PI) < TURN_SLACK && fabs(last - first - 2 * GONIO_PI / m->reduction) < TURN_SLACK) {
            return GONIO_OK;
        }
    }
    return gonio_fail_byte(error, GONIO_E_INPUT, file->source->path, HEADER,
                           "phi_i of %g to %g; expected -pi to pi, to 0 or to -pi/2", first, last);
}

static gonio_status name_channels(const tensor_file *file, gonio_rgl *m, gonio_error *error) {
    const int n = m->head.channels;
    m->names = calloc((size_t)n, sizeof *m->names);
    if (m->names == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %d channels", n);
    }
    const field *wavelengths = find(file, "wavelengths");
    const bool named = wavelengths != NULL && wavelengths->dtype == TYPE_F32 && wavelengths->count == (size_t)n;
    for (int c = 0; c < n; c++) {
        if (named) {
            gonio_number_format(m->names[c], sizeof m->names[c], "%.7gnm", (double)float_at(wavelengths, (size_t)c));
        } else if (n == 3) {
            snprintf(m->names[c], sizeof m->names[c], "%c", "rgb"[c]);
        } else {
            snprintf(m->names[c], sizeof m->names[c], "c%d", c + 1);
        }
    }
    m->head.channel_names = (const char(*)[32])m->names;
    return GONIO_OK;
}

static gonio_status load(const tensor_file *file, gonio_rgl *m, gonio_error *error) {
    const bool spectral = find(file, "spectra") != NULL;
    static const char *const names[6] = {"phi_i", "theta_i", "sigma", "ndf", "vndf", "rgb"};
    static const int ndims[6] = {1, 1, 2, 2, 4, 5};
    const field *f[6];
    for (int k = 0; k < 6; k++) {
        const gonio_status status = require(file, k == 5 && spectral ? "spectra" : names[k], ndims[k], &f[k], error);
        if (status != GONIO_OK) {
            return status;
        }
    }
    const size_t turns = f[0]->count, n = f[1]->count, channels = f[5]->shape[2];
    if (f[4]->shape[0] != turns || f[4]->shape[1] != n || f[5]->shape[0] != turns || f[5]->shape[1] != n ||
        channels > GONIO_CHANNELS_MAX) {
        return bad(file, HEADER, error, "the fields' shapes do not fit together");
    }
    m->head.channels = (int)channels;
    const field *jacobian = find(file, "jacobian");
    m->jacobian = jacobian == NULL || jacobian->data[0] != 0;
    gonio_status status = copy_angles(file, f[0], -3.2, 6.3, &m->phi_i, &m->n_phi, error);
    status = status == GONIO_OK ? copy_angles(file, f[1], 0, 1.6, &m->theta_i, &m->n_theta, error) : status;
    status = status == GONIO_OK ? set_reduction(file, m, error) : status;
    gonio_rgl_stack *const stacks[4] = {&m->sigma, &m->ndf, &m->vndf, &m->spectra};
    for (int k = 0; k < 4 && status == GONIO_OK; k++) {
        status = copy_stack(file, f[k + 2], stacks[k], error);
        m->head.bytes += f[k + 2]->count * sizeof(float);
    }
    status = status == GONIO_OK ? gonio_rgl_integrate(m, file->source->path, error) : status;
    m->head.bytes += f[4]->count * sizeof(float);
    m->head.control_points = f[5]->count / channels;
    return status == GONIO_OK ? name_channels(file, m, error) : status;
}

static gonio_status table_rgl(const gonio_source *source, gonio_model **out, gonio_error *error) {
    tensor_file *file = malloc(sizeof *file);
    gonio_rgl *m = calloc(1, sizeof *m);
    gonio_status status;
    if (file == NULL || m == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to read %s", source->path);
    } else {
        m->head.ops = &gonio_rgl_ops;
        status = parse_container(source, file, error);
    }
    status = status == GONIO_OK ? load(file, m, error) : status;
    if (status != GONIO_OK && m != NULL) {
        gonio_model_free(&m->head);
        m = NULL;
    }
    free(file);
    *out = status == GONIO_OK ? &m->head : NULL;
    return status;
}

// ---- samples ----

static gonio_status read_rgl(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                             gonio_read_report *report, gonio_error *error) {
    gonio_model *model;
    gonio_status status = table_rgl(source, &model, error);
    if (status != GONIO_OK) {
        return status;
    }
    char text[64];
    snprintf(text, sizeof text, "nusselt:%zu%s", values->at[0].count, model->isotropic ? "" : ",anisotropic=1");
    gonio_plan *plan;
    status = gonio_plan_make(text, values->seed, &plan, error);
    if (status == GONIO_OK) {
        status = gonio_samples_of_model(model, plan->poses, plan->n, values->threads, out, error);
        gonio_plan_free(plan);
    }
    if (status == GONIO_OK && report != NULL) {
        *report = (gonio_read_report){.format = "rgl", .rows = (*out)->n, .first_negative_line = -1};
    }
    gonio_model_free(model);
    return status;
}

// 100,000 pairs, stratified in Nusselt coordinates: 46 a unit, where the file's own tables have 32.
static const gonio_format_option options[] = {
    {"limit", GONIO_FORMAT_COUNT, "N", "100k", "at most about N samples of a table"}, {0}};

// pbrt ends at a file without spectra.
static const gonio_format_alias aliases[] = {{"mitsuba", NULL, NULL}, {"pbrt", "rgl-channels", "spectra"}, {0}};

const gonio_format gonio_format_rgl = {.name = "rgl",
                                       .summary = "RGL/EPFL table",
                                       .extensions = ".bsdf",
                                       .recognise = recognise,
                                       .read = read_rgl,
                                       .table = table_rgl,
                                       .write_table = gonio_rgl_write,
                                       .write_options = gonio_rgl_write_options,
                                       .quantity = "f_r cos(theta_o) over ndf / (4 sigma), f_r in 1/sr",
                                       .convention = "half vector's angles from the incident azimuth, or from the "
                                                     "mark where there are many phi_i",
                                       .aliases = aliases,
                                       .theta_max_deg = 89,
                                       .fitted = true,
                                       .options = options};
