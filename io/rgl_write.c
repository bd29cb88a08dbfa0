// SPDX-License-Identifier: BSD-3-Clause
// Writing a model as an RGL file (io/rgl.c has the formula).
//
// A reader takes any positive ndf, sigma and vndf; they only say how the square of the values is stretched. ndf is the
// model's own mean over a few difference angles at each half vector, so that what is left over is smooth; sigma is 1;
// vndf is ndf max(0, wi . m) over the half vectors' square and, where wi . m > 0, as much that is even, since a lobe
// near the pole, small in area, would get few nodes; with a floor, since a row of zeros has no direction.
//
// The nodes' values are those of io/rgl_fit.c.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread_pool.h"
#include "base/vector.h"
#include "io/rgl.h"

#define THETA_MAX_DEG 89.0 // of the last incident angle
#define FLOOR 1e-6         // of ndf's and vndf's maximum
// Part of vndf that is the same everywhere, of the rest's mean: of 0, 0.3, 1 and 3 the least 95 % error on sharp and
// broad lobes.
#define EVEN 1.0
#define NDF_SIDE 128
#define ISOTROPIC_BYTES 2000000
#define ANISOTROPIC_BYTES 20000000
#define SPECTRAL_BYTES 12000000

enum { CHANNELS_AUTO, CHANNELS_RGB, CHANNELS_SPECTRA };

const gonio_format_option gonio_rgl_write_options[] = {
    {"rgl-channels", GONIO_FORMAT_CHOICE, "auto|rgb|spectra", "auto",
     "what the file holds (auto: spectra where every channel is a wavelength); pbrt reads spectra alone"},
    {0}};

// ---- sizes ----

typedef struct sizes {
    size_t phi, theta, values, vndf;
} sizes;

static size_t bytes_of(const sizes *s, size_t channels) {
    return 4 * s->phi * s->theta * (s->vndf * s->vndf + (channels + 1) * s->values * s->values);
}

static sizes scaled_sizes(size_t side, bool isotropic) {
    return isotropic ? (sizes){1, side * 3 / 8 > 6 ? side * 3 / 8 : 6, side, side}
                     : (sizes){side * 6 / 5 + 1, side * 3 / 10 > 6 ? side * 3 / 10 : 6, side, side};
}

// The largest that stay within the bytes.
static gonio_status choose_sizes(const gonio_model *model, size_t max_bytes, sizes *s, gonio_error *error) {
    size_t side = 8;
    const size_t channels = (size_t)model->channels;
    *s = scaled_sizes(side, model->isotropic);
    if (bytes_of(s, channels) + 4096 > max_bytes) {
        return gonio_fail(error, GONIO_E_RANGE, "max-bytes %zu; the smallest RGL table of this model has %zu",
                          max_bytes, bytes_of(s, channels) + 4096);
    }
    for (; side < 512; side += 4) {
        const sizes next = scaled_sizes(side + 4, model->isotropic);
        if (bytes_of(&next, channels) + 4096 > max_bytes) {
            break;
        }
        *s = next;
    }
    return GONIO_OK;
}

// ---- the stretch ----

static double mean_of(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo) {
    double values[GONIO_CHANNELS_MAX], all = 0;
    gonio_model_eval(model, wi, wo, values);
    for (int c = 0; c < model->channels; c++) {
        all += fmax(values[c], 0) / model->channels;
    }
    return all;
}

// Over pairs whose half vector is m and whose difference angle is small enough for both to lie above the horizon.
static double facets_of(const gonio_model *model, gonio_vec3 m) {
    static const double tilts[] = {0.05, 0.3, 0.6};
    const gonio_vec3 east = normalised(cross((gonio_vec3){0, 1, 0}, m)), north = cross(m, east);
    double all = 0;
    int n = 0;
    for (int k = 0; k < 12; k++) {
        const gonio_vec3 d = gonio_direction(tilts[k / 4], GONIO_PI / 4 + GONIO_PI / 2 * (k % 4));
        const gonio_vec3 up = scaled(m, d.z), side = sum(scaled(east, d.x), scaled(north, d.y));
        const gonio_vec3 wi = sum(up, side), wo = difference(up, side);
        if (wi.z > 0.02 && wo.z > 0.02) {
            all += mean_of(model, wi, wo);
            n++;
        }
    }
    return n > 0 ? all / n : 0;
}

