// SPDX-License-Identifier: BSD-3-Clause
// A tabulated density to draw directions from.
//
// Projected on the surface, directions fill the unit disc, where a direction drawn in proportion to f_r has density
// f_r cos(theta_o) a solid angle. Polar coordinates about the mirror point m = -(wi.x, wi.y), s = |m|, reach all of the
// disc and follow a lobe from incidence to incidence: e is the point of the circle on the ray from m through p, at the
// angle psi from the azimuth opposite to m's, R = |e - m|, and r = |p - m| = rho R. Then dp = rho (1 + s cos psi) d rho
// d psi. The square's coordinates are
//   w = 2 v - 1 in [-1, 1): tan(psi / 2) = 2 w / (k (1 - w^2)), of k = 1 about uniform in psi; with k < 1 closer where
//   e comes close to m at grazing incidence, w = +-1; t in [0, 1]: r^2 = a (e^(t (2 - t) L) - 1), L = ln(1 + R^2 / a),
//   a a part of the lobe's half width squared in the plane of incidence: uniform in area inside it, logarithmic
//   outside, and toward the horizon linear in cos(theta_o), in which f_r is smooth.
// A slice holds, for one incident direction, the density over that square on a grid, and is bilinear between nodes;
// between the incident directions of the slices their densities are mixed, each in the coordinates of the direction
// asked for. Drawing takes one of the slices, then t by the running integral of its rows, then v by that of the row.
#include "brdf/sampler.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FLOOR 1e-3        // of the slice's mean density: what a node has at least
#define COSINE_LEAST 0.01 // the last slice's incidence stands for all that are closer to the horizon
#define CORE 0.1 // a, of the lobe's half width squared: of 1, 0.3, 0.1 the least variance on broad and sharp lobes
#define PEAK_LEAST 1e-5 // smallest radius at which the lobe's width is looked for

#define BLOCK 8 // cells of a row between two of its running integrals

struct gonio_sampler {
    gonio_sampler_size size;
    double a;
    double *running;  // [slices][rings][turns / BLOCK] the row's integral before each block, cells of area 1
    double *rows;     // [slices][rings] each row's integral
    double *marginal; // [slices][rings] that of the rows, from the slice's begin
    float *density;   // [slices][rings][turns + 1], the last as the first; integrates to 1
};

// ---- the square and the disc ----

// fmin and fmax are calls.
static inline double least(double a, double b) { return a < b ? a : b; }
static inline double most(double a, double b) { return a > b ? a : b; }

#define TINY 1e-200

// An incident direction: its mirror point and the axes about it.
typedef struct incidence {
    double s, cos2, k, a; // |m|, 1 - s^2
    double cx, cy;        // azimuth of -m
} incidence;

// a0: the square of a lobe's half width at normal incidence; in the plane of incidence it shrinks with the cosine.
static incidence incidence_of(double a0, gonio_vec3 wi) {
    const double s = least(sqrt(wi.x * wi.x + wi.y * wi.y), 1);
    incidence in = {.s = s, .cos2 = wi.z * wi.z, .k = 0.2 + 0.8 * wi.z, .cx = 1};
    const double c = most(wi.z, COSINE_LEAST);
    in.a = CORE * a0 * c * c;
    if (s > 0) {
        in.cx = wi.x / s;
        in.cy = wi.y / s;
    }
    return in;
}

// L. Its logarithm's rounding, 1e-16 of 1, is what R^2 / a is in units of 1 where a ray has no length.
static double log_of(double a, double radius2) {
    const double x = radius2 / a;
    return x > 1e-6 ? log(1 + x) : most(x - 0.5 * x * x, TINY);
}

// The disc's area over the square's; turn: d psi / d v.
static double area(const incidence *in, double radius2, double log_radius, double r2, double turn) {
    // 1 + s cos psi = (R^2 + 1 - s^2) / 2
    return 0.25 * (radius2 + in->cos2) * log_radius / most(radius2, TINY) * (r2 + in->a) * turn;
}

