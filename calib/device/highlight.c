// SPDX-License-Identifier: BSD-3-Clause
// The highlight of the lamp in a polished ball: one bright spot, whose centre of brightness is found to a few
// hundredths of a pixel.
#include <math.h>
#include <stdlib.h>

#include "base/statistics.h"
#include "calib/internal.h"
#include "gonio/characterise.h"

// The spot is what exceeds this share of its peak above the background. High enough that another surface's glow stays
// out, low enough that the centre rests on many pixels.
#define SHARE 0.3
// A peak must stand this many robust standard deviations of the image above its median.
#define CONTRAST 20
// A second spot of this share of the first one's brightness leaves open which is the lamp.
#define SECOND 0.3

typedef struct spot {
    double sum, u, v;
    int pixels;
    bool cut;
} spot;

// The 4-connected region above the level that holds pixel `first`; its pixels are marked. stack: one entry a pixel.
static spot flood(const gonio_image *image, double level, size_t first, uint8_t *marked, size_t *stack) {
    const size_t w = (size_t)image->width, h = (size_t)image->height;
    spot s = {0};
    size_t n = 0;
    stack[n++] = first;
    marked[first] = 1;
    while (n > 0) {
        const size_t at = stack[--n], u = at % w, v = at / w;
        const double value = image->pixels[at] - level;
        s.sum += value;
        s.u += value * (double)u;
        s.v += value * (double)v;
        s.pixels++;
        s.cut |= u == 0 || v == 0 || u == w - 1 || v == h - 1;
        const size_t next[4] = {u > 0 ? at - 1 : at, u + 1 < w ? at + 1 : at, v > 0 ? at - w : at,
                                v + 1 < h ? at + w : at};
        for (int k = 0; k < 4; k++) {
            if (!marked[next[k]] && image->pixels[next[k]] > level) {
                marked[next[k]] = 1;
                stack[n++] = next[k];
            }
        }
    }
    s.u /= s.sum;
    s.v /= s.sum;
    return s;
}

// The brightest spot of more than one pixel (a hot pixel is none), and the brightness of the next.
static spot brightest(const gonio_image *image, double level, uint8_t *marked, size_t *stack, double *second) {
    spot best = {0};
    *second = 0;
    for (size_t p = 0; p < (size_t)image->width * (size_t)image->height; p++) {
        if (marked[p] || !(image->pixels[p] > level)) {
            continue;
        }
        const spot s = flood(image, level, p, marked, stack);
        if (s.pixels > 1 && s.sum > best.sum) {
            *second = best.sum;
            best = s;
        } else if (s.pixels > 1) {
            *second = fmax(*second, s.sum);
        }
    }
    return best;
}

// The peak of 2 x 2 means, so that a hot pixel does not set the level.
static double peak_of(const gonio_image *image) {
    double peak = 0;
    for (int v = 0; v + 1 < image->height; v++) {
        const uint16_t *row = image->pixels + (size_t)v * (size_t)image->width, *below = row + image->width;
        for (int u = 0; u + 1 < image->width; u++) {
            peak = fmax(peak, (row[u] + row[u + 1] + below[u] + below[u + 1]) / 4.0);
        }
    }
    return peak;
}

gonio_status gonio_highlight_find(const gonio_image *image, double at[2], gonio_error *error) {
    const size_t n = (size_t)image->width * (size_t)image->height;
    if (image->channels != 1 || image->width < 8 || image->height < 8) {
        return gonio_fail(error, GONIO_E_USAGE, "a grey image of at least 8 x 8 pixels is needed");
    }
    float *values = malloc(n * sizeof *values);
    uint8_t *marked = calloc(n, 1);
    size_t *stack = malloc(n * sizeof *stack);
    gonio_status status = GONIO_OK;
    if (values == NULL || marked == NULL || stack == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to look at %zu pixels", n);
        goto done;
    }
    double median, sigma, second;
    for (size_t i = 0; i < n; i++) {
        values[i] = image->pixels[i];
    }
    status = gonio_median_mad_f32(values, n, &median, &sigma, error);
    if (status != GONIO_OK) {
        goto done;
    }
    const double peak = peak_of(image);
    if (!(peak - median > CONTRAST * fmax(sigma, 1))) {
        status = gonio_fail(error, GONIO_E_INPUT, "no highlight: the brightest spot is %.0f over a background of %.0f",
                            peak, median);
        goto done;
    }
    const spot s = brightest(image, median + SHARE * (peak - median), marked, stack, &second);
    if (s.pixels < 4) {
        status = gonio_fail(error, GONIO_E_INPUT, "no highlight: the brightest spot has %d pixels", s.pixels);
    } else if (s.cut) {
        status = gonio_fail(error, GONIO_E_INPUT, "the highlight at (%.0f, %.0f) is cut by the image's edge", s.u, s.v);
    } else if (second > SECOND * s.sum) {
        status = gonio_fail(error, GONIO_E_INPUT, "more than one highlight: the second is %.0f %% as bright",
                            100 * second / s.sum);
    }
    at[0] = s.u;
    at[1] = s.v;
done:
    free(values);
    free(marked);
    free(stack);
    return status;
}
