// SPDX-License-Identifier: BSD-3-Clause
// The right singular vectors and singular values of the matrix come from its Gram matrix' eigenvectors: it has far more
// rows than columns. With v_i the length of row i of the first k vectors and s_i that of column i of what is left,
// column i is drawn with p_i = (v_i^2 / sum v^2 + v_i s_i / sum v s + s_i^2 / sum s^2) / 3.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/random.h"
#include "fit/smooth/tridiagonal.h"
#include "scene/cpm/select.h"

#define RIDGE 1e-6 // of the mean diagonal: chosen columns are often nearly alike

typedef struct sampled {
    const cpm_matrix *m;
    size_t n;        // columns
    double *gram;    // n x n
    double *vectors; // n x n, one a column
    double *values;  // [n], ascending
    double *wanted;  // [n]: A^T b
    double *chance;  // [n]: cumulated
    double *room;    // n x n
    size_t *drawn, *best;
    double *weights, *best_weights;
    size_t best_n;
    double target2, best_snr;
} sampled;

static void release(sampled *s) {
    free(s->gram);
    free(s->vectors);
    free(s->values);
    free(s->wanted);
    free(s->chance);
    free(s->room);
    free(s->drawn);
    free(s->best);
    free(s->weights);
    free(s->best_weights);
}

static bool allocate(sampled *s) {
    const size_t n = s->n;
    s->gram = malloc(n * n * sizeof(double));
    s->vectors = malloc(n * n * sizeof(double));
    s->values = malloc(n * sizeof(double));
    s->wanted = calloc(n, sizeof(double));
    s->chance = malloc(n * sizeof(double));
    s->room = malloc(n * n * sizeof(double));
    s->drawn = malloc(n * sizeof(size_t));
    s->best = malloc(n * sizeof(size_t));
    s->weights = malloc(n * sizeof(double));
    s->best_weights = malloc(n * sizeof(double));
    return s->gram != NULL && s->vectors != NULL && s->values != NULL && s->wanted != NULL && s->chance != NULL &&
           s->room != NULL && s->drawn != NULL && s->best != NULL && s->weights != NULL && s->best_weights != NULL;
}

static void multiply(sampled *s) {
    const cpm_matrix *m = s->m;
    for (size_t q = 0; q < m->fit.n; q++) {
        s->target2 += m->fit.b[q] * m->fit.b[q];
    }
    for (size_t i = 0; i < s->n; i++) {
        const float *a = m->fit.a + i * m->fit.stride;
        for (size_t q = 0; q < m->fit.n; q++) {
            s->wanted[i] += (double)a[q] * m->fit.b[q];
        }
        for (size_t j = 0; j <= i; j++) {
            const float *b = m->fit.a + j * m->fit.stride;
            double part[4] = {0};
            size_t q = 0;
            for (; q + 4 <= m->fit.n; q += 4) {
                for (size_t k = 0; k < 4; k++) {
                    part[k] += (double)a[q + k] * (double)b[q + k];
                }
            }
            for (; q < m->fit.n; q++) {
                part[0] += (double)a[q] * (double)b[q];
            }
            s->gram[i * s->n + j] = s->gram[j * s->n + i] = part[0] + part[1] + part[2] + part[3];
        }
    }
}

// ---- eigenvectors ----

// Householder's reflections bring the symmetric matrix a to three diagonals; the reflections' vectors stay in the rows
// of its lower triangle, which reflect() takes back.
static void tridiagonal(double *a, size_t n, double *diagonal, double *side, double *scale) {
    double *p = side; // free until its element is set
    for (size_t i = n; i-- > 1;) {
        double *u = a + i * n, length2 = 0;
        for (size_t k = 0; k < i; k++) {
            length2 += u[k] * u[k];
        }
        const double length = copysign(sqrt(length2), u[i - 1]);
        diagonal[i] = u[i];
        scale[i] = 0;
        if (length2 > 0) {
            u[i - 1] += length;
            scale[i] = 1 / (length * u[i - 1]);
            double half = 0;
            for (size_t k = 0; k < i; k++) { // p = scale A u
                double sum = 0;
                for (size_t l = 0; l < i; l++) {
                    sum += (l <= k ? a[k * n + l] : a[l * n + k]) * u[l];
                }
                p[k] = sum * scale[i];
                half += p[k] * u[k];
            }
            half *= scale[i] / 2;
            for (size_t k = 0; k < i; k++) {
                p[k] -= half * u[k];
            }
            for (size_t k = 0; k < i; k++) {
                for (size_t l = 0; l <= k; l++) {
                    a[k * n + l] -= u[k] * p[l] + p[k] * u[l];
                }
            }
        }
        side[i - 1] = -length;
    }
    diagonal[0] = a[0];
}

