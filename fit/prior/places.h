// SPDX-License-Identifier: BSD-3-Clause
// Where to ask what is known: places spread over all pairs of directions and about the mirror direction.
#ifndef GONIO_FIT_PRIOR_PLACES_H
#define GONIO_FIT_PRIOR_PLACES_H

#include <stdint.h>

#include "gonio/direction.h"

// The i-th place, with no theta above theta_max: of even numbers spread over all pairs, of odd ones about the mirror
// direction, where the lobe is.
gonio_pair gonio_prior_place(uint64_t i, bool isotropic, double theta_max);

#endif
