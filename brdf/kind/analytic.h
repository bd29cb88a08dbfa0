// Analytic BRDFs: the lobe formulae, and a model that sums them with one parameter vector (docs/fitting.md).
//
// A kind is a formula and a table of named, bounded parameters; a term is a kind with values for every channel; a model
// is a sum of terms. The formulae take a gonio_lobe_geometry, so a fitter that varies only the parameters computes the
// geometry once a sample.
//
// Grazing. Ward's, Cook-Torrance's and Oren-Nayar's formulae divide by cosines that reach 0 at the horizon. Every
// cosine is raised to GONIO_LOBE_COSINE_MIN (89.99994 deg) first: below that angle nothing changes, beyond it the value
// of that angle holds, so every value is finite.
#ifndef GONIO_BRDF_KIND_ANALYTIC_H
#define GONIO_BRDF_KIND_ANALYTIC_H

#include "gonio/model.h"

#define GONIO_LOBE_COSINE_MIN 1e-6
#define GONIO_ANALYTIC_PARAMETERS_MAX 8
#define GONIO_ANALYTIC_TERMS_MAX 8

// What the formulae need of a pair of unit vectors.
typedef struct gonio_lobe_geometry {
    gonio_vec3 wi, wo;   // cosines (z) raised to the minimum
    gonio_vec3 h;        // unit half vector
    double cos_d;        // h . wi = h . wo
    double tan_x, tan_y; // h.x/h.z and h.y/h.z: slopes of the facet that mirrors wi into wo
    double tan2;         // their squares' sum, tan^2(theta_h)
} gonio_lobe_geometry;

gonio_lobe_geometry gonio_lobe_geometry_of(gonio_vec3 wi, gonio_vec3 wo);

// The lobes, 1/sr, of unit strength (no albedo).
// Ward 1992 as in Kameya 2002 eq. 3.3: exp(-tan^2/alpha^2) / (4 pi alpha^2 sqrt(cos_i cos_o)); elliptical for
// alpha_x != alpha_y.
double gonio_lobe_ward(const gonio_lobe_geometry *g, double alpha_x, double alpha_y);
// (n+2)(n+4) / (8 pi (n + 2^(-n/2))) cos^n(theta_h): the factor makes the albedo at normal incidence exactly 1.
double gonio_lobe_blinn_phong(const gonio_lobe_geometry *g, double n);
// Cook & Torrance 1982: D G F / (4 cos_i cos_o), Beckmann's D of slope m, their min() form of G, Schlick's F(f0).
double gonio_lobe_cook_torrance(const gonio_lobe_geometry *g, double m, double f0);
// Walter et al. 2007: D G F / (4 cos_i cos_o), GGX D (elliptical: Heitz 2014), Smith's G as the product of two G1.
double gonio_lobe_ggx(const gonio_lobe_geometry *g, double alpha_x, double alpha_y, double f0);
// Oren & Nayar 1994, the qualitative model (their eq. 30), without rho/pi; sigma is the facets' slope angle.
double gonio_lobe_oren_nayar(const gonio_lobe_geometry *g, double sigma_rad);

typedef struct gonio_analytic_parameter {
    const char *name;
    double minimum, maximum;
    double initial; // used where a spec leaves it out; NaN: it must be given
    const char *text;
} gonio_analytic_parameter;

// Another spelling of one or two parameters: value * scale goes to parameters first..last.
typedef struct gonio_analytic_alias {
    const char *name;
    int first, last;
    double scale;
} gonio_analytic_alias;

typedef struct gonio_analytic_kind {
    const char *name;
    int n; // parameters
    gonio_analytic_parameter parameters[GONIO_ANALYTIC_PARAMETERS_MAX];
    gonio_analytic_alias alias; // name NULL: none
    // f_r (1/sr) for parameters p[n] of one channel.
    double (*value)(const gonio_lobe_geometry *g, const double *p);
    bool (*isotropic)(const double *p); // NULL: always
} gonio_analytic_kind;

// The kinds, ended by a NULL pointer; static storage.
const gonio_analytic_kind *const *gonio_analytic_kinds(void);
const gonio_analytic_kind *gonio_analytic_kind_find(const char *name); // NULL: no such kind

typedef struct gonio_analytic_term {
    const gonio_analytic_kind *kind;
    const double *parameters; // [channels][kind->n]
} gonio_analytic_term;

// The sum of 1 to GONIO_ANALYTIC_TERMS_MAX terms; everything is copied. names (may be NULL: "value", or r g b for
// three channels, or c1, c2 ...). GONIO_E_RANGE where a parameter is outside its bounds. The caller frees the model.
gonio_status gonio_analytic_new(const gonio_analytic_term *terms, int n_terms, int channels, const char (*names)[32],
                                gonio_model **out, gonio_error *error);
// The model's terms, borrowed from it; 0 and NULL for a model of another kind.
int gonio_analytic_terms(const gonio_model *model, const gonio_analytic_term **terms);
// All parameters as one vector, term by term, channel by channel; change them only while nobody evaluates. Borrowed.
double *gonio_analytic_parameters(gonio_model *model, size_t *count);

#endif
