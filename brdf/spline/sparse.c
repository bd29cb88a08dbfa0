// SPDX-License-Identifier: BSD-3-Clause
// Evaluation of sparse lattices.
//
// A cell's row of four control points along the last axis begins anywhere in a brick, so it is read as two brick rows
// of four, and the last axis' weights stand at the right four of eight places, the others 0: no gathering of single
// points.
#include "brdf/spline/sparse.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "brdf/spline/rows.h"

typedef uint16_t half16 __attribute__((vector_size(32), aligned(2), may_alias));
typedef int8_t byte16 __attribute__((vector_size(16), aligned(1), may_alias));
typedef float f8 __attribute__((vector_size(32), aligned(4), may_alias));
typedef int16_t short16 __attribute__((vector_size(32)));
typedef int32_t wide16 __attribute__((vector_size(64)));
typedef uint32_t word16 __attribute__((vector_size(64)));

size_t gonio_sparse_element(gonio_storage storage) {
    return storage == GONIO_STORAGE_FLOAT ? 4 : storage == GONIO_STORAGE_HALF ? 2 : 1;
}

size_t gonio_sparse_bytes(const gonio_sparse *s) {
    const size_t c = (size_t)s->channels;
    if (gonio_sparse_hashed(s->storage)) {
        return s->slots * ((size_t)s->key_bytes + c * sizeof *s->values) + s->packed_length;
    }
    const size_t scales = s->storage == GONIO_STORAGE_BYTE ? s->bricks * c * sizeof *s->scales : 0;
    return s->side * s->side * s->side * sizeof *s->table + scales +
           s->bricks * c * GONIO_BRICK_POINTS * gonio_sparse_element(s->storage);
}

// A half's exponent and fraction, moved to a float's place, give the value times 2^-112, subnormals included.
GONIO_INLINE void decode_halves(const uint16_t *from, gonio_f16 *out) {
    const word16 h = __builtin_convertvector(*(const half16 *)from, word16);
    const word16 magnitude = (h & 0x7fff) << 13, sign = (h & 0x8000) << 16;
    gonio_f16 f;
    memcpy(&f, &magnitude, sizeof f);
    f *= 0x1p112f;
    word16 bits;
    memcpy(&bits, &f, sizeof bits);
    bits |= sign;
    memcpy(out, &bits, sizeof *out);
}

// The 16 control points of a brick with one first index: contiguous.
GONIO_INLINE void load_plane(const void *data, size_t element, const gonio_storage storage, gonio_f16 *out) {
    if (storage == GONIO_STORAGE_FLOAT) {
        *out = *(const gonio_f16 *)((const float *)data + element);
    } else if (storage == GONIO_STORAGE_HALF) {
        decode_halves((const uint16_t *)data + element, out);
    } else {
        // Width by width: GCC 12 takes the step from bytes to floats one number at a time.
        const short16 wide = __builtin_convertvector(*(const byte16 *)((const int8_t *)data + element), short16);
        *out = __builtin_convertvector(__builtin_convertvector(wide, wide16), gonio_f16);
    }
}

// The four basis functions of a cell as polynomials: coefficient[power][k], for Horner's rule in all lanes at once.
#define SIXTH (1.0f / 6)
#define BASIS0 SIXTH, 4 * SIXTH, SIXTH, 0
#define BASIS1 -0.5f, 0, 0.5f, 0
#define BASIS2 0.5f, -1, 0.5f, 0
#define BASIS3 -SIXTH, 0.5f, -0.5f, SIXTH
static const float basis_coefficients[4][4] = {{BASIS0}, {BASIS1}, {BASIS2}, {BASIS3}};

// The same at places low .. low + 3 of eight, 0 elsewhere: [low][power][place]. Computing the weights where they belong
// beats moving them there: a store at a varying place and a load across it stall.
static const float placed_coefficients[4][4][8] = {
    {{BASIS0}, {BASIS1}, {BASIS2}, {BASIS3}},
    {{0, BASIS0}, {0, BASIS1}, {0, BASIS2}, {0, BASIS3}},
    {{0, 0, BASIS0}, {0, 0, BASIS1}, {0, 0, BASIS2}, {0, 0, BASIS3}},
    {{0, 0, 0, BASIS0}, {0, 0, 0, BASIS1}, {0, 0, 0, BASIS2}, {0, 0, 0, BASIS3}},
};

