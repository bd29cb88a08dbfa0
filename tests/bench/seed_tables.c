// SPDX-License-Identifier: BSD-3-Clause
// The figures that Kameya (2002) and Park and Lee (2015) report, beside ours: docs/seed-tables.md, as `make
// seed-tables` writes it. Methods are looked up by name, so that a row fills itself once there is one.
//
// None of the texts' data is public. Their materials are stood for by simulated ones of the same character (below), of
// 1,400 random directions, so a ratio to a published error says how alike the materials are as much
// as how good the method is; what can be held against the texts is the order of their methods, and every figure that
// follows from counts alone.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "brdf/kind/lattice.h"
#include "brdf/spline/lattice_eval.h"
#include "fit/bvb/bvb.h"
#include "fit/bvb/table.h"
#include "fit/mba/mba.h"
#include "fit/options.h"
#include "tests/bench/dropped.h"
#include "tests/simulate.h"

static void check(gonio_status status, const gonio_error *error) {
    if (status != GONIO_OK) {
        fprintf(stderr, "%s\n", error->message);
        exit(1);
    }
}

enum { MATERIALS = 4, LEVELS = 7 };

// What stands for the thesis' felt, leather, aluminium foil and latex blue.
static const char *const names[MATERIALS] = {"felt", "leather", "aluminium", "latex blue"};
static const char *const specs[MATERIALS] = {"oren-nayar:rho=0.25,sigma_deg=30", "ward:rho_d=0.08,rho_s=0.06,alpha=0.2",
                                             "ward:rho_d=0.05,rho_s=0.6,alpha=0.1",
                                             "ward:rho_d=0.1,rho_s=0.05,alpha=0.03"};

typedef struct published {
    double rmse, mae, mre;
    const char *typo; // what the text prints, where that cannot be
} published;

// Tables B.1 and B.2: levels 0 to 6, Lafortune with 3 lobes, Koenderink to order 8.
static const published table_b[MATERIALS][LEVELS + 2] = {{{.123, .751, .751, NULL},
                                                          {.098, .677, .677, "MAE .902, above felt's largest value 1"},
                                                          {.072, .491, .493, NULL},
                                                          {.044, .268, .269, NULL},
                                                          {.019, .109, .110, NULL},
                                                          {.004, .035, .035, NULL},
                                                          {.001, .006, .006, "MAE .060; tables C say .006"},
                                                          {.024, .098, .098, "RMSE .020 in table C.2"},
                                                          {.011, .070, .070, NULL}},
                                                         {{.140, 1.184, .828, NULL},
                                                          {.125, 1.132, .791, NULL},
                                                          {.105, .947, .662, NULL},
                                                          {.074, .675, .471, NULL},
                                                          {.041, .418, .292, NULL},
                                                          {.015, .140, .098, NULL},
                                                          {.001, .009, .006, NULL},
                                                          {.099, .842, .589, NULL},
                                                          {.040, .384, .268, NULL}},
                                                         {{.171, 1.146, .785, NULL},
                                                          {.124, 1.006, .688, NULL},
                                                          {.084, .782, .535, NULL},
                                                          {.055, .545, .373, NULL},
                                                          {.027, .277, .190, NULL},
                                                          {.007, .063, .043, NULL},
                                                          {.001, .013, .009, NULL},
                                                          {.127, .716, .490, NULL},
                                                          {.036, .264, .181, NULL}},
                                                         {{.184, 5.554, .970, NULL},
                                                          {.180, 5.518, .964, NULL},
                                                          {.172, 5.316, .929, NULL},
                                                          {.154, 4.699, .821, NULL},
                                                          {.113, 3.340, .583, NULL},
                                                          {.076, 1.728, .302, "MRE .583; 1.728 of 5.726 is .302"},
                                                          {.029, .595, .104, NULL},
                                                          {.128, 4.016, .701, NULL},
                                                          {.125, 2.905, .507, NULL}}};