static double theta_of(double u) { return GONIO_PI / 2 * u * u; }
static double phi_of(double u) { return (2 * u - 1) * GONIO_PI; }

typedef struct job {
    const gonio_model *model;
    gonio_rgl *m;
} job;

static void fill_ndf_row(void *context, size_t row) {
    const job *j = context;
    const gonio_rgl_stack *ndf = &j->m->ndf;
    const double phi = phi_of((double)row / (double)(ndf->h - 1));
    double last = 0;
    for (size_t x = 0; x < ndf->w; x++) {
        const double found = facets_of(j->model, gonio_direction(theta_of((double)x / (double)(ndf->w - 1)), phi));
        last = found > 0 ? found : last; // too steep for any pair: as the steepest that is not
        ndf->values[row * ndf->w + x] = (float)last;
    }
}

static void lift(float *values, size_t n) {
    float largest = 0;
    for (size_t k = 0; k < n; k++) {
        largest = fmaxf(largest, values[k]);
    }
    const float least = largest > 0 ? (float)FLOOR * largest : 1;
    for (size_t k = 0; k < n; k++) {
        values[k] = fmaxf(values[k], least);
    }
}

static gonio_vec3 slice_wi(const gonio_rgl *m, size_t slice) {
    const double theta = m->theta_i[slice % m->n_theta];
    return gonio_direction(theta, m->phi_i[slice / m->n_theta]);
}

static void fill_vndf_slice(void *context, size_t slice) {
    const job *j = context;
    const gonio_rgl_stack *v = &j->m->vndf;
    float *values = v->values + slice * v->w * v->h;
    const gonio_vec3 wi = slice_wi(j->m, slice);
    double sum = 0, seen = 0;
    for (size_t y = 0; y < v->h; y++) {
        for (size_t x = 0; x < v->w; x++) {
            const double ux = (double)x / (double)(v->w - 1), uy = (double)y / (double)(v->h - 1);
            const gonio_vec3 facet = gonio_direction(theta_of(ux), phi_of(uy));
            const double ndf = gonio_rgl_bilinear(&j->m->ndf, 0, ux, uy);
            const double visible = fmax(dot(wi, facet), 0);
            values[y * v->w + x] = (float)(ndf * visible * sin(theta_of(ux)) * ux);
            sum += (double)values[y * v->w + x];
            seen += visible > 0;
        }
    }
    for (size_t k = 0; k < v->w * v->h && seen > 0; k++) {
        const gonio_vec3 facet = gonio_direction(theta_of((double)(k % v->w) / (double)(v->w - 1)),
                                                 phi_of((double)(k / v->w) / (double)(v->h - 1)));
        values[k] += dot(wi, facet) > 0 ? (float)(EVEN * sum / seen) : 0;
    }
    lift(values, v->w * v->h);
}

// ---- the values ----

// The values at a slice's nodes, as the model has them there.
static void fill_values_slice(void *context, size_t slice) {
    const job *j = context;
    const gonio_rgl_stack *s = &j->m->spectra;
    const size_t channels = (size_t)j->model->channels, area = s->w * s->h;
    const gonio_vec3 wi = slice_wi(j->m, slice);
    double values[GONIO_CHANNELS_MAX], u[2];
    for (size_t k = 0; k < area; k++) {
        gonio_rgl_warp(j->m, slice, (double)(k % s->w) / (double)(s->w - 1), (double)(k / s->w) / (double)(s->h - 1),
                       u);
        gonio_vec3 wo = gonio_rgl_mirrored(wi, u);
        wo.z = fmax(wo.z, GONIO_RGL_COSINE_LEAST);
        wo = normalised(wo);
        const double per_scale = wo.z * 4 / gonio_rgl_bilinear(&j->m->ndf, 0, u[0], u[1]);
        gonio_model_eval(j->model, wi, wo, values);
        for (size_t c = 0; c < channels; c++) {
            s->values[(slice * channels + c) * area + k] = (float)(fmax(values[c], 0) * per_scale);
        }
    }
}

