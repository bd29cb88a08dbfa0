// SPDX-License-Identifier: BSD-3-Clause
// The poses after which least is unknown of a material of the library: greedy, by the expected variance of z.
//
// A sample at x takes k(x, y)^2 / (k(x, x) + noise) of the variance at y away (fit/design/design.h); what is chosen
// depends on the library alone, so the whole plan is made beforehand.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "base/sobol.h"
#include "base/thread_pool.h"
#include "fit/design/design.h"
#include "fit/library/library.h"
#include "fit/smooth/matrix.h"

#define SPREAD 1024 // candidates over all pairs, and about the mirror direction
#define MIRROR 512
#define NOISE 1e-4 // variance of z: 1 %
#define POSES_MAX 1000

typedef struct planning {
    const gonio_library *learnt;
    size_t n;
    library_place *places;
    double *components, *covariance, *column, *gain;
    double scale;
} planning;

static gonio_pair candidate(size_t i, double theta_max, uint64_t seed) {
    if (i >= SPREAD) {
        return gonio_design_mirror_place(seed % 65536 * MIRROR + i - SPREAD, true, theta_max);
    }
    const double radius = sin(theta_max), limit = gonio_degrees(theta_max);
    const double deg[3] = {gonio_degrees(asin(radius * gonio_sobol((uint32_t)i, 0, seed))),
                           gonio_degrees(asin(radius * sqrt(gonio_sobol((uint32_t)i, 1, seed)))),
                           180 * gonio_sobol((uint32_t)i, 2, seed)};
    return (gonio_pair){gonio_radians(fmin(round(deg[0] * 1e4) / 1e4, limit)), 0,
                        gonio_radians(fmin(round(deg[1] * 1e4) / 1e4, limit)),
                        gonio_radians(round(deg[2] * 1e4) / 1e4)};
}

static void fill_row(void *context, size_t i) {
    const planning *p = context;
    for (size_t j = 0; j < p->n; j++) {
        p->covariance[i * p->n + j] = gonio_library_covariance(p->learnt, &p->places[i], &p->places[j]);
    }
}

// Only pairs spread over all count as targets: where the figures are taken.
static void gain_row(void *context, size_t i) {
    const planning *p = context;
    const double *row = p->covariance + i * p->n;
    p->gain[i] = gonio_dot(SPREAD, row, row) / (row[i] + NOISE);
}

static void condition_row(void *context, size_t i) {
    const planning *p = context;
    gonio_add_scaled(p->n, -p->column[i] * p->scale, p->column, p->covariance + i * p->n);
}

static void choose(planning *p, int threads, gonio_plan *plan, size_t n) {
    gonio_pool *pool = gonio_pool_new(threads);
    gonio_pool_run(pool, p->n, fill_row, p);
    for (plan->n = 0; plan->n < n; plan->n++) {
        size_t best = 0;
        gonio_pool_run(pool, p->n, gain_row, p);
        for (size_t i = 1; i < p->n; i++) {
            best = p->gain[i] > p->gain[best] ? i : best;
        }
        plan->poses[plan->n] = p->places[best].pair;
        memcpy(p->column, p->covariance + best * p->n, p->n * sizeof *p->column);
        p->scale = 1 / (p->column[best] + NOISE);
        gonio_pool_run(pool, p->n, condition_row, p);
    }
    gonio_pool_free(pool);
}

bool gonio_library_plan_is(const char *text) { return strncmp(text, "prior:", 6) == 0; }

// ",N=20,theta_max=85" behind the file's name.
static gonio_status parse(const char *text, const char *options, size_t *n, double *theta_max_deg, gonio_error *error) {
    for (const char *at = options; *at != 0;) {
        const char *item = at + 1;
        const bool count = strncmp(item, "N=", 2) == 0, angle = strncmp(item, "theta_max=", 10) == 0;
        const char *value = item + (count ? 2 : 10);
        char *end = NULL;
        const double number = count || angle ? gonio_number_parse(value, &end) : 0;
        const bool whole = end != NULL && end != value && (*end == 0 || *end == ',');
        if (!whole || (count && !(number >= 1 && number <= POSES_MAX && number == floor(number))) ||
            (angle && !(number >= 5 && number <= 90))) {
            return gonio_fail(error, GONIO_E_USAGE,
                              "plan '%.80s', character %zu: found '%.40s', expected N=1 to %d or theta_max=5 to 90",
                              text, (size_t)(item - text) + 1, item, POSES_MAX);
        }
        *n = count ? (size_t)number : *n;
        *theta_max_deg = angle ? number : *theta_max_deg;
        at = end;
    }
    return GONIO_OK;
}

gonio_status gonio_library_plan_make(const char *text, uint64_t seed, int threads, gonio_plan **out,
                                     gonio_error *error) {
    const char *name = text + strlen("prior:"), *options = strchr(name, ',');
    const size_t length = options != NULL ? (size_t)(options - name) : strlen(name);
    size_t n = 20;
    double theta_max_deg = 85;
    gonio_library *library;
    char path[4096];
    *out = NULL;
    gonio_status status = parse(text, options != NULL ? options : "", &n, &theta_max_deg, error);
    if (status == GONIO_OK && (length == 0 || length >= sizeof path)) {
        status = gonio_fail(error, GONIO_E_USAGE, "plan '%.80s', character 7: expected a file that `gonio learn` wrote",
                            text);
    }
    if (status == GONIO_OK) {
        snprintf(path, sizeof path, "%.*s", (int)length, name);
        status = gonio_library_open(path, &library, error);
    }
    if (status == GONIO_OK) {
        status = gonio_library_plan(library, n, gonio_radians(theta_max_deg), seed, threads, out, error);
        gonio_library_free(library);
    }
    return status;
}

gonio_status gonio_library_plan(const gonio_library *library, size_t n, double theta_max, uint64_t seed, int threads,
                                gonio_plan **out, gonio_error *error) {
    const size_t m = SPREAD + MIRROR, rank = (size_t)library->rank;
    *out = NULL;
    if (n < 1 || n > POSES_MAX) {
        return gonio_fail(error, GONIO_E_USAGE, "a prior's plan of %zu poses; expected 1 to %d", n, POSES_MAX);
    }
    planning p = {.learnt = library,
                  .n = m,
                  .places = malloc(m * sizeof *p.places),
                  .components = malloc(m * rank * sizeof *p.components),
                  .covariance = malloc((m + 2) * m * sizeof *p.covariance)};
    gonio_plan *plan = calloc(1, sizeof *plan);
    gonio_pair *poses = malloc(n * sizeof *poses);
    const bool enough =
        p.places != NULL && p.components != NULL && p.covariance != NULL && plan != NULL && poses != NULL;
    if (enough) {
        p.column = p.covariance + m * m;
        p.gain = p.column + m;
        for (size_t i = 0; i < m; i++) {
            const gonio_pair pair = candidate(i, theta_max, seed);
            gonio_library_place(library, &pair, p.components + i * rank, &p.places[i]);
        }
        plan->poses = poses;
        choose(&p, threads, plan, n);
        *out = plan;
    } else {
        free(plan);
        free(poses);
    }
    free(p.places);
    free(p.components);
    free(p.covariance);
    return enough ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a prior's plan");
}
