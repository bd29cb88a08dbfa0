// Evaluation of sparse lattices.
//
// A cell's row of four control points along the last axis begins anywhere in a brick, so it is read as two brick rows
// of four, and the last axis' weights stand at the right four of eight places, the others 0: no gathering of single
// points.
#include "fit/sparse.h"

#include <math.h>
#include <string.h>

#include "fit/rows.h"

typedef uint16_t half16 __attribute__((vector_size(32), aligned(2), may_alias));
typedef int8_t byte16 __attribute__((vector_size(16), aligned(1), may_alias));
typedef uint32_t word16 __attribute__((vector_size(64)));

size_t gonio_sparse_element(gonio_storage storage) {
    return storage == GONIO_STORAGE_FLOAT ? 4 : storage == GONIO_STORAGE_HALF ? 2 : 1;
}

size_t gonio_sparse_bytes(const gonio_sparse *s) {
    const size_t c = (size_t)s->channels;
    if (s->storage == GONIO_STORAGE_HASH) {
        return s->keys * (sizeof *s->key + c * sizeof *s->values) + s->packed_length;
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
        *out = __builtin_convertvector(*(const byte16 *)((const int8_t *)data + element), gonio_f16);
    }
}

// The bricks that the cell's points lie in, and the weights: of the first axis, and of the 16 points of a plane of the
// bricks [j][k] over the other two, zero where a point is not the cell's.
typedef struct brick_cell {
    uint32_t brick[2][2][2];
    uint32_t low[3]; // the cell's first point within its first brick
    float first[4];
    gonio_f16 plane[2][2];
} brick_cell;

// False where all bricks are empty.
GONIO_INLINE bool find_bricks(const gonio_sparse *s, const gonio_position *position, brick_cell *cell) {
    uint32_t any = 0, first[3];
    for (int d = 0; d < 3; d++) {
        const uint32_t c = gonio_bspline_cell(position->x[d], s->level);
        first[d] = c >> 2;
        cell->low[d] = c & 3;
    }
    const uint16_t *table = s->table + (first[0] * s->side + first[1]) * s->side + first[2];
    GONIO_UNROLL
    for (size_t k = 0; k < 8; k++) {
        // A cell that begins with its brick lies in it alone; its neighbours' weights are 0.
        const uint32_t id = table[((k >> 2) * s->side + (k >> 1 & 1)) * s->side + (k & 1)];
        cell->brick[k >> 2][k >> 1 & 1][k & 1] = id;
        any |= id;
    }
    return any != 0;
}

// Four weights at place `low` of eight.
GONIO_INLINE void spread_weights(const gonio_d4 *w, uint32_t low, float out[8]) {
    const gonio_f4 zero = {0};
    *(gonio_f4 *)out = zero;
    *(gonio_f4 *)(out + 4) = zero;
    *(gonio_f4 *)(out + low) = __builtin_convertvector(*w, gonio_f4);
}

GONIO_INLINE void fill_weights(const gonio_sparse *s, const gonio_position *position, brick_cell *cell) {
    gonio_place place;
    float y[8], z[8];
    gonio_rows_locate(position->x, s->level, gonio_bspline_size(s->level), 3, &place);
    const gonio_d4 *b = place.basis;
    const gonio_d4 x = {b[0][0], b[1][0], b[2][0], b[3][0]}, middle = {b[0][1], b[1][1], b[2][1], b[3][1]},
                   last = {b[0][2], b[1][2], b[2][2], b[3][2]};
    *(gonio_f4 *)cell->first = __builtin_convertvector(x, gonio_f4);
    spread_weights(&middle, cell->low[1], y);
    spread_weights(&last, cell->low[2], z);
    GONIO_UNROLL
    for (int n = 0; n < 4; n++) {
        const float *v = y + 4 * (n / 2);
        const gonio_f4 w = *(const gonio_f4 *)(z + 4 * (n % 2));
        float *out = (float *)&cell->plane[n / 2][n % 2];
        *(gonio_f4 *)out = v[0] * w;
        *(gonio_f4 *)(out + 4) = v[1] * w;
        *(gonio_f4 *)(out + 8) = v[2] * w;
        *(gonio_f4 *)(out + 12) = v[3] * w;
    }
}

GONIO_INLINE float sum_bricks(const gonio_sparse *s, const brick_cell *cell, size_t channel,
                              const gonio_storage storage) {
    const size_t channels = (size_t)s->channels;
    gonio_f16 total = {0};
    GONIO_UNROLL
    for (uint32_t n = 0; n < 4; n++) {
        gonio_f16 sum = {0}, points;
        if ((cell->brick[0][n / 2][n % 2] | cell->brick[1][n / 2][n % 2]) == 0) {
            continue;
        }
        GONIO_UNROLL
        for (uint32_t r = 0; r < 4; r++) {
            const uint32_t i = cell->low[0] + r;
            const size_t block = (size_t)cell->brick[i >> 2][n / 2][n % 2] * channels + channel;
            load_plane(s->data, block * GONIO_BRICK_POINTS + (i & 3) * 16, storage, &points);
            sum += (storage == GONIO_STORAGE_BYTE ? cell->first[r] * s->scales[block] : cell->first[r]) * points;
        }
        total += sum * cell->plane[n / 2][n % 2];
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

// Kameya 2002, chapter 6: the hash names an entry for any key; only the key stored there tells whether it is the one.
static void add_hash(const gonio_sparse *s, const gonio_position *position, float *values) {
    const uint32_t size = (uint32_t)gonio_bspline_size(s->level);
    gonio_place place;
    gonio_rows_locate(position->x, s->level, size, 3, &place);
    for (uint32_t p = 0; p < 64 && s->keys > 0; p++) {
        const uint32_t key = (uint32_t)place.first + ((p / 16) * size + p / 4 % 4) * size + p % 4;
        const uint32_t entry = gonio_mph_search(&s->mph, key);
        if (entry < s->keys && s->key[entry] == key) {
            const double w = place.basis[p / 16][0] * place.basis[p / 4 % 4][1] * place.basis[p % 4][2];
            for (size_t c = 0; c < (size_t)s->channels; c++) {
                values[c] += (float)w * s->values[(size_t)entry * (size_t)s->channels + c];
            }
        }
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
