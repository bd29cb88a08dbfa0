// SPDX-License-Identifier: BSD-3-Clause
// Poses -> samples: outgoing directions one by one, rays doubled until every pose of a direction is known well enough.
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/random.h"
#include "base/thread_pool.h"
#include "scene/patch/rays.h"

#define THETA_MAX_DEG 89.5
#define ROUNDING 1e-6               // relative, of float32's rays
#define FLOOR 0.02                  // of a direction's mean value: darker poses are brought to this absolute error
#define PIECE 1024                  // rays of a replicate between two looks at whether to stop
#define TABLE_MAX ((size_t)1 << 22) // values of a direction's table

// A pose of the plan, to be sorted by its outgoing direction.
typedef struct ordered {
    double theta_o, phi_o;
    size_t pose;
} ordered;

typedef struct group {
    size_t first, n; // of order
} group;

typedef struct run {
    const gonio_patch *patch;
    const gonio_plan *plan;
    const gonio_virtual_options *options;
    ordered *order; // those of one outgoing direction together
    group *groups;
    size_t group_count;
    gonio_samples *samples;
    gonio_pool *pool;
    // What the threads share.
    pthread_mutex_t mutex;
    patch_counts counts;
    size_t missed, finished;
    double started_s;
    atomic_bool stopped, no_memory;
} run;

void gonio_virtual_options_default(gonio_virtual_options *options) {
    *options = (gonio_virtual_options){.seed = 1, .target = 0.01, .rays = 256, .rays_max = 65536};
}

static gonio_status check(const gonio_plan *plan, const gonio_virtual_options *o, gonio_error *error) {
    if (!(o->target > 0 && o->target <= 1)) {
        return gonio_fail(error, GONIO_E_RANGE, "a standard error of %g; above 0, up to 1 is possible", o->target);
    }
    if (o->rays < 1 || o->rays_max < o->rays || o->rays_max > (size_t)1 << 32) {
        return gonio_fail(error, GONIO_E_RANGE,
                          "%zu to %zu rays for each direction; 1 to 2^32, the most not below the least", o->rays,
                          o->rays_max);
    }
    for (size_t i = 0; i < plan->n; i++) {
        const double in = gonio_degrees(plan->poses[i].theta_i), out = gonio_degrees(plan->poses[i].theta_o);
        if (!(in <= THETA_MAX_DEG + 1e-9 && out <= THETA_MAX_DEG + 1e-9)) {
            return gonio_fail(error, GONIO_E_RANGE,
                              "pose %zu: theta_i %g, theta_o %g deg; a virtual goniometer sees up to %g", i + 1, in,
                              out, THETA_MAX_DEG);
        }
        if (!(o->light_half_deg >= 0 && in + o->light_half_deg <= 90 + 1e-9 && o->camera_half_deg >= 0 &&
              out + o->camera_half_deg <= 90 + 1e-9)) {
            return gonio_fail(
                error, GONIO_E_RANGE,
                "pose %zu: theta_i %g +- %g, theta_o %g +- %g deg; lamp and aperture must lie above the horizon", i + 1,
                in, o->light_half_deg, out, o->camera_half_deg);
        }
    }
    return plan->n > 0 ? GONIO_OK : gonio_fail(error, GONIO_E_INPUT, "the plan has no poses");
}

// ---- poses by outgoing direction ----

static int by_outgoing(const void *a, const void *b) {
    const ordered *p = a, *q = b;
    if (p->theta_o != q->theta_o) {
        return p->theta_o < q->theta_o ? -1 : 1;
    }
    if (p->phi_o != q->phi_o) {
        return p->phi_o < q->phi_o ? -1 : 1;
    }
    return (p->pose > q->pose) - (p->pose < q->pose);
}

