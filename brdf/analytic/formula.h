// SPDX-License-Identifier: BSD-3-Clause
// Analytic BRDFs: what a formula is, and the geometry that all of them are written in.
//
// A formula joins with one file and one line: brdf/analytic/NAME.c opens with the formula and its source and ends with
// its registration, `const gonio_formula gonio_formula_NAME`; the line is X(NAME) in formulae.def. SPECs, their error
// messages, `gonio kinds`, docs/kinds.md, the model files of kind "analytic" and the tests of every formula loop over
// that list.
//
// A formula takes a gonio_lobe_geometry, so a fitter that varies only the parameters computes the geometry once a
// sample. It is in double, and finite for every pair of directions and all parameters within their bounds. It knows its
// derivatives by its parameters, and in which of them it is linear: that is what fit/analytic needs to fit it.
//
// Grazing. Ward's, Cook-Torrance's and Oren-Nayar's formulae divide by cosines that reach 0 at the horizon. Every
// cosine is raised to GONIO_LOBE_COSINE_MIN (89.99994 deg) first: below that angle nothing changes, beyond it the value
// of that angle holds, so every value is finite.
#ifndef GONIO_BRDF_ANALYTIC_FORMULA_H
#define GONIO_BRDF_ANALYTIC_FORMULA_H

#include <math.h>
#include <stdbool.h>

#include "brdf/lobe_sampling.h"
#include "gonio/direction.h"

#define GONIO_LOBE_COSINE_MIN 1e-6
#define GONIO_FORMULA_PARAMETERS_MAX 16
#define GONIO_FORMULA_NAME_MAX 24 // bytes, the terminating 0 among them
// Bytes in a model file, the terminating 0 among them: longer names are cut there, and differ before.
#define GONIO_FORMULA_FILE_NAME_MAX 16
#define GONIO_FORMULA_PROPOSALS_MAX 4

// What the formulae need of a pair of unit vectors.
typedef struct gonio_lobe_geometry {
    gonio_vec3 wi, wo;   // cosines (z) raised to the minimum
    gonio_vec3 h;        // unit half vector
    double cos_d;        // h . wi = h . wo
    double tan_x, tan_y; // h.x/h.z and h.y/h.z: slopes of the facet that mirrors wi into wo
    double tan2;         // their squares' sum, tan^2(theta_h)
} gonio_lobe_geometry;

gonio_lobe_geometry gonio_lobe_geometry_of(gonio_vec3 wi, gonio_vec3 wo);

// Schlick, "An inexpensive BRDF model for physically-based rendering" (1994), eq. 15: f0 at normal incidence, 1 at
// grazing.
double gonio_fresnel_schlick(double cos_d, double f0);

// 1 - gonio_fresnel_schlick's share of f0: F = f0 + (1 - f0) of it.
double gonio_fresnel_grazing(double cos_d);

static inline double gonio_square(double x) { return x * x; }
// x_i x_o + y_i y_o: the product of the sines and the cosine of the azimuths' difference.
static inline double gonio_lobe_planar(const gonio_lobe_geometry *g) { return g->wi.x * g->wo.x + g->wi.y * g->wo.y; }

// Lobes that fits use by themselves, 1/sr, of unit strength (no albedo); each stands in the file of its formula.
double gonio_lobe_cook_torrance(const gonio_lobe_geometry *g, double m, double f0);
double gonio_lobe_ggx(const gonio_lobe_geometry *g, double alpha_x, double alpha_y, double f0);
// The same with its derivatives by m and f0, or alpha_x, alpha_y and f0.
double gonio_lobe_cook_torrance_slope(const gonio_lobe_geometry *g, double m, double f0, double d[2]);
double gonio_lobe_ggx_slope(const gonio_lobe_geometry *g, double alpha_x, double alpha_y, double f0, double d[3]);
// Ward's Gaussian of slopes, exp(-(tan_x / alpha_x)^2 - (tan_y / alpha_y)^2) / (4 pi alpha_x alpha_y), with its
// derivatives by both.
double gonio_lobe_gaussian(const gonio_lobe_geometry *g, double alpha_x, double alpha_y, double d[2]);

