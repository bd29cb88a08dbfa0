// SPDX-License-Identifier: BSD-3-Clause
// One diffuse part and one GGX lobe that come closest to a model, and the model that they are.
//
// f_r = (1 - F) rho / pi + D V F, F of Schlick. For given widths f_r is linear in rho and f0 but for the product in the
// first term, whose F is that of the round before; two unknowns a channel, bounded by 0 and 1. Pairs are spread over
// the hemisphere and about the mirror direction, since a lobe may be seen nowhere else.
#include <math.h>
#include <stdlib.h>

#include "base/random.h"
#include "base/thread_pool.h"
#include "brdf/analytic/formula.h"
#include "brdf/lobe_sampling.h"
#include "io/parametric/principled.h"

#define PAIRS 1800
#define THETA_MAX_DEG 75
#define METAL_AS_GOOD 1.1 // of the squares' sum: a metal has three numbers less
#define BLENDER_F0 0.08
#define OUTLIER 4.0 // squares of relative errors count up to this

typedef struct pair {
    gonio_lobe_geometry g;
    double value[3], per[3], schlick;
} pair;

// ---- the model ----

typedef struct principled_model {
    gonio_model head;
    gonio_principled p;
    gonio_principled_rule rule;
} principled_model;

static double fifth(double cos_d) { return pow(1 - cos_d, 5); }

// What the diffuse part is multiplied by.
static double diffuse_share(gonio_principled_rule rule, const double f0[3], double schlick) {
    const double largest = fmax(f0[0], fmax(f0[1], f0[2]));
    return rule == GONIO_PRINCIPLED_BLENDER ? 1 : 1 - (largest + (1 - largest) * schlick);
}

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const principled_model *m = (const principled_model *)model;
    const gonio_lobe_geometry g = gonio_lobe_geometry_of(wi, wo);
    const double lobe = gonio_lobe_ggx(&g, m->p.alpha_x, m->p.alpha_y, 1), schlick = fifth(g.cos_d);
    const double share = m->p.metal ? 0 : diffuse_share(m->rule, m->p.f0, schlick);
    for (int c = 0; c < 3; c++) {
        values[c] = share * m->p.diffuse[c] / GONIO_PI + lobe * (m->p.f0[c] + (1 - m->p.f0[c]) * schlick);
    }
}

static void release(gonio_model *model) { free(model); }

static const gonio_model_ops ops = {.kind = "measured", .eval = eval, .free = release};
static const char names[3][32] = {"r", "g", "b"};

gonio_status gonio_principled_model(const gonio_principled *parameters, gonio_principled_rule rule, gonio_model **out,
                                    gonio_error *error) {
    principled_model *m = calloc(1, sizeof *m);
    if (m == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a parametric model");
    }
    m->head = (gonio_model){
        .ops = &ops, .channels = 3, .isotropic = parameters->alpha_x == parameters->alpha_y, .channel_names = names};
    m->p = *parameters;
    m->rule = rule;
    *out = &m->head;
    return GONIO_OK;
}

double gonio_principled_rounded(double value) { return round(value * 1e6) / 1e6; }

double gonio_principled_ior(double f0) {
    const double root = sqrt(fmin(f0, 0.98));
    return (1 + root) / (1 - root);
}

void gonio_principled_tell(const gonio_model *model, const gonio_principled *p, gonio_write_report *told) {
    snprintf(told->about, sizeof told->about, "GGX of alpha %.4g x %.4g, f0 %.3g %.3g %.3g, %s %.3g %.3g %.3g",
             p->alpha_x, p->alpha_y, p->f0[0], p->f0[1], p->f0[2], p->metal ? "metal, no diffuse part" : "diffuse",
             p->diffuse[0], p->diffuse[1], p->diffuse[2]);
    gonio_write_lost_channels(model, 3, told);
    gonio_write_lost(told, "all that is not one diffuse part and one GGX lobe");
}

// ---- the fit ----