// d psi / d v, of per_norm = 1 / (k^2 (1 - w^2)^2 + 4 w^2).
static double turn_of(const incidence *in, double w, double per_norm) { return 8 * in->k * (1 + w * w) * per_norm; }

// The direction of (v, t), and *jacobian, the disc's area over the square's.
static gonio_vec3 direction_at(const incidence *in, double v, double t, double *jacobian) {
    const double w = 2 * v - 1, c = in->k * (1 - w * w), b = 2 * w, per_norm = 1 / (c * c + b * b), s = in->s;
    const double gap = 2 * c * c * per_norm; // 1 + cos psi
    const double cosine = gap - 1, sine = 2 * b * c * per_norm;
    const double radius2 = (1 - s) * (1 - s) + 2 * s * gap, log_radius = log_of(in->a, radius2);
    const double rest = 1 - t, r2 = in->a * (exp((1 - rest * rest) * log_radius) - 1),
                 rho = least(sqrt(r2 / most(radius2, TINY)), 1);
    *jacobian = area(in, radius2, log_radius, r2, turn_of(in, w, per_norm)) * 2 * rest;
    const double x = rho * (cosine + s) - s, y = rho * sine;
    const double z2 = (1 - rho) * (in->cos2 + rho * radius2);
    return (gonio_vec3){x * in->cx - y * in->cy, x * in->cy + y * in->cx, sqrt(most(z2, 0x1p-120))};
}

// The square's coordinates of a direction and the jacobian there.
static void locate(const incidence *in, gonio_vec3 wo, double *v, double *t, double *jacobian) {
    const double dx = wo.x * in->cx + wo.y * in->cy + in->s, dy = wo.y * in->cx - wo.x * in->cy;
    const double r2 = dx * dx + dy * dy, md = -in->s * dx, root = sqrt(md * md + r2 * in->cos2);
    double ex = -1, ey = 0, radius2 = (1 - in->s) * (1 - in->s);
    if (r2 > 0) {
        const double stretch = md > 0 ? in->cos2 / (md + root) : (root - md) / r2; // 1 / rho
        ex = least(stretch * dx - in->s, 1);
        ey = stretch * dy;
        radius2 = r2 * stretch * stretch;
    }
    // (hc, hs) points along psi / 2; of the two forms the one that does not cancel.
    const double hc = ex >= 0 ? 1 + ex : fabs(ey), hs = in->k * (ex >= 0 ? ey : copysign(1 - ex, ey));
    const double w = hs / (hc + sqrt(hc * hc + hs * hs)), log_radius = log_of(in->a, radius2);
    *v = least(0.5 * (1 + w), 1 - 0x1p-53);
    const double rest = sqrt(most(1 - log_of(in->a, r2) / log_radius, 0));
    *t = 1 - rest;
    const double c = in->k * (1 - w * w);
    *jacobian = area(in, radius2, log_radius, r2, turn_of(in, w, 1 / (c * c + 4 * w * w))) * 2 * rest;
}

// ---- slices ----

// Those around an incident direction, and their shares.
typedef struct blend {
    int n;
    size_t slice[4];
    double share[4];
} blend;

static blend blend_of(const gonio_sampler *m, gonio_vec3 wi, double s) {
    const int tilts = m->size.tilts, azimuths = m->size.azimuths;
    const double x = least(s / (1 + wi.z), 1) * (tilts - 1);
    const int i = x < tilts - 2 ? (int)x : tilts - 2;
    const double fx = least(x - i, 1);
    if (azimuths == 1) {
        return (blend){2, {(size_t)i, (size_t)i + 1}, {1 - fx, fx}};
    }
    const double turn = atan2(wi.y, wi.x) / (2 * GONIO_PI), y = (turn < 0 ? turn + 1 : turn) * azimuths;
    const int j = (int)y, j0 = j % azimuths, j1 = (j + 1) % azimuths;
    const double fy = y - j;
    const size_t row = (size_t)i * (size_t)azimuths, next = row + (size_t)azimuths;
    return (blend){4,
                   {row + (size_t)j0, row + (size_t)j1, next + (size_t)j0, next + (size_t)j1},
                   {(1 - fx) * (1 - fy), (1 - fx) * fy, fx * (1 - fy), fx * fy}};
}

