// SPDX-License-Identifier: BSD-3-Clause
// Which channel stands for a wavelength.
#ifndef GONIO_BASE_CHANNEL_H
#define GONIO_BASE_CHANNEL_H

// The one of n wavelengths (any order, NaN: none) that is wanted, or else the nearest within half the distance to its
// next neighbour on that side, beyond the ends within half the last distance and 2 %; -1: none.
int gonio_wavelength_nearest(const double *wavelengths, int n, double wanted);

#endif
