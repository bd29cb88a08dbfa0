// SPDX-License-Identifier: BSD-3-Clause
// Keep-out zones: combinations of axis positions that must not be reached, nor passed.
//
// A zone is a box in the four axes (user degrees; an axis that is not named is free), or a narrow angle between camera
// and light, where one shadows the other. Moves are coordinated, so their path is a straight line in the axes, or
// two where they take up backlash.
#ifndef GONIO_DRIVERS_KEEP_OUT_H
#define GONIO_DRIVERS_KEEP_OUT_H

#include "gonio/rig.h"

enum { GONIO_ZONES_MAX = 16 };

typedef struct gonio_zone {
    char name[32];
    double minimum_deg[GONIO_AXES], maximum_deg[GONIO_AXES]; // -inf, inf: free
} gonio_zone;

typedef struct gonio_keep_out {
    int n;
    gonio_zone zones[GONIO_ZONES_MAX];
    bool independent; // the axes move each at its own pace: all of the box between two places counts as the way
    double retro_deg; // light and camera directions nearer than this: the camera shadows the light; 0: not checked
} gonio_keep_out;

// The zone's number by name, made where it is new (-1: there is no room).
int gonio_keep_out_zone(gonio_keep_out *keep_out, const char *name);
// GONIO_E_RANGE naming the zone that the path meets, straight or by way of `turn` (NULL: straight); from == to checks a
// pose. Shadowing counts at the end of the path alone: passing through it harms nothing.
gonio_status gonio_keep_out_check(const gonio_keep_out *keep_out, const double from_rad[GONIO_AXES],
                                  const double turn_rad[GONIO_AXES], const double to_rad[GONIO_AXES],
                                  gonio_error *error);

// Put the zones before the rig's stage: such moves are refused before anything moves. The rig's stage is closed with
// it.
gonio_status gonio_keep_out_guard(const gonio_keep_out *keep_out, gonio_rig *rig, gonio_error *error);

#endif
