// SPDX-License-Identifier: BSD-3-Clause
// Any bytes as a model file, aligned or not: refused, or evaluated without harm. The checksum would turn every mutation
// away, so this build does not compare it.
#include <math.h>

#include <stdlib.h>

#include "gonio/model.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    gonio_model *model;
    gonio_error error = {0};
    if (gonio_model_open_memory(data, size, &model, &error) != GONIO_OK) {
        if (model != NULL || error.message[0] == 0) {
            abort();
        }
        return 0;
    }
    double values[1024], gradient[4];
    float narrow[1024];
    for (int k = 0; k < 20; k++) {
        const gonio_pair pair = {0.08 * k, k, 1.57 - 0.07 * k, 2 * k};
        const gonio_vec3 wi = gonio_direction(pair.theta_i, pair.phi_i), wo = gonio_direction(pair.theta_o, pair.phi_o);
        gonio_model_eval(model, wi, wo, values);
        gonio_model_eval_f32(model, wi, wo, narrow);
        gonio_model_eval_many(model, 1, &wi, &wo, values);
        gonio_model_eval_channel(model, wi, wo, k % model->channels);
        gonio_model_gradient(model, &pair, k % model->channels, gradient);
        gonio_model_sigma(model, wi, wo, values);
    }
    gonio_model_free(model);
    return 0;
}