static gonio_samples *sets[MATERIALS];

// A fit in the thesis' form; false where there is no such method.
static bool fitted(const gonio_samples *samples, gonio_fit_options *o, const char *method, gonio_model **model,
                   gonio_fit_report *report) {
    const char *name = method;
    gonio_error error = {0};
    if (gonio_method_find(&name) == NULL) {
        return false;
    }
    o->thesis = true;
    o->threads = 1;
    gonio_fit_options_for(o, method);
    check(gonio_fit(samples, o, model, report, &error), &error);
    return true;
}

static gonio_fit_options usual(void) {
    gonio_fit_options o;
    gonio_fit_options_default(&o);
    return o;
}

// ---- tables B ----

static bool fit_column(int material, int column, gonio_model **model, gonio_fit_report *report) {
    gonio_fit_options o = usual();
    o.level = column < LEVELS ? column : GONIO_LEVEL_AUTO;
    o.lobes = column == LEVELS ? 3 : GONIO_LOBES_AUTO;
    o.order = column == LEVELS + 1 ? 8 : GONIO_ORDER_AUTO;
    const char *method = column < LEVELS ? "mba" : column == LEVELS ? "lafortune" : "koenderink";
    return fitted(sets[material], &o, method, model, report);
}

static const char *column_name(int column) {
    static const char *const all[] = {"level 0", "level 1", "level 2",      "level 3",      "level 4",
                                      "level 5", "level 6", "Lafortune(3)", "Koenderink(8)"};
    return all[column];
}

static void table_errors(void) {
    printf("\n## Kameya, tables B.1 and B.2 (figure 5.1)\n\nTraining errors: published, ours, ratio. MRE is MAE over "
           "the largest "
           "value. *: corrected, the table prints something else (below).\n\n| stands for | fit | RMSE | MAE | MRE | "
           "median_rel | "
           "held-out RMSE | held-out median_rel |\n|---|---|---|---|---|---|---|---|\n");
    double held[MATERIALS][LEVELS + 2];
    for (int m = 0; m < MATERIALS; m++) {
        for (int k = 0; k < LEVELS + 2; k++) {
            gonio_model *model;
            gonio_fit_report r;
            const published *p = &table_b[m][k];
            const bool there = fit_column(m, k, &model, &r);
            held[m][k] = there ? r.held_out.rmse : NAN;
            if (!there) {
                printf("| %s | %s | %.3f | %.3f | %.3f | | | |\n", names[m], column_name(k), p->rmse, p->mae, p->mre);
                continue;
            }
            const gonio_errors *e = &r.train;
            printf("| %s | %s%s | %.3f, %.4f, %.2f | %.3f, %.4f, %.2f | %.3f, %.4f, %.2f | %.4f | %.4f | %.4f |\n",
                   names[m], column_name(k), p->typo != NULL ? "*" : "", p->rmse, e->rmse, e->rmse / p->rmse, p->mae,
                   e->max_abs, e->max_abs / p->mae, p->mre, e->max_rel, e->max_rel / p->mre, e->median_rel,
                   r.held_out.rmse, r.held_out.median_rel);
            gonio_model_free(model);
        }
    }
    printf("\n");
    for (int m = 0; m < MATERIALS; m++) {
        for (int k = 0; k < LEVELS + 2; k++) {
            if (table_b[m][k].typo != NULL) {
                printf("- *%s, %s: %s.\n", names[m], column_name(k), table_b[m][k].typo);
            }
        }
    }
    printf("\nWhere held-out RMSE puts another of level 6, Lafortune and Koenderink first than the texts' training "
           "RMSE (level 6, of all):\n\n");
    for (int m = 0; m < MATERIALS; m++) {
        int best = LEVELS - 1;
        for (int k = LEVELS - 1; k < LEVELS + 2; k++) {
            best = held[m][k] < held[m][best] ? k : best;
        }
        printf("- %s: %s%s.\n", names[m], best == LEVELS - 1 ? "the same, " : "", column_name(best));
    }
}

