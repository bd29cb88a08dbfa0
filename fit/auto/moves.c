// SPDX-License-Identifier: BSD-3-Clause
#include "fit/auto/moves.h"

#include <string.h>

#include "fit/smooth/dense.h"

int gonio_auto_finest(int dims) {
    return dims == 3 ? GONIO_SMOOTH_DENSE_LEVEL_MAX_3D : GONIO_SMOOTH_DENSE_LEVEL_MAX_4D;
}

// A factor of ten, within bounds.
static bool scale(double *x, int by, double low, double high) {
    const double to = by > 0 ? *x * 10 : *x / 10;
    const bool inside = to > low / 2 && to < high * 2;
    *x = inside ? to : *x;
    return inside;
}

static bool stiffen(const gonio_auto_space *space, gonio_smooth_form *form, int by) {
    int count;
    const int first = gonio_coordinates_slow_axes(form->coordinates, space->dims, &count);
    bool moved = true;
    for (int d = first; d < first + count; d++) {
        moved = scale(&form->stretch[d], by, 0.01, 1e4) && moved;
    }
    return moved;
}

// A profile that is as smooth in both directions is for sharp peaks and wants a finer lattice.
static void set_profile(gonio_smooth_form *form, double weight, double stiffness) {
    form->profile = weight;
    form->profile_stretch[0] = 1;
    form->profile_stretch[1] = stiffness;
    form->profile_level = stiffness > 1 ? 5 : 6;
}

static bool has_profile(const gonio_auto_space *space, const gonio_smooth_form *form) {
    return space->profile && space->dims == 3 && gonio_coordinates_are_half_vector(form->coordinates);
}

// 0, 0.1, 1, 10
static bool weigh_profile(const gonio_auto_space *space, gonio_smooth_form *form, int by) {
    if (!has_profile(space, form) || (form->profile == 0 && by < 0)) {
        return false;
    }
    if (form->profile == 0) {
        set_profile(form, 0.1, 1);
        return true;
    }
    if (by < 0 && !(form->profile > 0.15)) {
        form->profile = 0;
        form->profile_level = 0;
        memset(form->profile_stretch, 0, sizeof form->profile_stretch);
        return true;
    }
    return scale(&form->profile, by, 0.1, 10);
}

// From no profile on: a stiff one.
static bool stiffen_profile(const gonio_auto_space *space, gonio_smooth_form *form, int by) {
    if (!has_profile(space, form) || (form->profile == 0 && by < 0)) {
        return false;
    }
    if (form->profile == 0) {
        set_profile(form, 0.1, 100);
        return true;
    }
    double stiffness = form->profile_stretch[1];
    const bool moved = scale(&stiffness, by, 1, 1e4);
    set_profile(form, form->profile, stiffness);
    return moved;
}

static bool widen(const gonio_auto_space *space, gonio_smooth_form *form, int by) {
    static const gonio_coordinates widths[] = {GONIO_HALF_VECTOR_NARROW, GONIO_HALF_VECTOR, GONIO_HALF_VECTOR_WIDE};
    const int n = sizeof widths / sizeof *widths;
    for (int w = 0; w < n && space->options->coordinates == GONIO_COORDINATES_AUTO; w++) {
        if (widths[w] == form->coordinates && w + by >= 0 && w + by < n) {
            form->coordinates = widths[w + by];
            return true;
        }
    }
    return false;
}

// The non-reciprocal part keeps all, a tenth or nothing of its prior variance.
static bool reciprocate(const gonio_auto_space *space, gonio_smooth_form *form, int by) {
    static const double steps[] = {0, 0.9, 1};
    const int n = sizeof steps / sizeof *steps;
    const bool open =
        space->options->symmetry == GONIO_SYMMETRY_AUTO && gonio_coordinates_are_half_vector(form->coordinates);
    for (int r = 0; r < n && open; r++) {
        if (steps[r] == form->reciprocity && r + by >= 0 && r + by < n) {
            form->reciprocity = steps[r + by];
            return true;
        }
    }
    return false;
}

static bool refine(const gonio_auto_space *space, gonio_smooth_form *form, int by) {
    const int level = form->level + by;
    const bool moved = space->options->level == GONIO_LEVEL_AUTO && level >= space->coarsest &&
                       level <= gonio_auto_finest(space->dims);
    form->level = moved ? level : form->level;
    return moved;
}

bool gonio_auto_move(const gonio_auto_space *space, gonio_smooth_form *form, gonio_auto_axis axis, int by) {
    static bool (*const moves[])(const gonio_auto_space *, gonio_smooth_form *, int) = {
        [GONIO_AUTO_STIFFNESS] = stiffen,
        [GONIO_AUTO_PROFILE] = weigh_profile,
        [GONIO_AUTO_PROFILE_STIFFNESS] = stiffen_profile,
        [GONIO_AUTO_WIDTH] = widen,
        [GONIO_AUTO_RECIPROCITY] = reciprocate,
        [GONIO_AUTO_LEVEL] = refine,
    };
    return moves[axis](space, form, by);
}

bool gonio_auto_same_form(const gonio_smooth_form *a, const gonio_smooth_form *b) {
    return a->coordinates == b->coordinates && a->level == b->level && a->reciprocity == b->reciprocity &&
           a->profile == b->profile && a->shares == b->shares &&
           memcmp(a->stretch, b->stretch, sizeof a->stretch) == 0 &&
           memcmp(a->profile_stretch, b->profile_stretch, sizeof a->profile_stretch) == 0;
}

int gonio_auto_starts(const gonio_auto_space *space, int level, bool mirror, gonio_smooth_form *forms) {
    const gonio_fit_options *options = space->options;
    const bool open = options->coordinates == GONIO_COORDINATES_AUTO;
    int n = 0;
    for (int half_vector = 1; half_vector >= 0; half_vector--) {
        for (gonio_coordinates c = 0; c < GONIO_COORDINATES; c++) {
            const bool wanted = open ? gonio_coordinates_base(c) == c : options->coordinates == c;
            if (wanted && gonio_coordinates_are_half_vector(c) == (half_vector == 1)) {
                forms[n] = gonio_smooth_form_default(c, level, mirror);
                if (half_vector == 1) { // most materials vary slowly along the difference angle
                    stiffen(space, &forms[n], 1);
                }
                forms[n++].reciprocity =
                    options->symmetry != GONIO_SYMMETRY_AUTO && (options->symmetry & GONIO_SYMMETRY_RECIPROCITY) != 0;
            }
        }
    }
    // A material that is a function of the half vector and the difference angle alone: coordinates that lose without a
    // profile may win with one.
    if (n > 0 && has_profile(space, &forms[0])) {
        forms[n] = forms[0];
        for (int k = 0; k < 2; k++) {
            stiffen(space, &forms[n], 1);
        }
        set_profile(&forms[n++], 1, 100);
    }
    return n;
}
