// SPDX-License-Identifier: BSD-3-Clause
// Recovery of random truths by the methods of formulae: the test takes a few of each, the bench a hundred.
//
// Half of the geometries are uniform over the hemisphere up to 85 deg; the other half has half vectors whose slopes are
// spread by their logarithm from 3e-4 to 1, as measured tables have them: without, narrow lobes leave no trace.
#ifndef TESTS_RECOVERY_H
#define TESTS_RECOVERY_H

#include <string.h>

#include "brdf/kind/analytic.h"
#include "gonio/fit.h"
#include "tests/simulate.h"

typedef struct recovery_range {
    const char *name;
    double low, high; // of the logarithm where low > 0, else of the value
} recovery_range;

// A method and the range of its truths. "published": of the 86 fits of Ngan et al. 2005 to MERL materials.
typedef struct recovery_case {
    const char *method, *source;
    int lobes;
    bool isotropic;
    recovery_range ranges[6]; // of each lobe; others keep what a SPEC leaves out; of rho_d the first lobe's alone
} recovery_case;

#define RECOVERY_RHO                                                                                                   \
    {"rho_d", 0.01, 0.4}, { "rho_s", 0.03, 0.5 }

static const recovery_case recovery_cases[] = {
    {"lambert", "any", 1, true, {{"rho", 0.01, 1}}},
    {"phong", "exponents as Blinn's over 4", 1, true, {RECOVERY_RHO, {"n", 3, 3e4}}},
    {"blinn-phong", "published", 1, true, {RECOVERY_RHO, {"n", 10, 1.1e5}}},
    {"lafortune", "published", 1, true, {RECOVERY_RHO, {"cxy", -1, -1}, {"n", 14, 1e4}}},
    {"lafortune", "published", 2, true, {RECOVERY_RHO, {"cxy", -1, -1}, {"n", 14, 1e4}}},
    {"lafortune", "published", 3, true, {RECOVERY_RHO, {"cxy", -1, -1}, {"n", 14, 1e4}}},
    {"lafortune", "published", 5, true, {RECOVERY_RHO, {"cxy", -1, -1}, {"n", 14, 1e4}}},
    {"ward", "published", 1, true, {RECOVERY_RHO, {"alpha", 0.0065, 0.45}}},
    {"ward", "published, along each axis", 1, false, {RECOVERY_RHO, {"alpha_x", 0.02, 0.45}, {"alpha_y", 0.02, 0.45}}},
    {"ward-duer", "as Ward's", 1, true, {RECOVERY_RHO, {"alpha", 0.0065, 0.45}}},
    {"cook-torrance", "published", 1, true, {RECOVERY_RHO, {"m", 0.0065, 0.35}, {"f0", 0.02, 0.9}}},
    {"cook-torrance", "published", 2, true, {RECOVERY_RHO, {"m", 0.0065, 0.35}, {"f0", 0.02, 0.9}}},
    {"cook-torrance", "published", 3, true, {RECOVERY_RHO, {"m", 0.0065, 0.35}, {"f0", 0.02, 0.9}}},
    {"ashikhmin-shirley", "exponents as Blinn's", 1, true, {RECOVERY_RHO, {"n", 10, 1e5}, {"f0", 0.02, 0.9}}},
    {"ashikhmin-shirley",
     "along each axis",
     1,
     false,
     {RECOVERY_RHO, {"n_u", 10, 1e4}, {"n_v", 10, 1e4}, {"f0", 0.02, 0.9}}},
    {"oren-nayar", "any", 1, true, {{"rho", 0.05, 1}, {"sigma", 0.1, 1.2}}},
    {"schlick", "squares of Ward's alpha", 1, true, {RECOVERY_RHO, {"r", 5e-5, 0.2}, {"f0", 0.02, 0.9}}},
    {"he",
     "He et al.'s surfaces, about",
     1,
     true,
     {RECOVERY_RHO, {"sigma", 0.03, 1}, {"tau", 1, 20}, {"f0", 0.02, 0.9}}},
    {"ggx", "as Ward's alpha", 1, true, {RECOVERY_RHO, {"alpha", 0.0065, 0.45}, {"f0", 0.02, 0.9}}},
    {"ggx", "as Ward's alpha", 2, true, {RECOVERY_RHO, {"alpha", 0.0065, 0.45}, {"f0", 0.02, 0.9}}},
    {"ggx",
     "along each axis",
     1,
     false,
     {RECOVERY_RHO, {"alpha_x", 0.02, 0.45}, {"alpha_y", 0.02, 0.45}, {"f0", 0.02, 0.9}}},
    {"principled",
     "any",
     1,
     true,
     {{"base", 0.05, 0.95}, {"metallic", 0.05, 0.95}, {"specular", 0.1, 1}, {"roughness", 0.1, 0.9}}},
};
#define RECOVERY_CASES (sizeof recovery_cases / sizeof *recovery_cases)

