// SPDX-License-Identifier: BSD-3-Clause
// From the sums to the lattice: phi = numerator / denominator (Lee, Wolberg and Shin 1997, eq. 5), with the mirrored
// samples' sums added first.
#include "fit/mba/level.h"

#include <stdlib.h>

#include "fit/mba/kernel.h"

gonio_status gonio_mba_level_scratch(gonio_mba_level *level, size_t doubles, gonio_error *error) {
    if (doubles > level->scratch_size) {
        free(level->scratch);
        level->scratch = aligned_alloc(64, (doubles * sizeof(double) + 63) / 64 * 64);
        level->scratch_size = level->scratch != NULL ? doubles : 0;
    }
    return level->scratch != NULL ? GONIO_OK
                                  : gonio_fail(error, GONIO_E_MEMORY, "no memory for the sums of level %d (%.3g GB)",
                                               level->lattice->level, (double)doubles * 8e-9);
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

void gonio_mba_level_update(const gonio_mba_level *level, size_t plane, double *sums) {
    gonio_lattice *l = level->lattice;
    const size_t count = l->count / l->size, stride = gonio_mba_stride(l->channels);
    if (level->scatter->mirror_axes != 0) {
        mirror_plane(l, level->scatter->mirror_axes, sums, count, stride);
    }
    update_plane(l, l->points + plane * count * (size_t)l->channels, sums, count, stride);
}
