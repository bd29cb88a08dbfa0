// A model's values at given pairs, as a sample set.
#include <stdlib.h>
#include <string.h>

#include "gonio/io.h"

gonio_status gonio_samples_of_model(const gonio_model *model, const gonio_pair *pairs, size_t n, gonio_samples **out,
                                    gonio_error *error) {
    *out = NULL;
    const bool sigma = model->ops->sigma != NULL;
    gonio_samples *s;
    gonio_status status = gonio_samples_new(model->channels, sigma, &s, error);
    if (status == GONIO_OK) {
        status = gonio_samples_reserve(s, n, error);
    }
    if (status != GONIO_OK) {
        gonio_samples_free(s);
        return status;
    }
    s->isotropic = model->isotropic;
    const size_t c = (size_t)model->channels;
    memcpy(s->channel_names, model->channel_names, c * sizeof *s->channel_names);
    memcpy(s->pairs, pairs, n * sizeof *pairs);
    s->n = n;
#pragma omp parallel for schedule(static, 256)
    for (size_t i = 0; i < n; i++) {
        const gonio_vec3 wi = gonio_direction(pairs[i].theta_i, pairs[i].phi_i);
        const gonio_vec3 wo = gonio_direction(pairs[i].theta_o, pairs[i].phi_o);
        gonio_model_eval(model, wi, wo, s->values + i * c);
        if (sigma) {
            memset(s->sigma_random + i * c, 0, c * sizeof(double));
            gonio_model_sigma(model, wi, wo, s->sigma_systematic + i * c);
        }
    }
    *out = s;
    return GONIO_OK;
}
