// SPDX-License-Identifier: BSD-3-Clause
// What a sample averages: its disc on the plate, the light's disc, the camera's aperture.
//
// Mean over the disc: every point is divided by its own irradiance (plate.c), so the mean is of f_r alone, each point
// with its own directions. Mean over the light's disc: the radiance is the sum over its points of f_r cos(theta_i), so
// the mean is of that product over the nominal cosine (the distance cancels against the reference, which the same lamp
// lit, to second order). Mean over the aperture: of f_r, rays converge on the sample.
//
// Each mean is taken of the model with two cubatures over the disc (u = r^2 / R^2 is uniform on a disc's area): one of
// degree 5 (two rings at u = 1/2 -+ 1/sqrt(12), Gauss-Legendre in u, six points each), and one of degree 3 (one ring at
// u = 1/2) whose difference from it bounds what higher orders leave over.
//
// A fit of few samples bends as it likes between them, most of all near the pole, where its coordinates turn quickly
// and the BRDF does not. What a model knows of the curvature it can be asked twice: by Helmholtz' reciprocity
// f_r(wi, wo) = f_r(wo, wi), so the same means with light and camera exchanged come from another place of the fit. Both
// answers count alike; what they disagree by is the correction's uncertainty. A fit that is reciprocal by construction
// says the same twice, so its own sigma counts too: it tells how well the fit knows the place, and a curvature is known
// worse.
//
// Transmission is looked at in front of the sample, as its model is (gonio_model_half). Its exchange holds for sheets
// with two like faces alone; for others the answers disagree, and less is corrected.
#include <math.h>
#include <stdlib.h>

#include "base/order_statistic.h"
#include "base/statistics.h"
#include "base/vector.h"
#include "calib/internal.h"

#define RING 6

typedef struct disc {
    gonio_vec3 a, b; // half axes, mm
} disc;

static gonio_vec3 moved(gonio_vec3 from, const disc *d, double x, double y) {
    return (gonio_vec3){from.x + x * d->a.x + y * d->b.x, from.y + x * d->a.y + y * d->b.y,
                        from.z + x * d->a.z + y * d->b.z};
}

static gonio_vec3 toward(gonio_vec3 from, gonio_vec3 to) {
    const gonio_vec3 d = difference(to, from);
    const double length = sqrt(dot(d, d));
    return (gonio_vec3){d.x / length, d.y / length, d.z / length};
}

typedef enum averaged { REGION, LIGHT, APERTURE } averaged;

// A mean of the model: of what, where, and whether the model is asked with light and camera exchanged.
typedef struct probe {
    const geometry *g;
    const gonio_model *model;
    int channel;
    averaged what;
    disc d;
    bool exchanged;
} probe;

static double evaluate(const probe *p, gonio_vec3 wi, gonio_vec3 wo) {
    wi.z = fmax(wi.z, 0);
    wo.z = fmax(wo.z, 0);
    return gonio_model_eval_channel(p->model, p->exchanged ? wo : wi, p->exchanged ? wi : wo, p->channel);
}

// The model with one of the three moved to (x, y) of its disc.
static double at(const probe *p, double x, double y) {
    const geometry *g = p->g;
    const gonio_vec3 origin = {0, 0, 0};
    const gonio_vec3 point = p->what == REGION ? moved(origin, &p->d, x, y) : origin;
    const gonio_vec3 wi = toward(point, p->what == LIGHT ? moved(g->light, &p->d, x, y) : g->light);
    const gonio_vec3 wo = toward(point, p->what == APERTURE ? moved(g->camera, &p->d, x, y) : g->camera);
    const double weight = p->what == LIGHT ? fmax(wi.z, 0) / (g->light.z / g->light_distance_mm) : 1;
    return weight * evaluate(p, wi, wo);
}

static double ring(const probe *p, double u, double phase) {
    double sum = 0;
    for (int k = 0; k < RING; k++) {
        const double angle = (k + phase) * 2 * GONIO_PI / RING;
        sum += at(p, sqrt(u) * cos(angle), sqrt(u) * sin(angle));
    }
    return sum / RING;
}

