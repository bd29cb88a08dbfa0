// SPDX-License-Identifier: BSD-3-Clause
// A model's values at given pairs, as a sample set.
#include <string.h>

#include "base/head.h"
#include "base/thread_pool.h"
#include "gonio/io.h"
#include "gonio/plan.h"

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

// What was known of the measurement goes on; how the model was fitted, and to what, is no word about these samples.
static gonio_status take_head(const char *about, char **head, gonio_error *error) {
    char key[GONIO_HEAD_KEY_MAX], value[4096];
    gonio_status status = GONIO_OK;
    for (const char *at = about; status == GONIO_OK && gonio_head_next(&at, key, value, sizeof value);) {
        const bool own = strncmp(key, "sampled.", 8) == 0 || strcmp(key, "fit") == 0 || strcmp(key, "train") == 0 ||
                         strcmp(key, "held_out") == 0;
        status = own ? GONIO_OK : gonio_head_add(head, key, value, error);
    }
    const bool tell = status == GONIO_OK && *head != NULL && !gonio_head_find(*head, "origin", value, sizeof value);
    return tell ? gonio_head_add(head, "origin", "values of a model that was fitted to the measurement", error)
                : status;
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
    status = take_head(model->about, &s->head, error);
    if (status != GONIO_OK) {
        gonio_samples_free(s);
        return status;
    }
    s->isotropic = model->isotropic;
    s->transmission = gonio_pairs_transmit(pairs, n);
    memcpy(s->channel_names, model->channel_names, (size_t)model->channels * sizeof *s->channel_names);
    memcpy(s->pairs, pairs, n * sizeof *pairs);
    s->n = n;
    gonio_pool_for(threads, (n + BLOCK - 1) / BLOCK, fill_block, &(job){model, s});
    *out = s;
    return GONIO_OK;
}
