// SPDX-License-Identifier: BSD-3-Clause
// What both solvers' uncertainties share: the channels' factors, the places where a law is asked, and the coarse spline
// of ln sigma that the model carries. It lies in half-vector coordinates, where lobes of any width are wide.
#include "fit/sigma/field.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/statistics.h"
#include "fit/prior/places.h"
#include "fit/sigma/beyond.h"
#include "fit/sigma/tuning.h"
#include "fit/smooth/cg.h"

#define SIGMA_LEVEL_3D 4
#define SIGMA_LEVEL_4D 2
#define PROBES 1600
#define HORIZON 0.01F // the cosine at which lobes are held in any case: they divide by it

// A channel's spread: the standard deviation of a normal with the same median |residual|.
void gonio_sigma_factors(size_t n, size_t c, const double *residuals, double *factor, double *work) {
    for (size_t k = 0; k < c; k++) {
        double squares = 0;
        for (size_t i = 0; i < n; i++) {
            work[i] = fabs(residuals[i * c + k]);
            squares += work[i] * work[i];
        }
        // A median of 0 (clamped zeros) is no spread.
        factor[k] = fmax(gonio_upper_median(work, n) / GONIO_MEDIAN_OF_NORMAL,
                         fmax(0.05 * sqrt(squares / (double)n), GONIO_SIGMA_EXACT));
    }
}

// Variance of the samples' noise, mean over channels in their factors' units; -1 where they do not tell it.
double gonio_sample_noise_variance(const gonio_dataset *data, const double *factor) {
    double sum = 0;
    for (int k = 0; k < data->channels; k++) {
        const double noise = data->noise[k] / factor[k];
        sum += noise * noise / data->channels;
    }
    return sum > 0 ? sum : -1;
}

// Beyond the samples' angles the lobes are held at the values that they have there (brdf/kind/lobe_spline.h). Nobody
// knows whether the material follows the lobes instead, or goes twice as far: the mean square of a step uniform from
// none to twice the lobes' own is 4/3 of its square, but materials of the lobes' own family go just that step, and as
// the median of a normal error that is 2.2 of its square. What is taken lies between. Added to the variance, mean over
// channels.
double gonio_sigma_held_back(const gonio_dataset *data, const gonio_lobe_base *held, const double *factor,
                             const gonio_pair *pair) {
    if (held == NULL || held->lobes == 0) {
        return 0;
    }
    const gonio_vec3 wi = gonio_direction(pair->theta_i, pair->phi_i), wo = gonio_direction(pair->theta_o, pair->phi_o);
    gonio_lobe_base free = *held;
    free.cosine_min = HORIZON;
    double units[2][1 + GONIO_LOBES_MAX], sum = 0;
    gonio_lobe_base_units(held, wi, wo, units[0]);
    gonio_lobe_base_units(&free, wi, wo, units[1]);
    for (int k = 0; k < data->channels; k++) {
        const double *strength = held->strength + (ptrdiff_t)k * (1 + GONIO_LOBES_MAX);
        const double step = gonio_lobe_base_transformed(&free, strength, units[1], data->kind, &data->transforms[k]) -
                            gonio_lobe_base_transformed(held, strength, units[0], data->kind, &data->transforms[k]);
        sum += gonio_sigma_tuned.held_back * step * step / (factor[k] * factor[k]) / data->channels;
    }
    return sum;
}

gonio_status gonio_sigma_probes(gonio_dataset *probes, const gonio_dataset *data, gonio_error *error) {
    gonio_samples *samples;
    gonio_status status = gonio_samples_new(1, false, &samples, error);
    if (status != GONIO_OK) {
        return status;
    }
    samples->isotropic = data->dims == 3;
    const double none = 1;
    for (size_t i = 0; i < PROBES && status == GONIO_OK; i++) {
        const gonio_pair pair = gonio_prior_place(i, samples->isotropic, GONIO_PI / 2);
        status = gonio_samples_add(samples, &pair, &none, NULL, NULL, error);
    }
    if (status == GONIO_OK) {
        const gonio_dataset_options how = {.mirror = data->mirror, .domain = GONIO_LINEAR};
        status = gonio_dataset_init(probes, samples, &how, error);
    }
    if (status == GONIO_OK) {
        memset(probes->values, 0, probes->n * sizeof *probes->values);
    }
    gonio_samples_free(samples);
    return status;
}

// A lattice through targets at the solver's probes.
static gonio_status fit_lattice(gonio_smooth_cg *cg, const gonio_dataset *probes, const double *targets, int level,
                                double tolerance, gonio_lattice *lattice, gonio_error *error) {
    gonio_smooth_cg_report unused;
    gonio_status status = gonio_lattice_init(lattice, probes->dims, level, 1, error);
    if (status != GONIO_OK) {
        return status;
    }
    double mean = 0, *points = malloc((lattice->count + probes->n) * sizeof *points);
    if (points == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    } else {
        double *rest = points + lattice->count;
        for (size_t i = 0; i < probes->n; i++) {
            mean += targets[i] / (double)probes->n;
        }
        for (size_t i = 0; i < probes->n; i++) {
            rest[i] = targets[i] - mean;
        }
        status = gonio_smooth_cg_cascade(cg, rest, 1, gonio_sigma_tuned.lambda, 200, tolerance, points, &unused, error);
    }
    for (size_t i = 0; i < lattice->count && status == GONIO_OK; i++) {
        lattice->points[i] = (float)(points[i] + mean);
    }
    free(points);
    if (status != GONIO_OK) {
        gonio_lattice_release(lattice);
    }
    return status;
}

static gonio_status fit_lattices(const gonio_dataset *probes, const double *support, gonio_lobe_spline_parts *parts,
                                 gonio_error *error) {
    const gonio_smooth_form form = gonio_smooth_form_default(
        GONIO_HALF_VECTOR, probes->dims == 3 ? SIGMA_LEVEL_3D : SIGMA_LEVEL_4D, probes->mirror);
    gonio_smooth_cg *cg;
    gonio_status status = gonio_smooth_cg_new(probes, &form, 1, &cg, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = fit_lattice(cg, probes, probes->targets, form.level, 1e-3, &parts->sigma, error);
    status = status == GONIO_OK ? fit_lattice(cg, probes, support, form.level, 1e-2, &parts->support, error) : status;
    if (status != GONIO_OK) {
        gonio_lattice_release(&parts->sigma);
    }
    gonio_smooth_cg_free(cg);
    return status;
}

gonio_status gonio_sigma_attach(gonio_dataset *probes, gonio_prior *prior, double *factor,
                                gonio_lobe_spline_parts *parts, gonio_error *error) {
    double least = 0, *support = malloc(probes->n * sizeof *support);
    for (int k = 0; k < parts->channels; k++) {
        least += GONIO_SIGMA_EXACT * GONIO_SIGMA_EXACT / (factor[k] * factor[k]) / parts->channels;
    }
    gonio_status status = support != NULL ? gonio_sigma_beyond(prior, parts, factor, probes, support, error)
                                          : gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    for (size_t i = 0; i < probes->n && status == GONIO_OK; i++) {
        probes->targets[i] = 0.5 * log(fmax(probes->targets[i], least));
    }
    status = status == GONIO_OK ? fit_lattices(probes, support, parts, error) : status;
    free(support);
    if (status == GONIO_OK) {
        parts->sigma_factor = factor;
        parts->sigma_half_vector = true;
    }
    return status;
}
