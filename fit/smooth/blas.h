// BLAS on one thread: the order of its sums, and so every bit, must not depend on how many threads there are, and
// callers run several solvers side by side instead.
#ifndef GONIO_FIT_SMOOTH_BLAS_H
#define GONIO_FIT_SMOOTH_BLAS_H

// Begin a stretch of BLAS calls. Nests, and works in any thread.
void gonio_smooth_blas_begin(void);
void gonio_smooth_blas_end(void);

#endif
