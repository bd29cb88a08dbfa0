// SPDX-License-Identifier: BSD-3-Clause
// The memory of a fit: an upper bound, phase by phase.
#include "fit/memory.h"

#include <math.h>
#include <stdio.h>
#include <unistd.h>

#include "fit/mba/mba.h"

// The program itself: its code, its libraries' tables, stacks.
#define PROGRAM_BYTES 20e6

// Transforms, names, threads, groups: what does not grow with samples or levels.
#define SMALL_BYTES 1e5

// n samples as gonio_samples keeps them.
static double samples_memory(const gonio_fit_size *s, double n) {
    return n * ((double)sizeof(gonio_pair) + 8.0 * s->channels * (s->sigma ? 3 : 1));
}

// One block's sort: keys, two orders, rows; and the counts.
static double sort_memory(const gonio_fit_size *s, double n) {
    const double block = fmin(n, (double)GONIO_SCATTER_BLOCK);
    return block * 4 * (3 + fmax(s->dims, s->channels)) + 64 * 512 * 4;
}

static double lattice_memory(const gonio_fit_size *s) {
    return (double)gonio_lattice_count(s->dims, s->level) * 4 * s->channels;
}

double gonio_lattices_fit_memory(const gonio_fit_size *s, double n, bool second_level) {
    const double fitted = n * (s->reciprocal ? 2 : 1), values = fitted * 4 * s->channels;
    const double prepared = values + fitted * 4 * (s->dims + (s->sigma ? 1 : 0));
    const double ranking = s->log || s->sigma ? n * 8 : 0; // the domain's offset, then the weights' variances
    const double levels = gonio_mba_memory(s->dims, s->level, s->channels, (size_t)fitted, s->threads);
    // Two levels (cbmba): what the first one leaves, and the second one's control points beside a correction's.
    const double second = second_level ? values + 2 * lattice_memory(s) : 0;
    return SMALL_BYTES + prepared + fmax(fmax(ranking, sort_memory(s, fitted)), levels + second);
}

double gonio_lattice_fit_memory(const gonio_fit_size *size, double n) {
    return gonio_lattices_fit_memory(size, n, false);
}

// Holding out: the split, the rest as a set of its own, its fit, the predictions; the model is there already.
static double hold_out_memory(const gonio_fit_size *s, gonio_method_memory *method) {
    const double n = (double)s->samples, rest = n * (1 - s->hold_out);
    const double kept = n * (sizeof(int) + 1 + 8.0 * s->channels);
    const double split = n * (8 + 2 * 16 + 1); // ranks, keys and what sorting them takes
    return lattice_memory(s) + kept + fmax(split, samples_memory(s, rest) + method(s, rest));
}

double gonio_fit_memory_of(const gonio_fit_size *size, gonio_method_memory *method) {
    const double n = (double)size->samples;
    // The saved model's own lattice stays while its error on the samples is taken.
    const double errors = lattice_memory(size) + n * 8 * (size->channels + 1);
    const double held_out = size->hold_out > 0 ? hold_out_memory(size, method) : 0;
    return PROGRAM_BYTES + samples_memory(size, n) + fmax(fmax(method(size, n), errors), held_out);
}

gonio_fit_size gonio_fit_size_of(const gonio_samples *samples, const gonio_fit_options *options, int level) {
    return (gonio_fit_size){.samples = samples->n,
                            .channels = samples->channels,
                            .dims = samples->isotropic ? 3 : 4,
                            .level = level,
                            .sigma = samples->sigma_random != NULL,
                            .log = options->domain != GONIO_LINEAR,
                            .reciprocal = options->symmetry > 0 && (options->symmetry & GONIO_SYMMETRY_RECIPROCITY),
                            .method = options->method,
                            .hold_out = options->folds >= 2 ? 1.0 / options->folds : options->hold_out,
                            .threads = options->threads};
}

double gonio_available_memory(void) {
    double kilobytes = 0;
    FILE *file = fopen("/proc/meminfo", "r");
    char line[128];
    while (file != NULL && kilobytes == 0 && fgets(line, sizeof line, file) != NULL) {
        (void)sscanf(line, "MemAvailable: %lf kB", &kilobytes);
    }
    if (file != NULL) {
        fclose(file);
    }
    return kilobytes > 0 ? kilobytes * 1024 : (double)sysconf(_SC_AVPHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
}

double gonio_fit_memory_limit(const gonio_samples *samples, const gonio_fit_options *options) {
    if (options->max_memory > 0) {
        return (double)options->max_memory;
    }
    const gonio_fit_size size = gonio_fit_size_of(samples, options, 0);
    return gonio_available_memory() + samples_memory(&size, (double)samples->n) + PROGRAM_BYTES;
}
