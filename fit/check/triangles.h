// SPDX-License-Identifier: BSD-3-Clause
// Integrals over the hemisphere of what is known at scattered directions.
#ifndef GONIO_FIT_CHECK_TRIANGLES_H
#define GONIO_FIT_CHECK_TRIANGLES_H

#include <stdbool.h>
#include <stddef.h>

#include "gonio/direction.h"
#include "gonio/status.h"

// Of the spherical triangle a, b, c, counter-clockwise as seen from outside: the integral of cos(theta) over it.
// Lambert: half the sum over the edges of the arc's length times the z of its plane's normal.
double gonio_projected_solid_angle(gonio_vec3 a, gonio_vec3 b, gonio_vec3 c);

// weight[n] such that sum weight f is the integral of f cos(theta) over the hemisphere for f linear over each triangle
// of the directions' Delaunay triangulation; the weights add up to pi. What lies beyond their hull takes the value of
// the nearest direction; *covered is the fraction of pi within the hull. mirror: each stands for its mirror image in y
// too.
gonio_status gonio_triangles_weigh(const gonio_vec3 *directions, size_t n, bool mirror, double *weight, double *covered,
                                   gonio_error *error);

#endif
