// SPDX-License-Identifier: BSD-3-Clause
// The part of Burley 2012 ("Disney") and OpenPBR that product viewers use: base colour, metallic, specular, roughness,
// anisotropic. With alpha = roughness^2, b the base colour of the channel, h = 0.08 specular (0.5: 4 %), w = (1 -
// cos_d)^5:
//   (1 - metallic) b / pi B(cos_i) B(cos_o) + D G (c + (1 - c) w), c = (1 - metallic) h + metallic b,
//   B(v) = 1 + (2 cos_d^2 roughness - 1/2)(1 - v)^5,
// D and G those of GGX (ggx.c) with slopes alpha / a and alpha a, a = sqrt(1 - 0.9 anisotropic); an anisotropic below 0
// is one above it turned by 90 deg. Sheen, clear coat, transmission and subsurface scattering are left out. b is
// linear, but the white gloss of a dielectric stays where it is 0: the formula is absolute, of data in 1/sr.
#include "brdf/analytic/formula.h"
#include "brdf/dual.h"

enum { BASE, METALLIC, SPECULAR, ROUGHNESS, ANISOTROPIC, COUNT };

typedef gonio_dual dual;

// f_r = white + base colour: their derivatives are by metallic, specular, roughness and anisotropic.
typedef struct parts {
    dual white, colour;
} parts;

static dual bend(dual rise, double cosine) {
    return gonio_dual_shift(gonio_dual_scale(rise, gonio_fresnel_grazing(cosine)), 1);
}

static dual microfacets(const gonio_lobe_geometry *g, dual roughness, dual anisotropic) {
    const double turned = anisotropic.v < 0 ? -1 : 1;
    const dual alpha = gonio_dual_square(roughness);
    const dual aspect = gonio_dual_sqrt(gonio_dual_shift(gonio_dual_scale(anisotropic, -0.9 * turned), 1));
    const dual wide = gonio_dual_div(alpha, aspect), narrow = gonio_dual_mul(alpha, aspect);
    const dual x = turned > 0 ? wide : narrow, y = turned > 0 ? narrow : wide;
    double d[3];
    const double lobe = gonio_lobe_ggx_slope(g, x.v, y.v, 1, d);
    return gonio_dual_join(x, y, lobe, d[0], d[1]);
}

static parts parts_of(const gonio_lobe_geometry *g, const double *p) {
    const dual metallic = gonio_dual_variable(p[METALLIC], 0), specular = gonio_dual_variable(p[SPECULAR], 1);
    const dual roughness = gonio_dual_variable(p[ROUGHNESS], 2), anisotropic = gonio_dual_variable(p[ANISOTROPIC], 3);
    const dual dielectric = gonio_dual_shift(gonio_dual_scale(metallic, -1), 1);
    const dual rise = gonio_dual_shift(gonio_dual_scale(roughness, 2 * g->cos_d * g->cos_d), -0.5);
    const dual diffuse = gonio_dual_mul(dielectric, gonio_dual_mul(bend(rise, g->wi.z), bend(rise, g->wo.z)));
    const double grazing = gonio_fresnel_grazing(g->cos_d);
    const dual lobe = microfacets(g, roughness, anisotropic);
    const dual gloss = gonio_dual_scale(gonio_dual_mul(dielectric, specular), 0.08 * (1 - grazing));
    return (parts){gonio_dual_mul(lobe, gonio_dual_shift(gloss, grazing)),
                   gonio_dual_add(gonio_dual_scale(diffuse, 1 / GONIO_PI),
                                  gonio_dual_mul(lobe, gonio_dual_scale(metallic, 1 - grazing)))};
}

static double value(const gonio_lobe_geometry *g, const double *p) {
    const parts f = parts_of(g, p);
    return f.white.v + p[BASE] * f.colour.v;
}

static double slope(const gonio_lobe_geometry *g, const double *p, double *d) {
    const parts f = parts_of(g, p);
    d[BASE] = f.colour.v;
    for (int k = 0; k < 4; k++) {
        d[METALLIC + k] = f.white.d[k] + p[BASE] * f.colour.d[k];
    }
    return f.white.v + p[BASE] * f.colour.v;
}

static bool isotropic(const double *p) { return p[ANISOTROPIC] == 0; }

const gonio_formula gonio_formula_principled = {
    .name = "principled",
    .summary = "base colour, metallic, specular, roughness, anisotropic",
    .source = "Burley, Physically based shading at Disney (2012); OpenPBR surface 1.1 (2024)",
    .n = COUNT,
    .parameters = {{"base", 0, 1, NAN, "base colour"},
                   {"metallic", 0, 1, 0, "0 a dielectric, 1 a metal"},
                   {"specular", 0, 1, 0.5, "reflectance at normal incidence, 0.08 times it"},
                   {"roughness", 0.01, 1, NAN, "root of the slope"},
                   {"anisotropic", -1, 1, 0, "stretch of the lobe along x, below 0 along y"}},
    .value = value,
    .slope = slope,
    .linear = GONIO_LINEAR(BASE),
    .absolute = true,
    .isotropic = isotropic,
};