static bool make_groups(run *r) {
    const size_t n = r->plan->n;
    r->order = malloc(n * sizeof *r->order);
    r->groups = malloc(n * sizeof *r->groups);
    if (r->order == NULL || r->groups == NULL) {
        return false;
    }
    for (size_t i = 0; i < n; i++) {
        r->order[i] = (ordered){r->plan->poses[i].theta_o, r->plan->poses[i].phi_o, i};
    }
    qsort(r->order, n, sizeof *r->order, by_outgoing);
    for (size_t k = 0; k < n; k++) {
        const ordered *p = &r->order[k], *before = p - 1;
        if (k == 0 || before->theta_o != p->theta_o || before->phi_o != p->phi_o) {
            r->groups[r->group_count++] = (group){k, 0};
        }
        r->groups[r->group_count - 1].n++;
    }
    return true;
}

// ---- one outgoing direction ----

typedef struct estimate {
    patch_rays rays;
    gonio_vec3 *wi;
    bool *done;
    double *table;
    uint32_t *used; // [n]: rays of a replicate that a pose's sums hold
} estimate;

static bool allocate(const run *r, const group *g, estimate *e) {
    const size_t channels = (size_t)r->patch->channels, classes = (size_t)gonio_patch_tile_classes(r->patch->tile);
    const size_t table = classes * g->n * channels;
    // Parallel light and a camera far away meet a facet under the same angles wherever it lies.
    const bool same = r->options->light_half_deg == 0 && r->options->camera_half_deg == 0;
    e->wi = malloc(g->n * sizeof *e->wi);
    e->done = calloc(g->n, sizeof *e->done);
    e->used = calloc(g->n, sizeof *e->used);
    e->rays.sums = calloc(g->n * PATCH_REPLICATES * channels, sizeof *e->rays.sums);
    e->table = same && table <= TABLE_MAX && classes <= r->options->rays ? malloc(table * sizeof *e->table) : NULL;
    return e->wi != NULL && e->done != NULL && e->used != NULL && e->rays.sums != NULL;
}

static void release(estimate *e) {
    free(e->wi);
    free(e->done);
    free(e->used);
    free(e->rays.sums);
    free(e->table);
}

// Mean and standard error over the replicates, as BRDF.
static void finish_value(const run *r, const estimate *e, size_t i, int c, double *value, double *sigma) {
    const size_t channels = (size_t)r->patch->channels;
    const double widened = (1 + cos(gonio_radians(r->options->light_half_deg))) / 2; // mean cosine over the lamp's cone
    const double scale = 1 / (e->used[i] * e->wi[i].z * widened);
    double mean = 0, squares = 0;
    for (size_t k = 0; k < PATCH_REPLICATES; k++) {
        mean += e->rays.sums[(i * PATCH_REPLICATES + k) * channels + (size_t)c] * scale / PATCH_REPLICATES;
    }
    for (size_t k = 0; k < PATCH_REPLICATES; k++) {
        const double d = e->rays.sums[(i * PATCH_REPLICATES + k) * channels + (size_t)c] * scale - mean;
        squares += d * d;
    }
    *value = mean;
    *sigma = sqrt(squares / (PATCH_REPLICATES * (PATCH_REPLICATES - 1.0)));
}

static double mean_value(const run *r, const estimate *e) {
    double total = 0, value, sigma;
    for (size_t i = 0; i < e->rays.n; i++) {
        for (int c = 0; c < r->patch->channels; c++) {
            finish_value(r, e, i, c, &value, &sigma);
            total += value;
        }
    }
    return total / (double)(e->rays.n * (size_t)r->patch->channels);
}

// The largest of the channels' errors over what the target allows.
static double excess(const run *r, const estimate *e, size_t i, double mean) {
    double worst = 0, value, sigma;
    for (int c = 0; c < r->patch->channels; c++) {
        finish_value(r, e, i, c, &value, &sigma);
        const double allowed = r->options->target * fmax(value, FLOOR * mean);
        worst = allowed > 0 ? fmax(worst, sigma / allowed) : worst;
    }
    return worst;
}

