// SPDX-License-Identifier: BSD-3-Clause
// How often `gonio check` calls a physical material's measurement "not explained by sigma", and how often it finds a
// defect: simulated materials with noise, whose sigma is known. A program of its own (make significance): minutes.
//
// usage: significance [MATERIALS [SEED]]
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/random.h"
#include "fit/check/measures.h"
#include "fit/check/partial.h"
#include "gonio/check.h"
#include "gonio/io.h"
#include "gonio/plan.h"
#include "tests/simulate.h"

#define NOISE 0.005 // of the value, k = 1
#define LEVEL 0.01

typedef struct trial {
    const char *what, *plan;
    bool separable, white, isotropic;              // white: a diffuser that loses nothing, where energy is at its limit
    double defect;                                 // rms of f(i, o) / f(o, i) - 1
    double (*p)(const gonio_check_report *report); // of a table
    gonio_symmetry_test symmetry;                  // of scattered samples, where p is NULL
} trial;

static double p_reciprocity(const gonio_check_report *r) { return r->reciprocity_test.p; }
static double p_isotropy(const gonio_check_report *r) { return r->isotropy_test.p; }
static double p_energy(const gonio_check_report *r) { return r->energy_test.p; }
static double p_separability(const gonio_check_report *r) { return r->separability_test[0].p; }

static const trial trials[] = {
    {"table, reciprocity", "uniform:15", .isotropic = true, .p = p_reciprocity},
    {"table, isotropy", "uniform:30,anisotropic=1", .p = p_isotropy},
    {"table, energy", "cells of 15", .white = true, .isotropic = true, .p = p_energy},
    {"table, one product", "uniform:30,anisotropic=1", .separable = true, .p = p_separability},
    {"scattered, reciprocity", "nusselt:1400", .isotropic = true, .symmetry = GONIO_TEST_RECIPROCITY},
    {"scattered, isotropy", "nusselt:1400,anisotropic=1", .symmetry = GONIO_TEST_ISOTROPY},
    {"scattered, reciprocity, 4-D", "nusselt:1400,anisotropic=1", .symmetry = GONIO_TEST_RECIPROCITY},
    {"table, 2 % defect", "uniform:15", .isotropic = true, .defect = 0.02, .p = p_reciprocity},
    {"scattered, 2 % defect", "nusselt:1400", .isotropic = true, .defect = 0.02, .symmetry = GONIO_TEST_RECIPROCITY},
};

static double draw(uint64_t *state, double low, double high) { return low + (high - low) * gonio_random_next(state); }

static double normal(uint64_t *state) {
    const double u = 1 - gonio_random_next(state), v = gonio_random_next(state);
    return sqrt(-2 * log(u)) * cos(2 * GONIO_PI * v);
}

static void make_spec(const trial *t, uint64_t *state, char *spec, size_t size) {
    const double rho_d = draw(state, 0.05, 0.5), rho_s = draw(state, 0.02, 0.4);
    const double rough = exp(draw(state, log(0.08), log(0.6))), f0 = draw(state, 0.03, 0.9);
    switch ((int)(4 * gonio_random_next(state))) {
    case 0:
        snprintf(spec, size, "ward:rho_d=%g,rho_s=%g,alpha=%g", rho_d, rho_s, rough);
        break;
    case 1:
        snprintf(spec, size, "ggx:rho_d=%g,rho_s=%g,alpha=%g,f0=%g", rho_d, rho_s, rough, f0);
        break;
    case 2:
        snprintf(spec, size, "cook-torrance:rho_d=%g,rho_s=%g,m=%g,f0=%g", rho_d, rho_s, rough, f0);
        break;
    default:
        snprintf(spec, size, "oren-nayar:rho=%g,sigma=%g", rho_d + 0.3, draw(state, 0.1, 0.7));
    }
    if (t->separable || t->white) {
        snprintf(spec, size, "lambert:rho=%g", t->white ? 1 : rho_d);
    }
}

