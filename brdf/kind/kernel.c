// SPDX-License-Identifier: BSD-3-Clause
// The samples themselves, DeYoung, "Properties of tabulated bidirectional reflectance distribution functions" (1996),
// section 3.2.1, on samples that are on no grid: a mean of the j nearest ones,
//   v(x) = sum_k w_k v_k / sum_k w_k, w_k = exp(-d_k^2 / (2 s^2)), s the mean of d_1 .. d_j,
// "a quadrivariate Gaussian with a standard deviation on the order of the mean distance". d is Euclidean: between both
// unit vectors, as he says ("a naive solution"), or between half-vector coordinates, where a lobe is round whatever the
// incidence. Of an isotropic, mirrored material all pairs are turned to phi_i = 0 and phi_o >= 0 first. What is
// averaged is the transformed values.
//
// The nearest are found in a k-d tree (Bentley 1975) without pointers: the middle of a range of samples is its root,
// the halves beside it are its branches, and the axes take turns.
#include "brdf/kind/kernel.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "brdf/channels.h"
#include "brdf/kind.h"

typedef struct kernel_model {
    gonio_channels channels;
    gonio_distance distance;
    int dims, neighbours;
    size_t n;
    const float *places; // [n][dims], in the tree's order
    const float *values; // [n][channels]
} kernel_model;

typedef struct description {
    uint32_t dims, distance, neighbours, transform;
    uint64_t n;
    uint32_t reserved[10];
} description;
_Static_assert(sizeof(description) == 64, "the description is one block");

static int dims_of(gonio_distance distance, bool isotropic) {
    return distance == GONIO_DISTANCE_HALF_VECTOR ? (isotropic ? 3 : 4) : isotropic ? 5 : 6;
}

static void locate(gonio_distance distance, bool isotropic, gonio_vec3 wi, gonio_vec3 wo, double *x) {
    if (distance == GONIO_DISTANCE_HALF_VECTOR && isotropic) {
        gonio_coordinates_isotropic(GONIO_HALF_VECTOR, wi, wo, x);
        x[1] = fabs(x[1] - 0.5);
    } else if (distance == GONIO_DISTANCE_HALF_VECTOR) {
        gonio_coordinates_anisotropic(GONIO_HALF_VECTOR, wi, wo, x);
    } else if (isotropic) {
        double turned[3];
        gonio_coordinates_isotropic(GONIO_NUSSELT, wi, wo, turned);
        x[0] = 2 * turned[0] - 1;
        x[1] = wi.z;
        x[2] = 2 * turned[1] - 1;
        x[3] = fabs(2 * turned[2] - 1);
        x[4] = wo.z;
    } else {
        const double both[6] = {wi.x, wi.y, wi.z, wo.x, wo.y, wo.z};
        memcpy(x, both, sizeof both);
    }
}

// ---- the tree ----

typedef struct search {
    const kernel_model *model;
    const double *x;
    size_t without; // a sample that does not count
    gonio_nearest nearest;
} search;

static void visit(search *s, size_t low, size_t high, int axis) {
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        const kernel_model *m = s->model;
        const float *place = m->places + middle * (size_t)m->dims;
        double square = 0;
        for (int d = 0; d < m->dims; d++) {
            square += (s->x[d] - (double)place[d]) * (s->x[d] - (double)place[d]);
        }
        if (middle != s->without) {
            gonio_nearest_show(&s->nearest, square, middle);
        }
        const double side = s->x[axis] - (double)place[axis];
        const int next = axis + 1 < m->dims ? axis + 1 : 0;
        const bool lower = side < 0;
        visit(s, lower ? low : middle + 1, lower ? middle : high, next);
        if (s->nearest.found == s->nearest.wanted && !(side * side < gonio_nearest_reach(&s->nearest))) {
            return;
        }
        // The other side, without a call of its own.
        const size_t from = lower ? middle + 1 : low, to = lower ? high : middle;
        low = from;
        high = to;
        axis = next;
    }
}

