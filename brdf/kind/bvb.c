// SPDX-License-Identifier: BSD-3-Clause
// Park and Lee, "Adaptive B-spline volume representation of measured BRDF data for photorealistic rendering" (Journal
// of Computational Design and Engineering 2, 2015), eq. 4:
//   B(u, v, w) = sum_ijk N_i,p(u) N_j,p(v) N_k,p(w) b_ijk,  u = theta_i / 90 deg, v = theta_o / 90 deg,
//   w = phi_d / 360 deg, phi_d = phi_o - phi_i from 0 to 360 deg,
// on knots of any spacing. Anisotropic models have phi_i / 360 deg as a fourth axis, which the paper leaves to the
// future, and any model may hold a transform of f_r. Between its knots a basis function is a polynomial; each span
// keeps its `order` functions as polynomials of the place within it, so that an evaluation looks a span up, works
// Horner's rule in four lanes and sums order^dims control points, by rows along phi_d.
//
// The angles of a pair are computed side by side, a vector lane each, in quarter turns.
//
// The spline of a peak swings below and above the data beside it: values are held within the range of what was fitted.
// At the points of a table that can only lower an error.
//
// Section: 64 bytes of description, the transforms, the ranges, the knots axis by axis, the control points; each part
// aligned (brdf/model_file.h).
#include "brdf/kind/bvb.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "brdf/channels.h"
#include "brdf/exp_log.h"
#include "brdf/kind.h"
#include "brdf/kind/bvb_axis.h"

#define COUNT_MAX 1024 // control points an axis

typedef struct bvb_model {
    gonio_channels channels;
    gonio_bvb_parts parts;
    gonio_bvb_axis axes[GONIO_BVB_AXES];
    double *range; // [2 channels]
} bvb_model;

typedef struct description {
    uint32_t dims, order, coordinates, kind;
    uint32_t count[GONIO_BVB_AXES];
    uint32_t reserved[8];
} description;
_Static_assert(sizeof(description) == 64, "the description is one block");

// ---- where a pair lies ----

// Of a direction in the plane, of any length: its azimuth in turns from how far its |azimuth| lies from the x axis, in
// quarter turns.
GONIO_INLINE double whole_turns(double quarter, double x, double y) {
    const double half = x < 0 ? 2 - quarter : quarter;
    return 0.25 * (y < 0 ? 4 - half : half);
}

GONIO_INLINE void locate(gonio_vec3 wi, gonio_vec3 wo, double x[GONIO_BVB_AXES]) {
    const double along = wi.x * wo.x + wi.y * wo.y, across = wi.x * wo.y - wi.y * wo.x;
    // At normal incidence phi_i is 0; where the outgoing direction is the normal, phi_d is.
    const bool pole = wi.x == 0 && wi.y == 0;
    const double d[2] = {pole ? wo.x : along, pole ? wo.y : across};
    gonio_d4 norm = {wi.x * wi.x + wi.y * wi.y, wo.x * wo.x + wo.y * wo.y, d[0] * d[0] + d[1] * d[1], 1}, turns;
    gonio_sqrt4(&norm);
    norm[3] = norm[0];
    const gonio_d4 unit = GONIO_SELECT4(norm > 0, 1 / norm, GONIO_ALL4(0.0));
    const gonio_d4 sine = {norm[0], norm[1], fabs(d[1]) * unit[2], fabs(wi.y) * unit[0]};
    const gonio_d4 cosine = {fmax(wi.z, 0), fmax(wo.z, 0), norm[2] > 0 ? fabs(d[0]) * unit[2] : 1,
                             pole ? 1 : fabs(wi.x) * unit[0]};
    gonio_quarter_turns4(&sine, &cosine, &turns);
    x[GONIO_BVB_THETA_I] = turns[0];
    x[GONIO_BVB_THETA_O] = turns[1];
    x[GONIO_BVB_PHI_D] = whole_turns(turns[2], d[0], d[1]);
    x[GONIO_BVB_PHI_I] = whole_turns(turns[3], wi.x, wi.y);
}

// The span of an axis and the place within it.
GONIO_INLINE size_t find_span(const gonio_bvb_axis *a, double x, double *place) {
    const double at = x * GONIO_BVB_BUCKETS;
    const size_t bucket = at < GONIO_BVB_BUCKETS ? (size_t)at : GONIO_BVB_BUCKETS - 1;
    size_t k = a->span[bucket];
    while (x >= a->begin[k + 1]) { // once at most where knots lie a step of a table apart
        k++;
    }
    *place = (x - a->begin[k]) * a->inverse[k];
    return k;
}

