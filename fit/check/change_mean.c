// SPDX-License-Identifier: BSD-3-Clause
// What all transforms of samples share: a copy, and one value on its way to a target, with its sigma.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/head.h"
#include "fit/check/change.h"

const char *gonio_change_name(gonio_change_kind kind) {
    static const char *const names[] = {"reciprocity", "energy", "isotropy", "separable", "mirror", "clamp"};
    return names[kind];
}

double gonio_change_between(const gonio_change *change, double a, double target) {
    if (change->delta == 1) {
        return target;
    }
    if (change->geometric && a > 0 && target > 0) {
        return pow(a, 1 - change->delta) * pow(target, change->delta);
    }
    return (1 - change->delta) * a + change->delta * target;
}

double gonio_change_factor(const gonio_change *change, double albedo) {
    const double over = fmax(0, albedo - change->ceiling);
    return change->ceiling / (change->delta * over + change->ceiling);
}

void gonio_change_weigh(const gonio_samples *in, size_t c, size_t n, const size_t *of, double *weight) {
    const size_t channels = (size_t)in->channels;
    double sum = 0;
    bool known = in->sigma_random != NULL;
    for (size_t k = 0; k < n; k++) {
        known = known && in->sigma_random[of[k] * channels + c] > 0;
    }
    for (size_t k = 0; k < n; k++) {
        const double sigma = known ? in->sigma_random[of[k] * channels + c] : 1;
        weight[k] = 1 / (sigma * sigma);
        sum += weight[k];
    }
    for (size_t k = 0; k < n; k++) {
        weight[k] /= sum;
    }
}

void gonio_change_towards(const gonio_change *change, const gonio_samples *in, size_t i, size_t c, size_t n,
                          const size_t *of, const double *weight, gonio_samples *out) {
    const size_t channels = (size_t)in->channels, at = i * channels + c;
    double target = 0, random = 0, systematic = 0, own = 1 - change->delta;
    for (size_t k = 0; k < n; k++) {
        target += weight[k] * in->values[of[k] * channels + c];
    }
    out->values[at] = gonio_change_between(change, in->values[at], target);
    if (in->sigma_random == NULL) {
        return;
    }
    for (size_t k = 0; k < n; k++) {
        const double part = change->delta * weight[k];
        if (of[k] == i) {
            own += part;
        } else {
            random += pow(part * in->sigma_random[of[k] * channels + c], 2);
            systematic += part * in->sigma_systematic[of[k] * channels + c];
        }
    }
    out->sigma_random[at] = sqrt(random + pow(own * in->sigma_random[at], 2));
    out->sigma_systematic[at] = systematic + own * in->sigma_systematic[at];
}

double gonio_change_leverage(const double *vectors, size_t n, size_t k, size_t at) {
    double sum = 0;
    for (size_t j = 0; j < k; j++) {
        sum += vectors[j * n + at] * vectors[j * n + at];
    }
    return fmin(sum, 1);
}

double gonio_change_product_sigma(const gonio_change *change, double u, double v) {
    return 1 - change->delta + change->delta * sqrt(u + v - u * v);
}

gonio_status gonio_change_check(const gonio_change *change, gonio_error *error) {
    if (!(change->delta >= 0 && change->delta <= 1)) {
        return gonio_fail(error, GONIO_E_USAGE, "delta %g; expected 0 (nothing changes) to 1", change->delta);
    }
    if (change->kind == GONIO_CHANGE_ENERGY && !(change->ceiling > 0 && change->ceiling <= 1)) {
        return gonio_fail(error, GONIO_E_USAGE, "ceiling %g; expected above 0, to 1", change->ceiling);
    }
    if (change->kind == GONIO_CHANGE_SEPARABLE && !(change->products >= 1 && change->products <= 64)) {
        return gonio_fail(error, GONIO_E_USAGE, "separable:%d; expected 1 to 64 products", change->products);
    }
    return GONIO_OK;
}

gonio_status gonio_change_copy(const gonio_samples *in, bool twice, gonio_samples **out, gonio_error *error) {
    const bool sigma = in->sigma_random != NULL;
    const size_t c = (size_t)in->channels;
    gonio_status status = gonio_samples_new(in->channels, sigma, out, error);
    if (status != GONIO_OK) {
        return status;
    }
    (*out)->isotropic = in->isotropic;
    (*out)->transmission = in->transmission;
    memcpy((*out)->channel_names, in->channel_names, c * sizeof *in->channel_names);
    status = gonio_head_copy(in->head, &(*out)->head, error);
    for (size_t i = 0; i < in->n && status == GONIO_OK; i++) {
        for (int k = 0; k < (twice ? 2 : 1) && status == GONIO_OK; k++) {
            const gonio_pair p = k == 0 ? in->pairs[i] : gonio_pair_mirrored(in->pairs[i]);
            status = gonio_samples_add(*out, &p, in->values + i * c, sigma ? in->sigma_random + i * c : NULL,
                                       sigma ? in->sigma_systematic + i * c : NULL, error);
            if (status == GONIO_OK && in->group != NULL) {
                status = gonio_samples_set_group(*out, (*out)->n - 1, in->group[i], error);
            }
        }
    }
    return status;
}
