// SPDX-License-Identifier: BSD-3-Clause
// Dense linear algebra of fit/smooth/matrix.h against OpenBLAS, one thread each, in one run: times and their ratio, the
// median of neighbouring runs; results verified against each other. OpenBLAS is opened at run time and never linked;
// without it there is nothing to compare with. OPENBLAS_CORETYPE chooses its kernels.
#include <dlfcn.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/random.h"
#include "fit/smooth/matrix.h"

#define ROUNDS_MAX 9

// Fortran's interfaces: everything by address.
typedef void gemm_fn(const char *ta, const char *tb, const int *m, const int *n, const int *k, const double *alpha,
                     const double *a, const int *lda, const double *b, const int *ldb, const double *beta, double *c,
                     const int *ldc);
typedef void syrk_fn(const char *uplo, const char *trans, const int *n, const int *k, const double *alpha,
                     const double *a, const int *lda, const double *beta, double *c, const int *ldc);
typedef void potrf_fn(const char *uplo, const int *n, double *a, const int *lda, int *info);
typedef void syevd_fn(const char *jobz, const char *uplo, const int *n, double *a, const int *lda, double *w,
                      double *work, const int *lwork, int *iwork, const int *liwork, int *info);

typedef struct blas {
    gemm_fn *gemm;
    syrk_fn *syrk;
    potrf_fn *potrf;
    syevd_fn *syevd;
    char *(*core)(void);
} blas;

// Matrices of n x n: factors, what both sides make, eigenvalues.
typedef struct problem {
    int n;
    double *a, *b, *symmetric, *positive, *ours, *theirs, *our_values, *their_values;
} problem;

static int failures;