typedef struct gonio_formula_parameter {
    const char *name;
    double minimum, maximum;
    double initial; // used where a SPEC leaves it out; NaN: it must be given
    const char *text;
} gonio_formula_parameter;

// Another spelling of one or two parameters: value * scale goes to parameters first..last.
typedef struct gonio_formula_alias {
    const char *name;
    int first, last;
    double scale;
} gonio_formula_alias;

typedef struct gonio_formula {
    const char *name;    // as a SPEC and a model file have it: lower case, at most GONIO_FORMULA_NAME_MAX - 1 bytes
    const char *summary; // one line
    const char *source;  // who published it, where
    int n;               // parameters
    gonio_formula_parameter parameters[GONIO_FORMULA_PARAMETERS_MAX];
    gonio_formula_alias alias; // name NULL: none
    // f_r (1/sr) for parameters p[n] of one channel.
    double (*value)(const gonio_lobe_geometry *g, const double *p);
    // The same, and its derivative by each parameter in d[n].
    double (*slope)(const gonio_lobe_geometry *g, const double *p, double *d);
    // Bits of the parameters that f_r is linear in, all others given: strengths and albedos. Unless the formula is
    // absolute, f_r is 0 where all of them are, and their upper bounds are those of a SPEC alone: a fit of data in any
    // unit may exceed them.
    unsigned linear;
    bool absolute;                      // the formula gives more than what its linear parameters scale
    bool (*isotropic)(const double *p); // NULL: always
    // Optional: at most GONIO_FORMULA_PROPOSALS_MAX densities to draw directions from, in the same order and of the
    // same shapes for all parameters; returns how many. NULL: gonio_proposals_standard.
    int (*proposals)(const double *p, gonio_proposal *out);
    bool not_reciprocal; // f_r(wi, wo) need not equal f_r(wo, wi)
} gonio_formula;

// How far strengths of fitted models may go: data of 2^100 have them, and no product of one and a lobe overflows.
#define GONIO_STRENGTH_MAX 0x1p400
#define GONIO_LINEAR(k) (1U << (k))

// The formulae, ended by a NULL pointer; static storage.
const gonio_formula *const *gonio_formulae(void);
const gonio_formula *gonio_formula_find(const char *name); // NULL: no such formula
// By the bytes of a model file.
const gonio_formula *gonio_formula_of_file(const char name[GONIO_FORMULA_FILE_NAME_MAX]);

// A diffuse part of albedo rho_d, and a lobe; of a lobe without Fresnel's term f0 is 1.
static inline int gonio_propose_diffuse_and_lobe(gonio_proposal *out, double rho_d, gonio_proposal lobe) {
    out[0] = (gonio_proposal){.shape = GONIO_PROPOSE_COSINE, .strength = rho_d, .f0 = 1};
    out[1] = lobe;
    return 2;
}

// ---- parameters that several formulae have ----

#define GONIO_RHO_D                                                                                                    \
    { "rho_d", 0, 1, 0, "diffuse albedo" }
// A specular scale may exceed 1 (fits of real metals do), but not without end.
#define GONIO_RHO_S                                                                                                    \
    { "rho_s", 0, 1e6, NAN, "strength of the lobe" }
// The narrowest lobe: at 1e-5 its peak is 1e9 times the base, as far as the fits go.
#define GONIO_ALPHA(name)                                                                                              \
    { name, 1e-5, 10, NAN, "roughness (slope)" }
#define GONIO_F0                                                                                                       \
    { "f0", 0, 1, 1, "reflectance at normal incidence (Schlick); 1: no Fresnel term" }

// rho_d / pi + rho_s lobe share, of p = {rho_d, rho_s, two shapes}, and its derivatives: d[2] and d[3] hold the lobe's
// own by the shapes. share does not depend on them.
static inline double gonio_diffuse_and_lobe(const double *p, double lobe, double share, double *d) {
    d[0] = 1 / GONIO_PI;
    d[1] = lobe * share;
    d[2] *= p[1] * share;
    d[3] *= p[1] * share;
    return p[0] / GONIO_PI + p[1] * d[1];
}

#endif
