// SPDX-License-Identifier: BSD-3-Clause
// A model's values at given pairs, as a sample set.
#include <string.h>

#include "base/thread_pool.h"
#include "gonio/io.h"

#define BLOCK 256

typedef struct job {
    const gonio_model *model;
    gonio_samples *samples;
} job;

static void fill_block(void *context, size_t block) {
    const job *j = context;
    gonio_samples *s = j->samples;
    const size_t c = (size_t)s->channels, begin = block * BLOCK, end = s->n - begin < BLOCK ? s->n : begin + BLOCK;
    for (size_t i = begin; i < end; i++) {
        const gonio_pair *p = &s->pairs[i];
        const gonio_vec3 wi = gonio_direction(p->theta_i, p->phi_i), wo = gonio_direction(p->theta_o, p->phi_o);
        gonio_model_eval(j->model, wi, wo, s->values + i * c);
        if (s->sigma_random != NULL) {
            memset(s->sigma_random + i * c, 0, c * sizeof(double));
            gonio_model_sigma(j->model, wi, wo, s->sigma_systematic + i * c);
        }
    }
}

gonio_status gonio_samples_of_model(const gonio_model *model, const gonio_pair *pairs, size_t n, int threads,
                                    gonio_samples **out, gonio_error *error) {
    *out = NULL;
    gonio_samples *s;
    gonio_status status = gonio_samples_new(model->channels, model->ops->sigma != NULL, &s, error);
    status = status == GONIO_OK ? gonio_samples_reserve(s, n, error) : status;
    if (status != GONIO_OK) {
        gonio_samples_free(s);
        return status;
    }
    s->isotropic = model->isotropic;
    memcpy(s->channel_names, model->channel_names, (size_t)model->channels * sizeof *s->channel_names);
    memcpy(s->pairs, pairs, n * sizeof *pairs);
    s->n = n;
    gonio_pool_for(threads, (n + BLOCK - 1) / BLOCK, fill_block, &(job){model, s});
    *out = s;
    return GONIO_OK;
}