static double now_s(void) {
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void *function_of(void *const libraries[2], const char *name) {
    for (int k = 0; k < 2; k++) {
        void *found = libraries[k] != NULL ? dlsym(libraries[k], name) : NULL;
        if (found != NULL) {
            return found;
        }
    }
    return NULL;
}

static bool blas_open(blas *b) {
    void *libraries[2] = {dlopen("libopenblas.so.0", RTLD_NOW | RTLD_LOCAL), NULL};
    void (*threads)(int) = NULL;
    libraries[1] = libraries[0] != NULL ? dlopen("liblapack.so.3", RTLD_NOW | RTLD_LOCAL) : NULL;
    *(void **)&b->gemm = function_of(libraries, "dgemm_");
    *(void **)&b->syrk = function_of(libraries, "dsyrk_");
    *(void **)&b->potrf = function_of(libraries, "dpotrf_");
    *(void **)&b->syevd = function_of(libraries, "dsyevd_");
    *(void **)&b->core = function_of(libraries, "openblas_get_corename");
    *(void **)&threads = function_of(libraries, "openblas_set_num_threads");
    if (threads != NULL) {
        threads(1); // of this program, which has no other threads
    }
    return b->gemm != NULL && b->syrk != NULL && b->potrf != NULL && b->syevd != NULL && threads != NULL;
}

static void *allocated(size_t bytes) {
    void *block = malloc(bytes);
    if (block == NULL) {
        abort();
    }
    return block;
}

static problem problem_new(int n) {
    const size_t m = (size_t)n, bytes = m * m * sizeof(double);
    problem p = {n,
                 allocated(bytes),
                 allocated(bytes),
                 allocated(bytes),
                 allocated(bytes),
                 allocated(bytes),
                 allocated(bytes),
                 allocated(m * sizeof(double)),
                 allocated(m * sizeof(double))};
    uint64_t seed = 11;
    for (size_t k = 0; k < m * m; k++) {
        p.a[k] = gonio_random_next(&seed) - 0.5;
        p.b[k] = gonio_random_next(&seed) - 0.5;
    }
    const gonio_matrix a = gonio_matrix_of(p.a, m, m);
    gonio_multiply(1, a, gonio_matrix_transposed(a), 0, gonio_matrix_of(p.positive, m, m));
    for (size_t j = 0; j < m; j++) {
        p.positive[j * m + j] += 1;
        for (size_t i = 0; i < m; i++) {
            p.symmetric[j * m + i] = p.a[j * m + i] + p.a[i * m + j];
        }
    }
    return p;
}

static void problem_free(problem *p) {
    double *const all[] = {p->a, p->b, p->symmetric, p->positive, p->ours, p->theirs, p->our_values, p->their_values};
    for (size_t k = 0; k < sizeof all / sizeof *all; k++) {
        free(all[k]);
    }
}

// ---- the four jobs; each begins with its input copied, which counts on both sides ----

typedef struct job {
    const char *name;
    void (*ours)(problem *p);
    void (*theirs)(problem *p, const blas *b);
    double (*difference)(const problem *p); // over what rounding may make of it
} job;

static size_t bytes_of(const problem *p) { return (size_t)p->n * (size_t)p->n * sizeof(double); }

static double largest(const problem *p, bool lower) {
    const size_t n = (size_t)p->n;
    double most = 0;
    for (size_t j = 0; j < n; j++) {
        for (size_t i = lower ? j : 0; i < n; i++) {
            const double off = fabs(p->ours[j * n + i] - p->theirs[j * n + i]);
            most = off <= most ? most : off; // a NaN stays
        }
    }
    return most / (0x1p-52 * (double)n); // elements are of size 1 to sqrt(n)
}

static double whole_difference(const problem *p) { return largest(p, false); }
static double lower_difference(const problem *p) { return largest(p, true); }

static void our_product(problem *p) {
    const size_t n = (size_t)p->n;
    gonio_multiply(1, gonio_matrix_of(p->a, n, n), gonio_matrix_of(p->b, n, n), 0, gonio_matrix_of(p->ours, n, n));
}

static void their_product(problem *p, const blas *b) {
    const double one = 1, zero = 0;
    b->gemm("N", "N", &p->n, &p->n, &p->n, &one, p->a, &p->n, p->b, &p->n, &zero, p->theirs, &p->n);
}

static void our_square(problem *p) {
    const size_t n = (size_t)p->n;
    const gonio_matrix a = gonio_matrix_of(p->a, n, n);
    gonio_multiply_lower(1, a, gonio_matrix_transposed(a), 0, gonio_matrix_of(p->ours, n, n));
}

static void their_square(problem *p, const blas *b) {
    const double one = 1, zero = 0;
    b->syrk("L", "N", &p->n, &p->n, &one, p->a, &p->n, &zero, p->theirs, &p->n);
}

static void our_cholesky(problem *p) {
    memcpy(p->ours, p->positive, bytes_of(p));
    failures += !gonio_cholesky((size_t)p->n, p->ours);
}

static void their_cholesky(problem *p, const blas *b) {
    int info;
    memcpy(p->theirs, p->positive, bytes_of(p));
    b->potrf("L", &p->n, p->theirs, &p->n, &info);
    failures += info != 0;
}

static void our_eigen(problem *p) {
    memcpy(p->ours, p->symmetric, bytes_of(p));
    failures += !gonio_eigen((size_t)p->n, p->ours, p->our_values);
}

static void their_eigen(problem *p, const blas *b) {
    double best;
    int best_int, ask = -1, info;
    memcpy(p->theirs, p->symmetric, bytes_of(p));
    b->syevd("V", "L", &p->n, p->theirs, &p->n, p->their_values, &best, &ask, &best_int, &ask, &info);
    const int length = (int)best, int_length = best_int;
    double *work = allocated((size_t)length * sizeof *work);
    int *more = allocated((size_t)int_length * sizeof *more);
    b->syevd("V", "L", &p->n, p->theirs, &p->n, p->their_values, work, &length, more, &int_length, &info);
    failures += info != 0;
    free(work);
    free(more);
}

// Of values: in units of the rounding of A's norm. Vectors: their sign is free, so each pair's |cosine| against 1,
// in a tenth of what the least gap between values allows.
static double eigen_difference(const problem *p) {
    const size_t n = (size_t)p->n;
    double most = 0;
    for (size_t j = 0; j < n; j++) {
        const double norm = fmax(fabs(p->their_values[0]), p->their_values[n - 1]), unit = 0x1p-52 * norm;
        const double off = fabs(p->our_values[j] - p->their_values[j]) / unit;
        const double below = j > 0 ? p->their_values[j] - p->their_values[j - 1] : norm,
                     above = j + 1 < n ? p->their_values[j + 1] - p->their_values[j] : norm;
        const double cosine = fabs(gonio_dot(n, p->ours + j * n, p->theirs + j * n));
        const double turned = sqrt(fmax(0, 1 - cosine)) * fmin(below, above) / (10 * unit);
        most = off <= most ? most : off;
        most = turned <= most || 1 - cosine < 1e-12 ? most : turned;
    }
    return most / sqrt((double)n);
}

static const job jobs[] = {{"A B", our_product, their_product, whole_difference},
                           {"A A^T, lower half", our_square, their_square, lower_difference},
                           {"Cholesky", our_cholesky, their_cholesky, lower_difference},
                           {"eigenvalues and vectors", our_eigen, their_eigen, eigen_difference}};

static int by_value(const void *left, const void *right) {
    const double a = *(const double *)left, b = *(const double *)right;
    return (a > b) - (a < b);
}

static void compare(const job *j, problem *p, const blas *b) {
    double ratio[ROUNDS_MAX], ours[ROUNDS_MAX], theirs[ROUNDS_MAX];
    const int rounds = p->n >= 1000 ? 3 : ROUNDS_MAX;
    for (int r = 0; r < rounds; r++) {
        const double start = now_s();
        j->ours(p);
        const double middle = now_s();
        j->theirs(p, b);
        theirs[r] = now_s() - middle;
        ours[r] = middle - start;
        ratio[r] = ours[r] / theirs[r];
    }
    qsort(ratio, (size_t)rounds, sizeof *ratio, by_value);
    qsort(ours, (size_t)rounds, sizeof *ours, by_value);
    qsort(theirs, (size_t)rounds, sizeof *theirs, by_value);
    const double difference = j->difference(p);
    const bool differs = !(difference < 16);
    printf("  n %4d  %-24s %9.3f ms, OpenBLAS %9.3f ms, ratio %5.2f%s\n", p->n, j->name, 1e3 * ours[rounds / 2],
           1e3 * theirs[rounds / 2], ratio[rounds / 2], differs ? "  RESULTS DIFFER" : "");
    failures += differs;
    fflush(stdout);
}

int main(void) {
    static const int sizes[] = {200, 400, 1000};
    blas b = {0};
    if (!blas_open(&b)) {
        printf("SKIP: no libopenblas.so.0 here to compare with\n");
        return 0;
    }
    printf("one thread, OpenBLAS's kernels: %s\n", b.core != NULL ? b.core() : "unknown");
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++) {
        problem p = problem_new(sizes[k]);
        for (size_t j = 0; j < sizeof jobs / sizeof *jobs; j++) {
            compare(&jobs[j], &p, &b);
        }
        problem_free(&p);
    }
    return failures != 0;
}
