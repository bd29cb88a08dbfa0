// SPDX-License-Identifier: BSD-3-Clause
// What a set of samples covers of all pairs of directions, and what it leaves open.
#ifndef GONIO_COVERAGE_H
#define GONIO_COVERAGE_H

#include "gonio/export.h"
#include "gonio/sample.h"

GONIO_BEGIN

typedef struct gonio_coverage {
    size_t samples, geometries;            // the second: distinct ones
    size_t incidences;                     // distinct theta_i, and phi_i of anisotropic sets, to a tenth of a degree
    bool in_plane;                         // every direction out lies in the plane of incidence
    double theta_i_deg[2], theta_o_deg[2]; // smallest and largest
    unsigned halves;                       // bits 1 << gonio_half
    double horizon_deg;                    // nothing was measured nearer to it, on the light's or the camera's side
    // The pair, up to 80 deg and mirrored where the set is isotropic, that is the furthest from any sample of its half:
    // how far, over both directions' angles, and where.
    double hole_deg;
    gonio_pair hole;
} gonio_coverage;

// GONIO_E_MEMORY or GONIO_OK. Sets without samples cover nothing.
gonio_status gonio_coverage_of(const gonio_samples *samples, gonio_coverage *coverage, gonio_error *error);
// "171 geometries of 1 incidence (theta_i 30 deg) in its plane, theta_o 0 to 85 deg; ...", at most size bytes.
void gonio_coverage_text(const gonio_coverage *coverage, char *text, size_t size);
// The figures as lines of what a model was made of ("sampled.geometries = 171" ...) at the end of *lines, which is
// allocated anew; and back from such lines, false where they tell nothing of it.
gonio_status gonio_coverage_put(const gonio_coverage *coverage, char **lines, gonio_error *error);
bool gonio_coverage_take(const char *lines, gonio_coverage *coverage);
// "theta_i 10 to 70 deg of 5 incidences, theta_o 0 to 80 deg", of which its errors speak, at most size bytes.
void gonio_coverage_range_text(const gonio_coverage *coverage, char *text, size_t size);
// Does the set say too little of the rest for held-out errors to speak of it? They are then those of its own part.
bool gonio_coverage_is_narrow(const gonio_coverage *coverage);

GONIO_END
#endif
