// SPDX-License-Identifier: BSD-3-Clause
// Models of kind "cbmba": evaluation and file section.
//
// Section: 64 bytes of description, the transforms, the diffuse control points; then with bricks the table, the bricks,
// and (bytes) their scales; with a hash the keys, the values and libcmph's packed block or Jenkins' moves; then, where
// there is one, the uncertainty. Each part aligned.
#include "brdf/kind/bilevel.h"

#include <math.h>
#include <stdlib.h>

#include "brdf/channels.h"
#include "brdf/kind.h"
#include "brdf/locate.h"
#include "brdf/model_file.h"

#define LEVEL_MAX 9 // of the dense lattices in a file

typedef struct bilevel_model {
    gonio_channels channels;
    gonio_bilevel_parts parts;
    gonio_lattice diffuse; // a view on parts.diffuse
} bilevel_model;

typedef struct description {
    uint32_t diffuse_level, specular_level, coordinates, kind, storage, key_bytes; // key_bytes 0: 4
    uint64_t bricks, keys, packed, kept;                                           // bricks: of Jenkins' slots
    uint32_t salt, sigma; // 1 + level of the uncertainty's lattice; 0: none
} description;
_Static_assert(sizeof(description) == 64, "the description is one block");

static inline void locate(const bilevel_model *m, gonio_vec3 wi, gonio_vec3 wo, gonio_position *position) {
    double x[4] = {0};
    if (m->diffuse.dims == 4) {
        gonio_coordinates_anisotropic(m->parts.coordinates, wi, wo, x);
    } else {
        gonio_locate_isotropic(m->parts.coordinates, wi, wo, x);
    }
    gonio_position_set(position, x[0], x[1], x[2], x[3]);
}

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const bilevel_model *m = (const bilevel_model *)model;
    float v[model->channels];
    gonio_position position;
    locate(m, wi, wo, &position);
    gonio_lattice_eval_positions(&m->diffuse, 1, &position, v);
    gonio_sparse_add(&m->parts.sparse, &position, v);
    for (int c = 0; c < model->channels; c++) {
        values[c] = gonio_transform_invert(m->parts.kind, &m->channels.transforms[c], (double)v[c]);
    }
}

static void eval_f32(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, float *values) {
    const bilevel_model *m = (const bilevel_model *)model;
    gonio_position position;
    locate(m, wi, wo, &position);
    gonio_lattice_eval_positions(&m->diffuse, 1, &position, values);
    gonio_sparse_add(&m->parts.sparse, &position, values);
    for (int c = 0; c < model->channels; c++) {
        values[c] = (float)gonio_transform_invert(m->parts.kind, &m->channels.transforms[c], (double)values[c]);
    }
}

// What the kept parts leave open, and what falls back to the diffuse lattice.
static void sigma_of(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *sigma) {
    const bilevel_model *m = (const bilevel_model *)model;
    float v[model->channels], ln[2];
    gonio_position position;
    locate(m, wi, wo, &position);
    gonio_lattice_eval_positions(&m->parts.sigma, 1, &position, ln);
    gonio_lattice_eval_positions(&m->diffuse, 1, &position, v);
    gonio_sparse_add(&m->parts.sparse, &position, v);
    const double open = 1 - gonio_sparse_covered(&m->parts.sparse, &position),
                 transformed = hypot(exp((double)ln[0]), open * exp((double)ln[1]));
    for (int c = 0; c < model->channels; c++) {
        sigma[c] = transformed * fabs(gonio_transform_slope(m->parts.kind, &m->channels.transforms[c], (double)v[c]));
    }
}

// Arrays are const where a mapped file holds them; our own come from malloc.
static void drop(const void *owned) { free((void *)(uintptr_t)owned); }

void gonio_bilevel_parts_release(gonio_bilevel_parts *parts) {
    free(parts->diffuse);
    free(parts->sigma.points);
    drop(parts->sparse.table);
    drop(parts->sparse.data);
    drop(parts->sparse.scales);
    drop(parts->sparse.key);
    drop(parts->sparse.values);
    drop(parts->sparse.packed);
    *parts = (gonio_bilevel_parts){0};
}

