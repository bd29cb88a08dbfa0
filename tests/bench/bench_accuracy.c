// SPDX-License-Identifier: BSD-3-Clause
// Accuracy of the least-squares fits, each figure as "asked, measured". usage: bench_accuracy [PART ...], PART one of
//
//   simulated  lsq against multilevel approximation (level 6) on the same samples, 20 iterations against the plain
//              scalar fit, positivity. Isotropic Ward (a) alpha 0.15 and (b) 0.03, rho_d 0.3, rho_s 0.2, at directions
//              uniform in solid angle to 85 deg; errors on 20,000 others. lambda comes from the training samples alone.
//   draws      the two figures of `simulated` that a few grazing samples set, on four other draws each
//   measured   the default method on real materials: 5 folds over unique geometries, seed 1
//   noise      what noise alone does to the figures of single channels
//   speed      the default method's fit of 1,439 geometries x 31 channels, of 140,000 samples, and of 190,000 x 3
//   a name     that material of `measured` alone
//
// Without arguments all of them.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

#include "base/clock.h"
#include "fit/smooth/cg.h"
#include "gonio/fit.h"
#include "gonio/io.h"
#include "tests/golden/oracle.h"
#include "tests/simulate.h"

#define WARD_A "ward:rho_d=0.3,rho_s=0.2,alpha=0.15"
#define WARD_B "ward:rho_d=0.3,rho_s=0.2,alpha=0.03"

static int missed;

typedef struct result {
    gonio_errors errors;
    double relative_rmse; // rms of (p - f)/f
    double seconds;
    gonio_fit_report report;
    gonio_model *model;
} result;

