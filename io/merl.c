// SPDX-License-Identifier: BSD-3-Clause
// MERL's .binary table (Matusik et al. 2003; docs/formats.md), as samples and as a model, read and written.
//
// Three little-endian int32 (90, 90, 180), then a float64 plane for each of r, g, b; a value is multiplied by 1/1500,
// 1.15/1500, 1.66/1500 to give 1/sr. Rusinkiewicz' coordinates: cell k of theta_h covers 90 deg (k/90)^2 to
// 90 deg ((k+1)/90)^2, theta_d and phi_d have cells of one degree, phi_d in [0, 180) since phi_d + 180 is the
// reciprocal pair. Negative: not measured, or below the horizon.
//
// Values are taken to stand at the centres of their cells (the published reader returns the cell's value anywhere in
// it). The model interpolates between nodes, linearly in the three indices, over the valid ones.
//
// Programs that interpolate take the lower edges of the cells for the nodes; so are files written that are asked for by
// --merl-nodes edge, the standard. The last cell, which no pair above the horizon reaches, holds -2 in these. Numbers
// are rounded to 24 bits, so that what is read and written again is the same.
#include <byteswap.h>
#include <endian.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/random.h"
#include "base/thread_pool.h"
#include "io/format.h"

#define N_H 90
#define N_D 90
#define N_P 180
#define CELLS ((size_t)N_H * N_D * N_P)
#define HEADER 12
#define FILE_SIZE (HEADER + 3 * CELLS * 8)
#define INVALID (-1.0)

static const double scale[3] = {1.0 / 1500, 1.15 / 1500, 1.66 / 1500};
static const char names[3][32] = {"r", "g", "b"};

static int32_t dimension(const gonio_source *source, int k) {
    uint32_t raw;
    memcpy(&raw, source->data + 4 * k, 4);
    return (int32_t)le32toh(raw);
}

static int32_t swapped(const gonio_source *source, int k) { return (int32_t)bswap_32((uint32_t)dimension(source, k)); }

static bool is_big_endian(const gonio_source *source) {
    return swapped(source, 0) == N_H && swapped(source, 1) == N_D && swapped(source, 2) == N_P;
}

// Three plausible counts and a zero byte among them, so no text: then it is meant to be such a table.
static bool recognise(const gonio_source *source) {
    if (source->size < HEADER || memchr(source->data, 0, HEADER) == NULL) {
        return false;
    }
    if (is_big_endian(source)) {
        return true; // check says so
    }
    for (int k = 0; k < 3; k++) {
        if (dimension(source, k) < 1) {
            return false;
        }
    }
    return dimension(source, 0) == N_H || dimension(source, 1) == N_D || dimension(source, 2) == N_P;
}

static double number_at(const gonio_source *source, size_t index) {
    uint64_t raw;
    memcpy(&raw, source->data + HEADER + 8 * index, 8);
    raw = le64toh(raw);
    double value;
    memcpy(&value, &raw, 8);
    return value;
}

static gonio_status check(const gonio_source *source, gonio_error *error) {
    if (is_big_endian(source)) {
        return gonio_fail_byte(error, GONIO_E_INPUT, source->path, 0,
                               "its numbers are big-endian; a MERL table is little-endian");
    }
    const int32_t d[3] = {dimension(source, 0), dimension(source, 1), dimension(source, 2)};
    if (d[0] != N_H || d[1] != N_D || d[2] != N_P) {
        return gonio_fail_byte(error, GONIO_E_INPUT, source->path, 0,
                               "dimensions %d x %d x %d; expected %d x %d x %d of a MERL table", d[0], d[1], d[2], N_H,
                               N_D, N_P);
    }
    if (source->size != FILE_SIZE) {
        return gonio_fail_byte(error, GONIO_E_INPUT, source->path, (long long)source->size,
                               "the file has %zu bytes; a MERL table has %zu", source->size, FILE_SIZE);
    }
    for (size_t i = 0; i < 3 * CELLS; i++) {
        if (!isfinite(number_at(source, i))) {
            return gonio_fail_byte(error, GONIO_E_INPUT, source->path, (long long)(HEADER + 8 * i),
                                   "expected a finite number, found %g: not measured is written as a negative one",
                                   number_at(source, i));
        }
    }
    return GONIO_OK;
}

// ---- geometry ----

static gonio_vec3 turned_about_y(gonio_vec3 v, double angle) {
    const double c = cos(angle), s = sin(angle);
    return (gonio_vec3){c * v.x + s * v.z, v.y, c * v.z - s * v.x};
}

