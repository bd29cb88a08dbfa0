// SPDX-License-Identifier: BSD-3-Clause
#include "gonio/coverage.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/head.h"
#include "base/number.h"
#include "base/text.h"

// Of the search for the largest hole: its probes, every so many degrees up to the last; samples beyond the limit are
// thinned out evenly, which can only make holes larger by the distance of neighbours.
static const struct {
    double step_deg, last_deg;
    size_t samples;
    double narrow_deg; // a hole of this size is news
    size_t incidences; // fewer say nothing of how f_r goes with theta_i
} tuning = {10, 80, 5000, 30, 3};

typedef struct key {
    int32_t theta_i, phi_i, theta_o, phi_o; // 0.1 deg
} key;

static int32_t tenths(double rad) { return (int32_t)lround(gonio_degrees(rad) * 10); }

// Of an isotropic set the difference of azimuths alone, of the two mirror images the one from 0 to 180 deg.
static key key_of(const gonio_samples *s, size_t i) {
    const gonio_pair *p = &s->pairs[i];
    double turn = gonio_degrees(p->phi_o - (s->isotropic ? p->phi_i : 0)), light = gonio_degrees(p->phi_i);
    turn -= 360 * floor(turn / 360);
    light -= 360 * floor(light / 360);
    turn = s->isotropic && turn > 180 ? 360 - turn : turn;
    const int32_t o = tenths(p->theta_o), i10 = tenths(p->theta_i);
    return (key){i10, s->isotropic || i10 == 0 ? 0 : (int32_t)lround(light * 10) % 3600, o,
                 o == 0 || (s->isotropic && i10 == 0) ? 0 : (int32_t)lround(turn * 10) % 3600};
}

static int by_key(const void *left, const void *right) { return memcmp(left, right, sizeof(key)); }

static void count(const key *keys, size_t n, gonio_coverage *c) {
    for (size_t i = 0; i < n; i++) {
        const bool first = i == 0;
        c->geometries += first || memcmp(&keys[i], &keys[i - 1], sizeof *keys) != 0;
        c->incidences += first || keys[i].theta_i != keys[i - 1].theta_i || keys[i].phi_i != keys[i - 1].phi_i;
    }
}

static void find_ranges(const gonio_samples *s, gonio_coverage *c) {
    c->theta_i_deg[0] = c->theta_o_deg[0] = 90;
    c->in_plane = true;
    c->horizon_deg = 90;
    for (size_t i = 0; i < s->n; i++) {
        const gonio_pair *p = &s->pairs[i];
        const double ti = gonio_degrees(p->theta_i), to = gonio_degrees(p->theta_o);
        c->theta_i_deg[0] = fmin(c->theta_i_deg[0], ti);
        c->theta_i_deg[1] = fmax(c->theta_i_deg[1], ti);
        c->theta_o_deg[0] = fmin(c->theta_o_deg[0], to);
        c->theta_o_deg[1] = fmax(c->theta_o_deg[1], to);
        // How far the camera leaves the plane of light and normal.
        const double off = sin(p->theta_o) * sin(p->theta_i) * fabs(sin(p->phi_o - p->phi_i));
        c->in_plane = c->in_plane && off < 0.01;
        const gonio_pair raised = gonio_pair_raised(*p);
        c->horizon_deg = fmin(c->horizon_deg, 90 - gonio_degrees(fmax(raised.theta_i, raised.theta_o)));
    }
}

static double angle(gonio_vec3 a, gonio_vec3 b) { return acos(fmin(fmax(a.x * b.x + a.y * b.y + a.z * b.z, -1), 1)); }

typedef struct directions {
    gonio_vec3 wi, wo;
} directions;

static void probe(const directions *all, size_t n, bool isotropic, const gonio_pair *at, gonio_coverage *c) {
    const gonio_vec3 wi = gonio_direction(at->theta_i, at->phi_i), wo = gonio_direction(at->theta_o, at->phi_o);
    const gonio_vec3 mirrored = {wo.x, -wo.y, wo.z};
    double nearest = INFINITY, limit = -2; // the limit is its cosine
    for (size_t i = 0; i < n; i++) {
        if (wi.x * all[i].wi.x + wi.y * all[i].wi.y + wi.z * all[i].wi.z < limit) {
            continue; // the light's angle alone is more
        }
        const double out = isotropic ? fmin(angle(wo, all[i].wo), angle(mirrored, all[i].wo)) : angle(wo, all[i].wo);
        nearest = fmin(nearest, hypot(angle(wi, all[i].wi), out));
        limit = nearest < GONIO_PI ? cos(nearest) - 1e-12 : -2;
    }
    if (gonio_degrees(nearest) > c->hole_deg) {
        c->hole_deg = gonio_degrees(nearest);
        c->hole = *at;
    }
}

