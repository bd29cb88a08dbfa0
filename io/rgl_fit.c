// SPDX-License-Identifier: BSD-3-Clause
// The nodes' values of an RGL file that is written (io/rgl_write.c).
//
// The nodes' values are not the model's values there: interpolated linearly, over the incident angles above all, those
// lie too high wherever f_r is convex. They are the least-squares solution of what readers interpolate at random pairs,
// relative to the model's values: unknowns are the nodes' relative changes, held toward 0 where few pairs reach, by
// conjugate gradients on the normal equations.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/random.h"
#include "base/thread_pool.h"
#include "io/rgl.h"

#define ROUNDS 10  // of conjugate gradients
#define HOLD 0.02  // weight of a node's relative change, in pairs
#define PER_NODE 5 // pairs for each node and slice
#define PAIRS_MAX 1200000

// A random pair: which nodes make its value, and the value.
typedef struct row {
    uint32_t slice[4], cell;
    float weight[4], fx, fy;
} row;

typedef struct rows {
    const gonio_model *model;
    gonio_rgl *m;
    size_t n;
    row *at;        // cell UINT32_MAX: below the horizon
    float *targets; // [channels][n]
} rows;

#define BLOCK 1024

static void fill_row(const rows *r, size_t k) {
    gonio_rgl *m = r->m;
    const gonio_rgl_stack *s = &m->spectra;
    double v[4], u[2], x, y, scale, fx, fy, values[GONIO_CHANNELS_MAX];
    for (size_t d = 0; d < 4; d++) {
        v[d] = gonio_random_uniform(gonio_random(11) + (4 * k + d) * GONIO_RANDOM_STEP);
    }
    const size_t t = (size_t)(v[0] * (double)(m->n_theta - 1)),
                 p = (size_t)(v[1] * (double)(m->n_phi > 1 ? m->n_phi - 1 : 1));
    const double ft = v[0] * (double)(m->n_theta - 1) - (double)t;
    const double theta = m->theta_i[t] + ft * (m->theta_i[t + 1] - m->theta_i[t]);
    const double phi = m->n_phi > 1 ? -GONIO_PI + 2 * GONIO_PI * v[1] : 0;
    const gonio_vec3 wi = gonio_direction(theta, phi);
    gonio_rgl_warp(m, p * m->n_theta + t + (ft > 0.5), v[2], v[3], u);
    const gonio_vec3 wo = gonio_rgl_mirrored(wi, u);
    row *to = &r->at[k];
    to->cell = UINT32_MAX;
    if (wo.z < GONIO_RGL_COSINE_LEAST) {
        return;
    }
    const gonio_rgl_blend b = gonio_rgl_locate(m, wi, wo, &x, &y, &scale);
    const size_t ix = gonio_rgl_node(x, s->w, &fx), iy = gonio_rgl_node(y, s->h, &fy);
    for (int i = 0; i < 4; i++) {
        to->slice[i] = (uint32_t)b.slice[i];
        to->weight[i] = (float)b.weight[i];
    }
    to->cell = (uint32_t)(iy * s->w + ix);
    to->fx = (float)fx;
    to->fy = (float)fy;
    gonio_model_eval(r->model, wi, wo, values);
    for (size_t c = 0; c < (size_t)r->model->channels; c++) {
        r->targets[c * r->n + k] = (float)(fmax(values[c], 0) / scale);
    }
}

static void fill_rows(void *context, size_t block) {
    const rows *r = context;
    for (size_t k = block * BLOCK; k < r->n && k < (block + 1) * BLOCK; k++) {
        fill_row(r, k);
    }
}

// One channel's unknowns: the nodes' relative changes.
typedef struct channel_fit {
    const rows *r;
    size_t channels, area, nodes;
    const float *per_target; // [n]
    float *start;            // [nodes] of the channel, slice by slice
} channel_fit;

// out[k] = sum of the row's weights times start times x.
static double row_product(const channel_fit *f, const row *a, const float *x) {
    const size_t w = f->r->m->spectra.w;
    double all = 0;
    for (int i = 0; i < 4; i++) {
        if (a->weight[i] > 0) {
            const size_t at = a->slice[i] * f->area + a->cell;
            const float *s = f->start + at, *v = x + at;
            const double low = (1 - (double)a->fx) * (double)(s[0] * v[0]) + (double)a->fx * (double)(s[1] * v[1]);
            const double high =
                (1 - (double)a->fx) * (double)(s[w] * v[w]) + (double)a->fx * (double)(s[w + 1] * v[w + 1]);
            all += (double)a->weight[i] * ((1 - (double)a->fy) * low + (double)a->fy * high);
        }
    }
    return all;
}

static void row_add(const channel_fit *f, const row *a, double residual, float *out) {
    const size_t w = f->r->m->spectra.w;
    for (int i = 0; i < 4; i++) {
        if (a->weight[i] > 0) {
            const size_t at = a->slice[i] * f->area + a->cell;
            const float *s = f->start + at;
            const double high = residual * (double)a->weight[i] * (double)a->fy;
            const double low = residual * (double)a->weight[i] - high;
            out[at] += (float)(low * (1 - (double)a->fx)) * s[0];
            out[at + 1] += (float)(low * (double)a->fx) * s[1];
            out[at + w] += (float)(high * (1 - (double)a->fx)) * s[w];
            out[at + w + 1] += (float)(high * (double)a->fx) * s[w + 1];
        }
    }
}