static void release(gonio_model *model) {
    bilevel_model *m = (bilevel_model *)model;
    if (m->channels.mapped.base == NULL) {
        gonio_bilevel_parts_release(&m->parts);
    }
    gonio_channels_free(&m->channels);
}

static size_t diffuse_bytes(int dims, int level, int channels) {
    return gonio_lattice_count(dims, level) * (size_t)channels * sizeof(float);
}

static gonio_status save(const gonio_model *model, FILE *stream, gonio_error *error) {
    const bilevel_model *m = (const bilevel_model *)model;
    const gonio_sparse *s = &m->parts.sparse;
    const size_t c = (size_t)model->channels;
    const description about = {.diffuse_level = (uint32_t)m->parts.diffuse_level,
                               .specular_level = (uint32_t)s->level,
                               .coordinates = (uint32_t)m->parts.coordinates,
                               .kind = (uint32_t)m->parts.kind,
                               .storage = (uint32_t)s->storage,
                               .bricks = s->storage == GONIO_STORAGE_JENKINS ? s->slots : s->bricks,
                               .key_bytes = gonio_sparse_hashed(s->storage) ? (uint32_t)s->key_bytes : 0,
                               .salt = s->jenkins.salt,
                               .sigma = m->parts.sigma.points != NULL ? 1 + (uint32_t)m->parts.sigma.level : 0,
                               .keys = s->keys,
                               .packed = s->packed_length,
                               .kept = m->parts.kept};
    int n = 6;
    gonio_file_part parts[7] = {
        {&about, sizeof about},
        {m->channels.transforms, c * sizeof *m->channels.transforms},
        {m->parts.diffuse, diffuse_bytes(s->dims, m->parts.diffuse_level, model->channels)},
    };
    if (gonio_sparse_hashed(s->storage)) {
        parts[3] = (gonio_file_part){s->key, gonio_sparse_key_array(s->key_bytes, s->slots)};
        parts[4] = (gonio_file_part){s->values, s->slots * c * sizeof *s->values};
        parts[5] = (gonio_file_part){s->packed, s->packed_length};
    } else {
        const bool bytes = s->storage == GONIO_STORAGE_BYTE;
        parts[3] = (gonio_file_part){s->table, s->side * s->side * s->side * sizeof *s->table};
        parts[4] = (gonio_file_part){s->data, s->bricks * c * GONIO_BRICK_POINTS * gonio_sparse_element(s->storage)};
        parts[5] = (gonio_file_part){s->scales, bytes ? s->bricks * c * sizeof *s->scales : 0};
        n = bytes ? 6 : 5;
    }
    if (about.sigma != 0) {
        parts[n++] = (gonio_file_part){m->parts.sigma.points, diffuse_bytes(s->dims, m->parts.sigma.level, 2)};
    }
    return gonio_model_file_write(model, stream, parts, n, error);
}

static const gonio_model_ops bilevel_ops = {
    .kind = "cbmba",
    .eval = eval,
    .eval_f32 = eval_f32,
    .sigma = sigma_of,
    .save = save,
    .free = release,
};
static const gonio_model_ops plain_ops = {
    .kind = "cbmba",
    .eval = eval,
    .eval_f32 = eval_f32,
    .save = save,
    .free = release,
};

static gonio_status new_model(const gonio_bilevel_parts *parts, const gonio_transform *transforms,
                              const char (*names)[32], bilevel_model **out, gonio_error *error) {
    void *model;
    const gonio_sparse *s = &parts->sparse;
    const gonio_status status =
        gonio_channels_new(sizeof **out, s->channels, parts->kind, transforms, names, &model, error);
    if (status != GONIO_OK) {
        return status;
    }
    const int level = parts->diffuse_level;
    const size_t diffuse = gonio_lattice_count(s->dims, level);
    bilevel_model *m = *out = model;
    m->parts = *parts;
    m->diffuse = (gonio_lattice){s->dims, level, s->channels, gonio_bspline_size(level), diffuse, parts->diffuse};
    gonio_model *head = &m->channels.head;
    head->ops = parts->sigma.points != NULL ? &bilevel_ops : &plain_ops;
    head->isotropic = s->dims == 3;
    head->control_points = diffuse + parts->kept;
    head->bytes = diffuse_bytes(s->dims, level, s->channels) + gonio_sparse_bytes(s);
    if (parts->sigma.points != NULL) {
        head->bytes += diffuse_bytes(s->dims, parts->sigma.level, 2);
    }
    return GONIO_OK;
}