static double fine_mean(const probe *p) {
    return (ring(p, 0.5 - sqrt(1.0 / 12), 0) + ring(p, 0.5 + sqrt(1.0 / 12), 0.5)) / 2;
}

// Chosen for fits of 80 samples beside the mirror direction (tests/unit/test_blur.c), where a curvature that was
// invented is worth as much as a tenth of the fit's own sigma; fits that know a place to 1 % lose 0.3 % of their
// corrections.
#define CURVATURE_WORSE 10

// What a fit's own sigma makes of a bias; 0 where the model is no fit.
static double unsure(const probe *p, double bias, double centre) {
    const gonio_vec3 origin = {0, 0, 0};
    gonio_vec3 wi = toward(origin, p->g->light), wo = toward(origin, p->g->camera);
    double sigma[GONIO_CHANNELS_MAX];
    wi.z = fmax(wi.z, 0);
    wo.z = fmax(wo.z, 0);
    return gonio_model_sigma(p->model, wi, wo, sigma)
               ? fmin(CURVATURE_WORSE * sigma[p->channel] / centre, 1) * fabs(bias) / sqrt(3)
               : 0;
}

// Relative to centre, which is positive; the exchanged value itself may be anything.
static blur_bias mean_over(const probe *p, double centre) {
    probe exchanged = *p;
    exchanged.exchanged = true;
    const double fine = fine_mean(p), higher = fine - ring(p, 0.5, 0);
    const double here = fine - centre, there = fine_mean(&exchanged) - at(&exchanged, 0, 0);
    const double doubt = hypot((here - there) / sqrt(2), unsure(p, here, centre));
    return (blur_bias){(here + there) / 2 / centre, hypot(higher, doubt) / centre};
}

blur_terms gonio_blur_of(const gonio_rig_facts *facts, const gonio_model *whole, int channel, const gonio_pair *actual,
                         double centre) {
    const gonio_model *model = gonio_model_half(whole, gonio_pair_half(*actual));
    const gonio_pair raised = gonio_pair_raised(*actual), *pair = &raised;
    if (model == NULL) {
        return (blur_terms){0};
    }
    const geometry g = gonio_geometry_of_directions(facts, pair);
    const gonio_pair swapped = {pair->theta_o, pair->phi_o, pair->theta_i, pair->phi_i};
    const geometry turned = gonio_geometry_of_directions(facts, &swapped); // its right and up are the light arm's
    blur_terms terms = {0};
    probe p = {.g = &g, .model = model, .channel = channel};
    if (!facts->sphere && facts->region_radius_mm > 0) {
        const double r = facts->region_radius_mm;
        p.d = (disc){{r, 0, 0}, {0, r, 0}};
        p.what = REGION;
        terms.area = mean_over(&p, centre);
    }
    if (facts->light_radius_mm > 0 && g.light.z > 0) {
        p.d = (disc){scaled(turned.right, facts->light_radius_mm), scaled(turned.up, facts->light_radius_mm)};
        p.what = LIGHT;
        terms.light = mean_over(&p, centre);
    }
    if (facts->aperture_radius_mm > 0) {
        p.d = (disc){scaled(g.right, facts->aperture_radius_mm), scaled(g.up, facts->aperture_radius_mm)};
        p.what = APERTURE;
        terms.aperture = mean_over(&p, centre);
    }
    return terms;
}

// A larger bias means that the model is steeper than anything that this disc resolves.
#define CORRECTED_MAX 0.5

// misfit: how far the model lies from the sample itself, relative. Its curvature is trusted no better: a rectangular
// distribution of that half-width (GUM 4.3.7).
//
// So much of the bias is taken out as stands out of its own uncertainty u, 1 - u^2 / bias^2 (the positive-part
// James-Stein estimator, Efron and Morris 1973): nothing where the model cannot tell the bias from none. What is not
// taken out counts whole.
static double correct(const blur_bias *b, double misfit, double *factor) {
    const double u = hypot(b->rest, misfit * b->bias / sqrt(3)), ratio = b->bias != 0 ? u / b->bias : 1;
    const bool vouched = fabs(b->bias) <= CORRECTED_MAX && u < fabs(b->bias);
    const double share = vouched ? 1 - ratio * ratio : 0, kept = (1 - share) * b->bias;
    *factor *= 1 + share * b->bias;
    return u * u + kept * kept;
}

