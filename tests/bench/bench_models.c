// SPDX-License-Identifier: BSD-3-Clause
// What an evaluation costs, kind by kind, against the dense lattice of the same level, coordinates and domain in the
// same run: cbmba, the automatic choice, and lobe-splines of every base. The runs of all models take turns; a figure is
// the median of the ratios of neighbouring runs.
#include <string.h>

#include "base/clock.h"
#include "brdf/kind/lattice.h"
#include "brdf/kind/lobe_spline.h"
#include "gonio/fit.h"
#include "tests/unit/lobe_models.h"

#define LEVEL 5
#define QUERIES 20000
#define ROUNDS 15
#define MODELS_MAX 10

enum { SINGLE_F32, SINGLE, BATCHED, SORTED, WAYS };
static const double wanted[WAYS] = {2, 2, 1.6, 1.6};

typedef struct entrant {
    const char *name;
    gonio_model *model;
    double seconds[WAYS][ROUNDS];
} entrant;

typedef struct queries {
    gonio_vec3 wi[QUERIES], wo[QUERIES], sorted_i[QUERIES], sorted_o[QUERIES];
} queries;

static int failures;
static volatile double sink;

static void check(gonio_status status, const gonio_error *error) {
    if (status != GONIO_OK) {
        fprintf(stderr, "%s\n", error->message);
        exit(1);
    }
}

static gonio_model *fitted(const char *method, size_t n, int channels) {
    gonio_samples *samples = simulate_samples("ward:rho_d=0.3,rho_s=0.2,alpha=0.15", n, channels, 1);
    gonio_fit_options o;
    gonio_model *model;
    gonio_error error = {0};
    gonio_fit_options_default(&o);
    o.method = method;
    o.level = LEVEL;
    o.coordinates = GONIO_HALF_VECTOR;
    o.domain = GONIO_LOG;
    o.hold_out = 0;
    check(gonio_fit(samples, &o, &model, NULL, &error), &error);
    gonio_samples_free(samples);
    return model;
}

static void *copied(const void *from, size_t size) {
    void *to = malloc(size);
    if (to == NULL) {
        abort();
    }
    return memcpy(to, from, size);
}

typedef struct base_form {
    const char *name;
    int lobes;
    gonio_lobe_family family;
    bool terms; // profile and shares
} base_form;

// A lobe-spline on the dense model's lattice, scaled down so that its sum with the base stays in range.
static gonio_model *assembled(const gonio_model *dense, const base_form *form) {
    const size_t c = (size_t)dense->channels;
    gonio_lobe_spline_parts p = {.channels = dense->channels,
                                 .dims = 3,
                                 .coordinates = GONIO_HALF_VECTOR,
                                 .kind = GONIO_TRANSFORM_POSITIVE,
                                 .channel_names = dense->channel_names};
    gonio_error error = {0};
    gonio_model *model;
    p.lattice = *gonio_lattice_model_lattice(dense);
    p.lattice.points = copied(p.lattice.points, p.lattice.count * c * sizeof(float));
    p.transforms = malloc(c * sizeof *p.transforms);
    p.base = (gonio_lobe_base){
        .lobes = form->lobes, .family = form->family, .alpha = {0.15, 0.4}, .f0 = {0.05, 0.3}, .cosine_min = 0.09F};
    p.base.strength = malloc(c * 3 * sizeof(double));
    p.range = malloc(c * 2 * sizeof(double));
    p.shares = form->terms ? malloc(c * 3 * sizeof(double)) : NULL;
    for (size_t k = 0; k < c; k++) {
        p.transforms[k] = (gonio_transform){4, 1e-4};
        p.range[2 * k] = -8;
        p.range[2 * k + 1] = 3;
        for (size_t j = 0; j < 3; j++) {
            p.base.strength[3 * k + j] = 0.1 * (1 + 0.01 * (double)k);
            if (form->terms) {
                p.shares[3 * k + j] = 0.1;
            }
        }
    }
    if (form->terms) {
        check(gonio_lattice_init(&p.profile, 2, 4, dense->channels, &error), &error);
        for (size_t k = 0; k < p.profile.count * c; k++) {
            p.profile.points[k] = 0.1F * (float)sin((double)k);
        }
    }
    check(gonio_lobe_spline_new(&p, &model, &error), &error);
    return model;
}

static int by_place(const void *left, const void *right) {
    const double *a = left, *b = right;
    for (int d = 0; d < 3; d++) {
        const int m = (int)(a[d] * 32), n = (int)(b[d] * 32);
        if (m != n) {
            return m < n ? -1 : 1;
        }
    }
    return 0;
}

static queries *make_queries(void) {
    queries *q = malloc(sizeof *q);
    double(*order)[4] = malloc(QUERIES * sizeof *order);
    uint64_t seed = 77;
    for (size_t i = 0; i < QUERIES; i++) {
        const gonio_pair pair = simulate_pair(&seed, 1);
        q->wi[i] = gonio_direction(pair.theta_i, pair.phi_i);
        q->wo[i] = gonio_direction(pair.theta_o, pair.phi_o);
        gonio_coordinates_isotropic(GONIO_HALF_VECTOR, q->wi[i], q->wo[i], order[i]);
        order[i][3] = (double)i;
    }
    qsort(order, QUERIES, sizeof *order, by_place);
    for (size_t i = 0; i < QUERIES; i++) {
        q->sorted_i[i] = q->wi[(size_t)order[i][3]];
        q->sorted_o[i] = q->wo[(size_t)order[i][3]];
    }
    free(order);
    return q;
}

