// The fitter's figures, as ratios against the plain transcription of the thesis in the same run.
#include <stdio.h>
#include <time.h>

#include "fit/lattice.h"
#include "fit/mba.h"
#include "fit/scatter.h"
#include "gonio/fit.h"
#include "tests/golden/oracle.h"

static double now_s(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

// SplitMix64 (Steele, Lea and Flood 2014): a fixed stream of uniform numbers in [0, 1).
static double uniform(uint64_t *state) {
    uint64_t x = *state += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return (double)((x ^ (x >> 31)) >> 11) * 0x1p-53;
}

// Directions uniform on the hemisphere up to 85 deg.
static gonio_pair random_pair(uint64_t *state) {
    const double z = cos(85 * GONIO_PI / 180);
    const double ti = acos(1 - uniform(state) * (1 - z)), to = acos(1 - uniform(state) * (1 - z));
    return (gonio_pair){ti, 0, to, 2 * GONIO_PI * uniform(state)};
}

static gonio_samples *simulate(const char *spec, size_t n, int channels, uint64_t seed) {
    gonio_model *truth;
    gonio_samples *samples;
    gonio_error error = {0};
    if (gonio_model_from_spec(spec, &truth, &error) != GONIO_OK ||
        gonio_samples_new(channels, false, &samples, &error) != GONIO_OK) {
        fprintf(stderr, "%s\n", error.message);
        exit(1);
    }
    gonio_samples_reserve(samples, n, NULL);
    for (size_t i = 0; i < n; i++) {
        const gonio_pair pair = random_pair(&seed);
        double values[channels];
        gonio_model_eval_pair(truth, &pair, values);
        for (int c = channels - 1; c >= 0; c--) {
            values[c] = values[0] * (1 + 0.01 * c);
        }
        gonio_samples_add(samples, &pair, values, NULL, NULL, NULL);
    }
    gonio_model_free(truth);
    return samples;
}

int main(void) {
    for (size_t n = 14000; n <= 1400000; n *= 10) {
        gonio_samples *samples = simulate("ward:rho_d=0.3,rho_s=0.2,alpha=0.15", n, 1, 1);
        double *x = malloc(n * 3 * sizeof *x), *residual = malloc(n * sizeof *residual);
        for (size_t i = 0; i < n; i++) {
            gonio_scatter_locate(GONIO_NUSSELT, 3, &samples->pairs[i], x + 3 * i);
            residual[i] = samples->values[i];
        }
        double t0 = now_s();
        oracle_lattice o = oracle_fit(6, n, x, residual);
        double plain = now_s() - t0;
        printf("%zu plain: %.4f s, %.1f ns/sample/level\n", n, plain, plain / (double)n / 7 * 1e9);
        gonio_scatter_options so = {GONIO_NUSSELT, GONIO_LINEAR, 0, false};
        for (int rep = 0; rep < 3; rep++) {
            gonio_scatter s;
            t0 = now_s();
            gonio_scatter_init(&s, samples, &so, NULL);
            double prep = now_s() - t0;
            for (int th = 1; th <= 2; th++) {
                gonio_mba *m;
                t0 = now_s();
                gonio_mba_new(&s, NULL, th, &m, NULL);
                double last = now_s();
                printf("levels:");
                for (int h = 0; h <= 6; h++) {
                    gonio_mba_next(m, NULL);
                    double t = now_s();
                    printf(" %.2f", (t - last) * 1e3);
                    last = t;
                }
                double fast = now_s() - t0;
                double worst = 0;
                const gonio_lattice *l = gonio_mba_lattice(m);
                for (size_t i = 0; i < l->count; i++)
                    worst = fmax(worst, fabs((double)l->points[i] * s.transforms[0].scale - o.points[i]));
                printf("  prep %.4f fit(%d) %.4f s %.1f ns ratio %.2f; diff %.3g\n", prep, th, fast,
                       fast / (double)n / 7 * 1e9, plain / fast, worst);
                gonio_mba_free(m);
            }
            gonio_scatter_release(&s);
        }
        free(o.points);
        free(x);
        free(residual);
        gonio_samples_free(samples);
    }
}
