// SPDX-License-Identifier: BSD-3-Clause
// Which poses to measure.
#ifndef GONIO_PLAN_H
#define GONIO_PLAN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "gonio/direction.h"
#include "gonio/export.h"
#include "gonio/status.h"

GONIO_BEGIN

typedef struct gonio_plan {
    size_t n;
    gonio_pair *poses; // rad
} gonio_plan;

// "uniform:STEP[,theta_max=DEG][,anisotropic=1][,centred=1]": a grid, STEP degrees apart, in theta_i, theta_o and phi_o
// (phi_i = 0, half the azimuth: mirror symmetry; anisotropic: phi_i too, all round). centred: from STEP / 2 on, the
// middles of cells that fill the hemisphere, without pole and horizon. "nusselt:N[,theta_max=DEG][,anisotropic=1]": N
// poses stratified in Nusselt coordinates.
// Either with transmission=1: poses with the camera behind the sample too (theta_o = 180 deg - that of a pose in
// front); with back=1: with the light behind it as well. nusselt shares its N among the halves. Otherwise the path of a
// CSV with the header theta_i,phi_i,theta_o,phi_o (deg); thetas go to 90, to 180 where a comment
// "# halves = reflection,transmission" declares it.
// Deterministic in (text, seed). The caller frees it with gonio_plan_free.
gonio_status gonio_plan_make(const char *text, uint64_t seed, gonio_plan **out, gonio_error *error);
void gonio_plan_free(gonio_plan *plan);
// Does any direction lie behind the sample?
bool gonio_pairs_transmit(const gonio_pair *pairs, size_t n);

GONIO_END
#endif