static void reflect(const double *a, size_t n, const double *scale, double *vectors) {
    for (size_t i = 1; i < n; i++) {
        const double *u = a + i * n;
        for (size_t column = 0; column < n && scale[i] != 0; column++) {
            double sum = 0;
            for (size_t k = 0; k < i; k++) {
                sum += u[k] * vectors[k * n + column];
            }
            sum *= scale[i];
            for (size_t k = 0; k < i; k++) {
                vectors[k * n + column] -= sum * u[k];
            }
        }
    }
}

static bool decompose(sampled *s) {
    const size_t n = s->n;
    double *side = malloc(n * sizeof *side), *scale = calloc(n, sizeof *scale), most = 0;
    memcpy(s->room, s->gram, n * n * sizeof *s->room);
    for (size_t i = 0; i < n; i++) {
        most = fmax(most, s->gram[i * n + i]);
    }
    for (size_t i = 0; i < n * n && most > 0; i++) {
        s->room[i] /= most;
    }
    bool good = side != NULL && scale != NULL && most > 0;
    if (good) {
        tridiagonal(s->room, n, s->values, side, scale);
        good = gonio_tridiagonal_eigen(n, s->values, side, s->vectors);
    }
    if (good) {
        reflect(s->room, n, scale, s->vectors);
    }
    free(side);
    free(scale);
    return good;
}

// ---- drawing ----

// The least rank that keeps so much of the squares, and the chances that go with it.
static size_t find_chances(sampled *s, double energy) {
    const size_t n = s->n;
    double total = 0, kept = 0, vv = 0, vs = 0, ss = 0;
    size_t k = 0;
    for (size_t i = 0; i < n; i++) {
        total += fmax(0, s->values[i]);
    }
    while (k < n && kept < energy * total) {
        kept += fmax(0, s->values[n - 1 - k++]);
    }
    for (int pass = 0; pass < 2; pass++) {
        double before = 0;
        for (size_t i = 0; i < n; i++) {
            double v2 = 0, s2 = 0;
            for (size_t j = 0; j < n; j++) {
                const double x = s->vectors[i * n + j] * s->vectors[i * n + j];
                v2 += j >= n - k ? x : 0;
                s2 += j < n - k ? x * fmax(0, s->values[j]) : 0;
            }
            if (pass == 0) {
                vv += v2;
                vs += sqrt(v2 * s2);
                ss += s2;
            } else {
                before += (v2 / vv + (vs > 0 ? sqrt(v2 * s2) / vs : 0) + (ss > 0 ? s2 / ss : 0)) / 3;
                s->chance[i] = before;
            }
        }
    }
    return k;
}

static size_t draw(sampled *s, size_t c, uint64_t seed) {
    bool *taken = calloc(s->n, sizeof *taken);
    size_t n = 0;
    for (size_t k = 0; k < c && taken != NULL; k++) {
        const double at = gonio_random_uniform(seed + k) * s->chance[s->n - 1];
        size_t low = 0, high = s->n - 1;
        while (low < high) {
            const size_t middle = (low + high) / 2;
            if (s->chance[middle] > at) {
                high = middle;
            } else {
                low = middle + 1;
            }
        }
        if (!taken[low]) {
            taken[low] = true;
            s->drawn[n++] = low;
        }
    }
    free(taken);
    return n;
}