// The directions of fractional indices (cell centres at + 0.5), half vector at azimuth 0.
static void directions(double h, double d, double p, gonio_vec3 *wi, gonio_vec3 *wo) {
    const double theta_h = (h / N_H) * (h / N_H) * GONIO_PI / 2;
    const gonio_vec3 half = gonio_direction(theta_h, 0);
    const gonio_vec3 difference = gonio_direction(d / N_D * GONIO_PI / 2, p / N_P * GONIO_PI);
    *wi = turned_about_y(difference, theta_h);
    const double dot = 2 * (wi->x * half.x + wi->z * half.z);
    *wo = (gonio_vec3){dot * half.x - wi->x, dot * half.y - wi->y, dot * half.z - wi->z};
}

// Fractional indices of a pair; p in [0, N_P).
static void indices(gonio_vec3 wi, gonio_vec3 wo, double *h, double *d, double *p) {
    const gonio_vec3 sum = {wi.x + wo.x, wi.y + wo.y, wi.z + wo.z};
    const double length = sqrt(sum.x * sum.x + sum.y * sum.y + sum.z * sum.z);
    const double sin_h = hypot(sum.x, sum.y);
    *h = N_H * sqrt(fmax(0, atan2(sin_h, sum.z)) / (GONIO_PI / 2));
    // |wi + wo| = 2 cos(theta_d), |wi - wo| = 2 sin(theta_d).
    const gonio_vec3 gap = {wi.x - wo.x, wi.y - wo.y, wi.z - wo.z};
    *d = N_D * atan2(sqrt(gap.x * gap.x + gap.y * gap.y + gap.z * gap.z), length) / (GONIO_PI / 2);
    // In the frame of the half vector: b = (-s, c, 0) is its horizontal axis, t = b x h the other one.
    const double c = sin_h > 0 ? sum.x / sin_h : 1, s = sin_h > 0 ? sum.y / sin_h : 0;
    const double y = c * wi.y - s * wi.x;
    const double x = length > 0 ? ((c * wi.x + s * wi.y) * sum.z - wi.z * sin_h) / length : 1;
    double phi = atan2(y, x);
    if (phi < 0) {
        phi += GONIO_PI; // the reciprocal pair
    }
    *p = fmod(N_P * phi / GONIO_PI, N_P);
}

static size_t cell(int h, int d, int p) { return (size_t)p + N_P * ((size_t)d + N_D * (size_t)h); }

// ---- samples ----

// The directions at a cell's node, `offset` beyond its lower edge; false where one lies below the horizon.
static bool node(int h, int d, int p, double offset, gonio_vec3 *wi, gonio_vec3 *wo) {
    directions(h + offset, d + offset, p + offset, wi, wo);
    return wi->z > 0 && wo->z > 0;
}

static bool node_pair(int h, int d, int p, double offset, gonio_pair *pair) {
    gonio_vec3 wi, wo;
    if (!node(h, d, p, offset, &wi, &wo)) {
        return false;
    }
    const gonio_pair found = gonio_pair_from_vectors(wi, wo);
    *pair = (gonio_pair){gonio_angle_canonical(found.theta_i), 0, gonio_angle_canonical(found.theta_o),
                         gonio_angle_canonical(remainder(found.phi_o - found.phi_i, 2 * GONIO_PI))};
    return true;
}

static bool values_at(const gonio_source *source, size_t at, double values[3]) {
    for (size_t c = 0; c < 3; c++) {
        values[c] = number_at(source, c * CELLS + at) * scale[c];
        if (values[c] < 0) {
            return false;
        }
    }
    return true;
}

enum { NODES_AUTO, NODES_EDGE, NODES_CENTRE };
#define EDGE 0.0
#define CENTRE 0.5

#define MARK (-2.0) // in the last cell, which is invalid in every table: the nodes are the edges

// Where the file's nodes stand in their cells.
static double offset_of(const gonio_source *source) { return number_at(source, CELLS - 1) == MARK ? EDGE : CENTRE; }

