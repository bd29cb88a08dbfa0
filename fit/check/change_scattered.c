// SPDX-License-Identifier: BSD-3-Clause
// The transforms of scattered samples: what the property asks for is interpolated by the kernel (fit/check/kernel.h).
// The interpolation's own error is part of the partner's variance, so a partner that is not well known counts little.
#include <math.h>
#include <stdlib.h>

#include "brdf/kind/transformed.h"
#include "fit/check/change.h"
#include "fit/check/kernel.h"

enum { THETAS = 18 }; // of the products' tables: 5 deg

// The kernel as a model that another may own: freeing the other leaves it alone.
typedef struct borrowed {
    gonio_model head;
    const gonio_kernel *kernel;
} borrowed;

static void move(const gonio_change *change, const gonio_samples *in, size_t at, double target, double variance,
                 double weight, gonio_samples *out) {
    out->values[at] = gonio_change_between(change, in->values[at], (1 - weight) * in->values[at] + weight * target);
    if (in->sigma_random != NULL) {
        const double own = 1 - change->delta * weight, other = change->delta * weight;
        out->sigma_random[at] = sqrt(pow(own * in->sigma_random[at], 2) + other * other * variance);
    }
}

// The exchanged directions, or any azimuth: one interpolated value each.
static void change_by_kernel(const gonio_samples *in, const gonio_kernel *k, const gonio_change *change,
                             gonio_samples *out) {
    const size_t c = (size_t)in->channels;
    double values[GONIO_CHANNELS_MAX], sigma[GONIO_CHANNELS_MAX];
    for (size_t i = 0; i < in->n; i++) {
        const gonio_pair *p = &in->pairs[i];
        const gonio_vec3 wi = gonio_direction(p->theta_i, p->phi_i), wo = gonio_direction(p->theta_o, p->phi_o);
        const bool swap = change->kind == GONIO_CHANGE_RECIPROCITY;
        const bool there = gonio_kernel_value(k, swap ? wo : wi, swap ? wi : wo, swap ? i : SIZE_MAX, values, sigma);
        for (size_t j = 0; j < c && there; j++) {
            const size_t at = i * c + j;
            // Relative errors of the interpolation are about the same everywhere.
            const double gap = 1.4826 * k->left_out * values[j], variance = sigma[j] * sigma[j] + gap * gap;
            const double own = in->sigma_random != NULL ? in->sigma_random[at] * in->sigma_random[at] : 0;
            const double weight = !swap ? 1 : own > 0 ? own / (own + variance) : 0.5;
            move(change, in, at, values[j], variance, weight, out);
        }
    }
}

// ---- energy ----

static double albedo_at(const gonio_check_report *r, const gonio_pair *p, bool isotropic) {
    const gonio_check_albedo_point *best = NULL;
    double nearest = INFINITY;
    const gonio_vec3 wi = gonio_direction(p->theta_i, isotropic ? 0 : p->phi_i);
    for (size_t k = 0; k < r->incidences; k++) {
        const gonio_vec3 at = gonio_direction(r->albedos[k].theta_i, isotropic ? 0 : r->albedos[k].phi_i);
        const double apart = hypot(hypot(at.x - wi.x, at.y - wi.y), at.z - wi.z);
        if (isfinite(r->albedos[k].largest) && apart < nearest) {
            nearest = apart;
            best = &r->albedos[k];
        }
    }
    return best != NULL ? best->largest : 0;
}

static gonio_status conserve(const gonio_samples *in, const gonio_change *change, int threads, gonio_samples *out,
                             gonio_error *error) {
    gonio_check_report r;
    const gonio_status status = gonio_check_samples(in, threads, &r, error);
    const size_t c = (size_t)in->channels;
    for (size_t i = 0; status == GONIO_OK && i < in->n; i++) {
        const double by = gonio_change_factor(change, change->one_scalar ? fmax(r.energy, 0)
                                                                         : albedo_at(&r, &in->pairs[i], in->isotropic));
        for (size_t k = i * c; k < (i + 1) * c; k++) {
            out->values[k] *= by;
            if (out->sigma_random != NULL) {
                out->sigma_random[k] *= by;
                out->sigma_systematic[k] *= by;
            }
        }
    }
    if (status == GONIO_OK) {
        gonio_check_report_free(&r);
    }
    return status;
}

// ---- separability ----

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    gonio_model_eval(&((const borrowed *)model)->kernel->head, wi, wo, values);
}
static void leave(gonio_model *model) { free(model); }
static const gonio_model_ops borrowed_ops = {.kind = "kernel", .eval = eval, .free = leave};

static gonio_status separate(const gonio_samples *in, const gonio_kernel *k, const gonio_change *change, int threads,
                             gonio_samples *out, gonio_error *error) {
    const size_t c = (size_t)in->channels;
    double *tables, values[GONIO_CHANNELS_MAX];
    gonio_model *model = NULL;
    borrowed *inner = malloc(sizeof *inner);
    gonio_status status = inner != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a model");
    if (status == GONIO_OK) {
        *inner = (borrowed){k->head, k};
        inner->head.ops = &borrowed_ops;
        status = gonio_change_products(&inner->head, change->products, THETAS, &tables, threads, error);
    }
    if (status == GONIO_OK) {
        const gonio_transformed_parts parts = {.what = GONIO_MADE_SEPARABLE,
                                               .delta = 1,
                                               .products = (size_t)change->products,
                                               .thetas = THETAS,
                                               .phis = 4 * THETAS,
                                               .tables = tables};
        status = gonio_transformed_new(&inner->head, &parts, &model, error);
        free(tables);
    }
    for (size_t i = 0; status == GONIO_OK && i < in->n; i++) {
        gonio_model_eval_pair(model, &in->pairs[i], values);
        for (size_t j = 0; j < c; j++) {
            out->values[i * c + j] = gonio_change_between(change, in->values[i * c + j], values[j]);
        }
    }
    if (model != NULL) {
        gonio_model_free(model);
    } else {
        free(inner);
    }
    return status;
}

gonio_status gonio_change_scattered(const gonio_samples *in, const gonio_change *change, int threads,
                                    gonio_samples *out, gonio_error *error) {
    if (change->kind == GONIO_CHANGE_ENERGY) {
        return conserve(in, change, threads, out, error);
    }
    if (change->kind == GONIO_CHANGE_ISOTROPY && in->isotropic) {
        return GONIO_OK;
    }
    gonio_kernel k;
    gonio_status status = gonio_kernel_new(in, change->kind == GONIO_CHANGE_ISOTROPY, &k, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (change->kind == GONIO_CHANGE_SEPARABLE) {
        status = separate(in, &k, change, threads, out, error);
    } else {
        change_by_kernel(in, &k, change, out);
    }
    if (status == GONIO_OK && change->kind == GONIO_CHANGE_ISOTROPY && change->delta == 1) {
        for (size_t i = 0; i < out->n; i++) { // turned to azimuth 0 and declared isotropic
            out->pairs[i].phi_o =
                gonio_angle_canonical(remainder(out->pairs[i].phi_o - out->pairs[i].phi_i, 2 * GONIO_PI));
            out->pairs[i].phi_i = 0;
        }
        out->isotropic = true;
    }
    gonio_kernel_free(&k);
    return status;
}
