// SPDX-License-Identifier: BSD-3-Clause
// How often a model's error lies within 2 of its sigmas, pooled over seeds: materials x noise, and in each where
// samples are dense, sparse, and where there are none, in the lobe (specular above a tenth of the diffuse term) and in
// the base apart, and in bands of the larger theta. Wanted: 90 to 99 % and a median |error|/sigma of
// 0.5 to 0.85. Printed, and cells outside are counted; apart, those where the typical error is below 1e-4 of the value,
// the least sigma that a model states.
//
// usage: fit_coverage [SEEDS [METHOD [SAMPLES [MATERIAL [NOISE]]]]]
//   MATERIAL  counted from 0; "table" (the default): the first three; "others": those that no constant of the law was
//             chosen on
//   NOISE     counted from 0: 3 %, 0.5 %, none; all where left out
// usage: fit_coverage measured [FILE ...]
//   5 folds over unique geometries of measured materials (by default $GONIO_DATA/cornell): |measured - predicted| /
//   sigma of what was left out, by the larger theta. The measurement's own noise is part of that difference and no part
//   of the model's sigma.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gonio/fit.h"
#include "gonio/io.h"
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
    {"ward 0.08", "ward:rho_d=0.3,rho_s=0.2,alpha=0.08", 0.3 / GONIO_PI},
    {"ggx 0.2", "ggx:rho_d=0.2,rho_s=0.5,alpha=0.2,f0=0.05", 0.2 / GONIO_PI},
    {"lambert", "lambert:rho=0.5", 0.5 / GONIO_PI},
    {"oren-nayar", "oren-nayar:rho=0.5,sigma_deg=25", 0.5 / GONIO_PI},
};
#define MATERIALS (sizeof materials / sizeof *materials)
#define TABLE 3 // of the documentation; on the others nothing was tuned
static const char *const regions[] = {"dense", "sparse", "empty"};
static const double noises[] = {0.03, 0.005, 0};
static const double band_end[BANDS] = {30, 60, 75, 90};

// |error|/sigma of a cell, as many as there are.
typedef struct cell {
    double *ratios;
    size_t n, capacity;
    size_t exact; // errors below 1e-4 of the value
} cell;