// A pair among the control points: the first of its block, and the basis functions of each axis.
typedef struct cell {
    size_t first;
    gonio_f4 basis[GONIO_BVB_AXES];
} cell;

GONIO_INLINE void find_cell(const bvb_model *m, const int dims, const double *x, cell *c) {
    size_t index[GONIO_BVB_AXES] = {0};
    GONIO_UNROLL
    for (int d = 0; d < dims; d++) {
        double place;
        index[d] = find_span(&m->axes[d], x[d], &place);
        const gonio_f4 *b = m->axes[d].basis + 4 * index[d];
        const float s = (float)place;
        c->basis[d] = ((b[3] * s + b[2]) * s + b[1]) * s + b[0];
    }
    const size_t *n = m->parts.count;
    const size_t outer = dims == 4 ? index[3] * n[0] + index[0] : index[0];
    c->first = ((outer * n[1] + index[1]) * n[2] + index[2]) * (size_t)m->parts.channels;
}

// ---- sums ----

// Rows along phi_d, apart by these numbers of floats.
typedef struct strides {
    size_t phi_i, theta_i, theta_o;
} strides;

GONIO_INLINE strides strides_of(const bvb_model *m) {
    const size_t *n = m->parts.count, row = n[2] * (size_t)m->parts.channels;
    return (strides){n[0] * n[1] * row, n[1] * row, row};
}

GONIO_INLINE float sum_lanes(const gonio_f4 *v) { return ((*v)[0] + (*v)[1]) + ((*v)[2] + (*v)[3]); }

GONIO_INLINE void sum_one(const bvb_model *m, const int dims, const int order, const cell *c, float *value) {
    const strides apart = strides_of(m);
    const float *points = m->parts.points + c->first;
    gonio_f4 total = {0};
    for (int h = 0; h < (dims == 4 ? order : 1); h++) {
        gonio_f4 volume = {0};
        GONIO_UNROLL
        for (int i = 0; i < order; i++) {
            const float *row = points + (size_t)h * apart.phi_i + (size_t)i * apart.theta_i;
            gonio_f4 plane = {0};
            GONIO_UNROLL
            for (int j = 0; j < order; j++) {
                plane += c->basis[GONIO_BVB_THETA_O][j] * *(const gonio_f4 *)(row + (size_t)j * apart.theta_o);
            }
            volume += c->basis[GONIO_BVB_THETA_I][i] * plane;
        }
        total += (dims == 4 ? c->basis[GONIO_BVB_PHI_I][h] : 1) * volume;
    }
    const gonio_f4 last = total * c->basis[GONIO_BVB_PHI_D];
    *value = sum_lanes(&last);
}

#define ROWS_MAX 64

typedef struct row_list {
    size_t count, offset[ROWS_MAX];
    float weight[ROWS_MAX];
} row_list;

GONIO_INLINE void list_rows(const bvb_model *m, const int dims, const int order, const cell *c, row_list *rows) {
    const strides apart = strides_of(m);
    rows->count = 0;
    for (int h = 0; h < (dims == 4 ? order : 1); h++) {
        const float outer = dims == 4 ? c->basis[GONIO_BVB_PHI_I][h] : 1;
        for (int i = 0; i < order; i++) {
            const float weight = outer * c->basis[GONIO_BVB_THETA_I][i];
            for (int j = 0; j < order; j++, rows->count++) {
                rows->offset[rows->count] =
                    (size_t)h * apart.phi_i + (size_t)i * apart.theta_i + (size_t)j * apart.theta_o;
                rows->weight[rows->count] = weight * c->basis[GONIO_BVB_THETA_O][j];
            }
        }
    }
}

GONIO_INLINE void sum_all(const bvb_model *m, const int dims, const int order, const cell *c, float *sums,
                          float *values) {
    const size_t channels = (size_t)m->parts.channels, length = (size_t)order * channels;
    const float *points = m->parts.points + c->first;
    row_list rows;
    list_rows(m, dims, order, c, &rows);
    size_t v = 0;
    for (; v + 16 <= length; v += 16) {
        gonio_f16 sum = {0};
        for (size_t r = 0; r < rows.count; r++) {
            sum += rows.weight[r] * *(const gonio_f16 *)(points + rows.offset[r] + v);
        }
        *(gonio_f16 *)(sums + v) = sum;
    }
    for (; v < length; v += 4) {
        gonio_f4 sum = {0};
        for (size_t r = 0; r < rows.count; r++) {
            sum += rows.weight[r] * *(const gonio_f4 *)(points + rows.offset[r] + v);
        }
        *(gonio_f4 *)(sums + v) = sum;
    }
    for (size_t k = 0; k < channels; k++) {
        float value = 0;
        for (size_t f = 0; f < (size_t)order; f++) {
            value += c->basis[GONIO_BVB_PHI_D][f] * sums[f * channels + k];
        }
        values[k] = value;
    }
}

