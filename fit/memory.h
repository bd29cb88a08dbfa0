// SPDX-License-Identifier: BSD-3-Clause
// The memory of a fit, before it starts: from the samples and the options.
#ifndef GONIO_FIT_MEMORY_H
#define GONIO_FIT_MEMORY_H

#include "fit/method.h"

// A fit of these samples at this level.
gonio_fit_size gonio_fit_size_of(const gonio_samples *samples, const gonio_fit_options *options, int level);
// What n samples fitted on lattices take, as a method's `memory`; on two levels (cbmba) where `second` says so.
double gonio_lattice_fit_memory(const gonio_fit_size *size, double n);
double gonio_lattices_fit_memory(const gonio_fit_size *size, double n, bool second);
// gonio_fit_memory of a fit by the method whose `memory` is given, whatever size->method says.
double gonio_fit_memory_of(const gonio_fit_size *size, gonio_method_memory *method);
// Bytes that the kernel could give without swapping, the page cache among them.
double gonio_available_memory(void);
// Bytes that a fit may take in all, the samples included: the option's, or what is free and what the samples hold.
double gonio_fit_memory_limit(const gonio_samples *samples, const gonio_fit_options *options);
// gonio_fit_check_memory of such a fit, within that limit.
gonio_status gonio_fit_check_options(const gonio_samples *samples, const gonio_fit_options *options, int level,
                                     gonio_error *error);

#endif
