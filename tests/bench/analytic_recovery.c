// SPDX-License-Identifier: BSD-3-Clause
// What the fits of formulae recover of random truths: without noise, and with 2 % of it.
//   analytic_recovery [TRUTHS (100; a quarter where there are three lobes or more)] [METHOD]
#include "base/clock.h"
#include "tests/recovery.h"

#define SAMPLES 500

int main(int argc, char **argv) {
    const int asked = argc > 1 ? atoi(argv[1]) : 100;
    printf(
        "| method | lobes | truths from | within 1e-6 | worst of 95 %% | condition > 1e6 | did not converge | with "
        "2 %% "
        "noise within 3 sigma | worst start over the best | ms a fit |\n|---|---|---|---|---|---|---|---|---|---|\n");
    for (size_t k = 0; k < RECOVERY_CASES; k++) {
        const recovery_case *c = &recovery_cases[k];
        if (argc > 2 && strcmp(argv[2], c->method) != 0) {
            continue;
        }
        const int truths = c->lobes <= 2 ? asked : (asked + 3) / 4; // these take seconds each
        int good = 0, hard = 0, stuck = 0, within = 0, parameters = 0;
        double *worst = calloc((size_t)truths, sizeof *worst);
        uint64_t seed = 1 + k;
        const double start = gonio_clock_s();
        for (int t = 0; t < truths; t++) {
            const recovery r = recovery_run(c, SAMPLES, 0, &seed);
            const bool ill = !(r.condition <= 1e6);
            worst[t] = ill ? r.f_worst : r.worst;
            good += worst[t] <= 1e-6;
            hard += ill;
            stuck += !r.converged;
            for (int a = t; a > 0 && worst[a] < worst[a - 1]; a--) {
                const double kept = worst[a];
                worst[a] = worst[a - 1];
                worst[a - 1] = kept;
            }
        }
        const double ms = 1e3 * (gonio_clock_s() - start) / truths;
        double spread = 0;
        for (int t = 0; t < truths; t++) {
            const recovery r = recovery_run(c, SAMPLES, 0.02, &seed);
            spread += r.spread / truths;
            within += r.within;
            parameters += r.parameters;
        }
        printf("| %s%s | %d | %s | %d of %d | %.1e | %d | %d | %.1f %% | %.3g | %.1f |\n", c->method,
               c->isotropic ? "" : ", anisotropic", c->lobes, c->source, good, truths,
               worst[(95 * truths + 99) / 100 - 1], hard, stuck, 100.0 * within / parameters, spread, ms);
        fflush(stdout);
        free(worst);
    }
    return 0;
}
