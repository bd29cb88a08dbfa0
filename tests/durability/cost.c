// SPDX-License-Identifier: BSD-3-Clause
// Measures with frames of 1.3 megapixels, in pairs: as users measure, and with sync=off.
#include "tests/durability/cost.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

#include "tests/durability/run.h"
#include "tests/durability/tree.h"

enum { PAIRS_MAX = 50 };

static double wall_s(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static bool measure(runner *r, const char *session, bool sync, double *seconds, run_result *result) {
    const shim_order order = {.mode = SHIM_OFF};
    tree_remove(session);
    const double begun = wall_s();
    RUN(r, &order, result, "measure", "--json", "--threads", "2", "--sample", "ward:rho_d=0.3,rho_s=0.2,alpha=0.3",
        "--plan", "uniform:60", "--method", "mba", "--level", "2", "--hold-out", "0", "--set",
        "scan.dark_frames=8,scan.reference_frames=8,camera.width=1280,camera.height=1024,camera.window=full,reference."
        "panel_mm=500",
        "--set", sync ? "sync=on" : "sync=off", session);
    *seconds = wall_s() - begun;
    tree_remove(session);
    if (result->status != 0) {
        fprintf(stderr, "measure ends with %d: %s\n", result->status, result->message);
    }
    return result->status == 0;
}

static int by_size(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *values, int n) {
    qsort(values, (size_t)n, sizeof *values, by_size);
    return n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
}

static bool one_pair(runner *r, const char *session, int i, double *waits, double *shares) {
    double on, off;
    run_result with = {0}, without = {0};
    // Each comes first in every other pair.
    const bool good = i % 2 == 0 ? measure(r, session, true, &on, &with) && measure(r, session, false, &off, &without)
                                 : measure(r, session, false, &off, &without) && measure(r, session, true, &on, &with);
    if (good) {
        const int64_t *t = with.timers_ns;
        const double scale = 1e-7 / on;
        *waits = 100 * (on - off) / on;
        *shares = scale * (double)(t[SHIM_T_HASH] + t[SHIM_T_CHAIN]);
        printf("%lld frames: %.2f s, sync=off %.2f s: %.1f %%; hashes %.2f %%, chain %.2f %%, journal %.2f %%, "
               "compression "
               "%.1f %%, waiting for the disk %.1f %%\n",
               (long long)json_integer_value(json_object_get(with.json, "frames")), on, off, *waits,
               scale * (double)t[SHIM_T_HASH], scale * (double)t[SHIM_T_CHAIN], scale * (double)t[SHIM_T_JOURNAL],
               scale * (double)t[SHIM_T_COMPRESS], scale * (double)t[SHIM_T_SYNC]);
        fflush(stdout);
    }
    run_free(&with);
    run_free(&without);
    return good;
}

bool cost_tell(const char *program, const char *shim, const char *folder, int pairs) {
    double waits[PAIRS_MAX], shares[PAIRS_MAX];
    char session[SHIM_PATH];
    pairs = pairs < 1 ? 3 : pairs > PAIRS_MAX ? PAIRS_MAX : pairs;
    snprintf(session, sizeof session, "%.900s/cost-session", folder);
    runner *r = runner_start(program, shim, folder);
    bool good = r != NULL;
    if (good) {
        runner_bound(r, 3600);
    }
    for (int i = 0; good && i < pairs; i++) {
        good = one_pair(r, session, i, &waits[i], &shares[i]);
    }
    if (good) {
        printf("= of the wall time of a measure, medians of %d pairs: against sync=off %.1f %% (10 at most), hashes "
               "and chain "
               "%.2f %% (3 at most)\n",
               pairs, median(waits, pairs), median(shares, pairs));
    }
    runner_stop(r);
    return good;
}
