// SPDX-License-Identifier: BSD-3-Clause
// A coarse level of a multilevel fit: chunks of samples with sums of their own.
//
// A lattice of few cells is touched everywhere by any chunk of samples, so threads cannot share it out; but it is
// small, and each chunk can have one. Chunks are merged in their order, and how many there are follows from the samples
// and the lattice alone: the bits do not depend on who ran them. Blocks (GONIO_SCATTER_BLOCK) follow each other.
#include <string.h>

#include "fit/mba/kernel.h"
#include "fit/mba/level.h"

// Below 16,384 samples a chunk, waking a thread costs more than it saves; above 16 chunks, merging does.
#define CHUNK_SAMPLES GONIO_POOL_CHUNK
#define CHUNKS_MAX 16
// Doubles that all chunks together may have beyond the first one's: half of a usual second-level cache each.
#define CHUNKS_DOUBLES ((size_t)1 << 20)
#define PLANES_MAX 19 // control points a dimension at level 4

// Up to this level samples that follow each other share their cell more often than not.
#define RUNS_LEVEL_MAX 3

typedef struct chunk {
    gonio_mba_job job;
    double *planes[PLANES_MAX];
} chunk;

typedef struct coarse_work {
    const gonio_mba_level *level;
    chunk chunks[CHUNKS_MAX];
    size_t count;
    size_t doubles; // a chunk's
    double *total;  // sums of the blocks before; NULL: this block is the only one
    bool last;      // the last block: update the lattice
} coarse_work;

static void run_chunk(void *context, size_t item) {
    const coarse_work *work = context;
    const chunk *c = &work->chunks[item];
    memset(c->planes[0], 0, work->doubles * sizeof(double));
    gonio_mba_accumulate(&c->job);
}

// One plane of the lattice: merge what the chunks have of it; at the last block, update the lattice.
static void finish_plane(void *context, size_t plane) {
    const coarse_work *work = context;
    const size_t doubles = work->doubles / work->level->lattice->size;
    double *merged = work->total != NULL ? work->total + plane * doubles : work->chunks[0].planes[plane];
    for (size_t i = work->total != NULL ? 0 : 1; i < work->count; i++) {
        const double *sums = work->chunks[i].planes[plane];
        for (size_t k = 0; k < doubles; k++) {
            merged[k] += sums[k];
        }
    }
    if (work->last) {
        gonio_mba_level_update(work->level, plane, merged);
    }
}

static size_t doubles_of(int dims, int level, int channels) {
    return gonio_lattice_count(dims, level) * gonio_mba_stride(channels);
}

static size_t chunks_of(size_t samples, size_t doubles) {
    const size_t block = samples < GONIO_SCATTER_BLOCK ? samples : GONIO_SCATTER_BLOCK;
    const size_t wanted = block / CHUNK_SAMPLES < CHUNKS_MAX ? block / CHUNK_SAMPLES : CHUNKS_MAX;
    const size_t fitting = 1 + CHUNKS_DOUBLES / doubles;
    const size_t count = wanted < fitting ? wanted : fitting;
    return count > 0 ? count : 1;
}

static void cut_block(coarse_work *work, size_t begin, size_t n) {
    const gonio_mba_level *level = work->level;
    const gonio_lattice *l = level->lattice;
    work->count = chunks_of(n, work->doubles);
    for (size_t i = 0; i < work->count; i++) {
        chunk *c = &work->chunks[i];
        for (size_t p = 0; p < l->size; p++) {
            c->planes[p] = level->scratch + i * work->doubles + p * (work->doubles / l->size);
        }
        c->job = (gonio_mba_job){.scatter = level->scatter,
                                 .begin = begin + n * i / work->count,
                                 .end = begin + n * (i + 1) / work->count,
                                 .level = l->level,
                                 .size = l->size,
                                 .points = l->points,
                                 .planes = c->planes,
                                 .runs = l->level <= RUNS_LEVEL_MAX};
    }
}

gonio_status gonio_mba_fit_coarse(gonio_mba_level *level, gonio_error *error) {
    const gonio_lattice *l = level->lattice;
    const size_t n = level->scatter->n, doubles = doubles_of(l->dims, l->level, l->channels);
    const size_t chunks = chunks_of(n, doubles);
    const bool several = n > GONIO_SCATTER_BLOCK;
    const gonio_status status = gonio_mba_level_scratch(level, doubles * (chunks + several), error);
    if (status != GONIO_OK) {
        return status;
    }
    coarse_work work = {.level = level, .doubles = doubles};
    if (several) {
        work.total = level->scratch + doubles * chunks;
        memset(work.total, 0, doubles * sizeof(double));
    }
    for (size_t begin = 0; begin < n; begin += GONIO_SCATTER_BLOCK) {
        work.last = n - begin <= GONIO_SCATTER_BLOCK;
        cut_block(&work, begin, work.last ? n - begin : GONIO_SCATTER_BLOCK);
        gonio_pool_run(level->pool, work.count, run_chunk, &work);
        gonio_pool_run(work.count > 1 ? level->pool : NULL, l->size, finish_plane, &work);
    }
    return GONIO_OK;
}

double gonio_mba_coarse_memory(int dims, int level, int channels, size_t samples) {
    const size_t doubles = doubles_of(dims, level, channels);
    return 8.0 * (double)doubles * (double)(chunks_of(samples, doubles) + (samples > GONIO_SCATTER_BLOCK));
}
