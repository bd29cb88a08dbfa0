// SPDX-License-Identifier: BSD-3-Clause
// Importance sampling, kind by kind: chi-square of a million draws; the relative variance of the albedo's estimate and
// of the light that an environment sends back, beside a cosine, the best mixture of a cosine and a GGX lobe, and a
// piecewise constant density of 64 x 64 cells made for each incidence; what a draw costs in evaluations.
//
// Variances are integrals over the directions, not estimates. Below 1e-4 (1 % noise of a single draw) a variance counts
// as 1e-4. Exit status 1 where what is kept exceeds 1.3 times the better of the lobe and the cells, or where a
// chi-square fails.
#include <stdio.h>
#include <time.h>

#include "brdf/lobe_sampling.h"
#include "tests/conformance/make_kind.h"
#include "tests/sampling_check.h"

#define SIDE 160      // points a way of an integral
#define CELLS 64      // of the piecewise constant density
#define DRAWS 1000000 // of a chi-square
#define DEVIATES 5    // one in 3.6 million by chance
#define LEAST 1e-4
#define INCIDENCES 7
static const double tilts[INCIDENCES] = {4, 17, 33, 48, 62, 74, 83};

enum { COSINE, LOBE, CELL, OWN, TABLE, WAYS };

// One incidence: the directions of the integral, f_r cos(theta_o) there, and each way's density.
typedef struct incidence {
    gonio_vec3 wi;
    gonio_vec3 wo[SIDE * SIDE];
    double weight[SIDE * SIDE], value[SIDE * SIDE], light[SIDE * SIDE], pdf[WAYS][SIDE * SIDE];
} incidence;

static incidence *all; // [INCIDENCES]
static int failures;
static const char *only;

// Shirley and Chiu's map of the disc to the square (1997).
static void square_of(gonio_vec3 w, double *x, double *y) {
    const double r = hypot(w.x, w.y);
    double phi = atan2(w.y, w.x), a, b;
    phi = phi < -GONIO_PI / 4 ? phi + 2 * GONIO_PI : phi;
    const int quarter = (int)((phi + GONIO_PI / 4) / (GONIO_PI / 2)) % 4;
    const double turn = (phi - quarter * GONIO_PI / 2) * r * 4 / GONIO_PI;
    a = quarter == 0 ? r : quarter == 1 ? -turn : quarter == 2 ? -r : turn;
    b = quarter == 0 ? turn : quarter == 1 ? r : quarter == 2 ? -turn : -r;
    *x = (a + 1) / 2;
    *y = (b + 1) / 2;
}

static gonio_vec3 of_square(double x, double y) {
    const double a = 2 * x - 1, b = 2 * y - 1;
    const double r = fabs(a) > fabs(b) ? a : b;
    const double phi = r == 0 ? 0 : fabs(a) > fabs(b) ? GONIO_PI / 4 * b / a : GONIO_PI / 2 - GONIO_PI / 4 * a / b;
    return (gonio_vec3){r * cos(phi), r * sin(phi), sqrt(fmax(1 - r * r, 1e-12))};
}

static double mean_value(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo) {
    double values[GONIO_CHANNELS_MAX], sum = 0;
    gonio_model_eval(model, wi, wo, values);
    for (int c = 0; c < model->channels; c++) {
        sum += fmax(values[c], 0) / model->channels;
    }
    return sum;
}

static void fill_cells(const gonio_model *model, incidence *in) {
    static double cells[CELLS][CELLS];
    double total = 0;
    for (int j = 0; j < CELLS; j++) {
        for (int i = 0; i < CELLS; i++) {
            cells[j][i] = 0;
            for (int k = 0; k < 16; k++) {
                cells[j][i] += mean_value(model, in->wi,
                                          of_square((i + (k % 4 + 0.5) / 4) / CELLS, (j + (k / 4 + 0.5) / 4) / CELLS));
            }
            total += cells[j][i];
        }
    }
    for (int k = 0; k < SIDE * SIDE; k++) {
        double x, y;
        square_of(in->wo[k], &x, &y);
        const int i = (int)fmin(x * CELLS, CELLS - 1), j = (int)fmin(y * CELLS, CELLS - 1);
        in->pdf[CELL][k] = cells[j][i] / total * CELLS * CELLS / GONIO_PI * in->wo[k].z;
    }
}

