// SPDX-License-Identifier: BSD-3-Clause
// A fine level of a multilevel fit: the samples in the order of their cells along the first axis, so that only the
// planes of control points that the current cells reach need sums.
//
// The sums of a whole level 6 lattice of 31 channels are 77 MB: more than a cache holds, and most of the level's time
// went into getting that memory from the system. Four planes are 4.6 MB. Once the samples of a plane of cells are done,
// its first plane of control points is complete: the lattice is updated and the sums serve a later plane.
//
// Threads take segments of planes. A control point belongs to one segment and collects all its samples in their order,
// whatever the segments are: the bits depend on the samples alone. The few planes of cells before a segment's first
// plane, which reach into it, are computed by both neighbours. Planes that both read are updated when all are done.
#include <stdlib.h>
#include <string.h>

#include "fit/mba/kernel.h"
#include "fit/mba/level.h"

#define REACH 3       // planes of control points that a cell reaches beyond its own
#define SEGMENT_MIN 8 // planes; shorter segments would compute most cells twice
#define SEGMENTS_MAX 64

typedef struct segment {
    size_t first_group, end_group; // groups of samples that reach the segment
    size_t begin, end;             // planes of control points
    double **planes;               // [size]
    double *memory, *waste;        // all planes' sums; a plane for what belongs to others
} segment;

typedef struct fine_work {
    gonio_mba_level *level;
    size_t doubles; // a plane's
    // A group: samples equal in what the order knows of the first axis (gonio_scatter_order_bits); `width` planes of
    // cells. starts[block][group]: its first sample.
    size_t groups, width, blocks, *starts;
    size_t keep; // planes at a segment's end that the next one reads
    segment segments[SEGMENTS_MAX];
    size_t count;
} fine_work;

static size_t ring_of(size_t width) { return width + REACH; }

// Whole groups are computed by both neighbours, so the planes that the next segment reads are rounded up to them.
static size_t kept_planes(size_t width) { return (REACH + width - 1) / width * width; }

static bool is_kept(const fine_work *work, const segment *s, size_t plane) {
    return (s != &work->segments[0] && plane < s->begin + REACH) ||
           (s != &work->segments[work->count - 1] && plane + work->keep >= s->end);
}

// Give every plane its sums: a place in the ring, one of its own, or the waste.
static void place_planes(const fine_work *work, const segment *s) {
    const size_t ring = ring_of(work->width);
    double *own = s->memory + ring * work->doubles;
    for (size_t p = 0; p < work->level->lattice->size; p++) {
        s->planes[p] = s->waste;
        if (p >= s->begin && p < s->end) {
            s->planes[p] = s->memory + p % ring * work->doubles;
            if (is_kept(work, s, p)) {
                s->planes[p] = own;
                own += work->doubles;
            }
        }
    }
}

static void add_group(const fine_work *work, const segment *s, size_t group) {
    const gonio_lattice *l = work->level->lattice;
    gonio_mba_job job = {
        .scatter = work->level->scatter, .level = l->level, .size = l->size, .points = l->points, .planes = s->planes};
    for (size_t b = 0; b < work->blocks; b++) {
        job.begin = work->starts[b * (work->groups + 1) + group];
        job.end = work->starts[b * (work->groups + 1) + group + 1];
        gonio_mba_accumulate(&job);
    }
}

static bool is_empty(const fine_work *work, size_t group) {
    for (size_t b = 0; b < work->blocks; b++) {
        const size_t *starts = work->starts + b * (work->groups + 1) + group;
        if (starts[0] != starts[1]) {
            return false;
        }
    }
    return true;
}

static void run_segment(void *context, size_t item) {
    const fine_work *work = context;
    const segment *s = &work->segments[item];
    size_t reached = 0; // planes before it may hold sums
    place_planes(work, s);
    memset(s->memory, 0, (size_t)((char *)(s->waste + work->doubles) - (char *)s->memory));
    for (size_t g = s->first_group; g < s->end_group; g++) {
        if (!is_empty(work, g)) {
            add_group(work, s, g);
            reached = (g + 1) * work->width + REACH;
        }
        const size_t from = g * work->width < s->begin ? s->begin : g * work->width;
        const size_t to = g + 1 == s->end_group ? s->end : (g + 1) * work->width;
        for (size_t p = from; p < to && p < reached; p++) {
            if (!is_kept(work, s, p)) {
                gonio_mba_level_update(work->level, p, s->planes[p]);
                memset(s->planes[p], 0, work->doubles * sizeof(double));
            }
        }
    }
}

static void update_kept(void *context, size_t item) {
    const fine_work *work = context;
    const segment *s = &work->segments[item];
    for (size_t p = s->begin; p < s->end; p++) {
        if (is_kept(work, s, p)) {
            gonio_mba_level_update(work->level, p, s->planes[p]);
        }
    }
}

// The first sample of [begin, end) whose group is at least `group`.
static size_t lower_bound(const gonio_scatter *s, int bits, size_t group, size_t begin, size_t end) {
    while (begin < end) {
        const size_t middle = begin + (end - begin) / 2;
        if (gonio_bspline_cell(s->positions[middle * (size_t)s->dims], bits) < group) {
            begin = middle + 1;
        } else {
            end = middle;
        }
    }
    return begin;
}

