// SPDX-License-Identifier: BSD-3-Clause
// Regret of `--method auto`: its error at directions that no fit saw, over that of the best row of the trade-off
// (fit/tradeoff.h) on the same samples, for median_rel and for rms_log, each with the row that is best by it.
//
// Simulated sets are judged at 20,000 fresh directions; formulae do not count there, since one of them may be the truth
// itself. Measured sets are judged at what 5 folds leave out, over 3 seeds: the best row is chosen on one half of the
// geometries left out and scored on the other, either way.
//
// usage: regret [--full] [NAME ...]      a few small sets; --full: all of them; a name: those whose name holds it
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/order_statistic.h"
#include "fit/tradeoff.h"
#include "gonio/io.h"
#include "tests/sigma_regions.h"

#define WARD "ward:rho_d=0.3,rho_s=0.2,alpha=0.2"
#define SHARP "ggx:rho_d=0.2,rho_s=0.5,alpha=0.08,f0=0.05"
#define METAL "cook-torrance:rho_d=0.05,rho_s=0.8,alpha=0.25,f0=0.7"
#define ROUGH "oren-nayar:rho=0.6,sigma_deg=25"
#define TWO "lambert:rho=0.2+ggx:rho_s=0.3,alpha=0.12,f0=0.05+ggx:rho_s=0.3,alpha=0.4,f0=0.05"
#define PHONG "blinn-phong:rho_d=0.2,rho_s=0.3,n=40"

static const struct set {
    const char *name, *source; // a SPEC, or a file under GONIO_DATA
    size_t n;                  // 0: as many as the file has
    double noise;              // relative
    bool small, mean;          // of the short list; the mean of the file's channels
} sets[] = {
    {"ward 300", WARD, 300, 0, true, false},
    {"ward 100, 1 %", WARD, 100, .01, true, false},
    {"ward 1000", WARD, 1000, 0, false, false},
    {"ward 14000", WARD, 14000, 0, false, false},
    {"sharp 300, 1 %", SHARP, 300, .01, true, false},
    {"sharp 300", SHARP, 300, 0, true, false},
    {"sharp 1000", SHARP, 1000, 0, false, false},
    {"sharp 14000, 1 %", SHARP, 14000, .01, false, false},
    {"metal 100", METAL, 100, 0, true, false},
    {"metal 300, 1 %", METAL, 300, .01, false, false},
    {"metal 1000, 1 %", METAL, 1000, .01, false, false},
    {"rough 100", ROUGH, 100, 0, true, false},
    {"rough 300, 1 %", ROUGH, 300, .01, false, false},
    {"rough 1000, 1 %", ROUGH, 1000, .01, false, false},
    {"two 300", TWO, 300, 0, true, false},
    {"two 300, 1 %", TWO, 300, .01, false, false},
    {"two 1000", TWO, 1000, 0, false, false},
    {"phong 300", PHONG, 300, 0, true, false},
    {"phong 300, 1 %", PHONG, 300, .01, false, false},
    {"phong 1000", PHONG, 1000, 0, false, false},
    {"garnet_red mean", "cornell/garnet_red.brdf", 0, 0, false, true},
    {"acryl_blue mean", "cornell/acryl_blue.brdf", 0, 0, false, true},
    {"mystique mean", "cornell/mystique.brdf", 0, 0, false, true},
    {"vch_silk_blue", "rgl/vch_silk_blue_rgb.bsdf", 700, 0, false, true},
    {"aurora_white", "rgl/aurora_white_rgb.bsdf", 700, 0, false, true},
    {"chm_orange", "rgl/chm_orange_rgb.bsdf", 700, 0, false, true},
};
#define SETS (sizeof sets / sizeof *sets)

enum { MEDIAN, TAIL, FIGURES };
static const char *const figure_names[FIGURES] = {"median_rel", "rms_log"};
#define FOLDS 5
#define SEEDS 3
#define FRESH 20000
#define THETA_MAX (80 * GONIO_PI / 180)
#define FORMS_MAX 256

// Uniform in solid angle up to 80 deg.
static gonio_pair pair_at(uint64_t *state) {
    const double below = 1 - cos(THETA_MAX);
    const double a = simulate_uniform(state), b = simulate_uniform(state), c = simulate_uniform(state);
    return (gonio_pair){acos(1 - a * below), 0, acos(1 - b * below), 2 * GONIO_PI * c};
}