// In one half, whose samples are looked at in front of the surface.
static void find_hole_in(const gonio_samples *s, gonio_half half, directions *all, gonio_coverage *c) {
    const size_t step = s->n / tuning.samples + 1;
    const double before = c->hole_deg;
    size_t n = 0;
    for (size_t i = 0; i < s->n; i += step) {
        if (gonio_pair_half(s->pairs[i]) != half) {
            continue;
        }
        const gonio_pair p = gonio_pair_raised(s->pairs[i]);
        const double turn = s->isotropic ? p.phi_i : 0;
        all[n++] = (directions){gonio_direction(p.theta_i, p.phi_i - turn), gonio_direction(p.theta_o, p.phi_o - turn)};
    }
    for (double ti = 0; ti <= tuning.last_deg; ti += tuning.step_deg) {
        for (double to = 0; to <= tuning.last_deg; to += tuning.step_deg) {
            for (double phi = 0; phi <= (to > 0 ? 180 : 0); phi += to > 0 ? fmin(180, tuning.step_deg * 3) : 180) {
                const gonio_pair at = {gonio_radians(ti), 0, gonio_radians(to), gonio_radians(phi)};
                probe(all, n, s->isotropic, &at, c);
            }
        }
    }
    if (c->hole_deg > before) {
        c->hole = gonio_pair_lowered(c->hole, half);
    }
}

static void find_hole(const gonio_samples *s, directions *all, gonio_coverage *c) {
    const unsigned halves = gonio_samples_halves(s);
    for (int h = 0; h < GONIO_HALVES; h++) {
        if (halves >> h & 1) {
            find_hole_in(s, (gonio_half)h, all, c);
        }
    }
}

gonio_status gonio_coverage_of(const gonio_samples *samples, gonio_coverage *coverage, gonio_error *error) {
    *coverage = (gonio_coverage){.samples = samples->n};
    if (samples->n == 0) {
        return GONIO_OK;
    }
    key *keys = malloc(samples->n * sizeof *keys);
    directions *all = malloc((tuning.samples + 1) * sizeof *all);
    gonio_status status = GONIO_OK;
    if (keys == NULL || all == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to describe %zu samples", samples->n);
    } else {
        for (size_t i = 0; i < samples->n; i++) {
            keys[i] = key_of(samples, i);
        }
        qsort(keys, samples->n, sizeof *keys, by_key);
        count(keys, samples->n, coverage);
        find_ranges(samples, coverage);
        find_hole(samples, all, coverage);
        coverage->halves = gonio_samples_halves(samples);
    }
    free(keys);
    free(all);
    return status;
}

bool gonio_coverage_is_narrow(const gonio_coverage *c) {
    return c->samples > 0 && (c->incidences < tuning.incidences || c->in_plane || c->hole_deg > tuning.narrow_deg);
}

// ---- as lines ----

// The figures by name; both ends of a range are two.
static const struct figure {
    const char *name;
    size_t offset;
    enum { COUNT, FLAG, REAL } kind;
} figures[] = {
    {"sampled.samples", offsetof(gonio_coverage, samples), COUNT},
    {"sampled.geometries", offsetof(gonio_coverage, geometries), COUNT},
    {"sampled.incidences", offsetof(gonio_coverage, incidences), COUNT},
    {"sampled.in_plane", offsetof(gonio_coverage, in_plane), FLAG},
    {"sampled.theta_i_min_deg", offsetof(gonio_coverage, theta_i_deg[0]), REAL},
    {"sampled.theta_i_max_deg", offsetof(gonio_coverage, theta_i_deg[1]), REAL},
    {"sampled.theta_o_min_deg", offsetof(gonio_coverage, theta_o_deg[0]), REAL},
    {"sampled.theta_o_max_deg", offsetof(gonio_coverage, theta_o_deg[1]), REAL},
    {"sampled.horizon_deg", offsetof(gonio_coverage, horizon_deg), REAL},
    {"sampled.hole_deg", offsetof(gonio_coverage, hole_deg), REAL},
    {"sampled.hole_theta_i_rad", offsetof(gonio_coverage, hole.theta_i), REAL},
    {"sampled.hole_phi_i_rad", offsetof(gonio_coverage, hole.phi_i), REAL},
    {"sampled.hole_theta_o_rad", offsetof(gonio_coverage, hole.theta_o), REAL},
    {"sampled.hole_phi_o_rad", offsetof(gonio_coverage, hole.phi_o), REAL},
};
enum { FIGURES = sizeof figures / sizeof *figures };
#define HALVES "sampled.halves" // said of more than reflection alone

