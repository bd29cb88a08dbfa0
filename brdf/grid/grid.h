// SPDX-License-Identifier: BSD-3-Clause
// Grids over pairs of directions: nodes at equal steps of angles, poles and all, and what lies between the nodes.
//
// DeYoung, "Properties of tabulated bidirectional reflectance distribution functions" (1996), section 3.1, stores
// n_phi_i n_theta_i n_phi_r n_theta_r samples. Here the outgoing azimuth is counted from the incident one, so that a
// lobe lies along the axes and an isotropic table is the same without its axis of phi_i. The axes, first to last:
//   angles       theta_i, phi_i, theta_o, phi_o - phi_i
//   half-angles  theta_h, phi_h, theta_d, phi_d: of the half vector, and of wi about it (Rusinkiewicz 1998)
// the second of them in grids of four dimensions only. theta_h is stretched as in the half-vector coordinates.
//
// Tilts run from the pole to 90 deg, both among the nodes; azimuths around, without a node twice. Isotropic tables have
// mirror symmetry: their last axis runs from 0 to 180 deg, both among the nodes. Beyond a pole lies the direction of
// the opposite azimuth: with its tilt, the node of index -1 is that of index 1 half a turn on; turning the first
// direction of a pair half around turns the last axis too.
#ifndef GONIO_BRDF_GRID_GRID_H
#define GONIO_BRDF_GRID_GRID_H

#include <stdbool.h>
#include <stddef.h>

#include "gonio/direction.h"

// X(identifier, number in model files, name, what it is).
#define GONIO_GRID_TABLE(X)                                                                                            \
    X(ANGLES, 0, "angles", "both directions' angles")                                                                  \
    X(HALF_ANGLES, 1, "half-angles", "the half vector's angles and those about it")

#define GONIO_GRID_ENUM(id, number, name, summary) GONIO_GRID_##id = number,
typedef enum gonio_grid_system { GONIO_GRID_TABLE(GONIO_GRID_ENUM) } gonio_grid_system;
#undef GONIO_GRID_ENUM
#define GONIO_GRID_COUNT(id, number, name, summary) +1
#define GONIO_GRIDS (0 GONIO_GRID_TABLE(GONIO_GRID_COUNT)) // how many there are

#define GONIO_GRID_LEVEL_MAX 9
#define GONIO_GRID_POINTS_MAX 256 // 4^4

// Tilts have 2^level + 1 nodes, azimuths 2^(level + 1) (half as many and one where mirror symmetry halves them).
// Nodes are counted with the last axis fastest.
typedef struct gonio_grid {
    gonio_grid_system system;
    int dims, level;
    size_t size[4]; // of each axis
    size_t count;   // of all nodes; 0: more than can be counted
} gonio_grid;

// Between nodes: straight lines, or uniform cubic B-splines whose control points stand at the nodes.
typedef enum gonio_grid_degree { GONIO_GRID_LINEAR, GONIO_GRID_CUBIC, GONIO_GRID_DEGREES } gonio_grid_degree;

// dims 3: isotropic.
gonio_grid gonio_grid_of(gonio_grid_system system, int dims, int level);
// Where a pair lies, in steps of the nodes of each axis.
void gonio_grid_locate(const gonio_grid *grid, gonio_vec3 wi, gonio_vec3 wo, double x[4]);
// The pair of a node. A direction that half-angles put below the horizon stands on it.
void gonio_grid_node(const gonio_grid *grid, size_t node, gonio_vec3 *wi, gonio_vec3 *wo);
// The nodes, and their weights, that make the value at x; returns how many.
int gonio_grid_points(const gonio_grid *grid, gonio_grid_degree degree, const double x[4],
                      size_t nodes[GONIO_GRID_POINTS_MAX], double weights[GONIO_GRID_POINTS_MAX]);
bool gonio_grid_is_azimuth(const gonio_grid *grid, int axis);
// A grid is a matrix too: rows are nodes of the first direction's (or the half vector's) axes, columns those of the
// others. The rows, or the columns, whose straight lines make the value at x; returns how many (2 or 4).
int gonio_grid_rows(const gonio_grid *grid, const double x[4], size_t rows[4], double weights[4]);
int gonio_grid_columns(const gonio_grid *grid, const double x[4], size_t columns[4], double weights[4]);
static inline size_t gonio_grid_columns_n(const gonio_grid *grid) {
    return grid->size[grid->dims - 2] * grid->size[grid->dims - 1];
}
// The node that lies as far beyond the pole of this tilt as `node` lies before it: half a turn on.
size_t gonio_grid_beyond(const gonio_grid *grid, int tilt, size_t node);

#endif