static void set_pair(const gonio_model *model, size_t k, pair *out) {
    double u[6];
    for (size_t d = 0; d < 6; d++) {
        u[d] = gonio_random_uniform(gonio_random(23) + (6 * k + d) * GONIO_RANDOM_STEP);
    }
    const double reach = sin(gonio_radians(THETA_MAX_DEG));
    const gonio_vec3 wi = gonio_direction(asin(reach * sqrt(u[0])), 2 * GONIO_PI * u[1]);
    gonio_vec3 wo = gonio_direction(asin(reach * sqrt(u[2])), 2 * GONIO_PI * u[3]);
    static const double widths[3] = {0, 0.3, 0.04};
    if (widths[k % 3] > 0) {
        const gonio_proposal lobe = {GONIO_PROPOSE_GGX, widths[k % 3], widths[k % 3], 1, 1};
        gonio_proposals_sample(&lobe, 1, wi, u + 4, &wo);
        wo.z = fmax(wo.z, cos(gonio_radians(THETA_MAX_DEG)));
        const double length = sqrt(wo.x * wo.x + wo.y * wo.y + wo.z * wo.z);
        wo = (gonio_vec3){wo.x / length, wo.y / length, wo.z / length};
    }
    out->g = gonio_lobe_geometry_of(wi, wo);
    out->schlick = fifth(out->g.cos_d);
    gonio_model_eval(model, wi, wo, out->value);
    for (int c = 0; c < 3; c++) {
        const bool any = isfinite(out->value[c]);
        out->value[c] = any ? out->value[c] : 0;
        out->per[c] = any ? 1 / fmax(out->value[c], 1e-4) : 0;
    }
}

// rho and f0 of one channel; each within 0 and top. a, b: their rows; y: what is left to them.
static void two_unknowns(const double s[5], double top, double *rho, double *f0) {
    const double aa = s[0], ab = s[1], bb = s[2], ay = s[3], by = s[4], det = aa * bb - ab * ab;
    *rho = det > 1e-12 * aa * bb ? (ay * bb - by * ab) / det : 0;
    *f0 = det > 1e-12 * aa * bb ? (by * aa - ay * ab) / det : by / fmax(bb, 1e-300);
    const double held = fmin(fmax(*f0, 0), top);
    if (held != *f0) {
        *f0 = held;
        *rho = (ay - ab * held) / fmax(aa, 1e-300);
    }
    if (*rho < 0 || *rho > 1) {
        *rho = fmin(fmax(*rho, 0), 1);
        *f0 = fmin(fmax((by - ab * *rho) / fmax(bb, 1e-300), 0), top);
    }
}

// The best of all for these widths; returns the sum of squares.
static double solve(const pair *pairs, gonio_principled_rule rule, gonio_principled *p) {
    const double top = rule == GONIO_PRINCIPLED_BLENDER && !p->metal ? BLENDER_F0 : 1;
    double square = 0;
    for (int c = 0; c < 3; c++) {
        p->f0[c] = 0.04;
    }
    for (int round = 0; round < 4; round++) {
        double s[3][5] = {{0}};
        square = 0;
        for (size_t k = 0; k < PAIRS; k++) {
            const pair *x = &pairs[k];
            const double lobe = gonio_lobe_ggx(&x->g, p->alpha_x, p->alpha_y, 1);
            const double share = p->metal ? 0 : diffuse_share(rule, p->f0, x->schlick) / GONIO_PI;
            for (int c = 0; c < 3; c++) {
                const double a = share * x->per[c], b = lobe * (1 - x->schlick) * x->per[c];
                const double y = (x->value[c] - lobe * x->schlick) * x->per[c];
                const double off = a * p->diffuse[c] + b * p->f0[c] - y;
                const double held = off * off > OUTLIER ? OUTLIER / (off * off) : 1; // what is far off counts less
                square += fmin(off * off, OUTLIER);
                s[c][0] += held * a * a, s[c][1] += held * a * b, s[c][2] += held * b * b;
                s[c][3] += held * a * y, s[c][4] += held * b * y;
            }
        }
        for (int c = 0; c < 3 && round < 3; c++) {
            two_unknowns(s[c], top, &p->diffuse[c], &p->f0[c]);
        }
        if (rule == GONIO_PRINCIPLED_BLENDER && !p->metal && round < 3) { // its dielectric lobe has no colour
            p->f0[0] = p->f0[1] = p->f0[2] = (p->f0[0] + p->f0[1] + p->f0[2]) / 3;
        }
    }
    return square;
}

