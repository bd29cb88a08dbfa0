// Evaluation of sparse lattices.
//
// A cell's row of four control points along the last axis begins anywhere in a brick, so it is read as two brick rows
// of four, and the last axis' weights stand at the right four of eight places, the others 0: no gathering of single
// points.
#include "fit/sparse.h"

#include <math.h>
#include <string.h>

#include "fit/rows.h"

typedef uint16_t half4 __attribute__((vector_size(8), aligned(2), may_alias));
typedef int8_t byte4 __attribute__((vector_size(4), aligned(1), may_alias));
typedef uint32_t word4 __attribute__((vector_size(16)));

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
GONIO_INLINE void decode_half(const uint16_t *from, gonio_f4 *out) {
    const word4 h = __builtin_convertvector(*(const half4 *)from, word4);
    const word4 magnitude = (h & 0x7fff) << 13, sign = (h & 0x8000) << 16;
    gonio_f4 f;
    memcpy(&f, &magnitude, sizeof f);
    f *= 0x1p112f;
    word4 bits;
    memcpy(&bits, &f, sizeof bits);
    bits |= sign;
    memcpy(out, &bits, sizeof *out);
}

GONIO_INLINE void load_row(const void *data, size_t element, const gonio_storage storage, gonio_f4 *out) {
    if (storage == GONIO_STORAGE_FLOAT) {
        *out = *(const gonio_f4 *)((const float *)data + element);
    } else if (storage == GONIO_STORAGE_HALF) {
        decode_half((const uint16_t *)data + element, out);
    } else {
        *out = __builtin_convertvector(*(const byte4 *)((const int8_t *)data + element), gonio_f4);
    }
}

// The bricks that the cell's points lie in, and the weights.
typedef struct brick_cell {
    uint32_t brick[2][2][2];
    uint32_t low[3]; // the cell's first point within its first brick
    float weight[16];
    float last[8];
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
        // A cell that begins with its brick lies in it alone.
        const bool needed =
            (k < 4 || cell->low[0] > 0) && ((k & 2) == 0 || cell->low[1] > 0) && ((k & 1) == 0 || cell->low[2] > 0);
        const uint32_t id = table[((k >> 2) * s->side + (k >> 1 & 1)) * s->side + (k & 1)];
        cell->brick[k >> 2][k >> 1 & 1][k & 1] = needed ? id : 0;
        any |= needed ? id : 0;
    }
    return any != 0;
}

GONIO_INLINE void fill_weights(const gonio_sparse *s, const gonio_position *position, brick_cell *cell) {
    gonio_place place;
    gonio_row_list list;
    gonio_d4 last;
    gonio_rows_locate(position->x, s->level, gonio_bspline_size(s->level), 3, &place);
    gonio_rows_weights(&place, 3, &list);
    gonio_rows_last(&place, 3, &last);
    memcpy(cell->weight, list.weight, sizeof cell->weight);
    memset(cell->last, 0, sizeof cell->last);
    *(gonio_f4 *)(cell->last + cell->low[2]) = __builtin_convertvector(last, gonio_f4);
}

GONIO_INLINE float sum_bricks(const gonio_sparse *s, const brick_cell *cell, size_t channel,
                              const gonio_storage storage) {
    const size_t channels = (size_t)s->channels;
    gonio_f4 left = {0}, right = {0};
    GONIO_UNROLL
    for (uint32_t r = 0; r < 16; r++) {
        const uint32_t i = cell->low[0] + r / 4, j = cell->low[1] + r % 4;
        const uint32_t *ids = cell->brick[i >> 2][j >> 2];
        const size_t in_brick = ((i & 3) * 4 + (j & 3)) * 4;
        const size_t a = (size_t)ids[0] * channels + channel, b = (size_t)ids[1] * channels + channel;
        gonio_f4 row;
        load_row(s->data, a * GONIO_BRICK_POINTS + in_brick, storage, &row);
        left += (storage == GONIO_STORAGE_BYTE ? cell->weight[r] * s->scales[a] : cell->weight[r]) * row;
        load_row(s->data, b * GONIO_BRICK_POINTS + in_brick, storage, &row);
        right += (storage == GONIO_STORAGE_BYTE ? cell->weight[r] * s->scales[b] : cell->weight[r]) * row;
    }
    const gonio_f4 sum = left * *(const gonio_f4 *)cell->last + right * *(const gonio_f4 *)(cell->last + 4);
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
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

// Rows of 4 x channels halves, four at a time.
GONIO_CLONES void gonio_half_lattice_add(const uint16_t *points, int level, int channels,
                                         const gonio_position *position, float *values) {
    const size_t size = gonio_bspline_size(level), c = (size_t)channels;
    gonio_place place;
    gonio_row_list list;
    gonio_d4 last;
    gonio_rows_offsets(size, 3, &list);
    gonio_rows_locate(position->x, level, size, 3, &place);
    gonio_rows_weights(&place, 3, &list);
    gonio_rows_last(&place, 3, &last);
    const uint16_t *base = points + place.first * c;
    for (size_t v = 0; v < c; v++) {
        gonio_f4 sum = {0}, row;
        GONIO_UNROLL
        for (int r = 0; r < 16; r++) {
            decode_half(base + list.offset[r] * c + 4 * v, &row);
            sum += list.weight[r] * row;
        }
        // Element e of the row belongs to point e / channels, channel e % channels.
        for (size_t e = 4 * v; e < 4 * v + 4; e++) {
            values[e % c] += (float)last[e / c] * sum[e - 4 * v];
        }
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
    const uint16_t four[4] = {half};
    gonio_f4 out;
    decode_half(four, &out);
    return out[0];
}
