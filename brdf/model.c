// SPDX-License-Identifier: BSD-3-Clause
// The calls on a model that do not depend on its kind: dispatch, and what follows from eval where a kind has nothing
// better.
#include "gonio/model.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "gonio/output.h"
#include "gonio/sample.h"

void gonio_model_free(gonio_model *model) {
    if (model != NULL) {
        free(model->about);
        free(model->sampler);
        model->ops->free(model);
    }
}

gonio_status gonio_model_tell(gonio_model *model, const char *about, gonio_error *error) {
    char *copy = about != NULL ? strdup(about) : NULL;
    if (about != NULL && copy == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for what is known of a model");
    }
    free(model->about);
    model->about = copy;
    return GONIO_OK;
}

gonio_status gonio_model_save(const gonio_model *model, const char *path, gonio_error *error) {
    if (model->ops->save == NULL) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED, "a model of kind '%s' has no file form", model->ops->kind);
    }
    gonio_output *output;
    gonio_status status = gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = model->ops->save(model, gonio_output_stream(output), error);
    if (status != GONIO_OK && !ferror(gonio_output_stream(output))) {
        gonio_output_abandon(output);
        return status;
    }
    return gonio_output_commit(output, error);
}

// Is the model not to be asked for these directions?
static inline bool nothing_at(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo) {
    return gonio_half_of(wi, wo) != GONIO_REFLECTION && !model->ops->both_sides;
}

void gonio_model_eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    if (nothing_at(model, wi, wo)) {
        memset(values, 0, (size_t)model->channels * sizeof *values);
        return;
    }
    model->ops->eval(model, wi, wo, values);
}

void gonio_model_eval_f32(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, float *values) {
    if (nothing_at(model, wi, wo)) {
        memset(values, 0, (size_t)model->channels * sizeof *values);
        return;
    }
    if (model->ops->eval_f32 != NULL) {
        model->ops->eval_f32(model, wi, wo, values);
        return;
    }
    double wide[model->channels];
    model->ops->eval(model, wi, wo, wide);
    for (int c = 0; c < model->channels; c++) {
        values[c] = (float)wide[c];
    }
}

double gonio_model_eval_channel(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, int channel) {
    if (nothing_at(model, wi, wo)) {
        return 0;
    }
    if (model->ops->eval_channel != NULL) {
        return model->ops->eval_channel(model, wi, wo, channel);
    }
    double values[model->channels];
    model->ops->eval(model, wi, wo, values);
    return values[channel];
}

void gonio_model_eval_pair(const gonio_model *model, const gonio_pair *pair, double *values) {
    gonio_model_eval(model, gonio_direction(pair->theta_i, pair->phi_i), gonio_direction(pair->theta_o, pair->phi_o),
                     values);
}

void gonio_model_eval_many(const gonio_model *model, size_t n, const gonio_vec3 *wi, const gonio_vec3 *wo,
                           double *values) {
    size_t asked = 0;
    while (asked < n && !nothing_at(model, wi[asked], wo[asked])) {
        asked++;
    }
    if (model->ops->eval_many != NULL && asked == n) {
        model->ops->eval_many(model, n, wi, wo, values);
        return;
    }
    for (size_t i = 0; i < n; i++) {
        gonio_model_eval(model, wi[i], wo[i], values + i * (size_t)model->channels);
    }
}

// Central differences, one-sided at the edges of the hemisphere. The step balances truncation (h^2) against float32
// lattices' rounding (1e-7/h): about the cube root of 1e-7.
#define GRADIENT_STEP 2e-3

void gonio_model_gradient(const gonio_model *model, const gonio_pair *pair, int channel, double gradient[4]) {
    if (gonio_pair_half(*pair) != GONIO_REFLECTION && !model->ops->both_sides) {
        memset(gradient, 0, 4 * sizeof *gradient);
        return;
    }
    if (model->ops->gradient != NULL) {
        model->ops->gradient(model, pair, channel, gradient);
        return;
    }
    for (int k = 0; k < 4; k++) {
        double low[4] = {pair->theta_i, pair->phi_i, pair->theta_o, pair->phi_o}, high[4];
        memcpy(high, low, sizeof high);
        low[k] -= GRADIENT_STEP;
        high[k] += GRADIENT_STEP;
        if (k % 2 == 0) {
            low[k] = fmax(low[k], 0);
            high[k] = fmin(high[k], GONIO_PI / 2);
        }
        const double a =
            gonio_model_eval_channel(model, gonio_direction(low[0], low[1]), gonio_direction(low[2], low[3]), channel);
        const double b = gonio_model_eval_channel(model, gonio_direction(high[0], high[1]),
                                                  gonio_direction(high[2], high[3]), channel);
        gradient[k] = (b - a) / (high[k] - low[k]);
    }
}

double gonio_model_wavelength_nm(const gonio_model *model, int channel) {
    return gonio_channel_wavelength_nm(model->channel_names[channel]);
}

double gonio_model_support(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo) {
    return model->ops->support != NULL && !nothing_at(model, wi, wo) ? model->ops->support(model, wi, wo) : NAN;
}

bool gonio_model_sigma(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *sigma) {
    if (model->ops->sigma == NULL) {
        return false;
    }
    if (nothing_at(model, wi, wo)) {
        memset(sigma, 0, (size_t)model->channels * sizeof *sigma);
    } else {
        model->ops->sigma(model, wi, wo, sigma);
    }
    return true;
}
