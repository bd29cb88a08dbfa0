// SPDX-License-Identifier: BSD-3-Clause
// Equal geometries whose values differ by more than they may: the rows then differ in something that no column of the
// table's channels says.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "io/format.h"

// Combined standard uncertainties that the values of one geometry may be apart, and the share of the larger one where
// the file states none: repeated readings of one sample agree better.
static const struct { double sigmas, share; } tuning = {6, 0.25};

typedef struct repeat {
    gonio_pair pair;
    size_t row;
} repeat;

static int by_pair(const void *left, const void *right) {
    const repeat *a = left, *b = right;
    const int order = memcmp(&a->pair, &b->pair, sizeof a->pair);
    return order != 0 ? order : (a->row > b->row) - (a->row < b->row);
}

// How far apart two rows' values are, in what they may be.
static double apart(const gonio_samples *s, size_t i, size_t j) {
    double largest = 0;
    for (int c = 0; c < s->channels; c++) {
        const double a = s->values[i * (size_t)s->channels + (size_t)c];
        const double b = s->values[j * (size_t)s->channels + (size_t)c];
        const double sigma = hypot(gonio_samples_sigma(s, i, c), gonio_samples_sigma(s, j, c));
        const double may = sigma > 0 ? tuning.sigmas * sigma : tuning.share * fmax(fabs(a), fabs(b));
        largest = may > 0 ? fmax(largest, fabs(a - b) / may) : largest;
    }
    return largest;
}

gonio_status gonio_repeats_look(const gonio_samples *s, const long long *lines, char *notes, size_t size,
                                gonio_error *error) {
    repeat *all = calloc(s->n, sizeof *all);
    if (all == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to look for repeated geometries");
    }
    for (size_t i = 0; i < s->n; i++) {
        all[i] = (repeat){s->pairs[i], i};
    }
    qsort(all, s->n, sizeof *all, by_pair);
    size_t geometries = 0, rows = 0;
    double worst = 0;
    size_t example[2] = {0, 0};
    for (size_t i = 0, next; i < s->n; i = next) {
        double largest = 0;
        for (next = i + 1; next < s->n && memcmp(&all[next].pair, &all[i].pair, sizeof all[i].pair) == 0; next++) {
            const double d = apart(s, all[i].row, all[next].row);
            if (d > worst) {
                worst = d;
                example[0] = all[i].row;
                example[1] = all[next].row;
            }
            largest = fmax(largest, d);
        }
        geometries += largest > 1;
        rows += largest > 1 ? next - i : 0;
    }
    if (geometries > 0) {
        gonio_text_append(
            notes, size,
            "%zu geometries stand in %zu rows whose values are further apart than %s (lines %lld and %lld "
            "the furthest): do the rows differ in something else?\n",
            geometries, rows, s->sigma_random != NULL ? "their sigmas allow" : "repeated readings are",
            lines[example[0]], lines[example[1]]);
    }
    free(all);
    return GONIO_OK;
}
