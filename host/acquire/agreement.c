// SPDX-License-Identifier: BSD-3-Clause
// Rounding or change: what a replay makes of a session beside what the measure journalled.
//
// On another kind of processor, or with another C library, the mathematical functions round their last bit otherwise.
// The bounds below are what that may come to. Each is far below what the sample's own uncertainty could notice, and a
// choice that falls otherwise (another method, other exposures, another sample left out) is far above.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/acquire/acquire.h"

// A direction is some ten functions of angles, each good to 2^-52: 1e-15 rad, and at grazing angles the arc sine takes
// the root of that away.
#define ANGLE_BOUND_RAD 1e-7
// A value is a mean over pixels of products and quotients, times a reference's: a few hundred roundings, 1e-13, and the
// subtraction of dark and stray light costs up to four digits of what is as dark as its own noise. Then the mean over
// the averaged disc is corrected, by some 1e-3, with the curvature of a fit, for which what is said of sigma holds.
#define VALUE_BOUND 1e-7
// sigma holds the slope of a fit. Its smoothing is where leave-one-out errors are least, and the place of a minimum is
// known to the root of its value's rounding, 1e-8; the lattice is float, 6e-8, and a slope is a difference of neighbours
// that agree in two to three digits.
#define SIGMA_BOUND 1e-4
// The model, in shares of the sample's own sigma beside the float lattice's rounding of ln f, 2^-24 a unit.
#define MODEL_BOUND 1e-3
#define MODEL_FLOAT 1e-5

static double widest(double a, double b) { return b > a || isnan(b) ? (isnan(b) ? INFINITY : b) : a; }

static double angle_between(double a, double b) { return fabs(remainder(a - b, 2 * GONIO_PI)); }

static void add_pair(gonio_agreement *all, const gonio_pair *a, const gonio_pair *b) {
    const double by[4] = {angle_between(a->theta_i, b->theta_i), angle_between(a->phi_i, b->phi_i),
                          angle_between(a->theta_o, b->theta_o), angle_between(a->phi_o, b->phi_o)};
    for (int k = 0; k < 4; k++) {
        all->angle = widest(all->angle, by[k] / ANGLE_BOUND_RAD);
    }
}

// |a - b| in units of bound, 0 where the bits are the same: of 0 / 0 and of infinities too.
static double share(double a, double b, double bound) {
    return memcmp(&a, &b, sizeof a) == 0 ? 0 : fabs(a - b) / bound;
}

void gonio_agreement_add(gonio_agreement *all, const gonio_samples *a, const gonio_samples *b) {
    if (a == NULL && b == NULL) {
        return;
    }
    if (a == NULL || b == NULL || a->n != b->n || a->channels != b->channels) {
        all->value = INFINITY;
        return;
    }
    for (size_t i = 0; i < a->n; i++) {
        add_pair(all, &a->pairs[i], &b->pairs[i]);
    }
    for (size_t k = 0; k < a->n * (size_t)a->channels; k++) {
        const double sigma = hypot(a->sigma_random[k], a->sigma_systematic[k]);
        all->value = widest(all->value, share(a->values[k], b->values[k], VALUE_BOUND * (fabs(a->values[k]) + sigma)));
        all->sigma = widest(all->sigma, share(a->sigma_random[k], b->sigma_random[k], SIGMA_BOUND * sigma));
        all->sigma = widest(all->sigma, share(a->sigma_systematic[k], b->sigma_systematic[k], SIGMA_BOUND * sigma));
    }
}

static gonio_status add_model(gonio_agreement *all, const gonio_model *journalled, const gonio_outcome *again,
                              gonio_error *error) {
    const gonio_samples *s = again->samples;
    const size_t c = (size_t)s->channels;
    // Other control points are another choice, however near its values come.
    if (journalled->channels != s->channels || again->model->channels != s->channels ||
        journalled->control_points != again->model->control_points || journalled->bytes != again->model->bytes) {
        all->model = INFINITY;
        return GONIO_OK;
    }
    double *values = malloc(2 * c * sizeof *values);
    if (values == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu channels", c);
    }
    for (size_t i = 0; i < s->n; i++) {
        gonio_model_eval_pair(journalled, &s->pairs[i], values);
        gonio_model_eval_pair(again->model, &s->pairs[i], values + c);
        for (size_t k = 0; k < c; k++) {
            const double sigma = hypot(s->sigma_random[i * c + k], s->sigma_systematic[i * c + k]);
            const double bound = MODEL_BOUND * sigma + MODEL_FLOAT * fabs(values[k]);
            all->model = widest(all->model, share(values[k], values[c + k], bound));
        }
    }
    free(values);
    return GONIO_OK;
}

// The journalled model where its file still is what was journalled; NULL: it is not.
static gonio_model *journalled_model(gonio_session *session) {
    char *path = NULL, *wanted = NULL, sha256[GONIO_SHA256_HEX];
    gonio_model *model = NULL;
    if (gonio_session_model_path(session, &path, NULL) == GONIO_OK &&
        gonio_session_get(session, "result.model_sha256", &wanted, NULL) == GONIO_OK &&
        gonio_sha256_file(path, sha256, NULL) == GONIO_OK && strcmp(wanted, sha256) == 0 &&
        gonio_model_open(path, &model, NULL) != GONIO_OK) {
        model = NULL;
    }
    free(path);
    free(wanted);
    return model;
}

gonio_status gonio_agreement_finish(gonio_agreement *all, gonio_session *session, const gonio_outcome *again,
                                    gonio_error *error) {
    gonio_samples *samples = NULL;
    bool final = false;
    gonio_status status = gonio_session_final_samples(session, &samples, &final, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_agreement_add(all, samples, again->samples);
    gonio_samples_free(samples);
    char *wanted = NULL;
    status = gonio_session_get(session, "result.model_sha256", &wanted, error);
    if (status == GONIO_OK && strcmp(wanted, again->model_sha256) != 0) {
        gonio_model *model = journalled_model(session);
        if (model == NULL) {
            all->model = INFINITY;
        } else {
            status = add_model(all, model, again, error);
        }
        gonio_model_free(model);
    }
    free(wanted);
    return status;
}

void gonio_agreement_join(gonio_agreement *all, const gonio_agreement *other) {
    all->angle = widest(all->angle, other->angle);
    all->value = widest(all->value, other->value);
    all->sigma = widest(all->sigma, other->sigma);
    all->model = widest(all->model, other->model);
}

double gonio_agreement_largest(const gonio_agreement *all) {
    return fmax(fmax(all->angle, all->value), fmax(all->sigma, all->model));
}

double gonio_agreement_relative(const gonio_agreement *all) { return all->value * VALUE_BOUND; }