// out = (A^T A + HOLD) x, or, of right, A^T (1 - A 1).
static void normal_product(const channel_fit *f, const float *x, bool right, float *out) {
    for (size_t k = 0; k < f->nodes; k++) {
        out[k] = right ? 0 : (float)HOLD * x[k];
    }
    for (size_t k = 0; k < f->r->n; k++) {
        const row *a = &f->r->at[k];
        if (a->cell != UINT32_MAX && f->per_target[k] > 0) {
            const double per = (double)f->per_target[k], value = row_product(f, a, x) * per;
            row_add(f, a, (right ? 1 - value : value) * per, out);
        }
    }
}

static double inner(const float *a, const float *b, size_t n) {
    double all = 0;
    for (size_t k = 0; k < n; k++) {
        all += (double)a[k] * (double)b[k];
    }
    return all;
}

// x, the relative changes; work: 4 arrays of nodes.
static void solve(const channel_fit *f, float *work) {
    const size_t n = f->nodes;
    float *x = work, *residual = work + n, *way = work + 2 * n, *image = work + 3 * n;
    for (size_t k = 0; k < n; k++) {
        x[k] = 1;
    }
    normal_product(f, x, true, residual);
    memset(x, 0, n * sizeof *x);
    memcpy(way, residual, n * sizeof *way);
    double square = inner(residual, residual, n);
    for (int round = 0; round < ROUNDS && square > 0; round++) {
        normal_product(f, way, false, image);
        const double step = square / inner(way, image, n);
        for (size_t k = 0; k < n; k++) {
            x[k] += (float)step * way[k];
            residual[k] -= (float)step * image[k];
        }
        const double next = inner(residual, residual, n);
        for (size_t k = 0; k < n; k++) {
            way[k] = residual[k] + (float)(next / square) * way[k];
        }
        square = next;
    }
}

typedef struct refinement {
    const rows *r;
    bool *failed; // [channels]
} refinement;

static void refine_channel(void *context, size_t channel) {
    const refinement *job_of = context;
    const rows *r = job_of->r;
    gonio_rgl_stack *s = &r->m->spectra;
    channel_fit f = {.r = r, .channels = (size_t)r->model->channels, .area = s->w * s->h};
    const size_t slices = r->m->n_phi * r->m->n_theta;
    f.nodes = slices * f.area;
    float *work = malloc((5 * f.nodes + r->n) * sizeof *work);
    if (work == NULL) {
        job_of->failed[channel] = true;
        return;
    }
    f.start = work + 4 * f.nodes;
    float *per_target = work + 5 * f.nodes;
    double mean = 0;
    for (size_t k = 0; k < r->n; k++) {
        mean += r->at[k].cell != UINT32_MAX ? (double)r->targets[channel * r->n + k] / (double)r->n : 0;
    }
    for (size_t k = 0; k < r->n; k++) {
        const float target = r->targets[channel * r->n + k];
        per_target[k] = r->at[k].cell != UINT32_MAX && (double)target > 1e-4 * mean ? 1 / target : 0;
    }
    f.per_target = per_target;
    for (size_t slice = 0; slice < slices; slice++) {
        memcpy(f.start + slice * f.area, s->values + (slice * f.channels + channel) * f.area, f.area * sizeof(float));
    }
    solve(&f, work);
    for (size_t k = 0; k < f.nodes; k++) {
        s->values[(k / f.area * f.channels + channel) * f.area + k % f.area] *= 1 + fminf(fmaxf(work[k], -0.5F), 1);
    }
    free(work);
}

gonio_status gonio_rgl_refine(const gonio_model *model, gonio_rgl *m, int threads, gonio_error *error) {
    const size_t nodes = m->n_phi * m->n_theta * m->spectra.w * m->spectra.h, channels = (size_t)model->channels;
    rows r = {.model = model, .m = m, .n = PER_NODE * nodes < PAIRS_MAX ? PER_NODE * nodes : PAIRS_MAX};
    r.at = malloc(r.n * sizeof *r.at);
    r.targets = calloc(r.n * channels, sizeof *r.targets);
    bool failed[GONIO_CHANNELS_MAX] = {false};
    gonio_status status = GONIO_OK;
    if (r.at != NULL && r.targets != NULL) {
        gonio_pool_for(threads, (r.n + BLOCK - 1) / BLOCK, fill_rows, &r);
        gonio_pool_for(threads, channels, refine_channel, &(refinement){&r, failed});
    } else {
        failed[0] = true;
    }
    for (size_t c = 0; c < channels; c++) {
        status = failed[c] ? GONIO_E_MEMORY : status;
    }
    free(r.at);
    free(r.targets);
    return status == GONIO_OK ? status : gonio_fail(error, status, "no memory to fit %zu nodes", nodes);
}