gonio_status gonio_bilevel_model_new(gonio_bilevel_parts *parts, const gonio_transform *transforms,
                                     const char (*channel_names)[32], gonio_model **out, gonio_error *error) {
    *out = NULL;
    bilevel_model *m;
    const gonio_status status = new_model(parts, transforms, channel_names, &m, error);
    if (status == GONIO_OK) {
        *parts = (gonio_bilevel_parts){0};
        *out = &m->channels.head;
    }
    return status;
}

// Bricks: the table may name only bricks that exist.
static gonio_status read_bricks(gonio_mapped *mapped, size_t *at, gonio_sparse *s, gonio_error *error) {
    const size_t cells = s->side * s->side * s->side, c = (size_t)s->channels, table_at = *at;
    if (s->bricks < 1 || s->bricks > UINT16_MAX + 1) {
        return gonio_mapped_fail(mapped, 0, "an impossible number of bricks", error);
    }
    s->table = gonio_mapped_take(mapped, at, cells * sizeof *s->table);
    s->data = s->table != NULL
                  ? gonio_mapped_take(mapped, at, s->bricks * c * GONIO_BRICK_POINTS * gonio_sparse_element(s->storage))
                  : NULL;
    s->scales = s->data != NULL && s->storage == GONIO_STORAGE_BYTE
                    ? gonio_mapped_take(mapped, at, s->bricks * c * sizeof *s->scales)
                    : NULL;
    if (s->data == NULL || (s->storage == GONIO_STORAGE_BYTE && s->scales == NULL)) {
        return gonio_mapped_fail(mapped, table_at, "fewer bricks than its head says", error);
    }
    for (size_t i = 0; i < cells; i++) {
        if (s->table[i] >= s->bricks) {
            return gonio_mapped_fail(mapped, table_at + 2 * i, "a brick number beyond the last brick", error);
        }
    }
    return GONIO_OK;
}

static gonio_status read_hash(gonio_mapped *mapped, size_t *at, gonio_sparse *s, gonio_error *error) {
    const size_t keys_at = *at, c = (size_t)s->channels;
    const int kb = s->key_bytes;
    const bool jenkins = s->storage == GONIO_STORAGE_JENKINS;
    if (s->keys > gonio_lattice_count(s->dims, s->level) || s->slots < s->keys || s->slots > UINT32_MAX / 8 ||
        (jenkins && (s->slots == 0 || s->slots > GONIO_JENKINS_SLOTS_MAX)) || (kb != 3 && kb != 4) ||
        (jenkins && (s->packed_length == 0 || s->packed_length > UINT32_MAX / 8))) {
        return gonio_mapped_fail(mapped, 0, "more keys than control points, or of an impossible width", error);
    }
    s->key = gonio_mapped_take(mapped, at, gonio_sparse_key_array(s->key_bytes, s->slots));
    s->values = s->key != NULL ? gonio_mapped_take(mapped, at, s->slots * c * sizeof *s->values) : NULL;
    s->packed = s->values != NULL ? gonio_mapped_take(mapped, at, s->packed_length) : NULL;
    if (s->packed == NULL) {
        return gonio_mapped_fail(mapped, keys_at, "fewer hashed control points than its head says", error);
    }
    if (jenkins) {
        s->jenkins.slots = (uint32_t)s->slots;
        s->jenkins.buckets = (uint32_t)s->packed_length;
        s->jenkins.moves = s->packed;
    } else if (s->keys > 0 && !gonio_perfect_hash_unpack(s->packed, s->packed_length, &s->hash)) {
        return gonio_mapped_fail(mapped, keys_at, "its perfect hash is not sound", error);
    }
    return GONIO_OK;
}