// ---- counts and times ----

static double nanoseconds(const gonio_model *model) {
    enum { N = 4000 };
    static gonio_vec3 wi[N], wo[N];
    uint64_t seed = 5;
    double best = INFINITY;
    for (int i = 0; i < N; i++) {
        const gonio_pair p = simulate_pair(&seed, 1);
        wi[i] = gonio_direction(p.theta_i, p.phi_i);
        wo[i] = gonio_direction(p.theta_o, p.phi_o);
    }
    for (int r = 0; r < 5; r++) {
        struct timespec a, b;
        double value;
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &a);
        for (int i = 0; i < N; i++) {
            gonio_model_eval(model, wi[i], wo[i], &value);
        }
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &b);
        best = fmin(best, (double)(b.tv_sec - a.tv_sec) * 1e9 + (double)(b.tv_nsec - a.tv_nsec));
    }
    return best / N;
}

static gonio_model *compressed(int material, int d, int s, double c, int from, const char *storage,
                               gonio_fit_report *report) {
    gonio_fit_options o = usual();
    gonio_model *model;
    o.diffuse_level = d;
    o.level = s;
    o.drop_percent = c;
    o.specular_start = from;
    o.storage = storage;
    fitted(sets[material], &o, "cbmba", &model, report);
    return model;
}

static void print_number(int digits, double value) {
    if (isfinite(value)) {
        printf("%.*f", digits, value);
    } else {
        printf("-");
    }
}

static void table_costs(void) {
    static const struct {
        const char *name;
        double coefficients, microseconds;
        int column; // of tables B; -1: CBMBA
        const char *storage;
    } rows[] = {{"level 6", 300763, 3, 6, NULL},
                {"(4,6,95) hash", NAN, 8, -1, "hash"},
                {"(4,6,95) jenkins", NAN, 8, -1, "jenkins"},
                {"(4,6,95) byte bricks", NAN, NAN, -1, "byte"},
                {"Lafortune(3)", 10, 1, 7, NULL},
                {"Koenderink(8)", 55, 200, 8, NULL}};
    printf("\n## Kameya, figures 5.6 and 5.7, section 7.1.3: coefficients and time\n\nMicroseconds of the text on an "
           "Athlon of "
           "1.4 GHz (Koenderink: above 200); ours here, from a pair of unit vectors; times that of level 6.\n\n| form "
           "| coefficients: published, "
           "ours | us published | ns ours | ratio published | ratio ours |\n|---|---|---|---|---|---|\n");
    double first = NAN;
    for (size_t k = 0; k < sizeof rows / sizeof *rows; k++) {
        gonio_model *model;
        gonio_fit_report r;
        if (rows[k].column < 0) {
            model = compressed(1, 4, 6, 95, -1, rows[k].storage, &r);
        } else if (!fit_column(1, rows[k].column, &model, &r)) {
            continue;
        }
        const double ns = nanoseconds(model);
        // A lobe of Lafortune's has three numbers, and there is a diffuse one.
        const double ours = rows[k].column == LEVELS ? 10 : (double)model->control_points;
        first = k == 0 ? ns : first;
        printf("| %s | ", rows[k].name);
        print_number(0, rows[k].coefficients);
        printf(", %.0f | ", ours);
        print_number(0, rows[k].microseconds);
        printf(" | %.0f | ", ns);
        print_number(2, rows[k].microseconds / 3);
        printf(" | %.2f |\n", ns / first);
        gonio_model_free(model);
    }
}

// ---- table 6.1 ----

static double dropped_rmse(const gonio_model *dense, const gonio_samples *samples, double percent) {
    gonio_errors errors;
    gonio_error error = {0};
    gonio_model *model = dropped_model(dense, percent);
    check(gonio_errors_model(model, samples, NULL, 1, &errors, &error), &error);
    gonio_model_free(model);
    return errors.rmse;
}