static size_t row_at(const gonio_sampler *m, size_t slice, size_t ring) {
    return (slice * (size_t)m->size.rings + ring) * ((size_t)m->size.turns + 1);
}

// The mixed density over the square.
static double mixed(const gonio_sampler *m, const blend *b, double v, double t) {
    const double x = v * m->size.turns, y = t * (m->size.rings - 1);
    const int i = x < m->size.turns - 1 ? (int)x : m->size.turns - 1,
              j = y < m->size.rings - 2 ? (int)y : m->size.rings - 2;
    const double fx = x - i, fy = y - j;
    double sum = 0;
    for (int k = 0; k < b->n; k++) {
        const float *low = m->density + row_at(m, b->slice[k], (size_t)j) + i, *high = low + m->size.turns + 1;
        sum += b->share[k] * ((1 - fy) * ((1 - fx) * (double)low[0] + fx * (double)low[1]) +
                              fy * ((1 - fx) * (double)high[0] + fx * (double)high[1]));
    }
    return sum;
}

// How many of n ascending numbers are at most x; of branches only the loops', which are never mistaken.
static int count_up_to(const double *numbers, int n, double x) {
    int begin = 0, count = 0;
    for (int k = BLOCK; k <= n; k += BLOCK) {
        begin += numbers[k - 1] <= x ? BLOCK : 0;
    }
    const int left = n - begin < BLOCK ? n - begin : BLOCK;
    for (int k = 0; k < left; k++) {
        count += numbers[begin + k] <= x;
    }
    return begin + count;
}

// Where the integral of a density that runs from d0 to d1 over [0, 1] has reached `mass`.
static double within(double d0, double d1, double mass) {
    mass = most(mass, 0);
    return least(2 * mass / (d0 + sqrt(most(d0 * d0 + 2 * (d1 - d0) * mass, 0))), 1);
}

// The cell of the row at fy between two in which its running integral reaches `target`, and what is left of that.
static int cell_of(const gonio_sampler *m, size_t row, double fy, double *target) {
    const int turns = m->size.turns, blocks = turns / BLOCK;
    const double *low = m->running + row * (size_t)blocks, *next = low + blocks;
    int block = 0;
    for (int k = 1; k < blocks; k++) {
        block += (1 - fy) * low[k] + fy * next[k] <= *target;
    }
    *target -= (1 - fy) * low[block] + fy * next[block];
    const float *d = m->density + row * ((size_t)turns + 1) + (size_t)block * BLOCK, *above = d + turns + 1;
    double before = 0, sum = 0, left = (1 - fy) * (double)d[0] + fy * (double)above[0];
    int cell = 0;
    for (int k = 1; k < BLOCK; k++) {
        const double right = (1 - fy) * (double)d[k] + fy * (double)above[k];
        sum += 0.5 * (left + right);
        const bool passed = sum <= *target;
        cell += passed;
        before = passed ? sum : before;
        left = right;
    }
    *target -= before;
    return block * BLOCK + cell;
}

static void draw(const gonio_sampler *m, size_t slice, double u0, double u1, double *v, double *t) {
    const int turns = m->size.turns, rings = m->size.rings;
    const double *marginal = m->marginal + slice * (size_t)rings;
    double target = u0 * marginal[rings - 1];
    const int j = count_up_to(marginal + 1, rings - 2, target);
    const size_t row = slice * (size_t)rings + (size_t)j;
    const double fy = within(m->rows[row], m->rows[row + 1], target - marginal[j]);
    target = u1 * ((1 - fy) * m->rows[row] + fy * m->rows[row + 1]);
    const int i = cell_of(m, row, fy, &target);
    const float *d = m->density + row * ((size_t)turns + 1) + i, *above = d + turns + 1;
    const double left = (1 - fy) * (double)d[0] + fy * (double)above[0];
    const double right = (1 - fy) * (double)d[1] + fy * (double)above[1];
    *v = (i + within(left, right, target)) / turns;
    *t = (j + fy) / (rings - 1);
}

