// How often a model's error lies within 2 of its sigmas, pooled over 50 seeds: where samples are dense, sparse, and
// where there are none. Wanted: 90 to 99 % and a median |error|/sigma of 0.5 to 0.85. Reported, not judged.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "gonio/fit.h"
#include "tests/simulate.h"

#define SEEDS 50
#define SAMPLES 300
#define PROBES 300
#define SPEC "ward:rho_d=0.3,rho_s=0.2,alpha=0.3"

static double theta_between(uint64_t *state, double low_deg, double high_deg) {
    const double a = cos(low_deg * GONIO_PI / 180), b = cos(high_deg * GONIO_PI / 180);
    return acos(b + (a - b) * simulate_uniform(state));
}

// Nine of ten outgoing directions below 45 deg, the tenth from there to 70, none beyond.
static gonio_pair pair_in(uint64_t *state, int region) {
    static const double edges[] = {0, 45, 70, 88};
    const double theta_i = theta_between(state, 0, 70);
    const double theta_o = theta_between(state, edges[region], edges[region + 1]);
    return (gonio_pair){theta_i, 0, theta_o, 2 * GONIO_PI * simulate_uniform(state)};
}

static double normal(uint64_t *state) {
    double sum = -6; // Irwin-Hall
    for (int k = 0; k < 12; k++) {
        sum += simulate_uniform(state);
    }
    return sum;
}

static gonio_samples *sampled(const gonio_model *truth, double noise, uint64_t *state) {
    gonio_samples *samples;
    gonio_error error = {0};
    if (gonio_samples_new(1, noise > 0, &samples, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    samples->isotropic = true;
    for (int i = 0; i < SAMPLES; i++) {
        const gonio_pair pair = pair_in(state, i % 10 == 9);
        double value, sigma, zero = 0;
        gonio_model_eval_pair(truth, &pair, &value);
        sigma = noise * value;
        value += sigma * normal(state);
        const bool told = noise > 0;
        if (gonio_samples_add(samples, &pair, &value, told ? &sigma : NULL, told ? &zero : NULL, &error) != GONIO_OK) {
            simulate_die(&error);
        }
    }
    return samples;
}

static int by_value(const void *left, const void *right) {
    const double a = *(const double *)left, b = *(const double *)right;
    return (a > b) - (a < b);
}

static void probe(const gonio_model *truth, const gonio_model *model, uint64_t *state, int region, double *ratios) {
    for (int k = 0; k < PROBES; k++) {
        const gonio_pair p = pair_in(state, region);
        double f, g, sigma;
        gonio_model_eval_pair(truth, &p, &f);
        gonio_model_eval_pair(model, &p, &g);
        gonio_model_sigma(model, gonio_direction(p.theta_i, p.phi_i), gonio_direction(p.theta_o, p.phi_o), &sigma);
        ratios[k] = fabs(f - g) / sigma;
    }
}

static void pooled(const gonio_model *truth, double noise) {
    static const char *const names[] = {"dense", "sparse", "empty"};
    static double ratios[3][SEEDS * PROBES];
    gonio_fit_options o;
    gonio_fit_options_default(&o);
    o.hold_out = 0;
    for (uint64_t seed = 0; seed < SEEDS; seed++) {
        uint64_t state = 1000 + seed;
        gonio_samples *samples = sampled(truth, noise, &state);
        gonio_model *model;
        gonio_error error = {0};
        if (gonio_fit(samples, &o, &model, NULL, &error) != GONIO_OK) {
            simulate_die(&error);
        }
        for (int r = 0; r < 3; r++) {
            probe(truth, model, &state, r, ratios[r] + seed * PROBES);
        }
        gonio_model_free(model);
        gonio_samples_free(samples);
    }
    for (int r = 0; r < 3; r++) {
        qsort(ratios[r], SEEDS * PROBES, sizeof(double), by_value);
        int within = 0;
        while (within < SEEDS * PROBES && ratios[r][within] <= 2) {
            within++;
        }
        printf("noise %4.1f %%  %-6s  %.1f %% within 2 sigma, median |error|/sigma %.2f\n", 100 * noise, names[r],
               100.0 * within / (SEEDS * PROBES), ratios[r][SEEDS * PROBES / 2]);
    }
}

int main(void) {
    gonio_model *truth = simulate_truth(SPEC);
    printf("%s, %d samples, %d seeds\n", SPEC, SAMPLES, SEEDS);
    pooled(truth, 0.03);
    pooled(truth, 0);
    gonio_model_free(truth);
    return 0;
}