// The bricks that the cell's points lie in, and the weights: of the first axis, and of the 16 points of a plane of the
// bricks [j][k] over the other two, zero where a point is not the cell's.
typedef struct brick_cell {
    uint32_t brick[2][4]; // [first axis][2 j + k]
    uint32_t low;         // the cell's first point along the first axis, within its first brick
    float first[4];
    gonio_f16 plane[4]; // [2 j + k]
} brick_cell;

GONIO_INLINE void place_in_cell(const gonio_position *position, int level, gonio_f4 *t) {
    const gonio_i4 part = (gonio_i4)(*(const gonio_u4 *)position->x << (uint32_t)level >> 1);
    *t = __builtin_convertvector(part, gonio_f4) * 0x1p-31f;
}

GONIO_INLINE void basis_at(const gonio_f4 *t, const int axis, gonio_f4 *out) {
    const gonio_f4 *c = (const gonio_f4 *)basis_coefficients;
    const float x = (*t)[axis];
    *out = ((c[3] * x + c[2]) * x + c[1]) * x + c[0];
}

GONIO_INLINE void placed_basis_at(const gonio_f4 *t, const int axis, uint32_t low, f8 *out) {
    const f8 *c = (const f8 *)placed_coefficients[low];
    const float x = (*t)[axis];
    *out = ((c[3] * x + c[2]) * x + c[1]) * x + c[0];
}

// Returns 0 where all bricks are empty.
GONIO_INLINE uint32_t find_bricks(const gonio_sparse *s, const gonio_position *position, brick_cell *cell) {
    uint32_t first[3], low[3];
    GONIO_UNROLL
    for (int d = 0; d < 3; d++) {
        const uint32_t c = gonio_bspline_cell(position->x[d], s->level);
        first[d] = c >> 2;
        low[d] = c & 3;
    }
    const uint16_t *table = s->table + (first[0] * s->side + first[1]) * s->side + first[2];
    uint32_t any = 0;
    GONIO_UNROLL
    for (size_t k = 0; k < 8; k++) {
        // A cell that begins with its brick lies in it alone; its neighbours' weights are 0.
        const uint32_t id = table[((k >> 2) * s->side + (k >> 1 & 1)) * s->side + (k & 1)];
        cell->brick[k >> 2][k & 3] = id;
        any |= id;
    }
    cell->low = low[0];
    return any;
}