double gonio_sampler_sample(const gonio_sampler *m, gonio_vec3 wi, const double u[2], gonio_vec3 *wo) {
    const incidence in = incidence_of(m->a, wi);
    const blend b = blend_of(m, wi, in.s);
    double u0 = u[0], v, t, jacobian;
    int k = 0;
    while (k < b.n - 1 && u0 >= b.share[k]) {
        u0 -= b.share[k++];
    }
    draw(m, b.slice[k], b.share[k] > 0 ? least(u0 / b.share[k], 1 - 0x1p-53) : 0, u[1], &v, &t);
    *wo = direction_at(&in, v, t, &jacobian);
    return most(mixed(m, &b, v, t) / most(jacobian, TINY) * wo->z, TINY);
}

double gonio_sampler_pdf(const gonio_sampler *m, gonio_vec3 wi, gonio_vec3 wo) {
    const incidence in = incidence_of(m->a, wi);
    const blend b = blend_of(m, wi, in.s);
    double v, t, jacobian;
    locate(&in, wo, &v, &t, &jacobian);
    return mixed(m, &b, v, t) / most(jacobian, TINY) * wo.z;
}

// ---- building ----

// The mean over the channels of what is not negative, at n pairs of one wi.
typedef struct target {
    const gonio_model *model;
    gonio_vec3 *wi, *wo; // [room]
    double *values;      // [room][channels]
    double *fine;        // [2 rings - 1][2 turns]
} target;

static void averages(target *x, gonio_vec3 wi, size_t n, double *out) {
    const size_t c = (size_t)x->model->channels;
    for (size_t k = 0; k < n; k++) {
        x->wi[k] = wi;
    }
    gonio_model_eval_many(x->model, n, x->wi, x->wo, x->values);
    for (size_t k = 0; k < n; k++) {
        double sum = 0;
        for (size_t i = 0; i < c; i++) {
            const double f = x->values[k * c + i];
            sum += f > 0 ? fmin(f, 1e100) : 0;
        }
        out[k] = sum / (double)c;
    }
}

static gonio_vec3 slice_direction(const gonio_sampler_size *size, int tilt, int azimuth) {
    const double x = (double)tilt / (size->tilts - 1); // tan(theta / 2)
    const double c = fmax((1 - x * x) / (1 + x * x), COSINE_LEAST), s = sqrt(1 - c * c);
    const double phi = 2 * GONIO_PI * azimuth / size->azimuths;
    return (gonio_vec3){s * cos(phi), s * sin(phi), c};
}

// The radius about the mirror point beyond which f_r has fallen to half of its largest; 1 where it does not.
static double half_radius(target *x, gonio_vec3 wi) {
    enum { RADII = 44, WAYS = 8 };
    const double step = pow(1 / PEAK_LEAST, 1.0 / RADII);
    double found = 1;
    for (int way = 0; way < WAYS; way++) {
        double f[RADII], r = PEAK_LEAST, largest = 0;
        size_t n = 0;
        for (; n < RADII; n++, r *= step) {
            const double px = r * cos(2 * GONIO_PI * way / WAYS) - wi.x, py = r * sin(2 * GONIO_PI * way / WAYS) - wi.y;
            if (px * px + py * py >= 0.999) {
                break;
            }
            x->wo[n] = (gonio_vec3){px, py, sqrt(1 - px * px - py * py)};
        }
        averages(x, wi, n, f);
        r = PEAK_LEAST;
        for (size_t k = 0; k < n; k++, r *= step) {
            largest = fmax(largest, f[k]);
            if (f[k] < 0.5 * largest) {
                found = fmin(found, r);
                break;
            }
        }
    }
    return found;
}