// Values with noise and, where asked for, a defect that grows with the difference of both cosines.
static void spoil(const trial *t, gonio_samples *s, uint64_t *state) {
    double squares = 0;
    for (size_t i = 0; i < s->n; i++) {
        squares += pow(2 * (cos(s->pairs[i].theta_i) - cos(s->pairs[i].theta_o)), 2) / (double)s->n;
    }
    for (size_t i = 0; i < s->n; i++) {
        const double off = t->defect / sqrt(squares) * (cos(s->pairs[i].theta_i) - cos(s->pairs[i].theta_o));
        const double truth = s->values[i] * (1 + off);
        s->sigma_random[i] = NOISE * truth;
        s->values[i] = truth * (1 + NOISE * normal(state));
    }
}

static double of_table(const trial *t, const gonio_samples *s) {
    gonio_check_report report;
    gonio_error error = {0};
    if (gonio_check_samples(s, 1, &report, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    const double p = t->p(&report);
    gonio_check_report_free(&report);
    return p;
}

// The test alone: interpolating what the other figures need takes longer.
static double of_scattered(const trial *t, const gonio_samples *s) {
    gonio_check_test test;
    double part;
    gonio_error error = {0};
    if (gonio_partial_test(s, t->symmetry, 1, &test, &part, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    return test.p;
}

static double run(const trial *t, const gonio_plan *plan, uint64_t seed) {
    uint64_t state = gonio_random(seed);
    char spec[200];
    make_spec(t, &state, spec, sizeof spec);
    gonio_model *model;
    gonio_samples *exact, *s;
    gonio_error error = {0};
    if (gonio_model_from_spec(spec, &model, &error) != GONIO_OK ||
        gonio_samples_of_model(model, plan->poses, plan->n, 1, &exact, &error) != GONIO_OK ||
        gonio_samples_new(1, true, &s, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    s->isotropic = t->isotropic;
    for (size_t i = 0; i < exact->n; i++) {
        const double zero = 0;
        if (gonio_samples_add(s, &exact->pairs[i], &exact->values[i], &zero, &zero, &error) != GONIO_OK) {
            simulate_die(&error);
        }
    }
    spoil(t, s, &state);
    const double p = t->p != NULL ? of_table(t, s) : of_scattered(t, s);
    gonio_samples_free(s);
    gonio_samples_free(exact);
    gonio_model_free(model);
    return p;
}

int main(int argc, char **argv) {
    const int materials = argc > 1 ? atoi(argv[1]) : 1000;
    const uint64_t seed = argc > 2 ? strtoull(argv[2], NULL, 10) : 1;
    printf("%d materials, seed %llu, noise %.1f %%, level %.0f %%\n", materials, (unsigned long long)seed, 100 * NOISE,
           100 * LEVEL);
    printf("%-28s %-28s %9s %9s\n", "what", "plan", "p < 1 %", "p < 10 %");
    for (size_t k = 0; k < sizeof trials / sizeof *trials; k++) {
        if (argc > 3 && atoi(argv[3]) != (int)k) {
            continue;
        }
        gonio_plan *plan;
        gonio_error error = {0};
        int below = 0, ten = 0;
        // Energy is at its limit only where the table reaches the horizon.
        const gonio_status planned = trials[k].white ? gonio_check_cell_plan(6, true, &plan, &error)
                                                     : gonio_plan_make(trials[k].plan, seed, &plan, &error);
        if (planned != GONIO_OK) {
            simulate_die(&error);
        }
        for (int m = 0; m < materials; m++) {
            const double p = run(&trials[k], plan, seed * 1000003u + (uint64_t)m);
            below += p < LEVEL;
            ten += p < 10 * LEVEL;
        }
        printf("%-28s %-28s %7.1f %% %7.1f %%\n", trials[k].what, trials[k].plan, 100.0 * below / materials,
               100.0 * ten / materials);
        fflush(stdout);
        gonio_plan_free(plan);
    }
    return 0;
}