// A sky with a sun of 15 deg.
static double sky(gonio_vec3 w) {
    const gonio_vec3 sun = gonio_direction(0.7, 2);
    const double c = w.x * sun.x + w.y * sun.y + w.z * sun.z;
    return 0.3 + 0.7 * w.z + 20 * exp((c - 1) / 0.01);
}

static void fill(const gonio_model *model, const gonio_sampler *table, double power) {
    const sampling_source own = {model, NULL}, tabled = {model, table};
    for (int n = 0; n < INCIDENCES; n++) {
        incidence *in = &all[n];
        in->wi = gonio_direction(gonio_radians(tilts[n]), 0.7 + n);
        for (int k = 0; k < SIDE * SIDE; k++) {
            in->wo[k] = sampling_at(in->wi, power, (k % SIDE + 0.5) / SIDE * 2 * GONIO_PI, (k / SIDE + 0.5) / SIDE,
                                    &in->weight[k]);
            in->weight[k] *= 2 * GONIO_PI / SIDE / SIDE / in->wo[k].z;
            in->value[k] = mean_value(model, in->wi, in->wo[k]) * in->wo[k].z;
            in->light[k] = sky(in->wo[k]);
            in->pdf[COSINE][k] = in->wo[k].z / GONIO_PI;
            in->pdf[OWN][k] = sampling_pdf(&own, in->wi, in->wo[k]);
            in->pdf[TABLE][k] = sampling_pdf(&tabled, in->wi, in->wo[k]);
        }
        fill_cells(model, in);
    }
}

// Relative variance of value (lit: times light) over pdf.
static double variance_of(const incidence *in, const double *pdf, bool lit) {
    double total = 0, sum = 0, mass = 0;
    for (int k = 0; k < SIDE * SIDE; k++) {
        total += in->weight[k] * in->value[k] * (lit ? in->light[k] : 1);
        mass += in->weight[k] * pdf[k];
    }
    for (int k = 0; k < SIDE * SIDE; k++) {
        const double p = pdf[k] / mass, g = in->value[k] * (lit ? in->light[k] : 1) / total;
        sum += p > 0 ? in->weight[k] * p * (g / p - 1) * (g / p - 1) : g > 0 ? INFINITY : 0;
    }
    return sum;
}

static double variance(int way, bool lit) {
    double sum = 0;
    for (int n = 0; n < INCIDENCES; n++) {
        sum += variance_of(&all[n], all[n].pdf[way], lit) / INCIDENCES;
    }
    return sum;
}

typedef struct lobe_search {
    bool isotropic;
    double alpha[2], share, variance;
} lobe_search;

static double with_lobe(const double alpha[2], double share, double (*pdf)[SIDE * SIDE]) {
    const gonio_proposal mix[2] = {{GONIO_PROPOSE_COSINE, .strength = 1 - share, .f0 = 1},
                                   {GONIO_PROPOSE_GGX, alpha[0], alpha[1], share, 1}};
    double sum = 0;
    for (int n = 0; n < INCIDENCES; n++) {
        for (int k = 0; k < SIDE * SIDE; k++) {
            pdf[n][k] = gonio_proposals_pdf(mix, 2, all[n].wi, all[n].wo[k]);
        }
        sum += variance_of(&all[n], pdf[n], false) / INCIDENCES;
    }
    return sum;
}