#define AHEAD 4 // pairs between a look-up and its sum: their rows are asked for meanwhile

GONIO_INLINE void ask_for(const bvb_model *m, const int dims, const int order, const cell *c) {
    const strides apart = strides_of(m);
    const size_t row = (size_t)order * (size_t)m->parts.channels * sizeof(float);
    for (int h = 0; h < (dims == 4 ? order : 1); h++) {
        for (int i = 0; i < order; i++) {
            for (int j = 0; j < order; j++) {
                const char *at = (const char *)(m->parts.points + c->first + (size_t)h * apart.phi_i +
                                                (size_t)i * apart.theta_i + (size_t)j * apart.theta_o);
                __builtin_prefetch(at);
                __builtin_prefetch(at + row - 1);
            }
        }
    }
}

// Transformed values of n pairs, n x channels.
GONIO_INLINE void evaluate(const bvb_model *m, const int dims, const int order, size_t n, const gonio_vec3 *wi,
                           const gonio_vec3 *wo, float *values) {
    const size_t channels = (size_t)m->parts.channels;
    cell cells[AHEAD];
    float sums[channels > 1 ? 4 * channels + 16 : 1];
    for (size_t i = 0; i < n + AHEAD - 1; i++) {
        if (i < n) {
            double x[GONIO_BVB_AXES];
            locate(wi[i], wo[i], x);
            find_cell(m, dims, x, &cells[i % AHEAD]);
            if (n > 1) {
                ask_for(m, dims, order, &cells[i % AHEAD]);
            }
        }
        if (i + 1 >= AHEAD || n == 1) {
            const size_t at = n == 1 ? 0 : i + 1 - AHEAD;
            if (channels == 1) {
                sum_one(m, dims, order, &cells[at % AHEAD], values + at);
            } else {
                sum_all(m, dims, order, &cells[at % AHEAD], sums, values + at * channels);
            }
            if (n == 1) {
                return;
            }
        }
    }
}

#define EVALUATOR(dims, order)                                                                                         \
    GONIO_CLONES static void bvb_##dims##d_##order(const bvb_model *m, size_t n, const gonio_vec3 *wi,                 \
                                                   const gonio_vec3 *wo, float *values) {                              \
        evaluate(m, dims, order, n, wi, wo, values);                                                                   \
    }
EVALUATOR(3, 2)
EVALUATOR(3, 3)
EVALUATOR(3, 4)
EVALUATOR(4, 2)
EVALUATOR(4, 3)
EVALUATOR(4, 4)

static void transformed(const bvb_model *m, size_t n, const gonio_vec3 *wi, const gonio_vec3 *wo, float *values) {
    if (m->parts.dims == 3) {
        (m->parts.order == 2 ? bvb_3d_2 : m->parts.order == 3 ? bvb_3d_3 : bvb_3d_4)(m, n, wi, wo, values);
    } else {
        (m->parts.order == 2 ? bvb_4d_2 : m->parts.order == 3 ? bvb_4d_3 : bvb_4d_4)(m, n, wi, wo, values);
    }
}

static inline double finish(const bvb_model *m, int channel, double value) {
    const double *range = m->range + 2 * channel;
    return gonio_transform_invert(m->channels.kind, &m->channels.transforms[channel],
                                  fmin(fmax(value, range[0]), range[1]));
}

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const bvb_model *m = (const bvb_model *)model;
    float v[model->channels];
    transformed(m, 1, &wi, &wo, v);
    for (int c = 0; c < model->channels; c++) {
        values[c] = finish(m, c, (double)v[c]);
    }
}

static void eval_f32(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, float *values) {
    const bvb_model *m = (const bvb_model *)model;
    transformed(m, 1, &wi, &wo, values);
    for (int c = 0; c < model->channels; c++) {
        values[c] = (float)finish(m, c, (double)values[c]);
    }
}

