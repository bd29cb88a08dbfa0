// SPDX-License-Identifier: BSD-3-Clause
// The fitter's figures, as ratios against the plain transcription of the thesis (tests/golden/oracle.h), which is built
// with the same flags and timed in the same run, alternating; each figure is the least of several repetitions.
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "brdf/kind/lattice.h"
#include "brdf/spline/lattice_eval.h"
#include "fit/bilevel/bilevel.h"
#include "fit/mba/mba.h"
#include "fit/options.h"
#include "gonio/fit.h"
#include "tests/golden/oracle.h"
#include "tests/simulate.h"

#define LEVEL 6
#define QUERIES 200000
#define REPEATS 3

static const char *const specs[] = {"ward:rho_d=0.3,rho_s=0.2,alpha=0.15", "ward:rho_d=0.3,rho_s=0.2,alpha=0.03"};
static const gonio_scatter_options plain_form = {GONIO_NUSSELT, GONIO_LINEAR, 0, false, 0};
static int failures;

static double clock_s(clockid_t clock) {
    struct timespec t;
    clock_gettime(clock, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

// The thread's own time: other programs on the machine lengthen a wall clock, and not both sides of a ratio alike.
static double now_s(void) { return clock_s(CLOCK_THREAD_CPUTIME_ID); }

static double wall_s(void) { return clock_s(CLOCK_MONOTONIC); }

static void verdict(const char *what, double value, double limit, bool at_least) {
    const bool good = at_least ? value >= limit : value <= limit;
    printf("  %-66s %8.3g  (%s %.3g) %s\n", what, value, at_least ? ">=" : "<=", limit, good ? "ok" : "MISSED");
    failures += !good;
}

static void check(gonio_status status, const gonio_error *error) {
    if (status != GONIO_OK) {
        fprintf(stderr, "%s\n", error->message);
        exit(1);
    }
}

typedef struct problem {
    gonio_samples *samples;
    double *x, *z; // n x 3, n
    size_t n;
} problem;

static problem make_problem(const char *spec, size_t n, int channels) {
    problem p = {simulate_samples(spec, n, channels, 1), malloc(n * 3 * sizeof(double)), malloc(n * sizeof(double)), n};
    for (size_t i = 0; i < n; i++) {
        gonio_scatter_locate(GONIO_NUSSELT, 3, &p.samples->pairs[i], p.x + 3 * i);
        p.z[i] = p.samples->values[i * (size_t)channels];
    }
    return p;
}

static void free_problem(problem *p) {
    gonio_samples_free(p->samples);
    free(p->x);
    free(p->z);
}

static double time_plain(const problem *p, oracle_lattice *result) {
    double *residual = malloc(p->n * sizeof *residual);
    memcpy(residual, p->z, p->n * sizeof *residual);
    const double start = now_s();
    *result = oracle_fit(LEVEL, p->n, p->x, residual);
    const double seconds = now_s() - start;
    free(residual);
    return seconds;
}

// Like the plain fit, from coordinates and values: sorting and the levels. The samples are in random order each time.
static double time_fast(const problem *p, int threads, gonio_lattice *result, double *scale, double *wall) {
    gonio_scatter s;
    gonio_error error = {0};
    check(gonio_scatter_prepare(&s, p->samples, &plain_form, &error), &error);
    const double start = now_s(), wall_start = wall_s();
    check(gonio_scatter_sort(&s, threads, &error), &error);
    check(gonio_mba_fit(&s, NULL, LEVEL, threads, result, &error), &error);
    const double seconds = now_s() - start, wall_seconds = wall_s() - wall_start;
    *wall = fmin(*wall, wall_seconds);
    *scale = s.transforms[0].scale;
    gonio_scatter_release(&s);
    return seconds;
}

static double worst_difference(const oracle_lattice *plain, const gonio_lattice *fast, double scale) {
    double worst = 0;
    for (size_t i = 0; i < fast->count; i++) {
        worst = fmax(worst, fabs((double)plain->points[i] - (double)fast->points[i * (size_t)fast->channels] * scale));
    }
    return worst;
}

static double largest_value(const problem *p) {
    double largest = 0;
    for (size_t i = 0; i < p->n; i++) {
        largest = fmax(largest, fabs(p->z[i]));
    }
    return largest;
}

static void bench_fit(const char *spec, size_t n) {
    problem p = make_problem(spec, n, 1);
    double plain = INFINITY, fast = INFINITY, one = INFINITY, two = INFINITY, scale = 1, difference = 0;
    for (int r = 0; r < REPEATS; r++) {
        oracle_lattice o;
        gonio_lattice one_thread, two_threads;
        plain = fmin(plain, time_plain(&p, &o));
        fast = fmin(fast, time_fast(&p, 1, &one_thread, &scale, &one));
        time_fast(&p, 2, &two_threads, &scale, &two);
        difference = worst_difference(&o, &one_thread, scale) / largest_value(&p);
        if (memcmp(one_thread.points, two_threads.points, one_thread.count * sizeof(float)) != 0) {
            verdict("two threads give other bits", 1, 0, false);
        }
        free(o.points);
        gonio_lattice_release(&one_thread);
        gonio_lattice_release(&two_threads);
    }
    const double per = 1e9 / (double)n / (LEVEL + 1);
    printf("fit %zu samples, %s: plain %.1f, fast %.1f ns a sample and level; wall: one thread %.1f, two %.1f\n", n,
           spec, plain * per, fast * per, one * per, two * per);
    verdict("difference from the plain fit / largest value", difference, 1e-5, false);
    if (n > 14000) {
        verdict("fast / plain", fast / plain, 0.25, false);
    }
    if (n >= 1400000) {
        verdict("one thread / two threads", one / two, 1.5, true);
    } else if (n <= 14000) {
        verdict("two threads / one thread", two / one, 1.1, false); // 1 within the noise of 1 ms
    }
    free_problem(&p);
}

typedef struct queries {
    double *x; // QUERIES x 3
    gonio_position *positions;
    gonio_vec3 *wi, *wo;
    gonio_samples *truth;
} queries;

// Random directions; sorted: along the lattice's first two axes.
static queries make_queries(const char *spec) {
    queries q = {malloc(QUERIES * 3 * sizeof(double)), malloc(QUERIES * sizeof(gonio_position)),
                 malloc(QUERIES * sizeof(gonio_vec3)), malloc(QUERIES * sizeof(gonio_vec3)),
                 simulate_samples(spec, QUERIES, 1, 77)};
    for (size_t i = 0; i < QUERIES; i++) {
        const gonio_pair *pair = &q.truth->pairs[i];
        gonio_scatter_locate(GONIO_NUSSELT, 3, pair, q.x + 3 * i);
        q.positions[i] = gonio_position_of(q.x + 3 * i, 3);
        q.wi[i] = gonio_direction(pair->theta_i, pair->phi_i);
        q.wo[i] = gonio_direction(pair->theta_o, pair->phi_o);
    }
    return q;
}

static void free_queries(queries *q) {
    free(q->x);
    free(q->positions);
    free(q->wi);
    free(q->wo);
    gonio_samples_free(q->truth);
}

static volatile double sink;

static double time_plain_eval(const oracle_lattice *o, const queries *q) {
    const double start = now_s();
    double sum = 0;
    for (size_t i = 0; i < QUERIES; i++) {
        sum += oracle_eval(o, q->x + 3 * i);
    }
    sink = sum;
    return (now_s() - start) / QUERIES;
}

static double time_single_eval(const gonio_lattice *l, const queries *q, const gonio_position *positions) {
    float values[GONIO_CHANNELS_MAX];
    (void)q;
    const double start = now_s();
    double sum = 0;
    for (size_t i = 0; i < QUERIES; i++) {
        gonio_lattice_eval_positions(l, 1, &positions[i], values);
        sum += values[0];
    }
    sink = sum;
    return (now_s() - start) / QUERIES;
}

static double time_batched_eval(const gonio_lattice *l, const gonio_position *positions, float *values) {
    const double start = now_s();
    gonio_lattice_eval_positions(l, QUERIES, positions, values);
    sink = values[0];
    return (now_s() - start) / QUERIES;
}

static double time_model(const gonio_model *m, const queries *q) {
    const double start = now_s();
    float values[GONIO_CHANNELS_MAX];
    double sum = 0;
    for (size_t i = 0; i < QUERIES; i++) {
        gonio_model_eval_f32(m, q->wi[i], q->wo[i], values);
        sum += values[0];
    }
    sink = sum;
    return (now_s() - start) / QUERIES;
}

// What a renderer without Gonio would do: coordinates, then the plain sum.
static double time_plain_model(const oracle_lattice *o, const queries *q) {
    const double start = now_s();
    double sum = 0;
    for (size_t i = 0; i < QUERIES; i++) {
        double x[3];
        gonio_coordinates_isotropic(GONIO_NUSSELT, q->wi[i], q->wo[i], x);
        sum += oracle_eval(o, x);
    }
    sink = sum;
    return (now_s() - start) / QUERIES;
}

// A hash of the control points written inline, open addressing: what a probe a point costs at best.
typedef struct inline_hash {
    uint32_t *keys;
    float *values;
    uint32_t mask;
} inline_hash;

static uint32_t slot_of(uint32_t key, uint32_t mask) { return key * 2654435769u >> 7 & mask; }

static inline_hash make_inline_hash(const gonio_sparse *s) {
    inline_hash h = {.mask = 1};
    while (h.mask < 2 * s->keys) {
        h.mask *= 2;
    }
    h.keys = malloc(h.mask * sizeof *h.keys);
    h.values = malloc(h.mask * sizeof *h.values);
    h.mask--;
    memset(h.keys, 0xff, ((size_t)h.mask + 1) * sizeof *h.keys);
    for (size_t i = 0; i < s->keys; i++) {
        uint32_t at = slot_of(gonio_sparse_key(s, i), h.mask);
        while (h.keys[at] != UINT32_MAX) {
            at = (at + 1) & h.mask;
        }
        h.keys[at] = gonio_sparse_key(s, i);
        h.values[at] = s->values[i];
    }
    return h;
}

static double time_inline_hash(const inline_hash *h, const queries *q) {
    const uint32_t n = (1u << LEVEL) + 3;
    const double start = now_s();
    double total = 0;
    for (size_t s = 0; s < QUERIES / 10; s++) {
        double t, b[3][4];
        uint32_t cell[3];
        for (int d = 0; d < 3; d++) {
            cell[d] = (uint32_t)oracle_cell(q->x[3 * s + (size_t)d], LEVEL, &t);
            oracle_basis(t, b[d]);
        }
        for (uint32_t p = 0; p < 64; p++) {
            const uint32_t key = ((cell[0] + p / 16) * n + cell[1] + p / 4 % 4) * n + cell[2] + p % 4;
            uint32_t at = slot_of(key, h->mask);
            while (h->keys[at] != UINT32_MAX && h->keys[at] != key) {
                at = (at + 1) & h->mask;
            }
            total += h->keys[at] == key ? b[0][p / 16] * b[1][p / 4 % 4] * b[2][p % 4] * (double)h->values[at] : 0;
        }
    }
    sink = total;
    return (now_s() - start) / (QUERIES / 10);
}

static double rmse_of(const gonio_model *m, const queries *q) {
    gonio_errors errors;
    gonio_error error = {0};
    check(gonio_errors_model(m, q->truth, NULL, 0, &errors, &error), &error);
    return errors.rmse;
}

static gonio_model *fit_model(const problem *p, const char *method, const char *storage, double drop) {
    gonio_fit_options o;
    gonio_model *m;
    gonio_error error = {0};
    gonio_fit_options_default(&o);
    o.method = method;
    o.level = LEVEL;
    o.coordinates = GONIO_NUSSELT;
    o.domain = GONIO_LINEAR;
    o.hold_out = 0;
    o.storage = storage;
    o.diffuse_level = 4;
    o.drop_percent = drop;
    gonio_fit_options_for(&o, method); // without what it does not have
    check(gonio_fit(p->samples, &o, &m, NULL, &error), &error);
    return m;
}

static double time_open(const char *path, gonio_status (*open_model)(const char *, gonio_model **, gonio_error *)) {
    double best = INFINITY;
    gonio_error error = {0};
    for (int r = 0; r < 20; r++) {
        gonio_model *m;
        const double start = now_s();
        check(open_model(path, &m, &error), &error);
        best = fmin(best, now_s() - start);
        gonio_model_free(m);
    }
    return best;
}

static void bench_eval(const char *spec) {
    problem p = make_problem(spec, 140000, 1);
    queries q = make_queries(spec);
    oracle_lattice o;
    time_plain(&p, &o);
    gonio_model *dense = fit_model(&p, "mba", NULL, 0);
    const gonio_lattice *l = gonio_lattice_model_lattice(dense);
    float *values = malloc(QUERIES * sizeof *values);
    double plain = INFINITY, single = INFINITY, batched = INFINITY, plain_pair = INFINITY, pair = INFINITY;
    for (int r = 0; r < 3 * REPEATS; r++) {
        plain = fmin(plain, time_plain_eval(&o, &q));
        single = fmin(single, time_single_eval(l, &q, q.positions));
        batched = fmin(batched, time_batched_eval(l, q.positions, values));
        plain_pair = fmin(plain_pair, time_plain_model(&o, &q));
        pair = fmin(pair, time_model(dense, &q));
    }
    printf("evaluation, %s: plain %.1f, fast %.1f, batched %.1f ns; from direction pairs: plain %.1f, fast %.1f ns\n",
           spec, plain * 1e9, single * 1e9, batched * 1e9, plain_pair * 1e9, pair * 1e9);
    verdict("one random evaluation / plain", single / plain, 1 / 2.3, false);
    verdict("batched / plain", batched / plain, 1.0 / 3, false);
    verdict("from a direction pair / plain", pair / plain_pair, 1 / 1.5, false);
    const double dense_rmse = rmse_of(dense, &q);
    static const double drops[] = {95, 99};
    static const char *const storages[] = {"float", "half", "byte", "hash", "jenkins"};
    for (size_t d = 0; d < 2; d++) {
        for (size_t k = 0; k < 5; k++) {
            gonio_model *m = fit_model(&p, "cbmba", storages[k], drops[d]);
            double ns = INFINITY;
            for (int r = 0; r < REPEATS; r++) {
                ns = fmin(ns, time_model(m, &q) * 1e9);
            }
            const double share = (double)m->bytes / ((double)l->count * 4), rmse = rmse_of(m, &q) / dense_rmse;
            printf(" (4,6,%g) %-5s: %6.1f ns, %7zu bytes (%.2f %% of dense), held-out RMSE %.5f times dense's\n",
                   drops[d], storages[k], ns, m->bytes, share * 100, rmse);
            if (k == 2) {
                verdict("its evaluation / plain dense evaluation", ns / (plain_pair * 1e9), 1, false);
                verdict("its bytes / dense bytes", share, d == 0 ? 0.08 : 0.04, false);
                verdict("its held-out RMSE / dense", rmse, 1.005, false);
            }
            if (k == 4) {
                verdict("its evaluation / plain dense evaluation", ns / (plain_pair * 1e9), 5, false);
            }
            gonio_model_free(m);
        }
    }
    gonio_samples *samples = p.samples;
    gonio_scatter s;
    gonio_lattice diffuse, specular;
    gonio_bilevel_parts parts;
    gonio_error error = {0};
    check(gonio_scatter_init(&s, samples, &plain_form, &error), &error);
    check(gonio_bilevel_split(&s, NULL, 4, 5, LEVEL, 1, &diffuse, &specular, &error), &error);
    check(gonio_bilevel_pack(&diffuse, &specular, 95, GONIO_STORAGE_HASH, &parts, &error), &error);
    const inline_hash h = make_inline_hash(&parts.sparse);
    printf(" an inline hash a control point, specular part alone: %.1f ns, %zu bytes\n", time_inline_hash(&h, &q) * 1e9,
           ((size_t)h.mask + 1) * 8);
    free(h.keys);
    free(h.values);
    gonio_bilevel_parts_release(&parts);
    gonio_lattice_release(&diffuse);
    gonio_lattice_release(&specular);
    gonio_scatter_release(&s);
    const char *path = "/tmp/gonio_bench.model";
    struct stat info;
    check(gonio_model_save(dense, path, &error), &error);
    stat(path, &info);
    verdict("dense model file / 4 bytes a control point", (double)info.st_size / ((double)l->count * 4), 1.05, false);
    printf("  opening it, checksum and all: %.0f us; mapping it without: %.0f us\n",
           1e6 * time_open(path, gonio_model_open), 1e6 * time_open(path, gonio_model_map));
    unlink(path);
    free(values);
    free(o.points);
    gonio_model_free(dense);
    free_queries(&q);
    free_problem(&p);
}

static int by_cell(const void *left, const void *right) {
    const gonio_position *a = left, *b = right;
    for (int d = 0; d < 3; d++) {
        if (a->x[d] >> 26 != b->x[d] >> 26) {
            return a->x[d] >> 26 < b->x[d] >> 26 ? -1 : 1;
        }
    }
    return 0;
}

static void bench_spectral(void) {
    problem p = make_problem(specs[0], 140000, 31);
    queries q = make_queries(specs[0]);
    oracle_lattice o;
    gonio_lattice l;
    double scale, wall = INFINITY, plain = INFINITY, fast = INFINITY, plain_eval = INFINITY, random = INFINITY,
                  sorted = INFINITY;
    for (int r = 0; r < REPEATS; r++) {
        plain = fmin(plain, time_plain(&p, &o));
        if (r > 0) {
            gonio_lattice_release(&l);
        }
        fast = fmin(fast, time_fast(&p, 1, &l, &scale, &wall));
        if (r < REPEATS - 1) {
            free(o.points);
        }
    }
    float *values = malloc(QUERIES * 31 * sizeof *values);
    memset(values, 0, QUERIES * 31 * sizeof *values);
    gonio_position *order = malloc(QUERIES * sizeof *order);
    memcpy(order, q.positions, QUERIES * sizeof *order);
    qsort(order, QUERIES, sizeof *order, by_cell);
    for (int r = 0; r < REPEATS; r++) {
        plain_eval = fmin(plain_eval, time_plain_eval(&o, &q));
        random = fmin(random, time_batched_eval(&l, q.positions, values));
        sorted = fmin(sorted, time_batched_eval(&l, order, values));
    }
    printf("31 channels, 140000 samples: fit %.1f ns a sample and level (plain, one channel: %.1f); evaluation of all: "
           "random %.1f, sorted %.1f ns (plain, one: %.1f)\n",
           fast * 1e9 / 140000 / 7, plain * 1e9 / 140000 / 7, random * 1e9, sorted * 1e9, plain_eval * 1e9);
    verdict("31-channel fit / plain one-channel fit", fast / plain, 2, false);
    verdict("31 channels sorted / plain one channel", sorted / plain_eval, 3, false);
    verdict("31 channels random / plain one channel", random / plain_eval, 8, false);
    free(order);
    free(values);
    free(o.points);
    gonio_lattice_release(&l);
    free_queries(&q);
    free_problem(&p);
}

int main(void) {
    bench_fit(specs[0], 1400);
    bench_fit(specs[0], 14000);
    for (size_t k = 0; k < 2; k++) {
        bench_fit(specs[k], 140000);
        bench_fit(specs[k], 1400000);
    }
    bench_eval(specs[0]);
    bench_eval(specs[1]);
    bench_spectral();
    printf("%d figures missed\n", failures);
    return 0;
}
