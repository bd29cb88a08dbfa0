// SPDX-License-Identifier: BSD-3-Clause
// Lobe-splines of every make, from random parts, and what libm and the plain sums say of them.
#ifndef GONIO_TESTS_LOBE_MODELS_H
#define GONIO_TESTS_LOBE_MODELS_H

#include <stdlib.h>
#include <string.h>

#include "brdf/kind/lobe_spline.h"
#include "brdf/spline/profile.h"
#include "tests/simulate.h"

typedef struct lobe_make {
    int channels, dims, lobes;
    gonio_coordinates coordinates;
    gonio_transform_kind kind;
    gonio_lobe_family family;
    bool lattice, terms, range, grazing; // terms: shares and, where there can be one, a profile
    double rough;                        // size of the control points
} lobe_make;

static inline void *lobe_allocated(size_t n, size_t size) {
    void *p = calloc(n, size);
    if (p == NULL) {
        abort();
    }
    return p;
}

static inline double lobe_between(uint64_t *seed, double low, double high) {
    return low + (high - low) * simulate_uniform(seed);
}

static inline void lobe_random_lattice(gonio_lattice *l, int dims, int level, const lobe_make *make, uint64_t *seed) {
    gonio_error error = {0};
    if (gonio_lattice_init(l, dims, level, make->channels, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    for (size_t k = 0; k < l->count * (size_t)make->channels; k++) {
        l->points[k] = (float)lobe_between(seed, -make->rough, make->rough);
    }
}

static inline void lobe_random_channels(gonio_lobe_spline_parts *p, const lobe_make *make, uint64_t *seed) {
    for (int c = 0; c < make->channels; c++) {
        p->transforms[c] = (gonio_transform){ldexp(1, (int)lobe_between(seed, -3, 4)), exp(lobe_between(seed, -9, -2))};
        for (int j = 0; j < 3; j++) {
            if (make->lobes > 0) {
                p->base.strength[3 * c + j] = p->transforms[c].scale * exp(lobe_between(seed, -9, -1));
            }
            if (p->shares != NULL) {
                p->shares[3 * c + j] = lobe_between(seed, -0.5, 0.5);
            }
        }
        if (make->range) {
            p->range[2 * c] = lobe_between(seed, -3, -0.4);
            p->range[2 * c + 1] = lobe_between(seed, 0.4, 2);
        }
    }
}

static inline gonio_model *lobe_random_model(const lobe_make *make, uint64_t *seed) {
    static char names[64][32];
    const size_t c = (size_t)make->channels;
    gonio_lobe_spline_parts p = {.channels = make->channels,
                                 .dims = make->dims,
                                 .coordinates = make->coordinates,
                                 .kind = make->kind,
                                 .channel_names = (const char(*)[32])names};
    const bool profile =
        make->terms && make->lattice && make->dims == 3 && gonio_coordinates_are_half_vector(make->coordinates);
    gonio_error error = {0};
    gonio_model *model;
    p.transforms = lobe_allocated(c, sizeof *p.transforms);
    p.base = (gonio_lobe_base){.lobes = make->lobes,
                               .family = make->family,
                               .alpha = {lobe_between(seed, 0.05, 0.3), lobe_between(seed, 0.2, 0.7)},
                               .f0 = {0.05, 0.4},
                               .cosine_min = 0.08F,
                               .grazing = make->grazing ? 0.4F : 0};
    p.base.strength = lobe_allocated(3 * c, sizeof *p.base.strength);
    p.range = make->range ? lobe_allocated(2 * c, sizeof *p.range) : NULL;
    p.shares = make->terms && make->lobes > 0 ? lobe_allocated(3 * c, sizeof *p.shares) : NULL;
    lobe_random_channels(&p, make, seed);
    if (make->lattice) {
        lobe_random_lattice(&p.lattice, make->dims, make->dims == 3 ? 3 : 2, make, seed);
    }
    if (profile) {
        lobe_random_lattice(&p.profile, 2, 3, make, seed);
    }
    lobe_make one = *make;
    one.channels = 1;
    lobe_random_lattice(&p.sigma, make->dims, 1, &one, seed);
    p.sigma_factor = lobe_allocated(c, sizeof *p.sigma_factor);
    for (size_t k = 0; k < c; k++) {
        p.sigma_factor[k] = 0.05;
    }
    if (gonio_lobe_spline_new(&p, &model, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    return model;
}

// Every make of a list of channel counts: f is called with each model.
static inline void lobe_for_each_model(void (*f)(const lobe_make *make, const gonio_model *model)) {
    static const int channels[] = {1, 3, 2, 31, 5, 8, 40};
    uint64_t seed = 1;
    for (int k = 0; k < 210; k++) {
        const int lobes = k % 3;
        const lobe_make make = {.channels = channels[k % 7],
                                .dims = k % 2 == 0 ? 3 : 4,
                                .lobes = lobes,
                                .coordinates = (gonio_coordinates)(k / 3 % GONIO_COORDINATES),
                                .kind = k % 4 == 3 ? (gonio_transform_kind)(k / 4 % 2 * 2) : GONIO_TRANSFORM_POSITIVE,
                                .family = (gonio_lobe_family)(k / 6 % 2),
                                .lattice = lobes == 0 || k % 11 != 0,
                                .terms = k % 5 < 3,
                                .range = k % 4 < 2,
                                .grazing = lobes == 0 && k % 4 != 3 && k % 5 > 1,
                                .rough = k % 13 == 0 ? 80 : 0.7};
        gonio_model *model = lobe_random_model(&make, &seed);
        f(&make, model);
        gonio_model_free(model);
    }
}

// Pairs from everywhere: normal incidence, grazing, near the mirror direction, and beyond the samples of the base.
static inline gonio_pair lobe_random_pair(int k, uint64_t *seed) {
    gonio_pair p = {lobe_between(seed, 0, GONIO_PI / 2), lobe_between(seed, -3, 3), lobe_between(seed, 0, GONIO_PI / 2),
                    lobe_between(seed, -3, 3)};
    switch (k % 8) {
    case 0:
        p.theta_i = lobe_between(seed, 0, 1e-3);
        break;
    case 1:
        p.theta_o = lobe_between(seed, 1.5, GONIO_PI / 2);
        break;
    case 2:
        p.theta_o = p.theta_i + lobe_between(seed, 0, 0.01) * (p.theta_i < 1 ? 1 : -1);
        p.phi_o = p.phi_i + GONIO_PI + lobe_between(seed, -0.01, 0.01);
        break;
    case 3: // retro-reflection, where the azimuth about the half vector is rounding alone
        p.theta_o = k % 16 == 3 ? p.theta_i : p.theta_o;
        p.phi_o = k % 16 == 3 ? p.phi_i : p.phi_o;
        break;
    default:
        break;
    }
    return p;
}

static inline double lobe_plain_value(const gonio_lobe_spline_parts *p, gonio_vec3 wi, gonio_vec3 wo, int channel) {
    double units[1 + GONIO_LOBES_MAX], x[4] = {0}, mean[1 + GONIO_LOBES_MAX], share[1 + GONIO_LOBES_MAX], t = 0;
    gonio_lobe_base_units(&p->base, wi, wo, units);
    (p->dims == 3 ? gonio_coordinates_isotropic : gonio_coordinates_anisotropic)(p->coordinates, wi, wo, x);
    if (p->lattice.points != NULL) {
        t = gonio_lattice_eval_channel(&p->lattice, x, channel);
    }
    if (p->profile.points != NULL) {
        double y[2];
        gonio_profile_locate(p->coordinates, x, y);
        t += gonio_lattice_eval_channel(&p->profile, y, channel);
    }
    if (p->shares != NULL) {
        gonio_lobe_mean_strengths(&p->base, p->channels, mean);
        gonio_lobe_shares(&p->base, mean, units, share);
        for (int j = 0; j <= p->base.lobes; j++) {
            t += p->shares[3 * channel + j] * share[j];
        }
    }
    t += p->base.lobes == 0 ? units[0] : 0;
    t = p->range != NULL ? fmin(fmax(t, p->range[2 * channel]), p->range[2 * channel + 1]) : t;
    const gonio_transform *transform = &p->transforms[channel];
    if (p->base.lobes > 0) {
        const double base =
            gonio_lobe_base_transformed(&p->base, p->base.strength + 3 * channel, units, p->kind, transform);
        t = fmin(base + t, fmax(base, gonio_transform_apply(p->kind, transform, transform->scale)));
    }
    return gonio_transform_invert(p->kind, transform, t);
}

#endif