#define BATCH 128 // pairs at a time: their values stay in the first-level cache

static void eval_many(const gonio_model *model, size_t n, const gonio_vec3 *wi, const gonio_vec3 *wo, double *values) {
    const bvb_model *m = (const bvb_model *)model;
    const size_t channels = (size_t)model->channels, batch = channels > BATCH ? 1 : BATCH / channels;
    float v[channels > BATCH ? channels : BATCH];
    for (size_t begin = 0; begin < n; begin += batch) {
        const size_t count = n - begin < batch ? n - begin : batch;
        transformed(m, count, wi + begin, wo + begin, v);
        double *out = values + begin * channels;
        for (size_t i = 0; i < count * channels; i++) {
            out[i] = finish(m, (int)(i % channels), (double)v[i]);
        }
    }
}

// ---- one channel, and its gradient ----

// The basis functions of an axis at x, and their slopes by x where `slope` is not NULL.
static size_t axis_basis(const bvb_model *m, int d, double x, double basis[4], double *slope) {
    double s;
    const gonio_bvb_axis *a = &m->axes[d];
    const size_t k = find_span(a, x, &s);
    const gonio_f4 *b = a->basis + 4 * k;
    for (int f = 0; f < 4; f++) {
        const double c[4] = {(double)b[0][f], (double)b[1][f], (double)b[2][f], (double)b[3][f]};
        basis[f] = ((c[3] * s + c[2]) * s + c[1]) * s + c[0];
        if (slope != NULL) {
            slope[f] = ((3 * c[3] * s + 2 * c[2]) * s + c[1]) * a->inverse[k];
        }
    }
    return k;
}

// The spline of one channel at x and, unless NULL, its slopes along the axes.
static double sum_channel(const bvb_model *m, const double *x, int channel, double *slope) {
    double basis[GONIO_BVB_AXES][4] = {[GONIO_BVB_PHI_I] = {1}}, by[GONIO_BVB_AXES][4] = {{0}};
    size_t at[GONIO_BVB_AXES] = {0};
    const int p = m->parts.order, outer = m->parts.dims == 4 ? p : 1;
    const size_t *n = m->parts.count;
    double sum[1 + GONIO_BVB_AXES] = {0};
    for (int d = 0; d < m->parts.dims; d++) {
        at[d] = axis_basis(m, d, x[d], basis[d], slope != NULL ? by[d] : NULL);
    }
    for (int r = 0; r < outer * p * p; r++) {
        const int h = r / (p * p), i = r / p % p, j = r % p;
        const size_t row = (((at[3] + (size_t)h) * n[0] + at[0] + (size_t)i) * n[1] + at[1] + (size_t)j) * n[2] + at[2];
        double value = 0, along = 0;
        for (int k = 0; k < p; k++) {
            const double point =
                (double)m->parts.points[(row + (size_t)k) * (size_t)m->parts.channels + (size_t)channel];
            value += basis[2][k] * point;
            along += by[2][k] * point;
        }
        const double a = basis[3][h], b = basis[0][i], c = basis[1][j];
        sum[0] += a * b * c * value;
        sum[1] += a * by[0][i] * c * value;
        sum[2] += a * b * by[1][j] * value;
        sum[3] += a * b * c * along;
        sum[4] += by[3][h] * b * c * value;
    }
    if (slope != NULL) {
        memcpy(slope, sum + 1, sizeof(double[GONIO_BVB_AXES]));
    }
    return sum[0];
}

static double eval_channel(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, int channel) {
    const bvb_model *m = (const bvb_model *)model;
    double x[GONIO_BVB_AXES];
    locate(wi, wo, x);
    return finish(m, channel, sum_channel(m, x, channel, NULL));
}

static void gradient(const gonio_model *model, const gonio_pair *pair, int channel, double out[4]) {
    const bvb_model *m = (const bvb_model *)model;
    double x[GONIO_BVB_AXES], slope[GONIO_BVB_AXES];
    locate(gonio_direction(pair->theta_i, pair->phi_i), gonio_direction(pair->theta_o, pair->phi_o), x);
    const double v = sum_channel(m, x, channel, slope), *range = m->range + 2 * channel;
    const bool held = v < range[0] || v > range[1];
    const double outer = held ? 0 : gonio_transform_slope(m->channels.kind, &m->channels.transforms[channel], v);
    const double turn = outer / (2 * GONIO_PI), quarter = outer / (GONIO_PI / 2);
    out[0] = quarter * slope[GONIO_BVB_THETA_I];
    out[1] = turn * (slope[GONIO_BVB_PHI_I] - slope[GONIO_BVB_PHI_D]);
    out[2] = quarter * slope[GONIO_BVB_THETA_O];
    out[3] = turn * slope[GONIO_BVB_PHI_D];
}