// The widths and the share of least variance, each in turn over a ladder that closes in.
static void best_lobe(const gonio_model *model) {
    static double pdf[INCIDENCES][SIDE * SIDE];
    double best[3] = {0.3, 0.3, 0.5}, least = with_lobe(best, best[2], pdf);
    for (int round = 0; round < 3; round++) {
        for (int p = model->isotropic ? 1 : 0; p < 3; p++) {
            const double centre[3] = {best[0], best[1], best[2]};
            for (int k = -4; k <= 4; k++) {
                double tried[3] = {centre[0], centre[1], centre[2]};
                tried[p] = p < 2 ? centre[p] * pow(round == 0   ? 2.5
                                                   : round == 1 ? 1.3
                                                                : 1.06,
                                                   k)
                                 : fmin(fmax(centre[2] + k * (round == 0   ? 0.12
                                                              : round == 1 ? 0.03
                                                                           : 0.01),
                                             0),
                                        1);
                tried[0] = model->isotropic ? tried[1] : tried[0];
                const double v = with_lobe(tried, tried[2], pdf);
                if (v < least) {
                    least = v;
                    memcpy(best, tried, sizeof best);
                }
            }
        }
    }
    with_lobe(best, best[2], pdf);
    for (int n = 0; n < INCIDENCES; n++) {
        memcpy(all[n].pdf[LOBE], pdf[n], sizeof pdf[n]);
    }
}

static volatile double sink;

static double processor_seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

// ns of an evaluation, and of a draw with its evaluation.
static void costs(const gonio_model *model, double *evaluation, double *drawing) {
    enum { N = 20000, ROUNDS = 5 };
    static gonio_vec3 wi[N], wo[N];
    static double u[N][2];
    uint64_t seed = 1;
    double values[GONIO_CHANNELS_MAX];
    for (int k = 0; k < N; k++) {
        wi[k] = gonio_direction(acos(gonio_random_next(&seed)), 2 * GONIO_PI * gonio_random_next(&seed));
        u[k][0] = gonio_random_next(&seed);
        u[k][1] = gonio_random_next(&seed);
        gonio_model_sample(model, wi[k], u[k], &wo[k], NULL);
    }
    *evaluation = *drawing = INFINITY;
    for (int r = 0; r < ROUNDS; r++) {
        double begin = processor_seconds();
        for (int k = 0; k < N; k++) {
            gonio_model_eval(model, wi[k], wo[k], values);
            sink = values[0];
        }
        *evaluation = fmin(*evaluation, (processor_seconds() - begin) / N * 1e9);
        begin = processor_seconds();
        for (int k = 0; k < N; k++) {
            gonio_vec3 w;
            sink = gonio_model_sample(model, wi[k], u[k], &w, values) + values[0];
        }
        *drawing = fmin(*drawing, (processor_seconds() - begin) / N * 1e9);
    }
}

static double worst_deviate(const gonio_model *model, const gonio_sampler *table, double power) {
    static double expected[SAMPLING_CELLS];
    double worst = -INFINITY;
    for (int k = 0; k < 2; k++) {
        const sampling_source s = {model, k ? table : NULL};
        const gonio_vec3 wi = gonio_direction(gonio_radians(k ? 52 : 68), 1);
        sampling_expect(&s, wi, power, 64, expected);
        worst = fmax(worst, sampling_chi_square(&s, wi, power, DRAWS, 9, expected));
    }
    return worst;
}

static void by_incidence(void) {
    for (int n = 0; n < INCIDENCES; n++) {
        printf("  %2.0f deg", tilts[n]);
        for (int w = 0; w < WAYS; w++) {
            printf(" %8.2g", variance_of(&all[n], all[n].pdf[w], false));
        }
        printf("\n");
    }
}