// ---- the file ----

typedef struct field {
    const char *name;
    int ndim;
    unsigned char type; // 1: u8, 10: f32
    size_t shape[5];
    const void *data;
} field;

static void put_little(FILE *stream, uint64_t value, int bytes) {
    for (int k = 0; k < bytes; k++) {
        fputc((int)(value >> (8 * k) & 255), stream);
    }
}

static size_t count_of(const field *f) {
    size_t n = 1;
    for (int d = 0; d < f->ndim; d++) {
        n *= f->shape[d];
    }
    return n;
}

static void put_data(FILE *stream, const field *f) {
    const size_t n = count_of(f);
    if (f->type == 1) {
        fwrite(f->data, 1, n, stream);
        return;
    }
    for (size_t k = 0; k < n; k++) {
        uint32_t bits;
        memcpy(&bits, (const float *)f->data + k, 4);
        put_little(stream, bits, 4);
    }
}

static size_t aligned(size_t n) { return (n + 7) / 8 * 8; }

static void put_fields(FILE *stream, const field *fields, int n) {
    size_t at = 18;
    for (int k = 0; k < n; k++) {
        at += 2 + strlen(fields[k].name) + 2 + 1 + 8 + 8 * (size_t)fields[k].ndim;
    }
    fwrite("tensor_file\0\1\0", 1, 14, stream);
    put_little(stream, (uint64_t)n, 4);
    size_t offset = aligned(at);
    for (int k = 0; k < n; k++) {
        put_little(stream, strlen(fields[k].name), 2);
        fputs(fields[k].name, stream);
        put_little(stream, (uint64_t)fields[k].ndim, 2);
        fputc(fields[k].type, stream);
        put_little(stream, offset, 8);
        for (int d = 0; d < fields[k].ndim; d++) {
            put_little(stream, fields[k].shape[d], 8);
        }
        offset = aligned(offset + count_of(&fields[k]) * (fields[k].type == 1 ? 1 : 4));
    }
    for (int k = 0; k < n; k++) {
        for (; at % 8 != 0; at++) {
            fputc(0, stream);
        }
        put_data(stream, &fields[k]);
        at += count_of(&fields[k]) * (fields[k].type == 1 ? 1 : 4);
    }
}

// The mean over the channels: what readers draw directions by.
static float *luminance_of(const gonio_rgl *m) {
    const size_t slices = m->n_phi * m->n_theta, area = m->spectra.w * m->spectra.h, c = (size_t)m->head.channels;
    float *out = malloc(slices * area * sizeof *out);
    for (size_t slice = 0; out != NULL && slice < slices; slice++) {
        for (size_t k = 0; k < area; k++) {
            double all = 0;
            for (size_t i = 0; i < c; i++) {
                all += fmax((double)m->spectra.values[(slice * c + i) * area + k], 0) / (double)c;
            }
            out[slice * area + k] = (float)all;
        }
        lift(out + slice * area, area);
    }
    return out;
}

static bool is_spectral(const gonio_model *model) {
    for (int c = 0; c < model->channels; c++) {
        if (isnan(gonio_model_wavelength_nm(model, c)) ||
            (c > 0 && !(gonio_model_wavelength_nm(model, c) > gonio_model_wavelength_nm(model, c - 1)))) {
            return false;
        }
    }
    return model->channels > 1;
}

