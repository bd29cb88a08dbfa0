// SPDX-License-Identifier: BSD-3-Clause
// Only the rows of the Gram matrix that belong to chosen columns are computed: a choice of c of m columns takes c d m
// products instead of d m^2.
#include "scene/cpm/select.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define BLOCK 256
// Rows share directions, so that their residuals go together in groups of about this many. tests/bench/cpm_selection
// has 38.5, 36, 33.5, 38.5 and 36.5 points at 0, 12, 50, 200 and 1,000; with few pairs 0 misses what is asked for.
#define ALIKE 50
#define PATIENCE 16 // steps, and a quarter of the columns, without a better result

typedef struct greedy {
    const cpm_matrix *m;
    size_t most, n;
    size_t *chosen;            // [most]
    double *weights;           // [most]
    double *products;          // most x columns: of each chosen column with all
    double *wanted;            // [columns]: A^T b
    double *norms;             // [columns]: squares of the columns' lengths
    double *factor, *solution; // most x most, most
    bool *taken;               // [columns]
    double target2;            // |b|^2
    double noise2;             // of a row, which its weights cannot be told from
    size_t *best;              // [most]: the best columns so far, by what decides
    double *best_weights, best_snr;
    size_t best_n, best_step;
} greedy;

static void release(greedy *g) {
    free(g->chosen);
    free(g->weights);
    free(g->products);
    free(g->wanted);
    free(g->norms);
    free(g->factor);
    free(g->solution);
    free(g->taken);
    free(g->best);
    free(g->best_weights);
}

static bool allocate(greedy *g) {
    const size_t columns = g->m->columns;
    g->chosen = malloc(g->most * sizeof *g->chosen);
    g->weights = malloc(g->most * sizeof *g->weights);
    g->products = malloc(g->most * columns * sizeof *g->products);
    g->wanted = malloc(columns * sizeof *g->wanted);
    g->norms = malloc(columns * sizeof *g->norms);
    g->factor = malloc(g->most * g->most * sizeof *g->factor);
    g->solution = malloc(g->most * sizeof *g->solution);
    g->taken = calloc(columns, sizeof *g->taken);
    g->best = malloc(g->most * sizeof *g->best);
    g->best_weights = malloc(g->most * sizeof *g->best_weights);
    return g->chosen != NULL && g->weights != NULL && g->products != NULL && g->wanted != NULL && g->norms != NULL &&
           g->factor != NULL && g->solution != NULL && g->taken != NULL && g->best != NULL && g->best_weights != NULL;
}

// In eight sums, which the compiler keeps in one register.
static double product(const float *restrict x, const float *restrict y, size_t n) {
    float part[8] = {0};
    double total = 0;
    size_t i = 0;
    for (size_t block = 0; i + 8 <= n; block++) {
        for (size_t k = 0; k < 8; k++) {
            part[k] += x[i + k] * y[i + k];
        }
        i += 8;
        if (block % 64 == 63) { // float32 would lose what many terms add
            for (size_t k = 0; k < 8; k++) {
                total += (double)part[k];
                part[k] = 0;
            }
        }
    }
    for (size_t k = 0; k < 8; k++) {
        total += (double)part[k];
    }
    for (; i < n; i++) {
        total += (double)x[i] * (double)y[i];
    }
    return total;
}

static const float *column(const cpm_matrix *m, size_t j) { return m->fit.a + j * m->fit.stride; }

double gonio_cpm_snr(const cpm_rows *rows, size_t n, const size_t *columns, const double *weights) {
    double all = 0, rest = 0;
    for (size_t start = 0; start < rows->n; start += BLOCK) {
        const size_t few = rows->n - start < BLOCK ? rows->n - start : BLOCK;
        double left[BLOCK];
        memcpy(left, rows->b + start, few * sizeof *left);
        for (size_t k = 0; k < n; k++) {
            const float *a = rows->a + columns[k] * rows->stride + start;
            for (size_t q = 0; q < few; q++) {
                left[q] -= weights[k] * (double)a[q];
            }
        }
        for (size_t q = 0; q < few; q++) {
            rest += left[q] * left[q];
            all += rows->b[start + q] * rows->b[start + q];
        }
    }
    return all > 0 ? 10 * log10(all / fmax(rest, 1e-12 * all)) : INFINITY;
}

static void begin(greedy *g) {
    const cpm_matrix *m = g->m;
    for (size_t q = 0; q < m->fit.n; q++) {
        g->target2 += m->fit.b[q] * m->fit.b[q];
    }
    for (size_t j = 0; j < m->columns; j++) {
        const float *a = column(m, j);
        double wanted = 0;
        for (size_t q = 0; q < m->fit.n; q++) {
            wanted += (double)a[q] * m->fit.b[q];
        }
        g->wanted[j] = wanted;
        g->norms[j] = product(a, a, m->fit.n);
    }
}

// One weight for all chosen columns.
static double equal_weight(const greedy *g) {
    double wanted = 0, products = 0;
    for (size_t i = 0; i < g->n; i++) {
        wanted += g->wanted[g->chosen[i]];
        for (size_t j = 0; j < g->n; j++) {
            products += g->products[i * g->m->columns + g->chosen[j]];
        }
    }
    return products > 0 ? fmax(wanted / products, 0) : 0;
}