static result measure(const gonio_samples *samples, const gonio_samples *unseen, gonio_fit_options o) {
    result r = {0};
    gonio_error error = {0};
    o.hold_out = 0;
    const double start = gonio_clock_s();
    if (gonio_fit(samples, &o, &r.model, &r.report, &error) != GONIO_OK ||
        gonio_errors_model(r.model, unseen, NULL, 0, &r.errors, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    r.seconds = gonio_clock_s() - start;
    for (size_t i = 0; i < unseen->n; i++) {
        double p;
        gonio_model_eval_pair(r.model, &unseen->pairs[i], &p);
        const double d = (p - unseen->values[i]) / unseen->values[i];
        r.relative_rmse += d * d / (double)unseen->n;
    }
    r.relative_rmse = sqrt(r.relative_rmse);
    return r;
}

static gonio_fit_options form(const char *method, gonio_domain domain, int symmetry) {
    gonio_fit_options o;
    gonio_fit_options_default(&o);
    o.method = method;
    o.coordinates = domain == GONIO_LINEAR ? GONIO_NUSSELT : GONIO_COORDINATES_AUTO;
    o.domain = domain;
    o.symmetry = symmetry;
    return o;
}

static gonio_fit_options reference(void) {
    gonio_fit_options o = form("mba", GONIO_LINEAR, GONIO_SYMMETRY_AUTO);
    o.level = 6;
    return o;
}

static void judge(const char *what, double mine, double theirs, double factor) {
    const double ratio = mine / theirs;
    printf("%-46s %10.3g %10.3g   1/%-7.3g asked 1/%-5.3g %s\n", what, mine, theirs, 1 / ratio, factor,
           ratio <= 1 / factor ? "ok" : "MISSED");
    missed += ratio > 1 / factor;
}

static void add_noise(gonio_samples *samples, double relative, uint64_t seed) {
    for (size_t i = 0; i < samples->n; i++) {
        double normal = -6; // Irwin-Hall
        for (int k = 0; k < 12; k++) {
            normal += simulate_uniform(&seed);
        }
        samples->values[i] *= 1 + relative * normal;
    }
}

// Linear domain, Nusselt coordinates: the same space as the reference's, so the solve alone makes the difference. Log:
// coordinates and domain as `--method lsq` takes them by itself.
static void ward_case(const char *label, gonio_domain domain, size_t n, double noise, int symmetry, double factor,
                      const gonio_samples *unseen) {
    gonio_samples *samples = simulate_samples(WARD_A, n, 1, n);
    add_noise(samples, noise, 99);
    result mba = measure(samples, unseen, reference());
    result lsq = measure(samples, unseen, form("lsq", domain, symmetry));
    char text[96];
    snprintf(text, sizeof text, "%s, level %d, %s", label, lsq.report.level, symmetry != 0 ? "mirror" : "no symmetry");
    printf("%s\n", lsq.report.options);
    judge(text, lsq.errors.rmse, mba.errors.rmse, factor);
    gonio_model_free(mba.model);
    gonio_model_free(lsq.model);
    gonio_samples_free(samples);
}

static void count_negatives(const char *label, const gonio_model *model, size_t n) {
    size_t negative = 0;
    uint64_t seed = 5;
    gonio_vec3 wi[1024], wo[1024];
    double values[1024];
    for (size_t done = 0; done < n; done += 1024) {
        for (size_t i = 0; i < 1024; i++) {
            const double zi = simulate_uniform(&seed), zo = simulate_uniform(&seed);
            wi[i] = gonio_direction(acos(zi), 0);
            wo[i] = gonio_direction(acos(zo), 2 * GONIO_PI * simulate_uniform(&seed));
        }
        gonio_model_eval_many(model, 1024, wi, wo, values);
        for (size_t i = 0; i < 1024; i++) {
            negative += !(values[i] >= 0);
        }
    }
    printf("%-46s %zu negative values in %.0f million evaluations %s\n", label, negative, (double)n / 1e6,
           negative == 0 ? "ok" : "MISSED");
    missed += negative > 0;
}

// Seeds of the samples of (a) and (b), and of those held out.
typedef struct draw {
    uint64_t a, b, unseen;
} draw;

static const draw draws[] = {{14000, 1, 777}, {2, 2, 779}, {3, 3, 780}, {4, 4, 781}, {5, 5, 782}};
#define DRAWS (sizeof draws / sizeof *draws)

// `--method lsq` as it is by default against MBA on one draw; releases the samples.
static void grazing_case(const char *label, gonio_samples *samples, gonio_samples *unseen, double factor,
                         double relative_factor) {
    result mba = measure(samples, unseen, reference());
    result lsq = measure(samples, unseen, form("lsq", GONIO_LOG, GONIO_SYMMETRY_MIRROR));
    printf("%s level %d, %s, %.1f s\n", gonio_coordinates_name(lsq.report.coordinates), lsq.report.level,
           lsq.report.options, lsq.report.fit_seconds);
    judge(label, lsq.errors.rmse, mba.errors.rmse, factor);
    if (relative_factor > 0) {
        judge("  relative rmse", lsq.relative_rmse, mba.relative_rmse, relative_factor);
    }
    fflush(stdout);
    gonio_model_free(mba.model);
    gonio_model_free(lsq.model);
    gonio_samples_free(samples);
    gonio_samples_free(unseen);
}

static void grazing_cases(const draw *some, size_t n) {
    for (size_t k = 0; k < n; k++) {
        const draw *d = &some[k];
        char label[64];
        snprintf(label, sizeof label, "(a) 14k, default form, seeds %d and %d", (int)d->a, (int)d->unseen);
        grazing_case(label, simulate_samples(WARD_A, 14000, 1, d->a), simulate_samples(WARD_A, 20000, 1, d->unseen), 5,
                     0);
        snprintf(label, sizeof label, "(b) 140k, default form, seeds %d and %d", (int)d->b, (int)d->unseen);
        grazing_case(label, simulate_samples(WARD_B, 140000, 1, d->b), simulate_samples(WARD_B, 20000, 1, d->unseen), 3,
                     20);
    }
}

static void positive_cases(void) {
    static const char *const specs[] = {WARD_A, WARD_B};
    for (int k = 0; k < 2; k++) {
        gonio_samples *samples = simulate_samples(specs[k], 140000, 1, 1);
        gonio_samples *unseen = simulate_samples(specs[k], 2000, 1, 777);
        result positive = measure(samples, unseen, form("lsq", GONIO_LOG, GONIO_SYMMETRY_MIRROR));
        count_negatives(k == 0 ? "(a) positivity" : "(b) positivity", positive.model, 10000000);
        gonio_model_free(positive.model);
        gonio_samples_free(samples);
        gonio_samples_free(unseen);
    }
}

// 20 iterations, from the samples' positions to the solution, against the plain scalar fit of the same samples.
static void iteration_case(const gonio_samples *unseen) {
    gonio_samples *samples = simulate_samples(WARD_A, 140000, 1, 140000);
    result mba = measure(samples, unseen, reference());
    const gonio_dataset_options how = {.mirror = true, .domain = GONIO_LINEAR};
    const gonio_smooth_form space = gonio_smooth_form_default(GONIO_NUSSELT, 6, true);
    gonio_dataset data, at;
    gonio_error error = {0};
    if (gonio_dataset_init(&data, samples, &how, &error) != GONIO_OK ||
        gonio_dataset_init(&at, unseen, &how, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    double *x = malloc(3 * data.n * sizeof *x), *residual = malloc(data.n * sizeof *residual), best = INFINITY,
           plain = INFINITY;
    gonio_dataset_locate(&data, GONIO_NUSSELT, x);
    gonio_smooth_cg *cg;
    gonio_smooth_cg_report report;
    if (gonio_smooth_cg_new(&data, &space, 0, &cg, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    double *points = malloc(gonio_smooth_cg_count(cg, 6) * sizeof *points),
           *predicted = malloc(at.n * sizeof *predicted);
    for (int pass = 0; pass < 3; pass++) {
        memcpy(residual, data.targets, data.n * sizeof *residual);
        double start = gonio_clock_s();
        oracle_lattice oracle = oracle_fit(6, data.n, x, residual);
        plain = fmin(plain, gonio_clock_s() - start);
        free(oracle.points);
        start = gonio_clock_s();
        gonio_smooth_cg_cascade(cg, data.targets, 1, 1e-8, 20, 0, points, &report, &error);
        best = fmin(best, gonio_clock_s() - start);
    }
    double squares = 0;
    gonio_smooth_cg_eval(cg, &at, 6, points, predicted, 1, &error);
    for (size_t i = 0; i < at.n; i++) {
        const double d = predicted[i] * data.transforms[0].scale - at.values[i];
        squares += d * d / (double)at.n;
    }
    printf("20 iterations: %.0f ms, plain scalar fit %.0f ms: %.2f times, asked 2 %s\n", best * 1e3, plain * 1e3,
           best / plain, best <= 2 * plain ? "ok" : "MISSED");
    missed += best > 2 * plain;
    judge("(a) 140k after 20 iterations, rmse", sqrt(squares), mba.errors.rmse, 5);
    gonio_smooth_cg_free(cg);
    gonio_model_free(mba.model);
    gonio_dataset_release(&data);
    gonio_dataset_release(&at);
    free(x);
    free(residual);
    free(points);
    free(predicted);
    gonio_samples_free(samples);
}

static void simulated(void) {
    gonio_samples *unseen = simulate_samples(WARD_A, 20000, 1, 777);
    printf("%-46s %10s %10s\n", "held-out error of 20,000", "lsq", "MBA 6");
    ward_case("(a) 140k", GONIO_LINEAR, 140000, 0, 0, 5, unseen);
    ward_case("(a) 14k", GONIO_LINEAR, 14000, 0, 0, 1.4, unseen);
    grazing_cases(draws, 1);
    ward_case("(a) 1.4k", GONIO_LINEAR, 1400, 0, GONIO_SYMMETRY_MIRROR, 1.25, unseen);
    ward_case("(a) 140k, 2 % noise", GONIO_LINEAR, 140000, 0.02, GONIO_SYMMETRY_MIRROR, 2.5, unseen);
    iteration_case(unseen);
    positive_cases();
    gonio_samples_free(unseen);
}

// ---- measured materials ----

typedef struct material {
    const char *name, *file;
    bool mean;                                             // the average of the channels as one channel
    bool tensor;                                           // sampled at 1,400 directions
    bool printed;                                          // nothing is asked: every material there is
    double median_rel, rms_log, rmse, rmse_ratio, rmse_70; // asked; 0: nothing
} material;

static const material materials[] = {
    {.name = "garnet_red mean",
     .file = "cornell/garnet_red.brdf",
     .mean = true,
     .median_rel = .013,
     .rms_log = .10,
     .rmse_70 = .02},
    {.name = "acryl_blue mean", .file = "cornell/acryl_blue.brdf", .mean = true, .median_rel = .024, .rms_log = .21},
    {.name = "mystique mean", .file = "cornell/mystique.brdf", .mean = true, .median_rel = .048, .rms_log = .20},
    {.name = "garnet_red", .file = "cornell/garnet_red.brdf", .median_rel = .013, .rms_log = .10, .rmse_70 = .02},
    {.name = "acryl_blue", .file = "cornell/acryl_blue.brdf", .median_rel = .024, .rms_log = .21},
    {.name = "mystique", .file = "cornell/mystique.brdf", .median_rel = .048, .rms_log = .20},
    {.name = "PTFE 633 nm", .file = "nist_ptfe/PTFE.data.csv", .rmse = .0045},
    {.name = "vch_silk_blue",
     .file = "rgl/vch_silk_blue_rgb.bsdf",
     .tensor = true,
     .median_rel = .012,
     .rmse_ratio = 3},
    {.name = "aurora_white", .file = "rgl/aurora_white_rgb.bsdf", .tensor = true, .median_rel = .009, .rmse_ratio = 3},
    {.name = "chm_orange", .file = "rgl/chm_orange_rgb.bsdf", .tensor = true, .printed = true},
    {.name = "cm_military_green", .file = "rgl/cm_military_green_rgb.bsdf", .tensor = true, .printed = true},
    {.name = "ilm_solo_m_68", .file = "rgl/ilm_solo_m_68_rgb.bsdf", .tensor = true, .printed = true},
};
#define MATERIALS (sizeof materials / sizeof *materials)

// Solid-angle uniform, both thetas to 80 deg; out-of-gamut negatives count as 0.
static gonio_samples *sample_tensor(const char *path, size_t n) {
    gonio_model *table;
    gonio_samples *samples;
    gonio_error error = {0};
    gonio_pair *pairs = malloc(n * sizeof *pairs);
    const double below = 1 - cos(80 * GONIO_PI / 180);
    uint64_t seed = 1;
    for (size_t i = 0; i < n; i++) {
        const double a = simulate_uniform(&seed), b = simulate_uniform(&seed), c = simulate_uniform(&seed);
        pairs[i] = (gonio_pair){acos(1 - a * below), 0, acos(1 - b * below), 2 * GONIO_PI * c};
    }
    if (gonio_read_table(path, &table, &error) != GONIO_OK ||
        gonio_samples_of_model(table, pairs, n, 0, &samples, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    for (size_t i = 0; i < n * (size_t)samples->channels; i++) {
        samples->values[i] = fmax(samples->values[i], 0);
    }
    gonio_model_free(table);
    free(pairs);
    return samples;
}

// NULL where the data is absent.
static gonio_samples *load(const material *m) {
    const char *data = getenv("GONIO_DATA");
    char path[512];
    struct stat info;
    snprintf(path, sizeof path, "%s/%s", data != NULL ? data : "../shared/data", m->file);
    if (stat(path, &info) != 0) {
        printf("%-18s SKIP: no %s\n", m->name, path);
        return NULL;
    }
    if (m->tensor) {
        return sample_tensor(path, 1400);
    }
    gonio_read_options o;
    gonio_samples *samples;
    gonio_error error = {0};
    gonio_read_options_default(&o);
    o.wavelength_nm = 633; // NIST files alone look at it
    if (gonio_read(path, &o, &samples, NULL, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    return m->mean ? simulate_channel_mean(samples) : samples;
}

static gonio_fit_report fold_errors(const gonio_samples *samples, gonio_fit_options o) {
    gonio_model *model;
    gonio_fit_report report;
    gonio_error error = {0};
    o.hold_out = 0;
    o.folds = 5;
    if (gonio_fit(samples, &o, &model, &report, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    gonio_model_free(model);
    return report;
}

static void figure(const char *what, double measured, double asked) {
    if (asked > 0) {
        printf("  %s %.4g asked %.4g%s", what, measured, asked, measured <= asked ? "" : " MISSED");
        missed += measured > asked;
    } else {
        printf("  %s %.4g", what, measured);
    }
}

static void judge_material(const material *m) {
    gonio_samples *samples = load(m);
    if (samples == NULL) {
        return;
    }
    gonio_fit_options o;
    gonio_fit_options_default(&o);
    const gonio_fit_report mine = fold_errors(samples, o), theirs = fold_errors(samples, reference());
    const gonio_errors *e = &mine.held_out, *r = &theirs.held_out;
    printf("%-18s", m->name);
    figure("median_rel", e->median_rel, m->median_rel);
    figure("rms_log", e->rms_log, m->rms_log);
    figure("rmse", e->rmse, m->rmse_ratio > 0 ? r->rmse / m->rmse_ratio : m->rmse);
    figure("rmse_70", e->rmse_70, m->rmse_70);
    printf("  (MBA 6: %.4g / %.4g, rmse %.4g)\n%18s  %s level %d, %s, %.1f s\n", r->median_rel, r->rms_log, r->rmse, "",
           gonio_coordinates_name(mine.coordinates), mine.level, mine.options, mine.fit_seconds);
    // Nowhere worse than what anybody would have used before.
    if (e->median_rel > r->median_rel || e->rms_log > r->rms_log) {
        printf("%18s  MISSED: worse than MBA level 6\n", "");
        missed++;
    }
    fflush(stdout);
    gonio_samples_free(samples);
}

static int by_value(const void *left, const void *right) {
    const double a = *(const double *)left, b = *(const double *)right;
    return (a > b) - (a < b);
}

// f_k as a combination of its neighbours in the spectrum, by least squares of relative errors: out[0], out[1].
static void neighbours_share(const gonio_samples *s, size_t k, double out[2]) {
    double aa = 1e-12, ab = 0, bb = 1e-12, az = 0, bz = 0;
    const size_t c = (size_t)s->channels;
    for (size_t i = 0; i < s->n; i++) {
        const double *z = s->values + i * c + k, w = 1 / (fabs(z[-1] + z[1]) + 1e-3);
        aa += w * w * z[-1] * z[-1];
        ab += w * w * z[-1] * z[1];
        bb += w * w * z[1] * z[1];
        az += w * w * z[-1] * z[0];
        bz += w * w * z[1] * z[0];
    }
    const double determinant = aa * bb - ab * ab;
    out[0] = (az * bb - bz * ab) / determinant;
    out[1] = (bz * aa - az * ab) / determinant;
}

// The noise that channels do not share: what is left of one after its neighbours in the spectrum of the same geometry
// have told all they know, divided by what their own noise adds. No fit of single channels can err less on held-out
// samples than by that noise, taken as median_rel.
static void noise_floor(const material *m) {
    gonio_samples *s = load(m);
    if (s == NULL) {
        return;
    }
    const size_t c = (size_t)s->channels;
    double *work = malloc(s->n * sizeof *work), sum = 0, worst = 0;
    for (size_t k = 1; k + 1 < c; k++) {
        double share[2];
        neighbours_share(s, k, share);
        const double spread = sqrt(1 + share[0] * share[0] + share[1] * share[1]);
        for (size_t i = 0; i < s->n; i++) {
            const double *z = s->values + i * c + k;
            work[i] = fabs(z[0] - share[0] * z[-1] - share[1] * z[1]) / spread / (z[0] + 1e-3);
        }
        qsort(work, s->n, sizeof *work, by_value);
        sum += work[s->n / 2] / (double)(c - 2);
        worst = fmax(worst, work[s->n / 2]);
    }
    printf("%-18s noise of single channels alone: median_rel %.4f, in the noisiest channel %.3f\n", m->name, sum,
           worst);
    free(work);
    gonio_samples_free(s);
}

static void measured(const char *only) {
    for (size_t k = 0; k < MATERIALS; k++) {
        if (only == NULL || strcmp(only, materials[k].name) == 0) {
            judge_material(&materials[k]);
        }
    }
}

static void noise(void) {
    for (size_t k = 0; k < MATERIALS; k++) {
        if (!materials[k].mean && strncmp(materials[k].file, "cornell", 7) == 0) {
            noise_floor(&materials[k]);
        }
    }
}

// ---- speed ----

static void time_fit(const char *what, gonio_samples *samples, double asked) {
    gonio_fit_options o;
    gonio_model *model;
    gonio_fit_report report;
    gonio_error error = {0};
    gonio_fit_options_default(&o);
    o.hold_out = 0;
    struct timespec before, after;
    const double start = gonio_clock_s();
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &before);
    if (gonio_fit(samples, &o, &model, &report, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &after);
    const double seconds = gonio_clock_s() - start;
    printf("%-46s %.1f s (%.1f s of the processors)", what, seconds,
           (double)(after.tv_sec - before.tv_sec) + 1e-9 * (double)(after.tv_nsec - before.tv_nsec));
    if (asked > 0) {
        printf(", asked %.0f %s", asked, seconds <= asked ? "ok" : "MISSED");
    }
    printf("\n  %s %s level %d\n", report.options, gonio_coordinates_name(report.coordinates), report.level);
    fflush(stdout);
    missed += asked > 0 && seconds > asked;
    gonio_model_free(model);
    gonio_samples_free(samples);
}

static void speed(void) {
    gonio_samples *paint = load(&materials[3]);
    if (paint != NULL) {
        time_fit("1,439 geometries x 31 channels", paint, 60);
    }
    time_fit("140,000 samples, one channel", simulate_samples(WARD_A, 140000, 1, 1), 30);
    time_fit("140,000 samples, one channel, alpha 0.03", simulate_samples(WARD_B, 140000, 1, 1), 30);
    time_fit("190,000 samples, three channels", simulate_samples(WARD_A, 190000, 3, 1), 60);
}

int main(int argc, char **argv) {
    for (int k = 1; k < argc || k == 1; k++) {
        const char *part = k < argc ? argv[k] : "all";
        const bool all = strcmp(part, "all") == 0;
        if (all || strcmp(part, "simulated") == 0) {
            simulated();
        } else if (strcmp(part, "speed") != 0 && strcmp(part, "noise") != 0 && strcmp(part, "draws") != 0) {
            measured(strcmp(part, "measured") == 0 ? NULL : part);
        }
        if (all || strcmp(part, "draws") == 0) {
            grazing_cases(draws + 1, DRAWS - 1);
        }
        if (all || strcmp(part, "speed") == 0) {
            speed();
        }
        if (all) {
            measured(NULL);
        }
        if (all || strcmp(part, "noise") == 0) {
            noise();
        }
    }
    printf(missed == 0 ? "all figures reached\n" : "%d figures missed\n", missed);
    return 0;
}
