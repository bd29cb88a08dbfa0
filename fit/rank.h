// The k-th smallest of many values, in linear time.
#ifndef GONIO_FIT_RANK_H
#define GONIO_FIT_RANK_H

#include <stddef.h>

// values[n], reordered; k < n. Hoare, "Algorithm 65: Find", 1961.
double gonio_rank(double *values, size_t n, size_t k);

#endif
