// SPDX-License-Identifier: BSD-3-Clause
// What fits say of directions far from their samples: sets of one plane, one incidence, a handful of poses ...
// (tests/sparse_sets.h) of materials that the prior (fit/prior) was tuned on and of others. For each set and material,
// where the samples support the model (0.5 or more) and where they do not: how many values, per cent within 2 sigma,
// median |error|/sigma, the median and the 95th percentile of |ln(model/truth)|; and the largest albedo of the models.
//
// usage: fit_support [SEEDS [METHOD [DESIGN [tuned|others]]]]
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gonio/check.h"
#include "gonio/fit.h"
#include "tests/sparse_sets.h"

static const struct {
    const char *spec;
    bool tuned;
} materials[] = {
    {"ward:rho_d=0.3,rho_s=0.2,alpha=0.15", true},
    {"ward:rho_d=0.1,rho_s=0.4,alpha=0.4", true},
    {"ggx:rho_d=0.2,rho_s=0.5,alpha=0.2,f0=0.05", true},
    {"ggx:rho_d=0.02,rho_s=0.9,alpha=0.15,f0=0.8", true},
    {"lambert:rho=0.5", true},
    {"oren-nayar:rho=0.5,sigma_deg=25", true},
    {"cook-torrance:rho_d=0.1,rho_s=0.6,alpha=0.25,f0=0.04", false},
    {"cook-torrance:rho_d=0.3,rho_s=0.3,alpha=0.1,f0=0.6", false},
    {"blinn-phong:rho_d=0.2,rho_s=0.3,n=40", false},
    {"ward:rho_d=0.5,rho_s=0.1,alpha=0.25", false},
    {"lambert:rho=0.2+ggx:rho_s=0.3,alpha=0.12,f0=0.05+ggx:rho_s=0.3,alpha=0.4,f0=0.05", false},
    {"oren-nayar:rho=0.8,sigma_deg=35", false},
};
#define MATERIALS (sizeof materials / sizeof *materials)
#define PROBES 300
#define ANGLES 8 // of the albedo, 0 to 80 deg

typedef struct cell {
    double *ratios, *errors;
    size_t n, capacity;
} cell;

static void cell_add(cell *c, double ratio, double error) {
    if (c->n == c->capacity) {
        c->capacity = 2 * c->capacity + 1024;
        c->ratios = realloc(c->ratios, c->capacity * sizeof *c->ratios);
        c->errors = realloc(c->errors, c->capacity * sizeof *c->errors);
        if (c->ratios == NULL || c->errors == NULL) {
            abort();
        }
    }
    c->ratios[c->n] = ratio;
    c->errors[c->n++] = error;
}

static int by_value(const void *left, const void *right) {
    const double a = *(const double *)left, b = *(const double *)right;
    return (a > b) - (a < b);
}

static void cell_print(cell *c) {
    size_t within = 0;
    if (c->n == 0) {
        printf("  %33s", "-");
        return;
    }
    qsort(c->ratios, c->n, sizeof *c->ratios, by_value);
    qsort(c->errors, c->n, sizeof *c->errors, by_value);
    while (within < c->n && c->ratios[within] <= 2) {
        within++;
    }
    printf("  %5zu %5.1f %% %5.2f  %6.4f %6.3f", c->n, 100.0 * (double)within / (double)c->n, c->ratios[c->n / 2],
           c->errors[c->n / 2], c->errors[c->n * 95 / 100]);
    free(c->ratios);
    free(c->errors);
    *c = (cell){0};
}

static double largest_albedo(const gonio_model *model) {
    double most = 0;
    for (int a = 0; a < ANGLES; a++) {
        double albedo;
        gonio_check_albedo(model, a * GONIO_PI / 180 * 80 / (ANGLES - 1), &albedo);
        most = fmax(most, albedo);
    }
    return most;
}

static void probe(const gonio_model *truth, const gonio_model *model, uint64_t *state, cell *cells, cell *all) {
    for (int k = 0; k < PROBES; k++) {
        const gonio_pair p = sigma_pair(state, k % 2 == 1 ? 0 : 1 + k / 2 % 2, k % 3 == 2);
        const gonio_vec3 wi = gonio_direction(p.theta_i, p.phi_i), wo = gonio_direction(p.theta_o, p.phi_o);
        double f, g, sigma;
        gonio_model_eval_pair(truth, &p, &f);
        gonio_model_eval_pair(model, &p, &g);
        if (!gonio_model_sigma(model, wi, wo, &sigma)) {
            fprintf(stderr, "the model carries no sigma\n");
            exit(1);
        }
        const int supported = gonio_model_support(model, wi, wo) >= 0.5;
        cell_add(&cells[supported], fabs(f - g) / sigma, fabs(log(g / f)));
        cell_add(&all[supported], fabs(f - g) / sigma, fabs(log(g / f)));
    }
}

static void run(sparse_design design, size_t m, int seeds, const gonio_fit_options *o, cell all[2]) {
    gonio_model *truth = simulate_truth(materials[m].spec);
    cell cells[2] = {0};
    double albedo = 0;
    for (int seed = 0; seed < seeds; seed++) {
        uint64_t state = 100 + (uint64_t)seed;
        gonio_samples *samples = sparse_samples(truth, design, 1, 0, &state);
        gonio_model *model;
        gonio_error error = {0};
        if (gonio_fit(samples, o, &model, NULL, &error) != GONIO_OK) {
            simulate_die(&error);
        }
        albedo = fmax(albedo, largest_albedo(model));
        probe(truth, model, &state, cells, all);
        gonio_model_free(model);
        gonio_samples_free(samples);
    }
    printf("  %-32.32s", materials[m].spec);
    cell_print(&cells[1]);
    cell_print(&cells[0]);
    printf("  %.2f\n", albedo);
    fflush(stdout);
    gonio_model_free(truth);
}

int main(int argc, char **argv) {
    const int seeds = argc > 1 ? atoi(argv[1]) : 3, only = argc > 3 ? atoi(argv[3]) : -1;
    gonio_fit_options o;
    gonio_fit_options_default(&o);
    o.hold_out = 0;
    o.method = argc > 2 ? argv[2] : "auto";
    printf("%-34s  %-33s  %s\n", "", "supported: values, in 2 sigma, median", "unsupported; the largest albedo");
    for (int design = 0; design < SPARSE_DESIGNS; design++) {
        for (int tuned = 1; tuned >= 0 && (only < 0 || only == design); tuned--) {
            cell all[2] = {0};
            if (argc > 4 && (strcmp(argv[4], "tuned") == 0) != (tuned == 1)) {
                continue;
            }
            printf("%s, %s\n", sparse_names[design], tuned == 1 ? "tuned on" : "others");
            for (size_t m = 0; m < MATERIALS; m++) {
                if (materials[m].tuned == (tuned == 1)) {
                    run((sparse_design)design, m, seeds, &o, all);
                }
            }
            printf("  %-32s", "all");
            cell_print(&all[1]);
            cell_print(&all[0]);
            printf("\n");
        }
    }
    return 0;
}
