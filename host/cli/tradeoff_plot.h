// SPDX-License-Identifier: BSD-3-Clause
// Scatter plots of the trade-off as PNG.
#ifndef GONIO_CLI_TRADEOFF_PLOT_H
#define GONIO_CLI_TRADEOFF_PLOT_H

#include "fit/tradeoff.h"

typedef enum cli_tradeoff_axis { CLI_TRADEOFF_BYTES, CLI_TRADEOFF_NS, CLI_TRADEOFF_SECONDS } cli_tradeoff_axis;

// Held-out error against bytes, ns or the fit's seconds, both logarithmic; the front of the two joined and named.
// Written whole or not at all.
gonio_status cli_tradeoff_plot(const gonio_tradeoff_row *rows, size_t n, cli_tradeoff_axis axis, const char *path,
                               gonio_error *error);

#endif