static void table_dropped(void) {
    static const double percents[] = {0, 5, 50, 87.5, 93.4};
    static const double text[3][2][5] = {{{.0043, .0121, .0400, .1112, .1272}, {.0006, .0148, .0440, .1121, .1247}},
                                         {{.0154, .0209, .0484, .1361, .1559}, {.0008, .0169, .0574, .1453, .1572}},
                                         {{.0073, .0272, .0844, .1191, .1358}, {.0012, .0310, .0898, .1216, .1383}}};
    printf("\n## Kameya, table 6.1: control points dropped from one lattice\n\nTraining RMSE, published and ours, ours "
           "dropping those of least magnitude. A lattice of which half never saw a "
           "sample loses nothing by its least 5 %%, so the text dropped in another order, which it does not state; its "
           "counts of \"50 %%\" are 30 %% (level 5) and "
           "19 %% (level 6).\n\n| stands for | level | 0 %% | 5 %% | 50 %% | 87.5 %% | 93.4 %% "
           "|\n|---|---|---|---|---|---|---|\n");
    for (int m = 0; m < 3; m++) {
        for (int level = 5; level <= 6; level++) {
            gonio_model *dense;
            gonio_fit_report r;
            fit_column(m, level, &dense, &r);
            printf("| %s | %d |", names[m], level);
            for (int k = 0; k < 5; k++) {
                printf(" %.4f, %.4f |", text[m][level - 5][k], dropped_rmse(dense, sets[m], percents[k]));
            }
            printf("\n");
            gonio_model_free(dense);
        }
    }
}

// ---- table 7.1 ----

// The text's own: 4 bytes a diffuse point; 7 bytes, a float and three indices, a point that is kept; Jenkins' table and
// its scramble of 512 bytes.
static double bytes_of_text(int d, int s, int percent) {
    const double table = s == 6 ? (percent == 80   ? 32768
                                   : percent == 90 ? 16384
                                                   : 8192)
                                : (percent == 80   ? 4608
                                   : percent == 90 ? 3584
                                                   : 1536);
    return 4 * (double)gonio_lattice_count(3, d) + 7 * (1 - percent / 100.0) * (double)gonio_lattice_count(3, s) +
           table + 512;
}

static void table_bytes(void) {
    static const double text[2][2][3] = {{{70469, 39433, 22378}, {459672, 232754, 119295}},
                                         {{92581, 61545, 44490}, {481784, 254866, 141407}}};
    static const int percents[] = {80, 90, 95};
    printf("\n## Kameya, table 7.1: bytes\n\nPublished; by the text's own formula, 4 (2^D + 3)^3 + 7 K + T + 512 with "
           "K = (1 - C/100)(2^S + 3)^3 and Jenkins' table "
           "of T bytes; ours of leather's surrogate, a channel: BDZ and Jenkins' hash with keys of three bytes, byte "
           "bricks.\n\n| (D,S,C) | published | by its formula | BDZ | Jenkins | byte bricks "
           "|\n|---|---|---|---|---|---|\n");
    for (int k = 0; k < 12; k++) {
        const int d = 3 + k / 6, s = 5 + k / 3 % 2, c = percents[k % 3];
        static const char *const storages[] = {"hash", "jenkins", "byte"};
        printf("| (%d,%d,%d) | %.0f | %.0f |", d, s, c, text[d - 3][s - 5][k % 3], rint(bytes_of_text(d, s, c)));
        for (int f = 0; f < 3; f++) {
            gonio_fit_report r;
            gonio_model *model = compressed(1, d, s, c, -1, storages[f], &r);
            printf(" %zu |", model->bytes);
            gonio_model_free(model);
        }
        printf("\n");
    }
}

// ---- tables C ----

