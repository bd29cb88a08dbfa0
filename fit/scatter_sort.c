// The order of prepared samples: by cell, so that samples which share control points follow each other.
//
// Samples are taken in blocks of 2^20 in the order given, and each block is radix-sorted by its cell at level 6 (3-D)
// or 4 (4-D), axis after axis. A bounded block is what lets a stream of any length be fitted with the same bits as the
// set held in memory (fit/mba.c). Coarser levels' cells are unions of these in each axis; finer levels need no finer
// order, since a level 6 cell's rows at level 9 still fit a second-level cache.
#include <stdlib.h>
#include <string.h>

#include "fit/scatter.h"

#define DIGIT_BITS 9
#define DIGITS (1u << DIGIT_BITS)

static uint32_t cell_key(const uint32_t *position, int dims) {
    const int bits = dims == 3 ? 6 : 4;
    uint32_t key = 0;
    for (int d = 0; d < dims; d++) {
        key = key << bits | position[d] >> (32 - bits);
    }
    return key;
}

// Sort `order` by keys[order[i]], 18 bits in two passes; spare: n.
static void radix_sort(const uint32_t *keys, uint32_t *order, uint32_t *spare, size_t n) {
    for (int pass = 0; pass < 2; pass++) {
        size_t counts[DIGITS + 1] = {0};
        const int shift = pass * DIGIT_BITS;
        for (size_t i = 0; i < n; i++) {
            counts[(keys[i] >> shift & (DIGITS - 1)) + 1]++;
        }
        for (size_t d = 0; d < DIGITS; d++) {
            counts[d + 1] += counts[d];
        }
        for (size_t i = 0; i < n; i++) {
            const uint32_t sample = pass == 0 ? (uint32_t)i : order[i];
            spare[counts[keys[sample] >> shift & (DIGITS - 1)]++] = sample;
        }
        memcpy(order, spare, n * sizeof *order);
    }
}

// Rows of `size` bytes at base, reordered; spare holds n rows.
static void reorder(void *base, size_t size, const uint32_t *order, size_t n, void *spare) {
    unsigned char *rows = base, *out = spare;
    for (size_t i = 0; i < n; i++) {
        memcpy(out + i * size, rows + (size_t)order[i] * size, size);
    }
    memcpy(rows, out, n * size);
}

static void sort_block(gonio_scatter *s, size_t begin, size_t n, uint32_t *work, void *spare) {
    const size_t dims = (size_t)s->dims, c = (size_t)s->channels;
    uint32_t *keys = work, *order = work + n, *other = work + 2 * n;
    for (size_t i = 0; i < n; i++) {
        keys[i] = cell_key(s->positions + (begin + i) * dims, s->dims);
    }
    radix_sort(keys, order, other, n);
    reorder(s->positions + begin * dims, dims * sizeof *s->positions, order, n, spare);
    reorder(s->values + begin * c, c * sizeof *s->values, order, n, spare);
    if (s->weights != NULL) {
        reorder(s->weights + begin, sizeof *s->weights, order, n, spare);
    }
}

gonio_status gonio_scatter_sort(gonio_scatter *scatter, gonio_error *error) {
    const size_t largest = scatter->n < GONIO_SCATTER_BLOCK ? scatter->n : GONIO_SCATTER_BLOCK;
    const size_t row = (size_t)(scatter->channels > scatter->dims ? scatter->channels : scatter->dims);
    uint32_t *work = malloc(3 * largest * sizeof *work);
    float *spare = malloc(largest * row * sizeof *spare);
    gonio_status status = GONIO_OK;
    if (work == NULL || spare == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to sort %zu samples", largest);
    }
    for (size_t begin = 0; begin < scatter->n && status == GONIO_OK; begin += GONIO_SCATTER_BLOCK) {
        const size_t rest = scatter->n - begin;
        sort_block(scatter, begin, rest < GONIO_SCATTER_BLOCK ? rest : GONIO_SCATTER_BLOCK, work, spare);
    }
    free(work);
    free(spare);
    return status;
}
