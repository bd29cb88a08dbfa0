// Multilevel B-spline approximation (MBA).
//
// One level, Lee, Wolberg and Shin 1997, eqs. 3 to 5 (Kameya 2002, 2.3.2): a sample with residual r among the 4^d
// control points of its cell asks each for phi_c = w_c r / sum_a w_a^2; where samples disagree, the least squares
// answer is
//   phi = sum_c q_c w_c^2 phi_c / sum_c q_c w_c^2,
// with q_c the sample's weight (1 in the thesis). A point that no sample reaches keeps 0: the coarser level's value.
// Then the lattice is refined and the next level fits what is left.
//
// The residual of level h is taken from the sum of the levels below it, already refined to level h. So weights and
// addresses of a sample are computed once a level for both the residual and the sums, and no residuals are stored.
#include "fit/mba.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fit/mba_kernel.h"
#include "fit/team.h"

struct gonio_mba {
    const gonio_scatter *scatter;
    gonio_lattice lattice;
    double start[GONIO_CHANNELS_MAX];
    gonio_team *team; // NULL: one thread
    double *sums;     // scratch of the levels
    size_t sums_size;
    int first_level;
    bool begun;
};

// Chunks a block follow from the number of samples alone. Below 16,384 samples a chunk, waking a thread costs more than
// it saves; above 16 chunks, merging does.
#define CHUNK_SAMPLES GONIO_TEAM_CHUNK
#define CHUNKS_MAX 16

// Up to this level samples that follow each other share their cell more often than not.
#define RUNS_LEVEL_MAX 3

gonio_status gonio_mba_new(const gonio_scatter *scatter, const double *start, int threads, gonio_mba **out,
                           gonio_error *error) {
    gonio_mba *mba = *out = calloc(1, sizeof *mba);
    if (mba == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a fit");
    }
    mba->scatter = scatter;
    // One chunk is one thread's work: small fits start no thread at all.
    mba->team = scatter->n >= 2 * CHUNK_SAMPLES ? gonio_team_new(threads) : NULL;
    if (start != NULL) {
        memcpy(mba->start, start, (size_t)scatter->channels * sizeof *start);
    }
    return GONIO_OK;
}

void gonio_mba_free(gonio_mba *mba) {
    if (mba != NULL) {
        gonio_lattice_release(&mba->lattice);
        gonio_team_free(mba->team);
        free(mba->sums);
        free(mba);
    }
}

void gonio_mba_begin_at(gonio_mba *mba, int level) { mba->first_level = level; }

const gonio_lattice *gonio_mba_lattice(const gonio_mba *mba) { return &mba->lattice; }

void gonio_mba_take(gonio_mba *mba, gonio_lattice *lattice) {
    *lattice = mba->lattice;
    mba->lattice.points = NULL;
}

double gonio_mba_memory(int dims, int level, int channels, size_t samples) {
    const double count = (double)gonio_lattice_count(dims, level), size = (double)gonio_bspline_size(level);
    const size_t block = samples < GONIO_SCATTER_BLOCK ? samples : GONIO_SCATTER_BLOCK;
    const double chunks = fmin(fmax(floor((double)block / CHUNK_SAMPLES), 1), CHUNKS_MAX);
    // Sums: the lattice's planes, three more a further chunk, and the total once there are several blocks.
    const double planes = size + 3 * (chunks - 1) + (samples > block ? size : 0);
    const double sums = planes * count / size * 8.0 * (double)gonio_mba_stride(channels);
    return sums + count * 4.0 * channels * 2;
}

// The sums of one chunk of samples: private, so that chunks run in parallel, and merged in their order, so that the
// bits do not depend on who ran them. A chunk of sorted samples touches few planes of the lattice and holds only those.
typedef struct chunk {
    gonio_mba_job job;
    size_t planes; // first plane: job.plane
} chunk;

typedef struct level_work {
    gonio_mba *mba;
    chunk chunks[CHUNKS_MAX];
    size_t count;
    size_t plane_points; // control points a plane
    size_t stride;       // doubles a control point
    double *total;       // sums of the blocks before; NULL: none
    bool last;           // the last block: update the lattice
} level_work;