static gonio_samples *samples_of(const gonio_model *truth, size_t n, double noise, bool mean, uint64_t state) {
    gonio_samples *samples;
    gonio_error error = {0};
    double value[GONIO_CHANNELS_MAX];
    if (gonio_samples_new(1, false, &samples, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    samples->isotropic = true;
    for (size_t i = 0; i < n; i++) {
        const gonio_pair pair = pair_at(&state);
        double sum = 0;
        gonio_model_eval_pair(truth, &pair, value);
        for (int c = 0; c < (mean ? truth->channels : 1); c++) {
            sum += fmax(value[c], 0) / (mean ? truth->channels : 1);
        }
        sum *= 1 + (noise > 0 ? noise * sigma_normal(&state) : 0);
        if (gonio_samples_add(samples, &pair, &sum, NULL, NULL, &error) != GONIO_OK) {
            simulate_die(&error);
        }
    }
    return samples;
}

// The samples i with keep(i) == wanted: of a fold, or of the half of it.
static gonio_samples *part_of(const gonio_samples *all, int seed, int fold, int half) {
    gonio_samples *part;
    gonio_error error = {0};
    if (gonio_samples_new(1, false, &part, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    part->isotropic = all->isotropic;
    for (size_t i = 0; i < all->n; i++) {
        const uint64_t number = gonio_random((uint64_t)seed << 32 | i);
        const bool held = (int)(number % FOLDS) == fold, inside = half < 0 ? !held : held;
        const bool wanted = inside && (half < 0 || (int)(number / FOLDS % 2) == half);
        if (wanted && gonio_samples_add(part, &all->pairs[i], &all->values[i * (size_t)all->channels], NULL, NULL,
                                        &error) != GONIO_OK) {
            simulate_die(&error);
        }
    }
    return part;
}

// NULL where the file is not there.
static gonio_samples *load(const struct set *s) {
    const char *data = getenv("GONIO_DATA");
    char path[512];
    struct stat info;
    gonio_error error = {0};
    gonio_samples *samples;
    snprintf(path, sizeof path, "%s/%s", data != NULL ? data : "../shared/data", s->source);
    if (stat(path, &info) != 0) {
        return NULL;
    }
    if (s->n > 0) {
        gonio_model *table;
        if (gonio_read_table(path, &table, &error) != GONIO_OK) {
            simulate_die(&error);
        }
        samples = samples_of(table, s->n, 0, s->mean, 1);
        gonio_model_free(table);
        return samples;
    }
    gonio_read_options o;
    gonio_read_options_default(&o);
    if (gonio_read(path, &o, &samples, NULL, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    return simulate_channel_mean(samples);
}

// Sums over fits of a row's errors on both halves of what it did not see.
typedef struct tally {
    double sum[2][FIGURES];
    bool failed;
} tally;

static void judge(const gonio_samples *train, gonio_samples *const held[2], const gonio_tradeoff_form *form, tally *t) {
    gonio_fit_options o;
    gonio_model *model;
    gonio_error error = {0};
    gonio_fit_options_default(&o);
    o.hold_out = 0;
    o.method = form->method;
    o.level = form->level;
    o.coordinates = form->coordinates;
    o.domain = form->domain;
    if (t->failed || gonio_fit(train, &o, &model, NULL, &error) != GONIO_OK) {
        t->failed = true; // too few samples for it, as the trade-off says too
        return;
    }
    for (int half = 0; half < 2; half++) {
        gonio_errors e;
        if (gonio_errors_model(model, held[half], NULL, 0, &e, &error) != GONIO_OK) {
            simulate_die(&error);
        }
        t->sum[half][MEDIAN] += e.median_rel;
        t->sum[half][TAIL] += e.rms_log * e.rms_log;
    }
    gonio_model_free(model);
}

static void judge_all(const gonio_samples *train, gonio_samples *const held[2], bool formulae,
                      const gonio_tradeoff_form *forms, size_t n, tally *tallies) {
    static const char *const splines[] = {"mba", "cbmba", "lsq", "auto"};
    for (size_t f = 0; f < n; f++) {
        bool counts = formulae;
        for (size_t k = 0; k < sizeof splines / sizeof *splines; k++) {
            counts = counts || strcmp(forms[f].method, splines[k]) == 0;
        }
        tallies[f].failed = tallies[f].failed || !counts;
        judge(train, held, &forms[f], &tallies[f]);
    }
}

typedef struct regrets {
    double ratio[FIGURES][SETS];
    size_t n;
} regrets;

// fits: the number of fits that the sums are over.
static void print_set(const char *name, const gonio_tradeoff_form *forms, size_t n, const tally *tallies, double fits,
                      regrets *r) {
    size_t own = 0;
    while (own < n && strcmp(forms[own].method, "auto") != 0) {
        own++;
    }
    printf("%-18s", name);
    for (int figure = 0; figure < FIGURES; figure++) {
        double mine = 0, best = 0;
        size_t chosen = own;
        for (int half = 0; half < 2; half++) {
            size_t least = own;
            for (size_t f = 0; f < n; f++) {
                if (!tallies[f].failed && tallies[f].sum[half][figure] < tallies[least].sum[half][figure]) {
                    least = f;
                }
            }
            mine += tallies[own].sum[1 - half][figure] / (2 * fits);
            best += tallies[least].sum[1 - half][figure] / (2 * fits);
            chosen = least;
        }
        mine = figure == TAIL ? sqrt(mine) : mine;
        best = figure == TAIL ? sqrt(best) : best;
        r->ratio[figure][r->n] = mine / best;
        const gonio_tradeoff_form *b = &forms[chosen];
        printf("  %.4g %.4g %5.2f (%s %d %s %s)", mine, best, mine / best, b->method, b->level,
               b->coordinates < 0 ? "auto" : gonio_coordinates_name(b->coordinates),
               b->domain == GONIO_LINEAR ? "linear"
               : b->domain == GONIO_LOG  ? "log"
                                         : "auto");
    }
    r->n++;
    printf("\n");
    fflush(stdout);
}

static void run(const struct set *s, regrets *r) {
    gonio_tradeoff_form forms[FORMS_MAX];
    tally tallies[FORMS_MAX] = {{.failed = false}};
    const size_t n = gonio_tradeoff_forms(forms, FORMS_MAX);
    if (strchr(s->source, '/') == NULL) {
        gonio_model *truth = simulate_truth(s->source);
        gonio_samples *train = samples_of(truth, s->n, s->noise, false, 1);
        gonio_samples *held[2] = {samples_of(truth, FRESH, 0, false, 777), samples_of(truth, FRESH, 0, false, 778)};
        judge_all(train, held, false, forms, n, tallies);
        print_set(s->name, forms, n, tallies, 1, r);
        gonio_samples_free(held[0]);
        gonio_samples_free(held[1]);
        gonio_samples_free(train);
        gonio_model_free(truth);
        return;
    }
    gonio_samples *all = load(s);
    if (all == NULL) {
        printf("%-18s SKIP: no %s\n", s->name, s->source);
        return;
    }
    for (int k = 0; k < SEEDS * FOLDS; k++) {
        const int seed = 1 + k / FOLDS, fold = k % FOLDS;
        gonio_samples *train = part_of(all, seed, fold, -1);
        gonio_samples *held[2] = {part_of(all, seed, fold, 0), part_of(all, seed, fold, 1)};
        judge_all(train, held, true, forms, n, tallies);
        gonio_samples_free(held[0]);
        gonio_samples_free(held[1]);
        gonio_samples_free(train);
    }
    print_set(s->name, forms, n, tallies, SEEDS * FOLDS, r);
    gonio_samples_free(all);
}

int main(int argc, char **argv) {
    const bool full = argc > 1 && strcmp(argv[1], "--full") == 0;
    regrets r = {.n = 0};
    printf("%-18s  error of auto, of the best row, their ratio and that row; for %s and %s\n", "", figure_names[MEDIAN],
           figure_names[TAIL]);
    for (size_t s = 0; s < SETS; s++) {
        bool named = false;
        for (int a = 1 + full; a < argc; a++) {
            named = named || strstr(sets[s].name, argv[a]) != NULL;
        }
        if (named || (argc == 1 + full && (full || sets[s].small))) {
            run(&sets[s], &r);
        }
    }
    for (int figure = 0; figure < FIGURES && r.n > 0; figure++) {
        const double middle = gonio_order_statistic(r.ratio[figure], r.n, r.n / 2);
        const double most = gonio_order_statistic(r.ratio[figure], r.n, r.n - 1);
        printf("%s: median regret %.3f, largest %.2f (asked 1.05, 1.5)\n", figure_names[figure], middle, most);
    }
    return 0;
}