// ---- models and their files ----

void gonio_bvb_parts_release(gonio_bvb_parts *parts) {
    for (int d = 0; d < GONIO_BVB_AXES; d++) {
        free(parts->knots[d]);
    }
    free(parts->points);
    *parts = (gonio_bvb_parts){0};
}

static void release(gonio_model *model) {
    bvb_model *m = (bvb_model *)model;
    if (m->channels.mapped.base == NULL) {
        gonio_bvb_parts_release(&m->parts);
    }
    free(m->axes[0].begin);
    free(m->range);
    gonio_channels_free(&m->channels);
}

static size_t points_bytes(const gonio_bvb_parts *p) {
    return (gonio_bvb_points(p) * (size_t)p->channels + GONIO_BVB_PAD) * sizeof(float);
}

static gonio_status save(const gonio_model *model, FILE *stream, gonio_error *error) {
    const bvb_model *m = (const bvb_model *)model;
    const gonio_bvb_parts *p = &m->parts;
    const size_t c = (size_t)model->channels;
    description about = {.dims = (uint32_t)p->dims, .order = (uint32_t)p->order, .kind = (uint32_t)m->channels.kind};
    gonio_file_part parts[8] = {{&about, sizeof about},
                                {m->channels.transforms, c * sizeof *m->channels.transforms},
                                {m->range, 2 * c * sizeof *m->range}};
    int n = 3;
    for (int d = 0; d < GONIO_BVB_AXES; d++) {
        about.count[d] = (uint32_t)p->count[d];
        if (d < p->dims) {
            parts[n++] = (gonio_file_part){p->knots[d], (p->count[d] + (size_t)p->order) * sizeof(double)};
        }
    }
    parts[n++] = (gonio_file_part){p->points, points_bytes(p)};
    return gonio_model_file_write(model, stream, parts, n, error);
}

static const gonio_model_ops bvb_ops = {
    .kind = "bvb",
    .eval = eval,
    .eval_f32 = eval_f32,
    .eval_channel = eval_channel,
    .eval_many = eval_many,
    .gradient = gradient,
    .save = save,
    .free = release,
};

static gonio_status new_model(const gonio_bvb_parts *parts, gonio_transform_kind kind,
                              const gonio_transform *transforms, const double *range, const char (*names)[32],
                              bvb_model **out, gonio_error *error) {
    void *model;
    const size_t c = (size_t)parts->channels;
    gonio_status status = gonio_channels_new(sizeof **out, parts->channels, kind, transforms, names, &model, error);
    if (status != GONIO_OK) {
        return status;
    }
    bvb_model *m = *out = model;
    m->parts = *parts;
    m->range = malloc(2 * c * sizeof *range);
    status = m->range != NULL ? gonio_bvb_axes_fill(&m->parts, m->axes, error)
                              : gonio_fail(error, GONIO_E_MEMORY, "no memory for a model of %zu channels", c);
    if (status != GONIO_OK) {
        free(m->range);
        gonio_channels_free(&m->channels);
        return status;
    }
    memcpy(m->range, range, 2 * c * sizeof *range);
    gonio_model *head = &m->channels.head;
    head->ops = &bvb_ops;
    head->isotropic = parts->dims == 3;
    head->control_points = gonio_bvb_points(parts);
    head->bytes = points_bytes(parts) + c * (sizeof *transforms + 2 * sizeof *range) + sizeof *m;
    for (int d = 0; d < parts->dims; d++) {
        head->bytes += gonio_bvb_spans(parts, d) * (2 * sizeof(double) + 64) + GONIO_BVB_BUCKETS * sizeof(uint16_t);
    }
    return GONIO_OK;
}

gonio_status gonio_bvb_model_new(gonio_bvb_parts *parts, gonio_transform_kind kind, const gonio_transform *transforms,
                                 const double *range, const char (*channel_names)[32], gonio_model **out,
                                 gonio_error *error) {
    *out = NULL;
    bvb_model *m;
    const gonio_status status = new_model(parts, kind, transforms, range, channel_names, &m, error);
    if (status == GONIO_OK) {
        *parts = (gonio_bvb_parts){0};
        *out = &m->channels.head;
    }
    return status;
}