static double lobe_scale(target *x) {
    double radius = 1;
    for (int k = 0; k < (x->model->isotropic ? 2 : 8); k++) {
        const double tilt = k % 2 ? 0.2 : 0.8;
        radius = fmin(radius, half_radius(x, gonio_direction(tilt, GONIO_PI / 4 * k)) / cos(tilt));
    }
    return radius * radius;
}

// The density at the grid's nodes and half-way between them.
static void fill_fine(const gonio_sampler *m, target *x, gonio_vec3 wi) {
    const size_t width = 2 * (size_t)m->size.turns, height = 2 * (size_t)m->size.rings - 1;
    const incidence in = incidence_of(m->a, wi);
    const double inside = 1 - 0.1 / (m->size.rings - 1); // at the horizon itself f_r may be anything
    for (size_t j = 0; j < height; j++) {
        double *row = x->fine + j * width, jacobian;
        const double t = (double)j / (double)(height - 1);
        for (size_t i = 0; i < width; i++) {
            x->wo[i] = direction_at(&in, (double)i / (double)width, fmin(t, inside), &jacobian);
        }
        averages(x, wi, width, row);
        for (size_t i = 0; i < width; i++) {
            direction_at(&in, (double)i / (double)width, t, &jacobian);
            row[i] *= jacobian;
        }
    }
}

// The mean about a node, so that a peak between nodes is not overlooked.
static double around(const gonio_sampler *m, const double *fine, size_t i, size_t j) {
    const size_t width = 2 * (size_t)m->size.turns, height = 2 * (size_t)m->size.rings - 1;
    double sum = 0;
    for (int dy = -1; dy <= 1; dy++) {
        const size_t y = j == 0 && dy < 0 ? 0 : j == height - 1 && dy > 0 ? j : j + (size_t)dy;
        const double *row = fine + y * width;
        sum +=
            (dy == 0 ? 0.5 : 0.25) * (0.25 * row[(i + width - 1) % width] + 0.5 * row[i] + 0.25 * row[(i + 1) % width]);
    }
    return sum;
}

// The running integrals of a slice; returns its whole.
static double integrate(gonio_sampler *m, size_t slice) {
    const size_t turns = (size_t)m->size.turns, rings = (size_t)m->size.rings, blocks = turns / BLOCK;
    double *rows = m->rows + slice * rings, *marginal = m->marginal + slice * rings;
    for (size_t j = 0; j < rings; j++) {
        const float *density = m->density + row_at(m, slice, j);
        double *running = m->running + (slice * rings + j) * blocks, sum = 0;
        for (size_t i = 0; i < turns; i++) {
            if (i % BLOCK == 0) {
                running[i / BLOCK] = sum;
            }
            sum += 0.5 * ((double)density[i] + (double)density[i + 1]);
        }
        rows[j] = sum;
        marginal[j] = j == 0 ? 0 : marginal[j - 1] + 0.5 * (rows[j - 1] + rows[j]);
    }
    return marginal[rings - 1];
}

static void fill_slice(gonio_sampler *m, target *x, size_t slice, gonio_vec3 wi) {
    const size_t turns = (size_t)m->size.turns, rings = (size_t)m->size.rings, width = 2 * turns;
    const incidence in = incidence_of(m->a, wi);
    double mean = 0;
    fill_fine(m, x, wi);
    for (size_t j = 0; j < rings; j++) {
        for (size_t i = 0; i < turns; i++) {
            double *node = x->values + j * turns + i;
            *node = fmax(x->fine[2 * j * width + 2 * i], 0.5 * around(m, x->fine, 2 * i, 2 * j));
            mean += *node * (j == 0 || j == rings - 1 ? 0.5 : 1);
        }
    }
    mean /= (double)(turns * (rings - 1));
    float *density = m->density + row_at(m, slice, 0);
    for (size_t j = 0; j < rings; j++) {
        for (size_t i = 0; i <= turns; i++) {
            double jacobian;
            direction_at(&in, (double)(i % turns) / (double)turns, (double)j / (double)(rings - 1), &jacobian);
            const double q = mean > 0 ? x->values[j * turns + i % turns] / mean : jacobian / GONIO_PI;
            density[j * (turns + 1) + i] = (float)fmax(q, FLOOR);
        }
    }
    const double total = integrate(m, slice) / (double)(turns * (rings - 1));
    for (size_t k = 0; k < rings * (turns + 1); k++) {
        density[k] = (float)((double)density[k] / total);
    }
    integrate(m, slice);
}

