// SPDX-License-Identifier: BSD-3-Clause
// Models of kind "lobe-spline": an analytic base times what a B-spline says about its error.
//
// f_r = T^-1(T(base) + spline(x)), T the transform (brdf/transform.h), base = d + sum of strength_j lobe_j, x the
// coordinates of the pair. Without lobes it is a plain spline; without a lattice, the lobes alone. With lobes no answer
// exceeds the larger of the base and the transform's scale: a ratio learnt where the base is too low must not multiply
// its peak. A second, coarse lattice carries ln of the standard uncertainty in units of the transform.
//
// eval, eval_many and eval_channel give the same bits, on every x86-64; eval_f32 gives eval's value rounded to float.
#ifndef GONIO_BRDF_KIND_LOBE_SPLINE_H
#define GONIO_BRDF_KIND_LOBE_SPLINE_H

#include "brdf/spline/lattice.h"
#include "brdf/transform.h"
#include "gonio/model.h"

#define GONIO_LOBES_MAX 2

// X(identifier, number in model files, name): gonio_lobe_cook_torrance and gonio_lobe_ggx (isotropic) of
// brdf/kind/analytic.h.
#define GONIO_LOBE_FAMILY_TABLE(X)                                                                                     \
    X(COOK_TORRANCE, 0, "cook-torrance")                                                                               \
    X(GGX, 1, "ggx")

#define GONIO_LOBE_FAMILY_ENUM(id, number, name) GONIO_LOBE_##id = number,
typedef enum gonio_lobe_family { GONIO_LOBE_FAMILY_TABLE(GONIO_LOBE_FAMILY_ENUM) } gonio_lobe_family;
#undef GONIO_LOBE_FAMILY_ENUM
#define GONIO_LOBE_FAMILY_COUNT(id, number, name) +1
#define GONIO_LOBE_FAMILIES (0 GONIO_LOBE_FAMILY_TABLE(GONIO_LOBE_FAMILY_COUNT)) // how many there are

// The lobes' shapes are shared by the channels: roughness is geometry, only strengths depend on the wavelength.
typedef struct gonio_lobe_base {
    int lobes; // 0: no lobes
    gonio_lobe_family family;
    double alpha[GONIO_LOBES_MAX], f0[GONIO_LOBES_MAX];
    // The smallest cosine (of either direction) among the samples. Lobe formulae divide by cosines: beyond the samples
    // they are evaluated there, not at the horizon, where nobody measured and they reach 1e12.
    float cosine_min;
    // Without lobes, positive transform: exponent p of a factor (cos theta_i cos theta_o)^-p of y + eps, so that the
    // spline need not follow the steep rise at grazing angles that most materials have; 0: none.
    float grazing;
    double *strength; // [channels][3]: the diffuse f_r, then the lobes' strengths
} gonio_lobe_base;

// No base exceeds this times the transform's scale (the power of two above the largest sample): a lobe narrower than
// the samples' spacing may tower over them, but a strength that no sample holds down must not.
#define GONIO_LOBE_CEILING 32.0

// Unit-strength values of the lobes: out[0] = 1 (diffuse), out[1..lobes]; without lobes out[0] is the grazing factor's
// transformed value.
void gonio_lobe_base_units(const gonio_lobe_base *base, gonio_vec3 wi, gonio_vec3 wo, double out[1 + GONIO_LOBES_MAX]);
// The transformed value of the base of one channel (strength: its row, NULL without lobes) from those.
double gonio_lobe_base_transformed(const gonio_lobe_base *base, const double *strength, const double *units,
                                   gonio_transform_kind kind, const gonio_transform *transform);

// Shares: what part of the base each of its terms makes, between 0 and 1: a lobe's is 1 about its peak. Beside a spline
// that goes on from what surrounds a narrow peak as if the peak were not there, multiples of the shares say how much
// too low or high the robust fit of the lobes has left each. mean[1 + GONIO_LOBES_MAX]: strengths, averaged over the
// channels.
void gonio_lobe_mean_strengths(const gonio_lobe_base *base, int channels, double mean[1 + GONIO_LOBES_MAX]);
void gonio_lobe_shares(const gonio_lobe_base *base, const double *mean, const double *units,
                       double share[1 + GONIO_LOBES_MAX]);

// All a model is made of; gonio_lobe_spline_new takes over every pointer in it except the names.
typedef struct gonio_lobe_spline_parts {
    int channels, dims;
    gonio_coordinates coordinates;
    gonio_transform_kind kind;
    gonio_transform *transforms; // [channels]
    gonio_lobe_base base;
    gonio_lattice lattice;           // points NULL: no spline
    gonio_lattice profile;           // two-dimensional, added to the spline (brdf/spline/profile.h); points NULL: none
    double *shares;                  // [channels][1 + GONIO_LOBES_MAX] multiples of the shares, added to the spline
    double *range;                   // [channels][2], with a spline: between which its value, all that is added to it
                                     // included, is held (with a grazing factor: the sum)
    gonio_lattice sigma;             // one channel: ln sigma of the transformed value; points NULL: no uncertainty
    double *sigma_factor;            // [channels]
    gonio_lattice support;           // as sigma's lattice, in half-vector coordinates: the samples' support, held in 0
                                     // to 1; points NULL: not told
    bool sigma_half_vector;          // sigma's lattice lies in half-vector coordinates, whatever the spline's are
    const char (*channel_names)[32]; // copied
} gonio_lobe_spline_parts;

void gonio_lobe_spline_parts_release(gonio_lobe_spline_parts *parts);
// On success the parts are empty; on failure they are unchanged.
gonio_status gonio_lobe_spline_new(gonio_lobe_spline_parts *parts, gonio_model **out, gonio_error *error);
// The parts of a model that gonio_lobe_spline_new made; frees the rest of it.
void gonio_lobe_spline_take(gonio_model *model, gonio_lobe_spline_parts *parts);
// Borrowed; NULL for a model of another kind.
const gonio_lobe_spline_parts *gonio_lobe_spline_about(const gonio_model *model);

// "none" without lobes, else the family's name.
const char *gonio_lobe_base_name(const gonio_lobe_base *base);

#endif