static gonio_status put_model(const gonio_rgl *m, FILE *stream, gonio_error *error) {
    static const char description[] = "Written by Gonio";
    static const unsigned char one = 1;
    const size_t phi = m->n_phi, theta = m->n_theta, c = (size_t)m->head.channels;
    const bool spectral = is_spectral(&m->head);
    float *luminance = luminance_of(m), angles[2][1024], nm[GONIO_CHANNELS_MAX];
    if (luminance == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for an RGL table");
    }
    for (size_t k = 0; k < phi && k < 1024; k++) {
        angles[0][k] = (float)m->phi_i[k];
    }
    for (size_t k = 0; k < theta && k < 1024; k++) {
        angles[1][k] = (float)m->theta_i[k];
    }
    for (size_t k = 0; k < c; k++) {
        nm[k] = (float)gonio_model_wavelength_nm(&m->head, (int)k);
    }
    const gonio_rgl_stack *s = &m->spectra, *v = &m->vndf;
    const unsigned char jacobian = m->jacobian ? one : 0;
    const field fields[] = {
        {"description", 1, 1, {sizeof description - 1}, description},
        {"phi_i", 1, 10, {phi}, angles[0]},
        {"theta_i", 1, 10, {theta}, angles[1]},
        {"ndf", 2, 10, {m->ndf.h, m->ndf.w}, m->ndf.values},
        {"sigma", 2, 10, {m->sigma.h, m->sigma.w}, m->sigma.values},
        {"vndf", 4, 10, {phi, theta, v->h, v->w}, v->values},
        {"luminance", 4, 10, {phi, theta, s->h, s->w}, luminance},
        {"jacobian", 1, 1, {1}, &jacobian},
        {spectral ? "spectra" : "rgb", 5, 10, {phi, theta, c, s->h, s->w}, s->values},
        {"wavelengths", 1, 10, {c}, nm},
    };
    put_fields(stream, fields, spectral ? 10 : 9);
    free(luminance);
    return GONIO_OK;
}

// ---- the whole ----

static float *ones(size_t n) {
    float *values = malloc(n * sizeof *values);
    for (size_t k = 0; values != NULL && k < n; k++) {
        values[k] = 1;
    }
    return values;
}

static gonio_rgl *allocate(const gonio_model *model, const sizes *z, gonio_error *error) {
    gonio_rgl *m = calloc(1, sizeof *m);
    if (m == NULL) {
        gonio_fail(error, GONIO_E_MEMORY, "no memory for an RGL table");
        return NULL;
    }
    const size_t slices = z->phi * z->theta, c = (size_t)model->channels, turns = model->isotropic ? 2 : NDF_SIDE;
    m->head = (gonio_model){.ops = &gonio_rgl_ops, .channels = model->channels, .isotropic = model->isotropic};
    m->reduction = 1;
    m->jacobian = true;
    m->n_phi = z->phi;
    m->n_theta = z->theta;
    m->phi_i = calloc(z->phi, sizeof *m->phi_i);
    m->theta_i = calloc(z->theta, sizeof *m->theta_i);
    m->ndf = (gonio_rgl_stack){1, turns, NDF_SIDE, ones(turns * NDF_SIDE)};
    m->sigma = (gonio_rgl_stack){1, 2, 2, ones(4)};
    m->vndf = (gonio_rgl_stack){slices, z->vndf, z->vndf, ones(slices * z->vndf * z->vndf)};
    m->spectra = (gonio_rgl_stack){slices * c, z->values, z->values, ones(slices * c * z->values * z->values)};
    m->names = malloc(c * sizeof *m->names);
    if (m->phi_i == NULL || m->theta_i == NULL || m->ndf.values == NULL || m->sigma.values == NULL ||
        m->vndf.values == NULL || m->spectra.values == NULL || m->names == NULL) {
        gonio_model_free(&m->head);
        gonio_fail(error, GONIO_E_MEMORY, "no memory for an RGL table");
        return NULL;
    }
    memcpy(m->names, model->channel_names, c * sizeof *m->names);
    m->head.channel_names = (const char(*)[32])m->names;
    for (size_t k = 0; k < z->theta; k++) {
        m->theta_i[k] = (double)(float)gonio_radians(THETA_MAX_DEG * (double)k / (double)(z->theta - 1));
    }
    for (size_t k = 0; k < z->phi && z->phi > 1; k++) {
        m->phi_i[k] = (double)(float)(-GONIO_PI + 2 * GONIO_PI * (double)k / (double)(z->phi - 1));
    }
    return m;
}

