// SPDX-License-Identifier: BSD-3-Clause
#include "fit/prior/places.h"

#include <math.h>

#include "base/random.h"

static gonio_pair place(uint64_t *state, bool isotropic, bool mirror) {
    const double phi_i = isotropic ? 0 : 2 * GONIO_PI * gonio_random_next(state);
    const double theta_i = acos(gonio_random_next(state)), theta_o = acos(gonio_random_next(state));
    const gonio_pair p = {theta_i, phi_i, theta_o, 2 * GONIO_PI * gonio_random_next(state)};
    if (!mirror) {
        return p;
    }
    // The half vector's tan(theta_h) = sinh(r)/10, as half-vector coordinates see it, but denser toward the peak: there
    // sigma changes over less than a cell of theirs.
    const double u = gonio_random_next(state), tilt = atan(0.1 * sinh(4 * u * sqrt(u)));
    const gonio_vec3 i = gonio_direction(p.theta_i, p.phi_i),
                     h = gonio_direction(tilt, 2 * GONIO_PI * gonio_random_next(state));
    const double twice = 2 * (i.x * h.x + i.y * h.y + i.z * h.z);
    const gonio_vec3 o = {twice * h.x - i.x, twice * h.y - i.y, twice * h.z - i.z};
    return o.z > 0 ? gonio_pair_from_vectors(i, o) : p;
}

gonio_pair gonio_prior_place(uint64_t i, bool isotropic, double theta_max) {
    uint64_t state = gonio_random(i);
    gonio_pair p;
    do {
        p = place(&state, isotropic, i % 2 == 1);
    } while (fmax(p.theta_i, p.theta_o) > theta_max);
    return p;
}