static void cell_add(cell *c, double ratio, bool exact) {
    c->exact += exact;
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

static int cells, outside, exact_cells;

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
        const bool exact = 2 * c->exact > c->n;
        cells++;
        outside += !good;
        exact_cells += !good && exact;
        printf("  %-22s %5.1f %%  %.2f  (%zu)%s%s\n", label, share, middle, c->n, good ? "" : "  outside",
               exact ? ", errors below 1e-4" : "");
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
            const bool lobe = f - diffuse > 0.1 * diffuse, exact = fabs(f - g) < 1e-4 * f;
            int band = 0;
            while (larger > band_end[band]) {
                band++;
            }
            cell_add(&t->region[r][lobe], ratio, exact);
            cell_add(&t->all[r], ratio, exact);
            cell_add(&t->band[band][lobe], ratio, exact);
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

// A table of one material and noise; returns how many of its cells are outside.
static int run_pair(size_t m, size_t k, int seeds, size_t n, const gonio_fit_options *o) {
    gonio_model *truth = simulate_truth(materials[m].spec);
    table t = {0};
    for (int seed = 0; seed < seeds; seed++) {
        uint64_t state = 1000 + (uint64_t)seed;
        gonio_samples *samples = sigma_samples(truth, n, noises[k], &state);
        gonio_model *model;
        gonio_error error = {0};
        if (gonio_fit(samples, o, &model, NULL, &error) != GONIO_OK) {
            simulate_die(&error);
        }
        probe(truth, model, materials[m].diffuse, &state, &t);
        gonio_model_free(model);
        gonio_samples_free(samples);
    }
    const int before = outside, cells_before = cells;
    printf("%s, noise %.1f %%\n", materials[m].name, 100 * noises[k]);
    print_table(&t);
    printf("  %d of %d cells outside\n", outside - before, cells - cells_before);
    fflush(stdout);
    gonio_model_free(truth);
    return outside - before;
}

// ---- measured materials ----

#define FOLDS 5

static void run_fold(const gonio_samples *samples, const int *fold, int left_out, cell bands[BANDS + 1]) {
    bool *keep = malloc(samples->n * sizeof *keep);
    for (size_t i = 0; i < samples->n; i++) {
        keep[i] = fold[i] != left_out;
    }
    gonio_samples *part;
    gonio_model *model;
    gonio_error error = {0};
    gonio_fit_options o;
    gonio_fit_options_default(&o);
    o.hold_out = 0;
    if (gonio_samples_select(samples, keep, &part, &error) != GONIO_OK ||
        gonio_fit(part, &o, &model, NULL, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    for (size_t i = 0; i < samples->n; i++) {
        double f[GONIO_CHANNELS_MAX], sigma[GONIO_CHANNELS_MAX];
        const gonio_pair *p = &samples->pairs[i];
        if (keep[i]) {
            continue;
        }
        gonio_model_eval_pair(model, p, f);
        gonio_model_sigma(model, gonio_direction(p->theta_i, p->phi_i), gonio_direction(p->theta_o, p->phi_o), sigma);
        const double larger = fmin(fmax(p->theta_i, p->theta_o) * 180 / GONIO_PI, 90);
        int band = 0;
        while (larger > band_end[band]) {
            band++;
        }
        for (int k = 0; k < samples->channels; k++) {
            const double measured = samples->values[i * (size_t)samples->channels + (size_t)k];
            const double ratio = fabs(f[k] - measured) / sigma[k];
            cell_add(&bands[band], ratio, false);
            cell_add(&bands[BANDS], ratio, false);
        }
    }
    gonio_model_free(model);
    gonio_samples_free(part);
    free(keep);
}

static void run_measured(const char *path) {
    gonio_samples *samples;
    gonio_read_options how;
    gonio_error error = {0};
    gonio_read_options_default(&how);
    if (gonio_read(path, &how, &samples, NULL, &error) != GONIO_OK) {
        printf("%s: skipped, %s\n", path, error.message);
        return;
    }
    int *fold = malloc(samples->n * sizeof *fold);
    cell bands[BANDS + 1] = {0};
    if (fold == NULL || gonio_samples_folds(samples, FOLDS, 1, fold, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    for (int left_out = 0; left_out < FOLDS; left_out++) {
        run_fold(samples, fold, left_out, bands);
    }
    printf("%s, %zu samples of %d channels\n", path, samples->n, samples->channels);
    cell_print("all", &bands[BANDS]);
    for (int b = 0; b < BANDS; b++) {
        char label[64];
        snprintf(label, sizeof label, "theta to %.0f deg", band_end[b]);
        cell_print(label, &bands[b]);
    }
    fflush(stdout);
    free(fold);
    gonio_samples_free(samples);
}

static void measured(int count, char **paths) {
    static const char *const names[] = {"garnet_red", "acryl_blue", "mystique"};
    const char *data = getenv("GONIO_DATA");
    for (int i = 0; i < count; i++) {
        run_measured(paths[i]);
    }
    for (int i = 0; i < 3 && count == 0; i++) {
        char path[512];
        snprintf(path, sizeof path, "%s/cornell/%s.brdf", data != NULL ? data : "../shared/data", names[i]);
        run_measured(path);
    }
}

static bool wanted(size_t m, const char *which) {
    if (which == NULL || strcmp(which, "table") == 0) {
        return m < TABLE;
    }
    return strcmp(which, "others") == 0 ? m >= TABLE : (size_t)atol(which) == m;
}

int main(int argc, char **argv) {
    if (argc > 1 && strcmp(argv[1], "measured") == 0) {
        measured(argc - 2, argv + 2);
        return 0;
    }
    const int seeds = argc > 1 ? atoi(argv[1]) : 50;
    const size_t n = argc > 3 ? (size_t)atol(argv[3]) : 300;
    gonio_fit_options o;
    gonio_fit_options_default(&o);
    o.hold_out = 0;
    o.method = argc > 2 ? argv[2] : "auto";
    printf("%d seeds of %zu samples, %s: within 2 sigma, median |error|/sigma, (values)\n", seeds, n, o.method);
    int pairs = 0, good = 0;
    for (size_t m = 0; m < MATERIALS; m++) {
        for (size_t k = 0; k < sizeof noises / sizeof *noises; k++) {
            if (wanted(m, argc > 4 ? argv[4] : NULL) && (argc <= 5 || (size_t)atol(argv[5]) == k)) {
                pairs++;
                good += run_pair(m, k, seeds, n, &o) == 0;
            }
        }
    }
    printf("%d of %d cells outside, %d of them with errors below 1e-4 of the value; %d of %d pairs without any\n",
           outside, cells, exact_cells, good, pairs);
    return 0;
}
