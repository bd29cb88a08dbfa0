// OpenBLAS has one setting for the process: counted, so that the user's own comes back when the last stretch ends.
#include "fit/smooth/blas.h"

#include <cblas.h>
#include <pthread.h>

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static int stretches, threads_before;

void gonio_smooth_blas_begin(void) {
    pthread_mutex_lock(&lock);
    if (stretches++ == 0) {
        threads_before = openblas_get_num_threads();
        openblas_set_num_threads(1);
    }
    pthread_mutex_unlock(&lock);
}

void gonio_smooth_blas_end(void) {
    pthread_mutex_lock(&lock);
    if (--stretches == 0) {
        openblas_set_num_threads(threads_before);
    }
    pthread_mutex_unlock(&lock);
}