static double time_way(const gonio_model *m, const queries *q, int way, double *values) {
    float narrow[GONIO_CHANNELS_MAX];
    double sum = 0;
    const double start = gonio_clock_s();
    if (way == BATCHED) {
        gonio_model_eval_many(m, QUERIES, q->wi, q->wo, values);
    } else if (way == SORTED) {
        gonio_model_eval_many(m, QUERIES, q->sorted_i, q->sorted_o, values);
    }
    for (size_t i = 0; i < QUERIES && way == SINGLE; i++) {
        gonio_model_eval(m, q->wi[i], q->wo[i], values);
        sum += values[0];
    }
    for (size_t i = 0; i < QUERIES && way == SINGLE_F32; i++) {
        gonio_model_eval_f32(m, q->wi[i], q->wo[i], narrow);
        sum += (double)narrow[0];
    }
    sink = sum;
    return gonio_clock_s() - start;
}

// One by one, batched and in float it is the same function, and the plain formula's.
static void verify(const entrant *e, const queries *q) {
    const gonio_lobe_spline_parts *p = gonio_lobe_spline_about(e->model);
    const size_t c = (size_t)e->model->channels;
    double one[GONIO_CHANNELS_MAX], *all = malloc(QUERIES * c * sizeof *all);
    float narrow[GONIO_CHANNELS_MAX];
    gonio_model_eval_many(e->model, QUERIES, q->wi, q->wo, all);
    for (size_t i = 0; i < QUERIES; i += 7) {
        gonio_model_eval(e->model, q->wi[i], q->wo[i], one);
        gonio_model_eval_f32(e->model, q->wi[i], q->wo[i], narrow);
        for (size_t k = 0; k < c; k++) {
            const double plain = p != NULL ? lobe_plain_value(p, q->wi[i], q->wo[i], (int)k) : one[k];
            if (one[k] != all[i * c + k] || fabs((double)narrow[k] - one[k]) > 1e-6 * fabs(one[k]) ||
                !(fabs(plain - one[k]) <= 1e-10 * fabs(one[k]))) {
                printf("  %s: evaluations differ at query %zu, channel %zu\n", e->name, i, k);
                failures++;
                free(all);
                return;
            }
        }
    }
    free(all);
}

static int by_value(const void *left, const void *right) {
    const double a = *(const double *)left, b = *(const double *)right;
    return (a > b) - (a < b);
}

static double median(const double *values) {
    double sorted[ROUNDS];
    memcpy(sorted, values, sizeof sorted);
    qsort(sorted, ROUNDS, sizeof *sorted, by_value);
    return sorted[ROUNDS / 2];
}

static void report(const entrant *e, const entrant *dense, bool bound) {
    printf("  %-34s", e->name);
    for (int w = 0; w < WAYS; w++) {
        double ratio[ROUNDS];
        for (int r = 0; r < ROUNDS; r++) {
            ratio[r] = e->seconds[w][r] / dense->seconds[w][r];
        }
        const bool missed = bound && median(ratio) > wanted[w];
        printf("  %7.1f ns %5.2f%s", 1e9 * median(e->seconds[w]) / QUERIES, median(ratio), missed ? " MISSED" : "");
        failures += missed;
    }
    printf("\n");
}

static void bench(int channels, const queries *q) {
    static const base_form forms[] = {{"spline alone", 0, GONIO_LOBE_COOK_TORRANCE, false},
                                      {"1 Cook-Torrance", 1, GONIO_LOBE_COOK_TORRANCE, false},
                                      {"2 Cook-Torrance", 2, GONIO_LOBE_COOK_TORRANCE, false},
                                      {"2 GGX", 2, GONIO_LOBE_GGX, false},
                                      {"2 Cook-Torrance, profile, shares", 2, GONIO_LOBE_COOK_TORRANCE, true}};
    entrant e[MODELS_MAX] = {{.name = "mba", .model = fitted("mba", 1400, channels)},
                             {.name = "cbmba", .model = fitted("cbmba", 1400, channels)},
                             {.name = "auto", .model = fitted("auto", 150, channels)}};
    size_t n = 3;
    for (size_t k = 0; k < sizeof forms / sizeof *forms; k++) {
        e[n++] = (entrant){.name = forms[k].name, .model = assembled(e[0].model, &forms[k])};
    }
    double *values = malloc(QUERIES * (size_t)channels * sizeof *values);
    memset(values, 0, QUERIES * (size_t)channels * sizeof *values);
    for (int r = 0; r < ROUNDS; r++) {
        for (int w = 0; w < WAYS; w++) {
            for (size_t k = 0; k < n; k++) {
                e[k].seconds[w][r] = time_way(e[k].model, q, w, values);
            }
        }
    }
    printf(
        "%d channels, level %d; ns an evaluation of all, times dense: one in float (<= %.3g), one in double (<= %.3g), "
        "batched (<= %.3g), batched and sorted (<= %.3g)\n",
        channels, LEVEL, wanted[0], wanted[1], wanted[2], wanted[3]);
    for (size_t k = 0; k < n; k++) {
        verify(&e[k], q);
        report(&e[k], &e[0], k >= 2);
    }
    for (size_t k = 0; k < n; k++) {
        gonio_model_free(e[k].model);
    }
    free(values);
}

// Arguments: numbers of channels, instead of 1, 3 and 31.
int main(int argc, char **argv) {
    queries *q = make_queries();
    for (int k = 1; k < argc; k++) {
        bench(atoi(argv[k]), q);
    }
    if (argc == 1) {
        bench(1, q);
        bench(3, q);
        bench(31, q);
    }
    free(q);
    printf("%d figures missed\n", failures);
    return 0;
}