// Least squares of the drawn columns; negative weights become 0. Returns the signal-to-noise ratio then, of the rows
// that decide.
static double weigh(sampled *s, size_t n) {
    double *l = s->room, mean = 0;
    for (size_t i = 0; i < n; i++) {
        mean += s->gram[s->drawn[i] * s->n + s->drawn[i]] / (double)n;
    }
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j <= i; j++) {
            double sum = s->gram[s->drawn[i] * s->n + s->drawn[j]] + (i == j ? RIDGE * mean : 0);
            for (size_t k = 0; k < j; k++) {
                sum -= l[i * n + k] * l[j * n + k];
            }
            l[i * n + j] = i == j ? sqrt(fmax(sum, 1e-300)) : sum / l[j * n + j];
        }
    }
    for (size_t i = 0; i < n; i++) {
        double sum = s->wanted[s->drawn[i]];
        for (size_t k = 0; k < i; k++) {
            sum -= l[i * n + k] * s->weights[k];
        }
        s->weights[i] = sum / l[i * n + i];
    }
    for (size_t i = n; i-- > 0;) {
        double sum = s->weights[i];
        for (size_t k = i + 1; k < n; k++) {
            sum -= l[k * n + i] * s->weights[k];
        }
        s->weights[i] = sum / l[i * n + i];
    }
    double rest = s->target2;
    for (size_t i = 0; i < n; i++) {
        s->weights[i] = fmax(0, s->weights[i]);
    }
    if (s->m->held.n > 0) {
        return gonio_cpm_snr(&s->m->held, n, s->drawn, s->weights);
    }
    for (size_t i = 0; i < n; i++) {
        rest -= 2 * s->weights[i] * s->wanted[s->drawn[i]];
        for (size_t j = 0; j < n; j++) {
            rest += s->weights[i] * s->weights[j] * s->gram[s->drawn[i] * s->n + s->drawn[j]];
        }
    }
    return 10 * log10(s->target2 / fmax(rest, 1e-12 * s->target2));
}

// The best of some draws of c columns is kept where it reaches the ratio, or nothing has yet.
static bool try_count(sampled *s, size_t c, double snr_db, int repeats, uint64_t seed) {
    bool reached = false;
    for (int r = 0; r < repeats; r++) {
        const size_t n = draw(s, c, gonio_random(seed + 1000 * c + (uint64_t)r));
        const double snr = weigh(s, n);
        const bool better = snr >= snr_db ? s->best_snr < snr_db || n < s->best_n : snr > s->best_snr;
        reached = reached || snr >= snr_db;
        if (better) {
            s->best_n = n;
            s->best_snr = snr;
            memcpy(s->best, s->drawn, n * sizeof *s->best);
            memcpy(s->best_weights, s->weights, n * sizeof *s->weights);
        }
    }
    return reached;
}

bool gonio_cpm_select_sampled(const cpm_matrix *matrix, double snr_db, size_t most, double energy, int repeats,
                              uint64_t seed, cpm_choice *choice) {
    sampled s = {.m = matrix, .n = matrix->columns, .best_snr = -INFINITY};
    bool good = allocate(&s);
    choice->n = 0;
    choice->snr_db = INFINITY;
    if (good) {
        multiply(&s);
    }
    if (good && s.target2 > 0) {
        good = decompose(&s);
        size_t low = good ? find_chances(&s, energy) : 0, high = most < s.n ? most : s.n;
        while (good && low < high) {
            const size_t middle = (low + high) / 2;
            if (try_count(&s, middle, snr_db, repeats, seed)) {
                high = middle;
            } else {
                low = middle + 1;
            }
        }
        if (good && s.best_snr < snr_db) {
            try_count(&s, high, snr_db, repeats, seed);
        }
        for (size_t i = 0; i < s.best_n; i++) {
            if (s.best_weights[i] > 0 && choice->n < most) {
                choice->columns[choice->n] = s.best[i];
                choice->weights[choice->n++] = s.best_weights[i];
            }
        }
        choice->snr_db = s.best_snr;
    }
    release(&s);
    return good;
}