static void target_release(target *x) {
    free(x->wi);
    free(x->wo);
    free(x->values);
    free(x->fine);
}

static gonio_status target_init(target *x, const gonio_model *model, const gonio_sampler_size *size,
                                gonio_error *error) {
    const size_t row = 2 * (size_t)size->turns > 64 ? 2 * (size_t)size->turns : 64, c = (size_t)model->channels;
    const size_t nodes = (size_t)size->turns * (size_t)size->rings;
    *x = (target){.model = model,
                  .wi = malloc(row * sizeof *x->wi),
                  .wo = malloc(row * sizeof *x->wo),
                  .values = malloc((row * c > nodes ? row * c : nodes) * sizeof *x->values),
                  .fine = malloc(4 * nodes * sizeof *x->fine)};
    if (x->wi == NULL || x->wo == NULL || x->values == NULL || x->fine == NULL) {
        target_release(x);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to tabulate a density");
    }
    return GONIO_OK;
}

gonio_sampler_size gonio_sampler_standard(const gonio_model *model) {
    return model->isotropic ? (gonio_sampler_size){24, 1, 96, 48} : (gonio_sampler_size){20, 16, 64, 48};
}

void gonio_sampler_free(gonio_sampler *m) { free(m); }

static size_t slices_of(const gonio_sampler *m) { return (size_t)m->size.tilts * (size_t)m->size.azimuths; }

size_t gonio_sampler_bytes(const gonio_sampler *m) {
    const size_t rows = slices_of(m) * (size_t)m->size.rings;
    const size_t turns = (size_t)m->size.turns;
    return rows * ((turns + 1) * sizeof *m->density + (turns / BLOCK + 2) * sizeof(double));
}

gonio_status gonio_sampler_new(const gonio_model *model, const gonio_sampler_size *size, gonio_sampler **out,
                               gonio_error *error) {
    *out = NULL;
    target x;
    const gonio_status status = target_init(&x, model, size, error);
    if (status != GONIO_OK) {
        return status;
    }
    // One block, which whoever has it may free.
    const size_t rows = (size_t)size->tilts * (size_t)size->azimuths * (size_t)size->rings, turns = (size_t)size->turns;
    const size_t doubles = rows * (turns / BLOCK + 2);
    gonio_sampler *m = malloc(sizeof *m + doubles * sizeof(double) + rows * (turns + 1) * sizeof *m->density);
    if (m == NULL) {
        target_release(&x);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a density of %d x %d x %d x %d nodes", size->tilts,
                          size->azimuths, size->turns, size->rings);
    }
    m->size = *size;
    m->running = (double *)(m + 1);
    m->rows = m->running + rows * (turns / BLOCK);
    m->marginal = m->rows + rows;
    m->density = (float *)(m->marginal + rows);
    m->a = lobe_scale(&x);
    for (size_t slice = 0; slice < slices_of(m); slice++) {
        const int tilt = (int)(slice / (size_t)size->azimuths), azimuth = (int)(slice % (size_t)size->azimuths);
        fill_slice(m, &x, slice, slice_direction(size, tilt, azimuth));
    }
    target_release(&x);
    *out = m;
    return GONIO_OK;
}