static void table_compressed(void) {
    static const struct {
        int d, s, c;
        double rmse[MATERIALS], mae[MATERIALS];
        const char *typo;
    } rows[] = {{1, 6, 90, {.018, .015, .025, .030}, {.041, .028, .061, .595}, NULL},
                {2, 6, 90, {.007, .005, .010, .029}, {.017, .015, .026, .595}, NULL},
                {3, 6, 90, {.002, .002, .003, .029}, {.006, .008, .013, .595}, NULL},
                {3, 5, 90, {.005, .016, .008, .076}, {.035, .140, .063, 1.728}, NULL},
                {3,
                 6,
                 95,
                 {.004, .004, .005, .029},
                 {.010, .011, .014, .596},
                 "printed (3,5,95), whose errors would exceed level 5's"},
                {4, 5, 90, {.004, .015, .007, .078}, {.035, .140, .063, 1.728}, NULL},
                {4, 6, 95, {.001, .001, .001, .029}, {.006, .009, .013, .595}, NULL}};
    printf("\n## Kameya, tables C.1 and C.2: compressed fits\n\nHashed. RMSE and MAE, published, ours; ours over those "
           "of the dense lattice of level S, training; held-out RMSE and "
           "median_rel over the dense one's.\n\n| stands for | (D,S,C) | RMSE | MAE | RMSE / dense | MAE / dense | "
           "held-out RMSE / dense | held-out median_rel / dense "
           "|\n|---|---|---|---|---|---|---|---|\n");
    for (int m = 0; m < MATERIALS; m++) {
        gonio_fit_report dense[2];
        for (int s = 5; s <= 6; s++) {
            gonio_model *model;
            fit_column(m, s, &model, &dense[s - 5]);
            gonio_model_free(model);
        }
        for (size_t k = 0; k < sizeof rows / sizeof *rows; k++) {
            gonio_fit_report r;
            gonio_model_free(compressed(m, rows[k].d, rows[k].s, rows[k].c, -1, "jenkins", &r));
            const gonio_fit_report *to = &dense[rows[k].s - 5];
            printf("| %s | (%d,%d,%d)%s | %.3f, %.4f | %.3f, %.4f | %.3f | %.3f | %.3f | %.3f |\n", names[m], rows[k].d,
                   rows[k].s, rows[k].c, rows[k].typo != NULL ? "*" : "", rows[k].rmse[m], r.train.rmse, rows[k].mae[m],
                   r.train.max_abs, r.train.rmse / to->train.rmse, r.train.max_abs / to->train.max_abs,
                   r.held_out.rmse / to->held_out.rmse, r.held_out.median_rel / to->held_out.median_rel);
        }
    }
    printf("\n- *%s.\n", rows[4].typo);
    printf(
        "\nWhere the second fit begins (training MAE over the dense lattice's; the published tables are 1.000 of "
        "(4,5,90) and (3,5,90)):\n\n| stands for | (D,S,C) | D + 1 | D | 0 | S alone |\n|---|---|---|---|---|---|\n");
    static const int triples[][3] = {{4, 5, 90}, {3, 5, 90}, {4, 6, 95}};
    for (int m = 1; m < MATERIALS; m += 2) {
        for (int t = 0; t < 3; t++) {
            const int *v = triples[t], from[4] = {v[0] + 1, v[0], 0, v[1]};
            gonio_fit_report dense;
            gonio_model *model;
            fit_column(m, v[1], &model, &dense);
            gonio_model_free(model);
            printf("| %s | (%d,%d,%d) |", names[m], v[0], v[1], v[2]);
            for (int k = 0; k < 4; k++) {
                gonio_fit_report r;
                gonio_model_free(compressed(m, v[0], v[1], v[2], from[k], "jenkins", &r));
                printf(" %.3f |", r.train.max_abs / dense.train.max_abs);
            }
            printf("\n");
        }
    }
}

// ---- figure 2.10 ----