static gonio_status add_cells(const gonio_source *source, const gonio_format_values *values, gonio_samples *samples,
                              gonio_read_report *report, gonio_error *error) {
    // A cell is kept where its hash with the seed is below the share that the limit leaves; valid cells are about 4/5
    // of all.
    const double share = values->at[0].count > 0 ? (double)values->at[0].count / (double)CELLS : 1;
    const uint64_t key = gonio_random(values->seed);
    const double offset = offset_of(source);
    for (size_t at = 0; at < CELLS; at++) {
        if (share < 1 && gonio_random_uniform((key ^ at * GONIO_RANDOM_STEP) - GONIO_RANDOM_STEP) >= share) {
            continue;
        }
        const int p = (int)(at % N_P), d = (int)(at / N_P % N_D), h = (int)(at / N_P / N_D);
        gonio_pair pair;
        double rgb[3];
        report->rows++;
        if (!node_pair(h, d, p, offset, &pair) || !values_at(source, at, rgb)) {
            report->invalid++;
            continue;
        }
        const gonio_status status = gonio_samples_add(samples, &pair, rgb, NULL, NULL, error);
        if (status != GONIO_OK) {
            return status;
        }
    }
    return GONIO_OK;
}

static gonio_status read_merl(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                              gonio_read_report *report, gonio_error *error) {
    gonio_read_report own = {.format = "merl", .first_negative_line = -1};
    gonio_status status = check(source, error);
    status = status == GONIO_OK ? gonio_samples_new(3, false, out, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    memcpy((*out)->channel_names, names, sizeof names);
    status = add_cells(source, values, *out, &own, error);
    if (status == GONIO_OK && (*out)->n == 0) {
        status = gonio_fail_byte(error, GONIO_E_INPUT, source->path, HEADER, "no valid value in the table");
    }
    if (status != GONIO_OK) {
        gonio_samples_free(*out);
        *out = NULL;
    }
    if (report != NULL) {
        *report = own;
    }
    return status;
}

// ---- model ----

typedef struct merl_model {
    gonio_model head;
    double offset;   // of the nodes in their cells
    double values[]; // CELLS x 3, 1/sr; INVALID in all three where there is none
} merl_model;

// The two neighbours of a fractional index among nodes, and the weight of the upper one.
typedef struct neighbours {
    int at[2];
    double weight[2];
} neighbours;

static neighbours between(double x, double offset, int n, bool periodic) {
    const double shifted = x - offset, low = floor(shifted), w = shifted - low;
    const int i = (int)low;
    neighbours two = {{i, i + 1}, {1 - w, w}};
    for (int k = 0; k < 2; k++) {
        const int at = two.at[k];
        two.at[k] = periodic ? (at + n) % n : at < 0 ? 0 : at >= n ? n - 1 : at;
    }
    return two;
}

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const merl_model *m = (const merl_model *)model;
    double h, d, p, sum[3] = {0}, total = 0;
    indices(wi, wo, &h, &d, &p);
    const neighbours nh = between(h, m->offset, N_H, false), nd = between(d, m->offset, N_D, false);
    const neighbours np = between(p, m->offset, N_P, true);
    for (int k = 0; k < 8; k++) {
        const double w = nh.weight[k & 1] * nd.weight[k >> 1 & 1] * np.weight[k >> 2];
        const double *at = m->values + 3 * cell(nh.at[k & 1], nd.at[k >> 1 & 1], np.at[k >> 2]);
        if (at[0] >= 0 && w > 0) {
            total += w;
            for (int c = 0; c < 3; c++) {
                sum[c] += w * at[c];
            }
        }
    }
    for (int c = 0; c < 3; c++) {
        values[c] = total > 0 ? sum[c] / total : 0;
    }
}

static void release(gonio_model *model) { free(model); }

static const gonio_model_ops ops = {.kind = "measured", .eval = eval, .free = release};

static gonio_status table_merl(const gonio_source *source, gonio_model **out, gonio_error *error) {
    const gonio_status status = check(source, error);
    if (status != GONIO_OK) {
        return status;
    }
    const size_t size = 3 * CELLS * sizeof(double);
    merl_model *m = malloc(sizeof *m + size);
    if (m == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a MERL table (%zu bytes)", size);
    }
    m->head = (gonio_model){
        .ops = &ops, .channels = 3, .isotropic = true, .channel_names = names, .bytes = size, .control_points = CELLS};
    m->offset = offset_of(source);
    for (size_t at = 0; at < CELLS; at++) {
        double *v = m->values + 3 * at;
        if (!values_at(source, at, v)) {
            v[0] = v[1] = v[2] = INVALID;
        }
    }
    *out = &m->head;
    return GONIO_OK;
}

// ---- writing ----