// Marks the poses that are known well enough; true when all are.
static bool settle(const run *r, estimate *e) {
    bool all = true;
    for (size_t i = 0; i < e->rays.n; i++) {
        e->used[i] = e->done[i] ? e->used[i] : e->rays.to;
    }
    const double mean = mean_value(r, e);
    for (size_t i = 0; i < e->rays.n; i++) {
        e->done[i] = e->done[i] || excess(r, e, i, mean) <= 1;
        all = all && e->done[i];
    }
    return all;
}

// A pose that no ray has found lit is not known to be black: one ray in all of them might have been.
static void write_out(run *r, const group *g, const estimate *e) {
    const size_t channels = (size_t)r->patch->channels;
    const double mean = mean_value(r, e);
    size_t missed = 0;
    for (size_t i = 0; i < g->n; i++) {
        const size_t pose = r->order[g->first + i].pose;
        const double least = mean / ((double)e->used[i] * PATCH_REPLICATES);
        missed += !e->done[i];
        for (int c = 0; c < r->patch->channels; c++) {
            double value, sigma;
            finish_value(r, e, i, c, &value, &sigma);
            r->samples->values[pose * channels + (size_t)c] = value;
            r->samples->sigma_random[pose * channels + (size_t)c] = value > 0 ? fmax(sigma, ROUNDING * value) : least;
        }
    }
    pthread_mutex_lock(&r->mutex);
    for (size_t k = 0; k < PATCH_REPLICATES; k++) {
        r->counts.camera += e->rays.counts[k].camera;
        r->counts.shadow += e->rays.counts[k].shadow;
        r->counts.bounces += e->rays.counts[k].bounces;
        r->counts.fell += e->rays.counts[k].fell;
    }
    r->missed += missed;
    r->finished += g->n;
    pthread_mutex_unlock(&r->mutex);
}

static void tell(run *r) {
    const gonio_virtual_options *o = r->options;
    const double seconds = fmax(gonio_clock_s() - r->started_s, 1e-9);
    pthread_mutex_lock(&r->mutex);
    if (o->progress != NULL && !r->stopped) {
        const uint64_t rays = r->counts.camera + r->counts.shadow + r->counts.bounces;
        r->stopped =
            !o->progress(o->progress_context, (double)r->finished / (double)r->plan->n, (double)rays / seconds);
    }
    pthread_mutex_unlock(&r->mutex);
}

// The rays from..to of every replicate, in pieces after which the work may be stopped.
static void trace(run *r, estimate *e, uint32_t from, uint32_t to) {
    for (e->rays.from = from; e->rays.from < to && !r->stopped; e->rays.from = e->rays.to) {
        e->rays.to = to - e->rays.from > PIECE ? e->rays.from + PIECE : to;
        gonio_pool_run(r->pool, PATCH_REPLICATES, gonio_patch_rays_trace, &e->rays);
        tell(r);
    }
}

static void measure_group(void *context, size_t item) {
    run *r = context;
    const group *g = &r->groups[item];
    estimate e = {.wi = NULL};
    if (r->stopped || r->no_memory || !allocate(r, g, &e)) {
        r->no_memory = r->no_memory || (!r->stopped && e.wi == NULL);
        release(&e);
        return;
    }
    const gonio_pair *o = &r->plan->poses[r->order[g->first].pose];
    double *sums = e.rays.sums;
    for (size_t i = 0; i < g->n; i++) {
        const gonio_pair *p = &r->plan->poses[r->order[g->first + i].pose];
        e.wi[i] = gonio_direction(p->theta_i, p->phi_i);
    }
    e.rays = (patch_rays){.patch = r->patch,
                          .options = r->options,
                          .seed = gonio_random(r->options->seed * 0x9e37u + item),
                          .wo = gonio_direction(o->theta_o, o->phi_o),
                          .n = g->n,
                          .wi = e.wi,
                          .done = e.done,
                          .sums = sums};
    if (e.table != NULL) {
        gonio_patch_rays_table(&e.rays, e.table);
        e.rays.table = e.table;
    }
    uint32_t to = PATCH_PACKET;
    while ((size_t)to * PATCH_REPLICATES < r->options->rays) {
        to *= 2;
    }
    const uint32_t most = (uint32_t)(r->options->rays_max / PATCH_REPLICATES);
    bool good = false;
    for (uint32_t from = 0; !good && !r->stopped && (from == 0 || to <= most); from = to, to *= 2) {
        trace(r, &e, from, to);
        good = settle(r, &e);
    }
    write_out(r, g, &e);
    release(&e);
}

