// SPDX-License-Identifier: BSD-3-Clause
// Evaluation of the model in an RGL file (io/rgl.c has what it computes), and the map that it is stored along.
#include <math.h>
#include <stdlib.h>

#include "io/rgl.h"

static void release(gonio_model *model) {
    gonio_rgl *m = (gonio_rgl *)model;
    free(m->phi_i);
    free(m->theta_i);
    free(m->ndf.values);
    free(m->sigma.values);
    free(m->vndf.values);
    free(m->spectra.values);
    free(m->conditional);
    free(m->marginal);
    free(m->names);
    free(m);
}

// Where x lies among n nodes over [0, 1]: the lower node and the fraction toward the next.
size_t gonio_rgl_node(double x, size_t n, double *fraction) {
    const double at = fmin(fmax(x, 0), 1) * (double)(n - 1);
    const size_t low = at < (double)(n - 2) ? (size_t)at : n - 2;
    *fraction = at - (double)low;
    return low;
}

double gonio_rgl_bilinear(const gonio_rgl_stack *s, size_t slice, double x, double y) {
    double fx, fy;
    const size_t ix = gonio_rgl_node(x, s->w, &fx), iy = gonio_rgl_node(y, s->h, &fy);
    const float *at = s->values + (slice * s->h + iy) * s->w + ix;
    const double low = (1 - fx) * (double)at[0] + fx * (double)at[1];
    const double high = (1 - fx) * (double)at[s->w] + fx * (double)at[s->w + 1];
    return (1 - fy) * low + fy * high;
}

// The lower of the two nodes around x, and the upper one's weight; held at the ends.
static size_t between(const double *nodes, size_t n, double x, double *weight) {
    size_t low = 0;
    *weight = 0;
    while (low + 2 < n && nodes[low + 1] <= x) {
        low++;
    }
    if (n > 1) {
        *weight = fmin(fmax((x - nodes[low]) / (nodes[low + 1] - nodes[low]), 0), 1);
    }
    return low;
}

static gonio_rgl_blend slices_at(const gonio_rgl *m, double phi, double theta) {
    double wp, wt;
    const size_t p = between(m->phi_i, m->n_phi, phi, &wp), t = between(m->theta_i, m->n_theta, theta, &wt);
    gonio_rgl_blend b;
    for (size_t k = 0; k < 4; k++) {
        b.weight[k] = (k & 2 ? wp : 1 - wp) * (k & 1 ? wt : 1 - wt);
        b.slice[k] = b.weight[k] > 0 ? (p + (k >> 1)) * m->n_theta + t + (k & 1) : 0;
    }
    return b;
}

static double mixed(const float *values, const gonio_rgl_blend *b, size_t stride, size_t offset) {
    double sum = 0;
    for (int k = 0; k < 4; k++) {
        sum += b->weight[k] > 0 ? b->weight[k] * (double)values[b->slice[k] * stride + offset] : 0;
    }
    return sum;
}

// Map a point of vndf's square to the uniform square: the share of the density below it, row by row (y), then along the
// row (x). Densities are bilinear, so both running integrals are quadratic inside a cell.
static void unwarp(const gonio_rgl *m, const gonio_rgl_blend *b, double *x, double *y) {
    const size_t w = m->vndf.w, h = m->vndf.h, area = w * h;
    double fx, fy;
    const size_t ix = gonio_rgl_node(*x, w, &fx), iy = gonio_rgl_node(*y, h, &fy), at = ix + iy * w;
    const double v00 = mixed(m->vndf.values, b, area, at), v10 = mixed(m->vndf.values, b, area, at + 1);
    const double v01 = mixed(m->vndf.values, b, area, at + w), v11 = mixed(m->vndf.values, b, area, at + w + 1);
    const double c0 = (1 - fy) * v00 + fy * v01, c1 = (1 - fy) * v10 + fy * v11;
    const double before = (1 - fy) * mixed(m->conditional, b, area, at) + fy * mixed(m->conditional, b, area, at + w);
    const double r0 = mixed(m->conditional, b, area, iy * w + w - 1);
    const double r1 = mixed(m->conditional, b, area, iy * w + 2 * w - 1);
    const double row = (1 - fy) * r0 + fy * r1;
    *x = row > 0 ? (before + fx * (c0 + 0.5 * fx * (c1 - c0))) / row : *x;
    *y = mixed(m->marginal, b, h, iy) + fy * (r0 + 0.5 * fy * (r1 - r0));
}

static double u_theta(double theta) { return sqrt(theta * (2 / GONIO_PI)); }

static double u_phi(double phi) {
    const double u = (phi + GONIO_PI) / (2 * GONIO_PI);
    return u - floor(u);
}

// Turn a pair of a reduced file to where its phi_i are.
static void reduce(int reduction, gonio_vec3 *wi, gonio_vec3 *wo) {
    const bool turn = wi->y > 0 || (wi->y == 0 && wi->x > 0);
    const double sy = turn ? -1 : 1, sx = reduction == 4 ? (wi->x > 0 ? -1 : 1) : sy;
    wi->x *= sx, wi->y *= sy;
    wo->x *= sx, wo->y *= sy;
}