static void put_little(FILE *stream, const void *bits, size_t size) {
    if (size == 4) {
        uint32_t raw;
        memcpy(&raw, bits, 4);
        raw = htole32(raw);
        fwrite(&raw, 4, 1, stream);
    } else {
        uint64_t raw;
        memcpy(&raw, bits, 8);
        raw = htole64(raw);
        fwrite(&raw, 8, 1, stream);
    }
}

// The three planes' numbers of one cell; rounded so that the reader's product and this quotient give them again.
static void cell_values(const gonio_model *model, int h, int d, int p, double offset, double out[3]) {
    gonio_vec3 wi, wo;
    if (!node(h, d, p, offset, &wi, &wo)) {
        out[0] = out[1] = out[2] = INVALID;
        return;
    }
    double values[3];
    gonio_model_eval(model, wi, wo, values);
    for (int c = 0; c < 3; c++) {
        out[c] = (double)(float)(fmax(values[c], 0) / scale[c]);
    }
}

typedef struct filling {
    const gonio_model *model;
    double offset;
    double *planes;
} filling;

static void fill_planes(void *context, size_t h) {
    const filling *f = context;
    for (int d = 0; d < N_D; d++) {
        for (int p = 0; p < N_P; p++) {
            double values[3];
            cell_values(f->model, (int)h, d, p, f->offset, values);
            for (size_t c = 0; c < 3; c++) {
                f->planes[c * CELLS + cell((int)h, d, p)] = values[c];
            }
        }
    }
}

static gonio_status write_planes(const gonio_model *rgb, double offset, int threads, FILE *stream, gonio_error *error) {
    double *planes = malloc(3 * CELLS * sizeof *planes);
    if (planes == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a MERL table");
    }
    gonio_pool_for(threads, N_H, fill_planes, &(filling){rgb, offset, planes});
    for (size_t c = 0; c < 3 && offset == EDGE; c++) {
        planes[(c + 1) * CELLS - 1] = MARK;
    }
    const int32_t dimensions[3] = {N_H, N_D, N_P};
    for (int k = 0; k < 3; k++) {
        put_little(stream, &dimensions[k], 4);
    }
    for (size_t i = 0; i < 3 * CELLS && !ferror(stream); i++) {
        put_little(stream, &planes[i], 8);
    }
    free(planes);
    return GONIO_OK;
}

static gonio_status write_merl(const gonio_model *model, const gonio_format_values *values, FILE *stream,
                               gonio_write_report *told, gonio_error *error) {
    if (!model->isotropic) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED, "a MERL table is isotropic; the model is not");
    }
    gonio_model *rgb;
    gonio_status status = gonio_model_as_rgb(model, &rgb, error);
    if (status != GONIO_OK) {
        return status;
    }
    // A table that was read is written with the nodes that it has.
    const int choice = values->at[0].choice;
    const bool edge = choice == NODES_AUTO && model->ops == &ops ? ((const merl_model *)model)->offset == EDGE
                                                                 : choice != NODES_CENTRE;
    snprintf(told->about, sizeof told->about, "nodes at the cells' %s", edge ? "lower edges" : "centres");
    gonio_write_lost_channels(model, 3, told);
    gonio_write_lost(told, "f_r(wi, wo) and f_r(wo, wi) are one value");
    status = write_planes(rgb, edge ? EDGE : CENTRE, values->threads, stream, error);
    if (rgb != model) {
        gonio_model_free(rgb);
    }
    return status;
}

static const gonio_format_option write_options[] = {{"merl-nodes", GONIO_FORMAT_CHOICE, "auto|edge|centre", "auto",
                                                     "where in its cell a value stands: edge for programs that "
                                                     "interpolate, centre for those that take the cell's (auto: "
                                                     "edge, or as the table has it that is written again)"},
                                                    {0}};

static const gonio_format_option options[] = {
    {"limit", GONIO_FORMAT_COUNT, "N", "0", "at most about N samples of a table"}, {0}};

const gonio_format gonio_format_merl = {.name = "merl",
                                        .summary = "MERL table",
                                        .extensions = ".binary",
                                        .recognise = recognise,
                                        .read = read_merl,
                                        .table = table_merl,
                                        .write_table = write_merl,
                                        .write_options = write_options,
                                        .quantity = "f_r of r, g, b (linear sRGB), 1/sr, over 1/1500, 1.15/1500, "
                                                    "1.66/1500; -1: below the horizon",
                                        .convention = "Rusinkiewicz' half and difference angles, isotropic",
                                        .precision = 0x1p-24,
                                        .options = options};