void gonio_blur_correct(const gonio_rig_facts *facts, const gonio_model *model, int channel, const gonio_pair *pair,
                        double centre, double measured, slope_terms *terms) {
    const blur_terms b = gonio_blur_of(facts, model, channel, pair, centre);
    const double expected = centre * (1 + b.area.bias) * (1 + b.light.bias) * (1 + b.aperture.bias);
    const double misfit = fmin(fabs(measured / expected - 1), 1);
    double area = 1, blur = 1;
    terms->area = correct(&b.area, misfit, &area);
    terms->blur = correct(&b.light, misfit, &blur) + correct(&b.aperture, misfit, &blur);
    terms->area_bias = area - 1;
    terms->blur_bias = blur - 1;
    terms->factor /= area * blur;
}

// ---- what a session reports ----

// The bias of this many samples tells the rest; a sphere has hundreds of thousands.
#define REPORTED 5000

static double half_angle(double radius, double distance) { return atan(radius / distance); }

static void report_bias(const gonio_rig_facts *facts, const gonio_model *model, const gonio_samples *samples,
                        gonio_blur *blur) {
    const size_t step = samples->n / REPORTED + 1;
    double *bias = malloc((samples->n / step + 1) * sizeof *bias),
           *taken = malloc((samples->n / step + 1) * sizeof *taken);
    size_t n = 0, untouched = 0;
    for (size_t i = 0; bias != NULL && taken != NULL && i < samples->n; i += step) {
        const gonio_pair *p = &samples->pairs[i];
        const double value = gonio_model_eval_channel(model, gonio_direction(p->theta_i, p->phi_i),
                                                      gonio_direction(p->theta_o, p->phi_o), 0);
        if (value > 0) {
            const blur_terms b = gonio_blur_of(facts, model, 0, p, value);
            bias[n] = fabs((1 + b.area.bias) * (1 + b.light.bias) * (1 + b.aperture.bias) - 1);
            slope_terms terms = {.factor = 1};
            gonio_blur_correct(facts, model, 0, p, value, samples->values[i * (size_t)samples->channels], &terms);
            taken[n] = fabs(1 / terms.factor - 1);
            untouched += bias[n] > 0 && taken[n] == 0;
            n++;
        }
    }
    if (n > 0) {
        blur->bias_median = gonio_upper_median(bias, n);
        blur->bias_max = gonio_order_statistic(bias, n, n - 1);
        blur->taken_median = gonio_upper_median(taken, n);
        blur->taken_max = gonio_order_statistic(taken, n, n - 1);
        blur->untouched = (double)untouched / (double)n;
    }
    free(bias);
    free(taken);
}

void gonio_calib_blur(const gonio_rig_facts *facts, const gonio_model *model, const gonio_samples *samples,
                      gonio_blur *blur) {
    const double light = half_angle(facts->light_radius_mm, facts->light_distance_mm);
    const double aperture = half_angle(facts->aperture_radius_mm, facts->camera_distance_mm);
    const double nearest = fmin(facts->light_distance_mm, facts->camera_distance_mm);
    *blur = (gonio_blur){.light_deg = gonio_degrees(light),
                         .aperture_deg = gonio_degrees(aperture),
                         .region_deg = facts->sphere ? 0 : gonio_degrees(half_angle(facts->region_radius_mm, nearest)),
                         .light_sr = 2 * GONIO_PI * (1 - cos(light)),
                         .aperture_sr = 2 * GONIO_PI * (1 - cos(aperture))};
    if (model != NULL && samples != NULL) {
        report_bias(facts, model, samples, blur);
    }
}