static inline double recovery_draw(const recovery_range *r, uint64_t *seed) {
    const double u = simulate_uniform(seed);
    return r->low > 0 ? r->low * pow(r->high / r->low, u) : r->low + (r->high - r->low) * u;
}

static inline void recovery_set(const gonio_formula *f, double *p, const char *name, double value) {
    for (int k = 0; k < f->n; k++) {
        if (strcmp(f->parameters[k].name, name) == 0) {
            p[k] = value;
        }
    }
    for (int k = f->alias.first; f->alias.name != NULL && k <= f->alias.last && strcmp(f->alias.name, name) == 0; k++) {
        p[k] = value * f->alias.scale;
    }
}

// A random truth of one channel; parameters [lobes][formula->n].
static inline gonio_model *recovery_truth(const recovery_case *c, uint64_t *seed, double *parameters) {
    const gonio_formula *f = gonio_formula_find(c->method);
    gonio_analytic_term terms[5];
    for (int lobe = 0; lobe < c->lobes; lobe++) {
        double *p = parameters + lobe * f->n;
        terms[lobe] = (gonio_analytic_term){f, p};
        for (int k = 0; k < f->n; k++) {
            p[k] = isnan(f->parameters[k].initial) ? 0 : f->parameters[k].initial;
        }
        for (const recovery_range *r = c->ranges; r->name != NULL; r++) {
            const double value = recovery_draw(r, seed);
            recovery_set(f, p, r->name, strcmp(r->name, "rho_d") == 0 && lobe > 0 ? 0 : value);
        }
        if (strcmp(c->method, "lafortune") == 0) {
            // Between 1 and e^12 times as bright at grazing as at normal incidence; Ngan's factor (n + 2) / (2 pi).
            const double gain = 12 * simulate_uniform(seed), n = p[5];
            recovery_set(f, p, "cxy", -exp(gain / n));
            recovery_set(f, p, "rho_s", p[1] * (n + 2) / (2 * GONIO_PI) * exp(-gain));
        }
    }
    gonio_model *model;
    gonio_error error = {0};
    if (gonio_analytic_new(terms, c->lobes, 1, NULL, &model, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    return model;
}

static inline double recovery_normal(uint64_t *seed) {
    const double u = 1 - simulate_uniform(seed), v = simulate_uniform(seed);
    return sqrt(-2 * log(u)) * cos(2 * GONIO_PI * v);
}

static inline gonio_pair recovery_pair(uint64_t *seed, bool isotropic, size_t index) {
    for (;;) {
        gonio_pair pair = simulate_pair(seed, isotropic);
        if (index % 2 == 0) {
            return pair;
        }
        const double slope = 3e-4 * pow(1 / 3e-4, simulate_uniform(seed)), turn = 2 * GONIO_PI * simulate_uniform(seed);
        const double z = 1 / sqrt(1 + slope * slope);
        const gonio_vec3 h = {z * slope * cos(turn), z * slope * sin(turn), z};
        const gonio_vec3 i = gonio_direction(pair.theta_i, pair.phi_i);
        const double along = 2 * (h.x * i.x + h.y * i.y + h.z * i.z);
        const gonio_vec3 o = {along * h.x - i.x, along * h.y - i.y, along * h.z - i.z};
        if (o.z > 0.087) { // 85 deg
            return gonio_pair_from_vectors(i, o);
        }
    }
}

static inline gonio_samples *recovery_samples(const gonio_model *truth, size_t n, double noise, uint64_t *seed) {
    gonio_samples *samples;
    gonio_error error = {0};
    if (gonio_samples_new(1, false, &samples, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    samples->isotropic = truth->isotropic;
    for (size_t k = 0; k < n; k++) {
        const gonio_pair pair = recovery_pair(seed, truth->isotropic, k);
        double value;
        gonio_model_eval_pair(truth, &pair, &value);
        value *= 1 + noise * recovery_normal(seed);
        if (gonio_samples_add(samples, &pair, &value, NULL, NULL, &error) != GONIO_OK) {
            simulate_die(&error);
        }
    }
    return samples;
}

typedef struct recovery {
    double worst;     // relative error of the worst parameter, lobes in the order that makes it least
    double f_worst;   // of f_r at 1,000 directions, over the largest
    double condition; // of the Jacobian
    double spread;    // rms residual of the worst start over the best; 0: one lobe
    int within, parameters;
    bool converged, failed;
} recovery;

static inline bool recovery_varied(const gonio_formula *f, const recovery_case *c, int k) {
    double mark[GONIO_FORMULA_PARAMETERS_MAX] = {0};
    for (const recovery_range *r = c->ranges; r->name != NULL; r++) {
        recovery_set(f, mark, r->name, 1);
    }
    return mark[k] != 0;
}

// The worst error of one lobe against one of the truth, and how many parameters lie within 3 sigmas.
static inline double recovery_lobe(const recovery_case *c, const gonio_formula *f, const double *is,
                                   const double *sigma, const double *truth, bool first, int *within, int *count) {
    double worst = 0;
    *within = *count = 0;
    for (int k = 0; k < f->n; k++) {
        const bool diffuse = strcmp(f->parameters[k].name, "rho_d") == 0;
        if (recovery_varied(f, c, k) && (first || !diffuse)) {
            worst = fmax(worst, fabs(is[k] - truth[k]) / fabs(truth[k]));
            *within += fabs(is[k] - truth[k]) <= 3 * sigma[k];
            ++*count;
        }
    }
    return worst;
}

// rho_d goes with the first lobe of each.
static inline void recovery_match(const recovery_case *c, const gonio_formula *f, const gonio_model *model,
                                  const double *truth, recovery *out) {
    const gonio_analytic_term *terms;
    const int n = gonio_analytic_terms(model, &terms), total = f->n;
    const double *sigmas = gonio_analytic_sigmas(model);
    int order[5] = {0, 1, 2, 3, 4}, count[5] = {0};
    out->worst = INFINITY;
    for (;;) { // permutations, by Heap's counters
        double worst = 0;
        int within = 0, parameters = 0;
        for (int lobe = 0; lobe < n; lobe++) {
            double is[GONIO_FORMULA_PARAMETERS_MAX], sigma[GONIO_FORMULA_PARAMETERS_MAX];
            memcpy(is, terms[order[lobe]].parameters, (size_t)total * sizeof *is);
            memcpy(sigma, sigmas + order[lobe] * total, (size_t)total * sizeof *sigma);
            for (int k = 0; k < total; k++) {
                if (strcmp(f->parameters[k].name, "rho_d") == 0) {
                    is[k] = terms[0].parameters[k];
                    sigma[k] = sigmas[k];
                }
            }
            int w, p;
            worst = fmax(worst, recovery_lobe(c, f, is, sigma, truth + lobe * total, lobe == 0, &w, &p));
            within += w;
            parameters += p;
        }
        if (worst < out->worst) {
            *out = (recovery){.worst = worst, .within = within, .parameters = parameters};
        }
        int at = 1;
        while (at < n && count[at] == at) {
            count[at++] = 0;
        }
        if (at >= n) {
            return;
        }
        const int other = at % 2 == 0 ? 0 : count[at], kept = order[other];
        order[other] = order[at];
        order[at] = kept;
        count[at]++;
    }
}

static inline recovery recovery_run(const recovery_case *c, size_t n, double noise, uint64_t *seed) {
    const gonio_formula *f = gonio_formula_find(c->method);
    double parameters[5 * GONIO_FORMULA_PARAMETERS_MAX];
    gonio_model *truth = recovery_truth(c, seed, parameters), *model;
    gonio_samples *samples = recovery_samples(truth, n, noise, seed);
    gonio_fit_options o;
    gonio_fit_report report;
    gonio_error error = {0};
    recovery out = {.worst = INFINITY, .f_worst = INFINITY, .failed = true};
    gonio_fit_options_default(&o);
    o.method = c->method;
    o.hold_out = 0;
    o.threads = 1;
    if (strcmp(c->method, "lafortune") == 0 || strcmp(c->method, "cook-torrance") == 0 ||
        strcmp(c->method, "ggx") == 0) {
        o.lobes = c->lobes;
    }
    if (gonio_fit(samples, &o, &model, &report, &error) == GONIO_OK) {
        recovery_match(c, f, model, parameters, &out);
        out.converged = strstr(report.note, "did not converge") == NULL;
        out.condition = strtod(strstr(report.options, "condition=") + strlen("condition="), NULL);
        const char *starts = strstr(report.options, "starts=");
        double best = 0, worst = 0;
        const bool told = starts != NULL && sscanf(starts, "starts=%lf..%lf", &best, &worst) == 2;
        out.spread = told && best > 0 ? worst / best : 0;
        double largest = 0, miss = 0;
        for (size_t k = 0; k < 1000; k++) {
            const gonio_pair pair = recovery_pair(seed, truth->isotropic, k);
            double a, b;
            gonio_model_eval_pair(truth, &pair, &a);
            gonio_model_eval_pair(model, &pair, &b);
            largest = fmax(largest, fabs(a));
            miss = fmax(miss, fabs(a - b));
        }
        out.f_worst = miss / largest;
        gonio_model_free(model);
    }
    gonio_samples_free(samples);
    gonio_model_free(truth);
    return out;
}

#endif