static void figure_smoothness(void) {
    printf("\n## Kameya, figure 2.10: one level of 32 cells against levels 0 to 5\n\nThe text draws that both meet the "
           "samples and that one level alone is rough. RMS error at the samples, and RMS second "
           "difference along the last axis of the control points, over the largest value.\n\n| stands for | BA(32) "
           "error | second difference | MBA, level 5: error | second difference "
           "|\n|---|---|---|---|---|\n");
    for (int m = 0; m < MATERIALS; m++) {
        gonio_scatter s;
        gonio_error error = {0};
        const gonio_scatter_options form = {
            .coordinates = GONIO_NUSSELT, .domain = GONIO_LINEAR, .symmetry = GONIO_SYMMETRY_MIRROR, .threads = 1};
        check(gonio_scatter_init(&s, sets[m], &form, &error), &error);
        printf("| %s |", names[m]);
        for (int alone = 1; alone >= 0; alone--) {
            gonio_lattice l;
            check(alone ? gonio_mba_fit_from(&s, 5, 5, 1, &l, &error) : gonio_mba_fit(&s, NULL, 5, 1, &l, &error),
                  &error);
            double rough = 0, largest = 0, left = 0;
            size_t n = 0;
            for (size_t i = 0; i < l.count; i++) {
                largest = fmax(largest, fabs((double)l.points[i]));
                if (i % l.size >= 1 && i % l.size + 1 < l.size) {
                    const double d = (double)l.points[i - 1] - 2 * (double)l.points[i] + (double)l.points[i + 1];
                    rough += d * d;
                    n++;
                }
            }
            for (size_t i = 0; i < s.n; i++) {
                gonio_position position = {{0}};
                float value;
                memcpy(position.x, s.positions + 3 * i, 3 * sizeof(uint32_t));
                gonio_lattice_eval_positions(&l, 1, &position, &value);
                left += ((double)value - (double)s.values[i]) * ((double)value - (double)s.values[i]);
            }
            printf(" %.5f | %.5f |", sqrt(left / (double)s.n), sqrt(rough / (double)n) / largest);
            gonio_lattice_release(&l);
        }
        printf("\n");
        gonio_scatter_release(&s);
    }
}

// ---- Park and Lee ----

static const gonio_transform plain[3] = {{1, 0}, {1, 0}, {1, 0}};

static bool volume_row(const char *material, int order, double rate, const double *points, const char *paper) {
    char spec[96];
    gonio_model *truth, *model;
    gonio_bvb_table t;
    gonio_bvb_report r;
    gonio_error error = {0};
    gonio_fit_options o = usual();
    snprintf(spec, sizeof spec, "sgd:%s", material);
    if (gonio_model_from_spec(spec, &truth, NULL) != GONIO_OK) {
        return false;
    }
    check(gonio_bvb_table_init(&t, true, 3, 90, &error), &error);
    gonio_bvb_table_of_model(&t, truth, GONIO_TRANSFORM_LINEAR, plain, 0);
    // Thetas beyond 80 deg take the values there.
    const size_t row = t.size[2] * 3;
    for (size_t k = 0; k < 91 * 91; k++) {
        const size_t i = k / 91 < 80 ? k / 91 : 80, j = k % 91 < 80 ? k % 91 : 80;
        memmove(t.values + k * row, t.values + (91 * i + j) * row, row * sizeof *t.values);
    }
    o.order = order;
    o.rate = rate;
    if (points != NULL) {
        memcpy(o.points, points, sizeof o.points);
    }
    const char channels[3][32] = {"r", "g", "b"};
    check(gonio_bvb_fit_table(&t, GONIO_TRANSFORM_LINEAR, plain, channels, &o, &model, &r, &error), &error);
    printf(
        "| %s | %d | %.3g | %s | %zux%zux%zu: AR %.3f, MR %.4g, AE %.4f, E %.4g, E / MR %.4f, %zu bytes, %.2f %% |\n",
        material, order, rate, paper, r.count[0], r.count[1], r.count[2], r.table.mean, r.table.largest, r.error.mean,
        r.error.largest, r.error.largest / r.table.largest, model->bytes,
        100.0 * (double)model->control_points / (91 * 91 * 361.0));
    gonio_model_free(model);
    gonio_model_free(truth);
    gonio_bvb_table_release(&t);
    return true;
}