// ---- all ----

static gonio_status make_samples(run *r, gonio_samples **out, gonio_error *error) {
    const size_t channels = (size_t)r->patch->channels;
    gonio_status status = gonio_samples_new(r->patch->channels, true, out, error);
    status = status == GONIO_OK ? gonio_samples_reserve(*out, r->plan->n, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    gonio_samples *s = r->samples = *out;
    double zeros[channels];
    memset(zeros, 0, sizeof zeros);
    memcpy(s->channel_names, r->patch->channel_names, channels * sizeof *s->channel_names);
    for (size_t i = 0; i < r->plan->n && status == GONIO_OK; i++) {
        // A plan that turns nothing but the camera cannot tell what turning the patch would do.
        s->isotropic = s->isotropic && r->plan->poses[i].phi_i == r->plan->poses[0].phi_i;
        status = gonio_samples_add(s, &r->plan->poses[i], zeros, zeros, zeros, error);
    }
    return status;
}

// Root mean square of the relative errors of what is not dark.
static double relative_error(const gonio_samples *s) {
    const size_t values = s->n * (size_t)s->channels;
    double mean = 0, squares = 0;
    size_t lit = 0;
    for (size_t k = 0; k < values; k++) {
        mean += s->values[k] / (double)values;
    }
    for (size_t k = 0; k < values; k++) {
        if (s->values[k] > FLOOR * mean) {
            const double relative = s->sigma_random[k] / s->values[k];
            squares += relative * relative;
            lit++;
        }
    }
    return lit > 0 ? sqrt(squares / (double)lit) : 0;
}

static gonio_status outcome(const run *r, gonio_virtual_report *report, gonio_error *error) {
    if (report != NULL) {
        *report = (gonio_virtual_report){.camera_rays = r->counts.camera,
                                         .shadow_rays = r->counts.shadow,
                                         .bounces = r->counts.bounces,
                                         .missed = r->missed,
                                         .error = relative_error(r->samples),
                                         .seconds = gonio_clock_s() - r->started_s};
    }
    if (r->stopped) {
        return gonio_fail(error, GONIO_E_INTERRUPTED, "stopped after %zu of %zu poses", r->finished, r->plan->n);
    }
    if (r->no_memory) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the poses of one direction");
    }
    if ((double)r->counts.fell > 1e-4 * (double)r->counts.camera) {
        return gonio_fail(error, GONIO_E_INPUT, "the patch has holes: light falls through %llu times in %llu rays",
                          (unsigned long long)r->counts.fell, (unsigned long long)r->counts.camera);
    }
    return GONIO_OK;
}

gonio_status gonio_virtual_measure(const gonio_patch *patch, const gonio_plan *plan,
                                   const gonio_virtual_options *options, gonio_samples **out,
                                   gonio_virtual_report *report, gonio_error *error) {
    *out = NULL;
    run r = {.patch = patch, .plan = plan, .options = options, .started_s = gonio_clock_s()};
    gonio_status status = check(plan, options, error);
    if (status == GONIO_OK && !make_groups(&r)) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for a plan of %zu poses", plan->n);
    }
    status = status == GONIO_OK ? make_samples(&r, out, error) : status;
    if (status == GONIO_OK) {
        pthread_mutex_init(&r.mutex, NULL);
        r.pool = gonio_pool_new(options->threads);
        gonio_pool_run(r.pool, r.group_count, measure_group, &r);
        gonio_pool_free(r.pool);
        pthread_mutex_destroy(&r.mutex);
        status = outcome(&r, report, error);
    }
    free(r.order);
    free(r.groups);
    if (status != GONIO_OK) {
        gonio_samples_free(*out);
        *out = NULL;
    }
    return status;
}