static void find(const kernel_model *m, const double *x, size_t without, int wanted, gonio_nearest *nearest) {
    search s = {m, x, without, {.wanted = (size_t)wanted}};
    visit(&s, 0, m->n, 0);
    *nearest = s.nearest;
}

typedef struct entry {
    float place[GONIO_KERNEL_DIMS_MAX];
    size_t sample;
} entry;

static bool before(const entry *a, const entry *b, int axis) {
    return a->place[axis] != b->place[axis] ? a->place[axis] < b->place[axis] : a->sample < b->sample;
}

// Quickselect: entries[middle] as in sorted order by the axis, smaller ones before it.
static void select_middle(entry *e, size_t low, size_t high, size_t middle, int axis) {
    while (high - low > 1) {
        const entry pivot = e[low + (high - low) / 2];
        size_t i = low, j = high - 1;
        while (i <= j) {
            while (before(&e[i], &pivot, axis)) {
                i++;
            }
            while (before(&pivot, &e[j], axis)) {
                j--;
            }
            if (i > j) {
                break;
            }
            const entry swapped = e[i];
            e[i++] = e[j];
            e[j] = swapped;
            if (j == 0) {
                break;
            }
            j--;
        }
        if (middle <= j) {
            high = j + 1;
        } else if (middle >= i) {
            low = i;
        } else {
            return;
        }
    }
}

static void build(entry *e, size_t low, size_t high, int axis, int dims) {
    while (high - low > 1) {
        const size_t middle = low + (high - low) / 2;
        const int next = axis + 1 < dims ? axis + 1 : 0;
        select_middle(e, low, high, middle, axis);
        build(e, low, middle, next, dims);
        low = middle + 1;
        axis = next;
    }
}

// ---- evaluation ----

// Weights of the first `count` of the nearest; they sum to 1.
static void weigh(const gonio_nearest *nearest, size_t count, double *weights) {
    double mean = 0, total = 0;
    for (size_t k = 0; k < count; k++) {
        mean += sqrt(nearest->distance[k]) / (double)count;
    }
    for (size_t k = 0; k < count; k++) {
        weights[k] = mean > 0 ? exp(-nearest->distance[k] / (2 * mean * mean)) : 1;
        total += weights[k];
    }
    for (size_t k = 0; k < count; k++) {
        weights[k] /= total;
    }
}

static size_t prepare(const kernel_model *m, gonio_vec3 wi, gonio_vec3 wo, gonio_nearest *nearest,
                      double weights[GONIO_NEAREST_MAX]) {
    double x[GONIO_KERNEL_DIMS_MAX];
    locate(m->distance, m->channels.head.isotropic, wi, wo, x);
    find(m, x, SIZE_MAX, m->neighbours, nearest);
    weigh(nearest, nearest->found, weights);
    return nearest->found;
}

static double sum_of(const kernel_model *m, const gonio_nearest *nearest, size_t count, const double *weights,
                     int channel) {
    double sum = 0;
    for (size_t k = 0; k < count; k++) {
        sum += weights[k] * (double)m->values[nearest->index[k] * (size_t)m->channels.head.channels + (size_t)channel];
    }
    return sum;
}

static double eval_channel(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, int channel) {
    const kernel_model *m = (const kernel_model *)model;
    gonio_nearest nearest;
    double weights[GONIO_NEAREST_MAX];
    const size_t n = prepare(m, wi, wo, &nearest, weights);
    return gonio_transform_invert(m->channels.kind, &m->channels.transforms[channel],
                                  sum_of(m, &nearest, n, weights, channel));
}

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const kernel_model *m = (const kernel_model *)model;
    gonio_nearest nearest;
    double weights[GONIO_NEAREST_MAX];
    const size_t n = prepare(m, wi, wo, &nearest, weights);
    for (int c = 0; c < model->channels; c++) {
        values[c] =
            gonio_transform_invert(m->channels.kind, &m->channels.transforms[c], sum_of(m, &nearest, n, weights, c));
    }
}