static void run_chunk(void *context, size_t item) {
    const level_work *work = context;
    const chunk *c = &work->chunks[item];
    memset(c->job.sums, 0, c->planes * work->plane_points * work->stride * sizeof(double));
    gonio_mba_accumulate(&c->job);
}

static size_t flipped(const gonio_lattice *l, unsigned axes, size_t point) {
    size_t result = 0, stride = 1;
    for (int d = l->dims - 1; d > 0; d--) {
        const size_t k = point % l->size;
        point /= l->size;
        result += (axes >> d & 1 ? l->size - 1 - k : k) * stride;
        stride *= l->size;
    }
    return result;
}

// Add the sums of two control points to both: what the mirrored samples would have given.
static void mirror_plane(const gonio_lattice *l, unsigned axes, double *plane, size_t points, size_t stride) {
    for (size_t i = 0; i < points; i++) {
        const size_t j = flipped(l, axes, i);
        if (j < i) {
            continue;
        }
        double *a = plane + i * stride, *b = plane + j * stride;
        for (size_t k = 0; k < stride; k++) {
            a[k] = b[k] = a[k] + b[k];
        }
    }
}

static void update_plane(gonio_lattice *l, float *points, const double *plane, size_t count, size_t stride) {
    const size_t channels = (size_t)l->channels;
    for (size_t i = 0; i < count; i++) {
        const double *sums = plane + i * stride;
        if (sums[0] > 0) {
            for (size_t c = 0; c < channels; c++) {
                float *p = &points[i * channels + c];
                *p = (float)((double)*p + sums[c + 1] / sums[0]);
            }
        }
    }
}

// One plane of the lattice: merge what the chunks have of it; at the last block, update the lattice.
static void finish_plane(void *context, size_t plane) {
    const level_work *work = context;
    const size_t doubles = work->plane_points * work->stride;
    double *merged = work->total != NULL ? work->total + plane * doubles : NULL;
    for (size_t i = 0; i < work->count; i++) {
        const chunk *c = &work->chunks[i];
        if (plane < c->job.plane || plane >= c->job.plane + c->planes) {
            continue;
        }
        double *sums = c->job.sums + (plane - c->job.plane) * doubles;
        if (merged == NULL) {
            merged = sums;
            continue;
        }
        for (size_t k = 0; k < doubles; k++) {
            merged[k] += sums[k];
        }
    }
    if (merged == NULL || !work->last) {
        return;
    }
    gonio_lattice *l = &work->mba->lattice;
    if (work->mba->scatter->mirror_axes != 0) {
        mirror_plane(l, work->mba->scatter->mirror_axes, merged, work->plane_points, work->stride);
    }
    update_plane(l, l->points + plane * work->plane_points * (size_t)l->channels, merged, work->plane_points,
                 work->stride);
}

// The first and the last cell along the slowest axis that hold samples from..to. The samples' order is no finer than
// the scatter's sorting grid, so at fine levels the extremes may be anywhere among them.
static void cell_range(const gonio_mba *mba, size_t from, size_t to, size_t *first, size_t *last) {
    const gonio_scatter *s = mba->scatter;
    *first = SIZE_MAX;
    *last = 0;
    for (size_t i = from; i < to; i++) {
        const size_t cell = gonio_bspline_cell(s->positions[i * (size_t)s->dims], mba->lattice.level);
        *first = cell < *first ? cell : *first;
        *last = cell > *last ? cell : *last;
    }
}