// The table that is kept, which may be a finer one; the model stays without. NULL: the lobes are.
static gonio_sampler *kept_of(gonio_model *model) {
    gonio_error error = {0};
    if (gonio_model_prepare_sampling(model, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    gonio_sampler *kept = model->sampler;
    model->sampler = NULL;
    return kept;
}

static void compare(const char *name, gonio_model *model, double power) {
    if (only != NULL && strstr(name, only) == NULL) {
        return;
    }
    gonio_error error = {0};
    gonio_sampler *table;
    const gonio_sampler_size size = gonio_sampler_standard(model);
    const double begin = processor_seconds();
    if (gonio_sampler_new(model, &size, &table, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    const double seconds = processor_seconds() - begin;
    gonio_sampler *kept_table = kept_of(model);
    fill(model, kept_table != NULL ? kept_table : table, power);
    best_lobe(model);
    double v[WAYS], lit[WAYS], evaluation, drawing, own_evaluation, own;
    for (int w = 0; w < WAYS; w++) {
        v[w] = variance(w, false);
        lit[w] = variance(w, true);
    }
    const double deviate = worst_deviate(model, kept_table != NULL ? kept_table : table, power);
    costs(model, &own_evaluation, &own);
    model->sampler = kept_table;
    costs(model, &evaluation, &drawing);
    const double kept = model->sampler != NULL ? v[TABLE] : v[OWN];
    const double ratio = fmax(kept, LEAST) / fmax(fmin(v[LOBE], v[CELL]), LEAST);
    const bool fails = ratio > 1.3 || deviate > DEVIATES;
    failures += fails;
    printf(
        "%-44s %8.2g %8.2g %8.2g %8.2g %8.2g %-5s %5.2f | %7.2g %7.2g %7.2g | %5.1f %5.0f %4.0f %4.0f %5.0f %6.2f%s\n",
        name, v[COSINE], v[LOBE], v[CELL], v[OWN], v[TABLE], model->sampler != NULL ? "table" : "lobes", ratio,
        lit[COSINE], lit[LOBE], fmin(lit[TABLE], lit[OWN]), deviate, own, drawing, evaluation, seconds * 1e3,
        (double)gonio_sampler_bytes(kept_table != NULL ? kept_table : table) / 1e6, fails ? " FAILS" : "");
    fflush(stdout);
    if (only != NULL) {
        by_incidence();
    }
    gonio_sampler_free(table);
}

static const struct {
    const char *spec;
    double power;
} specs[] = {
    {"ward:rho_d=0.3,rho_s=0.2,alpha=0.15", 2},
    {"ggx:rho_d=0.2,rho_s=1,alpha=0.05,f0=0.04", 4},
    {"ggx:rho_s=1,alpha=0.005,f0=0.6", 7},
    {"ggx:rho_d=0.5,rho_s=1,alpha_x=0.15,alpha_y=0.4,f0=0.04", 2},
    {"blinn-phong:rho_d=0.1,rho_s=0.5,n=2000", 3},
    {"cook-torrance:rho_d=0.1,rho_s=1,m=0.1,f0=0.1+cook-torrance:rho_s=0.2,m=0.4", 2.5},
};

// argv[1]: only what has this in its name, each incidence by itself.
int main(int argc, char **argv) {
    only = argc > 1 ? argv[1] : NULL;
    all = malloc(INCIDENCES * sizeof *all);
    if (all == NULL) {
        return 1;
    }
    printf("%-44s %8s %8s %8s %8s %8s %-5s %5s | %7s %7s %7s | %5s %5s %4s %4s %5s %6s\n", "relative variance",
           "cosine", "GGX", "64x64", "lobes", "table", "kept", "ratio", "lit:cos", "GGX", "best", "chi2", "lobes", "ns",
           "eval", "ms", "MB");
    kind_maker maker;
    for (size_t k = 0; kind_maker_at(k, &maker); k++) {
        for (int isotropic = maker.isotropic_only ? 1 : 0; isotropic < 2; isotropic++) {
            char name[128];
            snprintf(name, sizeof name, "%s (%s)%s", maker.kind, maker.form, isotropic ? "" : ", anisotropic");
            gonio_model *model = kind_make(&maker, isotropic != 0, 1);
            compare(name, model, 1.5);
            gonio_model_free(model);
        }
    }
    for (size_t k = 0; k < sizeof specs / sizeof *specs; k++) {
        gonio_model *model = simulate_truth(specs[k].spec);
        compare(specs[k].spec, model, specs[k].power);
        gonio_model_free(model);
    }
    free(all);
    printf("%d failures\n", failures);
    return failures > 0;
}