void gonio_kernel_model_leave_one_out(const gonio_model *model, size_t index, int n, const int *neighbours,
                                      double *misses) {
    const kernel_model *m = (const kernel_model *)model;
    gonio_nearest nearest;
    double x[GONIO_KERNEL_DIMS_MAX], weights[GONIO_NEAREST_MAX];
    for (int d = 0; d < m->dims; d++) {
        x[d] = (double)m->places[index * (size_t)m->dims + (size_t)d];
    }
    find(m, x, index, neighbours[n - 1], &nearest);
    for (int k = 0; k < n; k++) {
        const size_t count = nearest.found < (size_t)neighbours[k] ? nearest.found : (size_t)neighbours[k];
        weigh(&nearest, count, weights);
        misses[k] = 0;
        for (int c = 0; c < model->channels; c++) {
            const double is = (double)m->values[index * (size_t)model->channels + (size_t)c];
            const double miss = sum_of(m, &nearest, count, weights, c) - is;
            misses[k] += miss * miss;
        }
    }
}

void gonio_kernel_model_set_neighbours(gonio_model *model, int neighbours) {
    ((kernel_model *)model)->neighbours = neighbours;
}

static void release(gonio_model *model) {
    kernel_model *m = (kernel_model *)model;
    if (m->channels.mapped.base == NULL) {
        free((void *)(uintptr_t)m->places);
        free((void *)(uintptr_t)m->values);
    }
    gonio_channels_free(&m->channels);
}

static gonio_status save(const gonio_model *model, FILE *stream, gonio_error *error) {
    const kernel_model *m = (const kernel_model *)model;
    const size_t channels = (size_t)model->channels;
    const description about = {.dims = (uint32_t)m->dims,
                               .distance = (uint32_t)m->distance,
                               .neighbours = (uint32_t)m->neighbours,
                               .transform = (uint32_t)m->channels.kind,
                               .n = m->n};
    const gonio_file_part parts[] = {{&about, sizeof about},
                                     {m->channels.transforms, channels * sizeof(gonio_transform)},
                                     {m->places, m->n * (size_t)m->dims * sizeof(float)},
                                     {m->values, m->n * channels * sizeof(float)}};
    return gonio_model_file_write(model, stream, parts, 4, error);
}

static const gonio_model_ops ops = {
    .kind = "kernel",
    .eval = eval,
    .eval_channel = eval_channel,
    .save = save,
    .free = release,
};

static gonio_status make(const kernel_model *like, bool isotropic, int channels, gonio_transform_kind kind,
                         const gonio_transform *transforms, const char (*names)[32], kernel_model **out,
                         gonio_error *error) {
    void *model;
    const gonio_status status = gonio_channels_new(sizeof **out, channels, kind, transforms, names, &model, error);
    if (status != GONIO_OK) {
        return status;
    }
    kernel_model *m = *out = model;
    gonio_model *head = &m->channels.head;
    m->distance = like->distance;
    m->dims = like->dims;
    m->neighbours = like->neighbours;
    m->n = like->n;
    m->places = like->places;
    m->values = like->values;
    head->ops = &ops;
    head->isotropic = isotropic;
    head->control_points = m->n;
    head->bytes =
        sizeof *m + (size_t)channels * sizeof *transforms + m->n * ((size_t)m->dims + (size_t)channels) * sizeof(float);
    return GONIO_OK;
}

// The samples in the tree's order.
static bool arrange(const gonio_kernel_parts *p, size_t dims, float *places, float *values) {
    const size_t channels = (size_t)p->channels;
    entry *entries = malloc(p->n * sizeof *entries);
    for (size_t i = 0; i < p->n && entries != NULL; i++) {
        const gonio_pair *pair = &p->pairs[i];
        double x[GONIO_KERNEL_DIMS_MAX] = {0};
        locate(p->distance, p->isotropic, gonio_direction(pair->theta_i, pair->phi_i),
               gonio_direction(pair->theta_o, pair->phi_o), x);
        entries[i].sample = i;
        for (size_t k = 0; k < GONIO_KERNEL_DIMS_MAX; k++) {
            entries[i].place[k] = (float)x[k];
        }
    }
    if (entries != NULL) {
        build(entries, 0, p->n, 0, (int)dims);
    }
    for (size_t i = 0; i < p->n && entries != NULL; i++) {
        memcpy(places + i * dims, entries[i].place, dims * sizeof *places);
        for (size_t c = 0; c < channels; c++) {
            values[i * channels + c] = (float)p->values[entries[i].sample * channels + c];
        }
    }
    const bool arranged = entries != NULL;
    free(entries);
    return arranged;
}