// Cut the block into chunks and give each its planes in one buffer.
static gonio_status cut_block(level_work *work, size_t begin, size_t n, gonio_error *error) {
    gonio_mba *mba = work->mba;
    const gonio_scatter *s = mba->scatter;
    const gonio_lattice *l = &mba->lattice;
    work->count = n / CHUNK_SAMPLES < 1 ? 1 : n / CHUNK_SAMPLES < CHUNKS_MAX ? n / CHUNK_SAMPLES : CHUNKS_MAX;
    size_t planes = 0;
    for (size_t i = 0; i < work->count; i++) {
        const size_t from = begin + n * i / work->count, to = begin + n * (i + 1) / work->count;
        size_t first, last;
        cell_range(mba, from, to, &first, &last);
        work->chunks[i] = (chunk){{s, from, to, l->level, l->size, l->points, NULL, first, l->level <= RUNS_LEVEL_MAX},
                                  last - first + 4};
        planes += last - first + 4;
    }
    const size_t doubles = planes * work->plane_points * work->stride;
    if (doubles > mba->sums_size) {
        free(mba->sums);
        mba->sums = malloc(doubles * sizeof *mba->sums);
        mba->sums_size = mba->sums != NULL ? doubles : 0;
        if (mba->sums == NULL) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for the sums of level %d (%.3g GB)", l->level,
                              (double)doubles * 8e-9);
        }
    }
    double *sums = mba->sums;
    for (size_t i = 0; i < work->count; i++) {
        work->chunks[i].job.sums = sums;
        sums += work->chunks[i].planes * work->plane_points * work->stride;
    }
    return GONIO_OK;
}

static gonio_status fit_level(gonio_mba *mba, gonio_error *error) {
    const gonio_lattice *l = &mba->lattice;
    level_work work = {
        .mba = mba, .plane_points = l->count / l->size, .stride = gonio_mba_stride(mba->scatter->channels)};
    const size_t n = mba->scatter->n;
    gonio_status status = GONIO_OK;
    if (n > GONIO_SCATTER_BLOCK) {
        work.total = calloc(l->count, work.stride * sizeof *work.total);
        if (work.total == NULL) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for the sums of level %d (%.3g GB)", l->level,
                              (double)l->count * (double)work.stride * 8e-9);
        }
    }
    for (size_t begin = 0; begin < n && status == GONIO_OK; begin += GONIO_SCATTER_BLOCK) {
        const size_t rest = n - begin;
        work.last = rest <= GONIO_SCATTER_BLOCK;
        status = cut_block(&work, begin, work.last ? rest : GONIO_SCATTER_BLOCK, error);
        if (status == GONIO_OK) {
            gonio_team_run(mba->team, work.count, run_chunk, &work);
            gonio_team_run(work.count > 1 ? mba->team : NULL, l->size, finish_plane, &work);
        }
    }
    free(work.total);
    return status;
}

gonio_status gonio_mba_next(gonio_mba *mba, gonio_error *error) {
    const gonio_scatter *s = mba->scatter;
    gonio_status status;
    if (mba->begun) {
        status = gonio_lattice_refine(&mba->lattice, error);
    } else {
        status = gonio_lattice_init(&mba->lattice, s->dims, mba->first_level, s->channels, error);
        if (status == GONIO_OK) {
            gonio_lattice_fill(&mba->lattice, mba->start);
            mba->begun = true;
        }
    }
    return status == GONIO_OK ? fit_level(mba, error) : status;
}

gonio_status gonio_mba_check_memory(int dims, int level, int channels, size_t samples, gonio_error *error) {
    const double machine = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
    const double needed = gonio_mba_memory(dims, level, channels, samples);
    int fits = level;
    while (fits > 0 && gonio_mba_memory(dims, fits, channels, samples) > machine) {
        fits--;
    }
    return needed <= machine
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_MEMORY,
                            "level %d of %d channels in %d dimensions needs %.3g GB; this machine has %.3g GB, enough "
                            "for level %d",
                            level, channels, dims, needed / 1e9, machine / 1e9, fits);
}

gonio_status gonio_mba_fit(const gonio_scatter *scatter, const double *start, int level, int threads,
                           gonio_lattice *lattice, gonio_error *error) {
    gonio_mba *mba;
    gonio_status status = gonio_mba_check_memory(scatter->dims, level, scatter->channels, scatter->n, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = gonio_mba_new(scatter, start, threads, &mba, error);
    for (int h = 0; h <= level && status == GONIO_OK; h++) {
        status = gonio_mba_next(mba, error);
    }
    if (status == GONIO_OK) {
        gonio_mba_take(mba, lattice);
    }
    gonio_mba_free(mba);
    return status;
}