const gonio_bvb_parts *gonio_bvb_model_parts(const gonio_model *model) {
    return model->ops == &bvb_ops ? &((const bvb_model *)model)->parts : NULL;
}

static bool knots_possible(const double *t, size_t count, size_t order) {
    for (size_t k = 0; k < order; k++) {
        if (t[k] != 0 || t[count + k] != 1) {
            return false;
        }
    }
    for (size_t k = order - 1; k < count; k++) {
        if (!(t[k + 1] - t[k] >= GONIO_BVB_GAP)) {
            return false;
        }
    }
    return true;
}

static gonio_status read_knots(const gonio_mapped *mapped, size_t *at, const description *about, gonio_bvb_parts *parts,
                               gonio_error *error) {
    for (int d = 0; d < GONIO_BVB_AXES; d++) {
        const size_t count = about->count[d], order = about->order, begin = *at;
        parts->count[d] = count;
        if (d >= parts->dims) {
            continue;
        }
        const double *knots = gonio_mapped_take(mapped, at, (count + order) * sizeof *knots);
        if (knots == NULL || !knots_possible(knots, count, order)) {
            return gonio_mapped_fail(mapped, begin, "knots that do not ascend from 0 to 1", error);
        }
        parts->knots[d] = (double *)(uintptr_t)knots; // never written: models are immutable
    }
    return GONIO_OK;
}

static bool description_possible(const gonio_mapped *mapped, const description *about) {
    bool good = about != NULL && about->dims == (mapped->isotropic ? 3u : 4u) && about->order >= GONIO_BVB_ORDER_MIN &&
                about->order <= GONIO_BVB_ORDER_MAX && about->coordinates == 0 &&
                about->kind <= GONIO_TRANSFORM_POSITIVE;
    for (uint32_t d = 0; good && d < GONIO_BVB_AXES; d++) {
        const uint32_t n = about->count[d];
        good = d < about->dims ? n >= about->order && n <= COUNT_MAX : n == 1;
    }
    return good;
}

static bool ranges_possible(const double *range, size_t channels) {
    for (size_t c = 0; c < channels; c++) {
        // Their logarithms reach 745.
        if (!(range[2 * c] <= range[2 * c + 1] && fabs(range[2 * c]) <= 800 && fabs(range[2 * c + 1]) <= 800)) {
            return false;
        }
    }
    return true;
}

static gonio_status read_model(gonio_mapped *mapped, gonio_model **out, gonio_error *error) {
    size_t at = 0;
    const size_t c = (size_t)mapped->channels;
    const description *about = gonio_mapped_take(mapped, &at, sizeof *about);
    if (!description_possible(mapped, about)) {
        return gonio_mapped_fail(mapped, 0, "a B-spline volume of impossible dimensions, order or counts", error);
    }
    const size_t transforms_at = at;
    const gonio_transform *transforms = gonio_mapped_take(mapped, &at, c * sizeof *transforms);
    const double *range = transforms != NULL ? gonio_mapped_take(mapped, &at, 2 * c * sizeof *range) : NULL;
    if (range == NULL || !gonio_scales_possible(&transforms->scale, c, about->kind != GONIO_TRANSFORM_LINEAR) ||
        !ranges_possible(range, c)) {
        return gonio_mapped_fail(mapped, transforms_at, "a channel's scale, eps or range that no fit makes", error);
    }
    gonio_bvb_parts parts = {.dims = (int)about->dims, .order = (int)about->order, .channels = mapped->channels};
    bvb_model *m;
    gonio_status status = read_knots(mapped, &at, about, &parts, error);
    if (status != GONIO_OK) {
        return status;
    }
    const size_t points_at = at, bytes = points_bytes(&parts);
    const float *points = gonio_mapped_take(mapped, &at, bytes);
    if (points == NULL) {
        return gonio_mapped_fail(mapped, points_at, "fewer control points than its counts and channels need", error);
    }
    parts.points = (float *)(uintptr_t)points;
    status = new_model(&parts, (gonio_transform_kind)about->kind, transforms, range, NULL, &m, error);
    if (status == GONIO_OK) {
        gonio_channels_adopt(&m->channels, mapped);
        *out = &m->channels.head;
    }
    return status;
}

const gonio_kind gonio_kind_bvb = {
    .name = "bvb",
    .summary = "a B-spline volume over the angles, with knots where the lobes are",
    .ops = &bvb_ops,
    .read = read_model,
};
