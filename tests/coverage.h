// SPDX-License-Identifier: BSD-3-Clause
// Is sigma honest? Errors over sigma pooled over seeds, in theta bands (the larger of the two thetas), lobe and base
// apart. An honest sigma has 90 to 99 % within 2 sigma and a median |error|/sigma of 0.5 to 0.85 in each cell.
#ifndef TESTS_COVERAGE_H
#define TESTS_COVERAGE_H

#include "base/random.h"
#include "tests/sim_scan.h"

#define COVERAGE_BANDS 4
static const double coverage_edges_deg[COVERAGE_BANDS + 1] = {0, 30, 60, 75, 85};

typedef struct coverage_cell {
    double *pull; // |error| / sigma
    size_t n, capacity;
} coverage_cell;

typedef struct coverage {
    coverage_cell cell[2][COVERAGE_BANDS]; // base, lobe
} coverage;

static inline void coverage_add(coverage *c, int lobe, int band, double pull) {
    coverage_cell *cell = &c->cell[lobe][band];
    if (cell->n == cell->capacity) {
        cell->capacity = cell->capacity > 0 ? 2 * cell->capacity : 256;
        cell->pull = realloc(cell->pull, cell->capacity * sizeof *cell->pull);
    }
    cell->pull[cell->n++] = pull;
}

static inline int coverage_band(const gonio_pair *p) {
    const double deg = gonio_degrees(fmax(p->theta_i, p->theta_o));
    for (int band = 0; band < COVERAGE_BANDS; band++) {
        if (deg < coverage_edges_deg[band + 1]) {
            return band;
        }
    }
    return -1;
}

// Base or lobe: does the value exceed `diffuse` by more than 10 %?
static inline int coverage_lobe(const gonio_model *truth, const gonio_pair *p, double diffuse) {
    return gonio_model_eval_channel(truth, gonio_direction(p->theta_i, p->phi_i), gonio_direction(p->theta_o, p->phi_o),
                                    0) > 1.1 * diffuse;
}

static inline void coverage_count(coverage *c, const gonio_samples *samples, const gonio_model *truth, double diffuse) {
    for (size_t i = 0; i < samples->n; i++) {
        double f[3];
        const int band = coverage_band(&samples->pairs[i]), lobe = coverage_lobe(truth, &samples->pairs[i], diffuse);
        gonio_model_eval_pair(truth, &samples->pairs[i], f);
        for (int k = 0; k < samples->channels && band >= 0; k++) {
            const double error = samples->values[i * (size_t)samples->channels + (size_t)k] - f[k];
            coverage_add(c, lobe, band, fabs(error) / gonio_samples_sigma(samples, i, k));
        }
    }
}

static inline double coverage_uniform(uint64_t *state) { return gonio_random_next(state); }

// A random pose of the given cell, uniform in Nusselt coordinates there, all angles free. Lobes are sought about the
// mirror direction. Angles are whole microdegrees, as a plan's are.
static inline gonio_pair coverage_pose(uint64_t *state, const gonio_model *truth, double diffuse, int lobe, int band) {
    const double most = sin(gonio_radians(coverage_edges_deg[band + 1]));
    for (int attempt = 0;; attempt++) {
        gonio_pair p;
        p.theta_i = asin(most * sqrt(coverage_uniform(state)));
        p.phi_i = GONIO_PI * (2 * coverage_uniform(state) - 1);
        p.theta_o = asin(most * sqrt(coverage_uniform(state)));
        p.phi_o = GONIO_PI * (2 * coverage_uniform(state) - 1);
        if (lobe) {
            const double spread = 0.5;
            const gonio_vec3 m = gonio_direction(p.theta_i, p.phi_i + GONIO_PI);
            const double x = m.x + spread * (coverage_uniform(state) - 0.5);
            const double y = m.y + spread * (coverage_uniform(state) - 0.5);
            if (hypot(x, y) >= most) {
                continue;
            }
            p.theta_o = asin(hypot(x, y));
            p.phi_o = atan2(y, x);
        }
        double *angles[4] = {&p.theta_i, &p.phi_i, &p.theta_o, &p.phi_o};
        for (int k = 0; k < 4; k++) {
            *angles[k] = gonio_radians(round(gonio_degrees(*angles[k]) * 1e6) / 1e6);
        }
        // Some cells do not exist: a broad lobe leaves no base at grazing angles. Then any pose of the band will do.
        const bool same = coverage_lobe(truth, &p, diffuse) == lobe || attempt > 20000;
        if (coverage_band(&p) == band && same) {
            return p;
        }
    }
}

static inline int coverage_by_value(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static inline double coverage_within(const coverage_cell *cell, double sigmas) {
    size_t n = 0;
    for (size_t i = 0; i < cell->n; i++) {
        n += cell->pull[i] <= sigmas;
    }
    return cell->n > 0 ? (double)n / (double)cell->n : NAN;
}

static inline double coverage_median(coverage_cell *cell) {
    qsort(cell->pull, cell->n, sizeof *cell->pull, coverage_by_value);
    return cell->n > 0 ? cell->pull[cell->n / 2] : NAN;
}

static inline double coverage_rms(const coverage_cell *cell) {
    double sum = 0;
    for (size_t i = 0; i < cell->n; i++) {
        sum += cell->pull[i] * cell->pull[i];
    }
    return cell->n > 0 ? sqrt(sum / (double)cell->n) : NAN;
}

static inline void coverage_free(coverage *c) {
    for (int lobe = 0; lobe < 2; lobe++) {
        for (int band = 0; band < COVERAGE_BANDS; band++) {
            free(c->cell[lobe][band].pull);
        }
    }
}

// Measure `each` poses of every cell of a flat plate for one seed, add the pointing term with the slopes of `slopes`
// (NULL: of the truth) and count. drift: let two hours pass and measure the reference again at the end.
static inline bool coverage_plate(coverage *c, const char *spec, double diffuse, uint64_t seed, int each,
                                  const char *const *settings, int side, bool drift, const gonio_model *slopes) {
    sim_scan scan;
    gonio_samples *samples = NULL;
    bool ok = scan_open(&scan, spec, seed, settings, side) && scan_prepare(&scan) &&
              gonio_samples_new(gonio_calib_channels(scan.calib), true, &samples, &scan.error) == GONIO_OK;
    const gonio_model *truth = ok ? gonio_sim_truth(scan.sim) : NULL;
    uint64_t state = seed * 7919;
    double clock[1024];
    for (int i = 0; ok && i < each * 2 * COVERAGE_BANDS; i++) {
        const gonio_pair pose = coverage_pose(&state, truth, diffuse, i % 2, i / 2 % COVERAGE_BANDS);
        clock[samples->n] = scan.stamp.clock_s;
        ok = scan_pose(&scan, &pose, samples);
        if (drift) {
            scan.stamp.clock_s += 3600.0 / (each * COVERAGE_BANDS); // two hours a scan
        }
    }
    if (ok && drift) {
        ok = scan_reference(&scan) &&
             scan_ok(&scan, gonio_calib_drift(scan.calib, clock, samples, NULL, &scan.error), "drift");
    }
    if (ok) {
        ok =
            scan_ok(&scan, gonio_calib_pointing(&scan.rig.facts, slopes != NULL ? slopes : truth, samples, &scan.error),
                    "pointing");
        coverage_count(c, samples, truth, diffuse);
    }
    gonio_samples_free(samples);
    scan_close(&scan);
    return ok;
}

#endif
