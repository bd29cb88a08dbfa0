// SPDX-License-Identifier: BSD-3-Clause
// What can be changed of a form, a step at a time.
#ifndef GONIO_FIT_AUTO_MOVES_H
#define GONIO_FIT_AUTO_MOVES_H

#include "fit/smooth/form.h"

// In the order in which a search goes through them: the level last, since every other step is cheaper before.
typedef enum gonio_auto_axis {
    GONIO_AUTO_STIFFNESS, // of the slow axes, by tens
    GONIO_AUTO_PROFILE,   // weight of the profile, by tens; from none on
    GONIO_AUTO_PROFILE_STIFFNESS,
    GONIO_AUTO_WIDTH, // of half-vector coordinates
    GONIO_AUTO_RECIPROCITY,
    GONIO_AUTO_LEVEL,
    GONIO_AUTO_AXES
} gonio_auto_axis;

typedef struct gonio_auto_space {
    const gonio_fit_options *options; // what they fix does not move
    int dims;
    bool profile; // may there be one?
    int coarsest; // level
} gonio_auto_space;

// One step along an axis, up (by 1) or down (-1); false: there is none, and the form is as it was.
bool gonio_auto_move(const gonio_auto_space *space, gonio_smooth_form *form, gonio_auto_axis axis, int by);
// The finest level that the direct solver builds in seconds.
int gonio_auto_finest(int dims);
bool gonio_auto_same_form(const gonio_smooth_form *a, const gonio_smooth_form *b);
// Where a search begins, in the order of preference: the coordinates given, or each system once, half vectors first;
// at last half vectors with a strong profile. Returns their number, at most GONIO_COORDINATES + 1.
int gonio_auto_starts(const gonio_auto_space *space, int level, bool mirror, gonio_smooth_form *forms);

#endif