static void park_and_lee(void) {
    static const double points[3] = {15, 15, 60};
    printf("\n## Park and Lee, figures 9 to 13: B-spline volumes\n\nThe fits of Bagher et al. (2012) to the same "
           "materials stand for the measured tables; thetas beyond 80 deg take the values there. "
           "Tables of 91 x 91 x 361 x 3 numbers: the text's 70 MB are of doubles (71.7), its \"four bytes\" make 35.9; "
           "our control points are floats. Counts are of points; where the text gives last indices, one is "
           "added.\n\n| material | order | rate | published | ours |\n|---|---|---|---|---|\n");
    const bool there = volume_row("gold-metallic-paint", 4, 0, points,
                                  "15x15x60: AR .092, MR 4.074, AE .003, E .343, E / MR .084, 324000 bytes, .45 %") &&
                       volume_row("specular-orange-phenolic", 2, 0.1, NULL, "50x59x9: AR .133, MR 2357, .89 %") &&
                       volume_row("specular-orange-phenolic", 2, 0.05, NULL, "81x84x11, 2.50 %") &&
                       volume_row("specular-orange-phenolic", 2, 0.005, NULL, "91x91x13, 3.60 %");
    if (!there) {
        printf("| | | | | not run: $GONIO_DATA is not set |\n");
    }
    printf("\n100 materials (figure 14: mean 2.4 %%, least .02, largest 7.5) and errors beside fits of Lafortune and "
           "Cook-Torrance (figure 16): `build/tests/bench/bench_bvb materials`, whose figures stand in "
           "[fitting.md](fitting.md).\n");
}

// ---- what is told elsewhere ----

static void elsewhere(void) {
    printf(
        "\n## Told elsewhere, and not told\n\n| figure | where |\n|---|---|\n"
        "| Kameya 5.1.4, five lobes that do not converge | plain descents from random starts: "
        "[fitting.md](fitting.md), by `build/tests/bench/lafortune_starts` |\n"
        "| Kameya 7.2.2 and Park and Lee figures 10, 18, images and their times | `gonio render SCENE --compare REF`: "
        "[scenes.md](scenes.md) |\n"
        "| Wu 2009, table 3 | `gonio cpm build` and `compare`: [scenes.md](scenes.md) |\n"
        "| DeYoung 1996, P_r, P_ec, P_i, P_s^(k) | `gonio check`: [physical.md](physical.md); his Phong's parameters "
        "and grid are not stated |\n"
        "| DeYoung 6.2, all storage schemes in one table | `gonio tradeoff` |\n");
}

int main(void) {
    for (int m = 0; m < MATERIALS; m++) {
        sets[m] = simulate_samples(specs[m], 1400, 1, 1);
    }
    printf("# Published figures beside ours\n\nWritten by `make seed-tables`. None of the texts' data is public: felt, "
           "leather, aluminium and latex blue are stood for by\n\n");
    for (int m = 0; m < MATERIALS; m++) {
        printf("- %s: `%s`, 1,400 random directions to 85 deg, in the thesis' form (`--thesis`)\n", names[m], specs[m]);
    }
    printf("\nso a ratio says how alike materials are as much as how good a method is. Held out: a fifth of the "
           "geometries, seed 1.\n");
    table_errors();
    table_costs();
    figure_smoothness();
    table_dropped();
    table_bytes();
    table_compressed();
    park_and_lee();
    elsewhere();
    for (int m = 0; m < MATERIALS; m++) {
        gonio_samples_free(sets[m]);
    }
    return 0;
}