gonio_status gonio_coverage_put(const gonio_coverage *coverage, char **lines, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (size_t k = 0; k < FIGURES && status == GONIO_OK; k++) {
        const void *at = (const char *)coverage + figures[k].offset;
        char text[32];
        switch (figures[k].kind) {
        case COUNT:
            snprintf(text, sizeof text, "%zu", *(const size_t *)at);
            break;
        case FLAG:
            snprintf(text, sizeof text, "%d", *(const bool *)at);
            break;
        case REAL:
            // What a libm may compute otherwise in its last digits is none of it.
            gonio_number_format(text, sizeof text, "%.9g", *(const double *)at);
        }
        status = gonio_head_add(lines, figures[k].name, text, error);
    }
    if (status == GONIO_OK && coverage->halves > 1u << GONIO_REFLECTION) {
        char text[16];
        snprintf(text, sizeof text, "%u", coverage->halves);
        status = gonio_head_add(lines, HALVES, text, error);
    }
    return status;
}

bool gonio_coverage_take(const char *lines, gonio_coverage *coverage) {
    *coverage = (gonio_coverage){0};
    for (size_t k = 0; k < FIGURES; k++) {
        void *at = (char *)coverage + figures[k].offset;
        char text[64], *end;
        if (!gonio_head_find(lines, figures[k].name, text, sizeof text)) {
            return false;
        }
        const double value = gonio_number_parse(text, &end);
        if (end == text || *end != 0 || !isfinite(value) ||
            (figures[k].kind == COUNT && !(value >= 0 && value < 1e15))) {
            return false;
        }
        switch (figures[k].kind) {
        case COUNT:
            *(size_t *)at = (size_t)value;
            break;
        case FLAG:
            *(bool *)at = value != 0;
            break;
        case REAL:
            *(double *)at = value;
        }
    }
    char text[64];
    coverage->halves = gonio_head_find(lines, HALVES, text, sizeof text) ? (unsigned)strtoul(text, NULL, 10) & 15u
                                                                         : 1u << GONIO_REFLECTION;
    return true;
}

// ---- in words ----

static void put_range(char *text, size_t size, const char *name, const double range[2]) {
    if (range[1] - range[0] < 0.05) {
        gonio_text_append(text, size, "%s %.4g deg", name, range[0]);
    } else {
        gonio_text_append(text, size, "%s %.4g to %.4g deg", name, range[0], range[1]);
    }
}

void gonio_coverage_range_text(const gonio_coverage *c, char *text, size_t size) {
    text[0] = 0;
    put_range(text, size, "theta_i", c->theta_i_deg);
    gonio_text_append(text, size, ", ");
    put_range(text, size, "theta_o", c->theta_o_deg);
    gonio_text_append(text, size, ", %zu incidence%s%s", c->incidences, c->incidences == 1 ? "" : "s",
                      c->in_plane ? ", in its plane alone" : "");
}

void gonio_coverage_text(const gonio_coverage *c, char *text, size_t size) {
    text[0] = 0;
    gonio_text_append(text, size, "%zu geometries", c->geometries);
    if (c->geometries < c->samples) {
        gonio_text_append(text, size, " (%zu rows repeat one)", c->samples - c->geometries);
    }
    gonio_text_append(text, size, " of %zu incidence%s, ", c->incidences, c->incidences == 1 ? "" : "s");
    put_range(text, size, "theta_i", c->theta_i_deg);
    gonio_text_append(text, size, ", ");
    put_range(text, size, "theta_o", c->theta_o_deg);
    const char *between = " in ";
    for (int h = 0; h < GONIO_HALVES && c->halves > 1; h++) {
        if (c->halves >> h & 1) {
            gonio_text_append(text, size, "%s%s", between, gonio_half_name((gonio_half)h));
            between = " and ";
        }
    }
    gonio_text_append(text, size, "%s; nothing nearer than %.3g deg to the horizon",
                      c->in_plane ? ", in the plane of incidence alone" : "", c->horizon_deg);
    if (c->hole_deg > tuning.narrow_deg) {
        gonio_text_append(text, size, "; the largest hole reaches %.0f deg about %.0f,%.0f,%.0f,%.0f", c->hole_deg,
                          gonio_degrees(c->hole.theta_i), gonio_degrees(c->hole.phi_i), gonio_degrees(c->hole.theta_o),
                          gonio_degrees(c->hole.phi_o));
    }
}