GONIO_INLINE void fill_weights(const gonio_sparse *s, const gonio_position *position, brick_cell *cell) {
    gonio_f4 t;
    f8 y, z;
    place_in_cell(position, s->level, &t);
    basis_at(&t, 0, (gonio_f4 *)cell->first);
    placed_basis_at(&t, 1, gonio_bspline_cell(position->x[1], s->level) & 3, &y);
    placed_basis_at(&t, 2, gonio_bspline_cell(position->x[2], s->level) & 3, &z);
    const gonio_f16 y0 = __builtin_shufflevector(y, y, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
    const gonio_f16 y1 = __builtin_shufflevector(y, y, 4, 4, 4, 4, 5, 5, 5, 5, 6, 6, 6, 6, 7, 7, 7, 7);
    const gonio_f16 z0 = __builtin_shufflevector(z, z, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3);
    const gonio_f16 z1 = __builtin_shufflevector(z, z, 4, 5, 6, 7, 4, 5, 6, 7, 4, 5, 6, 7, 4, 5, 6, 7);
    cell->plane[0] = y0 * z0;
    cell->plane[1] = y0 * z1;
    cell->plane[2] = y1 * z0;
    cell->plane[3] = y1 * z1;
}

GONIO_INLINE float sum_bricks(const gonio_sparse *s, const brick_cell *cell, size_t channel,
                              const gonio_storage storage) {
    const size_t channels = (size_t)s->channels;
    gonio_f16 total = {0};
    GONIO_UNROLL
    for (uint32_t n = 0; n < 4; n++) {
        gonio_f16 sum = {0}, points;
        if ((cell->brick[0][n] | cell->brick[1][n]) == 0) {
            continue;
        }
        GONIO_UNROLL
        for (uint32_t r = 0; r < 4; r++) {
            const uint32_t i = cell->low + r;
            const size_t block = (size_t)cell->brick[i >> 2][n] * channels + channel;
            load_plane(s->data, block * GONIO_BRICK_POINTS + (i & 3) * 16, storage, &points);
            sum += (storage == GONIO_STORAGE_BYTE ? cell->first[r] * s->scales[block] : cell->first[r]) * points;
        }
        total += sum * cell->plane[n];
    }
    float lanes[16];
    memcpy(lanes, &total, sizeof lanes);
    const gonio_f4 four = (*(const gonio_f4 *)lanes + *(const gonio_f4 *)(lanes + 4)) +
                          (*(const gonio_f4 *)(lanes + 8) + *(const gonio_f4 *)(lanes + 12));
    return (four[0] + four[1]) + (four[2] + four[3]);
}

GONIO_INLINE void add_bricks(const gonio_sparse *s, const gonio_position *position, float *values,
                             const gonio_storage storage) {
    brick_cell cell;
    if (!find_bricks(s, position, &cell)) {
        return;
    }
    fill_weights(s, position, &cell);
    for (int c = 0; c < s->channels; c++) {
        values[c] += sum_bricks(s, &cell, (size_t)c, storage);
    }
}

GONIO_CLONES static void add_float(const gonio_sparse *s, const gonio_position *position, float *values) {
    add_bricks(s, position, values, GONIO_STORAGE_FLOAT);
}
GONIO_CLONES static void add_half(const gonio_sparse *s, const gonio_position *position, float *values) {
    add_bricks(s, position, values, GONIO_STORAGE_HALF);
}
GONIO_CLONES static void add_byte(const gonio_sparse *s, const gonio_position *position, float *values) {
    add_bricks(s, position, values, GONIO_STORAGE_BYTE);
}

// Of the least significant byte first.
static inline uint32_t key_at(const gonio_sparse *s, size_t slot) {
    uint32_t key;
    memcpy(&key, s->key + slot * (size_t)s->key_bytes, sizeof key);
    return s->key_bytes == 3 ? key & 0xffffff : key;
}

uint32_t gonio_sparse_key(const gonio_sparse *s, size_t slot) { return key_at(s, slot); }

// The control points of a cell: their keys, and the weights of its rows along the last axis.
typedef struct probes {
    uint32_t rows, key[64]; // of each row's first point
    double weight[64];
    gonio_place place;
} probes;

static void set_probes(const gonio_sparse *s, const gonio_position *position, probes *p) {
    const uint32_t size = (uint32_t)gonio_bspline_size(s->level);
    const int dims = s->dims;
    if (dims == 4) {
        gonio_rows_locate(position->x, s->level, size, 4, &p->place);
    } else {
        gonio_rows_locate(position->x, s->level, size, 3, &p->place);
    }
    p->rows = dims == 4 ? 64 : 16;
    for (uint32_t r = 0; r < p->rows; r++) {
        const uint32_t i = r / 16, j = r / 4 % 4, k = r % 4;
        const uint32_t outer = dims == 4 ? (i * size + j) * size : j * size;
        p->key[r] = (uint32_t)p->place.first + (outer + k) * size;
        const double inner = p->place.basis[j][dims - 3] * p->place.basis[k][dims - 2];
        p->weight[r] = dims == 4 ? p->place.basis[i][0] * inner : inner;
    }
}

static void add_entry(const gonio_sparse *s, size_t entry, double weight, float *values) {
    for (size_t c = 0; c < (size_t)s->channels; c++) {
        values[c] += (float)weight * s->values[entry * (size_t)s->channels + c];
    }
}

// Kameya 2002, chapter 6: the hash names an entry for any key; only the key stored there tells whether it is the one.
static void add_hash(const gonio_sparse *s, const gonio_position *position, float *values) {
    probes p;
    set_probes(s, position, &p);
    for (uint32_t n = 0; n < 4 * p.rows && s->keys > 0; n++) {
        const uint32_t key = p.key[n / 4] + n % 4, entry = gonio_perfect_hash_search(&s->hash, key);
        if (entry < s->keys && key_at(s, entry) == key) {
            add_entry(s, entry, p.weight[n / 4] * p.place.basis[n % 4][s->dims - 1], values);
        }
    }
}

// All slots first, so that no look-up waits for another one.
GONIO_INLINE void probe_jenkins(const gonio_sparse *s, const probes *p, const uint32_t rows, float *values) {
    const gonio_jenkins_hash hash = s->jenkins;
    uint32_t slots[256];
    for (uint32_t r = 0; r < rows; r++) {
        GONIO_UNROLL
        for (uint32_t k = 0; k < 4; k++) {
            slots[4 * r + k] = gonio_jenkins_search(&hash, p->key[r] + k);
        }
    }
    const uint32_t mask = s->key_bytes == 3 ? 0xffffff : 0xffffffff;
    const size_t bytes = (size_t)s->key_bytes;
    for (uint32_t r = 0; r < rows; r++) {
        GONIO_UNROLL
        for (uint32_t k = 0; k < 4; k++) {
            uint32_t key;
            memcpy(&key, s->key + slots[4 * r + k] * bytes, sizeof key);
            if (((key ^ (p->key[r] + k)) & mask) == 0) {
                add_entry(s, slots[4 * r + k], p->weight[r] * p->place.basis[k][s->dims - 1], values);
            }
        }
    }
}

GONIO_CLONES static void add_jenkins(const gonio_sparse *s, const gonio_position *position, float *values) {
    probes p;
    set_probes(s, position, &p);
    if (s->keys == 0) {
        return;
    }
    if (s->dims == 4) {
        probe_jenkins(s, &p, 64, values);
    } else {
        probe_jenkins(s, &p, 16, values);
    }
}

void gonio_sparse_add(const gonio_sparse *sparse, const gonio_position *position, float *values) {
    switch (sparse->storage) {
    case GONIO_STORAGE_FLOAT:
        add_float(sparse, position, values);
        break;
    case GONIO_STORAGE_HALF:
        add_half(sparse, position, values);
        break;
    case GONIO_STORAGE_BYTE:
        add_byte(sparse, position, values);
        break;
    case GONIO_STORAGE_HASH:
        add_hash(sparse, position, values);
        break;
    case GONIO_STORAGE_JENKINS:
        add_jenkins(sparse, position, values);
        break;
    }
}

uint16_t gonio_half_encode(float value) {
    const uint16_t sign = signbit(value) ? 0x8000 : 0;
    const float a = fminf(fabsf(value), 65504);
    if (a < 0x1p-14f) {
        return (uint16_t)(sign | (uint16_t)lrintf(a * 0x1p24f));
    }
    uint32_t bits;
    memcpy(&bits, &a, sizeof bits);
    bits += 0xfff + (bits >> 13 & 1);
    return (uint16_t)(sign | (uint16_t)((bits >> 13) - (112u << 10)));
}

float gonio_half_decode(uint16_t half) {
    const uint16_t halves[16] = {half};
    gonio_f16 out;
    decode_halves(halves, &out);
    return out[0];
}

// ---- coverage ----

static bool is_there(const gonio_sparse *s, size_t point) {
    const size_t size = gonio_bspline_size(s->level);
    if (s->storage == GONIO_STORAGE_JENKINS || s->storage == GONIO_STORAGE_HASH) {
        if (s->keys == 0) {
            return false;
        }
        const uint32_t key = (uint32_t)point;
        const size_t slot = s->storage == GONIO_STORAGE_JENKINS ? gonio_jenkins_search(&s->jenkins, key)
                                                                : gonio_perfect_hash_search(&s->hash, key);
        return slot < s->slots && key_at(s, slot) == key;
    }
    const size_t k = point % size, j = point / size % size, i = point / size / size;
    return s->table[(i / 4 * s->side + j / 4) * s->side + k / 4] != 0;
}

double gonio_sparse_covered(const gonio_sparse *s, const gonio_position *position) {
    const size_t size = gonio_bspline_size(s->level);
    double w[4][4], sum = 0;
    size_t first[4];
    for (int d = 0; d < s->dims; d++) {
        first[d] = gonio_bspline_cell(position->x[d], s->level);
        gonio_bspline_weights(gonio_bspline_place(position->x[d], s->level), w[d]);
    }
    for (size_t p = 0; p < (size_t)1 << 2 * s->dims; p++) {
        size_t point = 0;
        double weight = 1;
        for (int d = 0; d < s->dims; d++) {
            const size_t k = p >> 2 * (s->dims - 1 - d) & 3;
            point = point * size + first[d] + k;
            weight *= w[d][k];
        }
        sum += is_there(s, point) ? weight : 0;
    }
    return fmin(sum, 1);
}