gonio_rgl_blend gonio_rgl_locate(const gonio_rgl *m, gonio_vec3 wi, gonio_vec3 wo, double *x, double *y,
                                 double *scale) {
    const gonio_vec3 half = {wi.x + wo.x, wi.y + wo.y, wi.z + wo.z};
    const double theta_i = gonio_direction_theta(wi), phi_i = gonio_direction_phi(wi);
    const double x_m = u_theta(fmin(gonio_direction_theta(half), GONIO_PI / 2));
    const double y_m = u_phi(gonio_direction_phi(half) - (m->head.isotropic ? phi_i : 0));
    const gonio_rgl_blend b = slices_at(m, phi_i, theta_i);
    *x = x_m, *y = y_m;
    unwarp(m, &b, x, y);
    *scale = 1;
    if (m->jacobian) {
        const double sigma = gonio_rgl_bilinear(&m->sigma, 0, u_theta(theta_i), u_phi(phi_i));
        *scale = sigma > 0 ? gonio_rgl_bilinear(&m->ndf, 0, x_m, y_m) / (4 * sigma) : 0;
    }
    *scale /= fmax(wo.z, GONIO_RGL_COSINE_MIN);
    return b;
}

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const gonio_rgl *m = (const gonio_rgl *)model;
    if (m->reduction > 1) {
        reduce(m->reduction, &wi, &wo);
    }
    double x, y, scale;
    const gonio_rgl_blend b = gonio_rgl_locate(m, wi, wo, &x, &y, &scale);
    for (size_t c = 0; c < (size_t)model->channels; c++) {
        double f = 0;
        for (int k = 0; k < 4; k++) {
            f += b.weight[k] > 0
                     ? b.weight[k] * gonio_rgl_bilinear(&m->spectra, b.slice[k] * (size_t)model->channels + c, x, y)
                     : 0;
        }
        values[c] = fmax(f, 0) * scale;
    }
}

const gonio_model_ops gonio_rgl_ops = {.kind = "measured", .eval = eval, .free = release};

// How far along a cell the integral of a density that runs from d0 to d1 reaches `mass`.
static double within(double d0, double d1, double mass) {
    const double root = sqrt(fmax(d0 * d0 + 2 * (d1 - d0) * mass, 0));
    return d0 + root > 0 ? fmin(fmax(2 * mass / (d0 + root), 0), 1) : 0;
}

// The last of n ascending running integrals, beside the end, that is at most x.
static size_t cell_of(const float *low, const float *high, double f, size_t n, double x) {
    size_t k = 0;
    while (k + 2 < n && (1 - f) * (double)low[k + 1] + f * (double)high[k + 1] <= x) {
        k++;
    }
    return k;
}

void gonio_rgl_warp(const gonio_rgl *m, size_t slice, double x, double y, double u[2]) {
    const size_t w = m->vndf.w, h = m->vndf.h;
    const float *marginal = m->marginal + slice * h, *values = m->vndf.values + slice * w * h;
    const float *along = m->conditional + slice * w * h;
    const size_t j = cell_of(marginal, marginal, 0, h, y * (double)marginal[h - 1]);
    const float *c0 = along + j * w, *c1 = c0 + w;
    const double fy = within((double)c0[w - 1], (double)c1[w - 1], y * (double)marginal[h - 1] - (double)marginal[j]);
    const double target = x * ((1 - fy) * (double)c0[w - 1] + fy * (double)c1[w - 1]);
    const size_t i = cell_of(c0, c1, fy, w, target);
    const float *v0 = values + j * w + i, *v1 = v0 + w;
    const double d0 = (1 - fy) * (double)v0[0] + fy * (double)v1[0], d1 = (1 - fy) * (double)v0[1] + fy * (double)v1[1];
    const double before = (1 - fy) * (double)c0[i] + fy * (double)c1[i];
    u[0] = ((double)i + within(d0, d1, target - before)) / (double)(w - 1);
    u[1] = ((double)j + fy) / (double)(h - 1);
}

// vndf scaled to integrate to 1 in each slice, with the running integrals (trapezoids: the density is bilinear).
gonio_status gonio_rgl_integrate(gonio_rgl *m, const char *path, gonio_error *error) {
    const size_t w = m->vndf.w, h = m->vndf.h;
    m->conditional = malloc(m->vndf.slices * w * h * sizeof *m->conditional);
    m->marginal = malloc(m->vndf.slices * h * sizeof *m->marginal);
    if (m->conditional == NULL || m->marginal == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the integrals of 'vndf'");
    }
    for (size_t s = 0; s < m->vndf.slices; s++) {
        float *values = m->vndf.values + s * w * h, *along = m->conditional + s * w * h;
        double total = 0;
        for (size_t y = 0; y < h; y++) {
            double sum = 0;
            for (size_t x = 0; x < w; x++) {
                sum += x > 0 ? 0.5 * ((double)values[y * w + x - 1] + (double)values[y * w + x]) : 0;
                along[y * w + x] = (float)sum;
            }
            total += y > 0 ? 0.5 * ((double)along[y * w - 1] + sum) : 0;
            m->marginal[s * h + y] = (float)total;
        }
        if (!(total > 0)) {
            return gonio_fail_byte(error, GONIO_E_INPUT, path, -1, "field 'vndf': a slice without any density");
        }
        // What was scaled already, as our own files are, stays as it is.
        if (fabs(total - 1) < 1e-5) {
            continue;
        }
        for (size_t k = 0; k < w * h; k++) {
            values[k] = (float)((double)values[k] / total);
            along[k] = (float)((double)along[k] / total);
        }
        for (size_t y = 0; y < h; y++) {
            m->marginal[s * h + y] = (float)((double)m->marginal[s * h + y] / total);
        }
    }
    return GONIO_OK;
}

gonio_vec3 gonio_rgl_mirrored(gonio_vec3 wi, const double u[2]) {
    const gonio_vec3 m = gonio_direction(GONIO_PI / 2 * u[0] * u[0], (2 * u[1] - 1) * GONIO_PI);
    const double twice = 2 * (wi.x * m.x + wi.y * m.y + wi.z * m.z);
    return (gonio_vec3){twice * m.x - wi.x, twice * m.y - wi.y, twice * m.z - wi.z};
}
