// SPDX-License-Identifier: BSD-3-Clause
// The cost of an evaluation: of a model with the same lattice, all zeros, since the time does not depend on its values.
#include "fit/eval_cost.h"

#include "fit/deadline.h"
#include "fit/smooth/loo.h"

#define RUNS 7
#define DIRECTIONS 64
#define RUN_NS 3e5 // of a run; timers are good to 50 ns

// Cosines of the golden ratio's sequence: spread evenly, and the same every time.
static void fill_directions(gonio_vec3 *wi, gonio_vec3 *wo) {
    for (int i = 0; i < DIRECTIONS; i++) {
        const double a = fmod(0.6180339887498949 * i, 1), b = fmod(0.7548776662466927 * i, 1);
        wi[i] = gonio_direction(acos(1 - 0.9 * a), 0);
        wo[i] = gonio_direction(acos(1 - 0.9 * b), 2 * GONIO_PI * fmod(0.5698402909980532 * i, 1));
    }
}

static double run_ns(const gonio_model *model, const gonio_vec3 *wi, const gonio_vec3 *wo, int rounds) {
    double values[GONIO_CHANNELS_MAX];
    const double start = gonio_clock_s();
    for (int r = 0; r < rounds; r++) {
        for (int i = 0; i < DIRECTIONS; i++) {
            gonio_model_eval(model, wi[i], wo[i], values);
        }
    }
    return 1e9 * (gonio_clock_s() - start);
}

static double least_ns(const gonio_model *model) {
    gonio_vec3 wi[DIRECTIONS], wo[DIRECTIONS];
    fill_directions(wi, wo);
    run_ns(model, wi, wo, 1); // into the caches
    const int rounds = (int)fmin(fmax(ceil(RUN_NS / (run_ns(model, wi, wo, 1) + 1)), 1), 1000);
    double least = INFINITY;
    for (int k = 0; k < RUNS; k++) {
        least = fmin(least, run_ns(model, wi, wo, rounds) / rounds / DIRECTIONS);
    }
    return least;
}

gonio_status gonio_eval_cost_ns(const gonio_dataset *data, const gonio_smooth_form *form, const gonio_lobe_base *lobes,
                                double *ns, gonio_error *error) {
    static const char names[GONIO_CHANNELS_MAX][32];
    gonio_lobe_spline_parts parts;
    gonio_status status = gonio_smooth_parts_init(&parts, data, lobes, form->coordinates, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_model *model = NULL;
    status = gonio_lattice_init(&parts.lattice, data->dims, form->level, data->channels, error);
    if (status == GONIO_OK && form->profile > 0) {
        status = gonio_lattice_init(&parts.profile, 2, form->profile_level, data->channels, error);
    }
    if (status == GONIO_OK) {
        parts.channel_names = names;
        status = gonio_lobe_spline_new(&parts, &model, error);
    }
    if (status == GONIO_OK) {
        *ns = least_ns(model);
    }
    gonio_model_free(model);
    gonio_lobe_spline_parts_release(&parts);
    return status;
}
