// SPDX-License-Identifier: BSD-3-Clause
// P_s^(k) of a matrix whose products are known, channel by channel.
#ifndef GONIO_FIT_CHECK_RANKS_H
#define GONIO_FIT_CHECK_RANKS_H

#include "fit/check/products.h"
#include "gonio/check.h"

// [channels]: squares that are left beyond k = 0, 1 ... products, the most that may be less of them, and what sigma
// says.
typedef struct gonio_ranks {
    double (*left)[GONIO_CHECK_RANKS + 1];
    double *error;
    gonio_check_test (*tests)[GONIO_CHECK_RANKS];
} gonio_ranks;

// Free it, also on failure.
gonio_status gonio_ranks_begin(size_t channels, gonio_ranks *ranks, gonio_error *error);
void gonio_ranks_free(gonio_ranks *ranks);
void gonio_ranks_of_products(const gonio_products *products, size_t channel, gonio_ranks *ranks);
// sigma: the random standard uncertainties of the channel's entries.
void gonio_ranks_test(const gonio_row_source *sigma, const gonio_products *products, size_t channel,
                      gonio_ranks *ranks);
void gonio_ranks_sum_up(const gonio_ranks *ranks, size_t rows, size_t columns, size_t channels,
                        gonio_check_report *report);

#endif
