// The memory of a fit, before it starts.
#include <math.h>
#include <stdio.h>
#include <unistd.h>

#include "fit/mba.h"
#include "gonio/fit.h"

// One block's sort: keys, two orders, rows; and the counts.
static double sort_memory(int dims, int channels, size_t samples) {
    const double block = fmin((double)samples, (double)GONIO_SCATTER_BLOCK);
    return block * 4 * (3 + fmax(dims, channels)) + 64 * 512 * 4;
}

double gonio_fit_memory(size_t samples, int channels, int dims, int level, bool sigma) {
    const double n = (double)samples, c = channels;
    const double kept = n * (sizeof(gonio_pair) + 8 * c * (sigma ? 3 : 1));
    const double prepared = n * 4 * (dims + c + (sigma ? 1 : 0));
    const double ranking = n * 8; // the domain's offset, then the weights' variances
    const double levels = gonio_mba_memory(dims, level, channels, samples, 0);
    const double fit = prepared + fmax(fmax(ranking, sort_memory(dims, channels, samples)), levels);
    // The model's own lattice stays while its error on the samples is taken.
    const double errors = (double)gonio_lattice_count(dims, level) * 4 * c + n * 8 * (c + 1);
    return kept + fmax(fit, errors);
}

// What the kernel could give without swapping, the page cache among it.
static double available_memory(void) {
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

gonio_status gonio_fit_check_memory(size_t samples, int channels, int dims, int level, bool sigma, double limit,
                                    gonio_error *error) {
    limit = limit > 0 ? limit : available_memory();
    const double needed = gonio_fit_memory(samples, channels, dims, level, sigma);
    if (needed <= limit) {
        return GONIO_OK;
    }
    int fits = level;
    while (fits >= 0 && gonio_fit_memory(samples, channels, dims, fits, sigma) > limit) {
        fits--;
    }
    if (fits >= 0) {
        return gonio_fail(error, GONIO_E_MEMORY,
                          "%zu samples of %d channels at level %d need %.3g GB; there are %.3g GB, enough for level %d",
                          samples, channels, level, needed / 1e9, limit / 1e9, fits);
    }
    size_t least = 0, most = samples; // least fits at level 0, most does not
    while (most - least > 1) {
        const size_t middle = least + (most - least) / 2;
        *(gonio_fit_memory(middle, channels, dims, 0, sigma) <= limit ? &least : &most) = middle;
    }
    return gonio_fail(error, GONIO_E_MEMORY,
                      "%zu samples of %d channels at level %d need %.3g GB; there are %.3g GB, enough for %zu samples "
                      "at level 0",
                      samples, channels, level, needed / 1e9, limit / 1e9, least);
}
