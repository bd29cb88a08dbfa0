// How often a model's error lies within 2 of its sigmas, pooled over seeds: materials x noise, and in each where
// samples are dense, sparse, and where there are none, in the lobe (specular above a tenth of the diffuse term) and in
// the base apart, and in bands of the larger theta. Wanted (DESIGN section 2): 90 to 99 % and a median |error|/sigma of
// 0.5 to 0.85. Printed, and cells outside are counted.
//
// usage: fit_coverage [SEEDS [METHOD [SAMPLES [MATERIAL]]]]   MATERIAL: only that one, counted from 0
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gonio/fit.h"
#include "tests/sigma_regions.h"
#include "tests/simulate.h"

#define PROBES 300 // a region and seed
#define BANDS 4

static const struct {
    const char *name, *spec;
    double diffuse; // f_r of the diffuse term
} materials[] = {
    {"ward 0.15", "ward:rho_d=0.3,rho_s=0.2,alpha=0.15", 0.3 / GONIO_PI},
    {"ward 0.03", "ward:rho_d=0.3,rho_s=0.2,alpha=0.03", 0.3 / GONIO_PI},
    {"two ggx", "lambert:rho=0.2+ggx:rho_s=0.3,alpha=0.12,f0=0.05+ggx:rho_s=0.3,alpha=0.4,f0=0.05", 0.2 / GONIO_PI},
};
static const char *const regions[] = {"dense", "sparse", "empty"};
static const double noises[] = {0.03, 0.005, 0};
static const double band_end[BANDS] = {30, 60, 75, 90};

// |error|/sigma of a cell, as many as there are.
typedef struct cell {
    double *ratios;
    size_t n, capacity;
} cell;

static void cell_add(cell *c, double ratio) {
    if (c->n == c->capacity) {
        c->capacity = 2 * c->capacity + 1024;
        c->ratios = realloc(c->ratios, c->capacity * sizeof *c->ratios);
        if (c->ratios == NULL) {
            abort();
        }
    }
    c->ratios[c->n++] = ratio;
}

static int by_value(const void *left, const void *right) {
    const double a = *(const double *)left, b = *(const double *)right;
    return (a > b) - (a < b);
}

static int cells, outside;

// Cells of fewer than 200 values say nothing.
static void cell_print(const char *label, cell *c) {
    if (c->n >= 200) {
        qsort(c->ratios, c->n, sizeof *c->ratios, by_value);
        size_t within = 0;
        while (within < c->n && c->ratios[within] <= 2) {
            within++;
        }
        const double share = 100.0 * (double)within / (double)c->n, middle = c->ratios[c->n / 2];
        const bool good = share >= 90 && share <= 99 && middle >= 0.5 && middle <= 0.85;
        cells++;
        outside += !good;
        printf("  %-22s %5.1f %%  %.2f  (%zu)%s\n", label, share, middle, c->n, good ? "" : "  outside");
    }
    free(c->ratios);
    *c = (cell){0};
}

typedef struct table {
    cell region[3][2]; // dense, sparse, empty; base, lobe
    cell all[3];
    cell band[BANDS][2];
} table;

static void probe(const gonio_model *truth, const gonio_model *model, double diffuse, uint64_t *state, table *t) {
    for (int r = 0; r < 3; r++) {
        for (int k = 0; k < PROBES; k++) {
            const gonio_pair p = sigma_pair(state, r, k % 3 == 2);
            double f, g, sigma;
            gonio_model_eval_pair(truth, &p, &f);
            gonio_model_eval_pair(model, &p, &g);
            if (!gonio_model_sigma(model, gonio_direction(p.theta_i, p.phi_i), gonio_direction(p.theta_o, p.phi_o),
                                   &sigma)) {
                fprintf(stderr, "the model carries no sigma\n");
                exit(1);
            }
            const double ratio = fabs(f - g) / sigma, larger = fmax(p.theta_i, p.theta_o) * 180 / GONIO_PI;
            const bool lobe = f - diffuse > 0.1 * diffuse;
            int band = 0;
            while (larger > band_end[band]) {
                band++;
            }
            cell_add(&t->region[r][lobe], ratio);
            cell_add(&t->all[r], ratio);
            cell_add(&t->band[band][lobe], ratio);
        }
    }
}

static void print_table(table *t) {
    char label[64];
    for (int r = 0; r < 3; r++) {
        cell_print(regions[r], &t->all[r]);
        for (int lobe = 0; lobe < 2; lobe++) {
            snprintf(label, sizeof label, "  %s, %s", regions[r], lobe ? "lobe" : "base");
            cell_print(label, &t->region[r][lobe]);
        }
    }
    for (int b = 0; b < BANDS; b++) {
        for (int lobe = 0; lobe < 2; lobe++) {
            snprintf(label, sizeof label, "theta to %.0f deg, %s", band_end[b], lobe ? "lobe" : "base");
            cell_print(label, &t->band[b][lobe]);
        }
    }
}

int main(int argc, char **argv) {
    const int seeds = argc > 1 ? atoi(argv[1]) : 50;
    const size_t n = argc > 3 ? (size_t)atol(argv[3]) : 300;
    gonio_fit_options o;
    gonio_fit_options_default(&o);
    o.hold_out = 0;
    o.method = argc > 2 ? argv[2] : "auto";
    printf("%d seeds of %zu samples, %s: within 2 sigma, median |error|/sigma, (values)\n", seeds, n, o.method);
    for (size_t m = 0; m < sizeof materials / sizeof *materials; m++) {
        if (argc > 4 && atoi(argv[4]) != (int)m) {
            continue;
        }
        gonio_model *truth = simulate_truth(materials[m].spec);
        for (size_t k = 0; k < sizeof noises / sizeof *noises; k++) {
            table t = {0};
            for (int seed = 0; seed < seeds; seed++) {
                uint64_t state = 1000 + (uint64_t)seed;
                gonio_samples *samples = sigma_samples(truth, n, noises[k], &state);
                gonio_model *model;
                gonio_error error = {0};
                if (gonio_fit(samples, &o, &model, NULL, &error) != GONIO_OK) {
                    simulate_die(&error);
                }
                probe(truth, model, materials[m].diffuse, &state, &t);
                gonio_model_free(model);
                gonio_samples_free(samples);
            }
            printf("%s, noise %.1f %%\n", materials[m].name, 100 * noises[k]);
            print_table(&t);
            fflush(stdout);
        }
        gonio_model_free(truth);
    }
    printf("%d of %d cells outside\n", outside, cells);
    return 0;
}