static gonio_status fill(const gonio_model *model, gonio_rgl *m, int threads, gonio_error *error) {
    job j = {model, m};
    const size_t slices = m->n_phi * m->n_theta;
    gonio_pool_for(threads, m->ndf.h, fill_ndf_row, &j);
    lift(m->ndf.values, m->ndf.w * m->ndf.h);
    gonio_pool_for(threads, slices, fill_vndf_slice, &j);
    gonio_status status = gonio_rgl_integrate(m, "an RGL table", error);
    if (status == GONIO_OK) {
        gonio_pool_for(threads, slices, fill_values_slice, &j);
        status = gonio_rgl_refine(model, m, threads, error);
    }
    return status;
}

static gonio_status write_new(const gonio_model *model, const gonio_format_values *values, FILE *stream,
                              gonio_write_report *told, gonio_error *error) {
    const size_t standard = model->channels > 3 ? SPECTRAL_BYTES
                            : model->isotropic  ? ISOTROPIC_BYTES
                                                : ANISOTROPIC_BYTES;
    sizes z;
    gonio_status status = choose_sizes(model, values->max_bytes > 0 ? values->max_bytes : standard, &z, error);
    gonio_rgl *m = status == GONIO_OK ? allocate(model, &z, error) : NULL;
    if (m == NULL) {
        return status == GONIO_OK ? GONIO_E_MEMORY : status;
    }
    status = fill(model, m, values->threads, error);
    status = status == GONIO_OK ? put_model(m, stream, error) : status;
    snprintf(told->about, sizeof told->about,
             "%zu x %zu incident directions, values %zu x %zu, stretched over %zu x %zu; %s", z.phi, z.theta, z.values,
             z.values, z.vndf, z.vndf, is_spectral(model) ? "spectra" : "rgb");
    gonio_model_free(&m->head);
    return status;
}

// The model as rgb or as spectra; it and *between are to be freed where they are not the model.
static gonio_status as_channels(const gonio_model *model, int choice, gonio_model **between, gonio_model **out,
                                gonio_write_report *told, gonio_error *error) {
    *between = *out = (gonio_model *)(uintptr_t)model;
    const bool spectral = is_spectral(model);
    if (spectral && choice != CHANNELS_RGB) {
        return GONIO_OK;
    }
    gonio_status status = gonio_model_as_rgb(model, between, error);
    *out = *between;
    gonio_write_lost_channels(model, 3, told);
    if (status == GONIO_OK && choice == CHANNELS_SPECTRA) {
        gonio_write_lost(told, "the spectra are smooth ones of the colour, not measured");
        status = gonio_model_as_spectra(*between, out, error);
    }
    return status;
}

gonio_status gonio_rgl_write(const gonio_model *model, const gonio_format_values *values, FILE *stream,
                             gonio_write_report *told, gonio_error *error) {
    const gonio_rgl *own = model->ops == &gonio_rgl_ops ? (const gonio_rgl *)model : NULL;
    if (own != NULL && own->n_phi <= 1024 && own->n_theta <= 1024 && values->max_bytes == 0 &&
        (values->at[0].choice == CHANNELS_AUTO || is_spectral(model) == (values->at[0].choice == CHANNELS_SPECTRA))) {
        snprintf(told->about, sizeof told->about, "the table as it was read");
        return put_model(own, stream, error);
    }
    gonio_model *between, *written;
    gonio_status status = as_channels(model, values->at[0].choice, &between, &written, told, error);
    status = status == GONIO_OK ? write_new(written, values, stream, told, error) : status;
    if (written != NULL && written != between) {
        gonio_model_free(written);
    }
    if (between != NULL && between != model) {
        gonio_model_free(between);
    }
    return status;
}
