// SPDX-License-Identifier: BSD-3-Clause
// A virtual gonioreflectometer: rays against a patch of microgeometry give the BRDF that it has from afar.
#ifndef GONIO_PATCH_H
#define GONIO_PATCH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "gonio/export.h"
#include "gonio/plan.h"
#include "gonio/sample.h"

GONIO_BEGIN

// One tile of a surface that repeats in x and y for ever; +z is the surface's normal. Immutable once open: any number
// of threads may measure it.
typedef struct gonio_patch gonio_patch;

typedef struct gonio_patch_facts {
    size_t triangles; // of one tile
    int materials, channels;
    double width, height; // a tile's sides along x and y
    double low, high;     // z
} gonio_patch_facts;

// text: a shape with settings, "sawtooth:slope=45,rho=0.5" ("cylinders", "velvet", "heights:file=F", "mesh:file=F"), or
// the path of an INI file with a section [patch]; docs/scenes.md has the keys. GONIO_E_USAGE for a wrong setting of the
// text, GONIO_E_INPUT with file and line for one of the file, for pictures and meshes that cannot be used, and for a
// mesh whose tile has holes. The caller frees it.
gonio_status gonio_patch_open(const char *text, gonio_patch **out, gonio_error *error);
void gonio_patch_free(gonio_patch *patch); // NULL is allowed
void gonio_patch_describe(const gonio_patch *patch, gonio_patch_facts *facts);

// How to measure. gonio_virtual_options_default() first.
typedef struct gonio_virtual_options {
    uint64_t seed;
    int threads;            // 0: all; the samples do not depend on it
    bool interreflection;   // light that meets the patch more than once
    double target;          // relative standard error that every pose is brought to, as far as rays_max allows
    size_t rays, rays_max;  // camera rays for each outgoing direction, at least and at most
    double light_half_deg;  // half angle of the lamp's cone about the incident direction; 0: parallel light
    double camera_half_deg; // of the camera's aperture about the outgoing one
    // Called now and then with the fraction done; returning false stops the call, which gives GONIO_E_INTERRUPTED.
    bool (*progress)(void *context, double fraction, double rays_per_s);
    void *progress_context;
} gonio_virtual_options;

typedef struct gonio_virtual_report {
    uint64_t camera_rays, shadow_rays, bounces;
    size_t missed; // poses whose standard error stayed above the target
    double error;  // root mean square over the poses of the relative standard error, of poses that are not dark
    double seconds;
} gonio_virtual_report;

void gonio_virtual_options_default(gonio_virtual_options *options);
// The patch's BRDF at the poses of a plan, in the plan's order, with the standard error of each as sigma_random. It is
// the same integral as in Wu, Dorsey and Rushmeier 2009, eq. 6: the mean over the visible area of f_r (n.wi) with
// shadows, over (N.wi); DeYoung 1996, section 2.2.3, measures it so. All poses of an outgoing direction share its rays.
// report may be NULL. GONIO_E_RANGE for options or thetas (above 89.5 deg) that cannot be measured, GONIO_E_INPUT where
// light falls through the patch. The caller frees the samples.
gonio_status gonio_virtual_measure(const gonio_patch *patch, const gonio_plan *plan,
                                   const gonio_virtual_options *options, gonio_samples **out,
                                   gonio_virtual_report *report, gonio_error *error);

GONIO_END
#endif
