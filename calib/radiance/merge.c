// SPDX-License-Identifier: BSD-3-Clause
// Maximum-likelihood merge of linear exposures of one pixel.
//
// Exposure j reads x_j = y a_j + noise with variance v_j(y) = (y a_j + dark_j) g + r^2 + q_j: Poisson electrons times g
// DN an electron, read noise, quantisation. Weighting by a_j / v_j gives y = sum(a x / v) / sum(a^2 / v) with variance
// 1 / sum(a^2 / v), the Cramer-Rao bound of the Gaussian model (Hasinoff, Durand and Freeman, "Noise-optimal capture
// for high dynamic range photography", CVPR 2010, eq. 4; Granados et al., "Optimal HDR reconstruction with linear
// digital cameras", CVPR 2010).
//
// Two things would bias it, and both are cured by predicting v_j and the decision "too near saturation" from the pooled
// estimate, not from x_j itself:
//   - v_j from the observed x_j makes low readings look precise, and the mean falls;
//   - leaving out x_j when it is itself above the ceiling keeps the low half of its noise.
// The pooled estimate p over all exposures that did not clip is efficient, so every other unbiased combination e
// differs from it by something uncorrelated with p. Hence E[e | p above the ceiling] = E[p | ...]: choosing by p leaves
// no first-order bias, as long as the ceiling stays several sigma below clipping. A hat function of the observed value
// (Debevec and Malik 1997), the obvious alternative, has both biases and discards most photons.
#include "calib/radiance/merge.h"

#include <math.h>

static double variance(const merge_noise *noise, const merge_term *term, double y) {
    return (fmax(y * term->scale, 0) + term->dark) * noise->dn_per_e + noise->read_variance + term->quantum_variance;
}

// Pool the terms that `use` marks, with weights for radiance y.
static double pooled(const merge_noise *noise, int n, const merge_term *terms, const bool *use, double y) {
    double sum = 0, information = 0;
    for (int j = 0; j < n; j++) {
        if (use[j]) {
            const double w = terms[j].scale / variance(noise, &terms[j], y);
            sum += w * terms[j].signal;
            information += w * terms[j].scale;
        }
    }
    return sum / information;
}

static void finish(const merge_noise *noise, int n, const merge_term *terms, const bool *use, double y,
                   merge_result *result) {
    double information = 0;
    for (int j = 0; j < n; j++) {
        result->weight[j] = use[j] ? terms[j].scale / variance(noise, &terms[j], y) : 0;
        information += result->weight[j] * terms[j].scale;
    }
    for (int j = 0; j < n; j++) {
        const double w = result->weight[j] / information;
        result->weight[j] = w;
        result->value += w * terms[j].signal;
        if (use[j]) {
            const double shot = (fmax(y * terms[j].scale, 0) + terms[j].dark) * noise->dn_per_e;
            result->photon_variance += w * w * shot;
            result->read_variance += w * w * (noise->read_variance + terms[j].quantum_variance);
            result->used++;
        }
    }
}

void gonio_merge_pixel(const merge_noise *noise, int n, const merge_term *terms, merge_result *result) {
    bool use[MERGE_MAX];
    int longest = -1;
    result->value = result->photon_variance = result->read_variance = 0;
    result->used = 0;
    for (int j = 0; j < n; j++) {
        use[j] = !terms[j].clipped;
        if (use[j] && (longest < 0 || terms[j].scale > terms[longest].scale)) {
            longest = j;
        }
    }
    result->saturated = longest < 0;
    if (longest < 0) {
        return;
    }
    double y = terms[longest].signal / terms[longest].scale;
    y = pooled(noise, n, terms, use, y);
    y = pooled(noise, n, terms, use, y);
    int left = 0;
    for (int j = 0; j < n; j++) {
        use[j] = use[j] && y * terms[j].scale + terms[j].dark <= noise->ceiling;
        left += use[j];
    }
    result->saturated = left == 0;
    if (left > 0) {
        finish(noise, n, terms, use, y, result);
    }
}
