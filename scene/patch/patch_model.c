// SPDX-License-Identifier: BSD-3-Clause
// The rig looks at a sample through thousands of pixels whose directions hardly differ, so few corners of the grid are
// needed for a pose; a degree is what lamp and lens blur anyway.
#include "scene/patch/patch_model.h"

#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "scene/patch/patch.h"

#define STEPS 1                  // of the grid a degree
#define RAYS 1024                // of a corner: about half a per cent
#define THETA_STEPS (89 * STEPS) // corners stay where the horizon does not hide everything
#define PHI_STEPS (360 * STEPS)
#define SLOTS_MIN ((size_t)1 << 12)

// A corner that is known: its directions as steps of the grid, and where its values stand.
typedef struct slot {
    uint64_t key; // 0: free
    size_t at;
} slot;

typedef struct patch_model {
    gonio_model head;
    gonio_patch *patch;
    pthread_mutex_t mutex;
    slot *slots;
    size_t slot_count, known;
    double *values; // of the known corners
    size_t room;
} patch_model;

static uint64_t key_of(const int steps[4]) {
    return 1 + ((uint64_t)steps[0] << 48 | (uint64_t)steps[1] << 32 | (uint64_t)steps[2] << 16 | (uint64_t)steps[3]);
}

static slot *find(const patch_model *m, uint64_t key) {
    size_t k = (size_t)(key * 0x9e3779b97f4a7c15u >> 20) & (m->slot_count - 1);
    while (m->slots[k].key != 0 && m->slots[k].key != key) {
        k = (k + 1) & (m->slot_count - 1);
    }
    return &m->slots[k];
}

static bool grow(patch_model *m) {
    const size_t channels = (size_t)m->head.channels;
    if (m->known == m->room) {
        double *values = realloc(m->values, 2 * (m->room + 64) * channels * sizeof *values);
        if (values == NULL) {
            return false;
        }
        m->values = values;
        m->room = 2 * (m->room + 64);
    }
    if (2 * m->known >= m->slot_count) {
        patch_model larger = *m;
        larger.slot_count = 2 * m->slot_count;
        larger.slots = calloc(larger.slot_count, sizeof *larger.slots);
        if (larger.slots == NULL) {
            return false;
        }
        for (size_t k = 0; k < m->slot_count; k++) {
            if (m->slots[k].key != 0) {
                *find(&larger, m->slots[k].key) = m->slots[k];
            }
        }
        free(m->slots);
        m->slots = larger.slots;
        m->slot_count = larger.slot_count;
    }
    return true;
}

static bool trace_corner(const patch_model *m, const int steps[4], double *values) {
    gonio_virtual_options o;
    gonio_samples *samples;
    gonio_pair pose = {gonio_radians((double)steps[0] / STEPS), gonio_radians((double)steps[1] / STEPS),
                       gonio_radians((double)steps[2] / STEPS), gonio_radians((double)steps[3] / STEPS)};
    gonio_virtual_options_default(&o);
    o.threads = 1;
    o.interreflection = true;
    o.rays = o.rays_max = RAYS;
    if (gonio_virtual_measure(m->patch, &(gonio_plan){1, &pose}, &o, &samples, NULL, NULL) != GONIO_OK) {
        return false;
    }
    memcpy(values, samples->values, (size_t)m->head.channels * sizeof *values);
    gonio_samples_free(samples);
    return true;
}

// The values of a corner, NaN where there is no memory for them.
static void corner(patch_model *m, const int steps[4], double *values) {
    const size_t channels = (size_t)m->head.channels;
    const uint64_t key = key_of(steps);
    pthread_mutex_lock(&m->mutex);
    const slot *known = find(m, key);
    if (known->key == 0 && grow(m) && trace_corner(m, steps, m->values + m->known * channels)) {
        *find(m, key) = (slot){key, m->known};
        m->known++;
    }
    known = find(m, key);
    for (size_t c = 0; c < channels; c++) {
        values[c] = known->key != 0 ? m->values[known->at * channels + c] : NAN;
    }
    pthread_mutex_unlock(&m->mutex);
}

// A direction's place on the grid: the corner below, and how far it is to the next one.
static void locate(gonio_vec3 w, int step[2], double rest[2]) {
    const double theta = gonio_direction_theta(w) * 180 / GONIO_PI * STEPS;
    const double phi = gonio_direction_phi(w) * 180 / GONIO_PI * STEPS, around = phi < 0 ? phi + PHI_STEPS : phi;
    step[0] = (int)fmin(theta, THETA_STEPS - 1);
    rest[0] = fmin(theta - step[0], 1);
    step[1] = (int)around;
    rest[1] = around - step[1];
}

static void patch_eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    patch_model *m = (patch_model *)model; // what it knows grows; what it answers does not change
    int step[4];
    double rest[4], part[m->head.channels];
    locate(wi, step, rest);
    locate(wo, step + 2, rest + 2);
    memset(values, 0, (size_t)m->head.channels * sizeof *values);
    for (int k = 0; k < 16; k++) {
        int steps[4];
        double weight = 1;
        for (int j = 0; j < 4; j++) {
            const int up = k >> j & 1;
            steps[j] = step[j] + up;
            weight *= up != 0 ? rest[j] : 1 - rest[j];
        }
        steps[1] = steps[0] == 0 ? 0 : steps[1] % PHI_STEPS;
        steps[3] = steps[2] == 0 ? 0 : steps[3] % PHI_STEPS;
        if (weight > 0) {
            corner(m, steps, part);
            for (int c = 0; c < m->head.channels; c++) {
                values[c] += weight * part[c];
            }
        }
    }
}

static void patch_free(gonio_model *model) {
    patch_model *m = (patch_model *)model;
    pthread_mutex_destroy(&m->mutex);
    gonio_patch_free(m->patch);
    free(m->slots);
    free(m->values);
    free(m);
}

static const gonio_model_ops patch_ops = {.kind = "patch", .eval = patch_eval, .free = patch_free};

gonio_status gonio_patch_model_new(const char *text, gonio_model **out, gonio_error *error) {
    *out = NULL;
    gonio_patch *patch;
    const gonio_status status = gonio_patch_open(text, &patch, error);
    if (status != GONIO_OK) {
        return status;
    }
    patch_model *m = calloc(1, sizeof *m);
    slot *slots = calloc(SLOTS_MIN, sizeof *slots);
    if (m == NULL || slots == NULL) {
        free(m);
        free(slots);
        gonio_patch_free(patch);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a patch");
    }
    m->head = (gonio_model){
        .ops = &patch_ops, .channels = patch->channels, .channel_names = patch->channel_names, .isotropic = false};
    m->patch = patch;
    m->slots = slots;
    m->slot_count = SLOTS_MIN;
    pthread_mutex_init(&m->mutex, NULL);
    *out = &m->head;
    return GONIO_OK;
}