typedef struct ladder {
    const pair *pairs;
    gonio_principled_rule rule;
    gonio_principled tried[33];
    double square[33];
} ladder;

static void try_rung(void *context, size_t k) {
    ladder *l = context;
    l->square[k] = solve(l->pairs, l->rule, &l->tried[k]);
}

// Try n widths about *best, `factor` apart, of both axes or one.
static void climb(ladder *l, gonio_principled *best, double *least, int n, double factor, bool x, bool y, int threads) {
    for (int k = 0; k < n; k++) {
        const double f = pow(factor, k - n / 2); // NOLINT(bugprone-integer-division)
        l->tried[k] = *best;
        l->tried[k].alpha_x = fmin(fmax(best->alpha_x * (x ? f : 1), 1e-3), 1);
        l->tried[k].alpha_y = fmin(fmax(best->alpha_y * (y ? f : 1), 1e-3), 1);
    }
    gonio_pool_for(threads, (size_t)n, try_rung, l);
    for (int k = 0; k < n; k++) {
        if (l->square[k] < *least) {
            *least = l->square[k];
            *best = l->tried[k];
        }
    }
}

static double search(const pair *pairs, gonio_principled_rule rule, bool isotropic, int threads,
                     gonio_principled *best) {
    ladder l = {.pairs = pairs, .rule = rule};
    double least = INFINITY;
    best->alpha_x = best->alpha_y = 0.05;
    climb(&l, best, &least, 33, 1.35, true, true, threads);
    for (double factor = 1.3; factor > 1.002; factor = sqrt(factor)) {
        climb(&l, best, &least, 5, factor, true, true, threads);
        for (int axis = 0; axis < 2 && !isotropic; axis++) {
            climb(&l, best, &least, 7, factor * factor, axis == 0, axis == 1, threads);
        }
    }
    return least;
}

// With a diffuse part, or as a metal where that is about as good.
static void search_both(const pair *pairs, gonio_principled_rule rule, bool isotropic, int threads,
                        gonio_principled *best) {
    gonio_principled metal = {.metal = true};
    *best = (gonio_principled){0};
    const double square = search(pairs, rule, isotropic, threads, best);
    if (search(pairs, rule, isotropic, threads, &metal) <= METAL_AS_GOOD * square + 1e-9) {
        *best = metal;
    }
}

gonio_status gonio_principled_fit(const gonio_model *model, gonio_principled_rule rule, int threads,
                                  gonio_principled *out, gonio_error *error) {
    gonio_model *rgb;
    pair *pairs = malloc(PAIRS * sizeof *pairs);
    gonio_status status = pairs != NULL ? gonio_model_as_rgb(model, &rgb, error)
                                        : gonio_fail(error, GONIO_E_MEMORY, "no memory to fit parameters");
    if (status == GONIO_OK) {
        for (size_t k = 0; k < PAIRS; k++) {
            set_pair(rgb, k, &pairs[k]);
        }
        search_both(pairs, rule, model->isotropic, threads, out);
        double *const numbers[] = {&out->alpha_x, &out->alpha_y};
        for (int k = 0; k < 2; k++) {
            *numbers[k] = gonio_principled_rounded(*numbers[k]);
        }
        for (int c = 0; c < 3; c++) {
            out->diffuse[c] = out->metal ? 0 : gonio_principled_rounded(out->diffuse[c]);
            out->f0[c] = gonio_principled_rounded(out->f0[c]);
        }
        if (rgb != model) {
            gonio_model_free(rgb);
        }
    }
    free(pairs);
    return status;
}
