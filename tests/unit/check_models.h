// SPDX-License-Identifier: BSD-3-Clause
// Models whose measures are known, and samples of them: for the tests of fit/check.
#ifndef TESTS_CHECK_MODELS_H
#define TESTS_CHECK_MODELS_H

#include "base/random.h"
#include "gonio/check.h"
#include "gonio/io.h"
#include "gonio/plan.h"
#include "tests/unit/near.h"

static inline gonio_model *from(const char *spec) {
    gonio_model *m;
    assert_int_equal(gonio_model_from_spec(spec, &m, NULL), GONIO_OK);
    return m;
}

static inline gonio_samples *sampled(const gonio_model *m, const char *plan_text) {
    gonio_plan *plan;
    gonio_samples *s;
    assert_int_equal(gonio_plan_make(plan_text, 1, &plan, NULL), GONIO_OK);
    assert_int_equal(gonio_samples_of_model(m, plan->poses, plan->n, 0, &s, NULL), GONIO_OK);
    gonio_plan_free(plan);
    return s;
}

static inline gonio_check_report report_of(const gonio_samples *s) {
    gonio_check_report r;
    gonio_error error = {0};
    if (gonio_check_samples(s, 1, &r, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    return r;
}

// ---- models whose measures are known ----

typedef struct phong {
    gonio_model head;
    double kd, ks, n;
    bool over_cosine; // DeYoung's: divided by cos(theta_i), so not reciprocal
    bool leaning;     // not reciprocal either, and smooth up to the horizon
} phong;

static const char one_name[1][32] = {"y"};

static inline void eval_phong(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const phong *p = (const phong *)model;
    const double c = 2 * wi.z * wo.z - (wi.x * wo.x + wi.y * wo.y + wi.z * wo.z);
    const double lobe = c > 0 ? p->ks * (p->n + 2) / (2 * GONIO_PI) * pow(c, p->n) : 0;
    values[0] = p->kd / GONIO_PI + (p->over_cosine ? lobe / fmax(wi.z, 1e-6)
                                    : p->leaning   ? lobe * (1 + wi.z) / 2
                                                   : lobe);
}
static inline void eval_lopsided(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    (void)model;
    (void)wo;
    values[0] = wi.z;
}
// One product that is neither reciprocal nor isotropic.
static inline void eval_product(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    (void)model;
    values[0] = (0.2 + wi.z * wi.z + 0.1 * wi.x) * (0.1 + exp(wo.x) * wo.z);
}
static inline void eval_broken(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    (void)model;
    (void)wi;
    values[0] = wo.x > 0.5 ? NAN : 1;
}
static inline void keep_it(gonio_model *model) { (void)model; }

static const gonio_model_ops phong_ops = {.kind = "test", .eval = eval_phong, .free = keep_it};
static const gonio_model_ops lopsided_ops = {.kind = "test", .eval = eval_lopsided, .free = keep_it};
static const gonio_model_ops product_ops = {.kind = "test", .eval = eval_product, .free = keep_it};
static const gonio_model_ops broken_ops = {.kind = "test", .eval = eval_broken, .free = keep_it};
#define HEAD(table, iso)                                                                                               \
    { .ops = &(table), .channels = 1, .isotropic = (iso), .channel_names = one_name }

static inline void add_noise(gonio_samples *s, double part, double defect, uint64_t seed) {
    uint64_t state = gonio_random(seed);
    if (s->sigma_random == NULL) {
        s->sigma_random = calloc(s->capacity, sizeof(double));
        s->sigma_systematic = calloc(s->capacity, sizeof(double));
    }
    for (size_t i = 0; i < s->n; i++) {
        const double u = 1 - gonio_random_next(&state), v = gonio_random_next(&state);
        const double off = 1 + defect * (cos(s->pairs[i].theta_i) - cos(s->pairs[i].theta_o));
        s->sigma_random[i] = part * s->values[i] * off;
        s->values[i] *= off * (1 + part * sqrt(-2 * log(u)) * cos(2 * GONIO_PI * v));
    }
}

#endif