static gonio_status find_groups(fine_work *work, gonio_error *error) {
    const gonio_scatter *s = work->level->scatter;
    const int order = gonio_scatter_order_bits(s->dims), level = work->level->lattice->level;
    const int bits = level < order ? level : order;
    work->groups = (size_t)1 << bits;
    work->width = (size_t)1 << (level - bits);
    work->keep = kept_planes(work->width);
    work->blocks = (s->n + GONIO_SCATTER_BLOCK - 1) / GONIO_SCATTER_BLOCK;
    work->starts = malloc(work->blocks * (work->groups + 1) * sizeof *work->starts);
    if (work->starts == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to fit level %d", level);
    }
    for (size_t b = 0; b < work->blocks; b++) {
        const size_t begin = b * GONIO_SCATTER_BLOCK, rest = s->n - begin;
        const size_t end = rest < GONIO_SCATTER_BLOCK ? s->n : begin + GONIO_SCATTER_BLOCK;
        for (size_t g = 0; g <= work->groups; g++) {
            work->starts[b * (work->groups + 1) + g] = lower_bound(s, bits, g, begin, end);
        }
    }
    return GONIO_OK;
}

static size_t samples_before(const fine_work *work, size_t group) {
    size_t n = 0;
    for (size_t b = 0; b < work->blocks; b++) {
        n += work->starts[b * (work->groups + 1) + group] - b * GONIO_SCATTER_BLOCK;
    }
    return n;
}

// Segments of about equally many samples.
static void cut_segments(fine_work *work) {
    const size_t n = work->level->scatter->n, threads = gonio_pool_size(work->level->pool);
    const size_t wanted = threads < SEGMENTS_MAX ? threads : SEGMENTS_MAX;
    const size_t planes = REACH + work->keep > SEGMENT_MIN ? REACH + work->keep : SEGMENT_MIN;
    const size_t least = (planes + work->width - 1) / work->width;
    size_t begin = 0;
    for (size_t i = 0; i < wanted && begin < work->groups; i++) {
        size_t end = begin + least;
        while (end < work->groups && samples_before(work, end) * wanted < n * (i + 1)) {
            end++;
        }
        // What would be too short a rest belongs to this one.
        end = i + 1 == wanted || end + least > work->groups ? work->groups : end;
        segment *s = &work->segments[work->count++];
        s->begin = begin * work->width;
        s->end = end == work->groups ? work->level->lattice->size : end * work->width;
        s->first_group = (s->begin > REACH ? s->begin - REACH : 0) / work->width;
        s->end_group = end;
        begin = end;
    }
}

// Planes of sums that one of `count` segments needs.
static size_t planes_of(size_t count, size_t width) {
    return ring_of(width) + (count > 1 ? REACH + kept_planes(width) : 0) + 1;
}

static gonio_status run_segments(fine_work *work, gonio_error *error) {
    const size_t size = work->level->lattice->size, each = planes_of(work->count, work->width) * work->doubles;
    gonio_status status = gonio_mba_level_scratch(work->level, each * work->count, error);
    double **planes = malloc(work->count * size * sizeof(double *));
    if (status == GONIO_OK && planes == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to fit level %d", work->level->lattice->level);
    }
    if (status == GONIO_OK) {
        for (size_t i = 0; i < work->count; i++) {
            segment *s = &work->segments[i];
            s->planes = planes + i * size;
            s->memory = work->level->scratch + i * each;
            s->waste = s->memory + each - work->doubles;
        }
        gonio_pool_run(work->level->pool, work->count, run_segment, work);
        gonio_pool_run(work->level->pool, work->count, update_kept, work);
    }
    free(planes);
    return status;
}

gonio_status gonio_mba_fit_fine(gonio_mba_level *level, gonio_error *error) {
    const gonio_lattice *l = level->lattice;
    fine_work work = {.level = level, .doubles = l->count / l->size * gonio_mba_stride(l->channels)};
    gonio_status status = find_groups(&work, error);
    if (status == GONIO_OK) {
        cut_segments(&work);
        status = run_segments(&work, error);
    }
    free(work.starts);
    return status;
}

double gonio_mba_fine_memory(int dims, int level, int channels, size_t samples, int threads) {
    const int order = gonio_scatter_order_bits(dims);
    const size_t width = (size_t)1 << (level > order ? level - order : 0), size = gonio_bspline_size(level);
    const size_t usable = samples >= GONIO_POOL_SAMPLES ? gonio_pool_threads(threads) : 1;
    const size_t wanted = usable < SEGMENTS_MAX ? usable : SEGMENTS_MAX, most = size / SEGMENT_MIN;
    const size_t count = wanted < most ? wanted : most > 0 ? most : 1;
    const double plane =
        (double)gonio_lattice_count(dims, level) / (double)size * 8 * (double)gonio_mba_stride(channels);
    return plane * (double)(planes_of(count, width) * count);
}
