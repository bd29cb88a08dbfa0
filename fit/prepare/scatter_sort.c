// SPDX-License-Identifier: BSD-3-Clause
// The order of prepared samples: by cell, so that samples which share control points follow each other.
//
// Samples are taken in blocks of 2^20 in the order given, and each block is radix-sorted by its cell at level 6 (3-D)
// or 4 (4-D), axis after axis. A bounded block is what lets a stream of any length be fitted with the same bits as the
// set held in memory (fit/mba/mba.c). Coarser levels' cells are unions of these in each axis; finer levels need no
// finer order, since a level 6 cell's rows at level 9 still fit a second-level cache.
#include <stdlib.h>
#include <string.h>

#include "base/thread_pool.h"
#include "fit/prepare/scatter.h"

#define DIGIT_BITS 9
#define DIGITS (1u << DIGIT_BITS)

static uint32_t cell_key(const uint32_t *position, int dims) {
    const int bits = gonio_scatter_order_bits(dims);
    uint32_t key = 0;
    for (int d = 0; d < dims; d++) {
        key = key << bits | position[d] >> (32 - bits);
    }
    return key;
}

#define CHUNKS (GONIO_SCATTER_BLOCK / GONIO_POOL_CHUNK)

// One block's sort. Chunks of samples are counted, placed and copied by several threads; the sort is stable, so the
// order does not depend on them.
typedef struct sorting {
    gonio_scatter *scatter;
    gonio_pool *pool;
    size_t begin, n; // the block's samples
    uint32_t *keys, *from, *to;
    int shift;
    bool first_pass;
    uint32_t (*counts)[DIGITS]; // [CHUNKS]: how many of each digit, then where they go
    unsigned char *rows, *spare;
    size_t row_size;
} sorting;

static size_t chunk_end(const sorting *s, size_t item) {
    const size_t begin = item * GONIO_POOL_CHUNK;
    return s->n - begin < GONIO_POOL_CHUNK ? s->n : begin + GONIO_POOL_CHUNK;
}

static size_t chunks_of(const sorting *s) { return (s->n + GONIO_POOL_CHUNK - 1) / GONIO_POOL_CHUNK; }

static void make_keys(void *context, size_t item) {
    const sorting *s = context;
    const size_t dims = (size_t)s->scatter->dims;
    for (size_t i = item * GONIO_POOL_CHUNK; i < chunk_end(s, item); i++) {
        s->keys[i] = cell_key(s->scatter->positions + (s->begin + i) * dims, s->scatter->dims);
    }
}

static uint32_t sample_at(const sorting *s, size_t i) { return s->first_pass ? (uint32_t)i : s->from[i]; }

static void count_digits(void *context, size_t item) {
    const sorting *s = context;
    uint32_t *counts = s->counts[item];
    memset(counts, 0, sizeof *s->counts);
    for (size_t i = item * GONIO_POOL_CHUNK; i < chunk_end(s, item); i++) {
        counts[s->keys[sample_at(s, i)] >> s->shift & (DIGITS - 1)]++;
    }
}

// Counts -> the place of each chunk's first sample of each digit.
static void sum_counts(const sorting *s) {
    uint32_t at = 0;
    for (size_t d = 0; d < DIGITS; d++) {
        for (size_t item = 0; item < chunks_of(s); item++) {
            const uint32_t count = s->counts[item][d];
            s->counts[item][d] = at;
            at += count;
        }
    }
}

static void place_samples(void *context, size_t item) {
    const sorting *s = context;
    uint32_t *places = s->counts[item];
    for (size_t i = item * GONIO_POOL_CHUNK; i < chunk_end(s, item); i++) {
        const uint32_t sample = sample_at(s, i);
        s->to[places[s->keys[sample] >> s->shift & (DIGITS - 1)]++] = sample;
    }
}

static void gather_rows(void *context, size_t item) {
    const sorting *s = context;
    for (size_t i = item * GONIO_POOL_CHUNK; i < chunk_end(s, item); i++) {
        memcpy(s->spare + i * s->row_size, s->rows + (size_t)s->from[i] * s->row_size, s->row_size);
    }
}

static void return_rows(void *context, size_t item) {
    const sorting *s = context;
    const size_t begin = item * GONIO_POOL_CHUNK, n = chunk_end(s, item) - begin;
    memcpy(s->rows + begin * s->row_size, s->spare + begin * s->row_size, n * s->row_size);
}

// Order s->from by its keys, 18 bits in two passes.
static void radix_sort(sorting *s) {
    for (int pass = 0; pass < 2; pass++) {
        s->shift = pass * DIGIT_BITS;
        s->first_pass = pass == 0;
        gonio_pool_run(s->pool, chunks_of(s), count_digits, s);
        sum_counts(s);
        gonio_pool_run(s->pool, chunks_of(s), place_samples, s);
        uint32_t *const swap = s->from;
        s->from = s->to;
        s->to = swap;
    }
}

// The block's rows at base, of 4-byte numbers, in the new order.
static void reorder(sorting *s, void *base, size_t numbers) {
    s->row_size = numbers * 4;
    s->rows = (unsigned char *)base + s->begin * s->row_size;
    gonio_pool_run(s->pool, chunks_of(s), gather_rows, s);
    gonio_pool_run(s->pool, chunks_of(s), return_rows, s);
}

static void sort_block(sorting *s) {
    gonio_scatter *scatter = s->scatter;
    gonio_pool_run(s->pool, chunks_of(s), make_keys, s);
    radix_sort(s);
    reorder(s, scatter->positions, (size_t)scatter->dims);
    reorder(s, scatter->values, (size_t)scatter->channels);
    if (scatter->weights != NULL) {
        reorder(s, scatter->weights, 1);
    }
}

gonio_status gonio_scatter_sort(gonio_scatter *scatter, int threads, gonio_error *error) {
    const size_t largest = scatter->n < GONIO_SCATTER_BLOCK ? scatter->n : GONIO_SCATTER_BLOCK;
    const size_t row = (size_t)(scatter->channels > scatter->dims ? scatter->channels : scatter->dims);
    uint32_t *work = malloc(3 * largest * sizeof *work);
    sorting s = {.scatter = scatter, .counts = malloc(CHUNKS * sizeof *s.counts), .spare = malloc(largest * row * 4)};
    gonio_status status = GONIO_OK;
    if (work == NULL || s.counts == NULL || s.spare == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to sort %zu samples", largest);
    } else {
        s.keys = work;
        s.from = work + largest;
        s.to = work + 2 * largest;
        s.pool = scatter->n >= GONIO_POOL_SAMPLES ? gonio_pool_new(threads) : NULL;
    }
    for (; s.begin < scatter->n && status == GONIO_OK; s.begin += GONIO_SCATTER_BLOCK) {
        const size_t rest = scatter->n - s.begin;
        s.n = rest < GONIO_SCATTER_BLOCK ? rest : GONIO_SCATTER_BLOCK;
        sort_block(&s);
    }
    gonio_pool_free(s.pool);
    free(work);
    free(s.counts);
    free(s.spare);
    return status;
}