// Behind all else.
static gonio_status read_sigma(gonio_mapped *mapped, size_t *at, uint32_t told, gonio_bilevel_parts *parts,
                               gonio_error *error) {
    if (told == 0) {
        return GONIO_OK;
    }
    if (told > 1 + LEVEL_MAX) {
        return gonio_mapped_fail(mapped, 0, "an uncertainty of an impossible level", error);
    }
    const int dims = parts->sparse.dims, level = (int)told - 1;
    const void *points = gonio_mapped_take(mapped, at, diffuse_bytes(dims, level, 2));
    parts->sigma = (gonio_lattice){
        dims, level, 2, gonio_bspline_size(level), gonio_lattice_count(dims, level), (void *)(uintptr_t)points};
    return points != NULL ? GONIO_OK
                          : gonio_mapped_fail(mapped, 0, "fewer values of its uncertainty than its level has", error);
}

static gonio_status read_parts(gonio_mapped *mapped, gonio_bilevel_parts *parts, const gonio_transform **transforms,
                               gonio_error *error) {
    size_t at = 0;
    const description *about = gonio_mapped_take(mapped, &at, sizeof *about);
    if (about == NULL || (!mapped->isotropic && about->storage < GONIO_STORAGE_HASH) ||
        about->diffuse_level > LEVEL_MAX || about->specular_level > 9 || about->coordinates >= GONIO_COORDINATES ||
        about->kind > GONIO_TRANSFORM_ASINH || about->storage >= GONIO_STORAGES) {
        return gonio_mapped_fail(mapped, 0, "a cbmba model of impossible levels, coordinates or storage", error);
    }
    const size_t c = (size_t)mapped->channels;
    *parts = (gonio_bilevel_parts){.coordinates = (gonio_coordinates)about->coordinates,
                                   .kind = (gonio_transform_kind)about->kind,
                                   .diffuse_level = (int)about->diffuse_level,
                                   .kept = about->kept};
    gonio_sparse *s = &parts->sparse;
    const bool jenkins = about->storage == GONIO_STORAGE_JENKINS;
    *s = (gonio_sparse){.dims = mapped->isotropic ? 3 : 4,
                        .level = (int)about->specular_level,
                        .channels = mapped->channels,
                        .storage = (gonio_storage)about->storage,
                        .side = gonio_sparse_side((int)about->specular_level),
                        .bricks = jenkins ? 0 : about->bricks,
                        .keys = about->keys,
                        .slots = jenkins ? about->bricks : about->keys,
                        .key_bytes = about->key_bytes != 0 ? (int)(about->key_bytes & 7) : 4,
                        .jenkins = {.salt = about->salt},
                        .packed_length = about->packed};
    *transforms = gonio_mapped_take(mapped, &at, c * sizeof **transforms);
    const void *diffuse =
        *transforms != NULL
            ? gonio_mapped_take(mapped, &at, diffuse_bytes(s->dims, parts->diffuse_level, mapped->channels))
            : NULL;
    if (diffuse == NULL) {
        return gonio_mapped_fail(mapped, 0, "fewer diffuse control points than its level and channels need", error);
    }
    if (!gonio_scales_possible(&(*transforms)->scale, c, about->kind != GONIO_TRANSFORM_LINEAR)) {
        return gonio_mapped_fail(mapped, sizeof *about, "a channel's scale or eps that no fit makes", error);
    }
    parts->diffuse = (void *)(uintptr_t)diffuse; // never written: models are immutable
    const gonio_status status =
        gonio_sparse_hashed(s->storage) ? read_hash(mapped, &at, s, error) : read_bricks(mapped, &at, s, error);
    return status == GONIO_OK ? read_sigma(mapped, &at, about->sigma, parts, error) : status;
}

static gonio_status read_model(gonio_mapped *mapped, gonio_model **out, gonio_error *error) {
    gonio_bilevel_parts parts;
    const gonio_transform *transforms = NULL;
    bilevel_model *m;
    gonio_status status = read_parts(mapped, &parts, &transforms, error);
    status = status == GONIO_OK ? new_model(&parts, transforms, NULL, &m, error) : status;
    if (status == GONIO_OK) {
        gonio_channels_adopt(&m->channels, mapped);
        *out = &m->channels.head;
    }
    return status;
}

const gonio_kind gonio_kind_cbmba = {
    .name = "cbmba",
    .summary = "a coarse B-spline for the diffuse part and a sparse fine one for the lobes",
    .ops = &bilevel_ops,
    .read = read_model,
};