gonio_status gonio_kernel_model_new(const gonio_kernel_parts *p, gonio_model **out, gonio_error *error) {
    const size_t dims = (size_t)dims_of(p->distance, p->isotropic);
    float *places = malloc(p->n * dims * sizeof *places);
    float *values = malloc(p->n * (size_t)p->channels * sizeof *values);
    kernel_model *m = NULL;
    gonio_status status = places != NULL && values != NULL && arrange(p, dims, places, values)
                              ? GONIO_OK
                              : gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu samples in a tree", p->n);
    if (status == GONIO_OK) {
        const kernel_model like = {.distance = p->distance,
                                   .dims = (int)dims,
                                   .neighbours = p->neighbours,
                                   .n = p->n,
                                   .places = places,
                                   .values = values};
        status = make(&like, p->isotropic, p->channels, p->kind, p->transforms, p->names, &m, error);
    }
    *out = status == GONIO_OK ? &m->channels.head : NULL;
    if (status != GONIO_OK) {
        free(places);
        free(values);
    }
    return status;
}

static bool possible(const description *d, const gonio_mapped *mapped) {
    return d != NULL && d->distance < GONIO_DISTANCES && d->neighbours >= 1 && d->neighbours <= GONIO_NEAREST_MAX &&
           d->transform <= GONIO_TRANSFORM_POSITIVE && d->n >= 1 && d->n <= SIZE_MAX / 4096 / sizeof(float) &&
           d->dims == (uint32_t)dims_of((gonio_distance)d->distance, mapped->isotropic);
}

static gonio_status read_model(gonio_mapped *mapped, gonio_model **out, gonio_error *error) {
    size_t at = 0;
    const description *d = gonio_mapped_take(mapped, &at, sizeof *d);
    if (!possible(d, mapped)) {
        return gonio_mapped_fail(mapped, 0, "an impossible number of samples or neighbours, distance or domain", error);
    }
    const size_t channels = (size_t)mapped->channels, transforms_at = at, n = (size_t)d->n;
    const gonio_transform *transforms = gonio_mapped_take(mapped, &at, channels * sizeof *transforms);
    if (transforms == NULL ||
        !gonio_scales_possible(&transforms->scale, channels, d->transform != GONIO_TRANSFORM_LINEAR)) {
        return gonio_mapped_fail(mapped, transforms_at, "a channel's scale or eps that no fit makes", error);
    }
    const size_t places_at = at;
    const float *places = gonio_mapped_take(mapped, &at, n * d->dims * sizeof(float));
    const float *values = places != NULL ? gonio_mapped_take(mapped, &at, n * channels * sizeof(float)) : NULL;
    if (values == NULL) {
        return gonio_mapped_fail(mapped, places_at, "fewer samples than it says", error);
    }
    const kernel_model like = {.distance = (gonio_distance)d->distance,
                               .dims = (int)d->dims,
                               .neighbours = (int)d->neighbours,
                               .n = n,
                               .places = places,
                               .values = values};
    kernel_model *m;
    const gonio_status status = make(&like, mapped->isotropic, mapped->channels, (gonio_transform_kind)d->transform,
                                     transforms, NULL, &m, error);
    if (status == GONIO_OK) {
        gonio_channels_adopt(&m->channels, mapped);
        *out = &m->channels.head;
    }
    return status;
}

const gonio_kind gonio_kind_kernel = {
    .name = "kernel",
    .summary = "the samples themselves, and a Gaussian mean of those nearest to a pair",
    .ops = &ops,
    .read = read_model,
};