// Least squares of the chosen columns by Cholesky's factors; weights are held to equal ones by a ridge. false: they are
// not independent.
static bool solve(greedy *g) {
    const size_t n = g->n, columns = g->m->columns;
    const double equal = equal_weight(g), ridge = equal > 0 ? g->noise2 / (equal * equal) : 0;
    double *l = g->factor;
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j <= i; j++) {
            double s = g->products[i * columns + g->chosen[j]] + (i == j ? ridge : 0);
            for (size_t k = 0; k < j; k++) {
                s -= l[i * n + k] * l[j * n + k];
            }
            if (i == j) {
                if (!(s > 1e-9 * g->norms[g->chosen[i]])) {
                    return false;
                }
                l[i * n + i] = sqrt(s);
            } else {
                l[i * n + j] = s / l[j * n + j];
            }
        }
    }
    for (size_t i = 0; i < n; i++) {
        double s = g->wanted[g->chosen[i]] + ridge * equal;
        for (size_t k = 0; k < i; k++) {
            s -= l[i * n + k] * g->solution[k];
        }
        g->solution[i] = s / l[i * n + i];
    }
    for (size_t i = n; i-- > 0;) {
        double s = g->solution[i];
        for (size_t k = i + 1; k < n; k++) {
            s -= l[k * n + i] * g->solution[k];
        }
        g->solution[i] = s / l[i * n + i];
    }
    return true;
}

static void drop(greedy *g, size_t i) {
    const size_t columns = g->m->columns, last = --g->n;
    g->taken[g->chosen[i]] = false;
    g->chosen[i] = g->chosen[last];
    g->weights[i] = g->weights[last];
    memcpy(g->products + i * columns, g->products + last * columns, columns * sizeof *g->products);
}

// From the weights so far as far toward the unconstrained ones as none falls below 0, where it is dropped; again.
static void settle(greedy *g) {
    while (g->n > 0) {
        if (!solve(g)) {
            drop(g, g->n - 1);
            continue;
        }
        double way = 1;
        size_t first = g->n;
        for (size_t i = 0; i < g->n; i++) {
            if (g->solution[i] <= 0) {
                const double reach = g->weights[i] / (g->weights[i] - g->solution[i]);
                if (reach < way || first == g->n) {
                    way = fmin(way, reach);
                    first = i;
                }
            }
        }
        for (size_t i = 0; i < g->n; i++) {
            g->weights[i] += way * (g->solution[i] - g->weights[i]);
        }
        if (first == g->n) {
            return;
        }
        drop(g, first);
    }
}

// The column that lies along the rest best, by the cosine between them; columns: none is left.
static size_t best_column(const greedy *g) {
    const size_t columns = g->m->columns;
    size_t best = columns;
    double most = 0;
    for (size_t j = 0; j < columns; j++) {
        double along = g->wanted[j];
        for (size_t k = 0; k < g->n; k++) {
            along -= g->weights[k] * g->products[k * columns + j];
        }
        const double cosine = g->norms[j] > 0 && !g->taken[j] ? along / sqrt(g->norms[j]) : 0;
        if (cosine > most) {
            most = cosine;
            best = j;
        }
    }
    return best;
}

static void take(greedy *g, size_t j) {
    const cpm_matrix *m = g->m;
    double *products = g->products + g->n * m->columns;
    for (size_t k = 0; k < m->columns; k++) {
        products[k] = product(column(m, j), column(m, k), m->fit.n);
    }
    g->taken[j] = true;
    g->chosen[g->n] = j;
    g->weights[g->n++] = 0;
}

// |b - A w|^2 by the products.
static double rest2(const greedy *g) {
    double rest = g->target2;
    for (size_t i = 0; i < g->n; i++) {
        rest -= 2 * g->weights[i] * g->wanted[g->chosen[i]];
        for (size_t j = 0; j < g->n; j++) {
            rest += g->weights[i] * g->weights[j] * g->products[i * g->m->columns + g->chosen[j]];
        }
    }
    return fmax(rest, 1e-12 * g->target2);
}

static double snr_of(const greedy *g) {
    if (g->m->held.n > 0) {
        return gonio_cpm_snr(&g->m->held, g->n, g->chosen, g->weights);
    }
    return g->target2 > 0 ? 10 * log10(g->target2 / rest2(g)) : INFINITY;
}

static void keep_the_better(greedy *g, size_t step) {
    const double snr = snr_of(g);
    if (snr > g->best_snr) {
        g->best_snr = snr;
        g->best_n = g->n;
        g->best_step = step;
        memcpy(g->best, g->chosen, g->n * sizeof *g->best);
        memcpy(g->best_weights, g->weights, g->n * sizeof *g->best_weights);
    }
}

bool gonio_cpm_select_greedy(const cpm_matrix *matrix, double snr_db, size_t most, cpm_choice *choice) {
    most = most < matrix->columns ? most : matrix->columns;
    greedy g = {.m = matrix, .most = most > 0 ? most : 1, .best_snr = -INFINITY};
    const bool good = allocate(&g);
    if (good) {
        begin(&g);
        g.noise2 = ALIKE * g.target2 * pow(10, -snr_db / 10) / (double)matrix->fit.n;
        keep_the_better(&g, 0);
        // Steps are bounded, since a column that is dropped may be taken again.
        for (size_t step = 0; step < 2 * most && g.n < most && g.best_snr < snr_db; step++) {
            const size_t j = best_column(&g);
            if (j == matrix->columns || step - g.best_step > PATIENCE + g.n / 4) {
                break;
            }
            take(&g, j);
            settle(&g);
            keep_the_better(&g, step);
        }
        choice->n = g.best_n;
        memcpy(choice->columns, g.best, g.best_n * sizeof *g.best);
        memcpy(choice->weights, g.best_weights, g.best_n * sizeof *g.best_weights);
        choice->snr_db = g.best_snr;
    }
    release(&g);
    return good;
}
